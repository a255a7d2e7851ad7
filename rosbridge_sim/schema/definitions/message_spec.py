"""Message types as tables: the fields, with all that is needed to check, fill and encode them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

import msgspec

from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.dialect import Dialect
from rosbridge_sim.schema.definitions.parse import Definition, Field


class FieldSpec(Record):
    """A field of a message type.

    Attributes:
        definition: the parsed field.
        attribute: its name in the struct: the wire name, unless Python reserves that.
        make: makes the default value.
        zero: the value of `null` as an element of an array; None for nested messages, which have none.
        nested: the nested message type, or None.
        is_single: a single element is accepted instead of an array.
        is_numeral: text is accepted instead of an integer.
    """

    definition: Field
    attribute: str
    make: Callable[[], object]
    zero: object
    nested: MessageSpec | None
    is_single: bool
    is_numeral: bool

    @property
    def has_floats(self) -> bool:
        """True if its value may hold floating-point numbers."""
        return self.definition.type in {"float32", "float64"} if self.nested is None else self.nested.has_floats


class MessageSpec(Record):
    """A message type: its fields and rules.

    Attributes:
        name: `pkg/Type`.
        definition: the parsed definition.
        dialect: of the ROS generation.
        struct_type: the class of its values.
        fields: by wire name, in wire order.
        aliases: accepted name -> wire name.
        is_header: a missing stamp becomes the present time.
        has_floats: a field may hold floating-point numbers, nested messages included.
        finalize: `(value, stamp_ns)`: completes in place a struct that was made with its defaults; None where nothing
            is left to do.
        elsewhere: fields that other releases have -> where, for errors; see `Leniency`.
    """

    name: str
    definition: Definition
    dialect: Dialect
    struct_type: type[msgspec.Struct]
    fields: Mapping[str, FieldSpec]
    aliases: Mapping[str, str]
    is_header: bool
    has_floats: bool
    finalize: Callable[[Any, int], None] | None = None
    elsewhere: Mapping[str, str] = field(default_factory=dict)


def layout_of(spec: MessageSpec) -> list[object]:
    """Return everything that decides a type's byte layout in ROS 2; it is equal in both generations for nearly all.

    Args:
        spec: the type, of either generation.
    """
    layout: list[object] = []
    for field_spec in spec.fields.values():
        one = field_spec.definition
        if spec.name == "std_msgs/Header" and one.name == "seq":
            continue  # ROS 2 has no such field
        layout += [one.array, one.is_bounded, one.type if field_spec.nested is None else layout_of(field_spec.nested)]
    return layout

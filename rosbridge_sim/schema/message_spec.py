"""A message type as tables: its fields with all that is needed to check, fill and encode them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from rosbridge_sim.schema.dialect import Dialect
from rosbridge_sim.schema.parse import Definition, Field

__all__ = ["FieldSpec", "MessageSpec"]


@dataclass(frozen=True, slots=True)
class FieldSpec:
    """A field with all that is needed to fill it.

    Attributes:
        attribute: its name in the struct: the wire name, unless Python cannot have it.
        make: makes the default value.
        zero: what `null` means as an element of an array; None where the type has no such value of its own.
        nested: the nested message, or None.
        is_single: may come as a single element instead of an array.
        is_numeral: may come as text.
    """

    definition: Field
    attribute: str
    make: Callable[[], object]
    zero: object
    nested: MessageSpec | None
    is_single: bool
    is_numeral: bool


@dataclass(frozen=True, slots=True)
class MessageSpec:
    """A message type as `check` sees it.

    Attributes:
        fields: by wire name, in wire order.
        aliases: accepted name -> wire name.
        is_header: its stamp is set to the time of now where none is given.
        finalize: `(value, stamp_ns)`: completes in place a struct that was made with its defaults; None where nothing
            is left to do.
    """

    name: str
    definition: Definition
    dialect: Dialect
    struct_type: type[msgspec.Struct]
    fields: Mapping[str, FieldSpec]
    aliases: Mapping[str, str]
    is_header: bool
    finalize: Callable[[Any, int], None] | None = None

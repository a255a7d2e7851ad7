"""Types as rosapi describes them: for each message its field names, their types and lengths, and an example."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rosbridge_sim.schema.check import Shape

__all__ = ["TypeDef", "typedefs"]


@dataclass(frozen=True, slots=True)
class TypeDef:
    """One message type; the lists but for the constants' are parallel. Field names are those of rosapi/TypeDef.

    Attributes:
        type: `pkg/Type`.
        fieldarraylen: -1 for a single value, 0 for any number, N for exactly N.
        examples: the default as text; `[]` for arrays, `{}` for messages.
        constnames, constvalues: those that the definition has, and no others.
    """

    type: str
    fieldnames: list[str]
    fieldtypes: list[str]
    fieldarraylen: list[int]
    examples: list[str]
    constnames: list[str]
    constvalues: list[str]


def typedefs(shape: Shape) -> list[TypeDef]:
    """A type, then each type within it once, depth first."""
    return list(_walk(shape, set()))


def _walk(shape: Shape, seen: set[str]) -> Iterator[TypeDef]:
    seen.add(shape.name)
    definition = shape.definition
    fields = definition.fields
    yield TypeDef(
        type=shape.name,
        fieldnames=[f.name for f in fields],
        fieldtypes=[f.type for f in fields],
        fieldarraylen=[-1 if f.array is None else 0 if f.is_bounded else f.array for f in fields],
        examples=[_example(shape, f.name) for f in fields],
        constnames=[c.name for c in definition.constants],
        constvalues=[c.text for c in definition.constants],
    )
    for slot in shape.slots.values():
        if slot.shape is not None and slot.shape.name not in seen:
            yield from _walk(slot.shape, seen)


def _example(shape: Shape, name: str) -> str:
    slot = shape.slots[name]
    if slot.field.array is not None:
        return "[]"
    if slot.shape is not None or slot.field.type in shape.dialect.times:
        return "{}"
    return str(slot.make())

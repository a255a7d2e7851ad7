"""Cost of a long JSON body: its elements are counted before they are decoded.

`{}` is two characters, and as an element of a MarkerArray it stands for nine structs and four float32, with 400 bytes
of text for each listener. So the length of a text says little of what it costs. A skeleton of a type has nothing but
its lists of messages; msgspec skips all else without making it, at a gigabyte a second.
"""

from __future__ import annotations

from types import GenericAlias
from typing import Any, Final

import msgspec

from rosbridge_sim.errors import FieldError
from rosbridge_sim.schema.check import Shape

__all__ = ["MAX_COST", "Skeleton"]

MAX_COST: Final = 300_000
"""The most that one message may cost: a struct counts 1, a float32 that must be rounded 2. 5,000 markers with two
points and two colours each cost 185,000; 300,000 take 20 to 60 ms to decode, and as much for each encoding."""

_ROUNDING: Final = 2

_List = tuple[str, int, "_Plan | None"]
"""A list of messages: its field, the cost of one default element, and the lists in each of them."""


class _Plan:
    """The lists of messages of a type, and how they are counted."""

    __slots__ = ("inner", "lists", "struct")

    def __init__(self, shape: Shape) -> None:
        self.lists: list[_List] = []
        self.inner: list[tuple[str, _Plan]] = []
        columns: list[tuple[str, Any, Any]] = []
        names: dict[str, str] = {}
        for i, (wire, slot) in enumerate(shape.slots.items()):
            if slot.shape is None:
                continue
            plan = _Plan(slot.shape)
            is_list = slot.field.array is not None
            if not is_list and not plan.has_lists:
                continue
            attribute = f"f{i}"
            names[attribute] = wire
            if is_list:
                element = plan.struct if plan.has_lists else msgspec.Raw
                columns.append((attribute, GenericAlias(list, (element,)), msgspec.field(default_factory=list)))
                self.lists.append((attribute, _cost_of(slot.shape), plan if plan.has_lists else None))
            else:
                columns.append((attribute, plan.struct | None, None))
                self.inner.append((attribute, plan))
        self.struct: Any = msgspec.defstruct("Skeleton", columns, rename=names, gc=False)

    @property
    def has_lists(self) -> bool:
        """True where there is anything to count."""
        return bool(self.lists or self.inner)

    def cost(self, value: Any) -> int:  # noqa: ANN401 - a struct made above
        """Cost of the elements of all lists."""
        total = 0
        for name, each, plan in self.lists:
            elements = getattr(value, name)
            total += each * len(elements)
            if plan is not None and total <= MAX_COST:
                total += sum(map(plan.cost, elements))
        for name, plan in self.inner:
            inner = getattr(value, name)
            if inner is not None:
                total += plan.cost(inner)
        return total


def _cost_of(shape: Shape) -> int:
    """Cost of a message with nothing but defaults."""
    cost = 1
    for slot in shape.slots.values():
        count = 1 if slot.field.array is None else 0 if slot.field.is_bounded else slot.field.array
        if slot.shape is not None:
            cost += count * _cost_of(slot.shape)
        elif slot.field.type == "float32" and slot.field.array is None:
            cost += _ROUNDING
    return cost


class Skeleton:
    """Counts what the bodies of one type cost."""

    __slots__ = ("_decode", "_plan")

    def __init__(self, shape: Shape) -> None:
        """Made at a type's first long body.

        Args:
            shape: the type.
        """
        self._plan = _Plan(shape)
        self._decode = msgspec.json.Decoder(self._plan.struct).decode

    def check(self, name: str, body: bytes | msgspec.Raw) -> None:
        """Refuse a body that would cost too much.

        Raises:
            FieldError: it would.
            msgspec.DecodeError, UnicodeDecodeError, RecursionError: a list holds something else than messages.
        """
        if not self._plan.has_lists:
            return
        cost = self._plan.cost(self._decode(body))
        if cost > MAX_COST:
            raise FieldError(
                f"{name}: expected lists that stand for at most {MAX_COST:,} messages and float32 in all, but got"
                f" {cost:,} or more"
            )

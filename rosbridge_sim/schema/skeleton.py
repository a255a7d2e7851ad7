"""Cost of a long JSON body: its elements are counted before they are decoded.

`{}` is two characters. As an element of a MarkerArray it stands for nine structs and four float32, with 400 bytes of
text for each listener. So the length of a text says little about its cost. The skeleton of a type has only its lists of
messages; msgspec skips everything else without decoding it, at a gigabyte a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import GenericAlias
from typing import Any, Final

import msgspec

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.definitions.message_spec import MessageSpec

MAX_COST: Final = 300_000
"""The highest cost of one message: a struct counts 1, a float32 that must be rounded 2. 5,000 markers with two points
and two colours each cost 185,000. 300,000 take 20 to 60 ms to decode, and as much for each encoding."""

_ROUNDING: Final = 2

_List = tuple[str, int, "_Plan | None"]
"""A list of messages: its field, the cost of one default element, and the lists in each of them."""


class _Plan:
    """The lists of messages of a type, and how they are counted; a flat plan passes over those in elements."""

    def __init__(self, spec: MessageSpec, *, is_flat: bool = False) -> None:
        self.lists: list[_List] = []
        self.inner: list[tuple[str, _Plan]] = []
        columns: list[tuple[str, Any, Any]] = []
        names: dict[str, str] = {}
        for i, (wire, field_spec) in enumerate(spec.fields.items()):
            if field_spec.nested is None:
                continue
            plan = _Plan(field_spec.nested, is_flat=is_flat)
            is_list = field_spec.definition.array is not None
            if not is_list and not plan.has_lists:
                continue
            attribute = f"f{i}"
            names[attribute] = wire
            if is_list:
                within = plan if plan.has_lists and not is_flat else None
                element = msgspec.Raw if within is None else within.struct_type
                columns.append((attribute, GenericAlias(list, (element,)), msgspec.field(default_factory=list)))
                self.lists.append((attribute, _cost_of(field_spec.nested), within))
            else:
                columns.append((attribute, plan.struct_type | None, None))
                self.inner.append((attribute, plan))
        self.struct_type: Any = msgspec.defstruct("Skeleton", columns, rename=names, gc=False)

    @property
    def is_nested(self) -> bool:
        """True if elements of a list have lists themselves."""
        return any(plan is not None for _, _, plan in self.lists) or any(plan.is_nested for _, plan in self.inner)

    @property
    def has_lists(self) -> bool:
        """True if there is anything to count."""
        return bool(self.lists or self.inner)

    def cost(self, value: Struct) -> int:
        """Return the cost of the elements of all lists."""
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


def _cost_of(spec: MessageSpec) -> int:
    """Return the cost of a message that has only defaults."""
    cost = 1
    for field_spec in spec.fields.values():
        count = 1 if field_spec.definition.array is None else field_spec.definition.count
        if field_spec.nested is not None:
            cost += count * _cost_of(field_spec.nested)
        elif field_spec.definition.type == "float32" and field_spec.definition.array is None:
            cost += _ROUNDING
    return cost


class Skeleton:
    """The cost of the bodies of one type."""

    def __init__(self, spec: MessageSpec) -> None:
        """Prepare the counting."""
        plan = _Plan(spec)
        # The elements alone come first: 150,000 `{}` are too many, and looking into each takes 0.1 s and 25 MB.
        plans = [_Plan(spec, is_flat=True), plan] if plan.is_nested else [plan] if plan.has_lists else []
        self._counts = [(msgspec.json.Decoder(each.struct_type).decode, each.cost) for each in plans]

    def check(self, name: str, body: bytes | msgspec.Raw) -> None:
        """Check that a body does not cost too much.

        Args:
            name: name of the type, for the error text.
            body: a JSON text.

        Raises:
            FieldError: it costs too much.
            msgspec.DecodeError, UnicodeDecodeError, RecursionError: a list holds something else than messages.
        """
        for cost in self.costs(body):
            if cost > MAX_COST:
                raise FieldError(
                    f"{name}: expected lists that stand for at most {MAX_COST:,} messages and float32 in all, but got"
                    f" {cost:,} or more"
                )

    def costs(self, body: bytes | msgspec.Raw) -> Iterator[int]:
        """Yield the cost of the lists of a body, first without the lists in elements, then with them.

        Nothing comes where the type has no lists.

        Raises:
            msgspec.DecodeError, UnicodeDecodeError, RecursionError: as in `check`.
        """
        for decode, cost_of in self._counts:
            yield cost_of(decode(body))

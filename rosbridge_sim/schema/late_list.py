"""Lists of structs that are made only when an encoder asks for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rosbridge_sim.loose_types import Struct


class LateList:
    """A list of structs, given by its length and by a function that makes them at their first use.

    A throttled subscriber, or a subscriber that leaves messages out, costs no struct then. All encoders take it as a
    list. `make` must hold copies of its figures: the world moves on before it is called.

    Args:
        make: returns them; called at most once.
    """

    __slots__ = ("_items", "_length", "_make")

    def __init__(self, length: int, make: Callable[[], list[Any]]) -> None:
        self._length = length
        self._make: Callable[[], list[Any]] | None = make
        self._items: list[Any] = []

    @property
    def items(self) -> list[Any]:
        """The structs."""
        if self._make is not None:
            self._items, self._make = self._make(), None
        return self._items

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[Any]:
        return iter(self.items)

    def __getitem__(self, place: int | slice) -> Struct:
        return self.items[place]

    def __eq__(self, other: object) -> bool:
        return self.items == (other.items if isinstance(other, LateList) else other)

    __hash__ = None  # type: ignore[assignment] # equal to a list, which has none

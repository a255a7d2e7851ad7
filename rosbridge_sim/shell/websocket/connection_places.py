"""Bounded numbers of connections that are no clients yet: the oldest one leaves for a new one.

Refusing the new one instead would let anyone keep out all others with a few idle connections.
"""

from __future__ import annotations

from typing import Protocol

__all__ = ["ConnectionPlaces", "Evictable"]


class Evictable(Protocol):
    """A holder of a place."""

    def evict(self) -> None:
        """Leave at once: another one takes the place. Must not raise."""


class ConnectionPlaces:
    """A bounded number of places, in order of arrival; the oldest one leaves for a new one."""

    def __init__(self, number: int) -> None:
        """All free.

        Args:
            number: of places, 1 at least.
        """
        self._number = number
        self._taken: dict[Evictable, None] = {}

    def __len__(self) -> int:
        """Number of places taken."""
        return len(self._taken)

    def take(self, one: Evictable) -> None:
        """Give a place to one that has none, if need be the place of the oldest."""
        self._taken[one] = None
        if len(self._taken) > self._number:
            oldest = next(iter(self._taken))
            del self._taken[oldest]
            oldest.evict()

    def leave(self, one: Evictable) -> None:
        """Free a place; one that has none is no error."""
        self._taken.pop(one, None)

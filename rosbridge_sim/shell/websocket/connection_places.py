"""A limited number of connections that are not clients yet: the oldest one is closed for a new one.

If the new one were refused, anyone could block all others with a few idle connections.
"""

from __future__ import annotations

from typing import Protocol


class Evictable(Protocol):
    """An owner of a place."""

    def evict(self) -> None:
        """Leave at once, because another connection takes the place. Must not raise."""


class ConnectionPlaces:
    """A limited number of places, in order of arrival; the oldest owner leaves for a new one."""

    def __init__(self, number: int) -> None:
        """Create free places.

        Args:
            number: number of places, at least 1.
        """
        self._number = number
        self._taken: dict[Evictable, None] = {}

    def __len__(self) -> int:
        """Number of places taken."""
        return len(self._taken)

    def take(self, one: Evictable) -> None:
        """Give a place to a connection without one; if all are in use, the oldest owner leaves."""
        self._taken[one] = None
        if len(self._taken) > self._number:
            oldest = next(iter(self._taken))
            del self._taken[oldest]
            oldest.evict()

    def leave(self, one: Evictable) -> None:
        """Free a place; a connection without one is not an error."""
        self._taken.pop(one, None)

"""The smallest of many numbers that come and go, for merged options of subscriptions and advertisements.

The numbers are in a heap, with a count for each. A removed number stays in the heap until it reaches the top, or until
most numbers of the heap are removed ones. So each change takes logarithmic time, however many clients there are.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable

_SPARE = 16
"""Removed numbers that a heap may always keep: rebuilding a small heap is not worthwhile."""


class Smallest:
    """A collection of numbers in which a number may occur several times."""

    __slots__ = ("_counts", "_heap", "_num_there")

    def __init__(self) -> None:
        self._counts: dict[float, int] = {}  # count of each number in the heap; 0 if it was removed
        self._heap: list[float] = []
        self._num_there = 0

    def add(self, number: float) -> None:
        """Add a number."""
        count = self._counts.get(number)
        if count is None:
            heapq.heappush(self._heap, number)
        self._counts[number] = (count or 0) + 1
        self._num_there += not count

    def remove(self, number: float) -> None:
        """Remove a number once; it must be there."""
        self._counts[number] -= 1
        self._num_there -= not self._counts[number]
        if len(self._heap) > 2 * self._num_there + _SPARE:
            self._counts = {number: count for number, count in self._counts.items() if count}
            self._heap = sorted(self._counts)

    def remove_all(self, numbers: Iterable[float]) -> None:
        """Remove each of these numbers once; they must be there."""
        for number in numbers:
            self.remove(number)

    def get(self) -> float | None:
        """Return the smallest number; None if there is none."""
        heap = self._heap
        while heap and not self._counts[heap[0]]:
            del self._counts[heapq.heappop(heap)]
        return heap[0] if heap else None

"""The smallest of many numbers that come and go: what merged subscriptions and advertisements need.

A heap of the different numbers, and how often each is there. A number that has gone stays in the heap until it is on
top, or until most of the heap has gone; so each change costs a logarithm, however many clients choose the numbers.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable

__all__ = ["Smallest"]

_SPARE = 16
"""Gone numbers that a heap may always hold: a small one is not worth making anew."""


class Smallest:
    """A bag of numbers."""

    __slots__ = ("_counts", "_heap", "_num_there")

    def __init__(self) -> None:
        self._counts: dict[float, int] = {}  # of each number in the heap; 0 where it has gone
        self._heap: list[float] = []
        self._num_there = 0

    def add(self, number: float) -> None:
        """Put a number in."""
        count = self._counts.get(number)
        if count is None:
            heapq.heappush(self._heap, number)
        self._counts[number] = (count or 0) + 1
        self._num_there += not count

    def remove(self, number: float) -> None:
        """Take a number out that is there."""
        self._counts[number] -= 1
        self._num_there -= not self._counts[number]
        if len(self._heap) > 2 * self._num_there + _SPARE:
            self._counts = {number: count for number, count in self._counts.items() if count}
            self._heap = sorted(self._counts)

    def remove_all(self, numbers: Iterable[float]) -> None:
        """Take numbers out that are there."""
        for number in numbers:
            self.remove(number)

    def get(self) -> float | None:
        """The smallest number; None where there is none."""
        heap = self._heap
        while heap and not self._counts[heap[0]]:
            del self._counts[heapq.heappop(heap)]
        return heap[0] if heap else None

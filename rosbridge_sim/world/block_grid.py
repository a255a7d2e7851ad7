"""A grid over boxes that never move: which of them can be near to a place, without a look at all of them.

It finds more than what is near and never less; whoever asks measures what it finds.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray, ranges

__all__ = ["REACH", "BlockGrid"]

REACH: Final = 16.0
"""How near a box must be for its being found to be certain [m]: a long lorry, and a bit."""

CELL: Final = 64.0
"""Side of a cell [m]; doubled until a box lies in `CELLS_EACH` of them in the mean, as on a map of very long lines."""

CELLS_EACH: Final = 16

COLUMN: Final = 1 << 32
"""From a cell to its eastern neighbour, in numbers of cells; to its northern one it is 1."""


class BlockGrid:
    """Boxes by the cells that they reach into."""

    __slots__ = ("_block", "_number", "_size")

    def __init__(self, low: FloatArray, high: FloatArray) -> None:
        """Lay boxes down; (b, 2) their corners, east and north [m]."""
        self._size = CELL
        while True:
            first = np.floor((low - REACH) / self._size).astype(np.int64)
            width, height = np.floor((high + REACH) / self._size).astype(np.int64).T - first.T + 1
            if np.sum(width.astype(np.float64) * height) <= CELLS_EACH * (len(low) + 1):
                break
            self._size *= 2.0
        num = width * height
        block = np.arange(len(low)).repeat(num)
        place = ranges(np.zeros_like(num), num)
        number = (first[block, 0] + place // height[block]) * COLUMN + first[block, 1] + place % height[block]
        order = number.argsort(kind="stable")
        self._number, self._block = number[order], block[order]

    def find(self, place: FloatArray) -> tuple[IntArray, IntArray]:
        """Return the boxes that can be within `REACH` of each place.

        Args:
            place: (n, 2) east and north [m].

        Returns:
            (m,) which place, rising; and (m,) the boxes, rising for each place.
        """
        column, line = np.floor(place / self._size).astype(np.int64).T
        number = column * COLUMN + line
        start = self._number.searchsorted(number, side="left")
        count = self._number.searchsorted(number, side="right") - start
        return np.arange(len(place)).repeat(count), self._block[ranges(start, count)]

"""A grid over boxes that never move: it finds those that can be near a place without a look at all of them.

It finds more boxes than are near, and never fewer; the caller measures the distances.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, ranges

REACH: Final = 16.0
"""A box within this distance is certainly found [m]: the length of a long lorry."""

CELL: Final = 64.0
"""Side of a cell [m]. On a map of very long lines it is doubled until a box lies in few enough cells."""

CELLS_EACH: Final = 16
"""Cells that a box lies in at most, in the mean: it bounds the memory of the grid."""

CELL_COLUMN: Final = 1 << 32
"""Key stride: + CELL_COLUMN moves one cell east, + 1 one cell north."""


class BlockGrid:
    """Boxes by the cells that they, enlarged by a reach, lie in."""

    __slots__ = ("_block", "_number", "_size")

    def __init__(self, low: FloatArray, high: FloatArray, reach: float = REACH, cell: float = CELL) -> None:
        """Sort boxes into cells.

        Args:
            low: (b, 2) south-western corners of the boxes, east and north [m].
            high: (b, 2) north-eastern corners [m].
            reach: boxes within this distance of a place are certainly found [m].
            cell: side of a cell [m].
        """
        self._size = cell
        while True:
            first = np.floor((low - reach) / self._size).astype(np.int64)
            width, height = np.floor((high + reach) / self._size).astype(np.int64).T - first.T + 1
            if np.sum(width.astype(np.float64) * height) <= CELLS_EACH * (len(low) + 1):
                break
            self._size *= 2.0
        num = width * height
        block = np.arange(len(low)).repeat(num)
        place = ranges(np.zeros_like(num), num)
        number = (first[block, 0] + place // height[block]) * CELL_COLUMN + first[block, 1] + place % height[block]
        order = number.argsort(kind="stable")
        self._number, self._block = number[order], block[order]

    def find(self, place: FloatArray) -> tuple[IntArray, IntArray]:
        """Return the boxes that can be within the reach of each place.

        Args:
            place: (n, 2) east and north [m].

        Returns:
            (m,) int64, index of the place, rising, and (m,) int64, index of the box, rising for each place.
        """
        cell = np.floor(place / self._size).astype(np.int64)
        number = cell[:, 0] * CELL_COLUMN + cell[:, 1]
        start = self._number.searchsorted(number, side="left")
        count = self._number.searchsorted(number, side="right") - start
        if not np.count_nonzero(count):
            return count[:0], self._block[:0]
        return np.arange(len(place)).repeat(count), self._block[ranges(start, count)]

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

PART: Final = 1 << 15
"""Boxes that are sorted into cells at once."""

CELL_COLUMN: Final = 1 << 32
"""Key stride: + CELL_COLUMN moves one cell east, + 1 one cell north."""


class BlockGrid:
    """Boxes by the cells that they, enlarged by a reach, lie in."""

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
        end = num.cumsum()
        total = int(end[-1]) if len(end) else 0
        block, number = np.empty(total, dtype=np.int64), np.empty(total, dtype=np.int64)
        # In parts: a single call for a large map would keep the interpreter from other threads, and need much memory.
        for begin in range(0, len(low), PART):
            own = num[begin : begin + PART]
            boxes = np.arange(begin, begin + len(own)).repeat(own)
            place, rows = ranges(np.zeros_like(own), own), height[boxes]
            part = slice(int(end[begin] - own[0]), int(end[begin + len(own) - 1]))
            block[part] = boxes
            number[part] = (first[boxes, 0] + place // rows) * CELL_COLUMN + first[boxes, 1] + place % rows
        order = number.argsort(kind="stable")
        self._number = _take_in_parts(number, order)
        del number
        self._block = _take_in_parts(block, order)

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


def _take_in_parts(values: IntArray, order: IntArray) -> IntArray:
    """Return `values[order]`, taken in parts so that other threads run between them."""
    taken = np.empty_like(values)
    for begin in range(0, len(order), 8 * PART):
        part = slice(begin, begin + 8 * PART)
        taken[part] = values[order[part]]
    return taken

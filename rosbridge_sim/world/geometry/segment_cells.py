"""The lanes that can be nearest, known for each small cell of the map: for searches at hundreds of places at once.

A `SegmentSearch` compares each place with the boxes of all blocks, and then with some hundred segments. Of these, only
about ten can be the nearest for any place of a cell of 2 m and any heading within a sector of 22.5 degrees. They are
found when the first place comes into the cell, and kept. The nearest of them is chosen by the same equations, so the
result is that of a `SegmentSearch`, to the bit. The same holds for the lanes around a place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, distinct, ranges, wrap_angle
from rosbridge_sim.world.geometry.segment_search import (
    HEIGHT_COST,
    TURN_COST,
    LaneSegments,
    Near,
    Placed,
    SegmentSearch,
    height_cost,
)

CELL: Final = 2.0
"""Side of a cell [m], about as long as the segments in bends: smaller cells are found more rarely."""

SECTORS: Final = 16
"""Sectors of headings."""

LEVEL: Final = 2.0
"""Height of a cell on a map with hills [m]."""

MAX_CELLS: Final = 1 << 16
"""Cells that are kept, 10 MB; then all are found anew. A vehicle passes 50 of them on 100 m."""

FULL_TURN: Final = 2.0 * math.pi

MAX_AT_ONCE: Final = 256
"""Cells that are found at once: some MB of temporary arrays."""

SQUARE: Final = 4
"""Cells along each side of a square."""

FEW_NEW: Final = 4
"""Up to so many new cells are found with all others of their squares: that takes half as long again, and a vehicle has
a new square four times as seldom as a new cell."""

MAX_COLUMNS: Final = 1 << 12
"""Cells whose segments are kept in columns, for places that come one by one: 4 MB."""

MAX_NUMBER: Final = 1 << 22
MAX_LEVEL: Final = 1 << 9
"""Bounds of the numbers of cells east and north (8,000 km), and of levels (1 km), so that a key has 60 bits."""

FARTHEST: Final = CELL * (MAX_NUMBER - 1)
HIGHEST: Final = LEVEL * (MAX_LEVEL - 1)
"""The same bounds for places and heights [m]."""

_OTHER_BITS: Final = SECTORS * 2 * MAX_LEVEL
"""A key has sector and level below the numbers of the cell."""

AROUND: Final = 4.0
"""The segments of all lanes within this distance of a cell are kept, too [m]: enough for a car, and for the question
whether a place is on a road."""

MAX_POINTS: Final = 1 << 10
"""Places that are looked for at once: far below the bound at which a search leaves some out."""

MORE: Final = 1.0 + 1e-9
"""Factor of bounds, so that rounding loses no segment."""


class SegmentCells(SegmentSearch):
    """A `SegmentSearch` that keeps for each cell what can be nearest.

    Args:
        segments: at least one.
    """

    def __init__(self, segments: LaneSegments, num_lanes: int) -> None:
        super().__init__(segments, num_lanes)
        self._table, self._around = _Table(), _Table()
        self._of_cell: dict[int, _Cell] = {}

    def nearest(self, place: FloatArray, heading: FloatArray | None, height: FloatArray | None = None) -> IntArray:
        """Return the nearest segment for each place; see `SegmentSearch.nearest`."""
        if heading is None or not _has_cell(place, height):
            return super().nearest(place, heading, height)
        keys = _keys_of(place, heading, height)
        owner, segment = self._table.find(keys, lambda new: self._look_at(new, has_height=height is not None))
        return self._choose(place, heading, height, owner, segment)

    def place(self, place: FloatArray, heading: FloatArray | None, height: FloatArray | None = None) -> Placed:
        """Return the nearest segment for each place, and the place on it; see `SegmentSearch.place`."""
        if len(place) != 1 or heading is None or not _has_cell(place, height):
            return super().place(place, heading, height)
        # One ego alone: the same equations in a third of the time, since what a cell has is kept in columns.
        (x, y), (along_x, along_y) = place[0].tolist(), heading[0].tolist()
        # At an edge of sectors `arctan2` may choose the other one; what is kept of a cell is right for both.
        sector = min(int((math.atan2(along_y, along_x) + math.pi) * (SECTORS / FULL_TURN)), SECTORS - 1)
        east, north = math.floor(x / CELL) + MAX_NUMBER, math.floor(y / CELL) + MAX_NUMBER
        level = 0 if height is None else math.floor(height.item() / LEVEL) + MAX_LEVEL
        key = ((east * (2 * MAX_NUMBER) + north) * SECTORS + sector) * (2 * MAX_LEVEL) + level
        cell = self._of_cell.get(key)
        if cell is None:
            if len(self._of_cell) >= MAX_COLUMNS:
                self._of_cell.clear()
            _, segment = self._table.find(
                np.array([key]), lambda new: self._look_at(new, has_height=height is not None)
            )
            cell = self._of_cell[key] = _Cell(self._segments, segment)
        return cell.place(x, y, along_x, along_y, height)

    def within(self, place: FloatArray, radius: FloatArray) -> Near:
        """Return the nearest segment of each lane that is near each place; see `SegmentSearch.within`."""
        if len(place) > MAX_POINTS:
            starts = range(0, len(place), MAX_POINTS)
            found = [self.within(place[i : i + MAX_POINTS], radius[i : i + MAX_POINTS]) for i in starts]
            owners = [start + owner for start, (owner, _, _) in zip(starts, found, strict=True)]
            along, lateral, distance = (np.concatenate(each) for each in zip(*(one[2] for one in found), strict=True))
            return np.concatenate(owners), np.concatenate([one[1] for one in found]), (along, lateral, distance)
        if not (np.abs(place).max() < FARTHEST and radius.max() <= AROUND):
            return super().within(place, radius)
        east, north = np.floor(place / CELL).astype(np.int64).T + MAX_NUMBER
        owner, segment = self._around.find((east * (2 * MAX_NUMBER) + north) * _OTHER_BITS, self._look_around)
        return self._best_of_lanes(place, radius, owner, segment)

    def _look_around(self, keys: IntArray) -> tuple[IntArray, IntArray]:
        """Return the segments within `AROUND` of somewhere in each cell; see `_look_at`."""
        middle = _middles_of(keys)[0]
        reach = np.full(len(keys), (AROUND + math.sqrt(0.5) * CELL) * MORE)
        owner, block = self._blocks_within(middle, reach)
        size = self._size[block]
        owner, segment = owner.repeat(size), ranges(self._first[block], size)
        is_near = self._segments.project(middle.take(owner, axis=0), segment)[2] <= reach[owner]
        return owner[is_near], segment[is_near]

    def _look_at(self, keys: IntArray, *, has_height: bool) -> tuple[IntArray, IntArray]:
        """Return the segments that can be the nearest from somewhere in each cell.

        Args:
            keys: (k,) int64, of the cells.

        Returns:
            (m,) int64, index of the cell, rising, and (m,) int64, the segments of each in rising order.
        """
        middle, heading, height = _middles_of(keys)
        reach = math.sqrt(0.5) * CELL * MORE  # from the middle to a corner
        slack = 2.0 * (TURN_COST + reach) + (2.0 * HEIGHT_COST * LEVEL if has_height else 0.0)
        owner, segment = self._candidates(middle, height if has_height else None, slack)
        segments = self._segments
        along, _, distance = segments.project(middle[owner], segment)
        least, most = np.maximum(distance - reach, 0.0), distance + reach
        turn = np.abs(wrap_angle(segments.angle[segment] - heading[owner]))
        half = math.pi / SECTORS * MORE
        least += TURN_COST * (1.0 - np.cos(np.maximum(turn - half, 0.0)))
        most += TURN_COST * (1.0 - np.cos(np.minimum(turn + half, math.pi)))
        if has_height:
            slope = segments.slope[segment]
            rise = np.abs(segments.height[segment] + along * slope - height[owner])
            more = (0.5 * LEVEL + np.abs(slope) * reach) * MORE  # the foot moves no farther than the place
            least += height_cost(rise - more)
            most += height_cost(rise + more)
        bound = np.minimum.reduceat(most, owner.searchsorted(np.arange(len(keys))))
        can_win = least <= bound[owner] * MORE + 1e-9
        return owner[can_win], segment[can_win]


class _Cell:
    """The segments of one cell, (k,) each.

    Args:
        segments: of all lanes.
        segment: (k,) int64, rising.
    """

    __slots__ = ("_columns", "_height", "_slope", "_used")

    def __init__(self, segments: LaneSegments, segment: IntArray) -> None:
        x, y = segments.start[segment].T.copy()
        along_x, along_y = segments.direction[segment].T.copy()
        self._columns = x, y, along_x, along_y, segments.length[segment]
        self._height, self._slope, self._used = segments.height[segment], segments.slope[segment], segment

    def place(self, x: float, y: float, cos: float, sin: float, height: FloatArray | None) -> Placed:
        """Return the nearest of them for one place and heading, with the equations of `SegmentSearch`; (1,) each."""
        start_x, start_y, along_x, along_y, length = self._columns
        east, north = x - start_x, y - start_y
        full = east * along_x + north * along_y
        lateral = north * along_x - east * along_y
        along = np.minimum(np.maximum(full, 0.0), length)
        distance = np.hypot(full - along, lateral)
        score = distance
        if height is not None:
            score = score + height_cost(np.abs(self._height + along * self._slope - height))
        score = score + TURN_COST * (1.0 - (cos * along_x + sin * along_y))
        best = int(score.argmin())
        chosen = slice(best, best + 1)
        return self._used[chosen], along[chosen], lateral[chosen], distance[chosen]


class _Table:
    """Cells by their keys, each with some segments. It holds `MAX_CELLS` and a few, and then begins anew."""

    def __init__(self) -> None:
        self._forget()

    def find(
        self, keys: IntArray, look_at: Callable[[IntArray], tuple[IntArray, IntArray]]
    ) -> tuple[IntArray, IntArray]:
        """Return the segments of cells.

        Args:
            keys: (n,) int64, of the cells.
            look_at: returns the same for cells that are not in the table; their keys rise.

        Returns:
            (m,) int64, index of the cell, rising, and (m,) int64, the segments of each in rising order.
        """
        cell = self._rows_of(keys)
        is_new = cell < 0
        if np.count_nonzero(is_new):
            if len(self._keys) > MAX_CELLS:
                self._forget()
                is_new[:] = True
            new = distinct(keys[is_new])
            if len(new) <= FEW_NEW:
                new = self._with_neighbours(new)
            self._add(new, look_at)
            cell = self._rows_of(keys)
        count = self._count[cell]
        return np.arange(len(keys)).repeat(count), self._found[ranges(self._start[cell], count)]

    def _forget(self) -> None:
        """Empty the table."""
        self._keys, self._start, self._count, self._found = (np.zeros(0, dtype=np.int64) for _ in range(4))
        self._used = 0

    def _rows_of(self, keys: IntArray) -> IntArray:
        """Return the rows of keys in the table, (n,) int64; -1 for those that are not there."""
        if not len(self._keys):
            return np.full(len(keys), -1, dtype=np.int64)
        at = np.minimum(self._keys.searchsorted(keys), len(self._keys) - 1)
        return np.where(self._keys[at] == keys, at, -1)

    def _with_neighbours(self, keys: IntArray) -> IntArray:
        """Return keys, and those of the other new cells of their squares: a vehicle will come into them."""
        place, other = np.divmod(keys, _OTHER_BITS)
        first = place - place % (2 * MAX_NUMBER) % SQUARE - place // (2 * MAX_NUMBER) % SQUARE * (2 * MAX_NUMBER)
        side = np.arange(SQUARE)
        square = (side[:, None] * (2 * MAX_NUMBER) + side).ravel()
        every = distinct(((first[:, None] + square) * _OTHER_BITS + other[:, None]).ravel())
        return np.asarray(every[self._rows_of(every) < 0])

    def _add(self, keys: IntArray, look_at: Callable[[IntArray], tuple[IntArray, IntArray]]) -> None:
        """Take cells into the table, by their keys (k,), which rise and are not in it."""
        for first in range(0, len(keys), MAX_AT_ONCE):
            part = keys[first : first + MAX_AT_ONCE]
            owner, segment = look_at(part)
            count = np.bincount(owner, minlength=len(part))
            used = self._used + len(segment)
            if used > len(self._found):
                found = np.zeros(2 * used, dtype=np.int64)
                found[: self._used] = self._found[: self._used]
                self._found = found
            self._found[self._used : used] = segment
            at = self._keys.searchsorted(part)
            self._keys = np.insert(self._keys, at, part)
            self._start = np.insert(self._start, at, self._used + np.cumsum(count) - count)
            self._count = np.insert(self._count, at, count)
            self._used = used


def _has_cell(place: FloatArray, height: FloatArray | None) -> bool:
    """Return whether places are within the bounds of the numbers of cells."""
    if len(place) == 1:  # the same in a third of the time
        x, y = place[0].tolist()
        is_near = -FARTHEST < x < FARTHEST and -FARTHEST < y < FARTHEST
        return is_near and (height is None or -HIGHEST < height.item() < HIGHEST)
    is_near = np.abs(place).max() < FARTHEST
    return bool(is_near and (height is None or np.abs(height).max() < HIGHEST))


def _keys_of(place: FloatArray, heading: FloatArray, height: FloatArray | None) -> IntArray:
    """Return the keys of the cells that places are in, (n,) int64; arguments as for `SegmentCells.nearest`."""
    east, north = np.floor(place / CELL).astype(np.int64).T + MAX_NUMBER
    angle = np.arctan2(heading[:, 1], heading[:, 0]) + math.pi
    sector = np.minimum((angle * (SECTORS / FULL_TURN)).astype(np.int64), SECTORS - 1)
    level = 0 if height is None else np.floor(height / LEVEL).astype(np.int64) + MAX_LEVEL  # never 0
    return np.asarray(((east * (2 * MAX_NUMBER) + north) * SECTORS + sector) * (2 * MAX_LEVEL) + level)


def _middles_of(keys: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the middles of cells: (k, 2) places [m], (k,) headings [rad] and (k,) heights [m]."""
    rest, level = np.divmod(keys, 2 * MAX_LEVEL)
    rest, sector = np.divmod(rest, SECTORS)
    east, north = np.divmod(rest, 2 * MAX_NUMBER)
    place = CELL * (np.stack([east, north], axis=1) - MAX_NUMBER + 0.5)
    return place, (sector + 0.5) * (FULL_TURN / SECTORS) - math.pi, LEVEL * (level - MAX_LEVEL + 0.5)

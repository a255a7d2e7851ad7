"""The roads as lanes: which lane is here, how far along it, where it leads.

A lane is a polyline in driving direction. All lanes lie end to end in one set of arrays, so that a question about
many places is a handful of numpy calls. Where a map comes from is not known here.

Arc length and distance are measured in the plane (east, north); the height is only carried along. That is what a
driver's `s` and lateral offset mean, and on a slope of 10 % the difference to the way driven is 0.5 %.

The nearest lane is found exactly. A uniform grid names, for each cell, every segment within `REACH` of any point of
that cell; if the best of them is no farther than `REACH`, none outside the list can beat it. Places farther from
every road than that are compared with all segments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry import FloatArray, IntArray

__all__ = ["Places", "Roads"]

REACH = 10.0
"""How far from a road the grid alone can answer [m]: three lanes, the width of any verge."""

CELL = 20.0
"""Side of a grid cell [m]. A cell's list covers CELL + 2 REACH; smaller cells only repeat more segments."""

TURN_COST = 3.0
"""A lane across the heading counts as this much farther away [m], an opposite lane as twice as much: an oncoming
lane (3.5 m) loses against one's own even while one drives on the line between them."""

MAX_CELL_ENTRIES = 1 << 22
"""Above this many entries the cells grow: a map of few huge links must not cost gigabytes."""

MAX_PAIRS = 1 << 21
"""Pairs (place, segment) compared at once off the grid: 16 MB for each temporary array."""


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where given points are, relative to the lane nearest to each; one row for each point.

    Attributes:
        lane: (n,) int64, row of the lane; -1 where there is no road at all (the rest is then 0, `distance` inf).
        s: (n,) arc length from the lane's start to the foot point [m].
        lateral: (n,) offset from the lane's line, left positive [m].
        distance: (n,) distance to the foot point; more than |lateral| beyond a lane's end [m].
        yaw: (n,) direction of the lane at the foot point, counter-clockwise from east, (-pi, pi] [rad].
    """

    lane: IntArray
    s: FloatArray
    lateral: FloatArray
    distance: FloatArray
    yaw: FloatArray


class Roads:
    """All lanes of a map, end to end; never changed after it is made.

    Attributes:
        ids: (l,) names of the lanes, as the map spells them.
        points: (n, 3) float64, the lanes' lines one after the other, east, north, up [m].
        first: (l + 1,) int64; lane `i` owns the points `first[i]:first[i + 1]`, two or more.
        s: (n,) arc length of each point from its lane's start [m].
        length: (l,) [m].
        width: (l,) [m].
        speed_limit: (l,) [m/s]; 0 means none given.
    """

    __slots__ = (
        "_base",
        "_cell",
        "_cell_first",
        "_cell_segment",
        "_chain",
        "_grid_shape",
        "_origin",
        "_rows",
        "_segment_direction",
        "_segment_lane",
        "_segment_length",
        "_segment_point",
        "_successor",
        "_successor_first",
        "first",
        "ids",
        "length",
        "points",
        "s",
        "speed_limit",
        "width",
    )

    def __init__(
        self,
        ids: Sequence[str] = (),
        lines: Sequence[FloatArray] = (),
        successors: Sequence[Sequence[int]] = (),
        width: Sequence[float] = (),
        speed_limit: Sequence[float] = (),
    ) -> None:
        """Lay the lanes out; without arguments, a place without roads.

        Args:
            ids: name of each lane, all different.
            lines: for each lane (k, 3) points in driving direction [m], finite. Repeated points are left out.
            successors: for each lane the rows of the lanes that go on where it ends.
            width: for each lane [m].
            speed_limit: for each lane [m/s].

        Raises:
            ValueError: the lengths differ, a name comes twice or a line has no length.
        """
        if not len(ids) == len(lines) == len(successors) == len(width) == len(speed_limit):
            raise ValueError("every lane needs a name, a line, successors, a width and a speed limit")
        self.ids = tuple(ids)
        self._rows = {name: i for i, name in enumerate(self.ids)}
        if len(self._rows) != len(self.ids):
            raise ValueError("two lanes have one name")
        clean = [_without_repeats(line) for line in lines]
        short = next((i for i, line in enumerate(clean) if len(line) < 2), None)  # noqa: PLR2004  # a line's two ends
        if short is not None:
            raise ValueError(f"lane {self.ids[short]!r} has no length")
        self.points = np.concatenate(clean) if clean else np.zeros((0, 3))
        self.first = np.concatenate([[0], np.cumsum([len(line) for line in clean], dtype=np.int64)]).astype(np.int64)
        self.width = np.array(width, dtype=np.float64)
        self.speed_limit = np.array(speed_limit, dtype=np.float64)
        self._successor_first = np.concatenate([[0], np.cumsum([len(row) for row in successors])]).astype(np.int64)
        self._successor = np.array([lane for row in successors for lane in row], dtype=np.int64)
        self._measure()
        self._lay_grid()

    def __len__(self) -> int:
        return len(self.ids)

    def row(self, name: str) -> int:
        """The row of the lane with this name.

        Raises:
            KeyError: there is no such lane.
        """
        return self._rows[name]

    def successors(self, lane: int) -> IntArray:
        """(k,) rows of the lanes that begin where this one ends, in the map's order; empty at a dead end."""
        return self._successor[self._successor_first[lane] : self._successor_first[lane + 1]]

    def at(self, lane: npt.ArrayLike, s: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Points on lanes.

        Args:
            lane: (n,) rows of lanes.
            s: (n,) arc lengths, held within the lane [m].

        Returns:
            (n, 3) points east, north, up [m] and (n,) the lanes' directions there, (-pi, pi] [rad].
        """
        lane = np.atleast_1d(np.asarray(lane, dtype=np.int64))
        along = self._base[lane] + np.clip(np.asarray(s, dtype=np.float64), 0.0, self.length[lane])
        point = np.searchsorted(self._chain, along, side="right") - 1
        point = np.clip(point, self.first[lane], self.first[lane + 1] - 2)
        segment = point - lane  # each lane before has one segment fewer than it has points
        share = (along - self._chain[point]) / self._segment_length[segment]
        start = self.points[point]
        return start + share[:, None] * (self.points[point + 1] - start), self._yaw(segment)

    def nearest(self, x: npt.ArrayLike, y: npt.ArrayLike, yaw: npt.ArrayLike | None = None) -> Places:
        """The lane nearest to each point, and where on it.

        Args:
            x: (n,) east, finite [m].
            y: (n,) north, finite [m].
            yaw: (n,) headings [rad]; when given, lanes of another direction count as farther away (`TURN_COST`).

        Returns:
            One row for each point. Of equally near lanes the first in the map's order.
        """
        x, y = np.broadcast_arrays(np.atleast_1d(np.asarray(x, np.float64)), np.atleast_1d(np.asarray(y, np.float64)))
        place = np.stack((x, y), axis=-1)
        n = len(place)
        if len(self) == 0 or n == 0:
            zero = np.zeros(n)
            return Places(np.full(n, -1, dtype=np.int64), zero, zero.copy(), np.full(n, np.inf), zero.copy())
        heading = None
        if yaw is not None:
            angle = np.broadcast_to(np.asarray(yaw, dtype=np.float64), (n,))
            heading = np.stack((np.cos(angle), np.sin(angle)), axis=-1)

        best = np.zeros(n, dtype=np.int64)
        score = np.full(n, np.inf)
        cell = self._cells(place)
        near = np.flatnonzero(cell >= 0)
        near = near[self._cell_first[cell[near] + 1] > self._cell_first[cell[near]]]
        if len(near):
            start, stop = self._cell_first[cell[near]], self._cell_first[cell[near] + 1]
            segment = self._cell_segment[_ranges(start, stop - start)]
            best[near], score[near] = self._best(place, heading, near, segment, stop - start)
        far = np.flatnonzero(score > REACH)
        every = np.arange(len(self._segment_point))
        step = max(1, MAX_PAIRS // len(every))
        for i in range(0, len(far), step):  # turns, not rows: nearly always one
            some = far[i : i + step]
            count = np.full(len(some), len(every))
            best[some], _ = self._best(place, heading, some, np.tile(every, len(some)), count)
        return self._places(place, best)

    def _places(self, place: FloatArray, segment: IntArray) -> Places:
        """What there is to say of `place` (n, 2) relative to the segments (n,) chosen for it."""
        along, lateral, distance = self._project(place, segment)
        lane = self._segment_lane[segment]
        return Places(lane, self.s[self._segment_point[segment]] + along, lateral, distance, self._yaw(segment))

    def _best(
        self, place: FloatArray, heading: FloatArray | None, rows: IntArray, segment: IntArray, count: IntArray
    ) -> tuple[IntArray, FloatArray]:
        """The best segment for each of `rows`, and its score [m].

        Args:
            place: (n, 2) all places.
            heading: (n, 2) unit vectors of all places, or None.
            rows: (k,) the places asked for.
            segment: (sum(count),) candidates, the first `count[0]` of them for `rows[0]` and so on.
            count: (k,) how many candidates each has, all above 0.
        """
        owner = np.repeat(rows, count)
        score = self._project(place[owner], segment)[2]
        if heading is not None:
            towards = np.einsum("ij,ij->i", heading[owner], self._segment_direction[segment])
            score = score + TURN_COST * (1.0 - towards)
        start = np.cumsum(count) - count
        least = np.minimum.reduceat(score, start)
        hit = np.flatnonzero(score == np.repeat(least, count))
        return segment[hit[np.searchsorted(hit, start)]], least

    def _project(self, place: FloatArray, segment: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Foot points: along the segment [m], offset to the left of its line [m], distance [m]."""
        away = place - self.points[self._segment_point[segment], :2]
        direction = self._segment_direction[segment]
        full = away[:, 0] * direction[:, 0] + away[:, 1] * direction[:, 1]
        lateral = away[:, 1] * direction[:, 0] - away[:, 0] * direction[:, 1]
        along = np.clip(full, 0.0, self._segment_length[segment])
        return along, lateral, np.hypot(full - along, lateral)

    def _yaw(self, segment: IntArray) -> FloatArray:
        direction = self._segment_direction[segment]
        return np.arctan2(direction[:, 1], direction[:, 0])

    def _measure(self) -> None:
        """Segments, their directions, and arc lengths."""
        lane_of_point = np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.first))
        is_last = np.zeros(len(self.points), dtype=bool)
        is_last[self.first[1:] - 1] = True
        self._segment_point = np.flatnonzero(~is_last)
        self._segment_lane = lane_of_point[self._segment_point]
        step = self.points[self._segment_point + 1, :2] - self.points[self._segment_point, :2]
        self._segment_length = np.hypot(step[:, 0], step[:, 1])
        self._segment_direction = step / self._segment_length[:, None]

        # One ascending scale for all lanes, a metre of nothing between two of them: a single search serves them all.
        gap = np.ones(len(self.points))
        gap[self._segment_point] = self._segment_length
        end = np.cumsum(gap)
        self._chain = end - gap
        self._base = self._chain[self.first[:-1]]
        self.s = self._chain - self._base[lane_of_point]
        self.length = self.s[self.first[1:] - 1]

    def _lay_grid(self) -> None:
        """List for each cell the segments within `REACH` of it (compressed rows: `_cell_first`, `_cell_segment`)."""
        self._cell = CELL
        if len(self) == 0:
            self._origin = np.zeros(2)
            self._grid_shape = np.zeros(2, dtype=np.int64)
            self._cell_first = np.zeros(1, dtype=np.int64)
            self._cell_segment = np.zeros(0, dtype=np.int64)
            return
        a, b = self.points[self._segment_point, :2], self.points[self._segment_point + 1, :2]
        low, high = np.minimum(a, b) - REACH, np.maximum(a, b) + REACH
        self._origin = low.min(axis=0)
        extent = high.max(axis=0) - self._origin
        limit = max(MAX_CELL_ENTRIES, 16 * len(a))
        while True:
            self._grid_shape = np.floor(extent / self._cell).astype(np.int64) + 1
            from_cell = np.floor((low - self._origin) / self._cell).astype(np.int64)
            to_cell = np.floor((high - self._origin) / self._cell).astype(np.int64)
            span = to_cell - from_cell + 1
            num_entries = float(np.prod(span.astype(np.float64), axis=1).sum())
            if max(num_entries, float(np.prod(self._grid_shape.astype(np.float64)))) <= limit:
                break
            self._cell *= 2.0
        count = span[:, 0] * span[:, 1]
        segment = np.repeat(np.arange(len(a), dtype=np.int64), count)
        inside = _ranges(np.zeros_like(count), count)
        column = from_cell[segment, 0] + inside // span[segment, 1]
        row = from_cell[segment, 1] + inside % span[segment, 1]
        cell = column * self._grid_shape[1] + row
        self._cell_segment = segment[np.argsort(cell, kind="stable")]
        num_in_cell = np.bincount(cell, minlength=int(self._grid_shape.prod()))
        self._cell_first = np.concatenate([[0], np.cumsum(num_in_cell)]).astype(np.int64)

    def _cells(self, place: FloatArray) -> IntArray:
        """(n,) the cell of each place, -1 outside the grid."""
        at = np.floor((place - self._origin) / self._cell)
        is_inside = np.asarray(((at >= 0) & (at < self._grid_shape)).all(axis=1))
        at = np.where(is_inside[:, None], at, 0.0).astype(np.int64)  # far away would not fit an integer
        return np.asarray(np.where(is_inside, at[:, 0] * self._grid_shape[1] + at[:, 1], -1))


def _without_repeats(line: FloatArray) -> FloatArray:
    """(k, 3) the line without points that stand where the one before them stands (in the plane)."""
    line = np.asarray(line, dtype=np.float64)
    is_new = np.ones(len(line), dtype=bool)
    is_new[1:] = (line[1:, 0] != line[:-1, 0]) | (line[1:, 1] != line[:-1, 1])
    return np.asarray(line[is_new])


def _ranges(start: IntArray, count: IntArray) -> IntArray:
    """`start[0], start[0] + 1, ...` for `count[0]` numbers, then the same for the next, end to end."""
    end = np.cumsum(count)
    total = int(end[-1]) if len(end) else 0
    return np.asarray(np.arange(total, dtype=np.int64) + np.repeat(start - (end - count), count))

"""The roads as lanes: which lane is here, how far along it, where it leads, what lies beside it.

A lane is a polyline in driving direction. All lanes lie end to end in one set of arrays, so that a question about
many places is a handful of numpy calls. Where a map comes from is not known here.

Arc length and distance are measured in the plane (east, north); the height is only carried along. That is what a
driver's `s` and lateral offset mean, and on a slope of 10 % the difference to the way driven is 0.5 %.

The nearest lane is found exactly, near a road or far from any. The segments lie in blocks of a few tens that follow
one another on a lane; a block's bounding box says how near it can be at best, its middle point how near it is at
least. Only the segments of blocks that can still win are looked at. (A grid of cells answers a single question as
fast, but grows with the area of the map and has nothing to say off the road.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from typing import TypeVar, cast

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.block_grid import REACH, BlockGrid
from rosbridge_sim.world.geometry import BoolArray, FloatArray, IntArray, ranges, wrap_angle

__all__ = ["LanePlaces", "Roads", "ranges"]

T = TypeVar("T")

BLOCK = 32
"""Segments in a block: about the root of their number on a small map, and 16 to 32 m of road."""

TURN_COST = 3.0
"""A lane across the heading counts as this much farther away [m], an opposite lane as twice as much: an oncoming
lane (3.5 m) loses against one's own even while one drives on the line between them."""

BESIDE = 0.5
"""Who is farther than this beyond a lane's end, or outside of a corner, is not beside it [m]."""

MAX_SEGMENTS = 1 << 19
"""Pairs (place, segment) of one look for lanes near places, about 40 ms: 10,000 entities on the lanes of a town."""

SQUARE = 4.0
CROWD = 64
"""Where there are more, so many are looked at in a square of this side [m], and of all squares the first ones before
the second ones. On the lanes, whoever stands among others in one place changes little."""

MAX_SEGMENT_PAIRS = 1 << 18
"""Pairs (place, block) compared at once: 2 MB for each temporary array, which stays inside the cache."""


@dataclass(frozen=True, slots=True, eq=False)
class LanePlaces:
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
        turn: (l,) by how much the lane turns from its start to its end, left positive; more than pi for a loop [rad].
        left, right: (l,) int64, rows of the lanes beside that one may change into; -1 where there is none.
        is_stop: (l,) bool, a stop line lies across the lane's end.
        border: (n, 2) how far the lane's edges lie to the left and to the right of each point, half a width where
            the map does not say [m].
        first_successor, successor: (l + 1,) and (k,) int64; `successor[first_successor[i]:first_successor[i + 1]]`
            are the rows of the lanes that begin where lane `i` ends.
        base, chain: (l,) and (n,) one scale for all lanes: the place `s` on lane `i` is `base[i] + s`, and `chain` has
            the points' places, rising; between two lanes lies a metre of nothing [m].
        digest: 16 bytes that stand for all of it.
    """

    __slots__ = (
        "_block_first",
        "_block_high",
        "_block_low",
        "_block_middle",
        "_block_size",
        "_derived",
        "_rows",
        "_segment_direction",
        "_segment_lane",
        "_segment_length",
        "_segment_point",
        "base",
        "border",
        "chain",
        "digest",
        "first",
        "first_successor",
        "ids",
        "is_stop",
        "left",
        "length",
        "points",
        "right",
        "s",
        "speed_limit",
        "successor",
        "turn",
        "width",
    )

    def __init__(
        self,
        ids: Sequence[str] = (),
        lines: Sequence[FloatArray] = (),
        successors: Sequence[Sequence[int]] = (),
        width: Sequence[float] = (),
        speed_limit: Sequence[float] = (),
        *,
        left: Sequence[int] | None = None,
        right: Sequence[int] | None = None,
        is_stop: Sequence[bool] | None = None,
        borders: Mapping[int, FloatArray] | None = None,
    ) -> None:
        """Lay the lanes out; without arguments, a place without roads.

        Args:
            ids: name of each lane, all different.
            lines: for each lane (k, 3) points in driving direction [m], finite. Repeated points are left out.
            successors: for each lane the rows of the lanes that go on where it ends.
            width: for each lane [m].
            speed_limit: for each lane [m/s].
            left: for each lane the row of the one to its left, or -1; None: nowhere is one.
            right: the same to the right.
            is_stop: for each lane whether it ends at a stop line; None: none does.
            borders: for some lanes (k, 2) the distances to the left and right edge at each point of its line [m].

        Raises:
            ValueError: the lengths differ, a name comes twice or a line has no length.
        """
        if not len(ids) == len(lines) == len(successors) == len(width) == len(speed_limit):
            raise ValueError("every lane needs a name, a line, successors, a width and a speed limit")
        num = len(ids)
        self.left = np.array([-1] * num if left is None else left, dtype=np.int64)
        self.right = np.array([-1] * num if right is None else right, dtype=np.int64)
        self.is_stop = np.array([False] * num if is_stop is None else is_stop, dtype=bool)
        if not len(self.left) == len(self.right) == len(self.is_stop) == num:
            raise ValueError("what lies beside and at the end of the lanes is told for each of them")
        self.ids = tuple(ids)
        self._rows = {name: i for i, name in enumerate(self.ids)}
        if len(self._rows) != len(self.ids):
            raise ValueError("two lanes have one name")
        kept = [_is_new(line) for line in lines]
        clean = [np.asarray(line, dtype=np.float64)[mask] for line, mask in zip(lines, kept, strict=True)]
        short = next((i for i, line in enumerate(clean) if len(line) < 2), None)  # noqa: PLR2004  # a line's two ends
        if short is not None:
            raise ValueError(f"lane {self.ids[short]!r} has no length")
        self.points = np.concatenate(clean) if clean else np.zeros((0, 3))
        self.first = np.concatenate([[0], np.cumsum([len(line) for line in clean], dtype=np.int64)]).astype(np.int64)
        self.width = np.array(width, dtype=np.float64)
        self.speed_limit = np.array(speed_limit, dtype=np.float64)
        self.first_successor = np.concatenate([[0], np.cumsum([len(row) for row in successors])]).astype(np.int64)
        self.successor = np.array([lane for row in successors for lane in row], dtype=np.int64)
        self.border = np.repeat(0.5 * self.width, np.diff(self.first))[:, None].repeat(2, axis=1)
        for lane, distances in (borders or {}).items():
            self.border[self.first[lane] : self.first[lane + 1]] = distances[kept[lane]]
        self._measure()
        self._lay_blocks()
        self._derived: dict[object, object] = {}
        self.digest = self._hash()

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
        return self.successor[self.first_successor[lane] : self.first_successor[lane + 1]]

    def derived(self, make: Callable[[Roads], T]) -> T:
        """`make(roads)`, made at the first call and kept."""
        value = self._derived.get(make)
        if value is None:
            value = self._derived[make] = make(self)
        return cast("T", value)  # the key says what the value is

    def at(self, lane: npt.ArrayLike, s: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Points on lanes.

        Args:
            lane: (n,) rows of lanes.
            s: (n,) arc lengths, held within the lane [m].

        Returns:
            (n, 3) points east, north, up [m] and (n,) the lanes' directions there, (-pi, pi] [rad].
        """
        lane = np.atleast_1d(np.asarray(lane, dtype=np.int64))
        point, share = self.locate(lane, np.asarray(s, dtype=np.float64))
        start = self.points[point]
        # Each lane before has one segment fewer than it has points.
        return start + share[:, None] * (self.points[point + 1] - start), self._yaw(point - lane)

    def beside(self, places: LanePlaces) -> tuple[FloatArray, FloatArray]:
        """How far the edges of their lanes are from given places.

        Args:
            places: from `nearest`.

        Returns:
            (n,) to the left edge and (n,) to the right one, negative beyond it; inf where there is no lane [m].
        """
        far = np.full(len(places.lane), np.inf)
        if len(self) == 0:
            return far, far.copy()
        point, share = self.locate(places.lane, places.s)
        border = self.border[point] + share[:, None] * (self.border[point + 1] - self.border[point])
        return border[:, 0] - places.lateral, border[:, 1] + places.lateral

    def locate(self, lane: IntArray, s: FloatArray) -> tuple[IntArray, FloatArray]:
        """(n,) the row of the point before each place, and (n,) the share of the way from it to the next one.

        Args:
            lane: (n,) rows of lanes.
            s: (n,) arc lengths, held within the lane [m].
        """
        length = self.length[lane]
        s = np.fmin(np.fmax(s, 0.0), length)
        first, last = self.first[lane], self.first[lane + 1] - 2
        # Most lanes have their points at equal distances: then the place is known without a search.
        point = np.minimum(first + (s * ((last + 1 - first) / length)).astype(np.int64), last)
        is_wrong = (s < self.s[point]) | (s >= self.s[point + 1])
        if is_wrong.any():
            at = np.flatnonzero(is_wrong)
            found = np.searchsorted(self.chain, self.base[lane[at]] + s[at], side="right") - 1
            point[at] = np.minimum(np.maximum(found, first[at]), last[at])
        return point, (s - self.s[point]) / self._segment_length[point - lane]

    def nearest(self, x: npt.ArrayLike, y: npt.ArrayLike, yaw: npt.ArrayLike | None = None) -> LanePlaces:
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
            return LanePlaces(np.full(n, -1, dtype=np.int64), zero, zero.copy(), np.full(n, np.inf), zero.copy())
        heading = None
        if yaw is not None:
            angle = np.broadcast_to(np.asarray(yaw, dtype=np.float64), (n,))
            heading = np.stack((np.cos(angle), np.sin(angle)), axis=-1)

        best = np.zeros(n, dtype=np.int64)
        step = max(1, MAX_SEGMENT_PAIRS // len(self._block_size))
        for i in range(0, n, step):  # turns, not rows: nearly always one
            part = slice(i, i + step)
            best[part] = self._best(place[part], None if heading is None else heading[part])
        return self._places(place, best)

    def within(self, x: FloatArray, y: FloatArray, radius: FloatArray) -> tuple[IntArray, LanePlaces]:
        """All lanes near each point; beside the middle of a lane, not beyond its ends.

        Args:
            x: (n,) east, finite [m].
            y: (n,) north, finite [m].
            radius: (n,) how near [m].

        Returns:
            (m,) int64, which point, rising; and (m,) the lanes, those of one point in the map's order. Of crowds beyond
            `MAX_SEGMENTS` not all points are looked at.
        """
        place = np.stack((x, y), axis=-1)
        if len(self) == 0 or len(place) == 0:
            none, empty = np.zeros(0, dtype=np.int64), np.zeros(0)
            return none, LanePlaces(none, empty, empty, empty, empty)
        owner, block = self._blocks_within(place, radius)
        is_seen = _thin_out(place, owner, self._block_size[block])
        owner, block = owner[is_seen], block[is_seen]
        size = self._block_size[block]
        owner, segment = np.repeat(owner, size), ranges(self._block_first[block], size)
        _, lateral, distance = self._project(place[owner], segment)
        is_near = (distance <= radius[owner]) & (distance - np.abs(lateral) < BESIDE)
        owner, segment, distance = owner[is_near], segment[is_near], distance[is_near]
        key = owner * len(self) + self._segment_lane[segment]
        order = np.lexsort((distance, key))
        best = order[np.flatnonzero(np.diff(key[order], prepend=-1))]
        return owner[best], self._places(place[owner[best]], segment[best])

    def _blocks_within(self, place: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
        """(m,) which place, rising, and (m,) the blocks whose boxes are within its radius, rising for each."""
        owner, block = self.derived(Roads._lay_grid).find(place)
        is_seen = _thin_out(place, owner, np.ones_like(owner))
        owner, block = owner[is_seen], block[is_seen]
        far = np.flatnonzero(radius > REACH)  # seldom anybody: these are compared with all blocks
        if len(far):
            is_near = radius[owner] <= REACH
            num = len(self._block_size)
            owner = np.concatenate([owner[is_near], far.repeat(num)])
            block = np.concatenate([block[is_near], np.tile(np.arange(num), len(far))])
            order = np.lexsort((block, owner))
            owner, block = owner[order], block[order]
        gap = np.maximum(self._block_low[block] - place[owner], place[owner] - self._block_high[block])
        is_within = _length(np.maximum(gap, 0.0)) <= radius[owner]
        return owner[is_within], block[is_within]

    def _places(self, place: FloatArray, segment: IntArray) -> LanePlaces:
        """What there is to say of `place` (n, 2) relative to the segments (n,) chosen for it."""
        along, lateral, distance = self._project(place, segment)
        lane = self._segment_lane[segment]
        return LanePlaces(lane, self.s[self._segment_point[segment]] + along, lateral, distance, self._yaw(segment))

    def _best(self, place: FloatArray, heading: FloatArray | None) -> IntArray:
        """(n,) the best segment for each place, its `heading` (n, 2) as a unit vector taken into account."""
        segment, count = self._candidates(place, slack=0.0 if heading is None else 2.0 * TURN_COST)
        owner = np.repeat(np.arange(len(place)), count)
        score = self._project(place[owner], segment)[2]
        if heading is not None:
            towards = (heading[owner] * self._segment_direction[segment]).sum(axis=1)
            score += TURN_COST * (1.0 - towards)
        start = np.cumsum(count) - count
        least = np.minimum.reduceat(score, start)
        hit = np.flatnonzero(score == least[owner])
        return np.asarray(segment[hit[np.searchsorted(hit, start)]])

    def _candidates(self, place: FloatArray, slack: float) -> tuple[IntArray, IntArray]:
        """The segments that can be the nearest, for each place one or more, and how many for each.

        Args:
            place: (n, 2) [m].
            slack: how much farther than the nearest one a segment may be [m].

        Returns:
            (sum of count,) segments, those of the first place first, and (n,) count.
        """
        gap = np.maximum(self._block_low - place[:, None], place[:, None] - self._block_high)
        at_best = _length(np.maximum(gap, 0.0))
        at_most = _length(place[:, None] - self._block_middle).min(axis=1) + slack
        # A hair more, so that rounding cannot lose the block that the bound itself comes from.
        owner, block = np.nonzero(at_best <= (at_most * (1.0 + 1e-9) + 1e-9)[:, None])
        size = self._block_size[block]
        count = np.bincount(np.repeat(owner, size), minlength=len(place))
        return ranges(self._block_first[block], size), count

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
        self.chain = end - gap
        self.base = self.chain[self.first[:-1]]
        self.s = self.chain - self.base[lane_of_point]
        self.length = self.s[self.first[1:] - 1]

        yaw = self._yaw(np.arange(len(self._segment_lane)))
        bend = np.where(self._segment_lane[1:] == self._segment_lane[:-1], wrap_angle(np.diff(yaw)), 0.0)
        self.turn = np.bincount(self._segment_lane[1:], weights=bend, minlength=len(self))

    def _lay_blocks(self) -> None:
        """Cut each lane into blocks of at most `BLOCK` segments."""
        num = np.diff(self.first) - 1  # segments of each lane
        blocks = -(-num // BLOCK)
        lane = np.repeat(np.arange(len(self), dtype=np.int64), blocks)
        offset = BLOCK * ranges(np.zeros_like(blocks), blocks)
        self._block_first = self.first[lane] - lane + offset
        self._block_size = np.minimum(num[lane] - offset, BLOCK)
        point = self._segment_point[self._block_first]
        self._block_middle = self.points[point + self._block_size // 2, :2]
        if len(lane) == 0:
            self._block_low = self._block_high = self._block_middle
            return
        a, b = self.points[self._segment_point, :2], self.points[self._segment_point + 1, :2]
        self._block_low = np.minimum.reduceat(np.minimum(a, b), self._block_first)
        self._block_high = np.maximum.reduceat(np.maximum(a, b), self._block_first)

    def _lay_grid(self) -> BlockGrid:
        """Return a grid over the blocks of the lanes."""
        return BlockGrid(self._block_low, self._block_high)

    def _hash(self) -> bytes:
        state = blake2b(repr(self.ids).encode(), digest_size=16)
        columns = (self.points, self.border, self.first, self.width, self.speed_limit, self.left, self.right)
        for column in (*columns, self.is_stop, self.first_successor, self.successor):
            state.update(column.tobytes())
        return state.digest()


def _length(vector: FloatArray) -> FloatArray:
    """Lengths of plane vectors (..., 2)."""
    return np.asarray(np.sqrt(vector[..., 0] * vector[..., 0] + vector[..., 1] * vector[..., 1]))


def _is_new(line: FloatArray) -> npt.NDArray[np.bool_]:
    """(k,) False for the points of a line that stand where the one before them stands (in the plane)."""
    line = np.asarray(line, dtype=np.float64)
    is_new = np.ones(len(line), dtype=bool)
    is_new[1:] = (line[1:, 0] != line[:-1, 0]) | (line[1:, 1] != line[:-1, 1])
    return is_new


def _thin_out(place: FloatArray, owner: IntArray, cost: IntArray) -> BoolArray | slice:
    """Choose the pairs to be looked at, of (m,) pairs that belong to places and cost so much each.

    All of them, where they cost `MAX_SEGMENTS` together at most; else those of some places.
    """
    if cost.sum() <= MAX_SEGMENTS:
        return slice(None)
    cost_of_place = np.bincount(owner, weights=cost, minlength=len(place))
    _, square = np.unique(np.floor(place / SQUARE), axis=0, return_inverse=True)
    order = square.argsort(kind="stable")
    num = np.bincount(square)
    rank = np.empty(len(place), dtype=np.int64)
    rank[order] = ranges(np.zeros_like(num), num)
    in_turn = rank.argsort(kind="stable")
    is_seen = np.empty(len(place), dtype=bool)
    is_seen[in_turn] = (cost_of_place[in_turn].cumsum() <= MAX_SEGMENTS) & (rank[in_turn] < CROWD)
    return np.asarray(is_seen[owner])

"""Search for the lanes near given places, exact near a road and far from any.

The lanes' lines are cut into straight segments, and the segments into blocks of a few tens that follow one another on
a lane. The bounding box of a block says how near it can be at best, its middle point how near it is at least. Only the
segments of blocks that can still win are looked at. A grid of cells would answer a single question as fast, but grows
with the area of the map and finds nothing away from the roads.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.block_grid import REACH, BlockGrid
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, ranges

Near = tuple[IntArray, IntArray, tuple[FloatArray, FloatArray, FloatArray]]
"""See `SegmentSearch.within`."""

Placed = tuple[IntArray, FloatArray, FloatArray, FloatArray]
"""See `SegmentSearch.place`."""

BLOCK_SEGMENTS: Final = 32
"""Segments in a block: about the root of their number on a small map, and 16 to 32 m of road."""

TURN_COST: Final = 3.0
"""A lane across the heading counts as this much farther away [m], and an opposite lane as twice as much. So an oncoming
lane (3.5 m away) loses against one's own lane, even while one drives on the line between them."""

HEIGHT_COST: Final = 2.0
SAME_HEIGHT: Final = 1.0
"""Each metre of height above the second number [m] counts as the first number of metres of distance. A bridge 6 m above
a road loses against the road below for an entity on that road, as far as 10 m beside its line. Within one road only
distances count: it rises by less across its lanes."""

BESIDE: Final = 0.5
"""A place farther than this beyond the end of a lane, or outside a corner, is not beside the lane [m]."""

MAX_SEGMENTS: Final = 1 << 19
"""Pairs (place, segment) of one search for lanes near places: about 40 ms, 10,000 entities on the lanes of a town."""

CROWD_SQUARE: Final = 4.0
CROWD: Final = 64
"""Above `MAX_SEGMENTS`, at most so many places are looked at in a square of this side [m]; and of all squares the first
places come before the second ones. An entity that stands among others in one place changes little."""

MAX_PAIRWISE: Final = 1 << 10
"""Up to so many pairs of a place and a block are all compared, without a grid: 5 us in place of 20."""

MAX_BLOCK_PAIRS: Final = 1 << 18
"""Pairs (place, block) compared at once: 2 MB for each temporary array, which stays inside the cache."""


class LaneSegments(Record, eq=False):
    """The straight segments of all lanes, in the order of the lanes.

    Attributes:
        lane: (k,) int64, row of the lane of each, rising.
        point: (k,) int64, row of the point of the roads at which each starts.
        start: (k, 2) start points, east and north [m].
        end: (k, 2) end points, east and north [m].
        length: (k,) in the plane, positive [m].
        direction: (k, 2) unit vectors in the plane.
        angle: (k,) of these, counter-clockwise from east, (-pi, pi] [rad].
        height: (k,) of the start points [m].
        slope: (k,) rise for each metre in the plane.
    """

    lane: IntArray
    point: IntArray
    start: FloatArray
    end: FloatArray
    length: FloatArray
    direction: FloatArray
    angle: FloatArray
    height: FloatArray
    slope: FloatArray

    def yaw(self, segment: IntArray) -> FloatArray:
        """Return the directions of segments, (n,), counter-clockwise from east, (-pi, pi] [rad]."""
        return self.angle[segment]

    def project(self, place: FloatArray, segment: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the foot points of places on segments.

        Args:
            place: (n, 2) east and north [m].
            segment: (n,) int64, a segment for each place.

        Returns:
            (n,) from the start of the segment to the foot [m], (n,) offset from its line, left positive [m], and (n,)
            distance to the foot [m].
        """
        # `take` needs a tenth of the time that an index needs for rows of an array.
        away = place - self.start.take(segment, axis=0)
        direction = self.direction.take(segment, axis=0)
        full = away[:, 0] * direction[:, 0] + away[:, 1] * direction[:, 1]
        lateral = away[:, 1] * direction[:, 0] - away[:, 0] * direction[:, 1]
        along = np.minimum(np.maximum(full, 0.0), self.length.take(segment))
        return along, lateral, np.hypot(full - along, lateral)


class SegmentSearch:
    """The segments of all lanes in blocks, and the searches over them.

    Args:
        segments: at least one.
    """

    def __init__(self, segments: LaneSegments, num_lanes: int) -> None:
        self._segments, self._num_lanes = segments, num_lanes
        num = np.bincount(segments.lane, minlength=num_lanes)  # segments of each lane
        first = np.cumsum(num) - num
        blocks = -(-num // BLOCK_SEGMENTS)
        lane = np.repeat(np.arange(num_lanes, dtype=np.int64), blocks)
        offset = BLOCK_SEGMENTS * ranges(np.zeros_like(blocks), blocks)
        self._first = first[lane] + offset
        self._size = np.minimum(num[lane] - offset, BLOCK_SEGMENTS)
        middle = self._first + self._size // 2
        self._middle, self._middle_height = segments.start[middle], segments.height[middle]
        end_height = segments.height + segments.slope * segments.length
        self._bottom = np.minimum.reduceat(np.minimum(segments.height, end_height), self._first)
        self._top = np.maximum.reduceat(np.maximum(segments.height, end_height), self._first)
        self._low = np.minimum.reduceat(np.minimum(segments.start, segments.end), self._first)
        self._high = np.maximum.reduceat(np.maximum(segments.start, segments.end), self._first)
        self._grid: BlockGrid | None = None

    @property
    def blocks(self) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
        """Low and high corners of all blocks, (b, 2) [m], their first segments and their sizes, (b,)."""
        return self._low, self._high, self._first, self._size

    def nearest(self, place: FloatArray, heading: FloatArray | None, height: FloatArray | None = None) -> IntArray:
        """Return the nearest segment for each place, (n,) int64; of equally near ones the first.

        Args:
            place: (n, 2) east and north, n >= 1 [m].
            heading: (n, 2) unit vectors; segments of another direction count as farther away (`TURN_COST`). None
                compares distances alone.
            height: (n,) heights of the places; segments above and below count as farther away (`HEIGHT_COST`) [m].
        """
        best = np.zeros(len(place), dtype=np.int64)
        step = max(1, MAX_BLOCK_PAIRS // len(self._size))
        for i in range(0, len(place), step):  # nearly always one part
            part = slice(i, i + step)
            best[part] = self._best(
                place[part],
                None if heading is None else heading[part],
                None if height is None else height[part],
            )
        return best

    def place(self, place: FloatArray, heading: FloatArray | None, height: FloatArray | None = None) -> Placed:
        """Return the nearest segment for each place, (n,) int64, and what `LaneSegments.project` returns for it."""
        segment = self.nearest(place, heading, height)
        return segment, *self._segments.project(place, segment)

    def within(self, place: FloatArray, radius: FloatArray) -> Near:
        """Return the nearest segment of each lane that is near each place; see `Roads.within`.

        Args:
            place: (n, 2) east and north, n >= 1 [m].
            radius: (n,) [m].

        Returns:
            (m,) int64, index of the place, rising; (m,) int64, the segment; and the place as `LaneSegments.project`
            returns it.
        """
        owner, block = self._blocks_within(place, radius)
        size = self._size[block]
        is_seen = _thin_out(place, owner, size)
        owner, block, size = owner[is_seen], block[is_seen], size[is_seen]
        return self._best_of_lanes(place, radius, owner.repeat(size), ranges(self._first[block], size))

    def clearance(self, place: FloatArray, most: FloatArray) -> FloatArray:
        """Return how far places are from all segments, (n,), but at most `most`; 0 where too many are near [m].

        Args:
            place: (n, 2) east and north, n >= 1 [m].
            most: (n,) [m].
        """
        owner, block = self._blocks_within(place, most)
        size = self._size[block]
        if size.sum() > MAX_SEGMENTS:
            return np.zeros(len(place))
        owner, found = owner.repeat(size), most.copy()
        _, _, distance = self._segments.project(place.take(owner, axis=0), ranges(self._first[block], size))
        np.minimum.at(found, owner, distance)
        return found

    def _best_of_lanes(self, place: FloatArray, radius: FloatArray, owner: IntArray, segment: IntArray) -> Near:
        """Return what `within` returns, of some segments for each place.

        Args:
            place: as for `within`.
            radius: as for `within`.
            owner: (k,) int64, index of the place, rising.
            segment: (k,) int64, rising for each place: so those of one lane are neighbours.
        """
        along, lateral, distance = self._segments.project(place.take(owner, axis=0), segment)
        near = ((distance <= radius[owner]) & (distance - np.abs(lateral) < BESIDE)).nonzero()[0]
        owner, segment = owner[near], segment[near]
        projected = along[near], lateral[near], distance[near]
        if not len(near):
            return owner, segment, projected
        key = owner * self._num_lanes + self._segments.lane[segment]
        is_first = np.ones(len(key), dtype=bool)
        np.not_equal(key[1:], key[:-1], is_first[1:])
        best = first_least(projected[2], is_first.cumsum() - 1, is_first.nonzero()[0])
        along, lateral, distance = projected
        return owner[best], segment[best], (along[best], lateral[best], distance[best])

    def _blocks_within(self, place: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
        """Return (m,) which place, rising, and (m,) the blocks whose boxes are within its radius, rising for each."""
        if len(place) * len(self._size) <= MAX_PAIRWISE:
            gap = np.maximum(self._low - place[:, None], place[:, None] - self._high)
            owner, block = (_length(np.maximum(gap, 0.0, out=gap)) <= radius[:, None]).nonzero()
            return owner, block
        if self._grid is None:  # made at the first search for all lanes near a place
            self._grid = BlockGrid(self._low, self._high)
        owner, block = self._grid.find(place)
        if len(owner) > MAX_SEGMENTS:
            is_seen = _thin_out(place, owner, np.ones_like(owner))
            owner, block = owner[is_seen], block[is_seen]
        if np.count_nonzero(radius > REACH):  # rare: these are compared with all blocks
            far = (radius > REACH).nonzero()[0]
            is_near = radius[owner] <= REACH
            num = len(self._size)
            owner = np.concatenate([owner[is_near], far.repeat(num)])
            block = np.concatenate([block[is_near], np.tile(np.arange(num), len(far))])
            order = np.lexsort((block, owner))
            owner, block = owner[order], block[order]
        where = place.take(owner, axis=0)
        gap = self._low.take(block, axis=0) - where
        where -= self._high.take(block, axis=0)
        np.maximum(gap, where, out=gap)
        near = (_length(np.maximum(gap, 0.0, out=gap)) <= radius[owner]).nonzero()[0]
        return owner[near], block[near]

    def _best(self, place: FloatArray, heading: FloatArray | None, height: FloatArray | None) -> IntArray:
        """Return the nearest segment for each place, (n,); arguments as for `nearest`."""
        slack = 0.0 if heading is None else 2.0 * TURN_COST
        if len(place) == 1 and height is None:  # the usual case: one ego, in half of the time
            segment = self._candidates_of_one(place, slack)
            first = int(self._score(place, heading, None, segment).argmin())
            return segment[first : first + 1]
        owner, segment = self._candidates(place, height, slack)
        return self._choose(place, heading, height, owner, segment)

    def _choose(
        self,
        place: FloatArray,
        heading: FloatArray | None,
        height: FloatArray | None,
        owner: IntArray,
        segment: IntArray,
    ) -> IntArray:
        """Return the nearest of some segments (m,) for each place (n,), whose indices are `owner`, rising (m,)."""
        heading = None if heading is None else heading.take(owner, axis=0)
        score = self._score(place.take(owner, axis=0), heading, None if height is None else height[owner], segment)
        return segment[first_least(score, owner, owner.searchsorted(np.arange(len(place))))]

    def _score(
        self, place: FloatArray, heading: FloatArray | None, height: FloatArray | None, segment: IntArray
    ) -> FloatArray:
        """Return how far each place is from its segment, with the costs of turn and height, (m,) [m]."""
        segments = self._segments
        along, _, score = segments.project(place, segment)
        if height is not None:
            score += height_cost(np.abs(segments.height[segment] + along * segments.slope[segment] - height))
        if heading is not None:
            direction = segments.direction.take(segment, axis=0)
            along_heading = heading[:, 0] * direction[:, 0] + heading[:, 1] * direction[:, 1]
            score += TURN_COST * (1.0 - along_heading)
        return score

    def _candidates_of_one(self, place: FloatArray, slack: float) -> IntArray:
        """Return the segments that `_candidates` returns for one place, (1, 2)."""
        gap = np.maximum(self._low - place, place - self._high)
        at_most = _length(place - self._middle).min() + slack
        block = (_length(np.maximum(gap, 0.0)) <= at_most * (1.0 + 1e-9) + 1e-9).nonzero()[0]
        return ranges(self._first[block], self._size[block])

    def _candidates(self, place: FloatArray, height: FloatArray | None, slack: float) -> tuple[IntArray, IntArray]:
        """Return the segments that can be the nearest for each place, one or more.

        Args:
            place: (n, 2) [m].
            height: (n,) of the places, or None to leave it out [m].
            slack: how much farther than the nearest one a segment may be [m].

        Returns:
            (m,) int64, index of the place, rising, and (m,) int64, the segments of each in rising order.
        """
        gap = np.maximum(self._low - place[:, None], place[:, None] - self._high)
        at_best = _length(np.maximum(gap, 0.0))
        at_most = _length(place[:, None] - self._middle)
        if height is not None:
            at_best += height_cost(
                np.maximum(np.maximum(self._bottom - height[:, None], height[:, None] - self._top), 0.0)
            )
            at_most += height_cost(np.abs(self._middle_height - height[:, None]))
        # A little more, so that rounding cannot lose the block that the bound itself comes from.
        owner, block = np.nonzero(at_best <= ((at_most.min(axis=1) + slack) * (1.0 + 1e-9) + 1e-9)[:, None])
        size = self._size[block]
        return owner.repeat(size), ranges(self._first[block], size)


def first_least(score: FloatArray, owner: IntArray, start: IntArray) -> IntArray:
    """Return for each owner the index of its least score; of equal ones the first.

    Args:
        score: (m,) with one or more for each owner.
        owner: (m,) int64, rising, 0 to k - 1.
        start: (k,) int64, the first index of each owner.
    """
    least = np.minimum.reduceat(score, start)
    hit = (score == least[owner]).nonzero()[0]
    return np.asarray(hit[hit.searchsorted(start)])


def height_cost(amount: FloatArray) -> FloatArray:
    """Return the metres of distance that amounts of height count as [m]."""
    return np.asarray(HEIGHT_COST * np.maximum(amount - SAME_HEIGHT, 0.0))


def _length(vector: FloatArray) -> FloatArray:
    """Return the lengths of plane vectors (..., 2)."""
    return np.asarray(np.sqrt(vector[..., 0] * vector[..., 0] + vector[..., 1] * vector[..., 1]))


def _thin_out(place: FloatArray, owner: IntArray, cost: IntArray) -> BoolArray | slice:
    """Choose which pairs to look at: all of them, or where they cost more than `MAX_SEGMENTS` those of some places.

    Args:
        place: (n, 2) east and north [m].
        owner: (m,) int64, index of the place of each pair.
        cost: (m,) int64, segments of each pair.

    Returns:
        (m,) bool, or a slice for all.
    """
    if BLOCK_SEGMENTS * len(cost) <= MAX_SEGMENTS or cost.sum() <= MAX_SEGMENTS:
        return slice(None)
    cost_of_place = np.bincount(owner, weights=cost, minlength=len(place))
    _, square = np.unique(np.floor(place / CROWD_SQUARE), axis=0, return_inverse=True)
    order = square.argsort(kind="stable")
    num = np.bincount(square)
    rank = np.empty(len(place), dtype=np.int64)
    rank[order] = ranges(np.zeros_like(num), num)
    in_turn = rank.argsort(kind="stable")
    is_seen = np.empty(len(place), dtype=bool)
    is_seen[in_turn] = (cost_of_place[in_turn].cumsum() <= MAX_SEGMENTS) & (rank[in_turn] < CROWD)
    return np.asarray(is_seen[owner])

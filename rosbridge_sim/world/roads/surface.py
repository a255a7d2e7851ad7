"""The surface of the ground: its height and its slope at any place, from the lines and the edges of the lanes.

*On a lane* the height is that of the lane's line at the foot point, and from there it rises across the lane by the
lane's `Roads.bank`. Along the line it is linear from point to point. *Beyond* the edges and the ends of all lanes the
plane of the nearest lane goes on for `BEYOND`, and is level after that.

*The slope* along a lane is that between two points of its line. Near a point it changes evenly within `ROUNDING`, so
that a vehicle does not pitch in one frame.

*Where roads lie above one another* the one counts that fits the height of the entity: a difference in height counts as
a distance (`segment_search.HEIGHT_COST`). So an entity on a bridge stays on it, as long as it is nearer to it than a
dozen metres. For a place without a height the lowest road counts.

Everything is prepared once for each map, and found for any number of places at once. Each place gets the bits that it
would get alone.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.block_grid import BlockGrid
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, in_columns
from rosbridge_sim.world.geometry.segment_search import SAME_HEIGHT, first_least, height_cost
from rosbridge_sim.world.roads.roads import Roads

REACH: Final = 8.0
"""Lanes within this distance are found by the grid [m]: all places on roads are so near to the line of a lane. For
others all lanes are searched."""

CELL: Final = 8.0
"""Side of a cell of the grid [m]: then a cell on a road of four lanes has about 100 segments of a metre."""

BEYOND: Final = 20.0
"""The plane of a lane goes on for this length beyond its edges and its ends [m]. A slope of 10 % rises 2 m there."""

ROUNDING: Final = 2.0
"""The slope changes within this distance of a point of a lane's line [m], less than the wheelbase of a car."""

LOWEST: Final = -1e5
"""Height that stands for none given [m]: below all roads, so the lowest one is the nearest."""


class Ground(Record, eq=False):
    """The ground at some places; (n,) each.

    Attributes:
        height: [m].
        east, north: rise for each metre to the east and to the north.
    """

    height: FloatArray
    east: FloatArray
    north: FloatArray

    def first(self, num: int) -> Ground:
        """Return the ground at the first places alone."""
        return Ground(self.height[:num], self.east[:num], self.north[:num])


class Surface:
    """The surface of one map; get it by `roads.derived(Surface)`.

    Args:
        roads: at least one lane.
    """

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        segments = roads.segments
        low, high = np.minimum(segments.start, segments.end), np.maximum(segments.start, segments.end)
        self._grid = BlockGrid(low, high, REACH, CELL)
        self._is_first = np.diff(segments.lane, prepend=-1) != 0
        self._is_last = np.diff(segments.lane, append=-1) != 0
        self._bank_at_start = roads.bank[segments.point]
        self._bank_change = roads.bank[segments.point + 1] - self._bank_at_start
        # Half of the change of slope at both ends of each segment; none at the ends of a lane.
        half = 0.5 * np.diff(segments.slope, append=0.0)
        half[self._is_last] = 0.0
        self._slope_at_end = half
        self._slope_at_start = -np.concatenate([[0.0], half[:-1]])

    def find(self, x: FloatArray, y: FloatArray, z: FloatArray | None = None) -> Ground:
        """Return the ground at places.

        Args:
            x: (n,) east [m].
            y: (n,) north [m].
            z: (n,) heights, which choose between a bridge and the road below it; None for the lowest road [m].
        """
        place = in_columns(x, y)
        z = np.full(len(place), LOWEST) if z is None else z
        ground = self._find_near(place, z)
        # A height from elsewhere has chosen the road; the nearest place on that road is that at its own height.
        far = (np.abs(ground.height - z) > SAME_HEIGHT).nonzero()[0]
        if len(far):
            again = self._find_near(place[far], ground.height[far])
            ground.height[far], ground.east[far], ground.north[far] = again.height, again.east, again.north
        return ground

    def _find_near(self, place: FloatArray, z: FloatArray) -> Ground:
        """Return the ground at places (n, 2) by the segments that are nearest to them and to the heights (n,)."""
        segments = self._roads.segments
        chosen = np.full(len(place), -1, dtype=np.int64)
        owner, segment = self._grid.find(place)
        if len(owner):
            along, lateral, distance = segments.project(place[owner], segment)
            is_near = (distance <= REACH).nonzero()[0]
            owner, segment, along, lateral = owner[is_near], segment[is_near], along[is_near], lateral[is_near]
            height = segments.height[segment] + along * segments.slope[segment]
            height += self._rise_across(segment, along, lateral)
            score = distance[is_near] + height_cost(np.abs(height - z[owner]))
            found = np.bincount(owner, minlength=len(place)).nonzero()[0]
            if len(found):
                owner = found.searchsorted(owner)
                chosen[found] = segment[first_least(score, owner, owner.searchsorted(np.arange(len(found))))]
        far = (chosen < 0).nonzero()[0]
        if len(far):
            chosen[far] = self._roads.find_segments(place[far], z[far])
        return self._measure(place, chosen)

    def find_on_lanes(self, point: IntArray, lane: IntArray, arc: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the slope of the ground on the lines of lanes.

        Args:
            point: (n,) int64, rows of the points of the roads before each place.
            lane: (n,) int64, rows of the lanes.
            arc: (n,) arc lengths on them [m].

        Returns:
            (n,) rise along the lane and (n,) to its left, for each metre.
        """
        segment = point - lane
        along = np.fmin(np.fmax(arc - self._roads.s[point], 0.0), self._roads.segments.length[segment])
        left, right = self._bank(segment, along)
        return self._slope(segment, along), 0.5 * (left + right)

    def _measure(self, place: FloatArray, segment: IntArray) -> Ground:
        """Return the ground at places (n, 2) by the segments (n,) that have been chosen for them."""
        segments = self._roads.segments
        along, lateral, _ = segments.project(place, segment)
        direction, away = segments.direction[segment], place - segments.start[segment]
        beyond = away[:, 0] * direction[:, 0] + away[:, 1] * direction[:, 1] - along
        is_open = np.where(beyond < 0.0, self._is_first[segment], self._is_last[segment])
        beyond = np.where(is_open, beyond, 0.0)
        slope, across = self._slope(segment, along), self._bank(segment, along)
        height = segments.height[segment] + along * segments.slope[segment]
        height += np.fmin(np.fmax(beyond, -BEYOND), BEYOND) * slope
        height += self._rise_across(segment, along, lateral)
        bank = 0.5 * (across[0] + across[1])
        slope = np.where(np.abs(beyond) < BEYOND, slope, 0.0)
        bank = np.where(np.abs(lateral) < BEYOND, bank, 0.0)
        east = slope * direction[:, 0] - bank * direction[:, 1]
        north = slope * direction[:, 1] + bank * direction[:, 0]
        return Ground(height, east, north)

    def _slope(self, segment: IntArray, along: FloatArray) -> FloatArray:
        """Return the slope along segments (n,) at distances (n,) from their starts [m]."""
        segments = self._roads.segments
        length = segments.length[segment]
        span = np.fmin(0.5 * length, ROUNDING)
        near_start, near_end = np.fmax(1.0 - along / span, 0.0), np.fmax(1.0 - (length - along) / span, 0.0)
        bend = near_start * self._slope_at_start[segment] + near_end * self._slope_at_end[segment]
        return np.asarray(segments.slope[segment] + bend)

    def _bank(self, segment: IntArray, along: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the bank of the left and of the right half of the lane, (n,) each."""
        share = along / self._roads.segments.length.take(segment)
        bank = self._bank_at_start.take(segment, axis=0)
        bank += share[:, None] * self._bank_change.take(segment, axis=0)
        return bank[:, 0], bank[:, 1]

    def _rise_across(self, segment: IntArray, along: FloatArray, lateral: FloatArray) -> FloatArray:
        """Return how far the ground is above the line of the lane beside it, (n,) [m]."""
        left, right = self._bank(segment, along)
        return np.fmin(np.fmax(lateral, -BEYOND), BEYOND) * np.where(lateral > 0.0, left, right)

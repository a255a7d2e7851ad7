"""Facts about lanes beside one another that lane changes need; worked out once for each map.

A map says into which lanes one may change. The places beside one another follow from the geometry: a lane beside may
begin later or end earlier.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, is_among, nearest_on_polyline
from rosbridge_sim.world.roads.lane_conflicts import make_links
from rosbridge_sim.world.roads.roads import Roads

LEFT, RIGHT = 0, 1
"""Sides, as indices. The columns `signal` and `leaving` have these plus 1."""

NUM_SIDES: Final = 2

NEAREST, FARTHEST = 1.5, 8.0
"""Lines of lanes beside one another are this far apart [m]. Nearer ones join; farther ones are apart."""

BEYOND: Final = 1.5
"""A place that is farther than this beyond the end of the lane beside is not beside it [m]."""

PARALLEL: Final = 0.9
"""Cosine of the greatest angle between lanes beside one another, 26 deg: more is no lane change."""

MAX_BESIDE: Final = 32
"""Lanes beside one another, at most: some map may have them in a ring."""

KEEP_RIGHT_FROM: Final = 70.0 / 3.6
"""Drivers keep right on roads with at least this limit [m/s], if one may change between all of their lanes. On slower
roads they choose their lane as they like, as most traffic codes have it for towns."""

ROUNDING: Final = 1e-3
"""Limits come in km/h, so the bound above is not met exactly [m/s]."""


class LaneNeighbours:
    """The facts for one map; get them by `roads.derived(LaneNeighbours)`.

    Attributes:
        is_any: whether one may change lanes anywhere.
        beside: (2, l) int64, rows of the lanes to the left and to the right; -1 for none. If the map names one lane as
            the neighbour of another, both are beside each other.
        may: (2, l) bool, one may change to that side.
        has_side: (l,) bool, one may change to any side.
        across: (2, n) for each point of the roads the arc length of the place beside it; nan where there is none [m].
        merge_side: (l,) int64, of a lane that ends while others beside it go on, the side of these plus 1; else 0.
        group: (l,) int64, the same number for lanes beside one another.
        place: (l,) int64, number of lanes to the right.
        keeps_right: (l,) bool, drivers keep right here.
        before: for each lane those that lead to it. The numbers mean nothing.
    """

    def __init__(self, roads: Roads) -> None:
        self.roads = roads
        named = np.stack((roads.left, roads.right))
        self.may = named >= 0
        self.has_side: BoolArray = self.may[LEFT] | self.may[RIGHT]
        self.is_any = bool(self.has_side.any())
        self.beside = named.copy()
        for side in range(NUM_SIDES):
            back = self.beside[1 - side]
            lanes = np.flatnonzero(named[side] >= 0)
            others = named[side, lanes]
            is_new = back[others] < 0
            back[others[is_new]] = lanes[is_new]
        self.across = np.full((NUM_SIDES, len(roads.points)), np.nan)
        for side in range(NUM_SIDES):
            for lane in np.flatnonzero(self.beside[side] >= 0).tolist():
                self._measure(side, lane)
        self.group, self.place = self._groups()
        self.before = make_links(len(roads), roads.successor, roads.predecessor)
        self.merge_side = self._merge_sides(np.diff(roads.first_successor) > 0)
        is_fast = roads.speed_limit >= KEEP_RIGHT_FROM - ROUNDING
        is_free = (self.beside < 0) | self.may
        refuses = ~(is_fast & is_free.all(axis=0))
        self.keeps_right = ~is_among(self.group, self.group[refuses])

    def cross(self, side: IntArray, lane: IntArray, s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the lanes beside given places, and the places there.

        Args:
            side: (k,) int64, `LEFT` or `RIGHT`.
            lane: (k,) int64, rows of lanes.
            s: (k,) arc lengths [m].

        Returns:
            (k,) int64, rows of lanes, -1 where no lane is beside the place; and (k,) arc lengths on them, else 0 [m].
        """
        point, share = self.roads.locate(lane, s)
        start, end = self.across[side, point], self.across[side, point + 1]
        there = start + share * (end - start)
        is_good = ~np.isnan(there)
        return np.where(is_good, self.beside[side, lane], -1), np.where(is_good, there, 0.0)

    def _measure(self, side: int, lane: int) -> None:
        """Write the places beside one lane."""
        roads, other = self.roads, int(self.beside[side, lane])
        rows = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
        line = roads.points[rows]
        near = nearest_on_polyline(roads.points[roads.first[other] : roads.first[other + 1]], line[:, 0], line[:, 1])
        foot, yaw = roads.at(np.full(len(line), other), near.arc)
        _, own_yaw = roads.at(np.full(len(line), lane), roads.s[rows])
        apart = line[:, :2] - foot[:, :2]
        along = apart[:, 0] * np.cos(yaw) + apart[:, 1] * np.sin(yaw)
        left = apart[:, 1] * np.cos(yaw) - apart[:, 0] * np.sin(yaw)
        across = -left if side == LEFT else left
        is_good = (across > NEAREST) & (across < FARTHEST) & (np.abs(along) < BEYOND)
        is_good &= np.cos(own_yaw - yaw) > PARALLEL
        self.across[side, rows] = np.where(is_good, near.arc, np.nan)

    def _groups(self) -> tuple[IntArray, IntArray]:
        """Return `group` and `place`."""
        group = np.arange(len(self.roads), dtype=np.int64)
        place = np.zeros(len(group), dtype=np.int64)
        at = group.copy()
        for _ in range(MAX_BESIDE):
            lowest = group.copy()
            for beside in self.beside:
                has = beside >= 0
                np.minimum.at(lowest, np.flatnonzero(has), group[beside[has]])
            if (lowest == group).all():
                break
            group = lowest
        for _ in range(MAX_BESIDE):
            right = np.where(at >= 0, self.beside[RIGHT, at], -1)
            place += right >= 0
            at = right
            if (at < 0).all():
                break
        return group, place

    def _merge_sides(self, goes_on: BoolArray) -> IntArray:
        """Return `merge_side`; `goes_on` is (l,), the lane has a successor."""
        found = np.zeros(len(goes_on), dtype=np.int64)
        at = [np.arange(len(goes_on), dtype=np.int64)] * NUM_SIDES
        for _ in range(MAX_BESIDE):
            for side in range(NUM_SIDES):
                may = (at[side] >= 0) & self.may[side, at[side]]
                at[side] = np.where(may, self.beside[side, at[side]], -1)
                is_found = (found == 0) & ~goes_on & (at[side] >= 0) & goes_on[at[side]]
                found[is_found] = side + 1
            if all((lanes < 0).all() for lanes in at):
                break
        return found

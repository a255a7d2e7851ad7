"""The area of the roads, for kerbs, ground and all that stands beside roads."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.roads import LanePlaces, Roads
from rosbridge_sim.world.roads.surface import Surface

AT_ONCE: Final = 500
"""Places that are looked at in one search: crowds of more are thinned out by it."""

_PLACE_FIELDS: Final = ("lane", "s", "lateral", "distance", "yaw")


class RoadCover:
    """The area of all lanes of a map."""

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        self.widest = float(roads.border.max(initial=1.75))

    def lanes_at(self, points: FloatArray, margin: float = 0.0) -> tuple[IntArray, LanePlaces]:
        """Return the lanes that cover places.

        Args:
            points: (n, 3); lanes on another level do not count [m].
            margin: lanes count as so much wider, and longer at both ends [m].

        Returns:
            (m,) int64 rows of the points, rising, and (m,) places on the lanes.
        """
        owners, lanes = [np.zeros(0, dtype=np.int64)], []
        reach = self.widest + margin
        for first in range(0, len(points), AT_ONCE):
            part = points[first : first + AT_ONCE]
            owner, places = self._roads.within(part[:, 0], part[:, 1], np.full(len(part), reach))
            left, right = self._roads.beside(places)
            beyond = np.sqrt(np.maximum(places.distance**2 - places.lateral**2, 0.0))
            is_in = (left > -margin) & (right > -margin) & (beyond <= margin)
            is_in &= self._roads.are_level(places, part[owner, 2])
            owners.append(first + owner[is_in])
            lanes.append([getattr(places, each)[is_in] for each in _PLACE_FIELDS])
        columns = [np.concatenate(column) for column in zip(*lanes, strict=True)] or [np.zeros(0)] * len(_PLACE_FIELDS)
        return np.concatenate(owners), LanePlaces(*columns)

    def is_on(self, points: FloatArray, margin: float = 0.0) -> BoolArray:
        """Return which places are on a lane, or nearer than a margin to one, (n,).

        Args:
            points: (n, 3); lanes on another level do not count [m].
            margin: [m].
        """
        found = np.zeros(len(points), dtype=bool)
        found[self.lanes_at(points, margin)[0]] = True
        return found

    def distance(self, points: FloatArray) -> FloatArray:
        """Return how far places are from the nearest lane's edge at least, (n,) [m]; negative on a lane.

        Args:
            points: (n, 2 or more) [m].
        """
        places = self._roads.nearest(points[:, 0], points[:, 1])
        return np.asarray(places.distance - self.widest)

    def height(self, points: FloatArray) -> FloatArray:
        """Return the height of the ground by the nearest lane, (n,) [m].

        Args:
            points: (n, 2 or 3); heights choose between a bridge and the road below it, which counts without them [m].
        """
        if self._roads.is_flat:
            return np.full(len(points), self._roads.points[0, 2] if len(self._roads.points) else 0.0)
        return self._roads.derived(Surface).find(*np.ascontiguousarray(points.T)).height

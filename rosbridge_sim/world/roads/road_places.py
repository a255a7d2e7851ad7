"""Places on roads by coordinates: the nearest lane, the place on a given lane, and whether a point is on a road."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.roads.roads import LanePlaces, Roads

MAX_EDGE: Final = 20.0
"""No edge of a lane is farther from its line [m]: readers of maps take a farther one for that of another lane."""

MAX_BEYOND_END: Final = 0.5
"""A place at most this far beyond the end of a lane is still on it [m]: lines of maps end a little early."""


class LanePlace(Record):
    """The place of one point on a lane.

    Attributes:
        lane: row of the lane.
        s: arc length from the lane's start to the foot point [m].
        lateral: offset from the lane's line, left positive [m].
        distance: from the point to the foot point [m].
        yaw: direction of the lane there, (-pi, pi] [rad].
    """

    lane: int
    s: float
    lateral: float
    distance: float
    yaw: float


def find_lane(roads: Roads, x: float, y: float, yaw: float | None = None, z: float | None = None) -> LanePlace | None:
    """Return the place on the lane nearest to a point.

    Args:
        x: east, finite [m].
        y: north, finite [m].
        yaw: heading; lanes of another direction then count as farther away, see `Roads.nearest` [rad]. None compares
            distances alone.
        z: height, which tells a bridge from the road below it [m]. None for any.

    Returns:
        The place; None where the map has no lanes.
    """
    if not len(roads):
        return None
    return _pick(roads.nearest(x, y, yaw, z), 0)


def place_on_lane(roads: Roads, lane: int, x: float, y: float, reach: float) -> LanePlace | None:
    """Return the place of a point on a given lane.

    Args:
        lane: row of the lane.
        x: east, finite [m].
        y: north, finite [m].
        reach: how far from the lane's line the point may be [m].

    Returns:
        The place; None where the point is farther away, or beyond the ends of the lane.
    """
    _, places = roads.within(np.array([x]), np.array([y]), np.array([reach]))
    found = np.flatnonzero(places.lane == lane)
    return _pick(places, int(found[0])) if len(found) else None


def is_on_road(roads: Roads, x: float, y: float) -> bool:
    """Return whether a point is between the edges of any lane.

    Args:
        x: east, finite [m].
        y: north, finite [m].
    """
    _, places = roads.within(np.array([x]), np.array([y]), np.array([MAX_EDGE]))
    if not len(places.lane):
        return False
    to_left, to_right = roads.beside(places)
    is_beside = places.distance - np.abs(places.lateral) <= MAX_BEYOND_END
    return bool((is_beside & (to_left >= 0.0) & (to_right >= 0.0)).any())


def _pick(places: LanePlaces, i: int) -> LanePlace:
    return LanePlace(
        lane=int(places.lane[i]),
        s=float(places.s[i]),
        lateral=float(places.lateral[i]),
        distance=float(places.distance[i]),
        yaw=float(places.yaw[i]),
    )

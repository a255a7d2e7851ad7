"""Joins of a map: where two lanes become one at a small angle, and the lanes that lead there; see `zip_merge`."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.roads.roads import Roads

MAX_ANGLE: Final = np.radians(20.0)
"""Lanes that meet at a greater angle are those of an intersection [rad]; an entry of a motorway has 2 to 5 degrees."""

APPROACH: Final = 250.0
"""Length before a join within which drivers look out for those on the other lane [m]: 8 s at 30 m/s."""

AT_END: Final = 5.0
"""Two lanes are together at their ends if the stretch where they are near ends so far before them at most [m]."""


class Joins(Record, eq=False):
    """The joins of a map.

    Attributes:
        join: (l,) int64, the join that a lane leads to, and to no other place; -1 for none.
        side: (l,) int64, 0 or 1: on which of its two lanes, or before which.
        to_join: (l,) from the end of the lane to the join [m].
        shared: (j,) length before the join on which the two lanes are too near for two vehicles side by side [m].
        lanes: (j, 2) int64, rows of the two lanes.
        narrow_from: (l,) arc length from which a lane shares its room with the other one; inf for all other lanes [m].
        num_in_map: joins of one world, of many worlds; 0 for those of a map.
    """

    join: IntArray
    side: IntArray
    to_join: FloatArray
    shared: FloatArray
    lanes: IntArray
    narrow_from: FloatArray
    num_in_map: int = 0


def find_joins(  # noqa: PLR0917 - columns of the pairs of near lanes
    roads: Roads,
    gives_way: BoolArray,
    lane: IntArray,
    other: IntArray,
    from_s: FloatArray,
    to_s: FloatArray,
    other_to_s: FloatArray,
) -> Joins:
    """Return the joins of a map.

    Args:
        gives_way: (l,) which lanes have a stop line before them; they keep to the right of way.
        lane: (k,) int64, rows of lanes that come near others, each pair in both orders.
        other: (k,) int64, rows of the others.
        from_s: (k,) arc length on `lane` from which they are near [m].
        to_s: (k,) arc length on `lane` up to which they are near [m].
        other_to_s: (k,) arc length on `other` up to which they are near [m].
    """
    num = len(roads)
    count = np.diff(roads.first_successor)
    has_one = count == 1
    successor = np.full(num, -1, dtype=np.int64)
    successor[has_one] = roads.successor[roads.first_successor[:-1][has_one]]
    num_before = np.bincount(roads.successor, minlength=num)
    is_pair = (lane < other) & has_one[lane] & (successor[lane] == successor[other])
    is_pair &= (num_before[successor[lane]] == 2) & ~gives_way[lane] & ~gives_way[other]  # noqa: PLR2004 - those two
    is_pair &= (to_s > roads.length[lane] - AT_END) & (other_to_s > roads.length[other] - AT_END)
    at = np.flatnonzero(is_pair)
    shared = roads.length[lane[at]] - from_s[at]
    turn = roads.at(lane[at], from_s[at])[1] - roads.at(other[at], roads.length[other[at]] - shared)[1]
    is_flat = np.abs(wrap_angle(turn)) < MAX_ANGLE
    at, shared = at[is_flat], shared[is_flat]
    lanes = np.stack([lane[at], other[at]], axis=1)
    join, side, to_join = np.full(num, -1, dtype=np.int64), np.zeros(num, dtype=np.int64), np.zeros(num)
    before = np.full(num, -1, dtype=np.int64)
    with_one = np.flatnonzero(has_one & (num_before[successor] == 1))
    before[successor[with_one]] = with_one
    for number, pair in enumerate(lanes):
        for which, last in enumerate(pair):
            here, distance = int(last), 0.0
            while here >= 0 and distance < APPROACH and join[here] < 0:
                join[here], side[here], to_join[here] = number, which, distance
                distance += float(roads.length[here])
                here = int(before[here])
    narrow_from = np.full(num, np.inf)
    narrow_from[lanes] = roads.length[lanes] - shared[:, None]
    return Joins(join, side, to_join, shared, lanes, narrow_from)

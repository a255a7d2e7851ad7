"""Turn signals of drivers on lanes: for lane changes, and before and in turns at intersections.

Those for turns follow from the lanes ahead, so they are no state, and they cost nothing where nobody looks at them.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.lane_change_map import LEFT, RIGHT
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

TURN: Final = math.radians(30.0)
"""A lane of an intersection that turns by more than this is a turn. Where a road goes on, few bend as much."""

SIGNAL_WAY, SIGNAL_TIME = 30.0, 3.0
"""A driver signals from this way [m], or this time at its present speed [s], before the turn, whichever is more. 30 m
is what the traffic acts of Korea and Japan demand, and 3 s are four blinks on faster roads."""


def find_turn_signals(world: WorldRows, rows: IntArray) -> IntArray:
    """Return the turn signals of entities: 0 none, 1 left, 2 right; those of lane changes come first.

    Only vehicles that follow lanes have any: the lamps of an ego are commanded.

    Args:
        world: read only.
        rows: (k,) int64.

    Returns:
        (k,) int64.
    """
    signals: IntArray = world.signal[rows]  # a copy
    which = (world.has_lane[rows] & (world.kind[rows] == Kind.VEHICLE) & (signals == 0)).nonzero()[0]
    if not len(which):
        return signals
    sides, length = world.roads.derived(_turn_sides), world.roads.length
    at = rows[which]
    distance = -(world.arc[at] + world.half_length[at] + world.centre[at])  # from the bumper to the start of the lane
    reach = np.fmax(SIGNAL_WAY, SIGNAL_TIME * world.speed[at])
    found = np.zeros(len(which), dtype=np.int64)
    for lane in world.int_block("lane", "ahead_5")[:, at]:
        is_next = (found == 0) & (lane >= 0) & (distance < reach)
        found = np.where(is_next, sides[lane], found)
        distance = distance + length[lane]
    signals[which] = found
    return signals


def _turn_sides(roads: Roads) -> IntArray:
    """Return for each lane the side to which it turns at an intersection, as in the column `signal`, (l,) int64.

    A lane is at an intersection if it crosses or joins another one, or if it forks from another one.
    """
    conflicts = roads.derived(LaneConflicts)
    is_turn = (np.abs(roads.turn) > TURN) & (np.isfinite(conflicts.wait_point) | (conflicts.shared > 0.0))
    return np.where(is_turn, np.where(roads.turn > 0.0, LEFT + 1, RIGHT + 1), 0)

"""Intruders: vehicles that drive through an intersection without the right of way, as an ego that runs a red light.

Drivers with a claim do not look out for rivals, because nobody else gets one. An ego asks for no claim. So a driver in
or before an intersection looks for vehicles that follow no lanes and drive on a rival lane, or will, because they are
too fast to stop before it. If both would be near each other at the same time, and a stop is still possible, the driver
stops before the place where the lanes meet.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import FIRM, Perception
from rosbridge_sim.world.drivers.driver_parameters import HEAVY_LENGTH
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries
from rosbridge_sim.world.drivers.right_of_way import find_entered
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, ranges
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts

MOVES: Final = 0.5
"""An intruder drives along the lane faster than this [m/s]; one that stands is an obstacle."""

EMERGENCY: Final = 7.0
"""The hardest braking that a driver expects to reach [m/s^2]; if a stop needs more, the driver goes on, since it would
come to a stand in the intruder's way."""

MARGIN: Final = 1.5
"""Both are apart in time if one leaves the shared place this long before the other comes [s]. It covers an intruder
that brakes or accelerates."""

LEAST_SPEED: Final = 2.0
"""Times to a place are estimated with at least this speed [m/s], so that a driver who has just started counts."""


def stop_for_intruders(conflicts: LaneConflicts, drivers: Drivers, perception: Perception, moving: Entries) -> IntArray:
    """Have drivers with a claim or a hold stop for intruders on rival lanes.

    Args:
        drivers: after claims were given.
        perception: `stop_distance` is written.
        moving: entries of the vehicles that do not follow lanes and move.

    Returns:
        (k,) int64, for each driver an entry in `moving` that it stops for; -1 for none.
    """
    gives_way = np.full(len(drivers.arc), -1, dtype=np.int64)
    who, lane, tail, nose, speed = _intruders(conflicts, moving)
    if not len(lane):
        return gives_way
    index, link = conflicts.rivals.of(lane)
    if not len(link):
        return gives_way
    mine = np.concatenate([drivers.claim, drivers.held])
    order = np.argsort(mine, kind="stable")
    mine = mine[order]
    begin = np.searchsorted(mine, conflicts.rivals.other[link])
    count = np.searchsorted(mine, conflicts.rivals.other[link], side="right") - begin
    pair = np.repeat(np.arange(len(link)), count)
    at = order[ranges(begin, count)]
    driver, is_held = at % len(drivers.arc), at >= len(drivers.arc)
    index, link = index[pair], link[pair]
    # Where cars pass each other, only long vehicles are in the way.
    counts = ~conflicts.rival_passes[link] | (drivers.length[driver] > HEAVY_LENGTH)
    counts |= (nose - tail)[index] > HEAVY_LENGTH
    driver, is_held, index, link = driver[counts], is_held[counts], index[counts], link[counts]
    back = conflicts.rival_back[link]
    # Places on the driver's lane, from its bumper; and on the intruder's lane, from its own.
    ahead = _distance_to(conflicts, drivers, driver, conflicts.rivals.other[link], is_held=is_held)
    enter, leave = ahead + conflicts.rival_from[back], ahead + conflicts.rivals.figure[link]
    own_speed = np.fmax(drivers.speed[driver], LEAST_SPEED)
    comes = (conflicts.rival_from[link] - nose[index]) / speed[index]
    goes = (conflicts.rivals.figure[back] - tail[index]) / speed[index]
    is_near = (goes > 0.0) & (enter / own_speed < goes + MARGIN)
    is_near &= comes < (leave + drivers.length[driver]) / own_speed + MARGIN
    can_stop = np.square(drivers.speed[driver]) < 2.0 * EMERGENCY * enter
    stops = is_near & can_stop
    np.minimum.at(perception.stop_distance, driver[stops], enter[stops])
    gives_way[driver[stops]] = who[index[stops]]
    return gives_way


def _intruders(
    conflicts: LaneConflicts, moving: Entries
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """Return intruders: indices of entries, lanes, and there tails and noses [m] and speeds [m/s]; (m,) each.

    A place before the start of the lane is negative.
    """
    roads = conflicts.roads
    at = (moving.speed > MOVES).nonzero()[0]
    lane, tail, speed = moving.lane[at], moving.tail[at], moving.speed[at]
    nose = 2.0 * moving.s[at] - tail
    to_end = roads.length[lane] - nose
    index, link = conflicts.onward.of(lane)
    is_coming = np.square(speed[index]) > 2.0 * FIRM * np.fmax(to_end[index], 0.0)
    index, link = index[is_coming], link[is_coming]
    length = roads.length[lane[index]]
    return (
        np.concatenate([at, at[index]]),
        np.concatenate([lane, conflicts.onward.other[link]]),
        np.concatenate([tail, tail[index] - length]),
        np.concatenate([nose, nose[index] - length]),
        np.concatenate([speed, speed[index]]),
    )


def _distance_to(
    conflicts: LaneConflicts, drivers: Drivers, driver: IntArray, lane: IntArray, *, is_held: BoolArray
) -> FloatArray:
    """Return the distances from bumpers to the starts of lanes that drivers claim or hold, (m,) [m]."""
    lanes, length = drivers.lanes.take(driver, axis=1), conflicts.roads.length
    ahead = -(drivers.arc[driver] + drivers.nose[driver])
    # The tail is still on a lane that the reference point has left, or only the nose is on it.
    is_behind = is_held & (lanes[0] != lane) & (find_entered(conflicts.roads, lanes, -ahead, lane) == 0)
    distance = np.where(is_behind, ahead - length[lane], np.inf)
    for here in lanes:
        distance = np.where(np.isinf(distance) & (here == lane), ahead, distance)
        ahead = ahead + length[here]  # beyond a dead end it is asked for no more
    return np.where(np.isinf(distance), -np.inf, distance)

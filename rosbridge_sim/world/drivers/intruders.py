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
        (k,) int64, for each driver the entry in `moving` that it stops for: that of the nearest place, and there the
        one that comes first; -1 for none.
    """
    gives_way = np.full(len(drivers.arc), -1, dtype=np.int64)
    who, lane, tail, nose, speed = _intruders(conflicts, moving)
    if not len(lane):
        return gives_way
    index, link = conflicts.rivals.of(lane)
    comes = (conflicts.rival_from[link] - nose[index]) / speed[index]
    goes = (conflicts.rivals.figure[conflicts.rival_back[link]] - tail[index]) / speed[index]
    at = (goes > 0.0).nonzero()[0]
    if not len(at):
        return gives_way
    index, link, comes, goes = index[at], link[at], comes[at], goes[at] + MARGIN
    is_used = np.zeros(len(conflicts.rivals.other), dtype=np.bool_)
    is_used[link] = True
    used = is_used.nonzero()[0]
    mine = np.concatenate([drivers.claim, drivers.held])
    order = mine.argsort(kind="stable")
    mine = mine[order]
    begin = mine.searchsorted(conflicts.rivals.other[used])
    count = mine.searchsorted(conflicts.rivals.other[used], side="right") - begin
    pair = np.repeat(used, count)
    if not len(pair):
        return gives_way
    at = order[ranges(begin, count)]
    driver, is_held = at % len(drivers.arc), at >= len(drivers.arc)
    length = drivers.length[driver]
    # Places on the driver's lane, from its bumper.
    ahead = _distance_to(conflicts, drivers, driver, conflicts.rivals.other[pair], is_held=is_held)
    enter = ahead + conflicts.rival_from[conflicts.rival_back[pair]]
    leave = ahead + conflicts.rivals.figure[pair]
    own_speed = np.fmax(drivers.speed[driver], LEAST_SPEED)
    # Where cars pass each other, only long vehicles are in the way: a car looks among these, 2 * link, and all others
    # among all, 2 * link + 1.
    is_long = ((nose - tail)[index] > HEAVY_LENGTH).nonzero()[0]
    row = np.concatenate([is_long, np.arange(len(index))])
    group = 2 * link[row] + (np.arange(len(row)) >= len(is_long))
    sees_all = ~conflicts.rival_passes[pair] | (length > HEAVY_LENGTH)
    first = _first_to_come(group, goes[row], comes[row], 2 * pair + sees_all, enter / own_speed)
    found = row[first]
    can_stop = np.square(drivers.speed[driver]) < 2.0 * EMERGENCY * enter
    stops = ((first >= 0) & (comes[found] < (leave + length) / own_speed + MARGIN) & can_stop).nonzero()[0]
    stops = stops[np.argsort(-enter[stops], kind="stable")]  # the nearest place is written last
    np.minimum.at(perception.stop_distance, driver[stops], enter[stops])
    gives_way[driver[stops]] = who[index[found[stops]]]
    return gives_way


def _first_to_come(
    group: IntArray, goes: FloatArray, comes: FloatArray, of_group: IntArray, enters: FloatArray
) -> IntArray:
    """Return for each search the row of its group that comes first of those that go after it enters; -1 for none.

    The cost grows with n log n, not with rows times searches: a crowd before a crossing may be as large as a snapshot.

    Args:
        group: (n,) group of each row.
        goes, comes: (n,) times [s].
        of_group: (k,) group of each search.
        enters: (k,) times [s].

    Returns:
        (k,) int64.
    """
    num, sorted_goes = len(group), np.sort(goes)
    key = group * (num + 1) + sorted_goes.searchsorted(goes)
    by_key = key.argsort(kind="stable")
    at = key[by_key].searchsorted(of_group * (num + 1) + sorted_goes.searchsorted(enters, side="right"))
    # The least rank of `comes` from each row to the end of its group: greater groups have greater numbers.
    by_comes = comes.argsort(kind="stable")
    rank = np.empty(num, dtype=np.int64)
    rank[by_comes] = np.arange(num)
    least = np.minimum.accumulate((group * num + rank)[by_key][::-1])[::-1] % num
    inside = np.fmin(at, num - 1)
    is_found = (at < num) & (group[by_key[inside]] == of_group)
    return np.where(is_found, by_comes[least[inside]], -1)


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

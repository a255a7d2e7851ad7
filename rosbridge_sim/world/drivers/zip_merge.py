"""Joins: two lanes that become one at a small angle, as an entry and the right lane of a motorway.

A right of way for the whole stretch in which they are side by side would let a few vehicles a minute pass. So drivers
on both lanes are put into one order, by the distance of their front bumpers from the join, and each one follows the
vehicle before it in this order, too (virtual vehicles, Uno, Sakaguchi, Tsugawa 1999). It gives a zip merge by itself.

Far from the place where the lanes come near each other, the gap to the vehicle on the other lane counts as larger, by
`EASE` for each metre, and braking is firm at most. So drivers open gaps little by little, and a queue on one lane does
not hold up the other one.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import CREEP, FIRM, HARDEST, gap_wanted, keep_gap
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts

EASE: Final = 0.2
"""Addition to the gap for each metre before the stretch that both lanes share. Found on the map `motorway`: with less,
drivers brake for those far away; with more, they open their gaps too late."""

_APART: Final = 4096.0
"""Difference of the sorting keys of two joins, more than any distance in a join [m]."""


def _keys(join: IntArray, distance: FloatArray, num_in_map: int) -> FloatArray | IntArray:
    """Return sorting keys, (m,): by join, then by distance. Of many worlds they have the order that each alone has."""
    if not num_in_map:
        return np.asarray(join * _APART + distance)
    keys = join % num_in_map * _APART + distance
    rank = np.unique(keys, return_inverse=True)[1]
    return np.asarray(join // num_in_map * (len(keys) + 1) + rank)


def follow_in_joins(conflicts: LaneConflicts, drivers: Drivers, moving: Entries, accel: FloatArray) -> FloatArray:
    """Have drivers before a join follow those on the other lane that will be there first.

    Args:
        moving: entries of the vehicles that do not follow lanes and move.
        accel: (k,) that the drivers chose without regard to joins [m/s^2].

    Returns:
        (k,) accelerations that regard them, not above `accel` [m/s^2].
    """
    joins = conflicts.joins
    lane = drivers.lanes[0]
    own = (joins.join[lane] >= 0).nonzero()[0]
    if not len(own):
        return accel
    num = len(own)
    other = ((moving.source < 0) & (joins.join[moving.lane] >= 0)).nonzero()[0]
    lane = np.concatenate([lane[own], moving.lane[other]])
    place = np.concatenate([drivers.arc[own], moving.s[other]])
    tail = np.concatenate([drivers.arc[own] - drivers.rear[own], moving.tail[other]])
    nose = np.concatenate([drivers.arc[own] + drivers.nose[own], (2.0 * moving.s - moving.tail)[other]])
    speed = np.concatenate([drivers.speed[own], moving.speed[other]])
    to_join = joins.to_join[lane] + conflicts.roads.length[lane]
    join, side = joins.join[lane], joins.side[lane]
    key = _keys(join, to_join - nose, joins.num_in_map)
    lead = np.full(num, -1, dtype=np.int64)
    for this in (0, 1):
        mine, theirs = (side[:num] == this).nonzero()[0], (side != this).nonzero()[0]
        theirs = theirs[np.lexsort((place[theirs], key[theirs]))]
        if not (len(mine) and len(theirs)):
            continue
        before = np.searchsorted(key[theirs], key[mine], side="right" if this else "left") - 1
        found = theirs[np.fmax(before, 0)]
        is_there = (before >= 0) & (join[found] == join[mine])
        lead[mine[is_there]] = found[is_there]
    at = (lead >= 0).nonzero()[0]
    if not len(at):
        return accel
    first, index = lead[at], own[at]
    from_join = (to_join - nose)[at]
    before = from_join - joins.shared[join[at]]
    gap = np.fmax(from_join - (to_join - tail)[first] + EASE * np.fmax(before, 0.0), CREEP)
    closing = drivers.speed[index] - speed[first]
    parameters = drivers.parameters.take(index)
    own_accel, comfort, headway = parameters.accel, parameters.comfort, parameters.headway
    wanted = gap_wanted(ARRAYS, drivers.speed[index], closing, own_accel, comfort, headway)
    braked = keep_gap(ARRAYS, own_accel, wanted, gap)
    chosen = accel.copy()
    chosen[index] = np.fmin(accel[index], np.fmax(braked, np.where(before > 0.0, -FIRM, -HARDEST)))
    return chosen

"""The right of way where lanes cross or join: which driver may enter a lane next.

A driver *claims* a lane before it enters. It asks when the wait point of the lane comes within its braking distance.
It gets the lane if no rival lane is claimed or occupied, and no driver before it asks for a rival. Drivers without a
stop line come before those that wait at one, and then the nearer one comes first. Of equally near ones the one from the
right comes first, and then those that do not turn left: no map tells that it has left-hand traffic. Now and then they
let in a driver that stands at its stop line. So two drivers never meet on rival lanes, with traffic lights or without.
A driver that would have to stop inside, because there is no room behind the lane, does not get it. The same holds if
something stands on the lane, as an ego that broke down.

As long as a driver can still stop comfortably, it asks for its claim again at each decision. So it does not matter who
has asked first, which depends on how early a driver looks ahead. A claim becomes a *hold* when the front bumper passes
the wait point. The hold ends when the tail has left all rivals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import BRAKE_FROM, CREEP, GAP, STOP_GAP, Perception
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries, EntryQueue
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads

SAME_DISTANCE: Final = 1.0
"""Distances are compared in steps of this [m]: at stop lines drivers stand that much apart, but equally near."""

FAR: Final = 1e6
"""Farther than any driver from the lane that it asks for, in steps."""

LEFT_TURN: Final = math.radians(30.0)
"""A lane that turns more to the left is a left turn [rad]."""

ROOM_TIME: Final = 2.0
"""A vehicle that moves leaves room behind itself: its speed times this time counts as free [s]. It is about the time
that the driver behind needs to come there."""


@dataclass(slots=True, eq=False)
class Requests:
    """The lane that each driver needs a claim for next; (k,) each.

    Attributes:
        lane: int64, row of the lane; -1 for none.
        exit_lane: int64, the lane behind it; -1 for none.
        distance: from the front bumper to the wait point of the lane, inf without a lane [m].
        again: bool, the driver had a claim for the lane until now.
    """

    lane: IntArray
    exit_lane: IntArray
    distance: FloatArray
    again: BoolArray

    @staticmethod
    def none(num: int) -> Requests:
        """Return the requests of drivers that need no lane."""
        none = np.full(num, -1, dtype=np.int64)
        return Requests(none, none.copy(), np.full(num, np.inf), np.zeros(num, dtype=bool))


def update_holds(conflicts: LaneConflicts, drivers: Drivers) -> None:
    """Turn claims into holds where the front bumper is past the wait point; end holds where the tail is out.

    Args:
        drivers: `claim` and `held` are written.
    """
    at = ((drivers.claim >= 0) & (drivers.claim == drivers.lanes[0])).nonzero()[0]
    if len(at):
        at = at[drivers.arc[at] + drivers.nose[at] >= conflicts.wait_point[drivers.claim[at]]]
        drivers.held[at], drivers.claim[at] = drivers.claim[at], -1
    at = (drivers.held >= 0).nonzero()[0]
    if not len(at):
        return
    is_out = _tail_on_held_lane(conflicts.roads, drivers, at) > conflicts.clear_point[drivers.held[at]]
    drivers.held[at[is_out]] = -1


def give_claims(
    conflicts: LaneConflicts,
    drivers: Drivers,
    perception: Perception,
    requests: Requests,
    queue: EntryQueue,
    *,
    others: Entries,
    num_moving: int,
) -> None:
    """Give lanes to the drivers that ask, one after another, where no rival is taken. The rest must stop.

    Args:
        drivers: `claim` and `exit_lane` are written.
        perception: `gap` and `lead` are read; `stop_distance`, `is_shut_out` and `is_blocked` are written.
        others: entries of the entities that do not follow lanes.
        num_moving: the first so many of `others` are moving vehicles: they occupy the lanes that they drive on.
    """
    needs = (requests.lane >= 0).nonzero()[0]
    if not len(needs):
        return
    # A driver asks before it would begin to brake, so that it need not brake if it gets the lane.
    speed, distance, lead = drivers.speed[needs], requests.distance[needs], perception.lead[needs]
    braking_distance = speed * (speed / (2.0 * BRAKE_FROM) + drivers.parameters.headway[needs]) + STOP_GAP + GAP
    # A driver whose lead vehicle waits itself could not use the lane, and would only keep others out.
    is_led = perception.gap[needs] <= distance
    has_claim = (drivers.claim >= 0) | requests.again
    at = needs[(distance < braking_distance) & (~is_led | ((lead >= 0) & has_claim[lead]))]
    # A driver has one claim at a time. A claim for a lane before this one must become a hold first: if it were given up
    # here, the driver would have to stop before a lane that it was about to enter.
    claim = drivers.claim[at]
    at = at[~((claim >= 0) & np.logical_or.reduce(drivers.lanes.take(at, axis=1) == claim))]
    if len(at):
        _give(conflicts, drivers, perception, requests, queue, at, others=others, num_moving=num_moving)
    waits = needs[drivers.claim[needs] != requests.lane[needs]]
    perception.stop_distance[waits] = np.fmin(perception.stop_distance[waits], requests.distance[waits])


def _give(  # noqa: PLR0917 - those of `give_claims`, and who asks
    conflicts: LaneConflicts,
    drivers: Drivers,
    perception: Perception,
    requests: Requests,
    queue: EntryQueue,
    at: IntArray,
    *,
    others: Entries,
    num_moving: int,
) -> None:
    """Give lanes to drivers that ask and may, (k,) int64 indices; see `give_claims`."""
    has_room = _has_room(conflicts, drivers, requests, queue, at)
    perception.is_shut_out[at[~has_room]] = True
    stands = np.zeros(len(conflicts.wait_point), dtype=bool)
    stands[others.lane[others.stands]] = True
    is_free = ~stands[requests.lane[at]]
    perception.is_blocked[at[~is_free]] = True
    at = at[has_room & is_free]
    if not len(at):
        return
    lane = requests.lane[at]
    taken = _taken(conflicts, drivers, others.lane[:num_moving], others.tail[:num_moving])
    rank = np.empty(len(at), dtype=np.int64)
    # Beside a full road without a stop line those at one would never come: now and then each is let in.
    is_let_in = drivers.is_let_in[at] & (drivers.speed[at] < CREEP) & (requests.distance[at] < 2.0 * STOP_GAP)
    distance, yields = requests.distance[at], conflicts.gives_way[lane] & ~is_let_in
    index, link = conflicts.rivals.of(lane)
    rival = conflicts.rivals.other[link]
    place = np.rint(distance / SAME_DISTANCE) + np.where(yields, FAR, 0.0)
    first = np.full(len(conflicts.wait_point), np.inf)
    np.minimum.at(first, lane, place)
    is_second = np.zeros(len(at), dtype=bool)
    is_second[index[(first[rival] == place[index]) & conflicts.rival_right[link]]] = True
    order = np.lexsort((lane, distance, conflicts.roads.turn[lane] > LEFT_TURN, is_second, place))
    rank[order] = np.arange(len(at))
    best = np.full(len(conflicts.wait_point), len(at), dtype=np.int64)
    np.minimum.at(best, lane, rank)
    is_refused = (taken[rival] < conflicts.rivals.figure[link]) | (best[rival] < rank[index])
    stands[drivers.held[(drivers.held >= 0) & (drivers.speed < CREEP)]] = True
    perception.is_blocked[at[index[stands[rival]]]] = True
    given = at[np.bincount(index[is_refused], minlength=len(at)) == 0]
    drivers.claim[given], drivers.exit_lane[given] = requests.lane[given], requests.exit_lane[given]


def _tail_on_held_lane(roads: Roads, drivers: Drivers, at: IntArray) -> FloatArray:
    """Return the arc lengths of the tails of some drivers on the lanes that they hold, (k,) [m]."""
    is_on = drivers.lanes[0][at] == drivers.held[at]
    before = np.where(is_on, 0.0, roads.length[drivers.held[at]])
    return np.asarray(before + drivers.arc[at] - drivers.rear[at])


def _has_room(
    conflicts: LaneConflicts, drivers: Drivers, requests: Requests, queue: EntryQueue, at: IntArray
) -> BoolArray:
    """Return which of some drivers find room behind the lane that they ask for, (k,)."""
    wait_point = conflicts.wait_point
    exit_lane = requests.exit_lane[at]
    first = queue.first_on(exit_lane)
    free = queue.tail[first] + ROOM_TIME * queue.speed[first]
    coming = (((drivers.claim >= 0) | (drivers.held >= 0)) & (drivers.exit_lane >= 0)).nonzero()[0]
    needs = drivers.length[coming] + GAP
    reserved = np.bincount(drivers.exit_lane[coming], weights=needs, minlength=len(wait_point))
    # Where lanes with rivals follow one another, each is claimed in turn: only a lane without rivals must have room.
    is_plain = (exit_lane >= 0) & np.isinf(wait_point[exit_lane])
    return np.asarray(~is_plain | (free - reserved[exit_lane] >= drivers.length[at] + GAP))


def _taken(conflicts: LaneConflicts, drivers: Drivers, moving_lane: IntArray, moving_tail: FloatArray) -> FloatArray:
    """Return where on each lane the last tail is of those that have or claim it, (l,); inf where there is none [m]."""
    taken = np.full(len(conflicts.wait_point), np.inf)
    at = (drivers.held >= 0).nonzero()[0]
    np.minimum.at(taken, drivers.held[at], _tail_on_held_lane(conflicts.roads, drivers, at))
    np.minimum.at(taken, moving_lane, moving_tail)
    taken[drivers.claim[drivers.claim >= 0]] = -np.inf
    return taken

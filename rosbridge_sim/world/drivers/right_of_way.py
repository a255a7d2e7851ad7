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
from itertools import pairwise
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import BRAKE_FROM, CREEP, GAP, STOP_GAP, Perception
from rosbridge_sim.world.drivers.driver_parameters import HEAVY_LENGTH
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries, EntryQueue
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, is_among, is_any
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts, Links, make_links
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
    is_out = _tail_on_held_lane(conflicts, drivers, at) > conflicts.clear_point[drivers.held[at]]
    drivers.held[at[is_out]] = -1


def find_entered(roads: Roads, lanes: IntArray, nose: FloatArray, lane: IntArray) -> IntArray:
    """Return where among lanes ahead one is that the nose has reached and the reference point has not, (k,) int64.

    Args:
        lanes: (6, k) int64, see `Drivers`.
        nose: (k,) arc lengths of the front bumpers, on the first of these [m].
        lane: (k,) int64, the lanes in question; -1 for none.

    Returns:
        Indices into the first axis of `lanes`; 0 for none.
    """
    place = np.zeros(len(nose), dtype=np.int64)
    at = (nose >= roads.length[lanes[0]]).nonzero()[0]
    if len(at):
        lanes, lane, beyond = lanes.take(at, axis=1), lane[at], nose[at]
        for i, (here, there) in enumerate(pairwise(lanes), 1):
            beyond = beyond - roads.length[here]
            is_on = beyond >= 0.0
            if not is_any(is_on):
                break
            place[at[is_on & (there == lane) & (lane >= 0)]] = i
    return place


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
    is_ahead = (claim >= 0) & np.logical_or.reduce(drivers.lanes.take(at, axis=1) == claim)
    if is_any(is_ahead):
        # At the end of a lane shorter than its nose it would wait for ever: its reference point would not be there.
        is_entered = is_ahead & (conflicts.roads.length[claim] < drivers.nose[at] + STOP_GAP + CREEP)
        nose = drivers.arc[at] + drivers.nose[at]
        is_entered &= find_entered(conflicts.roads, drivers.lanes.take(at, axis=1), nose, claim) > 0
        drivers.held[at[is_entered]], drivers.claim[at[is_entered]] = claim[is_entered], -1
        at = at[~is_ahead | is_entered]
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
    moving = others.first(num_moving)
    index, link = find_rivals(conflicts, drivers, requests.lane[at], at, moving)
    has_room = _has_room(conflicts, drivers, requests, queue, at)
    if is_any(conflicts.rival_passes):  # without rivals it may stop on the lane
        has_room |= np.bincount(index, minlength=len(at)) == 0
    perception.is_shut_out[at[~has_room]] = True
    stands = np.zeros(len(conflicts.wait_point), dtype=bool)
    stands[others.lane[others.stands]] = True
    is_free = ~stands[requests.lane[at]]
    perception.is_blocked[at[~is_free]] = True
    asks = has_room & is_free
    if not is_any(asks):
        return
    keeps = asks[index]
    index, link, at = (asks.cumsum() - 1)[index[keeps]], link[keeps], at[asks]
    holds, rival = _find_holds(conflicts, drivers), conflicts.rivals.other[link]
    is_own, is_last, is_taken = _are_taken(conflicts, drivers, holds, at[index], link, moving=moving)
    stands[drivers.held[(drivers.held >= 0) & (drivers.speed < CREEP)]] = True
    perception.is_blocked[at[index[stands[rival] & (is_taken | ~is_own)]]] = True
    if len(at) > 1:
        is_taken |= _are_later(
            *(conflicts, drivers, requests, at, index, link), holds=holds, is_last=is_last, is_taken=is_taken
        )
    given = at[np.bincount(index[is_taken], minlength=len(at)) == 0]
    drivers.claim[given], drivers.exit_lane[given] = requests.lane[given], requests.exit_lane[given]


def _are_later(  # noqa: PLR0917 - those of `_give`, and what it found
    conflicts: LaneConflicts,
    drivers: Drivers,
    requests: Requests,
    at: IntArray,
    index: IntArray,
    link: IntArray,
    *,
    holds: tuple[IntArray, IntArray, FloatArray],
    is_last: BoolArray,
    is_taken: BoolArray,
) -> BoolArray:
    """Return for pairs of lanes with rivals whether another driver asks for the rival and goes first, (m,).

    Args:
        at: (k,) int64, the drivers that ask.
        index: (m,) int64, which of these asks for the lane of a pair.
        link: (m,) int64, the pairs; see `Links.of`.
        holds: see `_find_holds`.
        is_last: (m,) see `_are_taken`.
        is_taken: (m,) others have the rivals already.
    """
    lane, rank = requests.lane[at], np.empty(len(at), dtype=np.int64)
    # Beside a full road without a stop line those at one would never come: now and then each is let in.
    is_let_in = drivers.is_let_in[at] & (drivers.speed[at] < CREEP) & (requests.distance[at] < 2.0 * STOP_GAP)
    distance, yields = requests.distance[at], conflicts.gives_way[lane] & ~is_let_in
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
    is_later = best[rival] < rank[index]
    unsure = (is_later & ~is_taken & (drivers.held[at[index]] >= 0)).nonzero()[0]
    if len(unsure):
        firsts = _find_firsts(drivers, at, lane, rank, np.bincount(index[is_last], minlength=len(at)) > 0, len(best))
        pair, found = firsts.of(rival[unsure])
        other, asker = firsts.other[found], index[unsure][pair]
        is_before = rank[other] < rank[asker]
        pair, other, asker = pair[is_before], other[is_before], asker[is_before]
        # Those who would go first, but wait for this driver to leave the crossing, do not count.
        bodies = make_links(len(drivers.arc), holds[0], holds[1])
        each, found = bodies.of(at[asker])
        under = other[each] * len(best) + bodies.other[found]
        waits = np.bincount(each[is_among(under, index[is_taken] * len(best) + rival[is_taken])], minlength=len(pair))
        is_later[unsure] = np.bincount(pair[waits == 0], minlength=len(unsure)) > 0
    return is_later


def _find_firsts(  # noqa: PLR0917 - what `_are_later` knows
    drivers: Drivers, at: IntArray, lane: IntArray, rank: IntArray, has_last: BoolArray, num_lanes: int
) -> Links:
    """Return for each lane those who ask for it, of all that wait for the same rivals the first one alone.

    All short vehicles do so, and all long ones. One that has the last tail on a rival itself is apart.

    Args:
        at: (k,) int64, the drivers that ask.
        lane: (k,) int64, for these lanes.
        rank: (k,) int64, in this order.
        has_last: (k,) they have a last tail.
        num_lanes: lanes of the map.
    """
    alike = 2 * lane + (drivers.length[at] > HEAVY_LENGTH)
    least = np.full(2 * num_lanes, len(at), dtype=np.int64)
    np.minimum.at(least, alike[~has_last], rank[~has_last])
    first = (has_last | (rank == least[alike])).nonzero()[0]
    return make_links(num_lanes, lane[first], first)


def find_rivals(
    conflicts: LaneConflicts, drivers: Drivers, lane: IntArray, at: IntArray, moving: Entries
) -> tuple[IntArray, IntArray]:
    """Return the pairs of lanes with rivals that count now; see `Links.of`.

    Where cars pass each other, a pair counts if the driver is long, or one that is on, has or asks for the other lane.

    Args:
        lane: (k,) int64, lanes that drivers ask for.
        at: (k,) int64, these drivers.
        moving: entries of the vehicles that do not follow lanes and move.
    """
    index, link = conflicts.rivals.of(lane)
    passes = conflicts.rival_passes[link]
    if not is_any(passes):
        return index, link
    is_long = drivers.length > HEAVY_LENGTH
    has_long = np.zeros(len(conflicts.wait_point) + 1, dtype=bool)  # the last one stands for no lane
    for lanes in (drivers.claim, drivers.held, drivers.lanes[0]):
        has_long[lanes[is_long]] = True
    has_long[lane[is_long[at]]] = True
    has_long[moving.lane[2.0 * (moving.s - moving.tail) > HEAVY_LENGTH]] = True
    counts = ~passes | is_long[at[index]] | has_long[conflicts.rivals.other[link]]
    return index[counts], link[counts]


def _tail_on_held_lane(conflicts: LaneConflicts, drivers: Drivers, at: IntArray) -> FloatArray:
    """Return the arc lengths of the tails of some drivers on the lanes that they hold, (k,) [m].

    It is -inf if only the nose is there.
    """
    held, tail = drivers.held[at], drivers.arc[at] - drivers.rear[at]
    beside = (drivers.lanes[0][at] != held).nonzero()[0]  # the reference point is behind that lane, or before it
    if len(beside):
        lane, which = held[beside], at[beside]
        tail[beside] += conflicts.roads.length[lane]
        nose = drivers.arc[which] + drivers.nose[which]
        place = find_entered(conflicts.roads, drivers.lanes.take(which, axis=1), nose, lane)
        tail[beside[place > 0]] = -np.inf
    return tail


def _find_holds(conflicts: LaneConflicts, drivers: Drivers) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the lanes that drivers hold or that are under their bodies: drivers, lanes and tails [m], (m,) each."""
    at = (drivers.held >= 0).nonzero()[0]
    held, tail = drivers.held[at], _tail_on_held_lane(conflicts, drivers, at)
    is_entered = np.isinf(tail)
    if not is_any(is_entered):
        return at, held, tail
    found = [(at, held, tail)]
    # From the reference point to the lane that the nose is on: each is taken as a whole
    at = at[is_entered]
    for lanes in drivers.lanes[:-1]:
        at = at[lanes[at] != drivers.held[at]]
        if not len(at):
            break
        found.append((at, lanes[at], np.full(len(at), -np.inf)))
    who, lane, tails = zip(*found, strict=True)
    return np.concatenate(who), np.concatenate(lane), np.concatenate(tails)


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


def _are_taken(
    conflicts: LaneConflicts,
    drivers: Drivers,
    holds: tuple[IntArray, IntArray, FloatArray],
    who: IntArray,
    link: IntArray,
    *,
    moving: Entries,
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return for pairs of lanes with rivals facts about the rival: three arrays (m,).

    Whether the driver itself is on it, whether the last tail there is its own, and whether others have it.

    Args:
        holds: see `_find_holds`.
        who: (m,) int64, the drivers that ask.
        link: (m,) int64, the pairs; see `Links.of`.
        moving: entries of the vehicles that do not follow lanes and move.
    """
    rival, figure, num = conflicts.rivals.other[link], conflicts.rivals.figure[link], len(conflicts.wait_point)
    taken = _taken(conflicts, drivers, holds, moving)
    if not is_any(drivers.held[who] >= 0):
        none = np.zeros(len(who), dtype=bool)
        return none, none, taken[rival] < figure
    # Where lanes are short the driver itself may be on the rival.
    by, lane, tail = holds
    is_own = is_among(who * num + rival, by * num + lane)
    last_by = np.full(num, -1, dtype=np.int64)
    last_by[lane[tail == taken[lane]]] = by[tail == taken[lane]]
    is_last, last = last_by[rival] == who, taken[rival]
    if is_any(is_last):
        is_other = last_by[lane] != by
        without = _taken(conflicts, drivers, (by[is_other], lane[is_other], tail[is_other]), moving)
        last = np.where(is_last, without[rival], last)
    return is_own, is_last, last < figure


def _taken(
    conflicts: LaneConflicts,
    drivers: Drivers,
    holds: tuple[IntArray, IntArray, FloatArray],
    moving: Entries,
) -> FloatArray:
    """Return where on each lane the last tail is of those that have or claim it, (l,); inf where there is none [m].

    Args:
        holds: see `_find_holds`.
        moving: entries of the vehicles that do not follow lanes and move.
    """
    taken = np.full(len(conflicts.wait_point), np.inf)
    who, lane, tail = holds
    if len(who):
        np.minimum.at(taken, lane, tail)
    if len(moving.lane):
        np.minimum.at(taken, moving.lane, moving.tail)
    taken[drivers.claim[drivers.claim >= 0]] = -np.inf
    return taken

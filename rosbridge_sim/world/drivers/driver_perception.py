"""Perception of drivers on their lanes: the lead vehicle, where to stop, the safe speed, and the right of way.

A driver looks along its lane and the five lanes ahead, as far as it matters at its speed. Drivers that do not follow
lanes are seen as entries (`lane_entries`). Where lanes cross or join, `right_of_way` decides.
"""

from __future__ import annotations

import math
from enum import Enum
from itertools import pairwise
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.drivers.driver_model import (
    BRAKE_FROM,
    CREEP,
    STOP_GAP,
    Perception,
    SlowVehicles,
    firm_stop,
    gap_wanted,
    keep_gap,
)
from rosbridge_sim.world.drivers.intruders import stop_for_intruders
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries, EntryQueue, sibling_entries
from rosbridge_sim.world.drivers.look_rules import MUCH_SLOWER, foresee, slow_down
from rosbridge_sim.world.drivers.looks_one_by_one import look_one_by_one
from rosbridge_sim.world.drivers.right_of_way import Requests, find_entered, find_rivals, give_claims, update_holds
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, is_among
from rosbridge_sim.world.roads.lane_conflicts import (
    MIN_SAFE_SPEED,
    LaneConflicts,
    foresight,
)

FOLLOWS_FROM: Final = 0.25
"""A driver follows if the entity ahead takes this much from its acceleration [m/s^2]: a passenger would feel it."""

FEW: Final = 24
"""Up to this number of drivers, single floats are faster than arrays: 6 us for each driver, or 160 us for all."""

SAME_PLACE: Final = 1e-6
"""Distances that differ by less are of one place [m]: they are sums of the same lengths in another order."""


def perceive(
    conflicts: LaneConflicts, may_enter: BoolArray, drivers: Drivers, others: Entries, num_moving: int
) -> Perception:
    """Return what each driver perceives. Claims are given out and given back.

    Args:
        may_enter: (l,) which lanes the traffic lights allow to enter.
        drivers: `claim`, `held` and `exit_lane` are written.
        others: entries of the entities that do not follow lanes.
        num_moving: the first so many of `others` are moving vehicles: they occupy the lanes that they drive on.
    """
    update_holds(conflicts, drivers)
    look = _Look(conflicts, may_enter, drivers, others)
    look.look_ahead()
    look.claim(num_moving)
    return look.perception


class Stop(Enum):
    """Reason of a driver to stop."""

    NONE = ""
    LIGHT = "light"
    RIGHT_OF_WAY = "right_of_way"
    NO_ROOM = "no_room"  # behind the intersection
    END = "end"  # of the road


class DriverSight(Record):
    """Perception of one driver. An index counts the drivers first, then the entries of the others; -1 is none.

    Attributes:
        lead: the entity ahead.
        gap: to its tail [m]; inf for none.
        is_following: the driver brakes, or accelerates less, because of it.
        stop: what it stops for now, other than the entity ahead.
        stop_distance: from the front bumper to that place [m]; inf for none.
        stop_lane: row of the lane that it may not enter; at the end of the road, of the lane that ends.
        rival: a driver or another entity that has the right of way.
    """

    lead: int
    gap: float
    is_following: bool
    stop: Stop
    stop_distance: float
    stop_lane: int
    rival: int


def observe(
    conflicts: LaneConflicts, may_enter: BoolArray, drivers: Drivers, others: Entries, num_moving: int, *, which: int
) -> DriverSight:
    """Return what one driver sees, and why it stops or slows down. The arguments are those of `perceive`.

    Args:
        may_enter: (l,) which lanes the traffic lights allow to enter.
        drivers: copies, since `claim`, `held` and `exit_lane` are written.
        others: entries of the entities that do not follow lanes.
        num_moving: the first so many of `others` are moving vehicles.
    """
    update_holds(conflicts, drivers)
    look = _Look(conflicts, may_enter, drivers, others)
    look.look_ahead()
    perception, requests = look.perception, look.requests
    gives_way = look.claim(num_moving)
    speed, gap = float(drivers.speed[which]), float(perception.gap[which])
    parameters, closing = drivers.parameters, drivers.speed - perception.lead_speed
    one = parameters.accel, parameters.comfort, parameters.headway
    wanted_gap = gap_wanted(ARRAYS, drivers.speed, closing, *one)
    lost = parameters.accel - keep_gap(ARRAYS, parameters.accel, wanted_gap, np.fmax(perception.gap, CREEP))
    distance = float(perception.stop_distance[which])
    is_stopping = speed < CREEP or speed * speed > 2.0 * BRAKE_FROM * max(distance - STOP_GAP, 0.0)
    lane = int(requests.lane[which])
    waits = drivers.claim[which] != lane and requests.distance[which] <= distance  # without a request it is inf
    stop, rival = Stop.NONE, -1
    if math.isinf(distance) or not is_stopping:
        distance, lane = math.inf, -1
    elif gives_way[which] >= 0:
        stop, lane = Stop.RIGHT_OF_WAY, int(max(drivers.claim[which], drivers.held[which]))
        rival = len(drivers.arc) + int(gives_way[which])
    elif waits:
        stop = Stop.NO_ROOM if perception.is_shut_out[which] else Stop.RIGHT_OF_WAY
        rival = _find_rival(conflicts, drivers, others.first(num_moving), lane, which)
    else:
        stop, lane = look.find_stop(which, distance)
    return DriverSight(
        lead=look.find_lead(which),
        gap=gap,
        is_following=bool(lost[which] > FOLLOWS_FROM),
        stop=stop,
        stop_distance=distance,
        stop_lane=lane,
        rival=rival,
    )


def _find_rival(conflicts: LaneConflicts, drivers: Drivers, moving: Entries, lane: int, which: int) -> int:
    """Return who has or claims a rival of a lane: an index as in `DriverSight`, -1 for none.

    Args:
        drivers: after claims were given.
        moving: entries of the moving vehicles that do not follow lanes.
        lane: row of the lane.
        which: the driver that asks for it.
    """
    _, link = find_rivals(conflicts, drivers, np.array([lane]), np.array([which]), moving)
    rivals = conflicts.rivals.other[link]
    has_one = is_among(drivers.held, rivals) | is_among(drivers.claim, rivals)
    has_one[which] = False
    found = np.concatenate([has_one, is_among(moving.lane, rivals)]).nonzero()[0]
    return int(found[0]) if len(found) else -1


class _Look:
    """One look ahead of all drivers.

    Attributes:
        perception: what they perceive; `look_ahead` completes it.
        requests: the lanes that they need a claim for; `look_ahead` completes it.
        queue: all entries.
    """

    def __init__(self, conflicts: LaneConflicts, may_enter: BoolArray, drivers: Drivers, others: Entries) -> None:
        self._conflicts, self._roads, self._may_enter = conflicts, conflicts.roads, may_enter
        self._drivers = drivers
        self._others = others
        lane, num = drivers.lanes[0], len(drivers.arc)
        own = Entries(
            lane,
            drivers.arc,
            drivers.arc - drivers.rear,
            drivers.speed,
            drivers.accel,
            np.arange(num),
            np.zeros(num, bool),
        )
        leaving = () if drivers.leaving is None else (drivers.leaving,)
        self.queue = EntryQueue(self._roads, own, *leaving, sibling_entries(conflicts, own), others)
        self.requests = Requests.none(num)

    def look_ahead(self) -> None:
        """Look along the lanes ahead, as far as it matters at each driver's speed."""
        drivers = self._drivers
        if 0 < len(drivers.arc) <= FEW:
            arguments = (self._conflicts, self._may_enter, drivers, self.queue, self.requests)
            self.perception = look_one_by_one(*arguments)
            return
        self._look_at_once()

    def _look_at_once(self) -> None:
        """Do the same for many drivers."""
        self._perceive_own_lane()
        drivers, perception, requests = self._drivers, self.perception, self.requests
        roads, conflicts, horizon = self._roads, self._conflicts, self._horizon
        self._request_own_lane()
        distance = roads.length[drivers.lanes[0]] - drivers.arc  # from the reference point to the next lane's start
        i = np.arange(len(distance))
        held_at = find_entered(roads, drivers.lanes, drivers.arc + drivers.nose, drivers.held)
        for part, (lanes, exit_lanes) in enumerate(zip(drivers.lanes[1:], [*drivers.lanes[2:], None], strict=True), 1):
            i = i[distance[i] < horizon[i]]
            lane = lanes[i]
            is_end = lane < 0
            if np.count_nonzero(is_end):
                at = i[is_end]
                to_end = distance[at] - drivers.nose[at]
                perception.stop_distance[at] = np.fmin(perception.stop_distance[at], to_end)
                i, lane = i[~is_end], lane[~is_end]
            if not len(i):
                break
            to_line = distance[i] - drivers.nose[i]
            self._obey_light(i, lane, to_line)
            following = np.isfinite(conflicts.wait_point[lane]).nonzero()[0]
            if len(following):
                at, there = i[following], lane[following]
                to_wait = to_line[following] + conflicts.wait_point[there]
                asks = (requests.lane[at] < 0) & np.isinf(perception.stop_distance[at])
                asks &= (drivers.claim[at] != there) | (to_wait > self._stop_way[at])
                asks &= part > held_at[at]
                at, there = at[asks], there[asks]
                self._request(at, there, -1 if exit_lanes is None else exit_lanes[at], to_wait[asks])
            self._slow_down(i, lane, distance[i])
            self._find_lead(i, lane, distance)
            distance[i] += roads.length[lane]
        perception.safe_speed = np.sqrt(np.fmax(self._safe_square, MIN_SAFE_SPEED**2))
        perception.slow = self._find_slow()

    def _perceive_own_lane(self) -> None:
        """Perceive the lead vehicles on the drivers' own lanes, and what limit and bends there allow."""
        drivers, queue, parameters, num = self._drivers, self.queue, self._drivers.parameters, len(self._drivers.arc)
        after = queue.position[:num] + 1
        lead = self._lead_at = np.where(queue.lane[after] == drivers.lanes[0], after, queue.num)
        self.perception = Perception(
            gap=queue.tail[lead] - drivers.arc - drivers.nose,
            lead_speed=queue.speed[lead],
            lead_accel=queue.accel[lead],
            lead=queue.source[lead],
            stop_distance=np.full(num, np.inf),
            safe_speed=np.empty(num),
            is_shut_out=np.zeros(num, dtype=bool),
            is_blocked=np.zeros(num, dtype=bool),
            queue=queue,
        )
        start, _, limit, limit_slope, _, bend, bend_slope = self._conflicts.speeds_ahead.take(drivers.point, 0).T
        self._reach = foresight(drivers.speed, parameters.reaction)
        self._horizon, self._stop_way, *self._factors, self._safe_square = foresee(
            *(ARRAYS, drivers.speed, drivers.accel, drivers.nose, drivers.lateral, parameters.speed_factor),
            *(parameters.accel, parameters.comfort, parameters.headway, parameters.reaction),
            *(drivers.arc, start, limit, limit_slope, bend, bend_slope),
        )

    def claim(self, num_moving: int) -> IntArray:
        """Give lanes to the drivers that ask, and have drivers stop for intruders.

        Returns:
            (k,) int64; see `stop_for_intruders`.
        """
        others = self._others
        arguments = (self._conflicts, self._drivers, self.perception)
        give_claims(*arguments, self.requests, self.queue, others=others, num_moving=num_moving)
        if not num_moving:
            return np.full(len(self._drivers.arc), -1, dtype=np.int64)
        return stop_for_intruders(*arguments, others.first(num_moving))

    def find_lead(self, which: int) -> int:
        """Return the entity ahead of a driver, an index as in `DriverSight`; -1 for none."""
        queue, drivers = self.queue, self._drivers
        if np.isinf(self.perception.gap[which]):
            return -1
        if self.perception.lead[which] >= 0:
            return int(self.perception.lead[which])
        num = len(drivers.arc)
        position = int(queue.position[which]) + 1
        if queue.lane[position] != drivers.lanes[0, which]:
            ahead = drivers.lanes[1:, which]
            position = next(at for at in queue.first_on(ahead[ahead >= 0]).tolist() if at < queue.num)
        entry = int((queue.position == position).nonzero()[0][0])
        return num + entry - (queue.num - len(self._others.lane))

    def find_stop(self, which: int, distance: float) -> tuple[Stop, int]:
        """Return why a driver must stop at a distance, and the lane; a light or the end of the road is there."""
        drivers, roads = self._drivers, self._roads
        lanes = drivers.lanes[:, which].tolist()
        to_line = float(roads.length[lanes[0]] - drivers.arc[which] - drivers.nose[which])
        for here, lane in pairwise(lanes):
            if lane < 0:
                return Stop.END, here
            if not self._may_enter[lane] and abs(to_line - distance) < SAME_PLACE:
                return Stop.LIGHT, lane
            to_line += float(roads.length[lane])
        return Stop.NONE, -1

    def _slow_down(self, i: IntArray, lane: IntArray, distance: FloatArray) -> None:
        """Lower the speeds for what comes on a lane ahead.

        Args:
            i: (m,) int64, indices of drivers.
            lane: (m,) int64, a lane ahead of each.
            distance: (m,) from its reference point to the start of that lane [m].
        """
        _, limit, limits, _, bend, bends, _ = self._conflicts.speeds_ahead.take(self._roads.first[lane], 0).T
        limit_factor, bend_factor, surplus = (factor[i] for factor in self._factors)
        mine = self._reach[i], self._drivers.parameters.comfort[i], limit_factor, bend_factor, surplus
        square = slow_down(ARRAYS, distance, *mine, limit, limits, bend, bends)
        self._safe_square[i] = np.fmin(self._safe_square[i], square)

    def _request_own_lane(self) -> None:
        """Request the driver's own lane where that crosses others only farther on, beyond its wait point."""
        drivers = self._drivers
        lane, exit_lane = drivers.lanes[:2]
        distance = self._conflicts.wait_point[lane] - drivers.arc - drivers.nose
        at = (np.isfinite(distance) & (distance > 0.0)).nonzero()[0]
        if len(at):
            asks = (drivers.claim[at] != lane[at]) | (distance[at] > self._stop_way[at])
            at = at[asks & (drivers.held[at] != lane[at])]
            self._request(at, lane[at], exit_lane[at], distance[at])

    def _request(self, at: IntArray, lane: IntArray, exit_lane: IntArray | int, distance: FloatArray) -> None:
        """Request lanes for drivers, (m,) int64 indices; a claim for one of them is given back. See `Requests`."""
        drivers, requests = self._drivers, self.requests
        requests.lane[at], requests.exit_lane[at], requests.distance[at] = lane, exit_lane, distance
        again = at[drivers.claim[at] == lane]
        requests.again[again], drivers.claim[again] = True, -1

    def _obey_light(self, i: IntArray, lane: IntArray, to_line: FloatArray) -> None:
        """Stop at the line of a lane that may not be entered, unless that needs more than firm braking.

        Stateless: a driver that brakes keeps satisfying the condition; one that continues stops satisfying it.

        Args:
            i: (m,) int64, indices of drivers.
            lane: (m,) int64, a lane ahead of each.
            to_line: (m,) from the front bumper to the start of that lane [m].
        """
        drivers, perception = self._drivers, self.perception
        closed = (~self._may_enter[lane] & (to_line > 0.0)).nonzero()[0]
        if not len(closed):
            return
        at = i[closed]
        needed = firm_stop(ARRAYS, drivers.speed[at], drivers.accel[at], drivers.parameters.reaction[at])
        stops = closed[needed < to_line[closed]]
        at = i[stops]
        perception.stop_distance[at] = np.fmin(perception.stop_distance[at], to_line[stops])
        drivers.claim[at[drivers.claim[at] == lane[stops]]] = -1

    def _find_lead(self, i: IntArray, lane: IntArray, distance: FloatArray) -> None:
        """Take the first entry on a lane ahead as lead vehicle, for drivers that have none yet.

        Args:
            i: (m,) int64, indices of drivers.
            lane: (m,) int64, a lane ahead of each.
            distance: (k,) for each driver from its reference point to the start of that lane [m].
        """
        perception, queue = self.perception, self.queue
        is_free = np.isinf(perception.gap[i]).nonzero()[0]
        if not len(is_free):
            return
        at = i[is_free]
        first = self._lead_at[at] = queue.first_on(lane[is_free])
        perception.gap[at] = distance[at] + queue.tail[first] - self._drivers.nose[at]
        perception.lead_speed[at], perception.lead_accel[at] = queue.speed[first], queue.accel[first]
        perception.lead[at] = queue.source[first]

    def _find_slow(self) -> SlowVehicles | None:
        """Return the vehicles next to the lead vehicles, on the same lanes, that are much slower or uncovered soon."""
        queue, perception, lead, drivers = self.queue, self.perception, self._lead_at, self._drivers
        following = np.minimum(lead + 1, queue.num)
        counts = drivers.speed - queue.speed[following] > MUCH_SLOWER
        if drivers.leaving is not None:
            leaves = np.zeros(len(drivers.arc) + 1, dtype=bool)  # the last one stands for entities without lanes
            leaves[drivers.leaving.source] = True
            counts |= leaves[queue.source[lead]]
        at = (counts & (queue.lane[following] == queue.lane[lead]) & (lead < queue.num)).nonzero()[0]
        return SlowVehicles.next_to(queue, perception.gap, lead, at) if len(at) else None

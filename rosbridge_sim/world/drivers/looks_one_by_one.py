"""The look along the lanes ahead of few drivers, one by one: single floats are faster than arrays then.

It finds what `driver_perception` finds for all drivers at once, to the last bit; see there for what drivers look at.
"""

from __future__ import annotations

import math

import numpy as np

from rosbridge_sim.world.drivers.driver_model import Perception, SlowVehicles, firm_stop
from rosbridge_sim.world.drivers.lane_entries import Drivers, EntryQueue
from rosbridge_sim.world.drivers.look_rules import MUCH_SLOWER, foresee, slow_down
from rosbridge_sim.world.drivers.right_of_way import Requests
from rosbridge_sim.world.drivers.rule_operators import written
from rosbridge_sim.world.geometry.planar import BoolArray
from rosbridge_sim.world.roads.lane_conflicts import MIN_SAFE_SPEED, LaneConflicts, foresight


def look_one_by_one(
    conflicts: LaneConflicts, may_enter: BoolArray, drivers: Drivers, queue: EntryQueue, requests: Requests
) -> Perception:
    """Return what drivers perceive along their lanes.

    Args:
        may_enter: (l,) which lanes the traffic lights allow to enter.
        drivers: `claim` is written.
        requests: written.
    """
    looks = _Looks(conflicts, may_enter, drivers, queue, requests)
    parameters, num = drivers.parameters, len(drivers.arc)
    columns = (
        *(drivers.arc, drivers.speed, drivers.accel, drivers.nose, drivers.lateral, parameters.speed_factor),
        *(parameters.accel, parameters.comfort, parameters.headway, parameters.reaction),
        *(foresight(drivers.speed, parameters.reaction), drivers.point, drivers.claim, drivers.held, drivers.lanes.T),
    )
    rows = enumerate(zip(*[column.tolist() for column in columns], strict=True))
    gap, lead_at, stop_distance, square = zip(*[looks.look(i, *row) for i, row in rows], strict=True)
    lead, gaps = np.array(lead_at), np.array(gap)
    slow = looks.find_slow(lead_at, drivers)
    return Perception(
        gap=gaps,
        lead_speed=queue.speed[lead],
        lead_accel=queue.accel[lead],
        lead=queue.source[lead],
        stop_distance=np.array(stop_distance),
        safe_speed=np.sqrt(np.fmax(square, MIN_SAFE_SPEED**2)),
        is_shut_out=np.zeros(num, dtype=bool),
        is_blocked=np.zeros(num, dtype=bool),
        slow=SlowVehicles.next_to(queue, gaps, lead, np.array(slow)) if slow else None,
        queue=queue,
    )


class _Looks:
    """Looks of single drivers, and the numbers that they read."""

    def __init__(
        self, conflicts: LaneConflicts, may_enter: BoolArray, drivers: Drivers, queue: EntryQueue, requests: Requests
    ) -> None:
        roads = conflicts.roads
        self._foresee, self._slow_down = written(foresee, 15), written(slow_down, 10)
        self._firm_stop = written(firm_stop, 3)
        self._length, self._first, self._wait_point = roads.length.data, roads.first.data, conflicts.wait_point.data
        self._speeds, self._may_enter = conflicts.speeds_ahead.data, may_enter.data
        self._num, self._position = queue.num, queue.position.data
        self._lane, self._tail, self._first_on = queue.lane.data, queue.tail.data, queue.first.data
        self._queue, self._requests, self._claim = queue, requests, drivers.claim.data

    def look(  # noqa: PLR0917 - numbers of one driver
        self,
        i: int,
        arc: float,
        speed: float,
        accel: float,
        nose: float,
        lateral: float,
        factor: float,
        own_accel: float,
        comfort: float,
        headway: float,
        reaction: float,
        reach: float,
        point: int,
        claim: int,
        held: int,
        lanes: list[int],
    ) -> tuple[float, int, float, float]:
        """Return the gap ahead of driver `i`, where its lead vehicle is in the queue, its stop and its safe square."""
        speeds, wait_point, tail, lane = self._speeds, self._wait_point, self._tail, lanes[0]
        lead = self._position[i] + 1
        if self._lane[lead] != lane:
            lead = self._num
        gap = tail[lead] - arc - nose
        here = speeds[point, 0], speeds[point, 2], speeds[point, 3], speeds[point, 5], speeds[point, 6]
        mine = speed, accel, nose, lateral, factor, own_accel, comfort, headway, reaction, arc
        horizon, stop_way, limit_factor, bend_factor, surplus, square = self._foresee(*mine, *here)
        to_wait = wait_point[lane] - arc - nose
        # It asks for its own lane where that crosses others only farther on, beyond its wait point.
        asks = 0.0 < to_wait < math.inf and held != lane and (claim != lane or to_wait > stop_way)
        if asks:
            claim = self._ask(i, claim, lane, lanes[1], to_wait)
        stop, distance = math.inf, self._length[lane] - arc
        held_at = self._find_held(held, lanes, nose - distance) if held >= 0 and nose >= distance else 0
        for part in range(1, len(lanes)):
            if distance >= horizon:
                break
            lane, to_line = lanes[part], distance - nose
            if lane < 0:
                stop = min(stop, to_line)
                break
            if not self._may_enter[lane] and 0.0 < to_line > self._firm_stop(speed, accel, reaction)[0]:
                stop = min(stop, to_line)
                if claim == lane:
                    claim = self._claim[i] = -1
            to_wait = to_line + wait_point[lane]
            if part > held_at and to_wait < math.inf == stop and not asks and (claim != lane or to_wait > stop_way):
                asks, exit_lane = True, lanes[part + 1] if part + 1 < len(lanes) else -1
                claim = self._ask(i, claim, lane, exit_lane, to_wait)
            at = self._first[lane]
            there = speeds[at, 1], speeds[at, 2], speeds[at, 4], speeds[at, 5]
            square = min(square, *self._slow_down(distance, reach, comfort, limit_factor, bend_factor, surplus, *there))
            if gap == math.inf:
                lead = self._first_on[lane]
                gap = distance + tail[lead] - nose
            distance += self._length[lane]
        return gap, lead, stop, square

    def _find_held(self, held: int, lanes: list[int], beyond: float) -> int:
        """Return what `find_entered` does for the lane that a driver holds; its nose is beyond the first lane [m]."""
        place = 0
        for i, lane in enumerate(lanes[1:], 1):
            if lane < 0 or beyond < 0.0:
                break
            place = i if lane == held else place
            beyond -= self._length[lane]
        return place

    def _ask(self, i: int, claim: int, lane: int, exit_lane: int, distance: float) -> int:
        """Request a lane for a driver; return its claim, which is given back if it is for this lane."""
        requests = self._requests
        requests.lane[i], requests.exit_lane[i], requests.distance[i] = lane, exit_lane, distance
        if claim != lane:
            return claim
        requests.again[i], self._claim[i] = True, -1
        return -1

    def find_slow(self, lead_at: tuple[int, ...], drivers: Drivers) -> list[int]:
        """Return the drivers that mind the vehicle ahead of their lead vehicle."""
        leaving = () if drivers.leaving is None else drivers.leaving.source.tolist()
        lane, speed, source, found = self._lane, self._queue.speed, self._queue.source, []
        for i, lead in enumerate(lead_at):
            if (
                lead < self._num
                and lane[lead + 1] == lane[lead]
                and (drivers.speed[i] - speed[lead + 1] > MUCH_SLOWER or source[lead] in leaving)
            ):
                found.append(i)
        return found

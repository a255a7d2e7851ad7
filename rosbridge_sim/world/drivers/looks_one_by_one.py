"""The look along the lanes ahead of few drivers, one by one: single floats are faster than arrays then.

It finds what `driver_perception` finds for all drivers at once, to the last bit; see there for what drivers look at.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from rosbridge_sim.world.drivers.driver_model import Perception, SlowVehicles, firm_stop
from rosbridge_sim.world.drivers.lane_entries import Drivers, EntryQueue
from rosbridge_sim.world.drivers.look_rules import MUCH_SLOWER, foresee, slow_down
from rosbridge_sim.world.drivers.right_of_way import Requests
from rosbridge_sim.world.drivers.route_choice import NUM_AHEAD
from rosbridge_sim.world.drivers.rule_operators import written
from rosbridge_sim.world.geometry.planar import BoolArray
from rosbridge_sim.world.roads.lane_conflicts import MIN_SAFE_SPEED, LaneConflicts, foresight
from rosbridge_sim.world.roads.roads import Roads


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
        *(drivers.speed, drivers.accel, drivers.nose, drivers.lateral, parameters.speed_factor, parameters.accel),
        *(parameters.comfort, parameters.headway, parameters.reaction, drivers.arc),
    )
    speed, accel, nose, *others, comfort, headway, reaction, arc = (column.tolist() for column in columns)
    start, _, limit, limit_slope, _, bend, bend_slope = conflicts.speeds_ahead.take(drivers.point, 0).T.tolist()
    here = start, limit, limit_slope, bend, bend_slope
    foreseen = map(written(foresee, 15), speed, accel, nose, *others, comfort, headway, reaction, arc, *here)
    reach, codes = foresight(drivers.speed, parameters.reaction), (drivers.claim, drivers.held, drivers.lanes.T)
    place = reach.tolist(), *(column.tolist() for column in codes)
    gap, lead_at, stop_distance, square = looks.look(
        zip(range(num), arc, speed, accel, nose, comfort, reaction, *place, foreseen, strict=True)
    )
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


class _LaneRows(dict[int, tuple[float, ...]]):
    """The numbers of lanes that somebody has looked at; get it by `roads.derived`.

    These are the length and the wait point [m], and those of `slow_down` at the start. The lanes of many worlds are
    those of their map, repeated.
    """

    def __init__(self, roads: Roads) -> None:
        super().__init__()
        self._roads, self._conflicts = roads, roads.derived(LaneConflicts)

    def __missing__(self, lane: int) -> tuple[float, ...]:
        roads, conflicts = self._roads, self._conflicts
        in_map = lane % len(roads)
        _, limit, least_limit, _, bend, least_bend, _ = conflicts.speeds_ahead[roads.first[in_map]].tolist()
        length, wait_point = roads.length.item(in_map), conflicts.wait_point.item(in_map)
        self[lane] = length, wait_point, limit, least_limit, bend, least_bend
        return self[lane]


class _Looks:
    """Looks of single drivers, and the numbers that they read."""

    def __init__(
        self, conflicts: LaneConflicts, may_enter: BoolArray, drivers: Drivers, queue: EntryQueue, requests: Requests
    ) -> None:
        self._lanes: _LaneRows = conflicts.roads.derived(_LaneRows)
        self._slow_down, self._firm_stop = written(slow_down, 10), written(firm_stop, 3)
        self._may_enter, self._requests, self._claim = may_enter.data, requests, drivers.claim.data
        self._num, self._position = queue.num, queue.position.data
        self._lane, self._tail, self._first_on = queue.lane.data, queue.tail.data, queue.first.data
        self._speed, self._source = queue.speed.data, queue.source.data

    def look(self, drivers: Iterable[tuple[Any, ...]]) -> tuple[list[float], list[int], list[float], list[float]]:
        """Return the gap ahead of each driver, where its lead vehicle is in the queue, its stop and its safe square.

        Args:
            drivers: of each its index; the arc length, speed and acceleration; its nose, comfort and reaction; how far
                it heeds limits and bends; its claim, the lane that it holds, its lanes, and what `foresee` returns.
        """
        numbers, position, lane_at, tail, first_on = self._lanes, self._position, self._lane, self._tail, self._first_on
        may_enter, slowed, firm, none, inf = self._may_enter, self._slow_down, self._firm_stop, self._num, math.inf
        gaps, leads, stops, squares = [], [], [], []
        for i, arc, speed, accel, nose, comfort, reaction, reach, claimed, held, lanes, foreseen in drivers:
            horizon, stop_way, limit_factor, bend_factor, surplus, square = foreseen
            claim, lane, lead = claimed, lanes[0], position[i] + 1
            if lane_at[lead] != lane:
                lead = none
            gap, stop, (length, wait_point, *_) = tail[lead] - arc - nose, inf, numbers[lane]
            to_wait, distance = wait_point - arc - nose, length - arc
            # It asks for its own lane where that crosses others only farther on, beyond its wait point.
            asks = 0.0 < to_wait < inf and held != lane and (claim != lane or to_wait > stop_way)
            if asks:
                claim = self._ask(i, claim, lane, lanes[1], to_wait)
            held_at = self._find_held(held, lanes, nose - distance) if held >= 0 and nose >= distance else 0
            part = 0
            while distance < horizon and part < NUM_AHEAD:
                part += 1
                lane, to_line = lanes[part], distance - nose
                if lane < 0:
                    stop = min(stop, to_line)
                    break
                if not may_enter[lane] and 0.0 < to_line > firm(speed, accel, reaction)[0]:
                    stop = min(stop, to_line)
                    if claim == lane:
                        claim = self._claim[i] = -1
                length, wait_point, limit, least_limit, bend, least_bend = numbers[lane]
                to_wait = to_line + wait_point
                if part > held_at and to_wait < inf == stop and not asks and (claim != lane or to_wait > stop_way):
                    asks, exit_lane = True, lanes[part + 1] if part < NUM_AHEAD else -1
                    claim = self._ask(i, claim, lane, exit_lane, to_wait)
                (slow,) = slowed(
                    distance, reach, comfort, limit_factor, bend_factor, surplus, limit, least_limit, bend, least_bend
                )
                square = min(square, slow)
                if gap == inf:
                    lead = first_on[lane]
                    gap = distance + tail[lead] - nose
                distance += length
            gaps.append(gap)
            leads.append(lead)
            stops.append(stop)
            squares.append(square)
        return gaps, leads, stops, squares

    def _find_held(self, held: int, lanes: list[int], beyond: float) -> int:
        """Return what `find_entered` does for the lane that a driver holds; its nose is beyond the first lane [m]."""
        place = 0
        for i, lane in enumerate(lanes[1:], 1):
            if lane < 0 or beyond < 0.0:
                break
            place = i if lane == held else place
            beyond -= self._lanes[lane][0]
        return place

    def _ask(self, i: int, claim: int, lane: int, exit_lane: int, distance: float) -> int:
        """Request a lane for a driver; return its claim, which is given back if it is for this lane."""
        requests = self._requests
        requests.lane[i], requests.exit_lane[i], requests.distance[i] = lane, exit_lane, distance
        if claim != lane:
            return claim
        requests.again[i], self._claim[i] = True, -1
        return -1

    def find_slow(self, lead_at: Sequence[int], drivers: Drivers) -> list[int]:
        """Return the drivers that mind the vehicle ahead of their lead vehicle."""
        leaving = () if drivers.leaving is None else drivers.leaving.source.tolist()
        lane, speed, source, own_speed, found = self._lane, self._speed, self._source, drivers.speed.data, []
        for i, lead in enumerate(lead_at):
            if (
                lead < self._num
                and lane[lead + 1] == lane[lead]
                and (own_speed[i] - speed[lead + 1] > MUCH_SLOWER or source[lead] in leaving)
            ):
                found.append(i)
        return found

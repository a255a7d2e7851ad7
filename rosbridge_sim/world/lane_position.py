"""Positions on lanes: put a vehicle onto the lanes, take it off, and find what lies ahead of it.

The reference point (middle of the rear axle) of a vehicle is on the line of its lane, at arc length `arc`. The middle
of the front axle is on the line as well, and that gives the heading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray
from rosbridge_sim.world.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.route_choice import RouteChoice
from rosbridge_sim.world.state import Kind, World, usual_wheelbase

__all__ = ["find_ahead", "headings", "join_lane", "keep_lane", "leave_lane", "set_legs"]

_LEGS: Final = ("leg_start", "leg_dz")
"""First and last of the columns that hold a straight leg."""


def keep_lane(
    world: World,
    row: int,
    lane: int,
    s: float,
    *,
    desired_speed: float = math.inf,
    route: Sequence[int] = (),
    is_loop: bool = False,
) -> None:
    """Put a vehicle onto a lane and have it follow the lanes from there, at first with the speed that it has.

    Args:
        world: written in place.
        row: row of a VEHICLE.
        lane: row of a lane.
        s: arc length on the lane, held within it [m].
        desired_speed: speed that the driver wants; limits, bends and other traffic make it slower [m/s].
        route: rows of lanes, each a successor of the one before, the first one `lane`. At its end, or without a
            route, chance chooses.
        is_loop: the route begins again; its first lane is then a successor of its last.

    Raises:
        ValueError: the row is no vehicle, there is no such lane, `desired_speed` or `s` is not a number within bounds,
            or the route does not lead along lanes. Nothing has changed.
    """
    roads = world.roads
    if world.kind[row] != Kind.VEHICLE or not world.alive[row]:
        raise ValueError(f"row {row}: expected a vehicle in use, which alone can keep to a lane")
    if not 0 <= lane < len(roads):
        raise ValueError(f"lane: expected 0..{len(roads) - 1}, got {lane!r}")
    if not (math.isfinite(s) and desired_speed >= 0.0):
        raise ValueError(
            f"s and desired_speed: expected a finite number and one that is not negative, got {s!r} and"
            f" {desired_speed!r}"
        )
    steps = [*route, route[0]] if route and is_loop else list(route)
    if route and route[0] != lane:
        raise ValueError(f"route: expected to begin with lane {lane}, got {route[0]}")
    for i, (here, there) in enumerate(pairwise(steps)):
        if not 0 <= here < len(roads) or there not in roads.successors(here):
            raise ValueError(f"route[{i}]: lane {there} does not follow lane {here}")

    s = min(max(s, 0.0), float(roads.length[lane]))
    x, y, z = roads.at(lane, s)[0][0].tolist()
    world.place(row, x=x, y=y, z=z, yaw=0.0, speed=max(float(world.speed[row]), 0.0))
    world.wheelbase[row] = usual_wheelbase(world.bodies[row])
    if len(route):
        world.routes[int(world.uid[row])] = np.array(route, dtype=np.int64)
    join_lane(world, row, lane, s, desired_speed=desired_speed, is_loop=is_loop)
    set_legs(world, roads.derived(LaneConflicts), np.array([row]))
    lanes = world.int_block("lane", "ahead_5")[:, [row]]
    world.yaw[row] = headings(roads, lanes, world.arc[[row]], world.wheelbase[[row]])[0]
    world.touch()


def leave_lane(world: World, row: int) -> None:
    """Stop a row from following lanes: it goes on as it moves now. A row that follows none is left as it is.

    Args:
        world: written in place.
        row: any row in use.
    """
    if world.has_lane[row]:
        x, y, z, yaw, speed = (float(getattr(world, name)[row]) for name in ("x", "y", "z", "yaw", "speed"))
        world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
        world.touch()


def join_lane(world: World, row: int, lane: int, s: float, *, desired_speed: float, is_loop: bool) -> None:
    """Write the columns that make a row follow lanes, without checks. Its pose stays as it is.

    Args:
        world: written in place; the caller calls `World.touch` afterwards.
        row: row of a VEHICLE or an EGO.
        lane: row of a lane.
        s: arc length on the lane [m].
        desired_speed: see `keep_lane` [m/s].
        is_loop: see `keep_lane`.
    """
    world.has_lane[row], world.is_loop[row], world.desired_speed[row] = True, is_loop, desired_speed
    world.lane[row], world.arc[row], world.turns[row] = lane, s, 0
    world.claim[row] = world.held[row] = world.exit_lane[row] = world.behind[row] = -1
    RouteChoice(world, np.array([row])).plan(np.array([0]))
    # A row that is put beyond the wait point of a lane is in the conflict area already, so it occupies the lane.
    if s + world.half_length[row] + world.centre[row] > world.roads.derived(LaneConflicts).wait_point[lane]:
        world.held[row], world.exit_lane[row] = lane, world.ahead_1[row]


def set_legs(world: World, conflicts: LaneConflicts, rows: IntArray) -> None:
    """Write the straight legs that rows are on, by their lane and arc length.

    Args:
        world: written in place.
        conflicts: of the world's roads.
        rows: (k,) int64.
    """
    point, _ = world.roads.locate(world.lane[rows], world.arc[rows])
    world.point[rows] = point
    world.block(*_LEGS)[:, rows] = conflicts.legs[point].T


def headings(roads: Roads, lanes: IntArray, arc: FloatArray, wheelbase: FloatArray) -> FloatArray:
    """Return the headings of vehicles that have both axles on the line of their lanes.

    Args:
        roads: the lanes.
        lanes: (6, k) int64, see `find_ahead`.
        arc: (k,) arc lengths of the rear axles on the first lane [m].
        wheelbase: (k,) [m].

    Returns:
        (k,) counter-clockwise from east, (-pi, pi] [rad].
    """
    rear, _ = roads.at(*find_ahead(roads, lanes, arc))
    front, yaw = roads.at(*find_ahead(roads, lanes, arc + wheelbase))
    step = front - rear
    # At the end of the last lane there is no line for the front axle: take the direction of the lane.
    is_short = np.hypot(step[:, 0], step[:, 1]) < 0.5 * wheelbase
    return np.where(is_short, yaw, np.arctan2(step[:, 1], step[:, 0]))


def find_ahead(roads: Roads, lanes: IntArray, arc: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return lane and arc length of places that may lie beyond the end of the first lane.

    Args:
        roads: the lanes.
        lanes: (6, k) int64, the lane of each row and the five ahead of it; -1 beyond a dead end.
        arc: (k,) arc lengths from the start of the first lane [m].

    Returns:
        (k,) int64, rows of lanes, and (k,) arc lengths on them [m]. A place beyond the last lane keeps that lane and
        an arc length greater than its length.
    """
    lane, s = lanes[0].copy(), arc.copy()
    for following in lanes[1:]:
        length = roads.length[lane]
        at = np.flatnonzero((s > length) & (following >= 0))
        if not len(at):
            break
        s[at] -= length[at]
        lane[at] = following[at]
    return lane, s

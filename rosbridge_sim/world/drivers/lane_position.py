"""Positions on lanes: put a vehicle onto the lanes, take it off, and find what lies ahead of it.

The reference point (middle of the rear axle) of a vehicle is on the line of its lane, at arc length `arc`. The middle
of the front axle is on the line as well, and that gives the heading. Vehicles that change lanes or keep beside the line
are shifted from there, see `lane_change_motion`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.drivers.route_choice import RouteChoice
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, is_among, is_any
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.labels import usual_wheelbase
from rosbridge_sim.world.state.settling import settle_on_lanes
from rosbridge_sim.world.state.world import Kind, World
from rosbridge_sim.world.state.world_rows import WorldRows

MAX_LATERAL: Final = 5.0
"""Greatest offset from the line that a driver keeps [m]: more is another lane."""

MAX_WANDER: Final = 0.3
"""Greatest standard deviation of the wander [m]: the aim then reaches 0.71 m, which a car has in a lane of 3.5 m."""

STRAIGHT: Final = 1e-12
"""Segments whose directions differ by no more than this are one straight [rad]: 1e-9 m after a kilometre."""

_LEGS: Final = ("leg_start", "leg_dz")
"""First and last of the columns that hold a straight leg."""


class LaneStart(Record):
    """A vehicle that begins to follow lanes.

    Attributes:
        row: row of a VEHICLE.
        lane: row of a lane.
        s: arc length on the lane, held within it [m].
        desired_speed: speed that the driver wants; limits, bends and other traffic make it slower [m/s].
        route: rows of lanes, each a successor of the one before, the first one `lane`. At its end, or without a
            route, chance chooses.
        is_loop: the route begins again; its first lane is then a successor of its last.
        changes_lanes: the driver changes lanes where that helps it.
        lateral: offset from the line of its lane that the driver keeps, left positive, at most `MAX_LATERAL` [m].
        wander: standard deviation with which the driver wanders about that, see `lane_wander` [m]. One with a
            `lateral` of its own does not wander.
        start_within: the vehicle stands until an EGO is this near, then it starts with the speed that it has now [m]; 0
            for at once.
    """

    row: int
    lane: int
    s: float
    desired_speed: float = math.inf
    route: tuple[int, ...] = ()
    is_loop: bool = False
    changes_lanes: bool = True
    lateral: float = 0.0
    wander: float = 0.0
    start_within: float = 0.0


def keep_lanes(world: World, starts: Sequence[LaneStart]) -> None:
    """Put vehicles onto lanes and have them follow the lanes from there, at first with the speeds that they have.

    Many at once take a third of the time.

    Args:
        world: written in place.
        starts: different rows of VEHICLEs.

    Raises:
        ValueError: a row is no vehicle, there is no such lane, `desired_speed`, `s`, `lateral`, `wander` or
            `start_within` is not a number within bounds, or a route does not lead along lanes. Nothing has changed.
    """
    if not starts:
        return
    for start in starts:
        _check_start(world, start)
    roads = world.roads
    rows = np.array([start.row for start in starts])
    lane = np.array([start.lane for start in starts], dtype=np.int64)
    s = np.minimum(np.maximum(np.array([start.s for start in starts], dtype=np.float64), 0.0), roads.length[lane])
    for start, (x, y, z) in zip(starts, roads.at(lane, s)[0].tolist(), strict=True):
        world.place(start.row, x=x, y=y, z=z, yaw=0.0, speed=max(float(world.speed[start.row]), 0.0))
        world.wheelbase[start.row] = usual_wheelbase(world.bodies[start.row])
        if start.route:
            world.routes[int(world.uid[start.row])] = np.array(start.route, dtype=np.int64)
    is_loop = np.array([start.is_loop for start in starts], dtype=bool)
    desired_speed = np.array([start.desired_speed for start in starts], dtype=np.float64)
    join_lanes(world, rows, lane, s, desired_speed=desired_speed, is_loop=is_loop)
    set_legs(world, roads.derived(LaneConflicts), rows)
    lanes = world.int_block("lane", "ahead_5")[:, rows]
    yaw = world.yaw[rows] = headings(roads, lanes, world.arc[rows], world.wheelbase[rows])
    world.keeps_lane[rows] = [not start.changes_lanes for start in starts]
    world.wander_width[rows] = [start.wander for start in starts]
    lateral = np.array([start.lateral for start in starts], dtype=np.float64)
    if np.count_nonzero(lateral):
        world.lateral[rows] = world.lateral_from[rows] = world.lateral_to[rows] = world.lateral_bias[rows] = lateral
        world.x[rows] -= lateral * np.sin(yaw)
        world.y[rows] += lateral * np.cos(yaw)
    for start in starts:
        if start.start_within > 0.0:
            world.start_within[start.row], world.start_speed[start.row] = start.start_within, world.speed[start.row]
            world.speed[start.row] = 0.0
    settle_on_lanes(world, world.roads, rows)
    world.touch()


def _check_start(world: WorldRows, start: LaneStart) -> None:
    roads, route = world.roads, start.route
    if world.kind.item(start.row) != Kind.VEHICLE or not world.alive[start.row]:
        raise ValueError(f"row {start.row}: expected a vehicle in use, which alone can keep to a lane")
    if not 0 <= start.lane < len(roads):
        raise ValueError(f"lane: expected 0..{len(roads) - 1}, got {start.lane!r}")
    if not (math.isfinite(start.s) and start.desired_speed >= 0.0):
        raise ValueError(
            f"s and desired_speed: expected a finite number and one that is not negative, got {start.s!r} and"
            f" {start.desired_speed!r}"
        )
    if not abs(start.lateral) <= MAX_LATERAL:
        raise ValueError(f"lateral: expected a number within +-{MAX_LATERAL:g} m, got {start.lateral!r}")
    if not 0.0 <= start.wander <= MAX_WANDER:
        raise ValueError(f"wander: expected a number within 0..{MAX_WANDER:g} m, got {start.wander!r}")
    if not (math.isfinite(start.start_within) and start.start_within >= 0.0):
        raise ValueError(f"start_within: expected at least 0 m, got {start.start_within!r}")
    if route and route[0] != start.lane:
        raise ValueError(f"route: expected to begin with lane {start.lane}, got {route[0]}")
    check_route(roads, route, is_loop=start.is_loop)


def check_route(roads: Roads, route: Sequence[int], *, is_loop: bool) -> None:
    """Check that a route leads along lanes.

    Args:
        route: rows of lanes; may be empty.
        is_loop: its first lane follows its last one.

    Raises:
        ValueError: there is no such lane, or one does not follow the one before.
    """
    steps = [*route, route[0]] if route and is_loop else list(route)
    if route and not 0 <= route[0] < len(roads):
        raise ValueError(f"route[0]: expected 0..{len(roads) - 1}, got {route[0]}")
    for i, (here, there) in enumerate(pairwise(steps)):
        if there not in roads.successors(here):
            raise ValueError(f"route[{i}]: lane {there} does not follow lane {here}")


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


def join_lane(world: WorldRows, row: int, lane: int, s: float, *, desired_speed: float, is_loop: bool) -> None:
    """Write the columns that make a row follow lanes, without checks. Its pose stays as it is.

    Args:
        world: written in place; the caller calls `World.touch` afterwards.
        row: row of a VEHICLE or an EGO.
        lane: row of a lane.
        s: arc length on the lane [m].
        desired_speed: see `LaneStart` [m/s].
        is_loop: see `LaneStart`.
    """
    join_lanes(
        world,
        np.array([row]),
        np.array([lane]),
        np.array([s]),
        desired_speed=np.array([desired_speed]),
        is_loop=np.array([is_loop]),
    )


def join_lanes(
    world: WorldRows, rows: IntArray, lane: IntArray, s: FloatArray, *, desired_speed: FloatArray, is_loop: BoolArray
) -> None:
    """Do what `join_lane` does for many rows, each once; all arguments but the world are (k,)."""
    world.has_lane[rows], world.is_loop[rows], world.desired_speed[rows] = True, is_loop, desired_speed
    world.lane[rows], world.arc[rows], world.turns[rows] = lane, s, 0
    for column in (world.claim, world.held, world.exit_lane, world.behind):
        column[rows] = -1
    RouteChoice(world, rows).plan(np.arange(len(rows)))
    # A row that is put beyond the wait point of a lane is in the conflict area already, so it occupies the lane.
    wait_point = world.roads.derived(LaneConflicts).wait_point[lane]
    inside = (s + world.half_length[rows] + world.centre[rows] > wait_point).nonzero()[0]
    if len(inside):
        world.held[rows[inside]], world.exit_lane[rows[inside]] = lane[inside], world.ahead_1[rows[inside]]


def set_legs(world: WorldRows, conflicts: LaneConflicts, rows: IntArray) -> None:
    """Write the straight legs that rows are on, by their lane and arc length.

    Args:
        world: written in place.
        rows: (k,) int64.
    """
    point, _ = world.roads.locate(world.lane[rows], world.arc[rows])
    world.point[rows] = point
    world.block(*_LEGS)[:, rows] = conflicts.legs.take(point, axis=0).T


def enter_next_legs(world: WorldRows, conflicts: LaneConflicts, rows: IntArray) -> IntArray:
    """Write the legs that follow on the same lanes, for rows that are beyond the ends of theirs, in half of the time.

    Args:
        world: written in place.
        rows: (k,) int64.

    Returns:
        Those that are beyond these legs, too, (m,) int64 indices; for them nothing is written.
    """
    if len(rows) == 1:  # the usual case of few vehicles, in a third of the time
        row = rows.item()
        leg = conflicts.legs[world.point.item(row) + 1]
        if world.arc.item(row) >= leg.item(1):
            return np.zeros(1, dtype=np.int64)
        world.point[row] += 1
        world.block(*_LEGS)[:, row] = leg
        return rows[:0]
    point = world.point[rows] + 1
    legs = conflicts.legs.take(point, axis=0)
    is_beyond = world.arc[rows] >= legs[:, 1]  # the last point of a lane has a leg that ends at 0
    farther: IntArray = is_beyond.nonzero()[0]
    if len(farther):
        near = (~is_beyond).nonzero()[0]
        rows, point, legs = rows[near], point[near], legs[near]
    world.point[rows] = point
    world.block(*_LEGS)[:, rows] = legs.T
    return farther


def headings(roads: Roads, lanes: IntArray, arc: FloatArray, wheelbase: FloatArray) -> FloatArray:
    """Return the headings of vehicles that have both axles on the line of their lanes.

    Args:
        lanes: (6, k) int64, see `find_ahead`.
        arc: (k,) arc lengths of the rear axles on the first lane [m].
        wheelbase: (k,) [m].

    Returns:
        (k,) counter-clockwise from east, (-pi, pi] [rad].
    """
    return rear_axles(roads, lanes, arc, wheelbase)[1]


def rear_axles(roads: Roads, lanes: IntArray, arc: FloatArray, wheelbase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the places of the rear axles, (k, 3) [m], and what `headings` returns, with one search for both axles."""
    num = len(arc)
    arcs, both = np.empty(2 * num), np.empty((len(lanes), 2 * num), dtype=np.int64)
    arcs[:num], both[:, :num], both[:, num:] = arc, lanes, lanes
    np.add(arc, wheelbase, arcs[num:])
    point, share = roads.locate(*find_ahead(roads, both, arcs))
    places = roads.places(point, share)
    rear = places[:num]
    step = places[num:] - rear
    east, north = step[:, 0], step[:, 1]
    # At the end of the last lane there is no line for the front axle: take the direction of the lane.
    is_short = np.hypot(east, north) < 0.5 * wheelbase
    heading = np.arctan2(north, east)
    if is_any(is_short):
        heading[is_short] = roads.between(point[num:][is_short], share[num:][is_short])[1]
    return rear, heading


def headings_ahead(
    roads: Roads, lanes: IntArray, arc: FloatArray, wheelbase: FloatArray, *, point: IntArray, moves: BoolArray
) -> FloatArray:
    """Return the same as `headings` for vehicles that move; where both axles are on one straight, in less time.

    Args:
        lanes: (6, k) int64, as for `headings`.
        arc: (k,) arc lengths [m].
        wheelbase: (k,) [m].
        point: (k,) int64, rows of points at or before those places, on the first lanes.
        moves: (k,) bool, which vehicles move.

    Returns:
        (k,) [rad]; of no meaning for vehicles that stand.
    """
    end, yaw = roads.derived(find_straights)
    heading: FloatArray = yaw[point]
    at = ((arc + wheelbase > end[point]) & moves).nonzero()[0]
    if not len(at):
        return heading
    heading[at] = headings(roads, lanes.take(at, axis=1), arc[at], wheelbase[at])
    return heading


def find_straights(roads: Roads) -> tuple[FloatArray, FloatArray]:
    """Return for each point the arc length up to which the lane goes straight on [m], and the direction [rad], (n,)."""
    num = len(roads.points)
    point = np.delete(np.arange(num), roads.first[1:] - 1)  # the last point of a lane has no segment
    yaw, end = np.zeros(num), np.zeros(num)
    yaw[point] = roads.segments.yaw(np.arange(len(point)))
    after = point + 1
    is_end = np.abs(yaw[after] - yaw[point]) > STRAIGHT
    is_end |= is_among(after, roads.first[1:] - 1)
    is_bent = roads.curve[point].any(axis=1)
    is_end |= is_bent | roads.curve[after].any(axis=1)
    # Each takes the end of the next segment that ends a straight.
    last = is_end.nonzero()[0]
    end[point] = roads.s[after[last[np.searchsorted(last, np.arange(len(point)))]]]
    end[point[is_bent]] = -np.inf  # no part of a bend is straight
    return end, yaw


def find_ahead(roads: Roads, lanes: IntArray, arc: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return lane and arc length of places that may lie beyond the end of the first lane.

    Args:
        lanes: (6, k) int64, the lane of each row and the five ahead of it; -1 beyond a dead end.
        arc: (k,) arc lengths from the start of the first lane [m].

    Returns:
        (k,) int64, rows of lanes, and (k,) arc lengths on them [m]. A place beyond the last lane keeps that lane and
        an arc length greater than its length.
    """
    lane, s = lanes[0].copy(), arc.copy()
    for following in lanes[1:]:
        length = roads.length[lane]
        at = (s > length).nonzero()[0]
        at = at[following[at] >= 0] if len(at) else at
        if not len(at):
            break
        s[at] -= length[at]
        lane[at] = following[at]
    return lane, s

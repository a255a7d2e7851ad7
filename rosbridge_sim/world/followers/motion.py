"""Velocity and acceleration of any rows at their reference points, each in the frame of its own row.

The frame of a row is the map frame rotated by its yaw alone: x forward, y to the left, z up. The reference point is
that of `state`: the middle of the rear axle of a vehicle, the centre of any other entity.

*Velocity* is that at the end of the last step. *Acceleration* is its change over the last step, divided by the step,
in the present frame of the row. How they are found depends on what moves the row:

- On a path or a lane the velocity is speed * n, and the acceleration (v1 n1 - v0 n0) / dt. A path is made of straight
  legs, so the direction jumps at each of its points. The bare derivative would be 0, with a peak of ten to thirty
  m/s^2 at each point of a bend. So n is the mean direction over `SPAN` of the line, half of it behind and half ahead.
  The line of a lane is smooth but for its sharp corners, and the span there is the way of `SPAN_TIME`. Its length is
  one (for a lane in the plane, since its arc length is measured there). Only in a corner sharper than a right angle
  it is less, because there the direction turns round. Drivers who change lanes or wander move aslant of the line by
  `drift` and `wander_slope`. A body that follows a bend does not look exactly where its reference point goes, so
  there is a part to the left.
- Constant motion is along the heading.
- A driven row of the kinematic model moves along its heading, because its wheels do not slip. Its acceleration to the
  left is speed * yaw rate. With tyres that slip, it has a velocity to the left.
- A ghost shows what it was given; see `placement`.

A row that is placed elsewhere, or stops at once at the end of its path, has no acceleration from that.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.lane_position import find_ahead
from rosbridge_sim.world.geometry.bends import offset, slope
from rosbridge_sim.world.geometry.planar import ComplexArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.paths import DX, DY, DZ, START, X, Y, Z
from rosbridge_sim.world.state.world import DT, Kind
from rosbridge_sim.world.state.world_rows import WorldRows

SPAN: Final = {Kind.VEHICLE: 2.0, Kind.PEDESTRIAN: 0.5, Kind.OBSTACLE: 0.5}
"""The length of line over which a direction is averaged [m]. Lanes have a point each half metre or metre, and bends of
4 m radius and more; a pedestrian turns within a step."""

SPAN_TIME: Final = 0.06
LEAST_SPAN: Final = 0.2
"""On a lane the span is the way of this time [s], at least the second number [m] and at most `SPAN`. Where a bend of
radius R begins, the told direction is off by span / 8 R: 0.02 m/s at 5 m/s in a bend of 9 m, and twice as much where a
left bend meets a right one."""

TURNING_ROUND: Final = 0.7
"""The ends of a span are nearer to each other than this share of it, if it has a corner sharper than 90 deg."""

ALIGNED: Final = 1e-9
"""A share of the speed below this is rounding: two ways to compute a direction differ by so much."""

NO_ACCEL: Final = 1e-8
"""An acceleration below this is rounding [m/s^2]."""

_SPANS: Final = np.array([SPAN.get(kind, 0.0) for kind in Kind])  # by kind; an EGO follows no line

_Points = tuple[ComplexArray, FloatArray]
"""Places [m] or directions: east + i north, and up; (k,) each."""


def motion(world: WorldRows, rows: IntArray) -> FloatArray:
    """Return velocity and acceleration of rows.

    Args:
        world: read only.
        rows: (k,) int64, any rows in use.

    Returns:
        (6, k) velocity forward, left and up [m/s], acceleration forward, left and up [m/s^2].
    """
    columns = (world.speed, world.lateral_speed, world.climb, world.accel, world.lateral_accel, world.climb_accel)
    figures = np.empty((6, len(rows)))
    for i, column in enumerate(columns):
        column.take(rows, out=figures[i])
    lines = world.derived(_Lines)
    if lines.is_any:
        at = lines.is_followed[rows].nonzero()[0]
        if len(at):
            figures[:, at] = _along(world, lines, rows[at])
    return figures


class _Lines:
    """The rows that follow a line. It lives until the next `World.touch`.

    Attributes:
        is_followed: (n,) bool, the row follows a lane or a path.
        is_any: whether any row does.
        half: (n,) half of the span, on lanes at most [m].
    """

    def __init__(self, world: WorldRows) -> None:
        # A pedestrian that heeds others walks beside its path, straight on between its decisions.
        is_walker = (world.kind == Kind.PEDESTRIAN) & (world.yields > 0)
        is_steered = world.is_ghost | (world.kind == Kind.EGO) | is_walker
        self.is_followed = (world.has_lane | world.has_path) & ~is_steered
        self.is_any = bool(self.is_followed.any())
        # On a small loop the span is a quarter of it, or its two ends could be the same place.
        is_loop = world.is_loop & world.has_path
        self.half = 0.5 * np.fmin(_SPANS[world.kind], np.where(is_loop, 0.25 * world.path_length, np.inf))


def _along(world: WorldRows, lines: _Lines, rows: IntArray) -> FloatArray:
    """Return the `motion` of rows (k,) that follow a line, (6, k)."""
    figures = np.zeros((6, len(rows)))
    speed, before = world.speed[rows], world.speed[rows] - world.accel[rows] * DT
    arc, half, is_on_lane = world.arc[rows], lines.half[rows], world.has_lane[rows]
    then = arc - (speed + before) * (0.5 * DT)
    half, old_half = (
        np.where(is_on_lane, np.fmin(half, np.fmax(0.5 * SPAN_TIME * v, 0.5 * LEAST_SPAN)), half)
        for v in (speed, before)
    )
    start, end, _, _, _, east, north, up = world.block("leg_start", "leg_dz").take(rows, axis=1)
    leg = east + 1j * north
    curve = world.roads.curve[world.point[rows]] * is_on_lane[:, None] if len(world.roads) else np.zeros((len(rows), 2))
    now: _Points = leg, up
    past: _Points = now
    if np.count_nonzero(curve):
        now = leg * _turn(curve, arc - start, end - start, half), up
        past = leg * _turn(curve, then - start, end - start, old_half), up
    # Far enough from both ends of a leg, the direction is that of the leg.
    is_bent = (then - old_half < start) | (arc + half > end)
    bent = (is_bent & (speed + before > 0.0)).nonzero()[0]
    if len(bent):
        past = past[0].copy(), up.copy()
        halves = np.concatenate([half[bent], old_half[bent]])
        _bend(world, rows[bent], np.concatenate([arc[bent], then[bent]]), halves, (now, past, bent))
    to_body = np.exp(-1j * world.yaw[rows])
    velocity, old = speed * now[0] * to_body, before * past[0] * to_body
    drift = world.drift[rows] + world.wander_slope[rows]
    drift_rate = world.drift_rate[rows] + world.wander_slope_rate[rows]
    if np.count_nonzero(drift) or np.count_nonzero(drift_rate):
        velocity, old = velocity * np.exp(1j * drift), old * np.exp(1j * (drift - drift_rate * DT))
    accel = (velocity - old) / DT
    forward, left = velocity.real, velocity.imag
    is_ahead = (np.abs(left) <= ALIGNED * speed) & (forward >= (1.0 - ALIGNED) * speed)
    figures[0], figures[1] = np.where(is_ahead, speed, forward), np.where(is_ahead, 0.0, left)
    figures[3], figures[4] = accel.real, np.where(np.abs(accel.imag) < NO_ACCEL, 0.0, accel.imag)
    if np.count_nonzero(up) or np.count_nonzero(past[1]):
        figures[2], figures[5] = speed * up, (speed * up - before * past[1]) / DT
    return figures


def _bend(
    world: WorldRows, rows: IntArray, arc: FloatArray, half: FloatArray, directions: tuple[_Points, _Points, IntArray]
) -> None:
    """Write the mean directions of the lines, now and one step before, for rows that are near a corner.

    Args:
        world: read only.
        rows: (k,) int64, rows that follow a lane or a path.
        arc: (2 k,) present arc lengths, then those one step before [m].
        half: (2 k,) halves of their spans [m].
        directions: written: present directions and those one step before, (n,) each; and (k,) int64, the index of each
            row in them.
    """
    num = len(rows)
    arcs = np.concatenate([arc + half, arc - half])
    owners = np.concatenate([rows, rows, rows, rows])
    is_path = world.has_path[owners]
    num_paths = np.count_nonzero(is_path)
    if num_paths == len(owners):
        place, height = _on_paths(world, owners, arcs)
    elif not num_paths:
        place, height = _on_lanes(world, owners, arcs)
    else:
        place, height = np.empty(4 * num, dtype=np.complex128), np.empty(4 * num)
        place[is_path], height[is_path] = _on_paths(world, owners[is_path], arcs[is_path])
        place[~is_path], height[~is_path] = _on_lanes(world, owners[~is_path], arcs[~is_path])
    step, rise = place[: 2 * num] - place[2 * num :], height[: 2 * num] - height[2 * num :]
    # A path is measured in space, a lane on the map.
    length = np.hypot(np.abs(step), rise * is_path[: 2 * num])
    length = np.fmax(length, 2.0 * TURNING_ROUND * half)
    step, rise = step / length, rise / length
    now, past, at = directions
    for i, direction in enumerate((now, past)):
        part = slice(i * num, (i + 1) * num)
        direction[0][at], direction[1][at] = step[part], rise[part]


def _on_paths(world: WorldRows, rows: IntArray, arc: FloatArray) -> _Points:
    """Return the points at arc lengths (k,) of the paths of rows (k,); beyond an end a path continues straight."""
    length = world.path_length[rows]
    arc = np.where(world.is_loop[rows], np.mod(arc, length), arc)
    return _on_legs(world.find_legs(world.path_bases(rows), np.fmin(np.fmax(arc, 0.0), length)), arc)


def _on_lanes(world: WorldRows, rows: IntArray, arc: FloatArray) -> _Points:
    """Return the points at arc lengths (k,) of the lanes of rows (k,); beyond these they continue straight."""
    roads = world.roads
    lane, s = find_ahead(roads, world.int_block("lane", "ahead_5").take(rows, axis=1), arc)
    behind = world.behind[rows]
    is_before = ((s < 0.0) & (behind >= 0)).nonzero()[0]
    if len(is_before):
        lane[is_before] = behind[is_before]
        s[is_before] += roads.length[lane[is_before]]
    point = roads.locate(lane, s)[0]
    legs, curve = roads.derived(LaneConflicts).legs[point], roads.curve[point]
    plane, height = _on_legs(legs, s)
    if np.count_nonzero(curve):
        length = legs[:, 1] - legs[:, START]
        aside = offset(curve, np.fmin(np.fmax(s - legs[:, START], 0.0), length), length)
        plane += aside * (1j * legs[:, DX] - legs[:, DY])
    return plane, height


def _turn(curve: FloatArray, along: FloatArray, length: FloatArray, half: FloatArray) -> ComplexArray:
    """Return the mean directions of smooth lines from `half` behind to `half` ahead, relative to their legs, (k,).

    Args:
        curve: (k, 2) see `bends.leg_curves`.
        along: (k,) distances from the start of the leg [m].
        length: (k,) of the legs [m].
        half: (k,) half of the span [m].
    """
    aside = 1.0 + 1j * (slope(curve, along, length) - curve[:, 1] * half * half)
    return np.asarray(aside / np.abs(aside))


def _on_legs(legs: FloatArray, arc: FloatArray) -> _Points:
    """Return the points at arc lengths (k,) of legs (k, 8 or 10), whose columns begin like those of a path segment."""
    legs = legs.T
    distance = arc - legs[START]
    plane = legs[X] + distance * legs[DX] + 1j * (legs[Y] + distance * legs[DY])
    return plane, legs[Z] + distance * legs[DZ]

"""Velocity and acceleration of any rows at their reference points, each in the frame of its own row.

The frame of a row is the map frame turned by its yaw alone: x forward, y to the left, z up. The reference point is that
of `state`: the middle of the rear axle of a vehicle, the centre of anything else.

*Velocity* is that at the end of the last step. *Acceleration* is its change over the last step, divided by the step,
in the frame of the row as it is now. How they are known depends on what moves the row:

- On a path or a lane it is speed * n, and the acceleration (v1 n1 - v0 n0) / dt. The line is made of straight legs, so
  the direction of the motion jumps at each of its points, and the bare derivative would be 0 but for a kick of ten or
  thirty m/s^2 at each point of a bend. So n is the mean direction over `SPAN` of the line, half of it behind and half
  ahead. It is of length one (for a lane, whose arc length is that on the map, on the map), but within a corner sharper
  than a right angle, where it shrinks on the way to turning round. A body that follows a bend does not look exactly
  where its reference point goes: so there is a part to the left.
- Constant motion is along the heading.
- A driven row moves along its heading, for its wheels do not slip; its acceleration to the left is speed * yaw rate.
- A ghost shows what it was told to; see `dynamics`.

Who is put somewhere else, or stands at once because his path has ended, has no acceleration by that.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import ComplexArray, FloatArray, IntArray
from rosbridge_sim.world.lane_conflicts import LaneConflicts
from rosbridge_sim.world.lane_position import find_ahead
from rosbridge_sim.world.paths import DX, DY, DZ, START, X, Y, Z
from rosbridge_sim.world.state import DT, Kind, World

__all__ = ["SPAN", "motion"]

SPAN: Final = {Kind.VEHICLE: 2.0, Kind.PEDESTRIAN: 0.5, Kind.OBSTACLE: 0.5}
"""The length of line that counts for a direction [m]. Lanes have a point each half metre or metre, and bends of 4 m and
more; who is on foot turns within a step."""

TURNING_ROUND: Final = 0.7
"""Both ends of a span are nearer to each other than this share of it where it has a corner sharper than 90 deg."""

ALIGNED: Final = 1e-9
"""Share of the speed that means nothing: what rounding leaves between two ways to work out a direction."""

NO_ACCEL: Final = 1e-8
"""The same of an acceleration [m/s^2]."""

_SPANS: Final = np.array([SPAN.get(kind, 0.0) for kind in Kind])  # by kind; nobody drives an EGO along a line

_Points = tuple[ComplexArray, FloatArray]
"""Places or directions: east + i north, and up."""


def motion(world: World, rows: IntArray) -> FloatArray:
    """Return how rows move.

    Args:
        world: read only.
        rows: (k,) of anybody.

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
    """Facts about the lines that rows follow, which hold until an entity comes, goes or is put elsewhere.

    Attributes:
        is_followed: (n,) whether the row follows a lane or a path.
        is_any: whether any row does.
        half: (n,) half of the span that counts [m].
    """

    def __init__(self, world: World) -> None:
        is_steered = world.is_ghost | (world.kind == Kind.EGO)
        self.is_followed = (world.has_lane | world.has_path) & ~is_steered
        self.is_any = bool(self.is_followed.any())
        # Of a small loop a quarter, or both ends of the span would be one place.
        is_loop = world.is_loop & world.has_path
        self.half = 0.5 * np.fmin(_SPANS[world.kind], np.where(is_loop, 0.25 * world.path_length, np.inf))


def _along(world: World, lines: _Lines, rows: IntArray) -> FloatArray:
    """Return the `motion` of rows that follow a line."""
    figures = np.zeros((6, len(rows)))
    speed, before = world.speed[rows], world.speed[rows] - world.accel[rows] * DT
    arc, half = world.arc[rows], lines.half[rows]
    then = arc - (speed + before) * (0.5 * DT)
    start, end, _, _, _, east, north, up = world.block("leg_start", "leg_dz")[:, rows]
    now: _Points = east + 1j * north, up
    past: _Points = now
    # On a leg, far enough from both its ends, the direction is that of the leg.
    bent = (((then - half < start) | (arc + half > end)) & (speed + before > 0.0)).nonzero()[0]
    if len(bent):
        past = now[0].copy(), up.copy()
        _bend(world, rows[bent], np.concatenate([arc[bent], then[bent]]), half[bent], (now, past, bent))
    to_body = np.exp(-1j * world.yaw[rows])
    velocity, old = speed * now[0] * to_body, before * past[0] * to_body
    accel = (velocity - old) / DT
    forward, left = velocity.real, velocity.imag
    is_ahead = (np.abs(left) <= ALIGNED * speed) & (forward >= (1.0 - ALIGNED) * speed)
    figures[0], figures[1] = np.where(is_ahead, speed, forward), np.where(is_ahead, 0.0, left)
    figures[3], figures[4] = accel.real, np.where(np.abs(accel.imag) < NO_ACCEL, 0.0, accel.imag)
    if np.count_nonzero(up) or np.count_nonzero(past[1]):
        figures[2], figures[5] = speed * up, (speed * up - before * past[1]) / DT
    return figures


def _bend(
    world: World,
    rows: IntArray,
    arc: FloatArray,
    half: FloatArray,
    directions: tuple[_Points, _Points, IntArray],
) -> None:
    """Write the mean directions of lines around two places of each row into those of now and of the step before.

    Args:
        world: read only.
        rows: (k,) that follow a lane or a path.
        arc: (2 k,) where they are, then where they were [m].
        half: (k,) half of the span [m].
        directions: those of now and of the step before, (n,) each, and (k,) where in them the rows are.
    """
    num = len(rows)
    half = np.concatenate([half, half])
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
    way, rise = place[: 2 * num] - place[2 * num :], height[: 2 * num] - height[2 * num :]
    # A path is measured in space, a lane on the map.
    length = np.hypot(np.abs(way), rise * is_path[: 2 * num])
    length = np.fmax(length, 2.0 * TURNING_ROUND * half)
    way, rise = way / length, rise / length
    now, past, at = directions
    for i, direction in enumerate((now, past)):
        part = slice(i * num, (i + 1) * num)
        direction[0][at], direction[1][at] = way[part], rise[part]


def _on_paths(world: World, rows: IntArray, arc: FloatArray) -> _Points:
    """Return points at arc lengths of the paths of rows; beyond an end a path goes straight on."""
    length = world.path_length[rows]
    arc = np.where(world.is_loop[rows], np.mod(arc, length), arc)
    return _on_legs(world.paths.find(world.path_base[rows], np.fmin(np.fmax(arc, 0.0), length)), arc)


def _on_lanes(world: World, rows: IntArray, arc: FloatArray) -> _Points:
    """Return the same on the lanes of rows; before the lane that they have come from they go straight as well."""
    roads = world.roads
    lane, s = find_ahead(roads, world.int_block("lane", "ahead_5")[:, rows], arc)
    behind = world.behind[rows]
    is_before = ((s < 0.0) & (behind >= 0)).nonzero()[0]
    if len(is_before):
        lane[is_before] = behind[is_before]
        s[is_before] += roads.length[lane[is_before]]
    return _on_legs(roads.derived(LaneConflicts).legs[roads.locate(lane, s)[0]], s)


def _on_legs(legs: FloatArray, arc: FloatArray) -> _Points:
    """Return points at arc lengths of straight legs, whose columns begin as those of a segment of a path do."""
    legs = legs.T
    way = arc - legs[START]
    return legs[X] + way * legs[DX] + 1j * (legs[Y] + way * legs[DY]), legs[Z] + way * legs[DZ]

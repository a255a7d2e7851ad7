"""Velocity and acceleration of any rows at their reference points, each in the frame of its own row.

The frame of a row is the map frame turned by its yaw alone: x forward, y to the left, z up. The reference point is that
of `state`: the middle of the rear axle of a vehicle, the centre of anything else.

*Velocity* is that at the end of the last step. *Acceleration* is its change over the last step, divided by the step,
in the frame of the row as it is now. How they are known depends on what moves the row:

- On a path or a lane it is speed * n, and the acceleration (v1 n1 - v0 n0) / dt. The line is made of straight legs, so
  the direction of the motion jumps at each of its points, and the bare derivative would be 0 but for a kick of ten or
  thirty m/s^2 at each point of a bend. So n is the mean direction over `SPAN` of the line, half of it behind and half
  ahead. It is of length one, but within a corner sharper than a right angle, where it shrinks on the way to turning
  round. A body that follows a bend does not look exactly where its reference point goes: so there is a part to the
  left.
- Constant motion is along the heading.
- A driven row moves along its heading, for its wheels do not slip; its acceleration to the left is speed * yaw rate.
- A ghost shows what it was told to; see `dynamics`.

Who is put somewhere else, or stands at once because his path has ended, has no acceleration by that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray
from rosbridge_sim.world.network import Network
from rosbridge_sim.world.paths import DX, DZ, START, X, Z
from rosbridge_sim.world.state import DT, Kind, World
from rosbridge_sim.world.traffic import onto

__all__ = ["SPAN", "motion"]

SPAN: Final = {Kind.VEHICLE: 2.0, Kind.PEDESTRIAN: 0.5, Kind.OBSTACLE: 0.5}
"""The length of line that counts for a direction [m]. Lanes have a point each half metre or metre, and bends of 4 m and
more; who is on foot turns within a step."""

TURNING_ROUND: Final = 0.7
"""Both ends of a span are nearer to each other than this share of it where it has a corner sharper than 90 deg."""

ALIGNED: Final = 1e-9
"""Angle that means nothing: what rounding leaves between two ways to work out a direction [rad]."""

_SPANS: Final = np.array([SPAN.get(kind, 0.0) for kind in Kind])  # by kind; nobody drives an EGO along a line

_Place = Callable[[World, IntArray, FloatArray], FloatArray]


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
    on_lane = (world.has_lane & ~world.is_ghost & (world.kind != Kind.EGO))[rows]
    if on_lane.any():
        figures[:, on_lane] = _along(world, rows[on_lane], _on_lanes)
    on_path = (world.has_path & ~world.is_ghost)[rows]
    if on_path.any():
        figures[:, on_path] = _along(world, rows[on_path], _on_paths)
    return figures


def _along(world: World, rows: IntArray, place: _Place) -> FloatArray:
    """Return the `motion` of rows that follow a line; `place` finds points of it."""
    figures = np.zeros((6, len(rows)))
    speed, accel = world.speed[rows], world.accel[rows]
    before = speed - accel * DT
    moves = np.flatnonzero((speed != 0.0) | (before != 0.0))
    if not len(moves):
        return figures
    rows, speed, accel, before = rows[moves], speed[moves], accel[moves], before[moves]
    arc = world.arc[rows]
    then = arc - (speed + before) * (0.5 * DT)
    # Of a small loop a quarter, or both ends of the span would be one place.
    is_loop = world.is_loop[rows] & world.has_path[rows]
    span = np.fmin(_SPANS[world.kind[rows]], np.where(is_loop, 0.25 * world.path_length[rows], np.inf))
    half = 0.5 * span
    ends = place(world, np.tile(rows, 4), np.concatenate([arc + half, then + half, arc - half, then - half]))
    way = (ends[:, : 2 * len(rows)] - ends[:, 2 * len(rows) :]) / np.tile(span, 2)
    length = np.sqrt(np.square(way).sum(axis=0))
    way /= np.fmax(length, TURNING_ROUND)
    now, turn = way[:, : len(rows)], way[:, : len(rows)] - way[:, len(rows) :]
    turn[:, (np.abs(turn) < ALIGNED).all(axis=0)] = 0.0
    east, north, up = now
    yaw = world.yaw[rows]
    cos, sin = np.cos(yaw), np.sin(yaw)
    forward, left = east * cos + north * sin, north * cos - east * sin
    is_level = (np.abs(up) < ALIGNED) & (length[: len(rows)] >= TURNING_ROUND)
    is_aligned = (np.abs(left) < ALIGNED) & (forward > 0.0)
    forward = np.where(is_aligned, np.where(is_level, 1.0, np.hypot(east, north)), forward)
    left, up = np.where(is_aligned, 0.0, left), np.where(is_level, 0.0, up)
    kick = turn * (before / DT)
    figures[:, moves] = (
        *(speed * forward, speed * left, speed * up),
        accel * forward + (kick[0] * cos + kick[1] * sin),
        accel * left + (kick[1] * cos - kick[0] * sin),
        accel * up + kick[2],
    )
    return figures


def _on_paths(world: World, rows: IntArray, arc: FloatArray) -> FloatArray:
    """Return points at arc lengths of the paths of rows, (3, k); beyond an end a path goes straight on."""
    length = world.path_length[rows]
    is_loop = world.is_loop[rows]
    arc = np.where(is_loop, np.mod(arc, length), arc)
    segments = world.paths.find(world.path_base[rows], np.clip(arc, 0.0, length))
    return (segments[:, X : Z + 1] + (arc - segments[:, START])[:, None] * segments[:, DX : DZ + 1]).T


def _on_lanes(world: World, rows: IntArray, arc: FloatArray) -> FloatArray:
    """Return the same on the lanes of rows; before the lane that they have come from they go straight as well."""
    roads = world.roads
    lanes = world.int_block("lane", "ahead_5")[:, rows]
    behind = world.behind[rows]
    lane, s = onto(roads, lanes, arc)
    is_before = (s < 0.0) & (behind >= 0)
    lane = np.where(is_before, behind, lane)
    s = np.where(is_before, s + roads.length[lane], s)
    legs = roads.derived(Network).legs[roads.locate(lane, s)[0]]
    return (legs[:, 2:5] + (s - legs[:, 0])[:, None] * legs[:, 5:8]).T

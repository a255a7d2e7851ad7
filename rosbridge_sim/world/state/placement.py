"""Placement of rows from outside: teleports, and ghosts that steps leave where they are.

A *ghost* is a row whose motion comes from elsewhere, such as a recording or another simulator.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state.labels import check_pose
from rosbridge_sim.world.state.settling import settle
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_SPEED, Dynamics, Kind, World
from rosbridge_sim.world.state.world_rows import WorldRows

_TILTS: Final = {"roll": "ground_roll", "pitch": "ground_pitch"}


def teleport(
    world: World,
    row: int,
    *,
    x: float,
    y: float,
    z: float,
    yaw: float,
    speed: float = 0.0,
    roll: float = 0.0,
    pitch: float = 0.0,
    is_ghost: bool = False,
) -> None:
    """Place a row somewhere else. Commands, gear and steering stay. It leaves its path or lane.

    On a map with hills it is put onto the ground: z chooses between a bridge and the road below it, and roll and pitch
    are those of the ground.

    Args:
        world: written in place.
        row: any row in use.
        x: new reference point, east [m].
        y: the same, north [m].
        z: the same, up [m].
        yaw: new heading, wrapped [rad].
        speed: new speed along it [m/s].
        roll: [rad].
        pitch: [rad].
        is_ghost: see `place_ghost`.

    Raises:
        ValueError: a number is not finite or out of bounds. Nothing has moved.
    """
    check_pose(x=x, y=y, z=z, yaw=yaw, speed=speed, roll=roll, pitch=pitch)
    world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
    world.tilt(row, roll=roll, pitch=pitch)
    set_ghost(world, row, is_ghost=is_ghost)
    if not (is_ghost or world.roads.is_flat):
        settle(world, world.roads, np.array([row]), np.array([z]))


def set_speed(world: World, row: int, speed: float) -> None:
    """Set the speed of a row at once. Its path or lane and its commands stay; it waits for no ego any more.

    A ghost stops being one.

    Args:
        world: written in place.
        row: any row in use.
        speed: along the heading, the path or the lane; not negative on a path or a lane [m/s].

    Raises:
        ValueError: not finite, out of bounds, or negative on a path or a lane. Nothing has changed.
    """
    check_pose(speed=speed)
    if speed < 0.0 and (world.has_path[row] or (world.has_lane[row] and world.kind[row] != int(Kind.EGO))):
        raise ValueError(f"speed: expected >= 0 on a path or a lane, got {speed!r}")
    if world.loose[row] and world.kind[row] == int(Kind.EGO):
        world.loose[row] = 0.0
    elif world.loose[row]:
        x, y, z, yaw = (float(getattr(world, name)[row]) for name in ("x", "y", "z", "yaw"))
        world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
    world.speed[row] = speed
    if world.yields[row]:
        world.desired_speed[row] = speed
    if world.dynamics == Dynamics.SINGLE_TRACK and world.kind[row] == int(Kind.EGO):
        world.lateral_speed[row] = world.yaw_rate[row] = 0.0
    world.start_within[row] = world.start_speed[row] = 0.0
    set_ghost(world, row, is_ghost=False)
    world.touch()  # it may move now, or no longer


def place_ghost(world: World, row: int, **pose: float) -> None:
    """Place a row as a ghost: steps leave it there, until a `teleport` or, for a driven row, a `command`.

    Ghosts collide only at their final pose, not along the jump. Other entities see the speed that is given here. They
    are not put onto the ground.

    Args:
        world: written in place.
        row: any row in use.
        pose: as for `teleport`; a speed is that which others see.

    Raises:
        ValueError: a number is not finite or out of bounds. Nothing has moved.
    """
    teleport(world, row, is_ghost=True, **pose)


def place_ghosts(world: World, rows: IntArray, poses: FloatArray) -> None:
    """Place many rows as ghosts at once; see `place_ghost`.

    Args:
        world: written in place.
        rows: (m,) int64, any rows in use, each once.
        poses: (7, m) x, y, z [m], yaw [rad], speed [m/s], roll, pitch [rad].

    Raises:
        ValueError: a number is not finite or out of bounds. Nothing has moved.
    """
    x, y, z, yaw, speed, roll, pitch = poses
    limits = np.array(
        [MAX_COORDINATE, MAX_COORDINATE, MAX_COORDINATE, MAX_COORDINATE, MAX_SPEED, *[MAX_COORDINATE] * 2]
    )
    if not (np.abs(poses) <= limits[:, None]).all():
        raise ValueError("poses: expected finite numbers within the bounds of the world")
    world.place_all(rows, x=x, y=y, z=z, yaw=yaw, speed=speed)
    world.roll[rows], world.pitch[rows] = roll, pitch
    is_ego = world.kind[rows] == int(Kind.EGO)
    world.ground_roll[rows], world.ground_pitch[rows] = np.where(is_ego, roll, 0.0), np.where(is_ego, pitch, 0.0)
    world.is_ghost[rows] = True
    world.touch()


def show_ghosts(world: World, rows: IntArray, columns: Sequence[str], values: FloatArray) -> None:
    """Write columns of many ghosts at once, as they were recorded or computed elsewhere. Steps leave them as they are.

    The rows stay ghosts until a `teleport` or, for driven rows, a `command`.

    Args:
        world: written in place.
        rows: (m,) int64, any rows in use.
        columns: the columns to write: of x, y, z, roll, pitch, yaw, speed, lateral_speed, climb, accel, lateral_accel,
            climb_accel, yaw_rate and, for driven rows, steer, throttle and brake.
        values: (columns, m) in the world's units and within its bounds, which is not checked; headings are wrapped.
            NaN leaves a value as it is.
    """
    for name, figures in zip(columns, values, strict=True):
        column = getattr(world, name)
        column[rows] = np.where(np.isnan(figures), column[rows], wrap_angle(figures) if name == "yaw" else figures)
        if name in _TILTS:  # an ego that is driven again leans from here
            is_ego = world.kind[rows] == int(Kind.EGO)
            getattr(world, _TILTS[name])[rows] = np.where(is_ego, column[rows], 0.0)
    if not world.is_ghost[rows].all():
        world.is_ghost[rows] = True
        world.touch()


def set_ghost(world: WorldRows, row: int, *, is_ghost: bool) -> None:
    """Mark a row as a ghost or as none.

    Args:
        world: written in place.
        row: any row in use.
    """
    if world.is_ghost.item(row) != is_ghost:
        world.is_ghost[row] = is_ghost
        world.touch()
        if is_ghost:
            return
        limit = world.max_steer.item(row)  # what was recorded may be beyond what its wheels and pedals can do
        for column, low, high in ((world.steer, -limit, limit), (world.throttle, 0.0, 1.0), (world.brake, 0.0, 1.0)):
            column[row] = min(max(column.item(row), low), high)
        if not world.roads.is_flat:  # from here on it is on the ground
            settle(world, world.roads, np.array([row]), world.z[[row]])

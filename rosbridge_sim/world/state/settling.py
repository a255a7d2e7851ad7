"""Entities on the ground: their height, pitch and roll, and the acceleration of driven rows by its slope.

On a flat map nothing here is called. On others all rows stand on the surface of the roads, but ghosts: these keep the
pose that they were given. A row that moves is put onto the ground at the end of its motion within a step; one that is
placed, at once. Which of two roads above one another it is, its height before tells (`surface`).

- Reference points are on the ground. Vehicles and obstacles pitch and roll with it; pedestrians stay upright.
- Vehicles that follow lanes are on the line of their lane already, so only their pitch and roll are looked up there.
- A slope acts on driven rows by `grade`, in the single track model: -g sin(slope) along the heading.

Limits of the model: distances and speeds are those in the plane, which on a slope of 10 % are 0.5 % less than those
along the road. The ground's slope to the side moves nothing.
"""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.surface import Ground, Surface
from rosbridge_sim.world.state.entity_arrays import EntityArrays
from rosbridge_sim.world.state.entity_types import GRAVITY, Kind


def settle(arrays: EntityArrays, roads: Roads, rows: IntArray, z: FloatArray | None) -> None:
    """Put rows onto the ground where they are.

    Args:
        arrays: written in place.
        roads: not flat.
        rows: (k,) int64, rows in use.
        z: (k,) heights, which choose between a bridge and the road below it; None for the lowest road [m].
    """
    settle_on(arrays, rows, roads.derived(Surface).find(arrays.x[rows], arrays.y[rows], z))


def settle_on(arrays: EntityArrays, rows: IntArray, ground: Ground) -> None:
    """Put rows onto the ground that has been found where they are.

    Args:
        arrays: written in place.
        rows: (k,) int64, rows in use.
    """
    arrays.z[rows] = ground.height
    free = rows[~(arrays.has_path[rows] | arrays.has_lane[rows])]
    arrays.leg_z[free] = arrays.z[free]  # constant motion goes on from here
    _lean(arrays, rows, ground)


def settle_on_lanes(arrays: EntityArrays, roads: Roads, rows: IntArray) -> None:
    """Pitch and roll rows that follow lanes with the ground, if that is not flat.

    Args:
        arrays: written in place.
        roads: of the lanes that they follow.
        rows: (k,) int64, no egos; their legs are up to date.
    """
    if roads.is_flat:
        return
    along, left = roads.derived(Surface).find_on_lanes(
        arrays.point[rows], roads.in_map(arrays.lane[rows]), arrays.arc[rows]
    )
    arrays.pitch[rows], arrays.roll[rows] = _tilt(along, left)


def keep_level(arrays: EntityArrays) -> None:
    """Take the slope of former roads from all driven rows, because the new ones are flat."""
    rows = np.flatnonzero(arrays.alive & (arrays.kind == int(Kind.EGO)))
    arrays.grade[rows] = arrays.ground_pitch[rows] = arrays.ground_roll[rows] = 0.0
    arrays.climb[rows] = arrays.climb_accel[rows] = 0.0
    arrays.pitch[rows], arrays.roll[rows] = arrays.lean_pitch[rows], arrays.lean_roll[rows]


def _lean(arrays: EntityArrays, rows: IntArray, ground: Ground) -> None:
    """Pitch and roll rows (k,) with the ground below them."""
    yaw = arrays.yaw[rows]
    cos, sin = np.cos(yaw), np.sin(yaw)
    ahead, left = ground.east * cos + ground.north * sin, ground.north * cos - ground.east * sin
    is_upright = arrays.kind[rows] == int(Kind.PEDESTRIAN)
    pitch, roll = _tilt(np.where(is_upright, 0.0, ahead), np.where(is_upright, 0.0, left))
    is_ego = (arrays.kind[rows] == int(Kind.EGO)).nonzero()[0]
    if len(is_ego):
        egos = rows[is_ego]
        arrays.ground_pitch[egos], arrays.ground_roll[egos] = pitch[is_ego], roll[is_ego]
        arrays.grade[egos] = GRAVITY * np.sin(pitch[is_ego])
        pitch[is_ego] += arrays.lean_pitch[egos]
        roll[is_ego] += arrays.lean_roll[egos]
    arrays.pitch[rows], arrays.roll[rows] = pitch, roll


def _tilt(ahead: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return pitch and roll of a body on a plane that rises ahead and to the left by these shares, (k,) each [rad]."""
    return np.arctan(-ahead), np.arctan2(left, np.sqrt(1.0 + ahead * ahead))

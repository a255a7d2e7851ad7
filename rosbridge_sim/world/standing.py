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

from typing import TYPE_CHECKING, Final

import numpy as np

from rosbridge_sim.world.entity_types import Dynamics, Kind
from rosbridge_sim.world.geometry import FloatArray, IntArray
from rosbridge_sim.world.surface import Ground, Surface

if TYPE_CHECKING:  # `state` calls `settle`
    from rosbridge_sim.world.state import World

__all__ = ["keep_level", "settle", "settle_on_lanes", "stand"]

G: Final = 9.80665
"""Acceleration of free fall, as in `sensors` [m/s^2]."""


def settle(world: World, rows: IntArray, z: FloatArray | None) -> None:
    """Put rows onto the ground where they are.

    Args:
        world: written in place; its roads are not flat.
        rows: (k,) int64, rows in use.
        z: (k,) heights, which choose between a bridge and the road below it; None for the lowest road [m].
    """
    ground = world.roads.derived(Surface).find(world.x[rows], world.y[rows], z)
    world.z[rows] = ground.height
    free = rows[~(world.has_path[rows] | world.has_lane[rows])]
    world.leg_z[free] = world.z[free]  # constant motion goes on from here
    _lean(world, rows, ground)


def settle_on_lanes(world: World, rows: IntArray) -> None:
    """Pitch and roll rows that follow lanes with the ground, if that is not flat.

    Args:
        world: written in place.
        rows: (k,) int64, no egos; their legs are up to date.
    """
    if world.roads.is_flat:
        return
    along, left = world.roads.derived(Surface).find_on_lanes(world.point[rows], world.lane[rows], world.arc[rows])
    world.pitch[rows], world.roll[rows] = _tilt(along, left)


def keep_level(world: World) -> None:
    """Take the slope of former roads from all driven rows, because the new ones are flat."""
    rows = world.rows(Kind.EGO)
    world.grade[rows] = world.ground_pitch[rows] = world.ground_roll[rows] = world.climb[rows] = 0.0
    world.pitch[rows], world.roll[rows] = world.lean_pitch[rows], world.lean_roll[rows]


def stand(world: World, before: FloatArray, dt: float) -> None:
    """Put all rows that have moved within a step onto the ground.

    Args:
        world: written in place; its roads are not flat.
        before: (5, n) x, y, yaw, speed and z as the step began, as `collisions` remembers them.
        dt: length of the step [s].
    """
    standing = world.derived(_Standing)
    if len(standing.followers):
        settle_on_lanes(world, standing.followers)
    rows = standing.searched
    if not len(rows):
        return
    x, y, yaw, _, z = before[:, rows]
    is_moved = (world.x[rows] != x) | (world.y[rows] != y) | (world.yaw[rows] != yaw)
    is_ego = world.kind[rows] == Kind.EGO
    is_kinematic = world.dynamics == Dynamics.KINEMATIC
    egos = rows[is_ego]
    world.climb[egos] = 0.0
    if is_kinematic:
        world.pitch_rate[egos] = world.roll_rate[egos] = 0.0
    at = is_moved.nonzero()[0]
    if not len(at):
        return
    rows, z, is_ego = rows[at], z[at], is_ego[at]
    egos = rows[is_ego]
    pitch, roll = world.ground_pitch[egos], world.ground_roll[egos]
    settle(world, rows, z)
    if len(egos):
        world.climb[egos] = (world.z[egos] - z[is_ego]) / dt
        world.pitch_rate[egos] += (world.ground_pitch[egos] - pitch) / dt
        world.roll_rate[egos] += (world.ground_roll[egos] - roll) / dt


class _Standing:
    """The rows that move on the ground. It lives until the next `World.touch`.

    Attributes:
        followers: (k,) int64, rows on lanes.
        searched: (m,) int64, all other rows that may move.
    """

    def __init__(self, world: World) -> None:
        is_ego = world.kind == Kind.EGO
        on_ground = world.alive & ~world.is_ghost
        is_follower = world.has_lane & ~is_ego
        self.followers = np.flatnonzero(on_ground & is_follower)
        self.searched = np.flatnonzero(on_ground & ~is_follower & (is_ego | (world.speed != 0.0)))


def _lean(world: World, rows: IntArray, ground: Ground) -> None:
    """Pitch and roll rows (k,) with the ground below them."""
    yaw = world.yaw[rows]
    cos, sin = np.cos(yaw), np.sin(yaw)
    ahead, left = ground.east * cos + ground.north * sin, ground.north * cos - ground.east * sin
    is_upright = world.kind[rows] == Kind.PEDESTRIAN
    pitch, roll = _tilt(np.where(is_upright, 0.0, ahead), np.where(is_upright, 0.0, left))
    is_ego = (world.kind[rows] == Kind.EGO).nonzero()[0]
    if len(is_ego):
        egos = rows[is_ego]
        world.ground_pitch[egos], world.ground_roll[egos] = pitch[is_ego], roll[is_ego]
        world.grade[egos] = G * np.sin(pitch[is_ego])
        pitch[is_ego] += world.lean_pitch[egos]
        roll[is_ego] += world.lean_roll[egos]
    world.pitch[rows], world.roll[rows] = pitch, roll


def _tilt(ahead: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return pitch and roll of a body on a plane that rises ahead and to the left by these shares, (k,) each [rad]."""
    return np.arctan(-ahead), np.arctan2(left, np.sqrt(1.0 + ahead * ahead))

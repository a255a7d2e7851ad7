"""Placement on the ground of all rows that moved within a step, on a map with hills; see `settling`."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.entity_types import Dynamics, Kind
from rosbridge_sim.world.geometry import FloatArray
from rosbridge_sim.world.settling import settle, settle_on_lanes
from rosbridge_sim.world.state import World

__all__ = ["stand"]


def stand(world: World, before: FloatArray, dt: float) -> None:
    """Put all rows that have moved within a step onto the ground.

    Args:
        world: written in place; its roads are not flat.
        before: (5, n) x, y, yaw, speed and z as the step began, as `collisions` remembers them.
        dt: length of the step [s].
    """
    standing = world.derived(_Standing)
    if len(standing.followers):
        settle_on_lanes(world, world.roads, standing.followers)
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
    settle(world, world.roads, rows, z)
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
        may_move = is_ego | (world.loose > 0.0) | (world.speed != 0.0) | (world.yields > 0)
        self.searched = np.flatnonzero(on_ground & ~is_follower & may_move)

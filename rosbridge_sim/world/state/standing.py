"""Placement on the ground of all rows that moved within a step, on a map with hills; see `settling`.

*Vertical motion of egos.* With the speed v along the ground and the heights z of the ground half a `SPAN` ahead of and
behind the reference point, in the direction of motion,

    climb = v (z_ahead - z_behind) / SPAN

and its change over the step, divided by the step, is the acceleration. A map has straight lines from point to point,
and lanes that meet with a small change of slope: the bare derivative would be a peak in one frame at each of them. Both
follow from the poses before and after the step alone, so a row that is placed elsewhere has no acceleration from that.
The kinematic model tells the bare climb, and no acceleration, as it always did.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import ComplexArray, FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.roads.surface import Surface
from rosbridge_sim.world.state.entity_types import Dynamics, Kind
from rosbridge_sim.world.state.settling import settle_on, settle_on_lanes
from rosbridge_sim.world.state.world_rows import WorldRows

SPAN: Final = 2.0
"""The length of ground over which an ego's slope is averaged [m], as `motion.SPAN` has it for vehicles on lanes."""

STILL: Final = 1e-9
"""Below this speed a row has no direction of motion [m/s]."""


def stand(world: WorldRows, before: FloatArray, dt: float) -> None:
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
    is_ego = world.kind[rows] == int(Kind.EGO)
    is_kinematic = world.dynamics == Dynamics.KINEMATIC
    egos = rows[is_ego]
    world.climb[egos] = world.climb_accel[egos] = 0.0
    if is_kinematic:
        world.pitch_rate[egos] = world.roll_rate[egos] = 0.0
    at = is_moved.nonzero()[0]
    if not len(at):
        return
    rows, z, is_ego = rows[at], z[at], is_ego[at]
    egos = rows[is_ego]
    pitch, roll = world.ground_pitch[egos], world.ground_roll[egos]
    x, y, num = world.x[rows], world.y[rows], len(rows)
    if is_kinematic:
        settle_on(world, rows, world.roads.derived(Surface).find(x, y, z))
        world.climb[egos] = (world.z[egos] - z[is_ego]) / dt
    else:
        speed, place = _look_along(world, egos, before[:, egos], dt)
        x, y = np.concatenate([x, place.real.ravel()]), np.concatenate([y, place.imag.ravel()])
        ground = world.roads.derived(Surface).find(x, y, np.concatenate([z, np.tile(z[is_ego], 4)]))
        settle_on(world, rows, ground.first(num))
        ahead, behind = ground.height[num:].reshape(2, 2, -1)
        climb = speed * (ahead - behind) / SPAN
        world.climb[egos], world.climb_accel[egos] = climb[0], (climb[0] - climb[1]) / dt
    world.pitch_rate[egos] += (world.ground_pitch[egos] - pitch) / dt
    world.roll_rate[egos] += (world.ground_roll[egos] - roll) / dt


def _look_along(world: WorldRows, egos: IntArray, before: FloatArray, dt: float) -> tuple[FloatArray, ComplexArray]:
    """Return speeds now and before, (2, k) [m/s], and the places half a span ahead and behind, (2, 2, k) [m].

    Args:
        world: read only.
        egos: (k,) int64, rows of the single track model that have moved.
        before: (5, k) their x, y, yaw, speed and z as the step began.
        dt: length of the step [s].
    """
    x, y, yaw, speed, _ = before
    yaws = np.stack([world.yaw[egos], yaw])
    along = np.stack([world.speed[egos], speed])
    across = world.lateral_speed[egos]
    turned = wrap_angle(yaws[0] - yaw) * along.mean(axis=0)
    # The lateral speed before, from the acceleration that the model has told.
    across = np.stack([across, across - world.lateral_accel[egos] * dt + turned])
    velocity = (along + 1j * across) * np.exp(1j * yaws)
    amount = np.abs(velocity)
    reach = velocity * (0.5 * SPAN / np.fmax(amount, STILL))
    place = np.stack([world.x[egos] + 1j * world.y[egos], x + 1j * y])
    return amount, np.stack([place + reach, place - reach])


class _Standing:
    """The rows that move on the ground. It lives until the next `World.touch`.

    Attributes:
        followers: (k,) int64, rows on lanes.
        searched: (m,) int64, all other rows that may move.
    """

    def __init__(self, world: WorldRows) -> None:
        is_ego = world.kind == int(Kind.EGO)
        on_ground = world.alive & ~world.is_ghost
        is_follower = world.has_lane & ~is_ego
        self.followers = np.flatnonzero(on_ground & is_follower)
        may_move = is_ego | (world.loose > 0.0) | (world.speed != 0.0) | (world.yields > 0)
        self.searched = np.flatnonzero(on_ground & ~is_follower & may_move)

"""Effect of collisions on motion: impulses between the rows of the world, and rows that slide to rest afterwards.

It is on with `World.has_impacts`; without it, collisions are reported only. The impulses are those of
`impact_mechanics`.

*Free* rows are moved by an impact: driven egos, vehicles on lanes, and *loose* vehicles, which an impact has thrown off
their lane. *Immovable* are all other vehicles and obstacles: what a client or a scenario has placed, and what follows a
path. *Passed through* are pedestrians, because a car is hardly slowed by them, and ghosts, whose motion comes from
elsewhere. Contacts between two rows of which none is free, or one is passed through, are told, without an impulse.

*Placed into an overlap*. A pair that overlaps when one of the two is placed gets no impulse until it has parted once.
It is in `World.passing` until then. So is a pair of which one was passed through as it began to touch.

*A loose vehicle* has locked wheels and slides to rest by friction. It does not drive again until something places it,
or gives it a speed, a path or a lane. The model: two masses above the axles (k^2 = a b), so each axle is slowed by mu g
against its own motion, and the rigid body keeps the mean of both along the heading. Energy never grows by that.

Egos go on by their own model. One that spins after an impact, faster than `SPIN`, is loose until it turns slower than
`SPIN_END`: one wheel for each axle does not describe a spin, and a driver brakes then. In the kinematic model wheels
never slip, so of the velocity after an impact only the part along the heading is left.

Order: bodies are sorted by id, so rows do not matter. Limits: at most `MAX_PAIRS` pairs in a step get an impulse, those
with the lowest ids; a slope does not move a loose vehicle.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.contacts.collisions import POSE_X, POSE_Y, POSE_YAW, POSE_Z, CollisionDetector, pair_codes
from rosbridge_sim.world.contacts.impact_mechanics import Rigid, play
from rosbridge_sim.world.geometry.planar import (
    BoolArray,
    FloatArray,
    IntArray,
    distinct,
    do_boxes_meet,
    is_among,
    wrap_angle,
)
from rosbridge_sim.world.state.entity_types import GRAVITY, MAX_SPEED
from rosbridge_sim.world.state.labels import usual_wheelbase
from rosbridge_sim.world.state.world import NO_CONTACTS, Dynamics, Kind, World
from rosbridge_sim.world.state.world_rows import WorldRows

SLIDING_FRICTION: Final = 0.75
"""Friction of locked wheels on dry asphalt (Wong, Theory of Ground Vehicles, table 1.3)."""

SPIN: Final = 1.5
SPIN_END: Final = 0.5
"""Yaw rates above which an ego begins to spin, and below which its driver has it again [rad/s]. Full lock at
5 m/s turns a car by 1.35 rad/s, and no driver catches a faster spin. Above 5 rad/s the steps of `single_track` would
add energy."""

MAX_PAIRS: Final = 128
"""Pairs whose impacts are worked out in one step: 50 ms at most. A crash of more has pairs that pass through each other
in this step; most of them are apart again, or get their turn, in the next ones."""

NEAR: Final = 0.5
"""Distance beyond the motion of a step within which others may be hit by a row that is thrown aside [m]."""


def collide(world: WorldRows, dt: float) -> None:
    """Change the motion of what has touched in this step; `collisions.find` has found it.

    Args:
        world: written in place.
        dt: length of the step [s].
    """
    for each in world.struck():
        _collide(each, dt)


def _collide(world: World, dt: float) -> None:
    """Do the same in one world."""
    placed, world.placed_uids = world.placed_uids, set()
    if not len(world.contacts):
        world.passing = NO_CONTACTS
        return
    poses = world.derived(CollisionDetector).poses.copy()
    rows = _rows_of(world, world.contacts)
    is_free, is_solid = _find_free(world), _find_solid(world)
    acts = is_solid[rows].all(axis=1) & is_free[rows].any(axis=1)
    is_passing = is_among(pair_codes(world.contacts), pair_codes(world.passing)) | ~acts
    was_placed = np.flatnonzero(np.isin(world.contacts, sorted(placed)).any(axis=1))
    if len(was_placed):
        is_passing[was_placed] |= _overlap(world, rows[was_placed], poses[0])
    world.passing = world.contacts[is_passing]
    rows = rows[~is_passing]
    if len(rows):
        _Crash(world, rows, (is_free, is_solid), poses, dt).make()


def slide(world: WorldRows, dt: float) -> None:
    """Move the loose rows by `dt` [s]; see the head of this file."""
    rows = (world.loose > 0.0).nonzero()[0]
    rows = rows[~world.is_ghost[rows]]
    u, w, r = world.speed[rows], world.lateral_speed[rows], world.yaw_rate[rows]
    moves = ((u != 0.0) | (w != 0.0) | (r != 0.0)).nonzero()[0]
    if not len(moves):
        world.accel[rows] = world.lateral_accel[rows] = 0.0
        return
    world.accel[rows] = world.lateral_accel[rows] = 0.0
    rows, u, w, r = rows[moves], u[moves], w[moves], r[moves]
    share, length, to_rear = _figures(world, rows)[:3]
    yaw = world.yaw[rows]
    old = _to_map(u, w + to_rear * r, yaw)
    most = SLIDING_FRICTION * GRAVITY * dt
    front = w + length * r
    keep_front = 1.0 - most / np.fmax(np.hypot(u, front), most)
    keep_rear = 1.0 - most / np.fmax(np.hypot(u, w), most)
    front, rear = front * keep_front, w * keep_rear
    rate = (front - rear) / length
    new = _to_map(u * (share * keep_front + (1.0 - share) * keep_rear), rear + to_rear * rate, yaw)
    middle = [world.x[rows] + to_rear * np.cos(yaw), world.y[rows] + to_rear * np.sin(yaw)]
    turned = wrap_angle(yaw + (0.5 * dt) * (r + rate))
    cos, sin = np.cos(turned), np.sin(turned)
    world.x[rows] = middle[0] + (0.5 * dt) * (old[0] + new[0]) - to_rear * cos
    world.y[rows] = middle[1] + (0.5 * dt) * (old[1] + new[1]) - to_rear * sin
    world.yaw[rows], world.yaw_rate[rows] = turned, rate
    world.speed[rows] = new[0] * cos + new[1] * sin
    world.lateral_speed[rows] = new[1] * cos - new[0] * sin - to_rear * rate
    change = (new[0] - old[0]) / dt, (new[1] - old[1]) / dt
    world.accel[rows] = change[0] * cos + change[1] * sin
    world.lateral_accel[rows] = change[1] * cos - change[0] * sin
    egos = (world.kind[rows] == int(Kind.EGO)).nonzero()[0]
    if len(egos):
        world.yaw_accel[rows[egos]] = (rate - r)[egos] / dt
        caught = egos[np.abs(rate[egos]) < SPIN_END]
        if len(caught):
            world.loose[rows[caught]] = 0.0
            world.touch()


class _Crash:
    """The impacts of one step.

    Args:
        world: written by `make`.
        rows: (m, 2) int64, pairs that touch, in order of their ids.
        kinds: (n,) bool, the rows that are free, and those that are solid.
        poses: (2, 5, n) as in `CollisionDetector`.
        dt: length of the step [s].
    """

    def __init__(
        self, world: World, rows: IntArray, kinds: tuple[BoolArray, BoolArray], poses: FloatArray, dt: float
    ) -> None:
        self._world, self._poses, self._dt = world, poses, dt
        self._is_free, self._is_solid = kinds
        pairs = rows[:MAX_PAIRS]
        if len(rows) < MAX_PAIRS:
            pairs = np.concatenate([pairs, self._find_neighbours(distinct(pairs))])
            pairs = pairs[np.unique(pair_codes(world.uid[pairs]), return_index=True)[1]][:MAX_PAIRS]
        self._rows, index = np.unique(pairs, return_inverse=True)
        self._pairs: list[tuple[int, int]] = [(i, j) for i, j in index.reshape(-1, 2).tolist()]

    def make(self) -> None:
        """Change the velocities and places of the rows."""
        world = self._world
        bodies = [self._rigid(row) for row in self._rows.tolist()]
        play(bodies, self._pairs, self._dt)
        for row, body in zip(self._rows.tolist(), bodies, strict=True):
            if body.was_struck or body.was_pushed:
                self._write(row, body)
        if any(body.was_struck for body in bodies):
            world.touch()

    def _find_neighbours(self, rows: IntArray) -> IntArray:
        """Return pairs of rows that do not touch, but may when rows (k,) are thrown aside; (m, 2), lower ids first."""
        world, poses = self._world, self._poses
        reach = np.hypot(world.half_length + np.abs(world.centre), world.half_width) + NEAR
        reach = reach + np.hypot(poses[1, POSE_X] - poses[0, POSE_X], poses[1, POSE_Y] - poses[0, POSE_Y])
        thrown = rows[self._is_free[rows]]
        others = (self._is_solid & world.alive).nonzero()[0]
        east = poses[1, POSE_X, thrown][:, None] - poses[1, POSE_X, others]
        north = poses[1, POSE_Y, thrown][:, None] - poses[1, POSE_Y, others]
        low, high = poses[:, POSE_Z].min(axis=0), poses[:, POSE_Z].max(axis=0) + world.height
        is_near = east * east + north * north <= np.square(reach[thrown][:, None] + reach[others])
        is_near &= (low[thrown][:, None] < high[others]) & (low[others] < high[thrown][:, None])
        is_near &= thrown[:, None] != others
        first, second = is_near.nonzero()
        pairs = np.stack([thrown[first], others[second]], axis=1)
        pairs = np.where((world.uid[pairs[:, 0]] < world.uid[pairs[:, 1]])[:, None], pairs, pairs[:, ::-1])
        return np.asarray(pairs[~is_among(pair_codes(world.uid[pairs]), pair_codes(world.passing))])

    def _rigid(self, row: int) -> Rigid:
        """Return a row as a body within this step."""
        world = self._world
        (x, y, yaw), (end_x, end_y, end_yaw) = self._poses[:, : POSE_YAW + 1, row].tolist()
        turn = wrap_angle(end_yaw - yaw).item()
        box = world.half_length.item(row), world.half_width.item(row)
        if not self._is_free[row]:
            move_x, move_y = end_x - x, end_y - y
            speeds = move_x / self._dt, move_y / self._dt, turn / self._dt
            return Rigid(x, y, yaw, move_x, move_y, turn, *speeds, 0.0, 0.0, world.centre.item(row), *box)
        _, _, to_rear, mass, inertia = (figure.item() for figure in _figures(world, np.array([row])))
        x, y = x + to_rear * math.cos(yaw), y + to_rear * math.sin(yaw)
        cos, sin = math.cos(end_yaw), math.sin(end_yaw)
        rate = world.yaw_rate.item(row)
        along, across = world.speed.item(row), self._lateral_speed(row) + to_rear * rate
        return Rigid(
            *(x, y, yaw, end_x + to_rear * cos - x, end_y + to_rear * sin - y, turn),
            *(along * cos - across * sin, along * sin + across * cos, rate),
            *(1.0 / mass, 1.0 / inertia, world.centre.item(row) - to_rear, *box),
            can_be_pushed=not world.has_lane[row] or world.kind.item(row) == Kind.EGO,
        )

    def _lateral_speed(self, row: int) -> float:
        """Return the speed of a free row to the left, which only rows that may slip have."""
        world = self._world
        may_slip = world.loose.item(row) > 0.0 or (
            world.kind.item(row) == Kind.EGO and world.dynamics == Dynamics.SINGLE_TRACK
        )
        return world.lateral_speed.item(row) if may_slip else 0.0

    def _write(self, row: int, body: Rigid) -> None:
        """Write what has become of a free row."""
        world = self._world
        to_rear = world.centre.item(row) - body.centre
        yaw = wrap_angle(body.yaw).item()
        cos, sin = math.cos(yaw), math.sin(yaw)
        x, y = body.x - to_rear * cos, body.y - to_rear * sin
        if not body.was_struck:
            world.x[row], world.y[row] = x, y
            return
        fastest = MAX_SPEED / max(MAX_SPEED, math.hypot(body.velocity_x, body.velocity_y))
        along = (body.velocity_x * cos + body.velocity_y * sin) * fastest
        across = (body.velocity_y * cos - body.velocity_x * sin) * fastest - to_rear * body.rate
        before = world.speed.item(row), self._lateral_speed(row), world.yaw_rate.item(row)
        accel = world.accel.item(row) + (along - before[0]) / self._dt
        lateral_accel = world.lateral_accel.item(row) + (across - before[1]) / self._dt
        if world.kind.item(row) != Kind.EGO:
            roll, pitch = world.roll.item(row), world.pitch.item(row)
            world.place(row, x=x, y=y, z=world.z.item(row), yaw=yaw, speed=along)
            world.tilt(row, roll=roll, pitch=pitch)
            world.placed_uids.discard(world.uid.item(row))
            world.loose[row] = 1.0
        world.x[row], world.y[row], world.yaw[row], world.speed[row] = x, y, yaw, along
        world.accel[row] = accel
        if world.kind.item(row) == Kind.EGO and world.dynamics == Dynamics.KINEMATIC:
            return  # its wheels do not slip: the rest of the velocity is lost
        world.lateral_speed[row], world.lateral_accel[row] = across, lateral_accel
        world.yaw_rate[row] = body.rate
        if world.kind.item(row) == Kind.EGO:
            if abs(body.rate) > SPIN:
                world.loose[row] = 1.0
            world.yaw_accel[row] += (body.rate - before[2]) / self._dt


def _find_solid(world: WorldRows) -> BoolArray:
    """Return which rows stop others, (n,)."""
    return np.asarray(world.alive & ~world.is_ghost & (world.kind != int(Kind.PEDESTRIAN)))


def _find_free(world: WorldRows) -> BoolArray:
    """Return which rows an impulse moves, (n,)."""
    is_free = (world.kind == int(Kind.EGO)) | world.has_lane | (world.loose > 0.0)
    return np.asarray(world.alive & ~world.is_ghost & is_free)


def _figures(world: WorldRows, rows: IntArray) -> FloatArray:
    """Return the figures of vehicles by their bodies.

    Returns:
        (5, k) share of the mass above the front axle, wheelbase [m], distance of the centre of gravity from the rear
        axle [m], mass [kg], moment of inertia about it [kg m^2].
    """
    figures = np.empty((5, len(rows)))
    for i, row in enumerate(rows.tolist()):
        body = world.body_of(row)
        length = usual_wheelbase(body)
        to_rear = body.front_load * length
        inertia = body.mass * body.dynamic_index * to_rear * (length - to_rear)
        figures[:, i] = body.front_load, length, to_rear, body.mass, inertia
    return figures


def _rows_of(world: World, pairs: IntArray) -> IntArray:
    """Return the rows of ids (m, 2), of the same shape."""
    return np.array([[world.row(a), world.row(b)] for a, b in pairs.tolist()], dtype=np.int64)


def _overlap(world: WorldRows, rows: IntArray, poses: FloatArray) -> BoolArray:
    """Return which pairs of rows (m, 2) overlap in the given poses (5, n)."""
    pairs = np.ascontiguousarray(rows.T)
    yaw = poses[POSE_YAW][pairs]
    heading = np.cos(yaw) + 1j * np.sin(yaw)
    middle = poses[POSE_X][pairs] + 1j * poses[POSE_Y][pairs] + heading * world.centre[pairs]
    apart = middle[1] - middle[0]
    half = np.stack([world.half_length[pairs], world.half_width[pairs]], axis=-1)
    return do_boxes_meet(apart, apart, heading, half)


def _to_map(along: FloatArray, across: FloatArray, yaw: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return vectors that are given along and across headings, east and north."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return along * cos - across * sin, along * sin + across * cos

"""Entities that go their own way: constant motion or a waypoint path, all of them at once.

Everybody who is not driven slides along a straight *leg*: the point at arc length s of a row is

    (x, y, z) = (leg_x, leg_y, leg_z) + (s - leg_start) (leg_dx, leg_dy, leg_dz)

with a unit vector as direction. Constant motion is a leg that never ends. On a path, whoever has come past `leg_end`
is given the segment that he is on by now, found in `paths` for all who need one by a single search. A row is therefore
on its polyline to the last bits, however long it has walked, and at any speed: many segments, or many rounds of a small
loop, within one step cost no more than one.

Rows with speed 0 are not looked at. Behaviour (following, lights, lanes) will set `speed` between two calls and find
its motion here.
"""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray
from rosbridge_sim.world.paths import TICKS
from rosbridge_sim.world.state import Kind, World

__all__ = ["walk"]


def walk(world: World, dt: float) -> None:
    """Move all rows that go their own way by `dt`, in place."""
    moving = world.derived(_Moving)
    if moving.num:
        moving.gather()
        moving.advance(world, dt)
        moving.scatter()


class _Moving:
    """The moving rows as (k,) arrays: views when they are neighbours in the world's arrays, else copies.

    Lives until somebody comes, goes, stops or is put elsewhere. All methods write in place.
    """

    def __init__(self, world: World) -> None:
        self.rows: IntArray = np.flatnonzero(world.alive & (world.kind != Kind.EGO) & (world.speed != 0.0))
        self.num = len(self.rows)
        if not self.num:
            return
        self.whole = world.block("x", "leg_dz")
        first, last = int(self.rows[0]), int(self.rows[-1])
        self.is_view = last - first + 1 == self.num
        self.block = self.whole[:, first : last + 1] if self.is_view else np.empty((len(self.whole), self.num))
        # In the order of `state.FLOATS`; a count that does not fit fails here.
        self.x, self.y, self.yaw, self.speed, self.z, self.arc = self.block[:6]
        self.legs = self.block[6:]
        self.leg_start, self.leg_end, *_ = self.legs
        self.leg_x, self.leg_y, self.leg_z, self.leg_dx, self.leg_dy, self.leg_dz = self.legs[2:]
        self.has_path = bool(world.has_path[self.rows].any())
        self.is_loop = world.is_loop[self.rows]
        self.path_base = world.path_base[self.rows]
        self.path_length = world.path_length[self.rows]
        self.flags = np.empty(self.num, dtype=bool)
        self.way, self.dt = np.empty((2, self.num))
        self.dt.fill(0.0)
        self.last_dt = 0.0

    def gather(self) -> None:
        if not self.is_view:
            np.take(self.whole, self.rows, axis=1, out=self.block, mode="clip")

    def scatter(self) -> None:
        if not self.is_view:
            self.whole[:, self.rows] = self.block

    def advance(self, world: World, dt: float) -> None:
        """Move by `dt`; `world` gives the paths, and is told when somebody has come to an end."""
        if dt != self.last_dt:
            self.dt.fill(dt)
            self.last_dt = dt
        way = self.way
        np.multiply(self.speed, self.dt, way)
        np.add(self.arc, way, self.arc)
        if self.has_path:
            np.greater_equal(self.arc, self.leg_end, self.flags)
            if np.count_nonzero(self.flags):
                self._turn(world, np.flatnonzero(self.flags))
        past = np.subtract(self.arc, self.leg_start, way)
        self._slide(past, self.leg_dx, self.leg_x, self.x)
        self._slide(past, self.leg_dy, self.leg_y, self.y)
        if self.has_path:  # who has none keeps his height
            self._slide(past, self.leg_dz, self.leg_z, self.z)

    def _turn(self, world: World, at: IntArray) -> None:
        """Give the entries `at`, who have passed their leg's end, the leg that they are on."""
        arc, length = self.arc[at], self.path_length[at]
        is_over = arc >= length
        if np.count_nonzero(is_over):
            is_loop = self.is_loop[at]
            arc = np.where(is_loop, np.fmod(arc, length), np.minimum(arc, length))
            self.arc[at] = arc
            at_end = at[is_over & ~is_loop]
            if len(at_end):
                self.speed[at_end] = 0.0
                world.touch()
        keys = self.path_base[at] + (arc * TICKS).astype(np.int64)
        legs = world.paths.segments[world.paths.keys.searchsorted(keys, side="right") - 1]
        self.legs[:, at] = legs[:, :8].T
        self.yaw[at] = legs[:, 8]

    def _slide(self, past: FloatArray, direction: FloatArray, start: FloatArray, out: FloatArray) -> None:
        np.multiply(past, direction, out)
        np.add(out, start, out)

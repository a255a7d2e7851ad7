"""Entities that go their own way: constant motion or a waypoint path, all of them at once.

Everybody who is not driven slides along a straight *leg*: the point at arc length s of a row is

    (x, y, z) = (leg_x, leg_y, leg_z) + (s - leg_start) (leg_dx, leg_dy, leg_dz)

with a unit vector as direction. Constant motion is a leg that never ends. On a path, whoever has come past `leg_end`
is given the segment that he is on by now, found in `paths` for all who need one by a single search. A row is therefore
on its polyline to the last bits, however long it has walked, and at any speed: many segments, or many rounds of a small
loop, within one step cost no more than one. The heading is

    yaw = leg_yaw + (s - leg_start) leg_turn

and goes on evenly where legs do not; see `paths`.

Rows with speed 0 and ghosts are not looked at, and neither are those that keep to the lanes: they look where they go,
and are `traffic`.
"""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray
from rosbridge_sim.world.row_program import RowProgram
from rosbridge_sim.world.state import BoolArray, Kind, World

__all__ = ["walk"]


def walk(world: World, dt: float) -> None:
    """Move all rows that go their own way by `dt`, in place."""
    moving = world.derived(_Moving)
    if moving.num:
        moving.advance(dt)


class _Moving:
    """The rows that move and the calls that move them.

    Lives until somebody comes, goes, stops or is put elsewhere.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        is_still = world.has_lane | world.is_ghost | (world.speed == 0.0)
        self.rows = np.flatnonzero(world.alive & (world.kind != Kind.EGO) & ~is_still)
        self.num = len(self.rows)
        self.dt = 0.0

    def advance(self, dt: float) -> None:
        if dt != self.dt:
            self.dt = dt
            self._lay_down()
        self.block.run()

    def _lay_down(self) -> None:
        block = self.block = RowProgram(self.world, self.rows, "x", "leg_turn", written_from="x")
        # In the order of `state.FLOATS`; a count that does not fit fails here.
        x, y, yaw, speed, z, arc = block.values[:6]
        leg_start, leg_end, leg_x, leg_y, leg_z, leg_dx, leg_dy, leg_dz, leg_yaw, leg_turn = block.values[6:]
        has_path = bool(self.world.has_path[self.rows].any())
        way = np.empty(block.num)
        do = block.do
        do(np.multiply, speed, block.constant(self.dt), way)
        do(np.add, arc, way, arc)
        if has_path:
            is_past = np.empty(block.num, dtype=bool)
            do(np.greater_equal, arc, leg_end, is_past)
            do(_Turn(self.world, block.rows, block.values, is_past).make)
        do(np.subtract, arc, leg_start, way)
        do(np.multiply, way, leg_dx, x)
        do(np.add, x, leg_x, x)
        do(np.multiply, way, leg_dy, y)
        do(np.add, y, leg_y, y)
        if has_path:  # whoever has none keeps his height and heading
            do(np.multiply, way, leg_dz, z)
            do(np.add, z, leg_z, z)
            do(np.multiply, way, leg_turn, yaw)
            do(np.add, yaw, leg_yaw, yaw)


class _Turn:
    """Gives those who have passed the end of their leg the leg that they are on.

    It knows the block's arrays but not the block, which holds it: in a ring, each touch would leave work to the
    garbage collector.
    """

    def __init__(self, world: World, rows: IntArray, values: FloatArray, is_past: BoolArray) -> None:
        self.world, self.is_past = world, is_past
        _, _, _, self.speed, _, self.arc = values[:6]
        self.legs = values[6:]
        self.is_loop, self.path_length = world.is_loop[rows], world.path_length[rows]
        self.path_base = world.path_base[rows]

    def make(self) -> None:
        if not np.count_nonzero(self.is_past):
            return
        at = self.is_past.nonzero()[0]
        arc, length = self.arc[at], self.path_length[at]
        is_over = arc >= length
        if np.count_nonzero(is_over):
            is_loop = self.is_loop[at]
            arc = np.where(is_loop, np.fmod(arc, length), np.minimum(arc, length))
            self.arc[at] = arc
            at_end = at[is_over & ~is_loop]
            if len(at_end):
                self.speed[at_end] = 0.0
                self.world.touch()
        self.legs[:, at] = self.world.paths.find(self.path_base[at], arc).T

"""Motion along waypoint paths, and constant motion, of all such entities at once.

These entities slide along a straight *leg*. The point at arc length s of a row is

    (x, y, z) = (leg_x, leg_y, leg_z) + (s - leg_start) (leg_dx, leg_dy, leg_dz)

with a unit vector as direction. Constant motion is a leg that never ends. A row on a path that has come past `leg_end`
gets the segment that it is on now; a single search in `paths` finds it for all rows that need one. So a row is on its
polyline to the last bits, however long it has moved and at any speed. Many segments, or many rounds of a small loop,
within one step cost no more than one. The heading is

    yaw = leg_yaw + (s - leg_start) leg_turn

and changes evenly where legs meet at a corner; see `paths`.

Rows that stop for others (`yields`) take part while they stand, because they start again by themselves. All other rows
with speed 0, ghosts, loose rows and lane followers are left out; `lane_following` moves the latter, `impacts` the
loose ones.
"""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.row_program import MovedRows, RowProgram
from rosbridge_sim.world.state.world import BoolArray, Kind
from rosbridge_sim.world.state.world_rows import WorldRows


def follow_paths(world: WorldRows, dt: float) -> None:
    """Move all rows that are on a path or in constant motion.

    Args:
        world: written in place.
        dt: length of the step [s].
    """
    moving = world.derived(_Moving)
    if moving.num:
        moving.advance(dt)


class _Moving(MovedRows):
    """The rows that move, and the numpy calls that move them.

    It lives until the next `World.touch`: until an entity comes or goes, stops or is placed.
    """

    def __init__(self, world: WorldRows) -> None:
        is_still = world.has_lane | world.is_ghost | (world.loose > 0.0) | ((world.speed == 0.0) & (world.yields == 0))
        super().__init__(world, (world.alive & (world.kind != Kind.EGO) & ~is_still).nonzero()[0])

    def write_program(self) -> None:
        """Add the calls of a step; see the head of this file for the equations."""
        program = self.program = RowProgram(self.world, self.rows, "x", "leg_turn", written_from="x")
        # In the order of `entity_arrays.FLOATS`; a count that does not fit fails here.
        x, y, yaw, speed, z, arc = program.values[:6]
        leg_start, leg_end, leg_x, leg_y, leg_z, leg_dx, leg_dy, leg_dz, leg_yaw, leg_turn = program.values[6:]
        has_path = bool(self.world.has_path[self.rows].any())
        distance = np.empty(program.num)
        do = program.do
        do(np.multiply, speed, program.constant(self.dt), distance)
        do(np.add, arc, distance, arc)
        if has_path:
            is_past = np.empty(program.num, dtype=bool)
            do(np.greater_equal, arc, leg_end, is_past)
            do(_LegChange(self.world, program.rows, program.values, is_past).make)
        do(np.subtract, arc, leg_start, distance)
        do(np.multiply, distance, leg_dx, x)
        do(np.add, x, leg_x, x)
        do(np.multiply, distance, leg_dy, y)
        do(np.add, y, leg_y, y)
        if has_path:  # without a path, height and heading stay
            do(np.multiply, distance, leg_dz, z)
            do(np.add, z, leg_z, z)
            do(np.multiply, distance, leg_turn, yaw)
            do(np.add, yaw, leg_yaw, yaw)


class _LegChange:
    """Gives rows that have passed the end of their leg the leg that they are on now.

    It knows the arrays of the program but not the program, which holds it: a reference cycle would leave work to the
    garbage collector at each `World.touch`.
    """

    def __init__(self, world: WorldRows, rows: IntArray, values: FloatArray, is_past: BoolArray) -> None:
        self.world, self.is_past = world, is_past
        _, _, _, self.speed, _, self.arc = values[:6]
        self.legs = values[6:]
        self.is_loop, self.path_length = world.is_loop[rows], world.path_length[rows]
        self.path_base = world.path_bases(rows)

    def make(self) -> None:
        """Bring arc lengths and legs up to date; a row at the end of its path stops."""
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
        self.legs[:, at] = self.world.find_legs(self.path_base[at], arc).T

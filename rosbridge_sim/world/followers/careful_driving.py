"""Vehicles on paths that stop for what is ahead of them: those with `yields` not 0.

Ten times a second such a vehicle looks along its path for the first body on it, and takes the acceleration of the
intelligent driver model (Treiber, Hennecke, Helbing 2000) towards it. In between it keeps its speed, so that
`path_following` moves it as any other row. It sees no lights and gives no way: a path is not a lane.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.neighbours import find_neighbours
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, ranges
from rosbridge_sim.world.roads.paths import DX, DY, END, START, X, Y
from rosbridge_sim.world.state.world import DT, Kind
from rosbridge_sim.world.state.world_rows import WorldRows

INTERVAL: Final = 5
"""Frames from one decision to the next, as that of drivers; it falls one frame after theirs, which spreads the load."""

PATH_OFFSET: Final = 1
_SECONDS: Final = INTERVAL * DT

ACCEL: Final = 1.5
BRAKE: Final = 2.0
HEADWAY: Final = 1.2
GAP: Final = 2.0
"""The paper's a and b [m/s^2], T [s] and s0 [m], as usual for cars in towns."""

HARDEST: Final = 8.0
"""The hardest braking [m/s^2]: about what tyres on a dry road give."""

SPACING: Final = 0.5
"""Distance of the places on the path that are looked at [m]: nothing on a road is smaller."""

HORIZON: Final = 20.0
"""The vehicle looks so far ahead [m], and 4 s more: from 50 km/h it then stops with 2 m/s^2."""

HORIZON_TIME: Final = 4.0
MARGIN: Final = 0.4
"""Room that it wants at each side [m]."""

PERSON_MARGIN: Final = 1.0
"""The same beside pedestrians [m]: they may step to the side."""


def mind_the_path(world: WorldRows) -> None:
    """Have the vehicles decide; called on the frames of decision.

    Args:
        world: written in place.
    """
    careful = world.derived(_Careful)
    if len(careful.rows):
        careful.decide()


class _Careful:
    """The vehicles on paths that stop for what is ahead. It lives until the next `World.touch`."""

    def __init__(self, world: WorldRows) -> None:
        self.world = world
        is_one = world.alive & (world.kind == int(Kind.VEHICLE)) & world.has_path & (world.yields > 0) & ~world.is_ghost
        self.rows: IntArray = (is_one & (world.start_within == 0.0)).nonzero()[0]
        self.bodies: IntArray = world.alive.nonzero()[0]
        margin = np.where(world.kind == int(Kind.PEDESTRIAN), PERSON_MARGIN, MARGIN)[self.bodies]
        self.half_length, self.half_width = world.half_length[self.bodies], world.half_width[self.bodies]
        self.margin = margin
        self.longest = float(np.hypot(self.half_length, self.half_width).max(initial=0.0)) + PERSON_MARGIN

    def decide(self) -> None:
        """Choose the speeds until the next decision."""
        world, rows = self.world, self.rows
        speed = world.speed[rows]
        gap, lead_speed = self._find_lead(speed)
        wish = np.fmax(world.desired_speed[rows], 0.1)
        room = GAP + np.fmax(speed * (HEADWAY + (speed - lead_speed) / (2.0 * math.sqrt(ACCEL * BRAKE))), 0.0)
        accel = ACCEL * (1.0 - (speed / wish) ** 4 - np.square(room / np.fmax(gap, 0.1)))
        accel = np.fmax(accel, -HARDEST)
        length = world.path_length[rows]
        is_over = ~world.is_loop[rows] & (world.arc[rows] >= length)
        after = np.where(is_over, 0.0, np.fmax(speed + accel * _SECONDS, 0.0))
        world.accel[rows] = (after - speed) / _SECONDS
        world.speed[rows] = after

    def _find_lead(self, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gap to the first body on each path, inf for none [m], and its speed along the path [m/s]."""
        world, rows, bodies = self.world, self.rows, self.bodies
        nose = world.half_length[rows] + world.centre[rows]
        fastest = world.most_of_world(speed, rows, rows)
        num = np.broadcast_to(np.ceil((HORIZON + HORIZON_TIME * fastest) / SPACING), rows.shape).astype(np.int64)
        owner = np.arange(len(rows)).repeat(num)
        ahead = ranges(np.zeros_like(num), num) * SPACING + nose[owner]
        arc, length = world.arc[rows][owner] + ahead, world.path_length[rows][owner]
        is_loop = world.is_loop[rows][owner]
        at = (is_loop | (arc <= length)).nonzero()[0]
        owner, ahead = owner[at], ahead[at]
        arc = np.where(is_loop[at], np.fmod(arc[at], length[at]), arc[at])
        leg = world.find_legs(world.path_bases(rows)[owner], arc).T
        along = np.fmin(arc, leg[END]) - leg[START]
        x, y = leg[X] + along * leg[DX], leg[Y] + along * leg[DY]
        yaw = world.yaw[bodies]
        cos, sin = np.cos(yaw), np.sin(yaw)
        middle_x = world.x[bodies] + world.centre[bodies] * cos
        middle_y = world.y[bodies] + world.centre[bodies] * sin
        reach = self.longest + float(world.half_width[rows].max())
        place, body = find_neighbours(x, y, middle_x, middle_y, reach, world.worlds_of(rows[owner], bodies))
        one = owner[place]
        room = world.half_width[rows[one]] + self.margin[body]
        east, north = x[place] - middle_x[body], y[place] - middle_y[body]
        is_on = np.abs(east * cos[body] + north * sin[body]) < self.half_length[body] + room
        is_on &= np.abs(north * cos[body] - east * sin[body]) < self.half_width[body] + room
        is_on &= bodies[body] != rows[one]
        is_on &= np.abs(world.z[bodies[body]] - world.z[rows[one]]) < 2.0 * (1.0 + world.height[bodies[body]])
        place, body, one = place[is_on], body[is_on], one[is_on]
        gap = np.full(len(rows), np.inf)
        lead_speed = np.zeros(len(rows))
        # Places are in rising order for each vehicle: the first pair of each is its lead.
        first = (np.diff(one, prepend=-1) > 0).nonzero()[0]
        lead = bodies[body[first]]
        direction = leg[DX][place[first]] * np.cos(world.yaw[lead]) + leg[DY][place[first]] * np.sin(world.yaw[lead])
        gap[one[first]] = np.fmax(ahead[place[first]] - nose[one[first]], 0.0)
        lead_speed[one[first]] = np.fmax(world.speed[lead] * direction, 0.0)
        return gap, lead_speed

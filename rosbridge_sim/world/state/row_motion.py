"""Motion of each row of the world (a straight leg, a path or lanes), and its placing."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, nearest_on_polyline, wrap_angle
from rosbridge_sim.world.roads.paths import DX, DY, DZ, END, START, TURN, YAW, Paths, Segments, X, Y, Z
from rosbridge_sim.world.state.entity_arrays import INTS, LANE_CHANGE_CODES, LANE_CHANGE_COLUMNS, LEG_COLUMNS
from rosbridge_sim.world.state.entity_types import ROAD_FRICTION, Kind
from rosbridge_sim.world.state.world_rows import WorldRows

_SURELY_WRAPPED: Final = 3.14
"""Angles within this are certainly wrapped, however the last place of pi is rounded [rad]."""

_LANE_COLUMNS: Final = (
    "desired_speed",
    *INTS[INTS.index("turns") : INTS.index("ahead_5") + 1],
    "has_lane",
    "is_loop",
    *LANE_CHANGE_COLUMNS,
    *LANE_CHANGE_CODES,
    "keeps_lane",
)

NO_ROUTE: IntArray = np.empty(0, dtype=np.int64)
NO_ROUTE.flags.writeable = False


class RowMotion(WorldRows):
    """The rows of one world, and the functions that change what moves a row.

    Attributes:
        paths: the paths of the entities that follow one, by id.
        routes: (k,) int64 rows of lanes for each lane follower that has a route, by id.
        placed_uids: ids of what was placed since the last step, while `has_impacts`.
    """

    paths: Paths
    routes: dict[int, IntArray]
    placed_uids: set[int]

    def routes_of(self, rows: IntArray) -> list[IntArray]:
        """Return the routes of rows, in rows of the lanes of `roads`; an empty list if no entity has one."""
        return [self.routes.get(uid, NO_ROUTE) for uid in self.uid[rows].tolist()] if self.routes else []

    @property
    def path_store(self) -> Paths:
        """See `WorldRows.path_store`."""
        return self.paths

    def place(self, row: int, *, x: float, y: float, z: float, yaw: float, speed: float) -> None:
        """Place a row on a straight leg that never ends, without acceleration. Nothing is checked.

        Args:
            row: any row in use; it leaves its path or lane.
            x: reference point, east [m].
            y: reference point, north [m].
            z: reference point, up [m].
            yaw: heading; any angle is wrapped [rad].
            speed: along the heading [m/s].
        """
        self._leave_path_or_lane(row)
        # Numpy takes 5 us for one angle. Nearly all are wrapped already, and then keep their bits.
        wrapped = yaw if -_SURELY_WRAPPED < yaw < _SURELY_WRAPPED else wrap_angle(yaw)
        self._lay_leg(row, (x, y, z, wrapped, speed), (math.cos(yaw), math.sin(yaw)))
        if self.loose[row]:
            self.loose[row] = 0.0
            self.touch()
        if self.has_impacts:
            self.placed_uids.add(self.uid.item(row))
        if self.kind[row] != int(Kind.EGO):
            self.touch()  # it may move now, or no longer
            return
        self.friction[row] = ROAD_FRICTION * self.friction_share  # until the next look at the ground
        if self.is_scoring:  # it has driven over no line on its way here
            self.near_lane[row] = self.open_line[row] = 0

    def tilt(self, row: int, *, roll: float, pitch: float) -> None:
        """Set roll and pitch of a row and of the ground below it [rad]; nothing is checked."""
        self.roll[row], self.pitch[row] = roll, pitch
        if self.kind[row] == int(Kind.EGO):
            self.ground_roll[row], self.ground_pitch[row] = roll, pitch

    def place_all(
        self, rows: IntArray, *, x: FloatArray, y: FloatArray, z: FloatArray, yaw: FloatArray, speed: FloatArray
    ) -> None:
        """Place many rows as `place` does; all arguments are (m,), and no row comes twice."""
        for row in rows[self.has_lane[rows] | self.has_path[rows]].tolist():
            self._leave_path_or_lane(row)
        headings = yaw.tolist()  # by the functions that `place` uses: numpy's can differ in the last bit
        ahead = list(map(math.cos, headings)), list(map(math.sin, headings))
        self._lay_leg(rows, (x, y, z, wrap_angle(yaw), speed), ahead)
        self.loose[rows] = 0.0
        if self.has_impacts:
            self.placed_uids.update(self.uid[rows].tolist())
        self.near_lane[rows] = self.open_line[rows] = 0
        self.touch()

    def _lay_leg(
        self, at: int | IntArray, pose: tuple[npt.ArrayLike, ...], ahead: tuple[npt.ArrayLike, npt.ArrayLike]
    ) -> None:
        """Have a row, or many, begin a straight leg that never ends, without acceleration.

        Args:
            pose: x, y, z, yaw and speed.
            ahead: direction of the leg, east and north.
        """
        self.x[at], self.y[at], self.z[at], self.yaw[at], self.speed[at] = pose
        self.leg_x[at], self.leg_y[at], self.leg_z[at], self.leg_yaw[at], _ = pose
        self.leg_dx[at], self.leg_dy[at] = ahead
        self.leg_end[at] = np.inf
        self.accel[at] = self.lateral_accel[at] = self.yaw_rate[at] = self.climb[at] = self.climb_accel[at] = 0.0
        self.start_within[at] = self.start_speed[at] = 0.0
        self.arc[at] = self.leg_start[at] = self.leg_dz[at] = self.leg_turn[at] = 0.0
        self.block("drive_lag", "roll_rate")[:, at] = 0.0

    def _join_path(self, row: int, base: int, segments: Segments, *, is_loop: bool) -> None:
        """Have a row follow a path that is in the store already."""
        self.has_path[row], self.is_loop[row] = True, is_loop
        self.path_base[row], self.path_length[row] = base, segments[-1, END]
        self._enter_path(row, segments)

    def _enter_path(self, row: int, segments: Segments) -> None:
        """Place a row on its path, at the point nearest to it."""
        ends = np.concatenate([segments[:, X : Z + 1], segments[-1:, X : Z + 1]])
        ends[-1] += segments[-1, DX : DZ + 1] * (segments[-1, END] - segments[-1, START])
        near = nearest_on_polyline(ends, self.x[row], self.y[row])
        leg = segments[near.segment[0]]
        # The foot point was searched in the plane; along a slope the path is longer than that.
        flat = math.hypot(leg[DX], leg[DY])
        part = math.hypot(near.x[0] - leg[X], near.y[0] - leg[Y]) / flat if flat > 0.0 else 0.0
        arc = min(leg[START] + part, leg[END])
        self.arc[row] = arc
        self.yaw[row] = leg[YAW] + (arc - leg[START]) * leg[TURN]
        for column, value in zip(LEG_COLUMNS, leg, strict=True):
            getattr(self, column)[row] = value
        self.x[row], self.y[row], self.z[row] = leg[X : Z + 1] + leg[DX : DZ + 1] * (arc - leg[START])

    def _leave_path_or_lane(self, row: int) -> None:
        """Take a row off its path and its lane."""
        if self.has_lane[row]:
            self.routes.pop(int(self.uid[row]), None)
            for column in _LANE_COLUMNS:
                getattr(self, column)[row] = 0
            self.touch()
        if not self.has_path[row]:
            return
        self.has_path[row] = self.is_loop[row] = False
        self.path_base[row], self.path_length[row] = 0, 0.0
        self.yields[row], self.desired_speed[row] = 0, 0.0
        if self.paths.remove(int(self.uid[row])):
            for other in np.flatnonzero(self.has_path):  # rare: the store was compacted
                self.path_base[other] = self.paths.base(int(self.uid[other]))

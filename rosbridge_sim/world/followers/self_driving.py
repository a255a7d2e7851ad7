"""Self-driving egos: driven rows that follow the lanes by the driver model.

They decide as all other lane followers do, in `lane_following`. The chosen acceleration goes to their pedals, and pure
pursuit of the lane's line (Coulter 1992) turns their wheels. `dynamics` moves them. Their place on the lane is the
point of the line beside them. `change_lane` has them drive over to the lane beside theirs: then the wheels follow the
curve by which other drivers change lanes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.lane_position import check_route, find_ahead, join_lane, leave_lane
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.lane_change_map import NUM_SIDES, LaneNeighbours
from rosbridge_sim.world.roads.road_places import find_lane, place_on_lane
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import Gear, Kind, Mode, World
from rosbridge_sim.world.state.world_rows import WorldRows

MAX_LATERAL_OFFSET: Final = 3.0
"""Self-driving starts only this near to the line of a lane [m]: on the lane, or on the next one of usual width."""

MAX_HEADING_ERROR: Final = math.radians(60.0)
"""Self-driving starts only with at most this angle between the heading and the lane [rad]: pure pursuit would turn a
car that stands across the road in an arc wider than the road."""

LOOK_AHEAD_TIME: Final = 0.6
"""The wheels steer towards the point of the line that is this time ahead [s]. A longer time cuts corners."""

MIN_LOOK_AHEAD: Final = 4.0
"""The point is at least this far ahead [m]. A nearer one makes a slow car swing from side to side."""

_POSE: Final = ("x", "z")
_MOTION: Final = ("accel", "yaw_rate")
"""First and last of the columns of pose and speed, and of accelerations and yaw rate."""


def start_self_driving(
    world: World, row: int, *, route: Sequence[int] = (), is_loop: bool = False, desired_speed: float = math.inf
) -> bool:
    """Have an ego drive itself along the lanes, until `leave_lane` or until something places it elsewhere.

    It decides on the frames of decision (`lane_following.DECISION`); a `command` from outside holds until then.

    Args:
        world: written in place.
        row: row of an EGO.
        route: rows of lanes, each a successor of the one before; it starts on the first. At its end, or without a
            route, chance chooses.
        is_loop: the route begins again; its first lane is then a successor of its last.
        desired_speed: speed that the driver wants; limits, bends and other traffic make it slower [m/s].

    Returns:
        Whether there is a lane that it can drive on. If not, nothing has changed.

    Raises:
        ValueError: the row is no ego in use, or the route does not lead along lanes.
    """
    if world.kind[row] != int(Kind.EGO) or not world.alive[row]:
        raise ValueError(f"row {row} is not driven")
    check_route(world.roads, route, is_loop=is_loop)
    x, y, yaw, z = (float(getattr(world, name)[row]) for name in ("x", "y", "yaw", "z"))
    roads = world.roads
    near = place_on_lane(roads, route[0], x, y, MAX_LATERAL_OFFSET) if len(route) else find_lane(roads, x, y, yaw, z)
    if near is None or near.distance > MAX_LATERAL_OFFSET:
        return False
    if math.cos(near.yaw - yaw) < math.cos(MAX_HEADING_ERROR):
        return False
    leave_lane(world, row)
    if len(route):
        world.routes[int(world.uid[row])] = np.array(route, dtype=np.int64)
    join_lane(world, row, near.lane, near.s, desired_speed=desired_speed, is_loop=is_loop and len(route) > 0)
    world.touch()
    return True


def change_lane(world: World, row: int, side: int) -> bool:
    """Have a self-driving ego change to the lane beside its own. It drives on without a route.

    It does not look whether that lane is free: that is the caller's decision. From now on it keeps its gaps on the new
    lane, and the drivers on both lanes see it.

    Args:
        world: written in place.
        row: row of an EGO that drives itself.
        side: `LEFT` or `RIGHT` of `lane_change_map`.

    Returns:
        Whether it does. If not, there is no lane into which one may change there, or it is changing lanes already.

    Raises:
        ValueError: the row is no ego that drives itself.
    """
    if world.kind[row] != int(Kind.EGO) or not world.alive[row] or not world.has_lane[row]:
        raise ValueError(f"row {row} does not drive itself")
    old, neighbours = int(world.lane[row]), world.roads.derived(LaneNeighbours)
    if world.lateral_left[row] > 0.0 or not neighbours.may[side, old]:
        return False
    beside, place = neighbours.cross(np.array([side]), np.array([old]), world.arc[[row]])
    lane, s = int(beside[0]), float(place[0])
    if lane < 0:
        return False
    world.routes.pop(int(world.uid[row]), None)
    foot, yaw = world.roads.at([lane], [s])
    east, north = float(world.x[row] - foot[0, 0]), float(world.y[row] - foot[0, 1])
    join_lane(world, row, lane, s, desired_speed=float(world.desired_speed[row]), is_loop=False)
    lateral = north * math.cos(yaw[0]) - east * math.sin(yaw[0])
    world.lateral[row] = world.lateral_from[row] = lateral
    world.lateral_to[row] = world.lateral_push[row] = world.lateral_bend[row] = 0.0
    world.lateral_left[row] = 1.0
    world.leaving[row] = world.came_from[row] = NUM_SIDES - side
    world.touch()
    return True


class SelfDrivingEgos:
    """The self-driving egos among the lane followers.

    Attributes:
        index: (k,) int64, which of the lane followers they are.
        rows: (k,) int64, their rows in the world.

    Args:
        world: written by the methods.
        followers: (n,) int64, rows of all lane followers.
    """

    def __init__(self, world: WorldRows, followers: IntArray) -> None:
        self._world = world
        self.index: IntArray = (world.kind[followers] == int(Kind.EGO)).nonzero()[0]
        self.rows = followers[self.index]

    def project(self) -> None:
        """Set each arc length to the point of the lane's line beside the ego. It may be beyond the lane's end."""
        world, rows = self._world, self.rows
        foot, yaw = world.roads.at(world.lane[rows], world.arc[rows])
        along = (world.x[rows] - foot[:, 0]) * np.cos(yaw) + (world.y[rows] - foot[:, 1]) * np.sin(yaw)
        world.arc[rows] = np.fmax(world.arc[rows] + along, 0.0)

    def command(self, lanes: IntArray, accel: FloatArray) -> None:
        """Command wheels and pedals. An ego that is not in D brakes fully.

        Args:
            lanes: (6, k) int64, the lane of each ego and the five ahead of it.
            accel: (k,) the chosen accelerations [m/s^2].
        """
        world, rows = self._world, self.rows
        reach = np.fmax(world.speed[rows] * LOOK_AHEAD_TIME, MIN_LOOK_AHEAD)
        goal, direction = world.roads.at(*find_ahead(world.roads, lanes, world.arc[rows] + reach))
        aside = world.lateral[rows]
        if np.count_nonzero(aside):
            goal[:, 0] -= aside * np.sin(direction)
            goal[:, 1] += aside * np.cos(direction)
        east, north, yaw = goal[:, 0] - world.x[rows], goal[:, 1] - world.y[rows], world.yaw[rows]
        left = north * np.cos(yaw) - east * np.sin(yaw)
        steer = np.arctan2(2.0 * world.wheelbase[rows] * left, np.fmax(east * east + north * north, 1.0))
        for row, angle, wanted in zip(rows.tolist(), steer.tolist(), accel.tolist(), strict=True):
            if world.gear[row] == Gear.DRIVE:
                command(world, row, mode=Mode.ACCEL, steer=angle, accel=wanted)
            else:
                command(world, row, mode=Mode.PEDALS, steer=angle, brake=1.0)

    def save_poses(self) -> FloatArray:
        """Return copies of pose and speed, (5, k)."""
        return self._world.block(*_POSE)[:, self.rows]

    def restore_poses(self, saved: FloatArray) -> None:
        """Write back what `save_poses` has returned."""
        self._world.block(*_POSE)[:, self.rows] = saved

    def save_motion(self) -> FloatArray:
        """Return copies of accelerations and yaw rate, which the single track model continues from, (3, k)."""
        return self._world.block(*_MOTION)[:, self.rows]

    def restore_motion(self, saved: FloatArray) -> None:
        """Write back what `save_motion` has returned."""
        self._world.block(*_MOTION)[:, self.rows] = saved

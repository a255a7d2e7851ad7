"""Figures of EgoVehicleStatus that only one release has: lane, tyres, wheels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final, Literal

from rosbridge_sim.records import Record
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World
from rosbridge_sim.world.vehicle.wheel_readings import read_wheel


class LateralPlace(Record):
    """The ego's place across its lane, left positive, and the distances to the lane's edges [m]; zeros off any road."""

    lateral: float = 0.0
    to_left: float = 0.0
    to_right: float = 0.0


OFF_ROAD: Final = LateralPlace()
"""The place of an ego that is off any road."""

Figure = Callable[[World, int, LateralPlace], float]
"""Returns the figure of a row: `(world, row, place)`."""

LANE_FIGURES: Final[Mapping[str, Figure]] = {
    "lateral_offset": lambda _world, _row, lane: lane.lateral,
    "cross_track_error": lambda _world, _row, lane: -lane.lateral,  # the only lateral figure that is right positive
    "distance_left_lane_boundary": lambda _world, _row, lane: lane.to_left,
    "distance_right_lane_boundary": lambda _world, _row, lane: lane.to_right,
}
"""Figures of the ego's place, by their fields [m]."""

AXLE_OF: Final[Mapping[str, Literal["front", "rear"]]] = {"fl": "front", "fr": "front", "rl": "rear", "rr": "rear"}


def find_lane_place(world: World, row: int, roads: Roads) -> LateralPlace:
    """Return the place of a row across the nearest of these lanes."""
    places = roads.nearest(world.x[row], world.y[row], world.yaw[row], world.z[row])
    to_left, to_right = roads.beside(places)
    return LateralPlace(places.lateral.item(), to_left.item(), to_right.item())


def tyre_figure(figure: str, axle: Literal["front", "rear"]) -> Figure:
    """Return a function that reads a figure of a tyre in MORAI's unit."""
    if figure == "tire_lateral_force":
        return lambda world, row, _lane: read_wheel(world, row, axle).lateral_force
    if figure == "side_slip_angle":
        return lambda world, row, _lane: math.degrees(read_wheel(world, row, axle).slip)
    return lambda world, row, _lane: math.radians(read_wheel(world, row, axle).cornering_stiffness)  # N/deg


def rear_steer_angle(world: World, row: int, _lane: LateralPlace) -> float:
    """Return the angle of the rear wheels, left positive [deg]."""
    return math.degrees(world.rear_steer.item(row))


def front_steer_angle(world: World, row: int, _lane: LateralPlace) -> float:
    """Return the angle of the front wheels, left positive [deg], in any profile."""
    return math.degrees(world.steer.item(row))

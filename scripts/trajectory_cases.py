"""Small scenes that show how vehicles and people move: each gives a picture of the page about traffic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.scenarios.catalogue import BUILT_IN, default_model
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.state.world import Body, Gear, Kind, World
from scripts.soak.traffic_cells import Cell, world_of

WALK = -38.8
"""East of the crosswalk on the western arm of the roundabout [m]."""

Box = tuple[float, float, float, float]
"""West, south, east, north [m]."""


@dataclass(frozen=True, slots=True)
class Case:
    """A scene and the part of it that is drawn.

    Attributes:
        make: makes the world.
        box: part of the map.
        begin: time before the first place [s].
        seconds: from the first to the last place.
        every: from one place to the next [s].
    """

    make: Callable[[], World]
    box: Box
    begin: float
    seconds: float
    every: float


def _empty(name: str) -> World:
    road_map = DiskLibrary().map(name)
    world = World()
    world.lay_roads(road_map.roads, road_map.plan)
    return world


def _car() -> Body:
    return default_model(Kind.VEHICLE).body


def _bus() -> Body:
    return next(model.body for model in BUILT_IN.models if "Bus" in model.name and model.body.length > 10.0)


@dataclass(frozen=True, slots=True)
class _Start:
    """A vehicle: its lane and place on it [m], its speed [m/s], the speed that it wants, lanes ahead, and its body."""

    lane: str
    s: float
    speed: float
    desired_speed: float = float("inf")
    route: Sequence[str] = ()
    is_bus: bool = False


def _drive(world: World, starts: Sequence[_Start]) -> World:
    """Put vehicles onto lanes."""
    lanes = []
    for start in starts:
        body = _bus() if start.is_bus else _car()
        uid = world.spawn(Kind.VEHICLE, body, name="npc", x=0.0, y=0.0, speed=start.speed)
        route = tuple(world.roads.row(name) for name in start.route)
        lane = world.roads.row(start.lane)
        lanes.append(LaneStart(world.row(uid), lane, start.s, start.desired_speed, route))
    keep_lanes(world, lanes)
    return world


def _lane_change() -> World:
    slow = _Start("L3_03", 120.0, 20.0, 20.0, is_bus=True)
    return _drive(_empty("motorway"), [slow, _Start("L3_03", 10.0, 30.0)])


def _merge() -> World:
    main = [_Start("L3_04", s, 25.0, 27.0) for s in (0.0, 40.0, 80.0)]
    return _drive(_empty("motorway"), [*main, *(_Start("L4_04", s, 22.0, 27.0) for s in (20.0, 60.0))])


def _roundabout() -> World:
    return world_of(Cell("roundabout", 30, 0))


def _standing_ego() -> World:
    world = _empty("town")
    world.spawn(Kind.EGO, default_model(Kind.EGO).body, name="ego", x=-60.0, y=-5.25, gear=Gear.PARK)
    return _drive(world, [_Start("R1222L2", s, 8.0) for s in (2.0, 12.0)])


def _crossing_people() -> World:
    world = _empty("roundabout")
    man = default_model(Kind.PEDESTRIAN)
    for side, speed in ((-1.0, 1.3), (1.0, 1.1)):
        path = np.array([[WALK, 8.0 * side], [WALK, -8.0 * side]])
        world.spawn(Kind.PEDESTRIAN, man.body, name=man.name, x=WALK, y=8.0 * side, path=path, speed=speed, yields=True)
    out = ("GN", "OW", "WA")
    cars = [_Start("WB", 30.0, 9.0), _Start("WB", 2.0, 9.0), _Start("WT", 40.0, 6.0), _Start("GN", 2.0, 6.0, route=out)]
    return _drive(world, cars)


def _turning_bus() -> World:
    lanes = ("R1011L1", "J11S1E", "R1121L1")
    return _drive(_empty("town"), [_Start("R1011L1", 40.0, 8.0, route=lanes, is_bus=True)])


CASES: Final[dict[str, Case]] = {
    "lane_change": Case(_lane_change, (400.0, -14.0, 720.0, 10.0), 0.0, 12.0, 1.0),
    "merge": Case(_merge, (1080.0, -16.0, 1380.0, 8.0), 5.0, 12.0, 1.0),
    "roundabout": Case(_roundabout, (-42.0, -42.0, 42.0, 42.0), 40.0, 12.0, 0.5),
    "standing_ego": Case(_standing_ego, (-98.0, -12.0, -8.0, 4.0), 0.0, 16.0, 0.5),
    "crossing_people": Case(_crossing_people, (-66.0, -10.0, -14.0, 12.0), 0.0, 20.0, 0.5),
    "turning_bus": Case(_turning_bus, (-128.0, -136.0, -74.0, -100.0), 20.0, 40.0, 0.5),
}
"""Names of the pictures, without their beginning `trajectory_`."""

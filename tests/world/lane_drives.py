"""Worlds of lane followers, and how they are driven."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.world import DT, Body, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import CAR

BUS = Body(10.955, 2.49, 3.22, wheelbase=5.4, front_overhang=2.565, rear_overhang=2.99)
NOSE = CAR.length - CAR.rear_overhang


def world_of(roads: Roads, plan: SignalPlan | None = None, seed: int = 0) -> World:
    world = World(seed)
    world.lay_roads(roads, plan)
    return world


def run(world: World, seconds: float) -> FloatArray:
    """Speeds of all rows, (frames, n), while time passes; nobody ever touches anybody."""
    speeds = []
    for _ in range(round(seconds / DT)):
        step(world)
        assert not len(world.contacts), [world.names[world.row(int(uid))] for uid in world.contacts[0]]
        speeds.append(world.speed.copy())
    return np.array(speeds)


def to_line(world: World, row: int) -> float:
    """From the bumper to the end of the lane [m]."""
    nose = world.half_length[row] + world.centre[row]
    return float(world.roads.length[world.lane[row]] - world.arc[row] - nose)


def lane_of(world: World, row: int) -> str:
    return str(world.roads.ids[world.lane[row]])

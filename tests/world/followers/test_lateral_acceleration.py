"""The lateral acceleration of drivers on lanes has a bound, in bends, in lane changes and in both at once.

It is the speed times the change of the yaw within a frame, at the rear axle of the body that is published. The long
sibling of this is `scripts/soak/traffic.py`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import pytest

from rosbridge_sim.scenarios.catalogue import BUILT_IN
from rosbridge_sim.world.demand import LaneSlots, keep_clear
from rosbridge_sim.world.drivers.driver_parameters import CAR, MOTORCYCLE, DriverParameters, classes_of
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state.world import DT, Kind, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import built_in

pytestmark = pytest.mark.usefixtures("loops")

MODELS: Final = [BUILT_IN.find(name) for name in ("2015_Kia_K5", "2015_Kia_K5", "Motorcycle", "Van", "Bus")]

CASES: Final = [
    *(("town", 3, 3, 30.0), ("town", 100, 1, 20.0), ("parking", 4, 1, 40.0), ("roundabout", 16, 2, 20.0)),
    *(("track", 60, 0, 40.0), ("loop", 60, 0, 30.0), ("motorway", 100, 0, 40.0), ("hills", 16, 0, 30.0)),
]
"""Map, vehicles, seed, and length [s]."""


def traffic(name: str, num: int, seed: int) -> World:
    """Cars, motorcycles, vans and buses on free places of a map; cars alone where they are few."""
    world, built = World(seed), built_in(name)
    world.lay_roads(built.roads, built.plan)
    slots = built.roads.derived(LaneSlots.of)
    free = np.flatnonzero(keep_clear(world, slots, 14.0))
    starts = []
    for i, slot in enumerate(np.random.default_rng(seed).permutation(free)[:num].tolist()):
        model = MODELS[i % len(MODELS) if num > 10 else 0]
        assert model is not None
        speed = float(slots.speed[slot])
        row = world.row(world.spawn(Kind.VEHICLE, model.body, name="npc", x=0.0, y=0.0, speed=speed))
        starts.append(LaneStart(row, int(slots.lane[slot]), float(slots.s[slot]), wander=0.15))
    keep_lanes(world, starts)
    return world


def drive(world: World, rows: IntArray, seconds: float) -> FloatArray:
    """The greatest lateral acceleration of each row, (n,) [m/s^2], after three seconds in which all settle."""
    most, yaw, speed = np.zeros(len(rows)), world.yaw[rows], world.speed[rows]
    for frame in range(round(seconds / DT)):
        step(world)
        turn = np.abs(wrap_angle(world.yaw[rows] - yaw)) / DT
        if frame * DT > 3.0:
            most = np.fmax(most, turn * 0.5 * (world.speed[rows] + speed))
        yaw, speed = world.yaw[rows], world.speed[rows]
    return most


@pytest.mark.slow
@pytest.mark.parametrize(("name", "num", "seed", "seconds"), CASES)
def test_drivers_keep_the_lateral_acceleration_of_their_class(name: str, num: int, seed: int, seconds: float) -> None:
    world = traffic(name, num, seed)
    rows = np.flatnonzero(world.has_lane)
    most = drive(world, rows, seconds)
    sizes = 2.0 * world.half_length[rows], 2.0 * world.half_width[rows], world.height[rows]
    bound = DriverParameters.of(world, rows).most_lateral
    assert set(bound[classes_of(*sizes) == CAR].tolist()) == {3.25}
    assert set(bound[classes_of(*sizes) == MOTORCYCLE].tolist()) <= {3.7}
    assert (most < bound).all(), [(world.uid[rows[i]], most[i]) for i in np.flatnonzero(most >= bound)]
    assert most.max() > 1.5, "they take bends as people do"

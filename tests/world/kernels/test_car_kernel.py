"""Loops move cars of the single track model with the bits of arrays and of single floats."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.kernels.car_source import car_stages
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.kernels.compiled_loops import needs_compiler, with_loops
from tests.world.road_factory import CAR

pytestmark = needs_compiler


def cars(num: int, seed: int, *, is_stable: bool) -> World:
    """Egos with a box between them, so that their rows are no neighbours, at any speed and heading."""
    world, rng = World(seed, Dynamics.SINGLE_TRACK, has_stability_control=is_stable), np.random.default_rng(seed)
    for i in range(num):
        y, yaw = float(rng.normal()), float(rng.uniform(-math.pi, math.pi))
        gear = Gear.REVERSE if rng.random() < 0.2 else Gear.DRIVE
        speed = float(rng.choice([0.0, 2.0, 30.0]))
        world.spawn(Kind.EGO, CAR, name="ego", x=40.0 * i, y=y, yaw=yaw, speed=speed, gear=gear)
        if i == 1:
            world.spawn(Kind.OBSTACLE, CAR, name="box", x=20.0, y=500.0)
    return world


def drive_at_random(world: World, rng: np.random.Generator) -> None:
    for row in world.rows(Kind.EGO).tolist():
        steer, throttle, brake, speed, accel = rng.random(5).tolist()
        mode = Mode(int(rng.integers(1, 4)))
        brake *= brake > 0.7
        command(
            world, row, mode=mode, steer=steer - 0.5, throttle=throttle, brake=brake, speed=30 * speed, accel=4 * accel
        )


@pytest.mark.parametrize("num", [1, 3, 9])
@pytest.mark.parametrize("is_stable", [False, True])
def test_cars_have_the_bits_of_floats_and_of_arrays(num: int, *, is_stable: bool) -> None:
    one, other = (cars(num, seed=num, is_stable=is_stable) for _ in range(2))
    rngs = [np.random.default_rng(1) for _ in range(2)]
    for frame in range(105):
        if frame % 30 == 0:
            for world, rng in zip((one, other), rngs, strict=True):
                drive_at_random(world, rng)
        with with_loops(are_there=False):
            step(one)
        with with_loops(are_there=frame % 70 < 55):  # they are taken, and given back, between any two steps
            step(other)
        first, last = (world.block("front_load", "speed").tobytes() for world in (one, other))
        assert first == last, frame
    assert np.ptp(one.yaw[one.rows(Kind.EGO)]) > 0.1 or num == 1


@pytest.mark.parametrize("figure", [-0.0, 5e-324, 1e-9, math.pi, -math.pi, 1e6])
@pytest.mark.parametrize("column", ["yaw", "speed", "steer", "steer_cmd", "target", "yaw_rate"])
def test_extreme_figures_are_the_same(column: str, figure: float) -> None:
    worlds = [cars(2, seed=4, is_stable=True) for _ in range(2)]
    for world, are_there in zip(worlds, (False, True), strict=True):
        getattr(world, column)[0] = figure
        with with_loops(are_there=are_there):
            step(world)
    first, last = (world.block("rear_steer", "speed").tobytes() for world in worlds)
    assert first == last


def test_stages_have_all_equations_between_calls_of_numpy() -> None:
    for is_stable in (False, True):
        stages = car_stages(is_stable=is_stable)
        assert len(stages.bodies) == len(stages.calls) + 1
        rows = [row for calls in stages.calls for _, begin, end in calls for row in range(begin, end)]
        assert rows == list(range(stages.num_args))

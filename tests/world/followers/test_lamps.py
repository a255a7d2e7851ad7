"""Lamps of vehicles that nobody commands, row by row."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.followers.lamps import BRAKE, LEFT, REVERSE, RIGHT, find_lamps
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.lane_drives import world_of
from tests.world.road_factory import CAR, car, road

MAN = Body.box(0.45, 0.55, 1.7)


def test_bits_are_those_of_the_wire() -> None:
    assert (LEFT, RIGHT, BRAKE, REVERSE) == (1, 2, 4, 8)


@pytest.mark.parametrize(
    ("speed", "accel", "lamps"),
    [(5.0, 0.0, 0), (5.0, -1.0, 0), (5.0, -1.01, 4), (5.0, 1.5, 0), (-2.0, 0.0, 8), (-2.0, -3.0, 12), (0.0, 0.0, 0)],
)
def test_brake_light_is_lit_beyond_one_metre_per_second_squared_and_reverse_light_backwards(
    speed: float, accel: float, lamps: int
) -> None:
    world = World()
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="a", x=0.0, y=0.0, speed=speed))
    world.accel[row] = accel
    assert find_lamps(world, np.array([row])).tolist() == [lamps]


def test_driver_on_lanes_that_stands_holds_the_brake() -> None:
    world = world_of(road())
    row = car(world, "a", 50.0, speed=0.0)
    assert find_lamps(world, np.array([row])).tolist() == [BRAKE]
    world.speed[row] = 0.5
    assert find_lamps(world, np.array([row])).tolist() == [0]


@pytest.mark.parametrize(
    ("kind", "lamps"), [(Kind.EGO, 4), (Kind.VEHICLE, 4), (Kind.PEDESTRIAN, 0), (Kind.OBSTACLE, 0)]
)
def test_only_vehicles_have_lamps(kind: Kind, lamps: int) -> None:
    world = World()
    row = world.row(world.spawn(kind, CAR if kind <= Kind.VEHICLE else MAN, name="a", x=0.0, y=0.0))
    world.speed[row], world.accel[row] = 3.0, -4.0
    assert find_lamps(world, np.array([row])).tolist() == [lamps]


def test_signal_of_a_lane_change_is_shown() -> None:
    world = world_of(road())
    row = car(world, "a", 50.0, speed=5.0)
    for signal, lamps in [(1, LEFT), (2, RIGHT), (0, 0)]:
        world.signal[row] = signal
        assert find_lamps(world, np.array([row])).tolist() == [lamps]

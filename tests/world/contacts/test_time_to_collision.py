"""Time to collision, against motion that is known, and against steps of the world."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.contacts.time_to_collision import HORIZON, find_times_to_collision
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import CAR

POST = Body.box(0.2, 0.2, 1.0)


def time(world: World, row: int = 0) -> float:
    return float(find_times_to_collision(world, np.array([row]))[0])


def meeting(**other: float) -> World:
    """A car at the origin that goes east at 10 m/s, and another one."""
    world = World()
    world.spawn(Kind.VEHICLE, CAR, name="a", x=0.0, y=0.0, speed=10.0)
    world.spawn(Kind.VEHICLE, CAR, name="b", **other)  # type: ignore[arg-type] # whatever a test gives
    return world


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ({"x": 24.47, "y": 0.0}, 2.0),  # 20 m between the bumpers
        ({"x": 24.47, "y": 0.0, "speed": 6.0}, 5.0),
        ({"x": 24.47, "y": 0.0, "speed": 10.0}, math.inf),
        ({"x": 24.47, "y": 0.0, "speed": 12.0}, math.inf),
        ({"x": 24.47, "y": 1.83}, math.inf),  # beside
        ({"x": 24.47, "y": 1.81}, 2.0),
        ({"x": -24.47, "y": 0.0, "speed": 15.0}, 4.0),  # from behind
        ({"x": 2.0, "y": 1.0}, 0.0),  # now
        ({"x": 200.0, "y": 0.0}, math.inf),  # in 19.6 s
        ({"x": 24.47, "y": 0.0, "z": 2.0}, math.inf),  # on a bridge
        ({"x": 24.47, "y": 0.0, "z": 1.0}, 2.0),
    ],
)
def test_time_to_collision_on_a_straight(other: dict[str, float], expected: float) -> None:
    world = meeting(**other)
    assert time(world) == time(world, 1) == pytest.approx(expected, abs=1e-6)


def test_nearest_of_several_counts_and_oneself_does_not() -> None:
    world = meeting(x=60.0, y=0.0)
    assert time(world) > 5.0
    world.spawn(Kind.OBSTACLE, POST, name="post", x=30.0, y=0.0)
    assert time(world) == pytest.approx((30.0 - 0.1 - (CAR.length - CAR.rear_overhang)) / 10.0, abs=1e-6)
    alone = World()
    alone.spawn(Kind.VEHICLE, CAR, name="a", x=0.0, y=0.0, speed=10.0)
    assert time(alone) == math.inf


@given(
    place=st.tuples(st.floats(-40.0, 40.0), st.floats(-40.0, 40.0)),
    yaw=st.floats(-math.pi, math.pi),
    speed=st.floats(0.0, 20.0),
)
def test_constant_motion_collides_when_it_was_foreseen(place: tuple[float, float], yaw: float, speed: float) -> None:
    world = meeting(x=place[0], y=place[1], yaw=yaw, speed=speed)
    expected = time(world)
    met = math.inf
    for _ in range(200):
        step(world)
        if len(world.contacts):
            met = world.frame * DT
            break
    if expected <= 200 * DT - 2 * DT or met < math.inf:
        assert met - DT - 1e-3 <= expected <= met + 1e-3
    else:
        assert met == math.inf


def test_time_beyond_the_horizon_counts_as_none() -> None:
    way = 10.0 * HORIZON + CAR.length
    assert time(meeting(x=way - 0.1, y=0.0)) == pytest.approx(HORIZON, abs=0.011)
    assert time(meeting(x=way + 0.1, y=0.0)) == math.inf

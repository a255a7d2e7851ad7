"""Long vehicles in tight bends: they use their lane, and pass what stands beside it."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.drivers.lane_position import keep_lane
from rosbridge_sim.world.drivers.lane_swing import plan_swings
from rosbridge_sim.world.followers.lane_following import DECISION
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import BUS, world_of
from tests.world.road_factory import CAR, arc, car, line, make

RADIUS, HALF_LANE = 8.75, 1.75


def corner(side: int = -1) -> Roads:
    """A street to the east with a bend of 90 degrees, to the left with side 1."""
    bend = arc(50, side * RADIUS, RADIUS, -side * 90, side * 90)
    return make(
        a=(line((0, 0), (50, 0)), "b", 10.0),
        b=(bend, "c", 10.0),
        c=(line((50 + RADIUS, side * RADIUS), (50 + RADIUS, side * 80)), "", 10.0),
    )


def beyond(world: World, row: int, side: int) -> tuple[float, float]:
    """How far the vehicle is beyond the inner and the outer border of the corner now [m]."""
    along = world.centre[row] + world.half_length[row] * np.linspace(-1.0, 1.0, 21)
    across = world.half_width[row] * np.array([[1.0], [-1.0]])
    turned = np.exp(1j * world.yaw[row]) * (along + 1j * across) + complex(world.x[row], world.y[row])
    x, y = turned.real - 50.0, side * RADIUS - turned.imag
    y *= side
    # To the line: straight, round, straight. The centre of the bend is (0, 0), the lane comes at y = RADIUS.
    inwards = np.where(x < 0.0, RADIUS - y, np.where(y < 0.0, RADIUS - x, RADIUS - np.hypot(x, y)))
    return float(inwards.max()) - HALF_LANE, float(-inwards.min()) - HALF_LANE


def drive(world: World, row: int, side: int, seconds: float = 9.0) -> tuple[FloatArray, FloatArray]:
    """The greatest of these while it drives through, and its offsets to the left."""
    found, offsets = [], []
    for i in range(round(seconds / DT)):
        step(world)
        offsets.append(world.lateral[row])
        if i % DECISION == 0:
            found.append(beyond(world, row, side))
    return np.array(found).max(axis=0), np.array(offsets)


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1, 1])
def test_bus_uses_both_sides_of_its_lane_in_a_bend_and_is_on_the_line_again_after_it(side: int) -> None:
    world = world_of(corner(side))
    row = car(world, "a", 30.0, speed=5.0, body=BUS)
    (inner, outer), offsets = drive(world, row, side)
    assert (inner, outer) == (pytest.approx(0.27, abs=0.08), pytest.approx(0.27, abs=0.08))  # without: -0.1 and 0.62
    assert np.abs(np.diff(offsets)).max() < 0.02
    assert offsets[-1] == 0.0
    assert (world.lateral_rate[row], world.drift[row]) == (0.0, 0.0)


@pytest.mark.parametrize(("body", "own"), [(CAR, 0.0), (BUS, 0.25)])
def test_car_and_bus_with_an_offset_of_its_own_do_not_swing(body: Body, own: float) -> None:
    world = world_of(corner())
    row = world.row(world.spawn(Kind.VEHICLE, body, name="npc", x=0.0, y=0.0, speed=5.0))
    keep_lane(world, row, 0, 42.0, lateral=own)
    _, offsets = drive(world, row, -1, 1.0)
    assert set(offsets.tolist()) == {own}


def test_swings_of_all_are_those_of_each_one() -> None:
    world = world_of(corner())
    longer = Body(12.0, 2.5, 3.2)
    places = [("a", 48.0, BUS), ("a", 49.5, longer), ("b", 0.5, BUS), ("b", 7.0, longer), ("c", 2.0, BUS)]
    rows = np.array([car(world, lane, s, speed=5.0, body=body) for lane, s, body in places])
    world.behind[rows] = [-1, -1, 0, -1, 1]
    distance = np.array([0.5, 0.4, 0.0, 0.3, 0.5])
    alone = World()
    alone.restore(world.snapshot())
    plan_swings(world, rows, distance, 0.1)
    for i in range(len(rows)):
        plan_swings(alone, rows[[i]], distance[[i]], 0.1)
    assert world.digest() == alone.digest()
    assert np.count_nonzero(world.lateral_rate[rows]) >= 3


def test_snapshot_in_the_middle_of_a_swing_goes_on_with_the_same_bits() -> None:
    world = world_of(corner())
    row = car(world, "a", 46.0, speed=5.0, body=BUS)
    for _ in range(13):
        step(world)
    assert world.lateral[row] < 0.0
    restored = World()
    restored.restore(world.snapshot())
    for _ in range(20):
        step(world)
        step(restored)
    assert restored.digest() == world.digest()

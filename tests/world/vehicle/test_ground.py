"""Friction of the ground: on a road, beside it, and without a map."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.entity_types import ROAD_FRICTION
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Dynamics, Kind, World
from rosbridge_sim.world.step import step
from rosbridge_sim.world.vehicle.ground import INTERVAL, OFF_ROAD_FRICTION, are_on_road, find_friction
from tests.world.driven_cars import CAR, pedals

ROAD = Roads(["a"], [np.array([[0.0, 0.0, 0.0], [400.0, 0.0, 0.0]])], [[]], [3.5], [20.0])


def braking(y: float, roads: Roads | None = ROAD) -> World:
    world = World(0, Dynamics.SINGLE_TRACK)
    if roads is not None:
        world.lay_roads(roads)
    world.spawn(Kind.EGO, CAR, name="ego", x=50.0, y=y, speed=25.0)
    pedals(world, brake=1.0)
    return world


@pytest.mark.parametrize(("y", "friction"), [(0.0, 0.9), (1.7, 0.9), (1.8, 0.6)])  # asphalt and gravel
def test_brakes_find_the_friction_of_the_ground(y: float, friction: float) -> None:
    world = braking(y)
    for _ in range(60):
        step(world)
    assert world.friction[0] == friction
    assert -world.accel[0] == pytest.approx(0.95 * CAR.grip_along * friction * 9.80665, abs=0.7)


def test_all_is_road_without_a_map() -> None:
    world = braking(30.0, None)
    for _ in range(60):
        step(world)
    assert world.friction[0] == ROAD_FRICTION


def test_gentle_drive_does_not_look_at_the_ground() -> None:
    world = braking(30.0)
    pedals(world, brake=0.2)
    for _ in range(3 * INTERVAL):
        step(world)
    assert world.friction[0] == ROAD_FRICTION


def test_placed_car_starts_with_the_friction_of_a_road() -> None:
    world = braking(30.0)
    for _ in range(60):
        step(world)
    assert world.friction[0] == OFF_ROAD_FRICTION
    teleport(world, 0, x=60.0, y=0.0, z=0.0, yaw=0.0, speed=5.0)
    assert world.friction[0] == ROAD_FRICTION


def test_places_between_the_edges_are_on_the_road() -> None:
    found = are_on_road(ROAD, np.array([10.0, 10.0, -30.0]), np.array([1.0, -9.0, 0.0]), np.zeros(3))
    assert found.tolist() == [True, False, False]


def test_places_within_a_bend_of_few_points_are_on_the_road() -> None:
    """The line bulges 0.35 m beyond its chords, and the far edge lies as much farther from them."""
    angle = np.radians(np.arange(0.0, 91.0, 15.0))
    points = 40.0 * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    bend = Roads(["a"], [points], [[]], [3.5], [20.0])
    middle = np.radians(37.5)
    radius = np.array([38.2, 38.4, 41.6, 41.8])
    x, y = radius * np.cos(middle), radius * np.sin(middle)
    assert are_on_road(bend, x, y, np.zeros(4)).tolist() == [False, True, True, False]


def test_edges_of_a_bend_with_points_far_apart_are_on_the_road() -> None:
    """Its smooth line is beyond the chords between its points."""
    angles = np.arange(-90.0, 91.0, 20.0)
    bend = np.stack((100 + 60 * np.cos(np.radians(angles)), 60 + 60 * np.sin(np.radians(angles)), 0 * angles), axis=-1)
    points = np.concatenate([[(0.0, 0.0, 0.0), (50.0, 0.0, 0.0)], bend])
    roads = Roads(["a"], [points], [[]], [3.5], [20.0])
    s = np.linspace(120.0, 200.0, 41)
    places, yaw = roads.at(np.zeros(41, dtype=np.int64), s)
    for aside, is_on in [(-1.7, True), (1.7, True), (-1.9, False), (1.9, False)]:
        x, y = places[:, 0] - aside * np.sin(yaw), places[:, 1] + aside * np.cos(yaw)
        assert are_on_road(roads, x, y, np.zeros(41)).tolist() == [is_on] * 41
    assert np.hypot(places[:, 0] - 100.0, places[:, 1] - 60.0).max() == pytest.approx(60.0, abs=0.1)


@pytest.mark.parametrize("frame", range(6))
def test_ground_is_looked_at_in_each_fifth_frame_below_those_that_use_their_grip(frame: int) -> None:
    world = World(0, Dynamics.SINGLE_TRACK)
    world.lay_roads(ROAD)
    # Along and to the left [m/s^2]: both together count, braking and to the right too.
    accels = [(2.9, 0.7), (2.9, 0.9), (-3.1, 0.0), (0.0, -3.1), (-2.2, -2.2), (0.0, 0.0), (-2.0, 2.0)]
    for y in (30.0, 0.0):
        for accel in accels:
            row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=50.0, y=y))
            world.accel[row], world.lateral_accel[row] = accel
            world.friction[row] = 0.7  # neither of a road nor beside it
    world.frame, rows = frame, np.arange(1, 2 * len(accels))
    find_friction(world, rows)
    expected = [
        (OFF_ROAD_FRICTION if i < len(accels) else ROAD_FRICTION)
        if i and frame in {0, 5} and np.hypot(*accels[i % len(accels)]) > 3.0
        else 0.7
        for i in range(2 * len(accels))
    ]
    assert world.friction.tolist() == expected


def test_lane_above_or_below_is_no_road_unless_the_map_is_flat() -> None:
    heights = np.array([[0.0, 0.0, 8.0], [200.0, 0.0, 8.0], [400.0, 0.0, 9.0]])
    hill = Roads(["a"], [heights], [[]], [3.5], [20.0])
    x, z = np.full(4, 100.0), np.array([0.0, 7.9, 8.5, 20.0])
    assert are_on_road(hill, x, np.zeros(4), z).tolist() == [False, True, True, False]
    assert are_on_road(ROAD, x, np.zeros(4), z).all()


def stop(share: float) -> World:
    """A world whose ego has stopped from 20 m/s on ground with a share of the friction of a dry one."""
    world = World(0, Dynamics.SINGLE_TRACK)
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, speed=20.0)
    world.set_friction_share(share)
    pedals(world, brake=1.0)
    while world.speed.item(0) > 0.0:
        step(world)
    return world


@pytest.mark.parametrize("share", [0.7, 0.5])
def test_wet_ground_lengthens_the_way_of_a_stop(share: float) -> None:
    ratio = stop(share).x.item(0) / stop(1.0).x.item(0)
    assert 0.85 / share < ratio < 1.0 / share, "drag and the lag of the brake are as on dry ground"


def test_wet_ground_is_part_of_the_state_and_holds_for_egos_that_come_and_are_placed() -> None:
    dry, wet = World(0, Dynamics.SINGLE_TRACK), World(0, Dynamics.SINGLE_TRACK)
    wet.set_friction_share(0.7)
    assert dry.digest() != wet.digest()
    for world in (dry, wet):
        world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0)
        teleport(world, 0, x=5.0, y=0.0, z=0.0, yaw=0.0)
    assert wet.friction.item(0) == pytest.approx(0.7 * dry.friction.item(0))
    other = World(0, Dynamics.SINGLE_TRACK)
    other.restore(from_plain(to_plain(wet.snapshot()), wet.roads, wet.plan))
    assert (other.friction_share, other.digest()) == (0.7, wet.digest())
    wet.set_friction_share(1.0)
    assert wet.friction.item(0) == dry.friction.item(0)
    assert wet.digest() == dry.digest()


@pytest.mark.parametrize("share", [0.0, 1.5, math.nan, 1, "wet", None])
def test_snapshot_with_another_friction_is_refused(share: object) -> None:
    world = World(0, Dynamics.SINGLE_TRACK)
    with pytest.raises(ValueError, match=r"world.friction_share: expected 0.1..1"):
        from_plain(to_plain(world.snapshot()) | {"friction_share": share}, world.roads, world.plan)

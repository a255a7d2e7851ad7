"""Vehicles on paths that stop for what is ahead: each decision is that of the equations, and of the first body."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.followers.careful_driving import mind_the_path
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.state.world import Body, Kind, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import CAR

MAN = Body.box(0.45, 0.55, 1.7)
STRAIGHT = np.array([[0.0, 0.0], [200.0, 0.0]])
SPEED = 8.0
NOSE = CAR.length - CAR.rear_overhang
"""From the rear axle, the reference point [m]."""


def careful(world: World, speed: float = SPEED, path: FloatArray = STRAIGHT, *, is_loop: bool = False) -> int:
    x, y = path[0]
    uid = world.spawn(Kind.VEHICLE, CAR, name="a", x=x, y=y, path=path, speed=speed, is_loop=is_loop, yields=True)
    return world.row(uid)


def decide(world: World, row: int) -> float:
    """The acceleration that the vehicle decides on [m/s^2]."""
    before = world.speed[row]
    world.frame = 1
    mind_the_path(world)
    assert world.accel[row] == pytest.approx((world.speed[row] - before) / 0.1)
    return float(world.accel[row])


def by_the_model(speed: float, wish: float, gap: float, lead: float) -> float:
    """The intelligent driver model with a = 1.5, b = 2, T = 1.2 s and s0 = 2 m; at most 8 m/s^2 of braking."""
    room = 2.0 + max(speed * (1.2 + (speed - lead) / (2.0 * math.sqrt(1.5 * 2.0))), 0.0)
    return max(1.5 * (1.0 - (speed / wish) ** 4 - (room / max(gap, 0.1)) ** 2), -8.0)


def first_place_on(distance: float, half: float, margin: float) -> float:
    """The gap to a body across a straight path: the first place, each 0.5 m from the nose on, that is within it."""
    places = [0.5 * i for i in range(200)]
    return next(place for place in places if abs(NOSE + place - distance) < half + CAR.width / 2.0 + margin)


@pytest.mark.parametrize(("kind", "body", "margin"), [(Kind.PEDESTRIAN, MAN, 1.0), (Kind.OBSTACLE, MAN, 0.4)])
@pytest.mark.parametrize("distance", [11.0, 14.3, 24.9, 33.1])
def test_decision_is_that_of_the_model_for_the_first_place_that_a_body_leaves_no_room_at(
    kind: Kind, body: Body, margin: float, distance: float
) -> None:
    world = World()
    row = careful(world)
    world.desired_speed[row] = 10.0
    world.spawn(kind, body, name="b", x=distance, y=0.0)
    gap = first_place_on(distance, body.length / 2.0, margin)
    assert decide(world, row) == pytest.approx(by_the_model(SPEED, 10.0, gap, 0.0))


@pytest.mark.parametrize("path_yaw", [0.0, 0.6])
@pytest.mark.parametrize(("yaw", "lead"), [(0.0, 5.0), (0.7, 5.0 * math.cos(0.7)), (2.5, 0.0)])
def test_lead_counts_with_its_speed_along_the_path_and_one_that_comes_stands(
    yaw: float, lead: float, path_yaw: float
) -> None:
    world = World()
    along = np.array([math.cos(path_yaw), math.sin(path_yaw)])
    row = careful(world, path=np.array([[0.0, 0.0], 200.0 * along]))
    world.desired_speed[row] = 10.0
    x, y = 25.0 * along
    world.spawn(Kind.OBSTACLE, Body.box(0.4, 0.4, 1.0), name="b", x=x, y=y, yaw=path_yaw + yaw, speed=5.0)
    turned = 0.2 + CAR.width / 2.0 + 0.4
    gap = next(
        0.5 * i
        for i in range(200)
        if max(abs((NOSE + 0.5 * i - 25.0) * math.cos(yaw)), abs((NOSE + 0.5 * i - 25.0) * math.sin(yaw))) < turned
    )
    assert decide(world, row) == pytest.approx(by_the_model(SPEED, 10.0, gap, lead))


@pytest.mark.parametrize(("kind", "margin"), [(Kind.PEDESTRIAN, 1.0), (Kind.OBSTACLE, 0.4)])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("path_yaw", [0.0, 0.6, math.pi / 2, 3.0])
def test_body_counts_up_to_the_wanted_room_beside_the_path(
    kind: Kind, margin: float, side: float, path_yaw: float
) -> None:
    """Whatever the direction of the path. The body stands along it, 20 m ahead."""
    edge = CAR.width / 2.0 + margin + MAN.width / 2.0
    for offset, counts in [(edge - 0.05, True), (edge + 0.05, False)]:
        world = World()
        along = np.array([math.cos(path_yaw), math.sin(path_yaw)])
        row = careful(world, path=np.array([[0.0, 0.0], 200.0 * along]))
        x, y = 20.0 * along + side * offset * np.array([-along[1], along[0]])
        world.spawn(kind, MAN, name="b", x=x, y=y, yaw=path_yaw)
        assert (decide(world, row) < -1.0) == counts


@pytest.mark.parametrize("yaw", [math.pi / 2, -math.pi / 2])
def test_box_of_a_body_counts_and_not_its_reference_point(yaw: float) -> None:
    """A car across the path, with its rear axle beside it: only one of both ends reaches into the wanted room."""
    room = CAR.width / 2.0 + 0.4
    for to_middle, counts in [(NOSE + room - 0.05, True), (NOSE + room + 0.05, False)]:
        world = World()
        row = careful(world)
        world.spawn(Kind.OBSTACLE, CAR, name="b", x=20.0, y=-math.sin(yaw) * to_middle, yaw=yaw)
        assert (decide(world, row) < -1.0) == counts
    for to_middle, counts in [(CAR.rear_overhang + room - 0.05, True), (CAR.rear_overhang + room + 0.05, False)]:
        world = World()
        row = careful(world)
        world.spawn(Kind.OBSTACLE, CAR, name="b", x=20.0, y=math.sin(yaw) * to_middle, yaw=yaw)
        assert (decide(world, row) < -1.0) == counts


@pytest.mark.parametrize(("height", "counts"), [(4.0, True), (5.3, True), (5.5, False), (8.0, False), (-8.0, False)])
def test_body_on_a_bridge_above_or_below_does_not_count(height: float, counts: bool) -> None:  # noqa: FBT001 - a case
    world = World()
    row = careful(world)
    other = world.row(world.spawn(Kind.OBSTACLE, MAN, name="b", x=15.0, y=0.0))
    world.z[other] = height
    assert (decide(world, row) < -1.0) == counts


@pytest.mark.parametrize(("speed", "sees_to"), [(2.0, 28.0), (8.0, 52.0)])
def test_it_looks_twenty_metres_ahead_and_four_seconds_more(speed: float, sees_to: float) -> None:
    room = MAN.length / 2.0 + CAR.width / 2.0 + 0.4
    found = []
    for distance in (NOSE + sees_to + room - 0.8, NOSE + sees_to + room + 0.3):
        world, free = World(), World()
        row, alone = careful(world, speed), careful(free, speed)
        world.spawn(Kind.OBSTACLE, MAN, name="b", x=distance, y=0.0)
        found.append(decide(world, row) < decide(free, alone))
    assert found == [True, False]


def test_vehicle_without_others_takes_its_wanted_speed_and_stops_at_the_end_of_its_path() -> None:
    world = World()
    row = careful(world)
    world.desired_speed[row] = 16.0
    assert decide(world, row) == pytest.approx(1.5 * (1.0 - 0.5**4))
    world.arc[row] = world.path_length[row]
    world.speed[row] = SPEED
    assert decide(world, row) == pytest.approx(-SPEED / 0.1)


def test_loop_looks_beyond_its_end_and_another_path_does_not() -> None:
    square = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 60.0], [0.0, 60.0], [0.0, 0.0]])
    for is_loop in (True, False):
        world = World()
        row = careful(world, path=square, is_loop=is_loop)
        world.arc[row], world.x[row], world.y[row] = 225.0, 0.0, 15.0
        world.spawn(Kind.OBSTACLE, MAN, name="b", x=6.0, y=0.0)  # 6 m after the end, or 21 m ahead
        assert (decide(world, row) < -1.0) == is_loop


def test_decisions_fall_on_each_fifth_frame_one_after_those_of_drivers() -> None:
    world = World()
    row = careful(world)
    world.spawn(Kind.OBSTACLE, MAN, name="b", x=12.0, y=0.0)
    changes = []
    for _ in range(11):
        before = world.speed[row]
        step(world)
        changes.append(world.speed[row] != before)
    assert [frame for frame, is_one in enumerate(changes) if is_one] == [1, 6]


def test_those_that_wait_for_an_ego_and_ghosts_do_not_decide() -> None:
    world = World()
    uid = world.spawn(
        Kind.VEHICLE, CAR, name="a", x=0.0, y=0.0, path=STRAIGHT, speed=SPEED, start_within=30.0, yields=True
    )
    row = world.row(uid)
    mind_speed = world.speed[row]
    world.frame = 1
    mind_the_path(world)
    assert world.speed[row] == mind_speed == 0.0


def test_pedestrian_on_a_path_is_no_vehicle() -> None:
    world = World()
    careful(world)
    uid = world.spawn(Kind.PEDESTRIAN, MAN, name="p", x=0.0, y=5.0, path=STRAIGHT + 5.0, speed=1.3, yields=True)
    row = world.row(uid)
    world.desired_speed[row], world.frame = 2.0, 1
    mind_the_path(world)
    assert (world.speed[row], world.accel[row]) == (1.3, 0.0)

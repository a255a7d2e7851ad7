"""Entities that stand until an ego comes near."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.world.followers.lane_following import view_driver
from rosbridge_sim.world.followers.waiting import start
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import world_of
from tests.world.road_factory import car as lane_car
from tests.world.road_factory import crossing, keep_lane, road

pytestmark = pytest.mark.usefixtures("loops")

CAR = Body()
MAN = Body.box(0.5, 0.6, 1.75)


def ego(world: World, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> int:
    return world.row(world.spawn(Kind.EGO, CAR, name="ego", x=x, y=y, z=z))


def walker(world: World, kind: Kind = Kind.PEDESTRIAN, **figures: Any) -> int:  # noqa: ANN401 - whatever spawn takes
    usual: dict[str, Any] = {"name": "man", "x": 50.0, "y": 3.0, "speed": 1.5, "start_within": 20.0}
    return world.row(world.spawn(kind, MAN, **(usual | figures)))


def steps(world: World, num: int) -> None:
    for _ in range(num):
        step(world)


@pytest.mark.parametrize("kind", [Kind.PEDESTRIAN, Kind.OBSTACLE, Kind.VEHICLE])
def test_waiting_entity_starts_for_good_when_an_ego_is_near(kind: Kind) -> None:
    world = World()
    car, man = ego(world), walker(world, kind)
    steps(world, 100)
    assert (world.x[man], world.speed[man]) == (50.0, 0.0)
    teleport(world, car, x=30.1, y=3.0, z=0.0, yaw=0.0, speed=0.0)
    step(world)
    assert world.x[man] > 50.0
    assert (world.speed[man], world.start_within[man], world.start_speed[man]) == (1.5, 0.0, 0.0)
    teleport(world, car, x=-500.0, y=0.0, z=0.0, yaw=0.0, speed=0.0)
    steps(world, 50)
    assert world.x[man] == pytest.approx(50.0 + 51 * 0.03)


def test_distance_is_horizontal_and_to_the_nearest_ego() -> None:
    for x, does_start in ((29.9, False), (30.0, True), (70.0, True), (70.1, False)):
        world = World()
        ego(world, x=-1000.0)
        ego(world, x=x, y=3.0, z=500.0)
        man = walker(world)
        step(world)
        assert bool(world.speed[man]) is does_start, x


def test_approaching_ego_starts_a_pedestrian_on_its_path() -> None:
    world = World()
    car = ego(world)
    man = walker(world, path=np.array([[50.0, 3.0], [50.0, -3.0]]))
    assert world.yaw[man] == pytest.approx(-math.pi / 2)
    command(world, car, mode=Mode.SPEED, speed=15.0, steer=0.0)
    frame = None
    for _ in range(1_000):
        step(world)
        if frame is None and world.speed[man]:
            frame = world.frame
            # It was decided by where the car had been at the beginning of the step.
            assert 19.5 < math.hypot(world.x[car] - 50.0, world.y[car] - 3.0) < 20.5
    assert frame is not None
    assert (world.x[man], world.y[man], world.speed[man]) == (50.0, -3.0, 0.0)


def test_waiting_entity_without_an_ego_waits_and_without_speed_does_not() -> None:
    world = World()
    man, still = walker(world), walker(world, speed=0.0)
    steps(world, 10)
    assert (world.speed[man], world.start_within[man]) == (0.0, 20.0)
    assert world.start_within[still] == 0.0


def test_teleported_entity_no_longer_waits() -> None:
    world = World()
    ego(world)
    man = walker(world)
    world.place(man, x=100.0, y=0.0, z=0.0, yaw=0.0, speed=0.0)
    assert world.start_within[man] == 0.0
    other = walker(world)
    world.place_all(np.array([other]), x=np.zeros(1), y=np.zeros(1), z=np.zeros(1), yaw=np.zeros(1), speed=np.zeros(1))
    step(world)
    assert (world.start_within[other], world.speed[other]) == (0.0, 0.0)


def test_waiting_is_part_of_the_digest() -> None:
    def made(start_within: float) -> World:
        world = World()
        ego(world)
        walker(world, start_within=start_within)
        return world

    world = made(20.0)
    assert world.digest() == made(20.0).digest() != made(21.0).digest()
    saved = world.snapshot()
    teleport(world, 0, x=40.0, y=0.0, z=0.0, yaw=0.0, speed=0.0)
    steps(world, 50)
    after = world.digest()
    world.restore(saved)
    assert world.digest() == made(20.0).digest()
    teleport(world, 0, x=40.0, y=0.0, z=0.0, yaw=0.0, speed=0.0)
    steps(world, 50)
    assert world.digest() == after
    row = int(world.rows(Kind.PEDESTRIAN)[0])
    world.restore(saved)
    world.remove(int(world.uid[row]))
    assert walker(world, start_within=0.0) == row
    assert world.start_within[row] == 0.0
    world.reset()
    assert not (world.start_within > 0.0).any()


@pytest.mark.parametrize(
    ("kind", "figures"),
    [
        (Kind.PEDESTRIAN, {"start_within": -1.0}),
        (Kind.PEDESTRIAN, {"start_within": math.nan}),
        (Kind.PEDESTRIAN, {"start_within": math.inf}),
        (Kind.EGO, {"start_within": 5.0}),
        (Kind.PEDESTRIAN, {"roll": math.nan}),
        (Kind.PEDESTRIAN, {"pitch": math.inf}),
    ],
)
def test_invalid_waiting_distance_and_tilt_are_refused(kind: Kind, figures: dict[str, Any]) -> None:
    world = World()
    before = world.digest()
    with pytest.raises(ValueError, match=r"start_within|roll|pitch"):
        world.spawn(kind, CAR, name="x", x=0.0, y=0.0, speed=1.0, **figures)
    assert world.digest() == before


def test_waiting_entity_keeps_roll_and_pitch() -> None:
    world = World()
    box = world.row(world.spawn(Kind.OBSTACLE, MAN, name="box", x=0.0, y=0.0, roll=1.5, pitch=-0.2))
    steps(world, 5)
    assert (world.roll[box], world.pitch[box]) == (1.5, -0.2)


def test_driver_on_a_lane_stands_until_an_ego_is_near_and_then_drives_like_all() -> None:
    for speed in (0.0, 5.0):
        world = world_of(road(length=500.0, limit=15.0))
        parked = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=speed))
        keep_lane(world, parked, 0, 100.0, start_within=20.0)
        behind = lane_car(world, "a", 50.0, speed=10.0)
        car = ego(world, x=300.0, y=50.0)
        assert view_driver(world, parked) is None
        steps(world, 600)
        assert (world.x[parked], world.speed[parked], world.start_speed[parked]) == (100.0, 0.0, speed)
        assert world.speed[behind] == pytest.approx(0.0, abs=0.01)
        assert 80.0 < world.x[behind] < 100.0, "it queues behind what stands on its lane"
        teleport(world, car, x=100.0, y=19.0, z=0.0, yaw=0.0, speed=0.0)
        steps(world, 1)
        assert world.speed[parked] == pytest.approx(speed, abs=0.1)
        teleport(world, car, x=300.0, y=50.0, z=0.0, yaw=0.0, speed=0.0)
        steps(world, 500)
        assert world.x[parked] > 150.0
        assert world.x[behind] > 100.0


def test_driver_that_waits_holds_no_crossing() -> None:
    world = world_of(crossing())
    waiting = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
    keep_lane(world, waiting, world.roads.row("w"), 184.0, start_within=1.0)
    other = lane_car(world, "s", 100.0, speed=5.0)
    steps(world, 1500)
    assert (world.speed[waiting], world.claim[waiting]) == (0.0, -1)
    assert world.roads.ids[world.lane[other]] == "n"


def test_start_distance_of_a_driver_is_checked() -> None:
    world = world_of(road())
    row = lane_car(world, "a", 10.0)
    for bad in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="start_within"):
            keep_lane(world, row, 0, 10.0, start_within=bad)


@pytest.mark.parametrize(
    ("away", "starts"),
    [((29.9, 0.0), True), ((0.0, 29.9), True), ((-21.1, 21.1), True), ((30.1, 0.0), False), ((21.3, -21.3), False)],
)
def test_one_that_waits_starts_for_the_nearest_ego_in_any_direction(
    away: tuple[float, float],
    starts: bool,  # noqa: FBT001 - a case
) -> None:
    world = World()
    path = np.array([[500.0, 400.0], [500.0, 450.0]])
    waiting = world.row(
        world.spawn(Kind.PEDESTRIAN, CAR, name="a", x=500.0, y=400.0, path=path, speed=2.5, start_within=30.0)
    )
    ego(world, -500.0, 400.0)
    ego(world, 500.0 + away[0], 400.0 + away[1])
    assert (world.speed[waiting], world.start_within[waiting], world.start_speed[waiting]) == (0.0, 30.0, 2.5)
    start(world)
    expected = (2.5, 0.0, 0.0) if starts else (0.0, 30.0, 2.5)
    assert (world.speed[waiting], world.start_within[waiting], world.start_speed[waiting]) == expected

"""Teleports and ghosts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.state.placement import place_ghost, place_ghosts, set_speed, teleport
from rosbridge_sim.world.state.world import DT, Body, Gear, Kind, World
from rosbridge_sim.world.step import step
from tests.world.driven_cars import CAR, ego, pedals


def run(world: World, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        step(world)


def test_teleport_to_a_non_finite_place_is_refused() -> None:
    world = ego(speed=3.0)
    before = world.digest()
    for figure in ("x", "y", "z", "yaw", "speed", "roll", "pitch"):
        pose = {"x": 1.0, "y": 1.0, "z": 0.0, "yaw": 0.0} | {figure: math.nan}
        with pytest.raises(ValueError, match=f"{figure}: "):
            teleport(world, 0, is_ghost=False, **pose)
    assert world.digest() == before


def test_teleport_keeps_command_gear_and_steering() -> None:
    world = ego(speed=5.0)
    pedals(world, throttle=0.5, steer=0.2)
    run(world, 1.0)
    teleport(world, 0, x=7.0, y=8.0, z=9.0, yaw=-7.0, speed=2.0, roll=0.1, pitch=-0.1)
    assert (world.x[0], world.y[0], world.z[0], world.roll[0], world.pitch[0]) == (7.0, 8.0, 9.0, 0.1, -0.1)
    assert world.yaw[0] == pytest.approx(2 * math.pi - 7.0)
    assert (world.speed[0], world.accel[0], world.yaw_rate[0]) == (2.0, 0.0, 0.0)
    assert (world.steer[0], world.throttle[0], world.gear[0]) == (0.2, 0.5, Gear.DRIVE)
    step(world)
    assert world.speed[0] > 2.0


def test_ghost_stands_and_keeps_its_speed_until_a_command() -> None:
    world = ego()
    pedals(world, throttle=1.0)
    place_ghost(world, 0, x=5.0, y=6.0, z=7.0, yaw=4.0, speed=20.0, roll=0.1, pitch=0.2)
    run(world, 1.0)
    assert (world.x[0], world.y[0], world.z[0], world.speed[0]) == (5.0, 6.0, 7.0, 20.0)
    assert world.yaw[0] == pytest.approx(4.0 - math.tau)
    assert (world.roll[0], world.pitch[0], world.accel[0]) == (0.1, 0.2, 0.0)
    pedals(world)
    run(world, 0.1)
    assert math.hypot(world.x[0] - 5.0, world.y[0] - 6.0) == pytest.approx(2.0, rel=0.05)


def test_ghost_stands_while_another_ego_drives() -> None:
    world = ego(speed=10.0)
    world.spawn(Kind.EGO, CAR, name="other", x=0.0, y=9.0, speed=10.0)
    world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=18.0, speed=10.0)
    world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=27.0, speed=10.0)
    place_ghost(world, 0, x=1.0, y=0.0, z=0.0, yaw=0.0, speed=10.0)
    place_ghost(world, 2, x=1.0, y=18.0, z=0.0, yaw=0.0, speed=10.0)
    run(world, 1.0)
    assert world.x[[0, 2]].tolist() == [1.0, 1.0]
    assert (world.x[[1, 3]] > 9.0).all()
    teleport(world, 2, x=1.0, y=18.0, z=0.0, yaw=0.0, speed=10.0)
    run(world, 1.0)
    assert world.x[0] == 1.0
    assert world.x[2] == pytest.approx(11.0)


def test_ghost_at_a_non_finite_place_is_refused() -> None:
    world = ego()
    with pytest.raises(ValueError, match="speed: expected"):
        place_ghost(world, 0, x=5.0, y=0.0, z=0.0, yaw=0.0, speed=math.nan)
    assert (world.x[0], bool(world.is_ghost[0])) == (0.0, False)


def test_many_ghosts_at_once_equal_one_by_one() -> None:
    path = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0]])
    worlds = World(), World()
    for world in worlds:
        world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0)
        world.spawn(Kind.VEHICLE, Body(), name="a", x=0.0, y=0.0, speed=3.0, path=path)
        world.spawn(Kind.VEHICLE, Body(), name="b", x=9.0, y=0.0, speed=3.0)
        step(world)
    one, other = worlds
    poses = np.array(
        [
            [1.0, 2.0, 3.0, math.pi, 4.0, 0.1, 0.2],
            [-1.0, 5.0, 0.0, -10.0, -4.0, 0.0, 0.0],
            [1e6, 5.0, 0.0, 3.13, 0.0, 0.0, 0.3],
        ]
    )
    for row, (x, y, z, yaw, speed, roll, pitch) in enumerate(poses.tolist()):
        place_ghost(one, row, x=x, y=y, z=z, yaw=yaw, speed=speed, roll=roll, pitch=pitch)
    place_ghosts(other, np.array([0, 1, 2]), poses.T)
    for _ in range(3):
        assert one.digest() == other.digest()
        step(one)
        step(other)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e300])
def test_one_out_of_range_ghost_moves_none(wrong: float) -> None:
    world = World()
    for i in range(2):
        world.spawn(Kind.VEHICLE, Body(), name="x", x=10.0 * i, y=0.0)
    before = world.digest()
    for figure in range(7):
        poses = np.zeros((7, 2))
        poses[figure, 1] = wrong
        with pytest.raises(ValueError, match="expected finite numbers"):
            place_ghosts(world, np.array([0, 1]), poses)
    assert world.digest() == before


def test_speed_is_set_at_once_and_ends_waiting_and_ghost() -> None:
    world = World()
    uid = world.spawn(Kind.PEDESTRIAN, Body.box(0.5, 0.5, 1.7), name="p", x=0.0, y=0.0, speed=1.0, start_within=5.0)
    row = world.row(uid)
    set_speed(world, row, -2.0)
    step(world)
    assert (world.x[row], world.speed[row]) == (pytest.approx(-0.04), -2.0)
    place_ghost(world, row, x=0.0, y=0.0, z=0.0, yaw=0.0, speed=3.0)
    set_speed(world, row, 1.0)
    step(world)
    assert world.x[row] == pytest.approx(0.02)


def test_speed_that_cannot_be_is_refused() -> None:
    world = World()
    path = np.array([[0.0, 0.0], [9.0, 0.0]])
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="c", x=0.0, y=0.0, speed=1.0, path=path))
    before = world.digest()
    for speed in (math.nan, 2e3, -1.0):
        with pytest.raises(ValueError, match="speed: expected"):
            set_speed(world, row, speed)
    assert world.digest() == before

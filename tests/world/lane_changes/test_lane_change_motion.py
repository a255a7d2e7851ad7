"""Lateral motion in the lane: smooth, along the heading, and no motion at all without an offset."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.followers.lane_following import DECISION
from rosbridge_sim.world.followers.motion import motion
from rosbridge_sim.world.lane_changes.lane_change_motion import shift
from rosbridge_sim.world.state.world import DT, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import world_of
from tests.world.road_factory import arc, car, make, road


def start_shift(world: World, row: int, target: float) -> None:
    shift(world, np.array([row]), np.array([target]))
    world.touch()


@pytest.mark.parametrize("line", ["straight", "bend"])
def test_a_shift_is_smooth_and_along_the_heading(line: str) -> None:
    is_bend = line == "bend"
    ring = make(a=(arc(0, 0, 60, 0, 180), "b", 10.0), b=(arc(0, 0, 60, 180, 180), "a", 10.0))
    world = world_of(ring if is_bend else road())
    row = car(world, "a", 30.0, speed=10.0, desired_speed=10.0)
    for _ in range(100):
        step(world)
    start_shift(world, row, 3.5)
    poses, yaws, slides = [], [], []
    for _ in range(250):
        step(world)
        poses.append(complex(world.x[row], world.y[row]))
        yaws.append(world.yaw[row])
        slides.append(motion(world, np.array([row]))[1, 0])
    assert (world.lateral[row], world.drift[row]) == (3.5, 0.0)
    moved = np.diff(poses)
    # The chord of both axles differs from the tangent at the rear axle by half a wheelbase over the radius.
    chord = 0.5 * world.wheelbase[row] / 60.0 if is_bend else 0.0
    off = np.angle(moved * np.exp(-1j * np.array(yaws[1:])))
    assert off + chord == pytest.approx(0.0, abs=0.02)
    assert np.abs(np.diff(poses[::DECISION], 2)).max() / (DECISION * DT) ** 2 < 3.5  # with 1.7 by the bend
    assert np.abs(moved) / DT == pytest.approx(world.speed[row], rel=0.04)
    assert np.abs(slides).max() < (0.6 if is_bend else 0.25)
    beside = 60.0 - abs(poses[-1]) if is_bend else poses[-1].imag
    assert beside == pytest.approx(3.5, abs=0.1)


@pytest.mark.parametrize(("speed", "usual"), [(10.0, 4.0), (30.0, 4.8)])
def test_lane_changes_take_three_to_six_seconds_by_driver_and_speed(speed: float, usual: float) -> None:
    world = world_of(road(9000.0, limit=40.0))
    rows = np.array([car(world, "a", 80.0 * i, speed=speed, desired_speed=speed) for i in range(100)])
    shift(world, rows, np.full(len(rows), 3.5))
    world.touch()
    frames = np.zeros(len(rows))
    for _ in range(350):
        frames += world.lateral_left[rows] > 0.0
        step(world)
    times = frames * DT
    assert times.mean() == pytest.approx(usual, abs=0.3)
    assert np.ptp(times) > 1.8
    assert times.min() >= 3.0
    assert times.max() < 6.3  # the steps of decisions


def test_what_stands_does_not_slide_to_the_side() -> None:
    world = world_of(road())
    row = car(world, "a", 30.0, desired_speed=0.0)
    start_shift(world, row, 3.5)
    before = world.x[row], world.y[row], world.yaw[row]
    for _ in range(100):
        step(world)
    assert (world.x[row], world.y[row], world.yaw[row]) == before


def test_a_shift_can_be_replaced_on_its_way() -> None:
    world = world_of(road())
    row = car(world, "a", 30.0, speed=12.0, desired_speed=12.0)
    start_shift(world, row, 3.0)
    places = []
    for frame in range(400):
        if frame == 110:
            start_shift(world, row, 0.0)
        step(world)
        places.append(world.y[row])
    assert 0.5 < max(places) < 3.0
    assert np.abs(np.diff(places[::DECISION], 2)).max() / (DECISION * DT) ** 2 < 6.0
    assert (world.lateral[row], world.y[row]) == (0.0, 0.0)
    assert world.yaw[row] == pytest.approx(0.0, abs=1e-12)

"""Lateral motion in the lane: smooth, along the heading, and no motion at all without an offset."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.followers.lane_following import DECISION
from rosbridge_sim.world.followers.motion import motion
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.lane_changes.lane_change_motion import (
    bend_slope,
    bend_way,
    find_shifted,
    find_way,
    length_of_tight_shift,
    nudge,
    plan_shifts,
    shift,
    shift_length,
    shift_time,
    slope_of,
)
from rosbridge_sim.world.state.world import DT, Body, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import BUS, world_of
from tests.world.road_factory import CAR, arc, car, make, road

pytestmark = pytest.mark.usefixtures("loops")


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
    rows = np.array([car(world, "a", 80.0 * i, speed=speed, desired_speed=speed) for i in range(60)])
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


@pytest.mark.parametrize(
    ("change_time", "speed", "seconds"),
    [(4.4, 20.0, 4.4), (4.4, 30.0, 4.4 * 1.09), (4.4, 10.0, 4.4 * 0.91), (2.5, 20.0, 3.0), (7.0, 20.0, 6.0)],
)
def test_lane_change_takes_the_own_time_at_72_km_h_and_longer_at_more(
    change_time: float, speed: float, seconds: float
) -> None:
    assert shift_time(ARRAYS, np.array([change_time]), np.array([speed])) == pytest.approx(np.array([seconds]))


@pytest.mark.parametrize(
    ("length", "across", "way"),
    [(4.5, 3.5, 10.0), (3.0, 3.5, 10.0), (4.5, 7.0, 10.0), (4.5, 3.5 / 4.0, 5.0), (10.5, 3.5, 25.0), (4.5, 0.0, 0.0)],
)
def test_shift_needs_ten_metres_and_more_for_long_vehicles(length: float, across: float, way: float) -> None:
    assert shift_length(ARRAYS, np.array([length]), np.array([across])) == pytest.approx(np.array([way]))


@pytest.mark.parametrize(("body", "across"), [(CAR, 3.5), (CAR, 1.0), (CAR, 5.0), (BUS, 3.5), (BUS, 1.0), (BUS, 5.0)])
def test_way_out_from_rest_is_that_of_the_full_lock_or_of_the_length(body: Body, across: float) -> None:
    world = world_of(road())
    row = car(world, "a", 30.0, body=body)
    radius = body.wheelbase / math.tan(math.radians(36.25))
    by_lock = math.sqrt(20.0 / 3.0 * across * radius)
    by_length = 1.8 * body.length * math.sqrt(min(across / 3.5, 1.0))
    found = length_of_tight_shift(world, np.array([row]), np.array([across]))
    assert found == pytest.approx(np.array([max(by_lock, by_length)]))
    assert (by_lock > by_length) == (body is CAR)


WAY = Polynomial([0, 0, 0, 10, -15, 6])
PUSH = Polynomial([0, 1, 0, -6, 8, -3])
BEND = Polynomial([0, 0, 0.5, -1.5, 1.5, -0.5])
"""The curves at the head of `lane_change_motion`, by the share of the time."""


def test_curves_of_a_shift_are_those_of_least_jerk_and_slopes_are_their_derivatives() -> None:
    p = np.linspace(0.0, 1.0, 21)
    for curve, found in [
        (WAY, find_way),
        (WAY.deriv(), slope_of),
        (BEND, bend_way),
        (BEND.deriv(), bend_slope),
    ]:
        assert found(p) == pytest.approx(curve(p), abs=1e-12)


def on_the_way(seed: int) -> tuple[World, IntArray]:
    """Vehicles at rest in their lanes, on their way to other offsets, and at the end of it."""
    rng, world = np.random.default_rng(seed), world_of(road(4000.0))
    rows = np.array([car(world, "a", 20.0 + 40.0 * i, body=BUS if i % 3 else CAR, speed=8.0) for i in range(24)])
    num = len(rows)
    world.lateral_left[rows] = rng.choice([0.0, 0.01, 1.0], num) * rng.uniform(0.1, 1.0, num)
    world.lateral_from[rows], world.lateral_to[rows], world.lateral[rows] = rng.uniform(-4.0, 4.0, (3, num))
    world.lateral_push[rows] = rng.choice([0.0, 1.0], num) * rng.uniform(-3.0, 3.0, num)
    world.lateral_bend[rows] = rng.choice([0.0, 1.0], num) * rng.uniform(-20.0, 20.0, num)
    world.drift[rows] = rng.uniform(-0.4, 0.4, num)
    return world, rows


@pytest.mark.parametrize("seed", range(6))
def test_offsets_until_the_next_decision_are_those_of_the_curves(seed: int) -> None:
    world, rows = on_the_way(seed)
    rng = np.random.default_rng(seed)
    time, distance = (
        rng.uniform(3.0, 6.0, len(rows)),
        rng.choice([0.0, 1.0, 1.0], len(rows)) * rng.uniform(0.01, 3.0, 24),
    )
    expected = []
    for row, seconds, driven in zip(rows.tolist(), time.tolist(), distance.tolist(), strict=True):
        left, before, drift = (float(each[row]) for each in (world.lateral_left, world.lateral, world.drift))
        start, end, push, bend = (
            float(each[row]) for each in (world.lateral_from, world.lateral_to, world.lateral_push, world.lateral_bend)
        )
        if left == 0.0:
            expected.append((0.0, 0.0, 0.0))
            continue
        one, across = np.array([row]), np.array([abs(end - start) + abs(push)])
        length = 2.0 * world.half_length[one]
        way = length_of_tight_shift(world, one, across) if bend else shift_length(ARRAYS, length, across)
        part = min(0.1 / seconds, driven / max(way.item(), 1.0), left)
        curve = start + (end - start) * WAY + push * PUSH + bend * BEND
        share = 1.0 - left + part
        angle = math.atan2(curve.deriv()(share) * part, driven) if driven else drift
        expected.append((left - part, (curve(share) - before) / 0.1, (angle - drift) / 0.1))
    arrived = rows[world.lateral_left[rows] == 0.0]
    target = world.lateral_to[arrived].copy()
    plan_shifts(world, rows, time, distance, 0.1)
    found = np.stack((world.lateral_left[rows], world.lateral_rate[rows], world.drift_rate[rows]), axis=-1)
    assert found == pytest.approx(np.array(expected), abs=1e-9)
    assert world.lateral[arrived].tolist() == world.lateral_from[arrived].tolist() == target.tolist()
    for column in (world.drift, world.lateral_push, world.lateral_bend):
        assert not column[arrived].any()


def test_shift_that_replaces_another_begins_with_its_slope() -> None:
    world, rows = on_the_way(1)
    curves = []
    for row in rows.tolist():
        start, end, push, bend = (
            float(each[row]) for each in (world.lateral_from, world.lateral_to, world.lateral_push, world.lateral_bend)
        )
        curves.append((start + (end - start) * WAY + push * PUSH + bend * BEND).deriv())
    left = world.lateral_left[rows].copy()
    slopes = [curve(1.0 - share) if share else 0.0 for curve, share in zip(curves, left.tolist(), strict=True)]
    target = np.where(np.arange(len(rows)) % 2, world.lateral[rows], 1.0)
    shift(world, rows, target)
    assert world.lateral_push[rows] == pytest.approx(np.array(slopes), abs=1e-9)
    assert world.lateral_from[rows].tolist() == world.lateral[rows].tolist()
    assert world.lateral_to[rows].tolist() == target.tolist()
    assert not world.lateral_bend[rows].any()
    is_there = (target == world.lateral[rows]) & (left == 0.0)
    assert world.lateral_left[rows].tolist() == np.where(is_there, 0.0, 1.0).tolist()
    assert is_there.any()


def test_vehicle_is_beside_its_line_by_its_offset_and_turned_by_its_drift() -> None:
    world = world_of(road())
    row = car(world, "a", 30.0)
    world.yaw[row], world.wander_slope[row], world.lateral[row], world.drift[row] = 0.7, 0.1, 1.0, 0.2
    world.lateral_rate[row], world.drift_rate[row] = 5.0, -5.0
    x, y = float(world.x[row]), float(world.y[row])
    nudge(world, np.array([row]), 0.02)
    assert (world.lateral[row], world.drift[row]) == (pytest.approx(1.1), pytest.approx(0.1))
    line_yaw = 0.7 - 0.1 - 0.1
    assert world.x[row] - x == pytest.approx(-1.1 * math.sin(line_yaw))
    assert world.y[row] - y == pytest.approx(1.1 * math.cos(line_yaw))


def test_those_beside_the_line_or_on_their_way_are_shifted_and_no_others() -> None:
    world = world_of(road())
    rows = np.array([car(world, "a", 30.0 + 20.0 * i) for i in range(5)])
    for column, row in zip(("lateral", "drift_rate", "lateral_left", "lateral_to"), rows.tolist(), strict=False):
        getattr(world, column)[row] = 0.5
    assert find_shifted(world, rows).tolist() == [0, 1, 2, 3]

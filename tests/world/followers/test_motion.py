"""Velocities and accelerations are consistent with positions."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rosbridge_sim.world.followers.motion import SPAN, motion
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import place_ghost, show_ghosts, teleport
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import world_of
from tests.world.road_factory import CAR, arc, built_in, car, keep_lane, line, make, signalled

pytestmark = pytest.mark.usefixtures("loops")

MAN = Body.box(0.5, 0.6, 1.75)
ANGLES = np.linspace(0.0, 2.0 * math.pi, 100, endpoint=False)
CIRCLE = np.column_stack([8.0 * np.cos(ANGLES), 8.0 * np.sin(ANGLES)])  # a waypoint each half metre
BENT = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0], [30.0, 5.0]])


class PublishedMotion:
    """Positions, velocities and accelerations of rows in the map frame, (3, k) each, and headings (k,)."""

    def __init__(self, world: World, rows: IntArray) -> None:
        self.place = np.stack([world.x[rows], world.y[rows], world.z[rows]])
        self.yaw = world.yaw[rows]
        self.speed = world.speed[rows]
        figures = motion(world, rows)
        self.velocity, self.accel = self._to_map(figures[:3]), self._to_map(figures[3:])

    def _to_map(self, vector: FloatArray) -> FloatArray:
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        return np.stack([vector[0] * cos - vector[1] * sin, vector[0] * sin + vector[1] * cos, vector[2]])


def follow(world: World, rows: IntArray, num_steps: int) -> list[PublishedMotion]:
    told = [PublishedMotion(world, rows)]
    for _ in range(num_steps):
        step(world)
        told.append(PublishedMotion(world, rows))
    return told


def npc(world: World, **figures: Any) -> int:  # noqa: ANN401 - whatever spawn takes
    usual: dict[str, Any] = {"kind": Kind.VEHICLE, "body": CAR, "name": "npc", "x": 0.0, "y": 0.0}
    return world.row(world.spawn(**(usual | figures)))


def ring(radius: float) -> World:
    """A car that goes round on two half circles of a point each metre."""
    world = World()
    halves = [arc(0, 0, radius, start, 180) for start in (0, 180)]
    world.lay_roads(make(a=(halves[0], "b", 10.0), b=(halves[1], "a", 10.0)))
    car(world, "a", 5.0, speed=3.0)
    return world


def town() -> World:
    """Forty drivers who move, stop at lights and turn."""
    world, built = World(3), built_in("town")
    roads = built.roads
    world.lay_roads(roads, built.plan)
    lanes = np.flatnonzero(np.isinf(roads.derived(LaneConflicts).wait_point) & (roads.length > 20.0))
    for lane in lanes[:40].tolist():
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=0.0, speed=4.0))
        keep_lane(world, row, lane, 8.0)
    return world


def largest(vectors: FloatArray) -> float:
    """The length of the longest of them, (3, k)."""
    return float(np.sqrt(np.square(vectors).sum(axis=0)).max())


def check_accelerations(told: list[PublishedMotion]) -> None:
    """Each acceleration is the change of the velocity that was told over the step."""
    for before, now in pairwise(told):
        assert largest(now.accel - (now.velocity - before.velocity) / DT) < 1e-6


# Drivers


@pytest.mark.parametrize("radius", [6.0, 20.0])
def test_steady_bend_gives_the_motion_of_the_rear_axle(radius: float) -> None:
    world = ring(radius)
    rows = np.array([0])
    for _ in range(150):
        step(world)
    told = follow(world, rows, 150)
    check_accelerations(told)
    for before, now, after in zip(told, told[1:], told[2:], strict=False):
        speed = float(now.speed[0])
        assert largest(now.velocity) == pytest.approx(speed)
        # The line has a corner of 1 / radius at each metre: between two of them its way is off by half of that.
        derivative = (after.place - before.place) / (2.0 * DT)
        assert largest(now.velocity - derivative) <= 0.5 * speed / radius + 0.02
    shares = [float(-now.accel[:, 0] @ now.place[:, 0]) / float(now.speed[0]) ** 2 for now in told[1:]]
    assert np.mean(shares) == pytest.approx(1.0, rel=0.02)  # of v^2 / r; corner after corner comes and goes
    assert max(shares) < 1.6
    velocity = motion(world, rows)[:, 0]
    # Both axles are on the circle, so the rear one moves outwards of where the car looks.
    crab = math.asin(CAR.wheelbase / 2.0 / radius)
    assert math.atan2(velocity[1], velocity[0]) == pytest.approx(-crab, abs=0.02)


def test_straight_driving_has_velocity_along_the_heading() -> None:
    world = World()
    world.lay_roads(make(a=(line((0, 0), (300, 400)), "", 15.0)))
    car(world, "a", 10.0, speed=3.0)
    for before, now in pairwise(follow(world, np.array([0]), 300)):
        assert largest(now.velocity - (now.place - before.place) / DT) <= 0.5 * largest(now.accel) * DT + 1e-9
    forward, left, up, ahead, aside, rise = motion(world, np.array([0]))[:, 0]
    assert (forward, left, up) == (world.speed[0], 0.0, 0.0)
    assert (ahead, aside, rise) == (pytest.approx(world.accel[0]), 0.0, 0.0)


def test_velocity_on_a_slope_has_an_upward_part() -> None:
    world = World()
    points = np.array([(0.0, 0.0, 0.0), (300.0, 0.0, 30.0)])
    world.lay_roads(make(a=(points, "")))
    car(world, "a", 5.0, speed=10.0)
    told = follow(world, np.array([0]), 50)
    check_accelerations(told)
    for before, now in pairwise(told):
        assert now.velocity[2, 0] == pytest.approx(now.velocity[0, 0] / 10.0)
        assert largest(now.velocity - (now.place - before.place) / DT) < 0.05


@pytest.mark.parametrize("is_on_lane", [True, False])
def test_upward_part_of_a_velocity_is_that_of_the_slope_at_a_corner_too(*, is_on_lane: bool) -> None:
    world = World()
    points = np.array([(0.0, 0.0, 0.0), (20.0, 0.0, 2.0), (20.0 + 30.0 * math.cos(0.6), 30.0 * math.sin(0.6), 5.0)])
    if is_on_lane:
        world.lay_roads(make(a=(points, "")))
        car(world, "a", 14.0, speed=6.0)
    else:
        npc(world, path=points, speed=6.0)
    for told in follow(world, np.array([0]), 300 if not is_on_lane else 120):
        east, north, up = told.velocity[:, 0]
        assert up / math.hypot(east, north) == pytest.approx(0.1, abs=0.01)


@pytest.mark.slow
def test_velocities_and_accelerations_in_the_town_are_consistent() -> None:
    world = town()
    rows = np.flatnonzero(world.has_lane)
    told = follow(world, rows, 600)
    check_accelerations(told)
    lateral, stood = [], 0
    for before, now in pairwise(told):
        stands = (now.speed == 0.0) & (before.speed == 0.0)
        stood += int(stands.sum())
        assert not now.velocity[:, stands].any()
        assert not now.accel[:, stands].any()
        turn = np.abs(np.angle(np.exp(1j * (now.yaw - before.yaw))))
        assert turn.max() < math.radians(2.0)
        cos, sin = np.cos(now.yaw), np.sin(now.yaw)
        lateral.append(now.accel[1] * cos - now.accel[0] * sin)
    assert stood > 1000
    assert 2.0 < np.abs(lateral).max() < 6.0  # no kicks, though lanes have corners


def test_braking_driver_has_its_deceleration_and_then_none() -> None:
    world = World()
    world.lay_roads(*signalled(green=600))
    row = car(world, "s", 130.0, speed=12.0)
    told = follow(world, np.array([row]), 500)
    check_accelerations(told)
    assert told[-1].speed[0] == 0.0
    assert min(float(now.accel[1, 0]) for now in told) < -1.0
    assert not told[-1].accel.any()


# Paths


@pytest.mark.slow
@pytest.mark.parametrize("path", [CIRCLE, BENT])
@pytest.mark.parametrize("body", [CAR, MAN])
def test_velocities_and_accelerations_on_a_path_are_consistent(path: FloatArray, body: Body) -> None:
    world = World()
    kind = Kind.VEHICLE if body is CAR else Kind.PEDESTRIAN
    row = npc(world, kind=kind, body=body, x=path[0, 0], y=path[0, 1], path=path, is_loop=True, speed=2.0)
    told = follow(world, np.array([row]), 500)
    check_accelerations(told)
    lag = round(SPAN[kind] / 2.0 / 2.0 / DT)  # frames for half of the span
    for before, now, after in zip(told, told[lag:], told[2 * lag :], strict=False):
        mean = (after.place - before.place) / (2 * lag * DT)
        assert largest(now.velocity - mean / max(largest(mean) / 2.0, 0.7)) < 0.1


def test_circle_of_short_segments_has_centripetal_acceleration() -> None:
    world = World()
    row = npc(world, x=8.0, path=CIRCLE, is_loop=True, speed=4.0)
    for now in follow(world, np.array([row]), 250)[1:]:
        inwards = -now.place[:, 0] / 8.0
        assert float(now.accel[:, 0] @ inwards) == pytest.approx(2.0, rel=0.1)
        assert largest(now.velocity) == pytest.approx(4.0)


def test_end_of_a_path_has_no_acceleration_peak() -> None:
    world = World()
    row = npc(world, path=BENT[:2], speed=7.0)
    told = follow(world, np.array([row]), 100)
    assert told[70].velocity[0, 0] == 7.0
    assert not told[72].velocity.any()
    assert not any(now.accel.any() for now in told)


POINTS = st.lists(st.tuples(*[st.floats(-50.0, 50.0, width=32)] * 3), min_size=2, max_size=8, unique=True)


@given(points=POINTS, is_loop=st.booleans(), speed=st.floats(0.0, 30.0))
@example(points=[(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)], is_loop=True, speed=1.0)  # a slope ends
def test_accelerations_on_any_path_are_differences_of_velocities(
    points: list[tuple[float, float, float]],
    is_loop: bool,  # noqa: FBT001 - a parameter of a test
    speed: float,
) -> None:
    world = World()
    path = np.array(points)
    if np.sqrt(np.square(np.diff(path, axis=0)).sum(axis=1)).sum() < 1.0:
        return
    x, y, z = points[0]
    row = npc(world, x=x, y=y, z=z, path=path, is_loop=is_loop, speed=speed)
    told = follow(world, np.array([row]), 40)
    check_accelerations([now for now in told if now.speed[0] > 0.0])
    for now in told:
        assert largest(now.velocity) <= speed + 1e-9


def test_tiny_loop_has_a_direction() -> None:
    world = World()
    row = npc(world, path=CIRCLE / 80.0, is_loop=True, speed=0.5)  # 0.6 m round
    told = follow(world, np.array([row]), 100)
    check_accelerations(told)
    for now in told:
        assert largest(now.velocity) == pytest.approx(0.5)
        assert abs(float(now.velocity[:, 0] @ now.place[:, 0])) < 0.01  # across the radius


# All others


def test_straight_constant_motion_is_exact() -> None:
    world = World()
    npc(world, yaw=0.7, speed=12.0)
    npc(world, y=9.0, yaw=-2.0, speed=-3.0)
    step(world)
    assert motion(world, np.array([0, 1])).tolist() == [[12.0, -3.0], *[[0.0, 0.0]] * 5]


def test_motion_of_an_ego_equals_its_own_status() -> None:
    world = World()
    row = npc(world, kind=Kind.EGO)
    command(world, row, mode=Mode.SPEED, speed=8.0, steer=0.2)
    told = follow(world, np.array([row]), 400)
    for before, now in pairwise(told[200:]):
        # Its figures are those at the end of the step, the difference is that of its middle.
        assert largest(now.accel - (now.velocity - before.velocity) / DT) < 0.1
        middle = (now.velocity + before.velocity) / 2.0
        assert largest(middle - (now.place - before.place) / DT) < 1e-3
    assert motion(world, np.array([row]))[:, 0].tolist() == [
        *(world.speed[row], 0.0, 0.0),
        *(world.accel[row], world.lateral_accel[row], 0.0),
    ]
    assert world.lateral_accel[row] > 4.0


def test_ghost_keeps_its_given_motion_until_it_is_placed_again() -> None:
    world = World()
    row = npc(world, path=BENT, speed=3.0)
    place_ghost(world, row, x=1.0, y=2.0, z=0.0, yaw=0.5, speed=4.0)
    assert motion(world, np.array([row]))[:, 0].tolist() == [4.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    columns = ("speed", "lateral_speed", "climb", "accel", "lateral_accel", "climb_accel")
    shown = np.arange(1.0, 7.0)
    show_ghosts(world, np.array([row]), columns, shown[:, None])
    step(world)
    assert motion(world, np.array([row]))[:, 0].tolist() == shown.tolist()
    teleport(world, row, x=0.0, y=0.0, z=0.0, yaw=0.0)
    assert not motion(world, np.array([row])).any()


def test_restored_snapshot_has_the_same_motion() -> None:
    world = town()
    follow(world, np.array([0]), 20)
    rows = np.arange(world.n)
    told, saved = motion(world, rows), world.snapshot()
    other = World()
    other.restore(saved)
    assert np.array_equal(motion(other, rows), told)


def test_no_entities_give_no_rows() -> None:
    assert motion(World(), np.array([], dtype=np.int64)).shape == (6, 0)


# Many at once


def test_motion_of_many_rows_of_all_sorts_is_that_of_each_alone() -> None:
    world, rng = (
        world_of(make(a=(arc(0, 0, 12, 0, 90), "b"), b=(line((0, 12), (-20, 12), (-20, -30)), ""))),
        np.random.default_rng(4),
    )
    far = BENT + np.array([50.0, 0.0])
    for i in range(8):
        row = car(world, "ab"[i % 2], 2.0 * i + 1.0, speed=float(rng.choice([0.0, 5.0])))
        world.yaw[row] += 0.05
        world.drift[row], world.drift_rate[row] = rng.choice([0.0, 0.1], 2)
        npc(world, x=50.0, path=far, speed=3.0)
        npc(world, kind=Kind.PEDESTRIAN, body=MAN, x=50.0, path=far, speed=1.5, is_loop=True)
    for _ in range(13):
        step(world)
    rows = rng.permutation(world.n)
    together = motion(world, rows)
    for i, row in enumerate(rows.tolist()):
        assert together[:, i].tolist() == motion(world, np.array([row]))[:, 0].tolist()


def test_driver_that_moves_aslant_of_its_lane_has_a_velocity_to_that_side() -> None:
    world = world_of(make(a=(line((0, 0), (100, 0)), "")))
    row = car(world, "a", 30.0, speed=10.0)
    for drift, rate, slope in [(0.1, 0.0, 0.0), (0.0, 0.0, 0.1), (0.06, 1.0, 0.04), (0.0, 1.0, 0.0)]:
        world.drift[row], world.drift_rate[row], world.wander_slope[row] = drift, rate, slope
        forward, left, _, ahead, aside, _ = motion(world, np.array([row]))[:, 0].tolist()
        angle, before = drift + slope, drift + slope - 0.02 * rate
        assert (forward, left) == (pytest.approx(10.0 * math.cos(angle)), pytest.approx(10.0 * math.sin(angle)))
        assert ahead == pytest.approx(500.0 * (math.cos(angle) - math.cos(before)), abs=1e-6)
        assert aside == pytest.approx(500.0 * (math.sin(angle) - math.sin(before)), abs=1e-6)


def test_direction_in_a_corner_sharper_than_a_right_angle_is_shorter_than_one() -> None:
    world = World()
    back = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 0.5]])
    row = npc(world, path=back, speed=1.0)
    world.arc[row] = 10.0
    world.leg_start[row], world.leg_end[row] = 0.0, 10.0
    forward, left = motion(world, np.array([row]))[:2, 0]
    # Its ends, 1 m before and behind the corner, are 0.05 m from each other: over 0.7 of the span of 2 m.
    assert math.hypot(forward, left) == pytest.approx(0.05 / 1.4, abs=0.01)


@pytest.mark.parametrize("yields", [False, True])
def test_pedestrian_turns_at_a_corner_of_its_path_unless_it_walks_beside_it(*, yields: bool) -> None:
    world = World()
    row = npc(world, kind=Kind.PEDESTRIAN, body=MAN, path=BENT, speed=1.0, yields=yields)
    world.arc[row], world.leg_end[row] = 10.0, 10.0
    npc(world, kind=Kind.OBSTACLE, x=50.0)
    forward, left = motion(world, np.array([row]))[:2, 0]
    assert (forward, left) == ((1.0, 0.0) if yields else (pytest.approx(0.5**0.5), pytest.approx(0.5**0.5)))

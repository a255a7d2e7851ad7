"""Wander within the lane: as much as that of drivers, along the heading, within the borders, and reproducible."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from rosbridge_sim.world.drivers.lane_wander import USUAL_WANDER, LaneWander, _sum_of_waves, _waves_of
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.chance import bell, salt_of
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import BUS, lane_of, world_of
from tests.world.road_factory import CAR, ego, keep_lane, road
from tests.world.wide_roads import wide_road

pytestmark = pytest.mark.usefixtures("loops")

COLUMNS = ("x", "y", "yaw", "speed", "wander", "wander_slope", "wander_x", "wander_y", "wander_y_rate")


def wanderer(
    world: World,
    lane: int,
    s: float,
    *,
    body: Body = CAR,
    speed: float = 15.0,
    wander: float = USUAL_WANDER,
    **more: float,
) -> int:
    row = world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=speed))
    keep_lane(world, row, lane, s, desired_speed=more.get("desired_speed", speed), wander=wander)
    return row


def aims_at(salt: npt.NDArray[np.uint64], frame: int) -> FloatArray:
    """Where drivers aim at in lanes of any width."""
    return _sum_of_waves(*_waves_of(salt), frame)


def places(world: World, row: int, frames: int) -> FloatArray:
    """x, y, yaw and speed of a row after each of some steps."""
    seen = []
    for _ in range(frames):
        step(world)
        assert not len(world.contacts)
        seen.append([float(column[row]) for column in (world.x, world.y, world.yaw, world.speed)])
    return np.array(seen)


def test_aims_have_a_deviation_of_one_and_are_unlike_for_each_driver() -> None:
    salt = salt_of(5, np.arange(1, 41))
    aims = np.array([aims_at(salt, frame) for frame in range(0, 30_000, 100)])
    assert aims.std() == pytest.approx(1.0, abs=0.05)
    assert abs(aims.mean()) < 0.05
    assert np.abs(aims).max() < 2.4
    assert np.abs(np.corrcoef(aims.T) - np.eye(40)).mean() < 0.15


@pytest.mark.slow
def test_position_in_the_lane_wanders_with_its_deviation() -> None:
    world = world_of(road(3000.0))
    rows = [wanderer(world, 0, 60.0 * i) for i in range(30)]
    seen = []
    for frame in range(2500):
        step(world)
        if frame > 500 and frame % 10 == 0:
            seen.append(world.y[rows])
    offsets = np.array(seen)
    assert offsets.std() == pytest.approx(0.13, abs=0.02)
    assert np.abs(offsets).max() < 0.36


def test_wander_is_along_the_heading_and_stops_with_the_vehicle() -> None:
    world = world_of(road())
    ego(world, 220.0, 0.0)
    row = wanderer(world, 0, 100.0)
    seen = places(world, row, 850)
    assert np.abs(seen[:, 1]).max() > 0.05
    moving = np.diff(seen[:, :2], axis=0)
    fast = seen[1:, 3] > 1.0
    slip = np.arctan2(moving[fast, 1], moving[fast, 0]) - seen[1:, 2][fast]
    assert np.abs(slip).max() < 2e-3
    yaw_rate = np.abs(np.diff(seen[:, 2])) / DT
    assert (yaw_rate * seen[1:, 3]).max() < 0.5  # m/s^2
    stands = seen[seen[:, 3] == 0.0]
    assert len(stands) > 100
    assert np.ptp(stands[:, 1]) < 1e-3  # it comes to a stand between two decisions
    assert (stands[-100:] == stands[-1]).all()


@pytest.mark.slow
def test_wide_body_keeps_off_the_borders_of_its_lane() -> None:
    """A bus of 2.49 m in a lane of 3 m has 0.155 m to either side."""
    roads = road(2000.0)
    roads.border[:] = 1.5
    world = world_of(roads)
    row = wanderer(world, 0, 10.0, body=BUS, wander=0.3)
    y = places(world, row, 1200)[:, 1]
    assert 0.1 < np.abs(y).max() < 0.16


def test_lane_change_and_wander_add_up_without_a_jump() -> None:
    world = world_of(wide_road(2))
    ego(world, 150.0, 0.0)
    row = wanderer(world, 0, 20.0, wander=0.3)
    seen = places(world, row, 500)
    assert lane_of(world, row) == "l1"
    assert seen[:, 1].min() < -3.3
    velocity = np.diff(seen[:, 1]) / DT
    assert np.abs(np.diff(velocity)).max() < 0.18  # 1.3 m/s^2 of the change itself, and a little
    assert np.abs(np.diff(seen[:, 2])).max() < 0.01


def test_no_vehicle_jumps_along_its_lane_where_a_change_of_lanes_begins() -> None:
    """The change begins aslant by the wander, and the offset of a lane's width is across the lane all the same."""
    world = world_of(wide_road(2))
    for i in range(4):
        ego(world, 150.0 + 300.0 * i, 0.0)
        wanderer(world, 0, 60.0 + 300.0 * i, wander=0.3)
    rows = np.flatnonzero(world.has_lane)
    changed = 0
    for _ in range(500):
        x, y, speed = world.x[rows], world.y[rows], world.speed[rows]
        leaving = world.leaving[rows]
        step(world)
        way = np.hypot(world.x[rows] - x, world.y[rows] - y)
        assert np.abs(way - 0.5 * (speed + world.speed[rows]) * DT).max() < 1e-3
        changed += int(np.count_nonzero(world.leaving[rows] > leaving))
    assert changed == len(rows)


def test_drivers_without_wander_and_with_an_offset_keep_to_their_line() -> None:
    world = world_of(road())
    rows = [world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=10.0)) for _ in range(2)]
    keep_lane(world, rows[0], 0, 100.0)
    keep_lane(world, rows[1], 0, 200.0, lateral=0.4, wander=0.2)
    for _ in range(200):
        step(world)
    assert world.y[rows].tolist() == [0.0, 0.4]


def test_snapshot_between_decisions_goes_on_with_the_same_bits() -> None:
    first = world_of(wide_road(2))
    for i in range(4):
        wanderer(first, i % 2, 20.0 + 30.0 * i, desired_speed=8.0 + 4.0 * (3 - i))
    for _ in range(153):
        step(first)
    second = world_of(first.roads)
    second.restore(from_plain(to_plain(first.snapshot()), first.roads, first.signals.plan))
    assert first.digest() == second.digest()
    for frame in range(200):
        step(first)
        step(second)
        if frame == 77:
            second.touch()
    assert first.digest() == second.digest()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        *(("wander_width", -0.1), ("wander_width", 0.31), ("wander", 1e6), ("wander_slope", -1e15)),
        *(("wander_x", np.nan), ("wander_y", 1e300), ("wander_x_rate", np.inf), ("wander_y_rate", 1e5)),
    ],
)
def test_snapshot_with_an_impossible_wander_is_refused(column: str, value: float) -> None:
    world, copy = world_of(road()), World()
    row = wanderer(world, 0, 20.0)
    saved = to_plain(world.snapshot())
    copy.restore(world.snapshot())
    getattr(copy, column)[row] = value
    saved["floats"] = copy.snapshot().floats
    with pytest.raises(ValueError, match="numbers" if np.isnan(value) else column):
        from_plain(saved, world.roads, world.signals.plan)


def test_drivers_wander_alone_as_among_others() -> None:
    """The rows of the second world have gaps, so other ways through the arrays are taken."""
    alone, among = world_of(wide_road()), world_of(wide_road())
    for i in range(4):
        world_row = among.row(among.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=12.0, uid=i + 1))
        keep_lane(among, world_row, i % 3, 50.0 + 200.0 * i, wander=USUAL_WANDER, changes_lanes=False)
        still = among.row(among.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=12.0, uid=i + 50))
        keep_lane(among, still, (i + 1) % 3, 50.0 + 200.0 * i, changes_lanes=False)
    row = alone.row(alone.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=12.0, uid=1))
    keep_lane(alone, row, 0, 50.0, wander=USUAL_WANDER, changes_lanes=False)
    for _ in range(200):
        step(alone)
        step(among)
    assert alone.wander[row] != 0.0
    for column in COLUMNS:
        assert getattr(alone, column)[row] == getattr(among, column)[among.row(1)], column


@pytest.mark.parametrize("wander", [-0.1, 0.31, np.nan])
def test_wander_beyond_its_bounds_is_refused(wander: float) -> None:
    world = world_of(road())
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
    with pytest.raises(ValueError, match="wander"):
        keep_lane(world, row, 0, 5.0, wander=wander)
    assert not world.has_lane[row]


def test_aims_are_three_waves_of_parabolas_with_the_periods_and_phases_of_the_driver() -> None:
    salt = salt_of(3, np.arange(1, 31))
    for frame in (0, 137, 4_001):
        expected = np.zeros(len(salt))
        for i, period in enumerate((11.0, 19.0, 37.0)):
            spread, phase = bell(salt, 64 + 2 * i), 2.0 * bell(salt, 65 + 2 * i)
            turn = np.mod(frame * DT / (period * (1.0 + 0.1 * spread)) + phase, 1.0)
            half = np.mod(turn, 0.5)  # up in the first half of a period, down in the second one
            wave = 16.0 * half * (0.5 - half)
            expected += np.where(turn < 0.5, wave, -wave) * math.sqrt(2.0 / 3.0 * 15.0 / 16.0)
        assert aims_at(salt, frame) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_displacements_until_the_next_decision_follow_the_aim_as_one_by_one(seed: int) -> None:
    rng, world = np.random.default_rng(seed), world_of(wide_road(2))
    rows = []
    for i in range(10):
        body = [CAR, BUS, Body(5.0, 3.4, 3.0)][i % 3]
        rows.append(world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=9.0)))
        width = 0.0 if seed % 2 and i % 4 == 3 else rng.uniform(0.1, 0.3)
        keep_lane(world, rows[-1], i % 2, 50.0 * (i + 1), wander=width)
    at = np.array(rows)
    world.frame = 1_000 + 7 * seed
    for column in ("wander", "wander_slope", "wander_x", "wander_y"):
        getattr(world, column)[at] = rng.uniform(-0.3, 0.3, len(at))
    distance, heading = rng.choice([0.0, 1.0, 1.0], len(at)) * rng.uniform(0.1, 3.0, 10), rng.uniform(-3.0, 3.0, 10)
    before, off = heading.copy(), rng.choice(10, 3, replace=False)
    x, y = world.wander_x.copy(), world.wander_y.copy()
    expected = []
    for i, row in enumerate(rows):
        now, slope, way = float(world.wander[row]), float(world.wander_slope[row]), float(distance[i])
        aim = float(world.wander_width[row]) * float(aims_at(world.salts(at[[i]]), world.frame)[0])
        most = max(1.75 - float(world.half_width[row]) - 0.1, 0.0)
        aim = 0.0 if i in off else min(max(aim, -most), most)
        length = max(way / 0.1, 8.0)
        bend = (aim - now) * way / length**2 - 2.0 * slope * way / length
        then = now + way * (slope + 0.5 * bend)
        if not world.wander_width[row]:
            expected.append((now, before[i], 0.0, 0.0, 0.0))
            continue
        moves = float(way > 0.0)
        east, north = -then * math.sin(before[i]) - x[row], then * math.cos(before[i]) - y[row]
        expected.append((then, before[i] + slope + bend, bend / 0.1, moves * east / 0.1, moves * north / 0.1))
    wander = LaneWander(world, at)
    assert wander.which.tolist() == [i for i, row in enumerate(rows) if world.wander_width[row]]
    wander.plan(distance, heading, world.lane[at], off, 0.1)
    columns = (world.wander, world.wander_slope_rate, world.wander_x_rate, world.wander_y_rate)
    found = np.stack([columns[0][at], heading, *(column[at] for column in columns[1:])], axis=-1)
    assert found == pytest.approx(np.array(expected), abs=1e-9)
    place, slope_before = world.x[at].copy(), world.wander_slope[at].copy()
    wander.move(0.02)
    assert world.x[at] - place == pytest.approx(np.where(world.wander_width[at] > 0.0, world.wander_x[at], 0.0))
    assert world.wander_x[at] == pytest.approx(x[at] + 0.02 * world.wander_x_rate[at])
    assert world.wander_slope[at] == pytest.approx(slope_before + 0.02 * world.wander_slope_rate[at])

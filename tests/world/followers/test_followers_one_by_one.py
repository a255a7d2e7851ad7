"""Drivers that pass before people who cross, and the step of a driver along its lanes, in plain numbers."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_model import accelerate
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries
from rosbridge_sim.world.followers.lane_following import LaneFollowers
from rosbridge_sim.world.followers.other_entities import find_passed_first
from rosbridge_sim.world.followers.self_driving import start_self_driving
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Gear, Kind
from tests.world.drivers.random_drivers import situation
from tests.world.lane_changes.test_looks_one_by_one import Scene
from tests.world.lane_drives import world_of
from tests.world.road_factory import CAR, arc, built_in, car, crossing, ego, keep_lane, line, make, road


@pytest.fixture(scope="module")
def town() -> LaneConflicts:
    return LaneConflicts(built_in("town").roads)


def passes_first(roads: Roads, drivers: Drivers, i: int, place: tuple[int, float, float]) -> bool:
    """Whether a driver goes on before somebody who will be on a lane ahead after some time.

    It cannot stop with 4 m/s^2 any more, is not past the place, and will be a metre past it in that time with at least
    2 m/s, or its nose is a metre past it already.

    Args:
        place: lane, place of the tail on it [m], and time until they are in the way [s].
    """
    lane, tail, arrival = place
    speed, ahead = float(drivers.speed[i]), -float(drivers.arc[i] + drivers.nose[i])
    for here in drivers.lanes[:3, i].tolist():
        if here == lane:
            gap = ahead + tail
            rest = gap + float(drivers.length[i])
            is_past_in_time = rest + 1.0 < arrival * max(speed, 2.0) or gap < -1.0
            if gap < speed**2 / 8.0 and rest > 0.0 and is_past_in_time:
                return True
        ahead += float(roads.length[here]) if here >= 0 else 0.0
    return False


@pytest.mark.parametrize("seed", range(40))
def test_people_who_come_after_a_driver_has_passed_are_those_of_one_by_one(seed: int, town: LaneConflicts) -> None:
    rng, num = np.random.default_rng(seed), 30
    drivers = situation(town, seed).drivers
    drivers.speed[:] = rng.choice([0.0, 1.0, 1.0], len(drivers.arc)) * rng.uniform(0.0, 15.0, len(drivers.arc))
    who, part = rng.integers(0, len(drivers.arc), num), rng.integers(0, 4, num)
    lane = drivers.lanes[part, who]
    lane = np.where(lane < 0, drivers.lanes[0, who], lane)
    near = drivers.arc[who] + drivers.nose[who] + rng.uniform(-8.0, 12.0, num)
    tail = np.where(part == 0, near, rng.uniform(0.0, 20.0, num))
    arrival, zero = rng.choice([0.0, 1.0, 4.0], num) * rng.uniform(0.5, 1.5, num), np.zeros(num)
    source, stands = np.full(num, -1), np.zeros(num, dtype=np.bool_)
    entries = Entries(lane, tail + 0.3, tail, zero, zero, source, stands)
    expected = [
        any(passes_first(town.roads, drivers, i, place) for i in range(len(drivers.arc)))
        for place in zip(lane.tolist(), tail.tolist(), arrival.tolist(), strict=True)
    ]
    assert find_passed_first(town.roads, drivers, entries, arrival).tolist() == expected
    assert any(expected)


@pytest.mark.parametrize(
    ("speed", "accel", "after", "way", "told"),
    [
        (10.0, -2.0, 9.96, 0.1996, -2.0),
        (10.0, 1.5, 10.03, 0.2003, 1.5),
        (0.01, -2.0, 0.0, 0.0001, -0.5),  # it comes to a stand within the step
        (0.0, 0.0, 0.0, 0.0, 0.0),
    ],
)
def test_step_moves_a_driver_by_its_mean_speed_and_not_backwards(
    speed: float, accel: float, after: float, way: float, told: float
) -> None:
    world = world_of(road())
    row = car(world, "a", 50.0, speed=speed)
    world.accel[row], world.yaw[row], world.yaw_rate[row] = accel, 3.14, 1.0
    LaneFollowers(world).move(0.02)
    assert (world.speed[row], world.accel[row]) == (pytest.approx(after), pytest.approx(told))
    assert (world.arc[row], world.x[row], world.y[row]) == (pytest.approx(50.0 + way), pytest.approx(50.0 + way), 0.0)
    assert world.yaw[row] == pytest.approx(3.16 - 2.0 * np.pi)


def test_driver_that_comes_to_the_next_lane_is_on_it_with_one_more_lane_ahead() -> None:
    world = world_of(
        make(
            **{
                name: (line((40.0 * i, 0), (40.0 * i + 40.0, 0)), "bcdefgh "[i].strip())
                for i, name in enumerate("abcdefgh")
            }
        )
    )
    row = car(world, "a", 39.9, speed=10.0)
    assert (world.turns[row], world.behind[row], world.ahead_5[row]) == (0, -1, 5)
    LaneFollowers(world).move(0.02)
    assert (world.lane[row], world.behind[row], world.ahead_1[row], world.ahead_5[row]) == (1, 0, 2, 6)
    assert (world.turns[row], world.arc[row]) == (1, pytest.approx(0.1))
    assert (world.x[row], world.leg_start[row], world.leg_end[row]) == (pytest.approx(40.1), 0.0, 40.0)


def test_driver_at_a_dead_end_stands_at_it() -> None:
    world = world_of(road(100.0))
    row = car(world, "a", 99.9, speed=10.0)
    world.accel[row] = 1.0
    LaneFollowers(world).move(0.02)
    assert (world.speed[row], world.accel[row]) == (0.0, 0.0)
    assert world.arc[row] == np.nextafter(100.0, 0.0)


def test_driver_that_enters_a_lane_which_it_has_claimed_holds_it() -> None:
    world = world_of(crossing())
    row = car(world, "w", 189.9, speed=10.0)
    world.claim[row] = world.ahead_1[row]
    LaneFollowers(world).move(0.02)
    assert (world.held[row], world.claim[row]) == (world.lane[row], -1)


@pytest.mark.parametrize(("speed", "accel", "way"), [(0.05, -2.0, 0.000625), (6.0, 1.0, 0.605), (0.0, 0.0, 0.0)])
def test_driver_turns_by_the_way_up_to_the_next_decision_or_to_its_stand(
    speed: float, accel: float, way: float
) -> None:
    world = world_of(make(a=(arc(0, 0, 30, 0, 180), "b"), b=(arc(0, 0, 30, 180, 180), "a")))
    row = car(world, "a", 50.0, speed=speed)
    world.accel[row] = accel
    followers = LaneFollowers(world)
    followers._steer(followers.drivers().lanes, world.speed[[row]], world.accel[[row]])
    assert world.yaw_rate[row] == pytest.approx(way / 30.0 / 0.1, rel=0.02)
    assert world.lateral_accel[row] == pytest.approx(world.yaw_rate[row] * speed)


@pytest.mark.parametrize("num_between", [0, 1, 2])
def test_decision_brings_accelerations_nearer_to_what_drivers_want_by_their_reaction(num_between: int) -> None:
    world, rng = world_of(road()), np.random.default_rng(1)
    for i in range(6):
        for k in range(num_between if i == 3 else 0):
            world.spawn(Kind.OBSTACLE, CAR, name="box", x=300.0 + 20.0 * k, y=40.0)
        row = car(world, "a", 60.0 * i + 30.0, speed=float(rng.uniform(0.0, 14.0)))
        world.accel[row] = rng.uniform(-2.0, 2.0)
    world.frame = 5
    followers = LaneFollowers(world)
    scene, before = Scene(world), world.accel[followers.rows].copy()
    wanted = accelerate(scene.drivers.speed, scene.perception, scene.drivers.parameters)
    followers.decide()
    reached = 1.0 - np.exp(-0.1 / scene.drivers.parameters.reaction)
    assert world.accel[followers.rows] == pytest.approx(before + reached * (wanted - before))


def test_self_driving_ego_decides_where_it_is_and_has_its_pedals_follow_at_once() -> None:
    world = world_of(make(a=(line((0, 0), (100, 0)), "b"), b=(line((100, 0), (300, 0)), "")))
    rows = [ego(world, x, 0.4, speed=5.0) for x in (40.0, 90.0, 150.0)]
    for row in rows:
        world.gear[row] = Gear.DRIVE
        assert start_self_driving(world, row)
    world.x[rows], world.accel[rows] = [42.5, 103.0, 149.0], 0.3  # where their tyres have brought them
    world.frame = 5
    LaneFollowers(world).decide()
    assert world.lane[rows].tolist() == [0, 1, 1]
    assert world.arc[rows] == pytest.approx([42.5, 3.0, 49.0])
    wanted = world.accel[rows].copy()
    assert world.accel_cmd[rows].tolist() == wanted.tolist()
    assert not np.isin(wanted, 0.3).any()
    # It steers to where its line is 0.4 m to the right, by the bend that leads there.
    assert (world.steer_cmd[rows] < 0.0).all()


def test_driver_before_a_full_street_chooses_other_lanes_once_in_two_seconds() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "b"),
        b=(line((100, 0), (120, 0)), "d"),
        d=(line((120, 0), (220, 0)), ""),
        x=(line((110, -50), (110, 50)), ""),
    )
    for speed, route, gives_up in ((0.0, "", True), (0.0, "a b d", False), (0.2, "", False)):
        world = world_of(roads)
        car(world, "d", 3.0, desired_speed=0.0)
        row = car(world, "a", 95.0, speed=speed, route=route)
        followers, turns = LaneFollowers(world), []
        for decision in range(45):
            world.frame = 5 * decision
            followers.decide()
            turns.append(int(world.turns[row]))
        at = [i for i in range(1, 45) if turns[i] != turns[i - 1]]
        uid = int(world.uid[row])
        assert at == [i for i in range(1, 45) if gives_up and (i + uid) % 20 == 0]
        assert set(np.diff(turns).tolist()) <= {0, 6}


def test_each_driver_is_let_in_for_eight_seconds_of_each_minute_and_neighbours_at_other_times() -> None:
    world = world_of(road())
    for i in range(3):
        car(world, "a", 50.0 * i + 30.0)
    followers, seen = LaneFollowers(world), []
    for decision in range(600):
        world.frame = 5 * decision
        seen.append(followers.drivers().is_let_in.tolist())
    let_in = np.array(seen)
    assert let_in.sum(axis=0).tolist() == [80, 80, 80]
    begins = [np.flatnonzero(column & ~np.roll(column, 1)).tolist() for column in let_in.T]
    assert [len(each) for each in begins] == [1, 1, 1]
    assert len({each[0] for each in begins}) == 3


def test_way_along_a_lane_is_that_of_those_beside_it_and_aslant_of_it() -> None:
    rng, num, dt = np.random.default_rng(2), 40, 0.02
    world = world_of(make(a=(arc(0, 0, 100, 0, 180), "b"), b=(arc(0, 0, 100, 180, 180), "a")))
    for i in range(num):
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=float(rng.uniform(0.0, 20.0))))
        keep_lane(world, row, i % 2, 15.0 * (i // 2) + 5.0, wander=0.2 * (i % 4 == 0))
    for column, most in [
        (world.lateral, 4.0),
        (world.drift, 0.3),
        (world.drift_rate, 1.0),
        (world.wander, 0.3),
        (world.wander_slope, 0.2),
        (world.wander_slope_rate, 1.0),
        (world.yaw_rate, 2.0),
    ]:
        column[:num] = rng.uniform(-most, most, num)
    followers, step = LaneFollowers(world), rng.uniform(0.0, 0.3, num)
    followers.shifted = np.arange(0, num, 2)
    found = followers._along(step[::2], dt)
    for k, row in enumerate(range(0, num, 2)):
        turned = world.drift[row] + world.drift_rate[row] * dt + world.wander_slope[row]
        bend = world.yaw_rate[row] - world.drift_rate[row] - world.wander_slope_rate[row]
        way = float(step[row])
        beside = min(max(float(bend * world.lateral[row]) * dt, -0.5 * way), 0.5 * way)
        assert found[k] == pytest.approx(way * np.cos(turned) + beside)
    wanders = followers.wander.which
    assert wanders.tolist() == list(range(0, num, 4))
    beside_line = followers._way_beside(dt)
    bends = world.yaw_rate - world.drift_rate - world.wander_slope_rate
    assert beside_line[wanders] == pytest.approx((bends * dt * world.wander)[wanders])


def test_driver_that_stands_does_not_turn() -> None:
    world = world_of(road())
    row = car(world, "a", 50.0)
    world.yaw[row] += 0.1
    followers = LaneFollowers(world)
    for accel, turn in ((0.0, 0.0), (-1.0, 0.0), (1.0, -1.0)):
        followers._steer(followers.drivers().lanes, np.array([0.0]), np.array([accel]))
        assert (world.yaw_rate[row], world.lateral_accel[row]) == (pytest.approx(turn), 0.0)

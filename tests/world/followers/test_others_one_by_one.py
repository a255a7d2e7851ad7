"""What drivers see of those that follow no lanes, box by box in plain Python: people who cross, egos, things."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
import pytest

from rosbridge_sim.world.drivers.lane_entries import Drivers
from rosbridge_sim.world.followers.lane_following import LaneFollowers
from rosbridge_sim.world.people.people import COMMITTED, find_ways_over
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.followers.test_followers_one_by_one import passes_first
from tests.world.people.test_crossing_one_by_one import APART, NUM, people_at_the_road, street
from tests.world.people.test_walking_one_by_one import MAN
from tests.world.road_factory import CAR, car

LANES = {0: (0.0, False), 1: (3.5, False), 2: (10.0, True)}
"""How far to the north each lane of the street is [m], and whether it leads back to the west."""


@pytest.fixture(scope="module")
def roads() -> tuple[Roads, SignalPlan]:
    return street()


@dataclass(order=True)
class Entry:
    """An entry of a box, with its row, whether it drives, and when it will be in the way."""

    row: int
    lane: int
    s: float
    tail: float
    speed: float
    accel: float
    stands: bool
    arrival: float = 0.0


def busy_street(roads: tuple[Roads, SignalPlan], seed: int) -> World:
    """People at a road and vehicles, and more of all kinds on the road, some of them moving."""
    world, rows = people_at_the_road(roads, seed)
    rng = np.random.default_rng(seed + 1000)
    kinds = [(Kind.PEDESTRIAN, MAN), (Kind.OBSTACLE, Body.box(1.0, 3.0, 1.0)), (Kind.VEHICLE, CAR), (Kind.EGO, CAR)]
    for _ in range(24):
        kind, body = kinds[int(rng.integers(0, 4))]
        x, y, yaw = rng.uniform(20.0, APART * NUM - 20.0), rng.uniform(-9.0, 18.0), rng.uniform(-3.1, 3.1)
        row = world.row(world.spawn(kind, body, name="one", x=x, y=y, yaw=yaw))
        world.speed[row] = rng.choice([0.0, -0.6, 1.0]) * rng.uniform(0.3, 3.0)
        world.accel[row] = rng.uniform(-2.0, 2.0)
        world.loose[row] = rng.choice([0.0, 2.0])
    for row in rows:
        if rng.random() < 0.3:  # almost on the other side
            world.arc[row] += 0.9 * find_ways_over(world)[0][row] * max(world.speed[row], 0.5)
        if world.yields[row] >= COMMITTED:  # one that is about to be passed, or has been
            near = world.x[row] - CAR.length + rng.uniform(-14.0, 6.0)
            car(world, str(rng.choice(["a", "b"])), near, speed=float(rng.choice([0.0, 4.0, 14.0])))
    world.touch()
    return world


def boxes_of(world: World, row: int) -> list[tuple[complex, complex, float, float, float]]:
    """Where a row is now and later: its middle, heading and speed, for how long that is looked at, and from when on."""
    heading, speed = cmath.rect(1.0, float(world.yaw[row])), float(world.speed[row])
    place = complex(world.x[row], world.y[row])
    if world.kind[row] != Kind.PEDESTRIAN or world.yields[row] <= 1:
        is_blind = world.kind[row] == Kind.PEDESTRIAN and world.yields[row] == 0
        return [(place + float(world.centre[row]) * heading, heading, speed, 3.0 if is_blind else 0.0, 0.0)]
    times, velocities = find_ways_over(world)
    time = min(float(times[row]), 12.0)
    if time > 0.0:
        speed = abs(velocities[row])
        heading = complex(velocities[row]) / speed
    since = [3.0 * k for k in range(4) if k == 0 or time > 3.0 * k]
    return [(place + then * speed * heading, heading, speed, min(time - then, 3.0), then) for then in since]


def entries_of(world: World, row: int) -> list[Entry]:
    """All entries of a row: where it is, or will be soon, within 1.4 m of the line of a lane."""
    found = []
    half_length, half_width = float(world.half_length[row]), float(world.half_width[row])
    stands = bool(world.kind[row] != Kind.PEDESTRIAN and abs(world.speed[row]) < 0.5)
    for place, heading, speed, time, since in boxes_of(world, row):
        for lane, (north, is_back) in LANES.items():
            turn = -1.0 if is_back else 1.0
            local, to = turn * (place - 1j * north), turn * heading
            s = local.real + (APART * NUM if is_back else 0.0)
            across = abs(to.imag) * half_length + abs(to.real) * half_width + 1.4
            there = local.imag + to.imag * speed * time
            if min(local.imag, there) < across and max(local.imag, there) > -across:
                tail = s - abs(to.real) * half_length - abs(to.imag) * half_width
                arrival = since + max(abs(local.imag) - across, 0.0) / max(abs(to.imag * speed), 0.01)
                accel = float(world.accel[row]) * to.real
                found.append(Entry(row, lane, s, tail, max(to.real * speed, 0.0), accel, stands, arrival))
    return found


def seen_one_by_one(world: World, drivers: Drivers) -> tuple[list[Entry], list[Entry]]:
    """The entries of vehicles that drive, and those of all others."""
    driving: list[Entry] = []
    rest: list[Entry] = []
    for row in range(world.n):
        if not world.alive[row] or (world.has_lane[row] and world.start_within[row] == 0.0):
            continue
        on_wheels = world.kind[row] in {Kind.EGO, Kind.VEHICLE}
        for entry in entries_of(world, row):
            place = (entry.lane, entry.tail, entry.arrival)
            crosses = world.yields[row] >= COMMITTED
            if crosses and any(passes_first(world.roads, drivers, i, place) for i in range(len(drivers.arc))):
                continue
            (driving if on_wheels and abs(world.speed[row]) > 0.5 else rest).append(entry)
    return sorted(driving), sorted(rest)


@pytest.mark.parametrize("seed", range(6))
def test_drivers_see_those_without_lanes_where_they_are_or_will_soon_be(
    seed: int, roads: tuple[Roads, SignalPlan]
) -> None:
    world = busy_street(roads, seed)
    followers = LaneFollowers(world)
    may_move = (world.kind == Kind.EGO) | (world.speed != 0.0) | (world.loose > 0.0) | (world.yields > 0)
    world.x[may_move & ~world.has_lane] += 3.0  # since the drivers came, whatever can move has moved
    world.speed[(world.kind == Kind.EGO) & (world.speed == 0.0)] = 0.7
    drivers = followers.drivers()
    found, rows, num_driving = followers.others(lambda: drivers)
    columns = (rows, found.lane, found.s, found.tail, found.speed, found.accel, found.stands)
    told = [Entry(*values) for values in zip(*(column.tolist() for column in columns), strict=True)]
    for seen, expected in zip((told[:num_driving], told[num_driving:]), seen_one_by_one(world, drivers), strict=True):
        both = [[(each.row, each.lane, each.stands) for each in entries] for entries in (sorted(seen), expected)]
        assert both[0] == both[1]
        figures = [
            np.array([(each.s, each.tail, each.speed, each.accel) for each in entries])
            for entries in (sorted(seen), expected)
        ]
        assert figures[0] == pytest.approx(figures[1], abs=1e-9)
        assert len(seen)
    assert set(found.source.tolist()) == {-1}


def test_those_that_stand_are_seen_anew_as_soon_as_one_moves() -> None:
    world = World()
    world.lay_roads(*street())
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=50.0, y=0.0))
    car(world, "a", 10.0, speed=5.0)
    followers = LaneFollowers(world)
    drivers = followers.drivers()
    first, again = (followers.others(lambda: drivers)[0] for _ in range(2))
    assert first.s.tolist() == again.s.tolist() == pytest.approx([50.0 + CAR.centre])
    for column, change in ((world.x, 2.0), (world.yaw, 0.3), (world.speed, 1.0), (world.accel, 1.0)):
        column[row] += change
        seen, fresh = followers.others(lambda: drivers)[0], LaneFollowers(world).others(lambda: drivers)[0]
        for name in ("lane", "s", "tail", "speed", "accel", "stands"):
            assert getattr(seen, name).tobytes() == getattr(fresh, name).tobytes()
    assert seen.accel.tolist() != first.accel.tolist()


def test_people_far_from_all_lanes_are_left_out_until_they_come_near() -> None:
    rng = np.random.default_rng(0)
    world = World()
    world.lay_roads(*street())
    car(world, "a", 10.0, speed=5.0)
    rows = [world.row(world.spawn(Kind.PEDESTRIAN, MAN, name="p", x=20.0, y=-6.0)) for _ in range(8)]
    world.yields[rows] = 1
    followers, num_far = LaneFollowers(world), 0
    drivers = followers.drivers()
    for i in range(100):
        world.x[rows] += rng.uniform(-0.5, 0.5, len(rows))
        world.y[rows] = np.clip(world.y[rows] + rng.uniform(-0.5, 0.5, len(rows)), -9.0, 0.0)
        if i % 25 == 24:
            world.y[rows[i % 8]] = 0.0  # placed on the lane
        found, fresh = followers.others(lambda: drivers), LaneFollowers(world).others(lambda: drivers)
        num_far += int(np.count_nonzero(followers.other_entities._bodies.find_far()))
        assert found[1].tobytes() == fresh[1].tobytes()
        for name in ("lane", "s", "tail", "speed", "accel", "stands"):
            assert getattr(found[0], name).tobytes() == getattr(fresh[0], name).tobytes()
    assert 100 < num_far < 700


@pytest.mark.parametrize(("num", "are_left_out"), [(64, True), (65, False)])
def test_all_of_a_crowd_are_looked_for_on_lanes(num: int, *, are_left_out: bool) -> None:
    world = World()
    world.lay_roads(*street())
    car(world, "a", 10.0, speed=5.0)
    rows = [world.row(world.spawn(Kind.PEDESTRIAN, MAN, name="p", x=20.0, y=-9.0)) for _ in range(num)]
    world.yields[rows] = 1
    bodies = LaneFollowers(world).other_entities._bodies
    assert not bodies.find_far().any()  # nobody has been looked for yet
    world.x[rows] += 1.0
    assert bodies.find_far().all() == are_left_out
    assert bodies.find_far().any() == are_left_out

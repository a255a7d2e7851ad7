"""Joins: two lanes that become one at a small angle; drivers zip together and nobody waits for the right of way."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.drivers.lane_entries import Drivers, Entries
from rosbridge_sim.world.drivers.zip_merge import _keys, follow_in_joins
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.lane_joins import MAX_ANGLE
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import run, world_of
from tests.world.road_factory import car, ego, line, make

pytestmark = pytest.mark.usefixtures("loops")


def entry(angle_deg: float = 4.0, limit: float = 30.0) -> Roads:
    """`main` and `ramp` become `on` at x = 0."""
    angle = math.radians(angle_deg)
    steps = np.arange(-700.0, 5.0, 5.0)
    return make(
        main=(line(*[(x, 0.0) for x in steps]), "on", limit),
        ramp=(line(*[(x * math.cos(angle), x * math.sin(angle)) for x in steps]), "on", limit),
        on=(line(*[(x, 0.0) for x in np.arange(0.0, 1505.0, 5.0)]), "", limit),
    )


def two_streams(num: int = 8, speed: float = 25.0) -> tuple[World, list[int]]:
    """Cars side by side on both lanes."""
    world = world_of(entry())
    places = [(name, 450.0 - 40.0 * i) for i in range(num) for name in ("main", "ramp")]
    return world, [car(world, name, s, speed=speed, desired_speed=28.0) for name, s in places]


def test_lanes_that_meet_at_a_small_angle_are_a_join_and_no_rivals() -> None:
    network = LaneConflicts(entry())
    assert network.joins.lanes.tolist() == [[0, 1]]
    assert not len(network.rivals.other)
    assert network.joins.to_join.tolist() == [0.0, 0.0, 0.0]
    (shared,) = network.joins.shared
    assert shared == pytest.approx(2.4 / math.tan(math.radians(4.0)), abs=1.5)


def test_lanes_that_meet_at_a_great_angle_keep_the_right_of_way() -> None:
    network = LaneConflicts(entry(math.degrees(MAX_ANGLE) + 3.0))
    assert not len(network.joins.lanes)
    assert len(network.rivals.other) == 2


def test_lane_behind_a_stop_line_keeps_the_right_of_way() -> None:
    roads = entry()
    before = make(
        main=(roads.points[: roads.first[1]], "on", 30.0),
        lead=(line((-750, -52.4), (-699.0, -48.9)), "ramp", 30.0),
        ramp=(roads.points[roads.first[1] : roads.first[2]], "on", 30.0),
        on=(roads.points[roads.first[2] :], "", 30.0),
    )
    before.is_stop[1] = True
    assert not len(LaneConflicts(before).joins.lanes)


@pytest.mark.slow
def test_two_streams_zip_together_without_hard_braking() -> None:
    world, rows = two_streams()
    hardest, slowest = 0.0, np.inf
    for _ in range(1500):
        step(world)
        assert not len(world.contacts)
        hardest, slowest = min(hardest, world.accel[rows].min()), min(slowest, world.speed[rows].min())
    assert (world.x[rows] > 100.0).all()
    assert hardest > -4.5
    assert slowest > 8.0
    order = np.argsort(-world.x[rows])
    sides = [int(rows_index) % 2 for rows_index in order]
    assert all(sides[i] != sides[i + 1] for i in range(0, len(sides) - 1, 2))  # one from here, one from there


def test_driver_lets_in_an_ego_that_is_ahead_on_the_other_lane() -> None:
    world = world_of(entry())
    angle = math.radians(4.0)
    ego(world, -120.0 * math.cos(angle), -120.0 * math.sin(angle), yaw=angle, speed=10.0)
    row = car(world, "main", 560.0, speed=20.0, desired_speed=25.0)
    run(world, 0.6)
    assert world.accel[row] < -0.5
    alone = world_of(entry())
    row = car(alone, "main", 560.0, speed=20.0, desired_speed=25.0)
    run(alone, 0.6)
    assert alone.accel[row] > 0.0


def two_entries() -> LaneConflicts:
    """Two joins far from each other; the main lane of the first has another one before it."""
    steps = np.arange(-200.0, 5.0, 5.0)
    lanes = {"far": (line(*[(x, 0.0) for x in np.arange(-400.0, -195.0, 5.0)]), "main")}
    for name, north in (("", 0.0), ("2", 900.0)):
        lanes[f"main{name}"] = line(*[(x, north) for x in steps]), f"on{name}"
        lanes[f"ramp{name}"] = line(*[(x, north + 0.07 * x) for x in steps]), f"on{name}"
        lanes[f"on{name}"] = line((0, north), (300, north)), ""
    return LaneConflicts(make(**lanes))


def before_joins(conflicts: LaneConflicts, seed: int, num: int = 14) -> tuple[Drivers, Entries]:
    """Drivers and others on all lanes."""
    rng, roads = np.random.default_rng(seed), conflicts.roads
    lane, other_lane = rng.integers(0, len(roads), num), rng.integers(0, len(roads), 4)
    length, nothing = rng.choice([4.5, 11.0], num), np.full(num, -1)
    arc, s = roads.length[lane] * rng.random(num), roads.length[other_lane] * rng.random(4)
    figures = {each.name: rng.uniform(0.8, 2.0, num) for each in fields(DriverParameters)}
    speed, no = rng.uniform(0.0, 30.0, num), np.zeros(num, dtype=np.bool_)
    drivers = Drivers(
        lanes=np.stack([lane, *[nothing] * 5]),
        arc=arc,
        speed=speed,
        accel=np.zeros(num),
        point=np.zeros(num, dtype=np.int64),
        nose=0.8 * length,
        rear=0.2 * length,
        length=length,
        uid=np.arange(num),
        claim=nothing,
        held=nothing,
        exit_lane=nothing,
        is_let_in=no,
        parameters=DriverParameters(**figures),
        lateral=np.full(num, 2.5),
    )
    source = np.array([-1, -1, -1, 0])  # the last one is of a driver that changes lanes
    others = Entries(
        other_lane, s, s - 2.0, rng.uniform(0.0, 20.0, 4), np.zeros(4), source, np.zeros(4, dtype=np.bool_)
    )
    return drivers, others


def zip_one_by_one(conflicts: LaneConflicts, drivers: Drivers, others: Entries, i: int, accel: float) -> float:
    """The acceleration of one driver behind the one on the other lane that will be at the join just before it."""
    joins, length = conflicts.joins, conflicts.roads.length
    join, side = (int(each[drivers.lanes[0, i]]) for each in (joins.join, joins.side))
    if join < 0:
        return accel

    def to_join(lane: int, s: float) -> float:
        return float(joins.to_join[lane] + length[lane]) - s

    mine = to_join(int(drivers.lanes[0, i]), float(drivers.arc[i] + drivers.nose[i]))
    theirs = []
    for k, lane in enumerate(drivers.lanes[0].tolist()):
        places = float(drivers.arc[k] + drivers.nose[k]), float(drivers.arc[k] - drivers.rear[k])
        theirs.append((lane, *places, float(drivers.speed[k])))
    for k in (others.source < 0).nonzero()[0].tolist():
        tail = float(others.tail[k])
        theirs.append((int(others.lane[k]), 2.0 * float(others.s[k]) - tail, tail, float(others.speed[k])))
    before = [
        (to_join(lane, nose), to_join(lane, tail), speed)
        for lane, nose, tail, speed in theirs
        if joins.join[lane] == join and joins.side[lane] != side and to_join(lane, nose) < mine
    ]
    if not before:
        return accel
    _, tail, speed = max(before)
    to_narrow = mine - float(joins.shared[join])
    gap = max(mine - tail + 0.2 * max(to_narrow, 0.0), 0.1)
    own, (a, b, headway) = (
        float(drivers.speed[i]),
        (float(each[i]) for each in (drivers.parameters.accel, drivers.parameters.comfort, drivers.parameters.headway)),
    )
    wanted = 2.5 + max(own * (headway + (own - speed) / (2.0 * math.sqrt(a * b))), 0.0)
    braked = a * (1.0 - (wanted / gap) ** (2 if wanted > gap else 4))
    return min(accel, max(braked, -4.0 if to_narrow > 0.0 else -8.0))


@pytest.mark.parametrize("seed", range(25))
def test_drivers_follow_those_who_will_be_at_the_join_before_them_as_one_by_one(seed: int) -> None:
    conflicts = two_entries()
    assert len(conflicts.joins.lanes) == 2
    drivers, others = before_joins(conflicts, seed)
    accel = np.random.default_rng(seed).uniform(-9.0, 2.0, len(drivers.arc))
    expected = [zip_one_by_one(conflicts, drivers, others, i, value) for i, value in enumerate(accel.tolist())]
    found = follow_in_joins(conflicts, drivers, others, accel)
    assert found == pytest.approx(np.array(expected))


def test_driver_at_the_same_distance_as_one_on_the_other_lane_follows_it_on_one_side_alone() -> None:
    conflicts = two_entries()
    drivers, _ = before_joins(conflicts, 0, 2)
    drivers.lanes[0] = [conflicts.roads.row("main"), conflicts.roads.row("ramp")]
    drivers.arc[:] = conflicts.roads.length[drivers.lanes[0]] - 60.0
    drivers.nose[:], drivers.rear[:], drivers.speed[:] = 4.0, 1.0, 20.0
    none = np.zeros(0)
    no_lane = np.zeros(0, dtype=np.int64)
    others = Entries(no_lane, none, none, none, none, no_lane, no_lane == 0)
    found = follow_in_joins(conflicts, drivers, others, np.ones(2))
    assert sorted((found < 1.0).tolist()) == [False, True]


def test_keys_of_many_worlds_put_one_world_behind_the_other_each_in_its_order() -> None:
    """Two joins in a map, so those of the second world are 2 and 3."""
    join, distance = np.array([1, 0, 3, 2, 1, 2]), np.array([90.0, 5.0, 4.0, 1.0, 40.0, 2.0])
    order = np.lexsort((distance, join))
    assert (np.diff(_keys(join, distance, 2)[order]) > 0).all()
    assert (np.diff(_keys(join, distance, 0)[order]) > 0).all()

"""Joins: two lanes that become one at a small angle; drivers zip together and nobody waits for the right of way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.lane_joins import MAX_ANGLE
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import run, world_of
from tests.world.road_factory import car, ego, line, make


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

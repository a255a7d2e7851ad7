"""Vehicles that are put onto lanes, and those that leave them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.world.drivers.lane_position import (
    MAX_LATERAL,
    MAX_WANDER,
    LaneStart,
    enter_next_legs,
    find_ahead,
    headings,
    headings_ahead,
    keep_lanes,
    leave_lane,
    set_legs,
)
from rosbridge_sim.world.geometry.planar import wrap_angle
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Kind, World
from tests.world.lane_drives import lane_of, run, world_of
from tests.world.road_factory import CAR, built_in, car, crossing, ego, keep_lane, line, make, ring, road


@pytest.mark.parametrize(
    ("figures", "message"),
    [
        ({"lane": 5}, "lane: expected 0..4"),
        ({"lane": -1}, "lane: expected 0..4"),
        ({"s": math.nan}, "s and desired_speed"),
        ({"desired_speed": -1.0}, "s and desired_speed"),
        ({"desired_speed": math.nan}, "s and desired_speed"),
        ({"lateral": 1.01 * MAX_LATERAL}, "lateral: expected a number within"),
        ({"lateral": math.nan}, "lateral: expected a number within"),
        ({"wander": 1.01 * MAX_WANDER}, "wander: expected a number within"),
        ({"wander": -0.01}, "wander: expected a number within"),
        ({"start_within": -0.1}, "start_within: expected at least 0 m"),
        ({"start_within": math.inf}, "start_within: expected at least 0 m"),
        ({"route": [1, 3]}, "route: expected to begin with lane 0"),
        ({"route": [0, 1, 2]}, "lane 2 does not follow lane 1"),
        ({"route": [0, 99]}, "lane 99 does not follow lane 0"),
        ({"route": [0, 1], "is_loop": True}, "lane 0 does not follow lane 1"),
    ],
)
def test_invalid_argument_is_refused_and_changes_nothing(figures: dict[str, Any], message: str) -> None:
    world = world_of(ring())
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=3.0, y=4.0, speed=5.0))
    before = world.digest()
    with pytest.raises(ValueError, match=message):
        keep_lane(world, row, **({"lane": 0, "s": 1.0} | figures))
    assert world.digest() == before


def test_only_vehicles_follow_lanes() -> None:
    world = world_of(ring())
    with pytest.raises(ValueError, match="expected a vehicle"):
        keep_lane(world, ego(world, 0.0, 0.0), 0, 1.0)
    empty = World()
    empty.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0)
    with pytest.raises(ValueError, match="lane: expected"):
        keep_lane(empty, 0, 0, 0.0)


def test_teleported_vehicle_has_left_its_lane() -> None:
    world = world_of(ring())
    row = car(world, "a", 1.0, speed=5.0, route="a b")
    run(world, 1.0)
    teleport(world, row, x=500.0, y=500.0, z=0.0, yaw=0.0, speed=2.0)
    run(world, 1.0)
    assert (bool(world.has_lane[row]), world.routes) == (False, {})
    assert world.x[row] == pytest.approx(502.0)


def test_vehicles_stop_when_the_roads_are_replaced() -> None:
    world = world_of(ring())
    row = car(world, "a", 1.0, speed=5.0)
    run(world, 1.0)
    x = float(world.x[row])
    world.lay_roads(road())
    run(world, 1.0)
    assert (float(world.x[row]), float(world.speed[row]), bool(world.has_lane[row])) == (x, 0.0, False)
    with pytest.raises(ValueError, match="the plan is for"):
        world.lay_roads(ring(), SignalPlan(road()))


def test_reused_row_has_no_old_lane() -> None:
    world = world_of(ring())
    car(world, "a", 30.0)
    row = car(world, "a", 1.0, route="a b")
    world.remove(int(world.uid[row]))
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="other", x=9.0, y=9.0, speed=1.0))
    run(world, 1.0)
    assert (bool(world.has_lane[row]), world.routes) == (False, {})
    assert world.x[row] == pytest.approx(10.0)


def test_vehicle_passes_very_short_lanes() -> None:
    snippets = {f"l{i}": (line((0.01 * i, 0), (0.01 * i + 0.01, 0)), f"l{i + 1}") for i in range(200)}
    world = world_of(make(**snippets, l200=(line((2, 0), (300, 0)), "")))
    row = car(world, "l0", 0.0, speed=10.0)
    run(world, 20.0)
    assert lane_of(world, row) == "l200"


def test_many_vehicles_put_onto_lanes_at_once_are_as_one_by_one() -> None:
    worlds = World(seed=4), World(seed=4)
    starts = [("w", 10.0, ""), ("s", 195.0, "s sn n"), ("we", 15.0, ""), ("e", 500.0, "")]
    for world in worlds:
        world.lay_roads(crossing())
        for _ in starts:
            world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=3.0)
    one, many = worlds
    batch = []
    for row, (lane, s, route) in enumerate(starts):
        lanes = tuple(one.roads.row(name) for name in route.split())
        keep_lane(one, row, one.roads.row(lane), s, desired_speed=9.0, route=lanes)
        batch.append(LaneStart(row, one.roads.row(lane), s, 9.0, lanes))
    keep_lanes(many, batch)
    keep_lanes(many, [])
    assert many.digest() == one.digest()


def test_no_vehicle_moves_if_one_of_many_cannot_keep_its_lane() -> None:
    world = World()
    world.lay_roads(crossing())
    rows = [world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0)) for _ in range(2)]
    before = world.digest()
    with pytest.raises(ValueError, match="lane: expected 0"):
        keep_lanes(world, [LaneStart(rows[0], 0, 1.0), LaneStart(rows[1], 99, 1.0)])
    assert world.digest() == before


@pytest.mark.parametrize("name", ["town", "roundabout"])
def test_headings_on_straights_are_those_of_both_axles(name: str) -> None:
    roads = built_in(name).roads
    rng = np.random.default_rng(0)
    lane = rng.integers(len(roads), size=2000)
    following = np.array([(*roads.successors(i).tolist(), -1)[0] for i in lane.tolist()])
    lanes = np.stack([lane, following, *[np.full(len(lane), -1)] * 4])
    arc, wheelbase = rng.random(len(lane)) * roads.length[lane], np.full(len(lane), 2.7)
    point, _ = roads.locate(lane, arc)
    moves = np.ones(len(lane), dtype=bool)
    quick = headings_ahead(roads, lanes, arc, wheelbase, point=point, moves=moves)
    assert np.abs(wrap_angle(quick - headings(roads, lanes, arc, wheelbase))).max() < 1e-9


@pytest.mark.parametrize("together", [True, False])
def test_next_legs_are_those_that_a_search_finds(*, together: bool) -> None:
    world = world_of(make(a=(line(*[(x, 0.1 * x * x) for x in range(0, 31, 2)]), "")))
    conflicts, roads = world.roads.derived(LaneConflicts), world.roads
    rows = np.array([car(world, "a", s, speed=5.0) for s in (1.0, 9.0, 19.0, 25.0)])
    legs = world.block("leg_start", "leg_dz")
    ends = roads.s[world.point[rows] + 2]  # of the legs that follow
    world.arc[rows] = (world.leg_end[rows[0]], np.nextafter(ends[1], 0.0), ends[2], roads.length[0])
    before = legs[:, rows[2:]].tobytes(), world.point[rows[2:]].tolist()
    if together:
        assert enter_next_legs(world, conflicts, rows).tolist() == [2, 3]  # on the second leg, at the end of the lane
    else:
        assert [enter_next_legs(world, conflicts, rows[[i]]).tolist() for i in range(4)] == [[], [], [0], [0]]
    assert (legs[:, rows[2:]].tobytes(), world.point[rows[2:]].tolist()) == before
    entered = legs[:, rows[:2]].tobytes(), world.point[rows[:2]].tolist()
    set_legs(world, conflicts, rows[:2])
    assert (legs[:, rows[:2]].tobytes(), world.point[rows[:2]].tolist()) == entered


@pytest.mark.parametrize(("beyond", "holds"), [(-0.1, False), (0.1, True)])
def test_vehicle_that_is_put_beyond_the_wait_point_holds_its_lane(beyond: float, *, holds: bool) -> None:
    roads = make(
        a=(line(*[(x, 0) for x in range(0, 101, 10)]), "b"),
        b=(line((100, 0), (200, 0)), ""),
        x=(line(*[(50, y) for y in range(-100, 101, 10)]), ""),
    )
    world = world_of(roads)
    wait_point = float(roads.derived(LaneConflicts).wait_point[0])
    assert 25.0 < wait_point < 50.0
    row = car(world, "a", wait_point - (CAR.length - CAR.rear_overhang) + beyond)
    assert (world.held[row], world.exit_lane[row]) == ((0, 1) if holds else (-1, -1))


def test_vehicle_with_an_offset_is_to_the_left_of_the_line_by_it() -> None:
    world = world_of(make(a=(line((0, 0), (0, 100)), ""), b=(line((100, 0), (200, 0)), "")))
    for lane, place in [(0, (-0.4, 30.0)), (1, (130.0, 0.4))]:
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
        keep_lane(world, row, lane, 30.0, lateral=0.4)
        assert (world.x[row], world.y[row]) == (pytest.approx(place[0]), pytest.approx(place[1]))


def test_vehicle_that_waits_for_an_ego_stands_and_has_its_speed_for_later() -> None:
    world = world_of(road())
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=7.0))
    keep_lane(world, row, 0, 30.0, start_within=25.0)
    assert (world.speed[row], world.start_within[row], world.start_speed[row]) == (0.0, 25.0, 7.0)


def test_vehicle_that_leaves_its_lane_goes_on_as_it_moves() -> None:
    world = world_of(road())
    row = car(world, "a", 30.0, speed=7.0)
    world.y[row], world.yaw[row], world.z[row] = 0.2, 0.1, 0.5
    leave_lane(world, row)
    state = [float(each[row]) for each in (world.x, world.y, world.z, world.yaw, world.speed)]
    assert (world.has_lane[row], state) == (False, [30.0, 0.2, 0.5, 0.1, 7.0])


@pytest.mark.parametrize("changes", [True, False])
def test_vehicle_changes_lanes_and_wanders_only_as_it_was_put_there(*, changes: bool) -> None:
    world = world_of(road())
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
    keep_lane(world, row, 0, 30.0, changes_lanes=changes, wander=0.1 * changes)
    assert (world.keeps_lane[row], world.wander_width[row]) == (not changes, 0.1 * changes)


def test_row_of_a_vehicle_that_is_gone_keeps_to_no_lane() -> None:
    world = world_of(road())
    uid, _ = (world.spawn(Kind.VEHICLE, CAR, name="car", x=x, y=0.0) for x in (0.0, 20.0))
    row = world.row(uid)
    world.remove(uid)
    with pytest.raises(ValueError, match="expected a vehicle in use"):
        keep_lane(world, row, 0, 30.0)


def test_greatest_offset_and_wander_can_be_had() -> None:
    world = world_of(road())
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
    keep_lane(world, row, 0, 30.0, lateral=-MAX_LATERAL, wander=MAX_WANDER)
    assert (world.lateral[row], world.wander_width[row]) == (-MAX_LATERAL, MAX_WANDER)


def test_place_beyond_a_dead_end_stays_on_the_last_lane_and_one_before_it_does_not() -> None:
    roads = make(a=(line((0, 0), (0, 20)), "b"), b=(line((0, 20), (0, 50)), ""))
    lanes = np.full((6, 3), -1)
    lanes[0], lanes[1, :2] = [0, 0, 1], 1
    lane, s = find_ahead(roads, lanes, np.array([15.0, 60.0, 33.0]))
    assert (lane.tolist(), s.tolist()) == ([0, 1, 1], [15.0, 40.0, 33.0])


def test_vehicle_at_a_dead_end_has_the_direction_of_its_lane() -> None:
    world = world_of(make(a=(line((0, 0), (0, 50)), "")))
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
    for s in (50.0, 49.9, 20.0):
        keep_lane(world, row, 0, s)
        assert world.yaw[row] == pytest.approx(0.5 * np.pi)

"""Self-driving egos: on the lane, behind others, and back under command."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_model import GAP
from rosbridge_sim.world.drivers.lane_position import leave_lane
from rosbridge_sim.world.followers.lane_following import DECISION, drive_lanes
from rosbridge_sim.world.followers.self_driving import MAX_LATERAL_OFFSET, change_lane, start_self_driving
from rosbridge_sim.world.roads.lane_change_map import LEFT, RIGHT
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.commands import command, shift
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import DT, Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import CAR, arc, car, ego, line, make, road
from tests.world.wide_roads import wide_road

pytestmark = pytest.mark.usefixtures("loops")

LIMIT = 15.0


def world_of(roads: Roads) -> World:
    world = World()
    world.lay_roads(roads)
    return world


def self_driving_ego(world: World, x: float, y: float = 0.0, *, yaw: float = 0.0) -> int:
    """An ego in D that drives itself; returns the row."""
    row = ego(world, x, y, yaw=yaw)
    assert shift(world, row, Gear.DRIVE)
    assert start_self_driving(world, row)
    return row


def run(world: World, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        step(world)


def test_self_driving_ego_steers_onto_its_lane_and_reaches_the_limit() -> None:
    world = world_of(road(limit=LIMIT))
    row = self_driving_ego(world, 10.0, 1.5, yaw=0.1)
    assert (world.x[row], world.y[row]) == (10.0, 1.5)  # nobody lifts it there
    run(world, 15.0)
    assert world.y[row] == pytest.approx(0.0, abs=0.01)
    assert LIMIT - 0.5 < world.speed[row] <= LIMIT + 0.1


def test_self_driving_ego_keeps_its_lane_in_a_bend() -> None:
    world = world_of(
        make(
            a=(line((0, 0), (50, 0)), "b", LIMIT),
            b=(arc(50, 20, 20.0, -90.0, 90.0), "c", LIMIT),
            c=(line((70, 20), (70, 200)), "", LIMIT),
        )
    )
    row = self_driving_ego(world, 30.0)
    worst = 0.0
    for _ in range(round(12.0 / DT)):
        step(world)
        worst = max(worst, abs(float(world.roads.nearest(world.x[row], world.y[row], world.yaw[row]).lateral[0])))
    assert world.y[row] > 40.0
    assert worst < 0.3


def test_ego_begins_to_drive_itself_between_two_decisions_while_others_are_in_a_bend() -> None:
    world = world_of(
        make(
            a=(line((0, 0), (50, 0)), "b", LIMIT),
            b=(arc(50, 20, 20.0, -90.0, 90.0), "c", LIMIT),
            c=(line((70, 20), (70, 200)), "", LIMIT),
        )
    )
    car(world, "b", 5.0)
    run(world, DECISION * DT)
    step(world)  # the ego's leg is not known until the next decision
    row = self_driving_ego(world, 5.0)
    run(world, (DECISION - 1) * DT)  # a warning of numpy fails the test
    assert world.x[row] == pytest.approx(5.0)


def test_self_driving_ego_keeps_its_gap_to_the_lead_vehicle() -> None:
    world = world_of(road(limit=LIMIT))
    before = car(world, "a", 40.0, desired_speed=0.0)
    row = self_driving_ego(world, 10.0)
    run(world, 12.0)
    assert not len(world.contacts)
    assert world.speed[row] == pytest.approx(0.0, abs=0.01)
    gap = world.x[before] - CAR.rear_overhang - (world.x[row] + CAR.length - CAR.rear_overhang)
    assert gap == pytest.approx(GAP, abs=0.5)


def test_vehicles_keep_their_gap_to_a_self_driving_ego() -> None:
    world = world_of(road(limit=LIMIT))
    row = self_driving_ego(world, 60.0)
    behind = car(world, "a", 40.0, speed=10.0)
    leave_lane(world, row)
    command(world, row, mode=Mode.PEDALS, steer=0.0, brake=1.0)
    assert start_self_driving(world, row)
    world.desired_speed[row] = 5.0
    world.touch()
    run(world, 18.0)
    assert not len(world.contacts)
    assert world.speed[behind] == pytest.approx(world.speed[row], abs=0.2)


@pytest.mark.parametrize(("y", "yaw"), [(MAX_LATERAL_OFFSET + 0.1, 0.0), (0.0, math.radians(80.0)), (0.0, math.pi)])
def test_ego_beside_or_across_the_road_has_no_lane_to_follow(y: float, yaw: float) -> None:
    world = world_of(road())
    row = ego(world, 10.0, y, yaw=yaw)
    before = world.digest()
    assert not start_self_driving(world, row)
    assert world.digest() == before


def test_ego_without_roads_has_no_lane_to_follow() -> None:
    world = World()
    assert not start_self_driving(world, ego(world, 0.0, 0.0))


def test_only_an_ego_can_drive_itself() -> None:
    world = world_of(road())
    with pytest.raises(ValueError, match="not driven"):
        start_self_driving(world, car(world, "a", 10.0))
    row, _ = (ego(world, x, 0.0) for x in (30.0, 60.0))
    world.remove(int(world.uid[row]))
    with pytest.raises(ValueError, match="not driven"):
        start_self_driving(world, row)


def test_ego_goes_on_as_it_moves_when_self_driving_ends() -> None:
    world = world_of(road(limit=LIMIT))
    row = self_driving_ego(world, 10.0)
    run(world, 10.0)
    speed = float(world.speed[row])
    leave_lane(world, row)
    command(world, row, mode=Mode.PEDALS, steer=0.2)
    assert world.speed[row] == speed
    run(world, 2.0)
    assert world.y[row] > 1.0
    assert not world.has_lane[row]


def test_teleported_ego_has_left_its_lane() -> None:
    world = world_of(road())
    row = self_driving_ego(world, 10.0)
    teleport(world, row, x=0.0, y=50.0, z=0.0, yaw=0.0)
    run(world, 2.0)
    assert (world.x[row], world.y[row], world.has_lane[row]) == (0.0, 50.0, False)


def test_self_driving_ego_brakes_in_another_gear() -> None:
    world = world_of(road())
    row = self_driving_ego(world, 10.0)
    assert shift(world, row, Gear.NEUTRAL)
    run(world, 1.0)
    assert (world.speed[row], world.brake[row]) == (0.0, 1.0)


def test_self_driving_egos_among_drivers_change_nothing_of_how_these_move() -> None:
    lone, shared = world_of(road()), world_of(road())
    rows = [car(world, "a", 500.0, speed=10.0) for world in (lone, shared)]
    self_driving_ego(shared, 10.0)
    for _ in range(250):
        step(lone)
        step(shared)
    for name in ("x", "y", "yaw", "speed", "arc"):
        np.testing.assert_array_equal(getattr(lone, name)[rows[0]], getattr(shared, name)[rows[1]])


def test_a_restored_self_driving_ego_drives_on_to_the_bit() -> None:
    world = world_of(road())
    self_driving_ego(world, 10.0, 1.0)
    run(world, 1.0)
    saved = world.snapshot()
    run(world, 3.0)
    end = world.digest()
    world.restore(saved)
    run(world, 3.0)
    assert world.digest() == end
    assert world.kind[0] == Kind.EGO


def test_route_is_followed_and_its_first_lane_is_taken() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "b c"),
        b=(line((100, 0), (200, 0)), ""),
        c=(line((100, 0), (200, 40)), ""),
        other=(line((0, 1), (100, 1)), ""),
    )
    for goal in ("b", "c"):
        world = world_of(roads)
        row = ego(world, 10.0, 0.9)
        route = (roads.row("a"), roads.row(goal))
        assert start_self_driving(world, row, route=route, desired_speed=5.0)
        assert (world.lane[row], world.ahead_1[row], world.desired_speed[row]) == (*route, 5.0)
        leave_lane(world, row)
        assert not world.routes


def test_route_that_does_not_lead_along_lanes_is_refused() -> None:
    world = world_of(make(a=(line((0, 0), (100, 0)), ""), b=(line((0, 50), (100, 50)), "")))
    row = ego(world, 10.0, 0.0)
    before = world.digest()
    for route, why in (((0, 1), "lane 1 does not follow lane 0"), ((7,), "expected 0")):
        with pytest.raises(ValueError, match=why):
            start_self_driving(world, row, route=route)
    assert not start_self_driving(world, row, route=(1,)), "it is 50 m away"
    assert world.digest() == before


def three_lanes() -> World:
    """Three straight lanes of 2 km at y = 0 (the right one), 3.5 and 7 m."""
    lines = [line((0, 3.5 * i), (2000, 3.5 * i)) for i in range(3)]
    roads = Roads(
        ["R", "M", "L"],
        lines,
        [[], [], []],
        [3.5] * 3,
        [30.0] * 3,
        left=[1, 2, -1],
        right=[-1, 0, 1],
    )
    return world_of(roads)


@pytest.mark.parametrize("speed", [5.0, 15.0, 29.0])
def test_self_driving_ego_changes_lanes_gently(speed: float) -> None:
    world = three_lanes()
    row = self_driving_ego(world, 10.0)
    teleport(world, row, x=10.0, y=0.0, z=0.0, yaw=0.0, speed=speed)
    assert start_self_driving(world, row, desired_speed=speed)
    run(world, 1.0)
    assert change_lane(world, row, LEFT)
    assert not change_lane(world, row, LEFT)  # one at a time
    most = 0.0
    for _ in range(round(10.0 / DT)):
        step(world)
        most = max(most, abs(float(world.lateral_accel[row])))
    assert world.y[row] == pytest.approx(3.5, abs=0.1)
    assert most < 3.0
    assert change_lane(world, row, RIGHT)


def test_ego_changes_into_no_lane_that_is_not_there() -> None:
    world = three_lanes()
    row = self_driving_ego(world, 10.0)
    assert not change_lane(world, row, RIGHT)
    leave_lane(world, row)
    with pytest.raises(ValueError, match="does not drive itself"):
        change_lane(world, row, LEFT)


def test_ego_changes_into_no_lane_that_one_may_not_change_into() -> None:
    roads = wide_road(2)
    roads.right[:] = -1
    world = world_of(roads)
    row = self_driving_ego(world, 60.0)
    before = world.digest()
    assert not change_lane(world, row, RIGHT)
    assert world.digest() == before


def test_vehicle_behind_sees_an_ego_that_changes_into_its_lane() -> None:
    world = three_lanes()
    row = self_driving_ego(world, 60.0)
    behind = car(world, "M", 10.0)
    run(world, 8.0)
    gap = float(world.x[row] - world.x[behind])
    assert change_lane(world, row, LEFT)
    run(world, 12.0)
    assert world.y[row] == pytest.approx(3.5, abs=0.1)
    assert world.x[row] - world.x[behind] > 0.0
    assert gap != world.x[row] - world.x[behind]
    assert not len(world.contacts)


def test_ego_that_begins_anew_without_a_route_has_the_old_one_no_more() -> None:
    world = world_of(make(a=(line((0, 0), (60, 0)), "b"), b=(line((60, 0), (160, 0)), "")))
    row = ego(world, 10.0, 0.0)
    assert start_self_driving(world, row, route=[0, 1])
    assert world.routes
    assert start_self_driving(world, row, is_loop=True)
    assert (world.routes, world.is_loop[row]) == ({}, False)


@pytest.mark.parametrize("heading", [0.5 * math.pi, -2.5])
def test_ego_drives_itself_and_changes_lanes_on_a_road_of_any_direction(heading: float) -> None:
    way = np.array([math.cos(heading), math.sin(heading)])
    left = np.array([-way[1], way[0]])
    lines = [
        np.append(np.array([s * way + aside * left for s in (0.0, 200.0)]), np.zeros((2, 1)), 1) for aside in (0.0, 3.5)
    ]
    world = world_of(Roads(["R", "L"], lines, [[], []], [3.5] * 2, [15.0] * 2, left=[1, -1], right=[-1, 0]))
    x, y = 50.0 * way + 0.4 * left
    row = ego(world, x, y, yaw=heading)
    assert start_self_driving(world, row)
    assert (world.lane[row], world.arc[row]) == (0, pytest.approx(50.0))
    world.lateral_to[row] = world.lateral_push[row] = world.lateral_bend[row] = 0.1
    assert change_lane(world, row, LEFT)
    assert (world.lane[row], world.arc[row]) == (1, pytest.approx(50.0))
    assert (world.lateral[row], world.lateral_from[row]) == (pytest.approx(-3.1), pytest.approx(-3.1))
    assert world.lateral_to[row] == world.lateral_push[row] == world.lateral_bend[row] == 0.0
    assert (world.lateral_left[row], world.leaving[row], world.came_from[row]) == (1.0, 2 - LEFT, 2 - LEFT)
    world.lateral_left[row] = 0.0
    assert change_lane(world, row, RIGHT)
    assert (world.lane[row], world.leaving[row], world.came_from[row]) == (0, 2 - RIGHT, 2 - RIGHT)


def test_ego_drives_round_and_round_on_a_route_of_one_lane() -> None:
    world = world_of(make(a=(arc(0, 0, 30.0, 0.0, 360.0), "a")))
    row = ego(world, 30.0, 0.5, yaw=0.5 * math.pi)
    assert start_self_driving(world, row, route=[0], is_loop=True)
    assert (world.lane[row], world.is_loop[row]) == (0, True)


def steer_while_it_changes_lanes(heading: float) -> float:
    """Where the wheels point of an ego that drives along a road and begins to change to the left lane [rad]."""
    way = np.array([math.cos(heading), math.sin(heading)])
    left = np.array([-way[1], way[0]])
    lines = [
        np.append(np.array([s * way + aside * left for s in (0.0, 200.0)]), np.zeros((2, 1)), 1) for aside in (0.0, 3.5)
    ]
    world = world_of(Roads(["R", "L"], lines, [[], []], [3.5] * 2, [15.0] * 2, left=[1, -1], right=[-1, 0]))
    row = ego(world, *(50.0 * way), yaw=heading, speed=8.0)
    world.gear[row] = Gear.DRIVE
    assert start_self_driving(world, row)
    assert change_lane(world, row, LEFT)
    run(world, 1.0)
    return float(world.steer_cmd[row])


@pytest.mark.parametrize("heading", [0.5 * math.pi, -2.5])
def test_ego_that_changes_lanes_steers_alike_on_a_road_of_any_direction(heading: float) -> None:
    steer = steer_while_it_changes_lanes(0.0)
    assert steer > 0.01
    assert steer_while_it_changes_lanes(heading) == pytest.approx(steer, rel=1e-6)


@pytest.mark.parametrize("frame", [5, 6])
def test_drivers_leave_pose_and_motion_of_a_self_driving_ego_to_its_tyres(frame: int) -> None:
    world = World(0, Dynamics.SINGLE_TRACK)
    world.lay_roads(road())
    row = ego(world, 50.0, 0.3, speed=8.0)
    car(world, "a", 90.0, speed=8.0)
    world.gear[row] = Gear.DRIVE
    assert start_self_driving(world, row)
    world.accel[row], world.lateral_accel[row], world.yaw_rate[row], world.frame = 0.7, 0.3, 0.1, frame
    columns = ("x", "y", "z", "yaw", "speed", "accel", "lateral_accel", "yaw_rate")
    before = [float(getattr(world, name)[row]) for name in columns]
    drive_lanes(world, DT)
    assert [float(getattr(world, name)[row]) for name in columns] == before

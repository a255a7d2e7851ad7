"""Lane following: on a free road, behind others, at lights, and with others in the way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.drivers.driver_model import Perception, firm_stop
from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.drivers.driver_perception import perceive
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.followers.lane_following import DECISION, LANE_LOOPS
from rosbridge_sim.world.geometry.planar import BoolArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.signal_plan import Lamp, Light, SignalPlan
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.mutations import examples
from tests.world.lane_drives import BUS, NOSE, lane_of, run, to_line, world_of
from tests.world.road_factory import (
    CAR,
    arc,
    built_in,
    car,
    crossing,
    ego,
    keep_lane,
    line,
    make,
    ring,
    road,
    signalled,
)
from tests.world.traffic_observers import RedRuns

pytestmark = pytest.mark.usefixtures("loops")

# Alone


def parameters(world: World) -> DriverParameters:
    return DriverParameters.of(world, np.arange(world.n))


def test_speed_limit_is_reached_by_each_driver_times_its_own_factor() -> None:
    world = world_of(make(**{f"l{y}": (line((0, y), (1000, y)), "", 15.0) for y in (0, 50, 100)}))
    rows = []
    for i, lane in enumerate(world.roads.ids):
        world.spawn(Kind.OBSTACLE, CAR, name="far", x=0.0, y=1e5 + 10.0 * i, uid=10 * i + 10)  # drivers: 11, 21, 31
        rows.append(car(world, lane, 10.0))
    speeds = run(world, 24.0)[:, rows]
    wanted = parameters(world).speed_factor[rows] * 15.0
    assert len(set(wanted.tolist())) == len(rows)
    assert (speeds.max(axis=0) <= wanted + 1e-9).all()
    assert (speeds[-1] > wanted - 0.5).all()
    assert (np.diff(speeds, axis=0).max(axis=0) / DT < parameters(world).accel[rows]).all()


def test_driver_with_a_given_speed_keeps_the_limit() -> None:
    world = world_of(road(limit=15.0))
    car(world, "a", 10.0, speed=10.0, desired_speed=20.0)
    speeds = run(world, 15.0)
    assert speeds.max() <= 15.0 + 1e-9
    assert speeds[-1, 0] > 14.5


def test_no_driver_exceeds_its_desired_speed() -> None:
    world = world_of(road(limit=30.0))
    row = car(world, "a", 10.0, speed=12.0, desired_speed=8.0)
    speeds = run(world, 11.0)
    assert speeds[-1, row] == pytest.approx(8.0, abs=0.1)


def test_vehicle_stops_at_the_end_of_the_road() -> None:
    world = world_of(road(length=100.0))
    row = car(world, "a", 10.0, speed=15.0)
    run(world, 16.0)
    assert world.speed[row] < 0.01
    assert to_line(world, row) == pytest.approx(1.0, abs=0.3)


def test_vehicle_too_fast_for_the_end_of_the_road_stops_on_it() -> None:
    world = world_of(road(length=50.0))
    row = car(world, "a", 44.0, speed=15.0)
    run(world, 10.0)
    assert (world.x[row], world.speed[row]) == (pytest.approx(50.0), 0.0)


def test_lower_limit_is_kept_from_its_first_metre() -> None:
    roads = make(
        a=(line((0, 0), (150, 0)), "b", 20.0),
        b=(line((150, 0), (180, 0)), "c", 8.0),
        c=(line((180, 0), (900, 0)), "", 20.0),
    )
    world = world_of(roads)
    row = car(world, "a", 10.0, speed=20.0, desired_speed=20.0)
    at = {"a": 0.0, "b": 0.0, "c": 0.0}
    for _ in range(1000):
        step(world)
        at[lane_of(world, row)] = max(at[lane_of(world, row)], float(world.speed[row]))
    assert at["b"] < 8.0 + 1.0
    assert at["c"] > 15.0


def test_bend_speed_has_a_comfortable_lateral_acceleration() -> None:
    ring = make(a=(arc(0, 0, 30.0, 0, 180), "b", 30.0), b=(arc(0, 0, 30.0, 180, 180), "a", 30.0))
    world = world_of(ring)
    row = car(world, "a", 5.0, speed=4.0)
    run(world, 12.0)
    lateral = parameters(world).lateral[row]
    assert world.speed[row] == pytest.approx(math.sqrt(lateral * 30.0), rel=0.05)
    assert world.yaw_rate[row] == pytest.approx(world.speed[row] / 30.0, rel=0.1)
    assert world.lateral_accel[row] == pytest.approx(lateral, rel=0.15)


def test_both_axles_stay_on_the_lane() -> None:
    ring = make(a=(arc(0, 0, 20.0, 0, 180), "b", 10.0), b=(arc(0, 0, 20.0, 180, 180), "a", 10.0))
    world = world_of(ring)
    van = Body(6.9, 2.0, 2.5, wheelbase=5.4, front_overhang=0.7, rear_overhang=0.8)  # longer ones swing
    row = car(world, "a", 5.0, speed=5.0, body=van)
    for _ in range(700):  # once around
        step(world)
        assert -math.pi < world.yaw[row] <= math.pi
        rear = complex(world.x[row], world.y[row])
        front = rear + van.wheelbase * complex(math.cos(world.yaw[row]), math.sin(world.yaw[row]))
        assert abs(rear) == pytest.approx(20.0, abs=0.01)
        assert abs(front) == pytest.approx(20.0, abs=0.06)


def test_heights_are_followed() -> None:
    points = np.array([(0.0, 0.0, 0.0), (100.0, 0.0, 10.0), (200.0, 0.0, 10.0)])
    world = world_of(make(a=(points, "")))
    row = car(world, "a", 5.0, speed=10.0)
    for _ in range(300):
        step(world)
        assert world.z[row] == pytest.approx(min(world.x[row] / 10.0, 10.0), abs=1e-9)


# Behind others


def test_slower_lead_vehicle_is_followed_at_a_time_gap() -> None:
    world = world_of(road(length=3000.0, limit=20.0))
    slow = car(world, "a", 200.0, desired_speed=10.0, speed=10.0)
    fast = car(world, "a", 160.0, speed=15.0)
    run(world, 24.0)
    gap = world.arc[slow] - CAR.rear_overhang - world.arc[fast] - NOSE
    assert world.speed[fast] == pytest.approx(10.0, abs=0.1)
    assert gap == pytest.approx(2.5 + parameters(world).headway[fast] * 10.0, rel=0.05)


def test_queue_stops_and_starts_in_order() -> None:
    roads, plan = signalled(green=900)
    world = world_of(roads, plan)
    rows = [car(world, "s", 150.0 - 12.0 * i, speed=8.0) for i in range(8)]
    run(world, 18.0)
    assert (world.speed[rows] < 0.05).all()
    gaps = -np.diff(world.arc[rows]) - CAR.length
    assert gaps == pytest.approx(2.5, abs=0.6)
    run(world, 10.0)  # 3 s of yellow for the others, then it is theirs
    assert lane_of(world, rows[0]) != "s"
    assert (np.diff(world.y[rows]) < 0.0).all()


def test_queue_discharges_as_fast_as_in_sumo() -> None:
    """1.60 s from car to car, after the fourth: SUMO 1.28, its default car, steps of 0.1 s, the mean of ten runs."""
    headways = []
    for seed in range(2):
        roads = make(
            a=(line((0, 0), (200, 0)), "b", 13.89),
            b=(line((200, 0), (220, 0)), "c", 13.89),
            c=(line((220, 0), (900, 0)), "", 13.89),
        )
        world = world_of(roads, SignalPlan(roads, [Light("x", lanes=(1,))]), seed)
        world.signals.force(0, Lamp.RED)
        rows = np.array([car(world, "a", 190.0 - 7.0 * i) for i in range(12)])
        run(world, 5.0)
        world.signals.force(0, Lamp.GREEN)
        noses = []
        for _ in range(1100):
            step(world)
            noses.append(world.x[rows] + NOSE)
            assert world.accel[rows].max() <= 2.6
        headways.append(np.diff((np.array(noses) < 200.0).sum(axis=0) * DT))
    assert np.mean(headways, axis=0)[3:].mean() == pytest.approx(1.60, rel=0.1)


def driven(world: World, x: float, speed: float) -> int:
    """An ego that keeps its speed to the east; returns the row."""
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=x, y=0.0, speed=speed))
    command(world, row, mode=Mode.SPEED, steer=0.0, speed=speed)
    return row


@pytest.mark.parametrize("speed", [14.0, 33.0])
def test_nobody_crashes_behind_an_emergency_stop_and_the_braking_fades_along_the_platoon(speed: float) -> None:
    world = world_of(road(length=3000.0, limit=speed))
    leader = driven(world, 600.0, 0.9 * speed)
    rows = [car(world, "a", 600.0 - (1.1 * speed + 8.0) * (i + 1), speed=0.9 * speed) for i in range(8)]
    run(world, 5.0)
    command(world, leader, mode=Mode.PEDALS, steer=0.0, brake=1.0)
    hardest = np.zeros(len(rows))
    for _ in range(1000):
        step(world)
        assert not len(world.contacts)
        hardest = np.fmin(hardest, world.accel[rows])
    assert (world.speed < 0.05).all()
    assert hardest[0] < -5.0
    assert hardest[-1] > 0.75 * hardest[0]


def test_small_wave_fades_along_a_platoon() -> None:
    world = world_of(road(length=6000.0, limit=30.0))
    leader = driven(world, 800.0, 20.0)
    rows = [car(world, "a", 800.0 - 30.0 * (i + 1), speed=20.0) for i in range(8)]
    run(world, 10.0)
    command(world, leader, mode=Mode.SPEED, steer=0.0, speed=16.0)
    run(world, 3.0)
    command(world, leader, mode=Mode.SPEED, steer=0.0, speed=20.0)
    dips = 20.0 - run(world, 20.0)[:, rows].min(axis=0)
    assert dips[0] > 2.0
    assert dips[-1] < 0.7 * dips[0]


def test_driver_reacts_late_and_without_a_jump() -> None:
    world = world_of(road(length=3000.0, limit=20.0))
    row = car(world, "a", 100.0, speed=19.0)
    run(world, 5.0)
    before = world.accel[row]
    world.spawn(Kind.OBSTACLE, CAR, name="thing", x=float(world.x[row]) + 45.0, y=0.0)
    accels = []
    for _ in range(100):
        step(world)
        accels.append(world.accel[row] - before)
    full = min(accels)
    reached = next(i for i, value in enumerate(accels) if value < 0.63 * full) * DT
    assert full < -3.0
    assert 0.1 <= reached <= parameters(world).reaction[row] + DECISION * DT + 0.3


def test_vehicle_two_lanes_ahead_is_seen_in_time() -> None:
    snippets = {f"l{i}": (line((10.0 * i, 0), (10.0 * i + 10.0, 0)), f"l{i + 1}") for i in range(20)}
    roads = make(**snippets, l20=(line((200, 0), (300, 0)), ""))
    world = world_of(roads)
    front = car(world, "l20", 5.0, desired_speed=0.0)
    back = car(world, "l8", 1.0, speed=15.0)
    speeds = run(world, 15.0)
    assert speeds[-1, back] < 0.02
    assert world.x[front] - CAR.rear_overhang - world.x[back] - NOSE == pytest.approx(2.5, abs=0.3)


def test_vehicle_at_a_fork_blocks_both_lanes() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "b c"),
        b=(line((100, 0), (300, 0)), ""),
        c=(line((100, 0), (200, 20)), ""),
    )
    world = world_of(roads)
    car(world, "b", 1.5, desired_speed=0.0)
    other = car(world, "a", 50.0, speed=10.0, route="a c")
    run(world, 11.0)
    assert lane_of(world, other) == "a"
    assert world.speed[other] < 0.02


# Lights


def enters(world: World, row: int, seconds: float) -> float | None:
    """When the bumper is over the line [s]; None: it is not."""
    lane = world.lane[row]
    for frame in range(round(seconds / DT)):
        step(world)
        if world.lane[row] != lane or to_line(world, row) < 0.0:
            return frame * DT
    return None


def test_vehicle_stops_one_metre_before_a_red_stop_line() -> None:
    roads, plan = signalled(green=500)
    world = world_of(roads, plan)
    row = car(world, "s", 100.0, speed=14.0)
    run(world, 12.0)
    assert world.speed[row] < 0.02
    assert to_line(world, row) == pytest.approx(1.0, abs=0.2)
    assert enters(world, row, 20.0) == pytest.approx(1.0 + 1.5, abs=1.0), "green comes a second later"


def test_vehicle_does_not_brake_for_green() -> None:
    roads, plan = signalled(green=3000)
    world = world_of(roads, plan)
    car(world, "w", 50.0, speed=15.0, desired_speed=15.0)
    assert run(world, 12.0).min() > 14.7


@pytest.mark.parametrize("distance", [5.0, 15.0, 25.0, 28.0, 32.0, 40.0, 60.0])
def test_vehicle_stops_at_yellow_if_it_can(distance: float) -> None:
    roads, plan = signalled(green=DECISION, yellow=150)  # yellow from the second decision on, for 3 s
    world = world_of(roads, plan)
    row = car(world, "w", 190.0 - NOSE - distance, speed=14.0)
    when = enters(world, row, 4.0)
    driver = parameters(world)
    can_stop = distance - 14.0 * DECISION * DT > firm_stop(
        ARRAYS, np.array([14.0]), np.zeros(1), driver.reaction[[row]]
    )
    assert (when is None) == can_stop
    assert when is None or when <= 3.1, "he is over the line while it is yellow"
    assert world.accel.min() > -5.0


def test_vehicle_waits_for_a_left_arrow() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "b c"),
        b=(line((100, 0), (130, 0)), ""),
        c=(arc(100, 20, 20, -90, 90), ""),
    )
    plan = SignalPlan(roads, [Light("x", lamps=Lamp.GREEN | Lamp.LEFT, lanes=(1, 2))], passes=[16, 16, 32])
    world = world_of(roads, plan)
    world.signals.force(0, Lamp.GREEN)
    row = car(world, "a", 50.0, speed=10.0, route="a c")
    run(world, 10.0)
    assert lane_of(world, row) == "a"
    world.signals.force(0, Lamp.RED | Lamp.LEFT)
    run(world, 5.0)
    assert lane_of(world, row) == "c"


def test_unlit_light_stops_no_vehicle() -> None:
    roads, _ = signalled()
    world = world_of(roads, SignalPlan(roads, [Light("x", lanes=(1,)), Light("warn", lamps=Lamp.YELLOW, lanes=(4,))]))
    rows = [car(world, "w", 150.0, speed=10.0), car(world, "s", 70.0, speed=10.0)]
    run(world, 16.0)
    assert [lane_of(world, row) for row in rows] == ["e", "n"]


# Others in the way


def test_vehicles_follow_and_wait_for_an_ego() -> None:
    world = world_of(road())
    other = ego(world, 100.0, 0.3)
    row = car(world, "a", 10.0, speed=15.0)
    run(world, 14.0)
    assert world.speed[row] < 0.02
    assert world.x[other] - CAR.rear_overhang - world.x[row] - NOSE == pytest.approx(2.5, abs=0.3)


def test_entity_beside_the_lane_does_not_block_it() -> None:
    world = world_of(road())
    ego(world, 100.0, 3.5)
    world.spawn(Kind.OBSTACLE, Body.box(0.4, 0.4, 0.7), name="cone", x=150.0, y=-2.0)
    row = car(world, "a", 10.0, speed=15.0, desired_speed=15.0)
    assert run(world, 12.0)[:, row].min() > 14.5


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("clear", "is_passed"), [(1.35, False), (1.45, True)])
def test_obstacle_blocks_the_lane_within_half_a_car_width_and_a_margin(
    side: float, clear: float, *, is_passed: bool
) -> None:
    """1.4 m beside the line: a car is 1.82 m wide and keeps half a metre from what it passes."""
    world = world_of(road())
    world.spawn(Kind.OBSTACLE, Body.box(0.5, 0.5, 1.0), name="thing", x=120.0, y=side * (clear + 0.25))
    row = car(world, "a", 80.0, speed=10.0)
    run(world, 8.0)
    assert (world.x[row] > 130.0) is np.bool_(is_passed)


@pytest.mark.parametrize("kind", [Kind.PEDESTRIAN, Kind.OBSTACLE])
def test_vehicle_stops_for_pedestrians_and_obstacles(kind: Kind) -> None:
    world = world_of(road())
    uid = world.spawn(kind, Body.box(0.5, 0.5, 1.7), name="thing", x=120.0, y=0.8)
    row = car(world, "a", 10.0, speed=15.0)
    run(world, 14.0)
    assert (world.speed[row] < 0.02, world.x[row] < 120.0 - NOSE) == (True, True)
    world.remove(uid)
    run(world, 5.0)
    assert world.speed[row] > 3.0


def test_vehicle_lets_a_crossing_pedestrian_pass() -> None:
    world = world_of(road())
    way = np.array([[150.0, -8.0], [150.0, 8.0]])
    world.spawn(Kind.PEDESTRIAN, Body.box(0.5, 0.5, 1.7), name="man", x=150.0, y=-8.0, path=way, speed=1.2)
    row = car(world, "a", 80.0, speed=10.0)
    run(world, 20.0)
    assert world.x[row] > 200.0


def test_vehicle_does_not_hit_an_ego_in_a_crossing() -> None:
    world = world_of(crossing())
    ego(world, 0.0, -10.0, yaw=math.pi / 2, speed=3.0)
    row = car(world, "w", 160.0, speed=10.0)
    run(world, 12.0)
    assert lane_of(world, row) == "e"


def test_entities_far_from_roads_are_ignored() -> None:
    world = world_of(road())
    ego(world, 1e6, 1e6)
    row = car(world, "a", 10.0, speed=10.0)
    run(world, 1.0)
    assert world.speed[row] > 10.0


# Bits


def crowd(seed: int = 0, num: int = 30, *, is_alone: bool = False) -> World:
    """The town with cars in it and, unless these are alone, an ego that rolls and one who walks."""
    town = built_in("town")
    world = world_of(town.roads, town.plan, seed)
    network = town.roads.derived(LaneConflicts)
    free = [lane for lane in range(len(town.roads)) if math.isinf(network.wait_point[lane])]
    for i in range(num):
        lane = free[i * 7 % len(free)]
        car(world, town.roads.ids[lane], 10.0 + 12.0 * (i % 5), speed=5.0, body=BUS if i % 9 == 0 else CAR)
    if not is_alone:
        ego(world, 20.0, -5.25, speed=4.0)
        world.spawn(Kind.PEDESTRIAN, CAR, name="man", x=9.0, y=9.0, speed=1.0)
    return world


def test_the_same_seed_gives_the_same_bits_with_or_without_a_snapshot_between() -> None:
    first, second, third = crowd(), crowd(), crowd(seed=5)
    for frame in range(100):
        if frame == 43:
            third.restore(first.snapshot())
        if frame == 61:
            second.touch()
        for world in (first, second, third)[: 2 if frame < 43 else 3]:
            step(world)
        if frame > 43 and frame % 25 == 0:
            assert first.digest() == second.digest() == third.digest()
    assert first.digest() == second.digest() == third.digest()


def test_different_seeds_and_roads_have_different_digests() -> None:
    world = crowd()
    assert world.digest() != crowd(seed=1).digest()
    bare = World()
    before = bare.digest()
    bare.lay_roads(ring())
    assert bare.digest() != before


def test_free_rows_change_nothing() -> None:
    plain, holed = world_of(ring()), world_of(ring())
    for i in range(4):
        car(plain, "a", 2.0 + 13.0 * i, speed=6.0)
        holed.spawn(Kind.OBSTACLE, CAR, name="far", x=1e5 + 30.0 * i, y=1e5, uid=100 + i)
        row = holed.row(holed.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=6.0, uid=i + 1))
        keep_lane(holed, row, 0, 2.0 + 13.0 * i)
    run(plain, 8.0)
    run(holed, 8.0)
    for uid in range(1, 5):
        one, other = plain.row(uid), holed.row(uid)
        for column in ("x", "y", "yaw", "speed", "accel", "lane", "arc"):
            assert getattr(plain, column)[one] == getattr(holed, column)[other], column


ACTIONS = st.one_of(
    st.tuples(st.just("step"), st.integers(1, 40)),
    st.tuples(st.just("car"), st.integers(0, 300)),
    st.tuples(st.just("remove"), st.integers(0, 9)),
    st.tuples(st.just("teleport"), st.integers(0, 9)),
    st.tuples(st.just("ego"), st.integers(0, 60)),
    st.tuples(st.just("force"), st.integers(0, 1)),
)


@examples(25)
@given(st.lists(ACTIONS, max_size=20))
def test_every_vehicle_stays_on_its_lane(actions: list[tuple[str, int]]) -> None:
    roads, plan = signalled(green=60, yellow=20)
    world = world_of(roads, plan)
    for action, value in actions:
        some = list(world.placed())
        if action == "step":
            for _ in range(value):
                step(world)
        elif action == "car":
            car(world, roads.ids[value % 6], float(value % 97), speed=value % 17)
        elif action == "ego":
            ego(world, value - 30.0, 0.5, speed=value % 5)
        elif action == "force":
            world.signals.force(value, Lamp.GREEN)
        elif some and action == "remove":
            world.remove(int(world.uid[some[value % len(some)]]))
        elif some:
            teleport(world, some[value % len(some)], x=value, y=value, z=0.0, yaw=value, speed=value)
    for row in np.flatnonzero(world.has_lane).tolist():
        points, _ = roads.at(world.lane[row], world.arc[row])
        assert points[0] == pytest.approx([world.x[row], world.y[row], world.z[row]], abs=1e-6)
        assert 0.0 <= world.arc[row] <= roads.length[world.lane[row]]
        assert world.speed[row] >= 0.0
    assert np.isfinite(world.yaw).all()
    assert np.isfinite(world.accel).all()


# The town


def red_runs(world: World, seconds: float) -> int:
    """How often somebody comes over a stop line at red; nobody touches anybody."""
    judge = RedRuns(world)
    for _ in range(round(seconds / DT)):
        step(world)
        assert not len(world.contacts)
        judge.watch()
    return judge.num


def test_red_run_counter_finds_vehicles_that_ignore_lights(monkeypatch: pytest.MonkeyPatch) -> None:
    def blind(network: LaneConflicts, may_enter: BoolArray, *rest: Any) -> Perception:  # noqa: ANN401 - as `perceive` has them
        return perceive(network, np.ones_like(may_enter), *rest)

    monkeypatch.setattr("rosbridge_sim.world.followers.lane_following.perceive", blind)
    monkeypatch.setattr(LANE_LOOPS, "make", None)  # they call no function of Python
    assert red_runs(crowd(num=20, is_alone=True), 10.0) > 3


@pytest.mark.slow
@pytest.mark.parametrize("num_minutes", [1, pytest.param(10, marks=pytest.mark.long)])
def test_no_vehicle_runs_a_red_light(num_minutes: int) -> None:
    world = crowd(num=40, is_alone=True)
    assert red_runs(world, num_minutes * 60.0) == 0
    assert world.turns.min() >= num_minutes, "and nobody stands for ever"


def test_driver_sees_the_end_of_a_jam_beyond_the_lead_vehicle() -> None:
    """The lead vehicle leaves the lane in the last moment; the driver braked with 4.6 m/s^2 then."""
    world = world_of(road(limit=30.0))
    car(world, "a", 700.0, desired_speed=0.0)
    lead = ego(world, 450.0, 0.0, speed=30.0)
    row = car(world, "a", 400.0, speed=30.0)
    uid, lead_uid = int(world.uid[row]), int(world.uid[lead])
    hardest = 0.0
    while world.speed[world.row(uid)] > 0.1:
        step(world)
        if lead_uid in world.uid[world.alive] and world.x[world.row(lead_uid)] > 660.0:
            world.remove(lead_uid)
        hardest = min(hardest, float(world.accel[world.row(uid)]))
    assert hardest > -3.0

"""Lane changes: around what stands, where a lane ends, for a route, to get on faster; and never into anything."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.followers.lane_following import DECISION, view_driver
from rosbridge_sim.world.lane_changes.lane_change_model import LaneChange
from rosbridge_sim.world.roads.lane_change_map import LEFT, RIGHT
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import BUS, lane_of, run, world_of
from tests.world.road_factory import CAR, built_in, car, ego, keep_lane, line, make
from tests.world.wide_roads import wide_ring, wide_road

pytestmark = pytest.mark.usefixtures("loops")


def queue_behind_an_ego(num: int = 8) -> tuple[World, list[int]]:
    world = world_of(wide_road())
    ego(world, 300.0, -3.5)
    return world, [car(world, "l1", 5.0 + 30.0 * i, speed=20.0, desired_speed=20.0) for i in range(num)]


def crowd(seed: int = 0, each: int = 6) -> tuple[World, list[int]]:
    """A ring of three lanes with slow and fast drivers."""
    world, rng = world_of(wide_ring(radius=80.0), seed=seed), np.random.default_rng(seed)
    rows = []
    for lane, name in enumerate(world.roads.ids):
        for i in range(each):
            s = (i + 0.5) * float(world.roads.length[lane]) / each
            body = BUS if rng.random() < 0.1 else CAR
            rows.append(car(world, name, s, speed=8.0, body=body, desired_speed=rng.uniform(7.0, 20.0)))
    return world, rows


def road_with_a_ramp() -> Roads:
    """Two lanes to the east; a ramp joins the right one, `right`, at 400 m, from where on it is `on`."""
    whole = line(*[(x, 3.5) for x in range(0, 901, 10)])
    lines = [whole, line((0, 0), (400, 0)), line((400, 0), (900, 0)), line((150, -9), (400, 0))]
    ids, ahead = ["left", "right", "on", "ramp"], [[], [2], [], [2]]
    left_of, right_of = [-1, 0, -1, -1], [1, -1, -1, -1]
    return Roads(ids, lines, ahead, [3.5] * 4, [30.0] * 4, left=left_of, right=right_of)


@pytest.mark.slow
def test_eight_cars_pass_an_ego_that_stands_on_a_wide_road() -> None:
    world, rows = queue_behind_an_ego()
    speeds = run(world, 22.0)
    assert (world.x[rows] > 320.0).all()
    assert speeds[:, rows].min() > 8.0  # nobody had to queue


@pytest.mark.slow
def test_car_that_stands_behind_an_ego_pulls_out() -> None:
    world = world_of(wide_road(2))
    ego(world, 60.0, 0.0)
    row = car(world, "l0", 20.0, speed=0.0, desired_speed=15.0)
    run(world, 16.0)
    assert world.x[row] > 90.0


def brake_before_followers(world: World, row: int, rows: list[int], brake: float, seconds: float = 16.0) -> None:
    """Stop an ego with its brake; all followers get past it, and nobody touches it."""
    for frame in range(round(seconds * 50)):
        if frame % 50 == 0:
            command(world, row, mode=Mode.PEDALS, steer=0.0, brake=brake)
        step(world)
        assert not len(world.contacts)
        if (world.x[rows] > world.x[row] + 10.0).all():
            break
    assert world.speed[row] == 0.0
    assert (world.x[rows] > world.x[row] + 10.0).all()


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "speed", "brake"), [(2.0, 3.0, 0.24), (10.0, 3.0, 1.0), (15.0, 14.0, 0.5)])
def test_followers_pass_an_ego_that_brakes_to_a_stand_before_them(gap: float, speed: float, brake: float) -> None:
    world = world_of(wide_road())
    row = ego(world, 300.0, -3.5, speed=speed)
    each = CAR.length + gap
    rows = [car(world, "l1", 300.0 - each * (i + 1), speed=speed) for i in range(2)]
    brake_before_followers(world, row, rows, brake)


@pytest.mark.slow
@pytest.mark.parametrize("body", [CAR, BUS])
def test_driver_pulls_out_from_rest_at_the_gap_that_its_steering_allows(body: Body) -> None:
    world = world_of(wide_road(2))
    nose = body.length - body.rear_overhang
    row = car(world, "l0", 60.0, body=body)
    stands = ego(world, 60.0 + nose + (2.0 if body is CAR else 6.6) + CAR.rear_overhang, 0.0)
    speeds, yaws = [], []
    for _ in range(700):
        step(world)
        assert not len(world.contacts)
        speeds.append(float(world.speed[row]))
        yaws.append(float(world.yaw[row]))
    way = np.cumsum(speeds)[::DECISION] * DT
    turn = np.abs(np.diff(yaws[::DECISION]))
    radius = np.diff(way)[turn > 1e-3] / turn[turn > 1e-3]
    assert radius.min() > 0.95 * body.wheelbase / np.tan(CAR.max_steer)
    assert world.x[row] > world.x[stands] + 10.0


def test_last_driver_of_all_lanes_looks_at_what_stands_beyond_its_lane() -> None:
    roads = wide_ring(2)
    world = world_of(roads)
    place = roads.at([roads.row("a1")], [5.0])[0][0]
    ego(world, float(place[0]), float(place[1]))
    car(world, "b1", float(roads.length[roads.row("b1")]) - 25.0, speed=10.0)
    with np.errstate(all="raise"):
        run(world, 1.0)


@pytest.mark.parametrize("gap", [4.0, 6.0, 9.0])
def test_driver_that_passes_a_crawling_car_need_not_brake(gap: float) -> None:
    """It braked with 7 m/s^2 in the middle of the change, since it had become too fast to be clear in time."""
    world = world_of(wide_road(2))
    car(world, "l0", 60.0 + gap, speed=0.6, desired_speed=0.6)
    row = car(world, "l0", 60.0 - CAR.length, speed=0.6, desired_speed=15.0)
    hardest = 0.0
    for _ in range(600):
        step(world)
        hardest = min(hardest, world.accel[row])
        assert not len(world.contacts)
    assert hardest > -1.0
    assert world.x[row] > 100.0


def test_driver_does_not_change_by_choice_into_a_lane_that_soon_joins_another() -> None:
    """It would get into the order of the vehicles there at the last moment, and brake hard."""
    roads = road_with_a_ramp()
    assert roads.derived(LaneConflicts).joins.join[1] >= 0
    world = world_of(roads)
    car(world, "left", 100.0, speed=12.0, desired_speed=12.0)
    row = car(world, "left", 50.0, speed=20.0)
    for _ in range(500):
        step(world)
        assert lane_of(world, row) == "left"


@pytest.mark.slow
def test_cars_pass_an_ego_that_stands_on_the_stretch_before_a_join() -> None:
    roads = road_with_a_ramp()
    joins = roads.derived(LaneConflicts).joins
    stands_at = 385.0
    assert joins.narrow_from[roads.row("right")] < stands_at - 40.0
    world = world_of(roads)
    ego(world, stands_at, 0.0)
    rows = [car(world, "right", 140.0 + 60.0 * i, speed=15.0, desired_speed=15.0) for i in range(3)]
    run(world, 25.0)
    assert (world.x[rows] > 400.0).all()


@pytest.mark.slow
def test_two_full_lanes_become_one() -> None:
    world = world_of(wide_road(2, (400.0, 1200.0), 20.0, ends_at=300.0))
    rows = [car(world, f"l{k}", 5.0 + 30.0 * i, speed=12.0) for k in range(2) for i in range(6)]
    run(world, 60.0)
    assert (world.x[rows] > 400.0).all()
    assert np.abs(world.y[rows]).max() < 0.01


@pytest.mark.slow
def test_driver_on_another_lane_comes_back_to_its_route() -> None:
    world = world_of(wide_road(3, (500.0, 500.0)))
    slow = car(world, "l2", 150.0, speed=6.0, desired_speed=6.0)
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=15.0))
    roads = world.roads
    route = [roads.row("l2"), roads.row("m2")]
    keep_lane(world, row, route[0], 110.0, route=route)
    lanes = []
    for _ in range(1200):
        step(world)
        assert not len(world.contacts)
        lanes.append(lane_of(world, row))
    assert "l1" in lanes  # past the slow one
    assert world.arc[slow] + 500.0 * (lane_of(world, slow) == "m2") < world.x[row]
    assert lanes[-1].startswith("m")


@pytest.mark.slow
def test_route_that_leaves_from_the_right_lane_is_reached_in_time() -> None:
    straight = [line(*[(x, -3.5 * k) for x in np.arange(0.0, 605.0, 10.0)]) for k in range(2)]
    roads = make(
        a=(straight[0], "x", 18.0),  # too slow to keep right for that alone
        b=(straight[1], "y", 18.0),
        x=(line((600, 0), (900, 0)), "", 20.0),
        y=(line((600, -3.5), (700, -40), (900, -120)), "", 20.0),
    )
    roads.left[:2], roads.right[:2] = [-1, 0], [1, -1]
    world = world_of(roads)
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=15.0))
    keep_lane(world, row, 1, 30.0, route=[1, 3])
    ego(world, 150.0, -3.5)  # it must leave its lane, and come back
    reasons = set()
    for _ in range(2500):
        step(world)
        reasons.add(LaneChange(int(world.change[row])))
    assert {LaneChange.AROUND, LaneChange.ROUTE} <= reasons
    assert (lane_of(world, row), world.turns[row]) == ("y", 1)


def test_driver_signals_before_and_while_it_changes_and_says_why() -> None:
    world = world_of(wide_road(2))
    ego(world, 100.0, 0.0)
    row = car(world, "l0", 20.0, speed=10.0, desired_speed=10.0)
    signals, leavings = [], []
    for _ in range(400):
        step(world)
        signals.append(int(world.signal[row]))
        leavings.append(int(world.leaving[row]))
        if world.leaving[row] and len(set(leavings)) == 2 and leavings.count(1) == 10:
            view = view_driver(world, row)
            assert view is not None
            assert (view.change.value, view.signal, view.is_changing) == (world.change[row], 2, True)
            assert view.change in {LaneChange.AROUND, LaneChange.FASTER}
    on, moves = signals.index(2), leavings.index(1)
    assert 75 <= moves - on <= 90
    assert signals[on : moves + 150] == [2] * (moves + 150 - on)
    assert (signals[-1], leavings[-1], lane_of(world, row)) == (0, 0, "l1")
    view = view_driver(world, row)
    assert view is not None
    assert (view.change, view.signal, view.is_changing) == (LaneChange.NONE, 0, False)


def test_driver_that_keeps_its_lane_waits_behind_an_ego() -> None:
    world = world_of(wide_road())
    ego(world, 60.0, -3.5)
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=8.0))
    keep_lane(world, row, world.roads.row("l1"), 30.0, changes_lanes=False, lateral=0.4)
    run(world, 12.0)
    assert (lane_of(world, row), world.speed[row]) == ("l1", 0.0)
    assert world.y[row] == pytest.approx(-3.1)


def test_driver_never_takes_the_lane_of_the_other_direction() -> None:
    world = world_of(make(a=(line((0, 0), (600, 0)), ""), b=(line((600, 3.5), (0, 3.5)), "")))
    ego(world, 100.0, 0.0)
    row = car(world, "a", 40.0)
    run(world, 45.0)  # longer than any of the waits after which a driver takes another way
    assert (lane_of(world, row), world.speed[row], world.y[row]) == ("a", 0.0, 0.0)


def test_lane_that_one_may_not_leave_is_kept() -> None:
    roads = wide_road(2)
    roads.right[:] = -1
    world = world_of(roads)
    ego(world, 60.0, 0.0)
    row = car(world, "l0", 30.0, speed=8.0)
    run(world, 12.0)
    assert (lane_of(world, row), world.speed[row]) == ("l0", 0.0)


def test_driver_keeps_right_on_a_fast_empty_road() -> None:
    world = world_of(wide_road(2))
    row = car(world, "l0", 20.0, speed=20.0)
    run(world, 8.0)
    assert lane_of(world, row) == "l1"
    slow_road = world_of(wide_road(2, limit=15.0))
    row = car(slow_road, "l0", 20.0, speed=15.0)
    run(slow_road, 8.0)
    assert lane_of(slow_road, row) == "l0"


def test_driver_keeps_off_the_lane_of_an_entry() -> None:
    roads = built_in("motorway").roads
    world = world_of(roads)
    row = car(world, "L3_04", 10.0, speed=25.0, desired_speed=25.0)
    run(world, 6.0)
    assert lane_of(world, row) == "L3_04"


@pytest.mark.slow
def test_snapshot_in_the_middle_of_changes_goes_on_with_the_same_bits() -> None:
    first, _ = crowd()
    while np.count_nonzero(first.leaving) < 2 or first.frame % 5 != 3:
        step(first)
    second = world_of(first.roads)
    second.restore(from_plain(to_plain(first.snapshot()), first.roads, first.signals.plan))
    assert first.digest() == second.digest()
    for frame in range(150):  # to the end of a change
        step(first)
        step(second)
        if frame % 50 == 7:
            second.touch()
    assert first.digest() == second.digest()


def test_snapshot_with_an_impossible_change_is_refused() -> None:
    world, rows = crowd(each=1)
    for name, value in (
        ("leaving", 3),
        ("came_from", 3),
        ("signal", 3),
        ("change", -1),
        ("change_since", -1),
        ("lateral_left", 1.5),
        ("lateral_bend", 1e5),
    ):
        saved = to_plain(world.snapshot())
        copy = World()
        copy.restore(world.snapshot())
        getattr(copy, name)[rows[0]] = value
        forged = copy.snapshot()
        saved["floats"], saved["ints"] = forged.floats, forged.ints
        with pytest.raises(ValueError, match=name):
            from_plain(saved, world.roads, world.signals.plan)


@pytest.mark.slow
def test_worlds_apart_in_one_are_as_each_alone() -> None:
    """Drivers that others are far from decide alike, how many ever are worked out at once, in rows with gaps or not."""
    alone = world_of(wide_road())
    holed = world_of(wide_road())
    for i in range(6):
        for world in (alone, holed):
            if world is holed:
                world.spawn(Kind.OBSTACLE, CAR, name="far", x=1e5 + 30.0 * i, y=1e5, uid=100 + i)
            row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=15.0, uid=i + 1))
            keep_lane(world, row, 1 + i % 2, 20.0 + 30.0 * i, desired_speed=20.0 - 2.0 * i)
    run(alone, 15.0)
    run(holed, 15.0)
    assert np.unique(alone.lane).tolist() != [1, 2]
    for uid in range(1, 7):
        one, other = alone.row(uid), holed.row(uid)
        for column in ("x", "y", "yaw", "speed", "accel", "lane", "arc", "lateral", "change_since"):
            assert getattr(alone, column)[one] == getattr(holed, column)[other], column


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [12, pytest.param(60, marks=pytest.mark.long)])
def test_nobody_touches_anybody_in_a_dense_ring(seconds: int) -> None:
    world, rows = crowd(seed=3, each=7)
    num, hardest, before = 0, 0.0, world.leaving.copy()
    for _ in range(seconds * 50):
        step(world)
        assert not len(world.contacts)
        hardest = min(hardest, float(world.accel[rows].min()))
        num += int(np.count_nonzero((before == 0.0) & (world.leaving > 0.0)))
        before = world.leaving.copy()
    assert num > 5
    assert -8.0 < hardest < 0.0
    assert hardest > -6.0


def test_driver_keeps_right_only_fifteen_seconds_after_its_last_change() -> None:
    world = world_of(wide_road(2))
    row = car(world, "l0", 50.0, speed=20.0)
    world.change_since[row] = -500.0  # frames: ten seconds ago
    run(world, 4.0)
    assert world.signal[row] == 0.0
    run(world, 3.0)
    assert world.signal[row] == 2.0
    assert LaneChange(int(world.change[row])) is LaneChange.KEEP_RIGHT


@pytest.mark.parametrize(
    ("came_from", "ahead", "seconds", "changes"),
    [
        (LEFT, 40.0, 9.0, False),  # a slower lead vehicle is no reason to go back at once
        (LEFT, 40.0, 14.5, True),
        (RIGHT, 40.0, 9.0, True),  # it does not go back
        (LEFT, 20.0, 9.0, True),  # it would have to brake firmly
        (LEFT, 30.0, 9.0, True),  # it would have to brake by more than 2 m/s^2
    ],
)
def test_driver_goes_back_to_the_lane_that_it_left_only_for_a_reason(
    came_from: int, ahead: float, seconds: float, *, changes: bool
) -> None:
    world = world_of(wide_road(2, limit=15.0))
    row = car(world, "l1", 50.0, speed=12.0, desired_speed=12.0)
    car(world, "l1", 50.0 + ahead, speed=8.0, desired_speed=8.0)
    world.came_from[row], world.change_since[row] = came_from + 1, -seconds / DT
    run(world, 1.4)
    assert (world.signal[row] == 1.0) == changes


@pytest.mark.parametrize("is_followed", [True, False])
def test_driver_waits_for_a_fast_one_that_is_three_lanes_behind_on_the_other_side(*, is_followed: bool) -> None:
    world = world_of(wide_road(2, (200.0, 30.0, 30.0, 30.0, 600.0)))
    row = car(world, "p1", 5.0, speed=5.0, desired_speed=20.0)
    car(world, "p1", 24.0, speed=3.0, desired_speed=3.0)
    if is_followed:
        car(world, "m0", 1.0, speed=25.0)
    signal(world, row, LaneChange.FASTER, LEFT, 2.0)
    run(world, 1.0)
    assert (world.leaving[row] > 0) != is_followed


def test_driver_remembers_the_side_that_it_came_from() -> None:
    world = world_of(wide_road(2))
    row = car(world, "l0", 20.0, speed=20.0)
    assert world.came_from[row] == 0
    run(world, 9.0)
    assert (lane_of(world, row), world.leaving[row], world.came_from[row]) == ("l1", 0, LEFT + 1)


def signal(world: World, row: int, reason: LaneChange, side: int, seconds_ago: float) -> None:
    """Have a driver signal for a change since some time."""
    world.change[row], world.signal[row], world.change_since[row] = reason, side + 1, -seconds_ago / DT


@pytest.mark.parametrize(("seconds", "brakes"), [(2.0, True), (28.0, True), (31.0, False), (58.0, False), (61.0, True)])
def test_driver_opens_a_gap_for_one_whose_lane_ends_in_30_of_60_seconds(seconds: float, *, brakes: bool) -> None:
    world = world_of(wide_road(2, (400.0, 1200.0), ends_at=300.0))
    waiting = car(world, "l1", 290.0)
    row = car(world, "l0", 260.0, speed=12.0, desired_speed=12.0)
    signal(world, waiting, LaneChange.LANE_END, LEFT, seconds)
    hardest = 0.0
    for _ in range(20):
        step(world)
        hardest = min(hardest, float(world.accel[row]))
    if brakes:
        assert -2.01 < hardest < -1.0
    else:
        assert hardest > -0.2


@pytest.mark.parametrize("is_ending", [True, False])
def test_driver_whose_lane_ends_slows_gently_for_the_vehicle_that_it_will_follow(*, is_ending: bool) -> None:
    world = world_of(wide_road(2, (400.0, 1200.0), ends_at=300.0 if is_ending else 0.0))
    car(world, "l0", 180.0, speed=8.0, desired_speed=8.0)
    row = car(world, "l1", 170.0, speed=12.0, desired_speed=12.0)
    hardest = 0.0
    for _ in range(80):
        step(world)
        hardest = min(hardest, float(world.accel[row]))
    if is_ending:
        assert -2.01 < hardest < -1.0
    else:
        assert hardest > -0.1


def test_driver_wishes_no_change_by_choice_within_eight_seconds_of_the_last() -> None:
    world = world_of(wide_road(2, limit=15.0))
    car(world, "l1", 100.0, speed=8.0, desired_speed=8.0)
    row = car(world, "l1", 50.0, speed=12.0)
    world.change_since[row] = -300.0  # frames: six seconds ago
    run(world, 1.9)
    assert world.signal[row] == 0.0
    run(world, 1.3)
    assert LaneChange(int(world.change[row])) is LaneChange.FASTER


@pytest.mark.parametrize(("seconds", "is_kept"), [(2.0, True), (5.2, False)])
def test_driver_gives_up_a_change_by_choice_after_six_seconds_without_a_gap(seconds: float, *, is_kept: bool) -> None:
    world = world_of(wide_road(2, limit=15.0))
    car(world, "l1", 80.0, speed=8.0, desired_speed=8.0)
    row = car(world, "l1", 55.0, speed=12.0)
    car(world, "l0", 52.0, speed=12.0, desired_speed=12.0)
    signal(world, row, LaneChange.FASTER, LEFT, seconds)
    run(world, 0.6)
    assert world.signal[row] == 1.0
    run(world, 1.2)
    assert bool(world.signal[row]) == is_kept


def test_driver_passes_one_that_has_been_stuck_behind_an_ego_for_eight_seconds() -> None:
    world = world_of(wide_road(2, limit=15.0))
    ego(world, 66.5, 0.0)
    stuck = world.row(world.spawn(Kind.VEHICLE, CAR, name="stuck", x=0.0, y=0.0))
    keep_lane(world, stuck, world.roads.row("l0"), 60.0, changes_lanes=False)
    row = car(world, "l0", 52.0)
    world.change_since[row] = -1.0  # so it changes by no choice for 8 s
    signal(world, stuck, LaneChange.AROUND, RIGHT, 6.0)
    run(world, 1.9)
    assert LaneChange(int(world.change[row])) is LaneChange.NONE
    run(world, 1.3)
    assert LaneChange(int(world.change[row])) is LaneChange.AROUND


@pytest.mark.parametrize("is_followed", [True, False])
def test_slow_driver_makes_way_to_the_right_for_one_behind_it(*, is_followed: bool) -> None:
    world = world_of(wide_road(2, limit=15.0))
    row = car(world, "l0", 100.0, speed=8.0, desired_speed=8.0)
    if is_followed:
        fast = world.row(world.spawn(Kind.VEHICLE, CAR, name="fast", x=0.0, y=0.0, speed=15.0))
        keep_lane(world, fast, world.roads.row("l0"), 70.0, changes_lanes=False)
    run(world, 3.0)
    assert (world.signal[row] == 2.0) == is_followed


def test_driver_beside_a_lane_keeps_more_room_to_what_may_stay() -> None:
    places = []
    for changes_lanes in (True, False):
        world = world_of(wide_road(2, limit=15.0))
        for y in (0.0, -3.5):  # nobody can pass
            ego(world, 80.0, y)
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=3.0))
        keep_lane(world, row, world.roads.row("l0"), 65.0, changes_lanes=changes_lanes)
        run(world, 7.0)
        assert world.speed[row] < 0.01
        places.append(float(world.x[row]))
    assert 0.5 < places[1] - places[0] < 1.0  # a metre more than the mean driver in a queue

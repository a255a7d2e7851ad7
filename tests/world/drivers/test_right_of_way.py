"""The right of way where lanes cross and join."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_model import GAP
from rosbridge_sim.world.followers.lane_following import DECISION, Stop, view_driver
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.drivers.test_claims_one_by_one import one_crossing
from tests.world.lane_drives import BUS, NOSE, lane_of, run, world_of
from tests.world.road_factory import CAR, arc, built_in, car, crossing, line, make, signalled

pytestmark = pytest.mark.usefixtures("loops")


@pytest.mark.parametrize("offset", [0.0, 3.0, 9.0, 20.0])
def test_crossing_vehicles_take_turns(offset: float) -> None:
    world = world_of(crossing())
    rows = [car(world, "w", 120.0, speed=12.0), car(world, "s", 120.0 - offset, speed=12.0)]
    run(world, 15.0)
    assert [lane_of(world, row) for row in rows] == ["e", "n"]


def test_nearer_vehicle_goes_first_without_braking() -> None:
    world = world_of(crossing())
    near = car(world, "w", 110.0, speed=12.0, desired_speed=12.0)
    far = car(world, "s", 70.0, speed=12.0, desired_speed=12.0)
    speeds = run(world, 13.0)
    assert speeds[:, near].min() > 11.5
    assert speeds[:, far].min() < 11.0


def first_across(order: str, behind: float, seed: int, *, desired_speed: float = math.inf) -> str:
    """The street of the driver that enters the crossing first; the one from the south comes from so much farther."""
    world = world_of(crossing(), seed=seed)
    begin = {"w": 120.0, "s": 120.0 - behind}
    rows = [car(world, lane, begin[lane], speed=12.0, desired_speed=desired_speed) for lane in order]
    for _ in range(1000):
        step(world)
        for row, lane in zip(rows, order, strict=True):
            if lane_of(world, row) != lane:
                return lane
    raise AssertionError("nobody has entered the crossing")


@pytest.mark.parametrize("order", ["ws", "sw"])
@pytest.mark.parametrize("behind", [5.0, 15.0])
def test_nearer_driver_goes_first_whoever_was_created_first_and_looks_farther_ahead(behind: float, order: str) -> None:
    assert [first_across(order, behind, seed) for seed in range(3)] == ["w"] * 3


@pytest.mark.parametrize("order", ["ws", "sw"])
def test_of_equally_near_drivers_the_one_from_the_right_goes_first(order: str) -> None:
    assert [first_across(order, 0.0, seed, desired_speed=12.0) for seed in range(3)] == ["s"] * 3


def test_four_drivers_that_are_equally_near_all_get_through() -> None:
    ways = {"e": (1, 0), "n": (0, 1), "w": (-1, 0), "s": (0, -1)}
    lanes = {}
    for name, (x, y) in ways.items():
        places = [(x * s + 1.75 * y, y * s - 1.75 * x) for s in (-150, -10, 10, 300)]
        for part, (start, end) in enumerate(pairwise(places)):
            lanes[f"{name}{part}"] = line(start, end), f"{name}{part + 1}" if part < 2 else ""
    world = world_of(make(**lanes))
    rows = [car(world, f"{name}0", 100.0, speed=10.0, desired_speed=10.0) for name in ways]
    run(world, 20.0)
    assert [lane_of(world, row) for row in rows] == [f"{name}2" for name in ways]


def test_crossing_streams_both_get_through() -> None:
    world = world_of(crossing())
    rows = [car(world, lane, 100.0 + 20.0 * i, speed=8.0) for i in range(4) for lane in ("w", "s")]
    run(world, 30.0)
    assert [lane_of(world, row) for row in rows] == ["e", "n"] * 4


def test_merging_lanes_are_entered_one_by_one() -> None:
    roads = make(
        a=(line((0, 0), (200, 0)), "c"),
        b=(line((0, -90), (150, -1.5), (200, 0)), "c"),
        c=(line((200, 0), (900, 0)), ""),
    )
    world = world_of(roads)
    rows = [car(world, lane, 80.0 + 20.0 * i, speed=10.0) for i in range(4) for lane in ("a", "b")]
    run(world, 40.0)
    assert {lane_of(world, row) for row in rows} == {"c"}


def test_vehicle_does_not_enter_a_crossing_that_it_cannot_leave() -> None:
    world = world_of(crossing())
    blocker = car(world, "e", 4.0, desired_speed=0.0)
    waiting = car(world, "w", 140.0, speed=10.0)
    crosses = car(world, "s", 100.0, speed=10.0)
    run(world, 14.0)
    assert (lane_of(world, waiting), lane_of(world, crosses)) == ("w", "n")
    world.remove(int(world.uid[blocker]))
    run(world, 10.0)
    assert lane_of(world, waiting) == "e"


@pytest.mark.parametrize(("spare", "lane"), [(-0.3, "w"), (0.3, "e")])
def test_vehicle_enters_a_crossing_with_room_for_itself_and_its_gap_behind(spare: float, lane: str) -> None:
    """Who enters without room for the gap comes to a stand with its tail on the crossing."""
    world = world_of(crossing())
    car(world, "e", CAR.rear_overhang + CAR.length + GAP + spare, desired_speed=0.0)
    row = car(world, "w", 160.0, speed=8.0)
    run(world, 11.0)
    assert lane_of(world, row) == lane


@pytest.mark.parametrize("first", ["w", "we", "e"])
@pytest.mark.parametrize(("spare", "may_enter"), [(-0.3, False), (0.3, True)])
def test_room_behind_a_crossing_is_reserved_for_entering_vehicles_with_their_gaps(
    spare: float, first: str, *, may_enter: bool
) -> None:
    world = world_of(one_crossing(first).roads)
    car(world, "e", CAR.rear_overhang + 2.0 * (CAR.length + GAP) + spare, desired_speed=0.0)
    rows = [car(world, "w", 176.0, speed=8.0), car(world, "w", 164.0, speed=8.0)]
    run(world, 4 * DECISION * DT)
    entered = world.roads.row("we")
    assert (world.claim[rows] == entered).tolist() == [True, may_enter]


@pytest.mark.parametrize(("spare", "may_enter"), [(-0.5, False), (0.5, True)])
def test_vehicle_that_drives_behind_a_crossing_leaves_the_room_of_two_seconds(spare: float, *, may_enter: bool) -> None:
    world = world_of(crossing())
    car(world, "e", CAR.rear_overhang + CAR.length + GAP - 2.0 * 3.0 + spare, speed=3.0, desired_speed=3.0)
    row = car(world, "w", 176.0, speed=8.0)
    run(world, DT)
    assert (world.claim[row] >= 0) == may_enter


def test_vehicle_avoids_a_full_street() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "b c"),
        b=(line((100, 0), (120, 0)), "d"),
        c=(arc(100, 15, 15, -90, 90), "e"),
        d=(line((120, 0), (220, 0)), ""),
        e=(line((115, 15), (115, 115)), ""),
        x=(line((110, -50), (110, 50)), ""),
    )
    for seed in range(2):
        world = world_of(roads, seed=seed)
        car(world, "d", 3.0, desired_speed=0.0)
        row = car(world, "a", 70.0, speed=8.0)
        run(world, 20.0)
        assert lane_of(world, row) == "e"
    world = world_of(roads)
    car(world, "d", 3.0, desired_speed=0.0)
    row = car(world, "a", 70.0, speed=8.0, route="a b d")
    run(world, 20.0)
    assert lane_of(world, row) == "a", "but not if he knows where he wants to go"


def red_runner(world: World, speed: float, distance: float) -> None:
    """An ego that comes from the south and stops for nothing; `distance` from the stop line [m]."""
    uid = world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=-10.0 - NOSE - distance, yaw=math.pi / 2, speed=speed)
    command(world, world.row(uid), mode=Mode.SPEED, steer=0.0, speed=speed)


@pytest.mark.parametrize(("speed", "distance"), [(10.0, 64.0), (10.0, 84.0), (14.0, 82.0), (14.0, 105.0)])
def test_drivers_with_green_brake_for_an_ego_that_runs_red(speed: float, distance: float) -> None:
    """Each of these was hit while drivers trusted their claims."""
    roads, plan = signalled(green=10_000)
    world = world_of(roads, plan)
    red_runner(world, speed, distance)
    rows = [car(world, "w", 170.0 - 28.0 * i, speed=13.0) for i in range(5)]
    run(world, 20.0)  # without a contact
    assert {lane_of(world, row) for row in rows} == {"e"}, "and they go on behind it"


def test_driver_that_cannot_stop_any_more_does_not_stop_in_the_way_of_the_ego() -> None:
    world = world_of(crossing())
    row = car(world, "w", 185.0, speed=14.0)
    red_runner(world, 10.0, 14.0)
    assert run(world, 3.0)[:, row].min() > 11.0


def test_ego_that_stops_at_its_red_light_slows_no_driver() -> None:
    roads, plan = signalled(green=10_000)
    world = world_of(roads, plan)
    row = car(world, "w", 100.0, speed=14.0, desired_speed=14.0)
    uid = world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=-60.0, yaw=math.pi / 2, speed=10.0)
    command(world, world.row(uid), mode=Mode.ACCEL, steer=0.0, accel=-1.3)
    assert run(world, 10.0)[:, row].min() > 13.5


def test_driver_that_gives_way_to_an_ego_in_the_crossing_says_so() -> None:
    world = world_of(crossing())
    row = car(world, "w", 150.0, speed=12.0)
    run(world, 0.5)
    assert world.claim[row] >= 0
    red_runner(world, 10.0, 16.0)
    run(world, 0.6)
    seen = view_driver(world, row)
    assert seen is not None
    assert (seen.stop, seen.rival) == (Stop.RIGHT_OF_WAY, row + 1)


def test_vehicle_avoids_a_crossing_in_which_something_stands() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "b c"),
        b=(line((100, 0), (120, 0)), "d"),
        c=(arc(100, 15, 15, -90, 90), "e"),
        d=(line((120, 0), (220, 0)), ""),
        e=(line((115, 15), (115, 115)), ""),
        x=(line((110, -50), (110, 50)), ""),
    )
    for seed in range(2):
        world = world_of(roads, seed=seed)
        world.spawn(Kind.OBSTACLE, Body.box(2.0, 2.0, 1.0), name="thing", x=118.5, y=0.0)
        row = car(world, "a", 70.0, speed=8.0)
        run(world, 20.0)
        assert lane_of(world, row) == "e"


def test_driver_behind_a_stop_line_waits_for_one_on_the_major_road_who_is_farther_away() -> None:
    world = World()
    world.lay_roads(built_in("roundabout").roads)
    minor = car(world, "EA", 125.0, speed=9.0, route="EA JWE FA")
    major = car(world, "NA", 285.0, speed=12.0, route="NA JNS SB")
    speeds = run(world, 15.0)
    assert speeds[:300, major].min() > 11.5
    assert speeds[:, minor].min() < 3.0
    assert [lane_of(world, row) for row in (minor, major)] == ["FA", "SB"]


def test_driver_keeps_its_claim_until_it_has_entered_when_another_crossing_is_near() -> None:
    world = World()
    world.lay_roads(built_in("roundabout").roads)
    row = car(world, "NB", 290.0, speed=12.0, route="NB IN GN CW GW OS SA")
    into = world.roads.row("IN")
    claims = []
    while lane_of(world, row) == "NB":
        step(world)
        claims.append(world.claim.item(row))
    first = claims.index(into)
    assert set(claims[first:-1]) == {into}


def test_driver_may_claim_the_last_lane_that_it_knows_and_reserves_no_room_behind_it() -> None:
    names = ["a", "b", "c", "d", "e"]
    short = {
        name: (line((6.0 * i - 40.0, 0), (6.0 * i - 34.0, 0)), [*names, "we"][i + 1]) for i, name in enumerate(names)
    }
    world = world_of(
        make(
            **short,
            we=(line((-10, 0), (10, 0)), "out"),
            out=(line((10, 0), (400, 0)), ""),
            sn=(line((0, -10), (0, 10)), ""),
        )
    )
    row = car(world, "a", 1.0, speed=12.0)
    run(world, DECISION * DT)
    assert (world.claim[row], world.exit_lane[row]) == (world.roads.row("we"), -1)


@pytest.mark.parametrize("lane", ["a", "b"])
def test_driver_holds_a_lane_that_another_one_crosses_in_its_middle_until_it_is_past(lane: str) -> None:
    world = world_of(make(a=(line((-80, 0), (80, 0)), ""), b=(line((0, -80), (0, 80)), "")))
    row, number, held = car(world, lane, 40.0, speed=8.0), world.roads.row(lane), list[tuple[float, bool]]()
    while world.arc[row] < 110.0:
        step(world)
        held.append((float(world.arc[row]), world.held.item(row) == number))
    assert all(is_held for arc, is_held in held if 78.0 < arc < 80.0)
    assert not any(is_held for arc, is_held in held if arc < 60.0 or arc > 100.0)


@pytest.mark.parametrize("first", ["we", "sn"])
def test_driver_gets_no_way_across_a_claimed_lane_whichever_lane_is_the_first_of_the_map(first: str) -> None:
    world = world_of(one_crossing(first).roads)
    claims = car(world, "w", 160.0, speed=8.0)
    run(world, DECISION * DT)
    assert world.claim[claims] == world.roads.row("we")
    asks = car(world, "s", 180.0, speed=5.0)
    run(world, DECISION * DT)
    assert (world.claim[claims], world.claim[asks]) == (world.roads.row("we"), -1)


@pytest.mark.parametrize(
    ("decision", "speed", "distance", "is_let_in"),
    [(0, 0.0, 1.9, True), (0, 0.05, 0.5, True), (100, 0.0, 1.9, False), (0, 0.15, 1.9, False), (0, 0.0, 2.1, False)],
)
def test_driver_that_stands_at_its_stop_line_is_let_in_now_and_then(
    decision: int, speed: float, distance: float, *, is_let_in: bool
) -> None:
    """Not before its eight seconds have come, not while it creeps, and not from 2 m away on."""
    roads = crossing()
    roads.is_stop[roads.row("s")] = True
    world = world_of(roads)
    minor = car(world, "s", 190.0 - NOSE - distance, speed=speed)
    major = car(world, "w", 150.0, speed=10.0)
    world.frame = DECISION * decision
    step(world)
    assert (world.claim[[minor, major]] >= 0).tolist() == [is_let_in, not is_let_in]


@pytest.mark.slow
def test_driver_at_a_stop_line_is_let_in_beside_a_full_road() -> None:
    """A side street stood for ten minutes beside a road on which one vehicle followed the other."""
    ids, ahead = ["w", "we", "e", "s", "sn", "n"], [[1], [2], [], [4], [5], []]
    lines = [line((-1500, 0), (-10, 0)), line((-10, 0), (10, 0)), line((10, 0), (900, 0))]
    lines += [line((0, -200), (0, -10)), line((0, -10), (0, 10)), line((0, 10), (0, 400))]
    world = world_of(Roads(ids, lines, ahead, [3.5] * 6, [12.0] * 6, is_stop=[False] * 3 + [True] + [False] * 2))
    for i in range(60):
        car(world, "w", 370.0 + 18.0 * i, speed=10.0)
    waiting = car(world, "s", 130.0, speed=5.0)
    run(world, 50.0)
    assert lane_of(world, waiting) == "n"
    assert (world.lane[world.has_lane] == world.roads.row("w")).any()


@pytest.mark.parametrize("body", [CAR, BUS])
@pytest.mark.parametrize("length", [2.0, 4.0])
def test_vehicle_longer_than_the_lanes_of_a_crossing_does_not_wait_for_itself(length: float, body: Body) -> None:
    ends = [-200.0, 0.0, length, 2.0 * length, 3.0 * length, 150.0]
    names = ["a", "b", "c", "d", "e"]
    lanes = {
        name: (line((ends[i], 0), (ends[i + 1], 0)), "".join(names[i + 1 : i + 2])) for i, name in enumerate(names)
    }
    across = {f"n{i}": (line((x, -100), (x, 100)), "") for i, x in enumerate([0.5 * length, 2.5 * length])}
    world = world_of(make(**lanes, **across))
    row = car(world, "a", 165.0, speed=8.0, body=body)
    crossing_it = [car(world, f"n{i}", s, speed=8.0) for i in range(2) for s in (35.0, 60.0)]
    run(world, 20.0)
    assert lane_of(world, row) == "e"
    assert all(world.arc[other] > 105.0 for other in crossing_it)


def bend() -> Roads:
    """The two directions of a road, 3.5 m apart, that turn by a right angle with radii of 8.5 and 12 m."""
    inner = np.concatenate([line((-60, 8.5)), arc(0, 0, 8.5, 90, -90), line((8.5, -60))])
    outer = np.concatenate([line((12, -60)), arc(0, 0, 12.0, 0, 90), line((-60, 12))])
    return make(inner=(inner, ""), outer=(outer, ""))


def test_cars_pass_each_other_in_a_tight_bend_of_a_road() -> None:
    alone, both = world_of(bend()), world_of(bend())
    rows = [car(world, "inner", 20.0, speed=8.0) for world in (alone, both)]
    other = car(both, "outer", 20.0, speed=8.0)
    run(alone, 12.0)
    run(both, 12.0)
    assert both.arc[rows[1]] == alone.arc[rows[0]] > 90.0
    assert both.arc[other] > 90.0


@pytest.mark.parametrize(("bus", "second"), [("inner", "outer"), ("outer", "inner")])
def test_car_and_bus_use_a_tight_bend_of_a_road_in_turn(bus: str, second: str) -> None:
    alone, both = world_of(bend()), world_of(bend())
    row = car(alone, second, 20.0, speed=8.0)
    car(both, bus, 35.0, speed=8.0, body=BUS)
    other = car(both, second, 20.0, speed=8.0)
    run(alone, 8.0)
    run(both, 8.0)
    assert both.arc[other] < alone.arc[row] - 10.0
    run(both, 12.0)
    assert both.arc[other] > 90.0


@pytest.mark.parametrize(("length", "stops"), [(CAR.length, False), (12.0, True)])
def test_car_gives_way_in_a_tight_bend_to_an_oncoming_ego_that_is_long(length: float, *, stops: bool) -> None:
    world = world_of(bend())
    row = car(world, "inner", 45.0, speed=5.0)
    body = Body(length, CAR.width, CAR.height)
    uid = world.spawn(Kind.EGO, body, name="ego", x=12.0, y=-4.0, yaw=0.5 * math.pi, speed=4.0)
    command(world, world.row(uid), mode=Mode.ACCEL, steer=0.0, accel=0.0)
    step(world)
    view = view_driver(world, row)
    assert view is not None
    assert (view.stop is Stop.RIGHT_OF_WAY) == stops

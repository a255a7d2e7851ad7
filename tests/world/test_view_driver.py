"""`view_driver`: the reasons of a driver, where they can be seen at a glance."""

from __future__ import annotations

import math

import pytest

from rosbridge_sim.world.drivers.driver_model import STOP_GAP
from rosbridge_sim.world.followers.lane_following import DriverView, Stop, view_driver
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.drivers.test_claims_one_by_one import one_crossing
from tests.world.lane_drives import NOSE, lane_of, run, to_line, world_of
from tests.world.road_factory import CAR, car, crossing, ego, keep_lane, line, make, road, signalled

pytestmark = pytest.mark.usefixtures("loops")


def view(world: World, row: int) -> DriverView:
    """The view of the driver; it is asked for twice, and the world must not change."""
    before = world.digest()
    seen = view_driver(world, row)
    assert seen is not None
    assert view_driver(world, row) == seen
    assert world.digest() == before
    return seen


def test_driver_alone_follows_nothing_and_stops_for_nothing() -> None:
    world = world_of(road())
    row = car(world, "a", 10.0, speed=10.0)
    assert view(world, row) == DriverView(
        lead=-1,
        gap=math.inf,
        is_following=False,
        stop=Stop.NONE,
        stop_distance=math.inf,
        stop_lane=-1,
        light=-1,
        rival=-1,
    )


def test_what_follows_no_lane_is_no_driver() -> None:
    world = world_of(road())
    assert view_driver(world, ego(world, 0.0, 0.0)) is None
    waiting = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=7.0))
    keep_lane(world, waiting, 0, 30.0, start_within=25.0)
    assert view_driver(world, waiting) is None


def test_driver_behind_a_slower_one_follows_it_with_its_gap() -> None:
    world = world_of(road(length=3000.0, limit=20.0))
    far = car(world, "a", 2900.0, speed=10.0)
    slow = car(world, "a", 200.0, desired_speed=10.0, speed=10.0)
    fast = car(world, "a", 120.0, speed=15.0)
    run(world, 20.0)
    seen = view(world, fast)
    assert (seen.lead, seen.is_following) == (slow, True)
    assert seen.gap == pytest.approx(world.arc[slow] - CAR.rear_overhang - world.arc[fast] - NOSE)
    assert not view(world, slow).is_following
    assert view(world, slow).lead in {far, -1}


@pytest.mark.parametrize("kind", [Kind.EGO, Kind.PEDESTRIAN, Kind.OBSTACLE])
def test_driver_names_what_stands_in_its_way_on_any_lane_ahead(kind: Kind) -> None:
    roads = make(a=(line((0, 0), (50, 0)), "b"), b=(line((50, 0), (70, 0)), "c"), c=(line((70, 0), (300, 0)), ""))
    world = world_of(roads)
    car(world, "c", 200.0, desired_speed=0.0)
    body = CAR if kind == Kind.EGO else Body.box(0.5, 0.5, 1.7)
    thing = world.row(world.spawn(kind, body, name="thing", x=80.0, y=0.5))
    row = car(world, "a", 5.0, speed=8.0)
    run(world, 15.0)
    seen = view(world, row)
    assert (seen.lead, seen.is_following) == (thing, True)
    assert 0.0 < seen.gap < 5.0


def test_driver_at_a_red_light_names_it_and_its_lane() -> None:
    roads, plan = signalled(green=500)
    world = world_of(roads, plan)
    row = car(world, "s", 100.0, speed=14.0)
    run(world, 8.0)
    seen = view(world, row)
    assert (seen.stop, roads.ids[seen.stop_lane], plan.lights[seen.light].name) == (Stop.LIGHT, "sn", "north")
    assert seen.stop_distance == pytest.approx(to_line(world, row))
    assert seen.stop_distance >= STOP_GAP / 2


def test_driver_at_a_red_light_names_its_lane_also_if_that_is_the_first_one_of_the_map() -> None:
    roads = one_crossing("sn").roads
    red = Controller("c", 1, ((0,),), (Phase(10, (int(Lamp.RED),)),), (0,))
    world = world_of(roads, SignalPlan(roads, [Light("north", lanes=(0,))], [red]))
    row = car(world, "s", 160.0, speed=8.0)
    run(world, 5.0)
    seen = view(world, row)
    assert (seen.stop, seen.stop_lane, seen.light) == (Stop.LIGHT, 0, 0)


def test_driver_that_may_cross_and_stops_at_a_light_behind_the_crossing_names_the_light() -> None:
    roads = one_crossing("w").roads
    red = Controller("c", 1, ((0,),), (Phase(10, (int(Lamp.RED),)),), (0,))
    world = world_of(roads, SignalPlan(roads, [Light("behind", lanes=(roads.row("e"),))], [red]))
    row = car(world, "w", 190.0 - NOSE - 15.0, speed=10.0)
    seen = view(world, row)
    assert (seen.stop, roads.ids[seen.stop_lane], seen.rival) == (Stop.LIGHT, "e", -1)
    assert seen.stop_distance == pytest.approx(35.0)


def test_driver_at_the_end_of_the_road_says_so() -> None:
    world = world_of(road(length=200.0))
    row = car(world, "a", 100.0, speed=10.0)
    run(world, 20.0)
    seen = view(world, row)
    assert (seen.stop, world.roads.ids[seen.stop_lane], seen.light) == (Stop.END, "a", -1)


def test_driver_at_the_end_of_the_road_says_so_behind_an_ego_that_still_moves() -> None:
    world = world_of(road(length=200.0))
    ego(world, 50.0, 0.0, speed=5.0)
    row = car(world, "a", 190.0, speed=5.0)
    assert view(world, row).stop is Stop.END


def test_driver_that_gives_way_names_who_has_the_right_of_way() -> None:
    world = world_of(crossing())
    first = car(world, "w", 150.0, speed=10.0)
    second = car(world, "s", 140.0, speed=10.0)
    seen = []
    for _ in range(100):
        run(world, 0.1)
        seen.append(view(world, second))
    waits = [each for each in seen if each.stop is Stop.RIGHT_OF_WAY]
    assert {each.rival for each in waits} == {first}
    assert {world.roads.ids[each.stop_lane] for each in waits} == {"sn"}
    assert lane_of(world, second) != "s"


def test_driver_before_a_full_street_waits_for_room() -> None:
    world = world_of(crossing())
    for i in range(3):
        car(world, "e", 2.0 + 6.0 * i, desired_speed=0.0)
    row = car(world, "w", 140.0, speed=8.0)
    run(world, 15.0)
    seen = view(world, row)
    assert (seen.stop, world.roads.ids[seen.stop_lane]) == (Stop.NO_ROOM, "we")


def test_driver_names_the_vehicle_ahead_also_if_it_is_the_first_one_of_all() -> None:
    world = world_of(road())
    lead, row = car(world, "a", 60.0, speed=5.0), car(world, "a", 45.0, speed=8.0)
    assert (lead, view(world, row).lead) == (0, 0)


def test_driver_does_not_mention_a_light_far_ahead() -> None:
    roads, plan = signalled(green=3000)
    world = world_of(roads, plan)
    row = car(world, "s", 10.0, speed=5.0)
    assert view(world, row).stop is Stop.NONE


def test_driver_that_gives_way_at_a_green_light_names_no_light() -> None:
    roads, plan = signalled(green=3000)
    world = world_of(roads, plan)
    left_behind = car(world, "sn", 12.0, desired_speed=0.0)
    world.held[left_behind] = roads.row("sn")
    row = car(world, "w", 180.0, speed=3.0)
    run(world, 4.0)
    seen = view(world, row)
    assert (seen.stop, seen.rival, seen.light) == (Stop.RIGHT_OF_WAY, left_behind, -1)


def test_question_what_a_driver_does_changes_nothing() -> None:
    world = world_of(crossing())
    rows = [car(world, lane, 185.0, speed=8.0) for lane in ("w", "s")]
    before = world.digest()
    for row in rows:
        view(world, row)
    assert world.digest() == before

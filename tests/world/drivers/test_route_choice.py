"""Routes, and the chance that chooses where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.drivers.route_choice import RouteChoice
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.step import step
from tests.world.lane_drives import lane_of, world_of
from tests.world.road_factory import CAR, arc, car, keep_lane, line, make, ring
from tests.world.wide_roads import wide_ring

pytestmark = pytest.mark.usefixtures("loops")


def ways(others: int = 0) -> str:
    """The first four lanes that somebody comes through, in at most forty seconds."""
    world = world_of(ring())
    row = car(world, "a", 1.0, speed=10.0)
    for i in range(others):
        car(world, "d", 5.0 + 15.0 * i, speed=5.0)
    seen = "a"
    for _ in range(2000):
        step(world)
        seen += lane_of(world, row) if lane_of(world, row) != seen[-1] else ""
        if len(seen) == 4:
            break
    return seen


def planned(seed: int, roads: Roads) -> str:
    """The lanes that he has in mind at the start."""
    world = world_of(roads, seed=seed)
    row = car(world, "a", 1.0)
    return "".join(world.roads.ids[lane] for lane in world.int_block("lane", "ahead_5")[:, row])


def test_random_choices_depend_only_on_the_seed() -> None:
    roads = ring()
    assert ways() == ways(others=2) == planned(0, roads)[:4]
    assert len({planned(seed, roads) for seed in range(20)}) == 4, "two choices in five lanes"
    assert planned(2**70, roads) == planned(2**70, ring())


def test_route_is_followed_and_random_choices_go_on_after_it() -> None:
    world = world_of(ring())
    row = car(world, "a", 50.0, speed=12.0, route="a c e a b d")
    seen = "a"
    while len(seen) < 7:
        step(world)
        seen += lane_of(world, row) if lane_of(world, row) != seen[-1] else ""
    assert seen == "aceabda"


def test_route_can_repeat() -> None:
    world = world_of(ring())
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=5.0))
    keep_lane(world, row, 0, 1.0, route=[0, 2, 4], is_loop=True)
    seen = "a"
    while len(seen) < 7:
        step(world)
        seen += lane_of(world, row) if lane_of(world, row) != seen[-1] else ""
    assert seen == "aceacea"


def test_route_of_one_lane_can_repeat() -> None:
    world = world_of(make(a=(arc(0, 0, 30.0, 0.0, 360.0), "a b"), b=(line((30, 0), (30, 50)), "")))
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
    keep_lane(world, row, 0, 1.0, route=[0], is_loop=True)
    choice, same, turns = RouteChoice(world, np.array([row])), np.zeros(6, dtype=np.int64), np.arange(6)
    assert choice.choose(same, same, turns).tolist() == [0] * 6
    assert choice.find_wanted(same, turns).tolist() == [0] * 6


def next_of_route(route: list[int], lane: int, turn: int, *, is_loop: bool) -> int:
    """The lane that follows by a route on the woven ring of three lanes; -2 where the route says nothing.

    A driver beside its route takes, of the lanes that follow, the one nearest to the next one of the route.
    """
    index = turn % len(route) if is_loop else turn
    if index >= len(route):
        return -2
    if lane == route[index - 1]:
        return route[index]
    half, place = divmod(route[index], 3)
    following = [other for other in range(6) if other // 3 != lane // 3 and abs(other % 3 - lane % 3) <= 1]
    there = [other for other in following if lane >= 0 and other // 3 == half]
    return min(there, key=lambda other: abs(other % 3 - place), default=-1)


@pytest.mark.parametrize("seed", range(3))
def test_route_leads_also_those_that_are_on_a_lane_beside_it(seed: int) -> None:
    rng, world, routes = np.random.default_rng(seed), world_of(wide_ring(is_woven=True)), []
    for i in range(12):
        route = [int(rng.integers(0, 6))]
        while len(route) < i % 5 + 1 + i % 2:
            route.append(int(rng.choice(world.roads.successors(route[-1]))))
        is_loop = route[0] in world.roads.successors(route[-1])
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0))
        keep_lane(world, row, route[0], 10.0, route=route, is_loop=is_loop)
        routes.append((route, is_loop))
    without = car(world, "a1", 10.0)
    choice = RouteChoice(world, np.arange(without + 1))
    which, lane, turn = rng.integers(0, 13, 200), rng.integers(-1, 6, 200), rng.integers(0, 9, 200)
    chosen, wanted = choice.choose(which, lane, turn).tolist(), choice.find_wanted(which, turn).tolist()
    for i, here, number, found, of_route in zip(
        *(c.tolist() for c in (which, lane, turn)), chosen, wanted, strict=True
    ):
        route, is_loop = routes[i] if i < without else ([], False)
        expected = next_of_route(route, here, number, is_loop=is_loop)
        if expected == -2:
            assert found in (world.roads.successors(here) if here >= 0 else [-1])
            assert of_route == -1
        else:
            assert found == expected
            assert of_route == (route * 9)[number]
    assert any(is_loop for _, is_loop in routes)


def test_nothing_follows_beyond_a_dead_end_whatever_the_route_says() -> None:
    world = world_of(ring())
    row = car(world, "a", 1.0, route="a c e a")
    choice = RouteChoice(world, np.array([row]))
    assert choice.choose(np.array([0, 0]), np.array([-1, 0]), np.array([1, 1])).tolist() == [-1, 2]


def test_driver_that_chooses_anew_has_other_lanes_ahead_unless_it_has_a_route() -> None:
    world = world_of(ring())
    free, bound = car(world, "a", 1.0), car(world, "a", 30.0, route="a c e")
    choice, seen = RouteChoice(world, np.array([free, bound])), set()
    kept = world.int_block("lane", "ahead_5")[:, bound].tolist()
    for i in range(12):
        choice.change(np.array([0, 1]))
        lanes = world.int_block("lane", "ahead_5")[:, free]
        seen.add(int(lanes[1]))
        assert lanes.tolist() == choice.preview(np.array([0]), lanes[:1])[:, 0].tolist()
        assert world.turns[[free, bound]].tolist() == [6 * (i + 1), 0]
    assert seen == {1, 2}
    assert world.int_block("lane", "ahead_5")[:, bound].tolist() == kept

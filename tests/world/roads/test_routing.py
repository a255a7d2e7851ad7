"""Routes along the lanes: the shortest, with its points, and none where none leads."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest

from rosbridge_sim.world.roads import routing
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.routing import KnownRoutes, Route, find_route, route_points
from tests.world.road_factory import built_in, crossing, line, make, ring


def brute_force(roads: Roads, start: int, s: float, goal: int, goal_s: float) -> float:
    """The length of the shortest way by relaxing all lanes again and again."""
    if start == goal and goal_s >= s:
        return goal_s - s
    at_begin = np.full(len(roads), math.inf)
    for following in roads.successors(start):
        at_begin[following] = roads.length[start] - s
    for _ in range(len(roads)):
        for lane in range(len(roads)):
            for following in roads.successors(lane):
                at_begin[following] = min(at_begin[following], at_begin[lane] + roads.length[lane])
    return float(at_begin[goal] + goal_s)


def test_route_takes_the_shorter_of_two_ways() -> None:
    roads = ring()
    route = find_route(roads, roads.row("a"), 10.0, roads.row("a"), 5.0)
    assert route is not None
    assert [roads.ids[lane] for lane in route.lanes] == ["a", "b", "d", "a"]
    assert route.length == pytest.approx(brute_force(roads, 0, 10.0, 0, 5.0))


def test_goal_ahead_on_the_same_lane_is_one_lane_and_behind_is_none_on_a_dead_end() -> None:
    roads = make(a=(line((0, 0), (100, 0)), ""))
    assert find_route(roads, 0, 10.0, 0, 30.0) == Route((0,), 10.0, 30.0, 20.0)
    assert find_route(roads, 0, 30.0, 0, 10.0) is None
    assert find_route(crossing(), 0, 0.0, 5, 0.0) is None  # from the west to the north: nobody turns there


def test_routes_of_the_town_are_the_shortest_and_follow_successors() -> None:
    roads = built_in("town").roads
    chance = np.random.default_rng(3)
    for _ in range(8):
        start, goal = chance.integers(len(roads), size=2).tolist()
        s, goal_s = 0.4 * float(roads.length[start]), 0.7 * float(roads.length[goal])
        route = find_route(roads, start, s, goal, goal_s)
        wanted = brute_force(roads, start, s, goal, goal_s)
        assert (math.inf if route is None else route.length) == pytest.approx(wanted)
        if route is None:
            continue
        assert (route.lanes[0], route.lanes[-1]) == (start, goal)
        for here, there in zip(route.lanes, route.lanes[1:], strict=False):
            assert there in roads.successors(here)


def test_points_run_from_start_to_goal_along_the_lanes() -> None:
    roads = crossing()
    route = find_route(roads, roads.row("w"), 50.0, roads.row("e"), 100.0)
    assert route is not None
    points = route_points(roads, route)
    assert points[:, 0].tolist() == pytest.approx([-150.0, -10.0, 10.0, 110.0])
    assert not points[:, 1:].any()
    assert route.length == 260.0
    assert len(route_points(roads, Route((0,), 20.0, 20.0, 0.0))) == 1


def test_long_route_leaves_points_out_but_neither_the_first_nor_the_last() -> None:
    roads = built_in("loop").roads
    route = find_route(roads, 0, 20.0, 0, 10.0)
    assert route is not None
    whole, thin = route_points(roads, route), route_points(roads, route, most=7)
    assert 4 <= len(thin) <= 7
    assert thin[0].tolist() == whole[0].tolist()
    assert thin[-1].tolist() == whole[-1].tolist()


def city(num: int) -> Roads:
    """A grid of streets with `num` crossings on each side, both ways."""
    places = [(i, j) for i in range(num) for j in range(num)]
    names: dict[str, tuple[tuple[int, int], tuple[int, int]]] = {}
    for i, j in places:
        for there in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if there in places:
                names[f"{(i, j)}-{there}"] = ((i, j), there)
    starts: dict[tuple[int, int], list[int]] = {}
    for row, (start, _) in enumerate(names.values()):
        starts.setdefault(start, []).append(row)
    lines = [line((100.0 * a, 100.0 * b), (100.0 * c, 100.0 * d)) for (a, b), (c, d) in names.values()]
    successors = [starts[end] for _, end in names.values()]
    return Roads(list(names), lines, successors, [3.5] * len(names), [10.0] * len(names))


def test_search_looks_at_each_lane_a_few_times_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    roads = city(12)
    num = 0
    pop = heapq.heappop

    def counted(heap: list[tuple[float, int]]) -> tuple[float, int]:
        nonlocal num
        num += 1
        return pop(heap)

    monkeypatch.setattr(heapq, "heappop", counted)
    route = find_route(roads, 0, 0.0, len(roads) - 1, 0.0)
    assert route is not None
    assert num <= 2 * len(roads)


def test_kept_routes_are_the_same_and_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(routing, "MAX_KNOWN_LANES", 3)
    roads = crossing()
    known = roads.derived(KnownRoutes)
    for goal in (30.0, 31.0, 30.0, 32.0, 33.0, 30.0):
        assert known.find(0, 10.0, 0, goal) == find_route(roads, 0, 10.0, 0, goal)
        assert len(known._found) <= 3
    assert known.find(0, 10.0, 0, 30.0) is known.find(0, 10.0, 0, 30.0)

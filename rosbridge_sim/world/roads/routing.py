"""Routes: the shortest way along the lanes from one place to another.

A route goes from lane to successor. It never changes to a lane beside, because no driver of this world does: a vehicle
can follow each route that is found. The search is Dijkstra's over the lanes, with their lengths as costs. Of equally
long ways it takes the one that it finds first, in the map's order, so the result depends on the map alone.

Roads not taken: a search in numpy, front by front, is ten times as slow on a chain of lanes, and no faster on a city of
10,000 lanes, where this one takes 2 to 5 ms. A search from both ends halves that, and doubles the code.
"""

from __future__ import annotations

import heapq
import math
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads

MAX_ROUTE_POINTS: Final = 10_000
"""Points of a route that are given at most: 5 km with a point each half metre; a longer route leaves points out."""

MAX_KNOWN_LANES: Final = 500_000
"""Lanes of all routes that are kept for a map: about 20 MB, a thousand ways across a large city."""


class Route(Record):
    """A way along lanes.

    Attributes:
        lanes: rows of the lanes, each a successor of the one before. One alone where the goal lies ahead on the first.
        start: arc length on the first lane at which it begins [m].
        goal: arc length on the last lane at which it ends [m].
        length: of the whole way, in the plane [m].
    """

    lanes: tuple[int, ...]
    start: float
    goal: float
    length: float


def find_route(roads: Roads, start_lane: int, start: float, goal_lane: int, goal: float) -> Route | None:
    """Return the shortest way from a place on a lane to another one.

    Args:
        start_lane: row of the lane to begin on.
        start: arc length on it [m].
        goal_lane: row of the lane to end on.
        goal: arc length on it [m].

    Returns:
        The way; None where none leads there.
    """
    if start_lane == goal_lane and goal >= start:
        return Route((start_lane,), start, goal, goal - start)
    graph = roads.derived(_Graph)
    length, successors = graph.length, graph.successors
    best = [math.inf] * len(length)
    before = [-1] * len(length)
    # An entry is the way driven at the end of a lane, and the lane. The start is no entry of `best`: a way may come
    # back to its lane from behind.
    ahead = [(length[start_lane] - start, start_lane)]
    is_first = True
    while ahead:
        driven, lane = heapq.heappop(ahead)
        if lane == goal_lane and not is_first:
            break
        if not is_first and driven > best[lane]:
            continue
        is_first = False
        for following in successors[lane]:
            then = driven + length[following]
            if then < best[following]:
                best[following], before[following] = then, lane
                heapq.heappush(ahead, (then, following))
    else:
        return None
    lanes = [goal_lane]
    while (lane := before[lanes[-1]]) != start_lane:
        lanes.append(lane)
    lanes.append(start_lane)
    lanes.reverse()
    return Route(tuple(lanes), start, goal, best[goal_lane] - length[goal_lane] + goal)


def route_points(roads: Roads, route: Route, most: int = MAX_ROUTE_POINTS) -> FloatArray:
    """Return the line of a route: the points of its lanes, from its start to its goal.

    Args:
        route: from `find_route`.
        most: points at most, 2 or more. Of more points each second, third, ... is given, and always the last.

    Returns:
        (k, 3) east, north, up, without points that repeat the one before [m].
    """
    parts = []
    last = len(route.lanes) - 1
    ends, _ = roads.at([route.lanes[0], route.lanes[-1]], [route.start, route.goal])
    for i, lane in enumerate(route.lanes):
        rows = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
        s = roads.s[rows]
        is_within = ((s > route.start) | (i > 0)) & ((s < route.goal) | (i < last))
        parts.append(roads.points[rows][is_within])
    points = np.concatenate([ends[:1], *parts, ends[1:]])
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = (points[1:] != points[:-1]).any(axis=1)
    points = points[is_new]
    if len(points) > most:
        stride = -(-(len(points) - 1) // (most - 1))
        points = np.concatenate([points[:-1:stride], points[-1:]])
    return points


class KnownRoutes:
    """Routes that were looked for on one map, so that none is looked for twice; get it by `roads.derived(KnownRoutes)`.

    Any thread may use it.
    """

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        self._found: dict[tuple[int, float, int, float], Route | None] = {}
        self._num_lanes = 0

    def find(self, start_lane: int, start: float, goal_lane: int, goal: float) -> Route | None:
        """Return the shortest way from a place on a lane to another one; see `find_route`.

        Args:
            start_lane: row of the lane to begin on.
            start: arc length on it [m].
            goal_lane: row of the lane to end on.
            goal: arc length on it [m].
        """
        key = start_lane, start, goal_lane, goal
        if key in (found := self._found):
            return found[key]
        route = find_route(self._roads, *key)
        num = 1 if route is None else len(route.lanes)
        if self._num_lanes + num > MAX_KNOWN_LANES:
            self._found, self._num_lanes = {}, 0
        self._num_lanes += num
        self._found[key] = route
        return route


class _Graph:
    """The lanes as lists, which a search in Python reads faster than arrays."""

    def __init__(self, roads: Roads) -> None:
        self.length: list[float] = roads.length.tolist()
        borders, successor = roads.first_successor.tolist(), roads.successor.tolist()
        self.successors: list[list[int]] = [successor[borders[i] : borders[i + 1]] for i in range(len(roads))]

"""Distances between the actors of a story, in the ways that OpenSCENARIO has for them.

Along and aside are those of the measuring entity: ahead and to the left are positive. With the coordinate system
`entity` they are measured along its heading, with `road` and `lane` along the lanes that it would drive on. Free space
is the distance between the boxes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.openscenario.places import MapPlace, OnLane, predecessors
from rosbridge_sim.scenarios.openscenario.story_items import StoryItem
from rosbridge_sim.simulator.story.cast import Cast, StoryActor
from rosbridge_sim.world.geometry.planar import box_at, nearest_on_polyline
from rosbridge_sim.world.state.world import Body

REACH: Final = 1_000.0
"""So far along the lanes, ahead and behind, places are looked for [m]."""

MAX_LANES: Final = 200
"""Most lanes that are looked at, for one distance."""

MAX_KEPT: Final = 1_000
"""Most lanes of which the lanes around are kept."""

TOUCHES: Final = 1e-6
"""A difference that is rounding [m]."""

MAX_ASIDE: Final = 50.0
"""A place farther beside the lanes than this is not along them [m]."""


class Measures:
    """Measures distances of one cast."""

    def __init__(self, cast: Cast, bodies: Mapping[str, Body]) -> None:
        self._cast = cast
        self._bodies = bodies
        self._around: dict[tuple[int, tuple[int, ...]], list[tuple[int, float]]] = {}

    def to_entity(self, name: str, other: str, item: StoryItem) -> float:
        """Return a distance as a condition asks for it [m]: behind is negative, where it is measured along."""
        kind, system = _way_of(item)
        there = self._cast.find(other)
        is_free = item.get("freespace", False)
        if kind == "longitudinal":
            return self.free_along(name, other, system) if is_free else self.along(name, other, system)
        if kind == "lateral":
            aside = abs(self.aside(name, other, system))
            return max(aside - self.half_widths(name, other), 0.0) if is_free else aside
        if is_free:
            return _between(self._box(name), self._box(other))
        here = self._cast.find(name)
        return math.dist((here.x, here.y), (there.x, there.y))

    def to_place(self, name: str, place: MapPlace, item: StoryItem) -> float:
        """Return a distance to a place as a condition asks for it [m]."""
        kind, system = _way_of(item)
        here, body = self._cast.find(name), self._bodies[name]
        is_free = item.get("freespace", False)
        if kind not in {"longitudinal", "lateral"}:
            if is_free:
                return _between(self._box(name), [(place.x, place.y)])
            return math.dist((here.x, here.y), (place.x, place.y))
        along, aside = self._relative(here, place, system)
        if kind == "lateral":
            return max(abs(aside) - 0.5 * body.width, 0.0) if is_free else abs(aside)
        if is_free:
            front, rear = body.length - body.rear_overhang, body.rear_overhang
            return max(along - front, 0.0) if along >= 0.0 else min(along + rear, 0.0)
        return along

    def along(self, name: str, other: str, system: str) -> float:
        """Return how far ahead another entity's reference point is [m]."""
        return self._relative(self._cast.find(name), self._cast.find(other).place, system)[0]

    def aside(self, name: str, other: str, system: str) -> float:
        """Return how far to the left another entity's reference point is [m]."""
        here, there = self._cast.find(name), self._cast.find(other)
        # Within a frame an action may have shifted the other one already.
        is_on = system != "entity" and there.lane >= 0
        return self._relative(here, self._cast.map.at(there.on_lane) if is_on else there.place, system)[1]

    def free_along(self, name: str, other: str, system: str) -> float:
        """Return the free way to another entity [m]: negative behind; 0 beside."""
        if system != "entity":
            gap = self.along(name, other, system)
            ahead = 1.0 if gap >= 0.0 else -1.0
            return ahead * max(abs(gap) - self.half_lengths(name, other, ahead), 0.0)
        here = self._cast.find(name)
        front, rear = self._ends(name)
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        ways = [(x - here.x) * cos + (y - here.y) * sin for x, y in self._box(other)]
        if min(ways) > front:
            return min(ways) - front
        return max(ways) + rear if max(ways) < -rear else 0.0

    def half_lengths(self, name: str, other: str, ahead: float) -> float:
        """Return the distance of reference points at which the boxes touch, one behind the other [m].

        Args:
            ahead: 1 if the other is ahead, -1 if it is behind.
        """
        (front, rear), (other_front, other_rear) = self._ends(name), self._ends(other)
        return front + other_rear if ahead > 0.0 else rear + other_front

    def half_widths(self, name: str, other: str) -> float:
        """Return the distance of reference points at which the boxes touch, side by side [m]."""
        return 0.5 * (self._bodies[name].width + self._bodies[other].width)

    def between_lanes(self, actor: StoryActor, reference: StoryActor) -> float:
        """Return how far the line of another actor's lane is to the left of the line of the own lane [m]."""
        middle = self._cast.map.at(OnLane(reference.lane, reference.s, 0.0))
        found = self._on_lanes(actor, middle)
        if found is None:
            raise DocumentError("the lanes do not lie beside each other")
        return found[1] + actor.offset

    def way_to(self, name: str, place: MapPlace) -> float:
        """Return the way to a place along the lanes, or the straight one where no lane leads there [m]."""
        actor = self._cast.find(name)
        found = self._on_lanes(actor, place)
        if found is not None:
            return found[0] * actor.direction
        return math.dist((actor.x, actor.y), (place.x, place.y))

    def _relative(self, here: StoryActor, place: MapPlace, system: str) -> tuple[float, float]:
        """Return how far ahead and to the left of an actor a place is [m]."""
        if system in {"road", "lane", "trajectory"} and (found := self._on_lanes(here, place)) is not None:
            return found[0] * here.direction, found[1] * here.direction
        dx, dy = place.x - here.x, place.y - here.y
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        return dx * cos + dy * sin, dy * cos - dx * sin

    def _on_lanes(self, actor: StoryActor, place: MapPlace) -> tuple[float, float] | None:
        """Return how far along its lane's direction, and to the left of the actor, a place is; None if it is not."""
        if actor.lane < 0:
            return None
        story_map, around = self._cast.map, self._lanes_around(actor)
        on = story_map.project(place)
        starts = dict(reversed(around))
        if on.lane in starts:
            return starts[on.lane] + on.s - actor.s, on.offset - actor.offset
        roads = story_map.roads
        best: tuple[float, float, float] | None = None
        for lane, start in around:
            first, last = int(roads.first[lane]), int(roads.first[lane + 1])
            near = nearest_on_polyline(roads.points[first:last], place.x, place.y)
            away = abs(float(near.lateral[0]))
            if best is None or away < best[0] - TOUCHES:
                best = away, start + float(near.arc[0]), float(near.lateral[0])
        if best is None or best[0] > MAX_ASIDE:
            return None
        return best[1] - actor.s, best[2] - actor.offset

    def _lanes_around(self, actor: StoryActor) -> list[tuple[int, float]]:
        """Return the lanes ahead and behind, each with the way from the start of the own lane to its start [m]."""
        key = (actor.lane, tuple(actor.route))
        if key not in self._around:
            if len(self._around) >= MAX_KEPT:
                self._around.clear()
            self._around[key] = self._find_around(actor.lane, actor.route)
        return self._around[key]

    def _find_around(self, own: int, route: Sequence[int]) -> list[tuple[int, float]]:
        roads = self._cast.map.roads
        lanes = [(own, 0.0)]
        lane, start = own, 0.0
        while start + float(roads.length[lane]) < REACH and len(lanes) < MAX_LANES:
            end = OnLane(lane, float(roads.length[lane]), 0.0)
            moved, left = self._cast.map.move(end, TOUCHES, route)
            if left:
                break
            start += float(roads.length[lane])
            lane = moved.lane
            lanes.append((lane, start))
        lane, start = own, 0.0
        while start > -REACH and len(lanes) < 2 * MAX_LANES:
            before = predecessors(roads, lane)
            if not before:
                break
            lane = next((each for each in before if each in route), before[0])
            start -= float(roads.length[lane])
            lanes.append((lane, start))
        return lanes

    def _ends(self, name: str) -> tuple[float, float]:
        """Return how far a box reaches before and behind its reference point [m]."""
        body = self._bodies[name]
        return body.length - body.rear_overhang, body.rear_overhang

    def _box(self, name: str) -> list[tuple[float, float]]:
        actor, body = self._cast.find(name), self._bodies[name]
        return box_at((actor.x, actor.y, actor.yaw), 0.5 * body.length, 0.5 * body.width, body.centre)


def _way_of(item: StoryItem) -> tuple[str, str]:
    """Return the type and the coordinate system of a distance; those of version 1.0 say `alongRoute` instead."""
    if "relativeDistanceType" in item.values:
        return item["relativeDistanceType"], item.get("coordinateSystem", "entity")
    if "coordinateSystem" in item.values:
        return "euclidianDistance", item["coordinateSystem"]
    return ("longitudinal", "road") if item.get("alongRoute", False) else ("euclidianDistance", "entity")


def _between(one: list[tuple[float, float]], other: list[tuple[float, float]]) -> float:
    """Return the distance between two convex shapes, each a point or corners in order; 0 if they meet [m]."""
    if _contains(one, other[0]) or _contains(other, one[0]):
        return 0.0
    distances = [_to_side(point, a, b) for point in one for a, b in _sides(other)]
    distances += [_to_side(point, a, b) for point in other for a, b in _sides(one)]
    if any(_cross(a, b, c, d) for a, b in _sides(one) for c, d in _sides(other)):
        return 0.0
    return min(distances)


_Point = tuple[float, float]


def _sides(shape: list[_Point]) -> list[tuple[_Point, _Point]]:
    return list(zip(shape, [*shape[1:], shape[0]], strict=True))


def _turn(a: _Point, b: _Point, c: _Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _contains(shape: list[_Point], point: _Point) -> bool:
    turns = [_turn(a, b, point) for a, b in _sides(shape)]
    return len(shape) > 1 and (min(turns) >= 0.0 or max(turns) <= 0.0)


def _cross(a: _Point, b: _Point, c: _Point, d: _Point) -> bool:
    return _turn(a, b, c) * _turn(a, b, d) < 0.0 and _turn(c, d, a) * _turn(c, d, b) < 0.0


def _to_side(point: _Point, a: _Point, b: _Point) -> float:
    size = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    share = 0.0 if size == 0.0 else ((point[0] - a[0]) * (b[0] - a[0]) + (point[1] - a[1]) * (b[1] - a[1])) / size
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))

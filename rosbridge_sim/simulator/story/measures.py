"""Distances between the actors of a story, in the ways that OpenSCENARIO has for them.

Along and aside are those of the measuring entity: ahead and to the left are positive. With the coordinate system
`entity` they are measured along its heading, with `road` and `lane` along the lanes that it would drive on. Free space
is the distance between the boxes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Final

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.openscenario.places import MapPlace, OnLane, predecessors
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.simulator.story.cast import Cast, StoryActor
from rosbridge_sim.world.geometry.planar import FloatArray, box_at, nearest_on_polyline
from rosbridge_sim.world.state.world import Body

REACH: Final = 1_000.0
"""So far along the lanes, ahead and behind, places are looked for [m]."""

MAX_LANES: Final = 200
"""Most lanes that are looked at, for one distance."""

MAX_KEPT: Final = 1_000
"""Most lanes of which the lanes around are kept, and most places on them."""

TOUCHES: Final = 1e-6
"""A difference that is rounding [m]."""

MAX_ASIDE: Final = 50.0
"""A place farther beside the lanes than this is not along them [m]."""


_Box = tuple[float, float, float, float, float, float]


class _Around(Record, eq=False):
    """The lanes ahead and behind: the way from the start of the own lane to the start of each and of all [m]."""

    starts: Mapping[int, float]
    line: FloatArray
    first: float


class Measures:
    """Measures distances of one cast."""

    def __init__(self, cast: Cast, bodies: Mapping[str, Body]) -> None:
        self._cast = cast
        self._bodies = bodies
        self._around = lru_cache(MAX_KEPT)(self._find_around)
        self._from_start = lru_cache(MAX_KEPT)(self._find_from_start)

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
            to_other, is_apart = _to_box(self._box(name), self._corners(other))
            to_own, is_apart_too = _to_box(self._box(other), self._corners(name))
            return min(to_other, to_own) if is_apart or is_apart_too else 0.0
        here = self._cast.find(name)
        return math.dist((here.x, here.y), (there.x, there.y))

    def to_place(self, name: str, place: MapPlace, item: StoryItem) -> float:
        """Return a distance to a place as a condition asks for it [m]."""
        kind, system = _way_of(item)
        here, body = self._cast.find(name), self._bodies[name]
        is_free = item.get("freespace", False)
        if kind not in {"longitudinal", "lateral"}:
            if is_free:
                return _to_box(self._box(name), [(place.x, place.y)])[0]
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
        there = self._cast.find(other)
        on = there.on_lane if there.lane >= 0 and not there.is_changing_lane else None
        return self._relative(self._cast.find(name), there.place, system, on)[0]

    def aside(self, name: str, other: str, system: str) -> float:
        """Return how far to the left another entity's reference point is [m]."""
        here, there = self._cast.find(name), self._cast.find(other)
        # Within a frame an action may have shifted the other one already.
        if system == "entity" or there.lane < 0:
            return self._relative(here, there.place, system)[1]
        return self._relative(here, self._cast.map.at(there.on_lane), system, there.on_lane)[1]

    def free_along(self, name: str, other: str, system: str) -> float:
        """Return the free way to another entity [m]: negative behind; 0 beside."""
        if system != "entity":
            gap = self.along(name, other, system)
            ahead = 1.0 if gap >= 0.0 else -1.0
            return ahead * max(abs(gap) - self.half_lengths(name, other, ahead), 0.0)
        here = self._cast.find(name)
        front, rear = self._ends(name)
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        ways = [(x - here.x) * cos + (y - here.y) * sin for x, y in self._corners(other)]
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

    def _relative(
        self, here: StoryActor, place: MapPlace, system: str, on: OnLane | None = None
    ) -> tuple[float, float]:
        """Return how far ahead and to the left of an actor a place is [m]."""
        if system in {"road", "lane", "trajectory"} and (found := self._on_lanes(here, place, on)) is not None:
            return found[0] * here.direction, found[1] * here.direction
        dx, dy = place.x - here.x, place.y - here.y
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        return dx * cos + dy * sin, dy * cos - dx * sin

    def _on_lanes(self, actor: StoryActor, place: MapPlace, on: OnLane | None = None) -> tuple[float, float] | None:
        """Return how far along its lane's direction, and to the left of the actor, a place is; None if it is not.

        Args:
            on: the place on a lane, if it is known.
        """
        if actor.lane < 0:
            return None
        found = self._from_start(actor.lane, actor.route, place, on)
        return None if found is None else (found[0] - actor.s, found[1] - actor.offset)

    def _find_from_start(
        self, lane: int, route: tuple[int, ...], place: MapPlace, on: OnLane | None
    ) -> tuple[float, float] | None:
        """Return the same from the start and the line of a lane."""
        around = self._around(lane, route)
        on = self._cast.map.project(place) if on is None else on
        if on.lane in around.starts:
            return around.starts[on.lane] + on.s, on.offset
        near = nearest_on_polyline(around.line, place.x, place.y)
        lateral = float(near.lateral[0])
        return None if abs(lateral) > MAX_ASIDE else (around.first + float(near.arc[0]), lateral)

    def _find_around(self, own: int, route: tuple[int, ...]) -> _Around:
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
        starts = dict(sorted(lanes, key=lambda each: -abs(each[1])))  # of a ring each lane once, where it is nearer
        in_order = sorted(starts, key=lambda each: starts[each])
        line = np.concatenate([roads.points[roads.first[lane] : roads.first[lane + 1]] for lane in in_order])
        return _Around(starts, line, starts[in_order[0]])

    def _ends(self, name: str) -> tuple[float, float]:
        """Return how far a box reaches before and behind its reference point [m]."""
        body = self._bodies[name]
        return body.length - body.rear_overhang, body.rear_overhang

    def _corners(self, name: str) -> list[tuple[float, float]]:
        actor, body = self._cast.find(name), self._bodies[name]
        return box_at((actor.x, actor.y, actor.yaw), 0.5 * body.length, 0.5 * body.width, body.centre)

    def _box(self, name: str) -> _Box:
        """Return the middle of a box, the direction of its length, and half of its length and width."""
        actor, body = self._cast.find(name), self._bodies[name]
        cos, sin = math.cos(actor.yaw), math.sin(actor.yaw)
        return (
            *(actor.x + body.centre * cos, actor.y + body.centre * sin, cos, sin),
            *(0.5 * body.length, 0.5 * body.width),
        )


def _way_of(item: StoryItem) -> tuple[str, str]:
    """Return the type and the coordinate system of a distance; those of version 1.0 say `alongRoute` instead."""
    if "relativeDistanceType" in item.values:
        return item["relativeDistanceType"], item.get("coordinateSystem", "entity")
    if "coordinateSystem" in item.values:
        return "euclidianDistance", item["coordinateSystem"]
    return ("longitudinal", "road") if item.get("alongRoute", False) else ("euclidianDistance", "entity")


def _to_box(box: _Box, points: Sequence[tuple[float, float]]) -> tuple[float, bool]:
    """Return the least distance of points to a box [m], and whether a side of it lies between all of them and it."""
    x, y, cos, sin, half_length, half_width = box
    own = [((px - x) * cos + (py - y) * sin, (py - y) * cos - (px - x) * sin) for px, py in points]
    away = [math.hypot(max(abs(a) - half_length, 0.0), max(abs(b) - half_width, 0.0)) for a, b in own]
    along, across = zip(*own, strict=True)
    ways = (min(along), -max(along), half_length), (min(across), -max(across), half_width)
    return min(away), any(max(low, high) > half for low, high, half in ways)

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
from rosbridge_sim.simulator.story.story_actors import StoryActor, StoryActors
from rosbridge_sim.world.geometry.planar import FloatArray, nearest_on_polyline, outline_at

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


_LANE_SYSTEMS: Final = frozenset({"road", "lane", "trajectory"})

Target = str | MapPlace
_Size = tuple[float, float, float]


class _Around(Record, eq=False):
    """The lanes ahead and behind: the way from the start of the own lane to the start of each and of all [m]."""

    starts: Mapping[int, float]
    line: FloatArray
    first: float


class Measures:
    """Measures distances between the actors of one story. A target is the name of an entity, or a place.

    A place is a box without a size.
    """

    def __init__(self, actors: StoryActors) -> None:
        self._actors = actors
        self._around = lru_cache(MAX_KEPT)(self._find_around)
        self._from_start = lru_cache(MAX_KEPT)(self._find_from_start)

    def distance(self, name: str, target: Target, item: StoryItem) -> float:
        """Return a distance as a condition asks for it [m]: behind is negative, where it is measured along."""
        kind, system = _way_of(item)
        is_free = item.get("freespace", False)
        if kind == "longitudinal":
            return self._free_along(name, target, system) if is_free else self.along(name, target, system)
        if kind == "lateral":
            aside = abs(self.aside(name, target, system))
            return max(aside - self.half_widths(name, target), 0.0) if is_free else aside
        if is_free:
            to_target, is_apart = self._to_box(name, self._corners(target))
            to_own, is_apart_too = self._to_box(target, self._corners(name))
            return min(to_target, to_own) if is_apart or is_apart_too else 0.0
        here, there = self._actors.find(name), self._find(target)
        return math.dist((here.x, here.y), (there.x, there.y))

    def along(self, name: str, target: Target, system: str) -> float:
        """Return how far ahead the reference point of a target is [m]."""
        return self._relative(name, target, system)[0]

    def aside(self, name: str, target: Target, system: str) -> float:
        """Return how far to the left the reference point of a target is [m]."""
        return self._relative(name, target, system)[1]

    def _free_along(self, name: str, target: Target, system: str) -> float:
        """Return the free way to a target [m]: negative behind; 0 beside."""
        if system != "entity":
            gap = self.along(name, target, system)
            ahead = 1.0 if gap >= 0.0 else -1.0
            return ahead * max(abs(gap) - self.half_lengths(name, target, ahead), 0.0)
        here = self._actors.find(name)
        front, rear, _ = self._size(name)
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        ways = [(x - here.x) * cos + (y - here.y) * sin for x, y in self._corners(target)]
        if min(ways) > front:
            return min(ways) - front
        return max(ways) + rear if max(ways) < -rear else 0.0

    def half_lengths(self, name: str, target: Target, ahead: float) -> float:
        """Return the distance of reference points at which the boxes touch, one behind the other [m].

        Args:
            ahead: 1 if the target is ahead, -1 if it is behind.
        """
        (front, rear, _), (other_front, other_rear, _) = self._size(name), self._size(target)
        return front + other_rear if ahead > 0.0 else rear + other_front

    def half_widths(self, name: str, target: Target) -> float:
        """Return the distance of reference points at which the boxes touch, side by side [m]."""
        return self._size(name)[2] + self._size(target)[2]

    def between_lanes(self, name: str, reference: str) -> float:
        """Return how far the line of another actor's lane is to the left of the line of the own lane [m]."""
        there, actor = self._actors.on_lane(reference), self._actors.on_lane(name)
        found = self._on_lanes(actor, self._actors.map.at(OnLane(there.lane, there.s, 0.0)))
        if found is None:
            raise DocumentError("the lanes do not lie beside each other")
        return found[1] + actor.offset

    def way_to(self, name: str, place: MapPlace) -> float:
        """Return the way to a place along the lanes, or the straight one where no lane leads there [m]."""
        actor = self._actors.on_lane(name)
        found = self._on_lanes(actor, place)
        if found is not None:
            return found[0] * actor.direction
        return math.dist((actor.x, actor.y), (place.x, place.y))

    def _relative(self, name: str, target: Target, system: str) -> tuple[float, float]:
        """Return how far ahead and to the left of an actor a target is [m]."""
        here, there = self._actors.find(name), self._find(target)
        if system in _LANE_SYSTEMS and (found := self._relative_on_lanes(name, target)) is not None:
            return found
        dx, dy = there.x - here.x, there.y - here.y
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        return dx * cos + dy * sin, dy * cos - dx * sin

    def _relative_on_lanes(self, name: str, target: Target) -> tuple[float, float] | None:
        """Return the same along and beside the lanes of an actor; None where none of them leads to the target."""
        here, on = self._actors.on_lane(name), None
        if isinstance(target, MapPlace):
            place = target
        else:
            there = self._actors.on_lane(target)
            place = there.place
            if there.is_changing_lane:
                place = self._actors.map.at(there.lane_place)  # within a frame an action may have shifted it already
            elif there.lane >= 0:
                on = there.lane_place
        found = self._on_lanes(here, place, on)
        return None if found is None else (found[0] * here.direction, found[1] * here.direction)

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
        on, place = (self._actors.map.project(place), place) if on is None else (on, self._actors.map.at(on))
        if on.lane in around.starts:
            return around.starts[on.lane] + on.s, on.offset
        near = nearest_on_polyline(around.line, place.x, place.y)
        lateral = float(near.lateral[0])
        return None if abs(lateral) > MAX_ASIDE else (around.first + float(near.arc[0]), lateral)

    def _find_around(self, own: int, route: tuple[int, ...]) -> _Around:
        roads = self._actors.map.roads
        lanes = [(own, 0.0)]
        lane, start = own, 0.0
        while start + float(roads.length[lane]) < REACH and len(lanes) < MAX_LANES:
            end = OnLane(lane, float(roads.length[lane]), 0.0)
            moved, left = self._actors.map.move(end, TOUCHES, route)
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

    def _find(self, target: Target) -> StoryActor | MapPlace:
        return target if isinstance(target, MapPlace) else self._actors.find(target)

    def _size(self, target: Target) -> _Size:
        """Return how far a box reaches before, behind and beside its reference point [m]."""
        if isinstance(target, MapPlace):
            return 0.0, 0.0, 0.0
        body = self._actors.bodies[target]
        return body.length - body.rear_overhang, body.rear_overhang, 0.5 * body.width

    def _corners(self, target: Target) -> list[tuple[float, float]]:
        at, (front, rear, side) = self._find(target), self._size(target)
        return outline_at((at.x, at.y, at.yaw), ((front, side), (front, -side), (-rear, -side), (-rear, side)))

    def _to_box(self, target: Target, points: Sequence[tuple[float, float]]) -> tuple[float, bool]:
        """Return the least distance of points to a box [m], and whether a side of it lies between all and it."""
        at, (front, rear, side) = self._find(target), self._size(target)
        cos, sin = math.cos(at.yaw), math.sin(at.yaw)
        own = [((x - at.x) * cos + (y - at.y) * sin, (y - at.y) * cos - (x - at.x) * sin) for x, y in points]
        away = min(math.hypot(max(a - front, -rear - a, 0.0), max(abs(b) - side, 0.0)) for a, b in own)
        along, across = zip(*own, strict=True)
        is_apart = min(along) > front or max(along) < -rear or min(across) > side or max(across) < -side
        return away, is_apart


def _way_of(item: StoryItem) -> tuple[str, str]:
    """Return the type and the coordinate system of a distance; those of version 1.0 say `alongRoute` instead."""
    if "relativeDistanceType" in item.values:
        return item["relativeDistanceType"], item.get("coordinateSystem", "entity")
    if "coordinateSystem" in item.values:
        return "euclidianDistance", item["coordinateSystem"]
    return ("longitudinal", "road") if item.get("alongRoute", False) else ("euclidianDistance", "entity")

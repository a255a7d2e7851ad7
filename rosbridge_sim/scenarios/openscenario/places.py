"""Positions of a story on a map: lanes, roads, other entities, routes -> places in the map frame and on lanes.

Roads and lanes of OpenDRIVE files are found by the map's `RoadPositions`. Without it (MGeo, built-in maps) a position
names a link, by MORAI's `LinkPosition`, or a place in the map frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.georeference import Georeference
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.maps.road_positions import RoadPositions
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.geometry.planar import nearest_on_polyline
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.routing import find_route
from rosbridge_sim.world.state.entity_types import MAX_COORDINATE

FAR: Final = 100.0
"""Greatest distance from a lane at which a place still belongs to it [m]."""

TOUCHES: Final = 1e-6
"""A foot point is this near to the perpendicular of a place, unless the place lies beyond an end of its lane [m]."""

MAX_MOVED: Final = 10_000
"""Most lanes that a place is moved over; there it ends, as at the end of a road."""

MAX_KEPT: Final = 2_000
"""Most answers of one kind that are kept."""

SAME: Final = 0.5
"""A place this near to the line of a lane is in the middle of the lane [m]."""


class MapPlace(Record):
    """A place in the map frame.

    Attributes:
        x, y, z: [m].
        yaw, roll, pitch: pitch is positive with the nose down [rad].
    """

    x: float
    y: float
    z: float
    yaw: float
    roll: float = 0.0
    pitch: float = 0.0


class OnLane(Record):
    """A place on a lane.

    Attributes:
        lane: row of the lane; -1 for none.
        s: arc length from its start [m].
        offset: to the left of its line [m].
        turned: heading relative to the lane [rad].
    """

    lane: int
    s: float
    offset: float
    turned: float = 0.0


Entity = Callable[[str], tuple[MapPlace, OnLane]]
"""Returns place and lane of an entity by its name; DocumentError where it is not in the world."""


OnGlobe = Callable[[float, float], tuple[float, float] | None]
"""Returns x and y of a place [m] by its latitude and longitude [deg]; None where the projection has no such place."""


class StoryMap:
    """A map as stories use it. What is asked again has its last answers kept: hundreds of conditions ask the same."""

    def __init__(self, roads: Roads, index: RoadPositions | None = None, on_globe: OnGlobe | None = None) -> None:
        self.roads = roads
        self.index = index
        self.on_globe = on_globe
        self._fixed = lru_cache(MAX_KEPT)(self._find)
        self.project = lru_cache(MAX_KEPT)(self._project)
        self.at = lru_cache(MAX_KEPT)(self._at)
        self.beside = lru_cache(MAX_KEPT)(self._beside)
        self.lane_beside = lru_cache(MAX_KEPT)(self._lane_beside)

    @classmethod
    def of(cls, road_map: RoadMap) -> StoryMap:
        """Return a map as stories use it."""
        on_globe = partial(Georeference().find_place, road_map) if road_map.projection.is_known else None
        return cls(road_map.roads, road_map.positions, on_globe)

    def find_place(self, item: StoryItem, entity: Entity) -> MapPlace:
        """Return the place that a position means.

        Args:
            item: a `Position`, or what stands for one.

        Raises:
            DocumentError: the map has no such place, or an entity is not there. The text has file and line.
        """
        position = item.part() if item.kind in {"Position", "TargetPosition", "TargetPositionMaster"} else item
        return self._fixed(position) if position.kind in _FIXED else self._find(position, entity)

    def _find(self, position: StoryItem, entity: Entity | None = None) -> MapPlace:
        try:
            place = _FINDERS[position.kind](self, position, entity)
        except DocumentError as error:
            raise DocumentError(f"{position.where}: {position.kind}: {error}") from None
        if not max(map(abs, (place.x, place.y, place.z))) <= MAX_COORDINATE:
            raise DocumentError(f"{position.where}: {position.kind}: expected a place within {MAX_COORDINATE:g} m")
        turn = position.find("Orientation")
        if turn is None:
            return place
        h, p, r = (turn.get(key, 0.0) for key in "hpr")
        if turn.get("type", "absolute") == "relative":
            return MapPlace(place.x, place.y, place.z, place.yaw + h, place.roll + r, place.pitch + p)
        return MapPlace(place.x, place.y, place.z, h if "h" in turn.values else place.yaw, r, p)

    def _project(self, place: MapPlace) -> OnLane:
        """Return the lane that something with a heading is on or nearest to."""
        if not len(self.roads):
            return OnLane(-1, 0.0, 0.0)
        found = self.roads.nearest(place.x, place.y, place.yaw, place.z)
        if not found.distance[0] <= FAR:
            return OnLane(-1, 0.0, 0.0)
        turned = math.remainder(place.yaw - float(found.yaw[0]), math.tau)
        on = OnLane(int(found.lane[0]), float(found.s[0]), 0.0, turned)
        foot = self.at(on)
        cos, sin = math.cos(foot.yaw - turned), math.sin(foot.yaw - turned)
        dx, dy = place.x - foot.x, place.y - foot.y
        beside = OnLane(on.lane, on.s, dy * cos - dx * sin, turned)
        beyond = dx * cos + dy * sin
        return beside if abs(beyond) < TOUCHES else self.move(beside, beyond, ())[0]

    def on_ground(self, place: MapPlace) -> MapPlace:
        """Return a place with the height of the lane that it is on; 0 beside the lanes."""
        on = self.project(place)
        return replace(place, z=self.at(on).z if on.lane >= 0 else 0.0)

    def _at(self, on: OnLane) -> MapPlace:
        """Return the place in the map frame of a place on a lane."""
        points, yaws = self.roads.at(on.lane, on.s)
        x, y, z = points[0].tolist()
        yaw = float(yaws[0])
        return MapPlace(x - on.offset * math.sin(yaw), y + on.offset * math.cos(yaw), z, yaw + on.turned)

    def move(self, on: OnLane, way: float, route: Sequence[int]) -> tuple[OnLane, float]:
        """Return a place farther along the lanes, and the way that was left at a dead end.

        Args:
            way: may be negative [m].
            route: rows of lanes that are taken where lanes fork; where it does not tell, the straightest one.
        """
        roads, lane, s = self.roads, on.lane, on.s + way
        lanes_left = MAX_MOVED
        while s > roads.length[lane]:
            lanes_left -= 1
            following = roads.successors(lane).tolist()
            if not following or not lanes_left:
                return OnLane(lane, float(roads.length[lane]), on.offset, on.turned), s - float(roads.length[lane])
            s -= float(roads.length[lane])
            lane = _choose(roads, following, route)
        while s < 0.0:
            lanes_left -= 1
            before = predecessors(roads, lane)
            if not before or not lanes_left:
                return OnLane(lane, 0.0, on.offset, on.turned), s
            lane = next((each for each in before if each in route), before[0])
            s += float(roads.length[lane])
        return OnLane(lane, s, on.offset, on.turned), 0.0

    def _beside(self, on: OnLane, steps: int) -> tuple[int, float]:
        """Return the row of the lane so many lanes to the left, and how far its line is to the left [m].

        The row is -1 for a lane that has no traffic in this direction.

        Raises:
            DocumentError: there is no such lane.
        """
        if steps == 0:
            return on.lane, 0.0
        if self.index is not None:
            span = self.index.spans[on.lane]
            return self.lane_beside(on, _count_lanes(span.lane, steps if span.is_forward else -steps))
        lane = on.lane
        for _ in range(abs(steps)):
            lane = int((self.roads.left if steps > 0 else self.roads.right)[lane])
            if lane < 0:
                raise DocumentError(f"no lane {steps:+d} beside link {printable(self.roads.ids[on.lane], 40)!r}")
        own = self.at(OnLane(on.lane, on.s, 0.0))
        first, last = int(self.roads.first[lane]), int(self.roads.first[lane + 1])
        near = nearest_on_polyline(self.roads.points[first:last], own.x, own.y)
        return lane, -float(near.lateral[0])

    def _lane_beside(self, on: OnLane, lane: int) -> tuple[int, float]:
        """Return the same for a lane of the same road, by its id.

        Raises:
            DocumentError: there is no such lane, or the map has no lane ids.
        """
        if self.index is None:
            raise DocumentError("lanes have ids on OpenDRIVE maps alone; use RelativeTargetLane")
        road, s = self.index.spans[on.lane].road, self.index.road_s(on.lane, on.s)
        there, own = _lane_place(self.index, road, lane, s, 0.0), self.at(OnLane(on.lane, on.s, 0.0))
        aside = (there.y - own.y) * math.cos(own.yaw) - (there.x - own.x) * math.sin(own.yaw)
        found = self.project(there)
        is_there = found.lane >= 0 and abs(found.offset) < SAME and math.cos(there.yaw - own.yaw) > 0.0
        return (found.lane if is_there else -1), aside

    def find_way(self, start: OnLane, goals: Sequence[OnLane]) -> tuple[int, ...]:
        """Return the rows of lanes of the shortest way over all goals.

        Raises:
            DocumentError: no way leads there.
        """
        lanes = [start.lane]
        here = start
        for goal in goals:
            route = (
                find_route(self.roads, here.lane, here.s, goal.lane, goal.s) if min(here.lane, goal.lane) >= 0 else None
            )
            if route is None:
                raise DocumentError("no way along the lanes leads there")
            lanes.extend(route.lanes[1:])
            here = goal
        return tuple(lanes)


def predecessors(roads: Roads, lane: int) -> list[int]:
    """Return the rows of the lanes that end where a lane begins, in the map's order."""
    return roads.derived(_predecessors).get(lane, [])


def _predecessors(roads: Roads) -> dict[int, list[int]]:
    before: dict[int, list[int]] = {}
    for lane in range(len(roads)):
        for following in roads.successors(lane).tolist():
            before.setdefault(following, []).append(lane)
    return before


def _choose(roads: Roads, following: Sequence[int], route: Sequence[int]) -> int:
    """Return the lane that is taken where lanes fork."""
    on_route = [each for each in following if each in route]
    return min(on_route or following, key=lambda each: abs(float(roads.turn[each])))


def lane_id(text: str) -> int:
    """Return the id of a lane in its road.

    Raises:
        DocumentError: the text is none.
    """
    try:
        return int(text)
    except ValueError:
        raise DocumentError(f"expected the id of a lane, a whole number, got {printable(text, 40)!r}") from None


def _need_index(story_map: StoryMap) -> RoadPositions:
    if story_map.index is None:
        raise DocumentError("the map has no roads and lanes of OpenDRIVE; use LinkPosition or WorldPosition")
    return story_map.index


def _world(story_map: StoryMap, item: StoryItem, _: Entity) -> MapPlace:
    place = MapPlace(*(item.get(key, 0.0) for key in ("x", "y", "z", "h", "r", "p")))
    return place if "z" in item.values else story_map.on_ground(place)


def _geo(story_map: StoryMap, item: StoryItem, _: Entity) -> MapPlace:
    if story_map.on_globe is None:
        raise DocumentError("the map has no projection; use WorldPosition")
    angles = [item.get(f"{name}Deg", math.degrees(item.get(name, math.nan))) for name in ("latitude", "longitude")]
    found = None if any(map(math.isnan, angles)) else story_map.on_globe(*angles)
    if found is None:
        raise DocumentError("expected latitudeDeg and longitudeDeg, or both in radians, within the map's projection")
    return story_map.on_ground(MapPlace(*found, 0.0, 0.0))


def _trajectory(story_map: StoryMap, item: StoryItem, entity: Entity) -> MapPlace:
    shape = item.part("TrajectoryRef").part("Trajectory").part("Shape").part("Polyline")
    places = [story_map.find_place(each.part("Position"), entity) for each in shape.all("Vertex")]
    left = item["s"]
    for here, there in pairwise(places):
        length = math.dist((here.x, here.y), (there.x, there.y))
        if 0.0 <= left <= length > 0.0:
            share, yaw, aside = left / length, math.atan2(there.y - here.y, there.x - here.x), item.get("t", 0.0)
            x, y = here.x + share * (there.x - here.x), here.y + share * (there.y - here.y)
            z = here.z + share * (there.z - here.z)
            return MapPlace(x - aside * math.sin(yaw), y + aside * math.cos(yaw), z, yaw)
        left -= length
    raise DocumentError(f"s: expected 0..{item['s'] - left:.2f} m, the length of the trajectory, got {item['s']:g}")


def _relative(_: StoryMap, item: StoryItem, entity: Entity) -> MapPlace:
    """Return the place `dx`, `dy`, `dz` from an entity, in the axes of the world or in its own."""
    place = entity(item["entityRef"])[0]
    yaw = place.yaw if item.kind == "RelativeObjectPosition" else 0.0
    cos, sin, dx, dy = math.cos(yaw), math.sin(yaw), item["dx"], item["dy"]
    return MapPlace(
        place.x + dx * cos - dy * sin, place.y + dx * sin + dy * cos, place.z + item.get("dz", 0.0), place.yaw
    )


def _lane(story_map: StoryMap, item: StoryItem, _: Entity) -> MapPlace:
    index, lane = _need_index(story_map), lane_id(item["laneId"])
    return _lane_place(index, item["roadId"], lane, item["s"], item.get("offset", 0.0))


def _lane_place(index: RoadPositions, road: str, lane: int, s: float, offset: float) -> MapPlace:
    """Return a place on a lane, with the direction of traffic.

    Raises:
        DocumentError: there is no such place.
    """
    found = index.on_lane(road, s, lane, offset)
    if found is not None:
        return MapPlace(found.x, found.y, found.z, found.yaw)
    _check_road(index, road)
    there = index.lane_ids(road)
    if lane not in there:
        raise DocumentError(f"road {printable(road, 40)!r} has no lane {lane}; it has {', '.join(map(str, there))}")
    raise DocumentError(f"s: lane {lane} of road {printable(road, 40)!r} has no place at {s:g} m")


def _check_road(index: RoadPositions, road: str) -> None:
    if road not in set(index.road_ids()):
        raise DocumentError(f"the map has no road {printable(road, 40)!r}{hint(road, index.road_ids())}")


def _road(story_map: StoryMap, item: StoryItem, _: Entity) -> MapPlace:
    index, road = _need_index(story_map), item["roadId"]
    found = index.on_road(road, item["s"], item["t"])
    if found is None:
        _check_road(index, road)
        raise DocumentError(f"s: road {printable(road, 40)!r} has no place at {item['s']:g} m")
    return MapPlace(found.x, found.y, found.z, found.road_yaw)


def _link(story_map: StoryMap, item: StoryItem, _: Entity) -> MapPlace:
    roads = story_map.roads
    try:
        lane = roads.row(item["linkId"])
    except KeyError:
        name = item["linkId"]
        raise DocumentError(f"the map has no link {printable(name, 60)!r}{hint(name, roads.ids)}") from None
    s, length = item.get("s", 0.0), float(roads.length[lane])
    if not 0.0 <= s <= length:
        raise DocumentError(f"s: expected 0..{length:.2f} m, the length of the link, got {s:g}")
    return story_map.at(OnLane(lane, s, item.get("offset", 0.0)))


def _relative_lane(story_map: StoryMap, item: StoryItem, entity: Entity) -> MapPlace:
    on = _on_lane(item["entityRef"], entity)
    index = story_map.index
    if index is not None and "ds" in item.values:  # along the road, while it is the same one
        span = index.spans[on.lane]
        sign = 1 if span.is_forward else -1
        lane, s = _count_lanes(span.lane, sign * item["dLane"]), index.road_s(on.lane, on.s) + sign * item["ds"]
        found = index.on_lane(span.road, s, lane, item.get("offset", 0.0))
        if found is not None:
            return MapPlace(found.x, found.y, found.z, found.yaw)
    moved, _ = story_map.move(on, item.get("ds", item.get("dsLane", 0.0)), ())
    lane, aside = story_map.beside(moved, item["dLane"])
    there = story_map.at(OnLane(moved.lane, moved.s, aside + item.get("offset", 0.0)))
    if lane < 0 and index is not None:  # against this direction
        return MapPlace(there.x, there.y, there.z, there.yaw + math.pi)
    return there


def _count_lanes(lane: int, steps: int) -> int:
    """Return the id of the lane so many lanes to the left along the road; there is no lane 0."""
    there = lane + steps
    return there - (there <= 0 < lane) + (lane < 0 <= there)


def _relative_road(story_map: StoryMap, item: StoryItem, entity: Entity) -> MapPlace:
    on = _on_lane(item["entityRef"], entity)
    is_along = story_map.index is None or story_map.index.spans[on.lane].is_forward
    moved, _ = story_map.move(on, item["ds"] if is_along else -item["ds"], ())
    return story_map.at(OnLane(moved.lane, moved.s, on.offset + (item["dt"] if is_along else -item["dt"])))


def _route(story_map: StoryMap, item: StoryItem, entity: Entity) -> MapPlace:
    within = item.part("InRoutePosition").part()
    if within.kind == "FromCurrentEntity":
        return entity(within["entityRef"])[0]
    waypoints = item.part("RouteRef").part("Route").all("Waypoint")
    if len(waypoints) < 2:  # noqa: PLR2004 - a start and a goal
        raise DocumentError("expected a route with two waypoints or more")
    start, *goals = (story_map.project(story_map.find_place(each.part("Position"), entity)) for each in waypoints)
    route = story_map.find_way(start, goals)
    moved, _ = story_map.move(OnLane(start.lane, start.s, 0.0), within["pathS"], route)
    if within.kind == "FromRoadCoordinates":
        return story_map.at(OnLane(moved.lane, moved.s, within["t"]))
    aside = within.get("laneOffset", 0.0)
    if story_map.index is not None:
        aside += story_map.lane_beside(moved, lane_id(within["laneId"]))[1]
    return story_map.at(OnLane(moved.lane, moved.s, aside))


def _on_lane(name: str, entity: Entity) -> OnLane:
    on = entity(name)[1]
    if on.lane < 0:
        raise DocumentError(f"{printable(name, 60)} is on no lane")
    return on


_FIXED: Final = frozenset({"WorldPosition", "LanePosition", "RoadPosition", "LinkPosition", "GeoPosition"})
"""Kinds of positions that mean the same place at any time."""

_FINDERS: Final[dict[str, Callable[[StoryMap, StoryItem, Any], MapPlace]]] = {
    "WorldPosition": _world,
    "RelativeWorldPosition": _relative,
    "RelativeObjectPosition": _relative,
    "LanePosition": _lane,
    "RoadPosition": _road,
    "LinkPosition": _link,
    "RelativeLanePosition": _relative_lane,
    "RelativeRoadPosition": _relative_road,
    "RoutePosition": _route,
    "GeoPosition": _geo,
    "TrajectoryPosition": _trajectory,
}
"""Kinds of positions that are read, with what they mean."""

"""Positions of a story on a map made by hand: exact places, and texts of those that the map does not have."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.openscenario.places import MapPlace, OnLane, StoryMap, predecessors
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.world.roads.roads import Roads

HERE = MapPlace(40.0, 1.0, 2.0, math.pi / 2)
"""Where the entity `car` is."""

LINES = {
    "a": [(0, 0, 0), (100, 0, 0)],
    "b": [(0, 3.5, 0), (100, 3.5, 0)],
    "straight": [(100, 0, 0), (200, 0, 4)],
    "bend": [(100, 0, 0), (130, 3, 0), (150, 40, 0)],
}


def make_map() -> StoryMap:
    """Two lanes to the east; the right one forks into a straight one, that climbs, and a bend to the left."""
    lines = [np.array(line, dtype=np.float64) for line in LINES.values()]
    following, num = [[2, 3], [], [], []], len(lines)
    left, right = [1, -1, -1, -1], [-1, 0, -1, -1]
    return StoryMap(Roads(list(LINES), lines, following, [3.5] * num, [15.0] * num, left=left, right=right))


def item(kind: str, *parts: StoryItem, **values: Any) -> StoryItem:  # noqa: ANN401 - attributes of an element
    return StoryItem(kind, values, parts, "own.xosc:7")


def find(position: StoryItem, story_map: StoryMap | None = None) -> tuple[float, ...]:
    """x, y, z, yaw, roll and pitch of a position."""
    found = story_map or make_map()
    place = found.find_place(position, lambda _name: (HERE, OnLane(0, 40.0, 1.0, math.pi / 2)))
    return place.x, place.y, place.z, place.yaw, place.roll, place.pitch


def test_place_of_the_world_is_on_the_ground_unless_it_has_a_height() -> None:
    whole = item("WorldPosition", x=150.0, y=1.0, z=9.0, h=0.1, p=0.2, r=0.3)
    assert find(whole) == (150.0, 1.0, 9.0, 0.1, 0.3, 0.2)
    assert find(item("WorldPosition", x=150.0, y=1.0)) == pytest.approx((150.0, 1.0, 2.0, 0.0, 0.0, 0.0))
    assert find(item("WorldPosition", x=150.0, y=-400.0)) == (150.0, -400.0, 0.0, 0.0, 0.0, 0.0)
    assert find(item("Position", item("WorldPosition", x=1.0, y=2.0, z=3.0)))[:3] == (1.0, 2.0, 3.0)
    assert find(item("WorldPosition", x=5.0, y=6.0), StoryMap(Roads()))[:3] == (5.0, 6.0, 0.0)


def test_relative_places_are_along_the_axes_of_the_map_or_of_the_entity() -> None:
    values = {"entityRef": "car", "dx": 3.0, "dy": 2.0}
    assert find(item("RelativeWorldPosition", **values)) == (43.0, 3.0, 2.0, math.pi / 2, 0.0, 0.0)
    beside = find(item("RelativeObjectPosition", **values, dz=0.5))
    assert beside == pytest.approx((38.0, 4.0, 2.5, math.pi / 2, 0.0, 0.0))


def test_orientation_is_absolute_or_relative_to_that_of_the_place() -> None:
    values = {"entityRef": "car", "dx": 0.0, "dy": 0.0}
    turned = item("RelativeWorldPosition", item("Orientation", h=0.1, p=0.2, r=0.3), **values)
    assert find(turned)[3:] == (0.1, 0.3, 0.2)
    relative = item("RelativeWorldPosition", item("Orientation", h=0.1, p=0.2, r=0.3, type="relative"), **values)
    assert find(relative)[3:] == (math.pi / 2 + 0.1, 0.3, 0.2)
    pitched = item("RelativeWorldPosition", item("Orientation", p=0.2), **values)
    assert find(pitched)[3:] == (math.pi / 2, 0.0, 0.2)


def test_place_on_a_link_is_beside_its_line() -> None:
    assert find(item("LinkPosition", linkId="a", s=25.0, offset=1.5)) == pytest.approx((25.0, 1.5, 0.0, 0.0, 0.0, 0.0))
    assert find(item("LinkPosition", linkId="b"))[:2] == pytest.approx((0.0, 3.5))
    assert find(item("LinkPosition", linkId="a", s=100.0))[0] == pytest.approx(100.0)
    length = math.hypot(100.0, 4.0)
    assert find(item("LinkPosition", linkId="straight", s=0.5 * length))[2] == pytest.approx(2.0, abs=0.01)


def test_places_along_a_trajectory_are_beside_its_pieces() -> None:
    corners = [
        item("Vertex", item("Position", item("WorldPosition", x=x, y=y, z=0.0))) for x, y in ((0, 0), (30, 0), (30, 40))
    ]
    shape = item("TrajectoryRef", item("Trajectory", item("Shape", item("Polyline", *corners))))

    def at(s: float, t: float = 0.0) -> tuple[float, ...]:
        return find(item("TrajectoryPosition", shape, s=s, t=t))[:4]

    assert at(10.0, 2.0) == pytest.approx((10.0, 2.0, 0.0, 0.0))
    assert at(50.0, 2.0) == pytest.approx((28.0, 20.0, 0.0, math.pi / 2))
    assert at(70.0) == pytest.approx((30.0, 40.0, 0.0, math.pi / 2))
    with pytest.raises(DocumentError, match=r"s: expected 0\.\.70\.00 m, the length of the trajectory, got 71"):
        at(71.0)


def test_lanes_beside_and_ways_along_a_lane_are_counted_from_the_entity() -> None:
    values: dict[str, Any] = {"entityRef": "car", "dLane": 1}
    assert find(item("RelativeLanePosition", **values, ds=10.0))[:2] == pytest.approx((50.0, 3.5))
    assert find(item("RelativeLanePosition", **values, dsLane=-10.0, offset=-0.5))[:2] == pytest.approx((30.0, 3.0))
    assert find(item("RelativeLanePosition", entityRef="car", dLane=0, ds=0.0))[:2] == pytest.approx((40.0, 0.0))
    assert find(item("RelativeRoadPosition", entityRef="car", ds=20.0, dt=0.5))[:2] == pytest.approx((60.0, 1.5))
    with pytest.raises(DocumentError, match=r"own\.xosc:7: RelativeLanePosition: no lane -1 beside link 'a'"):
        find(item("RelativeLanePosition", entityRef="car", dLane=-1, ds=0.0))


def route(*xs: float, **within: Any) -> StoryItem:  # noqa: ANN401 - attributes of an element
    waypoints = [
        item("Waypoint", item("Position", item("WorldPosition", x=x, y=0.0, z=0.04 * max(x - 100, 0)))) for x in xs
    ]
    kind = "FromLaneCoordinates" if "laneId" in within else "FromRoadCoordinates"
    way = item("InRoutePosition", item(kind, **within))
    return item("RoutePosition", item("RouteRef", item("Route", *waypoints)), way)


def test_place_on_a_route_is_counted_from_its_start() -> None:
    assert find(route(10.0, 90.0, pathS=30.0, t=1.0))[:2] == pytest.approx((40.0, 1.0))
    assert find(route(10.0, 190.0, pathS=140.0, t=0.0))[0] == pytest.approx(150.0, abs=0.1)
    assert find(route(10.0, 90.0, pathS=30.0, laneId="1", laneOffset=0.5))[:2] == pytest.approx((40.0, 0.5))
    assert find(route(10.0, 90.0, pathS=30.0, laneId="1"))[:2] == pytest.approx((40.0, 0.0))
    own = item("RoutePosition", item("InRoutePosition", item("FromCurrentEntity", entityRef="car")))
    assert find(own) == (40.0, 1.0, 2.0, math.pi / 2, 0.0, 0.0)
    with pytest.raises(DocumentError, match="expected a route with two waypoints or more"):
        find(route(10.0, pathS=1.0, t=0.0))
    with pytest.raises(DocumentError, match="no way along the lanes leads there"):
        find(route(90.0, 10.0, pathS=1.0, t=0.0))


@pytest.mark.parametrize(
    ("position", "why"),
    [
        (item("LinkPosition", linkId="bent"), "LinkPosition: the map has no link 'bent' (did you mean bend?)"),
        (item("LinkPosition", linkId="a", s=101.0), "s: expected 0..100.00 m, the length of the link, got 101"),
        (item("LanePosition", roadId="1", laneId="1", s=0.0), "the map has no roads and lanes of OpenDRIVE; use Link"),
        (item("LanePosition", roadId="1", laneId="x", s=0.0), "the map has no roads and lanes of OpenDRIVE; use Link"),
        (item("GeoPosition", latitudeDeg=1.0, longitudeDeg=2.0), "the map has no projection; use WorldPosition"),
        (item("WorldPosition", x=1e300, y=0.0, z=0.0), "WorldPosition: expected a place within "),
    ],
)
def test_place_that_the_map_does_not_have_is_told(position: StoryItem, why: str) -> None:
    with pytest.raises(DocumentError) as refusal:
        find(position)
    assert why in str(refusal.value)
    assert str(refusal.value).startswith("own.xosc:7: ")


def test_something_with_a_heading_is_on_the_nearest_lane_and_counts_to_its_left() -> None:
    story_map = make_map()
    on = story_map.project(MapPlace(30.0, 1.0, 0.0, 0.2))
    assert (on.lane, on.s, on.offset, on.turned) == pytest.approx((0, 30.0, 1.0, 0.2))
    assert story_map.project(MapPlace(30.0, 3.0, 0.0, 0.0)).lane == 1
    assert story_map.project(MapPlace(30.0, -150.0, 0.0, 0.0)) == OnLane(-1, 0.0, 0.0)
    assert StoryMap(Roads()).project(MapPlace(0.0, 0.0, 0.0, 0.0)) == OnLane(-1, 0.0, 0.0)
    place = story_map.at(OnLane(0, 30.0, 2.0, 0.5))
    assert (place.x, place.y, place.z, place.yaw) == pytest.approx((30.0, 2.0, 0.0, 0.5))


def test_way_along_lanes_takes_the_route_or_the_straightest_and_ends_at_dead_ends() -> None:
    story_map = make_map()
    start = OnLane(0, 90.0, 0.5, 0.1)

    def move(on: OnLane, way: float, *rows: int) -> tuple[float, ...]:
        there, left = story_map.move(on, way, rows)
        return there.lane, there.s, there.offset, there.turned, left

    assert move(start, 30.0) == pytest.approx((2, 20.0, 0.5, 0.1, 0.0))
    assert move(start, 30.0, 3) == pytest.approx((3, 20.0, 0.5, 0.1, 0.0))
    length = float(story_map.roads.length[2])
    assert move(start, 500.0) == pytest.approx((2, length, 0.5, 0.1, 490.0 - length))
    assert move(OnLane(3, 5.0, 0.0), -20.0) == pytest.approx((0, 85.0, 0.0, 0.0, 0.0))
    assert move(OnLane(0, 5.0, 0.0), -20.0) == pytest.approx((0, 0.0, 0.0, 0.0, -15.0))
    assert [predecessors(story_map.roads, lane) for lane in range(4)] == [[], [], [0], [0]]
    assert story_map.find_way(OnLane(0, 10.0, 0.0), [OnLane(0, 50.0, 0.0), OnLane(3, 5.0, 0.0)]) == (0, 3)

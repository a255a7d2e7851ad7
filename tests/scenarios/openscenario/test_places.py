"""Positions of a story on a map made by hand: exact places, and texts of those that the map does not have."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.openscenario import places
from rosbridge_sim.scenarios.openscenario.places import MapPlace, OnLane, StoryMap, predecessors
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.world.roads.roads import Roads
from tests.maps.opendrive import xodr_texts as xodr

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
        item("Vertex", item("Position", item("WorldPosition", x=x, y=y, z=z)))
        for x, y, z in ((0, 0, 0), (30, 0, 3), (30, 40, 7))
    ]
    shape = item("TrajectoryRef", item("Trajectory", item("Shape", item("Polyline", *corners))))

    def at(s: float, t: float = 0.0) -> tuple[float, ...]:
        return find(item("TrajectoryPosition", shape, s=s, t=t))[:4]

    assert at(0.0) == (0.0, 0.0, 0.0, 0.0)
    assert at(10.0, 2.0) == pytest.approx((10.0, 2.0, 1.0, 0.0))
    assert at(50.0, 2.0) == pytest.approx((28.0, 20.0, 5.0, math.pi / 2))
    assert at(70.0) == pytest.approx((30.0, 40.0, 7.0, math.pi / 2))
    with pytest.raises(DocumentError, match=r"s: expected 0\.\.70\.00 m, the length of the trajectory, got 71"):
        at(71.0)


def test_lanes_beside_and_ways_along_a_lane_are_counted_from_the_entity() -> None:
    values: dict[str, Any] = {"entityRef": "car", "dLane": 1}
    assert find(item("RelativeLanePosition", **values, ds=10.0))[:2] == pytest.approx((50.0, 3.5))
    assert find(item("RelativeLanePosition", **values, dsLane=-10.0, offset=-0.5))[:2] == pytest.approx((30.0, 3.0))
    assert find(item("RelativeLanePosition", entityRef="car", dLane=0, ds=0.0))[:2] == pytest.approx((40.0, 0.0))
    assert find(item("RelativeLanePosition", entityRef="car", dLane=0))[:2] == pytest.approx((40.0, 0.0))
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


# Maps with roads and lanes of OpenDRIVE

TURN = 0.5
"""Direction of the roads; lanes of 3.5 m lie beside them, 1 and 2 to the left, -1 and -2 to the right."""


def turned_map() -> StoryMap:
    """Road `a` of 100 m, and road `b` behind it, which has the lanes 1 and -1 alone."""
    lanes = {name: xodr.lane(name, xodr.link(name, name)) for name in (2, 1, -1, -2)}
    one = xodr.road(
        "a",
        plan=xodr.geometry(hdg=TURN),
        sections=xodr.section([*lanes.values(), xodr.lane(0)]),
        links=xodr.joined("successor", "road", "b"),
    )
    other = xodr.road(
        "b",
        plan=xodr.geometry(x=100.0 * math.cos(TURN), y=100.0 * math.sin(TURN), hdg=TURN),
        sections=xodr.section([lanes[1], xodr.lane(0), lanes[-1]]),
        links=xodr.joined("predecessor", "road", "a", "end"),
    )
    return StoryMap.of(xodr.read(one, other, header="<geoReference>+proj=utm +zone=52 +ellps=WGS84</geoReference>"))


def beside_road(place: MapPlace) -> tuple[float, float, float]:
    """Distance along the roads, to their left, and direction relative to theirs, rounded."""
    there = complex(place.x, place.y) * complex(math.cos(TURN), -math.sin(TURN))
    return round(there.real, 6), round(there.imag, 6), round(math.remainder(place.yaw - TURN, math.tau), 6)


def on_roads(position: StoryItem, lane: str = "a.0.-1", s: float = 40.0, offset: float = 0.5) -> tuple[float, ...]:
    """The place of a position relative to an entity on a lane."""
    story_map = turned_map()
    on = OnLane(story_map.roads.row(lane), s, offset)
    return beside_road(story_map.find_place(position, lambda _name: (story_map.at(on), on)))


BACK = round(math.pi, 6)


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        (item("LanePosition", roadId="a", laneId="-2", s=30.0), (30.0, -5.25, 0.0)),
        (item("LanePosition", roadId="a", laneId="-1", s=30.0, offset=0.5), (30.0, -1.25, 0.0)),
        (item("LanePosition", roadId="a", laneId="2", s=30.0, offset=0.5), (30.0, 5.75, BACK)),
        (item("RoadPosition", roadId="b", s=30.0, t=2.0), (130.0, 2.0, 0.0)),
    ],
)
def test_place_on_a_road_has_its_direction_and_that_on_a_lane_the_one_of_traffic(
    position: StoryItem, expected: tuple[float, ...]
) -> None:
    found = on_roads(position)
    assert (*found[:2], abs(found[2])) == pytest.approx(expected, abs=2e-6)


@pytest.mark.parametrize(
    ("lane", "steps", "more", "expected"),
    [
        ("a.0.-1", -1, {"ds": 20.0}, (60.0, -5.25, 0.0)),
        ("a.0.-1", 1, {"ds": 20.0, "offset": 0.5}, (60.0, 2.25, BACK)),
        ("a.0.-2", 3, {"ds": -20.0}, (20.0, 5.25, BACK)),
        # The entity is 40 m from the start of a lane that runs against the road: at 60 m.
        ("a.0.1", 1, {"ds": 20.0}, (40.0, -1.75, 0.0)),
        ("a.0.1", -1, {"ds": 20.0}, (40.0, 5.25, BACK)),
        ("a.0.1", 0, {"ds": -20.0, "offset": 0.5}, (80.0, 2.25, BACK)),
        # Along the lane, onto the next road.
        ("a.0.-1", 0, {"dsLane": 80.0, "offset": 0.5}, (120.0, -1.25, 0.0)),
        ("a.0.-1", 0, {"ds": 80.0}, (120.0, -1.75, 0.0)),
        ("a.0.-1", 1, {"ds": 80.0}, (120.0, 1.75, BACK)),
        ("a.0.-1", 1, {"dsLane": 20.0, "offset": 0.5}, (60.0, 2.25, BACK)),
        ("a.0.-1", -1, {"dsLane": 20.0, "offset": 0.5}, (60.0, -4.75, 0.0)),
        ("b.0.1", -1, {"dsLane": 80.0}, (80.0, 5.25, BACK)),
    ],
)
def test_lanes_are_counted_to_the_left_of_the_entity(
    lane: str, steps: int, more: dict[str, float], expected: tuple[float, float, float]
) -> None:
    found = on_roads(item("RelativeLanePosition", entityRef="car", dLane=steps, **more), lane)
    assert (*found[:2], abs(found[2])) == pytest.approx(expected, abs=2e-6)


def test_place_relative_to_the_road_of_an_entity_follows_the_road_not_the_lane() -> None:
    position = item("RelativeRoadPosition", entityRef="car", ds=20.0, dt=0.25)
    assert on_roads(position) == pytest.approx((60.0, -1.0, 0.0), abs=2e-6)
    found = on_roads(position, "a.0.1")
    assert (*found[:2], abs(found[2])) == pytest.approx((80.0, 1.5, BACK), abs=2e-6)


def test_row_of_a_lane_beside_is_none_where_traffic_comes_the_other_way() -> None:
    story_map = turned_map()
    row = story_map.roads.row

    def beside(lane: str, steps: int) -> tuple[int, float]:
        found, aside = story_map.beside(OnLane(row(lane), 40.0, 9.0), steps)
        return found, round(aside, 6)

    assert [beside("a.0.-1", steps) for steps in (0, -1, 1, 2)] == [
        *((row("a.0.-1"), 0.0), (row("a.0.-2"), -3.5)),
        *((-1, 3.5), (-1, 7.0)),
    ]
    assert [beside("a.0.1", steps) for steps in (-1, 1)] == [(row("a.0.2"), -3.5), (-1, 3.5)]
    with pytest.raises(DocumentError, match="road 'a' has no lane -3; it has -2, -1, 1, 2"):
        beside("a.0.-1", -2)


def test_place_on_a_route_may_be_on_another_lane_of_the_road() -> None:
    corners = [
        item("Waypoint", item("Position", item("LanePosition", roadId=name, laneId="-1", s=50.0)))
        for name in ("a", "b")
    ]
    ref = item("RouteRef", item("Route", *corners))

    def at(**within: Any) -> tuple[float, ...]:  # noqa: ANN401 - attributes of an element
        return on_roads(item("RoutePosition", ref, item("InRoutePosition", item("FromLaneCoordinates", **within))))

    assert at(pathS=20.0, laneId="-2", laneOffset=0.5)[:2] == pytest.approx((70.0, -4.75), abs=2e-6)
    assert at(pathS=70.0, laneId="1")[:2] == pytest.approx((120.0, 1.75), abs=2e-6)
    with pytest.raises(DocumentError, match="RoutePosition: expected the id of a lane, a whole number, got 'x'"):
        at(pathS=20.0, laneId="x")


def test_place_on_the_globe_is_on_the_ground_of_the_map() -> None:
    story_map = turned_map()
    assert story_map.on_globe is not None
    values = {"latitudeDeg": 0.0005, "longitudeDeg": 124.511}
    expected = story_map.on_globe(values["latitudeDeg"], values["longitudeDeg"])
    assert expected is not None
    for each in (values, {name.removesuffix("Deg"): math.radians(value) for name, value in values.items()}):
        place = story_map.find_place(item("GeoPosition", **each), lambda _name: (HERE, OnLane(0, 0.0, 0.0)))
        assert (place.x, place.y, place.z, place.yaw) == pytest.approx((*expected, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize(
    ("position", "why"),
    [
        (
            item("LanePosition", roadId="a", laneId="-3", s=1.0),
            "LanePosition: road 'a' has no lane -3; it has -2, -1, 1, 2",
        ),
        (item("LanePosition", roadId="a", laneId="-1", s=101.0), "s: lane -1 of road 'a' has no place at 101 m"),
        (item("LanePosition", roadId="c", laneId="-1", s=1.0), "LanePosition: the map has no road 'c'"),
        (item("RoadPosition", roadId="c", s=1.0, t=0.0), "RoadPosition: the map has no road 'c'"),
        (item("RoadPosition", roadId="b", s=101.0, t=0.0), "s: road 'b' has no place at 101 m"),
        (item("GeoPosition", latitudeDeg=1.0), "expected latitudeDeg and longitudeDeg, or both in radians, within"),
    ],
)
def test_place_that_the_roads_do_not_have_is_told(position: StoryItem, why: str) -> None:
    with pytest.raises(DocumentError) as refusal:
        on_roads(position)
    assert why in str(refusal.value)


def test_place_relative_to_an_entity_beside_all_lanes_is_told() -> None:
    for position in (
        item("RelativeLanePosition", entityRef="car", dLane=0, ds=0.0),
        item("RelativeRoadPosition", entityRef="car", ds=0.0, dt=0.0),
    ):
        with pytest.raises(DocumentError, match=f"{position.kind}: car is on no lane"):
            make_map().find_place(position, lambda _name: (HERE, OnLane(-1, 0.0, 0.0)))


def test_lanes_with_ids_are_those_of_opendrive_alone() -> None:
    with pytest.raises(DocumentError, match="lanes have ids on OpenDRIVE maps alone; use RelativeTargetLane"):
        make_map().lane_beside(OnLane(0, 10.0, 0.0), 1)


def test_something_behind_the_end_of_a_lane_is_on_the_next_one_and_beyond_the_last_at_its_end() -> None:
    """The nearest point is a corner of the map's lines, and the way beyond it is counted along the lanes."""
    story_map = make_map()
    beyond = story_map.project(MapPlace(-5.0, 0.5, 0.0, 0.1))
    assert (beyond.lane, beyond.s, beyond.offset, beyond.turned) == pytest.approx((0, 0.0, 0.5, 0.1))
    last = story_map.project(MapPlace(102.0, 6.0, 0.0, 0.0))
    assert (last.lane, last.s, last.offset) == pytest.approx((1, 100.0, 2.5))


def test_lane_two_to_the_left_is_found_by_two_steps_on_a_map_without_roads() -> None:
    lines = [np.array([(0, y, 0), (100, y, 0)], dtype=np.float64) for y in (0.0, 3.0, 7.0)]
    roads = Roads(["a", "b", "c"], lines, [[], [], []], [3.5] * 3, [15.0] * 3, left=[1, 2, -1], right=[-1, 0, 1])
    story_map = StoryMap(roads)
    assert [story_map.beside(OnLane(0, 40.0, 9.0), steps) for steps in (1, 2)] == [(1, 3.0), (2, 7.0)]
    assert story_map.beside(OnLane(2, 40.0, 0.0), -2) == (0, -7.0)
    with pytest.raises(DocumentError, match=r"no lane \+3 beside link 'a'"):
        story_map.beside(OnLane(0, 40.0, 0.0), 3)


def test_ground_of_the_first_lane_has_its_height() -> None:
    roads = Roads(["up"], [np.array([(0.0, 0.0, 5.0), (100.0, 0.0, 5.0)])], [[]], [3.5], [15.0])
    assert find(item("WorldPosition", x=50.0, y=1.0), StoryMap(roads))[:3] == pytest.approx((50.0, 1.0, 5.0))


@pytest.mark.parametrize("way", [500.0, -500.0])
def test_way_around_a_ring_ends_after_so_many_lanes(monkeypatch: pytest.MonkeyPatch, way: float) -> None:
    monkeypatch.setattr(places, "MAX_MOVED", 5)
    lines = [np.array([(x, 0.0, 0.0), (x + 10.0, 0.0, 0.0)]) for x in (0.0, 10.0)]
    story_map = StoryMap(Roads(["a", "b"], lines, [[1], [0]], [3.5] * 2, [15.0] * 2))
    there, left = story_map.move(OnLane(0, 5.0, 0.0), way, ())
    assert (there.lane, there.s, left) == ((0, 10.0, 455.0) if way > 0.0 else (0, 0.0, -455.0))

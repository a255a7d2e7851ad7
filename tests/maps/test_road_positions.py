"""Places by road, lane and distance on the lanes of a map, and back."""

from __future__ import annotations

import math

import pytest

from rosbridge_sim.maps.road_positions import RoadPlace
from tests.maps.opendrive.xodr_texts import geometry, lane, link, read, road, section

FIRST = section([lane(1), lane(0), lane(-1, link(after=-2))])
SECOND = section([lane(1), lane(0), lane(-1), lane(-2)], 40.0)


def told(place: RoadPlace | None) -> tuple[float, ...]:
    assert place is not None
    return (
        place.lane,
        *(round(value, 6) for value in (place.s, place.offset, place.x, place.y, place.yaw, place.road_yaw)),
    )


def test_place_on_a_lane_is_found_in_its_section_and_in_the_direction_of_driving() -> None:
    road_map = read(road("a", plan=geometry(x=1000.0, hdg=math.pi / 2), sections=FIRST + SECOND))
    positions, row = road_map.positions, road_map.roads.row
    assert positions is not None
    quarter = round(math.pi / 2, 6)
    assert told(positions.on_lane("a", 10.0, -1)) == (row("a.0.-1"), 10.0, 0.0, 1001.75, 10.0, quarter, quarter)
    assert told(positions.on_lane("a", 70.0, -2)) == (row("a.1.-2"), 30.0, 0.0, 1005.25, 70.0, quarter, quarter)
    # Against the road: arc lengths run the other way, and so do offsets to the left.
    assert told(positions.on_lane("a", 70.0, 1, 0.5)) == (row("a.1.1"), 30.0, -0.5, 997.75, 70.0, -quarter, quarter)
    assert told(positions.on_road("a", 70.0, -4.0)) == (row("a.1.-2"), 30.0, 1.25, 1004.0, 70.0, quarter, quarter)
    assert told(positions.on_lane("a", 100.3, -2))[1] == 60.0


def test_place_on_a_lane_that_no_vehicle_drives_on_is_beside_the_nearest_one() -> None:
    lanes = [lane(1, kind="sidewalk"), lane(0), lane(-1), lane(-2, kind="shoulder"), lane(-3, kind="border")]
    tilt = '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'
    road_map = read(road("a", sections=section(lanes), more=tilt), road("b", sections=section([lane(0), lane(-1)])))
    positions = road_map.positions
    assert positions is not None
    for name, aside, yaw in ((1, 1.75, math.pi), (-2, -5.25, 0.0), (-3, -8.75, 0.0)):
        place = positions.on_lane("a", 30.0, name)
        assert place is not None
        assert (place.lane, abs(place.yaw), place.road_yaw) == (0, yaw, 0.0)
        assert [place.s, place.offset, place.x] == pytest.approx([30.0, aside + 1.75, 30.0])
        assert [place.y, place.z] == pytest.approx([aside * math.cos(0.1), aside * math.sin(0.1)])


@pytest.mark.parametrize(("name", "s", "lane_id"), [("b", 1.0, -1), ("a", 1.0, -2), ("a", 101.0, -1), ("a", -1.0, 1)])
def test_place_that_the_map_has_not_is_none(name: str, s: float, lane_id: int) -> None:
    positions = read(road("a", sections=FIRST + SECOND)).positions
    assert positions is not None
    assert positions.on_lane(name, s, lane_id) is None
    assert (list(positions.road_ids()), positions.lane_ids("a"), positions.lane_ids("b")) == (["a"], [-2, -1, 1], [])


def test_distances_along_and_beside_the_road_come_back() -> None:
    bend = geometry('<arc curvature="-0.01"/>')
    positions = read(road("a", plan=bend, sections=FIRST + SECOND)).positions
    assert positions is not None
    for s, lane_id, offset in ((3.3, 1, 0.4), (39.0, -1, -0.2), (77.7, 1, 0.0), (55.5, -2, 1.0)):
        place = positions.on_lane("a", s, lane_id, offset)
        assert place is not None
        assert positions.road_s(place.lane, place.s) == pytest.approx(s, abs=1e-3)
        middle = {1: 1.75, -1: -1.75, -2: -5.25}[lane_id]

        again = positions.on_road("a", s, middle + offset)
        assert again is not None
        assert again.lane == place.lane
        assert (again.x, again.y) == pytest.approx((place.x, place.y))

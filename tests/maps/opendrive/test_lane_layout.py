"""Lanes of roads as lines: widths, offsets, heights, superelevation, sides of traffic, sections, narrow ends, marks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.maps.road_map import RoadMap
from tests.maps.opendrive.xodr_texts import LINE, geometry, lane, read, road, section

TAPER = '<width sOffset="0" a="0" b="0" c="0.0105" d="-0.00035"/>'  # 0 to 3.15 m in 20 m, then on
OPENING = '<width sOffset="0" a="0" b="0.1" c="0" d="0"/><width sOffset="35" a="3.5" b="0" c="0" d="0"/>'


def line_of(road_map: RoadMap, name: str) -> np.ndarray:
    roads = road_map.roads
    row = roads.row(name)
    return roads.points[roads.first[row] : roads.first[row + 1]]


def test_lanes_lie_beside_the_reference_line_in_driving_direction() -> None:
    road_map = read(road(sections=section([lane(2), lane(1), lane(0), lane(-1), lane(-2, kind="sidewalk")])))
    ends = {name: line_of(road_map, name)[[0, -1], :2].tolist() for name in road_map.roads.ids}
    assert ends == {
        "1.0.2": [[100.0, 5.25], [0.0, 5.25]],
        "1.0.1": [[100.0, 1.75], [0.0, 1.75]],
        "1.0.-1": [[0.0, -1.75], [100.0, -1.75]],
    }
    assert (road_map.roads.border == 1.75).all()
    assert "lanes that are no road for vehicles are left out: 1 of type sidewalk" in road_map.notes


def test_left_hand_traffic_turns_directions_and_sides() -> None:
    road_map = read(road(sections=section([lane(2), lane(1), lane(0), lane(-1)]), rule="LHT"))
    roads = road_map.roads
    assert line_of(road_map, "1.0.1")[:, 0].tolist() == sorted(line_of(road_map, "1.0.1")[:, 0].tolist())
    assert line_of(road_map, "1.0.-1")[0, 0] == 100.0
    inner, outer = roads.row("1.0.1"), roads.row("1.0.2")
    assert (roads.right[inner], roads.left[inner], roads.left[outer]) == (-1, outer, -1)
    assert roads.right[outer] == inner


def test_offset_moves_all_lanes_and_bends_have_points_every_half_metre() -> None:
    arc = geometry('<arc curvature="0.02"/>')
    offsets = '<laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="50" a="1.5" b="0" c="0" d="0"/>'
    road_map = read(road(plan=arc, sections=section([lane(0), lane(-1)]), offsets=offsets))
    line = line_of(road_map, "1.0.-1")
    radius = np.hypot(line[:, 0], line[:, 1] - 50.0)
    assert len(line) == 201
    assert radius[:99] == pytest.approx(51.75, abs=1e-9)
    assert radius[101:] == pytest.approx(50.25, abs=1e-9)


def test_straight_road_has_few_points_and_all_ends_of_records() -> None:
    heights = (
        '<elevationProfile><elevation s="0" a="1" b="0" c="0" d="0"/><elevation s="33.3" a="1" b="0.05" c="0" d="0"/>'
        "</elevationProfile>"
    )
    line = line_of(read(road(more=heights)), "1.0.-1")
    assert len(line) < 25
    assert (line[line[:, 0] == 33.3][0, 2], line[-1, 2]) == (1.0, pytest.approx(1.0 + 66.7 * 0.05))


def test_superelevation_lifts_the_left_edge() -> None:
    tilt = '<lateralProfile><superelevation s="0" a="0.05" b="0" c="0" d="0"/></lateralProfile>'
    road_map = read(road(sections=section([lane(1), lane(0), lane(-1)]), more=tilt))
    roads = road_map.roads
    for name, sign in (("1.0.1", 1.0), ("1.0.-1", -1.0)):
        row, line = roads.row(name), line_of(road_map, name)
        assert line[:, 1] == pytest.approx(sign * 1.75 * math.cos(0.05))
        assert line[:, 2] == pytest.approx(sign * 1.75 * math.sin(0.05))
        assert roads.bank[roads.first[row]] == pytest.approx(-sign * math.tan(0.05) * np.ones(2))


def test_edges_follow_the_width_of_the_lane() -> None:
    wider = '<width sOffset="0" a="3" b="0" c="0.0003" d="-0.000002"/>'
    road_map = read(road(sections=section([lane(0), lane(-1, width=wider)])))
    roads = road_map.roads
    _, right, _ = roads.edge_lines()
    s = right[:, 0]
    assert right[:, 1] == pytest.approx(-(3.0 + 0.0003 * s**2 - 0.000002 * s**3), abs=2e-3)
    assert roads.width[0] == pytest.approx(3.0 + 0.75 - 0.25)


def test_lane_begins_where_it_is_half_a_metre_wide_and_one_without_width_is_left_out() -> None:
    nothing = '<width sOffset="0" a="0.2" b="0" c="0" d="0"/>'
    road_map = read(road(sections=section([lane(0), lane(-1, width=OPENING), lane(-2, width=nothing)])))
    assert road_map.roads.ids == ("1.0.-1",)
    assert line_of(road_map, "1.0.-1")[0, 0] == pytest.approx(5.0, abs=0.51)
    assert "1 lanes without width or length are left out: 1.0.-2" in road_map.notes


def test_section_ends_where_the_next_one_begins_and_its_records_count_from_there() -> None:
    second = section([lane(0), lane(-1, width=TAPER)], 60.0)
    road_map = read(road(sections=section([lane(0), lane(-1)]) + second))
    assert line_of(road_map, "1.0.-1")[[0, -1], 0].tolist() == [0.0, 60.0]
    line = line_of(road_map, "1.1.-1")
    at = line[line[:, 0] >= 70.0][0, 0] - 60.0
    assert line[line[:, 0] >= 70.0][0, 1] == pytest.approx(-0.5 * (0.0105 * at**2 - 0.00035 * at**3))


def test_speed_limits_have_units_and_cut_the_lanes_where_they_change() -> None:
    kinds = (
        '<type s="0" type="town"><speed max="30" unit="mph"/></type>'
        '<type s="40" type="town"><speed max="50" unit="km/h"/></type>'
        '<type s="99.5" type="town"><speed max="no limit"/></type>'
    )
    own = '<speed sOffset="70" max="5"/>'
    road_map = read(road(sections=section([lane(0), lane(-1, own), lane(-2)]), more=kinds))
    roads = road_map.roads
    limits = dict(zip(roads.ids, roads.speed_limit.round(4).tolist(), strict=True))
    assert {name: limit for name, limit in limits.items() if ".-1" in name} == {
        "1.0.-1": 13.4112,
        "1.0.-1.1": 13.8889,
        "1.0.-1.2": 5.0,
    }
    assert limits["1.0.-2.2"] == 13.8889
    assert line_of(road_map, "1.0.-1.1")[[0, -1], 0].tolist() == [40.0, 70.0]
    assert [roads.ids[row] for row in roads.successors(roads.row("1.0.-1"))] == ["1.0.-1.1"]


def test_marks_become_lines_with_shapes_colours_and_kinds() -> None:
    centre = '<roadMark sOffset="0" type="solid broken" color="yellow"/><roadMark sOffset="60" type="none"/>'
    broken, kerb = '<roadMark sOffset="0" type="broken" color="standard"/>', '<roadMark type="curb"/>'
    lanes = [lane(1, '<roadMark type="broken solid"/>'), lane(0, centre), lane(-1, broken), lane(-2, kerb)]
    found = read(road(sections=section(lanes))).borders
    told = {one.name: (one.type, one.shape, one.colour, one.line[[0, -1], :2].tolist()) for one in found}
    assert told == {
        "1.0.1": (505, ("Solid", "Broken"), ("white",), [[0.0, 3.5], [100.0, 3.5]]),
        "1.0.0": (501, ("Solid", "Broken"), ("yellow",), [[0.0, 0.0], [60.0, 0.0]]),
        "1.0.-1": (503, ("Broken",), ("white",), [[0.0, -3.5], [100.0, -3.5]]),
        "1.0.-2": (599, ("Solid",), ("white",), [[0.0, -7.0], [100.0, -7.0]]),
    }


def test_marks_that_only_repeat_the_one_before_are_no_lines_of_their_own() -> None:
    kinds = ((50, "solid"), (0, "broken"), (20, "broken"))
    marks = "".join(f'<roadMark sOffset="{s}" type="{kind}"/>' for s, kind in kinds)
    found = read(road(sections=section([lane(0), lane(-1, marks)]))).borders
    assert [(one.shape, one.line[[0, -1], 0].tolist()) for one in found] == [
        (("Broken",), [0.0, 50.0]),
        (("Solid",), [50.0, 100.0]),
    ]


def test_shapes_that_do_not_meet_are_told() -> None:
    plan = geometry(LINE, 50.0) + geometry(LINE, 50.0, 50.0, x=50.1, hdg=0.5)
    notes = read(road(plan=plan), road("2")).notes
    assert any(note.endswith("1 degree: road 1 at 50.00 m: 10 cm, 29 degrees") for note in notes)
    assert not any("do not meet" in note for note in read(road("2")).notes)


def test_short_shapes_and_sections_make_no_lanes_without_length() -> None:
    plan = geometry(LINE, 1e-7) + geometry(LINE, 100.0, 1e-7)
    parts = section([lane(0), lane(-1)]) + section([lane(0), lane(-1)], 50.0) + section([lane(0), lane(-1)], 50.0000001)
    assert read(road(plan=plan, sections=parts)).roads.ids == ("1.0.-1", "1.2.-1")


def test_section_at_the_very_end_of_a_road_has_no_lanes() -> None:
    both = section([lane(0), lane(-1)]) + section([lane(0), lane(-1)], s=100.0)
    assert read(road(sections=both)).roads.ids == ("1.0.-1",)

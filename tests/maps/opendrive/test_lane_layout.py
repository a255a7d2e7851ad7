"""Lanes of roads as lines: widths, offsets, heights, superelevation, sides of traffic, sections, narrow ends, marks."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive import lane_layout
from rosbridge_sim.maps.opendrive.lane_layout import (
    LanePiece,
    RoadLayouts,
    SectionLayout,
    find_limit,
    frame_at,
    lay_lanes,
    mark_shapes,
)
from rosbridge_sim.maps.opendrive.road_elements import RoadMark
from rosbridge_sim.maps.road_map import RoadMap
from tests.maps.opendrive.xodr_texts import LINE, follows, geometry, joined, lane, link, read, record, road, section

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


# Stations


def stations(text: str, *cuts: float, number: int = 0) -> list[float]:
    """Distances between the stations of a section, rounded."""
    own = record(text)
    s = SectionLayout(own, own.sections[number], cuts).s.tolist()
    return [round(there - here, 6) for here, there in pairwise(s)]


def heights(c: float = 0.0, d: float = 0.0) -> str:
    return f'<elevationProfile><elevation s="0" a="0" b="0" c="{c}" d="{d}"/></elevationProfile>'


def widths(*figures: float) -> str:
    a, b, c, d = figures
    return section([lane(0), lane(-1, width=f'<width sOffset="0" a="{a}" b="{b}" c="{c}" d="{d}"/>')])


@pytest.mark.parametrize(
    ("text", "num"),
    [
        (road(), 20),  # the longest step is 5 m
        (road(more=heights(0.0011)), 53),  # a chord of h metres is 0.0011 h^2 / 4 away: 1 mm at 1.907 m
        (road(more=heights(d=1e-5)), 87),  # at the far end the second derivative is 0.006 / m
        (road(sections=widths(3.5, 0.0, 0.0011, 0.0)), 53),
        (road(more=heights(0.0011), sections=widths(3.5, 0.0, 0.0011, 0.0)), 75),  # both together
        (road(more=heights(0.1)), 200),  # no step is shorter than half a metre
        (road(more=heights(-0.0011, 1e-5)), 69),  # from -0.0011 to +0.0019
        (road(sections=widths(0.6, -0.002, 0.0, 0.0)), 200),  # it becomes narrow
        (road(sections=section([lane(0), lane(-1), lane(-2, width='<width a="0.6" b="-0.002"/>')])), 200),
        (road(sections=widths(0.7, -0.0015, 0.0, 0.0)), 20),
        (road(sections=widths(0.2, 0.0, 0.0, 0.0)), 20),  # narrow all along: there is no place to find
        (road(more='<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'), 200),
        (road(plan=geometry('<arc curvature="0.001"/>')), 200),
    ],
)
def test_stations_are_as_close_as_lines_of_a_millimetre_need(text: str, num: int) -> None:
    assert stations(text) == [round(100.0 / num, 6)] * num


def test_each_shape_and_each_record_has_stations_of_its_own() -> None:
    plan = geometry(LINE, 40.0) + geometry('<arc curvature="0.001"/>', 20.0, 40.0, x=40.0) + geometry(LINE, 40.0, 60.0)
    assert stations(road(plan=plan)) == [5.0] * 8 + [0.5] * 40 + [5.0] * 8
    later = widths(3.5, 0.0, 0.0011, 0.0).replace('s="0.0"', 's="60"')
    both = road(sections=section([lane(0), lane(-1)]) + later)
    assert stations(both) == [5.0] * 12
    assert stations(both, number=1) == [round(40.0 / 21, 6)] * 21
    assert stations(both, 33.0) == [round(33.0 / 7, 6)] * 7 + [4.5] * 6
    assert stations(both, 80.0) == [5.0] * 12


def test_record_that_begins_with_another_one_has_no_station_of_its_own() -> None:
    lanes = [lane(0), lane(-1, '<roadMark sOffset="0" type="broken"/>')]
    both = section(lanes) + section(lanes, 50.0)
    offsets = '<laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="50.0000005" a="0" b="0" c="0" d="0"/>'
    own = record(road(sections=both, offsets=offsets))
    assert [SectionLayout(own, each).s[[0, -1]].tolist() for each in own.sections] == [[0.0, 50.0], [50.0, 100.0]]
    assert stations(road(sections=both, offsets=offsets)) == [5.0] * 10


@pytest.mark.parametrize(("text", "most"), [(road(), 79), (road(offsets=LINE), 79), (road(), 7)])
def test_road_of_too_many_points_is_refused(monkeypatch: pytest.MonkeyPatch, text: str, most: int) -> None:
    """It has 20 steps, and polynomials of the tilt, of the height, of lane 0 and of a width."""
    monkeypatch.setattr(lane_layout, "MAX_POINTS", most)
    with pytest.raises(DocumentError, match=rf"<road '1'>: expected a road that needs at most {most} points"):
        stations(text)
    monkeypatch.setattr(lane_layout, "MAX_POINTS", 80)
    assert len(stations(text)) == 20


# Lanes as records


def pieces_of(text: str, *cuts: float, number: int = 0) -> dict[str, LanePiece]:
    own = record(text)
    layout = SectionLayout(own, own.sections[number], cuts)
    return {piece.name: piece for piece in lay_lanes(own, number, layout, cuts)}


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_records_of_lanes_on_a_turned_road_have_the_figures_of_a_straight_one(rule: str) -> None:
    opening = '<width sOffset="0" a="0" b="0.1" c="0" d="0"/><width sOffset="35" a="3.5" b="0" c="0" d="0"/>'
    tilt = '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'
    closing = '<width sOffset="0" a="4" b="-0.05" c="0" d="0"/>'
    lanes = section([lane(2, width=closing), lane(1), lane(0), lane(-1), lane(-2, width=opening), lane(-3)])
    turned = road("r", plan=geometry(x=7.0, y=-3.0, hdg=2.0), sections=lanes, more=tilt, rule=rule)
    found = pieces_of(turned, 40.0)
    names = [f"r.0.{name}{piece}" for name in (2, 1, -1, -2, -3) for piece in ("", ".1")]
    assert list(found) == names
    cos, sin = math.cos(2.0), math.sin(2.0)
    for name, one in found.items():
        assert one.is_forward == ((one.lane < 0) == (rule == "RHT")), name
        assert (np.diff(one.s) > 0.0).all() == one.is_forward
        flat = one.aside * math.cos(0.1)
        assert one.line[:, 0] == pytest.approx(7.0 + cos * one.s - sin * flat)
        assert one.line[:, 1] == pytest.approx(-3.0 + sin * one.s + cos * flat)
        assert one.line[:, 2] == pytest.approx(one.aside * math.sin(0.1))
        assert one.bank == pytest.approx(np.full((len(one.s), 2), math.tan(0.1 if one.is_forward else -0.1)))
        assert one.length == pytest.approx(np.hypot(*np.diff(one.line[:, :2], axis=0).T).sum())
        middle = (20.0, 70.0)[one.piece]
        wide = {2: 4.0 - 0.05 * middle, -2: (2.0, 3.5)[one.piece]}.get(one.lane, 3.5)
        assert one.width == pytest.approx(wide), name
    ends = {name: sorted(one.s[[0, -1]].round(6).tolist()) for name, one in found.items()}
    assert {tuple(ends[name]) for name in names if "-2" not in name and not name.endswith(".2.1")} == {
        (0.0, 40.0),
        (40.0, 100.0),
    }
    assert ends["r.0.2.1"] == [40.0, 70.0]
    assert ends["r.0.-2"] == [5.0, 40.0]
    cuts = {name: one.is_cut for name, one in found.items() if any(one.is_cut)}
    is_right = rule == "RHT"
    assert cuts == {"r.0.2.1": (is_right, not is_right), "r.0.-2": (is_right, not is_right)}
    at = found["r.0.-2"].s.round(6).tolist().index(20.0)
    assert found["r.0.-2"].aside[at] == pytest.approx(-4.5)
    assert found["r.0.-3.1"].aside.round(9).tolist() == [-8.75] * len(found["r.0.-3.1"].s)


def test_piece_of_a_lane_that_has_no_width_yet_is_left_out_and_those_behind_it_are_not() -> None:
    found = pieces_of(road(sections=section([lane(0), lane(-1, width=OPENING), lane(-2)])), 4.0)
    assert {name: one.s[0] for name, one in found.items()} == {"1.0.-1.1": 5.0, "1.0.-2": 0.0, "1.0.-2.1": 4.0}


def test_edges_of_lanes_in_a_bend_are_half_a_width_away() -> None:
    arc = geometry('<arc curvature="0.02"/>', hdg=1.0)
    for one in pieces_of(road(plan=arc, sections=section([lane(1), lane(0), lane(-1)]))).values():
        assert one.border == pytest.approx(np.full((201, 2), 1.75), abs=1e-4)


def test_edges_of_a_lane_that_widens_are_across_its_own_line() -> None:
    """Its middle runs 0.05 aside for each metre, so its edges are nearer than half a width along the road."""
    (one,) = pieces_of(road(plan=geometry(hdg=1.0), sections=widths(3.0, 0.1, 0.0, 0.0))).values()
    assert one.border == pytest.approx((0.5 * (3.0 + 0.1 * one.s) / math.hypot(1.0, 0.05))[:, None].repeat(2, axis=1))


def test_lane_that_turns_on_the_spot_at_its_end_leads_on_and_one_without_length_is_left_out() -> None:
    """The middle of the lane is the centre of the bend, so that its line has no length there."""
    turn, lanes = math.pi, section([lane(0), lane(-1, link(after=-1))])
    half = geometry(f'<arc curvature="{-1.0 / 1.75}"/>', turn)
    bend = geometry(LINE, 10.0) + half.replace('s="0.0" x="0.0"', 's="10.0" x="10.0"')
    whole = read(
        road("1", plan=bend, length=10.0 + turn, sections=lanes, links=joined("successor", "road", "2")),
        road(
            "2",
            plan=geometry(
                LINE, x=10.0 + 1.75 * math.sin(turn / 1.75), y=-1.75 + 1.75 * math.cos(turn / 1.75), hdg=-turn / 1.75
            ),
        ),
        road("3", plan=half, length=turn),
    )
    assert follows(whole) == {"1.0.-1": ["2.0.-1"]}
    assert whole.roads.length.tolist() == pytest.approx([10.0, 100.0])
    assert "1 lanes without width or length are left out: 3.0.-1" in whole.notes


@pytest.mark.parametrize(
    ("plan", "length", "is_told"),
    [
        (geometry(x=9_999_950.0, length=40.0), 40.0, False),
        (geometry(x=9_999_950.0, length=60.0), 60.0, True),
        (geometry(y=-9_999_999.0, length=40.0), 40.0, True),
    ],
)
def test_lane_too_far_away_is_told_with_its_number(plan: str, length: float, is_told: bool) -> None:  # noqa: FBT001
    lanes = section([lane(2, kind="sidewalk"), lane(1), lane(0), lane(-1)])
    if not is_told:
        assert len(pieces_of(road(plan=plan, length=length, sections=lanes))) == 2
        return
    with pytest.raises(DocumentError, match=r"no longer than 2,000,000 m; lane -?1 of section 0 is not"):
        pieces_of(road(plan=plan, length=length, sections=lanes))


def test_speed_limit_of_a_place_is_the_last_one_before_it_and_that_of_the_lane_counts_first() -> None:
    kinds = '<type s="50" type="town"><speed max="20"/></type><type s="10" type="town"><speed max="10"/></type>'
    own = '<speed sOffset="20" max="5"/><speed sOffset="30" max="no limit"/>'
    one = record(road(sections=section([lane(0)]) + section([lane(0), lane(-1, own)], 40.0), more=kinds))
    limits = {s: find_limit(one, 1, -1, s) for s in (5.0, 10.0, 49.0, 50.0, 60.0, 70.0)}
    assert limits == {5.0: 0.0, 10.0: 10.0, 49.0: 10.0, 50.0: 20.0, 60.0: 5.0, 70.0: 20.0}


# Places beside the reference line


def test_middle_of_a_lane_is_found_by_its_road_and_distance() -> None:
    wide = '<width sOffset="0" a="3" b="0" c="0" d="0"/><width sOffset="20" a="4" b="0.1" c="0" d="0"/>'
    lanes = [lane(2), lane(1, width=wide), lane(0), lane(-1), lane(-2, width=wide)]
    offsets = '<laneOffset s="0" a="0.5" b="0" c="0" d="0"/>'
    own = record(road("1", sections=section(lanes) + section([lane(0), lane(-1)], 60.0), offsets=offsets))
    frames = RoadLayouts({"1": own, "left": record(road("left", rule="LHT"))})
    middles = {name: frames.middle("1", 30.0, name) for name in (2, 1, 0, -1, -2, -3)}
    assert middles == {2: 7.25, 1: 3.0, 0: 0.5, -1: -1.25, -2: -5.5, -3: None}
    assert [frames.middle("1", s, 1) for s in (-0.6, -0.4, 59.9, 60.0)] == [None, 2.0, 0.5 + 0.5 * 7.99, None]
    assert [frames.middle("1", s, -1) for s in (60.0, 100.4, 100.6)] == [-1.25, -1.25, None]
    assert frames.middle("2", 30.0, 0) is None
    less = record(road(sections=section([lane(0), lane(-1, width='<width a="-1"/>'), lane(-2)])))
    assert RoadLayouts({"1": less}).middle("1", 30.0, -2) == -1.75
    assert [frames.is_forward(name, lane_id) for name in ("1", "left") for lane_id in (1, -1)] == [
        *(False, True),
        *(True, False),
    ]


def test_place_beside_a_tilted_road_is_lifted() -> None:
    tilt = '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'
    hill = '<elevationProfile><elevation s="0" a="1" b="0.05" c="0" d="0"/></elevationProfile>'
    frames = RoadLayouts({"1": record(road(plan=geometry(x=3.0, y=4.0, hdg=2.0), more=tilt + hill))})
    flat, along, across = 2.0 * math.cos(0.1), (math.cos(2.0), math.sin(2.0)), (-math.sin(2.0), math.cos(2.0))
    expected = [base + 30.0 * one + flat * other for base, one, other in zip((3.0, 4.0), along, across, strict=True)]
    assert frames.point("1", 30.0, 2.0) == pytest.approx((*expected, 2.5 + 2.0 * math.sin(0.1), 2.0))


# Painted lines


def test_lines_end_exactly_where_marks_do_between_stations() -> None:
    marks = "".join(
        f'<roadMark sOffset="{s}" type="{kind}"/>' for s, kind in ((7, "solid"), (26.5, "grass"), (31, "x"))
    )
    arc = geometry('<arc curvature="0.02"/>', 30.0) + geometry(LINE, 70.0, 30.0, x=28.2, y=8.7, hdg=0.6)
    parts = section([lane(0), lane(-1)]) + section([lane(0, marks), lane(-1)], 20.0)
    found = {one.name: one.line for one in read(road(plan=arc, sections=parts)).borders}
    assert list(found) == ["1.1.0", "1.1.0.2"]
    whole = record(road(plan=arc, sections=parts))
    first, second = found.values()
    for line, s in ((first[0], 27.0), (first[-1], 46.5), (second[0], 51.0), (second[-1], 100.0)):
        assert line[:2] == pytest.approx(frame_at(whole, s, 0.0)[:2], abs=1e-4)
    # In the bend there are stations at each half metre, behind it at each 5 m.
    assert len(first) == len({27.0, 27.5, 28.0, 28.5, 29.0, 29.5, 30.0, 35.0, 40.0, 45.0, 46.5})
    assert len(second) == len({51.0, *range(55, 101, 5)})


def test_outermost_line_of_each_side_of_the_roadway_is_its_edge() -> None:
    mark = '<roadMark type="solid"/>'
    lanes = [*(lane(name, mark) for name in (2, 1, 0, -1)), lane(-2, mark, "shoulder"), lane(-3, mark, "border")]
    kinds = {one.name: one.type for one in read(road(sections=section(lanes))).borders}
    assert kinds == {"1.0.2": 505, "1.0.1": 503, "1.0.0": 501, "1.0.-1": 505, "1.0.-2": 505, "1.0.-3": 505}


@pytest.mark.parametrize(
    ("kind", "shapes"),
    [
        ("broken", ("Broken",)),
        ("solid broken", ("Solid", "Broken")),
        ("botts dots", ("Broken", "Solid")),
        ("a b c", ("Solid", "Solid")),
    ],
)
def test_words_of_a_mark_are_its_lines(kind: str, shapes: tuple[str, ...]) -> None:
    assert mark_shapes(RoadMark(0.0, kind, "standard")) == shapes

"""Roads and junctions as records: each value of their elements, its default, and what is told about a wrong one."""

from __future__ import annotations

import pytest

from rosbridge_sim.documents.xml_documents import read_children
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive.plan_view import PlanShape
from rosbridge_sim.maps.opendrive.road_elements import (
    Connection,
    Junction,
    LaneElement,
    RoadEnd,
    RoadMark,
    is_needed_object,
    read_junction,
)
from tests.maps.opendrive.xodr_texts import document, geometry, joined, lane, link, record, road, section


def read_junction_of(text: str) -> Junction:
    elements = read_children([document(text)], "a.xodr", "OpenDRIVE")
    return read_junction(next(each for each in elements if each.tag == "junction"))


def test_ends_of_a_road_are_those_of_other_roads_or_junctions() -> None:
    one = record(road(links=joined("predecessor", "road", "7", "end") + joined("successor", "junction", "9")))
    assert (one.before, one.after, one.junction) == (RoadEnd("7", is_start=False), RoadEnd(junction="9"), "")
    two = record(road(links='<successor elementId="8"/>', junction="4"))
    assert (two.before, two.after, two.junction) == (None, RoadEnd("8", is_start=True), "4")
    assert [record(road(rule=rule)).is_left_hand for rule in ("", "RHT", "LHT")] == [False, False, True]


def test_polynomials_are_sorted_and_begin_where_they_say() -> None:
    heights = '<elevation s="50" a="1" b="2" c="3" d="4"/><elevation s="0" a="5" b="6" c="7" d="8"/>'
    tilts = '<superelevation s="10" a="0.1" b="0" c="0" d="0"/>'
    more = f"<elevationProfile>{heights}</elevationProfile><lateralProfile>{tilts}</lateralProfile>"
    one = record(road(more=more, offsets='<laneOffset s="20" a="1.5" b="0" c="0" d="0"/>'))
    assert one.elevation.tolist() == [[0.0, 5.0, 6.0, 7.0, 8.0], [50.0, 1.0, 2.0, 3.0, 4.0]]
    assert (one.roll.tolist(), one.offset.tolist()) == ([[10.0, 0.1, 0, 0, 0]], [[20.0, 1.5, 0, 0, 0]])
    assert record(road()).roll.shape == (0, 5)


@pytest.mark.parametrize(
    ("shape", "kind", "figures"),
    [
        ("<line/>", "line", ()),
        ('<arc curvature="-100"/>', "arc", (-100.0,)),
        ('<spiral curvStart="100" curvEnd="-0.5"/>', "spiral", (100.0, -0.5)),
        ('<poly3 a="1" b="2" c="300" d="4"/>', "poly3", (1.0, 2.0, 300.0, 4.0)),
        (
            '<paramPoly3 aU="1" bU="2" cU="3" dU="4" aV="5" bV="6" cV="7" dV="8"/>',
            "paramPoly3",
            (1.0, *range(1, 9)),
        ),
        (
            '<paramPoly3 pRange="arcLength" aU="1" bU="2" cU="3" dU="4" aV="5" bV="6" cV="7" dV="8"/>',
            "paramPoly3",
            (0.0, *range(1, 9)),
        ),
        ('<userData/><arc curvature="0.1"/>', "arc", (0.1,)),
    ],
)
def test_shapes_have_the_figures_of_their_kind(shape: str, kind: str, figures: tuple[float, ...]) -> None:
    one = record(road(plan=geometry(shape, 0.25, x=1.0, y=2.0, hdg=3.0), length=0.25))
    assert one.shapes == (PlanShape(0.0, 1.0, 2.0, 3.0, 0.25, kind, figures),)


def test_shapes_are_sorted_and_one_without_length_has_a_trifle_of_it() -> None:
    one = record(road(plan=geometry(length=50.0, s=50.0) + geometry(length=0.0)))
    assert [(shape.s, shape.length) for shape in one.shapes] == [(0.0, 1e-9), (50.0, 50.0)]


def test_sections_end_where_others_begin_and_have_the_records_of_their_lanes() -> None:
    own = '<speed sOffset="5" max="36" unit="km/h"/><speed max="10" unit="mph"/><speed sOffset="9" max="undefined"/>'
    marks = '<roadMark sOffset="9"/><roadMark type="solid" color="yellow"/><roadMark sOffset="5" type="solid"/>'
    lanes = [lane(1, link(2, 3)), lane(0), lane(-1, own + marks, width=""), lane(-2, kind="")]
    first, second = record(road(sections=section([lane(0)], 40.0) + section(lanes))).sections
    assert (first.start, first.end, second.start, second.end) == (0.0, 40.0, 40.0, 100.0)
    assert list(first.lanes) == [1, 0, -1, -2]
    one: LaneElement = first.lanes[-1]
    assert one.marks == (
        RoadMark(0.0, "solid", "yellow"),
        RoadMark(5, "solid", "standard"),
        RoadMark(9, "none", "standard"),
    )
    assert [(s, round(limit, 5)) for s, limit in one.speeds] == [(5.0, 10.0), (0.0, 4.4704), (9.0, 0.0)]
    assert (first.lanes[1].predecessors, first.lanes[1].successors) == ((2,), (3,))
    assert (one.widths.shape, first.lanes[1].widths.tolist()) == ((0, 5), [[0.0, 3.5, 0.0, 0.0, 0.0]])


def test_stop_lines_and_crosswalks_are_the_objects_that_are_kept() -> None:
    objects = (
        ('name="Stop_Line 3"', False),
        ('name="stop line"', True),
        ('type="roadMark" subtype="SignalLines"', True),
        ('type="roadMark" subtype="stopLine"', True),
        ('type="roadMark" subtype="arrow"', False),
        ('type="barrier" subtype="stopLine"', False),
        ('type="crossWalk"', True),
        ('type="tree"', False),
    )
    texts = [f'<object id="{i}" s="1" t="0" {words}/>' for i, (words, _) in enumerate(objects)]
    kept = record(road(more=f"<objects>{''.join(texts)}</objects>")).objects
    wanted = [str(i) for i, (words, is_kept) in enumerate(objects) if is_kept or words == 'name="Stop_Line 3"']
    assert [one.attributes["id"] for one in kept] == wanted
    assert all(map(is_needed_object, kept))


def test_connections_of_a_junction_have_their_roads_and_lanes() -> None:
    connections = (
        '<connection id="0" incomingRoad="1" connectingRoad="5" contactPoint="end"><laneLink from="-1" to="2"/>'
        '<laneLink from="-2" to="3"/></connection><connection id="1" incomingRoad="2" linkedRoad="6"/>'
    )
    found = read_junction_of(f'<junction id="9">{connections}<controller id="a"/><controller id="b"/></junction>')
    assert found == Junction(
        "9",
        (Connection("1", "5", is_start=False, links=((-1, 2), (-2, 3))), Connection("2", "6", is_start=True, links=())),
        ("a", "b"),
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (road(plan="<geometries/>"), "<road '1'>: expected a <geometry> in <planView>; there is none"),
        (road(plan=geometry("")), "<geometry>: expected one of line, arc, spiral, poly3, paramPoly3, got 'nothing'"),
        (
            road(plan=geometry('<arc curvature="-100.5"/>')),
            "<arc>: curvature: expected a number -100..100, got '-100.5'",
        ),
        (
            road(plan=geometry('<spiral curvStart="0" curvEnd="101"/>')),
            "<spiral>: curvEnd: expected a number -100..100, got '101'",
        ),
        (road(plan=geometry(x=1.1e7)), "<geometry>: x: expected a number -1e+07..1e+07, got '11000000.0'"),
        (road(plan=geometry(length=-1.0)), "<geometry>: length: expected a number 0..1e+06, got '-1.0'"),
        (road(length=1.1e6), "<road '1'>: length: expected a number 0..1e+06, got '1100000.0'"),
        (road(sections="<laneSections/>"), "<lanes>: expected a <laneSection>; there is none"),
        (road(sections=section([lane(0)], -1.0)), "<laneSection>: s: expected a number 0..1e+06, got '-1.0'"),
        (road(sections=section([lane(2), lane(0)])), "expected lanes without gaps; lane 1 is missing"),
        (road(sections=section([lane(-201)])), "<lane '-201'>: id: expected a number -200..200, got '-201'"),
        (
            road(offsets='<laneOffset s="-1" a="0" b="0" c="0" d="0"/>'),
            "<laneOffset>: s: expected a number 0..1e+06, got '-1'",
        ),
        (
            road(sections=section([lane(-1, width='<width sOffset="2e6" a="0" b="0" c="0" d="0"/>')])),
            "<width>: sOffset: expected a number 0..1e+06, got '2e6'",
        ),
        (
            road(more='<type s="0"><speed max="1001"/></type>'),
            "<speed>: max: expected a number 0..1,000, got '1001'",
        ),
    ],
)
def test_wrong_value_is_told_with_its_element(text: str, told: str) -> None:
    with pytest.raises(DocumentError) as caught:
        record(text)
    assert told in str(caught.value)


def test_road_without_lanes_or_plan_is_told() -> None:
    for part in ("lanes", "planView"):
        text = road()
        begin, end = text.index(f"<{part}>"), text.index(f"</{part}>") + len(f"</{part}>")
        with pytest.raises(DocumentError, match=rf"<road '1'>: expected a <{part}>; there is none"):
            record(text[:begin] + text[end:])


def test_lane_with_borders_alone_is_told_but_lane_0_needs_no_width() -> None:
    border = '<border sOffset="0" a="3"/>'
    assert record(road(sections=section([lane(0, border), lane(-1)]))).sections[0].lanes[0].widths.shape == (0, 5)

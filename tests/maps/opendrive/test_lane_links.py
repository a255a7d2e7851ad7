"""Which lanes follow one another and lie side by side: roads, sections, junctions, wrong ends, gaps, marks."""

from __future__ import annotations

import math

import pytest

from rosbridge_sim.maps.opendrive.lane_links import find_cuts, forbids_change, spread_cuts
from tests.maps.opendrive.xodr_texts import follows, geometry, joined, lane, link, read, record, road, section

BOTH = section([lane(1), lane(0), lane(-1)])


def test_lanes_of_sections_follow_one_another_by_either_record() -> None:
    first = section([lane(2), lane(1), lane(0), lane(-1, link(after=-2))])
    second = section([lane(1, link(before=2)), lane(0), lane(-1), lane(-2)], 50.0)
    assert follows(read(road(sections=first + second))) == {"1.0.-1": ["1.1.-2"], "1.1.1": ["1.0.2"]}


@pytest.mark.parametrize(("contact", "hdg", "x"), [("start", 0.0, 100.0), ("end", math.pi, 200.0)])
def test_roads_are_joined_by_the_ends_that_touch(contact: str, hdg: float, x: float) -> None:
    """At a join of two starts or two ends the ids change their sign."""
    other = -1 if contact == "start" else 1
    one = road(
        "1", sections=section([lane(0), lane(-1, link(after=other))]), links=joined("successor", "road", "2", contact)
    )
    two = road("2", plan=geometry(x=x, hdg=hdg), sections=BOTH)
    assert follows(read(one, two)) == {"1.0.-1": [f"2.0.{other}"]}


def junction(*connections: str, kind: str = "default") -> str:
    return f'<junction id="9" name="" type="{kind}">{"".join(connections)}</junction>'


def connection(one: str, two: str, links: dict[int, int], contact: str = "start", key: str = "connectingRoad") -> str:
    inner = "".join(f'<laneLink from="{a}" to="{b}"/>' for a, b in links.items())
    return f'<connection id="0" incomingRoad="{one}" {key}="{two}" contactPoint="{contact}">{inner}</connection>'


def crossing(contact: str = "end") -> list[str]:
    """A road from the west, a connecting road within the junction, and a road to the east."""
    return [
        road("1", sections=BOTH, links=joined("successor", "junction", "9")),
        road(
            "5",
            plan=geometry(length=20.0, x=100.0),
            length=20.0,
            junction="9",
            sections=section([lane(0), lane(-1, link(-1, -1))]),
            links=joined("predecessor", "road", "1", contact) + joined("successor", "road", "2"),
        ),
        road("2", plan=geometry(x=120.0), sections=BOTH, links=joined("predecessor", "junction", "9")),
    ]


def test_junction_joins_incoming_connecting_and_outgoing_road() -> None:
    expected = {"1.0.-1": ["5.0.-1"], "5.0.-1": ["2.0.-1"]}
    assert follows(read(*crossing(), junction(connection("1", "5", {-1: -1})))) == expected


def test_direct_junction_joins_roads_without_a_connecting_one() -> None:
    parts = [
        road("1", sections=section([lane(0), lane(-1), lane(-2)]), links=joined("successor", "junction", "9")),
        road("2", plan=geometry(x=100.0), links=joined("predecessor", "junction", "9")),
        road("3", plan=geometry(x=100.0, y=-3.5), links=joined("predecessor", "junction", "9")),
    ]
    links = [connection("1", name, {lane_id: -1}, key="linkedRoad") for name, lane_id in (("2", -1), ("3", -2))]
    assert follows(read(*parts, junction(*links, kind="direct"))) == {"1.0.-1": ["2.0.-1"], "1.0.-2": ["3.0.-1"]}


def test_link_to_the_far_end_of_a_road_is_taken_to_the_near_one_and_told() -> None:
    """An early exporter of MORAI wrote all contact points the wrong way round."""
    road_map = read(*crossing("start"), junction(connection("1", "5", {-1: -1})))
    assert follows(road_map) == {"1.0.-1": ["5.0.-1"], "5.0.-1": ["2.0.-1"]}
    assert any("wrong end of a road; the near one is taken: road 5 - road 1" in note for note in road_map.notes)


@pytest.mark.parametrize(("contact", "is_told"), [("start", False), ("end", True)])
def test_wrong_end_of_a_road_shorter_than_a_gap_is_turned(contact: str, *, is_told: bool) -> None:
    """K-City's roundabouts have roads of half a metre: both ends are near, and vehicles leave both lanes at one."""
    lanes = section([lane(0), lane(-1, link(after=-1))])
    short = road("2", plan=geometry(x=100.0, length=0.6), length=0.6)
    road_map = read(road("1", sections=lanes, links=joined("successor", "road", "2", contact)), short)
    assert follows(road_map) == {"1.0.-1": ["2.0.-1"]}
    assert any("the near one is taken: road 1 - road 2" in note for note in road_map.notes) == is_told


def test_lanes_that_both_end_where_they_are_linked_do_not_follow() -> None:
    """The other end of a lane is not taken for the named one where it is farther away."""
    lanes = section([lane(0), lane(-1, link(after=1))])
    against = road("2", plan=geometry(x=100.0, y=-3.5, length=0.6), length=0.6, sections=section([lane(1), lane(0)]))
    road_map = read(road("1", sections=lanes, links=joined("successor", "road", "2", "start")), against)
    assert (follows(road_map), road_map.notes[1:]) == ({}, ())


def test_lane_that_only_the_near_end_of_the_other_road_has_is_taken_there() -> None:
    lanes = section([lane(0), lane(-1), lane(-2, link(after=-2))])
    wide, narrow = section([lane(0), lane(-1), lane(-2)]), section([lane(0), lane(-1)], 50.0)
    other = road("2", plan=geometry(x=100.0), sections=wide + narrow)
    road_map = read(road("1", sections=lanes, links=joined("successor", "road", "2", "end")), other)
    assert follows(road_map) == {"1.0.-2": ["2.0.-2"]}
    assert any("the near one is taken: road 1 - road 2" in note for note in road_map.notes)


def test_gaps_are_told_and_lanes_that_are_torn_do_not_follow() -> None:
    near = road("2", plan=geometry(x=100.2))
    far = road("3", plan=geometry(x=300.0))
    lanes = section([lane(0), lane(-1, link(after=-1))])
    for other, told, after in (
        (near, "1 lanes that follow one another over a gap of more than 1 cm: 1.0.-1 -> 2.0.-1 0.20 m", ["2.0.-1"]),
        (far, "1 lanes that are linked over more than 5 m do not follow one another: 1.0.-1 -> 3.0.-1 200.00 m", []),
    ):
        name = "2" if after else "3"
        road_map = read(road("1", sections=lanes, links=joined("successor", "road", name)), other)
        assert told in road_map.notes
        assert follows(road_map) == ({"1.0.-1": after} if after else {})


def test_link_to_nothing_and_link_without_width_are_told() -> None:
    gone = road("1", sections=section([lane(0), lane(-1, link(after=-3))]), links=joined("successor", "road", "7"))
    notes = read(gone, junction(connection("1", "8", {-1: -1}))).notes
    assert any(
        "2 links to roads and lanes that are not there: road 1 lane -1 -> road 7 lane -3, junction 9: road 1 -> road 8"
        in note
        for note in notes
    )
    closing = '<width sOffset="0" a="3.5" b="-0.07" c="0" d="0"/>'
    first = section([lane(0), lane(-1), lane(-2, link(after=-1), width=closing)])
    road_map = read(road(sections=first + section([lane(0), lane(-1)], 50.0)))
    assert any("1 links at the end of a lane where it has no width are left out" in note for note in road_map.notes)
    assert follows(road_map) == {}


@pytest.mark.parametrize(
    ("mark", "outwards", "inwards"),
    [
        ("broken", False, False),
        ("solid", True, True),
        ("none", False, False),
        ("solid broken", True, False),
        ("broken solid", False, True),
        ("solid solid", True, True),
        ("curb", True, True),
    ],
)
def test_solid_line_on_the_side_of_the_vehicle_forbids_a_change(mark: str, outwards: bool, inwards: bool) -> None:  # noqa: FBT001
    assert forbids_change(mark, is_outwards=True) == outwards
    assert forbids_change(mark, is_outwards=False) == inwards
    lanes = [lane(0), lane(-1, f'<roadMark sOffset="0" type="{mark}" laneChange="none"/>'), lane(-2)]
    roads = read(road(sections=section(lanes))).roads
    inner, outer = roads.row("1.0.-1"), roads.row("1.0.-2")
    assert (roads.right[inner], roads.left[outer]) == (-1 if outwards else outer, -1 if inwards else inner)
    assert (roads.left[inner], roads.right[outer]) == (-1, -1)


def test_lanes_are_cut_where_a_change_becomes_forbidden() -> None:
    marks = '<roadMark sOffset="0" type="broken"/><roadMark sOffset="70" type="solid"/>'
    roads = read(road(sections=section([lane(0), lane(-1, marks), lane(-2)]))).roads
    assert roads.ids == ("1.0.-1", "1.0.-1.1", "1.0.-2", "1.0.-2.1")
    assert (roads.right.tolist(), roads.left.tolist()) == ([2, -1, -1, -1], [-1, -1, 0, -1])


def test_parking_lane_and_oncoming_lane_are_no_neighbours() -> None:
    roads = read(road(sections=section([lane(1), lane(0), lane(-1), lane(-2, kind="parking")]))).roads
    assert roads.left.tolist() == roads.right.tolist() == [-1, -1, -1]


# Roundabouts


def loop(radius: float, straight: float) -> list[str]:
    """Two half circles, with or without streets between, a road towards one of them, and its entry."""
    turn, width = math.pi * radius, 2.0 * radius
    length, lanes = turn + straight, section([lane(0), lane(-1, link(-1, -1))])
    arc = f'<arc curvature="{1.0 / radius}"/>'
    plans = [
        geometry(length=straight, x=x, y=y, hdg=hdg) + geometry(arc, turn, straight, x=end, y=y, hdg=hdg)
        if straight
        else geometry(arc, turn, x=x, y=y, hdg=hdg)
        for x, y, hdg, end in ((0.0, 0.0, 0.0, straight), (straight, width, math.pi, 0.0))
    ]
    ahead = joined("predecessor", "road", "1", "end") + joined("successor", "road", "7")
    entry = geometry(length=30.0, x=straight + 30.0, y=width, hdg=math.pi)
    return [
        road("6", plans[0], lanes, length, links=joined("successor", "road", "7")),
        road("7", plans[1], lanes, length, links=joined("successor", "road", "6")),
        road("1", plan=geometry(x=straight + 130.0, y=width, hdg=math.pi), links=joined("successor", "junction", "9")),
        road("5", entry, lanes, 30.0, junction="9", links=ahead),
        junction(connection("1", "5", {-1: -1})),
    ]


@pytest.mark.parametrize(
    ("radius", "straight", "gives_way"),
    [(10.0, 0.0, True), (20.0, 0.0, True), (30.0, 0.0, False), (3.0, 40.0, False)],
    ids=["circle", "larger circle", "ring road", "two turns and a street"],
)
def test_those_who_enter_a_roundabout_give_way(radius: float, straight: float, *, gives_way: bool) -> None:
    road_map = read(*loop(radius, straight))
    assert follows(road_map) == {"1.0.-1": ["5.0.-1"], "5.0.-1": ["7.0.-1"], "6.0.-1": ["7.0.-1"], "7.0.-1": ["6.0.-1"]}
    roads = road_map.roads
    stops = [name for name, is_stop in zip(roads.ids, roads.is_stop, strict=True) if is_stop]
    assert stops == (["1.0.-1"] if gives_way else [])
    assert any("1 lanes into roundabouts without a stop line" in note for note in road_map.notes) == gives_way


# Single records of links


def test_link_to_a_sidewalk_is_no_way_and_no_mistake() -> None:
    lanes = section([lane(0), lane(-1, link(after=-2))])
    other = road("2", plan=geometry(x=100.0), sections=section([lane(0), lane(-1), lane(-2, kind="sidewalk")]))
    road_map = read(road("1", sections=lanes, links=joined("successor", "road", "2")), other)
    assert (follows(road_map), [note for note in road_map.notes if "link" in note]) == ({}, [])


def test_record_of_the_road_ahead_alone_joins_the_last_section_of_the_road_behind() -> None:
    behind = section([lane(0), lane(-1)]) + section([lane(0), lane(-1), lane(-2)], 50.0)
    ahead = section([lane(0), lane(-1, link(before=-2))])
    road_map = read(
        road("1", sections=behind),
        road("2", plan=geometry(x=100.0, y=-3.5), sections=ahead, links=joined("predecessor", "road", "1", "end")),
    )
    assert follows(road_map) == {"1.1.-2": ["2.0.-1"]}


def test_connection_to_lanes_that_one_road_does_not_have_is_told() -> None:
    for links in ({-1: -2}, {-2: -1}):
        (one, other) = next(iter(links.items()))
        road_map = read(*crossing(), junction(connection("1", "5", links)))
        told = f"1 links to roads and lanes that are not there: junction 9: road 1 -> road 5: lanes {one} -> {other}"
        assert told in road_map.notes
        # The connecting road tells the same link by itself.
        assert follows(road_map) == {"1.0.-1": ["5.0.-1"], "5.0.-1": ["2.0.-1"]}


def test_connection_of_a_road_that_does_not_meet_the_junction_is_told() -> None:
    road_map = read(
        road("1"), road("5", plan=geometry(x=100.0), junction="9"), junction(connection("1", "5", {-1: -1}))
    )
    assert "1 links to roads and lanes that are not there: junction 9: road 1 -> road 5" in road_map.notes


def test_wrong_end_is_known_by_the_gap_between_the_very_ends() -> None:
    """The near ends are 3 m apart, the next points of the lanes 5 m farther."""
    lanes = section([lane(0), lane(-1, link(after=-1))])
    for contact in ("start", "end"):
        other = road("2", plan=geometry(x=103.0))
        road_map = read(road("1", sections=lanes, links=joined("successor", "road", "2", contact)), other)
        assert follows(road_map) == {"1.0.-1": ["2.0.-1"]}
    far = road("2", plan=geometry(x=105.5))
    assert follows(read(road("1", sections=lanes, links=joined("successor", "road", "2", "end")), far)) == {}


def test_of_two_ends_that_would_do_the_nearer_one_is_taken() -> None:
    """Vehicles leave both lanes at the ends that are named; either road may be the one that goes on."""
    one = road(
        "1",
        plan=geometry(length=3.0),
        length=3.0,
        sections=section([lane(0), lane(-1, link(after=-1))]),
        links=joined("successor", "road", "2", "end"),
    )
    for x, expected in ((1.5, {"2.0.-1": ["1.0.-1"]}), (2.4, {"1.0.-1": ["2.0.-1"]})):
        two = road("2", plan=geometry(x=x, y=-3.5, hdg=math.pi, length=0.5), length=0.5)
        assert follows(read(one, two)) == expected


def test_joins_are_told_from_the_widest_gap_and_five_of_them_by_name() -> None:
    lanes, roads = section([lane(0), lane(-1, link(after=-1))]), []
    for i in range(7):
        roads.append(
            road(f"a{i}", plan=geometry(y=10.0 * i), sections=lanes, links=joined("successor", "road", f"b{i}"))
        )
        roads.append(road(f"b{i}", plan=geometry(x=100.1 + 0.1 * i, y=10.0 * i)))
    examples = ", ".join(f"a{i}.0.-1 -> b{i}.0.-1 0.{i + 1}0 m" for i in (6, 5, 4, 3, 2))
    note = f"7 lanes that follow one another over a gap of more than 1 cm: {examples}, ..."
    assert note in read(*roads).notes
    torn = read(*(text.replace('x="100', 'x="108') for text in roads))
    assert any(note.startswith("7 lanes that are linked over more than 5 m do not follow") for note in torn.notes)
    assert not any("1 cm" in note for note in torn.notes)
    assert follows(torn) == {}


def test_roads_are_joined_by_the_outer_pieces_of_lanes_that_are_cut() -> None:
    lanes = section([lane(1, link(1, 1)), lane(0), lane(-1, link(-1, -1) + '<speed sOffset="50" max="5"/>')])
    ends = joined("predecessor", "road", "1", "end") + joined("successor", "road", "3")
    outer = [road(name, plan=geometry(x=x), sections=BOTH) for name, x in (("1", -100.0), ("3", 100.0))]
    assert follows(read(*outer, road("2", sections=lanes, links=ends))) == {
        "1.0.-1": ["2.0.-1"],
        "2.0.-1": ["2.0.-1.1"],
        "2.0.-1.1": ["3.0.-1"],
        "3.0.1": ["2.0.1.1"],
        "2.0.1.1": ["2.0.1"],
        "2.0.1": ["1.0.1"],
    }


def test_lane_that_begins_between_two_follows_both() -> None:
    both = '<link><predecessor id="-1"/><predecessor id="-2"/></link>'
    parts = section([lane(0), lane(-1), lane(-2)]) + section([lane(0), lane(-1, both)], 50.0)
    assert follows(read(road(sections=parts))) == {"1.0.-1": ["1.1.-1"], "1.0.-2": ["1.1.-1"]}


@pytest.mark.parametrize(("contact", "end"), [("start", "end"), ("end", "start"), ("start", "start")])
def test_connecting_road_tells_which_end_of_a_road_it_joins_where_both_are_at_the_junction(
    contact: str, end: str
) -> None:
    """Road 1 begins and ends at the junction; the connection is recorded there, and not by a lane."""
    is_end, is_start = end == "end", contact == "start"
    one = road("1", links=joined("predecessor", "junction", "9") + joined("successor", "junction", "9"), sections=BOTH)
    x, heading = (100.0 if is_end else 0.0), (0.0 if is_end == is_start else math.pi)
    x, heading = (x, heading) if is_start else (x + 20.0 * (1 if is_end else -1), heading)
    lanes = section([lane(1), lane(0), lane(-1)])
    plan = geometry(length=20.0, x=x, hdg=heading)
    tag = "predecessor" if is_start else "successor"
    own = road("5", plan=plan, length=20.0, junction="9", sections=lanes, links=joined(tag, "road", "1", end))
    from_lane = -1 if is_end else 1
    to_lane = -1 if is_start else 1
    road_map = read(one, own, junction(connection("1", "5", {from_lane: to_lane}, contact)))
    assert follows(road_map) == {f"1.0.{from_lane}": [f"5.0.{to_lane}"]}


# Cuts


def cuts_of(*lanes: str, s: float = 10.0, more: str = "") -> list[float]:
    own = record(road(sections=section([lane(0)]) + section(lanes, s), more=more))
    return sorted(find_cuts(own, own.sections[1]))


def marks(*kinds: str) -> str:
    return "".join(f'<roadMark sOffset="{20 * i}" type="{kind}"/>' for i, kind in enumerate(kinds))


def test_section_is_cut_where_a_change_of_lanes_becomes_another_on_either_side() -> None:
    kinds = ("broken", "solid broken", "solid", "solid solid", "broken solid", "broken", "broken broken")
    assert cuts_of(lane(0), lane(-1, marks(*kinds)), lane(-2)) == [30.0, 50.0, 90.0, 110.0]
    assert cuts_of(lane(2), lane(1, marks("solid", "broken")), lane(0, kind="none")) == [30.0]


def test_lines_at_the_edges_of_the_roadway_cut_nothing() -> None:
    kinds = marks("broken", "solid")
    assert cuts_of(lane(1), lane(0, kinds), lane(-1)) == []
    assert cuts_of(lane(0), lane(-1, kinds)) == []
    assert cuts_of(lane(0), lane(-1, kinds), lane(-2, kind="shoulder")) == []
    assert cuts_of(lane(0), lane(-1, kind="sidewalk", inner=kinds), lane(-2)) == []


def test_speed_limits_of_the_road_and_of_its_lanes_cut_it() -> None:
    limit = '<speed sOffset="15" max="5"/>'
    kinds = '<type s="40" type="town"/>'
    assert cuts_of(lane(0), lane(-1, limit), more=kinds) == [25.0, 40.0]
    assert cuts_of(lane(0), lane(-1, limit, "sidewalk"), more=kinds) == [40.0]


def test_cuts_keep_a_metre_from_the_ends_and_from_one_another() -> None:
    own = record(road(sections=section([lane(0)]) + section([lane(0)], 10.0)))
    cuts = {5.0, 10.5, 11.5, 12.0, 12.6, 98.5, 99.5, 120.0}
    assert spread_cuts(cuts, own.sections[1]) == [11.5, 12.6, 98.5]


def test_line_between_two_pieces_of_lanes_is_that_in_their_middle() -> None:
    """In a section that begins at 10 m the line becomes solid at 50 m: the pieces are 10 to 50 m and 50 to 100 m."""
    kinds = '<roadMark sOffset="0" type="broken"/><roadMark sOffset="40" type="solid"/>'
    parts = section([lane(0), lane(-1)]) + section([lane(0), lane(-1, kinds), lane(-2)], 10.0)
    roads = read(road(sections=parts)).roads
    beside = {name: roads.right[row] for row, name in enumerate(roads.ids)}
    assert beside == {
        "1.0.-1": -1,
        "1.1.-1": roads.row("1.1.-2"),
        "1.1.-1.1": -1,
        "1.1.-2": -1,
        "1.1.-2.1": -1,
    }

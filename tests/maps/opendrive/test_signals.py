"""Lights, signs, stop lines, crosswalks and the default plan of OpenDRIVE maps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive.signal_elements import StopPlace, find_stop_cuts, find_stops
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.world.roads.signal_plan import Lamp
from rosbridge_sim.world.state.world import DT
from tests.maps.opendrive.xodr_texts import geometry, joined, lane, link, read, record, road, section

BOTH = section([lane(1), lane(0), lane(-1)])


def signal(name: str, s: float, kind: str = "1000001", *, way: str = "+", inner: str = "", t: float = -4.0) -> str:
    dynamic = "yes" if kind.startswith("10000") else "no"
    return (
        f'<signal id="{name}" s="{s}" t="{t}" type="{kind}" country="OpenDRIVE" orientation="{way}" '
        f'dynamic="{dynamic}" zOffset="3">{inner}</signal>'
    )


def on_road(*signals: str) -> str:
    return f"<signals>{''.join(signals)}</signals>"


def valid(low: int, high: int) -> str:
    return f'<validity fromLane="{low}" toLane="{high}"/>'


def crossing(more: dict[str, str] | None = None, controllers: str = "", *, extra: str = "", name: str = "9") -> RoadMap:
    """Four roads of 100 m that lead to a crossing of 20 m; within it, two straight ways each over the other two.

    The roads W, E, S and N end at the crossing. WE and EW cross SN and NS.
    """
    more = more or {}
    arms = {
        "W": (-110.0, 0.0, 0.0),
        "E": (110.0, 0.0, math.pi),
        "S": (0.0, -110.0, math.pi / 2),
        "N": (0.0, 110.0, -math.pi / 2),
    }
    parts = [
        road(
            name,
            plan=geometry(x=x, y=y, hdg=hdg),
            sections=BOTH,
            links=joined("successor", "junction", "9"),
            more=more.get(name, ""),
        )
        for name, (x, y, hdg) in arms.items()
    ]
    inner = section([lane(0), lane(-1, link(-1, 1))])
    connections = ""
    for one, other in ("WE", "EW", "SN", "NS"):
        x, y, hdg = arms[one]
        parts.append(
            road(
                one + other,
                plan=geometry(x=x / 11.0, y=y / 11.0, hdg=hdg, length=20.0),
                length=20.0,
                sections=inner,
                junction="9",
                links=joined("predecessor", "road", one, "end") + joined("successor", "road", other, "end"),
                more=more.get(one + other, ""),
            )
        )
        connections += (
            f'<connection id="{one}" incomingRoad="{one}" connectingRoad="{one}{other}" contactPoint="start">'
            '<laneLink from="-1" to="-1"/></connection>'
        )
    parts += [extra, controllers, f'<junction id="9" name="">{connections}</junction>']
    return read(*(part.replace('"9"', f'"{name}"') for part in parts))


def lights_of(road_map: RoadMap) -> dict[str, list[str]]:
    return {light.name: [road_map.roads.ids[row] for row in light.lanes] for light in road_map.plan.lights}


ALL_ARMS = {name: on_road(signal(f"T{name}", 98.0)) for name in "WESN"}


def test_light_before_a_junction_controls_the_lanes_behind_the_end_of_its_road() -> None:
    road_map = crossing(ALL_ARMS)
    assert lights_of(road_map) == {
        "TW": ["WE.0.-1"],
        "TE": ["EW.0.-1"],
        "TS": ["SN.0.-1"],
        "TN": ["NS.0.-1"],
    }
    light = road_map.plan.lights[0]
    assert (light.x, light.y, light.z) == pytest.approx((-12.0, -4.0, 3.0))
    assert abs(light.yaw) == pytest.approx(math.pi)


def test_references_take_the_place_of_the_light_and_validity_that_of_orientation() -> None:
    """CARLA: the light stands anywhere, and is referred to within the junction with the other orientation."""
    reference = f'<signalReference id="T" s="1" t="0" orientation="-">{valid(-1, -1)}</signalReference>'
    road_map = crossing({"N": on_road(signal("T", 50.0, way="-", inner=valid(0, 0))), "WE": on_road(reference)})
    assert lights_of(road_map) == {"T": ["WE.0.-1"]}


def test_light_without_a_junction_cuts_its_road() -> None:
    road_map = read(road(sections=BOTH, more=on_road(signal("T", 60.0, inner=valid(-1, -1)))))
    assert lights_of(road_map) == {"T": ["1.0.-1.1"]}
    roads = road_map.roads
    assert roads.points[roads.first[roads.row("1.0.-1.1")], 0] == 60.0


def shown(road_map: RoadMap) -> list[tuple[float, str]]:
    """Lengths of the phases of the only junction, and the lights that are green in each."""
    (controller,) = road_map.plan.controllers
    return [
        (
            round(phase.duration * DT, 2),
            " ".join(
                road_map.plan.lights[row].name
                for group, colour in zip(controller.groups, phase.colours, strict=True)
                for row in group
                if colour & Lamp.GREEN
            ),
        )
        for phase in controller.phases
    ]


def test_default_plan_lets_those_go_together_that_do_not_cross() -> None:
    road_map = crossing(ALL_ARMS)
    phases = shown(road_map)
    assert [names for _, names in phases] == ["TW TE", "", "TS TN", ""]
    assert [seconds for seconds, _ in phases] == [20.0, 1.9, 20.0, 1.9]  # (20 m + 6.1 m) / 13.9 m/s
    assert [frames * DT for frames in road_map.plan.controllers[0].yellow] == pytest.approx([3.3] * 4)
    assert "OpenDRIVE has no times of lights: 1 junctions with lights have a default plan" in road_map.notes


def test_no_two_crossing_lanes_are_ever_green_or_yellow_together() -> None:
    plan = crossing(ALL_ARMS).plan
    assert plan is not None
    lit = plan.colours & int(Lamp.GREEN | Lamp.YELLOW) != 0
    column = plan.column[plan.group]
    west, south = lit[:, column[plan.light("TW")]], lit[:, column[plan.light("TS")]]
    assert west.any()
    assert south.any()
    assert not (west & south).any()


def test_controller_of_the_file_makes_a_group_and_pedestrians_have_their_own_time() -> None:
    walk = [signal(f"P{side}", 97.0, "1000002", inner=valid(-1, 1), t=t) for side, t in (("l", 4.0), ("r", -4.0))]
    control = "".join(f'<control signalId="{name}"/>' for name in ("TS", "TN", "TN"))
    control = f'<controller id="7" name="">{control}</controller>'
    road_map = crossing({**ALL_ARMS, "W": on_road(signal("TW", 98.0), *walk)}, control)
    (controller,) = road_map.plan.controllers
    names = [[road_map.plan.lights[row].name for row in group] for group in controller.groups]
    assert names == [["TS", "TN"], ["TW"], ["Pl", "Pr"], ["TE"]]
    # TE leads into W, which is crossed; TS and TN lead elsewhere.
    assert [names for _, names in shown(road_map)] == ["TS TN Pl Pr", "", "TW TE", ""]
    (walk_time,) = controller.walks
    assert (walk_time.green * DT, walk_time.flashing * DT) == pytest.approx((7.0, 7.0 / 1.07), abs=0.02)


@pytest.mark.parametrize(
    ("more", "ends"),
    [
        (on_road(signal("s", 30.0, "294", inner=valid(-1, -1))), ["1.0.-1"]),
        (on_road(signal("s", 30.0, "206")), ["1.0.-1"]),
        (on_road(signal("s", 30.0, "205", way="-")), ["1.0.1.1"]),
        ('<objects><object id="o" type="-1" name="StopLine" s="30" t="-1.7" length="3.4"/></objects>', ["1.0.-1"]),
        (
            '<objects><object id="o" type="roadMark" subtype="signalLines" s="30" t="0" width="7"/></objects>',
            ["1.0.1.1", "1.0.-1"],
        ),
        (on_road(signal("s", 30.0, "274")), []),
    ],
)
def test_stop_lines_are_written_in_four_ways(more: str, ends: list[str]) -> None:
    roads = read(road(sections=BOTH, more=more)).roads
    assert [roads.ids[row] for row in np.flatnonzero(roads.is_stop)] == ends
    for name in ends:
        row = roads.row(name)
        assert roads.points[roads.first[row + 1] - 1, 0] == 30.0


@pytest.mark.parametrize(("name", "s"), [("W", 95.0), ("WE", 2.0)])
def test_stop_line_near_the_edge_of_a_junction_holds_there(name: str, s: float) -> None:
    roads = crossing({name: on_road(signal("s", s, "294", inner=valid(-1, -1)))}).roads
    assert [roads.ids[row] for row in np.flatnonzero(roads.is_stop)] == ["W.0.-1"]


def test_crosswalks_have_outlines_of_corners_or_of_their_size() -> None:
    local = "".join(f'<cornerLocal u="{u}" v="{v}" z="0.1"/>' for u, v in ((-1, -2), (1, -2), (1, 2), (-1, 2)))
    by_road = "".join(f'<cornerRoad s="{s}" t="{t}" dz="0"/>' for s, t in ((10, -3), (12, -3), (12, 3), (10, 3)))
    objects = (
        f'<object id="a" type="crosswalk" s="50" t="1" hdg="{math.pi / 2}"><outline>{local}</outline></object>'
        f'<object id="b" type="crosswalk" s="0" t="0"><outlines><outline>{by_road}</outline></outlines></object>'
        '<object id="c" type="crosswalk" s="80" t="0" length="2" width="6"/>'
    )
    walk = on_road(signal("P", 80.0, "1000002", t=3.5))
    road_map = read(road(sections=BOTH, more=f"<objects>{objects}</objects>{walk}"))
    found = {one.name: np.concatenate(one.outlines).round(6).tolist() for one in road_map.crosswalks}
    assert found == {
        "a": [[52.0, 0.0, 0.1], [52.0, 2.0, 0.1], [48.0, 2.0, 0.1], [48.0, 0.0, 0.1]],
        "b": [[10.0, -3.0, 0.0], [12.0, -3.0, 0.0], [12.0, 3.0, 0.0], [10.0, 3.0, 0.0]],
        "c": [[81.0, 3.0, 0.0], [81.0, -3.0, 0.0], [79.0, -3.0, 0.0], [79.0, 3.0, 0.0]],
    }
    assert [one.lights for one in road_map.crosswalks] == [(), (), (0,)]


def test_other_signals_are_signs_and_unknown_lights_are_told() -> None:
    road_map = read(road(more=on_road(signal("a", 20.0, "274"), signal("b", 30.0, "1000011"))))
    assert [(sign.name, sign.kind, sign.x, sign.y) for sign in road_map.signs] == [
        ("a", "2", 20.0, -4.0),
        ("b", "", 30.0, -4.0),
    ]
    assert "lights of other types are drawn as signs: 1 of type 1000011" in road_map.notes
    assert not road_map.plan.lights


def test_light_with_the_id_of_another_is_refused() -> None:
    with pytest.raises(DocumentError, match=r"line \d+: <signal 'T'>: id: expected each traffic light once, got 'T'"):
        crossing({name: on_road(signal("T", 98.0)) for name in "WE"})


# Stop lines as records


def test_stop_lines_have_their_lanes_their_direction_or_their_ends() -> None:
    objects = (
        '<object name="StopLine" s="30" t="-1.7" length="3.4"/><object name="StopLine" s="31" t="0"/>'
        '<object name="StopLine" s="32" t="1" length="2" width="7"/><object name="StopLine" s="33" t="0" length="0.5"/>'
        '<object type="crosswalk" s="34" t="0"/>'
    )
    signals = on_road(
        signal("a", 40.0, "294", inner=valid(-2, 1)),
        signal("b", 41.0, "205", way="-"),
        signal("c", 42.0, "206", way="none", inner=valid(0, 0)),
        signal("d", 43.0, "206").replace("OpenDRIVE", "US"),
        signal("e", 44.0, "206").replace("OpenDRIVE", "Germany"),
        '<signalReference id="a" s="45" t="0" type="206" orientation="+"/>',
    )
    assert find_stops(record(road(more=f"<objects>{objects}</objects>{signals}"))) == [
        StopPlace(40.0, lanes=frozenset({-2, -1, 1}), is_forward=True),
        StopPlace(41.0, is_forward=False),
        StopPlace(42.0),
        StopPlace(44.0, is_forward=True),
        StopPlace(30.0, aside=(-1.7, 0.5 * 3.4 - 1.0)),
        StopPlace(31.0, aside=(0.0, 1.0)),
        StopPlace(32.0, aside=(1.0, 2.5)),
        StopPlace(33.0, aside=(0.0, -0.75)),
    ]


def test_stop_line_is_for_the_lanes_that_it_says() -> None:
    painted = StopPlace(0.0, lanes=frozenset({7}), is_forward=False, aside=(-2.0, 1.5))
    assert [painted.holds_for(-1, middle, is_forward=True) for middle in (-4.6, -4.4, 0.4, 0.6)] == [
        *(False, True),
        *(True, False),
    ]
    assert [StopPlace(0.0, lanes=frozenset({-1})).holds_for(name, 0.0, is_forward=True) for name in (-1, 1)] == [
        True,
        False,
    ]
    assert [StopPlace(0.0, is_forward=way).holds_for(1, 0.0, is_forward=True) for way in (None, True, False)] == [
        *(True, True),
        False,
    ]


JUNCTION, ROAD = "junction", "road"


@pytest.mark.parametrize(
    ("before", "after", "way", "is_cut"),
    [
        (ROAD, ROAD, "+", True),
        (ROAD, JUNCTION, "+", False),
        (JUNCTION, ROAD, "+", True),
        (ROAD, JUNCTION, "-", True),
        (JUNCTION, ROAD, "-", False),
        (JUNCTION, ROAD, "none", False),
        (ROAD, JUNCTION, "none", False),
        ("", "", "none", True),
    ],
)
def test_light_cuts_its_road_unless_a_junction_follows_in_its_direction(
    before: str,
    after: str,
    way: str,
    is_cut: bool,  # noqa: FBT001
) -> None:
    links = "".join(joined(tag, kind, "8") for tag, kind in (("predecessor", before), ("successor", after)) if kind)
    more = on_road(signal("T", 50.0, way=way), '<signalReference id="T" s="60" t="0" orientation="+"/>')
    assert find_stop_cuts(record(road(links=links, more=more))) == ({50.0} if is_cut else set())
    assert find_stop_cuts(record(road(links=links, more=more, junction="8"))) == set()


@pytest.mark.parametrize(
    ("s", "way", "is_cut"),
    [(93.0, "+", False), (91.0, "+", True), (93.0, "-", True), (7.0, "-", True), (7.0, "+", True)],
)
def test_stop_line_cuts_its_road_unless_it_is_just_before_a_junction(s: float, way: str, is_cut: bool) -> None:  # noqa: FBT001
    """A line that might be for either direction is that of the junction."""
    own = record(road(links=joined("successor", "junction", "8"), more=on_road(signal("s", s, "294", way=way))))
    assert find_stop_cuts(own) == ({s} if is_cut or s < 90.0 else set()) - ({93.0} if way == "-" else set())


def test_stop_line_within_a_junction_holds_for_the_lanes_that_lead_to_its_own_section() -> None:
    inner = section([lane(0), lane(-1, link(-1, -1))]) + section([lane(0), lane(-1, link(-1, 1))], 10.0)
    stop = on_road(signal("s", 2.0, "294", inner=valid(-1, -1)))
    (own,) = (road("X", plan=geometry(x=-200.0, y=50.0), sections=BOTH, links=joined("successor", "junction", "9")),)
    way = road(
        "XY",
        plan=geometry(x=-100.0, y=50.0, length=20.0),
        length=20.0,
        sections=inner,
        junction="9",
        links=joined("predecessor", "road", "X", "end"),
        more=stop,
    )
    roads = crossing(extra=own + way).roads
    assert [roads.ids[row] for row in np.flatnonzero(roads.is_stop)] == ["X.0.-1"]


def test_lane_that_leads_nowhere_stops_at_the_edge_of_the_junction_too() -> None:
    lanes = section([lane(0), lane(-1), lane(-2)])
    text = road("Z", plan=geometry(y=50.0), sections=lanes, links=joined("successor", "junction", "9"))
    text = text.replace("<lanes>", on_road(signal("s", 95.0, "294")) + "<lanes>")
    roads = crossing(extra=text).roads
    assert [roads.ids[row] for row in np.flatnonzero(roads.is_stop)] == ["Z.0.-1", "Z.0.-2"]


# Lights and signs as they stand


def test_signs_face_those_who_come_and_turn_by_their_offset() -> None:
    turned = signal("c", 30.0, "274").replace("zOffset", 'hOffset="0.5" zOffset')
    text = road(
        plan=geometry(hdg=1.0), more=on_road(signal("a", 20.0, "274"), signal("b", 20.0, "27x", way="-"), turned)
    )
    assert [(sign.kind, round(sign.yaw, 6), sign.z) for sign in read(text).signs] == [
        ("2", round(1.0 - math.pi, 6), 3.0),
        ("", 1.0, 3.0),
        ("2", round(1.5 - math.pi, 6), 3.0),
    ]


def test_light_hangs_two_and_a_half_metres_above_the_middle_of_the_road_at_least() -> None:
    tilt = '<lateralProfile><superelevation s="0" a="0.4" b="0" c="0" d="0"/></lateralProfile>'
    hill = '<elevationProfile><elevation s="0" a="1" b="0" c="0" d="0"/></elevationProfile>'
    low, high = (signal("T", 60.0, t=5.0).replace(' zOffset="3"', more) for more in ("", ' zOffset="2"'))
    heights = [read(road(more=tilt + hill + on_road(one))).plan.lights[0].z for one in (low, high)]
    assert heights == pytest.approx([3.5, 3.0 + 5.0 * math.sin(0.4)])


def test_light_faces_those_for_whom_it_is_and_that_of_a_crosswalk_as_it_is_turned() -> None:
    plan = geometry('<arc curvature="0.02"/>')
    walk = signal("P", 60.0, "1000002").replace("zOffset", 'hOffset="0.5" zOffset')
    lights = read(
        road(plan=plan, sections=BOTH, more=on_road(signal("T", 60.0, inner=valid(-1, -1)), walk))
    ).plan.lights
    assert [round(light.yaw, 2) for light in lights] == [round(1.2 + math.pi - 2.0 * math.pi, 2), 1.7]
    (idle,) = read(road(plan=geometry(hdg=1.0), more=on_road(signal("T", 60.0, inner=valid(5, 5))))).plan.lights
    assert (idle.lanes, round(idle.yaw, 6)) == ((), round(1.0 - math.pi, 6))


def test_crosswalk_needs_an_area_and_has_the_lights_within_four_metres() -> None:
    local = "".join(f'<cornerLocal u="{u}" v="{v}"/>' for u, v in ((-1, -2), (1, -2), (1, 2)))
    objects = (
        f'<object id="two" type="crosswalk" s="10" t="0"><outline>{local[: local.rindex("<")]}</outline></object>'
        f'<object id="three" type="crosswalk" s="50" t="0" zOffset="0.2"><outline>{local}</outline></object>'
        '<object id="none" type="crosswalk" s="60" t="0" length="2"/>'
        '<object type="crosswalk" s="80" t="1" zOffset="0.3" hdg="0.4" length="2" width="6"/>'
    )
    lights = on_road(signal("A", 52.0, "1000002", t=5.8), signal("B", 52.0, "1000002", t=6.2), signal("C", 50.0))
    road_map = read(road(plan=geometry(hdg=1.0), sections=BOTH, more=f"<objects>{objects}</objects>{lights}"))
    three, sized = road_map.crosswalks
    assert (three.name, three.lights, three.outlines[0][:, 2].tolist()) == ("three", (0,), [0.2, 0.2, 0.2])
    middle = complex(80.0, 1.0) * complex(math.cos(1.0), math.sin(1.0))
    turn = complex(math.cos(1.4), math.sin(1.4))
    corners = [middle + turn * complex(u, v) for u, v in ((1, 3), (1, -3), (-1, -3), (-1, 3))]
    assert sized.name == ""
    assert sized.outlines[0] == pytest.approx(np.array([[each.real, each.imag, 0.3] for each in corners]))


# The default plan


def own_way(name: str, x: float, y: float, length: float = 10.3) -> str:
    """A road within the junction, with a light for itself."""
    light = on_road(signal(f"T{name}", 0.0, inner=valid(-1, -1)))
    return road(name, plan=geometry(x=x, y=y, length=length), length=length, junction="9", more=light)


def test_further_lights_are_green_in_every_phase_that_they_do_not_cross() -> None:
    free, across = own_way("X", 0.0, 200.0), own_way("Y", -12.0, 8.0)  # the second one ends behind the lane of NS alone
    phases = [names for _, names in shown(crossing(ALL_ARMS, extra=free + across))]
    assert phases == ["TW TE TX TY", "", "TS TN TX", ""]


@pytest.mark.parametrize(("length", "is_near"), [(11.2, False), (11.4, True)])
def test_lanes_that_come_within_two_and_a_half_metres_of_each_other_conflict(length: float, is_near: bool) -> None:  # noqa: FBT001
    """It ends 2.55 or 2.35 m before the lane of SN, whose middle is at x = 1.75 m."""
    lights = {"S": ALL_ARMS["S"]}
    phases = [names for _, names in shown(crossing(lights, extra=own_way("Y", -12.0, 8.0, length)))]
    assert phases == (["TS", "", "TY", ""] if is_near else ["TS TY", ""])


def test_pedestrians_do_not_walk_while_those_who_cross_their_way_have_green() -> None:
    walk = signal("P", 97.0, "1000002", inner=valid(-1, 1))
    both = crossing({"W": on_road(signal("TW", 98.0), walk)})
    assert [names for _, names in shown(both)] == ["TW", "", "P", ""]
    assert [seconds for seconds, _ in shown(both)][2] == pytest.approx(7.0 + 7.0 / 1.07, abs=0.02)
    assert [frames > 0 for frames in both.plan.controllers[0].yellow] == [True, False]
    alone = crossing({"W": on_road(walk)})
    assert [(round(seconds, 1), names) for seconds, names in shown(alone)] == [(13.5, "P"), (10.0, "")]


def test_way_of_pedestrians_is_as_wide_as_the_lanes_that_they_cross() -> None:
    """The light cuts the lanes at its own place, or stands within a metre of two sections: each lane counts once."""
    parts = section([lane(1), lane(0), lane(-1)]) + section([lane(0), lane(-1)], 50.0)
    for s, width in ((30.0, 7.0), (49.2, 7.0), (50.8, 7.0), (51.2, 3.5), (70.0, 3.5)):
        (controller,) = read(road(sections=parts, more=on_road(signal("P", s, "1000002")))).plan.controllers
        assert controller.walks[0].flashing * DT == pytest.approx(width / 1.07, abs=0.02), s


def test_controller_has_the_number_in_the_name_of_its_junction() -> None:
    for name, number in (("9", 9), ("J12", 12), ("J1b", 0), (str(2**31 + 5), 5)):
        (controller,) = crossing(ALL_ARMS, name=name).plan.controllers
        assert (controller.name, controller.number) == (name, number)


def test_times_of_lights_follow_the_limits_and_the_size_of_the_junction() -> None:
    def times(limit: float, length: float) -> tuple[float, float]:
        kinds = f'<type s="0" type="town"><speed max="{limit}"/></type>'
        lanes = section([lane(0), lane(-1, link(-1, -1))])
        light = on_road(signal("T", 0.0, inner=valid(-1, -1)))
        road_map = read(
            road("1", links=joined("successor", "road", "2"), sections=lanes, more=kinds),
            road("2", plan=geometry(x=100.0, length=length), length=length, junction="9", more=light),
            road("3", plan=geometry(y=50.0, length=5.0), length=5.0, junction="9", more=light.replace("T", "U")),
            road(
                "4",
                plan=geometry(x=3.0, y=47.0, hdg=1.57, length=9.0),
                length=9.0,
                junction="9",
                more=light.replace("T", "V"),
            ),
        )
        (controller,) = road_map.plan.controllers
        return round(controller.yellow[0] * DT, 2), round(controller.phases[1].duration * DT, 2)

    assert times(10.0, 40.0) == (3.0, 4.7)  # 1 s + 10 / (2 * 3.05) = 2.64 s; (40 m + 6.1 m) / (10 m/s) = 4.61 s
    assert times(20.0, 40.0) == (4.3, 2.4)
    assert times(40.0, 20.0) == (6.0, 1.0)
    assert times(5.0, 40.0) == (3.0, 6.0)
    assert times(0.5, 40.0) == (3.0, 6.0)

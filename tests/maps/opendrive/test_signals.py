"""Lights, signs, stop lines, crosswalks and the default plan of OpenDRIVE maps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.world.roads.signal_plan import Lamp
from rosbridge_sim.world.state.world import DT
from tests.maps.opendrive.xodr_texts import geometry, joined, lane, link, read, road, section

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


def crossing(more: dict[str, str] | None = None, controllers: str = "") -> RoadMap:
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
    return read(*parts, controllers, f'<junction id="9" name="">{connections}</junction>')


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

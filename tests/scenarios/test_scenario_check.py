from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.scenarios.scenario_check import (
    MAX_ODDITIES,
    Draft,
    find_misspelt_key,
    find_misspelt_keys,
    find_oddities,
    place_draft,
    read_draft,
)
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, read_scenario
from rosbridge_sim.world.geometry.near_pairs import MAX_NEAR
from rosbridge_sim.world.roads.roads import Roads
from tests.simulator.saved_files import edited_scenario, saved_scenario
from tests.simulator.small_maps import ROADRUNNER
from tests.simulator.small_maps import read as read_tiny

BOXES = "Cargo_Box, Wooden_Box, Box, ...; /sim/catalogue lists all"
AT = {"pos": {"x": 1, "y": 0}}
FAR = [{"pos": {"x": 0, "z": 0}}, {"pos": {"x": 9e7, "z": 0}}]
LINK = {"initPositionMode": "Link", "initLink": "nowhere"}


def draft(**parts: object) -> Draft:
    return read_draft(json.dumps(parts).encode(), "mine.json")


def mistakes(**parts: object) -> tuple[str, ...]:
    return draft(**parts).mistakes


def oddities(roads: Roads | None = None, **parts: object) -> list[str]:
    scenario = read_scenario(json.dumps(parts).encode(), "mine.json")
    return find_oddities(scenario if roads is None else place_on_roads(scenario, roads), roads)


# -- mistakes


def test_good_file_has_no_remarks() -> None:
    found = draft(egoVehicle={"initPosition": AT})
    assert found.mistakes == ()
    assert found.scenario is not None
    assert len(found.scenario.egos) == 1


def test_all_errors_are_reported_with_their_paths() -> None:
    found = draft(
        egoVehicle={"initPosition": {"pos": {"x": "a"}}},
        vehicleList=[{"initPosition": AT}, {}, {"initPosition": {**AT, "initPositionMode": "Link"}}],
        pedestrianList=[{"pos": {"x": 1, "y": 2}, "pathName": "gone"}, {"pos": {"x": 1, "y": 2}}],
        objectList=[{"pos": 1}, {"pos": {"x": 1, "y": 2}, "modelName": "Rocket"}],
        waypointDataList=[{"pathName": "far", "waypointData": FAR}, {"pathName": "bad", "waypointData": [{}]}],
        tlList=[{"state": "x"}],
        mapInfo=7,
    )
    assert found.mistakes == (
        "mine.json: mapInfo: expected an object, got 7",
        "mine.json: egoVehicle.initPosition.pos.x: expected a number, got 'a'",
        "mine.json: egoVehicle.initPosition.pos.y: missing",
        "mine.json: vehicleList[1].initPosition: missing",
        "mine.json: objectList[0].pos: expected an object, got 1",
        "mine.json: waypointDataList[1].waypointData[0].pos: missing",
        (
            "mine.json: tlList[0].index: missing; index of its controller among the map's, from 0;"
            " any other text is its id"
        ),
        "mine.json: tlList[0].state: expected a number, got 'x'",
        "mine.json: waypointDataList[0]: expected a path of at most 1,000 km",
        "mine.json: vehicleList[2].initPosition.initLink: missing",
        "mine.json: pedestrianList[0].pathName: waypointDataList has no path 'gone'",
        f"mine.json: objectList[1].modelName: expected one of the catalogue's obstacles, got 'Rocket'; it has {BOXES}",
    )
    scenario = found.scenario
    assert scenario is not None
    left = (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
    assert [spawn.where for spawn in left] == ["vehicleList[0]", "pedestrianList[1]"]
    assert scenario.phases == ()


def test_reference_to_an_invalid_path_is_not_a_second_error() -> None:
    walker = {"pos": {"x": 1, "y": 2}, "pathName": "bad"}
    for points in ([{"pos": 1}], FAR):
        paths = [{"pathName": "bad", "waypointData": points}]
        (line,) = mistakes(pedestrianList=[walker], waypointDataList=paths)
        assert line.startswith("mine.json: waypointDataList[0]"), points


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (b"", "mine.json: expected a JSON document, got nothing"),
        (b'{\n "egoVehicle": }', "mine.json:2:16: not JSON: expected a value"),
        (b"[1]", "mine.json: expected an object, got a list of 1"),
        (b"[" * 5_000, "mine.json: not JSON: nested too deeply"),
        (b'{"a": 1}', "mine.json: expected a scenario with at least one of mapInfo"),
    ],
    ids=["nothing", "torn", "list", "deep", "other"],
)
def test_document_that_is_no_scenario_has_one_error(text: bytes, line: str) -> None:
    found = read_draft(text, "mine.json")
    assert len(found.mistakes) == 1
    assert found.mistakes[0].startswith(line)
    assert found.scenario is None


def test_errors_that_need_the_map_are_found() -> None:
    found = draft(
        egoVehicle={"initPosition": LINK},
        vehicleList=[
            {"initPosition": LINK},
            {"initPosition": {**LINK, "initLink": "A1B1"}, "route": ["A1B1", "B2D"]},
            {"initPosition": {**LINK, "initLink": "A1B1"}},
        ],
        tlList=[{"index": "IntTL13", "state": 1}, {"index": "IntTL13", "state": 2}, {"index": "IntTL7"}],
    )
    assert found.mistakes == ()
    assert found.scenario is not None
    placed, more = place_draft(found.scenario, read_tiny(ROADRUNNER))
    assert more == [
        "mine: egoVehicle.initPosition.initLink: the map has no link 'nowhere'",
        "mine: vehicleList[0].initPosition.initLink: the map has no link 'nowhere'",
        "mine: vehicleList[1].route[0]: 'B2D' does not follow 'A1B1'",
    ]
    assert [spawn.where for spawn in placed.vehicles] == ["vehicleList[2]"]
    assert placed.notes == (
        "tlList: no intersection 'IntTL13' has a phase 2; the entry is ignored",
        "tlList: no intersection 'IntTL7' has a phase 0; the entry is ignored",
    )


# -- keys


def test_keys_are_sorted_into_read_and_ignored_ones() -> None:
    vehicle: dict[str, Any] = {"initPosition": {"pos": {"x": 1, "y": 2, "_z": "0", "w": 3}, "rot": {"q": 0}}}
    found = draft(
        version="1.0",
        vehicleList=[vehicle, {**vehicle, "velocityTyp": 2}],
        waypointDataList=[{"pathName": "a", "waypointData": [{"pos": {"x": 1, "z": 2}, "rot": {"w": 1}}] * 3}],
        pedspawnPointList=[{"DataID": 1, "pos": {}}],
    )
    assert found.mistakes == ()
    assert found.keys.idle == {"pedspawnPointList": 1}
    assert found.keys.passed_over == {
        "version": 1,
        "vehicleList[].initPosition.pos.w": 2,
        "vehicleList[].initPosition.rot.q": 2,
        "vehicleList[].velocityTyp": 1,
        "waypointDataList[].waypointData[].rot": 3,
    }
    assert found.keys.read["vehicleList[].initPosition.pos._z"] == 2
    assert found.keys.read["waypointDataList[].waypointData[].pos.x"] == 3


@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ("vehiclelist", "vehicleList"),
        ("vehicle_list", "vehicleList"),
        ("egoVehcile", "egoVehicle"),
        ("mapInof", "mapInfo"),
        ("tllist", "tlList"),
        ("vehicleList[].velocityTyp", "velocityType"),
        ("vehicleList[][].velocityTyp", "velocityType"),
        ("vehicleList[].initPositon", "initPosition"),
        ("vehicleList[].initPosition.POS", "pos"),
        ("vehicleList[].initPosition.pos.X", "x"),
        ("pedestrianList[].sped", "speed"),
        ("waypointDataList[].waypointData[].Pos", "pos"),
        ("vehicleList[].initPosition.pos.w", ""),
        ("vehicleList[].initPosition.pov", ""),
        ("version", ""),
        ("my.own.key", ""),
        ("aiPedstrianList", ""),
        ("pedestrianList[].initPos", ""),
        ("objectList[].movingDistanceAmount", ""),
        ("vehicleList[].viewCurrentVelocity", ""),
    ],
)
def test_misspelt_key_at_any_depth_is_known_by_its_place(path: str, meant: str) -> None:
    assert find_misspelt_key(path) == meant


def test_keys_of_the_saved_form_are_no_misspellings() -> None:
    for scenario in (saved_scenario(), edited_scenario()):
        assert find_misspelt_keys(draft(**scenario).keys) == []


def test_each_misspelt_key_is_one_line_however_often_it_stands_there() -> None:
    found = draft(vehiclelist=[], pedestrianList=[{"pos": {"x": 1, "y": 2}, "Speed": 3}] * 900, tllist=1)
    assert find_misspelt_keys(found.keys) == [
        "vehiclelist is no known key and is ignored; did you mean vehicleList?",
        "pedestrianList[].Speed (900 times) is no known key and is ignored; did you mean speed?",
        "tllist is no known key and is ignored; did you mean tlList?",
    ]
    many = find_misspelt_keys(draft(**{f"vehicleList{'_' * i}": 1 for i in range(1, 60)}).keys)
    assert len(many) == 51
    assert many[-1] == "... and 9 more of that kind"


def test_a_block_of_ours_at_a_place_that_has_none_is_told() -> None:
    found = draft(egoVehicle={"rosbridge_sim": {}}, mapInfo={"rosbridge_sim": {}}, vehicleList=[{"rosbridge_sim": {}}])
    assert [line.partition(" is ignored; it is read in ")[0] for line in find_misspelt_keys(found.keys)] == [
        "egoVehicle.rosbridge_sim",
        "mapInfo.rosbridge_sim",
    ]


# -- oddities


def test_vehicles_off_the_road_or_against_their_lane_are_reported() -> None:
    roads = read_tiny(ROADRUNNER).roads
    lines = oddities(
        roads,
        egoVehicle={"initPosition": {"pos": {"x": 50, "y": 0.5}, "rot": {"yaw": 5}}},
        vehicleList=[
            {"initPosition": {"pos": {"x": 30, "y": -4}}},
            {"initPosition": {"pos": {"x": -20, "y": 0}}},
            {"initPosition": {"pos": {"x": 70, "y": 0}, "rot": {"yaw": 180}}},
        ],
        objectList=[{"pos": {"x": 500, "y": 500}}],
    )
    assert lines == [
        "vehicleList[0] (2016_Hyundai_Ioniq) stands 2.0 m off the nearest lane, 'A1B1'",
        "vehicleList[1] (2016_Hyundai_Ioniq) stands 20.0 m off the nearest lane, 'A1B1'",
        "vehicleList[2] (2016_Hyundai_Ioniq) stands against the direction of its lane, 'A1B1'",
    ]
    assert oddities(Roads(), egoVehicle={"initPosition": AT}) == []


def test_things_and_people_kilometres_beyond_the_map_are_reported() -> None:
    roads = read_tiny(ROADRUNNER).roads
    lines = oddities(roads, objectList=[{"pos": {"x": 500, "y": 500}}], pedestrianList=[{"pos": {"x": -3e4, "y": 4e4}}])
    assert [line.partition(" stands ")[0] for line in lines] == ["pedestrianList[0] (Pedestrian)"]
    assert lines[0].endswith(" km outside of the map")
    assert oddities(Roads(), pedestrianList=[{"pos": {"x": -3e4, "y": 4e4}}]) == []


def test_overlapping_entities_are_reported() -> None:
    # The Ioniq's box reaches from 0.89 m behind its rear axle to 3.58 m before it.
    lines = oddities(
        egoVehicle={"initPosition": {"pos": {"x": 0, "y": 0}}},
        vehicleList=[{"initPosition": {"pos": {"x": 4.5, "y": 0}}}, {"initPosition": {"pos": {"x": 4.4, "y": 1.85}}}],
        pedestrianList=[{"pos": {"x": 3.5, "y": 0}}, {"pos": {"x": 3.5, "y": 0, "z": 8}}],
        objectList=[{"pos": {"x": -1.1, "y": 0}}, {"pos": {"x": 40, "y": 0}}],
    )
    assert lines == [
        "egoVehicle (2016_Hyundai_Ioniq) and pedestrianList[0] (Pedestrian) overlap",
        "egoVehicle (2016_Hyundai_Ioniq) and objectList[0] (Box) overlap",
        "vehicleList[0] (2016_Hyundai_Ioniq) and pedestrianList[0] (Pedestrian) overlap",
    ]


def test_heap_of_vehicles_is_judged_in_part() -> None:
    at = {"initPosition": {"pos": {"x": 0, "y": 0}}}
    few, many = oddities(vehicleList=[at] * 100), oddities(vehicleList=[at] * 3_000)
    assert few[-1] == f"... and {100 * 99 // 2 - 50:,} more of that kind"
    more = int(many[-1].removeprefix("... and at least ").removesuffix(" more of that kind").replace(",", ""))
    assert MAX_ODDITIES < more < MAX_NEAR, "it has 4,498,500"


def test_path_in_map_axes_is_reported_as_far_away() -> None:
    car = {"initPosition": {"pos": {"x": 100, "y": 50}}, "pathName": "way"}
    enu = [{"pos": {"x": 100, "y": 0, "z": 50}}, {"pos": {"x": 120, "y": 0, "z": 50}}]
    (line,) = oddities(vehicleList=[car], waypointDataList=[{"pathName": "way", "waypointData": enu}])
    assert line.startswith(
        "vehicleList[0] (2016_Hyundai_Ioniq) stands 223.6 m off its path; waypoints have the axes (-east, up,"
    )
    right = [{"pos": {"x": -100, "y": 0, "z": -50}}, {"pos": {"x": -120, "y": 0, "z": -50}}]
    assert oddities(vehicleList=[car], waypointDataList=[{"pathName": "way", "waypointData": right}]) == []


def test_number_of_remarks_of_one_kind_is_bounded() -> None:
    lines = oddities(objectList=[{"pos": {"x": 0, "y": 0}}] * 20)
    assert len(lines) == 51
    assert lines[-1] == "... and 140 more of that kind"

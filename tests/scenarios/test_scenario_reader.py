from __future__ import annotations

import copy
import json
import math
import runpy
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.map_formats import read_map
from rosbridge_sim.maps.mgeo import FILES
from rosbridge_sim.scenarios.scenario import Scenario, Spawn
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, read_scenario, sort_phases
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Phase, SignalPlan
from rosbridge_sim.world.state.world import Gear, Kind, World
from rosbridge_sim.world.step import step
from tests.support import ROOT

DATA = ROOT / "rosbridge_sim" / "data"
DEMO = (DATA / "scenarios" / "demo.json").read_bytes()
TRACK = {name: (DATA / "maps" / "track" / name).read_bytes() for name in FILES}

EGO: dict[str, Any] = {"initPosition": {"pos": {"x": 1, "y": 2}}}
# A document as MORAI writes it: numbers twice, texts for angles, a waypoint path found by the id in its name, and keys
# that mean nothing here. The figures are our own.
SAVED: dict[str, Any] = {
    "version": "1.0",
    "egoVehicle": {
        "DataID": 20200012,
        "UNIQUEID": -1,
        "m_eobstacleObjType": 0,
        "initPosition": {
            "initPositionMode": "Absolute",
            "pos": {"x": 1043.5, "y": -20.25, "z": 3.5, "_x": "1,043.5", "_y": "-20.25", "_z": "3.5"},
            "rot": {"roll": "0", "pitch": "0.1", "yaw": "-90.0"},
            "initLink": "",
            "initLinkRatio": 0.0,
        },
        "gear": 4,
        "currentVelocity": 36.0,
        "vehicleSaveData": {"wheels": [{}, {}, {}, {}], "engine": None},
    },
    "vehicleList": [
        {
            "DataID": 30200001,
            "UNIQUEID": 7,
            "initPosition": {"initPositionMode": "Absolute", "pos": {"_x": "-1,234,567.5", "_y": "8"}, "rot": {}},
            "velocityType": 1,
            "linkVelocity": 72,
            "constantVelocity": 18,
            "isCloseLoop": True,
            "isWaypointMode": True,
        },
        {
            "DataID": 30200001,
            "UNIQUEID": 8,
            "initPosition": {"initPositionMode": "Link", "initLink": "A1", "initLinkRatio": "0.25"},
            "velocityType": 2,
            "linkVelocity": 72,
            "constantVelocity": 18,
        },
    ],
    "pedestrianList": [
        {"DataID": 50100003, "UNIQUEID": 9, "pos": {"x": 5, "y": 5, "z": 0}, "speed": 5.4, "loop": True, "active": True}
    ],
    "objectList": [
        {"DataID": 40100005, "UNIQUEID": 10, "pos": {"x": 6, "y": 7, "z": 0}, "rot": {"yaw": "30"}, "scale": {"x": 1}}
    ],
    "spawnPointList": [],
    "tlList": [{"index": "IntTL0", "state": 0, "deltaTime": 0}],
    "mapInfo": {"mapName": "Somewhere", "eastOffset": 302459.9, "globalCoordinateSystem": "UTM52N"},
    "waypointDataList": [
        {
            "pathName": "ObstaclePath - 7",
            "waypointData": [
                {"pos": {"x": "-1,000.5", "y": "2.0", "z": "-30"}, "rot": {"x": 0, "y": 0, "z": 0, "w": 1}},
                {"pos": {"x": -1010.5, "y": 2.5, "z": -40}},
            ],
        },
        {"pathName": "PedPath - 9", "waypointData": [{"pos": {"x": -5.0, "y": 0, "z": -25.0}}]},
    ],
    "shadedAreaList": [],
    "aiPedstrianList": None,
}


def read(document: object) -> Scenario:
    return read_scenario(json.dumps(document).encode(), "some/dir/mine.json")


def refusal(document: object) -> str:
    """The error's text, which is one line, as every error of a document must be."""
    with pytest.raises(DocumentError) as caught:
        read(document)
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    assert len(text) < 400
    return text.removeprefix("some/dir/")


def changed(path: str, value: object) -> dict[str, Any]:
    """SAVED with the value at `path` (`vehicleList.0.UNIQUEID`) replaced, or taken out if the value is `...`."""
    document = copy.deepcopy(SAVED)
    *way, last = [int(part) if part.isdecimal() else part for part in path.split(".")]
    at: Any = document
    for part in way:
        at = at[part]
    if value is ...:
        del at[last]
    else:
        at[last] = value
    return document


# -- what is read


def test_ego_of_a_saved_file_is_read() -> None:
    (ego,) = read(SAVED).egos
    assert (ego.kind, ego.name, ego.uid, ego.gear) == (Kind.EGO, "Hyundai_Ioniq_5", 0, Gear.DRIVE)
    assert (ego.x, ego.y, ego.z) == (1043.5, -20.25, 3.5)
    assert ego.yaw == -math.pi / 2
    assert ego.speed == pytest.approx(10.0)
    assert ego.path is None


def test_texts_with_thousands_separators_replace_missing_numbers() -> None:
    vehicle = read(SAVED).vehicles[0]
    assert (vehicle.x, vehicle.y, vehicle.z) == (-1234567.5, 8.0, 0.0)


def test_waypoints_are_converted_from_engine_axes() -> None:
    path = read(SAVED).vehicles[0].path
    assert path is not None
    assert path.tolist() == [[1000.5, 30.0, 2.0], [1010.5, 40.0, 2.5]]


def test_vehicle_speed_is_its_own_or_the_links() -> None:
    by_link, own = read(SAVED).vehicles
    assert by_link.speed == pytest.approx(20.0)
    assert own.speed == pytest.approx(5.0)
    assert (by_link.is_loop, own.is_loop) == (True, False)


def test_single_waypoint_is_a_path_from_the_start_position() -> None:
    (walker,) = read(SAVED).pedestrians
    assert (walker.kind, walker.is_loop) == (Kind.PEDESTRIAN, True)
    assert walker.speed == pytest.approx(1.5)
    assert walker.path is not None
    assert walker.path.tolist() == [[5, 5, 0], [5, 25, 0]]


def test_obstacle_stands_at_its_position() -> None:
    (cone,) = read(SAVED).obstacles
    assert (cone.kind, cone.name, cone.uid, cone.x, cone.y) == (Kind.OBSTACLE, "Traffic_Cone", 10, 6.0, 7.0)
    assert cone.yaw == pytest.approx(math.pi / 6)
    assert (cone.speed, cone.path) == (0.0, None)


def test_names_of_scenario_and_map_are_read() -> None:
    scenario = read(SAVED)
    assert (scenario.name, scenario.map_name) == ("mine", "Somewhere")
    assert read({"egoVehicle": None}).map_name is None


def test_gear_that_there_is_not_and_a_speed_against_the_gear_are_noted() -> None:
    ego = {"initPosition": {"pos": {"x": 0, "y": 0}, "gear": 7}, "gear": 0, "currentVelocity": -18}
    assert read({"egoVehicle": ego}).notes == (
        "egoVehicle.gear: expected 1 (P), 2 (R), 3 (N) or 4 (D), got 7; it counts as D",
        "egoVehicle.currentVelocity: expected 0 or more in gear 4 (D), got -18; it counts without its sign",
    )
    assert read({"egoVehicle": ego | {"gear": 2}}).notes == ()


def test_unknown_model_number_is_noted_once() -> None:
    notes = read(SAVED).notes
    assert [note for note in notes if "30200001" in note] == [
        (
            "DataID 30200001 (vehicle) is not in the catalogue; it gets the ordinary size of its class,"
            " 4.47 x 1.82 x 1.45 m; --catalogue FILE can define it"
        )
    ]
    first, second = read(SAVED).vehicles
    assert first.name == second.name == "Vehicle_30200001"
    walker = {"DataID": 40100003, "pos": {"x": 0, "y": 0}}
    (note,) = read({"pedestrianList": [walker]}).notes
    assert "is not in the catalogue, and the number of a obstacle" not in note
    assert "is not in the catalogue, and its number belongs to an obstacle; it gets" in note


def test_model_may_be_given_by_name() -> None:
    document = changed("vehicleList.0.modelName", "kia k5")
    assert read(document).vehicles[0].name == "2015_Kia_K5"
    text = refusal(changed("vehicleList.0.modelName", "Traffic_Cone"))
    assert text == "mine.json: vehicleList[0].modelName: expected one of the catalogue's vehicles, got 'Traffic_Cone'"
    text = refusal(changed("objectList.0.modelName", "Rocket"))
    near = "it has Cargo_Box, Wooden_Box, Box, ...; /sim/catalogue lists all"
    assert (
        text == f"mine.json: objectList[0].modelName: expected one of the catalogue's obstacles, got 'Rocket'; {near}"
    )


def test_path_may_be_given_by_name() -> None:
    document = changed("vehicleList.1.pathName", "ObstaclePath - 7")
    first, second = read(document).vehicles
    assert second.path is first.path
    assert refusal(changed("vehicleList.1.pathName", "x")) == (
        "mine.json: vehicleList[1].pathName: waypointDataList has no path 'x'"
    )


def test_path_is_ignored_outside_waypoint_mode() -> None:
    assert read(changed("vehicleList.0.isWaypointMode", value=False)).vehicles[0].path is None
    scenario = read(changed("vehicleList.1.isWaypointMode", value=True))
    assert scenario.vehicles[1].path is None
    assert any("waypointDataList has no path ' - 8'" in note for note in scenario.notes)


def test_vehicle_does_not_follow_a_pedestrian_path() -> None:
    assert read(changed("waypointDataList.0.pathName", "PedPath - 7")).vehicles[0].path is None


def test_pedestrian_without_a_path_walks_straight_ahead() -> None:
    walker = {"pos": {"x": 1, "y": 1}, "rot": {"yaw": 90}, "speed": 3.6, "loop": True, "movingDistance": 10}
    (spawn,) = read({"pedestrianList": [walker]}).pedestrians
    assert spawn.path is not None
    np.testing.assert_allclose(spawn.path, [[1, 1, 0], [1, 11, 0]], atol=1e-12)
    assert spawn.is_loop


def test_path_without_length_is_noted_and_moves_nothing() -> None:
    here = {"pos": {"x": -5, "y": 0, "z": -5}}
    scenario = read(changed("waypointDataList.1.waypointData", [here, here]))
    assert (scenario.pedestrians[0].path, scenario.pedestrians[0].speed) == (None, 0.0)
    assert any("no length" in note for note in scenario.notes)


@pytest.mark.parametrize(
    ("gear", "meant"), [(1, Gear.PARK), (2, Gear.REVERSE), (3, Gear.NEUTRAL), (4, Gear.DRIVE), (-1, 4), (0, 4), (5, 4)]
)
def test_gears_are_read(gear: int, meant: int) -> None:
    assert read({"egoVehicle": {**EGO, "gear": gear}}).egos[0].gear == meant


@pytest.mark.parametrize(
    ("within", "beside", "meant"), [(1, 4, Gear.PARK), (None, 2, Gear.REVERSE), (0, 3, Gear.NEUTRAL), ("2", ..., 2)]
)
def test_gear_of_the_start_position_takes_precedence(within: object, beside: object, meant: int) -> None:
    ego: dict[str, Any] = {"initPosition": {**EGO["initPosition"], "gear": within}}
    ego |= {} if beside is ... else {"gear": beside}
    assert read({"egoVehicle": ego}).egos[0].gear == meant


def test_roll_and_pitch_are_wrapped_to_half_a_turn() -> None:
    tilt = {"roll": "90.0", "pitch": "-358.491", "yaw": "-358.491"}
    ego = {"initPosition": {"pos": {"x": 0, "y": 0}, "rot": tilt}}
    scenario = read({"egoVehicle": ego, "objectList": [{"pos": {"x": 1, "y": 2}, "rot": tilt}]})
    for spawn in (*scenario.egos, *scenario.obstacles):
        assert [spawn.roll, spawn.pitch, spawn.yaw] == pytest.approx([math.pi / 2, *[math.radians(1.509)] * 2])


def test_obstacle_scale_applies_to_width_height_and_length() -> None:
    box = {"DataID": 40100002, "pos": {"x": 1, "y": 2}}
    plain, large, empty = read(
        {"objectList": [box, {**box, "scale": {"x": 2, "y": "0.5", "z": 3}}, {**box, "scale": {}}]}
    ).obstacles
    body = large.model.body
    assert (body.length, body.width, body.height) == pytest.approx((3.6, 1.6, 0.4))
    assert [body.front_overhang, body.wheelbase] == pytest.approx([1.8, 0.0])
    assert plain.model is empty.model


@pytest.mark.parametrize("scale", [{"x": 0, "y": 1, "z": 1}, {"x": 1, "y": -1, "z": 1}, {"z": 1001}, {"y": 5e-324}])
def test_invalid_scale_is_a_remark(scale: dict[str, float]) -> None:
    scenario = read({"objectList": [{"pos": {"x": 1, "y": 2}, "scale": scale}]})
    assert scenario.obstacles[0].model.body.length == 0.6
    (note,) = scenario.notes
    assert note.startswith("objectList[0].scale: expected numbers from 0.001 to 1,000, got x ")


@pytest.mark.parametrize(("distance", "meant"), [(25, 25.0), ("1,000.5", 1000.5), (0, 0.0), (-1, 0.0), (None, 0.0)])
def test_active_distance_is_read(distance: object, meant: float) -> None:
    walker = {"pos": {"x": 1, "y": 1}, "speed": 3.6, "activeDistance": distance}
    ball = {"pos": {"x": 1, "y": 1}, "moveSpeed": 3.6, "activeDistance": distance}
    car = {**EGO, "activeDistance": distance}
    scenario = read({"vehicleList": [car], "pedestrianList": [walker], "objectList": [ball]})
    spawns = (*scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
    assert [spawn.start_within for spawn in spawns] == [meant] * 3


@pytest.mark.parametrize(
    ("desired", "constant", "kmh"),
    [(50, 18, 50), (0, 18, 18), (None, 18, 18), (50, None, 50), (0, None, 0), (None, None, 72)],
)
def test_own_speed_is_the_desired_speed(desired: object, constant: object, kmh: float) -> None:
    document = changed("vehicleList.1.desiredVelocity", desired)
    document["vehicleList"][1]["constantVelocity"] = constant
    assert read(document).vehicles[1].speed * 3.6 == pytest.approx(kmh)


def test_vehicle_saved_on_a_link_follows_the_lanes() -> None:
    car: dict[str, Any] = {**EGO, "velocityType": 2, "desiredVelocity": 36, "currentVelocity": 18}
    named = {**car, "currentLinkInfo": {"linkIdx": "A1B1", "pointIdx": 3}}
    also = {**car, "currentLinkInfo": None, "startPointLinkInfo": {"linkIdx": "A1B1"}}
    empty = {**car, "currentLinkInfo": {"linkIdx": ""}, "startPointLinkInfo": 7}
    ahead = {**named, "isWaypointMode": True}
    first, second, third, fourth = read({"vehicleList": [named, also, empty, ahead]}).vehicles
    for spawn in (first, second):
        assert spawn.driver is not None
        assert [spawn.driver.desired_speed, spawn.speed] == pytest.approx([10.0, 5.0])
    assert third.driver is None
    assert third.speed == pytest.approx(10.0)
    assert (fourth.driver, fourth.speed) == (None, 0.0), "it has no waypoints"


# Empty paths

NO_WAY: dict[str, Any] = {"pathName": "ObstaclePath - 7", "waypointData": []}


def test_obstacle_in_waypoint_mode_without_waypoints_stands() -> None:
    thing = {"UNIQUEID": 7, "pos": {"x": 3, "y": 4}, "moveSpeed": 9, "isWaypointMode": True}
    scenario = read({"objectList": [thing], "waypointDataList": [NO_WAY, {**NO_WAY, "pathName": "PedPath - 999"}]})
    (spawn,) = scenario.obstacles
    assert (spawn.path, spawn.speed, spawn.x, spawn.y, scenario.notes) == (None, 0.0, 3.0, 4.0, ())


def test_empty_path_is_ignored_outside_waypoint_mode() -> None:
    walker = {"UNIQUEID": 7, "pos": {"x": 0, "y": 0}, "speed": 3.6, "movingDistance": 10}
    paths = [{**NO_WAY, "pathName": "PedPath - 7"}]
    for more in ({}, {"isWaypointMode": False}):
        (spawn,) = read({"pedestrianList": [{**walker, **more}], "waypointDataList": paths}).pedestrians
        assert spawn.path is not None
        assert spawn.speed == pytest.approx(1.0)


def test_named_path_without_waypoints_is_accepted() -> None:
    thing = {"pos": {"x": 3, "y": 4}, "moveSpeed": 9, "pathName": "ObstaclePath - 7"}
    (spawn,) = read({"objectList": [thing], "waypointDataList": [NO_WAY]}).obstacles
    assert (spawn.path, spawn.speed) == (None, 0.0)


def test_missing_path_in_waypoint_mode_is_noted_for_moving_entities() -> None:
    thing = {"UNIQUEID": 8, "pos": {"x": 3, "y": 4}, "isWaypointMode": True}
    scenario = read({"objectList": [{**thing, "moveSpeed": 0}]})
    assert (scenario.notes, scenario.obstacles[0].speed) == ((), 0.0)
    scenario = read({"objectList": [{**thing, "moveSpeed": 5}]})
    assert scenario.notes == ("objectList[0]: isWaypointMode, but waypointDataList has no path ' - 8'",)
    assert scenario.obstacles[0].speed == 0.0


# Known without effect


def test_values_without_effect_are_kept_unchanged() -> None:
    generator = {"DataID": 90100001, "anything": [1, {"a": None}]}
    car = {**EGO, "isLaneChange": "perhaps", "latBiasMode": 2, "destinationUniqueID": None}
    document = {
        "pedspawnPointList": [generator],
        "shadedAreaList": {"not": "a list"},
        "frictionChangeMaterialList": [],
        "vehicleList": [car],
    }
    scenario = read(document)
    areas = {"shadedAreaList": {"not": "a list"}}
    assert scenario.kept == {"pedspawnPointList": [generator], "frictionChangeMaterialList": [], **areas}
    assert scenario.vehicles[0].kept == {"latBiasMode": 2}


@pytest.mark.parametrize(
    ("keys", "changes_lanes", "lateral", "num_remarks"),
    [
        ({}, True, 0.0, 0),
        ({"isLaneChange": True, "latBias": "-0.125"}, True, -0.125, 0),
        ({"isLaneChange": False, "latBias": 0.4}, False, 0.4, 0),
        ({"isLaneChange": "False", "latBias": 9}, False, 0.0, 1),
        ({"isLaneChange": "perhaps", "latBias": "wide"}, True, 0.0, 1),
        ({"isLaneChange": 0, "latBias": {"odd": 1}}, False, 0.0, 1),
    ],
)
def test_vehicle_keeps_its_lane_and_its_offset(
    keys: dict[str, Any],
    changes_lanes: bool,  # noqa: FBT001 - a column of the table
    lateral: float,
    num_remarks: int,
) -> None:
    scenario = read({"vehicleList": [{**EGO, "isWaypointMode": False, **keys}]})
    driver = scenario.vehicles[0].driver
    assert driver is not None
    assert (driver.changes_lanes, driver.lateral) == (changes_lanes, lateral)
    assert len([note for note in scenario.notes if "latBias" in note]) == num_remarks


# Lights


def phases(*indices: object) -> tuple[list[str], list[str]]:
    """What the controllers IntTL1, IntTL2 and "0" make of the indices: those that begin in a phase, and the lines."""
    controllers = [Controller(name, 0, (), (Phase(50, ()), Phase(50, ()))) for name in ("IntTL1", "IntTL2", "0")]
    scenario = read({"tlList": [{"index": index, "state": 1, "deltaTime": 0.5} for index in indices]})
    known, lines = sort_phases(scenario, SignalPlan(Roads(), (), controllers))
    assert all((start.phase, start.elapsed) == (1, 0.5) for start in known)
    return [start.controller for start in known], lines


def test_light_is_found_by_position_or_name() -> None:
    assert phases("1", 1, "2", " 1 ", "IntTL1") == (["IntTL2", "IntTL2", "0", "IntTL2", "IntTL1"], [])


def test_ambiguous_light_reference_is_a_position() -> None:
    (line,) = phases("0")[1]
    assert phases("0")[0] == ["IntTL1"]
    assert line == "index '0' is a position and an id; it is used as the position, 'IntTL1'"


@pytest.mark.parametrize("index", ["3", "-1", "1.5", "", "IntTL3", "9" * 100, "²"])
def test_unknown_controller_index_is_a_remark(index: str) -> None:
    known, (line,) = phases(index)
    assert known == []
    assert line.startswith("no intersection ")


def test_unknown_phase_is_a_remark() -> None:
    scenario = read({"tlList": [{"index": "0", "state": 7}, {"index": "0", "state": -1}]})
    plan = SignalPlan(Roads(), (), [Controller("IntTL1", 1, (), (Phase(50, ()),))])
    assert sort_phases(scenario, plan) == (
        (),
        [f"no intersection 'IntTL1 (index 0)' has a phase {n}; the entry is ignored" for n in (7, -1)],
    )
    assert sort_phases(scenario, SignalPlan(Roads()))[0] == ()


@pytest.mark.parametrize(("yaw", "meant"), [("190", -170.0), (-180, 180.0), (540, 180.0), ("1,080.5", 0.5)])
def test_headings_are_wrapped_to_half_a_turn(yaw: object, meant: float) -> None:
    ego = {"initPosition": {"pos": {"x": 0, "y": 0}, "rot": {"yaw": yaw}}}
    assert read({"egoVehicle": ego}).egos[0].yaw == pytest.approx(math.radians(meant))


def test_ids_are_unique() -> None:
    document = changed("vehicleList.1.UNIQUEID", 7)
    document["objectList"][0]["UNIQUEID"] = 0
    document["pedestrianList"][0]["UNIQUEID"] = -5
    scenario = read(document)
    assert [spawn.uid for spawn in (*scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)] == [7, *[None] * 3]
    assert "vehicleList[1]: UNIQUEID 7 is in use by vehicleList[0]; it gets the next free one" in scenario.notes
    assert "objectList[0]: UNIQUEID 0 is in use by egoVehicle; it gets the next free one" in scenario.notes


def test_number_of_notes_is_bounded() -> None:
    vehicles = [{"DataID": i, "initPosition": EGO["initPosition"]} for i in range(300)]
    notes = read({"vehicleList": vehicles}).notes
    assert len(notes) == 21
    assert notes[-1] == "... and more of that kind"


def test_byte_order_mark_is_ignored() -> None:
    assert read_scenario(b"\xef\xbb\xbf" + json.dumps(SAVED).encode(), "x.json").name == "x"


def test_null_equals_a_missing_key() -> None:
    document = {key: None for key in SAVED if key != "egoVehicle"} | {"egoVehicle": EGO}
    assert len(read(document).egos) == 1


# -- on a link

ROADS = Roads(
    ["A0", "A1"], [np.array([[0, 0, 0], [9, 0, 0]]), np.array([[9, 0, 1], [9, 40, 1]])], [[], []], [3, 3], [0, 0]
)


def test_agent_on_a_link_is_placed_by_the_map() -> None:
    scenario = read(SAVED)
    assert (scenario.vehicles[1].link, scenario.vehicles[1].is_placed) == ("A1", False)
    placed = place_on_roads(scenario, ROADS).vehicles[1]
    assert (placed.x, placed.y, placed.z, placed.link, placed.is_placed) == (9.0, 10.0, 1.0, None, True)
    assert placed.yaw == pytest.approx(math.pi / 2)


def test_unknown_link_is_an_error_without_a_position_and_a_note_with_one() -> None:
    with pytest.raises(DocumentError) as caught:
        place_on_roads(read(SAVED), Roads())
    assert str(caught.value) == "mine: vehicleList[1].initPosition.initLink: the map has no link 'A1'"
    scenario = place_on_roads(read(changed("vehicleList.1.initPosition.pos", {"x": 3, "y": 4})), Roads())
    assert (scenario.vehicles[1].x, scenario.vehicles[1].link) == (3.0, None)
    assert "vehicleList[1]: the map has no link 'A1'; placed by its position instead" in scenario.notes


# -- what is refused


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        ("vehicleList.0.initPosition.pos.x", "abc", "vehicleList[0].initPosition.pos.x: expected a number, got 'abc'"),
        ("egoVehicle.initPosition.pos.y", "12,5", "egoVehicle.initPosition.pos.y: expected a number, got '12,5'"),
        ("egoVehicle.initPosition.pos.y", "1,2345", "egoVehicle.initPosition.pos.y: expected a number, got '1,2345'"),
        ("egoVehicle.initPosition.pos.y", True, "egoVehicle.initPosition.pos.y: expected a number, got true"),
        ("egoVehicle.initPosition.pos.y", "", "egoVehicle.initPosition.pos.y: expected a number, got ''"),
        ("egoVehicle.initPosition.pos.y", math.nan, "egoVehicle.initPosition.pos.y: expected a finite number, got nan"),
        (
            "egoVehicle.initPosition.pos.y",
            1e9,
            "egoVehicle.initPosition.pos.y: expected at most 100,000,000, got 1000000000.0",
        ),
        ("egoVehicle.initPosition.pos", ..., "egoVehicle.initPosition.pos: missing"),
        ("egoVehicle.initPosition", ..., "egoVehicle.initPosition: missing"),
        ("egoVehicle.initPosition", [], "egoVehicle.initPosition: expected an object, got a list of 0"),
        ("egoVehicle.initPosition.initPositionMode", "Link", "egoVehicle.initPosition.initLink: missing"),
        ("egoVehicle.currentVelocity", 5000, "egoVehicle.currentVelocity: expected at most 1,000, got 5000"),
        # Other programs read these files, too: the bound is part of the format.
        ("egoVehicle.currentVelocity", 1000.1, "egoVehicle.currentVelocity: expected at most 1,000, got 1000.1"),
        ("egoVehicle.currentVelocity", -1000.1, "egoVehicle.currentVelocity: expected at least -1,000, got -1000.1"),
        (
            "vehicleList.1.initPosition.initLinkRatio",
            2,
            "vehicleList[1].initPosition.initLinkRatio: expected at most 1",
        ),
        ("vehicleList.0.isCloseLoop", "yes", "vehicleList[0].isCloseLoop: expected true or false, got 'yes'"),
        ("vehicleList.0.UNIQUEID", 1.5, "vehicleList[0].UNIQUEID: expected a whole number, got 1.5"),
        ("vehicleList.0.UNIQUEID", 10**30, "vehicleList[0].UNIQUEID: expected at most 2,147,483,647, got 1000"),
        ("vehicleList", {}, "vehicleList: expected a list, got an object"),
        ("vehicleList", [1], "vehicleList[0]: expected an object, got 1"),
        ("vehicleList", [EGO] * 10_001, "vehicleList: expected at most 10,000 entries, got a list of 10,001"),
        ("pedestrianList.0.pos", ..., "pedestrianList[0].pos: missing"),
        ("pedestrianList.0.pos", None, "pedestrianList[0].pos: expected an object, got null"),
        ("objectList.0.modelName", "\n" * 300, "objectList[0].modelName: expected at most 200 characters, got '\\n"),
        ("waypointDataList.0.waypointData.1.pos.z", ..., "waypointDataList[0].waypointData[1].pos.z: missing"),
        ("waypointDataList.0.waypointData.1.pos.z", 5e6, "waypointDataList[0]: expected a path of at most 1,000 km"),
        ("mapInfo", "track", "mapInfo: expected an object, got 'track'"),
    ],
)
def test_errors_name_path_and_expectation(path: str, value: object, text: str) -> None:
    assert refusal(changed(path, value)).startswith(f"mine.json: {text}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "mine.json: expected a JSON document, got nothing"),
        (b" \n", "mine.json: expected a JSON document, got nothing"),
        (b'{\n  "egoVehicle": }', "mine.json:2:17: not JSON: expected a value"),
        (b'{"a": 1,}', "mine.json:1:8: not JSON: trailing comma"),
        (b'{"mapInfo": {"mapName": "\xb5"}}', "mine.json:1:26: not UTF-8: byte 0xb5; save the file as UTF-8"),
        (b"[" * 5000, "mine.json: not JSON: nested too deeply"),
        (b"[]", "mine.json: expected an object, got a list of 0"),
        (b"null", "mine.json: expected an object, got null"),
        (
            b"{}",
            "mine.json: expected a scenario with at least one of mapInfo, egoVehicle, vehicleList, pedestrianList,",
        ),
        (b'{"openapi": "3.0"}', "mine.json: expected a scenario with at least one of mapInfo, egoVehicle"),
        (b" " * ((1 << 25) + 1), "mine.json: expected at most 33,554,432 bytes, got 33,554,433"),
    ],
    ids=lambda value: value[:12] if isinstance(value, bytes) else "",
)
def test_document_that_is_no_scenario_gives_one_error_line(text: bytes, message: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_scenario(text, "mine.json")
    assert str(caught.value).startswith(message)
    assert len(str(caught.value).splitlines()) == 1


junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["x", "pos", "y", "z"]), inner, max_size=3)
    ),
    max_leaves=4,
)
places = st.sampled_from(
    [
        "egoVehicle",
        "egoVehicle.initPosition",
        "egoVehicle.initPosition.pos",
        "egoVehicle.initPosition.rot",
        "vehicleList",
        "vehicleList.0",
        "vehicleList.0.UNIQUEID",
        "vehicleList.1.initPosition.initLink",
        "pedestrianList.0.speed",
        "pedestrianList.0.movingDistance",
        "objectList.0.pathName",
        "objectList.0.scale",
        "objectList.0.activeDistance",
        "objectList.0.rot",
        "egoVehicle.initPosition.gear",
        "vehicleList.0.desiredVelocity",
        "vehicleList.0.currentLinkInfo",
        "tlList",
        "spawnPointList",
        "waypointDataList.0",
        "waypointDataList.0.pathName",
        "waypointDataList.1.waypointData",
        "mapInfo",
    ]
)


@given(place=places, value=junk)
def test_any_value_is_read_or_reported(place: str, value: object) -> None:
    text = ""
    try:
        scenario = place_on_roads(read(changed(place, value)), ROADS)
    except DocumentError as error:
        text = str(error)
    else:
        populate(scenario)
    assert len(text.splitlines()) <= 1


# -- what ships


def populate(scenario: Scenario) -> World:
    world = World()
    for spawn in (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles):
        world.spawn(
            spawn.kind,
            spawn.model.body,
            name=spawn.name,
            x=spawn.x,
            y=spawn.y,
            z=spawn.z,
            yaw=spawn.yaw,
            speed=spawn.speed,
            uid=spawn.uid,
            path=spawn.path,
            is_loop=spawn.is_loop,
            gear=spawn.gear,
            roll=spawn.roll,
            pitch=spawn.pitch,
            start_within=spawn.start_within,
        )
    return world


def demo() -> tuple[Scenario, Roads]:
    roads = read_map(TRACK, "track").roads
    return place_on_roads(read_scenario(DEMO, "demo.json"), roads), roads


def test_demo_scenario_equals_the_output_of_its_script() -> None:
    assert runpy.run_path(str(ROOT / "scripts" / "draw_maps.py"))["demo_scenario"]() == DEMO


def test_json_schema_of_scenarios_is_current() -> None:
    for path, text in runpy.run_path(str(ROOT / "scripts" / "write_schemas.py"))["schema_files"]().items():
        assert path.read_text(encoding="utf-8") == text, "run scripts/write_schemas.py"


def test_demo_has_every_kind_of_entity() -> None:
    scenario, _ = demo()
    assert (scenario.name, scenario.map_name, scenario.notes) == ("demo", "track", ())
    assert len(scenario.egos) == 1
    assert len(scenario.vehicles) >= 4
    assert len(scenario.pedestrians) >= 1
    assert len(scenario.obstacles) >= 6
    assert all(spawn.speed > 0.0 and spawn.driver is not None for spawn in scenario.vehicles)
    assert all(spawn.yields and spawn.path is not None and spawn.is_loop for spawn in scenario.pedestrians)


def test_demo_vehicles_stand_in_their_lanes_in_driving_direction() -> None:
    scenario, roads = demo()
    for spawn in (*scenario.egos, *scenario.vehicles):
        place = roads.nearest(spawn.x, spawn.y, spawn.yaw)
        assert place.distance[0] < 0.05
        assert math.cos(place.yaw[0] - spawn.yaw) > 0.999
        assert roads.ids[place.lane[0]].startswith("L2" if spawn.kind is Kind.EGO else "L1")


def test_demo_pedestrians_and_obstacles_are_off_the_road() -> None:
    scenario, roads = demo()

    def clear(spawn: Spawn, x: float, y: float) -> bool:
        return bool(
            roads.nearest(x, y).distance[0] > 1.75 + math.hypot(spawn.model.body.length, spawn.model.body.width) / 2
        )

    assert all(clear(spawn, spawn.x, spawn.y) for spawn in (*scenario.pedestrians, *scenario.obstacles))
    for spawn in scenario.pedestrians:  # they turn off the road, and before the drives of the documentation leave it
        assert spawn.path is not None
        assert all(clear(spawn, x, y) and x < 55.0 for x, y, _ in spawn.path.tolist())


@pytest.mark.slow
@pytest.mark.parametrize("num_frames", [8_000, pytest.param(15_000, marks=pytest.mark.long)])
def test_demo_ego_has_no_collision_within_two_laps(num_frames: int) -> None:
    world = populate(demo()[0])
    ego = int(world.rows(Kind.EGO)[0])
    others = world.rows(Kind.VEHICLE)
    x, y = world.x[ego], world.y[ego]
    start = world.x[others].copy()
    for i in range(num_frames):
        step(world)
        if i % 25 == 0:
            # Every 4 m of their way: beside the ego they are a lane away.
            assert np.hypot(world.x[others] - x, world.y[others] - y).min() > 3.0
    assert world.frame == num_frames
    assert (world.x[ego], world.y[ego]) == (x, y)
    assert (world.x[others] != start).all()

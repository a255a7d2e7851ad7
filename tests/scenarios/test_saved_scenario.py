"""A hand-written scenario in MORAI's saved format: read, checked, loaded and driven."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.scenario import Scenario, Spawn
from rosbridge_sim.scenarios.scenario_check import find_oddities, place_draft, read_draft
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, read_scenario
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.world.state.world import Gear, Kind, World
from tests.simulator.small_maps import ROADRUNNER, read

TEXT = (Path(__file__).parent / "fixtures" / "saved.json").read_bytes()


def scenario() -> Scenario:
    return place_on_roads(read_scenario(TEXT, "saved.json"), read(ROADRUNNER).roads)


def place(spawn: Spawn) -> tuple[float, float, float, float]:
    return spawn.x, spawn.y, spawn.z, round(math.degrees(spawn.yaw), 6)


def kmh(spawn: Spawn) -> float:
    return round(spawn.speed * 3.6, 6)


def test_ego_of_a_saved_scenario_is_read() -> None:
    (ego,) = scenario().egos
    assert (ego.name, ego.uid, ego.gear) == ("Hyundai_Ioniq_5", 0, Gear.DRIVE)
    assert (place(ego), kmh(ego)) == ((30.0, 0.25, 0.0, 1.5), 18.0)


def test_vehicle_with_numbers_as_texts_follows_its_path() -> None:
    car = scenario().vehicles[0]
    assert (car.uid, place(car), kmh(car), car.is_loop) == (101, (1030.5, -2000.25, 1.5, 180.0), 27.0, True)
    assert car.path is not None
    # (-east, up, -north) in the file: the first waypoint is where it stands.
    assert car.path.tolist() == [[1030.5, -2000.25, 1.5], [1010.5, -2000.25, 1.5], [1010.5, -1980.25, 2.5]]
    assert (car.driver, car.link) == (None, None)


def test_vehicle_on_a_link_drives_at_the_speed_limit() -> None:
    car = scenario().vehicles[1]
    assert (car.uid, place(car), kmh(car)) == (102, (25.0, 3.5, 0.0, 0.0), 36.0)
    assert car.driver is not None
    assert math.isinf(car.driver.desired_speed)
    assert car.path is None


def test_pedestrians_walk_ahead_or_along_their_path() -> None:
    ahead, along = scenario().pedestrians
    assert (ahead.uid, place(ahead), kmh(ahead), ahead.is_loop) == (201, (104.0, -3.0, 0.0, 90.0), 5.4, True)
    assert ahead.path is not None
    assert ahead.path.round(9).tolist() == [[104.0, -3.0, 0.0], [104.0, 5.0, 0.0]]
    assert along.path is not None
    assert along.path.tolist() == [[20.0, 9.0, 0.0], [20.0, 19.0, 0.0]]
    assert (along.uid, kmh(along), along.is_loop) == (202, 3.6, False)


def test_obstacles_stand_or_follow_their_path() -> None:
    crate, cone = scenario().obstacles
    assert (crate.name, crate.uid, place(crate), kmh(crate)) == ("Cargo_Box", 301, (40.0, -4.0, 0.0, 0.0), 7.2)
    assert crate.path is not None
    assert crate.path.tolist() == [[40.0, -4.0, 0.0], [60.0, -4.0, 0.0]]
    assert (cone.name, cone.path) == ("Traffic_Cone", None)


def test_ignored_keys_are_listed_and_give_no_remarks() -> None:
    draft = read_draft(TEXT, "saved.json")
    assert draft.mistakes == ()
    assert draft.scenario is not None
    placed, mistakes = place_draft(draft.scenario, read(ROADRUNNER))
    assert mistakes == []
    assert placed.notes == (
        (
            "DataID 30200004 (vehicle) is not in the catalogue; it gets the ordinary size of its class,"
            " 4.47 x 1.82 x 1.45 m; --catalogue FILE can define it"
        ),
        (
            "DataID 50100002 (pedestrian) is not in the catalogue; it gets the ordinary size of its class,"
            " 0.45 x 0.55 x 1.7 m; --catalogue FILE can define it"
        ),
        (
            "DataID 50200001 (pedestrian) is not in the catalogue; it gets the ordinary size of its class,"
            " 0.45 x 0.55 x 1.7 m; --catalogue FILE can define it"
        ),
        "tlList: no intersection 'IntTL99' has a phase 0; the entry is ignored",
    )
    assert [line.partition(" (")[0] for line in find_oddities(placed, read(ROADRUNNER).roads)] == ["vehicleList[0]"]
    assert {key for key in draft.keys.passed_over if "." not in key} == {"v2IInfo", "aiPedstrianList", "version"}
    idle = {"shadedAreaList", "frictionChangeMaterialList", "pedspawnPointList"}
    assert {key for key in draft.keys.idle if "." not in key} == idle
    for key in (
        "egoVehicle.vehicleSaveData",
        "vehicleList[].viewCurrentVelocity",
        "waypointDataList[].waypointData[].rot",
        "mapInfo.eastOffset",
    ):
        assert draft.keys.passed_over[key] > 0
        assert key not in draft.keys.read
    for key in ("vehicleList[].initPosition.pos._x", "objectList[].scale.x", "pedestrianList[].activeDistance"):
        assert draft.keys.read[key] > 0
    for key in ("vehicleList[].latBiasMode", "vehicleList[].destinationMode", "pedestrianList[].active"):
        assert draft.keys.idle[key] == 1


class SavedLibrary:
    def map(self, name: str) -> RoadMap:
        assert name == "tiny"
        return read(ROADRUNNER)

    def scenario(self, name: str) -> Scenario:
        raise AssertionError(name)


def test_saved_scenario_loads_completely() -> None:
    world = World(seed=0)
    Scene(world, SavedLibrary(), read_scenario(TEXT, "saved.json"), ego_gear=Gear.DRIVE)
    counts = {kind: len(world.rows(kind)) for kind in Kind}
    assert counts == {Kind.EGO: 1, Kind.VEHICLE: 2, Kind.PEDESTRIAN: 2, Kind.OBSTACLE: 2}
    assert sorted(int(world.uid[row]) for row in world.placed()) == [0, 101, 102, 201, 202, 301, 302]
    assert world.signals.phase.tolist() == [1]
    assert world.signals.elapsed(0) == 125  # 2.5 s


@pytest.mark.parametrize("key", [key for key in json.loads(TEXT) if key != "egoVehicle"])
def test_every_section_may_be_missing_null_or_empty(key: str) -> None:
    document = json.loads(TEXT)
    parts = [{k: v for k, v in document.items() if k != key}, {**document, key: None}]
    parts += [{**document, key: []}] if isinstance(document[key], list) else []
    for part in parts:
        found = read_scenario(json.dumps(part).encode(), "part.json")
        assert len(found.egos) == 1


def test_line_ends_and_byte_order_mark_make_no_difference() -> None:
    windows = b"\xef\xbb\xbf" + TEXT.replace(b"\n", b"\r\n")
    assert read_draft(windows, "saved.json").mistakes == ()
    assert len(read_scenario(windows, "saved.json").vehicles) == 2

"""Scenario files in the shape that MORAI saves, from the disk into the world of both releases; verdicts on them."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.world.state.world import Kind, World
from tests.cli.tool_fixture import run
from tests.simulator.saved_files import CONTROLLERS, MAP, MAP_NAME, edited_scenario, saved_scenario
from tests.simulator.sim_harness import ALL, Client, make_store

FORMS: dict[str, Callable[[], dict[str, Any]]] = {"saved": saved_scenario, "edited": edited_scenario}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of scenarios as MORAI has it, and their map beside it."""
    (tmp_path / "maps" / MAP_NAME).mkdir(parents=True)
    for name, content in MAP.items():
        (tmp_path / "maps" / MAP_NAME / name).write_text(json.dumps(content))
    (tmp_path / "Scenario" / MAP_NAME).mkdir(parents=True)
    for name, make in FORMS.items():
        (tmp_path / "Scenario" / MAP_NAME / f"{name}.json").write_text(json.dumps(make()))
    return tmp_path


def library(folder: Path) -> DiskLibrary:
    return DiskLibrary([folder / "Scenario"], str(folder / "maps" / MAP_NAME))


def make(folder: Path, name: str, release: str) -> tuple[SimulatorNode, Client]:
    """A simulator whose opening scene is that file, and a client of it."""
    shelf = library(folder)
    bus = Bus(make_store(release))
    node = make_node(bus, World(), shelf, shelf.opening_scenario(name), NodeSettings(start="sync"))
    return node, Client(bus, "/client")


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
@pytest.mark.parametrize("name", FORMS)
def test_saved_file_loads_completely(folder: Path, name: str, release: str) -> None:
    node, client = make(folder, name, release)
    document = FORMS[name]()
    assert client.ask("/Service_MoraiSL", file_name=name, **ALL) == {"result": True}
    world = node.world
    counts = {kind: len(world.rows(kind)) for kind in Kind}
    num_objects = len(document["objectList"])
    assert counts == {Kind.EGO: 1, Kind.VEHICLE: 3, Kind.PEDESTRIAN: 1, Kind.OBSTACLE: num_objects}
    ego = int(world.rows(Kind.EGO)[0])
    assert (world.x[ego], world.y[ego], world.names[ego]) == (20.0, 3.5, "Vehicle_20200003")
    angles = [world.yaw[ego], world.roll[ego], world.pitch[ego]]
    assert angles == pytest.approx([math.radians(angle) for angle in (1.509, 0.25, 0.5)])
    assert client.told == []


@pytest.mark.parametrize("name", FORMS)
def test_saved_obstacles_stand_at_their_positions(folder: Path, name: str) -> None:
    node, client = make(folder, name, "22.R2")
    client.start()
    for _ in range(100):
        client.tick()
    world = node.world
    for row, item in zip(world.rows(Kind.OBSTACLE).tolist(), FORMS[name]()["objectList"], strict=True):
        assert (world.x[row], world.y[row], world.speed[row]) == (item["pos"]["x"], item["pos"]["y"], 0.0)
    first, third = (int(world.rows(Kind.OBSTACLE)[i]) for i in (0, 2))
    assert world.roll[third] == pytest.approx(math.pi / 2)
    body = world.bodies[first]
    assert (body.length, body.width, body.height) == pytest.approx((1.8, 0.8, 0.2))


@pytest.mark.parametrize("name", FORMS)
def test_saved_vehicles_drive_along_the_lanes(folder: Path, name: str) -> None:
    node, client = make(folder, name, "22.R2")
    cars = node.world.rows(Kind.VEHICLE)
    assert (node.world.speed[cars] * 3.6).tolist() == pytest.approx([36.0, 30.0, 0.0])
    before = node.world.x[cars].copy()
    client.start()
    for _ in range(50):
        client.tick()
    assert node.world.has_lane[cars].all()
    assert (node.world.x[cars] - before > 0.3).all()


@pytest.mark.parametrize(("name", "phases"), [("saved", [0, 1, 2, 0]), ("edited", [0, 0, 0, 0])])
def test_saved_light_phases_are_matched_by_position(folder: Path, name: str, phases: list[int]) -> None:
    signals = make(folder, name, "22.R2")[0].world.signals
    assert [one.name for one in signals.plan.controllers] == list(CONTROLLERS)
    assert signals.phase.tolist() == phases
    assert [signals.elapsed(i) for i in range(4)] == ([75] * 4 if name == "saved" else [0] * 4)


def test_pedestrian_starts_when_the_ego_is_near_and_waits_again_after_a_reset(folder: Path) -> None:
    node, client = make(folder, "saved", "22.R2")
    world = node.world
    client.start()
    opening = world.digest()

    def drive() -> list[float]:
        client.control(0, longlCmdType=2, velocity=36.0)
        client.ask("/SyncModeSetGear", frame=0, gear=4)
        heights = []
        for _ in range(200):
            client.tick()
            heights.append(float(world.y[world.rows(Kind.PEDESTRIAN)[0]]))
        return heights

    heights = drive()
    # The pedestrian waits at (60, -3) for an ego within 30 m, and then walks 9 m to the north.
    assert heights[50] == -3.0
    assert max(heights) > -2.0
    after = world.digest()
    client.call("/sim/reset", {"seed": -1})
    assert world.digest() == opening
    assert drive() == heights
    assert world.digest() == after


# Verdicts


def check(folder: Path, *words: str) -> JsonValue:
    done = run("scenario", "check", *words, "--map", str(folder / "maps" / MAP_NAME), "--json")
    assert done.err == ""
    return json.loads(done.out)


def test_saved_files_have_no_errors_and_remarks_on_unknown_keys(folder: Path) -> None:
    for name in FORMS:
        account = check(folder, str(folder / "Scenario" / MAP_NAME / f"{name}.json"))
        assert account["mistakes"] == []
        assert [line.partition(" (")[0] for line in account["remarks"] if "DataID" in line] == ["DataID 50100007"]
        assert [one["intersection"] for one in account["phases"]] == list(CONTROLLERS)
        idle = account["without_effect"]
        assert {"spawnPointList[].isSpawning", "shadedAreaList", "vehicleList[].latBiasMode"} <= set(idle)
        assert "frictionChangeMaterialList" in idle
        walker = next(one for one in account["items"] if one["kind"] == "pedestrian")
        assert walker["starts_within"] == 30.0
        assert walker["way"] == "path of 2 waypoints, 9 m, when an ego is within 30 m"


def test_saved_tilts_and_sizes_are_published(folder: Path) -> None:
    at = str(folder / "Scenario" / MAP_NAME / "edited.json")
    lines = run("scenario", "check", at, "--map", str(folder / "maps" / MAP_NAME)).lines
    (ego,) = [line for line in lines if line.startswith("egoVehicle  ")]
    assert "  1.5 (roll 0.2, pitch 0.5)  " in ego
    boxes = [line for line in lines if line.startswith("objectList[")]
    assert "  Box (1.8 x 0.8 x 0.2 m)  " in boxes[0]
    assert "  -115.0 (roll 90.0)  " in boxes[2]
    assert "(" not in boxes[3]


def spoilt(path: str, value: object) -> dict[str, Any]:
    """The saved file with another value at a place."""
    document = copy.deepcopy(saved_scenario(3))
    *way, last = [int(part) if part.isdecimal() else part for part in path.split(".")]
    at: Any = document
    for part in way:
        at = at[part]
    at[last] = value
    return document


@pytest.mark.parametrize(
    ("path", "value", "is_refused"),
    [
        ("egoVehicle.initPosition.pos.x", "left", True),
        ("egoVehicle.initPosition.pos", {"x": 5000, "y": 5000}, False),  # far off any road
        ("egoVehicle.initPosition", {"initPositionMode": "Link", "initLink": "gone"}, True),
        ("vehicleList.0.initPosition.initPositionMode", "Link", True),  # with no link to it
        ("vehicleList.0.DataID", 12345, False),
        ("vehicleList.0.isLaneChange", {"odd": 1}, False),
        ("vehicleList.1.route", ["B2D"], True),
        ("objectList.0.scale", {"x": 0}, False),
        ("objectList.0.scale", 2, True),
        ("objectList.0.modelName", "Rocket", True),
        ("objectList", {}, True),
        ("tlList.0.index", "IntTL77", False),
        ("tlList.0.state", 99, False),
        ("tlList.0.deltaTime", 1e6, False),
        ("tlList.0.deltaTime", "long", True),
        ("spawnPointList", "nonsense", True),
        ("spawnPointList.0.minSpawnPeriod", "soon", True),
        ("waypointDataList.0.pathName", "ObstaclePath - 12345", False),
        ("pedestrianList.0.activeDistance", "near", True),
        ("pedestrianList.0.activeDistance", -5, False),
    ],
)
def test_load_refuses_errors_and_accepts_remarks(folder: Path, path: str, value: object, *, is_refused: bool) -> None:
    (folder / "Scenario" / "other.json").write_text(json.dumps(spoilt(path, value)))
    account = check(folder, "other", "--scenario-path", str(folder / "Scenario"))
    assert bool(account["mistakes"]) is is_refused, account["mistakes"]
    node, client = make(folder, "edited", "22.R2")
    before = node.world.digest()
    assert client.ask("/Service_MoraiSL", file_name="other", **ALL) == {"result": not is_refused}
    assert bool(client.told) is is_refused
    assert (node.world.digest() == before) is is_refused


def test_unknown_map_is_an_error_for_load_and_check(folder: Path) -> None:
    done = run("scenario", "check", "saved", "--scenario-path", str(folder / "Scenario"), "--json")
    (line,) = json.loads(done.out)["mistakes"]
    assert done.code == 1
    assert line.startswith(
        f"mapInfo.mapName: no map '{MAP_NAME}'; known are hills, loop, motorway, parking, roundabout, town, track,"
        " and --map takes a folder or a .xodr file."
    )
    shelf = DiskLibrary([folder / "Scenario"])
    with pytest.raises(DocumentError, match=f"no map '{MAP_NAME}'"):
        make_node(Bus(make_store()), World(), shelf, shelf.opening_scenario("saved"))


def test_user_catalogue_removes_the_remarks_and_gives_the_sizes(folder: Path) -> None:
    file = folder / "models.csv"
    file.write_text(
        "DataID,name,class,length,width,height\n50100007,Runner,pedestrian,0.5,0.6,1.8\n30200005,Lorry,vehicle,9,2.4,3\n"
    )
    at = str(folder / "Scenario" / MAP_NAME / "edited.json")
    account = check(folder, at, "--catalogue", str(file))
    assert [line for line in account["remarks"] if "DataID" in line] == []
    models = {one["at"]: (one["model"], one["size"]) for one in account["items"]}
    assert models["pedestrianList[0]"] == ("Runner", [0.5, 0.6, 1.8])
    assert models["vehicleList[0]"] == ("Lorry", [9.0, 2.4, 3.0]), "it wins over ours"
    shelf = DiskLibrary([folder / "Scenario"], str(folder / "maps" / MAP_NAME), file)
    bus = Bus(make_store())
    settings = NodeSettings(start="sync", catalogue=shelf.catalogue)
    node = make_node(bus, World(), shelf, shelf.opening_scenario("edited"), settings)
    assert node.world.names[node.world.row(80)] == "Lorry"
    client = Client(bus, "/client")
    client.start()
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", frame=0, name="lorry", position={"x": 5, "y": 90})
    client.tick()
    added = node.world.rows(Kind.VEHICLE)[-1]
    assert node.world.bodies[added].length == 9.0

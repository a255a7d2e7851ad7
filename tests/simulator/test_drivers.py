"""Scenario vehicles that follow lanes, and initial phases of intersections."""

from __future__ import annotations

import json
import logging
import math
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, read_scenario
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.scene.load import WHOLE, LoadOptions
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.world.state.world import Gear, Kind, World
from rosbridge_sim.world.step import step
from tests.simulator.small_maps import ROADRUNNER, read, tiny
from tests.world.road_factory import built_in

LINK = {"initPositionMode": "Link", "initLink": "A1B1", "initLinkRatio": 0.25}


def scenario_of(*vehicles: dict[str, Any], **more: JsonValue) -> Scenario:
    return read_scenario(json.dumps({"vehicleList": vehicles, **more}).encode(), "drive.json")


def placed(**vehicle: Any) -> Scenario:  # noqa: ANN401 - keys of a vehicle
    return place_on_roads(scenario_of(vehicle), read(ROADRUNNER).roads)


def refusal(**vehicle: Any) -> str:  # noqa: ANN401 - keys of a vehicle
    with pytest.raises(DocumentError) as caught:
        placed(**vehicle)
    return str(caught.value)


# Documents


def test_vehicle_that_starts_on_a_link_follows_the_lanes() -> None:
    (spawn,) = placed(initPosition=LINK, velocityType=1, linkVelocity=30, currentVelocity=18).vehicles
    assert spawn.driver is not None
    assert (spawn.driver.lane, spawn.driver.s, spawn.driver.desired_speed, spawn.driver.route) == (
        0,
        25.0,
        math.inf,
        (),
    )
    assert (spawn.x, spawn.y, spawn.speed, spawn.path) == (25.0, 0.0, 5.0, None)


@pytest.mark.parametrize(
    ("speeds", "wish", "speed"),
    [
        ({}, math.inf, 0.0),
        ({"velocityType": 1, "linkVelocity": 36}, math.inf, 10.0),
        ({"velocityType": 2, "constantVelocity": 36}, 10.0, 10.0),
        ({"velocityType": 2, "constantVelocity": 36, "currentVelocity": 0}, 10.0, 0.0),
        ({"constantVelocity": 36}, 10.0, 10.0),
        ({"constantVelocity": 0}, 0.0, 0.0),
        ({"constantVelocity": -36}, 0.0, 0.0),
    ],
)
def test_own_speed_of_a_vehicle_is_its_desired_speed(speeds: dict[str, Any], wish: float, speed: float) -> None:
    (spawn,) = placed(initPosition=LINK, **speeds).vehicles
    assert spawn.driver is not None
    assert (spawn.driver.desired_speed, spawn.speed) == (wish, speed)


def at(x: float, y: float, yaw: float = 0.0) -> dict[str, Any]:
    return {"initPositionMode": "Absolute", "pos": {"x": x, "y": y}, "rot": {"yaw": yaw}}


def test_vehicle_without_waypoints_follows_the_lane_it_stands_on() -> None:
    (spawn,) = placed(initPosition=at(40.0, 2.4, 10.0), isWaypointMode=False).vehicles
    assert spawn.driver is not None
    assert (spawn.driver.lane, spawn.driver.s) == (1, 40.0)
    (spawn,) = placed(initPosition=at(40.0, 2.4, 10.0)).vehicles
    assert spawn.driver is None, "only if the document says that there are no waypoints"


@pytest.mark.parametrize("where", [at(40.0, 30.0), at(40.0, 1.0, 180.0), at(40.0, 1.0, 60.0)])
def test_vehicle_off_or_across_the_lanes_goes_straight_ahead(where: dict[str, Any]) -> None:
    scenario = placed(initPosition=where, isWaypointMode=False, constantVelocity=36)
    assert (scenario.vehicles[0].driver, scenario.vehicles[0].speed) == (None, 10.0)
    assert scenario.notes == ("vehicleList[0]: it stands on no lane; it goes straight ahead",)


def test_unknown_link_is_replaced_by_the_lane_at_the_position() -> None:
    start = {**at(40.0, 0.0), "initPositionMode": "Link", "initLink": "gone"}
    (spawn,) = placed(initPosition=start).vehicles
    assert spawn.driver is not None
    assert (spawn.driver.lane, spawn.driver.s) == (0, 40.0)


def test_path_takes_precedence_over_lanes() -> None:
    path = [{"pathName": "way", "waypointData": [{"pos": {"x": 0, "z": 0}}, {"pos": {"x": -50, "z": 0}}]}]
    scenario = scenario_of({"initPosition": LINK, "pathName": "way"}, waypointDataList=path)
    assert place_on_roads(scenario, read(ROADRUNNER).roads).vehicles[0].driver is None


def test_route_must_be_consecutive_links() -> None:
    (spawn,) = placed(initPosition=LINK, route=["A1B1", "B1C1"]).vehicles
    assert spawn.driver is not None
    assert spawn.driver.route == (0, 2)
    where = "drive: vehicleList[0].route"
    assert refusal(initPosition=LINK, route=["B1C1"]) == f"{where}[0]: expected 'A1B1', where it starts, got 'B1C1'"
    assert refusal(initPosition=LINK, route=["A1B1", "B2D"]) == f"{where}[0]: 'B2D' does not follow 'A1B1'"
    assert refusal(initPosition=LINK, route=["A1B1", "X"]) == f"{where}[1]: the map has no link 'X'"
    loop = {"route": ["A1B1", "B1C1"], "isCloseLoop": True}
    assert refusal(initPosition=LINK, **loop) == f"{where}[1]: 'A1B1' does not follow 'B1C1'"


def test_initial_phases_of_intersections_are_read() -> None:
    scenario = scenario_of(tlList=[{"index": "IntTL13", "state": 1, "deltaTime": "2.5"}, {"index": 7}])
    assert [(p.controller, p.phase, p.elapsed) for p in scenario.phases] == [("IntTL13", 1, 2.5), ("7", 0, 0.0)]
    with pytest.raises(DocumentError, match=r"drive.json: tlList\[0\].deltaTime: expected at least 0, got -1"):
        scenario_of(tlList=[{"index": "I", "deltaTime": -1}])


# On the stage


class TinyLibrary:
    """The hand-written map under any name but one."""

    def __init__(self) -> None:
        self.tiny = tiny()

    def scenario(self, name: str) -> Scenario:
        raise DocumentError(name)

    def map(self, name: str) -> RoadMap:
        return built_in("loop") if name == "loop" else self.tiny


def scene_of(scenario: Scenario) -> Scene:
    return Scene(World(), TinyLibrary(), scenario, ego_gear=Gear.DRIVE)


def test_vehicle_on_a_link_follows_its_route_and_another_goes_straight() -> None:
    scenario = scenario_of(
        {"initPosition": LINK, "route": ["A1B1", "B1C1"]}, {"initPosition": at(0, 50), "constantVelocity": 36}
    )
    world = scene_of(scenario).world
    driver, other = world.rows(Kind.VEHICLE).tolist()
    assert (bool(world.has_lane[driver]), bool(world.has_lane[other])) == (True, False)
    for _ in range(200):
        step(world)
    assert world.x[driver] > 35.0
    assert world.x[other] == pytest.approx(40.0)


def test_lights_begin_in_the_phase_of_the_scenario(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    phases = [{"index": "IntTL13", "state": 1, "deltaTime": 2.0}, {"index": "IntTL9"}, {"index": "IntTL13", "state": 7}]
    scene = scene_of(scenario_of(tlList=phases))
    signals = scene.world.signals
    assert (signals.phase.tolist(), signals.elapsed(0)) == ([1], 100)
    assert "scenario drive: no intersection 'IntTL9' has a phase 0" in caplog.text
    assert "scenario drive: no intersection 'IntTL13' has a phase 7" in caplog.text
    late = scene_of(scenario_of(tlList=[{"index": "IntTL13", "state": 0, "deltaTime": 1000.0}])).world.signals
    assert late.remaining(0) == 1


def test_load_keeps_the_lights_unless_it_sets_phases_or_changes_the_map() -> None:
    scene = scene_of(scenario_of())
    world = scene.world
    for _ in range(700):
        step(world)
    scene.carry_out(scene.prepare(scenario_of({"initPosition": LINK}), WHOLE))
    assert (world.signals.phase.tolist(), world.signals.elapsed(0)) == ([1], 50)
    scene.carry_out(scene.prepare(scenario_of(tlList=[{"index": "IntTL13"}]), WHOLE))
    assert (world.signals.phase.tolist(), world.signals.elapsed(0)) == ([0], 0)
    scene.carry_out(scene.prepare(scenario_of(mapInfo={"mapName": "loop"}), WHOLE))
    assert (len(world.signals.plan.controllers), len(world.roads)) == (0, 33)


def test_vehicles_of_an_old_map_stand_after_a_map_change() -> None:
    scene = scene_of(scenario_of({"initPosition": LINK, "currentVelocity": 36}))
    keep = LoadOptions(delete_all=False, ego=False, vehicles=True, pedestrians=False, obstacles=False)
    scene.carry_out(scene.prepare(scenario_of(mapInfo={"mapName": "loop"}), keep))
    world = scene.world
    (row,) = world.rows(Kind.VEHICLE).tolist()
    assert (bool(world.has_lane[row]), float(world.speed[row])) == (False, 0.0)


def test_load_uses_the_map_it_was_prepared_for() -> None:
    scene = scene_of(scenario_of())
    load = scene.prepare(scenario_of({"initPosition": LINK}), WHOLE)
    scene.carry_out(scene.prepare(scenario_of(mapInfo={"mapName": "loop"}), WHOLE))
    scene.carry_out(load)
    world = scene.world
    assert world.roads is scene.road_map.roads
    assert world.roads.ids[world.lane[world.rows(Kind.VEHICLE)[0]]] == "A1B1"


def test_reset_restores_the_beginning() -> None:
    phases = [{"index": "IntTL13", "state": 1, "deltaTime": 2.0}]
    scene = scene_of(scenario_of({"initPosition": LINK}, tlList=phases))
    before = scene.world.digest()
    for _ in range(123):
        step(scene.world)
    scene.reset(None)
    assert scene.world.digest() == before


def test_failed_load_keeps_roads_and_lights(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(scenario_of({"initPosition": LINK}))
    load = scene.prepare(scenario_of({"initPosition": at(0, 0)}, mapInfo={"mapName": "loop"}), WHOLE)
    for _ in range(50):
        step(scene.world)
    before = scene.world.digest()

    def refuse(*_: object, **__: object) -> int:
        raise ValueError("no room")

    monkeypatch.setattr(scene.world, "spawn", refuse)
    with pytest.raises(DocumentError, match="drive: no room"):
        scene.carry_out(load)
    assert scene.world.digest() == before


# What ships


@pytest.mark.parametrize(("name", "num"), [("town", 24), ("loop", 20), ("motorway", 44), ("roundabout", 16)])
def test_traffic_of_the_built_in_scenarios_drives(name: str, num: int) -> None:
    library = DiskLibrary()
    scenario = library.scenario(name)
    assert scenario.notes == ()
    scene = Scene(World(), library, scenario, ego_gear=Gear.DRIVE)
    world = scene.world
    rows = world.rows(Kind.VEHICLE)
    assert len(rows) == num
    assert world.has_lane[rows].all()
    before = world.x.copy(), world.y.copy()
    for _ in range(600):
        step(world)
        assert not len(world.contacts)
    moved = abs(world.x - before[0]) + abs(world.y - before[1])
    assert (moved[rows] > 5.0).all()
    assert world.speed[rows].mean() > (2.0 if name in {"town", "roundabout"} else 15.0)

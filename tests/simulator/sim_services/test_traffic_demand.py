"""Spawn points of scenarios, and `--traffic`."""

from __future__ import annotations

import json
import logging
from itertools import pairwise
from typing import Any, cast

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_check import place_draft
from rosbridge_sim.scenarios.scenario_reader import place_on_roads, read_scenario
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.plain.plain_bytes import decode, encode
from rosbridge_sim.simulator.scene.load import WHOLE
from rosbridge_sim.simulator.sim_services.traffic_demand import Traffic
from rosbridge_sim.simulator.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.simulator.snapshots import saved_loads
from rosbridge_sim.simulator.snapshots.node_state import NodeState
from rosbridge_sim.world.state.world import Kind, World
from tests.simulator.sim_harness import make_store
from tests.world.road_factory import built_in

pytestmark = pytest.mark.usefixtures("loops")

POINT = {
    "UNIQUEID": 7,
    "DataID": 90100001,
    "pos": {"x": 0, "y": 0, "z": 0},
    "startLinkInfo": {"linkIdx": "WB", "pointIdx": 4},
    "endLinkInfo": {"linkIdx": "EA", "pointIdx": 10},
    "minSpawnPeriod": 4.0,
    "maxSpawnPeriod": 6.0,
    "waitSpawnTime": 1.0,
    "SpawnVelocityType": 2,
    "MinSpawnVelocity_Custom": 10,
    "MaxSpawnVelocity_Custom": 20,
    "DesiredVelocityType": 2,
    "MinDesiredVelocity_Custom": 25,
    "MaxDesiredVelocity_Custom": 30,
    "SafetyDist": 5.0,
    "TTC": 1.0,
}


def read(*points: dict[str, Any], map_name: str = "roundabout", **more: JsonValue) -> Scenario:
    document = {"mapInfo": {"mapName": map_name}, "egoVehicle": EGO, "spawnPointList": points, **more}
    return read_scenario(json.dumps(document).encode(), "mine.json")


EGO = {"initPosition": {"pos": {"x": 5000, "y": 5000}}}


def simulate(scenario: Scenario, *, traffic: int = 0, seed: int = 0, wanders: bool = True) -> SimulatorNode:
    settings = NodeSettings(start="sync", traffic=traffic, traffic_wander=wanders)
    return make_node(Bus(make_store()), World(seed), DiskLibrary(), scenario, settings)


def run(node: SimulatorNode, seconds: float) -> None:
    world = node.context.world
    for _ in range(round(seconds * 50)):
        node.context.stepper.compute(0.0, is_tick=True, is_last=True)
        assert not len(world.contacts)


def vehicles(node: SimulatorNode) -> list[int]:
    return node.context.scene.vehicle_ids()


@pytest.mark.slow
def test_vehicles_appear_at_a_spawn_point_and_leave_at_its_destination() -> None:
    node = simulate(read(POINT))
    world = node.context.world
    seen: dict[int, float] = {}
    last: dict[int, str] = {}
    for frame in range(50 * 45):
        run(node, 0.02)
        for uid in vehicles(node):
            row = world.row(uid)
            if uid not in seen:
                assert world.roads.ids[world.lane[row]] == "WB"
                assert 10 / 3.6 - 0.1 <= world.speed[row] <= 20 / 3.6 + 0.1
                assert 25 / 3.6 <= world.desired_speed[row] <= 30 / 3.6
            seen.setdefault(uid, frame / 50)
            last[uid] = world.roads.ids[world.lane[row]]
    times = list(seen.values())
    assert times[0] == pytest.approx(1.0, abs=0.25)
    assert all(3.9 <= late - early <= 6.3 for early, late in pairwise(times))
    gone = [uid for uid in seen if uid not in world]
    assert len(gone) >= 1
    assert {last[uid] for uid in gone} == {"EA"}


def test_hundreds_of_spawn_points_without_room_leave_the_others_their_turn() -> None:
    blocker = {"modelName": "2015_Kia_K5", "initPosition": {"pos": {"x": -91, "y": -1.75}}, "isWaypointMode": True}
    blocked = [{**POINT, "UNIQUEID": i, "waitSpawnTime": 0} for i in range(399)]
    free = {**POINT, "UNIQUEID": 399, "waitSpawnTime": 0, "startLinkInfo": {"linkIdx": "WB", "pointIdx": 40}}
    node = simulate(read(*blocked, free, vehicleList=[blocker]))
    run(node, 1.0)
    assert len(vehicles(node)) == 2


def test_spawn_point_waits_until_there_is_room() -> None:
    blocker = {
        "modelName": "2015_Kia_K5",
        "initPosition": {"pos": {"x": -91, "y": -1.75}},
        "isWaypointMode": True,
    }
    node = simulate(read(POINT, vehicleList=[blocker]))
    run(node, 8.0)
    (uid,) = vehicles(node)
    node.context.scene.remove(uid)
    run(node, 1.0)
    assert len(vehicles(node)) == 1


@pytest.mark.slow
def test_spawn_point_has_no_more_vehicles_at_once_than_it_may() -> None:
    node = simulate(read({**POINT, "maximumSpawnVehicle": 2}))
    for _ in range(15):
        run(node, 1.0)
        assert len(vehicles(node)) <= 2
    assert len(vehicles(node)) == 2


def test_spawn_points_repeat_after_a_reset_and_differ_with_the_seed() -> None:
    node = simulate(read(POINT))
    run(node, 6.5)
    first = node.context.world.digest()
    node.context.scene_changes.reset(None, 0.0)
    run(node, 6.5)
    assert node.context.world.digest() == first
    other = simulate(read(POINT), seed=1)
    run(other, 6.5)
    speeds = [each.context.world.desired_speed[each.context.world.has_lane].tolist() for each in (node, other)]
    assert speeds[0] != speeds[1]


@pytest.mark.parametrize(("points", "traffic"), [((POINT,), 0), ((), 12)])
def test_restored_simulator_goes_on_with_the_same_traffic(points: tuple[dict[str, Any], ...], traffic: int) -> None:
    node = simulate(read(*points), traffic=traffic)
    run(node, 3.0)
    state = NodeState(node.context, node.components)
    saved = state.save()
    digests = []
    for _ in range(2):
        run(node, 3.0)
        digests.append(node.context.world.digest())
        state.restore(saved, 0.0, before_undo=lambda: None)
    assert digests[0] == digests[1]


@pytest.mark.parametrize("at", range(3))
@pytest.mark.parametrize("value", [-1, 2**63 - 1])
def test_state_with_a_count_that_cannot_grow_is_refused(at: int, value: int) -> None:
    (traffic,) = (one for one in simulate(read(POINT)).components if isinstance(one, Traffic))
    state = [part.copy() for part in cast("tuple[np.ndarray, ...]", traffic.save_state())]
    state[at][0] = value
    with pytest.raises(ValueError, match="expected frames and counts"):
        traffic.load_state(tuple(state), 0.0)


def test_spawn_point_is_found_by_its_position_and_its_destination_by_number() -> None:
    roads = built_in("roundabout").roads
    x, y, _ = roads.at(roads.row("NB"), 40.0)[0][0].tolist()
    there = {"UNIQUEID": 8, "pos": {"x": x, "y": y + 0.5}}
    here = {"pos": {"x": x, "y": y}, "endLinkInfo": {"linkIdx": ""}, "destinationObjUniqueID": 7}
    placed = place_on_roads(read(POINT, {**there, "destinationObjUniqueID": 7}, here), roads)
    assert placed.notes == ()
    first, second, third = placed.spawn_points
    assert roads.ids[second.lane] == "NB"
    assert second.s == pytest.approx(40.5, abs=0.1)
    assert (third.goal_lane, third.goal_s) == (second.goal_lane, second.goal_s) == (first.lane, first.s)


def test_spawn_point_off_all_lanes_is_a_remark() -> None:
    roads = built_in("roundabout").roads
    placed = place_on_roads(read({"DataID": 90100001}, {"pos": {"x": 900, "y": 900}}), roads)
    assert placed.spawn_points == ()
    assert placed.notes == tuple(f"spawnPointList[{i}]: it is on no lane; no vehicle appears there" for i in (0, 1))


@pytest.mark.parametrize(
    ("keys", "meant", "num_remarks"),
    [
        ({}, (True, (0.0, 0.0)), 0),
        (
            {"isLaneChange": "False", "latBiasMode": 2, "MinLatBias": "0.25", "MaxLatBias": -0.5},
            (False, (-0.5, 0.25)),
            0,
        ),
        ({"latBiasMode": 1, "MinLatBias": 0.5, "MaxLatBias": 0.25}, (True, (0.375, 0.375)), 0),
        ({"latBiasMode": "2", "MaxLatBias": 0.5}, (True, (0.0, 0.5)), 0),
        ({"latBiasMode": {}, "MinLatBias": [1], "MaxLatBias": 1e300}, (True, (0.0, 0.0)), 2),
    ],
)
def test_lane_change_and_offsets_of_a_spawn_point(
    keys: dict[str, Any], meant: tuple[bool, tuple[float, float]], num_remarks: int
) -> None:
    scenario = read({**POINT, **keys})
    (point,) = scenario.spawn_points
    assert (point.changes_lanes, point.lateral) == meant
    assert len([note for note in scenario.notes if "LatBias" in note]) == num_remarks


def test_vehicles_of_a_spawn_point_have_offsets_between_its_bounds() -> None:
    keys = {"isLaneChange": False, "latBiasMode": 2, "MinLatBias": 0.1, "MaxLatBias": 0.5}
    node = simulate(read(*[{**POINT, **keys, "startLinkInfo": {"linkIdx": link}} for link in ("WB", "NB", "EB", "SB")]))
    run(node, 1.5)
    world = node.context.world
    rows = world.rows(Kind.VEHICLE)
    offsets = world.lateral[rows]
    assert len(set(offsets.tolist())) == len(rows) >= 3
    assert (np.abs(offsets - 0.3) < 0.2).all()
    assert (world.keeps_lane[rows] == 1.0).all()


@pytest.mark.parametrize(
    ("key", "value"),
    [("minSpawnPeriod", -1), ("maximumSpawnVehicle", "many"), ("SafetyDist", -2), ("modelName", "Moon")],
)
def test_wrong_value_of_a_spawn_point_is_refused(key: str, value: JsonValue) -> None:
    with pytest.raises(DocumentError, match=rf"spawnPointList\[0\]\.{key}"):
        read({**POINT, key: value})


# --traffic


def test_traffic_fills_the_lanes_and_tells_how_many_fit(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "rosbridge_sim.morai"):
        node = simulate(read(), traffic=10)
        full = simulate(read(), traffic=5000)
    lines = [line for line in caplog.messages if line.startswith("traffic: ")]
    num = len(vehicles(full))
    assert lines == [
        "traffic: 10 of 10 fit on the lanes of roundabout",
        f"traffic: {num} of 5000 fit on the lanes of roundabout",
    ]
    assert len(vehicles(node)) == 10
    assert 30 < num < 200
    world = full.context.world
    assert world.has_lane[world.rows(Kind.VEHICLE)].all()
    run(full, 4.0)
    assert np.count_nonzero(world.speed[world.rows(Kind.VEHICLE)] > 1.0) > num / 3


@pytest.mark.parametrize("wanders", [True, False])
def test_traffic_wanders_within_its_lanes_unless_switched_off(wanders: bool) -> None:  # noqa: FBT001 - a parameter
    node = simulate(read(), traffic=5, wanders=wanders)
    run(node, 2.0)
    world = node.context.world
    rows = world.rows(Kind.VEHICLE)
    assert (world.wander[rows] != 0.0).all() == wanders
    assert (world.wander_width[rows] == (0.15 if wanders else 0.0)).all()


def test_no_traffic_appears_in_bays() -> None:
    node = simulate(read(map_name="parking"), traffic=100)
    world = node.context.world
    lanes = {world.roads.ids[lane] for lane in world.lane[world.rows(Kind.VEHICLE)].tolist()}
    assert lanes
    assert not any(name.startswith("B") for name in lanes)


@pytest.mark.slow
def test_vehicle_of_the_traffic_that_has_gone_is_replaced() -> None:
    node = simulate(read(), traffic=12)
    for uid in vehicles(node)[:4]:
        node.context.scene.remove(uid)
    run(node, 15.0)
    assert len(vehicles(node)) >= 10
    run(node, 15.0)
    assert len(vehicles(node)) == 12


def test_traffic_fills_each_scene_that_is_loaded() -> None:
    node = simulate(read(), traffic=12)
    scene = node.context.scene
    before = vehicles(node)
    whole = scene.prepare(read(), WHOLE)
    node.context.scene_changes.carry_out(whole, is_pausing=False, now=0.0)
    assert len(vehicles(node)) == 12
    assert not set(before) & set(vehicles(node))


def test_state_of_the_traffic_is_checked() -> None:
    node = simulate(read(POINT))
    (traffic,) = (one for one in node.components if isinstance(one, Traffic))
    good = traffic.save_state()
    assert isinstance(good, tuple)
    owner = np.array([[3, 5]], dtype=np.int64)
    for bad in (None, good[:3], (*good[:3], owner), (good[0] - 1000, *good[1:]), (good[0].astype(float), *good[1:])):
        with pytest.raises(ValueError, match="expected"):
            traffic.load_state(bad, 0.0)
    traffic.load_state(good, 0.0)


def test_spawn_points_and_their_state_survive_as_bytes() -> None:
    wide = {key: value for key, value in POINT.items() if "Velocity" not in key}  # at the speed limits, which are inf
    node = simulate(read(POINT, wide))
    run(node, 2.0)
    load = node.context.scene.loaded
    packed = tuple(load.packed)
    again = saved_loads.unpack_load(packed, lambda _key: load.road_map)
    assert again is not load
    assert again.spawn_points == load.spawn_points
    (traffic,) = (one for one in node.components if isinstance(one, Traffic))
    traffic.load_state(decode(encode(traffic.save_state()), max_values=1000), 0.0)
    assert len(vehicles(node)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("traffic", [0, 3])
def test_spawn_points_end_with_their_map_though_a_load_removes_nothing(traffic: int) -> None:
    node = simulate(read(POINT), traffic=traffic)
    scene = node.context.scene
    keeping = replace(WHOLE, delete_all=False)
    for map_name, num_points in (("roundabout", 1), ("loop", 0), ("roundabout", 0)):
        run(node, 1.0)
        load = scene.prepare(read(map_name=map_name), keeping)
        node.context.scene_changes.carry_out(load, is_pausing=False, now=0.0)
        assert len(scene.loaded.spawn_points) == num_points
        for _ in range(150):
            node.context.stepper.compute(0.0, is_tick=True, is_last=True)
        (traffic_of_node,) = (one for one in node.components if isinstance(one, Traffic))
        traffic_of_node.load_state(traffic_of_node.save_state(), 0.0)


def test_snapshot_with_spawn_points_of_another_map_is_refused() -> None:
    there, here = simulate(read(POINT)), simulate(read(map_name="loop"))
    state = NodeState(there.context, there.components)
    maps = {load.map_key: load.road_map for load in (there.context.scene.loaded, here.context.scene.loaded)}
    plain = NodeState(here.context, here.components).save().to_plain()
    assert isinstance(plain, dict)
    plain["loaded"] = tuple(there.context.scene.loaded.packed)
    with pytest.raises(DocumentError, match="expected spawn points on the map in use"):
        state.parse(plain, maps.__getitem__)


# Many vehicles in a file


def test_more_than_a_thousand_vehicles_need_lanes_that_are_long_enough() -> None:
    car = {"initPosition": {"initPositionMode": "Link", "initLink": "L1_00", "initLinkRatio": 0.5}}
    many = read(map_name="loop", vehicleList=[car] * 1_500)
    assert len(place_on_roads(many, built_in("loop").roads).vehicles) == 1_500  # on 15 km
    car = {"initPosition": {"pos": {"x": 0, "y": 0}}}
    many = read(vehicleList=[car] * 1_001)
    with pytest.raises(DocumentError, match=r"at most 1,000 vehicles on this map, got 1,001.* have 2\.7 km$"):
        place_on_roads(many, built_in("roundabout").roads)
    draft, mistakes = place_draft(many, built_in("roundabout"))
    assert len(mistakes) == 1
    assert len(draft.vehicles) == 1_001


@pytest.mark.slow
def test_rush_hour_fills_the_motorway_from_both_entries() -> None:
    node = simulate(DiskLibrary().scenario("rush_hour"))
    run(node, 32.0)
    world = node.context.world
    rows = world.rows(Kind.VEHICLE)
    assert 12 <= len(rows) <= 22, "one every 3 to 6 s at each of two entries"
    lanes = {world.roads.ids[lane][:2] for lane in world.lane[rows]}
    assert {"S0", "S1", "L3"} <= lanes, "they come in on the service roads and join"
    assert world.speed[rows].mean() > 15.0

"""Events of blocks `rosbridge_sim` in JSON scenarios, as they are told on a small map."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.scene.load import WHOLE
from rosbridge_sim.simulator.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.simulator.snapshots.node_state import NodeState
from rosbridge_sim.simulator.snapshots.saved_loads import unpack_load
from rosbridge_sim.simulator.story.stories import Stories
from rosbridge_sim.world.state.world import World
from tests.simulator.sim_harness import Client, make_store
from tests.simulator.story.story_texts import OneMap

Item = dict[str, Any]


def at_link(link: str, ratio: float) -> Item:
    return {"initPositionMode": "Link", "initLink": link, "initLinkRatio": ratio}


EGO = {"initPosition": at_link("middle", 0.02), "currentVelocity": 72}


def car(block: Item | None, link: str = "right", ratio: float = 0.05, **keys: object) -> Item:
    own = {} if block is None else {"rosbridge_sim": block}
    return {
        "initPosition": at_link(link, ratio),
        "velocityType": 2,
        "desiredVelocity": 50,
        "currentVelocity": 50,
        "isWaypointMode": False,
        **keys,
        **own,
    }


def scene(*cars: Item, map_name: str = "lanes", **parts: object) -> Item:
    return {"mapInfo": {"mapName": map_name}, "egoVehicle": EGO, "vehicleList": list(cars), **parts}


def begin(document: Item) -> SimulatorNode:
    scenario = read_scenario(json.dumps(document).encode(), "mine.json")
    return make_node(Bus(make_store()), World(), OneMap(), scenario, NodeSettings(start="sync"))


def run(node: SimulatorNode, frames: int = 1) -> None:
    """Let frames pass; the ego keeps its speed."""
    world = node.context.world
    for _ in range(frames):
        world.speed[world.row(0)] = 20.0
        node.context.stepper.compute(0.0, is_tick=True, is_last=True)


def away(world: World) -> float:
    return math.hypot(world.x[1] - world.x[0], world.y[1] - world.y[0])


def hashes(node: SimulatorNode, frames: int) -> list[str]:
    state, found = NodeState(node.context, node.components), []
    for _ in range(frames):
        run(node)
        found.append(state.hash())
    return found


CUT_IN = {"events": [{"when": {"ego_within": 25}, "change_lane": "left", "seconds": 2}]}


def test_a_car_changes_lane_when_the_ego_is_near_and_drives_on() -> None:
    node = begin(scene(car(CUT_IN)))
    world = node.context.world
    for _ in range(200):
        assert world.has_lane[1]
        run(node)
        if world.is_ghost[1]:
            break
    assert 24.5 < away(world) <= 25.0  # 6 m/s nearer, looked at each 50 ms
    run(node, 99)
    assert world.is_ghost[1]
    assert -3.5 < world.y[1] < 0.0
    run(node, 2)
    assert (bool(world.is_ghost[1]), bool(world.has_lane[1]), float(world.y[1])) == (False, True, 0.0)
    assert world.roads.ids[world.lane[1]].startswith("middle")
    assert world.speed[1] == pytest.approx(50 / 3.6, abs=0.2)


def test_a_vehicle_drives_on_with_the_speed_that_it_wants() -> None:
    change = {"events": [{"when": {"time": 0.2}, "change_lane": "left", "seconds": 2}]}
    node = begin(scene(car(change, ratio=0.4, currentVelocity=40)))
    world = node.context.world
    run(node, 3 * 50)
    assert not world.is_ghost[1]
    run(node, 4 * 50)
    assert world.speed[1] == pytest.approx(50 / 3.6, abs=0.5)


def test_a_vehicle_keeps_the_speed_of_its_last_event_and_what_its_item_says() -> None:
    events = [
        {"when": {"time": 0.2}, "speed_kmh": 30, "seconds": 1},
        {"when": {"time": 2}, "change_lane": "left", "seconds": 2},
    ]
    node = begin(scene(car({"events": events}, ratio=0.4, isLaneChange=False, latBias=0.5)))
    world = node.context.world
    run(node, 90)
    assert not world.is_ghost[1]
    assert world.y[1] == pytest.approx(-3.0, abs=1e-6)  # 0.5 m to the left of its line, without a jump
    run(node, 120)
    assert not world.is_ghost[1]
    assert abs(world.y[1]) < 0.1  # the change ends on the line, and from there it goes to its offset
    run(node, 8 * 50)
    assert world.y[1] == pytest.approx(0.5, abs=1e-3)
    assert world.speed[1] == pytest.approx(30 / 3.6, abs=0.1)
    assert world.keeps_lane[1]


def test_a_vehicle_follows_the_rest_of_its_route() -> None:
    slow = {"events": [{"when": {"time": 0.2}, "speed_kmh": 40, "seconds": 1}]}
    node = begin(scene(car(slow, link="middle", ratio=0.9, route=["middle", "bend"])))
    run(node, 3 * 50)
    world = node.context.world
    assert not world.is_ghost[1]
    assert world.routes[int(world.uid[1])].tolist() == [1, 3]


def test_lanes_of_vehicles_are_looked_up_only_where_a_trigger_asks_for_them() -> None:
    node = begin(scene(*[car(CUT_IN, ratio=0.3 + 0.01 * i) for i in range(40)]))
    told = node.component(Stories).running
    assert told is not None
    before = told._map.project.cache_info().misses
    run(node, 25)
    assert told._map.project.cache_info().misses == before


def test_the_model_keeps_its_name_and_others_are_moved_by_the_world() -> None:
    cars = [car(None, ratio=0.1, UNIQUEID=40), car(CUT_IN), car(None, ratio=0.2)]
    plain, told = begin(scene(*[{**each, "rosbridge_sim": None} for each in cars])), begin(scene(*cars))
    worlds = plain.context.world, told.context.world
    assert worlds[0].names == worlds[1].names
    assert worlds[0].uid.tolist() == worlds[1].uid.tolist()
    run(told, 165)
    assert worlds[1].y[:4].tolist() == [0.0, -3.5, 0.0, -3.5]


def test_a_scenario_without_events_has_the_hash_that_it_had() -> None:
    plain, block = scene(car(None, activeDistance=30)), scene(car({"start_within": 30}))
    one, other = begin(plain), begin(block)
    assert other.context.scene.loaded.story is None
    assert hashes(one, 5) == hashes(other, 5)
    assert one.context.scene.loaded.packed == other.context.scene.loaded.packed


PLACE = {"link": "middle", "s": 60}


@pytest.mark.parametrize(
    ("when", "low", "high"),
    [
        ({"ego_passes": PLACE}, 56.9, 57.5),
        ({"ego_passes": {**PLACE, "within": 10}}, 49.9, 50.5),
        ({"ego_passes": {"x": 60, "y": 0}}, 56.9, 57.5),
        ({"time": 1}, 39.9, 40.5),
        ({"time": 2, "ego_passes": {**PLACE, "within": 40}}, 59.9, 60.5),
    ],
)
def test_people_things_and_vehicles_wait_for_their_trigger(when: Item, low: float, high: float) -> None:
    block = {"rosbridge_sim": {"start_when": when}}
    node = begin(
        scene(
            car(block["rosbridge_sim"]),
            pedestrianList=[{"pos": {"x": 100, "y": 9}, "speed": 5, **block}],
            objectList=[{"pos": {"x": 100, "y": 20}, "moveSpeed": 5, **block}],
        )
    )
    world = node.context.world
    before = world.x.copy()
    run(node, 5)
    assert "waits for its event" in described(node, 1)["text"]
    for _ in range(150):
        run(node)
        if any(world.x[1:4] != before[1:4]):
            break
    assert low <= world.x[0] <= high + 1.0  # looked at each 50 ms; it moves in the frame after that
    assert all(world.x[1:4] > before[1:4])
    assert not any(world.start_within)


def described(node: SimulatorNode, row: int) -> Item:
    return call(node, "/sim/describe", id=int(node.context.world.uid[row]))


def call(node: SimulatorNode, service: str, **values: object) -> Item:
    answer = Client(node.context.bus, "asker").call(service, values)
    assert isinstance(answer.values, Message)
    found: Item = json.loads(answer.values.json)
    return found


def test_a_vehicle_brakes_at_a_place_and_starts_again() -> None:
    events = [
        {"when": {"passes": {"link": "right", "s": 80}}, "speed_kmh": 0, "seconds": 2},
        {"when": {"time": 5}, "speed_kmh": 36, "seconds": 1},
    ]
    node = begin(scene(car({"events": events})))
    world = node.context.world
    run(node, 240)
    assert 80.0 < world.x[1] < 95.0
    assert world.speed[1] == 0.0
    run(node, 170)
    assert world.speed[1] == pytest.approx(10.0, abs=0.2)


def test_events_at_the_same_time_do_not_end_each_other() -> None:
    events = [
        {"when": {"time": 0.5}, "change_lane": "left", "seconds": 4},
        {"when": {"time": 1}, "speed_kmh": 72, "seconds": 2},
    ]
    node = begin(scene(car({"events": events})))
    world = node.context.world
    run(node, 3 * 50 + 2)
    assert world.speed[1] == pytest.approx(20.0)
    assert -2.0 < world.y[1] < -0.5
    run(node, 75)
    assert world.y[1] == 0.0
    assert world.has_lane[1]


def test_a_light_shows_what_the_block_says() -> None:
    events = [
        {"when": {"time": 0.5}, "light": "light", "state": "red"},
        {"when": {"time": 1}, "light": "light", "state": "green"},
    ]
    node = begin(scene(rosbridge_sim={"events": events}))
    signals = node.context.world.signals
    run(node, 26)
    assert signals.shown[0] == 1
    run(node, 26)
    assert signals.shown[0] == 16


@pytest.mark.parametrize("frames", [5, 60, 130])
def test_a_restored_scenario_goes_on_to_the_bit(frames: int) -> None:
    document = scene(car(CUT_IN), car({"start_when": {"time": 2}}, ratio=0.8))
    one, other = begin(document), begin(document)
    run(one, frames)
    state = NodeState(one.context, one.components)
    saved = state.save()
    plain = saved.to_plain()
    there = NodeState(other.context, other.components)
    parsed = there.parse(plain, lambda _: other.context.scene.road_map)
    there.restore(parsed, 0.0, expected_hash=state.hash(), before_undo=lambda: None)
    expected = hashes(one, 15)
    assert hashes(other, 15) == expected
    state.restore(saved, 0.0, before_undo=lambda: None)
    assert hashes(one, 15) == expected
    assert len(set(expected)) == 15


def test_a_load_keeps_its_blocks_as_text() -> None:
    load = begin(scene(car(CUT_IN))).context.scene.loaded
    again = unpack_load(tuple(load.packed), lambda _: load.road_map)
    assert again.story is not load.story
    assert again.packed == load.packed


def test_a_reset_and_another_load_begin_the_events_again() -> None:
    node = begin(scene(car(CUT_IN)))
    first = hashes(node, 20)
    node.context.scene_changes.reset(None, 0.0)
    assert hashes(node, 20) == first
    context = node.context
    again = read_scenario(json.dumps(scene(car(None), car(CUT_IN))).encode(), "mine.json")
    context.scene_changes.carry_out(context.scene.prepare(again, WHOLE), is_pausing=False, now=0.0)
    run(node, 165)
    world = context.world
    assert [float(world.y[row]) == 0.0 for row in world.placed()] == [True, False, True]


def test_the_story_topic_names_events_by_their_places() -> None:
    node = begin(scene(car(CUT_IN)))
    run(node)
    story = call(node, "/sim/story")["story"]
    names = {each["name"] for each in story["elements"] if each["kind"] == "Event"}
    assert names == {"vehicleList[0].rosbridge_sim.events[0]"}
    assert [each["name"] for each in story["conditions"]] == ["ego_within 25 m"]
    assert story["entities"] == ["egoVehicle", "vehicleList[0]"]


@pytest.mark.parametrize(
    ("document", "text"),
    [
        (
            scene(car({"events": [{"when": {"passes": {"link": "L9"}}, "speed_kmh": 1}]})),
            r"mine.json: vehicleList\[0\].rosbridge_sim.events\[0\].when.passes: LinkPosition: the map has no link",
        ),
        (
            scene(car({"start_when": {"ego_passes": {"link": "middle", "s": 9e3}}})),
            r"start_when.ego_passes: LinkPosition: s: expected 0",
        ),
        (
            scene(rosbridge_sim={"events": [{"when": {"time": 1}, "light": "TL7", "state": "red"}]}),
            r"mine.json: rosbridge_sim.events\[0\].light: the map has no light 'TL7'",
        ),
    ],
)
def test_places_and_lights_that_the_map_lacks_are_refused(document: Item, text: str) -> None:
    with pytest.raises(DocumentError, match=text):
        begin(document)


def test_events_are_loaded_whole() -> None:
    node = begin(scene(car(None)))
    again = read_scenario(json.dumps(scene(car(CUT_IN))).encode(), "mine.json")
    with pytest.raises(DocumentError, match="a story is loaded whole"):
        node.context.scene.prepare(again, replace(WHOLE, pedestrians=False))


def test_a_lane_that_is_not_there_ends_the_event_and_the_driver_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    node = begin(scene(car({"events": [{"when": {"time": 0}, "change_lane": "left"}]}, link="left")))
    run(node, 5)
    assert node.context.world.has_lane[1]
    assert "vehicleList[0].rosbridge_sim.events[0]: LaneChangeAction" in caplog.text


def test_a_vehicle_that_is_gone_ends_nothing() -> None:
    node = begin(scene(car(CUT_IN), car(None)))
    node.context.world.remove(int(node.context.world.uid[1]))
    run(node, 20)
    assert len(node.context.world) == 2

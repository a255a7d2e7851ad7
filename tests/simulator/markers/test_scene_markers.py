"""`/sim/scene/map` and `/sim/scene/objects`: the markers of the scene, and when they are made and deleted."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.simulator.markers import map_markers, scene_markers
from rosbridge_sim.simulator.markers.map_markers import MAX_MAP_POINTS, make_map_markers
from rosbridge_sim.simulator.markers.markers import MarkerMaker, MarkerShape
from rosbridge_sim.simulator.scene.load import WHOLE
from rosbridge_sim.world.geometry.planar import rotate
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.placement import place_ghost
from tests.simulator.sim_harness import ALL, Client, ManualReader, SimHarness, make_store, put_egos
from tests.simulator.small_maps import ROADRUNNER, read

MAP, OBJECTS = "/sim/scene/map", "/sim/scene/objects"
DELETE, DELETE_ALL = 2, 3


def in_sync(scenario: str = "crossing", **settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings'
    harness = SimHarness(scenario, start="sync", **settings)
    client = harness.client()
    client.start(time_step=100)  # a message each tick
    return harness, client


def load(client: Client, scenario: str) -> None:
    assert client.call("/Service_MoraiSL", {"request": {"file_name": scenario, **ALL}}).is_ok


def set_lights(harness: SimHarness, client: Client, status: int) -> None:
    for light in harness.world.signals.plan.lights:
        fields = {"trafficLightIndex": light.name, "trafficLightStatus": status}
        client.send("/SetTrafficLight", "morai_msgs/SetTrafficLight", **fields)


def marker(message: dict[str, Any], ns: str, number: int = 0) -> dict[str, Any]:
    (found,) = [one for one in message["markers"] if (one["ns"], one["id"]) == (ns, number)]
    assert isinstance(found, dict)
    return found


def names(message: dict[str, Any]) -> list[str]:
    return sorted(f"{one['ns']} {one['id']}" for one in message["markers"] if one["action"] == 0)


def deleted(message: dict[str, Any]) -> list[str]:
    return [f"{one['ns']} {one['id']}" for one in message["markers"] if one["action"] == DELETE]


def is_cleared(message: dict[str, Any]) -> bool:
    return bool(message["markers"][0]["action"] == DELETE_ALL)


def last(client: Client) -> dict[str, Any]:
    return client.messages(OBJECTS)[-1]


# Objects


def test_objects_have_bodies_of_their_kind_labels_and_ego_arrow() -> None:
    harness, client = in_sync("crowd")
    client.listen(OBJECTS)
    client.tick()
    message = last(client)
    assert [name for name in names(message) if "labels" not in name] == sorted(
        ["ego_arrows 0", "egos 0", "obstacles 3", "obstacles 4", "pedestrians 9", "vehicles 7", "vehicles 10"]
    )
    assert {one["header"]["frame_id"] for one in message["markers"]} == {"map"}
    body, world, row = marker(message, "vehicles", 7), harness.world, harness.world.row(7)
    assert body["type"] == MarkerShape.CUBE
    assert body["scale"] == {"x": 2 * world.half_length[row], "y": 2 * world.half_width[row], "z": world.height[row]}
    assert body["pose"]["position"]["z"] == pytest.approx(world.z[row] + world.height[row] / 2)
    assert body["pose"]["position"]["x"] == pytest.approx(world.x[row] + world.centre[row] * math.cos(world.yaw[row]))
    assert marker(message, "pedestrians", 9)["type"] == MarkerShape.CYLINDER
    assert marker(message, "vehicles_labels", 7)["text"] == "7  36 km/h"
    assert marker(message, "egos_labels")["text"] == "ego 0  0 km/h"
    assert marker(message, "obstacles_labels", 3)["text"] == "3"
    tail, tip = marker(message, "ego_arrows")["points"]
    assert (tip["y"] - tail["y"], tip["x"] - tail["x"]) == (pytest.approx(1.5), pytest.approx(0.0, abs=2e-3))


def test_pose_of_a_body_follows_roll_and_pitch() -> None:
    harness, client = in_sync("crowd")
    row = harness.world.row(7)
    place_ghost(harness.world, row, x=1.0, y=2.0, z=30.0, yaw=0.4, roll=0.1, pitch=-0.3, speed=0.0)
    client.listen(OBJECTS)
    client.tick()
    pose = marker(last(client), "vehicles", 7)["pose"]
    axes = tuple(pose["orientation"][axis] for axis in "xyzw")
    assert len(axes) == 4
    ahead = rotate(axes, (1.0, 0.0, 0.0))
    assert ahead[2] == pytest.approx(math.sin(0.3)), "the nose is up"
    up = rotate(axes, (harness.world.centre[row], 0.0, harness.world.height[row] / 2))
    expected = np.add((1.0, 2.0, 30.0), up)
    assert [pose["position"][axis] for axis in "xyz"] == pytest.approx(expected.tolist())


def test_objects_come_ten_times_a_second_of_simulated_time() -> None:
    harness = SimHarness("crowd")
    client = harness.client()
    client.listen(OBJECTS)
    harness.run(1.001)
    assert [message["markers"][0]["header"]["seq"] for message in client.messages(OBJECTS)] == list(range(5, 51, 5))


def test_marker_of_what_has_gone_is_deleted_for_a_second() -> None:
    _, client = in_sync("crowd")
    client.listen(OBJECTS)
    for _ in range(11):
        client.tick()
    assert is_cleared(client.messages(OBJECTS)[9])
    assert not is_cleared(last(client)), "viewers are cleared for a second"
    client.call("/sim/remove", {"unique_ids": [7]})
    for _ in range(10):
        client.tick()
        assert deleted(last(client)) == ["vehicles 7", "vehicles_labels 7"]
        assert "vehicles 7" not in names(last(client))
    client.tick()
    assert deleted(last(client)) == []


@pytest.mark.parametrize("change", ["load", "reset", "restore"])
def test_new_scene_deletes_all_markers_first(change: str) -> None:
    _, client = in_sync("crowd")
    client.listen(OBJECTS)
    client.call("/sim/snapshot", {"id": "a"})
    for _ in range(11):
        client.tick()
    if change == "load":
        load(client, "parked")
    elif change == "reset":
        assert client.call("/sim/reset", {}).is_ok
    else:
        assert client.call("/sim/restore", {"id": "a", "user_id": "me"}).is_ok
    client.tick()
    assert is_cleared(last(client))
    assert ("vehicles 7" in names(last(client))) is (change != "load")


def test_further_egos_have_bodies_of_their_number() -> None:
    harness, client = in_sync("crowd")
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    client.listen(OBJECTS)
    client.tick()
    assert {"egos 0", "egos 2", "ego_arrows 2", "egos_labels 2"} <= set(names(last(client)))
    assert len(harness.node.egos) == 2


def test_bodies_labels_and_lamps_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_markers, "MAX_BODIES", 3)
    monkeypatch.setattr(scene_markers, "MAX_LABELS", 2)
    _, client = in_sync("crowd")
    client.listen(OBJECTS)
    client.tick()
    assert names(last(client)) == [
        *("ego_arrows 0", "egos 0", "egos_labels 0", "obstacles 3", "obstacles 4", "obstacles_labels 4")
    ], "the nearest to the ego"
    monkeypatch.setattr(scene_markers, "MAX_LAMPS", 1)
    _, client = in_sync()
    client.listen(OBJECTS)
    client.tick()
    assert len(marker(last(client), "lights")["points"]) <= 3, "the lamps of one light"


def test_lights_have_the_colours_of_now() -> None:
    harness, client = in_sync()
    client.listen(OBJECTS)
    plan = harness.world.signals.plan
    for light in plan.lights:
        client.send(
            "/SetTrafficLight", "morai_msgs/SetTrafficLight", trafficLightIndex=light.name, trafficLightStatus=1
        )
    client.tick()
    red = marker(last(client), "lights")
    assert len(red["points"]) == len(red["colors"]) == len(plan.lights)
    assert all(colour["r"] > 0.9 and colour["g"] < 0.2 for colour in red["colors"])
    set_lights(harness, client, 1 + 4)
    client.tick()
    assert len(marker(last(client), "lights")["points"]) == 2 * len(plan.lights), "two lamps of each are lit"


def test_scene_is_made_only_for_those_who_ask_for_it() -> None:
    harness, client = in_sync()
    heard: list[Topic] = []

    def hear(topic: Topic, _message: Message, _sender: Participant, _now: float) -> None:
        heard.append(topic)

    for name in (MAP, OBJECTS):
        harness.bus.subscribe(harness.client(), name, hear, is_general=True)
    client.tick()
    assert heard == []
    client.listen(OBJECTS, MAP)
    client.tick()
    assert {topic.name for topic in heard} == {MAP, OBJECTS}


def test_objects_are_shown_in_a_pause() -> None:
    harness = SimHarness("crowd")
    client = harness.client()
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    client.now = harness.now
    client.listen(OBJECTS)
    harness.run(2.5)
    assert len(client.messages(OBJECTS)) == 3


# Map


def test_map_comes_to_the_first_subscriber_and_is_kept_for_the_next() -> None:
    harness, client = in_sync()
    topic = harness.bus.find_topic(MAP)
    assert topic is not None
    assert topic.latched == []
    client.listen(MAP)
    (message,) = client.messages(MAP)
    assert is_cleared(message)
    assert {one["ns"] for one in message["markers"]} == {"", "lanes", "borders", "stop_lines", "posts"} | (
        {"crosswalks"} if harness.node.context.scene.road_map.crosswalks else set()
    )
    assert {(one["header"]["stamp"]["secs"], one["header"]["frame_id"]) for one in message["markers"]} == {(0, "map")}
    assert [held.json for held in topic.latched] == [client.raw[0].partition(b" ")[2]]
    harness.client().listen(MAP)
    client.tick()
    assert len(client.messages(MAP)) == 1, "the second subscriber gets the latched message"


def test_map_is_sent_anew_after_a_load_of_another_map_and_forgotten_without_subscribers() -> None:
    harness, client = in_sync()
    client.listen(MAP)
    load(client, "elsewhere")
    _, message = client.messages(MAP)
    assert is_cleared(message)
    lanes = marker(message, "lanes")
    assert max(point["z"] for point in lanes["points"]) == 10.0, "points have the height of the road"
    client.leave()
    other = harness.client()
    load(other, "crossing")
    topic = harness.bus.find_topic(MAP)
    assert topic is not None
    assert topic.latched == []
    other.listen(MAP)
    assert len(other.messages(MAP)) == 1


def test_map_made_too_late_is_dropped_for_the_one_in_use() -> None:
    reader = ManualReader()
    harness = SimHarness("crossing", reader=reader)
    client = harness.client()
    client.listen(MAP)
    assert len(reader.waiting) == 1
    scene = harness.node.context.scene
    elsewhere = scene.prepare(harness.shelf.scenario("elsewhere"), WHOLE)
    harness.node.context.scene_changes.carry_out(elsewhere, is_pausing=False, now=1.0)
    assert len(reader.waiting) == 2
    reader.hand_over()
    assert client.messages(MAP) == []
    reader.hand_over()
    assert len(client.messages(MAP)) == 1


def roads_of(lines: list[list[tuple[float, float, float]]]) -> Roads:
    n = len(lines)
    return Roads([f"L{i}" for i in range(n)], [np.array(line) for line in lines], [[]] * n, [3.5] * n, [10.0] * n)


def map_of(roads: Roads) -> RoadMap:
    return RoadMap("made", Projection(is_tm=False, zone=52), (0.0, 0.0, 0.0), roads)


def markers_of(road_map: RoadMap) -> list[Any]:
    make = MarkerMaker(make_store())
    header = make_store().message("std_msgs/Header").struct_type()
    return make_map_markers(make, header, road_map)


def test_straight_lane_needs_two_triangles_and_a_bend_more() -> None:
    straight = [(float(x), 0.0, 0.0) for x in range(101)]
    bend = [(30.0 * math.sin(a / 100), 50.0 - 30.0 * math.cos(a / 100), 0.0) for a in range(158)]
    counts = []
    for line in (straight, bend):
        (lanes,) = [one for one in markers_of(map_of(roads_of([line]))) if one.ns == "lanes"]
        counts.append(len(lanes.points))
    assert counts[0] == 6
    assert 60 < counts[1] < 200
    radii = [math.hypot(point.x, point.y - 50.0) for point in lanes.points]
    assert {round(radius, 1) for radius in radii} <= {28.2, 28.3, 31.7, 31.8}


@pytest.mark.parametrize("num_lanes", [2_000, 40_000])
def test_map_of_any_size_stays_within_the_bound(num_lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_markers, "MAX_MAP_POINTS", 6_000)
    lines = [[(0.0, float(i), 0.0), (10.0 + i % 7, float(i), 1.0)] for i in range(num_lanes // 10)]
    markers = markers_of(map_of(roads_of(lines)))
    num = sum(len(one.points) for one in markers)
    assert 0 < num <= 6_000 < MAX_MAP_POINTS


def test_map_without_lanes_is_an_empty_scene() -> None:
    assert [one.action for one in markers_of(map_of(Roads()))] == [DELETE_ALL]


@pytest.mark.parametrize("ros", [1, 2])
def test_markers_have_the_form_of_the_ros_generation(ros: int) -> None:
    store = Store(read_definitions("22.R2"), ros=ros)  # type: ignore[arg-type]  # 1 or 2
    make = MarkerMaker(store)
    header = store.message("std_msgs/Header").struct_type()
    made = make.array(make_map_markers(make, header, read(ROADRUNNER)))
    message = Message(store.message("visualization_msgs/MarkerArray"), made)
    assert message.json
    assert message.raw

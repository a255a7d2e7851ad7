"""`/sim/scene/state`: what it says of entities and lights, and when it goes out."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any

import cbor2
import numpy as np
import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.scenery.moving.moving_mesh import MovingScene
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.sim_services.scene_state import _looks_of
from rosbridge_sim.world.state import placement
from tests.simulator.sim_harness import ALL, Client, SimHarness, put_egos

STATE, VIEW = "/sim/scene/state", "/sim/scene/view"
SIZES = ("length", "width", "height", "center_x")


def in_sync(scenario: str = "crowd", **settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings'
    harness = SimHarness(scenario, start="sync", **settings)
    client = harness.client()
    client.start()
    return harness, client


def last(client: Client) -> dict[str, Any]:
    return client.messages(STATE)[-1]


def octets(column: str) -> list[int]:
    return list(base64.b64decode(column))


def spawn(client: Client, *objects: dict[str, object]) -> list[int]:
    answer = client.call("/sim/spawn", {"objects": list(objects)})
    assert isinstance(answer.values, Message), answer
    values: Any = answer.values.value
    assert values.result, values.message
    ids: Sequence[int] = values.unique_ids
    return list(ids)


def test_message_has_every_entity_of_the_frame_in_columns() -> None:
    harness, client = in_sync()
    client.listen(STATE)
    client.tick()
    state, world = last(client), harness.world
    assert (state["frame"], state["header"]["seq"], state["header"]["frame_id"]) == (1, 1, "map")
    assert state["scenario"] == "crowd"
    assert state["map_digest"] == client.call("/sim/map", {"page": 0}).values.value.digest  # type: ignore[attr-defined]
    rows = list(world.placed())
    assert state["id"] == world.uid[rows].tolist()
    assert octets(state["kind"]) == world.kind[rows].tolist() == [0, 1, 1, 2, 3, 3]
    assert (state["x"], state["y"]) == (world.x[rows].tolist(), world.y[rows].tolist())
    for field, column in {
        "z": "z",
        "heading": "yaw",
        "speed": "speed",
        "height": "height",
        "center_x": "centre",
    }.items():
        assert state[field] == pytest.approx(getattr(world, column)[rows].tolist(), abs=1e-6), field
    assert state["length"] == pytest.approx([world.bodies[row].length for row in rows])
    assert state["width"] == pytest.approx([world.bodies[row].width for row in rows])
    assert octets(state["flags"]) == [0] * 6


def test_bodies_have_the_shapes_and_colours_that_cameras_see() -> None:
    harness, client = in_sync()
    client.listen(STATE)
    client.tick()
    state, frame = last(client), take_frame(harness.world)
    assert octets(state["shape"]) == frame.shapes.tolist() == [0, 0, 0, 6, 7, 7]
    seen = MovingScene().mesh(frame, np.zeros(3))
    for row, paint in enumerate(state["paint"]):
        colour = (paint >> 16, paint >> 8 & 255, paint & 255)
        own = seen.colour[seen.instance == frame.ids[row] + 1]
        assert (own == colour).all(axis=1).any(), f"row {row} has no {colour}"
    assert state["paint"][0] == 24 << 16 | 78 << 8 | 160  # the ego's blue


def test_cbor_has_typed_arrays_of_the_same_numbers() -> None:
    harness, client = in_sync("crossing")
    found: list[Message] = []

    def hear(_topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        found.append(message)

    harness.bus.subscribe(client, STATE, hear)
    client.tick()
    value = cbor2.loads(found[0].cbor)
    ids, x, heading, state = value["id"], value["x"], value["heading"], value["light_state"]
    assert [item.tag for item in (ids, x, heading, state)] == [70, 86, 85, 77]
    assert np.frombuffer(x.value, "<f8").tolist() == harness.world.x[: harness.world.n].tolist()
    assert value["kind"] == bytes([0, 1, 1])
    assert len(found[0].raw) > 0


def test_further_ego_has_its_number_and_lamps_show_what_drivers_do() -> None:
    harness, client = in_sync()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    client.listen(STATE)
    client.control(0, longlCmdType=1, brake=0.5)
    ego = harness.node.egos[1]
    ego.turn_signal = 2
    client.tick()
    state = last(client)
    assert state["id"][-1] == 5
    assert (octets(state["lamps"])[0], octets(state["lamps"])[-1]) == (4, 2)
    ego.emergency_signal = 1
    harness.world.speed[1] = -1.0
    harness.world.signal[2] = 1.0  # as a driver that changes lanes
    client.tick()
    lamps = octets(last(client)["lamps"])
    assert (lamps[1], lamps[2], lamps[-1]) == (8, 1, 3)


def test_entities_that_touch_are_flagged() -> None:
    harness, client = in_sync()
    client.listen(STATE)
    world = harness.world
    placement.teleport(world, 1, x=float(world.x[2]) - 1.0, y=float(world.y[2]), z=0.0, yaw=0.0, speed=0.0)
    client.tick()
    assert octets(last(client)["flags"]) == [0, 1, 1, 0, 0, 0]


def test_lights_have_their_state_and_the_time_that_is_left() -> None:
    harness, client = in_sync("crossing")
    client.listen(STATE)
    client.tick()
    first = last(client)
    signals = harness.world.signals
    assert first["light_state"] == signals.shown.tolist()
    assert len(first["light_time_left"]) == len(signals.plan.lights) > 0
    client.tick()
    for before, after in zip(first["light_time_left"], last(client)["light_time_left"], strict=True):
        assert before == after == -1.0 or before - after == pytest.approx(0.02, abs=1e-5)
    name = signals.plan.lights[0].name
    client.send("/SetTrafficLight", "morai_msgs/SetTrafficLight", trafficLightIndex=name, trafficLightStatus=4)
    client.tick()
    assert last(client)["light_state"][0] == 4


def test_new_subscriber_sees_the_scene_at_once_while_the_world_waits_for_ticks() -> None:
    harness, client = in_sync()
    client.tick()
    viewer, other = harness.client(), harness.client()
    viewer.listen(STATE)
    harness.run(0.0)
    assert [message["frame"] for message in viewer.messages(STATE)] == [1]
    other.listen(STATE)
    harness.run(5.0)
    assert [len(one.messages(STATE)) for one in (viewer, other)] == [1, 1]
    client.tick()
    harness.run(5.0)
    assert [message["frame"] for message in viewer.messages(STATE)] == [1, 2]


def test_new_subscriber_sees_the_scene_in_a_pause_and_before_the_first_master() -> None:
    paused = SimHarness()
    paused.run(0.1)
    paused.client().ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    for harness in (paused, SimHarness(start="sync")):
        viewer = harness.client()
        viewer.listen(STATE)
        harness.run(3.0)
        assert len(viewer.messages(STATE)) == 1


def test_changes_between_two_frames_are_seen_at_once() -> None:
    harness, client = in_sync()
    client.listen(STATE)
    harness.run(0.0)
    (new,) = spawn(client, {"model": "Pedestrian", "place": {"x": 3.0, "y": 4.0}})
    harness.run(0.0)
    assert last(client)["id"][-1] == new
    client.call("/sim/remove", {"unique_ids": [new]})
    harness.run(0.0)
    assert new not in last(client)["id"]
    client.call("/sim/set", {"objects": [{"unique_id": 0, "set_lamps": True, "turn_signal": 1}]})
    harness.run(0.0)
    assert octets(last(client)["lamps"])[0] & 1
    client.send("/ScenarioLoad", "morai_msgs/ScenarioLoad", file_name="crossing", **ALL)
    harness.run(0.0)
    assert last(client)["scenario"] == "crossing"
    num = len(client.messages(STATE))
    harness.run(3.0)
    assert len(client.messages(STATE)) == num


def test_recordings_get_frames_alone_and_nothing_is_made_without_a_subscriber() -> None:
    harness, client = in_sync()
    found: list[Message] = []

    def hear(_topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        found.append(message)

    harness.bus.subscribe(harness.client(), STATE, hear, is_recording=True)
    assert harness.node.next_due(harness.now) is None
    client.tick()
    assert len(found) == 1
    assert harness.node.next_due(harness.now) is None


def test_real_time_sends_the_scene_with_each_frame() -> None:
    harness = SimHarness()
    viewer = harness.client()
    viewer.listen(STATE)
    harness.run(0.1)
    assert [message["frame"] for message in viewer.messages(STATE)] == [1, 2, 3, 4, 5]


def test_empty_scene_without_lanes_and_lights_is_sent_too() -> None:
    _, client = in_sync("empty")
    client.listen(STATE)
    client.tick()
    assert last(client)["id"] == [0]
    assert (last(client)["light_state"], last(client)["light_time_left"]) == ([], [])


def test_reset_and_restore_show_the_scene_that_they_lead_to() -> None:
    harness, client = in_sync()
    client.listen(STATE)
    client.tick()
    client.call("/sim/reset", {"seed": -1})
    harness.run(0.0)
    assert last(client)["frame"] == 0
    assert all(map(math.isfinite, last(client)["x"]))


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_both_releases_have_the_topic(release: str) -> None:
    harness, client = in_sync("crossing", release=release)
    client.listen(STATE)
    client.tick()
    assert len(last(client)["id"]) == len(harness.world)


def test_viewer_steps_a_paused_world_frame_by_frame_and_sees_each() -> None:
    harness = SimHarness()
    viewer = harness.client()
    viewer.listen(STATE)
    harness.run(0.1)
    viewer.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    harness.run(1.0)
    viewer.heard.clear()
    viewer.start("viewer")
    viewer.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    harness.run(1.0)
    assert viewer.messages(STATE) == []
    for _ in range(2):
        assert viewer.call("/sim/step", {"user_id": "viewer", "n": 1}).is_ok
        harness.run(1.0)
    assert [message["frame"] for message in viewer.messages(STATE)] == [6, 7]


def test_view_is_the_state_rounded() -> None:
    harness, client = in_sync("crossing")
    world = harness.world
    world.speed[1] = -3.456
    client.listen(STATE)
    client.listen(VIEW)
    client.tick()
    state, view = last(client), client.messages(VIEW)[-1]
    for name in ("header", "frame", "map_digest", "scenario", "id", "kind", "light_state"):
        assert view[name] == state[name], name
    places = [view["origin_x"] + x for x in view["x"]], [view["origin_y"] + y for y in view["y"]]
    assert places[0] == pytest.approx(state["x"], abs=1e-4)
    assert places[1] == pytest.approx(state["y"], abs=1e-4)
    turns = [(a * 1e-4 - b) / (2 * math.pi) for a, b in zip(view["heading"], state["heading"], strict=True)]
    assert turns == pytest.approx([round(turn) for turn in turns], abs=1e-5)
    assert [0.01 * speed for speed in view["speed"]] == pytest.approx(state["speed"], abs=0.006)
    size, paint = np.divmod(view["look"], len(view["paints"]))
    sizes = np.reshape(view["sizes"], (-1, 4))[size]
    assert np.array(octets(view["shapes"]))[size].tolist() == octets(state["shape"])
    assert np.array(view["paints"])[paint].tolist() == state["paint"]
    assert sizes.tolist() == np.column_stack([state[name] for name in SIZES]).tolist()
    assert len(view["sizes"]) < 4 * len(view["id"]) + 1
    left = [-1.0 if tenths == 65_535 else 0.1 * tenths for tenths in view["light_time_left"]]
    assert left == pytest.approx(state["light_time_left"], abs=0.1)
    assert (view["z"], view["roll"], view["flags"]) == ([], [], "")


def test_view_is_made_only_for_those_who_ask_for_it() -> None:
    harness, client = in_sync("crossing")
    heard: list[str] = []

    def hear(topic: Topic, _message: Message, _sender: Participant, _now: float) -> None:
        heard.append(topic.name)

    harness.bus.subscribe(harness.client(), VIEW, hear, is_general=True)
    harness.run(0.0)  # shows the scene as it stands to new viewers
    client.tick()
    harness.run(0.0)
    assert heard == [], "a recording has the same in /sim/scene/state"
    client.listen(VIEW)
    harness.run(0.0)
    assert client.messages(VIEW), "the scene as it stands"
    client.tick()
    assert heard


def test_view_takes_less_than_half_of_the_bytes() -> None:
    harness, client = in_sync("crossing")
    cars: list[dict[str, object]] = [
        {"model": "2015_Kia_K5", "place": {"x": 50.0 + 8.0 * i, "y": 90.0}} for i in range(100)
    ]
    spawn(client, *cars)
    found: dict[str, Message] = {}

    def hear(topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        found[topic.name] = message

    for name in (STATE, VIEW):
        harness.bus.subscribe(client, name, hear)
    client.tick()
    assert len(found[VIEW].cbor) < 0.5 * len(found[STATE].cbor)


def test_entities_with_too_many_looks_share_a_paint() -> None:
    count = 300
    sizes = [np.arange(count, dtype=np.float32)] * 4
    looks = _looks_of(sizes, np.zeros(count, np.uint8), np.arange(count, dtype=np.uint32))
    assert looks[0].tolist() == list(range(count))
    assert looks[3].tolist() == [0]

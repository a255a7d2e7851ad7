"""ReplayInfo of the simulator: its values, its subscribers, and a recording of it alone."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import FILE, INFO, NUM_FRAMES, PLAY, STOP, ego_values, replay, steer_frames
from tests.simulator.sim_harness import Client, SimHarness


def test_replay_info_is_published_while_a_bag_is_replayed(
    harness: SimHarness, client: Client, recordings: MemoryRecordings
) -> None:
    client.listen(INFO)
    client.tick()
    client.heard.clear()
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(3):
        client.tick()
    info = client.messages(INFO)[-1]
    recorded = ego_values(recordings)[2]
    assert info["ego_acc"] == pytest.approx(recorded.accel)
    assert info["ego_steer"] == pytest.approx(math.degrees(recorded.wheel_angle))
    assert info["linear_acceleration"]["x"] == recorded.acceleration.x
    assert info["angular_velocity"]["z"] != 0.0
    assert 2.0 * math.atan2(info["orientation"]["z"], info["orientation"]["w"]) == pytest.approx(
        math.radians(recorded.heading)
    )
    assert info["num_of_npcs"] == len(info["npc_list"]) == 2
    assert len(client.messages(INFO)) == 3
    assert replay(client, STOP)
    client.tick()
    assert not harness.node.scene.is_replaying, "what we say ourselves is not replayed"


@pytest.mark.parametrize("is_for_all", [False, True])
def test_replay_info_of_a_drive_is_published_for_its_subscribers_and_for_all_if_set(
    recordings: MemoryRecordings, *, is_for_all: bool
) -> None:
    harness = SimHarness(start="sync", recordings=recordings, replay_info=is_for_all)
    client, recorder = harness.client(), harness.client()
    seen: list[Any] = []
    harness.bus.subscribe(recorder, INFO, lambda _topic, message, _sender, _now: seen.append(message), is_general=True)
    client.start()
    client.tick()
    assert len(seen) == is_for_all
    client.listen(INFO, "/Ego_topic", "/Object_topic")
    client.control(0, longlCmdType=1, accel=0.5, steering=0.2)
    client.tick()
    assert len(seen) == 1 + is_for_all
    (info,), (ego,), (objects,) = (client.messages(name) for name in (INFO, "/Ego_topic", "/Object_topic"))
    assert info["header"]["seq"] == harness.world.frame
    assert (info["ego_acc"], info["linear_acceleration"]) == (0.5, ego["acceleration"])
    assert info["ego_steer"] == pytest.approx(math.degrees(ego["wheel_angle"]), abs=1e-5)
    assert [info[name] for name in ("npc_list", "pedestrian_list", "obstacle_list")] == [
        objects[name] for name in ("npc_list", "pedestrian_list", "obstacle_list")
    ]
    assert not harness.node.scene.is_replaying, "what we say ourselves is not replayed"


def test_no_replay_info_is_published_while_a_client_is_followed(client: Client, harness: SimHarness) -> None:
    client.listen(INFO)
    other = harness.client()
    other.send(INFO, "morai_msgs/ReplayInfo", ego_acc=1.0)
    assert harness.node.scene.is_replaying
    client.heard.clear()
    client.tick()
    assert not client.heard


def test_recording_of_replay_info_only_is_replayed(recordings: MemoryRecordings) -> None:
    harness = SimHarness(start="sync", recordings=recordings)
    client = harness.client()
    client.start()
    recordings.record(harness.bus, "driven", INFO)
    client.listen("/Object_topic")
    steer_frames(client, 30)
    driven = [
        [(one["unique_id"], one["position"], one["heading"]) for one in message["npc_list"]]
        for message in client.messages("/Object_topic")
    ]
    harness = SimHarness("parked", start="sync", recordings=recordings)
    client = harness.client()
    client.start()
    client.listen("/Object_topic")
    assert replay(client, PLAY, FILE, "driven")
    for _ in range(30):
        client.tick()
    shown = [
        [(one["unique_id"], one["position"], one["heading"]) for one in message["npc_list"]]
        for message in client.messages("/Object_topic")
    ]
    assert shown == driven


def test_replay_info_recording_moves_objects_and_pedals_only(client: Client, recordings: MemoryRecordings) -> None:
    client.listen("/Object_topic")
    place = client.tick()["vehicle_status"]["position"]
    client.heard.clear()
    assert replay(client, PLAY, FILE, "info")
    note = "it holds no position of the ego: objects and pedals are replayed"
    assert client.told == [("info", f"info: {note}")]
    statuses = [client.tick()["vehicle_status"] for _ in range(NUM_FRAMES)]
    recorded = ego_values(recordings)
    assert all(status["position"] == place for status in statuses)
    assert [status["accel"] for status in statuses] == pytest.approx([value.accel for value in recorded])
    assert [status["wheel_angle"] for status in statuses] == pytest.approx([value.wheel_angle for value in recorded])
    assert [status["heading"] for status in statuses] == pytest.approx([value.heading for value in recorded])
    last = client.messages("/Object_topic")[-1]
    then = [value for topic, value, _ in recordings.messages["drive"] if topic == "/Object_topic"][-1]
    assert last["npc_list"][0]["velocity"]["x"] == then.npc_list[0].velocity.x
    assert last["npc_list"][0]["position"]["x"] == then.npc_list[0].position.x

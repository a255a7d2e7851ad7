"""Network replay: the world follows one client, and never its own messages."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.replays import network_replay
from rosbridge_sim.simulator.replays.network_replay import MAX_OBJECTS
from rosbridge_sim.simulator.replays.recording_builder import MAX_RECORDED_ENTRIES
from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import (
    FILE,
    INFO,
    PAUSE,
    PLAY,
    START,
    STATUS,
    STOP,
    last_status,
    replay,
    replay_info_messages,
)
from tests.simulator.sim_harness import Client, SimHarness


def test_world_follows_the_client_that_replays_over_the_network(
    harness: SimHarness, client: Client, recordings: MemoryRecordings
) -> None:
    player, other = harness.client(), harness.client()
    client.listen("/Object_topic", STATUS, INFO)
    for info in replay_info_messages(recordings)[:5]:
        player.send(INFO, "morai_msgs/ReplayInfo", **info)
        status = client.tick()["vehicle_status"]
        assert status["accel"] == pytest.approx(info["ego_acc"], abs=1e-6)
        assert status["position"]["x"] == -5.0
        shown = client.messages("/Object_topic")[-1]["npc_list"]
        assert [npc["position"]["x"] for npc in shown] == [npc["position"]["x"] for npc in info["npc_list"]]
    assert last_status(client) == (0, 16, 1)
    assert len(client.messages(INFO)) == 5, "the player's own"
    other.send(INFO, "morai_msgs/ReplayInfo", **info)
    assert other.told == [("warning", f"{INFO} is ignored: another client replays already")]
    assert not replay(other, PLAY, START, start_time=1)
    player.leave()
    client.tick()
    assert last_status(client) == (16, 1, 1)
    assert not client.messages("/Object_topic")[-1]["npc_list"]


def test_stopped_source_is_followed_again_after_silence_or_a_new_advertise(
    harness: SimHarness, client: Client, recordings: MemoryRecordings
) -> None:
    player = harness.client()
    infos = replay_info_messages(recordings)
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[0])
    assert replay(client, PAUSE)
    assert not client.tick()["tick_status"]
    assert replay(client, STOP)
    assert client.tick()["tick_status"], "running, as it was before"
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[1])
    assert not harness.node.scene.is_replaying
    assert player.told == [("warning", f"{INFO} is ignored: the replay was stopped")]
    for i in range(60):
        client.tick()
        if i < 10:
            player.send(INFO, "morai_msgs/ReplayInfo", **infos[1])
    assert not harness.node.scene.is_replaying
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[1])
    assert harness.node.scene.is_replaying, "after a second of silence it is another one"
    assert replay(client, STOP)
    harness.bus.unadvertise(player, INFO, 100.0)
    client.tick()
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[2])
    assert harness.node.scene.is_replaying
    harness.bus.unadvertise(player, INFO, 100.0)
    client.tick()
    assert not harness.node.scene.is_replaying


def test_network_settings_rename_the_replay_topics_and_service(recordings: MemoryRecordings) -> None:
    network = {
        "publishers": {INFO: {"on": False}, STATUS: {"name": "/state"}},
        "subscribers": {INFO: {"name": "/told"}, "/ego_setting": {"name": "/put"}},
        "services": {"/Morai_SimProc": {"name": "/steer"}},
    }
    harness = SimHarness("parked", start="sync", recordings=recordings, network=network)
    client, player = harness.client(), harness.client()
    client.start()
    client.listen("/state")
    player.send("/told", "morai_msgs/ReplayInfo", **replay_info_messages(recordings)[0])
    client.tick()
    assert client.messages("/state")[-1]["current_mode"] == 16
    player.send("/put", "morai_msgs/MultiEgoSetting")
    assert player.told == [("warning", "/put is ignored while a recording is replayed")]
    player.leave()
    request = {"sim_process_status": PLAY, "replay_option": FILE, "rosbag_file_name": "drive"}
    assert client.ask("/steer", **request)["result"]
    client.tick()
    player.send("/told", "morai_msgs/ReplayInfo", ego_acc=1.0)
    assert player.told[1:] == [("warning", "/told is ignored: a bag is replayed already")]


def test_bag_takes_precedence_over_network_replay(
    harness: SimHarness, client: Client, recordings: MemoryRecordings
) -> None:
    player = harness.client()
    infos = replay_info_messages(recordings)
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[0])
    assert replay(client, PLAY, FILE, "drive")
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[1])
    assert player.told == [("warning", f"{INFO} is ignored: a bag is replayed already")]
    assert replay(client, STOP)
    assert not harness.node.scene.is_replaying


def test_invalid_number_is_reported_to_its_sender(harness: SimHarness) -> None:
    player = harness.client()
    infos: list[dict[str, Any]] = [
        {"ego_acc": math.nan},
        {"angular_velocity": {"z": math.nan}},
        {"angular_velocity": {"z": 1e300}},
        {"npc_list": [{"name": "Bus", "position": {"x": math.inf}}]},
    ]
    for info in infos:
        with pytest.raises(FieldError, match="not finite, or out of range"):
            player.send(INFO, "morai_msgs/ReplayInfo", **info)
    assert not harness.node.scene.is_replaying


@pytest.mark.parametrize("num", [MAX_OBJECTS + 1, MAX_RECORDED_ENTRIES + 1])
def test_a_message_of_too_many_objects_is_refused(num: int) -> None:
    harness = SimHarness()
    topic = harness.bus.advertise(harness.client(), INFO, "morai_msgs/ReplayInfo")
    value: Any = topic.type.check({"npc_list": [{}]}, 0)
    value.npc_list *= num
    before = harness.world.digest()
    with pytest.raises(FieldError, match=f"{INFO}: expected at most 10,000 objects in one message, got {num:,}"):
        harness.bus.publish(harness.client(), topic, Message(topic.type, value), 0.0)
    assert harness.world.digest() == before


def test_many_objects_are_read_in_turns_and_then_moved_at_once(
    monkeypatch: pytest.MonkeyPatch, harness: SimHarness, recordings: MemoryRecordings
) -> None:
    monkeypatch.setattr(network_replay, "MANY_OBJECTS", 0)
    harness.node.limit_turns(lambda: 0.0)
    first, second = harness.client(), harness.client()
    info = replay_info_messages(recordings)[0]
    assert info["npc_list"]
    for player in (first, second):
        player.send(INFO, "morai_msgs/ReplayInfo", **info)
    late_work, turns = harness.node.context.late_work, 0
    while late_work.waiting:
        assert harness.node.scene.is_replaying is (turns >= 3), "the last of three parts moves the world"
        turns += late_work.take_turn(0.0)
    assert turns == 6
    assert second.told == [("warning", f"{INFO} is ignored: another client replays already")]
    assert not first.told


def test_echoes_of_a_drive_from_a_far_bridge_are_not_followed(harness: SimHarness, client: Client) -> None:
    bridge = harness.client()
    bridge.listen(INFO)
    for _ in range(250):
        client.tick()
    echoes = bridge.messages(INFO)
    assert len(echoes) == 250
    for echo in (echoes[0], echoes[125], echoes[-1]):
        bridge.send(INFO, "morai_msgs/ReplayInfo", **echo)
    assert not harness.node.scene.is_replaying
    assert not bridge.told


def test_remembered_messages_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rosbridge_sim.simulator.replays.replay_info.MAX_ECHOES", 5)
    harness = SimHarness("parked", start="sync")
    client = harness.client()
    client.start()
    client.listen(INFO)
    for _ in range(7):
        client.tick()
    messages = client.messages(INFO)
    client.send(INFO, "morai_msgs/ReplayInfo", **messages[2])
    assert not harness.node.scene.is_replaying
    client.send(INFO, "morai_msgs/ReplayInfo", **messages[1])
    assert harness.node.scene.is_replaying


def test_echoes_of_a_replay_from_a_far_bridge_are_not_followed(harness: SimHarness, client: Client) -> None:
    bridge = harness.client()
    bridge.listen(INFO)
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(3):
        client.tick()
    echoes = bridge.messages(INFO)
    assert replay(client, STOP)
    bridge.send(INFO, "morai_msgs/ReplayInfo", ego_acc=1.0)
    assert harness.node.scene.is_replaying, "a message without a stamp gets that of now, and is no echo"
    bridge.leave()
    client.tick()
    for echo in echoes:
        bridge.send(INFO, "morai_msgs/ReplayInfo", **echo)
    assert not harness.node.scene.is_replaying
    assert not bridge.told
    echo["header"]["stamp"]["secs"] = 77
    bridge.send(INFO, "morai_msgs/ReplayInfo", **echo)
    assert harness.node.scene.is_replaying

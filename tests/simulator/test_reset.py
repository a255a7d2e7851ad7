"""/sim/reset: afterwards the bytes are the same as after the start."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Answer, Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from tests.simulator.sim_harness import ALL, Client, SimHarness, rates

HEARD = ("/clock", "/Ego_topic", "/Object_topic", "/CollisionData", "/VehicleCollisionData", "/SyncModeInfo")


def reset(client: Client, seed: int = -1) -> dict[str, Any]:
    answer = client.call("/sim/reset", {"seed": seed})
    assert answer.is_ok, answer.values
    assert isinstance(answer.values, Message)
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


def drive(client: Client, listener: Client) -> list[bytes]:
    """A little of everything; what the listener hears of it."""
    listener.raw.clear()
    place = {"name": "Box", "position": {"x": 10.0, "y": 24.5, "z": 0.0}, "heading": 5.0, "frame": 3}
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", **place)
    client.control(5, longlCmdType=2, velocity=40.0, steering=0.1)
    client.ask("/Service_MoraiEventCmd", option=4, lamps={"turnSignal": 2, "emergencySignal": 0})
    answers = [client.tick() for _ in range(60)]
    client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
    answers += [client.tick() for _ in range(20)]
    assert any(b'"collision_object":[{' in message for message in listener.raw)
    return [*listener.raw, json.dumps(answers).encode()]


def test_a_reset_run_repeats_byte_for_byte() -> None:
    harness = SimHarness(start="sync")
    client, listener = harness.client(), harness.client()
    listener.listen(*HEARD)
    client.start()
    first = drive(client, listener)
    digest = harness.world.digest()
    for _ in range(2):
        assert reset(client) == {"frame": 0, "seed": 0}
        assert drive(client, listener) == first
        assert harness.world.digest() == digest


def test_reset_state_equals_the_start_state() -> None:
    fresh, harness = SimHarness("crowd"), SimHarness("crowd")
    client = harness.client()
    client.ask("/Service_MoraiSL", file_name="elsewhere", **ALL)
    client.ask("/Service_MoraiEventCmd", option=7, ctrl_mode=1, gear=2, lamps={"turnSignal": 1, "emergencySignal": 1})
    setting: dict[str, Any] = {"number_of_ego_vehicle": 1, "camera_index": 2, "ego_index": [2], "gear": [4]}
    lists = ("global_position_x", "global_position_y", "global_position_z", "global_roll", "global_pitch", "global_yaw")
    setting |= {name: [0.0] for name in (*lists, "velocity")} | {"ctrl_mode": [16]}
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **setting)
    harness.run(1.0)
    reset(client)
    assert harness.world.digest() == fresh.world.digest()
    assert harness.node.scene.road_map.name == "track"
    assert [ego.index for ego in harness.node.egos] == [FIRST_EGO]
    assert client.call("/Ego-2/SyncModeCmd", {}).is_ok is False
    state, at_start = (each.ask("/Service_MoraiEventCmd", option=0) for each in (client, fresh.client()))
    assert state == at_start
    assert harness.bus.stamp_ns == 0


def test_reset_sets_or_keeps_the_seed() -> None:
    harness = SimHarness()
    client = harness.client()
    assert reset(client, 7) == {"frame": 0, "seed": 7}
    hashed = harness.world.digest()
    assert reset(client) == {"frame": 0, "seed": 7}
    assert harness.world.digest() == hashed
    assert reset(client, 0) == {"frame": 0, "seed": 0}
    assert harness.world.digest() != hashed


def test_reset_keeps_master_and_pause_and_drops_waiting_commands() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start()
    client.tick()
    client.control(40, longlCmdType=1, accel=1.0)
    client.listen("/SyncModeInfo")
    reset(client)
    assert client.messages("/SyncModeInfo")[-1] == {
        "master_id": "me",
        "status": True,
        "frame": 0,
        "can_send_tick": True,
    }
    for _ in range(50):
        assert client.tick()["vehicle_status"]["accel"] == 0.0
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    reset(client)
    assert client.tick()["pause_status"]


def test_generated_master_ids_start_again_without_a_master() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    assert client.start("")["user_id"] == "sync-1"
    reset(client)
    client.stop("sync-1")
    assert client.start("")["user_id"] == "sync-2"
    client.stop("sync-2")
    reset(client)
    assert client.start("")["user_id"] == "sync-1"


def test_real_time_frames_go_on_from_0_after_a_reset() -> None:
    harness = SimHarness(network=rates({"/Ego_topic": 100.0}))
    client = harness.client()
    client.listen("/Ego_topic", "/clock")
    harness.run(0.51)
    client.heard.clear()
    reset(client)
    harness.run(0.1)
    seqs = [message["header"]["seq"] for message in client.messages("/Ego_topic")]
    assert seqs[0] == 1
    assert seqs == sorted(seqs)
    assert seqs[-1] == 5


@pytest.mark.parametrize("start", ["run", "sync"])
def test_reset_from_a_subscriber_during_a_frame_is_refused(start: str) -> None:
    harness = SimHarness(start=start)
    client = harness.client()
    answers: list[Answer] = []

    def ask(_topic: Topic, _message: Message, _sender: Participant, now: float) -> None:
        harness.bus.call(client, "/sim/reset", {}, answers.append, now=now)

    harness.bus.subscribe(client, "/clock", ask)
    if start == "sync":
        client.start()
        client.tick()
    else:
        harness.run(0.021)
    assert [(answer.is_ok, answer.values) for answer in answers] == [(False, "the world is moving")]
    assert harness.world.frame == 1

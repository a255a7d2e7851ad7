"""`/Morai_SimProc` and the status topic: each command, its refusals, and its answer."""

from __future__ import annotations

from typing import Any

import pytest

from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import (
    FILE,
    PAUSE,
    PLAY,
    SPEED,
    START,
    STATUS,
    STOP,
    TARGETS,
    ego_values,
    last_status,
    replay,
    shown_x,
)
from tests.simulator.sim_harness import ALL, Client, SimHarness


def test_status_follows_each_command(client: Client) -> None:
    client.listen(STATUS)
    client.tick()
    assert last_status(client) == (0, 1, 1)
    assert not replay(client, PLAY, FILE, "nothing")
    assert last_status(client) == (32, 1, 1)
    assert client.told.pop() == ("error", "/Morai_SimProc: no recording 'nothing'")
    assert not replay(client, PLAY, FILE, "empty")
    assert last_status(client) == (48, 1, 1)
    assert client.told.pop() == (
        "error",
        "/Morai_SimProc: empty: it holds no ego and no objects that can be replayed",
    )
    client.tick()
    assert replay(client, PAUSE, FILE, "drive")
    assert last_status(client) == (1, 16, 16)
    assert client.messages(STATUS)[-1]["latest_command_time"] == {"secs": 0, "nsecs": 40_000_000}
    assert client.messages(STATUS)[-1]["header"]["frame_id"] == "SimProcStatus"
    assert replay(client, PLAY)
    assert last_status(client) == (1, 16, 1)
    assert not replay(client, PLAY, START, start_time=60_000)
    assert last_status(client) == (16, 16, 1)
    assert replay(client, STOP)
    assert last_status(client) == (1, 1, 1)
    client.tick()
    assert len(client.messages(STATUS)) == 9, "one with each frame and each change"


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"status": 0}, "sim_process_status: expected 1 (play), 2 (pause) or 32 (stop), got 0"),
        ({"status": 16}, "sim_process_status: expected 1 (play), 2 (pause) or 32 (stop), got 16"),
        ({"option": 32}, "replay_option: expected a sum of 1, 2, 4 and 8, got 32"),
        ({"option": -1}, "replay_option: expected a sum of 1, 2, 4 and 8, got -1"),
        ({"option": TARGETS}, "replay_target_option: expected a sum of 1, 2 and 4, got 0"),
        ({"option": TARGETS, "replay_target_option": 8}, "replay_target_option: expected a sum of 1, 2 and 4, got 8"),
        ({"option": START, "start_time": -1}, "start_time: expected 0 or more, got -1"),
        ({"option": SPEED, "replay_speed": 0}, "replay_speed: expected 1..10, got 0"),
        ({"option": SPEED, "replay_speed": 11}, "replay_speed: expected 1..10, got 11"),
    ],
)
def test_invalid_command_is_refused(client: Client, harness: SimHarness, fields: dict[str, int], why: str) -> None:
    client.listen(STATUS)
    digest = harness.world.digest()
    assert not replay(client, **fields)  # type: ignore[arg-type] # numbers alone
    assert client.told == [("error", f"/Morai_SimProc: morai_msgs/MoraiSimProcHandle.{why}")]
    assert last_status(client) == (16, 1, 1)
    assert harness.world.digest() == digest


def test_options_may_be_written_as_hexadecimal_digits(client: Client, recordings: MemoryRecordings) -> None:
    client.listen("/Ego_topic", "/Object_topic")
    option = 0x0001 | 0x0010 | 0x0100 | 0x1000
    assert replay(client, PLAY, option, "drive", start_time=200, replay_speed=2, replay_target_option=0x001 | 0x010)
    client.tick()
    client.tick()
    assert shown_x(client) == [value.position.x for value in ego_values(recordings)][10:14:2]
    assert client.messages("/Object_topic")[-1]["num_of_npcs"] == 2
    assert client.messages("/Object_topic")[-1]["num_of_pedestrian"] == 0


def test_options_without_a_recording_are_refused(client: Client) -> None:
    assert not replay(client, PLAY, SPEED, replay_speed=2)
    assert client.told == [("error", "/Morai_SimProc: no recording is loaded: replay_option 1 loads one")]


def test_refused_file_keeps_the_running_replay(client: Client, recordings: MemoryRecordings) -> None:
    client.listen("/Ego_topic")
    assert replay(client, PLAY, FILE, "drive")
    client.tick()
    assert not replay(client, PLAY, FILE, "empty")
    assert not replay(client, PLAY, FILE, "nothing")
    assert not replay(client, PLAY, FILE | START, "drive", start_time=99_999)
    client.tick()
    assert shown_x(client) == [value.position.x for value in ego_values(recordings)][:2]
    assert replay(client, PLAY, FILE, "drive")
    client.tick()
    assert shown_x(client)[2:] == shown_x(client)[:1]


def test_commands_without_a_replay_pause_and_restart_the_scenario() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen(STATUS, "/Ego_topic")
    harness.run(0.1)
    assert replay(client, PAUSE)
    assert last_status(client) == (1, 1, 16)
    frame = harness.world.frame
    harness.run(1.0)
    assert harness.world.frame == frame
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    assert replay(client, PLAY)
    harness.run(1.0)
    assert last_status(client) == (1, 1, 1)
    row = harness.node.egos[0].row
    assert harness.world.y[row] > 20.5
    assert client.ask("/Service_MoraiSL", file_name="elsewhere", **ALL)["result"]
    harness.run(0.1)
    assert replay(client, STOP)
    assert harness.world.y[harness.node.egos[0].row] == 50.0, "the scenario that was loaded last"
    assert harness.world.frame > frame
    assert client.call("/sim/reset", {"seed": -1}).is_ok
    harness.run(0.5)
    assert replay(client, STOP)
    assert harness.world.y[harness.node.egos[0].row] == 20.0
    assert last_status(client) == (1, 1, 1)


def test_answer_waits_for_reading_and_other_commands_are_refused_meanwhile(recordings: MemoryRecordings) -> None:
    harness = SimHarness("parked", start="sync", recordings=recordings)
    client, other = harness.client(), harness.client()
    answers: list[Any] = []
    request: dict[str, object] = {
        "request": {"sim_process_status": PLAY, "replay_option": FILE, "rosbag_file_name": "drive"}
    }
    recordings.is_slow = True
    try:
        harness.bus.call(client, "/Morai_SimProc", request, answers.append, now=100.0)
        assert not replay(other, PLAY)
        assert other.told == [("error", "/Morai_SimProc: a recording is being read")]
        assert not answers
        recordings.deliver()
        assert answers.pop().is_ok
        assert harness.node.scene.is_replaying
        harness.bus.call(client, "/Morai_SimProc", request, answers.append, now=100.0)
        assert client.call("/sim/reset", {"seed": -1}).is_ok
        assert answers.pop().values == "The simulation was reset"
        harness.bus.call(client, "/Morai_SimProc", request, answers.append, now=100.0)
        client.leave()
        recordings.deliver()
        assert not answers
        assert not harness.node.scene.is_replaying
        assert replay(other, PLAY)
    finally:
        recordings.is_slow = False

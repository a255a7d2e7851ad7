"""Replay: what was recorded comes out again, frame for frame; the table; what a recording does to everybody else."""

from __future__ import annotations

import math
from dataclasses import replace as changed
from itertools import product
from typing import Any

import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.morai.catalogue import Catalogue, Model, find_model
from rosbridge_sim.morai.releases import FIELD
from rosbridge_sim.morai.replays.recording_builder import MAX_RECORDED_ENTRIES
from rosbridge_sim.morai.replays.state_machine import (
    BAG_EVENTS,
    REPLAY_TABLE,
    SOURCE_EVENTS,
    ReplayEffect,
    ReplayEvent,
    ReplayState,
)
from rosbridge_sim.morai.scene import MAX_ENTITIES
from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.state import Body, Kind
from tests.morai.memory_recordings import Tape
from tests.morai.sim_harness import ALL, Client, SimHarness, put_egos

STATUS = "/sim/process/state/msg/MoraiSimProcStatus"
INFO = "/ReplayInfo_topic"
PLAY, PAUSE, STOP = 1, 2, 32
FILE, TARGETS, START, SPEED = 1, 2, 4, 8
EGO, VEHICLES, PEDESTRIANS = 1, 2, 4
NUM_FRAMES = 60


def replay(client: Client, status: int = PLAY, option: int = 0, name: str = "", **fields: int) -> bool:
    """What /Morai_SimProc says to a command."""
    result: bool = client.ask(
        "/Morai_SimProc", sim_process_status=status, replay_option=option, rosbag_file_name=name, **fields
    )["result"]
    return result


def steer_frames(client: Client, num: int) -> None:
    """A lively drive: throttle, brake, both sides, and an object that comes and goes."""
    for i in range(num):
        client.control(0, longlCmdType=1, accel=0.3 + 0.4 * (i % 3), brake=0.1 * (i > 40), steering=0.5 * math.sin(i))
        if i == 20:
            place = {"name": "Box", "position": {"x": 3.0, "y": 21.0, "z": 0.5}, "heading": 77.7, "frame": 0}
            client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", **place)
        client.tick()


@pytest.fixture(scope="module")
def tape() -> Tape:
    """A drive in the crowd, recorded; and the same as ReplayInfo alone."""
    tape = Tape()
    harness = SimHarness(start="sync", recordings=tape)
    client = harness.client()
    client.start()
    tape.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
    steer_frames(client, NUM_FRAMES)
    harness = SimHarness("parked", start="sync", recordings=tape)
    client = harness.client()
    client.start()
    tape.record(harness.bus, "told", INFO)
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(NUM_FRAMES):
        client.tick()
    tape.takes["empty"] = []
    return tape


@pytest.fixture
def harness(tape: Tape) -> SimHarness:
    return SimHarness("parked", start="sync", recordings=tape)


@pytest.fixture
def client(harness: SimHarness) -> Client:
    client = harness.client()
    client.start()
    return client


def bodies(messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Messages without their headers, which are of their own time."""
    return [{key: value for key, value in message.items() if key != "header"} for message in messages]


def test_table_has_a_row_for_all_that_can_happen() -> None:
    for state, event in product(ReplayState, ReplayEvent):
        is_possible = (event not in BAG_EVENTS or state in {ReplayState.REPLAYING, ReplayState.AT_END}) and (
            event not in SOURCE_EVENTS or state is ReplayState.FOLLOWING
        )
        assert (event in REPLAY_TABLE[state]) == is_possible


def test_every_refusal_says_why_and_changes_nothing() -> None:
    for state, rows in REPLAY_TABLE.items():
        for outcome in rows.values():
            assert not outcome.why or (outcome.state is state and not outcome.effects)


def test_a_recording_enters_and_leaves_in_turns() -> None:
    for state, rows in REPLAY_TABLE.items():
        for outcome in rows.values():
            is_on = state is not ReplayState.SIMULATING
            for effect in outcome.effects:
                assert effect is not ReplayEffect.ENTER or not is_on
                assert effect is not ReplayEffect.LEAVE or is_on
                is_on = is_on ^ (effect in {ReplayEffect.ENTER, ReplayEffect.LEAVE})
            assert is_on == (outcome.state is not ReplayState.SIMULATING)


def drive_and_replay(release: str, **settings: Any) -> tuple[list[Any], list[Any]]:  # noqa: ANN401 - NodeSettings'
    tape = Tape()
    topics = ("/Ego_topic", "/Object_topic", "/CollisionData", "/VehicleCollisionData")
    heard = []
    for scenario in ("crowd", "parked"):
        harness = SimHarness(scenario, start="sync", release=release, recordings=tape, **settings)
        client = harness.client()
        client.start()
        client.listen(*topics)
        if scenario == "crowd":
            tape.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
            box = find_model("Box")
            assert box is not None
            harness.node.scene.add(box, x=10.0, y=24.5, z=0.0, yaw=0.3)
            for i in range(NUM_FRAMES):
                client.control(0, longlCmdType=1, accel=0.9, steering=0.5 * math.sin(i / 9))
                client.tick()
        else:
            client.tick()
            client.heard.clear()
            assert replay(client, PLAY, FILE, "drive")
            for _ in range(NUM_FRAMES):
                client.tick()
        heard.append([bodies(client.messages(topic)) for topic in topics])
    return heard[0], heard[1]


@pytest.mark.parametrize("settings", [{}, {"profile": FIELD}], ids=["manual", "field"])
@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_recorded_drive_comes_out_again_to_the_last_bit(release: str, settings: dict[str, Any]) -> None:
    first, again = drive_and_replay(release, **settings)
    assert len(first[0]) == NUM_FRAMES
    assert len({str(message) for message in first[0]}) == NUM_FRAMES, "the ego moved"
    assert any(message["collision_object"] for message in first[2]), "and hit something"
    assert again == first


def test_a_recorded_model_of_the_users_has_its_proportions() -> None:
    lorry = Model(
        "Lorry", Kind.VEHICLE, changed(Body(), length=9.0, wheelbase=5.0, front_overhang=1.0, rear_overhang=3.0)
    )
    tape = Tape()
    settings: dict[str, Any] = {"start": "sync", "recordings": tape, "catalogue": Catalogue([lorry])}
    recording = SimHarness("parked", **settings)
    client = recording.client()
    client.start()
    tape.record(recording.bus, "drive", "/Ego_topic", "/Object_topic")
    recording.node.scene.add(lorry, x=30.0, y=0.0, z=0.0, yaw=0.0)
    for _ in range(5):
        client.tick()
    harness = SimHarness("parked", **settings)
    client = harness.client()
    client.start()
    client.tick()
    assert replay(client, PLAY, FILE, "drive")
    client.tick()
    (row,) = harness.world.rows(Kind.VEHICLE).tolist()
    assert (harness.world.names[row], harness.world.bodies[row].rear_overhang) == ("Lorry", 3.0)


def test_objects_come_and_go_under_their_numbers(client: Client, harness: SimHarness, tape: Tape) -> None:
    client.listen("/Object_topic")
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(NUM_FRAMES):
        client.tick()
    box = [
        [thing["unique_id"] for thing in message["obstacle_list"] if thing["name"] == "Box"]
        for message in client.messages("/Object_topic")
    ]
    recorded = [
        [thing.unique_id for thing in value.obstacle_list if thing.name == "Box"]
        for topic, value, _ in tape.takes["drive"]
        if topic == "/Object_topic"
    ]
    assert box == recorded
    assert box[0] != box[-1]
    assert harness.world.frame == NUM_FRAMES


# What it shows when


def ego_values(tape: Tape) -> list[Any]:
    return [value for topic, value, _ in tape.takes["drive"] if topic == "/Ego_topic"]


def shown_x(client: Client) -> list[float]:
    return [message["position"]["x"] for message in client.messages("/Ego_topic")]


def test_start_time_and_speed_choose_frames(client: Client, tape: Tape) -> None:
    client.listen("/Ego_topic")
    recorded = [value.position.x for value in ego_values(tape)]
    assert replay(client, PLAY, FILE | START | SPEED, "drive", start_time=200, replay_speed=3)
    for _ in range(5):
        client.tick()
    assert shown_x(client) == recorded[10:25:3]
    assert replay(client, PLAY, START, start_time=40)
    assert replay(client, PLAY, SPEED, replay_speed=1)
    for _ in range(3):
        client.tick()
    assert shown_x(client)[5:] == recorded[2:5]


def test_real_time_shows_the_same_frames(tape: Tape) -> None:
    harness = SimHarness("parked", recordings=tape)
    client = harness.client()
    client.listen("/Ego_topic")
    assert replay(client, PLAY, FILE, "drive")
    harness.run(5.0)
    recorded = [value.position.x for value in ego_values(tape)]
    assert shown_x(client)[: len(recorded)] == recorded
    assert harness.node.sync.is_paused, "at the end"
    assert set(shown_x(client)[len(recorded) :]) <= {recorded[-1]}, "the last frame is shown again in the pause"


def test_end_pauses_until_play_begins_again_or_stop_goes_back(client: Client, harness: SimHarness) -> None:
    client.listen("/Ego_topic", STATUS)
    before = client.tick()["vehicle_status"]["position"]
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(NUM_FRAMES):
        assert client.tick()["tick_status"]
    assert client.messages(STATUS)[-1]["current_status"] == 32
    answer = client.tick()
    assert (answer["tick_status"], answer["pause_status"]) == (False, True)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    assert harness.node.sync.is_paused, "nothing else ends the pause there"
    client.heard.clear()
    assert replay(client, PLAY)
    for _ in range(NUM_FRAMES):
        assert client.tick()["tick_status"]
    assert len(set(shown_x(client))) > NUM_FRAMES / 2
    assert replay(client, STOP)
    assert client.tick()["vehicle_status"]["position"] == before


def test_play_holds_when_a_scenario_ends_a_replay_that_began_paused(client: Client) -> None:
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert replay(client, PLAY, FILE, "drive")
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL)["result"]
    assert client.tick()["tick_status"]


def test_paused_load_stands_at_its_first_frame(client: Client, tape: Tape) -> None:
    first = ego_values(tape)[0]
    assert replay(client, PAUSE, FILE, "drive")
    answer = client.tick()
    assert (answer["tick_status"], answer["pause_status"]) == (False, True)
    assert answer["vehicle_status"]["position"]["x"] == first.position.x
    assert replay(client, PLAY)
    answer = client.tick()
    assert answer["tick_status"]
    assert answer["vehicle_status"]["position"]["x"] == first.position.x


def test_stop_gives_the_world_back_as_it_was() -> None:
    positions = []
    for is_replaying in (False, True):
        tape = Tape()
        harness = SimHarness(start="sync", recordings=tape)
        client = harness.client()
        client.start()
        tape.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
        steer_frames(client, 30)
        if is_replaying:
            assert replay(client, PLAY, FILE | START, "drive", start_time=100)
            for _ in range(7):
                client.tick()
            assert replay(client, STOP)
        client.listen("/Ego_topic", "/Object_topic")
        steer_frames(client, 30)
        positions.append(bodies([message for _, message in client.heard]))
        assert harness.world.frame == 60 + 7 * is_replaying
    assert positions[0] == positions[1]


# Whom it moves


def test_vehicles_alone_leave_the_ego_to_its_driver(tape: Tape) -> None:
    harness = SimHarness(start="sync", recordings=tape)
    client = harness.client()
    client.start()
    client.listen("/Object_topic")
    assert replay(client, PLAY, FILE | TARGETS, "drive", replay_target_option=VEHICLES)
    client.control(0, longlCmdType=1, accel=1.0)
    for _ in range(20):
        status = client.tick()["vehicle_status"]
    assert status["velocity"]["x"] > 1.0
    assert status["accel"] == 1.0
    last = client.messages("/Object_topic")[-1]
    recorded = [value for topic, value, _ in tape.takes["drive"] if topic == "/Object_topic"][19]
    assert [npc["position"]["x"] for npc in last["npc_list"]] == [npc.position.x for npc in recorded.npc_list]
    assert [person["unique_id"] for person in last["pedestrian_list"]] == [9], "of the scenario, and on its own way"
    assert replay(client, PLAY, TARGETS, replay_target_option=EGO)
    assert client.tick()["vehicle_status"]["position"]["x"] == ego_values(tape)[20].position.x


@pytest.mark.parametrize(
    ("option", "fields"),
    [(SPEED, {"replay_speed": 2}), (TARGETS, {"replay_target_option": VEHICLES | PEDESTRIANS})],
    ids=["speed", "targets"],
)
def test_ego_that_its_driver_keeps_drives_on_through_other_options(
    tape: Tape, option: int, fields: dict[str, int]
) -> None:
    harness = SimHarness(start="sync", recordings=tape)
    client = harness.client()
    client.start()
    assert replay(client, PLAY, FILE | TARGETS, "drive", replay_target_option=VEHICLES)
    client.control(0, longlCmdType=1, accel=1.0)
    before = [client.tick()["vehicle_status"] for _ in range(20)][-1]
    assert replay(client, PLAY, option, "", **fields)
    status = client.tick()["vehicle_status"]
    assert status["velocity"]["x"] > before["velocity"]["x"] > 1.0
    assert status["position"]["y"] > before["position"]["y"]
    assert replay(client, STOP)
    assert client.tick()["vehicle_status"]["velocity"]["x"] == 0.0, "as it was when the replay began"


def test_ego_that_the_world_has_not_is_told_to_whoever_asked(harness: SimHarness, client: Client, tape: Tape) -> None:
    tape.takes["two"] = tape.takes["drive"] + [
        ("/Ego-2/Ego_topic", value, stamp) for topic, value, stamp in tape.takes["drive"] if topic == "/Ego_topic"
    ]
    assert replay(client, PLAY, FILE, "two")
    assert client.told == [("info", "two: it holds an ego 2 and the world has none: that one is left out")]
    assert replay(client, STOP)
    client.told.clear()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    assert replay(client, PLAY, FILE, "two")
    client.tick()
    world, (first, second) = harness.world, harness.node.egos
    assert world.x[first.row] == world.x[second.row]
    assert client.told == []


def test_commands_to_the_replayed_are_ignored_with_one_warning(tape: Tape) -> None:
    harness = SimHarness("parked", recordings=tape)
    client = harness.client()
    assert replay(client, PLAY, FILE, "drive")
    npc = {"unique_id": 50, "name": "Bus", "position": {"x": 1.0, "y": 1.0, "z": 0.0}}
    lists = ("global_position_x", "global_position_y", "global_position_z", "global_roll", "global_pitch", "global_yaw")
    setting: dict[str, Any] = {"number_of_ego_vehicle": 1, "ego_index": [2], "gear": [4], "ctrl_mode": [16]}
    setting |= {name: [0.0] for name in (*lists, "velocity")}
    for _ in range(3):
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
        client.send("/ghost_ctrl_cmd", "morai_msgs/GhostMessage", position={"x": 9.0})
        client.send("/NpcGhost_Topic", "morai_msgs/NpcGhostCmd", npc_list=[npc])
        client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **setting)
    assert sorted(client.told) == [
        ("warning", f"{topic} is ignored while a recording is replayed")
        for topic in ("/NpcGhost_Topic", "/ctrl_cmd", "/ego_setting", "/ghost_ctrl_cmd")
    ]
    assert client.ask("/Service_MoraiEventCmd", option=3, ctrl_mode=1, gear=2)["gear"] != 2
    harness.run(0.2)
    assert len(harness.node.egos) == 1
    assert harness.world.is_ghost[harness.node.egos[0].row]


def test_nobody_comes_or_goes_by_himself_meanwhile(client: Client, harness: SimHarness) -> None:
    assert replay(client, PLAY, FILE, "drive")
    client.control(0, longlCmdType=1, accel=1.0)
    client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=7, frame=0)
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Box", position={"x": 1.0}, frame=0)
    num = len(harness.world)
    client.tick()
    assert len(harness.world) == num
    assert ("error", "/SyncModeRemoveObj: refused while a recording is replayed") in client.told
    assert ("error", "/SyncModeAddObj: refused while a recording is replayed") in client.told
    assert ("warning", "/SyncModeCtrlCmd moves nothing while a recording is replayed") in client.told


@pytest.mark.parametrize("how", ["reset", "load"])
def test_reset_and_scenario_load_end_a_replay(how: str, tape: Tape) -> None:
    harness = SimHarness("parked", recordings=tape)
    client = harness.client()
    client.listen(STATUS)
    assert replay(client, PLAY, FILE, "drive")
    harness.run(0.5)
    if how == "reset":
        assert client.call("/sim/reset", {"seed": -1}).is_ok
        assert harness.world.digest() == SimHarness("parked").world.digest()
    else:
        assert client.ask("/Service_MoraiSL", file_name="crowd", **ALL)["result"]
    harness.run(0.1)
    status = client.messages(STATUS)[-1]
    assert status["current_mode"] == 1
    assert status["latest_command_time"] == {"secs": 0, "nsecs": 0}
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    harness.run(0.5)
    assert harness.world.throttle[harness.node.egos[0].row] == 1.0
    assert not client.told


# The status


def process(client: Client) -> tuple[int, int, int]:
    last = client.messages(STATUS)[-1]
    return last["command_result"], last["current_mode"], last["current_status"]


def test_status_follows_each_command(client: Client) -> None:
    client.listen(STATUS)
    client.tick()
    assert process(client) == (0, 1, 1)
    assert not replay(client, PLAY, FILE, "nothing")
    assert process(client) == (32, 1, 1)
    assert client.told.pop() == ("error", "/Morai_SimProc: no recording 'nothing'")
    assert not replay(client, PLAY, FILE, "empty")
    assert process(client) == (48, 1, 1)
    assert client.told.pop() == (
        "error",
        "/Morai_SimProc: empty: there is nothing in it that can be replayed: no ego, no objects",
    )
    client.tick()
    assert replay(client, PAUSE, FILE, "drive")
    assert process(client) == (1, 16, 16)
    assert client.messages(STATUS)[-1]["latest_command_time"] == {"secs": 0, "nsecs": 40_000_000}
    assert client.messages(STATUS)[-1]["header"]["frame_id"] == "SimProcStatus"
    assert replay(client, PLAY)
    assert process(client) == (1, 16, 1)
    assert not replay(client, PLAY, START, start_time=60_000)
    assert process(client) == (16, 16, 1)
    assert replay(client, STOP)
    assert process(client) == (1, 1, 1)
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
def test_command_that_is_none_is_refused(client: Client, harness: SimHarness, fields: dict[str, int], why: str) -> None:
    client.listen(STATUS)
    digest = harness.world.digest()
    assert not replay(client, **fields)  # type: ignore[arg-type] # numbers alone
    assert client.told == [("error", f"/Morai_SimProc: morai_msgs/MoraiSimProcHandle.{why}")]
    assert process(client) == (16, 1, 1)
    assert harness.world.digest() == digest


def test_sums_may_be_written_as_in_the_comment(client: Client, tape: Tape) -> None:
    client.listen("/Ego_topic", "/Object_topic")
    option = 0x0001 | 0x0010 | 0x0100 | 0x1000
    assert replay(client, PLAY, option, "drive", start_time=200, replay_speed=2, replay_target_option=0x001 | 0x010)
    client.tick()
    client.tick()
    assert shown_x(client) == [value.position.x for value in ego_values(tape)][10:14:2]
    assert client.messages("/Object_topic")[-1]["num_of_npcs"] == 2
    assert client.messages("/Object_topic")[-1]["num_of_pedestrian"] == 0


def test_options_without_a_recording_are_refused(client: Client) -> None:
    assert not replay(client, PLAY, SPEED, replay_speed=2)
    assert client.told == [("error", "/Morai_SimProc: no recording is loaded: replay_option 1 loads one")]


def test_refused_file_leaves_the_replay_that_runs(client: Client, tape: Tape) -> None:
    client.listen("/Ego_topic")
    assert replay(client, PLAY, FILE, "drive")
    client.tick()
    assert not replay(client, PLAY, FILE, "empty")
    assert not replay(client, PLAY, FILE, "nothing")
    assert not replay(client, PLAY, FILE | START, "drive", start_time=99_999)
    client.tick()
    assert shown_x(client) == [value.position.x for value in ego_values(tape)][:2]
    assert replay(client, PLAY, FILE, "drive")
    client.tick()
    assert shown_x(client)[2:] == shown_x(client)[:1]


def test_in_simulation_mode_they_are_pause_and_reset() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen(STATUS, "/Ego_topic")
    harness.run(0.1)
    assert replay(client, PAUSE)
    assert process(client) == (1, 1, 16)
    frame = harness.world.frame
    harness.run(1.0)
    assert harness.world.frame == frame
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    assert replay(client, PLAY)
    harness.run(1.0)
    assert process(client) == (1, 1, 1)
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
    assert process(client) == (1, 1, 1)


# Recordings that take their time


def test_answer_waits_for_the_recording_and_others_are_refused_meanwhile(tape: Tape) -> None:
    harness = SimHarness("parked", start="sync", recordings=tape)
    client, other = harness.client(), harness.client()
    answers: list[Any] = []
    request: dict[str, object] = {
        "request": {"sim_process_status": PLAY, "replay_option": FILE, "rosbag_file_name": "drive"}
    }
    tape.is_slow = True
    try:
        harness.bus.call(client, "/Morai_SimProc", request, answers.append, now=100.0)
        assert not replay(other, PLAY)
        assert other.told == [("error", "/Morai_SimProc: a recording is being read")]
        assert not answers
        tape.deliver()
        assert answers.pop().is_ok
        assert harness.node.scene.is_replaying
        harness.bus.call(client, "/Morai_SimProc", request, answers.append, now=100.0)
        assert client.call("/sim/reset", {"seed": -1}).is_ok
        assert answers.pop().values == "The simulation was reset"
        harness.bus.call(client, "/Morai_SimProc", request, answers.append, now=100.0)
        client.leave()
        tape.deliver()
        assert not answers
        assert not harness.node.scene.is_replaying
        assert replay(other, PLAY)
    finally:
        tape.is_slow = False


# ReplayInfo


def test_it_is_told_while_a_bag_is_replayed(harness: SimHarness, client: Client, tape: Tape) -> None:
    client.listen(INFO)
    client.tick()
    client.heard.clear()
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(3):
        client.tick()
    info = client.messages(INFO)[-1]
    recorded = ego_values(tape)[2]
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
def test_a_drive_is_told_to_who_listens_to_it_and_to_all_if_that_is_wanted(tape: Tape, *, is_for_all: bool) -> None:
    harness = SimHarness(start="sync", recordings=tape, replay_info=is_for_all)
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


def test_nothing_is_told_of_a_drive_that_follows_somebodys_messages(client: Client, harness: SimHarness) -> None:
    client.listen(INFO)
    other = harness.client()
    other.send(INFO, "morai_msgs/ReplayInfo", ego_acc=1.0)
    assert harness.node.scene.is_replaying
    client.heard.clear()
    client.tick()
    assert not client.heard


def test_recording_of_a_drives_replay_info_alone_is_replayed(tape: Tape) -> None:
    harness = SimHarness(start="sync", recordings=tape)
    client = harness.client()
    client.start()
    tape.record(harness.bus, "driven", INFO)
    client.listen("/Object_topic")
    steer_frames(client, 30)
    driven = [
        [(one["unique_id"], one["position"], one["heading"]) for one in message["npc_list"]]
        for message in client.messages("/Object_topic")
    ]
    harness = SimHarness("parked", start="sync", recordings=tape)
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


def test_messages_of_a_drive_that_a_far_bridge_gives_back_late_are_not_followed(
    harness: SimHarness, client: Client
) -> None:
    bridge = harness.client()
    bridge.listen(INFO)
    for _ in range(500):
        client.tick()
    echoes = bridge.messages(INFO)
    assert len(echoes) == 500
    for echo in (echoes[0], echoes[250], echoes[-1]):
        bridge.send(INFO, "morai_msgs/ReplayInfo", **echo)
    assert not harness.node.scene.is_replaying
    assert not bridge.told


def test_what_was_said_is_not_remembered_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rosbridge_sim.morai.replays.replay_info.MAX_ECHOES", 5)
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


def test_what_a_far_bridge_gives_back_is_not_replayed(harness: SimHarness, client: Client) -> None:
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


def test_car_that_drives_itself_goes_on_after_a_replay(tape: Tape) -> None:
    ways = []
    for is_replaying in (False, True):
        harness = SimHarness("elsewhere", start="sync", recordings=tape)
        client = harness.client()
        client.start()
        assert client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=6)["ctrl_mode"] == 6
        for _ in range(25):
            client.tick()
        if is_replaying:
            assert replay(client, PLAY, FILE, "drive")
            for i in range(5):
                status = client.tick()["vehicle_status"]
                assert status["position"]["x"] == ego_values(tape)[i].position.x
            assert replay(client, STOP)
        ways.append([client.tick()["vehicle_status"]["position"] for _ in range(10)])
    assert ways[0] == ways[1]


def test_recording_of_it_alone_moves_objects_and_pedals(client: Client, tape: Tape) -> None:
    client.listen("/Object_topic")
    place = client.tick()["vehicle_status"]["position"]
    client.heard.clear()
    assert replay(client, PLAY, FILE, "told")
    note = "it holds no position of the ego: objects and pedals are replayed"
    assert client.told == [("info", f"told: {note}")]
    statuses = [client.tick()["vehicle_status"] for _ in range(NUM_FRAMES)]
    recorded = ego_values(tape)
    assert all(status["position"] == place for status in statuses)
    assert [status["accel"] for status in statuses] == pytest.approx([value.accel for value in recorded])
    assert [status["wheel_angle"] for status in statuses] == pytest.approx([value.wheel_angle for value in recorded])
    assert [status["heading"] for status in statuses] == pytest.approx([value.heading for value in recorded])
    last = client.messages("/Object_topic")[-1]
    then = [value for topic, value, _ in tape.takes["drive"] if topic == "/Object_topic"][-1]
    assert last["npc_list"][0]["velocity"]["x"] == then.npc_list[0].velocity.x
    assert last["npc_list"][0]["position"]["x"] == then.npc_list[0].position.x


def told_messages(tape: Tape) -> list[dict[str, Any]]:
    """What a client publishes who plays such a bag himself."""
    infos = []
    for topic, value, _ in tape.takes["told"]:
        assert topic == INFO
        npcs = [
            {
                "unique_id": one.unique_id,
                "name": one.name,
                "heading": one.heading,
                "velocity": {"x": one.velocity.x},
                "size": {"x": one.size.x, "y": one.size.y, "z": one.size.z},
                "position": {"x": one.position.x, "y": one.position.y},
            }
            for one in value.npc_list
        ]
        infos.append({"ego_acc": value.ego_acc, "ego_steer": value.ego_steer, "npc_list": npcs})
    return infos


def test_world_follows_who_replays_over_the_network(harness: SimHarness, client: Client, tape: Tape) -> None:
    player, other = harness.client(), harness.client()
    client.listen("/Object_topic", STATUS, INFO)
    for info in told_messages(tape)[:5]:
        player.send(INFO, "morai_msgs/ReplayInfo", **info)
        status = client.tick()["vehicle_status"]
        assert status["accel"] == pytest.approx(info["ego_acc"], abs=1e-6)
        assert status["position"]["x"] == -5.0
        shown = client.messages("/Object_topic")[-1]["npc_list"]
        assert [npc["position"]["x"] for npc in shown] == [npc["position"]["x"] for npc in info["npc_list"]]
    assert process(client) == (0, 16, 1)
    assert len(client.messages(INFO)) == 5, "the player's own"
    other.send(INFO, "morai_msgs/ReplayInfo", **info)
    assert other.told == [("warning", f"{INFO} is ignored: another client replays already")]
    assert not replay(other, PLAY, START, start_time=1)
    player.leave()
    client.tick()
    assert process(client) == (16, 1, 1)
    assert not client.messages("/Object_topic")[-1]["npc_list"]


def test_player_who_was_stopped_begins_anew_to_be_heard(harness: SimHarness, client: Client, tape: Tape) -> None:
    player = harness.client()
    infos = told_messages(tape)
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


def test_names_of_ones_own_are_kept_to(tape: Tape) -> None:
    network = {
        "publishers": {INFO: {"on": False}, STATUS: {"name": "/state"}},
        "subscribers": {INFO: {"name": "/told"}, "/ego_setting": {"name": "/put"}},
        "services": {"/Morai_SimProc": {"name": "/steer"}},
    }
    harness = SimHarness("parked", start="sync", recordings=tape, network=network)
    client, player = harness.client(), harness.client()
    client.start()
    client.listen("/state")
    player.send("/told", "morai_msgs/ReplayInfo", **told_messages(tape)[0])
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


def test_bag_goes_before_the_network(harness: SimHarness, client: Client, tape: Tape) -> None:
    player = harness.client()
    infos = told_messages(tape)
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[0])
    assert replay(client, PLAY, FILE, "drive")
    player.send(INFO, "morai_msgs/ReplayInfo", **infos[1])
    assert player.told == [("warning", f"{INFO} is ignored: a bag is replayed already")]
    assert replay(client, STOP)
    assert not harness.node.scene.is_replaying


def test_figure_that_is_none_is_told_to_its_sender(harness: SimHarness) -> None:
    player = harness.client()
    infos: list[dict[str, Any]] = [
        {"ego_acc": math.nan},
        {"angular_velocity": {"z": math.nan}},
        {"angular_velocity": {"z": 1e300}},
        {"npc_list": [{"name": "Bus", "position": {"x": math.inf}}]},
    ]
    for info in infos:
        with pytest.raises(FieldError, match="hold no numbers"):
            player.send(INFO, "morai_msgs/ReplayInfo", **info)
    assert not harness.node.scene.is_replaying


@pytest.mark.parametrize("num", [MAX_ENTITIES + 1, MAX_RECORDED_ENTRIES + 1])
def test_a_message_of_more_objects_than_the_world_holds_is_refused(num: int) -> None:
    harness = SimHarness()
    topic = harness.bus.advertise(harness.client(), INFO, "morai_msgs/ReplayInfo")
    value: Any = topic.type.check({"npc_list": [{}]}, 0)
    value.npc_list *= num
    before = harness.world.digest()
    with pytest.raises(FieldError, match=f"{INFO}: the world holds 20,000 at most, got {num:,} objects"):
        harness.bus.publish(harness.client(), topic, Message(topic.type, value), 0.0)
    assert harness.world.digest() == before

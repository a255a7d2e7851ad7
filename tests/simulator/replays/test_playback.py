"""Replay of a bag: recorded values come out again, frame by frame; replayed entities take no commands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.morai.releases import FIELD
from rosbridge_sim.records import replace as changed
from rosbridge_sim.scenarios.catalogue import Catalogue, Model, find_model
from rosbridge_sim.simulator.replays.playback import Playback
from rosbridge_sim.simulator.replays.recorded_drive import EGO_COLUMNS, EgoTrack, Recording
from rosbridge_sim.world.state.world import Body, Kind
from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import (
    EGO,
    FILE,
    NUM_FRAMES,
    PAUSE,
    PEDESTRIANS,
    PLAY,
    SPEED,
    START,
    STATUS,
    STOP,
    TARGETS,
    VEHICLES,
    bodies,
    ego_values,
    replay,
    shown_x,
    steer_frames,
)
from tests.simulator.sim_harness import ALL, Client, SimHarness, put_egos


def drive_and_replay(release: str, **settings: Any) -> tuple[list[Any], list[Any]]:  # noqa: ANN401 - NodeSettings'
    recordings = MemoryRecordings()
    topics = ("/Ego_topic", "/Object_topic", "/CollisionData", "/VehicleCollisionData")
    heard = []
    for scenario in ("crowd", "parked"):
        harness = SimHarness(scenario, start="sync", release=release, recordings=recordings, **settings)
        client = harness.client()
        client.start()
        client.listen(*topics)
        if scenario == "crowd":
            recordings.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
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
def test_replayed_drive_equals_the_recorded_one_to_the_last_bit(release: str, settings: dict[str, Any]) -> None:
    first, again = drive_and_replay(release, **settings)
    assert len(first[0]) == NUM_FRAMES
    assert len({str(message) for message in first[0]}) == NUM_FRAMES, "the ego moved"
    assert any(message["collision_object"] for message in first[2]), "and hit something"
    assert again == first


def test_recorded_model_of_the_users_catalogue_keeps_its_proportions() -> None:
    lorry = Model(
        "Lorry", Kind.VEHICLE, changed(Body(), length=9.0, wheelbase=5.0, front_overhang=1.0, rear_overhang=3.0)
    )
    recordings = MemoryRecordings()
    settings: dict[str, Any] = {"start": "sync", "recordings": recordings, "catalogue": Catalogue([lorry])}
    recording = SimHarness("parked", **settings)
    client = recording.client()
    client.start()
    recordings.record(recording.bus, "drive", "/Ego_topic", "/Object_topic")
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


def test_objects_appear_and_disappear_under_their_recorded_ids(
    client: Client, harness: SimHarness, recordings: MemoryRecordings
) -> None:
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
        for topic, value, _ in recordings.messages["drive"]
        if topic == "/Object_topic"
    ]
    assert box == recorded
    assert box[0] != box[-1]
    assert harness.world.frame == NUM_FRAMES


def test_start_time_and_speed_choose_frames(client: Client, recordings: MemoryRecordings) -> None:
    client.listen("/Ego_topic")
    recorded = [value.position.x for value in ego_values(recordings)]
    assert replay(client, PLAY, FILE | START | SPEED, "drive", start_time=200, replay_speed=3)
    for _ in range(5):
        client.tick()
    assert shown_x(client) == recorded[10:25:3]
    assert replay(client, PLAY, START, start_time=40)
    assert replay(client, PLAY, SPEED, replay_speed=1)
    for _ in range(3):
        client.tick()
    assert shown_x(client)[5:] == recorded[2:5]


def test_real_time_shows_the_same_frames(recordings: MemoryRecordings) -> None:
    harness = SimHarness("parked", recordings=recordings)
    client = harness.client()
    client.listen("/Ego_topic")
    assert replay(client, PLAY, FILE, "drive")
    harness.run(5.0)
    recorded = [value.position.x for value in ego_values(recordings)]
    assert shown_x(client)[: len(recorded)] == recorded
    assert harness.node.sync.is_paused, "at the end"
    assert set(shown_x(client)[len(recorded) :]) <= {recorded[-1]}, "the last frame is shown again in the pause"


def test_end_of_a_bag_pauses_until_play_or_stop(client: Client, harness: SimHarness) -> None:
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


def test_play_stays_in_force_when_a_scenario_ends_a_replay_that_began_paused(client: Client) -> None:
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert replay(client, PLAY, FILE, "drive")
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL)["result"]
    assert client.tick()["tick_status"]


def test_recording_loaded_in_pause_shows_its_first_frame(client: Client, recordings: MemoryRecordings) -> None:
    first = ego_values(recordings)[0]
    assert replay(client, PAUSE, FILE, "drive")
    answer = client.tick()
    assert (answer["tick_status"], answer["pause_status"]) == (False, True)
    assert answer["vehicle_status"]["position"]["x"] == first.position.x
    assert replay(client, PLAY)
    answer = client.tick()
    assert answer["tick_status"]
    assert answer["vehicle_status"]["position"]["x"] == first.position.x


def test_stop_restores_the_world() -> None:
    positions = []
    for is_replaying in (False, True):
        recordings = MemoryRecordings()
        harness = SimHarness(start="sync", recordings=recordings)
        client = harness.client()
        client.start()
        recordings.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
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


def test_replay_leaves_no_trace_in_scores_and_those_begun_meanwhile_begin_anew(
    client: Client, harness: SimHarness
) -> None:
    replay(client, PLAY, FILE, "drive")
    client.call("/sim/score", {"reset": False})
    for _ in range(5):
        client.tick()
    assert harness.world.score_distance[0] > 0.0
    replay(client, STOP)
    assert harness.world.is_scoring
    assert harness.world.score_distance[0] == 0.0
    assert harness.world.score_since[0] == harness.world.frame


def test_replay_of_vehicles_only_leaves_the_ego_to_its_driver(recordings: MemoryRecordings) -> None:
    harness = SimHarness(start="sync", recordings=recordings)
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
    recorded = [value for topic, value, _ in recordings.messages["drive"] if topic == "/Object_topic"][19]
    assert [npc["position"]["x"] for npc in last["npc_list"]] == [npc.position.x for npc in recorded.npc_list]
    assert [person["unique_id"] for person in last["pedestrian_list"]] == [9], "of the scenario, and on its own way"
    assert replay(client, PLAY, TARGETS, replay_target_option=EGO)
    assert client.tick()["vehicle_status"]["position"]["x"] == ego_values(recordings)[20].position.x


@pytest.mark.parametrize(
    ("option", "fields"),
    [(SPEED, {"replay_speed": 2}), (TARGETS, {"replay_target_option": VEHICLES | PEDESTRIANS})],
    ids=["speed", "targets"],
)
def test_ego_left_to_its_driver_drives_on_through_later_commands(
    recordings: MemoryRecordings, option: int, fields: dict[str, int]
) -> None:
    harness = SimHarness(start="sync", recordings=recordings)
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


def test_many_missing_egos_are_told_in_few_lines(harness: SimHarness) -> None:
    context = harness.node.context
    track = EgoTrack(np.zeros(1, dtype=np.int64), np.zeros((len(EGO_COLUMNS), 1)))
    playback = Playback(context.world, context.scene, context.egos)
    notes = playback.notes_on(Recording("many", dict.fromkeys(range(100), track)), EGO)
    assert notes[0] == "it holds an ego 1, but the world has none with this number: it is left out"
    assert (len(notes), notes[-1]) == (11, "so are 89 more egos")


def test_missing_ego_of_a_recording_is_reported_to_the_caller(
    harness: SimHarness, client: Client, recordings: MemoryRecordings
) -> None:
    recordings.messages["two"] = recordings.messages["drive"] + [
        ("/Ego-2/Ego_topic", value, stamp)
        for topic, value, stamp in recordings.messages["drive"]
        if topic == "/Ego_topic"
    ]
    assert replay(client, PLAY, FILE, "two")
    assert client.told == [("info", "two: it holds an ego 2, but the world has none with this number: it is left out")]
    assert replay(client, STOP)
    client.told.clear()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    assert replay(client, PLAY, FILE, "two")
    client.tick()
    world, (first, second) = harness.world, harness.node.egos
    assert world.x[first.row] == world.x[second.row]
    assert client.told == []


def test_commands_to_replayed_egos_are_ignored_with_one_warning(recordings: MemoryRecordings) -> None:
    harness = SimHarness("parked", recordings=recordings)
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
        ("warning", f"{topic} is ignored while a recording {what}")
        for topic, what in (
            ("/NpcGhost_Topic", "is replayed"),
            ("/ctrl_cmd", "moves ego 0"),
            ("/ego_setting", "is replayed"),
            ("/ghost_ctrl_cmd", "moves ego 0"),
        )
    ]
    assert client.ask("/Service_MoraiEventCmd", option=3, ctrl_mode=1, gear=2)["gear"] != 2
    harness.run(0.2)
    assert len(harness.node.egos) == 1
    assert harness.world.is_ghost[harness.node.egos[0].row]


def test_objects_cannot_be_added_or_removed_during_a_replay(client: Client, harness: SimHarness) -> None:
    assert replay(client, PLAY, FILE, "drive")
    client.control(0, longlCmdType=1, accel=1.0)
    client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=7, frame=0)
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Box", position={"x": 1.0}, frame=0)
    num = len(harness.world)
    client.tick()
    assert len(harness.world) == num
    assert ("error", "/SyncModeRemoveObj: refused while a recording is replayed") in client.told
    assert ("error", "/SyncModeAddObj: refused while a recording is replayed") in client.told
    assert ("warning", "/SyncModeCtrlCmd moves nothing while a recording moves ego 0") in client.told


@pytest.mark.parametrize("how", ["reset", "load"])
def test_reset_and_scenario_load_end_a_replay(how: str, recordings: MemoryRecordings) -> None:
    harness = SimHarness("parked", recordings=recordings)
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


def test_self_driving_ego_goes_on_after_a_replay(recordings: MemoryRecordings) -> None:
    ways = []
    for is_replaying in (False, True):
        harness = SimHarness("elsewhere", start="sync", recordings=recordings)
        client = harness.client()
        client.start()
        assert client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=6)["ctrl_mode"] == 6
        for _ in range(25):
            client.tick()
        if is_replaying:
            assert replay(client, PLAY, FILE, "drive")
            for i in range(5):
                status = client.tick()["vehicle_status"]
                assert status["position"]["x"] == ego_values(recordings)[i].position.x
            assert replay(client, STOP)
        ways.append([client.tick()["vehicle_status"]["position"] for _ in range(10)])
    assert ways[0] == ways[1]

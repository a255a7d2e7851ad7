"""Snapshots: what comes back, who may restore, what is refused, and what stays."""

from __future__ import annotations

import json
from collections.abc import Callable
from hashlib import blake2b
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Answer, Topic
from rosbridge_sim.records import replace
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.plain.snapshot_bytes import CHECKSUM_SIZE, MAGIC, SnapshotHead, unpack
from rosbridge_sim.simulator.snapshots import kept_snapshots
from rosbridge_sim.world.state.entity_arrays import FLOATS, INTS
from rosbridge_sim.world.state.world import Dynamics
from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.replays.replay_harness import FILE, INFO, PLAY, STOP, replay, replay_info_messages, steer_frames
from tests.simulator.sim_harness import ALL, Client, ManualReader, SimHarness, put_egos
from tests.simulator.sim_services.snapshot_fixture import HEARD, call, forge, hash_of, hear, restore, snapshot

BOX = {"name": "Box", "position": {"x": 10.0, "y": 24.5, "z": 0.0}, "heading": 5.0}


def in_sync(scenario: str = "crowd", **settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - as SimHarness
    harness = SimHarness(scenario, start="sync", **settings)
    client = harness.client()
    client.start()
    return harness, client


def run_on(client: Client, listener: Client, num: int = 30) -> list[bytes]:
    """Tick; the bytes on all topics, and the answers."""
    listener.raw.clear()
    answers = [client.tick() for _ in range(num)]
    return [*listener.raw, json.dumps(answers).encode()]


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_same_calls_after_a_restore_give_the_same_bytes(release: str) -> None:
    harness, client = in_sync("crossing", release=release)
    listener = hear(harness)
    for _ in range(20):
        client.tick()
    client.send("/SetTrafficLight", "morai_msgs/SetTrafficLight", trafficLightIndex="C1", trafficLightStatus=16)
    client.send("/lamps", "morai_msgs/Lamps", turnSignal=1, emergencySignal=1)
    pose: dict[str, Any] = {"sensor_index": [0], **{f"pose_{axis}": [1.5] for axis in "xyz"}}
    client.send("/SensorPosControl", "morai_msgs/SensorPosControl", **pose, roll=[0.0], pitch=[0.0], yaw=[0.1])
    client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=6)
    client.control(45, longlCmdType=2, velocity=40.0, steering=0.1)
    saved, before = snapshot(client, "here"), hash_of(client)
    assert saved.state_hash == before
    first, after = run_on(client, listener), hash_of(client)
    for which in ("here", bytes(saved.data)):
        client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
        client.tick()
        response = restore(client, which)
        assert (response.result, response.frame, response.state_hash) == (True, saved.frame, before)
        assert hash_of(client) == before
        assert run_on(client, listener) == first
        assert hash_of(client) == after


def test_snapshot_restores_into_another_simulator_with_another_scene() -> None:
    harness, client = in_sync("crowd")
    listener = hear(harness)
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5, 3))
    client.control(30, longlCmdType=1, accel=1.0)
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", **BOX, frame=20)
    client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=7, frame=25)
    client.ask("/SyncModeSetGear", frame=28, gear=4)
    client.ask("/SyncModeScenarioLoad", frame=35, file_name="crossing", **ALL)
    for _ in range(10):
        client.tick()
    saved = snapshot(client)
    first, after = run_on(client, listener), hash_of(client)
    other, other_client = in_sync("elsewhere")
    other_listener = hear(other)
    other_client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 9, 3))
    assert restore(other_client, bytes(saved.data)).result
    assert other.shelf.num_maps_read > 1
    assert [ego.index for ego in other.node.egos] == [0, 5, 3]
    assert {"/Ego-5/Ego_topic", "/Ego-3/Ego_topic"} <= set(other.bus.topics)
    assert not other.bus.topics["/Ego-9/Ego_topic"].publishers
    assert "/Ego-9/SyncModeWaitForTick" not in other.bus.services
    assert run_on(other_client, other_listener) == first
    assert hash_of(other_client) == after
    assert {uid for uid in range(10) if uid in other.world} == {uid for uid in range(10) if uid in harness.world}


def test_hash_is_equal_exactly_when_the_state_is() -> None:
    client = in_sync()[1]
    twin = in_sync()[1]
    assert hash_of(client) == hash_of(twin)
    seen = {hash_of(client)}
    steps: list[Callable[[], object]] = [
        client.tick,
        lambda: client.send("/lamps", "morai_msgs/Lamps", turnSignal=1, emergencySignal=0),
        lambda: client.control(9, longlCmdType=1, accel=0.5),
        lambda: client.control(9, longlCmdType=1, accel=0.6),
        lambda: client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=1),
        lambda: client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2)),
        lambda: client.ask("/Service_MoraiSL", file_name="parked", **ALL),
    ]
    for i, act in enumerate(steps, 2):
        act()
        seen.add(hash_of(client))
        assert len(seen) == i
    assert hash_of(client) in seen, "asking changes nothing"


@pytest.mark.parametrize("start", ["run", "sync"])
def test_hash_goes_out_behind_each_frame_and_equals_that_of_the_service(start: str) -> None:
    harness = SimHarness(start=start)
    client, listener = harness.client(), harness.client()
    listener.listen("/SyncModeInfo", "/sim/state_hash")
    if start == "sync":
        client.start()
        client.tick()
    else:
        harness.run(0.021)
    assert [name for name, _ in listener.heard][-2:] == ["/SyncModeInfo", "/sim/state_hash"]
    last = listener.messages("/sim/state_hash")[-1]
    assert (last["frame"], last["header"]["seq"], last["hash"]) == (1, 1, hash_of(client))
    assert len(listener.messages("/sim/state_hash")) == 1


def test_hash_is_not_made_for_those_that_take_all_topics() -> None:
    harness, client = in_sync()
    heard: list[object] = []
    harness.bus.subscribe(harness.client(), "/sim/state_hash", lambda *message: heard.append(message), is_general=True)
    client.tick()
    assert heard == []


# Who may, and when


def test_only_the_master_restores_in_synchronous_mode() -> None:
    harness, client = in_sync()
    saved = snapshot(client, "a")
    client.tick()
    other = harness.client()
    response = restore(other, "a", user_id="somebody")
    assert (response.result, response.frame, response.message) == (False, 1, "another user id is the master: 'me'")
    assert ("warning", f"/sim/restore: {response.message}") in other.told
    assert restore(other, "a", user_id="me").frame == saved.frame
    client.stop()
    assert restore(other, "a", user_id="").result, "in real time every client may"


def test_nobody_restores_while_nobody_is_master() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    snapshot(client, "a")
    assert "there is no master" in restore(client, "a", user_id="").message


def test_mode_master_pause_and_subscriptions_stay() -> None:
    harness, client = in_sync()
    snapshot(client, "a")
    client.tick()
    client.start(time_step=60)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    client.listen("/SyncModeInfo", "/Ego_topic")
    assert restore(client, "a").result
    info = client.messages("/SyncModeInfo")[-1]
    assert info == {"master_id": "me", "status": True, "frame": 0, "can_send_tick": False}
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    client.tick()
    assert [one["header"]["seq"] for one in client.messages("/Ego_topic")] == [1, 2, 3]
    assert harness.node.sync.master_id == "me"


@pytest.mark.parametrize("start", ["run", "sync"])
def test_restore_and_snapshot_from_within_a_frame_are_refused(start: str) -> None:
    harness = SimHarness(start=start)
    client = harness.client()
    snapshot(client, "a")
    answers: list[Answer] = []

    def ask(_topic: Topic, _message: Message, _sender: Participant, now: float) -> None:
        for service, args in (("/sim/restore", {"id": "a", "user_id": "me"}), ("/sim/snapshot", {})):
            harness.bus.call(client, service, args, answers.append, now=now)

    harness.bus.subscribe(client, "/clock", ask)
    if start == "sync":
        client.start()
        client.tick()
    else:
        harness.run(0.021)
    responses = [answer.values.value for answer in answers if isinstance(answer.values, Message)]
    assert [(one.result, "the world is moving" in one.message) for one in responses] == [(False, True)] * 2
    assert harness.world.frame == 1


def test_snapshot_waits_for_a_scenario_that_is_being_read() -> None:
    reader = ManualReader()
    harness, client = in_sync(reader=reader)
    snapshot(client, "a")
    held: list[Answer] = []
    request = {"request": {"frame": 3, "file_name": "parked", **ALL}}
    harness.bus.call(harness.client(), "/SyncModeScenarioLoad", request, held.append, now=0.0)
    assert "a scenario is being read" in call(client, "/sim/snapshot").message
    assert restore(client, "a").result, "what is being read was meant for another world"
    reader.hand_over()
    assert len(held) == 1
    for _ in range(5):
        client.tick()
    assert 7 in harness.world, "it was not loaded"


def test_load_that_is_being_read_fails_when_the_simulator_is_restored() -> None:
    reader = ManualReader()
    harness, client = in_sync(reader=reader)
    snapshot(client, "a")
    answers: list[Answer] = []
    request = {"request": {"file_name": "parked", **ALL}}
    harness.bus.call(harness.client(), "/Service_MoraiSL", request, answers.append, now=0.0)
    restore(client, "a")
    reader.hand_over()
    assert isinstance(answers[0].values, Message)
    assert json.loads(answers[0].values.json) == {"response": {"result": False}}
    assert 7 in harness.world


# Names, room


def test_list_shows_what_is_kept_and_removes() -> None:
    _, client = in_sync()
    assert call(client, "/sim/snapshot").id == "snapshot-1"
    client.tick()
    assert call(client, "/sim/snapshot", id="mine").frame == 1
    assert call(client, "/sim/snapshot").id == "snapshot-2"
    listed = call(client, "/sim/snapshots")
    assert [(one.id, one.frame) for one in listed.snapshots] == [("snapshot-1", 0), ("mine", 1), ("snapshot-2", 1)]
    assert listed.room == kept_snapshots.MAX_BYTES - sum(one.size for one in listed.snapshots)
    refused = call(client, "/sim/snapshots", remove=["mine", "other"])
    assert (refused.result, len(refused.snapshots)) == (False, 3)
    assert "no snapshot 'other'" in refused.message
    left = call(client, "/sim/snapshots", remove=["snapshot-1", "mine", "mine"])
    assert [one.id for one in left.snapshots] == ["snapshot-2"]
    assert "no snapshot 'mine'; known are snapshot-2" in restore(client, "mine").message


def test_snapshot_of_a_taken_name_replaces_the_old_one() -> None:
    harness, client = in_sync()
    call(client, "/sim/snapshot", id="a")
    client.tick()
    call(client, "/sim/snapshot", id="a")
    (kept,) = call(client, "/sim/snapshots").snapshots
    assert kept.frame == 1
    assert harness.bus.total.num_bytes == kept.size, "the memory budget counts what is kept"
    call(client, "/sim/snapshots", remove=["a"])
    assert harness.bus.total.num_bytes == 0


def test_no_more_than_so_many_snapshots_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    _, client = in_sync()
    monkeypatch.setattr(kept_snapshots, "MAX_SNAPSHOTS", 2)
    for name in "ab":
        call(client, "/sim/snapshot", id=name)
    refused = call(client, "/sim/snapshot", id="c")
    assert (refused.result, refused.id) == (False, "")
    assert "remove some by /sim/snapshots" in refused.message
    assert call(client, "/sim/snapshot", id="b").result, "the place of an old one is free"


def test_no_more_than_so_many_bytes_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    _, client = in_sync()
    size = call(client, "/sim/snapshot", id="a").size
    monkeypatch.setattr(kept_snapshots, "MAX_BYTES", 2 * size - 1)
    refused = call(client, "/sim/snapshot", id="b")
    assert not refused.result
    assert "remove some by /sim/snapshots" in refused.message
    assert call(client, "/sim/snapshot", id="a").result


@pytest.mark.parametrize("name", ["x" * 201, "line\nbreak", "\x1b[31m"], ids=["long", "line", "escape"])
def test_name_that_no_terminal_can_show_is_refused(name: str) -> None:
    _, client = in_sync()
    assert "printable" in call(client, "/sim/snapshot", id=name).message


def test_restore_takes_either_a_name_or_bytes() -> None:
    _, client = in_sync()
    saved = snapshot(client, "a")
    for args in ({}, {"id": "a", "data": bytes(saved.data)}):
        response = call(client, "/sim/restore", user_id="me", **args)
        assert (response.result, response.message) == (False, "expected either id or data")


# Bytes from outside


@pytest.fixture(scope="module")
def saved() -> bytes:
    """A snapshot with lanes, paths, lights, two egos and commands."""
    _, client = in_sync("crossing")
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    client.send("/NpcGhost_Topic", "morai_msgs/NpcGhostCmd", npc_list=[{"unique_id": 99, "name": "Van"}])
    client.control(30, longlCmdType=1, accel=1.0)
    client.ask("/SyncModeScenarioLoad", frame=35, file_name="crowd", **ALL)
    for _ in range(5):
        client.tick()
    return bytes(snapshot(client).data)


@pytest.fixture(scope="module")
def target() -> tuple[SimHarness, Client]:
    """The simulator that all of these bytes are sent to: none of them may change it."""
    return in_sync("crossing")


def refuse(target: tuple[SimHarness, Client], data: bytes) -> str:
    """Why bytes are refused; the state is as before, and the simulator goes on."""
    harness, client = target
    before = hash_of(client)
    response = restore(client, data)
    assert not response.result
    assert response.message
    assert hash_of(client) == before
    assert [ego.index for ego in harness.node.egos] == [0]
    assert client.tick()["tick_status"]
    message: str = response.message
    return message


def test_bytes_that_are_no_snapshot_are_refused(target: tuple[SimHarness, Client], saved: bytes) -> None:
    assert "expected a snapshot" in refuse(target, b"x")
    assert "cut off" in refuse(target, MAGIC)
    assert "cut off" in refuse(target, saved[:-1])
    assert "damaged" in refuse(target, saved + b"x")
    version = bytearray(saved)
    version[len(MAGIC)] = 9
    assert "version 9" in refuse(target, bytes(version))


def test_any_changed_byte_is_noticed(target: tuple[SimHarness, Client], saved: bytes) -> None:
    for at in range(0, len(saved), max(1, len(saved) // 60)):
        changed = bytearray(saved)
        changed[at] ^= 0x10
        assert refuse(target, bytes(changed))


def change_head(**fields: object) -> Callable[[SnapshotHead, Any], SnapshotHead]:
    return lambda head, _state: replace(head, **fields)


def put(*path: Any) -> Callable[[SnapshotHead, Any], None]:  # noqa: ANN401 - keys, places and a value
    """Put the last argument at the path of the others."""
    *way, last, value = path

    def change(_head: SnapshotHead, state: Any) -> None:  # noqa: ANN401 - plain data
        for key in way:
            state = state[key]
        state[last] = value

    return change


X, LANE, KIND, UID = FLOATS.index("x"), INTS.index("lane"), INTS.index("kind"), INTS.index("uid")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (change_head(layout=b"other"), "another version"),
        (change_head(definitions=b"other"), "another release"),
        (change_head(profile="other"), "other units"),
        (change_head(dynamics="other"), "was made with 'other'; here it is '--dynamics kinematic'"),
        (change_head(maps=(("nowhere", b"x"),)), "no map 'nowhere'"),
        (change_head(maps=(("tiny", b"x"),)), "another one than that of the snapshot"),
        (change_head(maps=(("hills", b"x"),)), "another one than that of the snapshot"),
        (change_head(maps=()), "maps"),
        (change_head(recording=("drive", b"x")), "no recordings are kept here"),
        (change_head(state_hash="0" * 32), "another state"),
        (change_head(frame=-1), "frame"),
        (put("map", ("tiny", b"x")), "not among those"),
        (put("map", 3), "map"),
        (put("world", None), "world"),
        (put("world", "floats", 3.0), "world.floats"),
        (put("world", "floats", (X, 0), np.nan), "world.floats"),
        (put("world", "floats", (X, 0), np.inf), "world.floats.x"),
        (put("world", "floats", (X, 0), 1e12), "world.floats.x"),
        (put("world", "floats", (FLOATS.index("speed"), 0), 1e6), "world.floats.speed: expected a figure within"),
        (put("world", "floats", (FLOATS.index("grip"), 0), 0.0), "world.floats.grip"),
        (put("world", "floats", (FLOATS.index("front_load"), 0), 1.5), "world.floats.front_load"),
        (put("world", "dynamics", 7), "world.dynamics"),
        (put("world", "is_creeping", 2), "world.is_creeping"),
        (put("world", "has_impacts", 2), "world.has_impacts"),
        (put("world", "passing", np.zeros((1, 3), dtype=np.int64)), "world.passing"),
        (put("world", "passing", np.full((1, 2), 1234, dtype=np.int64)), "world.passing"),
        (put("world", "placed_uids", np.full(1, 1234, dtype=np.int64)), "world.placed_uids"),
        (put("world", "floats", (FLOATS.index("loose"), 0), 1.0), "world.has_impacts"),
        (put("world", "ints", (LANE, slice(None)), 10_000), "world.ints.lane"),
        (put("world", "ints", (KIND, 0), 9), "world.ints.kind"),
        (put("world", "ints", (KIND, 0), 1), "egos"),
        (put("world", "ints", (UID, 0), 77), "world.uids"),
        (put("world", "ints", np.zeros((3, 3), dtype=np.int64)), "world.ints"),
        (put("world", "names", [3]), "world.names"),
        (put("world", "name_of", np.full(5, 9, dtype=np.int64)), "world.name_of"),
        (put("world", "bodies", (0, 0), -1.0), "Body.length"),
        (put("world", "frame", -1), "world.frame"),
        (put("world", "frame", True), "world.frame"),  # noqa: FBT003 - a wrong value
        (put("world", "next_uid", 0), "world.uids"),
        (put("world", "contacts", np.full((1, 2), 1234, dtype=np.int64)), "world.contacts"),
        (put("world", "origin", np.zeros(7, dtype=np.int64)), "world.origin"),
        (put("world", "routes", {1234: np.zeros(1, dtype=np.int64)}), "world.routes"),
        (put("world", "spans", np.zeros((1, 3), dtype=np.int64)), "world"),
        (put("next_uid", 0), "an id to go on with"),
        (put("next_uid", 99), "another state"),
        (put("egos", ()), "egos"),
        (put("egos", 0, "uid", 5), "egos"),
        (put("egos", 1, "index", 1), "egos"),
        (put("egos", 1, "index", 0), "egos"),
        (put("egos", 0, "ctrl_mode", 77), "egos"),
        (put("egos", 0, "lamps", (9, 9)), "egos"),
        (put("egos", 0, "mountings", ()), "egos"),
        (put("egos", 0, "odom_origin", (1e300, 0.0, 0.0, 0.0)), "egos"),
        (put("waiting", 0, (5, "x", ("control", {}))), "command"),
        (put("waiting", 0, (5, "x", ("dance", {}))), "command"),
        (put("waiting", 0, (10**9, "x", ("remove", {"unique_id": 3}))), "commands"),
        (put("waiting", 0, 3), "waiting"),
        (put("loaded", b""), "load"),
        (put("loaded", (b"l", b"d")), "load"),
        (put("components", {}), "components"),
        (put("components", "CommandTopics", None), "state"),
        (put("components", "CommandTopics", (1, 2, 3, 4)), "state"),
        (put("components", "Sensors", 3), "--sensor-noise"),
        (put("components", "Scenarios", 3), "expected nothing"),
        (put("components", "Replay", None), "state"),
        (put("components", "Replay", "process", (1, False)), "recording"),
        (put("components", "Replay", "process", (9, False)), "state"),
        (put("components", "Replay", "playback", 3), "state"),
        (put("components", "Replay", "status", ("x", -1, False)), "state"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_forged_snapshot_is_refused_and_changes_nothing(
    target: tuple[SimHarness, Client], saved: bytes, change: Callable[[SnapshotHead, Any], Any], why: str
) -> None:
    def thaw(head: SnapshotHead, state: Any) -> Any:  # noqa: ANN401 - plain data
        state["egos"] = list(state["egos"])
        return change(head, state)

    assert why in refuse(target, forge(saved, thaw))


def test_snapshot_of_another_release_is_refused() -> None:
    there, here = in_sync(release="26.R1")[1], in_sync(release="22.R2")[1]
    assert "another release" in restore(here, bytes(snapshot(there).data)).message


def test_snapshot_of_another_model_is_refused() -> None:
    there = in_sync(dynamics=Dynamics.SINGLE_TRACK, is_creeping=True)[1]
    here = in_sync(dynamics=Dynamics.SINGLE_TRACK)[1]
    message = restore(here, bytes(snapshot(there).data)).message
    assert message.endswith("made with '--dynamics single-track --creep'; here it is '--dynamics single-track'")


def test_snapshot_with_impacts_is_refused_without_them() -> None:
    there, here = in_sync(has_impacts=True)[1], in_sync()[1]
    message = restore(here, bytes(snapshot(there).data)).message
    assert message.endswith("'--dynamics kinematic --on-collision impact'; here it is '--dynamics kinematic'")


def test_drive_with_tyres_goes_on_from_a_snapshot_with_the_same_bits() -> None:
    harness, client = in_sync(dynamics=Dynamics.SINGLE_TRACK)
    client.control(0, longlCmdType=2, velocity=60.0, steering=0.1)
    for _ in range(60):
        client.tick()
    data = bytes(snapshot(client).data)
    for _ in range(60):
        client.tick()
    digest = harness.world.digest()
    other_harness, other = in_sync(dynamics=Dynamics.SINGLE_TRACK)
    assert restore(other, data).result
    for _ in range(60):
        other.tick()
    assert other_harness.world.digest() == digest


def test_topic_that_a_client_has_taken_refuses_an_ego_and_changes_nothing(saved: bytes) -> None:
    harness, client = in_sync("crossing")

    class Part(Participant):
        """An owner that gives way to nobody."""

        name = "/part"

        def notify(self, level: str, text: str) -> None:
            raise AssertionError((level, text))

    harness.bus.advertise(Part(), "/Ego-2/Ego_topic", "std_msgs/String")
    before = hash_of(client)
    assert "/Ego-2/Ego_topic" in restore(client, saved).message
    assert hash_of(client) == before
    assert "/Ego-2/SyncModeWaitForTick" not in harness.bus.services


# Maps and recordings that are not at hand


def test_map_that_is_not_in_use_is_read_in_the_background(saved: bytes) -> None:
    reader = ManualReader()
    harness, client = in_sync("elsewhere", reader=reader)
    responses: list[Answer] = []
    request = {"user_id": "me", "data": saved}
    harness.bus.call(client, "/sim/restore", request, responses.append, now=0.0)
    assert client.tick()["frame"] == 1, "the others go on"
    assert "another restore waits" in restore(client, saved).message
    for _ in ("bytes", "map", "state"):
        assert responses == []
        reader.hand_over()
    assert isinstance(responses[0].values, Message)
    assert responses[0].values.value.result
    assert reader.waiting == []
    assert hash_of(client) == unpack(saved)[0].state_hash


def test_bytes_of_another_process_are_checked_in_the_background_and_own_ones_are_restored_at_once(
    saved: bytes,
) -> None:
    reader = ManualReader()
    harness, client = in_sync("crossing", reader=reader)
    own = bytes(snapshot(client, "own").data)
    client.tick()
    assert restore(client, own).result
    assert (harness.world.frame, reader.waiting) == (0, [])
    answers: list[Answer] = []
    harness.bus.call(client, "/sim/restore", {"user_id": "me", "data": saved}, answers.append, now=0.0)
    assert (answers, len(reader.waiting), harness.world.frame) == ([], 1, 0)
    reader.hand_over()
    assert client.tick()["frame"] == 1, "ticks go on while the state is checked"
    while reader.waiting:
        reader.hand_over()
    assert isinstance(answers[0].values, Message)
    assert hash_of(client) == unpack(saved)[0].state_hash


def test_own_bytes_restore_their_state_when_the_name_has_another_one_or_is_gone() -> None:
    harness, client = in_sync("crossing")
    client.control(1, longlCmdType=1, accel=1.0)
    frames = {}
    for _ in range(3):
        client.tick()
        taken = snapshot(client, "same")
        frames[bytes(taken.data)] = taken.frame, taken.state_hash
    client.call("/sim/snapshots", {"remove": ["same"]})
    for data, (frame, state_hash) in [*frames.items(), *reversed(frames.items())]:
        assert restore(client, data).result
        assert (harness.world.frame, hash_of(client)) == (frame, state_hash)


def test_own_bytes_with_one_change_are_refused_even_with_a_right_checksum() -> None:
    harness, client = in_sync("crossing")
    own = bytearray(bytes(snapshot(client, "own").data))
    client.tick()
    before = hash_of(client)
    own[len(own) // 2] ^= 1
    assert "checksum" in restore(client, bytes(own)).message
    checked = bytes(own[:-CHECKSUM_SIZE])
    forged = checked + blake2b(checked, digest_size=CHECKSUM_SIZE).digest()
    assert not restore(client, forged).result
    assert (hash_of(client), harness.world.frame) == (before, 1)


def test_restore_whose_client_has_left_meanwhile_does_nothing(saved: bytes) -> None:
    reader = ManualReader()
    harness, client = in_sync("elsewhere", reader=reader)
    leaver = harness.client()
    harness.bus.call(leaver, "/sim/restore", {"user_id": "me", "data": saved}, lambda _: None, now=0.0)
    leaver.leave()
    before = hash_of(client)
    reader.hand_over()
    assert hash_of(client) == before
    assert restore(client, bytes(snapshot(client).data)).result, "no restore waits any longer"


def test_master_that_is_lost_while_a_map_is_read_restores_nothing(saved: bytes) -> None:
    reader = ManualReader()
    harness, client = in_sync("elsewhere", reader=reader)
    other = harness.client()
    answers: list[Answer] = []
    harness.bus.call(other, "/sim/restore", {"user_id": "me", "data": saved}, answers.append, now=0.0)
    client.stop()
    client.start("another")
    reader.hand_over()
    assert isinstance(answers[0].values, Message)
    assert "another user id is the master" in answers[0].values.value.message


@pytest.fixture(scope="module")
def recordings() -> MemoryRecordings:
    recordings = MemoryRecordings()
    harness, client = in_sync(recordings=recordings)
    recordings.record(harness.bus, "drive", "/Ego_topic", "/Object_topic")
    steer_frames(client, 60)
    return recordings


def test_replay_goes_on_after_a_restore(recordings: MemoryRecordings) -> None:
    harness, client = in_sync("parked", recordings=recordings)
    listener = hear(harness)
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(25):
        client.tick()
    saved, before = snapshot(client, "a"), hash_of(client)
    shown = run_on(client, listener, 10)
    stopped = [replay(client, STOP), *run_on(client, listener, 5)]
    after = hash_of(client)
    for which in ("a", bytes(saved.data)):
        assert restore(client, which).message == ""
        assert hash_of(client) == before
        assert run_on(client, listener, 10) == shown
        assert [replay(client, STOP), *run_on(client, listener, 5)] == stopped
        assert hash_of(client) == after
    other, other_client = in_sync("crowd", recordings=recordings)
    other_listener = hear(other)
    assert restore(other_client, bytes(saved.data)).message == ""
    assert run_on(other_client, other_listener, 10) == shown
    assert [replay(other_client, STOP), *run_on(other_client, other_listener, 5)] == stopped


def test_restore_ends_a_replay_that_the_snapshot_does_not_have(recordings: MemoryRecordings) -> None:
    harness, client = in_sync("parked", recordings=recordings)
    listener = hear(harness)
    snapshot(client, "a")
    first = run_on(client, listener)
    restore(client, "a")
    assert replay(client, PLAY, FILE, "drive")
    client.tick()
    assert restore(client, "a").result
    assert not harness.node.scene.is_replaying
    assert run_on(client, listener) == first


def test_recording_that_has_changed_is_refused(recordings: MemoryRecordings) -> None:
    harness, client = in_sync("parked", recordings=recordings)
    assert replay(client, PLAY, FILE, "drive")
    data = bytes(snapshot(client).data)
    assert replay(client, STOP)
    shorter = MemoryRecordings()
    shorter.messages["drive"] = recordings.messages["drive"][:-2]
    _, other = in_sync("parked", recordings=shorter)
    assert "another one than that of the snapshot" in restore(other, data).message
    assert "no recording" in restore(in_sync("parked", recordings=MemoryRecordings())[1], data).message
    del harness


def test_network_replay_goes_on_while_its_source_publishes(recordings: MemoryRecordings) -> None:
    infos = MemoryRecordings()
    harness, client = in_sync("parked", recordings=recordings)
    infos.record(harness.bus, "info", INFO)
    assert replay(client, PLAY, FILE, "drive")
    for _ in range(5):
        client.tick()
    assert replay(client, STOP)
    messages = replay_info_messages(infos)
    source = harness.client()
    source.send(INFO, "morai_msgs/ReplayInfo", **messages[0])
    client.tick()
    saved, before = snapshot(client, "a"), hash_of(client)
    listener = hear(harness)

    def follow() -> list[bytes]:
        source.send(INFO, "morai_msgs/ReplayInfo", **messages[1])
        return run_on(client, listener, 3)

    first = follow()
    for which in ("a", bytes(saved.data)):
        assert restore(client, which).message == ""
        assert hash_of(client) == before
        assert follow() == first
    source.leave()
    assert restore(client, "a").result
    client.tick()
    assert not harness.node.scene.is_replaying, "nobody replays any longer"


def test_further_ego_keeps_its_object_and_its_subscribers() -> None:
    harness, client = in_sync()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2))
    listener = hear(harness, "/Ego-2/Ego_topic")
    snapshot(client, "two")
    call(client, "/sim/reset", seed=-1)
    client.tick()
    listener.heard.clear()
    assert restore(client, "two").result
    client.tick()
    assert [one["unique_id"] for one in listener.messages("/Ego-2/Ego_topic")] == [2]


def test_world_that_has_failed_restores_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    harness, client = in_sync(on_world_failure="serve")
    snapshot(client, "a")
    monkeypatch.setattr(harness.world.signals, "_next_change", None, raising=False)
    assert not client.call("/SyncModeWaitForTick", {"request": {"user_id": "me"}}).is_ok
    assert not client.call("/sim/restore", {"user_id": "me", "id": "a"}).is_ok


def test_every_topic_of_the_world_is_heard_here() -> None:
    harness = SimHarness("crossing")
    # The markers differ after a restore: they begin with the deletion of what viewers were shown before.
    assert {topic.name for topic, _ in harness.node.context.publishers.current()} <= {*HEARD, "/sim/scene/objects"}


def test_restore_is_refused_while_a_tick_waits_for_its_turn() -> None:
    reader = ManualReader()
    harness, client = in_sync(reader=reader)
    snapshot(client, "a")
    held: list[Answer] = []
    load = {"request": {"frame": 1, "file_name": "parked", **ALL}}
    harness.bus.call(harness.client(), "/SyncModeScenarioLoad", load, held.append, now=0.0)
    harness.bus.call(harness.client(), "/SyncModeWaitForTick", {"request": {"user_id": "me"}}, held.append, now=0.0)
    assert "waiting for their turn" in restore(client, "a").message
    reader.hand_over()
    assert len(held) == 2
    assert restore(client, "a").result

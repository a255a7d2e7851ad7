"""The simulator node: real time, ticks, pauses, and reproducible bytes."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Answer, Topic
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.morai.releases import FIELD
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.kernel.real_time import MAX_FRAMES_AT_ONCE
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Then
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from rosbridge_sim.world.state.world import World
from tests.simulator.sim_harness import ALL, Client, SimHarness, make_store

THROTTLE = {"accel": 1.0, "brake": 0.0, "steering": 0.0}


# Real time


def test_real_time_makes_fifty_frames_a_second() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/Ego_topic", "/clock", "/SyncModeInfo")
    harness.run(1.0)
    assert harness.world.frame == 50
    assert [m["header"]["seq"] for m in client.messages("/Ego_topic")] == list(range(1, 51))
    assert client.messages("/clock")[-1] == {"clock": {"secs": 1, "nsecs": 0}}
    assert [m["frame"] for m in client.messages("/SyncModeInfo")] == list(range(1, 51))
    assert harness.bus.stamp_ns == 1_000_000_000


def test_no_frame_is_computed_before_it_is_due() -> None:
    harness = SimHarness()
    assert harness.node.next_due(5.0) == 5.0
    harness.node.advance(5.0)
    assert harness.world.frame == 0
    due = harness.node.next_due(5.0)
    assert due is not None
    assert due == pytest.approx(5.02)
    harness.node.advance(math.nextafter(due, 0.0))
    assert harness.world.frame == 0
    harness.node.advance(due)
    assert harness.world.frame == 1


def test_late_frames_are_computed_in_small_portions() -> None:
    harness = SimHarness()
    harness.node.advance(0.0)
    harness.node.advance(0.4)
    assert harness.world.frame == MAX_FRAMES_AT_ONCE
    due = harness.node.next_due(0.4)
    assert due is not None
    assert due < 0.4
    for _ in range(10):
        harness.node.advance(0.4)
    assert harness.world.frame == 20
    assert harness.node.context.pacer.num_stalls == 0


def test_stall_shifts_the_clock_and_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    harness = SimHarness()
    harness.node.advance(0.0)
    harness.node.advance(1_000.0)
    assert harness.world.frame == 1
    harness.node.advance(2_000.0)
    assert harness.world.frame == 2
    assert harness.node.context.pacer.num_stalls == 2
    assert [r.levelno for r in caplog.records if "stalled" in r.message].count(logging.WARNING) == 1
    assert harness.node.next_due(2_000.0) == pytest.approx(2_000.02)


def test_lag_is_what_real_time_is_ahead_of_the_world() -> None:
    harness = SimHarness()
    node = harness.node
    assert node.real_time_lag(5.0) == 0.0, "it has not begun"
    node.advance(0.0)
    assert node.real_time_lag(0.01) == 0.0
    assert node.real_time_lag(0.32) == pytest.approx(0.3)
    node.advance(1_000.0)
    assert node.real_time_lag(1_000.0) == 0.0
    assert node.context.pacer.lost_time == pytest.approx(999.98)
    assert harness.client().ask("/Service_MoraiEventCmd", option=8, set_pause=True)["set_pause"] is True
    assert node.real_time_lag(2_000.0) == 0.0, "a pause owes nothing"


def test_frames_are_measured_and_counted_by_real_time_and_by_ticks() -> None:
    harness = SimHarness()
    calls: list[str] = []

    class Meter:
        def begin(self) -> None:
            calls.append("begin")

        def end(self) -> None:
            calls.append(f"end {harness.world.frame}")

    harness.run(0.1)
    harness.node.context.stepper.meter = Meter()
    harness.run(0.04)
    client = harness.client()
    client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=40)
    client.ask("/SyncModeWaitForTick", user_id="me", frame=9)
    assert calls == [word for frame in (6, 7, 8, 9) for word in ("begin", f"end {frame}")]
    assert harness.node.context.stepper.num_frames == 9
    harness.client().call("/sim/reset", {"seed": 1})
    assert harness.world.frame == 0
    assert harness.node.context.stepper.num_frames == 9, "a counter never goes back"


def test_control_topic_drives_and_brakes_the_car_without_setup() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/Ego_topic")
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=0.5)
    harness.run(2.0)
    assert client.messages("/Ego_topic")[-1]["velocity"]["x"] > 1.0
    before = client.messages("/Ego_topic")[-1]["velocity"]["x"]
    client.send("/ctrl_cmd_0", "morai_msg/CtrlCmd", longCmdType=1, brake=1.0)
    harness.run(0.5)
    assert client.messages("/Ego_topic")[-1]["velocity"]["x"] < before
    assert client.told == []


def test_the_last_command_holds() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=2, velocity=36.0)
    client.leave()
    harness.run(10.0)
    assert harness.world.speed[harness.world.row(FIRST_EGO)] == pytest.approx(10.0)


def test_pause_stops_real_time_without_catching_up_later() -> None:
    harness = SimHarness()
    client = harness.client()
    harness.run(0.2)
    assert client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)["set_pause"] is True
    assert harness.node.next_due(harness.now) is None
    harness.run(3.0)
    assert harness.world.frame == 10
    client.now = harness.now
    assert client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)["set_pause"] is False
    harness.run(0.2)
    assert harness.world.frame == 20
    assert harness.node.context.pacer.num_stalls == 0


def test_topics_without_subscribers_are_not_computed() -> None:
    harness = SimHarness()
    published = harness.bus.delivery.num_published
    harness.run(0.2)
    assert harness.bus.delivery.num_published == published + 10  # /SyncModeInfo, latched


# Synchronous mode


def test_world_with_start_sync_stays_at_frame_0_until_a_tick() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    assert harness.node.next_due(0.0) is None
    harness.node.advance(1e6)
    assert harness.world.frame == 0
    (info,) = harness.bus.topics["/SyncModeInfo"].latched
    assert info.json == b'{"master_id":"","status":true,"frame":0,"can_send_tick":false}'
    assert client.start("") == {"user_id": "sync-1", "frame": 0, "result": True, "time_step": 20}
    assert client.tick("sync-1")["frame"] == 1


def test_topics_of_a_tick_come_before_its_answer() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start(time_step=60)
    client.listen("/SyncModeInfo", "/Object_topic", "/Ego_topic", "/clock")
    answered_after = []
    args: dict[str, object] = {"request": {"user_id": "me"}}
    harness.bus.call(client, "SyncModeWaitForTick", args, lambda _: answered_after.append(len(client.heard)), now=0.0)
    assert answered_after == [12]
    order = ["/clock", "/Ego_topic", "/Object_topic", "/SyncModeInfo"]
    assert [topic for topic, _ in client.heard] == order * 3
    assert [m["can_send_tick"] for m in client.messages("/SyncModeInfo")] == [False, False, True]


def test_the_answer_holds_the_true_frame_time_and_ego() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.listen("/Ego_topic")
    client.start(time_step=40)
    answer = client.tick(frame=12345)
    assert (answer["tick_status"], answer["pause_status"], answer["frame"]) == (True, False, 2)
    assert answer["time"] == "0.04"
    assert answer["vehicle_status"] == client.messages("/Ego_topic")[-1]
    assert answer["vehicle_status"]["header"]["stamp"] == {"secs": 0, "nsecs": 40_000_000}


@pytest.mark.parametrize("frame", [0, 1, 5, 6, 7, 99, 6.0, 2**63])
def test_tick_moves_one_time_step_regardless_of_its_frame(frame: float) -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start()
    for _ in range(5):
        client.tick()
    assert client.tick(frame=frame)["frame"] == 6


def test_strict_frames_refuse_all_but_the_next() -> None:
    harness = SimHarness(start="sync", sync_frames="strict")
    client = harness.client()
    client.start(time_step=40)
    assert client.tick(frame=2)["tick_status"]
    for frame in (2, 3, 5):
        answer = client.tick(frame=frame)
        assert (answer["tick_status"], answer["frame"]) == (False, 2)
    assert client.tick(frame=4)["tick_status"]
    assert "strict" in client.told[0][1]


def test_refused_ticks_move_nothing() -> None:
    harness = SimHarness()
    client, other = harness.client(), harness.client()
    harness.run(0.1)
    before = harness.world.digest()

    def is_refused(answer: dict[str, Any], *, is_paused: bool = False) -> bool:
        assert answer["frame"] == 5
        assert answer["pause_status"] is is_paused
        assert answer["vehicle_status"]["header"]["seq"] == 5
        assert harness.world.digest() == before
        return answer["tick_status"] is False

    assert is_refused(client.tick())  # off
    client.start()
    assert is_refused(other.tick("somebody"))
    assert is_refused(other.tick(""))
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert is_refused(client.tick(), is_paused=True)
    assert client.told[0] == ("warning", "/SyncModeWaitForTick: synchronous mode is off")


def test_second_master_is_refused_and_told_the_present_one() -> None:
    harness = SimHarness()
    first, second = harness.client(), harness.client()
    first.start("a", 100)
    assert second.start("b", 20) == {"user_id": "a", "frame": 0, "result": False, "time_step": 100}
    assert second.start("", 20)["result"] is False
    assert second.stop("b") == {"user_id": "a", "frame": 0, "result": False, "time_step": 100}
    assert first.start("a", 40) == {"user_id": "a", "frame": 0, "result": True, "time_step": 40}
    assert second.tick("a")["frame"] == 2, "whoever knows the id may use it"
    assert first.stop("a", 0) == {"user_id": "a", "frame": 2, "result": True, "time_step": 40}
    assert second.start("b", 0) == {"user_id": "b", "frame": 2, "result": True, "time_step": 20}


@pytest.mark.parametrize("step", [1, 10, 30, 1_001, 1_020, 2**32 - 1])
def test_invalid_time_steps_are_refused(step: int) -> None:
    harness = SimHarness()
    client = harness.client()
    assert client.start("a", step) == {"user_id": "", "frame": 0, "result": False, "time_step": 20}
    assert not harness.node.sync.is_on
    assert "time_step must be a multiple of 20" in client.told[0][1]


def test_sync_mode_info_follows_every_change() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/SyncModeInfo")
    client.start("a")
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    client.tick("a")
    client.stop("a")
    assert [tuple(m.values()) for m in client.messages("/SyncModeInfo")] == [
        ("a", True, 0, True),
        ("a", True, 0, False),
        ("a", True, 0, True),
        ("a", True, 1, True),
        ("", False, 1, False),
    ]


def test_real_time_resumes_after_stop_without_catching_up() -> None:
    harness = SimHarness()
    client = harness.client()
    harness.run(0.1)
    client.start()
    harness.run(60.0)
    assert harness.world.frame == 5
    client.now = harness.now
    client.stop()
    harness.run(0.1)
    assert harness.world.frame == 10
    assert harness.node.context.pacer.num_stalls == 0


def test_any_client_may_stop_if_allowed() -> None:
    harness = SimHarness(anyone_may_stop=True)
    harness.client().start("a")
    assert harness.client().stop("b")["result"] is True
    assert harness.node.sync.is_free


def test_tick_during_a_tick_is_refused() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start()
    inner: list[Answer] = []

    def tick_again(_topic: Topic, _message: Message, _sender: Participant, now: float) -> None:
        harness.bus.call(client, "/SyncModeWaitForTick", {"request": {"user_id": "me"}}, inner.append, now=now)

    harness.bus.subscribe(client, "/Ego_topic", tick_again)
    assert client.tick()["frame"] == 1
    assert [answer.is_ok for answer in inner] == [False]
    assert "a tick is in progress" in str(inner[0].values)
    assert client.tick()["frame"] == 2


# Losing the master


@pytest.mark.parametrize(
    ("on_loss", "status", "is_moving"), [("run", False, True), ("pause", False, False), ("wait", True, False)]
)
def test_world_follows_sync_on_loss_when_the_master_leaves(on_loss: str, status: bool, is_moving: bool) -> None:  # noqa: FBT001
    harness = SimHarness(sync_on_loss=on_loss)
    master, watcher = harness.client(), harness.client()
    watcher.listen("/SyncModeInfo")
    master.start("a")
    master.control(1, longlCmdType=2, velocity=36.0)
    master.tick("a")
    master.control(50, **THROTTLE)
    master.now = harness.now
    master.leave()
    last = watcher.messages("/SyncModeInfo")[-1]
    assert last == {"master_id": "", "status": status, "frame": 1, "can_send_tick": False}
    assert len(harness.node.sync.waiting()) == 0
    harness.run(1.0)
    assert harness.world.frame == (51 if is_moving else 1)
    frame = harness.world.frame
    assert watcher.start("b") == {"user_id": "b", "frame": frame, "result": True, "time_step": 20}
    answer = watcher.tick("b")
    assert answer["pause_status"] is (on_loss == "pause")
    if on_loss == "pause":
        watcher.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
        answer = watcher.tick("b")
    assert (answer["tick_status"], answer["frame"]) == (True, frame + 1)


@pytest.mark.parametrize(
    ("on_loss", "is_paused", "becomes"),
    [
        ("run", False, "the world runs in real time from now on"),
        ("pause", False, "the world is paused"),
        ("wait", False, "the world stands and waits for a new master"),
        ("run", True, "the world is paused"),
        ("wait", True, "the world is paused and waits for a new master"),
    ],
)
def test_log_says_which_master_was_lost_how_and_what_becomes_of_the_world(
    caplog: pytest.LogCaptureFixture, on_loss: str, becomes: str, *, is_paused: bool
) -> None:
    for how in ("has disconnected", "was silent for as long as --sync-lease"):
        harness = SimHarness(sync_on_loss=on_loss, sync_lease=2.0)
        master = harness.client()
        master.start("a\nb" + "c" * 100)
        if is_paused:
            master.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        if how == "has disconnected":
            master.leave()
        else:
            harness.run(2.5)
        name = "'a\\nb" + "c" * 57 + "...'"
        assert caplog.messages == [f"synchronous mode has lost its master: {name} {how}; {becomes}"]
        caplog.clear()


def test_master_id_lives_as_long_as_one_of_its_holders() -> None:
    harness = SimHarness(sync_on_loss="wait")
    first, second, stranger = harness.client(), harness.client(), harness.client()
    first.start("a")
    second.tick("a")
    stranger.tick("b")
    first.leave()
    stranger.leave()
    assert harness.node.sync.master_id == "a"
    second.leave()
    assert harness.node.sync.master_id == ""


def test_a_silent_master_is_lost_after_the_lease() -> None:
    harness = SimHarness(sync_lease=2.0)
    client = harness.client()
    client.now = harness.now
    client.start("a")
    assert harness.node.next_due(harness.now) == harness.now + 2.0
    harness.run(1.5)
    client.now = harness.now
    client.tick("a")
    harness.run(1.9)
    assert harness.node.sync.master_id == "a"
    harness.run(0.2)
    assert harness.node.sync.is_free
    assert harness.world.frame == 1 + 5
    assert harness.node.context.pacer.num_stalls == 0


# Names that are the simulator's own


# A step that fails


def break_world(harness: SimHarness) -> None:
    """Let the next step fail in its middle."""

    def fail() -> None:
        raise ZeroDivisionError("planted")

    harness.node.context.hooks.place.append(fail)


WHY = "the world has failed: ZeroDivisionError('planted')"


def test_failed_step_in_real_time_is_raised_at_every_call() -> None:
    harness = SimHarness()
    break_world(harness)
    harness.node.advance(harness.now)
    for later in (1.0, 2.0):
        with pytest.raises(ZeroDivisionError, match="planted"):
            harness.node.advance(harness.now + later)
        assert harness.node.next_due(harness.now) == harness.now
    assert harness.node.context.failure.why == WHY
    assert harness.world.frame == 0


def test_failed_tick_is_refused_and_raised_at_the_next_call() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start()
    break_world(harness)
    for _ in range(2):
        assert client.refused("/SyncModeWaitForTick", user_id="me", frame=1) == WHY
    assert harness.node.next_due(harness.now) == harness.now
    with pytest.raises(ZeroDivisionError, match="planted"):
        harness.node.advance(harness.now)


@pytest.mark.parametrize("start", ["run", "sync"])
def test_node_with_serve_refuses_everything_after_a_failure(start: str, caplog: pytest.LogCaptureFixture) -> None:
    harness = SimHarness(start=start, on_world_failure="serve")
    client, master = harness.client(), harness.client()
    client.listen("/Ego_topic", "/SyncModeInfo")
    break_world(harness)
    if start == "run":
        harness.run(1.0)
    else:
        master.start()
        assert master.refused("/SyncModeWaitForTick", user_id="me", frame=1) == WHY
    num_heard = len(client.heard)
    harness.run(1.0)
    for service in ("/SyncModeCmd", "/SyncModeWaitForTick", "/Service_MoraiEventCmd", "/sim/reset", "/Morai_SimProc"):
        answer = client.call(service, {})
        assert (answer.is_ok, answer.values) == (False, WHY)
    for topic, name in (
        ("/ctrl_cmd", "CtrlCmd"),
        ("/ScenarioLoad", "ScenarioLoad"),
        ("/InsnControl", "IntersectionControl"),
    ):
        with pytest.raises(GraphError, match="the world has failed"):
            client.send(topic, f"morai_msgs/{name}")
    master.leave()
    assert harness.world.frame == 0
    assert harness.node.next_due(harness.now) is None
    assert len(client.heard) == num_heard
    (record,) = (record for record in caplog.records if record.levelno == logging.CRITICAL)
    assert record.exc_info is not None


def test_pending_call_is_refused_when_the_world_fails() -> None:
    harness = SimHarness(recordings=NeverRead(), on_world_failure="serve")
    client = harness.client()
    answers: list[Answer] = []
    request: dict[str, object] = {"request": {"sim_process_status": 1, "replay_option": 1, "rosbag_file_name": "drive"}}
    harness.bus.call(client, "/Morai_SimProc", request, answers.append, now=harness.now)
    assert answers == []
    break_world(harness)
    harness.run(1.0)
    assert [(answer.is_ok, answer.values) for answer in answers] == [(False, WHY)]


# A failure that is not the world's


class FailingClient(Client):
    """A client that leaves at once when something that is done for it fails, as one with a socket does."""

    def fail(self, _error: Exception) -> None:
        self.leave()

    def break_down(self, topic: str) -> None:
        """Fail at the next message of a topic."""

        def fail(*_: object) -> None:
            raise ZeroDivisionError("planted")

        self._bus.subscribe(self, topic, fail)


def break_down(*_: object) -> None:
    raise ZeroDivisionError("planted")


@pytest.mark.parametrize("start", ["run", "sync"])
def test_failing_subscriber_is_not_a_failure_of_the_world(start: str) -> None:
    harness = SimHarness(start=start)
    frail, good, part = FailingClient(harness.bus, "/frail"), harness.client(), harness.client()
    frail.break_down("/Ego_topic")
    harness.bus.subscribe(part, "/Ego_topic", break_down)  # this one cannot end alone
    good.listen("/Ego_topic")
    if start == "sync":
        good.start()
        for _ in range(5):
            assert good.tick()["tick_status"]
    else:
        harness.run(0.1)
    assert len(good.messages("/Ego_topic")) == harness.world.frame == 5
    assert harness.node.context.failure.why is None
    assert frail not in harness.bus.owners()
    assert harness.bus.guard.num_faults == 1 + 5


def test_unencodable_message_is_not_a_failure_of_the_world(
    caplog: pytest.LogCaptureFixture,
) -> None:
    harness = SimHarness(start="sync")
    good = harness.client()
    good.listen("/Ego_topic", "/Object_topic")
    (feed,) = [feed for feed in harness.node.context.publishers._periodic if feed.name == "/Ego_topic"]
    feed.make = object
    good.start()
    for _ in range(5):
        assert good.tick()["tick_status"]
    assert good.messages("/Ego_topic") == []
    assert len(good.messages("/Object_topic")) == harness.world.frame == 5
    assert harness.bus.guard.num_faults == 5
    assert [record.getMessage()[:12] for record in caplog.records if record.exc_info] == ["/Ego_topic: "]
    assert not [record for record in caplog.records if not record.exc_info and record.levelno >= logging.WARNING]


@pytest.mark.parametrize(("on_loss", "status"), [("run", False), ("pause", False), ("wait", True)])
def test_master_that_fails_during_its_tick_is_lost_after_its_last_frame(on_loss: str, status: bool) -> None:  # noqa: FBT001
    harness = SimHarness(sync_on_loss=on_loss)
    master, watcher = FailingClient(harness.bus, "/master"), harness.client()
    watcher.listen("/SyncModeInfo")
    master.start("a", time_step=100)
    master.break_down("/Ego_topic")
    before = len(watcher.messages("/SyncModeInfo"))
    answers: list[Answer] = []
    harness.bus.call(
        master, "/SyncModeWaitForTick", {"request": {"user_id": "a", "frame": 0}}, answers.append, now=harness.now
    )
    infos = watcher.messages("/SyncModeInfo")[before:]
    assert [(info["master_id"], info["status"], info["frame"]) for info in infos] == [
        *(("a", True, frame) for frame in range(1, 6)),
        ("", status, 5),
    ]
    assert answers == []  # nobody is there to hear it
    assert harness.node.context.sync_driver.num_ticks == 1
    assert harness.node.context.failure.why is None


def test_master_is_lost_although_other_departure_hooks_fail() -> None:
    harness = SimHarness(sync_on_loss="run")
    master = harness.client()
    master.start("a")
    harness.node.context.hooks.on_leave.insert(0, break_down)  # as good a bug as any
    master.leave()
    assert harness.node.sync.master_id == ""
    assert harness.bus.guard.num_faults == 1


class NeverRead:
    """Recordings that take for ever."""

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        """Leave the caller waiting."""


def test_clients_cannot_take_names_of_the_simulator() -> None:
    harness = SimHarness()
    client = harness.client()
    for name, type_name in (
        ("/Ego_topic", "EgoVehicleStatus"),
        ("Object_topic", "ObjectStatusList"),
        ("/SyncModeInfo", "SyncModeInfo"),
    ):
        with pytest.raises(GraphError, match="is published by /morai_sim alone"):
            harness.bus.advertise(client, name, "morai_msgs/" + type_name)
    with pytest.raises(GraphError, match="is published by /morai_sim alone"):
        harness.bus.advertise(client, "/clock", "rosgraph_msgs/Clock")
    for name in list(harness.bus.services):
        with pytest.raises(GraphError, match="is provided by /morai_sim alone"):
            harness.bus.provide(client, name, "morai_msgs/MoraiSyncModeCmdSrv", lambda _call, _now: None)
    with pytest.raises(GraphError, match="already established with type morai_msgs/CtrlCmd"):
        harness.bus.advertise(client, "/ctrl_cmd", "std_msgs/String")


# The same calls, the same bytes


def drive(harness: SimHarness) -> tuple[list[bytes], str]:
    """A drive with everything in it that is decided by frames: commands ahead of time, objects, loads, pauses."""
    client = harness.client()
    client.listen("/clock", "/Ego_topic", "/Object_topic", "/SyncModeInfo")
    client.start("", 60)
    for i in range(40):
        frame = harness.world.frame
        client.control(
            frame + i % 5,
            longlCmdType=i % 4,
            accel=0.7,
            velocity=30.0,
            acceleration=math.cos(i),
            steering=0.4 * math.sin(i / 9),
        )
        if i % 10 == 3:
            client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Truck", heading=10.0 * i, frame=frame + 4)
        if i % 10 == 7:
            listed = client.messages("/Object_topic")[-1]["npc_list"]
            client.send("/SyncModeRemoveObj", "morai_msgs/SyncModeRemoveObj", unique_id=listed[0]["unique_id"])
        if i == 20:
            assert client.ask("/SyncModeScenarioLoad", file_name="crowd", frame=frame + 2, **ALL)["result"]
        if i == 28:
            client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
        assert client.tick("sync-1")["tick_status"]
    return client.raw, harness.world.digest()


def test_two_runs_give_the_same_bytes() -> None:
    first, second = drive(SimHarness(start="sync")), drive(SimHarness(start="sync"))
    assert len(set(first[0])) > 400
    assert first == second


def test_further_subscribers_change_no_bytes() -> None:
    alone, watched = SimHarness(start="sync", profile=FIELD), SimHarness(start="sync", profile=FIELD)
    Client(watched.bus, "/watcher").listen("/Ego_topic", "/Object_topic")
    assert drive(alone) == drive(watched)


def test_built_in_scene_is_loaded_at_the_start() -> None:
    library, world, bus = DiskLibrary(), World(), Bus(make_store())
    node = make_node(bus, world, library, library.scenario("demo"))
    assert len(world) > 5
    client = Client(bus, "/client")
    client.listen("/Object_topic")
    node.advance(0.0)
    node.advance(0.02)
    assert any(one["velocity"]["x"] > 0.0 for one in client.messages("/Object_topic")[0]["npc_list"])


# The call orders of programs in the field


def planner(client: Client, step_ms: int) -> list[dict[str, Any]]:
    """Counts frames by itself, one too few with longer steps, and never sets a gear or a control type."""
    started = client.start("", step_ms)
    user_id, named = started["user_id"], started["frame"] + 1
    answers = [client.tick(user_id, named)]
    for _ in range(70):
        named += step_ms // 20
        assert client.control(named, **THROTTLE)
        answers.append(client.tick(user_id, named))
    client.stop(user_id, step_ms)
    return answers


def planner_with_scenario(client: Client) -> list[dict[str, Any]]:
    """Scenario and gear for the next frame, which may be a float."""
    started = client.start()
    named = started["frame"] + 2.0 / 2
    assert client.ask("/SyncModeScenarioLoad", frame=named, file_name="crowd", **ALL)["result"]
    assert client.ask("/SyncModeSetGear", frame=named, gear=4)["result"]
    answers = [client.tick(frame=named)]
    for _ in range(70):
        named = answers[-1]["frame"] + 1
        assert client.control(named, **THROTTLE)
        answers.append(client.tick(frame=named))
    client.stop()
    return answers


def course(client: Client) -> list[dict[str, Any]]:
    """Gear and all ticks for the frame of the start, two ticks for a command, a scenario before the start."""
    assert client.ask("/Service_MoraiSL", file_name="crowd", **ALL)["result"]
    stale = client.start("course")["frame"]
    assert client.ask("/SyncModeSetGear", frame=stale, gear=4)["result"]
    answers = [client.tick("course", stale)]
    assert client.ask("/Service_MoraiSL", file_name="crowd", **ALL)["result"]
    for _ in range(35):
        answers.append(client.tick("course", stale))
        assert client.control(answers[-1]["frame"], longlCmdType=1, **THROTTLE)
        answers.append(client.tick("course", stale))
    client.stop("course")
    return answers


def constant(client: Client) -> list[dict[str, Any]]:
    """Every number is 1."""
    client.start()
    answers = [client.tick(frame=1)]
    for _ in range(70):
        assert client.control(1, **THROTTLE)
        answers.append(client.tick(frame=1))
    client.stop()
    return answers


def learner(client: Client) -> list[dict[str, Any]]:
    """Goes by the answer's frame; starts twice; steps of three frames."""
    client.start("rl", 60)
    named = client.start("rl", 60)["frame"] + 1
    answers = [client.tick("rl", named)]
    for _ in range(40):
        named = answers[-1]["frame"] + 3
        assert client.control(named, longlCmdType=2, velocity=36.0, acceleration=0.0, **THROTTLE)
        answers.append(client.tick("rl", named))
    client.stop("rl")
    return answers


@pytest.mark.parametrize("start", ["run", "sync"])
@pytest.mark.parametrize(
    "program",
    [lambda c: planner(c, 20), lambda c: planner(c, 40), planner_with_scenario, course, constant, learner],
    ids=["planner", "planner 40", "scenario", "course", "constant", "learner"],
)
def test_known_client_programs_drive(program: Callable[[Client], list[dict[str, Any]]], start: str) -> None:
    harness = SimHarness(start=start)
    client = harness.client()
    answers = program(client)
    frames = [answer["frame"] for answer in answers]
    assert len({b - a for a, b in pairwise(frames)}) == 1, "every tick moves one time step"
    assert all(answer["tick_status"] for answer in answers)
    first, last = (answers[i]["vehicle_status"] for i in (0, -1))
    assert last["velocity"]["x"] > 3.0
    assert (
        math.hypot(last["position"]["x"] - first["position"]["x"], last["position"]["y"] - first["position"]["y"]) > 3
    )
    assert [level for level, _ in client.told] == []
    assert harness.node.sync.is_free


def test_synchronous_mode_can_be_used_for_gear_changes_only() -> None:
    harness = SimHarness()
    client = harness.client()
    harness.run(0.1)
    assert client.start("gear", 0)["time_step"] == 20
    for gear in (1, 2, 4):
        assert client.ask("/SyncModeSetGear", frame=5, gear=gear)["result"]
        client.tick("gear", 5)
        assert client.ask("/Service_MoraiEventCmd", option=0, gear=-1)["gear"] == gear
    assert client.stop("gear", 0)["result"]


# Stamps

DAY_NS = 1_700_000_000 * 10**9


class FakeWallClock:
    """A clock that the shell would have.

    Attributes:
        num_read: how often it was read.
    """

    def __init__(self) -> None:
        self.num_read = 0

    def read_ns(self) -> int:
        self.num_read += 1
        return DAY_NS + 1_000 * self.num_read


def stamp_of(stamp: dict[str, int]) -> int:
    return stamp["secs"] * 10**9 + stamp["nsecs"]


def stamps_in(value: object) -> list[int]:
    """All times of day in a message."""
    if isinstance(value, list):
        return [stamp for one in value for stamp in stamps_in(one)]
    if not isinstance(value, dict):
        return []
    if set(value) == {"secs", "nsecs"}:
        return [stamp_of(value)]
    return [stamp for one in value.values() for stamp in stamps_in(one)]


def without_stamps(value: JsonValue) -> JsonValue:
    """The same without what says when it is."""
    if isinstance(value, (list, tuple)):
        return [without_stamps(one) for one in value]
    if not isinstance(value, dict):
        return value
    return {key: without_stamps(one) for key, one in value.items() if key not in {"stamp", "clock"}}


EVERYTHING = (
    *("/clock", "/tf", "/tf_static", "/Ego_topic", "/Object_topic", "/CollisionData", "/IntscnTL_topic"),
    *("/gps", "/imu"),
    *("/sim/process/state/msg/MoraiSimProcStatus", "/GetTrafficLightStatus", "/SyncModeInfo"),
)


@pytest.mark.parametrize("is_synchronous", [False, True])
def test_all_topics_of_a_frame_have_one_wall_clock_stamp(*, is_synchronous: bool) -> None:
    harness = SimHarness("crossing")
    day = FakeWallClock()
    harness.node.use_wall_time(day.read_ns, harness.now)
    client = harness.client()
    client.listen(*EVERYTHING)
    if is_synchronous:
        client.start(time_step=100)
        client.tick()
    else:
        harness.run(0.101)
    assert harness.world.frame == 5
    assert day.num_read == 1 + harness.world.frame, "once a frame"
    clocks = [stamp_of(message["clock"]) for message in client.messages("/clock")]
    assert clocks == [DAY_NS + 1_000 * (2 + i) for i in range(harness.world.frame)]
    by_frame: dict[int, set[int]] = {}
    for _, message in client.heard:
        if "header" in message:
            by_frame.setdefault(message["header"]["seq"], set()).update(stamps_in(message["header"]))
    assert by_frame == {frame: {clock} for frame, clock in enumerate(clocks, start=1)}
    assert [stamps_in(message) for message in client.messages("/tf")] == [[clock] for clock in clocks]
    assert harness.bus.stamp_ns == clocks[-1]
    assert harness.bus.time_ns == harness.world.frame * 20_000_000, "bags and rates count in simulated time"


def test_wall_clock_stamps_renew_latched_messages() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen(*EVERYTHING)
    harness.node.use_wall_time(FakeWallClock().read_ns, 0.0)
    assert {topic for topic, _ in client.heard} == {"/tf_static", "/sim/process/state/msg/MoraiSimProcStatus"}
    assert all(stamps_in(message.get("header", message))[0] == DAY_NS + 1_000 for _, message in client.heard)


def test_messages_and_answers_without_a_stamp_get_the_frames() -> None:
    harness = SimHarness()
    harness.node.use_wall_time(FakeWallClock().read_ns, 0.0)
    client = harness.client()
    client.send("/mine", "geometry_msgs/PointStamped")
    client.listen("/mine")
    client.send("/mine", "geometry_msgs/PointStamped")
    assert stamp_of(client.messages("/mine")[0]["header"]["stamp"]) == DAY_NS + 1_000
    client.call("/Morai_SimProc", {"request": {"sim_process_status": 2}})
    client.listen("/sim/process/state/msg/MoraiSimProcStatus")
    topic = harness.bus.find_topic("/sim/process/state/msg/MoraiSimProcStatus")
    assert topic is not None
    status = json.loads(topic.latched[0].json)
    assert stamp_of(status["latest_command_time"]) == DAY_NS + 1_000


def drive_all(*, has_wall: bool) -> tuple[list[Any], str]:
    """All that a drive gives, but for its stamps, and the world's hash at its end."""
    harness = SimHarness("crossing", start="sync")
    if has_wall:
        harness.node.use_wall_time(FakeWallClock().read_ns, 0.0)
    client = harness.client()
    client.listen(*EVERYTHING)
    client.start(time_step=40)
    answers = []
    for i in range(12):
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=0.5, front_steer=0.1)
        answers.append(client.tick(frame=2 * i + 2))
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData", is_custom_file_name=True, custom_file_name="one")
    harness.node.reset(None, 0.0)
    answers.append(client.tick())
    return [without_stamps(client.heard), without_stamps(answers), harness.drawer.saved], harness.world.digest()


def test_wall_clock_time_changes_only_stamps() -> None:
    plain = drive_all(has_wall=False)
    assert drive_all(has_wall=True) == plain
    assert plain[0][2][0][2], "sensor data was saved"

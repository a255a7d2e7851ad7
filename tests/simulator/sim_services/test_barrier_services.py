"""The barrier on the bus: its services and its topic, and what it does to synchronous mode and to the world."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.sync.sync_table import SyncState
from tests.simulator.sim_harness import ALL, Client, ManualReader, SimHarness


def values(answer: Answer) -> dict[str, Any]:
    assert answer.is_ok, answer.values
    assert isinstance(answer.values, Message)
    result: dict[str, Any] = json.loads(answer.values.json)
    return result


def join(client: Client, user_id: str = "", **terms: object) -> dict[str, Any]:
    return values(client.call("/sim/barrier/join", {"user_id": user_id, **terms}))


def leave(client: Client, user_id: str) -> dict[str, Any]:
    return values(client.call("/sim/barrier/leave", {"user_id": user_id}))


def tick(client: Client, harness: SimHarness, user_id: str, frame: int = 0) -> list[dict[str, Any] | str]:
    """Tick as a member; the responses that have come, now or later: a text for a refused call."""
    ends: list[dict[str, Any] | str] = []

    def note(answer: Answer) -> None:
        ends.append(values(answer)["response"] if answer.is_ok else str(answer.values))

    request = {"request": {"user_id": user_id, "frame": frame}}
    harness.bus.call(client, "/SyncModeWaitForTick", request, note, now=harness.now)
    return ends


def members(*names: str, **settings: Any) -> tuple[SimHarness, list[Client]]:  # noqa: ANN401 - those of the node
    """A simulator with a barrier: a client for each name."""
    return enter(SimHarness(**settings), *names)


def enter(harness: SimHarness, *names: str) -> tuple[SimHarness, list[Client]]:
    """Have a client join for each name."""
    clients = [harness.client() for _ in names]
    for client in clients:
        client.now = harness.now
    for name, client in zip(names, clients, strict=True):
        assert join(client, name)["result"]
    return harness, clients


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_world_moves_when_all_members_have_ticked(release: str) -> None:
    harness, (a, b) = members("a", "b", release=release)
    first = tick(a, harness, "a")
    assert (first, harness.world.frame) == ([], 0)
    second = tick(b, harness, "b")
    assert harness.world.frame == 1
    for (response,) in (first, second):
        assert isinstance(response, dict)
        assert (response["tick_status"], response["pause_status"], response["frame"]) == (True, False, 1)


def test_join_answers_with_the_terms_in_force() -> None:
    harness = SimHarness()
    a, b = harness.client(), harness.client()
    assert join(a, "a", time_step=60, deadline_s=0.25) == {
        "result": True,
        "message": "",
        "user_id": "a",
        "frame": 0,
        "time_step": 60,
        "deadline_s": 0.25,
        "members": ["a"],
    }
    refused = join(b, "b", time_step=20)
    assert (refused["result"], refused["time_step"], refused["members"]) == (False, 60, ["a"])
    assert refused["message"].endswith("time_step 60 ms, deadline_s 0.25")
    assert b.told == [("warning", f"/sim/barrier/join: {refused['message']}")]
    assert join(b)["user_id"] == "member-1"


def test_world_moves_without_a_late_member_at_the_deadline_and_tells_it() -> None:
    harness, (a, b) = members("a", "b")
    ends = tick(a, harness, "a")
    harness.run(0.99)
    assert ends == []
    harness.run(0.02)
    assert (len(ends), harness.world.frame) == (1, 1)
    text = "/sim/barrier: member 'b' has not ticked within 1 s: the world has moved without it;"
    assert b.told == [("warning", f"{text} its next tick counts for the next boundary")]
    assert a.told == []


def test_topic_shows_who_is_waited_for() -> None:
    harness = SimHarness()
    watcher = harness.client()
    watcher.listen("/sim/barrier")
    _, (a, b) = enter(harness, "a", "b")
    status = watcher.messages("/sim/barrier")[-1]
    assert (status["members"], status["waited_for"], status["late_counts"]) == (["a", "b"], [], [0, 0])
    tick(a, harness, "a")
    status = watcher.messages("/sim/barrier")[-1]
    assert (status["ticked"], status["waited_for"], status["frame"]) == (["a"], ["b"], 0)
    harness.run(1.1)
    status = watcher.messages("/sim/barrier")[-1]
    assert (status["ticked"], status["waited_for"], status["frame"], status["late_counts"]) == ([], [], 1, [0, 1])
    leave(a, "a")
    leave(b, "b")
    status = watcher.messages("/sim/barrier")[-1]
    assert (status["members"], status["time_step"], status["deadline_s"]) == ([], 0, 0.0)


def test_barrier_is_the_master_of_synchronous_mode_and_ends_it() -> None:
    harness = SimHarness()
    watcher = harness.client()
    watcher.listen("/SyncModeInfo")
    _, (a, b) = enter(harness, "a", "b")
    info = watcher.messages("/SyncModeInfo")[-1]
    assert (info["master_id"], info["status"], info["can_send_tick"]) == ("/sim/barrier", True, True)
    leave(a, "a")
    assert b.told == [("warning", "/sim/barrier: member 'a' has left; the barrier goes on without it")]
    assert b.stop("b")["result"]
    assert harness.node.sync.state is SyncState.FREE
    assert watcher.messages("/SyncModeInfo")[-1]["status"] is False
    frame = harness.world.frame
    harness.run(0.1)
    assert harness.world.frame > frame, "real time moves it again"


def test_start_and_stop_by_another_id_are_refused_with_the_reason() -> None:
    harness, (a, _) = members("a", "b")
    other = harness.client()
    answer = other.start("boss")
    assert (answer["result"], answer["user_id"]) == (False, "/sim/barrier")
    assert "join it by /sim/barrier/join" in other.told[-1][1]
    assert not other.stop("boss")["result"]
    assert not other.stop("/sim/barrier")["result"], "the barrier's own id is nobody's"
    assert not other.tick("/sim/barrier")["tick_status"]
    answer = a.start("a")
    assert (answer["result"], answer["user_id"], answer["time_step"]) == (True, "a", 20)
    assert not a.start("a", 40)["result"]


def test_barrier_cannot_be_joined_while_a_master_leads() -> None:
    harness = SimHarness()
    boss, a = harness.client(), harness.client()
    boss.start("/sim/barrier")
    assert "another user id is the master" in join(a, "a")["message"]
    boss.stop("/sim/barrier")
    assert join(a, "a")["result"]


def test_lost_member_leaves_and_the_others_go_on_and_are_told() -> None:
    harness, (a, b, c) = members("a", "b", "c")
    ends = [*tick(a, harness, "a"), *tick(b, harness, "b")]
    assert ends == []
    c.leave()
    assert harness.world.frame == 1
    for one in (a, b):
        text = "/sim/barrier: member 'c' is lost, for its connection has ended; the barrier goes on without it"
        assert one.told == [("warning", text)]


@pytest.mark.parametrize(
    ("on_loss", "state"),
    [("run", SyncState.FREE), ("pause", SyncState.FREE_PAUSED), ("wait", SyncState.OPEN)],
)
def test_loss_of_the_last_member_ends_the_mode_as_that_of_a_master(on_loss: str, state: SyncState) -> None:
    harness, (a,) = members("a", sync_on_loss=on_loss)
    a.leave()
    assert harness.node.sync.state is state
    assert harness.node.sync.master_id == ""


def test_lease_of_a_silent_member_ends_and_that_of_a_waiting_one_does_not() -> None:
    harness, (a, _) = members("a", "b", sync_lease=0.5)
    ends = tick(a, harness, "a")
    harness.run(0.6)
    assert (len(ends), harness.world.frame) == (1, 1)
    assert "was silent for 0.5 s" in a.told[-1][1]
    harness.run(1.0)
    assert harness.node.sync.state is SyncState.FREE


def test_pause_refuses_the_ticks_that_wait_and_those_that_come() -> None:
    harness, (a, b) = members("a", "b")
    ends = tick(a, harness, "a")
    b.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    (response,) = ends
    assert isinstance(response, dict)
    assert (response["tick_status"], response["pause_status"]) == (False, True)
    assert "was paused while the tick waited for the other members" in a.told[-1][1]
    assert not a.tick("a")["tick_status"]
    b.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    tick(a, harness, "a")
    assert b.tick("b")["frame"] == 1


def test_topic_follows_a_pause_with_and_without_members() -> None:
    harness = SimHarness()
    watcher = harness.client()
    watcher.listen("/sim/barrier")
    for names in ((), ("a",)):
        enter(harness, *names)
        for is_paused in (True, False):
            watcher.ask("/Service_MoraiEventCmd", option=8, set_pause=is_paused)
            assert watcher.messages("/sim/barrier")[-1]["is_paused"] is is_paused


def test_reset_refuses_the_ticks_that_wait_and_answers_with_frame_0() -> None:
    harness, (a, b) = members("a", "b")
    tick(a, harness, "a")
    tick(b, harness, "b")
    ends = tick(a, harness, "a")
    b.call("/sim/reset", {"seed": -1})
    (response,) = ends
    assert isinstance(response, dict)
    assert (response["tick_status"], response["frame"]) == (False, 0)
    assert harness.node.context.barrier.status().members == ["a", "b"]


def test_tick_of_several_frames_is_divided_over_turns() -> None:
    harness = SimHarness()
    a, b = harness.client(), harness.client()
    assert join(a, "a", time_step=200)["result"]
    assert join(b, "b")["result"]
    clock = iter(range(1_000))
    harness.node.context.sync_driver.read_clock = lambda: float(next(clock))
    first, second = tick(a, harness, "a"), tick(b, harness, "b")
    ahead = tick(a, harness, "a")
    for frame in range(1, 10):
        assert (harness.world.frame, first, second) == (frame, [], [])
        harness.node.advance(harness.now)
    for (response,) in (first, second):
        assert isinstance(response, dict)
        assert (response["tick_status"], response["frame"]) == (True, 10)
    assert ahead == []
    last = tick(b, harness, "b")
    harness.run(0.0)
    assert (len(ahead), len(last), harness.world.frame) == (1, 1, 20)


def test_steps_of_one_call_are_for_the_only_member() -> None:
    _, (a, b) = members("a", "b")
    refused = values(a.call("/sim/step", {"user_id": "a", "n": 5}))
    assert (refused["result"], refused["frame"]) == (False, 0)
    assert "the barrier has other members" in refused["message"]
    leave(b, "b")
    done = values(a.call("/sim/step", {"user_id": "a", "n": 5}))
    assert (done["result"], done["frame"]) == (True, 5)
    assert a.tick("a")["frame"] == 6
    assert not values(b.call("/sim/step", {"user_id": "b", "n": 5}))["result"]
    assert not values(b.call("/sim/step", {"user_id": "/sim/barrier", "n": 5}))["result"]


def test_each_member_may_restore_a_snapshot_and_others_may_not() -> None:
    harness, (a, b) = members("a", "b")
    saved = values(a.call("/sim/snapshot", {"id": "start"}))
    assert saved["result"]
    tick(a, harness, "a")
    tick(b, harness, "b")
    ends = tick(a, harness, "a")
    for user_id in ("c", "/sim/barrier", ""):
        refused = values(b.call("/sim/restore", {"user_id": user_id, "id": "start"}))
        assert (refused["result"], refused["frame"]) == (False, 1)
        assert "no member" in refused["message"]
    assert values(b.call("/sim/restore", {"user_id": "b", "id": "start"}))["frame"] == 0
    (response,) = ends
    assert isinstance(response, dict)
    assert (response["tick_status"], response["frame"]) == (False, 0)
    assert "a snapshot was restored while the tick waited" in a.told[-1][1]
    ends = tick(a, harness, "a")
    assert b.tick("b")["frame"] == 1


def test_tick_of_all_waits_for_a_scenario_that_is_being_read() -> None:
    reader = ManualReader()
    harness, (a, b) = members("a", "b", reader=reader)
    loader = harness.client()
    answers: list[Answer] = []
    harness.bus.call(
        loader,
        "/SyncModeScenarioLoad",
        {"request": {"frame": 1, "file_name": "parked", **ALL}},
        answers.append,
        now=harness.now,
    )
    ends = [tick(a, harness, "a"), tick(b, harness, "b")]
    assert (ends, harness.node.sync.state) == ([[], []], SyncState.WAITING)
    harness.run(2.0)
    assert ends == [[], []], "no deadline while the world itself is waited for"
    later = tick(a, harness, "a")
    reader.hand_over(now=harness.now)
    assert [len(one) for one in ends] == [1, 1]
    assert later == []
    b.now = harness.now
    assert b.tick("b")["frame"] == 2
    assert len(later) == 1


@pytest.mark.parametrize("event", ["pause", "reset", "leave"])
def test_tick_of_all_that_waits_is_refused_once_to_each_by_what_ends_it(event: str) -> None:
    harness, (a, b) = members("a", "b", reader=ManualReader())
    request = {"frame": 1, "file_name": "parked", **ALL}
    harness.bus.call(harness.client(), "/SyncModeScenarioLoad", {"request": request}, lambda _: None, now=harness.now)
    ends = [tick(a, harness, "a"), tick(b, harness, "b")]
    assert ends == [[], []]
    if event == "pause":
        harness.client().ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    elif event == "reset":
        values(harness.client().call("/sim/reset", {}))
    else:
        a.leave()
        b.leave()
    harness.run(1.0)
    if event != "leave":
        assert [len(one) for one in ends] == [1, 1]
    assert all(isinstance(each, dict) and not each["tick_status"] for one in ends for each in one)
    assert harness.world.frame in {0, 50}


def test_strict_frames_of_a_barrier_are_those_on_which_its_tick_ends() -> None:
    harness = SimHarness(sync_frames="strict")
    a, b = harness.client(), harness.client()
    assert join(a, "a", time_step=60)["result"]
    assert join(b, "b")["result"]
    for frame in (3, 6):
        ends = [tick(client, harness, name, frame) for client, name in ((a, "a"), (b, "b"))]
        assert [one[0]["tick_status"] for one in ends if isinstance(one[0], dict)] == [True, True]
        assert harness.world.frame == frame


def test_failed_step_is_told_to_all_who_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    harness, (a, b) = members("a", "b", on_world_failure="serve")

    def fail(*_args: object, **_options: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr(type(harness.node.context.stepper), "compute", fail)
    ends = [tick(a, harness, "a"), tick(b, harness, "b")]
    assert all(isinstance(one, str) for (one,) in ends)


def test_barrier_of_one_gives_the_bytes_of_a_master() -> None:
    def drive(*, is_barrier: bool) -> tuple[str, list[bytes]]:
        harness = SimHarness(start="sync")
        client = harness.client()
        client.listen("/Ego_topic", "/Object_topic", "/clock")
        if is_barrier:
            join(client, "me")
        else:
            client.start("me")
        for frame in range(1, 20):
            client.control(frame, longlCmdType=2, velocity=30.0)
            client.tick("me", frame)
        return harness.world.digest(), client.raw

    assert drive(is_barrier=True) == drive(is_barrier=False)


def test_barrier_cannot_be_joined_from_within_a_tick() -> None:
    harness, (a,) = members("a")
    answers: list[Answer] = []
    harness.node.context.hooks.after_frame.append(
        lambda now: harness.bus.call(a, "/sim/barrier/leave", {"user_id": "a"}, answers.append, now=now)
    )
    a.tick("a")
    assert [answer.values for answer in answers] == ["/sim/barrier/leave: a tick is in progress"]

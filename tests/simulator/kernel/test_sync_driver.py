"""Ticks that wait: what refuses them, in which order they and what waits behind them are answered, and who is held."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, NoReturn

import pytest

from rosbridge_sim.graph.topics_services import Answer
from tests.simulator.kernel.test_frame_gate import Gated, Held, members
from tests.simulator.sim_harness import ALL, Client, ManualReader, SimHarness
from tests.simulator.sim_services.test_step_service import Turns, ask, in_sync, step, values

TICK = "/SyncModeWaitForTick"


def fail(*_: object) -> NoReturn:
    raise ZeroDivisionError("planted")


def tick(harness: SimHarness, client: Client, note: Callable[[Answer], None], user_id: str = "me") -> None:
    harness.bus.call(client, TICK, {"request": {"user_id": user_id, "frame": 0}}, note, now=harness.now)


def fail_in_the_next_turn(harness: SimHarness) -> None:
    harness.node.context.stepper.step = fail
    with suppress(ZeroDivisionError):  # the program ends with it
        harness.node.advance(harness.now)


def test_step_that_fails_in_a_later_turn_refuses_all_ticks_that_wait_in_their_order() -> None:
    harness, first = in_sync(time_step=200)
    harness.node.context.sync_driver.read_clock = Turns()
    answers: list[tuple[str, bool, object]] = []
    clients = {"first": first, "second": harness.client(), "third": harness.client()}

    def note(name: str, answer: Answer) -> None:
        answers.append((name, answer.is_ok, answer.values))

    for name, client in clients.items():
        tick(harness, client, partial(note, name))
    assert (harness.world.frame, answers) == (1, [])
    fail_in_the_next_turn(harness)
    assert [(name, is_ok) for name, is_ok, _ in answers] == [(name, False) for name in clients]
    assert all("the world has failed: ZeroDivisionError('planted')" in str(why) for _, _, why in answers)
    assert not harness.node.context.sync_driver.has_turn


@pytest.mark.parametrize("num_frames", [1, 10])
def test_step_that_fails_at_once_or_in_a_later_turn_is_told_to_all_members_of_a_barrier(num_frames: int) -> None:
    harness = SimHarness()
    clients = [harness.client(), harness.client()]
    answers: list[Answer] = []
    for client, name in zip(clients, "ab", strict=True):
        assert values(client.call("/sim/barrier/join", {"user_id": name, "time_step": 20 * num_frames}))["result"]
    harness.node.context.sync_driver.read_clock = Turns()
    tick(harness, clients[0], answers.append, "a")
    if num_frames == 1:
        harness.node.context.stepper.step = fail
    tick(harness, clients[1], answers.append, "b")
    if num_frames > 1:
        assert (harness.world.frame, answers) == (1, [])
        fail_in_the_next_turn(harness)
    assert [answer.is_ok and values(answer)["response"]["tick_status"] for answer in answers] == [False, False]


def test_no_frame_of_a_tick_that_waits_is_computed_in_a_world_that_has_failed_meanwhile() -> None:
    reader = ManualReader()
    harness, client = in_sync(reader=reader)
    request = {"request": {"file_name": "parked", "frame": 1, **ALL}}
    harness.bus.call(client, "/SyncModeScenarioLoad", request, lambda _: None, now=harness.now)
    answers: list[Answer] = []
    tick(harness, client, answers.append)
    harness.node.context.failure.note(ZeroDivisionError("planted"))
    reader.hand_over(now=harness.now)
    assert [(answer.is_ok, answer.values) for answer in answers] == [(False, harness.node.context.failure.why)]
    assert harness.world.frame == 0


def test_scenario_that_is_read_at_once_within_a_frame_begins_no_turn() -> None:
    harness, client = in_sync(time_step=100)
    harness.node.context.sync_driver.read_clock = Turns()
    request = {"request": {"file_name": "parked", "frame": 100, **ALL}}

    def load(now: float) -> None:
        if harness.world.frame == 2:
            harness.bus.call(harness.client(), "/SyncModeScenarioLoad", request, lambda _: None, now=now)

    harness.node.context.hooks.after_frame.append(load)
    answers: list[Answer] = []
    for each in (client, harness.client()):
        tick(harness, each, answers.append)
    for frame in range(1, 10):
        assert harness.world.frame == frame
        harness.node.advance(harness.now)
    assert [values(answer)["response"]["frame"] for answer in answers] == [5, 10]


@pytest.mark.parametrize(("time_step", "frame", "steps"), [(20, 3, 3), (40, 4, 2)])
def test_pause_by_a_component_ends_a_call_for_many_steps_behind_the_step_in_which_it_comes(
    time_step: int, frame: int, steps: int
) -> None:
    harness, client = in_sync(time_step)
    driver = harness.node.context.sync_driver

    def pause(now: float) -> None:
        if harness.world.frame == 3:
            driver.pause(now)

    harness.node.context.hooks.after_frame.append(pause)
    response = step(client, 10)
    assert (response["result"], response["steps"], response["stopped_by"]) == (False, steps, "interrupted")
    assert "the simulation was paused" in response["message"]
    assert (harness.world.frame, driver.num_ticks) == (frame, steps)


def test_steps_of_a_caller_that_has_left_are_given_up_although_a_scenario_is_being_read() -> None:
    harness, client = in_sync(reader=ManualReader())
    client.tick()
    request = {"request": {"file_name": "parked", "frame": 2, **ALL}}
    harness.bus.call(client, "/SyncModeScenarioLoad", request, lambda _: None, now=harness.now)
    gone = harness.client()
    ask(gone, harness, user_id="me", n=5)
    assert harness.node.sync.num_ticks == 5
    gone.leave()
    harness.run(0.0)
    assert (harness.node.sync.num_ticks, harness.node.sync.state.name, harness.world.frame) == (0, "LED", 1)


@pytest.mark.parametrize("service", [TICK, "/sim/step"])
def test_caller_that_is_answered_at_once_is_not_held(service: str) -> None:
    harness = Gated()
    harness.closes = False
    arguments: dict[str, Any] = {"user_id": "me", "n": 3} if service == "/sim/step" else {"request": {"user_id": "me"}}
    harness.ask(service, **arguments)
    assert (len(harness.answers), harness.master.num_holds) == (1, 0)
    assert not harness.node.sync.is_muted(harness.master)


# What waits behind a tick


def test_changes_behind_a_tick_are_made_in_their_order_when_it_is_answered_though_a_pause_comes_before() -> None:
    harness, made = Gated(), list[int]()
    driver = harness.node.context.sync_driver

    def make(number: int, _now: float) -> None:
        made.append(number)

    assert not driver.wait_for_tick(harness.master, partial(make, 0))
    harness.tick()
    harness.tick()
    for number in (1, 2, 3):
        assert driver.wait_for_tick(harness.master, partial(make, number))
    harness.ask("/Service_MoraiEventCmd", harness.client(), request={"option": 8, "set_pause": True})
    assert (harness.results, made) == ([False], [])
    harness.open()
    assert (harness.results, made) == ([False, True], [1, 2, 3])
    assert harness.master.num_holds == 0


def test_change_behind_a_tick_is_made_after_the_frame_in_which_a_component_pauses() -> None:
    harness, client = in_sync(time_step=200)
    context = harness.node.context
    context.sync_driver.read_clock = Turns()
    tick(harness, client, lambda _: None)
    made: list[tuple[int, bool]] = []
    context.sync_driver.wait_for_tick(client, lambda _: made.append((harness.world.frame, context.stepper.is_moving)))

    def pause(now: float) -> None:
        if harness.world.frame == 2:
            context.sync_driver.pause(now)
            assert made == []

    context.hooks.after_frame.append(pause)
    harness.run(0.0)
    assert made == [(10, False)]


def test_change_that_is_asked_for_within_a_frame_does_not_wait() -> None:
    harness, client = in_sync(time_step=200)
    driver, waits = harness.node.context.sync_driver, list[bool]()
    driver.read_clock = Turns()
    harness.node.context.hooks.after_frame.append(lambda _: waits.append(driver.wait_for_tick(client, fail)))
    tick(harness, client, lambda _: None)
    harness.run(0.0)
    assert waits == [False] * 10


# The barrier


def test_tick_of_a_barrier_waits_for_a_gate_that_was_closed_before_it() -> None:
    harness = Gated()
    a, b = members(harness, "a", "b")
    harness.closes = False
    harness.gate.close()
    harness.tick(a, "a")
    harness.tick(b, "b")
    assert (harness.world.frame, harness.results) == (0, [])
    harness.open()
    assert (harness.world.frame, harness.results) == (1, [True, True])


def test_members_of_a_new_barrier_are_not_answered_by_the_tick_of_the_one_before() -> None:
    harness = Gated()
    old = members(harness, "a", "b")
    for client, name in zip(old, "ab", strict=True):
        harness.tick(client, name)
    for client in old:
        client.now = harness.now
        client.leave()
    harness.answers.clear()
    new = Held(harness.bus, "/new")
    harness.ask("/sim/barrier/join", new, user_id="new")
    harness.tick(new, "new")
    assert (harness.world.frame, harness.results) == (1, [])
    harness.open()
    assert (harness.world.frame, harness.results) == (2, [])
    harness.open()
    assert (harness.world.frame, harness.results) == (2, [True])


def wait_with_a_scenario(harness: SimHarness, client: Client) -> list[Answer]:
    """A tick of a barrier that waits for a scenario: the answers that come."""
    request = {"request": {"file_name": "parked", "frame": harness.world.frame + 1, **ALL}}
    harness.bus.call(harness.client(), "/SyncModeScenarioLoad", request, lambda _: None, now=harness.now)
    answers: list[Answer] = []
    tick(harness, client, answers.append, "a")
    assert answers == []
    return answers


def joined(**settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - those of the node
    """A simulator whose scenarios are never read, and the only member of its barrier."""
    harness = SimHarness(reader=ManualReader(), **settings)
    client = harness.client()
    client.now = harness.now
    assert values(client.call("/sim/barrier/join", {"user_id": "a"}))["result"]
    return harness, client


def test_lease_of_a_member_counts_anew_from_the_refusal_of_its_tick_that_waited() -> None:
    harness, client = joined(sync_lease=1.0)
    wait_with_a_scenario(harness, client)
    harness.run(5.0)
    other = harness.client()
    other.now = harness.now
    other.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    harness.run(0.9)
    assert harness.node.context.barrier.status().members == ["a"]
    harness.run(0.2)
    assert harness.node.context.barrier.status().members == []


def test_barrier_does_not_end_while_its_members_are_heard_but_do_not_tick() -> None:
    harness, client = joined(sync_lease=1.0)
    for _ in range(4):
        client.now = harness.now
        client.control(1, longlCmdType=1, accel=0.5)
        harness.run(0.6)
    assert (harness.node.sync.state.name, harness.world.frame) == ("LED", 0)


@pytest.mark.parametrize(("is_pause", "is_told"), [(True, True), (False, False)])
def test_refused_tick_of_a_member_tells_of_a_pause_only_if_there_is_one(*, is_pause: bool, is_told: bool) -> None:
    harness, client = joined()
    answers = wait_with_a_scenario(harness, client)
    if is_pause:
        harness.client().ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    else:
        harness.client().call("/sim/reset", {"seed": -1})
    (answer,) = answers
    response = values(answer)["response"]
    assert (response["tick_status"], response["pause_status"]) == (False, is_told)


def test_components_are_told_of_each_change_of_the_mode_by_a_master() -> None:
    harness, modes = SimHarness(), list[str]()
    harness.node.context.hooks.on_mode_change.append(lambda _: modes.append(harness.node.sync.state.name))
    client = harness.client()
    client.start()
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    client.stop()
    assert modes == ["LED", "LED_PAUSED", "LED", "FREE"]


@pytest.mark.parametrize("end", ["leaves", "is lost"])
def test_components_are_told_when_a_barrier_begins_and_ends_to_lead(end: str) -> None:
    harness, modes = SimHarness(), list[str]()
    harness.node.context.hooks.on_mode_change.append(lambda _: modes.append(harness.node.sync.state.name))
    client = harness.client()
    client.now = harness.now
    client.call("/sim/barrier/join", {"user_id": "a"})
    assert modes == ["LED"]
    if end == "leaves":
        client.call("/sim/barrier/leave", {"user_id": "a"})
    else:
        client.leave()
    assert modes == ["LED", "FREE"]

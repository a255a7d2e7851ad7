"""The gate behind a frame: while it is closed, no frame of a tick is computed, and no tick is answered."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.kernel.frame_gate import FrameGate
from rosbridge_sim.world.state.world import World
from tests.simulator.sim_harness import Client, SimHarness


class Held(Client):
    """A client whose input can wait.

    Attributes:
        num_holds: of its input at present.
    """

    num_holds = 0

    def hold(self) -> Callable[[], None]:
        self.num_holds += 1

        def release() -> None:
            self.num_holds -= 1

        return release


class Gated(SimHarness):
    """A simulator in synchronous mode whose gate is closed behind each frame.

    Attributes:
        master: a client that ticks.
        answers: of the calls, in the order in which they came.
        closes: whether it closes the gate behind the frames that come.
    """

    def __init__(self, time_step: int = 20, **settings: Any) -> None:  # noqa: ANN401 - those of the node
        super().__init__(**settings)
        self.master = Held(self.bus, "/master")
        self.master.now = self.now
        self.master.start(time_step=time_step)
        self.answers: list[dict[str, Any] | str] = []
        self.closes = True
        self.gate: FrameGate = self.node.context.gate
        self.node.context.hooks.after_frame.append(self._close)

    def _close(self, _now: float) -> None:
        if self.closes:
            self.gate.close()

    def open(self) -> None:
        self.gate.open(self.now)
        self.run(0.0)

    def ask(self, service: str, client: Client | None = None, **args: Any) -> None:  # noqa: ANN401 - of the service
        """Call without waiting."""
        self.bus.call(client or self.master, service, args, self._note, now=self.now)
        self.run(0.0)

    def _note(self, answer: Answer) -> None:
        if not answer.is_ok:
            self.answers.append(str(answer.values))
            return
        assert isinstance(answer.values, Message)
        values = json.loads(answer.values.json)
        self.answers.append(values.get("response", values))

    def tick(self, client: Client | None = None, user_id: str = "me") -> None:
        self.ask("/SyncModeWaitForTick", client, request={"user_id": user_id, "frame": 0})

    @property
    def state(self) -> str:
        return self.node.sync.state.name

    @property
    def results(self) -> list[bool | str]:
        """Of the ticks among the calls."""
        return [
            answer if isinstance(answer, str) else answer["tick_status"]
            for answer in self.answers
            if "tick_status" in answer or isinstance(answer, str)
        ]


def test_gate_is_open_when_each_closing_has_been_undone() -> None:
    gate, opened = FrameGate(), list[float]()
    gate.on_open.append(opened.append)
    assert gate.is_open
    gate.close()
    gate.close()
    gate.open(1.0)
    assert not gate.is_open
    assert not opened
    gate.open(2.0)
    assert gate.is_open
    assert opened == [2.0]


def test_tick_is_answered_when_the_gate_is_open_and_the_next_one_waits_for_it() -> None:
    harness = Gated()
    harness.tick()
    harness.tick()
    assert (harness.world.frame, harness.results) == (1, [])
    harness.open()
    assert (harness.world.frame, harness.results) == (2, [True])
    harness.closes = False
    harness.open()
    harness.tick()
    assert (harness.world.frame, harness.results) == (3, [True] * 3)


def test_each_frame_of_a_tick_waits_for_what_is_missing_of_the_one_before() -> None:
    harness = Gated(time_step=60)
    harness.tick()
    for frame in (1, 2, 3):
        assert (harness.world.frame, harness.results) == (frame, [])
        harness.open()
    assert (harness.world.frame, harness.results) == (3, [True])


def test_call_for_several_steps_waits_behind_each_frame() -> None:
    harness = Gated()
    harness.ask("/sim/step", user_id="me", n=2)
    assert (harness.world.frame, harness.answers) == (1, [])
    harness.open()
    assert (harness.world.frame, harness.answers) == (2, [])
    harness.open()
    (answer,) = harness.answers
    assert isinstance(answer, dict)
    assert (answer["result"], answer["steps"]) == (True, 2)


@pytest.mark.parametrize("service", ["/SyncModeWaitForTick", "/sim/step", "/sim/spawn"])
def test_caller_is_held_until_it_is_answered_and_its_silence_does_not_count(service: str) -> None:
    harness = Gated(sync_lease=5.0)
    master = harness.master
    if service == "/sim/step":
        harness.ask(service, user_id="me", n=1)
    else:
        harness.tick()
    other = Held(harness.bus, "/other")
    if service == "/sim/spawn":
        harness.ask(service, other, objects=[{"model": "Child", "place": {"x": 100.0, "y": 300.0}}])
    assert (master.num_holds, other.num_holds) == (1, service == "/sim/spawn")
    harness.run(6.0)
    assert harness.answers == []
    assert harness.state == "LED"
    harness.open()
    assert (master.num_holds, other.num_holds) == (0, 0)
    harness.run(4.9)
    assert harness.state == "LED"
    harness.run(0.2)
    assert harness.state == "FREE"


def test_gate_that_is_opened_within_its_frame_holds_nothing() -> None:
    harness = Gated(time_step=40)
    harness.node.context.hooks.after_frame.append(harness.gate.open)
    harness.tick()
    assert (harness.world.frame, harness.results) == (2, [True])


def test_object_of_another_client_waits_for_the_answer_of_the_tick_before() -> None:
    harness = Gated()
    num = len(harness.world)
    harness.tick()
    box = {"model": "Child", "place": {"x": 100.0, "y": 300.0}}
    harness.ask("/sim/spawn", harness.client(), objects=[box])
    assert (len(harness.world), harness.answers) == (num, [])
    harness.open()
    assert len(harness.world) == num + 1
    tick, spawn = harness.answers
    assert isinstance(tick, dict)
    assert isinstance(spawn, dict)
    assert (tick["tick_status"], spawn["result"]) == (True, True)


def test_reset_refuses_the_tick_whose_gate_is_closed() -> None:
    harness = Gated()
    harness.tick()
    harness.ask("/sim/reset", harness.client())
    assert harness.world.frame == 0
    num = len(harness.answers)
    harness.open()
    assert (harness.results, len(harness.answers)) == ([False], num)


def test_step_that_fails_refuses_the_ticks_that_wait_for_the_gate() -> None:
    harness = Gated()
    harness.tick()
    harness.tick()

    def fail(_world: World, _place: object) -> None:
        raise RuntimeError("no")

    harness.node.context.stepper.step = fail
    harness.gate.open(harness.now)
    first, second = harness.results
    assert first is True
    assert second is not True


def members(harness: Gated, *names: str) -> list[Client]:
    """Clients that have joined a barrier in place of the master."""
    harness.master.stop()
    clients = [harness.client() for _ in names]
    for client, name in zip(clients, names, strict=True):
        harness.ask("/sim/barrier/join", client, user_id=name)
    harness.answers.clear()
    return clients


def test_members_of_a_barrier_are_answered_when_the_gate_is_open() -> None:
    harness = Gated()
    a, b = members(harness, "a", "b")
    harness.tick(a, "a")
    harness.tick(b, "b")
    assert (harness.world.frame, harness.results) == (1, [])
    harness.tick(a, "a")
    harness.tick(b, "b")
    assert (harness.world.frame, harness.results) == (1, [])
    harness.open()
    assert (harness.world.frame, harness.results) == (2, [True, True])
    harness.open()
    assert harness.results == [True] * 4


def test_barrier_that_ends_behind_a_closed_gate_is_not_answered_again() -> None:
    harness = Gated()
    a, b = members(harness, "a", "b")
    harness.tick(a, "a")
    harness.tick(b, "b")
    for client in (a, b):
        client.now = harness.now
        client.leave()
    answers = list(harness.results)
    harness.open()
    assert harness.results == answers
    assert True not in answers

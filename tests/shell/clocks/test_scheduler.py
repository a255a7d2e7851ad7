"""The timer: set for the next deadline, updated on changes, and stopped after a failure."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Literal, NoReturn, cast

import orjson
import pytest

from rosbridge_sim.graph.attach.mirror import Mirror
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.shell.clocks.scheduler import Scheduler
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.state.world import World
from tests.simulator.sim_harness import make_store


class Loop:
    """As much of an event loop as the clockwork uses, with a clock that the test moves."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.soon: list[Callable[[], None]] = []
        self.timers: list[Timer] = []

    def time(self) -> float:
        return self.now

    def call_soon(self, call: Callable[[], None]) -> None:
        self.soon.append(call)

    def call_at(self, when: float, call: Callable[[], None]) -> Timer:
        timer = Timer(when, call)
        self.timers.append(timer)
        return timer

    def create_future(self) -> Future[None]:
        return Future()

    def settle(self) -> int:
        """Do all that is to be done now; the number of turns it took."""
        turns = 0
        while self.soon:
            turns += 1
            self.soon.pop(0)()
        return turns

    @property
    def armed(self) -> list[float]:
        """When the timers that wait will ring."""
        return [timer.when for timer in self.timers if not timer.is_cancelled]

    def move_to(self, now: float) -> int:
        """Let the time come, ring what is due, and do what follows."""
        self.now = now
        due = [timer for timer in self.timers if timer.when <= now and not timer.is_cancelled]
        self.timers = [timer for timer in self.timers if timer not in due]
        for timer in due:
            timer.call()
        return self.settle()


@dataclass(eq=False)
class Timer:
    when: float
    call: Callable[[], None]
    is_cancelled: bool = False

    def cancel(self) -> None:
        self.is_cancelled = True


class SchedulerFixture:
    """A bus and a world whose time the test moves."""

    def __init__(self, start: Literal["run", "sync"] = "run", loop: Loop | None = None) -> None:
        self.loop = loop or Loop()
        self.bus = Bus(make_store(), service_timeout=1.0)
        library = DiskLibrary()
        settings = NodeSettings(start=start)
        self.node = make_node(self.bus, World(0), library, library.scenario("demo"), settings)
        self.failures: list[None] = []
        self.scheduler = Scheduler(
            cast("asyncio.AbstractEventLoop", self.loop), self.bus, [self.node], lambda: self.failures.append(None)
        )
        self.scheduler.look()
        self.loop.settle()

    @property
    def frame(self) -> int:
        return self.node.world.frame


def test_timer_is_set_for_the_next_frame_only() -> None:
    room = SchedulerFixture()
    for n in range(1, 20):
        assert room.loop.armed == [pytest.approx(1000.0 + n * 0.02)]
        room.loop.move_to(room.loop.armed[0])
        assert room.frame == n


def test_no_timer_is_set_while_only_a_tick_can_move_the_world() -> None:
    room = SchedulerFixture("sync")
    assert room.loop.armed == []


def test_several_changes_in_one_turn_reschedule_once() -> None:
    room = SchedulerFixture("sync")
    for _ in range(100):
        room.scheduler.look()
    assert room.loop.settle() == 1


def test_late_frames_are_computed_a_few_per_turn() -> None:
    room = SchedulerFixture()
    assert room.loop.move_to(1000.0 + 0.41) > 1
    assert room.frame == 20
    assert room.loop.armed == [pytest.approx(1000.0 + 0.42)]


def test_frames_of_a_stall_are_not_caught_up() -> None:
    room = SchedulerFixture()
    room.loop.move_to(1000.0 + 3600.0)
    assert room.frame == 1
    assert room.node.context.pacer.num_stalls == 1


def test_earlier_time_out_resets_the_timer() -> None:
    room = SchedulerFixture("sync")
    answers: list[Answer] = []
    caller, provider = SilentParticipant("/caller"), SilentParticipant("/provider")
    room.bus.provide(provider, "/silent", "std_srvs/Trigger", lambda _call, _now: None)
    for timeout in (3.0, 2.0):
        room.bus.call(caller, "/silent", None, answers.append, now=room.loop.now, timeout=timeout)
        room.scheduler.look()
        room.loop.settle()
        assert room.loop.armed == [1000.0 + timeout]
    room.loop.move_to(1002.0)
    assert len(answers) == 1
    assert room.loop.armed == [1003.0]
    room.loop.move_to(1003.0)
    assert len(answers) == 2
    assert room.loop.armed == []


class CountingClock:
    """A clock that is never due, and counts how often it is asked."""

    num_asked = 0

    def next_due(self, _now: float) -> None:
        self.num_asked += 1

    def advance(self, _now: float) -> None:
        raise AssertionError("it is never due")


def test_message_from_client_to_client_asks_no_clock_and_any_other_op_does() -> None:
    room, clock = SchedulerFixture("sync"), CountingClock()
    room.scheduler.add(clock)
    client, listener = (
        Peer(room.bus, Session(Outbox(OutboxLimits(), lambda: None, lambda: None), lambda _due: None)) for _ in range(2)
    )

    def asked_after(peer: Peer, **op: object) -> int:
        clock.num_asked = 0
        peer.receive(orjson.dumps(op), room.loop.now)
        room.scheduler.turn()
        return clock.num_asked

    name = {"topic": "/chatter", "type": "std_msgs/String"}
    assert asked_after(listener, op="subscribe", **name) == 1
    assert asked_after(client, op="publish", **name) == 1, "it advertises, too"
    assert asked_after(client, op="publish", topic="/chatter") == 0
    assert asked_after(client, op="call_service", service="/rosapi/topics") == 1
    assert asked_after(client, op="publish", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd") == 1
    assert asked_after(client, op="publish", topic="/ctrl_cmd") == 1, "the simulator takes it"
    listener.leave(room.loop.now)
    room.scheduler.turn()
    assert clock.num_asked == 2


def test_time_out_is_announced_and_sets_the_timer_without_a_full_look() -> None:
    room = SchedulerFixture("sync")
    room.bus.provide(SilentParticipant("/provider"), "/silent", "std_srvs/Trigger", lambda _call, _now: None)
    answers: list[Answer] = []
    room.bus.call(SilentParticipant("/caller"), "/silent", None, answers.append, now=room.loop.now, timeout=2.0)
    room.scheduler.turn()
    assert room.loop.armed == [1002.0]
    room.loop.move_to(1002.0)
    assert len(answers) == 1
    assert room.loop.armed == []


def test_time_stops_after_a_failure_that_is_reported_once() -> None:
    room = SchedulerFixture()
    room.node.context.hooks.place.append(lambda: 1 // 0)  # as good a bug as any
    room.loop.move_to(1000.02)
    assert room.scheduler.is_failed
    assert room.failures == [None]
    room.scheduler.look()
    room.loop.settle()
    assert room.loop.armed == []
    assert room.failures == [None]


def break_down(*_: object) -> NoReturn:
    raise ZeroDivisionError


@pytest.mark.parametrize("seam", ["next_due", "advance"])
def test_failed_republisher_ends_and_time_goes_on(seam: str, monkeypatch: pytest.MonkeyPatch) -> None:
    room = SchedulerFixture()
    republisher = WebRepublisher(room.bus)
    monkeypatch.setattr(republisher._actionlib, seam, break_down)
    republisher._alarm = room.loop.now
    room.scheduler.add(republisher)
    room.loop.move_to(1000.02)
    room.loop.move_to(1000.04)
    assert room.frame == 2
    assert not room.scheduler.is_failed
    assert room.bus.guard.num_faults == 1
    assert "/republish_tfs" not in room.bus.services
    assert republisher.next_due(room.loop.now) is None


@pytest.mark.parametrize("seam", ["next_due", "advance"])
def test_failed_bridge_is_reported_and_time_goes_on(seam: str, monkeypatch: pytest.MonkeyPatch) -> None:
    room, failures = SchedulerFixture(), list[Exception]()
    mirror = Mirror(room.bus, room.node.participant, "ws://far")
    mirror.on_failure = failures.append
    monkeypatch.setattr(mirror, seam, break_down)
    room.scheduler.add(mirror)
    room.loop.move_to(1000.02)
    room.loop.move_to(1000.04)
    assert room.frame == 2
    assert not room.scheduler.is_failed
    assert failures
    assert room.bus.guard.num_faults == len(failures)


def test_caller_that_fails_on_its_time_out_does_not_stop_the_world() -> None:
    room = SchedulerFixture()
    caller, provider = SilentParticipant("/caller"), SilentParticipant("/provider")
    room.bus.provide(provider, "/silent", "std_srvs/Trigger", lambda _call, _now: None)
    room.bus.call(caller, "/silent", None, break_down, now=room.loop.now, timeout=0.01)
    room.scheduler.look()
    room.loop.settle()
    room.loop.move_to(1000.01)
    room.loop.move_to(1000.02)
    assert room.frame == 1
    assert not room.scheduler.is_failed
    assert room.bus.guard.num_faults == 1


def test_failed_disconnect_does_not_stop_the_world() -> None:
    room = SchedulerFixture()

    class Broken:
        def next_due(self, _now: float) -> float:
            raise ZeroDivisionError

        def advance(self, _now: float) -> None:
            """Never called."""

        def end(self, _error: Exception) -> None:
            raise ValueError

    room.scheduler.add(Broken())
    room.loop.move_to(1000.02)
    assert room.frame == 1
    assert not room.scheduler.is_failed


@dataclass(eq=False)
class SilentParticipant(Participant):
    """An owner that says nothing."""

    name: str

    def notify(self, level: str, text: str) -> None:
        """Nobody listens."""


class CoarseLoop(Loop):
    """An event loop as on Windows: its clock moves in steps, and a wait ends at one.

    It rings what is due within a step, as asyncio's loop does, which allows for the clock's resolution.
    """

    STEP = 1 / 64

    def __init__(self) -> None:
        super().__init__()
        self.real = self.now
        self.num_turns = 0

    def run_until(self, end: float) -> None:
        while self.real < end:
            wait = 0.0 if self.soon else max(0.0, min(self.armed) - self.now)
            if wait:
                self.real = (math.floor(self.real / self.STEP) + max(1, math.ceil(wait / self.STEP))) * self.STEP
            self.now = math.floor(self.real / self.STEP) * self.STEP
            due = [timer for timer in self.timers if timer.when < self.now + self.STEP and not timer.is_cancelled]
            self.timers = [timer for timer in self.timers if timer not in due]
            for timer in due:
                timer.call()
            soon, self.soon = self.soon, []
            for call in soon:
                call()
            self.num_turns += 1


def test_real_time_is_right_where_timers_are_coarse() -> None:
    loop = CoarseLoop()
    room = SchedulerFixture(loop=loop)
    for second in range(1, 4):
        loop.run_until(1000.0 + second)
        assert 0 <= 50 * second - room.frame <= 1
    assert room.node.context.pacer.num_stalls == 0
    assert loop.num_turns <= 2 * 3 / loop.STEP, "it waits, and does not spin"


class Backlog:
    """A clock that has a lot of work from a time on."""

    def __init__(self, begin: float) -> None:
        self.begin = begin
        self.num_turns = 0

    def next_due(self, now: float) -> float:
        return max(now, self.begin)

    def advance(self, now: float) -> None:
        self.num_turns += now >= self.begin


def test_one_pass_of_the_loop_has_one_turn_with_work() -> None:
    loop = Loop()
    clock = Backlog(loop.now + 1.0)
    bus = Bus(make_store())
    scheduler = Scheduler(cast("asyncio.AbstractEventLoop", loop), bus, [clock], lambda: None)
    scheduler.turn()
    loop.now += 1.0
    (timer,) = loop.timers
    for num in range(1, 5):
        if num == 1:
            timer.call()
        now, loop.soon = loop.soon, []
        scheduler.turn()  # after the frames of clients
        for call in now:
            call()
        scheduler.turn()
        assert clock.num_turns == num

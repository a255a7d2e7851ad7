"""Synchronous mode: the table row by row, and invariants under any order of events."""

from __future__ import annotations

from collections.abc import Callable

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.simulator.sync.sync_table import (
    FRAME_MS,
    MAX_AHEAD,
    MAX_STEP_MS,
    MAX_USER_ID,
    MAX_WAITING_COMMANDS,
    NO_MASTER,
    PAUSED,
    SYNC_TABLE,
    SyncEffect,
    SyncEvent,
    SyncOutcome,
    SyncState,
)

OF_A_MASTER = frozenset(
    {
        SyncEvent.START_BY_MASTER,
        SyncEvent.STOP_BY_MASTER,
        SyncEvent.TICK_BY_MASTER,
        SyncEvent.TICK_MISFIT,
        SyncEvent.TICK_EARLY,
        SyncEvent.LOSS_TO_RUN,
        SyncEvent.LOSS_TO_PAUSE,
        SyncEvent.LOSS_TO_WAIT,
    }
)
"""Events that need a master: the table has no row for them in the states of `NO_MASTER`."""

OF_WAITING = frozenset({SyncEvent.TURN, SyncEvent.LAST_DONE})
"""Events that take a tick that waits: the table has rows for them in WAITING alone."""


ME, YOU = "me", "you"  # peers; any hashable will do
FRAME = 100  # the world's, wherever it does not matter


def a_sync(state: SyncState, *, on_loss: str = "run", is_strict: bool = False) -> Sync[str]:
    """A Sync brought into `state` by what peers can do; its master, if any, is `boss`, held by ME."""
    is_on = state in (SyncState.OPEN, SyncState.OPEN_PAUSED)
    sync: Sync[str] = Sync(is_on=is_on, on_loss=on_loss, lease=5.0, is_strict=is_strict)  # type: ignore[arg-type]
    if state in (SyncState.LED, SyncState.LED_PAUSED, SyncState.WAITING):
        sync.start("boss", 40, ME, 0.0)
    if state in (SyncState.FREE_PAUSED, SyncState.OPEN_PAUSED, SyncState.LED_PAUSED):
        sync.pause(1.0)
    if state is SyncState.WAITING:
        sync.submit("scenario", FRAME + 1, FRAME, YOU, 0.0, is_ready=False)
        sync.tick("boss", FRAME + 2, FRAME, ME, 0.0)
    assert sync.state is state
    return sync


def is_possible(state: SyncState, event: SyncEvent) -> bool:
    """Whether an event can happen in a state: some take a master, some a tick that waits."""
    if event in OF_WAITING:
        return state is SyncState.WAITING
    return event not in OF_A_MASTER or state not in NO_MASTER


def tick(sync: Sync[str]) -> SyncOutcome:
    """A tick of the master that all commands are ready for."""
    sync.ready("scenario")
    return sync.tick("boss", FRAME + sync.num_frames, FRAME, ME, 1.0)


def tick_early(sync: Sync[str]) -> SyncOutcome:
    """A tick of the master before which a command is still being read."""
    sync.submit("another", FRAME + 1, FRAME, YOU, 1.0, is_ready=False)
    return sync.tick("boss", FRAME + sync.num_frames, FRAME, ME, 1.0)


def crowded(sync: Sync[str]) -> Sync[str]:
    for _ in range(MAX_WAITING_COMMANDS):
        sync.submit("x", FRAME + 1, FRAME, YOU, 0.0)
    return sync


ACTS: dict[SyncEvent, Callable[[Sync[str]], SyncOutcome | None]] = {
    SyncEvent.START_BY_MASTER: lambda s: s.start("boss", 60, ME, 1.0),
    SyncEvent.START_BY_OTHER: lambda s: s.start("rival", 20, YOU, 1.0),
    SyncEvent.START_MISFIT: lambda s: s.start("boss", 30, ME, 1.0),
    SyncEvent.STOP_BY_MASTER: lambda s: s.stop("boss", 1.0),
    SyncEvent.STOP_BY_OTHER: lambda s: s.stop("rival", 1.0),
    SyncEvent.TICK_BY_MASTER: tick,
    SyncEvent.TICK_EARLY: tick_early,
    SyncEvent.TICK_BY_OTHER: lambda s: s.tick("rival", FRAME + 1, FRAME, YOU, 1.0),
    SyncEvent.TICK_MISFIT: lambda s: s.tick("boss", FRAME, FRAME, ME, 1.0),
    SyncEvent.COMMAND: lambda s: s.submit("go", FRAME + 1, FRAME, YOU, 1.0),
    SyncEvent.COMMAND_TOO_FAR: lambda s: s.submit("go", FRAME + MAX_AHEAD + 3, FRAME, YOU, 1.0),
    SyncEvent.COMMAND_TOO_MANY: lambda s: crowded(s).submit("go", FRAME + 1, FRAME, YOU, 1.0),
    SyncEvent.PAUSE: lambda s: s.pause(1.0),
    SyncEvent.RESUME: lambda s: s.resume(1.0),
    SyncEvent.LOSS_TO_RUN: lambda s: s.leave(ME, 1.0),
    SyncEvent.LOSS_TO_PAUSE: lambda s: s.leave(ME, 1.0),
    SyncEvent.LOSS_TO_WAIT: lambda s: s.leave(ME, 1.0),
    SyncEvent.RESET: lambda s: s.forget(1.0),
}
ON_LOSS = {SyncEvent.LOSS_TO_RUN: "run", SyncEvent.LOSS_TO_PAUSE: "pause", SyncEvent.LOSS_TO_WAIT: "wait"}


def test_only_resuming_ends_a_pause_and_lets_time_flow() -> None:
    for state in PAUSED:
        for event, outcome in SYNC_TABLE[state].items():
            is_resumed = event is SyncEvent.RESUME
            assert (outcome.state in PAUSED) is not is_resumed, (state, event)
            assert is_resumed or SyncEffect.FLOW not in outcome.effects, (state, event)


def test_without_a_master_no_state_is_led() -> None:
    for state, rows in SYNC_TABLE.items():
        for event, outcome in rows.items():
            has_master = (state not in NO_MASTER or SyncEffect.LEAD in outcome.effects) and (
                SyncEffect.RELEASE not in outcome.effects
            )
            assert (outcome.state not in NO_MASTER) is has_master, (state, event)


@pytest.mark.parametrize("state", SyncState)
@pytest.mark.parametrize("event", SyncEvent)
def test_every_state_handles_every_event_as_in_the_table(state: SyncState, event: SyncEvent) -> None:
    if event in OF_WAITING:
        return  # see below
    if not is_possible(state, event):
        assert event not in SYNC_TABLE[state]
        return
    sync = a_sync(state, on_loss=ON_LOSS.get(event, "run"), is_strict=event is SyncEvent.TICK_MISFIT)
    before = (sync.master_id, sync.step_ms)
    outcome = ACTS[event](sync)
    assert outcome == SYNC_TABLE[state][event]
    assert sync.state is outcome.state
    assert bool(outcome.why) is not outcome.is_accepted
    if not outcome.is_accepted:
        assert sync.state is state
        assert not outcome.effects
        assert (sync.master_id, sync.step_ms) == before
    check_invariants(sync)


@pytest.mark.parametrize("state", SyncState)
@pytest.mark.parametrize("event", SyncEvent)
def test_effects_beyond_the_mode_call_their_hooks_in_the_order_of_the_row(state: SyncState, event: SyncEvent) -> None:
    if event in OF_WAITING or not is_possible(state, event):
        return
    sync = a_sync(state, on_loss=ON_LOSS.get(event, "run"), is_strict=event is SyncEvent.TICK_MISFIT)
    called: list[SyncEffect] = []
    sync.hooks.move = lambda _num_frames, _now: called.append(SyncEffect.MOVE)
    sync.hooks.refuse = lambda _why, _now: called.append(SyncEffect.REFUSE)
    sync.hooks.flow = lambda _now: called.append(SyncEffect.FLOW)
    sync.hooks.announce = lambda _now: called.append(SyncEffect.ANNOUNCE)
    outcome = ACTS[event](sync)
    assert outcome is not None
    beyond = {SyncEffect.MOVE, SyncEffect.REFUSE, SyncEffect.FLOW, SyncEffect.ANNOUNCE}
    assert called == [effect for effect in outcome.effects if effect in beyond]


def test_hooks_are_called_when_the_state_has_changed_and_with_the_time_of_the_event() -> None:
    sync = a_sync(SyncState.WAITING)
    seen: list[tuple[object, ...]] = []
    sync.hooks.refuse = lambda why, now: seen.append((sync.state, sync.master_id, sync.num_ticks, why[:28], now))
    sync.hooks.flow = lambda now: seen.append((sync.state, now))
    sync.stop("boss", 7.5)
    assert seen == [(SyncState.FREE, "", 0, "synchronous mode has ended, ", 7.5), (SyncState.FREE, 7.5)]


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (lambda s: s.pause(1.0), "the simulation was paused while"),
        (lambda s: s.forget(1.0), "the simulation was reset while"),
        (lambda s: s.leave(ME, 1.0), "synchronous mode has ended, or its master was lost, while"),
    ],
)
def test_ticks_that_wait_are_refused_with_the_reason(act: Callable[[Sync[str]], object], why: str) -> None:
    sync = a_sync(SyncState.WAITING)
    texts: list[str] = []
    sync.hooks.refuse = lambda text, _now: texts.append(text)
    act(sync)
    assert [text.startswith(why) for text in texts] == [True]


def test_tick_and_turn_move_the_frames_of_the_step_in_force_when_the_tick_came() -> None:
    sync = a_sync(SyncState.WAITING)  # its tick has 2 frames
    moved: list[tuple[int, float]] = []
    sync.hooks.move = lambda num_frames, now: moved.append((num_frames, now))
    waiting: list[int] = []
    sync.start("boss", 100, ME, 1.0)
    sync.tick("boss", 0, FRAME, ME, 2.0, on_wait=lambda: waiting.append(sync.num_ticks))
    assert (moved, waiting) == ([], [2])
    sync.ready("scenario")
    sync.take_turn(FRAME, 3.0)
    sync.take_turn(FRAME + 2, 4.0)
    sync.tick("boss", 0, FRAME + 7, ME, 5.0, on_wait=lambda: waiting.append(sync.num_ticks))
    assert (moved, waiting) == ([(2, 3.0), (5, 4.0), (5, 5.0)], [2])


def test_waiting_ticks_run_in_order_once_their_commands_are_ready() -> None:
    sync = a_sync(SyncState.WAITING)
    sync.tick("boss", 0, FRAME, ME, 1.0)
    assert (sync.num_ticks, sync.take_turn(FRAME, 1.0)) == (2, 0)
    sync.ready("scenario")
    assert sync.take_turn(FRAME, 1.0) == 2
    assert sync.state is SYNC_TABLE[SyncState.WAITING][SyncEvent.TURN].state
    check_invariants(sync)
    assert sync.due(FRAME + 1) == ["scenario"]
    assert sync.take_turn(FRAME + 2, 1.0) == 2
    assert sync.state is SYNC_TABLE[SyncState.WAITING][SyncEvent.LAST_DONE].state
    check_invariants(sync)
    assert sync.take_turn(FRAME + 4, 1.0) == 0


def test_every_row_of_the_table_can_happen() -> None:
    assert {(s, e) for s, rows in SYNC_TABLE.items() for e in rows} == {
        (s, e) for s in SyncState for e in SyncEvent if is_possible(s, e)
    }


@pytest.mark.parametrize("state", SyncState)
def test_only_an_accepted_tick_of_the_master_moves_the_world(state: SyncState) -> None:
    movers = {event for event, outcome in SYNC_TABLE[state].items() if SyncEffect.MOVE in outcome.effects}
    allowed = {SyncState.LED: {SyncEvent.TICK_BY_MASTER}, SyncState.WAITING: {SyncEvent.TURN}}
    assert movers == allowed.get(state, set())


@pytest.mark.parametrize("state", SyncState)
def test_ticks_wait_in_one_state_and_are_refused_when_it_ends(state: SyncState) -> None:
    for event, outcome in SYNC_TABLE[state].items():
        assert (SyncEffect.WAIT not in outcome.effects) or outcome.state is SyncState.WAITING
        ends = state is SyncState.WAITING is not outcome.state and SyncEffect.MOVE not in outcome.effects
        ends = ends and event is not SyncEvent.LAST_DONE  # nobody waits for those any more
        assert (SyncEffect.REFUSE in outcome.effects) == ends, event


@pytest.mark.parametrize("state", SyncState)
def test_real_time_flows_exactly_when_the_world_becomes_free(state: SyncState) -> None:
    for outcome in SYNC_TABLE[state].values():
        assert (SyncEffect.FLOW in outcome.effects) == (outcome.state is SyncState.FREE is not state)


def check_invariants(sync: Sync[str]) -> None:
    has_master = sync.state not in NO_MASTER
    assert bool(sync.master_id) is has_master
    assert (len(sync._holders) > 0) is has_master
    assert sync.is_on or len(sync.waiting()) == 0
    assert len(sync.waiting()) <= MAX_WAITING_COMMANDS
    assert (sync.num_ticks > 0) is (sync.state is SyncState.WAITING)
    assert sync.step_ms % FRAME_MS == 0
    assert 0 < sync.step_ms <= MAX_STEP_MS
    assert sync.num_frames == sync.step_ms // FRAME_MS
    assert (sync.lease_due is not None) is has_master
    assert sync.can_send_tick is (has_master and not sync.is_paused)
    assert sync.is_free is not (sync.is_on or sync.is_paused)


IDS = st.sampled_from(["", "a", "b", "sync-1", "sync-2", "x" * (MAX_USER_ID + 1)])
PEERS = st.sampled_from(["p", "q", "r"])
STEPS = st.sampled_from([0, 20, 30, 40, 1000, 1020, 2**32 - 1])
OFFSETS = st.sampled_from([-5, 0, 1, 2, 3, 7, MAX_AHEAD, MAX_AHEAD + 1])


class AnyOrder(RuleBasedStateMachine):
    """A slow, literal reading of the rules beside the real one."""

    def __init__(self) -> None:
        super().__init__()
        self.sync: Sync[str] = Sync(on_loss="wait", lease=10.0)
        self.now = 0.0
        self.frame = 50
        self.waiting: list[tuple[int, str]] = []
        self.unready: dict[str, int] = {}
        self.ticks: list[int] = []
        self.numbers: list[int] = []  # of the ticks that wait: the how many-th each is
        self.behind: dict[
            str, tuple[int, dict[int, int]]
        ] = {}  # command: frame named, (number: frames) of ticks before
        self.num_sent = self.num_ticks = 0
        self.limit: int | None = None  # frames that a turn computes at most
        self.sync.hooks.move = lambda num, _now: None if self.limit is None else min(num, self.limit)

    @property
    def end(self) -> int:
        """The frame on which the ticks that wait will end."""
        return self.frame + sum(self.ticks)

    def drop(self) -> None:
        self.waiting.clear()
        self.unready.clear()
        self.ticks.clear()
        self.numbers.clear()

    def queue(self, num_frames: int, num: int = 1) -> None:
        """Have ticks wait."""
        self.ticks += [num_frames] * num
        self.numbers += range(self.num_ticks, self.num_ticks + num)
        self.num_ticks += num

    def take(self, num: int = 1) -> list[int]:
        """Take the first ticks out; return their frames."""
        taken, self.ticks = self.ticks[:num], self.ticks[num:]
        self.numbers = self.numbers[num:]
        return taken

    def forgo(self, num: int) -> None:
        """Have the first ticks given up: what came behind them moves forward, down to the frame it names."""
        gone = dict(zip(self.numbers[:num], self.take(num), strict=True))
        for i, (due, command) in enumerate(self.waiting):
            named, before = self.behind[command]
            moved = max(named, due - sum(frames for number, frames in gone.items() if number in before))
            self.waiting[i] = (moved, command)
            if command in self.unready:
                self.unready[command] = moved

    def move(self, num_frames: int) -> None:
        for _ in range(num_frames):
            self.frame += 1
            due = [c for f, c in self.waiting if f == self.frame]
            assert self.sync.due(self.frame) == due
            assert not self.unready.keys() & due
            self.waiting = [(f, c) for f, c in self.waiting if f > self.frame]

    @rule(user_id=IDS, step=STEPS, peer=PEERS)
    def start(self, user_id: str, step: int, peer: str) -> None:
        master, before = self.sync.master_id, self.sync.step_ms
        outcome = self.sync.start(user_id, step, peer, self.now)
        fits = (step or 20) % 20 == 0 and step <= MAX_STEP_MS and len(user_id) <= MAX_USER_ID
        assert outcome.is_accepted == (fits and (not master or user_id == master))
        assert self.sync.step_ms == ((step or 20) if outcome.is_accepted else before)
        assert self.sync.master_id == ((user_id or self.sync.master_id) if outcome.is_accepted else master)

    @rule(user_id=IDS)
    def stop(self, user_id: str) -> None:
        master = self.sync.master_id
        outcome = self.sync.stop(user_id, 1.0)
        assert outcome.is_accepted == (not master or user_id == master)
        if outcome.is_accepted:
            self.drop()
            assert not self.sync.is_on

    @rule(user_id=IDS, offset=OFFSETS, peer=PEERS)
    def tick(self, user_id: str, offset: int, peer: str) -> None:
        may = bool(user_id) and user_id == self.sync.master_id and not self.sync.is_paused
        outcome = self.sync.tick(user_id, max(0, self.frame + offset), self.frame, peer, self.now)
        assert outcome.is_accepted == may
        if may:
            num_frames = self.sync.num_frames
            is_early = any(due <= self.end + num_frames for due in self.unready.values())
            waits = bool(self.ticks) or is_early
            assert outcome.effects == ((SyncEffect.WAIT,) if waits else (SyncEffect.MOVE,))
            if waits:
                self.queue(num_frames)
            else:
                self.move(num_frames)

    @rule(user_id=IDS, num=st.sampled_from([1, 2, 3]), peer=PEERS)
    def step(self, user_id: str, num: int, peer: str) -> None:
        may = bool(user_id) and user_id == self.sync.master_id and not self.sync.is_paused
        calls: list[int] = []
        outcome = self.sync.step(user_id, num, peer, self.now, on_wait=lambda: calls.append(num))
        assert (outcome.is_accepted, calls) == (may, [num] if may else [])
        if may:
            self.queue(self.sync.num_frames, num)

    @rule(user_id=IDS, peer=PEERS)
    def step_now(self, user_id: str, peer: str) -> None:
        prepared: list[int] = []
        is_free = bool(user_id) and user_id == self.sync.master_id and not self.sync.is_paused and not self.ticks
        is_early = any(due <= self.end + 1 for due in self.unready.values())
        can = is_free and self.sync.num_frames == 1 and not is_early
        is_done = self.sync.step_now(user_id, self.frame, peer, self.now, prepare=lambda: prepared.append(self.frame))
        assert (is_done, prepared) == (can, [self.frame] if can else [])
        if can:
            self.move(1)

    @precondition(lambda self: bool(self.ticks))
    @rule(data=st.data())
    def give_up(self, data: st.DataObject) -> None:
        num = data.draw(st.integers(1, len(self.ticks)))
        self.sync.give_up(num, self.now)
        self.forgo(num)
        assert (self.sync.state is SyncState.WAITING) == bool(self.ticks)

    @rule(most_ticks=st.integers(1, 3), limit=st.sampled_from([None, 1, 2, 51]))
    def take_turn(self, most_ticks: int, limit: int | None) -> None:
        most_ticks = max(1, min(most_ticks, len(self.ticks)))
        prepared: list[int] = []
        begun, self.limit = self.sync.is_in_tick, limit
        num_frames = self.sync.take_turn(
            self.frame, 1.0, prepare=lambda: prepared.append(self.frame), most_ticks=most_ticks
        )
        self.limit = None
        can_go = bool(self.ticks) and all(due > self.frame + self.ticks[0] for due in self.unready.values())
        ticks = self.ticks[:1] if self.waiting else self.ticks[:most_ticks]
        assert num_frames == (min(sum(ticks), limit or sum(ticks)) if can_go else 0)
        assert prepared == ([self.frame] if can_go and not begun else [])
        left = num_frames
        while left and self.ticks[0] <= left:
            left -= self.take()[0]
        if left:
            self.ticks[0] -= left
        assert self.sync.is_in_tick == (left > 0 or (begun and not can_go))
        self.move(num_frames)

    @rule(is_usable=st.booleans())
    def read(self, *, is_usable: bool) -> None:
        """What has been read for longest is there, or is not to be had."""
        command = next(iter(self.unready), "dropped long ago")
        self.unready.pop(command, None)
        if is_usable:
            self.sync.ready(command)
        else:
            self.sync.withdraw(command)
            self.waiting = [(f, c) for f, c in self.waiting if c != command]

    @rule()
    def reset(self) -> None:
        self.sync.forget(1.0)
        self.drop()
        self.frame = 0

    @rule(offset=OFFSETS, peer=PEERS, is_ready=st.booleans())
    def submit(self, offset: int, peer: str, *, is_ready: bool) -> None:
        self.num_sent += 1
        command, named = f"command {self.num_sent}", self.frame + offset
        outcome = self.sync.submit(command, named, self.frame, peer, self.now, is_ready=is_ready)
        assert outcome.is_accepted == (self.sync.is_on and named <= self.end + MAX_AHEAD)
        if outcome.is_accepted:
            self.behind[command] = named, dict(zip(self.numbers, self.ticks, strict=True))
            self.waiting.append((max(named, self.end + 1), command))
            if not is_ready:
                self.unready[command] = self.waiting[-1][0]

    @rule()
    def pause(self) -> None:
        is_on = self.sync.is_on
        self.sync.pause(1.0)
        self.forgo(len(self.ticks))
        assert self.sync.is_paused
        assert self.sync.is_on == is_on

    @rule()
    def resume(self) -> None:
        is_on = self.sync.is_on
        self.sync.resume(1.0)
        assert not self.sync.is_paused
        assert self.sync.is_on == is_on

    @rule(peer=PEERS)
    def leave(self, peer: str) -> None:
        self.after_loss(self.sync.leave(peer, 1.0))

    @rule(seconds=st.sampled_from([0.0, 1.0, 9.0, 10.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.after_loss(self.sync.expire(self.now))

    def after_loss(self, outcome: SyncOutcome | None) -> None:
        if outcome is not None:
            self.drop()
            assert self.sync.is_on
            assert self.sync.master_id == ""

    @invariant()
    def rules_hold(self) -> None:
        check_invariants(self.sync)
        assert len(self.sync.waiting()) == len(self.waiting)
        assert self.sync.num_ticks == len(self.ticks)


AnyOrder.TestCase.settings = settings(
    max_examples=15, stateful_step_count=30, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
TestAnyOrder = AnyOrder.TestCase


def test_command_during_waiting_ticks_is_for_the_frame_after_them() -> None:
    """The client has sent it after the ticks, so it must not act on the frames that they compute."""
    sync: Sync[str] = Sync()
    sync.start("me", 40, ME, 0.0)
    sync.submit("scenario", 11, 10, ME, 0.0, is_ready=False)
    for _ in range(2):
        assert sync.tick("me", 0, 10, ME, 0.0).effects == (SyncEffect.WAIT,)
    sync.submit("brake", 0, 10, ME, 0.0)
    sync.ready("scenario")
    assert [sync.due(frame) for frame in range(11, 16)] == [["scenario"], [], [], [], ["brake"]]


def test_generated_ids_start_again_at_a_reset_unless_one_is_in_use() -> None:
    """A reset run is the same as the first one; but two masters must never have the same id."""
    sync: Sync[str] = Sync()
    sync.start("", 20, ME, 0.0)
    first = sync.master_id
    sync.stop(first, 1.0)
    sync.forget(1.0)
    sync.start("", 20, ME, 0.0)
    assert sync.master_id == first
    sync.forget(1.0)
    sync.stop(first, 1.0)
    sync.start("", 20, ME, 0.0)
    assert sync.master_id != first


@pytest.mark.parametrize("way", ["drop", "withdraw"])
def test_remaining_commands_keep_the_order_of_their_frames(way: str) -> None:
    """A heap that lost entries is no heap: a late command hides an early one, which is then carried out too late."""
    sync: Sync[str] = Sync()
    sync.start("me", 20, ME, 0.0)
    commands = {named: f"for {named}" for named in (1, 5, 2, 6, 7, 3, 4)}
    for named, command in commands.items():
        sync.submit(command, named, 0, ME, 0.0, is_ready=named != 1)
    if way == "drop":
        assert sync.drop(lambda command: command is commands[1]) == 1
    else:
        sync.withdraw(commands[1])
    assert [sync.due(frame) for frame in range(1, 8)] == [[], *([commands[frame]] for frame in range(2, 8))]


def test_generated_ids_are_the_same_on_every_run() -> None:
    def run() -> list[str]:
        sync: Sync[str] = Sync()
        ids = []
        for _ in range(3):
            sync.start("", 20, ME, 0.0)
            ids.append(sync.master_id)
            sync.stop(sync.master_id, 1.0)
        return ids

    assert run() == run() == ["sync-1", "sync-2", "sync-3"]


def test_a_time_step_of_zero_is_one_frame() -> None:
    sync: Sync[str] = Sync()
    assert sync.start("a", 0, ME, 0.0).is_accepted
    assert (sync.step_ms, sync.num_frames) == (20, 1)


def test_master_may_change_its_time_step_and_keep_waiting_commands() -> None:
    sync: Sync[str] = Sync()
    sync.start("a", 20, ME, 0.0)
    sync.submit("go", 5, 0, ME, 0.0)
    assert sync.start("a", 100, YOU, 0.0).is_accepted
    assert (sync.num_frames, len(sync.waiting()), len(sync._holders)) == (5, 1, 2)


def test_commands_keep_their_order_of_arrival_within_their_frame() -> None:
    sync: Sync[str] = Sync()
    sync.start("a", 20, ME, 0.0)
    for command, named in [("late", 12), ("past", 3), ("next", 11), ("now", 10), ("later", 12)]:
        assert sync.submit(command, named, 10, ME, 0.0).is_accepted
    assert sync.due(11) == ["past", "next", "now"]
    assert sync.due(12) == ["late", "later"]
    assert sync.due(13) == []


def test_strict_frames_take_only_the_frame_that_the_tick_ends_on() -> None:
    sync: Sync[str] = Sync(is_strict=True)
    sync.start("a", 40, ME, 0.0)
    assert [named for named in range(8, 16) if sync.tick("a", named, 10, ME, 0.0).is_accepted] == [12]


def test_any_client_may_stop_if_allowed() -> None:
    sync: Sync[str] = Sync(may_anyone_stop=True)
    sync.start("a", 20, ME, 0.0)
    assert sync.stop("somebody", 1.0).is_accepted
    assert sync.is_free


def test_empty_id_can_neither_tick_nor_become_master() -> None:
    sync: Sync[str] = Sync(is_on=True)
    assert not sync.tick("", 1, 0, ME, 0.0).is_accepted
    sync.start("a", 20, ME, 0.0)
    assert not sync.tick("", 1, 0, ME, 0.0).is_accepted
    assert not sync.start("", 20, YOU, 0.0).is_accepted
    assert sync.master_id == "a"


def test_the_lease_ends_with_the_last_holder_of_the_id() -> None:
    sync: Sync[str] = Sync()
    sync.start("a", 20, ME, 0.0)
    sync.tick("a", 1, 0, YOU, 0.0)
    sync.tick("b", 1, 0, "stranger", 0.0)  # did not use the master's id with success
    assert sync.leave("stranger", 1.0) is None
    assert sync.leave(ME, 1.0) is None
    assert sync.leave(ME, 1.0) is None
    assert sync.leave(YOU, 1.0) is not None
    assert sync.is_free


def test_silence_ends_the_lease_and_any_message_renews_it() -> None:
    sync: Sync[str] = Sync(lease=5.0, on_loss="pause")
    assert sync.lease_due is None
    sync.start("a", 20, ME, 10.0)
    assert sync.lease_due == 15.0
    sync.tick("a", 1, 0, ME, 12.0)
    sync.submit("go", 2, 1, ME, 14.0)
    sync.submit("go", 2, 1, YOU, 16.0)  # no holder
    assert sync.expire(18.9) is None
    assert sync.expire(19.0) is not None
    assert sync.state is SyncState.FREE_PAUSED
    assert sync.expire(100.0) is None


def test_silence_does_not_count_while_a_holder_is_held() -> None:
    sync: Sync[str] = Sync(lease=5.0)
    sync.start("a", 20, ME, 10.0)
    sync.mute(YOU)  # no holder
    assert sync.lease_due == 15.0
    sync.mute(ME)
    sync.mute(ME)
    assert sync.lease_due is None
    assert sync.expire(100.0) is None
    sync.unmute(ME, 100.0)
    assert sync.expire(200.0) is None
    sync.unmute(ME, 200.0)
    assert sync.lease_due == 205.0
    sync.unmute(YOU, 204.0)
    assert sync.expire(205.0) is not None


def test_waiting_tick_keeps_its_time_step_and_strict_frames_count_it() -> None:
    sync: Sync[str] = Sync(is_strict=True)
    sync.start("a", 40, ME, 0.0)
    sync.submit("scenario", 12, 10, ME, 0.0, is_ready=False)
    assert sync.tick("a", 12, 10, ME, 0.0).effects == (SyncEffect.WAIT,)
    sync.start("a", 100, YOU, 0.0)
    assert not sync.tick("a", 15, 10, YOU, 0.0).is_accepted
    assert sync.tick("a", 17, 10, YOU, 0.0).is_accepted
    sync.ready("scenario")
    assert (sync.take_turn(10, 1.0), sync.take_turn(12, 1.0), sync.take_turn(17, 1.0)) == (2, 5, 0)


def test_tick_before_the_frame_of_an_unread_scenario_does_not_wait() -> None:
    sync: Sync[str] = Sync()
    sync.start("a", 40, ME, 0.0)
    sync.submit("scenario", 13, 10, ME, 0.0, is_ready=False)
    assert sync.tick("a", 0, 10, ME, 0.0).effects == (SyncEffect.MOVE,)
    assert sync.tick("a", 0, 12, ME, 0.0).effects == (SyncEffect.WAIT,)
    sync.withdraw("scenario")
    assert (sync.take_turn(12, 1.0), sync.due(13)) == (2, [])


def test_a_pause_outlives_its_master() -> None:
    sync: Sync[str] = Sync()
    sync.start("a", 20, ME, 0.0)
    sync.pause(1.0)
    assert not sync.tick("a", 1, 0, ME, 0.0).is_accepted
    sync.leave(ME, 1.0)
    assert sync.state is SyncState.FREE_PAUSED
    sync.start("b", 20, YOU, 0.0)
    assert not sync.can_send_tick
    sync.resume(1.0)
    assert sync.can_send_tick


def test_dropped_commands_are_not_due_and_free_their_room() -> None:
    sync: Sync[str] = Sync()
    sync.start("me", 20, "peer", 0.0)
    for i in range(MAX_WAITING_COMMANDS):
        assert sync.submit(f"{'even' if i % 2 == 0 else 'odd'} {i}", i % 7, 0, "peer", 0.0).is_accepted
    assert sync.drop(lambda command: command.startswith("even")) == MAX_WAITING_COMMANDS // 2
    assert sync.drop(lambda command: command.startswith("even")) == 0
    assert sync.submit("late", 3, 0, "peer", 0.0).is_accepted
    due = sync.due(10)
    assert len(due) == MAX_WAITING_COMMANDS // 2 + 1
    assert not any(command.startswith("even") for command in due)


def test_dropped_command_delays_no_tick() -> None:
    sync: Sync[str] = Sync()
    sync.start("me", 20, "peer", 0.0)
    sync.submit("scenario", 1, 0, "peer", 0.0, is_ready=False)
    assert SyncEffect.WAIT in sync.tick("me", 1, 0, "peer", 0.0).effects
    assert sync.drop(lambda command: command == "scenario") == 1
    assert sync.take_turn(0, 1.0) == 1
    assert len(sync.waiting()) == 0


def test_tick_that_is_computed_in_parts_has_all_its_frames_and_begins_once() -> None:
    sync: Sync[str] = Sync()
    sync.start("boss", 100, ME, 0.0)
    sync.hooks.move = lambda num_frames, _now: min(num_frames, 2)
    sync.tick("boss", FRAME + 5, FRAME, ME, 0.0, on_wait=lambda: None, is_in_turns=True)
    begun: list[str] = []
    parts = [sync.take_turn(FRAME + done, 1.0, prepare=lambda: begun.append("tick")) for done in (0, 2, 4, 5)]
    assert (parts, begun, sync.num_ticks) == ([2, 2, 1, 0], ["tick"], 0)


def test_command_that_enters_at_a_tick_is_carried_out_before_its_first_frame() -> None:
    sync: Sync[str] = Sync()
    sync.start("boss", 40, ME, 0.0)
    sync.submit("first", FRAME + 1, FRAME, YOU, 0.0)
    sync.enter("second", FRAME)
    assert (sync.due(FRAME), sync.due(FRAME + 1)) == ([], ["first", "second"])


def led(step_ms: int = 40) -> Sync[str]:
    """Synchronous mode at frame 10 with the master `me`."""
    sync: Sync[str] = Sync()
    sync.start("me", step_ms, ME, 0.0)
    return sync


@pytest.mark.parametrize(
    ("named", "num_given_up", "due"),
    [
        (0, 1, 15),  # three ticks of two frames would have been computed before it, now two are
        (0, 2, 13),
        (0, 3, 11),
        (16, 2, 16),  # never before the frame that it names
        (40, 2, 40),
    ],
)
@pytest.mark.parametrize("is_ready", [True, False])
def test_command_behind_ticks_that_are_given_up_moves_forward(
    named: int, num_given_up: int, due: int, *, is_ready: bool
) -> None:
    sync = led()
    sync.step("me", 3, ME, 0.0, on_wait=lambda: None)
    sync.submit("before", 11, 10, ME, 0.0)
    sync.submit("behind", named, 10, ME, 0.0, is_ready=is_ready)
    sync.give_up(num_given_up, 1.0)
    assert {command: frame for frame, command in sync.waiting()}["behind"] == due
    assert sync.num_ticks == 3 - num_given_up
    assert sync.state is (SyncState.LED if num_given_up == 3 else SyncState.WAITING)
    if not is_ready and num_given_up < 3:
        assert sync.has_turn(due - 3)
        assert not sync.has_turn(due - 2)


def test_command_that_came_between_ticks_moves_by_the_frames_before_it_alone() -> None:
    sync = led()
    sync.step("me", 1, ME, 0.0, on_wait=lambda: None)
    sync.submit("first", 0, 10, ME, 0.0)  # behind one tick
    sync.step("me", 2, ME, 0.0, on_wait=lambda: None)
    sync.submit("second", 0, 10, ME, 0.0)  # behind three
    assert sync.waiting() == [(13, "first"), (17, "second")]
    sync.give_up(2, 1.0)
    assert sync.waiting() == [(11, "first"), (13, "second")]
    assert sync.take_turn(10, 2.0) == 2
    sync.submit("third", 0, 12, ME, 2.0)
    assert sync.waiting()[-1] == (13, "third")


def test_ticks_that_wait_leave_in_the_order_in_which_they_came_each_with_its_own_step() -> None:
    sync = led()
    sync.step("me", 1, ME, 0.0, on_wait=lambda: None)
    sync.start("me", 100, ME, 0.0)
    sync.step("me", 1, ME, 0.0, on_wait=lambda: None)
    assert [sync.take_turn(10, 1.0), sync.take_turn(12, 1.0), sync.take_turn(17, 1.0)] == [2, 5, 0]


def test_a_turn_carries_out_one_tick_unless_more_are_allowed() -> None:
    for most, moved in [(None, 2), (2, 4), (3, 6)]:
        sync = led()
        sync.step("me", 3, ME, 0.0, on_wait=lambda: None)
        found = sync.take_turn(10, 1.0) if most is None else sync.take_turn(10, 1.0, most_ticks=most)
        assert (found, sync.num_ticks) == (moved, 3 - moved // 2)


def test_entered_commands_go_behind_those_that_came_before_in_their_order() -> None:
    sync = led()
    for command in ("a", "b"):
        sync.submit(command, 11, 10, ME, 0.0)
    for command in ("c", "d"):
        sync.enter(command, 10)
    sync.submit("e", 11, 10, ME, 0.0)
    assert sync.due(11) == ["a", "b", "c", "d", "e"]


def test_replaced_commands_come_in_the_order_of_their_frames_and_all_are_ready() -> None:
    sync = led()
    sync.submit("gone", 11, 10, ME, 0.0, is_ready=False)
    sync.replace_waiting([(19, "a"), (14, "b"), (12, "c"), (14, "d"), (11, "e")])
    assert not sync.has_unready
    sync.submit("f", 14, 10, ME, 0.0)
    assert [sync.due(frame) for frame in (11, 12, 14, 19)] == [["e"], ["c"], ["b", "d", "f"], ["a"]]


def test_only_the_id_of_the_master_is_the_masters() -> None:
    sync: Sync[str] = Sync()
    assert not sync.is_master("")
    sync.start("me", 40, ME, 0.0)
    assert [sync.is_master(one) for one in ("me", "you", "")] == [True, False, False]


@pytest.mark.parametrize(("length", "is_accepted"), [(MAX_USER_ID, True), (MAX_USER_ID + 1, False)])
def test_id_of_a_master_is_bounded(length: int, *, is_accepted: bool) -> None:
    assert Sync[str]().start("x" * length, 40, ME, 0.0).is_accepted == is_accepted


def test_there_is_no_turn_without_a_tick_that_waits() -> None:
    sync = led()
    assert not sync.has_turn(10)
    sync.step("me", 1, ME, 0.0, on_wait=lambda: None)
    assert sync.has_turn(10)


def test_a_refusal_ends_the_tick_that_has_begun() -> None:
    sync = led()
    sync.hooks.move = lambda _num, _now: 1  # a turn that ends after one frame
    sync.step("me", 2, ME, 0.0, on_wait=lambda: None)
    assert (sync.take_turn(10, 1.0), sync.is_in_tick, sync.num_ticks) == (1, True, 2)
    sync.pause(1.0)
    assert (sync.is_in_tick, sync.num_ticks) == (False, 0)


@pytest.mark.parametrize("is_on", [True, False])
def test_stop_by_anyone_without_a_master_is_as_one_where_only_the_master_may(*, is_on: bool) -> None:
    states, effects = [], []
    for may_anyone_stop in (True, False):
        sync: Sync[str] = Sync(is_on=is_on, may_anyone_stop=may_anyone_stop)
        effects.append(sync.stop("somebody", 1.0).effects)
        states.append(sync.state)
    assert states == [SyncState.FREE, SyncState.FREE]
    assert effects[0] == effects[1]


def test_frames_of_a_tick_that_has_begun_are_owed_until_they_are_computed() -> None:
    sync = led(100)
    sync.hooks.move = lambda num_frames, _now: min(num_frames, 2)
    sync.step("me", 2, ME, 0.0, on_wait=lambda: None)
    sync.submit("first", 0, 10, ME, 0.0)
    assert (sync.take_turn(10, 1.0), sync.num_ticks) == (2, 2)
    sync.submit("second", 0, 12, ME, 1.0)
    assert sync.waiting() == [(21, "first"), (21, "second")]
    sync.give_up(1, 1.0)  # three frames of it were left
    assert sync.waiting() == [(18, "first"), (18, "second")]
    assert [sync.take_turn(frame, 2.0) for frame in (12, 14, 16, 17)] == [2, 2, 1, 0]
    sync.submit("third", 0, 17, ME, 3.0)
    assert sync.due(18) == ["first", "second", "third"]


def test_each_tick_that_is_computed_in_parts_is_prepared_once() -> None:
    sync = led()
    sync.hooks.move = lambda _num_frames, _now: 1
    sync.step("me", 2, ME, 0.0, on_wait=lambda: None)
    begun: list[int] = []
    for frame in range(10, 14):
        sync.take_turn(frame, 1.0, prepare=lambda: begun.append(len(begun)))
    assert (begun, sync.num_ticks) == ([0, 1], 0)


def test_a_turn_carries_out_one_tick_while_any_command_waits_because_it_may_be_a_pause() -> None:
    sync = led()
    sync.submit("later", 30, 10, ME, 0.0)
    sync.step("me", 3, ME, 0.0, on_wait=lambda: None)
    assert (sync.take_turn(10, 1.0, most_ticks=3), sync.num_ticks) == (2, 2)


def test_ticks_do_not_wait_for_a_command_of_a_later_frame() -> None:
    sync = led()
    sync.submit("scenario", 30, 10, ME, 0.0, is_ready=False)
    sync.step("me", 1, ME, 0.0, on_wait=lambda: None)
    assert sync.take_turn(10, 1.0) == 2


def test_commands_that_move_forward_are_due_in_the_order_of_their_new_frames() -> None:
    sync = led()
    sync.step("me", 3, ME, 0.0, on_wait=lambda: None)
    sync.submit("for 16", 16, 10, ME, 0.0)
    sync.submit("for the next", 0, 10, ME, 0.0)
    sync.give_up(3, 1.0)
    assert [sync.due(frame) for frame in (11, 15, 16)] == [["for the next"], [], ["for 16"]]


@pytest.mark.parametrize(("step_ms", "effect"), [(20, SyncEffect.MOVE), (40, SyncEffect.WAIT)])
def test_tick_of_one_frame_is_not_divided(step_ms: int, effect: SyncEffect) -> None:
    assert led(step_ms).tick("me", 0, 10, ME, 0.0, is_in_turns=True).effects == (effect,)


def test_command_waits_for_a_frame_up_to_10000_ahead_and_1000_commands_wait_at_most() -> None:
    sync = led()
    assert sync.submit("far", 10 + 10_000, 10, ME, 0.0).is_accepted
    assert not sync.submit("farther", 10 + 10_001, 10, ME, 0.0).is_accepted
    accepted = [sync.submit(f"command {i}", 11, 10, ME, 0.0).is_accepted for i in range(1_000)]
    assert accepted == [True] * 999 + [False]


def test_refusal_of_another_id_names_the_master_and_no_other_refusal_does() -> None:
    sync = led()
    assert sync.why(sync.start("you", 40, YOU, 0.0)).endswith(": 'me'")
    assert sync.why(sync.tick("you", 0, 10, YOU, 0.0)).endswith(": 'me'")
    assert "'me'" not in sync.why(sync.start("me", 30, ME, 0.0))


def test_call_for_many_steps_renews_the_lease_and_makes_its_peer_a_holder() -> None:
    sync: Sync[str] = Sync(lease=5.0)
    sync.start("me", 20, ME, 10.0)
    sync.step("me", 2, YOU, 12.0, on_wait=lambda: None)
    assert (sync.lease_due, sync.holders) == (17.0, [ME, YOU])
    sync.step("you", 2, "stranger", 14.0, on_wait=lambda: None)
    assert (sync.lease_due, sync.holders) == (17.0, [ME, YOU])


def test_command_moves_forward_again_when_more_ticks_before_it_are_given_up() -> None:
    sync = led()
    sync.step("me", 3, ME, 0.0, on_wait=lambda: None)
    sync.submit("behind", 0, 10, ME, 0.0)
    for due in (15, 13, 11):
        sync.give_up(1, 1.0)
        assert sync.waiting() == [(due, "behind")]


@pytest.mark.parametrize(("step_ms", "is_accepted"), [(1_000, True), (1_020, False), (10, False)])
def test_time_step_is_a_number_of_frames_up_to_a_second(step_ms: int, *, is_accepted: bool) -> None:
    assert Sync[str]().start("me", step_ms, ME, 0.0).is_accepted == is_accepted


def test_command_that_a_stop_has_dropped_delays_no_tick_of_the_next_master() -> None:
    sync = led()
    sync.submit("scenario", 11, 10, ME, 0.0, is_ready=False)
    sync.stop("me", 1.0)
    assert not sync.has_unready
    sync.start("me", 40, ME, 2.0)
    assert sync.tick("me", 0, 10, ME, 2.0).state is SyncState.LED


def test_tick_that_is_given_up_in_the_middle_has_not_begun_any_more() -> None:
    sync, prepared = led(), list[int]()
    sync.hooks.move = lambda num_frames, _now: num_frames - 1
    sync.step("me", 2, ME, 0.0, on_wait=lambda: None)
    assert sync.take_turn(10, 0.0, prepare=lambda: prepared.append(1)) == 1
    assert sync.is_in_tick
    sync.give_up(1, 0.0)
    assert not sync.is_in_tick
    sync.take_turn(11, 0.0, prepare=lambda: prepared.append(2))
    assert prepared == [1, 2]

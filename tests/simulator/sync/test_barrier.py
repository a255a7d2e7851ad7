"""The barrier: the table row by row, and invariants under any order of events."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from rosbridge_sim.errors import Reason
from rosbridge_sim.simulator.sync.barrier import Barrier
from rosbridge_sim.simulator.sync.barrier_table import (
    BARRIER_ID,
    BARRIER_TABLE,
    MAX_DEADLINE,
    MAX_MEMBERS,
    MAX_TICKS_AHEAD,
    MIN_DEADLINE,
    BarrierEffect,
    BarrierEvent,
    BarrierOutcome,
    BarrierState,
)
from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.simulator.sync.sync_table import MAX_STEP_MS, MAX_USER_ID, SyncState

_OF_MEMBERS = frozenset(BarrierEvent) - frozenset(BARRIER_TABLE[BarrierState.EMPTY])
_OF_A_ROUND = frozenset({BarrierEvent.ALL_TICKED, BarrierEvent.DEADLINE, BarrierEvent.NONE_TICKED})
_OF_A_MOVE = frozenset({BarrierEvent.MOVED, BarrierEvent.NOT_MOVED})

IMPOSSIBLE = {
    BarrierState.EMPTY: _OF_MEMBERS,
    BarrierState.RESTING: _OF_A_ROUND | _OF_A_MOVE | {BarrierEvent.JOIN_TAKEN},
    BarrierState.GATHERING: _OF_A_MOVE | {BarrierEvent.JOIN_TAKEN, BarrierEvent.STILL_TICKED, BarrierEvent.LAST_LEFT},
    # A reset or a restore in MOVING meets a tick that waits; synchronous mode refuses it first (NOT_MOVED).
    BarrierState.MOVING: _OF_A_ROUND
    | {BarrierEvent.JOIN_TAKEN, BarrierEvent.STILL_TICKED, BarrierEvent.LAST_LEFT}
    | {BarrierEvent.RESET, BarrierEvent.RESTORED},
}
"""The events that cannot happen in a state: the table has no row for them."""


class Model:
    """A barrier that leads synchronous mode, on a world that is a number.

    Attributes:
        frame: of the world.
        moves: how many frames each tick of the barrier has moved it.
        ends: of each tick that was accepted, by its number: why it was refused, empty if it was not.
        told: (holder, text).
        warned: (holder, reason).
        mode: what was done to synchronous mode.
    """

    def __init__(self, *, is_slow: bool = False, lease: float | None = None, **flags: bool) -> None:
        """No members; with `is_slow` a tick of the barrier ends only when `finish` is called."""
        self.sync: Sync[str] = Sync(is_strict=flags.get("is_strict", False))
        self.barrier = Barrier(self.sync, lease=lease, **flags)
        self.frame = 0
        self.moves: list[int] = []
        self.ends: dict[int, list[str]] = {}
        self.told: list[tuple[str, str]] = []
        self.warned: list[tuple[str, Reason]] = []
        self.mode: list[str] = []
        self.is_slow = is_slow
        self.now = 0.0
        hooks = self.barrier.hooks
        hooks.lead = self._lead
        hooks.end = self._end
        hooks.lose = self._lose
        hooks.move = self._move
        hooks.tell = lambda holder, text: self.told.append((holder, text))
        hooks.warn = lambda holder, _text, reason: self.warned.append((holder, reason))
        self.sync.hooks.move = lambda num_frames, _now: self._compute(num_frames)
        self.sync.hooks.refuse = self._refuse

    def _lead(self, step_ms: int, now: float) -> None:
        self.mode.append("lead")
        assert self.sync.start(BARRIER_ID, step_ms, self.barrier, now).is_accepted

    def _end(self, now: float) -> None:
        self.mode.append("end")
        assert self.sync.stop(BARRIER_ID, now).is_accepted

    def _lose(self, now: float) -> None:
        self.mode.append("lose")
        assert self.sync.leave(self.barrier, now) is not None

    def _move(self, now: float) -> None:
        if self.is_slow:
            self.sync.submit("scenario", self.frame + 1, self.frame, "reader", now, is_ready=False)
        named = self.frame + self.sync.num_frames
        outcome = self.sync.tick(BARRIER_ID, named, self.frame, self.barrier, now, on_wait=lambda: None)
        if not outcome.is_accepted:
            self.barrier.not_moved(self.sync.why(outcome), now)
        elif outcome.state is not SyncState.WAITING:
            self.barrier.moved(now)

    def _compute(self, num_frames: int) -> None:
        self.sync.due(self.frame + num_frames)
        self.frame += num_frames
        self.moves.append(num_frames)

    def _refuse(self, why: str, now: float) -> None:
        self.barrier.not_moved(why, now)

    def finish(self) -> None:
        """The scenario has been read."""
        self.sync.ready("scenario")
        if self.sync.take_turn(self.frame, self.now):
            self.barrier.moved(self.now)

    def join(self, user_id: str, step_ms: int = 0, deadline: float = 0.0, holder: str = "") -> BarrierOutcome:
        return self.barrier.join(user_id, step_ms, deadline, holder or user_id, self.now)[0]

    def tick(self, user_id: str, named: int = 0, holder: str = "") -> BarrierOutcome:
        number = len(self.ends)
        ends: list[str] = []

        def end(why: str) -> None:
            assert not ends, "a tick is answered once"
            ends.append(why)

        outcome = self.barrier.tick(user_id, named, self.frame, holder or user_id, self.now, on_end=end)
        if outcome.is_accepted:
            self.ends[number] = ends
        return outcome

    def pause(self) -> None:
        self.sync.pause(self.now)
        self.barrier.pause(self.now)

    def reset(self) -> BarrierOutcome | None:
        self.frame = 0
        self.sync.forget(self.now)
        self.barrier.reset(self.now)
        return None

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.barrier.expire(self.now)

    def answers(self) -> list[str | None]:
        """The answer of each accepted tick; None for one that waits."""
        return [ends[0] if ends else None for ends in self.ends.values()]


def a_model(state: BarrierState, **flags: Any) -> Model:  # noqa: ANN401 - those of Model
    """A barrier brought into `state` by what peers can do: `a` and `b` with two connections each, steps of 40 ms."""
    model = Model(is_slow=state is BarrierState.MOVING, **flags)
    if state is not BarrierState.EMPTY:
        model.join("a", 40, 2.0)
        model.join("b")
        model.join("b", holder="b2")
        assert model.join("a", holder="a2").is_accepted
    if state in {BarrierState.GATHERING, BarrierState.MOVING}:
        model.tick("a", 2)
    if state is BarrierState.MOVING:
        model.tick("b", 2)
    assert model.barrier.state is state
    return model


def crowded(model: Model) -> BarrierOutcome:
    for i in range(MAX_MEMBERS):
        outcome = model.join(f"m{i}")
    return outcome


def eager(model: Model) -> BarrierOutcome:
    outcomes = [model.tick("a") for _ in range(MAX_TICKS_AHEAD + 1)]
    return outcomes[-1]


def taken(model: Model) -> BarrierOutcome:
    model.sync.start("boss", 20, "boss", 0.0)
    return model.join("a")


def alone(model: Model) -> Model:
    model.barrier.drop("b", 0.0)
    model.barrier.drop("b2", 0.0)
    return model


def in_pause(model: Model) -> Model:
    model.pause()
    return model


ASKED: dict[BarrierEvent, Callable[[Model], BarrierOutcome]] = {
    BarrierEvent.JOIN: lambda m: m.join("c"),
    BarrierEvent.JOIN_AGAIN: lambda m: m.join("b", 40, 2.0),
    BarrierEvent.JOIN_MISFIT: lambda m: m.join("c", 30),
    BarrierEvent.JOIN_OTHER_TERMS: lambda m: m.join("c", 20),
    BarrierEvent.JOIN_SHARED: lambda m: m.join("c", holder="a"),
    BarrierEvent.JOIN_TAKEN: taken,
    BarrierEvent.JOIN_TOO_MANY: crowded,
    BarrierEvent.LEAVE_BY_OTHER: lambda m: m.barrier.leave("c", 0.0),
    BarrierEvent.START_BY_MEMBER: lambda m: m.barrier.start("a", 40, "a", 0.0),
    BarrierEvent.START_OTHER_STEP: lambda m: m.barrier.start("a", 20, "a", 0.0),
    BarrierEvent.START_BY_OTHER: lambda m: m.barrier.start("c", 40, "c", 0.0),
    BarrierEvent.STOP_BY_OTHER: lambda m: m.barrier.stop("c", 0.0),
    BarrierEvent.TICK_PAUSED: lambda m: in_pause(m).tick("b"),
    BarrierEvent.TICK_SHARED: lambda m: m.tick("b", holder="a"),
    BarrierEvent.TICK_TOO_MANY: eager,
    BarrierEvent.TICK_BY_OTHER: lambda m: m.tick("c"),
    BarrierEvent.STEP_TOGETHER: lambda m: m.barrier.ask_step("a"),
    BarrierEvent.STEP_BY_OTHER: lambda m: m.barrier.ask_step("c"),
    BarrierEvent.RESTORE_BY_MEMBER: lambda m: m.barrier.ask_restore("a"),
    BarrierEvent.RESTORE_BY_OTHER: lambda m: m.barrier.ask_restore("c"),
}
"""The requests whose outcome is the row, and which no other event follows."""


@pytest.mark.parametrize("state", BarrierState)
@pytest.mark.parametrize("event", BarrierEvent)
def test_table_has_a_row_for_each_event_that_can_happen(state: BarrierState, event: BarrierEvent) -> None:
    assert (event in BARRIER_TABLE[state]) is (event not in IMPOSSIBLE[state])


@pytest.mark.parametrize("state", BarrierState)
def test_refusals_change_nothing_and_have_a_text_with_a_kind(state: BarrierState) -> None:
    for outcome in BARRIER_TABLE[state].values():
        assert bool(outcome.why) is not outcome.is_accepted
        if not outcome.is_accepted:
            assert (outcome.state, outcome.effects) == (state, ())
            assert outcome.reason is not Reason.REFUSED


@pytest.mark.parametrize("state", BarrierState)
def test_world_moves_and_synchronous_mode_ends_in_few_rows(state: BarrierState) -> None:
    for event, outcome in BARRIER_TABLE[state].items():
        moves = event in {BarrierEvent.ALL_TICKED, BarrierEvent.DEADLINE}
        assert (BarrierEffect.MOVE in outcome.effects) is moves
        is_end = outcome.state is BarrierState.EMPTY and state is not BarrierState.EMPTY
        assert bool({BarrierEffect.END, BarrierEffect.LOSE} & set(outcome.effects)) is is_end
        assert (BarrierEffect.LEAD in outcome.effects) is (state is BarrierState.EMPTY is not outcome.state)


ELSEWHERE = {
    (BarrierState.RESTING, BarrierEvent.TICK_TOO_MANY),
    (BarrierState.GATHERING, BarrierEvent.TICK_PAUSED),
    (BarrierState.MOVING, BarrierEvent.TICK_PAUSED),
}
"""Rows that take a request from within another event; what leads there by itself ends the state."""


@pytest.mark.parametrize(
    ("state", "event"),
    [
        (state, event)
        for state in BarrierState
        for event in ASKED
        if event in BARRIER_TABLE[state] and (state, event) not in ELSEWHERE
    ],
)
def test_each_request_is_answered_as_in_the_table(state: BarrierState, event: BarrierEvent) -> None:
    model = a_model(state)
    outcome = ASKED[event](model)
    assert outcome == BARRIER_TABLE[state][event]
    assert model.barrier.state is outcome.state


def test_stop_by_anyone_ends_the_barrier_in_each_state() -> None:
    for state in (BarrierState.RESTING, BarrierState.GATHERING, BarrierState.MOVING):
        model = a_model(state, may_anyone_stop=True)
        outcome = model.barrier.stop("stranger", 1.0)
        assert outcome == BARRIER_TABLE[state][BarrierEvent.STOP_BY_ANYONE]
        assert (model.sync.state, model.barrier.status().members) == (SyncState.FREE, [])
        assert None not in model.answers()
        assert model.moves == []
        assert model.join("first").is_accepted
        assert model.join("a", holder="b").is_accepted, "nobody belongs to a member any more"


def test_stop_without_members_is_refused_even_where_anyone_may_stop() -> None:
    outcome = Model(may_anyone_stop=True).barrier.stop("stranger", 1.0)
    assert outcome == BARRIER_TABLE[BarrierState.EMPTY][BarrierEvent.STOP_BY_OTHER]


@pytest.mark.parametrize("way", ["leave", "drop"])
def test_connection_whose_member_is_gone_belongs_to_none_and_may_be_another(way: str) -> None:
    model = a_model(BarrierState.RESTING)
    if way == "leave":
        assert model.barrier.leave("a", model.now).is_accepted
        assert model.join("z", holder="a").is_accepted
    else:
        model.barrier.drop("a", model.now)
        assert model.join("z", holder="a").is_accepted
    assert "z" in model.barrier.status().members


def test_step_is_for_the_only_member() -> None:
    model = a_model(BarrierState.RESTING)
    outcome = model.barrier.ask_step("a")
    assert not outcome.is_accepted
    assert "other members" in model.barrier.why(outcome)
    assert alone(model).barrier.ask_step("a").is_accepted


def test_step_of_the_only_member_waits_for_no_tick_under_way() -> None:
    model = Model(is_slow=True)
    model.join("a")
    model.tick("a")
    assert model.barrier.ask_step("a").why == "a tick of the barrier is under way"


def test_strict_frames_take_only_the_frame_that_the_tick_ends_on() -> None:
    for state, end in ((BarrierState.RESTING, 2), (BarrierState.GATHERING, 4), (BarrierState.MOVING, 4)):
        model = a_model(state, is_strict=True)
        for other in (end - 1, end + 1):
            assert model.tick("a", other) == BARRIER_TABLE[state][BarrierEvent.TICK_MISFIT]
        assert model.tick("a", end).is_accepted
    model = a_model(BarrierState.GATHERING, is_strict=True)
    model.join("c")
    assert not model.tick("c", 2).is_accepted, "the boundary that it comes too late for"
    assert model.tick("c", 4).is_accepted


@pytest.mark.parametrize(
    ("step_ms", "deadline", "user_id"),
    [
        (30, 0.0, "a"),
        (MAX_STEP_MS + 20, 0.0, "a"),
        (20, MIN_DEADLINE / 2, "a"),
        (20, MAX_DEADLINE + 1, "a"),
        (20, -1.0, "a"),
        (20, math.nan, "a"),
        (20, math.inf, "a"),
        (20, 1.0, "a" * (MAX_USER_ID + 1)),
    ],
)
def test_terms_that_cannot_be_had_are_refused(step_ms: int, deadline: float, user_id: str) -> None:
    model = Model()
    outcome = model.join(user_id, step_ms, deadline)
    assert outcome == BARRIER_TABLE[BarrierState.EMPTY][BarrierEvent.JOIN_MISFIT]
    assert model.mode == []


def test_refusal_of_a_long_user_id_repeats_only_its_start() -> None:
    _, repeated = Model().barrier.join("a" * 6_000_000, 20, 1.0, "peer", 0.0)
    assert repeated == "a" * MAX_USER_ID


# Members


def test_first_member_starts_synchronous_mode_and_sets_the_terms() -> None:
    model = Model()
    assert model.join("a", 60, 0.5).is_accepted
    assert (model.sync.state, model.sync.master_id, model.sync.step_ms) == (SyncState.LED, BARRIER_ID, 60)
    refused = model.join("b", 20)
    assert model.barrier.why(refused).endswith("time_step 60 ms, deadline_s 0.5")
    assert not model.join("b", 0, 1.0).is_accepted
    assert model.join("b").is_accepted
    assert model.join("c", 60, 0.5).is_accepted
    assert model.barrier.status().members == ["a", "b", "c"]


def test_next_first_member_sets_other_terms() -> None:
    model = Model()
    model.join("a", 60, 0.5)
    model.barrier.leave("a", 0.0)
    assert (model.mode, model.sync.state) == (["lead", "end"], SyncState.FREE)
    model.join("b", 100)
    assert (model.barrier.step_ms, model.barrier.deadline, model.sync.step_ms) == (100, 1.0, 100)


def test_master_of_synchronous_mode_keeps_a_barrier_away_and_is_named() -> None:
    model = Model()
    outcome = taken(model)
    assert model.barrier.why(outcome).endswith(": 'boss'")
    model.sync.stop("boss", 0.0)
    assert model.join("a").is_accepted


def test_member_without_an_id_is_given_one_that_is_free() -> None:
    model = Model()
    assert model.barrier.join("member-1", 0, 0.0, "x", 0.0)[1] == "member-1"
    assert model.barrier.join("", 0, 0.0, "y", 0.0)[1] == "member-2"
    assert model.barrier.join("", 0, 0.0, "y", 0.0)[1] == "member-2", "it is one already"


def test_connection_belongs_to_one_member_and_is_told_which() -> None:
    model = a_model(BarrierState.RESTING)
    outcome = model.join("c", holder="a")
    assert model.barrier.why(outcome, "a").endswith("it is 'a'")
    assert not model.tick("b", holder="a").is_accepted
    assert not model.barrier.start("b", 0, "a", 0.0).is_accepted


def test_member_that_joins_while_others_wait_is_not_waited_for() -> None:
    model = a_model(BarrierState.GATHERING)
    model.join("c")
    assert model.barrier.status().joining == ["c"]
    model.tick("c")
    assert model.moves == []
    model.tick("b")
    assert (model.moves, model.answers()) == ([2], ["", None, ""])
    status = model.barrier.status()
    assert (status.joining, status.ticked, status.waited_for) == ([], ["c"], ["a", "b"])


def test_member_that_leaves_is_not_waited_for_and_goes_at_the_boundary() -> None:
    model = a_model(BarrierState.GATHERING)
    model.join("c")
    assert model.barrier.leave("b", 0.0).is_accepted
    assert (model.moves, model.barrier.status().members) == ([2], ["a", "c"])
    assert ("a", "member 'b' has left; the barrier goes on without it") in model.told


def test_tick_of_a_member_that_leaves_still_counts() -> None:
    model = a_model(BarrierState.GATHERING)
    model.barrier.leave("a", 0.0)
    assert (model.barrier.status().leaving, model.moves) == (["a"], [])
    assert not model.tick("a").is_accepted
    model.tick("b")
    assert (model.answers(), model.barrier.status().members) == (["", ""], ["b"])


def test_member_that_joins_again_before_the_boundary_stays() -> None:
    model = a_model(BarrierState.GATHERING)
    model.barrier.leave("a", 0.0)
    assert model.join("a").is_accepted
    model.tick("b")
    assert model.barrier.status().members == ["a", "b"]


def test_ticks_that_a_leaving_member_sent_ahead_are_refused_at_the_boundary() -> None:
    model = a_model(BarrierState.GATHERING)
    model.tick("a")
    model.barrier.leave("a", 0.0)
    model.tick("b")
    assert model.answers() == ["", "the member has left", ""]


def test_last_connection_takes_its_member_along_and_the_others_go_on() -> None:
    model = a_model(BarrierState.GATHERING)
    model.barrier.drop("b", 0.0)
    assert model.moves == []
    model.barrier.drop("b2", 0.0)
    assert (model.moves, model.answers()) == ([2], [""])
    assert [text for holder, text in model.told if holder == "a"] == [
        "member 'b' is lost, for its connection has ended; the barrier goes on without it"
    ]


def test_tick_of_a_lost_member_counts_no_more() -> None:
    model = a_model(BarrierState.GATHERING)
    model.barrier.drop("a", 0.0)
    model.barrier.drop("a2", 0.0)
    assert (model.barrier.state, model.moves) == (BarrierState.RESTING, [])
    assert model.answers() == ["the member was lost while the tick waited for the other members"]
    assert model.barrier.due(0.0) is None, "nobody waits for a deadline"


def test_tick_of_a_member_that_is_lost_while_the_world_moves_is_answered_once() -> None:
    model = a_model(BarrierState.MOVING)
    model.barrier.drop("a", 0.0)
    model.barrier.drop("a2", 0.0)
    model.finish()
    assert model.answers() == ["the member was lost while the tick waited for the other members", ""]


def test_tick_of_a_new_member_waits_for_its_own_boundary_when_those_who_ticked_before_are_lost() -> None:
    model = a_model(BarrierState.GATHERING)
    model.now = 0.5
    model.join("c")
    model.tick("c")
    assert model.barrier.status().joining == ["c"]
    model.barrier.drop("a", model.now)
    model.barrier.drop("a2", model.now)
    assert (model.barrier.status().joining, model.barrier.due(model.now)) == ([], 2.5)


def test_tick_goes_with_its_connection_where_the_member_has_another() -> None:
    model = a_model(BarrierState.GATHERING)
    model.barrier.drop("a", 0.0)
    assert (model.barrier.state, model.barrier.status().waited_for) == (BarrierState.RESTING, [])
    model.tick("b")
    assert model.barrier.status().waited_for == ["a"]


def test_loss_of_the_last_member_is_the_loss_of_the_master() -> None:
    for state in (BarrierState.RESTING, BarrierState.GATHERING, BarrierState.MOVING):
        model = a_model(state)
        for holder in ("a", "a2", "b", "b2"):
            model.barrier.drop(holder, 0.0)
        assert (model.mode, model.barrier.state, model.sync.state) == (
            ["lead", "lose"],
            BarrierState.EMPTY,
            SyncState.FREE,
        )
        assert None not in model.answers()


def test_silent_member_is_lost_when_its_lease_ends_and_one_that_waits_is_not() -> None:
    model = a_model(BarrierState.GATHERING, lease=1.5)
    assert model.barrier.due(0.0) == 1.5
    model.wait(1.5)
    assert (model.barrier.status().members, model.moves) == (["a"], [2])
    assert "member 'b' was silent for 1.5 s; the barrier goes on without it" in [text for _, text in model.told]
    assert model.barrier.due(model.now) == 3.0, "its lease counts from its answer"
    model.wait(1.5)
    assert model.mode == ["lead", "lose"]


def test_lease_of_a_member_counts_from_its_joining() -> None:
    model = Model(lease=1.5)
    model.now = 10.0
    assert model.join("a").is_accepted
    assert model.barrier.due(model.now) == 11.5
    model.wait(1.4)
    assert model.barrier.status().members == ["a"]


def test_lease_of_a_member_whose_tick_is_refused_counts_from_the_refusal() -> None:
    model = a_model(BarrierState.GATHERING, lease=1.5)
    model.now = 1.0
    model.pause()
    assert None not in model.answers()
    assert model.barrier.due(model.now) == 2.5
    model.wait(1.0)
    assert model.barrier.status().members == ["a", "b"]


def test_member_whose_ticks_are_refused_in_a_pause_is_not_silent() -> None:
    model = a_model(BarrierState.RESTING, lease=1.0)
    model.pause()
    for _ in range(3):
        assert not model.tick("a").is_accepted
        model.wait(0.9)
    assert model.barrier.status().members == ["a"]


def test_members_that_leave_together_after_a_loss_end_the_mode_and_do_not_lose_it() -> None:
    model = a_model(BarrierState.RESTING)
    model.join("c")
    model.barrier.drop("c", 0.0)
    model.tick("a")
    model.barrier.leave("a", 0.0)
    model.barrier.leave("b", 0.0)
    assert (model.mode, model.barrier.state) == (["lead", "end"], BarrierState.EMPTY)


def test_command_and_held_input_keep_a_member() -> None:
    model = a_model(BarrierState.RESTING, lease=1.5)
    model.sync.submit("steer", 1, 0, "a", 1.0)
    model.sync.mute("b")
    assert model.barrier.due(1.0) == 2.5
    model.sync.unmute("b", 2.0)
    model.wait(2.5)
    assert model.barrier.status().members == ["b"]


# Ticks


def test_world_moves_when_all_have_ticked() -> None:
    model = a_model(BarrierState.RESTING)
    model.tick("b")
    status = model.barrier.status()
    assert (status.ticked, status.waited_for, model.moves) == (["b"], ["a"], [])
    assert model.barrier.due(0.0) == 2.0
    model.tick("a")
    assert (model.moves, model.answers()) == ([2], ["", ""])
    assert model.barrier.due(0.0) is None


def test_member_that_ticks_over_a_new_connection_stays_until_that_one_ends() -> None:
    model = a_model(BarrierState.RESTING)
    assert model.tick("a", holder="a3").is_accepted
    model.barrier.drop("a", model.now)
    model.barrier.drop("a2", model.now)
    assert model.barrier.status().members == ["a", "b"]
    model.barrier.drop("a3", model.now)
    assert model.barrier.status().members == ["b"]


def test_late_member_is_told_once_and_its_tick_counts_for_the_next_boundary() -> None:
    model = a_model(BarrierState.RESTING)
    for _ in range(2):
        model.tick("a")
        model.wait(2.0)
    assert model.moves == [2, 2]
    assert model.warned == [("b", Reason.LATE_TICK), ("b2", Reason.LATE_TICK)]
    assert model.barrier.status().late_counts == [0, 2]
    model.tick("b")
    assert (model.moves, model.barrier.status().waited_for) == ([2, 2], ["a"])
    model.tick("a")
    assert model.moves == [2, 2, 2]
    model.tick("a")
    model.wait(2.0)
    assert len(model.warned) == 4, "it had ticked in between"


def test_late_member_that_ticks_while_the_world_moves_is_told_of_this_and_of_its_next_delay() -> None:
    model = a_model(BarrierState.RESTING)
    model.is_slow = True
    model.tick("a")
    model.wait(2.0)
    model.tick("b")
    model.finish()
    model.tick("a")  # together with the tick of b that came late
    model.finish()
    model.tick("a")
    model.wait(2.0)
    model.finish()
    assert model.warned == 2 * [("b", Reason.LATE_TICK), ("b2", Reason.LATE_TICK)]


@pytest.mark.parametrize("is_lost", [True, False])
def test_late_member_that_leaves_or_is_lost_while_the_world_moves_is_not_told(*, is_lost: bool) -> None:
    model = a_model(BarrierState.RESTING)
    model.is_slow = True
    model.tick("a")
    model.wait(2.0)
    if is_lost:
        model.barrier.drop("b", model.now)
        model.barrier.drop("b2", model.now)
    else:
        assert model.barrier.leave("b", model.now).is_accepted
    model.finish()
    assert (model.answers(), model.warned) == ([""], [])


def test_late_member_is_told_anew_after_a_reset() -> None:
    model = a_model(BarrierState.RESTING)
    for _ in range(2):
        model.tick("a")
        model.wait(2.0)
        assert model.warned == [("b", Reason.LATE_TICK), ("b2", Reason.LATE_TICK)]
        model.reset()
        model.warned.clear()


def test_deadline_counts_from_the_first_tick_that_waits() -> None:
    model = a_model(BarrierState.RESTING)
    model.wait(100.0)
    assert (model.moves, model.barrier.due(model.now)) == ([], None)
    model.tick("a")
    assert model.barrier.due(model.now) == 102.0
    model.wait(1.99)
    assert model.moves == []
    model.wait(0.01)
    assert model.moves == [2]


def test_ticks_sent_ahead_are_one_boundary_each_and_one_in_each_turn() -> None:
    model = Model()
    model.join("a")
    model.join("b")
    for _ in range(3):
        model.tick("b")
    assert model.barrier.status().waited_for == ["a"]
    for _ in range(3):
        model.tick("a")
    assert model.moves == [1, 1, 1]
    model.tick("b")
    model.tick("b")
    model.tick("b")
    model.barrier.leave("a", model.now)
    assert model.moves == [1] * 4, "one boundary in one call"
    assert model.barrier.due(model.now) == model.now
    model.wait(0.0)
    assert model.moves == [1] * 5
    model.wait(0.0)
    assert (model.moves, model.answers()) == ([1] * 6, [""] * 9)
    assert model.barrier.due(model.now) is None


def test_tick_during_a_tick_counts_for_the_next_boundary() -> None:
    model = a_model(BarrierState.MOVING)
    model.tick("a")
    model.tick("b")
    model.is_slow = False
    model.finish()
    assert (model.moves, model.answers()) == ([2], ["", "", None, None])
    model.wait(0.0)
    assert model.moves == [2, 2]


def test_tick_from_within_an_answer_waits_for_its_own_turn() -> None:
    model = Model()
    model.join("a")
    ends: list[str] = []

    def again(why: str) -> None:
        ends.append(why)
        model.barrier.tick("a", 0, model.frame, "a", 0.0, on_end=ends.append)

    model.barrier.tick("a", 0, 0, "a", 0.0, on_end=again)
    assert (ends, model.moves) == ([""], [1])
    model.wait(0.0)
    assert (ends, model.moves) == (["", ""], [1, 1])


# The world


@pytest.mark.parametrize("state", [BarrierState.GATHERING, BarrierState.MOVING])
def test_pause_refuses_the_ticks_that_wait_and_keeps_the_members(state: BarrierState) -> None:
    model = a_model(state)
    model.join("c")
    model.tick("a", 4)
    model.pause()
    assert model.barrier.state is BarrierState.RESTING
    assert all(why and "paused" in why for why in model.answers())
    assert (model.barrier.status().members, model.barrier.status().joining) == (["a", "b", "c"], [])
    assert model.tick("a").reason is Reason.PAUSED
    model.sync.resume(0.0)
    model.is_slow = False
    for user_id in "abc":
        model.tick(user_id)
    model.finish()
    assert model.moves == [2]


@pytest.mark.parametrize("state", [BarrierState.RESTING, BarrierState.GATHERING, BarrierState.MOVING])
def test_reset_refuses_the_ticks_that_wait_and_forgets_who_was_late(state: BarrierState) -> None:
    model = a_model(BarrierState.RESTING)
    model.tick("a")
    model.wait(2.0)
    assert model.barrier.status().late_counts == [0, 1]
    model.reset()
    assert model.barrier.status().late_counts == [0, 0]
    model = a_model(state)
    model.reset()
    assert (model.barrier.state, model.barrier.status().members) == (BarrierState.RESTING, ["a", "b"])
    assert all(why and "reset" in why for why in model.answers())


def test_restore_refuses_the_ticks_that_wait_and_keeps_the_late_counts() -> None:
    model = a_model(BarrierState.RESTING)
    model.tick("a")
    model.wait(2.0)
    model.tick("a")
    assert model.barrier.ask_restore("b").is_accepted
    model.barrier.restored(0.0)
    assert model.answers() == ["", "a snapshot was restored while the tick waited for the other members"]
    assert model.barrier.status().late_counts == [0, 1]


def test_failed_tick_is_answered_to_all() -> None:
    model = a_model(BarrierState.GATHERING)
    model.barrier.hooks.move = lambda now: model.barrier.not_moved("the world has failed", now)
    model.tick("b")
    assert model.answers() == ["the world has failed"] * 2


def test_generated_ids_start_again_at_a_reset_without_members() -> None:
    model = Model()
    assert model.barrier.join("", 0, 0.0, "x", 0.0)[1] == "member-1"
    model.barrier.leave("member-1", 0.0)
    model.reset()
    assert model.barrier.join("", 0, 0.0, "x", 0.0)[1] == "member-1"


# Any order

IDS = st.sampled_from(["a", "b", "c", "d"])
PEERS = st.sampled_from(["a", "b", "c", "d", "e"])


class AnyOrder(RuleBasedStateMachine):
    """Four clients, five connections, in any order of joins, leaves, ticks, losses and deadlines."""

    def __init__(self) -> None:
        super().__init__()
        self.model = Model(lease=20.0)
        self.num_accepted = 0

    def after(self, frame: int) -> None:
        """Check that the world has moved by one time step at most."""
        assert self.model.frame - frame in {0, self.model.barrier.step_ms // 20}

    @rule(user_id=IDS, peer=PEERS, step=st.sampled_from([0, 0, 0, 20, 40]))
    def join(self, user_id: str, peer: str, step: int) -> None:
        self.model.join(user_id, step, holder=peer)

    @rule(user_id=IDS)
    def leave(self, user_id: str) -> None:
        frame = self.model.frame
        self.model.barrier.leave(user_id, self.model.now)
        self.after(frame)

    @rule(user_id=IDS, peer=PEERS)
    def tick(self, user_id: str, peer: str) -> None:
        frame = self.model.frame
        self.num_accepted += self.model.tick(user_id, holder=peer).is_accepted
        self.after(frame)

    @rule(peer=PEERS)
    def lose(self, peer: str) -> None:
        frame = self.model.frame
        self.model.barrier.drop(peer, self.model.now)
        self.after(frame)

    @rule(seconds=st.sampled_from([0.0, 0.4, 1.0, 5.0]))
    def wait(self, seconds: float) -> None:
        frame = self.model.frame
        self.model.wait(seconds)
        self.after(frame)

    @rule(is_slow=st.booleans())
    def read(self, *, is_slow: bool) -> None:
        self.model.is_slow = is_slow
        self.model.finish()

    @rule()
    def pause(self) -> None:
        self.model.pause()

    @rule()
    def resume(self) -> None:
        self.model.sync.resume(self.model.now)

    @rule()
    def reset(self) -> None:
        self.model.reset()

    @invariant()
    def rules_hold(self) -> None:
        model, barrier = self.model, self.model.barrier
        status = barrier.status()
        assert barrier.is_on is bool(status.members)
        assert (model.sync.master_id == BARRIER_ID) is barrier.is_on
        assert (model.sync.state is SyncState.WAITING) is (barrier.state is BarrierState.MOVING)
        assert len(model.ends) == self.num_accepted
        assert set(status.waited_for) <= set(status.members)
        if barrier.state is BarrierState.RESTING:
            assert not status.joining
            assert not status.leaving
            assert not status.ticked
        if barrier.state is BarrierState.GATHERING:
            due = barrier.due(model.now)
            assert due is not None, "no tick waits for ever"
            assert due <= model.now + barrier.deadline
        if not barrier.is_on:
            assert None not in model.answers()

    def teardown(self) -> None:
        """No deadlock: with time alone, and the disk, each tick is answered."""
        self.model.is_slow = False
        self.model.finish()
        for _ in range(10 * MAX_TICKS_AHEAD):
            if None not in self.model.answers():
                break
            self.model.wait(1.0)
        assert None not in self.model.answers()


AnyOrder.TestCase.settings = settings(
    max_examples=15, stateful_step_count=40, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
TestAnyOrder = AnyOrder.TestCase


def test_member_whose_tick_moves_the_world_is_not_silent() -> None:
    model = a_model(BarrierState.MOVING, lease=1.5)
    assert model.barrier.due(0.0) is None
    model.wait(9.0)
    assert model.barrier.status().members == ["a", "b"]
    model.finish()
    assert model.barrier.due(9.0) == 10.5


def test_loss_of_a_silent_member_is_followed_by_one_boundary_in_one_turn() -> None:
    model = a_model(BarrierState.GATHERING, lease=1.5)
    model.tick("a")  # one ahead
    model.wait(1.5)
    assert (model.barrier.status().members, model.moves) == (["a"], [2])
    model.wait(0.0)
    assert model.moves == [2, 2]


def test_member_starts_synchronous_mode_with_the_step_in_force_or_none() -> None:
    model = a_model(BarrierState.RESTING)
    assert [model.barrier.start("a", step, "a", 0.0).is_accepted for step in (0, 40, 1, 20)] == [
        True,
        True,
        False,
        False,
    ]


@pytest.mark.parametrize("deadline", [MIN_DEADLINE, MAX_DEADLINE])
def test_shortest_and_longest_deadline_can_be_had(deadline: float) -> None:
    model = Model()
    assert model.barrier.deadline == 1.0
    assert model.join("a" * MAX_USER_ID, MAX_STEP_MS, deadline).is_accepted
    assert model.barrier.deadline == deadline


def test_32_members_have_16_ticks_each_that_wait() -> None:
    model = Model()
    assert [model.join(f"m{i}").is_accepted for i in range(33)] == [True] * 32 + [False]
    assert [model.tick("m0").is_accepted for _ in range(17)] == [True] * 16 + [False]


def test_stop_by_a_member_is_its_leaving() -> None:
    model = a_model(BarrierState.RESTING)
    assert model.barrier.stop("a", 0.0) == BARRIER_TABLE[BarrierState.RESTING][BarrierEvent.LEAVE]
    assert model.barrier.status().members == ["b"]
    assert model.barrier.holders == ["b", "b2"]


def test_end_of_a_tick_is_followed_by_no_other_boundary_in_the_same_turn() -> None:
    model = a_model(BarrierState.MOVING)
    assert model.barrier.status().ticked == ["a", "b"]
    for user_id in ("a", "b"):
        model.tick(user_id)
    model.finish()
    assert (model.moves, model.barrier.state) == ([2], BarrierState.GATHERING)
    assert model.barrier.due(0.0) == 0.0


def test_member_that_is_late_for_the_first_time_is_told_beside_one_that_was_late_before() -> None:
    model = Model()
    for user_id in ("a", "b", "c"):
        model.join(user_id, 40, 2.0)
    model.tick("a")
    model.tick("c")
    model.wait(2.0)
    assert model.warned == [("b", Reason.LATE_TICK)]
    model.tick("a")
    model.wait(2.0)
    assert model.warned == [("b", Reason.LATE_TICK), ("c", Reason.LATE_TICK)]
    assert model.barrier.status().late_counts == [0, 2, 1]

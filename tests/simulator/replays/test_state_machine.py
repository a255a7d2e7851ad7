"""The table of replay states: complete, and consistent with itself."""

from __future__ import annotations

from itertools import product

from rosbridge_sim.simulator.replays.state_machine import (
    REPLAY_TABLE,
    ReplayEffect,
    ReplayEvent,
    ReplayState,
)

BAG_EVENTS = frozenset({ReplayEvent.RUN_OUT})
"""Events that happen only while a bag is replayed: the table has no row for them in the other states."""

SOURCE_EVENTS = frozenset({ReplayEvent.LOST})
"""Events that happen only while a source of network replay is followed."""


def test_table_has_a_row_for_every_possible_event() -> None:
    for state, event in product(ReplayState, ReplayEvent):
        is_possible = (event not in BAG_EVENTS or state in {ReplayState.REPLAYING, ReplayState.AT_END}) and (
            event not in SOURCE_EVENTS or state is ReplayState.FOLLOWING
        )
        assert (event in REPLAY_TABLE[state]) == is_possible


def test_every_refusal_says_why_and_changes_nothing() -> None:
    for state, rows in REPLAY_TABLE.items():
        for outcome in rows.values():
            assert not outcome.why or (outcome.state is state and not outcome.effects)


def test_enter_and_leave_alternate() -> None:
    for state, rows in REPLAY_TABLE.items():
        for outcome in rows.values():
            is_on = state is not ReplayState.SIMULATING
            for effect in outcome.effects:
                assert effect is not ReplayEffect.ENTER or not is_on
                assert effect is not ReplayEffect.LEAVE or is_on
                is_on = is_on ^ (effect in {ReplayEffect.ENTER, ReplayEffect.LEAVE})
            assert is_on == (outcome.state is not ReplayState.SIMULATING)

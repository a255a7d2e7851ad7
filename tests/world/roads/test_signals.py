"""Signals over time: phases and forced lights. Colours are tested with the plan."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import UNSET, Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.roads.signals import NEVER_FRAME, Signals

R, Y, G, L = Lamp.RED, Lamp.YELLOW, Lamp.GREEN, Lamp.LEFT


def make() -> SignalPlan:
    """Two intersections of two groups, a pair of lights that nothing runs, and a warning."""
    lights = [Light(f"T{i}") for i in range(7)] + [Light("warn", lamps=Y)]
    first = Controller("I0", 0, ((0, 1), (2,)), (Phase(100, (G, R)), Phase(50, (R, G))), (10, 10))
    second = Controller("I1", 1, ((3,), (4, 7)), (Phase(30, (G, R)), Phase(30, (R, G))), (5, 5))
    return SignalPlan(Roads(), lights, [first, second], together=[(5, 6)])


def at(signals: Signals, frame: int) -> list[int]:
    signals.advance(frame)
    return [int(value) for value in signals.shown]


def test_phases_give_elapsed_and_remaining_time() -> None:
    signals = Signals(make(), 1000)
    signals.advance(1000)
    assert (signals.phase.tolist(), signals.elapsed(0), signals.remaining(0)) == ([0, 0], 0, 110)
    signals.advance(1109)
    assert (signals.phase.tolist(), signals.elapsed(0), signals.remaining(0)) == ([0, 1], 109, 1)
    signals.advance(1110)
    assert (signals.phase.tolist(), signals.elapsed(0), signals.remaining(0)) == ([1, 1], 0, 60)
    assert (signals.phase_length(0, 0), signals.phase_length(0, 1)) == (110, 60)


def test_state_of_any_frame_is_computed_directly() -> None:
    steady, jumping = Signals(make()), Signals(make())
    seen = [at(steady, frame) for frame in range(400)]
    assert [at(jumping, frame) for frame in range(0, 400, 7)] == seen[::7]
    jumping.show(3)
    assert at(jumping, 3) == seen[3]


def test_forced_light_applies_to_its_group_until_the_next_phase() -> None:
    signals = Signals(make())
    signals.advance(40)
    signals.force(0, L)
    assert at(signals, 40)[:3] == [L, L, R]
    assert at(signals, 109)[:3] == [L, L, R]
    assert at(signals, 110)[:3] == [R, R, G]
    assert at(signals, 170)[:3] == [G, G, R]


def test_forced_light_can_return_to_its_schedule() -> None:
    signals = Signals(make())
    signals.advance(40)
    signals.force(1, 0)
    assert at(signals, 41)[:2] == [0, 0]
    signals.release(0)
    assert at(signals, 41)[:2] == [G, G]


def test_forced_light_without_a_controller_holds_forever() -> None:
    signals = Signals(make())
    assert at(signals, 0)[5:7] == [UNSET, UNSET]
    signals.force(6, R)
    assert at(signals, 10**9)[5:7] == [R, R]
    signals.release(5)
    assert at(signals, 10**9)[5:7] == [UNSET, UNSET]


def test_yellow_warning_light_can_be_forced() -> None:
    signals = Signals(make())
    assert at(signals, 0)[7] == Y
    signals.force(7, G)
    assert (at(signals, 1)[4], at(signals, 1)[7]) == (G, G)
    assert at(signals, 35)[7] == Y


def test_a_phase_can_be_set() -> None:
    signals = Signals(make())
    signals.advance(20)
    signals.force(0, Y)
    signals.set_phase(0, 1, 45)
    assert (signals.phase.tolist(), signals.elapsed(0), signals.remaining(0)) == ([1, 0], 45, 15)
    assert at(signals, 20)[:3] == [R, R, G], "coming to a phase frees what was forced"
    assert at(signals, 25)[:3] == [R, R, Y]
    assert at(signals, 35)[:3] == [G, G, R]
    assert (signals.elapsed(0), signals.elapsed(1)) == (0, 0), "the other one went on"


@pytest.mark.parametrize(("phase", "elapsed", "error"), [(2, 0, IndexError), (-1, 0, IndexError), (1, 60, ValueError)])
def test_unknown_phases_are_refused(phase: int, elapsed: int, error: type[Exception]) -> None:
    signals = Signals(make())
    before = signals.digest()
    with pytest.raises(error):
        signals.set_phase(0, phase, elapsed)
    assert signals.digest() == before


def test_lane_entry_follows_its_own_light() -> None:
    lines = [np.array([(0, i, 0), (9, i, 0)], dtype=np.float64) for i in range(5)]
    roads = Roads(list("abcde"), lines, [[]] * 5, [3.5] * 5, [0.0] * 5)
    lights = [Light("x", lanes=(0, 1)), Light("unset", lanes=(2,)), Light("warn", lamps=Y, lanes=(3,))]
    phases = (Phase(10, (G,)), Phase(10, (G | L,)), Phase(10, (R | L,)), Phase(10, (R,)), Phase(10, (0,)))
    plan = SignalPlan(roads, lights, [Controller("I", 0, ((0,),), phases, (5,))], passes=[G, L, G, G, G])
    signals = Signals(plan)
    may = []
    for frame in (0, 10, 20, 25, 35, 40, 50):
        signals.advance(frame)
        may.append((int(signals.shown[0]), *(bool(lane) for lane in signals.may_enter)))
    free = (True, True, True)
    assert may == [
        (G, True, False, *free),
        (G | L, True, True, *free),
        (Y | L, False, True, *free),
        (R | L, False, True, *free),
        (Y, False, False, *free),
        (R, False, False, *free),
        (0, True, True, *free),
    ]
    signals.force(2, R)
    assert not signals.may_enter[3]


CALLS = st.one_of(
    st.tuples(st.just("advance"), st.integers(0, 80)),
    st.tuples(st.just("force"), st.integers(0, 7)),
    st.tuples(st.just("release"), st.integers(0, 7)),
    st.tuples(st.just("phase"), st.integers(0, 3)),
)


def play(signals: Signals, calls: list[tuple[str, int]]) -> None:
    for call, value in calls:
        if call == "advance":
            signals.advance(signals.frame + value)
        elif call == "force":
            signals.force(value, 2**value & 0b110101)
        elif call == "release":
            signals.release(value)
        else:
            signals.set_phase(value % 2, value // 2, 7 * value)


@given(st.lists(CALLS, max_size=12), st.lists(CALLS, max_size=12))
def test_restored_snapshot_goes_on_like_the_original(
    before: list[tuple[str, int]], after: list[tuple[str, int]]
) -> None:
    signals = Signals(make())
    play(signals, before)
    saved = signals.snapshot()
    play(signals, after)
    for _ in range(2):
        other = Signals.restored(saved)
        play(other, after)
        assert other.digest() == signals.digest()
        assert other.shown.tolist() == signals.shown.tolist()
        assert other.phase.tolist() == signals.phase.tolist()


def test_states_with_different_futures_have_different_digests() -> None:
    digests = set()
    for force in (None, R, G):
        for phase in (0, 1):
            signals = Signals(make())
            signals.set_phase(1, phase)
            if force is not None:
                signals.force(5, force)
            digests.add(signals.digest())
    assert len(digests) == 6


def test_next_changes_are_the_frames_at_which_something_else_is_shown() -> None:
    signals = Signals(make(), 7)
    shown = [at(signals, frame) for frame in range(7, 700)]
    signals.show(7)
    for frame in range(7, 350, 3):
        signals.advance(frame)
        for light, change in enumerate(signals.next_changes().tolist()):
            if change == NEVER_FRAME:
                assert {line[light] for line in shown} == {shown[0][light]}
            else:
                assert change > frame
                assert {line[light] for line in shown[frame - 7 : change - 7]} == {shown[frame - 7][light]}
                assert shown[change - 7][light] != shown[frame - 7][light]


def test_forced_light_changes_when_the_forcing_ends() -> None:
    signals = Signals(make())
    signals.advance(40)
    signals.force(0, L)
    signals.force(5, R)
    assert signals.next_changes()[[0, 1, 5]].tolist() == [110, 110, NEVER_FRAME]


def test_plan_without_lights_has_no_changes() -> None:
    assert Signals(SignalPlan(Roads())).next_changes().tolist() == []

from __future__ import annotations

import pytest

from rosbridge_sim.simulator.kernel.real_time_pacer import STALL, RealTimePacer
from rosbridge_sim.world.state.world import DT


def owed(pace: RealTimePacer, now: float) -> int:
    """How many frames are computed when the clock shows `now`."""
    num = 0
    while now >= pace.due_at:
        pace.count()
        num += 1
    return num


def test_the_first_frame_is_due_one_step_after_the_start() -> None:
    pace = RealTimePacer()
    assert not pace.is_started
    pace.start(7.0)
    assert pace.is_started
    assert pace.due_at == 7.0 + DT
    assert owed(pace, 7.0) == 0
    assert owed(pace, 7.0 + DT) == 1


def test_pacer_owes_fifty_frames_a_second_without_drift() -> None:
    pace = RealTimePacer()
    start = 1_234_567.891
    pace.start(start)
    total = 0
    for i in range(1, 10_001):
        total += owed(pace, start + i * 0.0173)
    assert total == int(10_000 * 0.0173 / DT)
    assert pace.shown_at == pytest.approx(start + total * DT, abs=1e-6)


def test_calling_at_the_due_time_always_owes_exactly_one() -> None:
    pace = RealTimePacer()
    pace.start(0.1)
    assert [owed(pace, pace.due_at) for _ in range(2_000)] == [1] * 2_000


def test_late_frames_are_owed() -> None:
    pace = RealTimePacer()
    pace.start(0.0)
    assert pace.forgive(0.5) == 0.0
    assert owed(pace, 0.5) == 25
    assert pace.num_stalls == 0


def test_stall_leaves_one_frame_owed() -> None:
    pace = RealTimePacer()
    pace.start(0.0)
    assert pace.forgive(DT + STALL) == 0.0
    given_up = pace.forgive(3_600.0)
    assert given_up == pytest.approx(3_600.0 - DT)
    assert owed(pace, 3_600.0) == 1
    assert pace.num_stalls == 1
    assert pace.lost_time == given_up
    assert pace.due_at == pytest.approx(3_600.0 + DT)

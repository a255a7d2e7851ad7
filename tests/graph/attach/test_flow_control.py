"""Flow control towards a far bridge that has no back-pressure."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.attach.flow_control import FRAME_COST, MAX_IN_FLIGHT, MAX_PATIENCE, PATIENCE, FlowControl

HALF = MAX_IN_FLIGHT // 2 - FRAME_COST
"""Size of a frame that costs half a window [bytes]."""


def spend(credit: FlowControl, num_halves: int) -> None:
    for _ in range(num_halves):
        credit.note_sent(HALF)


def test_probe_is_due_after_half_a_window_and_sending_stops_after_a_whole_window() -> None:
    credit = FlowControl()
    assert not credit.wants_probe(0.0)
    spend(credit, 1)
    assert credit.wants_probe(0.0)
    credit.probe(0.0)
    assert not credit.wants_probe(0.0)
    assert not credit.is_full
    spend(credit, 1)
    assert credit.is_full


def test_small_frames_count_more_than_their_bytes() -> None:
    credit = FlowControl()
    for _ in range(MAX_IN_FLIGHT // (FRAME_COST + 2) + 1):
        credit.note_sent(2)
    assert credit.is_full


def test_answer_confirms_all_bytes_sent_before_its_probe() -> None:
    credit = FlowControl()
    spend(credit, 1)
    number = credit.probe(0.0)
    spend(credit, 1)
    credit.note_answer(number, 0.0)
    assert not credit.is_full
    assert credit.wants_probe(0.0)  # half a window has gone out since
    spend(credit, 1)
    assert credit.is_full


def test_refused_probes_allow_all_sending_and_are_retried_with_back_off() -> None:
    credit = FlowControl()
    now = 0.0
    waits: list[float] = []
    for _ in range(8):
        spend(credit, 1)
        assert credit.wants_probe(now)
        number = credit.probe(now)
        credit.note_refusal(now)
        spend(credit, 10)
        assert not credit.is_full
        assert not credit.wants_probe(now)
        assert credit.due is not None
        assert not credit.expire(credit.due - 0.1)
        waits.append(credit.due - now)
        now = credit.due
        assert not credit.expire(now)
        assert not credit.is_late
    assert waits == sorted(waits)
    assert (waits[0], waits[-1]) == (PATIENCE, MAX_PATIENCE)
    spend(credit, 1)
    credit.note_answer(credit.probe(now), now)  # there is somebody after all
    credit.note_answer(number, now)
    spend(credit, 2)
    assert credit.is_full


def test_silence_allows_half_a_window_with_growing_delays() -> None:
    credit = FlowControl()
    now, waits = 0.0, []
    spend(credit, 2)
    for _ in range(8):
        credit.probe(now)
        due = credit.due
        assert due is not None
        assert not credit.expire(due - 0.001)
        assert credit.expire(due)
        assert credit.is_late
        waits.append(due - now)
        now = due
        assert not credit.is_full
        spend(credit, 1)
        assert credit.is_full
    assert waits[:3] == [PATIENCE, 2 * PATIENCE, 4 * PATIENCE]
    assert waits[-1] == MAX_PATIENCE


def test_a_late_answer_counts_like_any_other() -> None:
    credit = FlowControl()
    spend(credit, 1)
    first = credit.probe(0.0)
    spend(credit, 1)
    credit.expire(PATIENCE)
    second = credit.probe(PATIENCE)
    credit.note_answer(first, 1.0)
    assert not credit.is_late
    assert credit.due is not None  # of the second
    credit.note_answer(second, 1.0)
    assert credit.due is None
    credit.note_answer(first, 1.0)  # twice, and out of order, is no harm
    assert not credit.is_full


@pytest.mark.parametrize("number", [0, 7, 10**9])
def test_answer_to_an_unknown_probe_confirms_nothing(number: int) -> None:
    credit = FlowControl()
    spend(credit, 2)
    credit.probe(0.0)
    credit.note_answer(number, 1.0)
    assert credit.is_full


def test_unanswered_probes_are_bounded() -> None:
    credit = FlowControl()
    now = 0.0
    for _ in range(1_000):
        credit.probe(now)
        now += MAX_PATIENCE
        credit.expire(now)
    spend(credit, 1_000)
    credit.note_answer(1, now)  # long forgotten
    assert credit.is_late

"""State of a far bridge's rosapi, call by call."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.attach.rosapi_watch import LOOK_PERIOD, LOST_PERIOD, RosapiChange, RosapiWatch


@pytest.mark.parametrize(
    ("calls", "news"),
    [
        ("yyy", "..."),
        ("nnny", "...."),  # one that never answered cannot be lost
        ("ynyny", "....."),  # single refusals
        ("ynn", "..L"),
        ("ynnnnny", "..L...B"),
        ("ynnyynny", "..LB..LB"),
    ],
)
def test_two_refusals_in_a_row_count_as_a_lost_rosapi(calls: str, news: str) -> None:
    watch = RosapiWatch()
    seen = [watch.note_reply(0.0, is_answered=call == "y") for call in calls]
    letters = {RosapiChange.NOTHING_NEW: ".", RosapiChange.LOST: "L", RosapiChange.BACK: "B"}
    assert "".join(letters[one] for one in seen) == news


def test_rosapi_is_asked_more_often_after_a_refusal() -> None:
    watch = RosapiWatch()
    assert watch.due is None
    watch.start(10.0)
    watch.start(11.0)
    assert watch.due == 10.0 + LOOK_PERIOD
    watch.note_reply(12.0, is_answered=True)
    watch.note_asked(15.0)
    assert watch.due == 15.0 + LOOK_PERIOD
    watch.note_reply(15.1, is_answered=False)
    assert watch.due == 15.1 + LOST_PERIOD
    watch.note_reply(16.2, is_answered=False)
    watch.note_asked(17.0)
    assert watch.due == 17.0 + LOST_PERIOD
    watch.note_reply(17.1, is_answered=True)
    watch.note_asked(18.0)
    assert watch.due == 18.0 + LOOK_PERIOD


def test_new_connection_starts_without_knowledge_of_rosapi() -> None:
    watch = RosapiWatch()
    watch.start(0.0)
    for is_answered in (True, False, False):
        watch.note_reply(1.0, is_answered=is_answered)
    watch.stop()
    assert watch.due is None
    assert [watch.note_reply(2.0, is_answered=one) for one in (False, False, True)] == [RosapiChange.NOTHING_NEW] * 3

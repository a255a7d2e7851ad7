"""The user's own expressions over a drive, with topics that come late, lack fields, or never come."""

from __future__ import annotations

import pytest

from rosbridge_sim.campaigns.campaign_model import read_campaign_document
from rosbridge_sim.campaigns.drive_limits import read_limits
from rosbridge_sim.campaigns.own_limits import OwnLimits
from rosbridge_sim.campaigns.trace import FIGURES
from rosbridge_sim.expressions import Value

FIELD = "/plan.speed"

KNOWN = frozenset(FIGURES)


def judged(
    own: dict[str, dict[str, object]], speeds: list[float | None]
) -> tuple[OwnLimits, list[tuple[str, float, str]]]:
    """Judge a drive of some frames with a topic that has a value in some of them."""
    found = OwnLimits(
        read_limits(read_campaign_document({"scenario": "x", "limits": {"own": own}}, "c").limits, KNOWN, KNOWN, "c")
    )
    for i, speed in enumerate(speeds, 1):
        values: dict[str, Value] = {"time": i * 0.02, "x": float(i), "y": 0.0}
        if speed is not None:
            values[FIELD] = speed
        found.take(values)
    return found, [(each.limit, each.time, each.text) for each in found.end()]


def test_breach_tells_when_where_and_the_values() -> None:
    own, found = judged({"fast": {"always": f"max({FIELD}) < 20"}}, [None, 15.0, 21.5, 3.0])
    assert found == [("fast", 0.06, "expected max(/plan.speed) < 20; /plan.speed 21.5, max(/plan.speed) 21.5")]
    (breach,) = own.end()
    assert (breach.x, breach.y) == (3.0, 0.0)
    exact, _ = judged({"a": {"always": "x < 1"}}, [])
    exact.take({"time": 0.02, "x": 1.23456, "y": 9.87654})
    assert [(each.x, each.y) for each in exact.end()] == [(1.23, 9.88)]


def test_frames_without_a_value_do_not_count() -> None:
    own, found = judged(
        {"mean": {"end": f"mean({FIELD}) == 4 and count({FIELD} > 4) == 1 and first({FIELD}) == 3"}},
        [None, 3.0, None, 5.0],
    )
    assert (own.trouble, found) == ("", [])


@pytest.mark.parametrize("kind", ["always", "end"])
def test_limit_over_a_topic_that_never_came_cannot_be_judged(kind: str) -> None:
    own, found = judged({"fast": {kind: f"always({FIELD} < 20)"}}, [None, None])
    assert found == []
    assert own.trouble == f"c: limits.own.fast.{kind}: /plan.speed has no value: no message came that has it"


def test_value_at_the_end_is_that_of_the_last_frame() -> None:
    assert judged({"slow": {"end": f"{FIELD} < 2"}}, [9.0, 1.0])[1] == []
    own, _ = judged({"slow": {"end": f"{FIELD} < 2"}}, [1.0, None])
    assert "has no value" in own.trouble
    assert judged({"slow": {"end": f"last({FIELD}) < 2"}}, [1.0, None])[1] == []


def test_limit_without_a_value_yet_does_not_keep_others_from_being_judged() -> None:
    own, found = judged({"a": {"always": f"{FIELD} < 2"}, "b": {"always": "x < 2"}}, [None, None, 1.0])
    assert ([each[:2] for each in found], own.trouble) == ([("b", 0.04)], "")
    own, found = judged({"a": {"end": f"{FIELD} < 2"}, "b": {"end": "x < 2"}}, [None, None])
    assert [each[:2] for each in found] == [("b", 0.04)]
    assert own.trouble.startswith("c: limits.own.a.end: /plan.speed has no value")


def test_division_by_zero_at_the_end_is_told() -> None:
    own, found = judged({"a": {"end": f"1 / ({FIELD} - 4) < 9"}}, [4.0])
    assert (own.trouble.partition(" by")[0], found) == ("c: limits.own.a.end: a division", [])
    assert not own.is_judging


def test_nothing_is_judged_without_limits_or_without_a_frame() -> None:
    own, found = judged({"a": {"always": "x < 2"}}, [])
    assert (own.is_judging, own.trouble, found) == (True, "", [])
    assert judged({"a": {"end": "x < 2"}}, [])[0].is_judging
    assert not judged({}, [1.0])[0].is_judging


def test_limit_that_begins_after_the_end_of_the_drive_is_told() -> None:
    own, _ = judged({"late": {"always": f"{FIELD} < 2", "after": 9.0}}, [1.0])
    assert own.trouble == "c: limits.own.late.always: it was never judged: the drive ended before"


def test_expression_that_cannot_be_computed_is_told_and_others_keep_their_breach() -> None:
    own, found = judged({"a": {"always": f"{FIELD} < 2"}, "b": {"always": f"1 / ({FIELD} - 4) < 9"}}, [3.0, 4.0, 5.0])
    assert [each[0] for each in found] == ["a"]
    assert own.trouble.startswith("c: limits.own.b.always: a division by zero")

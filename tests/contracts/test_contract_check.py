"""A contract beside what was seen: each broken term is one line with the place, what was expected and what came."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.contracts.contract import Contract, FieldTerms, TopicTerms
from rosbridge_sim.contracts.contract_check import judge_contract
from rosbridge_sim.contracts.seen_system import SeenSystem
from tests.contracts.test_seen_system import topic_of


def broken(terms: TopicTerms, *messages: dict[str, Any], kind: str = "a/B", period: float = 0.1) -> list[str]:
    topic = topic_of(*messages, period=period)
    claims = judge_contract(Contract(topics={"/t": terms}), SeenSystem({"/t": topic}, {"/t": kind}, {}, 1.0))
    return [str(claim) for claim in claims if claim.is_broken]


def broken_field(terms: FieldTerms, *values: object) -> list[str]:
    return broken(TopicTerms(type="", fields={"x": terms}), *({"x": value} for value in values))


@pytest.mark.parametrize("kind", ["tf2_web_republisher/Foo", "tf2_web_republisher_msgs/msg/Foo"])
def test_types_of_both_generations_are_equal(kind: str) -> None:
    assert broken(TopicTerms(type="tf2_web_republisher/Foo"), kind=kind) == []


def test_other_type_is_told() -> None:
    assert broken(TopicTerms(type="a/B"), kind="a/msg/C") == ["/t: type: expected a/B, got a/msg/C"]


def test_missing_topic_is_told_with_the_nearest_one() -> None:
    contract = Contract(topics={"/odom": TopicTerms(type="a/B", rate=5.0)}, services={"/reset": ""})
    claims = judge_contract(contract, SeenSystem({}, {"/odm": "a/B"}, {}, 1.0))
    assert [str(claim) for claim in claims] == [
        "/odom: type: expected a/B, got no such topic (did you mean /odm?)",
        "/reset: type: expected a service, got no such service",
    ]


def test_types_are_not_judged_without_rosapi() -> None:
    contract = Contract(topics={"/t": TopicTerms(type="a/B", fields={"x": FieldTerms()})}, services={"/s": "a/B"})
    claims = judge_contract(contract, SeenSystem({"/t": topic_of({"x": 1})}, None, None, 1.0))
    assert [claim.is_broken for claim in claims] == [False, False, False]
    assert "rosapi" in claims[0].seen


def test_silent_topic_breaks_its_terms() -> None:
    expected = ["/t: messages: expected at least one, got none within 1 s"]
    assert broken(TopicTerms(type="", fields={"x": FieldTerms()})) == expected
    assert broken(TopicTerms(type="", rate=5.0)) == expected
    assert broken(TopicTerms(type="", rate=0.5)) == []  # a longer look is needed
    assert broken(TopicTerms(type="")) == []


@pytest.mark.parametrize(("rate", "is_broken"), [(10.0, False), (8.5, False), (11.9, False), (8.0, True), (13.0, True)])
def test_rate_may_differ_by_the_tolerance(rate: float, *, is_broken: bool) -> None:
    assert bool(broken(TopicTerms(type="", rate=rate), *[{}] * 11)) == is_broken


@pytest.mark.parametrize(
    ("num", "text"),
    [
        (1, "1 message within 1 s"),
        (2, "2 messages within 1 s"),
        (3, "10 Hz"),
        (4, "10 Hz"),
    ],
)
def test_rate_of_three_messages_is_judged_and_fewer_are_too_few(num: int, text: str) -> None:
    (line,) = broken(TopicTerms(type="", rate=40.0), *[{}] * num)
    assert line == f"/t: rate: expected 32 to 48 Hz, got {text}"
    slow = broken(TopicTerms(type="", rate=3.5), *[{}] * num)
    assert slow == ([] if num < 3 else ["/t: rate: expected 2.8 to 4.2 Hz, got 10 Hz"])  # fewer may be late by chance


def test_nine_texts_are_cut_to_eight() -> None:
    words = [str(i) for i in range(9)]
    (line,) = broken_field(FieldTerms(values=list(words)), "x")
    assert line.startswith('/t: x: expected one of "0", "1", "2", "3", "4", "5", "6", "7", ..., got')
    (line,) = broken_field(FieldTerms(values=list(words[:8])), "x")
    assert line.startswith('/t: x: expected one of "0", "1", "2", "3", "4", "5", "6", "7", got')


def test_list_without_a_least_length_may_be_empty() -> None:
    assert broken_field(FieldTerms(max_length=2), [], [1, 2]) == []
    assert len(broken_field(FieldTerms(max_length=2), [1, 2, 3])) == 1


def test_broken_rate_is_told_with_its_bounds() -> None:
    assert broken(TopicTerms(type="", rate=50.0), *[{}] * 11) == ["/t: rate: expected 40 to 60 Hz, got 10 Hz"]
    assert broken(TopicTerms(type="", rate=50.0), {}) == ["/t: rate: expected 40 to 60 Hz, got 1 message within 1 s"]


RANGE = FieldTerms(low=-1.0, high=2.0)


@pytest.mark.parametrize(
    ("terms", "values", "text"),
    [
        (RANGE, [0, 2.5], "-1 to 2, got 0 to 2.5"),
        (FieldTerms(low=0.0), [-3], "at least 0, got -3"),
        (FieldTerms(high=0.0), [3], "at most 0, got 3"),
        (RANGE, [1, None], "-1 to 2, got 1, 1 times NaN"),
        (RANGE, ["a"], '-1 to 2, got "a"'),
        (RANGE, [True], "-1 to 2, got true"),
        (RANGE, [[1]], "-1 to 2, got lists of 1 elements"),
        (RANGE, [{}], "-1 to 2, got a message"),
        (FieldTerms(values=["a"]), ["a", "b"], '"a", got "a", "b"'),
        (FieldTerms(values=["a", "b"]), [7], 'one of "a", "b", got 7'),
        (FieldTerms(values=["a"]), ["x" * 1000], '"a", got long texts'),
        (FieldTerms(values=[True]), [False], "true, got false"),
        (FieldTerms(min_length=2, max_length=3), [[1], [1, 1]], "2 to 3 elements, got lists of 1 to 2 elements"),
        (FieldTerms(max_length=1), [[1, 2]], "at most 1 elements, got lists of 2 elements"),
        (FieldTerms(min_length=1), ["AAA="], 'at least 1 elements, got "AAA="'),
    ],
)
def test_broken_field_is_one_line(terms: FieldTerms, values: list[object], text: str) -> None:
    assert broken_field(terms, *values) == [f"/t: x: expected {text}"]


@pytest.mark.parametrize(
    ("terms", "values"),
    [
        (RANGE, [-1, 2.0]),
        (FieldTerms(low=0.0, nan=True), [None, 1e300]),
        (FieldTerms(values=["a", True]), ["a", True]),
        (FieldTerms(min_length=1), [[1], [1] * 50]),
        (FieldTerms(), [1, "a", None, [], {}]),
    ],
)
def test_field_that_fits_is_kept(terms: FieldTerms, values: list[object]) -> None:
    assert broken_field(terms, *values) == []


def test_missing_field_is_told_with_the_nearest_one() -> None:
    terms = TopicTerms(type="", fields={"pose.heading": FieldTerms()})
    assert broken(terms, {"pose": {"headin": 1}}) == [
        "/t: pose.heading: expected to be there, got no such field in 1 of 1 messages (did you mean pose.headin?)"
    ]


def test_elements_of_empty_lists_are_not_missing() -> None:
    terms = {"all[].x": RANGE, "all[]": FieldTerms()}
    assert broken(TopicTerms(type="", fields=terms), {"all": []}) == []
    assert len(broken(TopicTerms(type="", fields=terms), {"all": [{}]})) == 1

"""The contract of what was seen: narrow enough to say something, and always kept by what was seen."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.contracts.contract import CONTRACT, TOLERANCE, FieldTerms
from rosbridge_sim.contracts.contract_check import judge_contract
from rosbridge_sim.contracts.contract_recording import contract_document, record_contract
from rosbridge_sim.contracts.seen_system import SeenSystem, SeenTopic
from rosbridge_sim.documents.document_reading import check_values
from tests.contracts.test_seen_system import topic_of


def observed(topic: SeenTopic, kind: str = "a/B") -> SeenSystem:
    return SeenSystem({"/t": topic}, {"/t": kind}, {"/s": "c/D"}, 1.0)


def fields_of(*messages: dict[str, Any], margin: float = 0.1) -> dict[str, FieldTerms]:
    return record_contract(observed(topic_of(*messages)), margin).topics["/t"].fields


def test_range_is_wider_by_the_margin_on_both_sides() -> None:
    assert fields_of({"x": 0.0}, {"x": 10.0})["x"] == FieldTerms(low=-1.0, high=11.0)


@pytest.mark.parametrize(("value", "low", "high"), [(5.0, 4.5, 5.5), (-2, -2.2, -1.8), (0.0, 0.0, 0.0)])
def test_constant_number_is_wider_by_a_share_of_itself(value: float, low: float, high: float) -> None:
    assert fields_of({"x": value}, {"x": value})["x"] == FieldTerms(low=low, high=high)


def test_range_with_nan_allows_nan() -> None:
    assert fields_of({"x": 1.0, "y": None}, {"x": None, "y": None}, margin=0.0) == {
        "x": FieldTerms(low=1.0, high=1.0, nan=True),
        "y": FieldTerms(nan=True),
    }


def test_few_texts_are_listed_and_many_are_not() -> None:
    few = fields_of({"frame": "a", "on": True}, {"frame": "b", "on": True})
    assert few == {"frame": FieldTerms(values=["a", "b"]), "on": FieldTerms(values=[False, True])}
    assert fields_of(*({"word": str(i)} for i in range(20)))["word"] == FieldTerms()


def test_times_counters_and_sequence_numbers_have_no_range() -> None:
    headers = [{"seq": i, "stamp": {"secs": i, "nsecs": 0}, "frame_id": "a"} for i in range(3)]
    found = fields_of(*({"header": header, "count": 7 * i} for i, header in enumerate(headers)))
    assert found == {
        "header.stamp": FieldTerms(),
        "header.frame_id": FieldTerms(values=["a"]),
        "count": FieldTerms(),
    }


def test_lengths_of_lists_have_the_margin_only_where_they_differ() -> None:
    found = fields_of({"a": [1] * 3, "b": [1] * 2}, {"a": [1] * 3, "b": [1] * 12})
    assert found["a"] == FieldTerms(min_length=3, max_length=3)
    assert found["b"] == FieldTerms(min_length=1, max_length=13)


def test_list_that_was_empty_once_may_be_empty() -> None:
    found = fields_of({"a": [], "b": [1]}, {"a": [1] * 10, "b": [1] * 11})
    assert found["a"] == FieldTerms(min_length=0, max_length=11)
    assert found["b"] == FieldTerms(min_length=0, max_length=12)


def test_field_of_two_kinds_has_no_bounds_but_must_be_there() -> None:
    found = fields_of({"x": 1.0, "y": "a", "z": [1]}, {"x": "one", "y": True, "z": 3})
    assert (found["x"], found["y"], found["z"]) == (FieldTerms(), FieldTerms(), FieldTerms())


def test_contract_has_the_types_and_a_tolerance_that_is_not_the_usual_one() -> None:
    seen = observed(topic_of(*[{}] * 6))
    usual, own = record_contract(seen, 0.1), record_contract(seen, 0.1, 0.5)
    assert (usual.topics["/t"].type, usual.services) == ("a/B", {"/s": "c/D"})
    assert (usual.topics["/t"].tolerance, own.topics["/t"].tolerance) == (TOLERANCE, 0.5)
    assert "tolerance" not in str(contract_document(usual))
    unknown = record_contract(SeenSystem(seen.topics, None, None, 1.0), 0.1)
    assert (unknown.topics["/t"].type, unknown.services) == ("", {})


def test_field_that_was_missing_once_is_no_term() -> None:
    assert list(fields_of({"a": 1, "b": 1}, {"a": 1})) == ["a"]


def test_topic_with_few_messages_has_no_rate() -> None:
    assert record_contract(observed(topic_of({}, {})), 0.1).topics["/t"].rate is None
    assert record_contract(observed(topic_of(*[{}] * 6)), 0.1).topics["/t"].rate == 10.0


NAMES = st.sampled_from(["a", "b", "stamp", "frame_id", "seq", "secs", "nsecs", "", "a.b", "a[]", "$list", "x y\n"])
SCALARS = st.none() | st.booleans() | st.integers() | st.just(10**400) | st.floats() | st.text(max_size=5)
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(NAMES, inner), max_leaves=8)
MESSAGES = st.lists(st.dictionaries(NAMES, VALUES), max_size=6)


@given(MESSAGES, st.floats(0.0, 2.0))
def test_contract_is_readable_and_kept_by_what_was_seen(messages: list[dict[str, Any]], margin: float) -> None:
    seen = observed(topic_of(*messages))
    contract = record_contract(seen, margin)
    read = check_values(CONTRACT, contract_document(contract), str)
    assert read == (contract, [])
    assert [str(claim) for claim in judge_contract(contract, seen) if claim.is_broken] == []

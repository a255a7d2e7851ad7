"""What is kept of messages: ranges, texts, lengths, steps, and all of it bounded."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.contracts.seen_system import MAX_FIELDS, MAX_VALUES, SeenTopic, parent_of


def topic_of(*messages: dict[str, Any], period: float = 0.1) -> SeenTopic:
    topic = SeenTopic()
    for i, message in enumerate(messages):
        topic.add(i * period, message)
    return topic


def test_rate_is_that_of_the_gaps_between_messages() -> None:
    assert topic_of(*[{}] * 11, period=0.02).rate == pytest.approx(50.0)


@pytest.mark.parametrize("messages", [[], [{}]])
def test_fewer_than_two_messages_have_no_rate(messages: list[dict[str, Any]]) -> None:
    assert topic_of(*messages).rate is None


def test_messages_of_one_moment_have_no_rate() -> None:
    assert topic_of({}, {}, period=0.0).rate is None


def test_numbers_have_a_range() -> None:
    seen = topic_of({"pose": {"x": 3}}, {"pose": {"x": -1.5}}).fields["pose.x"]
    assert (seen.low, seen.high, seen.is_whole, seen.kinds) == (-1.5, 3, False, {"number"})


@pytest.mark.parametrize("word", [None, float("nan"), float("inf")])
def test_what_is_no_finite_number_is_counted(word: float | None) -> None:
    fields = topic_of({"x": word, "all": [1, word]}, {"x": 2.0, "all": []}).fields
    assert (fields["x"].low, fields["x"].high, fields["x"].num_not_finite) == (2.0, 2.0, 1)
    assert (fields["all[]"].low, fields["all[]"].num_not_finite) == (1, 1)


def test_elements_of_lists_are_one_field() -> None:
    fields = topic_of({"ranges": [1.0, 5.0]}, {"ranges": [0.5]}).fields
    assert (fields["ranges"].shortest, fields["ranges"].longest) == (1, 2)
    assert (fields["ranges[]"].low, fields["ranges[]"].high, fields["ranges[]"].num) == (0.5, 5.0, 3)


def test_messages_in_lists_are_looked_into() -> None:
    fields = topic_of({"all": [{"name": "a"}, {"name": "b"}]}).fields
    assert list(fields["all[].name"].words) == ["a", "b"]


def test_flags_are_no_numbers() -> None:
    fields = topic_of({"on": True, "all": [False, True]}).fields
    assert fields["on"].kinds == fields["all[]"].kinds == {"flag"}
    assert fields["on"].is_constant


@pytest.mark.parametrize(
    ("values", "is_counter"),
    [([1, 2, 3], True), ([5, 15, 25], True), ([1, 2, 4], False), ([1.0, 1.5, 2.0], False), ([3, 3, 3], False)],
)
def test_counter_grows_by_whole_steps(values: list[float], *, is_counter: bool) -> None:
    seen = topic_of(*({"seq": value} for value in values)).fields["seq"]
    assert seen.is_counter == is_counter
    assert seen.is_constant == (len(set(values)) == 1)


def test_times_are_known_in_both_spellings() -> None:
    fields = topic_of({"a": {"secs": 1, "nsecs": 2}, "b": {"sec": 1, "nanosec": 2}, "c": {"sec": 1}}).fields
    assert [fields[name].is_time for name in "abc"] == [True, True, False]


def test_missing_fields_are_counted_where_their_message_was_there() -> None:
    topic = topic_of({"a": {"x": 1}}, {"a": {}}, {"all": []})
    assert topic.num_missing("a") == 1
    assert topic.num_missing("a.x") == 1
    assert topic.num_missing("b.x") == 3
    assert topic.num_missing("all[]") == 0  # the list was empty
    assert topic.num_missing("all[].x") == 0
    assert topic.num_missing("none[].x") == 3
    assert topic.num_missing("a[]") == 2  # it is no list


def test_parents_of_paths() -> None:
    assert [parent_of(path) for path in ("a", "a.b", "a[]", "a[].b", "a[][]")] == ["", "a", "a", "a[]", "a[]"]


def test_many_fields_and_texts_are_bounded() -> None:
    topic = topic_of(
        {f"f{i}": {"x": i} for i in range(2 * MAX_FIELDS)}, *({"f0": {"word": str(i)}} for i in range(2 * MAX_VALUES))
    )
    assert len(topic.fields) == MAX_FIELDS
    one = topic_of(*({"word": str(i)} for i in range(2 * MAX_VALUES)), {"word": "x" * 1000}).fields["word"]
    assert (len(one.words), one.is_open) == (MAX_VALUES, True)


def test_deep_messages_are_not_followed_to_their_end() -> None:
    deep: Any = 1
    for _ in range(900):
        deep = {"x": [deep]}
    assert len(topic_of(deep).fields) < 30

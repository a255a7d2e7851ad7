"""What a mock's file says of messages that came: constants, patterns, rates, transforms."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.documents.document_model import Mistake
from rosbridge_sim.mock.mock_capture import (
    MAX_LIST,
    MAX_LONG_TEXT,
    SeenTransforms,
    captured_topic,
    leave_out_mistakes,
    shorten,
)
from tests.contracts.test_seen_system import topic_of


def value_of(*messages: dict[str, Any]) -> Any:  # noqa: ANN401 - of any type
    return captured_topic(topic_of(*messages), "a/B").get("value")


def field_of(*values: object) -> Any:  # noqa: ANN401 - as above
    return value_of(*({"x": value} for value in values))["x"]


def test_topic_has_its_type_and_its_rate() -> None:
    assert captured_topic(topic_of(*[{}] * 6, period=0.02), "a/B") == {"type": "a/B", "rate": 50.0}


@pytest.mark.parametrize(("num", "period", "rate"), [(1, 1.0, None), (3, 0.01, None), (2, 1.0, 1.0), (9, 1e-6, 1000.0)])
def test_few_messages_have_a_rate_only_if_they_are_slow(num: int, period: float, rate: float | None) -> None:
    assert captured_topic(topic_of(*[{}] * num, period=period), "a/B").get("rate") == rate


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ([5, 5], 5),
        (["map", "map"], "map"),
        ([True, True], True),
        ([[1, 2], [3, 4]], [1, 2]),
        ([7, 8, 9], {"$counter": {"start": 7, "step": 1}}),
        ([1.0, 3.0, 2.0], {"$random_walk": {"start": 1.0, "step": 0.1, "low": 1.0, "high": 3.0}}),
        (["a", "b", "a"], {"$list": ["a", "b"]}),
        ([True, False], {"$list": [True, False]}),
        ([1.0, None, 2.0], 1.0),
        ([1, "a"], 1),
        ([0.1 + 0.2] * 2, 0.3),
        ([{"x": 0, "y": 0, "z": 0, "w": 1}, {"x": 0, "y": 0, "z": 1, "w": 0}], {"x": 0, "y": 0, "z": 0, "w": 1}),
        ([{"secs": 1, "nsecs": 2}, {"secs": 2, "nsecs": 5}], {"secs": 1, "nsecs": 2}),
        ([[{"a": 1}], [{"a": 5}]], [{"a": 1}]),
    ],
)
def test_field_is_a_constant_or_a_plain_pattern(values: list[object], field: object) -> None:
    assert field_of(*values) == field


def test_many_texts_are_the_first_one() -> None:
    assert field_of(*map(str, range(20))) == "0"


def test_stamps_and_numbers_of_headers_are_those_of_the_mock() -> None:
    header = {"seq": 1, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": "odom"}
    assert value_of({"header": header, "all": [{"header": header}]}) == {
        "header": {"frame_id": "odom"},
        "all": [{"header": {"frame_id": "odom"}}],
    }


def test_what_is_too_long_is_left_out() -> None:
    long_list, long_text = [0] * (MAX_LIST + 1), "x" * (MAX_LONG_TEXT + 1)
    assert value_of({"a": long_list, "b": long_text, "c": [long_text], "d": 1}) == {"d": 1}


def test_text_of_a_stranger_becomes_no_pattern() -> None:
    assert value_of({"a": {"$file": "x"}, "b": [{"$expression": "1", "c": 2}]}) == {"a": {}, "b": [{"c": 2}]}


def test_deep_message_is_cut() -> None:
    deep: Any = 1
    for _ in range(900):
        deep = {"x": [deep]}
    assert len(repr(value_of(deep))) < 1_000


def transform(child: str, x: float = 0.0, z: float = 0.0, w: float = 1.0) -> dict[str, Any]:
    pose = {"translation": {"x": x, "y": 0.0, "z": 0.0}, "rotation": {"x": 0.0, "y": 0.0, "z": z, "w": w}}
    return {"header": {"frame_id": "map"}, "child_frame_id": child, "transform": pose}


def test_transforms_of_all_nodes_are_one_tree() -> None:
    seen = SeenTransforms()
    for i in range(6):
        seen.add(0.1 * i, {"transforms": [transform("base", x=i)]}, is_static=False)
        seen.add(0.1 * i, {"transforms": [transform("arm", z=1.0, w=0.0)]}, is_static=False)
    seen.add(0.0, {"transforms": [transform("lidar", x=2.0)]}, is_static=True)
    arm, base, lidar = seen.captured()
    assert base == {"parent": "map", "child": "base", "rate": 10.0, "x": 5.0}
    assert arm == {"parent": "map", "child": "arm", "rate": 10.0, "yaw": pytest.approx(3.141592654)}
    assert lidar == {"parent": "map", "child": "lidar", "x": 2.0}


@pytest.mark.parametrize("broken", [5, [5], [{}], [{"header": 5}], [{**transform("a"), "transform": {"rotation": 1}}]])
def test_broken_transforms_are_passed_over(broken: object) -> None:
    seen = SeenTransforms()
    seen.add(0.0, {"transforms": broken}, is_static=False)
    assert seen.captured() == []


def test_transform_without_numbers_is_passed_over() -> None:
    seen = SeenTransforms()
    seen.add(0.0, {"transforms": [transform("a", x="far"), transform("b", w=None)]}, is_static=False)  # type: ignore[arg-type] # a strange server
    assert seen.captured() == []


def test_mistakes_are_left_out_the_value_first() -> None:
    document: dict[str, Any] = {"topics": {"/a": {"type": "x", "value": {}}, "/b": {}}, "transforms": [1, 2], "seed": 5}

    def find(value: dict[str, Any]) -> list[Mistake]:
        found = []
        if "value" in value["topics"].get("/a", ()):
            found += [Mistake(("topics", "/a", "value", "y"), "one"), Mistake(("topics", "/a", "value", "z"), "two")]
        if "/b" in value["topics"]:
            found.append(Mistake(("topics", "/b", "type"), "three"))
        if len(value.get("transforms", ())) > 1:
            found.append(Mistake(("transforms", 1, "parent"), "four"))
        return found + ([Mistake(("seed",), "five")] if "seed" in value else [])

    assert leave_out_mistakes(document, find) == ["one", "two", "three", "four", "five"]
    assert document == {"topics": {"/a": {"type": "x"}}, "transforms": [1]}


def test_longest_values_are_left_out_until_the_rest_is_short_enough() -> None:
    document: dict[str, Any] = {"topics": {f"/{num}": {"value": "x" * num} for num in (10, 500, 30)}}
    assert shorten(document, 150, lambda value: len(repr(value))) == ["/500"]
    assert document["topics"]["/500"] == {}
    assert shorten(document, 150, lambda value: len(repr(value))) == []

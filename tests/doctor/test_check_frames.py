"""Frames of checks, written, read and compared."""

from __future__ import annotations

import datetime as dt
import json

import cbor2
import pytest

from rosbridge_sim.doctor.check_frames import agrees, read_frame, write_frame


@pytest.mark.parametrize(
    ("expected", "good", "bad"),
    [
        ("~a+", "aaa", "ab"),
        ({"$any": "number"}, 1.5, True),
        ({"$any": "bool"}, False, 0),
        ({"$any": "list"}, [1], {}),
        ({"$has": {"a": 1}}, {"a": 1, "b": 2}, {"a": 2}),
        ({"$has": {}}, {}, []),
        ({"$either": [1, ["other", 2]]}, 1, 2),
        ({"$ros": [1, 2]}, 1, 2),
        ({"$now": 0}, 0, 5),
        ({"$repeat": ["ab", 2]}, "abab", "ab"),
        ({"a": [1, {"b": None}]}, {"a": [1, {"b": None}]}, {"a": [1, {"b": None, "c": 1}]}),
        ([1], [1], [1, 1]),
        (1, 1, 1.0),
        (1, 1, True),
    ],
)
def test_frame_is_what_a_check_wants(expected: object, good: object, bad: object) -> None:
    assert agrees(expected, good)
    assert not agrees(expected, bad)


def test_frames_are_written_in_every_form() -> None:
    op = {"op": "publish", "msg": {"data": {"$repeat": ["x", 3]}}}
    assert json.loads(write_frame(op)) == {"op": "publish", "msg": {"data": "xxx"}}
    assert write_frame('{"op":') == '{"op":'
    assert write_frame({"$hex": "ff00"}) == b"\xff\x00"
    assert write_frame({"$json": {"op": "x"}}) == b'{"op": "x"}'
    frame = write_frame({"$cbor": {"data": {"$tag": 85, "$hex": "0000803f"}, "bytes": {"$hex": "01"}}})
    assert isinstance(frame, bytes)
    assert cbor2.loads(frame) == {"data": cbor2.CBORTag(85, b"\x00\x00\x80\x3f"), "bytes": b"\x01"}


def test_binary_frame_is_read_as_cbor() -> None:
    frame = cbor2.dumps({"bytes": b"\x01", "data": cbor2.CBORTag(85, b"\x02"), "x": float("nan")})
    assert read_frame(frame) == {"$cbor": {"bytes": {"$hex": "01"}, "data": {"$tag": 85, "$hex": "02"}, "x": "NaN"}}


def test_values_of_strange_cbor_are_shown_as_text() -> None:
    frame = cbor2.dumps({1: dt.date(2026, 1, 2), "big": cbor2.CBORTag(5000, [1])})
    value = read_frame(frame)
    assert json.loads(json.dumps(value)) == {"$cbor": {"1": "2026-01-02", "big": {"$tag": 5000, "value": [1]}}}


@pytest.mark.parametrize("frame", ["{", b"\xa3\x01"])
def test_frame_in_no_form_is_an_error(frame: str | bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - with the library's text
        read_frame(frame)

"""Bytes of ROS 1 that are no message of their type. What is read of the right ones: `test_all_encodings.py`."""

from __future__ import annotations

import struct

import pytest

from rosbridge_sim.errors import FieldError, Reason
from rosbridge_sim.schema.ros_reading import MAX_OBJECTS, RosReaders
from tests.schema.type_factory import make

TEXT = "uint8 a\nstring s\nInner[] many\nfloat64[] numbers\nuint8[] data\ntime[] times\nstring[2] two"
INNER = "string name\nNothing[] nothing"


def test_every_cut_and_every_byte_too_many_is_refused() -> None:
    t = make(TEXT, Inner=INNER, Nothing="")
    body = {
        "a": 1,
        "s": "hi",
        "many": [{"name": "x", "nothing": [{}]}] * 2,
        "numbers": [0.5] * 200,
        "data": [1, 2, 3],
        "times": [{"secs": 1, "nsecs": 2}],
        "two": ["p", "q"],
    }
    raw = t.encode_raw(t.check(body, 0))
    reader = RosReaders()
    assert t.encode_raw(reader.read(t.spec, raw)) == raw
    for end in range(len(raw)):
        with pytest.raises(FieldError, match="p/T: the bytes are not a message of this type: they end too early"):
            reader.read(t.spec, raw[:end])
    with pytest.raises(FieldError, match="and 1 more"):
        reader.read(t.spec, raw + b"\0")


def test_lengths_that_promise_gigabytes_cost_nothing() -> None:
    for text in ("uint8[] x", "float64[] x", "string x", "string[] x", "time[] x", "Nothing[] x"):
        t = make(text, Nothing="")
        with pytest.raises(FieldError):
            RosReaders().read(t.spec, struct.pack("<I", 2**32 - 1))


def test_a_message_of_too_many_parts_is_refused() -> None:
    t = make("Inner[] many", Inner="string[] names")
    num = MAX_OBJECTS // 2
    raw = struct.pack("<I", num) + struct.pack("<II", 1, 0) * num
    assert len(RosReaders().read(t.spec, raw).many) == num
    raw = struct.pack("<I", num) + struct.pack("<III", 2, 0, 0) * num
    with pytest.raises(FieldError, match="at most 10,000") as caught:
        RosReaders().read(t.spec, raw)
    assert caught.value.reason is Reason.TOO_MUCH


def test_text_in_another_encoding_is_read() -> None:
    t = make("string s")
    assert RosReaders().read(t.spec, b"\2\0\0\0\xb0C").s == "\N{REPLACEMENT CHARACTER}C"

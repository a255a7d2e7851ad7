"""ROS serialization: annotated bytes, and differences of the two ROS versions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import EncodingError, FieldError
from rosbridge_sim.schema.codegen import MAX_INLINE, MAX_STARRED
from rosbridge_sim.schema.definitions.names import Generation
from tests.schema.reference_readers import Rosbags, alike, plain
from tests.schema.type_factory import make


def written(ros: Generation, text: str, body: dict[str, Any], **other: str) -> bytes:
    message_type = make(text, ros=ros, **other)
    return message_type.encode_raw(message_type.check(body, 0))


TEXT = "uint8 a\nfloat64 b\nstring s\nint16 c\nint32[] n\nuint8 d\nfloat64[] m\nstring[] t\ntime stamp"
BODY = {
    "a": 1, "b": 0.5, "s": "hi", "c": -2, "n": [3], "d": 4, "m": [0.5], "t": ["x", "yz"],
    "stamp": {"secs": 5, "nsecs": 6},
}  # fmt: skip
HALF = b"\0\0\0\0\0\0\xe0\x3f"


def test_ros_1_bytes_have_no_padding() -> None:
    assert (
        written(1, TEXT, BODY)
        == (
            b"\1" + HALF + b"\2\0\0\0hi"  # a, b, s with its length
            b"\xfe\xff"  # c
            b"\1\0\0\0\3\0\0\0"  # n with its length
            b"\4"  # d
            b"\1\0\0\0" + HALF + b"\2\0\0\0\1\0\0\0x\2\0\0\0yz"  # m, t with their lengths
            b"\5\0\0\0\6\0\0\0"
        )
    )


def test_cdr_aligns_numbers_to_their_size() -> None:
    assert (
        written(2, TEXT, BODY)
        == (
            b"\0\1\0\0"  # encapsulation: CDR, little-endian
            b"\1" + bytes(7) + HALF + b"\3\0\0\0hi\0"  # a, up to 8, b, s with its zero: 23 bytes
            b"\0\xfe\xff"  # up to 24, c: 26
            b"\0\0\1\0\0\0\3\0\0\0"  # up to 28, n: 36
            b"\4\0\0\0"  # d, up to 40
            b"\1\0\0\0\0\0\0\0" + HALF + b"\2\0\0\0\2\0\0\0x\0"  # length of m, up to 48, m: 56; t and its first: 66
            b"\0\0\3\0\0\0yz\0"  # up to 68, its second: 75
            b"\0\5\0\0\0\6\0\0\0"  # up to 76
        )
    )


def test_empty_arrays_have_no_padding_in_cdr() -> None:
    assert written(2, "float64[] m\nuint8 d", {"d": 7}) == b"\0\1\0\0" + b"\0\0\0\0" + b"\7"


def test_empty_message_is_one_byte_in_cdr() -> None:
    assert written(1, "", {}) == b""
    assert written(2, "", {}) == b"\0\1\0\0\0"
    assert written(1, "U u\nint8 x\nU[2] two", {"x": 1}, U="") == b"\1"
    assert written(2, "U u\nint8 x\nU[2] two", {"x": 1}, U="") == b"\0\1\0\0\0\1\0\0"


def test_bytes_and_times_have_the_sign_of_their_ros_version() -> None:
    assert written(1, "byte b\nchar c\nbyte[] bs", {"b": -1, "c": 255, "bs": [-2]}) == b"\xff\xff\1\0\0\0\xfe"
    assert written(2, "byte b\nchar c\nbyte[] bs", {"b": 255, "bs": [254]}) == b"\0\1\0\0\xff\0\0\0\1\0\0\0\xfe"
    late = {"t": {"secs": 2**32 - 1, "nsecs": 2**32 - 1}, "d": {"secs": -1, "nsecs": -2}}
    assert written(1, "time t\nduration d", late) == b"\xff" * 12 + b"\xfe\xff\xff\xff"
    early = {"t": {"sec": -1, "nanosec": 2**32 - 1}}
    assert written(2, "time t", early) == b"\0\1\0\0" + b"\xff" * 8


def test_wide_string_cannot_be_serialized_in_ros_2() -> None:
    assert written(1, "wstring w", {"w": "ä"}) == b"\2\0\0\0\xc3\xa4"
    for text in ("wstring w", "wstring[] w", "U[] u"):
        with pytest.raises(FieldError, match="has a wstring"):
            written(2, text, {}, U="wstring w")


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("count", [MAX_STARRED, MAX_STARRED + 1])
@pytest.mark.parametrize("kind", ["int8", "uint16", "float32", "float64", "bool", "uint8", "string", "time"])
@pytest.mark.parametrize("before", ["", "int8 a", "int8[3] a"])
def test_fixed_arrays_of_any_length_are_serialized_in_any_place(
    ros: Generation, count: int, kind: str, before: str
) -> None:
    t = make(f"{before}\n{kind}[{count}] x\nint8 y\n{kind}[2] z", ros=ros)
    value = t.check({"y": 7}, 0)
    assert alike(Rosbags(ros).read(t.spec, t.encode_raw(value)), plain(t.spec, value))


@pytest.mark.parametrize("ros", [1, 2])
def test_large_nested_messages_are_serialized_by_separate_functions(ros: Generation) -> None:
    small = "".join(f"float64 x{i}\n" for i in range(MAX_INLINE))
    t = make("int8 a\nU u\nV v\nV[2] vs\nint16 b", ros=ros, U=small, V=small + "float64 last\nstring s\n")
    value = t.check({"a": 1, "v": {"last": 2.0, "s": "x"}, "vs": [{"s": "abc"}, {"s": "de"}], "b": 3}, 0)
    assert alike(Rosbags(ros).read(t.spec, t.encode_raw(value)), plain(t.spec, value))


@pytest.mark.parametrize("ros", [1, 2])
def test_numpy_values_are_serialized(ros: Generation) -> None:
    t = make("float64 f\nint32 i\nbool b\nfloat32[] a\nuint8[] d\nfloat64[6] m\nint32[] n\nbool[] o", ros=ros)
    value = t.struct_type(
        f=np.float32(0.5), i=np.int64(-3), b=np.bool_(1), a=np.array([0.5, np.nan]), d=np.array([1, 2], np.uint8),
        m=np.eye(6)[:, 0], n=np.arange(300)[::-1], o=np.array([True, False]),
    )  # fmt: skip
    again = Rosbags(ros).read(t.spec, t.encode_raw(value))
    assert (again["f"], again["i"], again["b"], again["d"], again["m"]) == (0.5, -3, True, b"\1\2", [1, 0, 0, 0, 0, 0])
    assert (again["n"][:2], len(again["n"]), again["o"]) == ([299, 298], 300, [True, False])
    assert (again["a"][0], math.isnan(again["a"][1])) == (0.5, True)


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize(
    "fields", [{"i": "x"}, {"i": 2**31}, {"s": 3}, {"f": 1e300}, {"u": None}, {"t": 3}, {"a": [1]}, {"u8": "x"}]
)
def test_value_that_does_not_fit_its_type_is_an_error(ros: Generation, fields: dict[str, Any]) -> None:
    t = make("int32 i\nstring s\nfloat32 f\nU u\ntime t\nfloat64[3] a\nuint8[] u8", ros=ros, U="int8 x")
    with pytest.raises(EncodingError, match=r"^p/T: cannot be written as ROS does: "):
        t.encode_raw(t.struct_type(**fields))

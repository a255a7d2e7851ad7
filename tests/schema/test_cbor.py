"""CBOR encoding: bytes, typed arrays, numpy values, and refused values."""

from __future__ import annotations

import math
import struct
from typing import Any

import cbor2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import EncodingError, FieldError
from rosbridge_sim.schema.cbor import encode_plain, head
from rosbridge_sim.schema.codegen import MAX_INLINE
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.schema.store import Store
from tests.schema.reference_readers import ARRAY_TAGS, read_cbor
from tests.schema.strategies import shared_store
from tests.schema.type_factory import make


def written(text: str, ros: Generation = 1, **fields: Any) -> bytes:  # noqa: ANN401 - any field
    message_type = make(text, ros=ros)
    return message_type.encode_cbor(message_type.struct_type(**fields))


def test_message_has_the_annotated_cbor_bytes() -> None:
    t = make("int32 i\nfloat64 f\nstring s\nbool b\nuint8[] d\nint16[] a\ntime t\nU u", U="int8 x")
    value = t.check({"i": -500, "f": 0.5, "s": "hi", "b": True, "d": [1, 255], "a": [1, -2], "t": {"secs": 1}}, 0)
    assert t.encode_cbor(value) == (
        b"\xa8"  # a map of eight
        b"\x61i\x39\x01\xf3"  # -1 - 499
        b"\x61f\xfb\x3f\xe0\0\0\0\0\0\0"  # a double
        b"\x61s\x62hi"
        b"\x61b\xf5"
        b"\x61d\x42\x01\xff"  # a byte string
        b"\x61a\xd8\x4d\x44\x01\0\xfe\xff"  # tag 77 over four bytes
        b"\x61t\xa2\x64secs\x01\x65nsecs\0"
        b"\x61u\xa1\x61x\0"
    )


@pytest.mark.parametrize("kind", ARRAY_TAGS)
@pytest.mark.parametrize("array", ["[]", "[3]", "[<=5]", "[70]"])
def test_number_arrays_are_typed_arrays_known_to_roslib(kind: str, array: str) -> None:
    values = [1, 2, 3] if array != "[70]" else [3] * 70
    item = cbor2.loads(written(f"{kind}{array} a", a=values))["a"]
    assert (item.tag, isinstance(item.value, bytes)) == (ARRAY_TAGS[kind], True)
    assert read_cbor(written(f"{kind}{array} a", a=values)) == {"a": values}


@pytest.mark.parametrize("kind", ["uint8", "char"])
@pytest.mark.parametrize("array", ["[]", "[3]"])
def test_arrays_of_bytes_are_byte_strings(kind: str, array: str) -> None:
    assert read_cbor(written(f"{kind}{array} a", a=b"\0\1\xff")) == {"a": b"\0\1\xff"}


def test_a_byte_has_a_sign_in_ros_1() -> None:
    assert cbor2.loads(written("byte[] a", a=[-1]))["a"] == cbor2.CBORTag(72, b"\xff")
    assert cbor2.loads(written("byte[] a", ros=2, a=[255]))["a"] == cbor2.CBORTag(64, b"\xff")


def test_other_arrays_are_plain_arrays() -> None:
    t = make("bool[] b\nstring[] s\ntime[] t\nduration[2] d\nU[] u", U="int8 x")
    body = {"b": [True, False], "s": ["", "é" * 300], "t": [{"secs": 1, "nsecs": 2}], "u": [{"x": 1}, {"x": -1}]}
    zero = {"secs": 0, "nsecs": 0}
    assert read_cbor(t.encode_cbor(t.check(body, 0))) == {**body, "d": [zero, zero]}


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, -0.0, 0.1])
def test_every_float_is_a_double(number: float) -> None:
    for kind in ("float32", "float64"):
        assert written(f"{kind} f", f=number) == b"\xa1\x61f\xfb" + struct.pack(">d", number)
    assert encode_plain(number) == b"\xfb" + struct.pack(">d", number)


@given(st.integers(-(2**63), 2**64 - 1))
def test_integers_have_the_shortest_head(number: int) -> None:
    t = make("uint64 i" if number >= 0 else "int64 i")
    assert t.encode_cbor(t.struct_type(i=number)) == b"\xa1\x61i" + cbor2.dumps(number)


@pytest.mark.parametrize("length", [0, 23, 24, 255, 256, 65_535, 65_536])
def test_lengths_of_every_size_are_encoded(length: int) -> None:
    value: dict[str, Any] = {
        "s": "x" * length,
        "d": b"x" * length,
        "a": [1.0] * length,
        "b": [True] * length,
        "t": ["y"] * length,
    }
    assert read_cbor(written("string s\nuint8[] d\nfloat32[] a\nbool[] b\nstring[] t", **value)) == value


def test_number_of_more_than_64_bits_is_refused() -> None:
    assert head(0, 2**64 - 1) == b"\x1b" + b"\xff" * 8
    with pytest.raises(ValueError, match="64 bits"):
        head(0, 2**64)


def test_numpy_values_are_encoded() -> None:
    value: dict[str, Any] = {
        "f": np.float32(0.5), "i": np.int64(-300), "b": np.bool_(1), "a": np.array([0.5, np.inf], np.float32),
        "d": np.array([1, 2], np.uint8), "m": np.eye(6)[:, 0], "n": np.arange(3)[::-1], "o": np.array([True, False]),
    }  # fmt: skip
    text = "float64 f\nint32 i\nbool b\nfloat32[] a\nuint8[] d\nfloat64[6] m\nint32[] n\nbool[] o"
    expected = {
        "f": 0.5, "i": -300, "b": True, "a": [0.5, math.inf], "d": b"\1\2", "m": [1, 0, 0, 0, 0, 0], "n": [2, 1, 0],
        "o": [True, False],
    }  # fmt: skip
    assert read_cbor(written(text, **value)) == expected


def test_large_nested_messages_are_encoded_by_separate_functions() -> None:
    small = "".join(f"float64 x{i}\n" for i in range(MAX_INLINE))
    t = make("int8 a\nU u\nV v\nint8 b", U=small, V=small + "float64 last\nstring s\n")
    value = t.check({"a": 1, "v": {"last": 2.0, "s": "x"}, "b": 3}, 0)
    again = read_cbor(t.encode_cbor(value))
    assert (again["a"], again["v"]["last"], again["v"]["s"], again["b"], len(again["u"])) == (1, 2.0, "x", 3, 100)


@pytest.mark.parametrize(
    "fields", [{"i": "x"}, {"i": 2**64}, {"s": 3}, {"f": "x"}, {"u": None}, {"t": 3}, {"a": [1]}, {"a": ["x"] * 3}]
)
def test_value_that_does_not_fit_its_type_is_an_error(fields: dict[str, Any]) -> None:
    t = make("int32 i\nstring s\nfloat64 f\nU u\ntime t\nfloat64[3] a", U="int8 x")
    with pytest.raises(EncodingError, match=r"^p/T: cannot be written as CBOR: "):
        t.encode_cbor(t.struct_type(**fields))


# Types that nobody knows


_ITEMS = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@given(_ITEMS)
def test_plain_objects_are_encoded(item: object) -> None:
    assert cbor2.loads(encode_plain(item)) == item


def test_values_of_unknown_types_are_encoded() -> None:
    message = Message(OpaqueType("who/Knows"), {"a": [1, {"b": None}]})
    assert cbor2.loads(message.cbor) == {"a": [1, {"b": None}]}
    with pytest.raises(FieldError, match=r"^who/Knows is not known here, so it cannot be sent as cbor-raw$"):
        _ = message.raw
    for item in (object(), {"a": object()}):
        with pytest.raises(FieldError, match="cannot be written as CBOR"):
            encode_plain(item)


def test_values_of_unknown_types_are_never_too_deep_for_the_encoder() -> None:
    def nested(depth: int) -> dict[str, Any]:
        value: dict[str, Any] = {}
        for _ in range(depth):
            value = {"a": value}
        return value

    accepted = OpaqueType("who/Knows").check(nested(240), 0)
    assert cbor2.loads(encode_plain(accepted)) == accepted
    for depth in (300, 100_000):
        with pytest.raises(FieldError, match="who/Knows"):
            OpaqueType("who/Knows").check(nested(depth), 0)


def test_a_message_is_encoded_once() -> None:
    store: Store = shared_store()
    message = Message(store.message("std_msgs/String"), store.message("std_msgs/String").struct_type(data="x"))
    assert message.cbor == b"\xa1\x64data\x61x"
    assert message.cbor is message.cbor
    assert message.raw == b"\1\0\0\0x"
    assert message.raw is message.raw

"""CBOR and pictures, in and out, and what of a stranger's is refused."""

from __future__ import annotations

import base64
import contextlib
import json
import math
from typing import Any

import cbor2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.encodings import cbor_head, cbor_raw_frame, decode_cbor, decode_png, is_cbor, png_frame

json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def tagged(tag: int, kind: str, values: list[float]) -> cbor2.CBORTag:
    return cbor2.CBORTag(tag, np.array(values, kind).tobytes())


@given(st.dictionaries(st.text(), json_values, max_size=4))
def test_a_plain_map_says_the_same_in_json(value: dict[str, Any]) -> None:
    frame = cbor2.dumps(value)
    assert json.loads(decode_cbor(frame)) == value


def test_bytes_are_base64_and_typed_arrays_are_lists() -> None:
    frame = cbor2.dumps(
        {
            "bytes": b"hi",
            "clamped": tagged(64, "u1", [1, 255]),
            "little": tagged(86, "<f8", [1.5, -2.0]),
            "big": tagged(81, ">f4", [0.5]),
            "ints": tagged(77, "<i2", [-3]),
            "nan": float("nan"),
        }
    )
    value = json.loads(decode_cbor(frame))
    assert math.isnan(value.pop("nan"))
    assert value == {"bytes": "aGk=", "clamped": "Af8=", "little": [1.5, -2.0], "big": [0.5], "ints": [-3]}


@pytest.mark.parametrize(
    "frame",
    [
        b"\xa1",
        b"\xa1\x61a",
        cbor2.dumps({1: 2}),
        cbor2.dumps({"a": cbor2.CBORTag(35, "a+")}),
        cbor2.dumps({"a": 2**70}),
        cbor2.dumps({"a": cbor2.CBORTag(86, b"abc")}),
        cbor2.dumps({"a": cbor2.CBORTag(86, "text")}),
        cbor2.dumps({"a": cbor2.CBORTag(99, 1)}),
        cbor2.dumps({"a": cbor2.undefined}),
        b"\xa1\x61a\xd8\x1c\x81\xd8\x1d\x00",  # a list that holds itself
        b"\xa1\x61a" * 10_000,
        b"\xa2\x61a\x01\x61a\x02",  # one key twice
        b"\xa1\x61a\x9b\xff\xff\xff\xff\xff\xff\xff\xff",  # a list that claims 2^64 items
        b"\xa1\x61a\x62\xff\xff",
        b"\xa1\x61a\xc1\x1a\x51\x4b\x67\xb0",  # a date
    ],
)
def test_what_json_has_no_word_for_is_refused(frame: bytes) -> None:
    with pytest.raises(FrameError) as caught:
        decode_cbor(frame)
    assert "\n" not in str(caught.value)


@given(st.binary(max_size=50).map(lambda data: b"\xa2" + data))
def test_any_bytes_are_a_text_or_an_error(frame: bytes) -> None:
    with contextlib.suppress(FrameError):
        json.loads(decode_cbor(frame))


def test_json_text_is_never_taken_for_cbor() -> None:
    assert not any(is_cbor(text.encode()) for text in ("", "{", " {", "\t{", "[", "Ä"))
    assert is_cbor(b"\xa3")
    assert is_cbor(b"\xbf")


def test_cbor_frames_out() -> None:
    assert cbor2.loads(cbor_head("/é") + b"\xa1\x61x\x01") == {"op": "publish", "topic": "/é", "msg": {"x": 1}}
    raw = cbor2.loads(cbor_raw_frame(cbor_head("/t"), 12_000_000_034, b"wire"))
    assert raw == {"op": "publish", "topic": "/t", "msg": {"secs": 12, "nsecs": 34, "bytes": b"wire"}}


@given(st.text(max_size=200))
def test_a_picture_gives_its_text_back(text: str) -> None:
    frame = json.dumps({"op": "publish", "msg": text}, ensure_ascii=False).encode()
    op = json.loads(png_frame(frame))
    assert op["op"] == "png"
    assert decode_png(op["data"]) == frame


def test_pictures_that_hold_nothing() -> None:
    bomb = base64.b64encode(
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\1\0\0\0\1\0\0\x08\2\0\0\0" + b"\0" * 4 + b"\0\0\0\0IEND\xaeB`\x82"
    ).decode()
    for data in ("", "AAAA", "not base64!", base64.b64encode(b"x" * 99).decode(), bomb):
        with pytest.raises(FrameError, match="png"):
            decode_png(data)

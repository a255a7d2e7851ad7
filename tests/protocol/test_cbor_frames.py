"""CBOR frames in both directions, and refused ones."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import cbor2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.cbor_frames import (
    MAX_CONTAINERS,
    MAX_SCALAR_BYTES,
    MAX_TEXTS,
    cbor_head,
    cbor_raw_frame,
    decode_cbor,
    is_cbor,
)
from tests.support import finish

json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def read(frame: bytes) -> Any:  # noqa: ANN401 - whatever the frame holds
    """What a frame of CBOR holds, in however many slices it is read."""
    return finish(decode_cbor(frame))


def tagged(tag: int, kind: str, values: list[float]) -> cbor2.CBORTag:
    return cbor2.CBORTag(tag, np.array(values, kind).tobytes())


@given(st.dictionaries(st.text(), json_values, max_size=4))
def test_plain_cbor_map_equals_its_json(value: dict[str, Any]) -> None:
    frame = cbor2.dumps(value)
    assert read(frame) == value


def test_cbor_bytes_become_base64_and_typed_arrays_become_arrays() -> None:
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
    value = read(frame)
    assert math.isnan(value.pop("nan"))
    arrays = {name: value.pop(name) for name in ("little", "big", "ints")}
    assert value == {"bytes": "aGk=", "clamped": "Af8="}
    assert {name: array.tolist() for name, array in arrays.items()} == {
        "little": [1.5, -2.0],
        "big": [0.5],
        "ints": [-3],
    }
    assert all(array.dtype.isnative for array in arrays.values())


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
def test_cbor_values_without_a_json_form_are_refused(frame: bytes) -> None:
    with pytest.raises(FrameError) as caught:
        read(frame)
    assert "\n" not in str(caught.value)


@given(st.binary(max_size=50).map(lambda data: b"\xa2" + data))
def test_any_bytes_give_a_value_or_an_error(frame: bytes) -> None:
    with contextlib.suppress(FrameError):
        read(frame)


def test_json_text_is_never_read_as_cbor() -> None:
    assert not any(is_cbor(text.encode()) for text in ("", "{", " {", "\t{", "[", "Ä"))
    assert is_cbor(b"\xa3")
    assert is_cbor(b"\xbf")


def test_frames_are_encoded_as_cbor() -> None:
    assert cbor2.loads(cbor_head("/é") + b"\xa1\x61x\x01") == {"op": "publish", "topic": "/é", "msg": {"x": 1}}
    raw = cbor2.loads(cbor_raw_frame(cbor_head("/t"), 12_000_000_034, b"wire"))
    assert raw == {"op": "publish", "topic": "/t", "msg": {"secs": 12, "nsecs": 34, "bytes": b"wire"}}


@pytest.mark.parametrize(
    "value",
    [[[]] * MAX_CONTAINERS, [{}] * MAX_CONTAINERS, [""] * MAX_TEXTS, [b""] * MAX_TEXTS, [0] * (MAX_SCALAR_BYTES + 1)],
)
def test_a_frame_with_too_many_items_is_refused_and_names_the_limit(value: list[object]) -> None:
    with pytest.raises(FrameError, match=r"at most [\d,]+ "):
        read(cbor2.dumps({"a": value}))


def test_item_count_stops_at_the_limit_and_yields_to_others() -> None:
    slices: list[None] = []
    with pytest.raises(FrameError, match="at most 15,000 maps"):
        slices.extend(decode_cbor(b"\xa1\x61a\x9a\x00\xf4\x24\x00" + b"\x80" * 16_000_000))
    assert 5 < len(slices) < 100


def test_bytes_and_typed_arrays_count_as_one_item() -> None:
    frame = cbor2.dumps({"image": bytes(6_220_800), "points": tagged(85, "<f4", [0.5] * 1_000_000)})
    value = read(frame)
    assert len(value["image"]) == 8_294_400
    assert len(value["points"]) == 1_000_000


@given(st.dictionaries(st.text(), json_values, max_size=4), st.integers(0, 30), st.integers(0, 30))
def test_item_count_of_any_frame_ends(value: dict[str, Any], cut: int, extra: int) -> None:
    with contextlib.suppress(FrameError):
        read(cbor2.dumps(value)[: -cut or None] + b"\x5f" * extra)


def test_unreadable_call_names_its_service_and_id() -> None:
    heavy = cbor2.dumps({"op": "call_service", "id": 7, "service": "/s", "args": {"a": [[]] * 20_000}})
    with pytest.raises(FrameError, match="at most 15,000 maps and lists") as caught:
        finish(decode_cbor(heavy))
    assert (caught.value.op, caught.value.op_id, caught.value.service) == ("call_service", 7, "/s")


def test_unreadable_publish_names_no_service() -> None:
    heavy = cbor2.dumps({"op": "publish", "topic": "/t", "msg": {"service": "/s", "a": [[]] * 20_000}})
    with pytest.raises(FrameError) as caught:
        finish(decode_cbor(heavy))
    assert caught.value.service is None

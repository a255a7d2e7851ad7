"""Plain data as bytes: it comes back, and no bytes do more than raise."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.plain.plain_bytes import MAX_DEPTH, decode, encode

SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary()
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=4).map(tuple)
        | st.dictionaries(st.text() | st.integers(), inner, max_size=4)
    ),
    max_leaves=12,
)


def same(one: Any, other: Any) -> bool:  # noqa: ANN401 - plain data
    """NaN equals NaN, and 0.0 is not -0.0."""
    return repr(one) == repr(other)


@given(VALUES)
def test_value_comes_back_with_its_types(value: object) -> None:
    data = encode(value)
    assert same(decode(data), value)
    assert encode(decode(data)) == data


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((0, 3)),
        np.array([math.nan, -0.0, math.inf]),
        np.arange(6, dtype=np.int64).reshape(2, 3),
        np.array([[True, False]]),
        np.arange(12.0).reshape(3, 4).T,
    ],
    ids=["empty", "odd figures", "ints", "bools", "not contiguous"],
)
def test_array_comes_back_and_can_be_written(array: np.ndarray[Any, Any]) -> None:
    back = decode(encode(array))
    assert (back.dtype, back.shape) == (array.dtype, array.shape)
    assert np.array_equal(back, array, equal_nan=array.dtype.kind == "f")
    back[...] = 0


@given(VALUES, st.data())
def test_changed_bytes_are_a_value_or_a_document_error(value: object, data: st.DataObject) -> None:
    changed = bytearray(encode(value))
    for _ in range(data.draw(st.integers(1, 3))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(changed)))
    for some in (bytes(changed), bytes(changed[:cut])):
        try:
            decode(some)
        except DocumentError as error:
            assert "byte" in str(error)  # noqa: PT017 - an error is allowed, not required


@given(st.binary(max_size=60))
def test_any_bytes_are_a_value_or_a_document_error(data: bytes) -> None:
    try:
        decode(data)
    except DocumentError:
        return


@pytest.mark.parametrize("letter", [b"l", b"t", b"m", b"s", b"b"])
def test_count_beyond_the_bytes_is_refused_before_anything_is_allocated(letter: bytes) -> None:
    with pytest.raises(DocumentError, match="expected bytes for"):
        decode(letter + struct.pack("<I", 2**32 - 1) + b"N" * 8)


def test_array_beyond_the_bytes_is_refused_before_anything_is_allocated() -> None:
    with pytest.raises(DocumentError, match="bytes more"):
        decode(b"af\x02" + struct.pack("<II", 2**32 - 1, 2**32 - 1) + b"\0" * 8)


@pytest.mark.parametrize("zero_at", [0, 3])
def test_array_of_no_items_with_huge_axes_is_refused(zero_at: int) -> None:
    axes = [2**32 - 1] * 4
    axes[zero_at] = 0
    with pytest.raises(DocumentError, match="axes"):
        decode(b"af\x04" + struct.pack("<4I", *axes))


def test_more_values_than_the_limit_are_refused() -> None:
    data = encode([None] * 9)
    assert decode(data, max_values=10) == [None] * 9
    with pytest.raises(DocumentError, match="at most 9 values"):
        decode(data, max_values=9)


def test_deep_nesting_is_refused() -> None:
    data = (b"l" + struct.pack("<I", 1)) * (MAX_DEPTH + 2) + b"N"
    with pytest.raises(DocumentError, match="levels"):
        decode(data)
    nested: Any = None
    for _ in range(MAX_DEPTH + 2):
        nested = [nested]
    with pytest.raises(TypeError, match="nested"):
        encode(nested)


@pytest.mark.parametrize(
    "value",
    [object(), {1, 2}, np.zeros(3, dtype=np.float32), np.float64(1.0)],
    ids=["object", "set", "array", "scalar"],
)
def test_other_objects_are_no_plain_data(value: object) -> None:
    with pytest.raises(TypeError, match="plain data"):
        encode(value)


def test_key_that_comes_twice_is_refused() -> None:
    twice = b"m" + struct.pack("<I", 2) + 2 * (encode("key") + encode(1))
    with pytest.raises(DocumentError, match="key"):
        decode(twice)


def test_bytes_behind_the_value_are_refused() -> None:
    with pytest.raises(DocumentError, match="expected the end"):
        decode(encode(1) + b"N")

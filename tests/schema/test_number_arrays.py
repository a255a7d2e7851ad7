"""Long arrays of numbers are converted in slices, in their own memory where that fits."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.schema import number_arrays
from rosbridge_sim.schema.number_arrays import are_integral, to_dtype, to_floats

NUM = 2 * number_arrays._SLICE + 1


@pytest.mark.parametrize("kind", ["int64", "uint64", "float64", "int32", "float32", "uint8", "int8"])
@pytest.mark.parametrize("target", ["int64", "uint64", "float64", "int32", "float32", "uint8", "int8"])
@pytest.mark.parametrize("is_own", [True, False])
def test_numbers_stay_the_same(kind: str, target: str, *, is_own: bool) -> None:
    numbers = np.arange(NUM) % 100
    value = numbers.astype(kind)
    if not is_own:
        value = np.frombuffer(value.tobytes(), kind)
    result = to_dtype(value, target)
    assert result.dtype == np.dtype(target)
    np.testing.assert_array_equal(result, numbers)
    if not is_own:
        np.testing.assert_array_equal(value, numbers)
        assert not np.shares_memory(result, value), "a message would keep the whole frame"


@pytest.mark.parametrize("kind", ["int64", "float64"])
def test_array_of_the_same_size_needs_no_further_memory(kind: str) -> None:
    value = np.ones(NUM, kind)
    assert np.shares_memory(to_floats(value, "float64"), value)


def test_part_of_another_array_is_not_changed() -> None:
    whole = np.ones(NUM, np.int64)
    to_dtype(whole[5:], "float64")
    assert whole.min() == whole.max() == 1


@pytest.mark.parametrize("at", [0, number_arrays._SLICE, NUM - 1])
def test_number_beyond_float32_is_found_anywhere(at: int) -> None:
    value = np.full(NUM, np.inf)
    value[at] = 1e39
    assert to_floats(value, "float32") is None
    value[at] = np.nan
    result = to_floats(value, "float32")
    assert result is not None
    np.testing.assert_array_equal(result, value)


@pytest.mark.parametrize("at", [0, number_arrays._SLICE, NUM - 1])
@pytest.mark.parametrize("bad", [0.5, np.nan, np.inf])
def test_number_that_is_not_whole_is_found_anywhere(at: int, bad: float) -> None:
    value = np.full(NUM, 3.0)
    assert are_integral(value)
    value[at] = bad
    assert not are_integral(value)

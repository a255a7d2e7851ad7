"""Typed arrays of numbers, converted to the type of a field.

A long array is converted slice by slice, and in its own memory where that fits: the system takes a millisecond or more
to provide a megabyte, so each whole copy of 4.4 million numbers delays all other clients by 35 ms and more.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rosbridge_sim.schema.float32 import NumberArray

_SLICE = 16 * 1024
"""Numbers of one slice: 128 KiB, which stay in the processor's cache."""


def _slices(size: int) -> Iterator[slice]:
    for start in range(0, size, _SLICE):
        yield slice(start, start + _SLICE)


def are_integral(value: NumberArray) -> bool:
    """Return True if all numbers of a float array are finite and whole.

    Args:
        value: the array.
    """
    for part in _slices(len(value)):
        numbers = value[part]
        if not (np.isfinite(numbers).all() and (np.floor(numbers) == numbers).all()):
            return False
    return True


def to_dtype(value: NumberArray, kind: str) -> NumberArray:
    """Return the numbers as another dtype.

    Args:
        value: the array. It is used up if it owns its memory: the result may have the same memory.
        kind: name of the dtype, which can hold all the numbers.
    """
    target = np.dtype(kind)
    result = _memory_for(value, target)
    if value.dtype != target:
        for part in _slices(len(value)):
            result[part] = value[part].astype(target)
    elif result is not value:
        result[:] = value
    return result


def to_floats(value: NumberArray, kind: str) -> NumberArray | None:
    """Return the numbers as floats; None if one is finite, but too large.

    Args:
        value: the array. It is used up if it owns its memory, as in `to_dtype`.
        kind: `float32` or `float64`.
    """
    target = np.dtype(kind)
    if value.dtype.kind == "f" and value.dtype.itemsize > target.itemsize:
        with np.errstate(over="ignore"):
            for part in _slices(len(value)):
                if not np.array_equal(np.isinf(value[part].astype(target)), np.isinf(value[part])):
                    return None
    with np.errstate(over="ignore"):
        return to_dtype(value, kind)


def _memory_for(value: NumberArray, target: np.dtype[np.generic]) -> NumberArray:
    """Return an array for as many numbers; it has the memory of `value` if that is its own and of the same size.

    An array that views the bytes of a frame is copied, because it would keep the whole frame.
    """
    flags = value.flags
    if flags.owndata and flags.writeable and flags.c_contiguous and value.dtype.itemsize == target.itemsize:
        return value if value.dtype == target else value.view(target)
    return np.empty(len(value), target)

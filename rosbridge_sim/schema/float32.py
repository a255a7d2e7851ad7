"""Rounding to float32, of single numbers and of lists."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import orjson

from rosbridge_sim.schema.definitions.parse import MAX_FLOAT32

NumberArray: TypeAlias = npt.NDArray[Any]
"""A typed array of CBOR: any numeric dtype of native byte order."""

LONG_ARRAY = 4_096
"""From this length on, a typed array stays one: as a list it would take four to eight times its memory."""

_MIN32 = 1.2e-38
"""A little above the smallest number that float32 holds with full precision."""


def round32(value: float) -> float:
    """Return the shortest decimal that stands for the same float32, so that 0.1 is 0.1 again after four bytes.

    Raises:
        OverflowError: the number is finite but beyond the range of float32.
    """
    size = abs(value)
    if _MIN32 < size < MAX_FLOAT32:
        # Up to six digits come back from float32 as they went in.
        if float(f"{value:.6g}") == value:
            return value
        return float(orjson.dumps(np.float32(value), option=orjson.OPT_SERIALIZE_NUMPY))
    if size == 0 or not math.isfinite(value):
        return value
    if size >= MAX_FLOAT32:
        raise OverflowError("float32")
    return float(orjson.dumps(np.float32(value), option=orjson.OPT_SERIALIZE_NUMPY))


def round32_list(values: list[float]) -> list[float] | NumberArray:
    """Return `round32` of every element; the elements are finite. A long list becomes an array of float32.

    Raises:
        OverflowError: an element is beyond the range of float32.
    """
    if len(values) <= 2:  # noqa: PLR2004 - numpy's call overhead is the cost of about three
        return [round32(value) for value in values]
    wide = np.array(values, np.float64)
    if wide.max() >= MAX_FLOAT32 or wide.min() <= -MAX_FLOAT32:
        raise OverflowError("float32")
    if len(values) >= LONG_ARRAY:
        return wide.astype(np.float32)
    rounded: list[float] = orjson.loads(orjson.dumps(wide.astype(np.float32), option=orjson.OPT_SERIALIZE_NUMPY))
    return rounded

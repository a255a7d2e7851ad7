"""An estimate of the memory that a decoded message takes, made in a microsecond or two.

Of a list a few elements are looked at, because they are of one type. The estimate is at least twice the length of the
text that the value came from, which bounds the error of unequal elements.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec
import numpy as np

from rosbridge_sim.loose_types import JsonValue, Struct
from rosbridge_sim.schema.late_list import LateList

_STRUCT, _FIELD, _LIST, _ITEM, _TEXT, _BYTES, _NUMBER, _DICT, _ENTRY = 16, 8, 56, 8, 49, 33, 28, 64, 100
"""Memory of CPython's own objects, without their content [bytes]; an entry of a dict has a key of its own."""

_SAMPLES: Final = 8
"""Elements of a list that are looked at, evenly spread: unequal elements are rare."""

_MAX_DEPTH: Final = 20
"""Below this depth, a value of an unknown type counts by its text alone."""


def size_of(value: Struct | JsonValue, text_length: int = 0) -> int:
    """Estimate the memory of a message's value [bytes].

    Args:
        value: a struct of a message type, or the objects of an unknown one.
        text_length: length of the body that it was decoded from; 0 if there was none [bytes].
    """
    return max(_size(value, 0), 2 * text_length)


def _size(value: Struct | JsonValue, depth: int) -> int:  # noqa: PLR0911 - one line a kind
    if isinstance(value, msgspec.Struct):
        fields = value.__struct_fields__
        return _STRUCT + _FIELD * len(fields) + sum(_size(getattr(value, name), depth + 1) for name in fields)
    if isinstance(value, (int, float, type(None))):
        is_shared = value is None or isinstance(value, bool) or (isinstance(value, int) and -5 <= value <= 256)  # noqa: PLR2004 - CPython has one object for each of these
        return 0 if is_shared else _NUMBER
    if isinstance(value, str):
        return _TEXT + len(value) * (1 if value.isascii() else 4)
    if isinstance(value, (bytes, bytearray, memoryview)):
        return _BYTES + len(value)
    if isinstance(value, np.ndarray):
        return _LIST + int(value.nbytes)
    if depth > _MAX_DEPTH:
        return 0
    if isinstance(value, (list, tuple, LateList)):
        return _LIST + _ITEM * len(value) + _sampled(value, depth)
    if isinstance(value, dict):
        return _DICT + _ENTRY * len(value) + _sampled(list(value.values()), depth)
    return _NUMBER


def _sampled(values: Any, depth: int) -> int:  # noqa: ANN401 - a list or a tuple
    if not values:
        return 0
    step = max(1, len(values) // _SAMPLES)
    sizes = [_size(value, depth + 1) for value in values[::step]]
    return sum(sizes) * len(values) // len(sizes)

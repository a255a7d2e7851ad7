"""The words `NaN`, `Infinity` and `-Infinity`, which JSON does not have, and which Python writes and reads.

rosbridge_suite is a Python program: it refuses a message with `null` in a float field, and reads these words.
"""

from __future__ import annotations

import math
from itertools import chain, zip_longest
from typing import Any

import msgspec
import numpy as np
import orjson

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec

_NAN, _INFINITY, _MINUS_INFINITY = b"NaN", b"Infinity", b"-Infinity"


def with_words(spec: MessageSpec, value: Struct) -> Struct:
    """Return a value that the JSON encoder writes with words; the value itself if all its numbers are finite."""
    changes: dict[str, Any] = {}
    for each in spec.fields.values():
        if each.has_floats:
            old: Any = getattr(value, each.attribute)
            new = _field_with_words(each, old)
            if new is not old:
                changes[each.attribute] = new
    return msgspec.structs.replace(value, **changes) if changes else value


def _field_with_words(field: FieldSpec, old: Any) -> Any:  # noqa: ANN401 - any field's value
    nested, is_array = field.nested, field.definition.array is not None
    if nested is None:
        return _list_with_words(old) if is_array else _number_with_word(old)
    if not is_array:
        return with_words(nested, old)
    new = [with_words(nested, item) for item in old]
    return new if any(one is not other for one, other in zip(new, old, strict=True)) else old


def _number_with_word(number: float) -> float | msgspec.Raw:
    return number if abs(number) < math.inf else msgspec.Raw(_word(number))


def _list_with_words(numbers: Any) -> Any:  # noqa: ANN401 - a list or an array of numbers
    if not isinstance(numbers, np.ndarray):
        is_finite = all(abs(number) < math.inf for number in numbers)
        return numbers if is_finite else [_number_with_word(number) for number in numbers]
    finite = np.isfinite(numbers)
    if finite.all():
        return numbers
    # each null in the text of an array of numbers is one of these
    between = orjson.dumps(np.ascontiguousarray(numbers), option=orjson.OPT_SERIALIZE_NUMPY).split(b"null")
    words = map(_word, numbers[~finite].tolist())
    return msgspec.Raw(b"".join(chain.from_iterable(zip_longest(between, words, fillvalue=b""))))


def _word(number: float) -> bytes:
    if math.isnan(number):
        return _NAN
    return _INFINITY if number > 0 else _MINUS_INFINITY

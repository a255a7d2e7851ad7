"""JSON text for a rosbridge, with the words `NaN`, `Infinity` and `-Infinity`, which Python programs write and read."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import orjson


def to_json(value: object) -> bytes:
    """Return the JSON text of a value, with the words for NaN and infinity.

    Raises:
        TypeError: a value cannot be written as JSON.
    """
    text = orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)
    if b"null" in text:  # orjson writes it for such numbers; then infinity would become NaN at the server
        text = orjson.dumps(_with_words(value), option=orjson.OPT_SERIALIZE_NUMPY)
    return text


def _with_words(value: Any) -> Any:  # noqa: ANN401 - anything that a program sends
    """Return a value in which all numbers that are not finite are JSON texts."""
    import numpy as np  # noqa: PLC0415 - takes 50 ms, and most programs send no such number

    if isinstance(value, Mapping):
        return {name: _with_words(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_with_words(each) for each in value]
    if isinstance(value, (float, np.floating)):
        return value if np.isfinite(value) else orjson.Fragment(json.dumps(float(value)))
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
        return [_with_words(each) for each in value]
    return value

"""JSON bodies that the fast decoder has refused, read by Python's own decoder."""

from __future__ import annotations

import json
import math
import re

import msgspec
import orjson

from rosbridge_sim.errors import FieldError
from rosbridge_sim.weight import LIGHT, weigh

_WEIGHED = 4 * 1024
"""From this size on, a text is weighed before Python's own decoder reads it [bytes]; a smaller one is always light."""

_LONG = 2**20
"""From this size on, the weight of a text tells whether a number may be out of range [bytes]."""

_MAX_ESCAPES = 100_000
"""Backslashes in a text. Python's own decoder takes 0.1 us for each."""

_HUGE_NUMBER = re.compile(r"[eE]\+?[0-9]{3}|[0-9]{300}")
"""Part of any number that is beyond the range of float64."""


def parse_json(name: str, body: bytes | msgspec.Raw, refusal: Exception) -> object:
    """Return the Python objects of a JSON text; the words NaN and Infinity are accepted.

    Args:
        name: name of the type, for error texts.
        refusal: the error of the fast decoder, for the error text of a heavy body, which is not read again.

    Raises:
        FieldError: it is no JSON, or a heavy body.
    """
    weight = None
    if len(body) >= _WEIGHED:
        weight = weigh(memoryview(body))
        too_much = LIGHT.excess(weight)
        if too_much is not None:
            raise FieldError(
                f"{name}: {refusal}. A message of this size must fit its type as it is: its own field names, numbers of"
                f" the right kind, no NaN; of others {too_much}"
            )
        if bytes(body).count(b"\\") > _MAX_ESCAPES:
            raise FieldError(
                f"{name}: {refusal}. A message with more than {_MAX_ESCAPES:,} escapes must fit its type as it is"
            )
    try:
        # `json` would accept UTF-16 and UTF-32 as well. JSON on the wire is UTF-8 alone.
        text = bytes(body).decode()
        # A function for each number costs more than the rest, so it is used only where one may be out of range.
        if weight is not None and len(body) >= _LONG:  # the pattern takes 20 ns for each character
            has_huge = weight.extremes > 0
        else:
            has_huge = _HUGE_NUMBER.search(text) is not None
        parse_float = _parse_float if has_huge else None
        return json.loads(text, parse_float=parse_float)
    except (ValueError, OverflowError) as error:
        raise FieldError(f"{name}: the body is no JSON: {error}") from None
    except RecursionError:
        raise FieldError(f"{name}: the body is nested too deeply") from None


def parse_by_position(name: str, body: bytes | msgspec.Raw) -> list[object]:
    """Return the values of a body that is a JSON list; they are checked one by one, so there may not be many.

    Args:
        name: name of the type, for error texts.

    Raises:
        FieldError: it is no JSON, or heavy.
    """
    too_much = LIGHT.excess(weigh(memoryview(body))) if len(body) >= _WEIGHED else None
    if too_much is not None:
        raise FieldError(f"{name}: name the fields of a message of this size; by position {too_much}")
    try:
        values: list[object] = orjson.loads(bytes(body))
    except orjson.JSONDecodeError as error:
        raise FieldError(f"{name}: {error}") from None
    return values


def _parse_float(text: str) -> float:
    """Return the number that a text stands for; raise OverflowError if float64 has none so large."""
    value = float(text)
    if math.isinf(value):
        # Only the word Infinity means infinity; 1e400 is an error.
        raise OverflowError(f"the number {text[:40]} is out of range")
    return value

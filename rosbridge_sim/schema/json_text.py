"""JSON bodies that the fast decoder has refused, read by Python's own decoder."""

from __future__ import annotations

import json
import math
import re

import msgspec

from rosbridge_sim.errors import FieldError
from rosbridge_sim.weight import LIGHT, weigh

__all__ = ["parse_json"]

_WEIGHED = 4 * 1024
"""A text from here on is weighed before it is read by Python's own decoder [bytes]; less is light in any case."""

_HUGE_NUMBER = re.compile(r"[eE]\+?[0-9]{3}|[0-9]{300}")
"""What a number must hold to be beyond what float64 has."""


def parse_json(name: str, body: bytes | msgspec.Raw, refusal: Exception) -> object:
    """The Python objects of a JSON text, the words NaN and Infinity included.

    Args:
        name: of the type.
        body: the text.
        refusal: what was wrong with it, for an error: a heavy text is not looked at any closer.

    Raises:
        FieldError: it is no JSON, or heavy.
    """
    if len(body) >= _WEIGHED:
        too_much = LIGHT.excess(weigh(memoryview(body)))
        if too_much is not None:
            raise FieldError(
                f"{name}: {refusal}. A message of this size must fit its type as it is: its own field names, numbers of"
                f" the right kind, no NaN; of others {too_much}"
            )
    try:
        # `json` would guess UTF-16 and 32 from bytes: decoded by us, it is UTF-8 or nothing.
        text = bytes(body).decode()
        # A function for each number costs more than all the rest: only where one may be out of range.
        parse_float = _parse_float if _HUGE_NUMBER.search(text) is not None else None
        return json.loads(text, parse_float=parse_float)
    except (ValueError, OverflowError) as error:
        raise FieldError(f"{name}: the body is no JSON: {error}") from None
    except RecursionError:
        raise FieldError(f"{name}: the body is nested too deeply") from None


def _parse_float(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        # Only the word Infinity means infinity; 1e400 is a mistake.
        raise OverflowError(f"the number {text[:40]} is out of range")
    return value

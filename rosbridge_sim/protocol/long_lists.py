"""Long lists of numbers in a JSON text, decoded in parts.

One call of a decoder takes 30 ns for each number, and nothing else runs until it returns: 4.4 million numbers in 9 MB
take 130 ms. So the long lists are taken out of such a text, and become numpy arrays part by part, as typed arrays of
CBOR do. A short text in the place of each list says where its array belongs.
"""

from __future__ import annotations

import json
from collections.abc import Generator
from contextlib import suppress
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.weight import real_quotes, weigh_exactly

LONG_LIST = 32 * 1024
"""Length of a text of numbers from which it is decoded by itself [bytes]."""

_PART = 32 * 1024
"""Length of one part [bytes]: up to 16,000 numbers, 1 ms."""

_SLICE = 256 * 1024
"""Bytes that are searched in one step: 1 ms."""

_MARK = "\0numbers:"
"""Start of the text in the place of a list. A client that sends such a text itself only puts its own list elsewhere."""

_OPEN, _CLOSE = b"[]"
_ENDS_RUN = np.ones(256, np.bool_)
_ENDS_RUN[list(b"0123456789+-.eE, \t\r\n")] = False

_ENDS_WORDS = _ENDS_RUN.copy()
_ENDS_WORDS[list(b"NaInfinity")] = False
_WORDS = (b"N", b"I")

_Numbers = npt.NDArray[Any]

_decode_ints = msgspec.json.Decoder(list[int]).decode
_decode_floats = msgspec.json.Decoder(list[float]).decode


def has_more_values(text: bytes, most: int) -> Generator[None, None, bool]:
    """Return True if a JSON text has more than `most` values; yield after each slice of a millisecond.

    Args:
        text: JSON text in UTF-8.
    """
    for weight in weigh_exactly(text):
        if weight.commas > most:
            return True
        yield
    return False


def take_out_lists(text: bytes, *, has_words: bool = False) -> Generator[None, None, tuple[bytes, dict[str, _Numbers]]]:
    """Take the long lists of numbers out of a JSON text; yield after each step of about a millisecond.

    An array is float64 if any of its numbers has a point or an exponent, otherwise int64 or uint64, if that holds all.

    Args:
        text: JSON text in UTF-8; it may be invalid.
        has_words: numbers may be the words NaN, Infinity and -Infinity, which Python writes.

    Returns:
        The text with marks in the place of the lists, and the arrays by their marks.

    Raises:
        ValueError: a long list is no valid JSON.
    """
    spans = yield from _find(text, _ENDS_WORDS if has_words else _ENDS_RUN)
    parts: list[bytes] = []
    lists: dict[str, _Numbers] = {}
    position = 0
    for start, stop in spans:
        mark = f"{_MARK}{len(lists)}"
        lists[mark] = yield from _decode(text, start + 1, stop)
        parts += (text[position:start], msgspec.json.encode(mark))
        position = stop + 1
    return b"".join([*parts, text[position:]]), lists


def _find(text: bytes, ends_run: npt.NDArray[np.bool_]) -> Generator[None, None, list[tuple[int, int]]]:
    """Return the places of the brackets around each long list of numbers outside of texts.

    Args:
        text: JSON text in UTF-8; it may be invalid.
        ends_run: False for the bytes that such a list is made of.
    """
    data = np.frombuffer(text, np.uint8)
    spans: list[tuple[int, int]] = []
    last = num_quotes = 0
    is_escaped = False
    for start in range(0, len(data), _SLICE):
        part = data[start : start + _SLICE]
        marks, is_escaped = real_quotes(part, is_escaped=is_escaped)
        quotes = np.flatnonzero(marks) + start
        ends = np.flatnonzero(ends_run[part]) + start
        before = np.concatenate(([last], ends[:-1])) if len(ends) else ends
        for i in np.flatnonzero(ends - before > LONG_LIST).tolist():
            first, end = int(before[i]), int(ends[i])
            is_outside = (num_quotes + int(np.searchsorted(quotes, end))) % 2 == 0
            if is_outside and data[first] == _OPEN and data[end] == _CLOSE:
                spans.append((first, end))
        last = int(ends[-1]) if len(ends) else last
        num_quotes += len(quotes)
        yield
    return spans


def _decode(text: bytes, start: int, stop: int) -> Generator[None, None, _Numbers]:
    """Decode the numbers between two brackets."""
    arrays: list[_Numbers] = []
    dtypes: set[np.dtype[Any]] = set()
    is_negative: bool | np.bool_ = False
    while start <= stop:
        end = stop if stop - start <= _PART else text.find(b",", start + _PART, stop)
        end = stop if end < 0 else end
        part = text[start:end]
        array = _to_array(b"[" + part + b"]")
        if not len(array):
            raise ValueError("a list has a comma too many")
        dtypes.add(array.dtype)
        is_negative = is_negative or array.min() < 0
        arrays.append(_shrink(array))
        start = end + 1
        yield
    is_unsigned = {dtype.kind for dtype in dtypes} == {"i", "u"} and not is_negative
    kind = np.dtype(np.uint64) if is_unsigned else np.result_type(*dtypes)
    end = sum(map(len, arrays))
    whole = np.empty(end, kind)
    while arrays:  # one by one, because the system takes a millisecond to provide a megabyte
        array = arrays.pop()
        end -= len(array)
        whole[end : end + len(array)] = array
        yield
    return whole


def _to_array(part: bytes) -> _Numbers:
    """Return the numbers of a list.

    Raises:
        ValueError: it is no valid JSON, or holds a word that is no number.
    """
    if any(sign in part for sign in _WORDS):
        return np.array(json.loads(part), np.float64)
    if any(sign in part for sign in (b".", b"e", b"E")):
        return np.array(_decode_floats(part), np.float64)
    numbers = _decode_ints(part)
    for kind in (np.int64, np.uint64):
        with suppress(OverflowError):
            return np.array(numbers, kind)
    return np.array(numbers, np.float64)


def _shrink(array: _Numbers) -> _Numbers:
    """Return small integers as int16, so that the parts of a long list take less memory beside the whole."""
    if array.dtype == np.int64 and array.min() >= -_INT16 and array.max() < _INT16:
        return array.astype(np.int16)
    return array


_INT16 = 2**15


def put_in_lists(value: JsonValue, lists: dict[str, _Numbers]) -> JsonValue:
    """Put arrays in the place of their marks; each one once.

    Args:
        value: the decoded JSON value; its dicts and lists are changed.
        lists: the arrays by their marks; those that were put in are removed.

    Returns:
        The value.
    """
    if isinstance(value, str):
        return lists.pop(value, value) if value.startswith(_MARK) else value
    if isinstance(value, dict):
        value.update({name: put_in_lists(inner, lists) for name, inner in value.items()})
    elif isinstance(value, list):
        value[:] = [put_in_lists(inner, lists) for inner in value]
    return value

"""Frames of checks: written to send, read when they come, compared with what must come.

A check writes frames as JSON objects. Other forms are:

    "text"                   a text frame with these characters
    {"$hex": "..."}          a binary frame with these bytes
    {"$json": {...}}         a binary frame with this object as JSON
    {"$cbor": {...}}         a binary frame with this object as CBOR; byte strings are {"$hex": ...}, and tagged ones
                             {"$tag": number, "$hex": ...}
    {"$png": {...}}          in a frame that is sent: the object as JSON, in a picture, as base64
    {"$repeat": ["x", 3]}    the text so many times; with a third part, behind that
    "~..."                   in a frame that must come: a regular expression for the whole text
    {"$any": "list"}         in a frame that must come: any value of this kind: list, object, text, number or bool
    {"$has": {...}}          in a frame that must come: an object with at least these fields
    {"$either": [frame, [name, frame]]}    the frame that must come; others that servers send, with the names of these
    {"$ros": [1, 2]}         in a frame that must come: what comes from ROS 1, and from ROS 2
    {"$now": 0}              in a frame that must come: a part of the current time, here that of a bus without a world
"""

from __future__ import annotations

import base64
import io
import json
import math
import re
from types import NoneType
from typing import Any, Final

import cbor2
from PIL import Image

from rosbridge_sim.loose_types import JsonValue

_KINDS: Final[dict[str, tuple[type, ...]]] = {
    "list": (list,),
    "object": (dict,),
    "text": (str,),
    "number": (int, float),
    "bool": (bool,),
}


def read_frame(frame: str | bytes) -> JsonValue:
    """Return the value of a text frame, or the value of a binary one under `$cbor`.

    Raises:
        ValueError: it is neither JSON nor CBOR.
    """
    if isinstance(frame, str):
        return json.loads(frame)
    try:
        return {"$cbor": _plain(cbor2.loads(frame))}
    except (cbor2.CBORDecodeError, TypeError, OverflowError) as error:  # the last two are of odd tags
        raise ValueError(str(error)) from None


def _plain(value: Any) -> Any:  # noqa: ANN401 - any CBOR value to any JSON value
    if isinstance(value, cbor2.CBORTag):
        inner = _plain(value.value)
        return {"$tag": value.tag, **(inner if isinstance(inner, dict) else {"value": inner})}
    if isinstance(value, bytes):
        return {"$hex": value.hex()}
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if not isinstance(value, (str, int, float, bool, NoneType)):  # a tag that the library reads, such as a date
        return str(value)
    return "NaN" if value != value else value  # noqa: PLR0124 - only NaN differs from itself


def write_frame(value: JsonValue) -> str | bytes:
    """Return the frame that a check sends."""
    if isinstance(value, dict) and len(value) == 1:
        ((form, inner),) = value.items()
        if form == "$hex":
            return bytes.fromhex(inner)
        if form == "$json":
            return json.dumps(inner).encode()
        if form == "$cbor":
            return cbor2.dumps(_written(inner))
    value = _written(value)
    return value if isinstance(value, str) else json.dumps(value)


def _written(value: JsonValue) -> Any:  # noqa: ANN401 - any value of JSON or CBOR
    """Return a value with its parts in the forms above written out."""
    if isinstance(value, list):
        return [_written(inner) for inner in value]
    if not isinstance(value, dict):
        return value
    forms = tuple(key for key in value if key.startswith("$"))
    if forms == ("$repeat",):
        text, number, *head = value["$repeat"]
        written: Any = "".join(head) + text * number
    elif forms == ("$png",):
        written = _picture(json.dumps(value["$png"]).encode())
    elif forms == ("$hex",):
        written = bytes.fromhex(value["$hex"])
    elif forms == ("$tag", "$hex"):
        written = cbor2.CBORTag(value["$tag"], bytes.fromhex(value["$hex"]))
    else:
        written = {key: _written(inner) for key, inner in value.items()}
    return written


def _picture(text: bytes) -> str:
    """Return a text as pixels of a PNG file, in base64: as rosbridge writes it, with line ends behind the text."""
    width = max(1, math.isqrt(len(text) // 3))
    height = -(-len(text) // (3 * width))
    file = io.BytesIO()
    Image.frombytes("RGB", (width, height), text.ljust(3 * width * height, b"\n")).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode()


def agrees(expected: JsonValue, got: JsonValue) -> bool:
    """Return whether a frame that came, or a part of it, is what a check wants."""
    if isinstance(expected, str) and expected.startswith("~"):
        return isinstance(got, str) and re.fullmatch(expected[1:], got, re.DOTALL) is not None
    if isinstance(expected, dict):
        return _agrees_object(expected, got)
    if isinstance(expected, list):
        return isinstance(got, list) and len(expected) == len(got) and all(map(agrees, expected, got))
    return type(expected) is type(got) and bool(expected == got)


def _agrees_object(expected: dict[str, JsonValue], got: JsonValue) -> bool:
    form = next(iter(expected), "") if len(expected) == 1 else ""
    inner: JsonValue = expected.get(form)
    if form == "$any":
        return isinstance(got, _KINDS[inner]) and (inner == "bool" or not isinstance(got, bool))
    if form == "$now":
        return agrees(inner, got)
    if form in {"$either", "$ros"}:
        return agrees(inner[0], got)
    if form == "$repeat":
        return bool(_written(expected) == got)
    if not isinstance(got, dict):
        return False
    wanted = inner if form == "$has" else expected
    has_keys = wanted.keys() <= got.keys() if form == "$has" else wanted.keys() == got.keys()
    return has_keys and all(agrees(value, got[key]) for key, value in wanted.items())

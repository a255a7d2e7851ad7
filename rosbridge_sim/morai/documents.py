"""JSON documents of the user's: bytes -> a checked model, or one readable line that says where and what.

Scenario and map files share this: how numbers may be written, how an error is told. The models are pydantic's; this
is the only file that knows how pydantic reports.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError, WithJsonSchema
from pydantic_core import ErrorDetails, PydanticCustomError

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue

__all__ = [
    "Coordinate",
    "Document",
    "KeptAsWritten",
    "LenientBool",
    "Mistake",
    "Number",
    "Ratio",
    "SortedKeys",
    "Whole",
    "find_mistakes",
    "keys_beside",
    "read_document",
    "sort_keys",
]

T = TypeVar("T")

MAX_VALUE_SHOWN = 40
"""Characters of an offending value that an error shows."""

MAX_DOCUMENT_MISTAKES = 100
"""Of a document that are told one by one."""

MAX_DOCUMENT_COORDINATE = 1e8
"""Beyond every plane coordinate on earth, false eastings included [m]."""

# 1234.5, -1,234.5, .5, 1e-05; a comma only where it parts thousands: "12,5" has two meanings and is refused.
_NUMBER = re.compile(r"[+-]?(\d{1,3}(,\d{3})+|\d+)?(\.\d*)?([eE][+-]?\d{1,3})?")
_JSON_PLACE = re.compile(r"(?P<what>.*) at line (?P<line>\d+) column (?P<column>\d+)")


class Document(BaseModel):
    """An object of a document. Keys that we do not read are passed over: MORAI writes many and adds more.

    Attributes:
        other_keys: what is read beside the fields.
        idle_keys: the fields that are read and kept and have no effect yet.
    """

    other_keys: ClassVar[frozenset[str]] = frozenset()
    idle_keys: ClassVar[frozenset[str]] = frozenset()

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, coerce_numbers_to_str=True)


def _number(value: object) -> object:
    """A number, as such or as text; MORAI writes many numbers twice, once as text with thousands commas."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value
    if isinstance(value, str):
        text = value.strip()
        if len(text) <= MAX_VALUE_SHOWN and any(map(str.isdigit, text)) and _NUMBER.fullmatch(text):
            text = text.replace(",", "")
            return int(text) if text.lstrip("+-").isdecimal() else float(text)
    raise PydanticCustomError("number", "expected a number")


def _flag(value: object) -> object:
    if isinstance(value, bool):
        return value
    if isinstance(value, int) and value in {0, 1}:
        return value == 1
    if isinstance(value, str) and value.strip().lower() in {"true", "false"}:
        return value.strip().lower() == "true"
    raise PydanticCustomError("flag", "expected true or false")


_NUMBER_SCHEMA = WithJsonSchema({"type": ["number", "string"]})

Number = Annotated[float, BeforeValidator(_number), Field(ge=-1e12, le=1e12), _NUMBER_SCHEMA]
"""Any finite number, also as text."""

Coordinate = Annotated[
    float, BeforeValidator(_number), Field(ge=-MAX_DOCUMENT_COORDINATE, le=MAX_DOCUMENT_COORDINATE), _NUMBER_SCHEMA
]
"""Metres."""

Ratio = Annotated[
    float,
    BeforeValidator(_number),
    Field(ge=0.0, le=1.0),
    WithJsonSchema({"type": ["number", "string"], "minimum": 0, "maximum": 1}),
]

Whole = Annotated[
    int, BeforeValidator(_number), Field(ge=-(2**31), le=2**31 - 1), WithJsonSchema({"type": ["integer", "string"]})
]
"""An int32, also as text or as 2.0."""

LenientBool = Annotated[bool, BeforeValidator(_flag), WithJsonSchema({"type": "boolean"})]


KeptAsWritten = Annotated[Any, WithJsonSchema({})]
"""Any JSON value, kept as it is written: what has no effect cannot be a mistake."""


def read_document(kind: TypeAdapter[T], text: bytes, source: str, max_bytes: int) -> T:
    """Read and check a document.

    Args:
        kind: what it must be.
        text: UTF-8, with or without a byte order mark.
        source: what errors call it: the file's name.
        max_bytes: the longest text that is looked at.

    Raises:
        DocumentError: one line. `demo.json:3:17: ...` where the text is no JSON (line and column, from 1);
            `demo.json: vehicleList[2].initPosition.pos.x: expected a number, got 'abc'` where a value does not fit.
            Of several mistakes the first is told.
    """
    try:
        return _validate(kind, text, source, max_bytes)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    raise DocumentError(_one_line(first, source))


@dataclass(frozen=True, slots=True)
class Mistake:
    """Something in a document that cannot be used.

    Attributes:
        place: keys and numbers that lead to it; none for the document as a whole.
        text: the line that says where it is and what it is.
    """

    place: tuple[int | str, ...]
    text: str


def find_mistakes(kind: TypeAdapter[T], text: bytes, source: str, max_bytes: int) -> list[Mistake]:
    """Every mistake of a document, in its order, each told as `read_document` tells the first; none in a good one."""
    try:
        _validate(kind, text, source, max_bytes)
    except DocumentError as error:
        return [Mistake((), str(error))]
    except ValidationError as error:
        errors = error.errors(include_url=False)
        found = [Mistake(one["loc"], _one_line(one, source)) for one in errors[:MAX_DOCUMENT_MISTAKES]]
        if len(errors) > MAX_DOCUMENT_MISTAKES:
            found.append(Mistake((), f"{source}: ... and {len(errors) - MAX_DOCUMENT_MISTAKES:,} more"))
        return list({mistake.text: mistake for mistake in found}.values())
    return []


def _validate(kind: TypeAdapter[T], text: bytes, source: str, max_bytes: int) -> T:
    if len(text) > max_bytes:
        raise DocumentError(f"{source}: expected at most {max_bytes:,} bytes, got {len(text):,}")
    if not text.strip():
        raise DocumentError(f"{source}: expected a JSON document, got nothing")
    return kind.validate_json(text.removeprefix(b"\xef\xbb\xbf"))


def _one_line(error: ErrorDetails, source: str) -> str:
    if error["type"] == "json_invalid":
        what = str(error.get("ctx", {}).get("error", "")) or error["msg"]
        place = _JSON_PLACE.fullmatch(what)
        if place:
            return f"{source}:{place['line']}:{place['column']}: not JSON: {place['what']}"
        return f"{source}: not JSON: {what}"
    path = _path(error["loc"])
    where = f"{source}: {path}" if path else source
    if error["type"] == "missing":
        return f"{where}: missing"
    return f"{where}: {_expected(error)}, got {_shown(error['input'])}"


def _path(loc: tuple[int | str, ...]) -> str:
    """`("vehicleList", 2, "pos")` -> `vehicleList[2].pos`."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc).removeprefix(".")


_EXPECTED = {
    "model_type": "an object",
    "model_attributes_type": "an object",
    "dict_type": "an object",
    "list_type": "a list",
    "tuple_type": "a list",
    "string_type": "a text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a whole number of 32 bits",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
}


def _expected(error: ErrorDetails) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in _EXPECTED:
        return f"expected {_EXPECTED[kind]}"
    if kind == "greater_than_equal":
        return f"expected at least {context['ge']:,.15g}"
    if kind == "less_than_equal":
        return f"expected at most {context['le']:,.15g}"
    if kind in {"too_long", "string_too_long"}:
        return f"expected at most {context['max_length']:,} {'characters' if kind == 'string_too_long' else 'entries'}"
    text = " ".join(error["msg"].split())
    return text[:1].lower() + text[1:]


def _shown(value: JsonValue) -> str:
    """A value on one line, and short."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return f"a list of {len(value):,}"
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value) if len(str(value)) <= MAX_VALUE_SHOWN else repr(str(value)[:MAX_VALUE_SHOWN]) + "..."
    return " ".join(text.split())


# Keys


class SortedKeys(NamedTuple):
    """Count how often each key stands in a document, by its path (`vehicleList[].initPosition.pos.x`), in order.

    Attributes:
        read: the keys that have an effect.
        idle: those that are read and kept, and have no effect yet.
        passed_over: the others. Of these and the idle ones only the outermost key is told.
    """

    read: Counter[str]
    idle: Counter[str]
    passed_over: Counter[str]


def sort_keys(kind: type[Document], value: object) -> SortedKeys:
    """Sort the keys of a JSON value by what becomes of them when it is read as a document of that kind.

    Args:
        kind: of the value, or of each entry if the value is a list.
        value: the document as it was parsed, good or bad.
    """
    keys = SortedKeys(Counter(), Counter(), Counter())
    for path, counter in _keys(kind, value, "", keys):
        counter[path] += 1
    return keys


def keys_beside(kind: type[Document], path: str) -> list[str]:
    """Return the keys that could be read where `sort_keys` found that path."""
    for part in path.split("."):
        # A list may stand within a list. The last key is none that is read, and may have points in it.
        field = kind.model_fields.get(part.rstrip("[]"))
        inner = None if field is None else _kind_within(field.annotation)
        if inner is None:
            break
        kind = inner
    return list(kind.model_fields)


def _keys(kind: type[Document], value: object, path: str, keys: SortedKeys) -> Iterator[tuple[str, Counter[str]]]:
    """Yield the path of each key and the counter that it belongs to."""
    if isinstance(value, list):
        for one in value:
            yield from _keys(kind, one, f"{path}[]", keys)
    elif isinstance(value, dict):
        for key, one in value.items():
            where = f"{path}.{key}".removeprefix(".")
            field = kind.model_fields.get(key)
            if key in kind.idle_keys:
                yield where, keys.idle
                continue
            yield where, keys.passed_over if field is None and key not in kind.other_keys else keys.read
            inner = None if field is None else _kind_within(field.annotation)
            if inner is not None:
                yield from _keys(inner, one, where, keys)


def _kind_within(annotation: object) -> type[Document] | None:
    """The document that a field holds: itself, or in a list, or where it is not None."""
    if isinstance(annotation, type) and issubclass(annotation, Document):
        return annotation
    return next((kind for kind in map(_kind_within, get_args(annotation)) if kind is not None), None)

"""JSON documents of the user: bytes -> a checked model, or one readable line with the place and the mistake.

Scenario and map files share this module: the spelling of numbers, and the form of errors. The models are pydantic's;
only this module knows pydantic's error reports.
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
from rosbridge_sim.not_json import explain_not_json

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
    "read_number",
    "sort_keys",
]

T = TypeVar("T")

MAX_VALUE_SHOWN = 40
"""Longest part of an offending value that an error shows [characters]."""

MAX_DOCUMENT_MISTAKES = 100
"""Largest number of mistakes that are reported for one document."""

MAX_DOCUMENT_COORDINATE = 1e8
"""Largest coordinate [m]; beyond every plane coordinate on earth, with false eastings."""

# 1234.5, -1,234.5, .5, 1e-05; a comma only between thousands: "12,5" has two meanings and is refused.
_NUMBER = re.compile(r"[+-]?(\d{1,3}(,\d{3})+|\d+)?(\.\d*)?([eE][+-]?\d{1,3})?")


class Document(BaseModel):
    """An object of a document. Unknown keys are ignored, because MORAI writes many and adds more.

    Attributes:
        other_keys: keys that are read in addition to the fields.
        idle_keys: fields that are read and kept but have no effect yet.
    """

    other_keys: ClassVar[frozenset[str]] = frozenset()
    idle_keys: ClassVar[frozenset[str]] = frozenset()

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, coerce_numbers_to_str=True)


def read_number(value: object) -> object:
    """Return a number that is given as such or as text; MORAI also writes numbers as text with thousands commas."""
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

Number = Annotated[float, BeforeValidator(read_number), Field(ge=-1e12, le=1e12), _NUMBER_SCHEMA]
"""Any finite number, also as text."""

Coordinate = Annotated[
    float, BeforeValidator(read_number), Field(ge=-MAX_DOCUMENT_COORDINATE, le=MAX_DOCUMENT_COORDINATE), _NUMBER_SCHEMA
]
"""Metres."""

Ratio = Annotated[
    float,
    BeforeValidator(read_number),
    Field(ge=0.0, le=1.0),
    WithJsonSchema({"type": ["number", "string"], "minimum": 0, "maximum": 1}),
]

Whole = Annotated[
    int, BeforeValidator(read_number), Field(ge=-(2**31), le=2**31 - 1), WithJsonSchema({"type": ["integer", "string"]})
]
"""An int32, also as text or as 2.0."""

LenientBool = Annotated[bool, BeforeValidator(_flag), WithJsonSchema({"type": "boolean"})]


KeptAsWritten = Annotated[Any, WithJsonSchema({})]
"""Any JSON value, kept as it is written; a key without effect cannot hold a mistake."""


def read_document(kind: TypeAdapter[T], text: bytes, source: str, max_bytes: int) -> T:
    """Read and check a document.

    Args:
        kind: the expected model.
        text: UTF-8, with or without a byte order mark.
        source: the file's name, for errors.
        max_bytes: largest length of `text`.

    Returns:
        The model.

    Raises:
        DocumentError: one line. `demo.json:3:17: ...` where the text is not JSON (line and column, from 1);
            `demo.json: vehicleList[2].initPosition.pos.x: expected a number, got 'abc'` where a value does not fit.
            Of several mistakes the first is reported.
    """
    try:
        return _validate(kind, text, source, max_bytes)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    raise DocumentError(_one_line(first, source))


@dataclass(frozen=True, slots=True)
class Mistake:
    """A mistake in a document.

    Attributes:
        place: keys and indices of the wrong value; empty for the document as a whole.
        text: one line with the place and the mistake.
    """

    place: tuple[int | str, ...]
    text: str


def find_mistakes(kind: TypeAdapter[T], text: bytes, source: str, max_bytes: int) -> list[Mistake]:
    """Return all mistakes of a document, each in the words of `read_document`.

    Args:
        kind: the expected model.
        text: UTF-8, with or without a byte order mark.
        source: the file's name, for errors.
        max_bytes: largest length of `text`.

    Returns:
        The mistakes in the document's order; empty if there are none.
    """
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
        return explain_not_json(error["input"], what, source)
    path = _path(error["loc"])
    where = f"{source}: {path}" if path else source
    if error["type"] == "missing":
        return f"{where}: missing"
    return f"{where}: {_expected(error)}, got {_shown(error['input'])}"


def _path(loc: tuple[int | str, ...]) -> str:
    """`("vehicleList", 2, "pos")` -> `vehicleList[2].pos`; an empty text is the tag of a union's member."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc if part != "").removeprefix(".")


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
    """Return a value as a short text on one line."""
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
    """Number of times that each key stands in a document, by its path (`vehicleList[].initPosition.pos.x`), in order.

    Attributes:
        read: the keys that have an effect.
        idle: the keys that are read and kept but have no effect yet.
        passed_over: the other keys. Of these and the idle ones only the outermost key is listed.
    """

    read: Counter[str]
    idle: Counter[str]
    passed_over: Counter[str]


def sort_keys(kind: type[Document], value: object) -> SortedKeys:
    """Sort the keys of a JSON value by their use when it is read as a document.

    Args:
        kind: model of the value, or of each entry if the value is a list.
        value: the document as it was parsed, correct or not.

    Returns:
        The numbers of keys.
    """
    keys = SortedKeys(Counter(), Counter(), Counter())
    for path, counter in _keys(kind, value, "", keys):
        counter[path] += 1
    return keys


def keys_beside(kind: type[Document], path: str) -> list[str]:
    """Return the keys that are valid at a path.

    Args:
        kind: model of the document.
        path: a path that `sort_keys` returned.

    Returns:
        The fields of the model at that place.
    """
    for part in path.split("."):
        # A list may be within a list. The last key is unknown and may contain points.
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
    """Return the model in a field's type: directly, in a list, or optional; None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, Document):
        return annotation
    return next((kind for kind in map(_kind_within, get_args(annotation)) if kind is not None), None)

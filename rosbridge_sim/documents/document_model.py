"""Models of documents of the user: their base classes, the spelling of numbers, and their keys.

Scenario, map, sensor, campaign and catalogue files share this module. A field has a type with marks (`Annotated` with
msgspec's `Meta`, which `about` makes): a description, bounds, and under `extra` the function that reads other
spellings. `document_reading` reads documents by these models, `document_mistakes` words their mistakes.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from typing import (
    Annotated,
    Any,
    ClassVar,
    Final,
    Generic,
    NamedTuple,
    Self,
    TypeAlias,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec
from msgspec import Meta

from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record

T = TypeVar("T")

MAX_KEY_SHOWN: Final = 100
"""Longest part of a key that an error or a list shows [characters]; that of no document of ours is as long."""

MAX_VALUE_SHOWN: Final = 40
"""Longest part of an offending value that an error shows [characters]."""

MAX_NUMBER_TEXT = 40
"""Longest text that is a number [characters]."""

MAX_DOCUMENT_COORDINATE = 1e8
"""Largest coordinate [m]; beyond every plane coordinate on earth, with false eastings."""

# 1234.5, -1,234.5, .5, 1e-05; a comma only between thousands: "12,5" has two meanings and is refused.
_NUMBER = re.compile(r"[+-]?(\d{1,3}(,\d{3})+|\d+)?(\.\d*)?([eE][+-]?\d{1,3})?")


def about(text: str, **marks: Any) -> Meta:  # noqa: ANN401 - those of `Meta`
    """Return the marks of a field: its description, then bounds, and functions under `extra`."""
    return Meta(description=text, **marks)


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """An object of a document. Unknown keys are ignored, because MORAI writes many and adds more.

    Subclasses are `frozen` and `kw_only`, too, which keeps their fields in order. A `__post_init__` that raises a
    ValueError tells which values do not fit together.

    Attributes:
        other_keys: keys that are read in addition to the fields.
    """

    other_keys: ClassVar[frozenset[str]] = frozenset()

    def changed(self, **fields: Any) -> Self:  # noqa: ANN401 - each field has its own type
        """Return a model with other values of some fields; they are not checked."""
        return msgspec.structs.replace(self, **fields)

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        """Return the JSON value that is read in place of a given one."""
        return value


class Table(Document, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An object of a file of our own form. Unknown keys are mistakes."""


class DocumentType(Generic[T]):
    """The form of a document.

    Attributes:
        form: a model, or a type such as `list[Model]`, with the marks of this module.
        knows_mistakes: what finds its mistakes was made; see `document_mistakes`.
    """

    def __init__(self, form: Any) -> None:  # noqa: ANN401 - a type form
        self.form = form
        self.knows_mistakes = False


Place: TypeAlias = tuple[int | str, ...]
"""Keys and indices of a value; empty for the document as a whole."""


def path_of(place: Place) -> str:
    """Return a place as a path: `vehicleList[2].pos`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{printable(part, MAX_KEY_SHOWN)}" for part in place)
    return "".join(parts).removeprefix(".")


Where: TypeAlias = Callable[[Place], str]
"""Returns the text for a place in an error."""


class Mistake(Record):
    """A mistake in a document.

    Attributes:
        place: of the wrong value.
        text: one line with the place and the mistake.
    """

    place: Place
    text: str


def show_json(value: JsonValue) -> str:
    """Return a value as a short text on one line."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return f"a list of {len(value):,}"
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    words = str(value)
    short = repr(value if isinstance(value, str | int | float) else words)
    return " ".join((short if len(words) <= MAX_VALUE_SHOWN else f"{words[:MAX_VALUE_SHOWN]!r}...").split())


# Marks


def read_number(value: object) -> object:
    """Return a number that is given as such or as text; MORAI also writes numbers as text with thousands commas.

    Raises:
        ValueError: it is none; the text follows the place in an error.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value
    if isinstance(value, str):
        text = value.strip()
        if len(text) <= MAX_NUMBER_TEXT and any(map(str.isdigit, text)) and _NUMBER.fullmatch(text):
            text = text.replace(",", "")
            return int(text) if text.lstrip("+-").isdecimal() else float(text)
    raise ValueError("expected a number")


def _read_flag(value: object) -> object:
    if isinstance(value, bool):
        return value
    if isinstance(value, int) and value in {0, 1}:
        return value == 1
    if isinstance(value, str) and value.strip().lower() in {"true", "false"}:
        return value.strip().lower() == "true"
    raise ValueError("expected true or false")


def read_text(value: object) -> object:
    """Return a text that may be given as a number: ids of maps are; 7.0 is `7`.

    Raises:
        ValueError: it is none.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f"{value:.0f}" if isinstance(value, float) and value.is_integer() else str(value)
    if isinstance(value, str):
        return value
    raise ValueError("expected a text")


SPELLED: Final = "spelled"
"""Key in the schema of a number that may also be written as a text."""


def number_within(low: float, high: float) -> Meta:
    """Return the mark of a number within bounds, also as text."""
    return Meta(ge=low, le=high, extra={"read": read_number}, extra_json_schema={SPELLED: True})


def text_within(
    longest: int | None = None, check: Callable[[str], None] | None = None, pattern: str | None = None
) -> Meta:
    """Return the mark of a text, which may be written as a number.

    Args:
        check: raises ValueError for a text that does not fit.
        pattern: regular expression of texts that fit, for the schema.
    """
    return Meta(max_length=longest, pattern=pattern, extra={"read": read_text, "check": check})


Number = Annotated[float, number_within(-1e12, 1e12)]
"""Any finite number, also as text."""

Coordinate = Annotated[float, number_within(-MAX_DOCUMENT_COORDINATE, MAX_DOCUMENT_COORDINATE)]
"""Metres."""

Ratio = Annotated[float, number_within(0.0, 1.0)]

Whole = Annotated[int, number_within(-(2**31), 2**31 - 1)]
"""An int32, also as text or as 2.0."""

Text = Annotated[str, text_within()]
"""Any text, also a number."""

LenientBool = Annotated[bool, Meta(extra={"read": _read_flag})]

KeptAsWritten = Any
"""Any JSON value, kept as it is written; a key without effect cannot hold a mistake."""

WithoutEffect = Annotated[Any, Meta(extra={"idle": True})]
"""The same of a key that nothing reads yet."""

SCALARS: Final = (float, int, bool, str)
"""Types of values without parts."""

_BOUNDS: Final = ("ge", "gt", "le", "min_length", "max_length", "description", "extra")


def split_marks(form: Any) -> tuple[Any, Meta]:  # noqa: ANN401 - type forms
    """Return a type without its marks, and one mark with all of them; of several bounds the innermost counts."""
    if get_origin(form) is not Annotated:
        return form, Meta()
    base, *marks = get_args(form)
    return base, Meta(
        **{
            name: next((value for mark in marks if (value := getattr(mark, name)) is not None), None)
            for name in _BOUNDS
        }
    )


@cache
def fields_of(kind: type[Document]) -> dict[str, Any]:
    """Return the types of the keys of a model."""
    hints = get_type_hints(kind, include_extras=True)
    return {key: hints[name] for key, name in zip(kind.__struct_encode_fields__, kind.__struct_fields__, strict=True)}


@cache
def idle_keys(kind: type[Document]) -> tuple[str, ...]:
    """Return the keys of a model that are `WithoutEffect`, in order."""
    return tuple([key for key, form in fields_of(kind).items() if "idle" in (split_marks(form)[1].extra or {})])


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
        path: a path that `sort_keys` returned.

    Returns:
        The fields of the model at that place.
    """
    for part in path.split("."):
        # A list may be within a list. The last key is unknown and may contain points.
        inner = kind_within(fields_of(kind).get(part.rstrip("[]")))
        if inner is None:
            break
        kind = inner
    return list(fields_of(kind))


def _keys(kind: type[Document], value: object, path: str, keys: SortedKeys) -> Iterator[tuple[str, Counter[str]]]:
    """Yield the path of each key and the counter that it belongs to."""
    if isinstance(value, list):
        for one in value:
            yield from _keys(kind, one, f"{path}[]", keys)
    elif isinstance(value, dict):
        for key, one in value.items():
            where = f"{path}.{printable(key, MAX_KEY_SHOWN)}".removeprefix(".")
            field = fields_of(kind).get(key)
            if key in idle_keys(kind):
                yield where, keys.idle
                continue
            yield where, keys.passed_over if field is None and key not in kind.other_keys else keys.read
            inner = kind_within(field)
            if inner is not None:
                yield from _keys(inner, one, where, keys)


def kind_within(form: object) -> type[Document] | None:
    """Return the model in a field's type: directly, in a list, or optional; None if there is none."""
    if isinstance(form, type) and issubclass(form, Document):
        return form
    return next((kind for kind in map(kind_within, get_args(form)) if kind is not None), None)

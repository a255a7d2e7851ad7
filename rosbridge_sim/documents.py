"""Models of JSON documents of the user: their base class, the spelling of numbers, and their keys.

Scenario, map and sensor files share this module. A model also gives the function that reads documents without a
mistake. `document_reading` reads any document.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cache, cached_property, partial
from math import inf
from types import UnionType
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
    Union,
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

Model: TypeAlias = Any
"""A class: a `Document`, or a model of pydantic with the same class values."""

MAX_NUMBER_TEXT = 40
"""Longest text that is a number [characters]."""

MAX_DOCUMENT_COORDINATE = 1e8
"""Largest coordinate [m]; beyond every plane coordinate on earth, with false eastings."""

# 1234.5, -1,234.5, .5, 1e-05; a comma only between thousands: "12,5" has two meanings and is refused.
_NUMBER = re.compile(r"[+-]?(\d{1,3}(,\d{3})+|\d+)?(\.\d*)?([eE][+-]?\d{1,3})?")


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """An object of a document. Unknown keys are ignored, because MORAI writes many and adds more.

    Subclasses are `frozen` and `kw_only`, too, which keeps their fields in order.

    Attributes:
        other_keys: keys that are read in addition to the fields.
        idle_keys: fields that are read and kept but have no effect yet.
    """

    other_keys: ClassVar[frozenset[str]] = frozenset()
    idle_keys: ClassVar[frozenset[str]] = frozenset()

    def changed(self, **fields: Any) -> Self:  # noqa: ANN401 - each field has its own type
        """Return a model with other values of some fields; they are not checked."""
        return msgspec.structs.replace(self, **fields)

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        """Return the JSON value that is read in place of a given one."""
        return value


class Spelling:
    """Mark of a field whose value may be written in more ways than JSON's own.

    Attributes:
        read: returns the value for what was written; raises ValueError, whose text follows the place in an error.
        check: raises ValueError for a value that does not fit, in the same way.
        schema: for the JSON Schema; None for that of the type.
    """

    __slots__ = ("check", "read", "schema")

    def __init__(
        self,
        read: Callable[[object], object] | None = None,
        *,
        check: Callable[[Any], None] | None = None,
        schema: Mapping[str, object] | None = None,
    ) -> None:
        self.read = read
        self.check = check
        self.schema = schema


def _read_number(value: object) -> object:
    """Return a number that is given as such or as text; MORAI also writes numbers as text with thousands commas."""
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


NUMBER: Final = Spelling(_read_number, schema={"type": ["number", "string"]})
WHOLE: Final = Spelling(_read_number, schema={"type": ["integer", "string"]})
FLAG: Final = Spelling(_read_flag, schema={"type": "boolean"})

Number = Annotated[float, NUMBER, Meta(ge=-1e12, le=1e12)]
"""Any finite number, also as text."""

Coordinate = Annotated[float, NUMBER, Meta(ge=-MAX_DOCUMENT_COORDINATE, le=MAX_DOCUMENT_COORDINATE)]
"""Metres."""

Ratio = Annotated[
    float,
    Spelling(_read_number, schema={"type": ["number", "string"], "minimum": 0, "maximum": 1}),
    Meta(ge=0.0, le=1.0),
]

Whole = Annotated[int, WHOLE, Meta(ge=-(2**31), le=2**31 - 1)]
"""An int32, also as text or as 2.0."""

LenientBool = Annotated[bool, FLAG]


KeptAsWritten = Annotated[Any, Spelling(schema={})]
"""Any JSON value, kept as it is written; a key without effect cannot hold a mistake."""


def number_spelling(low: float, high: float, kind: str = "number") -> Spelling:
    """Return the mark of a number, also as text, whose schema tells its bounds."""
    return Spelling(_read_number, schema={"type": [kind, "string"], "minimum": low, "maximum": high})


class DocumentType(Generic[T]):
    """The form of a document: what it holds, and how that is read.

    Attributes:
        form: a model, or a type such as `list[Model]`, with the marks of this module.
        knows_mistakes: what finds its mistakes was made; see `document_mistakes`.
    """

    def __init__(self, form: Any) -> None:  # noqa: ANN401 - a type form
        self.form = form
        self.knows_mistakes = False

    @cached_property
    def read(self) -> Callable[[Any], T]:
        """Function that returns the model of a JSON value; it raises ValueError for one that may have a mistake."""
        return _reader_of(self.form)


class Mistake(Record):
    """A mistake in a document.

    Attributes:
        place: keys and indices of the wrong value; empty for the document as a whole.
        text: one line with the place and the mistake.
    """

    place: tuple[int | str, ...]
    text: str


@cache
def fields_of(kind: Model) -> dict[str, Any]:
    """Return the types of the keys of a model."""
    if not issubclass(kind, Document):
        return {name: field.annotation for name, field in kind.model_fields.items()}
    hints = get_type_hints(kind, include_extras=True)
    return {name: hints[name] for name in kind.__struct_fields__}


# Readers

_Reader: TypeAlias = Callable[[Any], Any]
"""Returns the value for a JSON value; raises ValueError where there may be a mistake."""


_ALL: Final = (-inf, inf)


def _reader_of(form: Any) -> _Reader:  # noqa: ANN401, PLR0911 - a type form, and a line for each kind of it
    """Return the function that reads values of a type."""
    marks: list[Any] = []
    while get_origin(form) is Annotated:
        form, *more = get_args(form)
        marks = [*more, *marks]
    spelling = next((mark for mark in marks if isinstance(mark, Spelling)), Spelling())
    bounds = next(((mark.ge, mark.le) for mark in marks if isinstance(mark, Meta) and mark.ge is not None), _ALL)
    longest = next((mark.max_length for mark in marks if isinstance(mark, Meta) and mark.max_length is not None), inf)
    origin, args = get_origin(form), get_args(form)
    if form is Any:
        return _as_it_is
    if isinstance(form, type) and issubclass(form, Document):
        return _model_reader(form)
    if origin in {Union, UnionType}:
        return _choice_reader([_reader_of(arg) for arg in args])
    if form is str:
        return partial(_read_text, spelling.check, longest)
    if spelling.read is not None and form in {float, int, bool}:
        return partial(_read_spelled, form, spelling.read, bounds)
    if origin is list or (origin is tuple and args[1:] == (...,)):
        each = _reader_of(args[0]) if _has_own(args[0]) else None
        return partial(_read_each, each or partial(msgspec.convert, type=form), origin if each else None, longest)
    if origin is tuple and _has_own(form):
        return partial(_read_places, [_reader_of(arg) for arg in args])
    return partial(msgspec.convert, type=form)


def _has_own(form: Any) -> bool:  # noqa: ANN401 - a type form
    """Tell whether a type holds a model, a text, or a value with other spellings, which msgspec cannot read."""
    if form is str or (isinstance(form, type) and issubclass(form, Document)) or isinstance(form, Spelling):
        return True
    return any(map(_has_own, [*get_args(form), *getattr(form, "__metadata__", ())]))


def _as_it_is(value: object) -> object:
    return value


def _read_text(check: Callable[[str], None] | None, longest: float, value: object) -> str:
    if type(value) is int:
        value = str(value)
    if not isinstance(value, str) or len(value) > longest:
        raise ValueError("no such text")
    if check is not None:
        check(value)
    return value


def _read_spelled(kind: type[float], read: Callable[[object], Any], bounds: tuple[Any, Any], value: object) -> float:
    found = read(value)
    if not bounds[0] <= found <= bounds[1]:
        raise ValueError("out of range")
    number = kind(found)
    if number != found:
        raise ValueError("no whole number")
    return number


def _read_each(read: _Reader, kind: type[Any] | None, longest: float, value: object) -> object:
    """Read the entries of a list; or a list as a whole, if there is no kind."""
    if not isinstance(value, list) or len(value) > longest:
        raise ValueError("no such list")
    return read(value) if kind is None else kind(map(read, value))


def _read_places(readers: list[_Reader], value: object) -> object:
    if not isinstance(value, list) or len(value) != len(readers):
        raise ValueError("no such list")
    return tuple(read(one) for read, one in zip(readers, value, strict=True))


def _choice_reader(readers: list[_Reader]) -> _Reader:
    """Return the function that reads a value as one of several types."""

    def read(value: object) -> object:
        for each in readers:
            try:
                return each(value)
            except ValueError:
                pass
        raise ValueError("none of the types")

    return read


def _model_reader(kind: type[Document]) -> _Reader:
    """Return the function that reads objects of a model; that of a field is made when the field is first there."""
    forms = fields_of(kind)
    defaults = kind.__struct_defaults__
    names = kind.__struct_fields__
    without = (msgspec.NODEFAULT,) * (len(names) - len(defaults))
    needed = {name for name, default in zip(names, without + defaults, strict=True) if default is msgspec.NODEFAULT}
    readers: dict[str, _Reader] = {}
    prepare = kind.prepare if "prepare" in vars(kind) else _as_it_is

    def read(value: object) -> object:
        value = prepare(value)
        if not (isinstance(value, dict) and value.keys() >= needed):
            raise ValueError("no such object")
        found = {}
        for name in names:
            if name in value:
                if name not in readers:
                    readers[name] = _reader_of(forms[name])
                found[name] = readers[name](value[name])
        return kind(**found)

    return read


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


def sort_keys(kind: Model, value: object) -> SortedKeys:
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


def keys_beside(kind: Model, path: str) -> list[str]:
    """Return the keys that are valid at a path.

    Args:
        kind: model of the document.
        path: a path that `sort_keys` returned.

    Returns:
        The fields of the model at that place.
    """
    for part in path.split("."):
        # A list may be within a list. The last key is unknown and may contain points.
        inner = _kind_within(fields_of(kind).get(part.rstrip("[]")))
        if inner is None:
            break
        kind = inner
    return list(fields_of(kind))


def _keys(kind: Model, value: object, path: str, keys: SortedKeys) -> Iterator[tuple[str, Counter[str]]]:
    """Yield the path of each key and the counter that it belongs to."""
    if isinstance(value, list):
        for one in value:
            yield from _keys(kind, one, f"{path}[]", keys)
    elif isinstance(value, dict):
        for key, one in value.items():
            where = f"{path}.{printable(key, MAX_KEY_SHOWN)}".removeprefix(".")
            field = fields_of(kind).get(key)
            if key in kind.idle_keys:
                yield where, keys.idle
                continue
            yield where, keys.passed_over if field is None and key not in kind.other_keys else keys.read
            inner = _kind_within(field)
            if inner is not None:
                yield from _keys(inner, one, where, keys)


def _kind_within(annotation: object) -> Model | None:
    """Return the model in a field's type: directly, in a list, or optional; None if there is none."""
    if isinstance(annotation, type) and hasattr(annotation, "idle_keys"):
        return annotation
    return next((kind for kind in map(_kind_within, get_args(annotation)) if kind is not None), None)

"""Documents of the user: JSON or parsed TOML -> a checked model, or readable lines with the places and the mistakes.

One function per model is made from its fields, when it is first needed. It reads documents without a mistake. One that
it refuses goes to `document_mistakes`, which has the last word; it is imported only then, because its library takes a
tenth of the time and a seventh of the memory of a server's start.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import cache, partial
from types import NoneType, UnionType
from typing import Any, Final, Literal, TypeAlias, TypeVar, Union, get_args, get_origin

import msgspec

from rosbridge_sim.documents.document_model import (
    SCALARS,
    Document,
    DocumentType,
    Mistake,
    Place,
    Where,
    fields_of,
    path_of,
    read_number,
    split_marks,
)
from rosbridge_sim.documents.not_json import explain_not_json
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue

T = TypeVar("T")


class MistakeNotReadyError(DocumentError):
    """A document has a mistake, and what words it is not there yet."""


def read_document(kind: DocumentType[T], text: bytes, source: str, max_bytes: int) -> T:
    """Read and check a JSON document.

    Args:
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
    return read_values(kind, parse_json(text, source, max_bytes), source)


def read_values(kind: DocumentType[T], value: object, source: str, *, is_quick: bool = False) -> T:
    """Read and check a document that is parsed already, such as a TOML file.

    Args:
        is_quick: raise MistakeNotReadyError rather than take 95 ms; after `learn_mistakes` it is not raised.

    Raises:
        DocumentError: one line, the first mistake; see `read_document`.
    """
    checked = check_values(kind, value, partial(_place_in, source), is_quick=is_quick)
    if checked[0] is None:
        raise DocumentError(checked[1][0].text)
    return checked[0]


def check_values(
    kind: DocumentType[T], value: object, where: Where, *, is_quick: bool = False
) -> tuple[T | None, list[Mistake]]:
    """Return the model of a parsed document, or None and its mistakes: the first hundred, and the number of the others.

    Args:
        where: returns the text for a place.
        is_quick: see `read_values`.
    """
    with suppress(ValueError):
        return _document_reader(kind)(value), []
    if is_quick and not kind.knows_mistakes:
        raise MistakeNotReadyError(f"{where(())}: there is a mistake")
    from rosbridge_sim.documents.document_mistakes import judge_document  # noqa: PLC0415 - a large library, rarely needed

    return judge_document(kind, value, where)


def learn_mistakes(kind: DocumentType[Any]) -> None:
    """Make what words the mistakes of a document: 95 ms in a thread, once in a process."""
    from rosbridge_sim.documents.document_mistakes import adapter_of  # noqa: PLC0415 - as above

    adapter_of(kind)


def find_mistakes(kind: DocumentType[Any], text: bytes, source: str, max_bytes: int) -> list[Mistake]:
    """Return all mistakes of a JSON document, each in the words of `read_document`.

    Args:
        text: UTF-8, with or without a byte order mark.
        source: the file's name, for errors.
        max_bytes: largest length of `text`.

    Returns:
        The mistakes in the document's order, see `check_values`; empty if there are none.
    """
    try:
        value = parse_json(text, source, max_bytes)
    except DocumentError as error:
        return [Mistake((), str(error))]
    return check_values(kind, value, partial(_place_in, source))[1]


def _place_in(source: str, place: Place) -> str:
    """Return a file and a place in it: `demo.json: vehicleList[2].pos`."""
    return f"{source}: {path}" if (path := path_of(place)) else source


def parse_json(text: bytes, source: str, max_bytes: int) -> JsonValue:
    """Return the JSON value of a text.

    `NaN` and `Infinity` are accepted, as Python writes them, where no model looks at them.

    Args:
        text: UTF-8, with or without a byte order mark.
        source: the file's name, for errors.
        max_bytes: largest length of `text`.

    Raises:
        DocumentError: it is too long, or no JSON.
    """
    if len(text) > max_bytes:
        raise DocumentError(f"{source}: expected at most {max_bytes:,} bytes, got {len(text):,}")
    if not text.strip():
        raise DocumentError(f"{source}: expected a JSON document, got nothing")
    content = text.removeprefix(b"\xef\xbb\xbf")
    try:
        return msgspec.json.decode(content)
    except (ValueError, RecursionError):
        pass
    try:
        value = json.loads(content.decode())
        if b"\\u" in content:
            json.dumps(value, ensure_ascii=False).encode()  # an escape may be half a character, which is no text
    except (ValueError, RecursionError) as error:
        raise DocumentError(explain_not_json(content, error, source)) from None
    return value


# Readers

_Reader: TypeAlias = Callable[[Any], Any]
"""Returns the value for a JSON value; raises ValueError where there may be a mistake."""


@cache
def _document_reader(kind: DocumentType[Any]) -> _Reader:
    return _reader_of(kind.form)


def _reader_of(form: Any) -> _Reader:  # noqa: ANN401 - a type form
    """Return the function that reads values of a type."""
    form, mark = split_marks(form)
    extra: dict[str, Any] = mark.extra or {}
    if form in SCALARS or "read" in extra:
        read = extra.get("read") or partial(_read_exactly, form)
        if form is str:
            return partial(_read_text, read, _bound(mark.max_length, math.inf), extra.get("check"))
        return _number_reader(form, read, mark) if form in {float, int} else read
    if isinstance(form, type) and issubclass(form, Document):
        return _model_reader(form)
    return _as_it_is if form is Any else _reader_of_parts(get_origin(form), get_args(form), mark, form)


def _reader_of_parts(origin: Any, args: tuple[Any, ...], mark: msgspec.Meta, form: Any) -> _Reader:  # noqa: ANN401 - type forms
    """Return the function that reads values of a type with parts."""
    if origin is Literal:
        return partial(_read_word, list(args))
    if origin in {Union, UnionType}:
        return partial(_read_choice, [_reader_of(arg) for arg in args if arg is not NoneType], NoneType in args)
    bounds = _bound(mark.min_length, 0), _bound(mark.max_length, math.inf)
    if origin is dict:
        return partial(_read_entries, _reader_of(args[0]), _reader_of(args[1]), bounds)
    if origin is tuple and args[1:] != (...,):
        return partial(_read_places, [_reader_of(arg) for arg in args])
    quick = partial(msgspec.convert, type=form) if _is_numeric(args[0]) else None
    return partial(_read_each, _reader_of(args[0]), quick, origin, bounds)


def _bound(bound: float | None, default: float) -> float:
    return default if bound is None else bound


def _is_numeric(form: Any) -> bool:  # noqa: ANN401 - a type form
    """Tell whether a type holds numbers alone, which msgspec reads with the same bounds; a city has a million."""
    form, mark = split_marks(form)
    if (mark.extra or {}).get("read", read_number) is not read_number:
        return False
    return form in {float, int} or (get_origin(form) in {list, tuple} and all(map(_is_numeric, get_args(form))))


def _as_it_is(value: object) -> object:
    return value


def _read_exactly(kind: type[Any], value: object) -> object:
    if type(value) is kind or (kind is float and type(value) is int):
        return value
    raise ValueError("of another type")


_LARGEST: Final = math.nextafter(math.inf, 0.0)


def _number_reader(kind: type[float], read: _Reader, mark: msgspec.Meta) -> _Reader:
    low, high, above = _bound(mark.ge, -_LARGEST), _bound(mark.le, _LARGEST), _bound(mark.gt, -math.inf)

    def read_number(value: object) -> float:
        found = read(value)
        if low <= found <= high and found > above:
            number = kind(found)
            if number == found:
                return number
        raise ValueError("out of range, or no whole number")

    return read_number


def _read_text(read: _Reader, longest: float, check: Callable[[str], None] | None, value: object) -> str:
    found: str = read(value)
    if len(found) > longest:
        raise ValueError("too long")
    if check is not None:
        check(found)
    return found


def _read_word(words: list[str], value: object) -> object:
    if value in words:
        return value
    raise ValueError("no such word")


def _check_length(value: Collection[object], kind: type[Any], bounds: tuple[float, float]) -> None:
    if not isinstance(value, kind) or not bounds[0] <= len(value) <= bounds[1]:
        raise ValueError("of another type, too short or too long")


def _read_each(
    read: _Reader, quick: _Reader | None, kind: type[Any], bounds: tuple[float, float], value: list[object]
) -> object:
    """Read the entries of a list."""
    _check_length(value, list | tuple, bounds)  # type: ignore[arg-type] # for isinstance
    if quick is not None:
        try:
            return quick(value)
        except ValueError:  # numbers as text
            pass
    return kind(map(read, value))


def _read_places(readers: list[_Reader], value: list[object]) -> object:
    _check_length(value, list | tuple, (len(readers), len(readers)))  # type: ignore[arg-type] # for isinstance
    return tuple(read(one) for read, one in zip(readers, value, strict=True))


def _read_entries(read_key: _Reader, read: _Reader, bounds: tuple[float, float], value: dict[str, object]) -> object:
    _check_length(value, dict, bounds)
    return {read_key(key): read(one) for key, one in value.items()}


def _read_choice(readers: list[_Reader], is_optional: bool, value: object) -> object:  # noqa: FBT001 - of a partial
    """Read a value as one of several types."""
    if value is None and is_optional:
        return None
    for each in readers:
        try:
            return each(value)
        except ValueError:
            pass
    raise ValueError("none of the types")


class _FieldReaders(dict[str, _Reader]):
    """The readers of the fields of a model, by key; one is made when its field is first there."""

    def __init__(self, kind: type[Document]) -> None:
        super().__init__()
        self._kind = kind

    def __missing__(self, key: str) -> _Reader:
        self[key] = _reader_of(fields_of(self._kind)[key])
        return self[key]


def _model_reader(kind: type[Document]) -> _Reader:
    """Return the function that reads objects of a model."""
    keys, defaults = kind.__struct_encode_fields__, kind.__struct_defaults__
    fields = list(zip(keys, kind.__struct_fields__, strict=True))
    optional = zip(reversed(keys), reversed(defaults), strict=False)
    needed = set(keys) - {key for key, default in optional if default is not msgspec.NODEFAULT}
    readers = _FieldReaders(kind)
    prepare = kind.prepare if "prepare" in vars(kind) else _as_it_is
    known = set(keys) if kind.__struct_config__.forbid_unknown_fields else None

    def read(value: object) -> object:
        value = prepare(value)
        if not isinstance(value, dict) or not needed <= value.keys() or (known and not value.keys() <= known):
            raise ValueError("no such object")
        return kind(**{name: readers[key](value[key]) for key, name in fields if key in value})

    return read

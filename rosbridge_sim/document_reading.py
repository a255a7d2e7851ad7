"""Documents of the user: JSON or parsed TOML -> a checked model, or readable lines with the places and the mistakes.

One function per model is made from its fields, when it is first needed. It reads a document in one pass, and raises
`_WrongError` with all mistakes if there are some; a sentence is made only of those that are told. Lists of numbers are
read by msgspec at once, and one by one only if they have a mistake: a city has a million points.
"""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import cache, partial
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias, TypeVar, Union, get_args, get_origin

import msgspec
from msgspec import Meta

from rosbridge_sim.documents import MAX_KEY_SHOWN, SPELLED, Document, DocumentType, fields_of
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.not_json import explain_not_json
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record
from rosbridge_sim.suggestions import hint

T = TypeVar("T")

MAX_VALUE_SHOWN: Final = 40
"""Longest part of an offending value that an error shows [characters]."""

MAX_DOCUMENT_MISTAKES: Final = 100
"""Largest number of mistakes that are reported for one document."""

Place: TypeAlias = tuple[int | str, ...]
"""Keys and indices of a value; empty for the document as a whole."""

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


def read_values(kind: DocumentType[T], value: object, source: str) -> T:
    """Read and check a document that is parsed already, such as a TOML file.

    Raises:
        DocumentError: one line, the first mistake; see `read_document`.
    """
    checked = check_values(kind, value, partial(_place_in, source))
    if checked[0] is None:
        raise DocumentError(next(checked[1]).text)
    return checked[0]


def check_values(kind: DocumentType[T], value: object, where: Where) -> tuple[T | None, Iterator[Mistake]]:
    """Return the model of a parsed document, or None and its mistakes: the first hundred, and the number of the others.

    Args:
        where: returns the text for a place.
    """
    try:
        model: T = _document_reader(kind)(value)
        return model, iter(())
    except ValueError as error:
        return None, _told(_wrong_of(error, value), where)


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
    return list(check_values(kind, value, partial(_place_in, source))[1])


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


# Mistakes


class _Found(NamedTuple):
    """A mistake without words.

    Attributes:
        error: says what was expected.
        value: what came; `_NOTHING` if a sentence does not tell it.
    """

    place: Place
    error: ValueError
    value: object


_NOTHING: Final = object()


class _WrongError(ValueError):
    """Mistakes within a value.

    Attributes:
        mistakes: the first of them.
        num: how many there are.
    """

    def __init__(self) -> None:
        self.mistakes: list[_Found] = []
        self.num = 0

    def add(self, part: int | str, error: ValueError, value: object = _NOTHING) -> None:
        """Add the mistakes of a part, under its key or index."""
        within = _wrong_of(error, value)
        free = MAX_DOCUMENT_MISTAKES - len(self.mistakes)
        self.mistakes += [_Found((part, *one.place), one.error, one.value) for one in within.mistakes[:free]]
        self.num += within.num


class _NoSuchError(ValueError):
    """A key or a word that is not one of the known ones."""

    def __init__(self, known: Sequence[str]) -> None:
        super().__init__(f"expected one of {', '.join(known)}")
        self.known = known


def _wrong_of(error: ValueError, value: object) -> _WrongError:
    """Return the mistakes of a value, which may be one of the value as a whole."""
    if isinstance(error, _WrongError):
        return error
    wrong = _WrongError()
    wrong.mistakes, wrong.num = [_Found((), error, value)], 1
    return wrong


def _place_in(source: str, place: Place) -> str:
    """Return a file and a place in it: `demo.json: vehicleList[2].pos`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{printable(part, MAX_KEY_SHOWN)}" for part in place)
    path = "".join(parts).removeprefix(".")
    return f"{source}: {path}" if path else source


def _told(wrong: _WrongError, where: Where) -> Iterator[Mistake]:
    """Yield the mistakes in words: `demo.json: vehicleList[2].pos: expected an object, got null`."""
    for place, error, value in wrong.mistakes:
        got = "" if value is _NOTHING else f", got {show_json(value)}"
        near = ""
        if isinstance(error, _NoSuchError):
            near = hint(str(place[-1] if value is _NOTHING else value), error.known)
        yield Mistake(place, f"{where(place)}: {error}{got}{near}")
    if wrong.num > len(wrong.mistakes):
        yield Mistake((), f"{where(())}: ... and {wrong.num - len(wrong.mistakes):,} more")


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


# Readers

_Reader: TypeAlias = Callable[[Any], Any]
"""Returns the value for a JSON value; raises ValueError with what was expected."""


@cache
def _document_reader(kind: DocumentType[Any]) -> _Reader:
    return _reader_of(kind.form)


def _reader_of(form: Any) -> _Reader:  # noqa: ANN401 - a type form
    """Return the function that reads values of a type."""
    marks: list[Meta] = []
    while get_origin(form) is Annotated:
        form, *more = get_args(form)
        marks = [*more, *marks]
    extra: dict[str, Any] = next((mark.extra for mark in marks if mark.extra), {})
    if form in {float, int, bool, str} or "read" in extra:
        read = extra.get("read") or partial(_read_exactly, form)
        if form is str:
            return partial(_read_text, read, _bound(marks, "max_length", math.inf), extra.get("check"))
        return _number_reader(form, read, marks) if form in {float, int} else read
    if isinstance(form, type) and issubclass(form, Document):
        return _model_reader(form)
    return _as_it_is if form is Any else _reader_of_parts(get_origin(form), get_args(form), marks, form)


def _bound(marks: list[Meta], name: str, default: Any) -> Any:  # noqa: ANN401 - a whole number or a float
    """Return the innermost bound of a name."""
    return next((bound for mark in marks if (bound := getattr(mark, name)) is not None), default)


def _reader_of_parts(origin: Any, args: tuple[Any, ...], marks: list[Meta], form: Any) -> _Reader:  # noqa: ANN401 - type forms
    """Return the function that reads values of a type with parts."""
    if origin is Literal:
        return partial(_read_word, list(args))
    if origin in {Union, UnionType}:
        return _choice_reader([_reader_of(arg) for arg in args if arg is not NoneType], is_optional=NoneType in args)
    bounds = _bound(marks, "min_length", 0), _bound(marks, "max_length", math.inf)
    if origin is dict:
        return partial(_read_entries, _reader_of(args[0]), _reader_of(args[1]), bounds)
    if origin is tuple and args[1:] != (...,):
        return partial(_read_places, [_reader_of(arg) for arg in args])
    quick = partial(msgspec.convert, type=form) if _is_numeric(args[0]) else None
    return partial(_read_each, _reader_of(args[0]), quick, origin, bounds)


def _is_numeric(form: Any) -> bool:  # noqa: ANN401 - a type form
    """Tell whether a type holds numbers alone, which msgspec reads with the same bounds."""
    if get_origin(form) is Annotated:
        return _is_numeric(get_args(form)[0])
    return form in {float, int} or (get_origin(form) in {list, tuple} and all(map(_is_numeric, get_args(form))))


def _as_it_is(value: object) -> object:
    return value


_NAMES: Final = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


def _read_exactly(kind: type[Any], value: object) -> object:
    if type(value) is kind or (kind is float and type(value) is int):
        return value
    raise ValueError(f"expected {_NAMES[kind]}")


_LARGEST: Final = math.nextafter(math.inf, 0.0)


def _number_reader(kind: type[float], read: _Reader, marks: list[Meta]) -> _Reader:
    low, high = _bound(marks, "ge", -_LARGEST), _bound(marks, "le", _LARGEST)
    above = _bound(marks, "gt", -math.inf)

    def read_number(value: object) -> float:
        found = read(value)
        if low <= found <= high and found > above:
            number = kind(found)
            if number == found:
                return number
        if not -math.inf < found < math.inf:
            raise ValueError("expected a finite number")
        if kind is int and found != int(found):
            raise ValueError("expected a whole number")
        least = f"more than {above:,.15g}" if found <= above else f"at least {low:,.15g}"
        raise ValueError(f"expected at most {high:,.15g}" if found > high else f"expected {least}")

    return read_number


def _read_text(read: _Reader, longest: float, check: Callable[[str], None] | None, value: object) -> str:
    found: str = read(value)
    if len(found) > longest:
        raise ValueError(f"expected at most {longest:,} characters")
    if check is not None:
        check(found)
    return found


def _read_word(words: list[str], value: object) -> object:
    if value not in words:
        raise _NoSuchError(words) if isinstance(value, str) else ValueError(f"expected one of {', '.join(words)}")
    return value


def _check_length(value: Collection[object], bounds: tuple[int, float]) -> None:
    least, longest = bounds
    if not least <= len(value) <= longest:
        bound = f"at least {least:,}" if len(value) < least else f"at most {longest:,}"
        raise ValueError(f"expected {bound} entries")


def _read_each(
    read: _Reader, quick: _Reader | None, kind: type[Any], bounds: tuple[int, float], value: list[object]
) -> object:
    """Read the entries of a list."""
    if not isinstance(value, list | tuple):
        raise ValueError("expected a list")  # noqa: TRY004 - as all mistakes
    _check_length(value, bounds)
    try:
        return kind(map(read, value)) if quick is None else quick(value)
    except ValueError:
        return kind(_read_parts((i, read, one) for i, one in enumerate(value)))


def _read_places(readers: list[_Reader], value: list[object]) -> object:
    if not isinstance(value, list | tuple) or len(value) != len(readers):
        raise ValueError(f"expected a list of {len(readers)}")
    return tuple(_read_parts((i, read, one) for i, (read, one) in enumerate(zip(readers, value, strict=True))))


def _read_entries(read_key: _Reader, read: _Reader, bounds: tuple[int, float], value: object) -> object:
    if not isinstance(value, dict):
        raise ValueError("expected an object")  # noqa: TRY004 - as all mistakes
    _check_length(value, bounds)
    _read_parts((key, read_key, key) for key in value)
    return dict(zip(value, _read_parts((key, read, one) for key, one in value.items()), strict=True))


def _read_parts(parts: Iterable[tuple[Any, _Reader, object]]) -> list[object]:
    """Read the parts of a value one by one, so that each tells its mistakes."""
    found, wrong = [], None
    for part, read, one in parts:
        try:
            found.append(read(one))
        except ValueError as error:
            wrong = _added(wrong, part, error, one)
    if wrong is not None:
        raise wrong
    return found


def _choice_reader(readers: list[_Reader], *, is_optional: bool) -> _Reader:
    """Return the function that reads a value as one of several types."""

    def read(value: object) -> object:
        if value is None and is_optional:
            return None
        errors: list[ValueError] = []
        for each in readers:
            try:
                return each(value)
            except ValueError as error:
                errors.append(error)
        texts = " or ".join(str(error).removeprefix("expected ") for error in errors)
        within = (error for error in errors if isinstance(error, _WrongError))
        raise next(within, None) or (errors[0] if len(errors) == 1 else ValueError(f"expected {texts}"))

    return read


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
        if not isinstance(value, dict):
            raise ValueError("expected an object")  # noqa: TRY004 - as all mistakes
        wrong = None if known is None or value.keys() <= known else _strange_keys(value, keys)
        found = {}
        for key, name in fields:
            if key in value:
                try:
                    found[name] = readers[key](value[key])
                except ValueError as error:
                    wrong = _added(wrong, key, error, value[key])
            elif key in needed:
                wrong = _added(wrong, key, ValueError(f"missing{_meaning_of(fields_of(kind)[key])}"))
        if wrong is not None:
            raise wrong
        try:
            return kind(**found)
        except ValueError as error:  # its values do not fit together
            raise _wrong_of(error, value) from None

    return read


def _meaning_of(form: Any) -> str:  # noqa: ANN401 - a type form
    """Return the description of a field, to follow that it is missing."""
    texts = [mark.description for mark in getattr(form, "__metadata__", ()) if mark.description]
    return f"; {texts[-1]}" if texts else ""


def _strange_keys(value: Iterable[str], known: Sequence[str]) -> _WrongError:
    wrong = _WrongError()
    for key in value:
        if key not in known:
            wrong.add(key, _NoSuchError(known))
    return wrong


def _added(wrong: _WrongError | None, part: int | str, error: ValueError, value: object = _NOTHING) -> _WrongError:
    wrong = wrong or _WrongError()
    wrong.add(part, error, value)
    return wrong


# Schemas


def document_schema(kind: DocumentType[Any]) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a document."""
    (top,), parts = msgspec.json.schema_components([kind.form], ref_template="#/$defs/{name}")
    whole: dict[str, Any] = _plain(parts.pop(top["$ref"].rpartition("/")[2]))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **whole, "$defs": _plain(parts)}


def _plain(schema: JsonValue) -> JsonValue:
    """Return a schema without null as a default, with one `type` for "this or null", and with texts for numbers."""
    if isinstance(schema, list):
        return [_plain(item) for item in schema]
    if not isinstance(schema, dict):
        return inspect.cleandoc(schema) if isinstance(schema, str) else schema
    plain = {key: _plain(value) for key, value in schema.items() if not (key == "default" and value is None)}
    if plain.pop(SPELLED, False):
        plain["type"] = [plain["type"], "string"]
    match plain.get("anyOf"):
        case [{"type": str() | list() as kind, **rest}, {"type": "null"}]:
            del plain["anyOf"]
            kinds = [kind] if isinstance(kind, str) else kind
            return {"type": [*kinds, "null"], **rest, **plain}
    return plain

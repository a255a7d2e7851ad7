"""Messages from what a mock's file says of their fields: constants, checked once, and parts that change.

A message is a copy of the constant one with the changing fields set, so that it costs some microseconds. Headers
without a stamp get that of the message, and in ROS 1 its number.
"""

from __future__ import annotations

import csv
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final

from rosbridge_sim.documents.document_model import Mistake, Place, Where, show_json
from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.errors import DocumentError, PeerError
from rosbridge_sim.expressions import Expression, Following, TopicField, Value, parse_expression
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.mock.mock_model import PATTERN_OPTIONS, CsvPattern
from rosbridge_sim.mock.value_patterns import (
    SECOND_NS,
    ConstantPart,
    MessageTime,
    Part,
    RandomWalk,
    make_counter,
    make_cycle,
    make_ramp,
    make_sine,
)
from rosbridge_sim.printable import printable
from rosbridge_sim.schema.complete_check import check
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.float32 import round32
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.suggestions import hint, listing

Convert = Callable[[Any], Any]
"""Returns the value of a field for that of a pattern; a TypeError, ValueError or OverflowError if there is none."""

_NUMBERS: Final[dict[str, Callable[[Any], Part]]] = {
    "$sine": make_sine,
    "$ramp": make_ramp,
    "$counter": make_counter,
}
"""Patterns of numbers that need nothing but their options."""

TIME_NAMES: Final = ("time", "tick")
"""Names in expressions: time since the start [s], and number of the message."""


class MessageMaker:
    """Makes the parts of messages, and collects the mistakes in them.

    Attributes:
        mistakes: all that were found.
        latest: topic -> its last message, which expressions read.
        reads: topics that the expressions of the last message read.
        types: of the topics that expressions may read, by absolute name.
    """

    def __init__(self, where: Where, read_file: Callable[[str], bytes], tell: Callable[[str], None], seed: int) -> None:
        """Know no topics yet.

        Args:
            where: returns a place in the file for errors.
            read_file: returns the content of a file beside the mock's file; raises DocumentError.
            tell: gets each mistake that an expression makes later, once.
            seed: of random walks.
        """
        self.mistakes: list[Mistake] = []
        self.latest: dict[str, Struct] = {}
        self.reads: set[str] = set()
        self._where = where
        self.types: dict[str, MessageType] = {}
        self._read_file = read_file
        self._tell = tell
        self._seed = seed
        self._request: MessageSpec | None = None

    def note(self, place: Place, text: str) -> None:
        """Note a mistake."""
        self.mistakes.append(Mistake(place, f"{self._where(place)}: {text}"))

    def message(
        self, message_type: MessageType, tree: object, place: Place, request: MessageType | None = None
    ) -> Part:
        """Return the part that makes whole messages.

        Args:
            tree: fields as they were written; None for none.
            request: the type whose fields expressions may name; None for none.
        """
        self.reads = set()
        self._request = None if request is None else request.spec
        return self._message(message_type.spec, tree, place)

    def _message(self, spec: MessageSpec, tree: object, place: Place) -> Part:
        if tree is None:
            tree = {}
        if not isinstance(tree, dict):
            self.note(place, f"expected an object with fields of {spec.name}, got {show_json(tree)}")
            return ConstantPart(None)
        made = check(spec, {}, 0)
        parts: list[tuple[str, Part]] = []
        given = {spec.aliases.get(key, key): key for key in tree}
        for name in given.keys() - spec.fields.keys():
            text = f"{spec.name} does not have this field{hint(name, spec.fields)}; it has {listing(spec.fields)}"
            self.note((*place, given[name]), text)
        for name, field in spec.fields.items():
            if name in given:
                part = self._field(spec, field, tree[given[name]], (*place, given[name]))
            elif spec.is_header and name in {"stamp", "seq"}:
                part = _stamp if name == "stamp" else _number
            elif field.nested is not None and field.definition.array is None:
                part = self._message(field.nested, {}, (*place, name))  # it may have a header
            else:
                continue
            if isinstance(part, ConstantPart):
                setattr(made, field.attribute, part.value)
            else:
                parts.append((field.attribute, part))
        return _copier(made, parts) if parts else ConstantPart(made)

    def _field(self, spec: MessageSpec, field: FieldSpec, value: object, place: Place) -> Part:
        if _pattern_of(value) is not None:
            return self._pattern(spec, field, value, place)
        if field.nested is not None and field.definition.array is None:
            return self._message(field.nested, value, place)
        if isinstance(value, list) and (field.nested is not None or any(map(_pattern_of, value))):
            return self._list(spec, field, value, place)
        return self._constant(spec, field, value, place)

    def _constant(self, spec: MessageSpec, field: FieldSpec, value: object, place: Place) -> Part:
        try:
            return ConstantPart(getattr(check(spec, {field.definition.name: value}, 0), field.attribute))
        except PeerError as error:
            self.note(place, str(error))
            return ConstantPart(None)

    def _list(self, spec: MessageSpec, field: FieldSpec, values: list[object], place: Place) -> Part:
        """Return a list of messages, or of numbers of which some are patterns."""
        if field.definition.array is None or field.definition.is_bytes:
            return self._constant(spec, field, [0], place)
        parts: list[Part] = []
        for i, value in enumerate(values):
            at = (*place, i)
            if _pattern_of(value) is not None:
                parts.append(self._pattern(spec, field, value, at, is_element=True))
            elif field.nested is not None:
                parts.append(self._message(field.nested, value, at))
            else:
                made = self._constant(spec, field, [value] * (field.definition.array or 1), at)
                parts.append(
                    ConstantPart(made.value[0]) if isinstance(made, ConstantPart) and made.value is not None else made
                )
        num = field.definition.array
        if num and (len(values) > num or (len(values) < num and not field.definition.is_bounded)):
            self.note(place, f"expected {num} entries, got {len(values)}")
        if all(isinstance(part, ConstantPart) for part in parts):
            return ConstantPart([part(_NEVER) for part in parts])
        return lambda moment: [part(moment) for part in parts]

    # Patterns

    def _pattern(
        self, spec: MessageSpec, field: FieldSpec, value: object, place: Place, *, is_element: bool = False
    ) -> Part:
        """Return the part for a pattern, an object with one key."""
        ((pattern, given),) = value.items()  # type: ignore[attr-defined] # see `_pattern_of`
        place = (*place, pattern)
        if pattern not in PATTERN_OPTIONS:
            self.note(place, f"expected one of {', '.join(PATTERN_OPTIONS)}{hint(pattern, PATTERN_OPTIONS)}")
            return ConstantPart(None)
        options, mistakes = check_values(PATTERN_OPTIONS[pattern], given, lambda inner: self._where((*place, *inner)))
        self.mistakes += mistakes
        if options is None:
            return ConstantPart(None)
        if pattern == "$list" and not is_element:
            return make_cycle([self._field(spec, field, each, (*place, i)) for i, each in enumerate(options)])
        if pattern == "$file":
            return self._file(spec, field, options, place)
        convert = _converter(spec, field) if is_element or field.definition.array is None else None
        is_text = field.definition.type in {"string", "wstring"}
        if convert is None or (is_text and pattern not in {"$csv", "$expression", "$list"}):
            self.note(place, f"expected for a {field.definition.full_type} another pattern, or a constant")
            return ConstantPart(None)
        return self._number_or_text(pattern, options, convert, place, is_text=is_text)

    def _number_or_text(self, pattern: str, options: Any, convert: Convert, place: Place, *, is_text: bool) -> Part:  # noqa: ANN401 - those of the pattern
        match pattern:
            case "$list":
                part = make_cycle([ConstantPart(each) for each in options])
            case "$csv":
                part = make_cycle([ConstantPart(each) for each in self._column(options, place, is_text=is_text)])
            case "$expression":
                return self._expression(options, convert, place)
            case "$random_walk":
                part = RandomWalk(options, (self._seed, zlib.crc32(repr(place).encode())))
            case _:
                part = _NUMBERS[pattern](options)
        return self._converted(part, convert, place)

    def _converted(self, part: Part, convert: Convert, place: Place) -> Part:
        try:
            convert(part(_NEVER))
        except (TypeError, ValueError, OverflowError):
            self.note(place, "expected values that the field can have")
        return lambda moment: convert(part(moment))

    def _file(self, spec: MessageSpec, field: FieldSpec, path: str, place: Place) -> Part:
        """Return the content of a file, as bytes or as a text."""
        try:
            content = self._read_file(path)
            text = None if field.definition.is_bytes else content.decode()
        except (DocumentError, UnicodeDecodeError) as error:
            self.note(place, str(error) if isinstance(error, DocumentError) else f"{path}: expected a text in UTF-8")
            return ConstantPart(None)
        return self._constant(spec, field, content if text is None else text, place)

    def _column(self, options: CsvPattern, place: Place, *, is_text: bool) -> list[Any]:
        """Return the values of a column of a CSV file; one value if it cannot be read."""
        try:
            words = read_column(self._read_file(options.file), options.file, options.column)
            return words if is_text else [float(word) for word in words]
        except DocumentError as error:
            self.note(place, str(error))
        except (ValueError, csv.Error) as error:
            self.note(place, f"{options.file}: column {options.column}: {printable(str(error), 100)}")
        return ["" if is_text else 0.0]

    # Expressions

    def condition(self, text: str, request: MessageType, place: Place) -> Callable[[Any], bool]:
        """Return a function that tells whether an expression over the fields of a request holds."""
        self._request = request.spec
        part = self._expression(text, bool, place)
        return lambda value: bool(part(MessageTime(0, 0, None, value)))

    def _expression(self, text: str, convert: Convert, place: Place) -> Part:
        """Return the value of an expression; where it has none, as before the first message, that of 0."""
        named = {} if self._request is None else {name: field.attribute for name, field in self._request.fields.items()}
        try:
            expression = parse_expression(text, self._where(place), frozenset({*TIME_NAMES, *named}), is_followed=True)
            readers = {each.text: self._reader(each, place) for each in expression.fields}
        except DocumentError as error:
            self.mistakes.append(Mistake(place, str(error)))
            return ConstantPart(None)
        chosen = {name: attribute for name, attribute in named.items() if name in expression.names}
        return self._computed(expression, readers, chosen, convert)

    def _computed(
        self,
        expression: Expression,
        readers: Mapping[str, Callable[[], Any]],
        named: Mapping[str, str],
        convert: Convert,
    ) -> Part:
        """Return the value of an expression over the last messages of topics, and the fields of a request."""
        following = Following(expression)
        told: set[str] = set()

        def compute(moment: MessageTime) -> Any:  # noqa: ANN401 - of any field
            values: dict[str, Value] = {"time": moment.time_ns / SECOND_NS, "tick": moment.number}
            for name, attribute in named.items():
                values[name] = getattr(moment.request, attribute)
            for text, read in readers.items():
                with suppress(IndexError):  # the list is shorter in this message
                    values[text] = read()
            try:
                following.take(values)
                value = following.value(values)
                return convert(0 if value is None else value)
            except (DocumentError, TypeError, ValueError, OverflowError) as error:
                is_ours = isinstance(error, DocumentError)
                text = str(error) if is_ours else f"{expression.where}: a value that the field cannot have"
                if not told:
                    told.add(text)
                    self._tell(text)
                return convert(0)

        return compute

    def _reader(self, field: TopicField, place: Place) -> Callable[[], Any]:
        """Return a function that reads a field of the last message of a topic; it raises IndexError beyond a list.

        Raises:
            DocumentError: there is no such field.
        """
        where = self._where(place)
        message_type = self.types.get(field.topic)
        if message_type is None:
            near = hint(field.topic, self.types) or "; expressions may read `topics` and `subscribers`"
            raise DocumentError(f"{where}: no topic {field.topic} here{near}")
        spec: MessageSpec | None = message_type.spec
        steps: list[str | int] = []
        is_list = is_time = False
        for step in field.path:
            if isinstance(step, int) is not is_list or (spec is None and not is_list):
                break
            if isinstance(step, str):
                assert spec is not None, "checked above"
                found = spec.fields.get(spec.aliases.get(step, step))
                if found is None:
                    raise DocumentError(f"{where}: {spec.name} has no field {step}{hint(step, spec.fields)}")
                is_time = found.definition.type in spec.dialect.times
                step, spec, is_list = found.attribute, found.nested, found.definition.array is not None  # noqa: PLW2901
            else:
                is_list = False
            steps.append(step)
        if len(steps) < len(field.path) or is_list or is_time or spec is not None:
            raise DocumentError(f"{where}: expected a single number or text, but {field.text} is none")
        topic, latest = field.topic, self.latest
        latest.setdefault(topic, message_type.default())
        self.reads.add(topic)

        def read() -> Any:  # noqa: ANN401 - of any field
            value = latest[topic]
            for step in steps:
                value = getattr(value, step) if isinstance(step, str) else value[step]
            return value

        return read


def read_column(content: bytes, path: str, column: str) -> list[str]:
    """Return the words of a column of a CSV text, whose first line has the names.

    Raises:
        DocumentError: there is no such column, or nothing in it.
        ValueError, csv.Error: it is no CSV in UTF-8.
    """
    rows = list(csv.reader(content.decode("utf-8-sig").splitlines()))
    names = rows[0] if rows else []
    if column not in names:
        raise DocumentError(f"{path}: no column {printable(column)!r}{hint(column, names)}; it has {listing(names)}")
    at = names.index(column)
    words = [row[at] for row in rows[1:] if len(row) > at]
    if not words:
        raise DocumentError(f"{path}: expected rows below the names of the columns")
    return words


def fits(spec: MessageSpec, tree: Mapping[str, Any]) -> Callable[[Any], bool]:
    """Return a function that tells whether a request has these fields; the tree was checked.

    Args:
        spec: type of the request.
        tree: fields as they were written.
    """
    whole = check(spec, dict(tree), 0)
    tests: list[tuple[str, Callable[[Any], bool]]] = []
    for key, value in tree.items():
        field = spec.fields[spec.aliases.get(key, key)]
        if field.nested is not None and field.definition.array is None and isinstance(value, dict):
            tests.append((field.attribute, fits(field.nested, value)))
        else:
            tests.append((field.attribute, getattr(whole, field.attribute).__eq__))
    return lambda request: all(test(getattr(request, attribute)) is True for attribute, test in tests)


_NEVER: Final = MessageTime(0, 0, None)


def _pattern_of(value: object) -> str | None:
    """Return the key of a pattern; None for a constant."""
    if isinstance(value, dict) and len(value) == 1:
        key = next(iter(value))
        return key if key.startswith("$") else None
    return None


def _stamp(moment: MessageTime) -> object:
    return moment.stamp


def _number(moment: MessageTime) -> int:
    return moment.number % 2**32


def _copier(made: Struct, parts: Sequence[tuple[str, Part]]) -> Part:
    copy = made.__copy__

    def make(moment: MessageTime) -> Struct:
        value = copy()
        for attribute, part in parts:
            setattr(value, attribute, part(moment))
        return value

    return make


def _converter(spec: MessageSpec, field: FieldSpec) -> Convert | None:
    """Return a function from values of patterns to those of a field, or of an element; None for messages and times."""
    kind = field.definition.type
    if kind in spec.dialect.ints:
        low, high = spec.dialect.ints[kind]
        return lambda value: low if math.isnan(value) else round(min(max(value, low), high))
    return _CONVERTERS.get(kind)


_CONVERTERS: Final[dict[str, Convert]] = {
    "float64": float,
    "float32": lambda value: round32(float(value)),
    "bool": bool,
    "string": str,
    "wstring": str,
}
"""Type of a field -> function from values of patterns; whole numbers apart."""

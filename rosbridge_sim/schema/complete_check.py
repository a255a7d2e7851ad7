"""The rules by which a message body is accepted and converted: complete, but slow.

The decoders of `message_type` are fast and accept plain bodies only; all other bodies come here. For a body that both
accept, both must give the same value (a test compares them).

In short: a missing field or `null` is the default, and for floats `null` is NaN. Integers may come as integral floats,
bytes as base64 or as a list, times with the field names of either ROS generation. A header without a stamp gets the
present time. Everything else that does not fit is refused with the dotted path of the field, in the words of
rosbridge_suite.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import Any

import msgspec
import numpy as np

from rosbridge_sim.errors import FieldError, Reason
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.dialect import Dialect
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.definitions.parse import INT_RANGES, MAX_FLOAT32, Field
from rosbridge_sim.schema.float32 import LONG_ARRAY, NumberArray, round32, round32_list
from rosbridge_sim.schema.number_arrays import are_integral, to_dtype, to_floats
from rosbridge_sim.suggestions import hint, listing

_CHECKED_AT_ONCE = 32
"""From this length on, a list of numbers is checked at once, which is faster then than one by one."""

_DTYPES = {"byte": "int8", "char": "uint8"}
"""numpy's names of integer types, where they differ from ROS's."""

_SPELLINGS = (("secs", "sec"), ("nsecs", "nanosec"))
"""The names of each part of a time in ROS 1 and in ROS 2."""


def check(spec: MessageSpec, value: object, stamp_ns: int, root: str | None = None) -> Struct:
    """Return the struct for a body given as Python objects.

    Args:
        value: the body: dicts, lists, numbers, text, and bytes from a binary encoding. A long array that owns its
            memory is used up: the struct may have the same memory.
        stamp_ns: the present time, for headers without a stamp and for the text `now` [ns].
        root: name of the type in error texts; None for its own.

    Raises:
        FieldError: the body does not fit.
    """
    root = root or spec.name
    if not isinstance(value, dict):
        raise FieldError(f"Expected a JSON object for type {root} but received a {type(value)}")
    try:
        return _Check(spec.dialect, stamp_ns).message(spec, value)
    except _Misfit as misfit:
        path = "".join(reversed(misfit.path)).removeprefix(".")
        raise FieldError(misfit.say(root, printable(path, MAX_QUOTED)), reason=misfit.reason) from None


class _Misfit(Exception):  # noqa: N818 - never leaves this module
    """A value that does not fit. Each level of the message adds its part of the path as the error passes."""

    def __init__(self, say: Callable[[str, str], str], reason: Reason) -> None:
        super().__init__()
        self.say = say
        self.reason = reason
        self.path: list[str] = []


def _wrong_type(full_type: str, value: object) -> _Misfit:
    got = type(value)
    return _Misfit(
        lambda root, path: f"{root} message requires a {full_type} for field {path}, but got a {got}", Reason.WRONG_TYPE
    )


def _wrong_value(full_type: str, why: str) -> _Misfit:
    return _Misfit(
        lambda root, path: f"{root} message requires a {full_type} for field {path}, but got {why}", Reason.WRONG_VALUE
    )


def _unknown(name: str, spec: MessageSpec, given: Mapping[object, object]) -> _Misfit:
    """Return the error for an unknown field, with a suggestion.

    Args:
        spec: the message type that lacks it.
        given: all that was given for that message.
    """

    def say(root: str, path: str) -> str:
        owner = "it" if path == printable(name, MAX_QUOTED) else spec.name
        return f"Message type {root} does not have a field {path}{_advise(name, spec, given, owner)}"

    misfit = _Misfit(say, Reason.UNKNOWN_FIELD)
    misfit.path.append("." + name)
    return misfit


def _advise(name: str, spec: MessageSpec, given: Mapping[object, object], owner: str) -> str:
    """Return advice: the release with the field, or the nearest field, and a list; or to wrap the message.

    Args:
        spec: the message type that lacks it.
        given: all that was given for that message.
        owner: name of the message type in the sentence.
    """
    if not spec.fields:
        return f"; {owner} has no fields"
    (field_name, field_spec), *others = spec.fields.items()
    inner = field_spec.nested
    if inner is not None and not others and field_spec.definition.array is None and field_name not in given:
        known = inner.fields.keys() | inner.aliases.keys()
        if any(key in known for key in islice(given, _LOOKED_AT)):  # the inner message, without the field around it
            return f'; wrap it in `{field_name}`: {{"{field_name}": {{...}}}}'
    # An alias is accepted, but the field's own name is what a program should have.
    near = spec.elsewhere.get(name) or hint(name, spec.fields) or hint(name, spec.aliases)
    if not near and (near := hint(name, spec.elsewhere)):
        near += next(text for field, text in spec.elsewhere.items() if f" {field}?" in near)
    return f"{near}; {owner} has {listing(spec.fields)}"


_LOOKED_AT = 100
"""Keys of a message that are looked at for advice: more than the fields of any message of ours."""


class _Check(Record):
    """One check of a body; a method for each kind of value. Each returns the value, or raises _Misfit."""

    dialect: Dialect
    stamp_ns: int

    def message(self, spec: MessageSpec, value: object) -> msgspec.Struct:
        """Convert a nested or root message; `null` is like a message without any fields."""
        if value is None:
            return self.default(spec)
        if not isinstance(value, dict):  # before any comparison: an array compares element by element
            raise _wrong_type(spec.name, value)
        if not value:
            return self.default(spec)
        given = {}
        for key, item in value.items():
            if key in spec.fields:
                given[key] = item
            elif key in spec.aliases:
                # If both names are given, that of the wire counts.
                given.setdefault(spec.aliases[key], value.get(spec.aliases[key], item))
            elif not (spec.is_header and key == "seq"):
                raise _unknown(str(key), spec, value)
        values = {}
        for name, field_spec in spec.fields.items():
            try:
                values[field_spec.attribute] = (
                    self.field(spec, field_spec, given[name]) if name in given else self.absent(spec, field_spec)
                )
            except _Misfit as misfit:
                misfit.path.append("." + name)
                raise
        return spec.struct_type(**values)

    def absent(self, spec: MessageSpec, field_spec: FieldSpec) -> object:
        """Return the default of a field that was not given."""
        if field_spec.nested is not None:
            if field_spec.definition.array is None:
                return self.default(field_spec.nested)
            return [self.default(field_spec.nested) for _ in range(field_spec.definition.count)]
        if spec.is_header and field_spec.definition.name == "stamp":
            return self.dialect.time(self.stamp_ns)
        return field_spec.make()

    def default(self, spec: MessageSpec) -> msgspec.Struct:
        """Return a message of which nothing was given."""
        value = spec.struct_type()
        if spec.finalize is not None:
            spec.finalize(value, self.stamp_ns)
        return value

    def field(self, spec: MessageSpec, field_spec: FieldSpec, value: object) -> object:
        if value is None and (
            field_spec.definition.array is not None or not field_spec.definition.type.startswith("float")
        ):
            return self.absent(spec, field_spec)
        if field_spec.definition.is_bytes:
            return self.bytes(field_spec, value)
        if field_spec.definition.array is not None:
            return self.array(field_spec, value)
        return self.element(field_spec, value)

    def array(self, field_spec: FieldSpec, value: object) -> list[object] | NumberArray:
        if isinstance(value, np.ndarray):
            return self.numbers(field_spec, value)
        if field_spec.is_single and not isinstance(value, (list, tuple)):
            value = [value]
        if not isinstance(value, (list, tuple)):
            raise _wrong_type(field_spec.definition.full_type, value)
        _check_length(field_spec.definition, len(value), "elements")
        if len(value) >= _CHECKED_AT_ONCE and (plain := self.plain_numbers(field_spec, value)) is not None:
            return plain
        values = []
        for i, item in enumerate(value):
            try:
                values.append(self.element(field_spec, item))
            except _Misfit as misfit:
                misfit.path.append(f"[{i}]")
                raise
        return values

    def plain_numbers(self, field_spec: FieldSpec, value: Sequence[Any]) -> list[object] | NumberArray | None:
        """Convert a long list of numbers of one type at once; None where each element must be looked at."""
        kind = field_spec.definition.type
        kinds = set(map(type, value))
        if kind in self.dialect.ints and kinds == {int}:
            low, high = self.dialect.ints[kind]
            return list(value) if low <= min(value) and max(value) <= high else None
        if kind not in {"float32", "float64"} or not kinds <= {int, float, type(None)}:
            return None
        try:
            wide = np.array(value, np.float64)  # None is NaN
        except OverflowError:
            return None
        if kind == "float64":
            floats: list[object] = wide.tolist()
            return floats
        if len(value) < LONG_ARRAY:
            is_plain = bool(np.isfinite(wide).all()) and float(np.abs(wide).max()) < MAX_FLOAT32
            return round32_list(wide.tolist()) if is_plain else None  # type: ignore[return-value] # a list of objects
        with np.errstate(over="ignore"):
            narrow = wide.astype(np.float32)
        return narrow if np.array_equal(np.isinf(narrow), np.isinf(wide)) else None

    def numbers(self, field_spec: FieldSpec, value: NumberArray) -> list[object] | NumberArray:
        """Convert a typed array; a long one stays an array, which all encoders accept."""
        kind = field_spec.definition.type
        is_float = kind in {"float32", "float64"}
        if not is_float and kind not in self.dialect.ints:
            raise _wrong_type(field_spec.definition.full_type, [])
        _check_length(field_spec.definition, len(value), "elements")
        if len(value) < LONG_ARRAY:
            return self.array(field_spec, value.tolist())
        if is_float:
            floats = to_floats(value, kind)
            if floats is None:
                raise _wrong_value(kind, "a number that is out of its range")
            return floats
        low, high = self.dialect.ints[kind]
        if value.dtype.kind == "f" and not are_integral(value):
            raise _wrong_type(kind, 0.5)
        if int(value.min()) < low or int(value.max()) > high:
            raise _wrong_value(kind, f"a number out of its range ({low} to {high})")
        return to_dtype(value, _DTYPES.get(kind, kind))

    def bytes(self, field_spec: FieldSpec, value: object) -> bytes:
        """Convert base64 (white space in it is ignored), numbers, or bytes from a binary encoding."""
        if isinstance(value, np.ndarray):
            numbers = self.numbers(field_spec, value)
            return numbers.astype(np.uint8, copy=False).tobytes() if isinstance(numbers, np.ndarray) else bytes(numbers)  # type: ignore[arg-type] # checked to be integers
        if isinstance(value, (list, tuple)):
            return bytes(self.array(field_spec, value))  # type: ignore[arg-type] # its elements are checked to be integers
        if isinstance(value, str):
            try:
                value = msgspec.convert("".join(value.split()), bytes)
            except (msgspec.ValidationError, UnicodeEncodeError):
                raise _wrong_value(field_spec.definition.full_type, "text that is not base64") from None
        if not isinstance(value, (bytes, bytearray, memoryview)):
            raise _wrong_type(field_spec.definition.full_type, value)
        value = bytes(value)
        _check_length(field_spec.definition, len(value), "bytes")
        return value

    def element(self, field_spec: FieldSpec, value: object) -> object:
        """Convert a scalar field or one element of an array."""
        kind = field_spec.definition.type
        if field_spec.nested is not None:
            return self.message(field_spec.nested, value)
        if kind in {"float32", "float64"}:
            return _float(kind, value)
        if value is None:
            return field_spec.zero
        if kind in self.dialect.times:
            return self.time(kind, value)
        if kind in {"string", "wstring"}:
            return _text(field_spec.definition, value)
        return _bool(value) if kind == "bool" else self.integer(field_spec, value)

    def integer(self, field_spec: FieldSpec, value: object) -> int:
        kind = field_spec.definition.type
        if isinstance(value, str) and field_spec.is_numeral:
            value = _numeral(value)
        return _integer(kind, value, self.dialect.ints[kind])

    def time(self, kind: str, value: object) -> msgspec.Struct:
        """Convert a time with either field names; a missing part is 0, unknown keys are ignored."""
        if isinstance(value, str) and value == "now" and kind == "time":
            return self.dialect.time(self.stamp_ns)
        if not isinstance(value, dict):
            raise _wrong_type(kind, value)
        parts = []
        for spellings, part in zip(_SPELLINGS, self.dialect.time_parts[kind], strict=True):
            name = next((spelling for spelling in spellings if spelling in value), None)
            item = None if name is None else value[name]
            try:
                parts.append(0 if item is None else _integer(part, item, INT_RANGES[part]))
            except _Misfit as misfit:
                misfit.path.append(f".{name}")
                raise
        return self.dialect.times[kind](*parts)


def _check_length(field: Field, length: int, what: str) -> None:
    if field.array and (length > field.array or (length < field.array and not field.is_bounded)):
        raise _wrong_value(field.full_type, f"{length} {what}")


def _bool(value: object) -> bool:
    if not isinstance(value, bool):
        raise _wrong_type("bool", value)
    return value


def _text(field: Field, value: object) -> str:
    if not isinstance(value, str):
        raise _wrong_type(field.full_type, value)
    if not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError:
            raise _wrong_value(field.full_type, "text with half a surrogate pair") from None
    if field.max_chars is not None and len(value) > field.max_chars:
        raise _wrong_value(field.full_type, f"{len(value)} characters")
    return value


def _integer(kind: str, value: object, bounds: tuple[int, int]) -> int:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool):
        raise _wrong_type(kind, value)
    low, high = bounds
    if not low <= value <= high:
        shown = str(value) if abs(value) < _MAX_PRINTED else f"a number of {value.bit_length()} bits"
        raise _wrong_value(kind, f"{shown}, which is out of its range ({low} to {high})")
    return value


_MAX_PRINTED = 10**40
"""Numbers from this one on are not written out in error texts."""


def _numeral(text: str) -> int | str:
    """Return the number at the end of a text; the text itself if there is none."""
    match = re.fullmatch(r"\s*([+-]?\d{1,20})\s*|.*[A-Za-z_](\d{1,20})", text, re.ASCII | re.DOTALL)
    return text if match is None else int(match[1] or match[2])


def _float(kind: str, value: object) -> float:
    if value is None:
        return math.nan
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise _wrong_type(kind, value)
    try:
        value = float(value)
        return round32(value) if kind == "float32" else value
    except OverflowError:
        raise _wrong_value(kind, "a number that is out of its range") from None

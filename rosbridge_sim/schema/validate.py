"""What a message body may look like: every rule of conversion, once, in the order in which a reader asks.

This is the complete and slow meaning. `compile.py` has a fast way for the bodies that need no kindness, and it comes
here with all others; whatever it accepts by itself must come out of here as the same value (a test compares them).

In short: a missing field or `null` is the default, for floats `null` is NaN; integers may come as integral floats,
bytes as base64 or as a list, times in the spelling of either ROS; a header without a stamp gets the stamp of now. All
else that does not fit is refused with the dotted path of the field, in the words that rosbridge_suite uses.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Annotated, Any, TypeAlias

import msgspec
import numpy as np
import numpy.typing as npt
import orjson

from rosbridge_sim.errors import FieldError, Reason
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.schema.names import Generation
from rosbridge_sim.schema.parse import INT_RANGES, MAX_FLOAT32, Definition, Field
from rosbridge_sim.suggestions import hint, listing

__all__ = [
    "ROS1",
    "ROS2",
    "Dialect",
    "Duration",
    "FieldSpec",
    "Leniency",
    "MessageSpec",
    "Time",
    "Time2",
    "check",
    "round32",
    "round32_list",
]

_UInt32 = Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]
_Int32 = Annotated[int, msgspec.Meta(ge=-(2**31), le=2**31 - 1)]


class Time(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """A point in time as ROS 1 writes it [s, ns]."""

    secs: _UInt32 = 0
    nsecs: _UInt32 = 0


class Duration(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """A span of time as ROS 1 writes it [s, ns]."""

    secs: _Int32 = 0
    nsecs: _Int32 = 0


class Time2(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """A point in time, or a span of it, as ROS 2 writes both [s, ns]."""

    sec: _Int32 = 0
    nanosec: _UInt32 = 0


@dataclass(frozen=True, slots=True)
class Dialect:
    """What differs between the personalities of the two ROS generations.

    Attributes:
        ros: the generation.
        times: the structs of `time` and `duration`; their two fields are the spelling that goes out.
        time_parts: the integer types of their two fields.
        ints: least and greatest value of each integer type, `byte` and `char` included.
        no_stamp: the default of a header's stamp, known by identity: it stands until the time of now takes its place.
    """

    ros: Generation
    times: Mapping[str, type[msgspec.Struct]]
    time_parts: Mapping[str, tuple[str, str]]
    ints: Mapping[str, tuple[int, int]]
    no_stamp: msgspec.Struct

    def time(self, stamp_ns: int) -> msgspec.Struct:
        """The value of a `time` field at that time [ns]."""
        return self.times["time"](*divmod(stamp_ns, 1_000_000_000))


ROS1 = Dialect(
    ros=1,
    times={"time": Time, "duration": Duration},
    time_parts={"time": ("uint32", "uint32"), "duration": ("int32", "int32")},
    # In ROS 1 `byte` is an old name of int8 and `char` of uint8.
    ints={**INT_RANGES, "byte": INT_RANGES["int8"], "char": INT_RANGES["uint8"]},
    no_stamp=Time(),
)

ROS2 = Dialect(
    ros=2,
    times={"time": Time2, "duration": Time2},
    time_parts={"time": ("int32", "uint32"), "duration": ("int32", "uint32")},
    # In ROS 2 both are a byte without a sign.
    ints={**INT_RANGES, "byte": INT_RANGES["uint8"], "char": INT_RANGES["uint8"]},
    no_stamp=Time2(),
)

NumberArray: TypeAlias = npt.NDArray[Any]
"""A typed array of CBOR: any numeric dtype of native byte order."""

_MANY = 32
"""From so many elements on, checking all at once is quicker than one by one."""

_LONG_ARRAY = 4_096
"""From so many elements on, a typed array stays one: as a list it would take four to eight times its memory."""

_DTYPES = {"byte": "int8", "char": "uint8"}
"""numpy's names of integer types that are not our own."""

_SPELLINGS = (("secs", "sec"), ("nsecs", "nanosec"))
"""Each part of a time in the spelling of ROS 1 and of ROS 2."""


@dataclass(frozen=True, slots=True)
class Leniency:
    """Names and shapes that documents use in place of the wire's.

    Attributes:
        types: accepted type name -> the type's own name.
        fields: type -> {accepted field name: wire name}.
        scalars: type -> array fields that may come as a single element.
        numerals: type -> integer fields that may come as text: `"13"`, or `"IntTL13"` with the digits at its end.
    """

    types: Mapping[str, str] = field(default_factory=dict)
    fields: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    scalars: Mapping[str, frozenset[str]] = field(default_factory=dict)
    numerals: Mapping[str, frozenset[str]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FieldSpec:
    """A field with all that is needed to fill it.

    Attributes:
        attribute: its name in the struct: the wire name, unless Python cannot have it.
        make: makes the default value.
        zero: what `null` means as an element of an array; None where the type has no such value of its own.
        shape: the nested message, or None.
        is_single: may come as a single element instead of an array.
        is_numeral: may come as text.
    """

    field: Field
    attribute: str
    make: Callable[[], object]
    zero: object
    shape: MessageSpec | None
    is_single: bool
    is_numeral: bool


@dataclass(frozen=True, slots=True)
class MessageSpec:
    """A message type as `check` sees it.

    Attributes:
        slots: by wire name, in wire order.
        aliases: accepted name -> wire name.
        is_header: its stamp is set to the time of now where none is given.
        finish: `(value, stamp_ns)`: does in place what is left to do on a struct that was made with its defaults; None
            where nothing is.
    """

    name: str
    definition: Definition
    dialect: Dialect
    struct: type[msgspec.Struct]
    slots: Mapping[str, FieldSpec]
    aliases: Mapping[str, str]
    is_header: bool
    finish: Callable[[Any, int], None] | None = None


def check(shape: MessageSpec, value: object, stamp_ns: int, root: str | None = None) -> Struct:
    """The struct that a body (as Python objects) stands for.

    Args:
        shape: the type.
        value: what came: dicts, lists, numbers, text, and bytes where a binary encoding has them.
        stamp_ns: the time of now, for headers without a stamp and for the text `now` [ns].
        root: what error texts call the type; its own name when None.

    Raises:
        FieldError: the body does not fit.
    """
    root = root or shape.name
    if not isinstance(value, dict):
        raise FieldError(f"Expected a JSON object for type {root} but received a {type(value)}")
    try:
        return _Check(shape.dialect, stamp_ns).message(shape, value)
    except _Misfit as misfit:
        path = "".join(reversed(misfit.path)).removeprefix(".")
        raise FieldError(misfit.say(root, printable(path, MAX_QUOTED)), reason=misfit.reason) from None


class _Misfit(Exception):  # noqa: N818 - never leaves this module
    """A value that does not fit; each level adds its part of the path on the way up."""

    def __init__(self, say: Callable[[str, str], str], reason: Reason) -> None:
        super().__init__()
        self.say = say
        self.reason = reason
        self.path: list[str] = []


def _wrong_type(full_type: str, value: object) -> _Misfit:
    got = type(value)
    return _Misfit(
        lambda root, path: f"{root} message requires a {full_type} for field {path}, but got a {got}",
        Reason.WRONG_TYPE,
    )


def _wrong_value(full_type: str, why: str) -> _Misfit:
    return _Misfit(
        lambda root, path: f"{root} message requires a {full_type} for field {path}, but got {why}",
        Reason.WRONG_VALUE,
    )


def _unknown(name: str, shape: MessageSpec, given: Mapping[object, object]) -> _Misfit:
    """A field that a message does not have, with what is likely meant by it."""

    def say(root: str, path: str) -> str:
        owner = "it" if path == printable(name, MAX_QUOTED) else shape.name
        return f"Message type {root} does not have a field {path}{_advise(name, shape, given, owner)}"

    misfit = _Misfit(say, Reason.UNKNOWN_FIELD)
    misfit.path.append("." + name)
    return misfit


def _advise(name: str, shape: MessageSpec, given: Mapping[object, object], owner: str) -> str:
    """Return the nearest field and all that there are; or that what was given belongs into the only one.

    Args:
        name: the unknown field.
        shape: the message that lacks it.
        given: all that was given for that message.
        owner: what the sentence calls it.
    """
    if not shape.slots:
        return f"; {owner} has no fields"
    (field_name, slot), *others = shape.slots.items()
    inner = slot.shape
    if inner is not None and not others and slot.field.array is None and field_name not in given:
        known = inner.slots.keys() | inner.aliases.keys()
        if any(key in known for key in islice(given, _LOOKED_AT)):  # the message itself, without what wraps it
            return f'; wrap it in `{field_name}`: {{"{field_name}": {{...}}}}'
    return f"{hint(name, [*shape.slots, *shape.aliases])}; {owner} has {listing(shape.slots)}"


_LOOKED_AT = 100
"""Keys of a message that are looked at for an advice: more than any message of ours has fields."""


@dataclass(frozen=True, slots=True)
class _Check:
    dialect: Dialect
    stamp_ns: int

    def message(self, shape: MessageSpec, value: object) -> msgspec.Struct:
        """A nested or root message; an absent one (`null`) is like one without any fields."""
        if value is None:
            return self.default(shape)
        if not isinstance(value, dict):  # before any comparison: an array compares element by element
            raise _wrong_type(shape.name, value)
        if not value:
            return self.default(shape)
        given = {}
        for key, item in value.items():
            if key in shape.slots:
                given[key] = item
            elif key in shape.aliases:
                # Where both names are given the wire's own one counts.
                given.setdefault(shape.aliases[key], value.get(shape.aliases[key], item))
            elif not (shape.is_header and key == "seq"):
                raise _unknown(str(key), shape, value)
        values = {}
        for name, slot in shape.slots.items():
            try:
                values[slot.attribute] = (
                    self.field(shape, slot, given[name]) if name in given else self.absent(shape, slot)
                )
            except _Misfit as misfit:
                misfit.path.append("." + name)
                raise
        return shape.struct(**values)

    def absent(self, shape: MessageSpec, slot: FieldSpec) -> object:
        """The default of a field that was not given."""
        if slot.shape is not None:
            if slot.field.array is None:
                return self.default(slot.shape)
            return [self.default(slot.shape) for _ in range(0 if slot.field.is_bounded else slot.field.array)]
        if shape.is_header and slot.field.name == "stamp":
            return self.dialect.time(self.stamp_ns)
        return slot.make()

    def default(self, shape: MessageSpec) -> msgspec.Struct:
        """A message of which nothing was given."""
        value = shape.struct()
        if shape.finish is not None:
            shape.finish(value, self.stamp_ns)
        return value

    def field(self, shape: MessageSpec, slot: FieldSpec, value: object) -> object:
        if value is None and (slot.field.array is not None or not slot.field.type.startswith("float")):
            return self.absent(shape, slot)
        if slot.field.is_bytes:
            return self.bytes(slot, value)
        if slot.field.array is not None:
            return self.array(slot, value)
        return self.element(slot, value)

    def array(self, slot: FieldSpec, value: object) -> list[object] | NumberArray:
        if isinstance(value, np.ndarray):
            return self.numbers(slot, value)
        if slot.is_single and not isinstance(value, (list, tuple)):
            value = [value]
        if not isinstance(value, (list, tuple)):
            raise _wrong_type(slot.field.full_type, value)
        _check_length(slot.field, len(value), "elements")
        if len(value) >= _MANY and (plain := self.plain_numbers(slot, value)) is not None:
            return plain
        values = []
        for i, item in enumerate(value):
            try:
                values.append(self.element(slot, item))
            except _Misfit as misfit:
                misfit.path.append(f"[{i}]")
                raise
        return values

    def plain_numbers(self, slot: FieldSpec, value: Sequence[Any]) -> list[object] | NumberArray | None:
        """A long list of numbers of one kind, checked all at once; None where it must be looked at one by one."""
        kind = slot.field.type
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
        if len(value) < _LONG_ARRAY:
            is_plain = bool(np.isfinite(wide).all()) and float(np.abs(wide).max()) < MAX_FLOAT32
            return round32_list(wide.tolist()) if is_plain else None  # type: ignore[return-value] # a list of objects
        with np.errstate(over="ignore"):
            narrow = wide.astype(np.float32)
        return narrow if np.array_equal(np.isinf(narrow), np.isinf(wide)) else None

    def numbers(self, slot: FieldSpec, value: NumberArray) -> list[object] | NumberArray:
        """A typed array; a long one stays an array, which all encoders take."""
        kind = slot.field.type
        is_float = kind in {"float32", "float64"}
        if not is_float and kind not in self.dialect.ints:
            raise _wrong_type(slot.field.full_type, [])
        _check_length(slot.field, len(value), "elements")
        if len(value) < _LONG_ARRAY:
            return self.array(slot, value.tolist())
        if is_float:
            with np.errstate(over="ignore"):  # it is looked for in the next line
                floats = value.astype(kind)
            if not np.array_equal(np.isfinite(floats), np.isfinite(value)):
                raise _wrong_value(kind, "a number that is out of its range")
            return floats
        low, high = self.dialect.ints[kind]
        if value.dtype.kind == "f" and not (np.isfinite(value).all() and (np.floor(value) == value).all()):
            raise _wrong_type(kind, 0.5)
        if int(value.min()) < low or int(value.max()) > high:
            raise _wrong_value(kind, f"a number out of its range ({low} to {high})")
        return value.astype(_DTYPES.get(kind, kind))

    def bytes(self, slot: FieldSpec, value: object) -> bytes:
        """Base64 (white space in it is harmless), numbers, or bytes from a binary encoding."""
        if isinstance(value, np.ndarray):
            numbers = self.numbers(slot, value)
            return numbers.astype(np.uint8).tobytes() if isinstance(numbers, np.ndarray) else bytes(numbers)  # type: ignore[arg-type] # checked to be integers
        if isinstance(value, (list, tuple)):
            return bytes(self.array(slot, value))  # type: ignore[arg-type] # its elements are checked to be integers
        if isinstance(value, str):
            try:
                value = msgspec.convert("".join(value.split()), bytes)
            except (msgspec.ValidationError, UnicodeEncodeError):
                raise _wrong_value(slot.field.full_type, "text that is not base64") from None
        if not isinstance(value, (bytes, bytearray, memoryview)):
            raise _wrong_type(slot.field.full_type, value)
        value = bytes(value)
        _check_length(slot.field, len(value), "bytes")
        return value

    def element(self, slot: FieldSpec, value: object) -> object:
        """A scalar field, or one element of an array."""
        kind = slot.field.type
        if slot.shape is not None:
            return self.message(slot.shape, value)
        if kind in {"float32", "float64"}:
            return _float(kind, value)
        if value is None:
            return slot.zero
        if kind in self.dialect.times:
            return self.time(kind, value)
        if kind in {"string", "wstring"}:
            return _text(slot.field, value)
        return _bool(value) if kind == "bool" else self.integer(slot, value)

    def integer(self, slot: FieldSpec, value: object) -> int:
        kind = slot.field.type
        if isinstance(value, str) and slot.is_numeral:
            value = _numeral(value)
        return _integer(kind, value, self.dialect.ints[kind])

    def time(self, kind: str, value: object) -> msgspec.Struct:
        """Two numbers in either spelling; a missing one is 0 and unknown keys mean nothing, as in rosbridge_suite."""
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
"""Greater numbers are not written out in an error text."""


def _numeral(text: str) -> int | str:
    """The number that a text ends in; the text itself when it ends in none."""
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


# float32

_MIN32 = 1.2e-38
"""A little above the least number that float32 holds with full precision."""


def round32(value: float) -> float:
    """The shortest decimal that stands for the same float32: what 0.1 was before it went through four bytes.

    Raises:
        OverflowError: the number is finite and float32 has none so large.
    """
    size = abs(value)
    if _MIN32 < size < MAX_FLOAT32:
        # Up to six digits come back from float32 as they went in.
        if float(f"{value:.6g}") == value:
            return value
        return float(orjson.dumps(np.float32(value), option=orjson.OPT_SERIALIZE_NUMPY))
    if size == 0 or not math.isfinite(value):
        return value
    if size >= MAX_FLOAT32:
        raise OverflowError("float32")
    return float(orjson.dumps(np.float32(value), option=orjson.OPT_SERIALIZE_NUMPY))


def round32_list(values: list[float]) -> list[float] | NumberArray:
    """`round32` of every element, all at once; the elements are finite. A long list becomes an array of float32.

    Raises:
        OverflowError: an element is too large.
    """
    if len(values) <= 2:  # noqa: PLR2004 - numpy's own cost is that of about three
        return [round32(value) for value in values]
    wide = np.array(values, np.float64)
    if wide.max() >= MAX_FLOAT32 or wide.min() <= -MAX_FLOAT32:
        raise OverflowError("float32")
    if len(values) >= _LONG_ARRAY:
        return wide.astype(np.float32)
    rounded: list[float] = orjson.loads(orjson.dumps(wide.astype(np.float32), option=orjson.OPT_SERIALIZE_NUMPY))
    return rounded

"""Decoding of the bytes that ROS 1 sends, the other way of `ros_serialization.py`.

A function is generated for each type. It makes the checked value at once: every sequence of bytes of the right length
is a valid value, so only lengths can be wrong. Fields of fixed size that follow each other are read by one call of
`struct`, nested messages included.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np

from rosbridge_sim.errors import FieldError, Reason
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.codegen import MAX_INLINE, MAX_STARRED, Source, code_of, count_fields
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec

MAX_OBJECTS: Final = 10_000
"""Most messages and texts within a message: reading them takes 20 ms. Numbers and bytes cost next to nothing."""

_MIN_ARRAY: Final = 100
"""Shorter lists of numbers are read faster by `struct` than by numpy."""

_Read = Callable[[bytes, int, list[int]], tuple[Any, int]]
"""`(data, at, room)`: returns the value and the position after it; `room` has the number of objects that may come."""


class RosReaders:
    """The decoders of the types of one store of ROS 1, each made at its first use."""

    def __init__(self) -> None:
        self._readers: dict[str, _Read] = {}

    def read(self, spec: MessageSpec, data: bytes) -> Struct:
        """Return the value of a message.

        Args:
            spec: its type, of ROS 1.
            data: all of its bytes.

        Raises:
            FieldError: the bytes are not a message of the type, or it has too many parts.
        """
        read = self._readers.get(spec.name) or self._reader(spec)
        try:
            value, end = read(data, 0, [MAX_OBJECTS])
        except struct.error:
            end = len(data) + 1
        if end != len(data):
            what = "end too early" if end > len(data) else f"are {end} and {len(data) - end} more"
            raise FieldError(f"{spec.name}: the bytes are not a message of this type: they {what}")
        return value

    def _reader(self, spec: MessageSpec) -> _Read:
        reader = self._readers.get(spec.name)
        if reader is None:
            reader = self._readers[spec.name] = _ReaderSource(self._reader).finish(spec)
        return reader


class _ReaderSource(Source):
    """Source of a decoder; it collects neighbouring fields of fixed size into one call of `struct`."""

    def __init__(self, nested: Callable[[MessageSpec], _Read]) -> None:
        super().__init__()
        self._nested = nested
        self._codes = ""
        self._targets: list[str] = []

    def finish(self, spec: MessageSpec) -> _Read:
        value = self.message(spec)
        self.end_run()
        self.line(f"return {value}, at")
        return self.build("data, at, room", f"reader of {spec.name}")

    def message(self, spec: MessageSpec) -> str:
        """Add the statements that read a message; return the expression of its value."""
        parts = [f"{one.attribute}={self.field(one, spec)}" for one in spec.fields.values()]
        return f"{self.bind('make', spec.struct_type)}({', '.join(parts)})"

    def field(self, field_spec: FieldSpec, spec: MessageSpec) -> str:
        definition = field_spec.definition
        if definition.array is not None:
            return self.array(field_spec, spec)
        if field_spec.nested is not None:
            if count_fields(field_spec.nested) <= MAX_INLINE:
                return self.message(field_spec.nested)
            return self.call(f"{self.bind('read', self._nested(field_spec.nested))}(data, at, room)")
        if definition.type in {"string", "wstring"}:
            return self.call("text(data, at)", text=_text)
        times = spec.dialect.times.get(definition.type)
        if times is not None:
            parts = [self.fixed(code_of(part)) for part in spec.dialect.time_parts[definition.type]]
            return f"{self.bind('time', times)}({', '.join(parts)})"
        return self.fixed(code_of(definition.type))

    def array(self, field_spec: FieldSpec, spec: MessageSpec) -> str:
        definition = field_spec.definition
        count = definition.count
        times = spec.dialect.times.get(definition.type)
        is_number = field_spec.nested is None and times is None and definition.type not in {"string", "wstring"}
        if is_number and 0 < count <= MAX_STARRED and not definition.is_bytes:
            code = code_of(definition.type)
            return f"[{', '.join([self.fixed(code) for _ in range(count)])}]"
        number = str(count) if count else self.fixed("I")
        if field_spec.nested is not None:
            read: Callable[..., Any] = partial(_list, self._nested(field_spec.nested))
        elif definition.type in {"string", "wstring"}:
            read = partial(_list, _text_in)
        elif times is not None:
            codes = "".join(code_of(part) for part in spec.dialect.time_parts[definition.type])
            layout = struct.Struct("<" + codes)
            read = partial(_times, (times, layout))
        else:
            read = _bytes if definition.is_bytes else partial(_numbers, code_of(definition.type))
        return self.call(f"{self.bind('many', read)}(data, at, room, {number})")

    def fixed(self, code: str) -> str:
        """Add a number to the run of such fields; return its name."""
        name = self.new("v")
        self._codes += code
        self._targets.append(name)
        return name

    def call(self, expression: str, **names: object) -> str:
        """Add the call of a function that returns a value and the next position; return the name of the value."""
        self.names.update(names)
        self.end_run()
        name = self.new("v")
        self.line(f"{name}, at = {expression}")
        return name

    def end_run(self) -> None:
        if self._targets:
            layout = struct.Struct("<" + self._codes)
            self.line(f"{', '.join(self._targets)}, = {self.bind('unpack', layout.unpack_from)}(data, at)")
            self.line(f"at += {layout.size}")
            self._codes, self._targets = "", []


_length = struct.Struct("<I").unpack_from


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Read a text; ROS 1 does not say its encoding, and does not check it."""
    (length,) = _length(data, at)
    return data[at + 4 : at + 4 + length].decode(errors="replace"), at + 4 + length


def _text_in(data: bytes, at: int, _room: list[int]) -> tuple[str, int]:
    return _text(data, at)


def _list(read: _Read, data: bytes, at: int, room: list[int], count: int) -> tuple[list[Any], int]:
    _spend(room, count)
    values = []
    for _ in range(count):
        value, at = read(data, at, room)
        values.append(value)
    return values, at


def _times(
    kind: tuple[type, struct.Struct], data: bytes, at: int, room: list[int], count: int
) -> tuple[list[Any], int]:
    _spend(room, count)
    make, layout = kind
    return [make(*layout.unpack_from(data, at + i * layout.size)) for i in range(count)], at + count * layout.size


def _bytes(data: bytes, at: int, _room: list[int], count: int) -> tuple[bytes, int]:
    return data[at : at + count], at + count


def _numbers(code: str, data: bytes, at: int, _room: list[int], count: int) -> tuple[Any, int]:
    end = at + count * struct.calcsize("<" + code)
    if end > len(data):
        raise struct.error
    if count < _MIN_ARRAY or code == "?":
        return list(struct.unpack_from(f"<{count}{code}", data, at)), end
    return np.frombuffer(data, "<" + code, count, at).copy(), end


def _spend(room: list[int], count: int) -> None:
    """Count the objects of a list before they are made.

    Raises:
        FieldError: there are too many.
    """
    room[0] -= count
    if room[0] < 0:
        why = f"expected at most {MAX_OBJECTS:,} messages and texts within a message; got more"
        raise FieldError(why, reason=Reason.TOO_MUCH)

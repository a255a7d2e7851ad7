"""Generation of Python source for one message type, as `cbor` and `ros_serialization` need it.

Both generate a function for each type that writes a value as a list of pieces, without a loop over field specs. Fields
of fixed size are packed together by one call of `struct`, nested messages included; text, arrays and the like are
pieces of their own. Of a definition only field names get into the source. The parser has matched them with
[A-Za-z_][A-Za-z0-9_]*.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.definitions.names import Generation

MAX_INLINE = 100
"""A nested message with at most so many fields is written in the function of the outer one. The longest message of the
standard packages has 49; without a bound, definitions that multiply would make endless functions."""

MAX_STARRED = 64
"""Arrays of a fixed length up to this are packed by a `struct` layout of their own."""

_MAX_PACKED = 100
"""Lists shorter than this are packed faster by `struct` than by numpy."""

_STRUCT_CODES = {
    "bool": "?",
    "char": "B",
    "float32": "f",
    "float64": "d",
    "int8": "b",
    "int16": "h",
    "int32": "i",
    "int64": "q",
} | {f"uint{bits}": code for bits, code in ((8, "B"), (16, "H"), (32, "I"), (64, "Q"))}

_BYTE_CODES: Mapping[Generation, str] = {1: "b", 2: "B"}
"""The letter of `byte`, which has a sign in ROS 1 alone."""


def code_of(kind: str, ros: Generation = 1) -> str:
    """Return the letter of `struct` and of numpy for a number type."""
    return _BYTE_CODES[ros] if kind == "byte" else _STRUCT_CODES[kind]


def pack_numbers(code: str, values: Any) -> bytes:  # noqa: ANN401 - a list or an array
    """Return the little-endian bytes of numbers; `code` is their letter."""
    if type(values) is list and len(values) < _MAX_PACKED:
        return struct.pack(f"<{len(values)}{code}", *values)
    return np.asarray(values, "<" + code).tobytes()


class Source:
    """The source of a function that appends pieces of bytes to a list `out`.

    Attributes:
        names: global names of the function, with their values.
    """

    def __init__(self) -> None:
        self.names: dict[str, object] = {}
        self._lines: list[str] = []
        self._pieces: list[str] = []
        self._count = 0

    def new(self, prefix: str) -> str:
        """Return a name that is not in use."""
        self._count += 1
        return f"{prefix}{self._count}"

    def bind(self, prefix: str, value: object) -> str:
        """Return a new global name for a value."""
        name = self.new(prefix)
        self.names[name] = value
        return name

    def keep(self, expression: str) -> str:
        """Return a local name for an expression that is used more than once."""
        name = self.new("v")
        self.line(f"{name} = {expression}")
        return name

    def line(self, text: str) -> None:
        """Add a statement. It runs before the waiting pieces are put out."""
        self._lines.append(text)

    def piece(self, expression: str) -> None:
        """Add an expression whose bytes come next; it waits for `flush`."""
        self._pieces.append(expression)

    def flush(self) -> None:
        """Add a statement that puts out the waiting pieces."""
        if self._pieces:
            self.line(f"out += ({', '.join(self._pieces)},)")
            self._pieces = []

    def build(self, arguments: str, label: str) -> Callable[..., Any]:
        """Return the generated function."""
        self.flush()
        source = f"def write({arguments}):\n" + "".join(f"    {line}\n" for line in self._lines or ["pass"])
        exec(compile(source, f"<{label}>", "exec"), self.names)  # noqa: S102 - see the head of this file
        function: Callable[..., Any] = self.names["write"]  # type: ignore[assignment] # made by the line above
        return function


def count_fields(spec: MessageSpec) -> int:
    """Count the fields of a message and of its nested messages outside arrays, up to just above `MAX_INLINE`."""
    total = 0
    for field_spec in spec.fields.values():
        is_inline = field_spec.nested is not None and field_spec.definition.array is None
        total += count_fields(field_spec.nested) if is_inline and field_spec.nested is not None else 1
        if total > MAX_INLINE:
            break
    return total

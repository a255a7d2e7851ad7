"""Python source that is written for one type: what `cbor` and `wire` have in common.

Both make a function for each type, without any loop over descriptions of fields, that writes a value as a list of
pieces. What has a fixed size is packed by one call of `struct` as far as it goes, nested messages included; only text,
arrays and the like are pieces of their own. Nothing of a definition gets into the source but field names, which the
parser has matched against [A-Za-z_][A-Za-z0-9_]*.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rosbridge_sim.schema.message_spec import MessageSpec
from rosbridge_sim.schema.names import Generation

__all__ = ["MAX_INLINE", "MAX_STARRED", "Source", "code_of", "count_fields", "pack_numbers"]

MAX_INLINE = 100
"""Fields of a nested message that are written in the function of the outer one; the longest of the standard packages
has 49, and definitions that multiply would make endless functions."""

MAX_STARRED = 64
"""Elements of an array of fixed length that are packed by a layout of their own."""

_MAX_PACKED = 100
"""Elements up to which `struct` is faster than numpy, from a list."""

_CODES = {
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
"""`byte` has a sign in ROS 1."""


def code_of(kind: str, ros: Generation = 1) -> str:
    """The letter of `struct`, and of numpy, for a number."""
    return _BYTE_CODES[ros] if kind == "byte" else _CODES[kind]


def pack_numbers(code: str, values: Any) -> bytes:  # noqa: ANN401 - a list or an array
    """The little-endian bytes of numbers."""
    if type(values) is list and len(values) < _MAX_PACKED:
        return struct.pack(f"<{len(values)}{code}", *values)
    return np.asarray(values, "<" + code).tobytes()


class Source:
    """The body of a function that appends pieces of bytes to a list `out`.

    Attributes:
        names: what the body refers to, by name.
    """

    def __init__(self) -> None:
        self.names: dict[str, object] = {}
        self._lines: list[str] = []
        self._pieces: list[str] = []
        self._count = 0

    def new(self, prefix: str) -> str:
        """A name that nobody has yet."""
        self._count += 1
        return f"{prefix}{self._count}"

    def bind(self, prefix: str, value: object) -> str:
        """A new name for a value."""
        name = self.new(prefix)
        self.names[name] = value
        return name

    def keep(self, expression: str) -> str:
        """A local name for what is asked for more than once."""
        name = self.new("v")
        self.line(f"{name} = {expression}")
        return name

    def line(self, text: str) -> None:
        """A statement; the pieces that wait are not out yet when it runs."""
        self._lines.append(text)

    def piece(self, expression: str) -> None:
        """An expression whose bytes come next."""
        self._pieces.append(expression)

    def flush(self) -> None:
        """A statement that puts out the pieces that wait."""
        if self._pieces:
            self.line(f"out += ({', '.join(self._pieces)},)")
            self._pieces = []

    def build(self, arguments: str, label: str) -> Callable[..., Any]:
        """The function; Any: a generated function of `arguments`, the last line of whose body may be a return."""
        self.flush()
        source = f"def write({arguments}):\n" + "".join(f"    {line}\n" for line in self._lines or ["pass"])
        exec(compile(source, f"<{label}>", "exec"), self.names)  # noqa: S102 - see above
        function: Callable[..., Any] = self.names["write"]  # type: ignore[assignment] # made by the line above
        return function


def count_fields(spec: MessageSpec) -> int:
    """The fields of a message and of all in it that are no arrays; no more than needed to know it is large."""
    total = 0
    for field_spec in spec.fields.values():
        is_inline = field_spec.nested is not None and field_spec.definition.array is None
        total += count_fields(field_spec.nested) if is_inline and field_spec.nested is not None else 1
        if total > MAX_INLINE:
            break
    return total

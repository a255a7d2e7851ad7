"""Values to CBOR (RFC 8949, typed arrays RFC 8746), by a function that is made once for each type.

The shape is the one that roslib decodes: maps with the wire's field names, floats always of 64 bits (NaN and
infinities kept), uint8[] and char[] as byte strings, other numeric arrays as a tag over little-endian bytes.
cbor2 was measured and turned down for this direction: it knows no numpy, wraps each array in an object, and writes NaN
as a half float, which roslib cannot read; the few head bytes that we need are written here.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import msgspec
import numpy as np

from rosbridge_sim.schema.check import Shape, Slot

__all__ = ["CborWriters", "head"]

_Write = Callable[[Any, list[bytes]], None]
"""Appends a value's bytes; Any: a generated struct, or what its field holds."""

_UNSIGNED, _NEGATIVE, _BYTES, _TEXT, _ARRAY, _MAP, _TAG = range(7)
"""The major types."""

_ARRAY_TAGS: Final = {
    "uint16": (69, "<u2"),
    "uint32": (70, "<u4"),
    "uint64": (71, "<u8"),
    "int8": (72, "i1"),
    "byte": (72, "i1"),
    "int16": (77, "<i2"),
    "int32": (78, "<i4"),
    "int64": (79, "<i8"),
    "float32": (85, "<f4"),
    "float64": (86, "<f8"),
}
"""Element type -> tag and numpy type; uint8 and char are byte strings."""

_FLOAT: Final = struct.Struct(">Bd")


def head(major: int, number: int) -> bytes:
    """The first bytes of an item: its major type and its number, length or count."""
    first = major << 5
    if number < 24:  # noqa: PLR2004 - the bounds are the RFC's
        return bytes((first | number,))
    for code, size in ((24, 1), (25, 2), (26, 4), (27, 8)):
        if number < 1 << 8 * size:
            return bytes((first | code,)) + number.to_bytes(size, "big")
    raise ValueError(f"{number} has more than 64 bits")


class CborWriters:
    """The writers of all types that were asked for; one for each store."""

    def __init__(self) -> None:
        self._writers: dict[str, _Write] = {}

    def encode(self, shape: Shape, value: msgspec.Struct) -> bytes:
        """The CBOR map of a value."""
        out: list[bytes] = []
        self.writer(shape)(value, out)
        return b"".join(out)

    def writer(self, shape: Shape) -> _Write:
        """The writer of a message type, made at its first use."""
        writer = self._writers.get(shape.name)
        if writer is None:
            writer = self._writers[shape.name] = _compile(shape, self.writer)
        return writer


def _compile(shape: Shape, nested: Callable[[Shape], _Write]) -> _Write:
    opening = head(_MAP, len(shape.slots))
    parts = [(_text(wire), slot.attribute, _writer(slot, shape, nested)) for wire, slot in shape.slots.items()]

    def write(value: Any, out: list[bytes]) -> None:  # noqa: ANN401 - a generated struct
        out.append(opening)
        for key, attribute, write_field in parts:
            out.append(key)
            write_field(getattr(value, attribute), out)

    return write


def _writer(slot: Slot, shape: Shape, nested: Callable[[Shape], _Write]) -> _Write:
    kind, is_array = slot.field.type, slot.field.array is not None
    if slot.shape is not None:
        write = nested(slot.shape)
    elif kind in shape.dialect.times:
        write = partial(_write_time, [_text(name) for name in shape.dialect.times[kind].__struct_fields__])
    elif kind == "bool":
        write = _write_bool
    elif kind in {"string", "wstring"}:
        write = _write_text
    elif kind in {"float32", "float64"}:
        write = _write_float
    else:
        write = _write_int
    if not is_array:
        return write
    if isinstance(slot.make(), bytes):
        return _write_bytes
    if kind in _ARRAY_TAGS:
        tag, dtype = _ARRAY_TAGS[kind]
        return partial(_write_numbers, head(_TAG, tag), np.dtype(dtype))
    return partial(_write_list, write)


def _text(value: str) -> bytes:
    data = value.encode()
    return head(_TEXT, len(data)) + data


def _write_text(value: str, out: list[bytes]) -> None:
    out.append(_text(value))


def _write_bool(value: bool, out: list[bytes]) -> None:  # noqa: FBT001 - it is the value
    out.append(b"\xf5" if value else b"\xf4")


def _write_float(value: float, out: list[bytes]) -> None:
    out.append(_FLOAT.pack(0xFB, value))


def _write_int(value: int, out: list[bytes]) -> None:
    out.append(head(_UNSIGNED, value) if value >= 0 else head(_NEGATIVE, -1 - value))


def _write_time(keys: list[bytes], value: msgspec.Struct, out: list[bytes]) -> None:
    out.append(head(_MAP, len(keys)))
    for key, part in zip(keys, msgspec.structs.astuple(value), strict=True):
        out.append(key)
        _write_int(part, out)


def _write_bytes(value: bytes, out: list[bytes]) -> None:
    data = bytes(value)
    out.append(head(_BYTES, len(data)) + data)


def _write_numbers(tag: bytes, dtype: np.dtype[Any], value: Any, out: list[bytes]) -> None:  # noqa: ANN401 - list or array
    data = np.asarray(value, dtype).tobytes()
    out.append(tag + head(_BYTES, len(data)) + data)


def _write_list(write: _Write, value: list[Any], out: list[bytes]) -> None:
    out.append(head(_ARRAY, len(value)))
    for element in value:
        write(element, out)

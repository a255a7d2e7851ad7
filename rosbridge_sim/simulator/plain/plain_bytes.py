"""Plain data as bytes and back: None, bool, int, float, str, bytes, list, tuple, dict and numpy arrays.

The format is our own, because bytes of a peer must be safe to decode: `pickle` runs code, and a library that trusts a
count can be made to allocate gigabytes. Here each value is one letter of its kind and its content:

    N, T, F      None, True, False
    i            int: number of bytes (1), the bytes, signed
    d            float: 8 bytes
    s, b         text (UTF-8) or bytes: length (4), content
    l, t, m      list, tuple, dict: number of items (4), the items; of a dict each key and its value
    a            array: letter of its type, number of axes (1), length of each axis (4), content in C order

All numbers are little-endian. A count is compared with the bytes that are left before anything is allocated, so bytes
of n cannot make more than n values. Equal values give equal bytes: a hash of the bytes is one of the value.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from rosbridge_sim.errors import DocumentError

PlainData: TypeAlias = Any  # the kinds that the head of this file names; checked while they are encoded

MAX_DEPTH: Final = 32
"""Nesting of lists, tuples and dicts: twice what our own state has, and far from Python's own limit."""

MAX_AXES: Final = 4
"""Axes of an array: our own have two."""

MAX_VALUES: Final = 500_000
"""Values in one: a full world of 20,000 objects with a name and a route each has 60,000, and 1,000 network settings
that wait have some 300 each. They take 0.25 s to read, and all clients wait meanwhile; 16 MiB of one letter each would
take 5 s."""

MAX_ITEMS: Final = 2**32
"""Product of the axes of an array that are not 0: more than any bytes hold, and within what numpy can shape."""

_KINDS: Final = {b"f": np.dtype("<f8"), b"i": np.dtype("<i8"), b"?": np.dtype(np.bool_)}
_LETTERS: Final = {kind: letter for letter, kind in _KINDS.items()}

_COUNT: Final = struct.Struct("<I")
_FLOAT: Final = struct.Struct("<d")


def encode(value: PlainData) -> bytes:
    """Return the bytes of a value.

    Args:
        value: plain data, see the head of this file.

    Raises:
        TypeError: it is something else, which is a bug of ours.
    """
    parts: list[bytes] = []
    _encode(value, parts, 0)
    return b"".join(parts)


def decode(data: bytes | memoryview, *, max_values: int = MAX_VALUES) -> PlainData:
    """Return the value of some bytes; arrays are copies that may be written.

    Args:
        data: from anywhere.
        max_values: most values in it; the items of an array, a text or bytes do not count.

    Raises:
        DocumentError: these are not the bytes of one value, or there are too many in it; the text says at which byte.
    """
    reader = _Reader(memoryview(data), max_values)
    value = reader.value(0)
    if reader.at != len(reader.data):
        raise reader.error("expected the end")
    return value


def _encode(value: PlainData, parts: list[bytes], depth: int) -> None:
    write = _WRITERS.get(type(value))
    if write is None:
        raise TypeError(f"{type(value).__name__} is no plain data: {value!r:.80}")
    if depth > MAX_DEPTH:
        raise TypeError(f"plain data is nested more than {MAX_DEPTH} times")
    write(value, parts, depth)


def _encode_int(value: int, parts: list[bytes], _depth: int) -> None:
    size = value.bit_length() // 8 + 1
    parts.append(b"i" + bytes([size]) + value.to_bytes(size, "little", signed=True))


def _encode_text(value: str, parts: list[bytes], _depth: int) -> None:
    text = value.encode("utf-8", "surrogatepass")
    parts += (b"s" + _COUNT.pack(len(text)), text)


def _encode_dict(value: dict[PlainData, PlainData], parts: list[bytes], depth: int) -> None:
    parts.append(b"m" + _COUNT.pack(len(value)))
    for key, item in value.items():
        _encode(key, parts, depth + 1)
        _encode(item, parts, depth + 1)


def _encode_items(value: list[PlainData] | tuple[PlainData, ...], parts: list[bytes], depth: int) -> None:
    parts.append((b"l" if isinstance(value, list) else b"t") + _COUNT.pack(len(value)))
    for item in value:
        _encode(item, parts, depth + 1)


def _encode_array(array: np.ndarray[Any, Any], parts: list[bytes], _depth: int) -> None:
    letter = _LETTERS.get(array.dtype)
    if letter is None or array.ndim > MAX_AXES:
        raise TypeError(f"an array of {array.dtype} with {array.ndim} axes is no plain data")
    axes = b"".join(map(_COUNT.pack, array.shape))
    parts += (b"a" + letter + bytes([array.ndim]) + axes, array.tobytes())


_WRITERS: Final[dict[type, Callable[[Any, list[bytes], int], None]]] = {
    type(None): lambda _value, parts, _depth: parts.append(b"N"),
    bool: lambda value, parts, _depth: parts.append(b"T" if value else b"F"),
    int: _encode_int,
    float: lambda value, parts, _depth: parts.append(b"d" + _FLOAT.pack(value)),
    str: _encode_text,
    bytes: lambda value, parts, _depth: parts.extend((b"b" + _COUNT.pack(len(value)), value)),
    np.ndarray: _encode_array,
    dict: _encode_dict,
    list: _encode_items,
    tuple: _encode_items,
}


class _Reader:
    """Values read from bytes, one after the other.

    Attributes:
        data: all bytes.
        at: the first one that has not been read.
        max_values: most values that are read.
        num_values: values read so far.
    """

    def __init__(self, data: memoryview, max_values: int) -> None:
        self.data = data
        self.at = 0
        self.max_values = max_values
        self.num_values = 0

    def error(self, expected: str) -> DocumentError:
        """Return the error for the byte that is read next."""
        return DocumentError(f"byte {self.at:,} of {len(self.data):,}: {expected}")

    def value(self, depth: int) -> PlainData:
        """Read a value that stands in so many others."""
        if depth > MAX_DEPTH:
            raise self.error(f"expected at most {MAX_DEPTH} levels")
        self.num_values += 1
        if self.num_values > self.max_values:
            raise self.error(f"expected at most {self.max_values:,} values")
        kind = bytes(self.take(1))
        read = _READERS.get(kind)
        if read is None:
            self.at -= 1
            raise self.error(f"expected the letter of a kind, got {kind!r}")
        return read(self, depth)

    def take(self, num: int) -> memoryview:
        """Read so many bytes."""
        end = self.at + num
        if end > len(self.data):
            raise self.error(f"expected {num:,} bytes more")
        taken = self.data[self.at : end]
        self.at = end
        return taken

    def count(self, item_size: int) -> int:
        """Read a number of items, each of which takes at least so many bytes."""
        count: int = _COUNT.unpack(self.take(_COUNT.size))[0]
        if count * item_size > len(self.data) - self.at:
            raise self.error(f"expected bytes for {count:,} items")
        return count

    def text(self) -> str:
        """Read a text behind its letter."""
        content = bytes(self.take(self.count(1)))
        try:
            return content.decode("utf-8", "surrogatepass")
        except UnicodeDecodeError:
            raise self.error("expected UTF-8 before this") from None

    def array(self) -> PlainData:
        """Read an array behind its letter."""
        kind = _KINDS.get(bytes(self.take(1)))
        num_axes = self.take(1)[0]
        if kind is None or num_axes > MAX_AXES:
            raise self.error("expected an array's type and number of axes before this")
        shape = [_COUNT.unpack(self.take(_COUNT.size))[0] for _ in range(num_axes)]
        content = self.take(math.prod(shape) * kind.itemsize)
        # An axis of 0 makes an array of no bytes, whatever the others are; numpy refuses lengths that are too large.
        if math.prod(filter(None, shape)) > MAX_ITEMS:
            raise self.error(f"expected an array's axes of at most {MAX_ITEMS:,} items before this")
        if kind == np.bool_ and bytes(content).translate(None, b"\x00\x01"):
            raise self.error("expected bytes 0 and 1 before this")
        return np.frombuffer(content, dtype=kind).reshape(shape).copy()

    def items(self, depth: int) -> PlainData:
        """Read a dict behind its letter."""
        found: dict[PlainData, PlainData] = {}
        for _ in range(self.count(2)):
            key = self.value(depth + 1)
            if not isinstance(key, (str, int)) or key in found:
                raise self.error("expected another text or number as a key before this")
            found[key] = self.value(depth + 1)
        return found


_READERS: Final[dict[bytes, Callable[[_Reader, int], PlainData]]] = {
    b"N": lambda _reader, _depth: None,
    b"T": lambda _reader, _depth: True,
    b"F": lambda _reader, _depth: False,
    b"i": lambda reader, _depth: int.from_bytes(reader.take(reader.take(1)[0]), "little", signed=True),
    b"d": lambda reader, _depth: _FLOAT.unpack(reader.take(_FLOAT.size))[0],
    b"s": lambda reader, _depth: reader.text(),
    b"b": lambda reader, _depth: bytes(reader.take(reader.count(1))),
    b"a": lambda reader, _depth: reader.array(),
    b"l": lambda reader, depth: [reader.value(depth + 1) for _ in range(reader.count(1))],
    b"t": lambda reader, depth: tuple([reader.value(depth + 1) for _ in range(reader.count(1))]),
    b"m": lambda reader, depth: reader.items(depth),
}

"""Encoding of values as CBOR (RFC 8949; typed arrays RFC 8746), by a function that is generated for each type.

The form is the one that roslib decodes: maps with the wire's field names, floats always of 64 bits (NaN and infinity
are kept), uint8[] and char[] as byte strings, other numeric arrays as a tag over little-endian bytes. cbor2 was
measured and is taken in this direction for unknown types alone: it does not know numpy, wraps each array in an object,
and writes NaN as a half float, which roslib cannot read. The few head bytes that are needed are written here.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import cbor2
import msgspec
import numpy as np

from rosbridge_sim.errors import EncodingError, FieldError
from rosbridge_sim.schema.codegen import MAX_INLINE, MAX_STARRED, Source, code_of, count_fields, pack_numbers
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec

_Write = Callable[[Any, list[bytes]], None]
"""`(value, out)`: appends the bytes of a value, which is a generated struct."""

_UNSIGNED, _NEGATIVE, _BYTES, _TEXT, _ARRAY, _MAP, _TAG = range(7)
"""The major types."""

_ARRAY_TAGS: Final = {"B": 64, "H": 69, "I": 70, "Q": 71, "b": 72, "h": 77, "i": 78, "q": 79, "f": 85, "d": 86}
"""The tags of little-endian arrays, by the letters of `struct` (RFC 8746, section 2)."""

_DTYPE_CODES: Final = {
    **{f"{kind}{2**i}": letter for kind, letters in (("u", "BHIQ"), ("i", "bhiq")) for i, letter in enumerate(letters)},
    "f2": "f",
    "f4": "f",
    "f8": "d",
}
"""The letter of `struct` for a numpy dtype, given by kind and bytes."""

_HEADS: Final = tuple(
    (struct.Struct(">B" + letter).pack, code, 1 << bits)
    for letter, code, bits in (("H", 25, 16), ("I", 26, 32), ("Q", 27, 64))
)
"""For each longer head: its packing function, the code of its length, and the first number that is too large."""

_FALSE, _TRUE = b"\xf4", b"\xf5"


def head(major: int, number: int) -> bytes:
    """Return the first bytes of an item.

    Args:
        major: the major type.
        number: the item's number, length or count.

    Raises:
        ValueError: the number has more than 64 bits.
    """
    first = major << 5
    if number < 24:  # noqa: PLR2004 - the bounds are the RFC's
        return bytes((first | number,))
    if number < 1 << 8:
        return bytes((first | 24, number))
    for layout, code, end in _HEADS:
        if number < end:
            return layout(first | code, number)
    raise ValueError(f"{number} has more than 64 bits")


def encode_plain(value: object) -> bytes:
    """Return the CBOR item of plain Python objects: all that JSON can hold, bytes, and arrays. For unknown types.

    Raises:
        FieldError: the value holds something else.
    """
    try:
        data: bytes = cbor2.dumps(value, default=_write_array)
        has_half_floats = _HALF_FLOAT.search(data) is not None
        return cbor2.dumps(value, default=_write_array, encoders=_DOUBLES) if has_half_floats else data
    except (cbor2.CBORError, ValueError, RecursionError) as error:
        raise FieldError(f"cannot be written as CBOR: {error}") from None


_HALF_FLOAT: Final = re.compile(rb"\xf9[\x7c\x7e\xfc]\x00")
"""NaN or infinity as the library writes it; bytes of doubles look so, too, once in five million."""


def _write_double(encoder: cbor2.CBOREncoder, value: float) -> None:
    encoder.write(struct.pack(">Bd", 0xFB, value))


_DOUBLES: Final[dict[type, Any]] = {float: _write_double}


class CborWriters:
    """The CBOR encoders of the types of one store, each made at its first use."""

    def __init__(self) -> None:
        self._writers: dict[str, _Write] = {}

    def encode(self, spec: MessageSpec, value: msgspec.Struct) -> bytes:
        """Return the CBOR map of a value.

        Args:
            value: a checked struct of the type.

        Raises:
            EncodingError: the value does not fit its type: a bug, because values are checked before.
        """
        out: list[bytes] = []
        try:
            (self._writers.get(spec.name) or self.writer(spec))(value, out)
        except (struct.error, ValueError, TypeError, OverflowError, AttributeError) as error:
            raise EncodingError(f"{spec.name}: cannot be written as CBOR: {error}") from error
        return b"".join(out)

    def writer(self, spec: MessageSpec) -> _Write:
        """Return the encoder of a message type."""
        writer = self._writers.get(spec.name)
        if writer is None:
            writer = self._writers[spec.name] = _compile(spec, self.writer)
        return writer


class _CborSource(Source):
    """Source of a CBOR encoder; it collects neighbouring constants and doubles into one call of `struct`."""

    def __init__(self, nested: Callable[[MessageSpec], _Write]) -> None:
        super().__init__()
        self.names.update(ints=_INT_ITEMS, text=_text, bools=_bools, texts=_texts, head=head)
        self._nested = nested
        self._run: list[bytes | str] = []

    def constant(self, data: bytes) -> None:
        """Add bytes that are always the same."""
        last = self._run[-1] if self._run else None
        if isinstance(last, bytes):
            self._run[-1] = last + data
        else:
            self._run.append(data)

    def double(self, expression: str) -> None:
        """Add a float of 64 bits."""
        self.constant(b"\xfb")
        self._run.append(expression)

    def piece(self, expression: str) -> None:
        self._end_run()
        super().piece(expression)

    def flush(self) -> None:
        self._end_run()
        super().flush()

    def _end_run(self) -> None:
        run, self._run = self._run, []
        if not run:
            return
        if len(run) == 1 and isinstance(run[0], bytes):
            super().piece(self.bind("c", run[0]))
            return
        layout = ">" + "".join(f"{len(item)}s" if isinstance(item, bytes) else "d" for item in run)
        parts = [self.bind("c", item) if isinstance(item, bytes) else item for item in run]
        super().piece(f"{self.bind('pack', struct.Struct(layout).pack)}({', '.join(parts)})")

    def message(self, spec: MessageSpec, value: str) -> None:
        """The map of a message that `value` stands for."""
        self.constant(head(_MAP, len(spec.fields)))
        for wire, field_spec in spec.fields.items():
            self.constant(_text(wire))
            item = f"{value}.{field_spec.attribute}"
            if field_spec.definition.array is not None:
                self.array(field_spec, spec, self.keep(item))
            elif field_spec.nested is None:
                self.scalar(field_spec.definition.type, spec, item)
            elif count_fields(field_spec.nested) <= MAX_INLINE:
                self.message(field_spec.nested, self.keep(item))
            else:
                self.flush()
                self.line(f"{self.bind('write', self._nested(field_spec.nested))}({item}, out)")

    def scalar(self, kind: str, spec: MessageSpec, item: str) -> None:
        if kind in {"float32", "float64"}:
            self.double(item)
        elif kind in {"string", "wstring"}:
            self.piece(f"text({item})")
        elif kind == "bool":
            names = self.bind("c", _TRUE), self.bind("c", _FALSE)
            self.piece(f"{names[0]} if {item} else {names[1]}")
        elif kind in spec.dialect.times:
            time = self.keep(item)
            parts = spec.dialect.times[kind].__struct_fields__
            self.constant(head(_MAP, len(parts)))
            for part in parts:
                self.constant(_text(part))
                self.piece(f"ints[{time}.{part}]")
        else:
            self.piece(f"ints[{item}]")

    def array(self, field_spec: FieldSpec, spec: MessageSpec, item: str) -> None:
        kind = field_spec.definition.type
        if field_spec.definition.is_bytes:
            data = self.keep(f"bytes({item})")
            self.piece(f"head({_BYTES}, len({data}))")
            self.piece(data)
        elif field_spec.nested is not None:
            self.piece(f"head({_ARRAY}, len({item}))")
            self.flush()
            self.line(f"for item in {item}: {self.bind('write', self._nested(field_spec.nested))}(item, out)")
        elif kind in spec.dialect.times:
            parts = spec.dialect.times[kind].__struct_fields__
            self.piece(f"{self.bind('times', partial(_times, parts))}({item})")
        elif kind in {"string", "wstring"}:
            self.piece(f"texts({item})")
        elif kind == "bool":
            self.piece(f"bools({item})")
        else:
            code = code_of(kind, spec.dialect.ros)
            self.constant(head(_TAG, _ARRAY_TAGS[code]))
            count = field_spec.definition.count
            if count and count <= MAX_STARRED:
                layout = struct.Struct(f"<{count}{code}")
                self.constant(head(_BYTES, layout.size))
                self.piece(f"{self.bind('pack', layout.pack)}(*{item})")
            else:
                self.piece(f"{self.bind('numbers', partial(_numbers, code))}({item})")


def _compile(spec: MessageSpec, nested: Callable[[MessageSpec], _Write]) -> _Write:
    source = _CborSource(nested)
    source.message(spec, "value")
    return source.build("value, out", f"cbor of {spec.name}")


class _Ints(dict[int, bytes]):
    """The bytes of integers: those of small ones are kept, others are made when they are asked for."""

    def __missing__(self, number: int) -> bytes:
        return head(_UNSIGNED, number) if number >= 0 else head(_NEGATIVE, -1 - number)


_INT_ITEMS: Final = _Ints()
_INT_ITEMS.update((number, _INT_ITEMS[number]) for number in range(-24, 256))

_TEXT_HEADS: Final = [head(_TEXT, length) for length in range(256)]


def _text(value: str) -> bytes:
    data = value.encode()
    return (_TEXT_HEADS[len(data)] if len(data) < len(_TEXT_HEADS) else head(_TEXT, len(data))) + data


def _texts(values: Sequence[str]) -> bytes:
    return b"".join([head(_ARRAY, len(values)), *map(_text, values)])


def _bools(values: Sequence[bool]) -> bytes:
    return b"".join([head(_ARRAY, len(values)), *(_TRUE if value else _FALSE for value in values)])


def _times(names: tuple[str, ...], values: Sequence[msgspec.Struct]) -> bytes:
    first, second = (head(_MAP, len(names)) + _text(names[0]), _text(names[1]))
    pairs = [msgspec.structs.astuple(value) for value in values]
    return head(_ARRAY, len(values)) + b"".join([first + _INT_ITEMS[a] + second + _INT_ITEMS[b] for a, b in pairs])


def _numbers(code: str, values: Any) -> bytes:  # noqa: ANN401 - a list or an array
    data = pack_numbers(code, values)
    return head(_BYTES, len(data)) + data


def _write_array(encoder: cbor2.CBOREncoder, value: object) -> None:
    """Write a typed array, as a hook of cbor2."""
    if not isinstance(value, np.ndarray):
        raise ValueError(f"{type(value)} is no JSON")  # noqa: TRY004 - as what else cannot be written
    code = _DTYPE_CODES[value.dtype.kind + str(value.dtype.itemsize)]
    encoder.encode(cbor2.CBORTag(_ARRAY_TAGS[code], pack_numbers(code, value)))

"""Encoding of values as the bytes that ROS itself sends: the serialization of ROS 1, and CDR of ROS 2.

Both are little-endian numbers one after the other; before text and arrays of any length stands their length. In CDR
each number is at a multiple of its size, text ends with a zero that is counted, and an empty message has one byte. A
function is generated for each type. The serializers of rosbags need dataclasses of their own, which alone takes twice
as long; the tests use them as reference.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import msgspec

from rosbridge_sim.errors import EncodingError, FieldError
from rosbridge_sim.schema.codegen import MAX_INLINE, MAX_STARRED, Source, code_of, count_fields, pack_numbers
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.definitions.names import Generation

_Write = Callable[..., Any]
"""`(value, out)`, or for CDR `(value, out, at)`, which returns the new position; the value is a struct."""

_ENCAPSULATION: Final = b"\0\1\0\0"
"""The four bytes before CDR: little-endian. Positions are counted from after them."""

_PADS: Final = [bytes(length) for length in range(8)]


class RosWriters:
    """The ROS encoders of the types of one store, each made at its first use.

    Args:
        ros: the generation whose bytes are written.
    """

    def __init__(self, ros: Generation) -> None:
        self._is_cdr = ros != 1
        self._writers: dict[str, _Write] = {}

    def serialize(self, spec: MessageSpec, value: msgspec.Struct) -> bytes:
        """Return the bytes of a value; CDR begins with its four bytes of encapsulation.

        Args:
            value: a checked struct of the type.

        Raises:
            FieldError: the bytes of the type differ between ROS 2 implementations.
            EncodingError: the value does not fit its type: a bug, because values are checked before.
        """
        write = self._writers.get(spec.name) or self._writer(spec)
        out: list[bytes] = []
        try:
            if self._is_cdr:
                out.append(_ENCAPSULATION)
                write(value, out, 0)
            else:
                write(value, out)
        except (struct.error, ValueError, TypeError, OverflowError, AttributeError) as error:
            raise EncodingError(f"{spec.name}: cannot be written as ROS does: {error}") from error
        return b"".join(out)

    def _writer(self, spec: MessageSpec) -> _Write:
        writer = self._writers.get(spec.name)
        if writer is None:
            source = _RosSource(self._writer, is_cdr=self._is_cdr)
            source.message(spec, "value")
            writer = self._writers[spec.name] = source.finish(spec)
        return writer


class _RosSource(Source):
    """Source of a ROS encoder; it collects neighbouring fields of fixed size into one call of `struct`.

    In CDR the layout of such a run depends on its start: there is one for each position modulo 8, and the function
    counts its position `at`.
    """

    def __init__(self, nested: Callable[[MessageSpec], _Write], *, is_cdr: bool) -> None:
        super().__init__()
        self.names["pads"] = _PADS
        self._nested = nested
        self._is_cdr = is_cdr
        self._run: list[tuple[int, str, str]] = []

    def finish(self, spec: MessageSpec) -> _Write:
        self.flush()
        if self._is_cdr:
            self.line("return at")
        return self.build("value, out, at" if self._is_cdr else "value, out", f"bytes of {spec.name}")

    # Pieces

    def fixed(self, code: str, expression: str) -> None:
        """Add one or more numbers of one type; `code` is the letter of `struct`, with a count before it."""
        self._run.append((struct.calcsize("<" + code[-1]), code, expression))

    def flush(self) -> None:
        self._end_run()
        super().flush()

    def data(self, expression: str, align: int = 1) -> None:
        """Add bytes of any length; `align` is the size of the numbers in them [bytes]."""
        self._end_run()
        if self._is_cdr:
            if align > 1:
                pad = self.keep(f"pads[-at & {align - 1}] if {expression} else b''")
                self.piece(pad)
                self.line(f"at += len({pad})")
            self.line(f"at += len({expression})")
        self.piece(expression)

    def call(self, function: str, expression: str) -> None:
        """Add a call of another encoder."""
        self.flush()
        self.line(f"at = {function}({expression}, out, at)" if self._is_cdr else f"{function}({expression}, out)")

    def _end_run(self) -> None:
        run, self._run = self._run, []
        if not run:
            return
        arguments = ", ".join(expression for _, _, expression in run)
        if not self._is_cdr:
            layout = struct.Struct("<" + "".join(code for _, code, _ in run))
            self.piece(f"{self.bind('pack', layout.pack)}({arguments})")
            return
        layouts = [_layout(run, start) for start in range(8)]
        pack, size = self.new("pack"), self.new("size")
        self.line(f"{pack}, {size} = {self.bind('layouts', [(one.pack, one.size) for one in layouts])}[at & 7]")
        self.line(f"at += {size}")
        self.piece(f"{pack}({arguments})")

    # Fields

    def message(self, spec: MessageSpec, value: str) -> None:
        """Add all fields of the message that the expression `value` stands for."""
        for field_spec in spec.fields.values():
            if self._is_cdr and spec.name == "std_msgs/Header" and field_spec.definition.name == "seq":
                continue  # a header of ROS 1, written for ROS 2
            item = f"{value}.{field_spec.attribute}"
            if field_spec.definition.array is not None:
                self.array(field_spec, spec, self.keep(item))
            elif field_spec.nested is None:
                self.scalar(field_spec.definition.type, spec, item)
            elif count_fields(field_spec.nested) <= MAX_INLINE:
                self.message(field_spec.nested, self.keep(item))
            else:
                self.call(self.bind("write", self._nested(field_spec.nested)), item)
        if not spec.fields and self._is_cdr:
            self.fixed("B", "0")

    def scalar(self, kind: str, spec: MessageSpec, item: str) -> None:
        if kind in {"string", "wstring"}:
            self._check_wide(kind, spec)
            text = self.keep(f"{item}.encode() + b'\\0'" if self._is_cdr else f"{item}.encode()")
            self.fixed("I", f"len({text})")
            self.data(text)
        elif kind in spec.dialect.times:
            time = self.keep(item)
            parts = zip(spec.dialect.times[kind].__struct_fields__, spec.dialect.time_parts[kind], strict=True)
            for name, part in parts:
                self.fixed(code_of(part), f"{time}.{name}")
        else:
            self.fixed(code_of(kind, spec.dialect.ros), item)

    def array(self, field_spec: FieldSpec, spec: MessageSpec, item: str) -> None:
        kind = field_spec.definition.type
        count = field_spec.definition.count
        is_number = field_spec.nested is None and kind not in {"string", "wstring", *spec.dialect.times}
        if is_number and 0 < count <= MAX_STARRED and not field_spec.definition.is_bytes:
            self.fixed(f"{count}{code_of(kind, spec.dialect.ros)}", f"*{item}")
            return
        if not count:
            self.fixed("I", f"len({item})")
        if field_spec.nested is not None:
            self.flush()
            write = self.bind("write", self._nested(field_spec.nested))
            self.line(f"for item in {item}: {'at = ' if self._is_cdr else ''}{write}(item, out{self._at})")
        elif kind in {"string", "wstring"}:
            self._check_wide(kind, spec)
            self.call(self.bind("texts", _cdr_texts if self._is_cdr else _texts), item)
        elif kind in spec.dialect.times:
            pack = struct.Struct("<" + "".join(code_of(part) for part in spec.dialect.time_parts[kind])).pack
            self.data(self.keep(f"{self.bind('times', partial(_times, pack))}({item})"), align=4)
        elif field_spec.definition.is_bytes or kind == "bool":
            self.data(self.keep(f"bytes({item})"))
        else:
            code = code_of(kind, spec.dialect.ros)
            numbers = self.bind("numbers", partial(pack_numbers, code))
            self.data(self.keep(f"{numbers}({item})"), align=struct.calcsize("<" + code))

    @property
    def _at(self) -> str:
        return ", at" if self._is_cdr else ""

    def _check_wide(self, kind: str, spec: MessageSpec) -> None:
        if kind == "wstring" and self._is_cdr:
            raise FieldError(f"{spec.name} has a wstring, whose bytes differ from one ROS 2 to the next")


def _layout(run: list[tuple[int, str, str]], start: int) -> struct.Struct:
    """Return the layout of a run that starts at a position, with the padding of CDR."""
    at = start
    codes = ["<"]
    for size, code, _ in run:
        pad = -at % size
        codes.append(f"{pad}x{code}")
        at += pad + struct.calcsize("<" + code)
    return struct.Struct("".join(codes))


def _times(pack: Callable[..., bytes], values: Sequence[msgspec.Struct]) -> bytes:
    return b"".join([pack(*msgspec.structs.astuple(value)) for value in values])


def _texts(values: Sequence[str], out: list[bytes]) -> None:
    for value in values:
        data = value.encode()
        out += (len(data).to_bytes(4, "little"), data)


def _cdr_texts(values: Sequence[str], out: list[bytes], at: int) -> int:
    for value in values:
        data = value.encode() + b"\0"
        pad = _PADS[-at & 3]
        out += (pad, len(data).to_bytes(4, "little"), data)
        at += len(pad) + 4 + len(data)
    return at

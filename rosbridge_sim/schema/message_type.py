"""Compiled types: they decode, check, fill and encode the values of a message type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import msgspec
import numpy as np
import orjson
import pybase64

from rosbridge_sim.long_text import MARK, LongBody, put_back
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import Record
from rosbridge_sim.schema.cbor import CborWriters
from rosbridge_sim.schema.complete_check import check
from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.json_text import parse_json
from rosbridge_sim.schema.late_list import LateList
from rosbridge_sim.schema.number_words import with_words
from rosbridge_sim.schema.ros_serialization import RosWriters
from rosbridge_sim.schema.skeleton import Skeleton
from rosbridge_sim.weight import claim

LongField: TypeAlias = tuple[str, memoryview]
"""Attribute of a field of bytes, and its long base64 text as it came."""

Finalize = Callable[[Any, int], None]
"""`(value, stamp_ns)`: completes a decoded value in place."""

REFUSALS = (msgspec.DecodeError, ValueError, OverflowError, RecursionError)
"""Errors of the fast decoder; bad UTF-8 is a ValueError."""

_CLAIMED: Final = 2**20
"""From this size on, memory for a body is claimed before it is decoded [bytes]: it may hold a text for which no memory
is left. Below, Python itself would fail as well."""

_COUNTED = 32 * 1024
"""From this size on, the elements of a body are counted before it is decoded [bytes]; a smaller one costs at most
20 ms."""


_LONG: Final = 2048
"""Bytes from which on base64 is made here: by vector instructions, which save 0.1 ms for a picture of 100 kB."""


class _LongBytes:
    """Bytes in a class that `msgspec` passes to our own hook."""

    def __init__(self, content: bytes) -> None:
        self.content = content


class JsonBytes(bytes):
    """Bytes that came from JSON. `msgspec` passes a class that it does not know to our own hook, which is faster.

    Attributes:
        base64: their base64 text as it came, if it is long; see `LongBody`.
    """

    base64: memoryview | None = None


def _encode_other(value: object) -> object:
    """Encode what `msgspec` does not know: our bytes, lists that are made late, and numpy's arrays and scalars."""
    if isinstance(value, LateList):
        return value.items
    if isinstance(value, (JsonBytes, _LongBytes)):
        content = value if isinstance(value, bytes) else value.content
        return msgspec.Raw(b"".join((b'"', pybase64.b64encode(content), b'"')))
    if isinstance(value, np.ndarray) and value.dtype == np.uint8:
        return value.tobytes()
    if isinstance(value, (np.ndarray, np.generic)):
        return msgspec.Raw(
            orjson.dumps(np.ascontiguousarray(value) if value.ndim else value, option=orjson.OPT_SERIALIZE_NUMPY)
        )
    raise TypeError(f"{type(value)} is no value of a field")


_encode = msgspec.json.Encoder(enc_hook=_encode_other).encode


class MessageType:
    """A message type: it decodes, checks, fills and encodes its values.

    Attributes:
        name: `pkg/Type`.
        definition: the parsed definition.
        encode_json: returns the JSON text of a value: NaN and infinity are `null`, bytes are base64, numpy arrays are
            lists.
        struct_type: the class of its values; it takes the fields by keyword and fills in the defaults.
        spec: the fields as tables, for `complete_check.check`.

    Args:
        encoders: shared by the types of one store.
    """

    __slots__ = (
        "_bytes",
        "_compiled",  # of a LateMessageType, whose memory must have the same layout
        "_decode",
        "_encoders",
        "_finalize",
        "_skeleton",
        "definition",
        "encode_json",
        "name",
        "spec",
        "struct_type",
    )

    def __init__(self, spec: MessageSpec, encoders: Encoders) -> None:
        self.name = spec.name
        self.definition = spec.definition
        self.struct_type = spec.struct_type
        self.spec = spec
        self._finalize = spec.finalize
        self._skeleton: Skeleton | None = None
        self._encoders = encoders
        self._decode = msgspec.json.Decoder(spec.struct_type).decode
        kinds = spec.fields.values()
        self._bytes = [each.attribute for each in kinds if each.definition.is_bytes and not each.definition.array]
        self.encode_json: Callable[[Any], bytes] = self._encode_bytes if self._bytes else _encode

    def __repr__(self) -> str:
        return f"MessageType({self.name})"

    def decode_json(self, body: bytes | msgspec.Raw, stamp_ns: int) -> Struct:
        """Return the checked and filled value of a JSON body.

        Args:
            body: the text of one JSON object.
            stamp_ns: the time for headers without a stamp [ns].

        Raises:
            FieldError: the body is no JSON, or does not fit the type.
            MemoryError: there is not enough memory for it.
        """
        try:
            if len(body) >= _COUNTED:
                if body.__class__ is LongBody:
                    value = self._decode_long(body, stamp_ns)
                    if value is not None:
                        return value
                self._count(body)
            value = self._decode(body)
            if self._finalize is not None:
                self._finalize(value, stamp_ns)
        except REFUSALS as refusal:
            return self.check(parse_json(self.name, body, refusal), stamp_ns)
        return value

    def _decode_long(self, body: LongBody, stamp_ns: int) -> Struct | None:
        """Return the value of a body with a long text, if that is the content of a field of bytes; else None."""
        try:
            value = self._decode(body.short)
            attribute = self.put_long(value, body.data, stamp_ns)
        except REFUSALS:
            return None  # the usual way finds the mistake, and words it
        if attribute is None:
            return None
        content = JsonBytes(body.data)
        content.base64 = body.base64
        setattr(value, attribute, content)
        return value

    def put_long(self, value: Struct, content: bytes, stamp_ns: int) -> str | None:
        """Put the content of a long text into the field that has the mark in its place, and complete the value.

        Args:
            value: decoded, but not completed.
            content: what the text says in base64.

        Returns:
            The attribute of the field; None if no field of bytes of any number has the mark: the value is as before.

        Raises:
            ValueError, OverflowError: another field does not fit the type.
        """
        for attribute in self._bytes:
            if getattr(value, attribute) == MARK:
                setattr(value, attribute, content)
                assert self._finalize is not None, "it has a field of bytes"
                self._finalize(value, stamp_ns)
                return attribute
        return None

    def _count(self, body: bytes | msgspec.Raw) -> None:
        """Raise FieldError for a long body that would cost too much, and MemoryError if there is no memory for it."""
        if len(body) > _CLAIMED:
            claim(len(body))
        if self._skeleton is None:
            self._skeleton = Skeleton(self.spec)
        self._skeleton.check(self.name, body)

    def check(self, value: object, stamp_ns: int, root: str | None = None) -> Struct:
        """Return the checked and filled value of a body that is given as Python objects; see `complete_check.check`.

        Raises:
            FieldError: the body does not fit the type.
        """
        return check(self.spec, value, stamp_ns, root)

    def _encode_bytes(self, value: Struct) -> bytes:
        """Return the JSON text of a value that has fields of bytes."""
        for attribute in self._bytes:
            content = getattr(value, attribute)
            if len(content) >= _LONG and content.__class__ is bytes:
                value = msgspec.structs.replace(value, **{attribute: _LongBytes(content)})
        return _encode(value)

    def encode_json_parts(self, value: Struct, long_field: LongField | None = None) -> tuple[bytes | memoryview, ...]:
        """Return the same text in parts, end to end: a long base64 text that came so is not made again.

        Args:
            long_field: a field of bytes with its base64 text as it came.
        """
        if long_field is None:
            texts = ((attribute, getattr(getattr(value, attribute), "base64", None)) for attribute in self._bytes)
            long_field = next(((attribute, text) for attribute, text in texts if text is not None), None)
        if long_field is not None:
            attribute, base64 = long_field
            parts = put_back(_encode(msgspec.structs.replace(value, **{attribute: MARK})), base64)
            if parts is not None:
                return parts
        return (self.encode_json(value),)

    def encode_with_words(self, value: Struct, text: bytes) -> bytes:
        """Return the JSON text of a value with `NaN`, `Infinity` and `-Infinity` in place of `null`; see `with_words`.

        Args:
            text: its JSON text, which is returned if all numbers are finite.
        """
        if not self.spec.has_floats or b"null" not in text:
            return text
        changed = with_words(self.spec, value)
        return text if changed is value else _encode(changed)

    def encode_cbor(self, value: Struct) -> bytes:
        """Return the CBOR map of a value: NaN and infinity are kept, numeric arrays are typed arrays."""
        return self._encoders.cbor.encode(self.spec, value)

    def encode_raw(self, value: Struct) -> bytes:
        """Return the bytes that ROS itself sends: those of ROS 1, or CDR after its four bytes of encapsulation."""
        return self._encoders.ros.serialize(self.spec, value)

    def default(self) -> Struct:
        """Return a value whose fields all have their defaults."""
        return self.struct_type()


_COMPILED: Final = frozenset(MessageType.__slots__) - {"_compiled", "_encoders", "name"}
"""The slots that are set when a type is compiled."""


class LateMessageType(MessageType):
    """A message type that is compiled when it is first used: a server has 270 types, and most clients use ten.

    With its first use it becomes a `MessageType`. A class that always has `__getattr__`, or properties in place of the
    slots, would make each message dearer.

    Args:
        name: `pkg/Type`.
        compiled: returns the fields as tables, always the same ones.
        encoders: shared by the types of one store.
    """

    __slots__ = ()

    def __init__(self, name: str, compiled: Callable[[], MessageSpec], encoders: Encoders) -> None:
        self.name = name
        self._compiled = compiled
        self._encoders = encoders

    def __getattr__(self, attribute: str) -> object:
        """Compile the type; Python calls this for the slots that are not set yet."""
        if attribute not in _COMPILED:
            raise AttributeError(f"{type(self).__name__} has no attribute {attribute!r}")
        MessageType.__init__(self, self._compiled(), self._encoders)
        self.__class__ = MessageType  # type: ignore[assignment] # the base class has the same layout
        return getattr(self, attribute)


class Encoders:
    """The encoders besides JSON that the types of one store share.

    Attributes:
        cbor: writes CBOR.
        ros: writes the bytes of ROS itself.

    Args:
        ros: the generation whose bytes are written.
    """

    def __init__(self, ros: Generation = 1) -> None:
        self.cbor = CborWriters()
        self.ros = RosWriters(ros)


class ServiceType(Record):
    """A service type: two message types, `<name>Request` and `<name>Response`."""

    name: str
    request: MessageType
    response: MessageType


class ActionType(Record):
    """An action type: three message types, `<name>Goal`, `<name>Result` and `<name>Feedback`."""

    name: str
    goal: MessageType
    result: MessageType
    feedback: MessageType

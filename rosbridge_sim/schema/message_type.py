"""Compiled types: they decode, check, fill and encode the values of a message type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import msgspec
import numpy as np
import orjson
import pybase64

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.cbor import CborWriters
from rosbridge_sim.schema.json_text import parse_json
from rosbridge_sim.schema.message_spec import MessageSpec
from rosbridge_sim.schema.names import Generation
from rosbridge_sim.schema.ros_serialization import RosWriters
from rosbridge_sim.schema.skeleton import Skeleton
from rosbridge_sim.schema.validate import check
from rosbridge_sim.weight import claim

__all__ = ["REFUSALS", "ActionType", "Encoders", "Finalize", "JsonBytes", "MessageType", "ServiceType"]

Finalize = Callable[[Any, int], None]
"""`(value, stamp_ns)`: finishes a decoded value in place."""

REFUSALS = (msgspec.DecodeError, ValueError, OverflowError, RecursionError)
"""What the fast way may raise; bad UTF-8 is a ValueError."""

_CLAIMED: Final = 2**20
"""A body from here on may hold a text for which no memory is left [bytes]; below, Python itself has hardly any more."""

_COUNTED = 32 * 1024
"""The elements of a body from here on are counted before it is decoded [bytes]; less costs 20 ms at most."""


class MessageType:
    """A message type: checks, fills and encodes its values. Made by `compile_message`, once for each type.

    Attributes:
        name: `pkg/Type`.
        definition: what it was made from.
        struct_type: the class of its values; takes the fields by keyword and fills in the defaults.
        spec: the same as the slow rules see it.
    """

    __slots__ = ("_decode", "_encoders", "_finalize", "_skeleton", "definition", "name", "spec", "struct_type")

    def __init__(self, spec: MessageSpec, encoders: Encoders) -> None:
        self.name = spec.name
        self.definition = spec.definition
        self.struct_type = spec.struct_type
        self.spec = spec
        self._finalize = spec.finalize
        self._skeleton: Skeleton | None = None
        self._encoders = encoders
        self._decode = msgspec.json.Decoder(spec.struct_type).decode

    def __repr__(self) -> str:
        return f"MessageType({self.name})"

    @property
    def finalize(self) -> Finalize | None:
        """What is left to do on a decoded value, `(value, stamp_ns)`; None where nothing is."""
        return self._finalize

    def decode_json(self, body: bytes | msgspec.Raw, stamp_ns: int) -> Struct:
        """The checked and filled value of a JSON body.

        Args:
            body: the text of one JSON object.
            stamp_ns: the time that headers without a stamp get [ns].

        Raises:
            FieldError: it is no JSON, or does not fit the type.
            MemoryError: there is none for it.
        """
        try:
            if len(body) >= _COUNTED:
                self._count(body)
            value = self._decode(body)
            if self._finalize is not None:
                self._finalize(value, stamp_ns)
        except REFUSALS as refusal:
            return self.check(parse_json(self.name, body, refusal), stamp_ns)
        return value

    def _count(self, body: bytes | msgspec.Raw) -> None:
        """Refuse a long body that stands for too much, or for which there is no memory."""
        if len(body) > _CLAIMED:
            claim(len(body))
        if self._skeleton is None:
            self._skeleton = Skeleton(self.spec)
        self._skeleton.check(self.name, body)

    def check(self, value: object, stamp_ns: int, root: str | None = None) -> Struct:
        """The checked and filled value of a body that is there as Python objects; see `check.check`.

        Raises:
            FieldError: it does not fit the type.
        """
        return check(self.spec, value, stamp_ns, root)

    def encode_json(self, value: Struct) -> bytes:
        """The JSON text of a value; NaN and infinity are `null`, bytes are base64, numpy arrays are lists."""
        return _encode(value)

    def encode_cbor(self, value: Struct) -> bytes:
        """The CBOR map of a value: NaN and infinity stay, numeric arrays are typed arrays."""
        return self._encoders.cbor.encode(self.spec, value)

    def encode_raw(self, value: Struct) -> bytes:
        """The bytes that ROS itself sends: ROS 1's, or CDR with its four bytes in front."""
        return self._encoders.ros.serialize(self.spec, value)

    def default(self) -> Struct:
        """A value whose fields all have their defaults."""
        return self.struct_type()


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


@dataclass(frozen=True, slots=True)
class ServiceType:
    """A service type: two message types, `<name>Request` and `<name>Response`."""

    name: str
    request: MessageType
    response: MessageType


@dataclass(frozen=True, slots=True)
class ActionType:
    """An action type: three message types, `<name>Goal`, `<name>Result` and `<name>Feedback`."""

    name: str
    goal: MessageType
    result: MessageType
    feedback: MessageType


class JsonBytes(bytes):
    """Bytes that came from JSON; `msgspec` leaves the writing of a class that it does not know to us."""

    __slots__ = ()


def _encode_other(value: object) -> object:
    """What `msgspec` does not know: our bytes, and numpy's arrays and scalars, which the world's own code may use."""
    if isinstance(value, JsonBytes):
        return msgspec.Raw(b'"' + pybase64.b64encode(value) + b'"')
    if isinstance(value, np.ndarray) and value.dtype == np.uint8:
        return value.tobytes()
    if isinstance(value, (np.ndarray, np.generic)):
        return msgspec.Raw(
            orjson.dumps(np.ascontiguousarray(value) if value.ndim else value, option=orjson.OPT_SERIALIZE_NUMPY)
        )
    raise TypeError(f"{type(value)} is no value of a field")


_encode = msgspec.json.Encoder(enc_hook=_encode_other).encode

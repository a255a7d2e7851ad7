"""Encoding of ops as frames with JSON text, around message bodies that are encoded already."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Protocol, TypeVar

import orjson

from rosbridge_sim.printable import printable
from rosbridge_sim.protocol.ops import Id

T = TypeVar("T")


class Encoded(Protocol):
    """A message whose encodings are made once and shared by all subscribers."""

    @property
    def text_length(self) -> int:
        """Length of the text from which the message was decoded, if that was long [bytes]; else 0."""

    @property
    def num_bytes(self) -> int:
        """Estimated memory of the message [bytes]."""

    @property
    def json(self) -> bytes:
        """The body as JSON text."""

    @property
    def cbor(self) -> bytes:
        """The body as a CBOR map, numeric arrays as typed arrays."""

    @property
    def raw(self) -> bytes:
        """The body in ROS's own serialization: ROS 1 bytes, or CDR with its header of four bytes."""

    def framed(self, head: bytes) -> bytes:
        """Return `head`, the body as JSON text and a closing brace. The last result is kept for the next subscriber.

        Args:
            head: from `publish_head`.
        """

    def shared(self, key: object, make: Callable[[], T]) -> T:
        """Return the result of `make`, which is called only once for each key."""


def publish_head(topic: str) -> bytes:
    """Return the start of a JSON data message, up to its body.

    Args:
        topic: name of the topic as the subscriber spells it.
    """
    return b'{"op":"publish","topic":' + orjson.dumps(topic) + b',"msg":'


def call_head(service: str) -> bytes:
    """Return the start of a call to a provider, up to its id.

    Args:
        service: name of the service as the provider spells it.
    """
    return b'{"op":"call_service","service":' + orjson.dumps(service) + b',"id":'


def response_frame(service: str, values: bytes, *, is_ok: bool, op_id: Id) -> bytes:
    """Return the answer to a call. It has an `id` only if the call had one.

    Args:
        service: name of the service as the caller spelt it.
        values: JSON text of the response, or of the reason for a failure.
        is_ok: `result` of the answer.
    """
    tail = b"}" if op_id is None else b',"id":' + _encode_id(op_id) + b"}"
    result = b',"result":true' if is_ok else b',"result":false'
    # Joined, because each `+` would copy the values once more.
    return b"".join(
        (b'{"op":"service_response","service":', orjson.dumps(service), b',"values":', values, result, tail)
    )


def op_frame(op: str, bodies: Mapping[str, bytes], **fields: object) -> bytes:
    """Return the frame of any op.

    Args:
        bodies: message bodies as JSON text, by field name.
        fields: other fields; those that are None are left out.
    """
    parts = [b'{"op":' + orjson.dumps(op)]
    for name, value in fields.items():
        if value is not None:
            parts.append(orjson.dumps(name) + b":" + (_encode_id(value) if name == "id" else orjson.dumps(value)))
    parts += [orjson.dumps(name) + b":" + body for name, body in bodies.items()]
    return b",".join(parts) + b"}"


def status_frame(level: str, text: str, op_id: object) -> bytes:
    """Return a status frame. Half surrogate pairs in the text are escaped.

    Args:
        level: `info`, `warning` or `error`.
    """
    return op_frame("status", {}, level=level, msg=printable(text), id=op_id)


def _encode_id(op_id: object) -> bytes:
    """Return an id as JSON. The standard library is used because it writes integers of any size."""
    return orjson.dumps(op_id) if isinstance(op_id, str) else json.dumps(op_id).encode()

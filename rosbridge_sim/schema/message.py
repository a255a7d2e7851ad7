"""One value of a message type, and its encodings, each made once and shared."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import msgspec

from rosbridge_sim.errors import EncodingError, PeerError
from rosbridge_sim.long_text import LEAST
from rosbridge_sim.schema.message_type import LongField, MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.schema.sizes import size_of

T = TypeVar("T")


class Message(msgspec.Struct, eq=False):
    """One value of a message type. Each encoding is made at most once, for any number of listeners.

    It is a struct of `msgspec` because one is made for each message, four times as fast as an object of Python.

    Attributes:
        type: its type.
        value: a struct of the type, or a plain object of an unknown type; it must not change any more.
        text_length: length of the JSON text that it was decoded from [bytes]; 0 if it was made here, or is short.
        long_field: a field of bytes with its base64 text as it came, if that is long.
    """

    type: MessageType | OpaqueType
    value: Any
    text_length: int = 0
    long_field: LongField | None = None
    _size: int = 0
    _json: bytes | None = None
    _cbor: bytes | None = None
    _raw: bytes | None = None
    _head: bytes = b""
    _framed: bytes = b""
    _shared: dict[object, Any] | None = None
    _failures: dict[str, EncodingError] | None = None

    @property
    def num_bytes(self) -> int:
        """An estimate of the memory that it takes [bytes]."""
        if not self._size:
            self._size = size_of(self.value, self.text_length)
        return self._size

    @property
    def json(self) -> bytes:
        """The JSON text of the value.

        Raises:
            EncodingError: the value cannot be written.
        """
        if self._json is None:
            is_long = self.text_length >= LEAST
            self._json = b"".join(self._parts()) if is_long else self._write("JSON", self.type.encode_json)
        return self._json

    @property
    def json_with_words(self) -> bytes:
        """The JSON text with `NaN`, `Infinity` and `-Infinity` in place of `null`; `json` if all numbers are finite.

        Raises:
            EncodingError: the value cannot be written.
        """
        text = self.json
        return self.shared("words", lambda: self.type.encode_with_words(self.value, text))

    @property
    def cbor(self) -> bytes:
        """The value as a CBOR map.

        Raises:
            FieldError: the type is unknown, and CBOR cannot hold the value.
            EncodingError: the value cannot be written.
        """
        if self._cbor is None:
            self._cbor = self._write("CBOR", self.type.encode_cbor)
        return self._cbor

    @property
    def raw(self) -> bytes:
        """The bytes that ROS itself sends: those of ROS 1, or CDR.

        Raises:
            FieldError: the type is unknown, so its bytes are unknown too.
            EncodingError: the value cannot be written.
        """
        if self._raw is None:
            self._raw = self._write("cbor-raw", self.type.encode_raw)
        return self._raw

    def _write(self, encoding: str, encode: Callable[[Any], T]) -> T:
        """Return the value in an encoding. A failed one is not tried again for other listeners.

        Raises:
            PeerError: the error of `encode`.
            EncodingError: `encode` has failed, now or before.
        """
        failures = self._failures
        failure = None if failures is None else failures.get(encoding)
        if failure is None:
            try:
                return encode(self.value)
            except EncodingError as error:
                failure = error
            except PeerError:
                raise
            except Exception as error:  # noqa: BLE001 - any bug of ours or of a library
                failure = EncodingError(f"{self.type.name}: cannot be written as {encoding}: {error!r:.200}")
                failure.__cause__ = error
            self._failures = {**(failures or {}), encoding: failure}
        raise EncodingError(str(failure)) from failure.__cause__

    def framed(self, head: bytes) -> bytes:
        """Return `head`, the JSON text, and a closing brace; kept for the next listener.

        Raises:
            EncodingError: the value cannot be written.
        """
        if head != self._head:
            if self.text_length < LEAST:
                json = self._json
                if json is None:
                    json = self._json = self._write("JSON", self.type.encode_json)
                self._framed = b"".join((head, json, b"}"))
            else:
                self._framed = b"".join((head, *self._parts(), b"}"))
            self._head = head
        return self._framed

    def _parts(self) -> tuple[bytes | memoryview, ...]:
        """Return the JSON text in parts. See `framed`.

        Raises:
            EncodingError: the value cannot be written.
        """
        if self._json is not None:
            return (self._json,)
        return self._write("JSON", partial(self.type.encode_json_parts, long_field=self.long_field))

    def shared(self, key: object, make: Callable[[], T]) -> T:
        """Return `make()`, made once for each key: a form of the message that several listeners want.

        Args:
            make: makes it at the first call.

        Raises:
            EncodingError: `make` has failed.
        """
        if self._shared is None:
            self._shared = {}
        if key not in self._shared:
            try:
                self._shared[key] = make()
            except Exception as error:
                raise EncodingError(f"{self.type.name}: cannot be written: {error!r:.200}") from error
        made: T = self._shared[key]
        return made

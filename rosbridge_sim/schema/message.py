"""One value of a message type, and its encodings, each made once and shared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from rosbridge_sim.errors import EncodingError, PeerError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.schema.sizes import size_of

__all__ = ["Message"]

T = TypeVar("T")


class Message:
    """One value of a type, encoded at most once however many listeners it has.

    Attributes:
        type: its type.
        value: a struct of it, or the bare object of an unknown type; not changed any more.
        text_length: of the JSON text that it was decoded from [bytes]; 0 for one that was made here, or is short.

    Args:
        message_type: its type.
        value: see above.
        text_length: of the JSON text that it was decoded from, if it was [bytes].
    """

    __slots__ = (
        "_cbor",
        "_failures",
        "_framed",
        "_head",
        "_json",
        "_raw",
        "_shared",
        "_size",
        "text_length",
        "type",
        "value",
    )

    def __init__(self, message_type: MessageType | OpaqueType, value: Struct, text_length: int = 0) -> None:
        self._size = 0
        self.text_length = text_length
        self.type = message_type
        self.value = value
        self._json: bytes | None = None
        self._cbor: bytes | None = None
        self._raw: bytes | None = None
        self._head = b""
        self._framed = b""
        self._shared: dict[object, Any] | None = None
        self._failures: dict[str, EncodingError] | None = None

    @property
    def num_bytes(self) -> int:
        """An estimate of what holding it costs [bytes]."""
        if not self._size:
            self._size = size_of(self.value, self.text_length)
        return self._size

    @property
    def json(self) -> bytes:
        """The JSON text of the value.

        Raises:
            EncodingError: it cannot be written.
        """
        if self._json is None:
            self._json = self._write("JSON", self.type.encode_json)
        return self._json

    @property
    def cbor(self) -> bytes:
        """The value as a CBOR map.

        Raises:
            FieldError: the type is unknown here, and CBOR has nothing for the value.
            EncodingError: it cannot be written.
        """
        if self._cbor is None:
            self._cbor = self._write("CBOR", self.type.encode_cbor)
        return self._cbor

    @property
    def raw(self) -> bytes:
        """The value as ROS itself sends it: ROS 1 bytes, or CDR.

        Raises:
            FieldError: the type is unknown here, so its bytes are too.
            EncodingError: it cannot be written.
        """
        if self._raw is None:
            self._raw = self._write("cbor-raw", self.type.encode_raw)
        return self._raw

    def _write(self, encoding: str, encode: Callable[[Any], bytes]) -> bytes:
        """The value in an encoding. One that has failed is not tried again: a thousand listeners would each pay for it.

        Raises:
            PeerError: what `encode` says.
            EncodingError: `encode` has failed, now or before.
        """
        failure = None if self._failures is None else self._failures.get(encoding)
        if failure is None:
            try:
                return encode(self.value)
            except EncodingError as error:
                failure = error
            except PeerError:
                raise
            except Exception as error:  # noqa: BLE001 - a bug of ours or of a library, whatever it is
                failure = EncodingError(f"{self.type.name}: cannot be written as {encoding}: {error!r:.200}")
                failure.__cause__ = error
            self._failures = {**(self._failures or {}), encoding: failure}
        raise EncodingError(str(failure)) from failure.__cause__

    def framed(self, head: bytes) -> bytes:
        """`head`, the JSON text, and a closing brace; kept for the next listener, who mostly wants the same."""
        if head != self._head:
            self._framed = b"".join((head, self.json, b"}"))
            self._head = head
        return self._framed

    def shared(self, key: object, make: Callable[[], T]) -> T:
        """Return what `make` gives, made once for all who ask with this key: a form in which some listeners want it.

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

"""Compressed messages (permessage-deflate, RFC 7692), inflated slice by slice.

16 kB can inflate to 16 MB, and the library does that in one go while all other clients wait. Here its extension hands a
compressed message on as it came, marked as such, and `inflate` reads it in slices. Others have their turn in between.
"""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Generator, Sequence

from websockets.exceptions import ProtocolError
from websockets.extensions import Extension
from websockets.extensions.base import ServerExtensionFactory
from websockets.extensions.permessage_deflate import ServerPerMessageDeflateFactory
from websockets.frames import Frame, Opcode
from websockets.typing import ExtensionParameter

__all__ = ["Deflated", "DeflatedText", "LateDeflate", "LateDeflateFactory", "inflate", "library_deflate"]

_SLICE = 256 * 1024
"""Bytes that are inflated in one go: under a millisecond."""

_TAIL = b"\x00\x00\xff\xff"
"""The end of a message that is not sent (RFC 7692 section 7.2.1)."""


_BEGINNINGS = frozenset({Opcode.TEXT, Opcode.BINARY})

_DEFAULT_WINDOW = 15
"""Bits of a window that was not spoken of (RFC 7692 section 7.1.2)."""


class Deflated(bytes):
    """A message, or a fragment of one, as it was sent: compressed."""

    __slots__ = ()


class DeflatedText(Deflated):
    """A compressed message of text frames: what it inflates to must be UTF-8."""

    __slots__ = ()


class LateDeflate(Extension):
    """The library's extension, but for incoming messages, which stay compressed.

    Attributes:
        is_fresh: the client compresses each message by itself.
        window_bits: of the client's compression.
        decoder: what inflates the next message.
    """

    name = ServerPerMessageDeflateFactory.name

    def __init__(self, library: Extension, *, is_fresh: bool, window_bits: int) -> None:
        """An extension for a new connection.

        Args:
            library: compresses what is sent.
            is_fresh: as agreed upon (RFC 7692 section 7.1.1.2).
            window_bits: as agreed upon (RFC 7692 section 7.1.2.2).
        """
        self.is_fresh = is_fresh
        self.window_bits = window_bits
        self.decoder = zlib.decompressobj(wbits=-window_bits)
        self._library = library
        self._is_compressed = False  # the message whose continuation may come

    def encode(self, frame: Frame) -> Frame:
        """Compress a frame."""
        return self._library.encode(frame)

    def decode(self, frame: Frame, *, max_size: int | None = None) -> Frame:  # noqa: ARG002 - judged when it is inflated
        """Mark what is compressed; everything else stays as it is.

        Raises:
            ProtocolError: RFC 7692 forbids the bit in a continuation.
        """
        if frame.opcode is Opcode.CONT:
            if not self._is_compressed:
                return frame
            if frame.rsv1:
                raise ProtocolError("RSV1 bit set in continuation frame")
        elif not frame.rsv1 or frame.opcode not in _BEGINNINGS:
            return frame
        self._is_compressed = not frame.fin
        return dataclasses.replace(frame, data=Deflated(frame.data), rsv1=False)


class LateDeflateFactory(ServerExtensionFactory):
    """Negotiates as the library does, with its own defaults."""

    name = ServerPerMessageDeflateFactory.name

    def __init__(self) -> None:
        self._library = library_deflate()

    def process_request_params(
        self, params: Sequence[ExtensionParameter], accepted_extensions: Sequence[Extension]
    ) -> tuple[list[ExtensionParameter], LateDeflate]:
        """Answer an offer.

        Raises:
            NegotiationError: it cannot be accepted.
        """
        answer, agreed = self._library.process_request_params(params, accepted_extensions)
        said = dict(answer)
        extension = LateDeflate(
            agreed,
            is_fresh="client_no_context_takeover" in said,
            window_bits=int(said.get("client_max_window_bits") or _DEFAULT_WINDOW),
        )
        return answer, extension


def library_deflate() -> ServerPerMessageDeflateFactory:
    """The library's own extension, with the settings that it has by itself."""
    return ServerPerMessageDeflateFactory(
        server_max_window_bits=12, client_max_window_bits=12, compress_settings={"memLevel": 5}
    )


def inflate(extension: LateDeflate, data: Deflated, max_bytes: int) -> Generator[None, None, bytes | None]:
    """Read a compressed message; yields after each slice.

    Args:
        extension: of the connection, whose messages must be read in order.
        data: the whole message.
        max_bytes: longest message.

    Returns:
        The message; None where it is longer.

    Raises:
        zlib.error: it is not what zlib makes.
    """
    if extension.is_fresh:
        extension.decoder = zlib.decompressobj(wbits=-extension.window_bits)
    decoder = extension.decoder
    message = bytearray()
    compressed = data + _TAIL
    for start in range(0, len(compressed), _SLICE // 4):  # what is left over is copied: keep it short
        rest: bytes = compressed[start : start + _SLICE // 4]
        while rest:
            message += decoder.decompress(rest, _SLICE)
            rest = decoder.unconsumed_tail
            if len(message) > max_bytes:
                return None
            yield
    while more := decoder.decompress(b"", _SLICE):  # held back by the slice's length
        message += more
        yield
    return bytes(message) if len(message) <= max_bytes else None

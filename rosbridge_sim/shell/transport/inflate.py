"""Compressed messages (permessage-deflate, RFC 7692), decompressed in slices.

16 kB can decompress to 16 MB. The library does that in one call, while all other clients wait. Here its extension
passes a compressed message on unchanged, marked as such, and `inflate` reads it in slices. Other clients have their
turn in between.
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

_SLICE = 256 * 1024
"""Bytes decompressed in one slice: less than a millisecond."""

_TAIL = b"\x00\x00\xff\xff"
"""End of a message that is not sent (RFC 7692 section 7.2.1)."""


_BEGINNINGS = frozenset({Opcode.TEXT, Opcode.BINARY})

_DEFAULT_WINDOW = 15
"""Window bits if they were not negotiated (RFC 7692 section 7.1.2)."""


class Deflated(bytes):
    """A compressed message, or a fragment of one, as it was sent."""

    __slots__ = ()


class DeflatedText(Deflated):
    """A compressed message of text frames: its decompressed content must be UTF-8."""

    __slots__ = ()


class LateDeflate(Extension):
    """The library's extension, except that incoming messages stay compressed.

    Attributes:
        is_fresh: the client compresses each message independently.
        window_bits: window of the client's compression [bits].
        decoder: decompresses the next message.
    """

    name = ServerPerMessageDeflateFactory.name

    def __init__(self, library: Extension, *, is_fresh: bool, window_bits: int) -> None:
        """Create the extension for a new connection.

        Args:
            library: compresses outgoing messages.
            is_fresh: as negotiated (RFC 7692 section 7.1.1.2).
            window_bits: as negotiated (RFC 7692 section 7.1.2.2).
        """
        self.is_fresh = is_fresh
        self.window_bits = window_bits
        self.decoder = zlib.decompressobj(wbits=-window_bits)
        self._library = library
        self._is_compressed = False  # a compressed message is not finished

    def encode(self, frame: Frame) -> Frame:
        """Compress an outgoing frame."""
        return self._library.encode(frame)

    def decode(self, frame: Frame, *, max_size: int | None = None) -> Frame:  # noqa: ARG002 - checked during decompression
        """Mark an incoming compressed frame; leave other frames as they are.

        Args:
            max_size: not used.

        Raises:
            ProtocolError: RFC 7692 forbids the compression bit in a continuation frame.
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
    """Negotiates like the library, with the library's defaults."""

    name = ServerPerMessageDeflateFactory.name

    def __init__(self) -> None:
        self._library = ServerPerMessageDeflateFactory(
            server_max_window_bits=12, client_max_window_bits=12, compress_settings={"memLevel": 5}
        )

    def process_request_params(
        self, params: Sequence[ExtensionParameter], accepted_extensions: Sequence[Extension]
    ) -> tuple[list[ExtensionParameter], LateDeflate]:
        """Answer an offer of the client.

        Args:
            accepted_extensions: extensions accepted before.

        Returns:
            Parameters of the answer, and the extension.

        Raises:
            NegotiationError: the offer cannot be accepted.
        """
        answer, agreed = self._library.process_request_params(params, accepted_extensions)
        said = dict(answer)
        extension = LateDeflate(
            agreed,
            is_fresh="client_no_context_takeover" in said,
            window_bits=int(said.get("client_max_window_bits") or _DEFAULT_WINDOW),
        )
        return answer, extension


def inflate(extension: LateDeflate, data: Deflated, max_bytes: int) -> Generator[None, None, bytes | None]:
    """Decompress a message; yield after each slice.

    Args:
        extension: extension of the connection, whose messages must be read in order.
        data: the whole message.

    Returns:
        The message; None if it is longer.

    Raises:
        zlib.error: the data is not valid.
    """
    if extension.is_fresh:
        extension.decoder = zlib.decompressobj(wbits=-extension.window_bits)
    decoder = extension.decoder
    message = bytearray()
    compressed = data + _TAIL
    for start in range(0, len(compressed), _SLICE // 4):  # zlib copies unused input, so keep it short
        rest: bytes = compressed[start : start + _SLICE // 4]
        while rest:
            message += decoder.decompress(rest, _SLICE)
            rest = decoder.unconsumed_tail
            if len(message) > max_bytes:
                return None
            yield
    while more := decoder.decompress(b"", _SLICE):  # output beyond the length of a slice
        message += more
        yield
    return bytes(message) if len(message) <= max_bytes else None

"""Compressed messages (permessage-deflate, RFC 7692), inflated slice by slice.

16 kB can inflate to 16 MB, and the library does that in one go while everybody else waits. Here its extension hands a
compressed message on as it came, marked as such, and `inflate` reads it in slices. Others have their turn in between.
"""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Generator, Sequence

from websockets.exceptions import ProtocolError
from websockets.extensions import Extension
from websockets.extensions.base import ServerExtensionFactory
from websockets.extensions.permessage_deflate import PerMessageDeflate, ServerPerMessageDeflateFactory
from websockets.frames import CTRL_OPCODES, Frame, Opcode
from websockets.typing import ExtensionParameter

__all__ = ["Deflated", "DeflatedText", "LateDeflate", "LateDeflateFactory", "inflate"]

_SLICE = 256 * 1024
"""Bytes that are inflated in one go: under a millisecond."""

_TAIL = b"\x00\x00\xff\xff"
"""The end of a message that is not sent (RFC 7692 section 7.2.1)."""


class Deflated(bytes):
    """A message, or a fragment of one, as it was sent: compressed."""

    __slots__ = ()


class DeflatedText(Deflated):
    """A compressed message of text frames: what it inflates to must be UTF-8."""

    __slots__ = ()


class LateDeflate(PerMessageDeflate):
    """The library's extension, but for incoming messages, which stay compressed."""

    def decode(self, frame: Frame, *, max_size: int | None = None) -> Frame:  # noqa: ARG002 - judged when it is inflated
        """Mark what is compressed; everything else stays as it is.

        Raises:
            ProtocolError: RFC 7692 forbids the bit in a continuation.
        """
        if frame.opcode in CTRL_OPCODES:
            return frame
        if frame.opcode is Opcode.CONT:
            if not self.decode_cont_data:
                return frame
            if frame.rsv1:
                raise ProtocolError("RSV1 bit set in continuation frame")
        elif not frame.rsv1:
            return frame
        self.decode_cont_data = not frame.fin
        return dataclasses.replace(frame, data=Deflated(frame.data), rsv1=False)


class LateDeflateFactory(ServerExtensionFactory):
    """Negotiates as the library does, with its own defaults."""

    name = ServerPerMessageDeflateFactory.name

    def __init__(self) -> None:
        self._library = ServerPerMessageDeflateFactory(
            server_max_window_bits=12, client_max_window_bits=12, compress_settings={"memLevel": 5}
        )

    def process_request_params(
        self, params: Sequence[ExtensionParameter], accepted_extensions: Sequence[Extension]
    ) -> tuple[list[ExtensionParameter], LateDeflate]:
        """Answer an offer.

        Raises:
            NegotiationError: it cannot be accepted.
        """
        answer, agreed = self._library.process_request_params(params, accepted_extensions)
        extension = LateDeflate(
            agreed.remote_no_context_takeover,
            agreed.local_no_context_takeover,
            agreed.remote_max_window_bits,
            agreed.local_max_window_bits,
            agreed.compress_settings,
        )
        return answer, extension


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
    if extension.remote_no_context_takeover:
        extension.decoder = zlib.decompressobj(wbits=-extension.remote_max_window_bits)
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

"""Heads of WebSocket frames with a complete message, as server and client write them (RFC 6455 section 5.2)."""

from __future__ import annotations

from struct import Struct
from typing import Final

from rosbridge_sim.protocol.outbox import BinaryFrame

TEXT: Final = 0x81
"""First byte of a frame with a complete text message: FIN and the opcode, no extension bits."""

BINARY: Final = 0x82
"""The same for a binary message."""


_pack_short, _pack_middle, _pack_long = Struct("!BB").pack, Struct("!BBH").pack, Struct("!BBQ").pack


def head_of(message: bytes, mask_bit: int = 0) -> bytes:
    """Return the head of a frame with a complete message: `BinaryFrame` is binary, other messages are text.

    Args:
        message: the message before masking.
        mask_bit: 0x80 if the masking key follows, as in frames of clients.
    """
    size = len(message)
    first = BINARY if type(message) is BinaryFrame else TEXT
    if size < 126:  # noqa: PLR2004 - RFC 6455 section 5.2, three forms of the length
        return _pack_short(first, mask_bit | size)
    if size < 2**16:
        return _pack_middle(first, mask_bit | 126, size)
    return _pack_long(first, mask_bit | 127, size)

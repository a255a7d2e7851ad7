"""Pings and pongs among the frames of a client whose receiver accepts no next message now."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

CONTROL = 0x08
"""Bit of a frame's first byte: a ping, a pong or a close (RFC 6455 section 5.2)."""

_CLOSE = 0x88
PING = 0x89
_PONG = 0x8A


def take_out_pings(
    kept: bytearray, start: int, until: float, on_pong: Callable[[bytes], None]
) -> tuple[int, bytes, bool]:
    """Take the pings and pongs out of received frames, until the given time.

    RFC 6455 section 5.5 has them come between any other frames. A receiver may accept no next message for a minute. The
    connection would be taken for dead meanwhile, here and on the other side. Of several pings only the newest is
    answered, which section 5.5.3 allows. The time is checked after each frame, because 0.8 MB may hold 130,000 pings.

    Args:
        kept: received frames; changed.
        start: bytes of `kept` in which no ping or pong is left.
        until: end of the turn, by `perf_counter` [s].
        on_pong: called with each pong.

    Returns:
        The new `start`, the newest ping or nothing, and True if the time is over.
    """
    position = start
    others = bytearray()
    ping = b""
    is_over = False
    while not is_over and (stop := _end_of_frame(kept, position)):
        if kept[position] == PING:
            ping = bytes(kept[position:stop])
        elif kept[position] == _PONG:
            on_pong(bytes(kept[position:stop]))
        else:
            others += memoryview(kept)[position:stop]
        position = stop
        is_over = perf_counter() >= until
    kept[start:position] = others
    return start + len(others), ping, is_over


def _end_of_frame(data: bytearray, position: int) -> int:
    """Return the end of the frame at a position; 0 if it is incomplete, wrong or a close frame.

    Args:
        data: received frames.
        position: start of a frame, or the end of the data.
    """
    start = position + 6  # RFC 6455 section 5.2, as in `DirectConnection._read`
    if start > len(data) or data[position] == _CLOSE:
        return 0
    size = data[position + 1] - 0x80
    if size >= 126:  # noqa: PLR2004 - the same
        start += 2 if size == 126 else 8  # noqa: PLR2004 - the same
        if start > len(data) or data[position] & CONTROL:  # the library refuses a long ping in its turn
            return 0
        size = int.from_bytes(data[position + 2 : start - 4], "big")
    stop = start + size
    return stop if size >= 0 and stop <= len(data) else 0

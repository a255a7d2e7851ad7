"""A WebSocket connection whose messages go straight from the transport to a callback, and back.

The `websockets` library reads each frame through a chain of generators, puts it into a queue and wakes a task; that
is half of what a small message costs. Here the plain case, one whole data frame, is cut out of the received bytes in
one loop. Everything else (the handshake, pings, fragments, compression, closing, whatever breaks the rules) is
handed frame by frame to the library, which stays the judge of it and the keeper of the connection's state; what
it makes of fragments and compressed frames comes to the same callback.

The library's parser must only ever see whole frames, so that it stands between two of them whenever we look: what
comes in parts is kept here until it is whole. Too long a frame is handed over unfinished; it ends the connection.

Road not taken: a class of our own beside `ServerConnection` would repeat its closing, its pings and its time-outs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import pack
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.frames import DATA_OPCODES, Frame
from websockets.protocol import Event, State
from websockets.speedups import apply_mask

from rosbridge_sim.protocol.flow import BinaryFrame

__all__ = ["DirectSocket", "head_of"]

MESSAGES_PER_TURN = 64
"""Messages of one client that are handled before others have their turn; some 1 ms of work."""

MAX_HELD = 64 * 2**10
"""Received bytes that may wait for their turn before the transport is told to stop reading."""

LARGE = 16 * 2**10
"""A frame from here on is not copied once more to stand behind its head [bytes]."""

_BLANK_LINE = b"\r\n\r\n"
_OPEN = State.OPEN
_WHOLE = _TEXT, _BINARY = 0x81, 0x82
"""First byte of a frame that is a whole message (RFC 6455 section 5.2: FIN and the opcode, no extension's bits)."""


def _ignore() -> None:
    """Nobody listens yet."""


def head_of(message: bytes, mask_bit: int = 0) -> bytes:
    """What stands before a whole message in its frame: `BinaryFrame` is binary, all else is text.

    Args:
        message: as it is before it is masked.
        mask_bit: 0x80 where the mask's key follows, which is what clients send.
    """
    size = len(message)
    first = _BINARY if type(message) is BinaryFrame else _TEXT
    if size < 126:  # noqa: PLR2004 - RFC 6455 section 5.2, three forms of the length
        return pack("!BB", first, mask_bit | size)
    if size < 2**16:
        return pack("!BBH", first, mask_bit | 126, size)
    return pack("!BBQ", first, mask_bit | 127, size)


class DirectSocket(ServerConnection):
    """A connection that hands each message to a callback, once `listen` was called; `recv` gives nothing.

    Attributes:
        on_room: called when the transport takes bytes again.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 - the library's own arguments
        super().__init__(*args, **kwargs)
        self.on_room: Callable[[], None] = _ignore
        self._on_message: Callable[[bytes], None] | None = None
        self._on_turn: Callable[[], None] = _ignore
        self._head = b""  # the last bytes of the HTTP request so far: they may hold the beginning of its end
        self._kept = bytearray()  # what is no whole frame yet, or waits for its turn
        self._need = 0  # length from which on `_kept` is worth looking at
        self._is_held = True
        self._is_paused = False
        self._has_ended = False  # the other side says nothing any more
        self._message = bytearray()  # the fragments of a message so far

    def listen(self, on_message: Callable[[bytes], None], on_turn: Callable[[], None]) -> None:
        """From now on, call `on_message` for each message and `on_turn` after each run of them. Neither may raise."""
        self._on_message = on_message
        self._on_turn = on_turn
        self._go_on()
        if self._has_ended:
            self._end()

    def send_messages(self, messages: Sequence[bytes]) -> int:
        """Hand messages to the transport: `BinaryFrame` as binary, others as text. The connection must be open.

        Returns:
            How many bytes the transport was given.
        """
        protocol, transport = self.protocol, self.transport
        parts: list[bytes] = []
        if protocol.extensions:
            for message in messages:
                (protocol.send_binary if type(message) is BinaryFrame else protocol.send_text)(message)
            parts = protocol.data_to_send()
            messages = ()
        for message in messages:
            parts += (head_of(message), message)
        if len(parts) == 2 and len(parts[1]) >= LARGE:  # noqa: PLR2004 - one message
            transport.writelines(parts)
            return len(parts[0]) + len(parts[1])
        data = b"".join(parts)
        transport.write(data)
        return len(data)

    # What the transport calls

    def resume_writing(self) -> None:
        """Take note that there is room again."""
        super().resume_writing()
        self.on_room()

    def data_received(self, data: bytes) -> None:
        """Handle what came, or keep it."""
        if self.request is None:
            data = self._read_head(data)
        if self._kept or self._is_held:
            kept = self._kept
            kept += data
            if self._is_held:
                if len(kept) > MAX_HELD and not self._is_paused:
                    self._is_paused = True
                    self.transport.pause_reading()
                return
            if len(kept) < self._need:
                return
            self._kept = bytearray()
            self._read(kept)
        else:
            self._read(data)

    def eof_received(self) -> bool:  # type: ignore[override] # asyncio says so; the library never answers
        """Handle all that came before the end; then let the library end it.

        Returns:
            Whether the transport stays open: somebody will listen to what was kept, and end it.
        """
        self._has_ended = True
        if self._kept and self._on_message is None:
            return True
        self._end()
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget what nobody waits for any more."""
        self._kept.clear()
        super().connection_lost(exc)

    # What the library calls

    def process_event(self, event: Event) -> None:
        """Take the messages that the library has read: fragments, and what was compressed."""
        if not isinstance(event, Frame) or event.opcode not in DATA_OPCODES:
            super().process_event(event)
            return
        self._message += event.data
        if event.fin:
            message = bytes(self._message)
            self._message.clear()
            assert self._on_message is not None, "before that, what comes is kept"
            self._on_message(message)

    # How bytes become messages

    def _end(self) -> None:
        """Nothing comes any more: handle what is whole, forget the rest, and close."""
        while self._is_held and self._on_message is not None:
            self._go_on()
        self._kept.clear()  # a turn may still be on its way here
        super().eof_received()
        self.transport.close()

    def _read_head(self, data: bytes) -> bytes:
        """Give the library the HTTP request; what comes behind it."""
        seen = self._head + data
        end = seen.find(_BLANK_LINE)
        if end < 0:
            self._head = seen[1 - len(_BLANK_LINE) :]
            super().data_received(data)
            return b""
        cut = end + len(_BLANK_LINE) - len(self._head)
        super().data_received(data[:cut])
        return data[cut:]

    def _go_on(self) -> None:
        """The next turn of what was held back."""
        self._is_held = False
        kept, self._kept = self._kept, bytearray()
        if kept:
            self._read(kept)
        if self._is_paused and not self._is_held:
            self._is_paused = False
            if not self.transport.is_closing():
                self.transport.resume_reading()

    def _read(self, data: bytes | bytearray) -> None:
        """Handle the frames at the front of some bytes; keep what is left."""
        protocol, on_message = self.protocol, self._on_message
        max_size = protocol.max_message_size
        assert max_size is not None, "a server without a limit is not ours"
        assert on_message is not None, "before that, what comes is kept"
        view = memoryview(data)
        position, end = 0, len(data)
        need = 2
        budget = MESSAGES_PER_TURN
        while position + need <= end:
            if protocol.state is not _OPEN:  # closing, or broken: for good
                super().data_received(bytes(view[position:]))
                position = end
                break
            # RFC 6455 section 5.2: two bytes, two or eight more of a longer length, four of the mask, the payload
            first, size = data[position], data[position + 1] - 0x80
            start = position + 6
            if size >= 126:  # noqa: PLR2004 - the same
                start += 2 if size == 126 else 8  # noqa: PLR2004 - the same
                if start > end:
                    need = start - position
                    break
                size = int.from_bytes(view[position + 2 : start - 4], "big")
            stop = start + size
            if size < 0 or size > max_size:  # not masked, or too long: the library says so and closes
                need = 2
                super().data_received(bytes(view[position:]))
                position = end
                break
            if stop > end:
                need = stop - position
                break
            if not budget:
                self._is_held = True
                self.loop.call_soon(self._go_on)
                break
            budget -= 1
            if first in _WHOLE and protocol.current_size is None:
                on_message(apply_mask(view[start:stop], data[start - 4 : start]))
            else:
                super().data_received(bytes(view[position:stop]))
            position = stop
            need = 2
        if position < end:
            self._kept += view[position:]
            self._need = need
        self._on_turn()

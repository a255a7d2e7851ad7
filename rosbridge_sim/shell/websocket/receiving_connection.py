"""The part that both kinds of connection of the server share: how messages are read and written is left to them.

`DirectConnection` reads frames by our own code, `LibraryConnection` by the library's. Common to both are the bound on
what comes before a connection is trusted, compression in slices, and the way in which a connection ends.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode
from websockets.protocol import State

from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.websocket.websocket_internals import MessageConnection

__all__ = ["Receiver", "ReceivingConnection"]

MAX_EARLY = 16 * 2**10
"""Received bytes that may wait before the other side is trusted; and the longest HTTP request, as Node.js has it."""

COMPRESSED_AT_ONCE = 32 * 2**10
"""Bytes that are compressed in one go: 2 ms for text that does not repeat itself. A longer message goes out in
fragments (RFC 6455 section 5.4), and others have their turn in between."""

_BLANK_LINE = b"\r\n\r\n"

_TOO_LONG = (
    b"HTTP/1.1 431 Request Header Fields Too Large\r\nConnection: close\r\nContent-Type: text/plain; charset=utf-8\r\n"
    b"Content-Length: 48\r\n\r\nA request may have at most 16,384 bytes of head\n"
)


def _ignore() -> None:
    """Do nothing: no receiver listens yet."""


class Receiver(Protocol):
    """Takes the messages of a connection."""

    def begin(self) -> float:
        """Begin a turn; return when it ends, by `perf_counter` [s]. It may be over already."""

    def receive(self, message: bytes) -> bool:
        """Take a message; return whether the next one may come. Must not raise."""

    def wait(self, *, had_turn: bool) -> None:
        """Messages are left, or the end is: call the connection's `go_on` later."""


class ReceivingConnection(MessageConnection, ServerConnection):
    """A connection that hands each message to a receiver, once `listen` was called; `recv` is not for others.

    Attributes:
        on_too_long: called before a frame is refused for its length, or for having no mask.
        is_trusted: set before `listen`, and never taken back. While it is False, less is kept of what comes.
        num_early: bytes that came behind the HTTP request while the connection was not trusted.
        num_bytes_received: bytes that came in all, the HTTP request included.
        is_held: what comes is kept for later.
        unsent: messages that `send_more` has still to compress and send.
        is_text: the message that the receiver is handed now was sent as text. Not to be read at any other time.
    """

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self.on_too_long: Callable[[], None] = _ignore
        self.is_trusted = False
        self.num_early = 0
        self.num_bytes_received = 0
        self.is_held = True
        self.unsent: deque[bytes] = deque()
        self.is_text = True
        self._receiver: Receiver | None = None
        self._num_head = 0  # bytes of the HTTP request so far
        self._head = b""  # the last bytes of the HTTP request so far: they may hold the beginning of its end
        self._num_compressed = 0  # bytes of the first message of `unsent` that are sent

    @property
    def num_bytes_held(self) -> int:
        """Bytes that have come and were not handled yet, and those that are to be compressed."""
        return self.num_bytes_in_fragments + sum(map(len, self.unsent))

    # What each kind does in its own way

    def listen(self, receiver: Receiver) -> None:
        """Hand all messages to a receiver from now on, those first that have come already."""
        raise NotImplementedError

    def pause(self) -> None:
        """Read nothing more from the transport until `go_on`. For a receiver that takes no next message now."""
        raise NotImplementedError

    def put_back(self, message: bytes) -> None:
        """Have a message come again, before all that waits. For a receiver that took no next message."""
        raise NotImplementedError

    def go_on(self, until: float) -> bool:
        """Handle what was held back until that time of `perf_counter` [s].

        Returns:
            True while something is held back still, be it the end.
        """
        raise NotImplementedError

    def forget(self) -> None:
        """Pass over all messages from now on, those held back among them: the connection is closing."""
        self.forget_fragments()
        self.unsent.clear()

    # Sending

    def send_messages(self, messages: Sequence[bytes]) -> int:
        """Hand messages to the transport: `BinaryFrame` as binary, others as text. The connection must be open.

        Where they are compressed it is as many as that takes little time for: see `unsent`.

        Returns:
            Number of bytes that the transport was given.
        """
        if not self.is_extended:
            return self._send_plain(messages)
        self.unsent += messages
        return self.send_more()

    def _send_plain(self, messages: Sequence[bytes]) -> int:
        """Send messages without compression; see `send_messages`."""
        raise NotImplementedError

    def send_more(self) -> int:
        """Compress a slice of what is left, and hand it to the transport. The connection must be open.

        Returns:
            How many bytes the transport was given.
        """
        core = self.core
        left = COMPRESSED_AT_ONCE
        while self.unsent and left > 0:
            message, start = self.unsent[0], self._num_compressed
            part = memoryview(message)[start : start + COMPRESSED_AT_ONCE]
            is_last = start + len(part) == len(message)
            if start:
                core.send_continuation(part, fin=is_last)
            else:
                (core.send_binary if type(message) is BinaryFrame else core.send_text)(part, fin=is_last)
            if is_last:
                self.unsent.popleft()
            self._num_compressed = 0 if is_last else start + len(part)
            left -= len(part)
        return self.flush()

    # The end

    def refuse(self, fault: str) -> None:
        """Fail the connection for data that are not what their frame says, with code 1007 (RFC 6455 section 7.4.1)."""
        self.on_room()  # answers to the messages before it
        self.forget()
        self.fail(CloseCode.INVALID_DATA, fault)

    def _end(self) -> None:
        """Close after the last byte has come and whole frames were handled: send the answers, forget the rest."""
        self.on_room()
        super().eof_received()
        self.cut_off_unread()  # the transport itself waits without end for its buffer to be read
        self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget what cannot be sent any more."""
        self.unsent.clear()
        super().connection_lost(exc)

    # The beginning

    def _read_early(self, data: bytes) -> bytes:
        """Count what comes, and return what of it stands behind the HTTP request."""
        if self.request is None:
            data = self._read_head(data)
        self.num_early += len(data)
        if self.num_early > MAX_EARLY and self.core.state is State.CONNECTING:
            # RFC 6455 section 4.1: a client waits for the answer to its request before it sends any data
            self.transport.abort()
            return b""
        return data

    def _read_head(self, data: bytes) -> bytes:
        """Give the library the HTTP request, if it is not too long; return what comes behind it."""
        seen = self._head + data
        end = seen.find(_BLANK_LINE)
        self._num_head += len(data) if end < 0 else end + len(_BLANK_LINE) - len(self._head)
        if self._num_head > MAX_EARLY:
            if not self.transport.is_closing():
                self.transport.write(_TOO_LONG)
                self.transport.close()
            return b""
        if end < 0:
            self._head = seen[1 - len(_BLANK_LINE) :]
            self.feed(data)
            return b""
        cut = end + len(_BLANK_LINE) - len(self._head)
        self.feed(data[:cut])
        return data[cut:]

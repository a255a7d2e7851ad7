"""The HTTP request, compression in slices and the end of a server connection; `DirectConnection` reads the frames.

It also limits the data that is read before a connection is trusted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode
from websockets.protocol import State

from rosbridge_sim.link.websocket_internals import MessageConnection
from rosbridge_sim.long_text import LongText, find_long_text
from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.transport.request_faults import TOO_LONG, find_fault, find_first_fault

MAX_EARLY = 16 * 2**10
"""Received bytes that may wait before the other side is trusted, and the longest HTTP request, as in Node.js."""

COMPRESSED_AT_ONCE = 32 * 2**10
"""Bytes compressed in one slice: 2 ms for text without repetition. A longer message is sent in fragments (RFC 6455
section 5.4), and other clients have their turn in between."""

MAX_DISCARDED = 16 * 2**20
"""Bytes that are read and dropped behind a request that was turned away. A program that sends a body reads the answer
when it has sent all of it; if the socket were closed before, the system would drop the answer, too."""

_BLANK_LINE = b"\r\n\r\n"


def _ignore(_size: int) -> None:
    """Do nothing: no receiver listens yet."""


class Receiver(Protocol):
    """Takes the messages of a connection."""

    def begin(self) -> float:
        """Begin a turn.

        Returns:
            End of the turn, by `perf_counter` [s]; it may be over already.
        """

    def receive(self, message: bytes) -> bool:
        """Handle a message. Must not raise.

        Returns:
            True if the next one may come.
        """

    def wait(self, *, had_turn: bool) -> None:
        """Call the connection's `go_on` later, because messages are left or the end is; see also `has_pings`.

        Args:
            had_turn: this connection had a turn in this round.
        """


class ReceivingConnection(MessageConnection, ServerConnection):
    """A connection that gives each message to a receiver, after `listen` was called. Other code must not call `recv`.

    Attributes:
        on_too_long: called with the size of a frame [bytes] before it is refused because it is too long; less than 0 if
            it is not masked. Without another end of the connection, the library closes it.
        has_request: the head of its request is complete, or was turned away.
        is_trusted: set before `listen`, and never reset. While it is False, fewer received bytes are kept.
        num_early: bytes received after the HTTP request while the connection was not trusted.
        num_bytes_received: all bytes received, the HTTP request included.
        is_held: received data is kept for later.
        has_pings: `go_on_with_pings` must be called in a later turn, even while the receiver accepts no message.
        unsent: messages that `send_more` must still compress and send.
        is_text: the message that the receiver gets now was sent as text. Read it only during `receive`.
    """

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self.on_too_long: Callable[[int], None] = _ignore
        self.has_request = False
        self.is_trusted = False
        self.num_early = 0
        self.num_bytes_received = 0
        self.is_held = True
        self.has_pings = False
        self.unsent: deque[bytes] = deque()
        self.is_text = True
        self._receiver: Receiver | None = None
        self._head = bytearray()  # the HTTP request so far
        self._num_compressed = 0  # bytes already sent of the first message in `unsent`

    @property
    def num_bytes_held(self) -> int:
        """Bytes that were received and not handled yet, and bytes to be compressed."""
        return self.num_bytes_in_fragments + sum(map(len, self.unsent))

    def find_long_text(self, message: bytes) -> LongText | None:
        """Return the long text of a message that the receiver gets now; None if it has none."""
        return find_long_text(message)

    def forget(self) -> None:
        """Ignore all messages from now on, including those held back, because the connection is closing."""
        self.forget_fragments()
        self.unsent.clear()

    # Sending

    def send_more(self) -> int:
        """Compress a slice of `unsent`, and give it to the transport. The connection must be open.

        Returns:
            Number of bytes given to the transport.
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
        """Fail the connection with code 1007, because data does not match its frame type (RFC 6455 section 7.4.1).

        Args:
            fault: reason, for the close frame.
        """
        self.on_room()  # sends the answers to earlier messages
        self.forget()
        self.fail(CloseCode.INVALID_DATA, fault)

    def _end(self) -> None:
        """Close after the last byte was received and complete frames were handled: send the answers, drop the rest."""
        self.on_room()
        super().eof_received()
        self.cut_off_unread()  # the transport itself has no time limit for sending its buffer
        self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Drop everything that cannot be sent any more.

        Args:
            exc: the error of the transport, or None.
        """
        self.unsent.clear()
        super().connection_lost(exc)

    # The beginning

    def _read_early(self, data: bytes) -> bytes:
        """Count received bytes; return those behind the HTTP request."""
        if not self.has_request:
            data = self._read_head(data)
        self.num_early += len(data)
        if self.has_request and self.request is None:  # it was turned away
            if self.num_early > MAX_DISCARDED:
                self.transport.abort()
            return b""
        if self.num_early > MAX_EARLY and self.core.state is State.CONNECTING:
            # RFC 6455 section 4.1: a client waits for the answer to its request before it sends any data
            self.transport.abort()
            return b""
        return data

    def _read_head(self, data: bytes) -> bytes:
        """Keep the HTTP request until it is complete, and give it to the library; return the bytes behind it.

        The library closes what it cannot read without an answer, so such a request is answered here.
        """
        head = self._head
        searched = max(0, len(head) - len(_BLANK_LINE) + 1)
        head += data
        end = head.find(_BLANK_LINE, searched)
        size = len(head) if end < 0 else end + len(_BLANK_LINE)
        if size > MAX_EARLY:
            self._turn_away(TOO_LONG, head)
            return b""
        if end < 0:
            fault = find_first_fault(head)
            if fault is None:
                self.await_head()
            else:
                self._turn_away(fault, head)
            return b""
        self._head = bytearray()
        self.has_request = True
        whole, rest = bytes(head[:size]), bytes(head[size:])
        if not self.answer(whole, len(rest)):
            fault = find_fault(whole)
            if fault is None:
                self.feed_head(whole)
            else:
                self._turn_away(fault, whole)
        return rest

    def _turn_away(self, answer: bytes, head: bytes | bytearray) -> None:
        """Answer a request that the library cannot read; then drop all that comes, and close.

        Args:
            answer: from `request_faults`. To HEAD it is sent without its body.
            head: the request, as far as it has come.
        """
        if head.startswith(b"HEAD "):
            answer = answer[: answer.index(_BLANK_LINE) + len(_BLANK_LINE)]
        self.has_request = True
        self._head = bytearray()
        if self.transport.is_closing():
            return
        self.transport.write(answer)
        if self.transport.can_write_eof():  # with TLS, the other side knows the end by the length of the answer
            self.transport.write_eof()
        self.cut_off_unread()

    def await_head(self) -> None:
        """Note that a part of a request has come, and more of it must come."""

    def answer(self, _head: bytes, _num_behind: int) -> bool:
        """Answer a whole request without the library; return False to leave it to the library.

        Args:
            _head: the request.
            _num_behind: bytes that came behind it.
        """
        return False

    def feed_head(self, head: bytes) -> None:
        """Give a whole request to the library."""
        self.feed(head)

"""The HTTP request at the beginning of a connection, as far as the library would close it without an answer.

What is read before a connection is trusted has a limit.
"""

from __future__ import annotations

from websockets.asyncio.server import ServerConnection
from websockets.protocol import State

from rosbridge_sim.link.websocket_internals import MessageConnection
from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.shell.transport.request_faults import TOO_LONG, find_fault, find_first_fault

MAX_EARLY = 16 * 2**10
"""Received bytes that may wait before the other side is trusted, and the longest HTTP request, as in Node.js."""

MAX_DISCARDED = 16 * 2**20
"""Bytes that are read and dropped behind a request that was turned away. A program that sends a body reads the answer
when it has sent all of it; if the socket were closed before, the system would drop the answer, too."""

_BLANK_LINE = b"\r\n\r\n"


class RequestConnection(MessageConnection, ServerConnection):
    """A connection that reads its own HTTP request.

    Attributes:
        has_request: the head of its request is complete, or was turned away.
        is_trusted: set before `listen`, and never reset. While it is False, fewer received bytes are kept.
        num_early: bytes received after the HTTP request while the connection was not trusted.
    """

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self.has_request = False
        self.is_trusted = False
        self.num_early = 0
        self._head = bytearray()  # the HTTP request so far

    def read_early(self, data: bytes) -> bytes:
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

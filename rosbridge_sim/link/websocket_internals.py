"""Everything that is used of the `websockets` library beyond its documented interface.

Other modules use only documented names of the library, and everything else from here. A test checks that the library
has these parts (`tests/link/test_websocket_internals.py`). It names the tested versions, which are those
that `pyproject.toml` allows. It fails if another module uses private parts directly.
Expected of a connection (`websockets.asyncio`), in addition to the methods of asyncio's own `Protocol`:
    protocol                  its Sans-I/O core, whose methods are documented (`websockets.protocol.Protocol`)
    transport, loop           of asyncio
    process_event             called for each frame that was read, in order, before `data_received` returns
    send_data                 gives the core's output to the transport, and its end
    close_timeout             the argument of that name [s]
    connection_lost_waiter    a future, done when the transport is lost
    write_limit_high, write_limit_low    limits for the transport, which `connection_made` sets
    recv_messages             the queue, which `connection_made` makes; a lost connection closes it
    request                   None until there is one: frames are read after that
    keepalive, keepalive_task    the coroutine that waits, pings, and so on; its task, which a lost connection cancels

Expected of the core:
    max_message_size          read before the content of each frame is kept
    extensions                the negotiated extensions
    available_extensions      in a server: read after `process_request`
    parser                    a generator that reads what comes; `Protocol.parse` reads frames
    close_expected, close_rcvd    the transport should be closed; the other side has sent a close frame

Rejected design: a separate WebSocket implementation would repeat the handshake, the closing, the pings and the
time-outs.
"""

from __future__ import annotations

from asyncio import BaseTransport, Future, TimerHandle, Transport, timeout
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar, cast

from websockets.asyncio.connection import Connection
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.extensions import Extension
from websockets.frames import CloseCode, Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import Event, Protocol, State
from websockets.server import ServerProtocol

from rosbridge_sim.loose_types import LibraryArgument

if TYPE_CHECKING:
    from websockets.utils import apply_mask
else:
    try:
        from websockets.speedups import apply_mask
    except ImportError:  # no wheel for this machine, and no compiler at installation
        from websockets.utils import apply_mask

__all__ = ["MessageConnection", "apply_mask"]

E = TypeVar("E", bound=Extension)

_OPEN = State.OPEN
_DATA = frozenset({Opcode.CONT, Opcode.TEXT, Opcode.BINARY})

MAX_UNREAD = 64 * 2**20
"""Bytes that may wait for a peer that does not read but keeps sending, because each of its pings is answered. Beyond
this limit it is cut off."""

LAST_ANSWERS = 20.0
"""Time for a peer that has ended its side to read its answers [s]: the same as for a ping."""


_REQUEST = Request("/", Headers())
"""The request of all connections that are open without a task: the real one may have the token, and is not kept."""


class _NoQueue:
    """In place of the queue of a connection that never puts anything into it."""

    def close(self) -> None:
        """Do nothing."""


_NO_QUEUE: Any = _NoQueue()  # any, because the library names its own class


def _ignore() -> None:
    """Do nothing: no one listens yet."""


class MessageConnection(Connection):
    """The common part of a server's and a client's connection. It comes before the library's class in the bases.

    Attributes:
        core: the Sans-I/O connection; `flush` sends its output.
        max_message_size: a longer message closes the connection with code 1009 [bytes]; set by `limit_message_size`.
        on_room: called when the transport accepts bytes again.
        is_full: the transport accepts no more bytes now.
        is_in_fragments: the library has read the start of a message, but not its end.
    """

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self.core: Protocol = self.protocol
        self.max_message_size = self.core.max_message_size
        self.on_room: Callable[[], None] = _ignore
        self.is_full = False
        self.is_in_fragments = False
        self._message = bytearray()  # the fragments of a message so far
        self._is_text = True
        self._cut_off: TimerHandle | None = None
        self._ping_timer: TimerHandle | None = None

    # State

    @property
    def is_open(self) -> bool:
        """True after the handshake and before the closing."""
        return self.core.state is _OPEN

    @property
    def is_opening(self) -> bool:
        """True before the end of the handshake."""
        return self.core.state is State.CONNECTING

    @property
    def lost(self) -> Future[None]:
        """Done when the transport is lost. It may be awaited, but never cancelled."""
        return self.connection_lost_waiter

    @property
    def end(self) -> ConnectionClosed:
        """The end of the connection; valid only after it has ended."""
        return self.core.close_exc

    def extension(self, kind: type[E]) -> E:
        """Return the negotiated extension of a class."""
        return next(one for one in self.core.extensions if isinstance(one, kind))

    def limit_message_size(self, num_bytes: int) -> None:
        """Refuse longer messages from now on.

        Args:
            num_bytes: longest message [bytes].
        """
        self.max_message_size = self.core.max_message_size = num_bytes

    def refuse_extensions(self) -> None:
        """Refuse all extensions that the request offers. For a server's `process_request`."""
        assert isinstance(self.core, ServerProtocol), "only a server refuses extensions"
        self.core.available_extensions = None

    @property
    def num_bytes_unsent(self) -> int:
        """Bytes that the transport has accepted and the system has not."""
        try:
            return self.transport.get_write_buffer_size()
        except AttributeError:  # asyncio's TLS transport loses its buffer when it is closed twice
            return 0

    # The beginning of a server's connection without a task

    def begin_without_task(self, transport: BaseTransport) -> None:
        """Do what `connection_made` does, but for the task and the queue, which a later call of it makes."""
        self.transport = cast("Transport", transport)  # a cast, because uvloop's transports are not a subclass
        self.transport.set_write_buffer_limits(self.write_limit_high, self.write_limit_low)
        self.recv_messages = _NO_QUEUE

    def open_without_task(self) -> None:
        """Treat the handshake as done, and ping from time to time. The caller has checked and answered the request."""
        core = self.core
        self.request = _REQUEST
        core.state = State.OPEN
        core.parser = Protocol.parse(core)  # the one before waits for a request
        next(core.parser)
        if self.ping_interval is not None:
            self._ping_timer = self.loop.call_later(self.ping_interval, self._start_pings)

    def _start_pings(self) -> None:
        self.keepalive_task = self.loop.create_task(self._keep_alive())

    async def _keep_alive(self) -> None:
        """Ping, then go on as the library does, which waits before its first ping."""
        with suppress(ConnectionClosed):
            pong = await self.ping()
            try:
                async with timeout(self.ping_timeout):
                    await pong
            except TimeoutError:
                self.fail(CloseCode.INTERNAL_ERROR, "keepalive ping timeout")
            else:
                await self.keepalive()

    # Actions

    def flush(self) -> int:
        """Give the core's output to the transport, in one write.

        Returns:
            Number of bytes.
        """
        data = b"".join(self.core.data_to_send())
        self.transport.write(data)
        return len(data)

    def fail(self, code: CloseCode, reason: str) -> None:
        """Close an open connection because of a mistake of the other side, which has some time to close its own side.

        Args:
            code: code of the close frame.
            reason: text of the close frame.
        """
        if self.is_open:
            self.core.fail(code, reason)
            self.send_data()
            self.cut_off_later()

    def feed(self, data: bytes) -> None:
        """Give received bytes to the library. If they end the connection, the other side must close it soon.

        Otherwise it is cut off. The library itself has no time limit, neither after an invalid frame nor after a close
        frame. A peer that has sent a close frame gets time to read its earlier answers.
        """
        super().data_received(data)
        if self.core.close_expected():
            is_broken = self.core.close_rcvd is None
            is_read = not self.num_bytes_unsent
            if is_broken or is_read:
                self.cut_off_later()
            else:
                self.cut_off_unread()

    def cut_off_later(self) -> None:
        """Abort the transport if the other side does not close it in the library's time limit. One call is enough."""
        if self.close_timeout is not None:
            self._cut_off_in(self.close_timeout)

    def cut_off_unread(self) -> None:
        """Abort the transport of a peer that has ended its side, after some time to read long answers."""
        self._cut_off_in(LAST_ANSWERS)

    def begin_last_answer(self) -> None:
        """Give the other side time to read an answer over HTTP, after which the connection ends.

        The library would give it `close_timeout` from before the answer is sent, too little for a page and a slow link.
        """
        self.close_timeout = LAST_ANSWERS
        self.cut_off_unread()

    def _cut_off_in(self, delay: float) -> None:
        if self._cut_off is None:
            self._cut_off = self.loop.call_later(delay, self.transport.abort)

    def cut_off_deaf(self) -> None:
        """Abort a connection if the other side does not read answers but keeps sending."""
        if self.is_full and self.num_bytes_unsent > MAX_UNREAD:
            self.transport.abort()

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        """Handle a message that the library has read. Subclasses define it.

        Args:
            is_text: type of its first frame; the text may not be valid UTF-8.
            last: data of its last frame, whose class an extension may have chosen.
        """
        raise NotImplementedError

    def forget_fragments(self) -> None:
        """Drop the fragments of an unfinished message."""
        self._message.clear()

    @property
    def num_bytes_in_fragments(self) -> int:
        """Bytes of an unfinished message."""
        return len(self._message)

    # Called by the transport

    def pause_writing(self) -> None:
        """Note that the transport has no room."""
        self.is_full = True
        super().pause_writing()

    def resume_writing(self) -> None:
        """Note that the transport has room again."""
        self.is_full = False
        super().resume_writing()
        self.on_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """Note that the connection is over.

        Args:
            exc: the error of the transport, or None.
        """
        if self._cut_off is not None:
            self._cut_off.cancel()
        if self._ping_timer is not None:
            self._ping_timer.cancel()
        self.forget_fragments()  # the connection itself is in a cycle, and may live until garbage is collected
        super().connection_lost(exc)

    # Called by the library

    def process_event(self, event: Event) -> None:
        """Handle data frames that the library has read; all other events go to the library.

        Args:
            event: a frame, or an HTTP request or response.
        """
        if not isinstance(event, Frame) or event.opcode not in _DATA:
            super().process_event(event)
            return
        if event.opcode is not Opcode.CONT:
            self._is_text = event.opcode is Opcode.TEXT
        self.is_in_fragments = not event.fin
        self._message += event.data
        if event.fin:
            message = bytes(self._message)
            self._message.clear()
            self.take_message(message, is_text=self._is_text, last=event.data)

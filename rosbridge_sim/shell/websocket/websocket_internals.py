"""All that we use of the `websockets` library beyond its documented interface.

Other modules take documented names from the library, and everything else from here. A test holds the library to what
this module expects (`tests/shell/websocket/test_websocket_internals.py`). It names the versions that kept to it, which
are those that `pyproject.toml` allows, and it fails where another module of ours reaches past this one.

Expected of a connection (`websockets.asyncio`), beside the methods of asyncio's own `Protocol`:

    protocol                  its Sans-I/O core, whose methods are documented (`websockets.protocol.Protocol`)
    transport, loop           of asyncio
    process_event             called for each frame that was read, in their order, before `data_received` returns
    send_data                 hands to the transport what the core wants to send, and its end
    close_timeout             the argument of that name [s]
    connection_lost_waiter    a future, done when the transport is lost

Expected of the core:

    max_message_size          read before the payload of each frame is kept
    extensions                those that were agreed upon
    available_extensions      at a server: read after `process_request`
    close_expected, close_rcvd    the transport is to be closed, and the other side has sent a close frame

Road not taken: a WebSocket connection of our own would repeat the handshake, the closing, the pings and the time-outs.
"""

from __future__ import annotations

from asyncio import Future, TimerHandle
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from websockets.asyncio.connection import Connection
from websockets.exceptions import ConnectionClosed
from websockets.extensions import Extension
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import Event, Protocol, State
from websockets.server import ServerProtocol

from rosbridge_sim.loose_types import LibraryArgument

if TYPE_CHECKING:
    from websockets.utils import apply_mask
else:
    try:
        from websockets.speedups import apply_mask
    except ImportError:  # no wheel for this machine, and no compiler when it was installed
        from websockets.utils import apply_mask

__all__ = ["MessageConnection", "apply_mask"]

E = TypeVar("E", bound=Extension)

_DATA = frozenset({Opcode.CONT, Opcode.TEXT, Opcode.BINARY})

MAX_UNREAD = 64 * 2**20
"""Bytes that may wait for a peer that reads nothing and goes on sending: each ping of it is answered. Beyond, it is cut
off."""

LAST_ANSWERS = 20.0
"""Time for a peer that has ended its side to read its answers [s]: as long as for a ping."""


def _ignore() -> None:
    """Do nothing: no one listens yet."""


class MessageConnection(Connection):
    """The part that a server's and a client's connection share; stands before the library's class among their bases.

    Attributes:
        core: the Sans-I/O connection; what it wants to send goes out by `flush`.
        max_message_size: a longer message closes the connection with code 1009 [bytes]. Set by `limit_message_size`.
        on_room: called when the transport takes bytes again.
        is_full: the transport takes no more bytes now.
        is_in_fragments: the library has read the beginning of a message, and not its end.
    """

    has_queue = False
    """Data frames go into the library's own queue, for `recv`, and not to `take_message`."""

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

    # What it is

    @property
    def is_open(self) -> bool:
        """The handshake is over, and the closing has not begun."""
        return self.core.state is State.OPEN

    @property
    def lost(self) -> Future[None]:
        """Done when the transport is lost. To be waited for, and never cancelled."""
        return self.connection_lost_waiter

    @property
    def end(self) -> ConnectionClosed:
        """End of the connection; only once it has ended."""
        return self.core.close_exc

    @property
    def is_extended(self) -> bool:
        """Extensions were agreed upon: frames need the library on their way out."""
        return bool(self.core.extensions)

    def extension(self, kind: type[E]) -> E:
        """The extension of a class that was agreed upon."""
        return next(one for one in self.core.extensions if isinstance(one, kind))

    def limit_message_size(self, num_bytes: int) -> None:
        """Take no longer messages from now on."""
        self.max_message_size = self.core.max_message_size = num_bytes

    def refuse_extensions(self) -> None:
        """Agree upon no extension, whatever the request offers. For a server's `process_request`."""
        assert isinstance(self.core, ServerProtocol), "a client offers what it likes"
        self.core.available_extensions = None

    # What can be done with it

    def flush(self) -> int:
        """Hand to the transport what the core wants to send, in one write; return how many bytes that is."""
        data = b"".join(self.core.data_to_send())
        self.transport.write(data)
        return len(data)

    def fail(self, code: CloseCode, reason: str) -> None:
        """Close an open connection because of a mistake of the other side, which has a while to close its own side."""
        if self.is_open:
            self.core.fail(code, reason)
            self.send_data()
            self.cut_off_later()

    def feed(self, data: bytes) -> None:
        """Give the library some bytes. If the connection ends by them, the other side hangs up soon or is cut off.

        The library itself waits without end, both after a broken rule and after a close frame. A peer that has sent a
        close frame gets the time to read what it was answered before.
        """
        super().data_received(data)
        if self.core.close_expected():
            is_broken = self.core.close_rcvd is None
            is_read = not self.transport.get_write_buffer_size()
            if is_broken or is_read:
                self.cut_off_later()
            else:
                self.cut_off_unread()

    def cut_off_later(self) -> None:
        """Give the other side the library's time for closing to close the transport; then abort it. Once is enough."""
        if self.close_timeout is not None:
            self._cut_off_in(self.close_timeout)

    def cut_off_unread(self) -> None:
        """Abort the transport of a peer that has ended its side, after time for reading long answers."""
        self._cut_off_in(LAST_ANSWERS)

    def _cut_off_in(self, delay: float) -> None:
        if self._cut_off is None:
            self._cut_off = self.loop.call_later(delay, self.transport.abort)

    def cut_off_deaf(self) -> None:
        """Abort a connection if the other side reads no answers and goes on sending."""
        if self.is_full and self.transport.get_write_buffer_size() > MAX_UNREAD:
            self.transport.abort()

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        """Take a message that the library has read. For the class that says what is done with it.

        Args:
            message: whole.
            is_text: by its first frame; it is not checked whether it is UTF-8.
            last: the data of its last frame, whose class an extension may have chosen.
        """
        raise NotImplementedError

    def forget_fragments(self) -> None:
        """Drop the fragments of a message that has not come to its end."""
        self._message.clear()

    @property
    def num_bytes_in_fragments(self) -> int:
        """Bytes of a message that has not come to its end."""
        return len(self._message)

    # What the transport calls

    def pause_writing(self) -> None:
        """Take note that there is no room."""
        self.is_full = True
        super().pause_writing()

    def resume_writing(self) -> None:
        """Take note that there is room again."""
        self.is_full = False
        super().resume_writing()
        self.on_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """Take note that it is over."""
        if self._cut_off is not None:
            self._cut_off.cancel()
        super().connection_lost(exc)

    # What the library calls

    def process_event(self, event: Event) -> None:
        """Take the data frames that the library has read; everything else is the library's."""
        if not isinstance(event, Frame) or event.opcode not in _DATA or self.has_queue:
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

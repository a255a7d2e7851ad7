"""A connection that reads and writes with the library's own code (`--websocket-io library`).

It exists for comparison with `server_connection.py`.
Messages come from the library's `recv`, in a task, and its core makes the outgoing frames. If a fault occurs with
`DirectConnection` and not here, it is in this package's own frame reading. The difference in CPU time is the gain of
that code (`scripts/bench/wire.py --websocket-io library`). Turns, outboxes and the limits without a token are the same.
Some things differ, because the library reads ahead:
- about 16 more messages wait for their turn, and no account counts them;
- a client that closes is answered at once, before its last messages are handled; it does not get those answers;
- a message of more than 16 KiB that comes together with the token closes the connection (1009), without a status frame;
- a frame that is too long closes the connection with the library's own reason, without a status frame;
- a compressed message is decompressed in one call.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from time import perf_counter

from websockets.exceptions import ConnectionClosed

from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.transport.receiving_connection import Receiver, ReceivingConnection

__all__ = ["LibraryConnection"]

LAST_TURNS = 0.5
"""Time for messages read before the connection was lost to have their turn [s]: a hundred rounds."""


class LibraryConnection(ReceivingConnection):
    """A connection that reads and writes frames with the library's code."""

    has_queue = True

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: deque[str | bytes] = deque()  # messages that wait for their turn
        self._released = asyncio.Event()  # the next message may come
        self._is_forgotten = False
        self._reading: asyncio.Task[None] | None = None

    @property
    def num_bytes_held(self) -> int:
        """Bytes that `recv` has returned and that are not handled yet, and bytes to be compressed."""
        return super().num_bytes_held + sum(map(len, self._waiting))

    def listen(self, receiver: Receiver) -> None:
        """Give all messages to a receiver from now on, beginning with those that have already come."""
        self._receiver = receiver
        self.is_held = bool(self._waiting)
        if self.is_held:
            receiver.wait(had_turn=False)
        else:
            self._released.set()
        if self._reading is None:
            self._reading = self.loop.create_task(self._read_on())

    def pause(self) -> None:
        """Do nothing: while messages are held back, `recv` is not called, and the library stops reading by itself."""

    def put_back(self, message: bytes) -> None:
        """Deliver a message again, before all waiting ones. For a receiver that accepted no next message."""
        self._waiting.appendleft(message)

    def go_on(self, until: float) -> bool:
        """Handle messages that were held back.

        Args:
            until: end of the turn, by `perf_counter` [s].

        Returns:
            True if messages are left.
        """
        self.is_held = not self._hand_out(until)
        if not self.is_held:
            self._released.set()
        return self.is_held

    def forget(self) -> None:
        """Ignore all messages from now on, including those held back, because the connection is closing."""
        super().forget()
        self._is_forgotten = True
        self._waiting.clear()
        self.is_held = False
        self._released.set()

    def _send_plain(self, messages: Sequence[bytes]) -> int:
        """Let the library make frames of messages, and give them to the transport."""
        for message in messages:
            (self.core.send_binary if type(message) is BinaryFrame else self.core.send_text)(message)
        return self.flush()

    async def wait_closed(self) -> None:
        """Wait until the connection is closed and earlier messages have had their turn."""
        await super().wait_closed()
        reading = self._reading
        if reading is None:
            return
        try:
            await asyncio.wait([reading], timeout=LAST_TURNS)
            if reading.done():
                reading.result()  # raises an internal error, if there was one
        finally:
            reading.cancel()

    # Called by the transport

    def data_received(self, data: bytes) -> None:
        """Give received bytes to the library."""
        self.num_bytes_received += len(data)
        if not self.is_trusted:
            data = self._read_early(data)
            if self._receiver is not None:
                self._receiver.begin()  # it counts bytes without a token; pings are seen nowhere else
        if data:
            self.feed(data)
            self.cut_off_deaf()

    def eof_received(self) -> bool:  # type: ignore[override] # as in `DirectConnection`
        """Close, because the other side sends nothing more.

        Returns:
            False: the transport closes.
        """
        self._end()
        return False

    # Turns

    async def _read_on(self) -> None:
        """Deliver messages as they come, until the connection ends."""
        try:
            while True:
                message = await self.recv()
                if self._is_forgotten:
                    continue
                self._waiting.append(message)
                assert self._receiver is not None, "the task begins after `listen`"
                receiver = self._receiver
                if not self._hand_out(receiver.begin()):
                    self.is_held = True
                    self._released.clear()
                    receiver.wait(had_turn=not self._waiting)
                await self._released.wait()
        except ConnectionClosed:
            pass
        except Exception:
            self.transport.abort()
            raise

    def _hand_out(self, until: float) -> bool:
        """Deliver waiting messages until the given time; return True if none is left and the next one may come."""
        assert self._receiver is not None, "messages are read after `listen`"
        while self._waiting:
            if perf_counter() >= until:
                return False
            message = self._waiting.popleft()
            self.is_text = isinstance(message, str)
            takes_more = self._receiver.receive(message.encode() if isinstance(message, str) else message)
            self.is_text = True
            if not takes_more:
                return False
        return True

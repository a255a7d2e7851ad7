"""A connection that reads and writes the library's own way (`--websocket-io library`).

It is there to be compared with `server_connection.py`.

Messages come from the library's `recv`, in a task, and its core makes the frames that go out. A fault that shows with
`DirectConnection` and not here is one of our own frame reading. The difference in CPU time is what the shortcut gains
(`scripts/bench/wire.py --websocket-io library`). Turns, outboxes and the bounds without a token are the same. Some
things differ, because the library reads ahead of us:

- some 16 messages more wait for their turn, and no account counts them;
- a client that closes is answered at once, before what it sent last is handled; it does not get those answers;
- a message of more than 16 KiB that comes together with the token closes the connection (1009), without a status frame;
- a compressed message is inflated in one go.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from time import perf_counter

from websockets.exceptions import ConnectionClosed

from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.websocket.receiving_connection import Receiver, ReceivingConnection

__all__ = ["LibraryConnection"]

LAST_TURNS = 0.5
"""Time for what was read before the connection was lost to have its turn [s]: a hundred rounds."""


class LibraryConnection(ReceivingConnection):
    """A connection that reads and writes frames by the library's code."""

    has_queue = True

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: deque[str | bytes] = deque()  # for their turn
        self._released = asyncio.Event()  # the next message may come
        self._is_forgotten = False
        self._reading: asyncio.Task[None] | None = None

    @property
    def num_bytes_held(self) -> int:
        """Bytes that `recv` has given and that were not handled yet, and those that are to be compressed."""
        return super().num_bytes_held + sum(map(len, self._waiting))

    def listen(self, receiver: Receiver) -> None:
        """Hand all messages to a receiver from now on, those first that have come already."""
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
        """Have a message come again, before all that waits. For a receiver that took no next message."""
        self._waiting.appendleft(message)

    def go_on(self, until: float) -> bool:
        """Handle what was held back until that time of `perf_counter` [s]; return whether something still is."""
        self.is_held = not self._hand_out(until)
        if not self.is_held:
            self._released.set()
        return self.is_held

    def forget(self) -> None:
        """Pass over all messages from now on, those held back among them: the connection is closing."""
        super().forget()
        self._is_forgotten = True
        self._waiting.clear()
        self.is_held = False
        self._released.set()

    def _send_plain(self, messages: Sequence[bytes]) -> int:
        """Have the library make frames of messages, and hand them to the transport."""
        for message in messages:
            (self.core.send_binary if type(message) is BinaryFrame else self.core.send_text)(message)
        return self.flush()

    async def wait_closed(self) -> None:
        """Wait until the connection is closed and what was read before has had its turn."""
        await super().wait_closed()
        reading = self._reading
        if reading is None:
            return
        try:
            await asyncio.wait([reading], timeout=LAST_TURNS)
            if reading.done():
                reading.result()  # raises what was a bug of ours
        finally:
            reading.cancel()

    # What the transport calls

    def data_received(self, data: bytes) -> None:
        """Give the library what came."""
        self.num_bytes_received += len(data)
        if not self.is_trusted:
            data = self._read_early(data)
            if self._receiver is not None:
                self._receiver.begin()  # it counts what comes without a token; pings come to no other place of ours
        if data:
            self.feed(data)
            self.cut_off_deaf()

    def eof_received(self) -> bool:  # type: ignore[override] # as in `DirectConnection`
        """Close: the other side says nothing any more."""
        self._end()
        return False

    # Turns

    async def _read_on(self) -> None:
        """Hand out messages as they come, to the end of the connection."""
        try:
            while True:
                message = await self.recv()
                if self._is_forgotten:
                    continue
                self._waiting.append(message)
                assert self._receiver is not None, "there was one when this task began"
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
        """Hand out what waits until that time; return whether all is gone and the next message may come."""
        assert self._receiver is not None, "before that, nothing is read"
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

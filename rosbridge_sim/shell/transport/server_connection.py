"""A WebSocket connection whose messages go directly from the transport to a callback, and back.

The `websockets` library reads each frame through a chain of generators, puts it into a queue and wakes a task; that is
half of the cost of a small message. Here the usual case, one complete data frame, is cut out of the received bytes in
one loop. Everything else (unusual handshakes, pings, fragments, compression, closing, and invalid data) is passed frame
by frame to the library, which checks it and keeps the state of the connection. Messages that the library makes from
fragments and compressed frames go to the same callback.
A receiver sets the length of its turn, and says after each message if it accepts the next one. If it does not, or if
its time is over, the rest stays here, the transport stops reading, and `go_on` continues.
A text message must be UTF-8 (RFC 6455 section 8.1); otherwise the connection ends with code 1007. Nearly every message
is ASCII, which is checked very fast. A long text beyond ASCII is checked in slices before the receiver gets it.
The library's parser must only get complete frames, so that its state is always between two frames: incomplete data is
kept here. A frame that is too long is passed on incomplete; it ends the connection.
The HTTP request before all of it is read in `request_reading.py`.
Rejected design: a separate class beside `ServerConnection` would repeat its closing, its pings and its time-outs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Protocol

from websockets.frames import CloseCode
from websockets.protocol import State

from rosbridge_sim.link.frame_heads import BINARY, TEXT, head_of
from rosbridge_sim.link.websocket_internals import apply_mask
from rosbridge_sim.long_text import LEAST, LongText, find_long_text
from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.protocol.json_decoding import HEAVY
from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.transport.inflate import Deflated, DeflatedText
from rosbridge_sim.shell.transport.request_reading import MAX_EARLY, RequestConnection
from rosbridge_sim.shell.transport.text_check import TextCheck
from rosbridge_sim.shell.transport.waiting_pings import CONTROL, PING, take_out_pings

COMPRESSED_AT_ONCE = 32 * 2**10
"""Bytes compressed in one slice: 2 ms for text without repetition. A longer message is sent in fragments (RFC 6455
section 5.4), and other clients have their turn in between."""

MAX_HELD = 64 * 2**10
"""Received bytes that may wait for their turn before the transport stops reading."""

PROBE_INTERVAL = 0.25
"""Time between two pings to a client that has ended its side while its call is carried out [s]. The second one finds
that it is dead: the simulator stops its work within half a second, and most calls end before the first one."""

LARGE = 16 * 2**10
"""A frame of at least this size is not copied again to put its head in front [bytes]."""

_OPEN, _CLOSED = State.OPEN, State.CLOSED
_WHOLE = (TEXT, BINARY)


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


class DirectConnection(RequestConnection):
    """A connection that reads and writes complete frames with this package's own code; `recv` returns nothing.

    Each message goes to a receiver, after `listen` was called.

    Attributes:
        on_too_long: called with the size of a frame [bytes] before it is refused because it is too long; less than 0 if
            it is not masked. Without another end of the connection, the library closes it.
        num_bytes_received: all bytes received, the HTTP request included.
        is_held: received data is kept for later.
        has_pings: `go_on_with_pings` must be called in a later turn, even while the receiver accepts no message.
        unsent: messages that `send_more` must still compress and send.
        is_text: the message that the receiver gets now was sent as text. Read it only during `receive`.
    """

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self.on_too_long: Callable[[int], None] = _ignore
        self.num_bytes_received = 0
        self.is_held = True
        self.has_pings = False
        self.unsent: deque[bytes] = deque()
        self.is_text = True
        self._receiver: Receiver | None = None
        self._num_compressed = 0  # bytes already sent of the first message in `unsent`
        self._kept = bytearray()  # an incomplete frame, or frames that wait for their turn
        self._need = 0  # length of `_kept` at which reading can continue
        self._num_scanned = 0  # bytes of `_kept` in which no ping or pong is left
        self._takes_more = True
        self._is_paused = False
        self._has_ended = False  # the other side sends nothing more
        self._is_dropping = False  # all received data is ignored
        self._check: TextCheck | None = None  # check of the message before those in `_kept`
        self._long_text: LongText | None = None  # that of the message that the receiver gets now
        self._ping = b""  # the newest ping that came while there was no room for an answer

    @property
    def num_bytes_held(self) -> int:
        """Bytes that were received and not handled yet, and bytes to be compressed."""
        checked = 0 if self._check is None else len(self._check.message)
        unhandled = self.num_bytes_in_fragments + len(self._kept) + checked
        return unhandled + sum(map(len, self.unsent))

    def listen(self, receiver: Receiver) -> None:
        """Give all messages to a receiver from now on, beginning with those that have already come."""
        self._receiver = receiver
        self.is_held = True
        if self._kept or self._has_ended or self._is_paused:
            receiver.wait(had_turn=False)
        else:
            self.is_held = False

    def pause(self) -> None:
        """Stop reading from the transport until `go_on`. For a receiver that accepts no next message now."""
        if not self._is_paused and not self.transport.is_closing():
            self._is_paused = True
            self.transport.pause_reading()

    def put_back(self, message: bytes) -> None:
        """Deliver a message again, before all waiting ones. For a receiver that accepted no next message."""
        frame = head_of(message, mask_bit=0x80) + bytes(4) + message  # a masking key of zeros changes nothing
        self._kept[:0] = frame
        self._num_scanned += len(frame)

    def go_on(self, until: float) -> bool:
        """Handle data that was held back.

        Args:
            until: end of the turn, by `perf_counter` [s].

        Returns:
            True if messages, or the end, are left.
        """
        assert self._receiver is not None, "before that, what comes is kept"
        self.is_held = self._check is not None and not self._go_on_checking(until)
        if self.is_held:
            return True
        kept, self._kept = self._kept, bytearray()
        if kept:
            self._read(kept, until)
        if self.is_held:
            return True
        if self._is_paused:
            self._is_paused = False
            if not self.transport.is_closing():
                self.transport.resume_reading()
        if self._has_ended:
            self._end()
        return False

    def forget(self) -> None:
        """Ignore all messages from now on, including those held back, because the connection is closing."""
        self.forget_fragments()
        self.unsent.clear()
        self._is_dropping = True
        self._check = None

    def send_messages(self, messages: Sequence[bytes]) -> int:
        """Give messages to the transport: `BinaryFrame` as binary, others as text. The connection must be open.

        All go in one write, with heads of frames that are made here. With compression, only so many are sent as take
        little time: see `unsent`.

        Returns:
            Number of bytes given to the transport.
        """
        if self.core.extensions:
            self.unsent += messages
            return self.send_more()
        parts: list[bytes] = []
        for message in messages:
            parts += (head_of(message), message)
        if len(messages) == 1 and len(messages[0]) >= LARGE:
            self.transport.writelines(parts)
            return len(parts[0]) + len(parts[1])
        data = b"".join(parts)
        self.transport.write(data)
        return len(data)

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

    # Called by the transport

    def resume_writing(self) -> None:
        """Note that the transport has room again."""
        if self._ping:
            self.loop.call_soon(self._answer_ping)
        super().resume_writing()

    def _hand_over(self, frame: bytes) -> None:
        """Give a frame to the library; a ping that comes while there is no room for an answer is kept.

        Only the newest such ping is answered later, which RFC 6455 section 5.5.3 allows. The answers to a client that
        does not read would otherwise grow without limit.
        """
        if frame[0] == PING and self.is_full:
            self._ping = frame
        else:
            self.feed(frame)

    def _answer_ping(self) -> None:
        ping, self._ping = self._ping, b""
        if ping and self.core.state is not _CLOSED:
            self.feed(ping)

    def data_received(self, data: bytes) -> None:
        """Handle received bytes, or keep them."""
        self.num_bytes_received += len(data)
        if not self.is_trusted:
            data = self.read_early(data)
        kept: bytes | bytearray = self._kept
        if kept or self.is_held:
            kept += data
            if self.is_held:
                if not self._takes_more and self._receiver is not None:
                    self._take_out_pings(self._receiver.begin())
                if len(kept) > (MAX_HELD if self.is_trusted else MAX_EARLY):
                    self.pause()
                return
            if len(kept) < self._need:
                return
            self._kept = bytearray()
        else:
            kept = data
        receiver = self._receiver
        assert receiver is not None, "before that, what comes is kept"
        has_worked = self._read(kept, receiver.begin())
        if self.is_held:
            receiver.wait(had_turn=has_worked)

    def eof_received(self) -> bool:  # type: ignore[override] # bool as in asyncio; the library returns nothing
        """Handle all data before the end, in turns; then let the library end the connection.

        Returns:
            True if the transport stays open, because data is held back.
        """
        self._has_ended = True
        if self.is_held and (self._kept or self._receiver is not None):
            self.loop.call_later(PROBE_INTERVAL, self._probe)
            return True
        self._end()
        return False

    def _probe(self) -> None:
        """Find out whether the other side still reads, while data before its end is held back.

        A client that waits for its last answers ignores a ping, or answers it in vain. A client that was killed has a
        socket that refuses it: the next write fails, and the connection is lost. Without it, the call of a dead client
        is carried out to its end, which may take a minute.
        """
        if not self._has_ended or not self.is_held or self.transport.is_closing() or self.core.state is not _OPEN:
            return
        if not self.is_full:
            self.core.send_ping(b"")
            self.flush()
        self.loop.call_later(PROBE_INTERVAL, self._probe)

    def connection_lost(self, exc: Exception | None) -> None:
        """Drop everything that cannot be answered or sent any more.

        Args:
            exc: the error of the transport, or None.
        """
        self._kept.clear()
        self._check = None
        self._ping = b""
        self._has_ended = False
        self._is_dropping = True
        self.unsent.clear()
        super().connection_lost(exc)

    # Called by the library

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        """Handle a message that the library has read: fragments, or a compressed message.

        Args:
            last: data of its last frame.
        """
        assert self._receiver is not None, "before that, what comes is kept"
        self.is_text = is_text
        if isinstance(last, Deflated):  # it is checked after decompression
            message = (DeflatedText if is_text else Deflated)(message)
        elif is_text and not message.isascii() and not self._is_utf8(message):
            return
        self._takes_more = self._receiver.receive(message)
        self.is_text = True

    def refuse(self, fault: str) -> None:
        """Fail the connection with code 1007, because data does not match its frame type (RFC 6455 section 7.4.1).

        Args:
            fault: reason, for the close frame.
        """
        self.on_room()  # sends the answers to earlier messages
        self.forget()
        self.fail(CloseCode.INVALID_DATA, fault)

    # Texts

    def _receive_long(self, message: bytes, receiver: Receiver) -> bool:
        """Check a long text, and give it to the receiver; return True if the next message may come.

        If nearly all of it is base64, reading that is the check; the receiver does not read it once more.
        """
        found = find_long_text(message) if len(message) < HEAVY else None
        if found is None or not found.short.isascii():
            return receiver.receive(message) if message.isascii() or self._is_utf8(message) else self._takes_more
        self._long_text = found
        takes_more = receiver.receive(message)
        self._long_text = None
        return takes_more

    def find_long_text(self, message: bytes) -> LongText | None:
        """Return the long text of a message that the receiver gets now; None if it has none."""
        found = self._long_text
        return found if found is not None and found.text is message else find_long_text(message)

    def _is_utf8(self, message: bytes) -> bool:
        """Check a text that is not ASCII; return True if it is UTF-8 and the receiver may have it now.

        If it is not UTF-8, the connection is closed. A long text is checked later, and no other data is read before
        that.
        """
        check = TextCheck(message)
        if check.step():
            self._check = check
            self._takes_more = False
            return False
        if check.fault:
            self.refuse(check.fault)
        return not check.fault

    def _go_on_checking(self, until: float) -> bool:
        """Continue the check of a long text; return True if the messages behind it may be read."""
        check, receiver = self._check, self._receiver
        assert check is not None, "checked by the caller"
        assert receiver is not None, "before that, what comes is kept"
        while check.step():
            if perf_counter() >= until:
                return False
        self._check = None
        if check.fault:
            self.refuse(check.fault)
            return True
        return receiver.receive(check.message)

    # From bytes to messages

    def _end(self) -> None:
        """Close after the last byte was received and complete frames were handled: send the answers, drop the rest."""
        self._kept.clear()
        self.on_room()
        super().eof_received()
        self.cut_off_unread()  # the transport itself has no time limit for sending its buffer
        self.transport.close()

    # One long method, because a function call per frame would cost a tenth of the speed.
    def _read(self, data: bytes | bytearray, until: float) -> bool:  # noqa: C901, PLR0912, PLR0915
        """Handle the frames at the start of some bytes until the given time; keep the rest.

        Returns:
            True if any frame was handled. `is_held` is True if complete frames are left because the time is over.
        """
        core, receiver = self.core, self._receiver
        max_size = self.max_message_size
        assert max_size is not None, "the server sets a limit"
        assert receiver is not None, "before that, what comes is kept"
        on_message, clock = receiver.receive, perf_counter
        has_worked = False
        view = memoryview(data)
        position, end = 0, len(data)
        need = 2
        self._takes_more = True
        # A receiver that closes the connection calls `forget`, too; only frames to the library change the state.
        state = core.state
        while position + need <= end:
            if state is _CLOSED:  # the library drops all data
                self.feed(bytes(view[position:]))
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
                size = int.from_bytes(data[position + 2 : start - 4], "big")
            stop = start + size
            if size < 0 or size > max_size:  # not masked, or too long: the library reports it and closes
                if not self._takes_more:  # a later receiver may accept longer ones
                    break
                need = 2
                self.on_too_long(size)
                self.feed(bytes(view[position:]))
                position = end
                break
            if stop > end:
                need = stop - position
                break
            if not self._takes_more or clock() >= until:
                self.is_held = True
                break
            has_worked = True
            if (self._is_dropping or state is not _OPEN) and not first & CONTROL:
                pass  # closing: only the other side's close frame is still needed
            elif first in _WHOLE and not self.is_in_fragments:
                payload = data[start:stop] if size < LARGE else view[start:stop]  # a small copy is faster than a view
                message = apply_mask(payload, data[start - 4 : start])
                if first == BINARY:
                    self.is_text = False
                    self._takes_more = on_message(message)
                    self.is_text = True
                elif size >= LEAST:
                    self._takes_more = self._receive_long(message, receiver)
                elif message.isascii() or self._is_utf8(message):
                    self._takes_more = on_message(message)
            else:
                self._hand_over(bytes(view[position:stop]))
                state = core.state
            position = stop
            need = 2
        if self._num_scanned:
            self._num_scanned = max(0, self._num_scanned - position)
        if position < end:
            self._kept += view[position:]
            self._need = need
        if not self._takes_more:
            self.is_held = True
            self._take_out_pings(until)
        return has_worked

    def go_on_with_pings(self, until: float) -> None:
        """Handle pings and pongs among the frames that wait; see `has_pings`.

        Args:
            until: end of the turn, by `perf_counter` [s].
        """
        self.has_pings = False
        if self.is_held and not self._takes_more:
            self._take_out_pings(until)
        if self._is_paused and len(self._kept) <= MAX_HELD and not self.transport.is_closing():
            self._is_paused = False
            self.transport.resume_reading()

    def _take_out_pings(self, until: float) -> None:
        """Handle the pings and pongs among the frames that wait for the receiver, until the given time."""
        if not self.is_trusted or self.core.state is not _OPEN:
            return
        self._num_scanned, ping, is_over = take_out_pings(self._kept, self._num_scanned, until, self.feed)
        if is_over:
            self._wait_with_pings()
        if ping:
            self._hand_over(ping)

    def _wait_with_pings(self) -> None:
        """Continue to search for pings in a later turn."""
        assert self._receiver is not None, "before that, what comes is kept"
        if not self.has_pings:
            self.has_pings = True
            self._receiver.wait(had_turn=True)

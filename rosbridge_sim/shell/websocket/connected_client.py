"""One connected client: its socket, its outbox, its turns, and its peer on the bus."""

from __future__ import annotations

import asyncio
import logging
import time
import zlib
from collections.abc import Callable, Generator, Iterator
from time import perf_counter
from typing import Protocol

from websockets.frames import CloseCode
from websockets.protocol import State

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer, Work
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.protocol.outbox import Outbox
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.shell.transport.inflate import Deflated, DeflatedText, LateDeflate, inflate
from rosbridge_sim.shell.transport.text_check import TextCheck
from rosbridge_sim.shell.websocket.access import RateGate
from rosbridge_sim.shell.websocket.connections import ServedConnection, address_of
from rosbridge_sim.shell.websocket.freed_memory import LARGE_FRAME
from rosbridge_sim.shell.websocket.limits import CLOSE_TIMEOUT, ServerLimits
from rosbridge_sim.shell.websocket.turns import Turns

_log = logging.getLogger("rosbridge_sim.server")

MAX_REASON = 120
"""Longest reason in a close frame [characters]; the frame has room for 123 bytes (RFC 6455 section 5.5)."""

MAX_FLUSHED = 2 * 2**20
"""Bytes given to one transport in one turn: about 1 ms. The rest follows in later turns."""

SLICE_BYTES = 8 * 2**20
"""A slice of making or compressing frames counts as so many bytes sent: it takes 2 ms."""

WRITE_SIZE = 64 * 1024
"""Bytes given to the transport at once; about the size of a loopback socket's buffer."""

_SHORTER = (
    "A CBOR frame has the bytes of an image as they are, without base64: three quarters of the size;"
    " sensor_msgs/CompressedImage is smaller still. Or start the server with a larger --max-frame-size"
)
"""Ways to send a long message, for an error text."""

_OPEN = State.OPEN
_NEVER = float("inf")


class ClientWatch(Protocol):
    """Events that a client reports to its server."""

    def count_bug(self) -> None:
        """Count an internal error in work for a client."""

    def note_large_frame(self) -> None:
        """Note that a large frame was received or sent."""


class Client:
    """One connected client: its socket, its outbox, its peer on the bus.

    Attributes:
        host: network address without the port.
        number: in the order of connecting, from 1; 0 before it has its place.
        connected_ns: time of the connection [ns, time of day].
        num_bytes_sent: bytes given to the transport.
        has_failed: an internal error in this client's own state was found, and it is closing.
    """

    def __init__(
        self,
        socket: ServedConnection,
        bus: Bus,
        limits: ServerLimits,
        turns: Turns,
        watch: ClientWatch,
        *,
        is_from_autobahn: bool = False,
    ) -> None:
        """Create a client that does not read yet.

        Args:
            watch: gets events that concern the whole server.
            is_from_autobahn: it may be roslibpy.
        """
        self.socket = socket
        self.outbox = Outbox(limits.outbox, self._schedule_flush, self.flush)
        session = Session(
            self.outbox,
            self._set_alarm,
            max_frame_size=limits.max_frame_size,
            is_talkative=limits.is_talkative,
            account=Account(limits.client_memory, bus.total),
        )
        session.find_long_text = socket.find_long_text
        session.is_roslibpy = None if is_from_autobahn else False
        self.host = str(socket.remote_address[0]) if socket.remote_address else ""
        self.number = 0
        self.connected_ns = time.time_ns()
        self.num_bytes_sent = 0
        self.peer = Peer(bus, session, address_of(socket), limits.policy)
        self._bus = bus
        bus.accounts[self.peer] = session.account
        self._begin_frame: Callable[[bytes, float], Work | None] = self.peer.begin
        self._max_frame_size = limits.max_frame_size
        self._turns = turns
        self.begin = turns.begin  # for its socket, as a `Receiver`
        self._watch = watch
        self._guard = bus.guard
        self.has_failed = False
        self._clock = socket.loop.time
        self._is_woken = False
        # The due time is kept here, because uvloop's handle does not have it if its delay rounds to 0 ms.
        self._alarm: asyncio.Handle | None = None
        self._alarm_due = _NEVER
        self._closing: asyncio.Task[None] | None = None
        self._work: Work | None = None
        self._has_input = False
        self._has_output = False
        self._is_in_line = False
        socket.on_room = self.flush
        socket.on_too_long = self._refuse_too_long
        self.peer.on_failure = self._fail
        self.peer.on_released = lambda: self._get_in_line(had_turn=False)
        if limits.access.max_rate is not None:
            self._begin_frame = RateGate(self.peer, limits.access.max_rate, self._clock()).begin

    # Memory, as a `Holder`

    @property
    def name(self) -> str:
        """Address of the client, for people."""
        return self.peer.address

    @property
    def num_bytes_held(self) -> int:
        """Memory that the server holds for it: in its account, its outbox, its socket, and as parameters [bytes]."""
        waiting = self.num_bytes_waiting + self.socket.num_bytes_held
        return waiting + self.peer.session.account.num_bytes + self._bus.parameters.num_held(self.peer)

    @property
    def num_bytes_waiting(self) -> int:
        """Bytes on their way to the client: in its outbox and in its socket."""
        return self.outbox.num_bytes + self.socket.num_bytes_unsent

    def shared(self) -> Iterator[tuple[int, int]]:
        """Yield identity and size [bytes] of its waiting frames and messages, which other clients may share."""
        yield from self.outbox.frames()
        yield from self.peer.session.waiting()

    def evict(self, reason: str) -> None:
        """Close the connection at once with code 1008, and release everything.

        Args:
            reason: text for the close frame.
        """
        self.peer.session.remark("error", reason)
        self.flush()
        self._start_closing(CloseCode.POLICY_VIOLATION, reason[:MAX_REASON])
        self._bus.topic_table.forget_latched(self.peer)
        self.leave()

    # Input, as the `Receiver` of its socket

    def receive(self, message: bytes) -> bool:
        """Do the ops of a frame, as far as the turn allows.

        Args:
            message: content of the frame, perhaps compressed.

        Returns:
            True if the next frame may come.
        """
        if type(message) is not bytes:
            assert isinstance(message, Deflated), "the only other type that a socket passes"
            self._work = _InflatedWork(self, message)
            return self._do_steps()
        try:
            work = self._begin_frame(message, self._clock())
        except Exception:  # noqa: BLE001 - an internal error: this message is lost, everything else goes on
            self._regret_frame()
            return True
        if work is None:
            return not self.peer.num_holds
        self._work = work
        return self._do_steps()

    def _do_steps(self) -> bool:
        """Continue with the current frame until the turn is over; return True if it is finished."""
        while self._work is not None:
            if self.outbox.is_overfull or self._closing is not None:  # it does not read the answers
                self._end_frame()
                self.flush()
                break
            try:
                if not self._work.step(self._clock()):
                    self._end_frame()
                    break
            except Exception:  # noqa: BLE001 - as above; the rest of the frame is lost with it
                self._regret_frame()
                self._end_frame()
                break
            if self.peer.is_held or perf_counter() >= self._turns.until:
                return False
        return not self.peer.is_held

    def _end_frame(self) -> None:
        """End the work on a frame. A small one may have held a large one, as an image, compressed or in fragments."""
        self._work = None
        if self.peer.session.frame_length >= LARGE_FRAME:
            self._watch.note_large_frame()

    def _regret_frame(self) -> None:
        self._watch.count_bug()
        _log.exception("internal error in a frame of %s; the frame was dropped", self.peer.address)
        if not self.has_failed:
            self.peer.notify("error", "The server failed on a message; its log says why")

    def inflate(self, message: Deflated) -> Generator[None, None, Work | None]:
        """Decompress a message in slices, and begin the frame in it.

        Returns:
            As `Peer.begin`.
        """
        extension = self.socket.extension(LateDeflate)
        try:
            frame = yield from inflate(extension, message, self._max_frame_size)
        except zlib.error as error:
            self._start_closing(CloseCode.INVALID_DATA, f"decompression failed: {error}")
            return None
        if frame is None:
            text = f"a message inflates to more than {self._max_frame_size:,} bytes"
            self._start_closing(CloseCode.MESSAGE_TOO_BIG, text)
            return None
        if isinstance(message, DeflatedText) and not frame.isascii():
            check = TextCheck(frame)
            while check.step():
                yield
            if check.fault:
                self.socket.refuse(check.fault)
                return None
        return self._begin_frame(frame, self._clock())

    # Turns

    def wait(self, *, had_turn: bool) -> None:
        """Let the socket continue in a later turn.

        Args:
            had_turn: this client has worked in this round; others come first.
        """
        self._has_input = True
        self._get_in_line(had_turn=had_turn)

    def _get_in_line(self, *, had_turn: bool) -> None:
        if self._is_waiting and not self._is_in_line:
            self._is_in_line = True
            self._turns.wait(self, had_turn=had_turn)

    @property
    def _is_waiting(self) -> bool:
        return self._has_output or self.socket.has_pings or (self._has_input and not self.peer.is_held)

    def work(self, until: float) -> bool:
        """Continue with work that is left: frames to make, then pings, then other frames to read.

        Args:
            until: end of the turn, by `perf_counter` [s].

        Returns:
            True if work is left.
        """
        try:
            self._work_until(until)
        except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
            self._is_in_line = False
            self._guard.blame(self.peer, error)
        return self._is_in_line

    def _work_until(self, until: float) -> None:
        self._turns.until = until
        if self._has_output:
            self._has_output = False
            self.flush()
        if self.socket.has_pings:
            self.socket.go_on_with_pings(until)
        if self._has_input and not self.peer.is_held and self._do_steps():
            self._has_input = self.socket.go_on(until)
        self._is_in_line = self._is_waiting

    # Output

    def _schedule_flush(self) -> None:
        if not self._is_woken:
            self._is_woken = True
            self._turns.flush_later(self.flush)

    def _set_alarm(self, due: float) -> None:
        """Set an alarm for the peer's feeds at `due`, unless an earlier one is set."""
        if due < self._alarm_due:
            if self._alarm is not None:
                self._alarm.cancel()
            self._alarm_due = due
            self._alarm = self.socket.loop.call_at(due, self._flush_peer)

    def _flush_peer(self) -> None:
        self._alarm = None
        self._alarm_due = _NEVER
        try:
            self.peer.flush(self.socket.loop.time())
        except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
            self._guard.blame(self.peer, error)

    def _fail(self, error: Exception) -> None:
        """Close this client alone, with code 1011, after an internal error in work for it.

        The bus's guard calls it, too.
        """
        if self.has_failed:
            return
        self.has_failed = True  # before the log line, because this client may subscribe to /rosout
        _log.error("%s: closed because of an internal error", self.peer.address, exc_info=error)
        try:
            self._start_closing(CloseCode.INTERNAL_ERROR, "the server failed on this connection; its log says why")
        except Exception:  # noqa: BLE001 - whatever is wrong with it, it is to go
            _log.exception("%s: cut off, because closing failed", self.peer.address)
            self.socket.transport.abort()
        self.leave()

    def leave(self) -> None:
        """Remove the client from the bus; waiting frames are dropped. A second call does nothing."""
        try:
            if self._alarm is not None:
                self._alarm.cancel()
            self._turns.leave(self)
            self._work = None
            self.outbox.close()
        finally:
            self.peer.leave(self.socket.loop.time())

    def flush(self) -> None:
        """Give waiting frames to the transport, as long as it accepts them, and as many as one turn has time for."""
        try:
            self._flush_outbox()
        except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
            self._guard.blame(self.peer, error)

    def _flush_outbox(self) -> None:
        self._is_woken = False
        socket, outbox = self.socket, self.outbox
        if socket.core.state is not _OPEN:
            outbox.close()
            return
        turns = self._turns
        if turns.num_bytes_left <= 0 and (socket.unsent or outbox.num_bytes_late):
            self._has_output = True
            self._get_in_line(had_turn=True)
            return
        left = MAX_FLUSHED
        while (socket.unsent or outbox.num_bytes) and not socket.is_full:
            frames: list[bytes] = []
            if socket.unsent:
                self.num_bytes_sent += socket.send_more()
            else:
                frames = outbox.take(WRITE_SIZE)
            if frames:
                num_bytes = socket.send_messages(frames)
                if num_bytes >= WRITE_SIZE:
                    self._count(num_bytes)
                self.num_bytes_sent += num_bytes
                left -= num_bytes
            if not frames or left <= 0 or socket.unsent:
                if not frames or socket.unsent:  # a slice of a late frame was made, or a slice was compressed
                    turns.num_bytes_left -= max(SLICE_BYTES, outbox.num_bytes_late)
                self._has_output = True
                self._get_in_line(had_turn=True)
                break
        if outbox.is_overfull and self._closing is None:
            _log.warning("%s reads too slowly: %d bytes wait; closing", self.peer.address, outbox.num_bytes)
            outbox.close()
            self._start_closing(CloseCode.POLICY_VIOLATION, "answers were left unread for too long")

    def _count(self, num_bytes: int) -> None:
        """Count many bytes that were given to the transport."""
        self._turns.num_bytes_left -= num_bytes
        if num_bytes >= LARGE_FRAME:
            self._watch.note_large_frame()

    def _refuse_too_long(self, size: int) -> None:
        """Tell the client why a frame that is too long closes the connection, and what to do."""
        if size <= self._max_frame_size or not self.socket.is_open:  # else it is not masked, or it is closing already
            return
        text = f"{size:,} bytes in one frame, but --max-frame-size is {self._max_frame_size:,}"
        self.peer.explain("error", f"{text}, so the connection is closed. {_SHORTER}", Reason.TOO_MUCH)
        self.flush()
        self.socket.forget()
        self.socket.fail(CloseCode.MESSAGE_TOO_BIG, f"{text}; send CBOR or a CompressedImage"[:MAX_REASON])

    def cut(self, code: int, reason: str) -> None:
        """Close the connection with a code; 1006 ends it without a close frame, as a lost network does."""
        if code == CloseCode.ABNORMAL_CLOSURE:
            self.socket.transport.abort()
            return
        self.flush()
        self._start_closing(code, reason.encode()[:MAX_REASON].decode(errors="ignore"))

    def _start_closing(self, code: int, reason: str) -> None:
        """Close with a code and a reason, and stop all other work for this client."""
        if self._closing is None:
            self.socket.forget()
            self._closing = self.socket.loop.create_task(self._close(code, reason))

    async def _close(self, code: int, reason: str) -> None:
        """Close with a reason. A socket that is full is aborted, because the close frame could not be sent."""
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                await self.socket.close(code, reason)
        except TimeoutError:
            self.socket.transport.abort()
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it, it is to go
            self._guard.note(f"closing the connection of {self.peer.address}", error)
            self.socket.transport.abort()


class _InflatedWork:
    """Work for a compressed message: decompress it, then read it."""

    __slots__ = ("_slices", "_work")

    def __init__(self, client: Client, message: Deflated) -> None:
        self._slices = client.inflate(message)
        self._work: Work | None = None

    def step(self, now: float) -> bool:
        if self._work is not None:
            return self._work.step(now)
        try:
            next(self._slices)
        except StopIteration as end:
            self._work = end.value
            return self._work is not None
        return True

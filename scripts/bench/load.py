"""WebSocket clients that cost next to nothing, so that what is measured is the server.

Frames are masked once, before the clock starts, and sent in blocks; what comes back is counted by its length,
because every copy of one message is as long as the first. At most a window of messages is on its way at any
time, so that nobody has a reason to drop any. Everything happens in one thread. A frame that nobody expected
(a status frame, say) is an error, not noise. Measurements are shorter than the 20 s after which a server pings,
so that each byte is a message's.
"""

from __future__ import annotations

import re
import select
import socket
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import orjson

from rosbridge_sim.shell.websocket.websocket_internals import apply_mask

__all__ = [
    "LoadError",
    "Result",
    "Socket",
    "calls",
    "connect_many",
    "flood",
    "framed_size",
    "masked",
    "pulse",
    "round_trips",
]

PATIENCE = 10
"""A server that says nothing for so long has lost something [s]."""

NUM_CONNECTING = 50
"""Handshakes under way at once: below the listening socket's backlog of 100, beyond which the kernel waits a second."""

_MASK = b"\x37\xfa\x21\x3d"
_WATCHED = -1
_NOW = socket.MSG_DONTWAIT
_CALL_ID = re.compile(rb'"id":"([^"]*)"')
_HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


class LoadError(Exception):
    """The server did not answer as a rosbridge should; the figure would mean nothing."""


@dataclass(frozen=True, slots=True)
class Result:
    """What a measurement saw.

    Attributes:
        num: messages delivered (to each listener), or answers had.
        seconds: from the first byte out to the last byte in.
        latencies: of each of them where they were timed one by one [s].
    """

    num: int
    seconds: float
    latencies: tuple[float, ...] = ()


def masked(payload: bytes) -> bytes:
    """A client's text frame."""
    size = len(payload)
    if size < 126:
        head = bytes((0x81, 0x80 | size))
    elif size < 2**16:
        head = bytes((0x81, 0x80 | 126)) + size.to_bytes(2, "big")
    else:
        head = bytes((0x81, 0x80 | 127)) + size.to_bytes(8, "big")
    return head + _MASK + apply_mask(payload, _MASK)


def framed_size(size: int) -> int:
    """Length of a server's frame around a payload of that length [bytes]."""
    return size + (2 if size < 126 else 4 if size < 2**16 else 10)


class Socket:
    """One client's connection.

    Attributes:
        raw: the blocking socket, with a time-out.
    """

    def __init__(self, port: int) -> None:
        """Connect and begin the handshake; `finish` ends it."""
        self.raw = socket.create_connection(("127.0.0.1", port))
        self.raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", PATIENCE, 0))
        self.raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", PATIENCE, 0))
        self._kept = bytearray()
        self.raw.sendall(_HANDSHAKE)

    def finish(self) -> None:
        """Wait for the end of the handshake."""
        while b"\r\n\r\n" not in self._kept:
            self._fill()
        head, _, rest = bytes(self._kept).partition(b"\r\n\r\n")
        if b" 101 " not in head:
            raise LoadError(f"no WebSocket there: {head!r}")
        self._kept = bytearray(rest)

    def close(self) -> None:
        """Hang up."""
        self.raw.close()

    def tell(self, **op: object) -> None:
        """Send an op."""
        self.raw.sendall(masked(orjson.dumps(op)))

    def payload(self) -> bytes:
        """The next message; waits for it."""
        while True:
            for payload in self._parsed():
                return payload
            self._fill()

    def payloads(self) -> list[bytes]:
        """The messages that are there now; never waits."""
        with suppress(BlockingIOError):
            self._fill(_NOW)
        return list(self._parsed())

    def _fill(self, flags: int = 0) -> None:
        try:
            data = self.raw.recv(2**18, flags)
        except BlockingIOError:
            if flags & _NOW:
                raise
            raise LoadError(f"the server said nothing for {PATIENCE} s") from None
        if not data:
            raise LoadError("the server has hung up")
        self._kept += data

    def _parsed(self) -> Iterator[bytes]:
        kept = self._kept
        while len(kept) >= 10 or (len(kept) >= 2 and len(kept) >= 2 + kept[1]):
            start, size = 2, kept[1]
            if size == 126:
                start, size = 4, int.from_bytes(kept[2:4], "big")
            elif size == 127:
                start, size = 10, int.from_bytes(kept[2:10], "big")
            if len(kept) < start + size:
                return
            is_ping = kept[0] & 0x0F == 9
            payload = bytes(kept[start : start + size])
            del kept[: start + size]
            if not is_ping:
                yield payload


def connect_many(port: int, num: int) -> list[Socket]:
    """So many clients, connected as fast as the server takes them."""
    sockets: list[Socket] = []
    for i in range(num):
        sockets.append(Socket(port))
        if i >= NUM_CONNECTING:
            sockets[i - NUM_CONNECTING].finish()
    for one in sockets[-NUM_CONNECTING:]:
        one.finish()
    return sockets


class _Meter:
    """Counts the messages that listeners have had, all of one length."""

    def __init__(self, listeners: Sequence[Socket], out_size: int, watched: Socket | None = None) -> None:
        self.unit = framed_size(out_size)
        self.received = [0] * len(listeners)
        self._listeners = listeners
        self._index = {s.raw.fileno(): i for i, s in enumerate(listeners)}
        self._room = bytearray(2**18)
        self._poll = select.epoll()
        for fileno in self._index:
            self._poll.register(fileno, select.EPOLLIN)
        if watched is not None:
            self._index[watched.raw.fileno()] = _WATCHED
            self._poll.register(watched.raw.fileno(), select.EPOLLIN)
        self._heard_at = time.perf_counter()

    def count(self, wait: float) -> list[tuple[int, int]]:
        """Take in what has come, waiting so long for it [s].

        Returns:
            (listener, whole messages it has had in all) each, and (_WATCHED, 0) where the watched socket can be read.
        """
        seen = []
        for fileno, _ in self._poll.poll(wait):
            i = self._index[fileno]
            if i == _WATCHED:
                seen.append((i, 0))
                continue
            num_bytes = self._listeners[i].raw.recv_into(self._room, 0, _NOW)
            if not num_bytes:
                raise LoadError("the server has hung up on a listener")
            self.received[i] += num_bytes
            seen.append((i, self.received[i] // self.unit))
        now = time.perf_counter()
        if seen:
            self._heard_at = now
        elif now - self._heard_at > PATIENCE:
            raise LoadError(f"messages were lost: {self.received} bytes came, in units of {self.unit}")
        return seen

    def finish(self, num: int | None = None) -> None:
        """Every listener must have had exactly so many messages, or at least whole ones."""
        self._poll.close()
        if any(count % self.unit or num not in {None, count // self.unit} for count in self.received):
            raise LoadError(f"the listeners got {self.received} bytes, not {num} messages of {self.unit} bytes each")


def flood(
    publisher: Socket, listeners: Sequence[Socket], frame: bytes, out_size: int, *, seconds: float, window: int
) -> Result:
    """Publish one frame over and over, as fast as `window` messages on their way let us.

    Args:
        publisher: sends; must hear nothing meanwhile.
        listeners: each must get every message.
        frame: a masked frame.
        out_size: length of what each listener gets for it [bytes].
        seconds: how long to send; what is on its way then is waited for.
        window: messages sent that some listener has not had yet, at most.
    """
    num_block = max(1, window // 4)
    block = memoryview(frame * num_block)
    pending = block[:0]
    num_sent = num_had = 0
    meter = _Meter(listeners, out_size)
    start = now = time.perf_counter()
    while True:
        is_sending = now - start < seconds
        if not pending and is_sending and num_sent - num_had + num_block <= window:
            pending = block
            num_sent += num_block
        if pending:
            with suppress(BlockingIOError):
                pending = pending[publisher.raw.send(pending, _NOW) :]
        elif not is_sending and num_had == num_sent:
            break
        has_room = num_sent - num_had + num_block <= window
        meter.count(0.001 if pending else 0.0 if is_sending and has_room else 0.05)
        num_had = min(meter.received) // meter.unit
        now = time.perf_counter()
    meter.finish(num_sent)
    heard = publisher.payloads()
    if heard:
        raise LoadError(f"the publisher was told: {heard[0][:500]!r}")
    return Result(num_sent, now - start)


def pulse(
    publisher: Socket, listeners: Sequence[Socket], frame: bytes, out_size: int, *, seconds: float, rate: float
) -> Result:
    """Publish one frame at a rate [Hz]; the latency of each delivery is until its listener's socket was read."""
    meter = _Meter(listeners, out_size)
    num_had = [0] * len(listeners)
    sent_at: list[float] = []
    latencies: list[float] = []
    start = now = time.perf_counter()
    num = round(seconds * rate)
    while len(latencies) < num * len(listeners):
        due = start + len(sent_at) / rate
        if len(sent_at) < num and now >= due:
            sent_at.append(now)
            publisher.raw.sendall(frame)
            continue
        # epoll rounds up to milliseconds: what is left below one is spun away
        wait = due - now if len(sent_at) < num else 0.05
        seen = meter.count(max(0.0, wait - 0.001))
        now = time.perf_counter()
        for i, count in seen:
            latencies += [now - sent_at[k] for k in range(num_had[i], count)]
            num_had[i] = count
    meter.finish(num)
    return Result(num, now - start, tuple(latencies))


def round_trips(
    sender: Socket, receiver: Socket, frame: bytes, is_answer: Callable[[bytes], bool], seconds: float
) -> Result:
    """Send a frame, wait for what answers it, and again: one in flight."""
    latencies = []
    start = sent_at = time.perf_counter()
    while sent_at - start < seconds:
        sender.raw.sendall(frame)
        while not is_answer(receiver.payload()):
            pass
        now = time.perf_counter()
        latencies.append(now - sent_at)
        sent_at = now
    return Result(len(latencies), sent_at - start, tuple(latencies))


def calls(
    callers: Sequence[Socket],
    provider: Socket,
    frame: bytes,
    out_size: int,
    *,
    service: str,
    values: bytes,
    seconds: float,
) -> Result:
    """Call a service that a client provides, each caller as soon as it has its answer.

    Args:
        callers: each has one call in flight.
        provider: answers at once.
        frame: the masked call.
        out_size: length of the answer that a caller gets [bytes].
        service: its name.
        values: the JSON text of what the provider answers.
        seconds: how long to call.
    """
    head = b'{"op":"service_response","service":' + orjson.dumps(service) + b',"id":"'
    tail = b'","values":' + values + b',"result":true}'
    meter = _Meter(callers, out_size, provider)
    latencies: list[float] = []
    num_had = [0] * len(callers)
    start = now = time.perf_counter()
    sent_at = [start] * len(callers)
    for caller in callers:
        caller.raw.sendall(frame)
    num_calls = len(callers)
    while len(latencies) < num_calls:
        seen = meter.count(0.05)
        now = time.perf_counter()
        for i, count in seen:
            if i == _WATCHED:
                ids = [_CALL_ID.search(payload) for payload in provider.payloads()]
                provider.raw.sendall(b"".join([masked(head + found[1] + tail) for found in ids if found]))
                continue
            if count == num_had[i]:
                continue
            num_had[i] = count
            latencies.append(now - sent_at[i])
            if now - start < seconds:
                sent_at[i] = now
                num_calls += 1
                callers[i].raw.sendall(frame)
    meter.finish()
    return Result(num_calls, now - start, tuple(latencies))

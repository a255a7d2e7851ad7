"""WebSocket clients with very low cost, so that the figures are the server's.

Frames are masked before the clock starts, and sent in blocks. Received bytes are counted and divided by the length of
one message, because all copies of a message have the same length. The number of messages in flight is limited, so that
no message has to be dropped. There is one thread. An unexpected frame, such as a status, is an error. Measurements are
shorter than the server's 20 s between pings, so every received byte belongs to a message.
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

from rosbridge_sim.link.websocket_internals import apply_mask

PATIENCE = 10
"""Longest silence of a server before messages count as lost [s]."""

NUM_CONNECTING = 50
"""Handshakes at one time: below the listening socket's backlog of 100, beyond which the kernel waits a second."""

_MASK = b"\x37\xfa\x21\x3d"
_WATCHED = -1
_NOW = socket.MSG_DONTWAIT
_CALL_ID = re.compile(rb'"id":"([^"]*)"')
_HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


class LoadError(Exception):
    """The server did not answer as a rosbridge should, so the figure would be wrong."""


@dataclass(frozen=True, slots=True)
class Result:
    """Result of a measurement.

    Attributes:
        num: messages delivered (to each listener), or answers received.
        seconds: from the first byte sent to the last byte received.
        latencies: of each message or answer, if they were timed one by one [s].
    """

    num: int
    seconds: float
    latencies: tuple[float, ...] = ()


def masked(payload: bytes) -> bytes:
    """Return a text frame of a client.

    Args:
        payload: UTF-8 text.
    """
    size = len(payload)
    if size < 126:
        head = bytes((0x81, 0x80 | size))
    elif size < 2**16:
        head = bytes((0x81, 0x80 | 126)) + size.to_bytes(2, "big")
    else:
        head = bytes((0x81, 0x80 | 127)) + size.to_bytes(8, "big")
    return head + _MASK + apply_mask(payload, _MASK)


def framed_size(size: int) -> int:
    """Return the length of a server's frame.

    Args:
        size: of its payload [bytes].

    Returns:
        The length [bytes].
    """
    return size + (2 if size < 126 else 4 if size < 2**16 else 10)


class Socket:
    """Connection of one client.

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
        """Close the socket."""
        self.raw.close()

    def tell(self, **op: object) -> None:
        """Send an op."""
        self.raw.sendall(masked(orjson.dumps(op)))

    def payload(self) -> bytes:
        """Wait for the next message.

        Returns:
            Its payload.
        """
        while True:
            for payload in self._parsed():
                return payload
            self._fill()

    def payloads(self) -> list[bytes]:
        """Return the messages that have arrived; never waits.

        Returns:
            Their payloads.
        """
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
    """Connect many clients, as fast as the server accepts them.

    Args:
        port: of the server.
        num: number of clients.

    Returns:
        The connections.
    """
    sockets: list[Socket] = []
    for i in range(num):
        sockets.append(Socket(port))
        if i >= NUM_CONNECTING:
            sockets[i - NUM_CONNECTING].finish()
    for one in sockets[-NUM_CONNECTING:]:
        one.finish()
    return sockets


class _Meter:
    """Counter of the messages that listeners have received, all of one length."""

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
        """Receive what has arrived.

        Args:
            wait: longest wait for it [s].

        Returns:
            (listener, whole messages that it has received in all) each; and (_WATCHED, 0) if the watched socket can be
            read.
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
        """Check that every listener has received this number of messages, or whole messages if it is None."""
        self._poll.close()
        if any(count % self.unit or num not in {None, count // self.unit} for count in self.received):
            raise LoadError(f"the listeners got {self.received} bytes, not {num} messages of {self.unit} bytes each")


def flood(
    publisher: Socket, listeners: Sequence[Socket], frame: bytes, out_size: int, *, seconds: float, window: int
) -> Result:
    """Publish one frame repeatedly, as fast as the limit of messages in flight allows.

    Args:
        publisher: sends; must receive nothing meanwhile.
        listeners: each must get every message.
        frame: a masked frame.
        out_size: length of the message at a listener [bytes].
        seconds: duration of sending; then messages in flight are awaited.
        window: largest number of messages in flight.

    Returns:
        Number and duration.
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
    """Publish one frame at a rate.

    Args:
        publisher: sends.
        listeners: each must get every message.
        frame: a masked frame.
        out_size: length of the message at a listener [bytes].
        seconds: duration.
        rate: [Hz].

    Returns:
        Number, duration, and the latency of each delivery until its listener's socket was read.
    """
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
        # epoll rounds up to milliseconds, so the rest below one is spent in a busy loop
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
    """Send a frame, wait for its answer, and repeat: one in flight.

    Args:
        sender: sends.
        receiver: gets the answer.
        frame: a masked frame.
        is_answer: returns true for the payload of the answer.
        seconds: duration.

    Returns:
        Number, duration and latencies.
    """
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
    """Call a service of a client; each caller calls again when it has its answer.

    Args:
        callers: each has one call in flight.
        provider: answers at once.
        frame: the masked call.
        out_size: length of the answer that a caller gets [bytes].
        values: JSON text of the provider's answer.
        seconds: duration.

    Returns:
        Number, duration and latencies.
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

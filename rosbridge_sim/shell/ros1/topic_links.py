"""Connections for topics of ROS 1: to subscribers of ours, and to the publishers that the master names."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.ros1.ros1_types import Ros1Type
from rosbridge_sim.graph.ros1.tcpros import MAX_HEADER, MessageCutter, read_header, write_header
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Parts
from rosbridge_sim.shell.ros1.xmlrpc_http import call, connect

HEADER_TIMEOUT: Final = 5.0
"""Longest wait for a connection, and for its header [s]."""

REST_TIMEOUT: Final = 30.0
"""Longest wait for the next part of a message or a request that has begun [s]: it holds memory."""

MAX_BUFFERED: Final = 64 * 1024
"""Bytes in a socket's buffer from which on messages wait outside of it, where the oldest can be dropped."""

MAX_WAITING: Final = 100
MAX_WAITING_BYTES: Final = 8 * 2**20
"""Most messages, and bytes, that wait for a slow subscriber, besides the newest message. The oldest are dropped first,
because a stale picture is useless."""

CHUNK: Final = 64 * 1024
"""Bytes that are read at once."""

BYTES_PER_TURN: Final = 32 * 1024
LEAST_SIZE: Final = 1024
"""Messages that one turn of the loop takes from a publisher [bytes], of which a short one counts as so many."""


LOST: Final = (OSError, asyncio.IncompleteReadError, UnicodeError, GraphError)
"""Errors of a connection that cannot be made, has ended, or whose other side speaks something else."""


def why_lost(error: Exception) -> str:
    """Return the text for one of them: a time-out has none."""
    return str(error) or "no answer came in time"


async def open_stream(
    host: str, port: int, fields: Mapping[str, str]
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, dict[str, str]]:
    """Connect to a node, and return its header, too.

    Args:
        fields: our header.

    Raises:
        GraphError: the other side refuses, or sends no header.
        OSError, asyncio.IncompleteReadError, UnicodeError: it cannot be reached, or does not answer in time.
    """
    async with asyncio.timeout(HEADER_TIMEOUT):
        reader, writer = await connect(host, port)
    try:
        writer.write(write_header(fields))
        found = await take_header(reader)
    except BaseException:
        writer.close()
        raise
    if "error" in found:
        writer.close()
        raise GraphError(f"refused: {found['error'][:300]}")
    return reader, writer, found


async def take_header(reader: asyncio.StreamReader) -> dict[str, str]:
    """Return the header that the other side sends.

    Raises:
        GraphError: it is malformed, or longer than a header may be.
        OSError, asyncio.IncompleteReadError: the connection has ended, or it does not come in time.
    """
    async with asyncio.timeout(HEADER_TIMEOUT):
        length = int.from_bytes(await reader.readexactly(4), "little")
        if length > MAX_HEADER:
            raise GraphError(f"expected a connection header of at most {MAX_HEADER:,} bytes; got {length:,}")
        return read_header(await reader.readexactly(length))


async def read_body(reader: asyncio.StreamReader, max_size: int, room: Account) -> bytes:
    """Return a request or a response, which has its length before it.

    Args:
        max_size: longest one [bytes].

    Raises:
        GraphError: it is longer, or there is not enough memory for it.
        OSError, asyncio.IncompleteReadError: the connection has ended, or the rest does not come.
    """
    length = int.from_bytes(await reader.readexactly(4), "little")
    if length > max_size:
        raise GraphError(f"expected at most {max_size:,} bytes; got {length:,}")
    data = bytearray()
    try:
        while len(data) < length:
            async with asyncio.timeout(REST_TIMEOUT):
                part = await reader.read(min(CHUNK, length - len(data)))
            if not part:
                raise asyncio.IncompleteReadError(bytes(data[:100]), length)
            data += part
            if not room.take(len(part)):
                del data[-len(part) :]
                raise GraphError("nodes have sent too many bytes of messages that are not complete")
    finally:
        room.give(len(data))
    return bytes(data)


class SubscriberLink:
    """A node that subscribes to a topic of ours.

    Attributes:
        node: its name.
        topic: the topic on the bus.
        num_dropped: messages that it was too slow for.
        num_bytes: what it was sent.
    """

    def __init__(self, node: str, topic: str, writer: asyncio.StreamWriter) -> None:
        self.node = node
        self.topic = topic
        self.num_dropped = self.num_bytes = 0
        self._writer = writer
        self._waiting: deque[bytes] = deque()
        self._num_waiting_bytes = 0
        self._pump: asyncio.Task[None] | None = None
        writer.transport.set_write_buffer_limits(high=MAX_BUFFERED)

    def send(self, framed: bytes) -> bool:
        """Send a message, now or when the node has read what it has.

        Args:
            framed: with its length before it; shared by all subscribers.

        Returns:
            False if an older message was dropped for it.
        """
        if self._writer.is_closing():
            return True
        if self._pump is None and self._writer.transport.get_write_buffer_size() < MAX_BUFFERED:
            self._write(framed)
            return True
        waiting = self._waiting
        waiting.append(framed)
        self._num_waiting_bytes += len(framed)
        before = self.num_dropped
        while len(waiting) > MAX_WAITING or (self._num_waiting_bytes > MAX_WAITING_BYTES and len(waiting) > 1):
            self._num_waiting_bytes -= len(waiting.popleft())
            self.num_dropped += 1
        if self._pump is None:
            self._pump = asyncio.get_running_loop().create_task(self._send_waiting())
        return self.num_dropped == before

    def close(self) -> None:
        """End the connection at once."""
        if self._pump is not None:
            self._pump.cancel()
        self._waiting.clear()
        self._writer.transport.abort()

    def _write(self, framed: bytes) -> None:
        self.num_bytes += len(framed)
        self._writer.write(framed)

    async def _send_waiting(self) -> None:
        try:
            while self._waiting:
                await self._writer.drain()
                if self._waiting:
                    framed = self._waiting.popleft()
                    self._num_waiting_bytes -= len(framed)
                    self._write(framed)
        except OSError:
            self._waiting.clear()  # it has gone
        finally:
            self._pump = None


async def receive(reader: asyncio.StreamReader, cutter: MessageCutter, take: Callable[[bytes], None]) -> None:
    """Give all messages of a publisher to a function, until the connection ends; other work has its turns meanwhile.

    Raises:
        OSError: the connection has ended, or the rest of a message does not come.
    """
    size = 0
    while True:
        async with asyncio.timeout(REST_TIMEOUT if cutter.is_within else None):
            data = await reader.read(CHUNK)
        if not data:
            return
        for raw in cutter.feed(data):
            take(raw)
            size += max(len(raw), LEAST_SIZE)
            if size > BYTES_PER_TURN:
                size = 0
                await asyncio.sleep(0)


def misfit(known: Ros1Type, header: Mapping[str, str], node: str) -> str:
    """Return the text for a node with another definition of a type."""
    found, md5 = header.get("type", "*"), header.get("md5sum", "*")
    return (
        f"{node} has {found[:100]} with md5 sum {md5[:40]}, and this server {known.name} with {known.md5};"
        " choose --release, or give its package by --schema-path"
    )


MAX_PUBLISHERS: Final = 100
"""Most publishers of one topic that are followed."""

MAX_CONNECTING: Final = 32
"""Most publishers at once that we connect to: there may be any number of addresses that do not answer."""

FIRST_WAIT: Final = 0.5
LONGEST_WAIT: Final = 8.0
"""Time until a publisher that cannot be followed is tried again [s], doubled each time."""


@dataclass(eq=False)
class _Reader:
    """A topic, and the tasks that follow its publishers, by address."""

    type: Ros1Type
    tasks: dict[str, asyncio.Task[None]] = field(default_factory=dict)

    def keep(self, uris: Collection[str]) -> None:
        """End the connections to all publishers but some."""
        for uri in [uri for uri in self.tasks if uri not in uris]:
            self.tasks.pop(uri).cancel()


class TopicReaders:
    """All topics that our node subscribes to, by their names on the bus."""

    def __init__(self, parts: Ros1Parts) -> None:
        """Subscribe to nothing yet."""
        self._parts = parts
        self._choices = parts.choices
        self._readers: dict[str, _Reader] = {}
        self._connecting = asyncio.Semaphore(MAX_CONNECTING)

    def open(self, topic: str, far_type: Ros1Type) -> None:
        """Subscribe to a topic; `set_publishers` names its publishers."""
        self._readers[topic] = _Reader(far_type)

    def close(self, topic: str) -> None:
        """Unsubscribe."""
        self._readers.pop(topic).keep(())

    def stop(self) -> None:
        """End all connections."""
        for reader in self._readers.values():
            reader.keep(())

    def types(self) -> Iterator[tuple[str, str]]:
        """Yield name there and type of each topic."""
        return ((self._choices.there(name), one.type.name) for name, one in self._readers.items())

    def links(self) -> Iterator[tuple[str, str]]:
        """Yield name there and address of each publisher that is followed."""
        return ((self._choices.there(name), uri) for name, one in self._readers.items() for uri in one.tasks)

    def num_publishers(self, there: str) -> int | None:
        """Return the number of a topic's publishers that are followed; None without a subscription."""
        reader = self._readers.get(self._choices.here(there))
        return None if reader is None else len(reader.tasks)

    def set_publishers(self, there: str, uris: object, own_uri: str) -> None:
        """Follow the publishers of a topic that the master names, but ourselves."""
        reader = self._readers.get(topic := self._choices.here(there))
        if reader is None or not isinstance(uris, list):
            return
        found = [uri for uri in uris if isinstance(uri, str) and uri != own_uri]
        if len(found) > MAX_PUBLISHERS:
            self._parts.log.tell(f"{topic} has more than {MAX_PUBLISHERS} publishers: the others are not heard")
        reader.keep(found := found[:MAX_PUBLISHERS])
        for uri in found:
            if uri not in reader.tasks:
                reader.tasks[uri] = asyncio.get_running_loop().create_task(self._follow(topic, reader.type, uri))

    async def _follow(self, topic: str, own: Ros1Type, uri: str) -> None:
        """Take the messages of a publisher, which is tried again if it is lost."""
        pause = FIRST_WAIT
        while True:
            try:
                await self._take_messages(topic, own, uri)
                pause = FIRST_WAIT
            except LOST as error:
                self._parts.log.tell(f"{topic}: a publisher cannot be heard: {why_lost(error)}")
                pause = min(2 * pause, LONGEST_WAIT)
            await asyncio.sleep(pause)

    async def _take_messages(self, topic: str, own: Ros1Type, uri: str) -> None:
        fields = {"type": own.name, "md5sum": own.md5, "message_definition": self._parts.types.text(own.name)}
        stream, writer, header = await self._connect(uri, topic, fields)
        cutter = MessageCutter(self._choices.max_message_size, self._choices.room)
        try:
            if header.get("md5sum", "*") not in {"*", own.md5}:
                raise GraphError(misfit(own, header, header.get("callerid", uri)))
            loop = asyncio.get_running_loop()
            await receive(stream, cutter, lambda raw: self._parts.gateway.receive(topic, raw, loop.time()))
        finally:
            writer.close()
            cutter.close()
            if cutter.num_skipped:
                self._parts.log.tell(f"{topic}: messages beyond --max-frame-size are dropped")

    async def learn(self, node: str, topic: str, type_name: str) -> None:
        """Learn the type of a topic from the header that its publisher sends.

        Raises:
            GraphError, OSError, asyncio.IncompleteReadError: it cannot be had.
        """
        uri = await self._choices.ask("lookupNode", node)
        fields = {"type": type_name, "md5sum": "*", "message_definition": ""}
        _, writer, header = await self._connect(uri, topic, fields)
        writer.close()
        self._parts.types.learn(type_name, header.get("message_definition", ""), header.get("md5sum", ""))

    async def _connect(
        self, uri: str, topic: str, fields: dict[str, str]
    ) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, dict[str, str]]:
        """Connect to a publisher of a topic, and return its header, too; errors as for `learn`."""
        there = self._choices.there(topic)
        async with self._connecting:
            answer = await call(uri, "requestTopic", self._choices.name, there, [["TCPROS"]])
            match answer:
                case [_, str(host), int(port)] if 0 < port < 2**16:
                    own = {"callerid": self._choices.name, "topic": there, "tcp_nodelay": "1"}
                    return await open_stream(host, port, own | fields)
        raise GraphError(f"expected TCPROS and an address; got {str(answer)[:100]}")

"""The topics that our node subscribes to: connections to their publishers, which the master names."""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.ros1.ros1_types import Ros1Type
from rosbridge_sim.graph.ros1.tcpros import MessageCutter
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Parts
from rosbridge_sim.shell.ros1.topic_links import LOST, misfit, open_stream, receive, why_lost
from rosbridge_sim.shell.ros1.xmlrpc_http import call

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
            take, time = self._parts.gateway.receive, asyncio.get_running_loop().time
            await receive(stream, cutter, lambda raw: take(topic, raw, time()))
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

"""The connections that nodes make to ours: subscribers of our topics, and callers of our services."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.gateway.far_graph import Endpoint
from rosbridge_sim.graph.gateway.gateway import Gateway
from rosbridge_sim.graph.gateway.node_services import NodeServices
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros1.ros1_graph import is_name
from rosbridge_sim.graph.ros1.ros1_types import Ros1Type, Ros1Types
from rosbridge_sim.graph.ros1.tcpros import with_length, write_header
from rosbridge_sim.shell.ros1.other_nodes import OtherNodes
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Choices
from rosbridge_sim.shell.ros1.service_links import serve_calls
from rosbridge_sim.shell.ros1.topic_links import CHUNK, LOST, SubscriberLink, misfit, take_header
from rosbridge_sim.shell.ros1.xmlrpc_http import send

MAX_CONNECTIONS: Final = 500
"""Most connections of nodes at once, to topics and services of ours. One more takes the place of the oldest one that
has not told its name."""

_VALUES: Final = re.compile(r"(?<!md5 sum )\b[\d,]+\b|b?'.*'|b?\".*\"", re.DOTALL)
"""Numbers and quoted bytes of strangers in the line about a connection that is refused."""


@dataclass(eq=False)
class _Writer:
    """A topic that we publish; `links` are its subscribers."""

    type: Ros1Type
    quality: Quality
    links: set[SubscriberLink] = field(default_factory=set)


class NodeServer:
    """Takes the connections of nodes; one port serves topics and services.

    Attributes:
        port: where it listens.
    """

    def __init__(
        self,
        choices: Ros1Choices,
        types: Ros1Types,
        log: OnceLog,
        others: OtherNodes,
        *,
        gateway: Gateway[Ros1Type],
        services: NodeServices,
    ) -> None:
        """Listen nowhere yet.

        Args:
            others: hear of callers.
            gateway: hears of subscribers.
            services: get the calls.
        """
        self._gateway = gateway
        self._services = services
        self.port = 0
        self._choices = choices
        self._types = types
        self._log = log
        self._others = others
        self._loop = asyncio.get_running_loop()
        self._server: asyncio.Server | None = None
        self._writers: dict[str, _Writer] = {}
        self._connections: dict[asyncio.StreamWriter, None] = {}
        self._silent: dict[asyncio.StreamWriter, None] = {}  # those whose header has not come, oldest first
        self._num_links = 0

    async def start(self) -> None:
        """Listen.

        Raises:
            OSError: the host cannot be used.
        """
        self._server = await asyncio.start_server(self._accept, self._choices.host, 0)
        self.port = self._server.sockets[0].getsockname()[1]

    def stop_listening(self) -> None:
        """Take no more connections: nodes connect anew as soon as they lose a topic."""
        if self._server is not None:
            self._server.close()
            self._server = None

    def stop(self) -> None:
        """End all connections."""
        for writer in list(self._connections):
            writer.transport.abort()

    # Topics

    def open_writer(self, topic: str, far_type: Ros1Type, quality: Quality) -> None:
        """Publish on a topic."""
        self._writers[topic] = _Writer(far_type, quality)

    def close_writer(self, topic: str) -> None:
        """Stop to publish on a topic, and end the connections of its subscribers."""
        for link in self._writers.pop(topic).links:
            link.close()

    def write(self, topic: str, raw: bytes) -> bool:
        """Send a message to all subscribers; return False if an older one was dropped for it."""
        links = self._writers[topic].links
        if not links:
            return True
        framed = with_length(raw)  # one copy for all
        is_complete = True
        for link in links:
            if not link.send(framed):
                is_complete = False
                self._log.tell(
                    f"node {link.node} is too slow for {topic}: its oldest messages are dropped", logging.INFO
                )
        return is_complete

    def publishes(self, there: str) -> bool:
        """Return True if we publish a topic, by its name there."""
        return self._choices.here(there) in self._writers

    def types(self) -> Iterator[tuple[str, str]]:
        """Yield name there and type of each topic that we publish."""
        return ((self._choices.there(name), one.type.name) for name, one in self._writers.items())

    def links(self) -> Iterator[tuple[str, SubscriberLink]]:
        """Yield each subscriber with the name there of its topic."""
        return ((self._choices.there(link.topic), link) for one in self._writers.values() for link in one.links)

    # Connections

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._server is None:  # it came just before the end
            writer.transport.abort()
            return
        if len(self._connections) >= MAX_CONNECTIONS:
            self._log.tell(f"more than {MAX_CONNECTIONS} connections of nodes: silent ones and new ones are closed")
            oldest = next(iter(self._silent), writer)
            self._silent.pop(oldest, None)
            oldest.transport.abort()
            if oldest is writer:
                return
        self._connections[writer] = self._silent[writer] = None
        try:
            header = await take_header(reader)
            self._silent.pop(writer, None)
            node = header.get("callerid", "")
            if not is_name(node):
                raise GraphError(f"expected a callerid such as /node; got {node[:100]!r}")
            if "service" in header:
                await self._serve_service(header, node, reader, writer)
            else:
                await self._serve_topic(header, node, reader, writer)
        except PeerError as error:
            text = f"a node is refused: {error}"
            # The reason of a node that connects anew, because the end of a topic has not reached it yet.
            is_late = error.reason is Reason.UNKNOWN_TOPIC
            self._log.tell(text, logging.INFO if is_late else logging.WARNING, _VALUES.sub("", text))
            with suppress(OSError):
                send(writer, write_header({"error": str(error)}))
        except LOST:
            pass  # it has gone, or is silent
        finally:
            del self._connections[writer]
            self._silent.pop(writer, None)
            writer.close()

    async def _serve_topic(
        self, header: dict[str, str], node: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        there = header.get("topic", "")
        topic = self._choices.here(there)
        known = self._writers.get(topic)
        if known is None:
            raise GraphError(f"{there[:200]!r} is not published here", reason=Reason.UNKNOWN_TOPIC)
        own = {"type": known.type.name, "md5sum": known.type.md5}
        if any(header.get(name, "*") not in {"*", value} for name, value in own.items()):
            raise GraphError(f"{topic}: {misfit(known.type, header, node)}")
        rest = {"callerid": self._choices.name, "topic": there, "latching": str(int(known.quality.is_latched))}
        send(writer, write_header({**own, **rest, "message_definition": self._types.text(known.type.name)}))
        link = SubscriberLink(node, topic, writer)
        self._num_links += 1
        key = f"link {self._num_links}"
        known.links.add(link)
        try:
            endpoint = Endpoint(key, topic, known.type.name, False, Quality(), node)  # noqa: FBT003 - a field
            self._gateway.note_endpoints([endpoint], [], self._loop.time())
            for raw in self._gateway.latched(topic):
                link.send(with_length(raw))
            while await reader.read(CHUNK):
                pass  # a subscriber has nothing to say
        finally:
            known.links.discard(link)
            link.close()
            self._gateway.note_endpoints([], [key], self._loop.time())

    async def _serve_service(
        self, header: dict[str, str], node: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        there = header["service"]
        name = self._choices.here(there)
        service = self._services.find(name)
        md5 = header.get("md5sum", "*")
        if md5 not in {"*", service.hash}:
            raise GraphError(f"{name}: {node} has another definition of {service.name}: md5 sum {md5[:40]}")
        types = {"request_type": service.request.name, "response_type": service.response.name}
        fields = {"callerid": self._choices.name, "type": service.name, "md5sum": service.hash, "service": there}
        send(writer, write_header(fields | types))
        if header.get("probe") == "1":
            await writer.drain()
            return
        await self._others.meet_caller(node)
        await serve_calls(
            reader,
            writer,
            lambda request, on_reply: self._services.call(node, name, request, on_reply, self._loop.time()),
            self._choices,
            is_persistent=header.get("persistent") == "1",
        )

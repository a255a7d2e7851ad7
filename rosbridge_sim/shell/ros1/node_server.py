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
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros1.ros1_graph import is_name
from rosbridge_sim.graph.ros1.ros1_types import Ros1Type
from rosbridge_sim.graph.ros1.tcpros import with_length, write_header
from rosbridge_sim.shell.ros1.other_nodes import OtherNodes
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Parts
from rosbridge_sim.shell.ros1.service_links import serve_calls
from rosbridge_sim.shell.ros1.topic_links import CHUNK, SubscriberLink, misfit, take_header
from rosbridge_sim.shell.ros1.xmlrpc_http import BoundedServer, send

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


class NodeServer(BoundedServer):
    """Takes the connections of nodes; one port serves topics and services. Idle are those whose header has not come."""

    most = MAX_CONNECTIONS
    limit = CHUNK

    def __init__(self, parts: Ros1Parts, others: OtherNodes) -> None:
        """Listen nowhere yet.

        Args:
            others: hear of callers.
        """
        super().__init__()
        self._parts = parts
        self._choices = parts.choices
        self._others = others
        self._loop = asyncio.get_running_loop()
        self._writers: dict[str, _Writer] = {}
        self._num_links = 0

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
                text = f"node {link.node} is too slow for {topic}: its oldest messages are dropped"
                self._parts.log.tell(text, logging.INFO)
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

    def _make_room(self) -> bool:
        self._parts.log.tell(f"more than {self.most} connections of nodes: silent ones and new ones are closed")
        return super()._make_room()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            header = await take_header(reader)
            self.idle.pop(writer, None)
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
            self._parts.log.tell(text, logging.INFO if is_late else logging.WARNING, _VALUES.sub("", text))
            with suppress(OSError):
                send(writer, write_header({"error": str(error)}))

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
        send(writer, write_header({**own, **rest, "message_definition": self._parts.types.text(known.type.name)}))
        link = SubscriberLink(node, topic, writer)
        self._num_links += 1
        key = f"link {self._num_links}"
        known.links.add(link)
        try:
            endpoint = Endpoint(key, topic, known.type.name, False, Quality(), node)  # noqa: FBT003 - a field
            self._parts.gateway.note_endpoints([endpoint], [], self._loop.time())
            for raw in self._parts.gateway.latched(topic):
                link.send(with_length(raw))
            while await reader.read(CHUNK):
                pass  # a subscriber has nothing to say
        finally:
            known.links.discard(link)
            link.close()
            self._parts.gateway.note_endpoints([], [key], self._loop.time())

    async def _serve_service(
        self, header: dict[str, str], node: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        there = header["service"]
        name = self._choices.here(there)
        service = self._parts.services.find(name)
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
            lambda request, on_reply: self._parts.services.call(node, name, request, on_reply, self._loop.time()),
            self._choices,
            is_persistent=header.get("persistent") == "1",
        )

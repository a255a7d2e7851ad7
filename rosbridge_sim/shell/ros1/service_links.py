"""Connections for services of ROS 1: calls of nodes, and calls of services that nodes provide."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.far_graph import FarServiceType, OnReply
from rosbridge_sim.graph.ros1.tcpros import with_length
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Choices
from rosbridge_sim.shell.ros1.topic_links import LOST, open_stream, read_body, why_lost
from rosbridge_sim.shell.ros1.xmlrpc_http import address_of, send

MAX_IDLE: Final = 4
"""Connections to one service that are kept for later calls."""

MAX_CALLS: Final = 16
"""Most calls at once to one service of a node: each has a connection; the others wait for their turn."""

ANSWER_TIMEOUT: Final = 30.0
"""Longest wait until a node takes an answer that we send [s]."""


async def serve_calls(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    call: Callable[[bytes, OnReply], None],
    choices: Ros1Choices,
    *,
    is_persistent: bool,
) -> None:
    """Answer the calls of a node on one connection, one after the other.

    Args:
        call: calls the service.
        is_persistent: more than one call may come.

    Raises:
        OSError, asyncio.IncompleteReadError: the connection has ended.
    """
    loop = asyncio.get_running_loop()
    while True:
        try:
            request = await read_body(reader, choices.max_message_size, choices.room)
        except GraphError as error:
            reply, is_persistent = (False, str(error).encode()), False
        else:
            future: asyncio.Future[tuple[bool, bytes]] = loop.create_future()

            def on_reply(is_ok: bool, body: bytes, future: asyncio.Future[tuple[bool, bytes]] = future) -> None:  # noqa: FBT001 - see `OnReply`
                if not future.done():
                    future.set_result((is_ok, body))

            call(request, on_reply)
            reply = await future
        send(writer, (b"\1" if reply[0] else b"\0") + with_length(reply[1]))
        async with asyncio.timeout(ANSWER_TIMEOUT):
            await writer.drain()
        if not is_persistent:
            return
        await asyncio.sleep(0)  # other work has its turn, however many requests have come


class FarServices:
    """Calls of services that nodes provide, over connections that are kept; see `FarCall`."""

    def __init__(self, choices: Ros1Choices) -> None:
        """Make no connection yet."""
        self._choices = choices
        self._idle: dict[str, list[tuple[asyncio.StreamReader, asyncio.StreamWriter]]] = {}
        self._running: set[asyncio.Task[None]] = set()
        self._turns: dict[str, asyncio.Semaphore] = {}

    def call(self, name: str, service: FarServiceType, request: bytes, call: Call, on_reply: OnReply) -> None:
        """See `FarCall`."""
        task = asyncio.get_running_loop().create_task(self._run(name, service, request, on_reply))
        self._running.add(task)
        task.add_done_callback(self._running.discard)
        call.on_end = task.cancel  # no one waits for the answer any more

    def forget(self, name: str) -> None:
        """Close the idle connections of a service, because it has ended or moved."""
        self._turns.pop(name, None)
        for _, writer in self._idle.pop(name, ()):
            writer.close()

    def stop(self) -> None:
        """End all calls and connections."""
        for task in list(self._running):
            task.cancel()
        for name in list(self._idle):
            self.forget(name)

    async def _run(self, name: str, service: FarServiceType, request: bytes, on_reply: OnReply) -> None:
        try:
            async with self._turns.setdefault(name, asyncio.Semaphore(MAX_CALLS)):
                reply = await self._ask(name, service, request)
        except LOST as error:
            reply = False, f"Service {name} of ROS 1 was lost: {why_lost(error)}".encode()
        on_reply(*reply)

    async def _ask(self, name: str, service: FarServiceType, request: bytes) -> tuple[bool, bytes]:
        idle = self._idle.setdefault(name, [])
        while idle and (idle[-1][1].is_closing() or idle[-1][0].at_eof()):
            idle.pop()[1].close()
        reader, writer = idle.pop() if idle else await self._connect(name, service)
        try:
            writer.write(with_length(request))
            is_ok = (await reader.readexactly(1)) == b"\1"
            body = await read_body(reader, self._choices.max_message_size, self._choices.room)
        except BaseException:
            writer.close()
            raise
        if self._idle.get(name) is idle and len(idle) < MAX_IDLE:
            idle.append((reader, writer))
        else:
            writer.close()
        return is_ok, body

    async def _connect(self, name: str, service: FarServiceType) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        there = self._choices.there(name)
        fields = {"callerid": self._choices.name, "service": there, "md5sum": service.hash, "type": service.name}
        host, port = address_of(str(await self._choices.ask("lookupService", there)), "rosrpc")
        reader, writer, _ = await open_stream(host, port, {**fields, "persistent": "1", "tcp_nodelay": "1"})
        return reader, writer


async def probe(choices: Ros1Choices, there: str) -> dict[str, str]:
    """Return the header of a service, which names its type.

    Args:
        there: its name on the graph.

    Raises:
        GraphError, OSError, asyncio.IncompleteReadError: it cannot be asked.
    """
    host, port = address_of(str(await choices.ask("lookupService", there)), "rosrpc")
    fields = {"callerid": choices.name, "service": there, "md5sum": "*", "probe": "1"}
    _, writer, header = await open_stream(host, port, fields)
    writer.close()
    return header

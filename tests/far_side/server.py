"""Imitation of rosbridge_suite for ROS 1 (0.11), dialled by tests.

    async with FarSide() as far_side:
        await connect(far_side.url)

A client must send it nothing that does not fit its type: the block then ends with an error, unless its log was cleared.
It stands for a ROS machine: a master, rosbridge_websocket and, if wished, rosapi. Its manners are told where they are
shown: `client.py` has those of the wire, `graph.py` those of topics and services, `messages.py` those of types. Beyond
them it can be slow (`work`, `utf8_check`, `rosapi_delay`), stand still (`may_work`), die (`kill`) and come back on the
same port.

`python -m tests.far_side` runs it as a process; `GET /report` on its port says as JSON how long its longest queue was.
"""

from __future__ import annotations

import asyncio
import http
import json
import logging
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Coroutine
from types import TracebackType
from typing import Any, Self

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.http11 import Request, Response

from tests.far_side.client import Client
from tests.far_side.graph import Graph, Service
from tests.far_side.messages import UNFIT, Json, Types
from tests.far_side.rosapi import add_rosapi

__all__ = ["FarSide"]

_log = logging.getLogger("far_side")

_STANDING = {"/rosout": "rosgraph_msgs/Log", "/client_count": "std_msgs/Int32"}
"""Topics of rosbridge's own node."""


CHUNK = 65_536
"""What twisted reads of a socket at once [bytes]."""


def _checked(far_side: FarSide) -> type[ServerConnection]:
    """Return a connection whose bytes are checked as they come, while no other socket is read, as by autobahn."""

    class CheckedConnection(ServerConnection):
        def data_received(self, data: bytes) -> None:
            if far_side.utf8_check:
                self.transport.max_size = CHUNK  # type: ignore[attr-defined]  # of asyncio, for its next read
                time.sleep(len(data) * far_side.utf8_check / 1e6)
            super().data_received(data)

    return CheckedConnection


class FarSide:
    """A ROS machine with rosbridge on it.

    Attributes:
        graph: its topics and services.
        log: the last lines that it logged; a client hears of none of it.
        may_work: cleared, no client's thread gets on, while the sockets are still read.
        work: how long a thread takes for a frame [s].
        num_handled: frames that were handled, and `most_waiting` the length of the longest queue ever.
        num_clients: connections there ever were.
        num_published: messages of each topic that were handled.
    """

    def __init__(
        self,
        port: int = 0,
        *,
        release: str = "22.R2",
        without: Collection[str] = (),
        has_rosapi: bool = True,
        max_message_size: int | None = 10_000_000,
        work: float = 0.0,
        utf8_check: float = 0.0,
        rosapi_delay: float = 0.0,
    ) -> None:
        """A far side that does not listen yet.

        Args:
            port: to listen on; 0 takes a free one, and keeps it when it is started again.
            release: of morai_msgs there.
            without: packages that are not built there.
            has_rosapi: whether that node runs.
            max_message_size: longer messages go out in fragments, unasked [characters].
            work: how long a thread takes for a frame [s].
            utf8_check: how long the one thread that reads all sockets takes to check a megabyte [s]; autobahn 22.7
                takes 0.12 with wsaccel 0.6.4 on a core of its own, and 0.0024 with wsaccel 0.6.6.
            rosapi_delay: how long that node takes for an answer [s].
        """
        self.port = port
        self.log: deque[str] = deque(maxlen=10_000)
        self.may_work = asyncio.Event()
        self.may_work.set()
        self.work = work
        self.utf8_check = utf8_check
        self.rosapi_delay = rosapi_delay
        self.num_published: Counter[str] = Counter()
        self.max_message_size = max_message_size
        self.pieces: dict[Any, dict[Any, str]] = {}
        self.num_handled = self.most_waiting = self.num_clients = 0
        self._types = Types(release, without)
        self._has_rosapi = has_rosapi
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: Server | None = None
        self.graph = self._make_graph()

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.port}"

    async def __aenter__(self) -> Self:
        await self.listen()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.stop()
        if kind is None:
            unfit = [line for line in self.log if UNFIT.search(line)]
            assert not unfit, f"messages that ROS 1 refuses: {unfit[:5]}"

    async def listen(self) -> None:
        """Serve clients from now on; a second time after `stop` or `kill`, and nothing is remembered then."""
        self.graph = self._make_graph()
        for topic, kind in _STANDING.items():
            self.graph.advertise(self.graph.topic(topic, kind), None, None, is_latched=True)
        if self._has_rosapi:
            add_rosapi(self.graph)
        # permessage-deflate and pings are off by default, and there is no limit to what comes in
        self._server = await serve(
            self._greet,
            "127.0.0.1",
            self.port,
            compression=None,
            ping_interval=None,
            max_size=None,
            max_queue=None,
            process_request=self._look,
            create_connection=_checked(self),
        )
        (socket,) = self._server.sockets
        self.port = socket.getsockname()[1]

    async def stop(self) -> None:
        """End in order, as by Ctrl-C: every connection is closed."""
        await self._end()

    async def kill(self) -> None:
        """End as by `kill -9`: every connection is reset, without a word."""
        assert self._server is not None
        for connection in self._server.connections:
            connection.transport.abort()
        await self._end()

    def provide(self, name: str, kind: str, handler: Callable[[Json], Json] = lambda _: {}) -> None:
        """Have a node of the far side serve something."""
        request, response = self.graph.types.service(kind)
        self.graph.services[name] = Service(name, kind, request, response, handler=handler)

    def restart_master(self) -> None:
        """Have the ROS master restarted, without rosapi: the bridge lives on, and nobody there is known any more."""
        self.graph.forget_registrations()

    def start_rosapi(self) -> None:
        """Start that node."""
        add_rosapi(self.graph)

    # For its clients

    def start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Do something in a thread, so to speak; it ends with the far side at the latest."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def say(self, line: str) -> None:
        """Log a line."""
        self.log.append(line)
        _log.error("%s", line)

    def note_waiting(self, num_waiting: int) -> None:
        """A client's queue is so long."""
        self.most_waiting = max(self.most_waiting, num_waiting)

    def _make_graph(self) -> Graph:
        return Graph(self._types, self.start)

    async def _greet(self, connection: ServerConnection) -> None:
        self.num_clients += 1
        await Client(self, connection, self.num_clients).run()

    def _look(self, connection: ServerConnection, request: Request) -> Response | None:
        if request.path != "/report":
            return None
        report: Json = {"handled": self.num_handled, "most_waiting": self.most_waiting, "clients": self.num_clients}
        report["published"] = self.num_published
        return connection.respond(http.HTTPStatus.OK, json.dumps(report))

    async def _end(self) -> None:
        assert self._server is not None
        self._server.close()
        await self._server.wait_closed()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

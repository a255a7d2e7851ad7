"""A master of ROS 1 and a node, as small as they can be, over real sockets on loopback.

What they do is what rosmaster and rospy do on the wire, see `tests/end_to_end/test_ros1.py`, which runs the real ones.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.ros1.tcpros import read_header, with_length, write_header
from rosbridge_sim.shell.ros1.xmlrpc_http import XmlRpcServer, call
from tests.support import PATIENCE

STRING_MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"
TRIGGER_MD5 = "937c9679a518e3a18d831e57125ea522"

MOST_SERVICES = (
    "/rosapi/[acfhimnp]*",
    "/rosapi/definition",
    "/rosapi/service_[hnpr]*",
    "/rosapi/su*",
    "/rosapi/topic[_s]?*",
)
"""Services of rosapi that tests of others deny: a server registers each of them, and looks at all again and again."""

Stream = tuple[asyncio.StreamReader, asyncio.StreamWriter]
Reply = tuple[bool, bytes]
"""Whether a service succeeds, and its response or the reason."""


async def until(condition: Callable[[], object]) -> None:
    """Look every two milliseconds whether a condition holds, which no event tells."""
    async with asyncio.timeout(PATIENCE):
        while not condition():  # noqa: ASYNC110 - as above
            await asyncio.sleep(0.002)


class SmallMaster:
    """A master: registrations, parameters, and the calls that tell nodes of changes."""

    def __init__(self) -> None:
        self.server = XmlRpcServer(self.answer)
        self.kinds: dict[str, dict[str, dict[str, str]]] = {}
        self.types: dict[str, str] = {}
        self.nodes: dict[str, str] = {}
        self.services: dict[str, tuple[str, str]] = {}
        self.parameters: dict[str, Any] = {}
        self.num_looks = 0
        self.forget()

    def forget(self) -> None:
        """Lose all registrations, as in a restart."""
        self.kinds = {"Publisher": {}, "Subscriber": {}}
        self.types.clear()
        self.nodes.clear()
        self.services.clear()

    async def start(self) -> SmallMaster:
        await self.server.start("127.0.0.1")
        return self

    @property
    def uri(self) -> str:
        return f"http://127.0.0.1:{self.server.port}"

    def publishers(self, topic: str) -> dict[str, str]:
        """Node -> address of each publisher of a topic."""
        return self.kinds["Publisher"].get(topic, {})

    def answer(self, method: str, args: Sequence[Any]) -> list[Any]:
        self.num_looks += method == "getSystemState"
        node, *rest = args
        for kind, topics in self.kinds.items():
            if method == f"register{kind}":
                topic, type_name, uri = rest
                self.types[topic], self.nodes[node] = type_name, uri
                topics.setdefault(topic, {})[node] = uri
                if kind == "Publisher":
                    self.tell_publishers(topic)
                return [1, "", list(self.publishers(topic).values())]
            if method == f"unregister{kind}":
                topics.get(rest[0], {}).pop(node, None)
                if kind == "Publisher":
                    self.tell_publishers(rest[0])
                return [1, "", 1]
        return getattr(self, f"_{method}")(node, *rest)  # type: ignore[no-any-return] # of the methods below

    def tell_publishers(self, topic: str) -> None:
        uris = list(self.publishers(topic).values())
        for uri in self.kinds["Subscriber"].get(topic, {}).values():
            tell(uri, "publisherUpdate", "/master", topic, uris)

    def _registerService(self, node: str, name: str, service_uri: str, uri: str) -> list[Any]:  # noqa: N802 - of ROS
        self.services[name], self.nodes[node] = (node, service_uri), uri
        return [1, "", 1]

    def _unregisterService(self, _node: str, name: str, service_uri: str) -> list[Any]:  # noqa: N802 - of ROS
        if self.services.get(name, ("", ""))[1] == service_uri:
            del self.services[name]
        return [1, "", 1]

    def _lookupNode(self, _node: str, name: str) -> list[Any]:  # noqa: N802 - of ROS
        return [1, "", self.nodes[name]] if name in self.nodes else [-1, "unknown node", ""]

    def _lookupService(self, _node: str, name: str) -> list[Any]:  # noqa: N802 - of ROS
        return [1, "", self.services[name][1]] if name in self.services else [-1, "no provider", ""]

    def _getSystemState(self, _node: str) -> list[Any]:  # noqa: N802 - of ROS
        topics = [[[topic, list(nodes)] for topic, nodes in one.items() if nodes] for one in self.kinds.values()]
        return [1, "", [*topics, [[name, [node]] for name, (node, _) in self.services.items()]]]

    def _getTopicTypes(self, _node: str) -> list[Any]:  # noqa: N802 - of ROS
        return [1, "", [list(one) for one in self.types.items()]]

    def _subscribeParam(self, _node: str, _uri: str, _name: str) -> list[Any]:  # noqa: N802 - of ROS
        return [1, "", self.parameters]

    def _unsubscribeParam(self, _node: str, _uri: str, _name: str) -> list[Any]:  # noqa: N802 - of ROS
        return [1, "", 1]

    def _setParam(self, _node: str, name: str, value: Any) -> list[Any]:  # noqa: ANN401, N802 - of ROS
        self.parameters[name.strip("/")] = value
        return [1, "", 0]

    def _deleteParam(self, _node: str, name: str) -> list[Any]:  # noqa: N802 - of ROS
        del self.parameters[name.strip("/")]
        return [1, "", 0]


_tasks: set[asyncio.Task[Any]] = set()


def tell(uri: str, method: str, *args: object) -> None:
    """Call a node, and do not wait for its answer."""

    async def run() -> None:
        with suppress(GraphError):
            await call(uri, method, *args)

    task = asyncio.get_running_loop().create_task(run())
    _tasks.add(task)
    task.add_done_callback(_tasks.discard)


class SmallNode:
    """A node: it publishes texts, subscribes, offers services and calls them.

    Attributes:
        headers: those that came from subscribers and callers.
    """

    def __init__(self, master: SmallMaster, name: str) -> None:
        self.name = name
        self.headers: list[dict[str, str]] = []
        self.answer_header: dict[str, str] = {}
        self.handle: Callable[[bytes], Reply | Awaitable[Reply]] = lambda request: (True, request)
        self.subscribers: list[asyncio.StreamWriter] = []
        self._master = master
        self._api = XmlRpcServer(self._answer)
        self._server: asyncio.Server | None = None
        self._streams: list[asyncio.StreamWriter] = []

    async def start(self) -> SmallNode:
        await self._api.start("127.0.0.1")
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        return self

    def die(self) -> None:
        """Be gone without a word, as by kill -9."""
        self._api.stop()
        if self._server is not None:
            self._server.close()
            self._server = None
        for writer in [*self._streams, *self.subscribers]:
            writer.transport.abort()

    @property
    def uri(self) -> str:
        return f"http://127.0.0.1:{self._api.port}/"

    @property
    def port(self) -> int:
        assert self._server is not None
        return int(self._server.sockets[0].getsockname()[1])

    async def register(self, kind: str, name: str, rest: str) -> Any:  # noqa: ANN401 - any value of XML-RPC
        """Register a topic with its type, or a service."""
        rest = f"rosrpc://127.0.0.1:{self.port}" if kind == "Service" else rest
        return await call(self._master.uri, f"register{kind}", self.name, name, rest, self.uri)

    def _answer(self, method: str, _args: Sequence[Any]) -> list[Any]:
        return [1, "", ["TCPROS", "127.0.0.1", self.port] if method == "requestTopic" else 1]

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._server is None:  # it has died
            writer.transport.abort()
            return
        self._streams.append(writer)
        with suppress(OSError, asyncio.IncompleteReadError):
            header = await take_header(reader)
            writer.write(write_header({"callerid": self.name, **self.answer_header}))
            self.headers.append(header)
            if "service" not in header:
                self.subscribers.append(writer)
                return
            if header.get("probe") == "1":
                writer.close()
                return
            while True:
                request = await take_message(reader)
                reply = self.handle(request)
                is_ok, body = await reply if isinstance(reply, Awaitable) else reply
                writer.write(bytes([is_ok]) + with_length(body))

    def say(self, body: bytes) -> None:
        """Send a message to all subscribers."""
        for writer in self.subscribers:
            writer.write(with_length(body))

    async def subscribe(self, topic: str, **fields: str) -> tuple[dict[str, str], Stream]:
        """Register as a subscriber and connect to the first publisher; its header, and the stream of messages."""
        host, port = await self.ask_topic(topic, fields.get("type", "*"))
        return await self.connect(host, port, {"topic": topic, "type": "*", "md5sum": "*", **fields})

    async def ask_topic(self, topic: str, type_name: str = "*") -> tuple[str, int]:
        """Register as a subscriber; where the first publisher takes connections."""
        uris = await self.register("Subscriber", topic, type_name)
        _, host, port = await call(uris[0], "requestTopic", self.name, topic, [["TCPROS"]])
        return host, port

    async def open_service(self, name: str, **fields: str) -> tuple[dict[str, str], Stream]:
        """Connect to a service; its header, and the stream of calls."""
        uri = await call(self._master.uri, "lookupService", self.name, name)
        port = uri.rpartition(":")[2].strip("/")
        return await self.connect("127.0.0.1", int(port), {"service": name, "md5sum": "*", **fields})

    async def connect(self, host: str, port: int, fields: Mapping[str, str]) -> tuple[dict[str, str], Stream]:
        reader, writer = await asyncio.open_connection(host, port)
        self._streams.append(writer)
        writer.write(write_header({"callerid": self.name, **fields}))
        return await take_header(reader), (reader, writer)


async def take_message(reader: asyncio.StreamReader) -> bytes:
    """The next message of a stream."""
    async with asyncio.timeout(PATIENCE):
        return await reader.readexactly(int.from_bytes(await reader.readexactly(4), "little"))


async def take_header(reader: asyncio.StreamReader) -> dict[str, str]:
    return read_header(await take_message(reader))


async def ask(stream: Stream, request: bytes) -> tuple[bool, bytes]:
    """Call a service on an open connection."""
    stream[1].write(with_length(request))
    async with asyncio.timeout(PATIENCE):
        is_ok = await stream[0].readexactly(1)
    return is_ok == b"\1", await take_message(stream[0])

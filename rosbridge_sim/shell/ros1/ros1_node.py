"""Our node on the graph of ROS 1: its registrations with the master, its own server, and its connections.

One task looks at the master once a second, and registers what is wanted and missing there: so a master that was
restarted gets everything anew. All else are connections on the event loop.
"""

from __future__ import annotations

import asyncio
import logging
import os
import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.gateway.far_graph import Endpoint, FarService
from rosbridge_sim.graph.gateway.gateway import Gateway
from rosbridge_sim.graph.gateway.node_services import NodeServices
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros1.master_parameters import MasterParameters
from rosbridge_sim.graph.ros1.master_view import MasterView, Registration, read_view
from rosbridge_sim.graph.ros1.ros1_graph import is_name, name_here, name_there, type_of
from rosbridge_sim.graph.ros1.ros1_types import Ros1Service, Ros1Type, Ros1Types
from rosbridge_sim.graph.ros1.tcpros import MessageCutter, Room, with_length, write_header
from rosbridge_sim.records import Record
from rosbridge_sim.shell.ros1.service_links import FarServices, call_of, probe, serve_calls
from rosbridge_sim.shell.ros1.topic_links import CHUNK, LOST, SubscriberLink, exchange_headers, receive, take_header
from rosbridge_sim.shell.ros1.xmlrpc_http import UnreachableError, XmlRpcServer, call, connect

PERIOD: Final = 1.0
"""Time between two looks at the master [s]."""

MOST_LOOKING: Final = 0.02
"""Largest share of the time that is spent with looks: those at a graph of thousands of topics are rarer."""

MAX_CONNECTIONS: Final = 500
"""Most connections of nodes at once, to topics and services of ours."""

MAX_PUBLISHERS: Final = 100
"""Most publishers of one topic that are followed."""

MAX_CONNECTING: Final = 32
"""Most publishers at once that we connect to: strangers may name any number of addresses that do not answer."""

NEW_PER_LOOK: Final = 20
"""Services and unknown types of other nodes that one look asks for: each takes two connections."""

MAX_MISSED: Final = 3
"""Pings in a row without an answer by which a node has gone; one whose port is closed has gone at once."""

FIRST_WAIT: Final = 0.5
LONGEST_WAIT: Final = 8.0
"""Time until a publisher that cannot be followed is tried again [s], doubled each time."""

LAST_CALL: Final = 0.4
GOODBYE: Final = 1.2
"""Longest time for a call of the master that is on its way at the end, and for the end of all registrations [s]."""

_VALUES: Final = re.compile(r"(?<!md5 sum )\b[\d,]+\b|b?'.*'|b?\".*\"", re.DOTALL)
"""Numbers and quoted bytes of strangers in the line about a connection that is refused."""

_log = logging.getLogger("rosbridge_sim.ros1")


class Ros1Choices(Record):
    """The settings of the node.

    Attributes:
        master: URI of the master.
        name: full name of the node.
        namespace: stands before all names on the graph; empty, or absolute without a slash at its end.
        host: where the node listens.
        shown_host: host in its addresses, for other nodes.
        max_message_size: longest message of another node [bytes].
        room: for messages of all nodes that have not come whole yet.
    """

    master: str
    name: str
    namespace: str
    host: str
    shown_host: str
    max_message_size: int
    room: Room


@dataclass(eq=False)
class _Writer:
    """A topic that we publish; `links` are its subscribers."""

    type: Ros1Type
    quality: Quality
    links: set[SubscriberLink] = field(default_factory=set)


@dataclass(eq=False)
class _Reader:
    """A topic that we subscribe to: addresses of its publishers, and the tasks that follow them, by address."""

    type: Ros1Type
    publishers: set[str] = field(default_factory=set)
    tasks: dict[str, asyncio.Task[None]] = field(default_factory=dict)


class Ros1Node:
    """Our node; see `FarNode`.

    Attributes:
        gateway: moves the messages; set before `start`.
        services: moves the calls; set before `start`.
        far_services: calls services of other nodes.
        on_clock: called once with whether nodes use simulated time (`/use_sim_time`).
    """

    gateway: Gateway[Ros1Type]
    services: NodeServices[Ros1Service]
    far_services: FarServices

    def __init__(self, choices: Ros1Choices, types: Ros1Types, parameters: MasterParameters) -> None:
        self.on_clock: Callable[[bool], None] | None = None
        self._choices = choices
        self._types = types
        self._parameters = parameters
        self._loop = asyncio.get_running_loop()
        self._api = XmlRpcServer(self._answer)
        self._server: asyncio.Server | None = None
        self._port = 0
        self._writers: dict[str, _Writer] = {}
        self._readers: dict[str, _Reader] = {}
        self._connections: dict[asyncio.StreamWriter, None] = {}
        self._registered: dict[Registration, str] = {}  # with the type of a topic
        self._refused: set[Registration] = set()
        self._has_parameters = False
        self._endpoints: dict[str, Endpoint] = {}  # publishers of other nodes
        self._far_types: dict[tuple[str, str], FarService | None] = {}  # of services: (name, node) -> found
        self._unlearnt: dict[str, float] = {}  # types -> when to ask again
        self._missed: dict[str, int] = {}  # pings without an answer, by the name of the node
        self._num_links = 0
        self._is_ending = False
        self._connecting = asyncio.Semaphore(MAX_CONNECTING)
        self._log = OnceLog(_log.name)
        self._is_lost: str | None = None
        self._is_changed = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()

    # Life

    @property
    def uri(self) -> str:
        """Address of the node's own server."""
        return f"http://{self._choices.shown_host}:{self._api.port}/"

    async def start(self) -> None:
        """Listen, and register what is wanted; without a master later.

        Raises:
            OSError: the host cannot be used.
        """
        await self._api.start(self._choices.host)
        self._server = await asyncio.start_server(self._accept, self._choices.host, 0)
        self._port = self._server.sockets[0].getsockname()[1]
        self._parameters.on_change = self.services.on_change = self._is_changed.set
        await self._look_safely()
        self._spawn(self._run())

    async def stop(self) -> None:
        """Leave the graph, within two seconds. A second call does nothing."""
        tasks, self._tasks = self._tasks - {asyncio.current_task()}, set()
        self._is_ending = True
        if self._server is not None:
            self._server.close()  # nodes connect anew as soon as they lose a topic
        self._is_changed.set()
        if tasks:  # a registration that is on its way must arrive before its end
            await asyncio.wait(tasks, timeout=LAST_CALL)
        for task in tasks:
            task.cancel()
        for reader in self._readers.values():
            for task in reader.tasks.values():
                task.cancel()
        self.far_services.stop()
        with suppress(TimeoutError):
            async with asyncio.timeout(GOODBYE):
                await asyncio.gather(*map(self._unregister, list(self._registered)), return_exceptions=True)
                if self._has_parameters:
                    self._has_parameters = False
                    with suppress(GraphError):
                        await self._ask("unsubscribeParam", self.uri, "/")
        self._api.stop()
        for writer in list(self._connections):
            writer.transport.abort()

    def _spawn(self, work: Any) -> None:  # noqa: ANN401 - a coroutine
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._end_task)

    def _end_task(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            assert isinstance(error, Exception)
            self.gateway.fail(error)

    async def _ask(self, method: str, *args: object) -> Any:  # noqa: ANN401 - any value of XML-RPC
        """Call the master.

        Raises:
            GraphError: it refuses, or cannot be reached.
        """
        return await call(self._choices.master, method, self._choices.name, *args)

    # As a `FarNode`

    def open_writer(self, topic: str, far_type: Ros1Type, quality: Quality, *, is_sole: bool) -> None:  # noqa: ARG002 - of other graphs
        """See `FarNode`."""
        self._writers[topic] = _Writer(far_type, quality)
        self._is_changed.set()

    def open_reader(self, topic: str, far_type: Ros1Type, quality: Quality) -> None:  # noqa: ARG002 - as above
        """See `FarNode`."""
        self._readers[topic] = _Reader(far_type)
        self._is_changed.set()

    def close_writer(self, topic: str) -> None:
        """See `FarNode`."""
        for link in self._writers.pop(topic).links:
            link.close()
        self._is_changed.set()

    def close_reader(self, topic: str) -> None:
        """See `FarNode`."""
        reader = self._readers.pop(topic)
        reader.publishers.clear()
        for task in reader.tasks.values():
            task.cancel()
        self._is_changed.set()

    def write(self, topic: str, raw: bytes) -> bool:
        """See `FarNode`."""
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

    # The master

    async def _run(self) -> None:
        """Look at the master from time to time, and register changes in between."""
        pause = PERIOD
        while not self._is_ending:
            with suppress(TimeoutError):
                async with asyncio.timeout(pause):
                    while not self._is_ending:
                        await self._is_changed.wait()
                        await self._register_safely()
            if self._is_ending:
                return
            start = self._loop.time()
            await self._look_safely()
            pause = max(PERIOD, (self._loop.time() - start) * (1 / MOST_LOOKING)) if self._is_lost is None else PERIOD
            pause = min(pause, 10 * PERIOD)

    async def _register_safely(self) -> None:
        self._is_changed.clear()
        try:
            await self._register({})
        except GraphError as error:
            self._note_lost(str(error))
            await asyncio.sleep(PERIOD)

    async def _look_safely(self) -> None:
        try:
            await self._look()
        except GraphError as error:
            self._note_lost(str(error))
        else:
            if self._is_lost is not None:
                _log.info("the master %s is there again", self._choices.master)
            self._is_lost = None

    def _note_lost(self, why: str) -> None:
        if self._is_lost is None:
            _log.warning("the master cannot be used; it is tried again each second: %s", why)
        self._is_lost = why

    async def _look(self) -> None:
        """Compare the graph with what we know, and bring both up to date.

        Raises:
            GraphError: the master cannot be reached.
        """
        before = dict(self._registered)
        view = read_view(await self._ask("getSystemState"), await self._ask("getTopicTypes"))
        mine = view.of(self._choices.name)
        missing = [one for one in before if one not in mine and self._registered.get(one) == before[one]]
        for one in missing:
            del self._registered[one]
        if missing and len(missing) == len(before):
            _log.warning("the master has forgotten this node, perhaps in a restart: everything is registered anew")
            self._has_parameters = False
        if not self._has_parameters:
            tree = await self._ask("subscribeParam", self.uri, "/")
            self._has_parameters = True
            self._parameters.begin(tree)
            if self.on_clock is not None and isinstance(tree, dict):
                self.on_clock(tree.get("use_sim_time") is True)
                self.on_clock = None
        await self._register(dict.fromkeys(one for one, nodes in view.nodes.items() if nodes != [self._choices.name]))
        for one in mine - self._registered.keys():
            if one not in before:
                await self._unregister(one)  # of a node of this name that ended without a word
        await self._meet_publishers(view)
        await self._meet_services(view)
        await self._check_callers(view)

    def _wanted(self, taken: Iterable[Registration]) -> dict[Registration, str]:
        """Return what is to be registered: registration -> type of a topic.

        Args:
            taken: registrations of other nodes; a service has one provider alone.
        """
        there = self._choices.namespace
        wanted = {Registration("Publisher", name_there(n, there)): one.type.name for n, one in self._writers.items()}
        wanted |= {Registration("Subscriber", name_there(n, there)): one.type.name for n, one in self._readers.items()}
        services = {Registration("Service", name_there(n, there)): "" for n in self.services.offered()}
        for one in services.keys() & set(taken):
            del services[one]
            self._log.tell(f"service {one.name} has a provider on the graph already; that of this server does not pass")
        return {one: kind for one, kind in (wanted | services).items() if one not in self._refused}

    async def _register(self, taken: dict[Registration, None]) -> None:
        """Register what is wanted, and end what is not wanted any more.

        Raises:
            UnreachableError: the master cannot be reached.
        """
        wanted = self._wanted(taken)
        for one, type_name in list(self._registered.items()):
            if wanted.get(one) != type_name and not self._is_ending:
                await self._unregister(one)
        for one, type_name in wanted.items():
            if one in self._registered or self._is_ending:
                continue
            rest = [f"rosrpc://{self._choices.shown_host}:{self._port}"] if one.kind == "Service" else [type_name]
            self._registered[one] = type_name
            try:
                found = await self._ask(f"register{one.kind}", one.name, *rest, self.uri)
            except GraphError as error:
                self._registered.pop(one, None)
                if isinstance(error, UnreachableError):
                    raise
                self._refused.add(one)
                self._log.tell(f"the master does not take {one.name}: {error}")
                continue
            if one.kind == "Subscriber":
                self._set_publishers(one.name, found)
        await self._send_parameters()

    async def _unregister(self, one: Registration) -> None:
        uri = f"rosrpc://{self._choices.shown_host}:{self._port}" if one.kind == "Service" else self.uri
        try:
            await self._ask(f"unregister{one.kind}", one.name, uri)
        except UnreachableError:
            raise
        except GraphError:
            pass  # the master does not know it
        self._registered.pop(one, None)  # not before: the end of this task must not lose it

    async def _send_parameters(self) -> None:
        unsent = self._parameters.unsent
        while unsent and self._has_parameters:
            name = next(iter(unsent))
            value = unsent[name]
            with suppress(GraphError):  # deleted there already
                await (self._ask("deleteParam", name) if value is None else self._ask("setParam", name, value))
            if unsent.get(name) == value:
                unsent.pop(name, None)

    # Other nodes

    async def _meet_publishers(self, view: MasterView) -> None:
        """Tell the gateway of publishers that have come or gone, whose types are learnt before."""
        found: dict[str, Endpoint] = {}
        for there, node in view.others("Publisher", self._choices.name):
            topic, type_name = name_here(there, self._choices.namespace), view.types.get(there, "*")
            if topic is not None and type_of(type_name) is not None:
                key = f"{node} publishes {topic}, {type_name}"
                found[key] = Endpoint(key, topic, type_name, True, Quality(), node)  # noqa: FBT003 - a field
        new = [one for key, one in found.items() if key not in self._endpoints]
        now = self._loop.time()
        waits = [one for one in new if self._unlearnt.get(one.type_name, 0.0) <= now]
        unknown = {one.type_name: one for one in waits if not self._types.is_known(one.type_name)}
        for one in list(unknown.values())[:NEW_PER_LOOK]:
            self._unlearnt[one.type_name] = now + 10 * PERIOD
            try:
                await self._learn(one)
            except LOST as error:
                self._log.tell(f"{one.node} publishes {one.topic}: its type {one.type_name} is not known: {error}")
        passing = {key: one for key, one in found.items() if self._types.is_known(one.type_name)}
        come = [one for key, one in passing.items() if key not in self._endpoints]
        gone = [key for key in self._endpoints if key not in passing]
        self._endpoints = passing
        if come or gone:
            self.gateway.note_endpoints(come, gone, self._loop.time())

    async def _learn(self, publisher: Endpoint) -> None:
        """Learn the type of a topic from the header that its publisher sends.

        Raises:
            GraphError, OSError, asyncio.IncompleteReadError: it cannot be had.
        """
        uri = await self._ask("lookupNode", publisher.node)
        reader, writer = await self._connect(uri, publisher.topic)
        try:
            fields = {"type": publisher.type_name, "md5sum": "*", "message_definition": ""}
            header = await exchange_headers(reader, writer, self._topic_fields(publisher.topic) | fields)
        finally:
            writer.close()
        self._types.learn(publisher.type_name, header.get("message_definition", ""), header.get("md5sum", ""))

    async def _connect(self, uri: str, topic: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Connect to a publisher of a topic; errors as for `_learn`."""
        async with self._connecting:
            return await self._connect_now(uri, topic)

    async def _connect_now(self, uri: str, topic: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        there = name_there(topic, self._choices.namespace)
        answer = await call(uri, "requestTopic", self._choices.name, there, [["TCPROS"]])
        try:
            _, host, port = answer
            address = str(host), int(port)
        except (TypeError, ValueError):
            address = "", 0
        if not 0 < address[1] < 2**16:
            raise GraphError(f"expected TCPROS and an address; got {str(answer)[:100]}")
        async with asyncio.timeout(LONGEST_WAIT):
            return await connect(*address)

    def _topic_fields(self, topic: str) -> dict[str, str]:
        there = name_there(topic, self._choices.namespace)
        return {"callerid": self._choices.name, "topic": there, "tcp_nodelay": "1"}

    def _set_publishers(self, there: str, found: object) -> None:
        """Follow the publishers of a topic that the master names."""
        reader = self._readers.get(topic := name_here(there, self._choices.namespace) or "")
        if reader is None or not isinstance(found, list):
            return
        uris = [uri for uri in found if isinstance(uri, str) and uri != self.uri]
        if len(uris) > MAX_PUBLISHERS:
            self._log.tell(f"{topic} has more than {MAX_PUBLISHERS} publishers: the others are not heard")
        reader.publishers = set(uris[:MAX_PUBLISHERS])
        for uri in sorted(reader.publishers - reader.tasks.keys()):
            if len(reader.tasks) < 2 * MAX_PUBLISHERS:
                task = reader.tasks[uri] = self._loop.create_task(self._follow(topic, reader, uri))
                task.add_done_callback(lambda _done, uri=uri: reader.tasks.pop(uri, None))  # type: ignore[misc] # mypy

    async def _follow(self, topic: str, reader: _Reader, uri: str) -> None:
        """Take the messages of a publisher until the master names it no more; it is tried again if it is lost."""
        pause = FIRST_WAIT
        while uri in reader.publishers:
            try:
                await self._take_messages(topic, reader, uri)
                pause = FIRST_WAIT
            except LOST as error:
                if uri in reader.publishers:
                    self._log.tell(f"{topic}: a publisher cannot be heard: {error or 'no answer came in time'}")
                    await asyncio.sleep(pause)
                    pause = min(2 * pause, LONGEST_WAIT)
            else:
                await asyncio.sleep(FIRST_WAIT)

    async def _take_messages(self, topic: str, reader: _Reader, uri: str) -> None:
        stream, writer = await self._connect(uri, topic)
        try:
            own = {"type": reader.type.name, "md5sum": reader.type.md5}
            fields = self._topic_fields(topic) | own | {"message_definition": self._types.text(reader.type.name)}
            header = await exchange_headers(stream, writer, fields)
            if header.get("md5sum", "*") not in {"*", reader.type.md5}:
                raise GraphError(_misfit(reader.type, header, header.get("callerid", uri)))
            cutter = MessageCutter(self._choices.max_message_size, self._choices.room)

            def take(raw: bytes) -> None:
                self.gateway.receive(topic, raw, self._loop.time())

            try:
                await receive(stream, cutter, take)
            finally:
                cutter.close()
                if cutter.num_skipped:
                    self._log.tell(f"{topic}: messages beyond --max-frame-size are dropped")
        finally:
            writer.close()

    async def _meet_services(self, view: MasterView) -> None:
        """Offer on the bus the services of other nodes, whose types their headers name."""
        found = dict.fromkeys(view.others("Service", self._choices.name))
        for one in [one for one in self._far_types if one not in found]:
            del self._far_types[one]
            self.far_services.forget(name_here(one[0], self._choices.namespace) or "")
        new = [one for one in found if one not in self._far_types and name_here(one[0], self._choices.namespace)]
        await asyncio.gather(*map(self._meet_service, new[:NEW_PER_LOOK]))
        self.services.set_foreign([one for one in self._far_types.values() if one is not None])

    async def _meet_service(self, one: tuple[str, str]) -> None:
        there, node = one
        self._far_types[one] = None
        here = name_here(there, self._choices.namespace)
        try:
            header = await probe(await self._ask("lookupService", there), there, self._choices.name)
        except LOST as error:
            self._log.tell(
                f"service {there} of {node} cannot be asked for its type: {error or 'no answer'}", logging.INFO
            )
            return
        if here is not None and type_of(header.get("type", "")) is not None:
            self._far_types[one] = FarService(here, header["type"], node, header.get("md5sum", ""))

    async def _check_callers(self, view: MasterView) -> None:
        """Forget nodes that have called services here, and are gone: the master knows them no more, or a ping fails."""
        callers = self.services.callers
        for name, caller in list(callers.items()):
            is_there = view.has(name)
            if caller.was_seen and not is_there:
                self._forget_caller(name)
            caller.was_seen = is_there
        seen = [name for name, caller in callers.items() if caller.was_seen]
        await asyncio.gather(*map(self._ping, seen[-NEW_PER_LOOK:]))

    async def _ping(self, node: str) -> None:
        try:
            await call(await self._ask("lookupNode", node), "getPid", self._choices.name)
        except GraphError as error:
            self._missed[node] = self._missed.get(node, 0) + 1
            if self._missed[node] >= (1 if isinstance(error.__cause__, ConnectionRefusedError) else MAX_MISSED):
                self._forget_caller(node)
        else:
            self._missed.pop(node, None)

    def _forget_caller(self, node: str) -> None:
        self._missed.pop(node, None)
        _log.info("node %s has gone", node)
        self.services.forget_caller(node, self._loop.time())

    # Our own server

    def _answer(self, method: str, args: Sequence[Any]) -> list[Any]:
        """Answer a call of the master or of a node; wrong arguments raise."""
        writers, readers, there = self._writers, self._readers, self._choices.namespace
        values: dict[str, Callable[..., object]] = {
            "publisherUpdate": self._set_publishers,
            "paramUpdate": self._parameters.take,
            "shutdown": lambda *why: self._spawn(self._check_shutdown(f"{args[0]}: {' '.join(map(str, why))}"[:300])),
            "getPid": os.getpid,
            "getMasterUri": lambda: self._choices.master,
            "getPublications": lambda: [[name_there(name, there), one.type.name] for name, one in writers.items()],
            "getSubscriptions": lambda: [[name_there(name, there), one.type.name] for name, one in readers.items()],
            "getBusInfo": self._bus_info,
            "getBusStats": self._bus_stats,
        }
        if method in values:
            value = values[method](*args[1:])
            return [1, "", 0 if value is None else value]
        if method != "requestTopic":
            return [-1, f"{method[:60]} is not known here", 0]
        _, name, protocols = args
        if name_here(name, there) in writers and any(one[0] == "TCPROS" for one in protocols):
            return [1, "ready", ["TCPROS", self._choices.shown_host, self._port]]
        return [0, f"{name} is not published here over TCPROS", 0]

    def _bus_info(self) -> list[list[object]]:
        """Return all connections, as `rosnode info` reads them."""
        there = self._choices.namespace
        links = [link for writer in self._writers.values() for link in writer.links]
        out: list[list[object]] = [
            [i, link.node, "o", "TCPROS", name_there(link.topic, there), True] for i, link in enumerate(links)
        ]
        ways = [(name, uri) for name, reader in self._readers.items() for uri in reader.tasks]
        return out + [
            [i, uri, "i", "TCPROS", name_there(name, there), True] for i, (name, uri) in enumerate(ways, len(out))
        ]

    def _bus_stats(self) -> list[object]:
        out = [
            [name, sum(link.num_bytes for link in one.links), [[0, link.num_bytes, 0, True] for link in one.links]]
            for name, one in self._writers.items()
        ]
        return [out, [], []]

    async def _check_shutdown(self, shown: str) -> None:
        """Leave the graph if the master has another node of our name now; otherwise a stranger asked, and we stay."""
        try:
            uri = await self._ask("lookupNode", self._choices.name)
        except GraphError:
            uri = self.uri
        if uri == self.uri:
            self._log.tell(f"ignored a request to shut down ({shown}); stop the server itself")
            return
        _log.error(
            "another node has the name %s now (%s), so this one leaves the graph; use --ros1-name",
            self._choices.name,
            shown,
        )
        self._registered.clear()
        await asyncio.sleep(0)
        self._spawn(self.stop())

    # Connections of nodes

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._connections) >= MAX_CONNECTIONS:
            self._log.tell(f"more than {MAX_CONNECTIONS} connections of nodes: the others are closed")
            writer.transport.abort()
            return
        self._connections[writer] = None
        try:
            header = await take_header(reader)
            node = header.get("callerid", "")
            if not is_name(node):
                raise GraphError(f"expected a callerid such as /node; got {node[:100]!r}")
            if "service" in header:
                await self._serve_service(header, node, reader, writer)
            else:
                await self._serve_topic(header, node, reader, writer)
        except PeerError as error:
            text = f"a node is refused: {error}"
            is_late = (
                error.reason is Reason.UNKNOWN_TOPIC
            )  # it connects anew, and does not know yet that the topic ended
            self._log.tell(text, logging.INFO if is_late else logging.WARNING, _VALUES.sub("", text))
            with suppress(OSError):
                writer.write(write_header({"error": str(error)}))
        except LOST:
            pass  # it has gone, or is silent
        finally:
            del self._connections[writer]
            writer.close()

    async def _serve_topic(
        self, header: dict[str, str], node: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        there = header.get("topic", "")
        topic = name_here(there, self._choices.namespace) or ""
        known = self._writers.get(topic)
        if known is None:
            raise GraphError(f"{there[:200]!r} is not published here", reason=Reason.UNKNOWN_TOPIC)
        own = {"type": known.type.name, "md5sum": known.type.md5}
        if any(header.get(name, "*") not in {"*", value} for name, value in own.items()):
            raise GraphError(f"{topic}: {_misfit(known.type, header, node)}")
        rest = {"callerid": self._choices.name, "topic": there, "latching": str(int(known.quality.is_latched))}
        writer.write(write_header({**own, **rest, "message_definition": self._types.text(known.type.name)}))
        link = SubscriberLink(node, topic, writer)
        self._num_links += 1
        key = f"link {self._num_links}"
        known.links.add(link)
        try:
            endpoint = Endpoint(key, topic, known.type.name, False, Quality(), node)  # noqa: FBT003 - a field
            self.gateway.note_endpoints([endpoint], [], self._loop.time())
            for raw in self.gateway.latched(topic):
                link.send(with_length(raw))
            while await reader.read(CHUNK):
                pass  # a subscriber has nothing to say
        finally:
            known.links.discard(link)
            link.close()
            self.gateway.note_endpoints([], [key], self._loop.time())

    async def _serve_service(
        self, header: dict[str, str], node: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        there = header["service"]
        name = name_here(there, self._choices.namespace) or ""
        service = self.services.find(name)
        md5 = header.get("md5sum", "*")
        if md5 not in {"*", service.md5}:
            raise GraphError(f"{name}: {node} has another definition of {service.name}: md5 sum {md5[:40]}")
        types = {"request_type": service.request.name, "response_type": service.response.name}
        fields = {"callerid": self._choices.name, "type": service.name, "md5sum": service.md5, "service": there}
        writer.write(write_header(fields | types))
        if header.get("probe") == "1":
            await writer.drain()
            return
        await serve_calls(
            reader,
            writer,
            call_of(self.services, node, name, self._loop),
            is_persistent=header.get("persistent") == "1",
            max_size=self._choices.max_message_size,
            room=self._choices.room,
        )


def _misfit(known: Ros1Type, header: dict[str, str], node: str) -> str:
    """Return the text for a node with another definition of a type."""
    found, md5 = header.get("type", "*"), header.get("md5sum", "*")
    return (
        f"{node} has {found[:100]} with md5 sum {md5[:40]}, and this server {known.name} with {known.md5};"
        " choose --release, or give its package by --schema-path"
    )

"""Our node on the graph of ROS 1: the looks at the master, and the node's own server of XML-RPC.

One task looks at the master once a second, and registers what is wanted and missing there: so a master that was
restarted gets everything anew. All else are connections on the event loop: `node_server` has those that nodes make to
ours, `topic_links` those to publishers, `service_links` those to services.
"""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Callable, Coroutine, Iterable, Sequence
from contextlib import suppress
from typing import Any, Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.gateway import Gateway
from rosbridge_sim.graph.gateway.node_services import NodeServices
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.ros1.master_parameters import MasterParameters
from rosbridge_sim.graph.ros1.master_view import MasterView, Registration, read_view
from rosbridge_sim.graph.ros1.ros1_graph import ROS1_GRAPH
from rosbridge_sim.graph.ros1.ros1_types import Ros1Type, Ros1Types
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.shell.ros1.node_server import NodeServer
from rosbridge_sim.shell.ros1.other_nodes import OtherNodes
from rosbridge_sim.shell.ros1.registrations import Registrations
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Choices, Ros1Parts
from rosbridge_sim.shell.ros1.service_links import FarServices
from rosbridge_sim.shell.ros1.topic_links import MAX_PUBLISHERS, TopicReaders
from rosbridge_sim.shell.ros1.xmlrpc_http import XmlRpcServer

PERIOD: Final = 1.0
"""Time between two looks at the master [s]."""

MOST_LOOKING: Final = 0.02
"""Largest share of the time that is spent with looks: those at a graph of thousands of topics are rarer."""

LAST_CALL: Final = 0.4
GOODBYE: Final = 1.2
"""Longest time for a call of the master that is on its way at the end, and for the end of all registrations [s]."""

_log = logging.getLogger("rosbridge_sim.ros1")


class Ros1Node:
    """Our node; see `FarNode`.

    Attributes:
        gateway: moves messages.
        services: moves calls.
    """

    def __init__(
        self, choices: Ros1Choices, bus: Bus, types: Ros1Types, policy: Policy, *, topics: Rule, stamps: Stamps | None
    ) -> None:
        """Be on no graph yet.

        Args:
            policy: rights of all clients.
            topics: topics that pass, in both directions.
            stamps: get the clock of the nodes; None without a world.
        """
        self._choices = choices
        self._stamps = stamps
        self._loop = asyncio.get_running_loop()
        self._log = OnceLog(_log.name)
        self._far_services = FarServices(choices)
        self.services = NodeServices(ROS1_GRAPH, bus, types.find_service, policy, self._far_services.call)
        self.gateway: Gateway[Ros1Type] = Gateway(ROS1_GRAPH, bus, types.find, self, policy, topics=topics)
        parts = Ros1Parts(choices, types, self._log, self.gateway, self.services)
        self._readers = TopicReaders(parts)
        self._others = OtherNodes(parts, self._readers, self._far_services)
        self._server = NodeServer(parts, self._others)
        self._parameters = MasterParameters(bus.parameters)
        self._registrations = Registrations(choices, self._parameters, self._log)
        self._registrations.on_publishers = lambda there, uris: self._readers.set_publishers(there, uris, self._uri)
        self._api = XmlRpcServer(self._answer)
        self._is_ending = False
        self._is_lost = False
        self._is_changed = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()

    # Life

    @property
    def _uri(self) -> str:
        """Address of the node's own server."""
        return f"http://{self._choices.shown_host}:{self._api.port}/"

    async def start(self) -> None:
        """Listen, and register what is wanted now, while the world waits for its first frame; without a master later.

        Raises:
            OSError: the host cannot be used.
        """
        while (due := self.gateway.next_due(0.0)) is not None:
            self.gateway.advance(max(due, self._loop.time()))
        await self._api.start(self._choices.host)
        await self._server.start(self._choices.host)
        self._registrations.uri = self._uri
        self._registrations.service_uri = f"rosrpc://{self._choices.shown_host}:{self._server.port}"
        self._parameters.on_change = self.services.on_change = self._is_changed.set
        await self._look_safely()
        self._spawn(self._run())

    async def stop(self) -> None:
        """Leave the graph, within two seconds. A second call does nothing."""
        self.gateway.leave(self._loop.time())
        self.services.leave(self._loop.time())
        tasks, self._tasks = self._tasks - {asyncio.current_task()}, set()
        self._is_ending = self._registrations.is_ending = True
        self._is_changed.set()
        self._server.stop_listening()  # nodes connect anew as soon as they lose a topic
        if tasks:  # a registration that is on its way must arrive before its end
            await asyncio.wait(tasks, timeout=LAST_CALL)
        for task in tasks:
            task.cancel()
        self._readers.stop()
        self._others.stop()
        self._far_services.stop()
        with suppress(TimeoutError):
            async with asyncio.timeout(GOODBYE):
                await self._registrations.end_all()
        self._api.stop()
        self._server.stop()

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._end_task)

    def _end_task(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            assert isinstance(error, Exception)
            self.gateway.fail(error)

    # As a `FarNode`

    def open_writer(self, topic: str, far_type: Ros1Type, quality: Quality, *, is_sole: bool) -> None:  # noqa: ARG002 - of other graphs
        """See `FarNode`."""
        self._server.open_writer(topic, far_type, quality)
        self._is_changed.set()

    def open_reader(self, topic: str, far_type: Ros1Type, quality: Quality) -> None:  # noqa: ARG002 - as above
        """See `FarNode`."""
        self._readers.open(topic, far_type)
        self._is_changed.set()

    def close_writer(self, topic: str) -> None:
        """See `FarNode`."""
        self._server.close_writer(topic)
        self._is_changed.set()

    def close_reader(self, topic: str) -> None:
        """See `FarNode`."""
        self._readers.close(topic)
        self._is_changed.set()

    def write(self, topic: str, raw: bytes) -> bool:
        """See `FarNode`."""
        return self._server.write(topic, raw)

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
            pause = PERIOD if self._is_lost else max(PERIOD, (self._loop.time() - start) * (1 / MOST_LOOKING))
            pause = min(pause, 10 * PERIOD)

    async def _register_safely(self) -> None:
        self._is_changed.clear()
        try:
            await self._registrations.update(self._wanted(()))
        except GraphError as error:
            self._note_lost(error)
            await asyncio.sleep(PERIOD)

    async def _look_safely(self) -> None:
        try:
            await self._look()
        except GraphError as error:
            self._note_lost(error)
        else:
            if self._is_lost:
                _log.info("the master %s is there again", self._choices.master)
            self._is_lost = False

    def _note_lost(self, why: GraphError) -> None:
        if not self._is_lost:
            _log.warning("the master cannot be used; it is tried again each second: %s", why)
        self._is_lost = True

    async def _look(self) -> None:
        """Compare the graph with what we know, and bring both up to date.

        Raises:
            GraphError: the master cannot be reached.
        """
        own, known = self._choices.name, self._registrations.known
        before = dict(known)
        view = read_view(await self._choices.ask("getSystemState"), await self._choices.ask("getTopicTypes"))
        mine = view.of(own)
        missing = [one for one in before if one not in mine and known.get(one) == before[one]]
        for one in missing:
            del known[one]
        if missing and len(missing) == len(before):
            _log.warning("the master has forgotten this node, perhaps in a restart: everything is registered anew")
            self._registrations.has_parameters = False
        tree = await self._registrations.take_parameters()
        if self._stamps is not None and isinstance(tree, dict):
            self._stamps.settle(self._loop.time(), is_simulated=tree.get("use_sim_time") is True)
            self._stamps = None
        self._ask_for_publishers(view)
        await self._registrations.update(self._wanted(one for one, nodes in view.nodes.items() if nodes != [own]))
        for one in mine - known.keys():
            if one not in before:
                await self._registrations.end(one)  # of a node of this name that ended without a word
        self._others.look(view)

    def _ask_for_publishers(self, view: MasterView) -> None:
        """Subscribe anew to topics whose publishers the master has told us wrongly, or not at all."""
        for one in self._registrations.known:
            nodes = view.nodes.get(Registration("Publisher", one.name), ())
            num = min(len([node for node in nodes if node != self._choices.name]), MAX_PUBLISHERS)
            if one.kind == "Subscriber" and self._readers.num_publishers(one.name) != num:
                self._registrations.stale.add(one)

    def _wanted(self, taken: Iterable[Registration]) -> dict[Registration, str]:
        """Return what is to be registered: registration -> type of a topic.

        Args:
            taken: registrations of other nodes; a service has one provider alone.
        """
        wanted = {Registration("Publisher", name): type_name for name, type_name in self._server.types()}
        wanted |= {Registration("Subscriber", name): type_name for name, type_name in self._readers.types()}
        services = {Registration("Service", self._choices.there(name)): "" for name in self.services.offered()}
        for one in services.keys() & set(taken):
            del services[one]
            self._log.tell(f"service {one.name} has a provider on the graph already; that of this server does not pass")
        return wanted | services

    # Our own server

    def _answer(self, method: str, args: Sequence[Any]) -> list[Any]:
        """Answer a call of the master or of a node; wrong arguments raise."""
        values: dict[str, Callable[..., object]] = {
            "publisherUpdate": self._note_publishers,
            "paramUpdate": self._parameters.take,
            "shutdown": lambda *why: self._spawn(self._check_shutdown(f"{args[0]}: {' '.join(map(str, why))}"[:300])),
            "getPid": os.getpid,
            "getMasterUri": lambda: self._choices.master,
            "getPublications": lambda: list(map(list, self._server.types())),
            "getSubscriptions": lambda: list(map(list, self._readers.types())),
            "getBusInfo": self._bus_info,
            "getBusStats": self._bus_stats,
        }
        if method in values:
            value = values[method](*args[1:])
            return [1, "", 0 if value is None else value]
        if method != "requestTopic":
            return [-1, f"{method[:60]} is not known here", 0]
        _, name, protocols = args
        if self._server.publishes(name) and any(one[0] == "TCPROS" for one in protocols):
            return [1, "ready", ["TCPROS", self._choices.shown_host, self._server.port]]
        return [0, f"{name} is not published here over TCPROS", 0]

    def _note_publishers(self, there: str, _uris: object) -> None:
        """Ask the master itself for the publishers of a topic: anyone could have sent the list."""
        if (one := Registration("Subscriber", there)) in self._registrations.known:
            self._registrations.stale.add(one)
            self._is_changed.set()

    def _bus_info(self) -> list[list[object]]:
        """Return all connections, as `rosnode info` reads them."""
        out = [[link.node, "o", "TCPROS", there, True] for there, link in self._server.links()]
        out += [[uri, "i", "TCPROS", there, True] for there, uri in self._readers.links()]
        return [[i, *one] for i, one in enumerate(out)]

    def _bus_stats(self) -> list[object]:
        found: dict[str, list[list[object]]] = {there: [] for there, _ in self._server.types()}
        for there, link in self._server.links():
            found[there].append([0, link.num_bytes, 0, True])
        return [[[there, sum(int(str(one[1])) for one in links), links] for there, links in found.items()], [], []]

    async def _check_shutdown(self, shown: str) -> None:
        """Leave the graph if the master has another node of our name now; otherwise a stranger asked, and we stay."""
        try:
            uri = await self._choices.ask("lookupNode", self._choices.name)
        except GraphError:
            uri = self._uri
        if uri == self._uri:
            self._log.tell(f"ignored a request to shut down ({shown}); stop the server itself")
            return
        _log.error(
            "another node has the name %s now (%s), so this one leaves the graph; use --ros1-name",
            self._choices.name,
            shown,
        )
        self._registrations.known.clear()
        await asyncio.sleep(0)
        self._spawn(self.stop())

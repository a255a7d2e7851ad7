"""The other nodes of the graph: what they publish and provide, and whether those that call services here still live.

No look at the graph waits for a node: each new node is asked in a task of its own, a few at once.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Final

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.far_graph import Endpoint, FarService
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros1.master_view import MasterView
from rosbridge_sim.graph.ros1.ros1_graph import type_of
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Parts
from rosbridge_sim.shell.ros1.service_links import FarServices, probe
from rosbridge_sim.shell.ros1.topic_links import LOST, TopicReaders, why_lost
from rosbridge_sim.shell.ros1.xmlrpc_http import UnreachableError, call

MAX_ASKED: Final = 50
"""Most nodes that are asked for something at once; the others wait for their turn ..."""

MAX_WAITING: Final = 2_000
"""... and beyond so many for a later look."""

GATHERING: Final = 0.1
"""Time for which services that are found are gathered [s]: the bus hears of all at once."""

MAX_MISSED: Final = 3
"""Pings in a row without an answer by which a node has gone; one whose port is closed has gone at once."""

LEARN_AGAIN: Final = 10.0
"""Time until a type that could not be learnt is asked for again [s]."""

_log = logging.getLogger("rosbridge_sim.ros1")


class OtherNodes:
    """The other nodes."""

    def __init__(self, parts: Ros1Parts, readers: TopicReaders, far_services: FarServices) -> None:
        """Know no node yet.

        Args:
            readers: learn types from publishers.
            far_services: calls services.
        """
        self._parts = parts
        self._choices = parts.choices
        self._types = parts.types
        self._services = parts.services
        self._far_services = far_services
        self._readers = readers
        self._loop = asyncio.get_running_loop()
        self._asked: dict[object, asyncio.Task[None]] = {}
        self._turns = asyncio.Semaphore(MAX_ASKED)
        self._tell_later: asyncio.TimerHandle | None = None
        self._publishers: dict[str, Endpoint] = {}  # of the last look
        self._told: dict[str, Endpoint] = {}  # those that the gateway knows
        self._asked_at: dict[str, float] = {}  # unknown types -> when they were asked for
        self._types_of: dict[tuple[str, str], FarService | None] = {}  # of services: (name, node) -> found
        self._missed: dict[str, int] = {}  # pings without an answer, by the name of the node

    def look(self, view: MasterView) -> None:
        """Note what has changed on the graph, and ask new nodes for the rest."""
        self._look_at_publishers(view)
        self._look_at_services(view)
        self._look_at_callers(view)

    def stop(self) -> None:
        """Ask nothing any more."""
        for one in (*self._asked.values(), self._tell_later):
            if one is not None:
                one.cancel()

    def _ask(self, key: object, work: Callable[[], Coroutine[Any, Any, None]]) -> bool:
        """Ask a node, in a task of its own; return False if that is under way, or too many wait."""
        if key in self._asked or len(self._asked) >= MAX_WAITING:
            return False
        task = self._asked[key] = self._loop.create_task(self._take_turn(work))
        task.add_done_callback(partial(self._note_end, key))
        return True

    async def _take_turn(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        async with self._turns:
            await work()

    def _note_end(self, key: object, task: asyncio.Task[None]) -> None:
        del self._asked[key]
        if not task.cancelled() and (error := task.exception()) is not None:
            assert isinstance(error, Exception)
            self._parts.gateway.fail(error)

    # Publishers

    def _look_at_publishers(self, view: MasterView) -> None:
        self._publishers.clear()
        for there, node in view.others("Publisher", self._choices.name):
            topic, type_name = self._choices.here(there), view.types.get(there, "*")
            if topic and type_of(type_name) is not None:
                key = f"{node} publishes {topic}, {type_name}"
                self._publishers[key] = Endpoint(key, topic, type_name, True, Quality(), node)  # noqa: FBT003 - a field
        now = self._loop.time()
        unknown = {one.type_name: one for one in self._publishers.values() if not self._types.is_known(one.type_name)}
        self._asked_at = {name: at for name, at in self._asked_at.items() if name in unknown and at > now - LEARN_AGAIN}
        for name, one in unknown.items():
            if name not in self._asked_at and self._ask(name, partial(self._learn, one)):
                self._asked_at[name] = now
        self._tell_publishers()

    def _tell_publishers(self) -> None:
        """Tell the gateway of publishers that have come or gone, whose types are known."""
        passing = {key: one for key, one in self._publishers.items() if self._types.is_known(one.type_name)}
        come = [one for key, one in passing.items() if key not in self._told]
        gone = [key for key in self._told if key not in passing]
        self._told = passing
        if come or gone:
            self._parts.gateway.note_endpoints(come, gone, self._loop.time())

    async def _learn(self, one: Endpoint) -> None:
        try:
            await self._readers.learn(one.node, one.topic, one.type_name)
        except LOST as error:
            text = f"{one.node} publishes {one.topic}: its type {one.type_name} is not known: {why_lost(error)}"
            self._parts.log.tell(text)
        else:
            self._tell_publishers()

    # Services

    def _look_at_services(self, view: MasterView) -> None:
        found = dict.fromkeys(view.others("Service", self._choices.name))
        for one in [one for one in self._types_of if one not in found]:
            del self._types_of[one]
            self._far_services.forget(self._choices.here(one[0]))
        for one in found:
            if (
                one not in self._types_of
                and self._choices.here(one[0])
                and self._ask(one, partial(self._meet_service, one))
            ):
                self._types_of[one] = None
        self._tell_services()

    def _tell_services(self) -> None:
        self._tell_later = None
        self._services.set_foreign([one for one in self._types_of.values() if one is not None])

    async def _meet_service(self, one: tuple[str, str]) -> None:
        """Offer on the bus a service of another node, whose type its header names."""
        there, node = one
        try:
            header = await probe(self._choices, there)
        except LOST as error:
            text = f"service {there} of {node} cannot be asked for its type: {why_lost(error)}"
            self._parts.log.tell(text, logging.INFO)
            return
        if type_of(header.get("type", "")) is not None and one in self._types_of:
            found = FarService(self._choices.here(there), header["type"], node, header.get("md5sum", ""))
            self._types_of[one] = found
            self._tell_later = self._tell_later or self._loop.call_later(GATHERING, self._tell_services)

    # Callers

    async def meet_caller(self, node: str) -> None:
        """Note a node that calls a service here. One that the master knows can be seen to go."""
        caller = self._services.meet(node, self._loop.time())
        if not caller.was_seen:
            try:
                await self._choices.ask("lookupNode", node)
            except GraphError:
                return  # `rosservice call` in a terminal, or the master is away
            caller.was_seen = True

    def _look_at_callers(self, view: MasterView) -> None:
        """Ask nodes that have called services here whether they live, first those that the master knows no more."""
        names, callers = view.names(), self._services.callers
        self._missed = {name: num for name, num in self._missed.items() if name in callers}
        for name, caller in callers.items():
            caller.was_seen = caller.was_seen or name in names
        seen = [name for name, caller in callers.items() if caller.was_seen]
        gone = [name for name in seen if name not in names]
        for name in dict.fromkeys((*gone, *reversed(seen))):  # those that have called last before others
            self._ask(("ping", name), partial(self._ping, name))

    async def _ping(self, node: str) -> None:
        try:
            uri = await self._choices.ask("lookupNode", node)
        except UnreachableError:
            return  # the master has gone, which says nothing of the node
        except GraphError:
            self._forget_caller(node)
            return
        try:
            await call(uri, "getPid", self._choices.name)
        except UnreachableError as error:
            self._missed[node] = self._missed.get(node, 0) + 1
            if self._missed[node] >= (1 if isinstance(error.__cause__, ConnectionRefusedError) else MAX_MISSED):
                self._forget_caller(node)
        except GraphError:
            pass  # it answers
        else:
            self._missed.pop(node, None)

    def _forget_caller(self, node: str) -> None:
        self._missed.pop(node, None)
        _log.info("node %s has gone", node)
        self._services.forget_caller(node, self._loop.time())

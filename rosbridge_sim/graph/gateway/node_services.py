"""Services across a graph of ROS nodes: those of the bus for nodes there, and those of nodes for the bus.

A service of a node there gives way to one of the same name on the bus. A node that calls is a participant of the bus by
its name, if the graph tells it: synchronous mode knows its master by the name of the node, and ends when that has gone.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import Final

import orjson

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarCall, FarGraph, FarService, FarServiceType, OnReply
from rosbridge_sim.graph.gateway.far_offers import FarOffers
from rosbridge_sim.graph.participant import NodeRole
from rosbridge_sim.graph.policy import Guest, Policy
from rosbridge_sim.graph.topics_services import Answer, Call
from rosbridge_sim.schema.message import Message

MAX_SERVICES: Final = 5_000
"""Most services in each direction: every node of ROS 2 has seven, and a robot has some hundred nodes."""

MAX_CALLERS: Final = 1_000
"""Most nodes that are remembered as callers; the one that called first is forgotten."""

PATIENCE: Final = 60.0
"""Longest wait for the answer of a node, for calls that name no time-out, on a server without `--service-timeout` [s]:
a node that has died is found to be gone after some 20 s, and one that hangs never is."""


class CallingNode(Guest):
    """A node that has called a service of the bus, as a participant of the bus.

    Attributes:
        name: name of the node.
        address: stands for the address of a client, in the log.
        was_seen: the graph has told of it, so it can be seen to go.
    """

    def __init__(self, graph: FarGraph, name: str, policy: Policy) -> None:
        self.name = name
        self.was_seen = False
        self.address = f"{graph.title} node {name}"
        self._log = logging.getLogger(graph.logger)
        self.policy = policy

    def notify(self, level: str, text: str) -> None:
        """Log a notice: a node has no way to get one."""
        self._log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s: %s", self.name, text)


class NodeServices(FarOffers[FarServiceType]):
    """The services that pass, in both directions.

    Attributes, beside those of `FarOffers`:
        callers: nodes that have called, by name, in order of their last call.
        on_change: called if the services of the bus have changed.
        check_request: raises GraphError if a client must not send a request of a type to a node.
    """

    kind = "service"
    op = "call_service"
    most = MAX_SERVICES
    missing = Reason.NO_SUCH_SERVICE

    def __init__(
        self,
        graph: FarGraph,
        bus: Bus,
        find: Callable[[str], FarServiceType],
        policy: Policy,
        far_call: FarCall,
    ) -> None:
        """Offer nothing yet.

        Args:
            far_call: calls services of nodes. The others are those of `FarNodes`.
        """
        super().__init__(graph, bus, find, policy)
        self._known = bus.services
        self._check_use = policy.check_call
        self.callers: dict[str, CallingNode] = {}
        self.on_change: Callable[[], None] = lambda: None
        self.check_request: Callable[[str, Call], None] = lambda _name, _call: None
        self._far_call = far_call
        bus.on_holdings.append(self._note_holdings)

    def nodes(self, role: NodeRole, name: str) -> Iterable[str]:
        """See `Participant`."""
        found = self.foreign.values() if role == "any" else [one for one in (self.foreign.get(name),) if one]
        return {one.node or self.name for one in found}

    def leave(self, now: float) -> None:
        """End all services and callers. A second call does nothing."""
        if self._note_holdings in self._bus.on_holdings:
            self._bus.on_holdings.remove(self._note_holdings)
        super().leave(now)
        for name in list(self.callers):
            self.forget_caller(name, now)

    def _note_holdings(self, owner: object) -> None:
        if owner is not self:
            self.on_change()

    # Services of the bus, for nodes

    def call(self, node: str, name: str, request: bytes, on_reply: OnReply, now: float) -> None:
        """Call a service of the bus for a node.

        Args:
            node: name of the node; empty if the graph does not tell it.
            name: name of the service.
            request: the request in the bytes of the graph.
            on_reply: called once, perhaps before this returns, unless the node leaves first.
        """
        try:
            service = self.find(name)
            value = service.request.decode(request, self._bus.stamp_ns)
        except PeerError as error:
            self._report(name, error.reason, str(error), node)
            on_reply(False, str(error).encode())  # noqa: FBT003 - see `OnReply`
            return

        def on_answer(answer: Answer) -> None:
            if answer.is_ok and isinstance(answer.values, Message):
                on_reply(True, service.response.encode(answer.values))  # noqa: FBT003 - see `OnReply`
                return
            why = answer.values if isinstance(answer.values, str) else orjson.dumps(answer.values, default=str).decode()
            if answer.reason is not None:
                self._report(name, answer.reason, why, node)
            on_reply(False, why.encode())  # noqa: FBT003 - see `OnReply`

        body = service.request.type.encode_json(value)
        caller = self.meet(node, now) if node else self
        self._bus.call(caller, name, body, on_answer, now=now)

    def meet(self, node: str, now: float) -> CallingNode:
        """Return a node that calls, as a participant of the bus."""
        caller = self.callers.pop(node, None) or CallingNode(self._graph, node, self.policy)
        self.callers[node] = caller
        if len(self.callers) > MAX_CALLERS:  # one that the master does not know goes first
            strange = next((name for name, one in self.callers.items() if not one.was_seen), next(iter(self.callers)))
            self._bus.leave(self.callers.pop(strange), now)
        return caller

    def forget_caller(self, node: str, now: float) -> None:
        """End what a node holds on the bus, because the node has gone."""
        caller = self.callers.pop(node, None)
        if caller is not None:
            self._bus.leave(caller, now)

    # Services of nodes, for the bus

    def _provide(self, one: FarService, service: FarServiceType) -> None:
        if one.hash and one.hash != service.hash:
            raise GraphError(
                f"{one.type_name} has another definition there ({one.hash}, here {service.hash}); use --schema-path",
                reason=Reason.TYPE_CONFLICT,
            )
        self._bus.provide(self, one.name, one.type_name, partial(self._handle, one.name, service)).patience = PATIENCE

    def _withdraw(self, name: str) -> None:
        self._bus.withdraw(self, name)

    def _handle(self, name: str, service: FarServiceType, call: Call, _now: float) -> None:
        """Call a service of a node for a participant of the bus."""
        self.check_request(name, call)

        def on_reply(is_ok: bool, body: bytes) -> None:  # noqa: FBT001 - see `OnReply`
            if not is_ok:
                call.refuse(body.decode(errors="replace") or f"Service {name} failed; its node gave no reason")
                return
            try:
                values = service.response.decode(body, self._bus.stamp_ns)
            except PeerError as error:
                call.refuse(str(error))
                return
            call.answer(values)

        request = service.request.encode(Message(service.request.type, call.request))
        self._far_call(name, service, request, call, on_reply)

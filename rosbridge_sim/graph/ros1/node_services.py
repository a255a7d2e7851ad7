"""Services across the graph of ROS 1: those of the bus for nodes, and those of nodes for the bus.

A node that calls is a participant of the bus by its name, and not by the connection of one call: rospy opens a new one
for each. So synchronous mode knows its master by the name of the node, and ends when the node has ended.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from typing import Final, Protocol

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import HIDDEN
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.sentences import name_some
from rosbridge_sim.graph.participant import OfferKind
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.ros1.ros1_graph import is_name
from rosbridge_sim.graph.ros1.ros1_types import Ros1Service, Ros1Types
from rosbridge_sim.graph.topics_services import Answer, Call
from rosbridge_sim.schema.message import Message

MAX_SERVICES: Final = 1_000
"""Most services in each direction."""

MAX_CALLERS: Final = 1_000
"""Most nodes that are remembered as callers; the one that called first is forgotten."""

_log = logging.getLogger("rosbridge_sim.ros1")

OnReply = Callable[[bool, bytes], None]
"""`(is_ok, body)`: the response in the bytes of ROS 1, or the reason as text."""


class FarCalls(Protocol):
    """Calls of services that nodes provide, which `shell/` makes."""

    def call(self, name: str, service: Ros1Service, request: bytes, call: Call, on_reply: OnReply) -> None:
        """Call a service; `on_reply` is called once, later, unless the call ends before.

        Args:
            name: name of the service on the bus.
            service: its type.
            request: the request in the bytes of ROS 1.
            call: the call on the bus, with its deadline.
        """


class CallingNode:
    """A node that has called a service of the bus, as a participant of the bus.

    Attributes:
        name: name of the node.
        address: stands for the address of a client, in the log.
        was_seen: the master knew it, so it can be seen to go.
    """

    def __init__(self, name: str, policy: Policy) -> None:
        self.name = name
        self.address = f"ROS 1 node {name}"
        self.was_seen = False
        self._policy = policy

    def notify(self, level: str, text: str) -> None:
        """Log a notice: a node has no way to get one."""
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s: %s", self.name, text)

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Guest`; a calling node offers nothing by this participant."""

    def check_subscribe(self, topic: str, type_name: str) -> None:
        """See `Restricted`."""
        self._policy.check_subscribe(topic, type_name)

    def check_publish(self, topic: str, type_name: str) -> None:
        """See `Restricted`."""
        self._policy.check_publish(topic, type_name)


class NodeServices:
    """The services that pass, in both directions.

    Attributes:
        name: stands for the name of a node in rosapi's lists.
        address: stands for the address of a client, in the log.
        callers: nodes that have called, by name, in order of their last call.
        on_change: called if the services of the bus have changed.
    """

    name = "/ros1"
    address = "ROS 1"

    def __init__(self, bus: Bus, types: Ros1Types, policy: Policy, far: FarCalls) -> None:
        """Offer nothing yet.

        Args:
            bus: our bus.
            types: its types as nodes know them.
            policy: rights of all clients.
            far: calls services of nodes.
        """
        self.callers: dict[str, CallingNode] = {}
        self.on_change: Callable[[], None] = lambda: None
        self._bus = bus
        self._types = types
        self._policy = policy
        self._far = far
        self._foreign: dict[str, Ros1Service] = {}
        self._told: set[str] = set()
        bus.on_holdings.append(self._note_holdings)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus."""
        self._tell(text, logging.getLevelNamesMapping().get(level.upper(), logging.WARNING))

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Guest`: another participant provides it from now on."""
        self._foreign.pop(name, None)
        self._tell(f"{kind} {name}: {why}")

    def leave(self, now: float) -> None:
        """End all services and callers. A second call does nothing."""
        if self._note_holdings in self._bus.on_holdings:
            self._bus.on_holdings.remove(self._note_holdings)
        self._bus.leave(self, now)
        for name in list(self.callers):
            self.forget_caller(name, now)

    def _note_holdings(self, owner: object) -> None:
        if owner is not self:
            self.on_change()

    # Services of the bus, for nodes

    def offered(self) -> list[str]:
        """Return the names of the services that nodes may call."""
        names = [
            name
            for name, service in self._bus.services.items()
            if service.owner is not self
            and is_name(name)
            and HIDDEN not in name
            and self._policy.may_call(name)
            and self._has_type(name)
        ]
        if len(names) > MAX_SERVICES:
            self._tell(f"more than {MAX_SERVICES:,} services on the bus: the others do not pass")
        return names[:MAX_SERVICES]

    def _has_type(self, name: str) -> bool:
        try:
            self._types.find_service(self._bus.services[name].type.name)
        except PeerError as error:
            self._tell(f"service {name} does not pass: {error}", logging.INFO)
            return False
        return True

    def find(self, name: str) -> Ros1Service:
        """Return the type of a service of the bus.

        Raises:
            PeerError: there is none, or nodes must not call it.
        """
        service = self._bus.services.get(name)
        if service is None or service.owner is self:
            raise GraphError(f"service {name} does not exist here", reason=Reason.NO_SUCH_SERVICE)
        self._policy.check_call(name)
        return self._types.find_service(service.type.name)

    def call(self, node: str, name: str, request: bytes, on_reply: OnReply, now: float) -> None:
        """Call a service of the bus for a node.

        Args:
            node: name of the node.
            name: name of the service.
            request: the request in the bytes of ROS 1.
            on_reply: called once, perhaps before this returns, unless the node leaves first.
        """
        try:
            service = self.find(name)
            value = service.request.decode(request, self._bus.stamp_ns)
        except PeerError as error:
            self._refuse(node, name, error.reason, str(error))
            on_reply(False, str(error).encode())  # noqa: FBT003 - see `OnReply`
            return

        def on_answer(answer: Answer) -> None:
            if answer.is_ok and isinstance(answer.values, Message):
                on_reply(True, service.response.encode(answer.values))  # noqa: FBT003 - see `OnReply`
                return
            if answer.reason is not None:
                self._refuse(node, name, answer.reason, str(answer.values))
            on_reply(False, str(answer.values).encode())  # noqa: FBT003 - see `OnReply`

        body = service.request.type.encode_json(value)
        self._bus.call(self._caller(node), name, body, on_answer, now=now)

    def _refuse(self, node: str, name: str, reason: Reason, text: str) -> None:
        refusal = RefusedRequest(f"ROS 1 node {node}", reason, "call_service", name, text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)

    def _caller(self, node: str) -> CallingNode:
        caller = self.callers.pop(node, None) or CallingNode(node, self._policy)
        self.callers[node] = caller
        if len(self.callers) > MAX_CALLERS:
            self._bus.leave(self.callers.pop(next(iter(self.callers))), 0.0)
        return caller

    def forget_caller(self, node: str, now: float) -> None:
        """End what a node holds on the bus, because the node has gone."""
        caller = self.callers.pop(node, None)
        if caller is not None:
            self._bus.leave(caller, now)

    # Services of nodes, for the bus

    def set_foreign(self, found: Iterable[tuple[str, str, str]]) -> None:
        """Offer on the bus what nodes provide, and end what they provide no more.

        Args:
            found: name, type and md5 sum of each service.
        """
        wanted = {name: (type_name, md5) for name, type_name, md5 in found if is_name(name)}
        for name in [name for name in self._foreign if name not in wanted]:
            del self._foreign[name]
            self._bus.withdraw(self, name)
        unknown: dict[str, list[str]] = {}
        for name, (type_name, md5) in wanted.items():
            if name in self._foreign or len(self._foreign) >= MAX_SERVICES:
                continue
            try:
                self._policy.check_offer(name)
                service = self._types.find_service(type_name)
                if md5 != service.md5:
                    why = f"its {type_name} has another definition there (md5 sum {md5}, here {service.md5})"
                    self._tell(f"service {name} does not pass: {why}; use --schema-path")
                    continue
                self._bus.provide(self, name, type_name, self._handler(name, service))
            except PeerError as error:
                unknown.setdefault(str(error), []).append(name)
                continue
            self._foreign[name] = service
        for why, names in unknown.items():
            self._tell(f"{name_some(names)} of ROS 1 cannot be called: {why}; use --schema-path", logging.INFO)

    def _handler(self, name: str, service: Ros1Service) -> Callable[[Call, float], None]:
        def handle(call: Call, _now: float) -> None:
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
            self._far.call(name, service, request, call, on_reply)

        return handle

    def _tell(self, text: str, level: int = logging.WARNING) -> None:
        """Log a line once."""
        if text not in self._told and len(self._told) < MAX_SERVICES:
            self._told.add(text)
            _log.log(level, "%s", text)

"""Services and input topics of the world or of one ego, which can be removed together.

The world's own services and input topics stay as long as the simulator. Those of a further ego are added and removed
with it. Components use default names; the network settings give the names on the bus and turn items on or off.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import BodyLimits, Call, Handle, Subscription, Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.interface_registry import Interface, InterfaceRegistry, why_no_topic
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind

Take = Callable[[Any, Participant, float], None]
"""`(message's struct, sender, now)`; if it raises a PeerError, the sender gets a status."""


_USUAL: Final = BodyLimits()


class SubscribersServices:
    """Services and input topics of `morai_msgs` types under one prefix.

    Attributes:
        prefix: `/` for the world and the first ego.
    """

    def __init__(self, items: InterfaceRegistry, prefix: str = "/") -> None:
        self.prefix = prefix
        self._items = items
        self._own: list[Interface] = []

    def provide(
        self, name: str, type_name: str, handle: Handle, *, is_everywhere: bool = True, limits: BodyLimits = _USUAL
    ) -> None:
        """Offer a service that no other participant may offer.

        Args:
            name: default name, without the prefix.
            type_name: of `morai_msgs` if it names no package.
            handle: answers the calls.
            is_everywhere: every release has the type. If false, nothing is offered where a release lacks it.

        Raises:
            TypeNameError: there is no such type.
        """
        items = self._items

        def handle_while_open(call: Call, now: float) -> None:
            if items.why_closed is not None:
                items.check_open()
            handle(call, now)

        self._add(_Service(name, self.prefix, type_name, handle_while_open, limits), is_everywhere=is_everywhere)

    def listen(
        self, name: str, type_name: str, take: Take, *, is_everywhere: bool = True, limits: BodyLimits = _USUAL
    ) -> None:
        """Subscribe to an input topic.

        Args:
            name: default name, without the prefix.
            type_name: of `morai_msgs` if it names no package.
            take: takes each message.
            is_everywhere: every release has the type. If false, nothing is subscribed to where a release lacks it.

        Raises:
            GraphError: a client has given the topic another type.
            TypeNameError: there is no such type.
        """
        check_open = self._items.check_open

        def take_while_open(message: Struct, sender: Participant, now: float) -> None:
            check_open()
            take(message, sender, now)

        self._add(_Subscriber(name, self.prefix, type_name, take_while_open, limits), is_everywhere=is_everywhere)

    def service(self, name: str) -> str:
        """Return the name of a service on the bus.

        Args:
            name: default name, without the prefix.

        Returns:
            The name; empty if there is none.
        """
        return self._items.name_of(InterfaceKind.SERVICE, "/" + name, self.prefix)

    def topic(self, name: str) -> str:
        """Return the name of an input topic on the bus.

        Args:
            name: default name, without the prefix.

        Returns:
            The name; empty if there is none.
        """
        return self._items.name_of(InterfaceKind.SUBSCRIBER, "/" + name, self.prefix)

    @property
    def services(self) -> list[str]:
        """Names of the services that are on the bus."""
        return [item.name for item in self._own if item.kind is InterfaceKind.SERVICE and item.name is not None]

    def release(self, now: float) -> None:
        """Remove everything; clients that wait for an answer get an error."""
        self._items.remove(self._own, now)
        self._own = []

    def _add(self, item: Interface, *, is_everywhere: bool) -> None:
        self._items.add(item, is_everywhere=is_everywhere)
        self._own.append(item)


class _Service(Interface):
    """A service that only the simulator offers."""

    kind = InterfaceKind.SERVICE

    def __init__(self, name: str, prefix: str, type_name: str, handle: Handle, limits: BodyLimits) -> None:
        super().__init__("/" + name, prefix, _full(type_name))
        self._handle = handle
        self._limits = limits

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:  # noqa: ARG002 - it does not matter when
        bus.provide(owner, name, self.type_name, self._handle, is_exclusive=True, limits=self._limits)

    def release(self, owner: Participant, bus: Bus, now: float, *, is_gone: bool) -> None:  # noqa: ARG002 - as above
        assert self.name is not None
        bus.withdraw(owner, self.name, answers_calls=not is_gone)

    def why_not(self, owner: Participant, bus: Bus, name: str) -> str | None:
        service = bus.services.get(name)
        if service is None or service.owner is owner or service.owner.gives_way(owner):
            return None
        return f"service {name} is provided by {service.owner.name}"


class _Subscriber(Interface):
    """A topic that the simulator subscribes to."""

    kind = InterfaceKind.SUBSCRIBER

    def __init__(self, name: str, prefix: str, type_name: str, take: Take, limits: BodyLimits) -> None:
        super().__init__("/" + name, prefix, _full(type_name))
        self._take = take
        self._limits = limits
        self._subscription: Subscription | None = None

    def bind(self, owner: Participant, bus: Bus, name: str, now: float) -> None:  # noqa: ARG002 - it does not matter when
        def deliver(_topic: Topic, message: Message, sender: Participant, now: float) -> None:
            bus.agenda.is_touched = True
            self._take(message.value, sender, now)

        self._subscription = bus.subscribe(owner, name, deliver, type_name=self.type_name, limits=self._limits)

    def release(self, owner: Participant, bus: Bus, now: float, *, is_gone: bool) -> None:  # noqa: ARG002 - it owns nothing
        assert self._subscription is not None
        bus.unsubscribe(self._subscription, now)
        if not is_gone:
            bus.topic_table.forget_topic(self._subscription.topic.name)

    def why_not(self, owner: Participant, bus: Bus, name: str) -> str | None:
        return why_no_topic(owner, bus, name, self.type_name)


def _full(type_name: str) -> str:
    return type_name if "/" in type_name else "morai_msgs/" + type_name

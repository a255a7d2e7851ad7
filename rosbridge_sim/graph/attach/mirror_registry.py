"""Registry of the mirrored items: each one with its name, its connection and its handle on our bus.

A topic of the simulator is subscribed to here. An input is a topic to which the simulator subscribes; it is published
here in the far side's name. Changes are found by comparing the registry with what the simulator holds.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

from rosbridge_sim.graph.attach.connection import BridgeConnection
from rosbridge_sim.graph.attach.diagnostics import ItemKey
from rosbridge_sim.graph.attach.far_side import FarSide
from rosbridge_sim.graph.participant import Participant, resolve
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.protocol.json_encoding import publish_head
from rosbridge_sim.schema.message import Message

__all__ = ["MirrorRegistry", "MirroredItem", "depth_of"]


@dataclass(slots=True)
class MirroredItem:
    """One mirrored topic, input or service.

    Attributes:
        connection: connection of the item.
        kind, name, type: as in its key.
        topic: the topic on our bus, for a topic or an input.
        subscription: our subscription, for a topic.
        is_known: for a service: it was announced there before.
        is_silent: for a topic: nothing is published there for now.
        is_confirmed: for a topic: the far side has it, or cannot tell; nothing is published there otherwise.
    """

    connection: BridgeConnection
    kind: str
    name: str
    type: str
    topic: Topic | None = None
    subscription: Subscription | None = None
    is_known: bool = False
    is_silent: bool = False
    is_confirmed: bool = False


class MirrorRegistry:
    """All items that are mirrored on one far side.

    Attributes:
        items: by key, in order of arrival.
        connections: the wanted connections by name; the name of the first is empty.
        on_added: called with a new item.
        on_removed: called with an item before it leaves the bus.
    """

    def __init__(
        self,
        far_side: FarSide,
        make_connection: Callable[[str], BridgeConnection],
        *,
        has_connection_each: bool,
        extras: Callable[[], Collection[str]] = tuple,
        has_extras: bool = False,
    ) -> None:
        """Create an empty registry; `refresh` fills it.

        Args:
            far_side: owner of the mirrored items.
            make_connection: creates the connection with a name.
            has_connection_each: use one connection per topic and service, and not one for all.
            extras: returns the present names of topics that are mirrored on request alone.
            has_extras: mirror these, too; the subscriptions to them count as made by name.
        """
        self._extras = extras
        self._has_extras = has_extras
        self.items: dict[ItemKey, MirroredItem] = {}
        self.connections = {"": make_connection("")}
        self.on_added: Callable[[MirroredItem], None] = lambda _item: None
        self.on_removed: Callable[[MirroredItem], None] = lambda _item: None
        self._far_side = far_side
        self._bus = far_side.bus
        self._make_connection = make_connection
        self._has_connection_each = has_connection_each
        self._inputs: dict[str, Topic] = {}
        self._in_flight: dict[str, int] = {}  # number of calls of each service
        self._began_synchronous = False  # of the first of these calls

    @property
    def first(self) -> BridgeConnection:
        """The connection for our own questions."""
        return self.connections[""]

    def find_input(self, name: str) -> Topic | None:
        """Return an input; None if the simulator has no such subscription.

        Args:
            name: relative or absolute name.
        """
        return self._inputs.get(name) or self._inputs.get(resolve(name))

    def is_served(self, name: str) -> bool:
        """Return True if the simulator has a service of this name.

        Args:
            name: relative or absolute name.
        """
        service = self._bus.services.get(resolve(name))
        return service is not None and service.owner is self._far_side.source

    def items_of(self, connection: BridgeConnection) -> list[MirroredItem]:
        """Return all items of one connection.

        Args:
            connection: one of `connections`.
        """
        return [item for item in self.items.values() if item.connection is connection]

    # Calls in flight

    @property
    def is_in_call(self) -> bool:
        """True if the topics that are published now are the effects of a call from there in synchronous mode.

        The call that ends the mode is one of them, too.
        """
        return bool(self._in_flight) and (self._began_synchronous or self._far_side.is_synchronous())

    def begin_call(self, name: str) -> None:
        """Keep a service until the call has ended.

        Args:
            name: absolute name of the service.
        """
        if not self._in_flight:
            self._began_synchronous = self._far_side.is_synchronous()
        self._in_flight[name] = self._in_flight.get(name, 0) + 1

    def end_call(self, name: str) -> None:
        """Release a service that was kept only for its calls.

        Args:
            name: absolute name of the service.
        """
        left = self._in_flight.pop(name) - 1
        if left:
            self._in_flight[name] = left
        elif not self.is_served(name):
            self.refresh()

    # Changes

    def refresh(self) -> None:
        """Add new items and remove old ones.

        A service that is renamed during a call is removed after its answer. rosbridge_suite accepts no answers for a
        service that has ended, so the callers would get an error.
        """
        wanted = dict.fromkeys(self._wanted())
        names = {key[:2] for key in wanted}
        awaited = {("service", name) for name in self._in_flight} - names
        for key in [key for key in self.items if key not in wanted and key[:2] not in awaited]:
            if key[0] != "service" or key[:2] in names or not self._far_side.why_gone(key[1]):
                self._drop(key)
        for key in wanted:
            if key not in self.items:
                self._add(key)

    def _wanted(self) -> Iterator[ItemKey]:
        held, spelled = self._bus.holdings(self._far_side.source), self._bus.store.spelled
        extras = self._extras()
        for topic in held.published:
            if topic.name in extras and not self._has_extras:
                continue
            yield "topic", topic.name, spelled(topic.type.name, "msg")
        for subscription in held.subscriptions:
            if subscription.topic.owner is self._far_side.source:  # its own topic, where no other program may publish
                continue
            yield "input", subscription.topic.name, spelled(subscription.topic.type.name, "msg")
        for service in held.services:
            yield "service", service.name, spelled(service.type.name, "srv")

    def _add(self, key: ItemKey) -> None:
        kind, name, type_name = key
        connection = self._connection_for(kind, name)
        item = self.items[key] = MirroredItem(connection, kind, name, type_name)
        if kind == "topic":
            item.topic = self._bus.find_topic(name)
            item.subscription = self._listen(item)
        elif kind == "input":
            item.topic = self._inputs[name] = self._bus.advertise(self._far_side, name, type_name)
        self.on_added(item)

    def _listen(self, item: MirroredItem) -> Subscription:
        far_side, connection, name, head = self._far_side, item.connection, item.name, publish_head(item.name)
        source = far_side.source

        def deliver(topic: Topic, message: Message, sender: Participant, now: float) -> None:
            # A latched message may come just once, and perhaps between the announcements of topics and of services.
            is_open = connection.has_services or topic.is_latching
            if sender is source and is_open and item.is_confirmed and not item.is_silent:
                is_ordered = self.is_in_call or depth_of(topic, source) > 1
                connection.offer(name, far_side.framed(message, head), now, is_ordered=is_ordered)

        is_general = name not in self._extras()
        return self._bus.subscribe(
            self._far_side, name, deliver, is_idle=not connection.has_services, is_general=is_general
        )

    def _drop(self, key: ItemKey) -> None:
        item = self.items.pop(key)
        self.on_removed(item)
        if item.subscription is not None:
            self._bus.unsubscribe(item.subscription, self._far_side.now)
        elif item.kind == "input":
            del self._inputs[item.name]
            self._bus.unadvertise(self._far_side, item.name, self._far_side.now)
        if item.connection.name:
            del self.connections[item.connection.name]
            self._far_side.on_connections_changed()

    def _connection_for(self, kind: str, name: str) -> BridgeConnection:
        if not self._has_connection_each:
            return self.connections[""]
        connection = self.connections[f"{kind} {name}"] = self._make_connection(f"{kind} {name}")
        self._far_side.on_connections_changed()
        return connection


def depth_of(topic: Topic, source: Participant) -> int:
    """Return how many messages of a topic are kept for late subscribers; all of them must arrive."""
    return max(topic.publishers.get(source, {}).values(), default=0)

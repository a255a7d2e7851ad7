"""Registry of the mirrored items: each one with its name, its connection and its handle on our bus.

A topic of the simulator is subscribed to here. An input is a topic to which the simulator subscribes; it is published
here in the far side's name. Changes are found by comparing the registry with what the simulator holds.
Pictures and clouds are *large* topics. They have a connection of their own, the *bulk* connection, because a bridge
handles the messages of one connection in order, and a small message would wait for the picture before it. It only
carries their messages: they are announced on the first connection like all others, and the first connection carries
them while there is no bulk connection. Messages of a tick in synchronous mode stay on the first connection, so that
they come before the tick's answer. Large topics that nobody reads there are not published (`reader_watch.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Final

from rosbridge_sim.graph.attach.connection import BridgeConnection
from rosbridge_sim.graph.attach.diagnostics import ItemKey, plain_type
from rosbridge_sim.graph.attach.far_side import FarSide
from rosbridge_sim.graph.participant import Participant, resolve
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.protocol.json_encoding import publish_head
from rosbridge_sim.protocol.outbox import OutboxLimits
from rosbridge_sim.records import Record
from rosbridge_sim.schema.message import Message

BULK: Final = "pictures and clouds"
"""Name of the connection for the messages of large topics."""

LARGE_TYPES: Final = frozenset(("sensor_msgs/CompressedImage", "sensor_msgs/Image", "sensor_msgs/PointCloud2"))
"""Types whose messages have tens of kilobytes and more: a bridge takes 20 to 300 times as long for one as for others.
"""


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
        is_unread: for a large topic: nobody reads it there, so nothing is published.
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
    is_unread: bool = False

    @property
    def is_large(self) -> bool:
        """True for a topic of pictures or clouds."""
        return self.kind == "topic" and plain_type(self.type) in LARGE_TYPES


class MirrorChoices(Record):
    """Options of a mirror: its topics, and its connections.

    Attributes:
        has_connection_each: use one connection per topic and service, as MORAI SIM does, and not one for all (and a
            second one for pictures and clouds). One connection keeps the order of all messages and answers. With many,
            a slow topic does not delay an answer.
        limits: limits on frames that wait for one socket.
        max_frame_size: longest frame that fragments may form [characters]; a longer one closes a connection [bytes].
        extras: returns the present names of topics that are mirrored on request alone.
        has_extras: mirror these, too; the subscriptions to them count as made by name.
        second_names: returns the present names of topics with the messages of another one; they are published only if
            the far side says that they are read.
    """

    has_connection_each: bool = False
    limits: OutboxLimits = OutboxLimits()
    max_frame_size: int = 16 * 2**20
    extras: Callable[[], Collection[str]] = tuple
    has_extras: bool = False
    second_names: Callable[[], Collection[str]] = tuple


class MirrorRegistry:
    """All items that are mirrored on one far side.

    Attributes:
        items: by key, in order of arrival.
        connections: the wanted connections by name; the name of the first is empty.
        on_added: called with a new item.
        on_removed: called with an item before it leaves the bus.
    """

    def __init__(
        self, far_side: FarSide, make_connection: Callable[[str], BridgeConnection], choices: MirrorChoices
    ) -> None:
        """Create an empty registry; `refresh` fills it.

        Args:
            far_side: owner of the mirrored items.
        """
        self._choices = choices
        self.items: dict[ItemKey, MirroredItem] = {}
        self.connections = {"": make_connection("")}
        self.on_added: Callable[[MirroredItem], None] = lambda _item: None
        self.on_removed: Callable[[MirroredItem], None] = lambda _item: None
        self._far_side = far_side
        self._bus = far_side.bus
        self._make_connection = make_connection
        self._inputs: dict[str, Topic] = {}
        self._in_flight: dict[str, int] = {}  # number of calls of each service
        self._began_synchronous = False  # of the first of these calls

    @property
    def first(self) -> BridgeConnection:
        """The connection for our own questions."""
        return self.connections[""]

    @property
    def bulk(self) -> BridgeConnection | None:
        """The connection for the messages of large topics; None if there are no such topics, or one for each."""
        return self.connections.get(BULK)

    @property
    def large_items(self) -> list[MirroredItem]:
        """The topics of pictures and clouds."""
        return [item for item in self.items.values() if item.is_large]

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

    # Readers

    def note_readers(self, item: MirroredItem, *, is_read: bool | None) -> None:
        """Note if a large topic has readers there.

        Args:
            is_read: None if the far side cannot tell. Then the topic is published, but not under a second name.
        """
        item.is_unread = item.name in self._choices.second_names() if is_read is None else not is_read
        if item.is_unread:
            item.connection.forget(item.name)
            if self.bulk is not None:
                self.bulk.forget(item.name)
        self.set_idle(item)

    def forget_readers(self, item: MirroredItem) -> None:
        """Publish nothing of a large topic until its readers are known, except in synchronous mode.

        There the master may wait for the picture of its tick.
        """
        item.is_unread = item.is_large and not self._far_side.is_synchronous()
        self.set_idle(item)

    def set_idle(self, item: MirroredItem) -> None:
        """Let the simulator make the messages of a topic only if they will be sent."""
        if item.subscription is not None:
            item.subscription.is_idle = item.is_unread or not item.connection.has_services

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
        extras = self._choices.extras()
        for topic in held.published:
            if topic.name in extras and not self._choices.has_extras:
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
            self.forget_readers(item)
            item.subscription = self._listen(item)
        elif kind == "input":
            item.topic = self._inputs[name] = self._bus.advertise(self._far_side, name, type_name)
        if item.is_large and not connection.name and self.bulk is None:
            self.connections[BULK] = self._make_connection(BULK)
            self._far_side.on_connections_changed()
        self.on_added(item)

    def _listen(self, item: MirroredItem) -> Subscription:
        far_side, connection, name, head = self._far_side, item.connection, item.name, publish_head(item.name)
        source, is_large = far_side.source, item.is_large

        def deliver(topic: Topic, message: Message, sender: Participant, now: float) -> None:
            self._bus.agenda.is_touched = True
            # A latched message may come just once, and perhaps between the announcements of topics and of services.
            is_open = connection.has_services or topic.is_latching
            if sender is source and is_open and item.is_confirmed and not (item.is_silent or item.is_unread):
                is_ordered = self.is_in_call or depth_of(topic, source) > 1
                frame = far_side.framed(message, head)
                bulk = self.bulk if is_large else None
                if bulk is None or not bulk.is_ready:
                    connection.offer(name, frame, now, is_ordered=is_ordered)
                elif is_ordered:
                    bulk.forget(name)  # older ones must not come after it
                    connection.offer(name, frame, now, is_ordered=True)
                else:
                    bulk.offer(name, frame, now)

        is_general = name not in self._choices.extras()
        return self._bus.subscribe(
            self._far_side, name, deliver, is_idle=item.is_unread or not connection.has_services, is_general=is_general
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
        elif self.bulk is not None and not self.large_items:
            del self.connections[BULK]
            self._far_side.on_connections_changed()

    def _connection_for(self, kind: str, name: str) -> BridgeConnection:
        if not self._choices.has_connection_each:
            return self.connections[""]
        connection = self.connections[f"{kind} {name}"] = self._make_connection(f"{kind} {name}")
        self._far_side.on_connections_changed()
        return connection


def depth_of(topic: Topic, source: Participant) -> int:
    """Return how many messages of a topic are kept for late subscribers; all of them must arrive."""
    return max(topic.publishers.get(source, {}).values(), default=0)

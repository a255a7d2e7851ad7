"""Announcements of the simulator to a remote bridge (the far side), in order.

A new connection begins with topics and their latched messages; then subscriptions; then services. A final question
follows: its answer shows that everything was handled. Services come last, because clients wait for them. A topic is
published only if the far side lists it: a bridge that does not know its type refuses it without an answer, and then
logs an error for each message. A far side that cannot tell (no rosapi) is sent everything. Before the
first announcement of all, the far side is asked which services it already has. If our stamps depend on its
`/use_sim_time`, it is asked for that even earlier.
When an ego leaves, its services stay announced, and calls of them are refused with the reason. rosbridge_suite takes a
second to end a service, and handles nothing else during that second.
A restarted ROS master forgets all nodes, and a bridge that keeps running does not announce our items to it again. Then
we announce everything again. rosbridge_suite keeps a publisher for UNREGISTER_TIME after it was unadvertised, and
registers nothing while it has one. So if topics are still missing, they are unadvertised for longer than that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rosbridge_sim.errors import EncodingError
from rosbridge_sim.graph.attach.connection import PROBE, BridgeConnection, Values
from rosbridge_sim.graph.attach.diagnostics import is_list_of_topics, names_of, plain_type, types_of
from rosbridge_sim.graph.attach.far_side import FarSide
from rosbridge_sim.graph.attach.mirror_registry import MirroredItem, MirrorRegistry, depth_of
from rosbridge_sim.graph.stamps import PARAMETER, says_simulated
from rosbridge_sim.protocol.json_encoding import publish_head

UNREGISTER_TIME: Final = 11.0
"""Time for which a topic stays unadvertised [s]. rosbridge_suite drops its publisher after `unregister_timeout`, 10 s.
"""


class Announcer:
    """The announcements to one remote bridge.

    Attributes:
        is_attached: everything is announced, and handled there.
        is_time_known: the far side has told which clock its programs use.
        is_reading_known: a far side of ROS 2 has shown if it takes `null`.
        return_at: when the unadvertised topics are announced again [s]; None if there are none.
        on_ready: called with monotonic time [s] when a connection has announced everything and the far side has handled
            it.
        on_attached: called with monotonic time [s] after that, for the last connection.
        on_topics_missing: called with monotonic time [s] when the far side does not list a topic that is new here.
    """

    def __init__(self, far_side: FarSide, registry: MirrorRegistry) -> None:
        """Create an announcer that follows the registry; nothing is announced yet."""
        self._known_types: set[str] = set()  # of the topics that the far side has had since it was attached
        self.is_attached = False
        self.is_time_known = False
        self.is_reading_known = False
        self.return_at: float | None = None
        self.on_ready: Callable[[float], None] = lambda _now: None
        self.on_attached: Callable[[float], None] = lambda _now: None
        self.on_topics_missing: Callable[[float], None] = lambda _now: None
        self._far_side = far_side
        self._registry = registry
        registry.on_added = self._announce_added
        registry.on_removed = self.withdraw

    # One item

    def _announce_added(self, item: MirroredItem) -> None:
        """Announce a new item, unless its connection announces it later anyway."""
        if item.connection.is_open and (item.kind != "service" or item.connection.has_services):
            self._announce(item)
            if item.kind == "topic":
                self._ask_for_topic(item, self._far_side.now, self.on_topics_missing)

    def _announce(self, item: MirroredItem) -> None:
        connection = item.connection
        if item.kind == "service":
            connection.say("advertise_service", id=f"advertise_service:{item.name}", service=item.name, type=item.type)
            item.is_known = True
        elif item.kind == "input":
            connection.say("subscribe", id=f"subscribe:{item.name}", topic=item.name, type=item.type)
        else:
            assert item.topic is not None
            is_latched = depth_of(item.topic, self._far_side.source) > 0
            for each in self._carriers_of(item):
                each.say("advertise", id=f"advertise:{item.name}", topic=item.name, type=item.type, latch=is_latched)
            item.is_confirmed = False
            if item.type in self._known_types:
                self._confirm(item)  # at once: a topic that begins within a tick loses none of its messages

    def _carriers_of(self, item: MirroredItem) -> list[BridgeConnection]:
        """Return the open connections for the messages of a topic."""
        bulk = self._registry.bulk if item.is_large and not item.connection.name else None
        return [each for each in (item.connection, bulk) if each is not None and each.is_open]

    def _ask_for_topic(self, item: MirroredItem, now: float, on_missing: Callable[[float], None]) -> None:
        """Ask if the far side has one topic of ours."""

        def on_answer(values: Values | None, now: float) -> None:
            told = None if values is None else values.get("type")
            if self._far_side.is_gone or self._registry.items.get((item.kind, item.name, item.type)) is not item:
                return
            if not isinstance(told, str) or plain_type(told) == plain_type(item.type):
                self._confirm(item)
            else:
                on_missing(now)

        item.connection.ask("/rosapi/topic_type", on_answer, now, topic=item.name)

    def _confirm(self, item: MirroredItem) -> None:
        """Publish a topic from now on, with its latched messages."""
        if item.is_confirmed:
            return
        item.is_confirmed = True
        self._known_types.add(item.type)
        assert item.topic is not None
        head = publish_head(item.name)
        held = item.topic.kept.get(self._far_side.source)
        for message in held.messages() if held is not None else ():
            try:
                frame = self._far_side.framed(message, head)
                item.connection.offer(item.name, frame, self._far_side.now, is_ordered=True)
            except EncodingError as error:  # only that message is lost; all others are announced
                self._far_side.bus.guard.note_encoding(item.name, error)

    def note_topics(self, topics: Values | None, connection: BridgeConnection | None = None) -> None:
        """Publish the topics that the far side lists, and no others.

        Args:
            topics: the values of `/rosapi/topics`; None if it cannot tell: then all are published.
            connection: the connection of these topics; None for all.
        """
        types = types_of(topics) if is_list_of_topics(topics) else None
        for item in self._registry.items.values():
            if item.kind != "topic" or not item.connection.is_open or connection not in (None, item.connection):
                continue
            if types is None or plain_type(types.get(item.name, "")) == plain_type(item.type):
                if not item.is_silent:
                    self._confirm(item)
            else:
                self._suppress(item)

    def note_missing_package(self, package: str) -> None:
        """Publish no topic of a package that the far side does not know."""
        self._known_types = {name for name in self._known_types if name.partition("/")[0] != package}
        for item in self._registry.items.values():
            if item.kind == "topic" and item.type.partition("/")[0] == package:
                self._suppress(item)

    def _suppress(self, item: MirroredItem) -> None:
        item.is_confirmed = False
        for each in self._carriers_of(item):
            each.forget(item.name)

    def withdraw(self, item: MirroredItem) -> None:
        """Tell the far side that an item ends; else rosbridge_suite keeps a service whose provider has gone."""
        connection = item.connection
        if connection.is_open:
            if item.kind == "service":
                if connection.has_services:
                    connection.say("unadvertise_service", service=item.name)
            elif item.kind == "input":
                connection.say("unsubscribe", id=f"subscribe:{item.name}", topic=item.name)
            else:
                for each in self._carriers_of(item):
                    each.forget(item.name)
                    each.say("unadvertise", id=f"advertise:{item.name}", topic=item.name)

    # A connection

    def begin(self, connection: BridgeConnection, now: float) -> None:
        """Announce all items of a connection that has just got a socket."""
        if connection is self._registry.bulk:
            self._begin_bulk(connection, now)
            return
        stamps = self._far_side.stamps
        if stamps is not None and stamps.is_open and self._far_side.bus.store.ros == 1:
            self.ask_time(connection, now, lambda now: self._announce_all(connection, now))
            return
        if stamps is not None:
            stamps.settle(now, is_simulated=False)  # in ROS 2 each program has its own parameter
        if not connection.name:
            self.ask_reading(connection, now)
        self._announce_all(connection, now)
        if not connection.name:
            self.ask_time(connection, now)

    def _begin_bulk(self, bulk: BridgeConnection, now: float) -> None:
        """Advertise the large topics that are announced already over the connection for their messages, too."""

        def on_answer(_values: Values | None, _now: float) -> None:
            bulk.is_ready = True

        for item in self._registry.large_items:
            if item.connection.is_open and not item.is_silent:
                bulk.say("advertise", id=f"advertise:{item.name}", topic=item.name, type=item.type, latch=False)
        bulk.ask(PROBE, on_answer, now)

    def end(self, connection: BridgeConnection) -> None:
        """Stop publishing over a connection that has lost its socket."""
        if connection is self._registry.bulk:  # the first one carries its messages meanwhile
            return
        self.is_attached = False
        self._known_types.clear()
        if not connection.name:
            self.is_reading_known = False
            self._far_side.forget_reading()
        for item in self._registry.items_of(connection):
            item.is_silent = item.is_confirmed = False
            self._registry.set_idle(item)

    def ask_time(
        self, connection: BridgeConnection, now: float, then: Callable[[float], None] = lambda _now: None
    ) -> None:
        """Ask which clock the programs there use. The answer, or a time-out, decides our stamps.

        Args:
            connection: the connection for the question.
            then: called with monotonic time [s] after that.
        """
        stamps = self._far_side.stamps
        if stamps is None or self._far_side.bus.store.ros != 1:
            return

        def on_answer(values: Values | None, now: float) -> None:
            if self._far_side.is_gone:
                return
            is_simulated = values is not None and says_simulated(values.get("value"))
            was_open = stamps.is_open
            stamps.settle(now, is_simulated=is_simulated)
            self.is_time_known = values is not None
            if values is not None or was_open:
                self._far_side.diagnostics.check_stamps(
                    is_simulated=is_simulated, is_wall=stamps.is_wall, is_settled=was_open
                )
            then(now)

        connection.ask("/rosapi/get_param", on_answer, now, name=PARAMETER, default="")

    def ask_reading(self, connection: BridgeConnection, now: float) -> None:
        """Ask a far side of ROS 2 with `null` in place of a text: if it refuses that, it refuses it for a number, too.

        Args:
            connection: the connection for the question.
        """
        if self._far_side.bus.store.ros == 1:
            return

        def on_refusal(why: str) -> None:
            self._far_side.note_refusal(why)
            self.is_reading_known = self._far_side.reads_words

        def on_answer(values: Values | None, _now: float) -> None:
            self.is_reading_known |= values is not None

        connection.ask(
            "/rosapi/get_param", on_answer, now, on_refusal=on_refusal, name="/rosdistro", default_value=None
        )

    def _announce_all(self, connection: BridgeConnection, now: float) -> None:
        """Announce all items of a connection; services only when the far side has told which ones it has."""
        ours = self._registry.items_of(connection)
        topics = [item for item in ours if item.kind == "topic"]
        for item in ours:
            if item.kind != "service":
                self._announce(item)
        if len(topics) == 1:
            self._ask_for_topic(topics[0], now, lambda _now: None)
        elif topics:
            connection.ask("/rosapi/topics", lambda values, _now: self.note_topics(values, connection), now)
        if any(item.kind == "service" and not item.is_known for item in self._registry.items_of(connection)):
            connection.ask(
                "/rosapi/services", lambda values, now: self._announce_services(connection, values, now), now
            )
        else:
            self._announce_services(connection, None, now)

    def _announce_services(self, connection: BridgeConnection, values: Values | None, now: float) -> None:
        if self._far_side.is_gone:
            return
        there = set(names_of(values, "services"))
        connection.has_services = True
        for item in self._registry.items_of(connection):
            if item.kind == "service":
                if not item.is_known and item.name in there:
                    self._far_side.diagnostics.taken_services.append(item.name)
                self._announce(item)
            self._registry.set_idle(item)  # calls may come from now on, and their effects must be visible
        connection.ask(PROBE, lambda values, now: self._note_handled(connection, values, now), now)

    def _note_handled(self, connection: BridgeConnection, values: Values | None, now: float) -> None:
        """Mark a connection as ready: all is announced, and the far side's answer shows that it was handled."""
        connection.is_ready = True
        self.on_ready(now)
        if not connection.name and values is not None:
            self._far_side.diagnostics.check_generation(values)
        bulk = self._registry.bulk
        if not self.is_attached and all(one.is_ready or one is bulk for one in self._registry.connections.values()):
            self.is_attached = True
            self._far_side.diagnostics.report_attached(self._registry.items)
            self.on_attached(now)

    # Once more

    def announce_anew(self) -> None:
        """Announce everything again over the open sockets, because the remote master has forgotten our node."""
        self.return_at = None
        for item in self._registry.items.values():
            item.is_silent = False
            if item.connection.has_services:
                if item.kind != "service":  # announcing a service twice registers it again
                    self.withdraw(item)
                self._announce(item)

    def take_back(self, now: float) -> None:
        """Unadvertise the topics there until the bridge has dropped its publishers."""
        self.return_at = now + UNREGISTER_TIME
        for item in self._registry.items.values():
            if item.kind == "topic":
                self.withdraw(item)
                item.is_silent = True

    def bring_back(self) -> None:
        """Announce the unadvertised topics again."""
        self.return_at = None
        for item in self._registry.items.values():
            if item.is_silent:
                item.is_silent = False
                if item.connection.is_open:
                    self._announce(item)

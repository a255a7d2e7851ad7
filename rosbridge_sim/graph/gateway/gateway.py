"""The gateway between the bus and a graph of ROS nodes: all programs there, as one participant of the bus.

    topic with a publisher on the bus          a writer there; a message is encoded only if somebody there subscribes
    topic with a subscription on the bus       a reader there; its messages are published on the bus
    topic with a publisher there               advertised on the bus, so that clients find it

The gateway is a guest of the bus like any client: it gives way to the server's own parts, and the patterns of access
hold for it. A message that came from the graph is never sent back to it.
The graph changes often and in many small steps. So the wanted writers and readers are computed anew from the bus and
from the endpoints there, after a change, at most ten times a second.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Generic

from rosbridge_sim.errors import FieldError, GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import HIDDEN
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import Endpoint, FarGraph, FarNode, FarNodes, Type
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.gateway.sentences import node_text
from rosbridge_sim.graph.participant import NodeRole, OfferKind, Participant
from rosbridge_sim.graph.policy import Policy, Rule, is_allowed
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.records import replace
from rosbridge_sim.schema.message import Message
from rosbridge_sim.suggestions import name_some

MAX_TOPICS: Final = 1_000
"""Most topics in each direction. Every program there is told of every endpoint, so more would be a burden to all."""

MAX_ENDPOINTS: Final = 20_000
"""Most endpoints of other programs that are remembered."""

GATHERING: Final = 2.0
"""Time for which lines about endpoints are gathered, so that those of a program for one reason are one line [s]."""

ADVERTISED_PER_TURN: Final = 20
"""Topics of other programs that one turn puts on the bus or takes from it: 5 ms of work at most."""

PERIOD: Final = 0.1
"""Least time between two looks at all topics [s]."""


@dataclass(slots=True)
class _Untold:
    """A topic of an endpoint that does not pass, and is not logged yet.

    Attributes:
        why: the reason.
        kind: equal for topics of a program that share a log line.
    """

    endpoint: Endpoint
    why: str
    kind: object
    level: int


@dataclass(slots=True)
class _Writer(Generic[Type]):
    """A topic that we publish there."""

    type: Type
    quality: Quality
    subscription: Subscription


@dataclass(slots=True)
class _Reader(Generic[Type]):
    """A topic that we subscribe to there."""

    type: Type
    quality: Quality


class Gateway(FarNodes[Type]):
    """All programs on a graph of ROS nodes, as one participant of our bus.

    Attributes:
        num_received, num_sent, num_dropped: messages from the graph, to it, and dropped for slow subscribers there.
    """

    op = "publish"

    def __init__(
        self,
        graph: FarGraph,
        bus: Bus,
        find: Callable[[str], Type],
        node: FarNode[Type],
        policy: Policy,
        *,
        topics: Rule,
        qualities: Sequence[tuple[str, Quality]] = (),
    ) -> None:
        """Start without writers and readers; the first `advance` makes them.

        Args:
            find: see `FarNodes`, as for `graph`, `bus` and `policy`.
            topics: topics that pass, in both directions.
            qualities: pattern of topics, and the quality of our publishers there; the first that matches.
        """
        super().__init__(graph, bus, find, policy)
        self.num_received = self.num_sent = self.num_dropped = 0
        self._node = node
        self._topics = topics
        self._qualities = [(Rule((pattern,)), quality) for pattern, quality in qualities]
        self._writers: dict[str, _Writer[Type]] = {}
        self._readers: dict[str, _Reader[Type]] = {}
        self._endpoints: dict[str, Endpoint] = {}
        self._by_topic: dict[tuple[str, bool], dict[str, Endpoint]] = {}  # by name, and whether it is a writer
        self._advertised: dict[str, str] = {}
        self._untold: dict[str, _Untold] = {}  # by the key of the endpoint
        self._tell_at: float | None = None
        self._refused: set[tuple[str, str]] = set()
        self._due: float | None = 0.0
        self._looked_at = -PERIOD
        self._now = 0.0
        self._num_opened = self._num_advertised = 0
        self.on_change: Callable[[], None] = lambda: None
        bus.on_topic.append(self._note_topic)
        bus.on_holdings.append(self._note_holdings)

    # As a participant of the bus

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Participant`: a part of the server publishes there from now on."""
        self._advertised.pop(name, None)
        self._log.tell(f"{kind} {name}: {why}")

    def nodes(self, role: NodeRole, name: str) -> Iterable[str]:
        """See `Participant`. A program that has told no name counts as this gateway."""
        if role == "any":
            return {one.node or self.name for one in self._endpoints.values()}
        return {one.node or self.name for one in self._by_topic.get((name, role == "publisher"), {}).values()}

    def fail(self, error: Exception) -> None:
        """See `Guarded`: all ends, and nothing passes any more."""
        log = logging.getLogger(self._graph.logger)
        log.error("internal error; nothing passes to or from %s any more", self.address, exc_info=error)
        self.leave(self._now)

    def leave(self, now: float) -> None:
        """End everything, on the bus and on the graph. A second call does nothing."""
        if self._note_topic not in self._bus.on_topic:
            return
        self._bus.on_topic.remove(self._note_topic)
        self._bus.on_holdings.remove(self._note_holdings)
        self._due = None
        self._tell_gathered(is_last=True)
        self._bus.leave(self, now)
        for topic in list(self._writers):
            self._node.close_writer(topic)
        for topic in list(self._readers):
            self._node.close_reader(topic)
        self._writers.clear()
        self._readers.clear()

    # What the graph tells

    def note_endpoints(self, found: Iterable[Endpoint], lost: Iterable[str], now: float) -> None:
        """Note that endpoints of other programs have come, or have gone.

        Args:
            found: new or changed endpoints.
        """
        for key in lost:
            gone = self._endpoints.pop(key, None)
            if gone is not None:
                same = self._by_topic[gone.topic, gone.is_writer]
                del same[key]
                if not same:
                    del self._by_topic[gone.topic, gone.is_writer]
            self._name_untold(key, None, now)
            self._refused.clear()  # there may be room now
        for endpoint in found:
            if endpoint.key in self._endpoints or len(self._endpoints) < MAX_ENDPOINTS:
                self._endpoints[endpoint.key] = endpoint
                self._by_topic.setdefault((endpoint.topic, endpoint.is_writer), {})[endpoint.key] = endpoint
                if not endpoint.is_writer and (writer := self._writers.get(endpoint.topic)) is not None:
                    self._follow_readers(writer, is_read=True, now=now)  # at once, so that it misses nothing
                if endpoint.is_named:
                    self._name_untold(endpoint.key, endpoint, now)
            else:
                self._log.tell(f"more than {MAX_ENDPOINTS:,} endpoints of other programs: the others are not seen")
        self._mark(now)

    def receive(self, name: str, raw: bytes, now: float) -> None:
        """Publish a message of a topic on the bus. One that does not fit is dropped, and its mistake is told.

        Args:
            raw: the message in the bytes of the graph.
        """
        reader, topic = self._readers.get(name), self._bus.find_topic(name)
        if reader is None or topic is None or topic.type.name != reader.type.type.name:
            return
        if name not in self._advertised and not self._advertise(name, reader.type):
            return
        try:
            value = reader.type.decode(raw, self._bus.stamp_ns)
            self.num_received += 1
            same = raw if reader.type.has_same_bytes else None
            self._bus.publish(self, topic, Message(reader.type.type, value, _raw=same), now)
        except PeerError as error:
            self._refuse(name, error)
        except Exception as error:  # noqa: BLE001 - an internal error in work for this gateway
            self._bus.guard.blame(self, error)

    # Looking

    def next_due(self, _now: float) -> float | None:
        """Return when `advance` has something to do next [s]."""
        return min((at for at in (self._due, self._tell_at) if at is not None), default=None)

    def advance(self, now: float) -> None:
        """Make the wanted writers and readers, if something has changed."""
        self._now = now
        if self._tell_at is not None and now >= self._tell_at:
            self._tell_gathered()
        if self._due is None or now < self._due:
            return
        self._due = None
        self._looked_at = now
        self._num_opened = self._num_advertised = 0
        if len(self._refused) > MAX_ENDPOINTS:
            self._refused.clear()
        self._look(now)
        if self._num_opened > self._graph.endpoints_per_turn or self._num_advertised > ADVERTISED_PER_TURN:
            self._due = now

    end = fail
    """See `Endable`."""

    def _mark(self, now: float) -> None:
        """Have `advance` look at all topics, soon."""
        if self._due is None:
            self._due = max(now, self._looked_at + PERIOD)
            self.on_change()

    def _note_topic(self, _topic: Topic) -> None:
        self._mark(self._now)

    def _note_holdings(self, owner: Participant) -> None:
        if owner is not self:
            self._mark(self._now)

    def _look(self, now: float) -> None:
        self._advertise_foreign(now)
        topics = list(self._bus.topics.values())
        self._set_writers(topics, now)
        self._set_readers(topics)

    def _advertise_foreign(self, now: float) -> None:
        """Advertise on the bus what others publish on the graph, and end what they publish no more."""
        foreign: dict[str, Endpoint] = {}
        for endpoint in self._endpoints.values():
            if endpoint.is_writer and self._passes(endpoint.topic):
                foreign.setdefault(endpoint.topic, endpoint)
        for name in [name for name in self._advertised if name not in foreign]:
            self._num_advertised += 1
            if self._num_advertised > ADVERTISED_PER_TURN:
                return
            self._bus.unadvertise(self, name, now)
            del self._advertised[name]
        for name, endpoint in foreign.items():
            if name in self._advertised or (name, endpoint.type_name) in self._refused:
                continue
            self._num_advertised += 1
            if self._num_advertised > ADVERTISED_PER_TURN:
                return
            far_type = self._foreign_type(endpoint)
            if far_type is None or not self._advertise(name, far_type, endpoint):
                self._refused.add((name, endpoint.type_name))

    def _foreign_type(self, endpoint: Endpoint) -> Type | None:
        """Return the type of an endpoint of another program; None if it is not known here, which is told once."""
        type_name = self._graph.type_of(endpoint.type_name)
        if type_name is None:
            self._tell_of(endpoint, f"{endpoint.type_name} is no message of {self.address}")
            return None
        try:
            return self._find_type(type_name)
        except PeerError as error:
            self._tell_of(endpoint, str(error), level=logging.INFO)
            return None

    def _advertise(self, name: str, far_type: Type, endpoint: Endpoint | None = None) -> bool:
        """Advertise a topic on the bus for a program on the graph; return False if that is refused."""
        if len(self._advertised) >= MAX_TOPICS:
            self._log.tell(f"more than {MAX_TOPICS:,} topics of other programs: the others do not pass")
            return False
        try:
            self.policy.check_publish(name, far_type.type.name)
            self._bus.advertise(self, name, far_type.type.name, is_on_demand=True)
        except PeerError as error:
            kind = error.reason if isinstance(error, GraphError) else None
            self._tell_of(endpoint or Endpoint("", name, "", True, Quality(), ""), str(error), kind)  # noqa: FBT003 - a field
            return False
        self._advertised[name] = far_type.name
        return True

    def _set_writers(self, topics: list[Topic], now: float) -> None:
        """Open and close writers, and start and stop the encoding for those that somebody reads."""
        wanted: dict[str, tuple[Topic, Type]] = {}
        for topic in topics:
            if topic.is_settled and any(owner is not self for owner in topic.publishers) and self._may_leave(topic):
                far_type = self._find(topic)
                if far_type is not None:
                    wanted[topic.name] = (topic, far_type)
        for name, writer in list(self._writers.items()):
            if name not in wanted or wanted[name][1] is not writer.type:
                self._bus.unsubscribe(writer.subscription, now)
                self._node.close_writer(name)
                del self._writers[name]
                if wanted.pop(name, None):
                    self._mark(now)  # a library may need a moment before it takes another type
        read = {endpoint.topic for endpoint in self._endpoints.values() if not endpoint.is_writer}
        for name, (topic, far_type) in wanted.items():
            if name not in self._writers and not self._open_writer(topic, far_type):
                continue
            self._follow_readers(self._writers[name], is_read=name in read, now=now)

    def _follow_readers(self, writer: _Writer[Type], *, is_read: bool, now: float) -> None:
        """Have a topic encoded, and made if it is made for subscribers alone, while somebody there subscribes to it."""
        old = writer.subscription
        old.is_idle = not is_read and not self._keeps(writer.quality)
        if old.is_general is is_read:
            writer.subscription = self._bus.subscribe(
                self, old.topic.name, self._send, is_idle=old.is_idle, is_general=not is_read
            )
            self._bus.unsubscribe(old, now)

    def _open_writer(self, topic: Topic, far_type: Type) -> bool:
        if len(self._writers) >= MAX_TOPICS:
            self._log.tell(f"more than {MAX_TOPICS:,} topics on the bus: the others do not pass")
            return False
        self._num_opened += 1
        if self._num_opened > self._graph.endpoints_per_turn:
            return False
        quality = self._quality_of(topic)
        try:
            self._node.open_writer(topic.name, far_type, quality, is_sole=topic.owner is not None)
        except GraphError as error:
            self._log.tell(f"{topic.name} cannot be published: {error}")
            self._refused.add((topic.name, far_type.name))
            return False
        subscription = self._bus.subscribe(
            self, topic.name, self._send, is_idle=not self._keeps(quality), is_general=True
        )
        self._writers[topic.name] = _Writer(far_type, quality, subscription)
        if self._keeps(quality):
            for raw in self.latched(topic.name):
                self._write(topic.name, raw)
        return True

    def _keeps(self, quality: Quality) -> bool:
        return quality.is_latched and self._graph.keeps_latched

    def latched(self, name: str) -> Sequence[bytes]:
        """Return the latched messages of a topic that we publish there, oldest first."""
        writer, topic = self._writers.get(name), self._bus.find_topic(name)
        if writer is None or topic is None or topic.type.name != writer.type.type.name or not writer.quality.is_latched:
            return []
        kept = topic.kept.items()
        return [writer.type.encode(one) for owner, held in kept if owner is not self for one in held.messages()]

    def _quality_of(self, topic: Topic) -> Quality:
        """Return what our publisher of a topic offers."""
        for rule, quality in self._qualities:
            if rule.admits(topic.name):
                return quality
        return Quality(is_latched=topic.is_latching, depth=topic.depth or Quality().depth)

    def _set_readers(self, topics: list[Topic]) -> None:
        """Open and close readers, for the subscriptions on the bus."""
        wanted = self._wanted_readers(topics)
        offered = self._offered(wanted)
        for name, reader in list(self._readers.items()):
            if wanted.get(name) is not reader.type or reader.quality != offered[name]:
                self._node.close_reader(name)
                del self._readers[name]
                if wanted.get(name, reader.type) is not reader.type:
                    del wanted[name]
                    self._mark(self._now)  # see `_set_writers`
        for name in [name for name in wanted if name not in self._readers]:
            if len(self._readers) >= MAX_TOPICS:
                self._log.tell(f"more than {MAX_TOPICS:,} subscribed topics: the others do not pass")
                return
            self._num_opened += 1
            if self._num_opened > self._graph.endpoints_per_turn:
                return
            self._open_reader(name, wanted[name], offered[name])

    def _wanted_readers(self, topics: list[Topic]) -> dict[str, Type]:
        """Return the topics that clients subscribe to and nodes may publish on, with their types there."""
        found = {
            topic.name: self._find(topic)
            for topic in topics
            if any(one.owner is not self and not one.is_general for one in topic.all_subscriptions)
            and self._may_enter(topic)
        }
        return {name: far_type for name, far_type in found.items() if far_type is not None}

    def _open_reader(self, name: str, far_type: Type, quality: Quality) -> None:
        try:
            self._node.open_reader(name, far_type, quality)
        except GraphError as error:
            self._log.tell(f"{name} cannot be subscribed to: {error}")
            self._refused.add((name, far_type.name))
            return
        self._readers[name] = _Reader(far_type, quality)

    def _offered(self, wanted: dict[str, Type]) -> dict[str, Quality]:
        """Return the best quality that all publishers of each topic offer, so that a reader gets all of them."""
        found: dict[str, list[Quality]] = {}
        for endpoint in self._endpoints.values():
            if endpoint.is_writer and endpoint.topic in wanted:
                if endpoint.type_name != (expected := self._graph.spell_type(wanted[endpoint.topic].name)):
                    self._tell_of(endpoint, f"the type is {endpoint.type_name}, expected {expected}")
                    continue
                found.setdefault(endpoint.topic, []).append(endpoint.quality)
        return {
            name: Quality(
                is_reliable=all(one.is_reliable for one in found.get(name, ())),
                is_latched=bool(found.get(name)) and all(one.is_latched for one in found[name]),
            )
            for name in wanted
        }

    # Messages to the graph

    def _send(self, topic: Topic, message: Message, sender: Participant, _now: float) -> None:
        """Send a message of the bus to the graph, unless it came from there."""
        writer = self._writers.get(topic.name)
        if writer is None or sender is self or message.type.name != writer.type.type.name:
            return
        self._write(topic.name, writer.type.encode(message))

    def _write(self, topic: str, raw: bytes) -> None:
        if self._node.write(topic, raw):
            self.num_sent += 1
        else:
            self.num_dropped += 1

    # Rights and lines of the log

    def _passes(self, name: str) -> bool:
        is_own = name in self._graph.own_topics or name.startswith(self._graph.own_folders)
        return not is_own and self._graph.is_name(name) and self._topics.admits(name)

    def _may_leave(self, topic: Topic) -> bool:
        """Return True if programs on the graph may have a topic's messages."""
        action, hidden, _ = topic.name.partition(HIDDEN)
        is_of_action = bool(hidden) and action in self._bus.actions.by_name  # without its services it is only listed
        return (
            not is_of_action
            and self._passes(topic.name)
            and is_allowed(self.check_subscribe, topic.name, topic.type.name)
        )

    def _may_enter(self, topic: Topic) -> bool:
        """Return True if programs on the graph may publish on a topic."""
        is_free = topic.owner is None or topic.owner is self
        return is_free and self._passes(topic.name) and is_allowed(self.check_publish, topic.name, topic.type.name)

    def _find(self, topic: Topic) -> Type | None:
        """Return the type of a topic as the graph knows it; None if it has none or was refused, which is told once."""
        try:
            found = self._find_type(topic.type.name)
        except PeerError as error:
            self._log.tell(f"{topic.name} does not pass: {error}", logging.INFO)
            return None
        return None if (topic.name, found.name) in self._refused else found

    def _refuse(self, name: str, error: PeerError) -> None:
        """Report a message of the graph that does not fit, as a client's mistake."""
        text = f"{name}: {error}"
        self._log.tell(f"a message is dropped: {text}")
        reason = error.reason if isinstance(error, (FieldError, GraphError)) else Reason.REFUSED
        self._report(name, reason, text)

    def _tell_of(self, endpoint: Endpoint, why: str, kind: object = None, level: int = logging.WARNING) -> None:
        """Log why a topic of another program does not pass, as soon as the name of its node is known.

        Args:
            kind: see `_Untold`; None for topics with the same reason.
        """
        if endpoint.key in self._untold or len(self._untold) < MAX_TOPICS:
            self._untold[endpoint.key] = _Untold(endpoint, why, kind or why, level)
            self._tell_soon(self._now)

    def _name_untold(self, key: str, named: Endpoint | None, now: float) -> None:
        """Take the name of an endpoint's node; None if the endpoint has left before its name was known."""
        untold = self._untold.get(key)
        if untold is not None:
            untold.endpoint = named or replace(untold.endpoint, is_named=True)
            self._tell_soon(now)

    def _tell_soon(self, now: float) -> None:
        if self._tell_at is None:
            self._tell_at = now + GATHERING
            self.on_change()

    def _tell_gathered(self, *, is_last: bool = False) -> None:
        """Log a line for each program and reason, about the endpoints whose nodes have a name."""
        self._tell_at = None
        lines: dict[object, list[_Untold]] = {}
        for key, one in list(self._untold.items()):
            if one.endpoint.is_named or is_last:
                lines.setdefault((one.endpoint.node, one.endpoint.program, one.kind, one.level), []).append(one)
                del self._untold[key]
        for same in lines.values():
            first = same[0]
            topics = name_some(list(dict.fromkeys(one.endpoint.topic for one in same)))
            text = f"{node_text(first.endpoint.node, first.endpoint.program)} publishes {topics}, which does not pass"
            advice = f": {self._graph.one_too_many}" if first.kind is Reason.NAME_TAKEN else ""
            self._log.tell(f"{text}: {first.why}{advice}", first.level)

"""Topics of one client: advertisements, publishing and subscriptions, each with the client's own spelling.

The wire knows the client's spelling of each topic and its several subscriptions to one topic; the bus does not. Where
rosbridge_suite and the protocol's text differ, this server sends one message for each spelling of a topic, whatever the
number of subscription ids, and latched messages once for each new id.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import msgspec

from rosbridge_sim.errors import EncodingError, GraphError, Reason
from rosbridge_sim.graph.participant import Participant, decode_body, resolve
from rosbridge_sim.graph.peers.peer_base import CheckRoom, PeerBase, needed_type
from rosbridge_sim.graph.peers.publish_reader import PublishReader
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.graph.unheard import find_meant
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.subscription import COMPRESSIONS, Feed, read_options, read_qos
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.schema.plain_values import find_missing
from rosbridge_sim.suggestions import hint, listing

_IMPLICIT = object()
"""Key of the advertisement that a publish without id and advertise creates; no client can send it."""

MAX_WATCHED_TOPICS = 100
"""A client is told about at most so many topics without a publisher, which limits the lines in the log."""

MAX_ALIKE = 3
"""Topics of the same type that such a notice names."""

_log = logging.getLogger("rosbridge_sim.graph")


@dataclass(slots=True)
class _TopicSubscription:
    """One spelling of a topic: its feed on the wire and its one subscription on the bus."""

    feed: Feed
    subscription: Subscription


class PeerTopics:
    """The topics of one client.

    Attributes:
        num_held: number of advertisements and subscriptions; each id counts.
        is_searching: the client wants to know which fields its messages lack.
    """

    def __init__(self, peer: PeerBase, check_room: CheckRoom) -> None:
        """Create an empty table.

        Args:
            check_room: called before it holds another one.
        """
        self.num_held = 0
        self.is_searching = False
        self._peer = peer
        self._bus = peer.bus
        self._deliver = peer.bus.publish
        self._session = peer.session
        self._check_room = check_room
        self._publications: dict[str, Topic] = {}
        self._subscriptions: dict[str, _TopicSubscription] = {}
        self._reader: PublishReader | None = None  # many clients publish nothing
        self._searched: set[str] = set()  # topics, as it spells them, whose first message was searched
        self._judged: set[str] = set()  # names of topics without a subscriber that were judged

    # Publishing

    def advertise(self, op: ops.Advertise, now: float) -> None:
        """Make this client a publisher."""
        type_name = needed_type(op)
        self._peer.policy.check_publish(op.topic, type_name)
        self._publications[op.topic] = self._begin_publishing(op, type_name, op.id, now)

    def _begin_publishing(self, op: ops.Advertise | ops.Publish, type_name: str, key: object, now: float) -> Topic:
        """Make this client a publisher of a topic, and return the topic."""
        self._check_room(op.id)
        qos = read_qos(op.qos)
        depth = qos.depth if op.latch or qos.is_latching else 0
        num_keys = self._count_keys(op.topic)
        topic = self._bus.advertise(self._peer, op.topic, type_name, depth=depth, key=key)
        self.num_held += self._count_keys(op.topic) - num_keys
        if topic.name not in self._judged and len(self._judged) < MAX_WATCHED_TOPICS:
            self._bus.unheard.watch((self._peer, topic), topic, self._note_unheard, now)
        return topic

    def _note_unheard(self, topic: Topic) -> None:
        """Tell the client that a topic has no subscriber, if its name is nearly that of one with a subscriber."""
        if self._peer not in topic.publishers:
            return
        self._judged.add(topic.name)
        meant = find_meant(topic, self._peer, self._bus.topics.values(), self._peer.may_see)
        if meant:
            near = f" (did you mean {printable(meant)}?)"
            text = f"{topic.name} ({topic.type.name}) is published, but has no subscriber{near}"
            _log.info("%s: %s", self._peer.address, text, extra={"client": self._peer.address})
            self._peer.remark("info", text)

    def _count_keys(self, name: str) -> int:
        """Return the number of this client's advertisements of a topic."""
        topic = self._bus.find_topic(name)
        return len(topic.publishers.get(self._peer, ())) if topic is not None else 0

    def unadvertise(self, op: ops.Unadvertise, now: float) -> None:
        """Remove one advertisement, or all of a topic if the op has no id."""
        num_keys = self._count_keys(op.topic)
        self._bus.unadvertise(self._peer, op.topic, now, key=op.id)
        num_ended = num_keys - self._count_keys(op.topic)
        self.num_held -= num_ended
        if not num_ended:
            self._warn_of_nothing(op, "advertisement")
        name = resolve(op.topic)
        for spelling in (name, name[1:]):
            topic = self._publications.get(spelling)
            if topic is not None and self._peer not in topic.publishers:
                del self._publications[spelling]

    def publish(self, op: ops.Publish, now: float) -> None:
        """Publish a message; without an earlier advertise, this op advertises, too."""
        bus = self._bus
        topic = self._publications.get(op.topic)
        message_type = self._type_to_publish(op) if topic is None else topic.type
        message: object = op.msg
        if not isinstance(message, Message):  # else the reader has read it
            target = bus.find_topic(op.topic) if topic is None else topic
            if target is not None and target.limits is not None:
                target.limits.check(target.name, op.msg, "message")
            value = decode_body(message_type, op.msg, bus.stamp_ns)
            message = Message(message_type, value, self._session.frame_length)
            if self.is_searching and op.topic not in self._searched:
                self._warn_of_missing(op, message_type)
            if topic is not None:
                if self._reader is None:
                    self._reader = PublishReader(self._publications, bus, self._session)
                self._reader.note_usual(op.topic, topic)
        if topic is None:  # only after the check of the message, so that a wrong one changes nothing
            # Not under the op's id: roslib gives each publish a new one, and all of them would be stored.
            key = _IMPLICIT if op.id is None else op.id
            topic = self._publications[op.topic] = self._begin_publishing(op, message_type.name, key, now)
        self._deliver(self._peer, topic, message, now)

    def _warn_of_missing(self, op: ops.Publish, message_type: MessageType | OpaqueType) -> None:
        """Tell the client which fields its first message of a topic lacks, as the protocol's text says of all."""
        if len(self._searched) < MAX_WATCHED_TOPICS:
            self._searched.add(op.topic)
        missing = find_missing(message_type, {} if ops.is_absent(op.msg) else op.msg)
        if missing:
            text = f"publish: {message_type.name} without {listing(missing)}: these fields have their defaults"
            self._session.remark("warning", text, op.id)

    def _type_to_publish(self, op: ops.Publish) -> MessageType | OpaqueType:
        """Return the type of a publish without an advertise, if it is known or given."""
        self._peer.policy.check_publish(op.topic, op.type or self._type_name(op.topic) or "")
        return self._bus.topic_table.type_to_publish(op.topic, op.type or None)

    def _type_name(self, name: str) -> str | None:
        """Return the type of a topic; None if it does not exist."""
        topic = self._bus.find_topic(name)
        return topic.type.name if topic is not None else None

    def subscribe(self, op: ops.Subscribe, now: float) -> None:
        """Subscribe to a topic, or change the options of a subscription."""
        type_name = op.type or None  # roslib and others send "" for a type that they do not know
        if type_name is None and self._peer.policy.needs_type(op.topic):
            type_name = self._type_name(op.topic)
        self._peer.policy.check_subscribe(op.topic, type_name or "")
        qos = read_qos(op.qos)
        bus = self._bus
        held = self._subscriptions.get(op.topic)
        is_new = held is None or op.id not in held.feed.ids
        was_mute = False
        if is_new:
            self._check_room(op.id)
        if held is None:
            feed = Feed(self._session, op.topic)

            def deliver(_topic: Topic, message: Message, _sender: Participant, now: float) -> None:
                feed.deliver(message, now, bus.stamp_ns)

            notify = self._peer.notifier()
            subscription = bus.subscribe(self._peer, op.topic, deliver, type_name=type_name, notify=notify)
            held = self._subscriptions[op.topic] = _TopicSubscription(feed, subscription)
            if len(self._subscriptions) <= MAX_WATCHED_TOPICS:
                bus.unpublished.watch(subscription, subscription.topic, self._note_unpublished, now)
        elif type_name is not None:
            was_mute = bus.topic_table.retype(held.subscription, type_name)
        feed = held.feed
        feed.set_options(op.id, read_options(self._check_compression(op)))
        self.num_held += is_new
        if (is_new or was_mute) and qos.is_latching is not False:
            for message in held.subscription.topic.latched:
                try:
                    feed.send(message, bus.stamp_ns)
                except EncodingError as error:
                    bus.guard.note_encoding(op.topic, error)

    def _check_compression(self, op: ops.Subscribe) -> ops.Subscribe:
        """Return the op with an encoding that the client can read: roslibpy asks for pictures, and cannot.

        If the encoding that it names is not known, tell it that its messages come as JSON.
        """
        if op.compression == "png" and self._session.is_roslibpy:
            return msgspec.structs.replace(op, compression=None)
        if op.compression is None or op.compression in COMPRESSIONS:
            return op
        name = op.compression[:MAX_QUOTED]
        text = f"subscribe: expected compression {', '.join(COMPRESSIONS)}; got {name!r}{hint(name, COMPRESSIONS)}"
        self._session.remark("warning", f"{text}. Messages of {op.topic} come as JSON", op.id)
        self._peer.note(Reason.WRONG_VALUE, text, op)
        return op

    def _note_unpublished(self, topic: Topic) -> None:
        """Tell the client that a topic has no publisher yet. This is not a mistake, but the name may be wrong."""
        published = [each for each in self._bus.topics.values() if each.publishers and self._peer.may_see(each.name)]
        near = hint(topic.name, [each.name for each in published])
        alike = [each.name for each in published if each.type is topic.type][:MAX_ALIKE]
        of_type = f"; of this type there is {listing(alike)}" if alike else ""
        text = f"{topic.name} ({topic.type.name}) is subscribed to, but has no publisher"
        text += f"{self._bus.unpublished.advise(topic)}{near}{of_type}"
        _log.info("%s: %s", self._peer.address, text, extra={"client": self._peer.address})
        self._peer.remark("info", text)

    def unsubscribe(self, op: ops.Unsubscribe, now: float) -> None:
        """End one subscription, or all of a topic if the op has no id. Having none is not a mistake."""
        held = self._subscriptions.get(op.topic)
        ids = () if held is None else held.feed.ids
        if held is None or (op.id is not None and op.id not in ids):
            self._warn_of_nothing(op, "subscription")
        elif op.id is None or (op.id in ids and len(ids) == 1):
            del self._subscriptions[op.topic]
            self.num_held -= len(ids)
            self._session.drop_feed(held.feed)
            self._bus.unsubscribe(held.subscription, now)
        else:
            self.num_held -= 1
            held.feed.set_options(op.id, None)

    def _warn_of_nothing(self, op: ops.Unadvertise | ops.Unsubscribe, what: str) -> None:
        """Tell a client that wants warnings that its op has ended nothing. In rosbridge_suite it is no mistake."""
        with_id = "" if op.id is None else " with this id"
        text = f"{type(op).__struct_config__.tag}: this client has no {what} of {op.topic}{with_id}"
        self._session.remark("warning", text, op.id)

    # All topics

    def recheck(self, now: float) -> None:
        """End what the policy does not allow any more, because a name now belongs to another thing."""
        policy = self._peer.policy
        for spelling, topic in list(self._publications.items()):
            try:
                policy.check_publish(spelling, topic.type.name)
            except GraphError as error:
                self.unadvertise(ops.Unadvertise(topic=spelling), now)
                self._peer.remark("error", f"{error}: this client's advertisement has ended")
        for spelling, held in list(self._subscriptions.items()):
            try:
                policy.check_subscribe(spelling, held.subscription.topic.type.name)
            except GraphError as error:
                self.unsubscribe(ops.Unsubscribe(topic=spelling), now)
                self._peer.remark("error", f"{error}: this client's subscription has ended")

    def lose(self, name: str) -> None:
        """Remove the advertisements of a topic that another owner takes. They are still on the bus.

        Args:
            name: absolute name.
        """
        self.num_held -= self._count_keys(name)
        for spelling in (name, name[1:]):
            self._publications.pop(spelling, None)

    def forget(self) -> None:
        """Forget all topics; the bus removes its own entries itself."""
        self._publications.clear()
        for held in self._subscriptions.values():
            self._session.drop_feed(held.feed)
        self._subscriptions.clear()
        self.num_held = 0

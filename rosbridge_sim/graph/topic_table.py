"""Topics by name: their types, publishers and subscriptions, and the lifetime of topics without publishers.

Publishers decide the type of a topic. Clients that only subscribe do not, and a client must give way if a part of the
server needs a name or a type (`Participant.is_guest`). Otherwise any client could block topics of others, or of an ego.
A topic's type is kept for `TYPE_MEMORY` seconds after its last publisher has left, so that a restarted program finds
its topic unchanged (rosbridge_suite keeps the publisher itself for this time).
"""

from __future__ import annotations

from itertools import takewhile

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.bus_state import BusState, earliest
from rosbridge_sim.graph.participant import Notify, Participant, resolve
from rosbridge_sim.graph.topics_services import Deliver, Subscription, Topic
from rosbridge_sim.graph.type_resolution import TypeResolver
from rosbridge_sim.graph.unheard import MAX_TOLD_PUBLISHERS, MAX_WATCHED_PUBLISHERS, UNHEARD_AFTER, is_heard
from rosbridge_sim.graph.unpublished import UnpublishedTopics, WatchedTopics
from rosbridge_sim.protocol.body_limits import BodyLimits
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType

TYPE_MEMORY = 10.0
"""Time for which a topic's type is kept without publishers and subscribers [s] (`unregister_timeout`)."""

MAX_REMEMBERED_TOPICS = 10_000
"""Topics without publishers that are kept; the oldest are removed first."""


class TopicTable:
    """The topics of one bus.

    Attributes:
        by_name: all topics, by absolute name.
        unpublished: subscriptions to topics without a publisher.
        unheard: advertisements of clients without a subscriber.
    """

    def __init__(self, state: BusState, types: TypeResolver, by_name: dict[str, Topic]) -> None:
        """Create an empty table.

        Args:
            state: shared with the other parts of the bus.
            by_name: takes the topics; empty.
        """
        self.by_name = by_name
        self.unpublished = UnpublishedTopics(state.agenda)
        self.unheard: WatchedTopics[tuple[Participant, Topic]] = WatchedTopics(
            state.agenda, UNHEARD_AFTER, MAX_WATCHED_PUBLISHERS, MAX_TOLD_PUBLISHERS, is_heard
        )
        self._state = state
        self._types = types
        self._orphans: dict[Topic, None] = {}

    def advertise(
        self,
        owner: Participant,
        name: str,
        type_name: str,
        *,
        depth: int = 0,
        key: object = None,
        is_exclusive: bool = False,
        is_on_demand: bool = False,
    ) -> Topic:
        """Make `owner` a publisher of a topic.

        Args:
            name: name of the topic; may be relative.
            depth: number of latched messages of each publisher; the largest number of all its publishers counts.
            key: distinguishes several advertisements of one owner; the same key again replaces the old one.
            is_exclusive: no other owner may publish here; clients that do lose their advertisements.
            is_on_demand: the owner publishes only while the topic has a subscriber.

        Raises:
            GraphError: the topic has another type, or another owner publishes it exclusively.
            TypeNameError: the type does not exist.
        """
        topic, message_type = self._topic_for(owner, name, type_name)
        if not is_exclusive and topic.owner is not None and topic.owner is not owner:
            text = f"Topic {topic.name} is published by {topic.owner.name} alone; others may only subscribe"
            raise GraphError(text, reason=Reason.NAME_TAKEN)
        self._settle_type(owner, topic, message_type)
        if is_exclusive:
            topic.owner = owner
            self._displace_publishers(topic, f"{topic.name} is published by {owner.name} alone from now on")
        if is_on_demand:
            topic.on_demand[owner] = None
        topic.advertise(owner, key, depth)
        topic.orphaned_at = None
        self._orphans.pop(topic, None)
        self._state.held_by(owner).published[topic] = None
        self._state.report_topic(topic)
        self._state.report_holdings(owner)
        return topic

    def unadvertise(self, owner: Participant, name: str, now: float, key: object = None) -> None:
        """Remove an advertisement of `owner`; having none is not an error.

        Args:
            name: name of the topic; may be relative.
            key: key of the advertisement; None removes all of the owner there.
        """
        topic = self.by_name.get(resolve(name))
        if topic is None or owner not in topic.publishers:
            return
        topic.unadvertise(owner, key)
        if owner not in topic.publishers:
            self._drop_publisher(owner, topic, now)

    def subscribe(
        self,
        owner: Participant,
        name: str,
        deliver: Deliver,
        *,
        type_name: str | None = None,
        is_idle: bool = False,
        notify: Notify | None = None,
        is_general: bool = False,
        is_recording: bool = False,
        limits: BodyLimits | None = None,
    ) -> Subscription:
        """Subscribe to a topic. Latched messages are not delivered here: the caller reads `subscription.topic.latched`.

        A given type becomes the topic's type, unless the owner is a client. A client's subscription does not prevent a
        publisher with another type; it gets nothing while the topic has that other type.

        Args:
            name: name of the topic; may be relative.
            deliver: gets each message.
            type_name: type, in any accepted spelling; None means the topic's type.
            is_idle: do not start on-demand publishers; `is_idle` of the subscription may be changed later.
            notify: tells the owner something about the subscription; None means `owner.notify`.
            is_general: see `Subscription`.
            is_recording: see `Subscription`.
            limits: see `Subscription`.

        Raises:
            GraphError: the topic has another type, or no type is given and the topic is not advertised.
            TypeNameError: the type does not exist.
        """
        topic, message_type = self._topic_for(owner, name, type_name)
        if type_name is not None and not owner.is_guest:
            self._settle_type(owner, topic, message_type)
        wanted = None if type_name is None else message_type
        subscription = Subscription(
            topic,
            owner,
            deliver,
            is_idle,
            wanted,
            notify or owner.notify,
            is_general=is_general,
            is_recording=is_recording,
            limits=limits,
        )
        topic.add(subscription)
        self._state.held_by(owner).subscriptions[subscription] = None
        self._state.report_topic(topic)
        self._state.report_holdings(owner)
        return subscription

    def unsubscribe(self, subscription: Subscription, now: float) -> None:
        """End a subscription. A second call does nothing.

        Args:
            subscription: from `subscribe`.
        """
        topic = subscription.topic
        topic.remove(subscription)
        self._state.held_by(subscription.owner).subscriptions.pop(subscription, None)
        self.unpublished.forget(subscription)
        self._orphan(topic, now)
        self._state.report_holdings(subscription.owner)

    def type_to_publish(self, name: str, type_name: str | None) -> MessageType | OpaqueType:
        """Return the type for messages of a topic, which may not exist yet; nothing is changed.

        Args:
            name: name of the topic; may be relative.
            type_name: type, in any accepted spelling; None means the topic's type.

        Raises:
            GraphError: the topic has another type, or no type is given and the topic is not advertised.
            TypeNameError: the type does not exist.
        """
        topic = self.find_topic(name)
        if topic is None and type_name is None:
            raise self._no_topic(name)
        if topic is None or type_name is None:
            return self._types.message(type_name) if type_name is not None else topic.type  # type: ignore[union-attr] # one of them is not None
        why = self.type_conflict(name, type_name)
        if why is not None:
            raise GraphError(why, reason=Reason.TYPE_CONFLICT)
        return self._type_at(topic, type_name)

    def retype(self, subscription: Subscription, type_name: str) -> bool:
        """Restrict a client's subscription to a type, if that is the topic's type.

        Returns:
            True if it had another type before, so that no message could reach it.

        Raises:
            GraphError: the topic has another type; or it has no publisher, and the subscription asks for another type.
            TypeNameError: the name is malformed.
        """
        topic = subscription.topic
        had_messages = subscription in topic.subscriptions
        asked = topic.type if topic.is_settled or subscription.wanted is None else subscription.wanted
        if self._state.store.canonical(type_name) != asked.name:
            raise GraphError(_conflict(topic.name, type_name, asked.name), reason=Reason.TYPE_CONFLICT)
        subscription.wanted = asked
        topic.sort()
        if not had_messages:
            self._state.report_topic(topic)
        return not had_messages

    def forget_topic(self, name: str) -> None:
        """Forget a topic without publishers at once; an unknown topic is not an error.

        This removes its latched messages and, if it has no subscriber, its type.

        Args:
            name: name of the topic; may be relative.
        """
        topic = self.find_topic(name)
        if topic in self._orphans:
            self._forget(topic)

    def type_conflict(self, name: str, type_name: str, owner: Participant | None = None) -> str | None:
        """Return why a topic cannot have a type; None if it can. The topic may not exist yet.

        Args:
            name: name of the topic; may be relative.
            owner: the owner that needs it; None means a client.

        Raises:
            TypeNameError: the name of the type is malformed.
        """
        topic = self.find_topic(name)
        if topic is None or self._state.store.canonical(type_name) == topic.type.name or not topic.is_settled:
            return None
        if owner is not None and not owner.is_guest and not topic.is_bound:
            return None
        return _conflict(topic.name, type_name, topic.type.name)

    def find_topic(self, name: str) -> Topic | None:
        """Return the topic with a name; None if there is none.

        Args:
            name: relative or absolute name.
        """
        return self.by_name.get(resolve(name))

    def forget_latched(self, owner: Participant) -> None:
        """Drop the latched messages of an owner."""
        for topic in list(self.by_name.values()):
            topic.forget_messages_of(owner)

    def forget_orphans(self) -> None:
        """Drop the latched messages of publishers that are gone."""
        for topic in list(self._orphans):
            topic.forget_messages()

    # Time and departure

    def next_deadline(self) -> float | None:
        """Return when `expire` has something to do next [s]; None if never."""
        first = earliest(self.unpublished.next_due(), self.unheard.next_due())
        for topic in self._orphans:  # in the order in which they lost their publisher, so the first is the earliest
            if topic.orphaned_at is not None:
                return earliest(first, topic.orphaned_at + TYPE_MEMORY)
        return first

    def expire(self, now: float) -> None:
        """Forget topics that are unused for a while; tell subscribers that have waited long for a publisher."""
        attempt = self._state.guard.attempt
        for topic in list(takewhile(lambda topic: _is_over(topic, now), self._orphans)):
            attempt("forgetting a topic", self._forget, topic)
        for topic, notify in self.unpublished.take_due(now):
            attempt("a note about a topic without publishers", notify, topic)
        for topic, notify in self.unheard.take_due(now):
            attempt("a note about a topic without subscribers", notify, topic)

    def leave(self, owner: Participant, now: float) -> None:
        """End the subscriptions and advertisements of an owner."""
        attempt = self._state.guard.attempt
        held = self._state.holdings(owner)
        for subscription in list(held.subscriptions):
            attempt("the end of a subscription", self.unsubscribe, subscription, now)
        for topic in list(held.published):
            attempt("the end of an advertisement", topic.unadvertise, owner, None)
            attempt("the end of a publisher", self._drop_publisher, owner, topic, now)

    # Bookkeeping

    def _topic_for(
        self, owner: Participant, name: str, type_name: str | None
    ) -> tuple[Topic, MessageType | OpaqueType]:
        """Return a topic, which is created if needed, and the type that `owner` may use there.

        An existing topic is not changed.
        """
        absolute = resolve(name)
        topic = self.by_name.get(absolute)
        if topic is None:
            if type_name is None:
                raise self._no_topic(name)
            topic = self.by_name[absolute] = Topic(absolute, self._types.message(type_name))
        elif type_name is None:
            return topic, topic.type
        elif (why := self.type_conflict(absolute, type_name, owner)) is not None:
            raise GraphError(why, reason=Reason.TYPE_CONFLICT)
        return topic, self._type_at(topic, type_name)

    def _type_at(self, topic: Topic, type_name: str) -> MessageType | OpaqueType:
        """Return the type with a name: the topic's own object if it is the same type."""
        is_own = self._state.store.canonical(type_name) == topic.type.name
        return topic.type if is_own else self._types.message(type_name)

    def _settle_type(self, owner: Participant, topic: Topic, message_type: MessageType | OpaqueType) -> None:
        """Set the type of a topic, which must not be fixed to another type."""
        if message_type.name != topic.type.name:
            self._displace_publishers(
                topic,
                f"{topic.name} has type {message_type.name} of {owner.name} from now on, not {topic.type.name}",
            )
        topic.settle(message_type)

    def _displace_publishers(self, topic: Topic, why: str) -> None:
        """End the clients' advertisements of a topic that a part of the server needs for itself."""
        for owner in list(topic.publishers):
            if owner.is_guest:  # not a part of the server: see `Topic.is_bound`
                text = f"{why}: this client's advertisement ends"
                self._state.guard.attempt("the loss of a topic", owner.lose, "topic", topic.name, text)
                topic.unadvertise(owner, None)
                topic.on_demand.pop(owner, None)
                topic.forget_messages_of(owner)
                self._state.held_by(owner).published.pop(topic, None)
                self._state.report_holdings(owner)

    @staticmethod
    def _no_topic(name: str) -> GraphError:
        """Return the error for a topic that does not exist and has no given type."""
        text = f"Cannot infer topic type for topic {name} as it is not yet advertised"
        return GraphError(text, reason=Reason.UNKNOWN_TOPIC)

    def _drop_publisher(self, owner: Participant, topic: Topic, now: float) -> None:
        """Clean up after an owner that has stopped publishing there."""
        topic.on_demand.pop(owner, None)
        self.unheard.forget((owner, topic))
        if topic.publishers:
            topic.forget_messages_of(owner)
        if topic.owner is owner:
            topic.owner = None
        self._state.held_by(owner).published.pop(topic, None)
        self._orphan(topic, now)
        self._state.report_holdings(owner)

    def _orphan(self, topic: Topic, now: float) -> None:
        """Start the lifetime of a topic without publishers."""
        if not topic.publishers:
            topic.orphaned_at = now
            self._orphans.pop(topic, None)
            self._orphans[topic] = None
            self._state.agenda.announce(now + TYPE_MEMORY)
            if len(self._orphans) > MAX_REMEMBERED_TOPICS:
                self._forget(next(iter(self._orphans)))

    def _forget(self, topic: Topic) -> None:
        """Forget a topic without publishers; its type, too, if it has no subscriber."""
        del self._orphans[topic]
        topic.forget_messages()
        if not topic.all_subscriptions:
            if self.by_name.get(topic.name) is topic:
                del self.by_name[topic.name]
        elif not topic.is_bound:
            topic.unsettle()


def _conflict(topic: str, type_name: str, established: str) -> str:
    """Return the text that a topic has another type, in rosbridge_suite's words."""
    wanted = f"Tried to register topic {topic} with type {type_name}"
    return f"{wanted} but it is already established with type {established}"


def _is_over(topic: Topic, now: float) -> bool:
    """Return True if the lifetime of a topic without publishers is over."""
    return topic.orphaned_at is not None and topic.orphaned_at + TYPE_MEMORY <= now

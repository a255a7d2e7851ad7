"""Topics by name: their types, their publishers and subscriptions, and how long a topic without publishers lives.

A topic's type is its publishers'. Clients that only listen do not settle it, and a client gives way where a part of the
server wants a name or a type (`Guest`): else any client could keep others' topics, or an ego's, from being there.

A topic's type outlives its last publisher by `TYPE_MEMORY` seconds, so that a program that is restarted finds its topic
as it left it (rosbridge_suite keeps the publisher itself for as long).
"""

from __future__ import annotations

from itertools import takewhile

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.bus_state import BusState
from rosbridge_sim.graph.participant import Guest, Notify, Participant, resolve
from rosbridge_sim.graph.topics_services import Deliver, Subscription, Topic
from rosbridge_sim.graph.type_resolution import TypeResolver
from rosbridge_sim.graph.unpublished import UnpublishedTopics
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType

__all__ = ["MAX_REMEMBERED_TOPICS", "TYPE_MEMORY", "TopicTable"]

TYPE_MEMORY = 10.0
"""Time for which a topic's type is remembered without publishers and subscribers [s] (`unregister_timeout`)."""

MAX_REMEMBERED_TOPICS = 10_000
"""Topics without publishers that are kept for their next user: the newest."""


class TopicTable:
    """The topics of one bus.

    Attributes:
        by_name: all topics, by absolute name.
        unpublished: subscriptions to topics that nobody publishes.
    """

    def __init__(self, state: BusState, types: TypeResolver, by_name: dict[str, Topic]) -> None:
        """No topics yet.

        Args:
            state: shared with the other parts of the bus.
            types: of messages.
            by_name: takes the topics; empty.
        """
        self.by_name = by_name
        self.unpublished = UnpublishedTopics()
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
        """The topic, with `owner` as one of its publishers.

        Args:
            owner: who will publish.
            name: may be relative.
            type_name: in any accepted spelling.
            depth: keep so many of the last messages for those who come later, of each publisher as many as the one who
                asks for most.
            key: tells several advertisements of one owner apart; the same key again replaces the old one.
            is_exclusive: no other owner may publish here; clients that do lose their advertisements.
            is_on_demand: the owner publishes only while the topic has a listener.

        Raises:
            GraphError: type conflict, or another owner has the topic to itself.
            TypeNameError: the type cannot be had.
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
        """Take one advertisement of `owner` back, or all of them where `key` is None; none there is no error."""
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
    ) -> Subscription:
        """Listen to a topic. What is latched there is the caller's to fetch: `subscription.topic.latched`.

        A type that is given settles the topic's, unless a client gives it: then a publisher may come with another one,
        and the subscription gets nothing for as long as that is the topic's type.

        Args:
            owner: who listens.
            name: may be relative.
            deliver: gets each message.
            type_name: in any accepted spelling; None takes the topic's.
            is_idle: overhear only; the subscription's own `is_idle` may be changed later.
            notify: tells the owner something about the subscription; None for `owner.notify`.
            is_general: see `Subscription`.
            is_recording: the same.

        Raises:
            GraphError: type conflict, or no type given for a topic that nobody has advertised.
            TypeNameError: the type cannot be had.
        """
        topic, message_type = self._topic_for(owner, name, type_name)
        if type_name is not None and not isinstance(owner, Guest):
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
        )
        topic.add(subscription)
        self._state.held_by(owner).subscriptions[subscription] = None
        self._state.report_topic(topic)
        self._state.report_holdings(owner)
        return subscription

    def unsubscribe(self, subscription: Subscription, now: float) -> None:
        """Stop listening; twice is no error."""
        topic = subscription.topic
        topic.remove(subscription)
        self._state.held_by(subscription.owner).subscriptions.pop(subscription, None)
        self.unpublished.forget(subscription)
        self._orphan(topic, now)
        self._state.report_holdings(subscription.owner)

    def type_to_publish(self, name: str, type_name: str | None) -> MessageType | OpaqueType:
        """The type of messages for a topic, whether it is there or not; nothing is changed.

        Args:
            name: of the topic; may be relative.
            type_name: in any accepted spelling; None takes the topic's.

        Raises:
            GraphError: type conflict, or no type given for a topic that nobody has advertised.
            TypeNameError: the type cannot be had.
        """
        topic = self.find_topic(name)
        if topic is None and type_name is None:
            raise self._no_topic(name)
        if topic is None or type_name is None:
            return self._types.message(type_name) if type_name is not None else topic.type  # type: ignore[union-attr] # one is there
        why = self.type_conflict(name, type_name)
        if why is not None:
            raise GraphError(why, reason=Reason.TYPE_CONFLICT)
        return self._type_at(topic, type_name)

    def retype(self, subscription: Subscription, type_name: str) -> bool:
        """Have a client's subscription take messages of a type alone, if that is the topic's.

        Returns:
            Whether it was of another type until now, so that no message could reach it.

        Raises:
            GraphError: the topic has another type; or nobody publishes there, and the subscription asks for another.
            TypeNameError: the name is malformed.
        """
        topic = subscription.topic
        had_messages = subscription in topic.subscriptions
        asked = topic.type if topic.is_settled or subscription.wanted is None else subscription.wanted
        if self._state.store.canonical(type_name) != asked.name:
            raise GraphError(_conflict(topic.name, type_name, asked.name), reason=Reason.TYPE_CONFLICT)
        subscription.wanted = asked
        topic.sort()
        return not had_messages

    def forget_topic(self, name: str) -> None:
        """Forget now what is remembered of a topic without publishers; no such topic is no error.

        That is what is latched there and, unless somebody listens, its type.
        """
        topic = self.find_topic(name)
        if topic in self._orphans:
            self._forget(topic)

    def type_conflict(self, name: str, type_name: str, owner: Participant | None = None) -> str | None:
        """Why a topic cannot be of this type; None if it can, whether it is there or not.

        Args:
            name: of the topic; may be relative.
            type_name: in any accepted spelling.
            owner: who wants it; None for a client.

        Raises:
            TypeNameError: the name of the type is malformed.
        """
        topic = self.find_topic(name)
        if topic is None or self._state.store.canonical(type_name) == topic.type.name or not topic.is_settled:
            return None
        if owner is not None and not isinstance(owner, Guest) and not topic.is_bound:
            return None
        return _conflict(topic.name, type_name, topic.type.name)

    def find_topic(self, name: str) -> Topic | None:
        """The topic of that name, relative or absolute, if there is one."""
        return self.by_name.get(resolve(name))

    def forget_latched(self, owner: Participant) -> None:
        """Keep nothing that an owner has published for those who come late."""
        for topic in list(self.by_name.values()):
            topic.forget_messages_of(owner)

    def forget_orphans(self) -> None:
        """Keep nothing of publishers that are gone."""
        for topic in list(self._orphans):
            topic.forget_messages()

    # Time and departure

    def next_deadline(self) -> float | None:
        """Return when `expire` has something to do next [s]; None if never."""
        first = self.unpublished.next_due()
        for topic in self._orphans:  # in order of orphaning, so the first is the earliest
            if topic.orphaned_at is not None:
                due = topic.orphaned_at + TYPE_MEMORY
                return due if first is None else min(due, first)
        return first

    def expire(self, now: float) -> None:
        """Forget the topics that nobody has held for a while; tell listeners that have waited for a publisher."""
        attempt = self._state.guard.attempt
        for topic in list(takewhile(lambda topic: _is_over(topic, now), self._orphans)):
            attempt("forgetting a topic", self._forget, topic)
        for topic, notify in self.unpublished.take_due(now):
            attempt("a word about a topic that nobody publishes", notify, topic)

    def leave(self, owner: Participant, now: float) -> None:
        """End the subscriptions and advertisements of an owner."""
        attempt = self._state.guard.attempt
        held = self._state.holdings(owner)
        for subscription in list(held.subscriptions):
            attempt("the end of a subscription", self.unsubscribe, subscription, now)
        for topic in list(held.published):
            attempt("the end of an advertisement", topic.unadvertise, owner, None)
            attempt("the end of a publisher", self._drop_publisher, owner, topic, now)

    # How it is kept

    def _topic_for(
        self, owner: Participant, name: str, type_name: str | None
    ) -> tuple[Topic, MessageType | OpaqueType]:
        """The topic, made if need be, and the type that `owner` may use there; what is there is not changed."""
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
        """The type of that name: the topic's own, where it is that one."""
        is_own = self._state.store.canonical(type_name) == topic.type.name
        return topic.type if is_own else self._types.message(type_name)

    def _settle_type(self, owner: Participant, topic: Topic, message_type: MessageType | OpaqueType) -> None:
        """Have a type at a topic from now on. It must not be bound to another one."""
        if message_type.name != topic.type.name:
            self._displace_publishers(
                topic,
                f"{topic.name} has type {message_type.name} of {owner.name} from now on, not {topic.type.name}",
            )
        topic.settle(message_type)

    def _displace_publishers(self, topic: Topic, why: str) -> None:
        """End the clients' advertisements of a topic that a part of the server wants for itself."""
        for owner in list(topic.publishers):
            if isinstance(owner, Guest):  # no part of the server: see `Topic.is_bound`
                self._state.guard.attempt(
                    "the loss of a topic", owner.lose, "topic", topic.name, f"{why}: this client's advertisement ends"
                )
                topic.unadvertise(owner, None)
                topic.on_demand.pop(owner, None)
                topic.forget_messages_of(owner)
                self._state.held_by(owner).published.pop(topic, None)
                self._state.report_holdings(owner)

    @staticmethod
    def _no_topic(name: str) -> GraphError:
        """The error of a topic that is not there, and whose type was not said."""
        text = f"Cannot infer topic type for topic {name} as it is not yet advertised"
        return GraphError(text, reason=Reason.UNKNOWN_TOPIC)

    def _drop_publisher(self, owner: Participant, topic: Topic, now: float) -> None:
        """Tidy up after an owner that publishes there no longer."""
        topic.on_demand.pop(owner, None)
        if topic.publishers:
            topic.forget_messages_of(owner)
        if topic.owner is owner:
            topic.owner = None
        self._state.held_by(owner).published.pop(topic, None)
        self._orphan(topic, now)
        self._state.report_holdings(owner)

    def _orphan(self, topic: Topic, now: float) -> None:
        """Start the clock of a topic without publishers."""
        if not topic.publishers:
            topic.orphaned_at = now
            self._orphans.pop(topic, None)
            self._orphans[topic] = None
            if len(self._orphans) > MAX_REMEMBERED_TOPICS:
                self._forget(next(iter(self._orphans)))

    def _forget(self, topic: Topic) -> None:
        """Forget a topic without publishers, its type too if nobody waits there."""
        del self._orphans[topic]
        topic.forget_messages()
        if not topic.all_subscriptions:
            if self.by_name.get(topic.name) is topic:
                del self.by_name[topic.name]
        elif not topic.is_bound:
            topic.unsettle()


def _conflict(topic: str, type_name: str, established: str) -> str:
    """Say that a topic has another type, in rosbridge_suite's words."""
    wanted = f"Tried to register topic {topic} with type {type_name}"
    return f"{wanted} but it is already established with type {established}"


def _is_over(topic: Topic, now: float) -> bool:
    """Return whether the type of a topic without publishers has been remembered for long enough."""
    return topic.orphaned_at is not None and topic.orphaned_at + TYPE_MEMORY <= now

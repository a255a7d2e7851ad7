"""Topics with their subscriptions, and services with their calls, as values. Only the bus makes and changes them.

A call ends exactly once: it is answered, refused or given up. Later answers are ignored.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import msgspec

from rosbridge_sim.errors import PeerError, Reason
from rosbridge_sim.graph.participant import Notify, Participant, decode_body
from rosbridge_sim.protocol.body_limits import LIGHT, BodyLimits
from rosbridge_sim.protocol.client_memory import Account, HeldMessages
from rosbridge_sim.protocol.ops import OpBody
from rosbridge_sim.protocol.smallest import Smallest
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType, ServiceType
from rosbridge_sim.schema.opaque_types import OpaqueServiceType, OpaqueType

__all__ = ["Answer", "BodyLimits", "Call", "Deliver", "Handle", "OnAnswer", "Service", "Subscription", "Topic"]

Deliver = Callable[["Topic", Message, Participant, float], None]
"""`(topic, message, sender, now)`; a PeerError that it raises is sent back to the sender."""

Handle = Callable[["Call", float], None]
"""`(call, now)`; it answers the call, now or later. A PeerError that it raises refuses the call."""


class Answer(msgspec.Struct, frozen=True, eq=False):
    """The end of a call. A struct of `msgspec`, as `Call`, because both are made for each call.

    Attributes:
        is_ok: `result` on the wire.
        values: the response if `is_ok`; else the reason: a text, or any JSON value that the provider sent.
        reason: kind of mistake, if the caller made one; None if the provider failed or left.
    """

    is_ok: bool
    values: object
    reason: Reason | None = None


OnAnswer = Callable[[Answer], None]


@dataclass(eq=False, slots=True)
class Subscription:
    """One subscriber of one topic; the bus compares it by identity.

    Attributes:
        is_idle: it gets messages, but does not start on-demand publishers.
        wanted: the type that it was made with; None accepts any type of the topic.
        notify: tells its owner something about it.
        is_general: its owner subscribes to everything of a publisher, not to this topic in particular.
        is_recording: its owner stores the messages, so it must not get messages that are only shown again.
        limits: of the topic's messages from clients; None for none.
    """

    topic: Topic
    owner: Participant
    deliver: Deliver
    is_idle: bool
    wanted: MessageType | OpaqueType | None
    notify: Notify
    is_general: bool = False
    is_recording: bool = False
    limits: BodyLimits | None = None

    @property
    def fits(self) -> bool:
        """True if messages of the topic's type can be delivered to it."""
        return self.wanted is None or self.wanted.name == self.topic.type.name

    @property
    def is_binding(self) -> bool:
        """True if it fixes the topic's type. A client's subscription never does: it could block publishers."""
        return self.wanted is not None and not self.owner.is_guest


@dataclass(eq=False, slots=True)
class Topic:
    """A named channel of one type.

    The type is *settled* by a publisher, or by a subscription of the server's own parts. If only clients subscribe, it
    is *provisional*: the type that the first of them asked for, until a publisher comes with its own type.

    Attributes:
        type: settled or provisional.
        is_settled: the type is settled.
        publishers: owner -> keys of its advertisements, with the number of latched messages of each.
        subscriptions: those that get messages, in order of arrival; a tuple, so that it may change during a delivery.
        all_subscriptions: the same, and those that ask for another type than the settled one and get no messages.
        depth: number of latched messages of each publisher: the largest `depth` of all advertisements; 0 keeps none.
        kept: publisher -> its latched messages; the one that published last is at the end.
        depths: the depth of each advertisement, as negative numbers.
        owner: the only owner that may publish, for the simulator's outputs; None if all may.
        on_demand: publishers that are silent while there is no subscriber.
        orphaned_at: when the last publisher left [s]; None while there is one.
        limits: of a message from a client, if a part of the server reads the topic; None for none.
    """

    name: str
    type: MessageType | OpaqueType
    is_settled: bool = False
    publishers: dict[Participant, dict[object, int]] = field(default_factory=dict)
    subscriptions: tuple[Subscription, ...] = ()
    all_subscriptions: tuple[Subscription, ...] = ()
    depth: int = 0
    kept: dict[Participant, HeldMessages[Message]] = field(default_factory=dict)
    depths: Smallest = field(default_factory=Smallest)
    owner: Participant | None = None
    on_demand: dict[Participant, None] = field(default_factory=dict)
    orphaned_at: float | None = None
    limits: BodyLimits | None = None

    @property
    def is_latching(self) -> bool:
        """True if messages are kept for late subscribers."""
        return bool(self.depth)

    @property
    def latched(self) -> list[Message]:
        """The latched messages: the last ones of each publisher, oldest first."""
        return [message for held in self.kept.values() for message in held.messages()]

    @property
    def has_listener(self) -> bool:
        """True if a subscription waits for a message; an idle one does not count."""
        for subscription in self.subscriptions:  # noqa: SIM110 - called for each output in each frame; `any` is slower
            if not subscription.is_idle:
                return True
        return False

    @property
    def is_asked_for(self) -> bool:
        """True if a subscription is for this topic in particular, and not for all of a publisher."""
        return any(not subscription.is_general for subscription in self.subscriptions)

    @property
    def is_bound(self) -> bool:
        """True if a part of the server publishes here, or subscribes with a type, so that the type cannot change."""
        return any(not owner.is_guest for owner in self.publishers) or any(
            subscription.is_binding for subscription in self.all_subscriptions
        )

    def settle(self, message_type: MessageType | OpaqueType) -> None:
        """Fix the type, and tell the subscriptions that ask for another one (for the bus alone).

        All methods below are for the bus alone, too.
        """
        if self.is_settled and self.type.name == message_type.name:
            return
        if self.type is not message_type:  # a type of this name may have become known since
            self.type = message_type
            self.forget_messages()
        self.is_settled = True
        self.sort()
        name = self.type.name
        for subscription in self.all_subscriptions:
            if subscription.wanted is not None and not subscription.fits:
                subscription.notify(
                    "error",
                    f"{self.name} has type {name} now, but this subscription asks for {subscription.wanted.name}: it"
                    f" gets no messages; subscribe with type {name}",
                )

    def unsettle(self) -> None:
        """Use the type of the first subscription until there is a publisher again."""
        self.is_settled = False
        self.type = next((each.wanted for each in self.all_subscriptions if each.wanted is not None), self.type)
        self.sort()

    def sort(self) -> None:
        """Find the subscriptions that can get messages."""
        if self.is_settled:
            self.subscriptions = tuple(each for each in self.all_subscriptions if each.fits)
        else:
            self.subscriptions = self.all_subscriptions

    def add(self, subscription: Subscription) -> None:
        """Add a subscription."""
        self.all_subscriptions += (subscription,)
        self.limits = subscription.limits or self.limits
        if subscription.fits or not self.is_settled:
            self.subscriptions += (subscription,)

    def remove(self, subscription: Subscription) -> None:
        """Remove a subscription."""
        self.subscriptions = _without(self.subscriptions, subscription)
        self.all_subscriptions = _without(self.all_subscriptions, subscription)
        if subscription.limits is not None:
            self.limits = next((each.limits for each in self.all_subscriptions if each.limits is not None), None)
        if not self.is_settled:
            self.unsettle()

    def advertise(self, owner: Participant, key: object, depth: int) -> None:
        """Add an advertisement.

        Args:
            depth: number of messages to latch.
        """
        keys = self.publishers.setdefault(owner, {})
        if key in keys:
            self.depths.remove(-keys[key])
        keys[key] = depth
        self.depths.add(-depth)
        self._set_depth()

    def unadvertise(self, owner: Participant, key: object) -> None:
        """Remove an advertisement.

        Args:
            key: key of the advertisement; None removes all of the owner.
        """
        keys = self.publishers.get(owner, {})
        gone = list(keys) if key is None else [key] if key in keys else []
        self.depths.remove_all(-keys.pop(each) for each in gone)
        if not keys:
            self.publishers.pop(owner, None)
        self._set_depth()

    def keep(self, sender: Participant, message: Message, account: Account | None) -> bool:
        """Latch a message.

        Args:
            account: pays for it; None if the sender is a part of this process, which has no limit.

        Returns:
            True if there was room.
        """
        held = self.kept.pop(sender, None)
        if held is None:
            held = HeldMessages(account, _size_of)
            for owner in [owner for owner in self.kept if owner not in self.publishers]:
                self.forget_messages_of(owner)
        self.kept[sender] = held
        held.put(message, self.depth)
        return bool(held.entries)

    def forget_messages_of(self, owner: Participant) -> None:
        """Drop the latched messages of one publisher."""
        held = self.kept.pop(owner, None)
        if held is not None:
            held.shorten(0)

    def forget_messages(self) -> None:
        """Drop all latched messages."""
        self.depth = 0
        for owner in list(self.kept):
            self.forget_messages_of(owner)

    def _set_depth(self) -> None:
        """Update the number of latched messages. Without a publisher it stays, so they are kept as long as the type."""
        smallest = self.depths.get()
        if smallest is None:
            return
        depth = -int(smallest)
        if depth < self.depth:  # each message is removed only once, so many changes stay cheap
            for held in self.kept.values():
                held.shorten(depth)
            if not depth:
                self.kept = {}
        self.depth = depth


def _without(subscriptions: tuple[Subscription, ...], one: Subscription) -> tuple[Subscription, ...]:
    """Return the subscriptions but for one, which may be missing."""
    if one not in subscriptions:
        return subscriptions
    i = subscriptions.index(one)
    return subscriptions[:i] + subscriptions[i + 1 :]


def _size_of(message: Message) -> int:
    return message.num_bytes


@dataclass(eq=False, slots=True)
class Service:
    """A named service and its provider.

    Attributes:
        limits: those of a request; None for a client's service.
        patience: longest wait for an answer if neither the call nor the bus names one [s]; None waits for ever.
    """

    name: str
    type: ServiceType | OpaqueServiceType
    owner: Participant
    handle: Handle
    is_exclusive: bool = False
    limits: BodyLimits | None = None
    patience: float | None = None
    calls: dict[Call, None] = field(default_factory=dict)

    def decode_request(self, args: OpBody, stamp_ns: int, caller: Participant) -> object:
        """Return the checked and completed request of a call.

        Args:
            args: fields by name, by position, or none.
            stamp_ns: time for stamps that they leave open [ns].
            caller: the client that calls.

        Raises:
            PeerError: the request is too large, or does not fit the type.
        """
        if self.limits is not None and not (isinstance(args, msgspec.Raw) and len(args) < LIGHT):
            self.limits.check(self.name, args)
        return decode_body(self.type.request, args, stamp_ns, caller)


class _CallTable(Protocol):
    """The part of the service table that a call needs."""

    def forget_call(self, call: Call) -> None:
        """Remove an ended call from its caller's list."""

    def hand_over(self, call: Call, answer: Answer) -> None:
        """Give the answer of a call to its caller. Must not raise for a mistake of either side."""


class Call(msgspec.Struct, eq=False):
    """One call, from its request to its answer.

    Attributes:
        request: a struct of the service's request type; None after the end, because it may be large, and ended calls
            are kept for late answers.
        deadline: when it is given up [s], or None.
        is_done: answered, refused or given up; later answers are ignored.
        num_bytes: memory that its caller's account pays for it [bytes].
        on_end: called at its end, however it ends; set by its provider.
    """

    service: Service
    caller: Participant
    request: object
    on_answer: OnAnswer
    table: _CallTable
    deadline: float | None = None
    is_done: bool = False
    num_bytes: int = 0
    on_end: Callable[[], object] | None = None

    def answer(self, values: object) -> None:
        """End the call with a response.

        Args:
            values: a struct of the service's response type.
        """
        self._end(Answer(is_ok=True, values=Message(self.service.type.response, values)))

    def respond(self, *values: object, **fields: object) -> None:
        """End the call with a response of these fields."""
        self.answer(self.service.type.response.struct_type(*values, **fields))

    def fail(self, error: PeerError) -> None:
        """End the call with the fields `result` and `message` of a response, and tell the caller why."""
        self.explain(error, error.reason)
        self.respond(result=False, message=str(error))

    def explain(self, why: object, reason: Reason, level: str = "error") -> None:
        """Tell the caller why the request was refused, or not quite carried out; the call goes on.

        Args:
            reason: kind of mistake.
            level: `warning` or `error`.
        """
        self.caller.explain(level, f"{self.service.name}: {why}", reason)

    def answer_with(self, message: Message) -> None:
        """End the call with a response that may have been encoded already.

        Args:
            message: of the service's response type.
        """
        self._end(Answer(is_ok=True, values=message))

    def refuse(self, why: object, reason: Reason | None = None) -> None:
        """End the call with `result: false`.

        Args:
            why: the reason: a text, or any value that the provider sent.
            reason: kind of mistake, if the caller made one.
        """
        self._end(Answer(is_ok=False, values=why, reason=reason))

    def abandon(self) -> None:
        """End the call without an answer, because its caller is gone."""
        self._end(None)

    def _end(self, answer: Answer | None) -> None:
        if self.is_done:
            return
        self.is_done = True
        self.request = None
        self.service.calls.pop(self, None)
        self.table.forget_call(self)
        if self.on_end is not None:
            self.on_end()
            self.on_end = None
        if answer is not None:
            self.table.hand_over(self, answer)

"""Topics with their listeners, services with their calls, as values. The bus alone makes and changes them.

A call ends exactly once: it is answered, refused or given up, and whatever comes after that is ignored.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.participant import Guest, Notify, Participant
from rosbridge_sim.protocol.account import Account, HeldMessages
from rosbridge_sim.protocol.smallest import Smallest
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType, ServiceType
from rosbridge_sim.schema.opaque_types import OpaqueServiceType, OpaqueType

__all__ = ["Answer", "Call", "Deliver", "Handle", "OnAnswer", "Service", "Subscription", "Topic"]

Deliver = Callable[["Topic", Message, Participant, float], None]
"""`(topic, message, sender, now)`; a PeerError that it raises goes back to the sender."""

Handle = Callable[["Call", float], None]
"""`(call, now)`: answers the call, now or later; a PeerError that it raises refuses it."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The end of a call.

    Attributes:
        is_ok: `result` on the wire.
        values: the response when `is_ok`; else why not: a text, or whatever JSON value the provider sent.
        reason: the caller's mistake, where it is one: no provider that fails, and none that is gone.
    """

    is_ok: bool
    values: object
    reason: Reason | None = field(default=None, compare=False)


OnAnswer = Callable[[Answer], None]


@dataclass(eq=False, slots=True)
class Subscription:
    """One listener on one topic; the bus compares it by identity.

    Attributes:
        is_idle: it overhears what is published anyhow, but nothing has to be published for its sake.
        wanted: the type that it was made with; None where it takes any type that the topic has.
        notify: tells its owner something about it.
        is_general: its owner listens to everything that a publisher has, and not to this topic in particular.
        is_recording: its owner keeps what it hears, so what is only shown again is not for it.
    """

    topic: Topic
    owner: Participant
    deliver: Deliver
    is_idle: bool
    wanted: MessageType | OpaqueType | None
    notify: Notify
    is_general: bool = False
    is_recording: bool = False

    @property
    def fits(self) -> bool:
        """Return whether messages of the topic's type can be delivered to it."""
        return self.wanted is None or self.wanted.name == self.topic.type.name

    @property
    def is_binding(self) -> bool:
        """Return whether it settles the topic's type. A client's never does: any client could keep publishers away."""
        return self.wanted is not None and not isinstance(self.owner, Guest)


@dataclass(eq=False, slots=True)
class Topic:
    """A named channel of one type.

    The type is *settled* by a publisher, or by a subscription of the server's own parts. Where only clients listen it
    is *provisional*: the type that the first of them asked for, until a publisher comes, whose type wins.

    Attributes:
        type: settled or provisional.
        is_settled: which of the two.
        publishers: owner -> the keys under which it advertised, and how many messages each wants latched.
        subscriptions: those that messages are delivered to, in order of arrival; a tuple, so that a delivery may change
            it safely.
        all_subscriptions: the same, with those that ask for another type than the settled one and get no messages.
        depth: how many messages of each publisher are kept for those who come late: what the advertiser who asked for
            most asked for; 0 keeps none.
        kept: publisher -> its last messages; the one that published last stands last.
        depths: what each advertisement asks for, as negative numbers.
        owner: the one owner that may publish, for the simulator's outputs; None where all may.
        on_demand: the publishers that are silent while nobody listens.
        orphaned_at: when the last publisher left [s]; None while there is one.
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

    @property
    def is_latching(self) -> bool:
        """Return whether messages are kept for late subscribers."""
        return bool(self.depth)

    @property
    def latched(self) -> list[Message]:
        """Messages that are kept for late subscribers: of each publisher the last ones, oldest first."""
        return [message for held in self.kept.values() for message in held.messages()]

    @property
    def has_listener(self) -> bool:
        """Return whether a subscription waits for a message; an idle one does not count."""
        for subscription in self.subscriptions:  # noqa: SIM110 - asked for each output at each frame; `any` is slower
            if not subscription.is_idle:
                return True
        return False

    @property
    def is_bound(self) -> bool:
        """Return whether a part of the server publishes here, or listens with a type: the type cannot change then."""
        return any(not isinstance(owner, Guest) for owner in self.publishers) or any(
            subscription.is_binding for subscription in self.all_subscriptions
        )

    def settle(self, message_type: MessageType | OpaqueType) -> None:
        """Have this type for all to come, and tell the subscriptions that ask for another (for the bus alone).

        So are all methods that follow.
        """
        if self.is_settled and self.type.name == message_type.name:
            return
        if self.type.name != message_type.name:
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
        """Have the type that the first subscription asks for, until somebody publishes again."""
        self.is_settled = False
        self.type = next((each.wanted for each in self.all_subscriptions if each.wanted is not None), self.type)
        self.sort()

    def sort(self) -> None:
        """Find out which subscriptions messages can be delivered to."""
        if self.is_settled:
            self.subscriptions = tuple(each for each in self.all_subscriptions if each.fits)
        else:
            self.subscriptions = self.all_subscriptions

    def add(self, subscription: Subscription) -> None:
        """Have one more subscription."""
        self.all_subscriptions += (subscription,)
        if subscription.fits or not self.is_settled:
            self.subscriptions += (subscription,)

    def remove(self, subscription: Subscription) -> None:
        """Have it no longer."""
        self.subscriptions = tuple(each for each in self.subscriptions if each is not subscription)
        self.all_subscriptions = tuple(each for each in self.all_subscriptions if each is not subscription)
        if not self.is_settled:
            self.unsettle()

    def advertise(self, owner: Participant, key: object, depth: int) -> None:
        """Have a publisher that wants so many messages kept."""
        keys = self.publishers.setdefault(owner, {})
        if key in keys:
            self.depths.remove(-keys[key])
        keys[key] = depth
        self.depths.add(-depth)
        self._set_depth()

    def unadvertise(self, owner: Participant, key: object) -> None:
        """Take one advertisement back, or all of an owner where `key` is None."""
        keys = self.publishers.get(owner, {})
        gone = list(keys) if key is None else [key] if key in keys else []
        self.depths.remove_all(-keys.pop(each) for each in gone)
        if not keys:
            self.publishers.pop(owner, None)
        self._set_depth()

    def keep(self, sender: Participant, message: Message, account: Account | None) -> bool:
        """Keep a message for those who come late; return whether there was room for it.

        Args:
            sender: who has published it.
            message: the newest.
            account: pays for it; None where the sender is a part of this process, which has no limit.
        """
        held = self.kept.pop(sender, None)
        if held is None:
            held = HeldMessages(account, _size_of)
            for owner in [owner for owner in self.kept if owner not in self.publishers]:
                self.forget_messages_of(owner)
        self.kept[sender] = held
        held.put(message, self.depth)
        return len(held) > 0

    def forget_messages_of(self, owner: Participant) -> None:
        """Keep nothing of one publisher any longer."""
        held = self.kept.pop(owner, None)
        if held is not None:
            held.shorten(0)

    def forget_messages(self) -> None:
        """Keep nothing any longer."""
        self.depth = 0
        for owner in list(self.kept):
            self.forget_messages_of(owner)

    def _set_depth(self) -> None:
        """Keep as many as the publishers want; without one, what is latched stays for as long as the type does."""
        smallest = self.depths.get()
        if smallest is None:
            return
        depth = -int(smallest)
        if depth < self.depth:  # what was kept is taken off once, so many changes cost no more than the messages did
            for held in self.kept.values():
                held.shorten(depth)
            if not depth:
                self.kept = {}
        self.depth = depth


def _size_of(message: Message) -> int:
    return message.num_bytes


@dataclass(eq=False, slots=True)
class Service:
    """A named service and who provides it."""

    name: str
    type: ServiceType | OpaqueServiceType
    owner: Participant
    handle: Handle
    is_exclusive: bool = False
    calls: dict[Call, None] = field(default_factory=dict)


class _CallTable(Protocol):
    """The part of the table of services that a call needs."""

    def forget_call(self, call: Call) -> None:
        """Strike a finished call from its caller's list."""

    def hand_over(self, call: Call, answer: Answer) -> None:
        """Give a call's caller the answer. Must not raise for what is wrong with either of the two."""


@dataclass(eq=False, slots=True)
class Call:
    """One call, from its request to its one answer.

    Attributes:
        request: a struct of the service's request type; None after the end, for it may be large, and ended calls are
            kept for late answers.
        deadline: when it is given up [s], or None.
        is_done: answered, refused or given up; whatever comes after that is ignored.
        num_bytes: what its caller's account pays for it [bytes].
    """

    service: Service
    caller: Participant
    request: object
    on_answer: OnAnswer
    table: _CallTable
    deadline: float | None = None
    is_done: bool = False
    num_bytes: int = 0

    def answer(self, values: object) -> None:
        """End the call with a struct of the service's response type."""
        self._end(Answer(is_ok=True, values=Message(self.service.type.response, values)))

    def refuse(self, why: object, reason: Reason | None = None) -> None:
        """End the call with `result: false` and a text (or what the provider sent in its place).

        Args:
            why: the text.
            reason: the caller's mistake, if it is one.
        """
        self._end(Answer(is_ok=False, values=why, reason=reason))

    def abandon(self) -> None:
        """End the call without an answer: its caller is gone."""
        self._end(None)

    def _end(self, answer: Answer | None) -> None:
        if self.is_done:
            return
        self.is_done = True
        self.request = None
        self.service.calls.pop(self, None)
        self.table.forget_call(self)
        if answer is not None:
            self.table.hand_over(self, answer)

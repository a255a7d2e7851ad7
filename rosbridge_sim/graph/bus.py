"""Who talks to whom in this process: topics, services and parameters, in one synchronous table.

Everything that talks is an `Participant`: a WebSocket client's `Peer`, the simulator's node, rosapi, later a
recorder or a far bridge. The bus calls listeners and providers directly and in a fixed order, so one
incoming frame is carried to its end before the next: that is our transaction. It has never heard of
frames, sockets or JSON text; message bodies reach it as `Message` values of the store.

What belongs to an owner hangs on that owner, and `leave` takes all of it away: publishers, subscriptions,
services (whose waiting callers get an answer at once) and calls (whose answers nobody waits for any more).
Only a topic's *type* outlives its last publisher, by `TYPE_MEMORY` seconds, so that a program that is
restarted finds its topic as it left it (rosbridge_suite keeps the publisher itself for as long).

A topic's type is its publishers'. Clients that only listen do not settle it, and a client gives way where a part of the
server wants a name or a type (`Guest`): else any client could keep others' topics, or an ego's, from being there.

Time comes as an argument: `now` is monotonic seconds. `time_ns` is the simulation's time, and `stamp_ns` the time that
messages are stamped with: the same one, or the time of day. The node sets both at each frame.
"""

from __future__ import annotations

import heapq
import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import count, takewhile

from rosbridge_sim.errors import EncodingError, GraphError, PeerError, Reason, UnknownPackageError
from rosbridge_sim.graph.actions import Actions
from rosbridge_sim.graph.guard import Guard
from rosbridge_sim.graph.parameters import Parameters
from rosbridge_sim.graph.participant import (
    Guest,
    Notify,
    Participant,
    decode_body,
    gives_way,
    resolve,
    size_of_body,
    take_over,
)
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.topics_services import Answer, Call, Deliver, Handle, OnAnswer, Service, Subscription, Topic
from rosbridge_sim.graph.unpublished import UnpublishedTopics
from rosbridge_sim.protocol.account import Account
from rosbridge_sim.protocol.ops import OpBody
from rosbridge_sim.schema.compile import (
    ActionType,
    MessageType,
    OpaqueActionType,
    OpaqueServiceType,
    OpaqueType,
    ServiceType,
)
from rosbridge_sim.schema.store import Message, Store

__all__ = ["MAX_CALLS", "TYPE_MEMORY", "Bus", "Holdings"]

TYPE_MEMORY = 10.0
"""How long a topic's type is remembered without publishers and subscribers [s] (`unregister_timeout`)."""

MAX_CALLS = 1_000
"""Calls, and goals, that one caller may have in flight by default: ten times what the busiest known client has."""

MAX_REMEMBERED_TOPICS = 10_000
"""Topics without publishers, and types that nobody knows, that are kept for their next user: the newest."""

MAX_STALE = 100
"""Ended calls that may stay among the deadlines; more are taken out once they are half of the list. A deadline may be
years away, and a call holds its request."""

_log = logging.getLogger("rosbridge_sim.graph")


@dataclass(slots=True)
class Holdings:
    """What one owner has on the bus; dicts for their order, the values mean nothing."""

    published: dict[Topic, None] = field(default_factory=dict)
    subscriptions: dict[Subscription, None] = field(default_factory=dict)
    services: dict[Service, None] = field(default_factory=dict)
    calls: dict[Call, None] = field(default_factory=dict)


class Bus:
    """Topics, services and parameters of one process.

    Attributes:
        store: the types.
        time_ns: simulation time where there is a world, else the time of day [ns]; bags and rates count in it.
        stamp_ns: the time for stamps that a message leaves open [ns]: `time_ns`, or the time of day if that is chosen.
        actions: the third way of talking.
        parameters: the parameter server.
        watchers: called with `(owner, now)` after an owner has left.
        on_topic: called with a topic after somebody has begun to publish or to listen there.
        on_holdings: called with an owner after it has begun or ceased to publish, to listen or to serve somewhere.
        is_strict: refuse types of packages that nobody knows, in place of relaying them unchecked.
        max_calls: calls that one caller may have in flight, and as many goals.
        total: what all owners together make this process hold.
        accounts: those of owners that have a limit, by owner.
        guard: sees to it that a failure of ours hurts as few as possible.
        unpublished: subscriptions to topics that nobody publishes.
        on_refusal: called with each mistake that a client is told of.
        on_message: called with each message before it is delivered; None for nothing. It may not raise.
        num_published, num_calls: counters since the start.
    """

    def __init__(
        self,
        store: Store,
        *,
        is_strict: bool = False,
        service_timeout: float | None = None,
        max_calls: int = MAX_CALLS,
    ) -> None:
        self.store = store
        self.time_ns = 0
        self.stamp_ns = 0
        self.actions = Actions(self, max_calls)
        self.parameters = Parameters()
        self.watchers: list[Callable[[Participant, float], None]] = []
        self.on_topic: list[Callable[[Topic], None]] = []
        self.on_holdings: list[Callable[[Participant], None]] = []
        self.is_strict = is_strict
        self.service_timeout = service_timeout
        self.max_calls = max_calls
        self.guard = Guard()
        self.unpublished = UnpublishedTopics()
        self.on_refusal: Callable[[RefusedRequest], None] = lambda _refusal: None
        self.on_message: Callable[[Topic, Message], None] | None = None
        self.total = Account()
        self.accounts: dict[Participant, Account] = {}
        self._own_account = Account(total=self.total)
        self.num_published = 0
        self.num_calls = 0
        self.topics: dict[str, Topic] = {}
        self.services: dict[str, Service] = {}
        self._holdings: dict[Participant, Holdings] = {}
        self._deadlines: list[tuple[float, int, Call]] = []
        self._num_stale = 0  # calls among the deadlines that have ended
        self._ticket = count()
        self._orphans: dict[Topic, None] = {}
        self._opaque_types: dict[str, OpaqueType] = {}
        self._tidy_types_at = 0
        self._unknown_types: dict[tuple[str, str], None] = {}  # of services and actions, once each is in the log

    # Topics

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
            is_exclusive: nobody else may publish here; clients that do lose their advertisements.
            is_on_demand: the owner publishes only while the topic has a listener.

        Raises:
            GraphError: type conflict, or the topic is somebody else's alone.
            TypeNameError: the type cannot be had.
        """
        topic, message_type = self._topic_for(owner, name, type_name)
        if not is_exclusive and topic.owner is not None and topic.owner is not owner:
            text = f"Topic {topic.name} is published by {topic.owner.name} alone; others may only subscribe"
            raise GraphError(text, reason=Reason.NAME_TAKEN)
        self._settle(owner, topic, message_type)
        if is_exclusive:
            topic.owner = owner
            self._displace_publishers(topic, f"{topic.name} is published by {owner.name} alone from now on")
        if is_on_demand:
            topic.on_demand[owner] = None
        topic.advertise(owner, key, depth)
        topic.orphaned_at = None
        self._orphans.pop(topic, None)
        self._held(owner).published[topic] = None
        self._tell_of(topic)
        self._tell_holdings(owner)
        return topic

    def unadvertise(self, owner: Participant, name: str, now: float, key: object = None) -> None:
        """Take one advertisement of `owner` back, or all of them where `key` is None; none there is no error."""
        topic = self.topics.get(resolve(name))
        if topic is None or owner not in topic.publishers:
            return
        topic.unadvertise(owner, key)
        if owner not in topic.publishers:
            self._drop_publisher(owner, topic, now)

    def publish(self, sender: Participant, topic: Topic, message: Message, now: float) -> None:
        """Hand a message to every listener of a topic that `sender` advertised.

        Raises:
            PeerError: what a listener found wrong with the message, or why it could not be encoded for it; all others
                have it all the same.
            Exception: a listener that cannot end alone has failed; the same.
        """
        self.num_published += 1
        if self.on_message is not None:
            self.on_message(topic, message)
        problem: PeerError | None = None
        failure: Exception | None = None
        if topic.depth and not topic.keep(sender, message, self.accounts.get(sender)):
            text = f"{topic.name}: this client makes the server hold too much; the message is not latched"
            problem = GraphError(text, reason=Reason.TOO_MUCH)
        for subscription in topic.subscriptions:
            try:
                subscription.deliver(topic, message, sender, now)
            except EncodingError as error:
                self.guard.note_encoding(topic.name, error)
                problem = problem or error
            except PeerError as error:
                problem = problem or error
            except Exception as error:  # noqa: BLE001 - a bug of ours in one listener's own state
                failure = self._end_alone(subscription.owner, error, failure)
        if failure is not None:
            raise failure
        if problem is not None:
            raise problem

    def _end_alone(self, owner: Participant, error: Exception, before: Exception | None) -> Exception | None:
        """End an owner for which something has failed; return the failure to raise, if any: one, the others are noted.

        Args:
            owner: the listener.
            error: its failure.
            before: that of another listener which cannot end alone.
        """
        try:
            self.guard.blame(owner, error)
        except Exception as raised:  # noqa: BLE001 - the same error
            if before is None:
                return raised
            self.guard.note("another listener of the same message", raised)
        return before

    def announce(self, sender: Participant, topic: Topic, message: Message, now: float) -> None:
        """Publish something of our own. What a listener finds wrong with it is for the log, and so is its failure.

        Never raises: nothing that is wrong with a listener is the world's failure.
        """
        try:
            self.publish(sender, topic, message, now)
        except EncodingError:
            pass  # noted already
        except PeerError as error:
            _log.warning("a listener of %s refused a message: %s", topic.name, error)
        except Exception as error:  # noqa: BLE001 - a listener that cannot end alone
            self.guard.note(f"a listener of {topic.name}", error)

    def show(
        self, sender: Participant, topic: Topic, message: Message, listeners: Iterable[Subscription], now: float
    ) -> None:
        """Hand something of our own to some listeners of a topic; otherwise as `announce`. It is not latched.

        Args:
            sender: who publishes there.
            topic: of which they are listeners.
            message: may have been published before.
            listeners: the subscriptions that get it.
            now: monotonic time [s].
        """
        for subscription in listeners:
            try:
                subscription.deliver(topic, message, sender, now)
            except EncodingError as error:
                self.guard.note_encoding(topic.name, error)
            except PeerError as error:
                _log.warning("a listener of %s refused a message: %s", topic.name, error)
            except Exception as error:  # noqa: BLE001 - a bug of ours in one listener's own state
                self.guard.contain(subscription.owner, error)

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
            notify: tells the owner something about the subscription; None for `owner.tell`.
            is_general: see `Subscription`.
            is_recording: the same.

        Raises:
            GraphError: type conflict, or no type given for a topic that nobody has advertised.
            TypeNameError: the type cannot be had.
        """
        topic, message_type = self._topic_for(owner, name, type_name)
        if type_name is not None and not isinstance(owner, Guest):
            self._settle(owner, topic, message_type)
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
        self._held(owner).subscriptions[subscription] = None
        self._tell_of(topic)
        self._tell_holdings(owner)
        return subscription

    def unsubscribe(self, subscription: Subscription, now: float) -> None:
        """Stop listening; twice is no error."""
        topic = subscription.topic
        topic.remove(subscription)
        self._held(subscription.owner).subscriptions.pop(subscription, None)
        self.unpublished.forget(subscription)
        self._orphan(topic, now)
        self._tell_holdings(subscription.owner)

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
            return self._message_type(type_name) if type_name is not None else topic.type  # type: ignore[union-attr] # one is there
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
        if self.store.canonical(type_name) != asked.name:
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
        if topic is None or self.store.canonical(type_name) == topic.type.name or not topic.is_settled:
            return None
        if owner is not None and not isinstance(owner, Guest) and not topic.is_bound:
            return None
        return _conflict(topic.name, type_name, topic.type.name)

    def find_topic(self, name: str) -> Topic | None:
        """The topic of that name, relative or absolute, if anybody has spoken of it."""
        return self.topics.get(resolve(name))

    # Services

    def provide(
        self, owner: Participant, name: str, type_name: str, handle: Handle, *, is_exclusive: bool = False
    ) -> Service:
        """Offer a service. The last to offer a name has it; whoever waits for the one before is told at once.

        Raises:
            GraphError: the service belongs to the simulator.
            TypeNameError: the type cannot be had.
        """
        name = resolve(name)
        service_type = self._service_type(type_name)
        old = self.services.get(name)
        if old is not None:
            if old.is_exclusive and old.owner is not owner and not gives_way(old.owner, owner):
                raise GraphError(f"Service {name} is provided by {old.owner.name} alone", reason=Reason.NAME_TAKEN)
            if old.owner is not owner:
                owner.notify("warning", f"Duplicate service advertised. Overwriting {name}.")
                self.guard.attempt("the loss of a service", take_over, old.owner, "service", name, owner)
            self._drop_service(old, f"Service {name} was unadvertised")
        service = Service(name, service_type, owner, handle, is_exclusive)
        self.services[name] = service
        self._held(owner).services[service] = None
        self._tell_holdings(owner)
        return service

    def withdraw(self, owner: Participant, name: str, *, answers_calls: bool = False) -> None:
        """Stop offering a service.

        Args:
            owner: who offers it.
            name: of the service.
            answers_calls: the owner still answers the calls that are in flight; else they are refused now.

        Raises:
            GraphError: `owner` does not offer it.
        """
        service = self.services.get(resolve(name))
        if service is None or service.owner is not owner:
            text = f"Service {name} has not been advertised via rosbridge, can't unadvertise."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        self._drop_service(service, None if answers_calls else f"Service {service.name} was unadvertised")

    def call(
        self,
        caller: Participant,
        name: str,
        args: OpBody,
        on_answer: OnAnswer,
        *,
        now: float,
        timeout: float | None = None,
    ) -> None:
        """Call a service. `on_answer` is called exactly once, perhaps before this returns, unless the caller leaves.

        Args:
            caller: whose call it is; it ends when the caller leaves.
            name: of the service; may be relative.
            args: by name (an object), by position (a list), or none.
            on_answer: gets the answer. Whatever goes wrong is an answer too.
            now: monotonic time [s].
            timeout: give up after so long [s]; None takes the bus's default, 0 or less waits for ever.
        """
        self.num_calls += 1
        try:
            service = self.services.get(resolve(name))
            if service is None:
                raise GraphError(f"Service {name} does not exist", reason=Reason.NO_SUCH_SERVICE)
            request = decode_body(service.type.request, args, self.stamp_ns)
            held = self._held(caller).calls
            if len(held) >= self.max_calls:
                raise GraphError(f"Too many calls in flight: at most {self.max_calls}", reason=Reason.TOO_MUCH)
            # The simulator's own services answer at once, or hold their caller.
            size = 0 if service.is_exclusive else size_of_body(request, args)
            if size and not self.account_of(caller).take(size):
                text = "Too much in flight: this client makes the server hold too much"
                raise GraphError(text, reason=Reason.TOO_MUCH)
        except PeerError as error:
            on_answer(Answer(is_ok=False, values=str(error), reason=error.reason))
            return
        call = Call(service, caller, request, on_answer, self, num_bytes=size)
        service.calls[call] = None
        held[call] = None
        if timeout is None:
            timeout = self.service_timeout
        try:
            service.handle(call, now)
        except PeerError as error:
            if isinstance(error, EncodingError):
                self.guard.note_encoding(service.name, error)
            call.refuse(str(error), error.reason)
        except Exception as error:  # noqa: BLE001 - a bug of ours in the provider's own state
            call.refuse("The provider failed; the server's log says why")
            self.guard.blame(service.owner, error)
        if timeout is not None and timeout > 0 and not call.is_done:
            call.deadline = now + timeout
            heapq.heappush(self._deadlines, (call.deadline, next(self._ticket), call))

    def forget_call(self, call: Call) -> None:
        """Strike a finished call from its caller's list (for `Call` alone)."""
        if call.num_bytes:
            self.account_of(call.caller).give(call.num_bytes)
        held = self._holdings.get(call.caller)
        if held is not None:
            held.calls.pop(call, None)
        if call.deadline is not None:
            self._num_stale += 1
            if self._num_stale > MAX_STALE and 2 * self._num_stale > len(self._deadlines):
                self._deadlines = [each for each in self._deadlines if not each[2].is_done]
                heapq.heapify(self._deadlines)
                self._num_stale = 0

    def hand_over(self, call: Call, answer: Answer) -> None:
        """Give a call's caller the answer (for `Call` alone). One that cannot be encoded is a refusal."""
        try:
            call.on_answer(answer)
        except Exception as error:  # noqa: BLE001 - a bug of ours
            if isinstance(error, EncodingError) and answer.is_ok:
                name, owner = call.service.name, call.service.owner
                self.guard.note_encoding(name, error)
                self.guard.attempt("a remark to a provider", owner.notify, "error", f"{name}: {error}")
                self.hand_over(call, Answer(is_ok=False, values=str(error)))
            else:  # in the caller's own state
                self.guard.contain(call.caller, error)

    # Memory

    def account_of(self, owner: Participant) -> Account:
        """The account that pays for what an owner makes this process hold."""
        return self.accounts.get(owner, self._own_account)

    def forget_latched(self, owner: Participant) -> None:
        """Keep nothing that an owner has published for those who come late."""
        for topic in list(self.topics.values()):
            topic.forget_messages_of(owner)

    def forget_orphans(self) -> None:
        """Keep nothing of publishers that are gone."""
        for topic in list(self._orphans):
            topic.forget_messages()

    # Time and departure

    def next_deadline(self) -> float | None:
        """When `expire` has something to do next [s]; None if never."""
        while self._deadlines and self._deadlines[0][2].is_done:
            self._pop_deadline()
        first = self._deadlines[0][0] if self._deadlines else None
        unpublished = self.unpublished.next_due()
        if first is None or (unpublished is not None and unpublished < first):
            first = unpublished
        for topic in self._orphans:  # in order of orphaning, so the first is the earliest
            if topic.orphaned_at is not None:
                due = topic.orphaned_at + TYPE_MEMORY
                return due if first is None else min(due, first)
        return first

    def expire(self, now: float) -> None:
        """Give up the calls whose time is over and forget the topics that nobody has held for a while.

        A listener that has waited for a while for a topic without a publisher is told.
        """
        while self._deadlines and (self._deadlines[0][0] <= now or self._deadlines[0][2].is_done):
            refuse = self._pop_deadline().refuse
            self.guard.attempt("a time-out", refuse, "Timeout exceeded while waiting for service response")
        for topic in list(takewhile(lambda topic: _is_over(topic, now), self._orphans)):
            self.guard.attempt("forgetting a topic", self._forget, topic)
        for topic, notify in self.unpublished.take_due(now):
            self.guard.attempt("a word about a topic that nobody publishes", notify, topic)

    def leave(self, owner: Participant, now: float) -> None:
        """Take away all that `owner` holds, answer those who wait for it, tell the watchers. Twice is no error."""
        attempt = self.guard.attempt
        attempt("the end of an owner's goals", self.actions.leave, owner)
        held = self._holdings.get(owner)
        if held is not None:
            for call in list(held.calls):
                attempt("the end of a call", call.abandon)
            for subscription in list(held.subscriptions):
                attempt("the end of a subscription", self.unsubscribe, subscription, now)
            for topic in list(held.published):
                attempt("the end of an advertisement", topic.unadvertise, owner, None)
                attempt("the end of a publisher", self._drop_publisher, owner, topic, now)
            for service in list(held.services):
                why = f"Service {service.name} was unadvertised: its provider disconnected"
                attempt("the end of a service", self._drop_service, service, why)
            self._holdings.pop(owner, None)
        self.accounts.pop(owner, None)
        for watch in tuple(self.watchers):
            attempt("what follows an owner's end", watch, owner, now)

    def owners(self) -> list[Participant]:
        """Everybody who holds anything, in order of arrival."""
        return list(self._holdings)

    def holdings(self, owner: Participant) -> Holdings:
        """What an owner has here, to be read and not changed."""
        return self._holdings.get(owner) or Holdings()

    # How it is kept

    def _pop_deadline(self) -> Call:
        """Take the earliest deadline out, and the call off those that are watched."""
        call = heapq.heappop(self._deadlines)[2]
        self._num_stale -= call.is_done
        call.deadline = None
        return call

    def _held(self, owner: Participant) -> Holdings:
        held = self._holdings.get(owner)
        if held is None:
            held = self._holdings[owner] = Holdings()
        return held

    def _topic_for(
        self, owner: Participant, name: str, type_name: str | None
    ) -> tuple[Topic, MessageType | OpaqueType]:
        """The topic, made if need be, and the type that `owner` may use there; what is there is not changed."""
        absolute = resolve(name)
        topic = self.topics.get(absolute)
        if topic is None:
            if type_name is None:
                raise self._no_topic(name)
            topic = self.topics[absolute] = Topic(absolute, self._message_type(type_name))
        elif type_name is None:
            return topic, topic.type
        elif (why := self.type_conflict(absolute, type_name, owner)) is not None:
            raise GraphError(why, reason=Reason.TYPE_CONFLICT)
        return topic, self._type_at(topic, type_name)

    def _type_at(self, topic: Topic, type_name: str) -> MessageType | OpaqueType:
        """The type of that name: the topic's own, where it is that one."""
        return topic.type if self.store.canonical(type_name) == topic.type.name else self._message_type(type_name)

    def _settle(self, owner: Participant, topic: Topic, message_type: MessageType | OpaqueType) -> None:
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
                self.guard.attempt(
                    "the loss of a topic", owner.lose, "topic", topic.name, f"{why}: this client's advertisement ends"
                )
                topic.unadvertise(owner, None)
                topic.on_demand.pop(owner, None)
                topic.forget_messages_of(owner)
                self._held(owner).published.pop(topic, None)
                self._tell_holdings(owner)

    @staticmethod
    def _no_topic(name: str) -> GraphError:
        """The error of a topic that is not there, and whose type was not said."""
        text = f"Cannot infer topic type for topic {name} as it is not yet advertised"
        return GraphError(text, reason=Reason.UNKNOWN_TOPIC)

    def _message_type(self, name: str) -> MessageType | OpaqueType:
        """The type of that name; one that is only relayed where its whole package is unknown."""
        try:
            return self.store.message(name)
        except UnknownPackageError:
            if self.is_strict:
                raise
        canonical = self.store.canonical(name)
        opaque = self._opaque_types.get(canonical)
        if opaque is None:
            resolve(canonical)  # as long as a name may be
            if len(self._opaque_types) >= self._tidy_types_at:
                self._opaque_types = {t.type.name: t.type for t in self.topics.values() if type(t.type) is OpaqueType}
                # not again before half as many have come: a look at all topics then costs each type a constant amount
                self._tidy_types_at = max(MAX_REMEMBERED_TOPICS, len(self._opaque_types) * 3 // 2 + 1)
            opaque = self._opaque_types[canonical] = OpaqueType(canonical)
            near = self.store.near_package(canonical)
            _log.warning("%s: its package is unknown%s; messages of this type are relayed unchecked", canonical, near)
        return opaque

    def _service_type(self, name: str) -> ServiceType | OpaqueServiceType:
        """The type of that name; one that is only relayed where its whole package is unknown."""
        try:
            return self.store.service(name)
        except UnknownPackageError:
            if self.is_strict:
                raise
        return OpaqueServiceType(self._note_unknown(name, "calls of this service"))

    def action_type(self, name: str) -> ActionType | OpaqueActionType:
        """The type of that name; one that is only relayed where its whole package is unknown (for `Actions` alone).

        Raises:
            GraphError: the name is too long.
            TypeNameError: the type cannot be had.
        """
        try:
            return self.store.action(name)
        except UnknownPackageError:
            if self.is_strict:
                raise
        return OpaqueActionType(self._note_unknown(name, "goals of this action"))

    def _note_unknown(self, name: str, what: str) -> str:
        """Log once that a type of an unknown package is relayed; return its one spelling."""
        canonical = self.store.canonical(name)
        resolve(canonical)  # as long as a name may be
        if (canonical, what) not in self._unknown_types:
            if len(self._unknown_types) >= MAX_REMEMBERED_TOPICS:
                self._unknown_types.clear()
            self._unknown_types[canonical, what] = None
            near = self.store.near_package(canonical)
            _log.warning("%s: its package is unknown%s; %s are relayed unchecked", canonical, near, what)
        return canonical

    def _tell_of(self, topic: Topic) -> None:
        for notify in tuple(self.on_topic):
            self.guard.attempt(f"a look at {topic.name}", notify, topic)

    def _tell_holdings(self, owner: Participant) -> None:
        for notify in tuple(self.on_holdings):
            self.guard.attempt(f"a look at what {owner.name} holds", notify, owner)

    def _drop_publisher(self, owner: Participant, topic: Topic, now: float) -> None:
        """Tidy up after an owner that publishes there no longer."""
        topic.on_demand.pop(owner, None)
        if topic.publishers:
            topic.forget_messages_of(owner)
        if topic.owner is owner:
            topic.owner = None
        self._held(owner).published.pop(topic, None)
        self._orphan(topic, now)
        self._tell_holdings(owner)

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
            if self.topics.get(topic.name) is topic:
                del self.topics[topic.name]
        elif not topic.is_bound:
            topic.unsettle()

    def _drop_service(self, service: Service, why: str | None) -> None:
        """Strike a service off, and refuse the calls that wait for it, unless `why` is None."""
        if self.services.get(service.name) is service:
            del self.services[service.name]
        self._held(service.owner).services.pop(service, None)
        if why is not None:
            for call in list(service.calls):
                call.refuse(why)
        self._tell_holdings(service.owner)


def _conflict(topic: str, type_name: str, established: str) -> str:
    """Say that a topic has another type, in rosbridge_suite's words."""
    wanted = f"Tried to register topic {topic} with type {type_name}"
    return f"{wanted} but it is already established with type {established}"


def _is_over(topic: Topic, now: float) -> bool:
    """Whether the type of a topic without publishers has been remembered for long enough."""
    return topic.orphaned_at is not None and topic.orphaned_at + TYPE_MEMORY <= now

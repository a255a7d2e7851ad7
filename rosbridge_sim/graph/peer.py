"""What one client's ops mean on the bus, in that client's name.

A `Peer` joins a session (one wire) to the bus (all who talk). It keeps what the wire knows and the bus does
not: the client's own spelling of each topic, its several subscriptions to one topic, the ids under which calls
went out to it as a provider. A mistake gives one remark to this client, or a refusal to its call, and leaves
everything as it was.

Where rosbridge_suite and the protocol's text differ, we take: one message for each spelling of a topic,
whatever the number of subscription ids; latched messages once for each new id; a lost provider fails its calls at
once. rosbridge_suite ignores the `result` of a provider's answer, and many providers send it wrong or not at all. So
an object with a field of the response is an answer whatever `result` says, with a warning to the provider; anything
else without `result: true` is a failure (rosbridge_suite turns that into success, too, or never answers).

An op may take longer than its turn: a scenario is read from a disk. Then the client is *held*: whoever reads its
frames asks `is_held` after each op, stops there, and goes on when `on_released` is called. So a client's ops take
effect in the order in which they were sent, and nobody else waits.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn, Protocol, TypeVar

import msgspec
import orjson

from rosbridge_sim.errors import EncodingError, FrameError, GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import Goal, GoalOutcome, GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Notify, OfferKind, Participant, decode_body, resolve
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.graph.refusals import refusal_of
from rosbridge_sim.graph.topics_services import Answer, Call, Subscription, Topic
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.codec import is_absent
from rosbridge_sim.protocol.session import LEVELS, Feed, Session
from rosbridge_sim.protocol.subscription import read_options, read_qos
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.suggestions import hint, listing

__all__ = ["WEBSOCKET_NODE_NAME", "FrameWork", "Peer", "Work"]

WEBSOCKET_NODE_NAME = "/rosbridge_websocket"
"""All clients are one ROS node, as behind rosbridge_suite; Lichtblick looks for it."""

_IMPLICIT = object()
"""The key of the advertisement that a bare publish without an id makes; no client can spell it."""

MAX_OP_ID = 1_024
"""Longest id of what is held [characters]; any other id is only echoed."""

_EMPTY = re.compile(rb"\{\s*+\}")
"""JSON text of an object without fields."""

MAX_WATCHED_TOPICS = 100
"""Topics of one client at most that it is told of when nobody publishes them: as many lines in the log."""

MAX_ALIKE = 3
"""Topics of the same type that such a word names."""

_TIDY = 1_000
"""Ended calls or goals that a provider's list may hold before it is tidied: late answers to them are no mistake."""

_log = logging.getLogger("rosbridge_sim.graph")


@dataclass(slots=True)
class _Listening:
    """One spelling of a topic that a client listens to: its feed on the wire, its one subscription on the bus."""

    feed: Feed
    subscription: Subscription


@dataclass(slots=True)
class _Provision:
    """One service that a client provides, and the calls that wait for its answer."""

    name: str
    spelling: str
    num_calls: int = 0
    calls: dict[str, Call] = field(default_factory=dict)
    tidy_at: int = 0

    def tidy(self) -> None:
        """Forget calls that timed out or were abandoned: when they are many, so that each call costs little."""
        if len(self.calls) >= self.tidy_at:
            self.calls = {call_id: call for call_id, call in self.calls.items() if not call.is_done}
            self.tidy_at = max(_TIDY, 2 * len(self.calls))


@dataclass(slots=True)
class _Performance:
    """One action that a client provides, and the goals that it works on."""

    spelling: str
    type_name: str
    num_goals: int = 0
    goals: dict[str, Goal] = field(default_factory=dict)
    ids: dict[Goal, str] = field(default_factory=dict)
    tidy_at: int = 0

    def tidy(self) -> None:
        """Forget goals that have ended, as `_Provision.tidy` does calls."""
        if len(self.goals) >= self.tidy_at:
            self.goals = {goal_id: goal for goal_id, goal in self.goals.items() if not goal.is_done}
            self.ids = {goal: goal_id for goal_id, goal in self.goals.items()}
            self.tidy_at = max(_TIDY, 2 * len(self.goals))


_Offer = TypeVar("_Offer", _Provision, _Performance)
_Work = TypeVar("_Work", Call, Goal)


class Work(Protocol):
    """What a frame asks for, in steps."""

    def step(self, now: float) -> bool:
        """Do the next op, or the next slice of finding it; return whether there was anything left to do."""


class FrameWork:
    """The ops of one frame, read and done one by one."""

    __slots__ = ("_do", "_ops")

    def __init__(self, ops_of_frame: Iterator[ops.Op | None], do: Callable[[ops.Op, float], None]) -> None:
        self._ops = ops_of_frame
        self._do = do

    def step(self, now: float) -> bool:
        """See `Work`."""
        for op in self._ops:
            if op is not None:
                self._do(op, now)
            return True
        return False


class Peer:
    """One client on the bus.

    Attributes:
        session: its wire.
        address: where it comes from, for people to read.
        num_errors: mistakes it was told of.
        on_failure: called when something that is done for this client has failed by a bug of ours; raises it by itself.
        num_holds: reasons for its next op to wait; see `hold`.
        on_released: called when the last hold has ended; not after `leave`.
    """

    name = WEBSOCKET_NODE_NAME

    def __init__(self, bus: Bus, session: Session, address: str = "", policy: Policy = OPEN) -> None:
        """A client that holds nothing yet.

        Args:
            bus: where it meets the others.
            session: its wire.
            address: where it comes from.
            policy: what it may do.
        """
        self.session = session
        session.on_lost_answer = self._lose_answer
        session.on_mistake = lambda error: self.note(error.reason, str(error))
        session.on_unsent = bus.guard.note_encoding
        self.on_failure: Callable[[Exception], None] = _raise
        self.address = address
        self.num_errors = 0
        self.on_released: Callable[[], None] = _nothing
        self.num_holds = 0
        self._op_id: ops.Id = None  # of the op in hand
        self._op: ops.Op | None = None  # the op in hand itself, for what is noted of it
        self._bus = bus
        self._policy = policy
        self._num_ids = 0
        self._actions = bus.actions
        self._publications: dict[str, Topic] = {}
        self._listenings: dict[str, _Listening] = {}
        self._provisions: dict[str, _Provision] = {}
        self._performances: dict[str, _Performance] = {}
        self._goals: dict[tuple[str, ops.Id], Goal] = {}
        if not policy.is_open:
            policy.ways.on_change[self._judge_again] = None
        self._act: dict[type, Callable[[Any, float], None]] = {
            ops.Publish: self._publish,
            ops.CallService: self._call,
            ops.ServiceResponse: self._respond,
            ops.Subscribe: self._subscribe,
            ops.Unsubscribe: self._unsubscribe,
            ops.Advertise: self._advertise,
            ops.Unadvertise: self._unadvertise,
            ops.AdvertiseService: self._advertise_service,
            ops.UnadvertiseService: self._unadvertise_service,
            ops.AdvertiseAction: self._advertise_action,
            ops.UnadvertiseAction: self._unadvertise_action,
            ops.SendActionGoal: self._send_goal,
            ops.CancelActionGoal: self._cancel_goal,
            ops.ActionFeedback: self._report_goal,
            ops.ActionResult: self._end_goal,
            ops.SetLevel: self._set_level,
            ops.Status: self._status,
            ops.Auth: self._auth,
        }

    def receive(self, frame: bytes, now: float) -> None:
        """Do all that a frame asks, to its end, however long that takes."""
        work = self.begin(frame, now)
        while work is not None and work.step(now):
            pass

    def begin(self, frame: bytes, now: float) -> Work | None:
        """Do what an ordinary frame asks: its one op is done, and nothing is left.

        Args:
            frame: what came.
            now: monotonic time [s].

        Returns:
            None where all is done. Else the work that a long or glued frame makes, none of it done yet: `step` it to
            its end before the next frame. An op is done to its end; between two of them others may have their turn.
        """
        op = self.session.receive_plain(frame)
        if op is None:
            return FrameWork(self.session.receive(frame, now), self.do)
        self.do(op, now)
        return None

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the owner of the socket closes it."""
        self.on_failure(error)

    def flush(self, now: float) -> None:
        """Send the messages whose turn has come; the session's alarm says when."""
        self.session.flush(now, self._bus.stamp_ns)

    def do(self, op: ops.Op, now: float) -> None:
        """Do one op; a mistake in it is told to the client."""
        self._op_id = op.id
        self._op = op
        try:
            self._act[type(op)](op, now)
        except PeerError as error:
            self.num_errors += 1
            text = f"{error}{self._suggest(error.reason, op)}"
            self.session.remark("error", text, op.id)
            self.note(error.reason, text, op)
        self._op = None

    def note(self, reason: Reason, text: object, op: ops.Op | None = None) -> None:
        """Tell the log and `/sim/refusals` of a mistake of this client's.

        Args:
            reason: the kind of mistake.
            text: what the client was told.
            op: what it is about, where that is known.
        """
        refusal = refusal_of(self.address, reason, text, op)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)

    def _suggest(self, reason: Reason, op: ops.Op) -> str:
        """Return the nearest name that this client may use, for the end of an error; perhaps nothing."""
        names: Iterable[str]
        may_know: Callable[[str], bool]
        if reason is Reason.UNKNOWN_TOPIC and isinstance(op, (ops.Publish, ops.Subscribe)):
            name, names, may_know = op.topic, self._bus.topics, self._may_see
        elif reason is Reason.NO_SUCH_SERVICE and isinstance(op, ops.CallService):
            name, names, may_know = _split_id(op)[0], self._bus.services, self._policy.may_call
        elif reason is Reason.NO_SUCH_ACTION and isinstance(op, ops.SendActionGoal):
            name, names, may_know = op.action, self._actions.by_name, self._policy.may_send_goal
        else:
            return ""
        return hint(resolve(name), names if self._policy == OPEN else filter(may_know, names))

    def _may_see(self, name: str) -> bool:
        """Tell whether a topic that is there is any of this client's business."""
        return self._policy.may_see(name, self._bus.topics[name].type.name)

    def refuse(self, op: ops.Op, why: str, reason: Reason = Reason.REFUSED) -> bool:
        """Answer an op that is not to be done, if it waits for an answer; else False, and it gets no answer."""
        self.num_errors += 1
        self.note(reason, why, op)
        if isinstance(op, ops.CallService):
            self.session.answer(op.service, _split_id(op)[1], why, is_ok=False)
        elif isinstance(op, ops.SendActionGoal):
            status = GoalStatus.UNKNOWN
            self.session.say("action_result", {}, action=op.action, id=op.id, status=status, result=False, values=why)
        else:
            return False
        return True

    def notify(self, level: str, text: str) -> None:
        """Remark something that answers no request."""
        self._remark(level, text)
        self._note_told(level, text, self._op)

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """See `Explaining`."""
        self._remark(level, text)
        self.note(reason, text, self._op)

    def _note_told(self, level: str, text: str, op: ops.Op | None) -> None:
        """Note what was told without a reason; an `info` is no mistake."""
        if level == "error":
            self.note(Reason.REFUSED, text, op)
        elif level != "info":
            self.note(Reason.NOT_NOW, text, op)

    def _remark(self, level: str, text: str, op_id: ops.Id = None) -> None:
        """Remark something on behalf of others, who must not hear of a failure of this client's."""
        try:
            self.session.remark(level, text, op_id)
        except Exception as error:  # noqa: BLE001 - a bug of ours in this client's own state
            self._bus.guard.blame(self, error)

    def notifier(self) -> Notify:
        """See `Correlating`."""
        op_id, op = self._op_id, self._op

        def notify(level: str, text: str) -> None:
            self.num_errors += level == "error"
            self._remark(level, text, op_id)
            self._note_told(level, text, op)

        return notify

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Guest`."""
        if kind == "topic":
            self._num_ids -= self._num_keys(name)
            for spelling in (name, name[1:]):
                self._publications.pop(spelling, None)
        elif kind == "service":
            self._provisions.pop(name, None)
        else:
            self._performances.pop(name, None)
        self._remark("error", why)

    def _judge_again(self, now: float) -> None:
        """End what the policy no longer admits: names have got another meaning, by which they are another thing."""
        policy = self._policy
        for spelling, topic in list(self._publications.items()):
            try:
                policy.check_publish(spelling, topic.type.name)
            except GraphError as error:
                self._unadvertise(ops.Unadvertise(topic=spelling), now)
                self._remark("error", f"{error}: this client's advertisement has ended")
        for spelling, listening in list(self._listenings.items()):
            try:
                policy.check_subscribe(spelling, listening.subscription.topic.type.name)
            except GraphError as error:
                self._unsubscribe(ops.Unsubscribe(topic=spelling), now)
                self._remark("error", f"{error}: this client's subscription has ended")

    @property
    def is_held(self) -> bool:
        """Whether the next op has to wait until `on_released` is called."""
        return self.num_holds > 0

    def hold(self) -> Callable[[], None]:
        """See `Holdable`."""
        self.num_holds += 1
        is_holding = True

        def release() -> None:
            nonlocal is_holding
            if is_holding:
                is_holding = False
                self.num_holds -= 1
                if not self.num_holds:
                    try:
                        self.on_released()
                    except Exception as error:  # noqa: BLE001 - a bug of ours in this client's own state
                        self._bus.guard.blame(self, error)

        return release

    def leave(self, now: float) -> None:
        """Take everything of this client's off the bus; twice is no error."""
        self.on_released = _nothing
        self._policy.ways.on_change.pop(self._judge_again, None)
        try:
            self._forget_all()
        finally:  # whatever is wrong with it: what stays on the bus would fail again with each message
            self._bus.leave(self, now)

    def _forget_all(self) -> None:
        self._publications.clear()
        for listening in self._listenings.values():
            self.session.drop_feed(listening.feed)
        self._listenings.clear()
        self._provisions.clear()
        self._performances.clear()
        self._goals.clear()
        self._num_ids = 0
        self.session.leave()

    # Topics

    def _advertise(self, op: ops.Advertise, _now: float) -> None:
        self._policy.check_publish(op.topic, op.type)
        self._publications[op.topic] = self._claim(op, op.type, op.id)

    def _claim(self, op: ops.Advertise | ops.Publish, type_name: str, key: object) -> Topic:
        """The topic, with this client as a publisher of it."""
        self._check_room(op.id)
        qos = read_qos(op.qos)
        depth = qos.depth if op.latch or qos.is_latching else 0
        num_keys = self._num_keys(op.topic)
        topic = self._bus.advertise(self, op.topic, type_name, depth=depth, key=key)
        self._num_ids += self._num_keys(op.topic) - num_keys
        return topic

    def _num_keys(self, name: str) -> int:
        """How often this client has advertised a topic."""
        topic = self._bus.find_topic(name)
        return len(topic.publishers.get(self, ())) if topic is not None else 0

    def _unadvertise(self, op: ops.Unadvertise, now: float) -> None:
        num_keys = self._num_keys(op.topic)
        self._bus.unadvertise(self, op.topic, now, key=op.id)
        self._num_ids += self._num_keys(op.topic) - num_keys
        name = resolve(op.topic)
        for spelling in (name, name[1:]):
            topic = self._publications.get(spelling)
            if topic is not None and self not in topic.publishers:
                del self._publications[spelling]

    def _publish(self, op: ops.Publish, now: float) -> None:
        bus = self._bus
        topic = self._publications.get(op.topic)
        message_type = self._type_to_publish(op) if topic is None else topic.type
        value = decode_body(message_type, op.msg, bus.stamp_ns)
        if topic is None:  # after the message was found right: a wrong one leaves nothing behind
            # The id of this publish alone: roslib gives each one another, and all of them would be kept.
            key = _IMPLICIT if op.id is None else op.id
            topic = self._publications[op.topic] = self._claim(op, message_type.name, key)
        bus.publish(self, topic, Message(message_type, value, self.session.frame_length), now)

    def _type_to_publish(self, op: ops.Publish) -> MessageType | OpaqueType:
        """A publish without an advertise is one, where the type is known or given."""
        self._policy.check_publish(op.topic, op.type or self._type_name(op.topic) or "")
        return self._bus.type_to_publish(op.topic, op.type or None)

    def _type_name(self, name: str) -> str | None:
        """The type of a topic, if it is there."""
        topic = self._bus.find_topic(name)
        return topic.type.name if topic is not None else None

    def _subscribe(self, op: ops.Subscribe, now: float) -> None:
        type_name = op.type
        if type_name is None and self._policy.needs_type(op.topic):
            type_name = self._type_name(op.topic)
        self._policy.check_subscribe(op.topic, type_name or "")
        qos = read_qos(op.qos)
        bus = self._bus
        listening = self._listenings.get(op.topic)
        is_new = listening is None or op.id not in listening.feed.ids
        was_mute = False
        if is_new:
            self._check_room(op.id)
        if listening is None:
            feed = Feed(self.session, op.topic)

            def deliver(_topic: Topic, message: Message, _sender: Participant, now: float) -> None:
                feed.deliver(message, now, bus.stamp_ns)

            subscription = bus.subscribe(self, op.topic, deliver, type_name=type_name, notify=self.notifier())
            listening = self._listenings[op.topic] = _Listening(feed, subscription)
            if len(self._listenings) <= MAX_WATCHED_TOPICS:
                bus.unpublished.watch(subscription, self._tell_unpublished, now)
        elif op.type is not None:
            was_mute = bus.retype(listening.subscription, op.type)
        feed = listening.feed
        feed.set_terms(op.id, read_options(op))
        self._num_ids += is_new
        if (is_new or was_mute) and qos.is_latching is not False:
            for message in listening.subscription.topic.latched:
                try:
                    feed.send(message, bus.stamp_ns)
                except EncodingError as error:
                    bus.guard.note_encoding(op.topic, error)

    def _tell_unpublished(self, topic: Topic) -> None:
        """Tell that a topic has no publisher yet. That is no mistake; it may be a wrong name."""
        published = [each for each in self._bus.topics.values() if each.publishers and self._may_see(each.name)]
        near = hint(topic.name, [each.name for each in published])
        alike = [each.name for each in published if each.type is topic.type][:MAX_ALIKE]
        of_type = f"; of this type there is {listing(alike)}" if alike else ""
        text = f"{topic.name} ({topic.type.name}) is subscribed to, and nobody publishes it"
        text += f"{self._bus.unpublished.advise(topic)}{near}{of_type}"
        _log.info("%s: %s", self.address, text, extra={"client": self.address})
        self._remark("info", text)

    def _unsubscribe(self, op: ops.Unsubscribe, now: float) -> None:
        listening = self._listenings.get(op.topic)
        if listening is None:
            return
        ids = listening.feed.ids
        if op.id is None or (op.id in ids and len(ids) == 1):
            del self._listenings[op.topic]
            self._num_ids -= len(ids)
            self.session.drop_feed(listening.feed)
            self._bus.unsubscribe(listening.subscription, now)
        elif op.id in ids:
            self._num_ids -= 1
            listening.feed.set_terms(op.id, None)

    # Services

    def _call(self, op: ops.CallService, now: float) -> None:
        service, op_id = _split_id(op)
        try:
            self._policy.check_call(service)
        except GraphError as error:
            self.refuse(op, str(error), error.reason)
            return

        def on_answer(answer: Answer) -> None:
            values = answer.values
            if answer.reason is not None:
                values = f"{values}{self._suggest(answer.reason, op)}"
                self.note(answer.reason, values, op)
            self.session.answer(op.service, op_id, values, is_ok=answer.is_ok, fragment_size=op.fragment_size)

        self._bus.call(self, service, op.args, on_answer, now=now, timeout=op.timeout)

    def _advertise_service(self, op: ops.AdvertiseService, _now: float) -> None:
        self._policy.check_offer(op.service)
        self._check_room()
        provision = _Provision("", op.service)

        def handle(call: Call, _now: float) -> None:
            limit = self._bus.max_calls
            provision.tidy()
            if len(call.service.calls) > limit:  # this one is among them
                text = f"Service {provision.name} has {limit} calls waiting already"
                raise GraphError(text, reason=Reason.TOO_MUCH)
            provision.num_calls += 1
            call_id = f"service_request:{provision.spelling}:{provision.num_calls}"
            provision.calls[call_id] = call
            args = Message(call.service.type.request, call.request)
            self.session.say("call_service", {"args": args}, service=provision.spelling, id=call_id)

        service = self._bus.provide(self, op.service, op.type, handle)
        provision.name = service.name
        self._provisions[service.name] = provision

    def _unadvertise_service(self, op: ops.UnadvertiseService, _now: float) -> None:
        self._bus.withdraw(self, op.service)
        self._provisions.pop(resolve(op.service), None)

    def _respond(self, op: ops.ServiceResponse, _now: float) -> None:
        provision = self._provisions.get(resolve(op.service))
        if provision is None:
            text = f"Service {op.service} has not been advertised via rosbridge."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        call = provision.calls.pop(op.id, None) if isinstance(op.id, str) else None
        if call is None:
            text = f"Nobody waits for an answer of {op.service} with this id"
            self.session.remark("warning", text, op.id)
            self.note(Reason.STRAY_ANSWER, text, op)
            return
        if call.is_done:  # timed out, or the caller has left
            return
        if not op.result and (op.reason is not None or not _is_filled_object(op.values)):
            call.refuse(_read_refusal(op.values, provision.name) if op.reason is None else op.reason)
            if op.result is None and op.reason is None and not _says_anything(op.values):
                # what roslib sends for a provider whose function forgets to return true
                text = f"{provision.name}: the answer has neither a result nor values, so its call has failed."
                text += ' Send "result": true (with roslib, return true)'
                self.session.remark("warning", text, op.id)
                self.note(Reason.BAD_OP, text, op)
            return
        try:
            values = decode_body(call.service.type.response, op.values, self._bus.stamp_ns)
        except PeerError as error:
            if op.result is False:  # an object of the provider's own that says why not
                call.refuse(_read_refusal(op.values, provision.name))
                return
            call.refuse(str(error))
            raise
        call.answer(values)
        if not op.result:
            said = "no result" if op.result is None else "result false"
            text = f'{provision.name}: the answer has {said}; its values were passed on. Send "result": true'
            self.session.remark("warning", text, op.id)

    def _lose_answer(self, error: FrameError) -> None:
        """Fail the call or the goal whose answer cannot be read: its caller would wait for ever.

        Where the frame has no id of ours left in it, it is clear whose answer it is only if one alone is awaited.
        """
        why = f"The provider's answer cannot be read: {error}"
        if error.op == "service_response":
            call = self._find_awaited(self._provisions, error.op_id, lambda provision: provision.calls)
            if call is not None:
                call.refuse(why)
        else:
            goal = self._find_awaited(self._performances, error.op_id, lambda performance: performance.goals)
            if goal is not None:
                goal.fail(why)

    # Actions

    def _advertise_action(self, op: ops.AdvertiseAction, _now: float) -> None:
        self._policy.check_offer(op.action)
        self._check_room()
        performance = _Performance(op.action, op.type)

        def take(goal: Goal) -> None:
            performance.tidy()
            if len(goal.action.goals) > self._actions.max_goals:  # this one is among them
                text = f"Action {op.action} has {self._actions.max_goals} goals under way already"
                raise GraphError(text, reason=Reason.TOO_MUCH)
            performance.num_goals += 1
            goal_id = f"action_goal:{op.action}:{performance.num_goals}"
            performance.goals[goal_id] = goal
            performance.ids[goal] = goal_id
            args = Message(goal.action.type.goal, goal.request)
            self.session.say(
                "send_action_goal",
                {"args": args},
                id=goal_id,
                action=op.action,
                action_type=op.type,
                feedback=True,
            )

        def cancel(goal: Goal) -> None:
            goal_id = performance.ids.get(goal)
            if goal_id is not None:
                self.session.say("cancel_action_goal", {}, id=goal_id, action=op.action)

        action = self._actions.provide(self, op.action, op.type, take, cancel)
        self._performances[action.name] = performance

    def _unadvertise_action(self, op: ops.UnadvertiseAction, _now: float) -> None:
        self._actions.withdraw(self, op.action)
        self._performances.pop(resolve(op.action), None)

    def _send_goal(self, op: ops.SendActionGoal, _now: float) -> None:
        key = (op.action, op.id)

        def on_feedback(values: Message) -> None:
            self.session.say("action_feedback", {"values": values}, op.fragment_size, action=op.action, id=op.id)

        def on_outcome(outcome: GoalOutcome) -> None:
            self._goals.pop(key, None)
            values = outcome.values
            if outcome.reason is not None:
                values = f"{values}{self._suggest(outcome.reason, op)}"
                self.note(outcome.reason, values, op)
            end = {"action": op.action, "status": outcome.status, "result": outcome.is_ok, "id": op.id}
            if isinstance(values, Message):
                self.session.say("action_result", {"values": values}, op.fragment_size, **end)
            else:
                self.session.say("action_result", {}, op.fragment_size, values=values, **end)

        try:
            self._policy.check_goal(op.action)
            if op.action_type is not None:
                known = self._actions.by_name.get(resolve(op.action))
                if known is not None and self._bus.store.canonical(op.action_type) != known.type.name:
                    text = f"Action {op.action} is of type {known.type.name}, not {op.action_type}"
                    raise GraphError(text, reason=Reason.TYPE_CONFLICT)
        except PeerError as error:
            self.refuse(op, str(error), error.reason)
            return
        goal = self._actions.send(self, op.action, op.args, on_outcome, on_feedback if op.feedback else None)
        if goal is not None and op.id is not None:
            self._goals[key] = goal

    def _cancel_goal(self, op: ops.CancelActionGoal, _now: float) -> None:
        """A goal that has ended, or never was, needs no cancelling: no mistake, as in rosbridge_suite."""
        goal = self._goals.get((op.action, op.id))
        if goal is not None:
            goal.cancel()

    def _report_goal(self, op: ops.ActionFeedback, _now: float) -> None:
        goal = self._goal_at_work(op)
        if goal is not None:
            goal.report(decode_body(goal.action.type.feedback, op.values, self._bus.stamp_ns))

    def _end_goal(self, op: ops.ActionResult, _now: float) -> None:
        goal = self._goal_at_work(op)
        if goal is None:
            return
        result_type = goal.action.type.result
        if not op.result:
            try:
                values = decode_body(result_type, op.values, self._bus.stamp_ns)
            except PeerError:  # a failed provider sends a text, or anything
                values = result_type.default()
            goal.end(GoalStatus.ABORTED, values)
            return
        try:
            status = GoalStatus.SUCCEEDED if op.status is None else _read_status(op.status)
            values = decode_body(result_type, op.values, self._bus.stamp_ns)
        except PeerError as error:
            goal.fail(str(error))
            raise
        goal.end(status, values)

    def _goal_at_work(self, op: ops.ActionFeedback | ops.ActionResult) -> Goal | None:
        """The goal that this client works on under that id; None if nobody waits for it any more."""
        performance = self._performances.get(resolve(op.action))
        if performance is None:
            text = f"Action {op.action} has not been advertised via rosbridge."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        goal = performance.goals.get(op.id)
        if goal is None:
            text = f"Nobody waits for a goal of {op.action} with this id"
            self.session.remark("warning", text, op.id)
            self.note(Reason.STRAY_ANSWER, text, op)
        return None if goal is None or goal.is_done else goal

    @staticmethod
    def _find_awaited(
        offers: dict[str, _Offer], op_id: object, get: Callable[[_Offer], dict[str, _Work]]
    ) -> _Work | None:
        """The call or goal under that id or, without an id, the only one that is not done."""
        if isinstance(op_id, str):
            name = op_id.partition(":")[2].rpartition(":")[0]
            offer = offers.get(name) or offers.get("/" + name)
            return None if offer is None else get(offer).get(op_id)
        undone = (work for offer in offers.values() for work in get(offer).values() if not work.is_done)
        first, second = next(undone, None), next(undone, None)
        return first if second is None else None

    # The rest

    def _set_level(self, op: ops.SetLevel, _now: float) -> None:
        if op.level not in LEVELS:  # the protocol has no answer for it; its author sees the log
            expected = ", ".join(LEVELS)
            self.note(Reason.WRONG_VALUE, f"set_level: expected one of {expected}; got {op.level[:MAX_OP_ID]!r}", op)
        self.session.set_level(op.level)

    def _status(self, op: ops.Status, _now: float) -> None:
        _log.info("%s says: [%s] %s", self.address, op.level, op.msg, extra={"client": self.address})

    def _auth(self, op: ops.Auth, _now: float) -> None:
        """Nothing to check: no token is wanted here."""

    def _check_room(self, op_id: ops.Id = None) -> None:
        """Raise GraphError if the client may not hold one more thing, under that id."""
        if isinstance(op_id, str) and len(op_id) > MAX_OP_ID:
            raise GraphError(f"The id of a topic has at most {MAX_OP_ID} characters", reason=Reason.TOO_MUCH)
        limit = self._policy.max_held
        if self._num_ids + len(self._provisions) + len(self._performances) >= limit:
            text = f"At most {limit} topics, services and actions can be held by one client"
            raise GraphError(text, reason=Reason.TOO_MUCH)


def _nothing() -> None:
    """Do nothing: no op of this client waits for its release."""


def _raise(error: Exception) -> NoReturn:
    """Raise a failure in the caller's hands: this client has no socket that could be closed."""
    raise error


def _split_id(op: ops.CallService) -> tuple[str, ops.Id]:
    """The name and the id of a call; an old form has both in one: `service#id`."""
    if op.id is None and "#" in op.service:
        service, _, op_id = op.service.partition("#")
        return service, op_id
    return op.service, op.id


def _read_status(number: int) -> GoalStatus:
    try:
        return GoalStatus(number)
    except ValueError:
        text = f"action_result: {number} is no status of action_msgs/GoalStatus"
        raise GraphError(text, reason=Reason.WRONG_VALUE) from None


def _is_empty_object(body: ops.OpBody) -> bool:
    if isinstance(body, (bytes, msgspec.Raw)):
        return _EMPTY.match(memoryview(body)) is not None
    return isinstance(body, dict) and not body


def _is_filled_object(body: ops.OpBody) -> bool:
    """Tell whether a body is an object with anything in it. It may be no JSON at all."""
    if isinstance(body, (bytes, msgspec.Raw)):
        return bytes(memoryview(body)[:1]) == b"{" and not _is_empty_object(body)
    return isinstance(body, dict) and bool(body)


def _says_anything(body: ops.OpBody) -> bool:
    """Return whether a body is there and is no empty object."""
    return not is_absent(body) and not _is_empty_object(body)


def _read_refusal(values: ops.OpBody, service: str) -> object:
    """The reason that a provider gave: any JSON value; a text of ours where it gave none."""
    if not _says_anything(values):
        return f"Service {service} failed; its provider gave no reason"
    try:
        reason: object = orjson.loads(bytes(values)) if isinstance(values, (bytes, msgspec.Raw)) else values
        orjson.dumps(reason)
    except orjson.JSONDecodeError:
        return "The provider failed, with a reason that is not valid JSON"
    except orjson.JSONEncodeError:  # deeper than can be written again
        return "The provider failed, with a reason that is nested too deeply"
    return reason

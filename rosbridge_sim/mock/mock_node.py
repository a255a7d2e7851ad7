"""A mock on the bus: a participant that publishes, answers and pursues goals as its plan says.

Messages are due at whole nanoseconds after the start, so a message has its values from its number alone. One
without a subscriber is not made. Messages whose turn was missed are left out, and so are their numbers.
"""

from __future__ import annotations

import heapq
import logging
import math
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import Any, Final

import orjson

from rosbridge_sim.errors import DocumentError, GraphError, PeerError, Reason
from rosbridge_sim.graph.actionlib import Actionlib
from rosbridge_sim.graph.actions import Goal, GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call, Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.mock.mock_plan import AnswerPlan, GoalPlan, MockPlan, TopicPlan, absolute
from rosbridge_sim.mock.recorded_topics import RecordedFile, RecordedTrack, without_stamps
from rosbridge_sim.mock.value_patterns import SECOND_NS, ConstantPart, MessageTime
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.plain_values import without_unknown

_log = logging.getLogger("rosbridge_sim.mock")

MAX_TURN_MESSAGES: Final = 200
"""Most messages in one turn of the loop: 2 to 4 ms."""

MAX_PENDING: Final = 4_000
"""Messages that wait for a turn; while there are more, those that become due are left out."""

Hook = Callable[[str, dict[str, Any], dict[str, Any] | None], dict[str, Any] | None]
"""`(name, values, request)`: may return other values of a message, or of the response to a request; None keeps them."""

_ENDS: Final = {"succeeded": GoalStatus.SUCCEEDED, "aborted": GoalStatus.ABORTED, "canceled": GoalStatus.CANCELED}


class _Producer:
    """A topic that is published from its plan.

    Attributes:
        fixed: the message, if it never changes: then it is encoded once for all.
        is_read: expressions read it.
    """

    def __init__(self, plan: TopicPlan, topic: Topic, *, is_read: bool) -> None:
        self.plan, self.topic, self.is_read = plan, topic, is_read
        make = plan.make
        self.fixed = Message(plan.type, make.value) if isinstance(make, ConstantPart) else None


class _Group:
    """The topics of one rate.

    Attributes:
        active: those that are made now.
        next: number of the next message.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.producers: list[_Producer] = []
        self.active: list[_Producer] = []
        self.next = 0

    def due_ns(self) -> float:
        return self.next * self.period_ns if self.active else math.inf


class _Playback:
    """A recording that is played in a loop."""

    def __init__(self, file: RecordedFile, topics: dict[str, Topic]) -> None:
        self._file = file
        self._events = sorted(
            (time_ns, track_index, i)
            for track_index, track in enumerate(file.tracks)
            for i, time_ns in enumerate(track.times_ns)
        )
        self.topics = [topics[track.name] for track in file.tracks]
        self.is_active = False
        self._next = 0  # events of all rounds

    def seek(self, now_ns: int) -> None:
        """Leave out what was before a time."""
        rounds, passed_ns = divmod(now_ns, self._file.length_ns)
        self._next = rounds * len(self._events) + bisect_left(self._events, (passed_ns, -1, -1))

    def due_ns(self) -> float:
        if not self.is_active:
            return math.inf
        rounds, at = divmod(self._next, len(self._events))
        return rounds * self._file.length_ns + self._events[at][0]

    def take(self) -> tuple[RecordedTrack, Topic, bytes, int]:
        """Return the next message: track, topic, bytes and its number in the topic."""
        rounds, at = divmod(self._next, len(self._events))
        self._next += 1
        _, track_index, i = self._events[at]
        track = self._file.tracks[track_index]
        return track, self.topics[track_index], track.messages[i], rounds * len(track.messages) + i


class MockNode(Participant):
    """The participant of a mock.

    Attributes:
        name: of its node.
        hook: changes values; None for none.
    """

    def __init__(self, bus: Bus, hook: Hook | None = None) -> None:
        """Offer nothing yet; see `load`."""
        self.name = "/mock"
        self.hook = hook
        self._bus = bus
        self._plan: MockPlan | None = None
        self._began = 0.0
        self._producers: dict[str, list[_Producer]] = {}
        self._groups: list[_Group] = []
        self._playbacks: list[_Playback] = []
        self._actionlibs: list[Actionlib] = []
        self._pending: deque[tuple[_Producer, int, int]] = deque()
        self._later: list[tuple[float, int, Callable[[float], None]]] = []
        self._ticket = count()
        self._counts: dict[object, int] = {}
        self._told: set[str] = set()
        self._finishing: dict[Goal, Callable[[float], None]] = {}
        self._stamp: Any = None
        self._is_stale = True
        self._due: float | None = None
        bus.on_topic.append(self._note_change)
        bus.on_holdings.append(self._note_change)

    def notify(self, level: str, text: str) -> None:
        """Log a notice of the bus."""
        _log.log(logging.WARNING if level != "info" else logging.INFO, "%s", text)

    def _note_change(self, _what: object) -> None:
        self._is_stale = True

    def now_ns(self, now: float) -> int:
        """Return the time since the start [ns]."""
        return round((now - self._began) * SECOND_NS)

    # Plans

    def load(self, plan: MockPlan, now: float) -> None:
        """Begin anew with a plan. Goals and calls in flight fail.

        Raises:
            DocumentError: a name belongs to another part of the server; then all goes on as before.
        """
        old = self._plan
        self._unload(now)
        try:
            self._offer(plan, now)
        except PeerError as error:
            self._unload(now)
            if old is not None:
                self._offer(old, now)
            raise DocumentError(f"the mock cannot be offered: {error}") from None

    def _unload(self, now: float) -> None:
        self._bus.leave(self, now)
        for actionlib in self._actionlibs:
            actionlib.close()
        self._producers, self._groups, self._playbacks, self._actionlibs = {}, [], [], []
        self._later.clear()
        self._pending.clear()
        self._counts.clear()
        self._finishing.clear()

    def _offer(self, plan: MockPlan, now: float) -> None:
        bus = self._bus
        self._plan, self._began, self._told = plan, now, set()
        self.name = absolute(plan.document.node)
        self._stamp = bus.store.time_value(bus.stamp_ns)
        for name, type_name in plan.subscribers.items():
            bus.subscribe(self, name, self._hear, type_name=type_name)
        groups: dict[int, _Group] = {}
        for topic_plan in plan.topics:
            producer = self._advertise(topic_plan, plan)
            if topic_plan.period_ns is not None:
                group = groups.setdefault(topic_plan.period_ns, _Group(topic_plan.period_ns))
                group.producers.append(producer)
        self._groups = list(groups.values())
        for file in plan.recordings:
            topics = {track.name: bus.advertise(self, track.name, track.type_name) for track in file.tracks}
            self._playbacks.append(_Playback(file, topics))
        self._offer_services(plan)
        for name, value in plan.document.parameters.items():
            bus.parameters.put(absolute(name), orjson.dumps(value).decode(), self)
        for producer in [producer for producers in self._producers.values() for producer in producers]:
            if producer.plan.period_ns is None:
                self._send(producer, 0, 0, now)
        self._is_stale = True
        bus.agenda.is_touched = True

    def _offer_services(self, plan: MockPlan) -> None:
        """Offer the services and actions."""
        bus = self._bus
        for name, (type_name, answers) in plan.services.items():
            bus.provide(self, name, type_name, partial(self._answer, answers))
        for name, (type_name, goals) in plan.actions.items():
            action = bus.actions.provide(self, name, type_name, partial(self._pursue, goals), self._cancel)
            if bus.store.ros == 1:
                self._actionlibs.append(Actionlib(bus, action))

    def _advertise(self, topic_plan: TopicPlan, plan: MockPlan) -> _Producer:
        depth = int(topic_plan.is_latching)
        key = topic_plan.period_ns  # /tf may have several
        topic = self._bus.advertise(
            self, topic_plan.name, topic_plan.type.name, depth=depth, key=key, is_on_demand=not depth
        )
        producer = _Producer(topic_plan, topic, is_read=topic_plan.name in plan.latest)
        self._producers.setdefault(topic_plan.name, []).append(producer)
        return producer

    def _hear(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        """Keep the last message of a topic that the mock subscribes to, for expressions."""
        assert self._plan is not None, "it subscribes for a plan"
        if topic.name in self._plan.latest:
            self._plan.latest[topic.name] = message.value

    # Time, as a clock of the scheduler

    def next_due(self, now: float) -> float | None:
        """Return when `advance` has something to do next [s]."""
        if self._is_stale:
            self._find_active(now)
            self._set_due()
        return self._due

    def advance(self, now: float) -> None:
        """Do what is due, at most `MAX_TURN_MESSAGES` messages; the rest in the next turn."""
        if self._is_stale:
            self._find_active(now)
        now_ns = self.now_ns(now)
        while self._later and self._later[0][0] <= now_ns:
            heapq.heappop(self._later)[2](now)
        self._stamp = self._bus.store.time_value(self._bus.stamp_ns)
        for group in self._groups:
            number = now_ns // group.period_ns
            if group.active and number >= group.next and len(self._pending) < MAX_PENDING:
                group.next = number + 1
                self._pending.extend((producer, number, number * group.period_ns) for producer in group.active)
        num = 0
        while self._pending and num < MAX_TURN_MESSAGES:
            producer, number, time_ns = self._pending.popleft()
            self._send(producer, number, time_ns, now)
            num += 1
        for playback in self._playbacks:
            while num < MAX_TURN_MESSAGES and playback.due_ns() <= now_ns:
                self._play(*playback.take(), now)
                num += 1
        for actionlib in self._actionlibs:
            due = actionlib.next_due()
            if due is not None and due <= now:
                actionlib.advance(now)
        self._set_due()

    def end(self, error: Exception) -> None:
        """End, because the mock has failed; the server goes on."""
        _log.error("internal error: the mock has ended", exc_info=error)
        self._unload(self._began)
        self._due, self._is_stale = None, False

    def _find_active(self, now: float) -> None:
        """Find the topics that have subscribers, and those that their expressions read."""
        self._is_stale = False
        active = {name for name, each in self._producers.items() if each[0].topic.has_listener}
        to_do = list(active)
        while to_do:
            for producer in self._producers[to_do.pop()]:
                new = {name for name in producer.plan.reads if name in self._producers} - active
                active |= new
                to_do.extend(new)
        now_ns = self.now_ns(now)
        for group in self._groups:
            was_active = bool(group.active)
            group.active = [producer for producer in group.producers if producer.plan.name in active]
            if not was_active:
                group.next = max(group.next, -(-now_ns // group.period_ns))
        read = {name for name in active for producer in self._producers[name] for name in producer.plan.reads}
        for playback in self._playbacks:
            was_active = playback.is_active
            playback.is_active = any(topic.has_listener or topic.name in read for topic in playback.topics)
            if not was_active:
                playback.seek(now_ns)

    def _set_due(self) -> None:
        dues = [group.due_ns() for group in self._groups] + [playback.due_ns() for playback in self._playbacks]
        if self._later:
            dues.append(self._later[0][0])
        due_ns = 0.0 if self._pending else min(dues, default=math.inf)
        dues_of_status = [actionlib.next_due() for actionlib in self._actionlibs]
        due = min([self._began + due_ns / SECOND_NS, *(each for each in dues_of_status if each is not None)])
        self._due = None if due == math.inf else due

    def _at(self, time_ns: float, work: Callable[[float], None]) -> None:
        """Do something at a time since the start [ns], in the next turn if that has passed; it gets the time [s]."""
        heapq.heappush(self._later, (time_ns, next(self._ticket), work))
        self._set_due()
        self._bus.agenda.is_touched = True

    # Topics

    def _send(self, producer: _Producer, number: int, time_ns: int, now: float) -> None:
        topic, message = producer.topic, producer.fixed
        if message is None or self.hook is not None:
            value = producer.plan.make(MessageTime(number, time_ns, self._stamp))
            value = self._hooked(topic.name, producer.plan.type, value)
            if producer.is_read:
                assert self._plan is not None, "it has topics"
                self._plan.latest[topic.name] = value
            message = Message(producer.plan.type, value)
        if topic.depth or topic.has_listener:
            self._bus.announce(self, topic, message, now)

    def _play(self, track: RecordedTrack, topic: Topic, raw: bytes, number: int, now: float) -> None:
        """Publish a recorded message with new stamps."""
        latest = self._plan.latest if self._plan is not None else {}
        if not (topic.has_listener or topic.name in latest) or topic.name in self._told:
            return
        message_type = self._bus.store.message(track.type_name)
        try:
            value: Any = without_stamps(track.decode(raw))
            header = value.get("header")
            if isinstance(header, dict) and "frame_id" in header:
                header["seq"] = number % 2**32
            plain = without_unknown(value, message_type.spec)
            made = self._hooked(topic.name, message_type, message_type.check(plain, self._bus.stamp_ns))
        except (DocumentError, PeerError) as error:
            self._tell_once(topic.name, f"{topic.name}: the recording is played no more: {error}")
            return
        if topic.name in latest:
            latest[topic.name] = made
        if topic.has_listener:
            self._bus.announce(self, topic, Message(message_type, made), now)

    def _hooked(self, name: str, message_type: MessageType, value: Struct, request: object = None) -> Struct:
        """Return the value that the hook makes of a value."""
        if self.hook is None:
            return value
        asked = None if request is None else orjson.loads(message_type.encode_json(request))
        try:
            changed = self.hook(name, orjson.loads(message_type.encode_json(value)), asked)
            return value if changed is None else message_type.check(changed, self._bus.stamp_ns)
        except Exception as error:  # noqa: BLE001 - a function of the user
            self._tell_once(f"hook {name}", f"the hook failed for {name}, which stays as it was: {error!r:.200}")
            return value

    def _tell_once(self, key: str, text: str) -> None:
        if key not in self._told:
            self._told.add(key)
            _log.warning("%s", text)

    # Services

    def _answer(self, answers: tuple[AnswerPlan, ...], call: Call, now: float) -> None:
        request = call.request
        plan = next((each for each in answers if each.fits(request)), None)
        if plan is None:
            call.refuse("no answer of the mock fits this request", Reason.REFUSED)
            return
        number = self._counts[id(plan)] = self._counts.get(id(plan), -1) + 1
        if plan.make is None:
            finish = partial(call.refuse, plan.fail)
        else:
            made = plan.make(
                MessageTime(number, self.now_ns(now), self._bus.store.time_value(self._bus.stamp_ns), request)
            )
            response: Any = call.service.type.response
            finish = partial(call.answer, self._hooked(call.service.name, response, made, request))
        if plan.delay_ns:
            self._at(self.now_ns(now) + plan.delay_ns, lambda _now: finish())
        else:
            finish()

    # Goals

    def _pursue(self, plans: tuple[GoalPlan, ...], goal: Goal) -> None:
        request = goal.request
        plan = next((each for each in plans if each.fits(request)), None)
        if plan is None or plan.outcome == "rejected":
            raise GraphError(f"Action {goal.action.name}: the mock rejects this goal")
        # The bus gives no time with a goal: the turn that follows at once has it.
        self._at(-math.inf, lambda now: self._begin(plan, goal, request, now))

    def _begin(self, plan: GoalPlan, goal: Goal, request: object, now: float) -> None:
        began_ns = self.now_ns(now)

        def at(number: int, now: float) -> MessageTime:
            stamp = self._bus.store.time_value(self._bus.stamp_ns)
            return MessageTime(number, self.now_ns(now) - began_ns, stamp, request)

        def report(number: int, now: float) -> None:
            if goal.is_done or goal.is_canceling or plan.feedback is None:
                return
            goal.report(plan.feedback(at(number, now)), now)
            if (number + 1) * plan.feedback_ns < plan.duration_ns:
                self._at(began_ns + (number + 1) * plan.feedback_ns, partial(report, number + 1))

        def finish(now: float) -> None:
            self._finishing.pop(goal, None)
            if not goal.is_done:
                goal.end(_ENDS["canceled" if goal.is_canceling else plan.outcome], plan.result(at(0, now)))

        if goal.is_canceling or goal.is_done:
            finish(now)
            return
        if plan.feedback is not None:
            report(0, now)
        self._at(began_ns + plan.duration_ns, finish)
        self._finishing[goal] = finish

    def _cancel(self, goal: Goal) -> None:
        """End a goal that its client does not want any more, in the next turn."""
        finish = self._finishing.pop(goal, None)
        if finish is not None:
            self._at(-math.inf, finish)

"""The simulator behind somebody else's rosbridge: one owner's topics, services and subscriptions, mirrored there.

MORAI SIM is a client of a rosbridge: it advertises its topics and services there and subscribes to commands. A `Mirror`
does the same for an owner on our bus. It is an `Participant` itself and stands for everybody on the far side: what is
published there on an input topic is published here in its name, and so is each call. It stays on the bus while the
connection is lost and made again: a bridge that is restarted is no client that has left.

What the far side has to be told at the beginning of each connection, in this order: topics, with what is latched on
them; subscriptions; services; then a question, whose answer shows that all of it was handled. Services come last since
clients wait for them. Before the very first time it is asked which services it has already. Before all that it is asked
for its `/use_sim_time`, where our stamps depend on it.

rosbridge_suite answers no mistake: a type whose package is not built there gives a line in its own log and nothing
else. So a while later we ask it which topics and services it has, and say what is missing.

A ROS master that is restarted forgets everybody, and a bridge that lives on does not tell it of us again. What is seen
here is that rosapi refuses its calls for a while. When it answers again, everything is announced anew. rosbridge_suite
keeps a publisher for UNREGISTER_TIME after it was taken back, and registers nothing as long as it has one; so if the
lists show that our topics are missing all the same, they are taken back for longer than that.

A service of an ego that has left stays announced, and its calls are refused with the reason: rosbridge_suite takes a
second to end a service, during which it handles nothing else.

What it sends and what cannot be used is a mistake of the bridge's, as that of any client: a line in our log, with a
reason, and an entry on `/sim/refusals`. It has no other consequence.

Many callers share a line and cannot be told apart. Where one of them has to wait for something (`hold`), so does all
that comes behind it on the same line, and nothing else.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, NoReturn

from rosbridge_sim.errors import EncodingError, FrameError, PeerError, Reason
from rosbridge_sim.graph.attach.connection import PROBE, BridgeConnection, Values
from rosbridge_sim.graph.attach.diagnostics import Diagnostics, Key, names_of
from rosbridge_sim.graph.attach.rosapi_watch import RosapiWatch, Seen
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Notify, Participant, decode_body, resolve
from rosbridge_sim.graph.refusals import refusal_of
from rosbridge_sim.graph.stamps import PARAMETER, Stamps, says_simulated
from rosbridge_sim.graph.topics_services import Answer, Subscription, Topic
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.codec import publish_head
from rosbridge_sim.protocol.outbox import OutboxLimits
from rosbridge_sim.schema.message import Message

__all__ = ["FAR_SIDE_NAME", "Mirror"]

FAR_SIDE_NAME: Final = "/rosbridge_far_side"
"""All programs on the far side are one node here: from here they cannot be told apart."""

OPS_PER_TURN: Final = 64
"""Ops of one line that are done before others have their turn; some 2 ms of work."""

SURVEYS: Final = (0.0, 1.0, 3.0)
"""When the far side is asked what it has [s]: each after the one before. In ROS 2 topics are found by and by."""


UNREGISTER_TIME: Final = 11.0
"""Time for which a topic is taken back [s]. rosbridge_suite gives its publisher up after `unregister_timeout`, 10 s."""


@dataclass(slots=True)
class _Item:
    """One thing that is mirrored.

    Attributes:
        line: the connection that it goes over.
        kind, name, type: as in its key.
        topic: for a topic or an input, on our bus.
        subscription: for a topic, ours to it.
        is_known: for a service, that it was announced there before.
        is_silent: for a topic, that nothing is published there for now.
    """

    line: BridgeConnection
    kind: str
    name: str
    type: str
    topic: Topic | None = None
    subscription: Subscription | None = None
    is_known: bool = False
    is_silent: bool = False


class Mirror:
    """Everybody on the far side of one bridge, as one owner on our bus.

    Attributes:
        address: of the far side, for people to read.
        lines: the connections that it wants, by their names; the first one's is empty.
        on_lines: called when one has come or gone.
        on_attached: called each time when everything is announced.
        on_failure: called when something done for the far side has failed by a bug of ours; raises it by itself.
        stamps: which time goes out; None where the far side is not to be asked about it.
        why_gone: called with the name of a service that is not here any more; returns why it is not, if it may come
            back, or an empty text.
    """

    name = FAR_SIDE_NAME

    def __init__(
        self,
        bus: Bus,
        source: Participant,
        address: str,
        *,
        has_line_each: bool = False,
        limits: OutboxLimits | None = None,
        max_frame_size: int = 16 * 2**20,
    ) -> None:
        """A mirror of what `source` has on `bus` now and later; no line is open.

        Args:
            bus: where `source` is.
            source: the simulator.
            address: of the far side.
            has_line_each: a connection for each topic and service, as MORAI SIM has it, in place of one for all. One
                keeps the order of all messages and answers; many keep a slow topic from delaying an answer.
            limits: of what waits for one socket.
            max_frame_size: longest frame that pieces may make [characters].
        """
        self.address = address
        self.on_lines: Callable[[], None] = lambda: None
        self.on_attached: Callable[[], None] = lambda: None
        self.on_failure: Callable[[Exception], None] = _raise
        self.stamps: Stamps | None = None
        self.why_gone: Callable[[str], str] = lambda _name: ""
        self._bus = bus
        self._source = source
        self._has_line_each = has_line_each
        self._limits = limits or OutboxLimits()
        self._max_frame_size = max_frame_size
        self._items: dict[Key, _Item] = {}
        self._inputs: dict[str, Topic] = {}
        self._in_flight: dict[str, int] = {}
        self._line_in_hand: BridgeConnection | None = None
        self._op: ops.Op | None = None  # in hand, for what is noted of it
        self._now = 0.0
        self._is_attached = self._is_gone = False
        self._findings = Diagnostics(address, bus.store.ros)
        self._survey_at: float | None = None
        self._num_surveys = 0
        self._is_behind = False
        self._is_time_known = False
        self._rosapi = RosapiWatch()
        self._is_anew = False  # all was announced once more on sockets that lived on
        self._return_at: float | None = None  # of the topics that were taken back
        self.lines: dict[str, BridgeConnection] = {"": self._make_line("")}
        bus.on_holdings.append(self._look)
        self._refresh()

    def leave(self, now: float) -> None:
        """Tell the far side that all of it ends, and take everything off the bus. What still comes is passed over."""
        self._is_gone = True
        self._bus.on_holdings.remove(self._look)
        for item in reversed(self._items.values()):
            self._renounce(item)
        self._bus.leave(self, now)

    def notify(self, level: str, text: str) -> None:
        """Log what would be told to a client: no program there could hear it."""
        self._note_told(level, text, self._op)

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """See `Explaining`; the level is of no use, since no program there could hear it."""
        assert level != "info", "that is no mistake"
        self._note_mistake(reason, text, self._op)

    def notifier(self) -> Notify:
        """See `Correlating`."""
        op = self._op
        return lambda level, text: self._note_told(level, text, op)

    def _note_told(self, level: str, text: str, op: ops.Op | None) -> None:
        """Note what was told without a reason, as `Peer` does."""
        if level == "info":
            self._note(logging.INFO, f"a program there is told: [{level}] {text}")
        else:
            self._note_mistake(Reason.REFUSED if level == "error" else Reason.NOT_NOW, text, op)

    def _note_mistake(self, reason: Reason, text: object, op: ops.Op | None = None) -> None:
        """Tell the log and `/sim/refusals` of a mistake of a program there.

        Args:
            reason: the kind of mistake.
            text: what a client would be told.
            op: what it is about, where that is known.
        """
        refusal = refusal_of(self.address, reason, text, op)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the bridge's connections are made anew."""
        self.on_failure(error)

    def note(self, level: int, text: str, now: float) -> None:
        """Have a line in the log, unless there were too many of late."""
        self._findings.note(level, text, now)

    # What is mirrored

    def _look(self, owner: Participant) -> None:
        if owner is self._source:
            self._refresh()

    def _refresh(self) -> None:
        """Mirror what has come, and no longer what has gone.

        A service that moves to another name while it is called goes when it has answered: rosbridge_suite takes
        no answers for a service that has ended, and its callers would hear of a failure.
        """
        wanted = dict.fromkeys(self._wanted())
        names = {key[:2] for key in wanted}
        awaited = {("service", name) for name in self._in_flight} - names
        for key in [key for key in self._items if key not in wanted and key[:2] not in awaited]:
            if key[0] != "service" or key[:2] in names or not self.why_gone(key[1]):
                self._drop(key)
        for key in wanted:
            if key not in self._items:
                self._add(key)

    def _wanted(self) -> Iterable[Key]:
        held, spelled = self._bus.holdings(self._source), self._bus.store.spelled
        for topic in held.published:
            yield "topic", topic.name, spelled(topic.type.name, "msg")
        for subscription in held.subscriptions:
            if subscription.topic.owner is self._source:  # it hears itself, and nobody else may speak there
                continue
            yield "input", subscription.topic.name, spelled(subscription.topic.type.name, "msg")
        for service in held.services:
            yield "service", service.name, spelled(service.type.name, "srv")

    def _add(self, key: Key) -> None:
        kind, name, type_name = key
        line = self._line_for(kind, name)
        item = self._items[key] = _Item(line, kind, name, type_name)
        if kind == "topic":
            item.topic = self._bus.find_topic(name)
            item.subscription = self._listen(item)
        elif kind == "input":
            item.topic = self._inputs[name] = self._bus.advertise(self, name, type_name)
        if line.is_open and (kind != "service" or line.has_services):
            self._announce(item)

    def _listen(self, item: _Item) -> Subscription:
        source, line, name, head = self._source, item.line, item.name, publish_head(item.name)

        def deliver(_topic: Topic, message: Message, sender: Participant, _now: float) -> None:
            if sender is source and line.has_services and not item.is_silent:
                line.offer(name, message.framed(head))

        return self._bus.subscribe(self, name, deliver, is_idle=not line.has_services, is_general=True)

    def _drop(self, key: Key) -> None:
        item = self._items.pop(key)
        self._renounce(item)
        if item.subscription is not None:
            self._bus.unsubscribe(item.subscription, self._now)
        elif item.kind == "input":
            del self._inputs[item.name]
            self._bus.unadvertise(self, item.name, self._now)
        if item.line.name:
            del self.lines[item.line.name]
            self.on_lines()

    def _line_for(self, kind: str, name: str) -> BridgeConnection:
        if not self._has_line_each:
            return self.lines[""]
        line = self.lines[f"{kind} {name}"] = self._make_line(f"{kind} {name}")
        self.on_lines()
        return line

    def _make_line(self, name: str) -> BridgeConnection:
        line = BridgeConnection(name, self._limits, self._max_frame_size, self._refuse)
        line.on_probe = self._hear_probe
        return line

    # What the far side is told

    def _announce(self, item: _Item) -> None:
        line = item.line
        if item.kind == "service":
            line.say("advertise_service", id=f"advertise_service:{item.name}", service=item.name, type=item.type)
            item.is_known = True
        elif item.kind == "input":
            line.say("subscribe", id=f"subscribe:{item.name}", topic=item.name, type=item.type)
        else:
            assert item.topic is not None
            depth = max(item.topic.publishers.get(self._source, {}).values(), default=0)
            line.say("advertise", id=f"advertise:{item.name}", topic=item.name, type=item.type, latch=depth > 0)
            head = publish_head(item.name)
            held = item.topic.kept.get(self._source)
            for message in held.messages() if held is not None else ():
                try:
                    line.offer(item.name, message.framed(head))
                except EncodingError as error:  # that message alone: all else is announced
                    self._bus.guard.note_encoding(item.name, error)

    def _renounce(self, item: _Item) -> None:
        """Say that something ends. rosbridge_suite keeps a service whose provider has gone without a word."""
        line = item.line
        if line.is_open:
            if item.kind == "service":
                if line.has_services:
                    line.say("unadvertise_service", service=item.name)
            elif item.kind == "input":
                line.say("unsubscribe", id=f"subscribe:{item.name}", topic=item.name)
            else:
                line.say("unadvertise", id=f"advertise:{item.name}", topic=item.name)

    def connected(
        self, line: BridgeConnection, wake: Callable[[], None], carry: Callable[[], None], now: float
    ) -> None:
        """A line has a socket: announce what goes over it.

        Args:
            line: one of `lines`.
            wake: as for `BridgeConnection.open`.
            carry: the same.
            now: monotonic time [s].
        """
        self._now = now
        line.open(wake, carry)
        stamps = self.stamps
        if stamps is not None and stamps.is_open and self._bus.store.ros == 1:
            self._ask_time(line, now, lambda now: self._announce_all(line, now))
            return
        if stamps is not None:
            stamps.settle(now, is_simulated=False)  # in ROS 2 each program has a parameter of its own
        self._announce_all(line, now)
        if not line.name:
            self._ask_time(line, now)

    def _ask_time(self, line: BridgeConnection, now: float, then: Callable[[float], None] = lambda _now: None) -> None:
        """Ask which time programs there go by. What stamps depend on is settled by the answer, or by none in time."""
        stamps = self.stamps
        if stamps is None or self._bus.store.ros != 1:
            return

        def hear(values: Values | None, now: float) -> None:
            if self._is_gone:
                return
            is_simulated = values is not None and says_simulated(values.get("value"))
            was_open = stamps.is_open
            stamps.settle(now, is_simulated=is_simulated)
            self._is_time_known = values is not None
            if values is not None or was_open:
                self._findings.judge_stamps(is_simulated=is_simulated, is_wall=stamps.is_wall, is_settled=was_open)
            then(now)

        line.ask("/rosapi/get_param", hear, now, name=PARAMETER, default="")

    def _announce_all(self, line: BridgeConnection, now: float) -> None:
        """Tell the far side of what goes over a line; of services when it has said which ones it has."""
        for item in self._of(line):
            if item.kind != "service":
                self._announce(item)
        if any(item.kind == "service" and not item.is_known for item in self._of(line)):
            line.ask("/rosapi/services", lambda values, now: self._announce_services(line, values, now), now)
        else:
            self._announce_services(line, None, now)

    def _announce_services(self, line: BridgeConnection, values: Values | None, now: float) -> None:
        if self._is_gone:
            return
        there = set(names_of(values, "services"))
        line.has_services = True
        for item in self._of(line):
            if item.kind == "service":
                if not item.is_known and item.name in there:
                    self._findings.taken.append(item.name)
                self._announce(item)
            if item.subscription is not None:  # from now on calls may come, and what they move is to be seen
                item.subscription.is_idle = False
        line.ask(PROBE, lambda values, now: self._begin(line, values, now), now)

    def _begin(self, line: BridgeConnection, values: Values | None, now: float) -> None:
        """All of a line is announced, and handled if the far side answers."""
        line.is_ready = True
        self._rosapi.start(now)
        if not line.name and values is not None:
            self._findings.judge_time(values)
        if not self._is_attached and all(one.is_ready for one in self.lines.values()):
            self._is_attached = True
            self._findings.greet(self._items)
            self.on_attached()
            self._begin_surveys(now)

    def lost(self, line: BridgeConnection, now: float) -> None:
        """A line has lost its socket. Its calls that are still on their way here are answered to nobody."""
        self._now = now
        line.shut()
        if self.lines.get(line.name) is not line:  # nobody wants it any more
            return
        self._is_attached = False
        self._is_behind = self._is_any_late()
        self._survey_at = None
        if not line.name:
            self._rosapi.stop()
            self._is_anew = False
        for item in self._of(line):
            item.is_silent = False
            if item.subscription is not None:
                item.subscription.is_idle = True

    def _is_any_late(self) -> bool:
        return any(line.credit.is_late for line in self.lines.values())

    def _of(self, line: BridgeConnection) -> list[_Item]:
        return [item for item in self._items.values() if item.line is line]

    # What the far side says

    def receive(self, line: BridgeConnection, frame: bytes, now: float) -> bool:
        """Do what a frame asks, or have it wait for its turn; what is wrong with it is for the log.

        Returns:
            As `go_on`.
        """
        self._now = now  # for what cannot be read
        line.keep(frame, now)
        return self.go_on(line, now)

    def go_on(self, line: BridgeConnection, now: float) -> bool:
        """Do what has come on a line and waits, one turn's worth; after a release, or when more was left to do.

        Returns:
            Whether more is left that could be done at once: call it again in the next turn.
        """
        self._now = now
        for _ in range(OPS_PER_TURN):
            if self._is_gone or line.is_held or not line.waiting:
                return False
            op = line.waiting.popleft()
            self._line_in_hand, self._op = line, op
            try:
                self._do(line, op, now)
            except PeerError as error:
                self._note_mistake(error.reason, str(error), op)
            finally:
                self._line_in_hand = self._op = None
        return bool(line.waiting) and not line.is_held

    def hold(self) -> Callable[[], None]:
        """See `Holdable`: hold the line whose op is in hand."""
        let_go = (self._line_in_hand or self.lines[""]).hold()

        def release() -> None:
            try:
                let_go()
            except Exception as error:  # noqa: BLE001 - a bug of ours in this bridge's own state
                self._bus.guard.blame(self, error)

        return release

    def _do(self, line: BridgeConnection, op: ops.Op, now: float) -> None:
        if isinstance(op, ops.Publish):
            self._take(op, now)
        elif isinstance(op, ops.CallService):
            self._call(line, op, now)
        elif isinstance(op, ops.Status):
            self._findings.hear_status(op, self._items, now)
        else:
            self._note(logging.WARNING, f"it sent an op that means nothing here: {type(op).__name__}")

    def _take(self, op: ops.Publish, now: float) -> None:
        topic = self._inputs.get(op.topic) or self._inputs.get(resolve(op.topic))
        if topic is None:
            self._note(logging.WARNING, f"it sent a message of {op.topic}, for which nobody asked")
            return
        value = decode_body(topic.type, op.msg, self._bus.stamp_ns)
        self._bus.publish(self, topic, Message(topic.type, value), now)

    def _call(self, line: BridgeConnection, op: ops.CallService, now: float) -> None:
        session = line.session

        def on_answer(answer: Answer) -> None:
            notify(answer)
            left = self._in_flight.pop(name) - 1
            if left:
                self._in_flight[name] = left
            elif not self._serves(name):
                self._refresh()

        def notify(answer: Answer) -> None:
            if line.session is not session:  # another socket by now, on which ids are counted anew
                return
            if answer.is_ok:
                session.answer(op.service, op.id, answer.values, is_ok=True)
                return
            # rosbridge_suite takes an object for the values and passes over `result`: the caller gets an empty
            # response, which in MORAI's types says no; whoever knows `reason` can say why
            why = str(answer.values)
            if answer.reason is None:  # the simulator cannot, and it is no mistake of the caller's
                self._note(logging.INFO, f"a call of {op.service} is refused: {why}")
            else:
                self._note_mistake(answer.reason, why, op)
            line.say("service_response", service=op.service, id=op.id, values={}, result=False, reason=why)

        if not self._serves(op.service):
            why = self.why_gone(resolve(op.service)) or "it is not ours"
            notify(Answer(is_ok=False, values=f"Service {op.service} is not served: {why}"))
            return
        name = resolve(op.service)
        self._in_flight[name] = self._in_flight.get(name, 0) + 1
        self._bus.call(self, op.service, op.args, on_answer, now=now)

    def _serves(self, name: str) -> bool:
        service = self._bus.services.get(resolve(name))
        return service is not None and service.owner is self._source

    def _refuse(self, error: FrameError) -> None:
        self._note_mistake(error.reason, str(error))

    def _note(self, level: int, text: str) -> None:
        self.note(level, text, self._now)

    # What it has of ours

    def _survey(self, now: float) -> None:
        """Ask it for its lists; once more later, if something is missing, or nobody answers: rosapi may start later."""
        self._survey_at = None
        self._num_surveys += 1
        desk = self.lines[""]
        is_final = self._num_surveys == len(SURVEYS)

        def hear_services(topics: Values, services: Values | None, now: float) -> None:
            if services is None:
                miss(now)
            elif not self._judge(topics, services, now, is_final=is_final):
                again(now)

        def hear_topics(topics: Values | None, now: float) -> None:
            if topics is None:
                miss(now)
            else:
                desk.ask("/rosapi/services", lambda services, now: hear_services(topics, services, now), now)

        def miss(now: float) -> None:
            if is_final:
                self._findings.miss_rosapi()
            again(now)

        def again(now: float) -> None:
            if not is_final:
                self._survey_at = now + SURVEYS[self._num_surveys]

        desk.ask("/rosapi/topics", hear_topics, now)

    def _judge(self, topics: Values, services: Values, now: float, *, is_final: bool) -> bool:
        """Look through its lists, and return whether nothing is missing."""
        is_whole = self._findings.judge(topics, services, self._items, is_final=is_final and not self._is_anew)
        if is_final and self._is_anew:
            self._is_anew = False
            if self._findings.has_lost_topics:
                self._take_back(now)
        return is_whole

    # When its master has forgotten us

    def _hear_probe(self, is_answered: bool, now: float) -> None:  # noqa: FBT001 - a callback of one fact
        """The far side has answered or refused a call of rosapi."""
        seen = self._rosapi.hear(now, is_answered=is_answered)
        if seen is Seen.LOST:
            text = "rosapi does not answer there any more: was its ROS master restarted? All is announced when it does"
            self._note(logging.WARNING, text)
        elif seen is Seen.BACK:
            self._note(logging.INFO, "rosapi answers again: everything is announced anew")
            self._announce_anew(now)

    def _announce_anew(self, now: float) -> None:
        """Tell the far side of everything once more, over the sockets that there are."""
        self._is_anew, self._return_at = True, None
        for item in self._items.values():
            item.is_silent = False
            if item.line.has_services:
                if item.kind != "service":  # a service that is announced twice is registered anew
                    self._renounce(item)
                self._announce(item)
        if self._is_attached:
            self._begin_surveys(now)

    def _take_back(self, now: float) -> None:
        """End the topics there until the bridge has forgotten that it has them."""
        self._return_at = now + UNREGISTER_TIME
        for item in self._items.values():
            if item.kind == "topic":
                self._renounce(item)
                item.is_silent = True

    def _bring_back(self, now: float) -> None:
        """Announce the topics that were taken back."""
        self._return_at = None
        for item in self._items.values():
            if item.is_silent:
                item.is_silent = False
                if item.line.is_open:
                    self._announce(item)
        if self._is_attached:
            self._begin_surveys(now)

    def _begin_surveys(self, now: float) -> None:
        self._num_surveys = 0
        self._survey_at = now

    def _look_for_rosapi(self, now: float) -> None:
        """Make a call whose answer shows whether rosapi is there, unless it is late with others."""
        desk = self.lines[""]
        if desk.is_ready and not desk.credit.is_late:
            desk.ask(PROBE, lambda _values, _now: None, now)
        self._rosapi.note_asked(now)

    # Time

    def next_due(self, _now: float) -> float | None:
        """When `advance` has something to do next [s]."""
        dues = [line.due for line in self.lines.values()]
        own = (self._survey_at, self._rosapi.due, self._return_at)
        return min((due for due in (*dues, *own) if due is not None), default=None)

    def advance(self, now: float) -> None:
        """Give up what was not answered in time; ask what is to be asked by now."""
        self._now = now
        for line in list(self.lines.values()):
            line.expire(now)
        is_behind = self._is_any_late()
        if is_behind != self._is_behind:
            self._is_behind = is_behind
            if is_behind:
                text = "it does not keep up: topics wait, the newest are kept"
            else:
                num_dropped = sum(line.outbox.dropped.total() for line in self.lines.values())
                text = f"it keeps up again; {num_dropped:,} messages of topics were dropped since it is connected"
            self._findings.say(logging.WARNING, text)
        if self._rosapi.due is not None and now >= self._rosapi.due:
            self._look_for_rosapi(now)
        if self._return_at is not None and now >= self._return_at:
            self._bring_back(now)
        if self._survey_at is not None and now >= self._survey_at:
            if not self._is_time_known:  # rosapi may have started meanwhile
                self._ask_time(self.lines[""], now)
            self._survey(now)


def _raise(error: Exception) -> NoReturn:
    """Raise a failure in the caller's hands: this far side has no connection that could be cut."""
    raise error

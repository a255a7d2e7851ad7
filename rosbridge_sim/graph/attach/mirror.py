"""The mirror of the simulator on a remote rosbridge: topics, services and subscriptions of one owner, announced there.

MORAI SIM is a client of a rosbridge: it advertises its topics and services there, and subscribes to commands. A
`Mirror` does the same for an owner on our bus. It is a `Participant` itself and represents all programs on the far
side: their messages on input topics are published here in its name, and so are their calls. It stays on the bus while
the connection is lost and opened again, because a restarted bridge is not a client that has left.
This file handles the frames from the far side and connects the parts: the mirrored items (`mirror_registry.py`), their
announcement (`announcing.py`), the check that they arrived (`survey.py`), the readers of pictures and clouds
(`reader_watch.py`), and the state of its rosapi (`rosapi_watch.py`).
Many callers share a connection and cannot be told apart. If one of them must wait (`hold`), all later ops on the same
connection wait, too, and nothing else.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final

from rosbridge_sim.errors import FrameError, PeerError
from rosbridge_sim.graph.attach.announcing import Announcer
from rosbridge_sim.graph.attach.connection import PROBE, BridgeConnection
from rosbridge_sim.graph.attach.far_side import FarSide
from rosbridge_sim.graph.attach.lag_report import REPORT_PERIOD, LagReport
from rosbridge_sim.graph.attach.mirror_registry import BULK, MirrorChoices, MirrorRegistry
from rosbridge_sim.graph.attach.reader_watch import ReaderWatch
from rosbridge_sim.graph.attach.release_check import ReleaseCheck
from rosbridge_sim.graph.attach.rosapi_watch import RosapiChange, RosapiWatch
from rosbridge_sim.graph.attach.survey import Survey
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant, decode_body, resolve
from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.json_encoding import response_frame
from rosbridge_sim.schema.message import Message

OPS_PER_TURN: Final = 64
"""Ops of one connection that are done in one turn: about 2 ms of work."""

SMALL_HINT, BULK_HINT = (
    "turn off topics that nobody needs, in [publishers] of the settings",
    "with wsaccel older than 0.6.6 there, update it: pip install -U wsaccel",
)
"""Advice in the log lines about a bridge that is too slow. autobahn, the WebSocket library of rosbridge_suite, checks
texts with wsaccel, 50 times as fast with 0.6.6 as with 0.6.4: see docs/guides/attach.md."""


class Mirror(FarSide):
    """All programs on the far side of one bridge, as one participant of our bus.

    Attributes:
        connections: the wanted connections by name; the name of the first is empty.
        release_check: compares the fields of the types there with ours.
    """

    def __init__(self, bus: Bus, source: Participant, address: str, choices: MirrorChoices | None = None) -> None:
        """Create a mirror of everything that `source` has on `bus`, now and later. No connection is open yet.

        Args:
            bus: the bus of `source`.
            source: the simulator.
            choices: connections and extra topics; None for the defaults.
        """
        super().__init__(bus, source, address)
        self._choices = choices = choices or MirrorChoices()
        self._connection_in_hand: BridgeConnection | None = None
        self._report_due: float | None = None
        self._lag = LagReport("topic messages", SMALL_HINT)
        self._bulk_lag = LagReport("pictures and clouds", BULK_HINT)
        self._rosapi = RosapiWatch()
        registry = self._registry = MirrorRegistry(self, self._make_connection, choices)
        self.connections = registry.connections
        self.release_check = ReleaseCheck(self.diagnostics, registry, bus.store)
        self._survey = Survey(self.diagnostics, registry)
        self._readers = ReaderWatch(registry)
        self._announcer = Announcer(self, registry)
        self._survey.on_topics = self._announcer.note_topics
        self._announcer.on_topics_missing = self._begin_survey
        self._survey.on_topics_lost = self._announcer.take_back
        self._announcer.on_ready = self._note_ready
        self._announcer.on_attached = self._note_attached
        bus.on_holdings.append(self._note_holdings)
        registry.refresh()

    def _make_connection(self, name: str) -> BridgeConnection:
        beside = self._registry.first if name == BULK else None
        connection = BridgeConnection(
            name, self._choices.limits, self._choices.max_frame_size, self._note_no_op, beside=beside
        )
        connection.on_probe = self._note_probe
        return connection

    def _note_holdings(self, owner: Participant) -> None:
        if owner is self.source:
            self._registry.refresh()
            self._readers.note_items(self.now)

    def leave(self, now: float) -> None:
        """Tell the far side that everything ends, and remove it from the bus. Later input is ignored."""
        self.is_gone = True
        self.bus.on_holdings.remove(self._note_holdings)
        for item in reversed(self._registry.items.values()):
            self._announcer.withdraw(item)
        self.bus.leave(self, now)

    # Sockets

    def connected(
        self, connection: BridgeConnection, schedule_flush: Callable[[], None], flush: Callable[[], None], now: float
    ) -> None:
        """Announce the items of a connection that has a socket now.

        Args:
            connection: one of `connections`.
            schedule_flush: as for `BridgeConnection.open`.
            flush: as for `BridgeConnection.open`.
        """
        self.now = now
        connection.open(schedule_flush, flush)
        if not connection.name:  # a bridge that was started again may have other readers
            for item in self._registry.large_items:
                self._registry.forget_readers(item)
        self._announcer.begin(connection, now)

    def lost(self, connection: BridgeConnection, now: float) -> None:
        """Drop what was on its way over a lost socket. Its unfinished calls get no answer.

        Args:
            connection: one of `connections`.
        """
        self.now = now
        connection.shut()
        if self.connections.get(connection.name) is not connection:  # it was removed
            return
        self._announcer.end(connection)
        self._bulk_lag.restart()
        if connection is not self._registry.bulk:
            self._lag.restart()
            self._report_due = self._survey.due = None
        if not connection.name:
            self._rosapi.stop()
            self._readers.stop()
            self._survey.is_anew = False

    def _note_ready(self, now: float) -> None:
        """Begin to watch rosapi and the readers, because a connection has announced everything."""
        self._rosapi.start(now)
        if self._registry.first.is_ready:
            self._readers.start(now)

    def _note_attached(self, now: float) -> None:
        self.on_attached()
        self._report_due = now + REPORT_PERIOD
        self._survey.begin(now)
        self.release_check.ask(now)

    def age(self, now: float) -> float:
        """Return how old topic messages are when the slowest connection's far side handles them [s]."""
        return max(each.flow_control.age(now) for each in self.connections.values())

    # From the far side

    def receive(self, connection: BridgeConnection, frame: bytes, now: float) -> bool:
        """Do the ops of a frame, or let them wait for their turn. Mistakes go to the log.

        Args:
            connection: connection of the frame.
            frame: content of a text or binary frame.

        Returns:
            True if more ops could be done at once, as for `go_on`.
        """
        self.now = now  # for frames that cannot be read
        connection.queue(frame, now)
        return self.go_on(connection, now)

    def go_on(self, connection: BridgeConnection, now: float) -> bool:
        """Do the waiting ops of a connection, as many as one turn allows.

        Args:
            connection: one of `connections`.

        Returns:
            True if more ops could be done at once: call again in the next turn.
        """
        self.now = now
        for _ in range(OPS_PER_TURN):
            if self.is_gone or connection.is_held or not connection.waiting:
                return False
            op = connection.waiting.popleft()
            self._readers.note_mode(now, is_synchronous=self.is_synchronous())
            self._connection_in_hand, self.op = connection, op
            try:
                self._do(connection, op, now)
            except PeerError as error:
                self.note_mistake(error.reason, str(error), op)
            finally:
                self._connection_in_hand = self.op = None
        return bool(connection.waiting) and not connection.is_held

    def hold(self) -> Callable[[], None]:
        """Hold the connection of the current op; see `Participant`."""
        let_go = (self._connection_in_hand or self._registry.first).hold()

        def release() -> None:
            try:
                let_go()
            except Exception as error:  # noqa: BLE001 - an internal error in this bridge's own state
                self.bus.guard.blame(self, error)

        return release

    def _do(self, connection: BridgeConnection, op: ops.Op, now: float) -> None:
        if isinstance(op, ops.Publish):
            self._publish_input(op, now)
        elif isinstance(op, ops.CallService):
            self._call(connection, op, now)
        elif isinstance(op, ops.Status):
            self.note_refusal(op.msg)
            package = self.diagnostics.note_status(op, self._registry.items, now)
            if package:
                self._announcer.note_missing_package(package)
        else:
            self.note_now(logging.WARNING, f"it sent an op that this side does not support: {type(op).__name__}")

    def _publish_input(self, op: ops.Publish, now: float) -> None:
        topic = self._registry.find_input(op.topic)
        if topic is None:
            self.note_now(logging.WARNING, f"it sent a message of {op.topic}, which has no subscription here")
            return
        if topic.limits is not None:
            topic.limits.check(topic.name, op.msg, "message")
        value = decode_body(topic.type, op.msg, self.bus.stamp_ns)
        self.bus.publish(self, topic, Message(topic.type, value), now)

    def _call(self, connection: BridgeConnection, op: ops.CallService, now: float) -> None:
        session = connection.session

        def on_answer(answer: Answer) -> None:
            send(answer)
            self._registry.end_call(name)

        def send(answer: Answer) -> None:
            if connection.session is not session:  # a new socket, on which ids start again
                return
            if answer.is_ok:
                assert isinstance(answer.values, Message)
                body = self.body(answer.values)
                session.outbox.send(response_frame(op.service, body, is_ok=True, op_id=op.id))
                return
            # rosbridge_suite needs an object in `values` and ignores `result`: the caller gets an empty
            # response, which means "no" in MORAI's types; a bridge that supports `reason` can tell why
            why = str(answer.values)
            if answer.reason is None:  # the simulator cannot do it, and the caller made no mistake
                self.note_now(logging.INFO, f"a call of {op.service} is refused: {why}")
            else:
                self.note_mistake(answer.reason, why, op)
            connection.say("service_response", service=op.service, id=op.id, values={}, result=False, reason=why)

        if not self._registry.is_served(op.service):
            why = self.why_gone(resolve(op.service)) or "it is not a service of this simulator"
            send(Answer(is_ok=False, values=f"Service {op.service} is not served: {why}"))
            return
        name = resolve(op.service)
        self._registry.begin_call(name)
        self.bus.call(self, op.service, op.args, on_answer, now=now)

    def _note_no_op(self, error: FrameError) -> None:
        self.note_mistake(error.reason, str(error))

    # State of its rosapi

    def _note_probe(self, is_answered: bool, now: float) -> None:  # noqa: FBT001 - a callback of one fact
        """Handle the answer or refusal of a call of rosapi."""
        change = self._rosapi.note_reply(now, is_answered=is_answered)
        if change is RosapiChange.LOST:
            text = "rosapi there stopped answering (ROS master restarted?); all is announced again when it answers"
            self.note_now(logging.WARNING, text)
        elif change is RosapiChange.BACK:
            self.note_now(logging.INFO, "rosapi answers again: everything is announced again")
            self._announce_anew(now)

    def _check_rosapi(self, now: float) -> None:
        """Make a call whose answer shows if rosapi runs, unless other answers are already late."""
        first = self._registry.first
        if first.is_ready and not first.flow_control.is_late:
            first.ask(PROBE, lambda _values, _now: None, now)
        self._rosapi.note_asked(now)

    def _announce_anew(self, now: float) -> None:
        self._survey.is_anew = True
        self._announcer.announce_anew()
        self._begin_survey(now)

    def _bring_back(self, now: float) -> None:
        self._announcer.bring_back()
        self._begin_survey(now)

    def _begin_survey(self, now: float) -> None:
        """Compare lists again, unless the last connection will start that."""
        if self._announcer.is_attached:
            self._survey.begin(now)

    # Time

    def next_due(self, _now: float) -> float | None:
        """Return when `advance` has something to do next [s]."""
        dues = [each.due for each in self.connections.values()]
        own = (self._survey.due, self._rosapi.due, self._readers.due, self._report_due, self._announcer.return_at)
        return min((due for due in (*dues, *own) if due is not None), default=None)

    def advance(self, now: float) -> None:
        """Handle time-outs, and ask questions that are due."""
        self.now = now
        for each in list(self.connections.values()):
            each.expire(now)
        if self._report_due is not None and now >= self._report_due:
            self._report_lag(now)
        if self._readers.due is not None and now >= self._readers.due:
            self._readers.note_mode(now, is_synchronous=self.is_synchronous())
            self._readers.ask(now)
        if self._rosapi.due is not None and now >= self._rosapi.due:
            self._check_rosapi(now)
        if self._announcer.return_at is not None and now >= self._announcer.return_at:
            self._bring_back(now)
        if self._survey.due is not None and now >= self._survey.due:
            if not self._announcer.is_time_known:  # rosapi may have started meanwhile
                self._announcer.ask_time(self._registry.first, now)
            if not self._announcer.is_reading_known:
                self._announcer.ask_reading(self._registry.first, now)
            self._survey.ask(now)

    def _report_lag(self, now: float) -> None:
        """Log whether the bridge keeps up, if that has changed; and begin the next period."""
        self._report_due = now + REPORT_PERIOD
        bulk = self._registry.bulk
        others = [each for each in self.connections.values() if each is not bulk]
        for report, connections in ((self._lag, others), (self._bulk_lag, [] if bulk is None else [bulk])):
            text = report.note_period(
                sum(each.fresh.num_offered for each in connections),
                sum(each.fresh.dropped.total() for each in connections),
                max((each.flow_control.take_longest_age(now) for each in connections), default=0.0),
            )
            if text:
                self.note(logging.WARNING, text, now)

"""One connection to a remote rosbridge: its frames, our questions to it, and its progress.

A `BridgeConnection` outlives its sockets. `open` starts fresh on each socket, and `shut` drops what was on its way over
the last one. It knows the wire, but not the meaning of its contents; `graph/attach/mirror.py` handles that.
An op from the far side may take longer than its turn, for example to read a scenario from disk. Then the connection is
*held*: ops that arrive meanwhile wait in it. Answers to our own questions do not wait, because they show the far side's
progress.
The far side may be any rosbridge. So no status frame is ever sent (rosbridge_suite has no such op), every answer is
checked, and the frames to send have limits (`Outbox`, `FreshMessages`) and flow control (`FlowControl`).
A bridge handles the frames of a socket in order. So an answer comes after everything that was sent before its question,
and the time for it grows with the number of those frames (`Patience`). An answer after the waiting time is measured,
too: a bridge that is only slow then gets more time for the next question.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import msgspec
import orjson

from rosbridge_sim.errors import FrameError
from rosbridge_sim.graph.attach.flow_control import MAX_PATIENCE, FlowControl
from rosbridge_sim.graph.attach.fresh_messages import FreshMessages, WaitingMessage
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session

PROBE_PATIENCE: Final = 2.0
"""Shortest wait for an answer to a question [s]; rosbridge_suite in ROS 2 searches one second for a missing service."""

MAX_QUESTION_PATIENCE: Final = 60.0
"""Longest wait for an answer [s]: as for a probe."""

SLACK: Final = 4.0
"""The waiting time in expected round trips: a bridge's load varies, and some answers of rosapi take longer."""

MEMORY: Final = 8
"""Round trips that are remembered; the longest of them counts, and a bridge that was slow once is soon trusted again.
"""


class Patience:
    """The measured round trips of one socket.

    Attributes:
        has_answer: a call was answered with success.
        has_refusal: a call was refused, so the far side does answer calls.
    """

    def __init__(self) -> None:
        self.has_answer = self.has_refusal = False
        self._round_trips: deque[float] = deque(maxlen=MEMORY)
        self._per_frame: deque[float] = deque(maxlen=MEMORY)

    def note(self, round_trip: float, num_frames: float, *, is_ok: bool) -> None:
        """Note an answer, in time or late.

        Args:
            round_trip: time since the question [s].
            num_frames: number of frames that were before it, itself included.
            is_ok: it was no refusal.
        """
        if not is_ok:
            self.has_refusal = True
            return
        self.has_answer = True
        self._round_trips.append(round_trip)
        self._per_frame.append(round_trip / max(num_frames, 1.0))

    def wait(self, num_frames: float) -> float:
        """Return the time in which an answer should come [s].

        Args:
            num_frames: number of frames that are before the question, itself included.
        """
        longest = max(self._round_trips, default=0.0)
        expected = max(longest, num_frames * max(self._per_frame, default=0.0))
        return min(MAX_QUESTION_PATIENCE, max(PROBE_PATIENCE, SLACK * expected))


PROBE = "/rosapi/get_time"
"""A service whose answer shows the progress of the far side: cheap, and harmless everywhere.

In ROS 1 a service that does not exist would do. In ROS 2, rosbridge_suite searches a second for a missing service."""

MAX_OVERDUE: Final = 64
"""Questions after their waiting time whose late answers are still measured."""

MAX_WAITING_BYTES = 2**20
"""If more frames wait in a held connection, its socket is not read until they are done [bytes]. This is far more than
clients send while a scenario is read, and little beside the longest frame."""

_PROBE, _QUESTION = "mark:", "ask:"
"""Prefixes of the ids of our calls: of probes, and of questions."""

_NUMBER = re.compile(r"[0-9]{1,18}")
"""End of the id of a probe; an id from elsewhere may have more digits than Python converts."""

Values = dict[str, Any]
"""The values of an answer; they are not checked yet."""

OnReply = Callable[[Values | None, float], None]
"""Gets the values of an answer, or None if there are none, and `now`."""


def _nothing() -> None:
    """Do nothing, because there is no socket."""


ROUND_TRIPS: Final = 4.0
"""Age of the data there, times this: how long a question may take at a bridge that answers, because it has to come to
what was sent before the question."""


@dataclass(slots=True)
class _Question:
    """A call of ours without an answer.

    Attributes:
        asked_at, until: time of the call, and when it is given up [s].
        num_frames: number of frames that were before it, itself included.
    """

    on_answer: OnReply
    on_refusal: Callable[[str], None]
    service: str
    asked_at: float
    until: float
    num_frames: float


class BridgeConnection:
    """A connection to the remote bridge; it may be without a socket.

    Attributes:
        name: name of the connection among those to the same bridge; empty for the first.
        is_open: there is a socket.
        is_ready: the far side has handled the first announcements.
        has_services: services were announced on this socket.
        session: reads and writes the frames of this socket.
        outbox: frames that wait for the socket in their order, never replaced by newer ones.
        fresh: topic messages that wait for the socket and are replaced by newer ones.
        flow_control: decides how much may be sent.
        patience: the round trips of our calls over this socket.
        waiting: received ops that are not done yet, oldest first.
        on_released: called when the last hold has ended.
        on_probe: called when a call of PROBE was answered (True) or refused (False), with monotonic time [s]; not
            called for a time-out.
    """

    def __init__(
        self,
        name: str,
        limits: OutboxLimits,
        max_frame_size: int,
        on_refused: Callable[[FrameError], None],
        *,
        beside: BridgeConnection | None = None,
    ) -> None:
        """Create a connection without a socket.

        Args:
            beside: for a connection for large messages: the one for small messages to the same bridge.
            limits: limits on frames that wait for the socket.
            max_frame_size: longest frame that fragments may form [characters].
            on_refused: gets the error of each invalid part of an incoming frame.
        """
        self.name = name
        self.is_open = False
        self.is_ready = False
        self.has_services = False
        self.on_released: Callable[[], None] = _nothing
        self.on_probe: Callable[[bool, float], None] = lambda _is_answered, _now: None
        self._limits = limits
        self._max_frame_size = max_frame_size
        self._on_refused = on_refused
        self._num_asked = 0
        self._other_latency = None if beside is None else lambda: beside.flow_control.latency
        self._begin(_nothing, _nothing)

    def _begin(self, schedule_flush: Callable[[], None], flush: Callable[[], None]) -> None:
        self._schedule_flush = schedule_flush
        self.outbox = Outbox(self._limits, schedule_flush, flush)
        self.session = Session(
            self.outbox,
            lambda _due: None,  # nothing is throttled in this direction
            max_frame_size=self._max_frame_size,
            is_talkative=False,
            on_refused=self._on_refused,
        )
        self.fresh = FreshMessages(self._limits.topic_bytes // 2)
        self.flow_control: FlowControl = FlowControl(self._other_latency)
        self.patience = Patience()
        self._overdue: dict[str, _Question] = {}
        self.waiting: deque[ops.Op] = deque()
        self._num_waiting_bytes = 0
        self._holds: set[object] = set()  # a new set for each socket, so that a late release does not affect it
        self._questions: dict[str, _Question] = {}

    def open(self, schedule_flush: Callable[[], None], flush: Callable[[], None]) -> None:
        """Begin with a new socket.

        Args:
            schedule_flush: called when frames wait to be taken.
            flush: called before messages are dropped: take now as much as the socket accepts.
        """
        self._begin(schedule_flush, flush)
        self.is_open = True

    def shut(self) -> None:
        """Drop everything that was on its way, because the socket is lost."""
        self.is_open = self.is_ready = self.has_services = False
        self._begin(_nothing, _nothing)

    # Out

    def say(self, op: str, **fields: object) -> None:
        """Send an op without a message body; it is never dropped."""
        self.session.say(op, {}, None, **fields)

    def offer(self, topic: str, frame: bytes, now: float, *, is_ordered: bool = False) -> None:
        """Send a topic message, which may be left out if the far side is too slow.

        Args:
            is_ordered: it must not be replaced by a newer one, and leaves before all later ordered frames.
        """
        if is_ordered:
            self.fresh.forget(topic)  # older ones must not come after it
            self.outbox.offer(topic, frame)
            return
        if not self.fresh and not self.outbox:
            self._schedule_flush()
        self.fresh.offer(WaitingMessage(topic, frame, now))

    def forget(self, topic: str) -> None:
        """Drop the messages of a topic that wait, because it is not advertised any more."""
        self.fresh.forget(topic)

    @property
    def num_dropped(self) -> int:
        """Topic messages that were left out since the socket was opened."""
        return self.outbox.dropped.total() + self.fresh.dropped.total()

    def take(self, max_bytes: int, now: float) -> list[bytes]:
        """Remove and return the next frames, ordered ones first; none while the far side is behind.

        Args:
            max_bytes: about how much to return [bytes].
        """
        flow_control = self.flow_control
        frames: list[bytes] = []
        num_bytes = 0
        while num_bytes < max_bytes:
            if flow_control.wants_probe(now):
                frames.append(self._make_probe(now))
            taken = self._take_some(now)
            if not taken:
                break
            frames += taken
            num_bytes += sum(map(len, taken))
        if flow_control.wants_probe(now):
            frames.append(self._make_probe(now))
        return frames

    def _take_some(self, now: float) -> list[bytes]:
        """Remove and return the next frame, or the next pieces of a long one; none if nothing may be sent."""
        flow_control = self.flow_control
        while self.outbox and not flow_control.is_full:
            taken = self.outbox.take(1)  # one frame, because each counts
            for frame in taken:
                flow_control.note_sent(len(frame))
            if taken:
                return taken
        if self.outbox:
            return []
        if not flow_control.has_room:
            if self.fresh:
                flow_control.note_waiting()
            return []
        message = self.fresh.take(now)
        if message is None:
            return []
        flow_control.note_sent(len(message.frame), wait=max(now - message.since, 0.0))
        return [message.frame]

    def _make_probe(self, now: float) -> bytes:
        probe = f"{_PROBE}{self.flow_control.probe(now)}"
        return orjson.dumps({"op": "call_service", "service": PROBE, "id": probe, "args": {}})

    def ask(
        self,
        service: str,
        on_answer: OnReply,
        now: float,
        *,
        on_refusal: Callable[[str], None] = lambda _why: None,
        **args: object,
    ) -> None:
        """Call a service there. If the socket is lost first, `on_answer` is never called.

        Args:
            on_answer: gets the answer; None for a refusal, an invalid answer, or a time-out.
            on_refusal: gets the reason of a refusal, before `on_answer` is called.
        """
        self._num_asked += 1
        question = f"{_QUESTION}{self._num_asked}"
        num_frames = self.flow_control.num_in_flight + len(self.outbox) + 1
        wait = max(self.flow_control.patience, self.patience.wait(num_frames))
        self._questions[question] = _Question(on_answer, on_refusal, service, now, now + wait, num_frames)
        self.say("call_service", id=question, service=service, args=args)

    # In

    def receive(self, frame: bytes, now: float) -> Iterator[ops.Op | None]:
        """Read the ops in a frame. Answers to our own questions are handled here. Never raises.

        Args:
            frame: content of a text or binary frame.

        Yields:
            An op, or None after a slice of work.
        """
        for op in self.session.receive(frame, now):
            yield None if op is None or self._is_own_answer(op, now) else op

    def queue(self, frame: bytes, now: float) -> None:
        """Add the ops of a frame to `waiting`; otherwise as `receive`.

        Args:
            frame: content of a text or binary frame.
        """
        if not self.waiting:
            self._num_waiting_bytes = 0
        self._num_waiting_bytes += len(frame)
        self.waiting += [op for op in self.receive(frame, now) if op is not None]

    def hold(self) -> Callable[[], None]:
        """Let the ops wait until the returned function is called or the socket is lost. Several holds are counted."""
        holds, token = self._holds, object()
        holds.add(token)

        def release() -> None:
            if token in holds:
                holds.remove(token)
                if not holds and holds is self._holds:
                    self.on_released()

        return release

    @property
    def is_held(self) -> bool:
        """True if the waiting ops must not be done now."""
        return bool(self._holds)

    @property
    def is_full(self) -> bool:
        """True if so much waits that the socket should not be read."""
        return bool(self.waiting) and self._num_waiting_bytes > MAX_WAITING_BYTES

    def _is_own_answer(self, op: ops.Op, now: float) -> bool:
        """Handle the answer to one of our questions; return False for any other op."""
        if type(op) is not ops.ServiceResponse or not isinstance(op.id, str):
            return False
        number = op.id.removeprefix(_PROBE)
        if number != op.id:
            if not op.result:
                self.flow_control.note_refusal(now)
            elif _NUMBER.fullmatch(number):
                self.patience.has_answer = True
                self.flow_control.note_answer(int(number), now)
            self._schedule_flush()
            self.on_probe(bool(op.result), now)
            return True
        question = self._questions.pop(op.id, None)
        if question is not None:
            self._measure(question, op, now)
            if question.service == PROBE:
                self.on_probe(bool(op.result), now)
            values = _decoded(op.values)
            if not op.result:
                question.on_refusal(values if isinstance(values, str) else "")
            question.on_answer(values if op.result and isinstance(values, dict) else None, now)
        elif (overdue := self._overdue.pop(op.id, None)) is not None:
            self._measure(overdue, op, now)
        return question is not None or op.id.startswith(_QUESTION)  # perhaps an answer after the time-out

    def _measure(self, question: _Question, op: ops.ServiceResponse, now: float) -> None:
        self.patience.note(max(now - question.asked_at, 0.0), question.num_frames, is_ok=bool(op.result))

    # Time

    @property
    def due(self) -> float | None:
        """Return when `expire` has something to do [s]."""
        dues = [question.until for question in self._questions.values()]
        if self.flow_control.due is not None:
            dues.append(self.flow_control.due)
        return min(dues, default=None)

    def expire(self, now: float) -> None:
        """Give up questions without an answer in time."""
        for name, question in list(self._questions.items()):
            if now < question.until:
                continue
            if self._is_only_slow(question, now):
                question.until = now + PROBE_PATIENCE
            elif self._questions.pop(name, None) is not None:
                self._note_overdue(name, question)
                question.on_answer(None, now)
        if self.flow_control.expire(now):
            self._schedule_flush()

    def _note_overdue(self, name: str, question: _Question) -> None:
        """Remember a question that is given up, because a late answer shows how slow the far side is."""
        if len(self._overdue) >= MAX_OVERDUE:
            del self._overdue[next(iter(self._overdue))]
        self._overdue[name] = question

    def _is_only_slow(self, question: _Question, now: float) -> bool:
        """Return True if the far side answers calls, but has not come to what was sent before a question."""
        if not self.patience.has_answer or now - question.asked_at >= MAX_PATIENCE:
            return False
        return now - question.asked_at < ROUND_TRIPS * self.flow_control.age(now)


def _decoded(values: object) -> object:
    """Return the values of an answer, which may be JSON text; None if it is not valid."""
    if not isinstance(values, (bytes, msgspec.Raw)):
        return values
    try:
        return msgspec.json.decode(values)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None

"""One connection to a rosbridge that we dial: its frames, the questions we asked there, how far it has got.

A `BridgeConnection` outlives its sockets: `open` begins anew on each, `shut` forgets what was on its way over the last
one. It knows the wire and nothing of what goes over it; that is `graph/attach/mirror.py`.

An op from there may take longer than its turn: a scenario is read from a disk. Then the connection is *held*, and the
ops that come meanwhile wait in it. Answers to our own questions do not wait: they say how far the far side has got.

The far side may be any rosbridge. So no remark is ever sent (rosbridge_suite has no such op), no answer is taken for
granted, and what waits to be sent has a bound (`Outbox`) and a brake (`FlowControl`).
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import orjson

from rosbridge_sim.errors import FrameError
from rosbridge_sim.graph.attach.flow_control import FlowControl
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session

__all__ = ["PROBE", "BridgeConnection", "OnReply", "Values"]

PROBE = "/rosapi/get_time"
"""The call whose answer shows how far the far side has got: cheap, and harmless everywhere.

A service that nobody has would do in ROS 1; in ROS 2 rosbridge_suite looks for it for a second before it says so.
"""

PROBE_PATIENCE = 2.0
"""Longest wait for an answer to a question [s]; ROS 2's rosbridge looks for a service for one."""

MAX_WAITING_BYTES = 2**20
"""Frames whose ops may wait in a held connection before its socket is not read any more [bytes]: far more than clients
send while a scenario is read, and little beside what one frame may have."""

_PROBE, _QUESTION = "mark:", "ask:"
"""Beginnings of the ids of our calls: of probes, and of questions."""

_NUMBER = re.compile(r"[0-9]{1,18}")
"""Ends of the ids of probes; an id from elsewhere may have more digits than a number can be read from."""

Values = dict[str, Any]
"""The values of an answer; the asker has to check each."""

OnReply = Callable[[Values | None, float], None]
"""Gets the values of an answer, or None where there are none, and `now`."""


def _nothing() -> None:
    """Do nothing: there is no socket that frames could go to."""


class BridgeConnection:
    """One connection to the far side, which may have no socket.

    Attributes:
        name: what tells it from others to the same far side; empty for the first.
        is_open: there is a socket.
        is_ready: the far side has handled all that it was told at the beginning.
        has_services: services were announced on this socket.
        session: what this socket's frames are read and written by.
        outbox: what waits for the socket.
        flow_control: how much may be on its way.
        num_sent: messages of topics that went into the outbox, ever.
        waiting: ops that have come and are not done yet, oldest first.
        on_released: called when the last hold has ended.
        on_probe: called with whether a call of PROBE was answered or refused, and monotonic time [s]; silence is
            neither.
    """

    def __init__(
        self, name: str, limits: OutboxLimits, max_frame_size: int, on_refused: Callable[[FrameError], None]
    ) -> None:
        """A connection without a socket.

        Args:
            name: see above.
            limits: of what waits for the socket.
            max_frame_size: longest frame that pieces may make [characters].
            on_refused: hears of what came and is no op.
        """
        self.name = name
        self.is_open = False
        self.is_ready = False
        self.has_services = False
        self.num_sent = 0
        self.on_released: Callable[[], None] = _nothing
        self.on_probe: Callable[[bool, float], None] = lambda _is_answered, _now: None
        self._limits = limits
        self._max_frame_size = max_frame_size
        self._on_refused = on_refused
        self._num_asked = 0
        self._begin(_nothing, _nothing)

    def _begin(self, schedule_flush: Callable[[], None], flush: Callable[[], None]) -> None:
        self._schedule_flush = schedule_flush
        self.outbox = Outbox(self._limits, schedule_flush, flush)
        self.session = Session(
            self.outbox,
            lambda _due: None,  # nothing is throttled on the way there
            max_frame_size=self._max_frame_size,
            is_talkative=False,
            on_refused=self._on_refused,
        )
        self.flow_control = FlowControl()
        self.waiting: deque[ops.Op] = deque()
        self._num_waiting_bytes = 0
        self._holds: set[object] = set()  # one of its own for each socket: a late release frees no later one
        self._questions: dict[str, tuple[OnReply, float, str]] = {}

    def open(self, schedule_flush: Callable[[], None], flush: Callable[[], None]) -> None:
        """There is a socket.

        Args:
            schedule_flush: called when something waits to be taken.
            flush: called before anything is forgotten: take now, as much as the socket takes.
        """
        self._begin(schedule_flush, flush)
        self.is_open = True

    def shut(self) -> None:
        """The socket is gone, and with it all that was on its way."""
        self.is_open = self.is_ready = self.has_services = False
        self._begin(_nothing, _nothing)

    # Out

    def say(self, op: str, **fields: object) -> None:
        """Send an op without a message in it; it is never forgotten."""
        self.session.say(op, {}, None, **fields)

    def offer(self, topic: str, frame: bytes) -> None:
        """Send a message of a topic, which may be forgotten if the far side does not keep up."""
        self.num_sent += 1
        self.outbox.offer(topic, frame)

    def take(self, max_bytes: int, now: float) -> list[bytes]:
        """The frames whose turn it is, oldest first, about so many bytes; none while the far side is behind."""
        flow_control = self.flow_control
        if flow_control.wants_probe:  # after an answer that proved less than was sent meanwhile
            return [self._make_probe(now)]
        if flow_control.is_blocked:
            return []
        frames = self.outbox.take(max_bytes)
        flow_control.note_sent(frames)
        if flow_control.wants_probe:
            frames.append(self._make_probe(now))
        return frames

    def _make_probe(self, now: float) -> bytes:
        probe = f"{_PROBE}{self.flow_control.probe(now)}"
        return orjson.dumps({"op": "call_service", "service": PROBE, "id": probe, "args": {}})

    def ask(self, service: str, on_answer: OnReply, now: float, **args: object) -> None:
        """Call a service there. `on_answer` gets the answer, or None for a refusal, rubbish, or none in time.

        If the socket is lost before, it is never called.
        """
        self._num_asked += 1
        question = f"{_QUESTION}{self._num_asked}"
        self._questions[question] = (on_answer, now + PROBE_PATIENCE, service)
        self.say("call_service", id=question, service=service, args=args)

    # In

    def receive(self, frame: bytes, now: float) -> Iterator[ops.Op | None]:
        """The ops in a frame, but for the answers to our own questions, which are heard here. Never raises.

        Yields:
            An op, or None after a slice of work without one.
        """
        for op in self.session.receive(frame, now):
            yield None if op is None or self._is_own_answer(op, now) else op

    def queue(self, frame: bytes, now: float) -> None:
        """Have the ops in a frame wait for their turn, behind those that came before; otherwise as `receive`."""
        if not self.waiting:
            self._num_waiting_bytes = 0
        self._num_waiting_bytes += len(frame)
        self.waiting += [op for op in self.receive(frame, now) if op is not None]

    def hold(self) -> Callable[[], None]:
        """Have the ops wait until the returned function is called, or the socket is lost. Several holds count."""
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
        """Return whether the ops that wait are not to be done now."""
        return bool(self._holds)

    @property
    def is_full(self) -> bool:
        """Return whether so much waits that nothing more should be read from the socket."""
        return bool(self.waiting) and self._num_waiting_bytes > MAX_WAITING_BYTES

    def _is_own_answer(self, op: ops.Op, now: float) -> bool:
        """Return whether an op is the answer to a question of ours; it is handled then."""
        if type(op) is not ops.ServiceResponse or not isinstance(op.id, str):
            return False
        number = op.id.removeprefix(_PROBE)
        if number != op.id:
            if not op.result:
                self.flow_control.note_refusal(now)
            elif _NUMBER.fullmatch(number):
                self.flow_control.note_answer(int(number))
            self._schedule_flush()
            self.on_probe(bool(op.result), now)
            return True
        question = self._questions.pop(op.id, None)
        if question is not None:
            on_answer, _, service = question
            if service == PROBE:
                self.on_probe(bool(op.result), now)
            on_answer(_values_of(op), now)
        return question is not None or op.id.startswith(_QUESTION)  # perhaps one that came too late

    # Time

    @property
    def due(self) -> float | None:
        """Return when `expire` has something to do [s]."""
        dues = [until for _, until, _ in self._questions.values()]
        if self.flow_control.due is not None:
            dues.append(self.flow_control.due)
        return min(dues, default=None)

    def expire(self, now: float) -> None:
        """Give up what was not answered in time."""
        for question, (on_answer, until, _) in list(self._questions.items()):
            if now >= until and self._questions.pop(question, None) is not None:
                on_answer(None, now)
        if self.flow_control.expire(now):
            self._schedule_flush()


def _values_of(op: ops.ServiceResponse) -> Values | None:
    if not op.result:
        return None
    if not isinstance(op.values, (bytes, msgspec.Raw)):
        return op.values if isinstance(op.values, dict) else None
    try:
        values = msgspec.json.decode(op.values)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return values if isinstance(values, dict) else None

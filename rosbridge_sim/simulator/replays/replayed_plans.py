"""The publisher of the plans in a recording, beside the motion that the replay shows.

It is a participant of its own, and not the simulator, because viewers draw what programs publish. A topic that somebody
publishes here already is left to them: the simulator's own topics, and those of a program that plans anew.

A message is decoded only if somebody listens. A few bytes are decoded at once; more of them by the `Reader`, in parts,
so that nobody else waits. In synchronous mode the gate behind the frame stays closed until they are out. In real time
the replay goes on meanwhile; where new messages of a topic are due before the last ones had their turn, those are left
out.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rosbridge_sim.errors import DocumentError, PeerError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import is_allowed
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.plain_values import without_unknown
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recorded_plans import RecordedPlan
from rosbridge_sim.simulator.replays.state_machine import ReplayState

LONGEST_NS: Final = 1_000_000_000
"""A longer way from one position to the next is a jump [ns]: then the last message of each topic is shown alone."""

AT_ONCE: Final = 8_000
"""Bytes that are decoded at once: 3 ms. To have a thread do it would delay them by as much."""

BATCH_BYTES, BATCH_MESSAGES = 200_000, 100
"""Size of a part: a tenth of a second of the thread, and 5 ms of the loop to publish it. It may have one longer
message."""

_log = logging.getLogger("rosbridge_sim.replay")
_bus_log = logging.getLogger("rosbridge_sim.bus")


@dataclass(eq=False, slots=True)
class _ShownPlan:
    """A topic of the recording that is on the bus.

    Attributes:
        is_heard: its listeners have what was due up to the position that was shown last, or it waits for its turn.
        has_warned: the log has a message that was left out.
    """

    plan: RecordedPlan
    topic: Topic
    is_heard: bool = False
    has_warned: bool = False


_Batch = Sequence[tuple[_ShownPlan, bytes]]


class ReplayedPlans:
    """Publisher of recorded plans; the world does not know of it, and neither do snapshots."""

    def __init__(self, process: ReplayProcess) -> None:
        """Publish nothing yet.

        Args:
            process: whether a recording moves the world.
        """
        self._process, self._context, self._playback = process, process.context, process.playback
        self._publisher = GuestPublisher(self._context.bus)
        self._recording = Recording("")
        self._shown: dict[str, _ShownPlan] = {}
        self._shown_ns = -LONGEST_NS
        self._waiting: dict[_ShownPlan, deque[bytes]] = {}
        self._is_decoding = self._is_going_on = self._is_for_newcomer = False
        self._now = 0.0
        self._context.bus.on_topic.append(self._note_subscriber)

    def settle(self, now: float) -> None:
        """Publish what belongs to the position that the world shows; called after each frame and each command."""
        self._now = now
        is_shown = self._process.state in {ReplayState.REPLAYING, ReplayState.AT_END}
        recording = self._playback.recording if is_shown else Recording("")
        if recording.plans != self._recording.plans:
            self._begin(recording, now)
        if not self._shown:
            return
        position = self._playback.shown_ns
        is_jump = not 0 <= position - self._shown_ns < LONGEST_NS
        for shown in self._shown.values():
            if not shown.topic.has_listener:
                shown.is_heard = False
                self._waiting.pop(shown, None)
                continue
            is_new = is_jump or not shown.is_heard
            raws = shown.plan.last(position) if is_new else shown.plan.between(self._shown_ns, position)
            shown.is_heard = True
            if raws:
                self._waiting[shown] = deque(raws)  # those that wait are older: there are none in synchronous mode
        self._shown_ns = position
        self._go_on(now)

    def _begin(self, recording: Recording, now: float) -> None:
        """Take another recording: withdraw the topics of the last one, and offer those of this one."""
        self._publisher.leave(now)
        self._recording, self._shown_ns = recording, -LONGEST_NS
        self._shown.clear()
        self._waiting.clear()
        for plan in recording.plans:
            topic = self._publisher.offer(plan.topic, plan.type_name)
            if topic is not None:
                self._shown[topic.name] = _ShownPlan(plan, topic)

    def _note_subscriber(self, topic: Topic) -> None:
        """Give a new subscriber the last message, if nobody listened when it was due: a replay may be held."""
        shown = self._shown.get(topic.name)
        if shown is None or shown.topic is not topic or shown.is_heard or not topic.has_listener:
            return
        topic.forget_messages_of(self._publisher)  # an older one
        shown.is_heard = True
        raws = shown.plan.last(self._shown_ns)
        if raws:
            self._waiting[shown] = deque(raws)
            self._is_for_newcomer = True
            try:
                self._go_on(self._now)
            finally:
                self._is_for_newcomer = False

    # What waits

    def _go_on(self, now: float) -> None:
        """Publish what waits: a little at once, more in parts that the reader decodes."""
        if self._is_going_on:  # the reader of a part has no thread, so this is called within the loop below
            return
        self._is_going_on = True
        try:
            while self._waiting and not self._is_decoding:
                batch = self._take_batch()
                if not self._waiting and sum(len(raw) for _, raw in batch) <= AT_ONCE:
                    self._publish([self._decode(*each) for each in batch], now)
                else:
                    self._read(batch, now)
        finally:
            self._is_going_on = False

    def _take_batch(self) -> _Batch:
        """Take the next part from what waits; each topic has its turn."""
        batch: list[tuple[_ShownPlan, bytes]] = []
        num_bytes = 0
        while self._waiting and num_bytes < BATCH_BYTES and len(batch) < BATCH_MESSAGES:
            shown = next(iter(self._waiting))
            raws = self._waiting[shown]
            batch.append((shown, raws.popleft()))
            num_bytes += len(batch[-1][1])
            if not raws:
                del self._waiting[shown]
        return batch

    def _read(self, batch: _Batch, now: float) -> None:
        """Have a part decoded, and publish it then."""
        context, recording = self._context, self._recording
        is_tick = not context.sync.is_free or context.command_wait.is_on

        def work() -> list[tuple[_ShownPlan, Message | PeerError | DocumentError]]:
            return [self._decode(*each, is_for_json=True) for each in batch]

        def then(
            outcome: list[tuple[_ShownPlan, Message | PeerError | DocumentError]] | DocumentError, now: float
        ) -> None:
            self._is_decoding = False
            try:
                if isinstance(outcome, DocumentError):
                    _log.warning("%d messages of plans in the recording are left out: %s", len(batch), outcome)
                elif recording is self._recording:
                    self._publish(outcome, now)
                self._go_on(now)
            finally:
                if is_tick:
                    context.gate.open(now)

        self._is_decoding = True
        if is_tick:
            context.gate.close()
        self._context.reader.read(work, then, now)

    def _decode(
        self, shown: _ShownPlan, raw: bytes, *, is_for_json: bool = False
    ) -> tuple[_ShownPlan, Message | PeerError | DocumentError]:
        """Return a message, or why it is none; this may be called in any thread.

        Args:
            raw: its bytes.
            is_for_json: have its JSON text made as well.
        """
        try:
            message = self._publisher.make(shown.plan.type_name, shown.plan.decode(raw))
            if is_for_json:
                message.json  # noqa: B018 - it is kept
        except (PeerError, DocumentError) as error:
            return shown, error
        return shown, message

    def _publish(self, decoded: Sequence[tuple[_ShownPlan, Message | PeerError | DocumentError]], now: float) -> None:
        for shown, message in decoded:
            if not isinstance(message, Message):
                if not shown.has_warned:
                    text = "a message of %s in the recording is left out, and others like it: %s"
                    _log.warning(text, shown.plan.topic, message)
                shown.has_warned = True
            elif self._is_for_newcomer:  # who is being subscribed gets what is kept
                shown.topic.keep(self._publisher, message, None)
            else:
                self._context.bus.announce(self._publisher, shown.topic, message, now)


def without_denied_plans(recording: Recording, caller: Participant) -> Recording:
    """Return a recording without the plans that the caller may not publish; a remark says so."""
    plans = recording.plans
    denied = [plan for plan in plans if not is_allowed(caller.check_publish, plan.topic, plan.type_name)]
    if not denied:
        return recording
    return recording.without_plans(
        denied, f"{len(denied)} topics with plans are left out: not allowed to publish there"
    )


class GuestPublisher(Participant):
    """A participant with topics of its own.

    A topic that somebody publishes already is left to them.

    Attributes:
        name: the node name that rosapi shows.
    """

    name = "/replay"

    def __init__(self, bus: Bus) -> None:
        """Offer nothing yet."""
        self._bus = bus

    def notify(self, level: str, text: str) -> None:
        """Write a message from the bus into the log."""
        _bus_log.debug("%s: %s: %s", self.name, level, text)

    def offer(self, name: str, type_name: str) -> Topic | None:
        """Begin to publish a topic.

        Args:
            name: the topic's.

        Returns:
            The topic; None where it has a publisher already, or cannot have the type. The log says so.
        """
        try:
            known = self._bus.find_topic(name)
            if known is not None and known.publishers:
                _bus_log.info("%s: %s is left out: it has a publisher here", self.name, name)
                return None
            return self._bus.advertise(self, name, type_name, depth=1)  # a viewer may come while a replay is held
        except PeerError as error:
            _bus_log.warning("%s: %s is left out: %s", self.name, name, error)
            return None

    def make(self, type_name: str, value: object) -> Message:
        """Return a message; this may be called in any thread.

        Args:
            type_name: of the topic.
            value: plain objects; fields that the type does not have are left out.

        Raises:
            PeerError: it does not fit the type.
        """
        message_type = self._bus.store.message(type_name)
        return Message(message_type, message_type.check(without_unknown(value, message_type.spec), 0))

    def leave(self, now: float) -> None:
        """Publish none of the topics any more."""
        self._bus.leave(self, now)

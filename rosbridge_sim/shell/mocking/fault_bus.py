"""The bus of a mock: between it and each WebSocket client stand the faults of the wire.

The faults are judged once for each message, so all clients see the same. A connection keeps the order of a topic's
messages: one that is delayed delays those behind it.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from rosbridge_sim.errors import PeerError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.topics_services import Answer, Deliver, OnAnswer, Subscription, Topic
from rosbridge_sim.mock.faults import FaultEffect, FaultTable, changed
from rosbridge_sim.protocol.ops import OpBody
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.clocks.wall_clock import WallClockBus

MAX_LATE_BYTES: Final = 64_000_000
"""Most bytes of delayed messages; those beyond are dropped: without the oldest ones, none would ever come."""


class FaultBus(WallClockBus):
    """A bus whose WebSocket clients are subject to faults.

    Attributes:
        faults: what happens to messages and calls.
        is_spared: whether a client came through the control port.
        now_ns: returns the time of the mock for a time of the loop.
        num_late_bytes: size of all delayed messages [bytes].
    """

    def __init__(self, store: Store, **options: Any) -> None:  # noqa: ANN401 - those of the bus
        super().__init__(store, **options)
        self.faults = FaultTable({}, 0)
        self.is_spared: Callable[[Participant], bool] = lambda _owner: False
        self.now_ns: Callable[[float], int] = lambda _now: 0
        self.num_late_bytes = 0
        self._judged: tuple[int, FaultEffect | None] = (-1, None)
        self._changed: tuple[Message, str, Message] | None = None
        self._plain_subscribe, self._plain_call = self.subscribe, self.call
        self.subscribe, self.call = self._subscribe, self._call  # with faults before them

    def _subscribe(self, owner: Participant, name: str, deliver: Deliver, **options: Any) -> Subscription:  # noqa: ANN401 - as above
        if isinstance(owner, Peer) and not self.is_spared(owner):
            deliver = _FaultyWire(self, owner, deliver).take
        return self._plain_subscribe(owner, name, deliver, **options)

    def judge(self, topic: str, now: float) -> FaultEffect | None:
        """Return what happens to the message that is being published; the same for all clients."""
        number, verdict = self._judged
        if number != self.delivery.num_published:
            verdict = self.faults.judge(topic, self.now_ns(now))
            self._judged = self.delivery.num_published, verdict
        return verdict

    def changed(self, message: Message, change: str) -> Message:
        """Return the changed message, made once for all clients."""
        if self._changed is None or self._changed[0] is not message or self._changed[1] != change:
            self._changed = message, change, changed(message, change)
        return self._changed[2]

    def _call(self, caller: Participant, name: str, args: OpBody, on_answer: OnAnswer, **options: Any) -> None:  # noqa: ANN401 - as above
        now: float = options["now"]
        verdict = None
        if isinstance(caller, Peer) and self.faults.rules and not self.is_spared(caller):
            verdict = self.faults.judge(name if name.startswith("/") else f"/{name}", self.now_ns(now), is_call=True)
        if verdict is None:
            self._plain_call(caller, name, args, on_answer, **options)
            return

        def answer_late(answer: Answer) -> None:
            if verdict.delay:
                asyncio.get_running_loop().call_later(verdict.delay, self._answer, caller, on_answer, answer)
            else:
                on_answer(answer)

        if verdict.fail is not None:
            answer_late(Answer(is_ok=False, values=verdict.fail))
        else:
            self._plain_call(caller, name, args, answer_late, **options)

    def _answer(self, caller: Participant, on_answer: OnAnswer, answer: Answer) -> None:
        """Give a late answer to a caller that is still there."""
        if caller in self.accounts:
            on_answer(answer)


class _FaultyWire:
    """The way of one topic's messages to one client."""

    def __init__(self, bus: FaultBus, owner: Peer, deliver: Deliver) -> None:
        self._bus, self._owner, self._deliver = bus, owner, deliver
        self._late: deque[tuple[float, Topic, Message, Participant]] = deque()
        self._timer: asyncio.TimerHandle | None = None
        self._last: Message | None = None

    def take(self, topic: Topic, message: Message, sender: Participant, now: float) -> None:
        """Deliver a message, as the faults want it."""
        verdict = self._bus.judge(topic.name, now)
        if verdict is None:
            if not self._late:
                self._last = message
                self._deliver(topic, message, sender, now)
                return
            verdict = FaultEffect()
        if not verdict.is_frozen or self._last is None:
            self._last = message
        message = self._last
        if verdict.change:
            message = self._bus.changed(message, verdict.change)
        for _ in range(verdict.num_copies):
            if verdict.delay or self._late:
                self._delay(verdict.delay, topic, message, sender, now)
            else:
                self._send(topic, message, sender, now)

    def _send(self, topic: Topic, message: Message, sender: Participant, now: float) -> None:
        try:
            self._deliver(topic, message, sender, now)
        except PeerError:
            if message is self._last:
                raise
            # a changed message that the client's encoding cannot hold is lost

    def _delay(self, delay: float, topic: Topic, message: Message, sender: Participant, now: float) -> None:
        if self._bus.num_late_bytes + message.num_bytes > MAX_LATE_BYTES:
            return
        due = max(now + delay, self._late[-1][0] if self._late else 0.0)
        self._late.append((due, topic, message, sender))
        self._bus.num_late_bytes += message.num_bytes
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_at(self._late[0][0], self._flush)

    def _flush(self) -> None:
        """Deliver what is due, or drop everything if the client has left."""
        loop = asyncio.get_running_loop()
        self._timer = None
        now = loop.time()
        while self._late and (self._late[0][0] <= now or self._owner not in self._bus.accounts):
            _, topic, message, sender = self._late.popleft()
            self._bus.num_late_bytes -= message.num_bytes
            if self._owner in self._bus.accounts:
                try:
                    self._send(topic, message, sender, now)
                except PeerError:
                    continue  # as `announce` would log: the client cannot have it
                except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
                    self._bus.guard.blame(self._owner, error)
        if self._late:
            self._timer = loop.call_at(self._late[0][0], self._flush)

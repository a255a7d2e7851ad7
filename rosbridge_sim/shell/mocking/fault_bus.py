"""The bus of a mock: between it and each WebSocket client stand the faults of the wire.

Faults of all clients are judged once for each message, so all clients see the same. A connection keeps the order of a
topic's messages: one that is delayed delays those behind it.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.participant import Participant, size_of_body
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.topics_services import Answer, Deliver, OnAnswer, Subscription, Topic
from rosbridge_sim.mock.faults import NO_EFFECT, FaultEffect, FaultTable, FaultyClient, changed
from rosbridge_sim.mock.mock_model import FaultWay
from rosbridge_sim.protocol.ops import OpBody
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.clocks.wall_clock import WallClockBus

MAX_LATE_BYTES: Final = 64_000_000
"""Most bytes of delayed messages, calls and answers. Messages beyond are dropped: without the oldest ones, none would
ever come. Calls beyond are refused."""

CALL_BYTES: Final = 1_000
"""Least size that a delayed call or answer counts with: its objects [bytes]."""

MESSAGE_BYTES: Final = 400
"""The same of a delayed message: an empty one takes that much, too."""


class FaultBus(WallClockBus):
    """A bus whose WebSocket clients are subject to faults.

    Attributes:
        faults: what happens to messages and calls.
        find_client: returns the number and address of a client; None for one that faults spare, as on the control port.
        now_ns: returns the time of the mock for a time of the loop.
        num_late_bytes: size of everything that is delayed [bytes].
    """

    def __init__(self, store: Store, **options: Any) -> None:  # noqa: ANN401 - those of the bus
        super().__init__(store, **options)
        self.faults = FaultTable({}, 0)
        self.find_client: Callable[[Peer], FaultyClient | None] = lambda _peer: None
        self.now_ns: Callable[[float], int] = lambda _now: 0
        self.num_late_bytes = 0
        self._wires: dict[Participant, _ClientWires | None] = {}
        self._judged: tuple[int, FaultEffect | None] = (-1, None)
        self._changed: tuple[Message, str, Message] | None = None
        self._plain_subscribe, self._plain_call, self._plain_publish = self.subscribe, self.call, self.publish
        self.subscribe, self.call, self.publish = self._subscribe, self._call, self._publish  # with faults before them

    def leave(self, owner: Participant, now: float) -> None:
        """Remove everything of an owner; see `Bus.leave`."""
        super().leave(owner, now)
        self._wires.pop(owner, None)

    def _wires_of(self, owner: Participant) -> _ClientWires | None:
        """Return the wires of a client; None for a participant that faults spare."""
        if not isinstance(owner, Peer):
            return None
        if owner not in self._wires:
            client = self.find_client(owner)
            self._wires[owner] = None if client is None else _ClientWires(self, owner, client)
        return self._wires[owner]

    def _subscribe(self, owner: Participant, name: str, deliver: Deliver, **options: Any) -> Subscription:  # noqa: ANN401 - as above
        wires = self._wires_of(owner)
        if wires is not None:
            deliver = _FaultyWire(wires, deliver, "message").take
        return self._plain_subscribe(owner, name, deliver, **options)

    def _publish(self, sender: Participant, topic: Topic, message: Message, now: float) -> None:
        wires = self._wires_of(sender) if self.faults.rules or self.num_late_bytes else None
        if wires is None:
            self._plain_publish(sender, topic, message, now)
        else:
            wires.of_topic(topic.name).take(topic, message, sender, now)

    def deliver_published(self, topic: Topic, message: Message, sender: Participant, now: float) -> None:
        """Publish a message of a client that faults have let through, if the client still publishes there."""
        if sender in topic.publishers:
            self._plain_publish(sender, topic, message, now)

    def judge(self, client: FaultyClient, name: str, way: FaultWay, now: float) -> FaultEffect | None:
        """Return what happens to a message or a call. A fault of all clients does the same to each of them."""
        if not self.faults.rules:
            return None
        now_ns = self.now_ns(now)
        number, verdict = self._judged
        if way != "message":
            verdict = self.faults.judge(name, now_ns, way)
        elif number != self.delivery.num_published:
            verdict = self.faults.judge(name, now_ns, way)
            self._judged = self.delivery.num_published, verdict
        own = self.faults.judge(name, now_ns, way, client)
        return own if verdict is None else verdict if own is None else verdict.joined(own)

    def changed(self, message: Message, change: str) -> Message:
        """Return the changed message, made once for all clients."""
        if self._changed is None or self._changed[0] is not message or self._changed[1] != change:
            self._changed = message, change, changed(message, change)
        return self._changed[2]

    # Calls

    def _call(self, caller: Participant, name: str, args: OpBody, on_answer: OnAnswer, **options: Any) -> None:  # noqa: ANN401 - as above
        wires = self._wires_of(caller) if self.faults.rules else None
        absolute = name if name.startswith("/") else f"/{name}"
        verdict = None if wires is None else self.judge(wires.client, absolute, "call", options["now"])
        if verdict is None:
            self._plain_call(caller, name, args, on_answer, **options)
            return

        def answer(answer: Answer) -> None:
            values = answer.values
            num_bytes = values.num_bytes if isinstance(values, Message) else size_of_body(values, values)
            self._later(verdict.answer_delay, caller, num_bytes, partial(on_answer, answer), on_answer)

        def call(now: float) -> None:
            if verdict.fail is not None:
                answer(Answer(is_ok=False, values=verdict.fail))
            elif verdict.num_copies:
                self._plain_call(caller, name, args, answer, **{**options, "now": now})

        if not verdict.delay:
            call(options["now"])
            return
        loop = asyncio.get_running_loop()
        self._later(verdict.delay, caller, size_of_body(args, args), lambda: call(loop.time()), on_answer)

    def _later(
        self, delay: float, caller: Participant, num_bytes: int, work: Callable[[], None], on_answer: OnAnswer
    ) -> None:
        """Do a part of a call after a delay, unless the caller has left by then.

        Args:
            delay: [s]; 0 does it now.
            num_bytes: size of what is held so long.
            on_answer: gets the refusal if too much is delayed already.
        """
        if not delay:
            work()
            return
        num_bytes = max(CALL_BYTES, num_bytes)
        if self.num_late_bytes + num_bytes > MAX_LATE_BYTES:
            on_answer(Answer(is_ok=False, values="The faults of the mock delay too much already"))
            return
        self.num_late_bytes += num_bytes

        def finish() -> None:
            self.num_late_bytes -= num_bytes
            if caller in self.accounts:
                try:
                    work()
                except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
                    self.guard.blame(caller, error)

        asyncio.get_running_loop().call_later(delay, finish)


class _ClientWires:
    """One client, and the ways of the messages that it publishes."""

    def __init__(self, bus: FaultBus, owner: Peer, client: FaultyClient) -> None:
        self.bus, self.owner, self.client = bus, owner, client
        self._by_topic: dict[str, _FaultyWire] = {}

    def of_topic(self, name: str) -> _FaultyWire:
        """Return the way of a topic's messages from the client.

        Raises:
            GraphError: messages of as many topics are delayed as the client may hold at once.
        """
        wire = self._by_topic.get(name)
        if wire is None:
            limit = self.owner.policy.max_held
            if len(self._by_topic) >= limit:
                self._by_topic = {each: kept for each, kept in self._by_topic.items() if kept.is_delaying}
            if len(self._by_topic) >= limit:
                text = f"{name}: faults of the mock delay messages of {limit} other topics of this client already"
                raise GraphError(text, reason=Reason.TOO_MUCH)
            wire = self._by_topic[name] = _FaultyWire(self, self.bus.deliver_published, "publish")
        return wire


class _FaultyWire:
    """The way of one topic's messages to or from one client."""

    def __init__(self, wires: _ClientWires, deliver: Deliver, way: FaultWay) -> None:
        self._wires, self._bus, self._owner = wires, wires.bus, wires.owner
        self._deliver, self._way = deliver, way
        self._late: deque[tuple[float, Topic, Message, Participant]] = deque()
        self._timer: asyncio.TimerHandle | None = None
        self._last: Message | None = None

    @property
    def is_delaying(self) -> bool:
        """True while messages wait."""
        return bool(self._late)

    def take(self, topic: Topic, message: Message, sender: Participant, now: float) -> None:
        """Deliver a message, as the faults want it.

        Raises:
            PeerError: the faults refuse it, or a subscriber does.
        """
        verdict = self._bus.judge(self._wires.client, topic.name, self._way, now)
        if verdict is None:
            if not self._late:
                self._last = message
                self._deliver(topic, message, sender, now)
                return
            verdict = NO_EFFECT
        if verdict.fail is not None:
            raise GraphError(verdict.fail, reason=Reason.REFUSED)
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
        num_bytes = max(MESSAGE_BYTES, message.num_bytes)
        if self._bus.num_late_bytes + num_bytes > MAX_LATE_BYTES:
            return
        due = max(now + delay, self._late[-1][0] if self._late else 0.0)
        self._late.append((due, topic, message, sender))
        self._bus.num_late_bytes += num_bytes
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_at(self._late[0][0], self._flush)

    def _flush(self) -> None:
        """Deliver what is due, or drop everything if the client has left."""
        loop = asyncio.get_running_loop()
        self._timer = None
        now = loop.time()
        while self._late and (self._late[0][0] <= now or self._owner not in self._bus.accounts):
            _, topic, message, sender = self._late.popleft()
            self._bus.num_late_bytes -= max(MESSAGE_BYTES, message.num_bytes)
            if self._owner in self._bus.accounts:
                try:
                    self._send(topic, message, sender, now)
                except PeerError as error:
                    if self._way == "publish":
                        self._owner.notify("error", str(error))
                    # else as `announce` would log: the client cannot have it
                except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
                    self._bus.guard.blame(self._owner, error)
        if self._late:
            self._timer = loop.call_at(self._late[0][0], self._flush)

"""A bridge that is slow, with each frame or each byte: how old the data is there, in simulated time."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator
from statistics import median

import pytest

from rosbridge_sim.graph.attach.connection import BridgeConnection
from rosbridge_sim.graph.attach.flow_control import MAX_IN_AIR
from rosbridge_sim.graph.attach.fresh_messages import FreshMessages, WaitingMessage
from rosbridge_sim.protocol.outbox import OutboxLimits

FRAME_TIME = 0.02
"""Time between two messages of a topic [s]."""


class SlowBridge:
    """A bridge that handles one frame after another, each in the same time, with a rosapi that answers later.

    Attributes:
        ages: topic -> age of each message when it was handled [s].
    """

    def __init__(self, work: float, rosapi: float = 0.0) -> None:
        self.connection = BridgeConnection("", OutboxLimits(), 10_000, lambda _error: None)
        self.connection.open(lambda: None, lambda: None)
        self.ages: dict[str, list[float]] = {}
        self._work = work
        self._rosapi = rosapi
        self._answers: deque[tuple[float, bytes]] = deque()
        self._queue: deque[tuple[float, bytes]] = deque()
        self._free_at = 0.0

    def run(self, sizes: dict[str, int], seconds: float) -> None:
        for step in range(round(seconds * 1_000)):
            now = step / 1_000
            if step % round(FRAME_TIME * 1_000) == 0:
                for topic, size in sizes.items():
                    text = json.dumps({"op": "publish", "topic": topic, "at": now, "x": "x" * size})
                    self.connection.offer(topic, text.encode(), now)
            self.connection.expire(now)
            while frames := self.connection.take(8_192, now):
                self._queue += [(now, frame) for frame in frames]
            self._handle(now)

    def _handle(self, now: float) -> None:
        while self._queue and max(self._free_at, self._queue[0][0]) + self._work <= now:
            arrived, frame = self._queue.popleft()
            self._free_at = max(self._free_at, arrived) + self._work
            op = json.loads(frame)
            if op["op"] == "publish":
                self.ages.setdefault(op["topic"], []).append(self._free_at - op["at"])
            else:
                self._answers.append((self._free_at + self._rosapi, answer_to(op)))
        while self._answers and self._answers[0][0] <= now:
            list(self.connection.receive(self._answers.popleft()[1], now))


def answer_to(op: dict[str, object]) -> bytes:
    answer = {"op": "service_response", "service": "", "id": op["id"], "values": {}, "result": True}
    return json.dumps(answer).encode()


class CheckingBridge:
    """A bridge on a part of a core, whose one thread for all sockets checks that texts are UTF-8, as rosbridge_suite.

    Each turn reads up to CHUNK of each socket and checks it. The thread of each socket then does whole messages, for at
    most SLICE before the others have a turn.

    Attributes:
        ages: topic -> age of each message when it was handled [s].
    """

    CHECK = 0.12e-6
    """Time for a byte, by autobahn 22.7 with wsaccel 0.6.4 [s]."""
    CHUNK = 65_536
    SLICE = 0.005
    MESSAGE, CALL = 0.000_28, 0.003

    def __init__(self, speed: float, *, has_bulk: bool) -> None:
        first = BridgeConnection("", OutboxLimits(), 10_000, lambda _error: None)
        bulk = BridgeConnection("bulk", OutboxLimits(), 10_000, lambda _error: None, beside=first)
        self._connections = {first: deque[bytes](), bulk: deque[bytes]()} if has_bulk else {first: deque[bytes]()}
        for connection in self._connections:
            connection.open(lambda: None, lambda: None)
        self.large = bulk if has_bulk else first
        self.small = first
        self.ages: dict[str, list[float]] = {}
        self._speed = speed
        self._work = self._turns()
        self._now = 0.0

    def run(self, sizes: dict[str, tuple[float, int]], seconds: float) -> None:
        """Publish topics of such periods [s] and sizes [bytes]."""
        due = dict.fromkeys(sizes, 0.0)
        spent = 0.0
        for step in range(round(seconds * 1_000)):
            now = self._now = step / 1_000
            for topic, (period, size) in sizes.items():
                if now >= due[topic]:
                    due[topic] += period
                    head = json.dumps({"op": "publish", "topic": topic, "at": now}).encode()
                    connection = self.large if size > 50_000 else self.small
                    connection.offer(topic, head + b" " * size, now)
            for connection, socket in self._connections.items():
                connection.expire(now)
                while frames := connection.take(8_192, now):
                    socket.extend(frames)
            while spent < now * self._speed:
                spent += next(self._work)
            if not any(self._connections.values()):
                spent = max(spent, now * self._speed)

    def _turns(self) -> Iterator[float]:
        """Do the work of the bridge, and yield the time of each piece of it [s]."""
        checked = dict.fromkeys(self._connections, 0)
        whole: dict[BridgeConnection, deque[bytes]] = {connection: deque() for connection in self._connections}
        while True:
            yield 0.000_01
            for connection, socket in self._connections.items():
                room = self.CHUNK
                while socket and room:
                    part = min(room, len(socket[0]) - checked[connection])
                    checked[connection] += part
                    room -= part
                    if checked[connection] == len(socket[0]):
                        whole[connection].append(socket.popleft())
                        checked[connection] = 0
                yield (self.CHUNK - room) * self.CHECK
            for connection, frames in whole.items():
                left = self.SLICE
                while frames and left > 0:
                    op = json.loads(frames.popleft())
                    is_call = op["op"] != "publish"
                    yield self.CALL if is_call else self.MESSAGE
                    left -= self.CALL if is_call else self.MESSAGE
                    if is_call:
                        list(connection.receive(answer_to(op), self._now))
                    else:
                        self.ages.setdefault(op["topic"], []).append(self._now - op["at"])


MEASURED = {f"/small{i}": (FRAME_TIME, 100 + 100 * i) for i in range(12)} | {
    "/lidar3D": (0.1, 570_000),
    "/image_jpeg/compressed": (1 / 15, 100_000),
}
"""Period [s] and size [bytes] of topics, about those of MORAI's teaching sensors."""


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_small_topics_keep_their_rate_beside_clouds_at_half_a_core(speed: float) -> None:
    bridge = CheckingBridge(speed, has_bulk=True)
    seconds = 6.0
    bridge.run(MEASURED, seconds)
    for topic, ages in bridge.ages.items():
        if topic.startswith("/small"):
            assert len(ages) >= 30 * seconds, topic
            assert sorted(ages)[len(ages) * 95 // 100] <= 0.1, topic
        else:
            assert len(ages) >= 1.0 * seconds, topic


@pytest.mark.slow
@pytest.mark.parametrize("rosapi", [0.3, 1.5])
def test_busy_rosapi_does_not_slow_down_a_fast_bridge(rosapi: float) -> None:
    bridge = SlowBridge(0.000_3, rosapi)
    sizes = {f"/t{i}": 300 for i in range(12)}
    bridge.run(sizes, 10.0)
    for topic in sizes:
        assert len([age for age in bridge.ages[topic] if age < 0.1]) >= 30 * 6, topic


def test_few_probes_wait_for_a_busy_rosapi() -> None:
    bridge = SlowBridge(0.000_3, 5.0)
    bridge.run({"/t": 300}, 4.9)
    assert len(bridge._answers) <= MAX_IN_AIR


@pytest.mark.parametrize("num_topics", [1, 11])
@pytest.mark.parametrize("work", [0.0003, 0.005, 0.02, 0.1])
def test_data_at_a_slow_bridge_is_young_and_every_topic_gets_its_turn(work: float, num_topics: int) -> None:
    bridge = SlowBridge(work)
    sizes = {f"/t{i}": 100 + 300 * i for i in range(num_topics)} | {"/large": 20_000}
    bridge.run(sizes, 8.0)
    round_time = work * len(sizes)
    bound = max(0.2, 2.0 * round_time)
    for topic in sizes:
        assert median(bridge.ages[topic]) <= bound, topic
        assert len(bridge.ages[topic]) >= 0.4 * min(8.0 / round_time, 8.0 / FRAME_TIME), topic
    if work < 0.001:
        assert not bridge.connection.num_dropped
    assert bridge.connection.flow_control.age(8.0) <= bound


def test_messages_behind_leave_in_rounds_with_small_ones_first() -> None:
    fresh = FreshMessages(10_000)
    for i in range(3):
        fresh.offer(WaitingMessage("/large", b"L" * 100, 0.06 * i))
        fresh.offer(WaitingMessage("/small", b"s", 0.06 * i))
    assert fresh.is_behind
    assert (len(fresh), fresh.dropped) == (2, {"/large": 2, "/small": 2})
    taken = []
    for _ in range(2):
        taken.append(fresh.take(0.2))
        fresh.offer(WaitingMessage("/small", b"s", 0.2))
    assert [one.topic for one in taken if one is not None] == ["/small", "/large"]


def test_burst_is_sent_whole_and_in_order_while_the_bridge_keeps_up() -> None:
    fresh = FreshMessages(10_000)
    names = ["/b", "/a"] * 50
    for name in names:
        fresh.offer(WaitingMessage(name, name.encode(), 0.0))
    taken = [fresh.take(0.05) for _ in names]
    assert [one.topic for one in taken if one is not None] == names
    assert not fresh.dropped

"""A bridge that is slow with each frame: how old the data is there, in simulated time."""

from __future__ import annotations

import json
from collections import deque
from statistics import median

import pytest

from rosbridge_sim.graph.attach.connection import BridgeConnection
from rosbridge_sim.graph.attach.fresh_messages import FreshMessages, WaitingMessage
from rosbridge_sim.protocol.outbox import OutboxLimits

FRAME_TIME = 0.02
"""Time between two messages of a topic [s]."""


class SlowBridge:
    """A bridge that handles one frame after another, each in the same time.

    Attributes:
        ages: topic -> age of each message when it was handled [s].
    """

    def __init__(self, work: float) -> None:
        self.connection = BridgeConnection("", OutboxLimits(), 10_000, lambda _error: None)
        self.connection.open(lambda: None, lambda: None)
        self.ages: dict[str, list[float]] = {}
        self._work = work
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
                answer = {"op": "service_response", "service": "", "id": op["id"], "values": {}, "result": True}
                list(self.connection.receive(json.dumps(answer).encode(), now))


@pytest.mark.parametrize("num_topics", [1, 11])
@pytest.mark.parametrize("work", [0.0003, 0.005, 0.02, 0.1])
def test_data_at_a_slow_bridge_is_young_and_every_topic_gets_its_turn(work: float, num_topics: int) -> None:
    bridge = SlowBridge(work)
    sizes = {f"/t{i}": 100 + 300 * i for i in range(num_topics)} | {"/large": 20_000}
    bridge.run(sizes, 12.0)
    round_time = work * len(sizes)
    bound = max(0.2, 2.0 * round_time)
    for topic in sizes:
        assert median(bridge.ages[topic]) <= bound, topic
        assert len(bridge.ages[topic]) >= 0.4 * min(12.0 / round_time, 12.0 / FRAME_TIME), topic
    if work < 0.001:
        assert not bridge.connection.num_dropped
    assert bridge.connection.flow_control.age(12.0) <= bound


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

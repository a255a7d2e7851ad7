"""Recordings in memory, for tests of replay."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Then

__all__ = ["MemoryRecordings"]


class MemoryRecordings(Participant):
    """Recordings in memory: messages as they went over a bus.

    Attributes:
        messages: recording -> (topic, struct, stamp [ns]) in order.
    """

    name = "/recordings"

    def __init__(self) -> None:
        self.messages: dict[str, list[tuple[str, Any, int]]] = {}
        self.waiting: list[tuple[RecordingBuilder, Then]] = []
        self.is_slow = False

    def notify(self, level: str, text: str) -> None:
        raise AssertionError((level, text))

    def record(self, bus: Bus, name: str, *topics: str) -> None:
        messages = self.messages.setdefault(name, [])

        def hear(topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
            messages.append((topic.name, message.value, bus.stamp_ns))

        for topic in topics:
            bus.subscribe(self, topic, hear)

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        if self.is_slow:
            self.waiting.append((reading, then))
            return
        then(self._finish(reading) if name in self.messages else DocumentError(f"no recording {name!r}"), 100.0)

    def deliver(self) -> None:
        for reading, then in self.waiting:
            then(self._finish(reading), 100.0)
        self.waiting.clear()

    def _finish(self, reading: RecordingBuilder) -> Recording:
        for topic, value, stamp_ns in self.messages[reading.name]:
            if topic.endswith("/Ego_topic"):
                reading.take_ego(2 if topic.startswith("/Ego-2/") else 0, value, (stamp_ns, stamp_ns))
            elif topic == "/Object_topic":
                reading.take_objects(value, (stamp_ns, stamp_ns))
            else:
                reading.take_pedals(value, (stamp_ns, stamp_ns))
                reading.take_objects(value, (stamp_ns, stamp_ns))
        return reading.finish()

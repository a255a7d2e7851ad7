"""Participants in memory, for the tests of the bus and its parts."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import OfferKind, Participant
from rosbridge_sim.graph.topics_services import Answer, Call, Topic
from rosbridge_sim.schema.message import Message

__all__ = ["ADD", "STRING", "Somebody", "YieldingParticipant", "text"]

STRING = "std_msgs/String"
ADD = "rospy_tutorials/AddTwoInts"


class Somebody(Participant):
    """An owner that remembers what it is told and what it hears."""

    def __init__(self, name: str = "/somebody") -> None:
        self.name = name
        self.told: list[tuple[str, str]] = []
        self.heard: list[tuple[str, Any]] = []
        self.answers: list[Answer] = []
        self.calls: list[Call] = []

    def notify(self, level: str, text: str) -> None:
        self.told.append((level, text))

    def deliver(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.heard.append((topic.name, message.value))

    def keep(self, call: Call, _now: float) -> None:
        self.calls.append(call)


class YieldingParticipant(Somebody):
    """An owner that gives way to the server's own parts, as clients do."""

    is_guest = True

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        self.told.append((f"{kind} {name}", why))


def text(bus: Bus, data: str) -> Message:
    message_type = bus.store.message(STRING)
    return Message(message_type, message_type.struct_type(data=data))

"""Counts of the messages of each topic, for `/sim/topics`. Nothing is counted while nobody subscribes to it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Final

from rosbridge_sim.errors import PeerError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant, resolve
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.loose_types import JsonValue, Struct
from rosbridge_sim.protocol.outbox import Outbox
from rosbridge_sim.schema.message import Message

MAX_TOPICS: Final = 500
"""Topics of one message: it takes some 5 ms and 100 kB then."""

MAX_OWNERS: Final = 50
"""Publishers or subscribers of a topic that are listed, the first ones: a person reads no more."""

NOT_MEASURED: Final = -1.0
"""Rate before the first second is over [Hz]."""


class TopicReport:
    """The traffic of all topics of a bus."""

    def __init__(self, bus: Bus, policy: Policy) -> None:
        """Count nothing yet.

        Args:
            policy: the rights of clients; only what it allows is told.
        """
        self._bus = bus
        self._policy = policy
        self._last: dict[Topic, Message] = {}
        self._nums: Counter[Topic] = Counter()
        self._since: float | None = None

    def stop(self) -> None:
        """Count nothing any more."""
        if self._since is not None:
            self._since = None
            self._bus.delivery.unwatch(self._count)
            self._clear()

    def take(self, outboxes: Iterable[Outbox], now: float) -> dict[str, JsonValue]:
        """Return the fields of a message behind its header, of the time since the last call; counting goes on.

        Args:
            outboxes: those of clients, which may have lost messages.
        """
        seconds = 0.0 if self._since is None else now - self._since
        if self._since is None:
            self._bus.delivery.watch(self._count)
        may_see = self._policy.may_see
        topics = [
            topic
            for name, topic in sorted(self._bus.topics.items())
            if (topic.publishers or topic.all_subscriptions) and may_see(name, topic.type.name)
        ]
        dropped: Counter[str] = Counter()
        for outbox in outboxes:
            for spelling, num in outbox.dropped.items():
                dropped[resolve(spelling)] += num
        listed = [self._describe(topic, seconds, dropped[topic.name]) for topic in topics[:MAX_TOPICS]]
        self._clear()
        self._since = now
        return {"topics": listed, "num_topics": len(topics)}

    def _count(self, topic: Topic, message: Message) -> None:
        self._nums[topic] += 1
        self._last[topic] = message

    def _clear(self) -> None:
        self._nums.clear()
        self._last.clear()

    def _describe(self, topic: Topic, seconds: float, num_dropped: int) -> Struct:
        num, last = self._nums[topic], self._last.get(topic)
        rate = num / seconds if seconds else NOT_MEASURED
        size = 0 if last is None else _size_of(last)
        store = self._bus.store
        return store.message("rosbridge_sim_msgs/TopicInfo").struct_type(
            name=topic.name,
            type=store.spelled(topic.type.name, "msg"),
            rate=rate,
            bytes_per_second=max(rate, 0.0) * size,
            size=size,
            publishers=_addresses(topic.publishers),
            subscribers=_addresses(subscription.owner for subscription in topic.all_subscriptions),
            dropped=num_dropped,
            is_latched=topic.is_latching,
        )


def _size_of(message: Message) -> int:
    """Return the length of a message as JSON [bytes]; 0 for one that cannot be written."""
    if message.text_length:
        return message.text_length
    try:
        return len(message.json)
    except PeerError:
        return 0


def _addresses(owners: Iterable[Participant]) -> list[str]:
    """Return the addresses of participants, each once."""
    return list(dict.fromkeys(owner.where for owner in owners))[:MAX_OWNERS]

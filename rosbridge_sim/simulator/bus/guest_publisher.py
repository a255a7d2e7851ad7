"""A publisher beside the simulator, of messages that it has not made: viewers take them for those of a program."""

from __future__ import annotations

import logging

from rosbridge_sim.errors import PeerError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.plain_values import without_unknown

_log = logging.getLogger("rosbridge_sim.bus")


class GuestPublisher:
    """A participant with topics of its own.

    A topic that somebody publishes already is left to them.

    Attributes:
        name: the node name that rosapi shows.
        has_topics: it offers at least one.
    """

    def __init__(self, bus: Bus, name: str) -> None:
        """Offer nothing yet.

        Args:
            bus: has the topics.
            name: the node name.
        """
        self.name = name
        self.has_topics = False
        self._bus = bus

    def notify(self, level: str, text: str) -> None:
        """Write a message from the bus into the log."""
        _log.debug("%s: %s: %s", self.name, level, text)

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
                _log.info("%s: %s is left out: it has a publisher here", self.name, name)
                return None
            topic = self._bus.advertise(self, name, type_name, depth=1)  # a viewer may come while a replay is held
        except PeerError as error:
            _log.warning("%s: %s is left out: %s", self.name, name, error)
            return None
        self.has_topics = True
        return topic

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

    def publish(self, topic: Topic, message: Message, now: float) -> None:
        """Publish a message; a listener that refuses it, or fails, is in the log.

        Args:
            topic: from `offer`.
            message: from `make`.
        """
        self._bus.announce(self, topic, message, now)

    def leave(self, now: float) -> None:
        """Publish none of the topics any more."""
        if self.has_topics:
            self._bus.leave(self, now)
            self.has_topics = False

"""Delivery of messages to the subscribers of their topic, and the handling of subscribers that fail.

Subscribers get a message directly, in order of subscription, before `publish` returns. If a subscriber finds a mistake
in a message, its sender is told. An internal error in one subscriber affects only that subscriber.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable

from rosbridge_sim.errors import EncodingError, GraphError, PeerError, Reason
from rosbridge_sim.graph.bus_state import BusState
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.schema.message import Message

_log = logging.getLogger("rosbridge_sim.graph")


Watch = Callable[[Topic, Message], object]
"""`(topic, message)`."""


class Delivery:
    """Delivery of the messages of one bus.

    Attributes:
        num_published: number of messages since the start.
    """

    def __init__(self, state: BusState) -> None:
        self.num_published = 0
        self._watchers: tuple[Watch, ...] = ()
        self._guard = state.guard
        self._accounts = state.accounts

    def watch(self, watch: Watch) -> None:
        """Call a function with each message before its delivery. It must not raise."""
        self._watchers = (*self._watchers, watch)

    def unwatch(self, watch: Watch) -> None:
        """Call it no more."""
        self._watchers = tuple([other for other in self._watchers if other != watch])

    def publish(self, sender: Participant, topic: Topic, message: Message, now: float) -> None:
        """Give a message to every subscriber of a topic that `sender` advertised.

        Raises:
            PeerError: a mistake that a subscriber found, or a failed encoding. All other subscribers got the message.
            Exception: a subscriber failed that cannot be ended alone. All other subscribers got the message.
        """
        self.num_published += 1
        if self._watchers:
            for watch in self._watchers:
                watch(topic, message)
        problem: PeerError | None = None
        failure: Exception | None = None
        if topic.depth and not topic.keep(sender, message, self._accounts.get(sender)):
            text = f"{topic.name}: this client makes the server hold too much; the message is not latched"
            problem = GraphError(text, reason=Reason.TOO_MUCH)
        for subscription in topic.subscriptions:
            try:
                subscription.deliver(topic, message, sender, now)
            except EncodingError as error:
                self._guard.note_encoding(topic.name, error)
                problem = problem or error
            except PeerError as error:
                problem = problem or error
            except Exception as error:  # noqa: BLE001 - an internal error in one subscriber's own state
                failure = self._end_alone(subscription.owner, error, failure)
        if failure is not None:
            raise failure
        if problem is not None:
            raise problem

    def announce(self, sender: Participant, topic: Topic, message: Message, now: float) -> None:
        """Publish a message of the server itself. Mistakes and failures of subscribers go to the log.

        Never raises, because an error in a subscriber must not stop the world.
        """
        try:
            self.publish(sender, topic, message, now)
        except EncodingError:
            pass  # already logged
        except PeerError as error:
            _log.warning("a listener of %s refused a message: %s", topic.name, error)
        except Exception as error:  # noqa: BLE001 - a listener that cannot end alone
            self._guard.note(f"a listener of {topic.name}", error)

    def show(
        self, sender: Participant, topic: Topic, message: Message, listeners: Iterable[Subscription], now: float
    ) -> None:
        """Give a message of the server itself to some subscribers of a topic; otherwise as `announce`.

        The message is not latched.

        Args:
            message: the message; it may have been published before.
        """
        for subscription in listeners:
            try:
                subscription.deliver(topic, message, sender, now)
            except EncodingError as error:
                self._guard.note_encoding(topic.name, error)
            except PeerError as error:
                _log.warning("a listener of %s refused a message: %s", topic.name, error)
            except Exception as error:  # noqa: BLE001 - an internal error in one subscriber's own state
                self._guard.contain(subscription.owner, error)

    def _end_alone(self, owner: Participant, error: Exception, before: Exception | None) -> Exception | None:
        """End the owner of a failed subscription; return the failure to raise, if any. Further failures are logged.

        Args:
            before: failure of another subscriber that cannot be ended alone.
        """
        try:
            self._guard.blame(owner, error)
        except Exception as raised:  # noqa: BLE001 - the same error
            if before is None:
                return raised
            self._guard.note("another listener of the same message", raised)
        return before

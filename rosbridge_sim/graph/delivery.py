"""Messages from a publisher to the listeners of its topic, and what becomes of a listener that fails.

The listeners get a message directly, in order of arrival, before `publish` returns. A mistake that one of them finds
is the sender's to hear; a failure of one of them hurts that one alone.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable

from rosbridge_sim.errors import EncodingError, GraphError, PeerError, Reason
from rosbridge_sim.graph.bus_state import BusState
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Subscription, Topic
from rosbridge_sim.schema.message import Message

__all__ = ["Delivery"]

_log = logging.getLogger("rosbridge_sim.graph")


class Delivery:
    """Delivery of the messages of one bus."""

    def __init__(self, state: BusState) -> None:
        self._state = state
        self._guard = state.guard
        self._accounts = state.accounts

    def publish(self, sender: Participant, topic: Topic, message: Message, now: float) -> None:
        """Hand a message to every listener of a topic that `sender` advertised.

        Raises:
            PeerError: what a listener found wrong with the message, or why it could not be encoded for it; all others
                have it all the same.
            Exception: a listener that cannot end alone has failed; the same.
        """
        state = self._state
        state.num_published += 1
        if state.on_message is not None:
            state.on_message(topic, message)
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
            except Exception as error:  # noqa: BLE001 - a bug of ours in one listener's own state
                failure = self._end_alone(subscription.owner, error, failure)
        if failure is not None:
            raise failure
        if problem is not None:
            raise problem

    def announce(self, sender: Participant, topic: Topic, message: Message, now: float) -> None:
        """Publish something of our own. What a listener finds wrong with it is for the log, and so is its failure.

        Never raises: nothing that is wrong with a listener is the world's failure.
        """
        try:
            self.publish(sender, topic, message, now)
        except EncodingError:
            pass  # noted already
        except PeerError as error:
            _log.warning("a listener of %s refused a message: %s", topic.name, error)
        except Exception as error:  # noqa: BLE001 - a listener that cannot end alone
            self._guard.note(f"a listener of {topic.name}", error)

    def show(
        self, sender: Participant, topic: Topic, message: Message, listeners: Iterable[Subscription], now: float
    ) -> None:
        """Hand something of our own to some listeners of a topic; otherwise as `announce`. It is not latched.

        Args:
            sender: who publishes there.
            topic: of which they are listeners.
            message: may have been published before.
            listeners: the subscriptions that get it.
            now: monotonic time [s].
        """
        for subscription in listeners:
            try:
                subscription.deliver(topic, message, sender, now)
            except EncodingError as error:
                self._guard.note_encoding(topic.name, error)
            except PeerError as error:
                _log.warning("a listener of %s refused a message: %s", topic.name, error)
            except Exception as error:  # noqa: BLE001 - a bug of ours in one listener's own state
                self._guard.contain(subscription.owner, error)

    def _end_alone(self, owner: Participant, error: Exception, before: Exception | None) -> Exception | None:
        """End an owner for which something has failed; return the failure to raise, if any: one, the others are noted.

        Args:
            owner: the listener.
            error: its failure.
            before: that of another listener which cannot end alone.
        """
        try:
            self._guard.blame(owner, error)
        except Exception as raised:  # noqa: BLE001 - the same error
            if before is None:
                return raised
            self._guard.note("another listener of the same message", raised)
        return before

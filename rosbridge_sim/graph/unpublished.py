"""Subscriptions to topics without a publisher; their client is told once.

Such a subscription is allowed, because a publisher may come at any time. But the name may also be wrong, or the
simulator may lack the sensor, and then the program waits for ever without a message. So a subscriber whose topic has no
publisher after some seconds is told, at level `info`. Clients get that level only if they have asked for it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

from rosbridge_sim.graph.bus_state import Agenda
from rosbridge_sim.graph.topics_services import Subscription, Topic

UNPUBLISHED_AFTER = 5.0
"""Time without a publisher after which a subscriber is told [s]: most programs of a start script are running by then.
"""

MAX_WATCHED_SUBSCRIPTIONS = 1_000
"""Subscriptions that are watched at once; further ones are not told."""

MAX_TOLD_AT_ONCE = 20
"""Subscribers that are told in one turn, about 0.2 ms each; the others in the next turn."""


class UnpublishedTopics:
    """Subscriptions that began without a publisher, oldest first.

    Attributes:
        advise: returns what the simulator knows about a topic that it does not publish, for the end of a sentence; may
            be empty.
        advise_name: returns what the simulator knows about a topic or a service that does not exist, or about a type
            that is not known, for the end of a sentence; may be empty.
    """

    def __init__(self, agenda: Agenda) -> None:
        self._agenda = agenda
        self.advise: Callable[[Topic], str] = lambda _topic: ""
        self.advise_name: Callable[[str], str] = lambda _name: ""
        self._watched: dict[Subscription, tuple[float, Callable[[Topic], None]]] = {}

    def watch(self, subscription: Subscription, notify: Callable[[Topic], None], now: float) -> None:
        """Tell a subscriber if its topic has no publisher after `UNPUBLISHED_AFTER`.

        Args:
            subscription: a new subscription.
            notify: called with the topic, at most once.
        """
        if not subscription.topic.publishers and len(self._watched) < MAX_WATCHED_SUBSCRIPTIONS:
            self._watched[subscription] = (now + UNPUBLISHED_AFTER, notify)
            self._agenda.announce(now + UNPUBLISHED_AFTER)

    def forget(self, subscription: Subscription) -> None:
        """Stop watching a subscription; an unknown one is not an error."""
        self._watched.pop(subscription, None)

    def next_due(self) -> float | None:
        """Return when `take_due` has something to return next [s]; None if never."""
        for due, _ in self._watched.values():  # all wait for the same time, so the first is the earliest
            return due
        return None

    def take_due(self, now: float) -> list[tuple[Topic, Callable[[Topic], None]]]:
        """Return the topics whose subscribers should be told now, with the function that tells them."""
        due = [each for each in islice(self._watched.items(), MAX_TOLD_AT_ONCE) if each[1][0] <= now]
        for subscription, _ in due:
            del self._watched[subscription]
        return [(subscription.topic, notify) for subscription, (_, notify) in due if not subscription.topic.publishers]

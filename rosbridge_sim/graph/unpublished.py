"""Topics that a client listens to in vain: nobody publishes there, and the client is told so once.

Such a subscription is lawful: a publisher may come at any time. But it may also be a wrong name, or a sensor that the
simulator does not have, and then the program waits for ever without a word. So a listener whose topic still has no
publisher some seconds later is told, at level `info`. No client hears that level unless it has asked for it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

from rosbridge_sim.graph.topics_services import Subscription, Topic

__all__ = ["UNPUBLISHED_AFTER", "UnpublishedTopics"]

UNPUBLISHED_AFTER = 5.0
"""Time without a publisher after which a listener is told [s]: most programs of a start-up script are there
by then."""

MAX_WATCHED_SUBSCRIPTIONS = 1_000
"""Subscriptions that are watched at once; no listener of a further one is told."""

MAX_TOLD_AT_ONCE = 20
"""Listeners that are told in one turn, some 0.2 ms each; the others in the next."""


class UnpublishedTopics:
    """Subscriptions that began without a publisher, oldest first.

    Attributes:
        advise: returns what the simulator knows about a topic that it does not publish, for the end of a sentence;
            perhaps nothing.
    """

    def __init__(self) -> None:
        self.advise: Callable[[Topic], str] = lambda _topic: ""
        self._watched: dict[Subscription, tuple[float, Callable[[Topic], None]]] = {}

    def watch(self, subscription: Subscription, notify: Callable[[Topic], None], now: float) -> None:
        """Have a listener told if its topic still has no publisher after `UNPUBLISHED_AFTER`.

        Args:
            subscription: which has just begun.
            notify: called with the topic, once or never.
            now: monotonic time [s].
        """
        if not subscription.topic.publishers and len(self._watched) < MAX_WATCHED_SUBSCRIPTIONS:
            self._watched[subscription] = (now + UNPUBLISHED_AFTER, notify)

    def forget(self, subscription: Subscription) -> None:
        """Watch a subscription no longer; one that is not watched is no error."""
        self._watched.pop(subscription, None)

    def next_due(self) -> float | None:
        """Return when `advance` has something to do next [s]; None if never."""
        for due, _ in self._watched.values():  # all wait equally long, so the first is the earliest
            return due
        return None

    def take_due(self, now: float) -> list[tuple[Topic, Callable[[Topic], None]]]:
        """Return the topics without a publisher whose listeners are to be told by now [s], with what tells them."""
        due = [each for each in islice(self._watched.items(), MAX_TOLD_AT_ONCE) if each[1][0] <= now]
        for subscription, _ in due:
            del self._watched[subscription]
        return [(subscription.topic, notify) for subscription, (_, notify) in due if not subscription.topic.publishers]

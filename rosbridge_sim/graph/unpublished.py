"""Subscriptions to topics without a publisher; their client is told once.

Such a subscription is allowed, because a publisher may come at any time. But the name may also be wrong, or the
simulator may lack the sensor, and then the program waits for ever without a message. So a subscriber whose topic has no
publisher after some seconds is told, at level `info`. Clients get that level only if they have asked for it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from itertools import islice
from typing import Generic, TypeVar

from rosbridge_sim.graph.bus_state import Agenda
from rosbridge_sim.graph.topics_services import Subscription, Topic

UNPUBLISHED_AFTER = 5.0
"""Time without a publisher after which a subscriber is told [s]: most programs of a start script are running by then.
"""

MAX_WATCHED_SUBSCRIPTIONS = 1_000
"""Subscriptions that are watched at once; further ones are not told."""

MAX_TOLD_AT_ONCE = 20
"""Subscribers that are told in one turn, about 0.2 ms each; the others in the next turn."""


K = TypeVar("K", bound=Hashable)
Notify = Callable[[Topic], None]


class WatchedTopics(Generic[K]):
    """Topics that began without the other side, oldest first. Who waits for it is told once.

    Args:
        most_watched: numbers that are watched at once; further ones are not told.
        most_at_once: numbers that are told in one turn.
        has_other_side: returns whether nobody has to be told any more.
    """

    def __init__(
        self, agenda: Agenda, wait: float, most_watched: int, most_at_once: int, has_other_side: Callable[[Topic], bool]
    ) -> None:
        self._agenda = agenda
        self._wait = wait
        self._most_watched = most_watched
        self._most_at_once = most_at_once
        self._has_other_side = has_other_side
        self._watched: dict[K, tuple[float, Topic, Notify]] = {}

    def watch(self, key: K, topic: Topic, notify: Notify, now: float) -> None:
        """Have the owner told if its topic still has no other side after some seconds.

        Args:
            key: what is watched.
            notify: called with the topic, at most once.
        """
        if not self._has_other_side(topic) and len(self._watched) < self._most_watched:
            self._watched.setdefault(key, (now + self._wait, topic, notify))
            self._agenda.announce(now + self._wait)

    def forget(self, key: K) -> None:
        """Stop watching; an unknown key is not an error."""
        self._watched.pop(key, None)

    def next_due(self) -> float | None:
        """Return when `take_due` has something to return next [s]; None if never."""
        for due, _, _ in self._watched.values():  # all wait for the same time, so the first is the earliest
            return due
        return None

    def take_due(self, now: float) -> list[tuple[Topic, Notify]]:
        """Return the topics about which should be told now, with the function that does so."""
        due = [each for each in islice(self._watched.items(), self._most_at_once) if each[1][0] <= now]
        for key, _ in due:
            del self._watched[key]
        return [(topic, notify) for _, (_, topic, notify) in due if not self._has_other_side(topic)]


class UnpublishedTopics(WatchedTopics[Subscription]):
    """Subscriptions that began without a publisher, oldest first.

    Attributes:
        advise: returns what the simulator knows about a topic that it does not publish, for the end of a sentence; may
            be empty.
        advise_name: returns what the simulator knows about a topic or a service that does not exist, or about a type
            that is not known, for the end of a sentence; may be empty.
    """

    def __init__(self, agenda: Agenda) -> None:
        super().__init__(
            agenda, UNPUBLISHED_AFTER, MAX_WATCHED_SUBSCRIPTIONS, MAX_TOLD_AT_ONCE, lambda topic: bool(topic.publishers)
        )
        self.advise: Callable[[Topic], str] = lambda _topic: ""
        self.advise_name: Callable[[str], str] = lambda _name: ""

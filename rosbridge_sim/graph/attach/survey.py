"""Comparison of the announced items with the lists of the remote rosapi.

rosbridge_suite does not answer mistakes: a type whose package is not built there gives only a line in its own log. So a
while after everything was announced, we ask for its topics and services, and log what is missing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rosbridge_sim.graph.attach.connection import Values
from rosbridge_sim.graph.attach.diagnostics import Diagnostics, is_list_of_topics
from rosbridge_sim.graph.attach.mirror_registry import MirrorRegistry

SURVEY_DELAYS: Final = (0.0, 1.0, 3.0)
"""Waiting times before the lists are requested [s], each counted from the request before. In ROS 2, discovery of topics
takes seconds."""

MAX_DELAYED: Final = 10
"""Requests that are made once more because a rosapi that has answered other calls did not answer in time."""


class Survey:
    """Requests for the lists of one remote bridge.

    Attributes:
        due: when `ask` should be called [s]; None if no request is planned.
        is_anew: everything was announced again on open sockets, so we may have caused missing items ourselves.
        on_topics: called with the values of `/rosapi/topics` for each list.
        on_topics_lost: called with monotonic time [s] when topics are still missing.
    """

    def __init__(self, diagnostics: Diagnostics, registry: MirrorRegistry) -> None:
        """Create one without a planned request.

        Args:
            diagnostics: gets the lists.
            registry: the announced items; its first connection is asked.
        """
        self.due: float | None = None
        self.is_anew = False
        self.on_topics: Callable[[Values], None] = lambda _values: None
        self.on_topics_lost: Callable[[float], None] = lambda _now: None
        self._diagnostics = diagnostics
        self._registry = registry
        self._num_asked = self._num_delayed = 0
        self._began_at = 0.0

    def begin(self, now: float) -> None:
        """Start the requests, as planned by `SURVEY_DELAYS`."""
        self._num_asked = self._num_delayed = 0
        self.due = self._began_at = now

    def ask(self, now: float) -> None:
        """Request the lists; plan another request if items are missing or no answer comes.

        Rosapi may start later than the bridge.
        """
        self.due = None
        self._num_asked += 1
        first = self._registry.first
        is_final = self._num_asked == len(SURVEY_DELAYS)

        def on_services(topics: Values, services: Values | None, now: float) -> None:
            if services is None:
                self._note_no_answer(now)
            elif not self._compare(topics, services, now, is_final=is_final):
                self._schedule(now)

        def on_topics(topics: Values | None, now: float) -> None:
            if topics is None:
                self._note_no_answer(now)
            else:
                first.ask("/rosapi/services", lambda services, now: on_services(topics, services, now), now)

        first.ask("/rosapi/topics", on_topics, now)

    def _note_no_answer(self, now: float) -> None:
        """Ask again, or report that rosapi is not there, if it has never answered."""
        patience = self._registry.first.patience
        if self._num_asked < len(SURVEY_DELAYS):
            self._schedule(now)
        elif not patience.has_answer:
            self._diagnostics.report_no_rosapi(now - self._began_at, is_refused=patience.has_refusal)
        elif self._num_delayed < MAX_DELAYED:  # it is only slow
            self._num_delayed += 1
            self._num_asked -= 1
            self._schedule(now)

    def _schedule(self, now: float) -> None:
        if self._num_asked < len(SURVEY_DELAYS):
            self.due = now + SURVEY_DELAYS[self._num_asked]

    def _compare(self, topics: Values, services: Values, now: float, *, is_final: bool) -> bool:
        """Compare the lists; return True if nothing is missing."""
        if is_list_of_topics(topics):
            self.on_topics(topics)
        is_whole = self._diagnostics.compare_lists(
            topics, services, self._registry.items, is_final=is_final and not self.is_anew
        )
        if is_final and self.is_anew:
            self.is_anew = False
            if self._diagnostics.has_lost_topics:
                self.on_topics_lost(now)
        return is_whole

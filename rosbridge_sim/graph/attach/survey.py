"""Comparison of what was announced with the lists of the far side's rosapi.

rosbridge_suite answers no mistake: a type whose package is not built there gives a line in its own log and nothing
else. So a while after everything was announced we ask it which topics and services it has, and say what is missing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rosbridge_sim.graph.attach.connection import Values
from rosbridge_sim.graph.attach.diagnostics import Diagnostics
from rosbridge_sim.graph.attach.registry import MirrorRegistry

__all__ = ["SURVEY_DELAYS", "Survey"]

SURVEY_DELAYS: Final = (0.0, 1.0, 3.0)
"""Waits before the far side is asked for its lists [s]: each after the one before. In ROS 2 topics are found one by
one, over seconds."""


class Survey:
    """The questions for lists that are asked of one far side.

    Attributes:
        due: when `ask` is to be called [s]; None where nothing is to be asked.
        is_anew: all was announced once more on sockets that lived on, so what is missing may be our own doing.
        on_topics_lost: called with monotonic time [s] when topics are missing all the same.
    """

    def __init__(self, diagnostics: Diagnostics, registry: MirrorRegistry) -> None:
        """Nothing is to be asked.

        Args:
            diagnostics: gets the lists.
            registry: what was announced; its first connection is asked.
        """
        self.due: float | None = None
        self.is_anew = False
        self.on_topics_lost: Callable[[float], None] = lambda _now: None
        self._diagnostics = diagnostics
        self._registry = registry
        self._num_asked = 0

    def begin(self, now: float) -> None:
        """Ask from now on, as often as `SURVEY_DELAYS` says."""
        self._num_asked = 0
        self.due = now

    def ask(self, now: float) -> None:
        """Ask it for its lists; once more later, if something is missing, or nobody answers: rosapi may start later."""
        self.due = None
        self._num_asked += 1
        first = self._registry.first
        is_final = self._num_asked == len(SURVEY_DELAYS)

        def on_services(topics: Values, services: Values | None, now: float) -> None:
            if services is None:
                on_no_answer(now)
            elif not self._compare(topics, services, now, is_final=is_final):
                schedule(now)

        def on_topics(topics: Values | None, now: float) -> None:
            if topics is None:
                on_no_answer(now)
            else:
                first.ask("/rosapi/services", lambda services, now: on_services(topics, services, now), now)

        def on_no_answer(now: float) -> None:
            if is_final:
                self._diagnostics.report_no_rosapi()
            schedule(now)

        def schedule(now: float) -> None:
            if not is_final:
                self.due = now + SURVEY_DELAYS[self._num_asked]

        first.ask("/rosapi/topics", on_topics, now)

    def _compare(self, topics: Values, services: Values, now: float, *, is_final: bool) -> bool:
        """Look through its lists, and return whether nothing is missing."""
        is_whole = self._diagnostics.compare_lists(
            topics, services, self._registry.items, is_final=is_final and not self.is_anew
        )
        if is_final and self.is_anew:
            self.is_anew = False
            if self._diagnostics.has_lost_topics:
                self.on_topics_lost(now)
        return is_whole

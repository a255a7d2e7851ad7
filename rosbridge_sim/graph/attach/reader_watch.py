"""The readers of pictures and clouds at a remote bridge, found by calls of its rosapi.

A rosbridge does not say who subscribes to a topic that a client advertises. A cloud that nobody reads costs the bridge
as much as one that is read, up to a tenth of a second. So rosapi is asked for the subscribers of each large topic again
and again, and a topic without subscribers is not published.
Nothing is published until the first answer. If rosapi cannot tell (it is not there, or it fails twice), the topic is
published. It is also published when synchronous mode begins, until the next answer, because the master may wait for the
picture of its first tick.
"""

from __future__ import annotations

from typing import Final

from rosbridge_sim.graph.attach.connection import Values
from rosbridge_sim.graph.attach.diagnostics import names_of
from rosbridge_sim.graph.attach.mirror_registry import MirroredItem, MirrorRegistry

READERS_PERIOD: Final = 3.0
"""Time between two questions about one topic [s]: a new program there waits so long for its first picture, and three
topics are one call a second, little beside the pictures."""

RETRY_PERIOD: Final = 1.0
"""Time until a question without an answer is asked again [s]."""

MAX_FAILURES: Final = 1
"""Questions about one topic in a row without an answer that do not count: a busy rosapi may miss one."""


class ReaderWatch:
    """Questions for the readers of all large topics, one at a time.

    Attributes:
        due: when `ask` should be called [s]; None while an answer is awaited or there is no connection.
    """

    def __init__(self, registry: MirrorRegistry) -> None:
        """Create one that does not ask yet.

        Args:
            registry: the announced items; its first connection is asked.
        """
        self.due: float | None = None
        self._registry = registry
        self._asked_at: dict[str, float] = {}
        self._num_failures: dict[str, int] = {}
        self._was_synchronous = False
        self._num_begun = 0

    def start(self, now: float) -> None:
        """Ask for all topics, because everything is announced on the first connection, or synchronous mode begins."""
        self._num_begun += 1
        self._asked_at.clear()
        self.due = now

    def stop(self) -> None:
        """Forget what is known, because the first connection is gone."""
        self._num_begun += 1
        self._asked_at.clear()
        self._num_failures.clear()
        self.due = None

    def note_mode(self, now: float, *, is_synchronous: bool) -> None:
        """Publish all large topics when synchronous mode has begun, until their readers are known again."""
        if is_synchronous and not self._was_synchronous:
            for item in self._registry.large_items:
                self._registry.note_readers(item, is_read=True)
            if self._registry.first.is_ready:
                self.start(now)
        self._was_synchronous = is_synchronous

    def note_items(self, now: float) -> None:
        """Ask soon for a topic that is new here."""
        if self.due is not None and any(item.name not in self._asked_at for item in self._registry.large_items):
            self.due = min(self.due, now)

    def ask(self, now: float) -> None:
        """Ask for the readers of the topic that was asked for longest ago, if it is time."""
        items = self._registry.large_items
        self._asked_at = {item.name: self._asked_at.get(item.name, -READERS_PERIOD) for item in items}
        item = min(items, key=lambda one: self._asked_at[one.name], default=None)
        if item is None:
            self.due = now + READERS_PERIOD
            return
        due = self._asked_at[item.name] + READERS_PERIOD
        if now < due:
            self.due = due
            return
        self.due = None
        self._asked_at[item.name] = now
        begun = self._num_begun

        def on_answer(values: Values | None, now: float) -> None:
            if self._num_begun == begun:
                self._note(item, values, now)
                self.due = now

        self._registry.first.ask("/rosapi/subscribers", on_answer, now, topic=item.name)

    def _note(self, item: MirroredItem, values: Values | None, now: float) -> None:
        if values is not None and isinstance(values.get("subscribers"), list):
            self._num_failures.pop(item.name, None)
            self._registry.note_readers(item, is_read=bool(names_of(values, "subscribers")))
            return
        self._asked_at[item.name] = now + RETRY_PERIOD - READERS_PERIOD
        self._num_failures[item.name] = self._num_failures.get(item.name, 0) + 1
        if self._num_failures[item.name] > MAX_FAILURES:
            self._registry.note_readers(item, is_read=None)

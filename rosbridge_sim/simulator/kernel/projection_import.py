"""The import of pyproj beside the event loop, for topics with latitudes and longitudes.

The import takes a tenth of a second and 15 MB, so it is made when the first client subscribes to such a topic, and by
the `Reader`, in a thread as a rule. Until it is done the gate behind the frame stays closed: a tick waits, so that in
synchronous mode no message is left out. In real time the world goes on, and the topics begin when the import is done.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts
from rosbridge_sim.simulator.plain.reading import read_while_held

_TYPES: Final = ("morai_msgs/GPSMessage", "sensor_msgs/NavSatFix")
"""Types of the simulator's topics with latitudes and longitudes."""


class ProjectionImport:
    """The import, which is made once.

    Attributes:
        is_running: it has begun and is not done. A position that is asked for now waits for it.
    """

    def __init__(self, parts: SimulatorParts, work: Callable[[], None]) -> None:
        """Import nothing yet.

        Args:
            work: makes the import; the reader runs it.
        """
        self.is_running = False
        self._has_begun = False
        self._participant, self._gate, self._reader = parts.participant, parts.gate, parts.reader
        self._work = work
        parts.bus.on_topic.append(self._note_topic)

    def prepare(self, topic: Topic) -> None:
        """Begin the import if a topic needs it, and nobody has begun it yet."""
        if not self._has_begun and topic.type.name in _TYPES and self._participant in topic.publishers:
            self._has_begun = True
            read_while_held(self._reader, self._work, lambda _outcome, _now: None, self._hold, 0.0)

    def _note_topic(self, topic: Topic) -> None:
        if topic.has_listener:
            self.prepare(topic)

    def _hold(self) -> Callable[[float], None]:
        self.is_running = True
        self._gate.close()
        return self._release

    def _release(self, now: float) -> None:
        self.is_running = False
        self._gate.open(now)

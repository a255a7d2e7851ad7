"""The time of day for stamps: read once per frame, and never going back.

A user or NTP may set the system's clock back. Programs that compare two stamps of one topic would then see time run
backwards: tf2 clears its buffers, filters divide by zero. So after such a step the stamps go on at half the speed of
real time, until the system's clock has caught up: a step of 0.1 s is corrected within 0.2 s.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from rosbridge_sim.graph.bus import Bus


class WallClock:
    """The system's clock without steps back; each reading is later than the one before."""

    def __init__(
        self, read_wall_ns: Callable[[], int] = time.time_ns, read_steady_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        """Create a clock without readings.

        Args:
            read_wall_ns: returns the system's time of day [ns].
            read_steady_ns: returns a monotonic time [ns].
        """
        self._read_wall_ns = read_wall_ns
        self._read_steady_ns = read_steady_ns
        self._last_ns = 0
        self._steady_ns = read_steady_ns()

    def read_ns(self) -> int:
        """Return the time of day [ns since 1970], at least 1 ns after the last reading."""
        steady_ns = self._read_steady_ns()
        passed_ns, self._steady_ns = steady_ns - self._steady_ns, steady_ns
        self._last_ns = max(self._read_wall_ns(), self._last_ns + max(1, passed_ns // 2))
        return self._last_ns


class WallClockBus(Bus):
    """A bus without a simulation: stamps that a message leaves open get the time of day."""

    @property
    def time_ns(self) -> int:
        """The time of day [ns]."""
        return time.time_ns()

    @time_ns.setter
    def time_ns(self, time_ns: int) -> None:
        """Ignore it: the time of day cannot be set."""

    stamp_ns = time_ns
    """The same, for stamps that a message leaves open."""

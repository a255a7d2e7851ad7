"""Log lines about a remote bridge that does not keep up: how many topic messages it was not sent.

Topic messages are counted in periods, for small topics and for pictures and clouds apart. A bridge is *too slow* for
them if a tenth of a period's messages was left out, and *fast enough again* after some periods in which nearly none
was. These become more with each change, so a bridge that is neither gives few lines.
"""

from __future__ import annotations

from typing import Final

REPORT_PERIOD: Final = 5.0
"""Length of a period [s]: longer than the load at the start, when everything is announced."""

SLOW_SHARE: Final = 0.1
"""Share of left-out messages of a period from which on the bridge is too slow for them."""

FAST_SHARE: Final = 0.01
"""Share up to which it keeps up: a single disturbance of any machine is in it."""

MAX_QUIET_PERIODS: Final = 64
"""Most periods without loss before it is called fast enough again."""


class LagReport:
    """The log lines about one kind of topic messages at one bridge.

    Attributes:
        is_slow: the last line said that the bridge is too slow.
    """

    def __init__(self, kind: str, hint: str) -> None:
        """Create one that has counted nothing.

        Args:
            kind: the messages, as the lines call them.
            hint: what a user can do about the bridge.
        """
        self.is_slow = False
        self._kind = kind
        self._hint = hint
        self._offered = self._dropped = 0
        self._num_quiet, self._num_needed = 0, 1

    def restart(self) -> None:
        """Count anew, because a socket was lost, and its counters with it."""
        self._offered = self._dropped = 0

    def note_period(self, offered: int, dropped: int, age: float) -> str:
        """Count the messages of a period.

        Args:
            offered, dropped: messages for the bridge, and those of them that were left out, since the sockets opened.
            age: largest age of data there in the period [s].

        Returns:
            The line to log; empty if nothing has changed.
        """
        num, num_lost = offered - self._offered, dropped - self._dropped
        self._offered, self._dropped = offered, dropped
        if num <= 0:  # nothing can be said
            return ""
        share = num_lost / num
        counted = f"{num_lost:,} of {num:,} {self._kind} of the last {REPORT_PERIOD:g} s were left out"
        if share >= SLOW_SHARE:
            self._num_quiet = 0
            if self.is_slow:
                return ""
            self.is_slow = True
            return (
                f"it is too slow: {counted}, and only the newest of each topic are sent; data was up to {age:.2f} s old"
                f" there; {self._hint}"
            )
        self._num_quiet = self._num_quiet + 1 if share <= FAST_SHARE else 0
        if not self.is_slow or self._num_quiet < self._num_needed:
            return ""
        self.is_slow = False
        self._num_needed = min(MAX_QUIET_PERIODS, 2 * self._num_needed)
        return (
            f"it is fast enough again: {counted}, {dropped:,} since it connected; data was up to {age:.2f} s old there"
        )

"""Flow control towards a rosbridge that accepts everything at once and slows no client down.

rosbridge_suite reads a socket as fast as frames come, and keeps them in a queue without a limit. So the socket never
fills, however late the server is, and neither TCP nor a ping shows the delay. But it handles the frames of one socket
in order: the answer to a cheap call comes after everything that was sent before. Such a call is a *probe*. Bytes sent
after the last answered probe are in flight. If more than a window is in flight, nothing is sent until an answer comes.
The cost of a frame there was measured: about 0.28 ms, and 0.18 us per byte. So a frame counts as its bytes plus 1,500.
If a probe is not answered in time, another half of a window may be sent; then the waiting time doubles, and so on. So a
slow bridge is never flooded, and a bridge that answers no calls still gets a minimum rate. A late answer counts like
any other. A bridge that *refuses* the call does not have the service: then there are no probes for a while, and only
the socket limits the rate. The probe is tried again at growing intervals, because rosapi is a separate program and may
start after the bridge.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

__all__ = ["FRAME_COST", "MAX_IN_FLIGHT", "MAX_PATIENCE", "PATIENCE", "FlowControl"]

FRAME_COST = 1_500
"""Cost of a frame in addition to its bytes [bytes]."""

MAX_IN_FLIGHT = 512 * 1024
"""The window: bytes that may be in flight. They are a tenth of a second of rosbridge_suite's work, about 250 messages
of an ego's state."""

PATIENCE, MAX_PATIENCE = 2.0, 60.0
"""Waiting time for the answer to a probe: the first one, and the longest [s]."""

MAX_PROBES = 16
"""Unanswered probes that are remembered; by then the last ones are minutes apart."""


class FlowControl:
    """The bytes that may still be sent on one socket.

    Attributes:
        is_on: the far side answers probes, as far as we know. If not, everything may be sent.
        is_late: the last probe was not answered in time.
    """

    __slots__ = ("_allowed", "_due", "_num_probes", "_patience", "_probes", "_sent", "is_late", "is_on")

    def __init__(self) -> None:
        self.is_on = True
        self.is_late = False
        self._sent = 0
        self._allowed = MAX_IN_FLIGHT
        self._probes: deque[tuple[int, int]] = deque(maxlen=MAX_PROBES)  # number of the probe, and bytes sent before it
        self._num_probes = 0
        self._due: float | None = None
        self._patience = PATIENCE

    @property
    def is_blocked(self) -> bool:
        """True if nothing may be sent now; a probe is on its way or needed then."""
        return self.is_on and self._sent >= self._allowed

    @property
    def wants_probe(self) -> bool:
        """True if a probe should be sent now: none is on its way, and half of the window is used."""
        return self.is_on and self._due is None and self._sent >= self._allowed - MAX_IN_FLIGHT // 2

    def note_sent(self, frames: Sequence[bytes]) -> None:
        """Count frames that were sent.

        Args:
            frames: the frames.
        """
        self._sent += sum(map(len, frames)) + FRAME_COST * len(frames)

    def probe(self, now: float) -> int:
        """Register a probe that is sent now.

        Args:
            now: monotonic time [s].

        Returns:
            Its number.
        """
        self._num_probes += 1
        self._probes.append((self._num_probes, self._sent))
        self._due = now + self._patience
        return self._num_probes

    def note_refusal(self, now: float) -> None:
        """Pause probes for a while, because one was refused.

        Args:
            now: monotonic time [s].
        """
        self.is_on = self.is_late = False
        self._probes.clear()
        self._due = now + self._patience
        self._patience = min(MAX_PATIENCE, 2 * self._patience)

    def note_answer(self, number: int) -> None:
        """Register the answer to a probe; all earlier probes were handled, too.

        Args:
            number: number of the probe.
        """
        while self._probes and self._probes[0][0] <= number:
            probe, sent = self._probes.popleft()
            if probe == number:
                self._allowed = sent + MAX_IN_FLIGHT
                self._patience = PATIENCE
                self.is_late = False
        if not self._probes:
            self._due = None

    @property
    def due(self) -> float | None:
        """Return when `expire` has something to do [s]."""
        return self._due

    def expire(self, now: float) -> bool:
        """Check the time-out of the last probe. After a time-out, more may be sent.

        If probes were refused, they are tried again when the pause is over.

        Args:
            now: monotonic time [s].

        Returns:
            True if the answer is overdue.
        """
        if self._due is None or now < self._due:
            return False
        self._due = None
        if not self.is_on:
            self.is_on = True
            self._allowed = self._sent + MAX_IN_FLIGHT
            return False
        self._allowed = max(self._allowed, self._sent) + MAX_IN_FLIGHT // 2
        self._patience = min(MAX_PATIENCE, 2 * self._patience)
        self.is_late = True
        return True

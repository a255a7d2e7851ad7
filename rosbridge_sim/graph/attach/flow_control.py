"""Flow control towards a rosbridge that takes everything and holds no client back.

rosbridge_suite reads a socket as fast as frames come and keeps them in a queue without a bound, so the socket never
fills however far it is behind, and neither TCP nor a ping tells. It does handle the frames of one socket in order,
though: the answer to a cheap call comes after all that was sent before that call. Such a call is a *probe*. What was
sent since the last probe that was answered is unproven, and beyond a window nothing more is sent until an answer comes.

What a frame costs there was measured: some 0.28 ms, and 0.18 us a byte. So a frame counts its bytes and 1,500 more.

A probe that is not answered for a while lets another half of a window out, the next one after twice that while, and so
on: who is only slow is never buried, and who answers no calls at all still gets a trickle. An answer that comes later
than that counts like any other. Who *refuses* the call has no such service: then there are no probes for a while, and
the socket alone holds us back. It is tried again, ever more seldom: rosapi is a program of its own, and may come up
after the bridge.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

__all__ = ["FRAME_COST", "MAX_IN_FLIGHT", "MAX_PATIENCE", "PATIENCE", "FlowControl"]

FRAME_COST = 1_500
"""Cost of a frame beside its bytes [bytes]."""

MAX_IN_FLIGHT = 512 * 1024
"""Bytes that may be unproven: a tenth of a second of rosbridge_suite's work, some 250 messages of an ego's state."""

PATIENCE, MAX_PATIENCE = 2.0, 60.0
"""Longest wait for the answer to a probe, the first time and at most [s]."""

MAX_PROBES = 16
"""Probes without an answer that are remembered; by then the last ones are minutes apart."""


class FlowControl:
    """The bytes that may still be sent on one socket.

    Attributes:
        is_on: the far side answers probes, as far as we know; while it does not, everything may be sent.
        is_late: the last probe was not answered in time.
    """

    __slots__ = ("_allowed", "_due", "_num_probes", "_patience", "_probes", "_sent", "is_late", "is_on")

    def __init__(self) -> None:
        self.is_on = True
        self.is_late = False
        self._sent = 0
        self._allowed = MAX_IN_FLIGHT
        self._probes: deque[tuple[int, int]] = deque(maxlen=MAX_PROBES)  # its number, and what was sent before it
        self._num_probes = 0
        self._due: float | None = None
        self._patience = PATIENCE

    @property
    def is_blocked(self) -> bool:
        """Return whether nothing more is to be sent for now; then a probe is on its way, or wanted."""
        return self.is_on and self._sent >= self._allowed

    @property
    def wants_probe(self) -> bool:
        """Return whether a probe should be sent now: none is on its way, and half of the window is used."""
        return self.is_on and self._due is None and self._sent >= self._allowed - MAX_IN_FLIGHT // 2

    def note_sent(self, frames: Sequence[bytes]) -> None:
        """Count frames that were sent."""
        self._sent += sum(map(len, frames)) + FRAME_COST * len(frames)

    def probe(self, now: float) -> int:
        """The number of a probe that is sent now."""
        self._num_probes += 1
        self._probes.append((self._num_probes, self._sent))
        self._due = now + self._patience
        return self._num_probes

    def note_refusal(self, now: float) -> None:
        """A probe was refused: nobody there answers them, for a while."""
        self.is_on = self.is_late = False
        self._probes.clear()
        self._due = now + self._patience
        self._patience = min(MAX_PATIENCE, 2 * self._patience)

    def note_answer(self, number: int) -> None:
        """A probe was answered; all before it were handled, too."""
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
        """Return whether the answer to the last probe is overdue; some more may be sent then.

        Where probes were refused, they are tried again from now on.
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

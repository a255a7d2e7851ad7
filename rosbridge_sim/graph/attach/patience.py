"""Waiting time for the answer to a question of ours, by the measured round trips.

A bridge handles the frames of a socket in order. So an answer comes after everything that was sent before its question,
and the time for it grows with the number of those frames. An answer after the waiting time is measured, too: a bridge
that is only slow then gets more time for the next question.
"""

from __future__ import annotations

from collections import deque
from typing import Final

PROBE_PATIENCE: Final = 2.0
"""Shortest wait for an answer to a question [s]; rosbridge_suite in ROS 2 searches one second for a missing service."""

MAX_QUESTION_PATIENCE: Final = 60.0
"""Longest wait for an answer [s]: as for a probe."""

SLACK: Final = 4.0
"""The waiting time in expected round trips: a bridge's load varies, and some answers of rosapi take longer."""

MEMORY: Final = 8
"""Round trips that are remembered; the longest of them counts, and a bridge that was slow once is soon trusted again.
"""


class Patience:
    """The measured round trips of one socket.

    Attributes:
        has_answer: a call was answered with success.
        has_refusal: a call was refused, so the far side does answer calls.
    """

    def __init__(self) -> None:
        self.has_answer = self.has_refusal = False
        self._round_trips: deque[float] = deque(maxlen=MEMORY)
        self._per_frame: deque[float] = deque(maxlen=MEMORY)

    def note(self, round_trip: float, num_frames: float, *, is_ok: bool) -> None:
        """Note an answer, in time or late.

        Args:
            round_trip: time since the question [s].
            num_frames: number of frames that were before it, itself included.
            is_ok: it was no refusal.
        """
        if not is_ok:
            self.has_refusal = True
            return
        self.has_answer = True
        self._round_trips.append(round_trip)
        self._per_frame.append(round_trip / max(num_frames, 1.0))

    def wait(self, num_frames: float) -> float:
        """Return the time in which an answer should come [s].

        Args:
            num_frames: number of frames that are before the question, itself included.
        """
        longest = max(self._round_trips, default=0.0)
        expected = max(longest, num_frames * max(self._per_frame, default=0.0))
        return min(MAX_QUESTION_PATIENCE, max(PROBE_PATIENCE, SLACK * expected))

"""Frames that real time owes: 50 a second from an anchor, without drift, and without a race after a stall.

Frame n since the anchor is due at anchor + n * 20 ms, whatever happened before, so a late step is made up for and no
rounding adds up. A world that is behind by more than `STALL` must not race through missed frames (a laptop that slept
for a night owes two million frames): the anchor moves instead, and the world goes on from where it stands.
"""

from __future__ import annotations

from typing import Final

from rosbridge_sim.world.state import DT

__all__ = ["STALL", "RealTimePacer"]

STALL: Final = 0.5
"""Largest delay that the world still catches up with [s]."""


class RealTimePacer:
    """Counter of the frames of real time.

    Attributes:
        num_stalls: how often the anchor had to move.
        lost_time: real time that was given up by that [s].
    """

    def __init__(self) -> None:
        self.num_stalls = 0
        self.lost_time = 0.0
        self._anchor: float | None = None
        self._num_done = 0

    def start(self, now: float) -> None:
        """Count from `now` on: the first frame is due one step later."""
        self._anchor = now
        self._num_done = 0

    @property
    def is_started(self) -> bool:
        """True once `start` has been called."""
        return self._anchor is not None

    @property
    def shown_at(self) -> float:
        """Time at which the last frame was due, late or not [s]."""
        assert self._anchor is not None
        return self._anchor + self._num_done * DT

    @property
    def due_at(self) -> float:
        """Time at which the next frame is due [s]. It is owed from exactly then on: no busy waiting, no early step."""
        assert self._anchor is not None
        return self._anchor + (self._num_done + 1) * DT

    def count(self) -> None:
        """Note that the next frame has been computed."""
        self._num_done += 1

    def forgive(self, now: float) -> float:
        """After a stall, shift the clock so that one frame is owed.

        Returns:
            The time that was given up [s], 0.0 without a stall.
        """
        behind = now - self.due_at
        if behind <= STALL:
            return 0.0
        self.num_stalls += 1
        self.lost_time += behind
        self._anchor, self._num_done = now - DT, 0
        return behind

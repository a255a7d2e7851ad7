"""Frames that real time owes: 50 a second from an anchor, without drift, and without a race after a stall.

Frame n since the anchor is due at anchor + n * 20 ms, whatever happened before, so a late step is made up for and no
rounding adds up. A world that is behind by more than `STALL` must not race through missed frames (a laptop that slept
for a night owes two million frames): the anchor moves instead, and the world goes on from where it stands.

The *real-time factor* says how many simulated seconds go by in a second: with 2, a frame is due every 10 ms. With 0 a
frame is due at any time: as fast as possible.
"""

from __future__ import annotations

import math
from typing import Final

from rosbridge_sim.simulator.bus.publishers import MAX_WALL_RATE
from rosbridge_sim.world.state.world import DT

MIN_FACTOR: Final = 0.1
MAX_FACTOR: Final = 20.0
"""Least and greatest real-time factor: from five frames a second, which a person can follow one by one, to a thousand,
which a small scene reaches."""

WINDOW: Final = 1.0
"""Least time over which the factor is measured [s]."""

STALL: Final = 0.5
"""Largest delay that the world still catches up with [s]."""


def why_no_factor(factor: float) -> str:
    """Return why a number is no real-time factor; an empty text where it is one."""
    if factor == 0.0 or MIN_FACTOR <= factor <= MAX_FACTOR:
        return ""
    return f"expected {MIN_FACTOR:g} to {MAX_FACTOR:g}, or 0 for as fast as possible; got {factor:g}"


class ShowLimit:
    """Chooses the frames with which a topic of every frame goes out, where they are too many for wall time."""

    def __init__(self, pacer: RealTimePacer) -> None:
        """Let every frame pass for as long as the pacer is not too fast."""
        self._pacer = pacer
        self._free_at = -math.inf

    def is_open(self, frame: int, now: float) -> bool:
        """Return whether a message may go out with this frame; each may be asked once."""
        factor = self._pacer.factor
        if 0.0 < factor <= MAX_WALL_RATE * DT:
            return True
        if not factor:
            if now < self._free_at:
                return False
            self._free_at = now + 1.0 / MAX_WALL_RATE
            return True
        per_frame = MAX_WALL_RATE * DT / factor
        return math.floor(frame * per_frame) > math.floor((frame - 1) * per_frame)


class RealTimePacer:
    """Counter of the frames of real time.

    Attributes:
        factor: simulated seconds in a second; 0.0 for as fast as possible.
        num_stalls: how often the anchor had to move.
        lost_time: real time that was given up by that [s].
    """

    def __init__(self) -> None:
        self.factor = 1.0
        self.num_stalls = 0
        self.lost_time = 0.0
        self._anchor: float | None = None
        self._num_done = 0
        self._num_counted = 0  # frames since the first one; the anchor may move
        # When the factor was last measured from, and from when on that is done next: (time [s], frames counted).
        self._mark = self._next_mark = (0.0, 0)

    def start(self, now: float) -> None:
        """Count from `now` on: the first frame is due one step later."""
        self._anchor = now
        self._num_done = 0
        self._mark = self._next_mark = (now, self._num_counted)

    @property
    def is_started(self) -> bool:
        """True once `start` has been called."""
        return self._anchor is not None

    @property
    def frame_time(self) -> float:
        """Duration of a frame [s]; 0.0 for as fast as possible."""
        return DT / self.factor if self.factor else 0.0

    @property
    def shown_at(self) -> float:
        """Time at which the last frame was due, late or not [s]."""
        assert self._anchor is not None
        return self._anchor + self._num_done * self.frame_time

    @property
    def due_at(self) -> float:
        """Time at which the next frame is due [s]. It is owed from exactly then on: no busy waiting, no early step."""
        assert self._anchor is not None
        return self._anchor + (self._num_done + 1) * self.frame_time if self.factor else -math.inf

    def set_factor(self, factor: float, now: float) -> None:
        """Have another real-time factor from now on.

        Args:
            factor: one of which `why_no_factor` says nothing.
        """
        self.factor = factor
        if self.is_started:
            self.start(now)

    def measure(self, now: float) -> float:
        """Return the factor that was reached over the last seconds; 0.0 before any time has passed.

        Args:
            now: monotonic time [s]; call it at least now and then, for the last seconds to be told from those before.
        """
        since, num = self._mark
        if now - self._next_mark[0] >= WINDOW:
            self._mark, self._next_mark = self._next_mark, (now, self._num_counted)
        return (self._num_counted - num) * DT / (now - since) if now > since else 0.0

    def count(self) -> None:
        """Note that the next frame has been computed."""
        self._num_done += 1
        self._num_counted += 1

    def forgive(self, now: float) -> float:
        """After a stall, shift the clock so that one frame is owed.

        Returns:
            The time that was given up [s], 0.0 without a stall.
        """
        behind = now - self.due_at
        if behind <= STALL or not self.factor:
            return 0.0
        self.num_stalls += 1
        self.lost_time += behind
        self._anchor, self._num_done = now - self.frame_time, 0
        return behind

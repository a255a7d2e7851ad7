"""A gate behind each frame: closed while something that belongs to the frame is still being made elsewhere.

Pictures and point clouds take longer than a turn of the loop, so a thread of the shell makes them. In synchronous mode
they belong to the tick of their frame. So a component closes the gate after such a frame. No further frame of a tick is
computed, and no tick is answered, until the gate is open again. All other clients are served meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable


class FrameGate:
    """A gate that may be closed several times; it is open when each closing has been undone.

    Attributes:
        is_open: nothing of the last frame is missing.
        on_open: `(now)` called when it opens.
    """

    def __init__(self) -> None:
        self.on_open: list[Callable[[float], object]] = []
        self.is_open = True
        self._num_closed = 0

    def close(self) -> None:
        """Hold the frames that follow, and the answers, until as many calls of `open`."""
        self._num_closed += 1
        self.is_open = False

    def open(self, now: float) -> None:
        """Undo one `close`."""
        assert self._num_closed, "the gate is open"
        self._num_closed -= 1
        self.is_open = not self._num_closed
        if self.is_open:
            for act in self.on_open:
                act(now)

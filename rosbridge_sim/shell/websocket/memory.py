"""The C library's memory: kept while large messages come, given back to the system when they stop."""

from __future__ import annotations

import asyncio
import ctypes
import sys
from collections.abc import Callable

__all__ = ["LARGE_FRAME", "MemoryReturn", "keep_memory"]

LARGE_FRAME = 2**20
"""A frame of at least this size leaves enough free memory to be worth giving back [bytes]."""

DELAY = 3.0
"""Time from the last large frame until memory is given back [s]: longer than between two images of a camera."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
"""Constants of glibc's malloc.h."""


def keep_memory() -> None:
    """Tell the C library to keep freed memory for the next large message. Only for glibc; others are not changed.

    Without this, glibc gives buffers of 128 kB and more, and free memory at the end of the heap, back to the system at
    once. A stream of 100 kB images then costs 30 to 70 page faults per image, a third of its whole time. Relaying an
    image of 16 MB takes 65 ms and not 24 ms.
    """
    mallopt = _function("mallopt")
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, 32 * 2**20)  # the most that glibc accepts
        mallopt(_M_TRIM_THRESHOLD, 128 * 2**20)


class MemoryReturn:
    """Gives free memory back to the system when no large frames come any more."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        """Prepare; the first large frame starts the timer.

        Args:
            loop: runs the timer.
        """
        self._loop = loop
        self._trim = _function("malloc_trim")
        self._timer: asyncio.TimerHandle | None = None
        self._due = 0.0

    def note_large_frame(self) -> None:
        """Note that a large frame was received or sent."""
        self._due = self._loop.time() + DELAY
        if self._timer is None and self._trim is not None:
            self._timer = self._loop.call_at(self._due, self._give_back)

    def stop(self) -> None:
        """Cancel the timer."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _give_back(self) -> None:
        self._timer = None
        if self._loop.time() < self._due:  # more large frames came meanwhile
            self._timer = self._loop.call_at(self._due, self._give_back)
        elif self._trim is not None:
            self._trim(0)


def _function(name: str) -> Callable[..., int] | None:
    """Return a function of the C library; None if there is none with that name."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None

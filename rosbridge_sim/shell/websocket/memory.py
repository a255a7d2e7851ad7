"""The C library's memory: kept for the next large message while messages come, given back when they do not."""

from __future__ import annotations

import asyncio
import ctypes
import sys
from collections.abc import Callable

__all__ = ["LARGE_FRAME", "MemoryReturn", "keep_memory"]

LARGE_FRAME = 2**20
"""A frame from here on leaves so much free memory behind that it is worth giving back [bytes]."""

DELAY = 3.0
"""How long after the last large frame memory is given back [s]: not between two images of a camera."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
"""Names of glibc's malloc.h."""


def keep_memory() -> None:
    """Have the C library keep freed memory for the next large message (glibc alone; others do as they do).

    By itself it gives buffers of 128 kB and more, and what is free at the heap's end, back to the system at once. A
    stream of 100 kB images then costs 30 to 70 page faults each, a third of all its time; an image of 16 MB takes 65 ms
    instead of 24 ms to relay.
    """
    mallopt = _function("mallopt")
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, 32 * 2**20)  # the most that glibc accepts
        mallopt(_M_TRIM_THRESHOLD, 128 * 2**20)


class MemoryReturn:
    """Gives free memory back to the system once no large frames come any more."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        """Set no timer before the first large frame."""
        self._loop = loop
        self._trim = _function("malloc_trim")
        self._timer: asyncio.TimerHandle | None = None
        self._due = 0.0

    def note_large_frame(self) -> None:
        """Take note that a large frame came or went."""
        self._due = self._loop.time() + DELAY
        if self._timer is None and self._trim is not None:
            self._timer = self._loop.call_at(self._due, self._give_back)

    def stop(self) -> None:
        """Cancel what is planned."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _give_back(self) -> None:
        self._timer = None
        if self._loop.time() < self._due:  # more have come meanwhile
            self._timer = self._loop.call_at(self._due, self._give_back)
        elif self._trim is not None:
            self._trim(0)


def _function(name: str) -> Callable[..., int] | None:
    """A function of the C library; None where there is none of that name."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None

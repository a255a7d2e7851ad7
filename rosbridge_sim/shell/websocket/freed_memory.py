"""The C library's memory: kept while large messages come, given back to the system when they stop.

Python frees large messages to the C library, which keeps them for later. So memory is given back some time after the
last large frame, and after each large fall of the bytes held for clients, whatever the size of their frames.
"""

from __future__ import annotations

import ctypes
import mmap
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Thread

LARGE_FRAME = 2**20
"""A frame of at least this size leaves enough free memory to be worth giving back [bytes]."""

DELAY = 3.0
"""Time from the last large frame until memory is given back [s]: longer than between two images of a camera."""

FALL = 32 * 2**20
"""A fall of the held bytes that is worth giving back, and half of such a rise of the whole process [bytes]."""

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
    """Decides when free memory is given back to the system."""

    def __init__(self, give_back: Callable[[], None], resident: Callable[[], int]) -> None:
        """Prepare; `look` must be called from time to time.

        Args:
            give_back: gives free memory back, such as `trim_memory`.
            resident: returns the memory of the process [bytes], such as `resident_bytes`.
        """
        self._give_back = give_back
        self._resident = resident
        self._after_frames: float | None = None  # time to give back, unless more large frames come [s]
        self._after_fall: float | None = None  # the same after a fall; further ones do not delay it
        self._most_held = 0
        self._base: int | None = None  # memory of the process after it was given back last [bytes]

    def note_large_frame(self, now: float) -> None:
        """Note that a large frame was received or sent."""
        self._after_frames = now + DELAY

    def look(self, num_bytes_held: int, now: float) -> None:
        """Give memory back if it is time to.

        A rise of the whole process counts like a fall, because held bytes may rise and fall between two calls.

        Args:
            num_bytes_held: bytes held for all clients.
        """
        resident = self._resident()
        if self._base is None:
            self._base = resident
        self._most_held = max(self._most_held, num_bytes_held)
        has_fallen = self._most_held - num_bytes_held >= FALL or resident - self._base >= 2 * FALL
        if has_fallen and self._after_fall is None:
            self._after_fall = now + DELAY
        if any(due is not None and now >= due for due in (self._after_frames, self._after_fall)):
            self._after_frames = self._after_fall = self._base = None
            self._most_held = num_bytes_held
            self._give_back()


def trim_memory() -> None:
    """Give free memory of the C library back to the system, in a thread: 700 MB take 65 ms of CPU time."""
    trim = _function("malloc_trim")
    if trim is not None:
        Thread(target=trim, args=(0,), name="malloc_trim", daemon=True).start()


def resident_bytes() -> int:
    """Return the resident memory of this process; 0 where the system has no `/proc` [bytes]."""
    try:
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * mmap.PAGESIZE
    except OSError:
        return 0


def _function(name: str) -> Callable[..., int] | None:
    """Return a function of the C library; None if there is none with that name."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None

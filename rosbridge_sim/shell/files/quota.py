"""A quota for files that clients let the server write into `--data-dir`, in bytes and in number of files.

Everything in the folder counts, and folders count as files. Recordings (`.bag`, `.mcap`, `.db3`) do not count, because
they belong to the user. The contents are counted at the start; after that the quota adds what it allows. The user may
delete files meanwhile, so a full quota counts again, at most once a minute. Counting two hundred thousand files takes a
second, so a thread counts large folders.
"""

from __future__ import annotations

import asyncio
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError

FILES_AT_ONCE: Final = 1_000
"""Files that are counted at the start without a thread: two milliseconds on a local disk."""

MAX_COUNTED: Final = 5_000_000
"""Counting stops after so many files: half a minute of work of a thread."""

COUNT_PERIOD: Final = 60.0
"""Shortest time between two counts, and between two warnings about one matter [s]."""

MANY_FILES: Final = 10_000
"""So many files within `COUNT_PERIOD` give a warning: no recording of sensors makes 167 per second."""

_BREATH: Final = 100
"""Files after which the counting thread lets other threads run."""

_RECORDINGS: Final = (".bag", ".mcap", ".db3")

_log = logging.getLogger("rosbridge_sim.storage")


@dataclass(slots=True)
class Usage:
    """A number of bytes and files; folders count as files."""

    num_bytes: int = 0
    num_files: int = 0


Aside = Callable[[Callable[[], Usage], Callable[[Usage], None]], None]
"""`(work, done)`: do the work without delaying the loop, then call `done` with its result."""


def in_thread(loop: asyncio.AbstractEventLoop) -> Aside:
    """Return a function that does work in a new thread and delivers its result on the loop."""

    def aside(work: Callable[[], Usage], done: Callable[[Usage], None]) -> None:
        def run() -> None:
            usage = work()
            with suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(done, usage)

        threading.Thread(target=run, name="quota", daemon=True).start()

    return aside


class DataQuota:
    """The bytes and files that may still be written into one folder."""

    def __init__(
        self,
        root: str | Path,
        max_bytes: int | None,
        max_files: int | None,
        *,
        aside: Aside,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Count the contents. A long count ends later, and files are allowed until then.

        Args:
            root: the folder; it need not exist.
            max_bytes: limit for all files together; None means no limit.
            max_files: limit for files and folders; None means no limit.
            aside: does long work.
            clock: monotonic time [s].
        """
        self._root = root
        self._max_bytes = max_bytes
        self._max_files = max_files
        self._aside = aside
        self._clock = clock
        self._is_stopped = threading.Event()
        self._used = Usage()
        self._written = Usage()  # written since the start of the current count
        self._is_counting = False
        self._counted_at = clock()
        self._refused_at = self._warned_at = float("-inf")
        self._recent: deque[tuple[float, int]] = deque()  # (time, number of files) of the last `COUNT_PERIOD`
        self._num_recent = 0
        if max_bytes is not None or max_files is not None:
            self._begin()

    def stop(self) -> None:
        """Stop a running count."""
        self._is_stopped.set()

    def check(self, num_bytes: int, num_files: int) -> None:
        """Refuse files that would exceed the quota.

        Raises:
            DocumentError: the quota is exceeded; the text names it and its flag.
        """
        used = self._used
        if self._max_files is not None and used.num_files + num_files > self._max_files:
            why = f"{used.num_files:,} of {self._max_files:,} files; delete some or raise --data-quota-files"
        elif self._max_bytes is not None and used.num_bytes + num_bytes > self._max_bytes:
            why = f"{used.num_bytes:,} of {self._max_bytes:,} bytes; delete files or raise --data-quota"
        else:
            return
        now = self._clock()
        if not self._is_counting and now - self._counted_at >= COUNT_PERIOD:
            self._counted_at = now
            self._count_aside(_walk(self._root), Usage())
        text = f"the quota of --data-dir is reached: {why}"
        if now - self._refused_at >= COUNT_PERIOD:
            self._refused_at = now
            _log.warning("%s: %s", self._root, text)
        raise DocumentError(text)

    def add(self, num_bytes: int, num_files: int, source: str) -> None:
        """Note that files were written.

        Args:
            source: the topic or service that a client used, for the log.
        """
        for usage in (self._used, self._written):
            usage.num_bytes += num_bytes
            usage.num_files += num_files
        now = self._clock()
        recent = self._recent
        if recent and recent[-1][0] == int(now):
            recent[-1] = (recent[-1][0], recent[-1][1] + num_files)
        else:
            recent.append((int(now), num_files))
        self._num_recent += num_files
        while recent[0][0] <= now - COUNT_PERIOD:
            self._num_recent -= recent.popleft()[1]
        if self._num_recent >= MANY_FILES and now - self._warned_at >= COUNT_PERIOD:
            self._warned_at = now
            limit = "no limit" if self._max_files is None else f"at most {self._max_files:,}"
            _log.warning(
                "%s: %s files were written within a minute, the last by %s; if that is not intended,"
                " --data-quota-files limits them (now %s)",
                self._root,
                f"{self._num_recent:,}",
                source,
                limit,
            )

    def _begin(self) -> None:
        """Start to count; a long count goes on in a thread."""
        walk = _walk(self._root)
        for _, size in zip(range(FILES_AT_ONCE), walk, strict=False):
            self._used.num_files += 1
            self._used.num_bytes += size
        if self._used.num_files == FILES_AT_ONCE:
            self._count_aside(walk, Usage(self._used.num_bytes, self._used.num_files))

    def _count_aside(self, walk: Iterator[int], usage: Usage) -> None:
        """Continue the count in a thread."""
        self._is_counting = True
        self._written = Usage()
        self._aside(lambda: self._count(walk, usage), self._end_count)

    def _count(self, walk: Iterator[int], usage: Usage) -> Usage:
        """Count the rest, in a thread. The count may stop when the quota is exceeded."""
        max_files = MAX_COUNTED if self._max_files is None else min(self._max_files, MAX_COUNTED)
        for size in walk:
            usage.num_files += 1
            usage.num_bytes += size
            is_over = self._max_bytes is not None and usage.num_bytes > self._max_bytes
            if is_over or usage.num_files > max_files or self._is_stopped.is_set():
                break
            if usage.num_files % _BREATH == 0:
                time.sleep(0)
        return usage

    def _end_count(self, usage: Usage) -> None:
        """Use the new count. Files written during the count are added, though some may be counted twice."""
        self._is_counting = False
        self._used = Usage(usage.num_bytes + self._written.num_bytes, usage.num_files + self._written.num_files)


def _walk(root: str | Path) -> Iterator[int]:
    """Yield the size of each file and folder below a folder [bytes], 0 for folders; links are not followed."""
    folders = [os.fspath(root)]
    while folders:
        with suppress(OSError), os.scandir(folders.pop()) as entries:  # a missing or inaccessible folder counts as 0
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    folders.append(entry.path)
                    yield 0
                elif not entry.name.endswith(_RECORDINGS):
                    yield _size_of(entry)


def _size_of(entry: os.DirEntry[str]) -> int:
    """Return the size of a file [bytes]; 0 if it was deleted meanwhile."""
    try:
        return entry.stat(follow_symlinks=False).st_size
    except OSError:
        return 0

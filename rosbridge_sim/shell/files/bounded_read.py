"""Reading of files, up to a length: whole, or in pieces."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from time import sleep
from typing import Final

from rosbridge_sim.errors import DocumentError, file_errors

_FIRST_READ = 2**15
"""Size of the first read [bytes]: a first read of `max_bytes` would allocate that much for each of many small files."""


def read_bounded(path: Path, max_bytes: int) -> bytes:
    """Return a file's content.

    A pipe is refused, because a read of it waits for as long as nothing writes.

    Raises:
        DocumentError: it is no regular file, it cannot be read, or it is longer than `max_bytes`.
    """
    with file_errors(path, "read"), open(path, "rb", opener=_open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise DocumentError(f"{path}: expected a file, got a pipe or a device; write its content to a file")
        content = file.read(_FIRST_READ)
        if len(content) == _FIRST_READ:
            content += file.read(max_bytes + 1 - _FIRST_READ)
    if len(content) > max_bytes:
        raise DocumentError(f"{path}: expected at most {max_bytes:,} bytes; it is longer")
    return content


PIECE: Final = 2**15
"""Size of a piece [bytes]: a reader of maps takes about five milliseconds for it."""

TURN: Final = 2e-4
"""Pause after each piece [s], in which a thread that waits for the interpreter takes its lock.

The reader gives the lock up in calls of numpy too, but for microseconds: the other thread wakes up too late, and begins
to wait anew. An event loop waited for 200 ms so. A thread on another core wakes up within 100 microseconds.
"""


def read_in_pieces(path: Path, max_bytes: int) -> Iterator[bytes]:
    """Yield a file's content in pieces of at most `PIECE` bytes; other threads have a turn after each.

    Nothing longer than a piece is in memory.

    Raises:
        DocumentError: as for `read_bounded`; a file that is too long is known before its first piece.
    """
    with file_errors(path, "read"), open(path, "rb", opener=_open_at_once) as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise DocumentError(f"{path}: expected a file, got a pipe or a device; write its content to a file")
        if status.st_size > max_bytes:
            raise DocumentError(f"{path}: expected at most {max_bytes:,} bytes; it is longer")
        left = max_bytes  # a file can grow
        while left > 0 and (piece := file.read(min(PIECE, left))):
            left -= len(piece)
            yield piece
            sleep(TURN)


def _open_at_once(path: str, flags: int) -> int:
    """Open a file; a pipe that nothing writes to is opened without waiting."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))

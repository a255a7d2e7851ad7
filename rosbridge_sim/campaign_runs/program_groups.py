"""Process groups of programs, noted on the disk, so that they end even if the worker that started them was killed.

A worker ends the group of its program itself. A worker that was killed (no memory, a hang in compiled code) cannot, so
each group is noted in the folder of its run, and the campaign ends what is left there. The note has the time at which
the program started, because the system gives its number to other processes later.

A process that has left its group (a daemon) comes to the worker when its parent has ended, and ends with the run, too.
Both need Linux.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
from pathlib import Path
from typing import Final

NOTE: Final = "group"
"""Name of the file in the folder of a run."""


def note_group(work: Path, number: int) -> None:
    """Note the group of a program that was started just now. A full disk is no reason not to drive."""
    began = _began(Path(f"/proc/{number}"))
    with contextlib.suppress(OSError):
        (work / NOTE).write_text(f"{number} {began}\n")


def end_groups(folder: Path, pattern: str = "*") -> None:
    """End all groups that are noted in the folders of runs; those that have ended are no error.

    Args:
        folder: has a folder for each run that is not done.
    """
    for note in folder.glob(f"{pattern}/{NOTE}"):
        with contextlib.suppress(OSError, ValueError):
            number, began = map(int, note.read_text().split())
            if began and _is_that_group(number, began):
                os.killpg(number, signal.SIGKILL)
        with contextlib.suppress(OSError):
            note.unlink()


def _is_that_group(number: int, began: int) -> bool:
    """Return whether a group is that of a program: its leader, or else a process of it that came later, is there."""
    leader = _began(Path(f"/proc/{number}"))
    if leader:
        return leader == began
    for process in Path("/proc").glob("[0-9]*"):
        fields = _stat(process)
        if len(fields) > _START and fields[_GROUP] == fields[_SESSION] == str(number):
            return int(fields[_START]) >= began
    return False


_GROUP, _SESSION, _START = 2, 3, 19
"""Fields of /proc/PID/stat behind the name, see proc(5)."""


def _stat(process: Path) -> list[str]:
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def _began(process: Path) -> int:
    """Return when a process started, in ticks since the start of the machine; 0 where that cannot be told."""
    fields = _stat(process)
    return int(fields[_START]) if len(fields) > _START else 0


_SUBREAPER: Final = 36
"""PR_SET_CHILD_SUBREAPER of prctl(2)."""


def adopt_orphans() -> None:
    """Have processes whose parent has ended become children of this process, if they descend from it."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SUBREAPER, 1, 0, 0, 0)


def children() -> frozenset[int]:
    """Return the children of this process; none where that cannot be told."""
    own = os.getpid()
    try:
        return frozenset(map(int, Path(f"/proc/{own}/task/{own}/children").read_text().split()))
    except (OSError, ValueError):
        return frozenset()


def end_children(others: frozenset[int]) -> None:
    """End all children but some; what these leave behind comes to this process, and ends as well."""
    for _ in range(_ROUNDS):
        left = children() - others
        if not left:
            return
        for number in left:
            with contextlib.suppress(OSError):
                os.kill(number, signal.SIGKILL)
            with contextlib.suppress(OSError):
                os.waitpid(number, 0)


_ROUNDS: Final = 100
"""Generations of processes that are ended."""

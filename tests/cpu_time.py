"""CPU time of programs, and waits that are bounded by it: a busy machine takes longer for the same CPU time."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

__all__ = ["communicate", "cpu_time", "run"]

LIMIT = 240.0
"""CPU time that a program of a test may take [s]: ten times what the longest one does."""

PATIENCE = 60.0
"""A program that has used no CPU time for so long hangs [s]."""


class Program(Protocol):
    """What `communicate` uses of `subprocess.Popen`."""

    @property
    def pid(self) -> int:
        """Number of its process."""

    def communicate(self) -> tuple[str, str]:
        """Wait for its end; its output and its errors."""


def cpu_time(*pids: int) -> float:
    """CPU time of processes, and of all programs that they have started and that those have started [s]."""
    if not Path("/proc/self/stat").exists():
        return sum(os.times()[:4])
    ticks, waiting = 0, [(pid, 0) for pid in pids]
    counted: set[int] = set()
    while waiting:
        pid, parent = waiting.pop()
        if pid in counted:
            continue  # a program that is named beside the one that has started it
        try:
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has ended meanwhile
        if parent not in {0, int(fields[1])}:
            continue  # the child has ended, and another process has its number
        with suppress(OSError):  # likewise
            for task in list(Path(f"/proc/{pid}/task").iterdir()):
                with suppress(OSError):  # a thread that has ended; the others have children, too
                    waiting += [(int(child), pid) for child in (task / "children").read_text().split()]
        counted.add(pid)
        ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def communicate(program: Program, limit: float = LIMIT, patience: float = PATIENCE) -> tuple[str, str]:
    """Wait for the end of a program; what it has written to stdout and stderr.

    Args:
        limit: CPU time that it may take [s].
        patience: after so long without any CPU time it is said to hang [s].

    Raises:
        subprocess.TimeoutExpired: it has taken more, or hangs; it is killed.
    """
    has_ended = threading.Event()
    killed_after: list[float] = []

    def watch() -> None:
        before = -1.0
        while not has_ended.wait(patience):
            used = cpu_time(program.pid)
            if used == before or used >= limit:  # it is less if the program, or one that it has started, has just ended
                killed_after.append(used)
                with suppress(ProcessLookupError):
                    os.kill(program.pid, signal.SIGKILL)
                return
            before = used

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        texts = program.communicate()
    finally:
        has_ended.set()
        watcher.join()
    if killed_after:
        raise subprocess.TimeoutExpired(f"program {program.pid}", killed_after[0], *texts)
    return texts


def run(words: Sequence[str | Path], **options: Any) -> subprocess.CompletedProcess[str]:  # noqa: ANN401 - those of `Popen`
    """Run a program to its end, as `communicate` waits for it; its output is text."""
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options) as program:
        out, err = communicate(program)
    return subprocess.CompletedProcess(words, program.returncode, out, err)

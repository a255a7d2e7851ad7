"""Starting the programs that are measured, pinned to one core (and this process to another), and reading their cost."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

__all__ = ["FLOOR", "SERVER", "Program", "attached", "machine", "running"]

_ROOT = Path(__file__).resolve().parents[2]
_CORES = sorted(os.sched_getaffinity(0))

SERVER = (sys.executable, "-m", "rosbridge_sim", "serve", "--port", "0")
FLOOR = (sys.executable, str(_ROOT / "scripts" / "bench" / "relay.py"))


@dataclass(frozen=True, slots=True)
class Program:
    """A program that listens.

    Attributes:
        pid: its process.
        port: where it listens.
        start: from its first instruction to its listening line [s].
    """

    pid: int
    port: int
    start: float

    def cpu(self) -> float:
        """CPU time of the whole process so far [s], to the nanosecond."""
        # Linux, posix-cpu-timers: a process's own clock has the id (~pid << 3) | CPUCLOCK_SCHED
        return time.clock_gettime((~self.pid << 3) | 2)

    def memory(self) -> float:
        """Resident memory now [MB]."""
        for line in Path(f"/proc/{self.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
        raise AssertionError("Linux always names VmRSS")


@contextmanager
def running(command: Sequence[str], log: IO[bytes] | None = None) -> Iterator[Program]:
    """Run a program that listens, from its start to the end of the block.

    Raises:
        RuntimeError: it ended before it listened.
    """
    with _started(command, " listening on ws://", log) as (pid, line, start):
        yield Program(pid, int(line.rsplit(":", 1)[1]), start)


@contextmanager
def attached(bridge: Program, *flags: str) -> Iterator[Program]:
    """Run a simulator that has dialled a bridge: a program without a port, to be met at the bridge's.

    Raises:
        RuntimeError: it ended before everything was announced.
    """
    command = (sys.executable, "-m", "rosbridge_sim", "attach", f"ws://127.0.0.1:{bridge.port}", *flags)
    with _started(command, " attached to ws://", None) as (pid, _, start):
        yield Program(pid, bridge.port, start)


@contextmanager
def _started(command: Sequence[str], ready: str, log: IO[bytes] | None) -> Iterator[tuple[int, str, float]]:
    """The process, the first line, and how long that took [s]."""
    # what is started inherits the core; preexec_fn would cost a fork of this process in full
    os.sched_setaffinity(0, {_CORES[0]})
    begun = time.perf_counter()
    process = subprocess.Popen(  # noqa: S603 - our own programs
        command, cwd=_ROOT, stdout=subprocess.PIPE, stderr=log or subprocess.DEVNULL, text=True
    )
    if len(_CORES) > 1:
        os.sched_setaffinity(0, {_CORES[1]})
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        start = time.perf_counter() - begun
        if ready not in line:
            raise RuntimeError(f"{' '.join(command)} said {line!r} in place of {ready!r} and where")
        yield process.pid, line, start
    finally:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()


def machine() -> str:
    """What the figures were measured on, in one line."""
    model = next(
        (
            line.split(":", 1)[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ),
        "unknown processor",
    )
    pinned = "server and load on a core each" if len(_CORES) > 1 else "server and load share the only core"
    return f"{model}, {len(_CORES)} cores ({pinned}), Python {sys.version.split()[0]}"

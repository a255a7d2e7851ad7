"""Start of the measured programs, pinned to one core (and of this process to another), and their cost."""

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

from scripts.bench.reference import reference_line

_ROOT = Path(__file__).resolve().parents[2]
_CORES = sorted(os.sched_getaffinity(0))

SERVER = (sys.executable, "-m", "rosbridge_sim", "serve", "--port", "0")
FLOOR = (sys.executable, str(_ROOT / "scripts" / "bench" / "relay.py"))


@dataclass(frozen=True, slots=True)
class Program:
    """A program that listens.

    Attributes:
        pid: of its process.
        port: that it listens on.
        start: time from its start to its line about listening [s].
    """

    pid: int
    port: int
    start: float

    def cpu(self) -> float:
        """Return the CPU time of the whole process so far.

        Returns:
            Seconds, with a resolution of a nanosecond.
        """
        # Linux, posix-cpu-timers: a process's own clock has the id (~pid << 3) | CPUCLOCK_SCHED
        return time.clock_gettime((~self.pid << 3) | 2)

    def memory(self) -> float:
        """Return the resident memory.

        Returns:
            [MB].
        """
        for line in Path(f"/proc/{self.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
        raise AssertionError("Linux always names VmRSS")


@contextmanager
def running(command: Sequence[str], log: IO[bytes] | None = None) -> Iterator[Program]:
    """Run a program that listens, until the end of the block.

    Args:
        command: its words.
        log: gets its stderr; None discards it.

    Yields:
        The program.

    Raises:
        RuntimeError: it ended before it listened.
    """
    with _started(command, " listening on ws://", log) as (pid, line, start):
        yield Program(pid, int(line.rsplit(":", 1)[1]), start)


@contextmanager
def attached(bridge: Program, *flags: str) -> Iterator[Program]:
    """Run a simulator attached to a bridge, until the end of the block; clients connect to the bridge's port.

    Args:
        bridge: a running server.
        flags: of `attach`.

    Yields:
        The simulator, with the bridge's port.

    Raises:
        RuntimeError: it ended before everything was announced.
    """
    command = (sys.executable, "-m", "rosbridge_sim", "attach", f"ws://127.0.0.1:{bridge.port}", *flags)
    with _started(command, " attached to ws://", None) as (pid, _, start):
        yield Program(pid, bridge.port, start)


@contextmanager
def _started(command: Sequence[str], ready: str, log: IO[bytes] | None) -> Iterator[tuple[int, str, float]]:
    """Yield the process id, its first line, and the time until that line [s]."""
    # the child inherits the core; preexec_fn would need a full fork of this process
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
    """Return a line about the machine, for the figures.

    Returns:
        Processor, cores, Python version, and what the reference loop took.
    """
    model = next(
        (
            line.split(":", 1)[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ),
        "unknown processor",
    )
    pinned = "server and load on a core each" if len(_CORES) > 1 else "server and load share the only core"
    return f"{model}, {len(_CORES)} cores ({pinned}), Python {sys.version.split()[0]}; {reference_line()}"

"""Shared parts of the long runs in this folder: a watched server process, a bystander, some figures."""

from __future__ import annotations

import asyncio
import json
import os
import resource
import select
import signal
import socket
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any, ClassVar, Protocol, Self

ROOT = Path(__file__).resolve().parents[2]

PATIENCE = 60.0
"""Longest wait for an answer or an end [s]; a working server never needs it, even on a busy machine."""

Frame = dict[str, Any]
"""A frame as a JSON object; its values are any JSON values from the server."""


class SoakError(Exception):
    """The server did something wrong."""


class GoneError(SoakError):
    """The server closed a connection, or never accepted it."""


class RefusedError(Exception):
    """A call was answered with `result: false`; the text is the reason."""


# The server


@dataclass(frozen=True, slots=True)
class Figures:
    """Current cost of a server.

    Attributes:
        memory: resident [MB].
        descriptors, threads: of the process.
        tasks: of its event loop.
        objects: blocks of memory that Python has given to small objects.
        cpu: time so far [s].
    """

    memory: float
    descriptors: int
    threads: int
    tasks: int
    objects: int
    cpu: float


class Program(Protocol):
    """A process: a part of `subprocess.Popen`."""

    @property
    def pid(self) -> int:
        """Its number."""

    @property
    def stdout(self) -> IO[str] | None:
        """Its output."""

    def poll(self) -> int | None:
        """Return its exit code, None while it runs."""

    def wait(self, timeout: float | None = None, /) -> int:
        """Return its exit code once it has ended."""

    def send_signal(self, sig: int, /) -> None:
        """Send it a signal."""

    def kill(self) -> None:
        """End it at once."""


def _start_script(name: str, channel: int, words: Sequence[str], stderr: IO[bytes]) -> subprocess.Popen[str]:
    """Start a script of this folder, with a socket in it.

    Args:
        name: of the script.
        channel: descriptor of the socket, its first argument.
        words: the other arguments.
        stderr: file for its stderr.
    """
    return subprocess.Popen(  # noqa: S603 - our own program
        [sys.executable, str(ROOT / "scripts" / "soak" / f"{name}.py"), str(channel), *words],
        cwd=ROOT,
        pass_fds=(channel,),
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
    )


def _run(words: Sequence[str], stdout: int) -> subprocess.CompletedProcess[str]:
    """Run a command of `rosbridge-sim` that ends by itself.

    Args:
        words: the command and its arguments.
        stdout: descriptor for its output, or `PIPE`.
    """
    return subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-m", "rosbridge_sim", *words],
        cwd=ROOT,
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


class Programs:
    """Ways to start programs; the tests have quicker ones.

    Attributes:
        start_script: starts a script of this folder: its name, a descriptor, its other arguments and its stderr.
        run: runs a command of `rosbridge-sim`: its words, and a descriptor for its output, or `PIPE`.
    """

    run: ClassVar[Callable[[Sequence[str], int], subprocess.CompletedProcess[str]]] = staticmethod(_run)

    start_script: ClassVar[Callable[[str, int, Sequence[str], IO[bytes]], Program]] = staticmethod(_start_script)


class WatchedServer:
    """A `rosbridge-sim serve` in its own process, on a free loopback port.

    Attributes:
        pid: of the process.
        url, port: its address.
        code: exit code, once it has ended.
    """

    def __init__(
        self,
        log: Path,
        *flags: str,
        is_log_piped: bool = False,
    ) -> None:
        """Start it and wait until it listens.

        Args:
            log: file for its stderr.
            flags: after `serve --port 0`.
            is_log_piped: copy its stderr to the file in this process, so that a limit on its files does not apply.

        Raises:
            SoakError: it ended before it listened; the text is its log.
        """
        self._log = log
        self._counts, theirs = socket.socketpair()
        words = ["serve", "--port", "0", *flags]
        self._process: Program
        self._stderr: IO[str] | None = None
        self._carrier: threading.Thread | None = None
        with theirs, ExitStack() as stack:
            if is_log_piped:
                reading, writing = os.pipe()
                stderr = stack.enter_context(os.fdopen(writing, "wb"))
                self._stderr = os.fdopen(reading)
                self._carrier = threading.Thread(target=_carry, args=(self._stderr, log), daemon=True)
                self._carrier.start()
            else:
                stderr = stack.enter_context(log.open("ab"))
            self._process = Programs.start_script("counting_tasks", theirs.fileno(), words, stderr)
        self.pid = self._process.pid
        line = _read_line(self._process.stdout)
        if " listening on ws://" not in line:
            self.kill()
            raise SoakError(self.log.strip() or f"it said {line!r} and no reason")
        self.url = line.rpartition(" ")[2].strip()
        self.port = int(self.url.rpartition(":")[2])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    @property
    def log(self) -> str:
        """Its stderr so far."""
        return self._log.read_text(errors="replace")

    @property
    def is_alive(self) -> bool:
        """True while it runs."""
        return self._process.poll() is None

    @property
    def code(self) -> int | None:
        """Its exit code; None while it runs."""
        return self._process.poll()

    def figures(self, *, is_collected: bool = False) -> Figures:
        """Return its current cost.

        Args:
            is_collected: collect garbage first, which stalls the server for about ten milliseconds.

        Returns:
            The figures.

        Raises:
            SoakError: it has ended.
        """
        if not self.is_alive:
            raise self._ending()
        fields = self._status()
        times = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        tasks, objects = self._ask(b"!" if is_collected else b"?")
        return Figures(
            memory=int(fields["VmRSS"].split()[0]) / 1024,
            descriptors=len(list(Path(f"/proc/{self.pid}/fd").iterdir())),
            threads=int(fields["Threads"]),
            tasks=tasks,
            objects=objects,
            cpu=(int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK"),  # proc(5): utime and stime
        )

    def longest_pass(self) -> float:
        """Return the longest CPU time of one pass of its event loop since the last call; the first call starts that.

        Returns:
            CPU time of the loop's thread between two heartbeats, which are 2 ms apart in an idle loop [ms].

        Raises:
            SoakError: it has ended.
        """
        (longest_ns,) = self._ask(b"~")
        return longest_ns / 1e6

    def forget_peak(self) -> None:
        """Reset the kernel's count of its memory peak (proc(5): clear_refs)."""
        Path(f"/proc/{self.pid}/clear_refs").write_text("5")

    def peak(self) -> float:
        """Return its largest memory since then [MB]."""
        return int(self._status()["VmHWM"].split()[0]) / 1024

    def address_space(self) -> int:
        """Return the size that RLIMIT_AS limits.

        Returns:
            [bytes].
        """
        return int(self._status()["VmSize"].split()[0]) * 1024

    def open_files(self) -> Counter[str]:
        """Return the targets of its descriptors; sockets and pipes without their numbers.

        Returns:
            Target -> number.
        """
        found = Counter[str]()
        for path in Path(f"/proc/{self.pid}/fd").iterdir():
            with suppress(OSError):
                found[str(path.readlink()).partition(":[")[0]] += 1
        return found

    def limit(self, kind: int, value: int) -> None:
        """Set a resource limit of the running process.

        Args:
            kind: `resource.RLIMIT_...`.
            value: the limit; -1 removes it.
        """
        hard = resource.prlimit(self.pid, kind)[1]
        resource.prlimit(self.pid, kind, (value if value >= 0 else hard, hard))

    def stop(self) -> int:
        """Stop it with SIGTERM, and wait.

        Returns:
            Its exit code.

        Raises:
            SoakError: it does not end.
        """
        self._process.send_signal(signal.SIGTERM)
        try:
            return self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise SoakError(f"the server did not end within {PATIENCE:.0f} s of SIGTERM") from None
        finally:
            self.kill()

    def kill(self) -> None:
        """Kill it if it still runs, and close its pipes; a second call is no error."""
        if self.is_alive:
            self._process.kill()
        self._process.wait()
        if self._carrier is not None:
            self._carrier.join(PATIENCE)
        self._counts.close()
        for pipe in (self._process.stdout, self._stderr):
            if pipe is not None:
                pipe.close()

    def _status(self) -> dict[str, str]:
        lines = Path(f"/proc/{self.pid}/status").read_text().splitlines()
        return dict(line.split(":", 1) for line in lines)

    def _ask(self, question: bytes) -> tuple[int, ...]:
        """Return the answer to a question of `counting_tasks.py`."""
        self._counts.settimeout(PATIENCE)
        try:
            self._counts.send(question)
            answer = tuple(map(int, self._counts.recv(100).split()))
        except TimeoutError:
            raise SoakError(f"the server's loop has not turned for {PATIENCE:.0f} s") from None
        except OSError:
            raise self._ending() from None
        if not answer:  # the other end is closed
            raise self._ending()
        return answer

    def _ending(self) -> SoakError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)
        return SoakError(f"the server has ended with {self.code}; its log ends with:\n{self.log[-2000:]}")


def _read_line(pipe: IO[str] | None) -> str:
    assert pipe is not None
    is_ready, _, _ = select.select([pipe], [], [], PATIENCE)
    return pipe.readline() if is_ready else ""


def _carry(pipe: IO[str], log: Path) -> None:
    with log.open("a", buffering=1) as file:
        for line in pipe:
            file.write(line)


# The bystander


@dataclass(frozen=True, slots=True)
class Waits:
    """Times that a bystander waited for its answers [ms]."""

    num: int
    median: float
    longest: float


class Bystander:
    """A running `bystander.py`."""

    def __init__(self, url: str) -> None:
        """Start it."""
        self._channel, theirs = socket.socketpair()
        with theirs, Path(os.devnull).open("wb") as stderr:
            self._process = Programs.start_script("bystander", theirs.fileno(), [url], stderr)

    async def waits(self) -> Waits:
        """Return the figures since the last call.

        Raises:
            SoakError: it has ended, or waits for an answer itself.
        """
        return await asyncio.to_thread(self._ask)

    def stop(self) -> None:
        """End it."""
        self._channel.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def _ask(self) -> Waits:
        line = b""
        self._channel.settimeout(2 * PATIENCE)
        with suppress(OSError):  # no answer, or no other end
            self._channel.sendall(b"\n")
            while not line.endswith(b"\n") and (data := self._channel.recv(4096)):
                line += data
        if not line:
            raise SoakError("the bystander got no answer, or was disconnected")
        return Waits(**json.loads(line))


# Waiting, and growth


async def until(question: Callable[[], bool] | Callable[[], Awaitable[bool]], patience: float = PATIENCE) -> bool:
    """Repeat a question until the answer is yes.

    Args:
        question: returns the answer.
        patience: longest wait [s].

    Returns:
        False if the answer was never yes.
    """
    loop = asyncio.get_running_loop()
    end = loop.time() + patience
    while True:
        answer = question()
        if answer if isinstance(answer, bool) else await answer:
            return True
        if loop.time() > end:
            return False
        await asyncio.sleep(0.02)


def slope_per_hour(samples: Sequence[tuple[float, float]]) -> float:
    """Return the slope of the regression line through samples.

    Args:
        samples: (time [s], value) each.

    Returns:
        Change of the value in an hour.
    """
    if len(samples) < 2:
        return 0.0
    mean_time = sum(time for time, _ in samples) / len(samples)
    mean = sum(value for _, value in samples) / len(samples)
    spread = sum((time - mean_time) ** 2 for time, _ in samples)
    return 3600 * sum((time - mean_time) * (value - mean) for time, value in samples) / spread

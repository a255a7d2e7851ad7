"""Programs that are forked from one process in which the package is imported already.

A start of `python -m rosbridge_sim` imports for three quarters of a second of CPU time, and the tests start hundreds.
`start` forks instead: what runs then is the same `__main__`, with its own arguments, environment, output
and end. What it does not have is a hash seed of its own, so tests that compare two programs start them in the
ordinary way; so do tests of the command line.

The process of the first fork is started when it is wanted, one for each process of tests, and ends with it:
`python -m tests.fork_server FD`, where FD is a socket. A request is the length of a text, the text, and three file
descriptors: stdout and stderr of the program, and a pipe for its process id and later its exit code. A fourth one is
for the program itself, which finds it as `CHANNEL`.
"""

from __future__ import annotations

import atexit
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import IO, NamedTuple

__all__ = ["CHANNEL", "ForkServer", "ForkedProgram", "start"]

_ROOT = Path(__file__).parent.parent

_MODULES = (
    "rosbridge_sim.shell.app",
    "rosbridge_sim.shell.config.loading",
    "rosbridge_sim.shell.monitoring.log_format",
    "rosbridge_sim.link.stop_signals",
    "rosbridge_sim.shell.websocket.memory",
    "tests.far_side.server",
    "uvloop",
    "numpy.ma",  # numpy imports it when it is first used
)
"""What the programs import at their start, but for their `__main__`, which each of them runs itself."""

_LENGTH = 4
"""Of the head of a request [bytes]."""

CHANNEL = 3
"""The descriptor that a program may have beside its standard streams."""

_MOST_DESCRIPTORS = 4
"""Of a request."""


# The side of the tests


class ForkedProgram:
    """A program that runs: what the tests use of `subprocess.Popen`.

    Attributes:
        pid: of its process.
        stdout: its output.
        returncode: its exit code, minus a signal's number; None until its end was noticed.
    """

    def __init__(self, pid: int, stdout: IO[str], status: int) -> None:
        self.pid = pid
        self.stdout = stdout
        self.returncode: int | None = None
        self._status = status

    def poll(self) -> int | None:
        """The exit code, or None if it still runs."""
        if self.returncode is None and select.select([self._status], [], [], 0)[0]:
            self.returncode = _read_number(self._status)
            os.close(self._status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end [s]; the exit code."""
        if self.returncode is None:
            select.select([self._status], [], [], timeout)
        code = self.poll()
        if code is None:
            raise subprocess.TimeoutExpired(f"forked program {self.pid}", timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless its end was noticed."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def start(
    module: str, words: Sequence[str], env: Mapping[str, str], stderr: IO[bytes], channel: int | None = None
) -> ForkedProgram:
    """Start `python -m MODULE WORDS...` in the project's folder, with its stdout in a pipe, and perhaps a `CHANNEL`."""
    return _server().start(module, words, env, stderr, channel)


class ForkServer:
    """The process of which programs are forked, as the tests know it. When it is closed, they are killed."""

    def __init__(self) -> None:
        self._control, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.fork_server", str(theirs.fileno())],
                cwd=_ROOT,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )
        self._lock = threading.Lock()
        atexit.register(self.close)

    def start(
        self, module: str, words: Sequence[str], env: Mapping[str, str], stderr: IO[bytes], channel: int | None = None
    ) -> ForkedProgram:
        """Start a program; see `start` of this module."""
        out, program_out = os.pipe()
        status, program_status = os.pipe()
        request = json.dumps({"module": module, "words": [*words], "env": dict(env)}).encode()
        try:
            more = [] if channel is None else [channel]
            self._send(request, [program_out, stderr.fileno(), program_status, *more])
        finally:
            os.close(program_out)
            os.close(program_status)
        return ForkedProgram(_read_number(status), os.fdopen(out), status)

    def _send(self, request: bytes, descriptors: Sequence[int]) -> None:
        with self._lock:
            socket.send_fds(self._control, [len(request).to_bytes(_LENGTH, "big")], [*descriptors])
            self._control.sendall(request)

    def close(self) -> None:
        """End all programs, and the process."""
        self._control.close()
        self._process.wait()


@cache
def _server() -> ForkServer:
    return ForkServer()


def _read_number(status: int) -> int:
    """The next number out of a pipe of status."""
    text = b""
    while not text.endswith(b"\n"):
        part = os.read(status, 1)
        assert part, "the fork server ended"
        text += part
    return int(text)


# The side of the programs


class _Request(NamedTuple):
    module: str
    words: list[str]
    env: dict[str, str]
    stdout: int
    stderr: int
    status: int
    channel: int | None = None


def _main() -> None:
    for name in _MODULES:
        import_module(name)
    with socket.socket(fileno=int(sys.argv[1])) as control:
        request = _serve(control)
    if request is not None:
        _run(request)


def _serve(control: socket.socket) -> _Request | None:
    """Fork a program for each request: in it, return the request; here, return None when no more can come."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the tests
    awake, wakeup = os.pipe()
    os.set_blocking(wakeup, False)
    signal.set_wakeup_fd(wakeup)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    running: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([control.fileno(), awake], [], [])
        if awake in ready:
            os.read(awake, 1024)
            _report_ends(running)
        if control.fileno() in ready:
            request = _receive(control)
            if request is None:
                for pid in running:  # the tests were broken off
                    os.kill(pid, signal.SIGKILL)
                return None
            pid = os.fork()
            if not pid:
                return request
            running[pid] = request.status
            os.write(request.status, b"%d\n" % pid)
            os.close(request.stdout)
            os.close(request.stderr)
            if request.channel is not None:
                os.close(request.channel)


def _receive(control: socket.socket) -> _Request | None:
    head, descriptors, _, _ = socket.recv_fds(control, _LENGTH, _MOST_DESCRIPTORS)
    if not head:
        return None
    size, text = int.from_bytes(head, "big"), b""
    while len(text) < size:
        text += control.recv(size - len(text))
    fields = json.loads(text)
    return _Request(fields["module"], fields["words"], fields["env"], *descriptors)


def _report_ends(running: dict[int, int]) -> None:
    while running:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if not pid:
            return
        to = running.pop(pid)
        with suppress(BrokenPipeError):  # nobody wants to know
            os.write(to, b"%d\n" % os.waitstatus_to_exitcode(status))
        os.close(to)


def _run(request: _Request) -> None:
    """Run the program in this fork as if Python had been started with it."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.dup2(request.stdout, 1)
    os.dup2(request.stderr, 2)
    if request.channel is not None:
        os.dup2(request.channel, CHANNEL)
    os.closerange(CHANNEL + (request.channel is not None), os.sysconf("SC_OPEN_MAX"))
    os.environ.clear()
    os.environ.update(request.env)
    time.tzset()
    sys.argv[1:] = request.words
    runpy.run_module(request.module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _main()

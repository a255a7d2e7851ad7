"""Programs that are forked from one process in which the package is imported already.

A start of `python -m rosbridge_sim` imports for three quarters of a second of CPU time, and the tests start hundreds.
`start` forks instead: what runs then is the same `__main__`, with its own arguments, environment, output
and end. What it does not have is a hash seed of its own, so tests that compare two programs start them in the
ordinary way; so do tests of the start and the end of a process. Nor is its memory cleared before it ends.

The process of the first fork is started when it is wanted, one for each process of tests, and ends with it:
`python -m tests.fork_server FD`, where FD is a socket. A request is the length of a text, the text, and three file
descriptors: stdout and stderr of the program, and a pipe for its process id and later its exit code. A fourth one is
for the program itself, which finds it as `CHANNEL`.
"""

from __future__ import annotations

import atexit
import gc
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import IO, NamedTuple, NoReturn

__all__ = ["CHANNEL", "ForkServer", "ForkedProgram", "run", "start"]

_ROOT = Path(__file__).parent.parent

_MODULES = (
    "rosbridge_sim.shell.app",
    "rosbridge_sim.shell.config.loading",
    "rosbridge_sim.shell.monitoring.log_format",
    "rosbridge_sim.link.stop_signals",
    "rosbridge_sim.shell.websocket.memory",
    "rosbridge_sim.cli.command_table",
    "rosbridge_sim.client",
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


def run(
    program: str, *words: object, cwd: Path = _ROOT, env: Mapping[str, str] | None = None, timeout: float = 180.0
) -> subprocess.CompletedProcess[str]:
    """Run a program that ends by itself: `python -m PROGRAM WORDS...`, or `python PROGRAM WORDS...` for a file.

    Args:
        program: a module, or the path of a file that ends with `.py`.
        words: its arguments.
        cwd: the folder in which it runs.
        env: its environment beside the test's own.
        timeout: after which it is killed, and `subprocess.TimeoutExpired` is raised [s].
    """
    texts = [*map(str, words)]
    with tempfile.TemporaryFile() as stderr:
        forked = _server().start(program, texts, {**os.environ, **(env or {})}, stderr, cwd=cwd)
        killer = threading.Timer(timeout, forked.kill)
        killer.start()
        with forked.stdout:
            out = forked.stdout.read()
        killer.cancel()
        code = forked.wait(timeout)
        if code == -signal.SIGKILL:
            raise subprocess.TimeoutExpired([program, *texts], timeout)
        stderr.seek(0)
        return subprocess.CompletedProcess([program, *texts], code, out, stderr.read().decode(errors="replace"))


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
        self,
        module: str,
        words: Sequence[str],
        env: Mapping[str, str],
        stderr: IO[bytes],
        channel: int | None = None,
        cwd: Path = _ROOT,
    ) -> ForkedProgram:
        """Start a program, a module or a file; see `start` and `run` of this module."""
        out, program_out = os.pipe()
        status, program_status = os.pipe()
        request = json.dumps({"module": module, "words": [*words], "env": dict(env), "cwd": str(cwd)}).encode()
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
    cwd: str
    stdout: int
    stderr: int
    status: int
    channel: int | None = None


def _main() -> None:
    for name in _MODULES:
        import_module(name)
    gc.collect()
    gc.freeze()  # a collection in a program would copy the pages of all that it shares
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
    return _Request(fields["module"], fields["words"], fields["env"], fields["cwd"], *descriptors)


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
    """Run the program in this fork as if Python had been started with it, and end."""
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
    os.chdir(request.cwd)
    code: object = None
    try:
        if request.module.endswith(".py"):
            sys.argv = [request.module, *request.words]
            sys.path[0] = str(Path(request.module).parent)
            runpy.run_path(request.module, run_name="__main__")
        else:
            sys.argv[1:] = request.words
            sys.path[0] = request.cwd
            runpy.run_module(request.module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = end.code
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
        code = 1
    _end(code)


def _end(code: object) -> NoReturn:
    """End as the interpreter does after `sys.exit(code)`, but leave the memory as it is: that costs as much as a fork."""
    if code is not None and not isinstance(code, int):
        print(code, file=sys.stderr)  # noqa: T201 - as sys.exit does
        code = 1
    threading._shutdown()  # type: ignore[attr-defined] # noqa: SLF001 - waits for threads, before what atexit has
    atexit._run_exitfuncs()  # noqa: SLF001 - what the interpreter calls
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(int(code or 0) & 0xFF)


if __name__ == "__main__":
    _main()

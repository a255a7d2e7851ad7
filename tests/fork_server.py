"""Programs that are forked from one process in which the package is imported already.

A start of `python -m rosbridge_sim` imports for three quarters of a second of CPU time, and the tests start hundreds.
`start` forks instead: what runs then is the same `__main__`, with its own arguments, environment, output
and end. What it does not have is a hash seed of its own, so tests that compare two programs start them in the
ordinary way; so do tests of the start and the end of a process. Nor is its memory cleared before it ends. Message
types, the maps of the scenes that most tests open with, with what was computed of their roads, and the files of the
page are there, too (`tests/kept_work.py`): they never change.

Programs that fork programs of their own in turn: what draws for sensors, and the workers of a campaign, are Python with
`-c` and one of `CHILDREN`. They are forks of the program, without its threads, descriptors and signals.

The process of the first fork is started when it is wanted, one for each process of tests, and ends with it. If there
are several processes of tests, theirs are forked of one more. It is `python -m tests.fork_server FD`, where FD is a
socket. A request is the length of a text, the text, and four file descriptors: stdin, stdout and stderr of the program,
and a pipe for its process id and later its exit code. A fifth one is for the program itself, which finds it as
`CHANNEL`.
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
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from types import ModuleType, TracebackType
from typing import IO, Any, NamedTuple, NoReturn, Self

from tests.cpu_time import communicate

__all__ = ["CHANNEL", "ForkServer", "ForkedProgram", "pids", "popen", "run", "server", "start", "use"]

_ROOT = Path(__file__).parent.parent

_MODULES = (
    "rosbridge_sim.shell.app",
    "rosbridge_sim.shell.config.loading",
    "rosbridge_sim.shell.monitoring.log_format",
    "rosbridge_sim.link.stop_signals",
    "rosbridge_sim.shell.websocket.freed_memory",
    "rosbridge_sim.cli.bridge_commands",
    "rosbridge_sim.cli.command_table",
    "rosbridge_sim.campaign_runs.running",
    "rosbridge_sim.cli.campaigns.campaign_results",
    "rosbridge_sim.cli.campaigns.campaign_run",
    "rosbridge_sim.client",
    "rosbridge_sim.serving",
    "rosbridge_sim.shell.attach",
    "rosbridge_sim.shell.bags.bag_recorder",
    "rosbridge_sim.shell.drawing.map_picture",
    "rosbridge_sim.shell.drawing.sensor_makers",
    "tests.far_side.server",
    "uvloop",
    "twisted.internet.endpoints",  # of roslibpy; what chooses an event loop is not among them
    "twisted.internet.ssl",
    "autobahn.websocket.protocol",
    "encodings.ascii",
    "encodings.idna",  # of a listening asyncio
    "fsspec.implementations.local",
    "pebble",
    "pyproj",
    "numpy.ma",  # numpy imports it when it is first used
    "pytest",  # of tests that users write; a plugin of it that were imported here could not be rewritten
)
"""What the programs import at their start, but for their `__main__`, which each of them runs itself."""

CHILDREN = (
    "from multiprocessing.forkserver import main; main(",
    "from multiprocessing.resource_tracker import main;main(",
    "import sys; sys.path[:] = sys.argv[1:]; from rosbridge_sim.shell.drawing.drawing_process import main; main()",
)
"""How the code of programs begins that programs start, and that would import for a third of a second."""

_LENGTH = 4
"""Of the head of a request [bytes]."""

CHANNEL = 3
"""The descriptor that a program may have beside its standard streams."""

_MOST_DESCRIPTORS = 5
"""Of a request."""


# The side of the tests


class ForkedProgram:
    """A program that runs: what the tests use of `subprocess.Popen`.

    Attributes:
        pid: of its process.
        stdin, stdout, stderr: its streams, where they are pipes.
        returncode: its exit code, minus a signal's number; None until its end was noticed.
    """

    def __init__(
        self, pid: int, status: int, stdin: IO[str] | None, stdout: IO[str] | None, stderr: IO[str] | None
    ) -> None:
        self.pid = pid
        self.stdin, self.stdout, self.stderr = stdin, stdout, stderr
        self.returncode: int | None = None
        self._status = status

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pipes, and wait for its end."""
        for stream in (self.stdin, self.stdout, self.stderr):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        self.wait()

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Close its stdin and wait for its end [s]; the rest of its output and of its stderr."""
        if self.stdin is not None:
            self.stdin.close()
        texts = ["", ""]

        def read(number: int, stream: IO[str]) -> None:
            texts[number] = stream.read()

        streams = (self.stdout, self.stderr)
        readers = [threading.Thread(target=read, args=(i, one)) for i, one in enumerate(streams) if one is not None]
        for reader in readers:
            reader.start()
        try:
            self.wait(timeout)
        except subprocess.TimeoutExpired:
            self.kill()
            raise
        finally:
            for reader in readers:
                reader.join()
            for stream in streams:
                if stream is not None:
                    stream.close()
        return texts[0], texts[1]

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
        """Send it a signal, unless it has ended: its end may be noticed here later than the system forgets it."""
        if self.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def start(
    module: str, words: Sequence[str], env: Mapping[str, str], stderr: IO[bytes], channel: int | None = None
) -> ForkedProgram:
    """Start `python -m MODULE WORDS...` in the project's folder, with its stdout in a pipe, and perhaps a `CHANNEL`."""
    return server().start(["-m", module, *words], env=env, stderr=stderr.fileno(), channel=channel)


def popen(
    command: Sequence[object],
    *,
    cwd: Path = _ROOT,
    env: Mapping[str, str] | None = None,
    stdin: int = subprocess.DEVNULL,
    stdout: int = subprocess.PIPE,
    stderr: int | IO[bytes] = subprocess.PIPE,
) -> ForkedProgram:
    """Start `python COMMAND...`: a file, or `-m MODULE` or `-c CODE`, with arguments.

    Args:
        command: words after Python's own.
        cwd: the folder in which it runs.
        env: its whole environment; None is the one of the tests.
        stdin: `DEVNULL`, or `PIPE` for a pipe of text.
        stdout: `PIPE`, or a descriptor.
        stderr: the same, or a file.
    """
    error = stderr if isinstance(stderr, int) else stderr.fileno()
    words = [*map(str, command)]
    return server().start(
        words, env=os.environ if env is None else env, stdin=stdin, stdout=stdout, stderr=error, cwd=cwd
    )


def run(
    command: Sequence[object], *, cwd: Path = _ROOT, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run `python COMMAND...` to its end, as `popen` starts it and `communicate` of `tests.cpu_time` waits for it.

    Args:
        command: words after Python's own.
        cwd: the folder in which it runs.
        env: its whole environment; None is the one of the tests.
    """
    with popen(command, cwd=cwd, env=env) as program:
        out, err = communicate(program)
        return subprocess.CompletedProcess([*map(str, command)], program.wait(), out, err)


class ForkServer:
    """The process of which programs are forked, as the tests know it. When it is closed, they are killed.

    Args:
        origin: one of which this one is forked, so that it imports nothing.
    """

    def __init__(self, origin: ForkServer | None = None) -> None:
        self._control, theirs = socket.socketpair()
        self._process: subprocess.Popen[bytes] | ForkedProgram
        with theirs:
            if origin is None:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "tests.fork_server", str(theirs.fileno())],
                    cwd=_ROOT,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    pass_fds=[theirs.fileno()],
                )
            else:
                command = ["-m", "tests.fork_server", str(CHANNEL)]
                out, channel = subprocess.DEVNULL, theirs.fileno()
                self._process = origin.start(command, env=os.environ, stderr=2, stdout=out, channel=channel)
        self._lock = threading.Lock()
        self.pid = self._process.pid
        atexit.register(self.close)

    def start(
        self,
        command: Sequence[str],
        *,
        env: Mapping[str, str],
        stderr: int,
        stdin: int = subprocess.DEVNULL,
        stdout: int = subprocess.PIPE,
        channel: int | None = None,
        cwd: Path = _ROOT,
    ) -> ForkedProgram:
        """Start a program; see `start` and `popen` of this module."""
        request = json.dumps({"command": [*command], "env": dict(env), "cwd": str(cwd)}).encode()
        with ExitStack() as theirs:

            def pipe(number: int, *, is_input: bool = False) -> tuple[int, IO[str] | None]:
                """The program's descriptor, and our end of a new pipe."""
                if number == subprocess.DEVNULL:
                    number = os.open(os.devnull, os.O_RDWR)
                    theirs.callback(os.close, number)
                if number != subprocess.PIPE:
                    return number, None
                ends = os.pipe()
                far, near = ends if is_input else ends[::-1]
                theirs.callback(os.close, far)
                return far, os.fdopen(near, "w" if is_input else "r")

            far_in, near_in = pipe(stdin, is_input=True)
            far_out, near_out = pipe(stdout)
            far_error, near_error = pipe(stderr)
            status, far_status = os.pipe()
            theirs.callback(os.close, far_status)
            more = [] if channel is None else [channel]
            self._send(request, [far_in, far_out, far_error, far_status, *more])
        return ForkedProgram(_read_number(status), status, near_in, near_out, near_error)

    def _send(self, request: bytes, descriptors: Sequence[int]) -> None:
        with self._lock:
            socket.send_fds(self._control, [len(request).to_bytes(_LENGTH, "big")], [*descriptors])
            self._control.sendall(request)

    def close(self) -> None:
        """End all programs, and the process."""
        self._control.close()
        self._process.wait()

    def let_go(self) -> None:
        """Leave it to another process of tests, which has a copy of this object."""
        atexit.unregister(self.close)
        self._control.close()


_servers: list[ForkServer] = []


def use(server: ForkServer) -> None:
    """Have `start` and the others fork programs of this one."""
    _servers[:] = [server]


def pids() -> list[int]:
    """Processes of which programs of this process of tests are forked."""
    return [server.pid for server in _servers]


def server() -> ForkServer:
    """The one of this process of tests, started when it is first wanted."""
    if not _servers:
        use(ForkServer())
    return _servers[0]


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
    command: list[str]
    env: dict[str, str]
    cwd: str
    stdin: int
    stdout: int
    stderr: int
    status: int
    channel: int | None = None

    @property
    def descriptors(self) -> list[int]:
        """Those that are the program's alone, but for `status`."""
        return [number for number in (self.stdin, self.stdout, self.stderr, self.channel) if number is not None]


def _main() -> None:
    if "tests.kept_work" not in sys.modules:  # else it was forked of one that has done all this
        for name in _MODULES:
            import_module(name)
        import_module("tests.kept_work").keep_work()
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
            for number in request.descriptors:
                os.close(number)


def _receive(control: socket.socket) -> _Request | None:
    head, descriptors, _, _ = socket.recv_fds(control, _LENGTH, _MOST_DESCRIPTORS)
    if not head:
        return None
    size, text = int.from_bytes(head, "big"), b""
    while len(text) < size:
        text += control.recv(size - len(text))
    fields = json.loads(text)
    return _Request(fields["command"], fields["env"], fields["cwd"], *descriptors)


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
    os.dup2(request.stdin, 0)
    os.dup2(request.stdout, 1)
    os.dup2(request.stderr, 2)
    if request.channel is not None:
        os.dup2(request.channel, CHANNEL)
    os.closerange(CHANNEL + (request.channel is not None), os.sysconf("SC_OPEN_MAX"))
    os.environ.clear()
    os.environ.update(request.env)
    time.tzset()
    # Those of the server, to which `__stdout__` holds, are for another kind of file.
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - a descriptor, to the end
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - a descriptor, to the end
    sys.stderr = open(2, "w", 1, "utf-8", "backslashreplace", closefd=False)  # noqa: SIM115 - the same
    if request.env.get("PYTHONUNBUFFERED"):
        sys.stdout.reconfigure(line_buffering=True)
    os.chdir(request.cwd)
    _fork_children()
    code: object = None
    first, *words = request.command
    try:
        if first == "-c":
            sys.argv = ["-c", *words[1:]]
            sys.path[0] = request.cwd
            module = sys.modules["__main__"] = ModuleType("__main__")
            exec(compile(words[0], "<string>", "exec"), module.__dict__)  # noqa: S102 - the program
        elif first == "-m":
            sys.argv[1:] = words[1:]
            sys.path[0] = request.cwd
            runpy.run_module(words[0], run_name="__main__", alter_sys=True)
        else:
            sys.argv = [first, *words]
            sys.path[0] = str(Path(first).parent)
            runpy.run_path(first, run_name="__main__")
    except SystemExit as end:
        code = end.code
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
        code = 1
    _end(code)


def _fork_children() -> None:
    """Have this program fork what would be Python with `CHILDREN` again."""
    import _posixsubprocess  # noqa: PLC0415 - not on Windows, where nothing is forked

    fork_exec = _posixsubprocess.fork_exec

    def fork(args: Sequence[str | bytes | Path], *options: Any) -> int:  # noqa: ANN401 - those of the standard library
        """As `fork_exec`, which `subprocess` and `multiprocessing` call alike."""
        words = [*map(os.fsdecode, args)]
        where = words.index("-c") if words[0] == sys.executable and "-c" in words else 0
        if not where or not words[where + 1].startswith(CHILDREN):
            pid: int = fork_exec(args, *options)
            return pid
        sys.stdout.flush()  # else the child would write it, too
        pid = os.fork()
        if not pid:
            _run_child(words[where:], *options[2:13])
        return pid

    for module, name in ((_posixsubprocess, "fork_exec"), (subprocess, "_fork_exec")):
        assert hasattr(module, name)
        setattr(module, name, fork)


def _run_child(words: list[str], keep: Sequence[int], cwd: str | None, env: Sequence[bytes] | None, *fds: int) -> None:
    """Run a child's code in this fork as after `exec`, and end.

    Args:
        words: `-c`, the code and its arguments.
        keep: descriptors that it has beside the standard streams.
        cwd: its folder; None is that of its parent.
        env: `NAME=VALUE`; None is that of its parent.
        fds: of pipes, -1 for none: the ends that are read and written of stdin's, of stdout's, of stderr's, and of one
            that tells that `exec` has failed.
    """
    code = 1
    try:
        atexit._clear()
        signal.set_wakeup_fd(-1)
        for number in signal.valid_signals():
            if callable(signal.getsignal(number)):
                signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
        for source, target in ((fds[0], 0), (fds[3], 1), (fds[5], 2)):
            if source >= 0:
                os.dup2(source, target)
        for lower, upper in pairwise([2, *sorted({*keep} - {fds[7]}), os.sysconf("SC_OPEN_MAX")]):
            os.closerange(lower + 1, upper)
        if cwd is not None:
            os.chdir(cwd)
        if env is not None:
            os.environ.clear()
            os.environ.update(dict(os.fsdecode(each).split("=", 1) for each in env))
        sys.argv = ["-c", *words[2:]]
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - a descriptor, to the end
        exec(words[1], {"__name__": "__main__"})  # noqa: S102 - the child
        code = 0
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
    finally:
        os._exit(code)


def _end(code: object) -> NoReturn:
    """End as after `sys.exit(code)`, but leave the memory as it is: to clear it costs as much as a fork."""
    if code is not None and not isinstance(code, int):
        print(code, file=sys.stderr)  # noqa: T201 - as sys.exit does
        code = 1
    threading._shutdown()  # type: ignore[attr-defined]  # waits for threads, as the interpreter does
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(int(code or 0) & 0xFF)


if __name__ == "__main__":
    _main()

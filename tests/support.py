"""Helpers for tests of a live server: the server as a process, a bare socket client, and tools.

Nothing here sleeps: each wait is for an event and has a deadline, so that a server that says nothing fails a
test and does not hang it.
"""

from __future__ import annotations

import asyncio
import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NoReturn, Self, TypeVar
from urllib.request import urlopen

import pytest
from websockets.asyncio.client import ClientConnection, connect

from rosbridge_sim.doctor.check_frames import read_frame
from tests import fork_server
from tests.fork_server import ForkedProgram

__all__ = [
    "PATIENCE",
    "ROOT",
    "AttachProcess",
    "Client",
    "FarSideProcess",
    "Frame",
    "Process",
    "ServerProcess",
    "finish",
    "held_port",
    "mask",
    "miss",
    "open_raw",
    "read_line",
    "require_chromium",
    "require_node_modules",
    "require_tool",
]

ROOT = Path(__file__).parent.parent

PATIENCE = 60.0
"""How long an event is waited for [s]: never reached by a server that works, on however busy a machine."""

T = TypeVar("T")

_READY = "rosbridge-sim listening on "

Frame = dict[str, Any]
"""A frame as the JSON object that it holds: its values are whatever the server says."""


# Tools


def miss(reason: str) -> NoReturn:
    """Skip this test for want of something, or fail it where everything must be there."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"{reason} (a skip would hide it, since CI=true)")
    pytest.skip(reason)


def require_tool(name: str) -> str:
    """The path of a program that a test needs."""
    path = shutil.which(name)
    if path is None:
        miss(f"needs the program {name!r} on the PATH")
    return path


def require_chromium() -> str:
    """The path of Chromium: of its headless shell, where it is there.

    That one has the same engine and no window system: it opens a page in a quarter of the CPU time.
    """
    return shutil.which("chromium-headless-shell") or require_tool("chromium")


def require_node_modules() -> Path:
    """The folder of the JavaScript clients."""
    folder = ROOT / "tests" / "end_to_end" / "node_modules"
    for package in ("roslib", "roslib1", "@lichtblick/roslibjs"):
        if not (folder / package / "package.json").is_file():
            miss(f"needs {package!r}: npm ci --prefix tests/end_to_end (./scripts/test does it)")
    return folder


def finish(slices: Generator[None, None, T]) -> T:
    """Do all slices of some work; what it returns."""
    while True:
        try:
            next(slices)
        except StopIteration as end:
            value: T = end.value
            return value


@contextmanager
def held_port() -> Iterator[int]:
    """Hold a port of loopback for servers that come and go on it; yield its number.

    A free port that nobody holds may be that of another program's connection when the server is started. On Linux, a
    socket that is bound and does not listen keeps it from all who take any free port, and from no server that names it.
    """
    with socket.socket() as holder:
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        holder.bind(("127.0.0.1", 0))
        port: int = holder.getsockname()[1]
        if sys.platform != "linux":
            holder.close()
        yield port


# Processes


def read_line(process: subprocess.Popen[str] | ForkedProgram) -> str:
    """The first line of a process's stdout; empty if it says nothing for too long, or ends."""
    assert process.stdout is not None
    is_ready, _, _ = select.select([process.stdout], [], [], PATIENCE)
    return process.stdout.readline() if is_ready else ""


def _start(
    command: Sequence[str], env: dict[str, str], stderr: IO[bytes], python: Path | None
) -> subprocess.Popen[str] | ForkedProgram:
    """Start Python with these words: by a fork, unless Python itself has to take notice of them."""
    whole = {**os.environ, **env}
    if python is None and hasattr(os, "fork") and not any(name.startswith("PYTHON") for name in env):
        return fork_server.popen(command, env=whole, stderr=stderr)
    return subprocess.Popen(
        [python or sys.executable, *command], cwd=ROOT, env=whole, stdout=subprocess.PIPE, stderr=stderr, text=True
    )


class Process:
    """A program that says a first line when it is ready, and is expected to end when it is told to and not before.

    Attributes:
        said: what follows the expected beginning of its first line.
        pid: of the process.
    """

    def __init__(
        self,
        log: Path,
        command: Sequence[str],
        ready: str,
        env: dict[str, str] | None = None,
        python: Path | None = None,
    ) -> None:
        """Start it and wait until it is ready.

        Args:
            log: where its stderr goes, behind what is there already.
            command: words after Python's own.
            ready: how its first line begins.
            env: beside the test's own environment.
            python: an interpreter of another environment; None for this one.
        """
        self._log = log
        self._is_told_to_stop = False
        with log.open("ab") as stderr:
            self._process = _start(command, env or {}, stderr, python)
        self.pid = self._process.pid
        line = read_line(self._process)
        if not line.startswith(ready):
            self.kill()
            raise AssertionError(f"{' '.join(command)} said {line!r} and not {ready!r}. Its log:\n{self.log}")
        self.said = line[len(ready) :].strip()

    @property
    def log(self) -> str:
        """What it has written to stderr so far."""
        return self._log.read_text(errors="replace")

    @property
    def is_alive(self) -> bool:
        """Whether it still runs."""
        return self._process.poll() is None

    @property
    def memory(self) -> int:
        """Resident memory [bytes]."""
        for line in Path(f"/proc/{self.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) * 1024
        raise AssertionError("no VmRSS in /proc")

    def stop(self, signal_number: int = signal.SIGTERM) -> int:
        """Ask it to stop and wait for it; its exit code."""
        self._is_told_to_stop = True
        try:
            self._process.send_signal(signal_number)
            return self._process.wait(PATIENCE)
        finally:
            self.kill()

    def kill(self) -> None:
        """End it if it still runs, and let go of its pipe."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def stop_cleanly(self) -> None:
        """Stop it if that was not done yet, and insist on a clean end: exit code 0, and no traceback in its log."""
        if self.is_alive:
            self.stop()
        self.kill()
        code = self._process.returncode
        assert self._is_told_to_stop, f"it ended by itself, with {code}. Its log:\n{self.log}"
        assert code == 0, f"it ended with {code}. Its log:\n{self.log}"
        assert "Traceback" not in self.log, f"it logged a traceback:\n{self.log}"


class ServerProcess(Process):
    """A running `rosbridge-sim serve`.

    Attributes:
        url: where it listens.
        port: the same, the number alone.
    """

    def __init__(
        self,
        log: Path,
        flags: Sequence[str] = (),
        env: dict[str, str] | None = None,
        port: int = 0,
        python: Path | None = None,
    ) -> None:
        """Start it and wait until it listens.

        Args:
            log: where its stderr goes.
            flags: after `serve --port N`.
            env: beside the test's own environment.
            port: to listen on; 0 takes a free one.
            python: an interpreter of another environment; None for this one.
        """
        super().__init__(log, ["-m", "rosbridge_sim", "serve", "--port", str(port), *flags], _READY, env, python)
        self.url = self.said
        self.port = int(self.url.rpartition(":")[2].strip("/"))


class AttachProcess(Process):
    """A running `rosbridge-sim attach`, known to have announced everything to its first bridge."""

    def __init__(
        self, log: Path, urls: Sequence[str], flags: Sequence[str] = (), env: dict[str, str] | None = None
    ) -> None:
        """Start it and wait until it has announced everything.

        Args:
            log: where its stderr goes.
            urls: of the bridges.
            flags: behind them.
            env: beside the test's own environment.
        """
        super().__init__(log, ["-m", "rosbridge_sim", "attach", *urls, *flags], "rosbridge-sim attached to ", env)


class FarSideProcess(Process):
    """A running `python -m tests.far_side`.

    Attributes:
        url: where it listens.
        port: the same, the number alone.
    """

    def __init__(self, log: Path, flags: Sequence[str] = (), port: int = 0) -> None:
        """Start it and wait until it listens.

        Args:
            log: where its stderr goes.
            flags: after `--port N`.
            port: to listen on; 0 takes a free one.
        """
        super().__init__(log, ["-m", "tests.far_side", "--port", str(port), *flags], "far side listening on ")
        self.url = self.said
        self.port = int(self.url.rpartition(":")[2])

    @property
    def report(self) -> dict[str, Any]:
        """Its counts: `handled`, `most_waiting`, `clients`, and by topic `published`."""
        with urlopen(f"http://127.0.0.1:{self.port}/report", timeout=PATIENCE) as answer:
            report: dict[str, Any] = json.load(answer)
        return report


# The client


class Client:
    """A bare rosbridge client: JSON objects into a socket and out of it.

    Frames that a `take` did not look for wait in the inbox for a later one.

    Attributes:
        socket: the WebSocket.
        inbox: frames that came and were not taken yet, oldest first.
        raw: the same frames as text, all that ever came, if `is_recording`.
    """

    def __init__(self, socket: ClientConnection, *, is_recording: bool = False) -> None:
        self.socket = socket
        self.inbox: deque[Frame] = deque()
        self.raw: list[str] = []
        self._is_recording = is_recording
        self._num_calls = 0

    @classmethod
    async def open(cls, url: str, *, is_recording: bool = False) -> Client:
        """A client that is connected to `url`."""
        socket = await connect(url, compression=None, max_size=None, max_queue=None, ping_interval=None, proxy=None)
        return cls(socket, is_recording=is_recording)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Leave in order."""
        await self.socket.close()

    def cut(self) -> None:
        """Be gone at once, without a word: what a crash or a pulled cable looks like."""
        self.socket.transport.abort()

    async def send_raw(self, frame: str | bytes) -> None:
        """Send a frame as it is: text, or bytes for a binary frame."""
        await self.socket.send(frame)

    async def send(self, op: str, **fields: object) -> None:
        """Send one op."""
        await self.send_raw(json.dumps({"op": op, **fields}))

    async def read(self) -> Frame:
        """The next frame off the socket; a binary one under the key `$cbor`."""
        async with asyncio.timeout(PATIENCE):
            text = await self.socket.recv()
        if isinstance(text, bytes):
            binary: Frame = read_frame(text)
            return binary
        if self._is_recording:
            self.raw.append(text)
        frame: Frame = json.loads(text, parse_constant=_refuse_constant)
        return frame

    async def take_where(self, matches: Callable[[Frame], bool], what: str) -> Frame:
        """The first frame that matches, out of the inbox or else off the socket."""
        for i, frame in enumerate(self.inbox):
            if matches(frame):
                del self.inbox[i]
                return frame
        try:
            async with asyncio.timeout(PATIENCE):
                while True:
                    frame = await self.read()
                    if matches(frame):
                        return frame
                    self.inbox.append(frame)
        except TimeoutError:
            last = list(self.inbox)[-3:]
            raise AssertionError(f"waited in vain for {what}; the last of what came: {last}") from None

    async def take(self, op: str, **fields: object) -> Frame:
        """The first frame with this op and these fields."""
        wanted = {"op": op, **fields}
        return await self.take_where(lambda frame: wanted.items() <= _shallow(frame).items(), str(wanted))

    async def message(self, topic: str) -> Frame:
        """The next message of a topic: its `msg`."""
        msg: Frame = (await self.take("publish", topic=topic))["msg"]
        return msg

    async def message_where(self, topic: str, matches: Callable[[Frame], bool]) -> Frame:
        """The next message of a topic that matches; the ones before it are thrown away."""
        async with asyncio.timeout(PATIENCE):
            while True:
                msg = await self.message(topic)
                if matches(msg):
                    return msg

    async def subscribe(self, topic: str, **fields: object) -> None:
        """Subscribe, and come back once the server has done it."""
        await self.send("subscribe", topic=topic, **fields)
        await self.settle()

    async def settle(self) -> list[Frame]:
        """Come back once the server has handled all that was sent; what it has said until then, the inbox first.

        Frames are handled in order, so the answer to a harmless call comes after all that went before it.
        """
        self._num_calls += 1
        mark = f"settle-{self._num_calls}"
        await self.send("call_service", service="/rosapi/get_time", id=mark)
        await self.take("service_response", id=mark)
        frames = list(self.inbox)
        self.inbox.clear()
        return frames

    async def call(self, service: str, args: object = None, **fields: object) -> Frame:
        """The whole answer to a call."""
        self._num_calls += 1
        mark = f"call-{self._num_calls}"
        await self.send("call_service", service=service, id=mark, args={} if args is None else args, **fields)
        return await self.take("service_response", id=mark)

    async def values(self, service: str, args: object = None) -> Frame:
        """The values of an answer that must be a success."""
        answer = await self.call(service, args)
        assert answer["result"] is True, f"{service} was refused: {answer['values']}"
        values: Frame = answer["values"]
        return values

    async def ask(self, service: str, **request: object) -> Frame:
        """A call of a simulator's service: `request` within the arguments, `response` within the values."""
        response: Frame = (await self.values(service, {"request": request}))["response"]
        return response


async def open_raw(port: int) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A socket that has shaken hands and does nothing by itself: it neither answers pings nor holds back."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(
        b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    async with asyncio.timeout(PATIENCE):
        answer = await reader.readuntil(b"\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 101"), answer
    return reader, writer


def mask(text: str) -> bytes:
    """A short text as a client's WebSocket frame, masked with zeros."""
    data = text.encode()
    assert len(data) < 2**16
    length = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + len(data).to_bytes(2, "big")
    return b"\x81" + length + bytes(4) + data


def _shallow(frame: Frame) -> Frame:
    """The fields of a frame that can be compared at a glance."""
    return {key: value for key, value in frame.items() if isinstance(value, (str, int, float, bool))}


def _refuse_constant(name: str) -> NoReturn:
    raise AssertionError(f"the server sent a bare {name}, which is not JSON")

"""Shared parts of the long runs in this folder: a watched server process, a client, a bystander, some figures."""

from __future__ import annotations

import asyncio
import json
import os
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any, ClassVar, Protocol, Self

import orjson
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

__all__ = [
    "PATIENCE",
    "ROOT",
    "Bystander",
    "Client",
    "Figures",
    "Frame",
    "GoneError",
    "RefusedError",
    "SoakError",
    "Waits",
    "WatchedServer",
    "census",
    "differences",
    "handshake",
    "masked",
    "open_raw",
    "reset",
    "slope_per_hour",
    "until",
]

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


# A client


class Client:
    """A rosbridge client that reads all the time.

    Attributes:
        socket: the WebSocket.
        num_heard: messages by topic.
        told: texts of status frames of level error.
        on_op: additional functions for frames, by op.
        is_leaving: the end of the connection is expected.
        num_calls: calls so far; the id of the next one is `call-N`, with the next number.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self.socket = connection
        self.num_heard: Counter[str] = Counter()
        self.told: list[str] = []
        self.on_op: dict[str, Callable[[Frame], None]] = {}
        self.is_leaving = False
        self.num_calls = 0
        self._waiting: dict[str, asyncio.Future[Frame]] = {}
        self._wanted: dict[str, asyncio.Future[Frame]] = {}
        self._reading = asyncio.get_running_loop().create_task(self._read())

    @classmethod
    async def open(cls, url: str) -> Client:
        """Connect a client.

        Args:
            url: of the server.

        Returns:
            The client.

        Raises:
            GoneError: the server does not accept it.
        """
        try:
            async with asyncio.timeout(PATIENCE):
                return cls(await connect(url, compression=None, max_size=None, ping_interval=None, proxy=None))
        except (OSError, WebSocketException) as error:
            raise GoneError(f"no connection to {url}: {error!r}") from None

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def send(self, op: str, **fields: object) -> None:
        """Send an op.

        Args:
            op: its name.
            fields: of the op.

        Raises:
            GoneError: the connection is closed.
        """
        await self.send_raw(orjson.dumps({"op": op, **fields}).decode())

    async def send_raw(self, frame: str | bytes) -> None:
        """Send a frame as it is.

        Args:
            frame: text, or bytes for a binary one.

        Raises:
            GoneError: the connection is closed.
        """
        try:
            await self.socket.send(frame)
        except ConnectionClosed as error:
            raise GoneError(f"the server closed the connection: {error}") from None

    async def answer(self, op: str, **fields: object) -> Frame:
        """Send an op with an id, and wait for the frame with this id.

        Args:
            op: its name.
            fields: of the op.

        Raises:
            GoneError: the connection is closed.
            SoakError: there is no answer.
        """
        self.num_calls += 1
        mark = f"call-{self.num_calls}"
        future: asyncio.Future[Frame] = asyncio.get_running_loop().create_future()
        self._waiting[mark] = future
        try:
            await self.send(op, id=mark, **fields)
            async with asyncio.timeout(PATIENCE):
                return await future
        except TimeoutError:
            raise SoakError(f"no answer to {op} {fields} within {PATIENCE:.0f} s") from None
        finally:
            self._waiting.pop(mark, None)

    async def call(self, service: str, args: object = None, **fields: object) -> Frame:
        """Call a service.

        Args:
            args: of the call.
            fields: further fields of the op.

        Returns:
            The values of the answer.

        Raises:
            RefusedError: it was refused.
            SoakError: there is no answer.
        """
        answer = await self.answer("call_service", service=service, args=args or {}, **fields)
        if not answer["result"]:
            raise RefusedError(f"{service}: {answer['values']}")
        values: Frame = answer["values"]
        return values

    async def request(self, service: str, **request: object) -> Frame:
        """Call a service of the simulator, which wraps its request and its response.

        Args:
            request: fields of the request.

        Returns:
            Fields of the response.

        Raises:
            RefusedError: it was refused.
            SoakError: there is no answer.
        """
        values = await self.call(service, {"request": request})
        response: Frame = values["response"]
        return response

    async def next_message(self, topic: str) -> Frame:
        """Wait for the next message of a topic that is subscribed to already.

        Returns:
            The message.

        Raises:
            GoneError: the connection is closed.
            SoakError: there is none.
        """
        future = self._wanted.get(topic)
        if future is None:
            future = self._wanted[topic] = asyncio.get_running_loop().create_future()
        try:
            async with asyncio.timeout(PATIENCE):
                return await asyncio.shield(future)
        except TimeoutError:
            raise SoakError(f"no message on {topic} within {PATIENCE:.0f} s") from None

    async def close(self) -> None:
        """Close the connection in order."""
        self.is_leaving = True
        await self.socket.close()
        await self._reading

    async def cut(self, *, is_reset: bool = False) -> None:
        """Cut the connection.

        Args:
            is_reset: by a reset (RST), else as after a crash (FIN).
        """
        self.is_leaving = True
        if is_reset:
            reset(self.socket.transport)
        self.socket.transport.abort()
        await self._reading

    async def _read(self) -> None:
        try:
            async for data in self.socket:
                self._take(data)
        except ConnectionClosed:
            pass
        finally:
            gone = GoneError(
                "the connection is closed"
                if self.is_leaving
                else f"the server closed the connection: {self.socket.close_code} {self.socket.close_reason}"
            )
            for future in [*self._waiting.values(), *self._wanted.values()]:
                if not future.done():
                    future.set_exception(gone)
                    future.exception()  # an answer that no code waits for is not a mistake

    def _take(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            self.num_heard["binary"] += 1
            if "binary" in self.on_op:
                self.on_op["binary"]({"data": data})
            return
        frame: Frame = orjson.loads(data)
        op = frame["op"]
        if op == "publish":
            self.num_heard[frame["topic"]] += 1
            wanted = self._wanted.pop(frame["topic"], None)
            if wanted is not None:
                wanted.set_result(frame["msg"])
        elif op == "status":
            self.told.append(frame["msg"])
        elif op in {"service_response", "action_result"}:
            waiting = self._waiting.get(frame.get("id", ""))
            if waiting is not None and not waiting.done():
                waiting.set_result(frame)
        if op in self.on_op:
            self.on_op[op](frame)


# Bare sockets


def handshake() -> bytes:
    """Return the request that opens a WebSocket."""
    return (
        b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )


async def open_raw(
    port: int, *, is_greeting: bool = True, buffer: int = 1 << 16
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """Open a bare socket, which answers no pings and reads nothing beyond its buffer.

    Args:
        port: of the server.
        is_greeting: do the handshake.
        buffer: size of its receive buffer [bytes].

    Returns:
        Its reader and writer.

    Raises:
        GoneError: the server does not accept it.
    """
    plain = socket.socket()
    plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    plain.setblocking(False)  # noqa: FBT003 - the standard library's own
    try:
        async with asyncio.timeout(PATIENCE):
            await asyncio.get_running_loop().sock_connect(plain, ("127.0.0.1", port))
            reader, writer = await asyncio.open_connection(sock=plain, limit=buffer)
            if is_greeting:
                writer.write(handshake())
                answer = await reader.readuntil(b"\r\n\r\n")
                if not answer.startswith(b"HTTP/1.1 101"):
                    writer.transport.abort()
                    raise GoneError(f"the handshake was answered {answer[:80]!r}")
    except (OSError, EOFError) as error:
        plain.close()
        raise GoneError(f"no connection: {error!r}") from None
    return reader, writer


def masked(payload: bytes, first: int = 0x81) -> bytes:
    """Return a WebSocket frame of a client, masked with zeros.

    Args:
        payload: its content.
        first: its first byte.
    """
    size = len(payload)
    if size < 126:
        head = bytes((first, 0x80 | size))
    elif size < 2**16:
        head = struct.pack("!BBH", first, 0xFE, size)
    else:
        head = struct.pack("!BBQ", first, 0xFF, size)
    return head + bytes(4) + payload


def reset(transport: asyncio.BaseTransport) -> None:
    """End a connection with a reset (RST).

    Args:
        transport: of the connection.
    """
    plain = transport.get_extra_info("socket")
    if plain is not None:
        with suppress(OSError):
            plain.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


# What is left behind, and what grows


async def census(client: Client) -> dict[str, list[str]]:
    """Return the names on the bus, as rosapi lists them.

    Args:
        client: asks.

    Returns:
        Kind -> names.
    """
    return {
        "topics": sorted((await client.call("/rosapi/topics"))["topics"]),
        "services": sorted((await client.call("/rosapi/services"))["services"]),
        "nodes": sorted((await client.call("/rosapi/nodes"))["nodes"]),
        "action servers": sorted((await client.call("/rosapi/action_servers"))["action_servers"]),
    }


def differences(before: Mapping[str, Sequence[str]], after: Mapping[str, Sequence[str]]) -> list[str]:
    """Return one line for each list that has changed.

    Args:
        before: kind -> names.
        after: kind -> names.
    """
    lines = []
    for name, names in before.items():
        gone, new = sorted(set(names) - set(after[name])), sorted(set(after[name]) - set(names))
        if gone or new:
            lines.append(f"{name}: gone {gone}, left behind {new}")
    return lines


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

#!/usr/bin/env python3
"""Send random ops of every kind to a live server for minutes, and check that an honest client is not disturbed.

    python scripts/soak/fuzz.py [--minutes 10] [--seed 0] [--clients 4] [--only NAME]
    python scripts/soak/fuzz.py --replay FILE
    python scripts/soak/fuzz.py --decoders 20

Several clients at once send frames from `fuzz_frames.py`: right and wrong ops in every encoding, values by the
definitions, damaged frames; some leave in the middle of one. Each makes one honest call before it leaves. The server
runs in one configuration after the other: with and without a world, both releases, both generations of ROS, other
maps, synchronous from the start, recording, compressing.

A failure is: a traceback in the log, an early or bad end of the process, a call without an answer, a connection closed
with 1011, memory beyond the bound, a world that cannot be reset at the end, or a failure of the honest client
(`innocent.py`). Then the frames since the server's start are in a file, and `--replay` sends them again.
`--decoders N` runs the tests that damage valid documents, with N times as many documents as each of them says.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, cast

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.morai.releases import LENIENCY  # noqa: E402
from rosbridge_sim.schema.store import Store  # noqa: E402
from rosbridge_sim.shell.files.definitions import read_definitions  # noqa: E402
from scripts.soak.fuzz_bridge import spoiling  # noqa: E402
from scripts.soak.fuzz_frames import Act, FrameMaker, Interface  # noqa: E402
from scripts.soak.fuzz_server import (  # noqa: E402
    CONFIGURATIONS,
    Configuration,
    FuzzError,
    Server,
    make_data,
    serving,
)
from scripts.soak.fuzz_tape import Tape  # noqa: E402

PATIENCE = 60.0
"""Longest wait for an answer before it counts as lost [s]."""

FRAGMENTS = 1.0
"""Time in which a client that is not answered must get fragments [s]. It may have asked for ten million of them, by 200
glued calls of `/rosapi/topics_and_raw_types` with `fragment_size` 1; then its answer comes after them, in minutes."""

ROUND = 40.0
"""Seconds in one configuration; then a new server starts in the next one."""

MAX_GROWTH = 400.0
"""Memory above that of the idle server [MB]: outboxes of a few clients that read slowly, and their state."""

DECODER_TESTS = (
    "tests/protocol/test_any_frame.py",
    "tests/simulator/test_any_frame.py",
    "tests/schema/test_any_definition.py",
    "tests/simulator/test_any_document.py",
    "tests/shell/bags/test_any_file.py",
    "tests/cli/test_any_tool.py",
)
"""Tests that use `tests/mutations.py`."""

ACTS = (5, 20, 100, 300)
"""Number of acts of one client before it leaves."""


@dataclass(slots=True)
class Report:
    """Counts of a run.

    Attributes:
        num: counts of acts, visits, closed connections and received frames.
        memory: idle, greatest and last memory of each server [MB].
        innocent: last line of the honest client, per server.
    """

    num: Counter[str] = field(default_factory=Counter)
    memory: list[tuple[str, float, float, float]] = field(default_factory=list)
    innocent: list[dict[str, Any]] = field(default_factory=list)


# Clients


class Visitor:
    """One malicious client: it connects, acts, makes one honest call and leaves."""

    def __init__(self, number: int, tape: Tape, report: Report, maker: FrameMaker | None) -> None:
        self._number = number
        self._tape = tape
        self._report = report
        self._maker = maker
        self._mark = f"honest:{number}"
        self._answered = asyncio.Event()
        self._num_fragments = 0

    async def visit(self, url: str, acts: Iterable[Act]) -> None:
        """Carry out all acts on a new connection.

        Args:
            url: of the server.
            acts: in order.

        Raises:
            FuzzError: the server did something wrong.
        """
        acts = iter(acts)
        first = next(acts)
        if first.form == "raw":
            self._tape.add(self._number, first)
            self._report.num["raw"] += 1
            await _send_raw(url, first.data)
            return
        try:
            socket = await _connect(url, offers_deflate=self._number % 3 == 0)
        except (OSError, WebSocketException) as error:
            raise FuzzError(f"client {self._number} cannot connect: {error!r}") from None
        reading = asyncio.create_task(self.read(socket))
        try:
            for act in chain([first], acts):
                self._tape.add(self._number, act)
                self._report.num[act.form] += 1
                await self.act(socket, act)
                if act.form == "part":
                    return
            await self.leave(socket)
        except (ConnectionClosed, AttributeError):  # AttributeError is the library's own, of a closed transport
            self.judge_close(socket)
        finally:
            socket.transport.abort()
            reading.cancel()
            with suppress(asyncio.CancelledError):
                await reading

    async def act(self, socket: ClientConnection, act: Act) -> None:
        """Carry out one act.

        Args:
            socket: the connection.
        """
        match act.form:
            case "text":
                await socket.send(act.data.decode())
            case "binary":
                await socket.send(act.data)
            case "pieces":
                third = len(act.data) // 3 + 1
                await socket.send([act.data[i : i + third] for i in range(0, len(act.data), third)])
            case "wait":
                await asyncio.sleep(int(act.data) / 1000)
            case "deaf":
                socket.transport.pause_reading()
                asyncio.get_running_loop().call_later(int(act.data) / 1000, socket.transport.resume_reading)
            case "part":
                socket.transport.write(act.data)
                await asyncio.sleep(0.005)
                socket.transport.abort()

    async def leave(self, socket: ClientConnection) -> None:
        """Make the honest call, and close.

        Args:
            socket: the connection.

        Raises:
            FuzzError: it was not answered.
        """
        await self._ask(socket)
        await socket.close()
        self._report.num["closed by the client"] += 1

    def judge_close(self, socket: ClientConnection) -> None:
        """Count how the server has closed a connection.

        Args:
            socket: the connection.

        Raises:
            FuzzError: not for a mistake of this client.
        """
        code = socket.close_code
        self._report.num[f"closed with {code}"] += 1
        if code not in {1002, 1007, 1008, 1009}:
            raise FuzzError(f"client {self._number} was closed with {code} {socket.close_reason!r}") from None

    async def _ask(self, socket: ClientConnection) -> None:
        """Make one call at the end; it must be answered, whatever the client did."""
        call = {"op": "call_service", "service": "/rosapi/get_time", "id": self._mark}
        await socket.send(json.dumps(call))
        waiting = [asyncio.create_task(self._answered.wait()), asyncio.create_task(socket.wait_closed())]
        done, _ = await asyncio.wait(waiting, timeout=PATIENCE, return_when=asyncio.FIRST_COMPLETED)
        num_fragments = self._num_fragments
        if not done:
            done, _ = await asyncio.wait(waiting, timeout=FRAGMENTS, return_when=asyncio.FIRST_COMPLETED)
        for task in waiting:
            task.cancel()
        self._report.num["honest calls answered"] += self._answered.is_set()
        if not done and self._num_fragments > num_fragments:
            self._report.num["left behind fragments of their own"] += 1
        elif not done:
            raise FuzzError(f"client {self._number} was not answered within {PATIENCE:g} s")

    async def read(self, socket: ClientConnection) -> None:
        """Read all frames, and answer calls and goals in some way.

        Args:
            socket: the connection.
        """
        with suppress(ConnectionClosed):
            async for data in socket:
                self._report.num["frames that came"] += 1
                if isinstance(data, bytes):
                    continue
                frame = json.loads(data)
                self._num_fragments += frame.get("op") == "fragment"
                if frame.get("id") == self._mark:
                    self._answered.set()
                elif self._maker is not None and frame.get("op") in {"call_service", "send_action_goal"}:
                    act = self._maker.answer(frame)
                    if act is not None:
                        self._tape.add(self._number, act)
                        self._report.num["answers"] += 1
                        await self.act(socket, act)


async def _connect(url: str, *, offers_deflate: bool) -> ClientConnection:
    compression = "deflate" if offers_deflate else None
    return await connect(url, compression=compression, max_size=None, ping_interval=None, proxy=None)


async def _send_raw(url: str, data: bytes) -> None:
    """Send bytes to the port, read a little and close."""
    host, port = url.removeprefix("ws://").rstrip("/").split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    with suppress(OSError, TimeoutError):
        writer.write(data)
        await writer.drain()
        async with asyncio.timeout(0.05):
            await reader.read(1_000)
    writer.transport.abort()


async def _interface(url: str, configuration: Configuration) -> Interface:
    """Return the server's topics and services, as rosapi lists them."""
    store = Store(read_definitions(configuration.release), leniency=LENIENCY, ros=configuration.ros)
    interface = Interface(store)
    async with connect(url, compression=None, max_size=None, proxy=None) as socket:

        async def ask(service: str, /, **args: object) -> dict[str, Any]:
            await socket.send(json.dumps({"op": "call_service", "service": service, "args": args}))
            answer = json.loads(await socket.recv())
            return cast("dict[str, Any]", answer["values"])

        topics = await ask("/rosapi/topics")
        interface.topics.update(zip(topics["topics"], topics["types"], strict=True))
        for service in (await ask("/rosapi/services"))["services"]:
            interface.services[service] = (await ask("/rosapi/service_type", service=service))["type"]
    return interface


async def fuzz(
    server: Server, tape: Tape, report: Report, *, seed: str, num_clients: int, seconds: float = 0.0, visits: int = 0
) -> None:
    """Let clients come and go, for a time or for a number of visits of each.

    Args:
        server: running.
        tape: keeps the acts.
        report: counts.
        seed: random seed.
        num_clients: at one time.
        seconds: duration, or 0.
        visits: of each client, or 0.

    Raises:
        FuzzError: the server did something wrong.
    """
    configuration = tape.configuration
    async with AsyncExitStack() as stack:
        servers = [server]
        interface = await _interface(server.url, configuration)
        if configuration.is_attached:
            proxy = await stack.enter_async_context(spoiling(server.url, seed, interface))
            servers.append(await stack.enter_async_context(_attached(configuration, server.folder, proxy.url)))
            interface = await _interface(server.url, configuration)
            proxy.is_spoiling = True
        innocent = stack.enter_context(_innocent(server.url, *(["/Ego_topic"] if configuration.has_world else [])))
        watch = _Watch(servers, innocent)
        idle = server.memory()

        async def come_and_go(lane: int) -> None:
            count = 0
            end = time.monotonic() + seconds
            while count < visits or time.monotonic() < end:
                maker = FrameMaker(f"{seed}:{lane}:{count}", interface)
                visitor = Visitor(lane + num_clients * count, tape, report, maker)
                await visitor.visit(server.url, maker.acts(maker.chance.choice(ACTS)))
                count += 1
                report.num["visits"] += 1

        await _together([come_and_go(lane) for lane in range(num_clients)], watch.run())
        watch.look()
        if configuration.has_world:
            await _begin_anew(server.url)
        elif configuration.is_attached:
            report.num["frames spoiled at the bridge"] += proxy.num_spoiled
            report.num["cuts at the bridge"] += proxy.num_cut
        report.innocent.append(await _farewell(innocent))
    report.memory.append((configuration.name, idle, watch.most, server.memory()))


class _Watch:
    """Watcher of the programs.

    Attributes:
        most: greatest memory of the first of them [MB].
    """

    def __init__(self, servers: Sequence[Server], innocent: subprocess.Popen[str]) -> None:
        self.most = 0.0
        self._servers = [(server, server.memory()) for server in servers]
        self._innocent = innocent

    async def run(self) -> None:
        """Check the programs again and again."""
        while True:
            self.look()
            await asyncio.sleep(0.2)

    def look(self) -> None:
        """Check that all programs run, without faults and within the memory bound.

        Raises:
            FuzzError: they do not.
        """
        for server, idle in self._servers:
            server.check()
            memory = server.memory()
            if memory > idle + MAX_GROWTH:
                raise FuzzError(f"memory has grown from {idle:.0f} to {memory:.0f} MB")
        self.most = max(self.most, self._servers[0][0].memory())
        if self._innocent.poll() is not None:
            raise FuzzError(f"the innocent client has ended: {_last_words(self._innocent)}")


async def _farewell(innocent: subprocess.Popen[str]) -> dict[str, Any]:
    """End the honest client, and return its figures."""
    assert innocent.stdin is not None
    innocent.stdin.close()
    words = await asyncio.to_thread(_last_words, innocent)
    if innocent.returncode:
        raise FuzzError(f"the innocent client says: {words}")
    return cast("dict[str, Any]", json.loads(words))


@asynccontextmanager
async def _attached(configuration: Configuration, folder: Path, bridge: str) -> AsyncIterator[Server]:
    """Run a simulator behind a bridge in this event loop, until the end of the block."""
    attached = await asyncio.to_thread(Server, configuration, folder, bridge)
    try:
        yield attached
        await asyncio.to_thread(attached.stop)
    finally:
        attached.kill()


async def _begin_anew(url: str) -> None:
    """Check that the world can still be reset and moved.

    Raises:
        FuzzError: it cannot.
    """
    async with asyncio.timeout(PATIENCE), await _connect(url, offers_deflate=False) as socket:

        async def ask(service: str, **args: object) -> dict[str, Any]:
            await socket.send(json.dumps({"op": "call_service", "service": service, "args": args, "id": service}))
            while (frame := json.loads(await socket.recv())).get("id") != service:
                pass
            if not frame["result"]:
                raise FuzzError(f"{service} is refused at the end: {frame['values']}")
            return cast("dict[str, Any]", frame["values"])

        await ask("/Service_MoraiEventCmd", request={"option": 8, "set_pause": False})
        await ask("/sim/reset", seed=0)
        request = {"user_id": "honest", "start_sync_mode": True, "time_step": 20}
        answer = (await ask("/SyncModeCmd", request=request))["response"]
        if not answer["result"]:
            raise FuzzError(f"synchronous mode is refused at the end: {answer}")
        frame = answer["frame"] + 1
        answer = (await ask("/SyncModeWaitForTick", request={"user_id": "honest", "frame": frame}))["response"]
        if not answer["tick_status"] or answer["frame"] != frame:
            raise FuzzError(f"the world does not move at the end: {answer}")


async def _together(clients: Sequence[Any], watching: Any) -> None:  # noqa: ANN401 - coroutines
    """Run all clients to their end; the first failure of a client or of the watch ends all."""
    watch = asyncio.create_task(watching)
    tasks = [asyncio.create_task(client) for client in clients]
    try:
        waiting = set(tasks)
        while waiting:
            done, pending = await asyncio.wait({watch, *waiting}, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
            waiting = pending - {watch}
    finally:
        for task in (watch, *tasks):
            task.cancel()
        await asyncio.gather(watch, *tasks, return_exceptions=True)


async def replay(server: Server, tape: Tape, report: Report) -> None:
    """Send the acts of a tape again, each client's on its own connection, in the same order, and its honest call.

    Args:
        server: running.
        tape: the acts.
        report: counts.

    Raises:
        FuzzError: the server did something wrong.
    """
    visits: dict[int, tuple[Visitor, ClientConnection]] = {}
    closed: set[int] = set()
    reading: list[asyncio.Task[None]] = []
    last = {client: i for i, (client, _) in enumerate(tape.acts)}
    for i, (client, act) in enumerate(tape.acts):
        if act.form == "raw":
            await _send_raw(server.url, act.data)
            continue
        if client not in visits:
            visits[client] = (
                Visitor(client, tape, report, None),
                await _connect(server.url, offers_deflate=client % 3 == 0),
            )
            reading.append(asyncio.create_task(visits[client][0].read(visits[client][1])))
        visitor, socket = visits[client]
        if client in closed:
            continue
        try:
            await visitor.act(socket, act)
            if act.form == "part":  # it has left; an answer to a call may stand behind that on the tape
                closed.add(client)
            elif last[client] == i:
                await visitor.leave(socket)
        except (ConnectionClosed, AttributeError):  # as in `visit`
            closed.add(client)
            visitor.judge_close(socket)
        if i % 100 == 0:
            server.check()
    for task in reading:
        task.cancel()
    await asyncio.sleep(0.5)
    server.check()


@contextmanager
def _innocent(*words: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, str(ROOT / "scripts" / "soak" / "innocent.py"), *words]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, text=True)  # noqa: S603 - our own program
    with process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def _last_words(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    words = process.stdout.read().strip()
    process.wait(PATIENCE)
    return words


def main() -> int:
    """Run it, with a line for each configuration."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--clients", type=int, default=4)
    parser.add_argument("--only", choices=[one.name for one in CONFIGURATIONS], help="one configuration alone")
    parser.add_argument("--keep-going", action="store_true", help="go on in the next configuration after a failure")
    parser.add_argument("--decoders", type=int, metavar="N", help="spoil documents for all decoders instead")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="send the frames of a failure again")
    options = parser.parse_args()
    if options.decoders:
        command = [sys.executable, "-m", "pytest", "-q", "--show-capture=no", *DECODER_TESTS]
        environment = {**os.environ, "FUZZ_FACTOR": str(options.decoders)}
        return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode  # noqa: S603 - our own program
    report = Report()
    with tempfile.TemporaryDirectory() as name:
        data = Path(name)
        make_data(data, options.seed)
        num_failed = _replay(options.replay, data) if options.replay else _fuzz_all(options, data, report)
    print(", ".join(f"{count:,} {what}" for what, count in sorted(report.num.items())))
    print(f"NOT GOOD: {num_failed} failures" if num_failed else "good")
    return 1 if num_failed else 0


def _replay(path: Path, data: Path) -> int:
    tape = Tape.read(path)
    try:
        with serving(tape.configuration, data) as server:
            asyncio.run(replay(server, tape, Report()))
    except FuzzError as error:
        print(f"FAILED again in {tape.configuration.name!r}: {error}")
        return 1
    return 0


def _fuzz_all(options: argparse.Namespace, data: Path, report: Report) -> int:
    """Use one configuration after the other until the time is over, and return the number of failed rounds."""
    chosen = [one for one in CONFIGURATIONS if options.only in {None, one.name}]
    end = time.monotonic() + options.minutes * 60.0
    count = num_failed = 0
    while (left := end - time.monotonic()) > 0 and (not num_failed or options.keep_going):
        tape = Tape(chosen[count % len(chosen)])
        seed = f"{options.seed}:{count}"
        try:
            with serving(tape.configuration, data) as server:
                seconds = min(ROUND, left)
                asyncio.run(fuzz(server, tape, report, seed=seed, num_clients=options.clients, seconds=seconds))
        except FuzzError as error:
            num_failed += 1
            path = Path(tempfile.gettempdir()) / f"fuzz-{options.seed}-{count}-{os.getpid()}.jsonl"
            tape.write(path)
            print(f"FAILED in {tape.configuration.name!r} with seed {options.seed}, round {count}: {error}")
            for client, act in tape.acts[-5:]:
                print(f"  client {client} {act.form}: {act.data[:300]!r}")
            print(f"its frames: {path}; send them again by --replay {path}", flush=True)
        else:
            _, idle, most, last = report.memory[-1]
            memory = f"{idle:.0f} MB idle, {most:.0f} at most, {last:.0f} at the end"
            print(
                f"{tape.configuration.name:10} {report.num['visits']:6,} visits; {memory}; {report.innocent[-1]}",
                flush=True,
            )
        count += 1
    return num_failed


if __name__ == "__main__":
    sys.exit(main())

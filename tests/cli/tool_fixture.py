"""Fixtures for tests of the tools: commands run in this process, and foreign or silent servers."""

from __future__ import annotations

import asyncio
import io
import json
import os
import subprocess
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from rosbridge_sim.cli.command_table import TOOLS
from tests import fork_server
from tests.fork_server import ForkedProgram
from tests.support import PATIENCE

__all__ = [
    "Frame",
    "Reply",
    "Result",
    "answering",
    "in_the_background",
    "other_server",
    "raw_server",
    "run",
    "start",
    "talking_server",
]

Frame = dict[str, Any]
"""A JSON object of the wire."""


@dataclass(frozen=True)
class Result:
    """How a command ended, and what it said."""

    code: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        return self.out.splitlines()

    @property
    def json(self) -> Any:  # noqa: ANN401 - whatever the command shows
        assert (self.code, self.err) == (0, ""), self
        return json.loads(self.out)

    @property
    def complaint(self) -> str:
        """The one line of a command that failed, without the program's name."""
        assert self.err.startswith("rosbridge-sim: "), self
        assert self.err.count("\n") == 1, self
        return self.err.removeprefix("rosbridge-sim: ").rstrip("\n")


def run(*words: str, url: str | None = None) -> Result:
    """Run a command that ends by itself."""
    group, *rest = words
    if url is not None:
        rest += ["--url", url]
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = TOOLS[group](rest)
    return Result(code, out.getvalue(), err.getvalue())


async def in_the_background(*words: str, url: str) -> Result:
    """The same beside a test's own event loop."""
    async with asyncio.timeout(PATIENCE):
        return await asyncio.to_thread(run, *words, url=url)


def start(*words: str, url: str, stdout: int = subprocess.PIPE) -> ForkedProgram:
    """A command in a process of its own, with its output in pipes or wherever `stdout` says."""
    command = ["-m", "rosbridge_sim", *words, "--url", url]
    return fork_server.popen(command, env={**os.environ, "PYTHONUNBUFFERED": "1"}, stdout=stdout)


# Servers


Reply = Callable[[Frame], Iterable[str | bytes]]
"""What a server has to say to a frame."""


@asynccontextmanager
async def talking_server(
    handle: Callable[[ServerConnection], Awaitable[None]],
    look: Callable[[ServerConnection, Request], Response | None] | None = None,
) -> AsyncIterator[str]:
    """A WebSocket server that does with each connection what `handle` does; its URL."""
    async with serve(handle, "127.0.0.1", 0, process_request=look) as server:
        (socket,) = server.sockets
        yield f"ws://127.0.0.1:{socket.getsockname()[1]}"


@asynccontextmanager
async def other_server(
    reply: Reply, look: Callable[[ServerConnection, Request], Response | None] | None = None
) -> AsyncIterator[str]:
    """A WebSocket server that replies to each frame with these; its URL."""

    async def handle(connection: ServerConnection) -> None:
        async for data in connection:
            for frame in reply(json.loads(data)):
                await connection.send(frame)

    async with talking_server(handle, look) as url:
        yield url


def answering(**services: Frame | str) -> Reply:
    """Replies of a server with these rosapi services, and nothing else: values, or the text of a refusal."""

    def reply(frame: Frame) -> Iterable[str | bytes]:
        name = str(frame.get("service", "")).removeprefix("/rosapi/")
        if name in services:
            values = services[name]
            yield json.dumps(
                {
                    "op": "service_response",
                    "id": frame["id"],
                    "service": frame["service"],
                    "values": values,
                    "result": not isinstance(values, str),
                }
            )

    return reply


@asynccontextmanager
async def raw_server(
    talk: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]],
) -> AsyncIterator[str]:
    """A TCP server that does with each connection what `talk` does; its URL."""
    tasks: list[asyncio.Future[None]] = []

    def greet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.ensure_future(talk(reader, writer))
        task.add_done_callback(lambda _: writer.close())  # also of one that is cancelled before it begins
        tasks.append(task)

    server = await asyncio.start_server(greet, "127.0.0.1", 0)
    (socket,) = server.sockets
    try:
        yield f"ws://127.0.0.1:{socket.getsockname()[1]}"
    finally:
        server.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

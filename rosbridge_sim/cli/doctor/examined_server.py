"""The server that `rosbridge-sim doctor` examines: what it is, and connections to it for the checks."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

from websockets.exceptions import WebSocketException

from rosbridge_sim.cli.tools.tool_client import ToolAnswer
from rosbridge_sim.doctor.check import ON_ROS_2, Check
from rosbridge_sim.doctor.check_frames import read_frame
from rosbridge_sim.link.bridge_errors import BridgeError
from rosbridge_sim.link.client_connection import why_not
from rosbridge_sim.link.plain_client import PlainClient
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.link.urls import shown_url
from rosbridge_sim.loose_types import JsonValue

_DETAILS = {"topic": "/rosapi/message_details", "service": "/rosapi/service_request_details"}
"""Kind of a type -> service that knows it."""

_WELL_KNOWN = {"topic": "std_msgs/String", "service": "std_srvs/Empty"}
"""Kind of a type -> one that every server knows."""

STATUS_PATIENCE = 0.1
"""Wait for a status behind the answer to a later call [s]: most servers never send one."""

MAX_SETTLING = 2.0
"""Longest wait for a subscription to work [s]."""

LEAST_DIALLING = 5.0
"""Least patience for a connection [s]: a handshake takes longer than an answer."""

BEAT = 0.01
"""Time between two publishes while the doctor looks for a subscription's effect [s]."""

FAST = 0.03
"""A subscription that works so soon works at once [s]."""


NO_CONNECTION = (OSError, ValueError, WebSocketException)
"""Errors of the library where a connection cannot be made."""


class ExaminedServer:
    """A server.

    Attributes:
        url: full URL.
        name: what it is, in words.
        prefix: namespace of all names of the checks.
        ros: 1 or 2; 0 if it does not tell.
        patience: longest wait for a frame [s].
        dialling: longest wait for a connection [s].
        settling: time until a subscription works [s].
        has_answers: it answers a call of a service that it may lack.
    """

    def __init__(self, url: str, token: str | None, patience: float, prefix: str) -> None:
        self.url = url
        self.token = token
        self.patience = patience
        self.dialling = max(patience, LEAST_DIALLING)
        self.prefix = prefix
        self.ros = 0
        self.name = ""
        self.settling = 0.0
        self.has_answers = True
        self._numbers = itertools.count(1)
        self._asker = LiveClients(self)
        self._known_types: dict[tuple[str, str], bool] = {}
        self._asking = asyncio.Lock()

    def why_not(self, error: Exception) -> str:
        """Return why there is no connection.

        Args:
            error: one of `NO_CONNECTION`.
        """
        return why_not(self.url, error, self.dialling, flag="URL", token="--token", secrets=[self.token or ""])  # noqa: S106 - a flag, and no secret

    async def find_out(self, ros: int | None) -> None:
        """Find out what it is.

        Args:
            ros: 1 or 2; None finds it out, too.

        Raises:
            BridgeError: there is no connection, it has closed the connection, or needs a token.
        """
        try:
            await self._find_out(ros)
        except NO_CONNECTION as error:
            raise BridgeError(self.why_not(error)) from error

    async def _find_out(self, ros: int | None) -> None:
        await self._asker.connect("doctor")
        answer = await self.call("/rosapi/get_time")
        self.has_answers = answer is not None
        if answer is not None and not answer.is_ok and "token" in str(answer.values):
            raise BridgeError(f"{shown_url(self.url)}: it needs a token (--token): {safe(str(answer.values))}")
        ending = (await self._asker.connect("doctor")).ending
        if ending is not None:
            code, reason = ending
            raise BridgeError(f"{shown_url(self.url)}: the connection has ended ({code}): {safe(reason)}")
        self.ros = ros or await self._find_ros()
        self.settling = await self._find_settling()
        kind = f"rosbridge of ROS {self.ros}" if self.ros else "rosbridge that does not tell its ROS"
        self.name = f"{shown_url(self.url)}: {kind}; subscriptions work after {1e3 * self.settling:.0f} ms"

    async def _find_ros(self) -> int:
        version = await self.call("/rosapi/get_ros_version")
        if version is not None and version.fields.get("version") in {1, 2}:
            return int(version.fields["version"])
        topics = await self.call("/rosapi/topics")
        types = topics.fields.get("types") if topics is not None else None
        names = [name for name in types if isinstance(name, str)] if isinstance(types, list) else []
        if not names:
            return 0
        return 2 if any("/msg/" in name for name in names) else 1

    async def _find_settling(self) -> float:
        topic = f"{self.prefix}/settling"
        async with self.clients() as clients:
            await clients.send("a", json.dumps({"op": "advertise", "topic": topic, "type": "std_msgs/String"}))
            await clients.connect("b")
            begun = asyncio.get_running_loop().time()
            await clients.send("b", json.dumps({"op": "subscribe", "topic": topic, "type": "std_msgs/String"}))
            while (waited := asyncio.get_running_loop().time() - begun) < MAX_SETTLING:
                await clients.send("a", json.dumps({"op": "publish", "topic": topic, "msg": {"data": "x"}}))
                await asyncio.sleep(BEAT)
                if await clients.rest("b"):
                    return 0.0 if waited < FAST else 1.5 * waited
        return 0.3

    async def call(self, service: str, **args: object) -> ToolAnswer | None:
        """Return the answer of a service; None if there is none in time."""
        return await self._asker.ask("doctor", service, args)

    async def why_not_applicable(self, check: Check) -> str:
        """Return why a check cannot be made with this server; empty if it can."""
        if check.ros and self.ros and check.ros != self.ros:
            return f"only for ROS {check.ros}"
        for kind, name in sorted(check.types):
            wanted = ON_ROS_2.get(name, name) if self.ros == 2 else name  # noqa: PLR2004 - as in the name
            if kind in _DETAILS and not await self._knows(kind, wanted):
                return f"{wanted} is not installed there"
        return ""

    async def _knows(self, kind: str, name: str) -> bool:
        """Return whether the server knows a type; True if it does not tell."""
        async with self._asking:
            if (kind, name) not in self._known_types:
                answer = await self.call(_DETAILS[kind], type=name)
                is_known = answer is None or answer.fields.get("typedefs") != []
                if answer is not None and not answer.is_ok:  # it refuses the type, or lacks the service
                    there = await self.call(_DETAILS[kind], type=_WELL_KNOWN[kind])
                    is_known = there is None or not there.is_ok
                self._known_types[kind, name] = is_known
            return self._known_types[kind, name]

    @asynccontextmanager
    async def dial(self, **offer: Any) -> AsyncIterator[PlainClient]:  # noqa: ANN401 - see `PlainClient.open`
        """Yield one connection, which is closed behind it.

        Args:
            offer: what differs from the doctor's own connections, such as `url`, `token` or `compression`.

        Raises:
            OSError, ValueError, WebSocketException: there is no connection; see `why_not`.
        """
        usual = {"url": self.url, "token": self.token, "patience": self.dialling}
        client = await PlainClient.open(**{**usual, **offer})
        try:
            yield client
        finally:
            await client.close()

    def count(self) -> int:
        """Return the number of the next check."""
        return next(self._numbers)

    @asynccontextmanager
    async def clients(self) -> AsyncIterator[LiveClients]:
        """Yield connections for a check, which are closed behind it."""
        clients = LiveClients(self)
        try:
            yield clients
        finally:
            await clients.close_all()

    async def close(self) -> None:
        """Close the doctor's own connection."""
        await self._asker.close_all()


class LiveClients:
    """Connections of one check, by the names of its clients; see `doctor.examination.Clients`."""

    def __init__(self, server: ExaminedServer) -> None:
        self._server = server
        self._clients: dict[str, PlainClient] = {}
        self._answers: dict[str, asyncio.Future[ToolAnswer]] = {}

    async def connect(self, name: str) -> PlainClient:
        """Return a connection; the first time it is made."""
        if name not in self._clients:
            server = self._server
            self._clients[name] = await PlainClient.open(
                server.url, token=server.token, patience=server.dialling, on_frame=self._take_answer
            )
        return self._clients[name]

    def _take_answer(self, frame: str | bytes) -> bool:
        """Take the answer to a call of the doctor's own; a second one is lost."""
        if isinstance(frame, bytes) or '"doctor:' not in frame[-200:] + frame[:200]:
            return False
        answer = _value_of(frame)
        if not isinstance(answer, dict) or not str(answer.get("id")).startswith("doctor:"):
            return False
        future = self._answers.pop(str(answer["id"]), None)
        if future is not None:
            future.set_result(ToolAnswer(bool(answer.get("result", True)), answer.get("values")))
        return True

    async def ask(self, name: str, service: str, args: object) -> ToolAnswer | None:
        """Return the answer of a service; None if there is none in time."""
        client = await self.connect(name)
        number = f"doctor:{self._server.count()}"
        future = self._answers[number] = asyncio.get_running_loop().create_future()
        await client.send(json.dumps({"op": "call_service", "id": number, "service": service, "args": args}))
        until = asyncio.get_running_loop().time() + self._server.patience
        while not future.done() and client.ending is None and await client.wait(until):
            pass
        self._answers.pop(number, None)
        return future.result() if future.done() else None

    async def send(self, name: str, frame: str | bytes) -> None:
        """Send a frame."""
        await (await self.connect(name)).send(frame)

    async def settle(self) -> None:
        """Wait until the server has read all frames, and subscriptions work."""
        if self._server.has_answers:
            open_ones = [name for name, client in self._clients.items() if client.ending is None]
            await asyncio.gather(*(self.ask(name, "/rosapi/get_time", {}) for name in open_ones))
        await asyncio.sleep(self._server.settling)

    async def next(self, name: str, *, is_status: bool) -> JsonValue:
        """Return the next frame of a client that is a status, or that is none; None if none comes in time."""
        client = await self.connect(name)
        loop = asyncio.get_running_loop()
        if is_status:
            await self.settle()
        until = loop.time() + (STATUS_PATIENCE if is_status else self._server.patience)
        while True:
            for at, frame in enumerate(client.frames):
                value = _value_of(frame)
                if (isinstance(value, dict) and value.get("op") == "status") == is_status:
                    del client.frames[at]
                    return value
            if client.ending is not None:
                return {"$closed": list(client.ending)}
            if not await client.wait(until):
                return None

    async def rest(self, name: str) -> Sequence[JsonValue]:
        """Return all frames that came to a client and were not taken."""
        client = self._clients.get(name)
        if client is None:
            return []
        frames, client.frames = client.frames, []
        return [_value_of(frame) for frame in frames]

    async def close(self, name: str) -> None:
        """Close a client's connection."""
        client = self._clients.pop(name, None)
        if client is not None:
            await client.close()

    async def close_all(self) -> None:
        """Close all connections."""
        await asyncio.gather(*(self.close(name) for name in list(self._clients)))


def _value_of(frame: str | bytes) -> JsonValue:
    try:
        return read_frame(frame)
    except (ValueError, RecursionError):
        return {"$unreadable": str(frame[:200])}

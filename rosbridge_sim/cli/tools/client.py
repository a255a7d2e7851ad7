"""A small rosbridge client: one socket, one thing at a time, and a deadline for every answer.

It is made for any rosbridge and not for ours alone: for one that never sends a status frame, that has no rosapi, that
cuts its long messages into fragments nobody asked for, or that says nothing at all. There is no task and no queue
behind it. Whoever waits for something reads the socket; what comes meanwhile and is not his waits in the inbox.
"""

from __future__ import annotations

import asyncio
import itertools
import json
from collections import deque
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import msgspec
import orjson
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.fragments import Defragmenter
from rosbridge_sim.protocol.ops import Fragment
from rosbridge_sim.shell.terminal_text import safe
from rosbridge_sim.shell.websocket.bridge_errors import BridgeError, RefusedError
from rosbridge_sim.shell.websocket.client_connection import why_gone, why_not
from rosbridge_sim.shell.websocket.library_log import quiet
from rosbridge_sim.shell.websocket.urls import full_url, shown_url

__all__ = ["Bridge", "Frame", "ToolAnswer", "absolute", "answer_of", "open_bridge", "words"]

MAX_SIZE = 2**28
"""The longest frame that is read [bytes]: a picture or a point cloud as base64 has a tenth of it."""

CLOSE_PATIENCE = 1.0
"""How long the other side may take to say goodbye [s]."""

CALLS_AT_ONCE = 20
"""Calls that are under way together: the reference server takes a thread for each."""

Frame = dict[str, Any]
"""A JSON object of the server's: what is in it is for whoever reads it to check."""


@dataclass(frozen=True, slots=True)
class ToolAnswer:
    """What a service said.

    Attributes:
        is_ok: whether it did what it was asked for.
        values: the response, or the text of the refusal.
    """

    is_ok: bool
    values: object


# The connection


@asynccontextmanager
async def open_bridge(url: str, token: str | None, patience: float) -> AsyncIterator[Bridge]:
    """A connection that is closed at the end.

    Args:
        url: `ws://HOST:PORT`; `HOST` or `HOST:PORT` will do.
        token: what lets us in, where something must.
        patience: how long an answer may take [s].

    Raises:
        BridgeError: it cannot be made.
        RefusedError: it ended by itself.
    """
    url = full_url(url)
    secrets = (token,) if token else ()
    headers = {"Authorization": f"Bearer {_check_token(token)}"} if token else {}
    try:
        connection = await connect(
            url,
            additional_headers=headers,
            compression=None,
            open_timeout=patience,
            close_timeout=CLOSE_PATIENCE,
            ping_interval=None,  # a server that is busy with a long call answers no ping, and that is no fault
            max_size=MAX_SIZE,
            proxy=None,  # the environment's are for the web
            logger=quiet,
        )
    except (OSError, ValueError, WebSocketException) as error:
        text = why_not(url, error, patience, flag="--url", token="--token", secrets=secrets)  # noqa: S106 - a flag
        raise BridgeError(text) from None
    async with connection:
        try:
            yield Bridge(connection, url, patience)
        except ConnectionClosed as closed:
            raise RefusedError(why_gone(url, closed, secrets)) from None


def _check_token(token: str) -> str:
    if not token.isascii() or not token.isprintable() or " " in token:
        raise BridgeError("--token: expected printable ASCII without blanks")
    return token


# Frames


class Bridge:
    """A rosbridge at the other end.

    Attributes:
        patience: how long an answer may take [s].
    """

    def __init__(self, connection: ClientConnection, url: str, patience: float) -> None:
        self.patience = patience
        self._connection = connection
        self._url = shown_url(url)
        self._inbox: deque[Frame] = deque()
        self._pieces = Defragmenter(MAX_SIZE)
        self._numbers = itertools.count(1)

    def now(self) -> float:
        """The time that deadlines are measured in [s]."""
        return asyncio.get_running_loop().time()

    async def send(self, op: str, **fields: object) -> str:
        """Send an op; the id that it got."""
        mark = f"{op}:{next(self._numbers)}"
        await self._connection.send(orjson.dumps({"op": op, "id": mark, **fields}).decode())
        return mark

    async def receive(self, until: float | None = None) -> Frame | None:
        """The next frame; None if none comes until then."""
        return self._inbox.popleft() if self._inbox else await self._read(until)

    def take_inbox(self) -> list[Frame]:
        """The frames that came while something else was waited for."""
        frames = list(self._inbox)
        self._inbox.clear()
        return frames

    async def _read(self, until: float | None) -> Frame | None:
        """The next frame off the socket. What is no JSON object is passed over."""
        try:
            async with asyncio.timeout_at(until):
                while True:
                    frame = _parse(await self._connection.recv())
                    if frame.get("op") == "fragment":
                        frame = _parse(self._join(frame))
                    if frame:
                        return frame
        except TimeoutError:
            return None

    def _join(self, frame: Frame) -> bytes:
        """The whole that a piece completes, or nothing."""
        try:
            return self._pieces.add(msgspec.convert(frame, Fragment), self.now()) or b""
        except (msgspec.ValidationError, FrameError) as error:
            note(f"a fragment that cannot be used: {error}")
            return b""

    # Calls

    async def call(self, service: str, args: object, patience: float | None) -> ToolAnswer | None:
        """What a service answers; None if it does not.

        Args:
            service: its name.
            args: the request, by name or by position.
            patience: how long it may take [s]; None is for ever. The server is told, and has a moment more, so that its
                own words win.
        """
        mark = await self.send("call_service", service=service, args=args, timeout=patience or 0.0)
        until = None if patience is None else self.now() + patience + _LAST_WORD
        return (await self._answers([mark], until)).get(mark)

    async def ask(self, service: str, /, **args: object) -> Frame:
        """The values of a rosapi service.

        Raises:
            RefusedError: it refuses, or is not there.
            BridgeError: there is no answer.
        """
        (answer,) = await self.ask_all([(service, args)])
        if not answer.is_ok or not isinstance(answer.values, dict):
            text = safe(str(answer.values))
            hint = "; is rosapi running there?" if "not exist" in text else ""
            raise RefusedError(f"/rosapi/{service} says: {text}{hint}")
        return answer.values

    async def ask_all(self, questions: Sequence[tuple[str, Mapping[str, object]]]) -> list[ToolAnswer]:
        """The answers of rosapi services, in order of the questions.

        Raises:
            BridgeError: one of them does not come.
        """
        answers: list[ToolAnswer] = []
        for start in range(0, len(questions), CALLS_AT_ONCE):
            marks = [
                await self.send("call_service", service=f"/rosapi/{service}", args=args)
                for service, args in questions[start : start + CALLS_AT_ONCE]
            ]
            found = await self._answers(marks, self.now() + self.patience)
            if len(found) < len(marks):
                raise BridgeError(self.silence)
            answers += [found[mark] for mark in marks]
        return answers

    @property
    def silence(self) -> str:
        """What to say when rosapi does not answer."""
        return f"{self._url}: no answer within {self.patience:g} s; is rosapi running there?"

    async def _answers(self, marks: Sequence[str], until: float | None) -> dict[str, ToolAnswer]:
        """The answers to these calls that come until then, by the ids of the calls."""
        found: dict[str, ToolAnswer] = {}
        while len(found) < len(marks):
            frame = await self._read(until)
            if frame is None:
                break
            if frame.get("op") == "service_response" and frame.get("id") in marks:
                found[frame["id"]] = answer_of(frame)
            else:
                self._inbox.append(frame)
        return found


_LAST_WORD = 0.5
"""How much longer than the server we wait for its own words about a time-out [s]."""


def _parse(data: str | bytes) -> Frame:
    """The JSON object of a frame; an empty one if it holds none."""
    value: object
    try:
        value = orjson.loads(data)
    except orjson.JSONDecodeError:
        try:
            value = json.loads(data)  # some servers write a bare NaN, which is no JSON
        except (ValueError, RecursionError):
            value = None
    return value if isinstance(value, dict) else {}


def answer_of(frame: Frame) -> ToolAnswer:
    """What a service_response says; where it does not say whether it went well, it did."""
    return ToolAnswer(frame.get("result", True) is not False, frame.get("values", {}))


def absolute(name: str) -> str:
    """The name with its leading slash: rosapi compares names as they are written."""
    return name if name.startswith("/") else f"/{name}"


def words(values: Frame, key: str) -> list[str]:
    """The list of names in an answer; empty where it has none."""
    value = values.get(key)
    return [str(one) for one in value] if isinstance(value, list) else []

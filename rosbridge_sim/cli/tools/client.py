"""The tools' connection: a rosbridge that is asked one thing at a time, with a deadline for every answer.

It is made for any rosbridge and not for ours alone: for one that never sends a status frame, that has no rosapi, that
cuts its long messages into fragments nobody asked for, or that says nothing at all. `rosbridge_sim.client` reads and
writes the frames. Frames that answer no call wait in the inbox until a tool takes them.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import ClassVar

from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.client.asynchronous import AsyncClient
from rosbridge_sim.client.frames import Frame, absolute
from rosbridge_sim.errors import ConnectError, ConnectionLostError
from rosbridge_sim.shell.terminal_text import safe
from rosbridge_sim.shell.websocket.bridge_errors import BridgeError, RefusedError
from rosbridge_sim.shell.websocket.urls import shown_url

__all__ = ["Bridge", "Frame", "ToolAnswer", "absolute", "answer_of", "open_bridge", "words"]

CALLS_AT_ONCE = 20
"""Calls that are under way together: the reference server takes a thread for each."""


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
    client = _ToolClient(url, token=token, timeout=patience, status_level=None)
    try:
        await client.open()
    except ConnectError as error:
        raise BridgeError(str(error)) from error
    try:
        yield Bridge(client, patience)
    except ConnectionLostError as error:
        raise RefusedError(str(error)) from None
    finally:
        await client.close()


class _ToolClient(AsyncClient):
    """A client that speaks of flags, to the user of a command."""

    url_name: ClassVar[str] = "--url"
    token_name: ClassVar[str] = "--token"  # noqa: S105 - a flag, and no secret

    def note(self, text: str) -> None:
        note(text)


# Frames


class Bridge:
    """A rosbridge at the other end.

    Attributes:
        patience: how long an answer may take [s].
    """

    def __init__(self, client: AsyncClient, patience: float) -> None:
        self.patience = patience
        self._client = client
        self._inbox = client.collect_others()

    def now(self) -> float:
        """The time that deadlines are measured in [s]."""
        return asyncio.get_running_loop().time()

    async def send(self, op: str, **fields: object) -> str:
        """Send an op; the id that it got."""
        return await self._client.send(op, **fields)

    async def receive(self, until: float | None = None) -> Frame | None:
        """The next frame; None if none comes until then."""
        return await self._inbox.next(until)

    def take_inbox(self) -> list[Frame]:
        """The frames that came while something else was waited for."""
        return self._inbox.take()

    # Calls

    async def call(self, service: str, args: object, patience: float | None) -> ToolAnswer | None:
        """What a service answers; None if it does not.

        Args:
            service: its name.
            args: the request, by name or by position.
            patience: how long it may take [s]; None is for ever. The server is told, and has a moment more, so that its
                own words win.
        """
        call = await self._client.begin_call(service, args, server_timeout=patience or 0.0)
        answers = await self._answers([call], None if patience is None else patience + _LAST_WORD)
        return answers[0] if answers else None

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
            calls = [
                await self._client.begin_call(f"/rosapi/{service}", args)
                for service, args in questions[start : start + CALLS_AT_ONCE]
            ]
            found = await self._answers(calls, self.patience)
            if len(found) < len(calls):
                raise BridgeError(self.silence)
            answers += found
        return answers

    @property
    def silence(self) -> str:
        """What to say when rosapi does not answer."""
        return f"{shown_url(self._client.url)}: no answer within {self.patience:g} s; is rosapi running there?"

    async def _answers(self, calls: Sequence[asyncio.Future[Frame]], patience: float | None) -> list[ToolAnswer]:
        """Return the answers to these calls that come in time, in the order of the calls; cancel the others."""
        try:
            await asyncio.wait(calls, timeout=patience)
            return [answer_of(call.result()) for call in calls if call.done()]
        finally:
            for call in calls:
                call.cancel()


_LAST_WORD = 0.5
"""How much longer than the server we wait for its own words about a time-out [s]."""


def answer_of(frame: Frame) -> ToolAnswer:
    """What a service_response says; where it does not say whether it went well, it did."""
    return ToolAnswer(frame.get("result", True) is not False, frame.get("values", {}))


def words(values: Frame, key: str) -> list[str]:
    """The list of names in an answer; empty where it has none."""
    value = values.get(key)
    return [str(one) for one in value] if isinstance(value, list) else []

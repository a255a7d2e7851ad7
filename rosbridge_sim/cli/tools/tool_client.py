"""The connection of the tools to a rosbridge: one request at a time, with a time limit for every answer.

It works with any rosbridge: also with one that never sends a status frame, that has no rosapi, that cuts long messages
into fragments without a request, or that sends nothing at all. `rosbridge_sim.client` reads and writes the frames.
Frames that answer no call wait in the inbox until a tool takes them.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.client.asynchronous import AsyncClient
from rosbridge_sim.client.frames import Frame, absolute
from rosbridge_sim.errors import ConnectError, ConnectionLostError
from rosbridge_sim.link.bridge_errors import BridgeError, RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.link.urls import shown_url

__all__ = ["Bridge", "Connect", "Frame", "ToolAnswer", "absolute", "answer_of", "frames_in", "open_bridge", "words"]

CALLS_AT_ONCE = 20
"""Calls that run at the same time: rosbridge_suite uses a thread for each."""


@dataclass(frozen=True, slots=True)
class ToolAnswer:
    """The answer of a service.

    Attributes:
        is_ok: the service did what was requested.
        values: the response, or the text of the refusal.
    """

    is_ok: bool
    values: object

    @property
    def fields(self) -> Frame:
        """Fields of the response; none after a refusal, or if a stranger sends something else."""
        return self.values if self.is_ok and isinstance(self.values, dict) else {}

    def word(self, key: str) -> str:
        """Return a field that is a word; empty if there is none."""
        return str(self.fields.get(key) or "")

    def demand(self, source: str, doubt: str) -> Frame:
        """Return the fields; a refusal is an error with a source, and with a doubt if there is no such service."""
        if not self.is_ok or not isinstance(self.values, dict):
            text = safe(str(self.values))
            raise RefusedError(f"{source}{text}{doubt if 'not exist' in text else ''}")
        return self.values


# The connection


@asynccontextmanager
async def open_bridge(url: str, token: str | None, patience: float) -> AsyncIterator[Bridge]:
    """Open a connection that is closed at the end.

    Args:
        url: `ws://HOST:PORT`; `HOST` and `HOST:PORT` are accepted, too.
        token: token of the server; None sends none.
        patience: longest wait for an answer [s].

    Yields:
        The rosbridge.

    Raises:
        BridgeError: the connection cannot be made.
        RefusedError: the server has closed it.
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
    """A client whose errors name flags, for users of the command line."""

    url_name: ClassVar[str] = "--url"
    token_name: ClassVar[str] = "--token"  # noqa: S105 - a flag, and no secret

    def note(self, text: str) -> None:
        note(text)


# Frames


class Bridge:
    """A rosbridge at the other end of a connection.

    Attributes:
        patience: longest wait for an answer [s].
    """

    def __init__(self, client: AsyncClient, patience: float) -> None:
        self.patience = patience
        self._client = client
        self._inbox = client.collect_others()

    def now(self) -> float:
        """Return the time of the event loop, used for time limits [s]."""
        return asyncio.get_running_loop().time()

    async def send(self, op: str, **fields: object) -> str:
        """Send an op."""
        return await self._client.send(op, **fields)

    async def receive(self, until: float | None = None) -> Frame | None:
        """Return the next frame; None if none comes in time.

        Args:
            until: time of the event loop [s]; None means no limit.
        """
        return await self._inbox.next(until)

    def take_inbox(self) -> list[Frame]:
        """Return the frames that came during other waits."""
        return self._inbox.take()

    # Calls

    async def call(self, service: str, args: object, patience: float | None) -> ToolAnswer | None:
        """Return the answer of a service; None if none comes in time.

        Args:
            args: the request, by name or by position.
            patience: longest wait [s]; None means no limit. The server gets the same time-out, and this side waits a
                moment longer, so that the server's own error text arrives.
        """
        call = await self._client.begin_call(service, args, server_timeout=patience or 0.0)
        answers = await self._answers([call], None if patience is None else patience + _LAST_WORD)
        return answers[0] if answers else None

    async def request(self, service: str, args: Mapping[str, object]) -> Frame:
        """Return the values of a simulator's service.

        Raises:
            RefusedError: it refuses, or does not exist.
            BridgeError: there is no answer.
        """
        answer = await self.call(service, args, self.patience)
        if answer is None:
            raise BridgeError(f"{service}: no answer within {self.patience:g} s; --timeout waits longer")
        return answer.demand("", "; does the rosbridge have a simulator?")

    async def ask(self, service: str, /, **args: object) -> Frame:
        """Return the values of a rosapi service.

        Raises:
            RefusedError: it refuses, or does not exist.
            BridgeError: there is no answer.
        """
        (answer,) = await self.ask_all([(service, args)])
        return answer.demand(f"/rosapi/{service} says: ", "; is rosapi running there?")

    async def ask_all(self, questions: Sequence[tuple[str, Mapping[str, object]]]) -> list[ToolAnswer]:
        """Return the answers of rosapi services, in order of the requests.

        Args:
            questions: name and request of each service.

        Raises:
            BridgeError: an answer is missing.
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
        """Error text for the case that rosapi does not answer."""
        return f"{shown_url(self._client.url)}: no answer within {self.patience:g} s; is rosapi running there?"

    async def _answers(self, calls: Sequence[asyncio.Future[Frame]], patience: float | None) -> list[ToolAnswer]:
        """Return the answers to these calls that come in time, in order of the calls; cancel the others."""
        try:
            await asyncio.wait(calls, timeout=patience)
            return [answer_of(call.result()) for call in calls if call.done()]
        finally:
            for call in calls:
                call.cancel()


Connect: TypeAlias = Callable[[str], AbstractAsyncContextManager[Bridge]]
"""Opens a connection to a URL, as `open_bridge` does."""

_LAST_WORD = 0.5
"""Extra time after the server's time-out to receive its error text [s]."""


def answer_of(frame: Frame) -> ToolAnswer:
    """Return the content of a service_response; a missing `result` counts as success."""
    return ToolAnswer(frame.get("result", True) is not False, frame.get("values", {}))


def words(values: Frame, key: str) -> list[str]:
    """Return the list of names in an answer; empty if there is none."""
    value = values.get(key)
    return [str(one) for one in value] if isinstance(value, list) else []


def frames_in(values: Frame, key: str) -> list[Frame]:
    """Return the list of objects in an answer or a message; a stranger's may hold anything."""
    value = values.get(key)
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []

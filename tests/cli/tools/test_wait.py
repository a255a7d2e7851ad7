"""`wait` returns when a server accepts clients, and otherwise says why it does not."""

from __future__ import annotations

import asyncio

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.cli.tools import wait
from tests.cli.tool_fixture import in_the_background, raw_server
from tests.support import PATIENCE


async def test_wait_ends_at_once_if_the_server_is_ready() -> None:
    async with Simulator(port=0, world=False) as sim:
        done = await in_the_background("wait", "--timeout", "1000", url=sim.url)
    assert (done.code, done.out, done.err) == (0, "", "")


async def test_wait_ends_when_the_server_becomes_ready(kept_port: int) -> None:
    url = f"ws://127.0.0.1:{kept_port}"
    waiting = asyncio.create_task(in_the_background("wait", "--timeout", str(PATIENCE), url=url))
    async with Simulator(port=kept_port, world=False):
        assert (await waiting).code == 0


async def test_wait_without_a_server_gives_exit_code_1_and_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ATTEMPT", "PAUSE"):  # there is one attempt, which gets the time that it needs
        monkeypatch.setattr(wait, name, PATIENCE)
    done = await in_the_background("wait", "--timeout", "0.05", url="ws://127.0.0.1:1")
    why = "ws://127.0.0.1:1: nothing listens there; is the server running?"
    assert (done.code, done.complaint) == (1, f"not ready within 0.05 s: {why}")


async def test_silent_port_does_not_extend_the_wait() -> None:
    async def be_silent(_reader: asyncio.StreamReader, _writer: asyncio.StreamWriter) -> None:
        await asyncio.Event().wait()

    async with raw_server(be_silent) as url:
        done = await in_the_background("wait", "--timeout", "0.05", url=url)
    assert (done.code, done.complaint.partition(": ")[0]) == (1, "not ready within 0.05 s")


async def test_wrong_token_ends_the_wait_at_once() -> None:
    async with Simulator(port=0, world=False, token="right") as sim:  # noqa: S106 - of this test
        done = await in_the_background("wait", "--token", "wrong", "--timeout", "1000", url=sim.url)
    assert (done.code, "it needs a token" in done.complaint) == (1, True)


@pytest.mark.parametrize(("words", "text"), [((), "--url: expected a URL"), (("--token", "a b"), "--token: expected")])
async def test_usage_error_gives_exit_code_2_at_once(words: tuple[str, ...], text: str) -> None:
    url = "ftp://x" if not words else "ws://127.0.0.1:1"
    done = await in_the_background("wait", "--timeout", "1000", *words, url=url)
    assert done.code == 2
    assert done.complaint.startswith(text)

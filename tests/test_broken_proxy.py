"""The broken proxy causes exactly the planned faults."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio

from tests.broken_proxy import BrokenProxy, Fate, Way, draw_fates
from tests.support import PATIENCE


@pytest_asyncio.fixture
async def echo() -> AsyncIterator[int]:
    """The port of a server that says what it hears."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while data := await reader.read(1 << 16):
                writer.write(data)
                await writer.drain()
        except OSError:
            pass
        finally:
            writer.close()

    async with await asyncio.start_server(answer, "127.0.0.1", 0) as server:
        yield server.sockets[0].getsockname()[1]


async def talk(proxy: BrokenProxy, data: bytes) -> bytes:
    """What comes back of some bytes, until all is there or the connection is reset."""
    reader, writer = await asyncio.open_connection("127.0.0.1", proxy.port)
    got = b""
    try:
        writer.write(data)
        async with asyncio.timeout(PATIENCE):
            while len(got) < len(data):
                piece = await reader.read(1 << 16)
                if not piece:
                    break
                got += piece
    except OSError:
        pass
    finally:
        writer.transport.abort()
    return got


async def test_split_and_delayed_bytes_all_arrive(echo: int) -> None:
    data = bytes(range(256)) * 2
    async with BrokenProxy(echo, [Fate(piece=7), Fate(piece=1), Fate(piece=100, pause=0.001)]) as proxy:
        for _ in range(4):
            assert await talk(proxy, data) == data
        assert proxy.is_used_up
        assert proxy.num_ended == 0


@pytest.mark.parametrize("at", [0, 1, 100, 150])
async def test_reset_happens_after_the_planned_bytes(echo: int, at: int) -> None:
    async with BrokenProxy(echo, [Fate(reset_at=at)]) as proxy:
        assert len(await talk(proxy, bytes(100))) <= max(0, at - 100)
        await proxy.until(lambda: proxy.num_ended == 1)
        assert await talk(proxy, b"well") == b"well", "a good line after the plan"


@pytest.mark.parametrize("at", [0, 1, 100])
async def test_half_close_ends_one_direction_after_earlier_answers(echo: int, at: int) -> None:
    async with BrokenProxy(echo, [Fate(finish_at=at)]) as proxy:
        assert await talk(proxy, bytes(200)) == bytes(at)
        assert proxy.num_ended == 1
        assert await talk(proxy, b"well") == b"well", "the next connection has nothing to do with it"


@pytest.mark.parametrize("way", ["up", "down"])
async def test_stall_stops_one_direction_and_stays_connected(echo: int, way: Way) -> None:
    async with BrokenProxy(echo, [Fate(stall_at=0, stalled=way)]) as proxy:
        reader, writer = await asyncio.open_connection("127.0.0.1", proxy.port)
        writer.write(b"anybody?")
        await proxy.until(lambda: proxy.num_ended == 1)
        answer = asyncio.ensure_future(reader.read(1))
        assert await talk(proxy, b"well") == b"well", "the next connection has nothing to do with it"
        assert not answer.done()
        writer.transport.abort()
        assert await asyncio.wait_for(answer, PATIENCE) == b""


async def test_missing_server_behind_the_proxy_is_a_reset() -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))  # it does not listen, so connections are refused, and nobody else gets its port
        async with BrokenProxy(silent.getsockname()[1]) as proxy:
            assert await talk(proxy, b"anybody?") == b""


def test_same_seed_gives_the_same_faults() -> None:
    assert draw_fates(1, 9, 1000) == draw_fates(1, 9, 1000)
    assert draw_fates(1, 9, 1000) != draw_fates(2, 9, 1000)
    assert sum(fate.stall_at is not None for fate in draw_fates(1, 9, 1000)) == 3

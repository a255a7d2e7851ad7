"""A dialled connection delivers messages complete, in order and at once, and reports why it ended."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, ConnectionClosedError, InvalidHandshake, InvalidStatus, InvalidURI
from websockets.frames import Close, CloseCode
from websockets.http11 import Response

from rosbridge_sim.link import websocket_internals
from rosbridge_sim.link.client_connection import DialedConnection, why_gone, why_not
from rosbridge_sim.protocol.outbox import BinaryFrame
from tests.support import PATIENCE

Handler = Callable[[ServerConnection], Awaitable[None]]


@asynccontextmanager
async def dialled(
    handler: Handler, max_size: int = 10_000, close_timeout: float = 1.0
) -> AsyncIterator[DialedConnection]:
    """A socket to a server that does as the handler says."""
    async with serve(handler, "127.0.0.1", 0, compression=None) as server:
        url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        socket = await connect(
            url,
            create_connection=DialedConnection,
            compression=None,
            max_size=max_size,
            close_timeout=close_timeout,
            proxy=None,
        )
        assert isinstance(socket, DialedConnection)
        yield socket
        await socket.close()


class ReceivedMessages:
    """Messages that came, and a way to wait for so many of them."""

    def __init__(self) -> None:
        self.messages: list[bytes] = []
        self._has_changed = asyncio.Event()

    def __call__(self, message: bytes) -> None:
        self.messages.append(message)
        self._has_changed.set()

    async def count(self, num: int) -> list[bytes]:
        async with asyncio.timeout(PATIENCE):
            while len(self.messages) < num:
                self._has_changed.clear()
                await self._has_changed.wait()
        return self.messages


async def test_messages_arrive_complete_and_in_order_for_any_framing() -> None:
    async def say(connection: ServerConnection) -> None:
        await connection.send("one")
        await connection.send(b"\x02\x03")

        def parts() -> Iterator[str]:
            yield from ("th", "re", "e")

        await connection.send(parts())
        await connection.ping()
        await connection.send("four")
        await connection.wait_closed()

    async with dialled(say) as socket:
        heard = ReceivedMessages()
        socket.listen(heard)
        assert await heard.count(4) == [b"one", b"\x02\x03", b"three", b"four"]


async def test_messages_before_the_first_receiver_are_kept() -> None:
    async def say(connection: ServerConnection) -> None:
        await connection.send("early")
        await (await connection.ping())
        await connection.send("late")
        await connection.wait_closed()

    async with dialled(say) as socket:
        await (await socket.ping())  # by then the first has come
        heard = ReceivedMessages()
        socket.listen(heard)
        assert await heard.count(2) == [b"early", b"late"]


async def test_messages_are_sent_in_order_as_text_and_binary() -> None:
    got: asyncio.Queue[str | bytes] = asyncio.Queue()

    async def listen(connection: ServerConnection) -> None:
        async for message in connection:
            got.put_nowait(message)

    sizes = (0, 1, 125, 126, 127, 2**16 - 1, 2**16, 100_000)
    messages: list[str | bytes] = ["é", *("x" * size for size in sizes), *(b"\xff" * size for size in sizes)]
    async with dialled(listen) as socket:
        assert socket.has_room
        socket.send_messages([m.encode() if isinstance(m, str) else BinaryFrame(m) for m in messages])
        for message in messages:
            assert await asyncio.wait_for(got.get(), PATIENCE) == message
    assert not socket.has_room


@pytest.mark.parametrize(
    ("last", "said"),
    [
        (b"\x88\x02\x03\xe8", "the server has closed the connection (1000)"),
        (b"\x83\x00", "the connection was given up: invalid opcode"),
        (b"\x01\x01a" + b"\x00\x7e\x0f\xff" + bytes(4_095), "the connection was given up: frame"),
    ],
)
async def test_server_that_stops_responding_is_disconnected(last: bytes, said: str) -> None:
    is_left = asyncio.Event()

    async def hang(connection: ServerConnection) -> None:
        connection.transport.pause_reading()
        connection.transport.write(last)
        await is_left.wait()
        connection.transport.abort()

    async with dialled(hang, max_size=4_000, close_timeout=0.1) as socket:
        async with asyncio.timeout(PATIENCE):
            await socket.wait_closed()
        is_left.set()
        assert isinstance(socket.end, ConnectionClosed)
        assert said in why_gone("ws://h", socket.protocol.close_exc)


@pytest.mark.slow
async def test_pongs_to_a_server_that_does_not_read_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(websocket_internals, "MAX_UNREAD", 2**20)

    async def ping(connection: ServerConnection) -> None:
        connection.transport.pause_reading()
        while not connection.transport.is_closing():
            connection.transport.write((b"\x89\x7d" + bytes(125)) * 1_000)
            await asyncio.sleep(0)

    async with dialled(ping) as socket, asyncio.timeout(PATIENCE):
        await socket.wait_closed()


async def test_free_room_is_reported_when_the_server_reads_again() -> None:
    may_read = asyncio.Event()

    async def listen(connection: ServerConnection) -> None:
        connection.transport.pause_reading()
        await may_read.wait()
        connection.transport.resume_reading()
        async for _ in connection:
            pass

    async with dialled(listen) as socket:
        has_room = asyncio.Event()
        socket.on_room = has_room.set
        async with asyncio.timeout(PATIENCE):
            while socket.has_room:
                socket.send_messages([b"x" * 2**20])
            may_read.set()
            await has_room.wait()


@pytest.mark.parametrize(
    ("end", "said"),
    [
        ("bye", "the server has closed the connection (1001): bye"),
        ("reset", "the connection was lost"),
        ("long", "the connection was given up: "),
    ],
)
async def test_connection_reports_why_it_ended(end: str, said: str) -> None:
    async def leave(connection: ServerConnection) -> None:
        if end == "reset":
            connection.transport.abort()
        elif end == "bye":
            await connection.close(CloseCode.GOING_AWAY, "bye")
        else:
            await connection.send("x" * 20_000)
            await connection.wait_closed()

    async with dialled(leave) as socket:
        await socket.wait_closed()
        closed = socket.protocol.close_exc
        assert isinstance(closed, ConnectionClosed)
        assert why_gone("ws://far:1/?token=x", closed).startswith(f"ws://far:1: {said}")


SECRET_URL = "ws://me:pass%20word@far:1/?token=s3same/%2B"  # noqa: S105 - a test's own


@pytest.mark.parametrize(
    "error",
    [
        InvalidStatus(
            Response(404, "No /?token=s3same/%2B", Headers(), b"There is no /?token=s3same/%2B for pass word")
        ),
        InvalidStatus(Response(401, "Unauthorized", Headers(), b"not s3same/+, not Bearer b3arer")),
        InvalidURI(SECRET_URL, "no"),
        InvalidHandshake(f"strange: {SECRET_URL}"),
    ],
)
def test_connect_error_shows_no_secret(error: Exception) -> None:
    said = why_not(SECRET_URL, error, 1.0, flag="--url", token="--token", secrets=("b3arer",))  # noqa: S106 - a flag
    assert said.startswith(("ws://far:1: ", "--url: "))
    assert not [secret for secret in ("s3same", "pass", "b3arer") if secret in said]


def test_close_reason_shows_no_secret() -> None:
    closed = ConnectionClosedError(Close(1008, "bad token s3same/+ or b3arer"), None)
    said = why_gone(SECRET_URL, closed, secrets=("b3arer",))
    assert said == "ws://far:1: the server has closed the connection (1008): bad token ... or ..."

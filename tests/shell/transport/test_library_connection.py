"""The connection by the library's own reader behaves like the direct one, except for documented differences.

`ROSBRIDGE_SIM_WEBSOCKET_IO=library ./scripts/test tests/end_to_end` runs other tests so, whose servers are processes.
"""

from __future__ import annotations

import asyncio
import json
import logging
from contextlib import suppress
from math import inf
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode

from rosbridge_sim.link import websocket_internals
from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.transport import library_connection
from rosbridge_sim.shell.transport.library_connection import LibraryConnection
from rosbridge_sim.shell.transport.receiving_connection import ReceivingConnection
from rosbridge_sim.shell.transport.server_connection import DirectConnection
from tests.shell.transport.test_server_connection import (
    CONVERSATIONS,
    INVALID_DATA,
    MAX_SIZE,
    REQUEST,
    SIZES,
    TEXTS,
    PausingReceiver,
    converse,
    frame,
)
from tests.support import PATIENCE, Client, mask, open_raw

TOKEN = "s3same"  # noqa: S105 - a test's own
AUTH = json.dumps({"op": "auth", "token": TOKEN})
CLOSE = frame(Opcode.CLOSE, b"\x03\xe8")


class NotifyingReceiver(PausingReceiver):
    """A `PausingReceiver` that tells when it has heard something."""

    def __init__(self, socket: LibraryConnection, heard: list[bytes], num_a_turn: int) -> None:
        super().__init__(socket, heard, num_a_turn)
        self.kinds: list[bool] = []
        self._socket = socket

    def receive(self, message: bytes) -> bool:
        self.kinds.append(self._socket.is_text)
        return super().receive(message)


async def talk(data: bytes, num_a_turn: int, *, hangs_up: bool) -> tuple[list[bytes], bytes]:
    """What such a server heard, and what it said; the client ends its side at once, or once the server has."""
    heard: list[bytes] = []
    mishaps: list[dict[str, Any]] = []
    is_over = asyncio.Event()
    asyncio.get_running_loop().set_exception_handler(lambda _, context: mishaps.append(context))

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, LibraryConnection)
        ear = NotifyingReceiver(socket, heard, num_a_turn)
        socket.listen(ear)
        await socket.wait_closed()
        is_over.set()

    async with serve(
        handler,
        "127.0.0.1",
        0,
        create_connection=LibraryConnection,
        max_size=MAX_SIZE,
        compression=None,
        close_timeout=1.0,
        logger=logging.getLogger("quiet"),
    ) as server:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.sockets[0].getsockname()[1])
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        writer.write(data)
        if hangs_up:
            writer.write_eof()
        said = await reader.read()
        writer.close()
        async with asyncio.timeout(PATIENCE):
            await is_over.wait()
    assert not mishaps
    return heard, said


@pytest.mark.parametrize("num_a_turn", [1, 64])
@pytest.mark.parametrize("name", [*CONVERSATIONS, *TEXTS])
async def test_received_and_sent_bytes_equal_those_of_the_library(name: str, num_a_turn: int) -> None:
    data = {**CONVERSATIONS, **TEXTS}[name]
    expected, expected_said = await converse([data], is_direct=False)
    heard, said = await talk(data, num_a_turn, hangs_up=INVALID_DATA not in expected_said)
    assert said == expected_said
    assert heard == expected


async def test_text_and_binary_messages_are_distinguished() -> None:
    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, LibraryConnection)
        ear = NotifyingReceiver(socket, [], 1)
        socket.listen(ear)
        await socket.wait_closed()
        kinds.set_result(ear.kinds)

    kinds: asyncio.Future[list[bool]] = asyncio.get_running_loop().create_future()
    async with serve(handler, "127.0.0.1", 0, create_connection=LibraryConnection, compression=None) as server:
        async with connect(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}", proxy=None) as client:
            for message in ("a", b"b", "c"):
                await client.send(message)
        async with asyncio.timeout(PATIENCE):
            assert await kinds == [True, False, True]


@pytest.mark.parametrize("compression", [None, "deflate"])
async def test_sent_messages_arrive_complete_as_text_and_binary(compression: Any) -> None:  # noqa: ANN401 - a literal of the library's
    sent = [b"x" * n for n in SIZES] + [BinaryFrame(b"y" * n) for n in SIZES]

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, LibraryConnection)
        socket.listen(PausingReceiver(socket, [], 1))
        assert socket.send_messages(sent) > 0
        while socket.unsent:
            socket.send_more()
        await socket.close()

    async with serve(handler, "127.0.0.1", 0, create_connection=LibraryConnection, compression=compression) as server:
        url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        async with connect(url, compression=compression, max_size=None, proxy=None) as client:
            heard = [message async for message in client]
    assert heard == [bytes(one) if isinstance(one, BinaryFrame) else one.decode() for one in sent]


async def test_receiver_that_raises_ends_its_connection_and_is_logged() -> None:
    class Broken(PausingReceiver):
        def receive(self, message: bytes) -> bool:
            raise LookupError(message)

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, LibraryConnection)
        socket.listen(Broken(socket, [], 1))
        with pytest.raises(LookupError):
            await socket.wait_closed()
        told.set_result(None)

    told: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    async with serve(handler, "127.0.0.1", 0, create_connection=LibraryConnection, compression=None) as server:
        async with connect(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}", proxy=None) as client:
            await client.send("a")
            with pytest.raises(ConnectionClosed):
                await client.recv()
        async with asyncio.timeout(PATIENCE):
            await told


async def test_unreleased_message_does_not_keep_a_lost_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library_connection, "LAST_TURNS", 0.01)
    heard: list[bytes] = []

    class Stuck(PausingReceiver):
        def wait(self, *, had_turn: bool) -> None:
            del had_turn

        def begin(self) -> float:
            return -inf

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, LibraryConnection)
        socket.listen(Stuck(socket, heard, 1))
        await socket.wait_closed()
        over.set_result(socket.num_bytes_held)

    over: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    async with serve(handler, "127.0.0.1", 0, create_connection=LibraryConnection, compression=None) as server:
        async with connect(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}", proxy=None) as client:
            await client.send("abc")
        async with asyncio.timeout(PATIENCE):
            assert await over == 3
    assert heard == []


# The whole server


async def test_clients_publish_subscribe_and_call() -> None:
    async with (
        Simulator(port=0, world=False, websocket_io="library") as sim,
        await Client.open(sim.url) as first,
        await Client.open(sim.url) as second,
    ):
        await second.send("subscribe", topic="/t", type="std_msgs/String")
        await second.settle()
        for text in ("a", "가" * 50_000, "c"):
            await first.send("publish", topic="/t", type="std_msgs/String", msg={"data": text})
            assert (await second.message("/t"))["data"] == text
        assert not sim.num_bugs


async def test_messages_right_before_a_clean_close_are_handled() -> None:
    async with Simulator(port=0, world=False, websocket_io="library") as sim, await Client.open(sim.url) as other:
        await other.send("subscribe", topic="/t", type="std_msgs/String")
        await other.settle()
        reader, writer = await open_raw(int(sim.url.rsplit(":", 1)[1]))
        publish = {"op": "publish", "topic": "/t", "type": "std_msgs/String"}
        frames = [mask(json.dumps({**publish, "msg": {"data": str(i)}})) for i in range(300)]
        writer.write(b"".join(frames) + CLOSE)
        for i in range(300):
            assert (await other.message("/t"))["data"] == str(i)
        await reader.read()
        writer.close()


async def test_token_in_the_first_message_is_accepted_and_a_wrong_one_refused() -> None:
    async with Simulator(port=0, world=False, websocket_io="library", token=TOKEN) as sim:
        async with await Client.open(sim.url) as client:
            await client.send("auth", token=TOKEN)
            await client.send("subscribe", topic="/t", type="std_msgs/String")
            await client.settle()
            await client.send("publish", topic="/t", type="std_msgs/String", msg={"data": "x" * 100_000})
            assert len((await client.message("/t"))["data"]) == 100_000
        async with await Client.open(sim.url) as stranger:
            await stranger.send("subscribe", topic="/t")
            assert (await stranger.read())["op"] == "status"
            await stranger.send_raw(
                AUTH + json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "behind"})
            )
            while (await stranger.read()).get("id") != "behind":
                pass


async def test_rubbish_glued_behind_a_binary_token_is_refused() -> None:
    async with Simulator(port=0, world=False, websocket_io="library", token=TOKEN) as sim:
        async with await Client.open(sim.url) as client:
            await client.send_raw(AUTH.encode() + b"\xff\xfe")
            await client.send("call_service", service="/rosapi/get_time", id="behind")
            while (await client.read()).get("id") != "behind":
                pass
        assert not sim.num_bugs


@pytest.mark.slow  # a second for the closing
async def test_pings_of_an_unauthenticated_client_count() -> None:
    async with Simulator(port=0, world=False, websocket_io="library", token=TOKEN) as sim:
        reader, writer = await open_raw(int(sim.url.rsplit(":", 1)[1]))
        ping = frame(Opcode.PING, b"x" * 100)
        with suppress(ConnectionError):
            for _ in range(40):
                writer.write(ping * 100)
                await writer.drain()
        async with asyncio.timeout(PATIENCE):
            assert b"too many bytes without a token" in await reader.read()
        writer.close()


async def test_client_that_pings_and_does_not_read_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(websocket_internals, "MAX_UNREAD", 2**16)

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, LibraryConnection)
        socket.listen(PausingReceiver(socket, [], 64))
        await socket.wait_closed()

    async with serve(handler, "127.0.0.1", 0, create_connection=LibraryConnection, compression=None) as server:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.sockets[0].getsockname()[1], limit=2**10)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        async with asyncio.timeout(PATIENCE):
            with pytest.raises(ConnectionError):  # noqa: PT012 - which of the writes finds out is the kernel's business
                while True:
                    writer.write(Frame(Opcode.PING, b"x" * 125).serialize(mask=True) * 100)
                    await writer.drain()
        writer.close()


async def test_compressing_client_is_served() -> None:
    async with (
        Simulator(port=0, world=False, websocket_io="library", compression=True) as sim,
        connect(sim.url, compression="deflate", max_size=None, proxy=None) as socket,
    ):
        await socket.send(json.dumps({"op": "subscribe", "topic": "/t", "type": "std_msgs/String"}))
        for text in ("a", "x" * 1_000_000, "b"):
            await socket.send(json.dumps({"op": "publish", "topic": "/t", "msg": {"data": text}}))
            assert json.loads(await socket.recv())["msg"] == {"data": text}


async def test_oversized_message_closes_with_1009() -> None:
    async with (
        Simulator(port=0, world=False, websocket_io="library", max_frame_size=4096) as sim,
        await Client.open(sim.url) as client,
    ):
        await client.send_raw("x" * 4097)
        with pytest.raises(ConnectionClosed):
            await client.read()
        assert client.socket.close_code == 1009


async def test_server_with_clients_can_stop() -> None:
    async with Simulator(port=0, world=False, websocket_io="library") as sim:
        clients = [await Client.open(sim.url) for _ in range(3)]
        for client in clients:
            await client.settle()
    for client in clients:
        with pytest.raises(ConnectionClosed):
            await client.read()
        assert client.socket.close_code == 1001


def test_neither_kind_of_connection_is_the_other() -> None:
    for kind, other in [(LibraryConnection, DirectConnection), (DirectConnection, LibraryConnection)]:
        assert issubclass(kind, ReceivingConnection)
        assert not issubclass(kind, other)

"""The direct connection reads what the library reads, for any split of the bytes."""

from __future__ import annotations

import asyncio
import logging
import random
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from itertools import pairwise
from math import inf
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.frames import Frame, Opcode

from rosbridge_sim.link import websocket_internals
from rosbridge_sim.long_text import LongText, find_long_text
from rosbridge_sim.protocol.outbox import BinaryFrame
from rosbridge_sim.shell.transport import server_connection
from rosbridge_sim.shell.transport.server_connection import COMPRESSED_AT_ONCE, MAX_HELD, DirectConnection, Receiver
from tests.mutations import examples
from tests.support import PATIENCE

MAX_SIZE = 70_000
REQUEST = (
    b"GET / HTTP/1.1\r\nHost: here\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


def frame(opcode: Opcode, data: bytes, *, fin: bool = True) -> bytes:
    return Frame(opcode, data, fin).serialize(mask=True)


class PausingReceiver:
    """Takes messages of one connection, a few in each turn, and now and then wants a pause behind one."""

    def __init__(self, socket: DirectConnection, heard: list[bytes], num_a_turn: int) -> None:
        self._socket = socket
        self._heard = heard
        self._num_a_turn = num_a_turn

    def begin(self) -> float:
        return inf

    def receive(self, message: bytes) -> bool:
        self._heard.append(message)
        return len(self._heard) % self._num_a_turn != 0

    def wait(self, *, had_turn: bool) -> None:
        assert isinstance(had_turn, bool)
        self._socket.loop.call_soon(self._go_on)

    def _go_on(self) -> None:
        if self._socket.go_on(inf):
            self._socket.loop.call_soon(self._go_on)


@asynccontextmanager
async def listening(
    heard: list[bytes],
    *,
    is_direct: bool = True,
    num_a_turn: int = 64,
    close_timeout: float = 1.0,
    kind: type[DirectConnection] = DirectConnection,
) -> AsyncIterator[int]:
    """A server whose connections add what they hear; its port."""

    async def handler(connection: ServerConnection) -> None:
        if isinstance(connection, DirectConnection):
            connection.listen(PausingReceiver(connection, heard, num_a_turn))
            await connection.wait_closed()
        else:
            while True:
                message = await connection.recv()
                heard.append(message.encode() if isinstance(message, str) else message)

    server = await serve(
        handler,
        "127.0.0.1",
        0,
        create_connection=kind if is_direct else ServerConnection,
        max_size=MAX_SIZE,
        compression=None,
        close_timeout=close_timeout,
        logger=logging.getLogger("quiet"),
    )
    async with server:
        yield next(iter(server.sockets)).getsockname()[1]


async def converse(pieces: list[bytes], *, is_direct: bool, num_a_turn: int = 64) -> tuple[list[bytes], bytes]:
    """What the server heard, and what it said, when those pieces arrive one by one."""
    heard: list[bytes] = []
    mishaps: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: mishaps.append(context))
    async with listening(heard, is_direct=is_direct, num_a_turn=num_a_turn) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        for piece in pieces:
            writer.write(piece)
            await writer.drain()
            await asyncio.sleep(0)
        writer.write_eof()
        said = await reader.read()
        writer.close()
    assert not mishaps
    return heard, said


SIZES = (0, 1, 125, 126, 65_535, 65_536, MAX_SIZE)

CONVERSATIONS = {
    "sizes": b"".join(frame(Opcode.TEXT, bytes([65 + i]) * n) for i, n in enumerate(SIZES)),
    "binary": frame(Opcode.BINARY, b"\xff\x00") + frame(Opcode.TEXT, b"x"),
    "many": b"".join(frame(Opcode.TEXT, b"%d" % i) for i in range(500)),
    "fragments with a ping between": frame(Opcode.TEXT, b"a", fin=False)
    + frame(Opcode.PING, b"?")
    + frame(Opcode.CONT, b"b", fin=False)
    + frame(Opcode.CONT, b"c")
    + frame(Opcode.TEXT, b"d"),
    "a message inside a fragmented one": frame(Opcode.TEXT, b"a", fin=False) + frame(Opcode.TEXT, b"b"),
    "a continuation of nothing": frame(Opcode.TEXT, b"a") + frame(Opcode.CONT, b"b") + frame(Opcode.TEXT, b"c"),
    "ping and pong": frame(Opcode.PING, b"1") + frame(Opcode.PONG, b"2") + frame(Opcode.TEXT, b"a"),
    "close": frame(Opcode.TEXT, b"a") + frame(Opcode.CLOSE, b"\x03\xe8") + frame(Opcode.TEXT, b"b"),
    "too long": frame(Opcode.TEXT, b"a") + frame(Opcode.TEXT, b"b" * (MAX_SIZE + 1)),
    "too long in fragments": frame(Opcode.TEXT, b"b" * MAX_SIZE, fin=False) + frame(Opcode.CONT, b"b"),
    "not masked": frame(Opcode.TEXT, b"a") + b"\x81\x01b" + frame(Opcode.TEXT, b"c"),
    "unknown opcode": frame(Opcode.TEXT, b"a") + b"\x83\x80\0\0\0\0" + frame(Opcode.TEXT, b"c"),
    "a bit of an extension": frame(Opcode.TEXT, b"a") + b"\xc1\x80\0\0\0\0" + frame(Opcode.TEXT, b"c"),
    "ends in the middle after a long run": frame(Opcode.TEXT, b"a") * 500 + frame(Opcode.TEXT, b"b")[:-1],
    "ends in the middle": frame(Opcode.TEXT, b"a") + frame(Opcode.TEXT, b"b")[:-1],
    "a long ping": frame(Opcode.TEXT, b"a") + b"\x89\xfe\x00\x80\0\0\0\0" + bytes(128),
}


A, BAD, KO = b"a", b"\xff", "가".encode()
LONG_TEXT = KO * (MAX_SIZE // 3 - 1)  # longer than is checked in one go
IMAGE = b'{"frame_id":"eye","data":"' + b"iVBO" * (MAX_SIZE // 8) + b'"}'

TEXTS = {
    "beyond ASCII": frame(Opcode.TEXT, KO) + frame(Opcode.TEXT, "\U0001f697".encode()) + frame(Opcode.TEXT, A),
    "no UTF-8": frame(Opcode.TEXT, A) + frame(Opcode.TEXT, BAD) + frame(Opcode.TEXT, A),
    "a surrogate": frame(Opcode.TEXT, b"\xed\xa0\x80"),
    "an overlong form": frame(Opcode.TEXT, b"\xc0\xaf"),
    "beyond Unicode": frame(Opcode.TEXT, b"\xf4\x90\x80\x80"),
    "half a character": frame(Opcode.TEXT, KO[:2]) + frame(Opcode.TEXT, KO[2:]),
    "binary": frame(Opcode.BINARY, BAD) + frame(Opcode.TEXT, A),
    "binary in fragments": frame(Opcode.BINARY, BAD, fin=False) + frame(Opcode.CONT, BAD) + frame(Opcode.TEXT, KO),
    "a character in two fragments": frame(Opcode.TEXT, KO[:1], fin=False)
    + frame(Opcode.PING, b"?")
    + frame(Opcode.CONT, KO[1:])
    + frame(Opcode.TEXT, A),
    "a continuation that is no UTF-8": frame(Opcode.TEXT, A, fin=False)
    + frame(Opcode.CONT, BAD)
    + frame(Opcode.TEXT, A),
    "a fragment that is no UTF-8": frame(Opcode.TEXT, BAD, fin=False) + frame(Opcode.CONT, A) + frame(Opcode.TEXT, A),
    "a long text": frame(Opcode.TEXT, LONG_TEXT) + frame(Opcode.PING, b"?") + frame(Opcode.TEXT, A),
    "two long texts": frame(Opcode.TEXT, LONG_TEXT) * 2 + frame(Opcode.CLOSE, b"\x03\xe8"),
    "a long text in fragments": frame(Opcode.TEXT, LONG_TEXT[:1000], fin=False)
    + frame(Opcode.CONT, LONG_TEXT[1000:])
    + frame(Opcode.TEXT, A),
    "a long text with a bad end": frame(Opcode.TEXT, A) + frame(Opcode.TEXT, LONG_TEXT + BAD) + frame(Opcode.TEXT, A),
    "a long text with a bad beginning": frame(Opcode.TEXT, BAD + LONG_TEXT) + frame(Opcode.TEXT, A),
    "an image": frame(Opcode.TEXT, IMAGE) + frame(Opcode.TEXT, A),
    "an image beside words beyond ASCII": frame(Opcode.TEXT, IMAGE.replace(b"eye", KO)) + frame(Opcode.TEXT, A),
    "an image beside a text that is no UTF-8": frame(Opcode.TEXT, IMAGE.replace(b"eye", BAD)) + frame(Opcode.TEXT, A),
    "an image with a byte that is no UTF-8": frame(Opcode.TEXT, IMAGE.replace(b"BO", BAD, 1)) + frame(Opcode.TEXT, A),
    "an image in binary": frame(Opcode.BINARY, IMAGE.replace(b"eye", BAD)) + frame(Opcode.TEXT, A),
    "a long text with half a character at its end": frame(Opcode.TEXT, LONG_TEXT + KO[:1]) + frame(Opcode.TEXT, A),
}

INVALID_DATA = b"\x03\xef"
"""Code 1007 (RFC 6455 section 7.4.1)."""


def without_reason(said: bytes) -> bytes:
    """What was said, but for the text behind code 1007 and its length: ours is another than the library's."""
    at = said.find(INVALID_DATA)
    return said if at < 0 else said[: at - 1] + INVALID_DATA


@pytest.mark.parametrize("num_a_turn", [1, 64])
@pytest.mark.parametrize("name", TEXTS)
async def test_texts_that_the_library_refuses_are_refused(name: str, num_a_turn: int) -> None:
    heard, said = await converse([TEXTS[name]], is_direct=True, num_a_turn=num_a_turn)
    expected, expected_said = await converse([TEXTS[name]], is_direct=False)
    assert heard == expected
    assert without_reason(said) == without_reason(expected_said)


@pytest.mark.parametrize("name", [name for name, data in TEXTS.items() if len(data) < 1000])
async def test_texts_are_checked_equally_byte_by_byte_and_at_once(name: str) -> None:
    data = TEXTS[name]
    heard, said = await converse([data[i : i + 1] for i in range(len(data))], is_direct=True)
    expected, expected_said = await converse([data], is_direct=False)
    assert (heard, without_reason(said)) == (expected, without_reason(expected_said))


async def test_long_text_is_searched_once_and_kept_while_its_receiver_has_the_message(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Searching(PausingReceiver):
        def receive(self, message: bytes) -> bool:
            found = self._socket.find_long_text(message)
            texts.append(None if found is None else found.text)
            return super().receive(message)

    def search(message: bytes) -> LongText | None:
        num_searches.append(len(message))
        return find_long_text(message)

    texts: list[bytes | None] = []
    num_searches: list[int] = []
    sockets: list[DirectConnection] = []
    monkeypatch.setattr(server_connection, "find_long_text", search)

    async def handler(connection: ServerConnection) -> None:
        assert isinstance(connection, DirectConnection)
        sockets.append(connection)
        connection.listen(Searching(connection, [], 64))
        await connection.wait_closed()

    beside = IMAGE.replace(b"eye", KO)
    async with serve(handler, "127.0.0.1", 0, create_connection=DirectConnection, compression=None) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        for message in (A, IMAGE, beside):
            writer.write(frame(Opcode.TEXT, message))
        writer.write_eof()
        await reader.read()
        writer.close()
    assert texts == [None, IMAGE, beside]
    assert num_searches == [len(A), len(IMAGE), len(beside), len(beside)]  # what is not ASCII is searched twice
    assert sockets[0].num_bytes_held == 0
    assert sockets[0]._long_text is None


async def test_refused_text_is_reported_with_the_wrong_position() -> None:
    _, said = await converse([frame(Opcode.TEXT, b"abc" + BAD)], is_direct=True)
    assert said.endswith(INVALID_DATA + b"text is not UTF-8: invalid start byte at byte 3")


async def test_client_that_stays_after_a_refused_text_is_cut_off() -> None:
    heard: list[bytes] = []
    async with listening(heard, is_direct=True, close_timeout=0.01) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        writer.write(frame(Opcode.TEXT, BAD))
        assert INVALID_DATA in await reader.read()
        with pytest.raises(ConnectionError):  # noqa: PT012 - which of the writes finds out is the kernel's business
            while True:
                writer.write(frame(Opcode.TEXT, A))
                await writer.drain()
                await asyncio.sleep(0)
        writer.close()
    assert heard == []


@pytest.mark.parametrize(
    "name",
    [
        *("not masked", "unknown opcode", "too long", "a long ping", "close"),
        *("a continuation of nothing", "too long in fragments"),
    ],
)
async def test_client_that_stays_after_the_closing_handshake_is_cut_off(name: str) -> None:
    fault = CONVERSATIONS[name]
    gone = asyncio.Event()

    class Socket(DirectConnection):
        def connection_lost(self, exc: Exception | None) -> None:
            gone.set()
            super().connection_lost(exc)

    async with listening([], kind=Socket, close_timeout=0.01) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        writer.write(fault)
        assert b"\x88" in await reader.read()  # a close frame, and the server's half of the end
        async with asyncio.timeout(PATIENCE):
            await gone.wait()
        writer.close()


async def test_malformed_request_is_answered_and_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(websocket_internals, "LAST_ANSWERS", 0.01)
    async with listening([], kind=DirectConnection) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"no HTTP\r\n")
        with suppress(ConnectionError):
            assert (await reader.read()).startswith(b"HTTP/1.1 400 Bad Request\r\n")
        with pytest.raises(ConnectionError):  # noqa: PT012 - which of the writes finds out is the kernel's business
            while True:
                writer.write(b"x")
                await writer.drain()
                await asyncio.sleep(0)
        writer.close()


@pytest.mark.parametrize("ending", ["close", "eof"])
async def test_half_closed_client_that_does_not_read_is_cut_off(monkeypatch: pytest.MonkeyPatch, ending: str) -> None:
    monkeypatch.setattr(websocket_internals, "LAST_ANSWERS", 0.01)
    gone, begun = asyncio.Event(), asyncio.Event()

    class Socket(DirectConnection):
        def listen(self, receiver: Receiver) -> None:
            super().listen(receiver)
            self.send_messages([b"x" * 20_000_000])
            begun.set()

        def connection_lost(self, exc: Exception | None) -> None:
            gone.set()
            super().connection_lost(exc)

    async with listening([], kind=Socket, close_timeout=3_600.0) as port:
        with socket.create_connection(("127.0.0.1", port)) as client:
            client.sendall(REQUEST)
            async with asyncio.timeout(PATIENCE):
                await begun.wait()
                if ending == "close":
                    client.sendall(frame(Opcode.CLOSE, b"\x03\xe8"))
                else:
                    client.shutdown(socket.SHUT_WR)
                await gone.wait()


@pytest.mark.parametrize("name", CONVERSATIONS)
async def test_received_and_sent_bytes_equal_those_of_the_library(name: str) -> None:
    data = CONVERSATIONS[name]
    assert await converse([data], is_direct=True) == await converse([data], is_direct=False)


@pytest.mark.parametrize("name", [name for name, data in CONVERSATIONS.items() if len(data) < 1000])
async def test_bytes_one_by_one_give_the_same_messages_as_at_once(name: str) -> None:
    data = CONVERSATIONS[name]
    assert await converse([data[i : i + 1] for i in range(len(data))], is_direct=True) == await converse(
        [data], is_direct=False
    )


@examples(30)
@given(
    cuts=st.lists(st.integers(0, 6_000), max_size=6).map(sorted),
    names=st.lists(st.sampled_from(["many", "binary", "ping and pong", "fragments with a ping between"]), max_size=4),
)
def test_any_split_gives_the_same_messages_as_none(cuts: list[int], names: list[str]) -> None:
    data = b"".join(CONVERSATIONS[name] for name in names)
    pieces = [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True) if b > a]
    heard, said = asyncio.run(converse(pieces, is_direct=True))
    all_heard, all_said = asyncio.run(converse([data], is_direct=False))
    assert heard == all_heard
    pongs = [Frame(Opcode.PONG, ping).serialize(mask=False) for ping in (b"1", b"?")]
    assert without(pongs, said) == without(pongs, all_said), "of pings that wait the newest is answered"
    assert said.count(b"\x8a") <= all_said.count(b"\x8a")
    assert (b"\x8a" in said) == (b"\x8a" in all_said)


def without(parts: list[bytes], data: bytes) -> bytes:
    for part in parts:
        data = data.replace(part, b"")
    return data


@pytest.mark.parametrize("cut", [len(REQUEST) - n for n in range(6)] + [len(REQUEST) + 3])
async def test_frames_right_after_the_handshake_are_received(cut: int) -> None:
    heard: list[bytes] = []
    data = REQUEST + frame(Opcode.TEXT, b"early") + frame(Opcode.TEXT, b"bird")
    async with listening(heard, is_direct=True) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        for piece in (data[:cut], data[cut:]):
            writer.write(piece)
            await writer.drain()
            await asyncio.sleep(0)
        writer.write(frame(Opcode.CLOSE, b"\x03\xe8"))
        await reader.read()
        writer.close()
    assert heard == [b"early", b"bird"]


async def test_frames_right_after_the_handshake_are_received_without_further_bytes() -> None:
    heard: list[bytes] = []
    async with listening(heard, is_direct=True) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST + frame(Opcode.TEXT, b"early") * 100 + frame(Opcode.TEXT, b"bird")[:-1])
        writer.write_eof()
        await reader.read()
        writer.close()
    assert heard == [b"early"] * 100


async def test_connection_yields_during_a_long_run_of_frames() -> None:
    turns: list[int] = []
    heard: list[bytes] = []
    async with listening(heard, is_direct=True, num_a_turn=50) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        writer.write(frame(Opcode.TEXT, b"x") * 1_000 + frame(Opcode.CLOSE, b"\x03\xe8"))
        while len(heard) < 1_000:
            await asyncio.sleep(0)
            turns.append(len(heard))
        writer.close()
    steps = [b - a for a, b in pairwise(turns)]
    assert max(steps) <= 50


async def test_sent_bytes_equal_those_of_the_library() -> None:
    sent = [b"x" * n for n in SIZES] + [BinaryFrame(b"y" * n) for n in SIZES]

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, DirectConnection)
        socket.listen(PausingReceiver(socket, [], 1))
        for message in sent:
            socket.send_messages([message])
        size = socket.send_messages(sent)
        assert size > sum(map(len, sent))
        await socket.close()

    async with serve(handler, "127.0.0.1", 0, create_connection=DirectConnection, compression=None) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        expected = b"".join(
            Frame(Opcode.BINARY if isinstance(m, BinaryFrame) else Opcode.TEXT, m).serialize(mask=False) for m in sent
        )
        assert await reader.readexactly(2 * len(expected)) == 2 * expected
        writer.write(frame(Opcode.CLOSE, b"\x03\xe8"))
        await reader.read()
        writer.close()


@pytest.mark.parametrize("num_pings", [1, 3])
async def test_newest_ping_is_answered_when_there_is_room(num_pings: int) -> None:
    sockets: list[DirectConnection] = []
    heard: list[bytes] = []
    is_heard = asyncio.Event()

    class Once(PausingReceiver):
        def receive(self, message: bytes) -> bool:
            is_heard.set()
            return super().receive(message)

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, DirectConnection)
        sockets.append(socket)
        socket.pause_writing()
        socket.listen(Once(socket, heard, 64))
        await socket.wait_closed()

    async with serve(handler, "127.0.0.1", 0, create_connection=DirectConnection, compression=None) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        pings = b"".join(frame(Opcode.PING, b"%d" % i) for i in range(num_pings))
        writer.write(REQUEST + pings + frame(Opcode.TEXT, b"behind"))
        await reader.readuntil(b"\r\n\r\n")
        await is_heard.wait()
        assert sockets[0].transport.get_write_buffer_size() == 0
        sockets[0].resume_writing()
        pong = Frame(Opcode.PONG, b"%d" % (num_pings - 1)).serialize(mask=False)
        writer.write(frame(Opcode.CLOSE, b"\x03\xe8"))
        assert (await reader.read()).startswith(pong)
        writer.close()


class HoldingReceiver(PausingReceiver):
    """Accepts one message, and the next one when `go_on` is called; each turn has a given end."""

    def __init__(self, socket: DirectConnection, heard: list[bytes], until: float) -> None:
        super().__init__(socket, heard, 1)
        self.until = until
        self.num_waits = 0

    def begin(self) -> float:
        return self.until

    def wait(self, *, had_turn: bool) -> None:
        assert isinstance(had_turn, bool)
        self.num_waits += 1


class CountingConnection(DirectConnection):
    """Counts the pieces that the transport delivers."""

    num_pieces = 0

    def data_received(self, data: bytes) -> None:
        self.num_pieces += 1
        super().data_received(data)


@asynccontextmanager
async def held_connection(
    until: float, heard: list[bytes]
) -> AsyncIterator[tuple[CountingConnection, HoldingReceiver, asyncio.StreamReader, asyncio.StreamWriter]]:
    """A trusted connection whose receiver has had one message, and accepts no other one."""
    served: asyncio.Future[tuple[CountingConnection, HoldingReceiver]] = asyncio.get_running_loop().create_future()

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, CountingConnection)
        socket.is_trusted = True
        receiver = HoldingReceiver(socket, heard, until)
        socket.listen(receiver)
        served.set_result((socket, receiver))
        await socket.wait_closed()

    async with serve(handler, "127.0.0.1", 0, create_connection=CountingConnection, compression=None) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await reader.readuntil(b"\r\n\r\n")
        socket, receiver = await served
        writer.write(frame(Opcode.TEXT, b"first"))
        await turns_until(lambda: socket.num_bytes_received > len(REQUEST))
        while not heard:
            socket.go_on(inf)
        yield socket, receiver, reader, writer
        socket.transport.abort()
        writer.close()


async def turns_until(question: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not question():  # noqa: ASYNC110 - what is waited for tells nobody
            await asyncio.sleep(0)


def pong_of(i: int) -> bytes:
    return Frame(Opcode.PONG, b"%05d" % i).serialize(mask=False)


async def test_pings_behind_a_held_client_collapse_to_the_newest() -> None:
    heard: list[bytes] = []
    async with held_connection(inf, heard) as (socket, _, reader, writer):
        pings = [frame(Opcode.PING, b"%05d" % i) for i in range(5_000)]
        writer.write(b"".join(pings[:2_500]) + frame(Opcode.TEXT, b"between") + b"".join(pings[2_500:]))
        async with asyncio.timeout(PATIENCE):
            said = await reader.readuntil(pong_of(4_999))
        assert len(said) <= socket.num_pieces * len(pong_of(0)), "one answer to each piece of what came"
        assert socket.num_bytes_held == len(frame(Opcode.TEXT, b"between"))
        socket.go_on(inf)
        assert heard == [b"first", b"between"]


async def test_search_for_pings_ends_with_the_turn_and_goes_on_in_a_later_one() -> None:
    heard: list[bytes] = []
    async with held_connection(-inf, heard) as (socket, receiver, reader, writer):
        texts, pings = ([frame(kind, b"%05d" % i) for i in range(100)] for kind in (Opcode.TEXT, Opcode.PING))
        both = b"".join(text + ping for text, ping in zip(texts, pings, strict=True))
        begun = socket.num_bytes_received
        writer.write(both)
        await turns_until(lambda: socket.num_bytes_received == begun + len(both))
        assert socket.has_pings
        assert receiver.num_waits
        assert socket.num_bytes_held >= len(both) - len(pings[0]) * socket.num_pieces, "one frame of each piece at most"
        for _ in range(5):
            held = socket.num_bytes_held
            socket.go_on_with_pings(-inf)
            assert held - socket.num_bytes_held <= len(pings[0])
            assert socket.has_pings
        socket.go_on_with_pings(inf)
        assert not socket.has_pings
        assert socket.num_bytes_held == len(b"".join(texts))
        async with asyncio.timeout(PATIENCE):
            await reader.readuntil(pong_of(99))
        while socket.num_bytes_held:
            socket.go_on(inf)
        assert heard == [b"first", *(b"%05d" % i for i in range(100))]


async def test_connection_reads_again_once_its_pings_are_out_of_the_way() -> None:
    heard: list[bytes] = []
    async with held_connection(-inf, heard) as (socket, _, reader, writer):
        pings = b"".join(frame(Opcode.PING, b"%05d" % i) for i in range(10_000))
        begun = socket.num_bytes_received
        writer.write(pings)
        await turns_until(lambda: socket.num_bytes_held > MAX_HELD)
        socket.go_on_with_pings(inf)
        while socket.has_pings or socket.num_bytes_received < begun + len(pings):
            await asyncio.sleep(0)
            socket.go_on_with_pings(inf)
        async with asyncio.timeout(PATIENCE):
            await reader.readuntil(pong_of(9_999))


async def test_lost_connection_holds_no_fragments() -> None:
    connections: list[DirectConnection] = []

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, DirectConnection)
        socket.is_trusted = True
        connections.append(socket)
        socket.listen(PausingReceiver(socket, [], 64))
        await socket.wait_closed()

    async with serve(handler, "127.0.0.1", 0, create_connection=DirectConnection, compression=None) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REQUEST)
        await turns_until(lambda: bool(connections))
        writer.write(frame(Opcode.TEXT, b"x" * 50_000, fin=False))
        await turns_until(lambda: connections[0].num_bytes_held >= 50_000)
        writer.transport.abort()
        await connections[0].lost
        assert connections[0].num_bytes_held == 0


async def test_long_messages_are_compressed_slice_by_slice() -> None:
    noise = random.Random(0).randbytes(3 * COMPRESSED_AT_ONCE + 7)  # noqa: S311 - the same each time
    sent = [b"", b"first", BinaryFrame(noise), b"x" * 200_000, BinaryFrame(noise[:COMPRESSED_AT_ONCE]), b"last"]
    sizes: list[int] = []

    async def handler(socket: ServerConnection) -> None:
        assert isinstance(socket, DirectConnection)
        socket.listen(PausingReceiver(socket, [], 1))
        sizes.append(socket.send_messages(sent))
        while socket.unsent:
            sizes.append(socket.send_more())
        await socket.close()

    async with serve(handler, "127.0.0.1", 0, create_connection=DirectConnection, compression="deflate") as server:
        port = next(iter(server.sockets)).getsockname()[1]
        async with connect(f"ws://127.0.0.1:{port}", compression="deflate", proxy=None) as client:
            heard = [message if isinstance(message, bytes) else message.encode() async for message in client]
    assert heard == sent
    assert len(sizes) > sum(map(len, sent)) // (2 * COMPRESSED_AT_ONCE)
    assert max(sizes) < 2 * COMPRESSED_AT_ONCE + 1_000

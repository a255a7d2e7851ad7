"""A connection without a token holds little, gets no service, and blocks no client with the token."""

from __future__ import annotations

import asyncio
import json
import logging
import zlib
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from typing import Any

import cbor2
import pytest
import pytest_asyncio
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.frames import Frame, Opcode

from rosbridge_sim import Simulator
from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.shell.transport.request_reading import MAX_EARLY
from rosbridge_sim.shell.websocket.access import Access
from rosbridge_sim.shell.websocket.connection_places import ConnectionPlaces
from rosbridge_sim.shell.websocket.limits import MAX_OPENING, ServerLimits
from rosbridge_sim.shell.websocket.server import Server
from rosbridge_sim.shell.websocket.unauthenticated import (
    MAX_REFUSED,
    MAX_TRIES,
    MAX_UNPROVEN_BYTES,
    MAX_UNPROVEN_SIZE,
    NO_TOKEN,
)
from tests.graph.bus_fixture import make_store
from tests.support import PATIENCE, Client, mask, open_raw

TOKEN = "s3same-street"  # noqa: S105 - a test's own
BEARER = {"Authorization": f"Bearer {TOKEN}"}
AUTH = json.dumps({"op": "auth", "token": TOKEN})
FOR_EVER = 3_600.0
"""A delay that no test waits for [s]."""


async def enter(url: str, headers: dict[str, str] | None = None, **options: Any) -> Client:  # noqa: ANN401 - the library's
    """A client that shows headers of its own in its handshake."""
    options = {"compression": None, **options}
    return Client(await connect(url, additional_headers=headers, ping_interval=None, proxy=None, **options))


async def read_to_the_end(client: Client) -> list[dict[str, Any]]:
    """All that still comes before the connection is closed."""
    frames = list(client.inbox)
    async with asyncio.timeout(PATIENCE):
        try:
            while True:
                frames.append(json.loads(await client.socket.recv()))
        except ConnectionClosed:
            return frames


PAUSE = 0.002
"""Between two looks at a server that shares the loop [s]: some waits are for time to pass, which needs no busy core."""


async def until(is_so: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not is_so():  # noqa: ASYNC110 - no event tells of it
            await asyncio.sleep(PAUSE)


class Port:
    """A server over a bus with nothing but rosapi on it."""

    def __init__(self, server: Server, bus: Bus) -> None:
        self.server = server
        self.bus = bus
        self.url = f"ws://127.0.0.1:{server.port}"

    @property
    def num_strangers(self) -> int:
        return len(self.server._tables.unauthenticated)

    async def is_serving(self) -> None:
        """A client with the token is let in at once, and served."""
        async with await enter(self.url, BEARER) as owner:
            await owner.subscribe("/serving", type="std_msgs/Int32")
            await owner.send("publish", topic="/serving", msg={"data": 1})
            assert await owner.message("/serving") == {"data": 1}


Listen = Callable[..., Awaitable[Port]]


@pytest_asyncio.fixture
async def listen() -> AsyncIterator[Listen]:
    """Servers that want a token."""
    async with AsyncExitStack() as stack:

        async def start(*, is_compressing: bool = False, open_timeout: float = 5.0, **rules: Any) -> Port:  # noqa: ANN401 - each rule of its own type
            bus = Bus(make_store())
            Rosapi(bus)
            access = Access(**{"token": TOKEN, "delay": 0.0, **rules})
            limits = ServerLimits(access=access, is_compressing=is_compressing, open_timeout=open_timeout)
            server = Server(bus, limits, lambda: None)
            await server.start("127.0.0.1", 0)
            stack.push_async_callback(server.stop)
            return Port(server, bus)

        yield start


# What is said before the token


async def test_roslibpy_gets_the_reason_in_the_op_without_the_token_and_with_it(listen: Listen) -> None:
    port, agent = await listen(), {"User-Agent": "AutobahnPython/26.10.2"}
    async with await enter(port.url, agent) as client:
        await client.send("advertise", topic="/t", type="std_msgs/Int", id="advertise:/t:1")
        await client.take(f"status error: {NO_TOKEN}", id="advertise:/t:1")
        await client.send("advertise", topic="/t", type="std_msgs/Int", id="mine")
        assert (await client.take("status", id="mine"))["msg"] == NO_TOKEN
    for headers, ops in ((agent, ["status error: Unable"]), ({"User-Agent": "Mozilla/5.0"}, ["status"])):
        async with await enter(port.url, headers | BEARER) as client:
            await client.send("advertise", topic="/t", type="std_msgs/Int", id="advertise:/t:1")
            await client.call("/rosapi/topics")
            assert [frame["op"][:20] for frame in client.inbox] == ops


async def test_each_op_before_the_token_is_refused_with_an_answer(listen: Listen) -> None:
    port = await listen()
    async with await enter(port.url, BEARER) as owner, await enter(port.url) as client:
        await owner.send("advertise", topic="/pair", type="std_msgs/Int32")
        await client.send("subscribe", topic="/pair", type="std_msgs/Int32", id="s")
        status = await client.take("status", id="s")
        assert "token" in status["msg"]
        assert status["level"] == "error"
        answer = await client.call("/rosapi/topics")
        assert (answer["result"], answer["values"]) == (False, status["msg"])
        await client.send("send_action_goal", action="/a", id="g")
        assert (await client.take("action_result", id="g"))["result"] is False
        await client.send("auth", mac="rosauth's", id="a")
        assert (await client.take("status", id="a"))["msg"] == status["msg"]
        await client.send("auth", token="wrong", id="a")  # noqa: S106 - a test's own
        assert (await client.take("status", id="a"))["msg"] == "The token is wrong"
        assert not client.inbox
        assert len(port.server.clients) == 1
        assert len(port.bus.accounts) == 1

        await client.send("auth", token=TOKEN)
        await client.subscribe("/pair", type="std_msgs/Int32")
        await owner.send("publish", topic="/pair", msg={"data": 2})
        assert (await client.message("/pair"))["data"] == 2
        assert len(port.server.clients) == 2


async def test_ops_glued_behind_the_token_are_handled(listen: Listen) -> None:
    port = await listen()
    async with await enter(port.url) as client:
        ops = [
            {"op": "auth", "token": TOKEN},
            {"op": "subscribe", "topic": "/t", "type": "std_msgs/Int32"},
            {"op": "publish", "topic": "/t", "msg": {"data": 1}},
        ]
        await client.send_raw("".join(map(json.dumps, ops)))
        await client.send("publish", topic="/t", msg={"data": 2})
        assert await client.message("/t") == {"data": 1}
        assert await client.message("/t") == {"data": 2}


@pytest.mark.parametrize("size", [None, 1_000])
async def test_ops_in_one_burst_with_the_token_are_handled_in_order(listen: Listen, size: int | None) -> None:
    port = await listen()
    reader, writer = await open_raw(port.server.port)
    big = "x" * (2 * MAX_UNPROVEN_SIZE)
    frames = [AUTH, '{"op": "subscribe", "topic": "/t", "type": "std_msgs/String"}']
    frames += [json.dumps({"op": "publish", "topic": "/t", "msg": {"data": f"{i} {big}"}}) for i in range(10)]
    data = b"".join(map(mask, frames))
    for start in range(0, len(data), size or len(data)):
        writer.write(data[start : start + (size or len(data))])
    async with asyncio.timeout(PATIENCE):
        for i in range(10):
            await reader.readuntil(f'"{i} x'.encode())
    writer.close()
    await port.is_serving()


async def test_token_byte_by_byte_and_in_websocket_fragments_is_accepted(listen: Listen) -> None:
    port = await listen()
    frames = (
        Frame(Opcode.TEXT, AUTH[:9].encode(), fin=False),
        Frame(Opcode.PING, b""),
        Frame(Opcode.CONT, AUTH[9:].encode()),
    )
    for parts in (
        [mask(AUTH)[i : i + 1] for i in range(len(mask(AUTH)))],
        [frame.serialize(mask=True) for frame in frames],
    ):
        reader, writer = await open_raw(port.server.port)
        for part in parts:
            writer.write(part)
            await writer.drain()
        writer.write(mask('{"op": "call_service", "service": "/rosapi/get_time"}'))
        async with asyncio.timeout(PATIENCE):
            await reader.readuntil(b'"result":true')
        writer.close()


@pytest.mark.parametrize("ending", ["close", "cut", "eof"])
async def test_token_followed_by_a_close_leaves_nothing_behind(listen: Listen, ending: str) -> None:
    port = await listen()
    _, writer = await open_raw(port.server.port)
    writer.write(mask(AUTH) + mask('{"op": "advertise", "topic": "/t", "type": "std_msgs/Int32"}'))
    if ending == "close":
        writer.write(Frame(Opcode.CLOSE, b"\x03\xe8").serialize(mask=True))
    elif ending == "eof":
        writer.write_eof()
    else:
        writer.transport.abort()
    writer.close()
    await until(lambda: not port.server._tables.sockets and not port.server.clients)
    assert not port.bus.accounts
    await port.is_serving()


# What is not even decoded


def fragments_of(text: str) -> list[str]:
    pieces = text[:9], text[9:]
    return [json.dumps({"op": "fragment", "id": "f", "data": p, "num": i, "total": 2}) for i, p in enumerate(pieces)]


async def test_token_in_fragments_cbor_or_a_long_frame_is_not_accepted(listen: Listen) -> None:
    port = await listen()
    async with await enter(port.url) as client:
        kinds: tuple[list[str] | list[bytes], ...] = (
            fragments_of(AUTH),
            [cbor2.dumps({"op": "auth", "token": TOKEN})],
            [AUTH[:-1] + " " * 5_000 + "}"],
            [json.dumps({"op": "png", "data": "x" * 14_000})],
            ["[" * 3_000, "", "\0"],
            [b"\xff"],
        )
        for frames in kinds:
            for frame in frames:
                await client.send_raw(frame)
                assert (await client.take("status"))["msg"] == NO_TOKEN
        assert not port.server.clients
        await client.send_raw(AUTH)
        await client.settle()
        assert len(port.server.clients) == 1


async def test_refusal_has_the_id_of_a_small_plain_frame_only(listen: Listen) -> None:
    port = await listen()
    async with await enter(port.url) as client:
        for op in ("fragment", "png", "subscribe", "publish"):
            await client.send(op, id="i", data="", num=0, total=1, topic="/t", msg={})
            assert (await client.take("status"))["id"] == "i"
        await client.send("publish", id="i", topic="/t", msg="x" * 5_000)
        assert "id" not in await client.take("status")


async def test_compression_needs_the_token_in_the_handshake(
    listen: Listen,
) -> None:
    port = await listen(is_compressing=True)
    async with await enter(port.url, BEARER, compression="deflate") as owner:
        assert "permessage-deflate" in str(owner.socket.response and owner.socket.response.headers)
        assert await owner.settle() == []
    async with await enter(port.url, compression="deflate") as client:
        assert "permessage-deflate" not in str(client.socket.response and client.socket.response.headers)
        await client.send_raw(AUTH)
        assert await client.settle() == []


async def test_compressed_frame_before_the_token_is_not_inflated(listen: Listen) -> None:
    port = await listen(is_compressing=True)
    reader, writer = await open_raw(port.server.port)
    packer = zlib.compressobj(wbits=-12)
    data = (packer.compress(AUTH.encode()) + packer.flush(zlib.Z_SYNC_FLUSH))[:-4]
    writer.write(b"\xc1" + Frame(Opcode.TEXT, data).serialize(mask=True)[1:])
    async with asyncio.timeout(PATIENCE):
        said = await reader.read()
    assert b"\x03\xea" in said  # 1002: nothing of the kind was agreed upon
    assert not port.server.clients
    writer.close()


# What is not even kept


async def test_frame_with_too_large_a_length_is_refused_by_its_header(listen: Listen) -> None:
    port = await listen()
    reader, writer = await open_raw(port.server.port)
    writer.write(b"\x81\xfe" + (MAX_UNPROVEN_SIZE + 1).to_bytes(2, "big") + bytes(4))
    async with asyncio.timeout(PATIENCE):
        said = await reader.read()
    assert NO_TOKEN.encode() in said
    assert b"\x03\xf1" in said  # 1009
    writer.close()
    await port.is_serving()


async def test_websocket_fragments_beyond_the_limit_are_refused(listen: Listen) -> None:
    port = await listen()
    client = await enter(port.url)

    async def parts() -> AsyncIterator[str]:
        for _ in range(3):
            yield "x" * (MAX_UNPROVEN_SIZE // 2)

    await client.socket.send(parts())
    await read_to_the_end(client)
    assert client.socket.close_code == 1009


async def test_a_client_with_the_token_may_send_long_frames(listen: Listen) -> None:
    port = await listen()
    async with await enter(port.url) as client:
        await client.send_raw(AUTH)
        await client.send("publish", topic="/t", type="std_msgs/String", msg={"data": "x" * 1_000_000})
        assert await client.settle() == []


async def test_too_many_frames_before_the_token_close_the_connection(listen: Listen) -> None:
    port = await listen()
    client = await enter(port.url)
    for i in range(MAX_REFUSED + 5):
        await client.send("subscribe", topic="/t", id=i)
    frames = await read_to_the_end(client)
    assert [frame["id"] for frame in frames] == list(range(MAX_REFUSED))
    assert (client.socket.close_code, client.socket.close_reason) == (1008, "too many messages without a token")


@pytest.mark.slow  # a second for the closing
async def test_ping_flood_before_the_token_closes_the_connection(listen: Listen) -> None:
    port = await listen()
    reader, writer = await open_raw(port.server.port)
    ping = Frame(Opcode.PING, b"x" * 100).serialize(mask=True)
    said = b""
    async with asyncio.timeout(PATIENCE):
        while b"too many bytes without a token" not in said:
            writer.write(ping * (MAX_UNPROVEN_BYTES // 500))
            await writer.drain()
            said = await reader.read(2**20)
            assert said
    writer.close()


@pytest.mark.slow  # a second for the closing
async def test_client_that_reads_no_refusals_is_closed(listen: Listen) -> None:
    port = await listen()
    _, writer = await open_raw(port.server.port)
    await until(lambda: len(port.server._tables.sockets) == 1)
    (socket,) = port.server._tables.sockets
    socket.pause_writing()
    writer.write(mask('{"op": "subscribe"}'))
    await until(lambda: not port.server._tables.sockets)
    writer.close()


async def test_endless_request_is_refused(listen: Listen) -> None:
    port = await listen()
    for head in (
        b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * MAX_EARLY,
        b"GET / HTTP/1.1\r\n" + (b"X: " + b"y" * 6_000 + b"\r\n") * 3 + b"\r\n",
    ):
        reader, writer = await asyncio.open_connection("127.0.0.1", port.server.port)
        writer.write(head)
        async with asyncio.timeout(PATIENCE):
            answer = await reader.read(2**20)
        assert answer.startswith(b"HTTP/1.1 431 ")
        assert answer.endswith(b"of head\n")
        writer.close()
    await port.is_serving()


async def test_request_with_long_cookies_is_accepted(listen: Listen) -> None:
    port = await listen()
    async with await enter(port.url, {**BEARER, "Cookie": "x" * 7_000, "X-Other": "y" * 7_000}) as client:
        assert await client.settle() == []


# Time


async def test_connection_without_a_token_is_closed_after_a_time_out_with_a_reason(listen: Listen) -> None:
    port = await listen(patience=0.05)
    client = await enter(port.url)
    (status,) = await read_to_the_end(client)
    assert status["msg"] == NO_TOKEN
    assert (client.socket.close_code, client.socket.close_reason) == (1008, "no token was sent in time")
    await port.is_serving()


async def test_connection_with_many_wrong_tokens_is_closed(listen: Listen) -> None:
    port = await listen()
    client = await enter(port.url)
    for guess in range(MAX_TRIES + 2):
        await client.send("auth", token=str(guess))
    await client.send_raw(AUTH)
    frames = await read_to_the_end(client)
    assert [frame["msg"] for frame in frames] == ["The token is wrong"] * MAX_TRIES
    assert (client.socket.close_code, client.socket.close_reason) == (1008, "wrong tokens")
    assert not port.server.clients


async def test_each_wrong_token_is_answered_with_a_longer_delay(
    listen: Listen, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = await listen(delay=0.015625, patience=FOR_EVER)
    loop = asyncio.get_running_loop()
    delays: list[float] = []
    call_later = loop.call_later

    def note(delay: float, *args: Any) -> asyncio.TimerHandle:  # noqa: ANN401 - asyncio's own
        delays.append(delay)
        return call_later(delay, *args)

    monkeypatch.setattr(loop, "call_later", note)
    client = await enter(port.url)
    for guess in range(MAX_TRIES):
        await client.send("auth", token=str(guess))
    await read_to_the_end(client)
    assert [delay for delay in delays if delay in {0.015625, 0.03125, 0.0625}] == [0.015625, 0.03125, 0.0625]


async def test_a_wrong_token_delays_its_own_connection_and_no_other_of_the_same_address(listen: Listen) -> None:
    port = await listen(delay=FOR_EVER, patience=FOR_EVER, open_timeout=FOR_EVER)
    by_message = await enter(port.url)
    await by_message.send("auth", token="wrong", id="w")  # noqa: S106 - a test's own
    await by_message.send_raw(AUTH)  # comes behind it, and waits too
    by_handshake = asyncio.ensure_future(enter(f"{port.url}/?token=wrong", open_timeout=None))
    await until(lambda: port.num_strangers == 2)
    await port.is_serving()
    async with await enter(port.url) as other:
        await other.send_raw(AUTH)
        assert await other.settle() == []
        assert not by_handshake.done()
        assert len(port.server.clients) == 1
    by_handshake.cancel()
    by_message.cut()
    await asyncio.wait([by_handshake])
    await until(lambda: port.num_strangers == 1)
    for socket in port.server._tables.sockets:  # nothing is read of it, not even that it is gone
        socket.transport.abort()


async def test_ops_after_a_wrong_token_are_handled_after_its_answer(listen: Listen) -> None:
    port = await listen(delay=0.01)
    reader, writer = await open_raw(port.server.port)
    frames = ['{"op": "auth", "token": "wrong"}', AUTH, '{"op": "call_service", "service": "/rosapi/get_time"}']
    writer.write(b"".join(map(mask, frames)))
    async with asyncio.timeout(PATIENCE):
        said = await reader.readuntil(b'"result":true')
    assert said.index(b"The token is wrong") < said.index(b"service_response")
    writer.close()


async def test_too_much_input_after_a_wrong_token_closes_the_connection(listen: Listen) -> None:
    port = await listen(delay=FOR_EVER)
    reader, writer = await open_raw(port.server.port)
    frame = mask(json.dumps({"op": "publish", "topic": "/t", "msg": {"data": "x" * 3_000}}))
    writer.write(mask('{"op": "auth", "token": "wrong"}') + frame * 20)
    async with asyncio.timeout(PATIENCE):
        assert b"too much was sent behind a wrong token" in await reader.read(2**20)
    writer.close()


async def test_flood_after_a_wrong_token_is_read_in_small_part(listen: Listen) -> None:
    port = await listen(delay=FOR_EVER, patience=FOR_EVER)
    _, writer = await open_raw(port.server.port)
    writer.write(mask('{"op": "auth", "token": "wrong"}'))
    await until(lambda: any(getattr(one, "_is_paused", False) for one in port.server._tables.sockets))
    (socket,) = port.server._tables.sockets
    writer.write(mask("x" * 1_000) * 10_000)
    await port.is_serving()
    assert socket.num_bytes_held <= MAX_UNPROVEN_SIZE
    writer.transport.abort()
    socket.transport.abort()  # a stop would wait for it


# Room


def test_oldest_unauthenticated_connection_makes_room_for_a_new_one() -> None:
    class One:
        is_gone = False

        def evict(self) -> None:
            self.is_gone = True

    places, ones = ConnectionPlaces(3), [One() for _ in range(6)]
    for one in ones[:3]:
        places.take(one)
    places.leave(ones[1])
    places.leave(ones[1])
    places.take(ones[3])
    assert [one.is_gone for one in ones] == [False] * 6
    places.take(ones[4])
    places.take(ones[5])
    assert [one.is_gone for one in ones] == [True, False, True, False, False, False]
    assert len(places) == 3


async def test_unauthenticated_connections_take_no_place_of_a_client_with_the_token(listen: Listen) -> None:
    port = await listen(max_clients=5)
    strangers = [await enter(port.url) for _ in range(5)]
    owners = [await enter(port.url, BEARER) for _ in range(4)]
    await strangers[0].send_raw(AUTH)
    assert await strangers[0].settle() == []
    assert len(port.server.clients) == 5
    for client in owners:
        assert await client.settle() == []
    with pytest.raises(InvalidStatus) as caught:  # now it is full
        await enter(port.url, BEARER)
    assert caught.value.response.status_code == 503
    await strangers[1].send_raw(AUTH)
    assert await read_to_the_end(strangers[1]) == []
    assert strangers[1].socket.close_code == 1013
    assert strangers[1].socket.close_reason == "at most 5 clients; try again later"
    assert len(port.server.clients) == 5
    await owners[0].close()
    await until(lambda: len(port.server.clients) == 4)
    await strangers[2].send_raw(AUTH)
    assert await strangers[2].settle() == []
    for client in (*strangers, *owners):
        await client.close()


async def test_unauthenticated_connections_have_their_own_places_and_the_oldest_makes_room(listen: Listen) -> None:
    port = await listen(max_strangers=3)
    strangers = [await enter(port.url) for _ in range(10)]
    for gone in strangers[:7]:
        assert await read_to_the_end(gone) == []
        assert gone.socket.close_code == 1013
        assert "--max-strangers" in str(gone.socket.close_reason)
    assert port.num_strangers == 3
    for left in strangers[7:]:
        await left.send_raw(AUTH)
        assert await left.settle() == []
    assert port.num_strangers == 0
    await port.is_serving()
    for client in strangers:
        await client.close()


async def test_delayed_handshakes_with_a_wrong_token_are_bounded(listen: Listen) -> None:
    port = await listen(delay=FOR_EVER, max_strangers=3, open_timeout=FOR_EVER)
    tries = [asyncio.ensure_future(enter(f"{port.url}/?token=wrong", open_timeout=None)) for _ in range(10)]
    async with asyncio.timeout(PATIENCE):
        while sum(one.done() for one in tries) < 7:
            await asyncio.wait([one for one in tries if not one.done()], return_when=asyncio.FIRST_COMPLETED)
    assert port.num_strangers == 3
    await port.is_serving()
    for one in tries:
        one.cancel()
    await asyncio.wait(tries)
    assert all(one.cancelled() or one.exception() for one in tries)


@pytest.mark.slow
async def test_connections_without_a_request_are_bounded_and_block_no_client(listen: Listen) -> None:
    port = await listen(open_timeout=FOR_EVER)
    tables = port.server._tables
    idle = [await asyncio.open_connection("127.0.0.1", port.server.port) for _ in range(MAX_OPENING + 10)]
    await until(lambda: len(tables.sockets) <= MAX_OPENING)
    assert len(tables.opening) == MAX_OPENING
    for reader, _ in idle[:10]:
        async with asyncio.timeout(PATIENCE):
            assert await reader.read() == b""
    await port.is_serving()
    for _, writer in idle:
        writer.transport.abort()
    await until(lambda: not tables.sockets)
    assert len(tables.opening) == 0


async def test_closed_unauthenticated_connection_frees_its_place(listen: Listen) -> None:
    port = await listen(patience=FOR_EVER)
    for _ in range(20):
        client = await enter(port.url)
        await client.send("subscribe", topic="/t")
        client.cut()
    await until(lambda: not port.server._tables.sockets)
    assert port.num_strangers == 0
    await until(lambda: not [task for task in asyncio.all_tasks() if "protocol_handler" in repr(task.get_coro())])


@pytest.mark.parametrize("query", ["", "?token=wrong"])
async def test_handshake_checked_after_a_lost_connection_takes_no_place(listen: Listen, query: str) -> None:
    port = await listen(patience=FOR_EVER)
    client = await enter(port.url)
    await until(lambda: port.num_strangers == 1)
    (socket,) = port.server._tables.sockets
    client.cut()
    await until(lambda: not port.server._tables.sockets)
    assert socket.request is not None
    socket.request.path += query
    judged = port.server._judge_handshake(socket, socket.request)  # as the library does where both come at once
    if isinstance(judged, Awaitable):
        await judged
    assert port.num_strangers == 0


@pytest.mark.slow  # a second for the closing
async def test_stop_does_not_wait_for_unauthenticated_connections(listen: Listen) -> None:
    port = await listen(delay=FOR_EVER, patience=FOR_EVER, open_timeout=FOR_EVER)
    idle = await enter(port.url)
    guessing = await enter(port.url)
    await guessing.send("auth", token="wrong")  # noqa: S106 - a test's own
    refused = asyncio.ensure_future(enter(f"{port.url}/?token=wrong", open_timeout=None))
    await until(lambda: port.num_strangers == 3)
    async with asyncio.timeout(5):
        await port.server.stop()
    assert await read_to_the_end(idle) == []
    assert idle.socket.close_code == 1001
    await asyncio.wait([refused])
    assert refused.exception() is not None
    guessing.cut()


# What the log says of it


async def test_refusals_before_the_token_are_one_log_line_per_reason(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with Simulator(port=0, world=False, token=TOKEN) as sim:
        for _ in range(5):
            client = await enter(sim.url)
            await client.send("subscribe", topic="/t")
            assert (await client.take("status"))["msg"] == NO_TOKEN
            await client.send("x\ny", id=1)
            assert (await client.take("status", id=1))["msg"] == NO_TOKEN
            await client.close()
        client = await enter(sim.url)
        address = client.socket.local_address
        await client.send("auth", token="wrong")  # noqa: S106 - a test's own
        assert (await client.take("status"))["msg"] == "The token is wrong"
        warnings = [one.getMessage() for one in caplog.records if one.levelno == logging.WARNING]
        assert len(warnings) == 2
        assert warnings[0].startswith(f"no token: refused: subscribe: {NO_TOKEN}; the connection is 127.0.0.1:")
        assert warnings[0].endswith("(no_token)")
        assert warnings[1] == (
            f"no token: refused: auth: The token is wrong; the connection is 127.0.0.1:{address[1]} (wrong_token)"
        )
        await client.close()
        async with await enter(sim.url, BEARER) as owner:
            await owner.send("subscribe", topic="/sim/refusals")
            told = await owner.message("/sim/refusals")
            assert {one["client"] for one in told["refusals"]} == {"no token"}
            assert {one["reason"] for one in told["refusals"]} == {"no_token", "wrong_token"}


async def test_wrong_token_in_the_handshake_is_logged(listen: Listen) -> None:
    port = await listen()
    noted: list[RefusedRequest] = []
    port.bus.on_refusal = noted.append
    with pytest.raises(InvalidStatus):
        await enter(f"{port.url}/?token=guess")
    assert [(one.client, one.reason) for one in noted] == [("no token", Reason.WRONG_TOKEN)]
    assert "guess" not in str(noted)


async def test_too_much_input_before_the_handshake_answer_closes_the_connection(listen: Listen) -> None:
    port = await listen(delay=FOR_EVER, open_timeout=FOR_EVER)
    reader, writer = await asyncio.open_connection("127.0.0.1", port.server.port)
    writer.write(
        b"GET /?token=wrong HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n" + bytes(MAX_EARLY + 1)
    )
    async with asyncio.timeout(PATIENCE):
        with suppress(ConnectionError):
            assert await reader.read() == b""
    writer.close()
    await until(lambda: not port.server._tables.sockets)
    await port.is_serving()

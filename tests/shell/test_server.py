"""The port: limits of a connection, plain HTTP beside it, and many clients that do not disturb each other."""

from __future__ import annotations

import asyncio
import json
import re
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack

import pytest
import pytest_asyncio
import uvloop
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi import Rosapi
from rosbridge_sim.protocol.flow import OutboxLimits
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.server import Server, ServerLimits
from rosbridge_sim.shell.storage import read_definitions
from tests.support import PATIENCE, Client, mask, open_raw


class Port:
    """A server on a free port, over a bus with nothing but rosapi on it."""

    def __init__(self, server: Server, bus: Bus) -> None:
        self.server = server
        self.bus = bus

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.server.port}"

    async def http(self, target: str, *headers: str, method: str = "GET") -> tuple[int, str]:
        """Status and body of a plain request."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.server.port)
        request = "\r\n".join([f"{method} {target} HTTP/1.1", "Host: localhost", *headers, "", ""])
        writer.write(request.encode())
        async with asyncio.timeout(PATIENCE):
            answer = (await reader.read()).decode()
        writer.close()
        await writer.wait_closed()
        head, _, body = answer.partition("\r\n\r\n")
        return int(head.split()[1]), body


Listen = Callable[..., Awaitable[Port]]


@pytest_asyncio.fixture
async def listen() -> AsyncIterator[Listen]:
    """Servers with limits of the test's own."""
    async with AsyncExitStack() as stack:

        async def start(limits: ServerLimits | None = None) -> Port:
            bus = Bus(Store(read_definitions("22.R2")))
            Rosapi(bus)
            server = Server(bus, limits or ServerLimits(), lambda: None)
            await server.start("127.0.0.1", 0)
            stack.push_async_callback(server.stop)
            return Port(server, bus)

        yield start


async def hear_at_many_rates() -> None:
    """Have clients hear two topics, in two spellings each, at twelve throttle rates."""
    topics = ("/Ego_topic", "Ego_topic", "/Object_topic", "Object_topic")
    async with Simulator(port=0, scenario="demo") as sim, AsyncExitStack() as stack:
        clients = [await stack.enter_async_context(await Client.open(sim.url)) for _ in range(12)]
        for i, client in enumerate(clients):
            for j, topic in enumerate(topics):
                await client.send("subscribe", topic=topic, throttle_rate=1 + 3 * i + j, queue_length=1)
        for client in clients:
            for topic in topics * 5:
                await client.message(topic)
        assert not sim.num_bugs


@pytest.mark.slow
@pytest.mark.parametrize("make_loop", [asyncio.new_event_loop, uvloop.new_event_loop], ids=["asyncio", "uvloop"])
def test_many_throttle_rates_at_once_keep_the_server_alive(
    make_loop: Callable[[], asyncio.AbstractEventLoop],
) -> None:
    with asyncio.Runner(loop_factory=make_loop) as runner:
        runner.run(hear_at_many_rates())


async def test_a_clean_stop_tells_every_client_that_we_go_away(listen: Listen) -> None:
    port = await listen()
    clients = [await Client.open(port.url) for _ in range(3)]
    for client in clients:
        await client.settle()
    await port.server.stop()
    for client in clients:
        with pytest.raises(ConnectionClosed):
            await client.read()
        assert client.socket.close_code == 1001


async def test_small_frames_leave_at_once(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        await client.settle()
        (served,) = port.server.clients
        sock = served.socket.transport.get_extra_info("socket")
        assert sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0


async def test_a_frame_over_the_limit_closes_with_1009_and_one_at_the_limit_does_not(listen: Listen) -> None:
    size = 4096
    port = await listen(ServerLimits(max_frame_size=size))
    head, tail = '{"op":"publish","topic":"/t","type":"std_msgs/String","msg":{"data":"', '"}}'
    fits = head + "x" * (size - len(head) - len(tail)) + tail
    async with await Client.open(port.url) as client, await Client.open(port.url) as other:
        await client.send_raw(fits)
        assert await client.settle() == []
        await client.send_raw(fits + " ")
        with pytest.raises(ConnectionClosed):
            await client.read()
        assert client.socket.close_code == 1009
        assert await other.settle() == []


async def test_the_limits_we_start_with() -> None:
    limits = ServerLimits()
    assert limits.max_frame_size == 16 * 2**20
    assert limits.ping_interval is not None
    assert limits.ping_timeout is not None
    assert not limits.is_compressing


@pytest.mark.slow
async def test_a_client_that_answers_no_ping_is_dropped_and_what_it_held_with_it(listen: Listen) -> None:
    port = await listen(ServerLimits(ping_interval=0.05, ping_timeout=1.0))
    async with await Client.open(port.url) as watcher:
        # a socket that shakes hands, advertises a topic, and then is as dead as behind a pulled cable
        _, writer = await open_raw(port.server.port)
        writer.write(mask('{"op":"advertise","topic":"/t","type":"std_msgs/String"}'))
        async with asyncio.timeout(PATIENCE):
            while not (await watcher.values("/rosapi/publishers", {"topic": "/t"}))["publishers"]:
                pass
            while (await watcher.values("/rosapi/publishers", {"topic": "/t"}))["publishers"]:
                pass
        writer.close()
        await writer.wait_closed()


async def test_no_compression_unless_asked(listen: Listen) -> None:
    for is_compressing in (False, True):
        port = await listen(ServerLimits(is_compressing=is_compressing))
        async with connect(port.url, compression="deflate", proxy=None) as offering:
            extensions = offering.response.headers.get("Sec-WebSocket-Extensions", "") if offering.response else ""
            assert ("permessage-deflate" in extensions) is is_compressing


async def test_json_in_binary_frames_is_json(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        await client.send_raw(b'{"op":"call_service","service":"rosapi/topics","id":"b"}')
        assert (await client.take("service_response", id="b"))["result"] is True


async def test_objects_glued_in_one_frame_are_done_in_order(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        ops = [
            {"op": "subscribe", "topic": "/t", "type": "std_msgs/Int32"},
            {"op": "publish", "topic": "/t", "msg": {"data": 1}},
            {"op": "publish", "topic": "/t", "msg": {"data": 2}},
        ]
        await client.send_raw("\n".join(json.dumps(op) for op in ops))
        assert [await client.message("/t") for _ in range(2)] == [{"data": 1}, {"data": 2}]


async def test_bare_nan_is_taken_and_null_is_sent(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        await client.subscribe("/t", type="std_msgs/Float64")
        for value in ("NaN", "Infinity", "-Infinity", "null"):
            await client.send_raw('{"op":"publish","topic":"/t","msg":{"data":' + value + "}}")
            assert await client.message("/t") == {"data": None}


async def test_unicode_goes_through(listen: Listen) -> None:
    port = await listen()
    text = '안녕하세요 é \u2028 🚗 \x7f \\ "'
    async with await Client.open(port.url) as client, await Client.open(port.url) as other:
        await other.subscribe("/말", type="std_msgs/String")
        await client.send("publish", topic="/말", type="std_msgs/String", msg={"data": text})
        await client.send_raw(
            json.dumps({"op": "publish", "topic": "/말", "msg": {"data": text}}, ensure_ascii=False).encode()
        )
        assert [await other.message("/말") for _ in range(2)] == [{"data": text}] * 2


async def test_two_clients_do_not_mix(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as a, await Client.open(port.url) as b:
        await a.subscribe("/t", type="std_msgs/String", id="same")
        await b.subscribe("t", type="std_msgs/String", id="same")
        await a.send("publish", topic="/t", msg={"data": "x"})
        assert await a.read() == {"op": "publish", "topic": "/t", "msg": {"data": "x"}}
        assert await b.read() == {"op": "publish", "topic": "t", "msg": {"data": "x"}}
        await a.send("unsubscribe", topic="/t")
        await a.send("publish", topic="/t", msg={"data": "y"})
        assert await b.read() == {"op": "publish", "topic": "t", "msg": {"data": "y"}}
        assert await a.settle() == []


async def test_what_a_client_held_is_gone_with_it(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as watcher:
        client = await Client.open(port.url)
        await client.subscribe("/t", type="std_msgs/String")
        client.cut()
        async with asyncio.timeout(PATIENCE):
            while (await watcher.values("/rosapi/subscribers", {"topic": "/t"}))["subscribers"]:
                pass
        assert len(port.server.clients) == 1


async def test_who_does_not_read_costs_bounded_memory_and_nobody_else_a_message(listen: Listen) -> None:
    limits = OutboxLimits(burst=10, topic_bytes=2**20, hard_bytes=8 * 2**20)
    port = await listen(ServerLimits(outbox=limits))
    num_messages, size = 600, 20_000  # 12 MB: far more than the limit and a loopback socket's buffers together
    async with await Client.open(port.url) as talker, await Client.open(port.url) as good:
        lazy = await connect(port.url, compression=None, max_queue=1, ping_interval=None, proxy=None)
        lazy.transport.pause_reading()
        await lazy.send('{"op":"subscribe","topic":"/t","type":"std_msgs/String"}')
        await good.subscribe("/t", type="std_msgs/String")
        async with asyncio.timeout(PATIENCE):
            while len((await good.values("/rosapi/subscribers", {"topic": "/t"}))["subscribers"]) < 1:
                pass
        largest = 0
        for i in range(num_messages):
            await talker.send("publish", topic="/t", msg={"data": f"{i} " + "x" * size})
            data = (await good.message("/t"))["data"]
            assert data.startswith(f"{i} ")
            largest = max(largest, *(client.outbox.num_bytes for client in port.server.clients))
        assert size < largest < limits.topic_bytes + 2 * size
        lazy.transport.resume_reading()
        last = ""
        async with asyncio.timeout(PATIENCE):
            while not last.startswith(f"{num_messages - 1} "):
                last = json.loads(await lazy.recv())["msg"]["data"]
        await lazy.close()


async def ask_and_never_read(port: Port) -> ClientConnection:
    """A client that has asked for 10 MB of answers and takes none of them."""
    async with await Client.open(port.url) as good:
        await good.values("/rosapi/set_param", {"name": "/long", "value": json.dumps("x" * 100_000)})
    lazy = await connect(port.url, compression=None, max_queue=1, ping_interval=None, proxy=None)
    lazy.transport.pause_reading()
    ask = json.dumps({"op": "call_service", "service": "/rosapi/get_param", "args": {"name": "/long"}})
    for _ in range(100):
        await lazy.send(ask)
    return lazy


UNREAD = ServerLimits(outbox=OutboxLimits(burst=10, topic_bytes=2**16, hard_bytes=2**20), ping_interval=None)


async def test_who_leaves_answers_unread_beyond_the_limit_is_told_why_and_closed(listen: Listen) -> None:
    port = await listen(UNREAD)
    lazy = await ask_and_never_read(port)
    async with await Client.open(port.url) as good:
        while all(client.socket.state is State.OPEN for client in port.server.clients):
            await good.settle()
        lazy.transport.resume_reading()
        with pytest.raises(ConnectionClosed, match=r"1008 .*unread"):
            await read_to_the_end(lazy)
        assert await good.settle() == []


@pytest.mark.slow
async def test_who_does_not_even_read_that_is_cut_off(listen: Listen) -> None:
    port = await listen(UNREAD)
    lazy = await ask_and_never_read(port)
    async with await Client.open(port.url) as good, asyncio.timeout(PATIENCE):
        while len(port.server.clients) > 1:
            await good.settle()
    lazy.transport.abort()


@pytest.mark.slow
async def test_a_stop_does_not_wait_for_who_does_not_read(listen: Listen) -> None:
    port = await listen(ServerLimits(ping_interval=None))
    lazy = await ask_and_never_read(port)
    async with asyncio.timeout(PATIENCE):
        await port.server.stop()
    assert not port.server.clients
    lazy.transport.abort()


@pytest.mark.slow
async def test_a_stop_does_not_wait_for_who_never_says_what_he_wants(listen: Listen) -> None:
    port = await listen()
    mute = [await asyncio.open_connection("127.0.0.1", port.server.port) for _ in range(2)]
    mute[1][1].write(b"GET / HTTP/1.1\r\nHost: localhost\r\n")  # and no more
    async with await Client.open(port.url) as client:
        await client.settle()
    async with asyncio.timeout(5):  # the handshake's own patience is 10 s
        await port.server.stop()
    for _, writer in mute:
        writer.transport.abort()


async def read_to_the_end(socket: ClientConnection) -> None:
    async with asyncio.timeout(PATIENCE):
        while True:
            await socket.recv()


async def test_healthz_says_ok(listen: Listen) -> None:
    port = await listen()
    assert await port.http("/healthz") == (200, "ok\n")
    assert await port.http("/healthz?verbose=1") == (200, "ok\n")


async def test_plain_http_elsewhere_is_told_what_lives_here(listen: Listen) -> None:
    port = await listen()
    status, body = await port.http("/nothing")
    assert status == 404
    assert "/nothing" in body
    assert "rosbridge" in body
    status, body = await port.http("/")
    assert status == 426
    assert re.search("websocket", body, re.IGNORECASE)


async def test_a_query_string_is_no_other_place(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url + "/?token=abc") as client:
        assert await client.settle() == []


async def test_a_bug_of_ours_is_told_counted_and_survived(listen: Listen, caplog: pytest.LogCaptureFixture) -> None:
    port = await listen()

    def fail(*_: object) -> None:
        raise ZeroDivisionError

    class Owner:
        name = "/owner"

        def tell(self, level: str, text: str) -> None:
            pass

    port.bus.subscribe(Owner(), "/t", fail, type_name="std_msgs/String")
    async with await Client.open(port.url) as client:
        await client.send("publish", topic="/t", msg={})
        assert (await client.take("status"))["level"] == "error"
        assert await client.settle() == []
    assert port.server.num_bugs == 1
    assert "ZeroDivisionError" in caplog.text


async def test_a_port_that_is_taken_is_an_os_error(listen: Listen) -> None:
    port = await listen()
    second = Server(port.bus, ServerLimits(), lambda: None)
    with pytest.raises(OSError, match="address already in use"):
        await second.start("127.0.0.1", port.server.port)

"""The port: limits of a connection, plain HTTP, and many independent clients."""

from __future__ import annotations

import asyncio
import json
import re
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from itertools import pairwise
from typing import NoReturn

import pytest
import pytest_asyncio
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State

from rosbridge_sim import __version__
from rosbridge_sim.errors import EncodingError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.protocol import png
from rosbridge_sim.protocol.outbox import OutboxLimits
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.kernels.backend import backend
from rosbridge_sim.shell.monitoring.log_limits import PLACE_BURST, TRACEBACK_COST
from rosbridge_sim.shell.websocket import connected_client, server, turns
from rosbridge_sim.shell.websocket.access import Access
from rosbridge_sim.shell.websocket.connected_client import Client as Served
from rosbridge_sim.shell.websocket.freed_memory import LARGE_FRAME
from rosbridge_sim.shell.websocket.http_pages import STOPPING
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.server import Server
from tests.graph.bus_fixture import make_store
from tests.shell.event_loops import EACH_LOOP, MakeLoop
from tests.support import PATIENCE, Client, mask, open_raw

PAUSE = 0.01
"""Between two looks at what takes time in a server that shares the loop [s]."""


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
            bus = Bus(make_store())
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
@EACH_LOOP
def test_many_throttle_rates_at_once_keep_the_server_alive(
    make_loop: MakeLoop,
) -> None:
    with asyncio.Runner(loop_factory=make_loop) as runner:
        runner.run(hear_at_many_rates())


async def test_clean_stop_closes_every_client_with_going_away(listen: Listen) -> None:
    port = await listen()
    clients = [await Client.open(port.url) for _ in range(3)]
    for client in clients:
        await client.settle()
    await port.server.stop()
    for client in clients:
        with pytest.raises(ConnectionClosed):
            await client.read()
        assert client.socket.close_code == 1001


async def test_small_frames_are_sent_at_once(listen: Listen) -> None:
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
        assert (await client.read())["op"] == "status"
        with pytest.raises(ConnectionClosed):
            await client.read()
        assert client.socket.close_code == 1009
        assert await other.settle() == []


async def test_frame_over_the_limit_is_refused_by_a_status_and_the_reason_names_the_flag(listen: Listen) -> None:
    port = await listen(ServerLimits(max_frame_size=4096))
    async with await Client.open(port.url) as client:
        await client.send_raw('{"op":"call_service","service":"/rosapi/get_time","id":"before"}')
        await client.send_raw("x" * 5_000)
        assert (await client.read())["id"] == "before"
        status = await client.read()
        assert (status["op"], status["level"]) == ("status", "error")
        assert "5,000 bytes in one frame, but --max-frame-size is 4,096" in status["msg"]
        assert "CBOR" in status["msg"]
        with pytest.raises(ConnectionClosed):
            await client.read()
        assert client.socket.close_code == 1009
        reason = "5,000 bytes in one frame, but --max-frame-size is 4,096; send CBOR or a CompressedImage"
        assert client.socket.close_reason == reason


async def test_default_limits_are_the_documented_ones() -> None:
    limits = ServerLimits()
    assert limits.max_frame_size == 16 * 2**20
    assert limits.ping_interval is not None
    assert limits.ping_timeout is not None
    assert not limits.is_compressing


@pytest.mark.slow
async def test_client_without_a_pong_is_disconnected_and_its_names_freed(listen: Listen) -> None:
    port = await listen(ServerLimits(ping_interval=0.05, ping_timeout=1.0))
    async with await Client.open(port.url) as watcher:
        # a socket that shakes hands, advertises a topic, and then is as dead as behind a pulled cable
        _, writer = await open_raw(port.server.port)
        writer.write(mask('{"op":"advertise","topic":"/t","type":"std_msgs/String"}'))
        async with asyncio.timeout(PATIENCE):
            while not (await watcher.values("/rosapi/publishers", {"topic": "/t"}))["publishers"]:
                pass
            while (await watcher.values("/rosapi/publishers", {"topic": "/t"}))["publishers"]:  # noqa: ASYNC110 - what is waited for tells nobody
                await asyncio.sleep(PAUSE)
        writer.close()
        await writer.wait_closed()


async def test_compression_is_off_by_default(listen: Listen) -> None:
    for is_compressing in (False, True):
        port = await listen(ServerLimits(is_compressing=is_compressing))
        async with connect(port.url, compression="deflate", proxy=None) as offering:
            extensions = offering.response.headers.get("Sec-WebSocket-Extensions", "") if offering.response else ""
            assert ("permessage-deflate" in extensions) is is_compressing


async def test_json_in_binary_frames_is_read(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        await client.send_raw(b'{"op":"call_service","service":"rosapi/topics","id":"b"}')
        assert (await client.take("service_response", id="b"))["result"] is True


async def test_ops_glued_in_one_frame_are_handled_in_order(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        ops = [
            {"op": "subscribe", "topic": "/t", "type": "std_msgs/Int32"},
            {"op": "publish", "topic": "/t", "msg": {"data": 1}},
            {"op": "publish", "topic": "/t", "msg": {"data": 2}},
        ]
        await client.send_raw("\n".join(json.dumps(op) for op in ops))
        assert [await client.message("/t") for _ in range(2)] == [{"data": 1}, {"data": 2}]


async def test_bare_nan_is_accepted_and_sent_as_null(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        await client.subscribe("/t", type="std_msgs/Float64")
        for value in ("NaN", "Infinity", "-Infinity", "null"):
            await client.send_raw('{"op":"publish","topic":"/t","msg":{"data":' + value + "}}")
            assert await client.message("/t") == {"data": None}


async def test_unicode_passes_unchanged(listen: Listen) -> None:
    port = await listen()
    text = '안녕하세요 é \u2028 🚗 \x7f \\ "'
    async with await Client.open(port.url) as client, await Client.open(port.url) as other:
        await other.subscribe("/말", type="std_msgs/String")
        await client.send("publish", topic="/말", type="std_msgs/String", msg={"data": text})
        await client.send_raw(
            json.dumps({"op": "publish", "topic": "/말", "msg": {"data": text}}, ensure_ascii=False).encode()
        )
        assert [await other.message("/말") for _ in range(2)] == [{"data": text}] * 2


async def test_messages_of_two_clients_do_not_mix(listen: Listen) -> None:
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


async def test_names_of_a_client_are_freed_when_it_leaves(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as watcher:
        client = await Client.open(port.url)
        await client.subscribe("/t", type="std_msgs/String")
        client.cut()
        async with asyncio.timeout(PATIENCE):
            while (await watcher.values("/rosapi/subscribers", {"topic": "/t"}))["subscribers"]:
                pass
        assert len(port.server.clients) == 1


async def test_stalled_client_costs_bounded_memory_and_no_other_client_a_message(listen: Listen) -> None:
    limits = OutboxLimits(burst=10, topic_bytes=2**20, hard_bytes=8 * 2**20)
    port = await listen(ServerLimits(outbox=limits))
    num_messages, size = 80, 150_000  # 12 MB: far more than the limit and a loopback socket's buffers together
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


async def test_client_with_too_many_unread_answers_is_disconnected_with_a_reason(
    listen: Listen, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (connected_client, server):  # the reason comes behind megabytes, which take a busy machine its time
        monkeypatch.setattr(module, "CLOSE_TIMEOUT", PATIENCE)
    port = await listen(UNREAD)
    lazy = await ask_and_never_read(port)
    async with await Client.open(port.url) as good:
        while all(client.socket.state is State.OPEN for client in port.server.clients):
            await good.settle()
            await asyncio.sleep(PAUSE)
        lazy.transport.resume_reading()
        with pytest.raises(ConnectionClosed, match=r"1008 .*unread"):
            await read_to_the_end(lazy)
        assert await good.settle() == []


@pytest.mark.slow
async def test_client_that_does_not_read_its_close_is_cut_off(listen: Listen) -> None:
    port = await listen(UNREAD)
    lazy = await ask_and_never_read(port)
    async with await Client.open(port.url) as good, asyncio.timeout(PATIENCE):
        while len(port.server.clients) > 1:
            await good.settle()
            await asyncio.sleep(PAUSE)
    lazy.transport.abort()


@pytest.mark.slow
async def test_stop_does_not_wait_for_a_stalled_client(listen: Listen) -> None:
    port = await listen(ServerLimits(ping_interval=None))
    lazy = await ask_and_never_read(port)
    async with asyncio.timeout(PATIENCE):
        await port.server.stop()
    assert not port.server.clients
    lazy.transport.abort()


@pytest.mark.slow
async def test_stop_does_not_wait_for_a_connection_without_a_request(listen: Listen) -> None:
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


async def test_text_that_is_not_utf_8_disconnects_after_earlier_requests_are_answered(listen: Listen) -> None:
    port = await listen()
    reader, writer = await open_raw(port.server.port)
    call = mask('{"op":"call_service","service":"/none","id":"before"}')
    writer.write(call + b"\x81\x81\0\0\0\0\xff" + mask('{"op":"call_service","service":"/none","id":"after"}'))
    async with asyncio.timeout(PATIENCE):
        said = await reader.read()
    assert b'"before"' in said
    assert b'"after"' not in said
    assert said.endswith(b"\x03\xeftext is not UTF-8: invalid start byte at byte 0")
    writer.close()
    async with await Client.open(port.url) as other:
        assert "/rosapi/topics" in (await other.values("/rosapi/services"))["services"]


@pytest.mark.parametrize("character", ["a", "가"])
async def test_half_closing_client_gets_its_answers(listen: Listen, character: str) -> None:
    port = await listen()
    reader, writer = await open_raw(port.server.port)
    text = json.dumps({"op": "status", "level": "info", "msg": character * 3_000_000}, ensure_ascii=False).encode()
    writer.write(b"\x81\xff" + len(text).to_bytes(8, "big") + bytes(4) + text)
    writer.write(mask('{"op":"call_service","service":"/none","id":"last"}'))
    writer.write_eof()
    async with asyncio.timeout(PATIENCE):
        assert b'"last"' in await reader.read()
    writer.close()


async def test_healthz_tells_the_state_as_json(listen: Listen) -> None:
    port = await listen()
    port.server.pages.describe = lambda: {"frame": 7}
    for target in ("/healthz", "/healthz?verbose=1"):
        status, body = await port.http(target)
        assert (status, json.loads(body)) == (
            200,
            {"status": "ok", "version": __version__, "frame": 7, "clients": 0},
        )
        assert '"status": "ok"' in body, "what a probe may look for"
    async with await Client.open(port.url) as client:
        await client.settle()
        assert json.loads((await port.http("/healthz"))[1])["clients"] == 1


async def test_healthz_tells_why_the_server_is_of_no_use(listen: Listen) -> None:
    port = await listen()
    port.server.pages.why_unhealthy = lambda: "it is Monday"
    status, body = await port.http("/healthz")
    health = json.loads(body)
    assert (status, health["status"], health["reason"]) == (503, "failed", "it is Monday")


async def test_healthz_says_so_while_the_server_shuts_down(listen: Listen) -> None:
    port = await listen()
    reader, writer = await asyncio.open_connection("127.0.0.1", port.server.port)
    writer.write(b"GET /healthz HTTP/1.1\r\n")
    async with asyncio.timeout(PATIENCE):
        while not port.server.num_bytes_received:  # noqa: ASYNC110 - it has no event for that
            await asyncio.sleep(0)
    stopping = asyncio.create_task(port.server.stop())
    await asyncio.sleep(0)
    writer.write(b"Host: localhost\r\n\r\n")
    async with asyncio.timeout(PATIENCE):
        answer = (await reader.read()).decode()
        await stopping
    writer.close()
    health = json.loads(answer.partition("\r\n\r\n")[2])
    assert (answer.split()[1], health["status"], health["reason"]) == ("503", "stopping", STOPPING)


async def test_healthz_keeps_details_for_those_who_show_the_token(listen: Listen) -> None:
    port = await listen(ServerLimits(access=Access(token="sesame", delay=0.0)))  # noqa: S106 - no secret
    assert await port.http("/healthz") == (200, '{"status": "ok"}\n')
    assert await port.http("/healthz", "Authorization: Bearer wrong") == (200, '{"status": "ok"}\n')
    status, body = await port.http("/healthz", "Authorization: Bearer sesame")
    assert (status, json.loads(body)["version"]) == (200, __version__)


@pytest.mark.parametrize("path", ["/healthz", "/"])
async def test_health_and_links_with_a_wrong_token_are_told_late(listen: Listen, path: str) -> None:
    port = await listen(ServerLimits(access=Access(token="sesame", delay=3600.0)))  # noqa: S106 - as above
    _, writer = await asyncio.open_connection("127.0.0.1", port.server.port)
    writer.write(f"GET {path}?token=guess HTTP/1.1\r\nHost: x\r\n\r\n".encode())
    async with asyncio.timeout(PATIENCE):
        while not port.server.num_strangers:  # noqa: ASYNC110 - it has no event for that
            await asyncio.sleep(0)
    assert (await port.http(path))[0] == 200, "others are answered at once"
    writer.close()


# Counters


async def test_counters_keep_what_clients_that_have_left_have_counted(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url) as client:
        await client.settle()
        await client.settle()
        during = port.server.traffic
        assert (during.num_clients, during.num_frames_received) == (1, 2)
        assert during.num_bytes_sent > 0
        num_bytes_received = port.server.num_bytes_received
        assert num_bytes_received > 100
    async with asyncio.timeout(PATIENCE):
        while port.server.clients or port.server._tables.sockets:  # noqa: ASYNC110 - it has no event for that
            await asyncio.sleep(0)
    assert port.server.traffic == during
    assert port.server.num_bytes_received > num_bytes_received, "its goodbye came, too"


async def test_page_of_metrics_is_there_where_it_is_rendered(listen: Listen, caplog: pytest.LogCaptureFixture) -> None:
    port = await listen()
    assert (await port.http("/metrics"))[0] == 404

    async def render(accept: str) -> tuple[bytes, str]:
        return accept.encode(), "text/x-test"

    async def fail(_: str) -> NoReturn:
        raise ZeroDivisionError

    port.server.pages.render_metrics = render
    assert await port.http("/metrics?x=1", "Accept: a", "Accept: b") == (200, "a, b")
    port.server.pages.render_metrics = fail
    assert await port.http("/metrics") == (500, "The server failed; its log says why\n")
    assert port.server.num_bugs == 1
    assert "ZeroDivisionError" in caplog.text


async def test_version_is_json(listen: Listen) -> None:
    port = await listen()
    for target in ("/version", "/version?token=needless"):
        status, body = await port.http(target)
        assert status == 200
        expected = {"name": "rosbridge-sim", "version": __version__, "protocol": "rosbridge v2.0"}
        assert json.loads(body) == {**expected, "backend": backend()}


async def test_plain_http_request_on_another_path_gets_an_explanation(listen: Listen) -> None:
    port = await listen()
    status, body = await port.http("/nothing")
    assert status == 404
    assert "/nothing" in body
    assert "rosbridge" in body
    status, body = await port.http("/", "Sec-WebSocket-Key: eA==")  # a proxy has taken the header Upgrade away
    assert status == 426
    assert re.search("websocket", body, re.IGNORECASE)


async def test_query_string_does_not_change_the_path(listen: Listen) -> None:
    port = await listen()
    async with await Client.open(port.url + "/?token=abc") as client:
        assert await client.settle() == []


async def test_internal_failure_is_logged_counted_and_survived(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    port = await listen()

    def fail(*_: object) -> None:
        raise ZeroDivisionError

    class Owner(Participant):
        name = "/owner"

        def notify(self, level: str, text: str) -> None:
            pass

    port.bus.subscribe(Owner(), "/t", fail, type_name="std_msgs/String")
    async with await Client.open(port.url) as client:
        await client.send("publish", topic="/t", msg={})
        assert (await client.take("status"))["level"] == "error"
        assert await client.settle() == []
    assert port.server.num_bugs == 1
    assert "ZeroDivisionError" in caplog.text


async def test_port_in_use_is_an_os_error(listen: Listen) -> None:
    port = await listen()
    second = Server(port.bus, ServerLimits(), lambda: None)
    with pytest.raises(OSError, match="address already in use"):
        await second.start("127.0.0.1", port.server.port)


# A failure of ours that belongs to one client


def break_down(*_: object) -> NoReturn:
    """Fail, as no part of the server does on purpose."""
    raise ZeroDivisionError


class PublishingComponent(Participant):
    """A part of the server that publishes, and remembers what it is told."""

    name = "/speaker"

    def __init__(self, port: Port, topic: str = "/t") -> None:
        self.bus = port.bus
        self.told: list[str] = []
        self.topic = port.bus.advertise(self, topic, "std_msgs/String")

    def notify(self, _level: str, text: str) -> None:
        self.told.append(text)

    def say(self, data: object) -> None:
        message_type = self.bus.store.message("std_msgs/String")
        self.bus.publish(self, self.topic, Message(message_type, message_type.struct_type(data=data)), 0.0)


async def connect_two(port: Port) -> tuple[tuple[Client, Served], tuple[Client, Served]]:
    """A client in which the test breaks something, and another one; each with what the server has of it."""
    clients = []
    for _ in range(2):
        clients.append(await Client.open(port.url))
        await clients[-1].settle()
    (first, second), (served_first, served_second) = clients, port.server.clients
    return (first, served_first), (second, served_second)


async def close_code_of(client: Client) -> int | None:
    """The code with which the server closes a client."""
    async with asyncio.timeout(PATIENCE):
        await client.socket.wait_closed()
    return client.socket.close_code


def num_bugs(port: Port) -> int:
    return port.server.num_bugs + port.bus.guard.num_faults


def failures(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What the log says of failures, each with its traceback."""
    return [record.getMessage() for record in caplog.records if record.exc_info]


async def test_client_that_fails_on_a_message_is_disconnected_alone(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    port = await listen()
    (bad, served), (good, _) = await connect_two(port)
    speaker = PublishingComponent(port)
    await bad.subscribe("/t")
    await good.subscribe("/t")
    served.peer.topics._subscriptions["/t"].feed._head = 5  # type: ignore[assignment] # as good a bug as any
    for data in ("a", "b", "c"):
        speaker.say(data)
    assert [(await good.message("/t"))["data"] for _ in range(3)] == ["a", "b", "c"]
    assert await close_code_of(bad) == 1011
    assert bad.socket.close_reason == "the server failed on this connection; its log says why"
    assert (num_bugs(port), speaker.told) == (1, [])
    assert [line.partition(": ")[2] for line in failures(caplog)] == ["closed because of an internal error"]
    assert served.peer not in port.bus.owners()
    await good.close()


async def test_unencodable_message_disconnects_no_client(listen: Listen, caplog: pytest.LogCaptureFixture) -> None:
    port = await listen()
    (first, _), (second, _) = await connect_two(port)
    speaker = PublishingComponent(port)
    await first.subscribe("/t")
    await second.subscribe("/t", compression="cbor")
    for data in ("a", object(), "b", object()):
        with suppress(EncodingError):
            speaker.say(data)
    assert [(await first.message("/t"))["data"] for _ in range(2)] == ["a", "b"]
    for data in ("a", "b"):
        assert (await second.read())["$cbor"]["msg"]["data"] == data
    assert (port.server.num_bugs, port.bus.guard.num_faults) == (0, 4)
    assert len(failures(caplog)) == 2  # one for each encoding
    await first.close()
    await second.close()


async def test_failed_png_disconnects_no_client(
    listen: Listen, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = await listen()
    (first, _), (second, _) = await connect_two(port)
    speaker = PublishingComponent(port)
    for client in (first, second):
        await client.subscribe("/t", compression="png")
    with monkeypatch.context() as patch:
        patch.setattr(png, "_file", break_down)
        speaker.say("a")
        assert [await client.settle() for client in (first, second)] == [[], []]
    speaker.say("b")
    for client in (first, second):
        assert (await client.read())["op"] == "png"
        await client.close()
    assert (port.server.num_bugs, port.bus.guard.num_faults) == (0, 2)
    assert [line.partition(":")[0] for line in failures(caplog)] == ["/t"]


async def test_client_that_fails_on_queued_messages_is_disconnected_alone(listen: Listen) -> None:
    port = await listen()
    (bad, served), (good, _) = await connect_two(port)
    speaker = PublishingComponent(port)
    for client in (bad, good):
        await client.subscribe("/t", throttle_rate=1, queue_length=10)
    served.peer.topics._subscriptions["/t"].feed._head = 5  # type: ignore[assignment] # as above
    served.peer.topics._subscriptions["/t"].feed.throttle._free_at = (
        served.socket.loop.time() + 0.005
    )  # so that the first one waits
    for data in ("a", "b", "c"):
        speaker.say(data)
    assert [(await good.message("/t"))["data"] for _ in range(3)] == ["a", "b", "c"]
    assert await close_code_of(bad) == 1011
    assert num_bugs(port) == 1
    await good.close()


def break_writing(served: Served) -> None:
    """Have it fail when bytes were handed to its socket."""
    served.num_bytes_sent = None  # type: ignore[assignment] # as good a bug as any


def break_leaving(served: Served) -> None:
    """Have it fail at a message, and then at giving up what it holds."""
    served.peer.topics._subscriptions["/t"].feed._head = 5  # type: ignore[assignment] # as above
    served.peer.topics._subscriptions = None  # type: ignore[assignment] # as above


def break_outbox(served: Served) -> None:
    """Have it fail at all that is sent to it."""
    served.outbox._frames = None  # type: ignore[assignment] # as above


@pytest.mark.parametrize("plant", [break_writing, break_leaving, break_outbox])
async def test_failing_client_is_disconnected_alone_at_every_place(
    listen: Listen, plant: Callable[[Served], None]
) -> None:
    port = await listen()
    (bad, served), (good, _) = await connect_two(port)
    speaker = PublishingComponent(port)
    for client in (bad, good):
        await client.subscribe("/t")
    await bad.send("advertise_service", service="/s", type="std_srvs/Trigger")
    await bad.settle()
    plant(served)
    speaker.say("a")
    assert (await good.message("/t"))["data"] == "a"
    assert await close_code_of(bad) == 1011
    assert await good.settle() == []
    assert served.peer not in port.bus.owners()
    assert "/s" not in port.bus.services
    assert port.bus.guard.num_faults >= 1
    assert speaker.told == []
    await good.close()


async def test_failing_provider_is_disconnected_and_its_caller_answered(listen: Listen) -> None:
    port = await listen()
    (bad, served), (good, _) = await connect_two(port)
    await bad.send("advertise_service", service="/s", type="std_srvs/Trigger")
    await bad.settle()
    served.peer.services._provided["/s"].num_given = None  # type: ignore[assignment] # as above
    answer = await good.call("/s")
    assert (answer["result"], answer["values"]) == (False, "The provider failed; the server's log says why")
    assert await close_code_of(bad) == 1011
    assert (await good.call("/s"))["values"] == "Service /s does not exist"
    assert num_bugs(port) == 1
    await good.close()


async def test_client_that_fails_on_its_own_message_is_handled_no_further(listen: Listen) -> None:
    port = await listen()
    (bad, served), (good, _) = await connect_two(port)
    PublishingComponent(port)
    for client in (bad, good):
        await client.subscribe("/t")
    served.peer.topics._subscriptions["/t"].feed._head = 5  # type: ignore[assignment] # as above
    head = '{"op":"publish","topic":"/t","msg":{"data":'
    await bad.send_raw(f'{head}"first"}}}}{head}"behind it"}}}}')
    assert (await good.message("/t"))["data"] == "first"
    assert await close_code_of(bad) == 1011
    assert await good.settle() == []
    assert num_bugs(port) == 1
    await good.close()


async def test_client_that_cannot_be_notified_of_a_failure_is_disconnected(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    port = await listen()
    (bad, served), (good, _) = await connect_two(port)
    break_outbox(served)
    await bad.send("publish", topic="/u", msg={})  # a mistake
    assert await close_code_of(bad) == 1011
    assert await good.settle() == []
    assert num_bugs(port) >= 2  # the remark on the mistake, and the one on that failure
    assert len(failures(caplog)) >= 2
    await good.close()


@pytest.mark.slow  # what it has not read yet keeps its closing waiting
async def test_client_that_fails_in_its_turn_does_not_take_the_turns_of_others(listen: Listen) -> None:
    port = await listen()
    (bad, served), (good, served_good) = await connect_two(port)
    releases = [one.peer.hold() for one in (served, served_good)]
    for client in (bad, good):
        for name in ("first", "second"):
            await client.send("call_service", service="/rosapi/get_time", id=name)
    async with asyncio.timeout(PATIENCE):
        while not all(one._has_input for one in (served, served_good)):  # noqa: ASYNC110 - what is waited for tells nobody
            await asyncio.sleep(0)
    served.socket._receiver = None  # as good a bug as any
    for release in releases:  # both wait for their turns now, the bad one first
        release()
    await good.take("service_response", id="second")
    assert await close_code_of(bad) == 1011
    assert num_bugs(port) == 1
    await good.close()


async def test_ping_of_a_client_is_answered_while_its_ops_wait(listen: Listen) -> None:
    port = await listen()
    (held, served), (other, _) = await connect_two(port)
    release = served.peer.hold()
    for id_ in ("first", "second"):
        await held.send("call_service", service="/rosapi/get_time", id=id_)
        async with asyncio.timeout(PATIENCE):
            await (await held.socket.ping())  # without an answer to it, the client closes the connection
            await (await served.socket.ping())  # and without the client's pong the server does
    assert await other.settle() == []
    release()
    answers = [(await held.take("service_response"))["id"] for _ in range(2)]
    assert answers == ["first", "second"]
    await held.close()
    await other.close()


@pytest.mark.slow
async def test_end_of_a_client_whose_ops_wait_is_noticed(listen: Listen) -> None:
    port = await listen(ServerLimits(ping_interval=None))
    (held, served), (other, _) = await connect_two(port)
    release = served.peer.hold()
    await held.send("call_service", service="/rosapi/get_time", id="waits")
    held.socket.transport.abort()  # as the system does for a process that is killed
    async with asyncio.timeout(PATIENCE):
        while served.peer in port.bus.owners():  # noqa: ASYNC110 - what is waited for tells nobody
            await asyncio.sleep(PAUSE)
    release()
    assert await other.settle() == []
    await other.close()


@pytest.mark.parametrize("seam", ["close", "forget"])
async def test_client_that_cannot_be_closed_is_cut_off(
    listen: Listen, monkeypatch: pytest.MonkeyPatch, seam: str
) -> None:
    port = await listen()
    (bad, served), (good, _) = await connect_two(port)
    speaker = PublishingComponent(port)
    for client in (bad, good):
        await client.subscribe("/t")
    served.peer.topics._subscriptions["/t"].feed._head = 5  # type: ignore[assignment] # as good a bug as any
    monkeypatch.setattr(served.socket, seam, break_down)
    speaker.say("a")
    assert (await good.message("/t"))["data"] == "a"
    assert await close_code_of(bad) == 1006
    assert served.peer not in port.bus.owners()
    await good.close()


async def test_client_whose_token_check_fails_is_disconnected(listen: Listen) -> None:
    port = await listen(ServerLimits(access=Access(token=5)))  # type: ignore[arg-type] # as good a bug as any
    client = await Client.open(port.url)
    await client.send("auth", token="5")  # noqa: S106 - opens nothing
    assert await close_code_of(client) == 1011
    assert num_bugs(port) == 1


@pytest.mark.slow  # as above
async def test_connection_that_cannot_be_served_is_refused_counted_and_logged(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    port = await listen()
    async with await Client.open(port.url) as good:
        await good.settle()
        bus, port.server._bus = port.server._bus, None  # type: ignore[assignment] # as good a bug as any
        bad = await Client.open(port.url)
        assert await close_code_of(bad) == 1011
        port.server._bus = bus
        assert await good.settle() == []
    assert port.server.num_bugs == 1
    assert [line.rpartition(" could ")[2] for line in failures(caplog)] == ["not be served"]


async def test_failing_request_and_failing_watcher_are_counted_and_survived(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    port = await listen()
    port.server.pages.why_unhealthy = break_down
    assert await port.http("/healthz") == (500, "The server failed; its log says why\n")
    port.server.on_clients = break_down
    async with await Client.open(port.url) as client:
        assert await client.settle() == []
        assert port.server.num_bugs == 2
    assert len(failures(caplog)) >= 2


async def test_memory_is_given_back_after_a_small_frame_that_holds_a_large_one(listen: Listen) -> None:
    port = await listen()
    picture = png.PngFrame(b'{"op":"unsubscribe","topic":"/t"}'.ljust(LARGE_FRAME))
    while not picture.work():
        pass
    assert picture.frame is not None
    assert len(picture.frame) < LARGE_FRAME // 100
    memory = port.server._memory
    assert memory is not None
    async with await Client.open(port.url) as client:
        await client.settle()
        assert memory._after_frames is None
        await client.socket.send(picture.frame.decode())
        await client.settle()
        assert memory._after_frames is not None


@pytest.mark.slow
async def test_hundred_failing_clients_are_disconnected_with_a_short_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with Simulator(port=0, world=False) as sim, AsyncExitStack() as stack:
        clients = [await stack.enter_async_context(await Client.open(sim.url)) for _ in range(101)]
        for client in clients:
            await client.subscribe("/t", type="std_msgs/String")
        *bad, good = clients
        assert sim._server is not None
        for served in list(sim._server.clients)[:-1]:
            served.peer.topics._subscriptions["/t"].feed._head = 5  # type: ignore[assignment] # as good a bug as any
        for data in ("a", "b"):
            await good.send("publish", topic="/t", msg={"data": data})
            assert (await good.message("/t"))["data"] == data
        assert {await close_code_of(client) for client in bad} == {1011}
        assert await good.settle() == []
        assert sim.num_bugs == 100
    least = PLACE_BURST / TRACEBACK_COST
    assert least <= len(failures(caplog)) < 2 * least  # on a busy machine there is time for more than the burst
    told = [re.search(r"(\d+) more lines of connected_client.py", line) for line in caplog.messages]
    assert len(failures(caplog)) + sum(int(found[1]) for found in told if found) == 100


async def test_heavy_message_to_many_subscribers_is_sent_in_several_passes(
    listen: Listen, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame, num = 400_000, 12
    monkeypatch.setattr(turns, "ROUND_BYTES", 2 * frame)
    port = await listen()
    loop, clients, is_over = asyncio.get_running_loop(), port.server.clients, False
    seen = [0]

    def look() -> None:
        seen.append(sum(client.num_bytes_sent for client in clients))
        if not is_over:
            loop.call_soon(look)

    async with AsyncExitStack() as stack:
        publisher = await stack.enter_async_context(await Client.open(port.url))
        await publisher.send("advertise", topic="/s", type="std_msgs/String")
        await publisher.settle()
        listeners = [await stack.enter_async_context(await Client.open(port.url)) for _ in range(num)]
        for listener in listeners:
            await listener.send("subscribe", topic="/s")
            await listener.settle()
        look()
        await publisher.send("publish", topic="/s", msg={"data": "x" * frame})
        for listener in listeners:
            assert len((await listener.message("/s"))["data"]) == frame
        is_over = True
    rises = [after - before for before, after in pairwise(seen[1:])]
    assert sum(rises) >= num * frame
    assert max(rises) < 5 * frame  # what a round has left, and one frame more; the end of one round and the next

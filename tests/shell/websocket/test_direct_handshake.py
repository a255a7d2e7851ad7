"""Handshakes over sockets: those that the server answers by itself, and those that it leaves to the library."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, closing, suppress
from http.client import HTTPConnection

import pytest
import pytest_asyncio

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.link.websocket_internals import LAST_ANSWERS
from rosbridge_sim.shell.transport import request_reading
from rosbridge_sim.shell.transport.request_reading import MAX_EARLY
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.server import Server
from tests.graph.bus_fixture import make_store
from tests.support import PATIENCE, Client, mask, open_raw

REQUEST = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
CALL = '{"op":"call_service","service":"/rosapi/get_time","id":"c"}'
FOR_EVER = 3_600.0

Listen = Callable[..., Awaitable[Server]]


@pytest_asyncio.fixture
async def listen() -> AsyncIterator[Listen]:
    """Servers with limits of the test's own."""
    async with AsyncExitStack() as stack:

        async def start(**limits: float) -> Server:
            bus = Bus(make_store())
            Rosapi(bus)
            server = Server(bus, ServerLimits(**limits), lambda: None)  # type: ignore[arg-type] # each of its own type
            await server.start("127.0.0.1", 0)
            stack.push_async_callback(server.stop)
            return server

        yield start


PAUSE = 0.002
"""Between two looks at a server that shares the loop [s]: some waits are for time to pass, which needs no busy core."""


async def until(is_so: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not is_so():  # noqa: ASYNC110 - no event tells of it
            await asyncio.sleep(PAUSE)


def num_tasks() -> int:
    """Number of the library's tasks for connections."""
    return sum("_handler" in repr(task.get_coro()) for task in asyncio.all_tasks())


async def head_of(reader: asyncio.StreamReader) -> bytes:
    async with asyncio.timeout(PATIENCE):
        return await reader.readuntil(b"\r\n\r\n")


async def frame_of(reader: asyncio.StreamReader) -> tuple[int, bytes]:
    """First byte and content of the next frame."""
    async with asyncio.timeout(PATIENCE):
        first, size = await reader.readexactly(2)
        if size == 126:
            size = int.from_bytes(await reader.readexactly(2), "big")
        return first, await reader.readexactly(size)


async def rest_of(reader: asyncio.StreamReader) -> bytes:
    """What comes until the end of the connection."""
    data = b""
    with suppress(ConnectionError):
        async with asyncio.timeout(PATIENCE):
            while more := await reader.read(2**16):
                data += more
    return data


async def assert_answered(reader: asyncio.StreamReader) -> None:
    first, content = await frame_of(reader)
    assert first == 0x81
    assert json.loads(content)["op"] == "service_response"


async def test_ordinary_request_costs_no_task(listen: Listen) -> None:
    server = await listen()
    async with await Client.open(f"ws://127.0.0.1:{server.port}") as client:
        await client.settle()
        assert (num_tasks(), len(server.clients)) == (0, 1)
    await until(lambda: not server.clients)
    assert not server._tables.sockets


@pytest.mark.parametrize("size", [1, 7, len(REQUEST) - 1])
async def test_request_in_parts_is_answered_by_the_library(listen: Listen, size: int) -> None:
    server = await listen(open_timeout=FOR_EVER)
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    data = REQUEST + mask(CALL)
    for start in range(0, len(data), size):
        received = sum(each.num_bytes_received for each in server._tables.sockets)
        writer.write(data[start : start + size])
        await until(lambda: sum(each.num_bytes_received for each in server._tables.sockets) > received)  # noqa: B023 - at once
    assert (await head_of(reader)).startswith(b"HTTP/1.1 101")
    await assert_answered(reader)
    assert num_tasks() == 1
    writer.close()
    await until(lambda: not server._tables.sockets)
    await until(lambda: not num_tasks())


async def test_frames_behind_the_request_are_handled(listen: Listen) -> None:
    server = await listen()
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(REQUEST + mask(CALL) * 3 + mask(CALL)[:-1])
    assert (await head_of(reader)).startswith(b"HTTP/1.1 101")
    for _ in range(3):
        await assert_answered(reader)
    writer.write(mask(CALL)[-1:])
    await assert_answered(reader)
    assert num_tasks() == 0
    writer.close()


async def test_too_much_behind_the_request_is_cut_off(listen: Listen) -> None:
    server = await listen()
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(REQUEST + mask("x" * (MAX_EARLY + 1)))
    assert b" 101 " not in await rest_of(reader)
    assert not server.clients
    writer.close()


@pytest.mark.parametrize("first", [b"", b"G", REQUEST[:-1], b"GET /healthz HTTP/1.1\r\n"])
async def test_connection_without_a_whole_request_leaves_nothing(listen: Listen, first: bytes) -> None:
    server = await listen(open_timeout=0.05)
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(first)
    assert await rest_of(reader) == b""
    await until(lambda: not server._tables.sockets)
    await until(lambda: not num_tasks())
    assert not len(server._tables.opening)
    writer.close()


NOT_ASCII = b"GET /?token=\xff HTTP/1.1\r\nHost: x\r\n\r\n"
POST = b'POST %s HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\n{"op": 1}'

UNREADABLE = [
    pytest.param(b"no request\r\n", 400, b"HTTP/1.1", id="no HTTP"),
    pytest.param(b"GET / HTTP/2.0\r\n", 400, b"HTTP/1.1", id="another version"),
    pytest.param(b"GET / HTTP/1.1\n", 400, b"HTTP/1.1", id="a bare line feed"),
    pytest.param(NOT_ASCII, 400, b"ASCII", id="not ASCII"),
    pytest.param(b"GET / HTTP/1.1\r\nHost\r\n\r\n", 400, b"headers", id="no header"),
    pytest.param(POST % b"/", 405, b"GET or HEAD", id="a body"),
    pytest.param(POST % b"/healthz", 405, b"GET or HEAD", id="a body for a page"),
    pytest.param(b"PUT / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 405, b"GET", id="chunks"),
    pytest.param(b"GET / HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc", 400, b"body", id="GET with a body"),
    pytest.param(b"GET /" + b"x" * 9_000 + b" HTTP/1.1\r\n\r\n", 431, b"8,192", id="a long line"),
    pytest.param(b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 200 + b"\r\n", 431, b"128 headers", id="many headers"),
]


@pytest.mark.parametrize(("request_", "status", "text"), UNREADABLE)
async def test_request_that_cannot_be_read_is_answered(
    listen: Listen, request_: bytes, status: int, text: bytes
) -> None:
    server = await listen(open_timeout=FOR_EVER)
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(request_)
    head, _, body = (await rest_of(reader)).partition(b"\r\n\r\n")
    first, *headers = head.split(b"\r\n")
    assert first.startswith(b"HTTP/1.1 %d " % status)
    assert text in body
    assert b"Content-Length: %d" % len(body) in headers
    assert b"Connection: close" in headers
    assert (b"Allow: GET, HEAD" in headers) == (status == 405)
    writer.close()
    await until(lambda: not server._tables.sockets)


async def test_program_that_sends_a_long_body_first_reads_the_answer(listen: Listen) -> None:
    server = await listen()
    body = bytes(4 * 2**20)

    def post() -> tuple[int, bytes]:
        connection = HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE)
        with closing(connection):
            connection.request("POST", "/", body)
            answer = connection.getresponse()
            return answer.status, answer.read()

    status, text = await asyncio.to_thread(post)
    assert (status, b"GET or HEAD" in text) == (405, True)


async def test_refused_request_that_never_ends_is_cut_off(
    listen: Listen, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(request_reading, "MAX_DISCARDED", 100_000)
    server = await listen(open_timeout=FOR_EVER)
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(b"no request\r\n")
    assert (await rest_of(reader)).startswith(b"HTTP/1.1 400")
    writer.write(bytes(MAX_EARLY + 1))
    await until(lambda: any(each.num_early > MAX_EARLY for each in server._tables.sockets))  # still reading
    writer.write(bytes(100_000))
    await until(lambda: not server._tables.sockets)
    assert [record for record in caplog.records if record.exc_info] == []
    writer.close()


class _Clock:
    """The time of a loop, which a test moves on."""

    def __init__(self, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch) -> None:
        self.slept = 0.0
        time = loop.time
        monkeypatch.setattr(loop, "time", lambda: time() + self.slept)


async def test_machine_that_slept_still_reads_the_request_that_waits(
    listen: Listen, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = await listen()
    clock = _Clock(asyncio.get_running_loop(), monkeypatch)
    with socket.create_connection(("127.0.0.1", server.port)) as far:
        await until(lambda: bool(server._tables.sockets))
        clock.slept = 3_600.0  # the timer is due before the loop reads
        for _ in range(3):
            await asyncio.sleep(0)
        assert server._tables.sockets
        far.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
        reader, writer = await asyncio.open_connection(sock=far)
        assert (await head_of(reader)).startswith(b"HTTP/1.1 200")
        writer.close()


async def test_complete_request_outlives_the_time_for_the_request(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    server = await listen(open_timeout=0.02)
    may_answer = asyncio.Event()

    async def render(_accepted: str) -> tuple[bytes, str]:
        await may_answer.wait()
        return b"late", "text/plain"

    server.pages.render_metrics = render
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n")
    await until(lambda: any(each.has_request for each in server._tables.sockets))
    silent, silent_writer = await asyncio.open_connection("127.0.0.1", server.port)
    assert await rest_of(silent) == b""  # it came later, and its time is over
    may_answer.set()
    assert (await rest_of(reader)).endswith(b"late")
    assert not caplog.records
    writer.close()
    silent_writer.close()


async def test_answer_that_takes_too_long_is_503_and_a_log_line(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    server = await listen(answer_timeout=0.02)

    async def render(_accepted: str) -> tuple[bytes, str]:
        await asyncio.get_running_loop().create_future()
        raise AssertionError

    server.pages.render_metrics = render
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(b"GET /metrics?token=secret HTTP/1.1\r\nHost: localhost\r\n\r\n")
    answer = await rest_of(reader)
    assert answer.startswith(b"HTTP/1.1 503 ")
    assert answer.endswith(b"The server is busy; try again\n")
    port = writer.get_extra_info("sockname")[1]
    writer.close()
    [line] = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert line == f"127.0.0.1:{port} got no answer to /metrics in 0.02 s and was sent 503; the server is busy"
    assert server.num_bugs == 0


async def test_slow_reader_gets_all_of_a_long_answer(listen: Listen) -> None:
    server = await listen()
    body = bytes(8 * 2**20)

    async def render(_accepted: str) -> tuple[bytes, str]:
        return body, "text/plain"

    server.pages.render_metrics = render
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port, limit=1_000)
    writer.write(b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n")
    await until(lambda: any(each.num_bytes_unsent for each in server._tables.sockets))
    [socket_] = server._tables.sockets
    assert socket_.close_timeout == LAST_ANSWERS  # the library's own second would cut it off
    assert len((await rest_of(reader)).partition(b"\r\n\r\n")[2]) == len(body)
    writer.close()


async def test_open_connection_outlives_the_time_for_the_request(listen: Listen) -> None:
    server = await listen(open_timeout=0.02)
    reader, writer = await open_raw(server.port)
    silent, silent_writer = await asyncio.open_connection("127.0.0.1", server.port)
    assert await rest_of(silent) == b""  # it came later, and its time is over
    writer.write(mask(CALL))
    await assert_answered(reader)
    silent_writer.close()
    writer.close()


async def test_client_that_answers_pings_stays(listen: Listen) -> None:
    server = await listen(ping_interval=0.01, ping_timeout=FOR_EVER)
    reader, writer = await open_raw(server.port)
    pings = []
    for _ in range(4):
        first, content = await frame_of(reader)
        assert first == 0x89
        pings.append(content)
        writer.write(bytes([0x8A, 0x80 | len(content)]) + bytes(4) + content)
    assert len(set(pings)) == 4  # each waits for the answer to the one before
    writer.write(mask(CALL))
    while (frame := await frame_of(reader))[0] == 0x89:
        pass
    assert frame[0] == 0x81
    writer.close()
    await until(lambda: not server._tables.sockets)


async def test_client_that_answers_no_ping_is_closed(listen: Listen) -> None:
    server = await listen(ping_interval=0.01, ping_timeout=0.01)
    reader, writer = await open_raw(server.port)
    frames = await rest_of(reader)
    assert frames[:2] == b"\x89\x04"
    assert frames[6:] == b"\x88\x18\x03\xf3keepalive ping timeout"  # 1011, after one ping
    writer.close()
    await until(lambda: not server.clients)


async def test_silent_connection_does_not_delay_the_stop(listen: Listen) -> None:
    server = await listen(open_timeout=FOR_EVER)
    silent, writer = await asyncio.open_connection("127.0.0.1", server.port)
    await until(lambda: bool(server._tables.sockets))
    async with asyncio.timeout(PATIENCE):
        await server.stop()
    assert await rest_of(silent) == b""
    assert not server._tables.sockets
    writer.close()


async def test_failure_to_serve_an_ordinary_request_closes_it_alone(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    server = await listen()
    good, writer = await open_raw(server.port)
    turns, server._turns = server._turns, None  # as good a bug as any
    bad, bad_writer = await open_raw(server.port)
    assert (await rest_of(bad))[:4] == b"\x88\x02\x03\xf3"
    server._turns = turns
    writer.write(mask(CALL))
    await assert_answered(good)
    assert server.num_bugs == 1
    (line,) = [record.getMessage() for record in caplog.records if record.exc_info]
    assert line.endswith("could not be served")
    bad_writer.close()
    writer.close()

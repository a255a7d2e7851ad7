"""Access and rate limits: refused clients get a reason, other clients are unaffected."""

from __future__ import annotations

import asyncio
import json
import logging
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from socket import gethostname
from typing import Any
from urllib.parse import quote

import pytest
import pytest_asyncio
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from websockets.asyncio.client import connect as connect_socket
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException

from rosbridge_sim import DocumentError, Simulator
from rosbridge_sim.client import AsyncClient, ConnectError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.websocket import connections
from rosbridge_sim.shell.websocket.access import (
    LEAST_BURST,
    MAX_SHOWN_TOKENS,
    Access,
    RateGate,
    TokenBucket,
    load_certificate,
)
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.origins import OriginRules, own_names
from rosbridge_sim.shell.websocket.server import Server
from tests import fork_server
from tests.conftest import Connect, Serve
from tests.graph.bus_fixture import make_store
from tests.shell.event_loops import EACH_LOOP, MakeLoop
from tests.support import PATIENCE, ROOT, Client

TOKEN = "s3cret/+="  # noqa: S105 - a test's own

BEARER = {"Authorization": f"Bearer {TOKEN}"}


async def enter(url: str, headers: dict[str, str] | None = None, context: ssl.SSLContext | None = None) -> Client:
    """A client whose handshake has headers of its own."""
    return Client(
        await connect_socket(
            url, additional_headers=headers, ssl=context, compression=None, ping_interval=None, proxy=None
        )
    )


async def turned_away(url: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    """Status, text and headers with which a handshake is refused."""
    with pytest.raises(InvalidStatus) as caught:
        await enter(url, headers)
    response = caught.value.response
    assert response.body is not None
    return response.status_code, response.body.decode(), dict(response.headers.raw_items())


async def read_to_the_end(client: Client) -> list[dict[str, Any]]:
    """All that still comes before the connection is closed."""
    frames = list(client.inbox)
    async with asyncio.timeout(PATIENCE):
        try:
            while True:
                frames.append(json.loads(await client.socket.recv()))
        except ConnectionClosed:
            return frames


class Pair:
    """Two clients that are let in and talk to each other, whatever happens around them."""

    def __init__(self, talker: Client, listener: Client) -> None:
        self._talker = talker
        self._listener = listener
        self._count = 0

    async def go_on(self) -> None:
        """One more message goes from the one to the other, and neither has heard anything else."""
        self._count += 1
        await self._talker.send("publish", topic="/pair", type="std_msgs/Int32", msg={"data": self._count})
        assert await self._listener.message("/pair") == {"data": self._count}
        assert await self._talker.settle() == []
        assert await self._listener.settle() == []


Listen = Callable[..., Awaitable[tuple[str, Server]]]
Pairs = Callable[..., Awaitable[Pair]]


@pytest_asyncio.fixture
async def listen() -> AsyncIterator[Listen]:
    """Servers over a bus with nothing but rosapi on it, with rules of the test's own."""
    async with AsyncExitStack() as stack:

        async def start(**rules: Any) -> tuple[str, Server]:  # noqa: ANN401 - each rule of its own type
            bus = Bus(make_store())
            Rosapi(bus)
            server = Server(bus, ServerLimits(access=Access(**{"delay": 0.0, **rules})), lambda: None)
            await server.start("127.0.0.1", 0)
            stack.push_async_callback(server.stop)
            return f"ws://127.0.0.1:{server.port}", server

        yield start


@pytest_asyncio.fixture
async def pairs() -> AsyncIterator[Pairs]:
    async with AsyncExitStack() as stack:

        async def make(url: str, **headers: str) -> Pair:
            talker, listener = [await stack.enter_async_context(await enter(url, headers)) for _ in range(2)]
            await listener.subscribe("/pair", type="std_msgs/Int32")
            return Pair(talker, listener)

        yield make


# The token


async def test_wrong_token_in_the_handshake_is_refused_without_effect_on_others(listen: Listen, pairs: Pairs) -> None:
    url, server = await listen(token=TOKEN)
    pair = await pairs(url, **BEARER)
    for refused in (
        await turned_away(url, Authorization="Bearer wrong"),
        await turned_away(url, Authorization=f"bearer {TOKEN}x"),
        await turned_away(f"{url}/?token=wrong"),
        await turned_away(f"{url}?token={TOKEN[:-1]}&token="),
    ):
        status, text, headers = refused
        assert (status, text) == (401, "The token is wrong\n")
        assert headers["WWW-Authenticate"] == "Bearer"
        await pair.go_on()
    assert len(server.clients) == 2


@pytest.mark.parametrize(
    ("query", "headers"),
    [
        ("", BEARER),
        ("", {"Authorization": f"bearer   {TOKEN}"}),
        ("/?token=s3cret%2F%2B%3D", {}),
        ("?a=b&token=s3cret/%2B=", {}),
        ("/?token=s3cret/%2B=", {"Authorization": "Basic abc"}),
        ("/?token=wrong", BEARER),
    ],
)
async def test_token_in_the_handshake_is_accepted(listen: Listen, query: str, headers: dict[str, str]) -> None:
    url, _ = await listen(token=TOKEN)
    async with await enter(url + query, headers) as client:
        assert await client.settle() == []


async def test_request_with_too_many_tokens_is_refused(listen: Listen) -> None:
    url, _ = await listen(token=TOKEN, delay=0.0)
    right = f"token={quote(TOKEN)}"
    async with await enter(f"{url}/?token=wrong&{right}", BEARER) as client:
        assert await client.settle() == []
    guesses = "&".join(f"token={i}" for i in range(MAX_SHOWN_TOKENS))
    assert (await turned_away(f"{url}/?{guesses}&{right}"))[0] == 401
    assert (await turned_away(f"{url}/?{right}&{guesses}"))[0] == 401


async def test_any_token_is_accepted_without_a_set_one(listen: Listen) -> None:
    url, _ = await listen()
    async with await enter(f"{url}/?token=x", {"Authorization": "Bearer y"}) as client:
        await client.send("auth", token="z")  # noqa: S106 - a test's own
        await client.send("auth", mac="x", client="x", dest="x", rand="x", t=0, level="x", end=0)
        assert await client.settle() == []


@pytest.mark.client
@pytest.mark.slow
async def test_token_header_of_roslibpy_is_accepted(listen: Listen) -> None:
    _, server = await listen(token=TOKEN)
    program = (
        "import roslibpy, sys\n"
        f"ros = roslibpy.Ros('127.0.0.1', {server.port}, headers={BEARER})\n"
        "ros.run()\n"
        "print(sorted(ros.get_services())[0])\n"
        "ros.terminate()\n"
    )
    async with asyncio.timeout(3 * PATIENCE):
        done = await asyncio.to_thread(fork_server.run, ["-c", program])
    assert done.stdout.startswith("/rosapi/"), done.stderr


# Pages


async def test_refused_page_gets_a_reason_without_effect_on_others(listen: Listen, pairs: Pairs) -> None:
    url, server = await listen(origins=OriginRules(("https://app.example",)))
    pair = await pairs(url, Origin="https://app.example")
    status, text, _ = await turned_away(url, Origin="https://evil.example")
    assert status == 403
    assert text == (
        "Pages from https://evil.example may not connect here; --allow-origin https://evil.example would let them\n"
    )
    await pair.go_on()
    assert len(server.clients) == 2


async def shake_hands(port: int, *lines: str, path: str = "/") -> tuple[int, str]:
    """Status and body of the answer to a handshake with these lines, as they are."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    key = f"Sec-WebSocket-Key: {'A' * 22}=="
    rest = ("Upgrade: websocket", "Connection: Upgrade", key, "Sec-WebSocket-Version: 13")
    writer.write("\r\n".join([f"GET {path} HTTP/1.1", *lines, *rest, "", ""]).encode("latin-1"))
    async with asyncio.timeout(PATIENCE):
        status = int((await reader.readuntil(b"\r\n\r\n")).split()[1])
        body = "" if status == 101 else (await reader.read()).decode()
    writer.close()
    return status, body


async def test_handshake_with_the_token_needs_no_origin_or_host(listen: Listen) -> None:
    _, server = await listen(token=TOKEN)
    headers = ("Origin: http://rebound.example", "Host: rebound.example")
    bearer = f"Authorization: Bearer {TOKEN}"
    assert await shake_hands(server.port, *headers, bearer) == (101, "")
    assert await shake_hands(server.port, *headers, path=f"/?token={quote(TOKEN)}") == (101, "")
    for path in ("/", "/?token=wrong"):
        status, text = await shake_hands(server.port, *headers, path=path)
        assert status == 403
        assert "--allow-host rebound.example" in text


async def test_token_without_a_set_one_does_not_replace_the_origin_check(listen: Listen) -> None:
    url, _ = await listen()
    status, _, _ = await turned_away(f"{url}/?token=", Origin="http://page.example")
    assert status == 403


async def test_refused_page_is_one_warning_with_the_flag_to_use(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "rosbridge_sim.server")
    url, _ = await listen()
    for origin in ("http://a.example", "http://a.example", "HTTP://A.example", "http://b.example", "http://a.example"):
        await turned_away(url, Origin=origin)
    refusals = [record for record in caplog.records if "refused" in record.getMessage()]
    assert [record.levelno == logging.WARNING for record in refusals] == [True, False, False, True, False]
    assert "--allow-origin http://a.example " in refusals[0].getMessage()
    assert "--allow-origin http://b.example " in refusals[3].getMessage()


async def test_many_refused_origins_end_in_one_summary_line(
    listen: Listen, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rosbridge_sim.shell.websocket.origins.MAX_REFUSED_ORIGINS", 3)
    url, _ = await listen()
    for i in range(6):
        await turned_away(url, Origin=f"http://{i}.example")
    warnings = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert [f"http://{i}.example" in warnings[i] for i in range(3)] == [True] * 3
    assert len(warnings) == 4
    assert "further ones" in warnings[3]


async def test_retrying_page_does_not_hide_the_warning_for_another(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO, "rosbridge_sim.server")
    monkeypatch.setattr("rosbridge_sim.shell.monitoring.log_limits.PLACE_BURST", 5.0)
    monkeypatch.setattr("rosbridge_sim.shell.monitoring.log_limits.PLACE_RATE", 0.0)
    async with Simulator(port=0, world=False) as sim:
        for _ in range(10):
            assert (await shake_hands(sim.port, "Host: localhost", "Origin: http://a.example"))[0] == 403
        assert (await shake_hands(sim.port, "Host: localhost", "Origin: http://b.example"))[0] == 403
    warnings = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert [f"--allow-origin http://{name}.example" in warnings[i] for i, name in enumerate("ab")] == [True, True]


async def test_duplicate_or_missing_header_is_reported(listen: Listen) -> None:
    _, server = await listen()

    host, origin = "Host: localhost", "Origin: http://localhost:3000"
    refused = (403, "Expected one Origin header; got 2\n")
    assert await shake_hands(server.port, host, origin, origin) == refused
    for hosts in ((), (host, host), (host, "Host: evil.example")):
        refused = (403, f"Expected one Host header beside an Origin; got {len(hosts)}\n")
        assert await shake_hands(server.port, origin, *hosts) == refused
    for bad in ("Origin:", "Origin: http://\xe9vil.example"):
        status, text = await shake_hands(server.port, host, bad)
        assert (status, text[:26]) == (403, "Expected an Origin such as")
    for lines in ((), ("Host: evil.example",), (host, origin)):
        assert await shake_hands(server.port, *lines) == (101, "")


async def get(port: int, path: str, *lines: str) -> tuple[int, str]:
    """Status and body of the answer to a plain request with these lines."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write("\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode())
    async with asyncio.timeout(PATIENCE):
        head, _, body = (await reader.read()).decode().partition("\r\n\r\n")
    writer.close()
    return int(head.split()[1]), body


DATA = ("/map.json", "/log.json", "/metrics", "/version")
"""Paths with data."""


async def test_data_over_http_need_a_known_host_with_and_without_an_origin(caplog: pytest.LogCaptureFixture) -> None:
    rebound = "Host: rebound.example:9090"
    async with Simulator(port=0) as sim:
        for path in DATA:
            for lines in ((rebound,), (rebound, "Origin: http://rebound.example:9090"), (rebound, "Origin: null")):
                status, text = await get(sim.port, path, *lines)
                assert (status, "--allow-host rebound.example " in text) == (403, True), (path, lines)
            for host in ("localhost", f"127.0.0.1:{sim.port}", "[::1]", gethostname(), "sim.localhost"):
                assert (await get(sim.port, path, f"Host: {host}"))[0] == 200, (path, host)
            assert await get(sim.port, path) == (403, "Expected one Host header; got 0\n")
    warnings = [record.getMessage() for record in caplog.records if "refused: " in record.getMessage()]
    assert len(warnings) == 1, "one for each host"
    assert "--allow-host rebound.example " in warnings[0]


async def test_data_over_http_are_told_to_a_host_of_the_flag_and_to_those_with_the_token() -> None:
    host = "Host: simulator:9090"
    async with Simulator(port=0, allow_host="simulator") as sim:
        for path in DATA:
            assert (await get(sim.port, path, host))[0] == 200
            assert (await get(sim.port, path, "Host: other"))[0] == 403
    async with Simulator(port=0, token=TOKEN) as sim:
        for path in DATA:
            assert (await get(sim.port, path, host, f"Authorization: Bearer {TOKEN}"))[0] == 200
            assert (await get(sim.port, path, "Host: localhost"))[0] == 401


async def test_page_about_access_names_each_path_that_needs_the_token() -> None:
    text = (ROOT / "docs/reference/access.md").read_text("utf-8")
    async with Simulator(port=0, token=TOKEN) as sim:
        links = json.loads((await get(sim.port, "/"))[1])["links"].values()
        closed = [path for path in links if (await get(sim.port, f"/{path}"))[0] == 401]
    assert len(closed) == 4
    [row_of_token] = [line for line in text.splitlines() if line.startswith("| `--token")]
    [row_of_host] = [line for line in text.splitlines() if line.startswith("| `--allow-host")]
    for path in closed:
        assert f"`/{path}`" in row_of_token
        assert f"`/{path}`" in row_of_host


async def test_healthz_and_links_answer_under_any_host_and_keep_details_from_unknown_ones() -> None:
    async with Simulator(port=0) as sim:
        for lines in (("Host: sim", "Origin: http://sim"), ("Host: a.example",), ()):
            assert await get(sim.port, "/healthz", *lines) == (200, '{"status": "ok"}\n')
            assert "version" not in json.loads((await get(sim.port, "/", *lines))[1])
        assert json.loads((await get(sim.port, "/healthz", "Host: localhost"))[1])["version"]
        for path in ("/", "/page.js", "/page.css"):
            assert (await get(sim.port, path, "Host: a.example", "Accept: text/html"))[0] == 200


async def test_host_name_of_the_machine_is_accepted(listen: Listen) -> None:
    _, server = await listen()
    assert server._gate.own_names == own_names(gethostname())
    name = min(server._gate.own_names, key=len)
    assert await shake_hands(server.port, f"Origin: http://{name}", f"Host: {name}") == (101, "")


async def test_loopback_is_detected_from_the_bound_address() -> None:
    for host, is_loopback in (("127.0.0.1", True), ("localhost", True), ("127.0.0.3", True), ("0.0.0.0", False)):  # noqa: S104
        server = Server(Bus(make_store()), ServerLimits(), lambda: None)
        await server.start(host, 0)
        assert server.is_loopback is is_loopback
        await server.stop()


# Room


async def test_client_above_the_limit_is_refused_until_there_is_room(listen: Listen, pairs: Pairs) -> None:
    url, server = await listen(max_clients=3)
    pair = await pairs(url)
    third = await enter(url)
    status, text, _ = await turned_away(url)
    assert status == 503
    assert text == "At most 3 clients; try again later\n"
    await pair.go_on()
    await third.close()
    while len(server.clients) > 2:
        await pair.go_on()
    async with await enter(url) as fourth:
        assert await fourth.settle() == []
    await pair.go_on()


async def test_simultaneous_clients_count_towards_the_limit(listen: Listen) -> None:
    url, server = await listen(max_clients=5)
    came = await asyncio.gather(*(enter(url) for _ in range(20)), return_exceptions=True)
    inside = [client for client in came if isinstance(client, Client)]
    assert len(inside) == len(server.clients) == 5
    assert [one.response.status_code for one in came if isinstance(one, InvalidStatus)] == [503] * 15
    for client in inside:
        await client.close()


async def test_healthz_answers_without_a_token_and_when_full(listen: Listen) -> None:
    url, server = await listen(token=TOKEN, max_clients=1)
    async with await enter(url):
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(b"GET /healthz HTTP/1.1\r\nHost: x\r\nOrigin: http://evil.example\r\n\r\n")
        async with asyncio.timeout(PATIENCE):
            assert (await reader.read()).startswith(b"HTTP/1.1 200 ")
        writer.close()
        await writer.wait_closed()


async def test_version_needs_the_token(listen: Listen) -> None:
    _, server = await listen(token=TOKEN)
    for target, header, status in (
        ("/version", "", 401),
        ("/version?token=wrong", "", 401),
        (f"/version?token={quote(TOKEN, safe='')}", "", 200),
        ("/version", f"Authorization: Bearer {TOKEN}\r\n", 200),
    ):
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(f"GET {target} HTTP/1.1\r\nHost: x\r\n{header}\r\n".encode())
        async with asyncio.timeout(PATIENCE):
            answer = await reader.read()
        writer.close()
        await writer.wait_closed()
        assert answer.startswith(b"HTTP/1.1 %d " % status)
        assert (b'"version"' in answer) is (status == 200)
        assert (b"Content-Type: application/json" in answer) is (status == 200)


# Pace


def test_token_bucket_allows_its_burst_and_then_its_rate() -> None:
    bucket = TokenBucket(rate=2.0, burst=3.0, now=10.0)
    assert [bucket.take(10.0) for _ in range(4)] == [True, True, True, False]
    assert [bucket.take(10.5), bucket.take(10.5)] == [True, False]
    assert [bucket.take(11.25), bucket.take(11.5), bucket.take(11.5)] == [True, True, False]
    assert [bucket.take(1e6) for _ in range(4)] == [True, True, True, False]


class GuardedClient:
    """A client in memory behind a warden."""

    def __init__(self, max_rate: int) -> None:
        self.bus = Bus(make_store())
        Rosapi(self.bus)
        self.outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
        self.peer = Peer(self.bus, Session(self.outbox, lambda _due: None))
        self.gate = RateGate(self.peer, max_rate, 0.0)

    def hear(self, frame: bytes, now: float) -> None:
        work = self.gate.begin(frame, now)
        while work is not None and work.step(now):
            pass

    def says(self, now: float, *ops: dict[str, object]) -> list[dict[str, Any]]:
        """What comes back for a frame of these ops."""
        self.hear("".join(map(json.dumps, ops)).encode(), now)
        return [json.loads(frame) for frame in self.outbox.take(2**40)]


HELLO: dict[str, object] = {"op": "publish", "topic": "/t", "type": "std_msgs/String", "id": "p"}


def test_rate_limit_is_reported_once_a_second_and_excess_refused() -> None:
    client = GuardedClient(max_rate=200)
    assert [client.says(0.0, HELLO) for _ in range(200)] == [[]] * 200
    why = "Too fast: at most 200 frames a second are accepted from one client"

    def told(count: int) -> list[dict[str, Any]]:
        return [{"op": "status", "level": "error", "msg": f"{why}; refused so far: {count}"}]

    assert client.says(0.0, HELLO) == told(1)
    assert [client.says(0.0, HELLO) for _ in range(99)] == [[]] * 99
    assert client.bus.delivery.num_published == 200
    assert client.says(0.5, *[HELLO] * 101) == []  # half a second's worth, and one above
    assert client.bus.delivery.num_published == 300
    (status,) = client.says(1.0, *[HELLO] * 101)
    assert status["msg"] == f"{why}; refused so far: 102"
    assert client.bus.delivery.num_published == 400


def test_frame_above_the_rate_is_not_decoded() -> None:
    client = GuardedClient(max_rate=1)
    for _ in range(LEAST_BURST):
        client.says(0.0, HELLO)
    num_received = client.peer.session.num_received
    call: dict[str, object] = {"op": "call_service", "service": "/rosapi/get_time", "id": 1}
    (status,) = client.says(0.0, call)
    assert status["msg"].startswith("Too fast")
    assert "id" not in status
    for _ in range(1_000):
        assert client.says(0.5, call) == []
    assert client.peer.session.num_received == num_received


def test_awaited_answers_are_never_refused_by_the_rate_limit() -> None:
    client = GuardedClient(max_rate=1)
    caller_outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
    caller = Peer(client.bus, Session(caller_outbox, lambda _due: None))
    client.says(0.0, {"op": "advertise_service", "service": "/s", "type": "std_srvs/Trigger"})
    for _ in range(2 * LEAST_BURST):
        caller.receive(b'{"op":"call_service","service":"/s"}', 0.0)
    calls = [json.loads(frame) for frame in client.outbox.take(2**40)]
    for call in calls:
        answer = {"op": "service_response", "service": "/s", "id": call["id"], "result": True, "values": {}}
        assert client.says(0.0, answer) == []
    answers = [json.loads(frame) for frame in caller_outbox.take(2**40)]
    assert [answer["result"] for answer in answers] == [True] * 2 * LEAST_BURST
    assert client.says(0.0, HELLO)[0]["msg"].startswith("Too fast")  # but they count


def test_fragments_and_rubbish_count_towards_the_rate() -> None:
    client = GuardedClient(max_rate=1)
    for _ in range(LEAST_BURST):
        client.hear(b"rubbish", 0.0)
    client.outbox.take(2**40)
    assert client.says(0.0, HELLO)[0]["msg"].startswith("Too fast")


async def test_client_above_the_rate_stays_connected_without_effect_on_others(listen: Listen, pairs: Pairs) -> None:
    url, server = await listen(max_rate=200)
    pair = await pairs(url)
    async with await enter(url) as noisy:
        for _ in range(20):
            for _ in range(200):
                await noisy.send("publish", topic="/noise", type="std_msgs/String", msg={})
            await pair.go_on()
        assert "Too fast" in (await noisy.take("status"))["msg"]
        assert len(server.clients) == 3
        answered = asyncio.create_task(noisy.take("service_response"))
        while not answered.done():  # it is heard again as soon as its time has come
            await noisy.send("call_service", service="/rosapi/get_time")
            await pair.go_on()
        assert answered.result()["result"] is True


# What is no token


@pytest.mark.parametrize("token", ["", "ö", "\udcff", "s3cret/+", TOKEN + "\0", TOKEN.upper()])
def test_other_values_are_not_the_token(token: str) -> None:
    assert not Access(token=TOKEN).is_token(token)


def test_token_has_no_readable_repr() -> None:
    assert TOKEN not in repr(Access(token=TOKEN))


# TLS


class Certificate:
    """A certificate that vouches for itself, for 127.0.0.1, and its key, as files."""

    def __init__(self, folder: Path) -> None:
        key = ec.generate_private_key(ec.SECP256R1())
        name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "rosbridge_sim test")])
        now = datetime.now(UTC)
        certificate = (
            x509.CertificateBuilder()
            .subject_name(name)
            .issuer_name(name)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(days=1))
            .not_valid_after(now + timedelta(days=1))
            .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=False)
            .sign(key, hashes.SHA256())
        )
        encoding, form = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
        self.key_text = key.private_bytes(encoding, form, serialization.NoEncryption())
        self.locked_key_text = key.private_bytes(encoding, form, serialization.BestAvailableEncryption(b"word"))
        self.text = certificate.public_bytes(encoding)
        self.certfile, self.keyfile = str(folder / "cert.pem"), str(folder / "key.pem")
        Path(self.certfile).write_bytes(self.text)
        Path(self.keyfile).write_bytes(self.key_text)

    @property
    def context(self) -> ssl.SSLContext:
        """What a client needs who trusts this certificate and no other."""
        return ssl.create_default_context(cafile=self.certfile)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Certificate:
    return Certificate(tmp_path_factory.mktemp("certificate"))


async def test_server_with_a_certificate_speaks_wss(certificate: Certificate) -> None:
    options: SimulatorOptions = {"certfile": certificate.certfile, "keyfile": certificate.keyfile, "token": TOKEN}
    options |= {"port": 0, "world": False}
    async with Simulator(**options) as sim:
        assert sim.url == f"wss://127.0.0.1:{sim.port}"
        async with await enter(sim.url, headers=BEARER, context=certificate.context) as client:
            await client.subscribe("/t", type="std_msgs/String")
            text = "x" * 1_000_000
            await client.send("publish", topic="/t", msg={"data": text})
            assert (await client.message("/t"))["data"] == text


async def test_mock_is_served_by_wss(certificate: Certificate, tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    robot.write_text("services: {/reset: {type: std_srvs/Trigger, answers: [{value: {success: true}}]}}")
    async with (
        Simulator(port=0, mock=robot, token=TOKEN, certfile=certificate.certfile, keyfile=certificate.keyfile) as sim,
        AsyncClient(sim.url, token=TOKEN, tls=certificate.context) as client,
    ):
        assert (await client.call("/reset"))["success"] is True


async def test_python_client_trusts_the_certificate_that_it_is_given(certificate: Certificate) -> None:
    options: SimulatorOptions = {"certfile": certificate.certfile, "keyfile": certificate.keyfile, "token": TOKEN}
    options |= {"port": 0, "world": False}
    async with Simulator(**options) as sim:
        async with AsyncClient(sim.url, token=TOKEN, tls=certificate.context) as client:
            await client.confirm()
        with pytest.raises(ConnectError, match="certificate"):
            await AsyncClient(sim.url, token=TOKEN).open()


async def test_simulator_dials_a_wss_bridge(certificate: Certificate, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", certificate.certfile)
    options: SimulatorOptions = {"certfile": certificate.certfile, "keyfile": certificate.keyfile, "token": TOKEN}
    options |= {"port": 0, "world": False}
    async with (
        Simulator(**options) as bridge,
        Simulator(listen=False, attach=f"{bridge.url}/?token={quote(TOKEN)}") as sim,
    ):
        await asyncio.wait_for(asyncio.shield(sim.attachments[0].attached), PATIENCE)
        assert bridge.bus is not None
        assert "/SyncModeCmd" in bridge.bus.services


async def test_plain_request_to_a_tls_port_affects_no_other_client(
    certificate: Certificate, caplog: pytest.LogCaptureFixture
) -> None:
    async with Simulator(port=0, world=False, certfile=certificate.certfile, keyfile=certificate.keyfile) as sim:
        async with await enter(sim.url, context=certificate.context) as client:
            for _ in range(3):
                with pytest.raises((OSError, WebSocketException)):
                    await enter(sim.url.replace("wss", "ws"))
            with pytest.raises(ConnectError, match=r"if it speaks TLS, use wss://$"):
                await AsyncClient(sim.url.replace("wss", "ws")).open()
            assert await client.settle() == []
        _, silent = await asyncio.open_connection("127.0.0.1", sim.port)  # and a stop does not wait for this one
        async with asyncio.timeout(5):
            await sim.stop()
        silent.transport.abort()
    (warning,) = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert "must use wss://" in warning


@EACH_LOOP
def test_first_plain_request_to_a_tls_port_is_one_warning(
    certificate: Certificate, make_loop: MakeLoop, caplog: pytest.LogCaptureFixture
) -> None:
    async def check() -> None:
        server = Server(Bus(make_store()), ServerLimits(), lambda: None)
        await server.start("127.0.0.1", 0, load_certificate(certificate.certfile, certificate.keyfile))
        for first in (b"no TLS and no HTTP\r\n\r\n", *[b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"] * 3):
            reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
            writer.write(first)
            with suppress(ConnectionError):
                await reader.read()
            writer.close()
        await server.stop()

    with asyncio.Runner(loop_factory=make_loop) as runner:
        runner.run(check())
    assert [record.levelname for record in caplog.records if "wss://" in record.getMessage()] == ["WARNING"]


@pytest.mark.parametrize("is_tls", [True, False])
@EACH_LOOP
def test_connection_without_a_request_is_closed_in_time(
    certificate: Certificate, make_loop: MakeLoop, *, is_tls: bool
) -> None:
    limits = ServerLimits(tls_timeout=0.05, open_timeout=0.05)

    async def connect_and_wait(port: int, first: bytes) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(first)
        with suppress(ConnectionError):
            while await reader.read(1024):
                pass
        writer.close()

    async def check() -> None:
        server = Server(Bus(make_store()), limits, lambda: None)
        tls = load_certificate(certificate.certfile, certificate.keyfile) if is_tls else None
        await server.start("127.0.0.1", 0, tls)
        hello = b"\x16\x03\x01\x02\x00\x01" if is_tls else b"GET / HTTP/1.1\r\nHost: x\r\n"  # the rest never comes
        async with asyncio.timeout(PATIENCE):
            await asyncio.gather(*(connect_and_wait(server.port, first) for first in (b"", hello) for _ in range(20)))
        await server.stop()

    with asyncio.Runner(loop_factory=make_loop) as runner:
        runner.run(check())


@EACH_LOOP
def test_stalled_tls_handshakes_are_bounded_and_block_no_client(
    certificate: Certificate, make_loop: MakeLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MAX_OPENING", 3)

    async def check() -> None:
        server = Server(Bus(make_store()), ServerLimits(tls_timeout=3_600.0), lambda: None)
        await server.start("127.0.0.1", 0, load_certificate(certificate.certfile, certificate.keyfile))
        stalled = []
        for hello in (b"", b"\x16\x03\x01\x02\x00\x01") * 5:
            stalled.append(await asyncio.open_connection("127.0.0.1", server.port))
            stalled[-1][1].write(hello)
        async with asyncio.timeout(PATIENCE):
            for reader, _ in stalled[:7]:
                with suppress(ConnectionError):
                    assert await reader.read() == b""
            async with await enter(f"wss://127.0.0.1:{server.port}", context=certificate.context) as client:
                await client.send("subscribe", topic="/t", type="std_msgs/Int32")
                assert await client.settle() == []
            await server.stop()  # does not wait for those that stall
            for reader, writer in stalled:
                with suppress(ConnectionError):
                    assert await reader.read() == b""
                writer.close()
        assert not server._tables.handshakes
        assert not len(server._tables.opening)

    with asyncio.Runner(loop_factory=make_loop) as runner:
        runner.run(check())


def test_handshake_time_out_is_a_few_seconds() -> None:
    assert ServerLimits().tls_timeout == ServerLimits().open_timeout == 5.0


@pytest.mark.slow
def test_first_line_has_a_wss_url(serve: Serve, certificate: Certificate) -> None:
    server = serve("--no-world", "--certfile", certificate.certfile, "--keyfile", certificate.keyfile)
    assert server.url == f"wss://127.0.0.1:{server.port}"


def test_key_and_certificate_may_be_in_one_file(certificate: Certificate, tmp_path: Path) -> None:
    both = tmp_path / "both.pem"
    both.write_bytes(certificate.key_text + certificate.text)
    assert load_certificate(str(both), None) is not None
    assert load_certificate(None, None) is None


def test_unusable_certificate_gives_one_error_line(certificate: Certificate, tmp_path: Path) -> None:
    def said(certfile: str | None, keyfile: str | None) -> str:
        with pytest.raises(DocumentError) as caught:
            load_certificate(certfile, keyfile)
        text = str(caught.value)
        assert "\n" not in text
        return text.replace(str(tmp_path) + "/", "")

    other = Certificate(tmp_path)
    bad = str(tmp_path / "bad.pem")
    Path(bad).write_text("no PEM")
    locked = str(tmp_path / "locked.pem")
    Path(locked).write_bytes(other.locked_key_text)
    nowhere = str(tmp_path / "nowhere.pem")
    wants = "expected a certificate and its private key in PEM, without a password"
    assert said(nowhere, other.keyfile) == "nowhere.pem: cannot be read: No such file or directory"
    assert said(other.certfile, nowhere) == "nowhere.pem: cannot be read: No such file or directory"
    assert said(str(tmp_path), None) == f"{tmp_path}: cannot be read: Is a directory"
    assert said(bad, other.keyfile) == f"bad.pem, key.pem: {wants}"
    assert said(other.certfile, bad) == f"cert.pem, bad.pem: {wants}"
    assert said(other.certfile, locked) == f"cert.pem, locked.pem: {wants}"
    assert said(other.certfile, None) == f"cert.pem, without a keyfile: {wants}"
    assert said(other.certfile, certificate.keyfile) == (
        f"{certificate.keyfile}: expected the private key of cert.pem; got another"
    )
    assert said(None, other.keyfile) == "keyfile key.pem: expected a certfile beside it; got none"


# The whole


async def test_denied_topic_service_and_parameter_are_reported_without_effect_on_others(
    connect: Connect, pairs: Pairs
) -> None:
    async with Simulator(
        port=0,
        world=False,
        deny_publish=["/brake"],
        deny_subscribe=["/camera/*"],
        deny_service=["/drop"],
        allow_param=["/mine/*"],
        max_held=3,
        max_calls=1,
    ) as sim:
        pair = await pairs(sim.url)
        client = await connect(sim.url)
        for i, (op, fields) in enumerate(
            (
                ("advertise", {"topic": "/brake", "type": "std_msgs/Bool"}),
                ("publish", {"topic": "/brake", "type": "std_msgs/Bool"}),
                ("subscribe", {"topic": "/camera/front", "type": "std_msgs/String"}),
                ("advertise_service", {"service": "/drop", "type": "std_srvs/Trigger"}),
            )
        ):
            await client.send(op, id=i, **fields)
            assert (await client.take("status", id=i))["msg"].startswith("Not allowed to ")
            await pair.go_on()
        for service, args in (("/drop", {}), ("/rosapi/set_param", {"name": "/theirs", "value": "1"})):
            answer = await client.call(service, args)
            assert (answer["result"], answer["values"][:15]) == (False, "Not allowed to ")
            await pair.go_on()
        await client.values("/rosapi/set_param", {"name": "/mine/x", "value": "1"})
        for i in range(4):
            await client.send("subscribe", topic=f"/t{i}", type="std_msgs/String", id=i)
        assert "At most 3" in (await client.take("status", id=3))["msg"]
        await pair.go_on()
        provider = await connect(sim.url)
        await provider.send("advertise_service", service="/slow", type="std_srvs/Trigger")
        await provider.settle()
        await client.send("call_service", service="/slow")
        assert "at most 1" in (await client.call("/slow"))["values"]
        await pair.go_on()


async def test_open_access_without_a_token_is_warned_of_once(caplog: pytest.LogCaptureFixture) -> None:
    for options, num_lines in (
        ({"host": "0.0.0.0"}, 1),  # noqa: S104 - what the warning is about
        ({"host": "0.0.0.0", "token": TOKEN}, 0),  # noqa: S104
        ({"host": "127.0.0.1"}, 0),
        ({"host": "localhost"}, 0),
        ({"allow_origin": ["*"]}, 1),
        ({"allow_origin": ["null", "http://localhost:*"], "allow_host": ["*"]}, 2),
        ({"allow_origin": ["*"], "token": TOKEN}, 0),
        ({"allow_origin": ["https://*.example.org"], "allow_host": ["*.example.org"]}, 0),
    ):
        caplog.clear()
        async with Simulator(port=0, world=False, **options):
            pass
        warnings = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
        assert len(warnings) == num_lines, warnings
        assert all("--token" in line for line in warnings)


@EACH_LOOP
def test_request_in_one_packet_with_the_end_of_the_handshake_is_answered(
    certificate: Certificate, make_loop: MakeLoop
) -> None:
    async def check() -> None:
        server = Server(Bus(make_store()), ServerLimits(), lambda: None)
        await server.start("127.0.0.1", 0, load_certificate(certificate.certfile, certificate.keyfile))
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        client = certificate.context.wrap_bio(incoming, outgoing, server_hostname="127.0.0.1")
        async with asyncio.timeout(PATIENCE):
            while True:
                try:
                    client.do_handshake()
                    break
                except ssl.SSLWantReadError:
                    writer.write(outgoing.read())
                    incoming.write(await reader.read(2**16))
            client.write(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            writer.write(outgoing.read())  # the client's last flight of TLS 1.3, and the request behind it
            answer = b""
            while b"\r\n\r\n" not in answer:
                incoming.write(await reader.read(2**16))
                with suppress(ssl.SSLWantReadError):
                    answer += client.read(2**16)
        assert answer.startswith(b"HTTP/1.1 200")
        writer.close()
        await server.stop()
        assert not server._tables.handshakes
        assert not len(server._tables.opening)

    with asyncio.Runner(loop_factory=make_loop) as runner:
        runner.run(check())


async def test_encrypted_connection_that_is_closed_twice_can_still_be_measured(certificate: Certificate) -> None:
    async with (
        Simulator(port=0, world=False, certfile=certificate.certfile, keyfile=certificate.keyfile) as sim,
        await enter(sim.url, context=certificate.context) as client,
    ):
        assert await client.settle() == []
        assert sim._server is not None
        (served,) = sim._server.clients
        assert served.num_bytes_held == 0
        for _ in range(2):  # asyncio's transport has no buffer after this
            served.socket.transport.close()
        assert served.num_bytes_held == 0
        assert sim._server._budget is not None
        sim._server._budget.look()

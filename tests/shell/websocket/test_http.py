"""Plain requests and handshakes as RFC 9110, RFC 9112 and RFC 6455 have them, at each path of the server."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import NamedTuple

import pytest
import pytest_asyncio

from rosbridge_sim import Simulator
from tests.support import PATIENCE

KEY = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
UPGRADE = ("Upgrade: websocket", "Connection: Upgrade", KEY, "Sec-WebSocket-Version: 13")
PATHS = ["/", "/healthz", "/version", "/metrics", "/map.json", "/log.json", "/docs", "/docs/", "/docs/guides/ci"]
PATHS += ["/docs/images/rooms.svg", "/page.css", "/nothing"]


class Answer(NamedTuple):
    """An answer; headers with names in lower case."""

    status: int
    headers: dict[str, str]
    body: bytes


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def sim() -> AsyncIterator[Simulator]:
    async with Simulator(port=0, start="sync") as sim:
        yield sim


async def ask(sim: Simulator, method: str, target: str, *headers: str, host: str = "Host: localhost") -> Answer:
    reader, writer = await asyncio.open_connection("127.0.0.1", sim.port)
    writer.write("\r\n".join([f"{method} {target} HTTP/1.1", host, *headers, "", ""]).encode())
    async with asyncio.timeout(PATIENCE):
        first, *lines = (await reader.readuntil(b"\r\n\r\n")).decode().strip().split("\r\n")
        status = int(first.split()[1])
        body = b"" if status == 101 else await reader.read()
    writer.close()
    await writer.wait_closed()
    pairs = (line.split(": ", 1) for line in lines)
    return Answer(status, {name.lower(): value for name, value in pairs if name != "Date"}, body)


pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest.mark.parametrize("path", PATHS)
async def test_head_gets_the_headers_of_get_without_a_body(sim: Simulator, path: str) -> None:
    whole, head = await ask(sim, "GET", path), await ask(sim, "HEAD", path)
    assert (head.status, head.body) == (whole.status, b"")
    if path != "/metrics":  # it counts bytes, so its length differs
        assert head.headers == whole.headers
    assert int(whole.headers["content-length"]) == len(whole.body) > 0
    assert int(head.headers["content-length"]) > 0


async def test_head_of_a_request_that_cannot_be_read_gets_no_body(sim: Simulator) -> None:
    for header in ("Content-Length: 3", "no header", "X: " + "x" * 9_000, "X: " + "x" * 20_000):
        answer = await ask(sim, "HEAD", "/healthz", header)
        assert answer.status in {400, 431}
        assert (answer.body, int(answer.headers["content-length"]) > 0) == (b"", True)


@pytest.mark.parametrize("path", PATHS)
async def test_method_that_is_not_served_is_refused_at_each_path(sim: Simulator, path: str) -> None:
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "FROB"):
        for headers in ((), UPGRADE):
            answer = await ask(sim, method, path, *headers)
            assert (answer.status, answer.headers["allow"]) == (405, "GET, HEAD")


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("start", ["http://localhost", "HTTP://127.0.0.1:9090", "https://[::1]"])
async def test_target_in_absolute_form_is_its_path(sim: Simulator, path: str, start: str) -> None:
    plain = await ask(sim, "GET", path)
    answer = await ask(sim, "GET", start + path, host="Host: evil.example")
    assert answer.status == plain.status
    if path != "/metrics":
        assert answer.headers == plain.headers


async def test_host_of_an_absolute_target_is_judged_like_the_header(sim: Simulator) -> None:
    for host in ("evil.example", "", "user@localhost", "a b".replace(" ", "%20")):
        answer = await ask(sim, "GET", f"http://{host}/version")
        assert answer.status == (await ask(sim, "GET", "/version", host=f"Host: {host}")).status != 200
    for target in ("http://localhost", "http://localhost?x=1", "http://localhost/?x=/version"):
        assert (await ask(sim, "GET", target)).body == (await ask(sim, "GET", "/")).body
    for target in ("ftp://localhost/version", "localhost/version", "*"):
        assert (await ask(sim, "GET", target)).status == 404


@pytest.mark.parametrize(
    "target", ["/", "/?token=x", "http://localhost/", "ws://localhost:9090", "wss://localhost?a=b"]
)
async def test_handshake_in_either_form_opens_a_websocket(sim: Simulator, target: str) -> None:
    assert (await ask(sim, "GET", target, *UPGRADE)).status == 101


@pytest.mark.parametrize(
    "changed",
    [
        ("Upgrade: h2c, websocket", "Connection: Upgrade"),
        ("Upgrade: WebSocket,h2c", "Connection: upgrade"),
        ("Upgrade: h2c", "Upgrade: websocket", "Connection: keep-alive", "Connection: UPGRADE"),
        ("Upgrade: h2c/1, , websocket", "Connection: HTTP2-Settings, Upgrade, keep-alive"),
    ],
)
async def test_websocket_may_be_one_of_several_protocols(sim: Simulator, changed: tuple[str, ...]) -> None:
    answer = await ask(sim, "GET", "/", *changed, *UPGRADE[2:])
    assert (answer.status, answer.headers["upgrade"]) == (101, "websocket")


async def test_other_protocols_are_ignored(sim: Simulator) -> None:
    plain = await ask(sim, "GET", "/healthz")
    for path in ("/", "/healthz"):
        plain = await ask(sim, "GET", path)
        for name in ("h2c", "TLS/1.0", "websocketx"):
            assert await ask(sim, "GET", path, f"Upgrade: {name}", "Connection: Upgrade") == plain


@pytest.mark.parametrize(
    ("changed", "status"),
    [
        (("Upgrade: h2c", "Connection: Upgrade", *UPGRADE[2:]), 426),
        (("Upgrade: websocket", "Connection: close", *UPGRADE[2:]), 426),
        (("Upgrade: h2c, websocket", *UPGRADE[2:]), 426),
        (("Upgrade: @, websocket", "Connection: Upgrade", *UPGRADE[2:]), 400),
        (("Upgrade: h2c, websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"), 400),
        (("Upgrade: h2c, websocket", "Connection: Upgrade", KEY), 400),
        (("Upgrade: h2c, websocket", "Connection: Upgrade", KEY[:-4], "Sec-WebSocket-Version: 13"), 400),
    ],
)
async def test_incomplete_handshake_is_refused(sim: Simulator, changed: tuple[str, ...], status: int) -> None:
    assert (await ask(sim, "GET", "/", *changed)).status == status


@pytest.mark.parametrize("version", ["8", "0", "14", "013", "13, 8", "x"])
async def test_another_version_is_told_ours(sim: Simulator, version: str) -> None:
    answer = await ask(sim, "GET", "/", *UPGRADE[:3], f"Sec-WebSocket-Version: {version}")
    told = answer.status, answer.headers["sec-websocket-version"], answer.headers["upgrade"]
    assert told == (426, "13", "websocket")

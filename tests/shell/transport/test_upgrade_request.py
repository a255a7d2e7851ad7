"""The ordinary request for a WebSocket: which ones are read, and that the library would accept each of them, too."""

from __future__ import annotations

import logging

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.http11 import Request
from websockets.server import ServerProtocol

from rosbridge_sim.shell.transport.upgrade_request import MAX_HEAD, MAX_LINES, answer_to, read_upgrade

KEY = "dGhlIHNhbXBsZSBub25jZQ=="
"""Of RFC 6455 section 1.3, whose answer is known."""

CHROME = (
    "GET / HTTP/1.1\r\nHost: localhost:9090\r\nConnection: Upgrade\r\nPragma: no-cache\r\nCache-Control: no-cache\r\n"
    "User-Agent: Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36\r\nUpgrade: websocket\r\n"
    "Origin: http://localhost:8000\r\nSec-WebSocket-Version: 13\r\nAccept-Encoding: gzip, deflate, br, zstd\r\n"
    f"Accept-Language: ko-KR,ko;q=0.9\r\nSec-WebSocket-Key: {KEY}\r\n"
    "Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\r\n"
)
FIREFOX = CHROME.replace("Connection: Upgrade", "Connection: keep-alive, Upgrade")
WEBSOCKET_CLIENT = (
    "GET /?token=a%20b HTTP/1.1\r\nUpgrade: websocket\r\nHost: 127.0.0.1:9090\r\nOrigin: http://127.0.0.1:9090\r\n"
    f"Sec-WebSocket-Key: {KEY}\r\nSec-WebSocket-Version: 13\r\nConnection: Upgrade\r\n\r\n"
)
AUTOBAHN = (
    "GET / HTTP/1.1\r\nUser-Agent: AutobahnPython/24.4.2\r\nHost: 127.0.0.1:9090\r\nUpgrade: WebSocket\r\n"
    f"Connection: Upgrade\r\nPragma: no-cache\r\nCache-Control: no-cache\r\nSec-WebSocket-Key: {KEY}\r\n"
    "Sec-WebSocket-Version: 13\r\n\r\n"
)
ORDINARY = (CHROME, FIREFOX, WEBSOCKET_CLIENT, AUTOBAHN)


def read(text: str, *, may_extend: bool = False) -> Request | None:
    return read_upgrade(text.encode("iso-8859-1"), may_extend=may_extend)


def assert_library_agrees(head: bytes, request: Request) -> None:
    """Have the library read and accept the same request."""
    core = ServerProtocol(logger=logging.getLogger("quiet"))
    core.receive_data(head)
    (by_library,) = core.events_received()
    assert isinstance(by_library, Request)
    assert (request.path, request.headers) == (by_library.path, by_library.headers)
    answer = core.accept(by_library)
    assert answer.status_code == 101, answer
    lines = answer_to(request).decode().split("\r\n")
    assert lines[0] == "HTTP/1.1 101 Switching Protocols"
    del answer.headers["Date"]
    assert lines[1:] == [*(f"{name}: {value}" for name, value in answer.headers.raw_items()), "", ""]


@pytest.mark.parametrize("text", ORDINARY)
def test_request_of_a_known_client_is_read_as_by_the_library(text: str) -> None:
    request = read(text)
    assert request is not None
    assert_library_agrees(text.encode(), request)


def test_answer_has_the_value_of_the_rfc() -> None:
    request = read(AUTOBAHN)
    assert request is not None
    assert b"\r\nSec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n" in answer_to(request)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("GET / ", "POST / "),
        ("GET / ", "GET /healthz "),
        ("GET / ", "GET //evil "),
        ("GET / ", "GET http://localhost/ "),
        ("GET / ", "GET  / "),
        ("GET / ", "GET /? x "),
        ("HTTP/1.1", "HTTP/1.0"),
        ("HTTP/1.1\r\n", "HTTP/1.1\n"),
        ("GET / HTTP", "\r\nGET / HTTP"),
        ("Upgrade: WebSocket", "Upgrade: h2c"),
        ("Upgrade: WebSocket", "Upgrade: websocket, h2c"),
        ("Upgrade: WebSocket", "Upgrade: websocket\r\nUpgrade: websocket"),
        ("Upgrade: WebSocket", "Upgrade : websocket"),
        ("Upgrade: WebSocket\r\n", ""),
        ("Connection: Upgrade", "Connection: close"),
        ("Connection: Upgrade", "Connection: Upgrade\r\nConnection: close"),
        ("Connection: Upgrade", "Connection:\r\n Upgrade"),
        (KEY, KEY[:-1]),
        (KEY, "A" * 24),
        (KEY, KEY + "=="),
        (KEY, "\xe9" + KEY[1:]),
        (f"Sec-WebSocket-Key: {KEY}\r\n", f"Sec-WebSocket-Key: {KEY}\r\n" * 2),
        (f"Sec-WebSocket-Key: {KEY}\r\n", ""),
        ("Version: 13", "Version: 8"),
        ("Version: 13", "Version: 13\r\nSec-WebSocket-Version: 13"),
        ("Version: 13", "Version: 013"),
        ("Pragma: no-cache", "Content-Length: 5"),
        ("Pragma: no-cache", "Transfer-Encoding: chunked"),
        ("Pragma: no-cache", "Sec-WebSocket-Protocol: @@"),
        ("Pragma: no-cache", "Origin: http://a\r\nOrigin: http://b"),
        ("Pragma: no-cache", "Pragma no-cache"),
        ("Pragma: no-cache", "Pr agma: no-cache"),
        ("Pragma: no-cache", ": no-cache"),
        ("Pragma: no-cache", "Pragma: no\x00cache"),
        ("Pragma: no-cache", "Pragma: no\xe9"),
        ("Pragma: no-cache", "Pragma: no\ncache"),
        ("Pragma: no-cache", "Pragma: no\rcache"),
        ("Pragma: no-cache", "Pragma: " + "x" * MAX_HEAD),
        ("Pragma: no-cache", "\r\n".join(["a: b"] * MAX_LINES)),
    ],
)
def test_unusual_request_is_left_to_the_library(old: str, new: str) -> None:
    assert AUTOBAHN.count(old) == 1
    assert read(AUTOBAHN.replace(old, new)) is None


def test_request_for_extensions_is_left_to_the_library_where_there_are_some() -> None:
    assert read(CHROME, may_extend=True) is None
    assert read(AUTOBAHN, may_extend=True) is not None


_LINES = st.sampled_from([line + "\r\n" for text in ORDINARY for line in text.split("\r\n")[1:-2]])
_EDITS = st.tuples(st.integers(0, 400), st.integers(0, 3), st.binary(max_size=3) | _LINES.map(str.encode))


@given(st.sampled_from(ORDINARY), st.lists(_EDITS, max_size=3))
def test_no_request_is_read_that_the_library_refuses(text: str, edits: list[tuple[int, int, bytes]]) -> None:
    head = text.encode()
    for at, num, data in edits:
        head = head[:at] + data + head[at + num :]
    for may_extend in (False, True):
        request = read_upgrade(head, may_extend=may_extend)
        if request is not None:
            assert_library_agrees(head, request)

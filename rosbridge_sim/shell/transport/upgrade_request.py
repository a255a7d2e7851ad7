"""The ordinary request for a WebSocket, read in one pass.

Programs and browsers ask for a WebSocket in much the same words (RFC 6455 section 4.1). Such a request is read and
answered here, for a fifth of what the generators of the `websockets` library cost. Every other request is left to the
library: one that is unusual, wrong, or asks for something that must be negotiated. So nothing is refused here, and
nothing is accepted that the library would refuse; a test compares both.
"""

from __future__ import annotations

import re
from binascii import b2a_base64
from hashlib import sha1

from websockets.datastructures import Headers
from websockets.http11 import Request

MAX_HEAD = 8 * 2**10
"""Longest request that is read here [bytes]; for the library, it is the longest line of one."""

MAX_LINES = 100
"""Most lines that are read here; the library accepts 128 headers."""

_HEAD = re.compile(
    rb"GET (/(?:\?[\x21-\x7e]*+)?) HTTP/1\.1\r\n((?:[-!#$%&'*+.^_`|~0-9A-Za-z]++:[\t\x20-\x7e]*+\r\n)++)\r\n"
)
"""Request line and headers of RFC 9112, in ASCII. Nothing in it is tried twice."""

_KEY = re.compile(r"[A-Za-z0-9+/]{22}==")
"""16 bytes in base64."""

_CONNECTION = ("upgrade", "keep-alive, upgrade", "upgrade, keep-alive")
_LEFT = ("Content-Length", "Transfer-Encoding", "Sec-WebSocket-Protocol")
"""Headers with which a request is left to the library."""

_GUID = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # RFC 6455 section 1.3
_ANSWER = (
    b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: %s\r\n\r\n"
)


def read_upgrade(head: bytes, *, may_extend: bool) -> Request | None:
    """Return the request for a WebSocket at `/` in these bytes; None if it is another one, or not an ordinary one.

    Args:
        head: a whole request, with the empty line at its end.
        may_extend: extensions are negotiated, so requests for some are left to the library.
    """
    if len(head) > MAX_HEAD or head.count(b"\n") > MAX_LINES:
        return None
    found = _HEAD.fullmatch(head)
    if found is None:
        return None
    headers = Headers()
    for line in found[2].decode("ascii").split("\r\n")[:-1]:
        name, _, value = line.partition(":")
        headers[name] = value.strip(" \t")
    get_all = headers.get_all
    keys, upgrades, connections = get_all("Sec-WebSocket-Key"), get_all("Upgrade"), get_all("Connection")
    is_ordinary = (
        len(keys) == len(upgrades) == len(connections) == 1
        and get_all("Sec-WebSocket-Version") == ["13"]
        and upgrades[0].lower() == "websocket"
        and connections[0].lower() in _CONNECTION
        and _KEY.fullmatch(keys[0]) is not None
        and len(get_all("Origin")) <= 1
        and not any(name in headers for name in _LEFT)
        and not (may_extend and "Sec-WebSocket-Extensions" in headers)
    )
    return Request(found[1].decode("ascii"), headers) if is_ordinary else None


def answer_to(request: Request) -> bytes:
    """Return the answer that opens the WebSocket.

    Args:
        request: as from `read_upgrade`.
    """
    key = request.headers["Sec-WebSocket-Key"].encode()
    return _ANSWER % b2a_base64(sha1(key + _GUID, usedforsecurity=False).digest(), newline=False)

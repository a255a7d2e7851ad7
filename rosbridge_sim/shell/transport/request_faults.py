"""Answers to HTTP requests that the `websockets` library cannot read: it would close them without a word.

The library itself reads the request here, so that exactly what it refuses is answered: a body, a character beyond
ASCII, a line that is no header. Programs that speak no HTTP are told so, too, as soon as their first line is complete.
"""

from __future__ import annotations

import re
from collections.abc import Generator
from http import HTTPStatus
from io import BytesIO

from websockets.exceptions import SecurityError
from websockets.http11 import Request

_REQUEST_LINE = re.compile(rb"[-!#$%&'*+.^_`|~0-9A-Za-z]+ [^ \r\n]+ HTTP/1\.[01]\r\n")
"""Form of a request line (RFC 9112 section 3), with characters beyond ASCII in its path."""

_BODY = re.compile(rb"\r\n(?:Transfer-Encoding:|Content-Length:[ \t]*(?!0*[ \t]*\r))", re.IGNORECASE)
"""Header of a request with a body."""


def _answer(status: HTTPStatus, text: str, *headers: str) -> bytes:
    lines = (
        f"HTTP/1.1 {status.value} {status.phrase}",
        "Connection: close",
        "Content-Type: text/plain; charset=utf-8",
        f"Content-Length: {len(text) + 1}",
        *headers,
    )
    return ("\r\n".join(lines) + f"\r\n\r\n{text}\n").encode("ascii")


TOO_LONG = _answer(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "A request may have at most 16,384 bytes of head")
_LONG_LINE = _answer(
    HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "A request may have lines of at most 8,192 bytes, and 128 headers"
)
_NO_HTTP = _answer(HTTPStatus.BAD_REQUEST, "Expected a request of HTTP/1.1, such as GET / HTTP/1.1")
_NOT_ASCII = _answer(HTTPStatus.BAD_REQUEST, "Expected ASCII in the path; write other characters as %C3%BC")
_NO_HEADERS = _answer(HTTPStatus.BAD_REQUEST, "Expected headers such as Host: localhost")
_HAS_BODY = _answer(HTTPStatus.BAD_REQUEST, "Expected a request without a body; data go by WebSocket")
_WRONG_METHOD = _answer(
    HTTPStatus.METHOD_NOT_ALLOWED, "Expected GET or HEAD; the rest goes by WebSocket", "Allow: GET, HEAD"
)


def find_first_fault(head: bytes | bytearray) -> bytes | None:
    """Return the answer to a request whose first line is complete and wrong; None if more of it must come."""
    end = head.find(b"\n") + 1
    return _NO_HTTP if end and not _REQUEST_LINE.fullmatch(head, 0, end) else None


def find_fault(head: bytes) -> bytes | None:
    """Return the answer to a request that the library cannot read; None if the library reads and answers it.

    Args:
        head: a whole request, with the empty line at its end.
    """
    first = find_first_fault(head)
    if first is not None:
        return first
    lines = BytesIO(head)

    def read_line(max_size: int, *_errors: type[Exception]) -> Generator[None, None, bytes]:
        yield from ()
        line = lines.readline()
        if len(line) > max_size:
            raise SecurityError
        return line

    try:
        next(Request.parse(read_line))
    except StopIteration:
        return None
    except SecurityError:
        return _LONG_LINE
    except Exception:  # noqa: BLE001 - the library closes the connection after any exception
        method, path, _ = head.partition(b"\r\n")[0].split(b" ")
        if method not in {b"GET", b"HEAD"}:
            return _WRONG_METHOD
        if not path.isascii():
            return _NOT_ASCII
        return _HAS_BODY if _BODY.search(head) else _NO_HEADERS
    raise AssertionError("the whole request is there")

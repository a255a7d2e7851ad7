"""Answers to plain HTTP requests."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Awaitable, Mapping, Sequence
from http import HTTPStatus
from typing import Final, TypeAlias

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from rosbridge_sim.shell.page.map_page import MapText
from rosbridge_sim.shell.page.page_file import PageFile, is_known
from rosbridge_sim.version import __version__

JSON_KIND = "application/json"

PROTOCOL = "rosbridge v2.0"
"""Name of the protocol in its specification."""


Answer: TypeAlias = Response | Awaitable[Response]
"""An answer, or one that comes later."""

_ABSOLUTE: Final = re.compile(r"(?:http|ws)s?://(?P<host>[^/?#]*)(?P<path>[^#]*)", re.IGNORECASE)
"""Target of a request in absolute form."""

_PROTOCOL: Final = re.compile(r"(?:[-!#$%&'*+.^_`|~0-9A-Za-z]+(?:/[-!#$%&'*+.^_`|~0-9A-Za-z]+)?)?")
"""An entry of `Upgrade` (RFC 9110 section 7.8), which may be empty."""

_VERSION: Final = "13"
"""Version of the WebSocket protocol (RFC 6455 section 4.1)."""


def answer_with(connection: ServerConnection, code: HTTPStatus, body: bytes, content_type: str) -> Response:
    """Return an answer that is not plain text."""
    response = connection.respond(code, "")
    for name, value in (("Content-Type", content_type), ("Content-Length", str(len(body)))):
        del response.headers[name]
        response.headers[name] = value
    response.body = body
    return response


def answer_file(connection: ServerConnection, request: Request, file: PageFile, headers: Mapping[str, str]) -> Response:
    """Return a file of the web page, compressed if the browser takes that, or 304 if the browser has it.

    Args:
        request: a GET or HEAD request.
    """
    is_compressed = accepts(request, "Accept-Encoding", "gzip")
    etag = f'{file.etag[:-1]}-gzip"' if is_compressed else file.etag  # a strong ETag stands for the bytes on the wire
    if is_known(etag, request.headers.get_all("If-None-Match")):
        response = _answer_unchanged(connection)
    else:
        body = file.gzipped if is_compressed else file.body
        response = answer_with(connection, HTTPStatus.OK, body, file.kind)
        if is_compressed:
            response.headers["Content-Encoding"] = "gzip"
    for name, value in ({"ETag": etag, "Vary": "Accept, Accept-Encoding"} | dict(headers)).items():
        response.headers[name] = value
    return response


def _answer_unchanged(connection: ServerConnection) -> Response:
    response = connection.respond(HTTPStatus.NOT_MODIFIED, "")
    for name in ("Content-Type", "Content-Length"):  # they would be those of the file
        del response.headers[name]
    return response


def answer_moved(connection: ServerConnection, path: str) -> Response:
    """Return an answer that leads from a path without its last slash to the one with it.

    Args:
        path: a path of one name, such as `/docs`.
    """
    response = connection.respond(HTTPStatus.PERMANENT_REDIRECT, f"It is at {path}/\n")
    response.headers["Location"] = f"{path[1:]}/"  # relative, because a proxy may put the server below a folder
    return response


async def answer_map(
    connection: ServerConnection, asked: asyncio.Future[MapText], lost: asyncio.Future[None]
) -> Response:
    """Return the map once it is written, or why there is none.

    Args:
        lost: done when the connection is lost.
    """
    ends: list[asyncio.Future[MapText] | asyncio.Future[None]] = [asked, lost]
    await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
    if not asked.done():  # it has gone, or the server stops
        return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "The connection has ended\n")
    text = asked.result()
    if text.why_not:
        return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, text.why_not)
    if text.body is None:
        response = _answer_unchanged(connection)
    else:
        response = answer_with(connection, HTTPStatus.OK, text.body, JSON_KIND)
    response.headers["ETag"] = text.etag
    response.headers["Cache-Control"] = "no-cache"  # ask again each time: another scenario may bring another map
    return response


async def answer_late(lost: asyncio.Future[None], response: Response, delay: float) -> Response:
    """Delay the answer to a program that tries tokens; other connections are not delayed.

    Args:
        lost: done when the connection is lost.
        delay: the delay [s].
    """
    await asyncio.wait([lost], timeout=delay)
    return response


def links_of(paths: Sequence[str], *, has_version: bool) -> bytes:
    """Return a description of the server for programs: its name, and links relative to its URL.

    Args:
        paths: the paths that the server has beside the socket, without the first slash.
    """
    facts: dict[str, object] = {"name": "rosbridge-sim"}
    if has_version:
        facts |= {"version": __version__, "protocol": PROTOCOL}
    links = {"socket": "./"} | {path.partition(".")[0].rstrip("/") or "page": path or "./" for path in paths}
    return f"{json.dumps(facts | {'links': links})}\n".encode()


def not_allowed(connection: ServerConnection, request: Request) -> Response | None:
    """Return the refusal of a request that is neither GET nor HEAD; None if it is one of them."""
    method = method_of(request)
    if method in {"GET", "HEAD"}:
        return None
    response = connection.respond(HTTPStatus.METHOD_NOT_ALLOWED, "Expected GET or HEAD; the rest goes by WebSocket\n")
    response.headers["Allow"] = "GET, HEAD"
    return response


def method_of(request: Request) -> str:
    """Return the method of a request. Before version 17 the library only let GET pass and did not keep the method."""
    return str(getattr(request, "method", "GET"))


def read_target(request: Request) -> None:
    """Have a request in absolute form, such as `GET http://host/path`, be one for `/path` with that Host.

    Programs send it to what they take for a proxy. Its host takes the place of the header (RFC 9112 section 3.2.2), and
    is judged by the same rules.
    """
    found = _ABSOLUTE.fullmatch(request.path)
    if found is None:
        return
    path = found["path"]
    request.path = path if path.startswith("/") else f"/{path}"
    _set(request, "Host", found["host"])


def asks_for_websocket(request: Request) -> bool:
    """Return True if WebSocket is one of the protocols in `Upgrade` (RFC 9110 section 7.8)."""
    return any(name.lower() == "websocket" for name in _protocols(request))


def settle_upgrade(request: Request) -> None:
    """Leave WebSocket alone of the protocols in `Upgrade`: the library takes one alone. It refuses a broken list."""
    if all(map(_PROTOCOL.fullmatch, _protocols(request))):
        _set(request, "Upgrade", "websocket")


def _protocols(request: Request) -> list[str]:
    """Return the entries of `Upgrade`."""
    names = ",".join(request.headers.get_all("Upgrade")).split(",")
    return [name.strip(" \t") for name in names]


def is_upgrade(request: Request) -> bool:
    """Return True if a request is a WebSocket handshake, or one that a proxy has robbed of its `Upgrade` header.

    Other protocols in `Upgrade`, such as h2c, are ignored, as RFC 9110 section 7.8 allows.
    """
    names = ("Sec-WebSocket-Key", "Sec-WebSocket-Version")
    return method_of(request) == "GET" and (
        asks_for_websocket(request) or any(name in request.headers for name in names)
    )


def speaks_another_version(request: Request) -> bool:
    """Return True if a handshake is for another version of the WebSocket protocol than ours."""
    versions = request.headers.get_all("Sec-WebSocket-Version")
    return len(versions) == 1 and versions[0] != _VERSION


def answer_version(connection: ServerConnection) -> Response:
    """Return the refusal of another version of the WebSocket protocol (RFC 6455 section 4.4)."""
    text = f"Expected Sec-WebSocket-Version: {_VERSION}\n"
    response = connection.respond(HTTPStatus.UPGRADE_REQUIRED, text)
    response.headers["Upgrade"] = "websocket"
    response.headers["Sec-WebSocket-Version"] = _VERSION
    return response


def _set(request: Request, name: str, value: str) -> None:
    """Give a request one header in place of all of that name."""
    if name in request.headers:
        del request.headers[name]
    request.headers[name] = value


def accepts(request: Request, header: str, value: str) -> bool:
    """Return True if a header such as `Accept` names a value, and not with `q=0`. Wildcards do not count.

    Args:
        value: the value, such as `text/html`.
    """
    for entry in ",".join(request.headers.get_all(header)).split(","):
        name, *parameters = (part.strip().lower() for part in entry.split(";"))
        if name == value:
            weights = [text.partition("=")[2] for text in parameters if text.partition("=")[0].strip() == "q"]
            return not any(weight.strip().strip("0.") == "" for weight in weights)
    return False

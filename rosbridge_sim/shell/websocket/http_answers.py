"""Answers to plain HTTP requests."""

from __future__ import annotations

from http import HTTPStatus

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from rosbridge_sim.shell.page.web_page import WebPage

__all__ = ["answer_page", "answer_with"]


def answer_with(connection: ServerConnection, code: HTTPStatus, body: bytes, content_type: str) -> Response:
    """Return an answer that is not plain text.

    Args:
        connection: the connection of the request.
        code: the status.
        body: the content.
        content_type: its type.
    """
    response = connection.respond(code, "")
    for name, value in (("Content-Type", content_type), ("Content-Length", str(len(body)))):
        del response.headers[name]
        response.headers[name] = value
    response.body = body
    return response


def answer_page(connection: ServerConnection, request: Request, page: WebPage, path: str) -> Response | None:
    """Return a file of the web page; None if it has no file at the path.

    Args:
        connection: the connection of the request.
        request: the request.
        page: the page.
        path: the path without a query.
    """
    file = page.find(path)
    if file is None:
        return None
    is_compressed = "gzip" in ",".join(request.headers.get_all("Accept-Encoding"))
    response = answer_with(connection, HTTPStatus.OK, file.gzipped if is_compressed else file.body, file.kind)
    if is_compressed:
        response.headers["Content-Encoding"] = "gzip"
    response.headers["ETag"] = file.etag
    response.headers["Vary"] = "Accept-Encoding"
    for name, value in page.headers.items():
        response.headers[name] = value
    return response

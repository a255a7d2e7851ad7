"""Answers of the server to plain HTTP requests, by their paths."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from http import HTTPStatus
from typing import TypeAlias

from websockets.http11 import Request, Response

from rosbridge_sim.shell.kernels.backend import backend
from rosbridge_sim.shell.page.map_page import MapText
from rosbridge_sim.shell.page.web_page import PATHS, WebPage
from rosbridge_sim.shell.websocket.connections import ServedConnection
from rosbridge_sim.shell.websocket.http_answers import (
    JSON_KIND,
    Answer,
    accepts,
    answer_file,
    answer_map,
    answer_moved,
    answer_with,
    links_of,
)
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.request_gate import RequestGate
from rosbridge_sim.version import __version__

STOPPING = "the server is shutting down"
"""Reason in `/healthz` while the server stops."""

_VERSION = {"name": "rosbridge-sim", "version": __version__, "protocol": "rosbridge v2.0"}
"""Answer of `/version`; the protocol has the name that its specification uses."""

MAP_SERVICE = "/sim/map"
"""The service that gives the map in pages; who may not call it may not read `/map.json` either."""

REFUSALS_TOPIC = "/sim/refusals"
"""The topic with the refusals of all clients; who may not subscribe to it may not read `/log.json` either."""


_RenderMetrics: TypeAlias = Callable[[str], Awaitable[tuple[bytes, str]]]
_AskMap: TypeAlias = Callable[[Sequence[str]], asyncio.Future[MapText] | None]


class HttpPages:
    """The answers to requests that open no WebSocket.

    Attributes:
        why_unhealthy: called for `/healthz`; returns why the server does not work fully, or None if it does.
        describe: called for `/healthz`; returns values about the simulator, by name.
        render_metrics: called for `/metrics` with the `Accept` header; returns the body and its content type. None if
            there is no such page.
        ask_map: called for `/map.json` with the `If-None-Match` header; returns the text once it is written, or None if
            the settings switch it off. None if there is no such page.
        render_log: called for `/log.json` with whether the log may be read, too; returns JSON text. None if there is
            no such page.
        page: the web page at `/`; None if there is none.
        is_stopping: the server is shutting down.

    Args:
        num_clients: returns the number of connected clients.
    """

    def __init__(self, gate: RequestGate, limits: ServerLimits, num_clients: Callable[[], int]) -> None:
        self.why_unhealthy: Callable[[], str | None] = lambda: None
        self.describe: Callable[[], Mapping[str, object]] = dict
        self.render_metrics: _RenderMetrics | None = None
        self.ask_map: _AskMap | None = None
        self.render_log: Callable[[bool], bytes] | None = None
        self.page: WebPage | None = None
        self.is_stopping = False
        self._gate = gate
        self._policy = limits.policy
        self._num_clients = num_clients

    def answer(self, connection: ServedConnection, request: Request, path: str) -> Answer:
        """Return the answer to a request for a path."""
        if path == "/healthz":
            return self._tell_health(connection, request)
        tell = self._teller_of(path)
        if tell is None:
            return self._answer_file(connection, request, path)
        return self._gate.refuse_data(connection, request, path) or tell(connection, request)

    def _teller_of(self, path: str) -> Callable[[ServedConnection, Request], Answer] | None:
        """Return what answers those who may have data with that of a path; None where there is none."""
        if path == "/version":
            return self._tell_version
        if path == "/metrics" and self.render_metrics is not None:
            return partial(self._tell_metrics, self.render_metrics)
        if path == "/map.json" and self.ask_map is not None:
            return partial(self._tell_map, self.ask_map)
        if path == "/log.json" and self.render_log is not None:
            return partial(self._tell_log, self.render_log)
        return None

    def _answer_file(self, connection: ServedConnection, request: Request, path: str) -> Answer:
        if path in {"", "/"} and (self.page is None or not accepts(request, "Accept", "text/html")):
            return self._tell_links(connection, request)
        if self.page is not None and (path or "/") in PATHS:
            return self._answer_page(connection, request, self.page, path or "/")
        page = self.page
        if page is not None and path + "/" in page.folders:
            return answer_moved(connection, path)
        if page is not None and (folder := page.folder_of(path)) is not None:
            return self._answer_below(connection, request, page, folder)
        return connection.respond(HTTPStatus.NOT_FOUND, f"There is nothing at {path}; rosbridge is at /\n")

    async def _answer_page(self, connection: ServedConnection, request: Request, page: WebPage, path: str) -> Response:
        """Answer with a file of the web page, for which nothing needs to be shown."""
        file = (await asyncio.shield(page.ask()))[path]
        return answer_file(connection, request, file, page.headers)

    async def _answer_below(
        self, connection: ServedConnection, request: Request, page: WebPage, folder: str
    ) -> Response:
        """Answer with a file of a folder beside the page, for which nothing needs to be shown."""
        path = request.path.partition("?")[0]
        file = await page.folders[folder].read(path)
        if file is None:
            return connection.respond(HTTPStatus.NOT_FOUND, f"There is nothing at {path}; {folder} lists all\n")
        return answer_file(connection, request, file, page.headers)

    def _tell_links(self, connection: ServedConnection, request: Request) -> Answer:
        """Answer a program that wants no HTML: name and links, and the version for those who may know it."""
        pages = {"map.json": self.ask_map, "log.json": self.render_log, "metrics": self.render_metrics}
        paths = [] if self.page is None else ["", *(folder.lstrip("/") for folder in self.page.folders)]
        paths += [*(path for path, part in pages.items() if part is not None), "healthz", "version"]
        body = links_of(paths, has_version=self._gate.may_have_data(request))
        response = answer_with(connection, HTTPStatus.OK, body, JSON_KIND)
        response.headers["Vary"] = "Accept"
        return self._gate.late_for_wrong_token(connection, request, response)

    def _tell_health(self, connection: ServedConnection, request: Request) -> Answer:
        """Answer the state of the server as JSON. Requests that get no data get only status and reason."""
        why = self.why_unhealthy() or (STOPPING if self.is_stopping else None)
        health: dict[str, object] = {"status": "ok"}
        if why is not None:
            health = {"status": "stopping" if why == STOPPING else "failed", "reason": why}
        if self._gate.may_have_data(request):
            health |= {"version": __version__, **self.describe(), "clients": self._num_clients()}
        code = HTTPStatus.OK if why is None else HTTPStatus.SERVICE_UNAVAILABLE
        response = answer_with(connection, code, f"{json.dumps(health)}\n".encode(), JSON_KIND)
        return self._gate.late_for_wrong_token(connection, request, response)

    def _tell_version(self, connection: ServedConnection, _request: Request) -> Answer:
        """Answer name, version, protocol, and what drives vehicles on lanes."""
        body = f"{json.dumps({**_VERSION, 'backend': backend()})}\n"
        return answer_with(connection, HTTPStatus.OK, body.encode(), JSON_KIND)

    def _tell_metrics(self, render: _RenderMetrics, connection: ServedConnection, request: Request) -> Answer:
        """Answer all counters in Prometheus's format."""
        return self._answer_metrics(connection, render(", ".join(request.headers.get_all("Accept"))))

    async def _answer_metrics(self, connection: ServedConnection, rendered: Awaitable[tuple[bytes, str]]) -> Response:
        body, content_type = await rendered
        return answer_with(connection, HTTPStatus.OK, body, content_type)

    def _tell_log(self, render: Callable[[bool], bytes], connection: ServedConnection, _request: Request) -> Answer:
        """Answer the last refusals and warnings, to those who may subscribe to `/sim/refusals`."""
        policy = self._policy
        if not policy.may_subscribe(REFUSALS_TOPIC):
            text = f"Not allowed to subscribe to {REFUSALS_TOPIC}, which tells the same\n"
            return connection.respond(HTTPStatus.FORBIDDEN, text)
        response = answer_with(connection, HTTPStatus.OK, render(policy.may_subscribe("/rosout")), JSON_KIND)
        response.headers["Cache-Control"] = "no-store"
        return response

    def _tell_map(self, ask: _AskMap, connection: ServedConnection, request: Request) -> Answer:
        """Answer the map as JSON. Patterns for `/sim/map` hold for it."""
        if not self._policy.may_call(MAP_SERVICE):
            return connection.respond(
                HTTPStatus.FORBIDDEN, f"Not allowed to call {MAP_SERVICE}, which tells the same\n"
            )
        asked = ask(request.headers.get_all("If-None-Match"))
        if asked is None:
            return connection.respond(HTTPStatus.NOT_FOUND, f"The settings have {MAP_SERVICE} turned off\n")
        return answer_map(connection, asked, connection.lost)

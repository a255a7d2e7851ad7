"""WebSocket clients and plain HTTP on one port.

Reading and writing need no task. A frame goes from the transport directly to the client's `Peer`, which does its ops
one by one (`server_connection.py`). Long work continues in later turns (`turns.py`). Outgoing frames wait in outboxes
until the loop's next turn, and then go to each socket in one write, as long as the socket accepts them. When a socket
is full, the transport reports when there is room again; frames wait in the outbox until then (`protocol/outbox.py`). An
ordinary request for a WebSocket is answered as it arrives (`upgrade_request.py`), and the connection has no task. All
other requests go to the `websockets` library, with a task for each. The library also does pings, limits and closing.
Rejected designs: the library's `send` costs a task switch and a system call per message. Writing at the end of each
read, not in the next turn, costs a fifth of the calls if many clients talk to one.
"""

from __future__ import annotations

import asyncio
import json
import logging
import ssl
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from ipaddress import ip_address
from socket import gethostname
from time import monotonic

from websockets.asyncio.server import Server as WebSocketServer
from websockets.asyncio.server import ServerConnection, serve
from websockets.extensions.base import ServerExtensionFactory
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.link.library_log import quiet
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.shell.page.map_page import MapText
from rosbridge_sim.shell.page.web_page import PATHS, WebPage
from rosbridge_sim.shell.transport.inflate import (
    LateDeflateFactory,
)
from rosbridge_sim.shell.transport.upgrade_request import answer_to, read_upgrade
from rosbridge_sim.shell.websocket.access import HandshakeRefusal, is_from_autobahn
from rosbridge_sim.shell.websocket.client_totals import ClientTotals
from rosbridge_sim.shell.websocket.connected_client import Client
from rosbridge_sim.shell.websocket.connections import (
    ConnectionTables,
    ServedConnection,
    address_of,
    make_connection,
)
from rosbridge_sim.shell.websocket.freed_memory import MemoryReturn, resident_bytes, trim_memory
from rosbridge_sim.shell.websocket.http_answers import (
    JSON_KIND,
    accepts,
    answer_file,
    answer_late,
    answer_map,
    answer_moved,
    answer_version,
    answer_with,
    asks_for_websocket,
    is_upgrade,
    links_of,
    method_of,
    not_allowed,
    read_target,
    settle_upgrade,
    speaks_another_version,
)
from rosbridge_sim.shell.websocket.limits import CLOSE_TIMEOUT, ServerLimits
from rosbridge_sim.shell.websocket.memory_budget import Holder, HttpReader, MemoryBudget
from rosbridge_sim.shell.websocket.origins import RefusedOrigins, own_names
from rosbridge_sim.shell.websocket.tls_handshake import TlsRules
from rosbridge_sim.shell.websocket.turns import Turns
from rosbridge_sim.shell.websocket.unauthenticated import MAX_UNPROVEN_SIZE, WRONG_TOKEN, UnauthenticatedConnection
from rosbridge_sim.version import __version__

_log = logging.getLogger("rosbridge_sim.server")

STOPPING = "the server is shutting down"
"""Reason in `/healthz` while the server stops."""

_VERSION = json.dumps({"name": "rosbridge-sim", "version": __version__, "protocol": "rosbridge v2.0"})
"""Answer of `/version`; the protocol has the name that its specification uses."""

MAP_SERVICE = "/sim/map"
"""The service that gives the map in pages; who may not call it may not read `/map.json` either."""

REFUSALS_TOPIC = "/sim/refusals"
"""The topic with the refusals of all clients; who may not subscribe to it may not read `/log.json` either."""

UNAUTHENTICATED = "no token"
"""Name in the log and on `/sim/refusals` for all connections that have not sent the token."""


class Server:
    """A listener that makes each connection a peer of the bus.

    Attributes:
        clients: the connected clients, in order of arrival.
        on_clients: called when a client has connected or left.
        why_unhealthy: called for `/healthz`; returns why the server does not work fully, or None if it does.
        describe: called for `/healthz`; returns values about the simulator, by name.
        render_metrics: called for `/metrics` with the `Accept` header; returns the body and its content type. None if
            there is no such page.
        ask_map: called for `/map.json` with the `If-None-Match` header; returns the text once it is written, or None if
            the settings switch it off. None if there is no such page.
        render_log: called for `/log.json` with whether the log may be read, too; returns JSON text. None if there is
            no such page.
        page: the web page at `/`; None if there is none.
        num_bugs: number of frames and requests that failed by an internal error; each is in the log with its traceback.
            Errors counted by the bus's guard are not included.
        port: the real port, after the start.
        addresses: addresses on which it listens, without the port.
        is_loopback: it can only be reached from this machine.
        own_names: names of this machine that web pages may use.
    """

    def __init__(self, bus: Bus, limits: ServerLimits, on_change: Callable[[], None]) -> None:
        """Create a server that does not listen yet.

        Args:
            on_change: called after each frame and each departure, because the world may be due earlier than planned.
        """
        self.clients: dict[Client, None] = {}
        self.on_clients: Callable[[], None] = lambda: None
        self.why_unhealthy: Callable[[], str | None] = lambda: None
        self.describe: Callable[[], Mapping[str, object]] = dict
        self.render_metrics: Callable[[str], Awaitable[tuple[bytes, str]]] | None = None
        self.ask_map: Callable[[str], asyncio.Future[MapText] | None] | None = None
        self.render_log: Callable[[bool], bytes] | None = None
        self.page: WebPage | None = None
        self.num_bugs = 0
        self.port = 0
        self.addresses: tuple[str, ...] = ()
        self._bus = bus
        self._limits = limits
        self._on_change = on_change
        self._clock = monotonic
        self._turns: Turns | None = None
        self._memory: MemoryReturn | None = None
        self._budget: MemoryBudget | None = None
        self._server: WebSocketServer | None = None
        self._tables = ConnectionTables(limits.access.max_strangers, limits.open_timeout, self._take_request)
        self.is_loopback = False
        self.own_names: frozenset[str] = frozenset()
        self._refused_origins = RefusedOrigins()
        self._left = ClientTotals()  # totals of the clients that have left
        self._is_stopping = False

    @property
    def traffic(self) -> ClientTotals:
        """Totals of all clients since the start, with those that have left."""
        return self._left.plus(self.clients)

    @property
    def num_bytes_received(self) -> int:
        """Bytes received over all connections since the start."""
        return self._tables.num_bytes_received + sum(socket.num_bytes_received for socket in self._tables.sockets)

    @property
    def num_strangers(self) -> int:
        """Number of connections that still have to send the token."""
        return len(self._tables.unauthenticated)

    async def start(self, host: str, port: int, tls: ssl.SSLContext | None = None) -> None:
        """Listen for connections.

        Args:
            host: host name or address to listen on.
            port: TCP port; 0 takes a free one.
            tls: the certificate for wss://; None listens without TLS.

        Raises:
            OSError: the address cannot be used.
        """
        limits = self._limits
        loop = asyncio.get_running_loop()
        memory = self._memory = MemoryReturn(trim_memory, resident_bytes)
        self._turns, self._clock = Turns(loop, self._on_change), loop.time

        def look(num_bytes_held: int) -> None:
            memory.look(num_bytes_held, loop.time())

        self._budget = MemoryBudget(loop, self._bus, self._holders, limits.memory_budget, look)
        rules = None if tls is None else TlsRules(tls, limits.tls_timeout, CLOSE_TIMEOUT)
        self._server = await serve(
            self._serve,
            host,
            port,
            open_timeout=None,  # it would cut off a complete request, too; see `ServedConnection` and `_answer_in_time`
            create_connection=partial(make_connection, self._tables, rules),  # type: ignore[arg-type] # it is only called
            process_request=self._process_request,
            compression=None,
            extensions=_extensions(limits),
            max_size=limits.max_frame_size,
            ping_interval=limits.ping_interval,
            ping_timeout=limits.ping_timeout,
            close_timeout=CLOSE_TIMEOUT,
            server_header=None,
            logger=quiet,
        )
        addresses = [socket.getsockname() for socket in self._server.sockets]
        self.port = addresses[0][1]
        self.addresses = tuple(str(address[0]).partition("%")[0] for address in addresses)
        self.is_loopback = all(ip_address(address).is_loopback for address in self.addresses)
        self.own_names = own_names(gethostname())

    async def stop(self) -> None:
        """Close every connection with code 1001 and stop listening; it takes at most a second and a half."""
        self._is_stopping = True
        if self._budget is not None:
            self._budget.stop()
        if self._server is not None:
            self._server.close()
            for handshake in list(self._tables.handshakes):
                handshake.evict()
            self._tables.close_those_without_task()
            try:
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await self._server.wait_closed()
                    await self._tables.wait_empty()
            except TimeoutError:  # some do not read the close frame; some never sent a request
                for socket in self._tables.sockets:
                    socket.transport.abort()
                for handshake in list(self._tables.handshakes):  # the system has already accepted them
                    handshake.evict()
                await self._server.wait_closed()
                await self._tables.wait_empty()

    async def _serve(self, socket: ServerConnection) -> None:
        """Serve a connection to its end."""
        assert isinstance(socket, ServedConnection)
        try:
            await self._serve_socket(socket)
        except Exception:  # the library closes it with code 1011, but its own log line is suppressed
            self._note_unserved(socket)
            raise

    def _note_unserved(self, socket: ServedConnection) -> None:
        self.num_bugs += 1
        _log.exception("internal error: %s could not be served", address_of(socket))

    async def _serve_socket(self, socket: ServedConnection) -> None:
        """Serve a client, after it has sent the token if one is needed."""
        if not socket.is_trusted:
            why = await self._let_prove(socket)
            if why is not None:
                _log.info("%s turned away: %s", address_of(socket), why)
                return
        await self._serve_client(socket)

    async def _let_prove(self, socket: ServedConnection) -> str | None:
        """Wait until a connection has sent the token.

        Returns:
            None if it has; else why it was closed, for example because there are too many clients.
        """
        assert self._turns is not None, "it listens"
        note = partial(self._note_refused_token, socket)
        access, is_talkative = self._limits.access, self._limits.is_talkative
        waiting = UnauthenticatedConnection(socket, access, self._turns, is_talkative=is_talkative, on_refusal=note)
        try:
            socket.listen(waiting)
            why = await waiting.wait_settled()
            code = CloseCode.POLICY_VIOLATION
            if why is None and self._limits.access.is_full(len(self.clients)):
                code, why = CloseCode.TRY_AGAIN_LATER, f"at most {len(self.clients)} clients; try again later"
            if why is None:
                self._tables.unauthenticated.leave(socket)
                self._trust(socket)
                if waiting.rest:
                    socket.put_back(waiting.rest)
                return None
            waiting.let_go()
            with suppress(TimeoutError):
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await socket.close(code, why)
            socket.transport.abort()
            return why
        finally:
            waiting.leave()

    def _note_refused_token(self, socket: ServerConnection, reason: Reason, op: str, text: str) -> None:
        """Report a connection without the token in the log and on `/sim/refusals`.

        All of them count as one client there, because each attempt can come from another port or address.
        """
        text = f"{text}; the connection is {address_of(socket)}"
        refusal = RefusedRequest(UNAUTHENTICATED, reason, op, "", text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)

    def _trust(self, socket: ServedConnection) -> None:
        """Treat a connection as a client's from now on."""
        socket.is_trusted = True
        socket.limit_message_size(self._limits.max_frame_size)

    async def _serve_client(self, socket: ServedConnection) -> None:
        client = self._add_client(socket, socket.request)
        try:
            socket.listen(client)
            await socket.wait_closed()
        finally:
            self._remove_client(client)

    def _take_request(self, socket: ServedConnection, head: bytes) -> bool:
        """Open and serve a connection without a task, if its request is an ordinary one and has nothing against it.

        Returns:
            True if it is served; otherwise the library reads the request, and asks `_process_request`.
        """
        request = read_upgrade(head, may_extend=self._limits.is_compressing)
        if request is None or self._is_stopping or not self._may_enter(request):
            return False
        self._tables.opening.leave(socket)
        self._trust(socket)
        socket.open(answer_to(request))
        try:
            client = self._add_client(socket, request)
            socket.on_lost = partial(self._remove_client, client)
            socket.listen(client)
        except Exception:  # noqa: BLE001 - an internal error, which ends this connection alone
            self._note_unserved(socket)
            socket.fail(CloseCode.INTERNAL_ERROR, "")
        return True

    def _may_enter(self, request: Request) -> bool:
        """Return True if a request shows what is wanted, and there is room. Nothing else is done here."""
        try:
            return self._judge(request) is None and self._limits.access.is_shown(request)
        except Exception:  # noqa: BLE001 - an internal error, which `_process_request` finds again
            return False

    def _judge(self, request: Request) -> HandshakeRefusal | None:
        return self._limits.access.judge(
            request, len(self.clients), is_loopback=self.is_loopback, own_names=self.own_names
        )

    def _add_client(self, socket: ServedConnection, request: Request | None) -> Client:
        """Make a connection a client; the caller lets it listen."""
        assert self._turns is not None, "it listens"
        client = Client(socket, self._bus, self._limits, self._turns, self, is_from_autobahn=is_from_autobahn(request))
        self.clients[client] = None
        self._try(self.on_clients)
        _log.info("%s connected; %d connected now", client.peer.address, len(self.clients))
        return client

    def _remove_client(self, client: Client) -> None:
        """Forget a client whose connection is over."""
        del self.clients[client]
        self._try(client.leave)
        self._left.add(client)
        self._try(self.on_clients)
        self._on_change()
        _log.info("%s left; %d connected now", client.peer.address, len(self.clients))

    def _holders(self) -> list[Holder]:
        """Return everything for which the server holds memory: the clients, and the readers of HTTP answers."""
        sockets = {client.socket for client in self.clients}
        return [*self.clients, *(HttpReader(socket) for socket in self._tables.sockets if socket not in sockets)]

    def _try(self, act: Callable[[], None]) -> None:
        """Call a function; log its failure, because the rest must still be done."""
        try:
            act()
        except Exception:  # noqa: BLE001 - any internal error
            self.num_bugs += 1
            _log.exception("internal error while a client came or left; the other clients are served")

    def count_bug(self) -> None:
        """Count an internal error; see `ClientWatch`."""
        self.num_bugs += 1

    def note_large_frame(self) -> None:
        """Note that a large frame was received or sent; see `ClientWatch`."""
        assert self._memory is not None, "it listens"
        self._memory.note_large_frame(self._clock())

    def _process_request(
        self, connection: ServerConnection, request: Request
    ) -> Response | Awaitable[Response | None] | None:
        """Answer a plain HTTP request; return None to continue the WebSocket handshake."""
        assert isinstance(connection, ServedConnection)
        try:
            read_target(request)
            answer = not_allowed(connection, request) or self._judge_request(connection, request)
        except Exception:  # noqa: BLE001 - an internal error; the library would give the same answer, but not log it
            answer = self._regret_request(connection)
        if answer is None or isinstance(answer, Response):
            return self._finish(connection, request, answer)
        return self._answer_in_time(connection, request, answer)

    @staticmethod
    def _finish(connection: ServedConnection, request: Request, response: Response | None) -> Response | None:
        """Begin to send an answer, if there is one. HEAD gets the headers alone (RFC 9110 section 9.3.2)."""
        if response is not None:
            if method_of(request) == "HEAD":
                response.body = b""
            connection.begin_last_answer()
        return response

    async def _answer_in_time(
        self, connection: ServedConnection, request: Request, answer: Awaitable[Response | None]
    ) -> Response | None:
        """Wait for an answer; after some time, answer that the server is busy."""
        timeout = self._limits.answer_timeout
        try:
            async with asyncio.timeout(timeout):
                response = await answer
        except TimeoutError:
            path = printable(request.path.partition("?")[0], MAX_QUOTED)
            where = address_of(connection)
            _log.warning("%s got no answer to %s in %g s and was sent 503; the server is busy", where, path, timeout)
            response = connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "The server is busy; try again\n")
        except Exception:  # noqa: BLE001 - as above
            response = self._regret_request(connection)
        return self._finish(connection, request, response)

    def _regret_request(self, connection: ServedConnection) -> Response:
        """Count and log the current exception; answer that the server has failed."""
        self.num_bugs += 1
        _log.exception("internal error: an HTTP request of %s could not be answered", address_of(connection))
        return connection.respond(HTTPStatus.INTERNAL_SERVER_ERROR, "The server failed; its log says why\n")

    def _judge_request(
        self, connection: ServedConnection, request: Request
    ) -> Response | Awaitable[Response | None] | None:
        path = request.path.partition("?")[0]
        if path == "/healthz":
            return self._tell_health(connection, request)
        if path == "/version":
            return self._tell_version(connection, request)
        if path == "/metrics" and self.render_metrics is not None:
            return self._tell_metrics(connection, request, self.render_metrics)
        if path == "/map.json" and self.ask_map is not None:
            return self._tell_map(connection, request, self.ask_map)
        if path == "/log.json" and self.render_log is not None:
            return self._tell_log(connection, request, self.render_log)
        return self._judge_root(connection, request, path)

    def _judge_root(
        self, connection: ServedConnection, request: Request, path: str
    ) -> Response | Awaitable[Response | None] | None:
        is_root = path in {"", "/"}
        if is_root and is_upgrade(request):
            return self._judge_handshake(connection, request) if asks_for_websocket(request) else None
        if is_root and (self.page is None or not accepts(request, "Accept", "text/html")):
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

    def _tell_links(self, connection: ServedConnection, request: Request) -> Response | Awaitable[Response]:
        """Answer a program that wants no HTML: name and links, and the version for those who may know it."""
        pages = {"map.json": self.ask_map, "log.json": self.render_log, "metrics": self.render_metrics}
        paths = [] if self.page is None else ["", *(folder.lstrip("/") for folder in self.page.folders)]
        paths += [*(path for path, part in pages.items() if part is not None), "healthz", "version"]
        access = self._limits.access
        body = links_of(paths, has_version=access.judge_data(request, self.own_names) is None)
        response = answer_with(connection, HTTPStatus.OK, body, JSON_KIND)
        response.headers["Vary"] = "Accept"
        return self._late_for_wrong_token(connection, request, response)

    def _late_for_wrong_token(
        self, connection: ServedConnection, request: Request, response: Response
    ) -> Response | Awaitable[Response]:
        """Delay an answer to a request with a wrong token; otherwise tokens could be tried here without a delay."""
        access = self._limits.access
        if access.is_shown(request) or not access.shows_any(request):
            return response
        self._limit(connection)
        return answer_late(connection.lost, response, access.delay)

    def _judge_handshake(
        self, connection: ServedConnection, request: Request
    ) -> Response | Awaitable[Response | None] | None:
        if speaks_another_version(request):
            return answer_version(connection)
        settle_upgrade(request)
        access = self._limits.access
        refusal = self._judge(request)
        if refusal is None:
            if access.is_shown(request):
                self._tables.opening.leave(connection)
                self._trust(connection)
            else:
                self._limit(connection)
            return None
        if refusal.status is HTTPStatus.UNAUTHORIZED:
            self._note_refused_token(connection, Reason.WRONG_TOKEN, "", WRONG_TOKEN)
        self._refused_origins.log(_log, address_of(connection), refusal.text, refusal.origin)
        response = connection.respond(refusal.status, refusal.text)
        return self._delay(connection, response) if refusal.status is HTTPStatus.UNAUTHORIZED else response

    def _delay(self, connection: ServedConnection, response: Response) -> Awaitable[Response]:
        """Send the refusal of a token after a delay; until then the connection counts as one without the token."""
        response.headers["WWW-Authenticate"] = "Bearer"
        self._limit(connection)
        return answer_late(connection.lost, response, self._limits.access.delay)

    def _limit(self, connection: ServedConnection) -> None:
        """Limit a connection without the token until it is trusted."""
        connection.limit_message_size(min(MAX_UNPROVEN_SIZE, self._limits.max_frame_size))
        connection.refuse_extensions()  # without extensions, no decompression is needed
        self._tables.opening.leave(connection)
        if connection in self._tables.sockets:  # else it is already lost, and would never leave its place
            self._tables.unauthenticated.take(connection)

    def _tell_health(self, connection: ServedConnection, request: Request) -> Response | Awaitable[Response]:
        """Answer the state of the server as JSON. Requests that get no data get only status and reason."""
        why = self.why_unhealthy() or (STOPPING if self._is_stopping else None)
        health: dict[str, object] = {"status": "ok"}
        if why is not None:
            health = {"status": "stopping" if why == STOPPING else "failed", "reason": why}
        access = self._limits.access
        if access.judge_data(request, self.own_names) is None:
            health |= {"version": __version__, **self.describe(), "clients": len(self.clients)}
        code = HTTPStatus.OK if why is None else HTTPStatus.SERVICE_UNAVAILABLE
        response = answer_with(connection, code, f"{json.dumps(health)}\n".encode(), JSON_KIND)
        return self._late_for_wrong_token(connection, request, response)

    def _tell_version(self, connection: ServedConnection, request: Request) -> Response | Awaitable[Response]:
        """Answer name, version and protocol, to those who may have data."""
        refusal = self._refuse_data(connection, request, "/version")
        return refusal or answer_with(connection, HTTPStatus.OK, f"{_VERSION}\n".encode(), JSON_KIND)

    def _tell_metrics(
        self,
        connection: ServedConnection,
        request: Request,
        render: Callable[[str], Awaitable[tuple[bytes, str]]],
    ) -> Response | Awaitable[Response]:
        """Answer all counters in Prometheus's format, to those who may have data."""
        refusal = self._refuse_data(connection, request, "/metrics")
        return refusal or self._answer_metrics(connection, render(", ".join(request.headers.get_all("Accept"))))

    async def _answer_metrics(self, connection: ServedConnection, rendered: Awaitable[tuple[bytes, str]]) -> Response:
        body, content_type = await rendered
        return answer_with(connection, HTTPStatus.OK, body, content_type)

    def _tell_log(
        self, connection: ServedConnection, request: Request, render: Callable[[bool], bytes]
    ) -> Response | Awaitable[Response]:
        """Answer the last refusals and warnings, to those who may have data and subscribe to `/sim/refusals`."""
        refusal = self._refuse_data(connection, request, "/log.json")
        if refusal is not None:
            return refusal
        policy = self._limits.policy
        if not policy.may_subscribe(REFUSALS_TOPIC):
            text = f"Not allowed to subscribe to {REFUSALS_TOPIC}, which tells the same\n"
            return connection.respond(HTTPStatus.FORBIDDEN, text)
        response = answer_with(connection, HTTPStatus.OK, render(policy.may_subscribe("/rosout")), JSON_KIND)
        response.headers["Cache-Control"] = "no-store"
        return response

    def _tell_map(
        self,
        connection: ServedConnection,
        request: Request,
        ask: Callable[[str], asyncio.Future[MapText] | None],
    ) -> Response | Awaitable[Response]:
        """Answer the map as JSON, to those who may have data. Patterns for `/sim/map` hold for it."""
        refusal = self._refuse_data(connection, request, "/map.json")
        if refusal is not None:
            return refusal
        if not self._limits.policy.may_call(MAP_SERVICE):
            return connection.respond(
                HTTPStatus.FORBIDDEN, f"Not allowed to call {MAP_SERVICE}, which tells the same\n"
            )
        asked = ask(", ".join(request.headers.get_all("If-None-Match")))
        if asked is None:
            return connection.respond(HTTPStatus.NOT_FOUND, f"The settings have {MAP_SERVICE} turned off\n")
        return answer_map(connection, asked, connection.lost)

    def _refuse_data(
        self, connection: ServedConnection, request: Request, path: str
    ) -> Response | Awaitable[Response] | None:
        """Refuse a path with data to requests without the token, or with an unknown Host; None if it may be told."""
        refusal = self._limits.access.judge_data(request, self.own_names)
        if refusal is None:
            return None
        response = connection.respond(refusal.status, refusal.text)
        if refusal.status is not HTTPStatus.UNAUTHORIZED:
            self._refused_origins.log(_log, address_of(connection), refusal.text, refusal.origin)
            return response
        self._note_refused_token(connection, Reason.NO_TOKEN, "", f"{path} needs the token")
        return self._delay(connection, response)


def _extensions(limits: ServerLimits) -> list[ServerExtensionFactory] | None:
    """Return the extensions that the server accepts."""
    if not limits.is_compressing:
        return None
    return [LateDeflateFactory()]

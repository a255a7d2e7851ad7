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
import logging
import ssl
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from ipaddress import ip_address
from socket import gethostname

from websockets.asyncio.server import Server as WebSocketServer
from websockets.asyncio.server import ServerConnection, serve
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.link.library_log import quiet
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.shell.transport.inflate import LateDeflateFactory
from rosbridge_sim.shell.transport.upgrade_request import answer_to, read_upgrade
from rosbridge_sim.shell.websocket.access import HandshakeRefusal, is_from_autobahn
from rosbridge_sim.shell.websocket.client_totals import ClientTotals
from rosbridge_sim.shell.websocket.connected_client import Client
from rosbridge_sim.shell.websocket.connections import ConnectionTables, ServedConnection, address_of, make_connection
from rosbridge_sim.shell.websocket.freed_memory import MemoryReturn, resident_bytes, trim_memory
from rosbridge_sim.shell.websocket.http_answers import (
    Answer,
    answer_version,
    asks_for_websocket,
    is_upgrade,
    method_of,
    not_allowed,
    read_target,
    settle_upgrade,
    speaks_another_version,
)
from rosbridge_sim.shell.websocket.http_pages import HttpPages
from rosbridge_sim.shell.websocket.limits import CLOSE_TIMEOUT, ServerLimits
from rosbridge_sim.shell.websocket.memory_budget import Holder, HttpReader, MemoryBudget
from rosbridge_sim.shell.websocket.origins import own_names
from rosbridge_sim.shell.websocket.request_gate import RequestGate
from rosbridge_sim.shell.websocket.tls_handshake import TlsRules
from rosbridge_sim.shell.websocket.turns import Turns
from rosbridge_sim.shell.websocket.unauthenticated import WRONG_TOKEN, UnauthenticatedConnection

_log = logging.getLogger("rosbridge_sim.server")


class Server:
    """A listener that makes each connection a peer of the bus.

    Attributes:
        clients: the connected clients, in order of arrival.
        on_clients: called when a client has connected or left.
        pages: the answers to plain HTTP requests.
        num_bugs: number of frames and requests that failed by an internal error; each is in the log with its traceback.
            Errors counted by the bus's guard are not included.
        port: the real port, after the start.
        addresses: addresses on which it listens, without the port.
        is_loopback: it can only be reached from this machine.
    """

    def __init__(self, bus: Bus, limits: ServerLimits, on_change: Callable[[], None]) -> None:
        """Create a server that does not listen yet.

        Args:
            on_change: called after each frame and each departure, because the world may be due earlier than planned.
        """
        self.clients: dict[Client, None] = {}
        self.on_clients: Callable[[], None] = lambda: None
        self.num_bugs = 0
        self.port = 0
        self.addresses: tuple[str, ...] = ()
        self._bus = bus
        self._limits = limits
        self._on_change = on_change
        self._turns: Turns | None = None
        self._memory: MemoryReturn | None = None
        self._budget: MemoryBudget | None = None
        self._server: WebSocketServer | None = None
        self._tables = ConnectionTables(limits.access.max_strangers, limits.open_timeout, self._take_request)
        self.is_loopback = False
        self._gate = RequestGate(bus, limits, self._tables)
        self.pages = HttpPages(self._gate, limits, lambda: len(self.clients))
        self._left = ClientTotals()  # totals of the clients that have left

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
        self._turns = Turns(loop, self._on_change)

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
            extensions=[LateDeflateFactory()] if limits.is_compressing else None,
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
        self._gate.own_names = own_names(gethostname())

    async def stop(self) -> None:
        """Close every connection with code 1001 and stop listening; it takes at most a second and a half."""
        self.pages.is_stopping = True
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
            why = None if socket.is_trusted else await self._let_prove(socket)
            if why is None:
                await self._serve_client(socket)
            else:
                _log.info("%s turned away: %s", address_of(socket), why)
        except Exception:  # the library closes it with code 1011, but its own log line is suppressed
            self._note_unserved(socket)
            raise

    def _note_unserved(self, socket: ServedConnection) -> None:
        self.num_bugs += 1
        _log.exception("internal error: %s could not be served", address_of(socket))

    async def _let_prove(self, socket: ServedConnection) -> str | None:
        """Wait until a connection has sent the token.

        Returns:
            None if it has; else why it was closed, for example because there are too many clients.
        """
        assert self._turns is not None, "it listens"
        note = partial(self._gate.note_refused_token, socket)
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
        if request is None or self.pages.is_stopping or not self._may_enter(request):
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
            request, len(self.clients), is_loopback=self.is_loopback, own_names=self._gate.own_names
        )

    def _add_client(self, socket: ServedConnection, request: Request | None) -> Client:
        """Make a connection a client; the caller lets it listen."""
        assert self._turns is not None, "it listens"
        client = Client(socket, self._bus, self._limits, self._turns, self, is_from_autobahn=is_from_autobahn(request))
        self.clients[client] = None
        client.number = self._left.num_clients + len(self.clients)
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
        self._memory.note_large_frame(asyncio.get_running_loop().time())

    def _process_request(self, connection: ServerConnection, request: Request) -> Answer | None:
        """Answer a plain HTTP request; return None to continue the WebSocket handshake."""
        assert isinstance(connection, ServedConnection)
        try:
            read_target(request)
            answer = not_allowed(connection, request) or self._judge_request(connection, request)
        except Exception:  # noqa: BLE001 - an internal error; the library would give the same answer, but not log it
            answer = self._regret_request(connection)
        if isinstance(answer, Response):
            return self._finish(connection, request, answer)
        return None if answer is None else self._answer_in_time(connection, request, answer)

    @staticmethod
    def _finish(connection: ServedConnection, request: Request, response: Response) -> Response:
        """Begin to send an answer. HEAD gets the headers alone (RFC 9110 section 9.3.2)."""
        if method_of(request) == "HEAD":
            response.body = b""
        connection.begin_last_answer()
        return response

    async def _answer_in_time(
        self, connection: ServedConnection, request: Request, answer: Awaitable[Response]
    ) -> Response:
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

    def _judge_request(self, connection: ServedConnection, request: Request) -> Answer | None:
        path = request.path.partition("?")[0]
        if path in {"", "/"} and is_upgrade(request):
            return self._judge_handshake(connection, request) if asks_for_websocket(request) else None
        return self.pages.answer(connection, request, path)

    def _judge_handshake(self, connection: ServedConnection, request: Request) -> Answer | None:
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
                self._gate.limit(connection)
            return None
        if refusal.status is HTTPStatus.UNAUTHORIZED:
            self._gate.log(connection, refusal)
        return self._gate.refuse(connection, refusal, Reason.WRONG_TOKEN, WRONG_TOKEN)

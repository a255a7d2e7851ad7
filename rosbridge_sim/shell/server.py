"""WebSocket clients and plain HTTP on one port.

Neither reading nor writing needs a task: a frame goes from the transport straight to the client's `Peer`, who
carries it to its end (`direct.py`). What is sent waits in outboxes until the loop's next turn, then goes to each
socket together, in one write, for as long as the socket takes it; when it is full, the transport tells us once there
is room again. What does not fit meanwhile is the outbox's business (`protocol/flow.py`). A task for each connection
sees to its end; the `websockets` library does the handshake, pings, limits and the closing.

Roads not taken: the library's `send` costs a task switch and a system call for each message; writing at the end of
each read, and not in the next turn, costs many clients that speak to one listener a fifth of their calls.
"""

from __future__ import annotations

import asyncio
import logging
import ssl
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from ipaddress import ip_address
from typing import Any

from websockets.asyncio.server import Server as WebSocketServer
from websockets.asyncio.server import ServerConnection, serve
from websockets.frames import CloseCode
from websockets.http11 import Request, Response
from websockets.protocol import State

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peer import Peer
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.protocol.flow import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.shell.access import Access, Warden
from rosbridge_sim.shell.direct import DirectSocket

__all__ = ["Client", "Server", "ServerLimits", "quiet"]

_log = logging.getLogger("rosbridge_sim.server")

WRITE_SIZE = 64 * 1024
"""Bytes handed to the transport at once; about what a loopback socket's buffer takes."""

CLOSE_TIMEOUT = 1.0
"""How long a client may take to hear that it is closed [s]; who does not read is cut off then."""

_NEVER = float("inf")


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """What one connection may do.

    Attributes:
        max_frame_size: a longer frame closes the connection with code 1009 [bytes].
        ping_interval, ping_timeout: the watchdog against half-open connections [s]; None is off.
        is_compressing: accept permessage-deflate from clients that offer it.
        is_talkative: send status frames.
        outbox: what a client may leave unread.
        access: who may connect, and how fast a client may talk.
        policy: what a client may do.
    """

    max_frame_size: int = 16 * 2**20
    ping_interval: float | None = 20.0
    ping_timeout: float | None = 20.0
    is_compressing: bool = False
    is_talkative: bool = True
    outbox: OutboxLimits = field(default_factory=OutboxLimits)
    access: Access = field(default_factory=Access)
    policy: Policy = OPEN


class _Socket(DirectSocket):
    """A connection that stands in a table for as long as it is open.

    Attributes:
        is_proven: its handshake has shown the token, if one is wanted.
    """

    is_proven = False

    def __init__(self, table: dict[_Socket, None], *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 - the library's own
        super().__init__(*args, **kwargs)
        self._table = table

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._table[self] = None
        super().connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self._table.pop(self, None)
        super().connection_lost(exc)


class Client:
    """One connected client: its socket, its outbox, its peer on the bus.

    Attributes:
        host: the address it comes from, without the port.
        connected_ns: since when [ns, the time of day].
        num_bytes_sent: what the transport was given [bytes].
        receive: does what a frame asks, as `Peer.receive`.
    """

    def __init__(self, socket: _Socket, bus: Bus, limits: ServerLimits) -> None:
        self.socket = socket
        self.outbox = Outbox(limits.outbox, self._wake, self.carry)
        session = Session(
            self.outbox, self._set_alarm, max_frame_size=limits.max_frame_size, is_talkative=limits.is_talkative
        )
        self.host = str(socket.remote_address[0]) if socket.remote_address else ""
        self.connected_ns = time.time_ns()
        self.num_bytes_sent = 0
        self.peer = Peer(bus, session, _address_of(socket), limits.policy)
        self.receive = self.peer.receive
        self._access = limits.access
        self._deadline: asyncio.TimerHandle | None = None
        self._is_woken = False
        # The due time is kept here: a handle of uvloop whose delay rounds to 0 ms cannot tell it.
        self._alarm: asyncio.Handle | None = None
        self._alarm_due = _NEVER
        self._closing: asyncio.Task[None] | None = None
        socket.on_room = self.carry
        if not socket.is_proven or limits.access.max_rate is not None:
            self._post_warden(limits.access)

    def _post_warden(self, access: Access) -> None:
        """Have frames looked at before they reach the peer."""
        loop, is_proven = self.socket.loop, self.socket.is_proven
        warden = Warden(
            self.peer, access, loop.time(), is_proven=is_proven, on_proven=self._welcome, close=self._close_politely
        )
        self.receive = warden.receive
        if not is_proven:
            self._deadline = loop.call_later(access.patience, warden.expire)

    def _welcome(self) -> None:
        """The token was shown: no deadline any more, and no warden but for the rate."""
        if self._deadline is not None:
            self._deadline.cancel()
        if self._access.max_rate is None:
            self.receive = self.peer.receive

    def _wake(self) -> None:
        if not self._is_woken:
            self._is_woken = True
            self.socket.loop.call_soon(self.carry)

    def _set_alarm(self, due: float) -> None:
        """Flush the peer's feeds at `due`, or earlier if an earlier alarm is set already."""
        if due < self._alarm_due:
            if self._alarm is not None:
                self._alarm.cancel()
            self._alarm_due = due
            self._alarm = self.socket.loop.call_at(due, self._flush)

    def _flush(self) -> None:
        self._alarm = None
        self._alarm_due = _NEVER
        self.peer.flush(self.socket.loop.time())

    def leave(self) -> None:
        """Take the client off the bus, whatever was on its way to it."""
        for timer in (self._alarm, self._deadline):
            if timer is not None:
                timer.cancel()
        self.outbox.close()
        self.peer.leave(self.socket.loop.time())

    def carry(self) -> None:
        """Hand what waits to the transport, for as long as it takes it."""
        self._is_woken = False
        socket, outbox = self.socket, self.outbox
        if socket.protocol.state is not State.OPEN:
            outbox.close()
            return
        while len(outbox) and not socket.paused:
            self.num_bytes_sent += socket.send_messages(outbox.take(WRITE_SIZE))
        if outbox.is_overfull and self._closing is None:
            _log.warning("%s reads too slowly: %d bytes wait; closing", self.peer.address, outbox.num_bytes)
            outbox.close()
            self._start_closing("answers were left unread for too long")

    def _close_politely(self, reason: str) -> None:
        """Close with code 1008, after what the client was told."""
        self.carry()
        self._start_closing(reason)

    def _start_closing(self, reason: str) -> None:
        if self._closing is None:
            self._closing = self.socket.loop.create_task(self._close(reason))

    async def _close(self, reason: str) -> None:
        """Close with a reason; a socket that takes no more bytes would keep the closing itself waiting."""
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                await self.socket.close(CloseCode.POLICY_VIOLATION, reason)
        except TimeoutError:
            self.socket.transport.abort()


class Server:
    """Listens, and makes each connection a peer of the bus.

    Attributes:
        clients: who is connected now, in order of arrival.
        on_clients: called when somebody has come or gone.
        num_bugs: frames whose handling failed by a fault of ours; each is in the log with its traceback.
        port: the real port, once started.
        addresses: on which it listens, without the port.
        is_loopback: it can be reached from this machine alone.
    """

    def __init__(self, bus: Bus, limits: ServerLimits, on_change: Callable[[], None]) -> None:
        """A server that does not listen yet.

        Args:
            bus: where clients meet.
            limits: for each connection.
            on_change: called after each frame and each departure: the world may be due earlier than planned.
        """
        self.clients: dict[Client, None] = {}
        self.on_clients: Callable[[], None] = lambda: None
        self.num_bugs = 0
        self.port = 0
        self.addresses: tuple[str, ...] = ()
        self._bus = bus
        self._limits = limits
        self._on_change = on_change
        self._server: WebSocketServer | None = None
        self._sockets: dict[_Socket, None] = {}
        self.is_loopback = False

    async def start(self, host: str, port: int, tls: ssl.SSLContext | None = None) -> None:
        """Listen, with a certificate at wss://; port 0 takes a free one.

        Raises:
            OSError: the address cannot be had.
        """
        limits = self._limits
        self._server = await serve(
            self._serve,
            host,
            port,
            ssl=tls,
            create_connection=partial(_Socket, self._sockets),  # type: ignore[arg-type] # it is only ever called
            process_request=self._process_request,
            compression="deflate" if limits.is_compressing else None,
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

    async def stop(self) -> None:
        """Close every connection with code 1001 and stop listening; takes a second and a half at most."""
        if self._server is not None:
            self._server.close()
            try:
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await self._server.wait_closed()
            except TimeoutError:  # some do not read, not even that we go; some never said what they want
                for socket in self._sockets:
                    socket.transport.abort()
                await self._server.wait_closed()

    async def _serve(self, socket: ServerConnection) -> None:
        assert isinstance(socket, _Socket)
        client = Client(socket, self._bus, self._limits)
        peer = client.peer
        clock = socket.loop.time
        self.clients[client] = None
        self.on_clients()
        _log.info("%s connected; %d connected now", peer.address, len(self.clients))

        def receive(message: bytes) -> None:
            try:
                client.receive(message, clock())
            except Exception:  # noqa: BLE001 - our own bug: this message is lost, everybody goes on
                self.num_bugs += 1
                _log.exception("a frame of %s could not be handled", peer.address)
                peer.tell("error", "The server failed on a message; its log says why")

        try:
            socket.listen(receive, self._on_change)
            await socket.wait_closed()
        finally:
            del self.clients[client]
            self.on_clients()
            client.leave()
            self._on_change()
            _log.info("%s left; %d connected now", peer.address, len(self.clients))

    def _process_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Plain HTTP: None lets the WebSocket handshake go on."""
        path = request.path.partition("?")[0]
        if path == "/healthz":
            return connection.respond(HTTPStatus.OK, "ok\n")
        if path not in {"", "/"}:
            return connection.respond(HTTPStatus.NOT_FOUND, f"There is nothing at {path}; rosbridge is at /\n")
        if "Upgrade" not in request.headers:
            return None  # a browser that looks what is here: the library tells it
        access = self._limits.access
        refusal = access.judge(request, len(self.clients), is_loopback=self.is_loopback)
        if refusal is None:
            assert isinstance(connection, _Socket)
            connection.is_proven = access.is_shown(request)
            return None
        _log.info("%s refused: %s", _address_of(connection), refusal.text.rstrip())
        response = connection.respond(refusal.status, refusal.text)
        if refusal.status is HTTPStatus.UNAUTHORIZED:
            response.headers["WWW-Authenticate"] = "Bearer"
        return response


def _address_of(connection: ServerConnection) -> str:
    address = connection.remote_address
    return f"{address[0]}:{address[1]}" if address else ""


class _Quiet(logging.LoggerAdapter[Any]):
    """The library logs a traceback for each handshake that a port scanner breaks off; a line at debug is enough."""

    def log(self, level: int, msg: object, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 - logging's own signature
        if level >= logging.INFO:
            level = logging.DEBUG
            kwargs.pop("exc_info", None)
        super().log(level, msg, *args, **kwargs)


quiet = _Quiet(logging.getLogger("rosbridge_sim.websockets"), {})

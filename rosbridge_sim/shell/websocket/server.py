"""WebSocket clients and plain HTTP on one port.

Neither reading nor writing needs a task: a frame goes from the transport straight to the client's `Peer`, which does
what it asks, op by op (`server_connection.py`). What takes long goes on in later turns (`turns.py`). What is sent waits
in outboxes until the loop's next turn, then goes to each socket together, in one write, for as long as the socket takes
it; when it is full, the transport tells us once there is room again. What does not fit meanwhile is the outbox's
business (`protocol/outbox.py`). A task for each connection sees to its end; the `websockets` library does the
handshake, pings, limits and the closing.

Roads not taken: the library's `send` costs a task switch and a system call for each message; writing at the end of
each read, and not in the next turn, costs many clients that speak to one listener a fifth of their calls.
"""

from __future__ import annotations

import asyncio
import json
import logging
import ssl
import time
import zlib
from collections.abc import Awaitable, Callable, Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from ipaddress import ip_address
from socket import gethostname
from time import perf_counter
from typing import ParamSpec, Protocol

from websockets.asyncio.server import Server as WebSocketServer
from websockets.asyncio.server import ServerConnection, serve
from websockets.extensions.base import ServerExtensionFactory
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peer import Peer, Work
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.protocol.account import Account
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.shell.websocket.access import Access, RateGate, Refusal
from rosbridge_sim.shell.websocket.inflate import (
    Deflated,
    DeflatedText,
    LateDeflate,
    LateDeflateFactory,
    inflate,
    library_deflate,
)
from rosbridge_sim.shell.websocket.library_connection import LibraryConnection
from rosbridge_sim.shell.websocket.library_log import quiet
from rosbridge_sim.shell.websocket.memory import LARGE_FRAME, MemoryReturn
from rosbridge_sim.shell.websocket.memory_budget import MemoryBudget
from rosbridge_sim.shell.websocket.origins import MAX_REFUSED_ORIGINS, RefusedOrigins, own_names
from rosbridge_sim.shell.websocket.server_connection import DirectConnection
from rosbridge_sim.shell.websocket.strangers import MAX_UNPROVEN_SIZE, WRONG_TOKEN, ConnectionPlaces, Stranger
from rosbridge_sim.shell.websocket.text_check import TextCheck
from rosbridge_sim.shell.websocket.tls_door import TlsDoor, TlsRules
from rosbridge_sim.shell.websocket.turns import Turns
from rosbridge_sim.version import __version__

__all__ = ["Client", "Server", "ServerLimits"]

P = ParamSpec("P")

_log = logging.getLogger("rosbridge_sim.server")

MAX_REASON = 120
"""Characters of a reason in a close frame, which has room for 123 bytes (RFC 6455 section 5.5)."""

MAX_CARRIED = 2 * 2**20
"""Bytes that are handed to one transport in one turn: some 1 ms. The rest goes in later turns."""

WRITE_SIZE = 64 * 1024
"""Bytes handed to the transport at once; about what a loopback socket's buffer takes."""

CLOSE_TIMEOUT = 1.0
"""How long a client may take to hear that it is closed [s]; who does not read is cut off then."""

_VERSION = json.dumps({"name": "rosbridge-sim", "version": __version__, "protocol": "rosbridge v2.0"})
"""Answer of `/version`; the protocol is called as its specification calls itself."""

_NEVER = float("inf")

TLS_TIMEOUT = 5.0
"""Longest TLS handshake [s]: two round trips, with a slow phone far away half a second."""

OPEN_TIMEOUT = 5.0
"""Longest time from there to the whole request [s]: one packet of a real client."""

MAX_OPENING = 256
"""Connections without a whole request at once, those in a TLS handshake included; the oldest one is cut off for a new
one. The system hands over some hundred in one go (the backlog), and each has its request read in the next turn of the
loop. Together with strangers they leave most of the usual 1,024 file descriptors to clients."""

_SILENT = "its request had not come when too many other connections did"
_CROWDED = "more connections without a token came than there are places for (--max-strangers)"

STRANGERS = "no token"
"""Name under which the log and `/sim/refusals` have all connections that have not shown the token."""


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """What one connection may do.

    Attributes:
        max_frame_size: a longer frame closes the connection with code 1009 [bytes].
        ping_interval, ping_timeout: the watchdog against half-open connections [s]; None is off.
        is_compressing: accept permessage-deflate from clients that offer it.
        is_direct: read frames by our own code, and not by the library's.
        is_talkative: send status frames.
        outbox: what a client may leave unread.
        client_memory: what one client may make the server hold, apart from its outbox [bytes].
        memory_budget: the same for all clients together, their outboxes included [bytes]; None is no limit.
        access: who may connect, and how fast a client may talk.
        policy: what a client may do.
        tls_timeout, open_timeout: for the TLS handshake, and for the request after it [s].
    """

    max_frame_size: int = 16 * 2**20
    ping_interval: float | None = 20.0
    ping_timeout: float | None = 20.0
    is_compressing: bool = False
    is_direct: bool = True
    is_talkative: bool = True
    client_memory: int = 256 * 2**20
    memory_budget: int | None = None
    outbox: OutboxLimits = field(default_factory=OutboxLimits)
    access: Access = field(default_factory=Access)
    policy: Policy = OPEN
    tls_timeout: float = TLS_TIMEOUT
    open_timeout: float = OPEN_TIMEOUT


class _Tables:
    """All connections, and where those stand that are no clients yet."""

    def __init__(self, max_strangers: int) -> None:
        self.sockets: dict[_Socket, None] = {}
        self.doors: dict[TlsDoor, None] = {}
        self.opening = ConnectionPlaces(MAX_OPENING)
        self.strangers = ConnectionPlaces(max_strangers)


class _Socket(DirectConnection):
    """A connection that stands in tables for as long as it is open."""

    def __init__(self, tables: _Tables, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._tables = tables

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._tables.sockets[self] = None
        self._tables.opening.take(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self._tables.sockets.pop(self, None)
        self._tables.opening.leave(self)
        self._tables.strangers.leave(self)
        super().connection_lost(exc)

    def evict(self) -> None:
        """Close it without waiting for the other side: its place is taken."""
        _log.info("%s cut off: %s", _address_of(self), _CROWDED if self.request is not None else _SILENT)
        self.forget()
        if self.is_open:
            self.core.fail(CloseCode.TRY_AGAIN_LATER, _CROWDED)
            self.flush()
        if self.transport.get_write_buffer_size():
            self.transport.abort()
        else:
            self.transport.close()


class _LibrarySocket(_Socket, LibraryConnection):
    """The same, without the shortcut of `DirectConnection`."""


def _make_connection(
    kind: type[_Socket], tables: _Tables, rules: TlsRules | None, *args: LibraryArgument, **kwargs: LibraryArgument
) -> asyncio.Protocol:
    """Make the protocol of a connection that was accepted; `rules` are those of TLS, if it is to be encrypted."""
    socket = kind(tables, *args, **kwargs)
    return socket if rules is None else TlsDoor(socket, rules, tables.opening, tables.doors)


class ClientWatch(Protocol):
    """Events that a client reports to its server."""

    def count_bug(self) -> None:
        """Count a fault of ours that has shown while something was done for a client."""

    def note_large_frame(self) -> None:
        """Take note that a large frame came or went."""


class Client:
    """One connected client: its socket, its outbox, its peer on the bus.

    Attributes:
        host: the address it comes from, without the port.
        connected_ns: since when [ns, the time of day].
        num_bytes_sent: what the transport was given [bytes].
        has_failed: a failure of ours in what is this client's alone has been found; it is closing.
    """

    def __init__(self, socket: _Socket, bus: Bus, limits: ServerLimits, turns: Turns, watch: ClientWatch) -> None:
        """A client that nothing is read from yet.

        Args:
            socket: its connection, open.
            bus: where it meets the others.
            limits: of what it may do.
            turns: when it may work.
            watch: hears of what concerns the whole server.
        """
        self.socket = socket
        self.outbox = Outbox(limits.outbox, self._wake, self.carry)
        session = Session(
            self.outbox,
            self._set_alarm,
            max_frame_size=limits.max_frame_size,
            is_talkative=limits.is_talkative,
            account=Account(limits.client_memory, bus.total),
        )
        self.host = str(socket.remote_address[0]) if socket.remote_address else ""
        self.connected_ns = time.time_ns()
        self.num_bytes_sent = 0
        self.peer = Peer(bus, session, _address_of(socket), limits.policy)
        self._bus = bus
        bus.accounts[self.peer] = session.account
        self._begin_frame: Callable[[bytes, float], Work | None] = self.peer.begin
        self._max_frame_size = limits.max_frame_size
        self._turns = turns
        self._watch = watch
        self._guard = bus.guard
        self.has_failed = False
        self._clock = socket.loop.time
        self._is_woken = False
        # The due time is kept here: a handle of uvloop whose delay rounds to 0 ms cannot tell it.
        self._alarm: asyncio.Handle | None = None
        self._alarm_due = _NEVER
        self._closing: asyncio.Task[None] | None = None
        self._until = 0.0
        self._work: Work | None = None
        self._has_input = False
        self._has_output = False
        self._is_in_line = False
        socket.on_room = self.carry
        self.peer.on_failure = self._fail
        self.peer.on_released = lambda: self._get_in_line(had_turn=False)
        if limits.access.max_rate is not None:
            self._begin_frame = RateGate(self.peer, limits.access.max_rate, self._clock()).begin

    # Memory, as a `Holder`

    @property
    def name(self) -> str:
        """Address of the client, for people to read."""
        return self.peer.address

    @property
    def num_bytes_held(self) -> int:
        """Memory that the server holds for it: in its account, its outbox, its socket, and as parameters [bytes]."""
        waiting = self.outbox.num_bytes + self.socket.transport.get_write_buffer_size() + self.socket.num_bytes_held
        return waiting + self.peer.session.account.num_bytes + self._bus.parameters.num_held(self.peer)

    def shared(self) -> Iterator[tuple[int, int]]:
        """The frames and messages that wait, which others may wait for, too."""
        yield from self.outbox.frames()
        yield from self.peer.session.waiting()

    def evict(self, reason: str) -> None:
        """Close it at once with code 1008, and let go of all it holds."""
        self.peer.session.remark("error", reason)
        self.carry()
        self._start_closing(CloseCode.POLICY_VIOLATION, reason[:MAX_REASON])
        self._bus.forget_latched(self.peer)
        self.leave()

    # In, as the `Receiver` of its socket

    def begin(self) -> float:
        """Begin a turn; see `Turns.begin`."""
        self._until = self._turns.begin()
        return self._until

    def receive(self, message: bytes) -> bool:
        """Do what a frame asks, as far as the turn goes; return whether the next one may come."""
        if type(message) is not bytes:
            assert isinstance(message, Deflated), "a socket hands over nothing else"
            self._work = _InflatedWork(self, message)
            return self._do_steps()
        try:
            work = self._begin_frame(message, self._clock())
        except Exception:  # noqa: BLE001 - our own bug: this message is lost, everybody goes on
            self._regret_frame()
            return True
        if work is None:
            return not self.peer.num_holds
        if len(message) >= LARGE_FRAME:
            self._watch.note_large_frame()
        self._work = work
        return self._do_steps()

    def _do_steps(self) -> bool:
        """Go on with the frame in hand until the turn is over; return whether it is done with."""
        while self._work is not None:
            if self.outbox.is_overfull or self._closing is not None:  # it does not hear the answers
                self._work = None
                self.carry()
                break
            try:
                if not self._work.step(self._clock()):
                    self._work = None
                    break
            except Exception:  # noqa: BLE001 - as above; the rest of the frame is lost with it
                self._regret_frame()
                self._work = None
                break
            if self.peer.is_held or perf_counter() >= self._until:
                return False
        return not self.peer.is_held

    def _regret_frame(self) -> None:
        self._watch.count_bug()
        _log.exception("a frame of %s could not be handled", self.peer.address)
        if not self.has_failed:
            self.peer.notify("error", "The server failed on a message; its log says why")

    def inflate(self, message: Deflated) -> Generator[None, None, Work | None]:
        """Inflate a message, in slices, and begin the frame that it holds."""
        extension = self.socket.extension(LateDeflate)
        try:
            frame = yield from inflate(extension, message, self._max_frame_size)
        except zlib.error as error:
            self._start_closing(CloseCode.INVALID_DATA, f"decompression failed: {error}")
            return None
        if frame is None:
            text = f"a message inflates to more than {self._max_frame_size:,} bytes"
            self._start_closing(CloseCode.MESSAGE_TOO_BIG, text)
            return None
        if isinstance(message, DeflatedText) and not frame.isascii():
            check = TextCheck(frame)
            while check.step():
                yield
            if check.fault:
                self.socket.refuse(check.fault)
                return None
        return self._begin_frame(frame, self._clock())

    # Turns

    def wait(self, *, had_turn: bool) -> None:
        """Have the socket go on in a later turn."""
        self._has_input = True
        self._get_in_line(had_turn=had_turn)

    def _get_in_line(self, *, had_turn: bool) -> None:
        is_waiting = self._has_output or (self._has_input and not self.peer.is_held)
        if is_waiting and not self._is_in_line:
            self._is_in_line = True
            self._turns.wait(self, had_turn=had_turn)

    def work(self, until: float) -> bool:
        """Go on with what was left: frames to make, then frames to read; return whether any is left still."""
        try:
            self._work_until(until)
        except Exception as error:  # noqa: BLE001 - our own bug, in what is this client's alone
            self._is_in_line = False
            self._guard.blame(self.peer, error)
        return self._is_in_line

    def _work_until(self, until: float) -> None:
        self._until = until
        if self._has_output:
            self._has_output = False
            self.carry()
        if self._has_input and not self.peer.is_held and self._do_steps():
            self._has_input = self.socket.go_on(until)
        self._is_in_line = self._has_output or (self._has_input and not self.peer.is_held)

    # Out

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
        self._contain(self.peer.flush, self.socket.loop.time())

    def _contain(self, act: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> None:
        """Do something that concerns this client alone; if it fails, the client is closed."""
        try:
            act(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - our own bug, in what is this client's alone
            self._guard.blame(self.peer, error)

    def _fail(self, error: Exception) -> None:
        """Close this client alone, with code 1011: something that was done for it has failed by a bug of ours.

        For the bus's guard, which has an eye on this too.
        """
        if self.has_failed:
            return
        self.has_failed = True  # first of all: the log is a topic, and this client may listen to it
        _log.error("%s: closed, because of a failure of ours", self.peer.address, exc_info=error)
        try:
            self._start_closing(CloseCode.INTERNAL_ERROR, "the server failed on this connection; its log says why")
        except Exception:  # noqa: BLE001 - whatever is wrong with it, it is to go
            _log.exception("%s: it could not be closed; cut off", self.peer.address)
            self.socket.transport.abort()
        self.leave()

    def leave(self) -> None:
        """Take the client off the bus, whatever was on its way to it. Twice is no error."""
        try:
            if self._alarm is not None:
                self._alarm.cancel()
            self._turns.leave(self)
            self._work = None
            self.outbox.close()
        finally:
            self.peer.leave(self.socket.loop.time())

    def carry(self) -> None:
        """Hand what waits to the transport, for as long as it takes it, and about as much as one turn has time for."""
        self._contain(self._carry)

    def _carry(self) -> None:
        self._is_woken = False
        socket, outbox = self.socket, self.outbox
        if not socket.is_open:
            outbox.close()
            return
        left = MAX_CARRIED
        while (socket.unsent or len(outbox)) and not socket.is_full:
            frames: list[bytes] = []
            if socket.unsent:
                self.num_bytes_sent += socket.send_more()
            else:
                frames = outbox.take(WRITE_SIZE)
            if frames:
                num_bytes = socket.send_messages(frames)
                if num_bytes >= LARGE_FRAME:
                    self._watch.note_large_frame()
                self.num_bytes_sent += num_bytes
                left -= num_bytes
            if not frames or left <= 0 or socket.unsent:
                self._has_output = True
                self._get_in_line(had_turn=True)
                break
        if outbox.is_overfull and self._closing is None:
            _log.warning("%s reads too slowly: %d bytes wait; closing", self.peer.address, outbox.num_bytes)
            outbox.close()
            self._start_closing(CloseCode.POLICY_VIOLATION, "answers were left unread for too long")

    def _start_closing(self, code: CloseCode, reason: str) -> None:
        """Close with a code and a reason; nothing more of this client's is done."""
        if self._closing is None:
            self.socket.forget()
            self._closing = self.socket.loop.create_task(self._close(code, reason))

    async def _close(self, code: CloseCode, reason: str) -> None:
        """Close with a reason; a socket that takes no more bytes would keep the closing itself waiting."""
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                await self.socket.close(code, reason)
        except TimeoutError:
            self.socket.transport.abort()
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it, it is to go
            self._guard.note(f"closing the connection of {self.peer.address}", error)
            self.socket.transport.abort()


class _InflatedWork:
    """A compressed message: it is inflated, then read."""

    __slots__ = ("_slices", "_work")

    def __init__(self, client: Client, message: Deflated) -> None:
        self._slices = client.inflate(message)
        self._work: Work | None = None

    def step(self, now: float) -> bool:
        if self._work is not None:
            return self._work.step(now)
        try:
            next(self._slices)
        except StopIteration as end:
            self._work = end.value
            return self._work is not None
        return True


class Server:
    """Listens, and makes each connection a peer of the bus.

    Attributes:
        clients: who is connected now, in order of arrival.
        on_clients: called when somebody has come or gone.
        why_unhealthy: asked for `/healthz`: why the server does not do all that it should; None where it does.
        num_bugs: frames whose handling failed by a fault of ours, and the like; each is in the log with its traceback.
            What the bus's guard has counted is not among them.
        port: the real port, once started.
        addresses: on which it listens, without the port.
        is_loopback: it can be reached from this machine alone.
        own_names: names of this machine, by which web pages may call it.
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
        self.why_unhealthy: Callable[[], str | None] = lambda: None
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
        self._tables = _Tables(limits.access.max_strangers)
        self.is_loopback = False
        self.own_names: frozenset[str] = frozenset()
        self._refused_origins = RefusedOrigins()

    async def start(self, host: str, port: int, tls: ssl.SSLContext | None = None) -> None:
        """Listen, with a certificate at wss://; port 0 takes a free one.

        Raises:
            OSError: the address cannot be had.
        """
        limits = self._limits
        loop = asyncio.get_running_loop()
        self._turns, self._memory = Turns(loop, self._on_change), MemoryReturn(loop)
        if limits.memory_budget is not None:
            self._budget = MemoryBudget(loop, self._bus, lambda: list(self.clients), limits.memory_budget)
        kind = _Socket if limits.is_direct else _LibrarySocket
        rules = None if tls is None else TlsRules(tls, limits.tls_timeout, CLOSE_TIMEOUT)
        self._server = await serve(
            self._serve,
            host,
            port,
            open_timeout=limits.open_timeout,
            create_connection=partial(_make_connection, kind, self._tables, rules),  # type: ignore[arg-type] # it is only ever called
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
        """Close every connection with code 1001 and stop listening; takes a second and a half at most."""
        for part in (self._memory, self._budget):
            if part is not None:
                part.stop()
        if self._server is not None:
            self._server.close()
            for door in list(self._tables.doors):
                door.evict()
            try:
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await self._server.wait_closed()
            except TimeoutError:  # some do not read, not even that we go; some never said what they want
                for socket in self._tables.sockets:
                    socket.transport.abort()
                for door in list(self._tables.doors):  # the system had accepted them already
                    door.evict()
                await self._server.wait_closed()

    async def _serve(self, socket: ServerConnection) -> None:
        """Serve a connection to its end."""
        assert isinstance(socket, _Socket)
        try:
            await self._serve_socket(socket)
        except Exception:  # the library closes it with code 1011, and its own words about that are not logged
            self.num_bugs += 1
            _log.exception("%s could not be served", _address_of(socket))
            raise

    async def _serve_socket(self, socket: _Socket) -> None:
        """Serve a client, after it has shown the token if one is wanted."""
        if not socket.is_trusted:
            why = await self._let_prove(socket)
            if why is not None:
                _log.info("%s turned away: %s", _address_of(socket), why)
                return
        await self._serve_client(socket)

    async def _let_prove(self, socket: _Socket) -> str | None:
        """Wait until a stranger has shown the token; why it was closed if it has not, or has found no room."""
        assert self._turns is not None, "it listens"
        note = partial(self._note_stranger, socket)
        access, is_talkative = self._limits.access, self._limits.is_talkative
        stranger = Stranger(socket, access, self._turns, is_talkative=is_talkative, on_refusal=note)
        try:
            socket.listen(stranger)
            why = await stranger.wait_settled()
            code = CloseCode.POLICY_VIOLATION
            if why is None and self._limits.access.is_full(len(self.clients)):
                code, why = CloseCode.TRY_AGAIN_LATER, f"there are {len(self.clients)} clients already; try again later"
            if why is None:
                self._tables.strangers.leave(socket)
                self._trust(socket)
                if stranger.rest:
                    socket.put_back(stranger.rest)
                return None
            stranger.let_go()
            with suppress(TimeoutError):
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await socket.close(code, why)
            socket.transport.abort()
            return why
        finally:
            stranger.leave()

    def _note_stranger(self, socket: ServerConnection, reason: Reason, op: str, text: str) -> None:
        """Tell the log and `/sim/refusals` of a connection without the token.

        All of them count as one client there, because each attempt can come from another port or address.
        """
        text = f"{text}; the connection is {_address_of(socket)}"
        refusal = RefusedRequest(STRANGERS, reason, op, "", text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)

    def _trust(self, socket: _Socket) -> None:
        """Have a connection treated as a client's from now on."""
        socket.is_trusted = True
        socket.limit_message_size(self._limits.max_frame_size)

    async def _serve_client(self, socket: _Socket) -> None:
        assert self._turns is not None, "it listens"
        client = Client(socket, self._bus, self._limits, self._turns, self)
        peer = client.peer
        self.clients[client] = None
        self._try(self.on_clients)
        _log.info("%s connected; %d connected now", peer.address, len(self.clients))
        try:
            socket.listen(client)
            await socket.wait_closed()
        finally:
            del self.clients[client]
            self._try(client.leave)
            self._try(self.on_clients)
            self._on_change()
            _log.info("%s left; %d connected now", peer.address, len(self.clients))

    def _try(self, act: Callable[[], None]) -> None:
        """Do something whose failure must not keep the rest from being done."""
        try:
            act()
        except Exception:  # noqa: BLE001 - our own bug, whatever it is
            self.num_bugs += 1
            _log.exception("something failed as a client came or went; the rest goes on")

    def count_bug(self) -> None:
        """See `ClientWatch`."""
        self.num_bugs += 1

    def note_large_frame(self) -> None:
        """See `ClientWatch`."""
        assert self._memory is not None, "it listens"
        self._memory.note_large_frame()

    def _process_request(
        self, connection: ServerConnection, request: Request
    ) -> Response | Awaitable[Response | None] | None:
        """Plain HTTP: None lets the WebSocket handshake go on."""
        try:
            return self._judge_request(connection, request)
        except Exception:  # noqa: BLE001 - our own bug; the library would say the same, but not log it
            self.num_bugs += 1
            _log.exception("a request of %s could not be answered", _address_of(connection))
            return connection.respond(HTTPStatus.INTERNAL_SERVER_ERROR, "The server failed; its log says why\n")

    def _judge_request(
        self, connection: ServerConnection, request: Request
    ) -> Response | Awaitable[Response | None] | None:
        path = request.path.partition("?")[0]
        if path == "/healthz":
            return self._tell_health(connection)
        if path == "/version":
            return self._tell_version(connection, request)
        if path not in {"", "/"}:
            return connection.respond(HTTPStatus.NOT_FOUND, f"There is nothing at {path}; rosbridge is at /\n")
        if "Upgrade" not in request.headers:
            return None  # a browser that looks what is here: the library tells it
        return self._judge_handshake(connection, request)

    def _judge_handshake(
        self, connection: ServerConnection, request: Request
    ) -> Response | Awaitable[Response | None] | None:
        assert isinstance(connection, _Socket)
        access = self._limits.access
        refusal = access.judge(request, len(self.clients), is_loopback=self.is_loopback, own_names=self.own_names)
        if refusal is None:
            if access.is_shown(request):
                self._tables.opening.leave(connection)
                self._trust(connection)
            else:
                self._limit(connection)
            return None
        if refusal.status is HTTPStatus.UNAUTHORIZED:
            self._note_stranger(connection, Reason.WRONG_TOKEN, "", WRONG_TOKEN)
        self._log_refusal(_address_of(connection), refusal)
        response = connection.respond(refusal.status, refusal.text)
        return self._delay(connection, response) if refusal.status is HTTPStatus.UNAUTHORIZED else response

    def _delay(self, connection: _Socket, response: Response) -> Awaitable[Response]:
        """Send the refusal of a token after a while, during which the connection counts as a stranger."""
        response.headers["WWW-Authenticate"] = "Bearer"
        self._limit(connection)
        return _answer_late(connection, response, self._limits.access.delay)

    def _limit(self, connection: _Socket) -> None:
        """Have a connection treated as a stranger's until it is trusted."""
        connection.limit_message_size(min(MAX_UNPROVEN_SIZE, self._limits.max_frame_size))
        connection.refuse_extensions()  # what cannot come compressed need not be inflated
        self._tables.opening.leave(connection)
        if connection in self._tables.sockets:  # else it is lost already, and would keep its place
            self._tables.strangers.take(connection)

    def _log_refusal(self, address: str, refusal: Refusal) -> None:
        """Warn of each web page once, and not of each of its attempts: a page in a tab may try every second."""
        text = refusal.text.rstrip()
        if refusal.origin is None or not self._refused_origins.add(refusal.origin):
            _log.info("%s refused: %s", address, text)
            return
        # A line of its own in the code: the log limits lines by that, and a page in a loop must not hide another page.
        _log.warning("%s refused: %s", address, text)
        if self._refused_origins.is_full:
            _log.warning("pages of %d origins were refused; further ones are told at level info", MAX_REFUSED_ORIGINS)

    def _tell_health(self, connection: ServerConnection) -> Response:
        why = self.why_unhealthy()
        if why is not None:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, f"{why}\n")
        return connection.respond(HTTPStatus.OK, "ok\n")

    def _tell_version(self, connection: ServerConnection, request: Request) -> Response | Awaitable[Response]:
        """Answer name, version and protocol; with a token set, only to those who show it."""
        if not self._limits.access.is_shown(request):
            assert isinstance(connection, _Socket)
            self._note_stranger(connection, Reason.NO_TOKEN, "", "/version wants the token")
            return self._delay(
                connection, connection.respond(HTTPStatus.UNAUTHORIZED, "The token is missing or wrong\n")
            )
        response = connection.respond(HTTPStatus.OK, _VERSION + "\n")
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = "application/json"
        return response


def _extensions(limits: ServerLimits) -> list[ServerExtensionFactory] | None:
    """The extensions that the server agrees to."""
    if not limits.is_compressing:
        return None
    return [LateDeflateFactory() if limits.is_direct else library_deflate()]


async def _answer_late(connection: _Socket, response: Response, delay: float) -> Response:
    """Keep a program that tries tokens waiting for its answer, and nobody else [s]."""
    await asyncio.wait([connection.lost], timeout=delay)
    return response


def _address_of(connection: ServerConnection) -> str:
    address = connection.remote_address
    return f"{address[0]}:{address[1]}" if address else ""

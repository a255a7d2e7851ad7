"""Connections of the server, and the tables that list them while they are open."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode

from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.shell.transport.request_reading import MAX_EARLY
from rosbridge_sim.shell.transport.server_connection import DirectConnection
from rosbridge_sim.shell.websocket.connection_places import ConnectionPlaces
from rosbridge_sim.shell.websocket.limits import MAX_OPENING
from rosbridge_sim.shell.websocket.tls_handshake import TlsHandshake, TlsRules

_log = logging.getLogger("rosbridge_sim.server")

_SILENT = "it had not sent its request when too many other connections came"

LATE = 0.5
"""Delay of a timer from which on the loop has not read what has come [s]: a hundred times a usual turn."""

CROWDED = "there were more connections without the token than --max-strangers allows"


def _ignore() -> None:
    """Do nothing: no one waits for the end."""


class ConnectionTables:
    """All connections, and the places of those that are not clients yet.

    Attributes:
        sockets: every open connection.
        handshakes: connections in their TLS handshake.
        opening: connections without a complete request.
        unauthenticated: connections that have not sent the token.
        num_bytes_received: bytes received over connections that are closed now.
    """

    def __init__(
        self, max_strangers: int, open_timeout: float, take: Callable[[ServedConnection, bytes], bool]
    ) -> None:
        """Create empty tables.

        Args:
            max_strangers: most connections without the token.
            open_timeout: longest time until a request is complete [s].
            take: called with a whole request; returns True if it has answered it, and serves the connection.
        """
        self.sockets: dict[ServedConnection, None] = {}
        self.handshakes: dict[TlsHandshake, None] = {}
        self.opening = ConnectionPlaces(MAX_OPENING)
        self.unauthenticated = ConnectionPlaces(max_strangers)
        self.num_bytes_received = 0
        self.open_timeout = open_timeout
        self.take = take
        self._closing: list[asyncio.Task[None]] = []

    def close_those_without_task(self) -> None:
        """Close connections that the library's server does not know, because the server stops."""
        for socket in list(self.sockets):
            if not socket.has_task:
                if socket.is_opening:  # it has not sent a request
                    socket.transport.abort()
                else:
                    self._closing.append(socket.loop.create_task(socket.close(CloseCode.GOING_AWAY)))

    async def wait_empty(self) -> None:
        """Wait until those connections are closed."""
        if self._closing:
            await asyncio.wait(self._closing)


class ServedConnection(DirectConnection):
    """A connection that is in the tables while it is open.

    The library's task, which waits for a request and serves the connection, only begins with a request that is left to
    the library. So a client that asks in the usual words costs no task.

    Attributes:
        on_lost: called when the connection is over.
        has_task: the library's task has begun.
    """

    def __init__(self, tables: ConnectionTables, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._tables = tables
        self.on_lost: Callable[[], None] = _ignore
        self.has_task = False
        self._open_timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take a place among the connections without a request."""
        self.begin_without_task(transport)
        self._tables.sockets[self] = None
        self._tables.opening.take(self)
        self._start_open_timer()

    def _start_open_timer(self) -> None:
        patience = self._tables.open_timeout
        self._open_timer = self.loop.call_later(patience, self._give_up, self.loop.time() + patience)

    def _give_up(self, due: float) -> None:
        """Cut off a connection whose request is not complete in time.

        Args:
            due: when this was to happen [s]. If the loop comes later, it has not read for as long, because the machine
                slept or was busy; the request may wait in the system's buffer.
        """
        if self.has_request:
            return
        if self.loop.time() - due > LATE:
            self._start_open_timer()
        else:
            self.transport.abort()

    def _stop_open_timer(self) -> None:
        if self._open_timer is not None:
            self._open_timer.cancel()
            self._open_timer = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave all places.

        Args:
            exc: the error of the transport, or None.
        """
        self._stop_open_timer()
        if self in self._tables.sockets:
            del self._tables.sockets[self]
            self._tables.num_bytes_received += self.num_bytes_received
        self._tables.opening.leave(self)
        self._tables.unauthenticated.leave(self)
        super().connection_lost(exc)
        on_lost, self.on_lost = self.on_lost, _ignore
        on_lost()

    def answer(self, head: bytes, num_behind: int) -> bool:
        """Let the server answer; see `RequestConnection.answer`.

        Args:
            num_behind: bytes that came behind it.
        """
        return not self.has_task and num_behind <= MAX_EARLY and self._tables.take(self, head)

    def await_head(self) -> None:
        """Begin the library's task, with which a server that stops waits for the rest of the request."""
        if not self.has_task:
            self.has_task = True
            super().connection_made(self.transport)

    def feed_head(self, head: bytes) -> None:
        """Give a whole request to the library, whose task answers it."""
        self.await_head()
        super().feed_head(head)

    def open(self, answer: bytes) -> None:
        """Answer a request, without the library."""
        self._stop_open_timer()
        self.transport.write(answer)
        self.open_without_task()

    def evict(self) -> None:
        """Close the connection without waiting for the other side, because its place is needed."""
        _log.info("%s cut off: %s", address_of(self), CROWDED if self.request is not None else _SILENT)
        self.forget()
        if self.is_open:
            self.core.fail(CloseCode.TRY_AGAIN_LATER, CROWDED)
            self.flush()
        if self.num_bytes_unsent:
            self.transport.abort()
        else:
            self.transport.close()


def make_connection(
    tables: ConnectionTables, rules: TlsRules | None, *args: LibraryArgument, **kwargs: LibraryArgument
) -> asyncio.Protocol:
    """Create the protocol object of an accepted connection.

    Args:
        rules: rules for TLS; None for an unencrypted connection.
    """
    socket = ServedConnection(tables, *args, **kwargs)
    return socket if rules is None else TlsHandshake(socket, rules, tables.opening, tables.handshakes)


def address_of(connection: ServerConnection) -> str:
    """Return address and port of the other side, for people; empty if there is none."""
    address = connection.remote_address
    return f"{address[0]}:{address[1]}" if address else ""

"""Connections of the server, and the tables that they stand in for as long as they are open."""

from __future__ import annotations

import asyncio
import logging

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode

from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.shell.websocket.connection_places import ConnectionPlaces
from rosbridge_sim.shell.websocket.library_connection import LibraryConnection
from rosbridge_sim.shell.websocket.limits import MAX_OPENING
from rosbridge_sim.shell.websocket.receiving_connection import ReceivingConnection
from rosbridge_sim.shell.websocket.server_connection import DirectConnection
from rosbridge_sim.shell.websocket.tls_handshake import TlsHandshake, TlsRules

__all__ = [
    "CROWDED",
    "ConnectionTables",
    "DirectServedConnection",
    "LibraryServedConnection",
    "ServedConnection",
    "address_of",
    "make_connection",
]

_log = logging.getLogger("rosbridge_sim.server")

_SILENT = "its request had not come when too many other connections did"

CROWDED = "more connections without a token came than there are places for (--max-strangers)"


class ConnectionTables:
    """All connections, and the places of those that are no clients yet.

    Attributes:
        sockets: every open connection.
        handshakes: those in their TLS handshake.
        opening: those without a whole request.
        unauthenticated: those that have not shown the token.
        num_bytes_received: bytes that came over connections that are closed by now.
    """

    def __init__(self, max_strangers: int) -> None:
        """Tables without connections; at most `max_strangers` may be without the token."""
        self.sockets: dict[ServedConnection, None] = {}
        self.handshakes: dict[TlsHandshake, None] = {}
        self.opening = ConnectionPlaces(MAX_OPENING)
        self.unauthenticated = ConnectionPlaces(max_strangers)
        self.num_bytes_received = 0


class ServedConnection(ReceivingConnection):
    """A connection that stands in tables for as long as it is open; stands before the kind of reading in the bases."""

    def __init__(self, tables: ConnectionTables, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._tables = tables

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take a place among the connections without a request."""
        super().connection_made(transport)
        self._tables.sockets[self] = None
        self._tables.opening.take(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave all places."""
        if self in self._tables.sockets:
            del self._tables.sockets[self]
            self._tables.num_bytes_received += self.num_bytes_received
        self._tables.opening.leave(self)
        self._tables.unauthenticated.leave(self)
        super().connection_lost(exc)

    def evict(self) -> None:
        """Close it without waiting for the other side: its place is taken."""
        _log.info("%s cut off: %s", address_of(self), CROWDED if self.request is not None else _SILENT)
        self.forget()
        if self.is_open:
            self.core.fail(CloseCode.TRY_AGAIN_LATER, CROWDED)
            self.flush()
        if self.transport.get_write_buffer_size():
            self.transport.abort()
        else:
            self.transport.close()


class DirectServedConnection(ServedConnection, DirectConnection):
    """A connection of the server that reads frames by our own code."""


class LibraryServedConnection(ServedConnection, LibraryConnection):
    """A connection of the server that reads frames by the library's code."""


def make_connection(
    kind: type[ServedConnection],
    tables: ConnectionTables,
    rules: TlsRules | None,
    *args: LibraryArgument,
    **kwargs: LibraryArgument,
) -> asyncio.Protocol:
    """Make the protocol of a connection that was accepted; `rules` are those of TLS, if it is to be encrypted."""
    socket = kind(tables, *args, **kwargs)
    return socket if rules is None else TlsHandshake(socket, rules, tables.opening, tables.handshakes)


def address_of(connection: ServerConnection) -> str:
    """Return address and port of the other side, for people to read; an empty text where there is none."""
    address = connection.remote_address
    return f"{address[0]}:{address[1]}" if address else ""

"""Connections of the server, and the tables that list them while they are open."""

from __future__ import annotations

import asyncio
import logging

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode

from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.shell.transport.library_connection import LibraryConnection
from rosbridge_sim.shell.transport.receiving_connection import ReceivingConnection
from rosbridge_sim.shell.transport.server_connection import DirectConnection
from rosbridge_sim.shell.websocket.connection_places import ConnectionPlaces
from rosbridge_sim.shell.websocket.limits import MAX_OPENING
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

_SILENT = "it had not sent its request when too many other connections came"

CROWDED = "there were more connections without the token than --max-strangers allows"


class ConnectionTables:
    """All connections, and the places of those that are not clients yet.

    Attributes:
        sockets: every open connection.
        handshakes: connections in their TLS handshake.
        opening: connections without a complete request.
        unauthenticated: connections that have not sent the token.
        num_bytes_received: bytes received over connections that are closed now.
    """

    def __init__(self, max_strangers: int) -> None:
        """Create empty tables.

        Args:
            max_strangers: most connections without the token.
        """
        self.sockets: dict[ServedConnection, None] = {}
        self.handshakes: dict[TlsHandshake, None] = {}
        self.opening = ConnectionPlaces(MAX_OPENING)
        self.unauthenticated = ConnectionPlaces(max_strangers)
        self.num_bytes_received = 0


class ServedConnection(ReceivingConnection):
    """A connection that is in the tables while it is open. It comes first in the bases, before the class that reads."""

    def __init__(self, tables: ConnectionTables, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._tables = tables

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take a place among the connections without a request.

        Args:
            transport: the transport of the connection.
        """
        super().connection_made(transport)
        self._tables.sockets[self] = None
        self._tables.opening.take(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave all places.

        Args:
            exc: the error of the transport, or None.
        """
        if self in self._tables.sockets:
            del self._tables.sockets[self]
            self._tables.num_bytes_received += self.num_bytes_received
        self._tables.opening.leave(self)
        self._tables.unauthenticated.leave(self)
        super().connection_lost(exc)

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


class DirectServedConnection(ServedConnection, DirectConnection):
    """A connection of the server that reads frames with this package's own code."""


class LibraryServedConnection(ServedConnection, LibraryConnection):
    """A connection of the server that reads frames with the library's code."""


def make_connection(
    kind: type[ServedConnection],
    tables: ConnectionTables,
    rules: TlsRules | None,
    *args: LibraryArgument,
    **kwargs: LibraryArgument,
) -> asyncio.Protocol:
    """Create the protocol object of an accepted connection.

    Args:
        kind: class of the connection.
        tables: the tables of the server.
        rules: rules for TLS; None for an unencrypted connection.
        args: the library's arguments.
        kwargs: the library's arguments.
    """
    socket = kind(tables, *args, **kwargs)
    return socket if rules is None else TlsHandshake(socket, rules, tables.opening, tables.handshakes)


def address_of(connection: ServerConnection) -> str:
    """Return address and port of the other side, for people; empty if there is none."""
    address = connection.remote_address
    return f"{address[0]}:{address[1]}" if address else ""

"""TLS handshakes whose number is bounded, which the listeners of asyncio and uvloop cannot do.

A connection begins as a `TlsDoor`: from its first packet on it has a place among those without a request. Only
when its handshake is done does it become a connection of the `websockets` library. A listener with `ssl=` of its own
hides a connection until then, so any number could wait there and use up the file descriptors.
"""

from __future__ import annotations

import asyncio
import socket
import ssl
from contextlib import suppress
from dataclasses import dataclass
from typing import cast

from rosbridge_sim.shell.websocket.strangers import ConnectionPlaces

__all__ = ["TlsDoor", "TlsRules"]


@dataclass(frozen=True, slots=True)
class TlsRules:
    """Rules of encryption for connections.

    Attributes:
        context: the certificate and its key.
        handshake_timeout: longest handshake [s].
        shutdown_timeout: how long the other side may take to confirm the end [s].
    """

    context: ssl.SSLContext
    handshake_timeout: float
    shutdown_timeout: float


class TlsDoor(asyncio.Protocol):
    """A connection that is in its TLS handshake."""

    def __init__(
        self, inner: asyncio.Protocol, rules: TlsRules, places: ConnectionPlaces, doors: dict[TlsDoor, None]
    ) -> None:
        """A door without a connection.

        Args:
            inner: gets the connection when the handshake is done.
            rules: for the handshake.
            places: where it takes one, until it is done.
            doors: where it stands until then, so that the server can close it.
        """
        self._inner = inner
        self._rules = rules
        self._places = places
        self._doors = doors
        self._socket: socket.socket | None = None
        self._task: asyncio.Task[None] | None = None  # the loop itself keeps no tasks

    def evict(self) -> None:
        """Close it without waiting for the other side."""
        if self._socket is not None:
            with suppress(OSError):  # it is closed already
                self._socket.shutdown(socket.SHUT_RDWR)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin the handshake, with a transport of its own.

        `start_tls` is of no use here: uvloop reads the client's first packet before it can be called.
        """
        try:
            self._socket = transport.get_extra_info("socket").dup()
        except OSError:  # no file descriptor is left
            return
        finally:
            cast("asyncio.Transport", transport).abort()  # a cast, since uvloop's are no subclass
        self._socket.setblocking(False)  # noqa: FBT003 - the library's own
        self._doors[self] = None
        self._places.take(self)
        self._task = asyncio.get_running_loop().create_task(self._shake_hands(self._socket))

    async def _shake_hands(self, connected: socket.socket) -> None:
        rules = self._rules
        with suppress(OSError):  # TLS errors, time-outs and lost connections are such; none of them is worth a line
            try:
                await asyncio.get_running_loop().connect_accepted_socket(
                    self._take_over,
                    connected,
                    ssl=rules.context,
                    ssl_handshake_timeout=rules.handshake_timeout,
                    ssl_shutdown_timeout=rules.shutdown_timeout,
                )
            finally:
                self._places.leave(self)
                self._doors.pop(self, None)

    def _take_over(self) -> asyncio.Protocol:
        return self._inner

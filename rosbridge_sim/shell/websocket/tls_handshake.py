"""TLS handshakes with a limited number, which the listeners of asyncio and uvloop do not offer.

A connection begins as a `TlsHandshake`, and from its first packet on it has a place among those without a request. Only
after the handshake does it become a connection of the `websockets` library. A listener with its own `ssl=` hides a
connection until then, so any number of them could wait and use up the file descriptors.
Each kind of event loop needs its own method. uvloop reads the client's first packet before `start_tls` can be called,
so the socket is duplicated and accepted again. The loop of Windows cannot accept a known socket again, so asyncio's own
loops use `start_tls`.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import cast

from rosbridge_sim.shell.websocket.connection_places import ConnectionPlaces

_log = logging.getLogger("rosbridge_sim.server")

_PLAIN = "HTTP_REQUEST"
"""OpenSSL's reason for a handshake that begins like an HTTP request."""


@dataclass(slots=True)
class TlsRules:
    """TLS settings of connections.

    Attributes:
        context: the certificate and its key.
        handshake_timeout: longest handshake [s].
        shutdown_timeout: longest wait for the other side to confirm the end [s].
        has_warned: the log has the warning about requests without TLS. Once is enough: a page may try each second.
    """

    context: ssl.SSLContext
    handshake_timeout: float
    shutdown_timeout: float
    has_warned: bool = False

    @contextmanager
    def expecting_faults(self) -> Iterator[None]:
        """End a handshake quietly if it fails: TLS errors, time-outs and lost connections need no log line.

        A request without TLS is a mistake that users make, so the first one is a warning.
        """
        try:
            yield
        except ssl.SSLError as error:
            if error.reason == _PLAIN and not self.has_warned:
                self.has_warned = True
                _log.warning("a client sent ws:// or http:// to this port, which speaks TLS: it must use wss://")
        except OSError:
            pass


class TlsHandshake(asyncio.Protocol):
    """A connection during its TLS handshake."""

    def __init__(
        self, inner: asyncio.Protocol, rules: TlsRules, places: ConnectionPlaces, handshakes: dict[TlsHandshake, None]
    ) -> None:
        """Prepare for a connection.

        Args:
            inner: gets the connection after the handshake.
            rules: TLS settings.
            places: has a place for it until the handshake is done.
            handshakes: table that lists it until then, so that the server can close it.
        """
        self._inner = inner
        self._rules = rules
        self._places = places
        self._handshakes = handshakes
        self._socket: socket.socket | None = None  # the duplicated socket
        self._transport: asyncio.Transport | None = None  # used if the socket is not duplicated
        self._task: asyncio.Task[None] | None = None  # a reference, because the loop keeps none to its tasks
        self._early = bytearray()  # decrypted data that came before `inner` had the connection
        self._is_handed_over = False

    def evict(self) -> None:
        """Close the connection without waiting for the other side."""
        if self._socket is not None:
            with suppress(OSError):  # it may be closed already
                self._socket.shutdown(socket.SHUT_RDWR)
        if self._transport is not None:
            self._transport.abort()
            self._leave()
            if self._task is not None:
                self._task.cancel()

    # Called by the first transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin the handshake."""
        if isinstance(transport, asyncio.Transport):
            transport.pause_reading()  # `start_tls` reads the first packet
            self._transport = transport
            work = self._encrypt(transport)
        else:
            try:
                self._socket = transport.get_extra_info("socket").dup()
            except OSError:  # no file descriptor is left
                return
            finally:
                cast("asyncio.Transport", transport).abort()  # a cast, because uvloop's transports are not a subclass
            self._socket.setblocking(False)  # noqa: FBT003 - the library's own
            work = self._accept_again(self._socket)
        self._handshakes[self] = None
        self._places.take(self)
        self._task = asyncio.get_running_loop().create_task(work)

    async def _accept_again(self, connected: socket.socket) -> None:
        """Let the loop accept the duplicated socket with TLS, for uvloop."""
        rules = self._rules
        with rules.expecting_faults():
            try:
                await asyncio.get_running_loop().connect_accepted_socket(
                    lambda: self._inner,
                    connected,
                    ssl=rules.context,
                    ssl_handshake_timeout=rules.handshake_timeout,
                    ssl_shutdown_timeout=rules.shutdown_timeout,
                )
            finally:
                self._leave()

    async def _encrypt(self, transport: asyncio.Transport) -> None:
        """Encrypt the connection with `start_tls`, for asyncio's own loops."""
        rules = self._rules
        encrypted: asyncio.Transport | None = None
        try:
            with rules.expecting_faults():
                encrypted = await asyncio.get_running_loop().start_tls(
                    transport,
                    self,
                    rules.context,
                    server_side=True,
                    ssl_handshake_timeout=rules.handshake_timeout,
                    ssl_shutdown_timeout=rules.shutdown_timeout,
                )
        finally:
            self._leave()
        if encrypted is not None and not encrypted.is_closing():
            self._hand_over(encrypted)

    def _leave(self) -> None:
        self._places.leave(self)
        self._handshakes.pop(self, None)

    def _hand_over(self, encrypted: asyncio.Transport) -> None:
        """Give the connection to `inner`, with data that came in the last packet of the handshake."""
        self._is_handed_over = True
        encrypted.set_protocol(self._inner)
        self._inner.connection_made(encrypted)
        if self._early:
            self._inner.data_received(bytes(self._early))
            self._early.clear()

    # Called by the encrypted transport until `inner` has it

    def data_received(self, data: bytes) -> None:
        """Keep received data; it is at most one read of the transport."""
        self._early += data

    def connection_lost(self, exc: Exception | None) -> None:
        """Tell `inner` if the connection was lost while `inner` was getting it.

        Args:
            exc: the error of the transport, or None.
        """
        if self._is_handed_over:
            self._inner.connection_lost(exc)

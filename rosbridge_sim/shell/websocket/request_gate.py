"""Treatment of requests without the token or with an unknown host: refusals, delays, and less room."""

from __future__ import annotations

import logging
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.shell.websocket.access import HandshakeRefusal
from rosbridge_sim.shell.websocket.connections import ConnectionTables, ServedConnection, address_of
from rosbridge_sim.shell.websocket.http_answers import Answer, answer_late
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.origins import RefusedOrigins
from rosbridge_sim.shell.websocket.unauthenticated import MAX_UNPROVEN_SIZE

_log = logging.getLogger("rosbridge_sim.server")

UNAUTHENTICATED = "no token"
"""Name in the log and on `/sim/refusals` for all connections that have not sent the token."""


class RequestGate:
    """Judges requests for data, and keeps those without the token slow and small.

    Attributes:
        own_names: names of this machine that web pages may use.
    """

    def __init__(self, bus: Bus, limits: ServerLimits, tables: ConnectionTables) -> None:
        self.own_names: frozenset[str] = frozenset()
        self._bus = bus
        self._limits = limits
        self._tables = tables
        self._refused_origins = RefusedOrigins()

    def may_have_data(self, request: Request) -> bool:
        """Return True if a request may have data."""
        return self._limits.access.judge_data(request, self.own_names) is None

    def refuse(self, connection: ServedConnection, refusal: HandshakeRefusal, reason: Reason, text: str) -> Answer:
        """Refuse a request, and report it; for the want of a token the answer is late.

        Args:
            reason, text: of the want of the token, for the report.
        """
        response = connection.respond(refusal.status, refusal.text)
        if refusal.status is not HTTPStatus.UNAUTHORIZED:
            self.log(connection, refusal)
            return response
        self.note_refused_token(connection, reason, "", text)
        response.headers["WWW-Authenticate"] = "Bearer"
        self.limit(connection)
        return answer_late(connection.lost, response, self._limits.access.delay)

    def log(self, connection: ServedConnection, refusal: HandshakeRefusal) -> None:
        """Log a refusal; each web page has one warning."""
        self._refused_origins.log(_log, address_of(connection), refusal.text, refusal.origin)

    def refuse_data(self, connection: ServedConnection, request: Request, path: str) -> Answer | None:
        """Refuse a path with data to requests without the token, or with an unknown Host; None if it may be told."""
        refusal = self._limits.access.judge_data(request, self.own_names)
        return None if refusal is None else self.refuse(connection, refusal, Reason.NO_TOKEN, f"{path} needs the token")

    def late_for_wrong_token(self, connection: ServedConnection, request: Request, response: Response) -> Answer:
        """Delay an answer to a request with a wrong token; otherwise tokens could be tried here without a delay."""
        access = self._limits.access
        if access.is_shown(request) or not access.shows_any(request):
            return response
        self.limit(connection)
        return answer_late(connection.lost, response, access.delay)

    def limit(self, connection: ServedConnection) -> None:
        """Limit a connection without the token until it is trusted."""
        connection.limit_message_size(min(MAX_UNPROVEN_SIZE, self._limits.max_frame_size))
        connection.refuse_extensions()  # without extensions, no decompression is needed
        self._tables.opening.leave(connection)
        if connection in self._tables.sockets:  # else it is already lost, and would never leave its place
            self._tables.unauthenticated.take(connection)

    def note_refused_token(self, socket: ServerConnection, reason: Reason, op: str, text: str) -> None:
        """Report a connection without the token in the log and on `/sim/refusals`.

        All of them count as one client there, because each attempt can come from another port or address.
        """
        text = f"{text}; the connection is {address_of(socket)}"
        refusal = RefusedRequest(UNAUTHENTICATED, reason, op, "", text)
        self._bus.guard.attempt("the account of a refusal", self._bus.on_refusal, refusal)

"""Limits of the server and of each of its connections."""

from __future__ import annotations

from dataclasses import dataclass, field

from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.protocol.outbox import OutboxLimits
from rosbridge_sim.shell.websocket.access import Access

__all__ = ["CLOSE_TIMEOUT", "MAX_OPENING", "ServerLimits"]

CLOSE_TIMEOUT = 1.0
"""Time for a client to hear that it is closed [s]; one that does not read is cut off then."""

TLS_TIMEOUT = 5.0
"""Longest TLS handshake [s]: two round trips, with a slow phone far away half a second."""

OPEN_TIMEOUT = 5.0
"""Longest time from there to the whole request [s]: one packet of a real client."""

MAX_OPENING = 256
"""Connections without a whole request at once, those in a TLS handshake included; the oldest one is cut off for a new
one. The system hands over some hundred in one go (the backlog), and each has its request read in the next turn of the
loop. Together with those that have no token they leave most of the usual 1,024 file descriptors to clients."""


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """Limits of one connection.

    Attributes:
        max_frame_size: a longer frame closes the connection with code 1009 [bytes].
        ping_interval, ping_timeout: the watchdog against half-open connections [s]; None is off.
        is_compressing: accept permessage-deflate from clients that offer it.
        is_direct: read frames by our own code, and not by the library's.
        is_talkative: send status frames.
        outbox: what a client may leave unread.
        client_memory: what one client may make the server hold, apart from its outbox [bytes].
        memory_budget: the same for all clients together, their outboxes included [bytes]; None is no limit.
        access: rules for new connections, and how fast a client may send.
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

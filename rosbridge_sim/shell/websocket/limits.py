"""Limits of the server and of each of its connections."""

from __future__ import annotations

from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.protocol.outbox import OutboxLimits
from rosbridge_sim.records import Record, field
from rosbridge_sim.shell.websocket.access import Access

CLOSE_TIMEOUT = 1.0
"""Time for a client to receive the close frame [s]; a client that does not read is cut off then."""

TLS_TIMEOUT = 5.0
"""Longest TLS handshake [s]: two round trips, which take half a second for a distant phone with a slow connection."""

OPEN_TIMEOUT = 5.0
"""Longest time from the TLS handshake to the complete request [s]: a real client needs one packet."""

ANSWER_TIMEOUT = 30.0
"""Longest time from a complete request over HTTP to its answer [s]; then the answer is 503. Many times what the page
takes on a busy machine, and as long as browsers and proxies wait at least."""

MAX_OPENING = 256
"""Most connections without a complete request, with those in a TLS handshake; the oldest one is cut off for a new one.
The system delivers about a hundred at once (the backlog), and the request of each is read in the next turn of the loop.
Together with connections without a token they leave most of the usual 1,024 file descriptors to clients."""


class ServerLimits(Record):
    """Limits of one connection.

    Attributes:
        max_frame_size: a longer frame closes the connection with code 1009 [bytes].
        ping_interval, ping_timeout: check for half-open connections [s]; None turns it off.
        is_compressing: accept permessage-deflate from clients that offer it.
        is_talkative: send status frames.
        outbox: limits on frames that a client leaves unread.
        client_memory: memory of one client on the server, without its outbox [bytes].
        memory_budget: memory of all clients together, with their outboxes [bytes]; None means no limit.
        access: rules for new connections, and the rate of a client.
        policy: rights of clients.
        tls_timeout, open_timeout, answer_timeout: time-outs of the TLS handshake, of the request after it, and of the
            answer over HTTP [s].
    """

    max_frame_size: int = 16 * 2**20
    ping_interval: float | None = 20.0
    ping_timeout: float | None = 20.0
    is_compressing: bool = False
    is_talkative: bool = True
    client_memory: int = 256 * 2**20
    memory_budget: int | None = None
    outbox: OutboxLimits = field(default_factory=OutboxLimits)
    access: Access = field(default_factory=Access)
    policy: Policy = OPEN
    tls_timeout: float = TLS_TIMEOUT
    open_timeout: float = OPEN_TIMEOUT
    answer_timeout: float = ANSWER_TIMEOUT

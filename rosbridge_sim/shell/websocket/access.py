"""Rules for connections: token, origin, number of clients and rate. They apply before anything reaches the bus.

A WebSocket handshake is refused with an HTTP status and a text in three cases: the web page may not connect (403), the
token is wrong (401), or there is no room (503). A client that sends no token in the handshake may still send it in a
message; see `unauthenticated.py`.
The rights of connected clients are in `graph/policy.py`. A `RateGate` is used only if a rate is set.
"""

from __future__ import annotations

import hmac
import re
import ssl
from collections.abc import Iterator
from dataclasses import dataclass, field
from http import HTTPStatus
from itertools import islice
from urllib.parse import parse_qs, urlsplit

from websockets.http11 import Request

from rosbridge_sim.errors import DocumentError, Reason, file_errors
from rosbridge_sim.graph.peers.peer import FrameWork, Peer, Work
from rosbridge_sim.protocol.ops import ActionResult, Id, Op, ServiceResponse
from rosbridge_sim.records import Record
from rosbridge_sim.shell.websocket.origins import OriginRules

LEAST_BURST = 100
"""Frames that may always come at once: a program with many topics sends so many when it connects."""

MAX_SHOWN_TOKENS = 3
"""Tokens that are checked in one request, equal to the tries of a connection; a URL of 8 kB has room for a thousand."""

_ANSWERS = (ServiceResponse, ActionResult)
"""Ops that other participants wait for: they count, but are never refused for the rate."""

_ANSWER = re.compile(rb'\s*\{.{0,200}?"op"\s*:\s*"(?:service_response|action_result)"', re.DOTALL)
"""Start of a frame with one of them, as all clients write it."""

_LOOKED_AT = 256
"""Bytes of a frame that are searched for its op without decoding."""


class HandshakeRefusal(Record):
    """Refusal of a handshake.

    Attributes:
        status: HTTP status.
        text: body of the answer.
        origin: the refused web page; None if the page is not the reason.
    """

    status: HTTPStatus
    text: str
    origin: str | None = None


@dataclass(frozen=True, slots=True)
class Access:
    """The rules for new connections.

    Attributes:
        token: token that clients must send; None lets every client connect.
        origins: the web pages that may connect. They are not checked if the handshake has the token.
        max_clients: most clients at once; None means no limit. With a token set, only clients that have sent it count.
        max_strangers: most connections at once that have not sent the token.
        max_rate: frames per second from one client, after a burst of as many (or of LEAST_BURST); None means no limit.
        patience: longest time of a connection without the token [s].
        delay: wait before the answer to a wrong token [s]; it doubles with each further one on a connection.
    """

    token: str | None = field(default=None, repr=False)
    origins: OriginRules = field(default_factory=OriginRules)
    max_clients: int | None = 1_000
    max_strangers: int = 100
    max_rate: int | None = None
    patience: float = 10.0
    delay: float = 0.5

    def judge(
        self, request: Request, num_clients: int, *, is_loopback: bool, own_names: frozenset[str] = frozenset()
    ) -> HandshakeRefusal | None:
        """Return why a handshake is refused; None if it may go on.

        Args:
            request: the HTTP request.
            is_loopback: the server can only be reached from this machine.
            own_names: names of this machine that web pages may use.
        """
        if self.token is None or not self.is_shown(request):
            origins, hosts = (request.headers.get_all(name) for name in ("Origin", "Host"))
            why = self.origins.judge(origins, hosts, own_names, is_loopback=is_loopback)
            if why is not None:
                return HandshakeRefusal(HTTPStatus.FORBIDDEN, f"{why}\n", origins[0])
        if not self.is_shown(request):  # a connection without the token does not use a client's place
            is_wrong = any(_shown_tokens(request))
            return HandshakeRefusal(HTTPStatus.UNAUTHORIZED, "The token is wrong\n") if is_wrong else None
        if self.is_full(num_clients):
            text = f"At most {num_clients} clients; try again later\n"
            return HandshakeRefusal(HTTPStatus.SERVICE_UNAVAILABLE, text)
        return None

    def judge_data(self, request: Request, own_names: frozenset[str]) -> HandshakeRefusal | None:
        """Return why a plain HTTP request gets no data; None if it may have them.

        Args:
            request: the HTTP request.
        """
        if not self.is_shown(request):
            return HandshakeRefusal(HTTPStatus.UNAUTHORIZED, "The token is missing or wrong\n")
        if self.token is not None:
            return None
        hosts = request.headers.get_all("Host")
        why = self.origins.judge_host(hosts, own_names)
        if why is None:
            return None
        return HandshakeRefusal(HTTPStatus.FORBIDDEN, f"{why}\n", f"http://{hosts[0]}" if hosts else None)

    def is_full(self, num_clients: int) -> bool:
        """Return True if there is no room for another client."""
        return self.max_clients is not None and num_clients >= self.max_clients

    def is_shown(self, request: Request) -> bool:
        """Return True if a request has the token, or none is needed.

        Args:
            request: the HTTP request.
        """
        if self.token is None:
            return True
        shown = list(islice(_shown_tokens(request), MAX_SHOWN_TOKENS + 1))
        return len(shown) <= MAX_SHOWN_TOKENS and any(self.is_token(text) for text in shown)

    def shows_any(self, request: Request) -> bool:
        """Return True if the request has any token, right or wrong.

        Args:
            request: the HTTP request.
        """
        return any(True for _ in _shown_tokens(request))

    def is_token(self, text: str) -> bool:
        """Return True if a text is the token. The time does not depend on the position of the first difference."""
        wanted = "" if self.token is None else self.token
        return hmac.compare_digest(text.encode("utf-8", "surrogatepass"), wanted.encode())


def is_from_autobahn(request: Request | None) -> bool:
    """Return True if a handshake may be one of roslibpy: both of its transports use Autobahn."""
    agents = [] if request is None else request.headers.get_all("User-Agent")
    return any(agent.startswith("AutobahnPython/") for agent in agents)


def _shown_tokens(request: Request) -> Iterator[str]:
    """Yield the tokens in a request's header and query."""
    for value in request.headers.get_all("Authorization"):
        scheme, _, token = value.partition(" ")
        if scheme.lower() == "bearer":
            yield token.strip()
    yield from parse_qs(urlsplit(request.path).query).get("token", [])


class TokenBucket:
    """The frames that a client may still send: it fills with time up to the burst, and each frame takes one."""

    __slots__ = ("_at", "_burst", "_level", "_rate")

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """Create a full bucket.

        Args:
            rate: frames per second.
            burst: capacity [frames].
        """
        self._rate = rate
        self._burst = self._level = burst
        self._at = now

    def take(self, now: float) -> bool:
        """Take one frame out.

        Returns:
            True if there was one.
        """
        self._level = min(self._burst, self._level + (now - self._at) * self._rate)
        self._at = now
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


class RateGate:
    """A filter in front of a client's peer that lets ops through at a limited rate."""

    def __init__(self, peer: Peer, max_rate: int, now: float) -> None:
        """Begin with a full bucket.

        Args:
            peer: handles the frames that are let through.
            max_rate: frames per second.
        """
        self._peer = peer
        self._max_rate = max_rate
        self._num_too_many = 0
        self._is_counted = False
        self._tell_at = now
        self._bucket = TokenBucket(max_rate, max(max_rate, LEAST_BURST), now)

    def begin(self, frame: bytes, now: float) -> Work | None:
        """Do the same as `Peer.begin`, if the rate allows it. A frame that comes too fast is not decoded.

        Args:
            frame: content of a text or binary frame.

        Returns:
            As `Peer.begin`.
        """
        if not self._bucket.take(now) and not _ANSWER.match(frame[:_LOOKED_AT]):
            self._slow_down(now)
            return None
        self._is_counted = True
        session = self._peer.session
        op = session.receive_plain(frame)
        if op is None:
            return FrameWork(session.receive(frame, now), self._judge)
        self._judge(op, now)
        return None

    def _judge(self, op: Op, now: float) -> None:
        """Do an op, or refuse it. The first op counts with its frame, each further op counts by itself."""
        is_counted, self._is_counted = self._is_counted, False
        if is_counted or self._bucket.take(now) or isinstance(op, _ANSWERS):
            self._peer.do(op, now)
        else:
            self._slow_down(now, op.id)

    def _slow_down(self, now: float, op_id: Id = None) -> None:
        """Refuse a frame or an op; the client is told once a second."""
        self._num_too_many += 1
        self._peer.num_errors += 1
        if now >= self._tell_at:
            self._tell_at = now + 1.0
            why = f"Too fast: at most {self._max_rate} frames a second are accepted from one client"
            text = f"{why}; refused so far: {self._num_too_many}"
            self._peer.session.remark("error", text, op_id)
            self._peer.note(Reason.TOO_FAST, text)


def load_certificate(certfile: str | None, keyfile: str | None) -> ssl.SSLContext | None:
    """Load the certificate for wss://; return None if none is set.

    Args:
        certfile: a certificate, or a chain of them, in PEM.
        keyfile: its private key in PEM; None if it is in `certfile`.

    Raises:
        DocumentError: a file cannot be read, or has other contents.
    """
    if certfile is None:
        if keyfile is not None:
            raise DocumentError(f"keyfile {keyfile}: expected a certfile beside it; got none")
        return None
    for path in (certfile, keyfile or certfile):
        with file_errors(path, "read"), open(path, "rb"):  # noqa: PTH123 - the library does not say which is missing
            pass
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certfile, keyfile, password=lambda: "")  # else it asks for one on the terminal
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            raise DocumentError(f"{keyfile or certfile}: expected the private key of {certfile}; got another") from None
        raise DocumentError(
            f"{certfile}, {keyfile or 'without a keyfile'}: expected a certificate and its private key in PEM,"
            " without a password"
        ) from None
    return context

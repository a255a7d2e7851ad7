"""Rules for connections: token, origin, number of clients and rate. They apply before anything reaches the bus.

A WebSocket handshake is refused with an HTTP status and a text where the page that asks is none of ours (403), where
the token that it shows is wrong (401), or where there is no room (503). A client that shows no token may still show it
in a message; see `unauthenticated.py`.

What clients may do once they are in is `graph/policy.py`. A client needs a `RateGate` only where a rate is set.
"""

from __future__ import annotations

import hmac
import logging
import re
import ssl
from collections.abc import Iterator
from dataclasses import dataclass, field
from http import HTTPStatus
from itertools import islice
from urllib.parse import parse_qs, urlsplit

from websockets.http11 import Request

from rosbridge_sim.errors import DocumentError, Reason
from rosbridge_sim.graph.peer import FrameWork, Peer, Work
from rosbridge_sim.protocol.ops import ActionResult, Id, Op, ServiceResponse
from rosbridge_sim.shell.websocket.origins import OriginRules

__all__ = ["Access", "RateGate", "Refusal", "TokenBucket", "load_certificate"]

_log = logging.getLogger("rosbridge_sim.access")

LEAST_BURST = 100
"""Frames that may always come at once: what a program with many topics says when it connects."""

MAX_SHOWN = 3
"""Tokens that one request may show, as one connection has three tries: 8 kB of URL would have room for a thousand."""

_ANSWERS = (ServiceResponse, ActionResult)
"""Ops that others wait for: they count, but are never refused for coming too fast."""

_ANSWER = re.compile(rb'\s*\{.{0,200}?"op"\s*:\s*"(?:service_response|action_result)"', re.DOTALL)
"""The beginning of a frame that holds one of them, as all clients write it."""

_LOOKED_AT = 256
"""Bytes of a frame in which its op is looked for without decoding it."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Refusal of a handshake.

    Attributes:
        status: of the HTTP answer.
        text: its body.
        origin: of the web page that was refused; None where that is not the reason.
    """

    status: HTTPStatus
    text: str
    origin: str | None = None


@dataclass(frozen=True, slots=True)
class Access:
    """The rules for new connections.

    Attributes:
        token: required from clients; None lets every client connect.
        origins: the web pages that may connect. A handshake that shows the token is not asked for its page.
        max_clients: at once; None is no limit. Only those count that have shown the token, if one is wanted.
        max_strangers: connections at once that have not.
        max_rate: frames a second from one client, after a burst of as many (or of LEAST_BURST); None is no limit.
        patience: how long a client may be connected without a token [s].
        delay: how long the answer to a wrong token waits [s]; twice as long after each further one on a connection.
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
    ) -> Refusal | None:
        """Return why a handshake is refused; None if it may go on.

        Args:
            request: of the handshake.
            num_clients: at present.
            is_loopback: the server can be reached from this machine alone.
            own_names: names of this machine, by which web pages may call it.
        """
        if self.token is None or not self.is_shown(request):
            origins, hosts = (request.headers.get_all(name) for name in ("Origin", "Host"))
            why = self.origins.judge(origins, hosts, own_names, is_loopback=is_loopback)
            if why is not None:
                return Refusal(HTTPStatus.FORBIDDEN, f"{why}\n", origins[0])
        if not self.is_shown(request):  # a connection without the token takes no client's place
            return Refusal(HTTPStatus.UNAUTHORIZED, "The token is wrong\n") if any(_shown_tokens(request)) else None
        if self.is_full(num_clients):
            text = f"There are {num_clients} clients already, and no room for more; try again later\n"
            return Refusal(HTTPStatus.SERVICE_UNAVAILABLE, text)
        return None

    def is_full(self, num_clients: int) -> bool:
        """Tell whether there is no room for one more client."""
        return self.max_clients is not None and num_clients >= self.max_clients

    def is_shown(self, request: Request) -> bool:
        """Tell whether a request shows the token, or none is wanted."""
        if self.token is None:
            return True
        shown = list(islice(_shown_tokens(request), MAX_SHOWN + 1))
        return len(shown) <= MAX_SHOWN and any(self.is_token(text) for text in shown)

    def shows_any(self, request: Request) -> bool:
        """Tell whether the request shows a token at all, right or wrong."""
        return any(True for _ in _shown_tokens(request))

    def is_token(self, text: str) -> bool:
        """Tell whether a text is the token, in a time that does not depend on where they differ."""
        wanted = "" if self.token is None else self.token
        return hmac.compare_digest(text.encode("utf-8", "surrogatepass"), wanted.encode())


def _shown_tokens(request: Request) -> Iterator[str]:
    """Return the tokens that a request shows, in the header and in the query."""
    for value in request.headers.get_all("Authorization"):
        scheme, _, token = value.partition(" ")
        if scheme.lower() == "bearer":
            yield token.strip()
    yield from parse_qs(urlsplit(request.path).query).get("token", [])


class TokenBucket:
    """The frames that a client may still send: it fills with time up to a burst, and each frame takes one."""

    __slots__ = ("_at", "_burst", "_level", "_rate")

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """A full bucket; `rate` a second."""
        self._rate = rate
        self._burst = self._level = burst
        self._at = now

    def take(self, now: float) -> bool:
        """Take a frame's worth; return whether there was one."""
        self._level = min(self._burst, self._level + (now - self._at) * self._rate)
        self._at = now
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


class RateGate:
    """Stands before a client's peer: lets ops through, and not faster than allowed."""

    def __init__(self, peer: Peer, max_rate: int, now: float) -> None:
        """Begin with a full bucket.

        Args:
            peer: handles the frames that are let through.
            max_rate: frames a second.
            now: monotonic time [s].
        """
        self._peer = peer
        self._max_rate = max_rate
        self._num_too_many = 0
        self._is_counted = False
        self._tell_at = now
        self._bucket = TokenBucket(max_rate, max(max_rate, LEAST_BURST), now)

    def begin(self, frame: bytes, now: float) -> Work | None:
        """Do what `Peer.begin` does, as far as it is allowed. A frame that comes too fast is not even decoded."""
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
        """Do an op, or refuse it. The first one of a frame is counted with the frame, further ones each for itself."""
        is_counted, self._is_counted = self._is_counted, False
        if is_counted or self._bucket.take(now) or isinstance(op, _ANSWERS):
            self._peer.do(op, now)
        else:
            self._slow_down(now, op.id)

    def _slow_down(self, now: float, op_id: Id = None) -> None:
        """Refuse a frame, or an op of one; the client hears of it once a second."""
        self._num_too_many += 1
        self._peer.num_errors += 1
        if now >= self._tell_at:
            self._tell_at = now + 1.0
            why = f"Too fast: at most {self._max_rate} frames a second are taken from one client"
            text = f"{why}; refused so far: {self._num_too_many}"
            self._peer.session.remark("error", text, op_id)
            self._peer.note(Reason.TOO_FAST, text)


def load_certificate(certfile: str | None, keyfile: str | None) -> ssl.SSLContext | None:
    """Load the certificate for wss://; None where there is none.

    Args:
        certfile: a certificate, or a chain of them, in PEM.
        keyfile: its private key in PEM; None where the same file holds it.

    Raises:
        DocumentError: a file that cannot be read, or that holds something else.
    """
    if certfile is None:
        if keyfile is not None:
            raise DocumentError(f"keyfile {keyfile}: expected a certfile beside it; got none")
        return None
    for path in (certfile, keyfile or certfile):
        try:
            with open(path, "rb"):  # noqa: PTH123 - the library below says only that one of the two is missing
                pass
        except OSError as error:
            raise DocumentError(f"{path}: cannot be read: {error.strerror}") from None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certfile, keyfile, password=_no_password)
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            raise DocumentError(f"{keyfile or certfile}: expected the private key of {certfile}; got another") from None
        raise DocumentError(
            f"{certfile}, {keyfile or 'without a keyfile'}: expected a certificate and its private key in PEM,"
            " without a password"
        ) from None
    return context


def _no_password() -> str:
    """Return no password; without this the library would ask for one on the terminal."""
    return ""

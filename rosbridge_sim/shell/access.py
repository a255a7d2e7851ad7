"""Who may connect, and how fast a client may talk: what is judged before anything reaches the bus.

A WebSocket handshake is refused with an HTTP status and a text where the page that asks is none of ours (403), where
the token that it shows is wrong (401), or where there is no room (503). A client that shows no token may still send
`{"op": "auth", "token": ...}` first, since a page in a browser can set no header. Until then its other ops are
refused, each with an answer, and after a while its connection is closed with code 1008.

What clients may do once they are in is `graph/policy.py`. Who needs no `Warden`, since no token is wanted and no rate
is set, pays nothing for one.
"""

from __future__ import annotations

import hmac
import logging
import re
import ssl
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

from websockets.http11 import Request

from rosbridge_sim.errors import DocumentError, Reason
from rosbridge_sim.graph.peer import FrameWork, Peer, Work
from rosbridge_sim.protocol.ops import ActionResult, Auth, Id, Op, ServiceResponse

__all__ = ["Access", "Bucket", "Refusal", "Warden", "load_certificate"]

_log = logging.getLogger("rosbridge_sim.access")

LEAST_BURST = 100
"""Frames that may always come at once: what a program with many topics says when it connects."""

MAX_TRIES = 3
"""Wrong tokens in messages before the connection is closed at once."""

MAX_UNPROVEN_SIZE = 16 * 1024
"""A longer frame of a client that has shown no token is not even read [bytes]."""

_NO_TOKEN = "This server wants a token first: as ?token= in the URL, as a Bearer token, or by the op auth"  # noqa: S105

_ANSWERS = (ServiceResponse, ActionResult)
"""Ops that others wait for: they count, but are never refused for coming too fast."""

_ANSWER = re.compile(rb'\s*\{.{0,200}?"op"\s*:\s*"(?:service_response|action_result)"', re.DOTALL)
"""The beginning of a frame that holds one of them, as all clients write it."""

_LOOKED_AT = 256
"""Bytes of a frame in which its op is looked for without decoding it."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a handshake ends without a connection."""

    status: HTTPStatus
    text: str


@dataclass(frozen=True, slots=True)
class Access:
    """Who may connect.

    Attributes:
        token: what a client must show; None lets everybody in.
        origins: patterns of the pages that may connect, such as `https://*.example.org`; empty is any page where we
            listen on loopback alone, else those of the host that the client calls us by. What is no page has no origin.
        max_clients: at once; None is no limit.
        max_rate: frames a second from one client, after a burst of as many (or of LEAST_BURST); None is no limit.
        patience: how long a client may be connected without a token [s].
    """

    token: str | None = field(default=None, repr=False)
    origins: tuple[str, ...] = ()
    max_clients: int | None = 1_000
    max_rate: int | None = None
    patience: float = 10.0

    def judge(self, request: Request, num_clients: int, *, is_loopback: bool) -> Refusal | None:
        """Why this handshake is refused; None if it may go on."""
        origins = request.headers.get_all("Origin")
        if origins and not self._is_welcome(origins, request.headers.get_all("Host"), is_loopback=is_loopback):
            shown = origins[0][:100].encode("ascii", "replace").decode()
            text = f"Pages from {shown} may not connect here; --allow-origin would let them\n"
            return Refusal(HTTPStatus.FORBIDDEN, text)
        if self.token is not None and not self.is_shown(request) and any(_shown_tokens(request)):
            return Refusal(HTTPStatus.UNAUTHORIZED, "The token is wrong\n")
        if self.max_clients is not None and num_clients >= self.max_clients:
            text = f"There are {num_clients} clients already, and no room for more; try again later\n"
            return Refusal(HTTPStatus.SERVICE_UNAVAILABLE, text)
        return None

    def is_shown(self, request: Request) -> bool:
        """Whether the request itself shows the token, or none is wanted."""
        return self.token is None or any(self.is_token(text) for text in _shown_tokens(request))

    def is_token(self, text: str) -> bool:
        """Whether a text is the token, in a time that says nothing about where they differ."""
        wanted = "" if self.token is None else self.token
        return hmac.compare_digest(text.encode("utf-8", "surrogatepass"), wanted.encode())

    def _is_welcome(self, origins: list[str], hosts: list[str], *, is_loopback: bool) -> bool:
        if len(origins) > 1:
            return False
        origin = origins[0].lower()
        if self.origins:
            return any(origin == one or fnmatchcase(origin, one) for one in map(_plain_origin, self.origins))
        return is_loopback or (len(hosts) == 1 and _host_of(origin) == _host_of(f"//{hosts[0].lower()}") is not None)


def _plain_origin(pattern: str) -> str:
    return pattern.lower().removesuffix("/")


def _host_of(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:  # a bracket that nothing closes
        return None


def _shown_tokens(request: Request) -> Iterator[str]:
    """What a request shows as its token, in the header or in the query."""
    for value in request.headers.get_all("Authorization"):
        scheme, _, token = value.partition(" ")
        if scheme.lower() == "bearer":
            yield token.strip()
    yield from parse_qs(urlsplit(request.path).query).get("token", [])


class Bucket:
    """How many frames a client may still send: it fills with time up to a burst, and each frame takes one."""

    __slots__ = ("_at", "_burst", "_level", "_rate")

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """A full bucket; `rate` a second."""
        self._rate = rate
        self._burst = self._level = burst
        self._at = now

    def take(self, now: float) -> bool:
        """Whether there was one to take."""
        self._level = min(self._burst, self._level + (now - self._at) * self._rate)
        self._at = now
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


class Warden:
    """Stands before a client's peer: lets ops through once the token was shown, and not faster than allowed.

    Attributes:
        is_proven: the token was shown, or none is wanted.
    """

    def __init__(
        self,
        peer: Peer,
        access: Access,
        now: float,
        *,
        is_proven: bool,
        on_proven: Callable[[], None],
        close: Callable[[str], None],
    ) -> None:
        """A warden for one connection.

        Args:
            peer: who does what is let through.
            access: the rules.
            now: monotonic time [s].
            is_proven: the handshake has shown the token.
            on_proven: called when a message has.
            close: called with a reason when the connection is to be closed with code 1008.
        """
        self.is_proven = is_proven
        self._peer = peer
        self._access = access
        self._on_proven = on_proven
        self._close = close
        self._num_tries = 0
        self._num_too_many = 0
        self._is_counted = False
        self._tell_at = now
        rate = access.max_rate
        self._bucket = None if rate is None else Bucket(rate, max(rate, LEAST_BURST), now)

    def begin(self, frame: bytes, now: float) -> Work | None:
        """Do what `Peer.begin` does, as far as it is allowed. A frame that comes too fast is not even decoded."""
        session, bucket = self._peer.session, self._bucket
        if not self.is_proven:
            if len(frame) > MAX_UNPROVEN_SIZE:
                session.remark("error", _NO_TOKEN)
                self._peer.note(Reason.NO_TOKEN, _NO_TOKEN)
                return None
        elif bucket is not None and not bucket.take(now) and not _ANSWER.match(frame[:_LOOKED_AT]):
            self._slow_down(now)
            return None
        self._is_counted = True
        op = session.receive_plain(frame)
        if op is None:
            return FrameWork(session.receive(frame, now), self._judge)
        self._judge(op, now)
        return None

    def _judge(self, op: Op, now: float) -> None:
        """Do an op, or refuse it. The first one of a frame is counted with the frame, further ones each for itself."""
        is_counted, self._is_counted = self._is_counted, False
        if not self.is_proven:
            self._prove(op)
        elif is_counted or self._bucket is None or self._bucket.take(now) or isinstance(op, _ANSWERS):
            self._peer.do(op, now)
        else:
            self._slow_down(now, op.id)

    def expire(self) -> None:
        """Close the connection if it has still shown no token."""
        if not self.is_proven:
            self._peer.session.remark("error", _NO_TOKEN)
            self._peer.note(Reason.NO_TOKEN, _NO_TOKEN)
            self._close("no token was shown in time")

    def _prove(self, op: Op) -> None:
        """Take the op that shows the token; refuse all others until then."""
        if not isinstance(op, Auth) or op.token is None:
            self._refuse(op, _NO_TOKEN)
        elif self._num_tries >= MAX_TRIES:
            pass  # the connection is closing; what was on its way is not even tried
        elif self._access.is_token(op.token):
            self.is_proven = True
            self._on_proven()
        else:
            self._num_tries += 1
            self._refuse(op, "The token is wrong")
            if self._num_tries == MAX_TRIES:
                self._close("wrong tokens")

    def _refuse(self, op: Op, why: str) -> None:
        if not self._peer.refuse(op, why, Reason.NO_TOKEN):
            self._peer.session.remark("error", why, op.id)

    def _slow_down(self, now: float, op_id: Id = None) -> None:
        """Refuse a frame, or an op of one; the client hears of it once a second."""
        self._num_too_many += 1
        self._peer.num_errors += 1
        if now >= self._tell_at:
            self._tell_at = now + 1.0
            why = f"Too fast: at most {self._access.max_rate} frames a second are taken from one client"
            text = f"{why}; refused so far: {self._num_too_many}"
            self._peer.session.remark("error", text, op_id)
            self._peer.note(Reason.TOO_FAST, text)


def load_certificate(certfile: str | None, keyfile: str | None) -> ssl.SSLContext | None:
    """What wss:// needs; None where there is no certificate.

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
    """Nobody sits there to type one; without this the library would ask on the terminal."""
    return ""

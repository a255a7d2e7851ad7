"""A WebSocket connection to another rosbridge, and texts about why there is none.

`DialedConnection` is to a client what `server_connection.py` is to the server: messages go from the transport to a
callback and back, without a queue and a task in between. It leaves the reading of frames to the library: what comes
from a rosbridge that we dial are commands and calls of one client, and not the frames of hundreds.
"""

from __future__ import annotations

import os
import socket
import ssl
from collections.abc import Callable, Collection, Sequence

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidStatus, InvalidURI

from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.shell.terminal_text import safe
from rosbridge_sim.shell.websocket.server_connection import head_of
from rosbridge_sim.shell.websocket.urls import DEFAULT_PORT, hide, secrets_of, shown_url
from rosbridge_sim.shell.websocket.websocket_internals import MessageConnection, apply_mask

__all__ = ["DialedConnection", "why_gone", "why_not"]


class DialedConnection(MessageConnection, ClientConnection):
    """A connection that hands each message to a callback, once `listen` was called; `recv` gives nothing."""

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._on_message: Callable[[bytes], None] | None = None
        self._early: list[bytes] = []  # came before `listen`: nothing, but for a server that greets

    def listen(self, on_message: Callable[[bytes], None]) -> None:
        """From now on, call `on_message` for each message; it may not raise."""
        self._on_message = on_message
        early, self._early = self._early, []
        for message in early:
            on_message(message)

    @property
    def has_room(self) -> bool:
        """True while messages can be sent."""
        return not self.is_full and self.is_open

    def send_messages(self, messages: Sequence[bytes]) -> None:
        """Hand messages to the transport: `BinaryFrame` as binary, others as text. The connection must be open.

        The library's own way costs twice as much; nothing was agreed upon that it would have to do (no extensions).
        """
        keys = os.urandom(4 * len(messages))
        parts: list[bytes] = []
        for i, message in enumerate(messages):
            key = keys[4 * i : 4 * i + 4]
            parts += (head_of(message, mask_bit=0x80), key, apply_mask(message, key))
        self.transport.write(b"".join(parts))

    def data_received(self, data: bytes) -> None:
        """Take bytes. If the connection ends by them, the other side has a while to close it; the library waits on."""
        self.feed(data)
        self.cut_off_deaf()

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        """Take a message that the library has read."""
        del is_text, last  # rosbridge's messages tell by themselves what they are, and nothing comes compressed
        if self._on_message is None:
            self._early.append(message)
        else:
            self._on_message(message)


def why_not(
    url: str, error: Exception, patience: float, *, flag: str, token: str, secrets: Collection[str] = ()
) -> str:
    """Return why there is no connection, and what to do about it.

    Args:
        url: what was dialled.
        error: what the library raised.
        patience: how long an answer was waited for [s].
        flag: where the URL was given.
        token: where a token can be given.
        secrets: what was sent and is not to be shown, beside what stands in the URL.
    """
    shown = shown_url(url)
    hidden = secrets_of(url) | set(secrets)
    is_bad_url = isinstance(error, (InvalidURI, ValueError)) and not isinstance(error, (UnicodeError, ssl.SSLError))
    if is_bad_url:
        return f"{flag}: expected a URL such as ws://127.0.0.1:{DEFAULT_PORT}; got {shown!r}"
    if isinstance(error, InvalidStatus):
        why = _why_status(error, token, hidden)
    elif isinstance(error, TimeoutError):
        why = f"no answer within {patience:g} s; not a rosbridge, or one that is stuck"
    elif isinstance(error, ssl.SSLCertVerificationError):
        why = f"{error.verify_message}; the variable SSL_CERT_FILE may name certificates to trust"
    elif isinstance(error, ssl.SSLError) or (isinstance(error, ConnectionResetError) and url.startswith("wss:")):
        why = "no TLS there, it seems; ws:// is without"
    elif isinstance(error, ConnectionRefusedError) or "Connect call failed" in str(error):
        why = "nothing listens there; is the server running?"
    elif isinstance(error, socket.gaierror) and error.errno == socket.EAI_AGAIN:
        why = "no name server answers, to say where that host is"
    elif isinstance(error, (socket.gaierror, UnicodeError)):
        why = "there is no such host"
    elif isinstance(error, OSError) and not isinstance(error, ConnectionError):
        why = f"cannot be reached: {error.strerror or error}"
    else:
        why = f"not a rosbridge: {safe(hide(str(error.__cause__ or error), hidden) or type(error).__name__)}"
    return f"{shown}: {why}"


def _why_status(error: InvalidStatus, token: str, hidden: Collection[str]) -> str:
    """Return the meaning of an HTTP status, without what a server repeats of our request."""
    response = error.response
    denials = {
        401: f"it wants a token ({token})",
        403: "it refuses us",
        429: "it refuses us",
        503: "it takes no more clients now",
    }
    status = f"HTTP {response.status_code} {safe(hide(response.reason_phrase, hidden))}".strip()
    said = hide((response.body or b"").decode(errors="replace").strip(), hidden)
    said = f": {safe(said)}" if said and "\n" not in said and "<" not in said else ""
    return f"{denials.get(response.status_code, 'not a rosbridge')} ({status}){said}"


def why_gone(url: str, closed: ConnectionClosed, secrets: Collection[str] = ()) -> str:
    """Return how a connection ended that was not closed from here; see `why_not`."""
    shown = shown_url(url)
    hidden = secrets_of(url) | set(secrets)
    if closed.rcvd is None:
        if closed.sent is not None and closed.sent.reason:  # a frame too long, a ping without an answer
            return f"{shown}: the connection was given up: {safe(hide(closed.sent.reason, hidden))}"
        return f"{shown}: the connection was lost"
    reason = f": {safe(hide(closed.rcvd.reason, hidden))}" if closed.rcvd.reason else ""
    return f"{shown}: the server has closed the connection ({closed.rcvd.code}){reason}"

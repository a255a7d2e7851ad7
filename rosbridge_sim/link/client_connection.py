"""A WebSocket connection to another rosbridge, and error texts for failed connections.

`DialedConnection` is the client's counterpart of `server_connection.py`: messages go directly from the transport to a
callback and back, without a queue or a task in between. The library still reads the frames, because a remote rosbridge
sends only commands and calls of one client, not the frames of hundreds.
"""

from __future__ import annotations

import os
import socket
import ssl
from collections.abc import Callable, Collection, Sequence

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidMessage, InvalidStatus, InvalidURI
from websockets.frames import CloseCode

from rosbridge_sim.link.frame_heads import head_of
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.link.urls import DEFAULT_PORT, hide, secrets_of, shown_url
from rosbridge_sim.link.websocket_internals import MessageConnection, apply_mask
from rosbridge_sim.loose_types import LibraryArgument


class DialedConnection(MessageConnection, ClientConnection):
    """A connection that gives each message to a callback, after `listen` was called; `recv` returns nothing."""

    def __init__(self, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        super().__init__(*args, **kwargs)
        self._on_message: Callable[[bytes], None] | None = None
        self._early: list[bytes] = []  # messages before `listen`; only a server that sends a greeting has some

    def listen(self, on_message: Callable[[bytes], None]) -> None:
        """Call a function for each message from now on.

        Args:
            on_message: the function; it must not raise.
        """
        self._on_message = on_message
        early, self._early = self._early, []
        for message in early:
            on_message(message)

    @property
    def has_room(self) -> bool:
        """True while messages can be sent."""
        return not self.is_full and self.is_open

    def send_messages(self, messages: Sequence[bytes]) -> None:
        """Give messages to the transport: `BinaryFrame` as binary, others as text. The connection must be open.

        The library's own method costs twice as much. It is not needed, because no extensions are in use.
        """
        keys = os.urandom(4 * len(messages))
        parts: list[bytes] = []
        for i, message in enumerate(messages):
            key = keys[4 * i : 4 * i + 4]
            parts += (head_of(message, mask_bit=0x80), key, apply_mask(message, key))
        self.transport.write(b"".join(parts))

    def data_received(self, data: bytes) -> None:
        """Handle received bytes. If they end the connection, the other side has some time to close it."""
        self.feed(data)
        self.cut_off_deaf()

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        """Handle a message that the library has read.

        Args:
            is_text: not used.
            last: not used.
        """
        del is_text, last  # a rosbridge message shows its own kind, and none is compressed here
        if self._on_message is None:
            self._early.append(message)
        else:
            self._on_message(message)


class CheckedConnection(DialedConnection):
    """A connection that ends if a text is not valid UTF-8.

    Attributes:
        why_given_up: the reason, if it was this side that ended the connection.
    """

    why_given_up = ""

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        """Hand over a message that the library has read.

        Args:
            is_text: its bytes must be UTF-8.
            last: not used.
        """
        if is_text and not message.isascii():
            try:
                message.decode()
            except UnicodeDecodeError as error:
                self.why_given_up = f"{error.reason} at position {error.start}"
                self.fail(CloseCode.INVALID_DATA, self.why_given_up)
                return
        super().take_message(message, is_text=is_text, last=last)


def why_not(
    url: str, error: Exception, patience: float, *, flag: str, token: str, secrets: Collection[str] = ()
) -> str:
    """Return why there is no connection, and what to do.

    Args:
        url: the URL that was dialled.
        error: the error of the library.
        patience: time that was waited for an answer [s].
        flag: name of the flag or argument with the URL.
        token: text that says where to give a token.
        secrets: texts that were sent and must not be shown, besides those in the URL.
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
        why = "the server seems to have no TLS; use ws://"
    elif isinstance(error, ConnectionRefusedError) or "Connect call failed" in str(error):
        why = "nothing listens there; is the server running?"
    elif isinstance(error, socket.gaierror) and error.errno == socket.EAI_AGAIN:
        why = "no DNS server answers, so the host cannot be found"
    elif isinstance(error, (socket.gaierror, UnicodeError)):
        why = "there is no such host"
    elif isinstance(error, OSError) and not isinstance(error, ConnectionError):
        why = f"cannot be reached: {error.strerror or error}"
    else:
        why = f"not a rosbridge: {safe(hide(str(error.__cause__ or error), hidden) or type(error).__name__)}"
        why += "; if it speaks TLS, use wss://" if url.startswith("ws:") and _is_silent(error) else ""
    return f"{shown}: {why}"


def _is_silent(error: Exception) -> bool:
    """Return True if the server closed the connection in place of an HTTP answer, as TLS servers do."""
    return isinstance(error, InvalidMessage) and isinstance(error.__cause__, EOFError)


def _why_status(error: InvalidStatus, token: str, hidden: Collection[str]) -> str:
    """Return the meaning of an HTTP status, without parts of our request that the server repeats."""
    response = error.response
    denials = {
        401: f"it needs a token ({token})",
        403: "it refuses this client",
        429: "it refuses this client",
        503: "it accepts no more clients now",
    }
    status = f"HTTP {response.status_code} {safe(hide(response.reason_phrase, hidden))}".strip()
    said = hide((response.body or b"").decode(errors="replace").strip(), hidden)
    said = f": {safe(said)}" if said and "\n" not in said and "<" not in said else ""
    return f"{denials.get(response.status_code, 'not a rosbridge')} ({status}){said}"


def why_gone(url: str, closed: ConnectionClosed, secrets: Collection[str] = ()) -> str:
    """Return why a connection ended that was not closed from this side; see `why_not`.

    Args:
        url: the URL that was dialled.
        closed: the error of the library.
        secrets: texts that were sent and must not be shown, besides those in the URL.
    """
    shown = shown_url(url)
    hidden = secrets_of(url) | set(secrets)
    if closed.rcvd is None:
        if closed.sent is not None and closed.sent.reason:  # such as a frame that is too long, or an unanswered ping
            return f"{shown}: the connection was given up: {safe(hide(closed.sent.reason, hidden))}"
        return f"{shown}: the connection was lost"
    reason = f": {safe(hide(closed.rcvd.reason, hidden))}" if closed.rcvd.reason else ""
    return f"{shown}: the server has closed the connection ({closed.rcvd.code}){reason}"

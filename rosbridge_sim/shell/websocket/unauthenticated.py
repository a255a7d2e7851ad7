"""Connections without the token, on a server that needs one.

A browser page cannot set headers, so a client may also send its token in its first message: `{"op": "auth", "token":
...}`. Until then it is an `UnauthenticatedConnection`, without peer, session and outbox. Only small frames of plain
JSON are decoded. Frames and bytes are counted, and too many of them close the connection. A wrong token delays only
this connection, because behind a router or Docker all clients have the same address.
These connections have separate places (`ConnectionPlaces`) and never use a client's. When all places are in use, the
oldest connection is closed for the new one. So each client has some time, and a client that sends its token in the
handshake never needs such a place.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from rosbridge_sim.errors import Reason
from rosbridge_sim.protocol.first_op import FirstOp, read_first_op, refusal_frame
from rosbridge_sim.shell.transport.inflate import Deflated
from rosbridge_sim.shell.transport.server_connection import DirectConnection
from rosbridge_sim.shell.websocket.access import Access, is_from_autobahn
from rosbridge_sim.shell.websocket.turns import Turns

MAX_UNPROVEN_SIZE = 16 * 1024
"""Longest message [bytes]; a longer one closes the connection with code 1009 before its content is stored."""

MAX_UNPROVEN_BYTES = 64 * 1024
"""Most bytes in all, with pings and fragments: far more than a token in any spelling."""

MAX_REFUSED = 16
"""Frames without a token that are answered; the next one closes the connection. A program for a server without a token
sends about as many at its start, and each answer says what is missing."""

MAX_TRIES = 3
"""Wrong tokens before the connection is closed: one or two typing errors."""

NO_TOKEN = "This server needs a token first: as ?token= in the URL, as a Bearer token, or by the op auth"  # noqa: S105
WRONG_TOKEN = "The token is wrong"  # noqa: S105

MAX_OP = 30
"""Longest op in a log line [characters]; the longest existing one has 20."""

_GONE = "the connection was lost"


class UnauthenticatedConnection:
    """A connection without the token, as the `Receiver` of its socket and a `Worker` with turns.

    Attributes:
        settled: reason to close it with code 1008; None if it has sent the token. After that, nothing is read from the
            socket until another receiver listens. An internal error is its exception.
        rest: the ops behind the token in the same message.
    """

    def __init__(
        self,
        socket: DirectConnection,
        access: Access,
        turns: Turns,
        *,
        is_talkative: bool,
        on_refusal: Callable[[Reason, str, str], None] = lambda _reason, _op, _text: None,
    ) -> None:
        """Begin to wait for the token; the time limit starts now.

        Args:
            is_talkative: send status frames.
            on_refusal: called with each refusal: its reason, the op if it is a word, and the text.
        """
        loop = socket.loop
        self.settled: asyncio.Future[str | None] = loop.create_future()
        self.rest = b""
        self._socket = socket
        self._access = access
        self._turns = turns
        self._is_talkative = is_talkative
        self._on_refusal = on_refusal
        self._num_tries = 0
        self._num_refused = 0
        self._num_bytes = 0
        self._is_waiting = False  # the answer to a wrong token is delayed
        self._is_in_line = False
        self._timers = [loop.call_later(access.patience, self._contain, self._expire)]
        socket.on_too_long = self._refuse_unread

    async def wait_settled(self) -> str | None:
        """Wait until it has sent the token or must be closed; return the reason, as in `settled`."""
        ends: list[asyncio.Future[Any]] = [self.settled, self._socket.lost]
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        return self.settled.result() if self.settled.done() else _GONE

    def leave(self) -> None:
        """Stop all activity of this object. A second call does nothing."""
        for timer in self._timers:
            timer.cancel()
        self._turns.leave(self)
        self._socket.on_too_long = _ignore

    def let_go(self) -> None:
        """Ignore all received data from now on, except the closing handshake."""
        self._socket.forget()
        self._is_waiting = False
        if not self._is_in_line and self._socket.is_held:
            self._get_in_line(had_turn=False)

    # As a receiver and a worker

    def begin(self) -> float:
        """Begin a turn; return its end, by `perf_counter` [s]. See `Turns.begin`."""
        self._contain(self._count_bytes)
        return self._turns.begin()

    def receive(self, message: bytes) -> bool:
        """Read a message.

        Returns:
            True if the next one may come.
        """
        if not self.settled.done():
            self._contain(self._hear, message)
        return not (self._is_waiting or self._is_proven)

    def wait(self, *, had_turn: bool) -> None:
        """Let the socket continue in a later turn; not yet if a wrong token or the next owner must wait first.

        Args:
            had_turn: it has worked in this round; others come first.
        """
        self._hold_back()
        if not (self._is_in_line or self._is_waiting or self._is_proven):
            self._get_in_line(had_turn=had_turn)

    def work(self, until: float) -> bool:
        """Continue with received data.

        Args:
            until: end of the turn, by `perf_counter` [s].

        Returns:
            True if some is left for a later turn.
        """
        is_more = self._socket.go_on(until)
        self._hold_back()
        self._is_in_line = is_more and not (self._is_waiting or self._is_proven)
        return self._is_in_line

    # Messages and their effects

    @property
    def _is_proven(self) -> bool:
        settled = self.settled
        return settled.done() and settled.exception() is None and settled.result() is None

    def _hear(self, message: bytes) -> None:
        found = None if type(message) is Deflated else read_first_op(message)
        if found is None:
            self._refuse(None)
            return
        op, rest = found
        if op.op != "auth" or op.token is None:
            self._refuse(op)
        elif self._access.is_token(op.token):
            self.rest = rest
            self.settled.set_result(None)
        else:
            self._num_tries += 1
            self._is_waiting = True
            # The delay doubles after each try, so that guessing over one connection is not faster.
            delay = self._access.delay * 2 ** (self._num_tries - 1)
            self._timers.append(self._socket.loop.call_later(delay, self._contain, self._answer_wrong, op))

    def _hold_back(self) -> None:
        """While the answer to a wrong token is delayed, read nothing, and keep at most one message."""
        if self._is_waiting:
            self._socket.pause()
            if self._socket.num_bytes_held > MAX_UNPROVEN_SIZE:
                self._end("too much was sent behind a wrong token")

    def _answer_wrong(self, op: FirstOp) -> None:
        if self.settled.done():
            return
        self._say(refusal_frame(op, WRONG_TOKEN))
        self._on_refusal(Reason.WRONG_TOKEN, "auth", WRONG_TOKEN)
        self._is_waiting = False
        if self._num_tries >= MAX_TRIES:
            self._end("wrong tokens")
        else:
            self._get_in_line(had_turn=False)

    def _refuse(self, op: FirstOp | None) -> None:
        self._num_refused += 1
        if self._num_refused > MAX_REFUSED:
            self._end("too many messages without a token")
        else:
            self._say(refusal_frame(op, NO_TOKEN, may_be_roslibpy=is_from_autobahn(self._socket.request)))
            is_word = op is not None and len(op.op) <= MAX_OP and op.op.isascii() and op.op.isidentifier()
            self._on_refusal(Reason.NO_TOKEN, op.op if op is not None and is_word else "", NO_TOKEN)

    def _refuse_unread(self, _size: int) -> None:
        """Send the reason before the library closes the connection because of a frame's length."""
        if not self.settled.done():
            self._contain(self._say, refusal_frame(None, NO_TOKEN))

    def _count_bytes(self) -> None:
        """Count earlier data. The newest data may contain the token, with much behind it, so it is not counted yet."""
        if self._num_bytes > MAX_UNPROVEN_BYTES:
            self._end("too many bytes without a token")
        self._num_bytes = self._socket.num_early

    def _expire(self) -> None:
        if not self.settled.done():
            self._say(refusal_frame(None, NO_TOKEN))
            self._end("no token was sent in time")

    def _end(self, reason: str) -> None:
        if not self.settled.done():
            self.settled.set_result(reason)
            self.let_go()

    def _say(self, frame: bytes) -> None:
        """Send an answer. A client that does not read its answers is closed."""
        socket = self._socket
        if socket.is_full:
            self._end("answers were left unread")
        elif socket.is_open and (self._is_talkative or not frame.startswith(_STATUS)):
            socket.send_messages([frame])

    def _get_in_line(self, *, had_turn: bool) -> None:
        self._is_in_line = True
        self._turns.wait(self, had_turn=had_turn)

    def _contain(self, act: Callable[..., None], *args: object) -> None:
        """Call a function that concerns only this connection; an internal error closes it and no other."""
        try:
            act(*args)
        except Exception as error:  # noqa: BLE001 - the server logs and counts it
            if not self.settled.done():
                self.settled.set_exception(error)
            self.let_go()


_STATUS = b'{"op":"status'


def _ignore(_size: int) -> None:
    """Do nothing: the connection is lost or has become a client."""

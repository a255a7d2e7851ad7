"""One connection as a state machine: frames in, ops out; messages, answers and remarks in, frames out.

A session knows one peer's wire and nothing else: how it spells topics, in which encoding and how often it wants
their messages, which pieces of which long frames have come, from which level on it wants status frames, and
what waits in its outbox. `receive` never raises for anything that a peer can send; the peer is told what is no op.
The meaning of the ops is in `graph/peer.py`.

No encoding, piece or binary frame goes to a peer that did not ask for it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator

import orjson

from rosbridge_sim.errors import EncodingError, FrameError
from rosbridge_sim.protocol.account import Account
from rosbridge_sim.protocol.cbor_frames import decode_cbor, is_cbor
from rosbridge_sim.protocol.codec import (
    LONG,
    Encoded,
    decode_frame,
    decode_quickly,
    op_frame,
    op_from_value,
    response_frame,
    status_frame,
)
from rosbridge_sim.protocol.fragments import Characters, Defragmenter, Pieces
from rosbridge_sim.protocol.ops import Fragment, Id, Op, Png
from rosbridge_sim.protocol.outbox import LateFrames, Outbox
from rosbridge_sim.protocol.png import decode_png
from rosbridge_sim.protocol.subscription import Feed

__all__ = ["LEVELS", "Session"]

LEVELS = {"none": 0, "error": 1, "warning": 2, "warn": 2, "info": 3}
"""Levels of remarks; a peer hears those up to its own. `warn` is what C++ servers' clients write."""


class Session:
    """The wire of one peer.

    Attributes:
        outbox: what is on its way to the peer.
        account: has the memory that is held for the peer.
        level: remarks up to this one are sent; `error` until the peer asks otherwise.
        frame_length: of the frame in hand, if it is not a plain one [bytes]; else 0.
        num_received, num_refused: frames in, and those among them that held something that is no op.
        num_sent: messages of topics that went into the outbox.
        on_unsent: called with a spelling of a topic, if a message could not be encoded after it had waited.
        on_mistake: called with what is no op, after the peer was told.
        on_lost_answer: called with what is no op but should have been the answer to a call or the result of a goal.
    """

    def __init__(
        self,
        outbox: Outbox,
        alarm: Callable[[float], None],
        *,
        max_frame_size: int = 16 * 2**20,
        is_talkative: bool = True,
        on_refused: Callable[[FrameError], None] | None = None,
        account: Account | None = None,
    ) -> None:
        """Begin without subscriptions.

        Args:
            outbox: where frames for the peer go.
            alarm: called with a time [s] at which `flush` will have something to do.
            max_frame_size: longest frame that pieces may make [bytes].
            is_talkative: whether remarks are sent at all (an option for clients that choke on them).
            on_refused: hears of what is no op, in place of the peer: for a session with a server, which has no ear for
                remarks.
            account: pays for what the peer makes us hold; None is one without a limit.
        """
        self.outbox = outbox
        outbox.on_unmade = self._lose_message
        self.level = LEVELS["error"]
        self.frame_length = 0
        self.num_received = 0
        self.num_refused = 0
        self.num_sent = 0
        self.on_lost_answer: Callable[[FrameError], None] = lambda _error: None
        self.on_mistake: Callable[[FrameError], None] = lambda _error: None
        self.on_unsent: Callable[[str, EncodingError], None] = lambda _spelling, _error: None
        self._alarm = alarm
        self._is_talkative = is_talkative
        self._on_refused = on_refused
        self._max_frame_size = max_frame_size
        self.account = Account() if account is None else account
        self._defragmenter = Defragmenter(max_frame_size, self.account)
        self._num_fragmented = 0
        self._waiting: dict[Feed, None] = {}

    # In

    def receive_plain(self, frame: bytes) -> Op | None:
        """Return the one op of a clean frame of ordinary length; None where `receive` has to read it.

        Nearly every frame is of that kind, and costs half a microsecond here.
        """
        self.frame_length = 0
        if len(frame) < LONG:
            op = decode_quickly(frame)
            if op is not None and type(op) is not Fragment and type(op) is not Png:
                self.num_received += 1
                return op
        return None

    def receive(self, frame: bytes, now: float) -> Iterator[Op | None]:
        """Read the ops of a frame one by one, in order. The peer is told of whatever else is in it. Never raises.

        Args:
            frame: what came, of a text or of a binary frame.
            now: monotonic time [s].

        Yields:
            An op, or None after a slice of work without one: others may have their turn in between.
        """
        self.num_received += 1
        self.frame_length = len(frame)
        for op in self._decode(frame):
            if isinstance(op, (Fragment, Png)):
                yield from self._unwrap(op, now)
                yield None  # thousands of pieces may be glued together that make nothing whole
            elif isinstance(op, FrameError):
                self._refuse(op)
                yield None
            else:
                yield op

    def _decode(self, frame: bytes) -> Iterator[Op | FrameError | None]:
        if not is_cbor(frame):
            yield from decode_frame(frame)
            return
        try:
            yield op_from_value((yield from decode_cbor(frame)))
        except FrameError as error:
            yield error

    def _unwrap(self, op: Fragment | Png, now: float) -> Iterator[Op | None]:
        """Yield the ops inside a picture, or inside the frame that a piece has made whole."""
        try:
            inner = yield from self._open(op, now)
        except FrameError as error:
            error.op_id = error.op_id or op.id
            self._refuse(error)
            return
        for inner_op in decode_frame(inner) if inner is not None else ():
            if isinstance(inner_op, (Fragment, Png)):  # a picture in a picture in a picture: no client needs it
                self._refuse(FrameError("A fragment or a png may not hold another one", inner_op.id))
                yield None
            elif isinstance(inner_op, FrameError):
                self._refuse(inner_op)
                yield None
            else:
                yield inner_op

    def _open(self, op: Fragment | Png, now: float) -> Generator[None, None, bytes | None]:
        """The frame inside a picture, or the one that a piece has made whole, if it has.

        Raises:
            FrameError: it cannot be had.
        """
        if isinstance(op, Png):
            return (yield from decode_png(op.data, self._max_frame_size))
        return self._defragmenter.add(op, now)

    def _refuse(self, error: FrameError) -> None:
        self.num_refused += 1
        if error.op in {"service_response", "action_result"}:
            self.on_lost_answer(error)
        if self._on_refused is None:
            self.remark("error", str(error), error.op_id)
            self.on_mistake(error)
        else:
            self._on_refused(error)

    # Out

    def set_level(self, level: str) -> None:
        """Send status frames up to `level` from now on; a word that is no level changes nothing."""
        self.level = LEVELS.get(level, self.level)

    def remark(self, level: str, text: str, op_id: object = None) -> None:
        """Send a status frame, if the peer wants those of that level."""
        if self._is_talkative and LEVELS[level] <= self.level:
            self.outbox.send(status_frame(level, text, op_id))

    def answer(
        self, service: str, op_id: Id, values: Encoded | object, *, is_ok: bool, fragment_size: float | None = None
    ) -> None:
        """Answer a call of the peer's: with a message, or with whatever JSON value says why not.

        Raises:
            EncodingError: the message cannot be written; this is an internal error.
        """
        body = values.json if is_ok else orjson.dumps(values)  # type: ignore[union-attr] # is_ok: Encoded
        frame = response_frame(service, body, is_ok=is_ok, op_id=op_id)
        self.outbox.send(frame if fragment_size is None else self.pieces(frame, fragment_size))

    def say(self, op: str, bodies: dict[str, Encoded], fragment_size: float | None = None, **fields: object) -> None:
        """Send any op that is an answer or a request, and so must not be lost."""
        frame = op_frame(op, {name: body.json for name, body in bodies.items()}, **fields)
        self.outbox.send(frame if fragment_size is None else self.pieces(frame, fragment_size))

    def pieces(
        self, frame: bytes, size: float | None, share: Callable[[], Characters] | None = None
    ) -> bytes | LateFrames:
        """The frame, in pieces if the peer asked for frames of at most `size` characters.

        Args:
            frame: JSON text.
            size: None is no limit.
            share: gives its characters, if others get the same frame.
        """
        if size is None or size <= 0 or len(frame) <= size:
            return frame
        self._num_fragmented += 1
        text = Characters(frame) if share is None else share()
        return Pieces(text, int(min(size, 2**31)), f"frag:{self._num_fragmented}")

    def _lose_message(self, spelling: str, cause: Exception) -> None:
        """Report a message whose frames could not be made when the peer was to have them."""
        if isinstance(cause, EncodingError):
            self.on_unsent(spelling, cause)
            return
        error = EncodingError(f"a message cannot be written: {cause!r:.200}")
        error.__cause__ = cause
        self.on_unsent(spelling, error)

    # Feeds

    def await_turn(self, feed: Feed, due: float) -> None:
        """Have `flush` look at a feed in which messages wait (for `Feed` alone)."""
        if feed not in self._waiting:
            self._waiting[feed] = None
            self._alarm(due)

    def flush(self, now: float, stamp_ns: int) -> None:
        """Send what has waited for its turn, and set the alarm for what still does.

        Args:
            now: monotonic time [s].
            stamp_ns: the time that cbor-raw frames carry [ns].
        """
        due = float("inf")
        for feed in list(self._waiting):
            try:
                feed.flush(now, stamp_ns)
            except EncodingError as error:
                self.on_unsent(feed.spelling, error)
            turn = feed.throttle.due()
            if turn is None:
                self._waiting.pop(feed, None)
            else:
                due = min(due, turn)
        if self._waiting:
            self._alarm(due)

    def waiting(self) -> Iterator[tuple[int, int]]:
        """Identity and size of each message that waits for its turn: several sessions may hold the same one."""
        for feed in self._waiting:
            for message in feed.throttle.waiting():
                yield id(message), message.num_bytes

    def leave(self) -> None:
        """Forget what is held for a peer that is gone."""
        self._defragmenter.forget()

    def drop_feed(self, feed: Feed) -> None:
        """Forget what waits in a feed that has ended."""
        feed.throttle.forget()
        self._waiting.pop(feed, None)
        self.outbox.bursts.pop(feed.spelling, None)

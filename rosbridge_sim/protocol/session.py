"""One connection as a state machine: it turns frames into ops, and messages, answers and texts into frames.

A session knows only the wire of one peer: its spelling of topics, encodings and rates of its subscriptions, unfinished
fragments, its status level, and its outbox. `receive` never raises, whatever the peer sends; the peer is told about
each invalid part.
`graph/peers/peer.py` defines the meaning of the ops.
A peer gets other encodings, fragments or binary frames only if it asked for them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from typing import Protocol

import orjson

from rosbridge_sim.errors import EncodingError, FrameError
from rosbridge_sim.long_text import LongText, find_long_text
from rosbridge_sim.protocol.cbor_frames import decode_cbor, is_bson, is_cbor
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.protocol.fragments import Characters, Defragmenter, Pieces
from rosbridge_sim.protocol.json_decoding import (
    HEAVY,
    LONG,
    MALFORMED,
    decode_frame,
    decode_op,
    op_from_value,
    read_long_text,
)
from rosbridge_sim.protocol.json_encoding import Encoded, op_frame, response_frame, status_frame
from rosbridge_sim.protocol.ops import Fragment, Id, Op, Png
from rosbridge_sim.protocol.outbox import LateFrames, Outbox
from rosbridge_sim.protocol.png import decode_png
from rosbridge_sim.protocol.roslibpy_status import roslibpy_status_frame
from rosbridge_sim.protocol.subscription import Feed

LEVELS = {"none": 0, "error": 1, "warning": 2, "warn": 2, "info": 3}
"""Levels of status frames; a peer gets those up to its own level. Clients for C++ servers write `warn`."""

SHORT = 400
"""Only frames of at least this length are read together with their message; for shorter ones it costs more than a
second pass [bytes]."""

_WRAPPERS = frozenset({Fragment, Png})
"""Ops that hold other ops."""


class MessageReader(Protocol):
    """Reads frames together with their messages, in one pass. It knows the types of some topics."""

    def read(self, frame: bytes) -> Op | None:
        """Return the only op of a frame, with its message decoded, checked and completed; None for the usual way.

        Args:
            frame: JSON text, short enough to be decoded in one call.
        """

    def read_long(self, frame: LongText) -> Op | None:
        """Do the same for a frame that is mostly one long text."""


def _ignore(*_: object) -> None:
    """Do nothing: no one listens yet."""


class Session:
    """The wire of one peer.

    Attributes:
        outbox: frames on their way to the peer.
        account: pays for the memory that the peer uses.
        level: status frames up to this level are sent; `error` until the peer sets another one.
        is_roslibpy: the peer cannot read status frames, see `roslibpy_status.py`; None if that is not known yet.
        frame_length: length of the current frame if `receive` reads it, or of the frame inside it [bytes]; else 0.
        num_received, num_refused: number of incoming frames, and of those with an invalid part.
        num_sent: number of topic messages put into the outbox.
        on_unsent: called with the spelling of a topic if a waiting message could not be encoded.
        on_mistake: called with the error of an invalid part, after the peer was told.
        on_lost_answer: called with the error if the invalid part was an answer to a call or the result of a goal.
        find_long_text: the function of that name, or one that may know its result already.
        reader: reads some frames together with their messages.
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
        """Create a session without subscriptions.

        Args:
            outbox: takes the frames for the peer.
            alarm: called with the monotonic time at which `flush` should be called [s].
            max_frame_size: longest frame that fragments may form [bytes].
            is_talkative: False sends no status frames at all, for clients that cannot handle them.
            on_refused: gets the errors of invalid parts in place of the peer. A session with a server uses it, because
                servers do not read status frames.
            account: pays for the memory that the peer uses; None means no limit.
        """
        self.outbox = outbox
        outbox.on_unmade = self._lose_message
        self.level = LEVELS["error"]
        self.is_roslibpy: bool | None = False
        self.frame_length = 0
        self.num_received = 0
        self.num_refused = 0
        self.num_sent = 0
        self.on_lost_answer: Callable[[FrameError], None] = _ignore
        self.on_mistake: Callable[[FrameError], None] = _ignore
        self.on_unsent: Callable[[str, EncodingError], None] = _ignore
        self.reader: MessageReader | None = None
        self.find_long_text: Callable[[bytes], LongText | None] = find_long_text
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
        """Return the only op of a well-formed frame that needs no slices; None if `receive` must read the frame.

        Nearly all frames are like this: those of ordinary length, which cost half a microsecond here, and images.

        Args:
            frame: content of a text or binary frame.
        """
        self.frame_length = 0
        size = len(frame)
        if size < LONG:
            op = None if size < SHORT or self.reader is None else self.reader.read(frame)
            if op is None:
                try:
                    op = decode_op(frame)
                except MALFORMED:
                    return None
            if type(op) not in _WRAPPERS:
                self.num_received += 1
                return op
        elif size < HEAVY:
            found = self.find_long_text(frame)
            op = None if found is None or self.reader is None else self.reader.read_long(found)
            if op is None:
                op = read_long_text(found)
            if op is not None:
                self.num_received += 1
                self.frame_length = size
            return op
        return None

    def receive(self, frame: bytes, now: float) -> Iterator[Op | None]:
        """Read the ops of a frame one by one, in order. The peer is told about each invalid part. Never raises.

        Args:
            frame: content of a text or binary frame.

        Yields:
            An op; or None after a slice of work, so that others can have their turn.
        """
        self.num_received += 1
        self.frame_length = len(frame)
        for op in self._decode(frame):
            if isinstance(op, (Fragment, Png)):
                yield from self._unwrap(op, now)
                yield None  # one frame may hold thousands of fragments that complete no message
            elif isinstance(op, FrameError):
                self._refuse(op)
                yield None
            else:
                yield op

    def _decode(self, frame: bytes) -> Iterator[Op | FrameError | None]:
        if is_bson(frame):
            yield FrameError(
                "Received a frame in BSON, which this server does not read: set the client to JSON or CBOR"
                " (no bson_only_mode)"
            )
            return
        if not is_cbor(frame):
            yield from decode_frame(frame)
            return
        try:
            yield op_from_value((yield from decode_cbor(frame)))
        except FrameError as error:
            yield error

    def _unwrap(self, op: Fragment | Png, now: float) -> Iterator[Op | None]:
        """Yield the ops inside a PNG image, or inside a frame that a fragment has completed."""
        try:
            inner = yield from self._open(op, now)
        except FrameError as error:
            error.op_id = error.op_id or op.id
            self._refuse(error)
            return
        if inner is None:
            return
        self.frame_length = len(inner)
        for inner_op in decode_frame(inner):
            if isinstance(inner_op, (Fragment, Png)):  # no client needs an image in an image
                self._refuse(FrameError("A fragment or a png may not hold another one", inner_op.id))
                yield None
            elif isinstance(inner_op, FrameError):
                self._refuse(inner_op)
                yield None
            else:
                yield inner_op

    def _open(self, op: Fragment | Png, now: float) -> Generator[None, None, bytes | None]:
        """Return the frame inside a PNG image, or the one that a fragment has completed; None if fragments are missing.

        Raises:
            FrameError: the frame cannot be read.
        """
        if isinstance(op, Png):
            return (yield from decode_png(op.data, self._max_frame_size))
        return self._defragmenter.add(op, now)

    def _refuse(self, error: FrameError) -> None:
        self.num_refused += 1
        if error.op in {"service_response", "action_result"}:
            self.on_lost_answer(error)
        if self._on_refused is None:
            if error.service is None:
                self.remark("error", str(error), error.op_id)
            else:  # its caller waits
                op_id = error.op_id if isinstance(error.op_id, (str, int)) else None
                self.answer(error.service, op_id, str(error), is_ok=False)
            self.on_mistake(error)
        else:
            self._on_refused(error)

    # Out

    def set_level(self, level: str) -> None:
        """Send status frames up to `level` from now on. An unknown level changes nothing.

        Args:
            level: one of LEVELS.
        """
        self.level = LEVELS.get(level, self.level)
        self.is_roslibpy = False

    def remark(self, level: str, text: str, op_id: object = None) -> None:
        """Send a status frame if the peer wants this level.

        Args:
            level: one of LEVELS.
        """
        if self._is_talkative and LEVELS[level] <= self.level:
            if not self.is_roslibpy:
                self.outbox.send(status_frame(level, text, op_id))
            if self.is_roslibpy is not False:  # after it, so that the last line that roslibpy prints has the reason
                self.outbox.send(roslibpy_status_frame(level, text, op_id))

    def answer(
        self, service: str, op_id: Id, values: Encoded | object, *, is_ok: bool, fragment_size: float | None = None
    ) -> None:
        """Answer a call of the peer.

        Args:
            service: name of the service as the peer spelt it.
            values: the response message; or, for a failure, any JSON value with the reason.
            is_ok: `result` of the answer.
            fragment_size: longest frame that the caller asked for [characters]; None means no limit.

        Raises:
            EncodingError: the message cannot be written; this is an internal error.
        """
        body = values.json if is_ok else orjson.dumps(values)  # type: ignore[union-attr] # is_ok: Encoded
        self.outbox.send(self.pieces(response_frame(service, body, is_ok=is_ok, op_id=op_id), fragment_size))

    def say(self, op: str, bodies: dict[str, Encoded], fragment_size: float | None = None, **fields: object) -> None:
        """Send any op that is an answer or a request, and so must not be dropped.

        Args:
            bodies: messages by field name.
            fragment_size: longest frame that the peer asked for [characters]; None means no limit.
            fields: other fields; those that are None are left out.
        """
        frame = op_frame(op, {name: body.json for name, body in bodies.items()}, **fields)
        self.outbox.send(self.pieces(frame, fragment_size))

    def pieces(
        self, frame: bytes, size: float | None, share: Callable[[], Characters] | None = None
    ) -> bytes | LateFrames:
        """Return the frame, or its fragments if it is longer than `size`.

        Args:
            frame: JSON text.
            size: longest frame that the peer asked for [characters]; None means no limit.
            share: returns the characters of the frame, if other peers get the same frame.
        """
        if size is None or size <= 0 or len(frame) <= size:
            return frame
        self._num_fragmented += 1
        text = Characters(frame) if share is None else share()
        return Pieces(text, int(size), f"frag:{self._num_fragmented}")

    def _lose_message(self, spelling: str, cause: Exception) -> None:
        """Report a message whose frames could not be made when the outbox reached it."""
        if isinstance(cause, EncodingError):
            self.on_unsent(spelling, cause)
            return
        error = EncodingError(f"a message cannot be written: {cause!r:.200}")
        error.__cause__ = cause
        self.on_unsent(spelling, error)

    # Feeds

    def await_turn(self, feed: Feed, due: float) -> None:
        """Let `flush` look at a feed with waiting messages (for `Feed` alone).

        Args:
            due: monotonic time of its next message [s].
        """
        if feed not in self._waiting:
            self._waiting[feed] = None
            self._alarm(due)

    def flush(self, now: float, stamp_ns: int) -> None:
        """Send the messages whose time has come, and set the alarm for the next one.

        Args:
            stamp_ns: time that cbor-raw frames carry [ns].
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
        """Yield identity and size [bytes] of each waiting message; several sessions may hold the same message."""
        for feed in self._waiting:
            for message in feed.throttle.waiting():
                yield id(message), message.num_bytes

    def leave(self) -> None:
        """Release what is held for a peer that is gone."""
        self._defragmenter.forget()

    def drop_feed(self, feed: Feed) -> None:
        """Drop the waiting messages of a feed that has ended."""
        feed.throttle.forget()
        self._waiting.pop(feed, None)
        self.outbox.bursts.pop(feed.spelling, None)

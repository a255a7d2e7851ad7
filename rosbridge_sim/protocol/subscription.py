"""Subscriptions of one peer to one topic: merged, throttled, queued, and encoded as they ask.

All subscriptions of one client to one spelling of a topic form one feed, which sends each message at most once. Their
options are merged. The words in brackets name the source: rosbridge_suite, the protocol's text, or both:

    throttle_rate   the lowest (both)
    queue_length    the highest (the text; rosbridge_suite takes the lowest, which drops messages that a client wanted)
    fragment_size   the lowest that was given (the text)
    compression     cbor-raw before cbor before png before none (rosbridge_suite)

A throttled feed sends the first message of a burst at once. Without a queue, the others are dropped until the
interval is over. With a queue, the newest `queue_length` messages wait, and one is sent in each interval, so the last
value of a burst arrives. Time is an argument. The feed calls `await_turn`, and the session then calls `flush` in time.

A feed encodes each message as its options say. A heavy message is encoded only when the outbox reaches it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from rosbridge_sim.errors import EncodingError, FrameError, PeerError
from rosbridge_sim.printable import MAX_QUOTED, printable
from rosbridge_sim.protocol.cbor_frames import cbor_head, cbor_raw_frame
from rosbridge_sim.protocol.client_memory import Account, HeldMessages
from rosbridge_sim.protocol.fragments import Characters
from rosbridge_sim.protocol.json_decoding import HEAVY
from rosbridge_sim.protocol.json_encoding import Encoded, publish_head
from rosbridge_sim.protocol.ops import Id, Subscribe
from rosbridge_sim.protocol.outbox import BinaryFrame, LateFrames, Outbox
from rosbridge_sim.protocol.png import PictureFrames, PngFrame
from rosbridge_sim.protocol.smallest import Smallest
from rosbridge_sim.records import Record

COMPRESSIONS = ("none", "png", "cbor", "cbor-raw")
"""Encodings, from the lowest priority to the highest."""

MAX_QUEUE = 10_000
"""A longer queue_length is lowered to this one, because waiting messages use memory."""

T = TypeVar("T")


class SubscriptionOptions(Record):
    """The options of one subscription.

    Attributes:
        interval: shortest time between two messages [s]; 0 means no limit.
        queue_length: messages that may wait; 0 means none.
        fragment_size: longest frame [characters]; None means no limit.
        compression: one of COMPRESSIONS.
    """

    interval: float = 0.0
    queue_length: int = 0
    fragment_size: int | None = None
    compression: str = "none"


_PLAIN = SubscriptionOptions()


def read_options(op: Subscribe) -> SubscriptionOptions:
    """Return the options of a subscribe op. An unknown encoding means JSON, as in rosbridge_suite."""
    size = op.fragment_size
    if size is None and op.throttle_rate is None and op.queue_length is None and op.compression is None:
        return _PLAIN
    return SubscriptionOptions(
        interval=max(0.0, op.throttle_rate or 0.0) / 1e3,
        queue_length=int(min(MAX_QUEUE, max(0.0, op.queue_length or 0.0))),
        fragment_size=int(min(size, 2**31)) if size is not None and size > 0 else None,
        compression=op.compression if op.compression in COMPRESSIONS else "none",
    )


class Qos(Record):
    """The quality-of-service settings that have a meaning in one process.

    Attributes:
        depth: messages kept for later subscribers.
        is_latching: durability: True for transient_local, False for volatile, None if not given.
    """

    depth: int = 1
    is_latching: bool | None = None


QOS_VALUES: dict[str, tuple[str, ...]] = {
    "history": ("keep_last", "keep_all"),
    "reliability": ("reliable", "best_effort", "best_available"),
    "durability": ("transient_local", "volatile", "best_available"),
}
"""Policies whose value is a word. `depth` is a number. `deadline` and `lifespan` are durations, which are ignored."""

MAX_QOS_DEPTH = 1_000
"""Largest number of latched messages of one topic."""


def read_qos(qos: dict[str, object] | None) -> Qos:
    """Return the supported part of a `qos` object: durability and depth (rosbridge_suite of 2026, PR 1150).

    Args:
        qos: the object; None means none was given.

    Raises:
        FrameError: a policy or one of its values is unknown.
    """
    if qos is None:
        return Qos()
    for policy, value in qos.items():
        values = QOS_VALUES.get(policy)
        if values is None and policy not in {"depth", "deadline", "lifespan"}:
            known = [*QOS_VALUES, "depth", "deadline", "lifespan"]
            raise FrameError(f"{_shown(policy)} is not a valid policy name. Valid options are: {known}")
        if values is not None and (not isinstance(value, str) or value not in values):
            raise FrameError(f"{_shown(value)} is not a valid {policy}. Valid options are: {list(values)}")
    depth = qos.get("depth", 1)
    if not isinstance(depth, int) or isinstance(depth, bool) or depth < 0:
        raise FrameError(f"depth must be a whole number from 0 on, not {_shown(depth)}")
    keeps_all = qos.get("history") == "keep_all"
    return Qos(
        depth=MAX_QOS_DEPTH if keeps_all else max(1, min(depth, MAX_QOS_DEPTH)),
        is_latching={"transient_local": True, "volatile": False}.get(str(qos.get("durability"))),
    )


def _shown(value: object) -> str:
    return printable(repr(value), MAX_QUOTED)


class MergedOptions:
    """The options of a feed, merged from those of its subscriptions. Each change takes logarithmic time.

    Attributes:
        by_id: options of each subscription.
    """

    __slots__ = ("_bags", "by_id")

    def __init__(self) -> None:
        self.by_id: dict[Id, SubscriptionOptions] = {}
        self._bags: tuple[Smallest, Smallest, Smallest, Smallest] | None = None

    def put(self, sub_id: Id, options: SubscriptionOptions | None) -> None:
        """Set, replace or remove the options of one subscription.

        Args:
            options: its options; None removes it.
        """
        old = self.by_id.pop(sub_id, None) if options is None else self.by_id.get(sub_id)
        if options is not None:
            self.by_id[sub_id] = options
        if self._bags is not None:
            _change(self._bags, old, options)
        elif len(self.by_id) > 1:  # most feeds only ever have one subscription
            self._bags = (Smallest(), Smallest(), Smallest(), Smallest())
            for each in self.by_id.values():
                _change(self._bags, None, each)

    def merged(self) -> SubscriptionOptions:
        """Return the options of the feed. There must be at least one subscription."""
        if self._bags is None:
            (only,) = self.by_id.values()
            return only
        interval, length, rank, size = (bag.get() for bag in self._bags)
        assert interval is not None
        assert length is not None
        assert rank is not None
        return SubscriptionOptions(
            interval=interval,
            queue_length=-int(length),
            fragment_size=None if size is None else int(size),
            compression=COMPRESSIONS[-int(rank)],
        )


def _change(bags: tuple[Smallest, ...], old: SubscriptionOptions | None, new: SubscriptionOptions | None) -> None:
    """Replace the numbers of some options in each collection; they are negated if the largest one counts."""
    for options, act in ((old, Smallest.remove), (new, Smallest.add)):
        if options is not None:
            rank = COMPRESSIONS.index(options.compression)
            numbers = (options.interval, -options.queue_length, -rank, options.fragment_size)
            for bag, number in zip(bags, numbers, strict=True):
                if number is not None:
                    act(bag, number)


def _nothing(_message: object) -> int:
    """Return 0: messages are not counted."""
    return 0


class Throttle(Generic[T]):
    """Throttle and queue of one feed; it does not look into the messages.

    Attributes:
        num_dropped: number of messages that were never sent.
    """

    __slots__ = ("_free_at", "_interval", "_max_length", "_waiting", "num_dropped")

    def __init__(self, account: Account | None = None, size_of: Callable[[T], int] = _nothing) -> None:
        """Create an empty queue without a throttle.

        Args:
            account: pays for the waiting messages.
            size_of: returns the memory of a message [bytes].
        """
        self._interval = 0.0
        self._free_at = float("-inf")
        self._max_length = 0
        self._waiting = HeldMessages(account or Account(), size_of)
        self.num_dropped = 0

    def set_options(self, options: SubscriptionOptions) -> None:
        """Use new options; waiting messages stay as far as the new queue has room."""
        self._free_at += options.interval - self._interval
        self._interval = options.interval
        self._max_length = options.queue_length
        self.num_dropped += self._waiting.shorten(options.queue_length)

    def admit(self, message: T, now: float) -> bool:
        """Decide about a new message: send it now, let it wait, or drop it.

        Returns:
            True if the message should be sent now.
        """
        if self._interval == 0.0 and not self._waiting:
            return True
        if now >= self._free_at and not self._waiting:
            self._free_at = now + self._interval
            return True
        self.num_dropped += self._waiting.put(message, self._max_length) if self._max_length else 1
        return False

    def due(self) -> float | None:
        """Return the monotonic time at which `release` returns a message [s]; None if no message waits."""
        return self._free_at if self._waiting else None

    def release(self, now: float) -> T | None:
        """Remove and return the next waiting message if its time has come; else None. Call until it returns None."""
        if not self._waiting or now < self._free_at:
            return None
        # count from the due time, so that a late timer does not slow the feed; after a long delay, count from now
        self._free_at = max(self._free_at + self._interval, now)
        return self._waiting.pop()

    def forget(self) -> None:
        """Drop the waiting messages, because the subscriptions have ended."""
        self._waiting.shorten(0)

    def waiting(self) -> list[T]:
        """Return the waiting messages, oldest first."""
        return self._waiting.messages()


class FeedWire(Protocol):
    """The part of a session that a feed needs.

    Attributes:
        account: pays for the waiting messages.
        outbox: takes the frames.
        num_sent: number of messages put into the outbox.
        on_unsent: called with a spelling whose message could not be encoded.
    """

    account: Account
    outbox: Outbox
    num_sent: int
    on_unsent: Callable[[str, EncodingError], None]

    def await_turn(self, feed: Feed, due: float) -> None:
        """Call the `flush` of a feed at a given time.

        Args:
            due: monotonic time [s].
        """

    def remark(self, level: str, text: str) -> None:
        """Send a status frame."""

    def pieces(self, frame: bytes, size: float | None, share: Callable[[], Characters]) -> bytes | LateFrames:
        """Return the frame, or its fragments if it is longer than `size`.

        Args:
            frame: JSON text.
            size: longest frame [characters]; None means no limit.
            share: returns the characters of the frame, which other peers may share.
        """


class _LateMessage:
    """A heavy message on its way to one subscriber. It is encoded when it is taken, once for each encoding."""

    __slots__ = ("_feed", "_frames", "_message", "_stamp_ns", "identity", "is_finished", "num_bytes")

    def __init__(self, feed: Feed, message: Encoded, stamp_ns: int) -> None:
        self.num_bytes = message.text_length
        self.identity = id(message)
        self.is_finished = False
        self._feed = feed
        self._message: Encoded | None = message
        self._stamp_ns = stamp_ns
        self._frames: LateFrames | None = None

    def take(self, max_bytes: int) -> list[bytes]:
        """See `LateFrames`."""
        if self._frames is not None:
            frames = self._frames.take(max_bytes)
            self.is_finished = self._frames.is_finished
            return frames
        assert self._message is not None, "it is taken once"
        made = self._feed.encode_late(self._message, self._stamp_ns)
        self._message = None
        if made is None or isinstance(made, bytes):
            self.is_finished = True
            return [] if made is None else [made]
        self._frames = made
        return []


def _size_of(message: Encoded) -> int:
    return message.num_bytes


class Feed:
    """One spelling of a topic to which a peer subscribes, with the merged options of all its subscriptions.

    Attributes:
        spelling: the topic as the peer writes it.
        throttle: throttle and queue.
        ids: options of each subscription.
    """

    def __init__(self, wire: FeedWire, spelling: str) -> None:
        self.spelling = spelling
        self.throttle: Throttle[Encoded] = Throttle(wire.account, _size_of)
        self._merged = MergedOptions()
        self.ids = self._merged.by_id
        self._wire = wire
        self._options = SubscriptionOptions()
        self._is_plain = self._is_free = True
        self._is_warned = False
        self._head = publish_head(spelling)

    def set_options(self, sub_id: Id, options: SubscriptionOptions | None) -> None:
        """Set, replace or remove the options of one subscription. At least one subscription must stay.

        Args:
            options: its options; None removes it.
        """
        self._is_warned = False
        self._merged.put(sub_id, options)
        merged = self._merged.merged()
        if merged == self._options:  # avoid copying the queue for each of many subscriptions
            return
        self._options = merged
        self.throttle.set_options(merged)
        self._is_plain = merged.compression == "none" and merged.fragment_size is None
        self._is_free = self._is_plain and merged.interval == 0.0 and self.throttle.due() is None
        is_binary = merged.compression.startswith("cbor")
        self._head = cbor_head(self.spelling) if is_binary else publish_head(self.spelling)
        if merged.queue_length and merged.interval == 0.0:
            self._wire.outbox.bursts[self.spelling] = merged.queue_length
        else:
            self._wire.outbox.bursts.pop(self.spelling, None)

    def deliver(self, message: Encoded, now: float, stamp_ns: int) -> None:
        """Send a message now or later, or drop it, as the options say.

        Args:
            stamp_ns: time that cbor-raw frames carry [ns].
        """
        if self._is_free and message.text_length < HEAVY:  # nearly all of them: no throttle, plain JSON
            wire = self._wire
            wire.num_sent += 1
            wire.outbox.offer(self.spelling, message.framed(self._head))
        elif self.throttle.admit(message, now):
            self.send(message, stamp_ns)
        else:
            due = self.throttle.due()
            if due is not None:
                self._wire.await_turn(self, due)

    def flush(self, now: float, stamp_ns: int) -> None:
        """Send the waiting messages whose time has come.

        Args:
            stamp_ns: time that cbor-raw frames carry [ns].
        """
        while (message := self.throttle.release(now)) is not None:
            self.send(message, stamp_ns)

    def send(self, message: Encoded, stamp_ns: int) -> None:
        """Send a message in the wanted encoding. If it cannot be encoded so, tell the subscriber once.

        Args:
            stamp_ns: time that cbor-raw frames carry [ns].

        Raises:
            EncodingError: the message cannot be written; this is an internal error.
        """
        wire = self._wire
        if message.text_length >= HEAVY:
            wire.num_sent += 1
            wire.outbox.offer(self.spelling, _LateMessage(self, message, stamp_ns))
            return
        if self._is_plain:
            wire.num_sent += 1
            wire.outbox.offer(self.spelling, message.framed(self._head))
            return
        try:
            frame = self._encode(message, stamp_ns)
        except EncodingError:
            raise
        except PeerError as error:
            self._complain(error)
            return
        wire.num_sent += 1
        wire.outbox.offer(self.spelling, frame)

    def encode_late(self, message: Encoded, stamp_ns: int) -> bytes | LateFrames | None:
        """Encode a message that has waited in the outbox; None if it cannot be encoded (the subscriber was told).

        Args:
            stamp_ns: time that cbor-raw frames carry [ns].
        """
        try:
            return self._encode(message, stamp_ns)
        except EncodingError as error:
            self._wire.on_unsent(self.spelling, error)
        except PeerError as error:
            self._complain(error)
        return None

    def _complain(self, error: PeerError) -> None:
        """Tell the subscriber once that the messages do not exist in its encoding."""
        if not self._is_warned:
            self._is_warned = True
            self._wire.remark("error", f"{self.spelling}: {error}")

    def _encode(self, message: Encoded, stamp_ns: int) -> bytes | LateFrames:
        options = self._options
        if options.compression == "cbor":
            return BinaryFrame(self._head + message.cbor)
        if options.compression == "cbor-raw":
            return BinaryFrame(cbor_raw_frame(self._head, stamp_ns, message.raw))
        frame = message.framed(self._head)
        if options.compression == "png":
            return PictureFrames(message.shared(("png", self._head), lambda: PngFrame(frame)))
        return self._wire.pieces(
            frame, options.fragment_size, lambda: message.shared(("characters", self._head), lambda: Characters(frame))
        )

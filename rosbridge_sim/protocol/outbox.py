"""The outbox of a peer: a limited queue of frames that wait for its socket.

Topic messages, answers and status frames leave in one order, so the topics of a tick always come before the answer to
that tick. While the socket accepts frames, nothing is lost, even in a long burst. If it does not, the outbox grows to a
limit and then drops the oldest messages of each topic. The newest `burst` messages of every topic stay, as far as the
byte limit allows: rosbridge_suite's own smoke test sends ten at once to a subscriber with default settings and expects
all ten. Answers and status frames are never dropped. If they alone exceed the hard limit, the connection must be
closed.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from operator import itemgetter
from typing import Any, Protocol

from rosbridge_sim.records import Record


class BinaryFrame(bytes):
    """A frame to send as binary; plain bytes are sent as text."""

    __slots__ = ()


class LateFrames(Protocol):
    """Frames that are made only when they are taken, because this takes long or needs much memory."""

    @property
    def num_bytes(self) -> int:
        """Memory held until they are taken [bytes]."""

    @property
    def identity(self) -> int:
        """Identity of the held memory: equal for all subscribers that share it."""

    @property
    def is_finished(self) -> bool:
        """True when all frames were taken."""

    def take(self, max_bytes: int) -> list[bytes]:
        """Do a slice of work.

        Args:
            max_bytes: about how much to return [bytes].

        Returns:
            The frames that are ready, perhaps none.
        """


_frame_of: Any = itemgetter(1)  # of an entry that waits


def _ignore(topic: str, error: Exception) -> None:
    """Ignore messages whose frames could not be made."""


class OutboxLimits(Record):
    """Limits on the frames that a peer leaves unread.

    Attributes:
        burst: newest messages of each topic that are kept for a peer that does not read.
        topic_bytes: more than this drops topic messages [bytes]; at least one of each topic stays.
        hard_bytes: more than this closes the connection [bytes].
    """

    burst: int = 100
    topic_bytes: int = 4 * 2**20
    hard_bytes: int = 64 * 2**20


class Outbox:
    """The frames that wait for one socket, oldest first.

    Attributes:
        num_bytes: size of the waiting frames [bytes]; 0 only if none waits.
        bursts: topic -> newest messages to keep, if not the `burst` of the limits.
        dropped: topic -> number of dropped messages.
        is_overfull: the hard limit is exceeded; the owner of the socket should close it.
        on_unmade: called with the topic of a message whose frames cannot be made, and the error; the message is
            dropped.
    """

    def __init__(self, limits: OutboxLimits, schedule_flush: Callable[[], None], flush: Callable[[], None]) -> None:
        """Create an empty outbox.

        Args:
            limits: limits on waiting frames.
            schedule_flush: called when a frame arrives in an empty outbox; the owner should call `take` soon.
            flush: called before messages are dropped; the owner should call `take` now, as much as the socket accepts.
        """
        self._limits = limits
        self._schedule_flush = schedule_flush
        self._flush = flush
        self._frames: deque[tuple[str | None, bytes | LateFrames, int]] = deque()
        self._begun: str | None = None  # topic of the first frames, if some of them are already made
        self._num_late = 0
        self._is_relieving = False
        self._trim_at = limits.burst
        self._relieve_at = limits.topic_bytes
        self.num_bytes = 0
        self.bursts: dict[str, int] = {}
        self.dropped: Counter[str] = Counter()
        self.is_overfull = False
        self.on_unmade: Callable[[str, Exception], None] = _ignore

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def num_bytes_late(self) -> int:
        """Memory held until the first frame is taken, if that is made late; else 0 [bytes]."""
        if not self._num_late or isinstance(self._frames[0][1], bytes):
            return 0
        return self._frames[0][2]

    def send(self, frame: bytes | LateFrames) -> None:
        """Add an answer or a status frame, which is never dropped."""
        if not self._frames:
            self._schedule_flush()
        size = len(frame) if isinstance(frame, bytes) else self._size_of(frame)
        self._frames.append((None, frame, size))
        self.num_bytes += size
        if self.num_bytes > self._relieve_at:
            self._relieve()

    def offer(self, topic: str, frame: bytes | LateFrames) -> None:
        """Add a message of a topic. It may be dropped as a whole if the peer does not read."""
        waiting = self._frames
        if not waiting:
            self._schedule_flush()
        size = len(frame) if isinstance(frame, bytes) else self._size_of(frame)
        waiting.append((topic, frame, size))
        self.num_bytes += size
        if len(waiting) > self._trim_at or self.num_bytes > self._relieve_at:
            self._relieve()

    def _size_of(self, frame: LateFrames) -> int:
        self._num_late += 1
        return frame.num_bytes

    def take(self, max_bytes: int) -> list[bytes]:
        """Remove and return the oldest frames, in order.

        Args:
            max_bytes: about how much to return [bytes].

        Returns:
            At least one frame if any waits. But the list is empty if the next frame is not ready: then a slice of work
                on it was done, and the caller should ask again.

        Raises:
            Exception: the frames of an answer cannot be made. The connection should be closed, because the caller would
                wait for ever.
        """
        waiting = self._frames
        if self.num_bytes <= max_bytes and not self._num_late:
            taken: list[bytes] = list(map(_frame_of, waiting))
            waiting.clear()
            self.num_bytes = 0
            return taken
        taken = []
        total = 0
        while waiting and total < max_bytes:
            topic, frame, size = waiting[0]
            if isinstance(frame, bytes):
                taken.append(frame)
                total += size
                waiting.popleft()
                self.num_bytes -= size
                continue
            # Making frames takes time, so the frames already taken are sent first. And it must not be done once
            # for each subscriber in the turn of the client that sent the message.
            if taken or self._is_relieving:
                break
            topic = topic or self._begun
            try:
                made = frame.take(max_bytes)
            except Exception as error:
                if topic is None:
                    raise
                self._drop_first(size)
                self.on_unmade(topic, error)
                continue
            taken += made
            total += sum(map(len, made))
            if not frame.is_finished:
                self._begun = topic
                waiting[0] = None, frame, size  # begun: the rest of it must not be dropped
                break
            self._drop_first(size)
        return taken

    def frames(self) -> Iterator[tuple[int, int]]:
        """Return identity and size [bytes] of each waiting frame; several outboxes may hold the same frame."""
        for _, frame, size in self._frames:
            yield id(frame) if isinstance(frame, bytes) else frame.identity, size

    def _drop_first(self, size: int) -> None:
        """Remove the first entry, whose frames were made late or cannot be made."""
        self._frames.popleft()
        self._begun = None
        self._num_late -= 1
        self.num_bytes -= size

    def close(self) -> None:
        """Drop everything, because the peer is gone."""
        self._frames.clear()
        self._begun = None
        self._num_late = 0
        self.num_bytes = 0

    def _relieve(self) -> None:
        """Let the owner send what the socket accepts; then drop topic messages if that was not enough."""
        self._is_relieving = True
        try:
            self._flush()
        finally:
            self._is_relieving = False
        if len(self._frames) > self._trim_at or self.num_bytes > self._limits.topic_bytes:
            self._trim()
        # wait until the size has doubled before the next trim, so that trimming costs constant work per frame
        self._trim_at = max(self._limits.burst, 2 * len(self._frames))
        self._relieve_at = max(self._limits.topic_bytes, self.num_bytes + self._limits.topic_bytes // 2)
        self.is_overfull = self.num_bytes > self._limits.hard_bytes

    def _trim(self) -> None:
        """Keep all answers, and the newest messages of each topic, up to the burst and to half the byte limit."""
        kept: deque[tuple[str | None, bytes | LateFrames, int]] = deque()
        counts: Counter[str] = Counter()
        topic_bytes = 0
        num_bytes = 0
        for entry in reversed(self._frames):
            topic, frame, size = entry
            if topic is not None:
                is_over = topic_bytes + size > self._limits.topic_bytes // 2
                if counts[topic] and (is_over or counts[topic] >= self.bursts.get(topic, self._limits.burst)):
                    self.dropped[topic] += 1
                    self._num_late -= not isinstance(frame, bytes)
                    continue
                counts[topic] += 1
                topic_bytes += size
            kept.appendleft(entry)
            num_bytes += size
        self._frames = kept
        self.num_bytes = num_bytes

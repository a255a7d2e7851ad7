"""The outbox of a peer: the frames that wait for its socket, with a bound.

Topic messages, answers and remarks leave in one order, so that a tick's topics are always ahead of the
tick's answer. While the socket takes what it is given, nothing is lost, however long the burst. When it does
not, the outbox grows to a limit and then forgets the oldest messages of each topic: the newest `burst` of
every topic stay as long as the byte limit lets them (rosbridge_suite's own smoke test sends ten at once to a
subscriber with default settings and wants ten). Answers and remarks are never forgotten; if they alone pass
the hard limit, the connection has to be closed.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

__all__ = ["BinaryFrame", "LateFrames", "Outbox", "OutboxLimits"]


class BinaryFrame(bytes):
    """A frame that goes out as binary; plain bytes go out as text."""

    __slots__ = ()


class LateFrames(Protocol):
    """Frames that are made when they are taken, because making them is long work or takes much memory."""

    @property
    def num_bytes(self) -> int:
        """Memory that is held until they are taken [bytes]."""

    @property
    def identity(self) -> int:
        """Tells what is held from other things; the same for all listeners that share it."""

    @property
    def is_finished(self) -> bool:
        """True once all of them were taken."""

    def take(self, max_bytes: int) -> list[bytes]:
        """Do a slice of work; return the frames that it gave, if any: about `max_bytes` in all."""


def _ignore(topic: str, error: Exception) -> None:
    """Ignore messages whose frames could not be made."""


@dataclass(frozen=True, slots=True)
class OutboxLimits:
    """The bounds on what a peer may leave unread.

    Attributes:
        burst: newest messages of each topic that are kept for a peer that does not read.
        topic_bytes: topic messages are forgotten beyond this [bytes]; at least one of each topic stays.
        hard_bytes: the connection is closed beyond this [bytes].
    """

    burst: int = 100
    topic_bytes: int = 4 * 2**20
    hard_bytes: int = 64 * 2**20


class Outbox:
    """The frames that wait for one socket, oldest first.

    Attributes:
        num_bytes: what waits now [bytes].
        bursts: topic -> newest messages kept, where it is not the limits' burst.
        dropped: topic -> messages forgotten.
        is_overfull: the hard limit is passed; the owner of the socket should close it.
        on_unmade: called with the topic of a message, and why its frames could not be made; the message is dropped.
    """

    __slots__ = (
        "_begun",
        "_flush",
        "_frames",
        "_is_relieving",
        "_limits",
        "_num_late",
        "_relieve_at",
        "_schedule_flush",
        "_trim_at",
        "bursts",
        "dropped",
        "is_overfull",
        "num_bytes",
        "on_unmade",
    )

    def __init__(self, limits: OutboxLimits, schedule_flush: Callable[[], None], flush: Callable[[], None]) -> None:
        """An empty outbox.

        Args:
            limits: the bounds.
            schedule_flush: called when a frame arrives in an empty outbox; its owner should call `take` soon.
            flush: called before anything is forgotten; its owner should call `take` now, as much as the socket takes.
        """
        self._limits = limits
        self._schedule_flush = schedule_flush
        self._flush = flush
        self._frames: deque[tuple[str | None, bytes | LateFrames, int]] = deque()
        self._begun: str | None = None  # the topic of the first frames, if some of them were made already
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

    def send(self, frame: bytes | LateFrames) -> None:
        """Add an answer or a remark, which is never forgotten."""
        if not self._frames:
            self._schedule_flush()
        size = len(frame) if isinstance(frame, bytes) else self._size_of(frame)
        self._frames.append((None, frame, size))
        self.num_bytes += size
        if self.num_bytes > self._relieve_at:
            self._relieve()

    def offer(self, topic: str, frame: bytes | LateFrames) -> None:
        """Add a message of a topic, which may be forgotten, as a whole, if the peer does not read."""
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
        """Take the oldest frames, in order: about `max_bytes` in all.

        Returns:
            One frame at least if there is any; but none where the next one is not finished: a slice of the work on it
            was done, and there will be more if it is asked again.

        Raises:
            Exception: the frames of an answer cannot be made. Its caller would wait for ever, so the
                connection should be closed.
        """
        waiting = self._frames
        if self.num_bytes <= max_bytes and not self._num_late:
            taken: list[bytes] = [frame for _, frame, _ in waiting]  # type: ignore[misc] # none is late
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
            # Making frames is work of its own: what was taken goes first. And it must not be done in the turn of the
            # client that has sent the message, once for each subscriber.
            if taken or self._is_relieving:
                break
            topic = topic or self._begun
            try:
                made = frame.take(max_bytes - total)
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
                waiting[0] = None, frame, size  # begun: the rest of it must not be forgotten
                break
            self._drop_first(size)
        return taken

    def frames(self) -> Iterator[tuple[int, int]]:
        """Identity and size of each frame that waits: several outboxes may hold the same one [bytes]."""
        for _, frame, size in self._frames:
            yield id(frame) if isinstance(frame, bytes) else frame.identity, size

    def _drop_first(self, size: int) -> None:
        """Take out the first frames, which were made late or cannot be made."""
        self._frames.popleft()
        self._begun = None
        self._num_late -= 1
        self.num_bytes -= size

    def close(self) -> None:
        """Forget everything: the peer is gone."""
        self._frames.clear()
        self._begun = None
        self._num_late = 0
        self.num_bytes = 0

    def _relieve(self) -> None:
        """Have the owner take what the socket takes; forget topic messages if that was not enough."""
        self._is_relieving = True
        try:
            self._flush()
        finally:
            self._is_relieving = False
        if len(self._frames) > self._trim_at or self.num_bytes > self._limits.topic_bytes:
            self._trim()
        # not again before as much has come as is left: trimming then costs each frame a constant amount of work
        self._trim_at = max(self._limits.burst, 2 * len(self._frames))
        self._relieve_at = max(self._limits.topic_bytes, self.num_bytes + self._limits.topic_bytes // 2)
        self.is_overfull = self.num_bytes > self._limits.hard_bytes

    def _trim(self) -> None:
        """Keep the newest of each topic, up to the burst and to half the byte limit, and all that is no topic."""
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

"""The memory that one client makes the server hold: counted in bytes, and bounded.

Messages in throttle queues, latched messages, calls and goals in flight and unfinished pieces of frames are all taken
from one account. Numbers of things alone are no bound: three topics that keep a thousand messages of 4 MB each hold
12 GB. What waits for a slow reader has a bound of its own (`outbox.py`). A shared message counts in each account.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

__all__ = ["UNLIMITED", "Account", "HeldMessages"]

T = TypeVar("T")

UNLIMITED = 2**62
"""A limit for owners in this process."""


class Account:
    """Bytes that are held for one owner; what is taken is given back when it is let go.

    Attributes:
        num_bytes: held now [bytes].
    """

    __slots__ = ("_limit", "_total", "num_bytes")

    def __init__(self, limit: int = UNLIMITED, total: Account | None = None) -> None:
        """Begin with nothing held.

        Args:
            limit: the most that can be held [bytes].
            total: an account of all owners together, kept beside this one.
        """
        self.num_bytes = 0
        self._limit = limit
        self._total = total

    def has_room(self, size: int) -> bool:
        """Return whether so many bytes more can be held."""
        return self.num_bytes + size <= self._limit

    def take(self, size: int) -> bool:
        """Hold so many bytes more; return whether there was room."""
        if self.num_bytes + size > self._limit:
            return False
        self.num_bytes += size
        if self._total is not None:
            self._total.num_bytes += size
        return True

    def give(self, size: int) -> None:
        """Let go of so many bytes."""
        self.num_bytes -= size
        if self._total is not None:
            self._total.num_bytes -= size


class HeldMessages(Generic[T]):
    """Messages that wait, oldest first, bounded in number and by an account; the oldest are dropped for the newest."""

    __slots__ = ("_account", "_entries", "_size_of")

    def __init__(self, account: Account | None, size_of: Callable[[T], int]) -> None:
        """No messages.

        Args:
            account: has their memory; None where there is no limit but their number.
            size_of: what a message costs [bytes].
        """
        self._account = account
        self._size_of = size_of
        self._entries: deque[tuple[T, int]] = deque()

    def __len__(self) -> int:
        return len(self._entries)

    def messages(self) -> list[T]:
        """All of them, oldest first."""
        return [message for message, _ in self._entries]

    def put(self, message: T, max_length: int) -> int:
        """Add the newest message; return how many were dropped for it, or itself: 1, where there is no room at all."""
        entries = self._entries
        if self._account is None:
            entries.append((message, 0))
            if len(entries) <= max_length:
                return 0
            entries.popleft()
            return 1
        size = self._size_of(message)
        num_dropped = self.shorten(max_length - 1)
        while not self._account.take(size):
            if not self._entries:
                return num_dropped + 1
            self.pop()
            num_dropped += 1
        if max_length > 0:
            self._entries.append((message, size))
            return num_dropped
        self._account.give(size)
        return num_dropped + 1

    def pop(self) -> T:
        """Take the oldest message out."""
        message, size = self._entries.popleft()
        if self._account is not None:
            self._account.give(size)
        return message

    def shorten(self, max_length: int) -> int:
        """Drop the oldest messages until so many are left; return how many were dropped."""
        num_dropped = 0
        while len(self._entries) > max(0, max_length):
            self.pop()
            num_dropped += 1
        return num_dropped

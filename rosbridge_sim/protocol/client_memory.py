"""Memory that one client makes the server hold: counted in bytes, and limited.

One account pays for messages in throttle queues, latched messages, calls and goals in flight, and fragments of
unfinished frames. A limit on the number of things is not enough: three topics that keep a thousand messages of 4 MB
each hold 12 GB. Frames that wait for a slow reader have their own limit (`outbox.py`). A message shared by several
owners counts in each account.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

UNLIMITED = 2**62
"""Limit of an owner inside this process: none in practice [bytes]."""


class Account:
    """Bytes held for one owner. Each `take` needs a `give` of the same size later.

    Attributes:
        num_bytes: bytes held now.
    """

    __slots__ = ("_limit", "_total", "num_bytes")

    def __init__(self, limit: int = UNLIMITED, total: Account | None = None) -> None:
        """Create an account that holds nothing.

        Args:
            limit: largest number of bytes it may hold.
            total: account of all owners together, which is updated, too.
        """
        self.num_bytes = 0
        self._limit = limit
        self._total = total

    def has_room(self, size: int) -> bool:
        """Return True if `size` more bytes fit into the limit.

        Args:
            size: number of bytes.
        """
        return self.num_bytes + size <= self._limit

    def take(self, size: int) -> bool:
        """Hold `size` more bytes if there is room.

        Args:
            size: number of bytes.

        Returns:
            True if the bytes are held now; False if there was no room.
        """
        if self.num_bytes + size > self._limit:
            return False
        self.num_bytes += size
        if self._total is not None:
            self._total.num_bytes += size
        return True

    def give(self, size: int) -> None:
        """Release bytes that were taken.

        Args:
            size: number of bytes.
        """
        self.num_bytes -= size
        if self._total is not None:
            self._total.num_bytes -= size


class HeldMessages(Generic[T]):
    """Queue of waiting messages, limited in number and by an account. The oldest are dropped first.

    Attributes:
        entries: the messages with their sizes [bytes], oldest first; read only for others.
    """

    __slots__ = ("_account", "_size_of", "entries")

    def __init__(self, account: Account | None, size_of: Callable[[T], int]) -> None:
        """Create an empty queue.

        Args:
            account: pays for the messages; None means that only their number is limited.
            size_of: returns the memory of a message [bytes].
        """
        self._account = account
        self._size_of = size_of
        self.entries: deque[tuple[T, int]] = deque()

    def __len__(self) -> int:
        return len(self.entries)

    def messages(self) -> list[T]:
        """Return all messages, oldest first."""
        return [message for message, _ in self.entries]

    def put(self, message: T, max_length: int) -> int:
        """Add the newest message; drop the oldest ones if there is no room.

        Args:
            max_length: largest number of messages.

        Returns:
            Number of dropped messages. It is 1 if the new message itself does not fit.
        """
        entries = self.entries
        if self._account is None:
            entries.append((message, 0))
            if len(entries) <= max_length:
                return 0
            entries.popleft()
            return 1
        size = self._size_of(message)
        num_dropped = self.shorten(max_length - 1)
        while not self._account.take(size):
            if not self.entries:
                return num_dropped + 1
            self.pop()
            num_dropped += 1
        if max_length > 0:
            self.entries.append((message, size))
            return num_dropped
        self._account.give(size)
        return num_dropped + 1

    def pop(self) -> T:
        """Remove and return the oldest message."""
        message, size = self.entries.popleft()
        if self._account is not None:
            self._account.give(size)
        return message

    def shorten(self, max_length: int) -> int:
        """Drop the oldest messages until at most `max_length` are left.

        Args:
            max_length: largest number of messages.

        Returns:
            Number of dropped messages.
        """
        num_dropped = 0
        while len(self.entries) > max(0, max_length):
            self.pop()
            num_dropped += 1
        return num_dropped

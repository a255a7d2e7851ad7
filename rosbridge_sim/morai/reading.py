"""Work that reads from a disk, done without holding up anybody but the client that asked for it.

The simulator says what is to be read, as a function that touches nothing of its own state; the shell calls it in a
thread and brings the outcome back. So what follows from a document happens between two frames, like everything else.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from rosbridge_sim.errors import DocumentError

__all__ = ["AtOnce", "Reader"]

T = TypeVar("T")


class Reader(Protocol):
    """Something that does the reading."""

    def read(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None], now: float) -> None:
        """Have something read, which may take its time.

        Args:
            work: called once, perhaps in another thread; it changes nothing that others use, and what it raises as
                DocumentError is its outcome.
            then: called once with the outcome and the time [s], perhaps before this returns, and never while frames are
                being computed.
            now: monotonic time [s].
        """


class AtOnce:
    """The reader of a simulator without an event loop: everybody waits."""

    def read(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None], now: float) -> None:
        """See `Reader`."""
        outcome: T | DocumentError
        try:
            outcome = work()
        except DocumentError as error:
            outcome = error
        then(outcome, now)

"""Reading from a disk without delaying other clients than the one that asked.

The simulator passes a function that reads and that touches nothing of the simulator's state. The shell calls it in a
thread and returns the result between two frames. So a document takes effect between two frames, like every command.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias, TypeVar

from rosbridge_sim.errors import DocumentError

T = TypeVar("T")

Then: TypeAlias = Callable[[T | DocumentError, float], None]
"""Takes what has been read, or the error that prevented it; and monotonic time [s]."""


class Reader(Protocol):
    """Runs functions that read from a disk."""

    def read(self, work: Callable[[], T], then: Then[T], now: float) -> None:
        """Run a function that may take seconds.

        Args:
            work: called once, perhaps in another thread. It must not change shared state. A DocumentError that it
                raises is
                its result.
            then: called once with the result and monotonic time [s]; perhaps before this method returns, but never
                while
                frames are being computed.
        """


def read_while_held(
    reader: Reader, work: Callable[[], T], then: Then[T], hold: Callable[[], Callable[[float], None]], now: float
) -> None:
    """Run a function that may take seconds, and hold the client that asked for it until its result has been taken.

    Args:
        work: see `Reader.read`.
        then: see `Reader.read`.
        hold: holds the client; returns what releases it. It is not called if the result is there at once.
    """
    is_done = False
    release: Callable[[float], None] | None = None

    def finish(outcome: T | DocumentError, now: float) -> None:
        nonlocal is_done
        is_done = True
        try:
            then(outcome, now)
        finally:
            if release is not None:
                release(now)

    reader.read(work, finish, now)
    if not is_done:
        release = hold()


def answering(refuse: Callable[[str], object], then: Then[T]) -> Then[T]:
    """Return a function that does the same, and that answers a call even if it fails: a caller must not wait for ever.

    Args:
        refuse: refuses the call; does nothing if it has been answered.
        then: uses what has been read. It may raise anything, which goes on to the reader, and into its log.
    """

    def answer(outcome: T | DocumentError, now: float) -> None:
        try:
            then(outcome, now)
        except BaseException:
            refuse("the server failed to use what it has read; the server's log says why")
            raise

    return answer


class AtOnce:
    """Reader for a simulator without an event loop: it blocks until the work is done."""

    def read(self, work: Callable[[], T], then: Then[T], now: float) -> None:
        """Run the work and pass its result on before returning; see `Reader.read`."""
        outcome: T | DocumentError
        try:
            outcome = work()
        except DocumentError as error:
            outcome = error
        then(outcome, now)

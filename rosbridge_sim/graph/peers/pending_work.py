"""Calls or goals that wait for a client as their provider, by the ids that were sent to it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Generic, Protocol, TypeVar

from rosbridge_sim.errors import FrameError
from rosbridge_sim.graph.peers.peer_base import CheckRoom, PeerBase

MIN_TIDY = 1_000
"""Ended calls or goals that a list may hold before they are removed. A late answer to one of them is not a mistake."""


class _Awaited(Protocol):
    """A call or a goal.

    Attributes:
        is_done: it has ended.
    """

    is_done: bool


W = TypeVar("W", bound=_Awaited)


class PendingWork(Generic[W]):
    """The work that was given to one service or action.

    Attributes:
        num_given: number of calls or goals so far.
    """

    def __init__(self, prefix: str, spelling: str) -> None:
        """Create an empty list.

        Args:
            prefix: start of the ids; the spelling and a number follow.
            spelling: name of the service or action as the client writes it.
        """
        self.num_given = 0
        self._prefix = f"{prefix}:{spelling}:"
        self._by_id: dict[str, W] = {}
        self._tidy_at = 0

    def tidy(self) -> bool:
        """Remove ended work if there is much of it, so that each call costs little.

        Returns:
            True if any was removed.
        """
        if len(self._by_id) < self._tidy_at:
            return False
        self._by_id = {work_id: work for work_id, work in self._by_id.items() if not work.is_done}
        self._tidy_at = max(MIN_TIDY, 2 * len(self._by_id))
        return True

    def add(self, work: W) -> str:
        """Add a call or goal.

        Args:
            work: the call or goal.
        """
        self.num_given += 1
        work_id = f"{self._prefix}{self.num_given}"
        self._by_id[work_id] = work
        return work_id

    def get(self, work_id: object) -> W | None:
        """Return the work with an id, which may have ended; None if there is none."""
        return self._by_id.get(work_id) if isinstance(work_id, str) else None

    def pop(self, work_id: object) -> W | None:
        """Remove and return the work with an id; None if there is none."""
        return self._by_id.pop(work_id, None) if isinstance(work_id, str) else None

    def items(self) -> Iterable[tuple[str, W]]:
        """Return all ids with their work, oldest first."""
        return self._by_id.items()

    def awaited(self) -> Iterator[W]:
        """Yield the work that has not ended."""
        return (work for work in self._by_id.values() if not work.is_done)


class Offers(Generic[W]):
    """The services, or the actions, that one client provides."""

    def __init__(self, peer: PeerBase, check_room: CheckRoom, fail: Callable[[W, str], None]) -> None:
        """Create an empty table.

        Args:
            check_room: called before it offers another one.
            fail: ends a call or a goal, for a reason.
        """
        self._peer = peer
        self._check_room = check_room
        self._fail = fail
        self._provided: dict[str, PendingWork[W]] = {}  # by absolute name

    @property
    def num_held(self) -> int:
        """Number of services or actions that the client provides."""
        return len(self._provided)

    def lose(self, name: str) -> None:
        """Remove one that another owner takes.

        Args:
            name: absolute name.
        """
        self._provided.pop(name, None)

    def fail_unreadable(self, error: FrameError) -> None:
        """Fail the call or goal whose answer cannot be read, because its caller would wait for ever.

        If the frame has no id of one, it is only known if exactly one waits.
        """
        work = find_awaited(self._provided, error.op_id)
        if work is not None:
            self._fail(work, f"The provider's answer cannot be read: {error}")

    def forget(self) -> None:
        """Forget all; the bus removes its own entries itself."""
        self._provided.clear()


def find_awaited(offers: dict[str, PendingWork[W]], work_id: object) -> W | None:
    """Return the work with an id; without an id, the only unfinished work.

    Args:
        offers: pending work by absolute name.
        work_id: id of a call or goal; if it is not a text, it counts as missing.

    Returns:
        The work; None if it is not found, or if several are unfinished and there is no id.
    """
    if isinstance(work_id, str):
        name = work_id.partition(":")[2].rpartition(":")[0]
        offer = offers.get(name) or offers.get("/" + name)
        return None if offer is None else offer.get(work_id)
    awaited = (work for offer in offers.values() for work in offer.awaited())
    first, second = next(awaited, None), next(awaited, None)
    return first if second is None else None

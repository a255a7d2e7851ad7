"""Calls or goals that wait for a provider among the clients, by the ids under which it got them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Generic, Protocol, TypeVar

__all__ = ["PendingWork", "find_awaited"]

MIN_TIDY = 1_000
"""Ended calls or goals that a list may hold before it is tidied: late answers to them are no mistake."""


class _Awaited(Protocol):
    """A call or a goal.

    Attributes:
        is_done: it has ended.
    """

    is_done: bool


W = TypeVar("W", bound=_Awaited)


class PendingWork(Generic[W]):
    """The work that one service or action has been given.

    Attributes:
        spelling: its name, as the client writes it.
        num_given: calls or goals so far.
    """

    __slots__ = ("_by_id", "_prefix", "_tidy_at", "num_given", "spelling")

    def __init__(self, prefix: str, spelling: str) -> None:
        """No work yet.

        Args:
            prefix: what the ids begin with; the spelling and a number follow.
            spelling: see above.
        """
        self.spelling = spelling
        self.num_given = 0
        self._prefix = prefix
        self._by_id: dict[str, W] = {}
        self._tidy_at = 0

    def tidy(self) -> bool:
        """Forget what has ended, when it is much, so that each call costs little; return whether it was."""
        if len(self._by_id) < self._tidy_at:
            return False
        self._by_id = {work_id: work for work_id, work in self._by_id.items() if not work.is_done}
        self._tidy_at = max(MIN_TIDY, 2 * len(self._by_id))
        return True

    def add(self, work: W) -> str:
        """Have one more wait; return its id."""
        self.num_given += 1
        work_id = f"{self._prefix}:{self.spelling}:{self.num_given}"
        self._by_id[work_id] = work
        return work_id

    def get(self, work_id: object) -> W | None:
        """The work under an id, perhaps ended; None if there is none."""
        return self._by_id.get(work_id) if isinstance(work_id, str) else None

    def pop(self, work_id: object) -> W | None:
        """Take the work under an id out; None if there is none."""
        return self._by_id.pop(work_id, None) if isinstance(work_id, str) else None

    def items(self) -> Iterable[tuple[str, W]]:
        """All ids with their work, oldest first."""
        return self._by_id.items()

    def awaited(self) -> Iterator[W]:
        """The work that has not ended."""
        return (work for work in self._by_id.values() if not work.is_done)


def find_awaited(offers: dict[str, PendingWork[W]], work_id: object) -> W | None:
    """The work under an id or, without an id, the only one that has not ended.

    Args:
        offers: by absolute name.
        work_id: of a call or a goal; a text or nothing of use.
    """
    if isinstance(work_id, str):
        name = work_id.partition(":")[2].rpartition(":")[0]
        offer = offers.get(name) or offers.get("/" + name)
        return None if offer is None else offer.get(work_id)
    awaited = (work for offer in offers.values() for work in offer.awaited())
    first, second = next(awaited, None), next(awaited, None)
    return first if second is None else None

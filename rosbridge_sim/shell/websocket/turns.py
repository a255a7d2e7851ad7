"""Turns: the work that clients ask for is done in short pieces, so that one client never holds up the others.

Everything happens in one thread, so whatever is done for one client keeps all others waiting. A frame is handled when
it comes, as long as the round has time left. A round is one pass of the event loop; after it, the loop looks at all
sockets again. Work that does not fit waits here and goes on in later rounds, one client after the other. A client that
has had no turn yet comes before those that have: a small request waits for one turn of a large one, not for all of it.

Turns are counted in time and not in messages, because a message may cost a microsecond or a second.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from time import perf_counter
from typing import Protocol

__all__ = ["Turns", "Worker"]

TURN_TIME = 0.002
"""Longest turn of one client, before others have theirs [s]: some 150 small messages."""

ROUND_TIME = 0.004
"""Longest round of all clients, before the sockets and the world are looked at again [s]: a fifth of a frame."""


class Worker(Protocol):
    """A client that may have work left."""

    def work(self, until: float) -> bool:
        """Go on until that time of `perf_counter` [s], or as long as one op takes; return whether any work is left.

        Must not raise: others would lose their turn.
        """


class Turns:
    """The turns of all clients of one server."""

    def __init__(self, loop: asyncio.AbstractEventLoop, on_round: Callable[[], None]) -> None:
        """Begin without any worker.

        Args:
            loop: its passes are the rounds.
            on_round: called after each round in which a client has worked; it must not raise.
        """
        self._loop = loop
        self._on_round = on_round
        self._is_begun = False
        self._ends = 0.0
        self._new: deque[Worker] = deque()
        self._old: deque[Worker] = deque()

    def begin(self) -> float:
        """Begin a client's turn, and a round if none is under way; return when the turn ends, by `perf_counter` [s].

        The turn may be over already: then the round is, and the client should `wait`.
        """
        now = perf_counter()
        if not self._is_begun:
            self._is_begun = True
            self._ends = now + ROUND_TIME
            self._loop.call_soon(self._end_round)
        return min(now + TURN_TIME, self._ends)

    def wait(self, worker: Worker, *, had_turn: bool) -> None:
        """Have a worker's `work` called in a later turn, and again until nothing is left. Once at a time, please.

        Args:
            worker: has work left.
            had_turn: it has worked in this round; others come first.
        """
        (self._old if had_turn else self._new).append(worker)
        self.begin()  # a round, so that it ends

    def leave(self, worker: Worker) -> None:
        """Forget a worker; one that does not wait is no error."""
        for waiting in (self._new, self._old):
            if worker in waiting:
                waiting.remove(worker)

    def _end_round(self) -> None:
        self._is_begun = False
        self._on_round()
        if not self._new and not self._old:
            return
        self.begin()
        new, self._new = self._new, deque()
        while new and perf_counter() < self._ends:
            self._serve(new.popleft())
        self._new.extendleft(reversed(new))
        # One of these at least has its turn in each round, however many others come.
        for i in range(len(self._old)):
            if i and perf_counter() >= self._ends:
                break
            self._serve(self._old.popleft())

    def _serve(self, worker: Worker) -> None:
        if worker.work(perf_counter() + TURN_TIME):
            self._old.append(worker)

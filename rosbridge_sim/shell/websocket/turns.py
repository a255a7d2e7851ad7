"""Turns: work for clients is done in short pieces, so that one client never blocks the others.

Everything runs in one thread, so work for one client delays all others. A frame is handled when it arrives, as long as
the round has time left. A round is one pass of the event loop; after it, the loop checks all sockets again. Work that
does not fit waits here and continues in later rounds, one client after the other. Clients without a turn so far come
first: a small request waits for one turn of a large one, not for all of it.
Turns are measured in time, not in messages, because a message may cost a microsecond or a second.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from time import perf_counter
from typing import Protocol

TURN_TIME = 0.002
"""Longest turn of one client, before others have theirs [s]: about 150 small messages."""

ROUND_TIME = 0.004
"""Longest round of all clients, before the sockets and the world are checked again [s]: a fifth of a frame."""

ROUND_BYTES = 32 * 2**20
"""Bytes of heavy messages that all sockets get in one round: 15 ms. The time of a round does not bound them, because
the event loop writes to the sockets after it."""


class Worker(Protocol):
    """A client that may have work left."""

    def work(self, until: float) -> bool:
        """Continue until the given time, or until the current op ends.

        Must not raise, because others would lose their turn.

        Args:
            until: end of the turn, by `perf_counter` [s].

        Returns:
            True if work is left.
        """


class Turns:
    """The turns of all clients of one server.

    Attributes:
        until: end of the turn that runs, by `perf_counter` [s].
        num_bytes_left: bytes that sockets may still get in this round; clients subtract theirs. Below 1, heavy messages
            wait for a later round.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, on_round: Callable[[], None]) -> None:
        """Begin without workers.

        Args:
            on_round: called after each round in which a client has worked; it must not raise.
        """
        self._loop = loop
        self._on_round = on_round
        self.until = 0.0
        self.num_bytes_left = ROUND_BYTES
        self._is_begun = False
        self._ends = 0.0
        self._new: deque[Worker] = deque()
        self._old: deque[Worker] = deque()
        self._flushes: list[Callable[[], None]] = []
        self._is_gathering = False  # the end of a round will call what comes to `flush_later`

    def begin(self) -> float:
        """Begin a client's turn, and a round if none is running.

        Returns:
            End of the turn, by `perf_counter` [s]. If it is over already, so is the round, and the client should
            `wait`.
        """
        now = perf_counter()
        if not self._is_begun:
            self._begin_round(now)
        until = now + TURN_TIME
        self.until = until = until if until < self._ends else self._ends  # noqa: FURB136 - each read comes here; `min` takes 70 ns more
        return until

    def _begin_round(self, now: float) -> None:
        self._is_begun = self._is_gathering = True
        self._ends = now + ROUND_TIME
        self._loop.call_soon(self._end_round)

    def flush_later(self, flush: Callable[[], None]) -> None:
        """Call a function at the end of the running round, after the world's turn; without a round, in the next pass.

        Args:
            flush: sends what waits for one socket; it must not raise.
        """
        if self._is_gathering:
            self._flushes.append(flush)
        else:
            self._loop.call_soon(flush)

    def wait(self, worker: Worker, *, had_turn: bool) -> None:
        """Call a worker's `work` in later turns until nothing is left. The worker must not be waiting already.

        Args:
            worker: has work left.
            had_turn: it has worked in this round; others come first.
        """
        (self._old if had_turn else self._new).append(worker)
        if not self._is_begun:  # the end of a round serves the worker
            self._begin_round(perf_counter())

    def leave(self, worker: Worker) -> None:
        """Forget a worker; one that does not wait is not an error."""
        for waiting in (self._new, self._old):
            if worker in waiting:
                waiting.remove(worker)

    def _end_round(self) -> None:
        self._is_begun = False
        self.num_bytes_left = ROUND_BYTES
        self._on_round()
        flushes, self._flushes = self._flushes, []
        self._is_gathering = self._is_begun
        for flush in flushes:
            flush()
        if not self._new and not self._old:
            return
        if not self._is_begun:
            self._begin_round(perf_counter())
        new, self._new = self._new, deque()
        while new and perf_counter() < self._ends:
            self._serve(new.popleft())
        self._new.extendleft(reversed(new))
        # At least one of these has its turn in each round, and may send, however many others come.
        self.num_bytes_left = max(1, self.num_bytes_left)
        for i in range(len(self._old)):
            if i and (perf_counter() >= self._ends or self.num_bytes_left <= 0):
                break
            self._serve(self._old.popleft())

    def _serve(self, worker: Worker) -> None:
        if worker.work(perf_counter() + TURN_TIME):
            self._old.append(worker)

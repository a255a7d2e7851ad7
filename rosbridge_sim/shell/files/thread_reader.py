"""Reading beside the event loop: scenarios and maps, in daemon threads.

A thread does one piece of work that shares nothing with the loop but what is never changed, and hands the outcome over.
What follows from it happens on the loop, between two frames. `stop` waits for no thread, and after it nothing is handed
over.

A process must not end while such a thread is inside a library that is not written in Python (pydantic, numpy): the
interpreter kills it there, and the process dies of SIGABRT or SIGSEGV. So `stop` interrupts the threads, and the end of
the process waits a moment for those that are left.
"""

from __future__ import annotations

import asyncio
import atexit
import ctypes
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, Final, Generic, TypeVar

from rosbridge_sim.errors import DocumentError

__all__ = ["ThreadReader"]

MAX_THREADS: Final = 2
"""Pieces of work at once. A second one lets others load while a network disk hangs; more would only compete for the
interpreter, which runs one thread at a time, and make the event loop wait longer for its turn."""

READ_PATIENCE: Final = 120.0
"""After so long a client is told that its document cannot be read [s]. The largest city map that is known takes some
ten seconds; a disk that answers later than this has gone."""

LAST_MOMENT: Final = 0.5
"""How long the end of the process waits for threads that were interrupted [s]. One that takes longer waits for a disk:
there it does no harm."""

_log = logging.getLogger("rosbridge_sim.storage")

T = TypeVar("T")


class _Job(Generic[T]):
    """A piece of work.

    Attributes:
        work, then: as for `Reader.read`.
        deadline: when it is given up.
        is_done: its outcome was handed over, or it was given up.
    """

    def __init__(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None]) -> None:
        self.work = work
        self.then = then
        self.deadline: asyncio.TimerHandle | None = None
        self.is_done = False


class ThreadReader:
    """A `Reader` with threads. Its methods are called on the event loop.

    Attributes:
        on_done: called after each outcome, since the world may have begun to move.
        num_bugs: pieces of work, or what followed from them, that failed by a fault of ours; each is in the log with
            its traceback.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, patience: float = READ_PATIENCE) -> None:
        """A reader without threads; each is started when there is something to read.

        Args:
            loop: where outcomes are handed over.
            patience: how long a piece of work may take, the wait for its turn included [s].
        """
        self.on_done: Callable[[], None] = _nothing
        self.num_bugs = 0
        self._loop = loop
        self._patience = patience
        self._jobs: deque[_Job[Any]] = deque()  # of any kind of outcome; those that wait for their turn
        self._threads: set[threading.Thread] = set()
        self._deadlines: set[asyncio.TimerHandle] = set()
        self._is_stopped = False

    def read(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None], now: float) -> None:  # noqa: ARG002 - the loop has a clock
        """See `Reader`. Work is begun in the order in which it comes; MAX_THREADS pieces are done at once."""
        if self._is_stopped:
            return
        job = _Job(work, then)
        late = DocumentError(f"it cannot be read: the disk has not answered for {self._patience:g} s")
        job.deadline = self._loop.call_later(self._patience, self._end, job, late)
        self._deadlines.add(job.deadline)
        self._jobs.append(job)
        self._start_next()

    def stop(self) -> None:
        """Hand nothing over any more, begin nothing, and interrupt what is being read. Twice is no error."""
        if self._is_stopped:
            return
        self._is_stopped = True
        self._jobs.clear()
        if self._threads:
            for thread in self._threads:
                _interrupt(thread)
            atexit.register(_await_end, tuple(self._threads))
        for deadline in self._deadlines:
            deadline.cancel()
        self._deadlines.clear()

    def _start_next(self) -> None:
        while self._jobs and len(self._threads) < MAX_THREADS:
            job = self._jobs.popleft()
            if not job.is_done:
                thread = threading.Thread(target=self._run, args=(job,), name="reading", daemon=True)
                self._threads.add(thread)
                thread.start()

    def _run(self, job: _Job[T]) -> None:
        """Work in a thread, until the work is done or `stop` interrupts it."""
        with suppress(SystemExit):
            self._do(job)

    def _do(self, job: _Job[T]) -> None:
        outcome: T | DocumentError
        is_bug = False
        try:
            outcome = job.work()
        except DocumentError as error:
            outcome = error
        except Exception:  # noqa: BLE001 - a bug of ours must not leave the caller without an answer
            _log.exception("internal error: a document could not be read")
            outcome, is_bug = DocumentError("it cannot be read: the server failed, and its log says why"), True
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._hand_over, threading.current_thread(), job, outcome, is_bug)

    def _hand_over(
        self,
        thread: threading.Thread,
        job: _Job[T],
        outcome: T | DocumentError,
        is_bug: bool,  # noqa: FBT001 - asyncio passes by position
    ) -> None:
        """Take the outcome of a thread, on the loop."""
        self._threads.discard(thread)
        self.num_bugs += is_bug
        self._start_next()
        self._end(job, outcome)

    def _end(self, job: _Job[T], outcome: T | DocumentError) -> None:
        """Hand over an outcome, on the loop: it is there, or it took too long."""
        if job.is_done or self._is_stopped:
            return
        job.is_done = True
        assert job.deadline is not None, "every job has one"
        job.deadline.cancel()
        self._deadlines.discard(job.deadline)
        try:
            job.then(outcome, self._loop.time())
        except Exception:  # noqa: BLE001 - our own bug: this load is lost, everything else goes on
            self.num_bugs += 1
            _log.exception("internal error: a document that was read could not be used")
        self.on_done()


def _interrupt(thread: threading.Thread) -> None:
    """Have a thread end at its next step in Python; one that has ended is no error."""
    if thread.ident is not None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(SystemExit))


def _await_end(threads: Iterable[threading.Thread]) -> None:
    """Wait for threads, LAST_MOMENT at most."""
    until = time.monotonic() + LAST_MOMENT
    for thread in threads:
        thread.join(max(0.0, until - time.monotonic()))


def _nothing() -> None:
    """Do nothing: no outcome moves the world yet."""

"""Reading of scenarios and maps in daemon threads, beside the event loop.

A thread does one job. It shares only unchangeable data with the loop, and delivers the result. The result is used on
the loop, between two frames. `stop` does not wait for threads, and nothing is delivered after it.
A process must not end while such a thread runs compiled code of a library (pydantic, numpy): the interpreter kills the
thread there, and the process dies of SIGABRT or SIGSEGV. So `stop` interrupts the threads, and the end of the process
waits a moment for those that still run.
"""

from __future__ import annotations

import asyncio
import atexit
import ctypes
import logging
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any, Final, Generic, TypeVar

from rosbridge_sim.errors import DocumentError

MAX_THREADS: Final = 2
"""Jobs at the same time. A second one lets others load while a network disk hangs. More would only compete for the
interpreter, which runs one thread at a time, and delay the event loop."""

READ_PATIENCE: Final = 120.0
"""Time after which a client is told that its document cannot be read [s]. The largest known city map takes about ten
seconds; a disk that needs longer than this does not work."""

LAST_MOMENT: Final = 0.5
"""Longest wait for interrupted threads at the end of the process [s]. A thread that takes longer waits for a disk,
where killing it is harmless."""

NEXT_INTERRUPT: Final = 0.05
"""Time after which a thread that still runs is interrupted again [s]: the interpreter drops what is raised within a
callback of a weak reference."""

_log = logging.getLogger("rosbridge_sim.storage")

T = TypeVar("T")


class _Job(Generic[T]):
    """A piece of work.

    Attributes:
        work, then: as for `Reader.read`.
        deadline: timer after which it is given up.
        is_done: its result was delivered, or it was given up.
    """

    def __init__(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None]) -> None:
        self.work = work
        self.then = then
        self.deadline: asyncio.TimerHandle | None = None
        self.is_done = False


class ThreadReader:
    """A `Reader` with threads. Its methods must be called on the event loop.

    Attributes:
        on_done: called after each result, because the world may have changed.
        num_bugs: number of jobs, or uses of their results, that failed by an internal error; each is in the log with
            its traceback.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, patience: float = READ_PATIENCE) -> None:
        """Create a reader without threads; each thread is started when it is needed.

        Args:
            patience: longest time for a job, waiting included [s].
        """
        self.on_done: Callable[[], None] = _nothing
        self.num_bugs = 0
        self._loop = loop
        self._patience = patience
        self._jobs: deque[_Job[Any]] = deque()  # waiting jobs, with results of any type
        self._threads: set[threading.Thread] = set()
        self._deadlines: set[asyncio.TimerHandle] = set()
        self._is_stopped = False

    def read(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None], now: float) -> None:  # noqa: ARG002 - the loop has a clock
        """See `Reader`. Jobs are started in order of arrival; MAX_THREADS run at the same time.

        Args:
            work: makes the result, in a thread.
            then: called with the result or the error, and the time.
            now: not used.
        """
        if self._is_stopped:
            return
        job = _Job(work, then)
        late = DocumentError(f"it cannot be read: the disk has not answered for {self._patience:g} s")
        job.deadline = self._loop.call_later(self._patience, self._end, job, late)
        self._deadlines.add(job.deadline)
        self._jobs.append(job)
        self._start_next()

    def stop(self) -> None:
        """Deliver no more results, start no more jobs, and interrupt running ones. A second call does nothing."""
        if self._is_stopped:
            return
        self._is_stopped = True
        self._jobs.clear()
        if self._threads:
            _print_no_interrupts()
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
        """Run a job in a thread, until it is done or `stop` interrupts it."""
        with suppress(SystemExit):
            self._do(job)

    def _do(self, job: _Job[T]) -> None:
        outcome: T | DocumentError
        is_bug = False
        try:
            outcome = job.work()
        except DocumentError as error:
            outcome = error
        except BaseException:  # noqa: BLE001 - the caller needs an answer, and the next job a thread, whatever fails
            if self._is_stopped:  # `stop` has interrupted it
                return
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
        """Take the result of a thread, on the loop."""
        self._threads.discard(thread)
        self.num_bugs += is_bug
        self._start_next()
        self._end(job, outcome)

    def _end(self, job: _Job[T], outcome: T | DocumentError) -> None:
        """Deliver a result or a time-out, on the loop."""
        if job.is_done or self._is_stopped:
            return
        job.is_done = True
        assert job.deadline is not None, "every job has one"
        job.deadline.cancel()
        self._deadlines.discard(job.deadline)
        try:
            job.then(outcome, self._loop.time())
        except Exception:  # noqa: BLE001 - an internal error: this load is lost, everything else goes on
            self.num_bugs += 1
            _log.exception("internal error: a document that was read could not be used")
        self.on_done()


def _interrupt(thread: threading.Thread) -> None:
    """Let a thread end at its next Python instruction; a thread that has ended is not an error.

    A thread that imports a library is left to its end: a half imported one is broken for the rest of the process.
    """
    frame = sys._current_frames().get(thread.ident or 0)  # noqa: SLF001 - Python's own way to see where a thread is
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    if thread.ident is not None and frame is None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(SystemExit))


def _await_end(threads: Iterable[threading.Thread]) -> None:
    """Wait for threads, at most LAST_MOMENT."""
    until = time.monotonic() + LAST_MOMENT
    for thread in threads:
        while thread.is_alive() and (left := until - time.monotonic()) > 0.0:
            thread.join(min(left, NEXT_INTERRUPT))
            _interrupt(thread)


def _print_no_interrupts() -> None:
    """Have the interpreter print no traceback where it drops an interrupt."""
    if getattr(sys.unraisablehook, "func", None) is not _print_other:
        sys.unraisablehook = partial(_print_other, sys.unraisablehook)


def _print_other(hook: Callable[[sys.UnraisableHookArgs], object], dropped: sys.UnraisableHookArgs) -> None:
    if dropped.exc_type is not SystemExit:
        hook(dropped)


def _nothing() -> None:
    """Do nothing: there is no callback yet."""

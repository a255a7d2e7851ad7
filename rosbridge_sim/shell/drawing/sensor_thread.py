"""A thread that has a process draw what cameras and lidars see, beside the event loop.

It is started with the first job, or by `open`. It waits for the process; jobs are done one after the other, and their
results are delivered on the loop, between two frames.
"""

from __future__ import annotations

import asyncio
import logging
import queue
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, Final, Protocol, TypeAlias, TypeVar

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.drawing.drawing_process import DrawingProcess
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, Sighting

LAST_MOMENT: Final = 1.0
"""Longest wait for the thread at the end [s]; the process that it waits for is gone by then."""

_Given = TypeVar("_Given")
_Made = TypeVar("_Made")
_Then: TypeAlias = Callable[[Sequence[Sighting] | Exception, float], None]

_log = logging.getLogger("rosbridge_sim.app")


class Drawer(Protocol):
    """Draws; see `DrawingProcess`."""

    def why_not(self, specs: Sequence[DrawnSpec]) -> str:
        """Return why it cannot draw for some sensors; empty if it can."""

    def open(self, specs: Sequence[DrawnSpec]) -> None:
        """Make what draws for some sensors now, or raise any error."""

    def draw(self, job: DrawingJob) -> Sequence[Sighting]:
        """Return what the sensors of a job see, or raise any error."""

    def kill(self) -> None:
        """End what is being drawn; it is called from another thread."""


class SensorThread:
    """A `SensorWorker` with one thread. Its methods must be called on the event loop.

    Attributes:
        on_done: called after each result, because the world may go on.
        num_bugs: jobs, or uses of their results, that failed by an internal error.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, drawer: Drawer | None = None) -> None:
        """Start no thread yet.

        Args:
            drawer: draws, in the thread; a process of its own if it is left out.
        """
        self.on_done: Callable[[], None] = _nothing
        self.num_bugs = 0
        self._loop = loop
        self._drawer = DrawingProcess() if drawer is None else drawer
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._num_waiting = 0
        self._thread: threading.Thread | None = None
        self._is_stopped = False

    @property
    def is_busy(self) -> bool:
        """True if a job waits or is being done."""
        return self._num_waiting > 0

    def why_not(self, specs: Sequence[DrawnSpec]) -> str:
        """Return why some sensors cannot be drawn; see `SensorWorker`."""
        return self._drawer.why_not(specs)

    def open(self, specs: Sequence[DrawnSpec]) -> None:
        """Make what draws for some sensors now, so that a server that cannot draw does not start.

        Raises:
            DocumentError: nothing can be drawn here; the text says why, and what to do.
        """
        why = self.why_not(specs)
        if why:
            raise DocumentError(f"sensors: {why}")
        made: Future[Exception | None] = Future()
        self._add(lambda: made.set_result(_try(self._drawer.open, specs)))
        error = made.result()
        if error is not None:
            self.stop()
            raise DocumentError(f"sensors: {error}") from error

    def submit(self, job: DrawingJob, then: _Then) -> None:
        """Do a job; see `SensorWorker`."""
        if self._is_stopped:
            return
        self._num_waiting += 1
        self._add(lambda: self._hand_over(then, _try(self._drawer.draw, job)))

    def stop(self) -> None:
        """Deliver no more results, and end the thread. A second call does nothing."""
        if self._is_stopped:
            return
        self._is_stopped = True
        self._drawer.kill()
        if self._thread is not None:
            self._work.put(None)
            self._thread.join(LAST_MOMENT)

    def _add(self, work: Callable[[], None]) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="drawing", daemon=True)
            self._thread.start()
        self._work.put(work)

    def _run(self) -> None:
        """Do work until the end."""
        while (work := self._work.get()) is not None and not self._is_stopped:
            work()

    def _hand_over(self, then: _Then, results: Sequence[Sighting] | Exception) -> None:
        with suppress(RuntimeError):  # the loop is closed
            # One turn later, because sockets that became ready during the delivery before are read first.
            self._loop.call_soon_threadsafe(self._loop.call_soon, self._deliver, then, results)

    def _deliver(self, then: _Then, results: Any) -> None:  # noqa: ANN401 - asyncio passes anything
        """Pass results on, on the loop."""
        self._num_waiting -= 1
        if self._is_stopped:
            return
        try:
            then(results, self._loop.time())
        except Exception:  # noqa: BLE001 - an internal error: these messages are lost, everything else goes on
            self.num_bugs += 1
            _log.exception("internal error: what was drawn could not be published")
        self.on_done()


def _try(work: Callable[[_Given], _Made], given: _Given) -> _Made | Exception:
    try:
        return work(given)
    except Exception as error:  # noqa: BLE001 - the tick must be answered even after an internal error
        return error


def _nothing() -> None:
    """Do nothing: there is no callback yet."""

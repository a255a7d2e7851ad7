"""A thread that draws what cameras and lidars see, beside the event loop.

It is started with the first job, or by `open`. All that draws is made in it and used in it alone, because a context of
OpenGL belongs to a thread. Jobs are done one after the other; their results are delivered on the loop, between two
frames. `stop` waits a moment for the job in hand: a process must not end while a thread runs a library's code.
"""

from __future__ import annotations

import asyncio
import logging
import queue
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from importlib.util import find_spec
from typing import Any, Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, Makers, Result, draw
from rosbridge_sim.simulator.sensors.sensor_specs import CameraSpec

__all__ = ["SensorThread"]

LAST_MOMENT: Final = 1.0
"""Longest wait for the job in hand at the end [s]: a city map takes about this long to be drawn first."""

CAMERA_LIBRARIES: Final = ("moderngl", "simplejpeg")
LIDAR_LIBRARIES: Final = ("embreex",)
"""Libraries of the extra `sensors`."""

_Then = Callable[[Sequence[Result] | Exception, float], None]

_log = logging.getLogger("rosbridge_sim.app")


def _make_makers() -> Makers:
    """Return what draws; the libraries are imported, because a server without cameras and lidars needs none of them."""
    from rosbridge_sim.shell.sensor_makers import make_makers  # noqa: PLC0415 - as above

    return make_makers()


class SensorThread:
    """A `SensorWorker` with one thread. Its methods must be called on the event loop.

    Attributes:
        on_done: called after each result, because the world may go on.
        num_bugs: jobs, or uses of their results, that failed by an internal error.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, make: Callable[[], Makers] = _make_makers) -> None:
        """Start no thread yet.

        Args:
            loop: delivers the results.
            make: makes what draws, in the thread.
        """
        self.on_done: Callable[[], None] = _nothing
        self.num_bugs = 0
        self._loop = loop
        self._make = make
        self._makers: Makers | None = None
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._num_waiting = 0
        self._thread: threading.Thread | None = None
        self._is_stopped = False

    @property
    def is_busy(self) -> bool:
        """True if a job waits or is being done."""
        return self._num_waiting > 0

    def why_not(self, specs: Sequence[DrawnSpec]) -> str:
        """Return which library is missing for some sensors; see `SensorWorker`."""
        has_camera = any(isinstance(spec, CameraSpec) for spec in specs)
        has_lidar = any(not isinstance(spec, CameraSpec) for spec in specs)
        wanted = [*(CAMERA_LIBRARIES if has_camera else ()), *(LIDAR_LIBRARIES if has_lidar else ())]
        missing = [name for name in wanted if self._make is _make_makers and find_spec(name) is None]
        if not missing:
            return ""
        what = " and ".join(word for word, is_there in (("cameras", has_camera), ("lidars", has_lidar)) if is_there)
        return f"{what} need the library {missing[0]}: pip install 'rosbridge-sim[sensors]'"

    def open(self, specs: Sequence[DrawnSpec]) -> None:
        """Make what draws for some sensors now, so that a server that cannot draw does not start.

        Raises:
            DocumentError: nothing can be drawn here; the text says why, and what to do.
        """
        why = self.why_not(specs)
        if why:
            raise DocumentError(f"sensors: {why}")
        made: Future[None] = Future()

        def make() -> None:
            try:
                makers = self._have_makers()
                for spec in specs:
                    makers.pictures() if isinstance(spec, CameraSpec) else makers.rays()
                made.set_result(None)
            except Exception as error:  # noqa: BLE001 - a library or a driver, whatever it raises
                made.set_exception(error)

        self._add(make)
        try:
            made.result()
        except Exception as error:
            self.stop()
            raise DocumentError(f"sensors: {error}") from error

    def submit(self, job: DrawingJob, then: _Then) -> None:
        """Do a job; see `SensorWorker`."""
        if self._is_stopped:
            return
        self._num_waiting += 1
        self._add(lambda: self._hand_over(then, self._do(job)))

    def stop(self) -> None:
        """Deliver no more results, and end the thread. A second call does nothing."""
        if self._is_stopped:
            return
        self._is_stopped = True
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
        if self._makers is not None:
            self._makers.close()

    def _have_makers(self) -> Makers:
        if self._makers is None:
            self._makers = self._make()
        return self._makers

    def _do(self, job: DrawingJob) -> Sequence[Result] | Exception:
        try:
            return draw(job, self._have_makers())
        except Exception as error:  # noqa: BLE001 - the tick must be answered even after an internal error
            _log.debug("a picture could not be made", exc_info=error)
            return error

    def _hand_over(self, then: _Then, results: Sequence[Result] | Exception) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._deliver, then, results)

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


def _nothing() -> None:
    """Do nothing: there is no callback yet."""

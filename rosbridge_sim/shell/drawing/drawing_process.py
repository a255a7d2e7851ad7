"""A process that draws what cameras and lidars see.

The libraries that draw keep the interpreter lock: Embree for a quarter of a second while it prepares a map, OpenGL for
a tenth while it takes it, and numpy for many small pieces. In a thread all of that stopped the event loop. A process
has a lock of its own, and if a driver ends it, the server goes on and starts another one.

Parent and child exchange pickles by the child's standard input and output. A map is sent once. The child ends when its
input does, so it never outlives its parent.
"""

from __future__ import annotations

import io
import logging
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from typing import IO, Any, Final

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, Makers, Sighting, draw
from rosbridge_sim.world.roads.signal_plan import SignalPlan

LIBRARIES: Final = {"pictures": ("cameras", "moderngl", "simplejpeg"), "rays": ("lidars", "embreex")}
"""Field of `Makers` -> the sensors that need it, and libraries of the extra `sensors`."""

MAX_ENDS: Final = 3
"""A process that has ended so often in a row, with no job done, is started again only after `PAUSE`."""

PAUSE: Final = 10.0
"""Time between two starts of a process that keeps ending [s]: a start takes half a second of a core."""

_START: Final = (
    "import sys; sys.path[:] = sys.argv[1:]; from rosbridge_sim.shell.drawing.drawing_process import main; main()"
)
"""The child finds the same modules as its parent. `multiprocessing` would import the user's program once more."""

_log = logging.getLogger("rosbridge_sim.app")


class DrawingError(RuntimeError):
    """Something could not be drawn; the text says why."""


class DrawingProcess:
    """The parent's side. Its methods may be called by one thread at a time; `kill` by any other."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._shared: tuple[RoadMap, SignalPlan] | None = None
        self._num_ends = 0
        self._ended_at = 0.0
        self._is_killed = False
        self._starting, self._asking = threading.Lock(), threading.Lock()

    @property
    def pid(self) -> int | None:
        """Id of the process; None while there is none."""
        return None if self._child is None else self._child.pid

    def why_not(self, specs: Sequence[DrawnSpec]) -> str:
        """Return which library is missing for some sensors; see `SensorWorker`."""
        used = [needed for maker, needed in LIBRARIES.items() if any(spec.maker == maker for spec in specs)]
        missing = [name for _, *names in used for name in names if find_spec(name) is None]
        if not missing:
            return ""
        what = " and ".join(noun for noun, *_ in used)
        return f"{what} need the library {missing[0]}: pip install 'rosbridge-sim[sensors]'"

    def open(self, specs: Sequence[DrawnSpec]) -> None:
        """Make what draws for some sensors now.

        Raises:
            DrawingError: nothing can be drawn here.
        """
        self._ask(tuple(specs))

    def draw(self, job: DrawingJob) -> Sequence[Sighting]:
        """Return what the sensors of a job see.

        Raises:
            DrawingError: it cannot be drawn, or the process has ended meanwhile.
        """
        results: Sequence[Sighting] = self._ask(job)
        self._num_ends = 0
        return results

    def kill(self) -> None:
        """End the process at once, and start no other one; a call that waits for it fails."""
        with self._starting:
            self._is_killed = True
            if self._child is not None:
                self._child.kill()
        with self._asking:  # a call that waits for it fails now
            if self._child is not None:
                self._bury()

    def _ask(self, request: object) -> Any:  # noqa: ANN401 - the results of a job, or nothing
        with self._asking:
            try:
                child = self._have_child()
                assert child.stdin is not None, "it is a pipe"
                assert child.stdout is not None
                child.stdin.write(self._pack(request))
                child.stdin.flush()
                answer = pickle.load(child.stdout)  # noqa: S301 - what our own process sends
            except (OSError, EOFError, pickle.UnpicklingError) as error:
                raise DrawingError(f"the process that draws has ended{self._bury()}") from error
        if isinstance(answer, _Failure):
            _log.debug("a picture could not be made: %s", answer.details)
            raise DrawingError(answer.text)
        return answer

    def _have_child(self) -> subprocess.Popen[bytes]:
        """Return the process, which is started if there is none.

        Raises:
            DrawingError: it keeps ending.
            OSError: it cannot be started.
        """
        if self._child is not None:
            return self._child
        if self._num_ends >= MAX_ENDS and time.monotonic() < self._ended_at + PAUSE:
            raise DrawingError("the process that draws keeps ending; see its messages")
        self._shared = None
        with self._starting:
            if self._is_killed:
                raise DrawingError("the server stops")
            self._child = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing of a client
                [sys.executable, "-c", _START, *sys.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
            return self._child

    def _bury(self) -> str:
        """Forget the process; return how it ended, for a text."""
        child, self._child = self._child, None
        self._num_ends += 1
        self._ended_at = time.monotonic()
        if child is None:
            return ""
        child.kill()
        code = child.wait()
        for pipe in (child.stdin, child.stdout):
            assert pipe is not None
            with suppress(OSError):  # what was not written yet cannot be
                pipe.close()
        return f" (signal {-code})" if code < 0 else f" (exit code {code})"

    def _pack(self, request: object) -> bytes:
        """Return a request as bytes, behind the map where the child does not have it."""
        buffer = io.BytesIO()
        if isinstance(request, DrawingJob):
            shared = request.road_map, request.frame.plan
            if self._shared is None or any(a is not b for a, b in zip(shared, self._shared, strict=True)):
                _Pickler(buffer, ()).dump(_Shared(shared))
                self._shared = shared
            _Pickler(buffer, shared).dump(request)
        else:
            _Pickler(buffer, ()).dump(request)
        return buffer.getvalue()


class _Failure:
    """An answer: the request failed.

    Attributes:
        text: the error's.
        details: the traceback.
    """

    def __init__(self, text: str, details: str) -> None:
        self.text, self.details = text, details


class _Shared:
    """A request: keep what all jobs of a map share; it has no answer.

    Attributes:
        objects: the map and its lights.
    """

    def __init__(self, objects: tuple[RoadMap, SignalPlan]) -> None:
        self.objects = objects


class _Pickler(pickle.Pickler):
    """Writes objects that the other side has as their numbers.

    As it calls Python for each object, other threads have their turn while it writes a large map.
    """

    def __init__(self, file: io.BytesIO, shared: Sequence[object]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._numbers = {id(each): number for number, each in enumerate(shared)}

    def persistent_id(self, obj: object) -> int | None:
        return self._numbers.get(id(obj))


class _Unpickler(pickle.Unpickler):
    """Reads what `_Pickler` wrote."""

    def __init__(self, file: IO[bytes], shared: Sequence[object]) -> None:
        super().__init__(file)
        self._objects = shared

    def persistent_load(self, pid: int) -> object:
        return self._objects[pid]


def main() -> None:
    """Do what the parent asks until the input ends: the program of the child."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library that prints must not print into the answers
    _serve(sys.stdin.buffer, answers)
    os._exit(0)  # without the libraries' own endings, which have nothing to save


def _serve(requests: IO[bytes], answers: IO[bytes]) -> None:
    # Imported here, because the parent needs no library that draws.
    from rosbridge_sim.shell.drawing.sensor_makers import make_makers  # noqa: PLC0415

    makers: Makers = make_makers()
    shared: Sequence[object] = ()
    while True:
        try:
            request = _Unpickler(requests, shared).load()
        except (EOFError, pickle.UnpicklingError):
            return
        if isinstance(request, _Shared):
            shared = request.objects
            continue
        try:
            answer: Any = _answer(request, makers)
        except Exception as error:  # noqa: BLE001 - a library or a driver, whatever it raises
            answer = _Failure(str(error) or type(error).__name__, traceback.format_exc())
        try:
            pickle.dump(answer, answers, pickle.HIGHEST_PROTOCOL)
            answers.flush()
        except BrokenPipeError:
            return


def _answer(request: Any, makers: Makers) -> Sequence[Sighting] | None:  # noqa: ANN401 - see `_ask`
    if isinstance(request, DrawingJob):
        return draw(request, makers)
    for spec in request:
        getattr(makers, spec.maker)()
    return None

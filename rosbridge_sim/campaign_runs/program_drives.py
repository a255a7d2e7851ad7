"""Drives by programs: a simulator in the worker's process, and the user's program beside it, which gets its URL.

The program has a process group of its own, which ends with the run: SIGTERM, and a second later SIGKILL. Its output is
read all the time, so a program that prints a gigabyte is not held up, and costs a hundred kilobytes of memory.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final, NoReturn

from rosbridge_sim.campaign_runs.job import LoadedJob
from rosbridge_sim.campaign_runs.outcome import KeptOutput, Outcome
from rosbridge_sim.campaign_runs.program_groups import children, end_children, note_group
from rosbridge_sim.campaign_runs.simulator_options import make_work_folder, simulator_options
from rosbridge_sim.campaign_runs.watched_drive import WatchedDrive
from rosbridge_sim.campaigns.campaign_model import DriverItem
from rosbridge_sim.campaigns.run_results import Run
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.simulator.simulator_node import SimulatorNode

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

NUM_CLIENTS: Final = "/client_count"
"""Topic with the number of clients."""

PATIENCE: Final = 1.0
"""Time from SIGTERM to SIGKILL [s]."""

HURRY: Final = 0.2
"""The same if the worker is told to end [s]."""


def drive_by_program(loaded: LoadedJob, driver: DriverItem, run: Run, *, record: bool) -> Outcome:
    """Drive a run by a program.

    Args:
        record: record the topics of the simulator.

    Returns:
        The outcome; its files are in its folder `work`, which the caller removes.
    """
    drive = _Drive(loaded, run)
    outcome = drive.outcome
    try:
        outcome.work = work = make_work_folder(loaded, run)
        options = simulator_options(loaded, run, work, is_real_time=driver.real_time)
        if record:
            options["record"] = str(work / "drive.mcap")
        simulator = Simulator(**options)
        simulator.library, simulator.types = loaded.library_for(simulator.settings), loaded.types
        with _logged(drive), simulator:
            simulator.run_inside(lambda: drive.watch(simulator, is_real_time=driver.real_time))
            with _program(loaded, driver, run, simulator.url, work) as program:
                drive.follow(program, driver.timeout, simulator)
            if outcome.trace.rows and not outcome.state_hash:
                simulator.run_inside(lambda: drive.close(simulator))
    except DocumentError as error:
        outcome.error = outcome.error or str(error)
    except OSError as error:
        outcome.error = outcome.error or f"{error.filename or 'the disk'}: {error.strerror}"
    return outcome


@contextlib.contextmanager
def _logged(drive: _Drive) -> Iterator[None]:
    """Keep what the simulator logs, and put it behind the output of the program."""
    output = KeptOutput()
    handler = logging.StreamHandler(output)
    handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
    log = logging.getLogger("rosbridge_sim")
    is_passed_on, level = log.propagate, log.level
    log.addHandler(handler)
    log.propagate = False
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.propagate = is_passed_on
        log.setLevel(level)
        drive.outcome.log += f"\nthe simulator's log:\n{output.text}"


class _Drive:
    """One drive: what the world's thread notes, and when it has ended."""

    def __init__(self, loaded: LoadedJob, run: Run) -> None:
        self._watched = WatchedDrive(loaded.campaign, run)
        self.outcome = self._watched.outcome
        self._is_over = threading.Event()
        self._has_client = threading.Event()

    def watch(self, simulator: Simulator, *, is_real_time: bool) -> None:
        """Note each frame from now on. Runs in the simulator's thread."""
        assert simulator.node is not None
        assert simulator.bus is not None
        world = simulator.node.world
        if is_real_time:
            self._stand(simulator.node, simulator.bus)
        else:
            self._stand_without_master(simulator.node)
        self._watched.listen(simulator.bus)

        def take(_now: float) -> None:
            if not self._is_over.is_set() and self._watched.take(world):
                self.close(simulator)

        simulator.node.context.hooks.after_frame.append(take)

    def _stand(self, node: SimulatorNode, bus: Bus) -> None:
        """Have a world in real time stand at frame 0 until the program has connected."""
        now = asyncio.get_running_loop().time()
        node.context.sync_driver.pause(now)
        if node.world.frame:
            node.reset(None, now)

        def take(_topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
            if message.value.data:
                self._has_client.set()

        bus.subscribe(self._watched, NUM_CLIENTS, take)

    @staticmethod
    def _stand_without_master(node: SimulatorNode) -> None:
        """Have only ticks move the world: a program that ends, or goes on without them, adds no frame of real time."""
        context = node.context

        def stand(now: float) -> None:
            if context.sync.is_free:
                context.sync_driver.pause(now)

        context.hooks.on_mode_change.append(stand)

    def close(self, simulator: Simulator) -> None:
        """Note the state at the end, and end the recording. Runs in the simulator's thread."""
        assert simulator.node is not None
        self._watched.finish(simulator.node.world)
        simulator.close_recording()
        self._is_over.set()

    def follow(self, program: _Program, timeout: float, simulator: Simulator) -> None:
        """Wait until the drive is over, the program has ended, or the time has passed."""
        assert simulator.node is not None
        outcome, end = self.outcome, time.monotonic() + timeout
        world = simulator.node.context.sync_driver
        while not self._is_over.wait(LOOK_EVERY):
            if self._has_client.is_set():  # the wait for the program is over
                self._has_client.clear()
                simulator.run_inside(lambda: world.resume(asyncio.get_running_loop().time()))
            code = program.process.poll()
            if code is not None:
                if code:
                    outcome.error = f"the program ended with {_told(code)} after {len(outcome.trace.rows)} frames"
                elif not outcome.trace.rows:
                    outcome.error = "the program ended before the world has moved; does it start synchronous mode?"
                break
            if time.monotonic() >= end:
                outcome.error = (
                    f"time-out: {timeout:g} s on the wall clock have passed after {len(outcome.trace.rows)} frames"
                )
                break
        self._is_over.set()  # what comes later does not count
        code = program.stop()
        how = "it was stopped at the end of the drive" if code is None else f"it ended with {_told(code)}"
        outcome.log = f"{program.output.text}\n[{' '.join(program.words)}: {how}]\n"


LOOK_EVERY: Final = 0.02
"""Time between two looks whether the program still runs [s]."""


def _told(code: int) -> str:
    return f"code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"


class _Program:
    """A program in a process group of its own.

    Attributes:
        words: its command line.
        output: what it printed.

    Args:
        others: children of this process that were there before.
    """

    def __init__(self, process: subprocess.Popen[bytes], words: list[str], others: frozenset[int]) -> None:
        self.process, self.words, self.output = process, words, KeptOutput()
        self._others = others
        assert process.stdout is not None
        self._reader = threading.Thread(target=self._read, args=[process.stdout], daemon=True)
        self._reader.start()

    def _read(self, pipe: IO[bytes]) -> None:
        with contextlib.suppress(OSError, ValueError):
            while piece := os.read(pipe.fileno(), 65_536):
                self.output.take(piece)

    def stop(self, patience: float = PATIENCE) -> int | None:
        """End the group; return the code of a program that had ended before, else None.

        Args:
            patience: time from SIGTERM to SIGKILL [s].
        """
        code = self.process.poll()
        self._signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(patience)
        self._signal(getattr(signal, "SIGKILL", signal.SIGTERM))
        self.process.wait()
        end_children(self._others)  # one that has left the group may still hold the pipe
        self._reader.join(patience)
        return code

    def _signal(self, number: signal.Signals) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if hasattr(os, "killpg"):
                os.killpg(self.process.pid, number)
            else:
                self.process.terminate()


@contextlib.contextmanager
def _program(loaded: LoadedJob, driver: DriverItem, run: Run, url: str, work: Path) -> Iterator[_Program]:
    """Start the program of a driver.

    Raises:
        DocumentError: it cannot be started.
    """
    assert driver.command is not None
    told = {
        "url": url,
        "seconds": f"{loaded.campaign.document.seconds:g}",
        "seed": str(run.seed),
        "run": str(run.number),
        "python": sys.executable,
        **{name: str(value) for name, value in run.parameters.items()},
    }
    words = [_filled(word, told) for word in driver.command]
    variables = {
        "ROSBRIDGE_SIM_URL": url,
        "ROSBRIDGE_SIM_SECONDS": told["seconds"],
        "ROSBRIDGE_SIM_SEED": told["seed"],
        "TMPDIR": str(work),
    }
    own = {name: _filled(text, told) for name, text in driver.environment.items()}
    others = children()
    try:
        process = subprocess.Popen(  # noqa: S603 - the user's own program
            words,
            cwd=loaded.job.base,
            env={**os.environ, **variables, **own},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    except (OSError, ValueError) as error:  # a text with a null character is a ValueError
        why = error.strerror if isinstance(error, OSError) else error
        raise DocumentError(f"the program {words[0]!r} cannot be started: {why}") from None
    with contextlib.suppress(ProcessLookupError, PermissionError, ValueError, AttributeError):
        most = driver.memory_mb * 2**20
        resource.prlimit(process.pid, resource.RLIMIT_DATA, (most, most))
    note_group(work, process.pid)
    program = _Program(process, words, others)
    with _stopped_with_worker(program):
        try:
            yield program
        finally:
            program.stop()
            if process.stdout is not None:
                process.stdout.close()


@contextlib.contextmanager
def _stopped_with_worker(program: _Program) -> Iterator[None]:
    """End the program first if the worker is told to end meanwhile."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread gets signals
        return

    def end(*_: object) -> NoReturn:
        program.stop(HURRY)
        os._exit(1)  # see `settle_worker`

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _filled(word: str, told: dict[str, str]) -> str:
    for name, text in told.items():
        word = word.replace(f"{{{name}}}", text)
    return word

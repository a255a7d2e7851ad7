"""Recordings in the data folder, found by name and read in a thread.

Reading a bag of ten minutes takes seconds, so a separate thread does it while the event loop serves clients. The thread
shares nothing: it fills its own `RecordingBuilder` and returns it when it is done.
A name is searched in the data folder and in its folder `Replay`, with or without suffix. It may be a path, but it must
stay inside the data folder.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.bags.bag_reader import read_recording
from rosbridge_sim.shell.files.definitions import Texts
from rosbridge_sim.shell.files.sensor_data_store import OWN_NAME
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Then

REPLAY_FOLDER: Final = "Replay"
"""Folder for recordings within the data folder."""

MAX_RECORDING_NAME: Final = 400
"""Longest name of a recording, with its folders [characters]."""

MAX_RECORDINGS_LISTED: Final = 20
"""Names that an error lists."""

_SUFFIXES: Final = ("", ".bag", ".mcap")

_log = logging.getLogger("rosbridge_sim.replay")


class DiskRecordings:
    """Recordings by name, read in threads.

    Attributes:
        on_done: called after each result was delivered, because the world may have changed.
        num_bugs: number of recordings that failed by an internal error; each is in the log with its traceback.
    """

    def __init__(self, folder: str | Path, texts: Texts, loop: asyncio.AbstractEventLoop) -> None:
        """Set the folder; `read` reads.

        Args:
            folder: the data folder; it need not exist.
            texts: current definitions, for bags that have none.
            loop: delivers the results.
        """
        self.on_done: Callable[[], None] = _nothing
        self.num_bugs = 0
        self._folder = Path(folder)
        self._texts = texts
        self._loop = loop
        self._is_stopped = threading.Event()

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        """See `Recordings`.

        Args:
            reading: a new builder.
            then: called with the result.
        """
        threading.Thread(target=self._read, args=(name, reading, then), name="replay", daemon=True).start()

    def stop(self) -> None:
        """Deliver no more results, and end the threads soon."""
        self._is_stopped.set()

    def _read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        """Find and read a recording in a thread, and deliver the result."""
        outcome: Recording | DocumentError
        is_bug = False
        try:
            path = find_recording(self._folder, name)
            outcome = read_recording(path, reading, self._texts, self._breathe)
        except DocumentError as error:
            outcome = error
        except BaseException:  # noqa: BLE001 - the caller needs an answer, whatever fails
            _log.exception("internal error: recording %s could not be read", name[:80])
            outcome, is_bug = DocumentError(f"{reading.name}: cannot be read; the server's log says why"), True
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._deliver, then, outcome, is_bug)

    def _breathe(self) -> None:
        if self._is_stopped.is_set():
            raise DocumentError("the server is stopping")
        time.sleep(0)

    def _deliver(
        self,
        then: Then,
        outcome: Recording | DocumentError,
        is_bug: bool,  # noqa: FBT001 - asyncio passes by position
    ) -> None:
        self.num_bugs += is_bug
        if self._is_stopped.is_set():
            return
        try:
            then(outcome, self._loop.time())
        except Exception:  # noqa: BLE001 - an internal error: this replay is lost, everything else goes on
            self.num_bugs += 1
            _log.exception("internal error: a recording could not be replayed")
        self.on_done()


def _nothing() -> None:
    """Do nothing: there is no callback for results yet."""


# Names


def find_recording(folder: Path, name: str) -> Path:
    """Return the path of the bag that a client names.

    Args:
        folder: the data folder.

    Raises:
        DocumentError: there is none, or the name leads out of the folder.
    """
    wanted = name.replace("\\", "/").strip()
    if not wanted or len(wanted) > MAX_RECORDING_NAME or not wanted.isprintable():
        raise DocumentError(f"{name[:80]!r} is not a recording's name: expected NAME.bag, NAME.mcap or a folder's name")
    root = folder.resolve()
    for path in _places(folder, wanted):
        try:
            is_inside = path.resolve().is_relative_to(root)
        except (OSError, RuntimeError):  # a loop of links, or a name too long for the disk
            continue
        if not is_inside:
            raise DocumentError(f"{name[:80]!r} leads out of --data-dir")
        if _is_bag(path):
            return path
    known = ", ".join(name for name, _ in list_recordings(folder)[:MAX_RECORDINGS_LISTED]) or "none"
    raise DocumentError(f"no recording {name[:80]!r} in --data-dir ({folder}); known are {known}")


def _places(folder: Path, wanted: str) -> Iterator[Path]:
    """Yield the paths that a name may mean, best first; it may begin with MORAI's name of the data folder."""
    for name in dict.fromkeys((wanted, wanted.removeprefix(OWN_NAME + "/"))):
        for base in (folder / REPLAY_FOLDER, folder):
            for suffix in _SUFFIXES:
                yield base / (name + suffix)


def _is_bag(path: Path) -> bool:
    """Return True if a path may be a bag: any file, or a folder of rosbag2."""
    with suppress(OSError):
        return path.is_file() or any(next(path.glob(pattern), None) for pattern in ("*.yaml", "*.mcap", "*.db3"))
    return False


def list_recordings(folder: Path) -> list[tuple[str, Path]]:
    """Return the recordings of a data folder: the name for `find_recording`, and the file or folder, sorted by path.

    Args:
        folder: the data folder; it need not exist.
    """
    found: dict[str, Path] = {}
    for base in (folder / REPLAY_FOLDER, folder):
        with suppress(OSError):
            for path in sorted([*base.glob("*.bag"), *base.glob("*.mcap"), *base.glob("*/metadata.yaml")]):
                place = path.parent if path.name == "metadata.yaml" else path
                found.setdefault(place.name, place)
    return list(found.items())

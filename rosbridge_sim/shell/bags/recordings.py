"""Recordings in the data folder, found by name and read in a thread.

A bag of ten minutes takes seconds to read, so a thread of its own does it, and the event loop goes on serving. Nothing
is shared with that thread: it fills a `RecordingBuilder` that nothing else has, and hands it over when it is done.

A name is looked for in the data folder and in `Replay` within it, with its suffix or without. It may be a path, but one
that stays in there.
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
from rosbridge_sim.morai.replays.recording import Recording
from rosbridge_sim.morai.replays.recording_builder import RecordingBuilder, Then
from rosbridge_sim.shell.bags.bag_reader import read_recording
from rosbridge_sim.shell.files.definitions import Texts
from rosbridge_sim.shell.files.sensor_data_store import OWN_NAME

__all__ = ["REPLAY_FOLDER", "DiskRecordings", "find_recording"]

REPLAY_FOLDER: Final = "Replay"
"""The folder for recordings within the data folder."""

MAX_RECORDING_NAME: Final = 400
"""Characters of a recording's name, its folders included."""

MAX_RECORDINGS_LISTED: Final = 20
"""Names that an error lists."""

_SUFFIXES: Final = ("", ".bag", ".mcap")

_log = logging.getLogger("rosbridge_sim.replay")


class DiskRecordings:
    """Recordings by name, read in threads.

    Attributes:
        on_done: called after each outcome was handed over, because the world may have begun to move.
        num_bugs: recordings that could not be read or used by a fault of ours; each is in the log with its traceback.
    """

    def __init__(self, folder: str | Path, texts: Texts, loop: asyncio.AbstractEventLoop) -> None:
        """Remember the folder; `read` reads.

        Args:
            folder: the data folder; it need not be there.
            texts: the definitions in use, for bags that have none.
            loop: hands over the outcomes.
        """
        self.on_done: Callable[[], None] = _nothing
        self.num_bugs = 0
        self._folder = Path(folder)
        self._texts = texts
        self._loop = loop
        self._is_stopped = threading.Event()

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        """See `Recordings`."""
        try:
            path = find_recording(self._folder, name)
        except DocumentError as error:
            then(error, self._loop.time())
            return
        threading.Thread(target=self._read, args=(path, reading, then), name="replay", daemon=True).start()

    def stop(self) -> None:
        """Hand over nothing more, and end the threads soon."""
        self._is_stopped.set()

    def _read(self, path: Path, reading: RecordingBuilder, then: Then) -> None:
        """Read in a thread, and hand over the outcome."""
        outcome: Recording | DocumentError
        is_bug = False
        try:
            outcome = read_recording(path, reading, self._texts, self._breathe)
        except DocumentError as error:
            outcome = error
        except Exception:  # noqa: BLE001 - a bug of ours must not leave the caller without an answer
            _log.exception("internal error: recording %s could not be read", path)
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
        except Exception:  # noqa: BLE001 - our own bug: this replay is lost, everything else goes on
            self.num_bugs += 1
            _log.exception("internal error: a recording could not be replayed")
        self.on_done()


def _nothing() -> None:
    """Do nothing: no one waits for outcomes yet."""


# Names


def find_recording(folder: Path, name: str) -> Path:
    """The bag that a client names.

    Raises:
        DocumentError: there is none, or the name leads out of the folder.
    """
    wanted = name.replace("\\", "/").strip()
    if not wanted or len(wanted) > MAX_RECORDING_NAME or not wanted.isprintable():
        raise DocumentError(f"{name[:80]!r} is no name of a recording: expected NAME.bag, NAME.mcap or a folder's name")
    root = folder.resolve()
    for path in _places(folder, wanted):
        try:
            is_inside = path.resolve().is_relative_to(root)
        except (OSError, RuntimeError):  # links in a circle, a name too long for the disk
            continue
        if not is_inside:
            raise DocumentError(f"{name[:80]!r} leads out of --data-dir")
        if _is_bag(path):
            return path
    known = ", ".join(_known(folder)) or "none"
    raise DocumentError(f"no recording {name[:80]!r} in --data-dir ({folder}); known are {known}")


def _places(folder: Path, wanted: str) -> Iterator[Path]:
    """Yield the paths that a name may mean, best first; it may begin with MORAI's name of the data folder."""
    for name in dict.fromkeys((wanted, wanted.removeprefix(OWN_NAME + "/"))):
        for base in (folder / REPLAY_FOLDER, folder):
            for suffix in _SUFFIXES:
                yield base / (name + suffix)


def _is_bag(path: Path) -> bool:
    """Tell whether a path may be a bag: any file, or a folder as rosbag2 makes it."""
    with suppress(OSError):
        return path.is_file() or any(next(path.glob(pattern), None) for pattern in ("*.yaml", "*.mcap", "*.db3"))
    return False


def _known(folder: Path) -> list[str]:
    """Some of the names that are taken, for a person to read."""
    names = []
    for base in (folder / REPLAY_FOLDER, folder):
        with suppress(OSError):
            found = sorted([*base.glob("*.bag"), *base.glob("*.mcap"), *base.glob("*/metadata.yaml")])
            names += [path.parent.name if path.name == "metadata.yaml" else path.name for path in found]
    return list(dict.fromkeys(names))[:MAX_RECORDINGS_LISTED]

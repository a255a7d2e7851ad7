"""Recordings in the data folder, found by name and read in a thread.

Reading a bag of ten minutes takes seconds, so a thread does it while the event loop serves clients (`ThreadReader`).
A name is searched in the data folder and in its folder `Replay`, with or without suffix. It may be a path, but it must
stay inside the data folder.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.bags.bag_reader import read_recording
from rosbridge_sim.shell.files.definitions import Texts
from rosbridge_sim.shell.files.sensor_data_store import OWN_NAME
from rosbridge_sim.shell.files.thread_reader import ThreadReader
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Then

BAG_PATIENCE: Final = 3_600.0
"""Time after which a client is told that its bag cannot be read [s]: a bag of hours takes minutes."""

REPLAY_FOLDER: Final = "Replay"
"""Folder for recordings within the data folder."""

MAX_RECORDING_NAME: Final = 400
"""Longest name of a recording, with its folders [characters]."""

MAX_RECORDINGS_LISTED: Final = 20
"""Names that an error lists."""

_SUFFIXES: Final = ("", ".bag", ".mcap")


class DiskRecordings:
    """Recordings by name, read in threads.

    Attributes:
        reader: its threads.
    """

    def __init__(self, folder: str | Path, texts: Texts, loop: asyncio.AbstractEventLoop) -> None:
        """Set the folder; `read` reads.

        Args:
            folder: the data folder; it need not exist.
            texts: current definitions, for bags that have none.
        """
        self.reader = ThreadReader(loop, BAG_PATIENCE)
        self._folder = Path(folder)
        self._texts = texts

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        """See `Recordings`.

        Args:
            then: called with the result.
        """
        self.reader.read(lambda: read_recording(find_recording(self._folder, name), reading, self._texts), then, 0.0)


# Names


def find_recording(folder: Path, name: str) -> Path:
    """Return the path of the bag that a client names.

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

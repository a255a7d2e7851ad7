"""The disk as the place of captures: sensors' data, in the folder of `--data-dir` and nowhere else.

A client may name a folder and the files. The folder is within `--data-dir`, whichever way it is spelled: links are
followed before that is judged. Nothing that is there is ever overwritten.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.storage import MAX_NAME, PLAIN_NAME

__all__ = ["OWN_NAME", "DiskArchive"]

USUAL_FOLDER = "SensorData"
"""Where captures go whose client names no folder."""

OWN_NAME = "SaveFile"
"""What MORAI calls the folder of `--data-dir`; a client's path may begin with it."""

MAX_PATH = 1_000
"""Characters of a client's path."""

_log = logging.getLogger("rosbridge_sim.storage")


class DiskArchive:
    """Writes captures. A mistake of the client's is told to it alone, a failure of the disk to the log as well."""

    def __init__(self, root: str | Path) -> None:
        """An archive in a folder that is made when it is needed."""
        self._root = Path(root)
        self._has_saved = False

    def save(self, folder: str, name: str, files: Mapping[str, bytes]) -> None:
        """Write the files of one capture: all of them, or none.

        Args:
            folder: a path within `--data-dir`, from there or a full one; empty for `SensorData` in it.
            name: of the capture. Where one of its files is there already, `NAME_2` serves, then `NAME_3`, ...
            files: contents by names in which `{}` stands for the capture's.

        Raises:
            DocumentError: one line for the client: the folder is out of bounds, the name is none, or the disk says no.
        """
        if len(name) > MAX_NAME or not PLAIN_NAME.fullmatch(name):
            raise DocumentError(f"expected a plain file name without a folder, got {name[:80]!r}")
        place = self._find(folder)
        for pattern in files:
            self._check((place / pattern).parent, folder)
        written: list[Path] = []
        try:
            _write(place, name, files, written)
        except (OSError, ValueError) as error:  # a ValueError is a text that is no name of a file
            for path in written:
                with suppress(OSError):
                    path.unlink()
            why = (error.strerror if isinstance(error, OSError) else None) or str(error)
            _log.warning("%s: sensor data cannot be saved: %s", place, why)
            raise DocumentError(f"{name[:80]!r} cannot be saved: {why}") from None
        _log.log(logging.DEBUG if self._has_saved else logging.INFO, "sensor data saved in %s", place)
        self._has_saved = True

    def _find(self, folder: str) -> Path:
        """The folder that a client means.

        Raises:
            DocumentError: the text is no path to a folder in `--data-dir`.
        """
        path = folder.replace("\\", "/") or USUAL_FOLDER
        parts = [part for part in path.split("/") if part not in {"", "."}]
        is_full = path.startswith("/")
        if not is_full and parts[:1] == [OWN_NAME]:
            parts = parts[1:]
        if len(path) > MAX_PATH or not all(map(PLAIN_NAME.fullmatch, parts)):
            raise _out_of_bounds(folder)
        return Path("/", *parts) if is_full else self._root.joinpath(*parts)

    def _check(self, place: Path, folder: str) -> None:
        """Refuse a place that is not, or by way of a link would not be, within `--data-dir`.

        Raises:
            DocumentError: it is not.
        """
        try:
            is_within = place.resolve().is_relative_to(self._root.resolve())
        except (OSError, RuntimeError, ValueError):  # a circle of links, a text that is no path
            is_within = False
        if not is_within:
            raise _out_of_bounds(folder)


def _out_of_bounds(folder: str) -> DocumentError:
    return DocumentError(f"expected a folder within --data-dir, got {folder[:80] or USUAL_FOLDER!r}")


def _write(place: Path, name: str, files: Mapping[str, bytes], written: list[Path]) -> None:
    """Write all files; `written` tells of those that were begun, should one of them fail."""
    free = _find_free(place, name, files)
    for pattern, content in files.items():
        path = place / pattern.format(free)
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            written.append(path)
            file.write(content)


def _find_free(place: Path, name: str, patterns: Mapping[str, bytes]) -> str:
    """The name itself, or with the first number behind it under which nothing is there.

    In twice the logarithm of their number steps: a client may save under one name all day long. That takes numbers
    without gaps; where somebody has made some, it finds a later one that is free.
    """

    def is_taken(number: int) -> bool:
        numbered = name if number == 1 else f"{name}_{number}"
        return any(os.path.lexists(place / pattern.format(numbered)) for pattern in patterns)

    low, high = 0, 1  # nothing is asked of 0; low is taken, high is to be free
    while is_taken(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if is_taken(middle) else (low, middle)
    return name if high == 1 else f"{name}_{high}"

"""The disk as the place of captures: sensors' data, in the folder of `--data-dir` and nowhere else.

A client may name a folder and the files. The folder is within `--data-dir`, whichever way it is spelled: links are
followed before that is judged. Nothing that is there is ever overwritten.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.access_rights import why_not_writable
from rosbridge_sim.shell.files.names import MAX_NAME, is_plain_name
from rosbridge_sim.shell.files.quota import DataQuota

__all__ = ["OWN_NAME", "DiskArchive"]

USUAL_FOLDER = "SensorData"
"""Folder of captures for clients that name none."""

OWN_NAME = "SaveFile"
"""What MORAI calls the folder of `--data-dir`; a client's path may begin with it."""

_MAX_PART = 200
"""Characters of a capture's name in that of its unfinished part; a disk takes 255 bytes."""

MAX_PATH = 1_000
"""Characters of a client's path."""

_log = logging.getLogger("rosbridge_sim.storage")


class DiskArchive:
    """Writes captures. A mistake of the client's is told to it alone, a failure of the disk to the log as well."""

    def __init__(self, root: str | Path, quota: DataQuota | None = None) -> None:
        """An archive in a folder that is made when it is needed; a quota of None is no limit."""
        self._root = Path(root)
        self._quota = quota
        self._has_saved = False

    def save(self, folder: str, name: str, files: Mapping[str, bytes], source: str = "") -> None:
        """Write the files of one capture: all of them, or none.

        Args:
            folder: a path within `--data-dir`, from there or a full one; empty for `SensorData` in it.
            name: of the capture. Where one of its files is there already, `NAME_2` serves, then `NAME_3`, ...
            files: contents by names in which `{}` stands for the capture's.
            source: the topic or service that asked for it, for the log.

        Raises:
            DocumentError: one line for the client: the folder is out of bounds, the name is none, the quota is used up,
                or the disk says no.
        """
        if len(name) > MAX_NAME or not is_plain_name(name):
            raise DocumentError(f"expected a plain file name without a folder, got {name[:80]!r}")
        place = self._find(folder)
        for pattern in files:
            self._check((place / pattern).parent, folder)
        made: list[Path] = []
        try:
            folders = _missing_folders((place / pattern).parent for pattern in files)
            num_bytes, num_files = sum(map(len, files.values())), len(files) + len(folders)
            if self._quota is not None:
                self._quota.check(num_bytes, num_files)
            _write(place, name, files, folders, made)
        except (OSError, ValueError) as error:  # a ValueError is a text that is no name of a file
            for path in reversed(made):
                with suppress(OSError):
                    path.rmdir() if path in folders else path.unlink()
            why = (error.strerror if isinstance(error, OSError) else None) or str(error)
            said = why_not_writable(place, error) if isinstance(error, OSError) else why
            _log.warning("%s: sensor data cannot be saved: %s", place, said)
            raise DocumentError(f"{name[:80]!r} cannot be saved: {why}") from None
        if self._quota is not None:
            self._quota.add(num_bytes, num_files, source)
        _log.log(logging.DEBUG if self._has_saved else logging.INFO, "sensor data saved in %s", place)
        self._has_saved = True

    def _find(self, folder: str) -> Path:
        """Return the folder that a client means.

        Raises:
            DocumentError: the text is no path to a folder in `--data-dir`.
        """
        path = folder.replace("\\", "/") or USUAL_FOLDER
        parts = [part for part in path.split("/") if part not in {"", "."}]
        is_full = path.startswith("/")
        if not is_full and parts[:1] == [OWN_NAME]:
            parts = parts[1:]
        if len(path) > MAX_PATH or not all(map(is_plain_name, parts)):
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


def _missing_folders(wanted: Iterable[Path]) -> list[Path]:
    """Return the folders that have to be made to have these, the outer ones first."""
    missing: dict[Path, None] = {}
    for folder in wanted:
        inner: list[Path] = []
        path = folder
        while path not in missing and not os.path.lexists(path):
            inner.append(path)
            path = path.parent
        missing |= dict.fromkeys(reversed(inner))
    return list(missing)


def _write(place: Path, name: str, files: Mapping[str, bytes], folders: Sequence[Path], made: list[Path]) -> None:
    """Make the folders and write all files; `made` tells of those that were begun, should one of them fail.

    A file gets its name when it is whole: if the process is killed meanwhile, a hidden part is left, and no half file.
    """
    free = _find_free(place, name, files)
    for folder in folders:
        folder.mkdir(exist_ok=True)
        made.append(folder)
    for pattern, content in files.items():
        path = place / pattern.format(free)
        part = path.with_name(f".{path.name[:_MAX_PART]}.part")
        part.unlink(missing_ok=True)  # of a process that was killed
        with part.open("xb") as file:
            made.append(part)
            file.write(content)
        _name(part, path)
        made.append(path)
        part.unlink(missing_ok=True)


def _name(part: Path, path: Path) -> None:
    """Give a whole file its name, which no other file may have: a renaming alone would take another file's place.

    Raises:
        OSError: there is a file of that name, or the disk says no.
    """
    try:
        path.hardlink_to(part)
    except FileExistsError:
        raise
    except OSError:  # FAT and exFAT have no links: take the name first
        path.touch(exist_ok=False)
        try:
            part.replace(path)
        except OSError:
            path.unlink()
            raise


def _find_free(place: Path, name: str, patterns: Mapping[str, bytes]) -> str:
    """Return the name, or the name with the first number behind it that is free.

    In twice the logarithm of their number steps: a client may save under one name all day long. That takes numbers
    without gaps; where a user has made some, it finds a later one that is free.
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

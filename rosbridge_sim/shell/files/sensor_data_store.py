"""Sensor data (captures) on the disk, only in the folder of `--data-dir`.

A client may name a folder and the files. The folder must be within `--data-dir`, however it is spelled: links are
followed before the check. Existing files are never overwritten.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.access_rights import why_not_writable
from rosbridge_sim.shell.files.file_names import MAX_NAME, is_plain_name
from rosbridge_sim.shell.files.quota import DataQuota

USUAL_FOLDER = "SensorData"
"""Folder for clients that name none."""

OWN_NAME = "SaveFile"
"""MORAI's name for the folder of `--data-dir`; a client's path may begin with it."""

_MAX_PART = 200
"""Characters of a capture's name that are used in the name of its unfinished file; disks allow 255 bytes."""

MAX_PATH = 1_000
"""Longest path from a client [characters]."""

_log = logging.getLogger("rosbridge_sim.storage")


class DiskArchive:
    """Writes captures. Only the client is told about its mistakes; disk errors go to the log, too."""

    def __init__(self, root: str | Path, quota: DataQuota | None = None) -> None:
        """Set the folder, which is created when it is needed.

        Args:
            quota: limit for the folder; None means no limit.
        """
        self._root = Path(root)
        self._quota = quota
        self._has_saved = False

    def save(self, folder: str, name: str, files: Mapping[str, bytes], source: str = "") -> None:
        """Write the files of one capture: all of them, or none.

        Args:
            folder: a path within `--data-dir`, relative to it or absolute; empty means its folder `SensorData`.
            name: name of the capture. If one of its files exists, `NAME_2` is used, then `NAME_3`, ...
            files: contents by file name; `{}` in a name is replaced by the capture's name.
            source: the topic or service of the request, for the log.

        Raises:
            DocumentError: a line for the client: the folder or name is not allowed, the quota is reached, or the disk
                fails.
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
        except (OSError, ValueError) as error:  # ValueError: a text that cannot be a file name
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
            DocumentError: the text is not a path to a folder in `--data-dir`.
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
        """Refuse a folder that is outside `--data-dir`, directly or by a link.

        Raises:
            DocumentError: it is outside.
        """
        try:
            is_within = place.resolve().is_relative_to(self._root.resolve())
        except (OSError, RuntimeError, ValueError):  # a loop of links, or a text that is not a path
            is_within = False
        if not is_within:
            raise _out_of_bounds(folder)


def _out_of_bounds(folder: str) -> DocumentError:
    return DocumentError(f"expected a folder within --data-dir, got {folder[:80] or USUAL_FOLDER!r}")


def _missing_folders(wanted: Iterable[Path]) -> list[Path]:
    """Return the folders that must be created for these, outer ones first."""
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
    """Create the folders and write all files; `made` gets each file when it is begun, for the clean-up after an error.

    A file gets its name when it is complete. If the process is killed earlier, a hidden part file is left, but no
    incomplete file.
    """
    free = _find_free(place, name, files)
    for folder in folders:
        folder.mkdir(exist_ok=True)
        made.append(folder)
    for pattern, content in files.items():
        path = place / pattern.format(free)
        part = path.with_name(f".{path.name[:_MAX_PART]}.part")
        part.unlink(missing_ok=True)  # left by a killed process
        with part.open("xb") as file:
            made.append(part)
            file.write(content)
        _name(part, path)
        made.append(path)
        part.unlink(missing_ok=True)


def _name(part: Path, path: Path) -> None:
    """Give a complete file its name. A rename is not used, because it would replace an existing file.

    Raises:
        OSError: a file with that name exists, or the disk fails.
    """
    try:
        path.hardlink_to(part)
    except FileExistsError:
        raise
    except OSError:  # FAT and exFAT have no hard links: create an empty file with the name first
        path.touch(exist_ok=False)
        try:
            part.replace(path)
        except OSError:
            path.unlink()
            raise


def _find_free(place: Path, name: str, patterns: Mapping[str, bytes]) -> str:
    """Return the name, or the name with the first free number behind it.

    It needs about 2 log2(n) checks for n captures, because a client may use one name all day. If a user has made gaps
    in the numbers, a later free one may be found.
    """

    def is_taken(number: int) -> bool:
        numbered = name if number == 1 else f"{name}_{number}"
        return any(os.path.lexists(place / pattern.format(numbered)) for pattern in patterns)

    low, high = 0, 1  # 0 is not checked; low is used, high will be free
    while is_taken(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if is_taken(middle) else (low, middle)
    return name if high == 1 else f"{name}_{high}"

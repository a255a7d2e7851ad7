"""Message definitions: found in the package's own folder and in the user's folders, and read."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from rosbridge_sim.errors import DocumentError, file_errors
from rosbridge_sim.schema.definitions.parse import parse_action, parse_message, parse_service
from rosbridge_sim.shell.files.bounded_read import read_bounded

_log = logging.getLogger("rosbridge_sim.storage")

Texts = dict[tuple[str, str, str], str]
"""(package, `msg` or `srv`, Name) -> definition."""

_PACKAGE = Path(__file__).resolve().parents[2]

SCHEMAS = next(folder for folder in (_PACKAGE / "schemas", _PACKAGE.parent / "schemas") if folder.is_dir())
"""The package's own definitions: inside the wheel, or beside the package in a checkout."""

MAX_DEFINITION_SIZE = 2**20
"""Longest definition [bytes]; the longest real one has 20 kB."""

MAX_FOLDERS = 20_000
"""Folders that are searched for packages: ten times a large workspace. It limits the search if a user gives `/`."""

_KINDS = {"msg": ".msg", "srv": ".srv", "action": ".action"}
_PARSERS: dict[str, Callable[..., object]] = {"msg": parse_message, "srv": parse_service, "action": parse_action}
_PACKAGE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_MANIFEST_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
_IGNORE_MARKS = ("CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE")


def read_definitions(release: str, folders: Sequence[str | Path] = ()) -> Texts:
    """Return every message, service and action definition of the package, then those of the user's folders.

    A folder may be a package (with `msg/` or `srv/` in it), contain packages, or be a whole catkin or colcon tree. If a
    package has several releases (`morai_msgs/22.R2/msg`), the chosen one is read. Later definitions replace earlier
    ones. The user's own are parsed once here, so that the user sees a mistake at the start.

    Args:
        release: release to read of a package that has several.
        folders: the user's folders, in order.

    Raises:
        DocumentError: a folder has no definitions, or a file cannot be used.
    """
    texts = dict(_read_built_in(release))
    for one in folders:
        texts.update(_read_own(Path(one), release))
    return texts


@cache  # there are two releases, and one of them takes 50 ms to read
def _read_built_in(release: str) -> Texts:
    texts: Texts = {}
    for package, folder in _find_packages(SCHEMAS, release):
        texts.update((key, text) for key, text, _ in _read_package(package, folder))
    return texts


def read_installed(folders: Sequence[Path]) -> Texts:
    """Return the definitions of all packages that are installed for ROS 2. What cannot be read is left out.

    Args:
        folders: `share` folders; an earlier one has priority, as in AMENT_PREFIX_PATH.
    """
    texts: Texts = {}
    for folder in reversed(folders):
        for package in _list_folder(folder):
            with suppress(DocumentError, OSError):
                texts.update((key, text) for key, text, _ in _read_package(package, folder / package))
    return texts


def _read_own(root: Path, release: str) -> Texts:
    if not root.is_dir():
        raise DocumentError(f"{root}: expected a folder with ROS packages; there is none")
    texts: Texts = {}
    sources: dict[tuple[str, str, str], Path] = {}
    for package, folder in _find_packages(root, release):
        if not _PACKAGE_NAME.fullmatch(package):
            raise DocumentError(
                f"{folder}: {package!r} is not a ROS package name; rename the folder or add a package.xml"
            )
        for key, text, path in _read_package(package, folder):
            if texts.get(key, text) != text:
                _log.warning("ignored %s, because %s defines the same type; remove one of them", path, sources[key])
                continue
            _, kind, name = key
            _PARSERS[kind](f"{package}/{name}", text, str(path))
            texts[key] = text
            sources[key] = path
    if not texts:
        raise DocumentError(f"{root}: expected ROS packages (PACKAGE/msg/Type.msg); found no definition")
    return texts


def _find_packages(root: Path, release: str) -> Iterator[tuple[str, Path]]:
    """Yield the name of each package at or below `root`, and its folder with `msg/` or `srv/`, sorted by path."""
    waiting = [root]
    seen: set[str] = set()  # real paths, because workspaces have many links, and some form loops
    while waiting:
        folder = waiting.pop()
        real = os.path.realpath(folder)
        if real in seen:
            continue
        seen.add(real)
        if len(seen) > MAX_FOLDERS:
            raise DocumentError(f"{root}: more than {MAX_FOLDERS:,} folders; give a folder closer to the packages")
        names = _list_folder(folder)
        if any(mark in names for mark in _IGNORE_MARKS):
            continue
        holder = next((at for at in (folder, folder / release) if _holds_definitions(at)), None)
        if holder is not None:
            yield _package_name(folder), holder
        else:
            waiting += [folder / name for name in reversed(names) if names[name] and not name.startswith(".")]


def _list_folder(folder: Path) -> dict[str, bool]:
    """Return name -> True if it is a folder, for all entries of a folder, sorted by name."""
    with file_errors(folder, "read"), os.scandir(folder) as entries:
        return dict(sorted((entry.name, entry.is_dir()) for entry in entries))


def _holds_definitions(folder: Path) -> bool:
    for kind, suffix in _KINDS.items():
        at = folder / kind
        if at.is_dir() and any(name.endswith(suffix) for name in _list_folder(at)):
            return True
    return False


def _package_name(folder: Path) -> str:
    """Return the name in the manifest, as ROS does; without a manifest, the name of the folder."""
    manifest = folder / "package.xml"
    if manifest.is_file():
        match = _MANIFEST_NAME.search(_decode(read_bounded(manifest, MAX_DEFINITION_SIZE)))
        if match:
            return match[1]
    return folder.resolve().name


def _read_package(package: str, folder: Path) -> Iterator[tuple[tuple[str, str, str], str, Path]]:
    """Yield key, text and file of each definition of a package."""
    for kind, suffix in _KINDS.items():
        at = folder / kind
        if not at.is_dir():
            continue
        for name, is_folder in _list_folder(at).items():
            if name.endswith(suffix) and not is_folder:
                path = at / name
                yield (package, kind, name.removesuffix(suffix)), _decode(read_bounded(path, MAX_DEFINITION_SIZE)), path


def _decode(content: bytes) -> str:
    """Decode UTF-8. In an old file with other bytes, only comments are affected, and Latin 1 accepts all bytes."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")

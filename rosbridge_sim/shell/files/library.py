"""The disk: message definitions, scenarios and maps, found and read; whatever is wrong is one readable line.

What a person names at the start may lie anywhere. What a *client* names is only looked for inside the folders of
`--scenario-path` and among the built-in documents: a path out of them is refused, whichever way it is spelled.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator, Sequence
from glob import escape
from pathlib import Path

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.catalogue import BUILT_IN
from rosbridge_sim.morai.maps.mgeo import MAP_FILES, RoadMap, read_map
from rosbridge_sim.morai.scenarios.reader import Scenario, read_scenario
from rosbridge_sim.schema.parse import parse_action, parse_message, parse_service
from rosbridge_sim.shell.config.settings_file import looks_like_path
from rosbridge_sim.shell.files.document_cache import DocumentCache

__all__ = [
    "MAX_NAME",
    "PLAIN_NAME",
    "DiskLibrary",
    "Texts",
    "map_names",
    "read_definitions",
    "read_folder",
    "safe_parts",
]

_log = logging.getLogger("rosbridge_sim.storage")

Texts = dict[tuple[str, str, str], str]
"""(package, `msg` or `srv`, Name) -> definition."""

_PACKAGE = Path(__file__).resolve().parents[2]

SCHEMAS = next(folder for folder in (_PACKAGE / "schemas", _PACKAGE.parent / "schemas") if folder.is_dir())
"""Our definitions: within the wheel, or beside the package in a checkout."""

DATA = _PACKAGE / "data"
"""Our scenarios and maps."""

MAX_DEFINITION_SIZE = 2**20
"""The longest real definition has 20 kB [bytes]."""

MAX_DOCUMENT_SIZE = 256 * 2**20
"""A whole city's lane file has some 60 MB [bytes]."""

MAX_FOLDERS = 20_000
"""Folders looked through for packages: ten times a large workspace; somebody may have named `/`."""


# Definitions

_KINDS = {"msg": ".msg", "srv": ".srv", "action": ".action"}
_PARSERS = {"msg": parse_message, "srv": parse_service, "action": parse_action}
_PACKAGE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_MANIFEST_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
_IGNORE_MARKS = ("CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE")


def read_definitions(release: str, folders: Sequence[str | Path] = ()) -> Texts:
    """Every message, service and action definition that the server knows of its own, then those of the user's folders.

    A folder may be a package (with `msg/` or `srv/` in it), hold packages, or be a whole catkin or colcon tree.
    Where a package holds releases (`morai_msgs/22.R2/msg`), the chosen one is read. What comes later replaces what
    came before. The user's own are parsed once here, so that a mistake shows at the start and not to a client.

    Args:
        release: which release of a package that has several.
        folders: the user's, in order.

    Raises:
        DocumentError: a folder without definitions, or a file that cannot be used.
    """
    texts: Texts = {}
    for package, folder in _find_packages(SCHEMAS, release):
        texts.update((key, text) for key, text, _ in _read_package(package, folder))
    for one in folders:
        texts.update(_read_own(Path(one), release))
    return texts


def _read_own(root: Path, release: str) -> Texts:
    if not root.is_dir():
        raise DocumentError(f"{root}: expected a folder with ROS packages; there is none")
    texts: Texts = {}
    sources: dict[tuple[str, str, str], Path] = {}
    for package, folder in _find_packages(root, release):
        if not _PACKAGE_NAME.fullmatch(package):
            raise DocumentError(
                f"{folder}: {package!r} is no name of a ROS package; rename the folder or give it a package.xml"
            )
        for key, text, path in _read_package(package, folder):
            if texts.get(key, text) != text:
                _log.warning("%s: ignored, since %s defines the same type", path, sources[key])
                continue
            _, kind, name = key
            _PARSERS[kind](f"{package}/{name}", text, str(path))
            texts[key] = text
            sources[key] = path
    if not texts:
        raise DocumentError(f"{root}: expected ROS packages (PACKAGE/msg/Type.msg); found no definition")
    return texts


def _find_packages(root: Path, release: str) -> Iterator[tuple[str, Path]]:
    """Name, and the folder that holds `msg/` or `srv/`, of each package at or below `root`, in order of path."""
    waiting = [root]
    seen: set[str] = set()  # real paths: workspaces are full of links, some of them in circles
    while waiting:
        folder = waiting.pop()
        real = os.path.realpath(folder)
        if real in seen:
            continue
        seen.add(real)
        if len(seen) > MAX_FOLDERS:
            raise DocumentError(f"{root}: more than {MAX_FOLDERS:,} folders; name one nearer to the packages")
        names = _list_folder(folder)
        if any(mark in names for mark in _IGNORE_MARKS):
            continue
        holder = next((at for at in (folder, folder / release) if _holds_definitions(at)), None)
        if holder is not None:
            yield _package_name(folder), holder
        else:
            waiting += [folder / name for name in reversed(names) if names[name] and not name.startswith(".")]


def _list_folder(folder: Path) -> dict[str, bool]:
    """Name -> whether it is a folder, of all there is in one, in order of name."""
    try:
        with os.scandir(folder) as entries:
            return dict(sorted((entry.name, entry.is_dir()) for entry in entries))
    except OSError as error:
        raise DocumentError(f"{folder}: cannot be read: {error.strerror}") from None


def _holds_definitions(folder: Path) -> bool:
    for kind, suffix in _KINDS.items():
        at = folder / kind
        if at.is_dir() and any(name.endswith(suffix) for name in _list_folder(at)):
            return True
    return False


def _package_name(folder: Path) -> str:
    """What the manifest says, as ROS takes it; else the folder's name."""
    manifest = folder / "package.xml"
    if manifest.is_file():
        match = _MANIFEST_NAME.search(_decode(_read(manifest, MAX_DEFINITION_SIZE)))
        if match:
            return match[1]
    return folder.resolve().name


def _read_package(package: str, folder: Path) -> Iterator[tuple[tuple[str, str, str], str, Path]]:
    """Key, text and file of each definition of a package."""
    for kind, suffix in _KINDS.items():
        at = folder / kind
        if not at.is_dir():
            continue
        for name, is_folder in _list_folder(at).items():
            if name.endswith(suffix) and not is_folder:
                path = at / name
                yield (package, kind, name.removesuffix(suffix)), _decode(_read(path, MAX_DEFINITION_SIZE)), path


def _decode(content: bytes) -> str:
    """UTF-8; where it is not, the comments of an old file are in Latin 1 and nothing else matters."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


_FIRST_READ = 2**15
"""Asking for `max_bytes` at once would cost a hundred small files a buffer of that size each."""


def _read(path: Path, max_bytes: int) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(_FIRST_READ)
            if len(content) == _FIRST_READ:
                content += file.read(max_bytes + 1 - _FIRST_READ)
    except OSError as error:
        raise DocumentError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > max_bytes:
        raise DocumentError(f"{path}: expected at most {max_bytes:,} bytes; it is longer")
    return content


# Scenarios and maps

MAX_NAMES_LISTED = 20
"""Names that an error lists."""

MAX_NAME = 200
"""Characters of a scenario's name."""

MAX_NAME_BYTES = 255
"""Bytes of one file's or folder's name: disks refuse a longer one, and 200 Korean characters have 600."""

MIN_AGE = 2.0
"""A scenario file that was changed later than this may change again without its time of change telling so [s]: FAT
counts in steps of two seconds. Programs write a scenario, load it and write the next one to the same file."""

PLAIN_NAME = re.compile(r"(?!\.+$)[^\x00-\x1f\x7f<>:\"/\\|?*]+")
"""What names one file or folder on every system, MORAI's own included."""


class DiskLibrary:
    """Scenarios and maps by name. Those that were used last are kept for as long as their files stay as they are.

    Attributes:
        catalogue: the models that scenarios name. It is read once, at the start.
    """

    def __init__(
        self,
        scenario_folders: Sequence[str | Path] = (),
        own_map: str | None = None,
        own_models: str | Path | None = None,
    ) -> None:
        """A library that reads each document when it is asked for.

        Args:
            scenario_folders: where clients' scenarios are, in order of search.
            own_map: name or folder of a map that stands in for whichever map is asked for.
            own_models: file of the user's catalogue.

        Raises:
            DocumentError: a folder does not exist, or the catalogue cannot be used.
        """
        self._folders = [Path(folder) for folder in scenario_folders]
        self._own_map = own_map
        self._opening: Path | None = None
        self._cache = DocumentCache()
        self.catalogue = BUILT_IN
        if own_models is not None:
            # Imported here: a start without such a file does not wait for it.
            from rosbridge_sim.shell.files.catalogue_file import read_catalogue  # noqa: PLC0415

            self.catalogue = read_catalogue(Path(own_models))
        for folder in self._folders:
            if not folder.is_dir():
                raise DocumentError(f"{folder}: expected a folder with scenarios; there is none")

    def scenario(self, name: str) -> Scenario:
        """The scenario that a client names.

        It is `NAME.json` (the suffix may be given or not) in one of the folders, or, as MORAI keeps them,
        `MAP/NAME.json` there; `MAP/NAME` asks for one map's. After the folders comes the file that the server was
        started with: programs begin an episode anew by loading it.

        Raises:
            DocumentError: no such scenario, a name that leads out of the folders, or a file that cannot be used.
        """
        path = self._find_scenario(name)
        return self._cache.get("scenario", path, [path], lambda: self._understand(path), min_age=MIN_AGE)

    def opening_scenario(self, name: str) -> Scenario:
        """The scenario that the person who starts the server names: as above, or any file.

        Raises:
            DocumentError: as above.
        """
        text, source = self.opening_file(name)
        self._opening = Path(source)
        return read_scenario(text, source, catalogue=self.catalogue)

    def opening_file(self, name: str) -> tuple[bytes, str]:
        """Content and path of the file of that scenario.

        Raises:
            DocumentError: there is none, or it cannot be read.
        """
        path = Path(name)
        if looks_like_path(name) and (path.is_file() or name != path.name):
            return self._read_scenario(path)
        return self._read_scenario(self._find_scenario(name))

    def has_scenario(self, name: str) -> bool:
        """Tell whether `scenario` would find a file under a name; it need not be a good one."""
        try:
            self._find_scenario(name)
        except DocumentError:
            return False
        return True

    def _find_scenario(self, name: str) -> Path:
        parts = safe_parts(name)
        for folder in self._folders:
            path = _find_scenario(folder, parts)
            if path is not None:
                return path
        if self._opening is not None and parts == (f"{self._opening.name.removesuffix('.json')}.json",):
            return self._opening
        path = _find_scenario(DATA / "scenarios", parts)
        if path is not None:
            return path
        known = ", ".join(self.scenario_names())
        raise DocumentError(f"no scenario {name!r}; known are {known}, and --scenario-path takes a folder")

    def _understand(self, path: Path) -> Scenario:
        text, source = self._read_scenario(path)
        return read_scenario(text, source, catalogue=self.catalogue)

    def _read_scenario(self, path: Path) -> tuple[bytes, str]:
        return _read(path, MAX_DOCUMENT_SIZE), str(path)

    def scenario_names(self) -> list[str]:
        """Some of the names that `scenario` takes, in order of search, for a person to read."""
        own = [name for folder in self._folders for name in _names_in(folder)]
        opening = [] if self._opening is None else [self._opening.name.removesuffix(".json")]
        return list(dict.fromkeys([*own, *opening, *_names_in(DATA / "scenarios")]))[:MAX_NAMES_LISTED]

    def map(self, name: str) -> RoadMap:
        """The map that a scenario names, or the one that stands in for all.

        Raises:
            DocumentError: no such map, or a file that cannot be used.
        """
        folder = self.map_folder(name)
        files = [folder / name for name in _map_files(folder)]
        return self._cache.get("map", folder, files, lambda: read_map(read_folder(folder), str(folder)))

    def map_folder(self, name: str) -> Path:
        """Where the map of that name is, or the one that stands in for all.

        Raises:
            DocumentError: there is no such map.
        """
        folder = DATA / "maps" / (self._own_map or name)
        if self._own_map is not None and (looks_like_path(self._own_map) or not folder.is_dir()):
            folder = Path(self._own_map)
        if (self._own_map is None and not _is_file_name(name)) or not folder.is_dir():
            known = ", ".join(map_names())
            raise DocumentError(f"no map {self._own_map or name!r}; known are {known}, and --map takes a folder")
        return folder


def map_names() -> list[str]:
    """The built-in maps."""
    return sorted(at.name for at in (DATA / "maps").iterdir() if at.is_dir())


def safe_parts(name: str) -> tuple[str, ...]:
    """A client's name of a scenario, taken apart: (NAME.json,) or (MAP, NAME.json)."""
    parts = name.replace("\\", "/").split("/")
    is_plain = len(name) <= MAX_NAME and len(parts) <= len(("MAP", "NAME")) and all(map(_is_file_name, parts))
    if not parts[-1].endswith(".json"):
        parts[-1] += ".json"
    if not is_plain or not _is_file_name(parts[-1]):
        raise DocumentError(f"{name[:80]!r} is no name of a scenario: expected NAME or MAP/NAME within --scenario-path")
    return tuple(parts)


def _is_file_name(part: str) -> bool:
    """Tell whether a disk can have a file or folder of that name."""
    return PLAIN_NAME.fullmatch(part) is not None and len(part.encode("utf-8", "surrogatepass")) <= MAX_NAME_BYTES


def _names_in(folder: Path) -> list[str]:
    """The names of a folder's scenarios, sorted by path."""
    found = sorted([*folder.glob("*.json"), *folder.glob("*/*.json")])
    return [path.relative_to(folder).with_suffix("").as_posix() for path in found]


def _find_scenario(folder: Path, parts: tuple[str, ...]) -> Path | None:
    """The file of that name in a folder or, where no map is named, in one of the folders in it."""
    found = [path for path in [folder.joinpath(*parts)] if path.is_file()]
    if not found and len(parts) == 1:
        found = [path for path in sorted(folder.glob("*/" + escape(parts[0]))) if path.is_file()]
    if not found:
        return None
    if len(found) > 1:
        _log.warning("%s of several scenarios named %s; MAP/NAME asks for one map's", found[0], parts[0])
    if not found[0].resolve().is_relative_to(folder.resolve()):
        raise DocumentError(f"{'/'.join(parts)!r} leads out of --scenario-path")
    return found[0]


def read_folder(folder: Path) -> dict[str, bytes]:
    """Name -> content of the files of a map that are read; a city's folder holds many more, and large ones."""
    return {name: _read(folder / name, MAX_DOCUMENT_SIZE) for name in _map_files(folder)}


def _map_files(folder: Path) -> list[str]:
    return [name for name in MAP_FILES if (folder / name).exists()]

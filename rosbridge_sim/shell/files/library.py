"""Scenarios and maps by name, found on the disk and read.

A name that the user gives at the start may be any path. A name from a *client* is only searched in the folders of
`--scenario-path` and among the built-in documents; a path out of them is refused, however it is spelled.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import suppress
from glob import escape
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.map_formats import FILE_FORMATS, MAP_FILES, find_file_format, read_map
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import BUILT_IN
from rosbridge_sim.scenarios.openscenario.story_records import Findings, Story
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.settings_file import looks_like_path
from rosbridge_sim.shell.files.bounded_read import read_bounded, read_in_pieces
from rosbridge_sim.shell.files.document_cache import DocumentCache
from rosbridge_sim.shell.files.file_names import is_file_name, safe_parts
from rosbridge_sim.shell.files.other_formats import LOOKED_AT, MAP_IS, SCENARIO_IS, find_other_format, say_not_read
from rosbridge_sim.shell.files.story_files import (
    SUFFIX,
    StoryOptions,
    collect_story,
    declared_of,
    is_story,
    read_parameters,
    resolve_within,
)

_log = logging.getLogger("rosbridge_sim.storage")

DATA = Path(__file__).resolve().parents[2] / "data"
"""The built-in scenarios and maps."""

MAX_DOCUMENT_SIZE = 256 * 2**20
"""Longest file [bytes]; the lane file of a whole city has about 60 MB."""

MAX_NAMES_LISTED = 20
"""Largest number of names in an error."""

MIN_AGE = 2.0
"""A younger scenario file is not cached [s]. It may change again with the same modification time, because FAT counts in
steps of two seconds. Programs write a scenario, load it, and write the next one to the same file."""


_BUILT_IN_MAPS: Final = DocumentCache()
"""The built-in maps, with what was computed of their roads. All libraries of a process share them: environments have
one each."""


class DiskLibrary:
    """Scenarios and maps by name. Recently used ones are cached until their files change.

    Attributes:
        catalogue: the models for scenarios; read once, at the start.
    """

    def __init__(
        self,
        scenario_folders: Sequence[str | Path] = (),
        own_map: str | None = None,
        own_models: str | Path | None = None,
        stories: StoryOptions | None = None,
        own_signal_plan: str | Path | None = None,
    ) -> None:
        """Create a library that reads each document when it is needed.

        Args:
            scenario_folders: folders of clients' scenarios, in order of search.
            own_map: name or folder of a map that replaces all other maps.
            own_models: file of the user's catalogue.
            stories: how files of OpenSCENARIO are read; None for the defaults.
            own_signal_plan: file with the plan of the lights of the maps.

        Raises:
            DocumentError: a folder does not exist, or the catalogue cannot be used.
        """
        self._folders = [Path(folder) for folder in scenario_folders]
        self._own_map = own_map
        self._stories = stories or StoryOptions()
        self._story_maps: dict[str, Path] = {}
        self._own_signal_plan = None if own_signal_plan is None else Path(own_signal_plan)
        self._opening: Path | None = None
        self._cache = DocumentCache()
        self.catalogue = BUILT_IN
        if own_models is not None:
            # Imported here, so that a start without such a file is faster.
            from rosbridge_sim.shell.files.catalogue_file import read_catalogue  # noqa: PLC0415

            self.catalogue = read_catalogue(Path(own_models))
        for folder in self._folders:
            if not folder.is_dir():
                raise DocumentError(f"{folder}: expected a folder with scenarios; there is none")

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or pickle has: it reads its documents again."""
        return {**self.__dict__, "_cache": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Begin with an empty cache."""
        self.__dict__.update(state, _cache=DocumentCache())

    def scenario(self, name: str) -> Scenario:
        """Return the scenario that a client names.

        It is `NAME.json` in one of the folders (the suffix may be left out), or `MAP/NAME.json` there, as in MORAI.
        `MAP/NAME` selects the scenario of one map. After the folders, the file that the server was started with is
        tried, because programs load it to restart an episode.

        Args:
            name: NAME or MAP/NAME.

        Raises:
            DocumentError: there is no such scenario, the name leads out of the folders, or a file cannot be used.
        """
        path = self.scenario_path(name)
        return self._cache.get("scenario", path, [path], lambda: self._understand(path), min_age=MIN_AGE)

    def opening_scenario(self, name: str) -> Scenario:
        """Return the scenario that the user names at the start: as for `scenario`, or any file.

        Args:
            name: a name or a path.

        Raises:
            DocumentError: there is no such scenario, or a file cannot be used.
        """
        text, source = self.opening_file(name)
        self._opening = Path(source)
        return self._read(text, self._opening, self._stories, None)

    def opening_file(self, name: str) -> tuple[bytes, str]:
        """Return content and path of the scenario file that the user names at the start.

        Args:
            name: a name or a path.

        Raises:
            DocumentError: there is none, or it cannot be read.
        """
        path = Path(name)
        if looks_like_path(name) and (path.is_file() or name != path.name):
            return self._read_scenario(path)
        return self._read_scenario(self.scenario_path(name))

    def has_scenario(self, name: str) -> bool:
        """Return True if `scenario` would find a file; the file may be invalid.

        Args:
            name: NAME or MAP/NAME.
        """
        try:
            self.scenario_path(name)
        except DocumentError:
            return False
        return True

    def scenario_path(self, name: str) -> Path:
        """Return the file of a scenario.

        Args:
            name: NAME or MAP/NAME.

        Raises:
            DocumentError: there is none, or the name leads out of the folders.
        """
        parts = safe_parts(name)
        for folder in self._folders:
            path = _find_scenario(folder, parts)
            if path is not None:
                return path
        if self._opening is not None and parts in {(self._opening.name,), (f"{self._opening.stem}.json",)}:
            return self._opening
        path = _find_scenario(DATA / "scenarios", parts)
        if path is not None:
            return path
        if not is_story(name, b"") and (form := find_other_format(name)):
            raise DocumentError(f"{name!r}: {say_not_read(form)}; {SCENARIO_IS}")
        known = ", ".join(self.scenario_names())
        raise DocumentError(f"no scenario {name!r}; known are {known}, and --scenario-path takes a folder")

    def _understand(self, path: Path) -> Scenario:
        text, _ = self._read_scenario(path)
        is_opening = path == self._opening
        return self._read(text, path, self._stories, None if is_opening else self._folders)

    def _read(self, text: bytes, path: Path, options: StoryOptions, within: Sequence[Path] | None) -> Scenario:
        """Return a scenario of MORAI's or of OpenSCENARIO.

        Args:
            within: folders that the paths in it must lead to; None for any.

        Raises:
            DocumentError: it cannot be used.
        """
        if not is_story(path.name, text):
            return read_scenario(text, str(path), catalogue=self.catalogue)
        from rosbridge_sim.scenarios.openscenario.story import read_story  # noqa: PLC0415 - few servers read a story

        if within is not None:
            options = replace(options, parameters=declared_of(text, path.name, options.parameters))
        return self._scenario_of(read_story(collect_story(path, text, options, within)), path, within)

    def _scenario_of(self, story: Story, path: Path, within: Sequence[Path] | None) -> Scenario:
        from rosbridge_sim.scenarios.openscenario.entities import story_scenario  # noqa: PLC0415 - few servers read a story

        return story_scenario(story, path.stem, self._map_of(story, path, within), self.catalogue)

    def examine_story(self, text: bytes, path: Path) -> tuple[Scenario | None, Findings]:
        """Return the scenario of a file of OpenSCENARIO as far as there is one, and all that is told about the file.

        Raises:
            DocumentError: it is no such file, or a file that it names cannot be read.
        """
        from rosbridge_sim.scenarios.openscenario.story import examine_story  # noqa: PLC0415 - few servers read a story

        story, findings = examine_story(collect_story(path, text, self._stories, None))
        is_good = story is not None and not findings.mistakes
        return (self._scenario_of(story, path, None) if story is not None and is_good else None), findings

    def _map_of(self, story: Story, path: Path, within: Sequence[Path] | None) -> str | None:
        """Return the name of a story's map, under which `map` finds the file that it names."""
        if not story.map_file:
            return story.map_name or None
        file = resolve_within(path.parent / story.map_file, story.map_file, within)
        name = next((name for name, known in self._story_maps.items() if known == file), None)
        if name is None:
            num = sum(known.name == file.name for known in self._story_maps.values())
            name = file.name if num == 0 else f"{file.name} ({num + 1})"
            self._story_maps[name] = file
        return name

    def _read_scenario(self, path: Path) -> tuple[bytes, str]:
        text = read_bounded(path, MAX_DOCUMENT_SIZE)
        form = "" if is_story(path.name, text) else find_other_format(path.name, text)
        if form:
            raise DocumentError(f"{path}: {say_not_read(form)}; {SCENARIO_IS}")
        return text, str(path)

    def scenario_names(self) -> list[str]:
        """Return some of the names that `scenario` accepts, in order of search, for error texts."""
        return self.all_scenario_names()[:MAX_NAMES_LISTED]

    def all_scenario_names(self) -> list[str]:
        """Return the names that `scenario` accepts, in order of search."""
        own = [name for folder in self._folders for name in _names_in(folder)]
        opening = [] if self._opening is None else [self._opening.stem]
        return list(dict.fromkeys([*own, *opening, *_names_in(DATA / "scenarios")]))

    def map(self, name: str) -> RoadMap:
        """Return the map that a scenario names, or the one that replaces all maps.

        Raises:
            DocumentError: there is no such map, or a file cannot be used.
        """
        path = self.map_path(name)
        plan = self._own_signal_plan
        files = [*self.map_files(name), *([] if plan is None else [plan])]
        cache = _BUILT_IN_MAPS if plan is None and path.is_relative_to(DATA) else self._cache
        return cache.get("map", path, files, lambda: read_map_at(path, plan))

    def map_files(self, name: str) -> list[Path]:
        """Return the files of a map.

        Raises:
            DocumentError: there is no such map.
        """
        path = self.map_path(name)
        return [path / name for name in _map_files(path)] if path.is_dir() else [path]

    def map_path(self, name: str) -> Path:
        """Return the folder or file of a map, or of the one that replaces all maps.

        A scenario's map is a built-in one, or `NAME.xodr` in one of the folders of scenarios; that of a story is the
        file that the story names.

        Raises:
            DocumentError: there is no such map.
        """
        wanted = self._own_map or name
        built_in = DATA / "maps" / wanted
        if self._own_map is not None and (looks_like_path(wanted) or not built_in.is_dir()):
            path = Path(wanted)
            if path.is_dir() or _is_map_file(path):
                return path
            refuse_map_file(path)
        elif self._own_map is None and name in self._story_maps:
            path = self._story_maps[name]
            if _is_map_file(path):
                return path
            refuse_map_file(path)
            raise DocumentError(f"{path}: {MAP_IS}; there is none, and --map takes another one")
        elif is_file_name(wanted) and built_in.is_dir():
            return built_in
        elif is_file_name(wanted) and (found := self._find_map_file(wanted)):
            return found
        elif (form := find_other_format(name)) and form != "OpenDRIVE":
            raise DocumentError(f"map {name!r}: {form} is not read; {map_is()}")
        known = ", ".join(map_names())
        raise DocumentError(f"no map {wanted!r}; known are {known}, and --map takes a folder or a .xodr file")

    def _find_map_file(self, name: str) -> Path | None:
        """Return the file of a scenario's map in the folders of scenarios."""
        for each in FILE_FORMATS:
            file = name if name.lower().endswith(each.suffix) else name + each.suffix
            for folder in self._folders:
                path = folder / file
                if path.is_file() and path.resolve().is_relative_to(folder.resolve()):
                    return path
        return None


def read_map_at(path: Path, signal_plan: Path | None = None) -> RoadMap:
    """Return the map of a folder or of a file.

    Args:
        signal_plan: file with the plan of its lights.

    Raises:
        DocumentError: it cannot be used.
    """
    if signal_plan is not None:
        # Imported here, so that a start without such a file is faster.
        from rosbridge_sim.maps.signal_plan_file import MAX_PLAN_BYTES, set_signal_plan  # noqa: PLC0415

        content = read_bounded(signal_plan, MAX_PLAN_BYTES)
        return set_signal_plan(read_map_at(path), content, str(signal_plan))
    if path.is_dir():
        return read_map(read_folder(path), str(path))
    form = find_file_format(path.name, _beginning(path)) or FILE_FORMATS[0]
    return form.read(read_in_pieces(path, MAX_DOCUMENT_SIZE), str(path))


def _is_map_file(path: Path) -> bool:
    """Return whether a file is a map of a format that is read."""
    return path.is_file() and find_file_format(path.name, _beginning(path)) is not None


def _beginning(path: Path) -> bytes:
    """Return the first bytes of a file; none if it cannot be read."""
    with suppress(OSError), path.open("rb") as file:
        return file.read(LOOKED_AT)
    return b""


def open_library(settings: Settings) -> DiskLibrary:
    """Return the scenarios and maps of a server.

    Raises:
        DocumentError: a folder, the catalogue or a parameter cannot be used.
    """
    stories = StoryOptions(
        read_parameters(settings.param),
        settings.ego_entity or "",
        is_lenient=settings.lenient,
        drives_ego=settings.ego == "story",
    )
    return DiskLibrary(settings.scenario_path, settings.map, settings.catalogue, stories, settings.signal_plan)


def refuse_map_file(path: Path) -> None:
    """Raise the error for a map of the user that is a file, or is named like one of another format.

    Args:
        path: where no folder is.

    Raises:
        DocumentError: it is one.
    """
    is_file = path.is_file()
    form = find_other_format(path.name, _beginning(path) if is_file else b"")
    if form and form != "OpenDRIVE":
        raise DocumentError(f"{path}: {form} is not read; {map_is()}")
    if is_file:
        raise DocumentError(f"{path}: {map_is()}; got a file")


def map_is() -> str:
    """Return what a map is, for errors: its formats, or the name of a built-in one."""
    return f"{MAP_IS}, or one of {', '.join(map_names())}"


def map_names() -> list[str]:
    """Return the names of the built-in maps."""
    return sorted(at.name for at in (DATA / "maps").iterdir() if at.is_dir())


def _names_in(folder: Path) -> list[str]:
    """Return the names of the scenarios in a folder, sorted by path."""
    found = sorted(path for pattern in ("*.json", "*/*.json", "*.xosc", "*/*.xosc") for path in folder.glob(pattern))
    return [path.relative_to(folder).with_suffix("").as_posix() for path in found]


def _find_scenario(folder: Path, parts: tuple[str, ...]) -> Path | None:
    """Return the file with that name in a folder or, if no map is named, in one of its subfolders.

    Where there is no NAME.json, it may be NAME.xosc.
    """
    if parts[-1].endswith(".json"):
        story = (*parts[:-1], parts[-1].removesuffix(".json") + SUFFIX)
        return _find_file(folder, parts) or _find_file(folder, story)
    return _find_file(folder, parts)


def _find_file(folder: Path, parts: tuple[str, ...]) -> Path | None:
    found = [path for path in [folder.joinpath(*parts)] if path.is_file()]
    if not found and len(parts) == 1:
        found = [path for path in sorted(folder.glob("*/" + escape(parts[0]))) if path.is_file()]
    if not found:
        return None
    if len(found) > 1:
        _log.warning("took %s, but several scenarios are named %s; use MAP/NAME to choose one", found[0], parts[0])
    if not found[0].resolve().is_relative_to(folder.resolve()):
        raise DocumentError(f"{'/'.join(parts)!r} leads out of --scenario-path")
    return found[0]


def read_folder(folder: Path) -> dict[str, bytes]:
    """Return name -> content of the needed files of a map; a city's folder has many other, large files."""
    return {name: read_bounded(folder / name, MAX_DOCUMENT_SIZE) for name in _map_files(folder)}


def _map_files(folder: Path) -> list[str]:
    return [name for name in MAP_FILES if (folder / name).exists()]

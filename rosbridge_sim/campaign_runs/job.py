"""A campaign as the workers get it: the text of its file, and where files are found. It can be sent to another process.

What it takes long to read is read once in each process: the campaign, the user's Python files, maps and scenarios.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import sys
import tomllib
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from rosbridge_sim.campaign_runs.outcome import told_error
from rosbridge_sim.campaigns.assignments import Change, change_document
from rosbridge_sim.campaigns.campaign import Campaign, read_campaign
from rosbridge_sim.campaigns.campaign_model import DriverItem
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.toml_text import read_toml
from rosbridge_sim.shell.files.library import DiskLibrary, open_library
from rosbridge_sim.shell.files.message_types import MessageTypes
from rosbridge_sim.shell.files.story_files import StoryOptions, is_story

MAX_LIBRARIES: Final = 16
"""Most libraries of own maps and catalogues that are kept."""


class Job(Record):
    """A campaign, to be sent.

    Attributes:
        text: of the TOML file.
        source: its name, for errors.
        base: folder of the file; paths in it are relative to it.
        folder: of the results.
    """

    text: str
    source: str
    base: str
    folder: str


def read_job(path: Path, folder: Path) -> Job:
    """Read the file of a campaign.

    Raises:
        DocumentError: it is no file, cannot be read, or is not valid TOML.
    """
    if path.exists() and not path.is_file():  # a pipe would be waited for
        raise DocumentError(f"{path}: expected a TOML file; it is a folder, a pipe or a device")
    text, _ = read_toml(path)
    return Job(text, path.name, str(path.resolve().parent), str(folder.resolve()))


def parameters_of(changes: tuple[Change, ...], source: str) -> dict[str, str]:
    """Return the changes of a scenario of OpenSCENARIO: values of its parameters by name.

    Raises:
        DocumentError: a change is none of a parameter.
    """
    found: dict[str, str] = {}
    for path, value in changes:
        if len(path) != 1:
            text = ".".join(map(str, path))
            raise DocumentError(f"{source}: set.'scenario.{text}': expected scenario.NAME, the name of a parameter")
        found[str(path[0])] = str(value).lower() if isinstance(value, bool) else str(value)
    return found


class LoadedJob:
    """A campaign with all that its runs need, kept in a process.

    Attributes:
        job: as it was sent.
        campaign: parsed.
        library: scenarios, maps and models.
        types: message types of the runs' simulators.
    """

    def __init__(self, job: Job) -> None:
        self.job = job
        self.campaign: Campaign = read_campaign(tomllib.loads(job.text), job.source)
        self.library = DiskLibrary()
        self.types = MessageTypes()
        self._documents: dict[str, tuple[Any, str]] = {}
        self._libraries: dict[object, DiskLibrary] = {}

    def library_for(self, settings: Settings) -> DiskLibrary:
        """Return scenarios and maps for a simulator; the same ones for all that have the same folders.

        Args:
            settings: of the simulator.

        Raises:
            DocumentError: a folder or the catalogue cannot be used.
        """
        own = (
            *(settings.scenario_path, settings.map, settings.catalogue, settings.signal_plan),
            *(settings.param, settings.ego_entity, settings.ego, settings.lenient),
        )
        if own == (Settings().scenario_path, None, None, None, (), Settings().ego_entity, "program", False):
            return self.library
        if own not in self._libraries:
            if len(self._libraries) >= MAX_LIBRARIES:
                self._libraries.clear()
            self._libraries[own] = open_library(settings)
        return self._libraries[own]

    def scenario_text(self, name: str, changes: tuple[Change, ...]) -> tuple[bytes, str]:
        """Return a scenario's document with the changes of a run, and its path; a story without them.

        Args:
            name: name or file, as in the campaign.

        Raises:
            DocumentError: there is no such scenario, or no such place in it.
        """
        own = Path(self.job.base) / name
        if name not in self._documents:
            text, source = self.library.opening_file(str(own) if own.is_file() else name)
            if is_story(source, text):
                return text, source
            try:
                document = json.loads(text.removeprefix(b"\xef\xbb\xbf")) if changes else None
            except (ValueError, RecursionError):
                raise DocumentError(f"{source}: expected a JSON document") from None
            if not changes:
                return text, source
            self._documents[name] = document, source
        document, source = self._documents[name]
        if not changes:
            return json.dumps(document).encode(), source
        return json.dumps(change_document(document, changes, Path(source).name)).encode(), source

    def scenario(self, name: str, changes: tuple[Change, ...]) -> Scenario:
        """Return a scenario with the changes of a run. Arguments and errors as for `scenario_text`."""
        text, source = self.scenario_text(name, changes)
        if is_story(source, text):
            library = DiskLibrary(stories=StoryOptions(parameters_of(changes, Path(source).name)))
            return library.opening_scenario(source)
        return replace(read_scenario(text, Path(source).name, catalogue=self.library.catalogue))

    def drivers_function(self, driver: DriverItem) -> Callable[..., Any]:
        """Return the user's function or class of a driver.

        Raises:
            DocumentError: it cannot be loaded, or it is a policy and Gymnasium is missing.
        """
        if driver.policy is not None and importlib.util.find_spec("gymnasium") is None:
            raise DocumentError(
                "policy: it needs the extra rosbridge-sim[gym], too: pip install 'rosbridge-sim[campaign,gym]'"
            )
        name = driver.python or driver.policy
        assert name is not None
        return load_callable(name, self.job.base)

    @cached_property
    def checks(self) -> Mapping[str, Callable[..., object]]:
        """The user's functions that judge, by the name of the limit.

        Raises:
            DocumentError: one cannot be loaded.
        """
        limits = self.campaign.limits.python
        return {name: load_callable(function, self.job.base) for name, function in limits.items()}


@lru_cache(maxsize=2)
def open_job(job: Job) -> LoadedJob:
    """Return a campaign with what its runs need; the same one for the same job.

    Raises:
        DocumentError: it cannot be used.
    """
    return LoadedJob(job)


@lru_cache(maxsize=64)
def load_callable(name: str, base: str) -> Callable[..., Any]:
    """Return a function or class of the user.

    Args:
        name: `FILE.py:NAME`, relative to `base`, or `package.module:NAME`.
        base: folder that is searched first.

    Raises:
        DocumentError: there is none, or its module cannot be imported.
    """
    where, _, member = name.rpartition(":")
    if base not in sys.path:
        sys.path.insert(0, base)  # so that the file finds its neighbours
    try:
        is_file = where.endswith(".py")
        module = _import_file(Path(base) / where, name) if is_file else importlib.import_module(where)
    except DocumentError:
        raise
    except (Exception, SystemExit) as error:
        raise DocumentError(f"{name}: the import failed: {told_error(error)}") from error
    found = getattr(module, member, None)
    if not callable(found):
        raise DocumentError(f"{name}: the module has no function or class {member!r}")
    loaded: Callable[..., Any] = found
    return loaded


def _import_file(path: Path, name: str) -> ModuleType:
    if not path.is_file():
        raise DocumentError(f"{name}: there is no file {path}")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules.setdefault(path.stem, module)
    spec.loader.exec_module(module)
    return module

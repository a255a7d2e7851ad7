"""Options of a run's simulator, from what the run sets; and which settings a driver without a server takes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from rosbridge_sim.campaign_runs.job import LoadedJob, parameters_of
from rosbridge_sim.campaigns.run_results import Run
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Value
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS, SHORT_FORMS
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.files.story_files import is_story
from rosbridge_sim.suggestions import hint

OWN_SETTINGS: Final = frozenset({"scenario", "seed", "port", "host", "start", "score", "record", "data_dir", "config"})
"""Settings that belong to the campaign."""

WORLD_SETTINGS: Final = {"traffic": "traffic", "dynamics": "dynamics", "on_collision": "impacts"}
"""Settings for which many worlds in one step are enough -> argument of `Worlds`."""

GROUPS: Final = frozenset({"the world", "the simulator's topics and services", "MORAI conventions", "message types"})
"""Groups of settings that have a meaning without a server."""

NEED_A_SERVER: Final = {
    "world": "a drive needs a world",
    "data_quota": "it has no clients that save files",
    "data_quota_files": "it has no clients that save files",
    "real_time_factor": "its world moves with the driver",
    "sensors": "it sees numbers, no pictures",
    "on_world_failure": "it has no clients to serve on",
    "stamps": "its time is simulated time",
}
"""Settings of these groups that have none -> why."""


def check_settings(keys: Iterable[str], where: str, *, has_server: bool) -> None:
    """Refuse settings that a kind of driver does not take.

    Args:
        keys: names of settings, with underscores.
        where: place in the user's file, for errors.
        has_server: the driver is a program, which connects to a server.

    Raises:
        DocumentError: a setting is not known, belongs to the campaign, or needs a server.
    """
    for key in keys:
        flag = key.replace("_", "-")
        if flag not in FIELDS and flag not in SHORT_FORMS:
            raise DocumentError(f"{where}setting.{key}: there is no such setting{hint(flag, FLAGS)}")
        if key in OWN_SETTINGS:
            raise DocumentError(f"{where}setting.{key}: expected another setting; this one belongs to the campaign")
        if has_server:
            continue
        why = NEED_A_SERVER.get(key, "" if FLAGS[flag].group in GROUPS else "it has no server")
        if why:
            raise DocumentError(
                f"{where}setting.{key}: a driver in Python does not take it: {why}. A driver with a command does"
            )


def simulator_options(loaded: LoadedJob, run: Run, work: Path, *, is_real_time: bool = False) -> SimulatorOptions:
    """Return the options of a run's simulator.

    Args:
        work: its folder; a scenario with changes is written there.
        is_real_time: the world does not wait for ticks.

    Raises:
        DocumentError: the scenario or a setting cannot be used.
    """
    values = loaded.campaign.values_of(run)
    changes = values.scenario
    text, source = loaded.scenario_text(run.scenario, ())
    parameters: dict[str, str] = {}
    if is_story(source, text):
        if values.vehicle is not None:
            raise DocumentError(f"{Path(source).name}: set.vehicle: the ego of a story has the model of its file")
        parameters, changes = parameters_of(changes, Path(source).name), ()
    if values.vehicle is not None:
        changes = (*changes, (("egoVehicle", "modelName"), values.vehicle))
    if changes:
        text, _ = loaded.scenario_text(run.scenario, changes)
        file = work / "scenario.json"
        file.write_bytes(text)
        source = str(file)
    options: SimulatorOptions = {
        "scenario": source,
        "param": [f"{name}={value}" for name, value in parameters.items()],
        "seed": run.seed,
        "port": 0,
        "page": False,
        "start": "run" if is_real_time else "sync",
        "score": True,
        "data_dir": str(work / "SaveFile"),
    }
    settings = {
        key: _found(value, loaded.job.base) if key in _PATHS else value for key, value in values.settings.items()
    }
    options.update(settings)  # type: ignore[typeddict-item] # `Simulator` checks names and values
    return options


_PATHS: Final = frozenset({"map", "catalogue", "scenario_path", "schema_path", "sensor_noise", "sensors"})
"""Settings that may name a file or folder."""


def _found(value: Value, base: str) -> Value:
    """Return a path relative to the folder of the campaign, if there is something; else the value."""
    if isinstance(value, str) and value and (Path(base) / value).exists():
        return str(Path(base) / value)
    return value


def make_work_folder(loaded: LoadedJob, run: Run) -> Path:
    """Make a folder for a run's own files, beside the results, so that they can be moved there.

    Raises:
        OSError: the disk takes no more.
    """
    folder: Path | None = Path(loaded.job.folder) / ".work"
    try:
        Path(loaded.job.folder, ".work").mkdir(parents=True, exist_ok=True)
    except OSError:
        folder = None
    return Path(tempfile.mkdtemp(prefix=f"run-{run.number}-", dir=folder))

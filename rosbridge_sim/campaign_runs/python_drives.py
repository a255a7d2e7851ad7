"""Drives without a server: our own driver, Python functions and policies, one world or many of them together.

World i of a batch moves as it would alone, to the bit, so a batch changes nothing in the table. If a function that
drives many worlds raises an error, each of them is driven again alone: then the error belongs to its own run.
"""

from __future__ import annotations

import contextlib
import math
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from rosbridge_sim.campaign_runs.job import LoadedJob
from rosbridge_sim.campaign_runs.observation import Observation
from rosbridge_sim.campaign_runs.outcome import KeptOutput, Outcome
from rosbridge_sim.campaign_runs.surroundings import find_roads
from rosbridge_sim.campaigns.campaign import RunValues, names_of
from rosbridge_sim.campaigns.campaign_model import DriverItem
from rosbridge_sim.campaigns.results import Run
from rosbridge_sim.campaigns.trace import Recorder
from rosbridge_sim.environments.actions import MAX_ACCEL, MAX_STEER
from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.environments.observations import observe
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.world.followers.self_driving import start_self_driving
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.worlds.worlds import Worlds

__all__ = ["PYTHON_SETTINGS", "drive_in_python"]

PYTHON_SETTINGS: Final = {"traffic": "traffic", "dynamics": "dynamics", "on_collision": "impacts"}
"""Settings that count without a server -> argument of `Worlds`."""

Command = Mapping[str, Any]
Decide = Callable[[Worlds], Command]


def drive_in_python(loaded: LoadedJob, driver: DriverItem, runs: Sequence[Run]) -> list[Outcome]:
    """Drive runs of one driver, together where their settings are equal.

    Args:
        loaded: the campaign.
        driver: of all of them; no program.

    Returns:
        An outcome for each.
    """
    found: dict[int, Outcome] = {}
    groups: dict[str, list[tuple[Run, RunValues]]] = {}
    for run in runs:
        try:
            values = loaded.campaign.values_of(run)
            groups.setdefault(repr((values.settings, values.vehicle)), []).append((run, values))
        except DocumentError as error:
            found[run.number] = _broken(loaded, run, str(error))
    for group in groups.values():
        outcomes = _drive(loaded, driver, group)
        if outcomes is None:
            outcomes = [each for one in group for each in _drive(loaded, driver, [one]) or ()]
        for (run, _), outcome in zip(group, outcomes, strict=True):
            found[run.number] = outcome
    return [found[run.number] for run in runs]


def _broken(loaded: LoadedJob, run: Run, why: str) -> Outcome:
    return Outcome(_recorder(loaded, run).trace, error=why)


def _recorder(loaded: LoadedJob, run: Run) -> Recorder:
    campaign = loaded.campaign
    return Recorder(campaign.document.seconds, campaign.end_when, names_of(run))


def _drive(loaded: LoadedJob, driver: DriverItem, group: Sequence[tuple[Run, RunValues]]) -> list[Outcome] | None:
    """Drive worlds together; None if several failed together, and must be driven alone."""
    output = KeptOutput()
    try:
        worlds = _make_worlds(loaded, group)
        with _captured(output):
            decide = _decider(loaded, driver, worlds, [run for run, _ in group])
    except Exception as error:  # noqa: BLE001 - the user's code, or the user's scenario
        if len(group) > 1:
            return None
        outcome = _broken(loaded, group[0][0], _why(error))
        outcome.log = output.text + ("" if isinstance(error, DocumentError) else _trace_of(error))
        return [outcome]
    recorders = [_recorder(loaded, run) for run, _ in group]
    outcomes = [Outcome(recorder.trace) for recorder in recorders]
    active, frame = list(range(len(group))), 0
    while active:
        try:
            commands = None
            if decide is not None and frame % driver.every == 0:
                with _captured(output):
                    commands = decide(worlds)
            worlds.step(commands)
        except Exception as error:  # noqa: BLE001 - the user's code
            if len(group) > 1:
                return None
            outcomes[0].error = _why(error)
            output.write(_trace_of(error))
            _finish(outcomes[0], worlds, 0)
            break
        frame += 1
        active = [i for i in active if not _note(recorders[i], outcomes[i], worlds, i)]
    for outcome in outcomes:
        outcome.log = output.text
    return outcomes


def _note(recorder: Recorder, outcome: Outcome, worlds: Worlds, i: int) -> bool:
    """Note a frame of one world; return whether its drive has ended."""
    try:
        is_over = recorder.take(worlds.world(i))
    except DocumentError as error:
        outcome.error, is_over = str(error), True
    if is_over:
        _finish(outcome, worlds, i)
    return is_over


def _finish(outcome: Outcome, worlds: Worlds, i: int) -> None:
    outcome.state_hash = worlds.world(i).digest()
    if outcome.trace.rows:
        outcome.roads = find_roads(worlds.world(i), outcome.trace)


def _make_worlds(loaded: LoadedJob, group: Sequence[tuple[Run, RunValues]]) -> Worlds:
    """Return the worlds of some runs.

    Raises:
        DocumentError: a scenario or a setting cannot be used.
    """
    values = group[0][1]
    options: dict[str, Any] = {}
    for key, value in values.settings.items():
        if key not in PYTHON_SETTINGS:
            raise DocumentError(
                f"setting.{key}: drivers in Python have no server; they know {', '.join(PYTHON_SETTINGS)}. A driver"
                " with a command has all settings"
            )
        options[PYTHON_SETTINGS[key]] = value == "impact" if key == "on_collision" else value
    if options.get("dynamics", "kinematic") not in {"kinematic", "single-track"}:
        raise DocumentError(f"setting.dynamics: expected single-track or kinematic, got {options['dynamics']!r}")
    traffic = options.get("traffic", 0)
    if not isinstance(traffic, int) or not 0 <= traffic <= MAX_TRAFFIC:
        raise DocumentError(f"setting.traffic: expected a whole number from 0 to {MAX_TRAFFIC:,}, got {traffic!r}")
    scenarios = [loaded.scenario(run.scenario, each.scenario) for run, each in group]
    try:
        worlds = Worlds(
            scenarios, seed=[run.seed for run, _ in group], vehicle=values.vehicle, library=loaded.library, **options
        )
    except ValueError as error:
        raise DocumentError(str(error)) from None
    for i in range(worlds.num_worlds):
        if not len(worlds.world(i).rows(Kind.EGO)):
            raise DocumentError(f"{group[i][0].scenario}: expected a scenario with an ego")
    return worlds


MAX_TRAFFIC: Final = 10_000


def _decider(loaded: LoadedJob, driver: DriverItem, worlds: Worlds, runs: Sequence[Run]) -> Decide | None:
    """Return what gives commands; None for egos that drive themselves."""
    if driver.own is not None:
        for i, run in enumerate(runs):
            world = worlds.world(i)
            speed = math.inf if driver.speed is None else driver.speed
            if not start_self_driving(world, world.rows(Kind.EGO).item(0), desired_speed=speed):
                raise DocumentError(f"{run.scenario}: our own driver needs an ego on a lane, and along it")
        return None
    function = loaded.drivers_function(driver)
    if isinstance(function, type):
        function = function()  # an own one for each drive, or for each batch: it may keep a state
    if driver.policy is not None:
        task = DrivingTask(runs[0].scenario)

        def decide_policy(worlds: Worlds) -> Command:
            action = np.clip(np.asarray(function(observe(worlds, task)[0, 0]), dtype=np.float64), -1.0, 1.0)
            if action.shape != (2,):
                raise ValueError(f"expected an action of shape (2,), got {action.shape}")
            return {"steering": action[0] * MAX_STEER, "accel": action[1] * MAX_ACCEL}

        return decide_policy
    parameters = [names_of(run) for run in runs]

    def decide(worlds: Worlds) -> Command:
        command = function(Observation(worlds, parameters, is_single=not driver.batch))
        if not isinstance(command, Mapping):
            raise TypeError(f"expected a command such as {{'steering': 0.0, 'accel': 1.0}}, got {command!r:.60}")
        return {name: np.reshape(np.asarray(value, dtype=np.float64), (-1, 1)) for name, value in command.items()}

    return decide


def _why(error: Exception) -> str:
    if isinstance(error, DocumentError):
        return str(error)
    text = str(error).partition("\n")[0][:200]
    return (
        f"the driver failed: {type(error).__name__}: {text}" if text else f"the driver failed: {type(error).__name__}"
    )


def _trace_of(error: Exception) -> str:
    return "".join(traceback.format_exception(error))


@contextlib.contextmanager
def _captured(output: KeptOutput) -> Iterator[None]:
    """Keep what the user's code prints."""
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        yield

"""Drives without a server: our own driver, Python functions and policies, one world or many of them together.

`Worlds` moves them in one step. Where the campaign reads topics, or sets what `Worlds` does not know, each has the node
of a simulator instead, see `NodeWorlds`.

World i of a batch moves as it would alone, to the bit, so a batch changes nothing in the table. If a function that
drives many worlds raises an error, each of them is driven again alone: then the error belongs to its own run.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from rosbridge_sim.campaign_runs.job import LoadedJob
from rosbridge_sim.campaign_runs.observation import Observation
from rosbridge_sim.campaign_runs.outcome import KeptOutput, Outcome, told_error, told_trace
from rosbridge_sim.campaign_runs.simulator_options import (
    WORLD_SETTINGS,
    check_settings,
    make_work_folder,
    simulator_options,
)
from rosbridge_sim.campaign_runs.watched_drive import WatchedDrive
from rosbridge_sim.campaigns.campaign import RunValues, names_of
from rosbridge_sim.campaigns.campaign_model import DriverItem
from rosbridge_sim.campaigns.run_results import Run
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.shell.assembly import make_simulator_node, mistakes_of_items
from rosbridge_sim.shell.config.loading import check_options
from rosbridge_sim.simulator.simulator_node import SimulatorNode
from rosbridge_sim.world.followers.self_driving import start_self_driving
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.worlds.drivable_worlds import Commands, DrivableWorlds
from rosbridge_sim.worlds.worlds import Worlds

Command = Mapping[str, Any]
Decide = Callable[[Any], Command]
"""Returns commands for worlds."""


def drive_in_python(loaded: LoadedJob, driver: DriverItem, runs: Sequence[Run]) -> list[Outcome]:
    """Drive runs of one driver, together where their settings are equal.

    Args:
        driver: of all of them; no program.
    """
    found: dict[int, Outcome] = {}
    groups: dict[str, list[tuple[Run, RunValues]]] = {}
    for run in runs:
        try:
            values = loaded.campaign.values_of(run)
            groups.setdefault(repr((values.settings, values.vehicle)), []).append((run, values))
        except DocumentError as error:
            found[run.number] = WatchedDrive(loaded.campaign, run).outcome
            found[run.number].error = str(error)
    for group in groups.values():
        outcomes = _drive(loaded, driver, group)
        if outcomes is None:
            outcomes = [each for one in group for each in _drive(loaded, driver, [one]) or ()]
        for (run, _), outcome in zip(group, outcomes, strict=True):
            found[run.number] = outcome
    return [found[run.number] for run in runs]


def _drive(loaded: LoadedJob, driver: DriverItem, group: Sequence[tuple[Run, RunValues]]) -> list[Outcome] | None:
    """Drive worlds together; None if several failed together, and must be driven alone."""
    output = KeptOutput()
    drives = [WatchedDrive(loaded.campaign, run) for run, _ in group]
    try:
        worlds = _make_worlds(loaded, group, drives)
        with _captured(output):
            decide = _decider(loaded, driver, worlds, [run for run, _ in group])
    except (Exception, SystemExit) as error:  # noqa: BLE001 - the user's code, or the user's scenario
        outcome = _failed(drives, error)
        if outcome is not None:
            outcome.log = output.text + ("" if isinstance(error, DocumentError) else told_trace(error))
        return None if outcome is None else [outcome]
    active, frame = list(range(len(group))), 0
    while active:
        try:
            commands = None
            if decide is not None and frame % driver.every == 0:
                with _captured(output):
                    commands = decide(worlds)
            worlds.step(commands)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - the user's code
            outcome = _failed(drives, error)
            if outcome is None:
                return None
            output.write(told_trace(error))
            drives[0].finish(worlds.world(0))
            break
        frame += 1
        ended = [i for i in active if drives[i].take(worlds.world(i))]
        for i in ended:
            drives[i].finish(worlds.world(i))
        active = [i for i in active if i not in ended]
    for drive in drives:
        drive.outcome.log = output.text
    return [drive.outcome for drive in drives]


def _failed(drives: Sequence[WatchedDrive], error: BaseException) -> Outcome | None:
    """Return the outcome of a drive that failed; None if several did, whose folders are removed."""
    if len(drives) == 1:
        drives[0].outcome.error = _why(error)
        return drives[0].outcome
    for drive in drives:
        if drive.outcome.work is not None:
            shutil.rmtree(drive.outcome.work, ignore_errors=True)
    return None


def _make_worlds(
    loaded: LoadedJob, group: Sequence[tuple[Run, RunValues]], drives: Sequence[WatchedDrive]
) -> Worlds | NodeWorlds:
    """Return the worlds of some runs.

    Raises:
        DocumentError: a scenario or a setting cannot be used.
        OSError: the disk takes no more.
    """
    values, runs = group[0][1], [run for run, _ in group]
    check_settings(values.settings, "", has_server=False)
    needs_nodes = bool(loaded.campaign.fields) or not values.settings.keys() <= WORLD_SETTINGS.keys()
    scenarios = [] if needs_nodes else [loaded.scenario(run.scenario, each.scenario) for run, each in group]
    if needs_nodes or any(scenario.story is not None for scenario in scenarios):
        for drive, run in zip(drives, runs, strict=True):
            drive.outcome.work = make_work_folder(loaded, run)
        return NodeWorlds(loaded, drives, runs)
    return _make_fast_worlds(loaded, group, scenarios)


def _make_fast_worlds(
    loaded: LoadedJob, group: Sequence[tuple[Run, RunValues]], scenarios: Sequence[Scenario]
) -> Worlds:
    values = group[0][1]
    settings = check_options(values.settings)
    options: dict[str, Any] = {WORLD_SETTINGS[key]: getattr(settings, key) for key in values.settings}
    if "impacts" in options:
        options["impacts"] = options["impacts"] == "impact"
    try:
        return Worlds(
            scenarios, seed=[run.seed for run, _ in group], vehicle=values.vehicle, library=loaded.library, **options
        )
    except ValueError as error:
        raise DocumentError(str(error)) from None


def _decider(loaded: LoadedJob, driver: DriverItem, worlds: Worlds | NodeWorlds, runs: Sequence[Run]) -> Decide | None:
    """Return what gives commands; None for egos that drive themselves."""
    if driver.own is not None:
        _let_drive(worlds, math.inf if driver.speed is None else driver.speed, runs)
        return None
    function = loaded.drivers_function(driver)
    if isinstance(function, type):
        function = function()  # an own one for each drive, or for each batch: it may keep a state
    if driver.policy is not None:
        return _policy_decider(function, runs[0].scenario)
    parameters = [names_of(run) for run in runs]

    def decide(worlds: DrivableWorlds) -> Command:
        command = function(Observation(worlds, parameters, is_single=not driver.batch))
        if not isinstance(command, Mapping):
            raise TypeError(f"expected a command such as {{'steering': 0.0, 'accel': 1.0}}, got {command!r:.60}")
        return {name: np.reshape(np.asarray(value, dtype=np.float64), (-1, 1)) for name, value in command.items()}

    return decide


def _policy_decider(function: Callable[..., Any], scenario: str) -> Decide:
    """Return what gives the commands of a policy in one world.

    Args:
        function: from the observation `Lane` of the environments, (n,) float32, to its action, (2,) within -1..1.
        scenario: its name, or the path of its file.
    """
    # Here, since these need the extra `gym`, which campaigns without a policy do without.
    from rosbridge_sim.environments.action_kinds import MAX_ACCEL, MAX_STEER  # noqa: PLC0415
    from rosbridge_sim.environments.driving_task import DrivingTask  # noqa: PLC0415
    from rosbridge_sim.environments.observations import observe  # noqa: PLC0415

    task = DrivingTask(scenario)

    def decide(worlds: DrivableWorlds) -> Command:
        action = np.clip(np.asarray(function(observe(worlds, task)[0, 0]), dtype=np.float64), -1.0, 1.0)
        if action.shape != (2,):
            raise ValueError(f"expected an action of shape (2,), got {action.shape}")
        return {"steering": action[0] * MAX_STEER, "accel": action[1] * MAX_ACCEL}

    return decide


def _let_drive(worlds: Worlds | NodeWorlds, speed: float, runs: Sequence[Run]) -> None:
    """Let the first ego of each world follow the lanes, at most at a speed [m/s].

    Raises:
        DocumentError: one stands on no lane.
    """
    for i, run in enumerate(runs):
        if isinstance(worlds, NodeWorlds):
            is_driving = worlds.drive_first_ego(i, speed)
        else:
            world = worlds.world(i)
            is_driving = start_self_driving(world, world.rows(Kind.EGO).item(0), desired_speed=speed)
        if not is_driving:
            raise DocumentError(f"{run.scenario}: our own driver needs an ego on a lane, and along it")


def _why(error: BaseException) -> str:
    if isinstance(error, DocumentError):
        return str(error)
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:
        return f"{error.filename or 'the disk'}: {error.strerror}"
    return f"the driver failed: {told_error(error)}"


@contextlib.contextmanager
def _captured(output: KeptOutput) -> Iterator[None]:
    """Keep what the user's code prints. A copy of this process that it has made ends here: it would drive on, too."""
    number = os.getpid()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            yield
    finally:
        if os.getpid() != number:
            os._exit(0)


class NodeWorlds(DrivableWorlds):
    """The worlds of some simulators, which move together, with all topics and settings of a server, without sockets.

    A frame costs more than in `Worlds`, so they are used only for what `Worlds` lacks. The world of a node moves as
    that of `Worlds`, to the bit.

    Args:
        drives: of all runs; each hears the topics of its own simulator, and has a folder.

    Raises:
        DocumentError: a scenario or a setting cannot be used.
    """

    def __init__(self, loaded: LoadedJob, drives: Sequence[WatchedDrive], runs: Sequence[Run]) -> None:
        self._nodes = [_make_node(loaded, drive, run) for drive, run in zip(drives, runs, strict=True)]
        worlds = [node.world for node in self._nodes]
        super().__init__([world for world in worlds if isinstance(world, OneOfMany)])

    def step(self, commands: Commands | None = None) -> None:
        """Command the egos and move all worlds by one frame.

        Args:
            commands: as for `Worlds.step`; None for those of before.

        Raises:
            ValueError: as for `Worlds.step`. Nothing has moved.
        """
        if commands is not None:
            self.command(commands)
        for node in self._nodes:
            now = node.world.frame * self.dt
            node.context.stepper.compute(now, is_tick=True, is_last=True)

    def drive_first_ego(self, world: int, desired_speed: float) -> bool:
        """Let the first ego of a world follow the lanes; return False if it stands on no lane.

        Args:
            world: number of the world.
            desired_speed: speed that it wants [m/s].
        """
        return self._nodes[world].egos.first.drive_itself(desired_speed=desired_speed) is None


def _make_node(loaded: LoadedJob, drive: WatchedDrive, run: Run) -> SimulatorNode:
    assert drive.outcome.work is not None
    settings = check_options(simulator_options(loaded, run, drive.outcome.work), mistakes_of_items)
    _, store = loaded.types.read(settings)
    bus = Bus(store, is_strict=settings.strict_types)
    node = make_simulator_node(bus, settings, None, None, library=loaded.library_for(settings), make_world=OneOfMany)
    drive.listen(bus)
    return node

"""Worlds of drivers in Python with all topics and settings of a server: the simulator's node of each, without sockets.

A frame costs more than in `Worlds`, so they are used only for what `Worlds` lacks. The world of a node moves as that of
`Worlds`, to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence

from rosbridge_sim.campaign_runs.job import LoadedJob
from rosbridge_sim.campaign_runs.simulator_options import simulator_options
from rosbridge_sim.campaign_runs.watched_drive import WatchedDrive
from rosbridge_sim.campaigns.run_results import Run
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.shell.assembly import make_simulator_node, mistakes_of_items
from rosbridge_sim.shell.config.loading import check_options
from rosbridge_sim.simulator.simulator_node import SimulatorNode
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.worlds.drivable_worlds import Commands, DrivableWorlds


class NodeWorlds(DrivableWorlds):
    """The worlds of some simulators, which move together.

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

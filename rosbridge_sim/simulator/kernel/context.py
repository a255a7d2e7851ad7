"""Objects that the components of a simulator share. It is complete before the first component is made.

Each member is built from the members listed above it, so no code can use a part of the simulator that is not there
yet.
"""

from __future__ import annotations

from rosbridge_sim.simulator.kernel.command_wait import CommandWait
from rosbridge_sim.simulator.kernel.ego_interfaces import EgoInterfaces
from rosbridge_sim.simulator.kernel.frame_stepper import FrameStepper
from rosbridge_sim.simulator.kernel.late_work import LateWork
from rosbridge_sim.simulator.kernel.projection_import import ProjectionImport
from rosbridge_sim.simulator.kernel.scene_changes import SceneChanges
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts
from rosbridge_sim.simulator.kernel.sync_driver import SyncDriver


class SimulatorContext(SimulatorParts, eq=False):
    """The parts of a simulator, and what is made from them.

    Attributes:
        projection_import: imports what makes latitudes and longitudes.
        command_wait: has real time wait for commands, if that is chosen.
        stepper: computes one frame.
        sync_driver: carries out ticks and changes of the mode.
        late_work: what waits for turns of its own.
        ego_interfaces: topics and services of further egos.
        scene_changes: loads, resets and new egos.
    """

    projection_import: ProjectionImport
    command_wait: CommandWait
    stepper: FrameStepper
    sync_driver: SyncDriver
    late_work: LateWork
    ego_interfaces: EgoInterfaces
    scene_changes: SceneChanges

"""Objects that the components of a simulator share. It is complete before the first component is made.

Each member is built from the members listed above it, so no code can use a part of the simulator that is not there
yet. State that lasts from one frame to the next is in `world`, `scene`, `egos`, `sync`, `barrier`, `publishers`,
`pacer` and the components; the other members only act on it.
"""

from __future__ import annotations

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.simulator_participant import SimulatorParticipant
from rosbridge_sim.simulator.bus.warn_once import WarnOnce
from rosbridge_sim.simulator.bus.world_failure import WorldFailure
from rosbridge_sim.simulator.kernel.command_wait import CommandWait
from rosbridge_sim.simulator.kernel.ego_interfaces import EgoInterfaces
from rosbridge_sim.simulator.kernel.egos import EgoRegistry
from rosbridge_sim.simulator.kernel.frame_gate import FrameGate
from rosbridge_sim.simulator.kernel.frame_stepper import FrameStepper
from rosbridge_sim.simulator.kernel.hooks import Hooks
from rosbridge_sim.simulator.kernel.late_work import LateWork
from rosbridge_sim.simulator.kernel.projection_import import ProjectionImport
from rosbridge_sim.simulator.kernel.real_time_pacer import RealTimePacer
from rosbridge_sim.simulator.kernel.scene_changes import SceneChanges
from rosbridge_sim.simulator.kernel.simulation_time import SimulationTime
from rosbridge_sim.simulator.kernel.sync_driver import SyncDriver
from rosbridge_sim.simulator.kernel.sync_info import SyncInfo
from rosbridge_sim.simulator.kernel.tf_publisher import StaticTf
from rosbridge_sim.simulator.scene.load import Library
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_commands import SceneCommand
from rosbridge_sim.simulator.sync.barrier import Barrier
from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.world.state.world import World


class SimulatorContext(Record, eq=False):
    """Objects that the components share.

    Attributes:
        bus: has the simulator's topics and services; its stamp follows the world's frames.
        participant: their owner.
        world: the state of all entities; moved by `stepper` alone.
        library: source of scenarios and maps.
        convert: makes messages of the world, and reads controls.
        scene: the population and the map.
        egos: the ego vehicles, by number.
        sync: synchronous mode; components read it and submit commands that wait for a frame.
        barrier: clients that tick together; while it has members, it is the master of `sync`.
        hooks: moments at which components act.
        warnings: sends a warning once, for mistakes that a client may repeat.
        interfaces: the simulator's topics and services, by name.
        publishers: its output topics.
        failure: a bug of ours that has stopped the world.
        time: the stamps.
        pacer: the frames that real time owes.
        sync_info: publishes the mode.
        static_tf: publishes the frames that are fixed to the egos.
        gate: closed while something of the last frame is missing.
        projection_import: imports what makes latitudes and longitudes.
        command_wait: has real time wait for commands, if that is chosen.
        stepper: computes one frame.
        sync_driver: carries out ticks and changes of the mode.
        late_work: what waits for turns of its own.
        ego_interfaces: topics and services of further egos.
        scene_changes: loads, resets and new egos.
    """

    bus: Bus
    participant: SimulatorParticipant
    world: World
    library: Library
    convert: Converter
    scene: Scene
    egos: EgoRegistry
    sync: Sync[SceneCommand]
    barrier: Barrier
    hooks: Hooks
    warnings: WarnOnce
    interfaces: InterfaceRegistry
    publishers: Publishers
    failure: WorldFailure
    time: SimulationTime
    pacer: RealTimePacer
    sync_info: SyncInfo
    static_tf: StaticTf
    gate: FrameGate
    projection_import: ProjectionImport
    command_wait: CommandWait
    stepper: FrameStepper
    sync_driver: SyncDriver
    late_work: LateWork
    ego_interfaces: EgoInterfaces
    scene_changes: SceneChanges

"""What the components of a simulator share: built first, whole before the first component gets it.

The members are listed from the ground up: each is built from those above it, so nothing ever sees a part of the
simulator that is not there yet. State that lasts from one frame to the next is in `world`, `scene`, `egos`, `sync`,
`barrier`, `publishers`, `pacer` and the components; the other members only act on it.
"""

from __future__ import annotations

from dataclasses import dataclass

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.barrier import Barrier
from rosbridge_sim.morai.convert import Converter
from rosbridge_sim.morai.ego_interfaces import EgoInterfaces
from rosbridge_sim.morai.egos import EgoRegistry
from rosbridge_sim.morai.frame_stepper import FrameStepper
from rosbridge_sim.morai.hooks import Hooks
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.registry import InterfaceRegistry
from rosbridge_sim.morai.participant import SimulatorParticipant
from rosbridge_sim.morai.real_time_pacer import RealTimePacer
from rosbridge_sim.morai.scene import Library, Scene
from rosbridge_sim.morai.scene_changes import SceneChanges
from rosbridge_sim.morai.scene_commands import SceneCommand
from rosbridge_sim.morai.simulation_time import SimulationTime
from rosbridge_sim.morai.sync import Sync
from rosbridge_sim.morai.sync_driver import SyncDriver
from rosbridge_sim.morai.sync_info import SyncInfo
from rosbridge_sim.morai.tf_publisher import StaticTf
from rosbridge_sim.morai.warn_once import WarnOnce
from rosbridge_sim.morai.world_failure import WorldFailure
from rosbridge_sim.world.state import World

__all__ = ["SimulatorContext"]


@dataclass(frozen=True, slots=True, eq=False)
class SimulatorContext:
    """All that is shared.

    Attributes:
        bus: where the simulator's topics and services are; its stamp follows the world's frames.
        participant: their owner.
        world: the state of all entities; moved by `stepper` alone.
        library: where scenarios and maps come from.
        convert: makes messages of the world, and reads controls.
        scene: the population and the map.
        egos: who drives, by number.
        sync: synchronous mode, to be read, and to have commands wait for their frame.
        barrier: clients that tick together; its members lead synchronous mode while there are any.
        hooks: moments that components act on.
        warnings: for what a client may do many times.
        interfaces: all that the simulator has on the bus, by its names.
        publishers: its output topics.
        failure: a bug of ours that has stopped the world.
        time: what is stamped.
        pacer: the frames that real time owes.
        sync_info: publishes the mode.
        static_tf: publishes what stands on the egos.
        stepper: computes one frame.
        sync_driver: ticks, and all that changes the mode.
        ego_interfaces: the names of further egos.
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
    stepper: FrameStepper
    sync_driver: SyncDriver
    ego_interfaces: EgoInterfaces
    scene_changes: SceneChanges

"""Objects of a simulator that need none of those in `context.py`, which are made from them.

State that lasts from one frame to the next is in `world`, `scene`, `egos`, `sync`, `barrier`, `publishers` and `pacer`;
the other members only act on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.messages.convert import Converter, late_maker
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.simulator_participant import SimulatorParticipant
from rosbridge_sim.simulator.bus.warn_once import WarnOnce
from rosbridge_sim.simulator.bus.world_failure import WorldFailure
from rosbridge_sim.simulator.egos.ego_registry import EgoRegistry
from rosbridge_sim.simulator.egos.tf_publisher import StaticTf
from rosbridge_sim.simulator.kernel.frame_gate import FrameGate
from rosbridge_sim.simulator.kernel.hooks import Hooks
from rosbridge_sim.simulator.kernel.real_time_pacer import RealTimePacer
from rosbridge_sim.simulator.kernel.simulation_time import SimulationTime
from rosbridge_sim.simulator.kernel.sync_info import SyncInfo
from rosbridge_sim.simulator.plain.reading import Reader
from rosbridge_sim.simulator.scene.load import Library
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_commands import SceneCommand
from rosbridge_sim.simulator.sync.barrier import Barrier
from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.world.state.world import World


class SimulatorParts(Record, eq=False):
    """Objects that the components share, and that those who move the world are made from.

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
        reader: does what would delay all clients: reads documents, draws, imports.
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
    reader: Reader

    def maker(self, type_name: str, names: str) -> Callable[..., Any]:
        """Return a function that makes messages of a type; see `late_maker`."""
        return late_maker(self.bus.store, type_name, names)

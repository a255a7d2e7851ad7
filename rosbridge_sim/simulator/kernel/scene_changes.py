"""Changes of the whole scene: load a scenario, reset the world, add egos.

Each change is done completely or not at all. It happens between two frames or, as a command of synchronous mode,
before a frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from rosbridge_sim.errors import FieldError, GraphError, PeerError
from rosbridge_sim.morai.messages.command_parsing import EgoSetting
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.network_settings import NetworkSettings
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.kernel.ego import Ego
from rosbridge_sim.simulator.kernel.ego_interfaces import EgoInterfaces
from rosbridge_sim.simulator.kernel.egos import EgoRegistry
from rosbridge_sim.simulator.kernel.frame_stepper import FrameStepper
from rosbridge_sim.simulator.kernel.hooks import Hooks
from rosbridge_sim.simulator.kernel.simulation_time import SimulationTime
from rosbridge_sim.simulator.kernel.sync_driver import SyncDriver
from rosbridge_sim.simulator.kernel.sync_info import SyncInfo
from rosbridge_sim.simulator.kernel.tf_publisher import StaticTf
from rosbridge_sim.simulator.scene.load import Load
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_commands import SceneCommand, moves
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, FIRST_FREE_EGO, MAX_EGOS, MAX_ENTITIES
from rosbridge_sim.simulator.sync.sync import Sync


@dataclass(eq=False, kw_only=True, slots=True)
class SceneChanges:
    """Loads scenarios, resets the world and adds egos. It holds no state of its own; the scene and the egos do.

    Attributes:
        scene: has the world, and changes it.
        egos: are added and removed together with the scene.
        interfaces: get other network settings with a scenario.
        publishers: forget the messages that real time was to repeat.
        hooks: `on_scene_change`, `on_reset` and `on_new_scene` are called.
        sync: forgets what waits for frames.
        sync_driver: pauses the world.
        sync_info: announces the new frame.
        stepper: tells whether frames are being computed.
        time: follows the new frame.
        static_tf: announces the frames that are fixed to the egos.
    """

    scene: Scene
    egos: EgoRegistry
    ego_interfaces: EgoInterfaces
    interfaces: InterfaceRegistry
    publishers: Publishers
    hooks: Hooks
    sync: Sync[SceneCommand]
    sync_driver: SyncDriver
    sync_info: SyncInfo
    stepper: FrameStepper
    time: SimulationTime
    static_tf: StaticTf

    def carry_out(self, load: Load, *, is_pausing: bool, now: float, network: NetworkSettings | None = None) -> None:
        """Load a prepared scenario.

        Args:
            load: from `Scene.prepare`.
            is_pausing: pause the world afterwards.
            network: network settings from then on; None keeps the current ones.

        Raises:
            DocumentError: the world would be too full; then nothing has changed, except that a replay has ended. Or a
                name in
                the network settings cannot be used; then nothing has changed.
        """
        if network is not None:
            self.interfaces.check(network)
        for prepare in self.hooks.on_scene_change:
            prepare(now)
        egos = self.egos
        poses = [ego.pose for ego in egos]
        self.scene.carry_out(load)
        egos.keep_odometry(poses)
        if load.egos:
            egos.first.reset_controls()
        gone = [ego for ego in egos if not ego.is_there]
        for ego in gone:
            self.ego_interfaces.drop(ego, now)
        egos.drop(gone)
        for ego in egos:
            ego.resume()
        if network is not None:
            self.interfaces.change(network, now)
        egos.forget_statuses()
        self.static_tf.announce(now)
        if is_pausing:
            self.sync_driver.pause(now)
        for follow in self.hooks.on_new_scene:
            follow(now)

    def reset(self, seed: int | None, now: float) -> None:
        """Reset the world to its start: the same calls give the same bytes again. Synchronous mode stays as it is.

        Args:
            seed: random seed; None keeps the current one.

        Raises:
            GraphError: frames are being computed, for example because a subscriber asks for a reset when it gets a
                message.
        """
        if self.stepper.is_moving:
            raise GraphError("the world is moving")
        for prepare in self.hooks.on_scene_change:
            prepare(now)
        egos = self.egos
        for ego in list(egos)[1:]:
            self.ego_interfaces.drop(ego, now)
        self.scene.reset(seed)
        egos.reset()
        for forget in self.hooks.on_reset:
            forget()
        self.publishers.forget_repeats()
        self.time.follow()
        egos.forget_statuses()
        self.sync_info.announce(now)
        self.static_tf.announce_again(now)  # the latched message is of frame 0 again
        for follow in self.hooks.on_new_scene:
            follow(now)
        self.sync_driver.forget(now)  # last, because the ticks that waited are answered with the new frame

    def add_egos(self, settings: Sequence[EgoSetting], now: float, *, is_last: bool = True) -> None:
        """Add further egos to the world, each with its own topics and services; all of them or none.

        Args:
            settings: number, pose and gear of each ego.
            is_last: no others follow in the same change. Fixed frames are announced with the last ones, because each
                announcement has those of all egos.

        Raises:
            FieldError: a number that no ego can have, or too many egos.
            GraphError: a client has given one of the topics another type.
        """
        egos, world = self.egos, self.scene.world
        for setting in settings:
            if setting.index < FIRST_FREE_EGO:
                raise FieldError(f"ego_index: expected {FIRST_EGO}, {FIRST_FREE_EGO} or more, got {setting.index}")
        if len(egos) + len(settings) > MAX_EGOS:
            raise FieldError(f"ego_index: there are {MAX_EGOS} egos at most")
        if len(world) + len(settings) > MAX_ENTITIES:
            raise FieldError(f"ego_index: the world holds {MAX_ENTITIES:,} at most")
        added: list[Ego] = []
        try:
            for setting in settings:
                gear = setting.gear or egos.first.gear
                uid = self.scene.add_ego(egos.first.uid, setting.pose, gear, setting.model)
                ego = egos.create(setting.index, uid)
                added.append(ego)
                self.ego_interfaces.bind(ego)
        except PeerError:
            for ego in added:
                self.ego_interfaces.drop(ego, now)
                world.remove(ego.uid)
            raise
        egos.add(added)
        if is_last:
            self.static_tf.announce(now)

    def drop_egos(self, gone: Sequence[Ego], now: float) -> None:
        """Take further egos away, with their topics and services. Commands that wait for them are forgotten.

        Args:
            gone: none of them is the first.
        """
        for ego in gone:
            self.ego_interfaces.drop(ego, now)
            if ego.is_there:
                self.scene.world.remove(ego.uid)
            self.sync.drop(partial(moves, uid=ego.uid))
        self.egos.drop(gone)
        self.static_tf.announce(now)

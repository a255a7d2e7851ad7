"""Changes of the whole scene: load a scenario, reset the world, add egos.

Each change is done completely or not at all. It happens between two frames or, as a command of synchronous mode,
before a frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from rosbridge_sim.errors import FieldError, GraphError, PeerError
from rosbridge_sim.morai.messages.command_parsing import EgoSetting
from rosbridge_sim.simulator.bus.network_settings import NetworkSettings
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.ego_interfaces import EgoInterfaces
from rosbridge_sim.simulator.kernel.frame_stepper import FrameStepper
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts
from rosbridge_sim.simulator.kernel.sync_driver import SyncDriver
from rosbridge_sim.simulator.scene.load import Load
from rosbridge_sim.simulator.scene.scene_commands import moves
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, FIRST_FREE_EGO, MAX_EGOS, MAX_ENTITIES


class SceneChanges:
    """Loads scenarios, resets the world and adds egos. It holds no state of its own; the scene and the egos do."""

    def __init__(
        self, parts: SimulatorParts, stepper: FrameStepper, sync_driver: SyncDriver, ego_interfaces: EgoInterfaces
    ) -> None:
        self._parts, self._stepper = parts, stepper
        self._sync_driver, self._ego_interfaces = sync_driver, ego_interfaces

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
            self._parts.interfaces.check(network)
        for prepare in self._parts.hooks.on_scene_change:
            prepare(now)
        egos = self._parts.egos
        poses = [ego.pose for ego in egos]
        self._parts.scene.carry_out(load)
        egos.keep_odometry(poses)
        if load.egos:
            egos.first.reset_controls()
        gone = [ego for ego in egos if not ego.is_there]
        for ego in gone:
            self._ego_interfaces.drop(ego, now)
        egos.drop(gone)
        for ego in egos:
            ego.resume()
        if network is not None:
            self._parts.interfaces.change(network, now)
        egos.forget_statuses()
        self._parts.static_tf.announce(now)
        if is_pausing:
            self._sync_driver.pause(now)
        for follow in self._parts.hooks.on_new_scene:
            follow(now)

    def reset(self, seed: int | None, now: float) -> None:
        """Reset the world to its start: the same calls give the same bytes again. Synchronous mode stays as it is.

        Args:
            seed: random seed; None keeps the current one.

        Raises:
            GraphError: frames are being computed, for example because a subscriber asks for a reset when it gets a
                message.
        """
        if self._stepper.is_moving:
            raise GraphError("the world is moving")
        for prepare in self._parts.hooks.on_scene_change:
            prepare(now)
        egos = self._parts.egos
        for ego in list(egos)[1:]:
            self._ego_interfaces.drop(ego, now)
        self._parts.scene.reset(seed)
        egos.reset()
        for forget in self._parts.hooks.on_reset:
            forget()
        self._parts.publishers.forget_repeats()
        self._parts.time.follow()
        egos.forget_statuses()
        self._parts.sync_info.announce(now)
        self._parts.static_tf.announce_again(now)  # the latched message is of frame 0 again
        for follow in self._parts.hooks.on_new_scene:
            follow(now)
        self._sync_driver.forget(now)  # last, because the ticks that waited are answered with the new frame

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
        egos, world = self._parts.egos, self._parts.scene.world
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
                uid = self._parts.scene.add_ego(egos.first.uid, setting.pose, gear, setting.model)
                ego = egos.create(setting.index, uid)
                added.append(ego)
                self._ego_interfaces.bind(ego)
        except PeerError:
            for ego in added:
                self._ego_interfaces.drop(ego, now)
                world.remove(ego.uid)
            raise
        egos.add(added)
        if is_last:
            self._parts.static_tf.announce(now)

    def drop_egos(self, gone: Sequence[Ego], now: float) -> None:
        """Take further egos away, with their topics and services. Commands that wait for them are forgotten.

        Args:
            gone: none of them is the first.
        """
        for ego in gone:
            self._ego_interfaces.drop(ego, now)
            if ego.is_there:
                self._parts.scene.world.remove(ego.uid)
            self._parts.sync.drop(partial(moves, uid=ego.uid))
        self._parts.egos.drop(gone)
        self._parts.static_tf.announce(now)

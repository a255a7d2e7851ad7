"""Commands for egos and vehicles that clients publish: control, lamps, poses, ghosts.

A wrong message is reported to its sender and has no effect at all. A correct message is ignored if the mode is
synchronous or another mode drives the ego. Such messages arrive fifty times a second, so each client gets one warning.

*Ghosts* are placed by a client, frame by frame. No physics moves them, and their speed is the one that the client
sends. An ego is a ghost from its first GhostMessage until the next CtrlCmd, teleport or change of its control mode. A
vehicle that has become a ghost stays one.
"""

from __future__ import annotations

import logging
from collections.abc import Generator
from functools import partial
from typing import Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import BodyLimits
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.command_parsing import (
    AUTO_MODE,
    EgoSetting,
    NpcGhosts,
    ego_settings,
    ghost_pose,
    lamps_of,
    npc_ghosts,
)
from rosbridge_sim.morai.messages.control import GEARS, Control
from rosbridge_sim.records import replace
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import CtrlMode, Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.morai_services.control_units import warn_of_units
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.scene.ghosts import Ghosts
from rosbridge_sim.simulator.scene.scene_commands import moves
from rosbridge_sim.simulator.scene.scene_limits import MAX_EGOS, MAX_ENTITIES
from rosbridge_sim.world.state.commands import speed_in_gear
from rosbridge_sim.world.state.world import Gear

MANY_GHOSTS: Final = 2_000
"""More vehicles in one message are placed in turns of their own: to decode 2,000 takes a millisecond, to read them
another one, and to place them three."""

_GHOST_LIMITS: Final = BodyLimits(
    num_bytes=10 * 2**20, containers=3 * MAX_ENTITIES + 100, texts=16 * MAX_ENTITIES, values=16 * MAX_ENTITIES
)
"""Of a message with as many vehicles as the world holds: each has 0.4 kB, 3 objects, 15 names and texts, 15 values."""

_log = logging.getLogger("rosbridge_sim.morai")


class CommandTopics(Component):
    """Component of the input topics, except those of synchronous mode."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._ghosts = Ghosts(context.world, context.scene, context.egos.numbers)
        context.hooks.on_reset.append(self._ghosts.trails.clear)

    def save_state(self) -> PlainData:
        """Return what is known of ghosts."""
        return self._ghosts.trails.save_state()

    def load_state(self, data: PlainData, now: float) -> None:
        """See `Component`."""
        del now
        self._ghosts.trails.load_state(data)

    def bind(self, bindings: SubscribersServices) -> None:
        """Subscribe to the topics for all egos and vehicles."""
        bindings.listen("ego_setting", "MultiEgoSetting", partial(self._ego_setting, bindings))
        bindings.listen("NpcGhost_Topic", "NpcGhostCmd", partial(self._npc_ghosts, bindings), limits=_GHOST_LIMITS)

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Subscribe to the topics of one ego; the first ego has two names for its control."""
        names = ("ctrl_cmd", "ctrl_cmd_0") if ego is self._context.egos.first else ("ctrl_cmd",)
        for name in names:
            bindings.listen(name, "CtrlCmd", partial(self._ctrl_cmd, ego, bindings, name))
        bindings.listen("ghost_ctrl_cmd", "GhostMessage", partial(self._ghost, ego, bindings))
        bindings.listen("lamps", "Lamps", partial(self._lamps, ego))

    def _ctrl_cmd(
        self, ego: Ego, bindings: SubscribersServices, name: str, command: Struct, sender: Participant, _now: float
    ) -> None:
        control = self._context.convert.control(command)
        if self.drive(ego, bindings, name, control, sender, message=command):
            steering, warnings = self._context.convert.steering, self._context.warnings
            warn_of_units(control, steering, bindings.topic(name), sender, warnings)

    def drive(
        self,
        ego: Ego,
        bindings: SubscribersServices,
        name: str,
        control: Control,
        sender: Participant,
        *,
        message: Struct,
    ) -> bool:
        """Apply a command of a client to an ego, if it may move the ego now; else warn it, once.

        Args:
            name: default name of the topic that it came by.
            control: in the world's units.

        Returns:
            True if it was applied.
        """
        if not self._is_external(ego):
            self._decline(ego, bindings, name, bindings.service("SyncModeCtrlCmd"), sender)
            return False
        ego.control(control)
        ego.commander, ego.command_frame = sender, self._context.world.frame
        self._context.command_wait.note(ego, message)
        return True

    def _ghost(
        self, ego: Ego, bindings: SubscribersServices, message: Struct, sender: Participant, _now: float
    ) -> None:
        pose = ghost_pose(message)
        if self._is_external(ego):
            ego.place_as_ghost(pose)
            ego.commander = sender
            self._context.command_wait.note(ego, message)
        else:
            instead = self._context.interfaces.name_of(InterfaceKind.SUBSCRIBER, "/ego_setting")
            self._decline(ego, bindings, "ghost_ctrl_cmd", instead, sender)

    def _npc_ghosts(self, bindings: SubscribersServices, message: Struct, sender: Participant, _now: float) -> None:
        """Place vehicles. This works in synchronous mode too, because they are not the ego."""
        if len(message.npc_list) <= MANY_GHOSTS:
            self._place_ghosts(bindings, npc_ghosts(message, MAX_ENTITIES), sender)
        else:
            parts = self._place_many_ghosts(bindings, message, sender)
            self._context.late_work.do(parts, sender, bindings.topic("NpcGhost_Topic"))

    def _place_many_ghosts(
        self, bindings: SubscribersServices, message: Struct, sender: Participant
    ) -> Generator[None, None, None]:
        """Place vehicles in parts: read the message, then place all of them at once."""
        ghosts = npc_ghosts(message, MAX_ENTITIES)
        yield
        self._context.interfaces.check_open()  # the world may have failed meanwhile
        self._place_ghosts(bindings, ghosts, sender)

    def _place_ghosts(self, bindings: SubscribersServices, ghosts: NpcGhosts, sender: Participant) -> None:
        if not self._is_replaying(bindings, "NpcGhost_Topic", sender):
            self._ghosts.place(ghosts)
            self._context.egos.forget_statuses()

    def _is_external(self, ego: Ego) -> bool:
        """Return whether a client may move this ego now."""
        return not (ego.moved_by or self._context.sync.is_on) and ego.ctrl_mode is CtrlMode.EXTERNAL

    def _decline(self, ego: Ego, bindings: SubscribersServices, name: str, instead: str, sender: Participant) -> None:
        """Warn a client that it may not move this ego now, and name what it can use instead."""
        topic = bindings.topic(name)
        if ego.moved_by:
            why = f"{topic} is ignored while a {ego.moved_by} moves ego {ego.index}"
        elif self._context.sync.is_on:
            why = f"{topic} is ignored in synchronous mode: use {instead}"
        else:
            service = bindings.service("Service_MoraiEventCmd")
            why = f"{topic} is ignored: ctrl_mode is {ego.ctrl_mode.name}; set 3 by {service}"
        self._context.warnings.warn(sender, why)

    def _is_replaying(self, bindings: SubscribersServices, name: str, sender: Participant) -> bool:
        """Return whether a recording is replayed; if so, warn the client, because its message is ignored."""
        is_replaying = self._context.scene.is_replaying
        if is_replaying:
            self._context.warnings.warn(sender, f"{bindings.topic(name)} is ignored while a recording is replayed")
        return is_replaying

    def _lamps(self, ego: Ego, message: Struct, _sender: Participant, _now: float) -> None:
        ego.turn_signal, ego.emergency_signal = lamps_of(message)

    def _ego_setting(self, bindings: SubscribersServices, message: Struct, sender: Participant, now: float) -> None:
        """Place egos; an ego with an unknown number is added to the world."""
        if self._is_replaying(bindings, "ego_setting", sender):
            return
        context, topic = self._context, bindings.topic("ego_setting")
        settings = [
            (self._with_speed_in_gear(setting), _ctrl_mode(setting)) for setting in ego_settings(message, MAX_EGOS)
        ]
        self._warn_of_settings(message, topic, sender)
        context.scene_changes.add_egos(
            [setting for setting, _ in settings if context.egos.find(setting.index) is None], now
        )
        for setting, ctrl_mode in settings:
            ego = context.egos.find(setting.index)
            assert ego is not None
            is_itself = ctrl_mode is CtrlMode.AUTONOMOUS  # this mode needs a lane, so the ego is placed first
            if ctrl_mode is not None and not is_itself:
                ego.set_ctrl_mode(ctrl_mode)
            ego.teleport(setting.pose, setting.gear)
            num_dropped = context.sync.drop(partial(moves, uid=ego.uid))
            if num_dropped:
                _log.info("%s: ego %d is reset, %d waiting commands dropped", topic, ego.index, num_dropped)
            if is_itself:
                why = ego.set_ctrl_mode(CtrlMode.AUTONOMOUS)
                if why is not None:
                    sender.notify("warning", f"{topic}: {why}")
            if setting.lamps is not None:
                ego.turn_signal, ego.emergency_signal = setting.lamps
        context.egos.forget_statuses()

    def _with_speed_in_gear(self, setting: EgoSetting) -> EgoSetting:
        """Return a setting whose speed has the direction of its gear, or of the gear that it leaves.

        Raises:
            FieldError: it would drive backwards in D.
        """
        egos = self._context.egos
        gear = setting.gear or (egos.find(setting.index) or egos.first).gear
        try:
            speed = speed_in_gear(setting.pose.speed, gear)
        except ValueError as error:
            raise FieldError(f"morai_msgs/MultiEgoSetting.velocity of ego {setting.index}: {error}") from None
        return replace(setting, pose=replace(setting.pose, speed=speed))

    def _warn_of_settings(self, message: Struct, topic: str, sender: Participant) -> None:
        """Warn a client, once each, of values that do something else than they seem to."""
        warn = partial(self._context.warnings.warn, sender)
        if 0 in message.gear:
            warn(f"{topic}: gear 0 leaves the gear as it is; expected {GEARS}, or -1 to leave it")
        if 0 in message.ctrl_mode:
            warn(f"{topic}: ctrl_mode 0 leaves the mode as it is; expected 1 (keyboard) or 16 (automatic)")
        if any(
            gear == Gear.REVERSE and speed > 0.0 for gear, speed in zip(message.gear, message.velocity, strict=True)
        ):
            warn(f"{topic}: in gear 2 (R) a velocity is driven backwards, whatever its sign")


def _ctrl_mode(setting: EgoSetting) -> CtrlMode | None:
    """Return the mode that is to drive the ego; None for 0, which leaves the mode as it is.

    Raises:
        FieldError: there is no such mode.
    """
    if setting.ctrl_mode == 0:
        return None
    if setting.ctrl_mode == AUTO_MODE:
        return CtrlMode.EXTERNAL
    try:
        return CtrlMode(setting.ctrl_mode)
    except ValueError:
        raise FieldError(
            f"morai_msgs/MultiEgoSetting.ctrl_mode: expected 1 (keyboard) or 16 (automatic), got {setting.ctrl_mode}"
        ) from None

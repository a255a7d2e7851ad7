"""What clients tell the egos and vehicles by topics: control, lamps, places, ghosts.

A message that is wrong is told to its sender and does nothing, not even in part. One that is right but not wanted now
(the mode is synchronous, or the ego is driven otherwise) is passed over, with one warning for each peer: such messages
come fifty times a second.

*Ghosts* are put where a client says, frame by frame, and stand there: no physics moves them, and the speed that they
show is what was said. An ego is one from its first GhostMessage until the next CtrlCmd, teleport or change of its
control mode; a vehicle, once it is one, stays so.
"""

from __future__ import annotations

import logging
from functools import partial
from typing import Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.command_parsing import EgoSetting, ego_settings, ghost_pose, lamps_of, npc_ghosts
from rosbridge_sim.morai.component import Component
from rosbridge_sim.morai.context import SimulatorContext
from rosbridge_sim.morai.ego import CtrlMode, Ego
from rosbridge_sim.morai.ghosts import Ghosts
from rosbridge_sim.morai.interfaces.network_settings import InterfaceKind
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices
from rosbridge_sim.morai.scene import MAX_EGOS, MAX_ENTITIES
from rosbridge_sim.morai.scene_commands import moves

__all__ = ["CommandTopics"]

_AUTO_MODE: Final = 16
"""What MultiEgoSetting calls the mode in which a program drives."""

_log = logging.getLogger("rosbridge_sim.morai")


class CommandTopics(Component):
    """The component of input topics, but for those of synchronous mode."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._ghosts = Ghosts(context.world, context.scene, lambda unique_id: context.egos.find(unique_id) is not None)
        context.hooks.on_reset.append(self._ghosts.forget)

    def bind(self, bindings: SubscribersServices) -> None:
        """What the world has once."""
        bindings.listen("ego_setting", "MultiEgoSetting", partial(self._ego_setting, bindings))
        bindings.listen("NpcGhost_Topic", "NpcGhostCmd", partial(self._npc_ghosts, bindings))

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """What each ego has of its own; the first one has two names for its control."""
        names = ("ctrl_cmd", "ctrl_cmd_0") if ego is self._context.egos.first else ("ctrl_cmd",)
        for name in names:
            bindings.listen(name, "CtrlCmd", partial(self._ctrl_cmd, ego, bindings, name))
        bindings.listen("ghost_ctrl_cmd", "GhostMessage", partial(self._ghost, ego, bindings))
        bindings.listen("lamps", "Lamps", partial(self._lamps, ego))

    def _ctrl_cmd(
        self, ego: Ego, bindings: SubscribersServices, name: str, command: Struct, sender: Participant, _now: float
    ) -> None:
        control = self._context.convert.control(command)
        if self._is_external(ego):
            ego.control(control)
        else:
            self._decline(ego, bindings, name, bindings.service("SyncModeCtrlCmd"), sender)

    def _ghost(
        self, ego: Ego, bindings: SubscribersServices, message: Struct, sender: Participant, _now: float
    ) -> None:
        pose = ghost_pose(message)
        if self._is_external(ego):
            ego.place_as_ghost(pose)
        else:
            instead = self._context.interfaces.name_of(InterfaceKind.SUBSCRIBER, "/ego_setting")
            self._decline(ego, bindings, "ghost_ctrl_cmd", instead, sender)

    def _npc_ghosts(self, bindings: SubscribersServices, message: Struct, sender: Participant, _now: float) -> None:
        """Place vehicles; in synchronous mode too, for they are not the ego."""
        if self._is_replaying(bindings, "NpcGhost_Topic", sender):
            return
        self._ghosts.place(npc_ghosts(message, MAX_ENTITIES))
        self._context.egos.forget_statuses()

    def _is_external(self, ego: Ego) -> bool:
        """Whether a client may move this ego now."""
        return not (ego.is_replayed or self._context.sync.is_on) and ego.ctrl_mode is CtrlMode.EXTERNAL

    def _decline(self, ego: Ego, bindings: SubscribersServices, name: str, instead: str, sender: Participant) -> None:
        """Tell why a client may not move this ego now, and what to use in place of it."""
        topic = bindings.topic(name)
        if ego.is_replayed:
            why = f"{topic} is ignored while a recording is replayed"
        elif self._context.sync.is_on:
            why = f"{topic} is ignored in synchronous mode: use {instead}"
        else:
            service = bindings.service("Service_MoraiEventCmd")
            why = f"{topic} is ignored: ctrl_mode is {ego.ctrl_mode.name}; set 3 by {service}"
        self._context.warnings.warn(sender, why)

    def _is_replaying(self, bindings: SubscribersServices, name: str, sender: Participant) -> bool:
        """Whether nobody comes or goes now; if so, tell why."""
        is_replaying = self._context.scene.is_replaying
        if is_replaying:
            self._context.warnings.warn(sender, f"{bindings.topic(name)} is ignored while a recording is replayed")
        return is_replaying

    def _lamps(self, ego: Ego, message: Struct, _sender: Participant, _now: float) -> None:
        ego.turn_signal, ego.emergency_signal = lamps_of(message)

    def _ego_setting(self, bindings: SubscribersServices, message: Struct, sender: Participant, now: float) -> None:
        """Put egos somewhere; those whose number is new come into the world."""
        if self._is_replaying(bindings, "ego_setting", sender):
            return
        settings = [(setting, _ctrl_mode(setting)) for setting in ego_settings(message, MAX_EGOS)]
        context = self._context
        context.scene_changes.add_egos(
            [setting for setting, _ in settings if context.egos.find(setting.index) is None], now
        )
        for setting, ctrl_mode in settings:
            ego = context.egos.find(setting.index)
            assert ego is not None
            is_itself = ctrl_mode is CtrlMode.AUTONOMOUS  # that takes a lane, and so the place first
            if ctrl_mode is not None and not is_itself:
                ego.set_ctrl_mode(ctrl_mode)
            ego.teleport(setting.pose, setting.gear)
            num_dropped = context.sync.drop(partial(moves, uid=ego.uid))
            if num_dropped:
                topic = bindings.topic("ego_setting")
                _log.info("%s: ego %d is reset, %d waiting commands dropped", topic, ego.index, num_dropped)
            if is_itself:
                why = ego.set_ctrl_mode(CtrlMode.AUTONOMOUS)
                if why is not None:
                    sender.notify("warning", f"{bindings.topic('ego_setting')}: {why}")
            if setting.lamps is not None:
                ego.turn_signal, ego.emergency_signal = setting.lamps
        context.egos.forget_statuses()


def _ctrl_mode(setting: EgoSetting) -> CtrlMode | None:
    """Who is to drive; None for 0, which leaves it.

    Raises:
        FieldError: there is no such mode.
    """
    if setting.ctrl_mode == 0:
        return None
    if setting.ctrl_mode == _AUTO_MODE:
        return CtrlMode.EXTERNAL
    try:
        return CtrlMode(setting.ctrl_mode)
    except ValueError:
        raise FieldError(
            f"morai_msgs/MultiEgoSetting.ctrl_mode: expected 1 (keyboard) or 16 (automatic), got {setting.ctrl_mode}"
        ) from None

"""The commands of synchronous mode, carried out: the one place for all kinds of them.

A command was checked when it came. What can only be known at its frame (does the object still exist, does the car
stand) is told to its sender then.
"""

from __future__ import annotations

import logging

from rosbridge_sim.errors import DocumentError, FieldError, PeerError
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.scene.scene_commands import (
    AddObject,
    ControlEgo,
    LoadScenario,
    RemoveObject,
    SceneCommand,
    ShiftEgo,
)
from rosbridge_sim.simulator.sensor_services.sensor_commands import Sensors

_log = logging.getLogger("rosbridge_sim.morai")


class CommandExecutor:
    """Carries out each command before its frame is computed. It holds no state."""

    def __init__(self, context: SimulatorContext, sensors: Sensors) -> None:
        """Register with the frame stepper.

        Args:
            sensors: save what they see with a command.
        """
        self._context = context
        self._sensors = sensors
        context.stepper.carry_out = self.carry_out

    def carry_out(self, command: SceneCommand, now: float) -> None:
        """Carry out a command; what is wrong with it is told to its sender, and then nothing has changed."""
        try:
            match command.action:
                case ControlEgo() as action:
                    self._control(action, command)
                case ShiftEgo() as action:
                    self._shift(action, command)
                case AddObject() as action:
                    self._add(action)
                case RemoveObject() as action:
                    self._remove(action)
                case LoadScenario() as action:
                    self._load(action, now)
                case None:
                    raise AssertionError("no tick moves past a command that is not ready")
        except (PeerError, DocumentError) as error:
            command.notify("error", f"{command.source}: {error}")

    def _find_ego(self, uid: int) -> Ego | None:
        """Return the ego with this id in the world; None if it is gone."""
        for ego in self._context.egos:  # a generator costs more than the search
            if ego.uid == uid and ego.is_there:
                return ego
        return None

    def _control(self, action: ControlEgo, command: SceneCommand) -> None:
        ego = self._find_ego(action.uid)
        if ego is None:
            return
        why = ego.find_idle(action.control)
        ego.control(action.control)
        if why is not None:
            command.notify("warning", f"{command.source}: {why}")
        if action.has_capture:
            self._context.hooks.once_after_frame.append(
                lambda _now: self._sensors.capture(ego, command.notify, command.source)
            )

    def _shift(self, action: ShiftEgo, command: SceneCommand) -> None:
        if action.gear is None:
            return
        ego = self._find_ego(action.uid)
        why = (
            f"gear {action.gear.name} refused: ego {action.index} has been removed"
            if ego is None
            else ego.shift(action.gear)
        )
        if why is not None:
            command.notify("warning", f"{command.source}: {why}")

    def _add(self, action: AddObject) -> None:
        uid = self._context.scene.add(action.model, x=action.x, y=action.y, z=action.z, yaw=action.yaw)
        _log.info("added %s with unique_id %d", action.model.name, uid)

    def _remove(self, action: RemoveObject) -> None:
        context, unique_id = self._context, action.unique_id
        if unique_id not in context.world and context.egos.find(unique_id) is not None:
            raise FieldError(f"unique_id {unique_id}: the ego cannot be removed")
        context.scene.remove(unique_id)

    def _load(self, action: LoadScenario, now: float) -> None:
        change = self._context.scene_changes.carry_out
        change(action.load, is_pausing=action.is_pausing, now=now, network=action.network)

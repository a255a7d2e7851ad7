"""Commands of synchronous mode as data: what waits for its frame can be saved, compared and restored.

Each kind is one record, checked and in the world's units before it waits. `command_executor` is the one place that
carries them out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from rosbridge_sim.graph.participant import Notify
from rosbridge_sim.morai.messages.control import Control
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.simulator.bus.network_settings import NetworkSettings
from rosbridge_sim.simulator.scene.load import Load
from rosbridge_sim.world.state.world import Gear


class ControlEgo(Record):
    """Apply a control to an ego.

    Attributes:
        uid: its id in the world, because an ego that comes later may have the same number.
        control: the command.
        has_capture: save what the sensors see in the frame.
    """

    index: int
    uid: int
    control: Control
    has_capture: bool


class ShiftEgo(Record):
    """Change the gear of an ego.

    Attributes:
        index, uid: as in `ControlEgo`.
        gear: None leaves it.
    """

    index: int
    uid: int
    gear: Gear | None


class AddObject(Record):
    """Add an object at rest.

    Attributes:
        model: what it is.
        x, y, z: reference point, map frame [m].
        yaw: heading [rad].
    """

    model: Model
    x: float
    y: float
    z: float
    yaw: float


class RemoveObject(Record):
    """Remove an object.

    Attributes:
        unique_id: as the client calls it.
    """

    unique_id: int


class LoadScenario(Record, eq=False):
    """Load a scenario that has been read.

    Attributes:
        load: prepared by `Scene.prepare`.
        network: other network settings from then on; None for those in force.
        is_pausing: time stands still from then on.
    """

    load: Load
    network: NetworkSettings | None
    is_pausing: bool


SceneAction: TypeAlias = ControlEgo | ShiftEgo | AddObject | RemoveObject | LoadScenario


@dataclass(slots=True, eq=False)
class SceneCommand:
    """A command that waits for its frame; compared by identity.

    Attributes:
        action: what is to be done; None while its scenario is being read.
        source: name of the service or the topic that it came by.
        notify: tells its sender of a mistake that shows at the frame.
    """

    action: SceneAction | None
    source: str
    notify: Notify


def moves(command: SceneCommand, uid: int) -> bool:
    """Return whether a command is about the ego with this id in the world."""
    action = command.action
    return isinstance(action, (ControlEgo, ShiftEgo)) and action.uid == uid

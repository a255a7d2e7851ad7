"""Client commands for egos and vehicles, except CtrlCmd: converted to the world's units, and checked as a whole.

All functions here raise before anything has changed, so a message with one bad value has no effect at all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from operator import attrgetter
from typing import Final

import numpy as np

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.control import gear_of
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_SPEED, Gear

AUTO_MODE: Final = 16
"""Number of the mode in a MultiEgoSetting in which a program drives."""

_TURN_SIGNALS: Final = (0, 1, 2)
_EMERGENCY_SIGNALS: Final = (0, 1)
_FIRST_EGO, _FIRST_EGO_IN_FILES = 0, -1  # scenario files and topics number it differently
_NPC_POSE: Final = ("position.x", "position.y", "position.z", "rpy.x", "rpy.y", "rpy.z")
_HAZARD: Final = 3  # 26.R1 has one number for both lamps


class GhostPose(Record):
    """A pose at which to place a vehicle, in the world's units.

    Attributes:
        x, y, z: reference point in the map [m].
        roll, pitch, yaw: [rad].
        speed: along the heading [m/s].
        steer: of the front wheels, left positive [rad]; None keeps the current angle.
    """

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    speed: float = 0.0
    steer: float | None = None


class EgoSetting(Record):
    """One entry of a MultiEgoSetting.

    Attributes:
        pose: the pose to place it at.
        gear: None keeps the current one.
        ctrl_mode: the number on the wire.
        lamps: turn and emergency signal; None keeps the current ones.
        model: of an ego that is new; None for that of the first one.
    """

    index: int
    pose: GhostPose
    gear: Gear | None
    ctrl_mode: int
    lamps: tuple[int, int] | None = None
    model: Model | None = None


class NpcGhosts(Record, eq=False):
    """The entries of a NpcGhostCmd, in their order.

    Attributes:
        uids: numbers of the vehicles, none twice.
        names: of their models.
        poses: (7, m) x, y, z [m], yaw [rad], speed along it [m/s], roll, pitch [rad].
        has_speed: true if the release's message has a speed; else all of them are 0.
    """

    uids: list[int]
    names: list[str]
    poses: FloatArray
    has_speed: bool


_LISTS: Final = (
    *("ego_index", "global_position_x", "global_position_y", "global_position_z"),
    *("global_roll", "global_pitch", "global_yaw", "velocity", "gear", "ctrl_mode"),
)
_NEWER_LISTS: Final = ("steering_angle", "turn_signal")  # may be empty: clients of the older release lack them


def ego_settings(message: Struct, most: int) -> list[EgoSetting]:
    """Read a MultiEgoSetting.

    Args:
        most: largest number of egos.

    Returns:
        The entries in their order, in the world's units.

    Raises:
        FieldError: too many entries, lists of different lengths, a number that is not finite or out of range, an
            unknown
            gear or lamp, or an ego named twice.
    """
    where = "morai_msgs/MultiEgoSetting"
    num = message.number_of_ego_vehicle
    if num > most:
        raise FieldError(f"{where}.number_of_ego_vehicle: there are {most} egos at most, got {num} entries")
    for name in (*_LISTS, *_NEWER_LISTS):
        entries = getattr(message, name, ())
        if len(entries) != num and (name in _LISTS or len(entries)):
            raise FieldError(
                f"{where}.{name}: expected {num} entries as number_of_ego_vehicle says, got {len(entries)}"
            )
    steering, signals = (getattr(message, name, ()) for name in _NEWER_LISTS)
    settings = [
        EgoSetting(
            _FIRST_EGO if index == _FIRST_EGO_IN_FILES else index,
            _pose(
                f"{where}[{i}]",
                (message.global_position_x[i], message.global_position_y[i], message.global_position_z[i]),
                (message.global_roll[i], message.global_pitch[i], message.global_yaw[i]),
                velocity_kmh=message.velocity[i],
                steer_deg=steering[i] if len(steering) else None,
            ),
            gear_of(message.gear[i]),
            message.ctrl_mode[i],
            _lamps_of_signal(signals[i]) if len(signals) else None,
        )
        for i, index in enumerate(message.ego_index)
    ]
    if len({setting.index for setting in settings}) != num:
        raise FieldError(f"{where}.ego_index: an ego is named twice")
    return settings


def ghost_pose(message: Struct) -> GhostPose:
    """Read a GhostMessage.

    Returns:
        The pose in the world's units.

    Raises:
        FieldError: a number that is not finite or out of range.
    """
    position, rotation = message.position, message.rotation
    return _pose(
        "morai_msgs/GhostMessage",
        (position.x, position.y, position.z),
        (rotation.x, rotation.y, rotation.z),
        velocity_kmh=message.velocity,
        steer_deg=message.steering_angle,
    )


def npc_ghosts(message: Struct, most: int) -> NpcGhosts:
    """Read a NpcGhostCmd. The lists of lamps in newer releases are ignored: they only change the picture.

    Args:
        most: largest number of entities in the world.

    Returns:
        The entries, in the world's units.

    Raises:
        FieldError: too many vehicles, a number that is not finite or out of range, or a vehicle named twice.
    """
    where = "morai_msgs/NpcGhostCmd.npc_list"
    npcs = message.npc_list
    if len(npcs) > most:
        raise FieldError(f"{where}: the world holds {most:,} at most, got {len(npcs):,} vehicles")
    has_speed = len(npcs) > 0 and hasattr(npcs[0], "vehicle_speed")
    read = attrgetter(*_NPC_POSE, "vehicle_speed") if has_speed else attrgetter(*_NPC_POSE)
    values = np.fromiter(chain.from_iterable(map(read, npcs)), dtype=np.float64).reshape(-1, 6 + has_speed)
    place, turn_deg = values[:, :3].T, values[:, 3:6].T
    velocity_kmh = values[:, 6] if has_speed else np.zeros(len(npcs))
    speed = velocity_kmh / MPS_TO_KMH
    is_good = (np.abs(values[:, :6]) <= MAX_COORDINATE).all(axis=1) & (np.abs(speed) <= MAX_SPEED)
    if not is_good.all():
        i = int(is_good.argmin())
        _check_pose(f"{where}[{i}]", place[:, i].tolist(), turn_deg[:, i].tolist(), velocity_kmh.item(i))
    uids = [npc.unique_id for npc in npcs]
    if len(set(uids)) != len(uids):
        raise FieldError(f"{where}: a vehicle is named twice")
    roll, pitch, yaw = np.radians(turn_deg)
    return NpcGhosts(uids, [npc.name for npc in npcs], np.stack([*place, yaw, speed, roll, pitch]), has_speed)


def lamps_of(lamps: Struct) -> tuple[int, int]:
    """Read a Lamps message.

    Returns:
        The turn signal (0 none, 1 left, 2 right) and the emergency signal (0 off, 1 on).

    Raises:
        FieldError: a value that means no lamp.
    """
    return check_lamps(("lamps.turnSignal", lamps.turnSignal), ("lamps.emergencySignal", lamps.emergencySignal))


def check_lamps(turn: tuple[str, int], emergency: tuple[str, int]) -> tuple[int, int]:
    """Return a turn signal and an emergency signal, each given behind the name of its field; see `lamps_of`."""
    if turn[1] not in _TURN_SIGNALS:
        raise FieldError(f"{turn[0]}: expected 0, 1 or 2, got {turn[1]}")
    if emergency[1] not in _EMERGENCY_SIGNALS:
        raise FieldError(f"{emergency[0]}: expected 0 or 1, got {emergency[1]}")
    return turn[1], emergency[1]


def _lamps_of_signal(signal: int) -> tuple[int, int]:
    if signal == _HAZARD:
        return 0, 1
    if signal not in _TURN_SIGNALS:
        raise FieldError(f"turn_signal: expected 0, 1, 2 or 3, got {signal}")
    return signal, 0


def _pose(
    where: str, place: Sequence[float], turn_deg: Sequence[float], *, velocity_kmh: float, steer_deg: float | None
) -> GhostPose:
    _check_pose(where, place, turn_deg, velocity_kmh)
    if steer_deg is not None and not math.isfinite(steer_deg):
        raise FieldError(f"{where}: expected a finite steering angle, got {steer_deg}")
    steer = None if steer_deg is None else math.radians(steer_deg)
    x, y, z = place
    roll, pitch, yaw = map(math.radians, turn_deg)
    return GhostPose(x, y, z, roll, pitch, yaw, velocity_kmh / MPS_TO_KMH, steer)


def _check_pose(where: str, place: Sequence[float], turn_deg: Sequence[float], velocity_kmh: float) -> None:
    """Raise FieldError if a number of a pose is not finite or out of range."""
    if not all(-MAX_COORDINATE <= value <= MAX_COORDINATE for value in (*place, *turn_deg)):
        raise FieldError(f"{where}: expected finite numbers for the pose, got {(*place, *turn_deg)}")
    if not -MAX_SPEED <= velocity_kmh / MPS_TO_KMH <= MAX_SPEED:
        raise FieldError(f"{where}: expected a speed within +-{MAX_SPEED * MPS_TO_KMH:g} km/h, got {velocity_kmh}")

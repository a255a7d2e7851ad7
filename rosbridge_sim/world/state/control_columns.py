"""The columns of a driven row that follow from its body, its gear, its mode and its commands.

They are worked out once for each command, so that the equations of `dynamics` need no branches.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.state.entity_arrays import EntityArrays
from rosbridge_sim.world.state.entity_types import Body, Gear, Mode

STICTION: Final = 1e-9
"""Resistance of a row at rest in any gear but P [m/s^2]. It is too small to notice, and the controller does not count
it when it works out its pedals. Where throttle and rolling resistance balance at rest, rounding would leave a speed of
1e-18 m/s; this removes it."""

JERK_LIMIT: Final = 10.0
"""Largest change of acceleration in speed mode, in the single track model [m/s^3]. ISO 15622 allows adaptive cruise
control half of it at high speed."""

CREEP_ACCEL: Final = 0.5
"""Acceleration of an engine without throttle in D and R, at rest [m/s^2]: a light brake pedal holds the car."""

_JERK_LIMITS: Final = {Mode.PEDALS: 0.0, Mode.SPEED: JERK_LIMIT, Mode.ACCEL: math.inf}
_GEAR_DRIVE: Final = {Gear.PARK: 0.0, Gear.REVERSE: -1.0, Gear.NEUTRAL: 0.0, Gear.DRIVE: 1.0}


BODY_COLUMNS: Final = {
    "steer_rate": "max_steer_rate",
    "speed_accel": "speed_mode_accel",
    "speed_decel": "speed_mode_decel",
    **{
        name: name
        for name in (
            *("wheelbase", "max_steer", "max_accel", "max_decel", "rolling", "drag"),
            *("front_load", "cg_height", "dynamic_index", "front_stiffness", "rear_stiffness", "grip", "grip_along"),
            *("front_drive", "pitch_gain", "roll_gain", "launch_accel", "power", "top_speed"),
            *("air_drag", "engine_drag"),
        )
    },
}
"""Column -> field of `Body`."""


CONTROL_COLUMNS: Final = (
    *("sense", "drive", "holding", "creep", "rolls", "jerk_limit", "throttle_max"),
    *("target", "accel_min", "accel_max"),
)
"""Columns that `update_control_columns` writes."""


def fill_body_columns(arrays: EntityArrays, row: int, body: Body) -> None:
    """Write the limits of a body into the columns of an EGO.

    Args:
        arrays: written in place.
        row: row of an EGO.
    """
    for column, name in BODY_COLUMNS.items():
        getattr(arrays, column)[row] = getattr(body, name)


def update_control_columns(arrays: EntityArrays, row: int, *, is_creeping: bool) -> None:
    """Work out the columns that follow from gear, mode and commands of a driven row.

    - sense: +1, or -1 in R: speeds and accelerations of the commands count in this direction.
    - drive: acceleration of full throttle along the heading, 0 in P and N [m/s^2].
    - holding: deceleration without any pedal: the parking pawl of P [m/s^2].
    - target, accel_min, accel_max: the controller asks for (target - sense * speed) / dt, within these bounds. In the
      acceleration mode both bounds are the command.
    - throttle_max: 0 where the commanded speed is 0, so that no throttle balances the rolling resistance at rest.

    - jerk_limit: 0 in pedals mode, and without a bound in acceleration mode [m/s^3]. The single track model reads it.
    - creep: acceleration of the engine without throttle at rest [m/s^2].
    - rolls: 1 if a slope moves the row from rest, else 0.

    Args:
        arrays: written in place.
        row: row of an EGO.
        is_creeping: it creeps in D and R and rolls on slopes, while pedals control it.
    """
    gear, mode = arrays.gear.item(row), arrays.mode.item(row)
    is_reverse = gear == Gear.REVERSE
    arrays.sense[row] = -1.0 if is_reverse else 1.0
    arrays.drive[row] = arrays.max_accel.item(row) * _GEAR_DRIVE[Gear(gear)]
    arrays.holding[row] = arrays.max_decel.item(row) if gear == Gear.PARK else STICTION
    does_creep = is_creeping and mode == Mode.PEDALS
    arrays.creep[row] = CREEP_ACCEL if does_creep and gear in {Gear.DRIVE, Gear.REVERSE} else 0.0
    arrays.rolls[row] = float(does_creep)
    arrays.jerk_limit[row] = _JERK_LIMITS[Mode(mode)]
    throttle_max = 1.0
    if mode == Mode.ACCEL:
        arrays.accel_min[row] = arrays.accel_max[row] = arrays.accel_cmd.item(row)
    else:
        # A target is a magnitude in the direction of the gear. A negative one can only mean backwards: it is taken as
        # such in R, and as a stop in the gears that cannot go backwards.
        wanted = arrays.speed_cmd.item(row)
        target = abs(wanted) if is_reverse else max(wanted, 0.0)
        arrays.target[row] = target
        arrays.accel_min[row], arrays.accel_max[row] = -arrays.speed_decel.item(row), arrays.speed_accel.item(row)
        if mode == Mode.SPEED and target == 0.0:
            throttle_max = 0.0
    arrays.throttle_max[row] = throttle_max


def update_all_control_columns(arrays: EntityArrays, rows: IntArray, mode: Mode, *, is_creeping: bool) -> None:
    """Do what `update_control_columns` does for many rows whose mode is the same, and whose gears have not changed.

    Args:
        arrays: written in place.
        rows: (k,) int64, rows of EGOs, each once.
        is_creeping: see `update_control_columns`.
    """
    gear = arrays.gear[rows]
    does_creep = is_creeping and mode == Mode.PEDALS
    arrays.creep[rows] = np.where(
        does_creep & ((gear == int(Gear.DRIVE)) | (gear == int(Gear.REVERSE))), CREEP_ACCEL, 0.0
    )
    arrays.rolls[rows] = float(does_creep)
    arrays.jerk_limit[rows] = _JERK_LIMITS[mode]
    if mode == Mode.ACCEL:
        arrays.accel_min[rows] = arrays.accel_max[rows] = arrays.accel_cmd[rows]
        arrays.throttle_max[rows] = 1.0
        return
    wanted = arrays.speed_cmd[rows]
    target = np.where(gear == int(Gear.REVERSE), np.abs(wanted), np.maximum(wanted, 0.0))
    arrays.target[rows] = target
    arrays.accel_min[rows], arrays.accel_max[rows] = -arrays.speed_decel[rows], arrays.speed_accel[rows]
    arrays.throttle_max[rows] = np.where((target == 0.0) & (mode == Mode.SPEED), 0.0, 1.0)

"""The columns of a driven row that follow from its gear, its mode and its commands.

They are worked out once for each command, so that the equations of `dynamics` need no branches.
"""

from __future__ import annotations

from typing import Final

from rosbridge_sim.world.entity_arrays import EntityArrays
from rosbridge_sim.world.entity_types import Gear, Mode

__all__ = ["update_control_columns"]

STICTION: Final = 1e-9
"""Resistance of a row at rest in any gear but P [m/s^2]. It is too small to notice, and the controller does not count
it when it works out its pedals. Where throttle and rolling resistance balance at rest, rounding would leave a speed of
1e-18 m/s; this removes it."""

_GEAR_DRIVE: Final = {Gear.PARK: 0.0, Gear.REVERSE: -1.0, Gear.NEUTRAL: 0.0, Gear.DRIVE: 1.0}


def update_control_columns(arrays: EntityArrays, row: int) -> None:
    """Work out the columns that follow from gear, mode and commands of a driven row.

    - sense: +1, or -1 in R: speeds and accelerations of the commands count in this direction.
    - drive: acceleration of full throttle along the heading, 0 in P and N [m/s^2].
    - holding: deceleration without any pedal: the parking pawl of P [m/s^2].
    - target, accel_min, accel_max: the controller asks for (target - sense * speed) / dt, within these bounds. In the
      acceleration mode both bounds are the command.
    - throttle_max: 0 where the commanded speed is 0, so that no throttle balances the rolling resistance at rest.

    Args:
        arrays: written in place.
        row: row of an EGO.
    """
    gear, mode = arrays.gear.item(row), arrays.mode.item(row)
    is_reverse = gear == Gear.REVERSE
    arrays.sense[row] = -1.0 if is_reverse else 1.0
    arrays.drive[row] = arrays.max_accel.item(row) * _GEAR_DRIVE[Gear(gear)]
    arrays.holding[row] = arrays.max_decel.item(row) if gear == Gear.PARK else STICTION
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

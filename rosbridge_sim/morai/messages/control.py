"""Control commands as the world needs them: kinds, gears, units."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.records import Record
from rosbridge_sim.world.state.world import Gear, Mode

GEARS: Final = "1 (P), 2 (R), 3 (N), 4 (D)"
"""The gears on the wire, for a person to read."""

MODES: Final = {0: Mode.PEDALS, 1: Mode.PEDALS, 2: Mode.SPEED, 3: Mode.ACCEL}
"""`longlCmdType` -> control mode. 0 comes from clients that never set the field; they drive by pedals."""


class Control(Record):
    """A CtrlCmd in the world's units; the arguments of `commands.command`.

    Attributes:
        mode: pedals, speed or acceleration; it selects the fields that count.
        steer, rear_steer: front and rear wheels, left positive [rad].
        throttle, brake: as sent; the world clamps them to 0..1.
        speed: [m/s].
        accel: [m/s^2].
    """

    mode: Mode
    steer: float
    throttle: float
    brake: float
    speed: float
    accel: float
    rear_steer: float = 0.0


def gear_of(number: int) -> Gear | None:
    """Return the gear of a number on the wire.

    Args:
        number: 1 P, 2 R, 3 N, 4 D; -1 and 0 keep the current gear.

    Returns:
        The gear; None to keep the current one.

    Raises:
        FieldError: there is no such gear.
    """
    if number in {-1, 0}:
        return None
    try:
        return Gear(number)
    except ValueError:
        raise FieldError(f"gear: expected {GEARS} or -1 to leave it, got {number}") from None

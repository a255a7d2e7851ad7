"""Lamps of vehicles that nobody commands: brake, reverse and turn signals, as their motion asks for them."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.followers.turn_signals import find_turn_signals
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

LEFT, RIGHT, BRAKE, REVERSE = 1, 2, 4, 8
"""Bits of the lamps of a vehicle."""

_BRAKE_BIT, _REVERSE_BIT = 2, 3
"""Their places in a byte."""

BRAKE_LIGHT_DECEL: Final = 1.0
"""Deceleration from which brake lights are lit where no pedal is known [m/s^2]: in UN Regulation 13-H they must be off
below 0.7 and on above 1.3 m/s^2."""


def find_lamps(world: WorldRows, rows: IntArray) -> npt.NDArray[np.uint8]:
    """Return the lamps that are lit, a sum of bits for each entity; 0 for what is no vehicle.

    Those of an ego are commanded: here its brake lights follow from its deceleration alone.

    Args:
        world: read only.
        rows: (k,) int64.

    Returns:
        (k,) uint8.
    """
    speed = world.speed.take(rows)
    is_braking = world.accel.take(rows) < -BRAKE_LIGHT_DECEL
    is_braking |= (speed == 0.0) & world.has_lane.take(rows)  # a driver on lanes that stands holds the brake
    lamps = (is_braking.view(np.uint8) << _BRAKE_BIT) | ((speed < 0.0).view(np.uint8) << _REVERSE_BIT)
    lamps |= find_turn_signals(world, rows).astype(np.uint8)  # 1 left, 2 right: the same bits
    return np.asarray(lamps * (world.kind.take(rows) <= Kind.VEHICLE).view(np.uint8))

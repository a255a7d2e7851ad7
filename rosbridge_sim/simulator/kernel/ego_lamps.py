"""Lamps of an ego: those that its driver commands, and those that follow from pedals and gear."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.simulator.kernel.ego import Ego
from rosbridge_sim.world.followers.lamps import BRAKE, BRAKE_LIGHT_DECEL, LEFT, REVERSE, RIGHT
from rosbridge_sim.world.state.world import Gear, World

_RIGHT_SIGNAL: Final = 2
"""`turn_signal` of an ego that signals to the right."""


def lamps_of(ego: Ego, world: World) -> int:
    """Return the lamps of an ego that are lit, a sum of the bits of `world.followers.lamps`.

    Args:
        world: read only.
    """
    row = ego.row
    is_braking = world.brake.item(row) > 0.0 or (
        world.has_lane.item(row) and (world.speed.item(row) == 0.0 or world.accel.item(row) < -BRAKE_LIGHT_DECEL)
    )
    return (
        LEFT * (ego.turn_signal == 1 or ego.emergency_signal == 1)
        | RIGHT * (ego.turn_signal == _RIGHT_SIGNAL or ego.emergency_signal == 1)
        | BRAKE * is_braking
        | REVERSE * (world.gear.item(row) == Gear.REVERSE)
    )

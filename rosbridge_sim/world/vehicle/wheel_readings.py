"""Readings of one wheel of each axle of a driven row: slip, sideways force and cornering stiffness.

Both wheels of an axle have the same ones, because the model has one wheel for each axle. The kinematic model has no
tyres: all its readings are 0. A row that is placed from outside, as in a replay, has no slip and no force.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.state.world import Dynamics
from rosbridge_sim.world.state.world_rows import WorldRows


class WheelReading(NamedTuple):
    """Reading of one wheel.

    Attributes:
        slip: direction in which it moves, seen from where it points, left positive [rad].
        lateral_force: of the ground on the tyre, left positive [N].
        cornering_stiffness: of the tyre at its load at rest [N/rad].
    """

    slip: float
    lateral_force: float
    cornering_stiffness: float


NO_READING: Final = WheelReading(0.0, 0.0, 0.0)


def read_wheel(world: WorldRows, row: int, axle: Literal["front", "rear"]) -> WheelReading:
    """Return the reading of a wheel.

    Args:
        world: read only.
        row: row of an EGO.
    """
    if world.dynamics == Dynamics.KINEMATIC:
        return NO_READING
    body = world.body_of(row)
    half = 0.5 * body.mass
    if axle == "front":
        load, stiffness, slip, force = body.front_load, body.front_stiffness, world.front_slip, world.front_force
    else:
        load, stiffness, slip, force = 1.0 - body.front_load, body.rear_stiffness, world.rear_slip, world.rear_force
    cornering_stiffness = half * GRAVITY * load * stiffness
    if world.is_ghost.item(row):
        return WheelReading(0.0, 0.0, cornering_stiffness)
    return WheelReading(slip.item(row), half * force.item(row), cornering_stiffness)

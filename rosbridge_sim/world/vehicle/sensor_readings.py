"""Readings of sensors on a vehicle: position of an antenna, inertial unit, and boxes of the entities around.

A `Mounting` says where a sensor is on its vehicle. Readings are exact: nothing here adds noise. They follow from the
state at one frame, so it does not matter how often they are read.

*The inertial unit.* Over the last step, the reference point P (rear axle) of a driven row has the acceleration a_P
(`accel` forward, `lateral_accel` left) and the yaw rate w = `yaw_rate` about the map's z axis. With r the vector from P
to the sensor, all in the map frame,

    a = a_P + w' z x r + w z x (w z x r)

The change w' of the yaw rate follows from the single track model, w = v tan(d) / L:

    w' = (v' tan(d) + v d' (1 + tan(d)^2)) / L

with v and d in the middle of the step. That d has made `yaw_rate`, and d' is how fast the wheels have turned since. If
they cannot have turned so far, they were set from outside, and d' is 0. A ghost does not move by the model, and its w'
is 0. The single track model with tyres has its own w'.

The body of that model pitches and rolls, so gravity has parts along all axes of the sensor, and the angular velocity
has the rates of both. Their changes add no acceleration: the sensor is near the axis about which the body leans.

On hills P accelerates upwards by `climb_accel`, which adds to gravity. The kinematic model does not accelerate along z.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import (
    FloatArray,
    IntArray,
    Quaternion,
    Vector,
    chain,
    quaternion,
    rotate,
    rotate_back,
    wrap_angle,
)
from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.state.world import DT, Dynamics
from rosbridge_sim.world.state.world_rows import WorldRows

STEER_ROUNDING: Final = 1e-9
"""The most that rounding can add to the turn of the wheels in one step [rad]."""


class Mounting(Record):
    """Place and orientation of a sensor on its vehicle; the default is the reference point, looking forward.

    Attributes:
        x, y, z: forward, left and up of the middle of the rear axle on the ground [m].
        roll, pitch, yaw: orientation in the vehicle's frame, as for `planar.quaternion` [rad].
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    @property
    def place(self) -> Vector:
        """x, y and z [m]."""
        return self.x, self.y, self.z

    @property
    def orientation(self) -> Quaternion:
        """Orientation of its axes in the vehicle's frame."""
        return quaternion(self.roll, self.pitch, self.yaw)


class Inertia(Record):
    """Reading of an inertial unit.

    Attributes:
        orientation: the sensor's axes in the map frame.
        angular_velocity: of the sensor, in its own axes [rad/s].
        acceleration: specific force in its own axes: at rest `GRAVITY` upwards, as a real unit shows [m/s^2].
    """

    orientation: Quaternion
    angular_velocity: Vector
    acceleration: Vector


class Boxes(Record):
    """Bounding boxes of other entities as a vehicle sees them, the nearest first; (k,) float64 each unless noted.

    Attributes:
        rows: int64, rows of the entities.
        x, y, z: middle of the box, in the frame of the vehicle that looks [m].
        length, width, height: [m].
        yaw: heading relative to that of the vehicle that looks, within (-pi, pi] [rad].
        distance: from the reference point of the vehicle that looks to the middle [m].
        speed: along the entity's heading, negative backwards [m/s].
    """

    rows: IntArray
    x: FloatArray
    y: FloatArray
    z: FloatArray
    length: FloatArray
    width: FloatArray
    height: FloatArray
    yaw: FloatArray
    distance: FloatArray
    speed: FloatArray


def locate(world: WorldRows, row: int, mounting: Mounting) -> Vector:
    """Return where a sensor is.

    Args:
        world: read only.
        row: row of the vehicle.
        mounting: of the sensor.

    Returns:
        East, north, up in the map frame [m].
    """
    x, y, z = rotate(_orientation(world, row), mounting.place)
    return world.x.item(row) + x, world.y.item(row) + y, world.z.item(row) + z


def feel(world: WorldRows, row: int, mounting: Mounting) -> Inertia:
    """Return the reading of an inertial unit; see the head of this file for the equations.

    Args:
        world: read only.
        row: row of an EGO.
        mounting: of the unit.
    """
    vehicle = _orientation(world, row)
    axes = chain(vehicle, mounting.orientation)
    yaw, rate, change = world.yaw.item(row), world.yaw_rate.item(row), _yaw_accel(world, row)
    ahead, left = world.accel.item(row), world.lateral_accel.item(row)
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y, _ = rotate(vehicle, mounting.place)
    acceleration = (
        ahead * cos - left * sin - change * y - rate * rate * x,
        ahead * sin + left * cos + change * x - rate * rate * y,
        GRAVITY + (world.climb_accel.item(row) if world.dynamics == Dynamics.SINGLE_TRACK else 0.0),
    )
    turn = (0.0, 0.0, rate)
    roll_rate, pitch_rate = world.roll_rate.item(row), world.pitch_rate.item(row)
    if roll_rate or pitch_rate:
        # About the body's own axes x and y: the lean is a few degrees, so they are those about which it turns.
        lean = rotate(vehicle, (roll_rate, pitch_rate, 0.0))
        turn = (lean[0], lean[1], rate + lean[2])
    return Inertia(axes, rotate_back(axes, turn), rotate_back(axes, acceleration))


def find_boxes(world: WorldRows, row: int, reach: float, limit: int) -> Boxes:
    """Return the boxes of all other entities whose middle is near a vehicle.

    Args:
        world: read only.
        row: row of the vehicle that looks.
        reach: greatest distance of a middle [m].
        limit: boxes at most; of more, the nearest.
    """
    others = np.flatnonzero(world.alive)
    others = others[others != row]
    to_middle, half_height = world.centre[others], 0.5 * world.height[others]
    # The middle is `to_middle` along x and `half_height` along z of the body: the first and third axis of each.
    yaw, pitch, roll = world.yaw[others], world.pitch[others], world.roll[others]
    cos_yaw, sin_yaw, cos_pitch, sin_pitch = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    cos_roll, sin_roll = np.cos(roll), np.sin(roll)
    lean = sin_pitch * cos_roll
    x = cos_yaw * cos_pitch * to_middle + (cos_yaw * lean + sin_yaw * sin_roll) * half_height
    y = sin_yaw * cos_pitch * to_middle + (sin_yaw * lean - cos_yaw * sin_roll) * half_height
    z = cos_pitch * cos_roll * half_height - sin_pitch * to_middle
    away = np.stack([x, y, z])
    away += np.stack([world.x[others], world.y[others], world.z[others]])
    away -= np.array([[world.x[row]], [world.y[row]], [world.z[row]]])
    distance = np.sqrt(np.square(away).sum(axis=0))
    chosen = np.argsort(distance, kind="stable")[: min(limit, int(np.count_nonzero(distance <= reach)))]
    rows = others[chosen]
    axes = _orientation(world, row)
    columns = np.array([rotate(axes, unit) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))])
    seen = (columns[:, :, None] * away[:, chosen]).sum(axis=1)  # no matmul: its bits depend on the library behind it
    return Boxes(
        rows,
        *(seen[0], seen[1], seen[2]),
        *(2.0 * world.half_length[rows], 2.0 * world.half_width[rows], world.height[rows].copy()),
        wrap_angle(world.yaw[rows] - world.yaw[row]),
        distance[chosen],
        world.speed[rows].copy(),
    )


def _orientation(world: WorldRows, row: int) -> Quaternion:
    """Return the orientation of a row in the map frame."""
    return quaternion(world.roll.item(row), world.pitch.item(row), world.yaw.item(row))


def _yaw_accel(world: WorldRows, row: int) -> float:
    """Return the change of the yaw rate in the middle of the last step [rad/s^2]."""
    if world.dynamics == Dynamics.SINGLE_TRACK:
        return world.yaw_accel.item(row)
    wheelbase, accel = world.wheelbase.item(row), world.accel.item(row)
    speed = world.speed.item(row) - 0.5 * DT * accel
    if world.is_ghost.item(row) or wheelbase <= 0.0:
        return 0.0
    if speed == 0.0:  # it passes through standstill, where the turning of the wheels moves nothing
        return accel * math.tan(world.steer.item(row)) / wheelbase
    slope = world.yaw_rate.item(row) * wheelbase / speed
    turned = world.steer.item(row) - math.atan(slope)
    if abs(turned) > 0.5 * DT * world.steer_rate.item(row) + STEER_ROUNDING:
        turned = 0.0  # the car or its wheels were set from outside: they did not turn so far
    return (accel * slope + speed * (1.0 + slope * slope) * turned / (0.5 * DT)) / wheelbase

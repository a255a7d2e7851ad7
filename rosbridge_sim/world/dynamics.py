"""Commands of driven rows, and how they move: the kinematic single track with actuator limits.

The model. Reference point is the middle of the rear axle; there the velocity lies along the heading, so with speed v,
front wheel angle d and wheelbase L

    x' = v cos(yaw)     y' = v sin(yaw)     yaw' = v tan(d) / L

*Steering*: d follows the command with at most `max_steer_rate`; commands are clipped at `max_steer`.

*Longitudinal*: with throttle p and brake b (0..1), g = +1 in D, -1 in R, 0 in N and P,

    v' = g max_accel p  -  sign(v) (max_decel b + rolling + drag v^2)        [P adds max_decel to the bracket]

The bracket is friction: it slows and holds but never turns the motion round, so what stands stays at exactly 0.0 until
the throttle overcomes it.

*Controller* of the modes SPEED and ACCEL: the wanted acceleration a, counted in the direction of the gear, is
(target - v) / dt within the speed mode's limits, or the command. The pedals come from solving the line above for them:
p = (a + rolling + drag v^2) / max_accel if that is positive, else b = -(...) / max_decel, both clipped at 1. So what is
reported is what is pressed, and a speed is reached without overshoot, for model and inverse are the same.

Integration of one step. The acceleration is that at its beginning, so v is linear in the step and the way is
s = (v0 + v1) / 2 dt; the wheel angle d is that of the middle of the step. The turn is then s tan(d) / L = 2h and the
way a circular arc, whose chord is exact: s sin(h) / h in the direction yaw + h. At constant steering every step
therefore ends on the true circle, whatever dt; otherwise the error falls with dt.

Where it stops being true: no slip, so it takes any bend at any speed (beyond about 4 m/s^2 of lateral acceleration a
real car goes wide); no pitch, no slope, no load transfer, no engine that needs time.
"""

from __future__ import annotations

import math

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state import MAX_SPEED, Gear, Kind, Mode, World, check_pose

__all__ = ["command", "drive", "shift", "teleport"]

MAX_COMMAND_ACCEL = 100.0  # beyond any brake; keeps the controller's sums finite [m/s^2]
STANDSTILL = 0.1  # a gear change takes hold below this speed [m/s]
TINY = 1e-150  # sin(h) / h with h = 0 becomes TINY / TINY = 1; added to any other h it changes no bit


def command(
    world: World,
    row: int,
    *,
    mode: Mode,
    steer: float,
    throttle: float = 0.0,
    brake: float = 0.0,
    speed: float = 0.0,
    accel: float = 0.0,
) -> None:
    """Set what a driven row shall do from the next step on; it holds until the next command.

    Only the figures of the mode count; the others are not looked at.

    Args:
        world: written in place.
        row: of an EGO.
        mode: which longitudinal figures count.
        steer: front wheels, left positive, clipped at the body's limit [rad].
        throttle: 0..1, clipped; PEDALS.
        brake: 0..1, clipped; PEDALS.
        speed: in the direction of the gear; SPEED. Negative is a stop, in R the same as positive [m/s].
        accel: in the direction of the gear, so that a negative one brakes; ACCEL [m/s^2].

    Raises:
        ValueError: a figure that counts is not finite, or the row is not driven. The old command stays in force.
    """
    if world.kind[row] != Kind.EGO or not world.alive[row]:
        raise ValueError(f"row {row} is not driven by commands")
    wishes = {
        Mode.PEDALS: {"steer": steer, "throttle": throttle, "brake": brake},
        Mode.SPEED: {"steer": steer, "speed": speed},
        Mode.ACCEL: {"steer": steer, "accel": accel},
    }[Mode(mode)]
    for name, value in wishes.items():
        if not math.isfinite(value):
            raise ValueError(f"{name}: expected a finite number, got {value!r}")
    limit = float(world.max_steer[row])
    world.steer_cmd[row] = min(max(steer, -limit), limit)
    if mode == Mode.PEDALS:
        world.throttle[row], world.brake[row] = min(max(throttle, 0.0), 1.0), min(max(brake, 0.0), 1.0)
    elif mode == Mode.SPEED:
        world.speed_cmd[row] = min(max(speed, -MAX_SPEED), MAX_SPEED)
    else:
        world.accel_cmd[row] = min(max(accel, -MAX_COMMAND_ACCEL), MAX_COMMAND_ACCEL)
    if world.mode[row] != mode:
        world.mode[row] = mode
        world.touch()
    world.aim(row)


def shift(world: World, row: int, gear: Gear) -> bool:
    """Move the selector lever of a driven row.

    Returns:
        True when the row is in that gear now (it may have been before); False when it is too fast for a change.

    Raises:
        ValueError: the row is not driven, or there is no such gear.
    """
    if world.kind[row] != Kind.EGO or not world.alive[row]:
        raise ValueError(f"row {row} has no gears")
    gear = Gear(gear)
    if world.gear[row] == gear:
        return True
    if abs(world.speed[row]) >= STANDSTILL:
        return False
    world.gear[row] = gear
    world.aim(row)
    return True


def teleport(
    world: World,
    row: int,
    *,
    x: float,
    y: float,
    z: float,
    yaw: float,
    speed: float = 0.0,
    roll: float = 0.0,
    pitch: float = 0.0,
) -> None:
    """Put a row somewhere else. Commands, gear and steering stay; a path is left for good.

    Args:
        world: written in place.
        row: of anybody.
        x: new reference point, east [m].
        y: the same, north [m].
        z: the same, up [m].
        yaw: new heading, wrapped [rad].
        speed: new speed along it [m/s].
        roll: [rad].
        pitch: [rad].

    Raises:
        ValueError: a figure is not finite or out of bounds. Nothing has moved.
    """
    check_pose(x=x, y=y, z=z, yaw=yaw, speed=speed, roll=roll, pitch=pitch)
    world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
    world.roll[row], world.pitch[row] = roll, pitch


def drive(world: World, dt: float) -> None:
    """Move all driven rows by `dt`, in place; see the head of this file for the equations."""
    driven = world.derived(_Driven)
    if driven.num:
        driven.gather()
        driven.advance(dt)
        driven.scatter()


class _Driven:
    """The driven rows as (k,) arrays: views when they are neighbours in the world's arrays, else copies.

    Lives until somebody comes, goes or changes mode. All methods write in place; the scratch arrays make a step free
    of allocations, and equal shapes without gaps are numpy's fastest case (0.2 us a call against 0.4 with a scalar).
    """

    def __init__(self, world: World) -> None:
        self.rows: IntArray = np.flatnonzero(world.alive & (world.kind == Kind.EGO))
        self.num = len(self.rows)
        if not self.num:
            return
        self.whole = world.block("target", "speed")
        self.written = world.block("throttle", "speed")
        first, last = int(self.rows[0]), int(self.rows[-1])
        self.is_view = last - first + 1 == self.num
        block = self.whole[:, first : last + 1] if self.is_view else np.empty((len(self.whole), self.num))
        self.block, self.block_written = block, block[-len(self.written) :]
        # In the order of `state.FLOATS`; a count that does not fit fails here.
        self.target, self.accel_max, self.accel_min, self.throttle_max = block[:4]
        self.sense, self.drive, self.hold, self.steer_cmd = block[4:8]
        self.wheelbase, self.steer_rate, self.max_accel, self.max_decel, self.rolling, self.drag = block[8:14]
        self.throttle, self.brake, self.steer, self.accel, self.lateral_accel, self.yaw_rate = block[14:20]
        self.x, self.y, self.yaw, self.speed = block[20:]
        self.is_auto = world.mode[self.rows] != Mode.PEDALS
        self.num_auto = int(np.count_nonzero(self.is_auto))
        self.flags = np.empty(self.num, dtype=bool)
        self.scratch = tuple(np.empty((4, self.num)))
        self.constants = np.empty((4, self.num))
        self.half, self.one, self.tiny, self.pi = self.constants
        self.constants[:] = [[0.5], [1.0], [TINY], [math.pi]]
        self.zero = np.zeros(self.num)
        self.dt = np.empty(self.num)
        self.steer_step = np.empty(self.num)
        self._set_dt(0.0)

    def _set_dt(self, dt: float) -> None:
        self.last_dt = dt
        self.dt.fill(dt)

    def gather(self) -> None:
        if not self.is_view:
            np.take(self.whole, self.rows, axis=1, out=self.block, mode="clip")

    def scatter(self) -> None:
        if not self.is_view:
            self.written[:, self.rows] = self.block_written

    def advance(self, dt: float) -> None:
        """Move by `dt`."""
        if dt != self.last_dt:
            self._set_dt(dt)
        resist = self._resist()
        if self.num_auto:
            self._press(resist)
        way = self._accelerate(resist)
        self._steer_along(way)

    def _resist(self) -> FloatArray:
        """Return rolling + drag v^2 in scratch 0."""
        resist = self.scratch[0]
        np.multiply(self.speed, self.speed, resist)
        np.multiply(resist, self.drag, resist)
        np.add(resist, self.rolling, resist)
        return resist

    def _press(self, resist: FloatArray) -> None:
        """Work out the pedals of the rows whose mode is not PEDALS."""
        _, need, throttle, brake = self.scratch
        np.multiply(self.speed, self.sense, need)
        np.subtract(self.target, need, need)
        np.divide(need, self.dt, need)
        np.minimum(need, self.accel_max, out=need)
        np.maximum(need, self.accel_min, out=need)
        np.add(need, resist, need)
        if self.num_auto == self.num:
            throttle, brake = self.throttle, self.brake
        np.divide(need, self.max_accel, throttle)
        np.maximum(throttle, self.zero, out=throttle)
        np.minimum(throttle, self.throttle_max, out=throttle)
        np.negative(need, need)
        np.divide(need, self.max_decel, brake)
        np.maximum(brake, self.zero, out=brake)
        np.minimum(brake, self.one, out=brake)
        if self.num_auto != self.num:
            np.copyto(self.throttle, throttle, where=self.is_auto)
            np.copyto(self.brake, brake, where=self.is_auto)

    def _accelerate(self, resist: FloatArray) -> FloatArray:
        """Bring the speed to the end of the step and return the way, in scratch 0."""
        _, push, after, brake = self.scratch
        np.multiply(self.drive, self.throttle, push)
        np.multiply(push, self.dt, push)
        np.add(self.speed, push, after)
        np.multiply(self.brake, self.max_decel, brake)
        np.add(resist, brake, resist)
        np.add(resist, self.hold, resist)
        np.multiply(resist, self.dt, resist)
        # Friction takes at most all of the motion: v - clip(v, -friction, friction).
        np.negative(resist, brake)
        np.minimum(after, resist, out=resist)
        np.maximum(resist, brake, out=resist)
        np.subtract(after, resist, after)
        way = resist
        np.add(self.speed, after, way)
        np.multiply(way, self.half, way)
        np.multiply(way, self.dt, way)
        np.subtract(after, self.speed, self.accel)
        np.divide(self.accel, self.dt, self.accel)
        np.copyto(self.speed, after)
        return way

    def _steer_along(self, way: FloatArray) -> None:
        """Turn the wheels, and go the way along the arc of the wheel angle in the middle of the step."""
        _, change, limit, turn = self.scratch
        np.multiply(self.steer_rate, self.dt, limit)
        np.subtract(self.steer_cmd, self.steer, change)
        np.minimum(change, limit, out=change)
        np.negative(limit, limit)
        np.maximum(change, limit, out=change)
        np.add(self.steer, change, limit)  # the angle after the step
        np.multiply(change, self.half, change)
        np.add(self.steer, change, turn)
        np.copyto(self.steer, limit)
        np.tan(turn, turn)
        np.divide(turn, self.wheelbase, turn)
        np.multiply(turn, way, turn)
        np.divide(turn, self.dt, self.yaw_rate)
        np.multiply(self.yaw_rate, self.speed, self.lateral_accel)
        half_turn, course = change, limit
        np.multiply(turn, self.half, half_turn)
        np.add(self.yaw, half_turn, course)
        np.add(self.yaw, turn, self.yaw)
        np.add(half_turn, self.tiny, half_turn)
        np.sin(half_turn, turn)
        np.divide(turn, half_turn, turn)
        np.multiply(way, turn, way)
        np.cos(course, turn)
        np.multiply(turn, way, turn)
        np.add(self.x, turn, self.x)
        np.sin(course, turn)
        np.multiply(turn, way, turn)
        np.add(self.y, turn, self.y)
        np.absolute(self.yaw, turn)
        np.greater(turn, self.pi, self.flags)
        if np.count_nonzero(self.flags):
            np.copyto(self.yaw, wrap_angle(self.yaw))

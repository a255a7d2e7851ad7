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
from collections.abc import Sequence
from functools import partial

import numpy as np

from rosbridge_sim.world.geometry import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.row_program import RowProgram
from rosbridge_sim.world.state import MAX_COORDINATE, MAX_SPEED, BoolArray, Gear, Kind, Mode, World, check_pose

__all__ = [
    "command",
    "drive",
    "place_ghost",
    "place_ghosts",
    "release",
    "shift",
    "show_ghosts",
    "teleport",
    "turn_wheels",
]

MAX_COMMAND_ACCEL = 100.0  # beyond any brake; keeps the controller's sums finite [m/s^2]
STANDSTILL = 0.1  # a gear change takes hold below this speed [m/s]
ULP_PI = math.ulp(math.pi)  # from pi to the next number
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
    """Set what a driven row shall do from the next step on; it holds until the next command. Ends a ghost.

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
    if not _is_driven(world, row):
        raise ValueError(f"row {row} is not driven by commands")
    if mode == Mode.PEDALS:
        _check(steer=steer, throttle=throttle, brake=brake)
        world.throttle[row], world.brake[row] = min(max(throttle, 0.0), 1.0), min(max(brake, 0.0), 1.0)
    elif mode == Mode.SPEED:
        _check(steer=steer, speed=speed)
        world.speed_cmd[row] = min(max(speed, -MAX_SPEED), MAX_SPEED)
    elif mode == Mode.ACCEL:
        _check(steer=steer, accel=accel)
        world.accel_cmd[row] = min(max(accel, -MAX_COMMAND_ACCEL), MAX_COMMAND_ACCEL)
    else:
        raise ValueError(f"mode: expected 1 (pedals), 2 (speed) or 3 (acceleration), got {mode!r}")
    limit = world.max_steer.item(row)
    world.steer_cmd[row] = min(max(steer, -limit), limit)
    before = world.mode.item(row)
    world.mode[row] = mode
    world.aim(row)
    _set_ghost(world, row, is_ghost=False)
    if (before == Mode.PEDALS) != (mode == Mode.PEDALS):
        world.touch()  # the controller's calls are laid down only for those who need it


def _is_driven(world: World, row: int) -> bool:
    # `item`, here and in all that a command does: comparing numpy's scalars with an enum costs microseconds.
    return bool(world.kind.item(row) == Kind.EGO and world.alive.item(row))


def _check(**wishes: float) -> None:
    for name, value in wishes.items():
        if not math.isfinite(value):
            raise ValueError(f"{name}: expected a finite number, got {value!r}")


def shift(world: World, row: int, gear: Gear) -> bool:
    """Move the selector lever of a driven row.

    Returns:
        True when the row is in that gear now (it may have been before); False when it is too fast for a change.

    Raises:
        ValueError: the row is not driven, or there is no such gear.
    """
    if not _is_driven(world, row):
        raise ValueError(f"row {row} has no gears")
    gear = Gear(gear)
    if world.gear.item(row) == gear:
        return True
    if abs(world.speed[row]) >= STANDSTILL:
        return False
    world.gear[row] = gear
    world.aim(row)
    world.touch()
    return True


def turn_wheels(world: World, row: int, steer: float) -> None:
    """Stand the front wheels of a driven row at an angle at once; they stay there until the next command.

    Args:
        world: written in place.
        row: of an EGO.
        steer: left positive, clipped at the body's limit [rad].

    Raises:
        ValueError: not a finite angle, or the row is not driven. Nothing has changed.
    """
    if not _is_driven(world, row):
        raise ValueError(f"row {row} has no wheels to turn")
    _check(steer=steer)
    limit = world.max_steer.item(row)
    world.steer[row] = world.steer_cmd[row] = min(max(steer, -limit), limit)


def release(world: World, row: int) -> None:
    """Forget what a driven row was commanded: no pedal is pressed and the wheels stand straight at once.

    Gear, place and speed stay. Until the next command it rolls on in pedals mode. Ends a ghost.

    Raises:
        ValueError: the row is not driven. Nothing has changed.
    """
    command(world, row, mode=Mode.PEDALS, steer=0.0)
    world.speed_cmd[row] = world.accel_cmd[row] = 0.0
    world.aim(row)
    world.steer[row] = 0.0


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
    """Put a row somewhere else. Commands, gear and steering stay; a path is left for good. Ends a ghost.

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
    _set_ghost(world, row, is_ghost=False)


def place_ghost(
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
    """Put a row somewhere as a ghost: steps leave it there, until a `teleport` or, for a driven one, a `command`.

    Whoever moves a ghost does so from one step to the next: it touches whom it stands in, and whom it has been put past
    it has not met. Its speed is what others see of it.

    Args:
        world: written in place.
        row: of anybody.
        x: reference point, east [m].
        y: the same, north [m].
        z: the same, up [m].
        yaw: heading, wrapped [rad].
        speed: what it shows, along the heading [m/s].
        roll: [rad].
        pitch: [rad].

    Raises:
        ValueError: a figure is not finite or out of bounds. Nothing has moved.
    """
    check_pose(x=x, y=y, z=z, yaw=yaw, speed=speed, roll=roll, pitch=pitch)
    world.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
    world.roll[row], world.pitch[row] = roll, pitch
    _set_ghost(world, row, is_ghost=True)


def place_ghosts(world: World, rows: IntArray, poses: FloatArray) -> None:
    """Do the same as `place_ghost` for many rows at once; none of them comes twice.

    Args:
        world: written in place.
        rows: (m,) of anybody.
        poses: (7, m) x, y, z [m], yaw [rad], speed [m/s], roll, pitch [rad].

    Raises:
        ValueError: a figure is not finite or out of bounds. Nothing has moved.
    """
    x, y, z, yaw, speed, roll, pitch = poses
    limits = np.array(
        [MAX_COORDINATE, MAX_COORDINATE, MAX_COORDINATE, MAX_COORDINATE, MAX_SPEED, *[MAX_COORDINATE] * 2]
    )
    if not (np.abs(poses) <= limits[:, None]).all():
        raise ValueError("poses: expected finite numbers within the bounds of the world")
    world.place_all(rows, x=x, y=y, z=z, yaw=yaw, speed=speed)
    world.roll[rows], world.pitch[rows] = roll, pitch
    world.is_ghost[rows] = True
    world.touch()


def show_ghosts(world: World, rows: IntArray, columns: Sequence[str], values: FloatArray) -> None:
    """Have ghosts show what was worked out or recorded elsewhere: steps leave all of it as it is.

    For many at once, frame by frame. They stay ghosts until a `teleport`, for driven ones a `command`.

    Args:
        world: written in place.
        rows: (m,) of anybody.
        columns: what is shown of them: of x, y, z, roll, pitch, yaw, speed, lateral_speed, climb, accel, lateral_accel,
            climb_accel, yaw_rate and, for driven rows, steer, throttle and brake.
        values: (columns, m) in the world's units and within its bounds, which is not checked; headings are wrapped. NaN
            leaves a figure as it is.
    """
    for name, figures in zip(columns, values, strict=True):
        column = getattr(world, name)
        column[rows] = np.where(np.isnan(figures), column[rows], wrap_angle(figures) if name == "yaw" else figures)
    if not world.is_ghost[rows].all():
        world.is_ghost[rows] = True
        world.touch()


def _set_ghost(world: World, row: int, *, is_ghost: bool) -> None:
    if world.is_ghost.item(row) != is_ghost:
        world.is_ghost[row] = is_ghost
        world.touch()


def drive(world: World, dt: float) -> None:
    """Move all driven rows by `dt`, in place; see the head of this file for the equations."""
    driven = world.derived(_Driven)
    if driven.num:
        driven.advance(dt)


class _Driven:
    """The driven rows and the calls that move them.

    Lives until somebody comes or goes, shifts, or needs the controller or no longer: so what follows from body, mode
    and gear alone is worked out here, once. Friction and pedals are counted in change of speed per step.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.rows = np.flatnonzero(world.alive & (world.kind == Kind.EGO) & ~world.is_ghost)
        self.num = len(self.rows)
        self.dt = 0.0

    def advance(self, dt: float) -> None:
        if dt != self.dt:
            self.dt = dt
            self._lay_down()
        self.block.run()

    def _lay_down(self) -> None:
        block = self.block = RowProgram(self.world, self.rows, "target", "speed", written_from="throttle")
        # In the order of `state.FLOATS`; a count that does not fit fails here.
        self.target, self.accel_max, self.accel_min, self.throttle_max = block.values[:4]
        self.sense, self.full_throttle, self.holding, self.steer_cmd = block.values[4:8]
        self.wheelbase, self.steer_rate, self.max_accel, self.max_decel, self.rolling, self.drag = block.values[8:14]
        self.throttle, self.brake, self.steer, self.accel, self.lateral_accel, self.yaw_rate = block.values[14:20]
        self.x, self.y, self.yaw, self.speed = block.values[20:]
        resist, way, *spare = np.empty((5, block.num))
        self._resist(resist)
        is_auto = self.world.mode[block.rows] != Mode.PEDALS
        if is_auto.any():
            self._press(is_auto, resist, *spare)
        self._accelerate(resist, way, *spare)
        self._steer(way, half_turn=resist, change=spare[0])
        self._follow_arc(way, resist, *spare[:2])

    def _resist(self, resist: FloatArray) -> None:
        """Lay down: what slows without a pedal, rolling + drag v^2."""
        do, constant = self.block.do, self.block.constant
        do(np.multiply, self.speed, self.speed, resist)
        do(np.multiply, resist, constant(self.drag * self.dt), resist)
        do(np.add, resist, constant(self.rolling * self.dt), resist)

    def _press(
        self, is_auto: BoolArray, resist: FloatArray, need: FloatArray, throttle: FloatArray, brake: FloatArray
    ) -> None:
        """Lay down: the controller's pedals, from the change of speed that is wanted."""
        do, constant = self.block.do, self.block.constant
        is_all = bool(is_auto.all())
        if is_all:
            throttle, brake = self.throttle, self.brake
        dt, zero, one = constant(self.dt), constant(0.0), constant(1.0)
        do(np.multiply, self.speed, self.sense, need)
        do(np.subtract, self.target, need, need)
        do(np.divide, need, dt, need)
        do(np.fmin, need, self.accel_max, need)
        do(np.fmax, need, self.accel_min, need)
        do(np.multiply, need, dt, need)
        do(np.add, need, resist, need)
        do(np.divide, need, constant(self.max_accel * self.dt), throttle)
        do(np.fmax, throttle, zero, throttle)
        do(np.fmin, throttle, self.throttle_max, throttle)
        do(np.divide, need, constant(-self.max_decel * self.dt), brake)
        do(np.fmax, brake, zero, brake)
        do(np.fmin, brake, one, brake)
        if not is_all:
            do(partial(np.copyto, self.throttle, throttle, where=is_auto))
            do(partial(np.copyto, self.brake, brake, where=is_auto))

    def _accelerate(
        self, resist: FloatArray, way: FloatArray, push: FloatArray, friction: FloatArray, after: FloatArray
    ) -> None:
        """Lay down: throttle, then friction, which takes at most all of the motion: v - clip(v, -f, f)."""
        do, constant = self.block.do, self.block.constant
        do(np.multiply, self.throttle, constant(self.full_throttle * self.dt), push)
        do(np.add, self.speed, push, after)
        do(np.multiply, self.brake, constant(self.max_decel * self.dt), friction)
        do(np.add, friction, resist, friction)
        do(np.add, friction, constant(self.holding * self.dt), friction)
        do(np.negative, friction, resist)
        do(np.fmin, after, friction, friction)
        do(np.fmax, friction, resist, friction)
        do(np.subtract, after, friction, after)
        do(np.subtract, push, friction, self.accel)
        do(np.divide, self.accel, constant(self.dt), self.accel)
        do(np.add, self.speed, after, way)
        do(np.multiply, way, constant(self.dt / 2), way)
        do(np.copyto, self.speed, after)

    def _steer(self, way: FloatArray, half_turn: FloatArray, change: FloatArray) -> None:
        """Lay down: the wheels turn, and by their angle in the middle of the step the car."""
        do, constant = self.block.do, self.block.constant
        do(np.subtract, self.steer_cmd, self.steer, change)
        do(np.fmin, change, constant(self.steer_rate * self.dt), change)
        do(np.fmax, change, constant(-self.steer_rate * self.dt), change)
        do(np.add, self.steer, change, self.steer)
        do(np.multiply, change, constant(0.5), change)
        do(np.subtract, self.steer, change, half_turn)
        do(np.tan, half_turn, half_turn)
        do(np.divide, half_turn, constant(2.0 * self.wheelbase), half_turn)
        do(np.multiply, half_turn, way, half_turn)
        do(np.multiply, half_turn, constant(2.0 / self.dt), self.yaw_rate)
        do(np.multiply, self.yaw_rate, self.speed, self.lateral_accel)

    def _follow_arc(self, way: FloatArray, half_turn: FloatArray, course: FloatArray, part: FloatArray) -> None:
        """Lay down: the chord of the arc, in the direction of the heading half way."""
        do, constant = self.block.do, self.block.constant
        is_outside = np.empty(self.block.num, dtype=bool)
        do(np.add, self.yaw, half_turn, course)
        do(np.add, course, half_turn, self.yaw)
        do(np.add, half_turn, constant(TINY), half_turn)
        do(np.sin, half_turn, part)
        do(np.divide, part, half_turn, part)
        do(np.multiply, way, part, way)
        do(np.cos, course, part)
        do(np.multiply, part, way, part)
        do(np.add, self.x, part, self.x)
        do(np.sin, course, part)
        do(np.multiply, part, way, part)
        do(np.add, self.y, part, self.y)
        # A hair less, so that of the two borders -pi alone is outside: a car that goes due west costs nothing extra.
        do(np.subtract, self.yaw, constant(ULP_PI), part)
        do(np.absolute, part, part)
        do(np.greater_equal, part, constant(math.pi), is_outside)
        do(_wrap, self.yaw, is_outside)


def _wrap(yaw: FloatArray, is_outside: BoolArray) -> None:
    """Bring headings back into (-pi, pi], in place; hardly ever is there one to bring."""
    if np.count_nonzero(is_outside):
        yaw[:] = wrap_angle(yaw)

"""Motion of driven rows: the kinematic single track model with actuator limits.

The model. The reference point is the middle of the rear axle. There the velocity lies along the heading, so with speed
v, front wheel angle d and wheelbase L

    x' = v cos(yaw)     y' = v sin(yaw)     yaw' = v tan(d) / L

*Steering*: d follows the command with at most `max_steer_rate`; commands are clipped at `max_steer`.

*Longitudinal*: with throttle p and brake b (0..1), g = +1 in D, -1 in R, 0 in N and P,

    v' = g max_accel p  -  sign(v) (max_decel b + rolling + drag v^2)        [P adds max_decel to the bracket]

The bracket is friction: it slows down and holds, but never reverses the motion. So a vehicle at rest stays at exactly
0.0 until the throttle overcomes it.

*Controller* of the modes SPEED and ACCEL: the wanted acceleration a, counted in the direction of the gear, is
(target - v) / dt within the limits of the speed mode, or the command. The pedals come from solving the line above:
p = (a + rolling + drag v^2) / max_accel if that is positive, else b = -(...) / max_decel, both clipped at 1. So the
reported pedals are those that act. A speed is reached without overshoot, because model and inverse are the same.

*Integration* of one step. The acceleration is that at the beginning of the step, so v is linear within it and the
distance is s = (v0 + v1) / 2 dt. The wheel angle d is that in the middle of the step. The turn is s tan(d) / L = 2h,
and the path is a circular arc with the exact chord s sin(h) / h in the direction yaw + h. At constant steering every
step therefore ends on the true circle for any dt; otherwise the error falls with dt.

Limits of the model: no slip, so it takes any bend at any speed (beyond about 4 m/s^2 of lateral acceleration a real
car drifts to the outside). No pitch, no slope, no load transfer, no engine lag.

That is `Dynamics.KINEMATIC`. The equations of `Dynamics.SINGLE_TRACK` are in `single_track`; here they are applied to
the rows: to few rows one by one as Python floats, to many as arrays. Both give the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Final, Protocol, TypeVar

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, wrap_angle
from rosbridge_sim.world.state.entity_arrays import FLOATS as COLUMNS
from rosbridge_sim.world.state.loop_maker import LoopMaker
from rosbridge_sim.world.state.recorded_equations import RECORDED, EquationRecorder
from rosbridge_sim.world.state.row_program import MovedRows, RowProgram
from rosbridge_sim.world.state.world import DT, BoolArray, Dynamics, Kind, Mode
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.world.state.written_equations import Script, WrittenOperators
from rosbridge_sim.world.vehicle.ground import find_friction
from rosbridge_sim.world.vehicle.operators import Operators, V
from rosbridge_sim.world.vehicle.single_track import advance, make_car

ULP_PI: Final = math.ulp(math.pi)
"""From pi to the next number [rad]."""

FEW: Final = 4
"""Up to this number of rows, single floats are faster than arrays: 20 us for each row, or 150 us for all."""

FIRST, LAST = "front_load", "speed"
RESULTS: Final = ("rear_steer", "roll"), ("throttle", "speed")
_BODY: Final = ("front_load", "engine_drag"), ("wheelbase", "drag")
_STATE: Final = ("rear_steer_cmd", "steer_cmd"), ("throttle", "speed")
"""First and last of the columns that the single track model knows, those that it changes, of bodies, and the others."""

_LINES: Final = {name: line for line, name in enumerate(COLUMNS)}
_JERK_LIMIT: Final = _LINES["jerk_limit"] - _LINES[FIRST]

T = TypeVar("T")

TINY: Final = 1e-150
"""Added to h, so that sin(h) / h is TINY / TINY = 1 at h = 0; any other h keeps all its bits."""


def drive(world: WorldRows, dt: float) -> None:
    """Move all driven rows; see the head of this file for the equations.

    Args:
        world: written in place.
        dt: length of the step [s].
    """
    driven = world.derived(_Driven) if world.dynamics == Dynamics.KINEMATIC else world.derived(_SingleTrack)
    if driven.num:
        driven.advance(dt)


def _find_driven(world: WorldRows) -> IntArray:
    """Return the rows that the model moves, (k,) int64."""
    is_driven: BoolArray = world.alive & (world.kind == Kind.EGO) & ~world.is_ghost & (world.loose == 0.0)
    return is_driven.nonzero()[0]


class CarLoops(Protocol):
    """Loops that move the driven rows of the single track model by `DT`, see `kernels.car_kernel`."""

    def advance(self) -> None:
        """Move the rows."""


CAR_LOOPS: Final = LoopMaker[Callable[[WorldRows, IntArray], CarLoops]]()
"""The loops that move driven rows, from the next step of each world on."""


class _SingleTrack(MovedRows):
    """The driven rows of the single track model. It lives until the next `World.touch`."""

    def __init__(self, world: WorldRows) -> None:
        super().__init__(world, _find_driven(world))
        self._make: Callable[[WorldRows, IntArray], CarLoops] | None = None
        self._loops: CarLoops | None = None

    def advance(self, dt: float) -> None:
        """Move the rows by `dt` [s]."""
        find_friction(self.world, self.rows)
        if CAR_LOOPS.make is not self._make:
            self._make = CAR_LOOPS.make
            self._loops = None if self._make is None else self._make(self.world, self.rows)
        if self._loops is not None and dt == DT:
            self._loops.advance()
            return
        if dt != self.dt:
            self._prepare(dt)
        if self.num > FEW:
            self.program.run()
        else:
            self._advance_floats()

    def _prepare(self, dt: float) -> None:
        """Work out what follows from bodies alone."""
        self.dt = dt
        if self.num > FEW:
            self._write_program()
            return
        world = self.world
        self._inputs = world.block(FIRST, LAST)
        self._outputs = [world.block(*columns) for columns in RESULTS]
        self._cell = np.zeros(1)
        self._last: dict[int, tuple[bytes, FloatArray, FloatArray]] = {}
        self._advance = [
            _write_advance(dt, is_stable=world.has_stability_control, has_controller=has) for has in (False, True)
        ]

    def _write_program(self) -> None:
        program = self.program = RowProgram(self.world, self.rows, FIRST, LAST, written_from=RESULTS[0][0])
        recorder = EquationRecorder(program.num)
        given = [recorder.given(column) for column in program.values]
        after = find_after(RECORDED, given, self.dt, is_stable=self.world.has_stability_control)
        targets = [column for columns in RESULTS for column in columns_from(list(program.values), *columns)]
        recorder.finish(program, after, targets)

    def _advance_floats(self) -> None:
        inputs, (state, pose), cell = self._inputs, self._outputs, self._cell
        num = len(state)
        for row in self.rows.tolist():
            now = inputs[:, row]
            bits, last = now.tobytes(), self._last.get(row)
            if last is None or last[0] != bits:  # a car that stands has the same bits as in the last step
                figures = now.tolist()
                after = np.array(self._advance[figures[_JERK_LIMIT] > 0.0](figures, cell))
                last = self._last[row] = bits, after[:num], after[num:]
            state[:, row], pose[:, row] = last[1:]


@lru_cache(maxsize=8)
def _write_advance(
    dt: float, *, is_stable: bool, has_controller: bool
) -> Callable[[Sequence[float], FloatArray], tuple[float, ...]]:
    """Return the equations of one car as one function of the columns `FIRST` to `LAST`; see `Script.compile`.

    Args:
        dt: length of a step [s].
        has_controller: `jerk_limit` is positive: the controller presses the pedals.

    Returns:
        A function that returns the columns `rear_steer` to `roll`, then `throttle` to `speed`.
    """
    script = Script(_LINES[LAST] - _LINES[FIRST] + 1)
    do = WrittenOperators(script, is_any=has_controller)
    return script.compile(find_after(do, script.given, dt, is_stable=is_stable))


def columns_from(columns: Sequence[T], first: str, last: str) -> Sequence[T]:
    """Return those of the columns `FIRST` to `LAST` from one to another one."""
    return columns[_LINES[first] - _LINES[FIRST] : _LINES[last] - _LINES[FIRST] + 1]


def find_after(do: Operators[V], given: Sequence[V], dt: float, *, is_stable: bool) -> Sequence[V]:
    """Return the columns `RESULTS` one step later.

    Args:
        given: the columns `FIRST` to `LAST`.
        dt: length of the step [s].
    """
    body, limits = (list(columns_from(given, *names)) for names in _BODY)
    now = [value for names in _STATE for value in columns_from(given, *names)]
    return advance(do, make_car(do, body, limits, dt, is_stable=is_stable), now, dt)


class _Driven(MovedRows):
    """The driven rows of the kinematic model and the numpy calls that move them.

    It lives until the next `World.touch`: until an entity comes or goes, changes gear, or switches between pedals and
    controller. So everything that follows from body, mode and gear alone is worked out here, once. Friction and pedals
    are counted in change of speed for each step [m/s].
    """

    def __init__(self, world: WorldRows) -> None:
        super().__init__(world, _find_driven(world))
        self._at_rest = b""
        first, last = (self.rows[0], self.rows[-1] + 1) if self.num else (0, 0)
        self._now = world.block("target", "speed")[:, first:last] if last - first <= FEW else None

    def advance(self, dt: float) -> None:
        """Move the rows by `dt` [s]."""
        if self._now is None:
            super().advance(dt)
            return
        bits = self._now.tobytes()
        if bits != self._at_rest or dt != self.dt:
            super().advance(dt)
            # Cars that stand: the step has changed nothing, so it need not be done again.
            self._at_rest = bits if self._now.tobytes() == bits else b""

    def write_program(self) -> None:
        """Add the calls of a step; see the head of this file for the equations."""
        program = self.program = RowProgram(self.world, self.rows, "target", "speed", written_from="throttle")
        # In the order of `entity_arrays.FLOATS`; a count that does not fit fails here.
        self.target, self.accel_max, self.accel_min, self.throttle_max = program.values[:4]
        self.sense, self.full_throttle, self.holding, self.steer_cmd = program.values[4:8]
        self.wheelbase, self.steer_rate, self.max_accel, self.max_decel, self.rolling, self.drag = program.values[8:14]
        self.throttle, self.brake, self.steer, self.accel, self.lateral_accel, self.yaw_rate = program.values[14:20]
        self.x, self.y, self.yaw, self.speed = program.values[20:]
        resist, distance, *spare = np.empty((5, program.num))
        self._resist(resist)
        is_auto = self.world.mode[program.rows] != Mode.PEDALS
        if np.count_nonzero(is_auto):
            self._press(is_auto, resist, *spare)
        self._accelerate(resist, distance, *spare)
        self._steer(distance, half_turn=resist, change=spare[0])
        self._follow_arc(distance, resist, *spare[:2])

    def _resist(self, resist: FloatArray) -> None:
        """Add the calls for the resistance without a pedal, rolling + drag v^2."""
        do, constant = self.program.do, self.program.constant
        do(np.multiply, self.speed, self.speed, resist)
        do(np.multiply, resist, constant(self.drag * self.dt), resist)
        do(np.add, resist, constant(self.rolling * self.dt), resist)

    def _press(
        self, is_auto: BoolArray, resist: FloatArray, need: FloatArray, throttle: FloatArray, brake: FloatArray
    ) -> None:
        """Add the calls for the controller's pedals, from the wanted change of speed."""
        do, constant = self.program.do, self.program.constant
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
        self, resist: FloatArray, distance: FloatArray, push: FloatArray, friction: FloatArray, after: FloatArray
    ) -> None:
        """Add the calls for throttle, then friction, which takes at most all of the motion: v - clip(v, -f, f)."""
        do, constant = self.program.do, self.program.constant
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
        do(np.add, self.speed, after, distance)
        do(np.multiply, distance, constant(self.dt / 2), distance)
        do(np.copyto, self.speed, after)

    def _steer(self, distance: FloatArray, half_turn: FloatArray, change: FloatArray) -> None:
        """Add the calls that turn the wheels, and the car by their angle in the middle of the step."""
        do, constant = self.program.do, self.program.constant
        do(np.subtract, self.steer_cmd, self.steer, change)
        do(np.fmin, change, constant(self.steer_rate * self.dt), change)
        do(np.fmax, change, constant(-self.steer_rate * self.dt), change)
        do(np.add, self.steer, change, self.steer)
        do(np.multiply, change, constant(0.5), change)
        do(np.subtract, self.steer, change, half_turn)
        do(np.tan, half_turn, half_turn)
        do(np.divide, half_turn, constant(2.0 * self.wheelbase), half_turn)
        do(np.multiply, half_turn, distance, half_turn)
        do(np.multiply, half_turn, constant(2.0 / self.dt), self.yaw_rate)
        do(np.multiply, self.yaw_rate, self.speed, self.lateral_accel)

    def _follow_arc(self, distance: FloatArray, half_turn: FloatArray, course: FloatArray, part: FloatArray) -> None:
        """Add the calls for the chord of the arc, in the direction of the heading in the middle of the step."""
        do, constant = self.program.do, self.program.constant
        is_outside = np.empty(self.program.num, dtype=bool)
        do(np.add, self.yaw, half_turn, course)
        do(np.add, course, half_turn, self.yaw)
        do(np.add, half_turn, constant(TINY), half_turn)
        do(np.sin, half_turn, part)
        do(np.divide, part, half_turn, part)
        do(np.multiply, distance, part, distance)
        do(np.cos, course, part)
        do(np.multiply, part, distance, part)
        do(np.add, self.x, part, self.x)
        do(np.sin, course, part)
        do(np.multiply, part, distance, part)
        do(np.add, self.y, part, self.y)
        # A hair less, so that of the two borders -pi alone is outside: a car that goes due west costs nothing extra.
        do(np.subtract, self.yaw, constant(ULP_PI), part)
        do(np.absolute, part, part)
        do(np.greater_equal, part, constant(math.pi), is_outside)
        do(_wrap, self.yaw, is_outside)


def _wrap(yaw: FloatArray, is_outside: BoolArray) -> None:
    """Bring headings back into (-pi, pi], in place; this is rarely needed."""
    if np.count_nonzero(is_outside):
        yaw[:] = wrap_angle(yaw)

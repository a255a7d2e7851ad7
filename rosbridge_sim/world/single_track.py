"""Motion of driven rows: a dynamic single track model with tyres, lags of the actuators, and a body that leans.

One frame of one car: the equations stand here once. `V` is a Python float, or a `recorded.Value`, which stands for an
array with one entry for each car. Both give the same bits: sums, products, quotients and roots are correctly rounded in
both, and the few other functions are numpy's in both (`Operators`).

*State*: place and heading of the middle of the rear axle, there the speed u along the heading and w to the left, the
yaw rate r, the angles of the wheels, the pedals as engine and brakes follow them, and the lean of the body.

*Actuators*. Wheels turn with a limited rate. Engine and brakes follow their pedals as lags of first order.

*Load*. With the distances a and b of the centre of gravity from the axles, its height h, and the last acceleration:

    N_f = (g b - h u') / L        N_r = (g a + h u') / L             [for each kg of the car]

*Tyres*. An axle has one slip angle s: the direction in which its wheels move, seen from where they point. The force
across them is Pacejka's magic formula (Tyre and Vehicle Dynamics, ch. 4) without its shifts and its curvature factor:

    F = -D sin(C arctan(K s / (C D)))        K = stiffness N        D = sqrt((mu N)^2 - X^2)

X is the force along the wheels, so both together stay within the friction circle. It is at most `SHARE_OF_GRIP` of mu
N: that is what ABS and traction control leave. The brakes act on the axles in proportion to their loads.

*Motion*. With k^2 = I_z / m and the forces across and along the body:

    u' = sum of forces along + (w + b r) r        w' + b r' = sum of forces across - u r
    k^2 r' = a F_f - b F_r

*Integration*. Lateral motion is stiff at low speed: its fastest part dies within C g / u = 40 ms at 5 m/s. So the step
of w and r is linearly implicit: both axles' forces are linear in their lateral speeds, with the secant stiffness
-F / s. The weight of the end of the step is between 1/2 (second order, for slow parts) and 1 (fast parts vanish), as
the exact solution of a linear equation has it (Liniger and Willoughby 1970). The linear step is stable for any dt.
There is one step for a frame, without substeps.

*Low speed*. Slip angles have no meaning at rest. Below `BLEND_FROM` w and r are those of wheels that roll where they
point, above `BLEND_TO` those of the tyres, and in between a smooth mean.

*Rest*. Friction (brakes, rolling, air) takes at most all of the motion. A car at rest does not move by a slope, but
only by its engine, unless `rolls` is 1.

*Controller* (speed and acceleration mode). The wanted acceleration falls with the distance from the target in such a
way that its change stays below `PLANNED_JERK`. In speed mode the acceleration changes by at most `jerk_limit` anyway.
The pedals come from solving the equations above, lags included, as far as pedals of 0..1 can.

*Lean*. Pitch and roll of the body follow the accelerations as a lag of first order.

Limits of the model: one wheel for each axle, so no load transfer between left and right; no relaxation length of the
tyres; the wheels have no inertia.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from rosbridge_sim.world.geometry import wrap_angle
from rosbridge_sim.world.recorded import Value

__all__ = ["BLEND_FROM", "BLEND_TO", "FLOATS", "Car", "Operators", "advance", "make_car"]

V = TypeVar("V", float, Value)

G: Final = 9.80665
"""Acceleration of free fall [m/s^2]."""

SHAPE: Final = 1.35
"""C of the magic formula: between 1.3, Pacejka's value for lateral force, and 1.4; the force of a sliding tyre is 85 %
of its peak."""

SHARE_OF_GRIP: Final = 0.95
"""Share of the grip that brakes and engine can use: the usual efficiency of ABS."""

THROTTLE_LAG: Final = 0.2
BRAKE_LAG: Final = 0.15
"""Time constants of engine and brakes [s]."""

LEAN_LAG: Final = 0.15
"""Time constant of the body's lean [s]: springs and dampers of a car settle within half a second."""

BLEND_FROM: Final = 1.0
BLEND_TO: Final = 3.0
"""Speeds between which tyres take over from rolling wheels [m/s]."""

MIN_ROLLING: Final = 0.5
"""Slip angles count as those at this speed at least [m/s]; it is below `BLEND_FROM`."""

PLANNED_JERK: Final = 8.0
"""Change of acceleration that the controller plans with [m/s^3], below the limit of 10."""

SETTLING: Final = 0.25
"""Time constant of the end of a change of speed [s]. It is longer than the lags, or the speed would overshoot."""

CREEP_SPEED: Final = 1.9
"""Speed at which the engine no longer pushes by itself [m/s]; rolling resistance leaves 5 km/h."""

STILL: Final = 1e-6
"""Pedals and slip angles below this are 0, and a body leans no more [rad]: so all that decays ends."""

MOST_TRANSFER: Final = 0.9
"""Share of its load that an axle can lose by acceleration."""

MIN_DETERMINANT: Final = 0.05
"""Bound of the divisor of the implicit step. It is near 1 for any car; arrays from outside may hold anything."""


class Operators(Protocol[V]):
    """Functions that differ for floats and arrays; the results have the same bits."""

    def least(self, a: V, b: V | float, /) -> V:
        """Return the smaller one; 0 without a sign."""

    def most(self, a: V, b: V | float, /) -> V:
        """Return the greater one; 0 without a sign."""

    def pick(self, condition: V, if_positive: V | float, otherwise: V | float, /) -> V:
        """Return the second argument where the first one is positive, else the third one."""

    def is_any(self, a: V, /) -> bool:
        """Return whether any number may be positive."""

    def magnitude(self, a: V, /) -> V:
        """Return the amount."""

    def root(self, a: V, /) -> V:
        """Return the square root of a number >= 0."""

    def sin(self, a: V, /) -> V:
        """Return the sine."""

    def cos(self, a: V, /) -> V:
        """Return the cosine."""

    def arctan(self, a: V, /) -> V:
        """Return the arc tangent."""

    def wrap(self, a: V, /) -> V:
        """Return an angle within (-pi, pi]; one inside keeps its bits."""


class _Floats:
    """Operators of single floats. The functions of numpy get an array of one element, which they write into."""

    def __init__(self) -> None:
        self._cell = np.zeros(1)

    def least(self, a: float, b: float, /) -> float:
        return (b if b < a else a) + 0.0

    def most(self, a: float, b: float, /) -> float:
        return (b if b > a else a) + 0.0

    def pick(self, condition: float, if_positive: float, otherwise: float, /) -> float:
        return if_positive if condition > 0.0 else otherwise

    def is_any(self, a: float, /) -> bool:
        return a > 0.0

    def magnitude(self, a: float, /) -> float:
        return abs(a)

    def root(self, a: float, /) -> float:
        return math.sqrt(a)

    def sin(self, a: float, /) -> float:
        cell = self._cell
        cell[0] = a
        return np.sin(cell, cell).item()

    def cos(self, a: float, /) -> float:
        cell = self._cell
        cell[0] = a
        return np.cos(cell, cell).item()

    def arctan(self, a: float, /) -> float:
        cell = self._cell
        cell[0] = a
        return np.arctan(cell, cell).item()

    def wrap(self, a: float, /) -> float:
        return a if -math.pi < a <= math.pi else wrap_angle(a).item()


FLOATS: Final[Operators[float]] = _Floats()


class Car(NamedTuple, Generic[V]):
    """What follows from body and gear alone.

    Attributes:
        wheelbase, to_front, to_rear: L, a and b [m].
        front_rest, rear_rest: loads at rest [N/kg].
        transfer: h / L.
        transfer_min, transfer_max: bounds of the load that moves to the rear [N/kg].
        own_front, own_rear, cross: accelerations across at an axle for a force at the same, or the other, axle.
        front_stiffness, rear_stiffness: for each newton of load, divided by C [1/rad].
        grip, front_drive, pitch_gain, roll_gain: as in `Body`.
        steer_change: of the wheels in one step [rad].
        max_accel, max_decel, rolling, drag: as in `Body`.
    """

    wheelbase: V
    to_front: V
    to_rear: V
    front_rest: V
    rear_rest: V
    transfer: V
    transfer_min: V
    transfer_max: V
    own_front: V
    own_rear: V
    cross: V
    front_stiffness: V
    rear_stiffness: V
    grip: V
    front_drive: V
    pitch_gain: V
    roll_gain: V
    steer_change: V
    max_accel: V
    max_decel: V
    rolling: V
    drag: V
    throttle_share: float
    brake_share: float
    lean_share: float


def make_car(body: Sequence[V], limits: Sequence[V], dt: float) -> Car[V]:
    """Work out what does not change from frame to frame.

    Args:
        body: the columns `front_load` to `roll_gain`.
        limits: the columns `wheelbase` to `drag`.
        dt: length of a step [s].
    """
    front_load, cg_height, dynamic_index, front_stiffness, rear_stiffness, grip, front_drive, pitch, roll = body
    wheelbase, steer_rate, max_accel, max_decel, rolling, drag = limits
    to_rear = front_load * wheelbase
    to_front = wheelbase - to_rear
    front_rest, rear_rest = G * front_load, G * (1.0 - front_load)
    return Car(
        wheelbase,
        to_front,
        to_rear,
        front_rest,
        rear_rest,
        cg_height / wheelbase,
        -MOST_TRANSFER * rear_rest,
        MOST_TRANSFER * front_rest,
        # k^2 = index a b
        1.0 + to_front / (dynamic_index * to_rear),
        1.0 + to_rear / (dynamic_index * to_front),
        1.0 - 1.0 / dynamic_index,
        front_stiffness / SHAPE,
        rear_stiffness / SHAPE,
        grip,
        front_drive,
        pitch,
        roll,
        steer_rate * dt,
        max_accel,
        max_decel,
        rolling,
        drag,
        -math.expm1(-dt / THROTTLE_LAG),
        -math.expm1(-dt / BRAKE_LAG),
        -math.expm1(-dt / LEAN_LAG),
    )


def advance(do: Operators[V], car: Car[V], now: Sequence[V], dt: float) -> tuple[V, ...]:
    """Return the state one step later.

    Args:
        do: of the numbers' type.
        car: of the car or the cars.
        now: the columns `rear_steer_cmd` to `roll` and `target` to `steer_cmd`, then `throttle` to `speed`.
        dt: length of the step [s].

    Returns:
        The columns `rear_steer` to `roll`, then `throttle` to `speed`.
    """
    rear_cmd, creep, rolls, jerk_limit, friction, grade, ground_pitch, ground_roll = now[:8]
    rear_steer, drive_lag, brake_lag, w, _, _, _, front_force, rear_force, lean_pitch, lean_roll = now[8:19]
    target, accel_max, accel_min, throttle_max, sense, drive, holding, steer_cmd = now[23:31]
    throttle, brake, steer, accel, _, r, x, y, yaw, u = now[31:]
    least, most, pick, magnitude = do.least, do.most, do.pick, do.magnitude
    wheelbase, to_rear = car.wheelbase, car.to_rear

    # Wheels
    limit = car.steer_change
    change = most(least(steer_cmd - steer, limit), -limit)
    rear_change = most(least(rear_cmd - rear_steer, limit), -limit)
    steer, rear_steer = steer + change, rear_steer + rear_change
    half_change, half_rear_change = 0.5 * change, 0.5 * rear_change
    angle, rear_angle = steer - half_change, rear_steer - half_rear_change
    sin_f, cos_f, sin_r, cos_r = do.sin(angle), do.cos(angle), do.sin(rear_angle), do.cos(rear_angle)

    # Share of the tyres in the motion
    part = (u * u + w * w - BLEND_FROM * BLEND_FROM) * (1.0 / (BLEND_TO * BLEND_TO - BLEND_FROM * BLEND_FROM))
    part = least(most(part, 0.0), 1.0)
    share = part * part * (3.0 - 2.0 * part)

    # Pedals
    resist = car.rolling + car.drag * (u * u)
    turning = (w + to_rear * r) * r
    if do.is_any(jerk_limit):
        against = resist - sense * (share * (turning - front_force * sin_f - rear_force * sin_r) + grade)
        wanted = target, accel_min, accel_max, throttle_max, jerk_limit
        aim, aim_brake = _press(do, car, (sense * u, sense * accel, drive_lag, brake_lag), wanted, against, dt)
        throttle, brake = pick(jerk_limit, aim, throttle), pick(jerk_limit, aim_brake, brake)
    drive_lag = drive_lag + (throttle - drive_lag) * car.throttle_share
    brake_lag = brake_lag + (brake - brake_lag) * car.brake_share
    drive_lag, brake_lag = pick(drive_lag - STILL, drive_lag, 0.0), pick(brake_lag - STILL, brake_lag, 0.0)

    # Loads and forces along the wheels
    moved = most(least(car.transfer * accel, car.transfer_max), car.transfer_min)
    front_load, rear_load = car.front_rest - moved, car.rear_rest + moved
    grip = friction * car.grip
    front_grip, rear_grip = grip * front_load, grip * rear_load
    push = sense * most(drive_lag * (sense * drive), creep - creep * (1.0 / CREEP_SPEED) * magnitude(u))
    front_most, rear_most = SHARE_OF_GRIP * front_grip, SHARE_OF_GRIP * rear_grip
    front_push = most(least(car.front_drive * push, front_most), -front_most)
    rear_push = most(least(push - car.front_drive * push, rear_most), -rear_most)
    push = front_push + rear_push
    braking = least(brake_lag * car.max_decel + holding, SHARE_OF_GRIP * (grip * G))
    slowing = pick(u, braking, -braking) * (1.0 / G)
    front_along = most(least(front_push - slowing * front_load, front_most), -front_most)
    rear_along = most(least(rear_push - slowing * rear_load, rear_most), -rear_most)

    # Forces across the wheels
    front_slip, front_force, front_rate = _grip(
        do, u, w + wheelbase * r, (sin_f, cos_f), (car.front_stiffness * front_load, front_grip, front_along)
    )
    rear_slip, rear_force, rear_rate = _grip(
        do, u, w, (sin_r, cos_r), (car.rear_stiffness * rear_load, rear_grip, rear_along)
    )
    front_across = front_force * cos_f + front_along * sin_f
    rear_across = rear_force * cos_r + rear_along * sin_r

    # Along
    lost = front_along * (1.0 - cos_f) + rear_along * (1.0 - cos_r) + front_force * sin_f + rear_force * sin_r
    push = push * dt
    against = (braking + resist) * dt
    after = u + (push + (share * (turning - lost) + grade) * dt)
    after = after - most(least(after, against), -against)
    # At rest a slope moves the car no further than its engine does; in between, neither moves it.
    net = push - most(least(push, against), -against)
    held = most(least(after, most(net, 0.0)), least(net, 0.0))
    after = pick(u * u + w * w + rolls, after, held)
    mean = 0.5 * (u + after)

    # Across
    spin = mean * r
    front_error = dt * (car.own_front * front_across + car.cross * rear_across - spin)
    rear_error = dt * (car.cross * front_across + car.own_rear * rear_across - spin)
    own_front, own_rear = car.own_front * front_rate, car.own_rear * rear_rate
    fast = (0.5 * dt) * (own_front + own_rear)
    weight = dt * ((6.0 + 2.0 * fast) / (12.0 + 2.0 * fast))
    carry = mean / wheelbase
    m_ff, m_fr = 1.0 + weight * (own_front + carry), weight * (car.cross * rear_rate - carry)
    m_rf, m_rr = weight * (car.cross * front_rate + carry), 1.0 + weight * (own_rear - carry)
    determinant = most(m_ff * m_rr - m_fr * m_rf, MIN_DETERMINANT)
    front_change = (front_error * m_rr - m_fr * rear_error) / determinant
    w_change = (m_ff * rear_error - m_rf * front_error) / determinant
    # Wheels that roll where they point, at the end of the step
    tan_f, tan_r = sin_f / cos_f, sin_r / cos_r
    tan_f, tan_r = tan_f + half_change * (1.0 + tan_f * tan_f), tan_r + half_rear_change * (1.0 + tan_r * tan_r)
    w_after, r_after = after * tan_r, after * (tan_f - tan_r) / wheelbase
    w_after = w_after + share * (w + w_change - w_after)
    r_after = r_after + share * (r + (front_change - w_change) / wheelbase - r_after)

    # Pose: the chord of an arc, in the direction of the heading in the middle of the step
    r_mean, w_mean = 0.5 * (r + r_after), 0.5 * (w + w_after)
    half = (0.5 * dt) * r_mean
    square = half * half
    chord = dt * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)))  # sin(h) / h, as h is small
    course = yaw + half
    cos, sin = do.cos(course), do.sin(course)
    x = x + chord * (mean * cos - w_mean * sin)
    y = y + chord * (mean * sin + w_mean * cos)
    yaw = do.wrap(course + half)
    accel = (after - u) / dt - r_mean * w_mean
    lateral_accel = (w_after - w) / dt + r_mean * mean

    # Lean
    pitch_change = (-car.pitch_gain * accel - lean_pitch) * car.lean_share
    roll_change = (car.roll_gain * lateral_accel - lean_roll) * car.lean_share
    pitch_change = pick(magnitude(lean_pitch + pitch_change) - STILL, pitch_change, -lean_pitch)
    roll_change = pick(magnitude(lean_roll + roll_change) - STILL, roll_change, -lean_roll)
    lean_pitch, lean_roll = lean_pitch + pitch_change, lean_roll + roll_change
    return (
        *(rear_steer, drive_lag, brake_lag, w_after, (r_after - r) / dt),
        *(share * front_slip, share * rear_slip, front_force, rear_force),
        *(lean_pitch, lean_roll, pitch_change / dt, roll_change / dt),
        *(ground_pitch + lean_pitch, ground_roll + lean_roll),
        *(throttle, brake, steer, accel, lateral_accel, r_after, x, y, yaw, after),
    )


def _press(  # noqa: PLR0913, PLR0917 - one equation
    do: Operators[V],
    car: Car[V],
    state: tuple[V, V, V, V],
    aims: tuple[V, V, V, V, V],
    resist: V,
    dt: float,
) -> tuple[V, V]:
    """Return throttle and brake of the controller; see the head of this file.

    Args:
        do: of the numbers' type.
        car: of the cars.
        state: speed and acceleration in the direction of the gear, and the lags of throttle and brake.
        aims: the columns target, accel_min, accel_max, throttle_max and jerk_limit.
        resist: deceleration without pedals [m/s^2].
        dt: length of the step [s].
    """
    speed, accel, drive_lag, brake_lag = state
    target, accel_min, accel_max, throttle_max, jerk_limit = aims
    least, most = do.least, do.most
    error = target - speed
    amount = do.magnitude(error)
    near = PLANNED_JERK * SETTLING * SETTLING
    far = do.root(2.0 * PLANNED_JERK * (most(amount, near) - 0.5 * near))
    wanted = least(amount * (1.0 / SETTLING), far)
    wanted = most(least(do.pick(error, wanted, -wanted), accel_max), accel_min)
    change = jerk_limit * dt
    need = most(least(wanted, accel + change), accel - change) + resist
    brake = brake_lag + (need / -car.max_decel - brake_lag) * (1.0 / car.brake_share)
    brake = least(most(brake, 0.0), 1.0)
    after = brake_lag + (brake - brake_lag) * car.brake_share
    throttle = drive_lag + ((need + after * car.max_decel) / car.max_accel - drive_lag) * (1.0 / car.throttle_share)
    return least(most(throttle, 0.0), throttle_max), brake


def _grip(do: Operators[V], u: V, across: V, wheels: tuple[V, V], limits: tuple[V, V, V]) -> tuple[V, V, V]:
    """Return slip angle, force across the wheels, and its change with the lateral speed of the axle.

    Args:
        do: of the numbers' type.
        u: speed along the body [m/s].
        across: lateral speed of the axle [m/s].
        wheels: sine and cosine of their angle.
        limits: stiffness of the axle / C, its grip and the force along the wheels [N/kg].
    """
    sin, cos = wheels
    stiffness, grip, along = limits
    rolling = do.most(do.magnitude(u * cos + across * sin), MIN_ROLLING)
    slip = do.arctan((across * cos - u * sin) / rolling)
    most = do.root(grip * grip - along * along)
    force = -most * do.sin(SHAPE * do.arctan(stiffness * slip / most))
    is_slipping = do.magnitude(slip) - STILL
    secant = do.pick(is_slipping, -force / do.pick(is_slipping, slip, 1.0), SHAPE * stiffness)
    return slip, force, secant * (cos * cos) / rolling

"""Motion of driven rows: a dynamic single track model with tyres, lags of the actuators, and a body that leans.

One frame of one car: the equations stand here once. `V` is a written `Term`, which stands for a Python float, or a
recorded `Value`, which stands for an array with one entry for each car. Both give the same bits: sums, products,
quotients and roots are correctly rounded in both, and the few other functions are numpy's in both (`Operators`).

*State*: place and heading of the middle of the rear axle, there the speed u along the heading and w to the left, the
yaw rate r, the angles of the wheels, the pedals as engine and brakes follow them, and the lean of the body.

*Actuators*. Wheels turn with a limited rate. Engine and brakes follow their pedals as lags of first order.

*Engine*. Full throttle gives the least of three accelerations: that from rest, power / speed, and the resistance of the
road plus (top speed - speed) / `TOP_LAG`. So the top speed is reached and not passed. In D and R an engine without
throttle slows the car; the throttle goes evenly from there to full. Air and rolling resistance act in all gears.

*Load*. With the distances a and b of the centre of gravity from the axles, its height h, and the acceleration p by
engine and brakes:

    N_f = (g b - h p) / L         N_r = (g a + h p) / L              [for each kg of the car]

*Tyres*. An axle has one slip angle s: the direction in which its wheels move, seen from where they point. The force
across them is Pacejka's magic formula (Tyre and Vehicle Dynamics, ch. 4) without its shifts and its curvature factor:

    F = -D sin(C arctan(K s / (C D)))        K = stiffness N        D = mu N sqrt(1 - (X / (mu_x N))^2)

X is the force along the wheels, mu and mu_x are the frictions across and along them. So both forces together stay
within the friction ellipse. X is at most `SHARE_OF_GRIP` of mu_x N: that is what ABS and traction control leave. The
brakes act on the axles in proportion to their loads, unless stability control moves them to the front; see `stability`.

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
way that its change stays below `PLANNED_JERK`. In speed mode the acceleration changes by at most `jerk_limit` anyway,
and the pedals come from solving the equations above, lags included, as far as pedals of 0..1 can. In acceleration mode
the pedals are those that hold the command, so it is reached with the lags of engine and brakes.

*Lean*. Pitch and roll of the body follow the accelerations as a lag of first order.

Limits of the model: one wheel for each axle, so no load transfer between left and right; no relaxation length of the
tyres; the wheels have no inertia.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Generic, NamedTuple

from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.vehicle import stability
from rosbridge_sim.world.vehicle.operators import Operators, V

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

ENGINE_DRAG_FROM: Final = 1.9
ENGINE_DRAG_TO: Final = 5.0
"""Speeds between which the drag of the engine grows from 0 to all of it [m/s]. Below, up to `CREEP_SPEED`, an
engine without throttle pulls."""

REVERSE_SPEED: Final = 40.0 / 3.6
"""Top speed in R [m/s]: an estimate, for makers do not publish it."""

TOP_LAG: Final = 0.5
"""Time in which a car comes near its top speed [s]."""

MIN_PULL: Final = 0.01
"""Least range of accelerations that the controller divides by [m/s^2]."""

MIN_SPEED: Final = 0.01
"""Least speed that a power is divided by [m/s]; only a car without power gets it."""

MOST_JERK: Final = 1e6
"""A limit above this is none [m/s^3]: `control_columns` has infinity in acceleration mode."""

SETTLING: Final = 0.25
"""Time constant of the end of a change of speed [s]. It is longer than the lags, or the speed would overshoot."""

CREEP_SPEED: Final = 1.9
"""Speed at which the engine no longer pushes by itself [m/s]; rolling resistance leaves 5 km/h."""

STILL: Final = 1e-6
"""Pedals and slip angles below this are 0, and a body leans no more [rad]: so all that decays ends."""

MOST_TRANSFER: Final = 0.9
"""Share of its load that an axle can lose by acceleration."""

MIN_GRIP: Final = 1e-3
"""Least grip of tyres; without any, the equations would divide by 0. Wet ice has 0.05."""

MIN_DETERMINANT: Final = 0.05
"""Bound of the divisor of the implicit step. It is near 1 for any car; arrays from outside may hold anything."""


class Car(NamedTuple, Generic[V]):
    """Constants of the model that follow from body and gear.

    Attributes:
        wheelbase, to_front, to_rear: L, a and b [m].
        front_rest, rear_rest: loads at rest [N/kg].
        transfer: h / L.
        transfer_min, transfer_max: bounds of the load that moves to the rear [N/kg].
        own_front, own_rear, cross: accelerations across at an axle for a force at the same, or the other, axle.
        front_stiffness, rear_stiffness: for each newton of load, divided by C [1/rad].
        grip, front_drive, pitch_gain, roll_gain: as in `Body`.
        steer_change: of the wheels in one step [rad].
        launch_accel, power, top_speed, air_drag, engine_drag: as in `Body`.
        reverse_speed: top speed in R [m/s].
        max_along, share_along: force along the wheels that ABS leaves, for a friction of the tyres across of 1: of the
            car [N/kg], and of an axle for each newton of its load.
        to_across: grip across / grip along: what a force along takes from that across.
        max_decel: that of `Body` times its grip along: who fits better tyres fits brakes that use them.
        rolling: as in `Body`.
        yaw_control: constants of the stability control; None without it.
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
    launch_accel: V
    power: V
    top_speed: V
    reverse_speed: V
    air_drag: V
    engine_drag: V
    steer_change: V
    max_along: V
    share_along: V
    to_across: V
    max_decel: V
    rolling: V
    yaw_control: stability.YawControl[V] | None
    throttle_share: float
    brake_share: float
    lean_share: float


def make_car(do: Operators[V], body: Sequence[V], limits: Sequence[V], dt: float, *, is_stable: bool) -> Car[V]:
    """Work out what does not change from frame to frame.

    Args:
        body: the columns `front_load` to `engine_drag`.
        limits: the columns `wheelbase` to `drag`.
        dt: length of a step [s].
    """
    front_load, cg_height, dynamic_index, front_stiffness, rear_stiffness, grip, grip_along = body[:7]
    front_drive, pitch, roll, launch_accel, power, top_speed, air_drag, engine_drag = body[7:]
    wheelbase, steer_rate, _, max_decel, rolling, _ = limits
    to_rear = front_load * wheelbase
    to_front = wheelbase - to_rear
    front_rest, rear_rest = GRAVITY * front_load, GRAVITY * (1.0 - front_load)
    to_axles = to_front, to_rear
    control = stability.make_control(to_axles, dynamic_index, (front_stiffness, rear_stiffness)) if is_stable else None
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
        launch_accel,
        power,
        top_speed,
        do.least(top_speed, REVERSE_SPEED),
        air_drag,
        engine_drag,
        steer_rate * dt,
        (SHARE_OF_GRIP * GRAVITY) * (grip_along / grip),
        SHARE_OF_GRIP * (grip_along / grip),
        grip / grip_along,
        max_decel * grip_along,
        rolling,
        control,
        -math.expm1(-dt / THROTTLE_LAG),
        -math.expm1(-dt / BRAKE_LAG),
        -math.expm1(-dt / LEAN_LAG),
    )


def advance(  # noqa: PLR0915 - one equation after the other
    do: Operators[V], car: Car[V], now: Sequence[V], dt: float
) -> Sequence[V]:
    """Return the state one step later.

    Args:
        now: the columns `rear_steer_cmd` to `roll` and `target` to `steer_cmd`, then `throttle` to `speed`.
        dt: length of the step [s].

    Returns:
        The columns `rear_steer` to `roll`, then `throttle` to `speed`.
    """
    rear_cmd, creep, rolls, jerk_limit, friction, grade, ground_pitch, ground_roll = now[:8]
    rear_steer, drive_lag, brake_lag, w, _, _, _, front_force, rear_force, lean_pitch, lean_roll = now[8:19]
    target, accel_max, accel_min, throttle_max, sense, drive, holding, steer_cmd = now[23:31]
    throttle, brake, steer, accel, _, r, x, y, yaw, u = now[31:]
    pick = do.pick

    # Wheels
    steer, front_wheels = _turn(do, steer, steer_cmd, car.steer_change)
    rear_steer, rear_wheels = _turn(do, rear_steer, rear_cmd, car.steer_change)
    sin_f, cos_f, tan_f = front_wheels
    sin_r, cos_r, tan_r = rear_wheels

    # Share of the tyres in the motion
    part = (u * u + w * w - BLEND_FROM * BLEND_FROM) * (1.0 / (BLEND_TO * BLEND_TO - BLEND_FROM * BLEND_FROM))
    part = do.least(do.most(part, 0.0), 1.0)
    share = part * part * (3.0 - 2.0 * part)

    # Pedals
    resist, pull = _pull(do, car, u, sense, drive)
    turning = (w + car.to_rear * r) * r
    if do.is_any(jerk_limit):
        against = resist - sense * (share * (turning - front_force * sin_f - rear_force * sin_r) + grade)
        aims = target, accel_min, accel_max, throttle_max, jerk_limit
        motion = sense * u, sense * (accel + r * w), drive_lag, brake_lag
        aim, aim_brake = _press(do, car, motion, aims, (against, do.most(pull, MIN_PULL)), dt)
        throttle, brake = pick(jerk_limit, aim, throttle), pick(jerk_limit, aim_brake, brake)
    drive_lag = drive_lag + (throttle - drive_lag) * car.throttle_share
    brake_lag = brake_lag + (brake - brake_lag) * car.brake_share
    drive_lag, brake_lag = pick(drive_lag - STILL, drive_lag, 0.0), pick(brake_lag - STILL, brake_lag, 0.0)
    push = sense * do.most(drive_lag * pull, creep - creep * (1.0 / CREEP_SPEED) * do.magnitude(u))

    # Forces
    grip = do.most(friction * car.grip, MIN_GRIP)
    turned, tyres = (u, r, tan_f - tan_r), (share, front_force, rear_force)
    pressed, turn, reserve = _stabilize(do, car, grip, turned, tyres, brake_lag * car.max_decel + holding)
    push, braking, front, rear = _load(do, car, grip, u, push, pressed, reserve)
    front_slip, front_force, front_rate = _grip(do, car, u, w + car.wheelbase * r, (sin_f, cos_f), front)
    rear_slip, rear_force, rear_rate = _grip(do, car, u, w, (sin_r, cos_r), rear)

    # Along
    lost = front[2] * (1.0 - cos_f) + rear[2] * (1.0 - cos_r) + front_force * sin_f + rear_force * sin_r
    after = _roll(do, (u, w), push * dt, (share * (turning - lost) + grade) * dt, (braking + resist) * dt, rolls)
    mean = 0.5 * (u + after)

    # Across
    front_across = front_force * cos_f + front[2] * sin_f
    rear_across = rear_force * cos_r + rear[2] * sin_r
    r_change, w_change = _slide(do, car, mean, r, (front_across, rear_across), (front_rate, rear_rate), turn, dt)
    # Wheels that roll where they point, and the share of the tyres in the change from there
    w_after, r_after = after * tan_r, after * (tan_f - tan_r) / car.wheelbase
    w_after = w_after + share * (w + w_change - w_after)
    r_after = r_after + share * (r + r_change - r_after)

    r_mean, w_mean = 0.5 * (r + r_after), 0.5 * (w + w_after)
    x, y, yaw = _move(do, (x, y, yaw), (mean, w_mean, r_mean), dt)
    accel = (after - u) / dt - r_mean * w_mean
    lateral_accel = (w_after - w) / dt + r_mean * mean
    yaw_accel = (r_after - r) / dt

    pitch_change, lean_pitch = _lean(do, lean_pitch, -car.pitch_gain * accel, car.lean_share)
    roll_change, lean_roll = _lean(do, lean_roll, car.roll_gain * lateral_accel, car.lean_share)
    pitch, roll = ground_pitch + lean_pitch, ground_roll + lean_roll
    lags = [rear_steer, drive_lag, brake_lag, w_after, yaw_accel]
    forces = [share * front_slip, share * rear_slip, front_force, rear_force]
    leans = [lean_pitch, lean_roll, pitch_change / dt, roll_change / dt, pitch, roll]
    return lags + forces + leans + [throttle, brake, steer, accel, lateral_accel, r_after, x, y, yaw, after]


def _pull(do: Operators[V], car: Car[V], u: V, sense: V, drive: V) -> tuple[V, V]:
    """Return the deceleration without pedals on a level road, and what full throttle adds to it [m/s^2].

    Args:
        u: speed along the body [m/s].
        sense: direction of the gear.
        drive: not 0 in D and R.
    """
    least, most = do.least, do.most
    resist = car.rolling + car.air_drag * (u * u)
    part = (do.magnitude(u) - ENGINE_DRAG_FROM) * (1.0 / (ENGINE_DRAG_TO - ENGINE_DRAG_FROM))
    engine_drag = car.engine_drag * least(most(part, 0.0), 1.0)
    speed = sense * u
    top = do.pick(sense, car.top_speed, car.reverse_speed)
    # Power / speed, without a division by 0
    full = car.power / most(most(speed, car.power / most(car.launch_accel, MIN_PULL)), MIN_SPEED)
    full = most(least(full, resist + (top - speed) * (1.0 / TOP_LAG)), 0.0)
    is_in_gear = do.magnitude(drive)
    return resist + do.pick(is_in_gear, engine_drag, 0.0), do.pick(is_in_gear, full + engine_drag, 0.0)


def _turn(do: Operators[V], angle: V, command: V, limit: V) -> tuple[V, tuple[V, V, V]]:
    """Return the angle of wheels after the step; sine and cosine of it in the middle, and the tangent at the end."""
    change = do.most(do.least(command - angle, limit), -limit)
    angle = angle + change
    half = 0.5 * change
    middle = angle - half
    sin, cos = do.sin(middle), do.cos(middle)
    tan = sin / cos
    return angle, (sin, cos, tan + half * (1.0 + tan * tan))


def _stabilize(  # noqa: PLR0917 - keywords would take a tenth of the time
    do: Operators[V], car: Car[V], grip: V, motion: tuple[V, V, V], tyres: tuple[V, V, V], pressed: V
) -> tuple[V, V | None, tuple[V, V] | None]:
    """Return braking [N/kg], change of the yaw rate by it [rad/s^2], and forces that it must leave across [N/kg].

    Args:
        grip: of all tyres, for each newton of load.
        motion: speed along the body, yaw rate, and tangent of the front wheels' angle less that of the rear wheels.
        tyres: share of the tyres in the motion, and forces across at both axles.
        pressed: braking by the pedal [N/kg].
    """
    if car.yaw_control is None:
        return pressed, None, None
    share, front, rear = tyres
    u, r, turned = motion
    turn, more = stability.correct(do, car.yaw_control, grip, (u, r), turned)
    return do.most(pressed, share * more), share * turn, (do.magnitude(share * front), do.magnitude(share * rear))


def _load(  # noqa: PLR0917 - keywords would take a tenth of the time
    do: Operators[V], car: Car[V], grip: V, u: V, push: V, braking: V, reserve: tuple[V, V] | None
) -> tuple[V, V, tuple[V, V, V], tuple[V, V, V]]:
    """Return what the tyres take of engine and brakes, and for each axle: stiffness / C, grip, force along the wheels.

    Args:
        grip: of all tyres, for each newton of load.
        u: speed along the body [m/s].
        push: of the engine, along the body [N/kg].
        braking: against the motion, not negative [N/kg].
        reserve: forces across both axles that braking must leave [N/kg]; None without stability control.
    """
    least, most = do.least, do.most
    along = car.max_along * grip
    if reserve is None:
        braking = least(braking, along)
    else:
        spare = stability.share_beyond(do, reserve[1] / (grip * car.rear_rest))
        across = (SHARE_OF_GRIP * GRAVITY) * grip
        braking = least(braking, across + (along - across) * spare)
    slowing = do.pick(u, braking, -braking)
    moved = car.transfer * (most(least(push, along), -along) - slowing)
    moved = most(least(moved, car.transfer_max), car.transfer_min)
    front_load, rear_load = car.front_rest - moved, car.rear_rest + moved
    front_grip, rear_grip = grip * front_load, grip * rear_load
    front_most, rear_most = car.share_along * front_grip, car.share_along * rear_grip
    if reserve is not None:
        front_most = front_most * stability.share_along(do, reserve[0] / front_grip, stability.FRONT_RESERVE)
        rear_most = rear_most * stability.share_along(do, reserve[1] / rear_grip, stability.REAR_RESERVE)
    front_push = most(least(car.front_drive * push, front_most), -front_most)
    rear_push = most(least(push - car.front_drive * push, rear_most), -rear_most)
    if reserve is None:
        slowing = slowing * (1.0 / GRAVITY)
        front_slowing, rear_slowing = slowing * front_load, slowing * rear_load
    else:
        rear_slowing = most(least(slowing * (1.0 / GRAVITY) * rear_load, rear_most), -rear_most)
        front_slowing = most(least(slowing - rear_slowing, front_most), -front_most)
        braking = do.magnitude(front_slowing + rear_slowing)
    front_along = most(least(front_push - front_slowing, front_most), -front_most)
    rear_along = most(least(rear_push - rear_slowing, rear_most), -rear_most)
    front = car.front_stiffness * front_load, front_grip, front_along
    rear = car.rear_stiffness * rear_load, rear_grip, rear_along
    return front_push + rear_push, braking, front, rear


def _roll(do: Operators[V], speeds: tuple[V, V], push: V, other: V, against: V, rolls: V) -> V:  # noqa: PLR0917 - keywords would take a tenth of the time
    """Return the speed along the body after the step.

    Args:
        speeds: along and across the body [m/s].
        push: change of speed by the engine [m/s].
        other: change of speed by slope and tyres [m/s].
        against: most that friction can take [m/s].
        rolls: 1 if a slope moves the car from rest.
    """
    least, most = do.least, do.most
    u, w = speeds
    after = u + (push + other)
    after = after - most(least(after, against), -against)
    # At rest a slope moves the car no further than its engine does alone; so without the engine, it does not.
    net = push - most(least(push, against), -against)
    held = most(least(after, most(net, 0.0)), least(net, 0.0))
    return do.pick(u * u + w * w + rolls, after, held)


def _slide(  # noqa: PLR0917 - keywords would take a tenth of the time
    do: Operators[V], car: Car[V], u: V, r: V, across: tuple[V, V], rates: tuple[V, V], turn: V | None, dt: float
) -> tuple[V, V]:
    """Return the changes of yaw rate and lateral speed by the tyres; see *Integration* at the head of this file.

    Args:
        u: speed along the body, mean of the step [m/s].
        r: yaw rate [rad/s].
        across: forces across the body at both axles [N/kg].
        rates: their decrease with the lateral speed of the axle [N s/(kg m)].
        turn: change of the yaw rate by brakes of one side [rad/s^2]; None without stability control.
        dt: length of the step [s].
    """
    front_across, rear_across = across
    front_rate, rear_rate = rates
    spin = u * r
    front_error = dt * (car.own_front * front_across + car.cross * rear_across - spin)
    rear_error = dt * (car.cross * front_across + car.own_rear * rear_across - spin)
    if turn is not None:
        front_error = front_error + dt * (car.to_front * turn)
        rear_error = rear_error - dt * (car.to_rear * turn)
    own_front, own_rear = car.own_front * front_rate, car.own_rear * rear_rate
    fast = (0.5 * dt) * (own_front + own_rear)
    weight = dt * ((6.0 + 2.0 * fast) / (12.0 + 2.0 * fast))
    carry = u / car.wheelbase
    m_ff, m_fr = 1.0 + weight * (own_front + carry), weight * (car.cross * rear_rate - carry)
    m_rf, m_rr = weight * (car.cross * front_rate + carry), 1.0 + weight * (own_rear - carry)
    determinant = do.most(m_ff * m_rr - m_fr * m_rf, MIN_DETERMINANT)
    front_change = (front_error * m_rr - m_fr * rear_error) / determinant
    rear_change = (m_ff * rear_error - m_rf * front_error) / determinant
    return (front_change - rear_change) / car.wheelbase, rear_change


def _move(do: Operators[V], pose: tuple[V, V, V], speeds: tuple[V, V, V], dt: float) -> tuple[V, V, V]:
    """Return the pose after the step: along the chord of an arc, in the direction of the heading in its middle."""
    x, y, yaw = pose
    u, w, r = speeds
    half = (0.5 * dt) * r
    square = half * half
    chord = dt * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)))  # sin(h) / h, as h is small
    course = yaw + half
    cos, sin = do.cos(course), do.sin(course)
    return x + chord * (u * cos - w * sin), y + chord * (u * sin + w * cos), do.wrap(course + half)


def _lean(do: Operators[V], angle: V, goal: V, share: float) -> tuple[V, V]:
    """Return the change of an angle of the body, and the angle after it [rad]."""
    change = (goal - angle) * share
    change = do.pick(do.magnitude(angle + change) - STILL, change, -angle)
    return change, angle + change


def _press(  # noqa: PLR0917 - keywords would take a tenth of the time
    do: Operators[V], car: Car[V], state: tuple[V, V, V, V], aims: tuple[V, V, V, V, V], forces: tuple[V, V], dt: float
) -> tuple[V, V]:
    """Return throttle and brake of the controller; see the head of this file.

    Args:
        state: speed and acceleration in the direction of the gear, and the lags of throttle and brake.
        aims: the columns target, accel_min, accel_max, throttle_max and jerk_limit.
        forces: deceleration without pedals, and what full throttle adds to it [m/s^2].
        dt: length of the step [s].
    """
    speed, accel, drive_lag, brake_lag = state
    target, accel_min, accel_max, throttle_max, jerk_limit = aims
    resist, pull = forces
    least, most = do.least, do.most
    error = target - speed
    amount = do.magnitude(error)
    near = PLANNED_JERK * SETTLING * SETTLING
    far = do.root(2.0 * PLANNED_JERK * (most(amount, near) - 0.5 * near))
    wanted = least(amount * (1.0 / SETTLING), far)
    wanted = most(least(do.pick(error, wanted, -wanted), accel_max), accel_min)
    change = jerk_limit * dt
    need = most(least(wanted, accel + change), accel - change) + resist
    plain_throttle, plain_brake = need / pull, need / -car.max_decel
    brake = brake_lag + (need / -car.max_decel - brake_lag) * (1.0 / car.brake_share)
    brake = least(most(brake, 0.0), 1.0)
    after = brake_lag + (brake - brake_lag) * car.brake_share
    throttle = drive_lag + ((need + after * car.max_decel) / pull - drive_lag) * (1.0 / car.throttle_share)
    # In acceleration mode the jerk has no limit, and the lags stay.
    is_plain = jerk_limit - MOST_JERK
    throttle = do.pick(is_plain, plain_throttle, throttle)
    brake = do.pick(is_plain, least(most(plain_brake, 0.0), 1.0), brake)
    return least(most(throttle, 0.0), throttle_max), brake


def _grip(  # noqa: PLR0917 - keywords would take a tenth of the time
    do: Operators[V], car: Car[V], u: V, across: V, wheels: tuple[V, V], limits: tuple[V, V, V]
) -> tuple[V, V, V]:
    """Return slip angle, force across the wheels, and the decrease of this force with the lateral speed of the axle.

    Args:
        u: speed along the body [m/s].
        across: lateral speed of the axle [m/s].
        wheels: sine and cosine of their angle.
        limits: stiffness of the axle / C, its grip and the force along the wheels [N/kg].
    """
    sin, cos = wheels
    stiffness, grip, along = limits
    rolling = do.most(do.magnitude(u * cos + across * sin), MIN_ROLLING)
    slip = do.arctan((across * cos - u * sin) / rolling)
    taken = car.to_across * along
    most = do.root(grip * grip - taken * taken)
    force = -most * do.sin(SHAPE * do.arctan(stiffness * slip / most))
    is_slipping = do.magnitude(slip) - STILL
    secant = do.pick(is_slipping, -force / do.pick(is_slipping, slip, 1.0), SHAPE * stiffness)
    return slip, force, secant * (cos * cos) / rolling

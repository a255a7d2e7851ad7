"""Stability control of driven rows in the single track model: brake forces that leave grip across, and a yaw control.

New cars in the EU must have it (Regulation (EU) 2019/2144; tests in UN Regulation 140).

*Brakes*. At rest and straight on, both axles are braked in proportion to their loads, which is the ideal distribution.
In a bend that is not enough: braking unloads the rear axle, but the force across that holds the car's tail in the bend
stays. So an axle that carries a force F across keeps grip for `RESERVE` times as much, and along it gets at most

    X = SHARE_OF_GRIP mu_x N sqrt(1 - (RESERVE F / (mu N))^2)         RESERVE F at most a share of mu N

What the rear axle may not take goes to the front, within the same bound there. The rest is lost: the car brakes less.
The same bound holds for the engine, as traction control. And hard brakes unload the rear axle: of what the tyres grip
better along than across, all brakes together get only the share 1 - 3 (RESERVE F_r / (mu N_r))^2, at least 0, with the
load at rest. So from 0.45 g on in a bend they are as hard as if the tyres gripped along as they do across.

*Yaw control*. A car that is neither too fast nor sliding turns with the yaw rate

    r_0 = u (tan(d_f) - tan(d_r)) / (L + K u^2)      K = (1 / C_f - 1 / C_r) / g, its understeer, at least 0

and with no more than mu g / u. Where the car turns faster than that in either direction by more than `DEADBAND`, the
wheels of one side are braked, which changes the yaw rate by -`GAIN` times the excess. The wheels of one side can brake
with `SIDE_SHARE` of the grip of the whole car at half a track. So hard a brake is the least that acts: the car slows.

Limits of the model: one wheel stands for an axle, so the force of one side turns the car but changes no tyre's grip by
itself. Only turning too much is corrected, not sliding straight on.
"""

from __future__ import annotations

from typing import Final, Generic, NamedTuple

from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.vehicle.operators import Operators, V

RESERVE: Final = 1.25
"""Grip that is kept across, for each newton that an axle carries across. A tyre needs more slip, and so time, for more
force than it has; with 1 a car in a bend that tightens slides before the brakes give way."""

FRONT_RESERVE: Final = 0.85
REAR_RESERVE: Final = 0.97
"""Share of its grip that an axle can keep across. A car at full lock must still brake: at the front half of its grip is
left along. The rear axle may give up nearly all of its brakes, as a tail that slides cannot be caught by the driver."""

DEADBAND: Final = 0.05
"""Excess of the yaw rate that is no fault [rad/s]: 2.9 degrees a second. Usual lane changes stay within it."""

GAIN: Final = 22.0
"""Change of the yaw rate for each unit of excess [1/s]: below half of 1 / dt, so the explicit step cannot swing. With
12 the tail of some models slides when they brake with all they have from 30 m/s in a bend of 0.5 g."""

SIDE_SHARE: Final = 0.4
"""Force of the brakes of one side that turns the car, as a share of the grip of the car: of a half, four fifths."""

HALF_TRACK: Final = 0.28
"""Half of the track, for each metre of the wheelbase: 0.76 m of 2.7 m, usual for passenger cars."""

MIN_SPEED: Final = 3.0
"""Yaw rates are bounded as at this speed at least [m/s]; below it, tyres have no part in the motion."""


class YawControl(NamedTuple, Generic[V]):
    """Constants of the yaw control that follow from the body.

    Attributes:
        wheelbase: L [m].
        understeer: K [s^2/m].
        lever: change of the yaw rate by the brakes of one side, for each of their force [rad/m].
    """

    wheelbase: V
    understeer: V
    lever: V


def make_control(to_axles: tuple[V, V], dynamic_index: V, stiffness: tuple[V, V]) -> YawControl[V]:
    """Return the constants of a car.

    Args:
        to_axles: distances of the centre of gravity from the front and the rear axle [m].
        dynamic_index: as in `Body`.
        stiffness: of the front and the rear tyres, for each newton of load [1/rad].
    """
    (to_front, to_rear), (front, rear) = to_axles, stiffness
    wheelbase = to_front + to_rear
    lever = HALF_TRACK * wheelbase / (dynamic_index * to_front * to_rear)
    return YawControl(wheelbase, (1.0 / front - 1.0 / rear) * (1.0 / GRAVITY), lever)


def correct(do: Operators[V], control: YawControl[V], grip: V, motion: tuple[V, V], turned: V) -> tuple[V, V]:
    """Return the change of the yaw rate by brakes of one side [rad/s^2], and their force [N/kg].

    Args:
        grip: of all tyres, for each newton of load.
        motion: speed along the body [m/s] and yaw rate [rad/s].
        turned: tangent of the front wheels' angle less that of the rear wheels.
    """
    least, most = do.least, do.most
    u, r = motion
    bound = GRAVITY * grip / most(do.magnitude(u), MIN_SPEED)
    wanted = u * turned / (control.wheelbase + most(control.understeer, 0.0) * (u * u))
    wanted = most(least(wanted, bound), -bound)
    # Too much to the left is above the greater one of the wanted rate and straight on, to the right below the lesser.
    left = most(r - most(wanted, 0.0) - DEADBAND, 0.0)
    right = most(least(wanted, 0.0) - r - DEADBAND, 0.0)
    force = least((GAIN / control.lever) * (left + right), (SIDE_SHARE * GRAVITY) * grip)
    return do.pick(right, force, -force) * control.lever, force


def share_along(do: Operators[V], across: V, most_kept: float) -> V:
    """Return the share of an axle's grip along the wheels that leaves its grip across.

    Args:
        across: force across, as a share of the grip.
        most_kept: share of the grip that it can keep.
    """
    kept = do.least(RESERVE * across, most_kept)
    return do.root(1.0 - kept * kept)


def share_beyond(do: Operators[V], across: V) -> V:
    """Return the share of the grip along the wheels beyond that across which the brakes of a car may use in a bend.

    Args:
        across: force across at the rear axle, as a share of its grip at rest.
    """
    return do.most(1.0 - (3.0 * RESERVE * RESERVE) * (across * across), 0.0)

"""Lateral motion of vehicles on lanes: the way from one offset to another, with a heading that follows it.

A vehicle on a lane has an offset `lateral` from the line. It moves to another offset along the curve of least jerk (a
polynomial of fifth order, Flash and Hogan 1985), with the share p of it that is done rising from 0 to 1:

    offset = from + (to - from) (10 p^3 - 15 p^4 + 6 p^5) + push (p - 6 p^3 + 8 p^4 - 3 p^5)
                  + bend (p^2 - 3 p^3 + 3 p^4 - p^5) / 2

`push` is the slope with which the motion begins: 0, or that of a motion that this one replaces. `bend` is its second
derivative there: 0, or that of a vehicle at rest that turns its wheels before it pulls out. p rises with the time,
but not faster than the vehicle moves ahead: what stands does not slide to the side. The heading differs by `drift` from
that of the lane, so that the middle of the rear axle always moves along the heading. Both are worked out at each
decision for the next one, and are linear in between.

A vehicle without an offset moves on the line to the last bit.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.drivers.rule_operators import ARRAYS, RuleOperators, V
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, of_rows
from rosbridge_sim.world.state.world_rows import WorldRows

MIN_SHIFT_TIME, MAX_SHIFT_TIME = 3.0, 6.0
"""Bounds of the time that a lane change takes on a free road [s]. A width of 3.5 m then has a lateral acceleration of
2.2 m/s^2 at most, with which drivers of cars also take bends."""

USUAL_SPEED: Final = 20.0
LONGER_PER_SPEED: Final = 0.009
"""At this speed a lane change takes the driver's own time [m/s], and longer by this share for each m/s more. Drivers
take 5.8 s on motorways where they take 5.0 s in cities (Tijerina, Garrott, Stoltzfus, Parmer 2005)."""

LANE: Final = 3.5
"""A shift by this much is a lane change [m]; a smaller one needs less way."""

MIN_SHIFT: Final = 10.0
MIN_SHIFT_PER_LENGTH: Final = 2.5
"""The least way for a lane change: 10 m for a car, whose wheels then turn by 30 deg and whose rear axle has a radius of
5 m [m]; and what longer vehicles need in addition, for each metre beyond `CAR_LENGTH`. So the nose of a bus of 11 m
comes over the far border of the new lane by 0.35 m at most; the sides of buses are 0.5 m from the borders."""

TIGHT_BEND: Final = 20.0 / 3.0
"""`bend` of a vehicle that pulls out from rest, as a share of the way across. With this one the way begins as an arc:
its curvature is greatest at the beginning and changes slowly there. So the least radius of the rear axle R gives the
way sqrt(`TIGHT_BEND` R across): 9.3 m for a car with R = 3.7 m, which comes out from 1.9 m behind another car."""

FULL_LOCK: Final = math.radians(36.25)
"""Angle of the front wheels then, as for an ego by default: a turning circle of 10.5 m."""

TIGHT_PER_LENGTH: Final = 1.8
"""But the way is this many lengths of the vehicle at least. So the nose of a bus of 11 m, which turns by 17 deg then,
comes over the far border of the new lane by 0.2 m."""

PEAK: Final = 10.0 / math.sqrt(3.0)
"""Greatest second derivative of the curve of least jerk, for a way and a time of 1."""

LEAST_LATERAL: Final = 0.3
"""Lateral acceleration that a lane change leaves for the bend at least [m/s^2]."""

RESERVE: Final = 0.1
"""Lateral acceleration that bend and lane change together leave unused: for the wander within the lane, and for the
shorter way on the inner side of the bend [m/s^2]."""

CAR_LENGTH: Final = 4.5
"""Length of a usual car [m]."""

SHORTEST: Final = 1e-9
"""Least way in the angle of a motion across [m]: what stands has none."""

_COLUMNS: Final = ("lateral", "drift_rate")


def shift_time(do: RuleOperators[V], change_time: V, speed: V) -> V:
    """Return the time that a lane change takes at a speed [s].

    Args:
        change_time: of the driver, see `driver_parameters` [s].
        speed: [m/s].
    """
    longer = 1.0 + LONGER_PER_SPEED * (speed - USUAL_SPEED)
    return do.least(do.most(change_time * longer, MIN_SHIFT_TIME), MAX_SHIFT_TIME)


def lateral_in_shift(
    parameters: DriverParameters, which: IntArray, speed: FloatArray, across: FloatArray | float
) -> FloatArray:
    """Return the lateral acceleration that drivers accept of bends while they change lanes, (k,) [m/s^2].

    Args:
        which: (k,) int64, indices of those drivers.
        speed: (k,) [m/s].
        across: (k,) by which they shift; not negative [m].
    """
    time = shift_time(ARRAYS, parameters.change_time[which], speed)
    most, usual = parameters.most_lateral[which], parameters.lateral[which]
    return np.asarray(lateral_left(ARRAYS, most, usual, time, across))


def lateral_left(do: RuleOperators[V], most: V, usual: V, time: V, across: V | float) -> V:
    """Return the lateral acceleration that a lane change leaves for bends [m/s^2].

    Args:
        most: that the driver accepts at all [m/s^2].
        usual: that it accepts of bends [m/s^2].
        time: of the lane change [s].
        across: its width [m].
    """
    return do.least(do.most(most - RESERVE - PEAK * across / (time * time), LEAST_LATERAL), usual)


def find_shifted(world: WorldRows, rows: IntArray | slice) -> IntArray:
    """Return which of some lane followers are beside the line or on their way to another offset, (k,) int64 indices."""
    state = of_rows(world.block(*_COLUMNS), rows)
    is_shifted = np.logical_or.reduce(state != 0.0) | (world.lateral_left[rows] > 0.0) | (world.lateral_to[rows] != 0.0)
    which: IntArray = is_shifted.nonzero()[0]
    return which


def shift_length(do: RuleOperators[V], length: V, across: V) -> V:
    """Return the least way that a vehicle needs to shift [m].

    Args:
        length: of the vehicle [m].
        across: by which it shifts; not negative [m].
    """
    whole = MIN_SHIFT + MIN_SHIFT_PER_LENGTH * do.most(length - CAR_LENGTH, 0.0)
    return whole * do.root(do.least(across / LANE, 1.0))


def length_of_tight_shift(world: WorldRows, rows: IntArray, across: FloatArray) -> FloatArray:
    """Return the way that vehicles need to pull out from rest, with their wheels at full lock, (k,) [m].

    Args:
        world: read only.
        rows: (k,) int64.
        across: (k,) by which they shift; not negative [m].
    """
    return np.asarray(tight_length(ARRAYS, world.wheelbase[rows], world.half_length[rows], across))


def tight_length(do: RuleOperators[V], wheelbase: V, half_length: V, across: V) -> V:
    """Return what `length_of_tight_shift` returns for vehicles of such bodies [m]."""
    radius = wheelbase / math.tan(FULL_LOCK)
    least = TIGHT_PER_LENGTH * 2.0 * half_length * do.root(do.least(across / LANE, 1.0))
    return do.most(do.root(TIGHT_BEND * across * radius), least)


def shift(world: WorldRows, rows: IntArray, target: FloatArray) -> None:
    """Have lane followers move to other offsets, smoothly from where they are; `lane_following` does it from now on.

    Args:
        world: written in place. The caller calls `World.touch`, unless it is the one that moves them.
        rows: (k,) int64, lane followers.
        target: (k,) offsets from the line, left positive [m].
    """
    done = 1.0 - world.lateral_left[rows]
    _, slope = _places(world, rows, done)
    world.lateral_push[rows] = np.where(world.lateral_left[rows] > 0.0, slope, 0.0)
    world.lateral_from[rows], world.lateral_to[rows] = world.lateral[rows], target
    is_there = (target == world.lateral[rows]) & (world.lateral_push[rows] == 0.0)
    world.lateral_bend[rows] = 0.0
    world.lateral_left[rows] = np.where(is_there, 0.0, 1.0)


def plan_shifts(world: WorldRows, rows: IntArray, time: FloatArray, distance: FloatArray, interval: float) -> None:
    """Work out the lateral motion until the next decision: `lateral_rate` and `drift_rate`.

    Args:
        world: written in place.
        rows: (k,) int64, from `find_shifted`.
        time: (k,) that a lane change takes, from `shift_time` [s].
        distance: (k,) that each will drive until then [m].
        interval: until then [s].
    """
    left = world.lateral_left[rows]
    is_done = left <= 0.0
    done = rows[is_done]
    # The sum of the parts of an interval differs from the whole in the last bits: what has arrived is there exactly.
    world.lateral[done] = world.lateral_from[done] = world.lateral_to[done]
    world.drift[done] = world.lateral_push[done] = world.lateral_bend[done] = 0.0
    across = np.abs(world.lateral_to[rows] - world.lateral_from[rows]) + np.abs(world.lateral_push[rows])
    way = shift_length(ARRAYS, 2.0 * world.half_length[rows], across)
    tight = world.lateral_bend[rows].nonzero()[0]
    if len(tight):
        way[tight] = length_of_tight_shift(world, rows[tight], across[tight])
    part = np.fmin(np.fmin(interval / time, distance / np.fmax(way, 1.0)), left)
    share = 1.0 - (left - part)
    offset, slope = _places(world, rows, share)
    lateral = np.where(is_done, world.lateral[rows], offset)
    angle = np.arctan2(slope * part, np.fmax(distance, SHORTEST))
    drift = np.where(is_done, 0.0, np.where(distance > 0.0, angle, world.drift[rows]))
    world.lateral_rate[rows] = (lateral - world.lateral[rows]) / interval
    world.drift_rate[rows] = (drift - world.drift[rows]) / interval
    world.lateral_left[rows] = np.where(is_done, 0.0, left - part)


def nudge(world: WorldRows, rows: IntArray, dt: float) -> None:
    """Move rows sideways by one step; their pose on the line, their yaw and their wander are those of its end already.

    Args:
        world: written in place.
        rows: (k,) int64, from `find_shifted`.
        dt: length of the step [s].
    """
    lateral = world.lateral[rows] + world.lateral_rate[rows] * dt
    drift = world.drift[rows] + world.drift_rate[rows] * dt
    world.lateral[rows], world.drift[rows] = lateral, drift
    along = world.yaw[rows] - drift - world.wander_slope[rows]
    world.x[rows] -= lateral * np.sin(along)
    world.y[rows] += lateral * np.cos(along)


def _places(world: WorldRows, rows: IntArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the offsets at shares p (k,) of the way, and their derivatives by p, (k,) each [m]."""
    start, end, push = world.lateral_from[rows], world.lateral_to[rows], world.lateral_push[rows]
    return place_in_shift(ARRAYS, start, end, push, world.lateral_bend[rows], p)


def place_in_shift(_: RuleOperators[V], start: V, end: V, push: V, bend: V, p: V) -> tuple[V, V]:
    """Return the offset at a share p of the way, and its derivative by p [m]; see the head of this file."""
    square = p * p
    cube = square * p
    curve = start + (end - start) * find_way(p)
    curve = curve + push * (p + cube * (-6.0 + 8.0 * p - 3.0 * square))
    slope = (end - start) * slope_of(p)
    slope = slope + push * (1.0 + square * (-18.0 + 32.0 * p - 15.0 * square))
    return curve + bend * bend_way(p), slope + bend * bend_slope(p)


def find_way(p: V) -> V:
    """Return the share of the way across at a share p of the time, 0..1."""
    return p * p * p * (10.0 - 15.0 * p + 6.0 * p * p)


def slope_of(p: V) -> V:
    """Return the derivative of `find_way` by p."""
    left = 1.0 - p
    return 30.0 * (p * p) * (left * left)


def bend_way(p: V) -> V:
    """Return the offset at a share p of the time with a `bend` of 1 m [m]."""
    left = 1.0 - p
    return 0.5 * p * p * left * (left * left)


def bend_slope(p: V) -> V:
    """Return the derivative of `bend_way` by p [m]."""
    left = 1.0 - p
    return 0.5 * p * (left * left) * (2.0 - 5.0 * p)

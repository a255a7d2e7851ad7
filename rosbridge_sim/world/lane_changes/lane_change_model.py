"""The lane change model MOBIL: whether a change helps a driver, and what it costs the others.

It is the model of Kesting, Treiber and Helbing (2007). With the accelerations a of the driver (c), of the follower in
the other lane (n) and of the follower in the own lane (o), and the same after the change (a'), a driver changes if

    a_c' - a_c + p (a_n' - a_n + a_o' - a_o) > threshold + bias        (it helps more than it costs)
    a_n' > -b_safe and a_c' > -b_safe                                 (it is safe)

p is the politeness, see `driver_parameters`. The follower in the own lane counts for changes to the right alone: a slow
driver makes way to the right, but not to the left. All accelerations are those of the intelligent driver model, worked
out for the moment.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.rule_operators import ARRAYS, RuleOperators, V, written
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray
from rosbridge_sim.world.roads.lane_conflicts import COMFORT


class LaneChange(IntEnum):
    """Reason of a driver to change lanes."""

    NONE = 0
    FASTER = 1
    KEEP_RIGHT = 2
    ROUTE = 3  # its route goes on from another lane
    LANE_END = 4
    AROUND = 5  # something that stands and waits for nothing


MAX_REASON: Final = max(LaneChange)

SAFE_BRAKING: Final = 4.0
"""The paper's b_safe, the hardest braking that a change may force upon the follower [m/s^2]."""

THRESHOLD: Final = 0.2
"""Least advantage for which a driver changes lanes [m/s^2]; the paper has 0.1 to 0.2."""

KEEP_RIGHT_BIAS: Final = 0.3
"""Advantage that the right lane has in itself where drivers keep right [m/s^2], as in the paper."""

_ACCEL: Final = 1.5
_HEADWAY: Final = 1.2
_GAP: Final = 2.0
"""Figures of the mean driver, as a driver guesses them for others: acceleration [m/s^2], time gap [s], gap [m]."""

_CREEP: Final = 0.1
"""Keeps quotients finite [m/s]."""

MIN_GAP: Final = 2.0
"""A change needs this much free length before and behind the vehicle at any speed [m]: corners reach out in a turn."""

MIN_HEADWAY: Final = 0.4
"""A change needs this time gap to the lead vehicle in addition, and leaves it to the follower [s]."""


FEW: Final = 8
"""Up to this number of vehicles, single floats are faster than arrays: 1 us for each, or 15 us for all."""


def follow(speed: FloatArray, desired_speed: FloatArray, gap: FloatArray, lead_speed: FloatArray | float) -> FloatArray:
    """Return the accelerations by the intelligent driver model, for a mean driver.

    Args:
        speed: (k,) [m/s].
        desired_speed: (k,) [m/s].
        gap: (k,) to the lead vehicle, inf for none [m].
        lead_speed: (k,) [m/s].
    """
    if len(speed) <= FEW and isinstance(lead_speed, np.ndarray):
        columns = speed.tolist(), desired_speed.tolist(), gap.tolist(), lead_speed.tolist()
        return np.array([number for (number,) in map(written(mean_follow, 4), *columns)])
    return np.asarray(mean_follow(ARRAYS, speed, desired_speed, gap, lead_speed))


def mean_follow(do: RuleOperators[V], speed: V, desired_speed: V, gap: V, lead_speed: V | float) -> V:
    """Return what `follow` returns; the arguments are the same."""
    ratio = speed / do.most(desired_speed, _CREEP)
    square = ratio * ratio
    closing = speed * (speed - lead_speed) / (2.0 * math.sqrt(_ACCEL * COMFORT))
    wanted = (_GAP + do.most(speed * _HEADWAY + closing, 0.0)) / do.most(gap, _CREEP)
    return _ACCEL * (do.most(1.0 - square * square, -2.0) - wanted * wanted)


def find_safe(
    speed: FloatArray, gap_ahead: FloatArray, lead_speed: FloatArray, gap_behind: FloatArray, follower_speed: FloatArray
) -> BoolArray:
    """Return which changes are safe, (k,): nobody must brake harder than `SAFE_BRAKING`, and there is room.

    Args:
        speed: (k,) of the driver [m/s].
        gap_ahead: (k,) to the lead vehicle in the other lane, inf for none [m].
        lead_speed: (k,) of it [m/s].
        gap_behind: (k,) to the follower in the other lane, inf for none [m].
        follower_speed: (k,) of it [m/s].
    """
    own = follow(speed, np.fmax(speed, 1.0), gap_ahead, lead_speed)
    theirs = follow(follower_speed, np.fmax(follower_speed, 1.0), gap_behind, speed)
    has_room = (gap_ahead > MIN_GAP + MIN_HEADWAY * speed) & (gap_behind > MIN_GAP + MIN_HEADWAY * follower_speed)
    return np.asarray(has_room & (own > -SAFE_BRAKING) & (theirs > -SAFE_BRAKING))

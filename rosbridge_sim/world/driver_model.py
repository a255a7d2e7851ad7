"""The driver model: the acceleration that a driver chooses, from what it perceives.

It is the intelligent driver model (Treiber, Hennecke, Helbing 2000). With v the speed, v0 the desired speed or the
lower one that is safe here, s the gap to the lead vehicle and dv the closing speed:

    v' = a (1 - (v / v0)^4 - (s* / s)^2)        s* = s0 + v T + v dv / (2 sqrt(a b))

Two places differ from the paper. Above v0 the first two terms are replaced by (v0 - v) / `SETTLING_TIME`, since the
paper's term brakes too hard there. For what stands still (a stop line, the end of a road) the last term is replaced:
if the deceleration needed to stop exceeds a threshold, the driver applies exactly that deceleration. With s*, drivers
would brake for a stop line from far away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.lane_conflicts import COMFORT
from rosbridge_sim.world.lane_entries import EntryQueue

__all__ = [
    "ACCEL",
    "BRAKE_FROM",
    "BRAKE_FULLY",
    "CREEP",
    "FIRM",
    "GAP",
    "HEADWAY",
    "STOP_GAP",
    "Perception",
    "accelerate",
]

ACCEL: Final = 1.5
"""The paper's a, the acceleration from standstill on a free road [m/s^2]. The paper's b is `lane_conflicts.COMFORT`."""

HEADWAY: Final = 1.2
"""The paper's T, the time gap to the lead vehicle [s]."""

GAP: Final = 2.0
"""The paper's s0, the gap in a standing queue [m]."""

STOP_GAP: Final = 1.0
"""Distance before a stop line at which drivers come to a stand [m]."""

BRAKE_FROM: Final = 1.25
BRAKE_FULLY: Final = 1.75
"""Thresholds of the braking for a stop [m/s^2]. A driver ignores a stop that needs less than the first one. It applies
the full needed deceleration from the second one on, and a growing share of it between them."""

FIRM: Final = 4.0
"""The hardest braking for a light that has just become yellow, and for a speed above v0 [m/s^2]."""

HARDEST: Final = 8.0
"""The hardest braking at all: about what tyres on a dry road give [m/s^2]."""

SETTLING_TIME: Final = 0.4
"""Time constant with which a speed above v0 falls to v0 [s]."""

CREEP: Final = 0.1
"""A lower speed counts as standing [m/s]. The bound also keeps quotients finite."""


@dataclass(slots=True, eq=False)
class Perception:
    """Perception of drivers on their lanes; all arrays are (k,), one entry for each driver.

    Attributes:
        gap: from the front bumper to the tail of the lead vehicle, inf without one [m].
        lead_speed: of the lead vehicle, 0 without one [m/s].
        lead: int64, which driver the lead vehicle is; -1 for none, and for one that does not follow lanes.
        stop_distance: from the front bumper to where the driver must stop, inf without such a place [m].
        safe_speed: the most that the limit, the bends and what comes after them allow here [m/s].
        is_shut_out: bool, the driver asks for a lane behind which there is no room for it.
        queue: all entities on the lanes, for lane changes; None where nobody changes lanes.
    """

    gap: FloatArray
    lead_speed: FloatArray
    lead: IntArray
    stop_distance: FloatArray
    safe_speed: FloatArray
    is_shut_out: BoolArray
    queue: EntryQueue | None = None


def accelerate(speed: FloatArray, desired_speed: FloatArray, perception: Perception) -> FloatArray:
    """Return the accelerations that drivers choose; see the head of this file for the equations.

    Args:
        speed: (k,) not negative [m/s].
        desired_speed: (k,) v0, the desired speed or the safe one, whichever is lower [m/s].
        perception: of the same drivers; `safe_speed` is not read.

    Returns:
        (k,) at least -`HARDEST` and at most `ACCEL` [m/s^2].
    """
    below = ACCEL * (1.0 - np.square(np.square(np.fmin(speed / np.fmax(desired_speed, CREEP), 1.0))))
    free = np.where(speed < desired_speed, below, np.fmax((desired_speed - speed) / SETTLING_TIME, -FIRM))
    closing_term = (speed - perception.lead_speed) / (2.0 * math.sqrt(ACCEL * COMFORT))
    desired_gap = GAP + np.fmax(speed * (HEADWAY + closing_term), 0.0)
    following = free - ACCEL * np.square(desired_gap / np.fmax(perception.gap, CREEP))
    left = perception.stop_distance - STOP_GAP
    needed = np.where(left > 0.0, speed * speed / (2.0 * np.fmax(left, 1e-3)), HARDEST)
    share = np.fmin(np.fmax((needed - BRAKE_FROM) / (BRAKE_FULLY - BRAKE_FROM), 0.0), 1.0)
    stopping = np.fmin(free, free - share * (free + needed))
    return np.asarray(np.fmax(np.fmin(following, stopping), -HARDEST))

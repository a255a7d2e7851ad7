"""The driver model: the acceleration that a driver chooses, from what it perceives.

It is the intelligent driver model (Treiber, Hennecke, Helbing 2000) as Schakel, van Arem and Netten (2010) have it,
with the constant-acceleration heuristic of Kesting, Treiber and Helbing (2010). With v the speed, v0 the desired speed
or the lower one that is safe here, s the gap to the lead vehicle, vl its speed and dv = v - vl the closing speed:

    v' = min(a (1 - (v / v0)^4), f)     s* = s0 + v T + v dv / (2 sqrt(a b))     f_idm = a (1 - (s* / s)^2)

The older model adds both terms, so its gaps grow without bound near v0. The minimum keeps s* = s up to v0, which real
queues do. Where s > s*, the exponent is 4 here instead of 2. With 2, vehicles that accelerate one behind the other fall
back so far that queues and jams dissolve more slowly than real ones.

If the lead vehicle kept its acceleration al (at most a), this acceleration f_cah would just avoid a crash:

    v^2 al / (vl^2 - 2 s al)           if vl dv <= -2 s al, the lead vehicle stands first
    al - dv^2 / (2 s)                  otherwise, for dv > 0

A gap that is too small but harmless, as after a cut-in, gives a low f_idm and a mild f_cah. Then c = 0.99 counts:

    f = f_idm                                                          if f_idm >= f_cah
    f = (1 - c) f_idm + c (f_cah + b q / sqrt(1 + q^2))                otherwise, with q = (f_idm - f_cah) / b

Three more places differ from the papers. They have tanh(q), whose bits depend on the processor. Above v0 the free
term is replaced by (v0 - v) / `SETTLING_TIME`, since the paper's term brakes too hard there. For what stands still (a
stop line, the end of a road) f is replaced: if the deceleration needed to stop exceeds a threshold, the driver applies
exactly that deceleration. With s*, drivers would brake for a stop line from far away.

The chosen acceleration is not reached at once: see `lane_following`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.drivers.lane_entries import EntryQueue
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import SETTLING_TIME

GAP: Final = 2.5
"""The papers' s0, the gap in a standing queue [m]: theirs is 2 m, SUMO's 2.5 m."""

STOP_GAP: Final = 1.0
"""Distance before a stop line at which drivers come to a stand [m]."""

STANDS_WITHIN: Final = 0.3
"""A driver that is nearer to its place to stand does not set off to it [m]: half a second of creeping."""

BRAKE_FROM: Final = 1.25
BRAKE_FULLY: Final = 1.75
"""Thresholds of the braking for a stop [m/s^2]. A driver ignores a stop that needs less than the first one. It applies
the full needed deceleration from the second one on, and a growing share of it between them."""

FIRM: Final = 4.0
"""The hardest braking for a light that has just become yellow, and for a speed above v0 [m/s^2]."""

HARDEST: Final = 8.0
"""The hardest braking at all: about what tyres on a dry road give [m/s^2]."""

COOLNESS: Final = 0.99
"""The papers' c. 0 is a driver who takes each gap below s* for an emergency."""

CREEP: Final = 0.1
"""A lower speed counts as standing [m/s]. The bound also keeps quotients finite."""


class SlowVehicles(Record, eq=False):
    """Vehicles ahead of the lead vehicle: much slower than the driver, as the end of a jam, or uncovered soon.

    A driver minds them as if the lead vehicle were not there, which may leave the lane in the last moment. All arrays
    are (m,).

    Attributes:
        seen_by: int64, the drivers, each once.
        gap: from the driver's front bumper to the vehicle's tail [m].
        speed: of the vehicle [m/s].
        accel: of the vehicle [m/s^2].
    """

    seen_by: IntArray
    gap: FloatArray
    speed: FloatArray
    accel: FloatArray


@dataclass(slots=True, eq=False)
class Perception:
    """Perception of drivers on their lanes; all arrays are (k,), one entry for each driver.

    Attributes:
        gap: from the front bumper to the tail of the lead vehicle, inf without one [m].
        lead_speed: of the lead vehicle, 0 without one [m/s].
        lead_accel: of the lead vehicle, 0 without one [m/s^2].
        lead: int64, which driver the lead vehicle is; -1 for none, and for one that does not follow lanes.
        stop_distance: from the front bumper to where the driver must stop, inf without such a place [m].
        safe_speed: the most that the limit, the bends and what comes after them allow here [m/s].
        is_shut_out: bool, the driver asks for a lane behind which there is no room for it.
        is_blocked: bool, it asks for a lane on which something stands, or on whose rival another driver stands.
        slow: the much slower vehicles ahead of the lead vehicles; None for none.
        queue: all entities on the lanes, for lane changes; None where nobody changes lanes.
    """

    gap: FloatArray
    lead_speed: FloatArray
    lead_accel: FloatArray
    lead: IntArray
    stop_distance: FloatArray
    safe_speed: FloatArray
    is_shut_out: BoolArray
    is_blocked: BoolArray
    slow: SlowVehicles | None = None
    queue: EntryQueue | None = None


def accelerate(speed: FloatArray, perception: Perception, drivers: DriverParameters) -> FloatArray:
    """Return the accelerations that drivers choose; see the head of this file for the equations.

    Args:
        speed: (k,) not negative [m/s].

    Returns:
        (k,) at least -`HARDEST` and at most the driver's own `accel` [m/s^2].
    """
    wanted_speed = np.fmin(drivers.desired_speed, perception.safe_speed)
    free = drivers.accel * (1.0 - np.square(np.square(np.fmin(speed / np.fmax(wanted_speed, CREEP), 1.0))))
    too_fast = np.fmax((wanted_speed - speed) / SETTLING_TIME, -FIRM)
    free = np.where(speed < wanted_speed, free, too_fast)
    chosen = free
    at = (perception.stop_distance < np.inf).nonzero()[0]
    if len(at):
        chosen[at] = _stop(free[at], speed[at], perception.stop_distance[at])
    at = (perception.gap < np.inf).nonzero()[0]
    if len(at):
        leads = (perception.gap[at], perception.lead_speed[at], perception.lead_accel[at])
        chosen[at] = np.fmin(chosen[at], _follow(at, speed, *leads, drivers))
    if perception.slow is not None:
        slow = perception.slow
        at = slow.seen_by
        chosen[at] = np.fmin(chosen[at], _follow(at, speed, slow.gap, slow.speed, slow.accel, drivers))
    return np.asarray(np.fmax(chosen, -HARDEST))


def gap_wanted(speed: FloatArray, closing: FloatArray, drivers: DriverParameters) -> FloatArray:
    """Return s* of the head of this file, (k,) [m].

    Args:
        speed: (k,) [m/s].
        closing: (k,) dv [m/s].
        drivers: (k,) their parameters.
    """
    closing_term = closing / (2.0 * np.sqrt(drivers.accel * drivers.comfort))
    return np.asarray(GAP + np.fmax(speed * (drivers.headway + closing_term), 0.0))


def keep_gap(accel: FloatArray, wanted: FloatArray, gap: FloatArray) -> FloatArray:
    """Return f_idm of the head of this file, (k,) [m/s^2].

    Args:
        accel: (k,) a of the drivers [m/s^2].
        wanted: (k,) s* [m].
        gap: (k,) to the lead vehicle, positive [m].
    """
    ratio = np.square(wanted / gap)
    return np.asarray(accel * (1.0 - ratio * np.fmin(ratio, 1.0)))


def firm_stop(speed: FloatArray, accel: FloatArray, reaction: FloatArray) -> FloatArray:
    """Return the distance of a stop with `FIRM`, (k,) [m].

    With v' that goes to -F with the time constant T, it is (v + D)^2 / (2 F) - D T, where D = T (v' + F). A driver that
    brakes so stops at the same place in each moment of it.

    Args:
        speed: (k,) [m/s].
        accel: (k,) at present [m/s^2].
        reaction: (k,) time constant of the acceleration [s].
    """
    surplus = reaction * np.fmax(accel + FIRM, 0.0)
    return np.asarray(np.square(speed + surplus) / (2.0 * FIRM) - surplus * reaction)


def _stop(free: FloatArray, speed: FloatArray, distance: FloatArray) -> FloatArray:
    """Return the accelerations of drivers that must stop at a distance, (m,) [m/s^2]; the arguments are (m,), too."""
    left = distance - STOP_GAP
    square = speed * speed
    needed = np.where(left > 0.0, square / (2.0 * np.fmax(left, 1e-3)), np.inf)
    to_line = np.fmax(0.9 * distance, 1e-3)
    needed = np.fmin(needed, np.fmax(square / (2.0 * to_line), FIRM))  # beyond firm braking, use the way up to the line
    share = np.fmin(np.fmax((needed - BRAKE_FROM) / (BRAKE_FULLY - BRAKE_FROM), 0.0), 1.0)
    share = np.where(left < STANDS_WITHIN, 1.0, share)
    return np.asarray(np.fmin(free, free - share * (free + needed)))


def _follow(  # noqa: PLR0917 - of one vehicle and its lead vehicle
    at: IntArray,
    all_speeds: FloatArray,
    gap: FloatArray,
    lead_speed: FloatArray,
    lead_accel: FloatArray,
    drivers: DriverParameters,
) -> FloatArray:
    """Return f of the head of this file, for the drivers `at` (m,); the arguments about lead vehicles are (m,), too."""
    speed, gap = all_speeds[at], np.fmax(gap, CREEP)
    accel, comfort = drivers.accel[at], drivers.comfort[at]
    closing = speed - lead_speed
    wanted = GAP + np.fmax(speed * (drivers.headway[at] + closing / (2.0 * np.sqrt(accel * comfort))), 0.0)
    idm = np.fmax(keep_gap(accel, wanted, gap), -HARDEST)
    lead_accel, twice = np.fmin(lead_accel, accel), 2.0 * gap
    change = twice * lead_accel
    room = lead_speed * lead_speed - change
    heuristic = lead_accel - np.square(np.fmax(closing, 0.0)) / twice
    first = ((lead_speed * closing <= -change) & (room > 0.0)).nonzero()[0]  # where the lead vehicle stands first
    if len(first):
        heuristic[first] = np.square(speed[first]) * lead_accel[first] / room[first]
    mild = (idm < heuristic).nonzero()[0]
    if len(mild):
        hard, heuristic, comfort = idm[mild], heuristic[mild], comfort[mild]
        below = (hard - heuristic) / comfort
        cool = heuristic + comfort * below / np.sqrt(1.0 + below * below)
        idm[mild] = (1.0 - COOLNESS) * hard + COOLNESS * cool
    return idm

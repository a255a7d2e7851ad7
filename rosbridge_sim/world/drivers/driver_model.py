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

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.drivers.driver_parameters import DriverParameters
from rosbridge_sim.world.drivers.lane_entries import EntryQueue
from rosbridge_sim.world.drivers.rule_operators import ARRAYS, RuleOperators, V, written
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import SETTLING_TIME

FEW: Final = 40
"""Up to this number of drivers, single floats are faster than arrays: 1.2 us for each driver, or 60 us for all."""

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


TINY: Final = 1e-100
"""Keeps quotients finite that do not count [m^2/s^2]: no other number here is as small, and not 0."""


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

    @staticmethod
    def next_to(queue: EntryQueue, gap: FloatArray, lead: IntArray, at: IntArray) -> SlowVehicles:
        """Return the vehicles next to lead vehicles.

        Args:
            gap: (k,) to the lead vehicle of each driver [m].
            lead: (k,) int64, positions of the lead vehicles in the queue.
            at: (m,) int64, the drivers that mind the next ones.
        """
        before, after = lead[at], lead[at] + 1
        return SlowVehicles(
            at, gap[at] + queue.tail[after] - queue.tail[before], queue.speed[after], queue.accel[after]
        )


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
    choose = _choose_one_by_one if len(speed) <= FEW else _choose
    chosen = choose(speed, perception, drivers)
    if perception.slow is not None:
        slow = perception.slow
        at = slow.seen_by
        one = drivers.accel[at], drivers.comfort[at], drivers.headway[at]
        chosen[at] = np.fmin(chosen[at], follow(ARRAYS, speed[at], slow.gap, slow.speed, slow.accel, *one))
    return np.asarray(np.fmax(chosen, -HARDEST))


def _choose(speed: FloatArray, perception: Perception, drivers: DriverParameters) -> FloatArray:
    """Return the accelerations without regard to slow vehicles, (k,) [m/s^2]."""
    chosen: FloatArray = drive_free(ARRAYS, speed, drivers.desired_speed, perception.safe_speed, drivers.accel)
    at = (perception.stop_distance < np.inf).nonzero()[0]
    if len(at):
        chosen[at] = stop(ARRAYS, chosen[at], speed[at], perception.stop_distance[at])
    at = (perception.gap < np.inf).nonzero()[0]
    if len(at):
        leads = (perception.gap[at], perception.lead_speed[at], perception.lead_accel[at])
        one = drivers.accel[at], drivers.comfort[at], drivers.headway[at]
        chosen[at] = np.fmin(chosen[at], follow(ARRAYS, speed[at], *leads, *one))
    return chosen


def _choose_one_by_one(speed: FloatArray, perception: Perception, drivers: DriverParameters) -> FloatArray:
    """Return what `_choose` returns, in less time for few drivers."""
    free_of, stop_of, follow_of = written(drive_free, 4), written(stop, 3), written(follow, 7)
    now_of, accel_of = speed.tolist(), drivers.accel.tolist()
    free = map(free_of, now_of, drivers.desired_speed.tolist(), perception.safe_speed.tolist(), accel_of)
    columns = (
        *(drivers.comfort, drivers.headway, perception.stop_distance, perception.gap),
        *(perception.lead_speed, perception.lead_accel),
    )
    found = []
    for (on_free_road,), now, accel, comfort, headway, distance, gap, lead_speed, lead_accel in zip(
        free, now_of, accel_of, *[column.tolist() for column in columns], strict=True
    ):
        chosen = on_free_road
        if distance < math.inf:
            (chosen,) = stop_of(chosen, now, distance)
        if gap < math.inf:
            chosen = min(chosen, *follow_of(now, gap, lead_speed, lead_accel, accel, comfort, headway))
        found.append(chosen)
    return np.array(found)


def drive_free(do: RuleOperators[V], speed: V, desired: V, safe: V, accel: V) -> V:
    """Return the acceleration on a free road [m/s^2].

    Args:
        speed: [m/s].
        desired: v0 of the driver [m/s].
        safe: the most that is safe here [m/s].
        accel: a of the driver [m/s^2].
    """
    wanted = do.least(desired, safe)
    ratio = do.least(speed / do.most(wanted, CREEP), 1.0)
    square, lacking = ratio * ratio, wanted - speed
    return do.pick(lacking, accel * (1.0 - square * square), do.most(lacking / SETTLING_TIME, -FIRM))


def gap_wanted(  # noqa: PLR0917 - numbers of one driver
    do: RuleOperators[V], speed: V, closing: V, accel: V, comfort: V, headway: V
) -> V:
    """Return s* of the head of this file [m].

    Args:
        speed: [m/s].
        closing: dv [m/s].
        accel: a of the driver [m/s^2].
        comfort: b of the driver [m/s^2].
        headway: T of the driver [s].
    """
    return GAP + do.most(speed * (headway + closing / (2.0 * do.root(accel * comfort))), 0.0)


def keep_gap(do: RuleOperators[V], accel: V, wanted: V, gap: V) -> V:
    """Return f_idm of the head of this file [m/s^2].

    Args:
        accel: a of the driver [m/s^2].
        wanted: s* [m].
        gap: to the lead vehicle, positive [m].
    """
    ratio = wanted / gap
    square = ratio * ratio
    return accel * (1.0 - square * do.least(square, 1.0))


def firm_stop(do: RuleOperators[V], speed: V, accel: V, reaction: V) -> V:
    """Return the distance of a stop with `FIRM` [m].

    With v' that goes to -F with the time constant T, it is (v + D)^2 / (2 F) - D T, where D = T (v' + F). A driver that
    brakes so stops at the same place in each moment of it.

    Args:
        speed: [m/s].
        accel: at present [m/s^2].
        reaction: time constant of the acceleration [s].
    """
    surplus = reaction * do.most(accel + FIRM, 0.0)
    after = speed + surplus
    return after * after / (2.0 * FIRM) - surplus * reaction


def stop(do: RuleOperators[V], free: V, speed: V, distance: V) -> V:
    """Return the acceleration of a driver that must stop at a distance [m], and else has the acceleration `free`."""
    left = distance - STOP_GAP
    square = speed * speed
    # Beyond firm braking, use the way up to the line.
    to_line = do.most(square / (2.0 * do.most(0.9 * distance, 1e-3)), FIRM)
    needed = do.pick(left, do.least(square / (2.0 * do.most(left, 1e-3)), to_line), to_line)
    share = do.least(do.most((needed - BRAKE_FROM) / (BRAKE_FULLY - BRAKE_FROM), 0.0), 1.0)
    share = do.pick(STANDS_WITHIN - left, 1.0, share)
    return do.least(free, free - share * (free + needed))


def follow(  # noqa: PLR0917 - numbers of one vehicle and its lead vehicle
    do: RuleOperators[V], speed: V, gap: V, lead_speed: V, lead_accel: V, accel: V, comfort: V, headway: V
) -> V:
    """Return f of the head of this file [m/s^2].

    Args:
        speed: v [m/s].
        gap: s to the lead vehicle [m].
        lead_speed: vl [m/s].
        lead_accel: al [m/s^2].
        accel: a of the driver [m/s^2].
        comfort: b of the driver [m/s^2].
        headway: T of the driver [s].
    """
    gap = do.most(gap, CREEP)
    closing = speed - lead_speed
    wanted = gap_wanted(do, speed, closing, accel, comfort, headway)
    idm = do.most(keep_gap(do, accel, wanted, gap), -HARDEST)
    lead_accel, twice = do.least(lead_accel, accel), 2.0 * gap
    change = twice * lead_accel
    room = lead_speed * lead_speed - change
    closes = do.most(closing, 0.0)
    moves = lead_accel - closes * closes / twice
    stands_first = speed * speed * lead_accel / do.most(room, TINY)
    heuristic = do.pick(lead_speed * closing + change, moves, do.pick(room, stands_first, moves))
    below = (idm - heuristic) / comfort
    cool = heuristic + comfort * below / do.root(1.0 + below * below)
    return do.pick(heuristic - idm, (1.0 - COOLNESS) * idm + COOLNESS * cool, idm)

"""Clearance of lane changes: whether a vehicle gets past the one ahead of it in the lane that it leaves.

The corner of its nose moves across as `lane_change_motion` says. When it comes to the tail of the vehicle ahead, it
must be farther to the side than that vehicle reaches. A vehicle ahead that moves is taken for a usual car in the middle
of its lane. What stands counts with its true size and place, but for at least that much, unless the driver pulls out
from rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_model import CREEP
from rosbridge_sim.world.drivers.lane_entries import CORRIDOR
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, ranges
from rosbridge_sim.world.geometry.world_pairs import pair_in_worlds
from rosbridge_sim.world.lane_changes.lane_change_motion import (
    TIGHT_BEND,
    bend_slope,
    bend_way,
    find_way,
    length_of_shift,
    length_of_tight_shift,
    slope_of,
    time_of_shift,
)
from rosbridge_sim.world.roads.lane_change_map import LEFT
from rosbridge_sim.world.state.world import World

__all__ = ["STANDS", "Shifts", "is_clear"]

CLEARANCE: Final = 0.15
"""Distance to the side at which a driver passes the corner of what stands ahead [m]."""

SEEN: Final = 20.0
"""Bodies whose middle is within this distance, east plus north, may be in the way [m]: the lengths of two trucks."""

STANDS: Final = 0.5
"""Lower speeds count as standing [m/s]. What stands may be askew in its lane, as an ego after a mishap."""

PULLS_OUT_FROM: Final = 0.5
"""As far as its middle to the side, a body that stands ahead counts as in the way [shares of the way across]."""

MAX_PAIRS: Final = 1 << 16
"""Pairs of a driver and a body near it that are looked at in a decision: about 5 ms, a thousand drivers in a town. The
other drivers take what is ahead for a usual car."""


@dataclass(frozen=True, slots=True, eq=False)
class Shifts:
    """Vehicles that change lanes, or that may begin to; (k,) each.

    Attributes:
        rows: int64, rows of the world.
        nose: from the reference point to the front bumper [m].
        length: of the vehicle [m].
        side: int64, where the new lane is: `LEFT` or `RIGHT`.
        done: share of the change that is done, 0..1.
        across: distance between the lanes [m].
        gap: to the lead vehicle in the old lane, inf for none [m].
        lead_speed: of it [m/s].
        is_tight: bool, they pull out from rest.
        change_time: of the drivers, see `driver_parameters` [s].
    """

    rows: IntArray
    nose: FloatArray
    length: FloatArray
    side: IntArray
    done: FloatArray
    across: FloatArray
    gap: FloatArray
    lead_speed: FloatArray
    is_tight: BoolArray
    change_time: FloatArray


def is_clear(world: World, shifts: Shifts, speed: FloatArray) -> BoolArray:
    """Return whether vehicles are beside the lead vehicle of the old lane when they come to it, (k,).

    Args:
        world: read only.
        shifts: the vehicles.
        speed: (k,) of them, at present or as it may be [m/s].
    """
    speed = np.fmax(speed, CREEP)
    across, gap, is_tight = shifts.across, shifts.gap, shifts.is_tight
    closing = speed - shifts.lead_speed
    way = np.fmax(length_of_shift(shifts.length, across), time_of_shift(shifts.change_time, speed) * speed)
    edge, bend = np.full(len(across), CORRIDOR), np.zeros(len(across))
    seen = ((gap < SEEN) & (is_tight | (shifts.lead_speed < STANDS))).nonzero()[0]
    if len(seen):
        edge[seen] = np.fmax(_find_edges(world, shifts, seen), np.where(is_tight[seen], -np.inf, CORRIDOR))
    tight = is_tight.nonzero()[0]
    if len(tight):
        bend[tight] = TIGHT_BEND * across[tight]
        way[tight] = length_of_tight_shift(world, shifts.rows[tight], across[tight])
    comes = closing > 0.0
    driven = np.where(comes, np.fmax(gap, 0.0) * speed / np.where(comes, closing, 1.0), np.inf)
    part = np.fmin(shifts.done + driven / way, 1.0)
    slope = (across * slope_of(part) + bend * bend_slope(part)) / way
    # At the tail of the lead vehicle is the nose then, or, of those that pull out, what is beside it already.
    reach = np.where(is_tight, np.fmax(shifts.nose + np.fmin(gap, 0.0), 0.0), shifts.nose)
    corner = across * find_way(part) + bend * bend_way(part) + reach * slope / np.sqrt(1.0 + slope * slope)
    return np.asarray((corner - world.half_width[shifts.rows] > edge) | np.isinf(gap))


def _find_edges(world: World, shifts: Shifts, which: IntArray) -> FloatArray:
    """Return how far vehicles that change lanes must come to the side, to pass what is ahead in their lane, (m,) [m].

    It counts from where they began to where their own side passes; `CORRIDOR` where nothing is seen.

    Args:
        world: read only.
        shifts: the vehicles.
        which: (m,) int64, some of them.
    """
    own = shifts.rows[which]
    alive = world.alive.nonzero()[0]
    worlds = world.worlds_of(own, alive)
    if worlds is None:
        alive = alive[world.x[alive].argsort(kind="stable")]
        x = world.x[alive]
        first, last = x.searchsorted(world.x[own] - SEEN), x.searchsorted(world.x[own] + SEEN, side="right")
        count = last - first
        count[count.cumsum() > MAX_PAIRS] = 0
        i, near = np.repeat(np.arange(len(own)), count), alive[ranges(first, count)]
    else:
        i, near = pair_in_worlds(*worlds)
        near = alive[near]
    apart = np.abs(world.x[near] - world.x[own[i]]) + np.abs(world.y[near] - world.y[own[i]])
    is_near = (apart < SEEN) & (near != own[i])
    i, near = i[is_near], near[is_near]
    row = own[i]
    along_yaw = world.yaw[row] - world.drift[row]
    sign = np.where(shifts.side[which[i]] == LEFT, 1.0, -1.0)
    moved = np.where(world.leaving[row] > 0, world.lateral[row] - world.lateral_from[row], 0.0)
    cos, sin = np.cos(along_yaw), np.sin(along_yaw)
    turn = world.yaw[near] - along_yaw
    east = world.x[near] + world.centre[near] * np.cos(world.yaw[near]) - world.x[row]
    north = world.y[near] + world.centre[near] * np.sin(world.yaw[near]) - world.y[row]
    across_to, along = sign * (north * cos - east * sin + moved), east * cos + north * sin
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half_along = cos * world.half_length[near] + sin * world.half_width[near]
    half_across = sin * world.half_length[near] + cos * world.half_width[near]
    is_ahead = (along + half_along > shifts.nose[which[i]]) & (along > 0.0)
    is_ahead &= np.abs(across_to) < PULLS_OUT_FROM * shifts.across[which[i]]
    edges = np.full(len(own), -np.inf)
    np.maximum.at(edges, i[is_ahead], (across_to + half_across)[is_ahead] + CLEARANCE)
    return np.where(np.isinf(edges), CORRIDOR, edges)

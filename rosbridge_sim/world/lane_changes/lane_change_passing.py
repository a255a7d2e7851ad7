"""Clearance of lane changes: whether a vehicle gets past what is ahead of it in the lane that it leaves.

The corner of its nose moves across as `lane_change_motion` says. When it comes to the tail of the vehicle ahead, it
must be farther to the side than that vehicle reaches. A vehicle ahead that moves is taken for a usual car in the middle
of its lane. What stands counts with its true size and place, but for at least that much, unless the driver pulls out
from rest. What stands beyond the vehicle ahead counts where the nose comes to it, if the change is not over by then;
what is there later is for the drivers in the new lane.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.drivers.driver_model import CREEP
from rosbridge_sim.world.drivers.lane_entries import CORRIDOR
from rosbridge_sim.world.drivers.rule_operators import ARRAYS, RuleOperators, V
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, ranges
from rosbridge_sim.world.geometry.world_pairs import pair_in_worlds
from rosbridge_sim.world.lane_changes.lane_change_motion import (
    TIGHT_BEND,
    bend_slope,
    bend_way,
    find_way,
    length_of_tight_shift,
    shift_length,
    shift_time,
    slope_of,
)
from rosbridge_sim.world.roads.lane_change_map import LEFT
from rosbridge_sim.world.state.world_rows import WorldRows

CLEARANCE: Final = 0.15
"""Distance to the side at which a driver passes the corner of what stands ahead [m]."""

SEEN: Final = 20.0
"""Bodies whose middle is within this distance, east plus north, may be in the way [m]: the lengths of two trucks."""

STANDS: Final = 0.5
"""Lower speeds count as standing [m/s]. What stands may be askew in its lane, as an ego after a mishap."""

PULLS_OUT_FROM: Final = 0.5
"""As far as its middle to the side, a body that stands ahead counts as in the way [shares of the way across]."""

BEYOND: Final = 1.0
"""A body is beyond the lead vehicle if its tail is this much farther away [m]. A nearer one may stand beside it."""

MAX_PAIRS: Final = 1 << 16
"""Pairs of a driver and a body near it that are looked at in a decision: about 5 ms, a thousand drivers in a town. The
other drivers take what is ahead for a usual car."""


class Shifts(Record, eq=False):
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


Edges = tuple[IntArray, FloatArray, FloatArray]
"""Entities ahead of vehicles that change lanes, in their old lanes, (p,) each: the vehicle; how far its own side must
come from where it began, to pass [m]; the distance along the lane from its front bumper to the tail ahead [m]. A
vehicle may have several."""


def is_clear(world: WorldRows, shifts: Shifts, speed: FloatArray, edges: Edges | None = None) -> BoolArray:
    """Return whether vehicles are beside what is ahead in the old lane when they come to it, (k,).

    Args:
        world: read only.
        speed: (k,) of them, at present or as it may be [m/s].
        edges: from `find_edges`, if they are known.
    """
    return np.asarray(np.isinf(find_blocked(world, shifts, speed, edges)))


def find_blocked(world: WorldRows, shifts: Shifts, speed: FloatArray, edges: Edges | None = None) -> FloatArray:
    """Return the gaps from vehicles to the first thing in the old lane that they would touch, (k,), inf for none [m].

    It is the gap to the lead vehicle, or a larger one to what stands beyond it.

    Args:
        world: read only.
        speed: (k,) of them, at present or as it may be [m/s].
        edges: from `find_edges`, if they are known.
    """
    speed = np.fmax(speed, CREEP)
    across, gap, is_tight = shifts.across, shifts.gap, shifts.is_tight
    closing = speed - shifts.lead_speed
    way = np.fmax(shift_length(ARRAYS, shifts.length, across), shift_time(ARRAYS, shifts.change_time, speed) * speed)
    bend = np.zeros(len(across))
    tight = is_tight.nonzero()[0]
    if len(tight):
        bend[tight] = TIGHT_BEND * across[tight]
        way[tight] = length_of_tight_shift(world, shifts.rows[tight], across[tight])
    comes = closing > 0.0
    driven = np.where(comes, np.fmax(gap, 0.0) * speed / np.where(comes, closing, 1.0), np.inf)

    def side_at(i: IntArray | slice, part: FloatArray, gap: FloatArray) -> FloatArray:
        """Return how far to the side vehicles i pass, after a share `part` of the way, what is ahead by `gap`."""
        # At the tail of the lead vehicle is the nose then, or, of those that pull out, what is beside it already.
        reach = np.where(is_tight[i], np.fmax(shifts.nose[i] + np.fmin(gap, 0.0), 0.0), shifts.nose[i])
        return np.asarray(
            side_in_shift(ARRAYS, across[i], bend[i], way[i], part, reach, world.half_width[shifts.rows[i]])
        )

    usual = np.full(len(across), CORRIDOR)
    i, edge, tail = find_edges(world, shifts) if edges is None else edges
    if len(i):
        usual[i[is_tight[i]]] = -np.inf
    is_free = (side_at(slice(None), np.fmin(shifts.done + driven / way, 1.0), gap) > usual) | np.isinf(gap)
    blocked: FloatArray = np.where(is_free, np.inf, gap)
    if len(i):
        is_beyond = tail > gap[i] + BEYOND
        share = shifts.done[i] + np.where(is_beyond, np.fmax(tail, driven[i]), driven[i]) / way[i]
        tail = np.where(is_beyond, tail, gap[i])
        touches = (side_at(i, np.fmin(share, 1.0), tail) <= edge) & ~(is_beyond & (share >= 1.0))
        np.minimum.at(blocked, i[touches], tail[touches])
    return blocked


def side_in_shift(  # noqa: PLR0917 - numbers of one vehicle
    do: RuleOperators[V], across: V, bend: V, way: V, part: V, reach: V, half_width: V
) -> V:
    """Return how far to the side of where it began the near side of a vehicle is at a point ahead of it [m].

    Args:
        across, way: of the whole change [m].
        bend: see `lane_change_motion` [m].
        part: of the way that is done.
        reach: from its reference point to the point [m].
        half_width: of it [m].
    """
    slope = (across * slope_of(part) + bend * bend_slope(part)) / way
    corner = across * find_way(part) + bend * bend_way(part) + reach * slope / do.root(1.0 + slope * slope)
    return corner - half_width


def find_edges(world: WorldRows, shifts: Shifts) -> Edges:
    """Return what is ahead of vehicles that look closely, for what is ahead stands, or they pull out from rest."""
    which = ((shifts.gap < SEEN) & (shifts.is_tight | (shifts.lead_speed < STANDS))).nonzero()[0]
    if not len(which):
        return which, np.empty(0), np.empty(0)
    own = shifts.rows[which]
    alive = world.alive.nonzero()[0]
    worlds = world.worlds_of(own, alive)
    if worlds is None and len(own) * len(alive) <= MAX_PAIRS // 4:  # a third of the time of a sort
        i, near = (np.abs(world.x[alive] - world.x[own][:, None]) < SEEN).nonzero()
        near = alive[near]
    elif worlds is None:
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
    edge, tail = across_to + half_across + CLEARANCE, along - half_along - shifts.nose[which[i]]
    return which[i[is_ahead]], edge[is_ahead], tail[is_ahead]

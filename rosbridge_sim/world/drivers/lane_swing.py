"""Long vehicles in tight bends: they move to the side in their lane, so that neither side leaves it without need.

Both axles of a vehicle on lanes are on the line, so in a bend its middle is inside the line, and its nose and its tail
are outside. For a bus of 11 m in a right turn of 9 m that is 0.4 m and 1.4 m. The vehicle as a whole moves away from
the border that it would pass, until it is within the lane, or, where the lane is too narrow, as far beyond one border
as beyond the other. It moves without turning, and only while it drives.

The offset is a function of the lanes, the body and the place, so a vehicle needs no memory for it. It is written to the
columns of `lane_change_motion`, which moves the vehicle.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.drivers.driver_parameters import HEAVY_LENGTH
from rosbridge_sim.world.drivers.lane_position import find_ahead, find_straights, rear_axles
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import MAX_LATERAL, LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

MARGIN: Final = 0.1
"""Distance that the vehicle keeps to the borders of its lane if it can [m]: mirrors reach 0.1 to 0.2 m out."""

MAX_OFFSET: Final = 1.0
"""It moves by no more than this [m]: beyond it most of the vehicle would be in the next lane, whatever its length."""

SLOPE: Final = 0.1
"""It moves to the side by at most this for each metre ahead. The need rises by 0.06 in the turns of a town."""

NEGLIGIBLE: Final = 1e-9
"""A smaller offset is none [m], and then the vehicle is on the line to the last bit."""

MAX_RADIUS: Final = 60.0
"""In a wider bend nobody needs to swing [m]: a bus of 12 m is within lanes of 3 m there."""

CERTAIN: Final = 0.01
"""By this much a vehicle is within a straight, and its lane is wide enough, if its offset is not worked out [m]."""

NUM_PARTS: Final = 3
NUM_SIDES: Final = 2
"""Places of a vehicle whose distances to the borders count, and its sides."""

ROUNDS: Final = 2
"""Steps of the search for the place beside a corner; the second one moves it by less than a centimetre."""


def find_long(world: WorldRows, rows: IntArray) -> IntArray:
    """Return which of some lane followers are long enough to swing, (m,) int64 indices; `latBias` has none of it."""
    is_long = 2.0 * world.half_length[rows] > HEAVY_LENGTH
    is_one: BoolArray = is_long & (world.kind[rows] == int(Kind.VEHICLE)) & (world.lateral_bias[rows] == 0.0)
    return is_one.nonzero()[0]


def find_swinging(world: WorldRows, rows: IntArray) -> IntArray:
    """Return which of some long vehicles are at a bend, or not yet back on the line after one, (m,) int64 indices.

    Vehicles that change lanes are none of them.
    """
    is_free = (world.lateral_left[rows] == 0.0) & (world.leaving[rows] == 0)
    tight = world.roads.derived(are_tight)
    near = world.int_block("behind", "ahead_2").take(rows, axis=1)
    is_near = np.logical_or.reduce(tight[near] & (near >= 0))
    is_off = (world.lateral[rows] != 0.0) | (world.lateral_rate[rows] != 0.0)
    is_one: BoolArray = is_free & (is_near | is_off)
    return is_one.nonzero()[0]


def are_straight(world: WorldRows, rows: IntArray, distance: FloatArray) -> bool:
    """Return whether `plan_swings` would change nothing: all stay on a straight, and are planned so already.

    A plan makes the rate of the drift -0.0 for those who drive; the bits count, so that all states stay as they were.
    """
    planned = np.zeros((6, len(rows)))
    planned[3, distance > 0.0] = -0.0
    is_planned = world.block("lateral", "lateral_to").take(rows, axis=1).tobytes() == planned.tobytes()
    return is_planned and not len(_find_bent(world, rows, distance))


def plan_swings(world: WorldRows, rows: IntArray, distance: FloatArray, interval: float) -> None:
    """Work out the lateral motion until the next decision: `lateral_rate` and `drift_rate`.

    Args:
        world: written in place.
        rows: (k,) int64, long vehicles.
        distance: (k,) that each will drive until then [m].
        interval: until then [s].
    """
    now, most = world.lateral[rows], SLOPE * distance
    wanted = np.zeros(len(rows))
    at = _find_bent(world, rows, distance)
    if len(at):
        wanted[at] = _offsets(world, rows[at], distance[at])
    target = np.fmin(np.fmax(wanted, now - most), now + most)
    is_there = (np.abs(target) < NEGLIGIBLE) & (np.abs(now) < NEGLIGIBLE)
    world.lateral[rows] = np.where(is_there, 0.0, now)
    world.lateral_from[rows] = world.lateral_to[rows] = 0.0
    world.lateral_rate[rows] = np.where(is_there, 0.0, (target - now) / interval)
    drift = np.where(np.abs(world.drift[rows]) < NEGLIGIBLE, 0.0, world.drift[rows])
    world.drift[rows] = drift
    world.drift_rate[rows] = np.where(distance > 0.0, -drift / interval, 0.0)


def _find_bent(world: WorldRows, rows: IntArray, distance: FloatArray) -> IntArray:
    """Return which vehicles will not be on a straight from tail to nose, or not within its borders, (m,) int64 indices.

    The others want no offset.
    """
    begin, end, room = world.roads.derived(_find_rooms).take(world.point[rows], axis=1)
    middle, half_length = world.arc[rows] + distance + world.centre[rows], world.half_length[rows] + CERTAIN
    is_straight = (middle - half_length >= begin) & (middle + half_length <= end)
    is_straight &= room >= world.half_width[rows] + (MARGIN + CERTAIN)
    bent: IntArray = (~is_straight).nonzero()[0]
    return bent


def _find_rooms(roads: Roads) -> FloatArray:
    """Return for each point the arc lengths where its straight begins and ends, and its room, (3, n) [m].

    The room is the least distance from the line to a border. In a bend the end is before the beginning.
    """
    end, _ = roads.derived(find_straights)
    rooms = np.zeros((3, len(end)))
    is_first = np.ones(len(end), dtype=bool)
    is_first[1:] = (end[1:] != end[:-1]) | (roads.s[1:] == 0.0)
    first = is_first.nonzero()[0]
    of_straight = is_first.cumsum() - 1
    border = roads.border.min(axis=1)
    border[:-1] = np.minimum(border[:-1], border[1:])  # from a point to the next one
    rooms[0], rooms[1] = roads.s[first][of_straight], end
    rooms[2] = np.minimum.reduceat(border, first)[of_straight]
    return rooms


def _offsets(world: WorldRows, rows: IntArray, distance: FloatArray) -> FloatArray:
    """Return the offsets that vehicles want some distance ahead of where they are, (k,), left positive [m]."""
    roads = world.roads
    lanes = world.int_block("behind", "ahead_5").take(rows, axis=1)
    arc = world.arc[rows] + distance
    wheelbase, centre = world.wheelbase[rows], world.centre[rows]
    half_length, half_width = world.half_length[rows], world.half_width[rows]
    rear, yaw = rear_axles(roads, lanes[1:], arc, wheelbase)
    # All places are counted from the start of the lane behind, where the tail may be.
    first = (lanes[0] < 0).nonzero()[0]
    before = roads.length[lanes[0]]
    before[first] = 0.0
    lanes[:-1, first] = lanes[1:, first]
    arc += before
    # Both corners of the tail, both sides in the middle of the wheelbase, and both corners of the nose
    num = len(rows)
    along = np.empty((NUM_SIDES, NUM_PARTS, num))
    along[:, 0], along[:, 1], along[:, 2] = centre - half_length, 0.5 * wheelbase, centre + half_length
    across = np.empty((NUM_SIDES, 1, num))
    across[0], across[1] = half_width, -half_width
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = rear[:, 0] + along * cos - across * sin, rear[:, 1] + along * sin + across * cos
    lanes = np.concatenate([lanes] * (NUM_SIDES * NUM_PARTS), axis=1)
    beyond = _beyond(roads, lanes, (arc + along).ravel(), x.ravel(), y.ravel())
    left, right = (np.maximum.reduce(each.reshape(-1, num)) for each in beyond)
    to_right = np.fmin(np.fmax(left, 0.0), np.fmax(0.5 * (left - right), 0.0))
    to_left = np.fmin(np.fmax(right, 0.0), np.fmax(0.5 * (right - left), 0.0))
    return np.asarray(np.fmin(np.fmax(to_left - to_right, -MAX_OFFSET), MAX_OFFSET))


def _beyond(
    roads: Roads, lanes: IntArray, s: FloatArray, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return how far points are beyond the left and the right border, with `MARGIN`, (m,) each [m].

    Args:
        lanes: (n, m) int64, lanes that follow one another.
        s: (m,) about where the points are, counted from the start of the first lane [m].
        x: (m,) east [m].
        y: (m,) north [m].
    """
    for i in range(ROUNDS):
        point, share = roads.locate(*find_ahead(roads, lanes, s))
        foot, yaw = roads.between(point, share)
        east, north, cos, sin = x - foot[:, 0], y - foot[:, 1], np.cos(yaw), np.sin(yaw)
        if i < ROUNDS - 1:
            s = s + east * cos + north * sin
    lateral = north * cos - east * sin
    to_left, to_right = roads.edges(point, share, lateral)
    return MARGIN - to_left, MARGIN - to_right


def are_tight(roads: Roads) -> BoolArray:
    """Return which lanes have a bend of less than `MAX_RADIUS`, (l,)."""
    speed = roads.derived(LaneConflicts).bend_speed
    return np.asarray(np.minimum.reduceat(speed, roads.first[:-1]) < math.sqrt(MAX_LATERAL * MAX_RADIUS))

"""Time to collision: when would the boxes of two entities touch if both kept their present velocity and heading?

That is the measure of Hayward (1972), in the plane: boxes slide straight, and do not turn. Two boxes touch while the
line from one middle to the other is within the Minkowski sum of both. For boxes that is an octagon, the intersection of
four strips, one for each direction of an edge (separating axis theorem). So the time of the first touch is when the
last of the four strips is entered, if no other has been left by then.

On a map with hills both boxes keep to the ground below their straight lines: where they would touch, they must be at
one height.

The straight lines are a simplification: in a bend, oncoming traffic seems to come nearer than it will.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, ComplexArray, FloatArray, IntArray
from rosbridge_sim.world.geometry.world_pairs import pair_in_worlds
from rosbridge_sim.world.roads.surface import Surface
from rosbridge_sim.world.state.world import World

__all__ = ["HORIZON", "find_times_to_collision"]

HORIZON: Final = 10.0
"""Times above this count as none [s]: studies of conflicts call less than 1.5 to 4 s critical, and no driver keeps
velocity and heading for ten."""

MAX_PAIRS_AT_ONCE: Final = 1 << 14
"""Pairs looked at at once: the temporary arrays of 128 kB stay inside the cache."""

NOTHING: Final[IntArray] = np.zeros(0, dtype=np.int64)

MAX_RISE: Final = 50.0
"""Greatest rise that is guessed from the present slope [m]: 10 % for 10 s at 50 m/s."""

TOUCHING: Final = 1e-6
"""By how much two boxes must overlap to touch [m], as in `collisions`."""


def find_times_to_collision(world: World, rows: IntArray) -> FloatArray:
    """Return for each row the least time to collision with any other entity.

    Entities above or below, such as those on a bridge, are left out.

    Args:
        world: read only.
        rows: (k,) int64, rows in use.

    Returns:
        (k,) 0 while they touch, inf for none within `HORIZON` [s].
    """
    heading: ComplexArray = np.exp(1j * world.yaw)
    middle = world.x + 1j * world.y + world.centre * heading
    velocity = (world.speed + 1j * world.lateral_speed) * heading
    i, j = _may_touch(world, rows, middle, velocity)
    times = np.full(len(rows), np.inf)
    if not len(i):
        return times
    me = rows[i]
    time = _first_touch(
        middle[j] - middle[me],
        velocity[j] - velocity[me],
        np.stack([heading[me], heading[j]]),
        np.stack([world.half_length[[me, j]], world.half_width[[me, j]]], axis=-1),
    )
    if not world.roads.is_flat:
        time = np.where(_are_level(world, np.stack([me, j]), middle, velocity, time), time, np.inf)
    np.minimum.at(times, i, np.where(time <= HORIZON, time, np.inf))
    return times


def _may_touch(world: World, rows: IntArray, middle: ComplexArray, velocity: ComplexArray) -> tuple[IntArray, IntArray]:
    """Return the few pairs whose circles touch within the horizon; on a flat map at about one height.

    Args:
        world: read only.
        rows: (k,) int64.
        middle: (n,) of the boxes [m].
        velocity: (n,) [m/s].

    Returns:
        (m,) int64, indices into `rows`, and (m,) int64, rows of the others.
    """
    radius = np.hypot(world.half_length, world.half_width)
    if world.world_of_row is not None:
        alive = world.alive.nonzero()[0]
        i, j = pair_in_worlds(world.world_of_row[rows], world.world_of_row[alive])
        j = alive[j]
        span = radius + HORIZON * np.abs(velocity)
        reach = span[j] + span[rows[i]]
        is_near = np.abs(middle.real[j] - middle.real[rows[i]]) <= reach
        is_near &= np.abs(middle.imag[j] - middle.imag[rows[i]]) <= reach
        is_near &= rows[i] != j
        i, j = i[is_near], j[is_near]
        is_met = _do_meet(world, (rows[i], j), middle, velocity, radius)
        return i[is_met], j[is_met]
    span = radius + HORIZON * np.abs(velocity)
    east, north = middle.real.copy(), middle.imag.copy()
    found = []
    size = max(1, MAX_PAIRS_AT_ONCE // max(world.n, 1))
    for first in range(0, len(rows), size):  # nearly always one portion
        part = rows[first : first + size]
        reach = span + span[part, None]
        is_near = np.abs(east - east[part, None]) <= reach
        is_near &= np.abs(north - north[part, None]) <= reach
        is_near[np.arange(len(part)), part] = False
        i, j = is_near.nonzero()
        if not len(i):
            continue
        is_met = _do_meet(world, (part[i], j), middle, velocity, radius)
        found.append((first + i[is_met], j[is_met]))
    if not found:
        return NOTHING, NOTHING
    mine, others = zip(*found, strict=True)
    return np.concatenate(mine), np.concatenate(others)


def _do_meet(
    world: World,
    pairs: tuple[IntArray, IntArray],
    middle: ComplexArray,
    velocity: ComplexArray,
    radius: FloatArray,
) -> BoolArray:
    """Return of which pairs of rows (m,) the circles touch within the horizon; arguments as in `_may_touch`."""
    me, j = pairs
    apart, towards, width = middle[j] - middle[me], velocity[j] - velocity[me], radius[j] + radius[me]
    distance, speed = np.abs(apart), np.abs(towards)
    product = apart.conj() * towards
    # They come nearer, and will not miss one another.
    is_met: BoolArray = (product.real < 0.0) & (np.abs(product.imag) <= width * speed)
    is_met &= distance - width <= HORIZON * speed
    is_met |= distance <= width
    is_met &= world.alive[j]
    if world.roads.is_flat:
        bottom, top = world.z, world.z + world.height - TOUCHING
        is_met &= (bottom[me] < top[j]) & (bottom[j] < top[me])
    return is_met


def _are_level(
    world: World, pairs: IntArray, middle: ComplexArray, velocity: ComplexArray, time: FloatArray
) -> BoolArray:
    """Return (m,) which pairs are at one height when they touch.

    Args:
        world: read only; its roads are not flat.
        pairs: (2, m) int64, rows.
        middle: (n,) of the boxes [m].
        velocity: (n,) [m/s].
        time: (m,) when they touch; a pair that never does is not level [s].
    """
    is_level = time <= HORIZON
    at = is_level.nonzero()[0]
    pairs, time = pairs[:, at], time[at]
    place = middle[pairs] + velocity[pairs] * time
    # The slope below tells about what height that will be: it chooses between a bridge and the road below it.
    rise = -np.tan(world.pitch[pairs] - world.lean_pitch[pairs]) * (world.speed[pairs] * time + world.centre[pairs])
    guess = world.z[pairs] + np.fmin(np.fmax(rise, -MAX_RISE), MAX_RISE)
    ground = world.roads.derived(Surface).find(place.real.ravel(), place.imag.ravel(), guess.ravel())
    bottom = np.where(world.is_ghost[pairs], world.z[pairs], ground.height.reshape(pairs.shape))
    top = bottom + world.height[pairs] - TOUCHING
    is_level[at] = (bottom[0] < top[1]) & (bottom[1] < top[0])
    return is_level


def _first_touch(apart: ComplexArray, towards: ComplexArray, heading: ComplexArray, half: FloatArray) -> FloatArray:
    """Return when pairs of sliding boxes touch first, (m,), 0 if they do, inf for never [s].

    Args:
        apart: (m,) from the one middle to the other [m].
        towards: (m,) velocity of the other, seen from the one [m/s].
        heading: (2, m) unit vectors along each box.
        half: (2, m, 2) half of length and width of each [m].
    """
    into = heading.conj()
    between = heading[0] * into[1]
    cos, sin = np.abs(between.real)[:, None], np.abs(between.imag)[:, None]
    # Half the width of the four strips: (along, across) the one box, then the other.
    strip = half + half[::-1] * cos + half[::-1, ..., ::-1] * sin - TOUCHING
    place, speed = _parts(apart * into), _parts(towards * into)
    # Without motion across a strip: in it for ever, or never.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        one, other = (-strip - place) / speed, (strip - place) / speed
    enters, leaves = np.minimum(one, other).max(axis=(0, 2)), np.maximum(one, other).min(axis=(0, 2))
    return np.where((enters <= leaves) & (leaves >= 0.0), np.maximum(enters, 0.0), np.inf)


def _parts(vectors: ComplexArray) -> FloatArray:
    """Return complex vectors (...) as real ones (..., 2)."""
    return np.stack([vectors.real, vectors.imag], axis=-1)

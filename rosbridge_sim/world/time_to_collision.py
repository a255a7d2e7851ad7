"""Time to collision: when would the boxes of two entities touch if both kept their present velocity and heading?

That is the measure of Hayward (1972), in the plane: boxes slide straight, and do not turn. Two boxes touch while the
line from one middle to the other is within the Minkowski sum of both. For boxes that is an octagon, the intersection of
four strips, one for each direction of an edge (separating axis theorem). So the time of the first touch is when the
last of the four strips is entered, if no other has been left by then.

The straight lines are a simplification: in a bend, oncoming traffic seems to come nearer than it will.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import ComplexArray, FloatArray, IntArray
from rosbridge_sim.world.state import World

__all__ = ["HORIZON", "find_times_to_collision"]

HORIZON: Final = 10.0
"""Times above this count as none [s]: studies of conflicts call less than 1.5 to 4 s critical, and no driver keeps
velocity and heading for ten."""

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
    reach = np.hypot(world.half_length, world.half_width)
    # All pairs are looked at roughly first; few are left.
    apart = middle - middle[rows, None]
    towards = velocity - velocity[rows, None]
    gap = np.abs(apart) - reach - reach[rows, None]
    may_touch = (gap <= HORIZON * np.abs(towards)) & world.alive
    may_touch &= ((apart.conj() * towards).real < 0.0) | (gap <= 0.0)
    may_touch[np.arange(len(rows)), rows] = False
    i, j = may_touch.nonzero()
    times = np.full(len(rows), np.inf)
    if not len(i):
        return times
    me = rows[i]
    top = world.z + world.height
    is_level = (world.z[me] < top[j] - TOUCHING) & (world.z[j] < top[me] - TOUCHING)
    i, j, me = i[is_level], j[is_level], me[is_level]
    time = _first_touch(
        apart[i, j],
        towards[i, j],
        np.stack([heading[me], heading[j]]),
        np.stack([world.half_length[[me, j]], world.half_width[[me, j]]], axis=-1),
    )
    np.minimum.at(times, i, np.where(time <= HORIZON, time, np.inf))
    return times


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

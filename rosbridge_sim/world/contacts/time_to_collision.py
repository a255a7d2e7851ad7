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

from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.world.contacts.collisions import TOUCHING
from rosbridge_sim.world.geometry.planar import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    as_parts,
    in_columns,
    octagon,
)
from rosbridge_sim.world.roads.surface import Surface
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows

_Float = TypeVar("_Float", np.float32, np.float64)

HORIZON: Final = 10.0
"""Times above this count as none [s]: studies of conflicts call less than 1.5 to 4 s critical, and no driver keeps
velocity and heading for ten."""

MAX_PAIRS_AT_ONCE: Final = 1 << 14
"""Pairs looked at at once: the temporary arrays of 128 kB stay inside the cache."""

NOTHING: Final[IntArray] = np.zeros(0, dtype=np.int64)
NO_PAIRS: Final[IntArray] = np.zeros((2, 0), dtype=np.int64)
NO_MOTION: Final[ComplexArray] = np.zeros((3, 2, 0), dtype=np.complex128)

MAX_RISE: Final = 50.0
"""Greatest rise that is guessed from the present slope [m]: 10 % for 10 s at 50 m/s."""

FEW: Final = 256
"""Of fewer pairs in many worlds all are looked at."""

ROUGH: Final = 0.05
"""Boxes are so much larger [m], and the horizon so much longer [s], where `_Partners` calculates roughly."""


def find_times_to_collision(world: WorldRows, rows: IntArray) -> FloatArray:
    """Return for each row the least time to collision with any other entity.

    Entities above or below, such as those on a bridge, are left out.

    Args:
        world: read only.
        rows: (k,) int64, rows in use; of many worlds their egos, `World.rows`.

    Returns:
        (k,) 0 while they touch, inf for none within `HORIZON` [s].
    """
    is_one = world.world_of_row is None or world.num_worlds == 1
    return _times_of(world, len(rows), *(_near(world, rows) if is_one else _near_in_many_worlds(world, rows)))


def find_times_of_pairs(world: WorldRows, num: int, i: IntArray, pairs: IntArray) -> FloatArray:
    """Return what `find_times_to_collision` returns, if all pairs that touch within the horizon are known.

    Args:
        world: read only.
        num: number of rows whose times are wanted.
        i: (m,) int64, of which of these each pair is.
        pairs: (2, m) int64, these rows, and those of the others.
    """
    return _times_of(world, num, i, pairs, _move(world, pairs))


def _times_of(world: WorldRows, num: int, i: IntArray, pairs: IntArray, motion: ComplexArray) -> FloatArray:
    """Return the least time of each of `num` rows; see `find_times_of_pairs`, and `_move` for `motion`."""
    times = np.full(num, np.inf)
    at = _do_meet(world, pairs, motion).nonzero()[0] if len(i) else i
    if not len(at):
        return times
    i, pairs, (heading, middle, velocity) = i[at], pairs[:, at], motion.take(at, axis=2)
    time = _first_touch(
        middle[1] - middle[0],
        velocity[1] - velocity[0],
        heading,
        in_columns(world.half_length[pairs], world.half_width[pairs]),
    )
    if not world.roads.is_flat:
        time = np.where(_are_level(world, pairs, middle, velocity, time), time, np.inf)
    np.minimum.at(times, i, np.where(time <= HORIZON, time, np.inf))
    return times


def _move(world: WorldRows, rows: IntArray | slice) -> ComplexArray:
    """Return heading, middle of the box [m] and velocity [m/s] of rows (...), east + i north, (3, ...)."""
    yaw = world.yaw[rows]
    motion = np.empty((3, *yaw.shape), dtype=np.complex128)
    heading = np.exp(1j * yaw, out=motion[0])
    motion[1] = world.x[rows] + 1j * world.y[rows] + world.centre[rows] * heading
    motion[2] = (world.speed[rows] + 1j * world.lateral_speed[rows]) * heading
    return motion


def _near(world: WorldRows, rows: IntArray) -> tuple[IntArray, IntArray, ComplexArray]:
    """Return the pairs of which the rectangles that they reach within the horizon overlap.

    Args:
        world: read only; of one world.
        rows: (k,) int64.

    Returns:
        (m,) int64, indices into `rows`; (2, m) int64, rows, and those of the others; and (3, 2, m), `_move` of these.
    """
    motion = _move(world, slice(None))
    _, middle, velocity = motion
    radius = np.hypot(world.half_length, world.half_width)
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
        if size < len(rows):  # a crowd has millions of pairs: keep those alone that will meet
            is_near &= world.alive
            if world.roads.is_flat:
                top = world.z + world.height - TOUCHING
                is_near &= (world.z < top[part, None]) & (world.z[part, None] < top)
            is_near &= _will_touch(
                middle - middle[part, None], velocity - velocity[part, None], radius + radius[part, None]
            )
        i, j = is_near.nonzero()
        if len(i):
            found.append(np.array([first + i, part[i], j]))
    if not found:
        return NOTHING, NO_PAIRS, NO_MOTION
    index, *rest = found[0] if len(found) == 1 else np.concatenate(found, axis=1)
    pairs = np.array(rest)
    return index, pairs, motion.take(pairs, axis=1)


def _near_in_many_worlds(world: WorldRows, rows: IntArray) -> tuple[IntArray, IntArray, ComplexArray]:
    """Return the same pairs of egos and others of their worlds, without most of those that will not meet."""
    partners = world.derived(_Partners)
    assert rows is partners.rows
    j, i = partners.may_meet(world)
    pairs = np.stack([rows[i], partners.others[j, i]])
    motion = _move(world, pairs)
    _, middle, velocity = motion
    span = np.hypot(world.half_length[pairs], world.half_width[pairs]) + HORIZON * np.abs(velocity)
    reach = span[1] + span[0]
    is_near = np.abs(middle.real[1] - middle.real[0]) <= reach
    is_near &= np.abs(middle.imag[1] - middle.imag[0]) <= reach
    return i[is_near], pairs[:, is_near], motion[:, :, is_near]


class _Partners:
    """The pairs of egos and other entities of their worlds. It lives until the next `World.touch`.

    A few egos in each of hundreds of worlds are thousands of pairs, and few of them will meet. The others are found in
    a rough calculation with numbers of 32 bits, in a tenth of the time.

    Attributes:
        rows: (k,) int64, rows of the egos.
        others: (m, k) int64, all rows of their worlds.
    """

    def __init__(self, world: WorldRows) -> None:
        assert world.world_of_row is not None
        self.rows = world.rows(Kind.EGO)
        in_worlds = world.world_of_row.argsort(kind="stable").reshape(int(world.world_of_row[-1]) + 1, -1)
        self.others = in_worlds[world.world_of_row[self.rows]].T
        # Usually that is all rows, in their order.
        self._is_all = self.others.size == world.n and bool((self.others.ravel() == np.arange(world.n)).all())
        self._is_other = world.alive[self.others] & (self.others != self.rows)
        radius = np.hypot(world.half_length, world.half_width)
        self._width = (radius[self.others] + (radius[self.rows] + ROUGH)).astype(np.float32)

    def may_meet(self, world: WorldRows) -> tuple[IntArray, IntArray]:
        """Return the indices into `others` of those that may touch within the horizon: of all that do, and few more."""
        if self.others.size < FEW:
            j, i = self._is_other.nonzero()
            return j, i
        single = np.float32
        yaw, speed, aside = (column.astype(single) for column in (world.yaw, world.speed, world.lateral_speed))
        cos, sin = np.cos(yaw), np.sin(yaw)
        # Places are subtracted before they are rounded: far from the origin of a map 32 bits have no centimetres.
        east = self._apart(world.x + world.centre * cos).astype(single)
        north = self._apart(world.y + world.centre * sin).astype(single)
        east_speed, north_speed = self._apart(speed * cos - aside * sin), self._apart(speed * sin + aside * cos)
        distance = np.sqrt(east * east + north * north)
        closing = np.sqrt(east_speed * east_speed + north_speed * north_speed)
        # A velocity is wrong by some millionths of the greatest one.
        most = float(np.abs(speed).max(initial=0.0) + np.abs(aside).max(initial=0.0))
        error = distance * single(1e-5 * (1.0 + most))
        is_met = distance <= self._width + single(HORIZON + ROUGH) * closing
        is_met &= east * east_speed + north * north_speed <= error
        is_met &= np.abs(east * north_speed - north * east_speed) <= self._width * closing + error
        is_met |= distance <= self._width
        is_met &= self._is_other
        j, i = is_met.nonzero()
        return j, i

    def _apart(self, figure: NDArray[_Float]) -> NDArray[_Float]:
        """Return by how much a figure of all rows, (n,), of the others is more than that of the egos, (m, k)."""
        others = figure.reshape(self.others.shape) if self._is_all else figure.take(self.others)
        return others - figure.take(self.rows)


def _do_meet(world: WorldRows, pairs: IntArray, motion: ComplexArray) -> BoolArray:
    """Return of which pairs (m,) the circles touch within the horizon, on a flat map at about one height.

    Args:
        world: read only.
        pairs: (2, m) int64, rows.
        motion: (3, 2, m), `_move` of these.
    """
    _, middle, velocity = motion
    radius = np.hypot(world.half_length[pairs], world.half_width[pairs])
    is_met = _will_touch(middle[1] - middle[0], velocity[1] - velocity[0], radius[1] + radius[0])
    is_met &= world.alive[pairs[1]]
    if world.roads.is_flat:
        bottom, top = world.z[pairs], world.z[pairs] + world.height[pairs] - TOUCHING
        is_met &= (bottom[0] < top[1]) & (bottom[1] < top[0])
    return is_met


def _will_touch(apart: ComplexArray, towards: ComplexArray, width: FloatArray) -> BoolArray:
    """Return whether circles touch within the horizon that are so far apart [m], move so [m/s], and are so wide [m]."""
    distance, speed = np.abs(apart), np.abs(towards)
    product = apart.conj() * towards
    # They come nearer, and will not miss one another.
    is_met: BoolArray = (product.real < 0.0) & (np.abs(product.imag) <= width * speed)
    is_met &= distance - width <= HORIZON * speed
    is_met |= distance <= width
    return is_met


def _are_level(
    world: WorldRows, pairs: IntArray, middle: ComplexArray, velocity: ComplexArray, time: FloatArray
) -> BoolArray:
    """Return (m,) which pairs are at one height when they touch.

    Args:
        world: read only; its roads are not flat.
        pairs: (2, m) int64, rows.
        middle: (2, m) of the boxes [m].
        velocity: (2, m) [m/s].
        time: (m,) when they touch; a pair that never does is not level [s].
    """
    is_level = time <= HORIZON
    at = is_level.nonzero()[0]
    pairs, time = pairs[:, at], time[at]
    place = middle[:, at] + velocity[:, at] * time
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
    # Half the width of the four strips: (along, across) the one box, then the other.
    strip = octagon(heading[0] * into[1], half) - TOUCHING
    place, speed = as_parts(apart * into), as_parts(towards * into)
    # Without motion across a strip: in it for ever, or never.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        one, other = (-strip - place) / speed, (strip - place) / speed
    enters, leaves = np.minimum(one, other).max(axis=(0, 2)), np.maximum(one, other).min(axis=(0, 2))
    return np.where((enters <= leaves) & (leaves >= 0.0), np.maximum(enters, 0.0), np.inf)

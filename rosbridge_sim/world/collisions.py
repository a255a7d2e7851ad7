"""Who touches whom: oriented boxes, swept over the whole of a step, so that nobody passes through anybody unseen.

What counts. Two entities touch in a step if their boxes (`Body.length` x `width`, turned by the yaw, from the ground
up to `height`) overlap at any moment of it, and one of them is a car: what people and boxes do among themselves is
nobody's business here. Boxes that stand edge to edge do not touch. `World.contacts` holds the pairs of the last step.

What a contact does: it is reported, and nothing else. Bodies go through each other. MORAI documents no effect on
motion; an ego that is stopped, thrown back or bent by a model of our own would surprise everyone who uses a collision
to end an episode, and would make the way there depend on that model.

How it is exact at any speed. Within a step the boxes slide along the straight line from where they stood to where they
stand, at the heading that they have at the end: `geometry.do_boxes_meet` decides that for the whole line at once. Who
turns so much that a corner strays by more than `GRAIN` is taken in smaller pieces. So the places where a step ends are
judged exactly, all others to `GRAIN`. The heights are judged coarsely, by all that a body passes within the step.

How it is cheap. Most of the time nobody is near to anybody. A *list* holds the pairs that could meet within the next
`LIFE` steps if everybody went on as he does, or strayed from that by less than a margin; whoever strays by more ends
the list. It is made by the same judgement as above, of boxes that are larger by the margins. While it is empty, a step
costs a few comparisons of whole arrays. The list decides what is looked at and never what is found.

Nothing depends on rows or on the order of spawning: all goes by id.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry import BoolArray, ComplexArray, FloatArray, IntArray, do_boxes_meet, wrap_angle
from rosbridge_sim.world.state import NO_CONTACTS, Kind, World

__all__ = ["CollisionDetector", "find", "find_crashes", "find_touched", "remember"]

GRAIN: Final = 0.02
"""How far a corner may stray from its place because its box turns [m]: less than the thinnest post."""

MAX_SWEEP_PIECES: Final = 256
"""Into how many a step is cut at most: half a turn of a car at once still goes by 3 cm."""

TOUCHING: Final = 1e-6
"""What two boxes must overlap by [m]: coordinates of a map are rounded at 1e-9 and less."""

LIFE: Final = 12
"""Steps that a list lasts at most: a quarter of a second, in which a driver changes little of what was foreseen."""

MARGIN: Final = 0.15
"""What anybody may stray from his foreseen place, either way east and either way north [m]: 5 m/s^2 for LIFE steps."""

TURN_MARGIN: Final = 0.55
"""What his corners may stray because his heading is not the foreseen one [m]. A car turns into a street corner without
ending the list, and two cars side by side on lanes of 3.5 m are still not on it."""

SMALL: Final = 64
"""A world of so few needs no cells: everybody is compared with everybody."""

MAX_WIDE: Final = 8
MUCH: Final = 1.5
"""In a larger one, cells are as large as the usual entity needs. A few may be larger by far, and are compared with
everybody."""

MAX_BOX_PAIRS: Final = 1 << 16
PAIRS_EACH: Final = 8
MAX_NEAR: Final = 1 << 14
NEAR_EACH: Final = 1
"""Pairs that are compared coarsely for one list, and pairs that it is made of: so many at least, and so many for each
entity. 20,000 cars in a jam, bumper to bumper, need 90,000 and 20,000. More is a heap: of that a part is judged, all
pairs of an ego and then half as many others, of those with few partners first. So a heap in one place takes no contact
from those elsewhere, and costs a step no more than a jam does."""

MAX_SWEEPS: Final = 1 << 17
"""Pieces of turning pairs that are judged in a step, about 10 ms: 500 pairs at `MAX_SWEEP_PIECES`. With more pairs the
pieces are fewer, and so coarser."""

COLUMN: Final = 1 << 32
"""From a cell to its eastern neighbour, in numbers of cells; to its northern one it is 1."""

X, Y, YAW, SPEED, Z = range(5)  # of a pose


class CollisionDetector:
    """Who is where in the arrays, where they stood as the step began, and who might come to touch whom.

    Lives until somebody comes or goes (or does anything else that is a `touch`).

    Attributes:
        poses: (2, 5, n) as the step began and as it ended: x, y, yaw, speed, z.
    """

    __slots__ = (
        *(
            "_centre",
            "_drift",
            "_half",
            "_is_out",
            "_chord",
            "_life",
            "_margin",
            "_may_meet",
            "_now",
            "_pairs",
            "_places",
        ),
        *("_rate", "_reach", "_rows", "_seen", "_uid", "_world", "poses"),
    )

    def __init__(self, world: World) -> None:
        n = world.n
        rows = np.flatnonzero(world.alive)
        self._world = world
        self._uid = world.uid.copy()
        self._rows = rows[self._uid[rows].argsort()]
        # Around the reference point, whichever way the box is turned.
        self._reach = np.maximum(np.hypot(world.half_length + np.abs(world.centre), world.half_width), TOUCHING)
        is_car = world.kind[self._rows] <= Kind.VEHICLE
        # A small world needs no cells: each of those with each of those after it.
        self._may_meet = np.triu(is_car[:, None] | is_car, 1) if len(rows) <= SMALL else None
        self.poses: FloatArray = np.zeros((2, 5, n))
        self._now = world.block("x", "z")
        # Of x, y, yaw, as the step began and as it ended: where they are, were foreseen, and how far they may be off.
        self._places = self.poses[:, : YAW + 1]
        self._seen: FloatArray = np.zeros((2, 3, n))
        self._rate: FloatArray = np.zeros((3, n))
        self._margin: FloatArray = np.zeros((3, n))
        self._drift = np.empty((2, 3, n))
        self._is_out = np.empty((2, 3, n), dtype=bool)
        self._life = 0
        self._list(np.empty((2, 0), dtype=np.int64))

    def keep(self) -> None:
        """Remember where everybody stands."""
        np.copyto(self.poses[0], self._now)

    def take_over(self, other: CollisionDetector) -> None:
        """Remember what another one did, of all who were there then and are there now."""
        self.keep()
        n = min(len(self._uid), len(other._uid))
        is_same = self._uid[:n] == other._uid[:n]
        self.poses[0, :, :n][:, is_same] = other.poses[0, :, :n][:, is_same]

    def find(self) -> IntArray:
        """The contacts from what is remembered to now, (m, 2) ids, the lower one first, in rising order."""
        np.copyto(self.poses[1], self._now)
        np.add(self._seen, self._rate, self._seen)
        np.subtract(self._places, self._seen, self._drift)
        np.absolute(self._drift, self._drift)
        np.greater(self._drift, self._margin, self._is_out)
        if self._life <= 0 or np.count_nonzero(self._is_out):
            self._look_around()
        self._life -= 1
        return self._judge() if self._pairs.size else NO_CONTACTS

    # The list

    def _look_around(self) -> None:
        """Make the list anew: for this step and `LIFE` more."""
        world = self._world
        start, end = self._places
        self._life = LIFE
        self._seen = self._places.copy()
        self._rate = end - start
        turn = np.abs(wrap_angle(self._rate[YAW]))
        self._rate[YAW] = 0.0
        reach = self._reach
        # Whoever turns now may go on to do so.
        self._margin[:YAW] = MARGIN + 0.5 * LIFE * LIFE * np.abs(self._rate[:YAW]).max(axis=0) * turn
        self._margin[YAW] = TURN_MARGIN / reach + LIFE * turn
        extra = math.sqrt(2.0) * self._margin[X] + self._margin[YAW] * reach

        # The middles of the boxes, from where this step began on, at the heading of now.
        heading = _unit(end[YAW])
        way, middle = _complex(self._rate[X], self._rate[Y]), heading * world.centre + _complex(end[X], end[Y])
        first, last = middle - way, middle + LIFE * way
        cos, sin, half = np.abs(heading.real), np.abs(heading.imag), (world.half_length, world.half_width)
        span = np.stack([half[0] * cos + half[1] * sin, half[0] * sin + half[1] * cos])
        span += 0.5 * (LIFE + 1) * np.abs(self._rate[:YAW]) + extra
        middle = 0.5 * (first + last)
        near = self._near(np.stack([middle.real, middle.imag]), span)
        pairs = self._rows[near]
        if pairs.size:
            sides = np.stack([half[0][pairs], half[1][pairs]], axis=-1) + extra[pairs][..., None]
            apart = [place[pairs[1]] - place[pairs[0]] for place in (first, last)]
            pairs = pairs[:, do_boxes_meet(apart[0], apart[1], heading[pairs], sides)]
        self._list(pairs)

    def _near(self, place: FloatArray, span: FloatArray) -> IntArray:
        """Pairs of indices into `_rows` whose rectangles overlap, (2, m): see `_near_by_cells`."""
        rows = self._rows
        place, span = place[:, rows], span[:, rows]
        if self._may_meet is not None:
            is_near = np.abs(place[:, :, None] - place[:, None]) <= span[:, :, None] + span[:, None]
            return np.stack((is_near[0] & is_near[1] & self._may_meet).nonzero())
        kind = self._world.kind[rows]
        return _near_pairs(place, span, kind <= Kind.VEHICLE, kind == Kind.EGO)

    def _list(self, pairs: IntArray) -> None:
        world = self._world
        self._pairs = pairs
        half = np.stack([world.half_length[pairs], world.half_width[pairs]], axis=-1)
        self._half = np.maximum(half - TOUCHING / 2, 0.0)
        self._centre = world.centre[pairs]
        # A chord of this length on the unit circle is what a heading may change by without a corner straying.
        self._chord = GRAIN / np.maximum(np.hypot(half[..., 0], half[..., 1]), GRAIN)

    # The judgement

    def _judge(self) -> IntArray:
        """Which pairs of the list touch, as ids."""
        pairs = self._pairs
        poses = self.poses[:, :, pairs]  # (2, 5, 2, m)
        heading = _unit(poses[:, YAW])
        middle = heading * self._centre
        middle.real += poses[:, X]
        middle.imag += poses[:, Y]
        apart = middle[:, 1] - middle[:, 0]
        is_hit = do_boxes_meet(apart[0], apart[1], heading[1], self._half)
        stray = np.abs(heading[1] - heading[0]) / self._chord
        if np.count_nonzero(stray > 1.0):
            is_turning = (stray > 1.0).any(axis=0)
            most = max(1, MAX_SWEEPS // np.count_nonzero(is_turning))
            num = min(MAX_SWEEP_PIECES, most, math.ceil(stray.max()))
            is_hit[is_turning] = self._judge_turning(poses[..., is_turning], is_turning, num)
        if not np.count_nonzero(is_hit):
            return NO_CONTACTS
        pairs, z = pairs[:, is_hit], poses[:, Z][..., is_hit]
        low, high = z.min(axis=0), z.max(axis=0) + self._world.height[pairs]
        pairs = pairs[:, (low < high[::-1] - TOUCHING).all(axis=0)]
        return np.ascontiguousarray(self._uid[pairs].T)

    def _judge_turning(self, poses: FloatArray, of: BoolArray, num: int) -> BoolArray:
        """Which of these pairs touch, the step being cut into so many pieces."""
        start, end = poses
        part = np.linspace(0.0, 1.0, num + 1)[:, None, None]
        heading = _unit(start[YAW] + part * wrap_angle(end[YAW] - start[YAW]))  # (pieces + 1, 2, m)
        middle = heading * self._centre[:, of]
        middle.real += start[X] + part * (end[X] - start[X])
        middle.imag += start[Y] + part * (end[Y] - start[Y])
        apart = middle[:, 1] - middle[:, 0]
        half = self._half[:, None, of]
        is_hit = do_boxes_meet(apart[:-1], apart[1:], heading[1:].swapaxes(0, 1), half)
        return np.asarray(is_hit.any(axis=0))


def remember(world: World) -> CollisionDetector:
    """Keep where everybody stands as a step begins; give it to `find` as it ends."""
    watch = world.derived(CollisionDetector)
    watch.keep()
    return watch


def find(world: World, watch: CollisionDetector) -> None:
    """Set `world.contacts` to those who have touched since `remember`."""
    now = world.derived(CollisionDetector)
    if now is not watch:  # somebody has come, gone or stopped within the step
        now.take_over(watch)
    world.contacts = now.find()


def find_touched(world: World, uid: int) -> IntArray:
    """Return the rows of all that somebody touched in the last step, (k,) in order of their ids."""
    pairs = world.contacts
    others = pairs[:, ::-1][pairs == uid]
    return np.array([world.row(int(other)) for other in np.sort(others)], dtype=np.int64)


def find_crashes(world: World, most: int) -> IntArray:
    """Return the rows of the vehicles (no egos) that touched each other in the last step, (k, 2) in order of their ids.

    Args:
        world: read only.
        most: of more pairs than that the first ones.
    """
    pairs = world.contacts
    if not len(pairs):
        return pairs
    rows = world.alive.nonzero()[0]
    rows = rows[world.uid[rows].argsort()]
    found = rows[world.uid[rows].searchsorted(pairs)]
    return np.asarray(found[(world.kind[found] == Kind.VEHICLE).all(axis=1)][:most])


def _unit(yaw: FloatArray) -> ComplexArray:
    """Headings as complex unit vectors."""
    unit = np.empty(yaw.shape, dtype=np.complex128)
    np.cos(yaw, unit.real)
    np.sin(yaw, unit.imag)
    return unit


def _complex(x: FloatArray, y: FloatArray) -> ComplexArray:
    """Plane vectors as complex numbers."""
    vector = np.empty(x.shape, dtype=np.complex128)
    vector.real, vector.imag = x, y
    return vector


# Near pairs


def _near_pairs(place: FloatArray, span: FloatArray, is_car: BoolArray, is_ego: BoolArray) -> IntArray:
    """Return the pairs whose rectangles overlap and that have a car among them, by cells where that is faster.

    Args:
        place: (2, k) middles of the rectangles, east and north [m].
        span: (2, k) half of their sides [m].
        is_car: (k,) bool.
        is_ego: (k,) bool: their pairs come before all others where there are too many.

    Returns:
        (2, m) indices, the lower one first, in rising order.
    """
    k = place.shape[1]
    most = max(MAX_BOX_PAIRS, PAIRS_EACH * k)
    widest = span.max(axis=0)
    usual = np.partition(widest, k - 1 - MAX_WIDE)[k - 1 - MAX_WIDE]
    is_wide = widest > MUCH * usual
    pairs = _near_of_both(place, span, is_car, is_wide, most)
    is_heap = pairs is None
    if pairs is None:
        is_wide[is_ego.nonzero()[0][: most // k]] = True
        pairs = _near_of_both(place, span, is_car, is_wide, most // 4, is_heap=True)
        assert pairs is not None
    low, high = np.minimum(pairs[0], pairs[1]), np.maximum(pairs[0], pairs[1])
    order = (low * k + high).argsort()
    pairs = np.stack([low[order], high[order]])
    most = max(MAX_NEAR, NEAR_EACH * k)
    if pairs.shape[1] <= most // 2 or (pairs.shape[1] <= most and not is_heap):
        return pairs
    return _thin_out(pairs, is_ego, most)


def _thin_out(pairs: IntArray, is_ego: BoolArray, most: int) -> IntArray:
    """Return `most` pairs of egos at most and half as many others, of those with few partners first; in their order."""
    has_ego = is_ego[pairs[0]] | is_ego[pairs[1]]
    is_kept: BoolArray = has_ego & (has_ego.cumsum() <= most)
    others = (~has_ego).nonzero()[0]
    num_partners = np.bincount(pairs[:, others].ravel())
    is_kept[others[num_partners[pairs[:, others]].sum(axis=0).argsort(kind="stable")[: most // 2]]] = True
    return np.ascontiguousarray(pairs[:, is_kept])


def _find_share(count: IntArray, most: int) -> int:
    """Return the largest share such that all together take `most` at most, where each takes its share or its count."""
    low, high = 0, most
    while low < high:
        share = (low + high + 1) // 2
        if np.minimum(count, share).sum() <= most:
            low = share
        else:
            high = share - 1
    return low


def _near_of_both(
    place: FloatArray, span: FloatArray, is_car: BoolArray, is_wide: BoolArray, most: int, *, is_heap: bool = False
) -> IntArray | None:
    """The same in no order, the wide against everybody, the rest by cells; see `_near_by_cells`."""
    rest = (~is_wide).nonzero()[0]
    pairs = _near_by_cells(place[:, rest], span[:, rest], is_car[rest], most, is_heap=is_heap)
    if pairs is None:
        return None
    pairs = rest[pairs]
    wide = is_wide.nonzero()[0]
    if len(wide):
        pairs = np.concatenate([pairs, _near_of_wide(place, span, is_car, wide)], axis=1)
    return pairs


def _near_of_wide(place: FloatArray, span: FloatArray, is_car: BoolArray, wide: IntArray) -> IntArray:
    """Some against everybody; each pair once."""
    is_near = (np.abs(place[:, wide, None] - place[:, None]) <= span[:, wide, None] + span[:, None]).all(axis=0)
    is_near &= is_car[wide, None] | is_car
    # Two of them are a pair once, from the lower one on.
    is_near[:, wide] &= wide[:, None] < wide
    i, j = is_near.nonzero()
    return np.stack([wide[i], j])


def _near_by_cells(
    place: FloatArray, span: FloatArray, is_car: BoolArray, most: int, *, is_heap: bool
) -> IntArray | None:
    """By a grid whose cells are as large as the largest two need; each pair once.

    At most so many are compared. More give None or, in a heap, as many of each one's as there is room for; then the
    nearest ones in the east-west direction come first, for most of a heap's cell is not near.
    """
    column, line = np.floor(place / (2.0 * span.max(axis=1, initial=1.0)[:, None])).astype(np.int64)
    number = column * COLUMN + line
    order = np.lexsort((place[0], number)) if is_heap else number.argsort(kind="stable")
    number = number[order]
    # Partners: whoever comes later in the same cell or stands in the one north of it, and the three cells east.
    here = np.arange(len(number))
    starts = np.stack([here + 1, number.searchsorted(number + (COLUMN - 1), side="left")])
    ends = number.searchsorted(np.stack([number + 1, number + (COLUMN + 1)]), side="right")
    count = (ends - starts).ravel()
    if count.sum() > most:
        if not is_heap:
            return None
        np.minimum(count, _find_share(count, most), out=count)
    total = count.cumsum()
    owner = np.tile(here, 2).repeat(count)
    partner = np.arange(len(owner)) + (starts.ravel() - (total - count)).repeat(count)
    (x, y), (x_span, y_span) = place[:, order], span[:, order]
    is_near = np.abs(x[owner] - x[partner]) <= x_span[owner] + x_span[partner]
    owner, partner = owner[is_near], partner[is_near]
    is_near = np.abs(y[owner] - y[partner]) <= y_span[owner] + y_span[partner]
    pairs: IntArray = order[np.stack([owner[is_near], partner[is_near]])]
    return pairs[:, is_car[pairs].any(axis=0)]

"""Collision detection: which entities touch, with oriented boxes that are swept over the whole of a step.

*What counts.* Two entities touch in a step if their boxes overlap at any moment of it, and at least one of them is a
car (an ego or a vehicle); contacts among pedestrians and obstacles are not reported. A box is `Body.length` x `width`,
turned by the yaw, from the ground up to `height`. Boxes that stand edge to edge do not touch. `World.contacts` holds
the pairs of the last step.

*What a contact does.* It is reported only, unless the world has `impacts`. MORAI documents no effect on motion.
An ego that is stopped or thrown back by a model of our own would surprise everyone who uses a collision to end an
episode.

*How it is exact at any speed.* Within a step the boxes slide along the straight line from where they stood to where
they stand, with the heading that they have at the end; `planar.do_boxes_meet` decides for the whole line at once. If
a box turns so much that a corner strays by more than `GRAIN`, the step is cut into smaller pieces. So the end of a step
is judged exactly, and the rest of it to `GRAIN`. Heights are judged coarsely, by all that a body passes in the step; on
a slope from its lowest to its highest end.

*How it is cheap.* Usually no entity is near another. A *list* holds the pairs that could meet within the next `LIFE`
steps if every entity kept its velocity, or strayed from that by less than a margin. An entity that strays by more ends
the list. The list is made by the same judgement, of boxes enlarged by the margins. While it is empty, a step costs a
few comparisons of whole arrays. The list decides which pairs are looked at, and never changes what is found. Nor do the
*gaps*, the distances between the boxes of listed pairs when none touched: while no pair has come closer by more than
its gap, nothing touches.

Nothing depends on rows or on the order of spawning: pairs are sorted by id.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

import numpy as np

from rosbridge_sim.world.geometry.near_pairs import find_near_pairs
from rosbridge_sim.world.geometry.planar import (
    FULL_TURN,
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    box_gaps,
    distinct,
    do_boxes_meet,
    in_columns,
    is_any,
    ranges,
    wrap_angle,
)
from rosbridge_sim.world.state.loop_maker import LoopMaker
from rosbridge_sim.world.state.world import NO_CONTACTS, Kind, World
from rosbridge_sim.world.state.world_rows import WorldRows

GRAIN: Final = 0.02
"""Distance that a corner may stray from its place because its box turns [m]: less than the thinnest post."""

MAX_SWEEP_PIECES: Final = 256
"""Pieces into which a step is cut, at most: half a turn of a car within one step is still cut every 3 cm."""

TOUCHING: Final = 1e-6
"""By how much two boxes must overlap to touch [m]: coordinates of a map are rounded at 1e-9 and less."""

LIFE: Final = 16
"""Steps that a list lasts at most: a third of a second, in which drivers hardly change their motion."""

MARGIN: Final = 0.2
"""Distance that an entity may stray from its foreseen place, in x and in y [m]: 4 m/s^2 for `LIFE` steps."""

TURN_MARGIN: Final = 0.55
"""Distance that its corners may stray because its heading is not the foreseen one [m]. A car can turn at a corner
without ending the list, and two cars side by side on lanes of 3.5 m are still not on it."""

MORE: Final = 1.0 + 1e-12
"""Factor of places on a line of many worlds, so that rounding loses no pair: at most some centimetres."""

MAX_PAIRWISE: Final = 64
"""Up to so many entities are all compared with each other; more are sorted into cells first, which is faster then."""

MAX_SWEEPS: Final = 1 << 15
"""Pieces of turning pairs that are judged in a step: about 10 ms of a busy machine, 128 pairs at `MAX_SWEEP_PIECES`.
With more pairs each step is cut into fewer pieces, which are coarser."""

NO_PAIRS: Final = np.empty((2, 0), dtype=np.int64)

POSE_X, POSE_Y, POSE_YAW, POSE_SPEED, POSE_Z = range(5)
"""Rows of the array `CollisionDetector.poses`."""


class Watch(IntEnum):
    """Answer of loops about the pairs of the list."""

    APART = 0
    MAY_TOUCH = 1
    LIST_ENDS = 2


class Foreseen(NamedTuple):
    """Arrays of a detector that loops write, see there.

    Attributes:
        poses: (2, 5, n).
        seen: (2, 3, n) foreseen x, y [m] and yaw [rad] as the step began and as it ended.
        rate: (3, n) their change in a step.
        margin: (3, n) by which they may differ.
        reach: (n,) of the boxes from their reference points [m]; read.
    """

    poses: FloatArray
    seen: FloatArray
    rate: FloatArray
    margin: FloatArray
    reach: FloatArray


class PairLoops(Protocol):
    """Loops that watch the pairs of one world or of many, see `kernels.pair_kernel`."""

    def watch(self, *, is_due: bool) -> Watch:
        """Take the poses as the step has ended, and say what is to be done; a list that `is_due` ends."""

    def list_pairs(self) -> IntArray | None:
        """Return the list of `CollisionDetector`; None for a heap."""

    def judge(self, pairs: IntArray) -> bool:
        """Take a list, and return whether a pair of it may touch."""


MakeLoops = Callable[[WorldRows, IntArray, Foreseen], PairLoops]
"""Returns the loops for the rows in use, (k,) int64, in order of their ids; those of a world are neighbours."""

PAIR_LOOPS: Final = LoopMaker[MakeLoops]()
"""The loops that watch pairs, from the next list of each world on."""


class CollisionDetector:
    """Finds the contacts of each step: the poses as it began, and the list of pairs that may touch.

    It lives until the next `World.touch`: until an entity comes or goes, stops or starts to move.

    Attributes:
        poses: (2, 5, n) as the step began and as it ended: x, y [m], yaw [rad], speed [m/s], z [m].
    """

    def __init__(self, world: WorldRows) -> None:
        n = world.n
        rows = world.alive.nonzero()[0]
        self._world = world
        self._uid = world.ids().copy()
        self._world_of_row = world.world_of_row
        self._rows = rows[self._uid[rows].argsort()]
        # Radius around the reference point that holds the box at any yaw.
        self._reach = np.maximum(np.hypot(world.half_length + np.abs(world.centre), world.half_width), TOUCHING)
        is_car = world.kind[self._rows] <= int(Kind.VEHICLE)
        # A small world needs no cells: each entity with each one after it.
        is_small = len(rows) <= MAX_PAIRWISE and self._world_of_row is None
        self._may_meet = np.triu(is_car[:, None] | is_car, 1) if is_small else None
        self.poses: FloatArray = np.zeros((2, 5, n))
        self._poses_before, self._poses_after = self.poses
        self._now = world.block("x", "z")
        # Of x, y and yaw, as the step began and as it ended: actual, foreseen, and the allowed difference.
        self._places = self.poses[:, : POSE_YAW + 1]
        self._seen: FloatArray = np.zeros((2, 3, n))
        self._rate: FloatArray = np.zeros((3, n))
        self._margin: FloatArray = np.zeros((3, n))
        self._drift = np.empty((2, 3, n))
        self._is_out = np.empty((2, 3, n), dtype=bool)
        self._life = 0
        self._maker: MakeLoops | None = None
        self._loops: PairLoops | None = None
        self._list(NO_PAIRS)

    def keep(self) -> None:
        """Store the poses of all entities as those of the beginning of the step."""
        np.copyto(self._poses_before, self._now)

    def take_over(self, other: CollisionDetector) -> None:
        """Take the stored poses of another detector, for the entities that were there then and are there now."""
        self.keep()
        n = min(len(self._uid), len(other._uid))
        is_same = self._uid[:n] == other._uid[:n]
        self.poses[0, :, :n][:, is_same] = other.poses[0, :, :n][:, is_same]

    def find(self) -> IntArray:
        """Return the contacts between the stored poses and now, (m, 2) int64, ids, the lower first, in rising order."""
        if self._life <= 0 and PAIR_LOOPS.make is not self._maker:
            self._take_loops(PAIR_LOOPS.make)
        may_touch = self._watch() if self._loops is None else self._watch_by_loops(self._loops)
        self._life -= 1
        return self._judge() if may_touch else NO_CONTACTS

    def _take_loops(self, make: MakeLoops | None) -> None:
        self._maker, self._loops = make, None
        if make is not None:
            foreseen = Foreseen(self.poses, self._seen, self._rate, self._margin, self._reach)
            self._loops = make(self._world, self._rows, foreseen)

    def _watch(self) -> bool:
        """Bring the list up to date, and return whether there are pairs on it."""
        np.copyto(self._poses_after, self._now)
        np.add(self._seen, self._rate, self._seen)
        np.subtract(self._places, self._seen, self._drift)
        np.absolute(self._drift, self._drift)
        np.greater(self._drift, self._margin, self._is_out)
        if self._life <= 0:
            self._look_around(slice(None))
        elif self._is_astray():
            self._look_around(self._find_astray())
        return self._pairs.size > 0

    def _watch_by_loops(self, loops: PairLoops) -> bool:
        """Bring the list up to date, and return whether a pair of it may touch."""
        found = loops.watch(is_due=self._life <= 0)
        if found != Watch.LIST_ENDS:
            return found == Watch.MAY_TOUCH
        pairs = loops.list_pairs()
        if pairs is None:
            self._look_around(slice(None))
        else:
            self._life = LIFE
            self._list(pairs)
        return loops.judge(self._pairs)

    # The list

    def _is_astray(self) -> bool:
        """Return whether an entity has strayed from its foreseen place or heading by more than its margin."""
        if not is_any(self._is_out):
            return False
        turn = self._drift[:, POSE_YAW]
        np.minimum(turn, FULL_TURN - turn, out=turn)  # a vehicle that drives west has a yaw next to pi or to -pi
        np.greater(turn, self._margin[POSE_YAW], self._is_out[:, POSE_YAW])
        return is_any(self._is_out)

    def _find_astray(self) -> slice | IntArray:
        """Return the rows of the worlds in which an entity is astray."""
        if self._world_of_row is None:
            return slice(None)
        is_astray = np.zeros(int(self._world_of_row.max(initial=0)) + 1, dtype=bool)
        is_astray[self._world_of_row[self._is_out.any(axis=(0, 1))]] = True
        return is_astray[self._world_of_row].nonzero()[0]

    def _look_around(self, at: slice | IntArray) -> None:
        """Make the list of pairs for this step and `LIFE` more.

        Args:
            at: rows to look around from, those of whole worlds. What the list has of other worlds stays, and its life.
        """
        world = self._world
        is_all = isinstance(at, slice)
        start, end = self._places[..., at]
        if is_all:
            self._life = LIFE
        self._seen[..., at] = self._places[..., at]
        rate = end - start
        turn = np.abs(wrap_angle(rate[POSE_YAW]))
        rate[POSE_YAW] = 0.0
        self._rate[:, at] = rate
        reach = self._reach[at]
        # An entity that turns now may go on turning.
        margin = np.empty_like(rate)
        amount = np.abs(rate[:POSE_YAW])
        margin[:POSE_YAW] = MARGIN + 0.5 * LIFE * LIFE * np.maximum(amount[0], amount[1]) * turn
        margin[POSE_YAW] = TURN_MARGIN / reach + LIFE * turn
        self._margin[:, at] = margin
        extra = math.sqrt(2.0) * margin[POSE_X] + margin[POSE_YAW] * reach
        if (
            self._may_meet is not None
            and not self._pairs.size
            and self._are_apart(end, reach + extra + (LIFE + 1) * np.maximum(amount[0], amount[1]))
        ):
            return

        # The middles of the boxes from the beginning of this step on, at the present heading.
        heading = _unit(end[POSE_YAW])
        slide, middle = (
            _complex(rate[POSE_X], rate[POSE_Y]),
            heading * world.centre[at] + _complex(end[POSE_X], end[POSE_Y]),
        )
        first, last = middle - slide, middle + LIFE * slide
        cos, sin, half = np.abs(heading.real), np.abs(heading.imag), (world.half_length[at], world.half_width[at])
        span = np.array([half[0] * cos + half[1] * sin, half[0] * sin + half[1] * cos])
        span += 0.5 * (LIFE + 1) * amount + extra
        middle = 0.5 * (first + last)
        pairs = self._near(np.array([middle.real, middle.imag]), span, at)
        if pairs.size:
            sides = in_columns(half[0][pairs], half[1][pairs]) + extra[pairs][..., None]
            apart = [place[pairs[1]] - place[pairs[0]] for place in (first, last)]
            pairs = pairs[:, do_boxes_meet(apart[0], apart[1], heading[pairs], sides)]
        if not isinstance(at, slice):
            pairs = self._with_old(at[pairs], at)
        self._list(pairs)

    def _are_apart(self, place: FloatArray, reach: FloatArray) -> bool:
        """Return whether no pair can be on the list, by squares around the entities: the usual case in a small world.

        Args:
            place: (3, n) x and y [m], and yaw.
            reach: (n,) within this of its place an entity is in the steps of the list [m].
        """
        rows = self._rows
        (x, y), reach = place[:POSE_YAW].take(rows, axis=1), reach.take(rows)
        within = reach[:, None] + reach
        is_near = np.abs(x[:, None] - x) <= within
        is_near &= self._may_meet
        return not is_any(is_near) or not is_any(is_near & (np.abs(y[:, None] - y) <= within))

    def _with_old(self, pairs: IntArray, at: IntArray) -> IntArray:
        """Return new pairs (2, m) of the rows `at`, and the pairs of the list that are of others, in order of ids."""
        is_new = np.zeros(len(self._uid), dtype=bool)
        is_new[at] = True
        pairs = np.concatenate([self._pairs[:, ~is_new[self._pairs[0]]], pairs], axis=1)
        return np.asarray(pairs[:, np.lexsort(self._uid[pairs[::-1]])])

    def _near(self, place: FloatArray, span: FloatArray, at: slice | IntArray) -> IntArray:
        """Return pairs of indices into the rows `at` whose rectangles overlap, (2, m), those of lower ids first."""
        rows = self._rows
        if self._world_of_row is not None:
            return self._near_in_worlds(place, span, np.arange(len(self._uid))[at])
        place, span = place[:, rows], span[:, rows]
        if self._may_meet is not None:
            is_near = np.abs(place[:, :, None] - place[:, None]) <= span[:, :, None] + span[:, None]
            return np.asarray(rows[np.array((is_near[0] & is_near[1] & self._may_meet).nonzero())])
        kind = self._world.kind[rows]
        near, is_all = find_near_pairs(place, span, kind <= Kind.VEHICLE, kind == Kind.EGO)
        if not is_all and self._world.on_heap is not None:
            self._world.on_heap()
        return rows[near]

    def _near_in_worlds(self, place: FloatArray, span: FloatArray, at: IntArray) -> IntArray:
        """Return the same of small worlds."""
        assert self._world_of_row is not None
        place_of = np.full(len(self._uid), -1, dtype=np.int64)
        place_of[at] = np.arange(len(at))
        index = place_of[self._rows]
        index = index[index >= 0]  # by world, and by id in each
        if not len(index):
            return np.empty((2, 0), dtype=np.int64)
        place, span = place.take(index, axis=1), span.take(index, axis=1)
        # On one line, one world after the other: entities by their western sides, each with all that begin before its
        # eastern side. Of two that overlap one begins in the other.
        west, east = place[0] - span[0], place[0] + span[0]
        shift = self._world_of_row[at[index]] * (east.max() - west.min() + 1.0) - west.min()
        west, east = west + shift, (east + shift) * MORE + TOUCHING
        order = west.argsort(kind="stable")
        here = np.arange(len(order))
        count = west[order].searchsorted(east[order], side="right") - here - 1
        one, other = order[here.repeat(count)], order[ranges(here + 1, count)]
        for line in range(2):
            apart = np.abs(place[line].take(one) - place[line].take(other))
            near = (apart <= span[line].take(one) + span[line].take(other)).nonzero()[0]
            one, other = one.take(near), other.take(near)
        is_car = (self._world.kind[at] <= int(Kind.VEHICLE))[index]
        near = (is_car.take(one) | is_car.take(other)).nonzero()[0]
        one, other = one.take(near), other.take(near)
        key = np.minimum(one, other) * len(index) + np.maximum(one, other)
        key.sort()
        return np.asarray(index[np.stack([key // len(index), key % len(index)])])

    def _list(self, pairs: IntArray) -> None:
        """Take pairs of rows, (2, m), as the list."""
        self._pairs, self._is_measured = pairs, False
        self._gap = np.zeros(pairs.shape[1])

    def _measure(self) -> None:
        """Work out what the judgement wants of the pairs of a new list."""
        world, pairs = self._world, self._pairs
        self._is_measured = True
        half = in_columns(world.half_length[pairs], world.half_width[pairs])
        self._half = np.maximum(half - TOUCHING / 2, 0.0)
        self._centre = world.centre[pairs]
        # A chord of this length on the unit circle is what a heading may change by without a corner straying.
        corner = np.hypot(half[..., 0], half[..., 1])
        self._chord = GRAIN / np.maximum(corner, GRAIN)
        # An arc is at most pi / 2 times its chord; the middle of the box is on an arc, too.
        self._swing = 0.5 * math.pi * (corner + np.abs(self._centre))
        self._judged = np.zeros((POSE_YAW + 1, *pairs.shape))

    # The judgement

    def _are_still_apart(self) -> bool:
        """Return whether no pair of the list has used up its gap, neither as the step began nor as it ended."""
        if self._gap[0] <= 0.0:
            return False
        way = self._places.take(self._pairs, axis=2)  # (2, 3, 2, m)
        way -= self._judged
        nearer = way[:, :POSE_YAW, 1] - way[:, :POSE_YAW, 0]
        np.absolute(nearer, nearer)
        turn = way[:, POSE_YAW]
        np.absolute(turn, turn)
        turn *= self._swing
        turn += nearer
        return not is_any(turn[:, 0] + turn[:, 1] >= self._gap)

    def _judge(self) -> IntArray:
        """Return the pairs of the list that touch, as ids."""
        if not self._is_measured:
            self._measure()
        elif self._are_still_apart():
            return NO_CONTACTS
        pairs = self._pairs
        poses = self.poses.take(pairs, axis=2)  # (2, 5, 2, m)
        heading = _unit(poses[:, POSE_YAW])
        middle = heading * self._centre
        middle.real += poses[:, POSE_X]
        middle.imag += poses[:, POSE_Y]
        apart = middle[:, 1] - middle[:, 0]
        turn = np.abs(heading[1] - heading[0])
        # Whatever a box passes while it turns is within the box that is larger by the way of its corners.
        room = self._half + (turn * self._swing)[..., None]
        if not is_any(do_boxes_meet(apart[0], apart[1], heading[1], room)):
            self._gap = box_gaps(apart[1], heading[1], self._half) - TOUCHING
            self._judged = poses[1, : POSE_YAW + 1]
            return NO_CONTACTS
        is_hit = do_boxes_meet(apart[0], apart[1], heading[1], self._half)
        stray = turn / self._chord
        if is_any(stray > 1.0):
            turning = (stray > 1.0).any(axis=0).nonzero()[0]
            for num, those in self._pieces_of(turning, stray[:, turning].max(axis=0)):
                is_hit[those] = self._judge_turning(poses.take(those, axis=-1), those, num)
        if not is_any(is_hit):
            return NO_CONTACTS
        pairs, z = pairs[:, is_hit], poses[:, POSE_Z][..., is_hit]
        low, high = z.min(axis=0), z.max(axis=0) + self._world.height[pairs]
        if not self._world.roads.is_flat:
            low, high = self._reach_on_slope(pairs, low, high)
        pairs = pairs[:, (low < high[::-1] - TOUCHING).all(axis=0)]
        return np.ascontiguousarray(self._uid[pairs].T)

    def _pieces_of(self, which: IntArray, stray: FloatArray) -> list[tuple[int, IntArray]]:
        """Return into how many pieces the step of pairs is cut, and which pairs of the list these are.

        Args:
            which: (m,) int64, at least one pair of the list.
            stray: (m,) for each the number of pieces that is fine enough. The number is one for all pairs of a world.
        """
        if self._world_of_row is None:
            return [(min(MAX_SWEEP_PIECES, max(1, MAX_SWEEPS // len(which)), math.ceil(stray.max())), which)]
        world = self._world_of_row[self._pairs[0, which]]
        most = np.zeros(int(world.max()) + 1)
        np.maximum.at(most, world, stray)
        num_pairs = np.maximum(np.bincount(world), 1)
        num = np.minimum(np.minimum(MAX_SWEEP_PIECES, np.maximum(1, MAX_SWEEPS // num_pairs)), np.ceil(most))[world]
        return [(int(each), which[num == each]) for each in distinct(num)]

    def _reach_on_slope(self, pairs: IntArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return least and greatest heights of bodies on sloping ground, whose reference points are between others.

        Args:
            pairs: (2, m) int64, rows.
            low: (2, m) least heights of their reference points [m].
            high: (2, m) greatest heights above these [m].
        """
        world = self._world
        # The lean of a body on its springs is no slope of the ground.
        pitch, roll = world.pitch[pairs] - world.lean_pitch[pairs], world.roll[pairs] - world.lean_roll[pairs]
        nose = -np.sin(pitch) * (world.centre[pairs] + world.half_length[pairs])
        tail = -np.sin(pitch) * (world.centre[pairs] - world.half_length[pairs])
        aside = np.abs(np.sin(roll)) * world.half_width[pairs]
        return low + np.minimum(nose, tail) - aside, high + np.maximum(nose, tail) + aside

    def _judge_turning(self, poses: FloatArray, of: IntArray, num: int) -> BoolArray:
        """Return which pairs of boxes that turn touch, with the step cut into pieces.

        Args:
            poses: (2, 5, 2, m) of the pairs.
            of: (m,) int64, which pairs of the list they are.
        """
        start, end = poses
        part = np.linspace(0.0, 1.0, num + 1)[:, None, None]
        heading = _unit(start[POSE_YAW] + part * wrap_angle(end[POSE_YAW] - start[POSE_YAW]))  # (pieces + 1, 2, m)
        middle = heading * self._centre[:, of]
        middle.real += start[POSE_X] + part * (end[POSE_X] - start[POSE_X])
        middle.imag += start[POSE_Y] + part * (end[POSE_Y] - start[POSE_Y])
        apart = middle[:, 1] - middle[:, 0]
        half = self._half[:, None, of]
        is_hit = do_boxes_meet(apart[:-1], apart[1:], heading[1:].swapaxes(0, 1), half)
        return np.asarray(is_hit.any(axis=0))


def remember(world: WorldRows) -> CollisionDetector:
    """Store the poses as a step begins, and return the detector that `find` wants as it ends."""
    detector = world.derived(CollisionDetector)
    detector.keep()
    return detector


def find(world: WorldRows, detector: CollisionDetector) -> CollisionDetector:
    """Set `world.contacts` to the pairs that have touched since `remember`.

    Args:
        world: written in place.
        detector: what `remember` returned.

    Returns:
        The detector that has found them; it has the poses of this step.
    """
    now = world.derived(CollisionDetector)
    if now is not detector:  # an entity has come, gone or stopped within the step
        now.take_over(detector)
    world.keep_contacts(now.find())
    return now


def keep_poses(world: WorldRows, detector: CollisionDetector) -> None:
    """Keep the poses of this step, although an impact has set entities loose since `find`.

    Args:
        world: the same entities are in its rows.
        detector: what `find` returned.
    """
    now = world.derived(CollisionDetector)
    if now is not detector:
        np.copyto(now.poses, detector.poses)


def find_touched(world: World, uid: int) -> IntArray:
    """Return the rows of all entities that one entity touched in the last step, (k,) int64, in order of their ids.

    Args:
        world: read only.
    """
    pairs = world.contacts
    others = pairs[:, ::-1][pairs == uid]
    return np.array([world.row(int(other)) for other in np.sort(others)], dtype=np.int64)


def find_crashes(world: WorldRows, most: int) -> IntArray:
    """Return the rows of the vehicles (no egos) that touched each other in the last step, in order of ids.

    Args:
        world: read only.
        most: pairs at most; of more, the first ones.

    Returns:
        (k, 2) int64.
    """
    pairs = world.contacts
    if not len(pairs):
        return pairs
    rows = world.alive.nonzero()[0]
    rows = rows[world.uid[rows].argsort()]
    found = rows[world.uid[rows].searchsorted(pairs)]
    return np.asarray(found[(world.kind[found] == int(Kind.VEHICLE)).all(axis=1)][:most])


def pair_codes(pairs: IntArray) -> IntArray:
    """Return one number for each pair of ids (m, 2)."""
    return np.asarray((pairs[:, 0] << 31) | pairs[:, 1])  # ids have 31 bits


def _unit(yaw: FloatArray) -> ComplexArray:
    """Return headings [rad] as complex unit vectors."""
    unit = np.empty(yaw.shape, dtype=np.complex128)
    np.cos(yaw, unit.real)
    np.sin(yaw, unit.imag)
    return unit


def _complex(x: FloatArray, y: FloatArray) -> ComplexArray:
    """Return plane vectors as complex numbers x + iy."""
    vector = np.empty(x.shape, dtype=np.complex128)
    vector.real, vector.imag = x, y
    return vector

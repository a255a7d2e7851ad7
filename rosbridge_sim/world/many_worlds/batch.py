"""A batch: the rows of many small worlds in one set of columns, which one step moves.

A step costs some hundred numpy calls, whatever the number of rows; so the rows of many worlds cost little more than
those of one. A `Batch` is what a step takes for a world. Its rows are those of all its worlds, and it answers for each
row which frame, which chance, which lanes and which lights it has (`WorldRows`). There is one step, and one set of
equations.

*Equal to the bit.* World w of a batch is equal to the same world alone. All figures of a row depend on rows of its own
world alone, and on numpy calls whose result for an element does not depend on the other ones. What looks for entities
looks in one world: lanes are numbered apart (`repeat_roads`), and places are compared within a world. Where alone a
bound holds for all entities of a world (pairs of a heap, a crowd on the lanes), a small world cannot reach it; so
worlds with more than `MAX_ROWS` rows are not taken in.

*Layout.* Row r of the world in slot w is row r * slots + w of the batch: a block has the shape (columns, rows, slots).
So the first rows of all worlds, mostly egos, are neighbours, and each world has a view of its own columns.

*Phases.* Drivers decide on every fifth frame. All worlds of a batch do it at the same step, so their frames are equal
modulo `PHASES`. `WorldSet` puts worlds into the batches that they belong to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, Self, TypeVar, cast

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.contacts.collisions import CollisionDetector
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.many_worlds.many_roads import ManyPaths, ManySignals, repeat_roads
from rosbridge_sim.world.roads.paths import Paths
from rosbridge_sim.world.roads.signals import Signals
from rosbridge_sim.world.state.chance import salt_of_seeds
from rosbridge_sim.world.state.entity_arrays import BOOLS, FLOATS, INTS
from rosbridge_sim.world.state.entity_types import Body, Kind
from rosbridge_sim.world.state.row_motion import NO_ROUTE
from rosbridge_sim.world.state.world import MAX_UID, World
from rosbridge_sim.world.state.world_rows import NO_CONTACTS, WorldRows
from rosbridge_sim.world.step import step

MAX_ROWS: Final = 128
"""A world with more rows steps alone. All pairs of so many are below every bound of a step (2^14 pairs near each other,
2^16 compared), and at so many rows the calls are no longer what costs."""

PHASES: Final = 5
"""Frames from one decision to the next, of drivers, people and the look at the ground."""

T = TypeVar("T")

_WORLD_BITS: Final = 31
"""An id of many worlds has the world above so many bits."""


class OneOfMany(World):
    """A world whose columns may lie in a `Batch`. It does all that a `World` does; only the batch moves it then.

    Attributes:
        batch: where its columns are; None while it has its own.
        slot: which of the batch's worlds it is.
        has_changed: something other than a step has touched it since `WorldSet` looked.
        num_changes: rises when its rows change or move.
    """

    batch: Batch | None = None
    slot = -1
    has_changed = True
    num_changes = 0
    _seen_touches = -1

    @property
    def signals(self) -> Signals:
        """The traffic lights at this frame."""
        if self.batch is not None:
            self._signals.advance(self.frame)
            self.batch.many_signals.forget(self.slot)  # the caller may change them
        return self._signals

    @property
    def lights(self) -> Signals:
        """The traffic lights at this frame; read only."""
        self._signals.advance(self.frame)
        return self._signals

    @property
    def lights_before(self) -> Signals:
        """The traffic lights, perhaps as they were at an earlier frame; read only."""
        return self._signals

    def touch(self) -> None:
        """Drop what was derived from the arrays."""
        super().touch()
        self.has_changed = True
        if self.batch is not None:
            self.batch.touch()

    def start_scoring(self) -> None:
        """Keep the scores of all egos from this frame on."""
        super().start_scoring()
        self.has_changed = True

    def derived(self, make: Callable[[Self], T]) -> T:
        """Return `make(world)`, made once and kept until the next `touch` of this world, or of any in the batch."""
        batch = self.batch
        if batch is not None:
            if make is CollisionDetector:
                return cast("T", batch.detector_of(self.slot))
            if batch.num_touches != self._seen_touches:
                self._derived.clear()
                self._seen_touches = batch.num_touches
        return super().derived(make)

    def move_to(self, batch: Batch | None, slot: int) -> None:
        """Move the columns into a batch, or out of it."""
        old, n = self.batch, self.n
        saved = self._floats[:, :n].copy(), self._ints[:, :n].copy(), self._bools[:, :n].copy()
        names, bodies = self.names, self.bodies
        if old is not None:
            self._signals.advance(self.frame)
            old.leave(self.slot)
        self.batch, self.slot = batch, slot
        if batch is None:
            self._allocate(n)  # its own columns again
        else:
            batch.need_rows(n)
            self.bind_columns()
        self._floats[:, :n], self._ints[:, :n], self._bools[:, :n] = saved
        self.names, self.bodies = names, bodies
        self._bind(n)
        self.touch()

    def bind_columns(self) -> None:
        """Take the view of this world's columns in the batch."""
        assert self.batch is not None
        floats, ints, bools = self.batch.blocks
        self._floats, self._ints, self._bools = floats[:, :, self.slot], ints[:, :, self.slot], bools[:, :, self.slot]
        self._bind(self.n)

    def _allocate(self, n: int) -> None:
        if self.batch is None:
            super()._allocate(n)
            return
        self.batch.need_rows(n)
        self.names, self.bodies = [], []
        self._floats[:], self._ints[:], self._bools[:] = 0.0, 0, False
        self._bind(n)

    def _grow(self, num_rows: int) -> None:
        if self.batch is None:
            super()._grow(num_rows)
        else:
            self.batch.need_rows(max(2 * self.n, num_rows))

    def _bind(self, n: int) -> None:
        super()._bind(n)
        self.num_changes += 1
        if self.batch is not None:
            self.batch.has_new_rows = True


class Batch(WorldRows):
    """The rows of many worlds, as a step takes those of one. Entities come and go through the worlds.

    Between steps the worlds have their frames, contacts and lights, and a batch reads them with `look_at`. Its own
    `frame` is that of all worlds modulo `PHASES`, and `contacts` has the numbers of `ids`.

    Attributes:
        worlds: the worlds by slot; None for a free one.
        world_frames: (slots,) int64, the frame of each world.
        blocks: floats, ints and bools, (columns, rows, slots) each.
        many_signals: `signals`, the lights of all worlds.
        num_touches: rises with every `touch`.
        has_new_rows: the number of rows of a world has changed.

    Args:
        like: a world like all those of the batch, as `world_set` finds them.
    """

    def __init__(self, like: OneOfMany, num: int) -> None:
        super().__init__(
            like.dynamics,
            is_creeping=like.is_creeping,
            has_stability_control=like.has_stability_control,
            has_impacts=like.has_impacts,
            turn_shares=like.turn_shares,
        )
        self.is_scoring, self.friction_share = like.is_scoring, like.friction_share
        self.frame = like.frame % PHASES
        self.map_roads, self.map_plan = like.roads, like.plan
        self.num_touches = 0
        self.has_new_rows = True
        self.worlds: list[OneOfMany | None] = []
        self.world_frames: IntArray = np.zeros(0, dtype=np.int64)
        self.blocks: tuple[FloatArray, IntArray, BoolArray] = _blocks(0, 0)
        self._paths: ManyPaths | None = None
        self._touched: list[int] = []  # slots of the worlds in `contacts`
        self._has_all_contacts = True
        self._lay_out(like.n, num)

    # -- its worlds

    def add(self, world: OneOfMany) -> None:
        """Take a world in; it must be like the others."""
        if None not in self.worlds:
            self._lay_out(self.blocks[0].shape[1], 2 * len(self.worlds))
        slot = self.worlds.index(None)
        self.worlds[slot] = world
        world.move_to(self, slot)
        self.look_at(world)

    def leave(self, slot: int) -> None:
        """Free a slot; its world has copied its columns."""
        self.worlds[slot] = None
        for block in self.blocks:
            block[:, :, slot] = 0
        self._has_all_contacts = False
        self.many_signals.forget(slot)
        self.touch()

    def look_at(self, world: OneOfMany) -> None:
        """Take frame, contacts and lights of a world, which has come or changed."""
        self.world_frames[world.slot] = world.frame
        self._has_all_contacts = False
        self.many_signals.forget(world.slot)

    def need_rows(self, num: int) -> None:
        """Have room for so many rows in each world."""
        if num > self.blocks[0].shape[1]:
            self._lay_out(num, len(self.worlds))

    def _lay_out(self, num_rows: int, num_slots: int) -> None:
        """Take blocks of another size."""
        old, blocks = self.blocks, _blocks(num_rows, num_slots)
        rows, slots = old[0].shape[1:]
        for new, block in zip(blocks, old, strict=True):
            new[:, :rows, :slots] = block
        self.blocks = floats, ints, bools = blocks
        self._floats, self._ints = floats.reshape(len(FLOATS), -1), ints.reshape(len(INTS), -1)
        self._bools = bools.reshape(len(BOOLS), -1)
        if num_slots != len(self.worlds):
            frames = np.full(num_slots, self.frame, dtype=np.int64)
            frames[: len(self.world_frames)] = self.world_frames
            self.world_frames = frames
            self.worlds += [None] * (num_slots - len(self.worlds))
            self.roads = repeat_roads(self.map_roads, num_slots)
            self.many_signals = ManySignals(self.map_plan, num_slots, self._signals_of, frames)
            self._signals = self.many_signals
            self.num_worlds = num_slots
        for world in self.worlds:
            if world is not None:
                world.bind_columns()
        self.has_new_rows = True
        self.touch()

    def _signals_of(self, slot: int) -> Signals | None:
        world = self.worlds[slot]
        return None if world is None else world.lights_before

    # -- a step

    def advance(self, num_frames: int) -> None:
        """Move all worlds by so many frames."""
        self.bind_rows()
        if not self._has_all_contacts:
            self._join_contacts()
        self._number_lanes(1)
        try:
            for _ in range(num_frames):
                step(self)
        finally:
            self._number_lanes(-1)
            for world, frame in zip(self.worlds, self.world_frames.tolist(), strict=True):
                if world is not None:
                    world.frame = frame

    def bind_rows(self) -> None:
        """Have as many rows as its largest world, if that has changed."""
        if self.has_new_rows:
            self.has_new_rows = False
            num_rows = max((world.n for world in self.worlds if world is not None), default=0)
            self._bind(num_rows * len(self.worlds))

    def _number_lanes(self, sign: int) -> None:
        """Turn lanes of the map into lanes of `roads`, or back."""
        assert self.world_of_row is not None
        offset = np.where(self.has_lane, self.world_of_row * (sign * len(self.map_roads)), 0)
        if not np.count_nonzero(self.has_lane):
            return
        for first, last in (("claim", "exit_lane"), ("behind", "ahead_5")):
            lanes = self.int_block(first, last)
            lanes += offset * (lanes >= 0)

    def _bind(self, n: int) -> None:
        super()._bind(n)
        self.world_of_row = np.arange(n) % self.num_worlds

    def count_frame(self) -> None:
        """Count the step that has been made, in all worlds."""
        self.world_frames += 1
        self.frame = (self.frame + 1) % PHASES

    def touch(self) -> None:
        """Drop what was derived from the arrays."""
        super().touch()
        self.num_touches += 1
        self._paths = None

    # -- answers for each row

    def frames(self, rows: IntArray) -> int | IntArray:
        """Return the frame of the world of each row, (k,) int64."""
        return self.world_frames[self._worlds(rows)]

    def salts(self, rows: IntArray) -> npt.NDArray[np.uint64]:
        """Return the `salt_of` the entities in rows, (k,) uint64."""
        seeds = [0 if world is None else world.seed for world in self.worlds]
        return salt_of_seeds(seeds, self._worlds(rows), self.uid[rows])

    def ids(self) -> IntArray:
        """Return numbers that tell all entities of all worlds apart, (n,) int64."""
        assert self.world_of_row is not None
        return self.uid + (self.world_of_row << _WORLD_BITS)

    def routes_of(self, rows: IntArray) -> list[IntArray]:
        """Return the routes of rows, in rows of the lanes of `roads`; an empty list if no entity has one."""
        routes = [{} if world is None else world.routes for world in self.worlds]
        if not any(routes):
            return []
        num = len(self.map_roads)
        found = []
        for world, uid in zip(self._worlds(rows).tolist(), self.uid[rows].tolist(), strict=True):
            route = routes[world].get(uid)
            found.append(NO_ROUTE if route is None else route + world * num)
        return found

    def own_lanes(self, rows: IntArray, lane: IntArray) -> IntArray:
        """Return lanes of the map as lanes of `roads`: of the worlds of rows (k,); -1 stays -1."""
        return np.where(lane >= 0, lane + self._worlds(rows) * len(self.map_roads), lane)

    def own_lights(self, rows: IntArray, light: IntArray) -> IntArray:
        """Return lights of the plan as lights of `signals.shown`: of the worlds of rows (k,); -1 stays -1."""
        return np.where(light >= 0, light + self._worlds(rows) * len(self.map_plan.lights), light)

    def worlds_of(self, rows: IntArray, others: IntArray) -> tuple[IntArray, IntArray] | None:
        """Return the worlds of rows, (k,) int64, and of other rows, (m,) int64."""
        return self._worlds(rows), self._worlds(others)

    def most_of_world(self, values: FloatArray, rows: IntArray, others: IntArray) -> float | FloatArray:
        """Return for each other row, (m,), the greatest of the values (k,) of rows in its world, at least 0."""
        most = np.zeros(self.num_worlds)
        np.maximum.at(most, self._worlds(rows), values)
        return most[self._worlds(others)]

    def path_bases(self, rows: IntArray) -> IntArray:
        """Return for the paths of rows, (k,) int64, what `find_legs` takes."""
        return self.path_base[rows] + self.path_store.first_key[self._worlds(rows)]

    @property
    def path_store(self) -> ManyPaths:
        """The stores of all worlds, one after another."""
        if self._paths is None:
            self._paths = ManyPaths([_NO_PATHS if world is None else world.paths for world in self.worlds])
        return self._paths

    def body_of(self, row: int) -> Body:
        """Return the body of the entity in a row."""
        return self.world_with(row).bodies[row // self.num_worlds]

    def rows(self, kind: Kind) -> IntArray:
        """Return the rows of a kind, (k,) int64, rising; do not write into the array."""
        return self.derived(_rows_by_kind)[kind]

    def world_with(self, row: int) -> World:
        """Return the world that a row belongs to."""
        world = self.worlds[row % self.num_worlds]
        assert world is not None
        return world

    def struck(self) -> Iterator[World]:
        """Yield the worlds in which pairs touch, touched, or were placed since the last step."""
        for world in self.worlds:
            if world is not None and (len(world.contacts) or len(world.passing) or world.placed_uids):
                yield world

    def _worlds(self, rows: IntArray) -> IntArray:
        return rows % self.num_worlds

    # -- contacts

    def keep_contacts(self, pairs: IntArray) -> None:
        """Keep the pairs that touched in this step, and give each world its own."""
        self.contacts = pairs
        for slot in self._touched:
            self.world_with(slot).contacts = NO_CONTACTS
        self._touched = []
        if len(pairs):
            slots, first = np.unique(pairs[:, 0] >> _WORLD_BITS, return_index=True)
            self._touched = slots.tolist()
            for slot, part in zip(self._touched, np.split(pairs & MAX_UID, first[1:]), strict=True):
                self.world_with(slot).contacts = part

    def _join_contacts(self) -> None:
        """Take the contacts of all worlds."""
        of_slots = enumerate(NO_CONTACTS if world is None else world.contacts for world in self.worlds)
        parts = {slot: pairs + (slot << _WORLD_BITS) for slot, pairs in of_slots if len(pairs)}
        self.contacts, self._touched = np.concatenate([NO_CONTACTS, *parts.values()]), list(parts)
        self._has_all_contacts = True

    def detector_of(self, slot: int) -> _Poses:
        """Return the poses of one world as the last step began and as it ended; others may have more rows."""
        world = self.worlds[slot]
        assert world is not None
        return _Poses(self.derived(CollisionDetector).poses[:, :, slot :: self.num_worlds][..., : world.n])


class _Poses:
    """The part of a `CollisionDetector` that others read, of one world."""

    def __init__(self, poses: FloatArray) -> None:
        self.poses = poses


def _rows_by_kind(rows: WorldRows) -> dict[Kind, IntArray]:
    return {kind: (rows.alive & (rows.kind == kind)).nonzero()[0] for kind in Kind}


_NO_PATHS: Final = Paths()


def _blocks(num_rows: int, num_slots: int) -> tuple[FloatArray, IntArray, BoolArray]:
    """Return blocks of zeros, (columns, rows, slots)."""
    return (
        np.zeros((len(FLOATS), num_rows, num_slots)),
        np.zeros((len(INTS), num_rows, num_slots), dtype=np.int64),
        np.zeros((len(BOOLS), num_rows, num_slots), dtype=bool),
    )

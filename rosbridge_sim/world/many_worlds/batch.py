"""A batch: the rows of many small worlds in one set of columns, which one step moves.

A step costs some hundred numpy calls, whatever the number of rows; so the rows of many worlds cost little more than
those of one. A `Batch` is what a step takes for a world. Its rows are those of all its worlds, and it answers for each
row which frame, which chance, which lanes and which lights it has (`RowWorlds`). There is one step, and one set of
equations.

*Equal to the bit.* World w of a batch is equal to the same world alone. All figures of a row depend on rows of its own
world alone, and on numpy calls whose result for an element does not depend on the other ones. What looks for entities
looks in one world: lanes are numbered apart (`ManyRoads`), and places are compared within a world. Where alone a bound
holds for all entities of a world (pairs of a heap, a crowd on the lanes), a small world cannot reach it; so worlds with
more than `MAX_ROWS` rows are not taken in.

*Layout.* Row r of the world in slot w is row r * slots + w of the batch: a block has the shape (columns, rows, slots).
So the first rows of all worlds, mostly egos, are neighbours, and each world has a view of its own columns.

*Phases.* Drivers decide on every fifth frame. All worlds of a batch do it at the same step, so their frames are equal
modulo `PHASES`. `WorldSet` puts worlds into the batches that they belong to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, TypeVar, cast

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.contacts.collisions import CollisionDetector
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.many_worlds.many_roads import ManyPaths, ManyRoads, ManySignals
from rosbridge_sim.world.roads.paths import Paths
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import Signals
from rosbridge_sim.world.state.chance import salt_of_seeds
from rosbridge_sim.world.state.entity_arrays import BOOLS, FLOATS, INTS
from rosbridge_sim.world.state.entity_types import Body, Kind
from rosbridge_sim.world.state.row_worlds import NO_ROUTE
from rosbridge_sim.world.state.world import MAX_UID, NO_CONTACTS, World
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
    _own_frame = 0
    _own_contacts = NO_CONTACTS
    _seen_touches = -1

    @property
    def frame(self) -> int:
        """Steps done since the last reset."""
        return self._own_frame if self.batch is None else int(self.batch.world_frames[self.slot])

    @frame.setter
    def frame(self, value: int) -> None:
        self.has_changed = True
        if self.batch is None:
            self._own_frame = value
        else:
            self.batch.world_frames[self.slot] = value

    @property
    def contacts(self) -> IntArray:
        """Ids of the pairs that touched during the last step, (m, 2) int64."""
        return self._own_contacts if self.batch is None else self.batch.contacts_of(self.slot)

    @contacts.setter
    def contacts(self, pairs: IntArray) -> None:
        if self.batch is None:
            self._own_contacts = pairs
        else:
            self.batch.set_contacts(self.slot, pairs)

    @property
    def signals(self) -> Signals:
        """The traffic lights at this frame."""
        if self.batch is not None:
            self._signals.advance(self.frame)
            self.batch.many_signals.forget(self.slot)  # the caller may change them
        return self._signals

    @signals.setter
    def signals(self, signals: Signals) -> None:
        self._signals = signals
        if self.batch is not None:
            self.batch.many_signals.forget(self.slot)

    @property
    def lights(self) -> Signals:
        """The traffic lights at this frame; read only."""
        self._signals.advance(self.frame)
        return self._signals

    @property
    def lights_before(self) -> Signals:
        """The traffic lights, perhaps as they were at an earlier frame; read only."""
        return self._signals

    @property
    def plan(self) -> SignalPlan:
        """The plan of the lights."""
        return self._signals.plan

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

    def derived(self, make: Callable[[World], T]) -> T:
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
        old = self.batch
        frame, contacts, n = self.frame, self.contacts, self.n
        saved = self._floats[:, :n].copy(), self._ints[:, :n].copy(), self._bools[:, :n].copy()
        names, bodies = self.names, self.bodies
        if old is not None:
            self._signals.advance(frame)
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
        self.frame, self.contacts = frame, contacts
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


class Batch(World):
    """The rows of many worlds, as a step takes a world. Entities come and go through the worlds.

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
        self.names = []
        self.bodies = _Bodies(self)  # type: ignore[assignment]  # read by row alone
        self._derived = {}
        self.placed_uids = set()
        self.seed, self.passing, self.routes = 0, NO_CONTACTS, {}
        self.dynamics, self.is_creeping = like.dynamics, like.is_creeping
        self.has_stability_control, self.has_impacts = like.has_stability_control, like.has_impacts
        self.is_scoring, self.turn_shares = like.is_scoring, like.turn_shares
        self.friction_share = like.friction_share
        self.map_roads, self.map_plan = like.roads, like.signals.plan
        self.num_touches = 0
        self.has_new_rows = True
        self.worlds: list[OneOfMany | None] = []
        self.world_frames: IntArray = np.zeros(0, dtype=np.int64)
        self.blocks: tuple[FloatArray, IntArray, BoolArray] = _blocks(0, 0)
        self._joint: IntArray = NO_CONTACTS
        self._told: dict[int, IntArray] = {}
        self._phase = like.frame % PHASES
        self._paths: ManyPaths | None = None
        self._lay_out(like.n, num)

    # -- its worlds

    def add(self, world: OneOfMany) -> None:
        """Take a world in; it must be like the others."""
        if None not in self.worlds:
            self._lay_out(self.blocks[0].shape[1], 2 * len(self.worlds))
        slot = self.worlds.index(None)
        self.worlds[slot] = world
        self.many_signals.forget(slot)  # a step has seen the slot without lights
        world.move_to(self, slot)

    def leave(self, slot: int) -> None:
        """Free a slot; its world has copied its columns."""
        self.worlds[slot] = None
        for block in self.blocks:
            block[:, :, slot] = 0
        self.set_contacts(slot, NO_CONTACTS)
        self.many_signals.forget(slot)
        self.touch()

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
            frames = np.full(num_slots, self._phase, dtype=np.int64)
            frames[: len(self.world_frames)] = self.world_frames
            self.world_frames = frames
            self.worlds += [None] * (num_slots - len(self.worlds))
            self.roads = ManyRoads(self.map_roads, num_slots)
            self.many_signals = ManySignals(self.map_plan, num_slots, self._signals_of, frames)
            self.signals = self.many_signals
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
        self._number_lanes(1)
        try:
            for _ in range(num_frames):
                step(self)
        finally:
            self._number_lanes(-1)

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
        self.n = n
        for block, columns in ((self._floats, FLOATS), (self._ints, INTS), (self._bools, BOOLS)):
            for i, column in enumerate(columns):
                setattr(self, column, block[i, :n])
        self.world_of_row = np.arange(n) % max(len(self.worlds), 1)

    @property
    def frame(self) -> int:
        """The frame of all worlds, modulo `PHASES`."""
        return self._phase

    @frame.setter
    def frame(self, value: int) -> None:
        self.world_frames += value - self._phase
        self._phase = value % PHASES

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
        most = np.zeros(len(self.worlds))
        np.maximum.at(most, self._worlds(rows), values)
        return most[self._worlds(others)]

    @property
    def paths(self) -> Paths:  # type: ignore[override]
        """The paths of all worlds; read only."""
        if self._paths is None:
            self._paths = ManyPaths([_NO_PATHS if world is None else world.paths for world in self.worlds])
        return self._paths

    def path_bases(self, rows: IntArray) -> IntArray:
        """Return the bases of the paths of rows in `paths`, (k,) int64."""
        paths = self.paths
        assert isinstance(paths, ManyPaths)
        return self.path_base[rows] + paths.first_key[self._worlds(rows)]

    def rows(self, kind: Kind) -> IntArray:
        """Return the rows of a kind, (k,) int64, rising; do not write into the array."""
        return self.derived(_rows_by_kind)[kind]

    def world_with(self, row: int) -> World:
        """Return the world that a row belongs to."""
        world = self.worlds[row % len(self.worlds)]
        assert world is not None
        return world

    def struck(self) -> Iterator[World]:
        """Yield the worlds in which pairs touch, touched, or were placed since the last step."""
        touched = set((self.contacts[:, 0] >> _WORLD_BITS).tolist())
        for slot, world in enumerate(self.worlds):
            if world is not None and (slot in touched or len(world.passing) or world.placed_uids):
                yield world

    def _worlds(self, rows: IntArray) -> IntArray:
        return rows % len(self.worlds)

    # -- contacts

    @property
    def contacts(self) -> IntArray:
        """The pairs that touched during the last step, (m, 2) int64, by the numbers of `ids`, in rising order."""
        if self._told:
            world = self._joint[:, 0] >> _WORLD_BITS
            parts = [self._joint[~np.isin(world, list(self._told))]]
            parts += [pairs + (slot << _WORLD_BITS) for slot, pairs in self._told.items()]
            joint = np.concatenate(parts)
            self._joint = joint[np.lexsort((joint[:, 1], joint[:, 0]))]
            self._told = {}
        return self._joint

    @contacts.setter
    def contacts(self, pairs: IntArray) -> None:
        self._joint, self._told = pairs, {}

    def contacts_of(self, slot: int) -> IntArray:
        """Return the contacts of one world, by its own ids."""
        if slot in self._told:
            return self._told[slot]
        joint = self._joint
        if not len(joint):
            return NO_CONTACTS
        return np.asarray(joint[joint[:, 0] >> _WORLD_BITS == slot] & MAX_UID)

    def set_contacts(self, slot: int, pairs: IntArray) -> None:
        """Replace the contacts of one world."""
        if len(pairs) or len(self._joint):
            self._told[slot] = pairs

    def detector_of(self, slot: int) -> _Poses:
        """Return the poses of one world as the last step began and as it ended; others may have more rows."""
        world = self.worlds[slot]
        assert world is not None
        return _Poses(self.derived(CollisionDetector).poses[:, :, slot :: len(self.worlds)][..., : world.n])


class _Poses:
    """The part of a `CollisionDetector` that others read, of one world."""

    __slots__ = ("poses",)

    def __init__(self, poses: FloatArray) -> None:
        self.poses = poses


class _Bodies:
    """The bodies of a batch, by row."""

    __slots__ = ("_batch",)

    def __init__(self, batch: Batch) -> None:
        self._batch = batch

    def __getitem__(self, row: int) -> Body:
        return self._batch.world_with(row).bodies[row // len(self._batch.worlds)]


def _rows_by_kind(world: World) -> dict[Kind, IntArray]:
    return {kind: (world.alive & (world.kind == kind)).nonzero()[0] for kind in Kind}


_NO_PATHS: Final = Paths()


def _blocks(num_rows: int, num_slots: int) -> tuple[FloatArray, IntArray, BoolArray]:
    """Return blocks of zeros, (columns, rows, slots)."""
    return (
        np.zeros((len(FLOATS), num_rows, num_slots)),
        np.zeros((len(INTS), num_rows, num_slots), dtype=np.int64),
        np.zeros((len(BOOLS), num_rows, num_slots), dtype=bool),
    )

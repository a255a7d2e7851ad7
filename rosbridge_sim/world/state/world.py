"""The state of the world, one row for each entity in a struct of arrays: spawn, remove, snapshot, restore, digest.

`World` holds all state. Other modules move it: `dynamics` (driven rows), `path_following` (rows on paths and in
constant motion), `waiting` (rows that start when an ego comes), `lane_following` (rows on lanes), and `step`, which
calls them in a fixed order.

All numbers are SI and radians in the map frame (ENU metres, yaw counter-clockwise from east). The reference point of a
vehicle is the middle of its rear axle on the ground, that of a pedestrian or an obstacle its centre on the ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple
from hashlib import blake2b
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.paths import Paths, lay_segments
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import Signals
from rosbridge_sim.world.roads.turn_shares import TurnShares
from rosbridge_sim.world.state import labels
from rosbridge_sim.world.state.chance import salt_of
from rosbridge_sim.world.state.control_columns import fill_body_columns, update_control_columns
from rosbridge_sim.world.state.entity_arrays import (
    BOOLS,
    INTS,
    KINEMATIC_ALL,
    KINEMATIC_CORE,
    LANE_CHANGE_CODES,
    LANE_CHANGE_COLUMNS,
    NUM_CORE,
)
from rosbridge_sim.world.state.entity_rows import MAX_UID, EntityRows
from rosbridge_sim.world.state.entity_types import (
    MAX_COORDINATE,
    MAX_SPEED,
    NO_BODY,
    ROAD_FRICTION,
    Body,
    Dynamics,
    Gear,
    Kind,
    Mode,
)
from rosbridge_sim.world.state.settling import keep_level, settle
from rosbridge_sim.world.state.snapshot import Snapshot
from rosbridge_sim.world.state.world_rows import NO_CONTACTS

__all__ = [
    "DT",
    "MAX_COORDINATE",
    "MAX_SPEED",
    "MAX_UID",
    "NO_CONTACTS",
    "STEP_NS",
    "Body",
    "BoolArray",
    "Dynamics",
    "Gear",
    "Kind",
    "Mode",
    "Snapshot",
    "World",
]

DT: Final = 0.02
"""Length of a step [s]: MORAI's own, 50 frames a second."""


def in_frames(seconds: float) -> int:
    """Return a time as a number of steps."""
    return round(seconds / DT)


STEP_NS: Final = 20_000_000
"""Length of a step [ns]."""

FIRST_UID: Final = 1
"""The first id that is given out; 0 is left to the first ego, whose id is fixed."""

NO_ROADS: Final = Roads()
NO_PLAN: Final = SignalPlan(NO_ROADS)


_YIELDS: Final = INTS.index("yields")
_LANE_CHANGE_CODES: Final = [INTS.index(name) for name in LANE_CHANGE_CODES]
_KEEPS_LANE: Final = BOOLS.index("keeps_lane")
_KEPT: Final = (
    *("frame", "seed", "is_scoring", "friction_share", "dynamics", "is_creeping", "has_stability_control"),
    *("has_impacts", "turn_shares"),
)
"""Attributes that a snapshot has as they are."""


class World(EntityRows):
    """All entities, one row each in `EntityArrays`, which `spawn`, `remove`, `clear`, `reset` and `restore` replace.

    An entity stays in its row as long as it exists; afterwards another one may get the row. Every attribute may be
    read. Write through `spawn`, `remove` and the functions of `commands`, `placement` and `lane_position`, because some
    columns follow from others.

    Attributes:
        seed: of all chance in the world; see `chance`.
        passing: (m, 2) int64, ids of the pairs in `contacts` that go through each other, the lower first; without
            `has_impacts` it is empty.

    Args:
        seed: not negative.
        dynamics, is_creeping, has_stability_control, has_impacts, turn_shares: see `WorldRows`.
    """

    seed: int
    passing: IntArray
    _signals: Signals

    def __init__(
        self,
        seed: int = 0,
        dynamics: Dynamics = Dynamics.KINEMATIC,
        *,
        is_creeping: bool = False,
        has_stability_control: bool = True,
        has_impacts: bool = False,
        turn_shares: TurnShares | None = None,
    ) -> None:
        super().__init__(
            dynamics,
            is_creeping=is_creeping,
            has_stability_control=has_stability_control,
            has_impacts=has_impacts,
            turn_shares=turn_shares,
        )
        self.roads, self._signals = NO_ROADS, Signals(NO_PLAN)
        self.paths, self.placed_uids = Paths(), set()
        self.reset(seed)

    # -- the population

    @property
    def signals(self) -> Signals:
        """The traffic lights at this frame."""
        return self._signals

    def spawn(
        self,
        kind: Kind,
        body: Body,
        *,
        name: str,
        x: float,
        y: float,
        z: float | None = None,
        yaw: float = 0.0,
        speed: float = 0.0,
        uid: int | None = None,
        path: FloatArray | None = None,
        is_loop: bool = False,
        gear: Gear = Gear.DRIVE,
        roll: float = 0.0,
        pitch: float = 0.0,
        start_within: float = 0.0,
        yields: bool = False,
    ) -> int:
        """Add an entity to the world and return its id.

        An EGO waits for commands (pedals mode, no pedal pressed). Any other kind moves with `speed` along its heading
        for ever. With a path it moves along that: it starts at the point of the path nearest to (x, y), its heading
        follows the path (see `paths`), and at the end it stops or, with `is_loop`, begins again.

        Args:
            x: reference point, east [m].
            y: reference point, north [m].
            z: reference point, up [m]. On a map with hills the entity is put onto the ground, and this chooses between
                a bridge and the road below it. None for the lowest road there, or 0 on a flat map.
            yaw: heading; any angle is wrapped [rad].
            speed: along the heading; not negative with a path [m/s].
            uid: its id, 0..2^31-1; None for the next free one.
            path: (m, 2) or (m, 3) waypoints, m >= 2 [m]; with two columns they are at height z.
            is_loop: a last segment to the first point closes the path.
            gear: of an EGO.
            roll: kept until the entity is placed elsewhere, or moves on a map with hills [rad].
            pitch: kept likewise, positive with the nose down [rad].
            start_within: the entity stands until an EGO is this near, then it starts with `speed` [m]; 0 for at once.
                Not for an EGO.
            yields: it stops for what is ahead on its path, `speed` is the speed that it wants, and a PEDESTRIAN crosses
                roads by light or gap. Without a path it makes no difference.

        Raises:
            ValueError: a number is not finite or out of bounds, the id is in use, the path has no length, an EGO has a
                path or no wheelbase, or there is no such kind or gear. The world is as it was.
        """
        height, z = z, z or 0.0
        labels.check_pose(x=x, y=y, z=z, yaw=yaw, speed=speed, roll=roll, pitch=pitch, start_within=start_within)
        kind, gear = Kind(kind), Gear(gear)
        if start_within < 0.0 or (kind == Kind.EGO and start_within > 0.0):
            raise ValueError(f"start_within: expected at least 0 m, and 0 for an ego, got {start_within!r}")
        if kind == Kind.EGO and (path is not None or min(body.wheelbase, body.max_accel, body.max_decel) <= 0.0):
            raise ValueError(f"{name}: an ego has wheelbase, engine and brakes, and no path of its own")
        uid, next_uid = self._choose_uid(uid)
        segments = None
        if path is not None:
            if speed < 0.0:
                raise ValueError(f"speed: expected >= 0 on a path, got {speed!r}")
            segments = lay_segments(labels.in_space(path, z), is_loop=is_loop, reach=labels.reach_of(kind, body))
            base = self.paths.add(uid, segments)

        # Nothing below can fail.
        row = self._take_row()
        self._rows[uid], self._next_uid = row, next_uid
        self.names[row], self.bodies[row] = name, body
        self.alive[row], self.uid[row], self.kind[row] = True, uid, kind
        self.label[row] = labels.label_of(name, body)
        self.gear[row], self.mode[row] = gear, Mode.PEDALS
        for column, value in zip(labels.BOX_COLUMNS, labels.box_of(body), strict=True):
            getattr(self, column)[row] = value
        is_waiting = start_within > 0.0 and speed != 0.0
        self.place(row, x=x, y=y, z=z, yaw=yaw, speed=0.0 if is_waiting else speed)
        self.tilt(row, roll=roll, pitch=pitch)
        if is_waiting:
            self.start_within[row], self.start_speed[row] = start_within, speed
        if kind == Kind.EGO:
            self._equip(row, body)
        if segments is not None:
            self._join_path(row, base, segments, is_loop=is_loop)
            self.yields[row], self.desired_speed[row] = yields, speed * yields
        if not self.roads.is_flat:
            settle(self, self.roads, np.array([row]), None if height is None and segments is None else self.z[[row]])
        self.touch()
        return uid

    def spawn_all(
        self, kind: Kind, names: Sequence[str], bodies: Sequence[Body], uids: Sequence[int], *, speed: FloatArray | None
    ) -> IntArray:
        """Add many entities at the origin at once, as `spawn` does one by one; return their rows, (m,) int64.

        They are meant to be placed elsewhere at once.

        Args:
            kind: of all of them; not EGO.
            names: (m) any texts.
            bodies: (m) their sizes.
            uids: their ids, 0..2^31-1, none twice.
            speed: (m,) along the heading, which is east [m/s]; None for entities that `place_all` places next.

        Raises:
            ValueError: an id is in use or out of range, or a speed is out of bounds. The world is as it was.
        """
        if kind == Kind.EGO:
            raise ValueError("expected entities that are no egos")
        if speed is not None and len(speed) and not np.abs(speed).max() <= MAX_SPEED:
            raise ValueError(f"speed: expected numbers within +-{MAX_SPEED:g}")
        unique = set(uids)
        if len(unique) < len(uids):
            raise ValueError("uids: expected none twice")
        if uids and not 0 <= min(uids) <= max(uids) <= MAX_UID:
            raise ValueError(f"uids: expected 0..{MAX_UID}, got {min(uids)}..{max(uids)}")
        if not unique.isdisjoint(self._rows):
            raise ValueError("uids: one is in use")
        num = len(uids)
        with self.room_for(num):
            rows = np.flatnonzero(~self.alive)[:num]
            for row, uid, name, body in zip(rows.tolist(), uids, names, bodies, strict=True):
                self._rows[uid], self.names[row], self.bodies[row] = row, name, body
            self._next_uid = max(self._next_uid, max(uids, default=-1) + 1)
            self.alive[rows], self.uid[rows], self.kind[rows] = True, uids, kind
            self.label[rows], boxes = labels.labels_and_boxes(names, bodies)
            self.gear[rows], self.mode[rows] = Gear.DRIVE, Mode.PEDALS
            for column, values in zip(labels.BOX_COLUMNS, boxes, strict=True):
                getattr(self, column)[rows] = values
            if speed is not None:
                zero = np.zeros(num)
                self.place_all(rows, x=zero, y=zero, z=zero, yaw=zero, speed=speed)
                if not self.roads.is_flat:
                    settle(self, self.roads, rows, zero)
        return rows

    def follow_path(self, row: int, path: FloatArray, *, is_loop: bool) -> None:
        """Have an entity leave its path or lane and follow another path, from the point of it nearest to the entity on.

        Speed and ghost mark stay as they are.

        Args:
            row: row of an entity that is no EGO, with a speed that is not negative.
            path: see `spawn`.
            is_loop: see `spawn`.

        Raises:
            ValueError: the path has no length or is too long, or this row can follow none. Nothing has changed.
        """
        speed = float(self.speed[row])
        if self.kind[row] == int(Kind.EGO) or not self.alive[row] or speed < 0.0:
            raise ValueError(f"path: expected an entity that is no ego and has a speed >= 0, got speed {speed!r}")
        x, y, z, yaw = (float(getattr(self, name)[row]) for name in ("x", "y", "z", "yaw"))
        is_ghost = self.is_ghost.item(row)
        reach = labels.reach_of(Kind(self.kind.item(row)), self.bodies[row])
        segments = lay_segments(labels.in_space(path, z), is_loop=is_loop, reach=reach)
        self.paths.check_room(segments)
        self.place(row, x=x, y=y, z=z, yaw=yaw, speed=speed)
        self._join_path(row, self.paths.add(int(self.uid[row]), segments), segments, is_loop=is_loop)
        if not self.roads.is_flat and not is_ghost:
            settle(self, self.roads, np.array([row]), self.z[[row]])
        self.touch()

    def remove(self, uid: int) -> None:
        """Remove an entity; its row is free for another one.

        Raises:
            KeyError: no entity has this id.
        """
        row = self._rows.pop(uid)
        self._leave_path_or_lane(row)
        self._floats[:, row] = 0.0
        self._ints[:, row] = 0
        self._bools[:, row] = False
        self.names[row], self.bodies[row] = "", NO_BODY
        if len(self.contacts):
            self.contacts = self.contacts[(self.contacts != uid).all(axis=1)]
            self.passing = self.passing[(self.passing != uid).all(axis=1)]
        self.placed_uids.discard(uid)
        if row == self.n - 1:
            self._trim()
        self.touch()

    def clear(self) -> None:
        """Remove all entities. Roads, lights, frame, random generator and the count of ids stay."""
        self._rows = {}
        self.routes = {}
        self.contacts = self.passing = NO_CONTACTS
        self.placed_uids.clear()
        self.paths.clear()
        self._allocate(0)
        self.touch()

    def reset(self, seed: int | None = None) -> None:
        """Become a new, empty world at frame 0 on the same roads. Ids and the cycles of the lights begin again.

        Args:
            seed: not negative; None for the same seed as before.

        Raises:
            ValueError: the seed is negative. The world is as it was.
        """
        seed = self.seed if seed is None else seed
        if seed < 0:
            raise ValueError(f"seed: expected non-negative, got {seed}")
        self.clear()
        self.seed = seed
        self.frame = 0
        self.is_scoring = False
        self._signals = Signals(self.plan)
        self._next_uid = FIRST_UID

    def lay_roads(self, roads: Roads, plan: SignalPlan | None = None) -> None:
        """Replace the roads. The lights begin their cycles now; lane followers stop where they are.

        Entities are put onto the new ground, if it is not flat.

        Args:
            plan: their traffic lights; None for none.

        Raises:
            ValueError: the plan was made for other roads. The world is as it was.
        """
        plan = plan or SignalPlan(roads)
        if len(plan.light_of_lane) != len(roads):
            raise ValueError(f"the plan is for {len(plan.light_of_lane)} lanes, the roads have {len(roads)}")
        for row in np.flatnonzero(self.has_lane).tolist():  # rare: the map changes while vehicles drive on it
            self.place(row, x=self.x[row], y=self.y[row], z=self.z[row], yaw=self.yaw[row], speed=0.0)
        was_flat = self.roads.is_flat
        self.roads, self._signals = roads, Signals(plan, self.frame)
        self.int_block("near_lane", "open_reds")[:] = 0  # rows of the former lanes
        self.touch()
        if not roads.is_flat:
            rows = np.flatnonzero(self.alive & ~self.is_ghost)
            settle(self, roads, rows, self.z[rows])
        elif not was_flat:
            keep_level(self)

    def set_friction_share(self, share: float) -> None:
        """Make the ground as slippery as in rain, or dry again; for SINGLE_TRACK only.

        Args:
            share: friction of the ground, relative to a dry one; `MIN_FRICTION_SHARE` to 1.
        """
        if share != self.friction_share:
            self.friction_share = share
            self.friction[self.rows(Kind.EGO)] = ROAD_FRICTION * share  # until the next look at the ground
            self.touch()

    def start_scoring(self) -> None:
        """Keep the scores of all egos from this frame on, until the next `reset`; twice is no error. See `score`."""
        if not self.is_scoring:
            self.is_scoring = True
            self.reset_scores()

    def reset_scores(self) -> None:
        """Begin the scores of all egos anew at this frame; nothing while none are kept."""
        if self.is_scoring:
            for row in self.rows(Kind.EGO).tolist():
                self._begin_score(row)

    # -- snapshots

    def snapshot(self) -> Snapshot:
        """Return a copy of everything that decides what the world will do."""
        return Snapshot(
            next_uid=self._next_uid,
            uids=tuple(self._rows.items()),
            names=tuple(self.names),
            bodies=tuple(self.bodies),
            floats=self._floats[:, : self.n].copy(),
            ints=self._ints[:, : self.n].copy(),
            bools=self._bools[:, : self.n].copy(),
            paths=self.paths.snapshot(),
            contacts=self.contacts.copy(),
            roads=self.roads,
            signals=self.signals.snapshot(),
            routes=dict(self.routes),
            passing=self.passing.copy(),
            placed_uids=tuple(sorted(self.placed_uids)),
            **{name: getattr(self, name) for name in _KEPT},
        )

    def restore(self, saved: Snapshot) -> None:
        """Become what the snapshot holds: the same calls from here on give the same bits."""
        self.clear()
        n = len(saved.names)
        self._allocate(n)
        self._floats[:, :n], self._ints[:, :n], self._bools[:, :n] = saved.floats, saved.ints, saved.bools
        self.names, self.bodies = list(saved.names), list(saved.bodies)
        self._rows = dict(saved.uids)
        self.paths.restore(saved.paths)
        self.contacts = saved.contacts.copy()
        self.roads, self._signals = saved.roads, Signals.restored(saved.signals)
        self.routes = dict(saved.routes)
        self._next_uid, self.passing, self.placed_uids = saved.next_uid, saved.passing.copy(), set(saved.placed_uids)
        for name in _KEPT:
            setattr(self, name, getattr(saved, name))
        self.touch()

    def __reduce__(self) -> tuple[Callable[[Snapshot], Self], tuple[Snapshot]]:
        """Return the arguments for a copy or a pickle that goes on as this world does, to the bit."""
        return self._restored, (self.snapshot(),)

    def __deepcopy__(self, _memo: object) -> Self:
        """Return such a copy; the roads, which nothing changes, are shared."""
        return self._restored(self.snapshot())

    @classmethod
    def _restored(cls, saved: Snapshot) -> Self:
        world = cls()
        world.restore(saved)
        return world

    def model_figures(self) -> bytes:
        """Return the figures of bodies and models that `digest` leaves out, as older ones did; no scores."""
        columns = self._floats[: NUM_CORE[0], : self.n].tobytes() if self.dynamics == Dynamics.KINEMATIC else b""
        return columns + labels.figures_of_all(self.bodies)

    def restore_driven(self, uid: int, saved: Snapshot) -> None:
        """Restore one EGO from a snapshot; the rest of the world stays as it is.

        Args:
            uid: id of an EGO that is in the world and in the snapshot.
        """
        row, before = self._rows[uid], dict(saved.uids)[uid]
        self._floats[:, row], self._ints[:, row] = saved.floats[:, before], saved.ints[:, before]
        self._bools[:, row] = saved.bools[:, before]
        self.touch()

    def digest(self, *, has_scores: bool = True) -> str:
        """Return a hash of the whole state, 32 hexadecimal digits: equal worlds have equal digests.

        Args:
            has_scores: with the scores of the egos while they are kept; they move nothing.
        """
        state = blake2b(digest_size=16)
        counts = (self.frame, self.seed, self._next_uid, self.n)
        state.update(repr((counts, list(self._rows.items()))).encode())
        has_scores = has_scores and self.is_scoring
        num_floats, num_ints, num_bools = (None, None, None) if has_scores else NUM_CORE
        if self.has_impacts:
            state.update(b"impacts" + repr(sorted(self.placed_uids)).encode() + self.passing.tobytes())
        if self.friction_share != 1.0:
            state.update(b"friction share" + repr(self.friction_share).encode())
        if self.turn_shares is not None:
            state.update(b"turn shares" + np.array(astuple(self.turn_shares), dtype=np.float64).tobytes())
        changes = self.block(LANE_CHANGE_COLUMNS[0], LANE_CHANGE_COLUMNS[-1])
        codes = self.int_block(LANE_CHANGE_CODES[0], LANE_CHANGE_CODES[-1])
        has_changes = bool(changes.any() or codes.any() or self.keeps_lane.any())
        if self.dynamics == Dynamics.KINEMATIC and not self.has_impacts:
            state.update(self._floats[KINEMATIC_ALL if has_scores else KINEMATIC_CORE, : self.n].tobytes())
            if has_changes:
                state.update(b"lane changes" + changes.tobytes())
        else:
            state.update(self.dynamics.name.lower().replace("_", "-").encode())
            state.update(self._floats[:num_floats, : self.n].tobytes())
        ints, bools = self._ints[:num_ints, : self.n], self._bools[:num_bools, : self.n]
        # Older digests do not have these columns.
        left_out = ([] if self.yields.any() else [_YIELDS]) + ([] if has_changes else _LANE_CHANGE_CODES)
        state.update((np.delete(ints, left_out, axis=0) if left_out else ints).tobytes())
        state.update((bools if has_changes else np.delete(bools, _KEEPS_LANE, axis=0)).tobytes())
        state.update(self.contacts.tobytes())
        state.update(self.paths.digest())
        state.update(self.roads.digest)
        state.update(self.signals.digest())
        for uid, route in self.routes.items():
            state.update(uid.to_bytes(4) + route.tobytes())
        return state.hexdigest()

    # -- answers to a step

    def struck(self) -> Iterator[World]:
        """Yield the worlds in which pairs touch, touched, or were placed since the last step: perhaps this one."""
        yield self

    def world_with(self, _row: int) -> World:
        """Return the world that a row belongs to."""
        return self

    def salts(self, rows: IntArray) -> npt.NDArray[np.uint64]:
        """Return the `salt_of` the entities in rows, (k,) uint64."""
        return salt_of(self.seed, self.uid[rows])

    # -- internals

    def _begin_score(self, row: int) -> None:
        """Begin the score of an ego anew at this frame."""
        for block, num_core in zip((self._floats, self._ints, self._bools), NUM_CORE, strict=True):
            block[num_core:, row] = 0
        self.score_since[row] = self.frame
        self.time_to_collision[row] = self.min_time_to_collision[row] = math.inf

    def _equip(self, row: int, body: Body) -> None:
        """Write what a new EGO has of its own: the limits of its body, its controls, and its score."""
        fill_body_columns(self, row, body)
        self.friction[row] = ROAD_FRICTION * self.friction_share
        update_control_columns(self, row, is_creeping=self.is_creeping)
        if self.is_scoring:
            self._begin_score(row)

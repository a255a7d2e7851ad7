"""Lanes, lights and paths of many worlds, which a step reads as those of one.

The lanes of a map are there once for each world: row w * l + i is lane i in world w, of l lanes.

Points, lines and all that is searched by place are those of the map, shared. What is kept for each lane is repeated, so
that drivers of different worlds never have a lane in common. The lines are not shifted: that would change rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any, Final, TypeVar, cast

import numpy as np

from rosbridge_sim.world.drivers import lane_entries, lane_swing, lane_wander
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.geometry.segment_cells import SegmentCells
from rosbridge_sim.world.roads.lane_change_map import LaneNeighbours
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts, Links
from rosbridge_sim.world.roads.lane_joins import Joins
from rosbridge_sim.world.roads.paths import Paths
from rosbridge_sim.world.roads.roads import LanePlaces, Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import NEVER_FRAME, ShownLights, Signals, look_at
from rosbridge_sim.world.roads.turn_shares import TurnKinds

T = TypeVar("T")

MAX_POINTS: Final = 1 << 10
"""Places that are looked for at once: far below the bound at which a search leaves some out."""

_BY_LANE: Final[set[Callable[..., Any]]] = {lane_swing.are_tight, lane_wander.room_of}
"""Functions of roads that return an array (l,) of figures: these are repeated."""


def most_worlds(roads: Roads) -> int:
    """Return for how many worlds the lanes of a map can be repeated: sorting keys are whole numbers of 63 bits."""
    return int(lane_entries.MAX_SCALE_TICKS // lane_entries.scale_ticks(roads)) - 1


class ManyRoads(Roads):
    """Roads whose lanes stand once for each world.

    `nearest`, `within` and `find_segments` return lanes of the map; `left`, `right`, `is_stop` and the successors are
    those of the map, too.

    Attributes:
        num: number of worlds.

    Args:
        num: see above.
    """

    __slots__ = ("num",)

    def __init__(self, roads: Roads, num: int) -> None:
        self.num, self.alone = num, roads
        for name in Roads.__slots__:
            if name not in {"alone", "_derived"}:
                setattr(self, name, getattr(roads, name))
        self._derived = {}
        self._search = roads.derived(_cells_of)
        self.scale_of_lane = np.arange(num).repeat(len(roads))
        for name in ("length", "width", "speed_limit", "turn", "base", "last_leg", "legs_per_metre"):
            setattr(self, name, np.tile(getattr(roads, name), num))
        self.first = np.append(np.tile(roads.first[:-1], num), len(roads.points))

    def __len__(self) -> int:
        return self.num * len(self.alone)

    def in_map(self, lane: IntArray) -> IntArray:
        """Return rows of lanes as rows of the map's lanes; -1 stays -1."""
        return np.where(lane >= 0, lane % len(self.alone), -1)

    def successors(self, lane: int) -> IntArray:
        """Return the lanes that begin where a lane ends, in its world."""
        world, row = divmod(lane, len(self.alone))
        return self.alone.successors(row) + world * len(self.alone)

    def locate(self, lane: IntArray, s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return between which points given places lie; see `Roads.locate`."""
        return self.alone.locate(lane % len(self.alone), s)

    def within(self, x: FloatArray, y: FloatArray, radius: FloatArray) -> tuple[IntArray, LanePlaces]:
        """Return all lanes of the map near each point; see `Roads.within`."""
        parts = [slice(start, start + MAX_POINTS) for start in range(0, max(len(x), 1), MAX_POINTS)]
        found = [super(ManyRoads, self).within(x[part], y[part], radius[part]) for part in parts]
        if len(found) == 1:
            return found[0]
        owners = [part.start + owner for part, (owner, _) in zip(parts, found, strict=True)]
        columns = ([getattr(places, name) for _, places in found] for name in LanePlaces.__struct_fields__)
        return np.concatenate(owners), LanePlaces(*map(np.concatenate, columns))

    def derived(self, make: Callable[[Roads], T]) -> T:
        """Return `make(roads)` of the map, with what it has for each lane repeated."""
        value: T | None = self._derived.get(make)
        if value is None:
            value = self._derived[make] = self._make(make)
        return value

    def _make(self, make: Callable[[Roads], T]) -> T:
        value: Any = self.alone.derived(make)
        many: Any = value  # of points, or of places on the map
        if isinstance(value, LaneConflicts):
            many = _repeat_conflicts(value, self)
        elif isinstance(value, LaneNeighbours):
            many = _repeat_neighbours(value, self)
        elif isinstance(value, TurnKinds):
            many = TurnKinds(self.alone, self.num)
        elif make in _BY_LANE:
            many = np.tile(value, self.num)
        return cast("T", many)


def _cells_of(roads: Roads) -> SegmentCells | None:
    return SegmentCells(roads.segments, len(roads)) if len(roads) else None


def _lanes(lanes: IntArray, roads: ManyRoads) -> IntArray:
    """Return rows of lanes (..., k) once for each world, (..., num k); -1 stays -1."""
    offset = (np.arange(roads.num) * len(roads.alone)).repeat(lanes.shape[-1])
    tiled = np.tile(lanes, roads.num)
    return np.where(tiled >= 0, tiled + offset, tiled)


def _links(links: Links, roads: ManyRoads) -> Links:
    count = np.tile(np.diff(links.first), roads.num)
    first = np.append(0, np.cumsum(count))
    return Links(first, _lanes(links.other, roads), np.tile(links.figure, roads.num))


def _repeat_conflicts(one: LaneConflicts, roads: ManyRoads) -> LaneConflicts:
    many = copy(one)
    many.roads = roads
    for name in ("wait_point", "clear_point", "shared", "gives_way", "rival_from", "rival_passes", "rival_right"):
        setattr(many, name, np.tile(getattr(one, name), roads.num))
    for name in ("onward", "rivals", "siblings"):
        setattr(many, name, _links(getattr(one, name), roads))
    num = len(one.rival_back)
    many.rival_back = np.tile(one.rival_back, roads.num) + (np.arange(roads.num) * num).repeat(num)
    joins, num = one.joins, len(one.joins.shared)
    join = np.tile(joins.join, roads.num)
    assert roads.scale_of_lane is not None
    many.joins = Joins(
        join=np.where(join >= 0, join + roads.scale_of_lane * num, -1),
        side=np.tile(joins.side, roads.num),
        to_join=np.tile(joins.to_join, roads.num),
        shared=np.tile(joins.shared, roads.num),
        lanes=np.tile(joins.lanes, (roads.num, 1)) + (np.arange(roads.num) * len(roads.alone)).repeat(num)[:, None],
        narrow_from=np.tile(joins.narrow_from, roads.num),
        num_in_map=num,
    )
    return many


def _repeat_neighbours(one: LaneNeighbours, roads: ManyRoads) -> LaneNeighbours:
    many = copy(one)
    many.roads = roads
    many.beside = _lanes(one.beside, roads)
    many.group = _lanes(one.group, roads)
    for name in ("may", "has_side", "merge_side", "place", "keeps_right"):
        setattr(many, name, np.tile(getattr(one, name), roads.num))
    many.before = _links(one.before, roads)
    return many


class ManyPaths(Paths):
    """The stores of some worlds, one after another; read only.

    Attributes:
        first_key: (w,) int64, what is added to the bases of each world.

    Args:
        stores: of the worlds.
    """

    __slots__ = ("first_key",)

    def __init__(self, stores: Sequence[Paths]) -> None:
        super().__init__()
        lengths = np.array([store.next_base for store in stores], dtype=np.int64)
        self.first_key: IntArray = np.cumsum(lengths) - lengths
        used = [(store, key) for store, key in zip(stores, self.first_key.tolist(), strict=True) if store.num]
        if used:
            self.keys = np.concatenate([store.keys + key for store, key in used])
            self.segments = np.concatenate([store.segments for store, _ in used])
        self.num = len(self.keys)


class ManySignals(ShownLights):
    """The lights of all worlds of a batch.

    `shown` and `may_enter` have those of one world after another, as `ManyRoads` has its lanes. Of the plan, only
    `light_of_lane` is repeated.

    Args:
        plan: of the map.
        num: number of worlds.
        signals_of: returns the lights of a world, None for a world that is not there.
        frames: (num,) int64, the frame of each world; the owner moves it on.
    """

    __slots__ = ("_frames", "_map_plan", "_next", "_num_lanes", "_num_lights", "_signals_of", "_stale")

    def __init__(
        self, plan: SignalPlan, num: int, signals_of: Callable[[int], Signals | None], frames: IntArray
    ) -> None:
        self._signals_of, self._frames = signals_of, frames
        self._num_lanes, self._num_lights = len(plan.light_of_lane), len(plan.lights)
        self._map_plan, self.plan = plan, copy(plan)
        self.plan.light_of_lane = np.tile(plan.light_of_lane, num)
        self.may_enter = np.ones(num * self._num_lanes, dtype=bool)
        self.shown = np.zeros(num * self._num_lights, dtype=np.int64)
        self._next: IntArray = np.zeros(num, dtype=np.int64)
        self._stale = set(range(num))

    def forget(self, world: int) -> None:
        """Read the lights of a world anew before the next step."""
        self._stale.add(world)

    def advance(self, _frame: int) -> None:
        """Move all lights on to the next frames of their worlds."""
        for world in self._stale:
            self._next[world] = 0
        self._stale.clear()
        frames = self._frames + 1
        due = (frames >= self._next).nonzero()[0]
        if not len(due):
            return
        self._next[due] = NEVER_FRAME
        found = [(world, signals.timing) for world in due.tolist() if (signals := self._signals_of(world)) is not None]
        if not found:
            return
        worlds = np.array([world for world, _ in found])
        timing = (np.stack(column) for column in zip(*(each for _, each in found), strict=True))
        now = look_at(self._map_plan, frames[worlds, None], *timing)
        self.may_enter.reshape(len(frames), self._num_lanes)[worlds] = now.may_enter
        self.shown.reshape(len(frames), self._num_lights)[worlds] = now.shown
        self._next[worlds] = now.next_change

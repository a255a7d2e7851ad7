"""Lanes, lights and paths of many worlds, which a step reads as those of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any, Final

import numpy as np

from rosbridge_sim.world.drivers import lane_entries, lane_swing, lane_wander
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.geometry.segment_cells import SegmentCells
from rosbridge_sim.world.roads.lane_change_map import LaneNeighbours
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts, Links
from rosbridge_sim.world.roads.lane_joins import Joins
from rosbridge_sim.world.roads.paths import Paths
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import NEVER_FRAME, ShownLights, Signals, look_at
from rosbridge_sim.world.roads.turn_shares import TurnKinds

_BY_LANE: Final[set[Callable[..., Any]]] = {lane_swing.are_tight, lane_wander.room_of}
"""Functions of roads that return an array (l,) of figures: these are repeated."""


def most_worlds(roads: Roads) -> int:
    """Return for how many worlds the lanes of a map can be repeated: sorting keys are whole numbers of 63 bits."""
    return int(lane_entries.MAX_SCALE_TICKS // lane_entries.scale_ticks(roads)) - 1


def repeat_roads(roads: Roads, num: int) -> Roads:
    """Return the lanes of a map once for each of some worlds; see `Roads.copies`."""
    return roads.copies(num, roads.derived(_cells_of), _repeat)


def _repeat(roads: Roads, make: Callable[[Roads], Any], value: Any) -> Any:  # noqa: ANN401 - of any function of roads
    """Return `make` of copies of a map's lanes, of that of the map."""
    if isinstance(value, LaneConflicts):
        return _repeat_conflicts(value, roads)
    if isinstance(value, LaneNeighbours):
        return _repeat_neighbours(value, roads)
    if isinstance(value, TurnKinds):
        return TurnKinds(roads.alone, roads.num_copies)
    if make in _BY_LANE:
        return np.tile(value, roads.num_copies)
    return value  # of points, or of places on the map


def _cells_of(roads: Roads) -> SegmentCells | None:
    return SegmentCells(roads.segments, len(roads)) if len(roads) else None


def _lanes(lanes: IntArray, roads: Roads) -> IntArray:
    """Return rows of lanes (..., k) once for each world, (..., num k); -1 stays -1."""
    tiled = np.tile(lanes, roads.num_copies)
    return np.where(tiled >= 0, tiled + _offsets(roads, lanes.shape[-1]), tiled)


def _offsets(roads: Roads, num: int) -> IntArray:
    """Return what is added to some rows of lanes, for each world."""
    return (np.arange(roads.num_copies) * len(roads.alone)).repeat(num)


def _links(links: Links, roads: Roads) -> Links:
    count = np.tile(np.diff(links.first), roads.num_copies)
    first = np.append(0, np.cumsum(count))
    return Links(first, _lanes(links.other, roads), np.tile(links.figure, roads.num_copies))


def _repeat_conflicts(one: LaneConflicts, roads: Roads) -> LaneConflicts:
    many = copy(one)
    many.roads = roads
    for name in ("wait_point", "clear_point", "shared", "gives_way", "rival_from", "rival_passes", "rival_right"):
        setattr(many, name, np.tile(getattr(one, name), roads.num_copies))
    for name in ("onward", "rivals", "siblings"):
        setattr(many, name, _links(getattr(one, name), roads))
    num = len(one.rival_back)
    many.rival_back = np.tile(one.rival_back, roads.num_copies) + (np.arange(roads.num_copies) * num).repeat(num)
    joins, num = one.joins, len(one.joins.shared)
    join = np.tile(joins.join, roads.num_copies)
    assert roads.scale_of_lane is not None
    many.joins = Joins(
        join=np.where(join >= 0, join + roads.scale_of_lane * num, -1),
        side=np.tile(joins.side, roads.num_copies),
        to_join=np.tile(joins.to_join, roads.num_copies),
        shared=np.tile(joins.shared, roads.num_copies),
        lanes=np.tile(joins.lanes, (roads.num_copies, 1)) + _offsets(roads, num)[:, None],
        narrow_from=np.tile(joins.narrow_from, roads.num_copies),
        num_in_map=num,
    )
    return many


def _repeat_neighbours(one: LaneNeighbours, roads: Roads) -> LaneNeighbours:
    many = copy(one)
    many.roads = roads
    many.beside = _lanes(one.beside, roads)
    many.group = _lanes(one.group, roads)
    for name in ("may", "has_side", "merge_side", "place", "keeps_right"):
        setattr(many, name, np.tile(getattr(one, name), roads.num_copies))
    many.before = _links(one.before, roads)
    return many


class ManyPaths(Paths):
    """The stores of some worlds, one after another; read only.

    Attributes:
        first_key: (w,) int64, what is added to the bases of each world.

    Args:
        stores: of the worlds.
    """

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

    `shown` and `may_enter` have those of one world after another, as `repeat_roads` has the lanes. Of the plan, only
    `light_of_lane` is repeated.

    Args:
        plan: of the map.
        num: number of worlds.
        signals_of: returns the lights of a world, None for a world that is not there.
        frames: (num,) int64, the frame of each world; the owner moves it on.
    """

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

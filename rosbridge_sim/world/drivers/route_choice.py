"""The choice of the lanes that an entity will drive on: by its route, or by chance.

Chance is a function of the world's seed, the entity's id and the number of choices that it has made. It draws nothing
from the world's random generator, so a new entity does not change the choices of the others.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.lane_change_map import LaneNeighbours
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.turn_shares import ONE, TurnKinds
from rosbridge_sim.world.state.chance import mix
from rosbridge_sim.world.state.row_motion import NO_ROUTE
from rosbridge_sim.world.state.world_rows import WorldRows

NUM_AHEAD: Final = 5
"""Lanes that are chosen in advance. They are the columns `ahead_1` to `ahead_5` of the world."""


class RouteChoice:
    """The routes and the chance of some rows.

    The argument `which` of the methods holds indices into these rows, (k,) int64.

    Args:
        world: `plan` and `change` write into it.
        rows: (n,) int64, rows that keep to the lanes.
    """

    def __init__(self, world: WorldRows, rows: IntArray) -> None:
        self.world, self.rows = world, rows
        self.onward = world.roads.derived(LaneConflicts).onward
        self.neighbours = world.roads.derived(LaneNeighbours)
        routes = world.routes_of(rows)
        self.length = np.array([len(route) for route in routes] or [0] * len(rows), dtype=np.int64)
        self.first = np.cumsum(self.length) - self.length
        self.route = np.concatenate(routes) if routes else NO_ROUTE
        self.is_loop = world.is_loop[rows].copy()
        self.salt = world.salts(rows)
        self.bounds = None if world.turn_shares is None else world.roads.derived(TurnKinds).bounds(world.turn_shares)

    def plan(self, which: IntArray) -> None:
        """Choose all lanes ahead of some rows, and write them into the world."""
        world, rows = self.world, self.rows[which]
        lanes = world.int_block("lane", f"ahead_{NUM_AHEAD}")
        for i in range(1, len(lanes)):
            lanes[i, rows] = self.choose(which, lanes[i - 1, rows], world.turns[rows] + i)

    def change(self, which: IntArray) -> None:
        """Choose other lanes ahead for those rows that have no route; the rest stay as they are."""
        which = which[self.length[which] == 0]
        self.world.turns[self.rows[which]] += NUM_AHEAD + 1
        self.plan(which)

    def choose(self, which: IntArray, lane: IntArray, turn: IntArray) -> IntArray:
        """Return the lane that follows another one.

        Args:
            which: see the class.
            lane: (k,) int64, the lane before; -1 beyond a dead end.
            turn: (k,) int64, the number of this choice, which is also the index into the route.

        Returns:
            (k,) int64, rows of lanes; -1 where the lane before is a dead end.
        """
        onward = self.onward
        count = np.where(lane >= 0, onward.first[lane + 1] - onward.first[lane], 0)
        bits = mix(self.salt[which] + turn.astype(np.uint64))
        chosen = np.full(len(which), -1, dtype=np.int64)
        has_successor = count > 0
        if self.bounds is None:
            dice = bits % np.maximum(count, 1).astype(np.uint64)
            successor = onward.first[lane[has_successor]] + dice[has_successor].astype(np.int64)
        else:
            dice = bits % np.uint64(ONE)
            place = lane[has_successor] * ONE + dice[has_successor].astype(np.int64)
            successor = np.searchsorted(self.bounds, place, side="right")
        chosen[has_successor] = onward.other[successor]
        if not len(self.route):
            return chosen
        length = self.length[which]
        index = np.where(self.is_loop[which], turn % np.maximum(length, 1), turn)
        is_on_route = (index < length) & (lane >= 0)
        if np.count_nonzero(is_on_route):
            first = self.first[which[is_on_route]]
            wanted = self.route[first + index[is_on_route]]
            if self.neighbours.is_any:
                before = self.route[first + (index - 1)[is_on_route] % length[is_on_route]]
                wanted = self._beside_route(lane[is_on_route], before, wanted)
            chosen[is_on_route] = wanted
        return chosen

    def find_wanted(self, which: IntArray, turn: IntArray) -> IntArray:
        """Return the lane of the route at a turn, (k,) int64; -1 beyond its end or without a route.

        Args:
            which: see the class.
            turn: (k,) int64, as in `choose`.
        """
        length = self.length[which]
        index = np.where(self.is_loop[which], turn % np.maximum(length, 1), turn)
        wanted = np.full(len(which), -1, dtype=np.int64)
        has_one = index < length
        wanted[has_one] = self.route[self.first[which[has_one]] + index[has_one]]
        return wanted

    def preview(self, which: IntArray, lane: IntArray) -> IntArray:
        """Return the lanes that rows would have ahead of them on other lanes, (6, k) int64, as `plan` chooses them.

        Args:
            which: see the class.
            lane: (k,) int64, the other lanes.
        """
        turns = self.world.turns[self.rows[which]]
        lanes = [lane]
        for i in range(1, NUM_AHEAD + 1):
            lanes.append(self.choose(which, lanes[-1], turns + i))
        return np.stack(lanes)

    def _beside_route(self, lane: IntArray, before: IntArray, wanted: IntArray) -> IntArray:
        """Return the lanes that follow for rows that may be on a lane beside their route.

        Args:
            lane: (k,) int64, where the row is, no dead end.
            before: (k,) int64, lane of the route beside it.
            wanted: (k,) int64, next lane of the route; written.

        Returns:
            (k,) int64: of a row on its route the next lane. Of any other one the successor from which the route can be
            reached by the fewest lane changes; -1 if there is none.
        """
        is_beside = lane != before
        if not np.count_nonzero(is_beside):
            return wanted
        neighbours, roads = self.neighbours, self.world.roads
        for i in is_beside.nonzero()[0].tolist():  # few: those who overtake
            following = roads.successors(int(lane[i]))
            following = following[neighbours.group[following] == neighbours.group[wanted[i]]]
            apart = np.abs(neighbours.place[following] - neighbours.place[wanted[i]])
            wanted[i] = following[apart.argmin()] if len(following) else -1
        return wanted

"""The choice of the lanes that an entity will drive on: by its route, or by chance.

Chance is a function of the world's seed, the entity's id and the number of choices that it has made. It draws nothing
from the world's random generator, so a new entity does not change the choices of the others.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.chance import mix, salt_of
from rosbridge_sim.world.geometry import IntArray
from rosbridge_sim.world.lane_conflicts import LaneConflicts
from rosbridge_sim.world.state import World

__all__ = ["NUM_AHEAD", "RouteChoice"]

NUM_AHEAD: Final = 5
"""Lanes that are chosen in advance. They are the columns `ahead_1` to `ahead_5` of the world."""

_NO_ROUTE: Final[IntArray] = np.empty(0, dtype=np.int64)


class RouteChoice:
    """The routes and the chance of some rows.

    The argument `which` of the methods holds indices into these rows, (k,) int64.

    Args:
        world: `plan` and `change` write into it.
        rows: (n,) int64, rows that keep to the lanes.
    """

    def __init__(self, world: World, rows: IntArray) -> None:
        self.world, self.rows = world, rows
        self.onward = world.roads.derived(LaneConflicts).onward
        routes = [world.routes.get(uid, _NO_ROUTE) for uid in world.uid[rows].tolist()] if world.routes else []
        self.length = np.array([len(route) for route in routes] or [0] * len(rows), dtype=np.int64)
        self.first = np.cumsum(self.length) - self.length
        self.route = np.concatenate(routes) if routes else _NO_ROUTE
        self.is_loop = world.is_loop[rows].copy()
        self.salt = salt_of(world.seed, world.uid[rows])

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
        dice = mix(self.salt[which] + turn.astype(np.uint64)) % np.maximum(count, 1).astype(np.uint64)
        chosen = np.full(len(which), -1, dtype=np.int64)
        has_successor = count > 0
        successor = onward.first[lane[has_successor]] + dice[has_successor].astype(np.int64)
        chosen[has_successor] = onward.other[successor]
        length = self.length[which]
        index = np.where(self.is_loop[which] & (length > 0), turn % np.maximum(length, 1), turn)
        is_on_route = index < length
        if is_on_route.any():
            chosen[is_on_route] = self.route[self.first[which[is_on_route]] + index[is_on_route]]
        return chosen

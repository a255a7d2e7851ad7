"""Entities that stand until an ego comes near, such as pedestrians that step onto the road.

A waiting row has speed 0, and the columns `start_within` [m] and `start_speed` [m/s]. It starts in the first step at
whose beginning the reference point of any EGO is at most `start_within` away from its own, in the plane. From then on
it has its speed, and it does not stop when the ego leaves. A vehicle on a lane drives from then on as all drivers do,
also if that speed is 0. The columns are part of the state, so snapshot, restore and digest hold them. A row that is
placed elsewhere stops waiting.
"""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.geometry.world_pairs import pair_in_worlds
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.state.world_rows import WorldRows


def start(world: WorldRows) -> None:
    """Start the waiting rows that an EGO is near enough to.

    Args:
        world: written in place.
    """
    waiting = world.derived(_Waiting)
    if len(waiting.rows) and len(waiting.egos):
        waiting.start()


class _Waiting:
    """The rows that wait, and the egos that they wait for.

    It lives until the next `World.touch`: until an entity comes or goes, stops or is placed.
    """

    def __init__(self, world: WorldRows) -> None:
        self._world = world
        self.rows: IntArray = (world.start_within > 0.0).nonzero()[0]
        self.egos = world.rows(Kind.EGO)

    def start(self) -> None:
        """Start the rows that an EGO is near enough to."""
        world, rows, egos = self._world, self.rows, self.egos
        worlds = world.worlds_of(rows, egos)
        if worlds is None:
            away_x = world.x[rows][:, None] - world.x[egos]
            away_y = world.y[rows][:, None] - world.y[egos]
            nearest = (away_x * away_x + away_y * away_y).min(axis=1)
        else:
            one, ego = pair_in_worlds(*worlds)
            away_x, away_y = world.x[rows[one]] - world.x[egos[ego]], world.y[rows[one]] - world.y[egos[ego]]
            nearest = np.full(len(rows), np.inf)
            np.minimum.at(nearest, one, away_x * away_x + away_y * away_y)
        within = world.start_within[rows]
        starting = rows[nearest <= within * within]
        if len(starting):
            world.speed[starting] = world.start_speed[starting]
            world.start_within[starting] = world.start_speed[starting] = 0.0
            world.touch()

"""Begin and goal of episodes: a lane by chance, what is near it taken away, a free bay."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.environments.driving_task import CLEAR, DrivingTask
from rosbridge_sim.world.state.world import Kind, World
from rosbridge_sim.worlds.lanes_behind import find_lanes_behind
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

MAX_TRIES: Final = 100
"""Places that are tried for an ego."""

FREE: Final = 2.5
"""A bay is free if the middle of nothing is this near to that of the bay [m]."""


class Starts:
    """Chooses where episodes begin, and what they lead to.

    Attributes:
        goals: (num_worlds, num_egos, 3) float64, see `observe`.
        goal_lanes: (num_worlds, num_egos, num_lanes) bool, lanes on which an ego has arrived; (..., 0) without such a
            goal.

    Raises:
        ValueError: the map has no such lane.
    """

    def __init__(self, worlds: SteppedWorlds, task: DrivingTask) -> None:
        self._worlds, self._task = worlds, task
        self._lanes = self._find("start_lane", task.start_lane)
        self._ends = self._find("goal_lane", task.goal_lane)
        self.goals = np.full((*worlds.has_ego.shape, 3), np.nan)
        num = len(self._map.roads.alone) if task.goal == "lane" else 0
        self.goal_lanes = np.zeros((*worlds.has_ego.shape, num), dtype=bool)

    @property
    def _map(self) -> World:
        """The first world, for its roads; looked up each time, because a copy of the environment has other worlds."""
        return self._worlds.world(0)

    def begin(self, number: int, rng: np.random.Generator) -> None:
        """Begin an episode of one world, which was reset.

        Raises:
            ValueError: its egos do not fit on the lanes, or there are too few free bays.
        """
        task, world = self._task, self._worlds.world(number)
        lanes = np.full(self.goals.shape[1], -1)
        if len(self._lanes):
            taken: list[tuple[float, float]] = []
            for ego in range(self._worlds.has_ego[number].sum()):
                lanes[ego] = self._start(number, ego, taken, rng)
            self._clear(number, world, taken)
        if task.goal == "lane":
            if not len(self._lanes):
                rows = world.rows(Kind.EGO)
                found = self._map.roads.alone.nearest(world.x[rows], world.y[rows], world.yaw[rows], world.z[rows])
                lanes[: len(rows)] = found.lane
            for ego, lane in enumerate(lanes.tolist()):
                self.goal_lanes[number, ego] = find_lanes_behind(world, lane, self._ends)
        elif task.goal == "bay":
            for uid in world.uid[world.alive & world.has_lane & (world.kind == Kind.VEHICLE)].tolist():
                self._worlds.remove(number, uid)  # a driver that waits behind an ego would stand where it backs
            self.goals[number] = self._choose_bays(world, rng)

    def _start(self, number: int, ego: int, taken: list[tuple[float, float]], rng: np.random.Generator) -> int:
        """Place an ego on a lane by chance, not near the places that are taken; return the lane."""
        task = self._task
        for _ in range(MAX_TRIES):
            lane = int(self._lanes[rng.integers(len(self._lanes))]) if len(self._lanes) > 1 else int(self._lanes[0])
            length = float(self._map.roads.alone.length[lane])
            s = rng.uniform(0.0, length) if task.start_s is None else task.start_s
            places, yaws = self._map.roads.alone.at([lane], [s + length if s < 0.0 else s])
            x, y, z = places[0].tolist()
            if all(np.hypot(x - east, y - north) >= CLEAR for east, north in taken):
                taken.append((x, y))
                self._worlds.place(number, x=x, y=y, z=z, yaw=float(yaws[0]), speed=task.start_speed, ego=ego)
                return lane
        raise ValueError(f"start_lane: no place {CLEAR:g} m from the other egos was found for ego {ego}")

    def _clear(self, number: int, world: World, places: list[tuple[float, float]]) -> None:
        """Take away what is near the places at which egos begin."""
        is_near = np.zeros(len(world.x), dtype=bool)
        for x, y in places:
            is_near |= np.hypot(world.x - x, world.y - y) < CLEAR
        for uid in world.uid[is_near & world.alive & (world.kind != Kind.EGO)].tolist():
            self._worlds.remove(number, uid)

    def _find(self, option: str, pattern: str) -> npt.NDArray[np.int64]:
        """Return the rows of the lanes that a name or a pattern has."""
        if not pattern:
            return np.zeros(0, dtype=np.int64)
        rows = [row for row, name in enumerate(self._map.roads.alone.ids) if fnmatchcase(name, pattern)]
        if not rows:
            where = f"the map of {self._task.scenario!r}"
            raise ValueError(f"{option}: expected a lane of {where}, or a pattern of lanes, got {pattern!r}")
        return np.array(rows, dtype=np.int64)

    def _choose_bays(self, world: World, rng: np.random.Generator) -> npt.NDArray[np.float64]:
        """Return east and north of the middle of a free bay for each ego, and the heading in it, (num_egos, 3).

        Raises:
            ValueError: there are too few free bays.
        """
        places, yaws = self._map.roads.alone.at(self._ends, 0.5 * self._map.roads.alone.length[self._ends])
        middles = world.x + world.centre * np.cos(world.yaw), world.y + world.centre * np.sin(world.yaw)
        away = np.hypot(middles[0] - places[:, :1], middles[1] - places[:, 1:2])
        free = (away + np.where(world.alive, 0.0, np.inf)).min(axis=1, initial=np.inf) > FREE
        bays, num = free.nonzero()[0], self.goals.shape[1]
        if len(bays) < num:
            raise ValueError(f"goal_lane: expected {num} free bays, got {len(bays)}")
        chosen = rng.choice(bays, num, replace=False)
        return np.column_stack([places[chosen, :2], yaws[chosen] + np.pi])

"""The lights of many worlds: each world has its own `Signals`, and a step reads them all as one."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import NEVER_FRAME, Signals, look_at


class ManySignals(Signals):
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

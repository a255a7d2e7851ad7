"""The lights of many worlds: each world has its own `Signals`, and a step reads them all as one."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import Signals

__all__ = ["ManySignals"]


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

    __slots__ = ("_frames", "_next", "_num_lanes", "_num_lights", "_signals_of", "_stale")

    def __init__(
        self, plan: SignalPlan, num: int, signals_of: Callable[[int], Signals | None], frames: IntArray
    ) -> None:
        self._signals_of, self._frames = signals_of, frames
        self._num_lanes, self._num_lights = len(plan.light_of_lane), len(plan.lights)
        self.plan = copy(plan)
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
        for world in (frames >= self._next).nonzero()[0].tolist():
            self._take(world, int(frames[world]))

    def _take(self, world: int, frame: int) -> None:
        signals = self._signals_of(world)
        if signals is None:
            self._next[world] = np.iinfo(np.int64).max
            return
        signals.advance(frame)
        self.may_enter[world * self._num_lanes : (world + 1) * self._num_lanes] = signals.may_enter
        self.shown[world * self._num_lights : (world + 1) * self._num_lights] = signals.shown
        self._next[world] = signals.next_change

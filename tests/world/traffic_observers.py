"""Observers of traffic: runs of red lights, and waiting times."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.signal_plan import Lamp
from rosbridge_sim.world.state.world import DT, World

__all__ = ["RedRuns", "Waits"]


class RedRuns:
    """Counts how often a bumper of those who keep to lanes comes over a stop line at red.

    What is yellow is for those who cannot stop. Nobody may come or go meanwhile.

    Attributes:
        num: of red runs.
        num_passed: of stop lines passed with a light that somebody runs.
    """

    def __init__(self, world: World, rows: IntArray | None = None) -> None:
        """Watch these rows, or all that keep to lanes now."""
        self._world = world
        self._rows = np.flatnonzero(world.has_lane) if rows is None else rows
        self._nose = world.half_length[self._rows] + world.centre[self._rows]
        self.num = self.num_passed = 0
        self._remember()

    def _remember(self) -> None:
        world, rows = self._world, self._rows
        self._lane, self._following = world.lane[rows].copy(), world.ahead_1[rows].copy()
        self._rest = world.roads.length[world.lane[rows]] - world.arc[rows] - self._nose

    def watch(self) -> None:
        """Look once, after each frame."""
        world, rows, plan = self._world, self._rows, self._world.signals.plan
        lane, following, before = self._lane, self._following, self._rest
        self._remember()
        crosses = (before >= 0.0) & (self._rest < 0.0) & (lane == world.lane[rows]) & (following >= 0)
        if not plan.lights:
            return
        entered = world.ahead_1[rows[crosses]]
        light = plan.light_of_lane[entered]
        shown = world.signals.shown[light]
        is_lit = (light >= 0) & (shown > 0) & ~plan.is_warning[light]
        self.num_passed += int(np.count_nonzero(is_lit))
        self.num += int(np.count_nonzero(is_lit & (shown & Lamp.RED != 0) & (shown & plan.pass_of_lane[entered] == 0)))


class Waits:
    """How long those who keep to lanes stand, and how far they come.

    Attributes:
        longest: (drivers,) the longest that each stood without a break [s].
        distance: (drivers,) driven [m].
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._rows = np.flatnonzero(world.has_lane)
        self._still = np.zeros(len(self._rows))
        self.longest = np.zeros(len(self._rows))
        self.distance = np.zeros(len(self._rows))

    def watch(self) -> None:
        """Look once, after each frame."""
        speed = self._world.speed[self._rows]
        self._still = np.where(speed > 0.1, 0.0, self._still + DT)
        self.longest = np.maximum(self.longest, self._still)
        self.distance += speed * DT

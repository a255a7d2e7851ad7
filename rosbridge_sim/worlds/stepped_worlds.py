"""Worlds that a program moves step by step, wherever they are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy.typing as npt

from rosbridge_sim.simulator.scene.load import FoundMap
from rosbridge_sim.worlds.drivable_worlds import Commands, DrivableWorlds


class SteppedWorlds(DrivableWorlds, ABC):
    """Worlds that are commanded, moved and reset; see `Worlds`, which has them all in this process."""

    @abstractmethod
    def step(self, commands: Commands | None = None, n: int = 1) -> None:
        """Command the egos and move all worlds by n frames."""

    @abstractmethod
    def reset(self, mask: npt.ArrayLike | None = None, seeds: Sequence[int | None] | None = None) -> None:
        """Begin the scenario of some worlds again, at frame 0."""

    @abstractmethod
    def map_of(self, number: int) -> FoundMap:
        """Return the map of one world, with its name."""

    @abstractmethod
    def remove(self, world: int, uid: int) -> None:
        """Remove an object from one world."""

    @abstractmethod
    def place(
        self, world: int, *, x: float, y: float, z: float = 0.0, yaw: float, speed: float = 0.0, ego: int = 0
    ) -> None:
        """Place an ego of one world somewhere else."""

"""Observations of drivers in Python: motion of the ego, its lane, and the entities around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rosbridge_sim.expressions import Value
from rosbridge_sim.worlds.drivable_worlds import DrivableWorlds

Array = npt.NDArray[np.float64]


class Observation:
    """The first ego of one world, in numbers; or those of n worlds, in arrays of (n,).

    All numbers are SI and radians.

    Attributes:
        time: simulated time [s].
        seed: of the simulation; for n worlds a list.
        parameters: of the run, by name; for n worlds a list of such.
    """

    def __init__(self, worlds: DrivableWorlds, parameters: Sequence[Mapping[str, Value]], *, is_single: bool) -> None:
        self._worlds, self._is_single = worlds, is_single
        self.time = float(worlds.frames[0]) * worlds.dt
        self.seed: Any = worlds.seeds[0] if is_single else worlds.seeds
        self.parameters: Any = parameters[0] if is_single else parameters

    @cached_property
    def ego(self) -> dict[str, Any]:
        """Return state and controls: x, y, z [m], roll, pitch, yaw [rad], speed and lateral_speed [m/s], accel and
        lateral_accel [m/s^2], yaw_rate [rad/s], steer [rad], throttle and brake 0..1; a float each, or (n,).
        """  # noqa: D205 - one sentence
        return {name: self._one(values) for name, values in self._worlds.egos().items()}

    def lane(self, ahead: Sequence[float] = ()) -> dict[str, Any]:
        """Return where the ego is on its lane, and where the lane leads.

        Args:
            ahead: distances along the lane of the places that are wanted [m].

        Returns:
            offset [m] and heading [rad], left positive; to_left, to_right [m], speed_limit [m/s], is_on_road, s, lane:
            a float each, or (n,); points: (len(ahead), 2), or (n, len(ahead), 2), forward and left [m].
        """
        return {name: self._one(values) for name, values in self._worlds.lanes(ahead).items()}

    def others(self, num: int = 8) -> Array:
        """Return the nearest entities, the nearest first.

        Args:
            num: of them, at least 1.

        Returns:
            (num, 9), or (n, num, 9): 1 where there is one, else all are 0; x, y forward and left [m]; vx, vy relative
            [m/s]; cosine and sine of its heading; length and width [m].
        """
        values: Array = self._worlds.others(num)[:, 0]
        return values[0] if self._is_single else values

    def _one(self, values: Array) -> Any:  # noqa: ANN401 - a number or an array
        first = values[:, 0]
        if not self._is_single:
            return first
        return float(first[0]) if first.ndim == 1 else first[0]

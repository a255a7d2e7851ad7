"""Actions: for each name the space, and how an action becomes a command of `Worlds.step`.

`Continuous`    two numbers within -1..1: steering, left positive, times `MAX_STEER`; acceleration times `MAX_ACCEL`
`Pedals`        steering as before; the second number is the throttle where it is positive, the brake where negative
`DiscreteMeta`  0 change to the lane on the left, 1 go on, 2 to the lane on the right, 3 faster, 4 slower: the ego
                drives itself, as other vehicles do, and `target_speeds` has its speeds
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box, Discrete, Space

from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.environments.judgement import Index
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray
from rosbridge_sim.world.state.world import Gear
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

MAX_STEER: Final = 0.5
"""Angle of the front wheels at the action 1 [rad]."""

MAX_ACCEL: Final = 4.0
"""Acceleration at the action 1 [m/s^2]."""

META_ACTIONS: Final = ("LANE_LEFT", "IDLE", "LANE_RIGHT", "FASTER", "SLOWER")
"""Names of the actions of `DiscreteMeta`, as in highway-env."""

STANDSTILL: Final = 0.05
"""A slower ego may change gear [m/s]."""


class ActionKind:
    """A kind of action, and the way from actions to commands of the egos at `at`.

    Attributes:
        space: of one action.

    Args:
        at: which egos, see `Index`.
    """

    space: Space[Any] = Box(-1.0, 1.0, (2,), np.float32)

    def __init__(self, worlds: SteppedWorlds, task: DrivingTask, at: Index) -> None:
        self._worlds, self._task, self._at, self._shape = worlds, task, at, worlds.has_ego.shape

    def begin(self, mask: BoolArray) -> None:
        """Begin the episodes of some worlds, (num_worlds,) bool."""

    def check(self, actions: npt.ArrayLike, num: int) -> FloatArray:
        """Return actions as (num, 2) numbers within -1..1: sideways, left positive, and forward.

        Raises:
            ValueError: they have another shape, or are not finite.
        """
        chosen = np.asarray(actions, dtype=np.float64)
        if chosen.shape != (num, 2):
            raise ValueError(f"actions: expected shape ({num}, 2), got {chosen.shape}")
        if np.count_nonzero(np.isfinite(chosen)) < chosen.size:
            raise ValueError("actions: expected finite numbers")
        return np.minimum(np.maximum(chosen, -1.0), 1.0)

    def command(self, chosen: FloatArray) -> dict[str, FloatArray] | None:
        """Return what `Worlds.step` takes, for actions from `check`."""
        accel = MAX_ACCEL * chosen[:, 1]
        commands = {"steering": self._every(MAX_STEER * chosen[:, 0])}
        if self._task.reverses:
            egos = self._worlds.egos(("gear", "speed"))
            is_back = egos["gear"][self._at] == Gear.REVERSE
            wants_back = np.where(np.abs(egos["speed"][self._at]) < STANDSTILL, chosen[:, 1] < 0.0, is_back)
            commands["gear"] = self._every(np.where(wants_back, Gear.REVERSE, Gear.DRIVE), Gear.DRIVE)
            accel = np.where(wants_back, -accel, accel)
        return {**commands, "accel": self._every(accel)}

    def _every(self, values: FloatArray, rest: float = 0.0) -> FloatArray:
        """Return values of all egos, (num_worlds, num_egos)."""
        if values.size == math.prod(self._shape):
            return values.reshape(self._shape)
        found = np.full(self._shape, rest)
        found[self._at] = values
        return found


class _Pedals(ActionKind):
    """Steering and one number for both pedals."""

    def command(self, chosen: FloatArray) -> dict[str, FloatArray] | None:
        """Return what `Worlds.step` takes."""
        throttle, brake = np.maximum(chosen[:, 1], 0.0), np.maximum(-chosen[:, 1], 0.0)
        steering = self._every(MAX_STEER * chosen[:, 0])
        return {"steering": steering, "throttle": self._every(throttle), "brake": self._every(brake)}


class _DiscreteMeta(ActionKind):
    """Lanes and speeds, driven by our own drivers."""

    space = Discrete(len(META_ACTIONS))

    def __init__(self, worlds: SteppedWorlds, task: DrivingTask, at: Index) -> None:
        super().__init__(worlds, task, at)
        self._speeds = np.array(task.speeds)
        self._level = np.zeros(self._shape, dtype=np.int64)

    def begin(self, mask: BoolArray) -> None:
        """Begin with the speed that is nearest to the start's."""
        speed = self._worlds.egos(("speed",))["speed"]
        nearest = np.abs(self._speeds - speed[..., None]).argmin(axis=-1)
        self._level[mask] = nearest[mask]
        self._want(mask)

    def check(self, actions: npt.ArrayLike, num: int) -> FloatArray:
        """Return actions (num,) as (num, 2) numbers: to the left, and faster."""
        chosen = np.asarray(actions)
        if chosen.shape != (num,) or not np.isin(chosen, range(len(META_ACTIONS))).all():
            most = len(META_ACTIONS) - 1
            raise ValueError(
                f"actions: expected {num} numbers within 0..{most}, got shape {chosen.shape}, {chosen!r:.50}"
            )
        return np.stack([(chosen == 0) * 1.0 - (chosen == 2), (chosen == 3) * 1.0 - (chosen == 4)], axis=1)  # noqa: PLR2004

    def command(self, chosen: FloatArray) -> dict[str, FloatArray] | None:
        """Give the egos their wishes; `Worlds.step` needs no command then."""
        before = self._level.copy()
        self._level += self._every(chosen[:, 1]).astype(np.int64)
        np.clip(self._level, 0, len(self._speeds) - 1, out=self._level)
        self._want((self._level != before).any(axis=1))
        self._worlds.change_lanes(self._every(chosen[:, 0]))
        return None

    def _want(self, mask: BoolArray) -> None:
        """Give the egos of some worlds their speeds; the egos that are not ours drive so, too."""
        speeds = np.where(mask[:, None], self._speeds[self._level], np.nan)
        self._worlds.drive_itself(speeds)


_KINDS: Final[dict[str, type[ActionKind]]] = {
    "Continuous": ActionKind,
    "Pedals": _Pedals,
    "DiscreteMeta": _DiscreteMeta,
}


def make_action(worlds: SteppedWorlds, task: DrivingTask, at: Index) -> ActionKind:
    """Return the kind of actions that the options name."""
    return _KINDS[task.action](worlds, task, at)

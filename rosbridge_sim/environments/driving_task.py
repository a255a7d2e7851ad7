"""Options of an environment: scenario, observation, action, reward, and the begin and end of an episode."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from rosbridge_sim.environments.judgement import Judgement
from rosbridge_sim.suggestions import hint
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

EPISODE_STEPS: Final = 400
"""Default number of steps after which an episode is truncated: 40 s with `frame_skip` 5."""

CLEAR: Final = 25.0
"""Nothing else is within this distance of an ego that begins on `start_lane` [m]."""

WEIGHTS: Final = {
    "speed": 1.0,
    "offset": 0.5,
    "steering": 0.05,
    "failure": 10.0,
    "red_light": 0.0,
    "near_miss": 0.0,
    "arrived": 0.0,
    "goal": 0.0,
}
"""Weights of the terms of the reward, see `rewards.judge`."""

PARTS: Final = ("Lane", "Others", "Kinematics", "OccupancyGrid", "Lidar", "Camera")
"""Observations that are one array, and parts of `Dict`."""

OBSERVATIONS: Final = (*PARTS, "Dict", "Goal")

ACTIONS: Final = ("Continuous", "Pedals", "DiscreteMeta")

_GOALS: Final = ("", "lane", "bay")

_WHOLE: Final = ("frame_skip", "num_starts", "num_others", "num_rays", "camera_width", "camera_height")

_POSITIVE: Final = ("target_speed", "lidar_range", "grid_size", "grid_step")


@dataclass(frozen=True, slots=True, eq=False)
class DrivingTask:
    """Options of an environment.

    Attributes:
        scenario: name or file, as for `Worlds`.
        traffic: vehicles besides those of the scenario.
        observation: name of an observation, see `observations`; or the user's function: `observation(worlds)` returns
            figures of all egos, (num_worlds, num_egos, ...), which are taken as they are.
        parts: observations that `Dict` has.
        normalize: observations are within -1..1; else in SI units.
        lights: `Lane` has the light ahead, too.
        num_others: entities of `Others` and `Kinematics`.
        grid_size: side of the square of `OccupancyGrid` [m].
        grid_step: side of its cells [m].
        num_rays: rays of `Lidar`.
        lidar_range: their length [m].
        camera_width: of `Camera` [pixels].
        camera_height: likewise.
        action: name of an action, see `actions`.
        reverses: a negative acceleration drives a standing ego backwards.
        target_speed: speed at which the reward for speed is greatest [m/s].
        target_speeds: that `DiscreteMeta` chooses from, rising [m/s]; empty for 1/2, 3/4, 1 and 5/4 of `target_speed`.
        frame_skip: frames of 20 ms in a step; a multiple of 5 is fastest.
        num_starts: episodes begin with so many seeds of the world; fewer need less memory.
        max_offset: an episode ends this far from the line of the lane [m]; inf for at the edge of the road alone.
        max_distance: an episode with a bay ends this far from it [m].
        weights: of the terms of the reward, see `rewards.judge`; those that are not named stay as they are.
        reward: the user's function in place of these terms: `reward(worlds, judgement, actions)` returns the rewards of
            a step, (num_worlds,), with `judgement.reward` as that of the terms.
        start_lane: name of the lane on which episodes begin, or a pattern such as `R2*`, of whose lanes chance chooses
            one; "" for where the scenario has the ego. What is within `CLEAR` of it then is taken away.
        start_s: arc length on that lane; negative from its end; None for anywhere by chance [m].
        start_speed: speed there [m/s].
        goal: `lane` ends an episode well when the ego is `goal_s` m along a lane that `goal_lane` names and on which it
            did not begin; `bay` when it stands in the one of these lanes that chance has chosen among the free ones,
            with its nose to the lane's beginning. Vehicles that drive are taken away then.
        goal_lane: name or pattern.
        goal_s: see `goal` [m].
    """

    scenario: str
    traffic: int = 0
    observation: str | Callable[[SteppedWorlds], npt.ArrayLike] = "Lane"
    parts: tuple[str, ...] = ("Lane", "Others")
    normalize: bool = True
    lights: bool = False
    num_others: int = 14
    grid_size: float = 55.0
    grid_step: float = 5.0
    num_rays: int = 36
    lidar_range: float = 50.0
    camera_width: int = 96
    camera_height: int = 64
    action: str = "Continuous"
    reverses: bool = False
    target_speed: float = 15.0
    target_speeds: tuple[float, ...] = ()
    frame_skip: int = 5
    num_starts: int = 64
    max_offset: float = math.inf
    max_distance: float = math.inf
    weights: dict[str, float] = field(default_factory=dict)
    reward: Callable[[SteppedWorlds, Judgement, npt.NDArray[np.float64]], npt.ArrayLike] | None = None
    start_lane: str = ""
    start_s: float | None = 0.0
    start_speed: float = 0.0
    goal: Literal["", "lane", "bay"] = ""
    goal_lane: str = ""
    goal_s: float = 0.0

    def __post_init__(self) -> None:
        _check_names(self)
        _check_numbers(self)
        if self.observation == "Goal" and self.goal != "bay":
            raise ValueError("observation: Goal needs goal='bay'")
        if self.goal and not self.goal_lane:
            raise ValueError("goal_lane: expected the lanes of the goal, got ''")
        if self.reward is not None and not callable(self.reward):
            raise ValueError(f"reward: expected a function, got {self.reward!r}")

    @property
    def has_camera(self) -> bool:
        """True if the observation has pictures of a camera."""
        return self.observation == "Camera" or (self.observation == "Dict" and "Camera" in self.parts)

    @property
    def all_weights(self) -> dict[str, float]:
        """The weights of all terms of the reward."""
        return {**WEIGHTS, **self.weights}

    @property
    def speeds(self) -> tuple[float, ...]:
        """The speeds that `DiscreteMeta` chooses from [m/s]."""
        return self.target_speeds or tuple(share * self.target_speed for share in (0.5, 0.75, 1.0, 1.25))


def read_task(options: Mapping[str, Any]) -> DrivingTask:
    """Return the task of keyword arguments.

    Args:
        options: attributes of `DrivingTask` by name.

    Raises:
        TypeError: there is no such option.
        ValueError: an option is out of range.
    """
    known = [each.name for each in fields(DrivingTask)]
    if "duration" in options:
        raise TypeError("duration: there is no such option; give max_episode_steps, the number of steps of an episode")
    for name in options:
        if name not in known:
            raise TypeError(f"{name}: there is no such option{hint(name, known)}")
    return DrivingTask(**options)


def _check_names(task: DrivingTask) -> None:
    for name, weight in task.weights.items():
        if name not in WEIGHTS:
            raise ValueError(f"weights: expected names of {', '.join(WEIGHTS)}, got {name}{hint(name, WEIGHTS)}")
        if math.isnan(_finite(weight)):
            raise ValueError(f"weights: expected finite numbers, got {weight!r} for {name}")
    for name, known in (("observation", OBSERVATIONS), ("action", ACTIONS), ("goal", _GOALS)):
        if getattr(task, name) not in known and not (name == "observation" and callable(task.observation)):
            names = ", ".join(each or "''" for each in known)
            raise ValueError(f"{name}: expected one of {names}, got {getattr(task, name)!r}")
    if isinstance(task.parts, str) or not task.parts or not set(task.parts) <= set(PARTS):
        raise ValueError(f"parts: expected names of {', '.join(PARTS)}, got {task.parts!r}")


def _check_numbers(task: DrivingTask) -> None:
    for name in ("traffic", *_WHOLE):
        value, least = getattr(task, name), int(name != "traffic")
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
            raise ValueError(f"{name}: expected a whole number from {least} on, got {value!r}")
    for name, bound in (*((name, "") for name in _POSITIVE), ("max_offset", " or inf"), ("max_distance", " or inf")):
        value = getattr(task, name)
        if not (_finite(value) > 0.0 or (bound and value == math.inf)):
            raise ValueError(f"{name}: expected a positive number{bound}, got {value!r}")
    for name in ("start_speed", "goal_s"):
        if not _finite(value := getattr(task, name)) >= 0.0:
            raise ValueError(f"{name}: expected a number from 0 on, got {value!r}")
    if task.start_s is not None and math.isnan(_finite(task.start_s)):
        raise ValueError(f"start_s: expected a finite number or None, got {task.start_s!r}")
    speeds = [_finite(value) for value in task.target_speeds]
    if speeds != sorted(set(speeds)) or not all(value > 0.0 for value in speeds):
        raise ValueError(f"target_speeds: expected rising positive numbers, got {task.target_speeds!r}")


def _finite(value: object) -> float:
    """Return a finite number; nan for anything else."""
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        return math.nan
    return float(value) if math.isfinite(value) else math.nan

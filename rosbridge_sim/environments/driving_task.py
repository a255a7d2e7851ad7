"""The task of an environment: scenario, observation, reward, and the end of an episode."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from rosbridge_sim.worlds.surroundings import OTHER_FIGURES
from rosbridge_sim.worlds.worlds import Worlds

__all__ = ["AHEAD", "CLEAR", "MAX_ACCEL", "MAX_STEER", "DrivingTask", "Judgement", "judge", "observe"]

FloatArray = npt.NDArray[np.float32]
BoolArray = npt.NDArray[np.bool_]

MAX_STEER: Final = 0.5
"""Angle of the front wheels at the action 1 [rad]."""

MAX_ACCEL: Final = 4.0
"""Acceleration at the action 1 [m/s^2]."""

CLEAR: Final = 25.0
"""Nothing else is within this distance of an ego that begins on `start_lane` [m]."""

AHEAD: Final = (5.0, 10.0, 20.0, 40.0)
"""Distances along the lane of the places that are observed [m]."""

_SPEED, _OFFSET, _EDGE, _STEER = 40.0, 4.0, 8.0, MAX_STEER
"""Divisors of the observations, so that they are within -1..1."""

_OTHER_SCALE: Final = np.array([1.0, 100.0, 100.0, 40.0, 40.0, 1.0, 1.0, 20.0, 5.0])

WEIGHTS: Final = {"speed": 1.0, "offset": 0.5, "steering": 0.05, "failure": 10.0}

LANE_NAMES: Final = (
    *("speed", "offset", "heading", "to_left", "to_right", "steering", "yaw_rate"),
    *(f"{axis}_{int(distance)}" for distance in AHEAD for axis in ("x", "y")),
)
"""Figures of the observation `Lane`."""


@dataclass(frozen=True, slots=True)
class DrivingTask:
    """Options of an environment.

    Attributes:
        scenario: name or file, as for `Worlds`.
        traffic: vehicles besides those of the scenario.
        observation: `Lane` is the ego on its lane; `Kinematics` is that and the nearest entities.
        num_others: entities of `Kinematics`.
        target_speed: speed at which the reward for speed is greatest [m/s].
        duration: time until an episode is truncated [s].
        frame_skip: frames of 20 ms in a step; a multiple of 5 is fastest.
        num_starts: episodes begin with so many seeds of the world; fewer need less memory.
        max_offset: an episode ends this far from the line of the lane [m]; inf for at the edge of the road alone.
        weights: of the terms of the reward, see `judge`.
        reward: the user's function in place of these terms: `reward(worlds, judgement, actions)` returns the rewards of
            a step, (num_worlds,), with `judgement.reward` as that of the terms.
        start_lane: name of the lane on which episodes begin; "" for where the scenario has the ego. What is within
            `CLEAR` of it then is taken away.
        start_s: arc length on that lane [m].
        start_speed: speed there [m/s].
    """

    scenario: str
    traffic: int = 0
    observation: Literal["Lane", "Kinematics"] = "Lane"
    num_others: int = 14
    target_speed: float = 15.0
    duration: float = 40.0
    frame_skip: int = 5
    num_starts: int = 64
    max_offset: float = math.inf
    weights: dict[str, float] = field(default_factory=lambda: dict(WEIGHTS))
    reward: Callable[[Worlds, Judgement, npt.NDArray[np.float64]], npt.ArrayLike] | None = None
    start_lane: str = ""
    start_s: float = 0.0
    start_speed: float = 0.0

    def __post_init__(self) -> None:
        unknown = set(self.weights) - set(WEIGHTS)
        if unknown:
            raise ValueError(f"weights: expected names of {', '.join(WEIGHTS)}, got {', '.join(sorted(unknown))}")
        if self.observation not in {"Lane", "Kinematics"}:
            raise ValueError(f"observation: expected Lane or Kinematics, got {self.observation!r}")
        for name in ("target_speed", "duration", "frame_skip", "num_starts", "num_others"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not value > 0:
                raise ValueError(f"{name}: expected a positive number, got {value!r}")
        for name in ("start_s", "start_speed"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not 0.0 <= value < math.inf:
                raise ValueError(f"{name}: expected a number from 0 on, got {value!r}")
        if self.reward is not None and not callable(self.reward):
            raise ValueError(f"reward: expected a function, got {self.reward!r}")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of an observation."""
        num = len(LANE_NAMES)
        return (num,) if self.observation == "Lane" else (num + self.num_others * len(OTHER_FIGURES),)


@dataclass(frozen=True, slots=True)
class Judgement:
    """Reward and end of one step; (num_worlds,) each.

    Attributes:
        reward: sum of the terms.
        is_over: bool, the episode has ended by a failure.
        has_collided, is_off_road: bool, the failure.
        speed: [m/s].
        offset: from the line of the lane, left positive [m].
        scores: those of `Worlds.scores`.
    """

    reward: npt.NDArray[np.float64]
    is_over: BoolArray
    has_collided: BoolArray
    is_off_road: BoolArray
    speed: npt.NDArray[np.float64]
    offset: npt.NDArray[np.float64]
    scores: dict[str, npt.NDArray[np.float64]]


def observe(worlds: Worlds, task: DrivingTask) -> FloatArray:
    """Return observations of the first egos, (num_worlds, *task.shape), within -1..1.

    `Lane`: speed / 40 m/s, offset / 4 m, heading / pi, to_left / 8 m, to_right / 8 m, steering / 0.5 rad, yaw rate in
    rad/s, and the places of the lane's line `AHEAD` of the ego, forward and left / 40 m. `Kinematics`: behind these,
    for each of the nearest entities, `OTHER_FIGURES`: places / 100 m, velocities / 40 m/s, length / 20 m, width / 5 m.
    """
    egos, lanes = worlds.egos(), worlds.lanes(AHEAD)
    columns = [
        *(egos["speed"] / _SPEED, lanes["offset"] / _OFFSET, lanes["heading"] / math.pi),
        *(lanes["to_left"] / _EDGE, lanes["to_right"] / _EDGE, egos["steer"] / _STEER, egos["yaw_rate"]),
    ]
    lane = np.stack([column[:, 0] for column in columns], axis=1)
    parts = [lane, lanes["points"][:, 0].reshape(worlds.num_worlds, -1) / AHEAD[-1]]
    if task.observation == "Kinematics":
        others = worlds.others(task.num_others)[:, 0] / _OTHER_SCALE
        parts.append(others.reshape(worlds.num_worlds, -1))
    return np.clip(np.concatenate(parts, axis=1), -1.0, 1.0).astype(np.float32)


def judge(worlds: Worlds, task: DrivingTask, actions: npt.NDArray[np.float64]) -> Judgement:
    """Return what the last step was worth.

    The reward is the sum of: `speed` * max(0, 1 - |v cos(h) / target_speed - 1|), with the heading h relative to the
    lane; -`offset` * min(|offset| / 2 m, 1); -`steering` * (first action)^2; and -`failure` in the step of a collision,
    or in which the ego has left the road.

    Args:
        worlds: after the step.
        task: the options.
        actions: (num_worlds, 2) of the step.

    Raises:
        ValueError: the user's function has returned another shape.
    """
    lanes, scores = worlds.lanes(), {name: values[:, 0] for name, values in worlds.scores().items()}
    speed, offset = worlds.egos()["speed"][:, 0], lanes["offset"][:, 0]
    along = speed * np.cos(lanes["heading"][:, 0]) / task.target_speed
    has_collided = scores["num_collisions"] > 0.0
    is_off_road = (scores["is_off_road"] > 0.0) | (np.abs(offset) > task.max_offset)
    is_over = has_collided | is_off_road
    weights = {**WEIGHTS, **task.weights}
    reward = weights["speed"] * np.maximum(0.0, 1.0 - np.abs(along - 1.0))
    reward -= weights["offset"] * np.minimum(np.abs(offset) / 2.0, 1.0)
    reward -= weights["steering"] * np.square(actions[:, 0])
    reward -= weights["failure"] * is_over
    result = Judgement(reward, is_over, has_collided, is_off_road, speed, offset, scores)
    if task.reward is None:
        return result
    own = np.asarray(task.reward(worlds, result, actions), dtype=np.float64)
    if own.shape != reward.shape:
        raise ValueError(f"reward: expected an array of shape {reward.shape} from the function, got {own.shape}")
    return replace(result, reward=own)

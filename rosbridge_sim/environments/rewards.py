"""The reward of a step, and whether an episode has ended."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.environments.judgement import BoolArray, FloatArray, Index, Judgement
from rosbridge_sim.environments.observations import achieved_goals, desired_goals
from rosbridge_sim.records import replace
from rosbridge_sim.world.geometry.planar import wrap_angle
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

__all__ = ["goal_reward", "judge"]

GOAL_WEIGHTS: Final = (1.0, 1.0, 0.0, 0.0, 0.02, 0.02)
"""Weights of the differences to a goal in the reward: those of highway-env's parking, with both places alike."""

POSE: Final = ("x", "y", "yaw", "speed", "centre")

BAY_PLACE, BAY_HEADING, BAY_SPEED = 0.5, 0.2, 0.2
"""An ego stands in its bay if the middle of its body is this near to that of the bay [m], its heading this near to the
bay's [rad], and its speed at most this [m/s]: its sides are then within the 2.5 m of a usual bay."""

WRONG_WAY_SPEED: Final = 0.5
"""A slower ego does not drive the wrong way [m/s]: it may be turning."""


def judge(
    worlds: SteppedWorlds,
    task: DrivingTask,
    actions: FloatArray,
    *,
    at: Index,
    goals: FloatArray,
    goal_lanes: npt.NDArray[np.bool_],
    red_lights: FloatArray,
) -> Judgement:
    """Return what the last step was worth.

    The reward is the sum of: `speed` * max(0, 1 - |v cos(h) / target_speed - 1|), with the heading h relative to the
    lane; -`offset` * min(|offset| / 2 m, 1); -`steering` * (first action)^2; -`failure` in the step of a collision, in
    which the ego has left the road, or drives the wrong way; -`red_light` for each red light passed in the step;
    `arrived` in the step in which it arrives; and `goal` * `goal_reward`.

    Args:
        worlds: after the step.
        actions: (n, 2) of the step.
        at: which egos.
        goals: (num_worlds, num_egos, 3), see `observe`.
        goal_lanes: (n, num_lanes) bool, lanes on which each has arrived; (n, 0) without such a goal.
        red_lights: (n,) passed before the step.

    Raises:
        ValueError: the user's function has returned another shape.
    """
    names = POSE if task.goal == "bay" else ("speed",)
    egos = {name: values[at] for name, values in worlds.egos(names).items()}
    lanes = {name: values[at] for name, values in worlds.lanes().items()}
    scores = {name: values[at] for name, values in worlds.scores().items()}
    speed, offset = egos["speed"], lanes["offset"]
    along = speed * np.cos(lanes["heading"])
    has_collided = scores["num_collisions"] > 0.0
    is_parking = task.goal == "bay"
    is_off_road = ((scores["is_off_road"] > 0.0) & (not is_parking)) | (np.abs(offset) > task.max_offset)
    is_wrong_way = (along < -WRONG_WAY_SPEED) & (not is_parking)
    weights = task.all_weights
    own_goals = goals[at]
    has_arrived = np.zeros(len(speed), dtype=bool)
    reward = np.zeros(len(speed))
    if is_parking:
        has_arrived = _stands_in_bay(egos, own_goals)
        reward += weights["goal"] * goal_reward(achieved_goals(worlds)[at], desired_goals(own_goals))
    elif task.goal:
        lane = lanes["lane"].astype(np.int64)
        has_arrived = (lane >= 0) & goal_lanes[np.arange(len(lane)), lane] & (lanes["s"] >= task.goal_s)
    is_failure = has_collided | is_off_road | is_wrong_way
    has_arrived &= ~is_failure
    reward += weights["speed"] * np.maximum(0.0, 1.0 - np.abs(along / task.target_speed - 1.0))
    reward -= weights["offset"] * np.minimum(np.abs(offset) / 2.0, 1.0)
    reward -= weights["steering"] * np.square(actions[:, 0])
    reward -= weights["failure"] * is_failure
    reward -= weights["red_light"] * (scores["num_red_lights"] - red_lights)
    reward += weights["arrived"] * has_arrived
    result = Judgement(
        *(reward, is_failure | has_arrived, has_collided, is_off_road, is_wrong_way, has_arrived),
        *(speed, offset, scores),
    )
    if task.reward is None:
        return result
    own = np.asarray(task.reward(worlds, result, actions), dtype=np.float64)
    if own.shape != reward.shape:
        raise ValueError(f"reward: expected an array of shape {reward.shape} from the function, got {own.shape}")
    return replace(result, reward=own)


def goal_reward(achieved: npt.ArrayLike, desired: npt.ArrayLike) -> FloatArray:
    """Return minus the square root of the weighted distance of `GOAL_FIGURES`, (...,).

    Args:
        achieved: (..., 6) `achieved_goal` of the observation.
        desired: (..., 6) `desired_goal`.
    """
    apart = np.abs(np.asarray(achieved, dtype=np.float64) - np.asarray(desired, dtype=np.float64))
    # No matrix product: its last bits depend on the number of rows.
    return np.asarray(-np.sqrt(sum(weight * apart[..., i] for i, weight in enumerate(GOAL_WEIGHTS))))


def _stands_in_bay(egos: dict[str, FloatArray], goals: FloatArray) -> BoolArray:
    """Return which egos stand in their bays, (n,)."""
    x = egos["x"] + egos["centre"] * np.cos(egos["yaw"]) - goals[:, 0]
    y = egos["y"] + egos["centre"] * np.sin(egos["yaw"]) - goals[:, 1]
    is_there = (np.hypot(x, y) < BAY_PLACE) & (np.abs(wrap_angle(egos["yaw"] - goals[:, 2])) < BAY_HEADING)
    return np.asarray(is_there & (np.abs(egos["speed"]) <= BAY_SPEED))

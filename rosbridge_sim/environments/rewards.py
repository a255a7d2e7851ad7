"""The reward of a step, and whether an episode has ended."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.environments.judgement import Index, Judgement
from rosbridge_sim.environments.observations import GOAL_FIGURES, Lanes, achieved_goals, desired_goals
from rosbridge_sim.records import replace
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, wrap_angle
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

GOAL_WEIGHTS: Final = (1.0, 1.0, 0.0, 0.0, 0.02, 0.02)
"""Weights of the differences to a goal in the reward: those of highway-env's parking, with both places alike."""

BAY_PLACE, BAY_HEADING, BAY_SPEED = 0.5, 0.2, 0.2
"""An ego stands in its bay if the middle of its body is this near to that of the bay [m], its heading this near to the
bay's [rad], and its speed at most this [m/s]: its sides are then within the 2.5 m of a usual bay."""

WRONG_WAY_SPEED: Final = 0.5
"""A slower ego does not drive the wrong way [m/s]: it may be turning."""

NEAR_MISS: Final = 1.5
"""Least time to collision that is no near miss [s]: the bound for serious conflicts in studies since Hayward (1972)."""

STANDING: Final = 0.5
"""Least speed for a near miss [m/s]: an ego that stands does not cause one."""


def judge(
    worlds: SteppedWorlds,
    task: DrivingTask,
    actions: FloatArray,
    *,
    at: Index,
    goals: FloatArray,
    goal_lanes: npt.NDArray[np.bool_],
    red_lights: FloatArray,
    lanes: Lanes | None = None,
) -> Judgement:
    """Return what the last step was worth.

    The reward is the sum of: `speed` * max(0, 1 - |v cos(h) / target_speed - 1|), with the heading h relative to the
    lane; -`offset` * min(|offset| / 2 m, 1); -`steering` * (first action)^2; -`failure` in the step of a collision, in
    which the ego has left the road, or drives the wrong way; -`red_light` for each red light passed in the step;
    -`near_miss` * max(0, 1 - time to collision / 1.5 s) while it moves; `arrived` in the step in which it arrives; and
    `goal` * `goal_cost`, which is negative.

    Args:
        worlds: after the step.
        actions: (n, 2) of the step.
        goals: (num_worlds, num_egos, 3), see `observe`.
        goal_lanes: (n, num_lanes) bool, lanes on which each has arrived; (n, 0) without such a goal.
        red_lights: (n,) passed before the step.
        lanes: the lanes as they are now, if they are known.

    Raises:
        ValueError: the user's function has returned another shape.
    """
    lanes = worlds.lanes() if lanes is None else lanes
    lane_of = {name: lanes[name][at] for name in ("offset", "heading", "lane", "s")}
    scores = {name: values[at] for name, values in worlds.scores().items()}
    speed, offset = worlds.egos(("speed",))["speed"][at], lane_of["offset"]
    # What ends an episode as a failure, and the goal.
    along = speed * np.cos(lane_of["heading"])
    has_collided = scores["num_collisions"] > 0.0
    is_parking = task.goal == "bay"
    is_off_road = (scores["is_off_road"] > 0.0) | (np.abs(offset) > task.max_offset)
    is_wrong_way = (along < -WRONG_WAY_SPEED) & (not is_parking)
    weights = task.all_weights
    has_arrived = np.zeros(len(speed), dtype=bool)
    reward = np.zeros(len(speed))
    if is_parking:
        achieved, desired = achieved_goals(worlds)[at], desired_goals(goals[at])
        is_off_road |= distance_to_goal(achieved, desired) > task.max_distance
        has_arrived = stands_in_bay(achieved, desired)
        reward += weights["goal"] * goal_cost(achieved, desired)
    elif task.goal:
        lane = lane_of["lane"].astype(np.int64)
        has_arrived = (lane >= 0) & goal_lanes[np.arange(len(lane)), lane] & (lane_of["s"] >= task.goal_s)
    is_failure = has_collided | is_off_road | is_wrong_way
    has_arrived &= ~is_failure
    # The terms of the sum above, in its order.
    reward += weights["speed"] * np.maximum(0.0, 1.0 - np.abs(along / task.target_speed - 1.0))
    reward -= weights["offset"] * np.minimum(np.abs(offset) / 2.0, 1.0)
    reward -= weights["steering"] * np.square(actions[:, 0])
    reward -= weights["failure"] * is_failure
    if weights["red_light"]:
        reward -= weights["red_light"] * (scores["num_red_lights"] - red_lights)
    if weights["near_miss"]:
        nearness = np.maximum(0.0, 1.0 - scores["time_to_collision"] / NEAR_MISS)
        reward -= weights["near_miss"] * np.where(np.abs(speed) > STANDING, nearness, 0.0)
    if weights["arrived"]:
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


def goal_cost(achieved: npt.ArrayLike, desired: npt.ArrayLike) -> FloatArray:
    """Return minus the square root of the weighted distance of `GOAL_FIGURES`, (...,).

    Args:
        achieved: (..., 6) `achieved_goal` of the observation.
        desired: (..., 6) `desired_goal`.
    """
    apart = np.abs(_apart(achieved, desired))
    # No matrix product: its last bits depend on the number of rows.
    return np.asarray(-np.sqrt(sum(weight * apart[..., i] for i, weight in enumerate(GOAL_WEIGHTS))))


def distance_to_goal(achieved: npt.ArrayLike, desired: npt.ArrayLike) -> FloatArray:
    """Return the distance from the middle of the body to that of the bay, (...,) [m]; arguments as for `goal_cost`."""
    apart = _apart(achieved, desired)
    return np.asarray(GOAL_FIGURES["x"] * np.hypot(apart[..., 0], apart[..., 1]))


def stands_in_bay(achieved: npt.ArrayLike, desired: npt.ArrayLike) -> BoolArray:
    """Return which egos stand in their bays, (...,) bool; arguments as for `goal_cost`."""
    own, bay = np.asarray(achieved, dtype=np.float64), np.asarray(desired, dtype=np.float64)
    turn = np.arctan2(own[..., 5], own[..., 4]) - np.arctan2(bay[..., 5], bay[..., 4])
    is_there = (distance_to_goal(own, bay) < BAY_PLACE) & (np.abs(wrap_angle(turn)) < BAY_HEADING)
    return np.asarray(is_there & (GOAL_FIGURES["vx"] * np.hypot(own[..., 2], own[..., 3]) <= BAY_SPEED))


def _apart(achieved: npt.ArrayLike, desired: npt.ArrayLike) -> FloatArray:
    return np.asarray(achieved, dtype=np.float64) - np.asarray(desired, dtype=np.float64)

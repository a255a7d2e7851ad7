"""Environments as one set of arrays: their spaces, seeds and rewards, in few steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from rosbridge_sim.environments.driving_vector_env import DrivingVectorEnv


def places(many: DrivingVectorEnv) -> list[float]:
    return [float(x) for x in many.worlds.egos()["x"][:, 0]]


def test_spaces_of_many_are_those_of_one_with_a_row_each() -> None:
    many = DrivingVectorEnv(3, scenario="loop")
    assert many.observation_space.shape == (3, *(many.single_observation_space.shape or ()))
    assert many.action_space.shape == (3, *(many.single_action_space.shape or ()))
    assert many.render() is None
    assert not many.page_url


def test_environment_without_a_seed_goes_on_with_its_own_chance() -> None:
    many, others = (DrivingVectorEnv(2, scenario="loop", start_lane="L2_0*", start_s=None) for _ in range(2))
    for each, seeds in ((many, [7, None]), (others, [7, 7])):
        each.reset(seed=[7, 8])
        each.reset(seed=seeds)
    first, second = places(many), places(others)
    assert first[0] == second[0] == second[1]
    assert first[1] != second[1]
    many.reset(seed=7)
    assert places(many)[0] == first[0]


@pytest.mark.parametrize("num", [0, -1])
def test_episode_has_a_step_at_least(num: int) -> None:
    with pytest.raises(ValueError, match="max_episode_steps: expected"):
        DrivingVectorEnv(1, scenario="loop", max_episode_steps=num)


@pytest.mark.parametrize(
    ("collided", "off_road", "is_failure"),
    [(False, False, False), (True, False, True), (False, True, True), (True, True, True)],
)
def test_collision_or_a_place_off_the_road_fails_in_hindsight(
    collided: bool,  # noqa: FBT001 - of the table
    off_road: bool,  # noqa: FBT001 - of the table
    is_failure: bool,  # noqa: FBT001 - of the table
) -> None:
    many = DrivingVectorEnv(1, scenario="parking", goal="bay", goal_lane="*", observation="Goal")
    seen: Any = many.reset(seed=0)[0]
    desired = seen["desired_goal"][0]
    info = {"has_collided": collided, "is_off_road": off_road}
    weights = many.task.all_weights
    reward = many.compute_reward(desired, desired, info)
    assert reward == pytest.approx(-weights["failure"] if is_failure else weights["arrived"])
    assert weights["failure"] > 0.0
    both = many.compute_reward(np.stack([desired] * 2), np.stack([desired] * 2), [info, info])
    assert both.tolist() == [reward, reward]

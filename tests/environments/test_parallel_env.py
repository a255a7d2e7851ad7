"""Several egos in one world, as agents of PettingZoo."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pettingzoo", reason="the extra rosbridge-sim[gym]")

from pettingzoo.test import parallel_api_test

from rosbridge_sim.environments.parallel_env import DrivingParallelEnv


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"action": "DiscreteMeta", "observation": "Dict"}])
def test_parallel_environment_follows_the_rules(options: dict[str, Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(DrivingParallelEnv(3, max_episode_steps=10, **options), num_cycles=15)


def test_each_ego_does_what_its_agent_wants() -> None:
    env = DrivingParallelEnv(3, scenario="loop", start_lane="L2_0*", start_s=None, start_speed=10.0)
    seen, infos = env.reset(seed=1)
    assert sorted(seen) == sorted(infos) == env.agents == ["ego_0", "ego_1", "ego_2"]
    places = env.worlds.egos()
    x, y = places["x"][0], places["y"][0]
    apart = np.hypot(x[:, None] - x, y[:, None] - y)[np.triu_indices(3, 1)]
    assert apart.min() >= 25.0
    for _ in range(10):
        *_, infos = env.step({"ego_0": [0.0, 1.0], "ego_1": [0.0, -1.0], "ego_2": [0.0, 0.0]})
    speeds = [infos[agent]["speed"] for agent in env.agents]
    assert speeds[0] > speeds[2] + 1.0 > speeds[1] + 2.0


def test_ego_that_has_left_the_road_is_no_agent_any_more() -> None:
    env = DrivingParallelEnv(2, scenario="loop", start_lane="L2_0*", start_s=None, start_speed=10.0)
    env.reset(seed=1)
    rewards: dict[str, float] = {}
    terminated: dict[str, bool] = {}
    for _ in range(100):
        _, rewards, terminated, *_ = env.step({"ego_0": [0.4, 0.5], "ego_1": [0.0, -1.0]})
        if terminated["ego_0"]:
            break
    assert terminated == {"ego_0": True, "ego_1": False}
    assert rewards["ego_0"] < -5.0
    assert env.agents == ["ego_1"]
    for _ in range(50):
        seen, *_ = env.step({"ego_1": [0.0, -1.0]})
    assert list(seen) == ["ego_1"]
    assert abs(env.worlds.egos()["speed"][0, 0]) < 0.1


def test_same_seed_gives_the_same_episode() -> None:
    first, second = (DrivingParallelEnv(2, traffic=3) for _ in range(2))
    for env in (first, second):
        env.reset(seed=5)
    for _ in range(3):
        actions = {agent: np.array([0.1, 0.5]) for agent in first.agents}
        one, other = first.step(actions)[0], second.step(actions)[0]
        assert {name: each.tobytes() for name, each in one.items()} == {
            name: each.tobytes() for name, each in other.items()
        }


def test_spaces_of_an_agent_are_its_own_and_one_ego_needs_no_lane_to_begin_on() -> None:
    env = DrivingParallelEnv(2, render_mode="rgb_array")
    for spaces in (env.observation_space, env.action_space):
        assert spaces("ego_0") == spaces("ego_1")
        assert spaces("ego_0") is not spaces("ego_1")
    _, infos = env.reset(seed=0)
    assert [info["speed"] for info in infos.values()] == pytest.approx([5.0, 5.0])
    picture = env.render()
    assert picture is not None
    assert picture.shape == (400, 600, 3)
    one = DrivingParallelEnv(1, scenario="loop")
    one.reset(seed=0)
    assert one.agents == ["ego_0"]
    assert one.render() is None


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="start_lane: expected the lanes on which several egos begin"):
        DrivingParallelEnv(2, scenario="loop")
    with pytest.raises(ValueError, match=r"egos: expected 1\.\."):
        DrivingParallelEnv(0)
    env = DrivingParallelEnv(2, scenario="loop", start_lane="L2_00")
    with pytest.raises(ValueError, match="start_lane: no place 25 m from the other egos was found for ego 1"):
        env.reset(seed=0)
    env = DrivingParallelEnv(2, scenario="loop", start_lane="L2_0*")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="actions: expected one of each agent, got none of ego_1"):
        env.step({"ego_0": np.zeros(2)})

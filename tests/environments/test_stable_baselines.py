"""The adapter to stable-baselines3, by the documented contract of its vector environments, because it needs torch."""

from __future__ import annotations

import pickle
import sys
import types
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from rosbridge_sim.environments.stable_baselines import make_vec_env


class VecEnv(ABC):
    """The abstract methods of stable_baselines3.common.vec_env.VecEnv, and what its constructor does."""

    def __init__(self, num_envs: int, observation_space: Any, action_space: Any) -> None:  # noqa: ANN401
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(num_envs)]
        self._seeds: list[int | None] = [None] * num_envs
        self._options: list[dict[str, Any]] = [{} for _ in range(num_envs)]
        self.render_mode = self.get_attr("render_mode")[0]

    def _reset_seeds(self) -> None:
        self._seeds = [None] * self.num_envs

    def _reset_options(self) -> None:
        self._options = [{} for _ in range(self.num_envs)]

    @abstractmethod
    def reset(self) -> Any: ...  # noqa: ANN401

    @abstractmethod
    def step_async(self, actions: Any) -> None: ...  # noqa: ANN401

    @abstractmethod
    def step_wait(self) -> Any: ...  # noqa: ANN401

    @abstractmethod
    def close(self) -> None: ...

    @abstractmethod
    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]: ...  # noqa: ANN401

    @abstractmethod
    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None: ...  # noqa: ANN401

    @abstractmethod
    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]: ...  # noqa: ANN401

    @abstractmethod
    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]: ...  # noqa: ANN401

    def step(self, actions: Any) -> Any:  # noqa: ANN401
        self.step_async(actions)
        return self.step_wait()

    def seed(self, seed: int) -> None:
        self._seeds = [seed + i for i in range(self.num_envs)]


@pytest.fixture(autouse=True)
def stub(monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("stable_baselines3.common.vec_env")
    module.VecEnv = VecEnv  # type: ignore[attr-defined]
    for name in ("stable_baselines3", "stable_baselines3.common"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)


def test_ended_environment_tells_its_last_observation_and_begins_anew() -> None:
    envs = make_vec_env("rosbridge_sim/LaneKeeping-v1", 2, max_episode_steps=3)
    envs.seed(3)
    seen = envs.reset()
    assert seen.shape == (2, 15)
    assert envs.reset_infos[1]["speed"] == 0.0
    for number in range(3):
        seen, rewards, done, infos = envs.step(np.array([[0.0, 1.0], [0.0, 0.5]]))
        assert rewards.dtype == np.float32
        assert done.tolist() == [number == 2] * 2
    assert [info["TimeLimit.truncated"] for info in infos] == [True, True]
    assert infos[0]["terminal_observation"][0] > infos[1]["terminal_observation"][0] > seen[1][0] == 0.0
    assert infos[0]["speed"] > 0.2
    assert infos[0]["score"]["num_collisions"] == 0.0
    assert "TimeLimit.truncated" not in envs.step(np.zeros((2, 2)))[3][0]


def test_seed_holds_for_the_next_reset_alone() -> None:
    envs, others = (make_vec_env("rosbridge_sim/Highway-v1", 2) for _ in range(2))
    for each in (envs, others):
        each.seed(5)
    assert envs.reset().tobytes() == others.reset().tobytes()
    assert envs._seeds == [None, None]


def test_goals_are_rewarded_in_hindsight() -> None:
    envs = make_vec_env("rosbridge_sim/Parking-v1", 2)
    envs.reset()
    seen, rewards, _, infos = envs.step(np.zeros((2, 2)))
    found = envs.env_method(
        "compute_reward", seen["achieved_goal"], seen["desired_goal"], np.array(infos, dtype=object), indices=[0]
    )
    assert len(found) == 1
    assert found[0].astype(np.float32).tolist() == rewards.tolist()
    assert envs.env_is_wrapped(object, indices=0) == [False]


def test_attributes_are_those_of_all_environments() -> None:
    envs = make_vec_env("rosbridge_sim/LaneKeeping-v1", 2, render_mode="rgb_array")
    assert envs.render_mode == "rgb_array"
    envs.reset()
    assert [picture.shape for picture in envs.get_images()] == [(400, 600, 3)] * 2
    envs.set_attr("note", 1)
    assert envs.get_attr("note", indices=[1]) == [1]
    with pytest.raises(ValueError, match="indices: expected all"):
        envs.set_attr("note", 1, indices=[0])
    envs.close()


def test_missing_library_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    with pytest.raises(ImportError, match="pip install stable-baselines3"):
        make_vec_env("rosbridge_sim/LaneKeeping-v1", 2)


def test_pickled_environments_go_on_as_they_did() -> None:
    envs = make_vec_env("rosbridge_sim/LaneKeeping-v1", 2)
    envs.seed(3)
    envs.reset()
    both = [envs, pickle.loads(pickle.dumps(envs))]  # noqa: S301 - our own bytes
    actions = np.array([[0.1, 1.0], [0.0, 0.5]])
    seen = [each.step(actions)[0].tobytes() for each in both]
    assert seen[0] == seen[1]

"""Many environments with the interface of stable-baselines3's vector environments.

Its algorithms take gymnasium's single environments as they are. This adapter gives them many at once, as one set of
arrays, with automatic resets and infos in its form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from rosbridge_sim.environments.driving_vector_env import DrivingVectorEnv
from rosbridge_sim.environments.observations import Seen
from rosbridge_sim.environments.registration import register_all

Array = npt.NDArray[Any]
Indices = int | Iterable[int] | None


def make_vec_env(name: str, num_envs: int, **options: Any) -> Any:  # noqa: ANN401 - a VecEnv, whose class is not ours
    """Return environments for stable-baselines3.

    Args:
        name: of an environment, such as `rosbridge_sim/Highway-v1`.
        options: those of `make_vec`.

    Raises:
        ImportError: stable-baselines3 is not installed.
        ValueError: an option is out of range.
    """
    adapter = _adapter()
    register_all()
    options = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "SameStep", **options}
    return adapter(gymnasium.make_vec(name, num_envs=num_envs, **options).unwrapped)


def _adapter() -> type[Any]:
    """Return the class of the environments.

    Raises:
        ImportError: stable-baselines3 is not installed.
    """
    try:
        from stable_baselines3.common.vec_env import VecEnv  # noqa: PLC0415 - not a dependency: it brings torch
    except ImportError:
        raise ImportError("make_vec_env needs stable-baselines3: pip install stable-baselines3") from None
    return type("RosbridgeVecEnv", (_Methods, VecEnv), {"__doc__": _Methods.__doc__})


def _adapt(envs: DrivingVectorEnv) -> Any:  # noqa: ANN401 - as `make_vec_env`
    """Return environments that were pickled."""
    return _adapter()(envs)


class _Methods:
    """A vector environment as stable-baselines3 wants it.

    Args:
        envs: begin anew in the step in which they end.
    """

    num_envs: int
    reset_infos: list[dict[str, Any]]
    _seeds: list[int | None]
    _reset_seeds: Callable[[], None]
    _reset_options: Callable[[], None]

    def __init__(self, envs: DrivingVectorEnv) -> None:
        self.envs = envs
        self._actions: Array = np.zeros(0)
        base: Any = super()  # the class of stable-baselines3, see `make_vec_env`
        base.__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments for a copy or pickle: a class that is made at run time cannot be found by its name."""
        return _adapt, (self.envs,), self.__dict__

    def reset(self) -> Seen:
        """Begin new episodes; return the observations."""
        seeds = self._seeds if any(seed is not None for seed in self._seeds) else None
        seen, infos = self.envs.reset(seed=seeds)
        self.reset_infos = [_info(infos, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return seen

    def step_async(self, actions: Array) -> None:
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[Seen, Array, Array, list[dict[str, Any]]]:
        """Drive; return observations, rewards, ends and infos. An environment that has ended has begun anew."""
        seen, rewards, terminated, truncated, infos = self.envs.step(self._actions)
        done = terminated | truncated
        found = []
        for i in range(self.num_envs):
            if done[i]:
                is_late = bool(truncated[i] and not terminated[i])
                ended = {"terminal_observation": infos["final_obs"][i], "TimeLimit.truncated": is_late}
                found.append({**_info(infos["final_info"], i), **ended})
            else:
                found.append(_info(infos, i))
        return seen, rewards.astype(np.float32), done, found

    def close(self) -> None:
        """Free what the environments have."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute of environments; it is the same for all."""
        return [getattr(self.envs, attr_name)] * len(self._numbers(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:  # noqa: ANN401 - the caller's
        """Set an attribute of all environments.

        Raises:
            ValueError: only some of them are meant.
        """
        if len(self._numbers(indices)) != self.num_envs:
            raise ValueError("indices: expected all, because the environments are one set of arrays")
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Indices = None, **kwargs: Any) -> list[Any]:  # noqa: ANN401
        """Call a method of environments; what it returns is the same for all."""
        return [getattr(self.envs, method_name)(*args, **kwargs)] * len(self._numbers(indices))

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Indices = None) -> list[bool]:
        """Return whether environments have a wrapper: none has."""
        del wrapper_class
        return [False] * len(self._numbers(indices))

    def get_images(self) -> Sequence[Array | None]:
        """Return pictures of all environments."""
        pictures = self.envs.render()
        return [None] * self.num_envs if pictures is None else list(pictures)

    def _numbers(self, indices: Indices) -> list[int]:
        if indices is None:
            return list(range(self.num_envs))
        return [indices] if isinstance(indices, int) else list(indices)


def _info(infos: dict[str, Any], number: int) -> dict[str, Any]:
    """Return the info of one environment, as plain numbers."""
    return {
        name: _info(values, number) if isinstance(values, dict) else values[number].item()
        for name, values in infos.items()
        if not name.startswith("_") and name not in {"final_obs", "final_info"}
    }

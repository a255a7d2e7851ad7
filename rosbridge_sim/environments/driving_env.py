"""One environment: a `DrivingVectorEnv` of one world, with Gymnasium's interface of one."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import Env
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode

from rosbridge_sim.environments.driving_vector_env import FPS, DrivingVectorEnv

__all__ = ["DrivingEnv"]

Array = npt.NDArray[Any]


class DrivingEnv(Env[Array, Array]):
    """An environment in which one ego is driven; see `DrivingVectorEnv` for actions, and `DrivingTask` for the options.

    Args:
        render_mode: `rgb_array` or None.
        options: those of `DrivingTask`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": FPS}  # noqa: RUF012 - Gymnasium's own form

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:  # noqa: ANN401 - those of DrivingTask
        self._many = DrivingVectorEnv(1, render_mode=render_mode, autoreset_mode=AutoresetMode.DISABLED, **options)
        self.render_mode = render_mode
        self.observation_space: Box = self._many.single_observation_space
        self.action_space: Box = self._many.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin a new episode; see `gymnasium.Env.reset`. There are no `options`."""
        super().reset(seed=seed)
        del options
        seen, infos = self._many.reset(seed=seed)
        return seen[0], _first(infos)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Drive for `frame_skip` frames; see `gymnasium.Env.step`."""
        seen, rewards, terminated, truncated, infos = self._many.step(np.asarray(action)[None])
        return seen[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), _first(infos)

    def render(self) -> Array | None:
        """Return a picture from above, (400, 600, 3) uint8; None without a `render_mode`."""
        pictures = self._many.render()
        return None if pictures is None else pictures[0]


def _first(infos: dict[str, Any]) -> dict[str, Any]:
    """Return the infos of one environment as plain numbers."""
    return {
        name: _first(values) if isinstance(values, dict) else values[0].item()
        for name, values in infos.items()
        if not name.startswith("_")
    }

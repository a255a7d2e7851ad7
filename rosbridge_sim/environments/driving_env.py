"""One environment: a `DrivingVectorEnv` of one world, with Gymnasium's interface of one."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import Env
from gymnasium.vector import AutoresetMode

from rosbridge_sim.environments.driving_vector_env import RENDER_MODES, DrivingVectorEnv
from rosbridge_sim.environments.observations import Seen, pick, pick_figures

Array = npt.NDArray[Any]


class DrivingEnv(Env[Seen, Any]):
    """An environment in which one ego is driven; see `actions` and `observations`, and `DrivingTask` for the options.

    Args:
        render_mode: `rgb_array`, or `human` for a page in the browser, or None.
        options: those of `DrivingTask`.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 10}  # noqa: RUF012 - Gymnasium's own form

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:  # noqa: ANN401 - those of DrivingTask
        self._many = self._make_many(render_mode=render_mode, autoreset_mode=AutoresetMode.DISABLED, **options)
        self._many.has_masks = False
        self.task, self.worlds = self._many.task, self._many.worlds
        self.render_mode = render_mode
        self.metadata = {"render_modes": RENDER_MODES, "render_fps": self._many.episodes.fps}
        self.observation_space = self._many.single_observation_space
        self.action_space = self._many.single_action_space

    def _make_many(self, **options: Any) -> DrivingVectorEnv:  # noqa: ANN401 - as above
        return DrivingVectorEnv(1, **options)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin a new episode; see `gymnasium.Env.reset`. There are no `options`."""
        super().reset(seed=seed)
        del options
        seen, infos = self._many.reset(seed=seed)
        return pick(seen, 0), pick_figures(infos, 0)

    def step(self, action: Any) -> tuple[Seen, float, bool, bool, dict[str, Any]]:  # noqa: ANN401 - of the space
        """Drive for `frame_skip` frames; see `gymnasium.Env.step`."""
        seen, rewards, terminated, truncated, infos = self._many.step(np.asarray(action)[None])
        return pick(seen, 0), float(rewards[0]), bool(terminated[0]), bool(truncated[0]), pick_figures(infos, 0)

    def render(self) -> Array | None:
        """Return a picture from above, (400, 600, 3) uint8; None if the mode is another one."""
        pictures = self._many.render()
        return None if pictures is None else pictures[0]

    @property
    def page_url(self) -> str:
        """URL of the page with `human`; empty before the first reset."""
        return self._many.page_url

    def close(self) -> None:
        """Stop the server of the page, if there is one."""
        self._many.close()

    def compute_reward(self, achieved_goal: npt.ArrayLike, desired_goal: npt.ArrayLike, info: Any) -> Any:  # noqa: ANN401
        """Return the reward of steps that have led to goals; see `DrivingVectorEnv.compute_reward`."""
        return self._many.compute_reward(achieved_goal, desired_goal, info)

"""Many environments as one set of arrays, by `rosbridge_sim.Worlds`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from rosbridge_sim.environments.driving_task import read_task
from rosbridge_sim.environments.episodes import Episodes
from rosbridge_sim.environments.judgement import Judgement
from rosbridge_sim.environments.observations import Seen, pick, space_of
from rosbridge_sim.environments.rewards import goal_cost, stands_in_bay
from rosbridge_sim.environments.top_view import draw
from rosbridge_sim.worlds.argument_checks import check_number
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds
from rosbridge_sim.worlds.worlds import Worlds

if TYPE_CHECKING:
    from rosbridge_sim.environments.human_view import HumanView

Array = npt.NDArray[Any]

RENDER_MODES: Final = ["human", "rgb_array"]


class DrivingVectorEnv(VectorEnv[Seen, Array, Array]):
    """Environments in which the ego of each world is driven; see `DrivingTask` for the options.

    Environment i does what `DrivingEnv` does with the seed of i.

    Args:
        render_mode: `rgb_array`, or `human` for a page in the browser that shows the first environment, or None.
        max_episode_steps: steps after which an episode is truncated, as `make_vec` gives them; None for no end.
        autoreset_mode: when an environment that has ended begins again; see Gymnasium.
        options: those of `DrivingTask`.

    Attributes:
        has_masks: infos have Gymnasium's masks.

    Raises:
        ValueError: an option is out of range.
    """

    _view: HumanView | None = None  # here, since gymnasium closes an environment whose options were refused, too
    has_masks = True

    def __init__(
        self,
        num_envs: int = 1,
        *,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **options: Any,  # noqa: ANN401 - those of DrivingTask
    ) -> None:
        self.task = read_task(options)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        if max_episode_steps is not None:
            check_number("max_episode_steps", max_episode_steps)
        self._max_steps = max_episode_steps
        if render_mode not in {None, *RENDER_MODES}:
            raise ValueError(f"render_mode: expected {', '.join(RENDER_MODES)} or None, got {render_mode!r}")
        self.worlds = self._make_worlds(num_envs)
        self.episodes = Episodes(self.worlds, self.task)
        self.metadata = {"render_modes": RENDER_MODES, "render_fps": self.episodes.fps}
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.single_observation_space = space_of(self.task, self.worlds)
        self.single_action_space = self.episodes.action.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._is_done = np.zeros(num_envs, dtype=bool)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for a copy or pickle, without the page: a copy opens its own."""
        return {**self.__dict__, "_view": None}

    def _make_worlds(self, num: int) -> SteppedWorlds:
        return Worlds(self.task.scenario, num, seed=[0] * num, traffic=self.task.traffic)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: one for each environment, or s for s, s + 1, ...; None for chance that goes on.
            options: `reset_mask`, (num_envs,) bool, which environments begin anew; the others stay.

        Returns:
            Observations (num_envs, ...) and infos.

        Raises:
            ValueError: the mask or the seeds have another length, or a seed is negative. Nothing has changed.
        """
        mask = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(f"reset_mask: expected bool of shape ({self.num_envs},), got {mask.dtype} {mask.shape}")
        for i, number in enumerate(self._seeds(seed)):
            if mask[i] and number is not None:
                self.episodes.seed(i, number)
        self._begin(mask)
        self._show()
        return self.episodes.observe(), self._infos(self.episodes.judge())

    def step(self, actions: Array) -> tuple[Seen, Array, Array, Array, dict[str, Any]]:
        """Drive for `frame_skip` frames.

        Args:
            actions: (num_envs, ...), see `actions`.

        Returns:
            Observations, rewards, terminated, truncated and infos.

        Raises:
            ValueError: the actions have another shape. Nothing has moved.
        """
        begins = self._is_done & (self.autoreset_mode == AutoresetMode.NEXT_STEP)
        chosen = self.episodes.step(actions)
        if begins.any():
            self._begin(begins)
        result = self.episodes.judge(chosen)
        terminated = result.is_over & ~begins
        truncated = self.episodes.is_late(self._max_steps) & ~begins
        rewards = np.where(begins, 0.0, result.reward)
        infos = self._infos(result)
        self._is_done = terminated | truncated
        seen = self.episodes.observe()
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._is_done.any():
            done = self._is_done.copy()
            last = np.full(self.num_envs, None, dtype=object)
            for i in done.nonzero()[0].tolist():
                last[i] = pick(seen, i)
            final = infos
            self._begin(done)
            infos = self._infos(self.episodes.judge())
            infos |= {"final_obs": last, "_final_obs": done, "final_info": final, "_final_info": done}
            seen = self.episodes.observe()
        self._show()
        return seen, rewards, terminated, truncated, infos

    def render(self) -> tuple[Array, ...] | None:
        """Return a picture of each world from above, (400, 600, 3) uint8; None if the mode is another one."""
        if self.render_mode != "rgb_array":
            return None
        return tuple(draw(self.worlds, i, self.episodes.starts.goals[i]) for i in range(self.num_envs))

    def compute_reward(self, achieved_goal: npt.ArrayLike, desired_goal: npt.ArrayLike, info: Any) -> Any:  # noqa: ANN401
        """Return the reward of steps that have led to goals, as environments with goals have it.

        Args:
            achieved_goal: (6,) or (n, 6) of the observations.
            info: of the step, or (n,) of them.

        Returns:
            A number, or (n,): that of `step`, with the weights `goal`, `arrived` and `failure` alone.
        """
        weights = self.task.all_weights
        cost = goal_cost(achieved_goal, desired_goal)
        failed = [each["has_collided"] or each["is_off_road"] for each in np.atleast_1d(np.asarray(info, dtype=object))]
        is_failure = np.asarray(failed, dtype=bool).reshape(cost.shape)
        has_arrived = stands_in_bay(achieved_goal, desired_goal) & ~is_failure
        rewards = weights["goal"] * cost - weights["failure"] * is_failure + weights["arrived"] * has_arrived
        return float(rewards) if rewards.ndim == 0 else rewards

    @property
    def page_url(self) -> str:
        """URL of the page that shows the first environment with `human`; empty before the first reset."""
        return "" if self._view is None else self._view.page_url

    def close_extras(self, **_: Any) -> None:  # noqa: ANN401 - Gymnasium's own form
        """Stop the server of the page, if there is one."""
        if self._view is not None:
            self._view.close()
            self._view = None

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """Return a seed, or None, for each environment.

        Raises:
            ValueError: there are more or fewer, or something else.
        """
        if seed is None:
            return [None] * self.num_envs
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int | np.integer) else list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: expected {self.num_envs} seeds, one for each environment, got {len(seeds)}")
        for number in seeds:
            if number is not None and (not isinstance(number, int | np.integer) or number < 0):
                raise ValueError(f"seed: expected whole numbers from 0 on, or None, got {number!r}")
        return [None if number is None else int(number) for number in seeds]

    def _show(self) -> None:
        if self.render_mode == "human":
            if self._view is None:
                from rosbridge_sim.environments.human_view import HumanView  # noqa: PLC0415 - a server, seldom wanted

                assert isinstance(self.worlds, Worlds)
                self._view = HumanView(self.worlds, self.task.scenario)
            self._view.show()

    def _begin(self, mask: npt.NDArray[np.bool_]) -> None:
        self.episodes.begin(mask)
        self._is_done[mask] = False

    def _infos(self, result: Judgement) -> dict[str, Any]:
        """Return speed, offset, the kinds of failure and the score, with Gymnasium's masks."""
        figures = self.episodes.figures(result)
        if not self.has_masks:
            return figures
        every = np.ones(self.num_envs, dtype=bool)
        figures["score"] |= {f"_{name}": every for name in result.scores}
        return {**figures, **{f"_{name}": every for name in figures}}

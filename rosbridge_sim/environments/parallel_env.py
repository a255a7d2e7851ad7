"""Several egos in one world, each of them an agent of PettingZoo."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Discrete, Space
from pettingzoo import ParallelEnv

from rosbridge_sim.environments.driving_task import EPISODE_STEPS, read_task
from rosbridge_sim.environments.episodes import Episodes
from rosbridge_sim.environments.judgement import Index
from rosbridge_sim.environments.observations import Seen, pick, pick_figures, space_of
from rosbridge_sim.environments.top_view import draw
from rosbridge_sim.worlds.worlds import Worlds

Array = npt.NDArray[Any]
Figures = dict[str, Any]

ALL_EGOS: Final[Index] = (0, slice(None))

SLOWER: Final = 4
"""`DiscreteMeta` of an ego whose episode has ended."""


class DrivingParallelEnv(ParallelEnv[str, Seen, Any]):
    """Egos that drive in one world, each by its own agent: `ego_0`, `ego_1`, ...

    Each has the observation, the action and the reward that an environment of one ego has. An ego whose episode has
    ended brakes, and stays where it is.

    Args:
        max_episode_steps: steps after which all episodes are truncated; None for no end.
        render_mode: `rgb_array` or None.
        options: those of `DrivingTask`; the egos begin on the lanes of `start_lane`, 25 m apart at least.

    Raises:
        ValueError: an option is out of range.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10, "name": "rosbridge_sim_drive"}  # noqa: RUF012

    def __init__(
        self,
        num_egos: int = 4,
        *,
        render_mode: str | None = None,
        max_episode_steps: int | None = EPISODE_STEPS,
        **options: Any,  # noqa: ANN401 - those of DrivingTask
    ) -> None:
        defaults: dict[str, Any] = {"scenario": "town", "observation": "Kinematics", "lights": True}
        if "scenario" not in options:
            defaults |= {"start_lane": "R*L1", "start_s": None, "start_speed": 5.0, "target_speed": 10.0}
        self.task = read_task({**defaults, **options})
        if num_egos > 1 and not self.task.start_lane:
            raise ValueError("start_lane: expected the lanes on which several egos begin, got ''")
        self.worlds = Worlds(self.task.scenario, seed=[0], traffic=self.task.traffic, egos=num_egos)
        self.episodes = Episodes(self.worlds, self.task, ALL_EGOS)
        self.render_mode, self._max_steps = render_mode, max_episode_steps
        self.metadata = {**self.metadata, "render_fps": self.episodes.fps}
        self.possible_agents = [f"ego_{i}" for i in range(num_egos)]
        self.agents: list[str] = []
        self._observation_spaces = {agent: space_of(self.task, self.worlds) for agent in self.possible_agents}
        self._action_spaces = {agent: deepcopy(self.episodes.action.space) for agent in self.possible_agents}

    def observation_space(self, agent: str) -> Space[Any]:
        """Return the space of the observations of an agent."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Any]:
        """Return the space of the actions of an agent."""
        return self._action_spaces[agent]

    def reset(self, seed: int | None = None, options: Figures | None = None) -> tuple[dict[str, Seen], Figures]:
        """Begin a new episode of all agents; return their observations and infos. There are no `options`."""
        del options
        if seed is not None:
            self.episodes.seed(0, seed)
        self.agents = list(self.possible_agents)
        self.episodes.begin(np.ones(1, dtype=bool))
        figures = self.episodes.figures(self.episodes.judge())
        return self._by_agent(self.episodes.observe()), self._infos(figures)

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Seen], dict[str, float], dict[str, bool], dict[str, bool], Figures]:
        """Drive for `frame_skip` frames.

        Args:
            actions: of all agents that are left.

        Returns:
            Observations, rewards, terminated, truncated and infos of these agents. Those that have ended are no
            agents any more.

        Raises:
            ValueError: an agent has no action, or one of another shape. Nothing has moved.
        """
        missing = [agent for agent in self.agents if agent not in actions]
        if missing:
            raise ValueError(f"actions: expected one of each agent, got none of {', '.join(missing)}")
        braking: Any = SLOWER if isinstance(self.episodes.action.space, Discrete) else (0.0, -1.0)
        chosen = [actions[agent] if agent in self.agents else braking for agent in self.possible_agents]
        result = self.episodes.judge(self.episodes.step(np.asarray(chosen)))
        is_late = bool(self.episodes.is_late(self._max_steps)[0])
        seen, infos = self._by_agent(self.episodes.observe()), self._infos(self.episodes.figures(result))
        rewards = self._by_agent(result.reward.tolist())
        terminated = self._by_agent(result.is_over.tolist())
        truncated = {agent: is_late and not terminated[agent] for agent in self.agents}
        self.agents = [agent for agent in self.agents if not (terminated[agent] or truncated[agent])]
        return seen, rewards, terminated, truncated, infos

    def render(self) -> Array | None:
        """Return a picture around the first ego, (400, 600, 3) uint8; None without a `render_mode`."""
        return None if self.render_mode is None else draw(self.worlds, 0, self.episodes.starts.goals[0])

    def close(self) -> None:
        """Do nothing: there is nothing to free."""

    def _by_agent(self, values: Any) -> dict[str, Any]:  # noqa: ANN401 - of all egos
        numbers = [self.possible_agents.index(agent) for agent in self.agents]
        return {agent: pick(values, i) for agent, i in zip(self.agents, numbers, strict=True)}

    def _infos(self, figures: Figures) -> Figures:
        return {agent: pick_figures(figures, self.possible_agents.index(agent)) for agent in self.agents}

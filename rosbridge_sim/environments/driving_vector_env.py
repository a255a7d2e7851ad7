"""Many environments as one set of arrays, by `rosbridge_sim.Worlds`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from rosbridge_sim.environments.driving_task import CLEAR, MAX_ACCEL, MAX_STEER, DrivingTask, Judgement, judge, observe
from rosbridge_sim.environments.picture import draw
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.worlds.worlds import Worlds

__all__ = ["DrivingVectorEnv"]

Array = npt.NDArray[Any]

FPS: Final = 10


class DrivingVectorEnv(VectorEnv[Array, Array, Array]):
    """Environments in which the ego of each world is driven; see `DrivingTask` for the options.

    An action has two numbers within -1..1: steering, left positive, times `MAX_STEER`, and acceleration times
    `MAX_ACCEL`. Environment i does what `DrivingEnv` does with the seed of i.

    Args:
        num_envs: number of environments.
        render_mode: `rgb_array` or None.
        autoreset_mode: when an environment that has ended begins again; see Gymnasium.
        options: those of `DrivingTask`.

    Raises:
        ValueError: an option is out of range.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **options: Any,  # noqa: ANN401 - those of DrivingTask
    ) -> None:
        self.task = DrivingTask(**options)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": FPS, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = Box(-1.0, 1.0, self.task.shape, np.float32)
        self.single_action_space = Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.worlds = Worlds(self.task.scenario, num_envs, seed=[0] * num_envs, traffic=self.task.traffic)
        if not self.worlds.has_ego[:, :1].all():
            raise ValueError(f"scenario: expected one with an ego, got {self.task.scenario!r}")
        self._start = self._find_start()
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        self._is_done = np.zeros(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: one for each environment, or s for s, s + 1, ...; None for chance that goes on.
            options: `reset_mask`, (num_envs,) bool, which environments begin anew; the others stay.

        Returns:
            Observations (num_envs, ...) and infos.
        """
        mask = np.ones(self.num_envs, dtype=bool)
        if options is not None and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"])
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        for i in mask.nonzero()[0].tolist() if seeds is not None else ():
            if seeds is not None and seeds[i] is not None:
                self._rngs[i] = np.random.default_rng(seeds[i])
        self._begin(mask)
        return observe(self.worlds, self.task), self._infos(self._judge_nothing())

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Drive for `frame_skip` frames.

        Args:
            actions: (num_envs, 2) within -1..1.

        Returns:
            Observations, rewards, terminated, truncated and infos.

        Raises:
            ValueError: the actions have another shape. Nothing has moved.
        """
        chosen = np.asarray(actions, dtype=np.float64)
        if chosen.shape != (self.num_envs, 2):
            raise ValueError(f"actions: expected shape ({self.num_envs}, 2), got {chosen.shape}")
        chosen = np.clip(chosen, -1.0, 1.0)
        begins = self._is_done & (self.autoreset_mode == AutoresetMode.NEXT_STEP)
        commands = {"steering": MAX_STEER * chosen[:, :1], "accel": MAX_ACCEL * chosen[:, 1:]}
        self.worlds.step(commands, self.task.frame_skip)
        if begins.any():
            self._begin(begins)
        result = judge(self.worlds, self.task, chosen)
        frames = self.worlds.frames
        terminated = result.is_over & ~begins
        truncated = (frames * self.worlds.dt >= self.task.duration - 1e-9) & ~begins & ~terminated
        rewards = np.where(begins, 0.0, result.reward)
        infos = self._infos(result)
        self._is_done = terminated | truncated
        seen = observe(self.worlds, self.task)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._is_done.any():
            done = self._is_done.copy()
            last = np.full(self.num_envs, None, dtype=object)
            for i in done.nonzero()[0].tolist():
                last[i] = seen[i].copy()
            final = infos
            self._begin(done)
            infos = self._infos(self._judge_nothing())
            infos |= {"final_obs": last, "_final_obs": done, "final_info": final, "_final_info": done}
            seen = observe(self.worlds, self.task)
        return seen, rewards, terminated, truncated, infos

    def render(self) -> tuple[Array, ...] | None:
        """Return a picture of each world from above, (400, 600, 3) uint8; None without a `render_mode`."""
        if self.render_mode is None:
            return None
        return tuple(draw(self.worlds, i) for i in range(self.num_envs))

    def _begin(self, mask: npt.NDArray[np.bool_]) -> None:
        seeds: list[int | None] = [None] * self.num_envs
        for i in mask.nonzero()[0].tolist():
            seeds[i] = int(self._rngs[i].integers(self.task.num_starts))
        self.worlds.reset(mask, seeds)
        if self._start is not None:
            for i in mask.nonzero()[0].tolist():
                self._place(i, self._start)
        self._is_done[mask] = False

    def _find_start(self) -> tuple[float, float, float, float] | None:
        """Return x, y, z and yaw of `start_lane`; None without one."""
        task, roads = self.task, self.worlds.world(0).roads.alone
        if not task.start_lane:
            return None
        if task.start_lane not in roads.ids:
            raise ValueError(f"start_lane: expected a lane of the map of {task.scenario!r}, got {task.start_lane!r}")
        place, yaw = roads.at([roads.row(task.start_lane)], [task.start_s])
        return *place[0].tolist(), float(yaw[0])

    def _place(self, number: int, start: tuple[float, float, float, float]) -> None:
        """Place the ego of a world, and take away what is near it."""
        world, (x, y, z, yaw) = self.worlds.world(number), start
        is_near = world.alive & (world.kind != Kind.EGO) & (np.hypot(world.x - x, world.y - y) < CLEAR)
        for uid in world.uid[is_near].tolist():
            self.worlds.remove(number, uid)
        self.worlds.place(number, x=x, y=y, z=z, yaw=yaw, speed=self.task.start_speed)

    def _judge_nothing(self) -> Judgement:
        return judge(self.worlds, self.task, np.zeros((self.num_envs, 2)))

    def _infos(self, result: Judgement) -> dict[str, Any]:
        """Return speed, offset, the kinds of failure and the score, with Gymnasium's masks."""
        every = np.ones(self.num_envs, dtype=bool)
        figures = {name: getattr(result, name) for name in ("speed", "offset", "has_collided", "is_off_road")}
        figures["distance"] = result.scores["score_distance"]
        score = {**result.scores, **{f"_{name}": every for name in result.scores}}
        return {**figures, "score": score, **{f"_{name}": every for name in (*figures, "score")}}

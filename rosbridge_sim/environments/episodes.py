"""Episodes of many worlds, or of several egos in one world: what all environments here have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.environments.action_kinds import make_action
from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.environments.judgement import Index, Judgement
from rosbridge_sim.environments.observations import AHEAD, Lanes, Seen, observe, pick
from rosbridge_sim.environments.rewards import judge
from rosbridge_sim.environments.starts import Starts
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

if TYPE_CHECKING:
    from rosbridge_sim.environments.camera import EgoCameras

BoolArray = npt.NDArray[np.bool_]

FIRST_EGOS: Final[Index] = (slice(None), 0)

_FIGURES: Final = ("speed", "offset", "has_collided", "is_off_road", "is_wrong_way", "has_arrived")


class Episodes:
    """Episodes of n egos.

    Attributes:
        worlds: moved by `step`.
        action: the kind of actions.
        starts: begin and goals.

    Raises:
        ValueError: a world has no ego, or an option does not fit the map.
    """

    def __init__(self, worlds: SteppedWorlds, task: DrivingTask, at: Index = FIRST_EGOS) -> None:
        if not worlds.has_ego[:, :1].all():
            raise ValueError(f"scenario: expected one with an ego, got {task.scenario!r}")
        self.worlds, self.task, self._at = worlds, task, at
        self.starts = Starts(worlds, task)
        self.action = make_action(worlds, task, at)
        self._rngs = [np.random.default_rng() for _ in range(worlds.num_worlds)]
        self._num = len(worlds.has_ego[at])
        self._red_lights = np.zeros(self._num)
        self._lanes: Lanes | None = None
        self._sees_lanes = task.observation in {"Lane", "Kinematics", "Goal", "Dict"}
        self._cameras = _mount_cameras(worlds, task) if task.has_camera else None

    def seed(self, number: int, seed: int) -> None:
        """Set the chance of the episodes of one world."""
        self._rngs[number] = np.random.default_rng(seed)

    def begin(self, mask: BoolArray) -> None:
        """Begin new episodes of some worlds, (num_worlds,) bool."""
        worlds, chosen = self.worlds, mask.nonzero()[0].tolist()
        self._lanes = None
        seeds: list[int | None] = [None] * worlds.num_worlds
        for i in chosen:
            seeds[i] = int(self._rngs[i].integers(self.task.num_starts))
        worlds.reset(mask, seeds)
        for i in chosen:
            self.starts.begin(i, self._rngs[i])
        self.action.begin(mask)

    def step(self, actions: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Drive for `frame_skip` frames; return the actions as (n, 2) numbers.

        Raises:
            ValueError: the actions have another shape. Nothing has moved.
        """
        chosen = self.action.check(actions, self._num)
        self._lanes = None
        if self.task.all_weights["red_light"]:
            self._red_lights = self.worlds.scores()["num_red_lights"][self._at]
        self.worlds.step(self.action.command(chosen), self.task.frame_skip)
        return chosen

    def judge(self, chosen: npt.NDArray[np.float64] | None = None) -> Judgement:
        """Return what the step with these actions was worth; None for none yet."""
        scores_before = self._red_lights
        if chosen is None:
            chosen = np.zeros((self._num, 2))
            scores_before = self.worlds.scores()["num_red_lights"][self._at]
        starts = self.starts
        lanes = self.worlds.lanes(AHEAD if self._sees_lanes else ())
        self._lanes = lanes if self._sees_lanes else None
        return judge(
            self.worlds,
            self.task,
            chosen,
            at=self._at,
            lanes=lanes,
            goals=starts.goals,
            goal_lanes=starts.goal_lanes[self._at],
            red_lights=scores_before,
        )

    def observe(self) -> Seen:
        """Return the observations, (n, ...). The lanes of a judgement of this moment are those that are seen."""
        lanes, self._lanes = self._lanes, None
        return pick(observe(self.worlds, self.task, self.starts.goals, self._cameras, lanes), self._at)

    def is_late(self, max_steps: int | None) -> BoolArray:
        """Return which worlds have driven for so many steps of an episode, (num_worlds,) bool; None for no end."""
        if max_steps is None:
            return np.zeros(self.worlds.num_worlds, dtype=bool)
        return np.asarray(self.worlds.frames >= max_steps * self.task.frame_skip)

    @property
    def fps(self) -> float:
        """Steps in a second of the world, for pictures and films [1/s]."""
        return 1.0 / (self.worlds.dt * self.task.frame_skip)

    def figures(self, result: Judgement) -> dict[str, Any]:
        """Return what `infos` have of a judgement, (n,) each, and the figures of the score in `score`."""
        figures = {name: getattr(result, name) for name in _FIGURES}
        return {**figures, "distance": result.scores["score_distance"], "score": dict(result.scores)}


def _mount_cameras(worlds: SteppedWorlds, task: DrivingTask) -> EgoCameras:
    from rosbridge_sim.environments.camera import EgoCameras  # noqa: PLC0415 - what draws is in the extra `sensors`

    return EgoCameras(worlds, task.camera_width, task.camera_height)

"""Observations of egos: for each name the bounds of its figures, and a function that measures them.

All figures are seen from the ego: x forward, y to the left. They are cut at their bounds. Normalised ones are divided
by them, so they are within -1..1; the others are in SI units and radians.

`Lane`           the ego on its lane, `LANE_FIGURES`, and with the option `lights` `LIGHT_FIGURES` behind them
`Others`         (num_others, 9), the nearest entities, `worlds.surroundings.OTHER_FIGURES`
`Kinematics`     `Lane` and `Others` in one row
`OccupancyGrid`  (4, n, n), `worlds.occupancy.GRID_FIGURES`
`Lidar`          (num_rays, 2), `worlds.rays.RAY_FIGURES`
`Camera`         (camera_height, camera_width, 3) uint8, a picture from behind the windscreen; see `camera`
`Dict`           the option `parts` by name
`Goal`           as environments with goals have it: `observation` (`Kinematics`), `achieved_goal` and `desired_goal`
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box, Dict, Space

from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.worlds.drivable_worlds import DrivableWorlds
from rosbridge_sim.worlds.occupancy import num_cells

if TYPE_CHECKING:
    from rosbridge_sim.environments.camera import EgoCameras

Lanes = dict[str, FloatArray]
"""Figures of lanes by name; see `DrivableWorlds.lanes`."""

Seen = Any
"""An array, or a dict of arrays."""

AHEAD: Final = (5.0, 10.0, 20.0, 40.0)
"""Distances along the lane of the places that are observed [m]."""

LANE_FIGURES: Final = {
    "speed": 40.0,
    "offset": 4.0,
    "heading": math.pi,
    "to_left": 8.0,
    "to_right": 8.0,
    "steering": 0.5,
    "yaw_rate": 1.0,
    **{f"{axis}_{int(distance)}": AHEAD[-1] for distance in AHEAD for axis in ("x", "y")},
}
"""Figures of `Lane`, and their bounds."""

LIGHT_FIGURES: Final = {"to_light": 100.0, "must_stop": 1.0}
"""Distance to the end of the lane before the next light straight on, at most 100 m; and 1 if it is red or yellow."""

OTHER_BOUNDS: Final = (1.0, 100.0, 100.0, 40.0, 40.0, 1.0, 1.0, 20.0, 5.0)

GRID_BOUNDS: Final = (1.0, 40.0, 40.0, 1.0)

RAY_SPEED: Final = 40.0

GOAL_FIGURES: Final = {"x": 100.0, "y": 100.0, "vx": 5.0, "vy": 5.0, "cos": 1.0, "sin": 1.0}
"""Figures of goals in the frame of the map: middle of the body, velocity, heading; bounds only scale places."""


MAX_GOAL: Final = 1e6
"""Beyond every figure of a goal: places of maps are within 1e8 m, divided by 100 m."""


def _lane_bounds(task: DrivingTask) -> FloatArray:
    return np.array([*LANE_FIGURES.values(), *(LIGHT_FIGURES.values() if task.lights else ())])


def _see_lane(worlds: DrivableWorlds, task: DrivingTask, lanes: Lanes | None) -> FloatArray:
    egos = worlds.egos(("speed", "steer", "yaw_rate"))
    if lanes is None:
        lanes = worlds.lanes(AHEAD)
    points = lanes["points"].reshape(*egos["speed"].shape, -1)
    columns = [
        *(egos["speed"], lanes["offset"], lanes["heading"], lanes["to_left"], lanes["to_right"]),
        *(egos["steer"], egos["yaw_rate"], *(points[..., i] for i in range(points.shape[-1]))),
    ]
    if task.lights:
        lights = worlds.lights()
        columns += [np.fmin(lights["distance"], LIGHT_FIGURES["to_light"]), lights["must_stop"]]
    found = np.empty((*egos["speed"].shape, len(columns)))
    for i, values in enumerate(columns):
        found[..., i] = values
    return found


def _others_bounds(task: DrivingTask) -> FloatArray:
    return np.tile(np.array(OTHER_BOUNDS), (task.num_others, 1))


def _see_others(worlds: DrivableWorlds, task: DrivingTask, _lanes: Lanes | None) -> FloatArray:
    return worlds.others(task.num_others)


def _kinematics_bounds(task: DrivingTask) -> FloatArray:
    return np.concatenate([_lane_bounds(task), _others_bounds(task).ravel()])


def _see_kinematics(worlds: DrivableWorlds, task: DrivingTask, lanes: Lanes | None) -> FloatArray:
    others = _see_others(worlds, task, lanes)
    return np.concatenate([_see_lane(worlds, task, lanes), others.reshape(*others.shape[:2], -1)], axis=-1)


def _grid_bounds(task: DrivingTask) -> FloatArray:
    num = num_cells(task.grid_size, task.grid_step)
    return np.tile(np.array(GRID_BOUNDS)[:, None, None], (1, num, num))


OBSERVATION_PARTS: Final[
    dict[
        str,
        tuple[Callable[[DrivingTask], FloatArray], Callable[[DrivableWorlds, DrivingTask, Lanes | None], FloatArray]],
    ]
] = {
    "Lane": (_lane_bounds, _see_lane),
    "Others": (_others_bounds, _see_others),
    "Kinematics": (_kinematics_bounds, _see_kinematics),
    "OccupancyGrid": (_grid_bounds, lambda worlds, task, _: worlds.grids(task.grid_size, task.grid_step)),
    "Lidar": (
        lambda task: np.tile(np.array([task.lidar_range, RAY_SPEED]), (task.num_rays, 1)),
        lambda worlds, task, _: worlds.rays(task.num_rays, task.lidar_range),
    ),
}


@lru_cache(maxsize=64)
def bounds_of(name: str, task: DrivingTask) -> FloatArray:
    """Return the greatest amounts of the figures of an observation that is one array, in its shape, in SI units."""
    bounds = OBSERVATION_PARTS[name][0](task)
    bounds.flags.writeable = False
    return bounds


def space_of(task: DrivingTask, worlds: DrivableWorlds) -> Space[Any]:
    """Return the space of the observations of one ego.

    Raises:
        ValueError: the user's function returns something else than figures of all egos.
    """
    if callable(task.observation):
        return Box(-np.inf, np.inf, _see_own(worlds, task.observation).shape[2:], np.float32)
    if task.observation == "Dict":
        return Dict({name: _box(name, task) for name in task.parts})
    if task.observation == "Goal":
        figures = np.array(list(GOAL_FIGURES.values()))
        goal = Box(-MAX_GOAL, MAX_GOAL, figures.shape, np.float32)
        seen = _box("Kinematics", task)
        return Dict({"observation": seen, "achieved_goal": goal, "desired_goal": goal})
    return _box(task.observation, task)


def observe(
    worlds: DrivableWorlds,
    task: DrivingTask,
    goals: FloatArray | None = None,
    cameras: EgoCameras | None = None,
    lanes: Lanes | None = None,
) -> Seen:
    """Return the observations of all egos, (num_worlds, num_egos, ...) float32, or a dict of them.

    Args:
        goals: (num_worlds, num_egos, 3) east and north of the middle of the bay, and the heading in it; nan without.
            Only `Goal` has them.
        cameras: of these worlds; only `Camera` needs them.
        lanes: the lanes as they are now, with places at `AHEAD`, if they are known.
    """
    if callable(task.observation):
        return _see_own(worlds, task.observation)
    if task.observation == "Dict":
        return {name: _see(name, worlds, task, cameras, lanes) for name in task.parts}
    if task.observation == "Goal":
        assert goals is not None
        seen = _see("Kinematics", worlds, task, lanes=lanes)
        return {"observation": seen, "achieved_goal": achieved_goals(worlds), "desired_goal": desired_goals(goals)}
    return _see(task.observation, worlds, task, cameras, lanes)


def pick(seen: Seen, index: Any) -> Seen:  # noqa: ANN401 - whatever numpy takes
    """Return `seen[index]`, of a dict of arrays from each of them."""
    return {name: part[index] for name, part in seen.items()} if isinstance(seen, dict) else seen[index]


def pick_figures(figures: dict[str, Any], number: int) -> dict[str, Any]:
    """Return the figures of one environment or ego, as Python's numbers, from arrays of those of all."""
    return {
        name: pick_figures(values, number) if isinstance(values, dict) else values[number].item()
        for name, values in figures.items()
    }


def _box(name: str, task: DrivingTask) -> Box:
    if name == "Camera":
        return Box(0, 255, (task.camera_height, task.camera_width, 3), np.uint8)
    bounds = bounds_of(name, task)
    high = np.ones(bounds.shape, np.float32) if task.normalize else bounds.astype(np.float32)
    return Box(-high, high, bounds.shape, np.float32)


def _see(
    name: str,
    worlds: DrivableWorlds,
    task: DrivingTask,
    cameras: EgoCameras | None = None,
    lanes: Lanes | None = None,
) -> npt.NDArray[Any]:
    if name == "Camera":
        assert cameras is not None
        return cameras.draw()
    bounds, figures = bounds_of(name, task), OBSERVATION_PARTS[name][1](worlds, task, lanes)
    if task.normalize:
        return np.minimum(np.maximum(figures / bounds, -1.0), 1.0).astype(np.float32)
    return np.minimum(np.maximum(figures, -bounds), bounds).astype(np.float32)


def _see_own(worlds: Any, function: Callable[..., npt.ArrayLike]) -> npt.NDArray[np.float32]:  # noqa: ANN401 - what it takes
    """Return what the user's function returns.

    Raises:
        ValueError: it is no array of figures of all egos.
    """
    found = np.asarray(function(worlds), dtype=np.float32)
    shape = worlds.has_ego.shape
    if found.shape[:2] != shape:
        raise ValueError(f"observation: expected shape {shape} and more from the function, got {found.shape}")
    return found


def achieved_goals(worlds: DrivableWorlds) -> npt.NDArray[np.float32]:
    """Return `GOAL_FIGURES` of the egos, divided by their bounds, (num_worlds, num_egos, 6)."""
    egos = worlds.egos(("x", "y", "yaw", "speed", "lateral_speed", "centre"))
    cos, sin = np.cos(egos["yaw"]), np.sin(egos["yaw"])
    figures = [
        *(egos["x"] + egos["centre"] * cos, egos["y"] + egos["centre"] * sin),
        *(egos["speed"] * cos - egos["lateral_speed"] * sin, egos["speed"] * sin + egos["lateral_speed"] * cos),
        *(cos, sin),
    ]
    return _scaled(figures)


def desired_goals(goals: FloatArray) -> npt.NDArray[np.float32]:
    """Return `GOAL_FIGURES` of goals (..., 3), at rest, divided by their bounds, (..., 6)."""
    x, y, yaw = (goals[..., i] for i in range(3))
    zero = np.zeros(x.shape)
    return _scaled([x, y, zero, zero, np.cos(yaw), np.sin(yaw)])


def _scaled(figures: list[FloatArray]) -> npt.NDArray[np.float32]:
    return np.asarray(np.stack(figures, axis=-1) / np.array(list(GOAL_FIGURES.values())), dtype=np.float32)

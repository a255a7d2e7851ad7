"""Names of the environments in Gymnasium's registry."""

from __future__ import annotations

from dataclasses import asdict
from typing import Final

import gymnasium

from rosbridge_sim.environments.driving_task import DrivingTask

__all__ = ["REMOTE", "TASKS", "register_all"]

REMOTE: Final = "rosbridge_sim/RemoteDrive-v0"
"""`Drive-v0` in the world of a server."""

TASKS: Final[dict[str, DrivingTask]] = {
    "rosbridge_sim/LaneKeeping-v0": DrivingTask("loop", observation="Lane", target_speed=15.0),
    "rosbridge_sim/Highway-v0": DrivingTask("motorway", traffic=20, observation="Kinematics", target_speed=30.0),
    "rosbridge_sim/Merge-v0": DrivingTask(
        "motorway",
        traffic=20,
        observation="Kinematics",
        target_speed=25.0,
        start_lane="E0",
        start_s=20.0,
        start_speed=15.0,
    ),
    "rosbridge_sim/Roundabout-v0": DrivingTask("roundabout", traffic=8, observation="Kinematics", target_speed=8.0),
    "rosbridge_sim/Intersection-v0": DrivingTask(
        "town",
        traffic=12,
        observation="Kinematics",
        lights=True,
        target_speed=10.0,
        start_lane="R*L1",
        start_s=-40.0,
        start_speed=8.0,
        goal="lane",
        goal_lane="R*",
        goal_s=15.0,
        weights={"red_light": 10.0, "arrived": 10.0},
    ),
    "rosbridge_sim/Parking-v0": DrivingTask(
        "parking",
        observation="Goal",
        reverses=True,
        target_speed=2.0,
        duration=60.0,
        goal="bay",
        goal_lane="B[AB]*",
        weights={"speed": 0.0, "offset": 0.0, "steering": 0.0, "failure": 5.0, "goal": 1.0},
    ),
    "rosbridge_sim/Drive-v0": DrivingTask("town", observation="Kinematics", target_speed=12.0),
}


def register_all() -> None:
    """Register all environments; those that are registered already stay as they are."""
    for name, task in TASKS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="rosbridge_sim.environments.driving_env:DrivingEnv",
                vector_entry_point="rosbridge_sim.environments.driving_vector_env:DrivingVectorEnv",
                kwargs=asdict(task),
            )
    if REMOTE not in gymnasium.registry:
        gymnasium.register(
            REMOTE,
            entry_point="rosbridge_sim.environments.remote_env:RemoteDrivingEnv",
            kwargs=asdict(TASKS["rosbridge_sim/Drive-v0"]),
        )

"""Names of the environments in Gymnasium's registry."""

from __future__ import annotations

from dataclasses import asdict
from typing import Final

import gymnasium

from rosbridge_sim.environments.driving_task import EPISODE_STEPS, DrivingTask

REMOTE: Final = "rosbridge_sim/RemoteDrive-v0"
"""`Drive-v0` in the world of a server."""

TASKS: Final[dict[str, DrivingTask]] = {
    "rosbridge_sim/LaneKeeping-v1": DrivingTask(
        "loop",
        observation="Lane",
        target_speed=15.0,
        # Start anywhere on the lap: the first 600 m of the scenario are straight, so a driver need not see the lane.
        start_lane="L?_*",
        start_s=None,
    ),
    "rosbridge_sim/Highway-v1": DrivingTask(
        "motorway",
        traffic=20,
        observation="Kinematics",
        target_speed=30.0,
        # Start in the traffic: from a stop on a free lane, a driver that ignores other vehicles met none in 40 s.
        start_lane="L[123]_*",
        start_s=None,
        start_speed=25.0,
    ),
    "rosbridge_sim/Merge-v0": DrivingTask(
        "motorway",
        traffic=20,
        observation="Kinematics",
        target_speed=25.0,
        start_lane="E0",
        start_s=20.0,
        start_speed=15.0,
    ),
    "rosbridge_sim/Roundabout-v1": DrivingTask(
        "roundabout",
        traffic=8,
        observation="Kinematics",
        target_speed=8.0,
        # A driver that never gives way makes others brake, and is 3 s faster for it. At 10 that still paid.
        weights={"near_miss": 20.0},
    ),
    "rosbridge_sim/Intersection-v1": DrivingTask(
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
        # What can be earned behind the light is 40 for the way and 10 for arriving: to pass it never pays, whatever the
        # discount.
        weights={"red_light": 50.0, "arrived": 10.0},
    ),
    "rosbridge_sim/Parking-v1": DrivingTask(
        "parking",
        observation="Goal",
        reverses=True,
        target_speed=2.0,
        goal="bay",
        goal_lane="B[AB]*",
        max_distance=60.0,
        # 600 steps cost less than a failure, so that it never pays to end an episode by a crash.
        weights={"speed": 0.0, "offset": 0.0, "steering": 0.0, "goal": 0.02, "arrived": 10.0},
    ),
    "rosbridge_sim/Drive-v0": DrivingTask("town", observation="Kinematics", target_speed=12.0),
}


_STEPS: Final = {"rosbridge_sim/Parking-v1": 600}
"""Steps of episodes that are not `EPISODE_STEPS`."""


def register_all() -> None:
    """Register all environments; those that are registered already stay as they are."""
    for name, task in TASKS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="rosbridge_sim.environments.driving_env:DrivingEnv",
                vector_entry_point="rosbridge_sim.environments.driving_vector_env:DrivingVectorEnv",
                max_episode_steps=_STEPS.get(name, EPISODE_STEPS),
                kwargs=asdict(task),
            )
    if REMOTE not in gymnasium.registry:
        gymnasium.register(
            REMOTE,
            entry_point="rosbridge_sim.environments.remote_env:RemoteDrivingEnv",
            max_episode_steps=EPISODE_STEPS,
            kwargs=asdict(TASKS["rosbridge_sim/Drive-v0"]),
        )

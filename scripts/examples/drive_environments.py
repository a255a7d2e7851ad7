"""Drive the environments for Gymnasium with random actions and by a rule, and print what both reach.

The rule steers towards the line of the lane 10 m ahead (pure pursuit), wants the target speed, and keeps a gap of 1.2 s
and 8 m to what is ahead. Needs the extra `gym`.

    python scripts/examples/drive_environments.py --episodes 16
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.environments.registration import TASKS, register_all

NUM_LANE = 15
"""Figures of `Lane`, behind which those of the other entities begin."""

Policy = Callable[[Any], Any]


def by_rule(seen: Any, target: float) -> Any:  # noqa: ANN401 - arrays
    """Return actions (n, 2) for observations (n, ...)."""
    forward, left, speed = 40.0 * seen[:, 9], 40.0 * seen[:, 10], 40.0 * seen[:, 0]
    steering = 12.0 * left / np.maximum(forward**2 + left**2, 1.0)
    accel = (target - speed) / 8.0
    if seen.shape[1] > NUM_LANE:
        is_there, x, y, vx = (seen[:, NUM_LANE:].reshape(len(seen), -1, 9)[..., i] for i in range(4))
        is_ahead = (is_there > 0.0) & (x > 0.0) & (np.abs(100.0 * y) < 2.0)
        gap = np.where(is_ahead, 100.0 * x, np.inf).min(axis=1)
        closing = np.where(is_ahead, -40.0 * vx, 0.0).max(axis=1)
        wanted = np.where(np.isfinite(gap), 0.3 * (gap - 8.0 - 1.2 * speed) - 0.6 * closing, np.inf)
        accel = np.minimum(accel, wanted / 4.0)
    return np.clip(np.stack([steering, accel], axis=1), -1.0, 1.0)


def drive(name: str, policy: Policy, num: int) -> tuple[float, float, float]:
    """Return means over episodes: the sum of rewards, the time [s] and the distance [m]."""
    envs = gymnasium.make_vec(
        name,
        num_envs=num,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
    )
    seen, _ = envs.reset(seed=0)
    total, steps, distance, is_on = np.zeros(num), np.zeros(num), np.zeros(num), np.ones(num, dtype=bool)
    while is_on.any():
        seen, rewards, terminated, truncated, infos = envs.step(policy(seen))
        total += rewards * is_on
        steps += is_on
        distance = np.where(is_on, infos["distance"], distance)
        is_on &= ~(terminated | truncated)
    return float(total.mean()), float(steps.mean()) / 10.0, float(distance.mean())


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each environment and driver."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=16)
    chosen = parser.parse_args(arguments)
    register_all()
    rng = np.random.default_rng(0)
    for name, task in TASKS.items():
        target = task.target_speed
        drivers: dict[str, Policy] = {
            "random": lambda seen: rng.uniform(-1.0, 1.0, (len(seen), 2)),
            "by rule": lambda seen, target=target: by_rule(seen, target),  # type: ignore[misc]
        }
        for driver, policy in drivers.items():
            reward, seconds, metres = drive(name, policy, chosen.episodes)
            print(f"{name:32} {driver:8} reward {reward:7.1f}  {seconds:5.1f} s  {metres:6.0f} m", flush=True)


if __name__ == "__main__":
    main()

"""Drive the environments for Gymnasium with random actions, by a rule and by exploits, and print their results.

The rule steers towards the line of the lane 10 m ahead (pure pursuit), wants the target speed, slows down for bends,
keeps a gap of 1.2 s and 2 m to what is on its way, and stops at red lights. It gives way to those who will be on its
way before it, as if they went straight on. In `Parking-v1` it drives past its bay and reverses into it in an arc.
Exploits try to earn rewards without doing the task, see `exploit_environments.py`. Needs the extra `gym`.

    python scripts/examples/drive_environments.py --episodes 16
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from exploit_environments import NUM_LANE, NUM_LIGHT, exploits_of

from rosbridge_sim.environments.action_kinds import MAX_ACCEL
from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.environments.observations import AHEAD, pick
from rosbridge_sim.environments.registration import TASKS, register_all

NOSE = 3.6
"""From the rear axle to the front bumper [m]."""

LATERAL = 2.0
"""Lateral acceleration in bends [m/s^2]."""

SCALES = np.array([1.0, 100.0, 100.0, 40.0, 40.0, 1.0, 1.0, 20.0, 5.0])
"""Bounds of the figures of `Others`, which normalised ones are divided by."""

WAYS_OF_LINE = np.array(AHEAD)
TIMES = np.arange(0.0, 3.1, 0.5)
"""Times for which the rule foresees where the others are [s]."""

_KNOTS = np.array([0.0, *AHEAD])
BETWEEN = (np.vander(np.arange(41.0), 5) @ np.linalg.inv(np.vander(_KNOTS, 5)))[:, 1:]
"""(41, 4) from the places of the lane's line to one for each metre: the polynomial through them, and through 0."""

DISCOUNT = 0.99
"""Usual discount of a step, for the second sum of rewards: it halves a reward in 7 s."""

Policy = Callable[[Any], Any]


def by_rule(seen: Any, task: DrivingTask) -> Any:  # noqa: ANN401 - arrays
    """Return actions (n, 2) for observations (n, ...)."""
    forward, left, speed = 40.0 * seen[:, 9], 40.0 * seen[:, 10], 40.0 * seen[:, 0]
    steering = 12.0 * left / np.maximum(forward**2 + left**2, 1.0)
    line = 40.0 * seen[:, 7:NUM_LANE].reshape(len(seen), -1, 2)
    accel = np.minimum((task.target_speed - speed) / 2.0, slow_down_for_bends(line, speed))
    begin = NUM_LANE + NUM_LIGHT * task.lights
    if task.lights:
        room = 100.0 * seen[:, NUM_LANE] - NOSE - 1.0
        may_stop = speed**2 < 2.0 * 3.0 * np.maximum(room, 0.0)
        brakes = -np.square(speed) / (2.0 * np.maximum(room, 0.3))
        must_stop = (seen[:, NUM_LANE + 1] > 0.0) & may_stop & (room < 40.0)
        accel = np.where(must_stop, np.minimum(accel, np.where(brakes < -1.0, brakes, accel)), accel)
        accel = np.where(must_stop & (room < 1.0), -MAX_ACCEL, accel)
    if seen.shape[1] > begin:
        others = seen[:, begin:].reshape(len(seen), -1, 9) * SCALES
        accel = np.minimum(accel, follow(line, speed, others))
    return np.clip(np.stack([steering, accel / MAX_ACCEL], axis=1), -1.0, 1.0)


def slow_down_for_bends(line: Any, speed: Any) -> Any:  # noqa: ANN401 - arrays
    """Return the accelerations (n,) with which bends are slow enough [m/s^2].

    Args:
        line: (n, 4, 2) places of the lane's line ahead [m].
        speed: (n,) [m/s].
    """
    places = np.concatenate([np.zeros_like(line[:, :1]), line], axis=1)
    steps = np.diff(places, axis=1)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[..., 1], steps[..., 0]), axis=1), axis=1))
    lengths = np.hypot(steps[..., 0], steps[..., 1])
    curvature = turns / np.maximum(0.5 * (lengths[:, :-1] + lengths[:, 1:]), 1.0)
    allowed = LATERAL / np.maximum(curvature, 1e-3)
    return ((allowed - speed[:, None] ** 2) / (2.0 * np.maximum(WAYS_OF_LINE[:-1] - 3.0, 1.0))).min(axis=1)


def follow(line: Any, speed: Any, others: Any) -> Any:  # noqa: ANN401 - arrays
    """Return the accelerations (n,) that keep gaps to those who are on the way, or will be before the ego [m/s^2].

    Args:
        line: (n, 4, 2) places of the lane's line ahead [m].
        speed: (n,) [m/s].
        others: (n, m, 9) in SI units.
    """
    # All figures have the axes (n, others, parts of a body, times).
    is_there, x, y, vx, vy, cos, sin, length, width = np.moveaxis(others, -1, 0)[..., None, None]
    speed = speed[:, None, None, None]
    vx = vx + speed
    part = 0.5 * length * np.array([-1.0, 0.0, 1.0])[:, None]
    places = np.stack([x + part * cos + vx * TIMES, y + part * sin + vy * TIMES], axis=-1)
    way = np.einsum("wk,nkc->nwc", BETWEEN, line)
    away = np.square(places.reshape(len(line), -1, 1, 2) - way[:, None]).sum(axis=-1)
    nearest, apart = away.argmin(axis=2), np.sqrt(away.min(axis=2))
    tangent = np.take_along_axis(np.gradient(way, axis=1), nearest[..., None], axis=1).reshape(places.shape)
    nearest, apart = nearest.reshape(places.shape[:-1]), apart.reshape(places.shape[:-1])
    is_behind = (x < 0.0) & (np.abs(y) < 1.5)
    is_on = (is_there > 0.0) & ~is_behind & (apart < 1.3 + 0.5 * width) & (nearest > NOSE)
    room = np.maximum(nearest - NOSE, 0.0)
    comes_first = is_on & (room / np.maximum(speed, 1.0) + 0.5 >= TIMES)
    pace = np.maximum(tangent[..., 0] * vx + tangent[..., 1] * vy, 0.0)
    gap = room - pace * TIMES  # to where it would be now, had it always been on the way
    wanted = 0.3 * (gap - 2.0 - 1.2 * speed) - 0.6 * (speed - pace)
    return np.where(comes_first, np.maximum(wanted, -MAX_ACCEL), np.inf).min(axis=(1, 2, 3))


class ParkByRule:
    """Past the bay, back in an arc with the wheels at 0.5 rad, and straight back; one state for each environment."""

    RADIUS, AISLE, CENTRE = 5.2, 5.5, 1.35
    """Of the arc of the rear axle; from the middle of the bay to that of the aisle; from the rear axle to that of the
    body [m]."""

    def __init__(self, num: int) -> None:
        self._is_back = np.zeros(num, dtype=bool)
        self._is_turning = np.zeros(num, dtype=bool)

    def __call__(self, seen: Any) -> Any:  # noqa: ANN401 - arrays
        """Return actions (n, 2) for observations of `Goal`."""
        lane, own, bay = (seen[name] for name in ("observation", "achieved_goal", "desired_goal"))
        speed, wheels = 40.0 * lane[:, 0], 0.5 * lane[:, 5]
        yaw, way = np.arctan2(own[:, 5], own[:, 4]), np.arctan2(bay[:, 5], bay[:, 4])
        turn = (yaw - way + np.pi) % (2.0 * np.pi) - np.pi
        east, north = 100.0 * (own[:, 0] - bay[:, 0]), 100.0 * (own[:, 1] - bay[:, 1])
        out = east * np.cos(way) + north * np.sin(way) - self.CENTRE * np.cos(turn)
        aside = north * np.cos(way) - east * np.sin(way) - self.CENTRE * np.sin(turn)
        side = np.sign(np.sin(turn))
        left = self.RADIUS - aside * side
        is_in_aisle = (np.abs(out - self.AISLE) < 1.0) & (np.abs(np.cos(turn)) < 0.2)
        steering = np.clip(12.0 * 40.0 * lane[:, 8] / np.maximum((40.0 * lane[:, 7]) ** 2, 1.0), -1.0, 1.0)
        along = 0.3 * (out - self.AISLE) * side - 2.0 * (turn - side * 0.5 * np.pi)
        steering = np.where(is_in_aisle & (left < 12.0), np.clip(along, -1.0, 1.0), steering)
        wanted = np.where(is_in_aisle & (left > -1.0), np.clip(0.5 * left, 0.0, 2.0), 3.0)
        self._is_turning |= is_in_aisle & (np.abs(left) < 0.15) & (np.abs(speed) < 0.1)
        accel = wanted - speed
        # With the wheels turned it goes back until it is nearly straight, then it steers to the line of the bay.
        self._is_back |= self._is_turning & (np.abs(turn) < 0.15)
        line = np.clip(4.0 * (turn - np.clip(0.3 * aside, -0.2, 0.2)), -1.0, 1.0)
        steering = np.where(self._is_back, line, np.where(self._is_turning, side, steering))
        is_ready = self._is_back | (np.abs(wheels - 0.5 * side) < 0.05)
        rest = out + self.CENTRE
        back = np.where(self._is_back, np.clip(0.5 * rest, 0.0, 1.0), 1.0)
        accel = np.where(self._is_turning, np.where(is_ready, -back - speed, 0.0), accel)
        accel = np.where(self._is_back & (rest < 0.1), np.where(speed < -0.02, 1.0, 0.0), accel)
        return np.clip(np.stack([steering, accel], axis=1), -1.0, 1.0)


def drivers_of(task: DrivingTask, num: int) -> dict[str, Policy]:
    """Return all drivers by name, each ready for `num` new episodes; the random one has a seed of its own."""
    rng = np.random.default_rng(0)

    def rule() -> Policy:
        return ParkByRule(num) if task.goal == "bay" else lambda seen: by_rule(seen, task)

    return {"random": lambda _: rng.uniform(-1.0, 1.0, (num, 2)), "by rule": rule(), **exploits_of(task, rule)}


def drive(name: str, policy: Policy, num: int) -> dict[str, float]:
    """Return the results of one driver; see `drive_all`."""
    return drive_all(name, {"": policy}, num)[""]


def drive_all(name: str, drivers: dict[str, Policy], num: int) -> dict[str, dict[str, float]]:
    """Return for each driver means over the episodes with the seeds 0, 1, ..., num - 1; all are driven together.

    They are: sum of rewards, the same with `DISCOUNT`, time [s], distance [m], shares that arrived and that failed.
    """
    every = len(drivers) * num
    parts = {driver: slice(i * num, (i + 1) * num) for i, driver in enumerate(drivers)}
    envs = gymnasium.make_vec(
        name,
        num_envs=every,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
    )
    seen, _ = envs.reset(seed=list(range(num)) * len(drivers))
    total, discounted, steps, distance = (np.zeros(every) for _ in range(4))
    is_on, arrived, failed = np.ones(every, dtype=bool), np.zeros(every, dtype=bool), np.zeros(every, dtype=bool)
    while is_on.any():
        actions = [policy(pick(seen, parts[driver])) for driver, policy in drivers.items()]
        seen, rewards, terminated, truncated, infos = envs.step(np.concatenate(actions))
        total += rewards * is_on
        discounted += DISCOUNT**steps * rewards * is_on
        steps += is_on
        distance = np.where(is_on, infos["distance"], distance)
        arrived |= is_on & infos["has_arrived"]
        failed |= is_on & terminated & ~infos["has_arrived"]
        is_on &= ~(terminated | truncated)
    envs.close()
    return {
        driver: {
            "reward": round(float(total[part].mean()), 1),
            "discounted": round(float(discounted[part].mean()), 2),
            "seconds": round(float(steps[part].mean()) / 10.0, 1),
            "metres": round(float(distance[part].mean())),
            "arrived": round(float(arrived[part].mean()), 2),
            "failed": round(float(failed[part].mean()), 2),
        }
        for driver, part in parts.items()
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each environment and driver."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=16)
    parser.add_argument("--json", type=Path, help="file for the figures")
    parser.add_argument("--only", default="", help="environments whose names contain this")
    chosen = parser.parse_args(arguments)
    register_all()
    num = chosen.episodes
    figures: dict[str, dict[str, dict[str, float]]] = {}
    for name, task in TASKS.items():
        if chosen.only not in name:
            continue
        figures[name] = drive_all(name, drivers_of(task, num), num)
        for driver, found in figures[name].items():
            print(f"{name:32} {driver:11} {' '.join(f'{key} {value:g}' for key, value in found.items())}", flush=True)
        if chosen.json is not None:
            chosen.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Train a driver of `Highway-v1` that chooses lanes and speeds, by random search with numpy alone.

The ego keeps its lane and its gaps as all other vehicles do; the policy says faster or slower, and changes lanes, into
whatever is there. It knows the gaps ahead and behind on three lanes, and how fast they close. Reward is the speed, and
a contact ends the episode. What it reaches is compared with the mean speed of all other vehicles of the same worlds.
Needs the extra `gym`.

    python scripts/examples/train_highway.py --policy highway.npz
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from random_search import Array, Policy, improve

from rosbridge_sim.environments.registration import register_all
from rosbridge_sim.world.state.world import Kind

NAME = "rosbridge_sim/Highway-v1"
DIRECTIONS, BEST, PLACES = 16, 8, 6
STEP, NOISE = 0.1, 0.2
LANE, SEEN = 3.5, 100.0
"""Width of a lane, and how far others are observed [m]."""
OPTIONS: dict[str, Any] = {
    "action": "DiscreteMeta",
    "target_speeds": (20.0, 25.0, 30.0, 35.0),
    "normalize": False,
    "frame_skip": 25,
    "start_lane": "L2_*",
    "start_s": None,
    "start_speed": 25.0,
    "target_speed": 36.0,
    "max_episode_steps": 80,
    "weights": {"failure": 30.0, "offset": 0.0},
}
"""A decision each half second, from anywhere on the middle lane. No vehicle may drive faster than 33 m/s there."""


class Outcome(NamedTuple):
    """Of some episodes: sums of rewards (n,), observed figures, speed, that of all other vehicles [m/s], contacts."""

    rewards: Array
    figures: Array
    speed: float
    speed_of_others: float
    num_contacts: int


def figures_of(seen: Array) -> Array:
    """Return speed, and gap and relative speed of the next vehicles on three lanes, ahead and behind, (n, 13)."""
    others = seen[:, 15:].reshape(len(seen), -1, 9)
    x, y, away = others[..., 1], others[..., 2], others[..., 3]
    figures, every = [seen[:, 0]], np.arange(len(seen))
    for lane in (1, 0, -1):
        is_on = (others[..., 0] > 0.0) & (np.abs(y - lane * LANE) < 0.5 * LANE)
        for side in (1.0, -1.0):
            gap = np.where(is_on & (side * x > 0.0), side * x, SEEN)
            nearest = gap.argmin(axis=1)
            is_there = gap[every, nearest] < SEEN
            figures += [gap[every, nearest], np.where(is_there, side * away[every, nearest], 0.0)]
    return np.stack(figures, axis=1)


def make(num: int) -> Any:  # noqa: ANN401 - Gymnasium has no types here
    """Return environments without resets of their own."""
    how: dict[str, Any] = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "Disabled"}
    return gymnasium.make_vec(NAME, num_envs=num, **how, **OPTIONS)


def drive(envs: Any, policy: Policy, weights: Array, seeds: list[int]) -> Outcome:  # noqa: ANN401
    """Drive an episode with each policy; the greatest output is the action."""
    seen, _ = envs.reset(seed=seeds)
    num, worlds = len(seeds), envs.unwrapped.worlds
    total, metres, seconds, is_on = np.zeros(num), np.zeros(num), np.zeros(num), np.ones(num, dtype=bool)
    all_figures, others, has_met = [], [], np.zeros(num, dtype=bool)
    while is_on.any():
        figures = figures_of(seen)
        all_figures.append(figures[is_on])
        actions = policy.apply(weights, figures).argmax(axis=1)
        seen, rewards, terminated, truncated, infos = envs.step(actions)
        total += rewards * is_on
        metres, seconds = np.where(is_on, infos["distance"], metres), seconds + 0.5 * is_on
        has_met |= is_on & infos["has_collided"]
        for i in is_on.nonzero()[0].tolist():
            world = worlds.world(i)
            others.append(world.speed[world.alive & (world.kind == Kind.VEHICLE)].mean())
        is_on &= ~(terminated | truncated)
    speed = float(metres.sum() / seconds.sum())
    return Outcome(total, np.concatenate(all_figures), speed, float(np.mean(others)), int(has_met.sum()))


def train(chosen: argparse.Namespace) -> Policy:
    """Train for some rounds, or until the time is over."""
    rng, policy = np.random.default_rng(chosen.seed), Policy(5, 13)
    envs = make(2 * DIRECTIONS * PLACES)

    def try_out(weights: Array) -> tuple[Array, Array]:
        seeds = rng.integers(1 << 31, size=PLACES).repeat(len(weights)).tolist()
        outcome = drive(envs, policy, np.tile(weights, (PLACES, 1, 1)), seeds)
        print(f"  {outcome.speed:5.2f} m/s  others {outcome.speed_of_others:5.2f}  contacts {outcome.num_contacts}")
        return outcome.rewards.reshape(PLACES, -1).mean(axis=0), outcome.figures

    for number in range(chosen.rounds):
        reward = improve(policy, try_out, rng, directions=DIRECTIONS, best=BEST, step=STEP, noise=NOISE)
        print(f"round {number:3}  {time.process_time():6.1f} s  reward {reward:6.2f}", flush=True)
        if chosen.policy is not None:
            policy.save(chosen.policy)
        if time.process_time() > 60.0 * chosen.minutes:
            break
    return policy


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and drive other episodes with the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=5.0, help="CPU time at most")
    parser.add_argument("--rounds", type=int, default=30, help="rounds at most")
    parser.add_argument("--episodes", type=int, default=64, help="episodes at the end")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--policy", type=Path, help=".npz file for the weights, after each round")
    chosen = parser.parse_args(arguments)
    register_all()
    policy = train(chosen)
    untrained = Policy(5, 13)
    untrained.weights[1] = 1.0  # go on
    envs = make(chosen.episodes)
    for name, each in (("untrained", untrained), ("trained", policy)):
        outcome = drive(envs, each, each.weights, list(range(1_000_000, 1_000_000 + chosen.episodes)))
        print(
            f"{name:9} {outcome.speed:5.2f} m/s, all other vehicles {outcome.speed_of_others:5.2f} m/s,"
            f" {outcome.num_contacts} contacts in {chosen.episodes} episodes"
        )


if __name__ == "__main__":
    main()

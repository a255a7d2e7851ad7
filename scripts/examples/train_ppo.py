"""Train a driver of `LaneKeeping-v1` with PPO of stable-baselines3.

64 environments drive at once, as one set of arrays. They start where the scenario has the ego: on a straight of 600 m,
which is the easiest to learn. The driver is judged before and after, in 64 episodes of other seeds. Needs the extra
`gym`, torch and stable-baselines3.

    python scripts/examples/train_ppo.py --policy driver.zip
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.environments.stable_baselines import make_vec_env

NUM_ENVS = 64
SEED_OF_JUDGE = 1_000


def mean_reward(model: Any, envs: Any) -> float:  # noqa: ANN401 - both of a library without types
    """Return the mean reward of one episode in each environment, with the policy and no exploration."""
    envs.seed(SEED_OF_JUDGE)
    seen = envs.reset()
    sums, are_driving = np.zeros(envs.num_envs), np.ones(envs.num_envs, bool)
    while are_driving.any():
        actions, _ = model.predict(seen, deterministic=True)
        seen, rewards, have_ended, _ = envs.step(actions)
        sums += rewards * are_driving
        are_driving &= ~have_ended
    return float(sums.mean())


def main() -> None:
    """Train, and print the mean reward before and after."""
    parser = argparse.ArgumentParser(description="Train a driver of LaneKeeping-v1 with PPO of stable-baselines3.")
    parser.add_argument("--steps", type=int, default=16_384, help="steps of all environments together")
    parser.add_argument("--seed", type=int, default=1, help="seed of the policy and its exploration")
    parser.add_argument("--policy", type=Path, help="file for the trained policy (.zip)")
    arguments = parser.parse_args()

    torch.set_num_threads(1)  # the networks are small: more threads wait for each other
    envs = make_vec_env("rosbridge_sim/LaneKeeping-v1", num_envs=NUM_ENVS, max_offset=1.5, start_lane="")
    model = PPO("MlpPolicy", envs, n_steps=64, batch_size=512, gamma=0.98, seed=arguments.seed, device="cpu")
    print(f"before: mean reward {mean_reward(model, envs):.1f}", flush=True)
    began = time.process_time()
    model.learn(total_timesteps=arguments.steps)
    print(f"after {model.num_timesteps} steps ({time.process_time() - began:.0f} s of CPU):", end=" ")
    print(f"mean reward {mean_reward(model, envs):.1f}")
    if arguments.policy:
        model.save(arguments.policy)
        print(f"wrote {arguments.policy}")


if __name__ == "__main__":
    main()

"""Train a driver that keeps to its lane, by random search with numpy alone, until it drives a lap.

`random_search.py` tries changes of a linear policy, all at once, and moves it towards the better ones. Each drives for
15 s from eight places of the map `loop`, which chance chooses anew for each round; every fifth policy tries a whole
lap. Needs the extra `gym`.

    python scripts/examples/train_lane_keeping.py --curve curve.csv --policy driver.npz --film lap.gif
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from random_search import Array, Policy, improve

from rosbridge_sim.environments.registration import register_all
from rosbridge_sim.shell.files.library import DiskLibrary

NAME = "rosbridge_sim/LaneKeeping-v1"
DIRECTIONS, BEST, PLACES = 32, 16, 8
STEP, NOISE = 0.05, 0.1
"""Length of a step and of the changes, in weights of whitened figures."""
SPEED, STEPS = 15.0, 150
OPTIONS: dict[str, Any] = {"max_offset": 1.5, "target_speed": SPEED, "num_starts": 1, "start_speed": 10.0}
"""An episode ends 1.5 m from the line of the lane."""


def act(policy: Policy, weights: Array, seen: Array) -> Array:
    """Return actions (n, 2) of policies with weights (n, 2, 16), for observations (n, 15)."""
    return np.asarray(np.clip(policy.apply(weights, seen), -1.0, 1.0))


def ego_alone(folder: Path) -> str:
    """Return the path of a scenario that has the map and the ego of `loop`, and no traffic."""
    whole = json.loads(DiskLibrary().scenario_path("loop").read_text(encoding="utf-8"))
    path = folder / "loop_ego.json"
    path.write_text(json.dumps({name: whole[name] for name in ("mapInfo", "egoVehicle")}), encoding="utf-8")
    return str(path)


def lap_length() -> float:
    """Return the length of the middle lane of `loop` [m]."""
    roads = DiskLibrary().map("loop").roads
    return sum(float(roads.length[i]) for i, name in enumerate(roads.ids) if name.startswith("L2_"))


def make(scenario: str, num: int, **options: Any) -> Any:  # noqa: ANN401 - Gymnasium has no types here
    """Return environments without resets of their own."""
    how: dict[str, Any] = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "Disabled"}
    return gymnasium.make_vec(NAME, num_envs=num, scenario=scenario, **how, **{**OPTIONS, **options})


def drive(envs: Any, policy: Policy, weights: Array, seeds: list[int]) -> tuple[Array, Array]:  # noqa: ANN401
    """Drive an episode with each policy; return the sums of rewards (n,), and all that was observed (m, 15)."""
    seen, _ = envs.reset(seed=seeds)
    total, is_on, all_seen = np.zeros(len(weights)), np.ones(len(weights), dtype=bool), []
    while is_on.any():
        all_seen.append(seen[is_on])
        seen, rewards, terminated, truncated, _ = envs.step(act(policy, weights, seen))
        total += rewards * is_on
        is_on &= ~(terminated | truncated)
    return total, np.concatenate(all_seen)


def drive_lap(scenario: str, policy: Policy, length: float, path: Path | None = None) -> tuple[float, float]:
    """Drive until the lap is complete or the lane is left, and film it if there is a path; a picture each four seconds.

    Returns:
        The distance without crossing an edge of the lane [m], and the greatest offset from its line [m].
    """
    start = {"start_lane": "L2_00", "start_s": 0.0, "max_episode_steps": round(20.0 * length / SPEED)}
    env = gymnasium.make(NAME, scenario=scenario, render_mode="rgb_array", **{**OPTIONS, **start})
    seen, info = env.reset(seed=0)
    pictures: list[Image.Image] = []
    offset, metres, is_over = 0.0, 0.0, False
    while not is_over and metres < length:
        if path is not None and len(pictures) * 4.0 <= info["score"]["score_distance"] / SPEED:
            pictures.append(Image.fromarray(np.asarray(env.render())).resize((300, 200)).quantize(16))
        seen, _, terminated, truncated, info = env.step(act(policy, policy.weights, seen[None])[0])
        is_over = terminated or truncated or info["score"]["num_lane_invasions"] > 0
        metres, offset = info["distance"], max(offset, abs(info["offset"]))
    if path is not None:
        pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=150, loop=0, optimize=True)
    return metres, offset


def train(scenario: str, chosen: argparse.Namespace) -> Policy:
    """Train until a policy drives a lap, or the time is over."""
    rng, length = np.random.default_rng(chosen.seed), lap_length()
    policy = Policy(2, 15)
    envs = make(scenario, 2 * DIRECTIONS * PLACES, start_lane="L2_*", start_s=None, max_episode_steps=STEPS)

    def try_out(weights: Array) -> tuple[Array, Array]:
        seeds = rng.integers(1 << 31, size=PLACES).repeat(len(weights)).tolist()
        total, seen = drive(envs, policy, np.tile(weights, (PLACES, 1, 1)), seeds)
        return total.reshape(PLACES, -1).mean(axis=0), seen

    lines = ["round,cpu_seconds,reward,metres,offset"]
    for number in range(chosen.rounds):
        reward = improve(policy, try_out, rng, directions=DIRECTIONS, best=BEST, step=STEP, noise=NOISE)
        metres, offset = float("nan"), float("nan")
        if number % 5 == 4:  # a lap costs as much as some rounds
            metres, offset = drive_lap(scenario, policy, length)
        lines.append(f"{number},{time.process_time():.1f},{reward:.1f},{metres:.0f},{offset:.2f}")
        print(f"round {number:3}  {time.process_time():6.1f} s  reward {reward:6.1f}  lap {metres:5.0f} m", flush=True)
        if chosen.curve is not None:
            chosen.curve.write_text("\n".join(lines) + "\n", encoding="utf-8")
        if metres >= length or time.process_time() > 60.0 * chosen.minutes:
            break
    return policy


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print a line for each round."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="CPU time at most")
    parser.add_argument("--rounds", type=int, default=1_000, help="rounds at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--curve", type=Path, help="CSV file for the learning curve")
    parser.add_argument("--policy", type=Path, help=".npz file for weights, mean and variance")
    parser.add_argument("--film", type=Path, help=".gif file: the lap, a picture each four seconds")
    chosen = parser.parse_args(arguments)
    register_all()
    with tempfile.TemporaryDirectory() as folder:
        scenario = ego_alone(Path(folder))
        policy = train(scenario, chosen)
        if chosen.policy is not None:
            policy.save(chosen.policy)
        if chosen.film is not None:
            metres, offset = drive_lap(scenario, policy, lap_length(), chosen.film)
            print(f"lap: {metres:.0f} of {lap_length():.0f} m, at most {offset:.2f} m from the line of the lane")


if __name__ == "__main__":
    main()

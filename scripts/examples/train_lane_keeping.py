"""Train a driver that keeps to its lane, by random search with numpy alone, and write its learning curve.

Augmented random search (Mania, Guy and Recht 2018, arXiv:1803.07055): a linear policy is tried with small random
changes and with their opposites, all at once, and moves towards the better ones. Each drives for 20 s from four places
of the map `loop`; every fifth policy tries a whole lap. Needs the extra `gym`.

    python scripts/examples/train_lane_keeping.py --minutes 8 --curve curve.csv
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
import numpy.typing as npt
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.environments.registration import register_all
from rosbridge_sim.shell.files.library import DiskLibrary

Array = npt.NDArray[np.float64]

NAME = "rosbridge_sim/LaneKeeping-v0"
DIRECTIONS, BEST = 64, 16
STEP, NOISE, CALM = 0.1, 0.15, 8.0
"""Length of a step and of the changes; after `CALM` rounds both are half as long."""
NUM_SEEN, NUM_ACTIONS = 15, 2
SPEED = 15.0
STARTS = (("L2_00", 900.0), ("L2_01", 500.0), ("L2_05", 50.0), ("L2_00", 100.0))
"""Lanes and arc lengths from which policies drive [m]."""
DURATION = 20.0
BEGIN: dict[str, Any] = {
    "max_offset": 1.5,
    "target_speed": SPEED,
    "num_starts": 1,
    "start_lane": "L2_00",
    "start_s": 800.0,
    "start_speed": 10.0,
}
"""Options of the environments: the line of the lane is 1.5 m away at most."""


def ego_alone(folder: Path) -> str:
    """Return the path of a scenario that has the map and the ego of `loop`, and no traffic."""
    library = DiskLibrary()
    whole = json.loads(library.scenario_path("loop").read_text(encoding="utf-8"))
    path = folder / "loop_ego.json"
    path.write_text(json.dumps({name: whole[name] for name in ("mapInfo", "egoVehicle")}), encoding="utf-8")
    return str(path)


def lap_length() -> float:
    """Return the length of the middle lane of `loop` [m]."""
    roads = DiskLibrary().map("loop").roads
    return sum(float(roads.length[i]) for i, name in enumerate(roads.ids) if name.startswith("L2_"))


def make(scenario: str, num: int, duration: float, start: tuple[str, float]) -> Any:  # noqa: ANN401 - it says nothing
    """Return environments without resets of their own; leaving the line of the lane by 1.5 m ends an episode."""
    return gymnasium.make_vec(
        NAME,
        num_envs=num,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
        scenario=scenario,
        duration=duration,
        **{**BEGIN, "start_lane": start[0], "start_s": start[1]},
    )


def act(weights: Array, seen: Array) -> Array:
    """Return actions (n, 2) of linear policies (n, 2, 16), for observations (n, 15)."""
    with_one = np.concatenate([seen, np.ones((len(seen), 1))], axis=1)
    return np.asarray(np.clip(np.einsum("nij,nj->ni", weights, with_one), -1.0, 1.0))


def drive(envs: Any, weights: Array) -> tuple[Array, Array]:  # noqa: ANN401 - as above
    """Drive one episode with each policy (n, 2, 16); return sums of rewards and distances [m], (n,) each."""
    seen, _ = envs.reset(seed=0)
    total, metres, is_on = np.zeros(len(weights)), np.zeros(len(weights)), np.ones(len(weights), dtype=bool)
    while is_on.any():
        seen, rewards, terminated, truncated, infos = envs.step(act(weights, seen))
        total += rewards * is_on
        metres = np.where(is_on, infos["distance"], metres)
        is_on &= ~(terminated | truncated)
    return total, metres


def improve(weights: Array, places: Sequence[Any], rng: np.random.Generator, share: float = 1.0) -> tuple[Array, float]:
    """Return better weights (2, 16), and the mean reward of the best changes; `share` shortens changes and step."""
    changes = rng.normal(size=(DIRECTIONS, *weights.shape))
    both = np.concatenate([weights + share * NOISE * changes, weights - share * NOISE * changes])
    total = np.sum([drive(envs, both)[0] for envs in places], axis=0)
    plus, minus = total[:DIRECTIONS], total[DIRECTIONS:]
    best = np.argsort(-np.maximum(plus, minus))[:BEST]
    spread = np.concatenate([plus[best], minus[best]]).std() + 1e-6
    moved = np.einsum("k,kij->ij", plus[best] - minus[best], changes[best])
    return weights + share * STEP / (BEST * spread) * moved, float(np.maximum(plus, minus)[best].mean())


def film(scenario: str, weights: Array, path: Path) -> None:
    """Write an animated picture of the first 60 s of a policy's lap, a frame a second."""
    env = gymnasium.make(NAME, scenario=scenario, duration=60.0, render_mode="rgb_array", **BEGIN)
    seen, _ = env.reset(seed=0)
    frames = []
    for number in range(600):
        seen, _, terminated, _, _ = env.step(act(weights[None], seen[None])[0])
        if number % 10 == 0 or terminated:
            frames.append(Image.fromarray(np.asarray(env.render())).resize((300, 200)).quantize(16))
        if terminated:
            break
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=200, loop=0, optimize=True)


def train(scenario: str, chosen: argparse.Namespace) -> Array:
    """Train until a policy drives a lap, or the time is over; return its weights (2, 16)."""
    rng, weights, length = np.random.default_rng(chosen.seed), np.zeros((NUM_ACTIONS, NUM_SEEN + 1)), lap_length()
    places = [make(scenario, 2 * DIRECTIONS, DURATION, start) for start in STARTS]
    lap = make(scenario, 1, 2.0 * length / SPEED, ("L2_00", 0.0))
    lines = ["round,cpu_seconds,reward,metres"]
    for number in range(chosen.rounds):
        weights, reward = improve(weights, places, rng, CALM / (CALM + number))
        metres = float("nan")
        if number % 5 == 4:  # a lap costs as much as some rounds
            metres = float(drive(lap, weights[None])[1][0])
        spent = time.process_time()
        lines.append(f"{number},{spent:.1f},{reward:.1f},{metres:.0f}")
        print(f"round {number:3}  {spent:6.1f} s  reward {reward:7.1f}  lap {metres:5.0f} m", flush=True)
        if chosen.curve is not None:
            chosen.curve.write_text("\n".join(lines) + "\n", encoding="utf-8")
        if chosen.policy is not None:
            np.save(chosen.policy, weights)
        if metres >= length or spent > 60.0 * chosen.minutes:
            break
    return weights


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print a line for each round."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=8.0, help="CPU time at most")
    parser.add_argument("--rounds", type=int, default=1_000, help="rounds at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--curve", type=Path, help="CSV file for the learning curve")
    parser.add_argument("--policy", type=Path, help=".npy file for the weights")
    parser.add_argument("--film", type=Path, help=".gif file: a picture a second of the lap's first minute")
    chosen = parser.parse_args(arguments)
    register_all()
    with tempfile.TemporaryDirectory() as folder:
        scenario = ego_alone(Path(folder))
        weights = train(scenario, chosen)
        if chosen.film is not None:
            film(scenario, weights, chosen.film)


if __name__ == "__main__":
    main()

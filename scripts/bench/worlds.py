"""Measure many worlds: env steps a second at 1 to 1,024 worlds, in CPU time, in one run.

An env step is 5 frames with commands for the egos, and an observation of the ego and its 14 nearest neighbours. Each
world has the map and the ego of a scenario, and the `--traffic`; with `--whole` also what else the scenario has.

    python scripts/bench/worlds.py town --worlds 1 16 64 256 1024
    python scripts/bench/worlds.py motorway --worlds 256 --profile

`--beside PYTHON` compares, in the same run, with `highway-fast-v0` of highway-env, in an environment of its own, and
with our own `Highway-v1` as one set of arrays and in processes of `AsyncVectorEnv` (on Linux):

    python -m venv /tmp/highway && /tmp/highway/bin/pip install highway-env
    python scripts/bench/worlds.py motorway --worlds 256 --beside /tmp/highway/bin/python
"""

from __future__ import annotations

import argparse
import cProfile
import json
import os
import pstats
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim import Worlds
from rosbridge_sim.environments.registration import register_all
from rosbridge_sim.shell.files.library import DiskLibrary
from scripts.bench.reference import reference_line

FRAMES = 5
OTHERS = 14
SECONDS = 2.0


def measure(work: Callable[[], object]) -> float:
    """Return the CPU time of one call, measured for `SECONDS` [s]."""
    work()
    start, num = time.process_time(), 0
    while time.process_time() - start < SECONDS:
        work()
        num += 1
    return (time.process_time() - start) / num


def ego_alone(scenario: str, folder: Path) -> str:
    """Return the path of a scenario with the map and the ego of a built-in one, and nothing else."""
    whole = json.loads(DiskLibrary().scenario_path(scenario).read_text(encoding="utf-8"))
    path = folder / f"{scenario}_ego.json"
    path.write_text(json.dumps({name: whole[name] for name in ("mapInfo", "egoVehicle")}), encoding="utf-8")
    return str(path)


PARTS = {
    "drivers": ("lane_following.py", {"drive_lanes"}),
    "people": ("people.py", {"walk"}),
    "ego's motion": ("dynamics.py", {"drive"}),
    "contacts": ("collisions.py", {"remember", "find"}),
    "scores": ("scoring.py", {"remember", "judge"}),
    "traffic that comes and goes": ("one_scene.py", {"after_frame"}),
    "observation": ("worlds.py", {"egos", "others"}),
    "everything": ("worlds.py", {"step", "egos", "others"}),
}
"""Parts of a step by the functions that do them."""


def print_parts(work: Callable[[], object], num: int) -> None:
    """Print the share of each of `PARTS` in `num` calls."""
    work()
    profile = cProfile.Profile(time.process_time)
    profile.enable()
    for _ in range(num):
        work()
    profile.disable()
    times: dict[str, float] = {}
    for (file, _, function), figures in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        for part, (name, functions) in PARTS.items():
            if Path(file).name == name and function in functions and "rosbridge_sim" in Path(file).parts:
                times[part] = times.get(part, 0.0) + figures[3]
    print(", ".join(f"{part} {100 * each / times['everything']:.0f} %" for part, each in times.items()))


def of_worlds(
    scenario: str, num: int, traffic: int, *, scores: bool, profile: bool
) -> tuple[float, float, float, float]:
    """Return CPU time of a step, of its observation and of a reset of one world [s], and memory a world [bytes]."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    worlds = Worlds(scenario, num, traffic=traffic, scores=scores)
    rng = np.random.default_rng(0)
    one = np.zeros(num, dtype=bool)
    one[0] = True

    def step() -> None:
        worlds.step({"steering": 0.05 * rng.normal(size=(num, 1)), "accel": rng.normal(size=(num, 1))}, FRAMES)
        worlds.egos()
        worlds.others(OTHERS)

    if profile:
        print_parts(step, max(10, 2_000 // num))
    costs = measure(step), measure(lambda: (worlds.egos(), worlds.others(OTHERS))), measure(lambda: worlds.reset(one))
    memory = 1024.0 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / num
    return *costs, memory


HIGHWAY_ENV = """
import time, gymnasium, highway_env
gymnasium.register_envs(highway_env)
env = gymnasium.make("highway-fast-v0", config={"vehicles_count": 20, "lanes_count": 3})
env.reset(seed=0)
used = num = 0
while used < SECONDS:
    start = time.process_time()
    _, _, terminated, truncated, _ = env.step(env.action_space.sample())
    used += time.process_time() - start
    num += 1
    if terminated or truncated:
        env.reset()
print(num / used, env.unwrapped.config["policy_frequency"])
"""
"""Counts policy steps of highway-env for a CPU second, without resets."""

ENV = "rosbridge_sim/Highway-v1"


def of_processes(num: int, options: dict[str, Any]) -> float:
    """Return env steps of `AsyncVectorEnv` for each CPU second of its `num` processes and of this one together."""
    envs = gymnasium.make_vec(ENV, num_envs=num, vectorization_mode="async", **options)
    envs.reset(seed=0)
    ids = [process.pid for process in envs.unwrapped.processes]

    def used() -> float:
        fields = [Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split() for pid in ids]
        return sum(int(each[11]) + int(each[12]) for each in fields) / os.sysconf("SC_CLK_TCK") + time.process_time()

    actions, start, steps = np.zeros((num, 2), np.float32), used(), 0
    while (passed := used() - start) < num * SECONDS:
        envs.step(actions)
        steps += num
    envs.close()
    return steps / passed


def print_beside(num: int, worlds: float, python: str, options: dict[str, Any]) -> None:
    """Print env steps and simulated seconds a CPU second of `Worlds`, of our environments, and of highway-env.

    Args:
        num: worlds in one set of arrays.
        worlds: env steps a CPU second of `Worlds`.
        python: interpreter that has highway-env.
        options: of our environments.
    """
    register_all()
    envs = gymnasium.make_vec(ENV, num_envs=num, vectorization_mode="vector_entry_point", **options)
    envs.reset(seed=0)
    actions = np.zeros((num, 2), np.float32)
    arrays = num / measure(lambda: envs.step(actions))
    code = HIGHWAY_ENV.replace("SECONDS", str(SECONDS))
    answer = subprocess.check_output([python, "-c", code], text=True).split()  # noqa: S603 - the user names it
    rate, frequency = float(answer[0]), float(answer[1])
    rows = [
        (f"Worlds, {num}", worlds, 0.1),
        (f"{ENV}, {num} as arrays", arrays, 0.1),
        (f"{ENV}, AsyncVectorEnv of 2", of_processes(2, options), 0.1),
        ("highway-fast-v0", rate, 1.0 / frequency),
    ]
    print("what | env steps a CPU second | simulated seconds | Worlds in steps | Worlds in simulated seconds")
    for name, steps, seconds in rows:
        shares = worlds / steps, worlds * 0.1 / (steps * seconds)
        print(f"{name} | {steps:,.0f} | {steps * seconds:,.0f} | {shares[0]:,.0f} x | {shares[1]:,.0f} x", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each number of worlds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="?", default="town")
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 16, 64, 256])
    parser.add_argument("--traffic", type=int, default=20)
    parser.add_argument("--no-scores", action="store_true", help="keep no scores")
    parser.add_argument("--whole", action="store_true", help="with all vehicles and people of the scenario")
    parser.add_argument("--profile", action="store_true", help="print where the time goes, too")
    parser.add_argument("--beside", metavar="PYTHON", help="interpreter with highway-env, to compare with")
    chosen = parser.parse_args(arguments)
    print(reference_line())
    with tempfile.TemporaryDirectory() as folder:
        scenario = chosen.scenario if chosen.whole else ego_alone(chosen.scenario, Path(folder))
        run(scenario, chosen)


def run(scenario: str, chosen: argparse.Namespace) -> None:
    """Print a line for each number of worlds."""
    print("worlds | env steps a CPU second | ms a step | observation | reset of one world ms | memory a world MB")
    for num in chosen.worlds:
        step, look, reset, memory = of_worlds(
            scenario, num, chosen.traffic, scores=not chosen.no_scores, profile=chosen.profile
        )
        print(
            f"{num:6} | {num / step:12,.0f} | {1e3 * step:8.2f} | {look / step:6.1%} | {1e3 * reset:6.2f} |"
            f" {memory / 1e6:6.2f}",
            flush=True,
        )
        if chosen.beside:
            print_beside(num, num / step, chosen.beside, {"scenario": scenario, "traffic": chosen.traffic})


if __name__ == "__main__":
    main()

"""Measure the environments for Gymnasium: CPU time of a step of each, beside a step of `Worlds`, in one run.

The reference is the step of `scripts/bench/worlds.py town`: `Worlds` of the map and the ego of `town` with 20 vehicles,
5 frames with commands, and an observation of the ego and its 14 nearest neighbours. It has the same number of worlds,
and is measured in turn with each environment, which has commands of the same size. Environments do not begin anew. One
environment is made by `gymnasium.make`, with its wrappers; many by `make_vec`, as one set of arrays.

    python scripts/bench/environments.py --worlds 1 256 --rounds 5
    python scripts/bench/environments.py --worlds 1 --only Highway --against CHECKOUT
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.bench import in_turn

# isort: split
from rosbridge_sim import Worlds
from rosbridge_sim.environments.registration import TASKS, register_all
from scripts.bench.reference import reference_line
from scripts.bench.worlds import ego_alone

FRAMES, OTHERS, TRAFFIC = 5, 14, 20
SECONDS = 0.3


def measure(work: Callable[[], object]) -> float:
    """Return the CPU time of one call, measured for `SECONDS` [s]."""
    start, num = time.process_time(), 0
    while time.process_time() - start < SECONDS:
        work()
        num += 1
    return (time.process_time() - start) / num


def reference(num: int) -> Callable[[], object]:
    """Return a step of `num` worlds."""
    with tempfile.TemporaryDirectory() as folder:
        worlds = Worlds(ego_alone("town", Path(folder)), num, traffic=TRAFFIC)
    rng = np.random.default_rng(0)

    def step() -> None:
        worlds.step({"steering": 0.05 * rng.normal(size=(num, 1)), "accel": rng.normal(size=(num, 1))}, FRAMES)
        worlds.egos()
        worlds.others(OTHERS)

    return step


def environment(name: str, num: int) -> Callable[[], object]:
    """Return a step of one environment, or of many."""
    rng, how = np.random.default_rng(0), {"autoreset_mode": "Disabled", "vectorization_mode": "vector_entry_point"}
    envs: Any = gymnasium.make(name) if num == 1 else gymnasium.make_vec(name, num_envs=num, **how)
    envs.reset(seed=0)
    shape = envs.action_space.shape

    def step() -> None:
        envs.step(np.clip(rng.normal(size=shape) * [0.1, 0.25], -1.0, 1.0).astype(np.float32))

    return step


def _case(make: Callable[[int], Callable[[], object]], num: int) -> Callable[[], tuple[Callable[[], object], int]]:
    return lambda: (make(num), num)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each environment: its CPU time for each world, and the ratio to the reference."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 256])
    parser.add_argument("--rounds", type=int, default=5, help="pairs in turn; medians are printed")
    parser.add_argument("--only", default="", help="environments whose names contain this")
    chosen = in_turn.parse(parser, arguments)
    register_all()
    names = [name for name in TASKS if chosen.only in name]
    cases = {
        f"{name.partition('/')[2]}, {num}": _case(partial(environment, name), num)
        for num in chosen.worlds
        for name in names
    }
    cases |= {f"Worlds, {num}": _case(reference, num) for num in chosen.worlds}
    if in_turn.run(chosen, cases, "step of a world"):
        return
    print(reference_line())
    for num in chosen.worlds:
        base = reference(num)
        print(f"{num} worlds: CPU time of a step for each world, and its multiple of that of `Worlds`", flush=True)
        for name in names:
            step = environment(name, num)
            pairs = [(measure(step), measure(base)) for _ in range(chosen.rounds)]
            cost, ratio = statistics.median(own for own, _ in pairs), statistics.median(own / of for own, of in pairs)
            print(f"| `{name.partition('/')[2]}` | {1e6 * cost / num:.0f} µs | {ratio:.2f} |", flush=True)


if __name__ == "__main__":
    main()

"""Measure many worlds: env steps a second at 1 to 1,024 worlds, in CPU time, in one run.

An env step is 5 frames with commands for the egos, and an observation of the ego and its 14 nearest neighbours.

    python scripts/bench/worlds.py town --worlds 1 16 64 256 1024
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim import Worlds

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


def of_worlds(scenario: str, num: int, traffic: int, *, scores: bool) -> tuple[float, float, float, float]:
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

    costs = measure(step), measure(lambda: (worlds.egos(), worlds.others(OTHERS))), measure(lambda: worlds.reset(one))
    memory = 1024.0 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / num
    return *costs, memory


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each number of worlds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="?", default="town")
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 16, 64, 256])
    parser.add_argument("--traffic", type=int, default=20)
    parser.add_argument("--no-scores", action="store_true", help="keep no scores")
    chosen = parser.parse_args(arguments)
    print("worlds | env steps a CPU second | ms a step | observation | reset of one world ms | memory a world MB")
    for num in chosen.worlds:
        step, look, reset, memory = of_worlds(chosen.scenario, num, chosen.traffic, scores=not chosen.no_scores)
        print(
            f"{num:6} | {num / step:12,.0f} | {1e3 * step:8.2f} | {look / step:6.1%} | {1e3 * reset:6.2f} |"
            f" {memory / 1e6:6.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()

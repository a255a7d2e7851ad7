"""Measurements of another checkout and of this one in turn.

A script of this folder imports it first, and gives `run` its cases. With `--against CHECKOUT` both checkouts run in a
process of their own, each with its package and the cases of this script, and take turns of some milliseconds of CPU
time. So whatever else the machine does meets both. The ratio is the median over pairs.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from time import process_time
from typing import IO

from scripts.bench.reference import reference_line

_FLAG = "--in-tree"
OWN_TREE = Path(__file__).resolve().parents[2]
TREE = Path(sys.argv[sys.argv.index(_FLAG) + 1]) if _FLAG in sys.argv else OWN_TREE
sys.path.insert(0, str(TREE))  # works from a fresh clone, too

TURN = 0.005
TURNS = 10
"""CPU time of one turn of a case [s], and the turns of each in a pair: the least one counts. So a pair is compared
while the processor is at its fastest, and not while others use its caches."""

WARM_UP = 10
"""Calls before a measurement."""

Work = Callable[[], object]


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags of `run`."""
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="measure this checkout, too, in turn")
    parser.add_argument("--pairs", type=int, default=9, help="measured with --against [%(default)s]")
    parser.add_argument(_FLAG, type=Path, help=argparse.SUPPRESS)


def run(options: argparse.Namespace, make: Mapping[str, Callable[[], tuple[Work, int]]], unit: str) -> bool:
    """Measure in turn if the command line asks for it.

    Args:
        options: with those of `add_flags`.
        make: name of a case -> a function that makes its work, and says how many units one call does.
        unit: what is counted, such as a step.

    Returns:
        Whether it has; without `--against` the script measures by itself.
    """
    if options.in_tree is not None:
        _serve(make)
    elif options.against is not None:
        _compare(options.against.resolve(), options.pairs, unit)
    else:
        return False
    return True


def _serve(make: Mapping[str, Callable[[], tuple[Work, int]]]) -> None:
    """Measure a case for each line of the input; the other process waits meanwhile."""
    import rosbridge_sim  # noqa: PLC0415 - of the tree that the path names

    assert Path(rosbridge_sim.__file__).is_relative_to(TREE), rosbridge_sim.__file__
    print(json.dumps(list(make)), flush=True)
    for name in make:
        work, num = make[name]()
        print(_count(work), flush=True)
        for line in sys.stdin:
            if line == "next\n":
                break
            gc.collect()
            gc.disable()
            start = process_time()
            for _ in range(int(line)):
                work()
            print((process_time() - start) / int(line) / num, flush=True)
            gc.enable()


def _count(work: Work) -> int:
    """Return how many calls fit into a turn; its own calls are as many in each checkout, so both worlds go on alike."""
    for _ in range(WARM_UP):
        work()
    start = process_time()
    for _ in range(WARM_UP):
        work()
    return max(1, round(TURN * WARM_UP / (process_time() - start)))


def _compare(against: Path, pairs: int, unit: str) -> None:
    """Print a line for each case: the CPU time of a unit in both checkouts, and the ratio."""
    print(reference_line())
    print(f"{f'us of CPU for a {unit}':32} {'other':>10} {'this':>10} {'ratio':>7} {'(of pairs)':>14}")
    programs = [
        subprocess.Popen(  # noqa: S603 - our own
            [sys.executable, str(Path(sys.argv[0]).resolve()), *sys.argv[1:], _FLAG, str(tree)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=tree,
        )
        for tree in (against, OWN_TREE)
    ]
    pipes = [(_open(each.stdin), _open(each.stdout)) for each in programs]
    names = [json.loads(output.readline()) for _, output in pipes]
    for name in names[0]:
        num, found = min(int(output.readline()) for _, output in pipes), []
        for _ in range(pairs):
            turns = [[_ask(*pipe, num) for pipe in pipes] for _ in range(TURNS)]
            found.append([min(column) for column in zip(*turns, strict=True)])
        other, own = (median(column) for column in zip(*found, strict=True))
        ratios = sorted(new / old for old, new in found)
        spread = f"{ratios[0]:.2f}..{ratios[-1]:.2f}"
        print(f"{name:32} {1e6 * other:10.1f} {1e6 * own:10.1f} {median(ratios):7.2f} {spread:>14}", flush=True)
        for into, _ in pipes:
            into.write("next\n")
            into.flush()
    for each in programs:
        each.communicate()


def _open(pipe: IO[str] | None) -> IO[str]:
    assert pipe is not None
    return pipe


def _ask(into: IO[str], output: IO[str], num: int) -> float:
    into.write(f"{num}\n")
    into.flush()
    return float(output.readline())


def wait_for_kernels() -> str:
    """Start the compiled loops, if there is a compiler, and return what drives vehicles on lanes."""
    try:
        from rosbridge_sim.shell.kernels.backend import backend, start_kernels  # noqa: PLC0415 - see below
    except ImportError:  # a checkout of before
        return "arrays"
    if (thread := start_kernels()) is not None:
        thread.join()
    return backend()


def parse(parser: argparse.ArgumentParser, arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the options of a command line with the flags of `run`."""
    add_flags(parser)
    return parser.parse_args(arguments)

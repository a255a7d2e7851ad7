"""Cost of a start: CPU time until a server listens, and memory of an idle one; Linux alone.

    python scripts/bench/start.py [--pairs N] [--against PROGRAM] [--imports N] [-- FLAGS OF SERVE]

`--against` is another `rosbridge-sim` (`CHECKOUT/.venv/bin/python -m rosbridge_sim`, in quotes); both start in turn, so
that a busy machine affects both: compare the ratio. `--imports` lists the N modules whose own import takes longest.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import statistics
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.bench.reference import reference_line

SETTLE = 1.2
"""Time from the first line of a server to the measurement of its memory [s]."""


def cpu_of(pid: int) -> float:
    """Return the CPU time of all threads of a process that still run [s]."""
    total = 0.0
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with suppress(OSError):  # it has just ended
            total += int((thread / "schedstat").read_text().split()[0]) / 1e9
    return total


def start(command: list[str], flags: list[str]) -> tuple[float, float]:
    """Start a server; return its CPU time until it listens [s], and the resident memory when it is idle [MB]."""
    words = [*command, "serve", "--port", "0", *flags]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)  # noqa: S603 - our own words
    with process:
        assert process.stdout is not None
        if not process.stdout.readline():
            sys.exit(f"{shlex.join(words)}: it does not start")
        cpu = cpu_of(process.pid)
        time.sleep(SETTLE)
        status = Path(f"/proc/{process.pid}/status").read_text()
        process.terminate()
    resident = re.search(r"VmRSS:\s+(\d+)", status)
    assert resident is not None
    return cpu, int(resident[1]) / 1024


def list_imports(command: list[str], most: int) -> None:
    """Print the modules whose own import takes longest, in three starts, and the sum over all."""
    least: dict[str, int] = {}
    for _ in range(3):
        program = subprocess.run(  # noqa: S603 - the same
            [*command[:1], "-X", "importtime", "-c", "import gc; gc.disable(); import rosbridge_sim.shell.app, uvloop"],
            stderr=subprocess.PIPE,
            text=True,
            check=True,
        )
        for own, name in re.findall(r"import time:\s+(\d+) \|\s+\d+ \|\s+(\S+)", program.stderr):
            least[name] = min(int(own), least.get(name, int(own)))
    print(f"{len(least)} modules, {sum(least.values()) / 1000:.0f} ms")
    for name, own in sorted(least.items(), key=lambda one: -one[1])[:most]:
        print(f"{own / 1000:6.1f} ms  {name}")


def main() -> None:
    """Measure, and print a line for each program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=9)
    parser.add_argument("--against", type=shlex.split)
    parser.add_argument("--imports", type=int, default=0)
    parser.add_argument("flags", nargs="*")
    args = parser.parse_args()
    print(reference_line())
    os.chdir("/")  # each program finds its own package
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    own = [sys.executable, "-m", "rosbridge_sim"]
    programs = [own] if args.against is None else [args.against, own]
    for program in programs:
        start(program, args.flags)  # compiles the sources
    rounds = [[start(program, args.flags) for program in programs] for _ in range(args.pairs)]
    for i, program in enumerate(programs):
        costs = [one[i][0] for one in rounds]
        memory = statistics.median(one[i][1] for one in rounds)
        name = " ".join(program)
        print(
            f"{statistics.median(costs):.3f} s of CPU ({min(costs):.3f} to {max(costs):.3f}), {memory:.1f} MB  {name}"
        )
    if args.against is not None:
        ratio = statistics.median(after[0] / before[0] for before, after in rounds)
        print(f"ratio {ratio:.3f}")
    if args.imports:
        list_imports(own, args.imports)


if __name__ == "__main__":
    main()

"""Traffic of ours beside SUMO: queues at a light, a motorway loop, a town, and the cost of a step.

    python scripts/bench/traffic.py [--parts queue,loop] [--page docs/traffic.md] [--images DIR] [--env DIR]

It makes an environment of its own (`.venv-sumo`) with this project, SUMO (eclipse-sumo and libsumo) and matplotlib,
runs itself there, prints Markdown tables, and writes plots. The project's own environment does not get these packages.

SUMO has the same lanes, speed limits and lights: `sumo_network.py` converts our maps for netconvert. It has the same
vehicles at the same places with the routes that our drivers choose. Its car is its default one. SUMO's default step is
1 s; there a queue starts off later than at the step of 0.1 s in which our drivers decide. So both are shown, and ratios
are those to the step of 0.1 s unless the table names another one.

The cost is measured on copies of the town, side by side, as CPU time in turn: ours, then SUMO's with a step of 20 ms.
SUMO's drivers decide in each step, or every 0.1 s as ours do (`--default.action-step-length`). It is given in
vehicle-steps a second.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.shell.files.library import DiskLibrary  # noqa: E402
from rosbridge_sim.world.followers.lane_following import DECISION  # noqa: E402
from rosbridge_sim.world.state.world import DT  # noqa: E402
from rosbridge_sim.world.step import step  # noqa: E402
from scripts.bench import in_turn, sumo_runs  # noqa: E402
from scripts.bench.reference import reference_line  # noqa: E402
from scripts.bench.step import towns  # noqa: E402
from scripts.bench.sumo_network import Network, convert  # noqa: E402
from scripts.bench.traffic_cases import (  # noqa: E402
    QUEUE_RED,
    Flow,
    discharge,
    evenly,
    measure_flow,
    ours,
    plan_routes,
    queue_at_light,
    queue_roads,
    spread,
)

PACKAGES = ("eclipse-sumo==1.28.0", "libsumo==1.28.0", "matplotlib")

STEPS = (0.1, 1.0)
"""Lengths of SUMO's step [s]."""

QUEUE = 14
"""Vehicles in the queue."""

SATURATED = 4
"""Headways before the queue flows evenly: those behind the first four vehicles count for the saturation flow, as the
Highway Capacity Manual has it."""

SEEDS = 10
"""Runs with SUMO's and our chance, for a mean."""

DENSITIES = (5, 10, 15, 20, 25, 30, 40, 60, 80)
"""Vehicles on a kilometre of lane."""

TOWN = (24, 100, 200, 400)
MOTORWAY = (50, 100, 200)
SIZES = (20, 100, 1_000, 10_000)

PER_TOWN = 250
"""Vehicles in a copy of the town: busy, not jammed."""

ROUNDS = 9
"""Measurements of the cost; both take turns, and medians count."""

SETTLE, SECONDS = 120.0, 480.0
"""Time before a measurement of a flow, and of it [s]: ten cycles of the town's lights."""

FASTEST = 45.0
"""More than any vehicle drives [m/s], for the length of routes: SUMO takes a vehicle out at the end of its own."""

TOWN_SPEED = 15.0
"""More than vehicles drive in the town [m/s]."""

COST_SETTLE = 20.0
"""Time before the cost of a step is measured [s]."""

Table = list[list[str]]
"""Rows of cells; the first row is the head."""


@dataclass(frozen=True, slots=True)
class Case:
    """A map in both simulators.

    Attributes:
        network: ours.
        net: SUMO's file.
    """

    network: Network
    net: Path


def run_inside(env: Path, arguments: Sequence[str]) -> int:
    """Make the environment if there is none, and run this file in it.

    Args:
        env: folder of the environment.
        arguments: of the command line.
    """
    python = env / "bin" / "python"
    if not (env / "bin" / "netconvert").exists():
        print(f"making {env} with {', '.join(PACKAGES)} (some 300 MB)", file=sys.stderr)
        subprocess.run([sys.executable, "-m", "venv", str(env)], check=True)  # noqa: S603 - our own words
        install = [str(python), "-m", "pip", "install", "-q", *PACKAGES, "-e", str(ROOT)]
        if subprocess.run(install, check=False).returncode:  # noqa: S603 - the same
            print(
                f"traffic.py: SUMO cannot be installed into {env}. Give --env a folder of an environment that has"
                f" {', '.join(PACKAGES)} and this project.",
                file=sys.stderr,
            )
            return 2
    return subprocess.run([str(python), __file__, "--inside", *arguments], check=False).returncode  # noqa: S603 - the same


def plotting() -> Any:  # noqa: ANN401 - a module
    """Return matplotlib's pyplot, which draws into files here."""
    import_module("matplotlib").use("Agg")
    return import_module("matplotlib.pyplot")


def compare_queue(folder: Path, images: Path) -> Table:
    """Compare the headways of a queue that a light lets go.

    Args:
        folder: for SUMO's files.
        images: folder of the plot.
    """
    figure, axes = plotting().subplots(1, 2, figsize=(9.0, 3.4), sharey=True, constrained_layout=True)
    table = [["limit", "simulator", "2nd", "3rd", "4th", "saturation headway", "saturation flow", "of SUMO's"]]
    for axis, kmh in zip(axes, (50.0, 70.0), strict=True):
        roads, plan = queue_roads(kmh)
        case = _build(convert(roads, plan), folder, "queue")
        queue = queue_at_light(QUEUE)
        runs = {"ours": [discharge(QUEUE, kmh, seed) for seed in range(SEEDS)]}
        for each in STEPS:
            runs[f"SUMO, steps of {each:g} s"] = [
                sumo_runs.discharge(case.net, case.network, queue, red=QUEUE_RED, step=each, seed=seed)
                for seed in range(SEEDS)
            ]
        headways = {name: np.mean([np.diff(run) for run in times], axis=0) for name, times in runs.items()}
        saturated = {name: float(values[SATURATED - 1 :].mean()) for name, values in headways.items()}
        reference = saturated[f"SUMO, steps of {STEPS[0]:g} s"]
        for name, values in headways.items():
            first = [f"{value:.2f} s" for value in values[:3]]
            flow = f"{3600.0 / saturated[name]:,.0f}/h"
            table.append(
                [f"{kmh:g} km/h", name, *first, f"{saturated[name]:.2f} s", flow, f"{reference / saturated[name]:.2f}"]
            )
            axis.plot(np.arange(2, QUEUE + 1), values, "o-", label=name)
        axis.set_title(f"{kmh:g} km/h")
        axis.set_xlabel("vehicle")
    axes[0].set_ylabel("headway at the stop line [s]")
    axes[0].legend()
    figure.savefig(images / "traffic_queue.png", dpi=70)
    return table


def compare_loop(folder: Path, images: Path, densities: Sequence[int] = DENSITIES) -> Table:
    """Compare the flow on the map `loop` by its density.

    Args:
        folder: for SUMO's files.
        images: folder of the plot.
        densities: vehicles on a kilometre of lane.
    """
    case = _of_map("loop", folder)
    length = float(case.network.roads.length.sum()) / 1000.0
    table = [["vehicles/km", "ours", "km/h", *(f"SUMO, {each:g} s" for each in STEPS), "of SUMO's"]]
    flows: list[list[float]] = []
    for density in densities:
        num = round(density * length)
        flow = _compare_flow(case, lambda network, num=num: evenly(network, num, 10.0))  # type: ignore[misc]
        flows.append([density * 3.6 * each.speed for each in flow])
        mine, *other = flows[-1]
        cells = [f"{each:,.0f}/h" for each in other]
        table.append([str(density), f"{mine:,.0f}/h", f"{flow[0].speed * 3.6:.0f}", *cells, f"{mine / other[0]:.2f}"])
        print(f"  loop, {density}: {table[-1]}", file=sys.stderr)
    figure, axis = plotting().subplots(figsize=(6.0, 3.6), constrained_layout=True)
    for name, values in zip(
        ("ours", *(f"SUMO, steps of {each:g} s" for each in STEPS)), zip(*flows, strict=True), strict=True
    ):
        axis.plot(densities, values, "o-", label=name)
    axis.set_xlabel("density [vehicles/km of lane]")
    axis.set_ylabel("flow [vehicles/h of lane]")
    axis.legend()
    figure.savefig(images / "traffic_loop.png", dpi=70)
    return table


def compare_map(name: str, sizes: Sequence[int], folder: Path) -> Table:
    """Compare mean speed and throughput on a map.

    Args:
        name: of the map.
        sizes: numbers of vehicles.
        folder: for SUMO's files.
    """
    case = _of_map(name, folder)
    head = ["vehicles", "speed", *(f"SUMO, {each:g} s" for each in STEPS), "of SUMO's", "edges passed", "of SUMO's"]
    table = [head]
    for num in sizes:
        mine, *other = _compare_flow(case, lambda network, num=num: spread(network, num))  # type: ignore[misc]
        removed = [f" ({each.removed} removed)" if each.removed else "" for each in other]
        speeds = [f"{each.speed * 3.6:.1f} km/h{note}" for each, note in zip(other, removed, strict=True)]
        ratio = " / ".join(f"{mine.speed / each.speed:.2f}" for each in other)
        passed = " / ".join(f"{mine.edges_per_hour / each.edges_per_hour:.2f}" for each in other)
        table.append(
            [str(num), f"{mine.speed * 3.6:.1f} km/h", *speeds, ratio, f"{mine.edges_per_hour:,.0f}/h", passed]
        )
        print(f"  {name}, {num}: {table[-1]}", file=sys.stderr)
    return table


def compare_steps(folder: Path) -> Table:
    """Compare the cost of a step on copies of the town.

    Args:
        folder: for SUMO's files.
    """
    head = ["vehicles", "towns", "our step", "ours", "SUMO", "SUMO, 0.1 s", "of SUMO's", "of SUMO's, 0.1 s"]
    table = [head]
    for num in SIZES:
        copies = -(-num // PER_TOWN)
        roads, plan = towns(copies)
        case = _build(convert(roads, plan), folder, f"towns{copies}")
        demand = spread(case.network, num)
        world = ours(roads, plan, demand)
        frames = DECISION * min(max(10, 20_000 // num), 200)
        demand = plan_routes(world, demand, TOWN_SPEED * (COST_SETTLE + ROUNDS * frames * DT))
        for _ in range(round(COST_SETTLE / DT)):  # until some stand at lights and others move
            step(world)
        seldom = ("--default.action-step-length", f"{DECISION * DT:g}")
        took: list[float] = []
        its: list[list[float]] = [[], []]
        for flags, rates in zip(((), seldom), its, strict=True):
            its_run = sumo_runs.stepping(case.net, case.network, demand, settle=COST_SETTLE, step=DT, flags=flags)
            with its_run as (advance, count):
                for _ in range(ROUNDS):
                    took.append(_time(partial(step, world), frames))
                    rates.append(count() / _time(advance, frames))
        mine = num / np.array(took).reshape(2, ROUNDS)
        ratios = np.median(mine / np.array(its), axis=1)
        table.append(
            [
                f"{num:,}",
                str(copies),
                f"{np.median(took) * 1e3:.2f} ms",
                f"{np.median(mine) / 1e6:.2f} million/s",
                *(f"{np.median(rates) / 1e6:.2f} million/s" for rates in its),
                *(f"{ratio:.1f}" for ratio in ratios),
            ]
        )
    return table


def _time(call: Callable[[], None], num: int) -> float:
    """Return the mean CPU time of a call, which other programs on the machine hardly change [s]."""
    begin = time.process_time()
    for _ in range(num):
        call()
    return (time.process_time() - begin) / num


def _compare_flow(case: Case, make: Callable[[Network], Sequence[Any]]) -> list[Flow]:
    """Return our flow, and SUMO's with each step."""
    demand = make(case.network)
    world = ours(case.network.roads, case.network.plan, demand)
    planned = plan_routes(world, demand, FASTEST * (SETTLE + SECONDS))
    return [
        measure_flow(world, case.network, settle=SETTLE, seconds=SECONDS),
        *(
            sumo_runs.measure_flow(case.net, case.network, planned, settle=SETTLE, seconds=SECONDS, step=each)
            for each in STEPS
        ),
    ]


def _of_map(name: str, folder: Path) -> Case:
    road_map = DiskLibrary().map(name)
    return _build(convert(road_map.roads, road_map.plan), folder, name)


def _build(network: Network, folder: Path, name: str) -> Case:
    return Case(network, sumo_runs.build(network, folder, name))


def as_markdown(table: Table) -> str:
    """Return a table as Markdown.

    Args:
        table: rows of cells, the head first.
    """
    head, *rows = ["| " + " | ".join(row) + " |" for row in table]
    return "\n".join([head, "|" + "---|" * len(table[0]), *rows])


def put_into(page: Path, part: str, table: str) -> None:
    """Put a table into a page, behind the mark of its part and in place of the table that is there.

    Args:
        page: a Markdown file.
        part: its mark is an HTML comment with this name.
        table: as Markdown.
    """
    mark = f"<!-- {part} -->\n"
    before, found, after = page.read_text(encoding="utf-8").partition(mark)
    if not found:
        raise SystemExit(f"traffic.py: {page} has no line {mark.strip()}")
    lines = after.lstrip("\n").splitlines(keepends=True)
    rest = "".join(lines[next((i for i, line in enumerate(lines) if not line.startswith("|")), len(lines)) :])
    page.write_text(f"{before}{mark}\n{table}\n\n{rest.lstrip(chr(10))}", encoding="utf-8")


def main() -> int:
    """Compare, print, plot; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--parts", default="queue,loop,town,motorway,steps", help="parts to run [%(default)s]")
    parser.add_argument("--images", type=Path, default=ROOT / "docs" / "images", help="folder of the plots")
    parser.add_argument("--page", type=Path, help="page that gets the tables, such as docs/traffic.md")
    parser.add_argument("--env", type=Path, default=ROOT / ".venv-sumo", help="environment for the packages")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not arguments.inside:
        flags = [f"--images={arguments.images}", f"--parts={arguments.parts}"]
        return run_inside(arguments.env, [*flags, *([f"--page={arguments.page}"] if arguments.page else [])])
    with tempfile.TemporaryDirectory() as name:
        folder, images = Path(name), arguments.images
        parts: dict[str, Callable[[], Table]] = {
            "queue": lambda: compare_queue(folder, images),
            "loop": lambda: compare_loop(folder, images),
            "town": lambda: compare_map("town", TOWN, folder),
            "motorway": lambda: compare_map("motorway", MOTORWAY, folder),
            "steps": lambda: compare_steps(folder),
        }
        wanted = arguments.parts.split(",")
        if unknown := set(wanted) - set(parts):
            parser.error(f"--parts: expected some of {', '.join(parts)}; got {', '.join(sorted(unknown))}")
        images.mkdir(parents=True, exist_ok=True)
        print(reference_line())
        print(f"vehicles on lanes: {in_turn.wait_for_kernels()}")
        for part in wanted:
            table = as_markdown(parts[part]())
            print(f"\n## {part}\n\n{table}", flush=True)
            if arguments.page is not None:
                put_into(arguments.page, part, table)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Compare stories with logs of esmini: `openscenario_logs.py FOLDER`, where FOLDER has `xosc/` and `expected/*.csv.gz`.

Each `expected/NAME.csv.gz` is what `esmini --csv_logger --fixed_timestep 0.05` wrote of `xosc/NAME.xosc`. The story is
told here with `--ego story`, in the frames of the server (20 ms), without a server. An entity's place and speed are
compared at each frame that both have, until the log ends. All times of an entity may differ by one
shift, of `SHIFT` at most.
"""

from __future__ import annotations

import csv
import gzip
import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.records import replace
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.message_types import read_types
from rosbridge_sim.shell.files.story_files import StoryOptions
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.simulator.story.stories import Stories
from rosbridge_sim.world.state.world import DT, Body, World

COMMON = 0.1
"""Time between frames that both have [s]."""

SHIFT = 0.1
"""Largest difference of times [s]."""

GOOD = (0.2, 0.2)
"""Largest difference of a place [m] and of a speed [m/s]."""

Rows = npt.NDArray[np.float64]
"""(n, 5): time, x, y, z, speed."""


def read_log(path: Path) -> dict[str, Rows]:
    """Return the rows of each entity in a log of esmini."""
    with gzip.open(path, "rt", errors="replace") as file:
        lines = [row for row in csv.reader(file, skipinitialspace=True) if row and row[0].isdigit()]
    found: dict[str, list[list[float]]] = {}
    for row in lines:
        for start in range(2, len(row) - 12, 31):
            entity = row[start : start + 31]
            values = [float(row[1]), *map(float, entity[11:14]), float(entity[2])]
            found.setdefault(entity[0], []).append(values)
    return {name: np.array(rows) for name, rows in found.items()}


class Run(NamedTuple):
    """A story that was told: rows and bodies of its entities, times at which events began, and when it was over."""

    rows: dict[str, Rows]
    bodies: dict[str, Body]
    events: dict[str, float]
    over: float


def tell(path: Path, seconds: float, map_name: str | None = None, *, is_lenient: bool = False) -> Run:
    """Tell a story in frames of the world, with `--ego story`, and on another map if one is named."""
    library = DiskLibrary(stories=StoryOptions(is_lenient=is_lenient, drives_ego=True))
    scenario = library.opening_scenario(str(path))
    scenario = replace(scenario, map_name=map_name or scenario.map_name)
    node = make_node(Bus(read_types(Settings())[1]), World(), library, scenario, NodeSettings(start="sync"))
    told, world = node.component(Stories).running, node.context.world
    assert told is not None
    found: dict[str, list[list[float]]] = {name: [] for name in told.state.actors}
    begun: dict[str, float] = {}
    over = math.nan
    for frame in range(math.ceil(seconds / DT) + 2):
        for name, actor in told.state.actors.items():
            if actor.uid in world:
                row = world.row(actor.uid)
                found[name].append([frame * DT, *(getattr(world, key)[row] for key in ("x", "y", "z", "speed"))])
        for number, part in enumerate(told.board.parts):
            if part.kind == "Event" and told.state.board.counts[number]:
                begun.setdefault(f"{told.board.parts[part.parent].name}/{part.name}", told.time())
        if told.state.board.is_over and math.isnan(over):
            over = told.time()
        node.context.stepper.compute(0.0, is_tick=True, is_last=True)
    spawns = (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
    rows = {name: np.array(each) for name, each in found.items() if each}
    return Run(rows, {each.name: each.model.body for each in spawns}, begun, over)


def compare(ours: Rows, theirs: Rows) -> tuple[float, float, float, float]:
    """Return the largest distance [m] and difference of speeds [m/s], the time of the former and the shift [s].

    One shift, of all times, is looked for: the one with the least distance. Steps of the speed may be elsewhere within
    `SHIFT`.
    """
    theirs = theirs[np.abs(theirs[:, 0] / COMMON - np.round(theirs[:, 0] / COMMON)) < 1e-6]
    found = []
    for frames_later in range(-round(SHIFT / DT), round(SHIFT / DT) + 1):
        frames = np.clip(np.round((theirs[:, 0] - ours[0, 0]) / DT).astype(int) + frames_later, 0, len(ours) - 1)
        here = ours[frames]
        apart = np.hypot(here[:, 1] - theirs[:, 1], here[:, 2] - theirs[:, 2])
        faster = np.abs(here[:, 4] - np.abs(theirs[:, 4]))
        found.append((float(apart.max()), faster, float(theirs[apart.argmax(), 0]), frames_later * DT))
    place, _, time, shift = min(found, key=lambda each: (each[0], abs(each[3])))
    return place, float(np.min([each[1] for each in found], axis=0).max()), time, shift


def main() -> int:
    """Print a line for each entity of each log; return 1 if one differs by more than `GOOD`."""
    folder, wanted = Path(sys.argv[1]), set(sys.argv[2:])
    is_good = True
    for log in sorted((folder / "expected").glob("*.csv.gz")):
        name = log.name.removesuffix(".csv.gz")
        if wanted and name not in wanted:
            continue
        theirs = read_log(log)
        seconds = max(rows[-1, 0] for rows in theirs.values())
        try:
            run = tell(folder / "xosc" / f"{name}.xosc", seconds, is_lenient=name in wanted)
        except DocumentError as error:
            print(f"{name}: refused: {error}")
            continue
        events = [f"{event.rpartition('/')[2]} {time:.2f}" for event, time in run.events.items()]
        print(f"{name}: {seconds:.1f} s; events: {', '.join(events)}")
        for entity, rows in theirs.items():
            if entity not in run.rows:
                print(f"  {entity}: is not here")
                is_good = False
                continue
            place, speed, time, shift = compare(run.rows[entity], rows)
            verdict = "good" if place <= GOOD[0] and speed <= GOOD[1] else "differs"
            is_good &= verdict == "good"
            print(f"  {entity}: {verdict}, {place:.2f} m {speed:.2f} m/s at {time:.2f} s (shifted by {shift:.2f} s)")
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())

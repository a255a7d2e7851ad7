"""Compare stories with logs of esmini: `openscenario_logs.py FOLDER`, where FOLDER has `xosc/` and `expected/*.csv.gz`.

Each `expected/NAME.csv.gz` is what `esmini --csv_logger --fixed_timestep 0.05` wrote of `xosc/NAME.xosc`. The story is
told here with `--ego story`, in the frames of the server (20 ms), without a server. An entity's place and speed are
compared at each frame that both have, until the log ends. All times of an entity may differ by one
shift, of `SHIFT` at most.
"""

from __future__ import annotations

import csv
import gzip
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.scenarios.openscenario.places import StoryMap
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.message_types import read_types
from rosbridge_sim.shell.files.story_files import StoryOptions
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.simulator.story.told_story import ToldStory
from rosbridge_sim.world.state.world import DT, World

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


def tell(path: Path, seconds: float, *, is_lenient: bool) -> tuple[dict[str, Rows], list[str]]:
    """Return the same of a story that is told here, and when its events began."""
    library = DiskLibrary(stories=StoryOptions(is_lenient=is_lenient, drives_ego=True))
    scenario = library.opening_scenario(str(path))
    node = make_node(Bus(read_types(Settings())[1]), World(), library, scenario, NodeSettings(start="sync"))
    scene, story = node.context.scene, scenario.story
    assert story is not None
    world, others = node.context.world, (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
    told = ToldStory(scene, story, others, StoryMap.of(scene.road_map))
    told.open()
    found: dict[str, list[list[float]]] = {name: [] for name in told.state.actors}
    begun: dict[int, float] = {}
    for frame in range(round(seconds / DT) + 2):
        for name, actor in told.state.actors.items():
            if actor.uid in world:
                row = world.row(actor.uid)
                found[name].append([frame * DT, *(getattr(world, key)[row] for key in ("x", "y", "z", "speed"))])
        for number, part in enumerate(told.board.parts):
            if part.kind == "Event" and told.state.board.counts[number]:
                begun.setdefault(number, told.time())
        told.move()
        world.frame += 1
        told.tell()
    events = [f"{told.board.parts[number].name} {time:.2f}" for number, time in begun.items()]
    return {name: np.array(rows) for name, rows in found.items() if rows}, events


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
            ours, events = tell(folder / "xosc" / f"{name}.xosc", seconds, is_lenient=name in wanted)
        except DocumentError as error:
            print(f"{name}: refused: {error}")
            continue
        print(f"{name}: {seconds:.1f} s; events: {', '.join(events)}")
        for entity, rows in theirs.items():
            if entity not in ours:
                print(f"  {entity}: is not here")
                is_good = False
                continue
            place, speed, time, shift = compare(ours[entity], rows)
            verdict = "good" if place <= GOOD[0] and speed <= GOOD[1] else "differs"
            is_good &= verdict == "good"
            print(f"  {entity}: {verdict}, {place:.2f} m {speed:.2f} m/s at {time:.2f} s (shifted by {shift:.2f} s)")
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())

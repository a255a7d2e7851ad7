#!/usr/bin/env python3
"""Ten hours of traffic on the built-in maps, and check that it drives as traffic should.

    python scripts/soak/traffic.py [--hours 10] [--maps town,loop] [--processes 2] [--progress FILE]

A *cell* is ten simulated minutes of one map with a number of vehicles and a seed. One vehicle in five is a van, a truck
or a bus. All stand at the start, and all wander within their lanes. A cell counts:

- *overlaps*: pairs of vehicles that begin to touch, as the collision detection says;
- *red lights*: front bumpers that pass a stop line while the light of the lane that is taken is red;
- *stranded*: vehicles that stand for more than three minutes without a break: two cycles of the longest plan;
- *hard braking*: decelerations beyond 6 m/s^2, each with its cause. Such braking is *explained* if the cause is an
  entity that does not follow lanes. Traffic alone must never need it.

Any of these but explained braking is a fault, and the exit code is then 1. Each cell ends with a line of progress. With
`--progress` the lines are kept in a file, and a run that was interrupted goes on with the cells that are not in it.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.morai.catalogue import BUILT_IN, default_model  # noqa: E402
from rosbridge_sim.shell.files.library import DiskLibrary  # noqa: E402
from rosbridge_sim.world.geometry import IntArray  # noqa: E402
from rosbridge_sim.world.lane_conflicts import LaneConflicts  # noqa: E402
from rosbridge_sim.world.lane_following import view_driver  # noqa: E402
from rosbridge_sim.world.lane_position import LaneStart, keep_lanes  # noqa: E402
from rosbridge_sim.world.lane_wander import USUAL_WANDER  # noqa: E402
from rosbridge_sim.world.roads import Roads  # noqa: E402
from rosbridge_sim.world.signal_plan import Lamp, SignalPlan  # noqa: E402
from rosbridge_sim.world.state import DT, Body, Kind, World  # noqa: E402
from rosbridge_sim.world.step import step  # noqa: E402

__all__ = ["CELLS", "Cell", "Outcome", "Watch", "as_table", "populate", "run_cell"]

MINUTES = 10.0
"""Length of a cell."""

CELLS: dict[str, tuple[int, ...]] = {
    "town": (24, 100, 200, 300),
    "loop": (50, 200, 500),
    "motorway": (50, 200, 500),
    "hills": (6, 20),
}
"""Map -> numbers of vehicles: from free to jammed."""

STRANDED = 180.0
"""[s]"""

STANDS = 0.1
"""A slower vehicle stands [m/s]."""

HARD = -6.0
"""Acceleration beyond which braking is hard [m/s^2]."""

SPACE = 8.0
"""Between two vehicles at the start [m]."""

OTHERS = ("Van", "Bus", "Truck")
"""Words in the names of models that every fifth vehicle has."""

MAX_LINES = 10
"""Lines about each sort of fault that are kept of a cell."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Ten minutes of traffic.

    Attributes:
        map_name: of a built-in map.
        num: number of vehicles.
        seed: of the world and of the places.
    """

    map_name: str
    num: int
    seed: int


@dataclass(slots=True)
class Outcome:
    """The findings in one cell.

    Attributes:
        cell: the cell.
        num: vehicles that there was room for.
        minutes: simulated.
        overlaps, red_lights, stranded, hard, explained: see the head of this file; `explained` are some of `hard`.
        speed: mean [km/h].
        hardest: the hardest braking [m/s^2].
        seconds: that the cell took.
        lines: about faults.
    """

    cell: Cell
    num: int = 0
    minutes: float = 0.0
    overlaps: int = 0
    red_lights: int = 0
    stranded: int = 0
    hard: int = 0
    explained: int = 0
    speed: float = 0.0
    hardest: float = 0.0
    seconds: float = 0.0
    lines: list[str] = field(default_factory=list)

    @property
    def num_faults(self) -> int:
        """The number of faults."""
        return self.overlaps + self.red_lights + self.stranded + self.hard - self.explained


class Watch:
    """An observer of a world: it looks at all lane followers after each step.

    Args:
        world: read only. No entity may come or go meanwhile.
        outcome: gets the counts.
    """

    def __init__(self, world: World, outcome: Outcome) -> None:
        self._world, self._outcome = world, outcome
        self._rows = np.flatnonzero(world.alive & world.has_lane)
        self._nose = world.half_length[self._rows] + world.centre[self._rows]
        self._still = np.zeros(len(self._rows))
        self._is_hard = np.zeros(len(self._rows), dtype=bool)
        self._num_lines: Counter[str] = Counter()
        self._touching: set[tuple[int, int]] = set()
        self._total = 0.0
        self._steps = 0
        self._remember()

    def look(self) -> None:
        """Look once, after each step."""
        world, rows = self._world, self._rows
        speed, accel = world.speed[rows], world.accel[rows]
        self._steps += 1
        self._total += float(speed.mean())
        self._outcome.speed = self._total / self._steps * 3.6
        self._look_at_contacts()
        self._look_at_lights()
        stood = self._still
        self._still = np.where(speed > STANDS, 0.0, stood + DT)
        for which in np.flatnonzero((stood <= STRANDED) & (self._still > STRANDED)).tolist():
            self._outcome.stranded += 1
            self._note("stranded", f"uid {world.uid[rows[which]]} stands since {STRANDED:g} s", which)
        hard = accel < HARD
        self._outcome.hardest = min(self._outcome.hardest, float(accel.min()))
        for which in np.flatnonzero(hard & ~self._is_hard).tolist():
            self._outcome.hard += 1
            is_explained = self._note(
                "hard", f"uid {world.uid[rows[which]]} brakes with {accel[which]:.1f} m/s^2", which
            )
            self._outcome.explained += is_explained
        self._is_hard = hard

    def _look_at_contacts(self) -> None:
        contacts = self._world.contacts
        now = {(int(a), int(b)) for a, b in contacts} if len(contacts) else set()
        for a, b in sorted(now - self._touching):
            self._outcome.overlaps += 1
            row = self._world.row(a)
            which = int(self._rows.searchsorted(row))
            known = which if which < len(self._rows) and self._rows[which] == row else None
            self._note("overlap", f"uid {a} and {b} touch", known)
        self._touching = now

    def _look_at_lights(self) -> None:
        """Count those whose front bumper has just come over the end of their lane while the light behind it is red."""
        world, rows, plan = self._world, self._rows, self._world.signals.plan
        lane, before = self._lane, self._rest
        self._remember()
        crosses = (before >= 0.0) & (self._rest < 0.0) & (lane == self._lane) & (world.ahead_1[rows] >= 0)
        if not plan.lights or not crosses.any():
            return
        at = np.flatnonzero(crosses)
        entered = world.ahead_1[rows[at]]
        light = plan.light_of_lane[entered]
        shown = world.signals.shown[light]
        is_red = (light >= 0) & (shown > 0) & ~plan.is_warning[light]
        is_red &= (shown & int(Lamp.RED) != 0) & (shown & plan.pass_of_lane[entered] == 0)
        for which in at[is_red].tolist():
            self._outcome.red_lights += 1
            self._note("red", f"uid {world.uid[rows[which]]} passes a red light", which)

    def _remember(self) -> None:
        world, rows = self._world, self._rows
        self._lane = world.lane[rows].copy()
        self._rest = world.roads.length[self._lane] - world.arc[rows] - self._nose

    def _note(self, sort: str, what: str, which: int | None) -> bool:
        """Keep a line about a fault, and return whether an entity that follows no lanes is the cause."""
        world, outcome = self._world, self._outcome
        words, is_explained = "", False
        if which is not None:
            row = int(self._rows[which])
            place = f"lane {world.roads.ids[world.lane[row]]} at {world.arc[row]:.1f} m, {world.speed[row]:.1f} m/s"
            reason, is_explained = self._reason(row)
            words = f"; {place}; {reason}"
        if self._num_lines[sort] < MAX_LINES:
            self._num_lines[sort] += 1
            outcome.lines.append(f"{world.frame * DT:7.2f} s: {what}{words}")
        return is_explained

    def _reason(self, row: int) -> tuple[str, bool]:
        """Return what the driver of a row sees, and whether that is an entity that follows no lanes."""
        world = self._world
        view = view_driver(world, row)
        if view is None:
            return "follows no lane", False
        words, is_foreign = [], False
        if view.lead_row >= 0:
            lead = view.lead_row
            kind = Kind(world.kind.item(lead)).name.lower()
            is_foreign = not world.has_lane[lead]
            motion = f"{world.speed[lead] * 3.6:.0f} km/h, {world.accel[lead]:.1f} m/s^2"
            words.append(f"lead uid {world.uid[lead]} ({kind}, {motion}) in {view.gap:.1f} m")
        if view.stop.value:
            words.append(f"stops for {view.stop.value} in {view.stop_distance:.1f} m")
        if view.rival_row >= 0:
            words.append(f"gives way to uid {world.uid[view.rival_row]}")
        return ", ".join(words) or "sees nothing", is_foreign


def populate(roads: Roads, plan: SignalPlan | None, cell: Cell) -> World:
    """Return a world with the vehicles of a cell, or as many as there is room for, all at rest.

    Args:
        roads: the lanes.
        plan: their lights.
        cell: what is wanted.
    """
    chance = np.random.default_rng(cell.seed)
    world = World(cell.seed)
    world.lay_roads(roads, plan)
    conflicts = roads.derived(LaneConflicts)
    others = [
        model.body
        for model in BUILT_IN.models
        if model.kind == Kind.VEHICLE and any(word in model.name for word in OTHERS)
    ]
    car = default_model(Kind.VEHICLE).body
    starts: list[tuple[int, float, Body]] = []
    for lane in np.flatnonzero(np.isinf(conflicts.wait_point) & (conflicts.shared == 0.0)).tolist():
        s = 0.5 * SPACE
        while True:
            body = others[int(chance.integers(len(others)))] if others and chance.random() < 0.2 else car
            if s + body.length + 0.5 * SPACE > roads.length[lane]:
                break
            starts.append((lane, s + 0.5 * body.length - body.centre, body))
            s += body.length + SPACE
    chosen: IntArray = chance.permutation(len(starts))[: cell.num]
    with world.room_for(len(chosen)):
        rows = [world.row(world.spawn(Kind.VEHICLE, starts[i][2], name="npc", x=0.0, y=0.0)) for i in chosen.tolist()]
    places = [(row, starts[i][0], starts[i][1]) for row, i in zip(rows, chosen.tolist(), strict=True)]
    keep_lanes(world, [LaneStart(row, lane, s, wander=USUAL_WANDER) for row, lane, s in places])
    return world


def run_cell(cell: Cell, minutes: float = MINUTES) -> Outcome:
    """Run a cell.

    Args:
        cell: the cell.
        minutes: simulated.
    """
    begun = time.perf_counter()
    road_map = DiskLibrary().map(cell.map_name)
    world = populate(road_map.roads, road_map.plan, cell)
    outcome = Outcome(cell, num=len(world), minutes=minutes)
    watch = Watch(world, outcome)
    for _ in range(round(minutes * 60.0 / DT)):
        step(world)
        watch.look()
    outcome.seconds = time.perf_counter() - begun
    return outcome


def cells_of(hours: float, maps: Sequence[str], first_seed: int) -> list[Cell]:
    """Return the cells of a run: all maps and densities with one seed after the other, until the time is full.

    Args:
        hours: simulated, in all.
        maps: names of maps.
        first_seed: of the first round.
    """
    sorts = [(name, num) for name in maps for num in CELLS[name]]
    num = max(1, math.ceil(hours * 60.0 / MINUTES - 1e-9))
    return [Cell(*sorts[i % len(sorts)], first_seed + i // len(sorts)) for i in range(num)]


def as_table(outcomes: Iterable[Outcome]) -> str:
    """Return a Markdown table with a row for each map and density.

    Args:
        outcomes: of the cells.
    """
    sums: dict[tuple[str, int], list[Outcome]] = {}
    for each in outcomes:
        sums.setdefault((each.cell.map_name, each.num), []).append(each)
    lines = [
        "| map | vehicles | simulated | mean speed | overlaps | red lights | stranded | hard braking | hardest |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for (name, num), group in sorted(sums.items()):
        totals = [sum(getattr(each, what) for each in group) for what in ("overlaps", "red_lights", "stranded")]
        hard, explained = sum(each.hard for each in group), sum(each.explained for each in group)
        braking = f"{hard} ({explained} explained)" if explained else str(hard)
        cells = [
            *(name, str(num), f"{sum(each.minutes for each in group):g} min"),
            f"{sum(each.speed for each in group) / len(group):.1f} km/h",
            *map(str, totals),
            braking,
            f"{min(each.hardest for each in group):.1f} m/s²",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _read(progress: Path) -> list[Outcome]:
    """Return the outcomes in a file of progress; a last line that was cut is left out."""
    outcomes = []
    for line in progress.read_text(encoding="utf-8").splitlines():
        try:
            values = json.loads(line)
        except ValueError:
            continue
        outcomes.append(Outcome(Cell(**values.pop("cell")), **values))
    return outcomes


def _report(outcome: Outcome) -> None:
    cell = outcome.cell
    found = f"{outcome.overlaps} overlaps, {outcome.red_lights} red lights, {outcome.stranded} stranded"
    braking = f"{outcome.hard} hard braking ({outcome.explained} explained), hardest {outcome.hardest:.1f} m/s^2"
    print(
        f"{cell.map_name} {outcome.num} seed {cell.seed}: {outcome.speed:.1f} km/h, {found}, {braking};"
        f" {outcome.seconds:.0f} s",
        flush=True,
    )
    for line in outcome.lines:
        print(f"    {line}", flush=True)


def main() -> int:
    """Run all cells; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--hours", type=float, default=10.0, help="simulated time in all [%(default)s]")
    parser.add_argument("--maps", default=",".join(CELLS), help="names of maps [%(default)s]")
    parser.add_argument("--seed", type=int, default=0, help="first seed [%(default)s]")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="[%(default)s]")
    parser.add_argument("--progress", type=Path, help="file that keeps what is done")
    options = parser.parse_args()
    maps = options.maps.split(",")
    if unknown := [name for name in maps if name not in CELLS]:
        parser.error(f"--maps: expected some of {', '.join(CELLS)}; got {', '.join(unknown)}")
    cells = cells_of(options.hours, maps, options.seed)
    done = _read(options.progress) if options.progress is not None and options.progress.exists() else []
    outcomes = [each for each in done if each.cell in cells]
    left = [cell for cell in cells if cell not in {each.cell for each in outcomes}]
    print(f"{len(cells)} cells, {len(outcomes)} of them done before", flush=True)
    with ProcessPoolExecutor(options.processes, mp_context=get_context("spawn")) as pool:
        for future in as_completed([pool.submit(run_cell, cell) for cell in left]):
            outcome = future.result()
            outcomes.append(outcome)
            _report(outcome)
            if options.progress is not None:
                with options.progress.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(outcome)) + "\n")
    print(as_table(outcomes))
    num = sum(each.num_faults for each in outcomes)
    print("good" if not num else f"NOT GOOD: {num} faults")
    return 1 if num else 0


if __name__ == "__main__":
    sys.exit(main())

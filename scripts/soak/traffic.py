#!/usr/bin/env python3
"""Ten hours of traffic on the built-in maps, and check that it drives as traffic should.

    python scripts/soak/traffic.py [--hours 10] [--maps town,loop] [--processes 2] [--progress FILE]

A *cell* is ten simulated minutes of one map with a number of vehicles and a seed; some cells have people who cross the
roads, too. One vehicle in five is a van, a truck or a bus, but on the map `parking`, where other cars are parked. All
stand at the start, and wander within their lanes then. A cell counts:

- *overlaps*: pairs of vehicles that begin to touch, as the collision detection says;
- *red lights*: front bumpers that pass a stop line while the light of the lane that is taken is red;
- *stranded*: vehicles that stand for more than three minutes without a break: two cycles of the longest plan;
- *hard braking*: decelerations beyond 6 m/s^2, each with its cause. Such braking is *explained* if the cause is an
  entity that neither follows lanes nor heeds the traffic. Traffic alone must never need it;
- *too fast in bends*: vehicles whose lateral acceleration begins to be greater than any driver of their class accepts.
  It is the speed times the change of the yaw within a frame, as a gyroscope and an odometer at the rear axle read it;
- *hits*: people and vehicles that begin to touch;
- *bumps*: pairs of people who begin to touch; a body is a disc as wide as the mean of its length and width;
- *waiting*: people who stand for more than three minutes without a break;
- *braking for people*: that part of the hard braking whose cause is a pedestrian.

Any of these but explained braking is a fault, and the exit code is then 1. Each cell ends with a line of progress. With
`--progress` the lines are kept in a file, and a run that was interrupted goes on with the cells that are not in it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.world.drivers.driver_parameters import CAR, DriverParameters, classes_of  # noqa: E402
from rosbridge_sim.world.followers.lane_following import view_driver  # noqa: E402
from rosbridge_sim.world.geometry.planar import IntArray, wrap_angle  # noqa: E402
from rosbridge_sim.world.roads.signal_plan import Lamp  # noqa: E402
from rosbridge_sim.world.state.world import DT, Kind, World  # noqa: E402
from rosbridge_sim.world.step import step  # noqa: E402
from scripts.soak.traffic_cells import CELLS, MINUTES, Cell, cells_of, world_of  # noqa: E402

STRANDED = 180.0
"""[s]"""

STANDS = 0.1
"""A slower vehicle or pedestrian stands [m/s]."""

HARD = -6.0
"""Acceleration beyond which braking is hard [m/s^2]."""

MAX_LINES = 10
"""Lines about each sort of fault that are kept of a cell."""


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
        bends: vehicles too fast in bends; see the head of this file.
        across: the greatest lateral acceleration of a car [m/s^2].
        seconds: that the cell took.
        lines: about faults.
        people: pedestrians.
        hits, bumps, waiting, for_people: see the head of this file; `for_people` are some of `hard`.
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
    people: int = 0
    hits: int = 0
    bumps: int = 0
    waiting: int = 0
    for_people: int = 0
    bends: int = 0
    across: float = 0.0

    @property
    def num_faults(self) -> int:
        """The number of faults."""
        of_vehicles = self.overlaps + self.red_lights + self.stranded + self.hard - self.explained
        return of_vehicles + self.bends + self.hits + self.bumps + self.waiting


class Watch:
    """An observer of a world: it looks at all lane followers and pedestrians after each step.

    Args:
        world: read only. No entity may come or go meanwhile.
        outcome: gets the counts.
    """

    def __init__(self, world: World, outcome: Outcome) -> None:
        self._world, self._outcome = world, outcome
        self._rows = np.flatnonzero(world.alive & world.has_lane)
        self._people = np.flatnonzero(world.alive & (world.kind == Kind.PEDESTRIAN))
        self._waited = np.zeros(len(self._people))
        self._bumping: set[tuple[int, int]] = set()
        self._nose = world.half_length[self._rows] + world.centre[self._rows]
        self._still = np.zeros(len(self._rows))
        self._is_hard = np.zeros(len(self._rows), dtype=bool)
        self._num_lines: Counter[str] = Counter()
        self._touching: set[tuple[int, int]] = set()
        rows = self._rows
        lengths, widths = 2.0 * world.half_length[rows], 2.0 * world.half_width[rows]
        self._is_car = classes_of(lengths, widths, world.height[rows]) == CAR
        self._most_lateral = DriverParameters.of(world, rows).most_lateral
        self._is_fast = np.zeros(len(rows), dtype=bool)
        self._yaw, self._speed = world.yaw[rows].copy(), world.speed[rows].copy()
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
        self._look_at_bends()
        stood = self._still
        self._still = np.where(speed > STANDS, 0.0, stood + DT)
        for which in np.flatnonzero((stood <= STRANDED) & (self._still > STRANDED)).tolist():
            self._outcome.stranded += 1
            self._note("stranded", f"uid {world.uid[rows[which]]} stands since {STRANDED:g} s", which)
        hard = accel < HARD
        self._outcome.hardest = min(self._outcome.hardest, float(accel.min()))
        for which in np.flatnonzero(hard & ~self._is_hard).tolist():
            self._outcome.hard += 1
            cause = self._note("hard", f"uid {world.uid[rows[which]]} brakes with {accel[which]:.1f} m/s^2", which)
            if cause >= 0 and not world.has_lane[cause]:
                self._outcome.explained += world.yields.item(cause) == 0
                self._outcome.for_people += world.kind.item(cause) == Kind.PEDESTRIAN
        self._is_hard = hard
        if len(self._people):
            self._look_at_people()

    def _look_at_contacts(self) -> None:
        contacts = self._world.contacts
        now = {(int(a), int(b)) for a, b in contacts} if len(contacts) else set()
        for a, b in sorted(now - self._touching):
            people = [uid for uid in (a, b) if self._world.kind[self._world.row(uid)] == Kind.PEDESTRIAN]
            if people:
                self._outcome.hits += 1
                car = a + b - people[0]
                self._note("hit", f"uid {car} and pedestrian {self._describe(people[0])} touch", self._which(car))
            else:
                self._outcome.overlaps += 1
                self._note("overlap", f"uid {a} and {b} touch", self._which(a))
        self._touching = now

    def _look_at_bends(self) -> None:
        world, rows = self._world, self._rows
        yaw, speed = world.yaw[rows], world.speed[rows]
        across = np.abs(wrap_angle(yaw - self._yaw)) / DT * 0.5 * (speed + self._speed)
        self._yaw, self._speed = yaw, speed
        self._outcome.across = max(self._outcome.across, float(across[self._is_car].max(initial=0.0)))
        is_fast = across > self._most_lateral
        for which in np.flatnonzero(is_fast & ~self._is_fast).tolist():
            self._outcome.bends += 1
            self._note("bend", f"uid {world.uid[rows[which]]} drives with {across[which]:.2f} m/s^2 across", which)
        self._is_fast = is_fast

    def _look_at_people(self) -> None:
        """Count those that walk into one another, and those that wait too long."""
        world, rows = self._world, self._people
        waited = self._waited
        self._waited = np.where(world.speed[rows] > STANDS, 0.0, waited + DT)
        for which in np.flatnonzero((waited <= STRANDED) & (self._waited > STRANDED)).tolist():
            self._outcome.waiting += 1
            self._note(
                "waiting", f"pedestrian {self._describe(world.uid.item(rows[which]))} stands since {STRANDED:g} s"
            )
        now = set(_find_bumps(world, rows))
        for a, b in sorted(now - self._bumping):
            self._outcome.bumps += 1
            self._note("bump", f"pedestrians {self._describe(a)} and {self._describe(b)} touch")
        self._bumping = now

    def _which(self, uid: int) -> int | None:
        """Return the index of a lane follower; None for any other entity."""
        row = self._world.row(uid)
        which = int(self._rows.searchsorted(row))
        return which if which < len(self._rows) and self._rows[which] == row else None

    def _describe(self, uid: int) -> str:
        world = self._world
        row = world.row(uid)
        return f"{uid} at ({world.x[row]:.1f}, {world.y[row]:.1f}), {world.speed[row]:.1f} m/s"

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

    def _note(self, sort: str, what: str, which: int | None = None) -> int:
        """Keep a line about a fault, and return the row of the entity that is the cause; -1 for none."""
        world, outcome = self._world, self._outcome
        words, cause = "", -1
        if which is not None:
            row = int(self._rows[which])
            place = f"lane {world.roads.ids[world.lane[row]]} at {world.arc[row]:.1f} m, {world.speed[row]:.1f} m/s"
            reason, cause = self._reason(row)
            words = f"; {place}; {reason}"
        if self._num_lines[sort] < MAX_LINES:
            self._num_lines[sort] += 1
            outcome.lines.append(f"{world.frame * DT:7.2f} s: {what}{words}")
        return cause

    def _reason(self, row: int) -> tuple[str, int]:
        """Return what the driver of a row sees, and the row of the entity ahead; -1 for none."""
        world = self._world
        view = view_driver(world, row)
        if view is None:
            return "follows no lane", -1
        words = []
        if view.lead >= 0:
            lead = view.lead
            kind = Kind(world.kind.item(lead)).name.lower()
            motion = f"{world.speed[lead] * 3.6:.0f} km/h, {world.accel[lead]:.1f} m/s^2"
            words.append(f"lead uid {world.uid[lead]} ({kind}, {motion}) in {view.gap:.1f} m")
        if view.stop.value:
            words.append(f"stops for {view.stop.value} in {view.stop_distance:.1f} m")
        if view.rival >= 0:
            words.append(f"gives way to uid {world.uid[view.rival]}")
        return ", ".join(words) or "sees nothing", view.lead


def _find_bumps(world: World, rows: IntArray) -> list[tuple[int, int]]:
    """Return the pairs of ids of pedestrians that touch: discs as wide as the mean of length and width.

    Args:
        world: read only.
        rows: of the pedestrians.
    """
    place = world.x[rows] + 1j * world.y[rows]
    radius = 0.5 * (world.half_length[rows] + world.half_width[rows])
    a, b = np.nonzero(np.triu(np.abs(place[:, None] - place) < radius[:, None] + radius, 1))
    return list(zip(world.uid[rows[a]].tolist(), world.uid[rows[b]].tolist(), strict=True))


def run_cell(cell: Cell, minutes: float = MINUTES) -> Outcome:
    """Run a cell.

    Args:
        minutes: simulated.
    """
    begun = time.perf_counter()
    world = world_of(cell)
    num = int((world.alive & world.has_lane).sum())
    people = int((world.alive & (world.kind == Kind.PEDESTRIAN)).sum())
    outcome = Outcome(cell, num=num, people=people, minutes=minutes)
    watch = Watch(world, outcome)
    for _ in range(round(minutes * 60.0 / DT)):
        step(world)
        watch.look()
    outcome.seconds = time.perf_counter() - begun
    return outcome


def as_table(outcomes: Iterable[Outcome]) -> str:
    """Return a Markdown table with a row for each map and density.

    Args:
        outcomes: of the cells.
    """
    sums: dict[tuple[str, int, int], list[Outcome]] = {}
    for each in outcomes:
        sums.setdefault((each.cell.map_name, each.num, each.people), []).append(each)
    names = ("overlaps", "red_lights", "stranded", "bends", "hits", "bumps", "waiting")
    heads = [
        *("map", "vehicles", "people", "simulated", "mean speed"),
        *(name.replace("_", " ") for name in names),
        *("hard braking", "hardest", "across"),
    ]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for (name, num, people), group in sorted(sums.items()):
        totals = [sum(getattr(each, what) for each in group) for what in names]
        hard, explained = sum(each.hard for each in group), sum(each.explained for each in group)
        braking = f"{hard} ({explained} explained)" if explained else str(hard)
        cells = [
            *(name, str(num), str(people), f"{sum(each.minutes for each in group):g} min"),
            f"{sum(each.speed for each in group) / len(group):.1f} km/h",
            *map(str, totals),
            braking,
            f"{min(each.hardest for each in group):.1f} m/s²",
            f"{max(each.across for each in group):.2f} m/s²",
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
    found += f", {outcome.bends} too fast in bends (cars {outcome.across:.2f} m/s^2)"
    braking = f"{outcome.hard} hard braking ({outcome.explained} explained), hardest {outcome.hardest:.1f} m/s^2"
    if outcome.people:
        found += f", {outcome.people} people: {outcome.hits} hits, {outcome.bumps} bumps, {outcome.waiting} waiting"
        braking += f", {outcome.for_people} for people"
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

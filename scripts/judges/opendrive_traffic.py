"""Let traffic drive for ten minutes on OpenDRIVE maps, with their lights.

    scripts/judges/opendrive_traffic.py FILE.xodr... [--vehicles 60] [--minutes 10]

Vehicles come and go as with `--traffic`. Prints for each file: vehicles that were there, their mean speed, contacts,
and vehicles that stood for more than three minutes without a break, with the places of the first ones. Exit code 1 if
any.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.followers.lane_following import view_driver
from rosbridge_sim.world.state.world import DT, World
from tests.simulator.sim_harness import Client, make_store

STRANDED = 180.0
"""[s]"""

STANDS = 0.1
"""A slower vehicle stands [m/s]."""

EMPTY = json.dumps({"mapInfo": {"mapName": "any"}}).encode()


def drive(path: Path, num: int, minutes: float) -> tuple[str, bool]:
    """Return a line about a map, and whether nothing went wrong."""
    library, bus, world = DiskLibrary(own_map=str(path)), Bus(make_store()), World(1)
    scenario = read_scenario(EMPTY, "empty.json", catalogue=library.catalogue)
    make_node(bus, world, library, scenario, NodeSettings(start_mode="external", traffic=num, start="sync"))
    world.x[world.row(FIRST_EGO)] = 1e5  # it would stand in the way
    client = Client(bus, "/judge")
    client.start()
    seen: set[int] = set()
    touching: set[tuple[int, int]] = set()
    since: dict[int, int] = {}
    told: list[str] = []
    contacts = stranded = 0
    total = count = 0.0

    def place(uid: int) -> str:
        row = world.row(uid)
        lane = world.roads.ids[world.lane[row]] if world.has_lane[row] else "no lane"
        view = view_driver(world, row)
        why = "" if view is None else f" (stops for {view.stop.value or 'nothing'}, rival {view.rival_row})"
        return f"{uid} on {lane} at {world.arc[row]:.0f} m, {world.speed[row]:.1f} m/s{why}"

    for frame in range(round(minutes * 60.0 / DT)):
        client.tick(frame=frame)
        rows = np.flatnonzero(world.alive & world.has_lane)
        uids, speeds = world.uid[rows].tolist(), world.speed[rows]
        seen.update(uids)
        total, count = total + float(speeds.sum()), count + len(rows)
        now = {(int(a), int(b)) for a, b in world.contacts}
        for a, b in sorted(now - touching):
            contacts += 1
            told.append(f"{frame * DT:.1f} s: contact of {place(a)} and {place(b)}")
        touching = now
        still = {uid for uid, speed in zip(uids, speeds.tolist(), strict=True) if speed < STANDS}
        since = {uid: since.get(uid, frame) for uid in still}
        for uid, begun in since.items():
            if frame - begun == round(STRANDED / DT):
                stranded += 1
                told.append(f"{frame * DT:.1f} s: stands for {STRANDED:g} s: {place(uid)}")
    speed = 3.6 * total / max(count, 1.0)
    text = f"{path.name}: {len(seen)} vehicles, {speed:.1f} km/h, {contacts} contacts, {stranded} stranded"
    return "\n    ".join([text, *told[:12]]), not contacts and not stranded


def main() -> int:
    """Run the judge on files."""
    parser = argparse.ArgumentParser()
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--vehicles", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=10.0)
    options = parser.parse_args()
    all_good = True
    for path in options.files:
        text, is_good = drive(path, options.vehicles, options.minutes)
        print(("good " if is_good else "BAD  ") + text, flush=True)
        all_good &= is_good
    return 0 if all_good else 1


if __name__ == "__main__":
    sys.exit(main())

"""Let traffic drive for ten minutes on OpenDRIVE maps, with their lights.

    scripts/judges/opendrive_traffic.py FILE_OR_FOLDER... [--vehicles 60] [--minutes 10] [--seed 1]

Vehicles come and go as with `--traffic`. Prints for each file: vehicles that were there, their mean speed, contacts,
the longest stand, and vehicles that stood for more than three minutes without a break, with the places of the first
ones and what they waited for. At the end it tells the causes of a jam: those that have stood for a minute and wait
neither for a light nor for the vehicle ahead. Exit code 1 if there was a contact or a stand of three minutes.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.drivers.driver_perception import Stop
from rosbridge_sim.world.followers.lane_following import view_driver
from rosbridge_sim.world.state.world import DT, World
from tests.simulator.sim_harness import Client, make_store

STRANDED = 180.0
"""[s]"""

LONG = 60.0
"""A stand whose cause is told at the end [s]."""

STANDS = 0.1
"""A slower vehicle stands [m/s]."""

EMPTY = json.dumps({"mapInfo": {"mapName": "any"}}).encode()


def _place(world: World, uid: int) -> str:
    """Return where a vehicle is, and what it waits for."""
    row = world.row(uid)
    lane = world.roads.ids[world.lane[row]] if world.has_lane[row] else "no lane"
    view = view_driver(world, row)
    why = ""
    if view is not None:
        rows = {"behind": view.lead if view.is_following else -1, "rival": view.rival}
        why = ", ".join(f"{name} {_uid(world, other)}" for name, other in rows.items() if other >= 0)
        stop_lane = f" before {world.roads.ids[view.stop_lane]}" if view.stop_lane >= 0 else ""
        why = f" (stops for {view.stop.value or 'nothing'}{stop_lane}{', ' * bool(why)}{why})"
    return f"{uid} on {lane} at {world.arc[row]:.0f} of {world.roads.length[world.lane[row]]:.0f} m{why}"


def _uid(world: World, row: int) -> str:
    lane = world.roads.ids[world.lane[row]] if world.has_lane[row] else "no lane"
    return f"{world.uid[row]} on {lane}"


def _causes(world: World, uids: Iterable[int]) -> list[str]:
    """Return the places of those vehicles that wait neither for a light nor for the vehicle ahead."""
    views = {uid: view_driver(world, world.row(uid)) for uid in uids}
    found = [uid for uid, view in views.items() if view is not None and view.stop not in {Stop.NONE, Stop.LIGHT}]
    return [_place(world, uid) for uid in found]


def drive(path: Path, num: int, minutes: float, seed: int) -> tuple[str, bool]:
    """Return a line about a map, and whether nothing went wrong."""
    library, bus, world = DiskLibrary(own_map=str(path)), Bus(make_store()), World(seed)
    scenario = read_scenario(EMPTY, "empty.json", catalogue=library.catalogue)
    make_node(bus, world, library, scenario, NodeSettings(start_mode="external", traffic=num, start="sync"))
    world.x[world.row(FIRST_EGO)] = 1e5  # it would stand in the way
    client = Client(bus, "/judge")
    client.start()
    seen: set[int] = set()
    touching: set[tuple[int, int]] = set()
    since: dict[int, int] = {}
    told: list[str] = []
    contacts = stranded = longest = 0
    total = count = 0.0

    for frame in range(round(minutes * 60.0 / DT)):
        client.tick(frame=frame)
        rows = np.flatnonzero(world.alive & world.has_lane)
        uids, speeds = world.uid[rows].tolist(), world.speed[rows]
        seen.update(uids)
        total, count = total + float(speeds.sum()), count + len(rows)
        now = {(int(a), int(b)) for a, b in world.contacts}
        for a, b in sorted(now - touching):
            contacts += 1
            told.append(f"{frame * DT:.1f} s: contact of {_place(world, a)} and {_place(world, b)}")
        touching = now
        still = {uid for uid, speed in zip(uids, speeds.tolist(), strict=True) if speed < STANDS}
        since = {uid: since.get(uid, frame) for uid in still}
        longest = max(longest, frame - min(since.values(), default=frame))
        for uid, begun in since.items():
            if frame - begun == round(STRANDED / DT):
                stranded += 1
                told.append(f"{frame * DT:.1f} s: stands for {STRANDED:g} s: {_place(world, uid)}")
    speed = 3.6 * total / max(count, 1.0)
    text = f"{path.name}: {len(seen)} vehicles, {speed:.1f} km/h, {contacts} contacts, {stranded} stranded"
    text += f", longest stand {longest * DT:.0f} s"
    told = told[:12] + [
        f"at the end: {one}" for one in _causes(world, [u for u, b in since.items() if frame - b > LONG / DT])
    ]
    return "\n    ".join([text, *told]), not contacts and not stranded


def main() -> int:
    """Run the judge on files."""
    parser = argparse.ArgumentParser()
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--vehicles", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    all_good = True
    paths = [each for path in options.files for each in (sorted(path.rglob("*.xodr")) if path.is_dir() else [path])]
    for path in paths:
        text, is_good = drive(path, options.vehicles, options.minutes, options.seed)
        print(("good " if is_good else "BAD  ") + text, flush=True)
        all_good &= is_good
    return 0 if all_good else 1


if __name__ == "__main__":
    sys.exit(main())

"""Read a large OpenDRIVE file in a thread beside an event loop.

    scripts/judges/opendrive_large.py FILE.xodr [--copies 30]

Writes copies of the file's roads, junctions and controllers side by side into one file, with ids of their own, reads it
as the server does, and prints its size and roads, the CPU time, the peak memory, and the longest wait of the loop. On a
machine with other work a wait is longer; so the most CPU time of the reading thread within a wait is printed, too.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import resource
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.serving import YOUNG_OBJECTS
from rosbridge_sim.shell.files.library import read_map_at
from rosbridge_sim.shell.files.thread_reader import ThreadReader

STEP = 0.002
"""The bystander looks at the clock so often [s]."""

NAMES = {
    "road": ("id", "junction"),
    "junction": ("id",),
    "predecessor": ("elementId",),
    "successor": ("elementId",),
    "connection": ("incomingRoad", "connectingRoad"),
    "controller": ("id",),
    "control": ("signalId",),
    "signal": ("id",),
    "signalReference": ("id",),
}
"""Attributes with ids that are unique in a file."""


def copies(path: Path, num: int) -> Iterator[bytes]:
    """Yield the parts of a file with copies of its elements, each a few kilometres farther east."""
    root = ET.parse(path).getroot()  # noqa: S314 - a sample
    yield b"<OpenDRIVE>" + ET.tostring(root[0])
    ids = [
        (one, key, one.get(key))
        for one in root.iter()
        for key in NAMES.get(one.tag, ())
        if one.get(key) not in {None, "-1"}
    ]
    shapes = [(one, float(one.get("x", "0"))) for one in root.iter("geometry")]
    for i in range(num):
        for one, key, name in ids:
            one.set(key, f"{i}-{name}")
        for one, x in shapes:
            one.set("x", repr(x + 3_000.0 * i))
        yield b"".join(ET.tostring(one) for one in root if one.tag != "header")
    yield b"</OpenDRIVE>"


async def read(path: Path) -> tuple[RoadMap, float, float, float]:
    """Return the map, the CPU time, the longest wait of the loop, and the thread's most CPU time in a wait [s]."""
    loop = asyncio.get_running_loop()
    reader = ThreadReader(loop, 600.0)
    done: asyncio.Future[RoadMap] = loop.create_future()
    gc.collect()
    gc.freeze()  # as a server at its start
    gc.set_threshold(YOUNG_OBJECTS, *gc.get_threshold()[1:])
    begun = time.process_time()
    longest = busiest = 0.0
    reader.read(lambda: read_map_at(path), lambda outcome, _: done.set_result(outcome), loop.time())  # type: ignore[arg-type]
    thread = next(each for each in threading.enumerate() if each.name == "reading")
    assert thread.ident is not None
    clock = time.pthread_getcpuclockid(thread.ident)
    while not done.done():
        before = time.perf_counter(), time.clock_gettime(clock)
        await asyncio.sleep(STEP)
        longest = max(longest, time.perf_counter() - before[0] - STEP)
        if thread.is_alive():
            busiest = max(busiest, time.clock_gettime(clock) - before[1])
    return done.result(), time.process_time() - begun, longest, busiest


def main() -> None:
    """Run the judge on a file."""
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    parser.add_argument("--copies", type=int, default=30)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.xodr"
        with path.open("wb") as file:
            file.writelines(copies(options.file, options.copies))
        num_roads = path.read_bytes().count(b"<road ")
        size = path.stat().st_size
        idle = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{size / 1e6:.0f} MB, {num_roads:,} roads; before: {idle:.0f} MB of memory at most", flush=True)
        road_map, seconds, longest, busiest = asyncio.run(read(path))
    if isinstance(road_map, Exception):
        raise road_map
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{len(road_map.roads):,} lanes, {len(road_map.roads.points):,} points; {seconds:.1f} s of CPU time, "
        f"{peak:.0f} MB at most, the loop waited {1e3 * longest:.0f} ms at most, for {1e3 * busiest:.0f} ms of "
        "CPU time of the reading thread at most"
    )
    for note in road_map.notes:
        print("   ", note[:200])


if __name__ == "__main__":
    main()

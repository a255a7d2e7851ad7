"""Real-time factor of a server with many vehicles, of which one client gets the whole list five times a second.

The vehicles are on a plane, far from each other: all drive straight ahead, all stand, or all follow paths. Each row is
one way in which the client subscribes to `/Object_topic`. The measured factor is simulated time by wall time. A server
that was too slow for a moment catches up afterwards, and is faster than real time meanwhile. So the time that counts
begins after the first second in which it does not catch up. The client only counts bytes, on another core.

    python -m scripts.bench.objects [--objects 10000] [--seconds 10] [--motions straight,stand,path]

It exits with code 1 if a row is below 0.98.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import sys
import time

from websockets.asyncio.client import ClientConnection, connect

from rosbridge_sim.client import AsyncClient
from scripts.bench.program import SERVER, Program, machine, running

LEAST_FACTOR = 0.98
"""Real-time factor that each row must reach: what is lost is the measurement's own."""

SPAWN, SPAWN_PATHS = 100, 20
"""Objects in one call, without and with paths: the most that it takes."""

APART = 40.0
"""Distance of the vehicles [m]: none touches another one."""

CATCHING_UP = 1.01
"""A higher factor over a second means that the server has frames to catch up; two clock messages lie 20 ms apart."""

MOST_PATIENCE = 60.0
"""Longest wait for the end of that [s]."""

MOTIONS = ("straight", "stand", "path")
"""Behaviours of the vehicles, each on a server of its own."""

WAYS: tuple[tuple[str, dict[str, object] | None], ...] = (
    ("nobody listens", None),
    ("JSON, 5 Hz", {"throttle_rate": 200}),
    ("CBOR, 5 Hz", {"throttle_rate": 200, "compression": "cbor"}),
    ("cbor-raw, 5 Hz", {"throttle_rate": 200, "compression": "cbor-raw"}),
)


async def main() -> int:
    """Measure all rows, and print them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--objects", type=int, default=10_000, help="vehicles [%(default)s]")
    parser.add_argument("--seconds", type=float, default=10.0, help="time of each measurement [%(default)s]")
    parser.add_argument("--motions", default=",".join(MOTIONS), help="behaviours of the vehicles [%(default)s]")
    arguments = parser.parse_args()
    print(machine())
    is_good = True
    for motion in arguments.motions.split(","):
        with running((*SERVER, "--scenario", "loop")) as program:
            await spawn(program, arguments.objects, motion)
            for name, options in WAYS:
                factor, num, size = await measure(program, options, arguments.seconds)
                is_good &= factor >= LEAST_FACTOR
                print(f"{motion:8} {name:16} {arguments.objects:>6} objects   factor {factor:5.3f}", end="")
                print(f"   {num:5.1f} messages/s  {size} B", flush=True)
    return 0 if is_good else 1


async def spawn(program: Program, num: int, motion: str) -> None:
    """Fill the plane with vehicles."""
    async with AsyncClient(f"ws://127.0.0.1:{program.port}") as client:
        objects = []
        for i in range(num):
            x, y = APART * (i % 100), 5e3 + APART * (i // 100)
            each: dict[str, object] = {
                "model": "2015_Kia_K5",
                "place": {"x": x, "y": y, "z": 0.0},
                "behaviour": motion,
                "speed": 0.0 if motion == "stand" else 5.0 + 0.001 * (i % 100),
            }
            if motion == "path":  # a square of 20 m
                corners = ((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0))
                each |= {"path": [{"x": x + dx, "y": y + dy, "z": 0.0} for dx, dy in corners], "loop": True}
            objects.append(each)
        await client.start_sync()  # the world stands meanwhile, so that it has nothing to make up for
        step = SPAWN_PATHS if motion == "path" else SPAWN
        for first in range(0, num, step):
            await client.spawn_all(objects[first : first + step])
        await client.stop_sync()


async def measure(program: Program, options: dict[str, object] | None, seconds: float) -> tuple[float, float, int]:
    """Return real-time factor, messages a second, and the size of the last one [bytes]."""
    url = f"ws://127.0.0.1:{program.port}"
    async with connect(url, max_size=None, compression=None) as clock, connect(url, max_size=None) as listener:
        await clock.send(json.dumps({"op": "subscribe", "topic": "/clock", "throttle_rate": 100}))
        if options is not None:
            await listener.send(json.dumps({"op": "subscribe", "topic": "/Object_topic", **options}))
        sizes: list[int] = []
        count = asyncio.create_task(_count(listener, sizes))
        await _catch_up(clock)
        sizes.clear()
        begun, start = await _simulated(clock)
        now, end = begun, start
        while now - begun < seconds:
            now, end = await _simulated(clock)
        count.cancel()
        return (end - start) / (now - begun), len(sizes) / (now - begun), sizes[-1] if sizes else 0


async def _catch_up(clock: ClientConnection) -> None:
    """Wait until the server is not ahead of real time for a second, which begins after the first messages."""
    first, _ = await _simulated(clock)
    now, factor = first, math.inf
    while factor > CATCHING_UP and now - first < MOST_PATIENCE:
        begun, start = await _simulated(clock)
        now, end = begun, start
        while now - begun < 1.0:
            now, end = await _simulated(clock)
        factor = (end - start) / (now - begun)


async def _simulated(clock: ClientConnection) -> tuple[float, float]:
    """Return the arrival of the next message on `/clock`, and its time [s]."""
    stamp = json.loads(await clock.recv())["msg"]["clock"]
    return time.perf_counter(), float(stamp["secs"] + 1e-9 * stamp["nsecs"])


async def _count(listener: ClientConnection, sizes: list[int]) -> None:
    while True:
        sizes.append(len(await listener.recv()))


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))

"""Real-time factor of a server with many vehicles, of which one client gets the whole list five times a second.

The vehicles drive straight ahead on a plane, far from each other. Each row is one way in which the client subscribes to
`/Object_topic`. The measured factor is simulated time by wall time, over the named time; it is 1 where the server keeps
up. The client only counts bytes, on another core.

    python -m scripts.bench.objects [--objects 10000] [--seconds 5]

It exits with code 1 if a row is below 0.98.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
import time

from websockets.asyncio.client import ClientConnection, connect

from rosbridge_sim.client import AsyncClient
from scripts.bench.program import SERVER, Program, machine, running

LEAST_FACTOR = 0.98
"""Real-time factor that each row must reach: what is lost is the measurement's own."""

SPAWN = 100
"""Objects in one call: the most that it takes."""

APART = 40.0
"""Distance of the vehicles [m]: none touches another one."""

WAYS: tuple[tuple[str, dict[str, object] | None], ...] = (
    ("nobody listens", None),
    ("JSON, 5 Hz", {"throttle_rate": 200}),
    ("CBOR, 5 Hz", {"throttle_rate": 200, "compression": "cbor"}),
    ("cbor-raw, 5 Hz", {"throttle_rate": 200, "compression": "cbor-raw"}),
)


async def main() -> int:
    """Measure all rows, and print them.

    Returns:
        The exit code.
    """
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--objects", type=int, default=10_000, help="vehicles [%(default)s]")
    parser.add_argument("--seconds", type=float, default=5.0, help="time of each measurement [%(default)s]")
    arguments = parser.parse_args()
    print(machine())
    is_good = True
    with running((*SERVER, "--scenario", "loop")) as program:
        await spawn(program, arguments.objects)
        for name, options in WAYS:
            factor, num, size = await measure(program, options, arguments.seconds)
            is_good &= factor >= LEAST_FACTOR
            print(f"{name:16} {arguments.objects:>6} objects   factor {factor:5.3f}   {num:5.1f} messages/s  {size} B")
    return 0 if is_good else 1


async def spawn(program: Program, num: int) -> None:
    """Fill the plane with vehicles that drive straight ahead."""
    async with AsyncClient(f"ws://127.0.0.1:{program.port}") as client:
        objects = [
            {
                "model": "2015_Kia_K5",
                "place": {"x": APART * (i % 100), "y": 5e3 + APART * (i // 100), "z": 0.0},
                "behaviour": "straight",
                "speed": 5.0 + 0.001 * (i % 100),
            }
            for i in range(num)
        ]
        await client.start_sync()  # the world stands meanwhile, so that it has nothing to make up for
        for first in range(0, num, SPAWN):
            await client.spawn_all(objects[first : first + SPAWN])
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
        await asyncio.sleep(1.0)  # the first messages, and what is made once
        sizes.clear()
        begun, start = time.perf_counter(), await _simulated(clock)
        end = start
        while time.perf_counter() - begun < seconds:
            end = await _simulated(clock)
        passed = time.perf_counter() - begun
        count.cancel()
        return (end - start) / passed, len(sizes) / passed, sizes[-1] if sizes else 0


async def _simulated(clock: ClientConnection) -> float:
    """Return the next time of `/clock` [s]."""
    stamp = json.loads(await clock.recv())["msg"]["clock"]
    return float(stamp["secs"] + 1e-9 * stamp["nsecs"])


async def _count(listener: ClientConnection, sizes: list[int]) -> None:
    while True:
        sizes.append(len(await listener.recv()))


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))

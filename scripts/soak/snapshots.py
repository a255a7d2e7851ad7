#!/usr/bin/env python3
"""Reset and restore ten thousand times over a real socket, and check that nothing of it is left.

    python scripts/soak/snapshots.py [--turns 5000] [--seed 0]

Each turn takes a snapshot, changes the scene in some way (ticks, steps, objects, egos, scores, a load of another
map, a barrier), restores by name or by bytes, compares the state hash, and resets. So 5,000 turns are 10,000 resets
and restores. Some turns restore damaged bytes, which must be refused. At the end of each tenth all snapshots are
removed and the opening scene is loaded: memory, descriptors, tasks, objects, names on the bus and the room for
snapshots must then be as after the first tenth.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.client import AsyncClient  # noqa: E402
from rosbridge_sim.errors import ClientError  # noqa: E402
from scripts.soak.harness import Figures, SoakError, WatchedServer  # noqa: E402

NUM_WARM = 6_500
"""Turns before the first figures of a long run: the server's list of snapshots by their bytes (`MAX_OWN`) is full then,
with some ten small objects for each."""

NUM_KEPT = 20
"""Snapshots that are kept at once: each turn replaces one of them."""

MAX_GROWTH = 8.0
"""Largest growth of memory from the first tenth to the end [MB]: the allocator keeps unused blocks."""

MAX_OBJECTS = 2_000
"""Blocks of small objects that caches may fill after the first tenth; one for each turn would be 4,500."""


@dataclass(slots=True)
class Report:
    """Outcome of a run.

    Attributes:
        num: what was done -> how often.
        figures: after each part of the run, at rest.
        faults: what was wrong; empty if all was well.
    """

    num: Counter[str] = field(default_factory=Counter)
    figures: list[tuple[Figures, dict[str, int]]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


class _Turns:
    """Turns of one client; the seed decides all random choices."""

    def __init__(self, client: AsyncClient, num: Counter[str], seed: int) -> None:
        self._client = client
        self._chance = random.Random(seed)  # noqa: S311 - it is not a secret
        self._num = num
        self._acts: list[Callable[[], Awaitable[object]]] = [
            *(self._tick, self._step, self._spawn, self._ego, self._light, self._score, self._load, self._barrier),
        ]

    async def turn(self) -> None:
        """Save, change, restore and reset once."""
        client, chance = self._client, self._chance
        for _ in range(chance.randrange(3)):
            await self._act()
        name = f"turn {chance.randrange(NUM_KEPT)}"
        saved = await client.snapshot(name, with_data=chance.random() < 0.5)
        await self._act()
        await client.restore(saved.data or name)
        self._num["restores by bytes" if saved.data else "restores by name"] += 1
        if await client.state_hash() != saved.state_hash:
            raise SoakError("a restore has led to another state hash")
        if saved.data and chance.random() < 0.1:
            await self._refuse(saved.data, saved.state_hash)
        await client.call("/sim/reset", {"seed": chance.randrange(3)})
        self._num["resets"] += 1

    async def settle(self) -> dict[str, int]:
        """Remove all snapshots, and go back to the opening scene.

        Returns:
            Numbers of things that the server knows of.
        """
        client = self._client
        await client.snapshots(remove=[one.name for one in await client.snapshots()])
        await client.ask("/Service_MoraiSL", file_name="demo", delete_all=True, load_ego_vehicle_data=True)
        await client.call("/sim/reset", {"seed": 0})
        lists = {what: (await client.call(f"/rosapi/{what}"))[what] for what in ("topics", "services", "nodes")}
        room = (await client.call("/sim/snapshots"))["room"]
        return {what: len(names) for what, names in lists.items()} | {"bytes of room": room}

    async def _act(self) -> None:
        act = self._chance.choice(self._acts)
        await act()
        self._num[act.__name__.removeprefix("_")] += 1

    async def _refuse(self, data: bytes, state_hash: str) -> None:
        damaged = bytearray(data)
        damaged[self._chance.randrange(len(data))] ^= 1
        try:
            await self._client.restore(bytes(damaged))
        except ClientError:
            self._num["refused restores"] += 1
        else:
            raise SoakError("damaged bytes were restored")
        if await self._client.state_hash() != state_hash:
            raise SoakError("a refused restore has changed the state")

    async def _tick(self) -> None:
        await self._client.tick(self._chance.randint(1, 5))

    async def _step(self) -> None:
        command = {"longlCmdType": 1, "accel": self._chance.random(), "steering": self._chance.uniform(-0.3, 0.3)}
        await self._client.step(self._chance.randint(1, 10), commands={0: command}, stop_on=["collision"])

    async def _spawn(self) -> None:
        uid = await self._client.spawn("Box", x=self._chance.uniform(-50, 50), y=self._chance.uniform(-50, 50))
        await self._client.set_object(uid, speed=2.0)
        if self._chance.random() < 0.5:
            await self._client.remove(uid)

    async def _ego(self) -> None:
        place = {"place": {"x": 80.0, "y": self._chance.uniform(-50, 50)}}
        await self._client.call("/sim/spawn", {"objects": [{"is_ego": True, **place}]})  # refused in a full world

    async def _light(self) -> None:
        message = {"trafficLightIndex": "no light", "trafficLightStatus": 4}
        await self._client.publish("/SetTrafficLight", message, "morai_msgs/SetTrafficLight")

    async def _score(self) -> None:
        await self._client.score(reset=self._chance.random() < 0.5)

    async def _load(self) -> None:
        scene = self._chance.choice(["demo", "town", "loop", "hills"])
        await self._client.ask("/Service_MoraiSL", file_name=scene, delete_all=True, load_ego_vehicle_data=True)

    async def _barrier(self) -> None:
        await self._client.stop_sync()
        await self._client.join_barrier(user_id="soak")
        await self._client.tick()
        await self._client.leave_barrier()
        await self._client.start_sync(user_id="soak")


async def soak(turns: int, seed: int, folder: Path, *, num_parts: int = 10, num_warm: int = 0) -> Report:
    """Run the soak.

    Args:
        turns: number of turns.
        seed: random seed.
        folder: for the log.
        num_parts: parts of the run; the figures are compared after each.
        num_warm: turns before the first part.

    Returns:
        The report.
    """
    report = Report()
    # The pings of a client are a task that begins after twenty seconds.
    with WatchedServer(folder / "log", "--log-level=warning", "--ping-interval=none") as server:
        # A line for each refused restore and each refused light would fill the client's list.
        async with AsyncClient(server.url, status_level="none", timeout=60.0) as client:
            await client.start_sync(user_id="soak")
            play = _Turns(client, report.num, seed)
            begun = time.perf_counter()
            try:
                for _ in range(num_warm):
                    await play.turn()
                for i in range(1, num_parts + 1):
                    for _ in range(turns * i // num_parts - turns * (i - 1) // num_parts):
                        await play.turn()
                    known = await play.settle()
                    figures = await asyncio.to_thread(server.figures, is_collected=True)
                    report.figures.append((figures, known))
                    print(
                        f"{turns * i // num_parts:7,} turns: {time.perf_counter() - begun:5.0f} s, "
                        f"{figures.cpu:5.0f} s of CPU, {figures.memory:.1f} MB, {figures.objects:,} objects, "
                        f"{figures.descriptors} descriptors, {figures.tasks} tasks, {known}",
                        flush=True,
                    )
            except (SoakError, ClientError) as error:
                report.faults.append(str(error))
        if server.stop() != 0:
            report.faults.append(f"the server ended with {server.code}")
        report.faults += [line for line in server.log.splitlines() if "Traceback" in line or " ERROR " in line]
    return report


def judge(report: Report) -> list[str]:
    """Return what has grown since the first part of a run.

    Args:
        report: of the run.

    Returns:
        A line for each bound that is exceeded.
    """
    if not report.figures:
        return []
    (first, known), (last, known_now) = report.figures[0], report.figures[-1]
    grown = [
        f"{what}: {before:,} after the first part, {now:,.0f} at the end"
        for what, before, now, room in (
            ("memory [MB]", first.memory, last.memory, MAX_GROWTH),
            ("objects", first.objects, last.objects, MAX_OBJECTS),
            ("descriptors", first.descriptors, last.descriptors, 0),
            ("tasks", first.tasks, last.tasks, 0),
        )
        if now > before + room
    ]
    return grown if known == known_now else [*grown, f"{known} after the first part, {known_now} at the end"]


def main() -> int:
    """Run it, with a line of progress for each tenth."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--turns", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        report = asyncio.run(soak(options.turns, options.seed, Path(name), num_warm=NUM_WARM))
    print(", ".join(f"{count:,} {what}" for what, count in sorted(report.num.items())))
    faults = [*report.faults, *judge(report)]
    for fault in faults:
        print(fault)
    print("NOT GOOD" if faults else "good")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

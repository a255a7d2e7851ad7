#!/usr/bin/env python3
"""Let eight kinds of clients come and go for an hour, and check that the server leaks nothing.

    python scripts/soak/mixed.py [--minutes 60 | --seconds N] [--seed 0]

The kinds are: subscribers (JSON and CBOR), a planner, masters of synchronous mode, services with their callers, actions
with their goals, a director that loads, resets, adds and saves, and rude clients. All run at once on one `rosbridge-sim
serve`, and reconnect during the whole run. Each minute the script prints the server's cost and the waits of a bystander
in its own process. A second bystander measures an idle server; waits of both are caused by the machine. At the end all
clients leave, and everything that they had must be removed.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from scripts.bench.program import machine  # noqa: E402
from scripts.soak.harness import Bystander, Figures, SoakError, Waits, WatchedServer, slope_per_hour, until  # noqa: E402
from scripts.soak.lives import KINDS, Place  # noqa: E402
from scripts.soak.scenes import BUILT_IN, write_scenes  # noqa: E402
from scripts.soak.soak_client import Client, census, differences  # noqa: E402

WARM_UP = 0.25
"""First part of the run, which is not judged: all maps, message types and kinds of clients are used once in it."""

WARM_LIVES = 100
"""Least lives of clients in the warm-up. After one life each, a busy server has 340,000 objects and not all message
types, caches and buffers; after 80 the number stays within 2,000."""

MAX_WARM_UPS = 30
"""The warm-up is repeated so often at most."""

MIN_SECONDS = 300.0
"""Shortest run whose memory is judged [s]; in a shorter one nothing has been used often enough."""

MAX_SLOPE = 30.0
"""Largest growth of memory in an hour, by the regression line after the warm-up [MB]: half of an idle server."""

MAX_STEP = 6.0
"""Growth of memory at rest that is not judged [MB]: a load of a larger map, or more clients at once than before, leave
it behind. In five minutes one such step looks like 50 MB in an hour. Where there is more, a second round tells: a step
does not come again."""

MAX_OBJECTS = 5_000
"""Small objects that may be added in a run of any length: a rare message type has some hundreds of them, made once."""

MAX_OBJECTS_EACH = 0.5
"""Small objects that may stay for each life of a client: a leak of one object a life is found."""

MAX_THREADS = min(32, (os.cpu_count() or 1) + 4)
"""Threads that may stay and wait for the next file: the size of the loop's own executor."""

MAX_STALL = 150.0
"""Longest wait of the bystander above that of the one at the idle server [ms], if one pass of the server's loop also
took so much CPU time: 50 is the bound for one hostile frame. A longer wait with shorter passes is the machine's, whose
cores the clients of this script use."""

IDLE_TASKS = 2
"""Tasks of a server without clients: one runs it, and one waits for its failure."""

SAMPLES = 600
"""Samples of memory in the whole run."""


@dataclass(slots=True)
class Report:
    """Result of a run.

    Attributes:
        faults: one line for each failed bound; empty is good.
        num: counts of acts, by name.
        slope: of memory [MB/hour].
        longest: longest waits of the bystanders, here and at the idle server [ms].
        longest_pass: longest CPU time of one pass of the server's loop [ms].
    """

    faults: list[str]
    num: Counter[str]
    slope: float
    longest: tuple[float, float]
    longest_pass: float


class Mixed:
    """One run against one server."""

    def __init__(
        self, server: WatchedServer, idle: WatchedServer, place: Place, seed: int, max_stall: float | None
    ) -> None:
        self._server, self._idle = server, idle
        self._max_stall = max_stall
        self._place = place
        self._seed = seed
        self._faults: Counter[str] = Counter()
        self._memory: list[tuple[float, float]] = []
        self._longest = (0.0, 0.0)
        self._longest_pass = 0.0
        self._num_warm = 0

    async def run(self, seconds: float, num_lines: int, acts: Sequence[str]) -> Report:
        """Let clients come and go in two rounds, and check what the second round has left behind.

        The first round creates everything that is made once: maps, message types, buffers of the allocator.

        Args:
            seconds: duration of both rounds.
            num_lines: lines of figures.
            acts: what must have been done before the second round begins.

        Returns:
            The report.
        """
        try:
            for scene in BUILT_IN:
                await self._settle(scene)
            for number in range(MAX_WARM_UPS):
                if self._num_lives >= WARM_LIVES and all(self._place.num[act] for act in acts):
                    break
                await self._play(f"warm-up {number}", seconds * WARM_UP, 1)
            await self._settle()
            before, names, files = await self._rest(), await self._names(), self._server.open_files()
            self._memory.clear()
            self._num_warm = self._num_lives
            await self._play("", seconds * (1 - WARM_UP), num_lines)
            await self._settle()
            after = await self._rest(before)
            growth = after.memory - before.memory
            if seconds >= MIN_SECONDS and self._grows(growth):
                # A step does not come again in a second such round, and a leak does.
                self._memory.clear()
                await self._play("again", seconds * (1 - WARM_UP), 1)
                await self._settle()
                first, after = after, await self._rest(before)
                growth = after.memory - first.memory
            await self._judge(before, after, names, files)
            self._judge_figures(seconds, growth)
        except SoakError as error:
            self._faults[str(error)] += 1
        return Report(
            [f"{fault} ({num} times)" if num > 1 else fault for fault, num in self._faults.items()],
            self._place.num,
            self._slope,
            self._longest,
            self._longest_pass,
        )

    async def _play(self, name: str, seconds: float, num_lines: int) -> None:
        """Let clients come and go for a time, until the last one has left.

        Raises:
            SoakError: the server has ended, or gives a bystander no answer.
        """
        loop = asyncio.get_running_loop()
        bystanders = Bystander(self._server.url), Bystander(self._idle.url)
        for bystander in bystanders:
            await bystander.waits()
        await asyncio.to_thread(self._server.longest_pass)
        begun = loop.time()
        self._place.end = begun + seconds
        lives = [(kind, f"{self._seed} {name} {i}") for kind, num in KINDS.items() for i in range(num)]
        crowd = [loop.create_task(self._live(*life)) for life in lives]
        try:
            for line in range(1, num_lines + 1):
                await self._sample(begun, begun + seconds * line / num_lines, seconds / SAMPLES)
                waits = [await bystander.waits() for bystander in bystanders]
                self._longest = max(self._longest[0], waits[0].longest), max(self._longest[1], waits[1].longest)
                self._longest_pass = max(self._longest_pass, await asyncio.to_thread(self._server.longest_pass))
                _print_line(name or f"{loop.time() - begun:5.0f} s", await self._figures(), waits)
            await asyncio.gather(*crowd)
        finally:
            for task in crowd:
                task.cancel()
            await asyncio.gather(*crowd, return_exceptions=True)
            for bystander in bystanders:
                bystander.stop()

    async def _live(self, kind: Callable[[Place, random.Random], Awaitable[None]], seed: str) -> None:
        """Live one life after the other, until the end."""
        chance = random.Random(f"{kind.__name__} {seed}")  # noqa: S311 - to be repeated, no secret
        loop = asyncio.get_running_loop()
        while loop.time() < self._place.end:
            try:
                await kind(self._place, chance)
            except SoakError as error:
                self._faults[f"{kind.__name__}: {error}"] += 1
            except Exception:  # noqa: BLE001 - an answer of a form that no client expects
                self._faults[f"{kind.__name__}: {traceback.format_exc()}"] += 1
            self._place.num[f"lives of {kind.__name__}"] += 1
            await asyncio.sleep(chance.uniform(0.0, 0.2))

    async def _sample(self, begun: float, end: float, period: float) -> None:
        loop = asyncio.get_running_loop()
        while loop.time() < end:
            await asyncio.sleep(min(period, end - loop.time()))
            self._memory.append((loop.time() - begun, (await self._figures()).memory))

    async def _figures(self) -> Figures:
        return await asyncio.to_thread(
            self._server.figures
        )  # in a thread, so that a stalled server does not stall its clients

    async def _settle(self, scene: str = "demo") -> None:
        """Load the opening scene, or another one, in real time."""
        async with await Client.open(self._server.url) as client:
            await client.request("/Service_MoraiEventCmd", option=8, set_pause=False)
            await client.request("/Service_MoraiSL", file_name=scene, delete_all=True, load_ego_vehicle_data=True)
            await client.call("/sim/reset", {"seed": 0})
            # the first position opens the database of map projections, which stays open
            await client.send("subscribe", topic="/gps")
            await client.next_message("/gps")

    async def _rest(self, before: Figures | None = None) -> Figures:
        """Return the server's cost without garbage, after it has noticed that all clients have left."""

        async def is_at_rest() -> bool:
            now = await self._figures()
            return now.tasks <= IDLE_TASKS and (before is None or now.descriptors <= before.descriptors)

        await until(is_at_rest)
        figures = await asyncio.to_thread(self._server.figures, is_collected=True)
        _print_line("at rest", figures)
        return figures

    async def _names(self) -> dict[str, list[str]]:
        async with await Client.open(self._server.url) as client:
            return await census(client)

    @property
    def _num_lives(self) -> int:
        return sum(num for what, num in self._place.num.items() if what.startswith("lives of "))

    @property
    def _slope(self) -> float:
        return slope_per_hour(self._memory)

    async def _judge(self, before: Figures, after: Figures, names: dict[str, list[str]], files: Counter[str]) -> None:
        """Note everything that has stayed although all clients have left."""
        num_lives = self._num_lives - self._num_warm
        for what, num, now in (
            ("descriptors", before.descriptors, after.descriptors),
            ("tasks", before.tasks, after.tasks),
            ("threads", before.threads + MAX_THREADS, after.threads),
            ("objects", before.objects + MAX_OBJECTS + int(MAX_OBJECTS_EACH * num_lives), after.objects),
        ):
            if now > num:
                self._faults[f"{what}: expected at most {num} after all had left, got {now}"] += 1
                if what == "descriptors":
                    self._faults[f"left open: {dict(self._server.open_files() - files)}"] += 1
        for line in differences(names, await self._names()):
            self._faults[line] += 1
        async with await Client.open(self._server.url) as client:
            await client.send("subscribe", topic="/sim/clients")
            there = (await client.next_message("/sim/clients"))["clients"]
            if len(there) != 1:
                self._faults[f"/sim/clients: expected only this client, got {len(there)}"] += 1

    def _grows(self, growth: float) -> bool:
        """Return whether memory has grown too much in a round, by its slope and at rest [MB]."""
        return self._slope > MAX_SLOPE and growth > MAX_STEP

    def _judge_figures(self, seconds: float, growth: float) -> None:
        """Note the failed bounds of memory, waits and the log; this stops the server."""
        if seconds >= MIN_SECONDS and self._grows(growth):
            self._faults[f"memory: {growth:+.1f} MB at rest, {self._slope:+.1f} MB/hour"] += 1
        stall = min(self._longest[0] - self._longest[1], self._longest_pass)
        if self._max_stall is not None and stall > self._max_stall:
            text = f"the bystander waited {self._longest[0]:.0f} ms, at an idle server {self._longest[1]:.0f}"
            text += f"; a pass of the loop took {self._longest_pass:.0f} ms of CPU time"
            self._faults[text] += 1
        if (code := self._server.stop()) != 0:
            self._faults[f"the server ended with {code}"] += 1
        for line in self._server.log.splitlines():
            if line.startswith("Traceback") or " ERROR " in line or " CRITICAL " in line:
                self._faults[f"in the log: {line.partition(' ')[2] or line}"] += 1


def _print_line(when: str, figures: Figures, waits: list[Waits] | None = None) -> None:
    text = f"{when:>8}: {figures.memory:6.1f} MB, {figures.descriptors:3} descriptors, {figures.threads:2} threads, "
    text += f"{figures.tasks:3} tasks, {figures.objects:,} objects, {figures.cpu:6.0f} s of CPU"
    if waits is not None:
        here, idle = waits
        text += f"; bystander {here.median:.1f} ms, at worst {here.longest:.0f} (at an idle server {idle.longest:.0f})"
    print(text, flush=True)


async def soak(
    seconds: float,
    seed: int,
    folder: Path,
    *,
    num_lines: int = 60,
    longest_life: float = 5.0,
    max_stall: float | None = MAX_STALL,
    acts: Sequence[str] = (),
) -> Report:
    """Run the soak in a folder.

    Args:
        seconds: duration.
        seed: random seed of the clients.
        folder: for scenarios, saved files and logs.
        num_lines: lines of figures.
        longest_life: of a client [s].
        max_stall: see `MAX_STALL` [ms]; None judges no time.
        acts: names of acts without which the warm-up does not end; a busy machine does few of them in a second.

    Returns:
        The report.
    """
    scenes = folder / "scenes"
    scenes.mkdir()
    write_scenes(scenes)
    flags = (f"--scenario-path={scenes}", f"--data-dir={folder / 'data'}", "--log-level=warning")
    with WatchedServer(folder / "log", *flags) as server, WatchedServer(folder / "idle") as idle:
        place = Place(server.url, server.port, 0.0, longest_life)
        return await Mixed(server, idle, place, seed, max_stall).run(seconds, num_lines, acts)


def main() -> int:
    """Run it, with a line for each minute."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seconds", type=float, help="in place of --minutes")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    seconds: float = options.seconds or 60 * options.minutes
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        report = asyncio.run(
            soak(seconds, options.seed, Path(name), num_lines=max(1, round(seconds * (1 - WARM_UP) / 60)))
        )
    print(", ".join(f"{count:,} {what}" for what, count in sorted(report.num.items())))
    print(
        f"memory {report.slope:+.1f} MB/hour; longest wait {report.longest[0]:.0f} ms, "
        f"idle {report.longest[1]:.0f} ms; longest pass {report.longest_pass:.0f} ms of CPU"
    )
    for fault in report.faults:
        print(f"NOT GOOD: {fault}")
    print("good" if not report.faults else f"{len(report.faults)} bounds failed")
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())

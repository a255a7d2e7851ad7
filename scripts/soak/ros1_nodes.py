#!/usr/bin/env python3
"""Nodes of ROS 1 that come and go for ten minutes beside a server, and check that nothing of them is left.

    python scripts/soak/ros1_nodes.py [--minutes 10] [--seed 0]

Eight nodes live at once, each for three seconds at most: they subscribe and read, or never read; publish to a client;
provide a service that a client calls, and die in the middle of a call; call services; are the master of synchronous
mode; or send rubbish. Half of them unregister at their end, the others are gone as by kill -9, and the master names
them until the end of the part. Twice in each tenth the master loses everything, as in a restart. At its end no node is
there: memory, descriptors, threads and tasks must then be as after the first tenth.

Master and nodes are those of `tests/shell/ros1/small_ros1.py`, so no ROS is needed.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.client import AsyncClient  # noqa: E402
from rosbridge_sim.errors import ClientError, GraphError  # noqa: E402
from rosbridge_sim.graph.ros1.tcpros import with_length  # noqa: E402
from scripts.soak.harness import PATIENCE, Figures, SoakError, WatchedServer, until  # noqa: E402
from tests.shell.ros1.small_ros1 import (  # noqa: E402
    STRING_MD5,
    TRIGGER_MD5,
    SmallMaster,
    SmallNode,
    ask,
    take_message,
)

NODE = "/rosbridge_sim"

NUM_LIVES = 8
"""Nodes at once."""

REST = 2.0
"""Time in which connections are closed after a part [s]. After the last one it may take `PATIENCE`."""

MAX_MORE_PARTS = 20
"""Parts after the last one, if something has not been done by then."""

MAX_GROWTH = 8.0
"""Largest growth of memory from the first part to the end [MB]: the allocator keeps unused blocks."""

GONE = (OSError, asyncio.IncompleteReadError, GraphError, KeyError, IndexError, TimeoutError)
"""Errors of a node whose other side has gone, or whose master has just lost everything."""


@dataclass(slots=True)
class Report:
    """Outcome of a run.

    Attributes:
        num: what was done -> how often.
        figures: after each part of the run, at rest.
        faults: what was wrong; empty if all was well.
    """

    num: Counter[str] = field(default_factory=Counter)
    figures: list[Figures] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


class _Lives:
    """Nodes that live one after the other; the seed decides all random choices."""

    def __init__(self, master: SmallMaster, client: AsyncClient, num: Counter[str], seed: int) -> None:
        self._master = master
        self._client = client
        self._num = num
        self._chance = random.Random(seed)  # noqa: S311 - it is not a secret
        self._num_nodes = 0
        self._acts: list[Callable[[SmallNode], Awaitable[None]]] = [
            *(self._read, self._stall, self._publish, self._provide, self._call, self._lead, self._send_rubbish)
        ]

    async def live(self, end: float) -> None:
        """Be one node after the other."""
        while time.monotonic() < end:
            self._num_nodes += 1
            node = await SmallNode(self._master, f"/node_{self._num_nodes}").start()
            act = self._chance.choice(self._acts)
            with suppress(*GONE):
                async with asyncio.timeout(3.0):
                    await node.register("Publisher", "/rosout", "rosgraph_msgs/Log")  # as each rospy node does
                    await act(node)
            self._num[f"lives that {act.__name__.strip('_').replace('_', ' ')}"] += 1
            if self._chance.random() < 0.5:
                self.forget({node.name})
            node.die()

    def forget(self, nodes: set[str] | None = None) -> None:
        """End the registrations of nodes, of all by default."""
        master = self._master
        for topics in master.kinds.values():
            for topic, owners in topics.items():
                gone = [one for one in owners if one != NODE and (nodes is None or one in nodes)]
                for one in gone:
                    del owners[one]
                if gone:
                    master.tell_publishers(topic)
        for name, (owner, _) in list(master.services.items()):
            if owner != NODE and (nodes is None or owner in nodes):
                del master.services[name]

    async def _read(self, node: SmallNode) -> None:
        topic = self._chance.choice(["/imu", "/Ego_topic", "/clock", "/tf"])
        _, (reader, _) = await node.subscribe(topic)
        for _ in range(self._chance.randint(1, 20)):
            await take_message(reader)
            self._num["messages to nodes"] += 1

    async def _stall(self, node: SmallNode) -> None:
        await node.subscribe("/sim/scene/objects")
        await asyncio.sleep(0.5)

    async def _publish(self, node: SmallNode) -> None:
        node.answer_header = {"type": "std_msgs/String", "md5sum": STRING_MD5}
        await node.register("Publisher", f"/plan_{self._chance.randrange(4)}", "std_msgs/String")
        while not node.subscribers:  # noqa: ASYNC110 - no event tells of it
            await asyncio.sleep(0.01)
        for _ in range(self._chance.randint(1, 50)):
            node.say(with_length(b"x" * self._chance.randrange(1_000)))
        await asyncio.sleep(0.05)

    async def _provide(self, node: SmallNode) -> None:
        name, dies = f"/move_{self._num_nodes}", self._chance.random() < 0.5
        node.answer_header = {"type": "std_srvs/Trigger", "md5sum": TRIGGER_MD5}

        def answer(_request: bytes) -> tuple[bool, bytes]:
            if dies:
                node.die()
            return True, b"\1" + with_length(b"moved")

        node.handle = answer
        await node.register("Service", name, "")
        while True:
            try:
                await self._client.call(name)
            except ClientError as error:
                if "does not exist" in str(error):
                    await asyncio.sleep(0.05)
                    continue
                self._num["calls of clients that failed"] += 1
            else:
                self._num["calls of clients"] += 1
            return

    async def _call(self, node: SmallNode) -> None:
        _, stream = await node.open_service("/rosapi/get_time", persistent="1")
        for _ in range(self._chance.randint(1, 20)):
            await ask(stream, b"")
            self._num["calls of nodes"] += 1

    async def _lead(self, node: SmallNode) -> None:
        _, stream = await node.open_service("/SyncModeCmd")
        await ask(stream, with_length(node.name.encode()) + b"\1" + (20).to_bytes(4, "little"))
        for _ in range(10):
            _, stream = await node.open_service("/SyncModeWaitForTick")
            await ask(stream, with_length(node.name.encode()) + bytes(8))
            self._num["ticks"] += 1

    async def _send_rubbish(self, node: SmallNode) -> None:
        host, port = await node.ask_topic("/clock")
        _, writer = await asyncio.open_connection(host, port)
        try:
            writer.write(rubbish := self._chance.randbytes(self._chance.randint(1, 300)))
            await asyncio.sleep(0.1)
        finally:
            writer.close()
        self._num["bytes of rubbish"] += len(rubbish)


async def soak(seconds: float, seed: int, folder: Path, *, num_parts: int = 10, acts: Collection[str] = ()) -> Report:
    """Run the soak.

    Args:
        seconds: length.
        seed: random seed.
        folder: for the log.
        num_parts: parts of the run; the figures are compared after each.
        acts: what must have been done, or more parts follow; a busy machine does little in a second.

    Returns:
        The report.
    """
    report = Report()
    master = await SmallMaster().start()
    flags = (f"--ros1-master={master.uri}", "--log-level=error", "--ping-interval=none", "--sync-on-loss=run")
    with await asyncio.to_thread(WatchedServer, folder / "log", *flags) as server:  # the loop is the master's, too
        async with AsyncClient(server.url, status_level="none", timeout=60.0) as client:
            for i in range(4):
                await client.subscribe(f"/plan_{i}", "std_msgs/String", keep=1)
            lives = _Lives(master, client, report.num, seed)
            try:
                for i in range(1, num_parts + MAX_MORE_PARTS + 1):
                    if i > num_parts and all(report.num[act] for act in acts):
                        break
                    for _ in range(2):
                        end = time.monotonic() + seconds / num_parts / 2
                        await asyncio.gather(*(lives.live(end) for _ in range(NUM_LIVES)))
                        master.forget()  # a node that is there now would be unknown for ever
                    first = report.figures[0] if report.figures else None
                    patience = PATIENCE if i >= num_parts else REST
                    report.figures.append(await _settle(lives, client, server, first, patience))
                    print(f"part {i}: {report.num.total():,} done, {report.figures[-1]}", flush=True)
            except (SoakError, ClientError) as error:
                report.faults.append(str(error))
        if await asyncio.to_thread(server.stop) != 0:
            report.faults.append(f"the server ended with {server.code}")
        report.faults += [line for line in server.log.splitlines() if "Traceback" in line or " ERROR " in line]
    master.server.stop()
    return report


async def _settle(
    lives: _Lives, client: AsyncClient, server: WatchedServer, first: Figures | None, patience: float
) -> Figures:
    """Return the figures once the server knows no node any more.

    Args:
        first: figures after the first part, which are waited for; None in that part, whose least figures count.
        patience: longest wait for the ends of connections [s].
    """

    async def is_alone() -> bool:
        lives.forget()
        names = (await client.call("/rosapi/nodes"))["nodes"]
        return not any(name.startswith("/node_") for name in names)

    if not await until(is_alone):
        names = (await client.call("/rosapi/nodes"))["nodes"]
        raise SoakError(f"nodes that have gone are still known: {names}")
    found: list[Figures] = []

    async def is_at_rest() -> bool:
        found.append(await asyncio.to_thread(server.figures, is_collected=True))
        return first is not None and not _grown(first, found[-1])

    await until(is_at_rest, patience)
    return min(found, key=lambda one: (one.descriptors, one.tasks)) if first is None else found[-1]


def _grown(first: Figures, now: Figures) -> list[str]:
    """Return a line for each count that is larger than after the first part."""
    pairs = (
        ("descriptors", first.descriptors, now.descriptors),
        ("threads", first.threads, now.threads),
        ("tasks", first.tasks, now.tasks),
    )
    return [_line(*pair) for pair in pairs if pair[2] > pair[1]]


def _line(what: str, before: float, now: float) -> str:
    return f"{what}: {before} after the first part, {now} at the end"


def judge(report: Report) -> list[str]:
    """Return what has grown since the first part of a run, a line for each bound that is exceeded."""
    if not report.figures:
        return []
    first, last = report.figures[0], report.figures[-1]
    has_grown = last.memory > first.memory + MAX_GROWTH
    memory = [_line("memory [MB]", first.memory, last.memory)] if has_grown else []
    return [*memory, *_grown(first, last)]


def main() -> int:
    """Run it, with a line of progress for each tenth."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        report = asyncio.run(soak(60.0 * options.minutes, options.seed, Path(name)))
    print(", ".join(f"{count:,} {what}" for what, count in sorted(report.num.items())))
    faults = [*report.faults, *judge(report)]
    for fault in faults:
        print(fault)
    print("NOT GOOD" if faults else "good")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

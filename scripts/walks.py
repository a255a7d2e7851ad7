#!/usr/bin/env python3
"""Functions and files that a publish and a tick pass, as the interpreter reports them.

    python scripts/walks.py          prints the figures and each function

A server and two clients run in one event loop, and `sys.setprofile` reports each call of a function of the package,
from the bytes of a frame to the bytes for all sockets and the next timer. Each walk is repeated, so that caches are
warm, and the shortest one that is no exception counts: timers of the server lengthen some, and every few frames a tick
has more to do, as lights that change. Comprehensions do not count, because newer versions of Python do not call them.

`scripts/write_docs.py` writes both walks into `docs/architecture.md`.
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from functools import cache
from itertools import groupby, pairwise
from pathlib import Path
from types import FrameType
from typing import Final, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from websockets.asyncio.client import ClientConnection, connect  # noqa: E402

from rosbridge_sim import Simulator  # noqa: E402

PAGE: Final = ROOT / "docs" / "architecture.md"
PACKAGE: Final = ROOT / "rosbridge_sim"

PUBLISH: Final = "publish"
TICK: Final = "tick"

NUM_PUBLISHES: Final = 20
NUM_TICKS: Final = 40
"""Repetitions: a tick has least to do in one frame of four or five, see `world/followers/waiting.py`."""

USUAL: Final = 3
"""A walk that came less often is an exception."""

SETTLING_TIME: Final = 0.02
"""Time for turns of the loop that follow the last answer [s]; nothing is measured in time here."""


class Visit(NamedTuple):
    """A call of a function.

    Attributes:
        file: its file, within the package.
        function: its name, with that of its class or of the function around it.
    """

    file: str
    function: str

    @property
    def room(self) -> str:
        """The folder of the file, within the package; empty for the package itself."""
        return self.file.rpartition("/")[0]


class Figures(NamedTuple):
    """Length of a walk.

    Attributes:
        calls: of functions of the package.
        files: that have these functions.
        rooms: folders that have these files.
        changes: calls of a function that is in another file than the function called before it.
    """

    calls: int
    files: int
    rooms: int
    changes: int


def figures_of(walk: Sequence[Visit]) -> Figures:
    """Return the length of a walk."""
    files = [visit.file for visit in walk]
    changes = sum(file != other for file, other in pairwise(files))
    return Figures(len(walk), len({*files}), len({visit.room for visit in walk}), changes)


@cache
def measure_walks() -> dict[str, tuple[Visit, ...]]:
    """Return the calls of a publish and of a tick in their order, by the names of the walks."""
    return asyncio.run(_measure())


async def _measure() -> dict[str, tuple[Visit, ...]]:
    # In one server, ticks would set a timer anew for the seconds in which a topic without a subscriber is watched.
    return {PUBLISH: await _measure_publish(), TICK: await _measure_tick()}


async def _measure_publish() -> tuple[Visit, ...]:
    async with (
        Simulator(port=0, start="sync") as simulator,
        connect(simulator.url, compression=None) as client,
        connect(simulator.url, compression=None) as listener,
    ):
        topic = {"topic": "/chatter", "type": "std_msgs/String"}
        await _send(client, op="advertise", **topic)
        await _send(listener, op="subscribe", **topic)

        async def publish() -> None:
            await _send(client, op="publish", topic="/chatter", msg={"data": "hello"})
            await listener.recv()

        return await _shortest(publish, NUM_PUBLISHES)


async def _measure_tick() -> tuple[Visit, ...]:
    async with Simulator(port=0, start="sync") as simulator, connect(simulator.url, compression=None) as client:

        async def tick() -> None:
            await _call(client, "/SyncModeWaitForTick", user_id="walk", frame=1)

        await _call(client, "/SyncModeCmd", user_id="walk", start_sync_mode=True, time_step=20)
        return await _shortest(tick, NUM_TICKS)


async def _send(client: ClientConnection, **op: object) -> None:
    await client.send(json.dumps(op))


async def _call(client: ClientConnection, service: str, **request: object) -> None:
    await _send(client, op="call_service", service=service, args={"request": request})
    answer = json.loads(await client.recv())
    assert answer["result"] is True, answer


async def _shortest(act: Callable[[], Awaitable[None]], num: int) -> tuple[Visit, ...]:
    """Return the shortest usual walk of an act that is repeated."""
    walks = Counter([await _walk_of(act) for _ in range(num)])
    while max(walks.values()) < USUAL:  # on a machine with many pauses
        walks[await _walk_of(act)] += 1
    return min((walk for walk, times in walks.items() if times >= USUAL), key=len)


async def _walk_of(act: Callable[[], Awaitable[None]]) -> tuple[Visit, ...]:
    """Return the calls from the start of an act until the loop has nothing left to do for it."""
    calls: list[Visit] = []
    inside = f"{PACKAGE}/"

    def note(frame: FrameType, event: str, _argument: object) -> None:
        code = frame.f_code
        name = code.co_qualname
        if event == "call" and code.co_filename.startswith(inside) and not name.endswith(("comp>", "genexpr>")):
            calls.append(Visit(code.co_filename.removeprefix(inside), name.replace("<locals>.", "")))

    await asyncio.sleep(SETTLING_TIME)
    sys.setprofile(note)
    try:
        await act()
        await asyncio.sleep(SETTLING_TIME)
    finally:
        sys.setprofile(None)
    return tuple(calls)


def write_walks() -> str:
    """Return the page *Architecture* with both walks between their markers."""
    text = PAGE.read_text("utf-8")
    for name, walk in measure_walks().items():
        begin, end = f"<!-- walk of a {name}: scripts/walks.py -->\n", f"<!-- end of the walk of a {name} -->"
        head, _, rest = text.partition(begin)
        _, _, tail = rest.partition(end)
        assert tail, f"{PAGE.name}: expected {begin.strip()} and {end}"
        text = f"{head}{begin}{_table_of(walk)}{end}{tail}"
    return text


def _table_of(walk: Sequence[Visit]) -> str:
    """Return a walk as a table: a row for each stay in a room, each file with the functions called in it."""
    figures = figures_of(walk)
    lines = [
        f"{figures.calls} calls in {figures.files} files of {figures.rooms} rooms, {figures.changes} changes of file.",
        "",
        "| room | files and their functions |",
        "|---|---|",
    ]
    for room, visits in groupby(walk, lambda visit: visit.room):
        stays = [
            f"`{file.removeprefix(f'{room}/')}`: {', '.join(_short(visit.function) for visit in stay)}"
            for file, stay in groupby(visits, lambda visit: visit.file)
        ]
        lines.append(f"| `{room}/` | {'; '.join(stays)} |")
    return "\n".join(lines) + "\n"


def _short(function: str) -> str:
    """Return the last name of a function; one without a name has that of the function around it."""
    *outer, name = function.split(".")
    return f"a function of {outer[-1]}" if name == "<lambda>" and outer else name.replace("<lambda>", "a function")


def main() -> None:
    """Run the command."""
    for name, walk in measure_walks().items():
        print(f"{name}: {figures_of(walk)}")
        for visit in walk:
            print(f"    {visit.file:50} {visit.function}")


if __name__ == "__main__":
    main()

"""Cost of `/sim/scene/state`: one message, and the CPU time of a server that a page looks at.

    python scripts/bench/scene.py [--rounds N] [--seconds S]

    python scripts/bench/scene.py --browser    the real page in Chromium, without the first table

The first table is made in this process. For the second, three servers run the same scene in real time at the same
time on one core: one without a client, one with a plain client, one with the page's subscriptions. The plain client
has the state as other programs have it: `/Ego_topic`, `/Object_topic` and `/SyncModeInfo` as JSON, at 20 Hz, with the
same rate as the page's. The figures are the CPU time of a frame, and their ratios. With `--browser`
the page is the real one in Chromium, on the core that the servers do not use. The plain client then has the page's own
subscriptions, as its socket has sent them: the same topics, rates and encoding.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from playwright.sync_api import sync_playwright

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.world.state.world import Body, Kind, World
from scripts.bench.load import Socket
from scripts.bench.page import FLAGS
from scripts.bench.program import SERVER, Program, machine, running

NUM_OBJECTS = (20, 200, 1_000)

PLAIN = [(name, "none", 1) for name in ("/Ego_topic", "/Object_topic", "/SyncModeInfo")]
PAGE = [
    ("/sim/scene/state", "cbor", 1),
    *((name, "none", 1) for name in ("/Ego_topic", "/SyncModeInfo")),
    *((name, "none", 0) for name in ("/sim/drivers", "/sim/collisions", "/sim/replay")),
]
"""Topic, compression, and whether a throttle of 50 ms with a queue of one message is asked for."""


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7, help="rounds of each figure, 7 by default")
    parser.add_argument("--seconds", type=float, default=4.0, help="length of a round with servers, 4 by default [s]")
    parser.add_argument("--browser", action="store_true", help="compare the real page with its own subscriptions")
    choice = parser.parse_args()
    print(machine())
    if choice.browser:
        _measure_browser(choice.rounds, choice.seconds)
        return
    for num in NUM_OBJECTS:
        _measure_message(num, choice.rounds)
    _measure_servers(choice.rounds, choice.seconds)


def _measure_message(num: int, rounds: int) -> None:
    """Print the time of a message in this process."""
    bus, world, library = Bus(Store(read_definitions("22.R2"), leniency=LENIENCY)), World(), DiskLibrary()
    node = make_node(bus, world, library, library.scenario("loop"))
    while len(world) < num:
        world.spawn(Kind.VEHICLE, Body(), name="car", x=10.0 * len(world), y=5_000.0, speed=3.0)
    publisher = node.context.publishers.find("/sim/scene/state")
    topic = bus.find_topic("/sim/scene/state")
    assert publisher is not None
    assert topic is not None
    made = Message(topic.type, publisher.make())  # type: ignore[union-attr] # it is published with frames
    works: dict[str, Callable[[], object]] = {
        "make": publisher.make,  # type: ignore[union-attr] # as above
        "CBOR": lambda: Message(topic.type, made.value).cbor,
        "JSON": lambda: Message(topic.type, made.value).json,
    }
    figures = ", ".join(f"{name} {_best(work, rounds) * 1e6:.0f} us" for name, work in works.items())
    sizes = f"{len(made.cbor) / 1000:.1f} kB of CBOR, {len(made.json) / 1000:.1f} kB of JSON"
    print(f"{len(world):5,} entities: {figures}; {sizes}")


def _best(work: Callable[[], object], rounds: int, num: int = 100) -> float:
    """Return the shortest mean time of a call over some rounds [s]."""
    best = float("inf")
    for _ in range(rounds):
        start = time.perf_counter()
        for _ in range(num):
            work()
        best = min(best, (time.perf_counter() - start) / num)
    return best


def _measure_servers(rounds: int, seconds: float) -> None:
    """Print the CPU time of a frame of the three servers."""
    command = (*SERVER, "--scenario", "loop")
    with ExitStack() as stack:
        names = ("no client", "plain client", "page")
        servers = {name: stack.enter_context(running(command)) for name in names}
        sockets = [
            *_subscribe(stack, servers["plain client"], PLAIN),
            *_subscribe(stack, servers["page"], PAGE),
        ]
        costs: dict[str, list[float]] = {name: [] for name in names}
        for i in range(rounds + 1):
            before = {name: server.cpu() for name, server in servers.items()}
            end = time.perf_counter() + seconds
            while time.perf_counter() < end:
                for socket in sockets:
                    socket.payloads()
                time.sleep(0.01)
            if i:  # the first round has the start of each server
                for name, server in servers.items():
                    costs[name].append((server.cpu() - before[name]) / (seconds * 50))
    for name in names:
        print(f"{name:>12}: {statistics.median(costs[name]) * 1e6:.0f} us of CPU a frame")
    ratios = [page / plain for page, plain in zip(costs["page"], costs["plain client"], strict=True)]
    print(f"page / plain client: {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})")


def _measure_browser(rounds: int, seconds: float) -> None:
    """Print the CPU time of a frame of a server with the real page, and of one with a client of the same topics."""
    ops: list[dict[str, object]] = []
    with ExitStack() as stack:
        servers = {name: stack.enter_context(running((*SERVER, "--scenario", "town"))) for name in ("plain", "page")}
        browser = stack.enter_context(sync_playwright()).chromium.launch(
            executable_path=shutil.which("chromium-headless-shell") or shutil.which("chromium"), args=FLAGS
        )
        stack.callback(browser.close)
        page = browser.new_page()
        page.on("websocket", lambda socket: socket.on("framesent", lambda text: ops.append(json.loads(text))))
        page.goto(f"http://127.0.0.1:{servers['page'].port}/")
        page.wait_for_selector(".header-frame:not(:empty)", state="attached")
        page.wait_for_timeout(1e3 * seconds)
        subscriptions = [op for op in ops if op["op"] == "subscribe"]
        socket = Socket(servers["plain"].port)
        stack.callback(socket.close)
        socket.finish()
        for op in subscriptions:
            socket.tell(**op)
        costs: dict[str, list[float]] = {name: [] for name in servers}
        for i in range(rounds + 1):
            before = {name: server.cpu() for name, server in servers.items()}
            end = time.perf_counter() + seconds
            while time.perf_counter() < end:
                socket.payloads()
                page.wait_for_timeout(10)
            if i:  # the first round has the start of each server
                for name, server in servers.items():
                    costs[name].append((server.cpu() - before[name]) / (seconds * 50))
    print("subscriptions:", ", ".join(str(op["topic"]) for op in subscriptions))
    for name, figures in costs.items():
        print(f"{name:>12}: {statistics.median(figures) * 1e6:.0f} us of CPU a frame")
    ratios = [page / plain for page, plain in zip(costs["page"], costs["plain"], strict=True)]
    print(f"page / client of the same topics: {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})")


def _subscribe(stack: ExitStack, server: Program, topics: Sequence[tuple[str, str, int]]) -> list[Socket]:
    """Return the socket of a client that subscribes to topics."""
    socket = Socket(server.port)
    stack.callback(socket.close)
    socket.finish()
    for name, compression, is_throttled in topics:
        options = {"throttle_rate": 50, "queue_length": 1} if is_throttled else {}
        socket.tell(op="subscribe", topic=name, compression=compression, **options)
    return [socket]


if __name__ == "__main__":
    main()

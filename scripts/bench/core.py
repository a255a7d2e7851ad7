"""Cost of the core: bytes of a tick in, bytes out, without sockets, event loop or clock.

One peer with one subscription, of `/Ego_topic`, repeatedly calls `/SyncModeWaitForTick` in a world of one ego and 20
objects (a scene of actors on paths, with added ones). The time is that from the arrival of the frame until the topic's
message and the answer are in the outbox, as bytes of the wire.

A second row is a call of `/sim/step` for 100 ticks that asks for `/Object_topic`, beside what it cannot do without: 100
frames, and that message encoded once. Nobody listens to any topic there.

    ./.venv/bin/python scripts/bench/core.py [--scenario NAME] [--objects N] [--rounds N] [--json FILE]
    ./.venv/bin/python scripts/bench/core.py --scenario demo --against CHECKOUT [--pairs N]
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median, quantiles

import orjson

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.bench import in_turn

# isort: split
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.state.world import Dynamics, Kind, World
from rosbridge_sim.world.step import step
from scripts.bench.program import machine

TICKS_PER_ROUND = 1_000

STEPS = 100
"""Ticks in one call of `/sim/step`."""

CALLS_PER_ROUND = 5

SECOND = 50
"""Ticks in a simulated second, in which each driver looks at the lanes beside it once."""


PATHS = Path(__file__).with_name("paths.json")
"""A scene of actors that see nothing, so that the core is measured and no drivers: the former demo."""


class Core:
    """A world in synchronous mode and one client, connected by the core alone."""

    def __init__(self, num_objects: int, *, scenario: str = str(PATHS), is_listening: bool = True) -> None:
        library = DiskLibrary()
        bus = Bus(Store(read_definitions("22.R2"), leniency=LENIENCY))
        self.world = World(0, Dynamics.SINGLE_TRACK)
        node = self._node = make_node(
            bus, self.world, library, library.opening_scenario(scenario), NodeSettings(start="sync")
        )
        self._outbox = Outbox(OutboxLimits(), _nothing, _nothing)
        self._peer = Peer(bus, Session(self._outbox, _ignore))
        start = {"user_id": "bench", "start_sync_mode": True, "time_step": 20}
        self._send({"op": "call_service", "service": "/SyncModeCmd", "args": {"request": start}})
        if is_listening:
            self._send({"op": "subscribe", "topic": "/Ego_topic"})
        for i in range(num_objects - self.num_objects):
            new = {"name": "2016_Hyundai_Ioniq", "position": {"x": 10.0 * i, "y": 500.0, "z": 0.0}, "frame": 0}
            self._send({"op": "publish", "topic": "/SyncModeAddObj", "type": "morai_msgs/SyncModeAddObj", "msg": new})
        tick = {"request": {"user_id": "bench", "frame": 1}}
        self._frame = orjson.dumps(
            {"op": "call_service", "service": "/SyncModeWaitForTick", "id": "tick", "args": tick}
        )
        self._outbox.take(2**30)
        steps = {"user_id": "bench", "n": STEPS, "topics": ["/Object_topic"]}
        self._steps = orjson.dumps({"op": "call_service", "service": "/sim/step", "id": "step", "args": steps})
        *topics, answer = (orjson.loads(frame) for frame in self.tick())
        assert [topic["op"] for topic in topics] == ["publish"] * is_listening, topics
        assert answer["values"]["response"]["tick_status"], answer
        assert self.num_objects == num_objects, f"{self.num_objects} objects in place of {num_objects}"
        assert node.context.sync_driver.num_ticks == 1

    @property
    def num_objects(self) -> int:
        """Number of vehicles, pedestrians and obstacles, without the ego."""
        return sum(len(self.world.rows(kind)) for kind in Kind if kind is not Kind.EGO)

    def tick(self) -> list[bytes]:
        """Carry out one tick.

        Returns:
            The frames that it sent.
        """
        self._peer.receive(self._frame, 0.0)
        return self._outbox.take(2**30)

    def step(self) -> list[bytes]:
        """One call for many ticks: the frames that it sent."""
        self._peer.receive(self._steps, 0.0)
        return self._outbox.take(2**30)

    def compute(self) -> bytes:
        """As many frames, and one message encoded: what a call for them cannot do without."""
        context = self._node.context
        for _ in range(STEPS):
            context.stepper.compute(0.0, is_tick=True, is_last=True)
        publisher = context.publishers.find("/Object_topic")
        assert publisher is not None
        message = context.publishers.sample(publisher)
        assert message is not None
        return message.json

    def _send(self, op: dict[str, object]) -> None:
        self._peer.receive(orjson.dumps(op), 0.0)


def _ignore(_due: float) -> None:
    """Ignore a due time: nothing is throttled."""


def _nothing() -> None:
    """Do nothing: no socket waits for the outbox."""


def measure_steps(num_objects: int, rounds: int, scenario: str) -> tuple[float, float]:
    """Return the CPU time of a call for `STEPS` ticks [s], and its ratio to what it cannot do without: medians."""
    core = Core(num_objects, scenario=scenario, is_listening=False)
    (answer,) = core.step()
    assert orjson.loads(answer)["values"]["steps"] == STEPS, answer[:300]
    core.compute()
    times, ratios = [], []
    for _ in range(rounds):
        cuts = [time.process_time()]
        for work in (core.step, core.compute):
            for _ in range(CALLS_PER_ROUND):
                work()
            cuts.append(time.process_time())
        times.append((cuts[1] - cuts[0]) / CALLS_PER_ROUND)
        ratios.append((cuts[1] - cuts[0]) / (cuts[2] - cuts[1]))
    return median(times), median(ratios)


def main() -> None:
    """Measure, print, write JSON if asked."""
    parser = argparse.ArgumentParser(description="Ticks a second without sockets")
    parser.add_argument("--scenario", default=str(PATHS), help="name or file [actors on paths that see nothing]")
    parser.add_argument("--objects", type=int, default=20, help="beside the ego; at least what the scene has")
    parser.add_argument("--rounds", type=int, default=20, help=f"of {TICKS_PER_ROUND} ticks each")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures here too")
    args = in_turn.parse(parser)
    logging.disable(logging.WARNING)
    in_turn.wait_for_kernels()

    def in_turns(work: Callable[[Core], object]) -> tuple[in_turn.Work, int]:
        core = Core(args.objects, scenario=args.scenario)
        return lambda: [work(core) for _ in range(SECOND)], SECOND

    if in_turn.run(
        args,
        {
            "tick": lambda: in_turns(Core.tick),
            "step of the world alone": lambda: in_turns(lambda core: step(core.world)),
        },
        "tick",
    ):
        return
    core = Core(args.objects, scenario=args.scenario)
    latencies: list[float] = []
    rates: list[float] = []
    for _ in range(args.rounds):
        started = time.process_time()
        for _ in range(TICKS_PER_ROUND):
            before = time.perf_counter()
            core.tick()
            latencies.append(time.perf_counter() - before)
        rates.append(TICKS_PER_ROUND / (time.process_time() - started))
    cuts = quantiles(latencies, n=100)
    print(machine())
    print(
        f"1 ego and {args.objects} objects, one subscriber of /Ego_topic: {median(rates):,.0f} ticks per second of CPU"
        f" ({min(rates):,.0f}..{max(rates):,.0f}); a tick p50 {cuts[49] * 1e6:.1f} us, p99 {cuts[98] * 1e6:.1f} us"
    )
    call, ratio = measure_steps(args.objects, args.rounds, args.scenario)
    print(
        f"/sim/step for {STEPS} ticks: {call * 1e3:.2f} ms of CPU, {ratio:.2f} x the frames and one encoding of what is"
        " asked for (wanted: at most 1.1)"
    )
    if args.json:
        figures = {"ticks_per_second": median(rates), "p50_us": cuts[49] * 1e6, "p99_us": cuts[98] * 1e6}
        figures |= {"step_call_ms": call * 1e3, "step_call_of_frames": ratio}
        args.json.write_text(json.dumps({"machine": machine(), "objects": args.objects} | figures, indent=1))


if __name__ == "__main__":
    main()

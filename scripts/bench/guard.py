#!/usr/bin/env python3
"""Cost of fixed workloads: functions that they call, and CPU time beside another checkout.

    python scripts/bench/guard.py [--only NAME]...                       prints the calls of each workload
    python scripts/bench/guard.py --tree FOLDER [--pairs N] [--rounds N] [--only NAME]...

The calls are those of all functions, of Python and of C, as the interpreter reports them in one repetition. They are
the same on every machine, so `tests/test_cost.py` holds them. They do not tell how long a call takes: `--tree` measures
the CPU time of another checkout and of this one in turn, as multiples of a reference loop in the same process, and
prints both with their ratio. A multiple depends on the kind of processor, their ratio hardly.

The workloads are those parts of the server that each message passes, from the bytes of a frame to the bytes of the
answer, without sockets.
"""

from __future__ import annotations

import argparse
import gc
import json
import logging
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from time import thread_time_ns
from types import FrameType

_HERE = Path(__file__).resolve()
_TREE = Path(sys.argv[sys.argv.index("--measure-tree") + 1]) if "--measure-tree" in sys.argv else _HERE.parents[2]
sys.path.insert(0, str(_TREE))

import orjson  # noqa: E402 - the path comes first

from rosbridge_sim.graph.bus import Bus  # noqa: E402 - as above
from rosbridge_sim.graph.peers.peer import Peer  # noqa: E402 - as above
from rosbridge_sim.morai.releases import LENIENCY  # noqa: E402 - as above
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits  # noqa: E402 - as above
from rosbridge_sim.protocol.session import Session  # noqa: E402 - as above
from rosbridge_sim.schema.store import Store  # noqa: E402 - as above
from rosbridge_sim.shell.files.definitions import read_definitions  # noqa: E402 - as above
from rosbridge_sim.shell.websocket.freed_memory import keep_memory  # noqa: E402 - as above
from scripts.bench import bodies  # noqa: E402 - as above
from scripts.bench.core import Core  # noqa: E402 - as above

WARM_UPS = 500
"""Repetitions before calls are counted: a topic, for one, is published in a shorter way after some hundreds of them.

A number and no time, so that the same repetitions are counted on a slow machine."""

REPEATS = 9
"""Repetitions whose calls are counted; the lowest number counts, since every few frames a tick has more to do."""

ROUNDS = 40
"""Turns of the workload and of the reference loop in one measurement."""

SLICE_NS = 2_000_000
"""About the time of one turn [ns]."""

Work = Callable[[], object]


def reference() -> None:
    """Do some of what the server does with each message: decode, look up, copy and encode."""
    table: dict[str, int] = {}
    for i in range(20):
        op = orjson.loads(b'{"op":"publish","topic":"/t","msg":{"a":1,"b":[1.5,2.5],"c":"text"}}')
        table[op["topic"]] = table.get(op["topic"], 0) + len(op["msg"])
        parts = [b"head", orjson.dumps(op["msg"]), str(i).encode()]
        b"".join(parts)


class Wire:
    """Clients of one bus, without sockets."""

    def __init__(self) -> None:
        self.bus = Bus(Store(read_definitions("22.R2"), leniency=LENIENCY))

    def client(self) -> tuple[Peer, Outbox]:
        """Connect a client.

        Returns:
            Its peer and its outbox.
        """
        outbox = Outbox(OutboxLimits(), _nothing, _nothing)
        return Peer(self.bus, Session(outbox, lambda _due: None)), outbox


def _nothing() -> None:
    """Do nothing: no socket waits for the outbox."""


def _say(peer: Peer, **op: object) -> None:
    peer.receive(orjson.dumps(op), 0.0)


def _publish(type_name: str, body: bodies.Json, num: int, compression: str = "none") -> Callable[[], Work]:
    def prepare() -> Work:
        wire = Wire()
        peer, _ = wire.client()
        listeners = [wire.client() for _ in range(num)]
        for listener, _ in listeners:
            _say(listener, op="subscribe", topic="/bench", type=type_name, compression=compression)
        _say(peer, op="advertise", topic="/bench", type=type_name)
        frame = orjson.dumps({"op": "publish", "topic": "/bench", "msg": body})
        outboxes = [outbox for _, outbox in listeners]

        def work() -> None:
            peer.receive(frame, 0.0)
            for outbox in outboxes:
                while outbox:
                    outbox.take(2**20)

        peer.receive(frame, 0.0)
        for outbox in outboxes:
            (sent,) = outbox.take(2**30)
            assert compression != "none" or orjson.loads(sent)["msg"] == body, sent[:300]
        return work

    return prepare


def _call() -> Work:
    wire = Wire()
    (provider, asked), (caller, answers) = wire.client(), wire.client()
    _say(provider, op="advertise_service", service="/s", type="std_srvs/SetBool")
    call = orjson.dumps({"op": "call_service", "service": "/s", "id": "call", "args": {"data": True}})
    head = b'{"op":"service_response","service":"/s","values":{"success":true,"message":"done"},"result":true,"id":'

    def work() -> bytes:
        caller.receive(call, 0.0)
        (frame,) = asked.take(2**20)
        start = frame.index(b'"id":') + 5
        provider.receive(head + frame[start : frame.index(b'"', start + 1) + 1] + b"}", 0.0)
        (answer,) = answers.take(2**20)
        return answer

    assert orjson.loads(work())["values"] == {"success": True, "message": "done"}
    return work


def _own_call() -> Work:
    core = Core(20)
    peer, outbox = core._peer, core._outbox  # noqa: SLF001 - a client of the same bus
    call = orjson.dumps({"op": "call_service", "service": "/sim/state_hash", "id": "c", "args": {}})

    def work() -> bytes:
        peer.receive(call, 0.0)
        (answer,) = outbox.take(2**20)
        return answer

    assert orjson.loads(work())["result"] is True
    return work


def _tick() -> Work:
    return Core(20).tick


def _step() -> Work:
    core = Core(20, is_listening=False)
    peer, outbox = core._peer, core._outbox  # noqa: SLF001 - as above
    command = {"longlCmdType": 2, "velocity": 10.0}
    args = {"user_id": "bench", "n": 1, "commands": [{"ego": 0, "commands": [command]}]}
    call = orjson.dumps({"op": "call_service", "service": "/sim/step", "id": "s", "args": args})

    def work() -> bytes:
        peer.receive(call, 0.0)
        (answer,) = outbox.take(2**20)
        return answer

    assert orjson.loads(work())["values"]["steps"] == 1
    return work


def _client() -> Work:
    wire = Wire()
    subscribe = orjson.dumps({"op": "subscribe", "topic": "/bench", "type": "nav_msgs/Odometry"})
    keeper, _ = wire.client()
    keeper.receive(subscribe, 0.0)

    def work() -> None:
        peer, _ = wire.client()
        peer.receive(subscribe, 0.0)
        peer.leave(0.0)

    return work


WORKLOADS: dict[str, Callable[[], Work]] = {
    "publish 94 B": _publish("std_msgs/String", bodies.text(), 1),
    "publish 0.7 kB Odometry": _publish("nav_msgs/Odometry", bodies.odometry(), 1),
    "publish 0.9 kB ObjectStatusList": _publish("morai_msgs/ObjectStatusList", bodies.objects(2), 1),
    "publish 0.9 kB ObjectStatusList as CBOR": _publish("morai_msgs/ObjectStatusList", bodies.objects(2), 1, "cbor"),
    "publish 100 kB CompressedImage": _publish("sensor_msgs/CompressedImage", bodies.image(), 1),
    "publish 0.7 kB to 10 listeners": _publish("nav_msgs/Odometry", bodies.odometry(), 10),
    "call of a client's service": _call,
    "call of the simulator's service": _own_call,
    "tick": _tick,
    "/sim/step of one frame": _step,
    "client that connects, subscribes and leaves": _client,
}


def measure(prepare: Callable[[], Work], rounds: int = ROUNDS) -> float:
    """Return the cost of a workload, as a multiple of the reference loop.

    Args:
        prepare: makes the workload.
        rounds: turns of both.
    """
    work = prepare()
    num_works, num_references = _count(work), _count(reference)
    gc.collect()
    gc.disable()
    try:
        pairs = [(_time(work, num_works), _time(reference, num_references)) for _ in range(rounds)]
    finally:
        gc.enable()
    return (min(pair[0] for pair in pairs) / num_works) / (min(pair[1] for pair in pairs) / num_references)


def _count(work: Work) -> int:
    """Return how often a function fits into one turn; it is called for a while, so that its caches are warm."""
    num, start = 0, thread_time_ns()
    while thread_time_ns() - start < 10 * SLICE_NS:
        work()
        num += 1
    return max(1, num // 10)


def _time(work: Work, num: int) -> int:
    start = thread_time_ns()
    for _ in range(num):
        work()
    return thread_time_ns() - start


def count_calls(prepare: Callable[[], Work]) -> int:
    """Return how many functions a workload calls in one repetition, of Python and of C.

    Args:
        prepare: makes the workload.
    """
    work = prepare()
    for _ in range(WARM_UPS):
        work()
    return min(_calls_of(work) for _ in range(REPEATS))


def _calls_of(work: Work) -> int:
    num = 0

    def note(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal num
        num += event in {"call", "c_call"}

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return num - 1  # without the call that ends the count


def _compare(tree: Path, names: Sequence[str], rounds: int, pairs: int) -> None:
    """Print the costs of another checkout and of this one, measured in turn."""
    costs: dict[Path, dict[str, list[float]]] = {tree: {}, _HERE.parents[2]: {}}
    for _ in range(pairs):
        for each, found in costs.items():
            command = [sys.executable, str(_HERE), "--measure-tree", str(each), "--rounds", str(rounds)]
            for name in names:
                command += ["--only", name]
            made = subprocess.run(command, check=True, capture_output=True, text=True, cwd=each)  # noqa: S603 - our own
            for name, cost in json.loads(made.stdout).items():
                found.setdefault(name, []).append(cost)
    other, own = costs.values()
    for name in names:
        ratio = median(new / old for new, old in zip(own[name], other[name], strict=True))
        print(f"{name:46} {median(other[name]):9.4f} {median(own[name]):9.4f} {ratio:6.2f}")


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="workloads whose name holds this")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="turns of each [%(default)s]")
    parser.add_argument("--tree", type=Path, metavar="FOLDER", help="compare with this checkout")
    parser.add_argument("--pairs", type=int, default=5, help="measurements of each checkout [%(default)s]")
    parser.add_argument("--measure-tree", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    keep_memory()  # as the server does
    names = [name for name in WORKLOADS if not options.only or any(part in name for part in options.only)]
    if options.tree is not None:
        _compare(options.tree.resolve(), names, options.rounds, options.pairs)
    elif options.measure_tree is not None:
        print(json.dumps({name: measure(WORKLOADS[name], options.rounds) for name in names}))
    else:
        for name in names:
            print(f"{name:46} {count_calls(WORKLOADS[name]):6}")


if __name__ == "__main__":
    main()

"""Cost of the server on the wire, compared with the lower bound of a Python relay (`relay.py`).

Server and relay (the floor) run at the same time, pinned to the same core, and are loaded in turn (A B A B ...), so
that a slow minute of the machine affects both. Each figure is the median of the rounds, with the lowest and the
highest. The ratio to the floor is the median of the rounds' ratios; above 1 the server is better. The CPU time of a
delivered message is the figure with the least noise.

    ./.venv/bin/python scripts/bench/wire.py [--rounds N] [--quick] [--only NAME]... [--against PROGRAM] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median, quantiles

import orjson
from websockets.sync.client import connect

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.client import Client
from scripts.bench import bodies
from scripts.bench.core import PATHS
from scripts.bench.load import Result, Socket, calls, connect_many, flood, masked, pulse, round_trips
from scripts.bench.program import FLOOR, SERVER, Program, machine, running

TOPIC = "/bench"
SERVICE = "/bench_service"
SETTLE = 0.05
"""Time after which a subscription on one socket holds for a publish on another [s]; rosbridge has no reply to
subscribe."""

WINDOW_BYTES = 128 * 2**10
"""Bytes in flight; two loopback socket buffers hold them without a pause of either side."""

Figures = dict[str, float]

RATE, CPU, P50, P99, LOAD, MEMORY, TIME = "per second", "CPU us each", "p50 ms", "p99 ms", "CPU %", "memory", "ms"
TWO, TWO_CPU = "us the two calls", "CPU us the two calls"
OF_TWO, OF_TWO_CPU = "of the two calls", "of their CPU"
CLIENT = "CPU us of our client"
FRAME, P50_REST = "ms a further frame", "p50 ms without it"
ONE_MASTER = "one master per second"
STEP_WANTED = {P50_REST: 1 / 1.3, CLIENT: 1 / 1.3}

FURTHER = 10
"""Further steps in a call that shows what a frame costs within the server."""


@dataclass(frozen=True, slots=True)
class Row:
    """One kind of work.

    Attributes:
        name: for the table.
        server, floor: do it for about the given seconds, and return its cost.
        wanted: figure -> smallest acceptable ratio to the floor.
        is_world: the server runs with its world; otherwise it is only a gateway.
        is_fresh: a new process for each round.
    """

    name: str
    server: Callable[[Program, float], Figures]
    floor: Callable[[Program, float], Figures]
    wanted: dict[str, float] = field(default_factory=dict)
    is_world: bool = False
    is_fresh: bool = False


def _connect(program: Program, num: int) -> list[Socket]:
    return connect_many(program.port, num)


def _percentiles(result: Result) -> Figures:
    cuts = quantiles(result.latencies, n=100, method="inclusive")
    return {P50: cuts[49] * 1e3, P99: cuts[98] * 1e3}


class _Topic:
    """One publisher, some listeners, one message. The first copy is checked, and its length is taken."""

    def __init__(self, program: Program, type_name: str, body: bodies.Json, num_listeners: int) -> None:
        self.publisher, *self.listeners = self.sockets = _connect(program, 1 + num_listeners)
        for listener in self.listeners:
            listener.tell(op="subscribe", topic=TOPIC, type=type_name)
        self.publisher.tell(op="advertise", topic=TOPIC, type=type_name)
        time.sleep(SETTLE)
        self.frame = masked(orjson.dumps({"op": "publish", "topic": TOPIC, "msg": body}))
        self.publisher.raw.sendall(self.frame)
        first, *others = [listener.payload() for listener in self.listeners]
        op = orjson.loads(first)
        assert op == {"op": "publish", "topic": TOPIC, "msg": body}, f"not what was published: {first[:500]!r}"
        assert all(other == first for other in others)
        self.out_size = len(first)

    def close(self) -> None:
        for one in self.sockets:
            one.close()


def _flood(type_name: str, body: bodies.Json, num_listeners: int) -> Callable[[Program, float], Figures]:
    """Return the work: as many messages as possible."""

    def run(program: Program, seconds: float) -> Figures:
        topic = _Topic(program, type_name, body, num_listeners)
        window = max(4, min(256, WINDOW_BYTES // len(topic.frame)))
        args = (topic.publisher, topic.listeners, topic.frame, topic.out_size)
        flood(*args, seconds=seconds / 4, window=window)
        cpu = program.cpu()
        result = flood(*args, seconds=seconds, window=window)
        cpu = program.cpu() - cpu
        topic.close()
        num = result.num * num_listeners
        return {RATE: num / result.seconds, CPU: cpu / num * 1e6}

    return run


def _ping_pong(type_name: str, body: bodies.Json) -> Callable[[Program, float], Figures]:
    """Return the work: one message in flight."""

    def run(program: Program, seconds: float) -> Figures:
        topic = _Topic(program, type_name, body, 1)
        args = (topic.publisher, topic.listeners[0], topic.frame, lambda _: True)
        round_trips(*args, seconds / 4)
        cpu = program.cpu()
        result = round_trips(*args, seconds)
        cpu = program.cpu() - cpu
        topic.close()
        return _percentiles(result) | {CPU: cpu / result.num * 1e6}

    return run


def _calls(num_callers: int) -> Callable[[Program, float], Figures]:
    """Return the work: calls to a service of a client."""

    def run(program: Program, seconds: float) -> Figures:
        sockets = _connect(program, 1 + num_callers)
        provider, *callers = sockets
        provider.tell(op="advertise_service", service=SERVICE, type="std_srvs/SetBool")
        time.sleep(SETTLE)
        callers[0].tell(op="call_service", service=SERVICE, id="call", args={"data": True})
        asked = orjson.loads(provider.payload())
        assert asked["args"] == {"data": True}
        values = {"success": True, "message": "done"}
        provider.tell(op="service_response", service=SERVICE, id=asked["id"], values=values, result=True)
        first = callers[0].payload()
        answer = {"op": "service_response", "service": SERVICE, "id": "call", "values": values, "result": True}
        assert orjson.loads(first) == answer, f"not what was answered: {first!r}"
        frame = masked(orjson.dumps({"op": "call_service", "service": SERVICE, "id": "call", "args": {"data": True}}))
        args = (callers, provider, frame, len(first))
        calls(*args, service=SERVICE, values=orjson.dumps(values), seconds=seconds / 4)
        cpu = program.cpu()
        result = calls(*args, service=SERVICE, values=orjson.dumps(values), seconds=seconds)
        cpu = program.cpu() - cpu
        for one in sockets:
            one.close()
        return {RATE: result.num / result.seconds, CPU: cpu / result.num * 1e6} | _percentiles(result)

    return run


def _pulse(num_listeners: int, rate: float) -> Callable[[Program, float], Figures]:
    """Return the work: many listeners at a steady rate [Hz]."""

    def run(program: Program, seconds: float) -> Figures:
        topic = _Topic(program, "nav_msgs/Odometry", bodies.odometry(), num_listeners)
        args = (topic.publisher, topic.listeners, topic.frame, topic.out_size)
        pulse(*args, seconds=seconds / 2, rate=rate)
        cpu = program.cpu()
        result = pulse(*args, seconds=2 * seconds, rate=rate)
        cpu = program.cpu() - cpu
        topic.close()
        return _percentiles(result) | {LOAD: cpu / result.seconds * 100}

    return run


def _connections(num: int) -> Callable[[Program, float], Figures]:
    """Return the work: many clients connect at once and stay."""

    def run(program: Program, _seconds: float) -> Figures:
        for one in _connect(program, 10):  # so that the imports of the first connection are not counted
            one.close()
        time.sleep(0.2)
        memory = program.memory()
        start = time.perf_counter()
        sockets = _connect(program, num)
        elapsed = time.perf_counter() - start
        time.sleep(0.2)
        memory = program.memory() - memory
        for one in sockets:
            one.close()
        return {TIME: elapsed * 1e3, MEMORY + " kB each": memory * 1024 / num}

    return run


def _idle(num_clients: int) -> Callable[[Program, float], Figures]:
    """Return the work: start of a new process, and its memory with some clients."""

    def run(program: Program, _seconds: float) -> Figures:
        time.sleep(0.5)
        figures = {TIME: program.start * 1e3, MEMORY + " MB": program.memory()}
        sockets = _connect(program, num_clients)
        time.sleep(0.5)
        figures[f"{MEMORY} MB, {num_clients} clients"] = program.memory()
        for one in sockets:
            one.close()
        return figures

    return run


class _Tick:
    """One step of the world for each call, while one client subscribes to the ego; all on one socket, as clients do."""

    def __init__(self) -> None:
        self._call = {
            "op": "call_service",
            "service": "/SyncModeWaitForTick",
            "id": "tick",
            "args": {"request": {"user_id": "bench", "frame": 1}},
        }
        self._answer_size = 0

    def on_server(self, program: Program, seconds: float) -> Figures:
        """Measure ticks of the server."""
        (client,) = _connect(program, 1)
        start = {"user_id": "bench", "start_sync_mode": True, "time_step": 20}
        client.tell(op="call_service", service="/SyncModeCmd", id="start", args={"request": start})
        started = orjson.loads(client.payload())
        assert started["values"]["response"]["result"], f"no synchronous mode: {started}"
        client.tell(op="subscribe", topic="/Ego_topic", type="morai_msgs/EgoVehicleStatus")
        client.tell(**self._call)
        answer = client.payload()
        while b'"service_response"' not in answer:
            answer = client.payload()
        assert orjson.loads(answer)["values"]["response"]["tick_status"], f"no tick: {answer!r}"
        self._answer_size = len(answer)
        frame = masked(orjson.dumps(self._call))
        return self._measure(program, client, frame, b'"service_response"', seconds)

    def on_floor(self, program: Program, seconds: float) -> Figures:
        """Measure echoes of the floor, as long as the answer of a tick."""
        (client,) = _connect(program, 1)
        frame = masked(orjson.dumps(self._call | {"op": "echo", "size": self._answer_size}))
        return self._measure(program, client, frame, b"    ", seconds)

    @staticmethod
    def _measure(program: Program, client: Socket, frame: bytes, mark: bytes, seconds: float) -> Figures:
        def is_answer(payload: bytes) -> bool:
            return mark in payload

        round_trips(client, client, frame, is_answer, seconds / 4)
        cpu = program.cpu()
        result = round_trips(client, client, frame, is_answer, seconds)
        cpu = program.cpu() - cpu
        client.close()
        return {RATE: result.num / result.seconds, CPU: cpu / result.num * 1e6} | _percentiles(result)


class _Step:
    """One step for each call of `/sim/step` with a command, beside the two calls of synchronous mode that do the same.

    An echo moves no world. So the cost of a frame is measured, too, by calls for more steps, and is left out of one
    figure. The last figure is the CPU time of our own client, which is this process, beside an echo by the library
    that it uses.
    """

    def __init__(self) -> None:
        self._command = {"longlCmdType": 2, "velocity": 30.0}
        args = {"user_id": "bench", "n": 1, "commands": [{"ego": 0, "commands": [self._command]}]}
        self._call = {"op": "call_service", "service": "/sim/step", "id": "step", "args": args}
        requests: tuple[tuple[str, dict[str, object]], ...] = (
            ("/SyncModeCtrlCmd", {"frame": 0, "command": self._command}),
            ("/SyncModeWaitForTick", {"user_id": "bench", "frame": 0}),
        )
        self._two = [
            {"op": "call_service", "service": service, "id": "call", "args": {"request": request}}
            for service, request in requests
        ]
        self._answer_size = 0

    def on_server(self, program: Program, seconds: float) -> Figures:
        """The step, the two calls, and a step of our client."""
        (client,) = _connect(program, 1)
        start = {"user_id": "bench", "start_sync_mode": True, "time_step": 20}
        client.tell(op="call_service", service="/SyncModeCmd", id="start", args={"request": start})
        assert orjson.loads(client.payload())["values"]["response"]["result"], "no synchronous mode"
        client.tell(**self._call)
        answer = client.payload()
        assert orjson.loads(answer)["values"]["steps"] == 1, f"no step: {answer!r}"
        self._answer_size = len(answer)
        frames = [masked(orjson.dumps(call)) for call in (self._call, *self._two)]
        args = {"user_id": "bench", "n": 1 + FURTHER}
        more = [masked(orjson.dumps(self._call | {"args": args | {"n": n}})) for n in (1, 1 + FURTHER)]
        figures = self._measure(program, client, [*frames, *more], seconds)
        with Client(f"ws://127.0.0.1:{program.port}") as blocking:
            blocking.start_sync(user_id="bench")
            return figures | {CLIENT: _own_cpu(lambda: blocking.step(commands={0: self._command}), seconds)}

    def on_floor(self, program: Program, seconds: float) -> Figures:
        """The bare echo, two of them, and an echo by the library."""
        (client,) = _connect(program, 1)
        text = orjson.dumps(self._call | {"op": "echo", "size": self._answer_size}).decode()
        figures = self._measure(program, client, [masked(text.encode())] * 3, seconds)

        def echo() -> None:
            blocking.send(text)
            blocking.recv()

        with connect(f"ws://127.0.0.1:{program.port}", compression=None, ping_interval=None) as blocking:
            return figures | {CLIENT: _own_cpu(echo, seconds)}

    @staticmethod
    def _measure(program: Program, client: Socket, frames: Sequence[bytes], seconds: float) -> Figures:
        """Measure the call, the two calls and, if there are any, the calls for one step and for more."""
        frame, two, more = frames[0], frames[1:3], frames[3:]
        round_trips(client, client, frame, lambda _: True, seconds / 4)
        cuts = [program.cpu()]
        result = round_trips(client, client, frame, lambda _: True, seconds)
        cuts.append(program.cpu())
        num, begin = 0, time.perf_counter()
        while time.perf_counter() < begin + seconds:
            for one in two:
                client.raw.sendall(one)
                client.payload()
            num += 1
        two_time = (time.perf_counter() - begin) / num * 1e6
        cuts.append(program.cpu())
        further = [
            median(round_trips(client, client, one, lambda _: True, seconds / 4).latencies) * 1e3 for one in more
        ]
        client.close()
        cpu, two_cpu = (cuts[1] - cuts[0]) / result.num * 1e6, (cuts[2] - cuts[1]) / num * 1e6
        percentiles = _percentiles(result)
        of_frame = (further[1] - further[0]) / FURTHER if further else 0.0
        return {
            RATE: result.num / result.seconds,
            CPU: cpu,
            TWO: two_time,
            TWO_CPU: two_cpu,
            OF_TWO: result.seconds / result.num * 1e6 / two_time,
            OF_TWO_CPU: cpu / two_cpu,
            FRAME: of_frame,
            P50_REST: percentiles[P50] - of_frame,
        } | percentiles


def _own_cpu(work: Callable[[], object], seconds: float) -> float:
    """Return the CPU time of this process for a call of a function [us]."""
    num, cpu, end = 0, time.process_time(), time.perf_counter() + seconds
    while time.perf_counter() < end:
        work()
        num += 1
    return (time.process_time() - cpu) / num * 1e6


class _Barrier:
    """A step of the world for a tick of each of three members, beside a tick of one master; no topic is heard."""

    SERVICE = "/SyncModeWaitForTick"

    def on_server(self, program: Program, seconds: float) -> Figures:
        """The members, and then the master."""
        clients = _connect(program, 3)
        names = [f"member-{i}" for i in range(len(clients))]
        for client, name in zip(clients, names, strict=True):
            self._ask(client, "/sim/barrier/join", {"user_id": name, "deadline_s": 10.0})
        members = self._rate(clients, [self._tick(name) for name in names], seconds)
        for client, name in zip(clients, names, strict=True):
            self._ask(client, "/sim/barrier/leave", {"user_id": name})
        start = {"user_id": "bench", "start_sync_mode": True, "time_step": 20}
        self._ask(clients[0], "/SyncModeCmd", {"request": start})
        master = self._rate(clients[:1], [self._tick("bench")], seconds)
        for client in clients:
            client.close()
        return {RATE: members, ONE_MASTER: master}

    def on_floor(self, program: Program, seconds: float) -> Figures:
        """As many echoes at once, and one."""
        clients = _connect(program, 3)
        echo = masked(orjson.dumps({"op": "echo", "id": "tick", "service": self.SERVICE, "size": 800}))
        three, one = (self._rate(some, [echo] * len(some), seconds) for some in (clients, clients[:1]))
        for client in clients:
            client.close()
        return {RATE: three, ONE_MASTER: one}

    def _tick(self, user_id: str) -> bytes:
        args = {"request": {"user_id": user_id, "frame": 0}}
        return masked(orjson.dumps({"op": "call_service", "service": self.SERVICE, "id": "tick", "args": args}))

    @staticmethod
    def _ask(client: Socket, service: str, args: dict[str, object]) -> None:
        client.tell(op="call_service", service=service, args=args, id="ask")
        answer = orjson.loads(client.payload())
        while answer.get("id") != "ask":  # a member is told what the others do
            answer = orjson.loads(client.payload())
        values = answer["values"].get("response", answer["values"])
        assert values["result"], f"{service}: {answer}"

    @staticmethod
    def _rate(clients: Sequence[Socket], frames: Sequence[bytes], seconds: float) -> float:
        num, begin = 0, time.perf_counter()
        while time.perf_counter() < begin + seconds:
            for client, frame in zip(clients, frames, strict=True):
                client.raw.sendall(frame)
            for client in clients:
                while b'"service_response"' not in (payload := client.payload()) and b"    " not in payload:
                    pass
            num += 1
        return num / (time.perf_counter() - begin)


def _row(name: str, run: Callable[[Program, float], Figures], *wanted: str, is_fresh: bool = False) -> Row:
    return Row(name, run, run, dict.fromkeys(wanted, 0.7), is_fresh=is_fresh)


_tick = _Tick()
_step = _Step()
_barrier = _Barrier()

ROWS = (
    _row("publish 94 B", _flood("std_msgs/String", bodies.text(), 1), RATE, CPU),
    _row("publish 0.7 kB Odometry", _flood("nav_msgs/Odometry", bodies.odometry(), 1), RATE, CPU),
    _row("publish 0.9 kB ObjectStatusList", _flood("morai_msgs/ObjectStatusList", bodies.objects(2), 1), RATE, CPU),
    _row("publish 100 kB CompressedImage", _flood("sensor_msgs/CompressedImage", bodies.image(), 1), RATE, CPU),
    _row("publish 0.7 kB to 10 listeners", _flood("nav_msgs/Odometry", bodies.odometry(), 10), RATE, CPU),
    _row("one message in flight, 94 B", _ping_pong("std_msgs/String", bodies.text()), P50, CPU),
    _row("one message in flight, 0.7 kB", _ping_pong("nav_msgs/Odometry", bodies.odometry()), P50, CPU),
    _row("calls to a client's service, 1 caller", _calls(1), RATE, CPU),
    _row("calls to a client's service, 8 callers", _calls(8), RATE, CPU),
    _row("100 listeners at 50 Hz, 0.7 kB", _pulse(100, 50.0), P50, LOAD),
    _row("200 connections", _connections(200), is_fresh=True),
    Row("tick, beside an echo as long", _tick.on_server, _tick.on_floor, {P50: 1 / 1.6}, is_world=True),
    Row("step, beside an echo as long", _step.on_server, _step.on_floor, STEP_WANTED, is_world=True),
    Row("barrier of three, beside three echoes", _barrier.on_server, _barrier.on_floor, {}, is_world=True),
    Row("start and idle memory", _idle(10), _idle(10), is_world=True, is_fresh=True),
)


def _measure(
    rows: Sequence[Row], rounds: int, seconds: float, against: str | None
) -> dict[str, list[tuple[Figures, Figures]]]:
    """Measure all rows.

    Args:
        rows: the work.
        rounds: of each row.
        seconds: of each measurement.
        against: another server instead of the floor.

    Returns:
        Row -> (server's figures, floor's figures) of each round.
    """
    worldless = (*SERVER, "--no-world")
    measured: dict[str, list[tuple[Figures, Figures]]] = {}
    with running(worldless):  # so that the first, slower start is not measured
        pass
    for row in rows:
        command = (*SERVER, "--scenario", str(PATHS)) if row.is_world else worldless
        other: tuple[str, ...] = FLOOR
        run_other = row.floor
        if against is not None:
            other, run_other = (against, "serve", "--port", "0", *command[len(SERVER) :]), row.server
        measured[row.name] = []
        with ExitStack() as stack:
            if not row.is_fresh:
                server, floor = stack.enter_context(running(command)), stack.enter_context(running(other))
            for _ in range(rounds):
                if row.is_fresh:
                    with running(command) as server:
                        ours = row.server(server, seconds)
                    with running(other) as floor:
                        theirs = run_other(floor, seconds)
                else:
                    ours, theirs = row.server(server, seconds), run_other(floor, seconds)
                measured[row.name].append((ours, theirs))
                print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return measured


def _summary(rows: Sequence[Row], measured: dict[str, list[tuple[Figures, Figures]]]) -> list[dict[str, object]]:
    """Return one entry for each figure of each row."""
    entries: list[dict[str, object]] = []
    for row in rows:
        for name in measured[row.name][0][0]:
            ours = [server[name] for server, _ in measured[row.name]]
            theirs = [floor[name] for _, floor in measured[row.name]]
            ratios = [
                a / b if name in {RATE, ONE_MASTER} else b / a
                for a, b in zip(ours, theirs, strict=True)
                if a > 0 and b > 0
            ]
            entries.append(
                {
                    "row": row.name,
                    "figure": name,
                    "server": median(ours),
                    "server_range": (min(ours), max(ours)),
                    "floor": median(theirs),
                    "floor_range": (min(theirs), max(theirs)),
                    "of_floor": median(ratios) if ratios else None,
                    "wanted": row.wanted.get(name),
                }
            )
    return entries


def _shown(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def _print_table(entries: Sequence[dict[str, object]]) -> None:
    def span(entry: dict[str, object], who: str) -> str:
        low, high = entry[who + "_range"]  # type: ignore[misc] # built by _summary
        return f"{_shown(entry[who]):>8} ({_shown(low)}..{_shown(high)})"  # type: ignore[arg-type, has-type] # the same

    print(f"{'':24} {'server':28} {'floor':28} {'of floor':>8}  wanted")
    row = None
    for entry in entries:
        if entry["row"] != row:
            row = entry["row"]
            print(row)
        ratio = f"{entry['of_floor']:.2f}" if entry["of_floor"] is not None else "-"
        wanted = f"{entry['wanted']:.2f}" if entry["wanted"] is not None else ""
        print(f"  {entry['figure']:22} {span(entry, 'server'):28} {span(entry, 'floor'):28} {ratio:>8}  {wanted:>6}")


def main() -> None:
    """Measure, print a table, write JSON if asked."""
    parser = argparse.ArgumentParser(description="The server on the wire beside the relay floor")
    parser.add_argument("--rounds", type=int, default=9, help="times each row is measured, server and floor in turn")
    parser.add_argument("--quick", action="store_true", help="3 short rounds")
    parser.add_argument("--only", action="append", metavar="NAME", help="only rows whose name holds this")
    parser.add_argument(
        "--against", metavar="PROGRAM", help="another rosbridge-sim in place of the floor, such as one of an old commit"
    )
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures here too")
    args = parser.parse_args()
    rows = [row for row in ROWS if not args.only or any(part in row.name for part in args.only)]
    if not rows:
        parser.error("no such row; there are: " + "; ".join(row.name for row in ROWS))
    rounds, seconds = (3, 0.2) if args.quick else (args.rounds, 0.4)
    entries = _summary(rows, _measure(rows, rounds, seconds, args.against))
    print(machine())
    print(f"median (lowest..highest) of {rounds} rounds")
    _print_table(entries)
    if args.json:
        args.json.write_text(json.dumps({"machine": machine(), "rounds": rounds, "figures": entries}, indent=1))


if __name__ == "__main__":
    main()

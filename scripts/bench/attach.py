"""Cost of a bridge: ticks of an attached simulator, compared with a simulator that serves by itself.

`serve`, and `attach` with our own server without a world as its bridge, run at the same time, pinned to one core. Ticks
are requested from them in turn (A B A B ...), one at a time. Each figure is the median of the rounds, with the lowest
and the highest; the ratio is the median of the rounds' ratios.

An attached simulator cannot know the subscribers behind the bridge, so it publishes everything. The second row is the
fair comparison: there the client of each subscribes to everything too.

    ./.venv/bin/python scripts/bench/attach.py [--rounds N] [--quick]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import orjson

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.bench.load import Socket, connect_many, masked, round_trips
from scripts.bench.program import SERVER, Program, attached, machine, running

MASTER = "bench"
PATIENT = ("--ping-interval", "none")  # our clients answer no pings and must stay connected
EGO = ("/Ego_topic",)

ANSWER = b'"service_response"'


class Master:
    """A master that ticks and subscribes to topics.

    It stays connected, so that the next one need not wait for its lease.
    """

    def __init__(self, place: Sequence[Program]) -> None:
        """Start synchronous mode.

        Args:
            place: the program that clients connect to, then the programs behind it.
        """
        self._place = place
        (self._socket,) = connect_many(place[0].port, 1)
        request = {"user_id": MASTER, "start_sync_mode": True, "time_step": 20}
        answer = _ask(self._socket, "/SyncModeCmd", {"request": request})
        assert answer["response"]["result"], f"no synchronous mode: {answer}"
        request = {"user_id": MASTER, "frame": 1}
        self._tick = {"op": "call_service", "service": "/SyncModeWaitForTick", "id": "t", "args": {"request": request}}

    def topics(self) -> list[str]:
        """Return the topics of the simulator.

        Returns:
            Their names.
        """
        found = _ask(self._socket, "/rosapi/topics", {})["topics"]
        assert isinstance(found, list)
        return [name for name in found if name not in {"/rosout", "/client_count", "/connected_clients"}]

    def measure(self, topics: Sequence[str], seconds: float) -> tuple[float, float]:
        """Measure ticks while the client subscribes to topics.

        Args:
            topics: their names.
            seconds: duration [s].

        Returns:
            Ticks a second, and CPU time of a tick in all processes [us].
        """
        for topic in topics:
            self._socket.tell(op="subscribe", topic=topic)
        frame = masked(orjson.dumps(self._tick))
        args = (self._socket, self._socket, frame, lambda payload: ANSWER in payload)
        round_trips(*args, seconds / 4)
        cpu = sum(program.cpu() for program in self._place)
        result = round_trips(*args, seconds)
        cpu = sum(program.cpu() for program in self._place) - cpu
        for topic in topics:
            self._socket.tell(op="unsubscribe", topic=topic)
        _ask(self._socket, "/rosapi/get_time", {})  # after this answer no message of these topics arrives
        return result.num / result.seconds, cpu / result.num * 1e6


def _ask(client: Socket, service: str, args: dict[str, object]) -> dict[str, dict[str, object]]:
    client.tell(op="call_service", service=service, id="ask", args=args)
    while ANSWER not in (payload := client.payload()):
        pass
    answer = orjson.loads(payload)
    assert answer["result"], answer
    values: dict[str, dict[str, object]] = answer["values"]
    return values


def _shown(values: Sequence[float]) -> str:
    return f"{median(values):8,.0f} ({min(values):,.0f}..{max(values):,.0f})"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="An attached simulator beside one that serves")
    parser.add_argument("--rounds", type=int, default=9, help="times each row is measured, in turn")
    parser.add_argument("--quick", action="store_true", help="3 short rounds")
    args = parser.parse_args()
    rounds, seconds = (3, 0.3) if args.quick else (args.rounds, 1.0)
    with ExitStack() as stack:
        server = stack.enter_context(running((*SERVER, *PATIENT, "--start", "sync")))
        bridge = stack.enter_context(running((*SERVER, *PATIENT, "--no-world")))
        simulator = stack.enter_context(attached(bridge, "--start", "sync", "--sync-lease", "600"))
        masters = Master([server]), Master([bridge, simulator])
        rows = {"a client listens to the ego": EGO, "a client listens to everything": masters[0].topics()}
        measured = {
            name: [[master.measure(topics, seconds) for master in masters] for _ in range(rounds)]
            for name, topics in rows.items()
        }
    print(machine())
    print(f"median (lowest..highest) of {rounds} rounds")
    for name, pairs in measured.items():
        print(name)
        for label, i in (("ticks a second", 0), ("CPU us of a tick", 1)):
            ours, theirs = [pair[1][i] for pair in pairs], [pair[0][i] for pair in pairs]
            ratio = median(a / b for a, b in zip(ours, theirs, strict=True))
            print(f"  {label:18} serve {_shown(theirs):28} attach {_shown(ours):28} attach / serve {ratio:.2f}")


if __name__ == "__main__":
    main()

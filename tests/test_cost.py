"""Fixed workloads call no more functions than they did; see `scripts/bench/guard.py`."""

from __future__ import annotations

import pytest

from scripts.bench import guard

HELD = {
    "publish 94 B": 36,
    "publish 0.7 kB Odometry": 37,
    "publish 0.9 kB ObjectStatusList": 37,
    "publish 0.9 kB ObjectStatusList as CBOR": 79,
    "publish 100 kB CompressedImage": 57,
    "publish 0.7 kB to 10 listeners": 172,
    "call of a client's service": 85,
    "call of the simulator's service": 1507,
    "tick": 173,
    "/sim/step of one frame": 281,
    "client that connects, subscribes and leaves": 145,
}
"""Calls of each workload; it may make ROOM times as many. Write lower figures with a change that saves calls."""

ROOM = 1.05


def test_calls_of_python_and_of_c_are_counted() -> None:
    def prepare() -> guard.Work:
        def work() -> None:
            sorted([abs(-1)])

        return work

    assert guard.count_calls(prepare) == 3  # work, abs and sorted


def test_warm_ups_are_the_same_number_on_a_slow_machine() -> None:
    times = []
    guard.count_calls(lambda: lambda: times.append(0.0))
    assert len(times) == guard.WARM_UPS + guard.REPEATS


def test_every_workload_has_a_figure() -> None:
    assert set(HELD) == set(guard.WORKLOADS)


@pytest.mark.parametrize("name", HELD)
def test_workload_makes_no_more_calls(name: str) -> None:
    num = guard.count_calls(guard.WORKLOADS[name])
    assert num <= ROOM * HELD[name], f"python scripts/bench/guard.py --only {name!r}"

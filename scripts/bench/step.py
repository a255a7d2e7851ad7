"""What one step of the world costs: microseconds, and vehicle-steps a second, beside a plain floor.

    python scripts/bench/step.py [--rounds N] [--sizes 10,100,1000,10000]

The floor is the least that a vectorised single track can be: five lines of numpy on whole arrays (Euler, no limits, no
gears, no pedals, no drag, nobody comes or goes). All cases take turns within one run, so that a busy machine troubles
all of them alike: compare the ratios. Cases:

    driven      egos in speed mode, all steering: the whole vehicle model
    mixed       egos, one in two with gaps between their rows, modes and pedals at random
    straight    agents with constant motion
    paths       agents on closed paths with a waypoint every half metre, at 5 to 15 m/s
    demo        1 ego, 10 cars on paths, 5 cars straight ahead, 2 walkers, 3 boxes (whatever the size asked for)
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.world.dynamics import command
from rosbridge_sim.world.geometry import FloatArray
from rosbridge_sim.world.state import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step

CAR = Body()
TARGET_SECONDS = 0.004  # for one turn of a case: long against the clock, short against the noise


def circle(radius: float) -> FloatArray:
    """Return waypoints half a metre apart."""
    angles = np.linspace(0.0, 2.0 * math.pi, int(4.0 * math.pi * radius), endpoint=False)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])


def floor(num: int) -> Callable[[], None]:
    """Return the plain step."""
    rng = np.random.default_rng(0)
    x, y, yaw, speed = np.zeros((4, num))
    accel, steer = rng.uniform(0.0, 0.01, num), rng.uniform(-0.3, 0.3, num)

    def move() -> None:
        nonlocal x, y, yaw, speed
        x = x + speed * np.cos(yaw) * DT
        y = y + speed * np.sin(yaw) * DT
        yaw = yaw + speed * np.tan(steer) / CAR.wheelbase * DT
        speed = speed + accel * DT

    return move


def driven(num: int) -> World:
    """See the head of this file."""
    world, rng = World(), np.random.default_rng(0)
    for i in range(num):
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=float(i), y=0.0))
        command(world, row, mode=Mode.SPEED, speed=rng.uniform(5.0, 15.0), steer=rng.uniform(-0.3, 0.3))
    return world


def mixed(num: int) -> World:
    """See the head of this file."""
    world, rng = World(), np.random.default_rng(0)
    for i in range(num):
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=float(i), y=0.0))
        wishes = dict(zip(("steer", "throttle", "brake", "speed", "accel"), rng.uniform(0.0, 0.5, 5), strict=True))
        command(world, row, mode=Mode(int(rng.integers(1, 4))), **wishes)
        world.spawn(Kind.OBSTACLE, CAR, name="between", x=float(i), y=5.0)
    return world


def straight(num: int) -> World:
    """See the head of this file."""
    world, rng = World(), np.random.default_rng(0)
    for i in range(num):
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=float(i), y=0.0, yaw=rng.uniform(-3.0, 3.0), speed=10.0)
    return world


def paths(num: int) -> World:
    """See the head of this file."""
    world, rng = World(), np.random.default_rng(0)
    path = circle(50.0)
    for _ in range(num):
        x, y = path[rng.integers(len(path))]
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=x, y=y, path=path, is_loop=True, speed=rng.uniform(5.0, 15.0))
    return world


def demo(_: int) -> World:
    """See the head of this file."""
    world = driven(1)
    for i in range(10):
        world.spawn(Kind.VEHICLE, CAR, name="n", x=50.0, y=0.0, path=circle(50.0 + i), is_loop=True, speed=8.0 + i)
    for i in range(5):
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=4.0 * i, speed=10.0 + i)
    for i in range(2):
        world.spawn(Kind.PEDESTRIAN, CAR, name="man", x=9.0, y=0.0, path=circle(9.0 + i), is_loop=True, speed=1.4)
    for i in range(3):
        world.spawn(Kind.OBSTACLE, CAR, name="box", x=5.0, y=float(i))
    return world


def stepper(world: World) -> Callable[[], None]:
    """Return a call that steps a world."""
    return lambda: step(world)


def measure(cases: dict[str, Callable[[], None]], rounds: int) -> dict[str, FloatArray]:
    """Return the microseconds a call of each case took in each round."""
    times: dict[str, list[float]] = {name: [] for name in cases}
    counts = {}
    for name, call in cases.items():
        call()
        start = time.perf_counter()
        call()
        counts[name] = max(1, int(TARGET_SECONDS / (time.perf_counter() - start)))
    for _ in range(rounds):
        for name, call in cases.items():
            start = time.perf_counter()
            for _ in range(counts[name]):
                call()
            times[name].append((time.perf_counter() - start) / counts[name] * 1e6)
    return {name: np.array(values) for name, values in times.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="cost of one step of the world")
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--sizes", default="10,100,1000,10000")
    arguments = parser.parse_args()
    print(f"{'case':10}{'n':>7}{'p50 us':>10}{'p99 us':>10}{'best us':>10}{'million/s':>11}{'x floor':>9}")
    for num in map(int, arguments.sizes.split(",")):
        makers = {"driven": driven, "mixed": mixed, "straight": straight, "paths": paths, "demo": demo}
        cases = {"floor": floor(num)} | {name: stepper(make(num)) for name, make in makers.items()}
        times = measure(cases, arguments.rounds)
        base = np.median(times["floor"])
        for name, values in times.items():
            count = 21 if name == "demo" else num
            p50, p99 = np.percentile(values, [50, 99])
            figures = f"{p50:>10.1f}{p99:>10.1f}{values.min():>10.1f}{count / p50:>11.2f}{p50 / base:>9.2f}"
            print(f"{name:10}{count:>7}{figures}")


if __name__ == "__main__":
    main()

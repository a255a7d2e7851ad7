"""Cost of collision detection: microseconds of a step with it and without it.

    python scripts/bench/contacts.py [--rounds N]

Both kinds of step take turns in the same world, so that a busy machine affects both equally. Cases:

    quiet       1 ego and 20 objects, 20 m or more from each other
    queue       the same 8 m apart in a line
    fast        1 ego and 20 objects, 20 m apart, at 250 km/h
    town        1,000 cars on the lanes of a grid of roads
    city        10,000 of them
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.world.followers.lane_following import drive_lanes
from rosbridge_sim.world.followers.path_following import follow_paths
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from rosbridge_sim.world.vehicle.dynamics import drive
from scripts.bench.reference import reference_line

CAR = Body()


def line(gap: float, speed: float) -> World:
    """Return an ego with fifteen cars in front of it, and five cones beside the road.

    Args:
        gap: between cars [m].
        speed: of all [m/s].

    Returns:
        The world.
    """
    world = World()
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, speed=speed))
    command(world, row, mode=Mode.SPEED, speed=speed, steer=0.0)
    for i in range(1, 16):
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=gap * i, y=0.0, speed=speed)
    for i in range(5):
        world.spawn(Kind.OBSTACLE, Body.box(0.4, 0.4, 0.7), name="cone", x=gap * i, y=-gap)
    return world


def streets(num: int) -> World:
    """Return cars 30 m apart on 80 lanes, half of them to the east and half to the north, each at its own speed.

    Args:
        num: number of cars.

    Returns:
        The world.
    """
    world, rng = World(), np.random.default_rng(0)
    world.spawn(Kind.EGO, CAR, name="ego", x=-50.0, y=-50.0)
    for i in range(num):
        lane = i % 80
        along, across = (i // 80) * 30.0 + rng.uniform(0.0, 10.0), (lane // 4) * 200.0 + 3.5 * (lane % 4)
        x, y, yaw = (along, across, 0.0) if lane % 2 else (across, along, math.pi / 2)
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=x, y=y, yaw=yaw, speed=rng.uniform(12.0, 16.0))
    return world


def without(world: World) -> None:
    """Step a world as `step` does, without collision detection.

    Args:
        world: is moved.
    """
    world.signals.advance(world.frame + 1)
    drive_lanes(world, DT)
    follow_paths(world, DT)
    drive(world, DT)
    world.frame += 1


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="cost of contacts")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    print(reference_line())
    cases = {
        "quiet": (line(20.0, 14.0), 500),
        "queue": (line(8.0, 14.0), 500),
        "fast": (line(20.0, 250.0 / 3.6), 500),
        "town": (streets(1_000), 100),
        "city": (streets(10_000), 50),
    }
    print(f"{'case':10}{'without us':>12}{'with us':>10}{'adds us':>10}{'least us':>10}")
    for name, (world, num) in cases.items():
        start = world.snapshot()
        times: list[list[float]] = []
        for _ in range(arguments.rounds):
            times.append([])
            for move in (without, step):
                world.restore(start)
                move(world)
                begun = time.perf_counter()
                for _ in range(num):
                    move(world)
                times[-1].append((time.perf_counter() - begun) / num * 1e6)
        bare, whole = np.median(times, axis=0)
        least = np.min(times, axis=0)
        print(f"{name:10}{bare:>12.1f}{whole:>10.1f}{whole - bare:>10.1f}{least[1] - least[0]:>10.1f}")


if __name__ == "__main__":
    main()

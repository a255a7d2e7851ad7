"""Cost of one step of the world: microseconds, and vehicle-steps a second, compared with a lower bound.

    python scripts/bench/step.py [--rounds N] [--sizes 10,100,1000,10000] [--cases town,demo]
    python scripts/bench/step.py --against CHECKOUT [--pairs N] [--sizes 1,20,100] [--cases town]

The floor is the smallest vectorised single-track model: five lines of numpy on whole arrays (Euler, no limits, gears,
pedals or drag, a fixed population). All cases take turns within one run, so that a busy machine affects all of them
equally: compare the ratios. Cases:

    driven      egos in speed mode, all steering, far from each other: the whole kinematic model
    tyres       the same egos in the single track model
    mixed       egos, one in two with gaps between their rows, modes and pedals at random
    straight    agents with constant motion
    paths       agents on closed paths with a waypoint every half metre, at 5 to 15 m/s
    town        drivers in copies of the built-in town, 250 in each, and an ego: lanes, lights, traffic
    demo        1 ego, 10 cars on paths, 5 cars straight ahead, 2 walkers, 3 boxes (whatever the size asked for)

With the extra `[fast]`, or a compiler in ROSBRIDGE_SIM_CC, compiled loops drive the vehicles on lanes; `none` there
gives the figures of arrays.
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

from scripts.bench import in_turn
from scripts.bench.reference import reference_line

# isort: split
from rosbridge_sim.records import replace
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Body, Dynamics, Kind, Mode, World
from rosbridge_sim.world.step import step

CAR = Body()
CARS_IN_TOWN = 250  # one on 49 m of lanes: busy, not jammed
TOWN_SIZE = 700.0  # from one copy to the next [m]
APART = 100.0  # between egos that drive in circles of at most 27 m of radius [m]
_SECOND = round(1.0 / DT)  # in frames
TARGET_SECONDS = 0.004  # of one turn of a case: long for the clock, short for the noise


def circle(radius: float) -> FloatArray:
    """Return waypoints half a metre apart.

    Args:
        radius: [m].

    Returns:
        (m, 2) points [m].
    """
    angles = np.linspace(0.0, 2.0 * math.pi, int(4.0 * math.pi * radius), endpoint=False)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])


def floor(num: int) -> Callable[[], None]:
    """Return the step of the floor.

    Args:
        num: number of vehicles.

    Returns:
        A function that moves them by one step.
    """
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


def driven(num: int, dynamics: Dynamics = Dynamics.KINEMATIC) -> World:
    """See the head of this file."""
    world, rng = World(0, dynamics), np.random.default_rng(0)
    for i in range(num):
        # Far from each other, because pairs that may touch would cost more than the motion.
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=APART * (i % 100), y=APART * (i // 100)))
        steer = rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.3)
        command(world, row, mode=Mode.SPEED, speed=rng.uniform(5.0, 15.0), steer=steer)
    return world


def tyres(num: int) -> World:
    """See the head of this file."""
    return driven(num, Dynamics.SINGLE_TRACK)


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


def town(num: int) -> World:
    """See the head of this file."""
    world, rng = World(), np.random.default_rng(0)
    world.lay_roads(*towns(-(-num // CARS_IN_TOWN)))
    roads = world.roads
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=-5.25)
    wait_point = roads.derived(LaneConflicts).wait_point
    places = [(i, s) for i in np.flatnonzero(np.isinf(wait_point)) for s in np.arange(6.0, roads.length[i] - 6.0, 14.0)]
    rng.shuffle(places)
    for lane, s in places[:num]:
        uid = world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=0.0, speed=5.0)
        keep_lanes(world, [LaneStart(world.row(uid), int(lane), float(s))])
    for _ in range(1000):  # until some stand at lights and others move
        step(world)
    return world


def towns(copies: int) -> tuple[Roads, SignalPlan]:
    """Return copies of the built-in town, side by side.

    Args:
        copies: number of copies.

    Returns:
        The roads and the signal plan.
    """
    one = DiskLibrary().map("town")
    assert one.plan is not None
    roads, plan, size = one.roads, one.plan, len(one.roads)
    parts = range(copies)
    lines = [roads.points[roads.first[i] : roads.first[i + 1]] for i in range(size)]
    many = Roads(
        [f"{k}.{name}" for k in parts for name in roads.ids],
        [np.add(line, (k % 8 * TOWN_SIZE, k // 8 * TOWN_SIZE, 0.0)) for k in parts for line in lines],
        [[int(other) + k * size for other in roads.successors(i)] for k in parts for i in range(size)],
        roads.width.tolist() * copies,
        roads.speed_limit.tolist() * copies,
        left=[other + k * size if other >= 0 else -1 for k in parts for other in roads.left.tolist()],
        right=[other + k * size if other >= 0 else -1 for k in parts for other in roads.right.tolist()],
        is_stop=roads.is_stop.tolist() * copies,
    )
    lights = [
        replace(light, name=f"{k}.{light.name}", lanes=tuple(lane + k * size for lane in light.lanes))
        for k in parts
        for light in plan.lights
    ]
    controllers = [
        replace(
            controller,
            name=f"{k}.{controller.name}",
            groups=tuple(tuple(row + k * len(plan.lights) for row in group) for group in controller.groups),
        )
        for k in parts
        for controller in plan.controllers
    ]
    return many, SignalPlan(many, lights, controllers, passes=plan.pass_of_lane.tolist() * copies)


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


def stepper(world: World) -> tuple[Callable[[], None], int]:
    """Return a function that steps a world, and its number of steps.

    Args:
        world: with drivers, the function steps for a second, in which each of them looks at the lanes beside it.

    Returns:
        The function and the number.
    """
    if not world.has_lane.any():
        return lambda: step(world), 1

    def for_a_second() -> None:
        for _ in range(_SECOND):
            step(world)

    return for_a_second, _SECOND


def measure(cases: dict[str, tuple[Callable[[], None], int]], rounds: int) -> dict[str, FloatArray]:
    """Measure all cases in turn.

    Args:
        cases: name -> a function and its number of steps.
        rounds: measurements of each case.

    Returns:
        Name -> (rounds,) microseconds of a step.
    """
    times: dict[str, list[float]] = {name: [] for name in cases}
    counts = {}
    for name, (call, _) in cases.items():
        call()
        start = time.perf_counter()
        call()
        counts[name] = max(1, int(TARGET_SECONDS / (time.perf_counter() - start)))
    for _ in range(rounds):
        for name, (call, steps) in cases.items():
            start = time.perf_counter()
            for _ in range(counts[name]):
                call()
            times[name].append((time.perf_counter() - start) / counts[name] / steps * 1e6)
    return {name: np.array(values) for name, values in times.items()}


MAKERS: dict[str, Callable[[int], World]] = {
    "driven": driven,
    "tyres": tyres,
    "mixed": mixed,
    "straight": straight,
    "paths": paths,
    "town": town,
    "demo": demo,
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="cost of one step of the world")
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--sizes", default="10,100,1000,10000")
    parser.add_argument("--cases", default=",".join(MAKERS), help="[%(default)s]")
    arguments = in_turn.parse(parser)
    driven_by = in_turn.wait_for_kernels()
    sizes, names = [int(num) for num in arguments.sizes.split(",")], arguments.cases.split(",")
    if in_turn.run(
        arguments,
        {f"{name}, {num}": lambda name=name, num=num: stepper(MAKERS[name](num)) for name in names for num in sizes},  # type: ignore[misc]
        "step",
    ):
        return
    print(reference_line())
    print(f"vehicles on lanes: {driven_by}")
    print(f"{'case':10}{'n':>7}{'p50 us':>10}{'p99 us':>10}{'best us':>10}{'million/s':>11}{'x floor':>9}")
    for num in sizes:
        cases = {"floor": (floor(num), 1)} | {name: stepper(MAKERS[name](num)) for name in names}
        times = measure(cases, arguments.rounds)
        base = np.median(times["floor"])
        for name, values in times.items():
            count = 21 if name == "demo" else num
            p50, p99 = np.percentile(values, [50, 99])
            figures = f"{p50:>10.1f}{p99:>10.1f}{values.min():>10.1f}{count / p50:>11.2f}{p50 / base:>9.2f}"
            print(f"{name:10}{count:>7}{figures}")


if __name__ == "__main__":
    main()

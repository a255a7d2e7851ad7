"""Loops in C and arrays decide the same from any state: claims, holds, speeds and changes of lanes at random."""

from __future__ import annotations

from collections.abc import Callable
from cProfile import Profile
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.followers.lane_following import view_driver
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Body, Gear, Kind, World
from tests.world.kernels.compiled_loops import needs_compiler
from tests.world.kernels.test_lane_kernel import check_both
from tests.world.lane_drives import BUS
from tests.world.road_factory import CAR, arc, crossing, line
from tests.world.wide_roads import wide_road as beside

pytestmark = needs_compiler

BODIES = (CAR, CAR, BUS, Body(2.6, 1.5, 1.5, wheelbase=1.8, front_overhang=0.4, rear_overhang=0.4))

Lanes = dict[str, tuple[FloatArray, str]]
"""By name: the line, and the names of the successors with a blank between them; a name with `!` has a stop line."""


def short_crossing() -> Lanes:
    """Lanes shorter than a car's nose: drivers hold lanes that their axles have not reached, and cross themselves."""
    lanes: Lanes = {}
    for name, across in (("w", (0.0, 1.0)), ("s", (1.0, 0.0)), ("v", (0.6, 0.8))):
        places = [-40, -14, -12, -9, -4, -1, 2, 5, 30]
        for i, (start, end) in enumerate(pairwise(places)):
            corners = [(place * across[1], place * across[0]) for place in (start, end)]
            lanes[f"{name}{i}"] = line(*corners), f"{name}{(i + 1) % 8}" + (" s5 v5" if i == 4 else "")
    return lanes


def tight_bends() -> Lanes:
    """Both directions of a road with a tight bend: cars pass each other there, buses do not."""

    def way(radius: float) -> FloatArray:
        return np.concatenate([line((-9, radius)), arc(0, 0, radius, 90, -90), line((radius, -9))])

    # One after the other they would be no rivals: lanes are between them.
    return {
        "in": (way(9.0), "in+"),
        "in+": (line((9, -9), (9, -25)), "out-"),
        "out-": (line((30, -25), (12.5, -9)), "out"),
        "out": (way(12.5)[::-1], "out+"),
        "out+": (line((-9, 12.5), (-25, 12.5)), "in-"),
        "in-": (line((-25, 0), (-9, 9)), "in"),
    }


def roundabout() -> Lanes:
    """Eight short lanes in a circle; each other one has a way in, and one out."""
    lanes: Lanes = {}
    for i in range(8):
        lanes[f"r{i}"] = arc(0, 0, 9.0, 45.0 * i, 45.0), f"r{(i + 1) % 8}" + (f" o{i}" if i % 2 else "")
        end = np.radians(45.0 * (i + i % 2))
        x, y = 9.0 * float(np.cos(end)), 9.0 * float(np.sin(end))
        if i % 2:
            lanes[f"o{i}"] = line((x, y), (3.0 * x + 4.0 * y / 9.0, 3.0 * y - 4.0 * x / 9.0)), f"i{(i + 1) % 8}!"
        else:
            lanes[f"i{i}!"] = line((3.0 * x, 3.0 * y), (x, y)), f"r{i}"
    return lanes


def merging() -> Lanes:
    """Three roads become one, which one of them has a stop line for; then a way back."""
    return {
        "m1": (line((-50, 0), (-12, 0)), "n1"),
        "n1": (line((-12, 0), (0, 0)), "p"),
        "m2!": (line((-50, 20), (-12, 6)), "n2"),
        "n2": (line((-12, 6), (-6, 2), (0, 0)), "p"),
        "m3": (line((-12, -40), (-12, -10)), "n3"),
        "n3": (line((-12, -10), (-8, -2), (0, 0)), "p"),
        "p": (line((0, 0), (7, 0)), "q"),
        "q": (line((7, 0), (40, 0)), "m1 m2! m3"),
    }


def wide_road() -> Lanes:
    """Three lanes side by side in short pieces; the left one ends, the right one has two ways in."""
    lanes: Lanes = {}
    for k, name in enumerate("abc"):
        for i in range(9 if name != "a" else 6):
            onward = f"{name}{(i + 1) % 9}" if name != "a" or i < 5 else ""
            lanes[f"{name}{i}"] = line((8 * i, -3.5 * k), (8 * i + 8, -3.5 * k)), onward
    lanes["d0"] = line((-30, -20), (-7, -7), (0, -7)), "c0"
    lanes["d1"] = line((-30, -7), (0, -7)), "c0"
    return lanes


def hairpin() -> Lanes:
    """A turn so narrow that a long vehicle is still on a rival of the lane that it asks for."""
    return {
        "h": (line((-30, 0), (0, 0)), "h0"),
        "h0": (line((0, 0), (6, 0)), "h1"),
        "h1": (line((6, 0), (6, 2)), "h2"),
        "h2": (line((6, 2), (0, 2)), "h3"),
        "h3": (line((0, 2), (-30, 12)), "h"),
    }


PARTS = (short_crossing, tight_bends, roundabout, merging, wide_road)


@cache
def lay_out(*parts: Callable[[], Lanes]) -> Roads:
    """All of these, a kilometre from one another."""
    every: Lanes = {}
    for at, part in enumerate(parts):
        every |= {name: (np.add(points, (1000.0 * at, 0.0, 0.0)), onward) for name, (points, onward) in part().items()}
    names = list(every)
    left = [
        names.index(to) if (to := {"b": "a", "c": "b"}.get(name[0], "") + name[1:]) in every else -1 for name in names
    ]
    right = [left.index(row) if row in left else -1 for row in range(len(names))]
    return Roads(
        names,
        [points for points, _ in every.values()],
        [[names.index(name) for name in onward.split()] for _, onward in every.values()],
        [3.5] * len(names),
        [15.0] * len(names),
        left=left,
        right=right,
        is_stop=[name.endswith("!") for name in names],
    )


def any_state(roads: Roads, seed: int, num: int) -> World:
    """Drivers anywhere in any state: what no drive of a minute would meet."""
    world, rng = World(seed), np.random.default_rng(seed)
    world.lay_roads(roads)
    world.frame = 1000 + 25 * (seed % 4)
    part = np.rint(roads.points[roads.first[:-1], 0] / 1000.0)
    starts = []
    for _ in range(num):
        speed = max(float(rng.uniform(-6.0, 9.0)), 0.0)
        body = BODIES[rng.integers(0, 4)]
        row = world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=speed))
        lane = int(rng.choice((part == rng.integers(0, part[-1] + 1)).nonzero()[0]))
        desired = float(rng.choice([np.inf, 0.0, 5.0], p=[0.8, 0.1, 0.1]))
        to_end = rng.uniform(0.0, min(roads.length[lane], rng.choice([0.6, 8.0, np.inf])))
        starts.append(LaneStart(row, lane, float(roads.length[lane] - to_end), desired_speed=desired))
    keep_lanes(world, starts)
    for row in range(world.n):
        ahead = world.int_block("lane", "ahead_5")[:, row]
        some = [-1, *ahead[ahead >= 0][:4].tolist()]
        world.claim[row], world.held[row], world.exit_lane[row] = rng.choice(some, 3)
        if rng.random() < 0.4:
            world.claim[row] = -1
        if rng.random() < 0.3:  # the last lane under the nose
            ends = np.cumsum(roads.length[ahead[ahead >= 0]])
            under = np.searchsorted(ends, world.arc[row] + world.half_length[row] + world.centre[row], side="right")
            world.held[row] = ahead[min(int(under), len(ends) - 1)]
        world.change[row], world.came_from[row] = rng.integers(0, 6), rng.integers(0, 3)
        world.signal[row] = rng.integers(1, 3) if world.change[row] else 0
        world.change_since[row] = world.frame - rng.choice([0, 80, 350, 420, 800])
    for lane in rng.integers(0, len(roads), 2 + num // 20).tolist():  # vehicles that follow no lanes
        place, yaw = roads.at(np.array([lane]), np.array([0.5 * roads.length[lane]]))
        x, y, z = place[0]
        body, speed = BODIES[rng.integers(1, 3)], float(rng.choice([0.0, 4.0]))
        world.spawn(Kind.EGO, body, name="ego", x=x, y=y, z=z, yaw=yaw[0], speed=speed, gear=Gear.NEUTRAL)
    return world


def any_crowd(roads: Roads, seed: int, num: int) -> World:
    """Nearly all ask, for a few lanes, and many hold some: only bytes from outside hold such a state."""
    world, rng = any_state(roads, seed, num), np.random.default_rng(seed)
    rows, conflicts = world.has_lane.nonzero()[0], roads.derived(LaneConflicts)
    has_rivals = np.isfinite(conflicts.wait_point)
    lane = rng.choice(has_rivals.nonzero()[0], 1)
    busy = np.append(conflicts.rivals.other[conflicts.rivals.of(lane)[1]], lane)
    ahead = world.int_block("lane", "ahead_5")
    ahead[1:, rows] = rng.choice(busy, (5, len(rows)))
    # Who follows one that has a claim asks, too; nobody waits for these lanes.
    world.claim[rows], world.exit_lane[rows] = rng.choice((~has_rivals).nonzero()[0], len(rows)), -1
    world.held[rows] = np.where(rng.random(len(rows)) < 0.6, ahead[rng.integers(0, 6, len(rows)), rows], -1)
    return world


@pytest.mark.parametrize(("num", "seeds"), [(30, range(4)), (200, range(1)), (30, range(4, 40)), (200, range(1, 15))])
def test_crowds_before_one_crossing_decide_the_same(num: int, seeds: range) -> None:
    for seed in seeds:
        one, other = (any_crowd(lay_out(*PARTS), seed, num) for _ in range(2))
        check_both(one, other, 6)


def jam_on_one_lane(num: int) -> World:
    """All are on one lane of a crossing, which they hold; half of them ask for the lane that crosses it."""
    world, roads = World(), crossing()
    world.lay_roads(roads)
    own, other = roads.row("we"), roads.row("sn")
    starts = []
    for i in range(num):
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=10.0))
        starts.append(LaneStart(row, own, 0.5 + 2.0 * (i % 2) + 0.5 * i / num))
    keep_lanes(world, starts)
    world.held[:num], world.claim[:num], world.int_block("ahead_2", "ahead_5")[:, :num] = own, roads.row("e"), -1
    world.int_block("ahead_1", "ahead_1")[0, :num] = np.where(np.arange(num) % 2, other, own)
    return world


def test_thousands_on_one_lane_that_wait_for_one_another_decide_the_same() -> None:
    """Each compared with each one, for each one, the loops took 15 s for one decision."""
    one, other = (jam_on_one_lane(2000) for _ in range(2))
    check_both(one, other, 1)


def test_decision_of_a_crowd_calls_no_more_functions_than_that_of_some() -> None:
    """Arrays grow with the number of drivers, and nothing is done driver by driver."""

    def count(num: int) -> int:
        world, profile = jam_on_one_lane(num), Profile()
        view_driver(world, 0)
        profile.runcall(view_driver, world, 0)
        return sum(each.callcount for each in profile.getstats())

    assert count(120) == count(30)


def check_states(roads: Roads, num: int, seeds: range) -> None:
    for seed in seeds:
        one, other = (any_state(roads, seed, num) for _ in range(2))
        check_both(one, other, 6)


@pytest.mark.parametrize(
    ("num", "seeds"), [(15, range(4)), (40, range(5)), (90, range(3)), (40, range(5, 8)), (90, range(3, 8))]
)
def test_decisions_are_the_same_from_any_state(num: int, seeds: range) -> None:
    check_states(lay_out(*PARTS), num, seeds)


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("seeds", [range(4), range(4, 16)])
def test_decisions_of_few_are_the_same_from_any_state(seeds: range, part: Callable[[], Lanes]) -> None:
    check_states(lay_out(part), 5, seeds)


@pytest.mark.parametrize("seed", [177, 290, 335])  # of 400, those in which it matters
def test_driver_on_a_rival_of_the_lane_that_it_asks_for_gets_the_same(seed: int) -> None:
    check_states(lay_out(hairpin), 4, range(seed, seed + 1))


def overtaking(num: int) -> World:
    """Pairs on the right one of two lanes: one drives up to the other, and has signalled to the left for long."""
    world, rng = World(), np.random.default_rng(0)
    world.lay_roads(beside(2, (120.0 * num,)))
    world.frame = 1000
    starts = []
    for i in range(num):
        at = 50.0 + 110.0 * i
        for place, speed in ((at, rng.uniform(5.0, 14.0)), (at + rng.uniform(6.0, 30.0), rng.uniform(0.6, 6.0))):
            row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=float(speed)))
            starts.append(LaneStart(row, 1, float(place), desired_speed=30.0 if place == at else float(speed)))
    keep_lanes(world, starts)
    world.change[::2], world.signal[::2], world.change_since[::2] = 1, 1, 800
    return world


def test_drivers_behind_one_that_moves_begin_the_same_changes() -> None:
    one, other = (overtaking(40) for _ in range(2))
    check_both(one, other, 3)
    num_begun = np.count_nonzero(one.leaving[::2])
    assert 5 <= num_begun <= 35  # the others are too near to the one ahead
    check_both(one, other, 30)


@pytest.mark.parametrize("num", [5, 12, 30])
@pytest.mark.parametrize("parts", [PARTS, *((part,) for part in PARTS)])
def test_decisions_are_the_same_from_many_states(parts: tuple[Callable[[], Lanes], ...], num: int) -> None:
    check_states(lay_out(*parts), num * len(parts), range(100, 120))

"""Loops in C watch the pairs that arrays watch, and find the same contacts: of few and many boxes, wide ones, heaps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.contacts import collisions
from rosbridge_sim.world.contacts.collisions import LIFE, MAX_PAIRWISE, CollisionDetector
from rosbridge_sim.world.geometry.planar import FloatArray, wrap_angle
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.many_worlds.world_set import WorldSet
from rosbridge_sim.world.state.world import Kind, World
from rosbridge_sim.world.step import step
from tests.world.contacts.test_collisions import crowd
from tests.world.kernels.compiled_loops import needs_compiler, with_loops
from tests.world.road_factory import CAR

pytestmark = needs_compiler

Place = tuple[FloatArray, FloatArray]
"""Of a step: where x, y and yaw are as it begins and as it ends, (3, n) each [m, rad]."""


def watch(world: World, place: Place, *, by_loops: bool) -> CollisionDetector:
    """Move all entities within a step, and return the detector that has found the contacts."""
    num, now = place[0].shape[1], world.block("x", "yaw")
    with with_loops(are_there=by_loops):
        now[:, :num] = place[0]
        detector = collisions.remember(world)
        now[:, :num] = place[1]
        return collisions.find(world, detector)


def check_both(one: World, other: World, places: list[Place]) -> int:
    """Both find the same contacts, and keep the same lists; return how many contacts there were."""
    num_contacts = 0
    for place in places:
        first, second = watch(one, place, by_loops=False), watch(other, place, by_loops=True)
        assert one.contacts.tolist() == other.contacts.tolist()
        assert first._life == second._life
        assert first._pairs.tolist() == second._pairs.tolist()
        num_contacts += len(one.contacts)
    return num_contacts


def wild(world: World, num_steps: int, seed: int) -> list[Place]:
    """Places of entities that drive, turn past west, stand for a while, and jump now and then."""
    rng, now = np.random.default_rng(seed), world.block("x", "yaw")[:, : world.n].copy()
    speed, turn = rng.uniform(0.0, 0.6, world.n), rng.choice([0.0, 0.005, 0.02], world.n)
    speed *= world.kind[: world.n] < Kind.OBSTACLE
    places = []
    for k in range(num_steps):
        before = now.copy()
        if k % 20 == 19:
            before[0, k % world.n] += rng.uniform(-3.0, 3.0)
        now = before.copy()
        if k % 30 < 25:
            now[0] += speed * np.cos(before[2])
            now[1] += speed * np.sin(before[2])
            now[2] = wrap_angle(before[2] + turn)
        places.append((before, now))
    return places


@pytest.mark.parametrize(("num", "size"), [(2, 3.0), (9, 12.0), (MAX_PAIRWISE, 80.0), (MAX_PAIRWISE + 1, 80.0)])
@pytest.mark.parametrize("seed", range(2))
def test_loops_find_the_contacts_of_arrays(num: int, size: float, seed: int) -> None:
    one, other = (crowd(seed, num, size) for _ in range(2))
    assert check_both(one, other, wild(one, 2 * LIFE + 5, seed)) > 0


def test_boxes_of_many_worlds_touch_those_of_their_own_alone() -> None:
    sizes = [(2, 3.0), (20, 15.0), (1, 3.0), (60, 60.0), (9, 12.0)]
    one, other = ([OneOfMany(seed) for seed in range(len(sizes))] for _ in range(2))
    for worlds in (one, other):
        for world, (num, size) in zip(worlds, sizes, strict=True):
            crowd(world.seed, num, size, world)
    sets, num_contacts = [WorldSet(worlds) for worlds in (one, other)], 0
    for frame in range(4 * LIFE):
        for together, are_there in zip(sets, (False, True), strict=True):
            with with_loops(are_there=are_there):
                together.advance()
        assert [world.contacts.tolist() for world in one] == [world.contacts.tolist() for world in other], frame
        num_contacts += sum(len(world.contacts) for world in one)
        for worlds in (one, other):
            if frame % 9 == 5:  # one of them has a body more, and another one starts
                worlds[frame % 5].spawn(Kind.OBSTACLE, CAR, name="box", x=float(frame), y=0.0)
                worlds[3].speed[frame % 7] = 9.0
                worlds[3].touch()
    assert num_contacts > 0


@pytest.mark.parametrize("seed", range(3))
def test_pairs_of_many_boxes_come_from_cells(seed: int) -> None:
    """With boxes of 60 m among them, west and east of the origin and across it."""
    one, other = (crowd(seed, 200, 150.0) for _ in range(2))
    assert check_both(one, other, wild(one, LIFE + 4, seed)) > 0


def test_cars_that_pass_closely_touch_when_arrays_say_so() -> None:
    """Pairs that are near for a long time, and use up their gaps by a few centimetres now and then."""
    rng, worlds = np.random.default_rng(5), (World(), World())
    for world in worlds:
        for i in range(6):
            world.spawn(Kind.VEHICLE, CAR, name="x", x=6.0 * (i % 3), y=2.1 * (i // 3), yaw=math.pi)
    home, places = worlds[0].block("x", "yaw")[:, :6].copy(), []
    reach, now = rng.uniform(-0.15, 0.15, (3, 6)), home
    for k in range(300):
        before, now = now, home + reach * np.sin([[0.05 * k], [0.031 * k], [0.02 * k]])
        now[2] = wrap_angle(now[2])
        places.append((before, now))
    assert 0 < check_both(*worlds, places) < 6 * len(places)


@pytest.mark.parametrize(
    ("between", "within", "turn"),
    [(0.09, -0.09, 0.0), (0.0, 0.06, 0.0), (0.0, 0.0, 0.04), (0.0, 0.0, math.pi), (0.0, 0.0, 0.0)],
)
@pytest.mark.parametrize("row", [0, 1])
def test_pair_that_uses_up_its_gap_in_one_step_touches(between: float, within: float, turn: float, row: int) -> None:
    """Two cars side by side, 5 cm apart: one is aside only as a step begins, or as it ends, or turns."""
    worlds, side = (World(), World()), (1.0, -1.0)[row]
    for world in worlds:
        for y in (0.0, CAR.width + 0.05):
            world.spawn(Kind.VEHICLE, CAR, name="x", x=0.0, y=y)
    still = worlds[0].block("x", "yaw")[:, :2].copy()
    before = still.copy()
    before[1, row] += side * between
    after = before.copy()
    after[1, row] += side * within
    after[2, row] += side * turn
    assert check_both(*worlds, [(still, still)] * 3) == 0
    assert check_both(*worlds, [(before, after)]) == (between + abs(within) + turn > 0.0)


@pytest.mark.parametrize("num", [300, 400])
def test_heap_is_left_to_arrays(num: int) -> None:
    """A heap has more near pairs than are looked at, or more in its cells than are compared; arrays choose which."""
    one, other = (World() for _ in range(2))
    told: list[World] = []
    for world in (one, other):
        world.on_heap = lambda world=world: told.append(world)
        for i in range(num):
            x, y = 0.01 * (i % 20), 0.01 * (i // 20)
            world.spawn(Kind.EGO if i < 3 else Kind.VEHICLE, CAR, name="x", x=x, y=y)
    still = one.block("x", "yaw")[:, :num].copy()
    assert check_both(one, other, [(still, still)] * 3) > 0
    assert told.count(one) == told.count(other) > 0


def test_place_that_is_far_away_is_left_to_arrays() -> None:
    one, other = (crowd(1, MAX_PAIRWISE + 8, 20.0) for _ in range(2))
    place = one.block("x", "yaw")[:, : one.n].copy()
    place[0, 3] = 1e14
    check_both(one, other, [(place, place)] * 2)


def test_loops_come_and_go_with_the_next_list() -> None:
    one, other = (crowd(2, 40, 25.0) for _ in range(2))
    for k in range(8 * LIFE):
        step(one)
        with with_loops(are_there=k // 11 % 2 == 1):
            step(other)
        assert one.contacts.tolist() == other.contacts.tolist()
    assert one.digest() == other.digest()

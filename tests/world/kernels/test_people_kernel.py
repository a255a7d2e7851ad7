"""Loops in C give the bits of arrays for people: on roads, in crowds, around corners, in one world and in many."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.people.people import COMMITTED, People
from rosbridge_sim.world.state.world import World
from rosbridge_sim.world.step import step
from rosbridge_sim.worlds.worlds import Worlds
from tests.world.kernels.compiled_loops import make_people_kernel, needs_compiler, with_loops
from tests.world.kernels.test_lane_kernel import bits, check_both
from tests.world.people.test_crossing_one_by_one import people_at_the_road, street
from tests.world.people.test_walking_one_by_one import crowd

pytestmark = needs_compiler


@pytest.mark.parametrize("seed", range(3))
def test_people_at_kerbs_have_the_bits_of_arrays(seed: int) -> None:
    roads = street()
    (one, rows), (other, _) = (people_at_the_road(roads, seed) for _ in range(2))
    states = []
    for _ in range(12):
        check_both(one, other, 10)
        states.append(one.yields[rows] >= COMMITTED)
    assert 0 < np.count_nonzero(states) < np.size(states)
    for world in (one, other):  # some are pushed over the kerb, or put onto the road
        world.y[rows] += np.random.default_rng(seed).uniform(-3.0, 3.0, len(rows))
    check_both(one, other, 50)


@pytest.mark.parametrize("has_corners", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_crowd_has_the_bits_of_arrays(seed: int, *, has_corners: bool) -> None:
    one, other = (crowd(seed, has_corners=has_corners) for _ in range(2))
    check_both(one, other, 100)


def test_people_go_on_from_a_snapshot_and_after_one_has_gone() -> None:
    roads = street()
    (one, rows), (other, _) = (people_at_the_road(roads, 7) for _ in range(2))
    check_both(one, other, 30)
    saved = one.snapshot()
    check_both(one, other, 20)
    for world in (one, other):
        world.restore(saved)
        world.remove(int(world.uid[rows[3]]))
    check_both(one, other, 50)


def test_loops_for_people_are_taken_over_between_two_frames() -> None:
    def walkers() -> World:
        return people_at_the_road(street(), 3)[0]

    one, other = walkers(), walkers()
    for frame in range(60):
        with with_loops(are_there=False):
            step(one)
        with with_loops(are_there=frame % 17 > 7):
            step(other)
        assert (other.derived(People).kernel is not None) == (frame // 5 * 5 % 17 > 7) or frame < 5
        assert bits(one) == bits(other), frame


def test_people_of_many_worlds_have_the_bits_of_arrays() -> None:
    one, other = (Worlds("demo", 3, seed=7) for _ in range(2))
    for part in range(5):
        if part == 3:
            for worlds in (one, other):
                worlds.reset([True, False, False])
        with with_loops(are_there=False):
            one.step({"steering": 0.0, "speed": 3.0}, 7)
        with with_loops():
            other.step({"steering": 0.0, "speed": 3.0}, 7)
        assert one.digests() == other.digests()


@pytest.mark.parametrize(
    ("column", "figure"), [("x", np.nan), ("leg_start", np.nan), ("leg_start", 1e15), ("leg_start", -1e15)]
)
def test_place_that_is_no_number_or_has_no_key_is_where_arrays_have_it(column: str, figure: float) -> None:
    world = crowd(0)
    people = world.derived(People)
    getattr(world, column)[people.rows[::2]] = figure
    with np.errstate(invalid="ignore"):
        expected = people.find_places()
    people.take_kernel(make_people_kernel())
    assert people.kernel is not None
    for one, other in zip(people.kernel.find_places(), expected, strict=True):
        np.testing.assert_array_equal(one, other)

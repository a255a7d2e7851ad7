"""The first lane of a map, with row 0, is a lane as any other: traffic does not depend on the order of the lanes."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.world import World
from rosbridge_sim.world.step import step
from tests.world.lane_changes.test_looks_one_by_one import streets, traffic

pytestmark = pytest.mark.usefixtures("loops")

NUM_FRAMES = 40
FIRSTS = ("a1", "b1", "c1", "d1", "x", "r", "g1")
"""Lanes that end, fork, cross, join or have a light."""


@pytest.fixture(scope="module")
def maps() -> dict[str, tuple[Roads, SignalPlan]]:
    return {first: streets(first) for first in ("a0", *FIRSTS)}


def names_of(world: World, lanes: IntArray) -> list[str]:
    return [world.roads.ids[lane] if lane >= 0 else "" for lane in lanes.tolist()]


def drive(roads: tuple[Roads, SignalPlan], seed: int) -> tuple[list[list[str]], FloatArray]:
    """In each frame the lanes that drivers are on, claim, hold and leave by; and poses, speeds and signals."""
    world, lanes, figures = traffic(roads, seed), list[list[str]](), list[FloatArray]()
    for _ in range(NUM_FRAMES):
        step(world)
        columns = world.lane, world.claim, world.held, world.exit_lane
        lanes += [names_of(world, column[world.has_lane]) for column in columns]
        figures.append(np.array([world.x, world.y, world.yaw, world.speed, world.signal, world.change]))
    return lanes, np.array(figures)


@pytest.mark.parametrize("seed", range(8))
def test_traffic_is_the_same_whichever_lane_is_the_first(seed: int, maps: dict[str, tuple[Roads, SignalPlan]]) -> None:
    lanes, figures = drive(maps["a0"], seed)
    for first in FIRSTS[seed % 2 :: 2]:
        same_lanes, same_figures = drive(maps[first], seed)
        assert same_lanes == lanes, first
        # A place on the one scale of all lanes may differ in its last bits.
        assert np.allclose(same_figures, figures, rtol=0.0, atol=1e-6), first

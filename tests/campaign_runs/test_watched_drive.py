"""Lanes near the end of a drive, as a kept run has them."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from rosbridge_sim.campaign_runs.watched_drive import MAX_LANES, REACH, STEP, find_roads
from rosbridge_sim.campaigns.trace import FIGURES, Trace
from rosbridge_sim.world.state.world import World
from tests.world.road_factory import line, make


def trace_to(x: float, y: float) -> Trace:
    """A trace whose last frame is at a place."""
    return Trace([(0.0, 9e9, 9e9, *[0.0] * (len(FIGURES) - 3)), (0.02, x, y, *[0.0] * (len(FIGURES) - 3))], {}, deque())


def test_lanes_are_drawn_in_even_steps_from_end_to_end() -> None:
    world = World()
    world.lay_roads(make(long=(line((0, 0), (10, 0)), ""), short=(line((0, 7), (3, 7)), "")))
    near, far = find_roads(world, trace_to(0.0, 0.0))
    assert near == [(0.0, 0.0), (5.0, 0.0), (10.0, 0.0)], "two steps, since three would be shorter than STEP"
    assert far == [(0.0, 7.0), (3.0, 7.0)]
    assert STEP == 4.0


def test_nearest_lanes_come_first_and_points_beyond_the_reach_are_left_out() -> None:
    world = World()
    lanes = {f"lane{i}": (line((0, 2.0 * i), (2.0 * REACH, 2.0 * i)), "") for i in range(MAX_LANES + 20)}
    world.lay_roads(make(**lanes))
    drawn = find_roads(world, trace_to(0.0, 40.0))
    assert len(drawn) == MAX_LANES
    away = [abs(each[0][1] - 40.0) for each in drawn]
    assert away == sorted(away)
    assert away[0] == 0.0
    points = np.array([point for each in drawn for point in each])
    assert np.hypot(points[:, 0], points[:, 1] - 40.0).max() == pytest.approx(REACH, abs=STEP)
    assert find_roads(world, trace_to(0.0, 40.0 + 9.0 * REACH)) == []

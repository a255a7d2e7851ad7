"""Smooth lines through points: exact on arcs and straights that meet at points, and close to the points elsewhere."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbridge_sim.world.geometry.bends import MAX_BULGE
from tests.world.road_factory import arc, line, make


@pytest.mark.parametrize("num", [4, 10, 50])
def test_places_between_the_points_of_an_arc_lie_on_it(num: int) -> None:
    angles = np.linspace(-0.5 * math.pi, 0.0, num)
    points = np.stack([30.0 * np.cos(angles), 30.0 * np.sin(angles), 0.0 * angles], axis=-1)
    roads = make(a=(points, ""))
    s = np.linspace(0.0, roads.length[0], 200)
    places, yaw = roads.at(np.zeros(200, dtype=np.int64), s)
    turn = 0.5 * math.pi / (num - 1)  # of a leg, which is a parabola
    assert np.abs(np.hypot(places[:, 0], places[:, 1]) - 30.0).max() < 30.0 * turn**4 / 100.0 + 1e-9
    assert np.abs(yaw - np.arctan2(places[:, 0], -places[:, 1])).max() < turn**3 / 20.0 + 1e-9
    near = roads.nearest(places[:, 0], places[:, 1])
    assert np.abs(near.lateral).max() < 0.02 * 30.0 * turn**2
    assert np.allclose(near.distance, np.abs(near.lateral))


@pytest.mark.parametrize("legs", [1, 2, 5])
@pytest.mark.parametrize("is_first", [False, True])
def test_straight_before_or_behind_an_arc_stays_straight(legs: int, *, is_first: bool) -> None:
    bend = arc(0.0, 20.0, 20.0, -90.0, 60.0)
    before = np.stack([np.linspace(-10.0 * legs, 0.0, legs + 1), np.zeros(legs + 1), np.zeros(legs + 1)], axis=-1)
    points = np.concatenate([before[:-1], bend])
    if not is_first:
        points = points[::-1]
    roads = make(a=(points, ""))
    s = np.linspace(0.0, 10.0 * legs, 50)
    places, _ = roads.at(np.zeros(50, dtype=np.int64), s if is_first else roads.length[0] - s)
    assert np.abs(places[:, 1]).max() < 1e-9


def test_sharp_corners_and_lone_ones_between_long_legs_stay() -> None:
    for end in ((100.0, 100.0), (195.0, 30.0)):
        roads = make(a=(line((0, 0), (100, 0), end), ""))
        assert not roads.curve.any()


@pytest.mark.parametrize("seed", range(5))
def test_line_goes_through_its_points_and_stays_near_its_legs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    yaw = np.cumsum(rng.normal(0.0, 0.2, 60))
    step = rng.uniform(0.5, 20.0, 60)
    points = np.cumsum(np.stack([step * np.cos(yaw), step * np.sin(yaw), 0.0 * yaw], axis=-1), axis=0)
    roads = make(a=(points, ""))
    at, _ = roads.at(np.zeros(60, dtype=np.int64), roads.s)
    assert np.allclose(at, points)
    for i, (a, b) in enumerate(pairwise(points)):
        s = np.linspace(roads.s[i], roads.s[i + 1], 9)
        places = roads.at(np.zeros(9, dtype=np.int64), s)[0] - a
        along = (b - a) / np.linalg.norm(b - a)
        aside = np.abs(places[:, 1] * along[0] - places[:, 0] * along[1]).max()
        assert aside <= max(MAX_BULGE, 0.1 * step[i + 1])


def test_lanes_do_not_bend_one_another() -> None:
    roads = make(a=(line((0, 0), (10, 0)), "b"), b=(line((10, 0), (20, 4), (30, 8)), ""))
    assert not roads.curve.any()

"""Places on roads by coordinates."""

from __future__ import annotations

import math

import pytest

from rosbridge_sim.world.roads.road_places import find_lane, is_on_road, place_on_lane
from rosbridge_sim.world.roads.roads import Roads
from tests.world.road_factory import crossing, line, make


def test_nearest_lane_has_distance_offset_and_heading() -> None:
    near = find_lane(crossing(), -100.0, 1.25)
    assert near is not None
    assert (near.lane, near.s, near.lateral, near.distance, near.yaw) == (0, 100.0, 1.25, 1.25, 0.0)


def test_heading_prefers_the_lane_of_its_direction() -> None:
    roads = make(there=(line((0, 0), (100, 0)), ""), back=(line((100, 3.5), (0, 3.5)), ""))
    assert [near.lane for near in (find_lane(roads, 50.0, 1.5), find_lane(roads, 50.0, 1.5, math.pi)) if near] == [0, 1]


def test_map_without_lanes_has_no_nearest_one_and_no_road() -> None:
    assert find_lane(Roads(), 0.0, 0.0) is None
    assert place_on_lane(Roads(), 0, 0.0, 0.0, 3.0) is None
    assert not is_on_road(Roads(), 0.0, 0.0)


def test_place_on_a_given_lane_ignores_nearer_ones() -> None:
    roads = crossing()
    near = place_on_lane(roads, roads.row("sn"), 1.0, 0.0, 3.0)
    assert near is not None
    assert (roads.ids[near.lane], near.s, near.lateral) == ("sn", 10.0, -1.0)
    assert place_on_lane(roads, roads.row("n"), 1.0, 0.0, 3.0) is None


@pytest.mark.parametrize(
    ("x", "y", "is_on"),
    [(-100.0, 1.7, True), (-100.0, 1.8, False), (-200.4, 0.0, True), (-201.0, 0.0, False), (5e8, -1e9, False)],
)
def test_point_between_the_edges_of_a_lane_is_on_the_road(x: float, y: float, is_on: bool) -> None:  # noqa: FBT001 - pytest passes by name
    assert is_on_road(crossing(), x, y) is is_on

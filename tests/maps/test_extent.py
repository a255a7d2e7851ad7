"""The part of a map that a picture shows."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.maps.extent import find_bulk, find_far_lanes
from rosbridge_sim.world.roads.roads import Roads
from tests.world.road_factory import line, make


@pytest.mark.parametrize(
    ("boxes", "bulk"),
    [
        ([], []),
        ([(0, 0, 100, 100)], [True]),
        ([(0, 0, 1000, 10), (9000, 0, 9010, 10)], [True, False]),
        ([(0, 0, 1000, 10), (0, 9000, 10, 9010)], [True, False]),
        ([(0, 0, 1000, 10), (-9010, 0, -9000, 10)], [True, False]),
        ([(0, 0, 1000, 10), (2900, 0, 2910, 10)], [True, True]),
        # A part 9 km away is still to be seen on a map of 5 km.
        ([(0, 0, 5000, 5000), (14000, 0, 14100, 10)], [True, True]),
        ([(0, 0, 900, 10), (800, 5000, 1800, 5010), (950, 0, 1950, 10)], [True, False, True]),
        ([(1e8, 0, 1e8 + 10, 10), (0, 0, 1000, 10), (0, -1e8, 10, 5 - 1e8)], [False, True, False]),
    ],
)
def test_boxes_kilometres_away_from_the_heaviest_group_are_no_part_of_it(
    boxes: list[tuple[float, ...]], bulk: list[bool]
) -> None:
    corners = np.array(boxes, dtype=np.float64).reshape(-1, 4)
    low, high = corners[:, :2], corners[:, 2:]
    assert find_bulk(low, high, np.hypot(*(high - low).T)).tolist() == bulk


def test_lane_with_a_wrong_coordinate_is_far() -> None:
    roads = make(
        a=(line((0, 0), (300, 0)), "b"), b=(line((300, 0), (600, 0)), ""), c=(line((30000, 0), (30100, 0)), "")
    )
    assert find_far_lanes(roads).tolist() == [False, False, True]
    assert find_far_lanes(Roads()).tolist() == []

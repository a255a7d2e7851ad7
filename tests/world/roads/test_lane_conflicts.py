from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.lane_conflicts import (
    AT_START,
    CLEAR,
    COMFORT,
    DEFAULT_SPEED_LIMIT,
    LaneConflicts,
    Links,
)
from rosbridge_sim.world.roads.roads import Roads
from tests.world.road_factory import arc, built_in, crossing, line, make


def pairs(links: Links, roads: Roads) -> dict[tuple[str, str], float]:
    return {
        (roads.ids[lane], roads.ids[links.other[i]]): float(links.figure[i])
        for lane in range(len(roads))
        for i in range(links.first[lane], links.first[lane + 1])
    }


# How fast


def test_the_limit_is_the_safe_speed_of_a_straight() -> None:
    roads = make(a=(line((0, 0), (100, 0)), "", 12.0), b=(line((0, 9), (100, 9)), "", 0.0))
    assert LaneConflicts(roads).safe_speed.tolist() == pytest.approx(
        [12.0, 12.0, DEFAULT_SPEED_LIMIT, DEFAULT_SPEED_LIMIT]
    )


def test_bend_speed_follows_from_its_radius() -> None:
    network = LaneConflicts(make(a=(arc(0, 0, 20.0, 0, 180), "", 30.0)))
    assert network.safe_speed == pytest.approx(math.sqrt(2.5 * 20.0), rel=0.02)


def test_bend_with_points_far_apart_is_as_fast_as_its_circle() -> None:
    turn = 8.0 / 350.0 * np.arange(40)
    points = line(*[(350.0 * math.sin(a), 350.0 * (1.0 - math.cos(a))) for a in turn])
    network = LaneConflicts(make(a=(points, "", 60.0)))
    assert network.safe_speed == pytest.approx(math.sqrt(2.5 * 350.0), rel=0.02)


def test_rounded_map_points_make_no_bend() -> None:
    rng = np.random.default_rng(0)
    points = line(*[(0.5 * i, 0.0) for i in range(400)])
    points[:, 1] = rng.uniform(-0.0005, 0.0005, 400)
    assert LaneConflicts(make(a=(points, "", 30.0))).safe_speed.min() > 29.0


def test_slowing_is_before_a_bend_and_not_after() -> None:
    way = np.concatenate([line(*[(float(x), 0.0) for x in range(-200, 0, 2)]), arc(0, 15, 15.0, -90, 90)])
    way = np.concatenate([way, line(*[(15.0, 15.0 + y) for y in range(2, 200, 2)])])
    roads = make(a=(way, "", 20.0))
    pace = LaneConflicts(roads).safe_speed
    slow = math.sqrt(2.5 * 15.0)
    bend = int(np.argmin(pace))
    assert pace[bend] == pytest.approx(slow, rel=0.05)
    before = roads.s < roads.s[bend] - 10.0
    braking = np.sqrt(slow**2 + 2.0 * COMFORT * (200.0 - roads.s[before]))
    assert pace[before] == pytest.approx(np.fmin(20.0, braking), rel=0.1)
    assert pace[-1] == 20.0
    rises = np.diff(np.square(pace)) < -2.0 * COMFORT * np.diff(roads.s) - 1e-9
    assert not rises.any(), "nowhere must one brake harder than comfortably"


def test_segments_lead_from_point_to_point() -> None:
    roads = make(a=(line((0, 0), (3, 4), (3, 10)), ""), b=(np.array([(0.0, 9.0, 0.0), (8.0, 9.0, 4.0)]), ""))
    legs = LaneConflicts(roads).legs
    assert legs[:, :2].tolist() == [[0, 5], [5, 11], [5, 11], [0, 8], [0, 8]]
    assert legs[:, 5:].ravel().tolist() == pytest.approx([0.6, 0.8, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0.5, 1, 0, 0.5])


# Where on


def test_dead_ends_are_avoided_if_another_lane_exists() -> None:
    roads = make(
        a=(line((0, 0), (9, 0)), "b c"),
        b=(line((9, 0), (9, 9), (0, 9), (0, 0)), "a"),
        c=(line((9, 0), (20, 0)), "d"),
        d=(line((20, 0), (30, 0)), ""),
    )
    onward = LaneConflicts(roads).onward
    assert [onward.other[onward.first[i] : onward.first[i + 1]].tolist() for i in range(4)] == [[1], [0], [3], []]


def test_all_successors_are_candidates_if_every_one_is_a_dead_end() -> None:
    onward = LaneConflicts(crossing()).onward
    assert onward.other.tolist() == [1, 2, 4, 5]


# Where lanes lie over one another


def test_crossing_lanes_conflict_where_they_are_near() -> None:
    roads = crossing()
    network = LaneConflicts(roads)
    assert set(pairs(network.rivals, roads)) == {("we", "sn"), ("sn", "we")}
    assert pairs(network.rivals, roads)[("we", "sn")] == pytest.approx(10.0 + CLEAR + 1.0, abs=1.1)
    assert network.wait_point.tolist() == [math.inf, 0.0, math.inf, math.inf, 0.0, math.inf], (
        "one waits before the crossing"
    )
    assert network.clear_point[1] == pytest.approx(10.0 + CLEAR + 1.0, abs=1.1)


def test_wait_point_of_a_far_conflict_is_before_the_conflict() -> None:
    roads = make(a=(line((0, 0), (200, 0)), ""), b=(line((150, -100), (150, 100)), ""))
    hold = LaneConflicts(roads).wait_point
    assert hold[0] == pytest.approx(150.0 - CLEAR - 1.0, abs=1.1)
    assert hold[1] == pytest.approx(100.0 - CLEAR - 1.0, abs=1.1)
    assert hold.min() > AT_START


def test_bridge_conflicts_with_nothing() -> None:
    roads = make(a=(line((0, 0), (200, 0)), ""), b=(line((150, -100), (150, 100), z=6.0), ""))
    assert np.isinf(LaneConflicts(roads).wait_point).all()


def test_parallel_and_successive_lanes_do_not_conflict() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "b"),
        b=(line((100, 0), (200, 0)), ""),
        c=(line((0, 3.0), (100, 3.0)), "d"),
        d=(line((100, 3.0), (200, 3.0)), ""),
        e=(line((200, -3.0), (0, -3.0)), ""),
    )
    network = LaneConflicts(roads)
    assert (len(network.rivals.other), len(network.siblings.other)) == (0, 0)


def test_merging_lanes_conflict_to_their_end() -> None:
    roads = make(
        a=(line((0, 0), (100, 0)), "c"), b=(line((0, -40), (60, -1.5), (100, 0)), "c"), c=(line((100, 0), (200, 0)), "")
    )
    network = LaneConflicts(roads)
    assert set(pairs(network.rivals, roads)) == {("a", "b"), ("b", "a")}
    assert pairs(network.rivals, roads)[("b", "a")] == pytest.approx(101.0)
    assert 40.0 < network.wait_point[0] < 60.0


def test_diverging_lanes_are_siblings_while_they_overlap() -> None:
    roads = make(a=(line((0, 0), (50, 0)), "b c"), b=(line((50, 0), (100, 0)), ""), c=(line((50, 0), (90, 30)), ""))
    network = LaneConflicts(roads)
    assert set(pairs(network.siblings, roads)) == {("b", "c"), ("c", "b")}
    assert len(network.rivals.other) == 0
    # 0.6 across for each metre along c: they are apart at about four metres.
    assert 3.0 <= network.shared[1] <= 5.5
    assert network.shared[0] == 0.0


def test_tight_bends_need_more_room() -> None:
    inner, outer = arc(0, 0, 8.0, 0, 90), arc(0, 0, 11.2, 90, -90)
    assert len(LaneConflicts(make(a=(inner, ""), b=(outer, ""))).rivals.other) == 2
    inner, outer = arc(0, 0, 60.0, 0, 90), arc(0, 0, 63.2, 90, -90)
    assert len(LaneConflicts(make(a=(inner, ""), b=(outer, ""))).rivals.other) == 0


@pytest.mark.parametrize(("straight", "apart", "passes"), [(20.0, 3.5, True), (20.0, 2.6, False), (2.0, 3.5, False)])
def test_cars_pass_each_other_in_bends_of_roads_with_two_wide_directions(
    straight: float, apart: float, *, passes: bool
) -> None:
    def way(radius: float) -> FloatArray:
        return np.concatenate([line((-straight, radius)), arc(0, 0, radius, 90, -90), line((radius, -straight))])

    roads = make(a=(way(9.0), ""), b=(way(9.0 + apart)[::-1], ""))
    assert LaneConflicts(roads).rival_passes.tolist() == [passes] * 2
    one_way = make(a=(way(9.0), ""), b=(way(9.0 + apart), ""))
    assert LaneConflicts(one_way).rival_passes.tolist() == [False] * 2


def test_points_are_compared_in_bounded_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = LaneConflicts(built_in("town").roads)
    monkeypatch.setattr("rosbridge_sim.world.roads.lane_conflicts.MAX_LANE_PAIRS", 1000)
    parts = LaneConflicts(built_in("town").roads)
    assert whole.wait_point.tolist() == parts.wait_point.tolist()
    assert whole.rivals.other.tolist() == parts.rivals.other.tolist()
    assert whole.rivals.figure.tolist() == parts.rivals.figure.tolist()


def test_empty_road_map_has_no_conflicts() -> None:
    network = LaneConflicts(Roads())
    assert len(network.safe_speed) == len(network.wait_point) == len(network.rivals.other) == 0

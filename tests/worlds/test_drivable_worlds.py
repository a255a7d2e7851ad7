"""What egos see, in exact figures: on straight roads made by hand, without a map or a scenario."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.world import Body, Kind
from rosbridge_sim.worlds.drivable_worlds import DrivableWorlds
from rosbridge_sim.worlds.lanes_behind import find_lanes_behind
from tests.world.road_factory import crossing, ego, line, make, ring, road, signalled

BOX = Body.box(4.0, 2.0, 1.5)
"""A body whose reference point is its middle."""


def on(roads: Roads, plan: SignalPlan | None = None) -> OneOfMany:
    world = OneOfMany()
    world.lay_roads(roads, plan)
    return world


def box(
    world: OneOfMany, x: float, y: float, *, yaw: float = 0.0, speed: float = 0.0, lateral_speed: float = 0.0
) -> int:
    uid = world.spawn(Kind.VEHICLE, BOX, name="box", x=x, y=y, yaw=yaw, speed=speed)
    world.lateral_speed[world.row(uid)] = lateral_speed
    return uid


CENTRE = float(Body().length / 2 - Body().rear_overhang)
"""The middle of an ego is so far ahead of its rear axle [m]."""


def test_rays_meet_the_borders_of_the_road_and_its_ends() -> None:
    world = on(road(100.0))
    ego(world, 30.0 - CENTRE, 0.5, speed=2.0)
    found = DrivableWorlds([world]).rays(8, 200.0)[0, 0]
    diagonal = np.sqrt(0.5)
    left, right = 1.25, 2.25
    expected = [70.0, left / diagonal, left, left / diagonal, 30.0, right / diagonal, right, right / diagonal]
    assert found[:, 0] == pytest.approx(np.array(expected))
    assert found[:, 1] == pytest.approx(
        np.array([-2.0, -2.0 * diagonal, 0.0, 2 * diagonal, 2.0, 2 * diagonal, 0.0, -2 * diagonal])
    )


def test_rays_reach_as_far_as_they_are_long_and_meet_no_border_of_another_level() -> None:
    below = line((-100, 0), (100, 0))
    world = on(make(a=(below, ""), b=(line((0, -50), (0, 50), z=5.0), "")))
    row = ego(world, 10.0 - CENTRE, 0.0)
    worlds = DrivableWorlds([world])
    assert worlds.rays(2, 60.0)[0, 0].tolist() == [[60.0, 0.0], [60.0, 0.0]]
    world.z[row] = 5.0  # as high as the bridge, from whose side it is seen
    assert worlds.rays(2, 60.0)[0, 0, 1, 0] == pytest.approx(10.0 - 1.75)


def test_ray_meets_the_nearest_box_and_tells_how_fast_it_goes_away() -> None:
    world = on(road(1000.0))
    ego(world, 500.0 - CENTRE, 0.0, speed=3.0)
    gone = box(world, 505.0, 0.0)
    box(world, 520.0, 0.0, speed=5.0)
    box(world, 510.0, 0.4, yaw=np.pi / 2, speed=1.0, lateral_speed=-4.0)  # across; it slides forward
    box(world, 480.0, 0.0, yaw=np.pi, speed=2.0)
    world.remove(gone)
    ahead, behind = DrivableWorlds([world]).rays(2, 100.0)[0, 0]
    assert ahead == pytest.approx(np.array([9.0, 1.0]))  # 1 m before its middle; 4 - 3 m/s
    assert behind == pytest.approx(np.array([18.0, 5.0]))
    assert DrivableWorlds([world]).rays(2, 9.0)[0, 0].tolist() == [[9.0, 0.0], [9.0, 0.0]]


def test_ray_that_begins_in_a_box_is_as_short_as_none_can_be() -> None:
    world = on(road(1000.0))
    ego(world, 500.0 - CENTRE, 0.0)
    box(world, 501.0, 0.0)
    assert DrivableWorlds([world]).rays(4, 50.0)[0, 0, :, 0].tolist() == [0.0] * 4


def test_others_are_told_in_the_frame_of_the_ego_the_nearest_first() -> None:
    world = on(road())
    ego(world, 100.0, 0.0, yaw=np.pi / 2, speed=2.0)
    world.lateral_speed[0] = 0.5
    box(world, 110.0, 20.0, yaw=0.0, speed=4.0, lateral_speed=1.0)
    box(world, 100.0, 3.0, yaw=np.pi / 2)
    first, second, third = DrivableWorlds([world]).others(3)[0, 0]
    assert first == pytest.approx(np.array([1, 3, 0, -2, -0.5, 1, 0, 4, 2]), abs=1e-9)
    # It goes east and slides north: to the right and forward, as the ego sees it.
    assert second == pytest.approx(np.array([1, 20, -10, 1 - 2, -4 - 0.5, 0, -1, 4, 2]), abs=1e-9)
    assert not third.any()
    with pytest.raises(ValueError, match="num: expected a whole number from 1 on"):
        DrivableWorlds([world]).others(0)
    with pytest.raises(ValueError, match=r"out: expected shape \(1, 1, 2, 9\)"):
        DrivableWorlds([world]).others(2, np.empty((1, 1, 3, 9)))


def test_worlds_with_fewer_egos_have_places_without_one() -> None:
    first, second = on(road()), on(road())
    ego(first, 10.0, 0.0)
    ego(second, 20.0, 0.5)
    ego(second, 40.0, 0.0, speed=3.0)
    none = on(road())
    worlds = DrivableWorlds([first, second, none])
    assert (worlds.num_worlds, worlds.num_egos, worlds.has_ego.tolist()) == (
        3,
        2,
        [[True, False], [True, True], [False, False]],
    )
    assert worlds.egos(("x",))["x"].tolist()[1] == [20.0, 40.0]
    assert np.isnan(worlds.egos(("x",))["x"][[0, 2, 2], [1, 0, 1]]).all()
    assert worlds.lanes()["offset"][1].tolist() == [0.5, 0.0]
    assert worlds.others(1)[1, 1, 0, :2] == pytest.approx(np.array([1.0, CENTRE - 20.0]))
    with pytest.raises(ValueError, match="steering: expected finite numbers"):
        worlds.command({"steering": [[0.0, np.nan], [0.0, np.nan], [0.0, 0.0]], "speed": 1.0})
    worlds.command({"steering": [[0.0, np.nan], [0.0, 0.0], [np.nan, np.nan]], "speed": 1.0})  # of egos that are none
    for number in (-1, 3):
        with pytest.raises(ValueError, match=rf"world: expected 0\.\.2, got {number}"):
            worlds.world(number)


def test_table_of_egos_follows_those_that_come() -> None:
    world = on(road())
    ego(world, 10.0, 0.0)
    worlds = DrivableWorlds([world])
    assert worlds.num_egos == 1
    ego(world, 20.0, 0.0)
    assert worlds.num_egos == 2


def test_lanes_are_told_with_their_edges_and_places_ahead() -> None:
    world = on(make(a=(line((0, 0), (50, 0)), "b", 20.0), b=(line((50, 0), (100, 0)), "")))
    ego(world, 30.0, 0.5, yaw=0.1)
    ego(world, 30.0, 2.0)
    lanes = DrivableWorlds([world]).lanes([0.0, 10.0, 40.0, 90.0])
    expected = {"offset": 0.5, "heading": 0.1, "to_left": 1.25, "to_right": 2.25, "speed_limit": 20.0, "s": 30.0}
    assert {name: lanes[name][0, 0] for name in expected} == pytest.approx(expected)
    assert lanes["is_on_road"].tolist() == [[1.0, 0.0]]
    assert lanes["to_left"][0, 1] == pytest.approx(-0.25)
    ahead = np.array([0.0, 10.0, 40.0, 70.0])  # the road ends after 70 m
    cos, sin = np.cos(0.1), np.sin(0.1)
    places = np.column_stack([ahead * cos - 0.5 * sin, -ahead * sin - 0.5 * cos])
    assert lanes["points"][0, 0] == pytest.approx(places)
    for wrong in ([[1.0]], [np.nan]):
        with pytest.raises(ValueError, match="ahead: expected finite distances"):
            DrivableWorlds([world]).lanes(wrong)  # type: ignore[arg-type]


def test_without_a_road_there_is_no_lane_and_nothing_to_meet() -> None:
    world = OneOfMany()
    ego(world, 0.0, 0.0)
    worlds = DrivableWorlds([world])
    assert worlds.lanes([5.0])["lane"].tolist() == [[-1.0]]
    assert worlds.rays(4, 30.0)[0, 0].tolist() == [[30.0, 0.0]] * 4
    assert not worlds.grids(10.0, 1.0).any()


def test_light_ahead_is_told_with_its_distance_and_colour() -> None:
    roads, plan = signalled()
    world = on(roads, plan)
    ego(world, -50.0, 0.0)  # to the east, green at first
    ego(world, 0.0, -150.0, yaw=np.pi / 2)
    ego(world, 20.0, 0.0)  # behind the crossing
    ego(world, 0.0, 0.0)  # on the lane that has the light
    found = DrivableWorlds([world]).lights()
    assert found["distance"].tolist() == [[40.0, 140.0, np.inf, np.inf]]
    assert found["must_stop"].tolist() == [[0.0, 1.0, 0.0, 0.0]]


def test_places_ahead_at_a_fork_are_on_the_lane_that_turns_least() -> None:
    straight, bend = line((50, 0), (100, 0)), line((50, 0), (60, 0), (60, 40))
    for lanes in ({"b": (bend, ""), "c": (straight, "")}, {"b": (straight, ""), "c": (bend, "")}):
        world = on(make(a=(line((0, 0), (50, 0)), "b c"), **lanes))
        ego(world, 30.0, 0.0)
        assert DrivableWorlds([world]).lanes([45.0])["points"][0, 0, 0] == pytest.approx(np.array([45.0, 0.0]))


@pytest.mark.parametrize(
    ("start", "wanted", "found"),
    [
        ("a", "d e", "d e"),
        ("a", "b d e", "b e"),  # the way by b ends there
        ("a", "a", ""),  # a lane is no goal of a drive that begins on it
        ("d", "a b", "a"),
        ("d", "d", ""),
    ],
)
def test_goals_are_the_lanes_that_each_way_comes_to_first(start: str, wanted: str, found: str) -> None:
    world = on(ring())
    rows = np.array([world.roads.row(name) for name in wanted.split()], dtype=np.int64)
    is_found = find_lanes_behind(world, world.roads.row(start), rows)
    assert [world.roads.ids[i] for i in np.flatnonzero(is_found)] == found.split()


def test_from_no_lane_none_is_reached() -> None:
    world = on(crossing())
    assert not find_lanes_behind(world, -1, np.arange(len(world.roads))).any()


def test_ego_that_drives_itself_goes_on_with_another_wish_and_changes_lanes_where_there_is_one() -> None:
    roads = Roads(
        ["left", "right"],
        [line((0, 3.5), (500, 3.5)), line((0, 0), (500, 0))],
        [[], []],
        [3.5, 3.5],
        [15.0, 15.0],
        left=[-1, 0],
        right=[1, -1],
    )
    worlds_of = [on(roads), on(roads)]
    for world, y in zip(worlds_of, (0.0, 3.5), strict=True):
        ego(world, 50.0, y, speed=10.0)
    worlds = DrivableWorlds(worlds_of)
    assert worlds.drive_itself([[np.nan], [12.0]]).tolist() == [[False], [True]]
    assert worlds.drive_itself(0.0).tolist() == [[True], [True]]
    assert [world.desired_speed[0] for world in worlds_of] == [0.0, 0.0]
    assert worlds.change_lanes([[1.0], [1.0]]).tolist() == [[True], [False]]
    assert worlds.change_lanes([[0.0], [-0.5]]).tolist() == [[False], [True]]

"""The built-in maps: equal to the script's output, and consistent."""

from __future__ import annotations

import math
import re
import runpy

import numpy as np
import pytest

from rosbridge_sim.maps.mgeo_lights import light_type
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Lamp, SignalPlan
from rosbridge_sim.world.roads.signals import Signals
from tests.support import ROOT
from tests.world.road_factory import MAPS, built_in

NAMES = ("track", "town", "loop", "hills", "motorway", "roundabout", "parking")


def test_map_files_equal_the_output_of_their_script() -> None:
    drawn = runpy.run_path(str(ROOT / "scripts" / "draw_maps.py"))["drawn"]()
    data = ROOT / "rosbridge_sim" / "data"
    assert {path: path.read_bytes() for path in data.rglob("*.json")} == drawn
    assert sum(map(len, drawn.values())) < 1_800_000  # lanes have points 1 m apart in bends


@pytest.mark.parametrize("name", NAMES)
def test_every_lane_continues_in_the_same_direction(name: str) -> None:
    roads = built_in(name).roads
    for lane in through_lanes(roads):
        following = roads.successors(lane).tolist()
        assert following, roads.ids[lane]
        for other in following:
            ends, yaws = roads.at([lane, other], [roads.length[lane], 0.0])
            assert math.dist(ends[0], ends[1]) < 0.002
            # A chord of the tightest arc leaves its tangent by 4 degrees.
            assert abs(math.remainder(yaws[1] - yaws[0], math.tau)) < math.radians(5.0), roads.ids[lane]


@pytest.mark.parametrize("name", NAMES)
def test_bends_have_points_each_metre(name: str) -> None:
    roads = built_in(name).roads
    num = 0
    for lane in range(len(roads)):
        step = np.diff(roads.points[roads.first[lane] : roads.first[lane + 1], :2], axis=0)
        length, yaw = np.hypot(*step.T), np.arctan2(step[:, 1], step[:, 0])
        turn = np.abs(np.remainder(np.diff(yaw) + math.pi, math.tau) - math.pi)
        is_bent = turn / np.minimum(length[:-1], length[1:]) > 1.0 / 3000.0
        in_bend = length[1:-1][is_bent[:-1] & is_bent[1:]]
        num += len(in_bend)
        assert in_bend.max(initial=0.0) < 1.002, roads.ids[lane]  # files are rounded to the millimetre
    assert num > 200


@pytest.mark.parametrize("name", NAMES)
def test_every_lane_has_a_predecessor(name: str) -> None:
    roads = built_in(name).roads
    assert set(roads.successor.tolist()) == set(through_lanes(roads))


def through_lanes(roads: Roads) -> list[int]:
    """All lanes but the bays of the car park, which are joined to no other lane."""
    return [lane for lane, name in enumerate(roads.ids) if not re.fullmatch(r"B[A-D]\d\d", name)]


@pytest.mark.parametrize("name", NAMES)
def test_built_in_maps_are_read_without_notes(name: str) -> None:
    road_map = built_in(name)
    assert road_map.notes == ()
    assert sorted(path.name for path in MAPS.iterdir()) == sorted(NAMES)


@pytest.mark.parametrize("name", ["loop", "motorway", "parking", "roundabout"])
def test_map_without_lights_has_the_plan_of_a_world_without_one(name: str) -> None:
    """Its digest is part of the state hash."""
    assert built_in(name).plan.digest == SignalPlan(built_in(name).roads).digest


def test_motorway_lanes_are_neighbours() -> None:
    roads = built_in("loop").roads
    assert roads.left.tolist().count(-1) == roads.right.tolist().count(-1) == len(roads) // 3
    for lane in range(len(roads)):
        points, _ = roads.at(lane, roads.length[lane] / 2)
        for side, sign in ((roads.left[lane], 1.0), (roads.right[lane], -1.0)):
            if side >= 0:
                beside, _ = roads.at(side, roads.length[side] / 2)
                assert math.dist(points[0], beside[0]) == pytest.approx(3.5, abs=0.05)
                place = roads.nearest(beside[0, 0], beside[0, 1])
                assert roads.ids[place.lane[0]][1] == str(int(roads.ids[lane][1]) - int(sign))
    left, right = roads.beside(roads.nearest(roads.points[:, 0], roads.points[:, 1]))
    assert np.allclose(left, 1.75, atol=0.06)
    assert np.allclose(right, 1.75, atol=0.06)
    assert len(LaneConflicts(roads).rivals.other) == 0


def test_motorway_has_a_lane_beside_the_right_one_at_each_exit_and_entry() -> None:
    roads = built_in("motorway").roads
    fourth = [lane for lane, name in enumerate(roads.ids) if name.startswith("L4_")]
    assert len(fourth) == 4
    for lane in fourth:
        beside = int(roads.left[lane])
        assert roads.ids[beside] == roads.ids[lane].replace("L4", "L3")
        assert roads.right[beside] == lane
        here, there = roads.at([lane, beside], [roads.length[lane] / 2, roads.length[beside] / 2])[0]
        assert math.dist(here, there) == pytest.approx(3.5, abs=0.05)
    # An exit forks from lane 3, and an entry joins it: each of both is one choice among two.
    forks = [lane for lane in range(len(roads)) if len(roads.successors(lane)) == 2]
    assert {roads.ids[lane][:2] for lane in forks} == {"L3"}
    assert len(forks) == 2


def test_who_enters_a_roundabout_or_leaves_a_car_park_gives_way() -> None:
    for name, waiting in (("roundabout", "IE IN IW IS JEN JEW JES JWS JWE JWN"), ("parking", "OL OR")):
        roads = built_in(name).roads
        conflicts = LaneConflicts(roads)
        assert {roads.ids[lane] for lane in np.flatnonzero(conflicts.gives_way)} == set(waiting.split())
        for lane in np.flatnonzero(conflicts.gives_way).tolist():
            rivals = conflicts.rivals.other[conflicts.rivals.first[lane] : conflicts.rivals.first[lane + 1]]
            assert not conflicts.gives_way[rivals].all()


def test_bays_lie_beside_the_aisles_and_obstruct_no_traffic() -> None:
    roads = built_in("parking").roads
    bays = [lane for lane in range(len(roads)) if lane not in through_lanes(roads)]
    assert len(bays) == 56
    rivals = LaneConflicts(roads).rivals
    for lane in bays:
        assert roads.width[lane] == 2.5
        others = rivals.other[rivals.first[lane] : rivals.first[lane + 1]].tolist()
        assert set(others) <= set(bays)  # the bay behind its back


def town() -> RoadMap:
    return built_in("town")


def test_traffic_lights_stand_across_the_crossing_and_face_their_lanes() -> None:
    road_map = town()
    roads, plan = road_map.roads, road_map.plan
    assert plan is not None
    for light in plan.lights:
        assert bool(light.lanes) != light.is_pedestrian
        for lane in light.lanes:
            (start, _), yaw = roads.at([lane, lane], [0.0, roads.length[lane]])
            ahead = (light.x - start[0]) * math.cos(yaw[0]) + (light.y - start[1]) * math.sin(yaw[0])
            assert 20.0 < ahead < 30.0
            assert math.hypot(light.x - start[0], light.y - start[1]) < 30.0
            assert abs(math.remainder(light.yaw - yaw[0] - math.pi, math.tau)) < math.radians(5.0)


def test_every_stop_line_has_a_traffic_light() -> None:
    road_map = town()
    roads, plan = road_map.roads, road_map.plan
    assert plan is not None
    stops = np.flatnonzero(roads.is_stop).tolist()
    assert len(stops) > 60
    for lane in stops:
        assert all(plan.light_of_lane[other] >= 0 for other in roads.successors(lane).tolist())
        assert all(plan.controller_of_lane[other] >= 0 for other in roads.successors(lane).tolist())
    assert {light_type(light) for light in plan.lights} == {0, 1, 2, 100}
    assert len(plan.controllers) == 21


def test_crossing_lanes_are_never_green_together() -> None:
    road_map = town()
    roads, plan = road_map.roads, road_map.plan
    assert plan is not None
    network = LaneConflicts(roads)
    signals = Signals(plan)
    ever = np.zeros(len(roads), dtype=bool)
    lit = plan.light_of_lane >= 0
    for frame in range(0, int(plan.cycle.max()), 25):
        signals.show(frame)
        free = signals.may_enter & lit & ~plan.is_warning[plan.light_of_lane]
        ever |= free
        for lane in np.flatnonzero(free).tolist():
            rivals = network.rivals.other[network.rivals.first[lane] : network.rivals.first[lane + 1]]
            both = [roads.ids[other] for other in rivals.tolist() if free[other]]
            # Right turns join the street that others turn left into, and have to look themselves.
            assert all("right" in (movement(roads.ids[lane]), movement(name)) for name in both), (roads.ids[lane], both)
    assert (ever | ~lit | plan.is_warning[plan.light_of_lane]).all(), "everybody gets green at some time"


def movement(name: str) -> str:
    """What one does on a link that is called `J22E1N`."""
    legs = "ENWS"
    return {1: "right", 2: "straight", 3: "left"}[(legs.index(name[-1]) - legs.index(name[3])) % 4]


def test_pedestrians_have_green_only_without_crossing_left_or_straight_traffic() -> None:
    road_map = town()
    roads, plan = road_map.roads, road_map.plan
    assert plan is not None
    assert len(road_map.crosswalks) == 36
    signals = Signals(plan)
    seen: set[int] = set()
    for frame in range(0, int(plan.cycle.max()), 25):
        signals.show(frame)
        for crosswalk in road_map.crosswalks:
            shown = {int(signals.shown[light]) for light in crosswalk.lights}
            assert len(shown) == 1
            if not shown & {int(Lamp.GREEN), 0}:
                continue
            seen.add(crosswalk.lights[0])
            (corners,) = crosswalk.outlines
            low, high = corners.min(axis=0), corners.max(axis=0)
            for lane in np.flatnonzero(signals.may_enter & (plan.controller_of_lane >= 0)).tolist():
                line = roads.points[roads.first[lane] : roads.first[lane + 1]]
                is_on = ((line[:, :2] > low[:2]) & (line[:, :2] < high[:2])).all(axis=1).any()
                assert not is_on or movement(roads.ids[lane]) == "right", (crosswalk.name, roads.ids[lane])
    assert len(seen) == 36, "and everybody gets across at some time"

"""Places on lanes where vehicles may appear."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.demand import LaneSlots, has_room, keep_clear, safe_speed_at, stand_at_ends
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from tests.world.lane_drives import world_of
from tests.world.road_factory import CAR, built_in, car, crossing, ego, line, make, road

NOSE = CAR.length - CAR.rear_overhang


@pytest.mark.parametrize(("away", "is_free"), [(CAR.length + 5.1, True), (CAR.length + 4.9, False)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_gap_is_kept_before_and_behind_at_equal_speed(*, side: float, away: float, is_free: bool) -> None:
    world = world_of(road())
    car(world, "a", 500.0 + side * away, speed=10.0)
    assert has_room(world, 0, 500.0, CAR, 10.0, gap=5.0, time=1.0) is is_free


@pytest.mark.parametrize(("away", "is_free"), [(75.0, True), (45.0, False)])
def test_faster_vehicle_from_behind_needs_room_to_brake_also_from_the_lane_before(
    *, away: float, is_free: bool
) -> None:
    roads = make(a=(line((0, 0), (300, 0)), "b", 30.0), b=(line((300, 0), (600, 0)), "", 30.0))
    world = world_of(roads)
    car(world, "a", 310.0 - away, speed=15.0)
    assert has_room(world, 1, 10.0, CAR, 5.0, gap=5.0, time=1.0) is is_free


def test_slower_vehicle_on_the_next_lane_and_standing_ego_need_room_to_brake() -> None:
    roads = make(a=(line((0, 0), (300, 0)), "b", 30.0), b=(line((300, 0), (600, 0)), "", 30.0))
    world = world_of(roads)
    row = car(world, "b", 5.0)
    assert not has_room(world, 0, 270.0, CAR, 15.0, gap=5.0, time=1.0)
    assert has_room(world, 0, 200.0, CAR, 15.0, gap=5.0, time=1.0)
    world.remove(int(world.uid[row]))
    ego(world, 305.0, 0.0)
    assert not has_room(world, 0, 270.0, CAR, 15.0, gap=5.0, time=1.0)
    assert has_room(world, 0, 200.0, CAR, 15.0, gap=5.0, time=1.0)


def test_vehicle_beside_the_lane_or_on_a_bridge_needs_no_room() -> None:
    world = world_of(road())
    ego(world, 500.0, 3.5)
    assert has_room(world, 0, 500.0, CAR, 0.0, gap=5.0, time=1.0)
    world = world_of(road())
    row = ego(world, 500.0, 0.0)
    world.z[row] = 6.0
    assert has_room(world, 0, 500.0, CAR, 0.0, gap=5.0, time=1.0)


def test_slots_lie_apart_outside_of_crossings_and_on_lanes_that_go_on() -> None:
    roads = crossing()
    slots = LaneSlots.of(roads)
    assert {roads.ids[lane] for lane in slots.lane.tolist()} == {"w", "s", "e", "n"}
    assert {roads.ids[lane] for lane in slots.lane[slots.is_entry].tolist()} == {"w", "s"}
    for lane in set(slots.lane.tolist()):
        s = slots.s[slots.lane == lane]
        assert np.diff(s).min() > 12.0
        assert s[0] >= 8.0
        assert s[-1] <= roads.length[lane] - 8.0
    assert (slots.speed <= [0.5 * safe_speed_at(roads, *at) for at in zip(slots.lane, slots.s, strict=True)]).all()


def test_maps_without_lanes_have_no_slots() -> None:
    assert len(LaneSlots.of(Roads()).lane) == 0
    assert len(LaneSlots.of(road(99.0)).lane) == 0


def test_lane_that_enters_a_crossing_with_its_last_metres_has_slots_before_it() -> None:
    """A tight turn passes the end of a street."""
    roads = make(
        a=(line((-200, 0), (-1, 0)), "b"),
        b=(line((-1, 0), (20, 0)), ""),
        c=(line((-2, -60), (-2, 60)), ""),
    )
    conflicts = roads.derived(LaneConflicts)
    assert 150.0 < conflicts.wait_point[0] < roads.length[0]
    slots = LaneSlots.of(roads)
    assert 0 in slots.lane
    assert slots.s[slots.lane == 0].max() < conflicts.wait_point[0] - 5.0


def test_vehicle_stands_at_an_end_also_before_a_lane_too_short_for_it() -> None:
    for rest, is_end in ((3.0, True), (30.0, False)):
        roads = make(a=(line((0, 0), (100, 0)), "b"), b=(line((100, 0), (100 + rest, 0)), ""))
        world = world_of(roads)
        row = car(world, "a", 90.0)
        assert stand_at_ends(world)[row] == is_end
        other = car(world, "b", 2.0)
        assert stand_at_ends(world)[other]


def test_slots_near_an_entity_are_not_clear() -> None:
    world = world_of(built_in("loop").roads)
    slots = LaneSlots.of(world.roads)
    assert keep_clear(world, slots, 8.0).all()
    ego(world, float(slots.x[3]) + 1.0, float(slots.y[3]))
    assert not keep_clear(world, slots, 8.0)[3]

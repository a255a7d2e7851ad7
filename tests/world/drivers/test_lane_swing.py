"""Long vehicles in tight bends: they use their lane, and pass what stands beside it."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.drivers import lane_swing
from rosbridge_sim.world.drivers.lane_swing import are_straight, find_long, find_swinging, plan_swings
from rosbridge_sim.world.followers.lane_following import DECISION
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import BUS, world_of
from tests.world.road_factory import CAR, arc, car, keep_lane, line, make

pytestmark = pytest.mark.usefixtures("loops")

RADIUS, HALF_LANE = 8.75, 1.75


def corner(side: int = -1) -> Roads:
    """A street to the east with a bend of 90 degrees, to the left with side 1."""
    bend = arc(50, side * RADIUS, RADIUS, -side * 90, side * 90)
    return make(
        a=(line((0, 0), (50, 0)), "b", 10.0),
        b=(bend, "c", 10.0),
        c=(line((50 + RADIUS, side * RADIUS), (50 + RADIUS, side * 80)), "", 10.0),
    )


def beyond(world: World, row: int, side: int) -> tuple[float, float]:
    """How far the vehicle is beyond the inner and the outer border of the corner now [m]."""
    along = world.centre[row] + world.half_length[row] * np.linspace(-1.0, 1.0, 21)
    across = world.half_width[row] * np.array([[1.0], [-1.0]])
    turned = np.exp(1j * world.yaw[row]) * (along + 1j * across) + complex(world.x[row], world.y[row])
    x, y = turned.real - 50.0, side * RADIUS - turned.imag
    y *= side
    # To the line: straight, round, straight. The centre of the bend is (0, 0), the lane comes at y = RADIUS.
    inwards = np.where(x < 0.0, RADIUS - y, np.where(y < 0.0, RADIUS - x, RADIUS - np.hypot(x, y)))
    return float(inwards.max()) - HALF_LANE, float(-inwards.min()) - HALF_LANE


def drive(world: World, row: int, side: int, seconds: float = 10.0) -> tuple[FloatArray, FloatArray]:
    """The greatest of these while it drives through, and its offsets to the left."""
    found, offsets = [], []
    for i in range(round(seconds / DT)):
        step(world)
        offsets.append(world.lateral[row])
        if i % DECISION == 0:
            found.append(beyond(world, row, side))
    return np.array(found).max(axis=0), np.array(offsets)


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1, 1])
def test_bus_uses_both_sides_of_its_lane_in_a_bend_and_is_on_the_line_again_after_it(side: int) -> None:
    world = world_of(corner(side))
    row = car(world, "a", 30.0, speed=5.0, body=BUS)
    (inner, outer), offsets = drive(world, row, side)
    assert (inner, outer) == (pytest.approx(0.27, abs=0.08), pytest.approx(0.27, abs=0.08))  # without: -0.1 and 0.62
    assert np.abs(np.diff(offsets)).max() < 0.02
    assert offsets[-1] == 0.0
    assert (world.lateral_rate[row], world.drift[row]) == (0.0, 0.0)


@pytest.mark.parametrize(("body", "own"), [(CAR, 0.0), (BUS, 0.25)])
def test_car_and_bus_with_an_offset_of_its_own_do_not_swing(body: Body, own: float) -> None:
    world = world_of(corner())
    row = world.row(world.spawn(Kind.VEHICLE, body, name="npc", x=0.0, y=0.0, speed=5.0))
    keep_lane(world, row, 0, 42.0, lateral=own)
    _, offsets = drive(world, row, -1, 1.0)
    assert set(offsets.tolist()) == {own}


def test_swings_of_all_are_those_of_each_one() -> None:
    world = world_of(corner())
    longer = Body(12.0, 2.5, 3.2)
    places = [("a", 48.0, BUS), ("a", 49.5, longer), ("b", 0.5, BUS), ("b", 7.0, longer), ("c", 2.0, BUS)]
    rows = np.array([car(world, lane, s, speed=5.0, body=body) for lane, s, body in places])
    world.behind[rows] = [-1, -1, 0, -1, 1]
    distance = np.array([0.5, 0.4, 0.0, 0.3, 0.5])
    alone = World()
    alone.restore(world.snapshot())
    plan_swings(world, rows, distance, 0.1)
    for i in range(len(rows)):
        plan_swings(alone, rows[[i]], distance[[i]], 0.1)
    assert world.digest() == alone.digest()
    assert np.count_nonzero(world.lateral_rate[rows]) >= 3


def test_snapshot_in_the_middle_of_a_swing_goes_on_with_the_same_bits() -> None:
    world = world_of(corner())
    row = car(world, "a", 46.0, speed=5.0, body=BUS)
    for _ in range(13):
        step(world)
    assert world.lateral[row] < 0.0
    restored = World()
    restored.restore(world.snapshot())
    for _ in range(20):
        step(world)
        step(restored)
    assert restored.digest() == world.digest()


def in_a_ring(radius: float, side: int, body: Body, lane: str = "a") -> tuple[World, int]:
    """A vehicle in the middle of a half circle, to the left with side 1, that one comes to from another one."""
    halves = [arc(0, 0, radius, start, side * 180) for start in (0, 180)]
    world = world_of(make(a=(halves[0], "b", 10.0), b=(halves[1], "a", 10.0)))
    row = car(world, lane, 1.6 * radius, speed=5.0, body=body)
    return world, row


def wanted_offset(radius: float, side: int, body: Body) -> float:
    """The offset of a vehicle with both axles on a circle, from the places of its corners and of its middle."""
    half, centre = 0.5 * body.length, 0.5 * body.length - body.rear_overhang
    middle = complex(0.5 * body.wheelbase, side * np.sqrt(radius**2 - (0.5 * body.wheelbase) ** 2))  # of the circle
    places = [
        complex(along, across)
        for along in (centre - half, 0.5 * body.wheelbase, centre + half)
        for across in (0.5 * body.width, -0.5 * body.width)
    ]
    lateral = [side * (radius - abs(place - middle)) for place in places]
    left, right = max(lateral) - HALF_LANE + 0.1, -min(lateral) - HALF_LANE + 0.1
    if (
        left > right
    ):  # out of the lane on the left, or more so: to the right until it is within, or as far on both sides
        return -min(max(left, 0.0), 0.5 * (left - right), 1.0)
    return min(max(right, 0.0), 0.5 * (right - left), 1.0)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("radius", [8.75, 12.0, 20.0, 40.0, 59.0])
@pytest.mark.parametrize("body", [BUS, Body(12.0, 2.5, 3.2), Body(9.0, 2.0, 3.2, wheelbase=5.5)])
def test_offset_of_a_long_vehicle_brings_its_corners_and_its_middle_into_the_lane(
    body: Body, radius: float, side: int
) -> None:
    for lane, behind in (("a", -1), ("a", 1), ("b", 0)):  # it begins here, or has come from the other half
        world, row = in_a_ring(radius, side, body, lane)
        world.drift[row], world.behind[row] = 0.03, behind
        plan_swings(world, np.array([row]), np.array([100.0]), 0.1)
        assert world.lateral_rate[row] * 0.1 == pytest.approx(wanted_offset(radius, side, body), abs=0.03)
        assert world.drift_rate[row] == pytest.approx(-0.3)


def test_long_vehicle_moves_to_the_side_by_a_tenth_of_its_way_and_not_while_it_stands() -> None:
    wanted = wanted_offset(8.75, -1, BUS)
    for now, distance in [(0.0, 1.0), (0.0, 2.0), (1.5, 0.5), (0.0, 0.0)]:
        world, row = in_a_ring(8.75, -1, BUS)
        world.lateral[row], world.drift[row] = now, 1e-10
        plan_swings(world, np.array([row]), np.array([distance]), 0.1)
        assert world.lateral_rate[row] * 0.1 == pytest.approx(np.sign(wanted - now) * 0.1 * distance, abs=1e-9)
        assert (world.drift[row], world.drift_rate[row]) == (0.0, 0.0)


@pytest.mark.parametrize(("now", "then", "rate"), [(1e-10, 0.0, 0.0), (0.02, 0.02, -0.2), (0.2, 0.2, -0.5)])
def test_long_vehicle_behind_a_bend_comes_back_to_the_line_and_is_on_it_to_the_last_bit(
    now: float, then: float, rate: float
) -> None:
    world = world_of(corner())
    row = car(world, "a", 20.0, speed=5.0, body=BUS)
    world.lateral[row] = now
    plan_swings(world, np.array([row]), np.array([0.5]), 0.1)
    assert (world.lateral[row], world.lateral_rate[row]) == (then, pytest.approx(rate))


@pytest.mark.parametrize(
    ("length", "bias", "kind", "swings"),
    [(7.5, 0.0, Kind.VEHICLE, True), (6.5, 0.0, Kind.VEHICLE, False), (7.5, 0.2, Kind.VEHICLE, False)],
)
def test_vehicles_of_more_than_seven_metres_without_an_offset_of_their_own_swing(
    length: float, bias: float, kind: Kind, *, swings: bool
) -> None:
    world = world_of(corner())
    row = car(world, "a", 30.0, body=Body(length, 2.5, 3.2))
    world.kind[row], world.lateral_bias[row] = kind, bias
    assert find_long(world, np.array([row])).tolist() == [0] * swings


def test_long_vehicle_swings_from_two_lanes_before_a_bend_to_one_after_it_but_not_in_a_lane_change() -> None:
    lanes = {name: (line((50.0 * i, 0), (50.0 * i + 50.0, 0)), "abcdefgh"[i + 1]) for i, name in enumerate("abcd")}
    lanes["e"] = arc(200, 8.75, 8.75, -90, 90), "f"
    for i, name in enumerate("fgh"):
        lanes[name] = line((208.75, 8.75 + 50 * i), (208.75, 58.75 + 50 * i)), "gh "[i].strip()
    world = world_of(make(**lanes))
    rows = np.array([car(world, name, 10.0, body=BUS) for name in "abcdefg"])
    world.behind[rows] = [-1, 0, 1, 2, 3, 4, 5]
    assert find_swinging(world, rows).tolist() == [2, 3, 4, 5]
    world.lateral_left[rows[2]], world.leaving[rows[3]] = 0.5, 1
    world.lateral[rows[0]], world.lateral_rate[rows[6]] = 0.1, 0.1
    assert find_swinging(world, rows).tolist() == [0, 4, 5, 6]


def test_long_vehicle_swings_in_the_first_lane_of_a_map_if_that_is_the_bend() -> None:
    world = world_of(make(a=(arc(0, 8.75, 8.75, -90, 90), "b"), b=(line((8.75, 8.75), (8.75, 100)), "")))
    rows = np.array([car(world, name, s, body=BUS) for name, s in (("a", 5.0), ("b", 3.0), ("b", 50.0))])
    world.behind[rows] = [-1, 0, -1]
    assert find_swinging(world, rows).tolist() == [0, 1]


def test_vehicle_whose_offset_is_not_worked_out_wants_none_on_either_side_of_a_bend() -> None:
    world = world_of(corner())
    wide = Body(BUS.length, 3.4, BUS.wheelbase)
    places = [(lane, s, body) for lane in "ac" for s in np.arange(0.5, 49.0, 1.5) for body in (BUS, wide)]
    rows = np.array([car(world, lane, s, speed=5.0, body=body) for lane, s, body in places])
    distance = np.full(len(rows), 0.5)
    wants = lane_swing._offsets(world, rows, distance) != 0.0
    is_bent = np.isin(np.arange(len(rows)), lane_swing._find_bent(world, rows, distance))
    assert not (wants & ~is_bent).any()
    assert is_bent[1::2].all()  # wider than the lane
    assert wants.any()
    assert np.count_nonzero(~is_bent) > 20


def test_plan_is_left_out_only_where_it_would_change_nothing() -> None:
    world = world_of(corner())
    places = [(lane, s) for lane in "ac" for s in np.arange(0.5, 49.0, 3.0)]
    rows = np.array([car(world, lane, s, speed=5.0, body=BUS) for lane, s in places])
    distance = np.where(np.arange(len(rows)) % 3, 0.5, 0.0)
    left_out = []
    for _ in range(2):  # the first plan changes the bits of all that drive
        for i in range(len(rows)):
            row, way, before = rows[[i]], distance[[i]], world.digest()
            left_out.append(are_straight(world, row, way))
            plan_swings(world, row, way, 0.1)
            assert world.digest() == before or not left_out[-1]
    first, second = np.array(left_out).reshape(2, -1)
    assert not (first & (distance > 0.0)).any()
    assert 20 < np.count_nonzero(second) < len(rows)
    assert are_straight(world, rows[second], distance[second])
    for column in ("lateral", "lateral_rate", "drift", "drift_rate", "lateral_from", "lateral_to"):
        kept = getattr(world, column)[rows]
        getattr(world, column)[rows] = 1e-300
        assert not are_straight(world, rows[second], distance[second])
        getattr(world, column)[rows] = kept

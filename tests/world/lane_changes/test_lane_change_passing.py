"""Clearance of lane changes: whoever moves over passes what stands askew in the lane that it leaves."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from rosbridge_sim.records import replace
from rosbridge_sim.world.lane_changes import lane_change_passing
from rosbridge_sim.world.lane_changes.lane_change_passing import Shifts, find_blocked, is_clear
from rosbridge_sim.world.roads.lane_change_map import LEFT, RIGHT
from rosbridge_sim.world.state.world import Body, World
from tests.world.lane_drives import BUS, world_of
from tests.world.road_factory import CAR, car, ego
from tests.world.wide_roads import wide_road


def is_clear_of_an_ego(beside: float, course: float = 0.0) -> bool:
    """Return whether a driver that moves over to the right passes an ego that stands 13 m ahead and to the side."""
    world = world_of(wide_road(2))
    row = car(world, "l0", 137.0, speed=8.0)
    world.yaw[row] = course
    place = complex(world.x[row], world.y[row]) + complex(13.0, beside) * cmath.rect(1.0, course)
    standing = ego(world, place.real, place.imag, yaw=course)
    nose = world.half_length[row] + world.centre[row]
    shifts = Shifts(
        rows=np.array([row]),
        nose=np.array([nose]),
        length=np.array([2.0 * world.half_length[row]]),
        side=np.array([RIGHT]),
        done=np.array([0.25]),
        across=np.array([3.5]),
        gap=np.array([13.0 + world.centre[standing] - world.half_length[standing] - nose]),
        lead_speed=np.zeros(1),
        is_tight=np.array([False]),
        change_time=np.array([4.4]),
    )
    return bool(is_clear(world, shifts, np.array([8.0])).item())


@pytest.mark.parametrize(("beside", "clear"), [(0.0, True), (0.85, True), (-0.85, False)])
def test_driver_that_moves_over_keeps_off_what_stands_askew(beside: float, *, clear: bool) -> None:
    assert is_clear_of_an_ego(beside) == clear


@pytest.mark.parametrize("course", [0.0, math.pi])
def test_driver_beyond_the_greatest_number_of_pairs_takes_what_is_ahead_for_a_usual_car(
    course: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not is_clear_of_an_ego(-0.85, course)
    monkeypatch.setattr(lane_change_passing, "MAX_PAIRS", 0)
    assert is_clear_of_an_ego(-0.85, course)


@pytest.mark.parametrize(
    ("done", "standing_at", "stops_at"),
    # The change takes 13.3 m at 4 m/s, so the driver is in the new lane before it comes to the second car at 144 m.
    [(0.39, 144.0, "nothing"), (0.39, 137.0, "second"), (0.1, 144.0, "first")],
)
def test_what_stands_beyond_the_lead_vehicle_counts_where_the_driver_comes_to_it(
    done: float, standing_at: float, stops_at: str
) -> None:
    world = world_of(wide_road(2))
    row = car(world, "l0", 126.0, speed=4.0)
    lead = car(world, "l0", 134.0)
    # It stands across both lanes, as one that has stopped while it changed lanes.
    askew = ego(world, standing_at, -0.8, yaw=-0.55)
    nose = world.half_length[row] + world.centre[row]
    first = world.x[lead] + world.centre[lead] - world.half_length[lead] - world.x[row] - nose
    half = world.half_length[askew] * np.cos(0.55) + world.half_width[askew] * np.sin(0.55)
    second = world.x[askew] + world.centre[askew] * np.cos(0.55) - half - world.x[row] - nose
    shifts = Shifts(
        rows=np.array([row]),
        nose=np.array([nose]),
        length=np.array([2.0 * world.half_length[row]]),
        side=np.array([RIGHT]),
        done=np.array([done]),
        across=np.array([3.5]),
        gap=np.array([first]),
        lead_speed=np.zeros(1),
        is_tight=np.array([False]),
        change_time=np.array([3.9]),
    )
    gap = {"nothing": np.inf, "first": first, "second": second}[stops_at]
    assert find_blocked(world, shifts, np.array([4.0])) == pytest.approx([gap])


@pytest.mark.parametrize("side", [LEFT, RIGHT])
@pytest.mark.parametrize(
    ("body", "is_tight", "least"), [(CAR, True, 1.95), (CAR, False, 3.2), (BUS, True, 4.3), (BUS, False, 9.75)]
)
def test_vehicle_at_rest_comes_out_from_behind_another_one_by_the_gap_that_its_steering_needs(
    body: Body, side: int, least: float, *, is_tight: bool
) -> None:
    """With its wheels at full lock, or in an easy turn."""
    found = []
    for gap in (-6.0, least - 0.1, least + 0.1, 3.0 * least):
        world = world_of(wide_road(2))
        row = car(world, "l1" if side == LEFT else "l0", 100.0, body=body)
        nose = world.half_length[[row]] + world.centre[[row]]
        ego(world, 100.0 + nose.item() + gap + CAR.rear_overhang, float(world.y[row]))
        shifts = Shifts(
            rows=np.array([row]),
            nose=nose,
            length=2.0 * world.half_length[[row]],
            side=np.array([side]),
            done=np.zeros(1),
            across=np.array([3.5]),
            gap=np.array([gap]),
            lead_speed=np.zeros(1),
            is_tight=np.array([is_tight]),
            change_time=np.array([4.4]),
        )
        found.append(is_clear(world, shifts, np.zeros(1)).item())
    assert found == [False, False, True, True]


def test_driver_that_moves_over_slowly_needs_a_longer_gap() -> None:
    world = world_of(wide_road(2))
    row = car(world, "l0", 100.0, speed=20.0)
    gaps = np.arange(5.0, 60.0, 0.5)
    num = len(gaps)
    shifts = Shifts(
        rows=np.full(num, row),
        nose=np.full(num, 3.7),
        length=np.full(num, 4.5),
        side=np.full(num, RIGHT),
        done=np.zeros(num),
        across=np.full(num, 3.5),
        gap=gaps,
        lead_speed=np.full(num, 10.0),
        is_tight=np.zeros(num, dtype=bool),
        change_time=np.full(num, 3.3),
    )
    least = [
        gaps[is_clear(world, replace(shifts, change_time=np.full(num, time)), np.full(num, 20.0))].min()
        for time in (3.3, 5.0)
    ]
    # Both come beside the lead vehicle after the same share of the way across.
    assert least[1] / least[0] == pytest.approx(5.0 / 3.3, rel=0.06)


def things_ahead(world: World, row: int, side: int, nose: float, across: float) -> list[tuple[float, float]]:
    """What is near a vehicle in the lane that it leaves: how far to the side it must come, and how far ahead it is."""
    course = float(world.yaw[row] - world.drift[row])
    sign = 1.0 if side == LEFT else -1.0
    moved = float(world.lateral[row] - world.lateral_from[row]) if world.leaving[row] else 0.0
    found = []
    for other in range(world.n):
        offset = complex(world.x[other] - world.x[row], world.y[other] - world.y[row])
        if other == row or not world.alive[other] or abs(offset.real) + abs(offset.imag) >= 20.0:
            continue
        middle = (offset + cmath.rect(float(world.centre[other]), float(world.yaw[other]))) * cmath.rect(1.0, -course)
        turn = float(world.yaw[other]) - course
        half_length, half_width = float(world.half_length[other]), float(world.half_width[other])
        half_along = abs(math.cos(turn)) * half_length + abs(math.sin(turn)) * half_width
        half_across = abs(math.sin(turn)) * half_length + abs(math.cos(turn)) * half_width
        aside = sign * (middle.imag + moved)
        if middle.real > 0.0 and middle.real + half_along > nose and abs(aside) < 0.5 * across:
            found.append((aside + half_across + 0.15, middle.real - half_along - nose))
    return found


def blocked_at(world: World, shifts: Shifts, i: int, speed: float) -> float:
    """The gap from one vehicle to the first thing that it would touch."""
    row, side, is_tight = int(shifts.rows[i]), int(shifts.side[i]), bool(shifts.is_tight[i])
    gap, across = float(shifts.gap[i]), float(shifts.across[i])
    nose, length, lead = float(shifts.nose[i]), float(shifts.length[i]), float(shifts.lead_speed[i])
    if math.isinf(gap):
        return math.inf
    speed, bend = max(speed, 0.1), 0.0
    part = math.sqrt(min(across / 3.5, 1.0))
    if is_tight:
        bend, radius = 20.0 / 3.0 * across, float(world.wheelbase[row]) / math.tan(math.radians(36.25))
        way = max(math.sqrt(bend * radius), 1.8 * 2.0 * float(world.half_length[row]) * part)
    else:
        seconds = min(max(float(shifts.change_time[i]) * (1.0 + 0.009 * (speed - 20.0)), 3.0), 6.0)
        way = max((10.0 + 2.5 * max(length - 4.5, 0.0)) * part, seconds * speed)
    driven = max(gap, 0.0) * speed / (speed - lead) if speed > lead else math.inf

    def passes_at(p: float, distance: float) -> float:
        slope = (across * 30.0 * (p * (1.0 - p)) ** 2 + bend * (p - 4.5 * p**2 + 6.0 * p**3 - 2.5 * p**4)) / way
        reach = max(nose + min(distance, 0.0), 0.0) if is_tight else nose
        aside = across * (10.0 * p**3 - 15.0 * p**4 + 6.0 * p**5) + bend * (p**2 - 3.0 * p**3 + 3.0 * p**4 - p**5) / 2.0
        return aside + reach * math.sin(math.atan(slope)) - float(world.half_width[row])

    is_seen = gap < 20.0 and (is_tight or lead < 0.5)
    things = things_ahead(world, row, side, nose, across) if is_seen else []
    done = float(shifts.done[i])
    blocked = math.inf
    if not (is_tight and things) and passes_at(min(done + driven / way, 1.0), gap) <= 1.4:
        blocked = gap  # a usual car in the middle of its lane
    for edge, tail in things:
        if tail <= gap + 1.0:
            if passes_at(min(done + driven / way, 1.0), gap) <= edge:
                blocked = min(blocked, gap)
            continue
        share = done + max(tail, driven) / way
        if share < 1.0 and passes_at(share, tail) <= edge:
            blocked = min(blocked, tail)
    return blocked


@pytest.mark.parametrize("seed", range(30))
def test_many_vehicles_find_what_they_would_touch_as_one_by_one(seed: int) -> None:
    rng, num = np.random.default_rng(seed), 12
    world = world_of(wide_road(3))
    bodies = rng.choice(2, num)
    rows = np.array(
        [
            car(world, f"l{rng.integers(0, 3)}", rng.uniform(50.0, 110.0), body=BUS if is_bus else CAR)
            for is_bus in bodies.tolist()
        ]
    )
    for _ in range(4):
        ego(world, rng.uniform(50.0, 110.0), rng.uniform(-9.0, 2.0), yaw=rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
    world.remove(int(world.uid[rows[0]]))
    rows = rows[1:]
    num = len(rows)
    world.yaw[rows] += rng.uniform(-0.3, 0.3, num)
    world.drift[rows] = rng.choice([0.0, 1.0], num) * rng.uniform(-0.3, 0.3, num)
    world.leaving[rows] = rng.choice(3, num)
    world.lateral[rows], world.lateral_from[rows] = rng.uniform(-3.0, 3.0, (2, num))
    half, centre = world.half_length[rows], world.centre[rows]
    shifts = Shifts(
        rows=rows,
        nose=half + centre,
        length=2.0 * half,
        side=rng.choice([LEFT, RIGHT], num),
        done=rng.choice([0.0, 1.0], num) * rng.uniform(0.0, 1.0, num),
        across=rng.choice([3.5, 3.5, 2.0, 4.0], num),
        gap=rng.choice([*rng.uniform(-9.0, 3.0, 2), *rng.uniform(-3.0, 25.0, 4), 60.0, np.inf], num),
        lead_speed=rng.choice([0.0, 0.4, 0.6, 5.0], num),
        is_tight=rng.random(num) < 0.4,
        change_time=rng.uniform(2.5, 6.5, num),
    )
    for i in range(0, num, 2):  # behind the nearest of the things there
        nearby = things_ahead(world, int(rows[i]), int(shifts.side[i]), float(shifts.nose[i]), float(shifts.across[i]))
        if nearby:
            shifts.gap[i] = min(tail for _, tail in nearby) - rng.uniform(-0.5, 2.5)
    speed = rng.choice([0.0, 0.5, 1.0], num) * rng.uniform(0.0, 20.0, num)
    expected = [blocked_at(world, shifts, i, value) for i, value in enumerate(speed.tolist())]
    assert find_blocked(world, shifts, speed) == pytest.approx(np.array(expected))
    assert is_clear(world, shifts, speed).tolist() == [math.isinf(gap) for gap in expected]

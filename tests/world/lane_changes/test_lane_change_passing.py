"""Clearance of lane changes: whoever moves over passes what stands askew in the lane that it leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rosbridge_sim.world.lane_changes.lane_change_passing import Shifts, find_blocked, is_clear
from rosbridge_sim.world.roads.lane_change_map import RIGHT
from tests.world.lane_drives import world_of
from tests.world.road_factory import car, ego
from tests.world.wide_roads import wide_road


@pytest.mark.parametrize(("beside", "clear"), [(0.0, True), (0.85, True), (-0.85, False)])
def test_driver_that_moves_over_keeps_off_what_stands_askew(beside: float, *, clear: bool) -> None:
    world = world_of(wide_road(2))
    row = car(world, "l0", 137.0, speed=8.0)
    standing = ego(world, 150.0, beside)
    nose = world.half_length[row] + world.centre[row]
    tail = world.x[standing] + world.centre[standing] - world.half_length[standing]
    shifts = Shifts(
        rows=np.array([row]),
        nose=np.array([nose]),
        length=np.array([2.0 * world.half_length[row]]),
        side=np.array([RIGHT]),
        done=np.array([0.25]),
        across=np.array([3.5]),
        gap=np.array([tail - world.x[row] - nose]),
        lead_speed=np.zeros(1),
        is_tight=np.array([False]),
        change_time=np.array([4.4]),
    )
    assert is_clear(world, shifts, np.array([8.0])).tolist() == [clear]


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

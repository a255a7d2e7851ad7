"""Clearance of lane changes: whoever moves over passes what stands askew in the lane that it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.lane_changes.lane_change_clearance import Shifts, is_clear
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
    )
    assert is_clear(world, shifts, np.array([8.0])).tolist() == [clear]

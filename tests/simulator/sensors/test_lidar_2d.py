"""Figures of the messages of 2D lidars."""

from __future__ import annotations

import math

import pytest

from tests.simulator.sensor_rigs.test_mounted_sensors import SCAN, in_sync


def test_scan_tells_its_angles_its_times_and_its_ranges() -> None:
    spec = SCAN.changed(num_values=40, ahead=10, rate=25.0, min_range=0.5, max_range=90.0)
    _, client = in_sync(spec)
    client.listen("/lidar2D")
    client.tick()
    client.tick()
    (scan,) = client.messages("/lidar2D")
    step = math.radians(9.0)
    names = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
    assert [scan[name] for name in names] == pytest.approx(
        [-10 * step, 29 * step, step, 0.04 / 40, 0.04, 0.5, 90.0], rel=1e-6
    )
    assert len(scan["ranges"]) == len(scan["intensities"]) == 40
    found = [value for value in scan["ranges"] if value is not None]
    assert found
    assert all(0.5 <= value <= 90.0 for value in found)
    assert [value is None for value in scan["ranges"]] == [value == 0.0 for value in scan["intensities"]]
    assert spec.cost == (0, 40, 0)

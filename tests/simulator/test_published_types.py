"""Types of all topics: nothing publishes or takes what is not simulated."""

from __future__ import annotations

import re

import pytest

from tests.simulator.sim_harness import SimHarness

PICTURES_AND_SCANS = (
    "sensor_msgs/Image",
    "sensor_msgs/CompressedImage",
    "sensor_msgs/PointCloud2",
    "sensor_msgs/LaserScan",
    "sensor_msgs/Range",
    "morai_msgs/RadarDetections",
)

OTHER_MACHINES = re.compile(r"Dd|Skid|Ship|Robot|Trailer|WheelControl")
"""Parts of the names of messages for trailers, differential drives, ships and robots."""


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_nothing_publishes_pictures_scans_or_states_of_other_machines(release: str) -> None:
    bus = SimHarness(start="sync", release=release).bus
    assert {bus.store.message(name).name for name in PICTURES_AND_SCANS} == set(PICTURES_AND_SCANS), "they are known"
    assert bus.store.message("morai_msgs/DdCtrlCmd")
    types = {topic.type.name for topic in bus.topics.values()}
    assert "morai_msgs/EgoVehicleStatus" in types or "morai_msgs/EgoVehicleStatusExtended" in types
    assert not types & set(PICTURES_AND_SCANS)
    assert not [name for name in types if OTHER_MACHINES.search(name)]

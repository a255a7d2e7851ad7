"""The table of the kinds of sensors."""

from __future__ import annotations

from collections import Counter

import pytest

from rosbridge_sim.simulator.sensors.sensor_presets import read_rig_text, rig_schema, text_of
from rosbridge_sim.simulator.sensors.sensor_specs import SensorSpec
from rosbridge_sim.simulator.sensors.sensor_table import KINDS, SENSOR_FRAMES, check_rig, complete


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)
def test_file_of_each_kind_is_read_and_written(kind: type[SensorSpec]) -> None:
    spec = kind().changed(x=1.0, pitch=5.0)
    assert read_rig_text(text_of(spec), "x") == (spec,)
    assert kind.kind in rig_schema()["properties"]


def test_an_ego_can_have_one_of_each_kind() -> None:
    rig = complete(tuple(kind() for kind in KINDS))
    check_rig(rig)
    assert tuple(spec.frame_id for spec in rig[:2]) == SENSOR_FRAMES == ("gps_link", "imu_link")
    assert max(Counter(name for spec in rig for name, _ in spec.topics).values()) == 1

"""The table of the kinds of sensors."""

from __future__ import annotations

from collections import Counter

import pytest

from rosbridge_sim.documents.document_model import fields_of
from rosbridge_sim.errors import FieldError
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import SENSOR_FILE, read_rig_text, text_of
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.radar import RadarSpec
from rosbridge_sim.simulator.sensors.sensor_specs import MAX_RAYS, SensorSpec
from rosbridge_sim.simulator.sensors.sensor_table import KINDS, SENSOR_FRAMES, check_rig, complete


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)
def test_file_of_each_kind_is_read_and_written(kind: type[SensorSpec]) -> None:
    spec = kind().changed(x=1.0, pitch=5.0)
    assert read_rig_text(text_of(spec), "x") == (spec,)
    assert kind.kind in fields_of(SENSOR_FILE.form)


def test_an_ego_can_have_one_of_each_kind() -> None:
    rig = complete(tuple(kind() for kind in KINDS))
    check_rig(rig)
    assert tuple(spec.frame_id for spec in rig[:2]) == SENSOR_FRAMES == ("gps_link", "imu_link")
    assert max(Counter(name for spec in rig for name, _ in spec.topics).values()) == 1


def cameras(*sizes: tuple[int, int], raw: bool = False) -> list[SensorSpec]:
    encoding = "raw" if raw else "jpeg"
    return [
        CameraSpec(frame_id=f"c{i}", width=width, height=height, encoding=encoding)  # type: ignore[arg-type]
        for i, (width, height) in enumerate(sizes)
    ]


@pytest.mark.parametrize(
    ("rig", "text"),
    [
        (cameras((3840, 2160)), ""),
        (cameras((3840, 1080), (3840, 1080)), ""),
        (cameras((3840, 2160), (1, 1)), "cameras: expected at most 8,294,400 pixels for all of an ego, got 8,294,401"),
        (cameras((2000, 2000), raw=True), ""),
        (cameras((2000, 2000), (1, 1), raw=True), "expected at most 12,000,000 bytes .* got 12,000,003"),
        ([RadarSpec(frame_id=f"r{i}", topic=f"/r{i}") for i in range(32)], ""),
        ([RadarSpec(frame_id=f"r{i}", topic=f"/r{i}") for i in range(33)], "expected at most 32 for an ego, got 33"),
        (cameras((1, 1), (1, 1)), ""),  # several cameras may share a topic
        ([*cameras((1, 1)), *cameras((1, 1))], "frame_id: expected different names, got c0 2 times"),
        ([CameraSpec(), RadarSpec(frame_id="r", topic=CameraSpec().topic)], "r: topic .* as another sensor has"),
    ],
)
def test_sensors_of_an_ego_have_limits_together(rig: list[SensorSpec], text: str) -> None:
    if not text:
        check_rig(complete(tuple(rig)))
        return
    with pytest.raises(FieldError, match=text):
        check_rig(complete(tuple(rig)))


def test_rays_of_all_lidars_have_a_limit_together() -> None:
    rig = [Lidar3dSpec(frame_id=f"l{i}", topic=f"/l{i}", columns=2000) for i in range(16)]
    num = sum(spec.cost.num_rays for spec in rig)
    assert num > MAX_RAYS
    with pytest.raises(
        FieldError, match=f"lidars: expected at most 500,000 rays a turn for all of an ego, got {num:,}"
    ):
        check_rig(rig)
    check_rig(rig[: MAX_RAYS // rig[0].cost.num_rays])

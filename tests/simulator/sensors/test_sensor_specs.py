from __future__ import annotations

import math
from itertools import pairwise

import pytest

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.simulator.bus.publisher_kinds import PeriodicPublisher, is_due
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import PRESETS, read_rig
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.lidar_2d import Lidar2dSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.picture_sensor import model_of
from rosbridge_sim.simulator.sensors.radar import RadarSpec
from rosbridge_sim.simulator.sensors.sensor_specs import SensorSpec
from rosbridge_sim.simulator.sensors.sensor_table import check_rig


@pytest.mark.parametrize("name", PRESETS)
def test_an_ego_can_have_each_preset(name: str) -> None:
    check_rig(PRESETS[name])


def test_lane_detection_preset_is_ninety_degrees_high() -> None:
    (camera,) = PRESETS["lane-detection"]
    assert isinstance(camera, CameraSpec)
    assert (camera.width, camera.height) == (640, 480)
    assert camera.fov == pytest.approx(106.26, abs=0.005)
    assert model_of(camera).focal == pytest.approx(240.0)
    assert camera.mounting.place == (1.8, 0.0, 2.0)
    assert math.degrees(camera.mounting.pitch) == pytest.approx(7.0)


def test_calibration_preset_is_level() -> None:
    camera, lidar = PRESETS["calibration"]
    assert isinstance(camera, CameraSpec)
    assert model_of(camera).focal == pytest.approx(320.0)
    assert (camera.mounting.place, camera.mounting.pitch) == ((1.8, 0.0, 2.0), 0.0)
    assert (lidar.mounting.place, lidar.mounting.pitch) == ((2.0, 0.0, 1.25), 0.0)


def test_teaching_preset_has_the_mounting_of_the_lane_programs() -> None:
    camera, lidar = PRESETS["teaching"]
    assert isinstance(camera, CameraSpec)
    assert (camera.width, camera.height, camera.fov) == (640, 480, 90.0)
    assert camera.mounting.place == (1.8, 0.0, 2.0)
    assert math.degrees(camera.mounting.pitch) == pytest.approx(7.0)
    assert lidar.mounting.place == (2.0, 0.0, 1.28)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("fov", 0),
        ("fov", 180),
        ("width", 0),
        ("width", 8193),
        ("rate", 1000),
        ("rate", 0),
        ("x", math.nan),
        ("pitch", math.inf),
        ("z", 101),
        ("quality", 0),
        ("topic", "image jpeg"),
        ("topic", "image"),
        ("topic", "/"),
        ("frame_id", ""),
        ("frame_id", "/Camera"),
        ("frame_id", "base_link"),
        ("frame_id", "imu_link"),
        ("frame_id", "rear_left_wheel"),
        ("picture", "photo"),
        ("distortion", (1.0,)),
        ("distortion", (math.nan, 0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_camera_beyond_a_bound_is_refused(field: str, value: object) -> None:
    with pytest.raises(DocumentError, match=rf"^x: camera\[0\]\.{field}"):
        read_rig({"camera": [{field: value}]}, "x")


def test_error_names_the_reserved_frames() -> None:
    with pytest.raises(DocumentError, match=r"frame_id: expected .* own frames base_link, .*, odom, .*, got 'odom'$"):
        read_rig({"camera": [{"frame_id": "odom"}]}, "x")


@pytest.mark.parametrize(
    ("rig", "text"),
    [
        ([CameraSpec(frame_id=f"c{i}", width=8, height=8) for i in range(33)], "at most 32 for an ego, got 33"),
        ([CameraSpec(width=8192, height=4320)], "at most 8,294,400 pixels for all of an ego, got 35,389,440"),
        ([Lidar3dSpec(model="own", elevations=tuple(range(64)), columns=20_000)], "at most 500,000 rays a turn"),
        ([CameraSpec(picture="depth", width=3840, height=2160)], "at most 12,000,000 bytes of raw pictures and points"),
        ([Lidar3dSpec(model="own")], "velodyne.elevations: expected angles for model 'own'"),
        ([Lidar3dSpec(elevations=(1.0,))], "velodyne.elevations: expected angles for model 'own', and none for any"),
        ([Lidar3dSpec(model="own", elevations=(1.0, 1.0))], "velodyne.elevations: expected angles that grow"),
        ([Lidar2dSpec(num_values=100)], "ahead: expected an index below num_values = 100, got 180"),
        ([Lidar2dSpec(min_range=30.0)], "min_range: expected less than max_range = 30, got 30"),
        ([CameraSpec(), CameraSpec()], "different names, got Camera 2 times"),
        ([CameraSpec(frame_id="a"), RadarSpec(frame_id="a_optical")], "different names, got a_optical 2 times"),
        (
            [CameraSpec(), Lidar3dSpec(topic="/image_jpeg/compressed")],
            "expected sensor_msgs/CompressedImage, as another",
        ),
    ],
)
def test_rig_beyond_a_bound_is_refused_with_the_limit(rig: list[SensorSpec], text: str) -> None:
    with pytest.raises(FieldError) as caught:
        check_rig(rig)
    assert text in str(caught.value)


def test_cameras_may_share_a_topic_under_different_frames() -> None:
    check_rig([CameraSpec(frame_id=f"Camera-{i}", width=1280, height=720, rate=20) for i in (1, 2, 3)])


def test_frames_of_30_hz_are_40_or_20_ms_apart() -> None:
    due = [frame for frame in range(1, 51) if is_due(30.0, frame)]
    assert due[:6] == [2, 4, 5, 7, 9, 10]
    assert len(due) == 30
    assert {after - before for before, after in pairwise(due)} == {1, 2}


@pytest.mark.parametrize("rate", [0.1, 5.0, 10.0, 15.0, 29.97, 30.0, 1.0 / 0.0333, 50.0])
def test_sensors_are_due_at_the_frames_of_a_topic_with_their_rate(rate: float) -> None:
    publisher = PeriodicPublisher("/x", "std_msgs/Empty", lambda: None, rate=rate)
    publisher.tune(rate)
    assert [is_due(rate, frame) for frame in range(1, 2000)] == [bool(publisher.num_due(i)) for i in range(1, 2000)]


def test_lidar_has_both_names() -> None:
    assert Lidar3dSpec().topics == [
        ("/lidar3D", "sensor_msgs/PointCloud2"),
        ("/velodyne_points", "sensor_msgs/PointCloud2"),
    ]
    assert Lidar3dSpec(topic="/front/points").topics == [("/front/points", "sensor_msgs/PointCloud2")]


def test_picture_that_is_no_colours_has_a_topic_of_its_own() -> None:
    assert CameraSpec(picture="depth").topic == "/image"
    assert CameraSpec(picture="instance", topic="/ids").topic == "/ids"
    assert CameraSpec(encoding="raw").topic == "/image_raw"
    assert CameraSpec(picture="depth").topics[0] == ("/image", "sensor_msgs/Image")


def test_camera_info_stands_beside_the_picture() -> None:
    assert CameraSpec(topic="/image_jpeg/compressed2").topics[1][0] == "/image_jpeg/camera_info"
    assert CameraSpec(topic="/front").topics[1][0] == "/front/camera_info"


def test_scan_is_bounded_since_its_ranges_are_text() -> None:
    with pytest.raises(DocumentError, match="num_values: expected at most 4,096, got 4097"):
        read_rig({"lidar2d": [{"num_values": 4097}]}, "x")


def test_largest_lidar_on_the_market_is_allowed() -> None:
    check_rig([Lidar3dSpec(model="OS1-128", columns=2048)])

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.sensor_rigs.morai_sensor_file import is_morai_file, read_morai_sensors
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.gps import GpsSpec
from rosbridge_sim.simulator.sensors.imu import ImuSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.morai_items import Block, Item, Reading


def item(block: str, number: int, kind: int, place: tuple[str, ...], **keys: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    """An entry as MORAI saves it: numbers as texts, and keys that nothing here reads."""
    x, y, z, roll, pitch, yaw = place
    ros = {"RosBridgeIP": "127.0.0.1", "RosBridgePort": "9090", "RosMessageOnOff": "True", "childFrameID": ""}
    return {
        "m_TargetUniqueID": "0",
        "m_SensorUniqueID": str(number),
        "m_SensorType": str(kind),
        "pos": {"x": x, "y": y, "z": z},
        "rot": {"roll": roll, "pitch": pitch, "yaw": yaw},
        block: {
            "commType": 3,
            "sensorPeriod": "0.1",
            **keys,
            "rosConfig": {**ros, "Topic": keys.get("Topic", ""), "frameID": keys.get("frameID", "")},
        },
    }


CAMERA = item(
    *("cc", 4, 1, ("1.530", "0.000", "1.400", "0.000", "355.000", "0.000")),
    sensorPeriod="0.0333",
    Topic="/image_jpeg/compressed",
    frameID="Camera-4",
    cameraFOV=70,
    focalLengthpixel=457.1,
    principalPoint={"x": 320, "y": 240},
    compressedRatio=90,
)
LIDAR = item(
    *("lc", 2, 2, ("1.700", "0.000", "1.250", "0.000", "0.000", "0.000")), commType=1, lidar3DType=0, fireDistance=100
)


def read(**lists: Any) -> tuple[tuple[Any, ...], list[str]]:  # noqa: ANN401 - JSON
    return read_morai_sensors(lists, "saved.json")


def test_camera_of_a_saved_preset() -> None:
    (camera,), remarks = read(cameraList=[CAMERA], Lidar3DList=[])
    assert camera == CameraSpec(
        frame_id="Camera-4", rate=30.0, x=1.53, z=1.4, pitch=-5.0, fov=70.0, quality=90, width=640, height=480
    )
    assert math.degrees(camera.mounting.pitch) == pytest.approx(-5.0)  # up: positive is down
    assert not remarks


def test_lidar_by_udp_publishes_its_usual_topic() -> None:
    (lidar,), remarks = read(Lidar3DList=[LIDAR])
    assert lidar == Lidar3dSpec(x=1.7, z=1.25, rate=10.0)
    assert remarks == ["velodyne: its packets over UDP are not served; it publishes /lidar3D"]


def test_principal_point_gives_the_size_in_each_form() -> None:
    for middle in ("640,360", [640, 360], {"x": "640", "y": "360"}):
        block = CAMERA["cc"] | {"principalPoint": middle}
        ((camera,), _) = read(cameraList=[CAMERA | {"cc": block}])
        assert (camera.width, camera.height) == (1280, 720)


@pytest.mark.parametrize(
    ("block", "size"),
    [
        ({}, (640, 480)),
        ({"cameraFOV": 90, "focalLengthpixel": 500.0}, (1000, 750)),
        ({"cameraFOV": 0.5, "focalLengthpixel": 100_000}, (873, 655)),
        ({"focalLengthpixel": None}, (640, 480)),
        ({"cameraFOV": 200.0}, (640, 480)),
        ({"cameraFOV": 0.0}, (640, 480)),
        ({"principalPoint": "640,0"}, (640, 480)),
        ({"principalPoint": [0, 360]}, (640, 480)),
        ({"principalPoint": "640"}, (640, 480)),
        ({"principalPoint": "wide,high"}, (640, 480)),
        ({"principalPoint": [1e999, 2]}, (640, 480)),
    ],
)
def test_focal_length_gives_the_width_without_a_principal_point(block: dict[str, Any], size: tuple[int, int]) -> None:
    item = Item(cc=msgspec.convert({"principalPoint": None, "cameraFOV": 70, "focalLengthpixel": 457.1} | block, Block))
    reading = Reading()
    found = CameraSpec().of_morai(item, reading)
    assert (found["width"], found["height"]) == size
    assert reading.remarks == [f"Camera: no principalPoint: the picture is {size[0]} x {size[1]}"]


@pytest.mark.parametrize(
    ("keys", "remark"),
    [
        ({"cameraType": 3}, "Camera-4: cameraType 3 is not known; it sees colours"),
        ({"sensorPeriod": "0.01"}, "Camera-4: 100 Hz is more than a world of 50 frames a second has; it is 50 Hz"),
        ({"sensorPeriod": "0.01999"}, None),  # 50.03 Hz
        ({"sensorPeriod": "0.0199"}, "Camera-4: 50.2513 Hz is more than a world of 50 frames"),
    ],
)
def test_value_that_is_not_taken_is_told(keys: dict[str, Any], remark: str | None) -> None:
    (_, remarks) = read(cameraList=[CAMERA | {"cc": CAMERA["cc"] | keys}])
    assert len(remarks) == (remark is not None)
    assert remark is None or remarks[0].startswith(remark)


def test_frame_that_stands_there_twice_gets_a_number() -> None:
    rig, remarks = read(cameraList=[CAMERA, CAMERA])
    assert [camera.frame_id for camera in rig] == ["Camera-4", "Camera-4-2"]
    assert "stands there twice" in remarks[0]


def test_gps_and_imu_get_their_places() -> None:
    gps = {"pos": {"x": "0.80", "z": "1.22"}, "rot": {"pitch": "355.0"}, "gc": {"sensorPeriod": "0.1"}}
    rig, remarks = read(GPSList=[gps, gps], IMUList=[{"pos": {"x": "2.55", "z": "0.47"}}])
    assert rig == (GpsSpec(x=0.8, z=1.22, pitch=-5.0), ImuSpec(x=2.55, z=0.47))
    assert remarks == [
        "an ego has one GPS: 1 left out",
        "the rate of the GPS is that of the settings: --rate /gps=10",
    ]


def test_what_is_not_simulated_becomes_a_remark() -> None:
    other = LIDAR | {"m_TargetUniqueID": "7"}
    _, remarks = read(cameraList=[CAMERA], Lidar3DList=[other], UltrasonicList=[{}])
    assert len(remarks) == 2
    assert "belongs to vehicle 7" in remarks[0]


@pytest.mark.parametrize(
    ("lists", "text"),
    [
        ({"cameraList": [CAMERA | {"pos": {"x": "abc"}}]}, "cameraList[0].pos.x: expected a number, got 'abc'"),
        ({"cameraList": [CAMERA | {"cc": CAMERA["cc"] | {"cameraFOV": 180}}]}, "camera[0].fov: expected at most 170"),
        ({"cameraList": []}, "expected sensors, got none"),
        ({"cameraList": 3}, "cameraList: expected a list"),
    ],
)
def test_mistake_is_told_with_its_place(lists: dict[str, Any], text: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read(**lists)
    assert str(caught.value).startswith("saved.json: ")
    assert text in str(caught.value)


def test_file_of_ours_is_no_preset_of_morai() -> None:
    assert is_morai_file({"cameraList": []})
    assert not is_morai_file({"camera": []})
    assert not is_morai_file([])

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.assembly import list_items
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.rig_file import read_sensors
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import PRESETS
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec

OURS = """
[[camera]]
frame_id = "Camera-1"
width = 1280
height = 720
pitch = 2

[[camera]]
frame_id = "Camera-2"
yaw = "70.0"

[[lidar3d]]
model = "own"
elevations = [-10, -5, 0]
"""


def write(folder: Path, text: str, name: str = "car.toml") -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def test_presets_are_known_by_name() -> None:
    assert read_sensors("none") == ()
    assert read_sensors("teaching") is PRESETS["teaching"]


def test_file_of_ours_is_read(tmp_path: Path) -> None:
    assert read_sensors(write(tmp_path, OURS)) == (
        CameraSpec(frame_id="Camera-1", width=1280, height=720, pitch=2),
        CameraSpec(frame_id="Camera-2", yaw=70),
        Lidar3dSpec(model="own", elevations=(-10, -5, 0)),
    )


def test_json_of_the_same_keys_is_read(tmp_path: Path) -> None:
    assert read_sensors(write(tmp_path, '{"lidar3d": [{}]}', "car.json")) == (Lidar3dSpec(),)


def test_preset_of_morai_is_read_with_its_remarks(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "rosbridge_sim.app")
    saved = {"Lidar3DList": [{"pos": {"x": "1.7", "y": "0", "z": "1.25"}, "lc": {"commType": 1}}]}
    assert read_sensors(write(tmp_path, json.dumps(saved), "saved.json")) == (Lidar3dSpec(x=1.7, z=1.25),)
    assert "packets over UDP are not served" in caplog.text


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ("[[camera]]\nfow = 3", "camera[0].fow: expected one of "),
        ("[[camera]]\nwidht = 3", "(did you mean width?)"),
        (
            "[[camer]]",
            "camer: expected one of gps, imu, camera, fisheye, lidar3d, lidar2d, radar (did you mean camera?)",
        ),
        ("[[camera]]\nfov = 180", "camera[0].fov: expected at most 170, got 180"),
        ("[[camera]]\nfov = nan", "camera[0].fov: "),
        ("[[camera]]\nrate = 1000", "camera[0].rate: expected at most 50, got 1000"),
        ("[[camera]]\nwidth = 2026-01-01", "camera[0].width: expected a number"),
        ("camera = 3", "camera: expected a list"),
        ("[[camera]]\n[[camera]]", "expected different names, got Camera 2 times"),
        ("[[camera", "not valid TOML"),
    ],
)
def test_mistake_is_told_with_place_and_expectation(tmp_path: Path, text: str, mistake: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_sensors(write(tmp_path, text))
    assert mistake in str(caught.value)
    assert "car.toml" in str(caught.value)


def test_wrong_name_is_refused_with_the_nearest() -> None:
    with pytest.raises(DocumentError, match=r"--sensors: expected none, camera, .*did you mean teaching"):
        read_sensors("teachin")


@pytest.mark.parametrize("text", ["[]", "{", "3"])
def test_json_of_something_else_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(DocumentError, match=r"car\.json"):
        read_sensors(write(tmp_path, text, "car.json"))


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"none\.json"):
        read_sensors(str(tmp_path / "none.json"))


def test_names_of_drawn_sensors_can_be_listed_where_nothing_can_be_drawn() -> None:
    names = {item.name for item in list_items(Settings(sensors="all"))}
    assert {"/image_jpeg/compressed", "/lidar3D", "/velodyne_points", "/lidar2D", "/radar", "/image"} <= names

"""Boxes as vision_msgs: all fields in both generations of ROS, in the optical frame of the camera."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import rotation
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.simulator.sensor_data.visible_boxes import VisibleBox
from rosbridge_sim.simulator.sensor_data.vision_messages import (
    DETECTIONS_2D,
    DETECTIONS_3D,
    VisionMessages,
    _orientation,
    optical,
)
from tests.schema.strategies import shared_store

SEEN = VisibleBox(
    uid=7,
    label=2,
    bounds=[10.0, 20.0, 40.0, 100.0],
    visibility=0.5,
    centre=[8.0, 1.0, 0.5],
    size=[4.0, 2.0, 1.5],
    axes=([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
)
POSE = {"position": {"x": -1.0, "y": -0.5, "z": 8.0}, "orientation": {"x": 0.5, "y": -0.5, "z": 0.5, "w": 0.5}}
UNCERTAIN = {"pose": POSE, "covariance": [0.0] * 36}


def turned(quaternion: tuple[float, ...], vector: np.ndarray) -> np.ndarray:
    """Rotate a vector as Hamilton has it: q v q*."""
    x, y, z, w = quaternion
    axis = np.array([x, y, z])
    return np.asarray(vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector))


ANGLES = [tuple(angles) for angles in np.random.default_rng(4).uniform(-np.pi, np.pi, (40, 3)).tolist()]
HALF_TURNS = [(np.pi, 0.0, 0.0), (0.0, np.pi, 0.0), (0.0, 0.0, np.pi), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize("angles", [*HALF_TURNS, *ANGLES])
def test_quaternion_turns_the_axes_of_a_box_into_the_optical_frame(angles: tuple[float, float, float]) -> None:
    axes = rotation(*angles).T  # forward, left and up of the box, in the axes of the camera
    found = _orientation((axes[0].tolist(), axes[2].tolist()))
    assert np.linalg.norm(found) == pytest.approx(1.0)
    for unit, axis in zip(np.eye(3), axes, strict=True):
        assert turned(found, unit) == pytest.approx(np.array(optical(axis.tolist())), abs=1e-9)


def test_optical_frame_looks_along_z_with_x_to_the_right() -> None:
    assert [optical(unit) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))] == [
        (0.0, 0.0, 1.0),
        (-1.0, 0.0, 0.0),
        (0.0, -1.0, 0.0),
    ]


def detections_of(ros: Generation, type_name: str, *boxes: VisibleBox) -> Any:  # noqa: ANN401 - JSON
    """Header, and detections as JSON has them."""
    store = shared_store(ros)
    header: Any = store.message("std_msgs/Header").struct_type()
    header.frame_id = "camera"
    message = VisionMessages(store).detections_of(type_name, header, boxes)
    return json.loads(store.message(type_name).encode_json(message))


@pytest.mark.parametrize("type_name", [DETECTIONS_2D, DETECTIONS_3D])
@pytest.mark.parametrize("ros", [1, 2])
def test_each_box_is_a_detection_in_the_optical_frame(ros: Generation, type_name: str) -> None:
    found = detections_of(ros, type_name, SEEN, SEEN)
    own = found["header"]
    assert own["frame_id"] == "camera_optical"
    assert [one["header"] for one in found["detections"]] == [own, own]
    assert found["detections"][0] == found["detections"][1]
    assert detections_of(ros, type_name) == {"header": own, "detections": []}


def test_detections_of_ros_1_have_numbers_of_classes_and_an_empty_source() -> None:
    (flat,) = detections_of(1, DETECTIONS_2D, SEEN)["detections"]
    (solid,) = detections_of(1, DETECTIONS_3D, SEEN)["detections"]
    assert flat["results"] == solid["results"] == [{"id": 2, "score": 1.0, "pose": UNCERTAIN}]
    assert flat["bbox"] == {"center": {"x": 25.0, "y": 60.0, "theta": 0.0}, "size_x": 30.0, "size_y": 80.0}
    assert solid["bbox"] == {"center": POSE, "size": {"x": 4.0, "y": 2.0, "z": 1.5}}
    assert (flat["source_img"]["width"], solid["source_cloud"]["width"]) == (0, 0)


def test_detections_of_ros_2_have_names_of_classes_and_the_id_of_the_entity() -> None:
    (flat,) = detections_of(2, DETECTIONS_2D, SEEN)["detections"]
    (solid,) = detections_of(2, DETECTIONS_3D, SEEN)["detections"]
    assert flat["results"] == solid["results"] == [{"hypothesis": {"class_id": "2", "score": 1.0}, "pose": UNCERTAIN}]
    middle = {"position": {"x": 25.0, "y": 60.0}, "theta": 0.0}
    assert flat["bbox"] == {"center": middle, "size_x": 30.0, "size_y": 80.0}
    assert solid["bbox"] == {"center": POSE, "size": {"x": 4.0, "y": 2.0, "z": 1.5}}
    assert (flat["id"], solid["id"]) == ("7", "7")

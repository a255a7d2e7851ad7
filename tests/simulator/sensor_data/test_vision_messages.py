"""Orientations of boxes for vision_msgs: the quaternion turns the box's axes to where the camera sees them."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import rotation
from rosbridge_sim.simulator.sensor_data.vision_messages import _orientation, optical


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

"""Where a camera shows points, by the equations of a pinhole camera: the reference for pictures and boxes."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, rotation
from rosbridge_sim.world.geometry.planar import FloatArray

__all__ = ["project"]

OPTICAL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From axes with x forward, y left, z up to those of a picture: x right, y down, z forward."""


def project(camera: CameraModel, pose: Pose, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where points in the map frame (n, 3) [m] appear.

    Returns:
        (n, 2) column and row [pixels], outside of the picture as well, NaN behind the camera; and (n,) depth along the
        optical axis [m].
    """
    away = np.asarray(points, dtype=np.float64) - np.array(pose[:3])
    ray = away @ rotation(*pose[3:]) @ OPTICAL.T
    depth = ray[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = np.where((depth > 0.0)[:, None], ray[:, :2] / depth[:, None], np.nan)
    return camera.distort(flat) * camera.focal + np.array(camera.center), depth

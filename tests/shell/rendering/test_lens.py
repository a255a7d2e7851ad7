"""Plane pictures of lenses that bend lines: how large they are."""

from __future__ import annotations

import pytest

from rosbridge_sim.scenery.camera_geometry import MAX_PIXELS, CameraModel, FisheyeModel
from rosbridge_sim.shell.rendering.lens import MAX_GROWTH, Lens

BARREL = (-0.1, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "camera",
    [
        FisheyeModel(8192, 20, 90.0),  # one view of more pixels than a camera may have
        CameraModel(64, 48, 170.0, BARREL),  # as wide as a plane may be
        CameraModel(64, 48, 1.0, BARREL),
        FisheyeModel(64, 48, 1.0),
        FisheyeModel(1, 1, 220.0),
        FisheyeModel(8192, 1, 220.0),  # squares of cubes were 3,000 times as large
        FisheyeModel(1, 8192, 220.0),
        FisheyeModel(64, 48, 180.0),
    ],
)
def test_any_lens_has_plane_pictures_in_proportion_to_its_own(camera: CameraModel) -> None:
    planes = [view.camera for view in Lens(camera).views]
    assert sum(plane.width * plane.height for plane in planes) <= 2.0 * MAX_GROWTH**2 * camera.width * camera.height
    assert all(plane.width * plane.height <= MAX_PIXELS for plane in planes)

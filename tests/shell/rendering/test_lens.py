"""Plane pictures of lenses that bend lines: how large they are, and what is put together from them."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import MAX_PIXELS, CameraModel, FisheyeModel
from rosbridge_sim.scenery.pictures import Picture
from rosbridge_sim.shell.rendering.lens import MAX_GROWTH, SIDES, Lens, PlaneView

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


def seen(ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is seen in directions (..., 3): a smooth colour, and a class for each octant."""
    unit = np.nan_to_num(ways / np.linalg.norm(ways, axis=-1, keepdims=True))
    octant = (unit > 0.0) @ np.array([1, 2, 4]) + 1
    return np.rint(127.5 * (unit + 1.0)).astype(np.uint8), octant.astype(np.uint8)


@pytest.mark.parametrize(
    "camera",
    [
        CameraModel(64, 48, 90.0, (-0.2, 0.05, 0.01, -0.01, 0.0)),
        CameraModel(48, 64, 60.0, BARREL),
        FisheyeModel(64, 48, 100.0),
        FisheyeModel(80, 80, 200.0),
        FisheyeModel(90, 30, 220.0),
    ],
)
def test_each_pixel_shows_what_lies_in_the_direction_of_its_ray(camera: CameraModel) -> None:
    lens, pictures = Lens(camera), []
    for view in lens.views:
        plane = view.camera
        x = (np.arange(plane.width) + 0.5 - plane.center[0]) / plane.focal
        y = (np.arange(plane.height) + 0.5 - plane.center[1]) / plane.focal
        right, down = np.meshgrid(x, y)
        local = np.stack([np.ones(right.shape), -right, -down], axis=-1)  # forward, left, up
        rgb, label = seen(local @ view.axes(np.eye(3)).T)
        depth = (7.0 / np.linalg.norm(local, axis=-1)).astype(np.float32)  # of a sphere around the camera
        pictures.append(Picture(rgb, depth, label, label.astype(np.int32) + 100))
    found = lens.bend(pictures)
    rays = camera.rays.reshape(camera.height, camera.width, 3).astype(np.float64)
    rgb, label = seen(rays)
    assert found.rgb is not None
    assert found.depth is not None
    assert found.label is not None
    assert found.instance is not None
    is_lit = np.isfinite(rays[..., 0])
    known = found.label > 0
    assert not (known & ~is_lit).any()
    assert known.sum() > 0.97 * is_lit.sum()  # a lens that bends very much is black at its edge
    assert np.abs(found.rgb.astype(int) - rgb)[known].max() <= 4
    away = np.linalg.norm(rays, axis=-1)
    inner = known & (np.abs(rays / away[..., None]).min(axis=-1) > 0.05)
    assert np.array_equal(found.label[inner], label[inner])
    assert np.array_equal(found.instance[known], found.label[known].astype(np.int32) + 100)
    assert found.depth[known] == pytest.approx(7.0 / away[known], rel=0.06)  # a fisheye's is along its rays of length 1
    assert not found.rgb[~known].any()
    assert np.isinf(found.depth[~known]).all()
    few = lens.bend([Picture(None, None, each.label, None) for each in pictures])
    assert (few.rgb, few.depth, few.instance) == (None, None, None)
    assert np.array_equal(few.label, found.label)  # type: ignore[arg-type]


def test_colours_between_pixels_are_mixed_and_beyond_the_edge_there_is_none() -> None:
    places = np.array([(0.0, 0.0), (1.25, 0.5), (2.0, 1.0), (2.6, 0.0), (-0.4, 1.4), (-0.6, 0.0), (0.0, np.nan)])
    stretch = np.arange(1.0, 8.0, dtype=np.float32)
    view = PlaneView(CameraModel(3, 2, 90.0), SIDES[0], slice(None), places, stretch)
    rgb = np.repeat(np.array([[0, 100, 200], [40, 140, 240]], dtype=np.uint8)[..., None], 3, axis=2)
    mixed = np.full((7, 3), 9, dtype=np.uint8)
    view.mix(rgb, mixed)
    assert mixed[:, 0].tolist() == pytest.approx([0, 145, 240, 0, 40, 0, 0], abs=1)
    picked = np.full(7, -1.0, dtype=np.float32)
    view.pick(np.array([[1, 2, 3], [4, 5, 6]], dtype=np.float32), picked, np.inf)
    assert picked.tolist() == [1.0, 2 * 2.0, 3 * 6.0, np.inf, 5 * 4.0, np.inf, np.inf]

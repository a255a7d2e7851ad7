"""Geometry of cameras: intrinsics, mounting, projection, lenses, and boxes in view."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import (
    CameraModel,
    FisheyeModel,
    Pose,
    box_corners,
    boxes_in_view,
    mount,
    rotation,
)
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.world.geometry.planar import quaternion, rotate
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.scenery.projection import project


def test_field_of_view_is_horizontal_and_gives_the_focal_lengths_of_morai_presets() -> None:
    assert CameraModel(640, 480, 90.0).focal == pytest.approx(320.0)
    assert CameraModel(640, 480, 70.0).focal == pytest.approx(457.0, abs=0.1)
    assert CameraModel(640, 480, 90.0).center == (320.0, 240.0)


def test_rotation_is_that_of_the_quaternions_of_messages() -> None:
    turn = rotation(0.1, -0.2, 2.5)
    for axis in np.eye(3):
        assert turn @ axis == pytest.approx(rotate(quaternion(0.1, -0.2, 2.5), tuple(axis.tolist())))


def test_camera_is_mounted_from_the_middle_of_the_rear_axle() -> None:
    pose = mount(Pose(10.0, 20.0, 1.0, yaw=math.pi / 2), Pose(1.8, 0.5, 2.0, pitch=math.radians(7.0)))
    assert pose[:3] == pytest.approx((9.5, 21.8, 3.0))
    assert pose[3:] == pytest.approx((0.0, math.radians(7.0), math.pi / 2))


def test_positive_pitch_looks_down() -> None:
    camera = CameraModel()
    (place,), _ = project(camera, Pose(0.0, 0.0, 2.0, pitch=math.radians(7.0)), np.array([[20.0, 0.0, 2.0]]))
    assert place == pytest.approx((320.0, 240.0 - 320.0 * math.tan(math.radians(7.0))))


def test_point_to_the_left_is_left_in_the_picture_and_point_behind_is_nowhere() -> None:
    camera = CameraModel()
    place, depth = project(camera, Pose(0.0, 0.0, 0.0), np.array([[10.0, 5.0, 1.0], [-10.0, 0.0, 0.0]]))
    assert place[0] == pytest.approx((160.0, 208.0))
    assert np.isnan(place[1]).all()
    assert depth == pytest.approx((10.0, -10.0))


def test_distortion_follows_the_formula_of_opencv() -> None:
    camera = CameraModel(640, 480, 90.0, (0.1, -0.2, 0.01, 0.02, 0.3))
    x, y = 0.5, -0.25
    r2 = 0.3125
    radial = 1.0 + 0.1 * r2 - 0.2 * r2**2 + 0.3 * r2**3
    wanted = (
        x * radial + 2.0 * 0.01 * x * y + 0.02 * (r2 + 2.0 * x * x),
        y * radial + 0.01 * (r2 + 2.0 * y * y) + 2.0 * 0.02 * x * y,
    )
    assert camera.distort(np.array([[x, y]]))[0] == pytest.approx(wanted)
    assert camera.is_distorted
    assert CameraModel(640, 480, 90.0).is_distorted is False
    assert CameraModel(640, 480, 90.0).matrix.tolist() == [
        [pytest.approx(320.0), 0.0, 320.0],
        [0.0, pytest.approx(320.0), 240.0],
        [0.0, 0.0, 1.0],
    ]


def test_undistort_is_the_inverse_of_distort() -> None:
    camera = CameraModel(640, 480, 90.0, (-0.2, 0.05, 0.001, -0.002, 0.0))
    flat = np.array([[x, y] for x in (-0.9, -0.3, 0.0, 0.8) for y in (-0.7, 0.0, 0.5)])
    assert camera.undistort(camera.distort(flat)) == pytest.approx(flat, abs=1e-6)


def test_rays_of_pixels_are_projected_back_to_their_middles() -> None:
    for distortion in ((0.0, 0.0, 0.0, 0.0, 0.0), (-0.2, 0.05, 0.001, -0.002, 0.0)):
        camera = CameraModel(64, 48, 90.0, distortion)
        pose = Pose(1.0, 2.0, 3.0, 0.1, 0.2, 0.3)
        points = np.array(pose[:3]) + 7.0 * camera.rays.astype(np.float64) @ rotation(*pose[3:]).T
        place, depth = project(camera, pose, points)
        column, row = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
        assert np.abs(place - np.column_stack([column.ravel(), row.ravel()])).max() < 1e-3
        assert np.abs(depth - 7.0).max() < 1e-5


@pytest.mark.parametrize(
    "bad",
    [
        {"width": 0},
        {"height": 10_000},
        {"width": 8_000, "height": 8_000},
        {"fov_deg": 0.0},
        {"fov_deg": 180.0},
        {"fov_deg": math.nan},
        {"distortion": (math.nan, 0.0, 0.0, 0.0, 0.0)},
        {"distortion": (0.0, 0.0)},
    ],
)
def test_impossible_camera_is_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="camera: expected"):
        CameraModel(**bad)  # type: ignore[arg-type]


def test_box_in_view_holds_the_corners_of_the_body() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="car", x=20.0, y=0.0, yaw=0.5)
    frame, camera, pose = take_frame(world), CameraModel(), Pose(0.0, 0.0, 1.5)
    boxes = boxes_in_view(frame, camera, pose)
    assert boxes.rows.tolist() == [0]
    place, depth = project(camera, pose, box_corners(frame)[0])
    assert boxes.bounds[0] == pytest.approx((*place.min(axis=0), *place.max(axis=0)))
    assert boxes.corners[0, :, 0].mean() == pytest.approx(depth.mean())


def test_boxes_behind_outside_too_far_and_left_out_are_not_in_view() -> None:
    world = World()
    for x, y in ((-20.0, 0.0), (5.0, 40.0), (200.0, 0.0), (15.0, 0.0)):
        world.spawn(Kind.VEHICLE, Body(), name="car", x=x, y=y)
    frame, pose = take_frame(world), Pose(0.0, 0.0, 1.5)
    assert boxes_in_view(frame, CameraModel(), pose).rows.tolist() == [3]
    assert boxes_in_view(frame, CameraModel(), pose, without=int(frame.ids[3])).rows.tolist() == []


@pytest.mark.parametrize("camera", [CameraModel(), FisheyeModel()])
def test_camera_with_nothing_near_it_sees_no_box(camera: CameraModel) -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="car", x=200.0, y=0.0)
    boxes = boxes_in_view(take_frame(world), camera, Pose(0.0, 0.0, 1.5))
    assert (boxes.rows.shape, boxes.bounds.shape, boxes.corners.shape) == ((0,), (0, 4), (0, 8, 3))


def test_box_that_passes_the_camera_reaches_the_edge_of_the_picture() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="car", x=0.0, y=2.5)
    (bounds,) = boxes_in_view(take_frame(world), CameraModel(), Pose(0.0, 0.0, 1.5)).bounds
    assert bounds[0] == 0.0
    assert 0.0 < bounds[2] < 320.0
    assert bounds[3] == 480.0


# Fisheye

BENT = (0.05, -0.01, 0.002, -0.0005)


def test_fisheye_shows_points_where_opencv_does() -> None:
    camera = FisheyeModel(640, 480, 180.0, BENT)
    assert camera.focal == pytest.approx(640.0 / math.pi)
    points = np.array([(3.0, 1.0, 2.0), (-4.0, -1.5, 1.0), (0.5, 2.0, 0.5), (0.0, 0.0, 1.0)])  # right, down, ahead
    # cv2.fisheye.projectPoints of OpenCV 5.0 for the same K and D
    expected = [(522.754921, 307.584974), (47.874473, 137.952927), (390.036679, 520.146716), (320.0, 240.0)]
    ours = np.column_stack([points[:, 2], -points[:, 0], -points[:, 1]])
    place = camera.outline(np.repeat(ours[:, None], 8, axis=1))[:, 0]  # boxes without a size
    assert place == pytest.approx(np.array(expected), abs=1e-5)


@pytest.mark.parametrize(("fov", "distortion"), [(180.0, BENT), (220.0, (0.0, 0.0, 0.0, 0.0)), (100.0, BENT)])
def test_rays_of_a_fisheye_are_shown_at_the_middles_of_their_pixels(fov: float, distortion: tuple[float, ...]) -> None:
    camera = FisheyeModel(64, 48, fov, distortion)
    rays = camera.rays.astype(np.float64)
    is_seen = np.isfinite(rays[:, 0])
    assert np.abs(np.linalg.norm(rays[is_seen], axis=1) - 1.0).max() < 1e-6
    place = camera.outline(np.repeat(7.0 * rays[is_seen][:, None], 8, axis=1))[:, 0]
    rows, columns = np.mgrid[:48, :64].reshape(2, -1) + 0.5
    assert np.abs(place - np.column_stack([columns, rows])[is_seen]).max() < 1e-4
    # Beyond 90 deg, or half of the field of view, is nothing.
    assert np.degrees(np.arccos(rays[is_seen, 0])).max() <= max(90.0, fov / 2.0) + 1e-3
    assert is_seen.all() == (fov < 120.0)


def test_bounds_of_a_box_in_a_fisheye_are_those_of_its_bent_edges() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="car", x=1.0, y=2.5, yaw=0.4)
    frame, camera, pose = take_frame(world), FisheyeModel(640, 640, 200.0), Pose(0.0, 0.0, 1.5)
    (bounds,) = boxes_in_view(frame, camera, pose).bounds
    low, *_, high = box_corners(frame)[0]
    turn, (length, width, height) = rotation(0.0, 0.0, 0.4), frame.sizes[0]
    shares = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 61)] * 3), axis=-1).reshape(-1, 3)
    away = 0.5 * (low + high) + (shares * (length, width, height)) @ turn.T - np.array(pose[:3])
    side = np.hypot(away[:, 1], away[:, 2])
    angle = np.arctan2(side, away[:, 0])
    place = 320.0 - away[:, 1:] * (camera.focal * angle / side)[:, None]
    place = place[angle <= math.radians(100.0)]
    assert bounds == pytest.approx((*place.min(axis=0), *place.max(axis=0)), abs=2.0)


def test_coefficients_with_which_the_picture_folds_are_found() -> None:
    assert FisheyeModel(distortion=BENT).is_one_to_one
    assert not FisheyeModel(distortion=(-0.5, 0.0, 0.0, 0.0)).is_one_to_one


def test_depths_are_along_the_axis_of_a_plane_picture_and_distances_for_a_fisheye() -> None:
    points = np.array([[(3.0, 4.0, 0.0), (1.0, 2.0, 2.0)], [(5.0, 0.0, 0.0), (0.0, 6.0, 8.0)]])
    assert CameraModel(64, 48, 90.0).depths(points).tolist() == [[3.0, 1.0], [5.0, 0.0]]
    assert FisheyeModel(64, 48, 180.0).depths(points).tolist() == [[5.0, 3.0], [5.0, 10.0]]


@pytest.mark.parametrize(
    ("width", "height", "is_right"),
    [(1, 1, True), (8192, 1012, True), (8192, 1013, False), (8193, 1, False), (0, 1, False), (1, 0, False)],
)
def test_picture_has_a_pixel_at_least_and_eight_million_at_most(width: int, height: int, is_right: bool) -> None:  # noqa: FBT001 - of the table
    if is_right:
        assert CameraModel(width, height, 90.0).width == width
    else:
        with pytest.raises(ValueError, match="camera: expected"):
            CameraModel(width, height, 90.0)

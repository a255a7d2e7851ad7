"""Geometry of cameras: intrinsics, mounting, projection, lenses, and boxes in view."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, box_corners, boxes_in_view, mount, rotation
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
        assert place == pytest.approx(np.column_stack([column.ravel(), row.ravel()]), abs=1e-3)
        assert depth == pytest.approx(7.0, abs=1e-5)


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


def test_box_that_passes_the_camera_reaches_the_edge_of_the_picture() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="car", x=0.0, y=2.5)
    (bounds,) = boxes_in_view(take_frame(world), CameraModel(), Pose(0.0, 0.0, 1.5)).bounds
    assert bounds[0] == 0.0
    assert 0.0 < bounds[2] < 320.0
    assert bounds[3] == 480.0

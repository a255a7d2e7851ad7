"""Ranges of rays agree with geometry, and with the depth of pictures."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, mount, rotation
from rosbridge_sim.scenery.lidar import LidarNoise, sweep
from rosbridge_sim.scenery.lidar_models import LIDAR_MODELS
from rosbridge_sim.scenery.mesh import Label, Mesh, join_meshes
from rosbridge_sim.scenery.pictures import Channel
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.shell.rendering.ray_caster import RayCaster
from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError
from rosbridge_sim.world.state.world import World
from tests.shell.rendering.graphics import (
    box_mesh,
    built_in,
    ground_mesh,
    nothing,
    open_caster,
    open_renderer,
    put,
)

VLP = LIDAR_MODELS["VLP-16"]
MILLIMETRE = 1e-3


def test_ranges_to_a_plane_are_exact_to_a_millimetre() -> None:
    pose = Pose(3.0, 4.0, 1.25)
    cloud = sweep(open_caster(), ground_mesh(), nothing(), VLP, start=pose, end=pose, period=0.1)
    assert len(cloud) > 10_000
    assert np.abs(cloud.z + 1.25).max() < MILLIMETRE
    assert (cloud.label == Label.ASPHALT).all()
    # Eight lasers look down; that of -1 deg meets the ground at 71.6 m.
    assert sorted(set(cloud.ring.tolist())) == list(range(8))
    ranges = np.sqrt(cloud.x**2 + cloud.y**2 + cloud.z**2)
    assert ranges[cloud.ring == 7] == pytest.approx(1.25 / math.sin(math.radians(1.0)), abs=5 * MILLIMETRE)


def test_points_on_a_box_lie_on_its_sides() -> None:
    scene = join_meshes([ground_mesh(), box_mesh((20.0, -2.0, 0.0), (24.0, 3.0, 3.0), 5)])
    pose = Pose(0.0, 0.0, 1.5, yaw=0.1)
    cloud = sweep(open_caster(), scene, nothing(), VLP, start=pose, end=pose, period=0.1)
    on_box = cloud.instance == 5
    places = np.column_stack([cloud.x, cloud.y, cloud.z])[on_box] @ rotation(0, 0, 0.1).T + (0, 0, 1.5)
    assert len(places) > 100
    assert np.abs(places[:, 0] - 20.0).max() < MILLIMETRE
    assert places[:, 1].min() == pytest.approx(-2.0, abs=0.1)
    assert places[:, 1].max() == pytest.approx(3.0, abs=0.1)


def test_moving_thing_before_a_static_one_is_met_first_and_the_carrier_never() -> None:
    world = World()
    own, car = put(world, "2016_Hyundai_Ioniq", 0, 0), put(world, "Van", 12, 0)
    scene = join_meshes([ground_mesh(), box_mesh((20.0, -20.0, 0.0), (24.0, 20.0, 3.0))])
    pose = Pose(1.3, 0.0, 1.2)
    hits = open_caster().cast(
        scene,
        take_frame(world),
        np.array([pose[:3]], np.float32),
        np.array([[1, 0, 0], [0, 1, 0]], np.float32),
        100.0,
        without=own,
    )
    assert hits.instances.tolist() == [car + 1, 0]
    assert hits.ranges[0] == pytest.approx(12.0 - 1.07 - 1.3, abs=0.1)
    assert np.isinf(hits.ranges[1])
    assert hits.labels.tolist() == [Label.VEHICLE, Label.NONE]
    assert hits.normals[0, 0] < -0.9


def test_nothing_is_met_beyond_the_range_or_in_an_empty_scene() -> None:
    ray = np.array([[1, 0, 0]], np.float32)
    eye = np.zeros((1, 3), np.float32)
    caster = open_caster()
    assert np.isinf(caster.cast(box_mesh((50.0, -1, -1), (51, 1, 1)), nothing(), eye, ray, 49.9).ranges[0])
    assert caster.cast(box_mesh((50.0, -1, -1), (51, 1, 1)), nothing(), eye, ray, 50.1).ranges[0] == pytest.approx(50.0)
    assert np.isinf(caster.cast(Mesh.empty(), nothing(), eye, ray, 100.0).ranges[0])


def test_each_frame_has_its_own_scene() -> None:
    world = World()
    put(world, "Van", 12, 0)
    caster, ray, eye = open_caster(), np.array([[1, 0, 0]], np.float32), np.array([[0, 0, 1]], np.float32)
    scene = ground_mesh()
    before = caster.cast(scene, take_frame(world), eye, ray, 100.0).ranges[0]
    world.x[0] += 5.0
    assert caster.cast(scene, take_frame(world), eye, ray, 100.0).ranges[0] == pytest.approx(before + 5.0, abs=1e-4)


def test_moving_lidar_sweeps_its_turn() -> None:
    """At 20 m/s a turn of 0.1 s covers 2 m: a wall ahead is seen where it is from each ray's own place."""
    start, end = Pose(0.0, 0.0, 1.5), Pose(2.0, 0.0, 1.5)
    scene = box_mesh((30.0, -200.0, 0.0), (31.0, 200.0, 20.0))
    cloud = sweep(open_caster(), scene, nothing(), VLP, start=start, end=end, period=0.1)
    share = (cloud.time / 0.1 * VLP.columns).astype(int) + 0.5
    assert cloud.x == pytest.approx(30.0 - 2.0 * share / VLP.columns, abs=2 * MILLIMETRE)
    assert cloud.time.min() >= 0.0
    assert cloud.time.max() < 0.1
    assert (np.diff(cloud.time) >= -1e-4).all()


def test_lidar_and_camera_agree_on_depth_to_two_centimetres_at_twenty_metres() -> None:
    world = World()
    put(world, "Van", 20, 1, yaw=0.2)
    frame, pose = take_frame(world), Pose(0.0, 0.0, 1.5)
    camera = CameraModel(640, 480, 90.0)
    picture = open_renderer().render(ground_mesh(), frame, camera, pose, channels=Channel.ALL & ~Channel.RGB)
    assert picture.depth is not None
    assert picture.instance is not None
    flat = camera.rays.astype(np.float64)
    length = np.linalg.norm(flat, axis=1)
    hits = open_caster().cast(
        ground_mesh(), frame, np.array([pose[:3]], np.float32), (flat / length[:, None]).astype(np.float32), 60.0
    )
    depth, picture_depth = hits.ranges / length, picture.depth.reshape(-1)
    same = (picture.instance.reshape(-1) == hits.instances) & (picture_depth < 25.0) & np.isfinite(depth)
    assert same.sum() > 50_000
    assert np.quantile(np.abs(depth[same] - picture_depth[same]), 0.999) < 0.02
    assert (hits.instances == picture.instance.reshape(-1)).mean() > 0.995


@pytest.mark.slow
def test_paint_of_town_is_bright_and_asphalt_is_dark_to_a_lidar() -> None:
    road_map, static = built_in("town")
    lane = int(np.argmax(road_map.roads.length))
    (point,), (yaw,) = road_map.roads.at([lane], [0.4 * road_map.roads.length[lane]])
    pose = mount(Pose(point[0], point[1], point[2], yaw=float(yaw)), Pose(2.0, 0.0, 1.25))
    cloud = sweep(open_caster(), static, nothing(), LIDAR_MODELS["OS1-64"], start=pose, end=pose, period=0.1)
    paint = np.isin(cloud.label, [Label.PAINT_WHITE, Label.PAINT_YELLOW])
    assert paint.sum() > 200
    assert cloud.intensity[paint].min() > 90.0
    assert cloud.intensity[cloud.label == Label.ASPHALT].max() < 50.0
    ground = np.isin(cloud.label, [Label.ASPHALT, Label.PAINT_WHITE, Label.PAINT_YELLOW])
    assert np.abs(cloud.z[ground] + 1.25).max() < 0.02


def test_noise_follows_from_the_generator_alone() -> None:
    noise = LidarNoise(range_sigma=0.02, dropout=0.1)
    pose = Pose(0.0, 0.0, 1.25)
    clouds = [
        sweep(
            *(open_caster(), ground_mesh(), nothing(), VLP),
            start=pose,
            end=pose,
            period=0.1,
            noise=noise,
            rng=np.random.default_rng(seed),
        )
        for seed in (1, 1, 2)
    ]
    assert np.array_equal(clouds[0].x, clouds[1].x)
    assert len(clouds[0]) != len(clouds[2]) or not np.array_equal(clouds[0].x, clouds[2].x)
    assert len(clouds[0]) == pytest.approx(0.9 * 8 * VLP.columns, rel=0.02)


def test_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(RenderingUnavailableError, match=r"pip install 'rosbridge-sim\[sensors\]'"):
        RayCaster()

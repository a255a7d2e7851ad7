"""Ranges of rays agree with geometry, and with the depth of pictures."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, rotation
from rosbridge_sim.scenery.mesh import PAINTED, Label, Mesh, join_meshes
from rosbridge_sim.scenery.pictures import Channel, PictureChoices
from rosbridge_sim.scenery.scene_frame import SceneFrame, take_frame
from rosbridge_sim.shell.rendering.ray_caster import RayCaster
from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError
from rosbridge_sim.simulator.sensor_data.lidar_sweep import POINT_TYPE, Motion, beams_3d, echoes_of, pack_points, sweep
from rosbridge_sim.simulator.sensors.lidar_3d import LIDAR_MODELS
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

HERE = Pose(0.0, 0.0, 0.0)
MILLIMETRE = 1e-3


class Turn:
    """The points of a turn, and what each has met."""

    def __init__(self, scene: Mesh, frame: SceneFrame, motion: Motion, model: str = "VLP-16") -> None:
        elevations, columns = LIDAR_MODELS[model]
        beams = beams_3d(np.radians(elevations), columns, 0.1)
        origins, directions = sweep(motion, beams, scene.origin)
        hits = open_caster().cast(scene, frame, origins, directions, 100.0)
        data, self.num = pack_points(echoes_of(hits, directions), beams, 0.4, 100.0)
        points = np.frombuffer(data, dtype=POINT_TYPE)
        found = np.isfinite(hits.ranges)
        self.labels, self.instances = hits.labels[found], hits.instances[found]
        self.places = np.column_stack([points[axis] for axis in "xyz"]).astype(np.float64)
        self.intensity, self.ring, self.time = points["intensity"], points["ring"], points["time"]


def standing(mounting: Pose, vehicle: Pose = HERE) -> Motion:
    return Motion(vehicle, mounting, 0.0, 0.0)


def test_ranges_to_a_plane_are_exact_to_a_millimetre() -> None:
    turn = Turn(ground_mesh(), nothing(), standing(Pose(3.0, 4.0, 1.25)))
    assert turn.num > 10_000
    assert np.abs(turn.places[:, 2] + 1.25).max() < MILLIMETRE
    assert (turn.labels == Label.ASPHALT).all()
    # Eight lasers look down; that of -1 deg meets the ground at 71.6 m.
    assert sorted(set(turn.ring.tolist())) == list(range(8))
    ranges = np.linalg.norm(turn.places, axis=1)
    assert ranges[turn.ring == 7] == pytest.approx(1.25 / math.sin(math.radians(1.0)), abs=5 * MILLIMETRE)


def test_points_on_a_box_lie_on_its_sides() -> None:
    scene = join_meshes([ground_mesh(), box_mesh((20.0, -2.0, 0.0), (24.0, 3.0, 3.0), 5)])
    turn = Turn(scene, nothing(), standing(Pose(0.0, 0.0, 1.5, yaw=0.1)))
    places = turn.places[turn.instances == 5] @ rotation(0, 0, 0.1).T + (0, 0, 1.5)
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


def test_moving_thing_behind_a_static_one_is_hidden() -> None:
    world = World()
    car = put(world, "Van", 30, 0)
    wall = box_mesh((20.0, -20.0, 0.0), (24.0, 20.0, 3.0))
    eyes = np.array([[0, 0, 1.2], [0, 0, 1.2], [60, 0, 1.2]], np.float32)
    rays = np.array([[1, 0, 0], [0, 0, -1], [-1, 0, 0]], np.float32)
    hits = open_caster().cast(join_meshes([ground_mesh(), wall]), take_frame(world), eyes, rays, 100.0)
    assert hits.labels.tolist() == [Label.OBSTACLE, Label.ASPHALT, Label.VEHICLE]
    assert hits.instances.tolist() == [0, 0, car + 1]
    assert hits.ranges[:2] == pytest.approx([20.0, 1.2])


def test_paint_has_no_height_for_rays() -> None:
    ground, height = ground_mesh(), 0.006
    corners = np.array([(5, -1, height), (7, -1, height), (7, 1, height), (5, 1, height)], np.float32)
    paint = Mesh.of(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), (236, 233, 229), Label.CROSSWALK)
    x = np.array([4.99, 5.01, 6.99, 7.01])
    rays = np.column_stack([x, np.zeros(4), np.full(4, -1.25)])
    length = np.linalg.norm(rays, axis=1)
    eye, rays = np.array([[0, 0, 1.25]], np.float32), (rays / length[:, None]).astype(np.float32)
    hits = open_caster().cast(join_meshes([ground, paint]), nothing(), eye, rays, 100.0)
    assert hits.ranges == pytest.approx(length, abs=1e-5)
    assert hits.labels.tolist() == [Label.ASPHALT, Label.CROSSWALK, Label.CROSSWALK, Label.ASPHALT]


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
    scene = box_mesh((30.0, -200.0, 0.0), (31.0, 200.0, 20.0))
    turn = Turn(scene, nothing(), Motion(Pose(2.0, 0.0, 0.0), Pose(0.0, 0.0, 1.5), 20.0, 0.0))
    assert turn.places[:, 0] == pytest.approx(28.0 - 20.0 * turn.time, abs=2 * MILLIMETRE)
    assert np.ptp(turn.time) > 0.04


def test_lidar_and_camera_agree_on_depth_to_two_centimetres_at_twenty_metres() -> None:
    world = World()
    put(world, "Van", 20, 1, yaw=0.2)
    frame, pose = take_frame(world), Pose(0.0, 0.0, 1.5)
    camera = CameraModel(640, 480, 90.0)
    picture = open_renderer().render(
        ground_mesh(), frame, camera, pose, PictureChoices(channels=Channel.ALL & ~Channel.RGB)
    )
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
    vehicle = Pose(point[0], point[1], point[2], yaw=float(yaw))
    turn = Turn(static, nothing(), standing(Pose(2.0, 0.0, 1.25), vehicle), "OS1-64")
    paint = np.isin(turn.labels, [Label.PAINT_WHITE, Label.PAINT_YELLOW])
    assert paint.sum() > 200
    assert turn.intensity[paint].min() > 90.0
    assert turn.intensity[turn.labels == Label.ASPHALT].max() < 50.0
    ground = np.isin(turn.labels, [Label.ASPHALT, *PAINTED])
    assert (turn.places[ground, 2] == -1.25).all()  # to the bit: programs keep what is above that


def test_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(RenderingUnavailableError, match=r"pip install 'rosbridge-sim\[sensors\]'"):
        RayCaster()

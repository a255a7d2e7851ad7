"""Entities as triangles."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbridge_sim.scenarios.catalogue import CATALOGUE
from rosbridge_sim.scenery.camera_geometry import box_corners
from rosbridge_sim.scenery.mesh import Label, Lit, Mesh
from rosbridge_sim.scenery.moving.looks import EGO_PAINT, lit_table, paints, tint_table
from rosbridge_sim.scenery.moving.moving_mesh import MovingScene
from rosbridge_sim.scenery.moving.template import Tint
from rosbridge_sim.scenery.scene_frame import EgoLook, SceneFrame, Shape, take_frame
from rosbridge_sim.scenery.static.traffic_lights import SignalLamps
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.followers.lamps import BRAKE, LEFT, RIGHT
from rosbridge_sim.world.roads.signal_plan import Lamp
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.road_factory import signalled

ORIGIN = np.array([100.0, 200.0, 0.0])


def corners_of(mesh: Mesh, instance: int) -> np.ndarray:
    """(k, 3) corners of an entity, map frame."""
    corners = mesh.vertices[mesh.triangles[mesh.instance == instance]].reshape(-1, 3)
    return np.asarray(corners.astype(np.float64) + mesh.origin)


def crowd() -> SceneFrame:
    world = World()
    for k, model in enumerate(CATALOGUE):
        world.spawn(
            model.kind, model.body, name=model.name, x=20.0 * k, y=3.0, yaw=0.3 * k, speed=1.0, pitch=0.05, roll=0.02
        )
    return take_frame(world)


@pytest.mark.parametrize("eye", [None, np.array([5_000.0, 0.0, 0.0])])
def test_every_model_fills_its_box(eye: np.ndarray | None) -> None:
    frame = crowd()
    mesh = MovingScene().mesh(frame, ORIGIN, eye)
    for k, model in enumerate(CATALOGUE):
        corners = corners_of(mesh, int(frame.ids[k]) + 1)
        box = box_corners(frame)[k]
        middle, axes = box[0], np.array([box[4] - box[0], box[2] - box[0], box[1] - box[0]])
        size = np.linalg.norm(axes, axis=1)
        inside = (corners - middle) @ (axes / size[:, None]).T / size
        # Limbs and handlebars may reach beyond; nothing is much smaller than its box.
        assert inside.min() > -0.6, model.name
        assert inside.max() < 1.6, model.name
        assert (inside.max(axis=0) - inside.min(axis=0)).min() > 0.55, model.name
        if model.kind == Kind.VEHICLE and model.body.width > 1.0:
            assert inside.min() > -0.001, model.name
            assert inside.max() < 1.001, model.name


def test_ego_has_a_paint_of_its_own_and_others_differ() -> None:
    world = World()
    for k in range(30):
        world.spawn(Kind.VEHICLE, Body(), name="car", x=10.0 * k, y=0.0)
    uid = world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=9.0)
    mesh = MovingScene().mesh(take_frame(world), ORIGIN)
    paints = {tuple(map(tuple, np.unique(mesh.colour[mesh.instance == k + 1], axis=0).tolist())) for k in range(30)}
    assert len(paints) > 3
    assert EGO_PAINT in set(map(tuple, mesh.colour[mesh.instance == uid + 1].tolist()))


def test_lamps_are_lit_as_the_frame_says() -> None:
    world = World()
    uid = world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0)

    def lit(lamps: int) -> np.ndarray:
        frame = take_frame(world, [EgoLook(world.row(uid), 5, lamps)])
        mesh = MovingScene().mesh(frame, np.zeros(3))
        return np.asarray(mesh.vertices[mesh.triangles[mesh.lit == Lit.NOW]].mean(axis=1))

    assert len(lit(0)) == 0
    brakes = lit(BRAKE)
    assert brakes[:, 0].max() < 0.0
    assert brakes[:, 1].min() < -0.3
    assert brakes[:, 1].max() > 0.3
    assert lit(LEFT)[:, 1].min() > 0.0
    assert lit(RIGHT)[:, 1].max() < 0.0
    world.frame += 20  # 0.4 s later
    assert len(lit(LEFT)) == 0
    assert len(lit(BRAKE)) == len(brakes)


def test_vehicles_far_from_the_eye_have_fewer_triangles_and_beyond_its_reach_none() -> None:
    world = World()
    for x in (0.0, 44.0, 46.0, 200.0):
        world.spawn(Kind.VEHICLE, Body(), name="car", x=x, y=0.0)
    frame = take_frame(world)
    mesh = MovingScene().mesh(frame, np.zeros(3), np.zeros(3), 100.0)
    fine, coarse = 300 + 4 * 36, 104 + 4 * 16
    nums = [int((mesh.instance == uid + 1).sum()) for uid in frame.ids]
    assert nums == [fine, fine, coarse, 0]
    mesh = MovingScene().mesh(frame, np.zeros(3), which=np.array([True, False, False, True]))
    assert [int((mesh.instance == uid + 1).sum()) for uid in frame.ids] == [fine, 0, 0, fine]


def test_what_is_just_at_the_reach_of_an_eye_is_shown_and_just_at_the_distance_of_details_in_full() -> None:
    world = World()
    for x in (45.0, 100.0, 100.001):
        world.spawn(Kind.VEHICLE, Body(), name="car", x=x, y=0.0)
    frame = take_frame(world)
    mesh = MovingScene().mesh(frame, np.zeros(3), np.zeros(3), 100.0)
    assert [int((mesh.instance == uid + 1).sum()) for uid in frame.ids] == [300 + 4 * 36, 104 + 4 * 16, 0]


def test_lamps_of_lights_move_with_the_origin_and_can_be_left_out() -> None:
    roads, plan = signalled()
    world = World()
    world.lay_roads(roads, plan)
    frame, scene = take_frame(world), MovingScene()
    meshes = [scene.mesh(frame, origin) for origin in (np.zeros(3), ORIGIN, np.zeros(3))]
    assert {int(label) for mesh in meshes for label in mesh.label} == {Label.TRAFFIC_LIGHT}
    places = [mesh.vertices.astype(np.float64) + mesh.origin for mesh in meshes]
    assert places[1] == pytest.approx(places[0], abs=1e-4)
    assert np.array_equal(places[2], places[0])
    assert [mesh.origin.tolist() for mesh in meshes] == [[0.0] * 3, ORIGIN.tolist(), [0.0] * 3]
    assert len(scene.mesh(frame, ORIGIN, has_lenses=False)) == 0


def test_obstacle_lies_about_the_middle_of_its_body() -> None:
    world = World()
    body = Body(length=2.0, width=1.0, height=1.5, wheelbase=0.0, front_overhang=1.5, rear_overhang=0.5)
    uid = world.spawn(Kind.OBSTACLE, body, name="box", x=10.0, y=20.0)
    corners = corners_of(MovingScene().mesh(take_frame(world), ORIGIN), uid + 1)
    assert (corners[:, 0].min(), corners[:, 0].max()) == pytest.approx((9.5, 11.5), abs=0.02)
    assert (corners[:, 1].min(), corners[:, 1].max()) == pytest.approx((19.5, 20.5), abs=0.02)


def test_turn_signals_blink_ninety_times_a_minute_and_brakes_do_not() -> None:
    world = World()
    uid = world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0)
    for lamps, num_on, num_changes in ((LEFT, 50, 6), (BRAKE, 100, 0)):
        is_lit = []
        for _ in range(100):  # two seconds
            frame = take_frame(world, [EgoLook(world.row(uid), 5, lamps)])
            is_lit.append(bool((lit_table(frame, np.array([0])) == Lit.NOW).any()))
            world.frame += 1
        assert sum(is_lit) == pytest.approx(num_on, abs=2)
        assert sum(a != b for a, b in pairwise(is_lit)) == pytest.approx(num_changes, abs=1)


def test_main_colours_are_those_of_the_meshes() -> None:
    frame = crowd()
    colours = paints(frame)
    for shape in Shape:
        for row in np.flatnonzero(frame.shapes == shape).tolist():
            red, green, blue = tint_table(frame, np.array([row]), shape)[0, Tint.PAINT].tolist()
            assert colours[row] == 65_536 * red + 256 * green + blue


def test_front_wheels_are_steered() -> None:
    world = World()
    uid = world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0)
    straight = MovingScene().mesh(take_frame(world), np.zeros(3)).vertices
    world.steer[world.row(uid)] = math.radians(30.0)
    turned = MovingScene().mesh(take_frame(world), np.zeros(3)).vertices
    moved = straight[np.linalg.norm(turned - straight, axis=1) > 1e-3]
    assert len(moved) > 50
    assert np.abs(moved[:, 0] - 2.7).max() < 0.5


def test_people_walk_by_the_distance_that_they_walked() -> None:
    world = World()
    uid = world.spawn(Kind.PEDESTRIAN, Body.box(0.45, 0.55, 1.7), name="Man", x=0.0, y=0.0, speed=1.4)

    def reach() -> float:
        """Greatest distance of a foot from the middle, ahead."""
        corners = corners_of(MovingScene().mesh(take_frame(world), np.zeros(3)), uid + 1)
        feet = corners[corners[:, 2] < 0.15]
        return float(feet[:, 0].max() - world.x[world.row(uid)])

    reaches = []
    for step in range(14):
        world.x[world.row(uid)] = 0.1 * step
        reaches.append(reach())
    assert max(reaches) > min(reaches) + 0.15
    world.speed[world.row(uid)] = 0.0
    standing = reach()
    world.x[world.row(uid)] += 0.35
    assert reach() == pytest.approx(standing, abs=1e-6)


def test_lights_show_what_the_signals_say() -> None:
    plan = DiskLibrary().map("town").plan
    assert plan is not None
    lamps = SignalLamps(plan, np.zeros(3))
    dark = lamps.show(np.full(len(plan.lights), -1, dtype=np.int64))
    assert not dark.lit.any()
    red = lamps.show(np.full(len(plan.lights), int(Lamp.RED), dtype=np.int64))
    colours = red.colour[red.lit == Lit.NOW]
    assert len(np.unique(colours, axis=0)) == 1
    assert colours[0, 0] > 200 > colours[0, 1]
    assert set(np.unique(red.label).tolist()) == {int(Label.TRAFFIC_LIGHT)}


def test_empty_world_has_no_triangles() -> None:
    assert len(MovingScene().mesh(take_frame(World()), ORIGIN)) == 0

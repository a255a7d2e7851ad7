"""Shadows below entities, as triangles; views, their planes, and vertices as the shaders take them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel
from rosbridge_sim.scenery.mesh import Label, Lit, Mesh
from rosbridge_sim.scenery.scene_frame import Shape, take_frame
from rosbridge_sim.shell.rendering.camera_renderer import FAR, NEAR, _beams, _is_in_view, _matrices
from rosbridge_sim.shell.rendering.gl_mesh import SHADOW_LIFT, SHADOW_MARGIN, _shadows, pack_vertices, planes_of
from rosbridge_sim.world.state.world import World
from tests.shell.rendering.graphics import model, nothing, put


def test_shadow_reaches_a_margin_beyond_the_box_of_its_entity_and_turns_with_it() -> None:
    world, name = World(), "2016_Hyundai_Ioniq"
    put(world, name, 20.0, 30.0, yaw=0.5 * math.pi)  # it looks to the north
    corners = _shadows(take_frame(world), np.array([5.0, 10.0, 0.0]))
    body = model(name).body
    half = np.array([0.5 * body.length + SHADOW_MARGIN, 0.5 * body.width + SHADOW_MARGIN])
    middle = np.array([15.0, 20.0 + body.centre])
    assert corners.shape == (6, 5)
    assert corners[:, :2].min(axis=0) == pytest.approx(middle - half[::-1])
    assert corners[:, :2].max(axis=0) == pytest.approx(middle + half[::-1])
    assert corners[:, 2] == pytest.approx(SHADOW_LIFT)
    # Ahead is the first of both places within the shadow, left the second one.
    assert corners[:, 1] == pytest.approx(middle[1] + corners[:, 3] * half[0])
    assert corners[:, 0] == pytest.approx(middle[0] - corners[:, 4] * half[1])
    assert sorted(set(map(tuple, corners[:, 3:].tolist()))) == [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]


def test_nothing_has_no_shadow() -> None:
    assert _shadows(nothing(), np.zeros(3)).shape == (0, 5)


CAMERA = CameraModel(640, 480, 90.0)
EYE = np.array([5.0, -3.0, 2.0])


def seen(view: np.ndarray, x: float, y: float, z: float) -> np.ndarray:
    """Place in the picture, from -1 to 1 to the right, downwards and away, of a place from the eye of a camera."""
    found = view @ np.array([*(EYE + np.array((x, y, z))), 1.0])
    return np.asarray(found[:3] / found[3])


def test_view_shows_the_field_of_the_camera_from_the_nearest_to_the_farthest_place() -> None:
    view, back = _matrices(CAMERA, np.eye(3), EYE)
    for away, depth in ((NEAR, -1.0), (FAR, 1.0)):
        assert seen(view, away, 0.0, 0.0) == pytest.approx([0.0, 0.0, depth], abs=1e-6)
        assert seen(view, away, away, 0.75 * away) == pytest.approx([-1.0, -1.0, depth], abs=1e-6)
        assert seen(view, away, -away, -0.75 * away) == pytest.approx([1.0, 1.0, depth], abs=1e-6)
    for corner, ray in (
        ((0.0, 0.0), (1.0, 0.0, 0.0)),
        ((-1.0, -1.0), (1.0, 1.0, 0.75)),
        ((1.0, 0.5), (1.0, -1.0, -0.375)),
    ):
        assert (back @ np.array([*corner, 1.0, 0.0]))[:3] == pytest.approx(ray)


def test_planes_of_a_view_are_its_four_sides_and_the_nearest_place_in_metres() -> None:
    view, _ = _matrices(CAMERA, np.eye(3), EYE)
    planes = planes_of(view)
    ahead = EYE + np.array((10.0, 0.0, 0.0))
    side, top = 10.0 / math.sqrt(2.0), 10.0 * 0.75 / 1.25
    assert planes[:, :3] @ ahead + planes[:, 3] == pytest.approx([side, side, top, top, 10.0 - NEAR], rel=1e-4)
    beyond = EYE + np.array((10.0, 12.0, 0.0))
    assert (planes[:, :3] @ beyond + planes[:, 3] > 0.0).tolist() == [False, True, True, True, True]
    below = EYE + np.array((10.0, 0.0, -8.0))
    assert (planes[:, :3] @ below + planes[:, 3] > 0.0).tolist() == [True, True, True, False, True]


def test_entity_may_be_in_a_picture_while_a_sphere_around_it_is() -> None:
    view, _ = _matrices(CAMERA, np.eye(3), EYE)
    body = model("2016_Hyundai_Ioniq").body
    world = World()
    radius = body.centre + body.wheelbase + math.hypot(body.length, body.width, body.height) + 1.0
    edge = math.sqrt(2.0) * radius
    for ahead, left in (
        (50.0, 0.0),
        (50.0, 50.0 + edge - 0.1),
        (50.0, 50.0 + edge + 0.1),
        (0.2 - radius, 0.0),
        (-99.0, 0.0),
    ):
        put(world, "2016_Hyundai_Ioniq", EYE[0] + ahead, EYE[1] + left)
    frame = take_frame(world)
    level = _is_in_view(frame, np.array([0.0, 0.0, -EYE[2]]), view)
    assert level.tolist() == [True, True, False, True, False]


def test_head_lamps_of_the_nearest_vehicles_look_ahead_and_a_little_down() -> None:
    world = World()
    put(world, "2016_Hyundai_Ioniq", 10.0, 5.0, yaw=0.5 * math.pi)
    put(world, "Man", 1.0, 1.0)
    frame = take_frame(world)
    assert Shape.PERSON in frame.shapes
    places, ways = _beams(frame, np.zeros(3))
    body = model("2016_Hyundai_Ioniq").body
    assert places == pytest.approx(np.array([[10.0, 5.0 + body.centre + 0.5 * body.length, 0.65]]))
    assert ways == pytest.approx(np.array([[0.0, 1.0, -0.06]]) / math.hypot(1.0, 0.06))
    assert len(_beams(frame, np.array([1e4, 0.0, 0.0]))[0]) == 0


def test_vertices_have_place_colour_class_normal_lamp_and_entity() -> None:
    corners = np.array([(0, 0, 1), (2, 0, 1), (0, 3, 1)], dtype=np.float32)
    mesh = Mesh.of(corners, np.array([[0, 1, 2], [0, 2, 1]]), (10, 20, 30), Label.TREE, instance=7, lit=Lit.NOW)
    packed = pack_vertices(mesh)
    assert packed["place"].tolist() == corners[[0, 1, 2, 0, 2, 1]].tolist()
    assert packed["look"].tolist() == [[10, 20, 30, Label.TREE]] * 6
    assert packed["normal"].tolist() == [[0, 0, 127, Lit.NOW]] * 3 + [[0, 0, -127, Lit.NOW]] * 3
    assert packed["instance"].tolist() == [7] * 6

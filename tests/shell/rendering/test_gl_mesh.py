"""Shadows below entities, as triangles; views, their planes, and vertices as the shaders take them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel
from rosbridge_sim.scenery.mesh import Label, Lit, Mesh, join_meshes
from rosbridge_sim.scenery.scene_frame import Shape, take_frame
from rosbridge_sim.shell.rendering.camera_renderer import FAR, NEAR, _beams, _is_in_view, _matrices
from rosbridge_sim.shell.rendering.gl_mesh import (
    PIECE,
    REACH,
    SHADOW_LIFT,
    SHADOW_MARGIN,
    CellMesh,
    MovingBuffer,
    _Runs,
    _shadows,
    pack_vertices,
    planes_of,
)
from rosbridge_sim.shell.rendering.shaders import Coat
from rosbridge_sim.world.state.world import World
from tests.shell.rendering.graphics import model, nothing, open_renderer, put


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


# What is drawn, and in which order


def ball(ahead: float, left: float = 0.0, size: float = 2.0) -> np.ndarray:
    """Corners of two triangles around a place from the eye; their box has this side, so the ball half its diagonal."""
    low, high = (EYE + np.array((ahead, left, 0.0)) + sign * 0.5 * size for sign in (-1.0, 1.0))
    return np.array([low, high, low, high, low, high])


def visible(
    places: list[np.ndarray], reach: float | np.ndarray = 400.0, later: list[float] | None = None
) -> tuple[list[int], Any]:
    """Rows in view and their distances, of runs of two triangles each."""
    view, _ = _matrices(CAMERA, np.eye(3), EYE)
    first = 2 * np.arange(len(places))
    runs = _Runs(np.concatenate([*places, np.zeros((0, 3))]), first, reach, np.array(later or [0.0] * len(places)))
    rows, away = runs.visible(view, EYE)
    assert (runs.first.tolist(), runs.num.tolist()) == ((3 * first).tolist(), [6] * len(places))
    return rows.tolist(), away.tolist()


def test_runs_in_view_come_nearest_first_with_their_distances() -> None:
    radius = math.sqrt(3.0)
    assert visible([ball(50.0), ball(20.0), ball(30.0, 5.0)]) == (
        [1, 2, 0],
        pytest.approx([20.0 - radius, math.hypot(30.0, 5.0) - radius, 50.0 - radius]),
    )
    assert visible([]) == ([], [])


def test_lowest_surfaces_come_as_much_later_as_their_group_says() -> None:
    found = visible([ball(20.0), ball(50.0), ball(90.0)], later=[80.0, 20.0, 0.0])
    assert found == ([1, 2, 0], pytest.approx(np.array([50.0, 90.0, 20.0]) - math.sqrt(3.0)))


def test_run_beyond_its_reach_or_beside_the_view_is_left_out() -> None:
    radius = math.sqrt(3.0)
    assert visible([ball(50.0), ball(50.0)], np.array([50.0 - radius - 0.01, 50.0 - radius + 0.01])) == (
        [1],
        [pytest.approx(50.0 - radius)],
    )
    edge = 50.0 + math.sqrt(2.0) * radius  # the side of the view is 45 degrees to the left
    rows, _ = visible([ball(50.0, edge - 0.1), ball(50.0, edge + 0.1), ball(-99.0), ball(50.0, -edge - 0.1)])
    assert rows == [0]


def tile(x: float, y: float, label: Label, num: int = 1, instance: int = 0) -> Mesh:
    """Some equal triangles of a class, a metre to each side around a place on the ground."""
    corners = np.array([(x - 1, y - 1, 0), (x + 1, y - 1, 0), (x, y + 2, 0)], dtype=np.float32)
    return Mesh.of(corners, np.array([[0, 1, 2]] * num), (9, 9, 9), label, instance=instance)


def test_static_mesh_is_drawn_by_class_and_cell() -> None:
    view, _ = _matrices(CAMERA, np.eye(3), EYE)
    tiles = [
        tile(160.0, 10.0, Label.ASPHALT),
        tile(110.0, 10.0, Label.TREE, 2),  # the cell from 60 to 120 m
        tile(160.0, 11.0, Label.ASPHALT, 3),  # together with the first
        tile(130.0, 10.0, Label.TREE),  # the next cell
        tile(110.0, -10.0, Label.TREE),  # the cell to the right of the first
        tile(230.0, 10.0, Label.TREE),  # too far for a tree
        tile(25.0, 0.0, Label.ASPHALT),  # near enough for its coat
        tile(170.0, 10.0, Label.PAVEMENT),
    ]
    with open_renderer()._context as context:  # other tests have contexts of their own
        mesh = CellMesh(context, join_meshes(tiles))
        parts = mesh.visible(view, EYE)
        mesh.release()
    # They lie in memory by class, then from west to east, then from south to north.
    assert parts == [
        (Coat.ASPHALT, 18, 3),
        (Coat.PLAIN, 0, 3),
        (Coat.PLAIN, 3, 6),
        (Coat.PLAIN, 9, 3),
        (Coat.SLABS, 15, 3),
        (Coat.PLAIN, 21, 12),  # 20 m later than its place, and without a coat so far away
    ]


def test_moving_triangles_are_drawn_entity_by_entity_and_lenses_of_lights_by_pieces() -> None:
    view, _ = _matrices(CAMERA, np.eye(3), EYE)
    lenses = [tile(40.0, 0.0, Label.TRAFFIC_LIGHT, PIECE - 1), tile(60.0, 0.0, Label.TRAFFIC_LIGHT, 3)]
    tiles = [*lenses, tile(30.0, 0.0, Label.TREE, 5, instance=3), tile(90.0, 0.0, Label.TREE, 2_000, instance=4)]
    tiles += [tile(EYE[0] + REACH + 3.0, 0.0, Label.TREE, instance=5)]
    renderer = open_renderer()
    with renderer._context:
        moving = MovingBuffer(renderer._context, renderer._shadow)
        assert moving.visible(view, EYE) == []
        world = World()
        for i in range(2):
            put(world, "2016_Hyundai_Ioniq", 10.0 * i, 0.0)
        large, small = join_meshes(tiles), tile(50.0, 0.0, Label.TREE, instance=8)
        moving.write(large, take_frame(world), np.zeros(3))
        assert moving.visible(view, EYE) == [(294, 15), (0, 288), (288, 6), (309, 6_000)]
        assert moving._buffer.vertices.read().startswith(pack_vertices(large).tobytes())
        shadows = _shadows(take_frame(world), np.zeros(3)).astype("<f4").tobytes()
        assert moving._shadows.read().startswith(shadows)
        assert moving._num_shadows == 12
        moving.write(small, nothing(), np.zeros(3))
        assert moving.visible(view, EYE) == [(0, 3)]
        assert moving._buffer.vertices.read().startswith(pack_vertices(small).tobytes())
        assert moving._num_shadows == 0

"""What a camera's picture takes of the scene: matrices, rows of the sky, entities in view, beams of head lamps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import CameraModel, rotation
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.shell.rendering.camera_renderer import _beams, _is_in_view, _matrices, _sky_rows
from rosbridge_sim.world.state.world import Body, Kind, World

CAMERA = CameraModel(200, 100, 90.0)
EYE = np.array([3.0, -2.0, 1.5])


def on_picture(view: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, float]:
    """Place on the picture, -1 to 1 from the left and from the top, and depth."""
    found = view @ np.append(place, 1.0)
    return found[:2] / found[3], float(found[3])


def test_matrix_shows_places_as_a_pinhole_does_and_its_inverse_gives_the_rays() -> None:
    axes = rotation(0.1, 0.2, 0.7)
    view, back = _matrices(CAMERA, axes, EYE)
    for local in ((10.0, 0.0, 0.0), (10.0, 4.0, 1.0), (5.0, -2.0, 2.0)):
        (x, y), depth = on_picture(view, EYE + axes @ np.array(local))
        ahead, left, up = local
        assert (x, y, depth) == pytest.approx((-left / ahead, -2.0 * up / ahead, ahead))
        ray = back[:3, :3] @ (x, y, 1.0)
        assert ray == pytest.approx(axes @ np.array(local) / ahead)


@pytest.mark.parametrize(
    ("pitch", "rows"),
    [
        (0.0, 51),  # the horizon is in the middle
        (math.atan(0.25), 26),
        (-math.atan(0.25), 76),
        (0.6, 1),
        (-0.6, 100),
        (math.pi, 100),
        (math.pi / 2, 100),  # straight down: the picture has no upright columns
    ],
)
def test_sky_is_as_far_down_as_the_horizon(pitch: float, rows: int) -> None:
    _, back = _matrices(CAMERA, rotation(0.0, pitch, 0.4), EYE)
    assert _sky_rows(back, 100) == rows


def test_slanted_horizon_counts_where_it_is_lowest_and_a_camera_on_its_side_sees_sky_everywhere() -> None:
    _, back = _matrices(CAMERA, rotation(0.2, 0.0, 0.0), EYE)
    assert _sky_rows(back, 100) == math.ceil(50.0 * (1.0 + 2.0 * math.tan(0.2))) + 1
    _, back = _matrices(CAMERA, rotation(math.pi / 2, 0.0, 0.0), EYE)
    assert _sky_rows(back, 100) == 100


def test_entities_are_in_view_as_far_as_they_reach() -> None:
    world = World()
    places = [(20.0, 0.0), (-20.0, 0.0), (20.0, 19.0), (20.0, 40.0), (20.0, -40.0), (2.0, 4.0)]
    for x, y in places:
        world.spawn(Kind.VEHICLE, Body(), name="car", x=x + 100.0, y=y)
    origin, eye = np.array([130.0, 0.0, 0.0]), np.array([-30.0, 0.0, 0.0])
    view, _ = _matrices(CAMERA, rotation(0.0, 0.0, 0.0), eye)
    assert _is_in_view(take_frame(world), origin, view).tolist() == [True, False, True, False, False, True]


def test_beams_begin_at_the_noses_of_the_nearest_vehicles_and_look_a_bit_down() -> None:
    world = World()
    body = Body()
    for k in range(12):
        world.spawn(Kind.VEHICLE, body, name="car", x=10.0 * (12 - k), y=0.0, yaw=math.pi / 2)
    world.spawn(Kind.PEDESTRIAN, Body.box(0.5, 0.5, 1.7), name="Man", x=1.0, y=0.0)
    world.spawn(Kind.VEHICLE, body, name="car", x=5_000.0, y=0.0)
    places, ways = _beams(take_frame(world), np.zeros(3))
    nose = body.length - body.rear_overhang
    assert len(places) <= 12
    assert places[:2] == pytest.approx(np.array([(10.0, nose, 0.65), (20.0, nose, 0.65)]))
    assert np.linalg.norm(ways, axis=1) == pytest.approx(1.0)
    assert ways[0] == pytest.approx(np.array([0.0, 1.0, -0.06]) / math.hypot(1.0, 0.06))
    assert [len(each) for each in _beams(take_frame(World()), np.zeros(3))] == [0, 0]

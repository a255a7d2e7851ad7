from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.maps.mgeo import NO_PROJECTION
from rosbridge_sim.maps.road_map import Marking, RoadMap, Sign
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.road_signs import add_markings
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from tests.world.road_factory import line, make

ARROW = np.array(
    [(0, -0.1, 0), (3, -0.1, 0), (3, -0.5, 0), (5, 0, 0), (3, 0.5, 0), (3, 0.1, 0), (0, 0.1, 0)], dtype=np.float64
)
"""A shaft of 3 x 0.2 m, and a head of 2 x 1 m."""


def area_of(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.triangles[:, i]].astype(np.float64) for i in range(3))
    return float(0.5 * np.cross(b - a, c - a)[:, 2].sum())


@pytest.mark.parametrize("outline", [ARROW, ARROW[::-1], np.concatenate([ARROW, ARROW[:1]])])
def test_arrow_is_filled_and_looks_up(outline: np.ndarray) -> None:
    builder = MeshBuilder(np.zeros(3))
    add_markings(builder, [Marking("arrow", outline)])
    mesh = builder.finish()
    assert len(mesh) == 5
    assert (mesh.normals[:, 2] > 0.99).all()
    assert area_of(mesh) == pytest.approx(0.6 + 1.0, abs=1e-6)
    assert set(mesh.label) == {Label.PAINT_WHITE}


@pytest.mark.parametrize("turn", [1, -1])
def test_triangle_looks_up_whatever_its_order(turn: int) -> None:
    builder = MeshBuilder(np.zeros(3))
    outline = np.array([(0, 0, 0), (2, 0, 0), (0, 3, 0)], dtype=np.float64)[::turn]
    add_markings(builder, [Marking("wedge", outline)])
    assert area_of(builder.finish()) == pytest.approx(3.0)


def test_outline_that_crosses_itself_ends() -> None:
    builder = MeshBuilder(np.zeros(3))
    add_markings(builder, [Marking("bow", np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)], dtype=np.float64))])
    assert len(builder.finish()) <= 2


def test_plate_is_turned_as_its_heading_says() -> None:
    roads = make(a=(line((0, 0), (100, 0)), ""))
    yaw = math.radians(30.0)
    signs = (Sign("stop", 50.0, 8.0, 3.0, yaw, "2", width=0.8, height=0.5),)
    mesh = static_mesh(RoadMap("tiny", NO_PROJECTION, (0.0, 0.0, 0.0), roads, signs=signs), "tiny", 0, is_dressed=False)
    plate = mesh.vertices[mesh.triangles[mesh.label == Label.SIGN]].reshape(-1, 3) + mesh.origin - (50.0, 8.0, 3.0)
    facing = plate[:, 0] * math.cos(yaw) + plate[:, 1] * math.sin(yaw)
    aside = plate[:, 1] * math.cos(yaw) - plate[:, 0] * math.sin(yaw)
    assert (facing.min(), aside.min(), aside.max()) == pytest.approx((0.0, -0.4, 0.4), abs=1e-3)
    assert 0.01 < facing.max() < 0.1
    assert (plate[:, 2].min(), plate[:, 2].max()) == pytest.approx((-0.25, 0.25), abs=1e-3)
    pole = mesh.vertices[mesh.triangles[mesh.label == Label.POLE]].reshape(-1, 3) + mesh.origin - (50.0, 8.0, 3.0)
    middle = 0.5 * (pole.min(axis=0) + pole.max(axis=0))
    assert middle[0] * math.cos(yaw) + middle[1] * math.sin(yaw) < -0.02  # behind the plate
    assert middle[1] * math.cos(yaw) - middle[0] * math.sin(yaw) == pytest.approx(0.0, abs=0.01)


def test_markings_lie_half_a_centimetre_above_the_road() -> None:
    builder = MeshBuilder(np.zeros(3))
    add_markings(builder, [Marking("arrow", ARROW + np.array((0.0, 0.0, 7.0)))])
    assert builder.finish().vertices[:, 2] == pytest.approx(7.005, abs=1e-5)


def test_sign_faces_its_heading_on_a_pole_beside_the_road() -> None:
    roads = make(a=(line((0, 0), (100, 0)), ""))
    signs = (Sign("stop", 50.0, 6.0, 0.0, np.pi, "2"), Sign("gantry", 50.0, 0.0, 0.0, np.pi, width=4.0, height=2.0))
    mesh = static_mesh(RoadMap("tiny", NO_PROJECTION, (0.0, 0.0, 0.0), roads, signs=signs), "tiny", 0, is_dressed=False)
    corners = mesh.vertices[mesh.triangles[mesh.label == Label.SIGN]].reshape(-1, 3) + mesh.origin
    low, high = corners[corners[:, 1] > 3.0], corners[corners[:, 1] < 3.0]
    assert low.min(axis=0) == pytest.approx([49.98, 5.7, 2.0], abs=0.1)
    assert low[:, 2].max() == pytest.approx(2.6, abs=0.1)
    assert (low[:, 1].min(), low[:, 1].max()) == pytest.approx((5.7, 6.3), abs=1e-3)
    assert high[:, 2].min() == pytest.approx(5.0, abs=0.1)  # over the road, and without a pole
    poles = mesh.vertices[mesh.triangles[mesh.label == Label.POLE]].reshape(-1, 3) + mesh.origin
    assert (np.hypot(poles[:, 0] - 50.0, poles[:, 1] - 6.0) < 0.15).all()

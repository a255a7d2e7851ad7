"""Simple solids have the volumes and sides that geometry gives them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.solids import box, column, disc, join, prism
from tests.scenery.solid_figures import area_of, is_closed, parts_of, volume_of


def test_box_is_closed_and_looks_outwards() -> None:
    vertices, triangles = box((1.0, 2.0, 3.0), (2.0, 4.0, 7.0))
    assert volume_of(vertices, triangles) == pytest.approx(8.0)
    assert area_of(vertices, triangles) == pytest.approx(2 * (2 + 4 + 8))
    assert is_closed(triangles)
    assert (vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()) == ([1, 2, 3], [2, 4, 7])


@pytest.mark.parametrize("top", [None, 0.5, 2.0])
def test_column_is_a_frustum_without_a_floor(top: float | None) -> None:
    vertices, triangles = column(1.0, 0.0, 3.0, 8, top)
    upper = 1.0 if top is None else top
    area = 0.5 * 8 * math.sin(2 * math.pi / 8)  # of a regular polygon of radius 1
    assert volume_of(vertices, triangles) == pytest.approx(area * (1.0 + upper + upper * upper))
    assert not is_closed(triangles)
    floor = np.array([[0, i + 1, i] for i in range(1, 7)])
    assert is_closed(np.concatenate([triangles, floor]))
    assert np.hypot(*vertices[:8, :2].T) == pytest.approx(1.0)
    assert np.hypot(*vertices[8:, :2].T) == pytest.approx(upper)
    assert len(column(1.0, 0.0, 1.0)[0]) == 12


def test_prism_shrinks_about_the_origin_to_its_top() -> None:
    outline = np.array([(0.0, 0.0), (2.0, 0.0), (0.0, 2.0)])
    vertices, triangles = prism(outline, 1.0, 2.0, 0.5)
    assert vertices[3:].tolist() == [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]]
    assert len(triangles) == 7


def test_disc_looks_along_x() -> None:
    vertices, triangles = disc(2.0, 6)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normals = 0.5 * np.cross(b - a, c - a)
    assert normals.sum(axis=0) == pytest.approx(np.array([4.0 * 3.0 * math.sin(math.pi / 3), 0.0, 0.0]))
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(2.0)


def test_joined_solids_keep_their_parts() -> None:
    one, two, three = box((0, 0, 0), (1, 1, 1)), column(1.0, 5.0, 6.0), box((2, 2, 2), (4, 4, 4))
    vertices, triangles = join(one, two, three)
    volumes = [volume_of(vertices, part) for part in parts_of(triangles)]
    assert [volumes[0], volumes[2]] == pytest.approx([1.0, 8.0])
    assert len(vertices) == 8 + 12 + 8

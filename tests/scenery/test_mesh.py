"""Arrays of triangles."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.scenery.mesh import Label, Lit, Mesh, join_meshes

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
HALVES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def test_joined_meshes_keep_the_attributes_of_their_triangles() -> None:
    one = Mesh.of(SQUARE, HALVES, (1, 2, 3), Label.ASPHALT)
    two = Mesh.of(SQUARE + 5, HALVES[:1], (4, 5, 6), Label.VEHICLE, instance=8, lit=Lit.NOW)
    both = join_meshes([one, two])
    assert both.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    assert both.label.tolist() == [Label.ASPHALT, Label.ASPHALT, Label.VEHICLE]
    assert both.colour.tolist() == [[1, 2, 3], [1, 2, 3], [4, 5, 6]]
    assert both.instance.tolist() == [0, 0, 8]
    assert both.lit.tolist() == [Lit.NEVER, Lit.NEVER, Lit.NOW]


def test_meshes_of_different_origins_are_not_joined() -> None:
    one, two = (Mesh.of(SQUARE, HALVES, (0, 0, 0), Label.NONE, origin=np.full(3, x)) for x in (0.0, 1.0))
    with pytest.raises(ValueError, match="origin"):
        join_meshes([one, two])
    with pytest.raises(ValueError, match="at least one"):
        join_meshes([])


def test_normals_look_to_where_the_corners_go_counter_clockwise() -> None:
    flat = np.concatenate([SQUARE, SQUARE[:1]])
    mesh = Mesh.of(flat, np.array([[0, 1, 2], [0, 2, 1], [0, 0, 1]]), (0, 0, 0), Label.NONE)
    assert mesh.normals.tolist() == [[0, 0, 1], [0, 0, -1], [0, 0, 0]]


def test_digest_differs_for_every_attribute() -> None:
    mesh = Mesh.of(SQUARE, HALVES, (1, 2, 3), Label.ASPHALT)
    others = [
        Mesh.of(SQUARE + 1, HALVES, (1, 2, 3), Label.ASPHALT),
        Mesh.of(SQUARE, HALVES[::-1], (1, 2, 3), Label.ASPHALT),
        Mesh.of(SQUARE, HALVES, (1, 2, 4), Label.ASPHALT),
        Mesh.of(SQUARE, HALVES, (1, 2, 3), Label.KERB),
        Mesh.of(SQUARE, HALVES, (1, 2, 3), Label.ASPHALT, instance=1),
        Mesh.of(SQUARE, HALVES, (1, 2, 3), Label.ASPHALT, lit=Lit.NOW),
        Mesh.of(SQUARE, HALVES, (1, 2, 3), Label.ASPHALT, origin=np.ones(3)),
    ]
    assert len({mesh.digest, *(other.digest for other in others)}) == len(others) + 1
    assert mesh.digest == Mesh.of(SQUARE.copy(), HALVES.copy(), (1, 2, 3), Label.ASPHALT).digest

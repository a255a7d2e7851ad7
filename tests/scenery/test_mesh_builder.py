"""Meshes that are built of parts."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.scenery.mesh import NO_INSTANCE, Label, Lit
from rosbridge_sim.scenery.mesh_builder import MeshBuilder

ORIGIN = np.array([100.0, 200.0, 0.0])
SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=np.float64)
HALVES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def test_parts_keep_their_own_corners_colours_classes_and_lamps() -> None:
    builder = MeshBuilder(ORIGIN)
    builder.add(SQUARE + ORIGIN, HALVES, (1, 2, 3), Label.TREE)
    builder.add(SQUARE, np.zeros((0, 3), dtype=np.int32), (9, 9, 9), Label.KERB)  # no triangles: nothing is added
    colours = np.array([(4, 5, 6), (7, 8, 9)], dtype=np.uint8)
    builder.add(SQUARE + ORIGIN + 5.0, HALVES[::-1], colours, Label.POLE, Lit.IN_THE_DARK)
    mesh = builder.finish()
    assert mesh.origin.tolist() == ORIGIN.tolist()
    assert mesh.vertices.tolist() == [*SQUARE.tolist(), *(SQUARE + 5.0).tolist()]
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [4, 6, 7], [4, 5, 6]]
    assert mesh.colour.tolist() == [[1, 2, 3], [1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert mesh.label.tolist() == [Label.TREE, Label.TREE, Label.POLE, Label.POLE]
    assert mesh.lit.tolist() == [Lit.NEVER, Lit.NEVER, Lit.IN_THE_DARK, Lit.IN_THE_DARK]
    assert mesh.instance.tolist() == [NO_INSTANCE] * 4


def test_quadrilateral_is_two_triangles_that_look_to_its_upper_side() -> None:
    builder = MeshBuilder(np.zeros(3))
    builder.add_quads(np.stack([SQUARE, SQUARE + 10.0]), (1, 2, 3), Label.ASPHALT)
    mesh = builder.finish()
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    assert mesh.normals.tolist() == [[0.0, 0.0, 1.0]] * 4
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    assert (0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)).tolist() == [1.0] * 4


def test_copies_of_a_shape_stand_at_their_places() -> None:
    places = np.array([(100.0, 200.0, 1.0), (103.0, 204.0, 2.0), (90.0, 200.0, 0.0)])
    for shape in (SQUARE, np.stack([SQUARE, SQUARE, SQUARE])):
        builder = MeshBuilder(ORIGIN)
        builder.add_copies(shape, HALVES, places, colour=(1, 2, 3), label=Label.POLE, lit=Lit.NOW)
        mesh = builder.finish()
        wanted = [(SQUARE + place - ORIGIN)[HALVES] for place in places]
        assert mesh.vertices[mesh.triangles].tolist() == np.concatenate(wanted).tolist()
        assert (set(mesh.label.tolist()), set(mesh.lit.tolist())) == ({Label.POLE}, {Lit.NOW})


def test_nothing_added_is_an_empty_mesh_at_the_origin() -> None:
    mesh = MeshBuilder(ORIGIN).finish()
    assert len(mesh) == 0
    assert mesh.origin.tolist() == ORIGIN.tolist()

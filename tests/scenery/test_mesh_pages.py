"""A mesh in pages for the wire."""

from __future__ import annotations

import zlib

import numpy as np

from rosbridge_sim.scenery.mesh_pages import MeshPage, mesh_pages
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.shell.files.library import DiskLibrary


def unpack(page: MeshPage) -> tuple[np.ndarray, np.ndarray]:
    """Corners in the map frame, (m, 3, 3) [m], and colour with class of each triangle, (m, 4)."""
    data = zlib.decompress(page.data)
    ends = np.cumsum([6 * page.num_vertices, 6 * page.num_triangles, page.num_triangles])
    assert ends[-1] == len(data)
    vertices = np.frombuffer(data[: ends[0]], "<i2").reshape(-1, 3) * np.array(page.scale) + page.middle
    triangles = np.frombuffer(data[ends[0] : ends[1]], "<u2").reshape(-1, 3)
    palette = np.frombuffer(page.palette, np.uint8).reshape(-1, 4)
    return vertices[triangles], palette[np.frombuffer(data[ends[1] :], np.uint8)]


def test_pages_have_each_triangle_in_its_colour_within_a_centimetre_and_few_bytes() -> None:
    mesh = static_mesh(DiskLibrary().map("track"), "track", 0)
    made = mesh_pages(mesh)
    parts = [unpack(page) for page in made.pages]
    corners = np.concatenate([corners for corners, _ in parts])
    looks = np.concatenate([looks for _, looks in parts])
    assert len(corners) == len(mesh)
    wanted = mesh.vertices[mesh.triangles] + mesh.origin
    # The order is by squares: the sums over all triangles of a class tell whether each is there.
    for label in np.unique(mesh.label):
        own, told = mesh.label == label, looks[:, 3] == label
        assert own.sum() == told.sum()
        assert np.allclose(np.sort(wanted[own], axis=0), np.sort(corners[told], axis=0), atol=0.01)
        assert np.array_equal(np.sort(mesh.colour[own], axis=0), np.sort(looks[told, :3], axis=0))
    assert sum(len(page.data) + len(page.palette) for page in made.pages) < 12 * len(mesh)
    assert mesh_pages(mesh).digest == made.digest

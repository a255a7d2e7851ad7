"""A mesh in pages for the wire."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest

from rosbridge_sim.scenery.mesh import Label, Mesh, join_meshes
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
    mesh = static_mesh(DiskLibrary().map("parking"), "parking", 0)
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


def grid(num: int, *, side: float = 100.0, num_colours: int = 1) -> Mesh:
    """So many triangles within a square, each in one of some colours."""
    rng = np.random.default_rng(1)
    vertices = rng.uniform(1.0, side, (3 * num, 3)).astype(np.float32)
    colours = np.stack(
        [np.arange(num) % num_colours // 256 * 8, np.arange(num) % num_colours % 256, np.zeros(num)], axis=1
    )
    mesh = Mesh.of(vertices, np.arange(3 * num, dtype=np.int32).reshape(-1, 3), (0, 0, 0), Label.ASPHALT)
    return replace(mesh, colour=colours.astype(np.uint8))


CORNERS = ((0, 0), (254, 0), (256, 0), (0, 256), (10, 10))
"""Of triangles: three of them lie in one square of 256 m."""


def test_page_has_twenty_thousand_triangles_at_most_and_one_square() -> None:
    assert [page.num_triangles for page in mesh_pages(grid(20_000)).pages] == [20_000]
    assert [page.num_triangles for page in mesh_pages(grid(20_001)).pages] == [20_000, 1]
    places = [np.array([(x, y, 0), (x + 1, y, 0), (x, y + 1, 0)], np.float32) for x, y in CORNERS]
    apart = join_meshes([Mesh.of(place, np.array([[0, 1, 2]]), (1, 2, 3), Label.TREE) for place in places])
    assert sorted(page.num_triangles for page in mesh_pages(apart).pages) == [1, 1, 3]
    assert mesh_pages(Mesh.empty()).pages == ()


def test_squares_are_seen_from_above_so_a_high_place_is_on_the_page_below_it() -> None:
    corners = np.array([(1, 1, 0), (2, 1, 0), (1, 2, 0)], np.float32)
    made = mesh_pages(
        join_meshes(
            [
                Mesh.of(corners + np.array((0, 0, z)), np.array([[0, 1, 2]]), (1, 2, 3), Label.TREE)
                for z in (0, 300, 600)
            ]
        )
    )
    assert [page.num_triangles for page in made.pages] == [3]
    assert len(bytes.fromhex(made.digest)) == 16


def test_steps_of_a_page_fill_its_numbers_and_keep_each_place_to_half_a_step() -> None:
    mesh = grid(300, side=200.0)
    (page,) = mesh_pages(mesh).pages
    corners, _ = unpack(page)
    found, wanted = corners.reshape(-1, 3), mesh.vertices.astype(np.float64)
    assert np.abs(found - wanted).max() <= 0.51 * max(page.scale)
    assert np.ptp(wanted, axis=0) / page.scale == pytest.approx(65_000, rel=1e-3)
    flat = mesh_pages(
        Mesh.of(np.array([(0, 0, 5), (1, 0, 5), (0, 1, 5)], np.float32), np.array([[0, 1, 2]]), (0, 0, 0), Label.TREE)
    )
    assert unpack(flat.pages[0])[0][..., 2].ravel() == pytest.approx([5.0] * 3, abs=1e-4)


def test_more_colours_than_a_page_has_become_the_nearest_of_the_usual_ones() -> None:
    few = grid(256, num_colours=256)
    _, looks = unpack(mesh_pages(few).pages[0])
    assert np.array_equal(np.sort(looks[:, 1]), np.arange(256))
    many = grid(512 + 256, num_colours=512)  # the first 256 twice
    _, looks = unpack(mesh_pages(many).pages[0])
    assert len(np.unique(looks, axis=0)) == 256
    assert np.array_equal(looks[:256, :3], many.colour[:256])
    assert np.array_equal(looks[256:512, 1], many.colour[256:512, 1])  # the first of three numbers differs least

"""A mesh in pages for the wire: small numbers instead of floats, and colours by a palette.

A page has the triangles of a square of the map. Its vertices are whole steps from its middle: a step is the page's
extent divided by 65,000, some 4 mm in a square of 256 m.
"""

from __future__ import annotations

import zlib
from hashlib import blake2b
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.records import Record
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.world.geometry.planar import FloatArray

SIDE: Final = 256.0
"""Side of the square of a page [m]."""

MAX_TRIANGLES: Final = 20_000
"""Triangles of a page: their corners have numbers of 16 bits then. About 150 kB on the wire."""

MAX_COLOURS: Final = 256
"""Colours of a page; those of most triangles are kept, and others become the nearest of them."""

HALF_RANGE: Final = 32_500
"""Greatest number of steps from the middle."""


class MeshPage(Record):
    """The triangles of a square, as a page of `/sim/scene/mesh` has them.

    Attributes:
        middle: x, y, z in the map frame [m].
        scale: length of a step along x, y, z [m].
        num_vertices: number of corners.
        palette: red, green, blue and class of each colour.
        data: vertices, triangles and colours, compressed by zlib.
    """

    middle: tuple[float, float, float]
    scale: tuple[float, float, float]
    num_vertices: int
    num_triangles: int
    palette: bytes
    data: bytes


class MeshPages(Record):
    """All pages of a mesh.

    Attributes:
        digest: 32 hexadecimal digits that stand for all of it.
        pages: none for an empty mesh.
    """

    digest: str
    pages: tuple[MeshPage, ...]


def mesh_pages(mesh: Mesh) -> MeshPages:
    """Return a mesh in pages. It takes about as long as making the mesh: call it in a thread.

    Args:
        mesh: triangles with colours and classes; instances and lamps are left out.
    """
    corners = mesh.vertices[mesh.triangles]
    tiles = np.floor(corners[:, :, :2].mean(axis=1) / SIDE).astype(np.int64)
    order = np.lexsort((tiles[:, 0], tiles[:, 1]))
    ends = np.flatnonzero(np.any(np.diff(tiles[order], axis=0) != 0, axis=1)) + 1
    pages = [
        _page(mesh, rows[first : first + MAX_TRIANGLES])
        for rows in np.split(order, ends)
        for first in range(0, len(rows), MAX_TRIANGLES)
    ]
    state = blake2b(digest_size=16)
    for page in pages:
        state.update(repr((page.middle, page.scale)).encode() + page.palette + page.data)
    return MeshPages(state.hexdigest(), tuple(pages))


def _page(mesh: Mesh, rows: NDArray[np.int64]) -> MeshPage:
    corners = mesh.vertices[mesh.triangles[rows]].reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = 0.5 * (low + high)
    scale: FloatArray = np.maximum((high - low) / (2 * HALF_RANGE), 1e-6).astype(np.float32).astype(np.float64)
    steps = np.rint((corners - middle) / scale).astype("<i2")
    vertices, numbers = np.unique(steps, axis=0, return_inverse=True)
    looks = np.column_stack([mesh.colour[rows], mesh.label[rows]])
    palette, colours = _palette(looks)
    data = vertices.tobytes() + numbers.reshape(-1).astype("<u2").tobytes() + colours.tobytes()
    return MeshPage(
        tuple((middle + mesh.origin).tolist()),
        tuple(scale.tolist()),
        len(vertices),
        len(rows),
        palette.tobytes(),
        zlib.compress(data),
    )


def _palette(looks: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the colours of triangles, (k, 4), and the row of each triangle's."""
    found, numbers, counts = np.unique(looks, axis=0, return_inverse=True, return_counts=True)
    numbers = numbers.reshape(-1)
    if len(found) <= MAX_COLOURS:
        return found, numbers.astype(np.uint8)
    kept = found[np.argsort(-counts, kind="stable")[:MAX_COLOURS]]
    away = np.abs(found[:, None, :].astype(np.int64) - kept[None, :, :]).sum(axis=2)
    return kept, away.argmin(axis=1)[numbers].astype(np.uint8)

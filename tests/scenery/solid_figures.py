"""Figures of solids: volumes, areas, and whether a shape is closed or the same on both sides."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.world.geometry.planar import FloatArray

__all__ = ["area_of", "area_seen_from_above", "is_closed", "is_mirrored", "parts_of", "volume_of"]

Vertices = NDArray[np.float64] | NDArray[np.float32]
Triangles = NDArray[np.int32] | NDArray[np.int64]


def _corners(vertices: Vertices, triangles: Triangles) -> tuple[FloatArray, FloatArray, FloatArray]:
    a, b, c = (np.asarray(vertices, dtype=np.float64)[triangles[:, i]] for i in range(3))
    return a, b, c


def volume_of(vertices: Vertices, triangles: Triangles) -> float:
    """Volume of a closed solid; negative if its faces look inwards."""
    a, b, c = _corners(vertices, triangles)
    return float((a * np.cross(b, c)).sum() / 6.0)


def area_of(vertices: Vertices, triangles: Triangles) -> float:
    """Area of all faces."""
    a, b, c = _corners(vertices, triangles)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def area_seen_from_above(vertices: Vertices, triangles: Triangles) -> float:
    """Area of the faces as seen from above; those that look down count as negative."""
    a, b, c = _corners(vertices, triangles)
    return float(0.5 * np.cross(b - a, c - a)[:, 2].sum())


def is_closed(triangles: Triangles) -> bool:
    """Whether each edge has one face on either side."""
    edges = Counter((int(face[i]), int(face[(i + 1) % 3])) for face in triangles for i in range(3))
    return all(num == 1 and edges[b, a] == 1 for (a, b), num in edges.items())


def is_mirrored(vertices: FloatArray) -> bool:
    """Whether the corners are the same on both sides of the plane y = 0."""
    both = [sorted(map(tuple, (np.round(vertices * (1.0, side, 1.0), 6) + 0.0).tolist())) for side in (1.0, -1.0)]
    return both[0] == both[1]


def parts_of(triangles: Triangles) -> list[Triangles]:
    """The triangles of each part that hangs together by its corners."""
    parent = list(range(int(triangles.max()) + 1))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = i = parent[parent[i]]
        return i

    for a, b, c in triangles.tolist():
        parent[root(b)] = root(a)
        parent[root(c)] = root(a)
    owner = np.array([root(a) for a in triangles[:, 0].tolist()])
    return [triangles[owner == each] for each in dict.fromkeys(owner.tolist())]

"""Collects triangles in the map frame, and makes one mesh of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rosbridge_sim.scenery.mesh import Colour, Label, Lit, Mesh, join_meshes
from rosbridge_sim.scenery.solids import Solid, turned
from rosbridge_sim.world.geometry.planar import FloatArray


class MeshBuilder:
    """Triangles that grow piece by piece.

    Args:
        origin: (3,) of the mesh that is made, map frame [m].
    """

    def __init__(self, origin: FloatArray) -> None:
        self._origin = origin
        self._parts = [Mesh.empty(origin)]

    def add(
        self,
        vertices: FloatArray,
        triangles: NDArray[np.int32] | NDArray[np.int64],
        colour: Colour | NDArray[np.uint8],
        label: Label,
        lit: Lit = Lit.NEVER,
    ) -> None:
        """Add triangles.

        Args:
            vertices: (n, 3) map frame [m].
            triangles: (m, 3) rows of them.
            colour: of all, or (m, 3) uint8.
        """
        if len(triangles):
            at = self._origin
            self._parts.append(Mesh.of(vertices - at, triangles, colour, label, origin=at, lit=lit))

    def add_solid(
        self, solid: Solid, at: ArrayLike, colour: Colour, label: Label, *, way: ArrayLike = (1.0, 0.0)
    ) -> None:
        """Add a solid at a place, turned from its own x axis to a direction.

        Args:
            at: (3,) of its origin, map frame [m].
            way: (2,) unit vector.
        """
        vertices, triangles = solid
        self.add(turned(vertices, way) + np.asarray(at), triangles, colour, label)

    def add_quads(self, corners: FloatArray, colour: Colour | NDArray[np.uint8], label: Label) -> None:
        """Add quadrilaterals.

        Args:
            corners: (q, 4, 3) counter-clockwise as seen from their upper side, map frame [m].
            colour: of all, or (2 q, 3) uint8.
        """
        first = 4 * np.arange(len(corners), dtype=np.int32)[:, None, None]
        halves = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
        self.add(corners.reshape(-1, 3), (first + halves).reshape(-1, 3), colour, label)

    def add_copies(
        self,
        vertices: FloatArray,
        triangles: NDArray[np.int32],
        places: FloatArray,
        *,
        colour: Colour,
        label: Label,
        lit: Lit = Lit.NEVER,
    ) -> None:
        """Add copies of one shape.

        Args:
            vertices: (n, 3) of the shape, or (c, n, 3) of each copy [m].
            triangles: (m, 3) rows of them.
            places: (c, 3) where its origin comes to lie, map frame [m].
        """
        moved = vertices + places[:, None]
        first = moved.shape[1] * np.arange(len(places), dtype=np.int32)[:, None, None]
        self.add(moved.reshape(-1, 3), (first + triangles).reshape(-1, 3), colour, label, lit)

    def finish(self) -> Mesh:
        """Return the mesh of all that was added."""
        return join_meshes(self._parts)

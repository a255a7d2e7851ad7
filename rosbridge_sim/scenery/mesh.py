"""Triangles with a colour, a class and an instance each: what camera, lidar and the page's 3D view draw.

A `Mesh` has arrays, no objects: thousands of triangles are moved, joined and uploaded by a few calls of numpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from hashlib import blake2b
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.solids import join

Colour = tuple[int, int, int]
"""Red, green and blue, 0..255, as a camera sees it at noon."""

NO_INSTANCE: Final = 0
"""`Mesh.instance` of what is no entity."""


class Label(IntEnum):
    """Class of a triangle. The numbers are those of semantic pictures; a number never changes its meaning."""

    NONE = 0  # the sky, and rays that met nothing
    ASPHALT = 1
    PAINT_WHITE = 2
    PAINT_YELLOW = 3
    PAINT_BLUE = 4
    CROSSWALK = 5
    STOP_LINE = 6
    KERB = 7
    PAVEMENT = 8
    GROUND = 9
    BUILDING = 10
    TREE = 11
    POLE = 12
    TRAFFIC_LIGHT = 13
    SIGN = 14
    VEHICLE = 15
    MOTORCYCLE = 16
    BICYCLE = 17
    PEDESTRIAN = 18
    OBSTACLE = 19


PAINTED: Final = (Label.PAINT_WHITE, Label.PAINT_YELLOW, Label.PAINT_BLUE, Label.CROSSWALK, Label.STOP_LINE)
"""Classes of paint on roads. It lies some millimetres above the asphalt, so that pictures do not mix both; for rays it
has no height."""


class Lit(IntEnum):
    """Condition under which a triangle shines by itself."""

    NEVER = 0
    NOW = 1
    IN_THE_DARK = 2  # head lamps and street lamps


_LOOKS: Final = ("colour", "label", "instance", "lit")


@dataclass(frozen=True, eq=False)  # without slots, because the digest is kept
class Mesh:
    """Triangles; never changed after they are made. `m` triangles have `n` corners.

    Attributes:
        origin: (3,) float64, the place in the map frame from which `vertices` count [m].
        vertices: (n, 3) float32, east, north, up from `origin` [m].
        triangles: (m, 3) int32, rows of `vertices`. Both sides are seen.
        colour: (m, 3) uint8, red, green, blue.
        label: (m,) uint8, see `Label`.
        instance: (m,) int32, id of the entity plus 1; `NO_INSTANCE` for what is none.
        lit: (m,) uint8, whether it shines by itself, see `Lit`.
    """

    origin: NDArray[np.float64]
    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    colour: NDArray[np.uint8]
    label: NDArray[np.uint8]
    instance: NDArray[np.int32]
    lit: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.triangles)

    @cached_property
    def normals(self) -> NDArray[np.float32]:
        """(m, 3) unit normals by the order of the corners, counter-clockwise from outside; 0 where there is no area."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        length = np.sqrt(np.einsum("ij,ij->i", normal, normal))
        return np.asarray(normal / np.maximum(length, np.finfo(np.float32).tiny)[:, None], dtype=np.float32)

    @cached_property
    def digest(self) -> str:
        """32 hexadecimal digits that stand for all of it."""
        state = blake2b(digest_size=16)
        for array in (self.origin, self.vertices, self.triangles, self.colour, self.label, self.instance, self.lit):
            state.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return state.hexdigest()

    def pick(self, which: NDArray[np.bool_] | NDArray[np.int64] | NDArray[np.int32]) -> Mesh:
        """Return some of the triangles, with all vertices.

        Args:
            which: (m,) bool, or (k,) rows of triangles.
        """
        return replace(self, **{name: getattr(self, name)[which] for name in ("triangles", *_LOOKS)})

    @classmethod
    def of(
        cls,
        vertices: NDArray[np.float32] | NDArray[np.float64],
        triangles: NDArray[np.int32] | NDArray[np.int64],
        colour: Colour | NDArray[np.uint8],
        label: Label,
        *,
        origin: NDArray[np.float64] | None = None,
        instance: int = NO_INSTANCE,
        lit: Lit = Lit.NEVER,
    ) -> Mesh:
        """Return triangles of one class.

        Args:
            vertices: (n, 3) from the origin [m].
            triangles: (m, 3) rows of them.
            colour: of all, or (m, 3) uint8.
            origin: (3,) in the map frame [m]; None for (0, 0, 0).
        """
        num = len(triangles)
        return cls(
            np.zeros(3) if origin is None else origin,
            np.asarray(vertices, dtype=np.float32).reshape(-1, 3),
            np.asarray(triangles, dtype=np.int32).reshape(-1, 3),
            np.zeros((num, 3), dtype=np.uint8) + np.asarray(colour, dtype=np.uint8),
            np.full(num, label, dtype=np.uint8),
            np.full(num, instance, dtype=np.int32),
            np.full(num, lit, dtype=np.uint8),
        )

    @classmethod
    def empty(cls, origin: NDArray[np.float64] | None = None) -> Mesh:
        """Return a mesh without triangles."""
        return cls.of(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), (0, 0, 0), Label.NONE, origin=origin)


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Return the triangles of several meshes in one, in their order.

    Args:
        meshes: at least one; all have the same origin.

    Raises:
        ValueError: there is none, or the origins differ.
    """
    if not meshes:
        raise ValueError("meshes: expected at least one")
    origin = meshes[0].origin
    if any(each.origin is not origin and not np.array_equal(each.origin, origin) for each in meshes):
        raise ValueError("meshes: expected the same origin for all")
    vertices, triangles = join(*((each.vertices, each.triangles) for each in meshes))
    looks = (np.concatenate([getattr(each, name) for each in meshes]) for name in _LOOKS)
    return Mesh(origin, vertices, triangles, *looks)

"""The ground beside the roads: a grid of heights that follows them and stays just below them."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.scenery.mesh import Colour, Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray
from rosbridge_sim.world.roads.roads import Roads

MARGIN: Final = 250.0
"""The ground reaches this far beyond the outermost lanes [m]."""

CELL: Final = 6.0
FLAT_CELL: Final = 20.0
"""Side of a cell on hills and on flat maps [m], as long as there are not more than `MAX_CELLS`."""

MAX_CELLS: Final = 160
"""Cells along a side of the grid at most: 51,200 triangles."""

BELOW: Final = 0.06
"""The ground is so far below the roads [m], so that it never shows through them."""

ROUNDS: Final = 300
"""Rounds of smoothing between the roads; each evens out over one cell more."""

GRASS: Final[tuple[Colour, ...]] = ((84, 119, 72), (88, 125, 76), (79, 114, 69), (90, 123, 80))
"""Colours of cells."""


class Terrain:
    """The ground of one map.

    Args:
        roads: at least one lane.
    """

    def __init__(self, roads: Roads, cover: RoadCover) -> None:
        points = roads.points
        low = points[:, :2].min(axis=0) - MARGIN
        size = points[:, :2].max(axis=0) + MARGIN - low
        cell = max(FLAT_CELL if roads.is_flat else CELL, float(size.max()) / MAX_CELLS)
        self._low, self._cell = low, cell
        columns, rows = (math.ceil(side / cell) + 1 for side in size)
        x, y = np.meshgrid(low[0] + cell * np.arange(columns), low[1] + cell * np.arange(rows), indexing="ij")
        place = np.column_stack([x.ravel(), y.ravel()])
        height = cover.height(place).reshape(x.shape)
        if not roads.is_flat:
            is_near = (cover.distance(place) < 1.5 * cell).reshape(x.shape)
            height = _smooth(_lowest_around(height, is_near), is_near)
        self._height = height - BELOW

    def height(self, points: FloatArray) -> FloatArray:
        """Return the height of the ground at places (n, 2 or more), (n,) [m]."""
        last = np.array(self._height.shape) - 2
        at = (points[:, :2] - self._low) / self._cell
        cell = np.clip(np.floor(at).astype(np.int64), 0, last)
        u, v = np.clip(at - cell, 0.0, 1.0).T
        i, j = cell.T
        height = self._height
        return np.asarray(
            (1 - u) * (1 - v) * height[i, j]
            + u * (1 - v) * height[i + 1, j]
            + (1 - u) * v * height[i, j + 1]
            + u * v * height[i + 1, j + 1]
        )

    def add_to(self, builder: MeshBuilder) -> None:
        """Add the ground to a mesh."""
        columns, rows = self._height.shape
        i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
        vertices = np.column_stack(
            [self._low[0] + self._cell * i.ravel(), self._low[1] + self._cell * j.ravel(), self._height.ravel()]
        )
        at = (i[:-1, :-1] * rows + j[:-1, :-1]).ravel()
        quads = np.column_stack([at, at + rows, at + rows + 1, at, at + rows + 1, at + 1]).reshape(-1, 3)
        shade = (7 * i[:-1, :-1] + 3 * j[:-1, :-1] + (i[:-1, :-1] * j[:-1, :-1]) // 2) % len(GRASS)
        colour = np.repeat(np.array(GRASS, dtype=np.uint8)[shade.ravel()], 2, axis=0)
        builder.add(vertices, quads.astype(np.int32), colour, Label.GROUND)


def _lowest_around(height: FloatArray, is_near: BoolArray) -> FloatArray:
    """Return heights of which those near a road are the lowest of their neighbourhood."""
    wide = np.pad(height, 1, mode="edge")
    num_x, num_y = height.shape
    lowest = np.min([wide[a : a + num_x, b : b + num_y] for a in range(3) for b in range(3)], axis=0)
    return np.where(is_near, lowest, height)


def _smooth(height: FloatArray, is_fixed: BoolArray) -> FloatArray:
    """Return heights that change evenly between those that are fixed."""
    for _ in range(ROUNDS):
        wide = np.pad(height, 1, mode="edge")
        mean = 0.25 * (wide[2:, 1:-1] + wide[:-2, 1:-1] + wide[1:-1, 2:] + wide[1:-1, :-2])
        height = np.where(is_fixed, height, mean)
    return height

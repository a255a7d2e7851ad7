"""Grids around egos: which cells are occupied, how fast that moves, and where the road is."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.vehicle.ground import are_on_road
from rosbridge_sim.worlds.ego_table import Part
from rosbridge_sim.worlds.surroundings import find_others

GRID_FIGURES: Final = ("presence", "vx", "vy", "on_road")
"""Figures of a cell: 1 if an entity is there; its velocity relative to the ego's, forward and left [m/s]; 1 if the
middle of the cell is on the road."""

MAX_SEEN: Final = 64
"""So many entities are entered in a grid, the nearest ones."""


MAX_CELLS: Final = 256
"""Cells a side, at most: 2 MB for each ego."""


def num_cells(size: float, step: float) -> int:
    """Return how many cells a side has.

    Raises:
        ValueError: the cells are not positive, or too many.
    """
    if not (step > 0.0 and 0.0 < size <= MAX_CELLS * step):
        raise ValueError(f"size, step: expected 1..{MAX_CELLS} cells a side, got {size!r} and {step!r}")
    return max(round(size / step), 1)


def find_grids(part: Part, size: float, step: float) -> FloatArray:
    """Return square grids around egos, in their axes.

    An entity is in the cells whose middles lie in its box, and in that in which the middle of its box lies. In a cell
    of several entities the one nearest to the ego counts. The ego is in none.

    Args:
        size: side of the square; the middle of the ego's rear axle is in its middle [m].
        step: side of a cell [m].

    Returns:
        (k, 4, n, n) `GRID_FIGURES`; the last axes count cells from the back forwards, and from the right to the left.
    """
    columns, rows = part.columns, part.rows
    num = num_cells(size, step)
    middles = (np.arange(num) - 0.5 * (num - 1)) * step
    ahead, left = (axis.ravel() for axis in np.meshgrid(middles, middles, indexing="ij"))
    found = np.zeros((len(rows), len(GRID_FIGURES), num * num))
    others = find_others(part, MAX_SEEN)
    for i in reversed(range(int(others[..., 0].sum(axis=1).max(initial=0.0)))):  # the nearest one last
        is_there, x, y, vx, vy, cos, sin, length, width = (figure[:, None] for figure in others[:, i].T)
        east, north = ahead - x, left - y
        along, across = np.abs(east * cos + north * sin), np.abs(north * cos - east * sin)
        is_in = (along <= 0.5 * length) & (across <= 0.5 * width)
        is_in |= (np.abs(east) <= 0.5 * step) & (np.abs(north) <= 0.5 * step)
        for j, figure in enumerate((is_there, vx, vy)):
            found[:, j] = np.where(is_in, figure, found[:, j])
    cos, sin = np.cos(columns.yaw[rows])[:, None], np.sin(columns.yaw[rows])[:, None]
    x = columns.x[rows][:, None] + ahead * cos - left * sin
    y = columns.y[rows][:, None] + ahead * sin + left * cos
    roads = columns.roads.alone
    if len(roads):
        z = np.repeat(columns.z[rows], num * num)
        found[:, 3] = are_on_road(roads, x.ravel(), y.ravel(), z).reshape(len(rows), -1)
    return found.reshape(len(rows), len(GRID_FIGURES), num, num)

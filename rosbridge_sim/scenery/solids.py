"""Simple solids: boxes, columns, cones and round crowns, as vertices and triangles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rosbridge_sim.world.geometry.planar import FloatArray

Solid = tuple[NDArray[Any], NDArray[np.int32]]
"""(n, 3) vertices [m] and (m, 3) triangles, counter-clockwise from outside."""


def prism(outline: FloatArray, low: float, high: float, shrink: float = 1.0) -> Solid:
    """Return an upright solid over a convex outline; its floor is left out.

    Args:
        outline: (k, 2) counter-clockwise [m].
        low: height of the floor [m].
        high: height of the top [m].
        shrink: size of the top as a share of the floor, about the origin.
    """
    k = len(outline)
    lower = np.column_stack([outline, np.full(k, low)])
    upper = np.column_stack([outline * shrink, np.full(k, high)])
    return np.concatenate([lower, upper]), np.concatenate([sides(k), k + fan(k)])


def sides(num: int, rings: int = 2) -> NDArray[np.int32]:
    """Return the triangles between rings of `num` vertices each, one ring above the other."""
    i = np.arange(num, dtype=np.int32)
    j = (i + 1) % num
    between = np.concatenate([np.column_stack([i, j, num + j]), np.column_stack([i, num + j, num + i])])
    return np.concatenate([num * ring + between for ring in range(rings - 1)])


def fan(num: int) -> NDArray[np.int32]:
    """Return the triangles of a convex outline of `num` vertices."""
    i = np.arange(1, num - 1, dtype=np.int32)
    return np.column_stack([np.zeros_like(i), i, i + 1])


def turned(vertices: FloatArray, way: ArrayLike) -> FloatArray:
    """Return vertices turned about the z axis: x points along a unit vector (2,) then."""
    x, y = np.asarray(way)
    return np.column_stack([vertices[:, :1] * (x, y) + vertices[:, 1:2] * (-y, x), vertices[:, 2]])


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    """Return a box with all six sides, between two corners [m]."""
    (a, b, c), (d, e, f) = low, high
    vertices, triangles = prism(np.array([[a, b], [d, b], [d, e], [a, e]]), c, f)
    return vertices, np.concatenate([triangles, np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32)])


def column(radius: float, low: float, high: float, num: int = 6, top: float | None = None) -> Solid:
    """Return an upright column or cone.

    Args:
        radius: at the floor [m].
        low: height of the floor [m].
        high: height of the top [m].
        num: sides.
        top: radius at the top [m]; None for that of the floor.
    """
    angle = 2.0 * math.pi * np.arange(num) / num
    outline = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return prism(outline, low, high, 1.0 if top is None else top / radius)


def disc(radius: float, num: int = 8) -> Solid:
    """Return a disc about the origin that looks along x.

    Args:
        radius: [m].
    """
    angle = 2.0 * math.pi * np.arange(num) / num
    return np.column_stack([np.zeros(num), radius * np.cos(angle), radius * np.sin(angle)]), fan(num)


def join(*solids: Solid) -> Solid:
    """Return several solids as one."""
    first = np.cumsum([0, *(len(vertices) for vertices, _ in solids[:-1])]).tolist()
    return (
        np.concatenate([vertices for vertices, _ in solids]),
        np.concatenate([triangles + np.int32(at) for (_, triangles), at in zip(solids, first, strict=True)]),
    )

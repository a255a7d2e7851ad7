"""Points and directions of polylines, worked out in the plainest way."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import FloatArray

__all__ = ["left_of", "point_at"]


def point_at(points: FloatArray, arcs: FloatArray, arc: npt.ArrayLike) -> FloatArray:
    """The points of a polyline (m, d) at arc lengths (q,), (q, d); beyond an end it is that end.

    Args:
        points: (m, d) vertices [m].
        arcs: (m,) their arc lengths, as `arc_lengths` gives them [m].
        arc: (q,) arc lengths asked for [m].
    """
    at = np.atleast_1d(np.asarray(arc, dtype=np.float64))
    return np.column_stack([np.interp(at, arcs, column) for column in points.T])


def left_of(x: float, y: float, yaw: float) -> float:
    """How far a vector of the map frame goes to the left of a heading [m]."""
    return y * math.cos(yaw) - x * math.sin(yaw)

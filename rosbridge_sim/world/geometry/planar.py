"""Geometry for the modules of `world`: angles, polylines, sliding boxes, and rotations in space.

Everything is in the map frame (ENU metres, yaw counter-clockwise from east in radians). The functions are pure:
arguments are never written, and results are new arrays. All but the rotations is in the plane.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
ComplexArray = npt.NDArray[np.complex128]
Vector = tuple[float, float, float]
"""x, y, z."""

Quaternion = tuple[float, float, float, float]
"""x, y, z, w, of length 1."""

_Columns = TypeVar("_Columns", FloatArray, IntArray)

FULL_TURN = 2.0 * math.pi
MAX_PAIRS_AT_ONCE = 1 << 18
"""Pairs (query, segment) looked at at once: eight temporary arrays of 2 MB each stay inside the cache, and bound the
memory of a query of any size."""


class Nearest(NamedTuple):
    """Places of points relative to a polyline; (q,) each, one entry for each query.

    Attributes:
        segment: int64, index of the nearest segment, the first of equals.
        arc: arc length of the foot point from the first vertex [m].
        lateral: distance to the polyline, positive when the point is left of the segment's direction [m].
            Beyond the ends and outside a corner, the foot is the vertex, so this is the distance to the vertex.
        x, y: the foot point, east and north [m].
    """

    segment: IntArray
    arc: FloatArray
    lateral: FloatArray
    x: FloatArray
    y: FloatArray


def in_columns(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return two arrays (...) as one (..., 2), in a tenth of the time of `np.stack`, which counts for a few rows."""
    both = np.empty((*first.shape, 2))
    both[..., 0], both[..., 1] = first, second
    return both


def of_rows(columns: _Columns, rows: slice | IntArray) -> _Columns:
    """Return columns (c, n) of some rows, (c, k): a view if these are neighbours; `columns[:, rows]` takes longer."""
    return columns[:, rows] if isinstance(rows, slice) else columns.take(rows, axis=1)


def is_any(mask: BoolArray) -> bool:
    """Return whether a mask has a True, in a third of the time of `np.count_nonzero` where there are few."""
    return True in mask.tobytes()


def run_of(rows: IntArray) -> slice | IntArray:
    """Return rows, (k,) and rising, as a slice if they are neighbours: a view takes a third of the time of a copy."""
    first, last = rows.item(0), rows.item(-1)
    return slice(first, last + 1) if last - first + 1 == len(rows) else rows


def wrap_angle(angle: npt.ArrayLike) -> FloatArray:
    """Return angles within (-pi, pi] [rad], of the shape of the argument; angles already inside keep their bits."""
    value = np.asarray(angle, dtype=np.float64)
    is_far = np.abs(value) >= math.pi
    if not is_any(is_far) or not is_any(value[is_far] != math.pi):  # pi itself is due west
        return np.asarray(value + 0.0)  # the usual case, in a fifth of the time; the sum below has no -0.0 either
    wrapped = value - FULL_TURN * np.ceil((value - math.pi) / FULL_TURN)
    # A value next to the bound may be rounded beyond it by one last place: both mean pi. One just inside would be, too.
    return np.where(is_far, np.where(np.abs(wrapped) >= math.pi, math.pi, wrapped), value + 0.0)


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion of an orientation; all arguments in [rad].

    It is a rotation by `yaw` about the z axis, then by `pitch` about the rotated y axis (y is left, so pitch is
    positive with the nose down), then by `roll` about the x axis that both have rotated.
    """
    cos_yaw, sin_yaw = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    if roll == 0.0 and pitch == 0.0:  # on flat ground, which is nearly always
        return 0.0, 0.0, sin_yaw, cos_yaw
    cos_pitch, sin_pitch = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cos_roll, sin_roll = math.cos(0.5 * roll), math.sin(0.5 * roll)
    return (
        sin_roll * cos_pitch * cos_yaw - cos_roll * sin_pitch * sin_yaw,
        cos_roll * sin_pitch * cos_yaw + sin_roll * cos_pitch * sin_yaw,
        cos_roll * cos_pitch * sin_yaw - sin_roll * sin_pitch * cos_yaw,
        cos_roll * cos_pitch * cos_yaw + sin_roll * sin_pitch * sin_yaw,
    )


def chain(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation by `first` and then, about the axes that it has rotated, by `second`."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate(by: Quaternion, vector: Vector) -> Vector:
    """Return a vector given in rotated axes in the axes that were rotated.

    Args:
        vector: its components in the rotated axes.
    """
    x, y, z, w = by
    u, v, s = vector
    # q v q*, with t = 2 q x v
    t, p, r = 2.0 * (y * s - z * v), 2.0 * (z * u - x * s), 2.0 * (x * v - y * u)
    return u + w * t + y * r - z * p, v + w * p + z * t - x * r, s + w * r + x * p - y * t


def rotate_back(by: Quaternion, vector: Vector) -> Vector:
    """Return a vector in the rotated axes; the inverse of `rotate`."""
    x, y, z, w = by
    return rotate((-x, -y, -z, w), vector)


def outline_at(pose: Vector, outline: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return an outline at a pose.

    Args:
        pose: x and y [m], and yaw [rad].
        outline: forward and left of the pose [m].
    """
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    return [(x + ahead * cos - left * sin, y + ahead * sin + left * cos) for ahead, left in outline]


def box_at(pose: Vector, half_length: float, half_width: float, centre: float = 0.0) -> list[tuple[float, float]]:
    """Return the corners of a box at a pose; see `outline_at`.

    Args:
        centre: its middle lies so far ahead of the pose [m].
    """
    front, rear = centre + half_length, centre - half_length
    sides = ((front, half_width), (front, -half_width), (rear, -half_width), (rear, half_width))
    return outline_at(pose, sides)


def arc_lengths(points: FloatArray) -> FloatArray:
    """Return the arc length at each vertex, (m,), starting with 0 [m].

    Args:
        points: (m, 2) or (m, 3) vertices of a polyline [m]; with three columns the length is measured in space.
    """
    arcs = np.zeros(len(points))
    np.cumsum(np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)), out=arcs[1:])
    return arcs


def nearest_on_polyline(points: FloatArray, x: npt.ArrayLike, y: npt.ArrayLike) -> Nearest:
    """Return the nearest point of a polyline for each query point, in the plane.

    Every query looks at every segment. That suits paths of some thousand vertices; for a whole map use `Roads.nearest`.
    Memory is bounded for any number of queries.

    Args:
        points: (m, 2) or (m, 3) vertices, m >= 2; only x and y count, for `arc` too [m].
        x: (q,) query points, east [m].
        y: (q,) query points, north [m].
    """
    px, py = np.atleast_1d(np.asarray(x, dtype=np.float64)), np.atleast_1d(np.asarray(y, dtype=np.float64))
    chunk = max(1, MAX_PAIRS_AT_ONCE // max(1, len(points) - 1))
    parts = [_nearest(points, px[i : i + chunk], py[i : i + chunk]) for i in range(0, max(1, len(px)), chunk)]
    return parts[0] if len(parts) == 1 else Nearest(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def do_boxes_meet(first: ComplexArray, last: ComplexArray, heading: ComplexArray, half: FloatArray) -> BoolArray:
    """Return which pairs of oriented boxes overlap at any moment while they slide straight, without turning.

    Seen from one box, the middle of the other moves along a line. They meet if that line enters the octagon that is
    the Minkowski sum of both. They do not meet if an axis separates line and octagon: one of the four edges' normals,
    or the normal of the line (separating axis theorem). That is exact for any distance and for boxes of any width. A
    line without length is the question for two standing boxes. Boxes whose edges coincide meet.

    Vectors of the plane are complex numbers, x + iy: a multiplication rotates a vector, and `a * conj(b)` holds the
    part of a along b and the part across it.

    Args:
        first: (..., m) from the middle of the one box to that of the other as the slide begins [m].
        last: (..., m) the same as the slide ends [m].
        heading: (2, ..., m) unit vectors along the length of each box.
        half: (2, ..., m, 2) half of length and width of each box [m].

    Returns:
        (..., m) bool.
    """
    middle, slide = (first + last) * 0.5, (last - first) * 0.5
    into = heading.conj()
    to_other, along_slide = np.abs(as_parts(middle * into)), np.abs(as_parts(slide * into))
    reach = octagon(heading[0] * into[1], half)
    is_in = to_other <= reach + along_slide
    is_near: BoolArray = is_in[0] & is_in[1]
    is_near = is_near[..., 0] & is_near[..., 1]
    if not is_any(is_near):  # the usual case, in half of the time
        return is_near
    # Across the line, both sides times its length, so that a line without length separates nothing.
    across = np.abs(middle.real * slide.imag - middle.imag * slide.real)
    breadth = half * along_slide[..., ::-1]
    breadth = breadth[0] + breadth[1]
    return np.asarray(is_near & (across <= breadth[..., 0] + breadth[..., 1]))


def box_gaps(apart: ComplexArray, heading: ComplexArray, half: FloatArray) -> FloatArray:
    """Return the widest strip between the boxes of each pair, along an edge of one of them.

    Args:
        apart: (m,) from the middle of the one box to that of the other [m].
        heading: (2, m) unit vectors along the length of each box.
        half: (2, m, 2) half of length and width of each box [m].

    Returns:
        (m,) a distance that they have at least [m]; below zero where boxes overlap.
    """
    into = heading.conj()
    strips = np.abs(as_parts(apart * into)) - octagon(heading[0] * into[1], half)
    return np.asarray(strips.max(axis=(0, 2)))


def octagon(between: ComplexArray, half: FloatArray) -> FloatArray:
    """Return how far the octagon of two boxes reaches along the normals of each one's edges, in its own frame [m].

    Args:
        between: (..., m) unit vectors, the heading of the one box in the frame of the other.
        half: (2, ..., m, 2) half of length and width of each box [m].
    """
    cos, sin = np.abs(between.real)[..., None], np.abs(between.imag)[..., None]
    reach: FloatArray = half + half[::-1] * cos + half[::-1, ..., ::-1] * sin
    return reach


def as_parts(vectors: ComplexArray) -> FloatArray:
    """Return complex vectors (...) as real ones (..., 2)."""
    return vectors.view(np.float64).reshape(*vectors.shape, 2)


def _nearest(points: FloatArray, px: FloatArray, py: FloatArray) -> Nearest:
    """Return the same for queries that are looked at at once."""
    x0, y0 = points[:-1, 0], points[:-1, 1]
    dx, dy = np.diff(points[:, 0]), np.diff(points[:, 1])
    squared = dx * dx + dy * dy
    # A segment without length has its foot at its vertex, for any divisor of the quotient.
    along = ((px[:, None] - x0) * dx + (py[:, None] - y0) * dy) / np.where(squared > 0.0, squared, 1.0)
    np.clip(along, 0.0, 1.0, out=along)
    apart = np.square(px[:, None] - (x0 + along * dx)) + np.square(py[:, None] - (y0 + along * dy))
    segment = apart.argmin(axis=1)
    row = np.arange(len(px))
    part = along[row, segment]
    side = dx[segment] * (py - y0[segment]) - dy[segment] * (px - x0[segment])
    arc = arc_lengths(points[:, :2])[segment] + part * np.sqrt(squared[segment])
    return Nearest(
        segment.astype(np.int64),
        arc,
        np.copysign(np.sqrt(apart[row, segment]), side),
        x0[segment] + part * dx[segment],
        y0[segment] + part * dy[segment],
    )


def distinct(values: _Columns) -> _Columns:
    """Return all different values, rising.

    `np.unique` would import `numpy.ma` for the same, which takes 7 ms and 1.2 MB.

    Args:
        values: of any shape, without NaN.

    Returns:
        (k,) of the same type.
    """
    rising = np.sort(values, axis=None)
    is_new = np.ones(len(rising), dtype=bool)
    np.not_equal(rising[1:], rising[:-1], out=is_new[1:])
    return rising[is_new]


def is_among(values: IntArray, others: IntArray) -> BoolArray:
    """Return which values are among others.

    Many calls of `np.isin` sort all values, and import `numpy.ma`: see `distinct`.

    Args:
        values: of any shape.
        others: of any shape.

    Returns:
        The shape of `values`.
    """
    if not others.size:
        return np.zeros(values.shape, dtype=bool)
    rising = np.sort(others, axis=None)
    at = np.minimum(rising.searchsorted(values), len(rising) - 1)
    return np.asarray(rising[at] == values)


def ranges(start: IntArray, count: IntArray) -> IntArray:
    """Return `start[0], start[0] + 1, ...` (`count[0]` numbers), then the same for the next ones, as one array.

    Args:
        start: (k,) int64.
        count: (k,) int64, not negative.

    Returns:
        (sum of count,) int64.
    """
    if len(count) == 0:
        return np.empty(0, dtype=np.int64)
    end = count.cumsum()
    ahead = (start - (end - count)).repeat(count)
    return np.asarray(ahead + np.arange(len(ahead), dtype=np.int64))

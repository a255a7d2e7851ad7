"""Geometry that the rooms of the world share: angles, frames, polylines, boxes that slide, turns in space.

Everything is in the map frame (ENU metres, yaw counter-clockwise from east in radians) unless a name says *body*
(x forward, y left). Pure functions; arguments are never written to, results are fresh arrays. All but the turns in
space is plane.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = [
    "BoolArray",
    "ComplexArray",
    "FloatArray",
    "IntArray",
    "Nearest",
    "Quaternion",
    "Vector",
    "arc_lengths",
    "chain",
    "do_boxes_meet",
    "nearest_on_polyline",
    "quaternion",
    "ranges",
    "turn",
    "turn_back",
    "wrap_angle",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
ComplexArray = npt.NDArray[np.complex128]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # x, y, z, w, of length 1

FULL_TURN = 2.0 * math.pi
# (queries x segments) cells looked at in one go: eight temporaries of 2 MB each stay inside the cache and bound the
# memory of a query of any size.
CELLS = 1 << 18


class Nearest(NamedTuple):
    """Where points stand beside a polyline; one entry for each query, all (q,).

    Attributes:
        segment: index of the nearest segment, the first of equals, int64.
        arc: arc length of the foot point from the first vertex [m].
        lateral: distance to the polyline, positive when the point lies left of the segment's direction [m].
            Beyond the ends and outside a corner the foot is the vertex, so this is the distance to it.
        x, y: the foot point [m].
    """

    segment: IntArray
    arc: FloatArray
    lateral: FloatArray
    x: FloatArray
    y: FloatArray


def wrap_angle(angle: npt.ArrayLike) -> FloatArray:
    """Return the same direction within (-pi, pi], of the argument's shape; angles already inside keep their bits."""
    value = np.asarray(angle, dtype=np.float64)
    wrapped = value - FULL_TURN * np.ceil((value - math.pi) / FULL_TURN)
    # A value next to the border may round to the far side of it by one last place: both mean pi.
    return np.asarray(np.where(np.abs(wrapped) >= math.pi, math.pi, wrapped))


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return an orientation as x, y, z, w of a unit quaternion.

    It is a turn by `yaw` about the z axis, then by `pitch` about the y axis that this has turned (so it is positive
    with the nose down, y being left), then by `roll` about the x axis that both have turned [rad].
    """
    cos_yaw, sin_yaw = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    if roll == 0.0 and pitch == 0.0:  # on the flat, which is nearly always
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
    """Return the turn by `first` and then, about the axes that it has turned, by `second`."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turn(by: Quaternion, vector: Vector) -> Vector:
    """Return a vector of the turned axes in the axes that they were turned from."""
    x, y, z, w = by
    u, v, s = vector
    # q v q*, by way of t = 2 q x v
    t, p, r = 2.0 * (y * s - z * v), 2.0 * (z * u - x * s), 2.0 * (x * v - y * u)
    return u + w * t + y * r - z * p, v + w * p + z * t - x * r, s + w * r + x * p - y * t


def turn_back(by: Quaternion, vector: Vector) -> Vector:
    """Return a vector in the turned axes; the inverse of `turn`."""
    x, y, z, w = by
    return turn((-x, -y, -z, w), vector)


def arc_lengths(points: FloatArray) -> FloatArray:
    """Return the arc length at each vertex, (m,), starting with 0.

    Args:
        points: (m, 2) or (m, 3) vertices of a polyline [m]; with three columns the length is measured in space.
    """
    arcs = np.zeros(len(points))
    np.cumsum(np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)), out=arcs[1:])
    return arcs


def nearest_on_polyline(points: FloatArray, x: npt.ArrayLike, y: npt.ArrayLike) -> Nearest:
    """Return the nearest point of a polyline for each query point, seen from above.

    Every query looks at every segment: right for paths of some thousand vertices, while a whole map wants an index
    in front of it. Memory is bounded whatever the number of queries.

    Args:
        points: (m, 2) or (m, 3) vertices, m >= 2; only x and y count here, for `arc` too [m].
        x: (q,) query points, east [m].
        y: (q,) the same, north [m].
    """
    px, py = np.atleast_1d(np.asarray(x, dtype=np.float64)), np.atleast_1d(np.asarray(y, dtype=np.float64))
    chunk = max(1, CELLS // max(1, len(points) - 1))
    parts = [_nearest(points, px[i : i + chunk], py[i : i + chunk]) for i in range(0, max(1, len(px)), chunk)]
    return parts[0] if len(parts) == 1 else Nearest(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def do_boxes_meet(first: ComplexArray, last: ComplexArray, heading: ComplexArray, half: FloatArray) -> BoolArray:
    """Return which pairs of oriented boxes overlap at any moment of a slide: straight, even, without turning.

    Seen from the one box, the middle of the other moves along a line. They meet if that line comes into the octagon
    that the edges of both make (their Minkowski sum), and they do not if some axis parts line and octagon: one of the
    four edges' normals, or the normal of the line. That is exact however far they slide and however thin they are. A
    line without length is the plain question for two standing boxes; edges that just coincide meet.

    Vectors of the plane are complex numbers here, x + iy: to turn one is to multiply it, and `a * conj(b)` holds
    both the part of a along b and the part across it.

    Args:
        first: (..., m) from the middle of the one box to that of the other as the slide begins [m].
        last: (..., m) the same as it ends [m].
        heading: (2, ..., m) unit vectors along the length of the one and the other.
        half: (2, ..., m, 2) half of length and width of each [m].

    Returns:
        (..., m) bool.
    """
    middle, way = (first + last) * 0.5, (last - first) * 0.5
    into = heading.conj()
    to_other, along_way = np.abs(_parts(middle * into)), np.abs(_parts(way * into))
    between = heading[0] * into[1]
    cos, sin = np.abs(between.real)[..., None], np.abs(between.imag)[..., None]
    # How far the octagon reaches along the normals of each box's edges: (length, width) in that box's own frame.
    reach = half + half[::-1] * cos + half[::-1, ..., ::-1] * sin
    is_in = to_other <= reach + along_way
    # Across the line, both sides times its length, so that a line without any parts nothing.
    across = np.abs(middle.real * way.imag - middle.imag * way.real)
    breadth = half * along_way[..., ::-1]
    breadth, is_in = breadth[0] + breadth[1], is_in[0] & is_in[1]
    return np.asarray(is_in[..., 0] & is_in[..., 1] & (across <= breadth[..., 0] + breadth[..., 1]))


def _parts(vectors: ComplexArray) -> FloatArray:
    """Return complex vectors (...) as real ones (..., 2)."""
    return vectors.view(np.float64).reshape(*vectors.shape, 2)


def _nearest(points: FloatArray, px: FloatArray, py: FloatArray) -> Nearest:
    x0, y0 = points[:-1, 0], points[:-1, 1]
    dx, dy = np.diff(points[:, 0]), np.diff(points[:, 1])
    squared = dx * dx + dy * dy
    # A segment without length has its foot at its vertex, whatever the quotient's divisor.
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


def ranges(start: IntArray, count: IntArray) -> IntArray:
    """`start[0], start[0] + 1, ...` for `count[0]` numbers, then the same for the next, end to end."""
    end = np.cumsum(count)
    total = int(end[-1]) if len(end) else 0
    return np.asarray(np.arange(total, dtype=np.int64) + np.repeat(start - (end - count), count))

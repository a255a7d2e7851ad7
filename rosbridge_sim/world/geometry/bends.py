"""The smooth line through the points of a polyline: each leg is a cubic beside its chord.

At each point the line has the median of three directions: those of the circles through the point and the two before
it, the two after it, and one on each side. Where arcs and straights meet at points that is exact, and points that are
a little off turn it little. With the distance d along the chord of length l, the line is to the left of it by

    y = d (l - d) (p + q d)

which is the cubic with those directions at both ends. An arc that turns by less than 0.1 rad has q = 0, and is longer
than its chord by less than a thousandth. So arc lengths are those of the chords. What drives on a line with longer legs
needs more way for them; see `stretch`.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, wrap_angle

CORNER: Final = 0.6
"""A line that turns by more than this at a point has a corner there [rad]. A quarter of a circle that is drawn with
four points turns by 0.52."""

MAX_BULGE: Final = 0.25
"""A leg that is no part of an arc stays straight, if the smooth line would be farther from it than this [m]: a car has
0.8 m to the edge of a lane of 3.5 m."""

ALIKE: Final = 2.0
"""The legs between two points belong to one arc, if the curvatures there differ by at most this factor."""

TOLD_LATERAL: Final = 3.2
TOLD_ERROR: Final = 0.03
"""Largest lateral acceleration that drivers of cars accept [m/s^2]; and the difference between the speeds on a smooth
line and on its chords, at that acceleration, from which it matters [m/s]."""

_NO_BEND: Final = 1e-9
"""A smaller angle is rounding [rad]."""


def legs_of(first: IntArray) -> tuple[IntArray, IntArray]:
    """Return the legs of polylines that lie end to end.

    Args:
        first: (l + 1,) int64, polyline `i` has the points `first[i]:first[i + 1]`, two or more.

    Returns:
        (k,) int64, the point at which each leg starts, and (l + 1,) int64, the first leg of each polyline.
    """
    is_start = np.ones(int(first[-1]), dtype=bool)
    is_start[first[1:] - 1] = False
    return is_start.nonzero()[0], first - np.arange(len(first))


def end_angles(points: FloatArray, first: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the directions of smooth lines at both ends of each leg, counter-clockwise from its chord.

    Args:
        points: (n, 2) or more columns, of which the first two count; neighbours differ [m].
        first: (l + 1,) int64, as for `legs_of`.

    Returns:
        (k,) at the start and (k,) at the end of each leg [rad]; both 0 for a leg that stays straight.
    """
    start, first_leg = legs_of(first)
    num = len(start)
    if num < 2:  # noqa: PLR2004  # nothing turns
        return np.zeros(num), np.zeros(num)
    step = points[start + 1, :2] - points[start, :2]
    length, yaw = np.hypot(step[:, 0], step[:, 1]), np.arctan2(step[:, 1], step[:, 0])
    # Joint j lies between the legs j and j + 1; those between two lines and at corners are none.
    turn = wrap_angle(np.diff(yaw))
    joint = np.abs(turn) <= CORNER
    joint[first_leg[1:-1] - 1] = False
    turn[~joint] = 0.0
    across = np.hypot(*(step[1:] + step[:-1]).T)
    curvature = 2.0 * np.sin(turn) / np.where(joint, across, 1.0)
    before, after = _at_joints(length, turn, curvature, joint)
    is_arc = _are_arcs(curvature, joint)
    # The end of a leg without a joint continues its arc.
    head, tail = np.zeros(num), np.zeros(num)
    tail[:-1], head[1:] = before, after
    has_tail, has_head = np.append(joint, False), np.append(False, joint)
    head = np.where(has_head, head, -tail)
    tail = np.where(has_tail, tail, -head)
    straight = ~is_arc & (_bulge(length, head, tail) > MAX_BULGE)
    straight |= (np.abs(head) < _NO_BEND) & (np.abs(tail) < _NO_BEND)
    head[straight] = tail[straight] = 0.0
    return head, tail


def _at_joints(
    length: FloatArray, turn: FloatArray, curvature: FloatArray, joint: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return the directions at joints from the leg before and from the leg after, (k - 1,) each [rad]."""
    half = _half_angle(curvature, length[:-1])
    central = half
    left, right = np.full(len(turn), np.nan), np.full(len(turn), np.nan)
    left[1:] = np.where(joint[:-1], _half_angle(curvature[:-1], length[1:-1]), np.nan)
    right[:-1] = np.where(joint[1:], turn[:-1] - _half_angle(curvature[1:], length[1:-1]), np.nan)
    low, high = np.fmin(left, right), np.fmax(left, right)
    median = np.fmin(np.fmax(central, low), high)
    # One leg before an end only two are known. Of these the one that is nearer to the direction of a leg: where an arc
    # meets a straight, the other circle lies on both.
    near_low = np.fmin(np.abs(low), np.abs(low - turn))
    nearer = np.where(near_low <= np.fmin(np.abs(central), np.abs(central - turn)), low, central)
    middle = np.where(np.isnan(left) | np.isnan(right), nearer, median)
    before = np.where(joint, middle, 0.0)
    return before, np.where(joint, middle - turn, 0.0)


def _half_angle(curvature: FloatArray, length: FloatArray) -> FloatArray:
    """Return half of the angle of arcs over chords [rad]."""
    return np.asarray(np.arcsin(np.fmin(np.fmax(0.5 * curvature * length, -1.0), 1.0)))


def _are_arcs(curvature: FloatArray, joint: BoolArray) -> BoolArray:
    """Return (k,) which legs are part of an arc: with like curvatures at both ends, or at the end beside such a leg."""
    size = np.abs(curvature)
    low, high = np.fmin(size[:-1], size[1:]), np.fmax(size[:-1], size[1:])
    alike = joint[:-1] & joint[1:] & (curvature[:-1] * curvature[1:] > 0.0) & (high <= ALIKE * low)
    inner = np.concatenate([[False], alike, [False]])
    is_end = ~(np.append(joint, False) & np.append(False, joint))
    beside = np.zeros(len(inner), dtype=bool)
    beside[1:] |= inner[:-1] & joint
    beside[:-1] |= inner[1:] & joint
    return np.asarray(inner | (is_end & beside))


def _bulge(length: FloatArray, head: FloatArray, tail: FloatArray) -> FloatArray:
    """Return how far the cubics are from their chords at most, (k,) [m]; too much by a third at worst."""
    return np.asarray(length * (4.0 / 27.0) * (np.abs(head) + np.abs(tail)))


def leg_curves(length: FloatArray, head: FloatArray, tail: FloatArray) -> FloatArray:
    """Return the p and q of legs, (k, 2) [1/m, 1/m^2]; arguments are (k,), the angles from `end_angles`."""
    a, b = np.tan(head), np.tan(tail)
    return np.stack((a / length, -(a + b) / (length * length)), axis=-1)


def offset(curve: FloatArray, along: FloatArray, length: FloatArray) -> FloatArray:
    """Return how far lines are to the left of their chords, (n,) [m].

    Args:
        curve: (n, 2) of the legs, from `leg_curves`.
        along: (n,) distance from the start of the leg [m].
        length: (n,) of the legs [m].
    """
    return np.asarray(along * (length - along) * (curve[:, 0] + curve[:, 1] * along))


def slope(curve: FloatArray, along: FloatArray, length: FloatArray) -> FloatArray:
    """Return by how much they go to the left for each metre, (n,); arguments as for `offset`."""
    p, q = curve[:, 0], curve[:, 1]
    return np.asarray(length * p + along * (2.0 * (length * q - p) - 3.0 * q * along))


def stretch(curve: FloatArray, along: FloatArray, length: FloatArray) -> FloatArray:
    """Return the way on lines for each metre along their chords, (n,); arguments as for `offset`."""
    slant = slope(curve, along, length)
    return np.asarray(np.sqrt(1.0 + slant * slant))


def is_longer(length: FloatArray, head: FloatArray, tail: FloatArray) -> bool:
    """Return whether any line is so much longer than its chord that it matters; arguments as for `leg_curves`."""
    angle = np.fmax(np.abs(head), np.abs(tail))
    speed = np.sqrt(TOLD_LATERAL * length / np.fmax(2.0 * np.sin(angle), _NO_BEND))
    return bool((speed * (1.0 / np.cos(angle) - 1.0) > TOLD_ERROR).any())

"""Reference lines and polynomials of OpenDRIVE roads: places and directions at given distances along a road.

A reference line is a row of shapes (ASAM OpenDRIVE 1.8, section 9). Each begins at its own place with its own
direction, and is described in its own frame: u along the direction at its start, v to the left. Polynomials (widths,
heights, ...) hold from their own s to the next one; their variable is the distance from there.
"""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from operator import attrgetter, itemgetter
from typing import Final, NamedTuple

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import FloatArray

SHORT: Final = 1e-6
"""Places closer together than this are one [m]: files have 16 digits, but exporters compute."""

PANEL: Final = 1.0
"""Integration of a spiral goes in steps of at most this [m]; with 8 nodes for each it is exact to 1e-10 m."""

POLY3_STEP: Final = 0.05
"""Lengths along a poly3 are known at steps of this [m]: it is exact to 0.02 mm where the radius is over 10 m."""

MAX_STEPS: Final = 20_000
"""Steps of one shape; longer ones are measured in longer steps."""

MAX_GAP: Final = 0.01
"""Shapes and lanes that follow one another farther apart than this are told [m]."""

MAX_KINK: Final = math.radians(1.0)
"""Shapes that follow one another in directions more different than this are told [rad]: 2 cm a metre beside them."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)

Local = tuple[FloatArray, FloatArray, FloatArray]
"""u and v [m] and the direction in the shape's own frame [rad], (n,) each."""


class PlanShape(Record, gc=False):
    """A piece of a reference line.

    Attributes:
        s: distance along the road at which it begins [m].
        x, y: its start in the map frame [m].
        heading: its direction there [rad].
        length: along it [m].
        kind: a key of `SHAPES`.
        figures: those that its kind needs, see there.
    """

    s: float
    x: float
    y: float
    heading: float
    length: float
    kind: str
    figures: tuple[float, ...] = ()


def place_on(shapes: Sequence[PlanShape], s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return places on a reference line.

    Args:
        shapes: one or more, by rising s.
        s: (n,) rising distances along the road; the first one counts as behind a joint there, the last one as before
            it [m].

    Returns:
        (n,) x, y [m] and heading [rad].
    """
    # The last place of one shape and the first of the next one are neighbours, because the places rise.
    ends = [0, *_nudged(s).searchsorted([shape.s for shape in shapes[1:]]).tolist(), len(s)]
    found = np.empty((3, len(s)))
    for shape, (first, end) in zip(shapes, pairwise(ends), strict=True):
        if first < end:
            found[:, first:end] = _follow(shape, s[first:end])
    return found[0], found[1], found[2]


def point_on(shapes: Sequence[PlanShape], s: float) -> list[float]:
    """Return x, y [m] and heading [rad] of one place, as `place_on` for many.

    It and `cubic_at` search without numpy, which gives up the interpreter's lock in each search, for a moment too short
    for another thread to take it, and that thread then begins to wait anew. The lights of a large map would hold up an
    event loop for 100 ms.
    """
    shape = shapes[max(bisect(shapes, s, key=attrgetter("s")) - 1, 0)]
    return [float(each[0]) for each in _follow(shape, np.array([s]))]


def cubic_at(table: FloatArray, s: float) -> float:
    """Return the value of one table of polynomials, as for `Cubics`, at one place [m]."""
    records = table.tolist()
    if not records:
        return 0.0
    start, a, b, c, d = records[max(bisect(records, s, key=itemgetter(0)) - 1, 0)]
    away = s - start
    return float(a + away * (b + away * (c + away * d)))


def _follow(shape: PlanShape, s: FloatArray) -> Local:
    """Return x, y [m] and heading [rad] at (n,) distances along the road, on one shape."""
    u, v, turn = SHAPES[shape.kind](s - shape.s, shape.length, *shape.figures)
    cos, sin = np.cos(shape.heading), np.sin(shape.heading)
    return shape.x + cos * u - sin * v, shape.y + sin * u + cos * v, shape.heading + turn


class Joint(NamedTuple):
    """A place at which a shape of a reference line does not end where the next one begins.

    Attributes:
        gap: between the two [m].
        kink: angle between their directions there, not negative [rad].
        s: distance along the road [m].
    """

    gap: float
    kink: float
    s: float


def find_torn_joints(shapes: Sequence[PlanShape]) -> Iterator[Joint]:
    """Yield the joints with a gap over `MAX_GAP` or a kink over `MAX_KINK`."""
    for shape, after in pairwise(shapes):
        (x,), (y,), (heading,) = _follow(shape, np.array([after.s]))
        gap = math.hypot(after.x - x, after.y - y)
        kink = abs(math.remainder(after.heading - heading, 2.0 * math.pi))
        if gap > MAX_GAP or kink > MAX_KINK:
            yield Joint(gap, kink, after.s)


def _nudged(s: FloatArray) -> FloatArray:
    """Return places of which the first one lies behind a joint, and the last one before it; see `place_on`."""
    places = s.copy()
    places[0] += SHORT
    places[-1] -= SHORT
    return places


class Cubics:
    """Tables of polynomials that are evaluated at the same places: a + b d + c d^2 + d d^3 from each record's s on.

    Attributes:
        records: (m, 5) s, a, b, c, d of all tables, one table after the other, by rising s in each. The first record of
            a table holds before its s, too.
    """

    def __init__(self, tables: Sequence[FloatArray]) -> None:
        """Join tables, (k, 5) each; the values of one without any record are 0."""
        self.records = np.concatenate([each if len(each) else NO_RECORD for each in tables])
        self.heads = np.cumsum([0, *(len(each) or 1 for each in tables)])

    def at(self, s: FloatArray) -> FloatArray:
        """Return the values of all tables, (tables, n), at (n,) places as for `place_on` [m]."""
        start, a, b, c, d = self.holding(_nudged(s))
        away = s - start
        return np.asarray(a + away * (b + away * (c + away * d)))

    def holding(self, places: FloatArray) -> FloatArray:
        """Return the records that hold at (n,) rising places [m], as (5, tables, n) s, a, b, c, d."""
        joined, heads, shape = self.records, self.heads, (5, len(self.heads) - 1, len(places))
        if len(joined) == shape[1]:
            return np.broadcast_to(joined.T[:, :, None], shape)
        # The record in row i holds at the places from begin[i] to begin[i + 1]; those of each table take all n.
        begin = np.append(places.searchsorted(joined[:, 0]), 0)
        begin[heads] = 0
        end = begin[1:].copy()
        end[heads[1:] - 1] = len(places)
        return joined.T.repeat(end - begin[:-1], axis=1).reshape(shape)


NO_RECORD: Final = np.zeros((1, 5))
"""The record of a table without any."""


def _line(along: FloatArray, _: float) -> Local:
    return along, np.zeros(len(along)), np.zeros(len(along))


def _arc(along: FloatArray, length: float, curvature: float) -> Local:
    if not curvature:
        return _line(along, length)
    turn = curvature * along
    # 1 - cos(turn), without the cancellation for small angles
    return np.sin(turn) / curvature, 2.0 * np.square(np.sin(0.5 * turn)) / curvature, turn


def _spiral(along: FloatArray, length: float, start: float, end: float) -> Local:
    """Return places on a clothoid: its curvature changes evenly from `start` to `end` [1/m]."""
    rate = (end - start) / length
    grid = np.linspace(0.0, length, min(int(length / PANEL) + 2, MAX_STEPS))
    at, back = np.unique(np.concatenate([[0.0], grid, along]), return_inverse=True)
    half = 0.5 * np.diff(at)[:, None]
    inner = at[:-1, None] + half * (1.0 + _NODES)
    turn = inner * (start + 0.5 * rate * inner)
    steps = [half[:, 0] * (wave @ _WEIGHTS) for wave in (np.cos(turn), np.sin(turn))]
    zero = int(np.searchsorted(at, 0.0))
    u, v = (np.concatenate([[0.0], np.cumsum(step)]) for step in steps)
    own = back[1 + len(grid) :]
    return (u - u[zero])[own], (v - v[zero])[own], along * (start + 0.5 * rate * along)


def _poly3(along: FloatArray, length: float, *cubic: float) -> Local:
    """Return places on v(u) = a + b u + c u^2 + d u^3; the length counts along the curve, which u does not."""
    a, b, c, d = cubic
    u = np.linspace(0.0, length, min(int(length / POLY3_STEP) + 2, MAX_STEPS))
    half = 0.5 * np.diff(u)[:, None]
    inner = u[:-1, None] + half * (1.0 + _NODES)
    steps = half[:, 0] * (np.hypot(1.0, b + inner * (2.0 * c + 3.0 * d * inner)) @ _WEIGHTS)
    u = np.interp(along, np.concatenate([[0.0], np.cumsum(steps)]), u)
    return u, a + u * (b + u * (c + u * d)), np.arctan(b + u * (2.0 * c + 3.0 * d * u))


def _param_poly3(along: FloatArray, length: float, is_normalized: float, *figures: float) -> Local:
    """Return places on a pair of polynomials u(p), v(p); p counts metres, or goes from 0 to 1 (without `pRange`)."""
    p = along / length if is_normalized else along
    (u, du), (v, dv) = (
        (a + p * (b + p * (c + p * d)), b + p * (2.0 * c + 3.0 * d * p)) for a, b, c, d in (figures[:4], figures[4:])
    )
    return u, v, np.arctan2(dv, du)


SHAPES: Final[Mapping[str, Callable[..., Local]]] = {
    "line": _line,
    "arc": _arc,
    "spiral": _spiral,
    "poly3": _poly3,
    "paramPoly3": _param_poly3,
}
"""Shapes by the name of their element: functions of (n,) distances from the shape's start, its length and figures.
These are, in turn: none; curvature [1/m]; curvature at the start and the end; a, b, c, d; whether p is normalized,
then a, b, c, d of u and of v."""

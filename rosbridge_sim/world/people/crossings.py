"""Places where a path crosses the road, found from the path and the lanes alone.

A path crosses the road between two arc lengths: there it lies on a lane, up to the lane's edges. Parts that are nearer
to each other than a traffic island is long are one crossing. Lights for pedestrians at its ends belong to it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray, distinct
from rosbridge_sim.world.roads.paths import DX, DY, END, START, Segments, X, Y
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan

SAMPLE: Final = 0.25
"""Distance of the places of a path that are looked at [m]: half a step of a pedestrian."""

MAX_SAMPLES: Final = 40_000
"""Places of a path that are looked at, at most: ten kilometres. Of a longer path the samples are farther apart."""

PART: Final = 256
"""Places that are looked for on the lanes at once: a search for thousands leaves some of them out."""

ISLAND: Final = 1.2
"""A refuge that is shorter than this is part of the road [m]: the depth of a wheelchair."""

KERB: Final = 0.3
"""Distance from the edge of a lane at which a body still reaches onto it [m]: half of its width."""

WIDER: Final = 2.0
"""A crossing is at most so much longer at each end for those who walk beside the path [m]: where a lane turns across
the corner of a pavement, the place beside is on the lane before the path is."""

LIGHT_RANGE: Final = 4.0
"""A light for pedestrians within this distance of an end of a crossing belongs to it [m]: more than half the width of
a usual crosswalk, and less than the distance to that of the next street."""


class Crossings(Record, eq=False):
    """The crossings of one path, in its order; (c,) each.

    Attributes:
        start, end: arc lengths of the kerbs [m].
        light: int64, row of the light for pedestrians; -1 for none.
        ends: (c, 4) places of the kerbs: east and north of the first one, then of the second one [m].
    """

    start: FloatArray
    end: FloatArray
    light: IntArray
    ends: FloatArray


def find_crossings(segments: Segments, roads: Roads, plan: SignalPlan, side: float = 0.0) -> Crossings:
    """Return where a path crosses the road.

    Args:
        segments: of the path, (m, 10); see `paths`.
        side: those who follow the path walk at most so far to the right of it [m].
    """
    length = float(segments[-1, END])
    num = min(max(2, math.ceil(length / SAMPLE) + 1), MAX_SAMPLES)
    arc = np.linspace(0.0, length, num)
    leg = segments[np.minimum(np.searchsorted(segments[:, END], arc, side="right"), len(segments) - 1)]
    east = leg[:, X] + (arc - leg[:, START]) * leg[:, DX]
    north = leg[:, Y] + (arc - leg[:, START]) * leg[:, DY]
    is_on = np.zeros(num + 2, dtype=np.int8)
    is_on[1:-1] = _are_on_road(roads, east, north)
    first, last = np.flatnonzero(np.diff(is_on) == 1), np.flatnonzero(np.diff(is_on) == -1) - 1
    if len(first):
        is_apart = arc[first[1:]] - arc[last[:-1]] > ISLAND
        first, last = first[np.append(True, is_apart)], last[np.append(is_apart, True)]
    if side > 0.0 and len(first):
        most = int(WIDER * (num - 1) / length)
        steps = np.arange(1, most + 1)
        near = distinct(np.concatenate([first[:, None] - steps, last[:, None] + steps]))
        near = near[(near >= 0) & (near < num)]
        is_beside = np.zeros(num, dtype=bool)
        to_right = leg[near, DY], -leg[near, DX]
        is_beside[near] = _are_on_road(roads, east[near] + side * to_right[0], north[near] + side * to_right[1])
        for i in range(len(first)):
            low = int(last[i - 1]) + 1 if i else 0
            high = int(first[i + 1]) - 1 if i + 1 < len(first) else num - 1
            first[i] = _reach(is_beside, int(first[i]), -1, most, max(low, 0))
            last[i] = _reach(is_beside, int(last[i]), 1, most, high)
    ends = np.column_stack([east[first], north[first], east[last], north[last]])
    return Crossings(arc[first], arc[last], _find_lights(ends, plan), ends)


def _reach(is_beside: BoolArray, start: int, step: int, most: int, limit: int) -> int:
    """Return the last sample from `start` on in steps of 1 or -1 that is beside the road without a break."""
    at = start
    for _ in range(most):
        if at == limit or not is_beside[at + step]:
            break
        at += step
    return at


def _are_on_road(roads: Roads, x: FloatArray, y: FloatArray) -> BoolArray:
    """Return for each place if it lies on a lane."""
    is_on = np.zeros(len(x), dtype=bool)
    reach = float(roads.border.max(initial=0.0)) + KERB
    for start in range(0, len(x), PART):
        part = slice(start, start + PART)
        owner, places = roads.within(x[part], y[part], np.full(len(x[part]), reach))
        left, right = roads.beside(places)
        is_on[start + owner[np.fmin(left, right) > -KERB]] = True
    return is_on


def _find_lights(ends: FloatArray, plan: SignalPlan) -> IntArray:
    """Return the nearest light for pedestrians of each crossing, (c,) int64; -1 for none within `LIGHT_RANGE`."""
    found = np.full(len(ends), -1, dtype=np.int64)
    rows = np.array([row for row, light in enumerate(plan.lights) if light.is_pedestrian], dtype=np.int64)
    if not len(rows) or not len(ends):
        return found
    x, y = np.array([(plan.lights[row].x, plan.lights[row].y) for row in rows.tolist()]).T
    away = np.fmin(np.hypot(ends[:, :1] - x, ends[:, 1:2] - y), np.hypot(ends[:, 2:3] - x, ends[:, 3:] - y))
    nearest = away.argmin(axis=1)
    is_near = away[np.arange(len(ends)), nearest] <= LIGHT_RANGE
    found[is_near] = rows[nearest[is_near]]
    return found

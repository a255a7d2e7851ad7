"""The part of a map that a picture shows: the bulk of it, without what lies kilometres away by mistake.

One wrong coordinate makes a link of a map, or a thing of a scenario, lie far from all others. On a picture of all of it
the map would be a dot.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray
from rosbridge_sim.world.roads.roads import Roads

APART: Final = 2_000.0
"""Parts of a map with less than this between them belong together [m]: roads of one place with open country between."""

TIMES: Final = 2.0
"""A part farther away than so many times the size of the greatest part makes that too small to see on one picture."""


def find_bulk(low: FloatArray, high: FloatArray, weight: FloatArray) -> BoolArray:
    """Return which boxes belong together: the heaviest group of boxes that are near each other, and those around it.

    Args:
        low: (m, 2) their south-western corners [m].
        high: (m, 2) their north-eastern corners [m].
        weight: (m,) of each, such as its length.

    Returns:
        (m,) bool; all true where nothing lies kilometres away.
    """
    bulk = np.ones(len(low), dtype=bool)
    if not len(low):
        return bulk
    for axis in (0, 1, 0):  # what is apart from north to south only can hide a gap from west to east
        at = np.flatnonzero(bulk)
        bulk[at] = _heaviest(low[at, axis], high[at, axis], weight[at])
    south_west, north_east = low[bulk].min(axis=0), high[bulk].max(axis=0)
    away = np.maximum(low - north_east, south_west - high).max(axis=1)
    return np.asarray(away <= max(APART, TIMES * float((north_east - south_west).max())))


def _heaviest(low: FloatArray, high: FloatArray, weight: FloatArray) -> BoolArray:
    """Return which intervals belong to the heaviest group, (m,); groups have gaps of more than `APART` between them."""
    order = np.argsort(low, kind="stable")
    reach = np.maximum.accumulate(high[order])
    group = np.empty(len(low), dtype=np.int64)
    group[order] = np.cumsum(np.append(False, low[order][1:] - reach[:-1] > APART))
    return np.asarray(group == np.argmax(np.bincount(group, weights=weight)))


def find_far_lanes(roads: Roads) -> BoolArray:
    """Return which lanes lie kilometres away from the bulk of the map, (l,)."""
    if not len(roads):
        return np.zeros(0, dtype=bool)
    start = roads.first[:-1]
    points = roads.points[:, :2]
    low, high = np.minimum.reduceat(points, start), np.maximum.reduceat(points, start)
    return ~find_bulk(low, high, roads.length)

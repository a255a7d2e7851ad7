"""Painted lines of a map that has none: they follow from the lanes."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from rosbridge_sim.maps.road_map import Border
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_surface import sample_lane
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.roads import Roads

STEP: Final = 1.0
"""Distance of the places at which an edge of a lane is looked at [m]."""

PROBE: Final = 0.6
"""A place so far beyond or within the edge tells which lanes are there [m]."""

_NONE, _EDGE, _SAME_WAY, _ONCOMING = range(4)

_LOOKS: Final = {
    _EDGE: (505, ("Solid",), ("white",)),
    _SAME_WAY: (503, ("Broken",), ("white",)),
    _ONCOMING: (501, ("Solid",), ("yellow",)),
}
"""MGeo's type, shape and colour."""


def guess_borders(roads: Roads, cover: RoadCover) -> list[Border]:
    """Return lines: white at edges, broken between lanes of one direction, yellow between both; none at crossings."""
    borders = []
    for lane in range(len(roads)):
        points, side, edges, _ = sample_lane(roads, lane, STEP)
        yaw = np.arctan2(-side[:, 0], side[:, 1])
        for i, sign in enumerate((1.0, -1.0)):
            out = np.column_stack([sign * side, np.zeros(len(side))])
            line = points + edges[:, i : i + 1] * out
            look = _classify(cover, lane, line, out, yaw)
            if i:
                look[look == _SAME_WAY] = _NONE  # the lane to the right of it paints it
            for start, end in _runs(look):
                kind, shape, colour = _LOOKS[int(look[start])]
                borders.append(Border("", line[start:end], kind, shape, colour))
    return borders


def _classify(cover: RoadCover, lane: int, line: FloatArray, out: FloatArray, yaw: FloatArray) -> IntArray:
    """Return what lies beyond the points of an edge, (n,) int64."""
    look = np.full(len(line), _EDGE)
    owner, places = cover.lanes_at(line + PROBE * out)
    is_same = np.cos(places.yaw - yaw[owner]) > 0.0
    look[owner[~is_same]] = _ONCOMING
    look[owner[is_same]] = _SAME_WAY
    owner, places = cover.lanes_at(line - PROBE * out)
    look[owner[places.lane != lane]] = _NONE
    return look


def _runs(look: IntArray) -> list[tuple[int, int]]:
    """Return start and end of each run of one look; runs of one point are left out."""
    cuts = [0, *(np.flatnonzero(np.diff(look)) + 1).tolist(), len(look)]
    return [(a, b) for a, b in pairwise(cuts) if b - a > 1 and look[a] != _NONE]

"""Paint beside the lanes: lines, crosswalks and markings of a map, as far as they lie on no lane.

Maps have such paint where two carriageways are a few metres apart, where crosswalks are longer than the road is wide,
and where an edge line lies outside of the lane. Asphalt is laid below it, and kerbs leave it free.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from rosbridge_sim.maps.road_map import Crosswalk, RoadMap
from rosbridge_sim.scenery.lines import across, runs_of, sample_arcs, strip, take_at
from rosbridge_sim.scenery.mesh import Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_paint import four_corners, is_painted
from rosbridge_sim.scenery.static.road_surface import ASPHALT, SHOULDER
from rosbridge_sim.world.geometry.block_grid import BlockGrid
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, arc_lengths
from rosbridge_sim.world.roads.roads import LEVEL

STEP: Final = 0.5
"""Distance of the places at which paint is looked at [m]."""

MAX_PLACES, MAX_TILES = 100_000, 200
"""Pieces of a line, and along each side of a crosswalk, at most: beyond 50 km and 100 m the pieces get larger."""

ASPHALT_MARGIN: Final = 0.15
"""The asphalt of lanes reaches so far beyond their edges and their ends at least [m]."""

NEAR: Final = 0.75
"""A place nearer than this to a place of paint is on the asphalt around it [m]."""

CELL: Final = 4.0
"""Side of a cell of the search [m]."""


class LoosePaint:
    """The paint of one map that is on no lane.

    Args:
        road_map: has lines, crosswalks and markings.
    """

    def __init__(self, road_map: RoadMap, cover: RoadCover) -> None:
        lines = [border.line for border in road_map.borders if is_painted(border)]
        lines += [np.concatenate([marking.outline, marking.outline[:1]]) for marking in road_map.markings]
        lines = [take_at(line, _arcs(float(arc_lengths(line[:, :2])[-1]), MAX_PLACES)) for line in lines]
        tiles = np.concatenate([np.zeros((0, 4, 3)), *(quads for each in road_map.crosswalks for quads in _cut(each))])
        places = np.concatenate([np.zeros((0, 3)), *lines, tiles.mean(axis=1)])
        is_bare = ~cover.is_on(places, margin=ASPHALT_MARGIN)
        self._places = places[is_bare][~cover.is_on(places[is_bare], margin=SHOULDER)]
        flat = self._places[:, :2]
        self._grid = BlockGrid(flat, flat, NEAR, CELL)
        *of_lines, of_tiles = np.split(is_bare, np.cumsum([len(line) for line in lines], dtype=np.int64))
        self._tiles = tiles[of_tiles]
        self._lines = [
            line[start:end]
            for line, which in zip(lines, of_lines, strict=True)
            for start, end in runs_of(np.convolve(which, [1, 1, 1], mode="same") > 0)  # up to the asphalt of lanes
        ]

    def is_near(self, points: FloatArray) -> BoolArray:
        """Return which places lie on this paint or on the asphalt around it, (n,).

        Args:
            points: (n, 3); paint on another level does not count [m].
        """
        found = np.zeros(len(points), dtype=bool)
        owner, at = self._grid.find(points[:, :2])
        away = points[owner] - self._places[at]
        found[owner[(np.hypot(away[:, 0], away[:, 1]) < NEAR) & (np.abs(away[:, 2]) < LEVEL)]] = True
        return found

    def add_asphalt(self, builder: MeshBuilder) -> None:
        """Add the asphalt below it."""
        for places in self._lines:
            line = take_at(places, sample_arcs(places))
            aside = np.column_stack([SHOULDER * across(line), np.zeros(len(line))])
            builder.add(*strip(line + aside, line - aside), ASPHALT, Label.ASPHALT)
        builder.add_quads(self._tiles, ASPHALT, Label.ASPHALT)


def _arcs(length: float, most: int) -> FloatArray:
    """Return places along a length about `STEP` apart, with both ends, or farther apart if it has more pieces [m]."""
    return np.linspace(0.0, length, min(max(round(length / STEP), 1), most) + 1)


def _cut(crosswalk: Crosswalk) -> Iterator[FloatArray]:
    """Yield each part of a crosswalk in pieces of about `STEP`, (k, 4, 3) counter-clockwise."""
    for outline in crosswalk.outlines:
        corners = four_corners(outline)
        if corners is None:
            continue
        a, b, c, d = corners if np.cross(corners[1] - corners[0], corners[3] - corners[0])[2] > 0.0 else corners[::-1]
        sides = np.linalg.norm(b - a), np.linalg.norm(d - a)
        u, v = (_arcs(float(side), MAX_TILES) / max(float(side), 1e-6) for side in sides)
        u, v = u[:, None, None], v[None, :, None]
        grid = (1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c)
        quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
        yield quads.reshape(-1, 4, 3)

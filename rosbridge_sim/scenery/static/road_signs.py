"""Signs beside the roads, and markings on them such as arrows, where the map has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from rosbridge_sim.maps.road_map import Marking, Sign, open_outline
from rosbridge_sim.scenery.mesh import Colour, Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.solids import box, column
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_paint import WHITE
from rosbridge_sim.scenery.static.terrain import Terrain
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray

LIFT: Final = 0.005
"""Markings are so high above the asphalt [m], between lines and crosswalks."""

CLEAR, CLEAR_ON_ROAD = 2.0, 5.0
"""Height of the lower edge of a sign beside a road, and above one [m]; a higher place in the map counts."""

POLE, THICK = 0.04, 0.02
"""Radius of a pole, and thickness of a plate [m]."""

STEEL: Final[Colour] = (128, 132, 134)

_PLATES: Final[dict[str, Colour]] = {"1": (232, 190, 40), "2": (196, 40, 44), "3": (28, 82, 168)}
"""Main colour of signs that warn, regulate and direct; others are white."""


def add_markings(builder: MeshBuilder, markings: Sequence[Marking]) -> None:
    """Add areas that are painted white."""
    for marking in markings:
        outline = open_outline(marking.outline)
        builder.add(outline + np.array([0.0, 0.0, LIFT]), _triangles_of(outline[:, :2]), WHITE, Label.PAINT_WHITE)


def _triangles_of(outline: FloatArray) -> IntArray:
    """Return triangles, (m, 3), counter-clockwise, that fill an outline (k, 2) which does not cross itself.

    Ears are cut off (Meisters 1975). What crosses itself is filled as far as ears are found.
    """
    x, y = outline.T
    area = float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    rest = list(range(len(outline)))[:: 1 if area >= 0.0 else -1]
    found = []
    while len(rest) > 2:  # noqa: PLR2004 - a triangle
        for i in range(len(rest)):
            a, b, c = rest[i - 1], rest[i], rest[(i + 1) % len(rest)]
            if _side_of(outline[a], outline[b], outline[c]) <= 0.0:
                continue
            others = outline[[k for k in rest if k not in {a, b, c}]]
            pairs = ((a, b), (b, c), (c, a))
            is_in = np.all([_side_of(outline[p], outline[q], others) >= 0.0 for p, q in pairs], axis=0)
            if not is_in.any():
                found.append((a, b, c))
                del rest[i]
                break
        else:
            break
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def _side_of(start: FloatArray, end: FloatArray, places: FloatArray) -> FloatArray:
    """Return positive numbers for places (..., 2) on the left of a line."""
    return np.asarray(
        (end[0] - start[0]) * (places[..., 1] - start[1]) - (end[1] - start[1]) * (places[..., 0] - start[0])
    )


def add_signs(builder: MeshBuilder, signs: Sequence[Sign], cover: RoadCover, terrain: Terrain) -> None:
    """Add plates, and poles for those that stand beside the roads.

    Args:
        terrain: the ground on which poles stand.
    """
    if not signs:
        return
    place = np.array([(sign.x, sign.y, sign.z) for sign in signs])
    floor = terrain.height(place)
    is_above = cover.is_on(np.column_stack([place[:, :2], floor]))
    for sign, ground, above in zip(signs, floor.tolist(), is_above.tolist(), strict=True):
        low = max(ground + (CLEAR_ON_ROAD if above else CLEAR), sign.z - 0.5 * sign.height)
        cos, sin = np.cos(sign.yaw), np.sin(sign.yaw)
        plate = box((0.0, -0.5 * sign.width, low), (THICK, 0.5 * sign.width, low + sign.height))
        colour = _PLATES.get(sign.kind, WHITE)
        builder.add_solid(plate, (sign.x, sign.y, 0.0), colour, Label.SIGN, way=(cos, sin))
        if not above:
            at = (sign.x - 1.1 * POLE * cos, sign.y - 1.1 * POLE * sin, 0.0)
            builder.add_solid(column(POLE, ground - 0.2, low + sign.height, 6), at, STEEL, Label.POLE)

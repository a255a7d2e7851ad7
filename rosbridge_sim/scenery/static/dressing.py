"""Dressing beside the roads: buildings, trees, bushes, posts and street lamps.

All of it follows from the name of the map and the seed, and none of it stands on a road.
"""

from __future__ import annotations

import math
from hashlib import blake2b
from typing import Final

import numpy as np

from rosbridge_sim.scenery.lines import across, take_at
from rosbridge_sim.scenery.mesh import Colour, Label, Lit
from rosbridge_sim.scenery.solids import box, column, join, prism, sides
from rosbridge_sim.scenery.static.road_edges import NARROW, RoadSite
from rosbridge_sim.scenery.static.road_surface import SHOULDER
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads

REACH: Final = 140.0
"""Nothing stands farther than this from all roads [m]."""

GRID: Final = 11.0
"""A thing stands in each cell of this side at most [m]; buildings take cells of three."""

MAX_CELLS: Final = 40_000
"""Cells of trees at most: on large maps they get larger."""

CLEARANCE: Final = 1.5
"""Distance of everything from the edge of a road at least [m]."""

PAVEMENT: Final = 3.4
"""In towns trees and houses leave the pavement free [m]."""

LAMP_STEP: Final = 36.0
"""Distance of street lamps and posts along a road [m]."""

LAMP_HEIGHT: Final = 7.5
"""[m]."""

WALLS: Final[tuple[Colour, ...]] = (
    *((178, 168, 152), (160, 148, 138), (196, 190, 180), (150, 110, 92), (172, 138, 112), (140, 146, 150)),
    *((186, 176, 150), (128, 120, 116)),
)
ROOF: Final[Colour] = (112, 108, 106)
LEAVES: Final[tuple[Colour, ...]] = ((62, 92, 44), (72, 104, 50), (56, 84, 48), (88, 112, 52), (70, 96, 60))
BARK: Final[Colour] = (86, 68, 52)
STEEL: Final[Colour] = (128, 132, 134)
POST: Final[Colour] = (206, 204, 198)
GLOW: Final[Colour] = (250, 244, 220)


def add_dressing(site: RoadSite, *, name: str, seed: int, is_town: bool) -> None:
    """Add what stands beside the roads.

    Args:
        is_town: houses stand close together, and people walk.
    """
    digest = blake2b(f"{name} {seed}".encode(), digest_size=8).digest()
    rng = np.random.default_rng(int.from_bytes(digest))
    free = PAVEMENT if is_town else CLEARANCE
    houses = _add_buildings(site, rng=rng, free=free, share=0.8 if is_town else 0.06)
    share = 0.34 if is_town else 0.5
    _add_trees(site, rng=rng, free=free, houses=houses, share=share)
    _add_roadside(site, is_town=is_town)


def _cells(roads: Roads, cell: float, rng: np.random.Generator) -> FloatArray:
    """Return a place in each cell of a grid over the map and its surroundings, (n, 2) [m]."""
    points = roads.points[:, :2]
    low, high = points.min(axis=0) - REACH, points.max(axis=0) + REACH
    size = high - low
    cell = max(cell, math.sqrt(float(size[0] * size[1]) / MAX_CELLS))
    columns, rows = (max(int(side / cell), 1) for side in size)
    x, y = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    place = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(0.2, 0.8, (columns * rows, 2))
    return np.asarray(low + cell * place)


def _add_buildings(site: RoadSite, *, rng: np.random.Generator, free: float, share: float) -> FloatArray:
    """Add buildings and return their places and radii, (n, 3) [m]."""
    builder, roads, cover, _, terrain = site
    place = _cells(roads, 3.0 * GRID, rng)
    num = len(place)
    half = rng.uniform((6.0, 5.0), (12.0, 9.0), (num, 2))
    height = rng.choice([4.0, 7.0, 10.0, 13.0, 16.0, 22.0, 31.0], num, p=[0.14, 0.24, 0.24, 0.16, 0.12, 0.07, 0.03])
    radius = np.hypot(*half.T)
    kept = np.flatnonzero(rng.random(num) < share)
    away = cover.distance(place[kept])
    kept = kept[(away > free + radius[kept]) & (away < REACH)]
    shade = rng.integers(0, len(WALLS), num)
    kept = kept[_far_apart(place[kept], radius[kept] - 1.0)]
    yaws = roads.nearest(place[kept, 0], place[kept, 1]).yaw
    for k, yaw in zip(kept.tolist(), yaws.tolist(), strict=True):
        turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
        a, b = half[k]
        outline = np.array([[-a, -b], [a, -b], [a, b], [-a, b]]) @ turn + place[k]
        floor = terrain.height(outline)
        top = float(floor.max() + height[k])
        vertices, triangles = prism(outline, float(floor.min()) - 1.0, top)
        walls = np.tile(np.array(WALLS[shade[k]], dtype=np.uint8), (len(triangles), 1))
        walls[-2:] = ROOF
        builder.add(vertices, triangles, walls, Label.BUILDING)
    return np.column_stack([place[kept], radius[kept]])


def _far_apart(place: FloatArray, radius: FloatArray) -> list[int]:
    """Return rows of circles that do not meet, the first of those that do."""
    kept: list[int] = []
    cells: dict[tuple[int, int], list[int]] = {}
    for k, (x, y) in enumerate((place // 40.0).astype(int).tolist()):
        near = [other for i in (-1, 0, 1) for j in (-1, 0, 1) for other in cells.get((x + i, y + j), ())]
        if all(np.hypot(*(place[k] - place[other])) > radius[k] + radius[other] for other in near):
            kept.append(k)
            cells.setdefault((x, y), []).append(k)
    return kept


def _add_trees(site: RoadSite, *, rng: np.random.Generator, free: float, houses: FloatArray, share: float) -> None:
    """Add trees: many near roads, few far away, none in the buildings (n, 3)."""
    builder, roads, cover, _, terrain = site
    place = _cells(roads, GRID, rng)
    num = len(place)
    size = rng.uniform(0.75, 1.35, num)
    kept = np.flatnonzero(rng.random(num) < share)
    near = rng.random(num)
    away = cover.distance(place[kept])
    is_grown = (away > free + 2.2 * size[kept]) & (away < REACH * 0.7)
    is_grown &= near[kept] < np.exp(-np.maximum(away, 0.0) / 45.0)
    kept = kept[is_grown]
    kind = rng.integers(0, 3, num)
    shade = rng.integers(0, len(LEAVES), num)
    turn = rng.uniform(0.0, 2.0 * math.pi, num)
    for k, height in zip(kept.tolist(), terrain.height(place[kept]).tolist(), strict=True):
        if len(houses) and (np.hypot(*(houses[:, :2] - place[k]).T) < houses[:, 2] + 2.0).any():
            continue
        s = size[k]
        at = np.array([*place[k], height - 0.1])
        if kind[k] < 2:  # noqa: PLR2004 - two of three have round crowns
            trunk, crown = column(0.16 * s, 0.0, 2.4 * s, 5), _crown(1.9 * s, 1.9 * s, 6.2 * s, turn[k])
        else:
            trunk, crown = column(0.14 * s, 0.0, 1.4 * s, 5), _fir(1.7 * s, 1.0 * s, 7.4 * s)
        builder.add(trunk[0] + at, trunk[1], BARK, Label.TREE)
        leaves = np.array(LEAVES[shade[k]], dtype=np.float64) * (1.0 + 0.08 * np.sin(np.arange(len(crown[1])))[:, None])
        builder.add(crown[0] + at, crown[1], leaves.astype(np.uint8), Label.TREE)


def _crown(radius: float, low: float, high: float, turn: float) -> tuple[FloatArray, np.ndarray]:
    """Return a round crown of seven sides."""
    angle = turn + 2.0 * math.pi * np.arange(7) / 7
    rings = ((0.45, 0.0), (0.95, 0.28), (0.9, 0.6), (0.45, 0.9))  # shares of the radius, and of the height
    parts = []
    for k, (r, up) in enumerate(rings):
        z = np.full(7, low + up * (high - low))
        parts.append(np.column_stack([r * radius * np.cos(angle + 0.2 * k), r * radius * np.sin(angle + 0.2 * k), z]))
    vertices = np.concatenate([*parts, [[0.0, 0.0, low], [0.0, 0.0, high]]])
    i = np.arange(7, dtype=np.int32)
    j = (i + 1) % 7
    below, above = np.column_stack([np.full_like(i, 28), j, i]), np.column_stack([21 + i, 21 + j, np.full_like(i, 29)])
    return vertices, np.concatenate([below, sides(7, len(rings)), above])


def _fir(radius: float, low: float, high: float) -> tuple[FloatArray, np.ndarray]:
    """Return three cones above one another."""
    third = (high - low) / 3.0
    return join(
        *(
            column(radius * (1.0 - 0.27 * k), low + 0.85 * third * k, low + third * (k + 1) + 0.3 * third, 7, top=0.02)
            for k in range(3)
        )
    )


def _add_roadside(site: RoadSite, *, is_town: bool) -> None:
    """Add street lamps in towns, and posts elsewhere, where an edge of a lane has nothing beside it."""
    builder, roads, cover, paint, terrain = site
    out = 1.1 if is_town else CLEARANCE
    spots, ways = [], []
    for lane in range(len(roads)):
        length = float(roads.length[lane])
        if length < 0.5 * LAMP_STEP:
            continue
        rows = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
        arcs = np.arange(0.5 * LAMP_STEP, length, LAMP_STEP)
        points = take_at(np.column_stack([roads.points[rows], roads.border[rows], across(roads.points[rows])]), arcs)
        for i, sign in ((1, -1.0), (0, 1.0)):
            offset = points[:, 3 + i] + out
            spots.append(np.column_stack([points[:, :2] + (sign * offset)[:, None] * points[:, 5:7], points[:, 2]]))
            ways.append(-sign * points[:, 5:7])
    if not spots:
        return
    place, way = np.concatenate(spots), np.concatenate(ways)
    beyond = place - np.column_stack([(SHOULDER + NARROW - out) * way, np.zeros(len(way))])
    is_free = ~(cover.is_on(place, margin=0.9) | cover.is_on(beyond) | paint.is_near(place))
    place, way = place[is_free], way[is_free]
    kept = _far_apart(place[:, :2], np.full(len(place), 0.3 * LAMP_STEP))
    place, way = place[kept], way[kept]
    foot = np.column_stack([place[:, :2], terrain.height(place) - 0.1])
    if not is_town:
        post, cap = column(0.06, 0.0, 0.95, 6), column(0.065, 0.95, 1.08, 6)
        builder.add_copies(*post, foot, colour=POST, label=Label.POLE)
        builder.add_copies(*cap, foot, colour=(200, 60, 40), label=Label.POLE)
        return
    builder.add_copies(*column(0.09, 0.0, LAMP_HEIGHT, 7, top=0.05), foot, colour=STEEL, label=Label.POLE)
    arm, glass = box((0.0, -0.04, -0.04), (1.7, 0.04, 0.04)), box((1.1, -0.14, -0.1), (1.9, 0.14, 0.0))
    aside = np.column_stack([-way[:, 1], way[:, 0]])
    for (vertices, triangles), colour, lit in ((arm, STEEL, Lit.NEVER), (glass, GLOW, Lit.IN_THE_DARK)):
        flat = vertices[None, :, :1] * way[:, None] + vertices[None, :, 1:2] * aside[:, None]
        up = np.broadcast_to(vertices[None, :, 2:] + LAMP_HEIGHT, (*flat.shape[:2], 1))
        lamp = np.concatenate([flat, up], axis=2)
        builder.add_copies(lamp, triangles, foot, colour=colour, label=Label.POLE, lit=lit)

"""Painted lines, stop lines and crosswalks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from rosbridge_sim.maps.road_map import Border, Crosswalk, RoadMap, open_outline, stripes_of
from rosbridge_sim.scenery.lines import across, cut_dashes, sample_arcs, strip, take_at
from rosbridge_sim.scenery.mesh import Colour, Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.guessed_lines import guess_borders
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads

WHITE: Final[Colour] = (236, 233, 229)
"""HSV 17, 8, 236 in OpenCV's units: within H 0..30, S <= 10, V >= 205, the ranges of all masks for white paint."""

YELLOW: Final[Colour] = (224, 188, 50)
"""HSV 24, 198, 224: within H 20..30, S >= 130, V 120..230."""

BLUE: Final[Colour] = (44, 92, 190)
"""Of bus lanes."""

STOP_LINE, KERB_TYPES = 530, frozenset({598, 599})
"""MGeo's types of stop lines, and of edges that are not painted."""

LINE_WIDTH, STOP_WIDTH = 0.15, 0.5
"""Width of painted lines [m]: 10 to 15 cm and 30 to 60 cm in Korea's manual of road markings."""

DOUBLE: Final = 0.25
"""Distance of the middles of a double line [m]."""

TOWN_DASH, FAST_DASH = (3.0, 5.0), (10.0, 10.0)
"""Dash and gap of a broken line [m], in towns and on motorways."""

FAST: Final = 80.0 / 3.6
"""Speed limit from which a map's broken lines are those of a motorway [m/s]."""

LINE_LIFT, AREA_LIFT = 0.004, 0.006
"""Paint is so high above the asphalt [m]: 2 to 3 mm on real roads, and crossing paint must not share a plane."""

STOP_NEAR: Final = 5.0
"""A lane with a stop whose end is nearer than this to a painted stop line needs no other [m]."""


def add_paint(builder: MeshBuilder, road_map: RoadMap, cover: RoadCover) -> None:
    """Add all that is painted on the roads of a map.

    Args:
        road_map: has the painted lines; a map without any gets lines along the edges of its lanes.
    """
    roads = road_map.roads
    is_fast = bool(len(roads)) and float(np.median(roads.speed_limit)) >= FAST
    dashes = FAST_DASH if is_fast else TOWN_DASH
    for border in road_map.borders or guess_borders(roads, cover):
        _add_border(builder, border, dashes)
    for crosswalk in road_map.crosswalks:
        _add_crosswalk(builder, crosswalk)
    _add_stop_lines(builder, roads, [each for each in road_map.borders if each.type == STOP_LINE])


def is_painted(border: Border) -> bool:
    """Return whether a line is painted, and no kerb."""
    return border.type not in KERB_TYPES


def _add_border(builder: MeshBuilder, border: Border, dashes: tuple[float, float]) -> None:
    if not is_painted(border):
        return
    is_stop = border.type == STOP_LINE
    width = STOP_WIDTH if is_stop else LINE_WIDTH
    shapes = border.shape or ("Solid",)
    num = min(len(shapes), 2)
    for k, shape in enumerate(shapes[:num]):
        word = border.colour[min(k, len(border.colour) - 1)].lower() if border.colour else "white"
        own_label, colour = _COLOURS.get(word, _COLOURS["white"])
        line = border.line
        if num > 1:
            side = across(line) * DOUBLE * (0.5 - k)
            line = np.column_stack([line[:, :2] + side, line[:, 2]])
        is_solid = shape.lower() == "solid"
        label = Label.STOP_LINE if is_stop else own_label
        _add_line(builder, line, width=width, dashes=None if is_solid else dashes, colour=colour, label=label)


_COLOURS: Final = {
    "white": (Label.PAINT_WHITE, WHITE),
    "yellow": (Label.PAINT_YELLOW, YELLOW),
    "blue": (Label.PAINT_BLUE, BLUE),
}


def _add_line(
    builder: MeshBuilder,
    line: FloatArray,
    *,
    width: float,
    dashes: tuple[float, float] | None,
    colour: Colour,
    label: Label,
) -> None:
    """Add a line; with dashes (length and gap) it is broken."""
    arcs = sample_arcs(line)
    ends = [(0.0, float(arcs[-1]))] if dashes is None else cut_dashes(float(arcs[-1]), *dashes)
    whole = np.column_stack([line, across(line)])
    for start, end in ends:
        part = np.concatenate([[start], arcs[(arcs > start) & (arcs < end)], [end]])
        values = take_at(whole, part)
        points, side = values[:, :3] + (0.0, 0.0, LINE_LIFT), values[:, 3:]
        side = side / np.maximum(np.linalg.norm(side, axis=1), 1e-6)[:, None] * (0.5 * width)
        shift = np.column_stack([side, np.zeros(len(part))])
        builder.add(*strip(points + shift, points - shift), colour, label)


def _add_crosswalk(builder: MeshBuilder, crosswalk: Crosswalk) -> None:
    """Add the bars of a crosswalk, which lie along the road, across the longer side of each part."""
    for outline in crosswalk.outlines:
        corners = four_corners(outline)
        quads = None if corners is None else stripes_of(corners)
        if quads is None:
            continue
        quads[..., 2] += AREA_LIFT
        if np.cross(quads[0, 1] - quads[0, 0], quads[0, 3] - quads[0, 0])[2] < 0.0:
            quads = quads[:, ::-1]
        builder.add_quads(quads, WHITE, Label.CROSSWALK)


def four_corners(outline: FloatArray) -> FloatArray | None:
    """Return a quadrilateral for an outline: itself, or the box along its longest side; None if it has no area."""
    outline = open_outline(outline)
    if len(outline) == 4:  # noqa: PLR2004 - most crosswalks
        return outline
    if len(outline) < 3:  # noqa: PLR2004 - no area
        return None
    sides = np.roll(outline, -1, axis=0) - outline
    longest = sides[np.argmax(np.hypot(sides[:, 0], sides[:, 1])), :2]
    along = longest / max(float(np.hypot(*longest)), 1e-6)
    turn = np.array([along, [-along[1], along[0]]])
    flat = outline[:, :2] @ turn.T
    (u0, v0), (u1, v1) = flat.min(axis=0), flat.max(axis=0)
    corners = np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]]) @ turn
    near = np.linalg.norm(corners[:, None] - outline[None, :, :2], axis=2).argmin(axis=1)
    return np.column_stack([corners, outline[near, 2]])


def _add_stop_lines(builder: MeshBuilder, roads: Roads, painted: Sequence[Border]) -> None:
    """Add stop lines at the ends of lanes with a stop where the map has no painted one."""
    starts = np.concatenate([np.zeros((0, 2)), *(border.line[:-1, :2] for border in painted)])
    steps = np.concatenate([np.zeros((0, 2)), *(np.diff(border.line[:, :2], axis=0) for border in painted)])
    left, right, ahead = roads.edge_lines()
    for lane in np.flatnonzero(roads.is_stop).tolist():
        last = int(roads.first[lane + 1]) - 1
        end = roads.points[last]
        away = end[:2] - starts
        share = np.clip((away * steps).sum(axis=1) / np.maximum(np.square(steps).sum(axis=1), 1e-9), 0.0, 1.0)
        if (np.hypot(*(away - share[:, None] * steps).T) < STOP_NEAR).any():
            continue
        line = np.array([left[last], right[last]])
        line[:, :2] -= 0.5 * STOP_WIDTH * ahead[last]
        _add_line(builder, line, width=STOP_WIDTH, dashes=None, colour=WHITE, label=Label.STOP_LINE)

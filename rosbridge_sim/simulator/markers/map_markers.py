"""The markers of `/sim/scene/map`: road, edges and painted lines, stop lines, crosswalks and posts of lights.

The number of points is bounded: lines are drawn with as few points as their bends need, and with fewer on a large map.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.road_map import RoadMap, stripes_of
from rosbridge_sim.simulator.markers.markers import COLOURS, MarkerMaker, MarkerShape
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Light

MAX_MAP_POINTS: Final = 60_000
"""Points of all markers together: some 2.5 MB of JSON, which every rosbridge accepts in one message (10 MB)."""

TOLERANCES: Final = (0.05, 0.2, 1.0)
"""Largest distances of a drawn line from the true one [m]. The first that keeps within `MAX_MAP_POINTS` is taken: about
the width of paint, of a car's mirror, or just visible."""

PAINT_SHARE: Final = 0.25
"""Part of the points that painted lines, stop lines, crosswalks and posts may have each; the road has the rest."""

EDGE_WIDTH: Final = 0.12
"""Width of a painted line [m], as on real roads; a broken one is drawn half as wide."""

STOP_WIDTH: Final = 0.4
"""Width of a stop line [m], as on real roads."""

POST_WIDTH: Final = 0.15
"""Width of a light's post [m]."""

LIFT: Final = 0.03
"""Height of paint above the road [m]: otherwise viewers draw both at the same height, which flickers."""

POST_HEIGHT: Final = 5.0
"""Height of a light above the road where the map gives no height [m]."""

LOW_LAMP: Final = 1.5
"""A light lower than this above the road has no height in the map [m]: real ones hang higher, to be seen."""


def make_map_markers(make: MarkerMaker, header: Struct, road_map: RoadMap) -> list[Struct]:
    """Return the markers of a map; it may be called in a thread.

    Returns:
        First the deletion of what was there before, then the markers.
    """
    share = int(MAX_MAP_POINTS * PAINT_SHARE) // 3
    markers = [make.delete_all(header)]

    def add(ns: str, shape: MarkerShape, width: float, colour: str, points: FloatArray) -> None:
        if len(points):
            size = make.size(1.0, 1.0, 1.0) if shape == MarkerShape.TRIANGLES else make.size(width, 0.0, 0.0)
            number = sum(marker.ns == ns for marker in markers)
            paint = make.colour(COLOURS[colour])
            markers.append(make.group(header, ns, number, shape, size=size, colour=paint, points=make.points(points)))

    for ns, colour, shape, points in _road(road_map, MAX_MAP_POINTS - 4 * share):
        add(ns, shape, EDGE_WIDTH, colour, points)
    for colour, width, points in _paint(road_map, share):
        add("borders", MarkerShape.LINE_LIST, width, colour, points)
    add("stop_lines", MarkerShape.LINE_LIST, STOP_WIDTH, "stop", _stop_lines(road_map.roads)[:share])
    add("crosswalks", MarkerShape.TRIANGLES, 0.0, "white", _crosswalks(road_map)[:share])
    add("posts", MarkerShape.LINE_LIST, POST_WIDTH, "post", _posts(road_map)[:share])
    return markers


# Road


def _road(road_map: RoadMap, budget: int) -> Iterator[tuple[str, str, MarkerShape, FloatArray]]:
    """Yield namespace, colour, shape and points of the road's surface and of its edges."""
    roads = road_map.roads
    if not len(roads):
        return
    has_paint = bool(road_map.borders)
    is_inside = road_map.find_inside()  # edges there would cross everything
    for tolerance in TOLERANCES:
        kept = _kept(roads.points, roads.first, tolerance, roads.border)
        starts, lanes = _segments(kept, roads.first)
        num_points = 6 * len(starts) + (0 if has_paint else 4 * int((~is_inside[lanes]).sum()))
        if num_points <= budget:
            break
    else:  # too large for surfaces: the middle lines, of the longest lanes first
        starts, lanes = _longest(starts, lanes, roads.length, budget // 2)
        ends = _next(kept)[starts]
        yield "lanes", "road", MarkerShape.LINE_LIST, _pairs(roads.points[starts], roads.points[ends])
        return
    ends = _next(kept)[starts]
    left, right, _ = roads.derived(Roads.edge_lines)
    for colour, chosen in (("road", ~is_inside[lanes]), ("inside", is_inside[lanes])):
        first, last = starts[chosen], ends[chosen]
        yield "lanes", colour, MarkerShape.TRIANGLES, _quads(left[first], right[first], right[last], left[last])
    if not has_paint:
        chosen = ~is_inside[lanes]
        first, last = starts[chosen], ends[chosen]
        edges = np.concatenate([_pairs(left[first], left[last]), _pairs(right[first], right[last])])
        edges[:, 2] += LIFT
        yield "edges", "white", MarkerShape.LINE_LIST, edges


def _kept(points: FloatArray, first: IntArray, tolerance: float, border: FloatArray | None = None) -> BoolArray:
    """Return which points of polylines, end to end, are needed to draw them.

    A chord of length l over a line that turns by an angle a is at most l a / 8 away from it. So over a piece with the
    turn a, a drawing needs about sqrt(l a / (8 tolerance)) points; the sum of these tells where to put the next one.

    Args:
        points: (n, 3) [m].
        first: (l + 1,) first point of each polyline, and n.
        tolerance: largest distance between both lines [m].
        border: (n, 2) distances of the edges, which must be drawn as exactly; None for none [m].

    Returns:
        (n,); the first and the last point of each polyline are among them.
    """
    step = np.diff(points, axis=0)
    length = np.sqrt((step * step).sum(axis=1))
    unit = step / np.maximum(length, 1e-9)[:, None]
    need = np.zeros(len(points))
    turn = np.sqrt(((unit[1:] - unit[:-1]) ** 2).sum(axis=1))
    need[1:-1] = np.sqrt(turn * (length[1:] + length[:-1]) * 0.5 / (8.0 * tolerance))
    if border is not None:
        need[1:] += np.abs(np.diff(border, axis=0)).sum(axis=1) / (8.0 * tolerance)
    need[first[:-1]] = 0.0
    place = np.floor(np.cumsum(need))
    kept = np.zeros(len(points), dtype=bool)
    kept[1:] = place[1:] > place[:-1]
    kept[first[:-1]] = True
    kept[first[1:] - 1] = True
    return kept


def _segments(kept: BoolArray, first: IntArray) -> tuple[IntArray, IntArray]:
    """Return the point at which each drawn segment begins, and its polyline."""
    is_start = kept.copy()
    is_start[first[1:] - 1] = False
    starts = np.flatnonzero(is_start)
    return starts, np.searchsorted(first, starts, side="right") - 1


def _next(kept: BoolArray) -> IntArray:
    """Return for each point the next one that is drawn; the last one has itself."""
    n = len(kept)
    place = np.where(kept, np.arange(n), n - 1)
    after = np.append(np.minimum.accumulate(place[::-1])[::-1][1:], n - 1)
    return np.asarray(after)


def _longest(starts: IntArray, lines: IntArray, length: FloatArray, most: int) -> tuple[IntArray, IntArray]:
    """Return the segments of the longest polylines, at most so many."""
    num = np.bincount(lines, minlength=len(length))
    order = np.argsort(-length, kind="stable")
    fits = np.zeros(len(length), dtype=bool)
    fits[order] = np.cumsum(num[order]) <= most
    return starts[fits[lines]], lines[fits[lines]]


def _pairs(first: FloatArray, last: FloatArray) -> FloatArray:
    """Return the ends of lines, (2k, 3), from two times (k, 3)."""
    return np.stack([first, last], axis=1).reshape(-1, 3)


def _quads(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return the corners of two triangles for each quadrangle, (6k, 3), counter-clockwise as seen from above."""
    return np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)


# Paint


def _paint(road_map: RoadMap, budget: int) -> Iterator[tuple[str, float, FloatArray]]:
    """Yield colour, width [m] and points of the painted lines and kerbs."""
    borders = [border for border in road_map.borders if len(border.line) > 1]
    if not borders:
        return
    points = np.concatenate([border.line for border in borders])
    first = np.cumsum([0, *(len(border.line) for border in borders)])
    for tolerance in TOLERANCES:
        kept = _kept(points, first, tolerance)
        starts, lines = _segments(kept, first)
        if 2 * len(starts) <= budget:
            break
    else:
        step = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
        length = np.array([step[a : b - 1].sum() for a, b in pairwise(first.tolist())])
        starts, lines = _longest(starts, lines, length, budget // 2)
    ends = _next(kept)[starts]
    looks = [_look(border.colour, border.shape) for border in borders]
    for look in dict.fromkeys(looks):
        chosen = np.array([one == look for one in looks])[lines]
        ends_of_lines = _pairs(points[starts[chosen]], points[ends[chosen]])
        ends_of_lines[:, 2] += LIFT
        yield *look, ends_of_lines


def _look(colours: tuple[str, ...], shapes: tuple[str, ...]) -> tuple[str, float]:
    """Return colour and width [m] of a painted line."""
    colour = colours[0].lower() if colours else ""
    is_broken = bool(shapes) and all(shape.lower() == "broken" for shape in shapes)
    return (colour if colour in ("yellow", "blue") else "white"), EDGE_WIDTH / 2 if is_broken else EDGE_WIDTH


def _stop_lines(roads: Roads) -> FloatArray:
    """Return the ends of the stop lines, (2k, 3) [m]."""
    if not len(roads):
        return np.empty((0, 3))
    left, right, _ = roads.derived(Roads.edge_lines)
    last = roads.first[1:][roads.is_stop] - 1
    ends = _pairs(left[last], right[last])
    ends[:, 2] += 2 * LIFT
    return ends


def _crosswalks(road_map: RoadMap) -> FloatArray:
    """Return the triangles of the crosswalks' stripes, (6k, 3) [m]."""
    quads = [_stripes(outline) for crosswalk in road_map.crosswalks for outline in crosswalk.outlines]
    triangles = np.concatenate(quads) if quads else np.empty((0, 3))
    triangles[:, 2] += LIFT
    return triangles


def _stripes(outline: FloatArray) -> FloatArray:
    """Return the triangles of a crosswalk: stripes along the driving direction, or all of it if it is no rectangle."""
    stripes = stripes_of(outline)
    if stripes is None:
        corners = outline[:-1] if len(outline) > 1 and (outline[0] == outline[-1]).all() else outline
        return np.array([(corners[0], b, c) for b, c in pairwise(corners[1:])]).reshape(-1, 3)
    return _quads(*stripes.transpose(1, 0, 2))


def _posts(road_map: RoadMap) -> FloatArray:
    """Return foot and head of each light's post, (2k, 3) [m]."""
    plan, roads = road_map.plan, road_map.roads
    if not plan.lights:
        return np.empty((0, 3))
    heads = [(light.x, light.y, lamp_height(light, roads)) for light in plan.lights]
    feet = [(light.x, light.y, _ground(light, roads)) for light in plan.lights]
    return _pairs(np.array(feet), np.array(heads))


def _ground(light: Light, roads: Roads) -> float:
    """Return the height of the road at a light [m]; for one without lanes, a post's length below it."""
    if light.lanes:
        return float(roads.points[roads.first[light.lanes[0]], 2])
    return light.z - POST_HEIGHT if light.z > LOW_LAMP else light.z


def lamp_height(light: Light, roads: Roads) -> float:
    """Return the height at which a light is drawn: that of the map, or above the road where the map has none [m]."""
    ground = _ground(light, roads)
    return light.z if light.z - ground > LOW_LAMP else ground + POST_HEIGHT

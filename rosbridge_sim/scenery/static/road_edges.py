"""Edges of the roads: kerbs with pavements, verges, walls of bridges, and asphalt in narrow gaps between roads.

From each place at the edge of a lane a line is followed outwards. What comes within `NARROW` - another lane, or paint
beside the lanes - belongs to the road: the gap is asphalt, and behind another lane that lane's own edge goes on. What
comes later ends the pavement and the verge: two roads share the ground between them, each takes half of it.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from rosbridge_sim.scenery.lines import runs_of, sample_arcs
from rosbridge_sim.scenery.mesh import Colour, Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.loose_paint import LoosePaint
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_surface import ASPHALT, SHOULDER, LaneEdge, sample_lane
from rosbridge_sim.scenery.static.terrain import Terrain
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.roads import Roads

KERB_WIDTH, KERB_HEIGHT = 0.18, 0.09
"""[m]; a kerb at a crossing of people is lower than the usual 15 cm, and here all are."""

PAVEMENT_WIDTH, PAVEMENT_HEIGHT = 2.6, 0.03
"""[m]. It is low, because people walk at the height of the road."""

VERGE_WIDTH: Final = 3.0
"""Beyond kerb and pavement the edge leads down to the ground over this width [m]."""

LEAST_VERGE: Final = 0.5
"""Narrowest verge. If less room is left beside the pavement, the pavement takes it [m]."""

NARROW: Final = PAVEMENT_WIDTH
"""Ground between a lane and what comes beside it that is not wider than this is asphalt [m]: a pavement has no room."""

NARROW_IN_CROSSINGS: Final = 14.0
"""The same within a crossing [m]: no islands are drawn."""

BESIDE: Final = 0.1
"""A lane that is met nearer than this lies directly beside, and no gap between both is to be filled [m]."""

OUTWARD: Final = 0.25
"""Distance of the places on the line outwards [m]."""

REACH: Final = PAVEMENT_WIDTH + VERGE_WIDTH + OUTWARD
"""Length of the line outwards [m]."""

JUMP: Final = 2.0 * OUTWARD
"""Change of the width of a gap from one place to the next beyond which its edge is cut [m]."""

MIN_RUN: Final = 4
"""Pieces of an edge in a row that have a kerb at least: shorter ones are holes between lanes."""

STEP: Final = 1.0
"""Distance of the places at which an edge is looked at [m]."""

LONGEST_TURN: Final = 80.0
"""Lanes within a crossing are not longer [m]."""

BRIDGE: Final = 2.0
"""Height of an edge above the ground from which on the road is a bridge [m]."""

PARAPET, DECK = 0.9, 0.7
"""Height of the wall of a bridge above the road, and depth of its deck below it [m]."""

UP: Final = np.array([0.0, 0.0, 1.0])

GREY: Final[Colour] = (168, 166, 160)
SLABS: Final[Colour] = (150, 146, 140)
VERGE: Final[Colour] = (99, 112, 86)


class RoadSite(NamedTuple):
    """The surroundings of roads, for the functions that build things beside them.

    Attributes:
        builder: takes the meshes.
        roads: of the map.
        cover: of their lanes.
        paint: beside the lanes.
        terrain: the ground.
    """

    builder: MeshBuilder
    roads: Roads
    cover: RoadCover
    paint: LoosePaint
    terrain: Terrain


def add_edges(site: RoadSite, *, has_pavement: bool) -> None:
    """Add what lies at the sides of the roads.

    Args:
        has_pavement: people walk here.
    """
    builder, roads, cover, paint, terrain = site
    edges = [edge for lane in range(len(roads)) for edge in sample_lane(roads, lane, STEP, 2).edges()]
    nums = [len(edge.points) for edge in edges]
    narrow = np.where(_are_turns(roads), NARROW_IN_CROSSINGS, NARROW).repeat(2).repeat(nums)
    whole = _join(edges)
    room = _look_outwards(cover, paint, whole, narrow)
    far = whole.beyond(room.filled)
    far[:, 2] = cover.height(far)
    outer = whole.beyond(VERGE_WIDTH)
    is_bridge = outer[:, 2] - terrain.height(outer) > BRIDGE
    for edge, rows in zip(edges, np.split(np.arange(len(whole.points)), np.cumsum(nums)[:-1]), strict=True):
        _add_filling(builder, edge, far[rows], room.filled[rows])
        is_open = _drop_short(~room.is_closed[rows])
        shifted = edge._replace(offset=edge.offset + room.filled[rows])
        free = _narrowest(np.where(is_open, room.free[rows], np.inf))
        shape = np.column_stack([room.filled[rows], free])
        for which in (is_open & ~is_bridge[rows], is_open & is_bridge[rows]):
            for start, end in _smooth_runs(which, room.filled[rows]):
                here = _thin(edge.points, shape, start, end)
                if is_bridge[rows[start]]:
                    _add_parapet(builder, shifted.take(here))
                else:
                    _add_edge(builder, terrain, shifted.take(here), free[here], has_pavement=has_pavement)


class _Room(NamedTuple):
    """Ground beside the places of edges, (n,) each.

    Attributes:
        filled: width of the narrow gap up to a lane or to the end of paint [m]; 0 without one.
        is_closed: a lane lies behind the gap.
        free: width that pavement and verge may have beyond that [m].
    """

    filled: FloatArray
    is_closed: BoolArray
    free: FloatArray


def _join(edges: list[LaneEdge]) -> LaneEdge:
    """Return the places of all edges, one after the other."""
    points, out, offset, rise = (np.concatenate(column) for column in list(zip(*edges, strict=True))[:4])
    return LaneEdge(points, out, offset, rise, left=False)


def _are_turns(roads: Roads) -> BoolArray:
    """Return which lanes are ways through a crossing, (l,): short, and behind a stop line, a fork or before a join."""
    found = np.zeros(len(roads), dtype=bool)
    num_before = np.bincount(roads.successor, minlength=len(roads))
    for lane, (start, end) in enumerate(pairwise(roads.first_successor.tolist())):
        then = roads.successor[start:end]
        found[then] |= bool(roads.is_stop[lane]) or end - start > 1
        found[lane] |= bool((num_before[then] > 1).any())
    return found & (roads.length <= LONGEST_TURN)


def _look_outwards(cover: RoadCover, paint: LoosePaint, edge: LaneEdge, narrow: FloatArray) -> _Room:
    """Return the ground beside each place, up to the first lane.

    Args:
        narrow: widest gap that is filled, (n,) [m].
    """
    num = len(edge.points)
    filled, free, is_closed = np.zeros(num), np.full(num, REACH), np.zeros(num, dtype=bool)
    rows = np.arange(num)
    for distance in [BESIDE, *np.arange(OUTWARD, NARROW_IN_CROSSINGS + 2.0 * REACH, OUTWARD).tolist()]:
        places = edge.take(rows).beyond(distance)
        is_lane = cover.is_on(places, margin=SHOULDER)
        is_met = is_lane | paint.is_near(places)
        gap = distance - filled[rows]
        is_filled = is_met & (gap <= narrow[rows])
        if distance > BESIDE:
            filled[rows[is_filled]] = distance
        is_closed[rows[is_filled & is_lane]] = True
        is_beyond = is_met & ~is_filled
        free[rows[is_beyond]] = np.where(is_lane, 0.5 * gap, gap - OUTWARD)[is_beyond]
        rows = rows[~is_beyond & ~(is_filled & is_lane) & (gap < np.maximum(narrow[rows], REACH))]
    return _Room(filled, is_closed, np.minimum(free, REACH))


def _narrowest(free: FloatArray) -> FloatArray:
    """Return the least of each value and its two neighbours: straight pieces between places leave lanes free, too."""
    wide = np.pad(free, 1, mode="edge")
    return np.minimum(np.minimum(wide[:-2], wide[2:]), free)


def _drop_short(is_open: BoolArray) -> BoolArray:
    kept = np.zeros_like(is_open)
    for start, end in runs_of(is_open):
        if end - start >= MIN_RUN or (end - start) == len(is_open):
            kept[start:end] = True
    return kept


def _smooth_runs(which: BoolArray, filled: FloatArray) -> list[tuple[int, int]]:
    """Return the runs of true values, cut where the edge jumps: a slanted piece would cross what it jumps over."""
    jumps = 1 + np.flatnonzero(np.abs(np.diff(filled)) > JUMP)
    runs = []
    for start, end in runs_of(which):
        cuts = [start, *jumps[(jumps > start) & (jumps < end)].tolist(), end]
        runs += [(a, b) for a, b in pairwise(cuts) if b - a > 1]
    return runs


def _thin(line: FloatArray, widths: FloatArray, start: int, end: int) -> IntArray:
    """Return those rows of a run that the line (n, 3), or widths beside it (n, k), need."""
    line, widths = line[start:end], widths[start:end]
    arcs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
    near = np.clip(np.searchsorted(arcs, sample_arcs(line)), 0, len(arcs) - 1)
    is_other = np.any(np.diff(widths, axis=0) != 0.0, axis=1)
    is_kept = np.append(is_other, True) | np.append(True, is_other)
    is_kept[near] = True
    return start + np.flatnonzero(is_kept)


def _add_filling(builder: MeshBuilder, edge: LaneEdge, far: FloatArray, filled: FloatArray) -> None:
    """Add asphalt between an edge and places (n, 3) outwards, where its width (n,) is not 0.

    Each piece of it ends in a point at the places beside it, which closes the corners where two turns part.
    """
    is_filled = filled > 0.0
    if not is_filled.any():
        return
    near = edge.beyond(0.0)
    far = np.where(is_filled[:, None], far, near)
    for start, end in runs_of(np.convolve(is_filled, [1, 1, 1], mode="same") > 0):
        own = _thin(edge.points, filled[:, None], start, end)
        edge.add_ring(builder, near[own], far[own], (ASPHALT, Label.ASPHALT))


def _add_edge(builder: MeshBuilder, terrain: Terrain, edge: LaneEdge, free: FloatArray, *, has_pavement: bool) -> None:
    """Add the edge of a lane to one side: the rings of a profile across it, from the road outwards.

    Args:
        free: width that it may have, (n,) [m].
    """
    profile: list[tuple[float | FloatArray, float, Colour, Label]] = []
    out = np.zeros(len(free))
    if has_pavement:
        out = np.where(free < PAVEMENT_WIDTH + LEAST_VERGE, free, PAVEMENT_WIDTH)
        profile += [
            (0.0, KERB_HEIGHT, GREY, Label.KERB),
            (KERB_WIDTH, KERB_HEIGHT, GREY, Label.KERB),
            (KERB_WIDTH, PAVEMENT_HEIGHT, GREY, Label.KERB),
            (out, PAVEMENT_HEIGHT, SLABS, Label.PAVEMENT),
        ]
    rings = [edge.beyond(0.0), *(edge.beyond(width) + height * UP for width, height, _, _ in profile)]
    last = edge.beyond(np.minimum(out + VERGE_WIDTH, free))
    last[:, 2] = np.minimum(terrain.height(last), last[:, 2]) - 0.3
    rings.append(last)
    looks = [(colour, label) for _, _, colour, label in profile] + [(VERGE, Label.GROUND)]
    for (inner, outer), look in zip(pairwise(rings), looks, strict=True):
        edge.add_ring(builder, inner, outer, look)


def _add_parapet(builder: MeshBuilder, edge: LaneEdge) -> None:
    """Add a wall along the edge of a bridge, and the side of its deck."""
    wall = ((0.0, 0.0), (0.0, PARAPET), (0.25, PARAPET), (0.25, -DECK))
    for inner, outer in pairwise(edge.beyond(width) + height * UP for width, height in wall):
        edge.add_ring(builder, inner, outer, (GREY, Label.KERB))

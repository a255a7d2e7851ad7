"""Asphalt of the lanes, and kerbs and pavements along the edges of the roads."""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from rosbridge_sim.scenery.lines import across, sample_arcs, strip, take_at
from rosbridge_sim.scenery.mesh import Colour, Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.terrain import Terrain
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray
from rosbridge_sim.world.roads.roads import Roads

__all__ = ["ASPHALT", "add_asphalt", "add_edges"]

ASPHALT: Final[Colour] = (97, 97, 99)
"""Colour of the lanes: V is about 100 of 255, so no mask for white paint takes it."""

SHOULDER: Final = 0.35
"""Asphalt beyond the edges of the lanes [m]: the painted line lies on it, and it closes gaps between lanes."""

OVERLAP: Final = 0.2
"""Lanes are drawn so much longer at both ends [m], so that no gap is seen between one and the next."""

KERB_WIDTH, KERB_HEIGHT = 0.18, 0.09
"""[m]; a kerb at a crossing of people is lower than the usual 15 cm, and here all are."""

PAVEMENT_WIDTH, PAVEMENT_HEIGHT = 2.6, 0.03
"""[m]. It is low, because people walk at the height of the road."""

PROBE: Final = 0.25
"""A place so far beyond the shoulder tells whether there is another lane [m]."""

MIN_RUN: Final = 4
"""Pieces of an edge in a row that have a kerb at least: shorter ones are holes between lanes."""

STEP: Final = 1.0
"""Distance of the places at which an edge is looked at [m]."""

GAP: Final = 14.0
"""Within a crossing, ground between two lanes that is not wider than this is asphalt [m]: no islands are drawn."""

LONGEST_TURN: Final = 80.0
"""Lanes within a crossing are not longer [m]."""

VERGE_WIDTH: Final = 3.0
"""Beyond kerb and pavement the edge leads down to the ground over this width [m]."""

BRIDGE: Final = 2.0
"""Height of an edge above the ground from which on the road is a bridge [m]."""

PARAPET, DECK = 0.9, 0.7
"""Height of the wall of a bridge above the road, and depth of its deck below it [m]."""

GREY: Final[Colour] = (168, 166, 160)
SLABS: Final[Colour] = (150, 146, 140)
VERGE: Final[Colour] = (99, 112, 86)


def add_asphalt(builder: MeshBuilder, roads: Roads) -> None:
    """Add the surface of all lanes."""
    for lane in range(len(roads)):
        line, borders, bank = _lane(roads, lane)
        arcs = sample_arcs(line)
        points = take_at(line, arcs)
        edges = take_at(np.column_stack([line[:, :2], borders, bank]), arcs)[:, 2:]
        side = across(points)
        along = np.column_stack([side[:, 1], -side[:, 0]])
        points[0, :2] -= OVERLAP * along[0]
        points[-1, :2] += OVERLAP * along[-1]
        left, right = (_beside(points, side, edges[:, i] + SHOULDER, edges[:, 2 + i], i) for i in (0, 1))
        middle_left, middle_right = strip(left, points), strip(points, right)
        if bank.any():
            builder.add(*middle_left, ASPHALT, Label.ASPHALT)
            builder.add(*middle_right, ASPHALT, Label.ASPHALT)
        else:
            builder.add(*strip(left, right), ASPHALT, Label.ASPHALT)


def add_edges(builder: MeshBuilder, roads: Roads, cover: RoadCover, terrain: Terrain, *, has_pavement: bool) -> None:
    """Add kerbs where a road ends to the side, and pavements or verges behind them.

    Args:
        terrain: the ground, to which the edges lead down.
        has_pavement: people walk here.
    """
    is_turn = _are_turns(roads)
    for lane in range(len(roads)):
        line, borders, bank = _lane(roads, lane)
        length = float(roads.length[lane])
        arcs = np.linspace(0.0, length, max(round(length / STEP), 2) + 1)
        points = take_at(line, arcs)
        edges = take_at(np.column_stack([line[:, :2], borders, bank]), arcs)[:, 2:]
        side = across(points)
        for i in (0, 1):
            offset = edges[:, i] + SHOULDER
            probe = _beside(points, side, offset + PROBE, edges[:, 2 + i], i)
            is_ground = ~cover.is_on(probe, margin=SHOULDER)
            is_open = _drop_short(is_ground)
            whole = _Edge(points, side, offset, edges[:, 2 + i], left=not i)
            if is_turn[lane]:
                is_open &= ~_add_gaps(builder, cover, whole, is_ground)
            outer = whole.beyond(VERGE_WIDTH)
            is_bridge = outer[:, 2] - terrain.height(outer) > BRIDGE
            for start, end in [*_runs(is_open & ~is_bridge), *_runs(is_open & is_bridge)]:
                own = slice(start, end)
                at = arcs[own]
                keep = np.isin(at, _thin(at, take_at(line, at)))
                points_here, side_here = points[own][keep], side[own][keep]
                edge = _Edge(points_here, side_here, offset[own][keep], edges[own][keep, 2 + i], left=not i)
                if is_bridge[start]:
                    _add_parapet(builder, edge)
                else:
                    _add_edge(builder, terrain, edge, has_pavement=has_pavement)


def _are_turns(roads: Roads) -> BoolArray:
    """Return which lanes are ways through a crossing, (l,): short, and behind a stop line, a fork or before a join."""
    found = np.zeros(len(roads), dtype=bool)
    num_before = np.bincount(roads.successor, minlength=len(roads))
    for lane, (start, end) in enumerate(pairwise(roads.first_successor.tolist())):
        then = roads.successor[start:end]
        found[then] |= bool(roads.is_stop[lane]) or end - start > 1
        found[lane] |= bool((num_before[then] > 1).any())
    return found & (roads.length <= LONGEST_TURN)


def _add_gaps(builder: MeshBuilder, cover: RoadCover, edge: _Edge, is_open: BoolArray) -> BoolArray:
    """Fill narrow ground between the edge of a lane and the next lane with asphalt; return where, (n,).

    Each piece of it ends in a point at the places beside it, which closes the corners where two turns part.
    """
    width = np.zeros(len(is_open))
    for distance in np.arange(1.0, GAP + 1.0):
        empty = np.flatnonzero(is_open & (width == 0.0))
        reached = cover.is_on(edge.beyond(distance)[empty], margin=SHOULDER)
        width[empty[reached]] = distance
    is_gap = width > 0.0
    if not is_gap.any():
        return is_gap
    with_ends = np.convolve(is_gap, [1, 1, 1], mode="same") > 0
    edges = edge.beyond(0.0)
    for start, end in _runs(with_ends):
        near = edges[start:end]
        far = np.array([edge.beyond(distance)[start + i] for i, distance in enumerate(width[start:end].tolist())])
        builder.add(*(strip(far, near) if edge.left else strip(near, far)), ASPHALT, Label.ASPHALT)
    return is_gap


class _Edge(NamedTuple):
    """An edge of a road: the line of a lane, and how far beside it the road ends, (n,) each.

    Attributes:
        points: (n, 3) of the lane's line [m].
        side: (n, 2) unit vectors to its left.
        offset: of the edge from the line [m].
        bank: rise to the left for each metre.
        left: whether the edge is on the left.
    """

    points: FloatArray
    side: FloatArray
    offset: FloatArray
    bank: FloatArray
    left: bool

    def beyond(self, distance: float) -> FloatArray:
        """Return the places at a distance outwards from the edge, (n, 3) [m]."""
        return _beside(self.points, self.side, self.offset + distance, self.bank, 0 if self.left else 1)


def _add_edge(builder: MeshBuilder, terrain: Terrain, edge: _Edge, *, has_pavement: bool) -> None:
    """Add the edge of a lane to one side: the rings of a profile across it, from the road outwards."""
    up = np.array([0.0, 0.0, 1.0])
    profile: list[tuple[float, float, Colour, Label]] = []
    out = 0.0
    if has_pavement:
        profile += [
            (0.0, KERB_HEIGHT, GREY, Label.KERB),
            (KERB_WIDTH, KERB_HEIGHT, GREY, Label.KERB),
            (KERB_WIDTH, PAVEMENT_HEIGHT, GREY, Label.KERB),
            (PAVEMENT_WIDTH, PAVEMENT_HEIGHT, SLABS, Label.PAVEMENT),
        ]
        out = PAVEMENT_WIDTH
    rings = [edge.beyond(0.0), *(edge.beyond(width) + height * up for width, height, _, _ in profile)]
    last = edge.beyond(out + VERGE_WIDTH)
    last[:, 2] = np.minimum(terrain.height(last), last[:, 2]) - 0.3
    rings.append(last)
    looks = [(colour, label) for _, _, colour, label in profile] + [(VERGE, Label.GROUND)]
    for (inner, outer), (colour, label) in zip(pairwise(rings), looks, strict=True):
        builder.add(*(strip(outer, inner) if edge.left else strip(inner, outer)), colour, label)


def _add_parapet(builder: MeshBuilder, edge: _Edge) -> None:
    """Add a wall along the edge of a bridge, and the side of its deck."""
    up = np.array([0.0, 0.0, 1.0])
    wall = ((0.0, 0.0), (0.0, PARAPET), (0.25, PARAPET), (0.25, -DECK))
    rings = [edge.beyond(width) + height * up for width, height in wall]
    for inner, outer in pairwise(rings):
        builder.add(*(strip(outer, inner) if edge.left else strip(inner, outer)), GREY, Label.KERB)


def _lane(roads: Roads, lane: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    rows = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
    return roads.points[rows], roads.border[rows], roads.bank[rows]


def _beside(points: FloatArray, side: FloatArray, offset: FloatArray, bank: FloatArray, i: int) -> FloatArray:
    """Return places to the left (0) or to the right (1) of a line, on the plane of its bank."""
    sign = 1.0 if i == 0 else -1.0
    signed = (sign * offset)[:, None]
    return np.column_stack([points[:, :2] + signed * side, points[:, 2] + signed[:, 0] * bank])


def _runs(is_open: BoolArray) -> list[tuple[int, int]]:
    """Return start and end of each run of true values."""
    edge = np.flatnonzero(np.diff(np.concatenate([[0], is_open.view(np.int8), [0]])))
    return [(start, end) for start, end in edge.reshape(-1, 2).tolist() if end - start > 1]


def _drop_short(is_open: BoolArray) -> BoolArray:
    kept = np.zeros_like(is_open)
    for start, end in _runs(is_open):
        if end - start >= MIN_RUN or (end - start) == len(is_open):
            kept[start:end] = True
    return kept


def _thin(arcs: FloatArray, points: FloatArray) -> FloatArray:
    """Return those of some arc lengths that a straight piece needs [m]."""
    wanted = sample_arcs(points) + arcs[0]
    near = np.clip(np.searchsorted(arcs, wanted), 0, len(arcs) - 1)
    return np.unique(np.concatenate([arcs[[0, -1]], arcs[near]]))

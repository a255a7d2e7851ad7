"""Asphalt of the lanes."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from rosbridge_sim.scenery.lines import across, sample_arcs, strip, take_at
from rosbridge_sim.scenery.mesh import Colour, Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.roads import Roads

ASPHALT: Final[Colour] = (97, 97, 99)
"""Colour of the lanes: V is about 100 of 255, so no mask for white paint takes it."""

SHOULDER: Final = 0.35
"""Asphalt beyond the edges of the lanes [m]: the painted line lies on it, and it closes gaps between lanes."""

OVERLAP: Final = 0.2
"""Lanes are drawn so much longer at both ends [m], so that no gap is seen between one and the next."""


def add_asphalt(builder: MeshBuilder, roads: Roads) -> None:
    """Add the surface of all lanes."""
    for row in range(len(roads)):
        lane = sample_lane(roads, row)
        points = lane.points
        for end, inner in ((0, 1), (-1, -2)):
            outwards = points[end] - points[inner]
            points[end] += OVERLAP / np.hypot(*outwards[:2]) * outwards
        left, right = (edge.beyond(0.0) for edge in lane.edges())
        for pair in ((left, points), (points, right)) if lane.bank.any() else ((left, right),):
            builder.add(*strip(*pair), ASPHALT, Label.ASPHALT)


class LaneEdge(NamedTuple):
    """One edge of a lane, or several in one: where its asphalt ends.

    Attributes:
        points: (n, 3) on the lane's line [m].
        out: (n, 2) unit vectors away from the line.
        offset: of the edge from the line [m].
        rise: outwards, for each metre.
        left: whether the edge is on the left.
    """

    points: FloatArray
    out: FloatArray
    offset: FloatArray
    rise: FloatArray
    left: bool

    def beyond(self, distance: float | FloatArray) -> FloatArray:
        """Return the places at a distance outwards from the edge, or at one each, (n, 3) [m]."""
        away = self.offset + distance
        return np.column_stack([self.points[:, :2] + away[:, None] * self.out, self.points[:, 2] + away * self.rise])

    def take(self, rows: IntArray) -> LaneEdge:
        """Return some of its places."""
        return LaneEdge(self.points[rows], self.out[rows], self.offset[rows], self.rise[rows], self.left)

    def add_ring(self, builder: MeshBuilder, inner: FloatArray, outer: FloatArray, look: tuple[Colour, Label]) -> None:
        """Add the surface between two lines along the edge, its upper side upwards."""
        builder.add(*(strip(outer, inner) if self.left else strip(inner, outer)), *look)


class LaneSample(NamedTuple):
    """Places along a lane.

    Attributes:
        points: (k, 3) on its line [m].
        side: (k, 2) unit vectors to the left.
        border: (k, 2) distances of the left and the right edge [m].
        bank: (k, 2) see `Roads.bank`.
    """

    points: FloatArray
    side: FloatArray
    border: FloatArray
    bank: FloatArray

    def edges(self) -> tuple[LaneEdge, LaneEdge]:
        """Return the left and the right edge."""
        offset, bank = self.border + SHOULDER, self.bank
        return (
            LaneEdge(self.points, self.side, offset[:, 0], bank[:, 0], left=True),
            LaneEdge(self.points, -self.side, offset[:, 1], -bank[:, 1], left=False),
        )


def sample_lane(roads: Roads, lane: int, step: float | None = None, least: int = 1) -> LaneSample:
    """Return places along a lane, about `step` apart in at least so many pieces; None for those that its bends need."""
    rows = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
    line = roads.points[rows]
    if step is None:
        arcs = sample_arcs(line)
    else:
        length = float(roads.length[lane])
        arcs = np.linspace(0.0, length, max(round(length / step), least) + 1)
    figures = take_at(np.column_stack([line, roads.border[rows], roads.bank[rows]]), arcs)
    points = figures[:, :3].copy()
    return LaneSample(points, across(points), figures[:, 3:5], figures[:, 5:])

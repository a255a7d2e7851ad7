"""Asphalt of the lanes."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from rosbridge_sim.scenery.lines import across, sample_arcs, strip, take_at
from rosbridge_sim.scenery.mesh import Colour, Label
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads

ASPHALT: Final[Colour] = (97, 97, 99)
"""Colour of the lanes: V is about 100 of 255, so no mask for white paint takes it."""

SHOULDER: Final = 0.35
"""Asphalt beyond the edges of the lanes [m]: the painted line lies on it, and it closes gaps between lanes."""

OVERLAP: Final = 0.2
"""Lanes are drawn so much longer at both ends [m], so that no gap is seen between one and the next."""


def add_asphalt(builder: MeshBuilder, roads: Roads) -> None:
    """Add the surface of all lanes."""
    for lane in range(len(roads)):
        points, side, border, bank = sample_lane(roads, lane)
        for end, inner in ((0, 1), (-1, -2)):
            outwards = points[end] - points[inner]
            points[end] += OVERLAP / np.hypot(*outwards[:2]) * outwards
        left, right = (beside(points, side, border[:, i] + SHOULDER, bank[:, i], i) for i in (0, 1))
        middle_left, middle_right = strip(left, points), strip(points, right)
        if bank.any():
            builder.add(*middle_left, ASPHALT, Label.ASPHALT)
            builder.add(*middle_right, ASPHALT, Label.ASPHALT)
        else:
            builder.add(*strip(left, right), ASPHALT, Label.ASPHALT)


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


def beside(points: FloatArray, side: FloatArray, offset: FloatArray, bank: FloatArray, i: int) -> FloatArray:
    """Return places to the left (0) or to the right (1) of a line, on the plane of its bank."""
    sign = 1.0 if i == 0 else -1.0
    signed = (sign * offset)[:, None]
    return np.column_stack([points[:, :2] + signed * side, points[:, 2] + signed[:, 0] * bank])

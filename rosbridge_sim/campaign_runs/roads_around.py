"""The lanes around the end of a drive, for its picture."""

from __future__ import annotations

from typing import Final

import numpy as np

from rosbridge_sim.campaigns.trace import Trace
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World

REACH: Final = 150.0
"""Lanes within this distance of the last place are drawn [m]."""

STEP: Final = 4.0
"""Distance of the points of a drawn lane [m]."""

MAX_LANES: Final = 60
"""Most lanes of a picture, the nearest ones."""


def find_roads(world: World, trace: Trace) -> list[list[tuple[float, float]]]:
    """Return the lines of the lanes near the last place of the ego.

    Args:
        world: has the lanes.
        trace: of at least one frame.

    Returns:
        Points (x, y) of each line [m].
    """
    x, y = trace.rows[-1][1:3]
    found: list[tuple[float, list[tuple[float, float]]]] = []
    for line in world.roads.derived(_Lines).lines:
        away = np.hypot(line[:, 0] - x, line[:, 1] - y)
        near = away <= REACH
        if near.any():
            found.append((float(away.min()), [(px, py) for px, py in line[near].round(1).tolist()]))
    return [line for _, line in sorted(found)[:MAX_LANES]]


class _Lines:
    """The lines of all lanes of a map, in steps of some metres.

    Attributes:
        lines: (k, 2) of each lane [m].
    """

    def __init__(self, roads: Roads) -> None:
        num = np.maximum((roads.length / STEP).astype(np.int64), 1) + 1
        lane = np.arange(len(roads)).repeat(num)
        place = np.arange(len(lane)) - (num.cumsum() - num).repeat(num)
        points = roads.at(lane, place / (num - 1).repeat(num) * roads.length[lane])[0]
        self.lines: list[FloatArray] = np.split(points[:, :2], num.cumsum()[:-1]) if len(roads) else []

"""A map with pairs of carriageways that are a narrow gap apart, and paint in these gaps, as MORAI's maps have them."""

from __future__ import annotations

from functools import cache
from typing import Final

from rosbridge_sim.maps.mgeo import NO_PROJECTION
from rosbridge_sim.maps.road_map import Border, Crosswalk, RoadMap
from rosbridge_sim.world.geometry.planar import FloatArray
from tests.world.road_factory import line, make

__all__ = ["APART", "GAPS", "LANE", "narrow_gaps"]

LANE: Final = 3.5
"""Width of a lane of `road_factory` [m]."""

GAPS: Final = (0.6, 1.0, 2.0, 3.0, 4.0, 7.0)
"""Width between the lanes of each pair [m]."""

APART: Final = 40.0
"""From one pair to the next [m]."""

AWAY: Final = 2.69
"""From the line of a lane to the yellow line of the opposite direction [m]; their own one is 1.72 m away."""


def _shape(y: float) -> FloatArray:
    return line((0, y), (30, y), (60, y + 4), (90, y + 4))


@cache
def narrow_gaps() -> RoadMap:
    """Pair `k` begins at (0, k * `APART`) and goes east; the other direction is to its left."""
    lanes, borders, crosswalks = {}, [], []
    for k, gap in enumerate(GAPS):
        y, back = k * APART, k * APART + LANE + gap
        lanes[f"out{k}"] = _shape(y), ""
        lanes[f"back{k}"] = _shape(back)[::-1], ""
        sides = (
            (y + 1.72, "Yellow"),
            (min(y + AWAY, back - 1.72), "Yellow"),
            (y - 1.7, "White"),
            (back + 1.7, "White"),
        )
        borders += [Border(f"{k}", _shape(at), 501, ("Solid",), (colour,)) for at, colour in sides]
        outline = line((14, y - 2.5), (18, y - 2.5), (18, back + 2.5), (14, back + 2.5))
        crosswalks.append(Crosswalk(f"{k}", (outline,)))
    roads = make(**lanes)
    return RoadMap(
        *("gaps", NO_PROJECTION, (0.0, 0.0, 0.0), roads), crosswalks=tuple(crosswalks), borders=tuple(borders)
    )

"""A picture of a world from above, around its ego."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from rosbridge_sim.world.geometry.planar import box_at
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.worlds.drivable_worlds import DrivableWorlds

WIDTH, HEIGHT = 600, 400
PIXELS_PER_METRE: Final = 6.0
_COLOURS: Final = {
    Kind.EGO: (20, 120, 60),
    Kind.VEHICLE: (40, 80, 160),
    Kind.PEDESTRIAN: (180, 60, 40),
    Kind.OBSTACLE: (90, 90, 90),
}

_BAY: Final = (2.5, 1.25)
"""Half the length and half the width of a bay [m]."""


def draw(worlds: DrivableWorlds, number: int, goals: npt.NDArray[np.float64] | None = None) -> npt.NDArray[Any]:
    """Return a picture of one world, north up, with the first ego in the middle, (400, 600, 3) uint8.

    Args:
        goals: (num_egos, 3) bays of the egos, see `observe`; nan where there is none.
    """
    world = worlds.world(number)
    ego = int(world.rows(Kind.EGO)[0])
    middle = np.array([world.x[ego], world.y[ego]])
    half = np.array([WIDTH, -HEIGHT]) / 2.0

    def on_picture(places: npt.NDArray[np.float64]) -> list[tuple[float, float]]:
        pixels = (places - middle) * np.array([PIXELS_PER_METRE, -PIXELS_PER_METRE]) + np.abs(half)
        return [(float(x), float(y)) for x, y in pixels]

    image = Image.new("RGB", (WIDTH, HEIGHT), (235, 238, 230))
    pen = ImageDraw.Draw(image)
    roads, reach = world.roads, np.hypot(WIDTH, HEIGHT) / PIXELS_PER_METRE
    parts = [slice(int(roads.first[lane]), int(roads.first[lane + 1])) for lane in range(len(roads))]
    near = [lane for lane in range(len(roads)) if np.abs(roads.points[parts[lane], :2] - middle).max(1).min() < reach]
    for lane in near:
        line = roads.points[parts[lane], :2]
        pen.line(on_picture(line), fill=(200, 202, 205), width=int(roads.width[lane] * PIXELS_PER_METRE))
    edges = roads.edge_lines()[:2]
    for lane in near:
        for edge in edges:
            pen.line(on_picture(edge[parts[lane], :2]), fill=(225, 227, 230), width=1)
    for pose in () if goals is None else goals[np.isfinite(goals[:, 0])].tolist():
        pen.polygon(on_picture(np.array(box_at(tuple(pose), *_BAY))), outline=_COLOURS[Kind.EGO], width=3)
    for row in world.alive.nonzero()[0].tolist():
        pose = (world.x.item(row), world.y.item(row), world.yaw.item(row))
        corners = box_at(pose, world.half_length.item(row), world.half_width.item(row), world.centre.item(row))
        pen.polygon(on_picture(np.array(corners)), fill=_COLOURS[Kind(int(world.kind[row]))])
    return np.asarray(image)

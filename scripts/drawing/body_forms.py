"""Bodies of entities as triangles with parts, for programs that place and colour them by themselves, as the web page.

They are the shapes that cameras and lidars see, each stretched into a box of length, width and height 1. A viewer
stretches it to the box of an entity. People stand still there.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rosbridge_sim.records import replace
from rosbridge_sim.scenery.moving.moving_mesh import stretch
from rosbridge_sim.scenery.moving.template import Template, Tint
from rosbridge_sim.scenery.scene_frame import SceneFrame, Shape, take_frame
from rosbridge_sim.world.state.world import World

BODY_PARTS: Final = {
    Tint.PAINT: 0,
    Tint.GLASS: 1,
    Tint.DARK: 2,
    Tint.TYRE: 2,
    Tint.HAIR: 2,
    Tint.SKIN: 3,
    Tint.SECOND: 4,
    Tint.RIM: 4,
    Tint.PLATE: 4,
    Tint.HEAD_LAMP: 6,
    Tint.BRAKE_LAMP: 7,
    Tint.LEFT_LAMP: 8,
    Tint.RIGHT_LAMP: 9,
    Tint.REVERSE_LAMP: 10,
}
"""Tint -> part: 0 paint, 1 glass, 2 what is black, 3 skin, 4 what is pale, 5 the roof of a distant vehicle, then lamps:
6 head, 7 brake, 8 left and 9 right signal, 10 reversing."""

ROOF, GLASS, PAINT = 5, 1, 0

SIZES: Final = {
    Shape.CAR: (4.6, 1.85, 1.45, 2.75),
    Shape.VAN: (5.0, 1.95, 2.0, 3.1),
    Shape.TRUCK: (7.0, 2.3, 2.8, 4.0),
    Shape.BUS: (11.0, 2.5, 3.2, 6.0),
    Shape.MOTORCYCLE: (2.1, 0.8, 1.6, 1.4),
    Shape.BICYCLE: (1.75, 0.65, 1.75, 1.05),
    Shape.PERSON: (0.5, 0.55, 1.7, 0.0),
    Shape.BOX: (1.0, 1.0, 1.0, 0.0),
    Shape.CONE: (0.4, 0.4, 0.7, 0.0),
    Shape.BARREL: (0.6, 0.6, 0.9, 0.0),
    Shape.BARRIER: (2.0, 0.5, 0.9, 0.0),
}
"""Usual length, width, height and wheelbase [m]: with them a wheel is round."""

SCALE: Final = 1000
"""Whole numbers for a length, width or height of 1."""


def body_forms() -> dict[str, Any]:
    """Return all forms as values for JSON, in the order of `Shape`, and `far` for vehicles that are far away.

    Each form has `vertices` (x, y, z of each corner in thousandths of length, width and height: x -500 to 500 from rear
    to front, y to the left, z from the ground up), `triangles` (three rows of corners each) and `parts` (one for each
    triangle, see `BODY_PARTS`).
    """
    forms = {}
    for shape in Shape:
        frame = _one(shape)
        local, template = stretch(frame, np.array([0]), shape, is_coarse=False)
        length, width, height, wheelbase = SIZES[shape]
        shares = (local[0] - (0.5 * wheelbase, 0.0, 0.0)) / (length, width, height)
        forms[shape.name.lower()] = _values(Template(shares, template.triangles, template.tints))
    return {**forms, "far": _far()}


def _values(template: Template) -> dict[str, Any]:
    inside = np.clip(template.vertices, (-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))
    corners, rows = np.unique(np.rint(SCALE * inside).astype(np.int64), axis=0, return_inverse=True)
    part_of = np.zeros(len(Tint), dtype=np.int64)
    for tint, part in BODY_PARTS.items():
        part_of[tint] = part
    return {
        "vertices": corners.reshape(-1).tolist(),
        "triangles": rows.reshape(-1)[template.triangles].reshape(-1).tolist(),
        "parts": part_of[template.tints].tolist(),
    }


def _one(shape: Shape) -> SceneFrame:
    """Return a frame with one entity of a shape that stands at the origin."""
    length, width, height, wheelbase = SIZES[shape]
    zero = np.zeros(1)
    return replace(
        take_frame(World()),
        ids=np.zeros(1, dtype=np.int64),
        shapes=np.array([shape], dtype=np.uint8),
        is_ego=np.zeros(1, dtype=bool),
        looks=np.zeros(1, dtype=np.uint64),
        sizes=np.array([[length, width, height]]),
        centres=np.array([0.5 * wheelbase]),
        wheelbases=np.array([wheelbase]),
        poses=np.zeros((1, 6)),
        speeds=zero,
        steers=zero,
        lamps=np.zeros(1, dtype=np.uint8),
        strides=zero,
    )


def _far() -> dict[str, Any]:
    """Return a box with a windscreen: four sides first, so that a viewer from above may leave them out."""
    low = [(-500, -500, 0), (500, -500, 0), (500, 500, 0), (-500, 500, 0)]
    high = [(x, y, 900) for x, y, _ in low]
    screen = [(50, -420, 950), (280, -480, 950), (280, 480, 950), (50, 420, 950)]
    faces = [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)] + [(4, 5, 6, 7), (8, 9, 10, 11)]
    triangles = [corner for a, b, c, d in faces for corner in (a, b, c, a, c, d)]
    parts = [part for part in (PAINT, PAINT, PAINT, PAINT, ROOF, GLASS) for _ in range(2)]
    return {
        "vertices": [part for corner in (*low, *high, *screen) for part in corner],
        "triangles": triangles,
        "parts": parts,
    }

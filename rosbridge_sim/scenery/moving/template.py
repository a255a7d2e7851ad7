"""Templates of entities: triangles of one shape that are stretched, bent and coloured for each entity.

A triangle has no colour of its own but a `Tint`, which a table for each entity turns into a colour.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.records import Record
from rosbridge_sim.scenery.solids import Solid, box, column, fan, join
from rosbridge_sim.world.geometry.planar import FloatArray


class Tint(IntEnum):
    """Part of an entity that has one colour."""

    PAINT = 0  # of vehicles; the shirt of people; the main colour of obstacles
    SECOND = 1  # trousers; bands of obstacles
    DARK = 2  # plastic, shoes, frames
    GLASS = 3
    TYRE = 4
    RIM = 5
    SKIN = 6
    HAIR = 7
    PLATE = 8
    HEAD_LAMP = 9
    BRAKE_LAMP = 10
    LEFT_LAMP = 11
    RIGHT_LAMP = 12
    REVERSE_LAMP = 13


class Template(Record, eq=False):
    """Triangles of one shape.

    Attributes:
        vertices: (n, 3); the unit is told by the user of the template.
        triangles: (m, 3) int32.
        tints: (m,) uint8, see `Tint`.
    """

    vertices: FloatArray
    triangles: NDArray[np.int32]
    tints: NDArray[np.uint8]


Corner = tuple[float, float, float]

Profile = Sequence[tuple[float, float, float, Tint]]
"""Points of a side view, clockwise as seen from the left: along, up, half the width, and the tint of the face up to the
next point."""


def join_templates(*templates: Template) -> Template:
    """Return several templates as one."""
    solids = [(each.vertices, each.triangles) for each in templates]
    return Template(*join(*solids), np.concatenate([each.tints for each in templates]))


class TemplateBuilder:
    """Collects the triangles of a template.

    Args:
        is_coarse: for entities that are far away: small parts are left out or are plain.
    """

    def __init__(self, *, is_coarse: bool = False) -> None:
        self.is_coarse = is_coarse
        self._solids: list[Solid] = []
        self._tints: list[int] = []

    def add(self, solid: Solid, tint: Tint) -> None:
        """Add a solid in one tint."""
        self._solids.append(solid)
        self._tints += [tint] * len(solid[1])

    def box(self, low: Corner, high: Corner, tint: Tint) -> None:
        """Add a box between two corners."""
        self.add(box(low, high), tint)

    def boxes(self, low: Corner, high: Corner, left: Tint, right: Tint) -> None:
        """Add a box on the left side and its mirror image on the right one."""
        self.box(low, high, left)
        self.box((low[0], -high[1], low[2]), (high[0], -low[1], high[2]), right)

    def panes(self, corners: Sequence[Corner], tint: Tint) -> None:
        """Add a flat face of four corners on the left side, clockwise from outside, and its mirror image."""
        face = np.array(corners)
        self.add((face, fan(4)[:, ::-1]), tint)
        self.add((face * (1.0, -1.0, 1.0), fan(4)), tint)

    def lamps(self, low: Corner, high: Corner, left: Tint, right: Tint) -> None:
        """Add a lamp on the left side and its mirror image on the right one: boxes, or plain faces if coarse."""
        if not self.is_coarse:
            self.boxes(low, high, left, right)
            return
        x = high[0] if high[0] > 0.0 else low[0]
        for sign, tint in ((1.0, left), (-1.0, right)):
            y0, y1 = sorted((sign * low[1], sign * high[1]), reverse=x < 0.0)  # it looks away from the body
            corners = np.array([(x, y0, low[2]), (x, y1, low[2]), (x, y1, high[2]), (x, y0, high[2])])
            self.add((corners, fan(4)), tint)

    def column(self, radius: float, low: float, high: float, tint: Tint, *, top: float | None = None) -> None:
        """Add an upright column about the z axis, with eight sides."""
        self.add(column(radius, low, high, 8, top), tint)

    def extrude(self, profile: Profile, sides: Tint) -> None:
        """Add a body with one side view.

        Args:
            profile: its outline, from the lower rear up, forward and down; all of it can be seen from its first point.
        """
        k = len(profile)
        left = np.array([(u, w, h) for u, h, w, _ in profile])
        vertices = np.concatenate([left, left * (1.0, -1.0, 1.0)])
        faces, tints = [], []
        for i, (_, _, _, tint) in enumerate(profile):
            j = (i + 1) % k
            faces += [(i, k + i, k + j), (i, k + j, j)]
            tints += [tint, tint]
        for i in range(1, k - 1):
            faces += [(0, i, i + 1), (k, k + i + 1, k + i)]
            tints += [sides, sides]
        self._solids.append((vertices, np.array(faces, dtype=np.int32)))
        self._tints += tints

    def finish(self) -> Template:
        """Return the template."""
        return Template(*join(*self._solids), np.array(self._tints, dtype=np.uint8))

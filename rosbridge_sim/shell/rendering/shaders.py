"""The programs of the graphics library: scene, classes, shadows and sky. Their texts are in `glsl/`.

Light and haze of the scene are worked out for the corners of the triangles, which are small: pixels have less to do.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache
from typing import Final

from rosbridge_sim.packaged import read_packaged

MAX_BEAMS: Final = 6
"""Vehicles whose head lamps light the road in a picture."""


ASPHALT_FADES, GRASS_FADES = 30.0, 60.0
"""Distances at which the patterns of asphalt and grass have faded away [m]."""


class Coat(StrEnum):
    """Pattern on the triangles of a class. Each has a shader program of its own.

    A processor that draws works out all branches of a program for each pixel, whichever is taken.
    """

    PLAIN = "PLAIN"
    ASPHALT = "ASPHALT"
    GRASS = "GRASS"
    SLABS = "SLABS"
    WALL = "WALL"


@cache
def source_of(name: str) -> str:
    """Return the text of a program, such as `sky.vert`; that of `scene.frag` lacks its first lines."""
    return read_packaged(f"shell/rendering/glsl/{name}")


def scene_fragment(coat: Coat, *, is_dark: bool, is_wet: bool) -> str:
    """Return the program for the pixels of a class.

    Args:
        is_dark: head lamps light it.
    """
    words = [coat.value, *(["DARK"] if is_dark else []), *(["WET"] if is_wet else [])]
    fades = {Coat.ASPHALT: ASPHALT_FADES, Coat.GRASS: GRASS_FADES}.get(coat, 1.0)
    head = "".join(f"#define {word}\n" for word in [*words, f"FADES2 {fades * fades:.1f}"])
    return f"#version 330\n{head}const int MAX_BEAMS = {MAX_BEAMS};\n{source_of('scene.frag')}"

"""Two-wheelers with their riders, and obstacles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import cycle, pairwise
from typing import Final

import numpy as np

from rosbridge_sim.scenery.moving.people_shapes import pose_figure
from rosbridge_sim.scenery.moving.template import Template, TemplateBuilder, Tint
from rosbridge_sim.scenery.scene_frame import Shape
from rosbridge_sim.scenery.solids import box, fan, sides
from rosbridge_sim.world.geometry.planar import FloatArray

RIDER_HEIGHT: Final = 1.72
"""[m]"""

AXLES: Final = {Shape.BICYCLE: 1.05, Shape.MOTORCYCLE: 1.40}
"""Wheelbase of the template [m]; entities stretch it."""


@cache
def two_wheeler_template(shape: Shape) -> Template:
    """Return a two-wheeler with its rider in metres: the rear axle is above the origin.

    Args:
        shape: BICYCLE or MOTORCYCLE.
    """
    builder = TemplateBuilder()
    is_bicycle = shape == Shape.BICYCLE
    base, radius = AXLES[shape], 0.34 if is_bicycle else 0.31
    for x in (0.0, base):
        _wheel(builder, x, radius, 0.035 if is_bicycle else 0.12, is_spoked=is_bicycle)
    if is_bicycle:
        crank, saddle, head = (0.42, 0.30), (0.26, 0.93), (base - 0.16, 0.86)
        for a, b in (
            (crank, (0.28, 0.84)),
            (crank, head),
            ((0.28, 0.80), head),
            (crank, (0.0, radius)),
            ((0.0, radius), (0.28, 0.80)),
            (head, (base, radius)),
            (head, (base - 0.19, 1.0)),
        ):
            _tube(builder, a, b, 0.02)
        builder.box((saddle[0] - 0.12, -0.07, 0.86), (saddle[0] + 0.12, 0.07, 0.92), Tint.DARK)
        builder.box((base - 0.22, -0.27, 0.98), (base - 0.17, 0.27, 1.02), Tint.DARK)
        _rider(builder, (0.24, 0.92 - 0.50 * RIDER_HEIGHT), lean=0.55, thigh=(1.25, 0.62), shin=(-1.35, -0.55))
    else:
        builder.extrude(
            [
                (-0.25, 0.55, 0.12, Tint.PAINT),
                (-0.35, 0.86, 0.10, Tint.DARK),
                (0.55, 0.82, 0.15, Tint.PAINT),
                (1.0, 1.0, 0.16, Tint.PAINT),
                (1.12, 0.72, 0.14, Tint.PAINT),
                (0.9, 0.34, 0.16, Tint.DARK),
                (0.25, 0.28, 0.16, Tint.DARK),
            ],
            Tint.PAINT,
        )
        _tube(builder, (base, radius), (base - 0.3, 0.98), 0.05)
        builder.box((base - 0.42, -0.34, 1.0), (base - 0.37, 0.34, 1.04), Tint.DARK)
        _rider(builder, (0.22, 0.84 - 0.50 * RIDER_HEIGHT), lean=0.35, thigh=(1.2, 1.2), shin=(-1.5, -1.5))
    builder.box((base - 0.16, -0.05, 0.78), (base - 0.10, 0.05, 0.88), Tint.HEAD_LAMP)
    builder.box(
        (-0.34 if not is_bicycle else -0.06, -0.05, 0.70),
        (-0.30 if not is_bicycle else -0.02, 0.05, 0.78),
        Tint.BRAKE_LAMP,
    )
    return builder.finish()


def _wheel(builder: TemplateBuilder, x: float, radius: float, width: float, *, is_spoked: bool) -> None:
    """Add an upright wheel: a ring, and a disc inside unless it has spokes."""
    num = 14
    angle = 2.0 * math.pi * np.arange(num) / num
    circle = np.column_stack([np.cos(angle), np.zeros(num), np.sin(angle)])
    half = 0.5 * width
    outline = ((radius, -half), (radius, half), (0.86 * radius, half), (0.86 * radius, -half))
    rings = [circle * r + (x, y, radius) for r, y in outline]
    builder.add((np.concatenate(rings), sides(num, 5)[:, ::-1] % (4 * num)), Tint.TYRE)
    if is_spoked:
        for k in range(0, num, 2):
            rim = x + 0.9 * radius * math.cos(angle[k]), radius + 0.9 * radius * math.sin(angle[k])
            _tube(builder, (x, radius), rim, 0.004)
    else:
        builder.add((circle * 0.7 * radius + (x, 0.3 * width, radius), fan(num)[:, ::-1]), Tint.RIM)
        builder.add((circle * 0.7 * radius + (x, -0.3 * width, radius), fan(num)), Tint.RIM)


def _tube(builder: TemplateBuilder, a: tuple[float, float], b: tuple[float, float], half: float) -> None:
    """Add a square tube in the middle plane between two places (x, z)."""
    (ax, az), (bx, bz) = a, b
    length = math.hypot(bx - ax, bz - az)
    cos, sin = (bx - ax) / length, (bz - az) / length
    vertices, triangles = box((0.0, -half, -half), (length, half, half))
    turned = np.column_stack(
        [
            ax + vertices[:, 0] * cos - vertices[:, 2] * sin,
            vertices[:, 1],
            az + vertices[:, 0] * sin + vertices[:, 2] * cos,
        ]
    )
    builder.add((turned, triangles), Tint.RIM)


def _rider(
    builder: TemplateBuilder,
    seat: tuple[float, float],
    *,
    lean: float,
    thigh: tuple[float, float],
    shin: tuple[float, float],
) -> None:
    """Add a rider whose hips are 0.5 of its height above `seat` (x, z); `lean` is the angle of the trunk."""
    (left, right), (left_shin, right_shin) = thigh, shin
    angles = np.array([[left, left_shin, 0.95, 0.25, right, right_shin, 0.95, 0.25]])
    (vertices,), template = pose_figure(angles)
    placed = _lean(vertices, lean) * RIDER_HEIGHT + (seat[0], 0.0, seat[1])
    for tint in np.unique(template.tints):
        builder.add((placed, template.triangles[template.tints == tint]), Tint(int(tint)))


HIPS: Final = 0.5
"""Height about which a rider leans forward, as a share of its height; the legs stay."""


def _lean(vertices: FloatArray, angle: float) -> FloatArray:
    """Return vertices of which those above the hips are turned forward."""
    above = (vertices[:, 2] > HIPS + 0.02)[:, None]
    z = vertices[:, 2] - HIPS
    cos, sin = math.cos(angle), math.sin(angle)
    turned = np.column_stack([vertices[:, 0] * cos + z * sin, vertices[:, 1], HIPS - vertices[:, 0] * sin + z * cos])
    return np.where(above, turned, vertices)


@cache
def obstacle_template(shape: Shape) -> Template:
    """Return an obstacle: x and y -0.5..0.5, z 0..1.

    Args:
        shape: BOX, CONE, BARREL or BARRIER.
    """
    builder = TemplateBuilder()
    if shape == Shape.CONE:
        builder.box((-0.5, -0.5, 0.0), (0.5, 0.5, 0.05), Tint.DARK)
        for (low, high), tint in _banded((0.05, 0.38, 0.62, 0.78, 0.88, 1.0)):
            builder.column(_cone(low), low, high, tint, top=_cone(high))
    elif shape == Shape.BARREL:
        for (low, high), tint in _banded((0.0, 0.30, 0.34, 0.64, 0.68, 1.0)):
            builder.column(0.48 if tint == Tint.PAINT else 0.5, low, high, tint)
    elif shape == Shape.BARRIER:
        builder.extrude(
            [
                (-0.5, 0.0, 0.5, Tint.PAINT),
                (-0.5, 0.2, 0.5, Tint.PAINT),
                (0.5, 0.2, 0.5, Tint.PAINT),
                (0.5, 0.0, 0.5, Tint.PAINT),
            ],
            Tint.PAINT,
        )
        vertices, triangles = box((-0.5, -0.42, 0.2), (0.5, 0.42, 1.0))
        slim = vertices * np.where(vertices[:, 2:] > 0.5, (1.0, 0.45, 1.0), (1.0, 1.0, 1.0))  # noqa: PLR2004 - the top
        builder.add((slim, triangles), Tint.PAINT)
        builder.box((-0.5, -0.2, 0.7), (0.5, 0.2, 0.82), Tint.SECOND)
    else:
        builder.box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0), Tint.PAINT)
        for low, high in ((0.02, 0.10), (0.90, 0.98)):
            builder.box((-0.505, -0.505, low), (0.505, 0.505, high), Tint.SECOND)
    return builder.finish()


def _banded(heights: Sequence[float]) -> Iterator[tuple[tuple[float, float], Tint]]:
    """Yield the bands between heights, by turns in the main colour and in that of bands."""
    return zip(pairwise(heights), cycle((Tint.PAINT, Tint.SECOND)), strict=False)


def _cone(height: float) -> float:
    """Return the radius of a cone of height 1 at a height."""
    return 0.36 - 0.30 * height

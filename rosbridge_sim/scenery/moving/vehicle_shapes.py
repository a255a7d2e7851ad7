"""Bodies of vehicles with four wheels, as shares of length, width and height, and their wheels."""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np

from rosbridge_sim.scenery.moving.template import Template, TemplateBuilder, Tint
from rosbridge_sim.scenery.scene_frame import Shape
from rosbridge_sim.scenery.solids import fan, sides

WHEELS: Final = {
    Shape.CAR: (0.225, 0.12),
    Shape.VAN: (0.18, 0.12),
    Shape.TRUCK: (0.18, 0.13),
    Shape.BUS: (0.15, 0.12),
}
"""Radius of the wheels as a share of the height, and their thickness as one of the width."""

TRACK: Final = 0.84
"""Distance of the wheels of an axle, middle to middle, as a share of the width."""


@cache
def vehicle_template(shape: Shape, *, is_coarse: bool = False) -> Template:
    """Return the body of a vehicle: x -0.5..0.5 from rear to front, y -0.5..0.5 to the left, z 0..1.

    Args:
        shape: CAR, VAN, TRUCK or BUS.
        is_coarse: for one that is far away.
    """
    builder = TemplateBuilder(is_coarse=is_coarse)
    _MAKERS[shape](builder)
    whole = builder.finish()
    # Lamps and plates stand out by a little, mirrors by more: all of it is to be within the box of the entity.
    half = np.abs(whole.vertices[:, 0]).max()
    inside = np.clip(whole.vertices * (0.5 / half, 1.0, 1.0), (-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))
    return Template(inside, whole.triangles, whole.tints)


@cache
def wheel_template(*, is_coarse: bool = False) -> Template:
    """Return a left wheel about the y axis: radius 1, y -0.5..0.5. It has no inner side, which nobody sees.

    Args:
        is_coarse: for one that is far away.
    """
    num = 6 if is_coarse else 10
    angle = 2.0 * math.pi * np.arange(num) / num
    ring = np.column_stack([np.cos(angle), np.zeros(num), np.sin(angle)])
    builder = TemplateBuilder()
    builder.add((np.concatenate([ring - _HALF, ring + _HALF]), sides(num)[:, ::-1]), Tint.TYRE)
    for radius, out, tint in ((1.0, 0.5, Tint.TYRE), (0.62, 0.53, Tint.RIM))[: 1 if is_coarse else 2]:
        builder.add((ring * radius + (0, out, 0), fan(num)[:, ::-1]), tint)
    return builder.finish()


_HALF: Final = np.array([0.0, 0.5, 0.0])

_P, _G, _D = Tint.PAINT, Tint.GLASS, Tint.DARK


def _car(b: TemplateBuilder) -> None:
    b.extrude(
        [
            (-0.495, 0.20, 0.46, _P),
            (-0.5, 0.42, 0.475, _P),
            (-0.485, 0.60, 0.465, _P),
            (-0.40, 0.645, 0.455, _P),
            (0.20, 0.635, 0.455, _P),
            (0.40, 0.56, 0.445, _P),
            (0.485, 0.46, 0.43, _P),
            (0.5, 0.34, 0.43, _P),
            (0.49, 0.20, 0.44, _P),
            (0.47, 0.14, 0.43, _D),
            (-0.47, 0.14, 0.44, _D),
        ],
        _P,
    )
    # The sides are fuller than the ends.
    b.extrude(
        [
            (-0.36, 0.13, 0.49, _P),
            (-0.42, 0.42, 0.5, _P),
            (-0.34, 0.62, 0.475, _P),
            (0.24, 0.61, 0.475, _P),
            (0.34, 0.42, 0.5, _P),
            (0.32, 0.13, 0.49, _D),
        ],
        _P,
    )
    b.extrude(
        [(-0.43, 0.61, 0.43, _G), (-0.29, 0.955, 0.345, _P), (0.045, 0.96, 0.345, _G), (0.245, 0.61, 0.43, _G)], _G
    )
    b.extrude([(-0.31, 0.945, 0.36, _P), (-0.255, 0.995, 0.32, _P), (-0.02, 1.0, 0.32, _P), (0.06, 0.95, 0.36, _P)], _P)
    if not b.is_coarse:
        _car_details(b)
    b.lamps((0.45, 0.27, 0.43), (0.497, 0.43, 0.50), Tint.HEAD_LAMP, Tint.HEAD_LAMP)
    b.lamps((0.44, 0.40, 0.40), (0.49, 0.452, 0.43), Tint.LEFT_LAMP, Tint.RIGHT_LAMP)
    b.lamps((-0.503, 0.26, 0.50), (-0.46, 0.468, 0.585), Tint.BRAKE_LAMP, Tint.BRAKE_LAMP)
    b.lamps((-0.503, 0.36, 0.44), (-0.46, 0.472, 0.49), Tint.LEFT_LAMP, Tint.RIGHT_LAMP)
    b.lamps((-0.503, 0.26, 0.44), (-0.46, 0.35, 0.49), Tint.REVERSE_LAMP, Tint.REVERSE_LAMP)


def _car_details(b: TemplateBuilder) -> None:
    """Add pillars, mirrors, grille, plates and the third brake lamp."""
    for x, lean in ((-0.36, 0.03), (-0.085, 0.0), (0.15, -0.06)):  # pillars
        low, high = x - 0.014, x + 0.014
        b.panes([(low, 0.44, 0.61), (high, 0.44, 0.61), (high + lean, 0.356, 0.95), (low + lean, 0.356, 0.95)], _P)
    b.boxes((0.135, 0.46, 0.6), (0.175, 0.52, 0.66), _P, _P)  # mirrors
    b.box((0.487, -0.24, 0.2), (0.502, 0.24, 0.36), _D)  # grille
    b.box((-0.41, -0.12, 0.86), (-0.385, 0.12, 0.885), Tint.BRAKE_LAMP)
    b.box((-0.506, -0.15, 0.30), (-0.49, 0.15, 0.39), Tint.PLATE)
    b.box((0.49, -0.15, 0.22), (0.507, 0.15, 0.30), Tint.PLATE)
    b.box((-0.504, -0.44, 0.15), (-0.47, 0.44, 0.25), _D)


def _lamps(b: TemplateBuilder, low: float, *, rear: float = -0.5) -> None:
    """Add lamps and plates to a body with upright ends."""
    b.lamps((0.47, 0.30, low + 0.06), (0.504, 0.46, low + 0.16), Tint.HEAD_LAMP, Tint.HEAD_LAMP)
    b.lamps((0.47, 0.40, low), (0.504, 0.47, low + 0.05), Tint.LEFT_LAMP, Tint.RIGHT_LAMP)
    b.lamps((rear - 0.003, 0.40, low + 0.10), (rear + 0.02, 0.485, low + 0.24), Tint.BRAKE_LAMP, Tint.BRAKE_LAMP)
    b.lamps((rear - 0.003, 0.40, low + 0.04), (rear + 0.02, 0.485, low + 0.09), Tint.LEFT_LAMP, Tint.RIGHT_LAMP)
    b.lamps((rear - 0.003, 0.40, low), (rear + 0.02, 0.485, low + 0.035), Tint.REVERSE_LAMP, Tint.REVERSE_LAMP)
    if b.is_coarse:
        return
    b.box((rear - 0.004, -0.14, low), (rear + 0.01, 0.14, low + 0.07), Tint.PLATE)
    b.box((0.49, -0.14, low - 0.06), (0.505, 0.14, low), Tint.PLATE)


def _van(b: TemplateBuilder) -> None:
    b.extrude(
        [
            (-0.5, 0.14, 0.49, _P),
            (-0.495, 0.62, 0.49, _G),
            (-0.47, 0.93, 0.44, _P),
            (-0.44, 1.0, 0.42, _P),
            (0.20, 1.0, 0.42, _P),
            (0.26, 0.95, 0.43, _G),
            (0.39, 0.56, 0.47, _P),
            (0.485, 0.46, 0.46, _P),
            (0.5, 0.14, 0.46, _D),
        ],
        _P,
    )
    for a, c in ((-0.45, -0.20), (-0.18, 0.06), (0.08, 0.30)):
        b.panes([(a, 0.504, 0.60), (c, 0.495, 0.60), (min(c, 0.24), 0.457, 0.90), (a, 0.457, 0.90)], _G)
    b.boxes((0.26, 0.48, 0.56), (0.30, 0.56, 0.66), _D, _D)
    b.box((0.49, -0.30, 0.20), (0.503, 0.30, 0.34), _D)
    _lamps(b, 0.28)


def _truck(b: TemplateBuilder) -> None:
    b.extrude(
        [
            (0.12, 0.2, 0.46, _P),
            (0.12, 0.97, 0.44, _P),
            (0.18, 1.0, 0.43, _P),
            (0.36, 1.0, 0.43, _P),
            (0.40, 0.95, 0.44, _G),
            (0.485, 0.55, 0.46, _P),
            (0.5, 0.2, 0.46, _D),
        ],
        _P,
    )
    b.panes([(0.17, 0.474, 0.58), (0.45, 0.468, 0.58), (0.385, 0.453, 0.92), (0.17, 0.453, 0.92)], _G)
    b.box((-0.48, -0.30, 0.20), (0.14, 0.30, 0.34), _D)
    b.box((-0.5, -0.49, 0.34), (0.10, 0.49, 0.40), Tint.RIM)
    b.boxes((-0.5, 0.46, 0.40), (0.10, 0.49, 0.60), _P, _P)
    b.box((-0.5, -0.49, 0.40), (-0.485, 0.49, 0.60), _P)
    b.box((0.085, -0.49, 0.40), (0.10, 0.49, 0.72), _P)
    b.boxes((0.38, 0.47, 0.58), (0.41, 0.56, 0.74), _D, _D)
    b.box((0.49, -0.30, 0.24), (0.503, 0.30, 0.36), _D)
    _lamps(b, 0.24)


def _bus(b: TemplateBuilder) -> None:
    b.extrude(
        [
            (-0.5, 0.1, 0.49, _P),
            (-0.5, 0.96, 0.48, _P),
            (-0.48, 1.0, 0.46, _P),
            (0.47, 1.0, 0.46, _P),
            (0.488, 0.96, 0.48, _G),
            (0.5, 0.42, 0.49, _P),
            (0.5, 0.1, 0.49, _D),
        ],
        _P,
    )
    for k in range(7):
        a = -0.47 + 0.132 * k
        b.boxes((a, 0.489, 0.46), (a + 0.122, 0.497, 0.86), _G, _G)
    b.boxes((-0.49, 0.489, 0.36), (0.49, 0.498, 0.40), Tint.RIM, Tint.RIM)
    b.box((-0.504, -0.40, 0.56), (-0.498, 0.40, 0.88), _G)
    for x in (-0.06, 0.36):  # doors, on the right
        b.box((x, -0.5, 0.12), (x + 0.1, -0.488, 0.86), _G)
    b.boxes((0.47, 0.49, 0.62), (0.50, 0.56, 0.80), _D, _D)
    b.box((0.496, -0.34, 0.87), (0.502, 0.34, 0.95), _D)
    _lamps(b, 0.14)


_MAKERS: Final = {Shape.CAR: _car, Shape.VAN: _van, Shape.TRUCK: _truck, Shape.BUS: _bus}

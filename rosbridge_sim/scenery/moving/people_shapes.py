"""People and riders: limbs as tapered columns that turn about hips, knees, shoulders and elbows.

A figure has height 1. Each limb hangs down from its joint, so a turn about the y axis swings it: forward for a positive
angle.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.scenery.moving.template import Template, TemplateBuilder, Tint, join_templates
from rosbridge_sim.scenery.solids import Solid, column, fan, prism, sides
from rosbridge_sim.world.geometry.planar import FloatArray

HIP, KNEE, SHOULDER, ELBOW = 0.50, 0.275, 0.815, 0.63
"""Heights of joints as shares of the height of a person, as in anthropometric tables (Drillis and Contini, 1966)."""

HIP_SIDE, SHOULDER_SIDE = 0.055, 0.125
"""Distance of the joints from the middle plane."""

STRIDE: Final = 0.82
"""Length of two steps as a share of the height of a person: 1.4 m for 1.7 m."""

SWING: Final = 0.50
"""Angle of a thigh at the ends of a step [rad], at an ordinary pace."""


class Limb(Record, eq=False):
    """A part of a limb: hangs down from a joint.

    Attributes:
        template: vertices about the joint.
        joint: (x, y, z) of the joint while the figure stands straight.
        parent: of which it hangs: -1 for the trunk, else the row of a limb.
    """

    template: Template
    joint: tuple[float, float, float]
    parent: int


def _segment(length: float, top: float, bottom: float, tint: Tint, deep: float = 1.0) -> TemplateBuilder:
    """Return a tapered column that hangs down from the origin; `deep` stretches it along x."""
    builder = TemplateBuilder()
    vertices, triangles = column(bottom, -length, 0.0, 5, top)
    builder.add((vertices * (deep, 1.0, 1.0), triangles), tint)
    return builder


@cache
def figure_limbs() -> tuple[Limb, ...]:
    """Return the limbs: thigh, shin with shoe, upper arm, and forearm with hand; left ones, then right ones."""
    limbs: list[Limb] = []
    for side in (1.0, -1.0):
        first = len(limbs)
        thigh = _segment(HIP - KNEE, 0.058, 0.042, Tint.SECOND, 1.1)
        limbs.append(Limb(thigh.finish(), (0.0, side * HIP_SIDE, HIP), -1))
        shin = _segment(KNEE - 0.035, 0.042, 0.028, Tint.SECOND, 1.1)
        shin.box((-0.035, -0.028, -KNEE), (0.095, 0.028, -KNEE + 0.04), Tint.DARK)
        limbs.append(Limb(shin.finish(), (0.0, side * HIP_SIDE, KNEE), first))
        arm = _segment(SHOULDER - ELBOW, 0.036, 0.028, Tint.PAINT)
        limbs.append(Limb(arm.finish(), (0.0, side * SHOULDER_SIDE, SHOULDER), -1))
        forearm = _segment(ELBOW - 0.49, 0.028, 0.019, Tint.PAINT)
        forearm.add(column(0.022, -0.20, -0.14, 5), Tint.SKIN)
        limbs.append(Limb(forearm.finish(), (0.0, side * SHOULDER_SIDE, ELBOW), first + 2))
    return tuple(limbs)


@cache
def trunk_template() -> Template:
    """Return hips, chest, neck and head of a figure of height 1, its feet at the origin."""
    builder = TemplateBuilder()
    builder.add(_loft([(0.46, 0.060, 0.095), (0.52, 0.068, 0.100), (0.585, 0.060, 0.088)]), Tint.SECOND)
    builder.add(
        _loft(
            [
                (0.575, 0.060, 0.090),
                (0.70, 0.068, 0.105),
                (0.79, 0.066, 0.135),
                (0.83, 0.048, 0.118),
                (0.855, 0.03, 0.05),
            ]
        ),
        Tint.PAINT,
    )
    builder.add(column(0.030, 0.835, 0.885, 6), Tint.SKIN)
    head = [
        (0.865, 0.034, 0.028),
        (0.885, 0.055, 0.043),
        (0.935, 0.062, 0.050),
        (0.975, 0.052, 0.044),
        (0.995, 0.02, 0.02),
    ]
    builder.add(_loft(head), Tint.SKIN)
    hair = [(0.925, 0.060, 0.054), (0.945, 0.066, 0.055), (0.98, 0.056, 0.048), (1.0, 0.022, 0.022)]
    vertices, triangles = _loft(hair)
    builder.add((vertices - (0.009, 0.0, 0.0), triangles), Tint.HAIR)
    back = prism(np.array([(-0.068, -0.045), (-0.03, -0.051), (-0.03, 0.051), (-0.068, 0.045)]), 0.885, 0.94)
    builder.add(back, Tint.HAIR)
    return builder.finish()


def _loft(rings: list[tuple[float, float, float]], num: int = 7) -> Solid:
    """Return a solid through ellipses: height, half depth and half width of each."""
    angle = 2.0 * np.pi * (np.arange(num) + 0.5) / num
    vertices = np.concatenate(
        [np.column_stack([deep * np.cos(angle), wide * np.sin(angle), np.full(num, z)]) for z, deep, wide in rings]
    )
    top, floor = num * (len(rings) - 1) + fan(num), fan(num)[:, ::-1]
    return vertices, np.concatenate([sides(num, len(rings)), top, floor])


def walking_angles(strides: FloatArray, heights: FloatArray, speeds: FloatArray) -> FloatArray:
    """Return the angles of the limbs of people, (n, 8) in the order of `figure_limbs` [rad].

    Args:
        strides: (n,) distance walked [m].
        heights: (n,) of the people [m].
        speeds: (n,) those who stand have straight legs [m/s].
    """
    phase = 2.0 * np.pi * strides / (STRIDE * heights)
    swing = SWING * np.clip(np.abs(speeds) / 1.2, 0.0, 1.15)
    angles = np.zeros((len(strides), 8))
    for first, turn in ((0, phase), (4, phase + np.pi)):
        angles[:, first] = swing * np.sin(turn)
        # The knee bends while the leg swings forward.
        angles[:, first + 1] = -swing * (0.25 + 1.5 * np.maximum(np.cos(turn), 0.0) ** 2)
        angles[:, first + 2] = -0.75 * swing * np.sin(turn)
        angles[:, first + 3] = 0.12 + 0.6 * swing
    return angles


def pose_figure(angles: FloatArray) -> tuple[FloatArray, Template]:
    """Return figures of height 1 with bent limbs.

    Args:
        angles: (n, 8) in the order of `figure_limbs` [rad].

    Returns:
        (n, v, 3) vertices, and triangles and tints of all of them.
    """
    trunk, limbs = trunk_template(), figure_limbs()
    num = len(angles)
    parts = [np.broadcast_to(trunk.vertices, (num, *trunk.vertices.shape))]
    ends: list[tuple[FloatArray, FloatArray]] = []  # joint (n, 3) and whole angle (n,) of each limb
    for k, limb in enumerate(limbs):
        joint = np.broadcast_to(np.array(limb.joint), (num, 3))
        angle = angles[:, k]
        if limb.parent >= 0:
            above, turn = ends[limb.parent]
            joint = above + _swing(np.array(limb.joint) - np.array(limbs[limb.parent].joint), turn)[:, 0]
            angle = angle + turn
        ends.append((joint, angle))
        parts.append(joint[:, None] + _swing(limb.template.vertices, angle))
    return np.concatenate(parts, axis=1), join_templates(trunk, *(limb.template for limb in limbs))


def _swing(vertices: FloatArray, angle: FloatArray) -> FloatArray:
    """Return vertices (v, 3) turned about the y axis by angles (n,): what hangs down goes forward, (n, v, 3)."""
    vertices = np.atleast_2d(vertices)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y, z = vertices.T
    return np.stack([x * cos - z * sin, np.broadcast_to(y, (len(angle), len(y))), x * sin + z * cos], axis=2)

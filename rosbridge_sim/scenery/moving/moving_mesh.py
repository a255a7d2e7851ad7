"""All that moves in a scene as one mesh: vehicles, two-wheelers, people, obstacles, and the lamps of traffic lights.

The entities of one shape are made at once: a template is stretched, bent and turned for all of them by a few calls.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.camera_geometry import rotation
from rosbridge_sim.scenery.mesh import Label, Mesh, join_meshes
from rosbridge_sim.scenery.moving.looks import lit_table, tint_table
from rosbridge_sim.scenery.moving.other_shapes import AXLES, obstacle_template, two_wheeler_template
from rosbridge_sim.scenery.moving.people_shapes import pose_figure, walking_angles
from rosbridge_sim.scenery.moving.template import Template, join_templates
from rosbridge_sim.scenery.moving.vehicle_shapes import TRACK, WHEELS, vehicle_template, wheel_template
from rosbridge_sim.scenery.scene_frame import SceneFrame, Shape
from rosbridge_sim.scenery.static.traffic_lights import SignalLamps
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray

_LABELS: Final = {
    Shape.MOTORCYCLE: Label.MOTORCYCLE,
    Shape.BICYCLE: Label.BICYCLE,
    Shape.PERSON: Label.PEDESTRIAN,
    Shape.BOX: Label.OBSTACLE,
    Shape.CONE: Label.OBSTACLE,
    Shape.BARREL: Label.OBSTACLE,
    Shape.BARRIER: Label.OBSTACLE,
}

PERSON_WIDTH: Final = 0.55
"""Width of a person of 1.7 m with its arms [m]; bodies of other widths are as much wider or slimmer."""

USUAL_HEIGHT: Final = 1.70


NEAR: Final = 45.0
"""Vehicles farther than this from the eye have fewer triangles [m]: details of 5 cm are then less than a pixel."""


class MovingScene:
    """Makes the meshes of frames; keeps the lenses of the traffic lights from one to the next."""

    def __init__(self) -> None:
        self._lamps: SignalLamps | None = None
        self._known: tuple[object, bytes] | None = None

    def mesh(
        self,
        frame: SceneFrame,
        origin: FloatArray,
        eye: FloatArray | None = None,
        reach: float = math.inf,
        *,
        near: float = NEAR,
        has_lenses: bool = True,
        which: NDArray[np.bool_] | None = None,
    ) -> Mesh:
        """Return what moves at a frame; the triangles of an entity lie together.

        Args:
            origin: (3,) of the mesh: that of the static one [m].
            eye: (3,) from where it is seen, map frame [m]; None for all details.
            reach: what is farther from the eye is left out [m].
            near: vehicles farther from the eye have fewer triangles [m].
            which: (n,) entities that are wanted; None for all.
        """
        away = np.zeros(len(frame)) if eye is None else np.hypot(*(frame.poses[:, :2] - eye[:2]).T)
        is_near = away <= near
        is_wanted = away <= reach if which is None else which & (away <= reach)
        parts = [self._lenses(frame, origin)] if has_lenses else []
        for shape in Shape:
            is_there = is_wanted & (frame.shapes == shape)
            if shape > Shape.BUS:
                sets = [(is_there, False)]
            else:
                sets = [(is_there & is_near, False), (is_there & ~is_near, True)]
            for chosen, is_coarse in sets:
                rows = np.flatnonzero(chosen)
                if len(rows):
                    local, template = stretch(frame, rows, shape, is_coarse=is_coarse)
                    parts.append(_place(frame, rows, shape, origin, local=local, template=template))
        return join_meshes(parts or [Mesh.empty(origin)])

    def _lenses(self, frame: SceneFrame, origin: FloatArray) -> Mesh:
        key = (frame.plan, origin.tobytes())
        if self._lamps is None or self._known is None or self._known[0] is not key[0] or self._known[1] != key[1]:
            self._lamps, self._known = SignalLamps(frame.plan, origin), key
        return self._lamps.show(frame.signals)


def stretch(frame: SceneFrame, rows: IntArray, shape: Shape, *, is_coarse: bool) -> tuple[FloatArray, Template]:
    """Return the vertices of entities of one shape in their own axes, (k, n, 3) [m], and their triangles."""
    sizes = frame.sizes[rows]
    if shape <= Shape.BUS:
        body = vehicle_template(shape, is_coarse=is_coarse)
        local = body.vertices * sizes[:, None, :]
        local[:, :, 0] += frame.centres[rows, None]
        wheel = wheel_template(is_coarse=is_coarse)
        wheels = _wheels(frame, rows, shape, wheel.vertices)
        return np.concatenate([local, *wheels], axis=1), join_templates(body, *[wheel] * len(wheels))
    if shape in {Shape.MOTORCYCLE, Shape.BICYCLE}:
        template = two_wheeler_template(shape)
        stretch = np.column_stack([frame.wheelbases[rows] / AXLES[shape], np.ones((len(rows), 2))])
        return template.vertices * stretch[:, None, :], template
    if shape == Shape.PERSON:
        heights = sizes[:, 2]
        figure, template = pose_figure(walking_angles(frame.strides[rows], heights, frame.speeds[rows]))
        wide = (sizes[:, 1] / heights) / (PERSON_WIDTH / USUAL_HEIGHT)
        return figure * np.column_stack([heights, heights * wide, heights])[:, None, :], template
    template = obstacle_template(shape)
    local = template.vertices * sizes[:, None, :]
    local[:, :, 0] += frame.centres[rows, None]
    return local, template


def _place(
    frame: SceneFrame, rows: IntArray, shape: Shape, origin: FloatArray, *, local: FloatArray, template: Template
) -> Mesh:
    """Return entities at their places, from vertices (k, n, 3) in their own axes."""
    turn = np.moveaxis(rotation(*frame.poses[rows, 3:].T), 2, 0)
    placed = local @ turn.transpose(0, 2, 1) + (frame.poses[rows, None, :3] - origin)
    k, n = placed.shape[:2]
    m = len(template.triangles)
    first = (n * np.arange(k, dtype=np.int32))[:, None, None]
    return Mesh(
        origin,
        placed.reshape(-1, 3).astype(np.float32),
        (template.triangles + first).reshape(-1, 3),
        tint_table(frame, rows, shape)[:, template.tints].reshape(-1, 3),
        np.full(k * m, _LABELS.get(shape, Label.VEHICLE), dtype=np.uint8),
        np.repeat((frame.ids[rows] + 1).astype(np.int32), m),
        lit_table(frame, rows)[:, template.tints].reshape(-1),
    )


_AXLE_SIDES: Final = np.array([(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)])
"""Axle (0 rear, 1 front) and side of each wheel."""


def _wheels(frame: SceneFrame, rows: IntArray, shape: Shape, wheel: FloatArray) -> list[FloatArray]:
    """Return the vertices of the four wheels of vehicles, (k, n, 3) each."""
    radius_share, thick_share = WHEELS[shape]
    sizes = frame.sizes[rows]
    radius, thick = radius_share * sizes[:, 2], thick_share * sizes[:, 1]
    round_wheel = wheel * np.stack([radius, thick, radius], axis=1)[:, None, :]
    parts = []
    for axle, side in _AXLE_SIDES.tolist():
        turned = round_wheel * (1.0, side, 1.0)
        if axle:
            cos, sin = np.cos(frame.steers[rows])[:, None], np.sin(frame.steers[rows])[:, None]
            x, y, z = np.moveaxis(turned, 2, 0)
            turned = np.stack([x * cos - y * sin, x * sin + y * cos, z], axis=2)
        aside = side * (0.5 * TRACK * sizes[:, 1])
        at = np.column_stack([axle * frame.wheelbases[rows], aside, radius])
        parts.append(turned + at[:, None, :])
    return parts

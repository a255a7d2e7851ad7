"""Traffic lights: poles, arms and housings, which stand, and lamps, which change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.mesh import Colour, Label, Mesh
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.solids import box, column, disc, join, turned
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.terrain import Terrain
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.signal_plan import Lamp, Light, SignalPlan

LENS: Final = 0.15
"""Radius of a lens [m]: 30 cm across, as Korea's lights for vehicles have."""

WALK_LENS: Final = 0.11
"""Radius of a lens for pedestrians [m]."""

PITCH: Final = 0.36
"""Distance of the middles of two lenses, as a share of the usual lens of 30 cm [m]."""

DEPTH: Final = 0.22
"""Depth of a housing [m]."""

REACH: Final = 14.0
"""An arm is so long at most [m]; a light farther from a place beside the road has no pole."""

POLE, ARM = 0.09, 0.06
"""Radius of a pole and half the thickness of an arm [m]."""

SAME_POLE: Final = 0.5
"""Lights whose poles would be nearer to each other share one [m]."""

HOUSING: Final[Colour] = (34, 36, 36)
STEEL: Final[Colour] = (150, 152, 154)

_LIT: Final[dict[Lamp, Colour]] = {Lamp.RED: (255, 28, 42), Lamp.YELLOW: (250, 255, 24)}
_GREEN: Final[Colour] = (20, 240, 66)
_DARK: Final[dict[Lamp, Colour]] = {Lamp.RED: (58, 18, 16), Lamp.YELLOW: (58, 46, 14)}
_DARK_GREEN: Final[Colour] = (14, 48, 36)


def _lamps_of(light: Light) -> list[Lamp]:
    """Return the lenses of a light, from the left to the right as its drivers see them."""
    lamps = [lamp for lamp in Lamp if light.lamps & lamp] or [Lamp.YELLOW]
    return sorted(lamps, key=_ORDER.index) if len(lamps) > 1 else lamps * (2 if light.is_warning else 1)


_ORDER: Final = [
    *(Lamp.RED, Lamp.YELLOW, Lamp.U_TURN, Lamp.LEFT, Lamp.UP_LEFT, Lamp.DOWN_LEFT, Lamp.GREEN),
    *(Lamp.RIGHT, Lamp.UP_RIGHT, Lamp.DOWN_RIGHT),
]


def add_lights(builder: MeshBuilder, lights: Sequence[Light], cover: RoadCover, terrain: Terrain) -> None:
    """Add housings, arms and poles of lights; the lamps are in `SignalLamps`.

    Args:
        cover: poles stand beside the roads.
        terrain: the ground on which poles stand.
    """
    if not lights:
        return
    place = np.array([(light.x, light.y, light.z) for light in lights])
    facing, left = _axes(np.array([light.yaw for light in lights]))
    for light, at, ahead in zip(lights, place, facing, strict=True):
        num = len(_lamps_of(light))
        size = WALK_LENS / LENS if light.is_pedestrian else 1.0
        half = 0.5 * (PITCH * num + 0.06) * size
        low, high = (-DEPTH, -half, -0.21 * size), (0.0, half, 0.21 * size)
        if light.is_pedestrian:
            low, high = (-DEPTH, -0.21 * size, -half), (0.0, 0.21 * size, half)
        builder.add_solid(box(low, high), at, HOUSING, Label.TRAFFIC_LIGHT, way=ahead[:2])
    _add_poles(builder, place, facing, left, cover=cover, terrain=terrain)


def _axes(yaw: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors ahead and to the left, (n, 3) each."""
    zero = np.zeros(len(yaw))
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.column_stack([cos, sin, zero]), np.column_stack([-sin, cos, zero])


def _add_poles(
    builder: MeshBuilder, place: FloatArray, facing: FloatArray, left: FloatArray, *, cover: RoadCover, terrain: Terrain
) -> None:
    """Add a pole for each light at the nearest place to its side that is beside the road, and an arm to it."""
    behind = place - 0.5 * DEPTH * facing
    steps = np.array([0.0, *(sign * step for step in np.arange(0.5, REACH, 0.5) for sign in (1.0, -1.0))])
    spots = behind[:, None, :2] + steps[None, :, None] * left[:, None, :2]
    flat = spots.reshape(-1, 2)
    on_ground = np.column_stack([flat, terrain.height(flat)])
    is_free = ~cover.is_on(on_ground, margin=0.75).reshape(len(place), -1)
    found = is_free.argmax(axis=1)
    poles: list[FloatArray] = []
    for k in np.flatnonzero(is_free.any(axis=1)).tolist():
        foot = spots[k, found[k]]
        same = next((pole for pole in poles if np.hypot(*(pole[:2] - foot)) < SAME_POLE), None)
        if same is None:
            same = np.array([*foot, 0.0])
            poles.append(same)
        same[2] = max(same[2], place[k, 2] + 0.35)
        reach = float(np.hypot(*(behind[k, :2] - same[:2])))
        if reach > POLE:
            way = (behind[k, :2] - same[:2]) / reach
            arm = box((0.0, -ARM, -ARM), (reach, ARM, ARM))
            at = (*same[:2], place[k, 2] + 0.1)
            builder.add_solid(arm, at, STEEL, Label.POLE, way=way)
    for x, y, top in poles:
        floor = float(terrain.height(np.array([[x, y]]))[0])
        builder.add_solid(column(POLE, floor - 0.2, top, 8), (x, y, 0.0), STEEL, Label.POLE)


class SignalLamps:
    """The lenses of all lights of a map, and the visors above them.

    Args:
        origin: (3,) of the meshes, map frame [m].
    """

    def __init__(self, plan: SignalPlan, origin: FloatArray) -> None:
        rows, lamps, discs = [], [], []
        for row, light in enumerate(plan.lights):
            lenses = _lamps_of(light)
            (ahead,), (left,) = _axes(np.array([light.yaw]))
            vertices, faces = disc(WALK_LENS if light.is_pedestrian else LENS)
            pitch = PITCH * (WALK_LENS / LENS if light.is_pedestrian else 1.0)
            for k, lamp in enumerate(lenses):
                # As its drivers see it: the first lens on their left is on the light's own right side.
                shift = pitch * (k - 0.5 * (len(lenses) - 1))
                aside, up = (0.0, -shift) if light.is_pedestrian else (shift, 0.0)
                middle = np.array([light.x, light.y, light.z]) + 0.02 * ahead - aside * -left + (0.0, 0.0, up)
                discs.append((middle + turned(vertices, ahead[:2]), faces))
                rows += [row] * len(faces)
                lamps += [lamp] * len(faces)
        self._origin = origin
        places, self._triangles = join((np.zeros((0, 3)), np.zeros((0, 3), np.int32)), *discs)
        self._vertices = (places - origin).astype(np.float32)
        self._row, self._lamp = np.array(rows, dtype=np.int64), np.array(lamps, dtype=np.int64)
        self._bright = np.array([_LIT.get(lamp, _GREEN) for lamp in lamps], dtype=np.uint8).reshape(-1, 3)
        self._dark = np.array([_DARK.get(lamp, _DARK_GREEN) for lamp in lamps], dtype=np.uint8).reshape(-1, 3)

    def show(self, signals: IntArray) -> Mesh:
        """Return the lenses with those lit that show.

        Args:
            signals: (lights,) lit lamps of each light; -1 for none.
        """
        shown = np.maximum(signals, 0)[self._row] if len(self._row) else self._row
        is_lit: NDArray[np.bool_] = (shown & self._lamp) != 0
        num = len(self._triangles)
        return Mesh(
            self._origin,
            self._vertices,
            self._triangles,
            np.where(is_lit[:, None], self._bright, self._dark),
            np.full(num, Label.TRAFFIC_LIGHT, dtype=np.uint8),
            np.zeros(num, dtype=np.int32),
            is_lit.astype(np.uint8),  # `Lit.NOW` or `Lit.NEVER`
        )

"""Scenes for the tests of pictures and rays, and what these need of the machine."""

from __future__ import annotations

import math
from functools import cache
from importlib.util import find_spec

import numpy as np

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.catalogue import CATALOGUE, Model
from rosbridge_sim.scenery.camera_geometry import Pose
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.scene_frame import SceneFrame, take_frame
from rosbridge_sim.scenery.solids import box
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.rendering.camera_renderer import CameraRenderer
from rosbridge_sim.shell.rendering.ray_caster import RayCaster
from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError
from rosbridge_sim.world.state.world import World
from tests.support import miss

EDU = Pose(1.8, 0.0, 2.0, pitch=math.radians(7.0))
"""The camera of MORAI's teaching programs."""


@cache
def open_renderer() -> CameraRenderer:
    """One renderer for all tests of a process: a context of the graphics library takes a tenth of a second."""
    try:
        return CameraRenderer()
    except RenderingUnavailableError as error:
        miss(str(error))


@cache
def open_caster() -> RayCaster:
    try:
        return RayCaster()
    except RenderingUnavailableError as error:
        miss(str(error))


def need_jpeg() -> None:
    if find_spec("simplejpeg") is None:
        miss("needs simplejpeg: pip install '.[sensors]'")


@cache
def built_in(name: str) -> tuple[RoadMap, Mesh]:
    """A built-in map and its static mesh."""
    road_map = DiskLibrary().map(name)
    return road_map, static_mesh(road_map, name, 0)


def model(name: str) -> Model:
    return next(each for each in CATALOGUE if each.name == name)


def put(world: World, name: str, x: float, y: float, *, yaw: float = 0.0, speed: float = 0.0) -> int:
    """Put a model of the catalogue into a world, and return its id."""
    found = model(name)
    return world.spawn(found.kind, found.body, name=found.name, x=x, y=y, yaw=yaw, speed=speed)


def nothing() -> SceneFrame:
    """A frame in which nothing is."""
    return take_frame(World())


def ground_mesh(half: float = 300.0) -> Mesh:
    """A level square at height 0."""
    corners = np.array([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], dtype=np.float32)
    return Mesh.of(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), (97, 97, 99), Label.ASPHALT)


def box_mesh(low: tuple[float, float, float], high: tuple[float, float, float], instance: int = 0) -> Mesh:
    vertices, triangles = box(low, high)
    return Mesh.of(vertices.astype(np.float32), triangles, (200, 40, 40), Label.OBSTACLE, instance=instance)

"""Renderers for the sensors: OpenGL for pictures, Embree for rays. Each is made when it is first needed."""

from __future__ import annotations

from functools import cache, lru_cache

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.shell.rendering.camera_renderer import CameraRenderer
from rosbridge_sim.shell.rendering.jpeg import encode_jpeg
from rosbridge_sim.shell.rendering.ray_caster import RayCaster
from rosbridge_sim.simulator.sensors.drawing import Makers


def make_makers() -> Makers:
    """Return what draws; call it in the thread that will use it."""
    opened: list[CameraRenderer] = []

    @cache
    def pictures() -> CameraRenderer:
        opened.append(CameraRenderer())
        return opened[0]

    @cache
    def rays() -> RayCaster:
        return RayCaster()

    @lru_cache(maxsize=1)  # a mesh of a city has tens of megabytes
    def build(road_map: RoadMap, name: str, seed: int, is_dressed: bool) -> Mesh:  # noqa: FBT001 - see `Makers`
        return static_mesh(road_map, name, seed, is_dressed=is_dressed)

    def close() -> None:
        for renderer in opened:
            renderer.close()

    return Makers(pictures, rays, encode_jpeg, build, close)

"""All of a map that does not move, as one mesh: roads, paint, kerbs, ground, poles, and what stands beside roads."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.maps.extent import find_far_lanes
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.dressing import add_dressing
from rosbridge_sim.scenery.static.loose_paint import LoosePaint
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.road_edges import RoadSite, add_edges
from rosbridge_sim.scenery.static.road_paint import add_paint
from rosbridge_sim.scenery.static.road_signs import add_markings, add_signs
from rosbridge_sim.scenery.static.road_surface import add_asphalt
from rosbridge_sim.scenery.static.terrain import Terrain
from rosbridge_sim.scenery.static.traffic_lights import add_lights
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads


def static_mesh(road_map: RoadMap, name: str, seed: int, *, is_dressed: bool = True) -> Mesh:
    """Return what stands still of a map. It takes up to a second for a small town: call it in a thread.

    Args:
        name: chooses the dressing, with the seed: the name of the map.
        is_dressed: with buildings, trees and posts beside the roads.
    """
    roads = road_map.roads
    builder = MeshBuilder(origin_of(roads))
    if not len(roads):
        return builder.finish()
    cover = RoadCover(roads)
    terrain = Terrain(roads, cover)
    lights = road_map.plan.lights
    has_people = bool(road_map.crosswalks) or any(light.is_pedestrian for light in lights)
    terrain.add_to(builder)
    add_asphalt(builder, roads)
    paint = LoosePaint(road_map, cover)
    paint.add_asphalt(builder)
    site = RoadSite(builder, roads, cover, paint, terrain)
    add_edges(site, has_pavement=has_people)
    add_paint(builder, road_map, cover)
    add_markings(builder, road_map.markings)
    add_lights(builder, lights, cover, terrain)
    add_signs(builder, road_map.signs, cover, terrain)
    if is_dressed:
        add_dressing(site, name=name, seed=seed, is_town=has_people)
    return builder.finish()


def origin_of(roads: Roads) -> FloatArray:
    """Return the origin of the meshes of a map, (3,): near its middle, a multiple of 100 m, at height 0.

    Numbers of 32 bits are then exact to a millimetre within 8 km.
    """
    if not len(roads):
        return np.zeros(3)
    points = roads.points[~find_far_lanes(roads)[roads.lane_of_point], :2]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return np.array([*(100.0 * np.round(middle / 100.0)), 0.0])

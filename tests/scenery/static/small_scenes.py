"""Small maps made by hand, and figures of what is drawn of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from rosbridge_sim.maps.mgeo import NO_PROJECTION
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenery.mesh import Label, Mesh
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from tests.scenery.solid_figures import area_seen_from_above

__all__ = ["area", "corners", "drawn", "map_of", "thing"]


def map_of(roads: Roads, **more: Any) -> RoadMap:  # noqa: ANN401 - fields of a map
    return RoadMap("small", NO_PROJECTION, (0.0, 0.0, 0.0), roads, **more)


def drawn(roads: Roads, **more: Any) -> Mesh:  # noqa: ANN401 - fields of a map
    """What stands still of a map, without buildings, trees and posts."""
    return static_mesh(map_of(roads, **more), "small", 0, is_dressed=False)


def corners(mesh: Mesh, *labels: Label) -> FloatArray:
    """(k, 3, 3) corners of the triangles of some classes, map frame [m]."""
    return np.asarray(mesh.vertices[mesh.triangles[np.isin(mesh.label, labels)]].astype(np.float64) + mesh.origin)


def area(mesh: Mesh, *labels: Label) -> float:
    """Area of some classes as seen from above; faces that look down count as negative [m^2]."""
    return area_seen_from_above(mesh.vertices, mesh.triangles[np.isin(mesh.label, labels)])


def thing(mesh: Mesh, label: Label) -> tuple[list[float], list[float]]:
    """Lowest and highest corner of a class, rounded to millimetres [m]."""
    places = corners(mesh, label).reshape(-1, 3)
    return np.round(places.min(axis=0), 3).tolist(), np.round(places.max(axis=0), 3).tolist()

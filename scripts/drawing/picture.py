"""A picture of what the readers make of our files: to look at, nothing depends on it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rosbridge_sim.morai.mgeo import RoadMap
from rosbridge_sim.morai.scenario import Scenario, Spawn
from rosbridge_sim.world.state import Kind

__all__ = ["picture"]

COLOURS = {Kind.EGO: "#d33", Kind.VEHICLE: "#36c", Kind.PEDESTRIAN: "#080", Kind.OBSTACLE: "#e80"}


def picture(road_map: RoadMap, scenario: Scenario, scale: float = 1.0) -> str:
    """An SVG of the map and everything on it, `scale` times as large as life where things would be too small to see."""
    roads = road_map.roads
    low, high = roads.points.min(axis=0) - 20.0, roads.points.max(axis=0) + 20.0
    box = f"{low[0]:.1f} {-high[1]:.1f} {high[0] - low[0]:.1f} {high[1] - low[1]:.1f}"
    height = 1600.0 * (high[1] - low[1]) / (high[0] - low[0])
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" width="1600" height="{height:.0f}">']
    parts.append(f'<rect x="{low[0]:.1f}" y="{-high[1]:.1f}" width="100%" height="100%" fill="#dfd"/>')
    lines = [roads.points[roads.first[i] : roads.first[i + 1]].tolist() for i in range(len(roads))]
    parts += [_polyline(line, f'stroke="#888" stroke-width="{roads.width[i]}"') for i, line in enumerate(lines)]
    parts += [_polyline(line, 'stroke="#fff" stroke-width="0.3" stroke-dasharray="3 3"') for line in lines]
    for lane in range(len(roads)):  # an arrow in the middle of each lane
        points, yaw = roads.at(lane, roads.length[lane] / 2)
        place = _place(points[0, 0], points[0, 1], yaw[0])
        parts.append(f'<polygon points="-2,-1 -2,1 2,0" fill="#fff" {place}/>')
    parts += _signs(road_map)
    everyone = (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
    drawn: set[int] = set()
    for spawn in everyone:
        if spawn.path is not None and id(spawn.path) not in drawn:
            drawn.add(id(spawn.path))
            line = spawn.path.tolist()
            line += line[:1] if spawn.is_loop else []
            parts.append(_polyline(line, f'stroke="{COLOURS[spawn.kind]}" stroke-width="0.2"'))
    parts += [_agent(spawn, scale) for spawn in everyone]
    return "\n".join([*parts, "</svg>\n"])


def _signs(road_map: RoadMap) -> Iterator[str]:
    """Crosswalks, stop lines, and lights that point to where they look and are tied to the lanes that they serve."""
    roads = road_map.roads
    for crosswalk in road_map.crosswalks:
        for outline in crosswalk.outlines:
            corners = " ".join(f"{x:.2f},{-y:.2f}" for x, y, _ in outline.tolist())
            title = f"<title>{crosswalk.name}</title>"
            yield f'<polygon points="{corners}" fill="#fff" fill-opacity="0.6">{title}</polygon>'
    for lane in roads.is_stop.nonzero()[0].tolist():
        points, yaw = roads.at(lane, roads.length[lane])
        place = _place(points[0, 0], points[0, 1], yaw[0])
        yield f'<rect x="-0.3" y="-1.75" width="0.3" height="3.5" fill="#fff" {place}/>'
    for light in road_map.plan.lights if road_map.plan else ():
        colour = "#0aa" if light.is_pedestrian else "#b80" if light.is_warning else "#c0c"
        for lane in light.lanes:
            x, y, _ = roads.points[roads.first[lane]].tolist()
            yield _polyline([[light.x, light.y], [x, y]], f'stroke="{colour}" stroke-width="0.1" stroke-opacity="0.6"')
        place = _place(light.x, light.y, light.yaw)
        yield f'<polygon points="-0.4,-0.8 -0.4,0.8 1,0" fill="{colour}" {place}><title>{light.name}</title></polygon>'


def _agent(spawn: Spawn, scale: float) -> str:
    body = spawn.model.body
    nose, tail, side = body.length - body.rear_overhang, -body.rear_overhang, body.width / 2
    shape = f"{tail},{-side} {tail},{side} {nose - side},{side} {nose},0 {nose - side},{-side}"
    title = f"<title>{spawn.name} {spawn.speed * 3.6:.0f} km/h</title>"
    place = _place(spawn.x, spawn.y, spawn.yaw, scale)
    return f'<polygon points="{shape}" fill="{COLOURS[spawn.kind]}" {place}>{title}</polygon>'


def _place(x: float, y: float, yaw: float, scale: float = 1.0) -> str:
    return f'transform="translate({x:.3f} {-y:.3f}) rotate({-math.degrees(yaw):.3f}) scale({scale:g})"'


def _polyline(line: list[list[float]], style: str) -> str:
    return f'<polyline points="{" ".join(f"{p[0]:.2f},{-p[1]:.2f}" for p in line)}" fill="none" {style}/>'

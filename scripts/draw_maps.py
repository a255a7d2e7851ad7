#!/usr/bin/env python3
"""Draw the built-in map and scenario: the closed test track `track` and the scene `demo` on it.

    python scripts/draw_maps.py                writes rosbridge_sim/data/{maps,scenarios}/...
    python scripts/draw_maps.py --svg out.svg  also draws a picture of what the readers make of the files

The files are MORAI's formats (MGeo, scenario JSON) with numbers of our own. Tests compare the files with what this
script draws: change the script, not the files.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.morai.catalogue import find_model  # noqa: E402
from rosbridge_sim.morai.mgeo import RoadMap, read_map  # noqa: E402
from rosbridge_sim.morai.scenario import Scenario, Spawn, place_on_roads, read_scenario  # noqa: E402
from rosbridge_sim.world.state import Kind  # noqa: E402

DATA = ROOT / "rosbridge_sim" / "data"
LANE = 3.5  # width of a lane [m]
INNER, OUTER = 0.5 * LANE, -0.5 * LANE  # the two lanes' lines, left of the reference line between them [m]
STEP = 1.0  # between points of a lane [m]; on the tightest bend the chord leaves the arc by 3 mm
PATH_STEP = 2.0  # between waypoints in a bend [m]; by 13 mm


@dataclass(frozen=True)
class Section:
    """A piece of the reference line: a straight or an arc, with the pose at its start."""

    length: float  # of the reference line [m]
    curvature: float  # left positive [1/m]
    max_speed_kmh: int
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def at(self, s: float, offset: float = 0.0) -> tuple[float, float]:
        """The point `s` metres along the reference line and `offset` metres to the left of it."""
        yaw = self.yaw + self.curvature * s
        if self.curvature == 0.0:
            x, y = self.x + s * math.cos(yaw), self.y + s * math.sin(yaw)
        else:
            x = self.x + (math.sin(yaw) - math.sin(self.yaw)) / self.curvature
            y = self.y - (math.cos(yaw) - math.cos(self.yaw)) / self.curvature
        return x - offset * math.sin(yaw), y + offset * math.cos(yaw)

    def points(self, offset: float, step: float) -> list[tuple[float, float]]:
        """Its line at `offset`, in equal steps of at most `step` metres, both ends included."""
        num = max(1, math.ceil(self.length * (1.0 - offset * self.curvature) / step - 1e-9))
        return [self.at(self.length * i / num, offset) for i in range(num + 1)]


def bend(radius: float, degrees: float) -> Section:
    """An arc, left for positive degrees; 40 km/h are 3 m/s^2 to the side on 40 m."""
    turn = math.radians(degrees)
    return Section(radius * abs(turn), math.copysign(1.0 / radius, turn), 40)


def straight(length: float) -> Section:
    """A straight."""
    return Section(length, 0.0, 60)


def track() -> list[Section]:
    """The closed loop, counter-clockwise from (0, 0) to the east, 1.19 km.

    Two lengths follow from the loop being closed: the straights to the west and to the south.
    """
    way = [
        straight(300),  # 0 start
        bend(60, 90),
        straight(90),
        bend(40, 90),
        straight(60),
        bend(45, -60),  # 5 the S
        bend(45, 60),
        straight(0),  # 7 to the west
        bend(50, 90),
        straight(0),  # 9 to the south
        bend(60, 90),
    ]
    x, y = _end(way)
    way[7], way[9] = straight(x), straight(y)
    laid: list[Section] = []
    x, y, yaw = 0.0, 0.0, 0.0
    for section in way:
        here = Section(section.length, section.curvature, section.max_speed_kmh, x, y, yaw)
        (x, y), yaw = here.at(here.length), yaw + here.curvature * here.length
        laid.append(here)
    if math.hypot(x, y) > 1e-9:
        raise AssertionError("the loop is not closed")
    return laid


def _end(way: list[Section]) -> tuple[float, float]:
    x, y, yaw = 0.0, 0.0, 0.0
    for section in way:
        here = Section(section.length, section.curvature, 0, x, y, yaw)
        (x, y), yaw = here.at(here.length), yaw + here.curvature * here.length
    return x, y


def _mm(value: float) -> float:
    return round(value, 3) + 0.0  # no -0.0


def track_files() -> dict[str, bytes]:
    """The map as MGeo files."""
    sections = track()
    info = {
        "maj_ver": 2,
        "min_ver": 9,
        "global_coordinate_system": "+proj=utm +zone=52 +datum=WGS84 +units=m +no_defs",
        "local_origin_in_global": [330000.0, 4120000.0, 0.0],  # somewhere in zone 52, chosen for its round numbers
        "workspace_origin": [0.0, 0.0, 0.0],
        "lane_change_link_included": False,
        "traffic_dir": "RHT",
        "country": "",
        "road_type": "",
        "road_type_def": "",
        "license": "part of rosbridge_sim",
    }
    nodes = []
    links = []
    for lane, offset in enumerate((INNER, OUTER), start=1):
        for i, section in enumerate(sections):
            x, y = section.at(0.0, offset)
            node = {"idx": _node(lane, i), "node_type": None, "junction": [], "point": [_mm(x), _mm(y), 0.0]}
            nodes.append({**node, "on_stop_line": False})
            links.append(_link(lane, i, section, offset, len(sections)))
    return {
        "global_info.json": _json_lines(info),
        "node_set.json": _json_lines(nodes),
        "link_set.json": _json_lines(links),
    }


def _node(lane: int, i: int) -> str:
    return f"N{lane}_{i:02}"


def _link(lane: int, i: int, section: Section, offset: float, num: int) -> dict[str, Any]:
    other = f"L{3 - lane}_{i:02}"
    return {
        "idx": f"L{lane}_{i:02}",
        "from_node_idx": _node(lane, i),
        "to_node_idx": _node(lane, (i + 1) % num),
        "points": [[_mm(x), _mm(y), 0.0] for x, y in section.points(offset, STEP)],
        "max_speed": section.max_speed_kmh,
        "speed_unit": "kph",
        "lazy_init": False,
        "lane_ch_link_path": [],
        "can_move_left_lane": lane == 2,
        "can_move_right_lane": lane == 1,
        "left_lane_change_dst_link_idx": other if lane == 2 else None,
        "right_lane_change_dst_link_idx": other if lane == 1 else None,
        "link_type": "Driving",
        "link_type_def": "",
        "road_id": str(i),
        "ego_lane": lane,
        "related_signal": None,
        "width_start": LANE,
        "width_end": LANE,
        "force_width_start": False,
        "force_width_end": False,
        "enable_side_border": False,
        "geometry": [{"id": 0, "method": "poly3"}],
        "lane_mark_left": [],
        "lane_mark_right": [],
    }


_compact = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False).encode


def _json_lines(value: dict[str, Any] | list[Any]) -> bytes:
    """JSON with one entry a line: small, and a change shows as the lines that it changes."""
    if isinstance(value, list):
        return f"{_rows(value)}\n".encode()
    entries = [f"{_compact(key)}:{_rows(item) if _is_table(item) else _compact(item)}" for key, item in value.items()]
    return ("{\n" + ",\n".join(entries) + "\n}\n").encode()


def _is_table(item: object) -> bool:
    return isinstance(item, list) and bool(item) and isinstance(item[0], dict)


def _rows(items: list[Any]) -> str:
    return "[\n" + ",\n".join(map(_compact, items)) + "\n]"


SPEED_KMH = 30  # of all NPCs: on one path and with one speed they never meet
NPCS = (  # model, metres along the inner lane
    ("2015_Kia_K5", 75.0),
    ("Van", 300.0),
    ("2021_VW_Golf_GTI", 525.0),
    ("Bus", 760.0),
    ("2016_Kia_Niro(HEV)", 1010.0),
)
WALKS = (  # model, km/h, from, to: beside the start straight, outside and inside of the loop
    ("Man", 5.0, (60.0, -6.0), (130.0, -6.0)),
    ("Child", 4.0, (150.0, 6.5), (95.0, 6.5)),
)
THINGS = (  # model, x, y, heading: none on a lane, whose edges lie at -3.5 and 3.5
    ("Traffic_Cone", 90.0, -4.2, 0.0),
    ("Traffic_Cone", 95.0, -4.2, 0.0),
    ("Traffic_Cone", 100.0, -4.2, 0.0),
    ("Barrel", 120.0, -4.6, 0.0),
    ("Barrel", 122.0, -4.6, 0.0),
    ("Wooden_Box", 170.0, -5.0, 20.0),
    ("Cargo_Box", 60.0, 5.0, 90.0),
    ("Box", 62.0, 4.8, 35.0),
)


def demo_scenario() -> bytes:
    """The scene: an ego in the outer lane with a free road, traffic in the inner one, people and things beside."""
    sections = track()
    ids = iter(range(1, 1000))
    vehicles = []
    for model, s in NPCS:
        (x, y), yaw = _along(sections, s, INNER)
        vehicles.append(
            {
                "UNIQUEID": next(ids),
                "modelName": model,
                "initPosition": _init(x, y, yaw),
                "velocityType": 2,
                "constantVelocity": SPEED_KMH,
                "isCloseLoop": True,
                "pathName": "inner lane",
            }
        )
    paths = [{"pathName": "inner lane", "waypointData": list(_waypoints(_inner_lane(sections)))}]
    people = []
    for model, speed, start, goal in WALKS:
        uid = next(ids)
        yaw = math.degrees(math.atan2(goal[1] - start[1], goal[0] - start[0]))
        who = {"UNIQUEID": uid, "modelName": model, **_pose(*start, yaw), "speed": speed, "loop": True}
        people.append(who)
        paths.append({"pathName": f"PedPath - {uid}", "waypointData": list(_waypoints([start, goal]))})
    things = []
    for model, x, y, yaw in THINGS:
        entry = find_model(model)
        if entry is None or not entry.data_ids:
            raise AssertionError(f"{model} has no DataID")
        things.append({"UNIQUEID": next(ids), "DataID": entry.data_ids[0], **_pose(x, y, yaw)})
    document = {
        "mapInfo": {"mapName": "track"},
        "egoVehicle": {
            "UNIQUEID": -1,
            "modelName": "2016_Hyundai_Ioniq",
            "initPosition": _init(40.0, OUTER, 0.0),
            "gear": 4,
        },
        "vehicleList": vehicles,
        "pedestrianList": people,
        "objectList": things,
        "waypointDataList": paths,
    }
    return _json_lines(document)


def _along(sections: list[Section], s: float, offset: float) -> tuple[tuple[float, float], float]:
    """The point `s` metres along a lane, and its heading [deg]."""
    for section in sections:
        scale = 1.0 - offset * section.curvature
        if s <= section.length * scale:
            yaw = section.yaw + section.curvature * s / scale
            return section.at(s / scale, offset), math.degrees(math.remainder(yaw, math.tau))
        s -= section.length * scale
    raise AssertionError("beyond the lane's end")


def _inner_lane(sections: list[Section]) -> list[tuple[float, float]]:
    line: list[tuple[float, float]] = []
    for section in sections:
        step = PATH_STEP if section.curvature else math.inf
        line += section.points(INNER, step)[:-1]
    return line


def _waypoints(line: list[tuple[float, float]]) -> Iterator[dict[str, Any]]:
    """Waypoints in the axes of MORAI's engine: (-east, up, -north)."""
    for x, y in line:
        yield {"pos": {"x": _mm(-x), "y": 0.0, "z": _mm(-y)}}


def _pose(x: float, y: float, yaw: float) -> dict[str, Any]:
    return {
        "pos": {"x": _mm(x), "y": _mm(y), "z": 0.0},
        "rot": {"roll": "0", "pitch": "0", "yaw": f"{_mm(yaw):g}"},
    }


def _init(x: float, y: float, yaw: float) -> dict[str, Any]:
    return {"initPositionMode": "Absolute", **_pose(x, y, yaw)}


# -- the picture

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


def main() -> None:
    """Write the files, and the picture if one is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--svg", type=Path, metavar="FILE", help="also draw a picture of the files")
    parser.add_argument("--scale", type=float, default=1.0, help="draw cars and people larger than life")
    arguments = parser.parse_args()
    files = {DATA / "maps" / "track" / name: text for name, text in track_files().items()}
    files[DATA / "scenarios" / "demo.json"] = demo_scenario()
    for path, text in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text)
        print(f"{path.relative_to(ROOT)}: {len(text):,} bytes")
    if arguments.svg:
        road_map = read_map(track_files(), "track")
        scenario = place_on_roads(read_scenario(demo_scenario(), "demo.json"), road_map.roads)
        arguments.svg.write_text(picture(road_map, scenario, arguments.scale), encoding="utf-8")
        print(arguments.svg)


if __name__ == "__main__":
    main()

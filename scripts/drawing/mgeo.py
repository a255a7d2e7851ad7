"""Writer of MGeo and scenario files: the parts that all our maps share."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

LANE = 3.5  # width of a lane [m]

Point = tuple[float, float] | tuple[float, float, float]
"""East and north, and up where that is not 0 [m]."""


def mm(value: float, digits: int = 3) -> float:
    """Return a coordinate rounded to the millimetre.

    Args:
        value: [m].
        digits: behind the decimal point, if others are wanted.

    Returns:
        [m].
    """
    return round(value, digits) + 0.0  # no -0.0


def _xyz(point: Point, above: float = 0.0, digits: int = 3) -> list[float]:
    """Return a point in a file, so much above the ground [m]."""
    x, y = (mm(value, digits) for value in point[:2])
    return [x, y, above if len(point) == 2 else mm(point[2] + above)]


def info(east: float, north: float) -> dict[str, Any]:
    """Return the `global_info.json` of a map in UTM zone 52.

    Args:
        east: of the map's origin [m].
        north: of the map's origin [m].

    Returns:
        The JSON object.
    """
    return {
        "maj_ver": 2,
        "min_ver": 9,
        "global_coordinate_system": "+proj=utm +zone=52 +datum=WGS84 +units=m +no_defs",
        "local_origin_in_global": [east, north, 0.0],
        "workspace_origin": [0.0, 0.0, 0.0],
        "lane_change_link_included": False,
        "traffic_dir": "RHT",
        "country": "",
        "road_type": "",
        "road_type_def": "",
        "license": "part of rosbridge_sim",
    }


# Edges of lanes: our word, MGeo's lane_type, colour, shape, width [m], paint and gap of dashes [m].
_BORDERS = {
    "centre": (501, "yellow", "Solid", 0.15, 0, 0),
    "lane": (503, "white", "Broken", 0.15, 3, 5),
    "edge": (505, "white", "Solid", 0.15, 0, 0),
    "stop": (530, "white", "Solid", 0.6, 0, 0),
}


@dataclass
class MapFiles:
    """The entries of a map's files while it is drawn.

    Attributes:
        east, north: of the map's origin [m].
        digits: of the lanes' points, behind the decimal point. In a wide bend with points 1 m apart, a millimetre that
            is cut off changes the curvature by as much as half of it.
    """

    east: float
    north: float
    digits: int = 3
    nodes: dict[str, dict[str, Any]] = field(default_factory=dict)
    links: list[dict[str, Any]] = field(default_factory=list)
    border_nodes: list[dict[str, Any]] = field(default_factory=list)
    borders: list[dict[str, Any]] = field(default_factory=list)
    lights: list[dict[str, Any]] = field(default_factory=list)
    synced: list[dict[str, Any]] = field(default_factory=list)
    controllers: list[dict[str, Any]] = field(default_factory=list)
    schedules: list[dict[str, Any]] = field(default_factory=list)
    crosswalks: list[dict[str, Any]] = field(default_factory=list)
    stripes: list[dict[str, Any]] = field(default_factory=list)

    def node(self, idx: str, at: Point, *, is_stop: bool = False) -> str:
        """Add a node, where links meet.

        Args:
            idx: its id.
            at: east, north [m].
            is_stop: a stop line is there.

        Returns:
            The id.
        """
        self.nodes[idx] = _node(idx, at, is_stop=is_stop)
        return idx

    def link(self, idx: str, start: str, end: str, points: Iterable[Point], max_speed: int, **more: Any) -> str:  # noqa: ANN401
        """Add a lane.

        Args:
            idx: its id.
            start: id of its first node.
            end: id of its last node.
            points: its line [m].
            max_speed: [km/h].
            more: additional keys, or other values for the default ones.

        Returns:
            The id.
        """
        usual = {
            "idx": idx,
            "from_node_idx": start,
            "to_node_idx": end,
            "points": [_xyz(point, digits=self.digits) for point in points],
            "max_speed": max_speed,
            "speed_unit": "kph",
            "lazy_init": False,
            "lane_ch_link_path": [],
            "can_move_left_lane": more.get("left_lane_change_dst_link_idx") is not None,
            "can_move_right_lane": more.get("right_lane_change_dst_link_idx") is not None,
            "left_lane_change_dst_link_idx": None,
            "right_lane_change_dst_link_idx": None,
            "link_type": "Driving",
            "link_type_def": "",
            "road_id": "",
            "ego_lane": 1,
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
        self.links.append({**usual, **more})
        return idx

    def border(self, idx: str, kind: str, points: Sequence[Point]) -> str:
        """Add an edge of lanes, or a stop line.

        Args:
            idx: its id.
            kind: a key of `_BORDERS`.
            points: its line [m].

        Returns:
            The id.
        """
        lane_type, colour, shape, width, paint, gap = _BORDERS[kind]
        for end, at in (("A", points[0]), ("B", points[-1])):
            self.border_nodes.append(_node(f"{idx}{end}", at))
        self.borders.append(
            {
                "idx": idx,
                "from_node_idx": f"{idx}A",
                "to_node_idx": f"{idx}B",
                "points": list(map(_xyz, points)),
                "lane_type_def": "ngii_model2",
                "lane_type": lane_type,
                "lane_color": colour,
                "lane_shape": [shape],
                "lane_width": width,
                "dash_interval_L1": paint,
                "dash_interval_L2": gap,
                "pass_restr": "",
                "geometry": [{"id": 0, "method": "poly3"}],
            }
        )
        return idx

    def light(self, idx: str, links: Sequence[str], at: Point, heading: float, lamps: Sequence[str] | None) -> str:
        """Add a traffic light.

        Args:
            idx: its id.
            links: ids of the links that it is for.
            at: east, north; the lamps hang above [m].
            heading: direction that it faces [deg].
            lamps: `sub_type`; None for a pedestrian light.

        Returns:
            The id.
        """
        self.lights.append(
            {
                "idx": idx,
                "link_id_list": list(links),
                "road_id": "",
                "type": "car" if lamps else "pedestrian",
                "sub_type": list(lamps) if lamps else None,
                "dynamic": True,
                "orientation": "horizontal",
                "point": _xyz(at, 5.0 if lamps else 2.5),
                "heading": mm(math.remainder(heading, 360.0)),
                "ref_crosswalk_id": "",
            }
        )
        return idx

    def group(self, controller: str, lights: Sequence[str]) -> None:
        """Add a group of lights that change together.

        Args:
            controller: id of its intersection controller.
            lights: ids of the lights.
        """
        mine = [light for light in self.lights if light["idx"] in lights]
        self.synced.append(
            {
                "idx": f"SSN{len(self.synced):06}",
                "link_id_list": [link for light in mine for link in light["link_id_list"]],
                "point": mine[0]["point"],
                "intersection_controller_id": controller,
                "signal_id_list": list(lights),
            }
        )

    def crosswalk(self, idx: str, corners: Sequence[Point], lights: Sequence[str]) -> None:
        """Add a crosswalk of one part.

        Args:
            idx: its id.
            corners: its outline [m].
            lights: ids of its lights.
        """
        for light in self.lights:
            if light["idx"] in lights:
                light["ref_crosswalk_id"] = idx
        entry = {"idx": idx, "single_crosswalk_list": [f"S{idx}"], "ref_traffic_light_list": list(lights)}
        self.crosswalks.append(entry)
        points = list(map(_xyz, corners))
        self.stripes.append({"idx": f"S{idx}", "points": points, "sign_type": "5", "ref_crosswalk_id": idx})

    def files(self) -> dict[str, bytes]:
        """Return all files that have entries.

        Returns:
            File name -> content.
        """
        sets: dict[str, Any] = {
            "node_set.json": list(self.nodes.values()),
            "link_set.json": self.links,
            "lane_node_set.json": self.border_nodes,
            "lane_boundary_set.json": self.borders,
            "traffic_light_set.json": self.lights,
            "synced_traffic_light_set.json": self.synced,
            "intersection_controller_set.json": self.controllers,
            "intersection_controller_state.json": self.schedules,
            "crosswalk_set.json": self.crosswalks,
            "singlecrosswalk_set.json": self.stripes,
        }
        full = {"global_info.json": info(self.east, self.north)} | {key: value for key, value in sets.items() if value}
        return {name: json_lines(value) for name, value in full.items()}


def _node(idx: str, at: Point, *, is_stop: bool = False) -> dict[str, Any]:
    return {"idx": idx, "node_type": None, "junction": [], "point": _xyz(at), "on_stop_line": is_stop}


_compact = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False).encode


def json_lines(value: dict[str, Any] | list[Any]) -> bytes:
    """Return JSON with one entry a line, so that a change of an entry is a change of one line.

    Args:
        value: the document.

    Returns:
        UTF-8 text.
    """
    if isinstance(value, list):
        return f"{_rows(value)}\n".encode()
    entries = [f"{_compact(key)}:{_rows(item) if _is_table(item) else _compact(item)}" for key, item in value.items()]
    return ("{\n" + ",\n".join(entries) + "\n}\n").encode()


def _is_table(item: object) -> bool:
    return isinstance(item, list) and bool(item) and isinstance(item[0], dict)


def _rows(items: list[Any]) -> str:
    return "[\n" + ",\n".join(map(_compact, items)) + "\n]"


# Scenarios


def pose(x: float, y: float, yaw: float, z: float = 0.0) -> dict[str, Any]:
    """Return a position and a heading of a scenario.

    Args:
        x: east [m].
        y: north [m].
        yaw: [deg].
        z: up [m].

    Returns:
        The keys `pos` and `rot`.
    """
    return {
        "pos": {"x": mm(x), "y": mm(y), "z": mm(z)},
        "rot": {"roll": "0", "pitch": "0", "yaw": f"{mm(yaw):g}"},
    }


def init(x: float, y: float, yaw: float, z: float = 0.0) -> dict[str, Any]:
    """Return a pose as the start of a vehicle.

    Args:
        x: east [m].
        y: north [m].
        yaw: [deg].
        z: up [m].

    Returns:
        The value of `initPosition`.
    """
    return {"initPositionMode": "Absolute", **pose(x, y, yaw, z)}


def engine_waypoints(line: Iterable[Point]) -> Iterator[dict[str, Any]]:
    """Yield waypoints in the axes of MORAI's engine: (-east, up, -north).

    Args:
        line: points of the path [m].

    Yields:
        Each waypoint.
    """
    for point in line:
        x, y, z = _xyz(point)
        yield {"pos": {"x": mm(-x), "y": z, "z": mm(-y)}}

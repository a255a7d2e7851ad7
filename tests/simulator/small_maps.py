"""Maps written by hand in MGeo's own words, in the variants that real folders come in. All numbers are ours."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from rosbridge_sim.maps.map_formats import read_map
from rosbridge_sim.maps.road_map import RoadMap

__all__ = ["KOREAN", "ROADRUNNER", "Files", "read", "tiny"]

Files = dict[str, Any]

INFO: dict[str, Any] = {
    "saved_utc_time": "2024-01-01 00:00:00",
    "mgeo_file_hash": "{'node_set': 'abc'}",
    "maj_ver": 2,
    "min_ver": 9,
    "global_coordinate_system": "+proj=utm +zone=52 +ellps=WGS84",
    "local_origin_in_global": [300000.0, 4000000.0, 0.0],
    "workspace_origin": [0.0, 0.0, 0.0],
    "lane_change_link_included": True,
    "license": "none",
}


def node(idx: str, x: float, y: float, *, on_stop_line: bool = False) -> dict[str, Any]:
    return {"idx": idx, "node_type": None, "junction": [], "point": [x, y, 0.0], "on_stop_line": on_stop_line}


def link(idx: str, start: str, end: str, *points: tuple[float, float], **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """A link with all that MORAI writes; `more` says what is different."""
    usual = {
        "idx": idx,
        "from_node_idx": start,
        "to_node_idx": end,
        "points": [[x, y, 0.0] for x, y in points],
        "max_speed": 50,
        "speed_unit": "kph",
        "lazy_init": False,
        "lane_ch_link_path": [],
        "can_move_left_lane": False,
        "can_move_right_lane": False,
        "left_lane_change_dst_link_idx": None,
        "right_lane_change_dst_link_idx": None,
        "link_type": "6",
        "link_type_def": "ngii_model2",
        "road_type": None,
        "road_id": "1",
        "ego_lane": 1,
        "related_signal": None,
        "width_start": 3.5,
        "width_end": 3.5,
        "force_width_start": False,
        "force_width_end": False,
        "enable_side_border": False,
        "geometry": [{"id": 0, "method": "poly3"}],
        "lane_mark_left": [],
        "lane_mark_right": [],
        "opp_traffic": False,
    }
    return {**usual, **more}


def light(idx: str, links: list[str], **more: object) -> dict[str, Any]:
    usual = {
        "idx": idx,
        "link_id_list": links,
        "road_id": "1",
        "type": "car",
        "sub_type": ["red", "yellow", "straight"],
        "dynamic": True,
        "orientation": "horizontal",
        "point": [120.0, 3.0, 5.0],
        "country": "KR",
        "z_offset": 0,
        "height": 0.3,
        "width": 1.2,
        "type_def": "",
        "ref_crosswalk_id": "",
        "heading": 180.0,
    }
    return {**usual, **more}


# Two lanes to the east over a stop line at x = 100, then straight on from both, to the left from the inner (2).

_NODES = [
    *(node("A1", 0, 0), node("A2", 0, 3.5)),
    *(node("B1", 100, 0, on_stop_line=True), node("B2", 100, 3.5, on_stop_line=True)),
    *(node("C1", 120, 0), node("C2", 120, 3.5), node("D", 113.5, 17)),
]
_INSIDE: dict[str, Any] = {"link_type": "1", "max_speed": 30}
_LINKS = [
    link(
        *("A1B1", "A1", "B1", (0, 0), (50, 0), (100, 0)),
        can_move_left_lane=True,
        left_lane_change_dst_link_idx="A2B2",
        lane_mark_left=["middle"],
        lane_mark_right=["edge"],
    ),
    link(
        *("A2B2", "A2", "B2", (0, 3.5), (50, 3.5), (100, 3.5)),
        can_move_right_lane=True,
        right_lane_change_dst_link_idx="A1B1",
        lane_mark_right=["middle"],
    ),
    link("B1C1", "B1", "C1", (100, 0), (120, 0), related_signal="straight", **_INSIDE),
    link("B2C2", "B2", "C2", (100, 3.5), (120, 3.5), related_signal="straight", **_INSIDE),
    link("B2D", "B2", "D", (100, 3.5), (109.5, 7.5), (113.5, 17), related_signal="left", **_INSIDE),
    link(
        *("A1B1-A2B2", "A1", "B2", (0, 0), (100, 3.5)),
        lazy_init=True,
        max_speed=0,
        link_type=None,
        lane_ch_link_path=["A1B1", "A2B2"],
    ),
]
_BORDERS: list[dict[str, Any]] = [
    {"idx": "middle", "from_node_idx": "M0", "to_node_idx": "M1", "points": [[0, 1.6, 0], [100, 1.6, 0]]},
    {"idx": "edge", "from_node_idx": "E0", "to_node_idx": "E1", "points": [[0, -1.5, 0], [60, -2.5, 0]]},
    {"idx": "stop", "from_node_idx": "S0", "to_node_idx": "S1", "points": [[100, -2, 0], [100, 5, 0]]},
    {"idx": "nothing", "from_node_idx": "S0", "to_node_idx": "S0", "points": [[100, -2, 0]]},
]
for _border in _BORDERS:
    _border.update({"lane_type_def": "", "lane_type": 503, "lane_shape": ["Broken"], "lane_width": 0.15})

_LIGHTS = [
    light("C1", ["B1C1", "B2C2"]),
    light("C2", ["B1C1", "B2C2"], sub_type=["yellow", "yellow", "yellow"]),
    light("L1", ["B2D"], sub_type=["red", "yellow", "left"]),
    light("P1", [], type="pedestrian", sub_type=None, heading=90.0, ref_crosswalk_id="CW1"),
]
_SYNCED: list[dict[str, Any]] = [
    {"idx": "SSN000000", "link_id_list": ["B1C1", "B2C2"], "signal_id_list": ["C1", "C2"]},
    {"idx": "SSN000001", "link_id_list": ["B2D"], "signal_id_list": ["L1"]},
    {"idx": "SSN000002", "link_id_list": [], "signal_id_list": ["P1"]},
]
for _group in _SYNCED:
    _group.update({"point": [110.0, 0.0, 5.0], "intersection_controller_id": "IntTL13"})

_SCHEDULE = [
    {
        "idx": "IntTL13",
        "TLState": [
            {"duration": 10, "lightcolor": ["SG", "R", "R"]},
            {"duration": 5.5, "lightcolor": ["R", "GLeft", "R"]},
        ],
        "yelloduration": [3, 2, 3],
        "PSState": [[1, 2, 1, 3, 1.5]],
    }
]
_STRIPES = [
    {
        "idx": "SCW1",
        "points": [[102, -4, 0], [106, -4, 0], [106, 6, 0], [102, 6, 0]],
        "sign_type": "5",
        "ref_crosswalk_id": "CW1",
    },
    {"idx": "SCW2", "points": [[202, -4, 0], [206, -4, 0], [206, 6, 0]], "sign_type": "5", "ref_crosswalk_id": ""},
]

ROADRUNNER: Files = {
    "global_info.json": INFO,
    "node_set.json": _NODES,
    "link_set.json": _LINKS,
    "lane_node_set.json": [],
    "lane_boundary_set.json": _BORDERS,
    "traffic_light_set.json": _LIGHTS,
    "synced_traffic_light_set.json": _SYNCED,
    "intersection_controller_set.json": [{"idx": "IntTL13", "TL": [["C1", "C2"], ["L1"], ["P1"]]}],
    "intersection_controller_state.json": _SCHEDULE,
    "road_polygon_set.json": [],
    "crosswalk_set.json": [{"idx": "CW1", "single_crosswalk_list": ["SCW1"], "ref_traffic_light_list": ["P1", "?"]}],
    "singlecrosswalk_set.json": _STRIPES,
}
"""The new names, every set filled."""

KOREAN: Files = {
    "global_info.json": {**INFO, "global_coordinate_system": "UTM52N"},
    "node_set.json": _NODES,
    "link_set.json": _LINKS,
    "lane_node_set.json": [],
    "lane_marking_set.json": _BORDERS,
    "traffic_light_set.json": _LIGHTS,
    "synced_traffic_light_set.json": _SCHEDULE,
    "intersection_controller_set.json": [],
    "intersection_controller_data.json": _SCHEDULE,
}
"""The old names; the file of the groups holds the schedule once more, so nobody runs the lights."""


@cache
def tiny() -> RoadMap:
    """That of `ROADRUNNER`. A map never changes, and neither does what is computed of its roads."""
    return read(ROADRUNNER)


def read(files: Files) -> RoadMap:
    return read_map({name: json.dumps(value).encode() for name, value in files.items()}, "maps/tiny")

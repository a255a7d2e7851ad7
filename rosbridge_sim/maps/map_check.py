"""Contents of a map and its gaps, for its author: `rosbridge-sim map info`.

The figures come from the files and from the map that was read from them. A *gap* is something that a map refers to and
lacks, or that its traffic will miss; such a map can still be read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from rosbridge_sim.documents.document_model import read_text
from rosbridge_sim.documents.document_reading import parse_json
from rosbridge_sim.maps.extent import find_far_lanes
from rosbridge_sim.maps.mgeo import KINDS, MAP_FILES, sort_map_files
from rosbridge_sim.maps.mgeo_lights import LIGHT_FILES, light_type
from rosbridge_sim.maps.mgeo_links import MAX_MAP_BYTES
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.world import DT

UNREAD_FILES: Final = (
    "lane_node_set.json",
    "road_polygon_set.json",
    "parking_space_set.json",
    "sim_build_data_traffic_light.csv",
)
"""Files of MORAI maps that nothing here needs."""

MAX_EXAMPLES: Final = 5
"""Largest number of examples for one kind of gap."""

MAX_STEP: Final = 0.5
"""Largest distance between the end of a lane and the start of the next one [m]: the point distance of MORAI's maps."""

Entry = dict[str, Any]
"""An entry of a file: a JSON object, checked as far as it is read."""


def _parse(files: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the entries of a map's files, by kind."""
    found = sort_map_files({name: (text, name) for name, text in files.items()})
    return {
        kind: parse_json(*found[kind], MAX_MAP_BYTES) if kind in found else [] for kind in KINDS if kind != "stripes"
    }


def _name(entry: Entry, key: str = "idx") -> str:
    """Return an id as the reader takes it: a number is accepted, and a missing one is empty."""
    value = entry.get(key)
    return "" if value is None else str(read_text(value))


def _names(entry: Entry, key: str) -> list[str]:
    return [str(read_text(value)) for value in entry.get(key) or ()]


def list_files(files: Mapping[str, bytes], names: Iterable[str]) -> list[Entry]:
    """List the files of a map's folder, and the files that it could have.

    Args:
        files: contents of those of `MAP_FILES` that exist.

    Returns:
        For each file its name, whether it exists, is read and is known, and the kind of its entries.
    """
    found = sort_map_files({name: (text, name) for name, text in files.items()})
    held = {name: kind for kind, (_, name) in found.items()}
    there = set(names)
    listed = []
    for name in (*MAP_FILES, *UNREAD_FILES, *sorted(there - {*MAP_FILES, *UNREAD_FILES})):
        is_there, is_read = name in there, name in held
        holds = {"synced": "groups"}.get(held[name], held[name]) if is_read and name in LIGHT_FILES else None
        is_known = name in MAP_FILES or name in UNREAD_FILES
        listed.append({"name": name, "is_there": is_there, "is_read": is_read, "holds": holds, "is_known": is_known})
    return listed


def describe_map(files: Mapping[str, bytes], road_map: RoadMap) -> Entry:
    """Return the figures of a map as a JSON object; lengths in km, speeds in km/h, positions in metres.

    The kind of the projection is null if the map tells none.

    Args:
        files: contents of those of `MAP_FILES` that exist; the map was read from them. Empty for a map that is one
            file.

    Returns:
        The object; `gaps` lists what the map lacks.
    """
    sets = _parse(files)
    roads, plan, projection = road_map.roads, road_map.plan, road_map.projection
    low, high = (roads.points.min(axis=0), roads.points.max(axis=0)) if len(roads) else (np.zeros(3), np.zeros(3))
    changes = [link for link in sets["links"] if link.get("lazy_init")]
    kinds_of_edges = [_text(edge.get("lane_type")) for edge in sets["borders"]] or [
        str(e.type) for e in road_map.borders
    ]
    kinds = {_name(link): _text(link.get("link_type")) for link in sets["links"]}
    return {
        "name": road_map.name,
        "version": _version(sets["info"] or {}),
        "projection": {"text": projection.text, "kind": _projection_kind(projection), "ellipse": projection.ellipse},
        "origin": list(road_map.origin),
        "extent": {axis: [float(low[i]), float(high[i])] for i, axis in enumerate("xyz")},
        "nodes": {
            "num": len(sets["nodes"]),
            "on_stop_line": sum(bool(node.get("on_stop_line")) for node in sets["nodes"]),
        },
        "lanes": {
            "num": len(roads),
            "num_links_for_changes": len(changes),
            "length_km": float(roads.length.sum()) / 1000.0,
            "by_speed_limit": _lengths(
                roads.length, [f"{limit * MPS_TO_KMH:g}" for limit in roads.speed_limit.tolist()]
            ),
            "by_link_type": _lengths(roads.length, [kinds.get(name, "none") for name in roads.ids]),
            "by_width": _lengths(roads.length, [f"{width:g}" for width in roads.width.tolist()]),
            "num_with_neighbours": int(((roads.left >= 0) | (roads.right >= 0)).sum()),
            "num_to_stop_lines": int(roads.is_stop.sum()),
        },
        "borders": {"num": len(kinds_of_edges), "by_type": _count(kinds_of_edges)},
        "lights": _lights(sets, plan),
        "controllers": list(_controllers(plan)),
        "crosswalks": {
            "num": len(road_map.crosswalks),
            "num_parts": sum(len(crosswalk.outlines) for crosswalk in road_map.crosswalks),
            "num_with_lights": sum(bool(crosswalk.lights) for crosswalk in road_map.crosswalks),
        },
        "notes": list(road_map.notes),
        "gaps": list(_gaps(sets, road_map)),
    }


def _projection_kind(projection: Projection) -> str | None:
    if not projection.is_known:
        return None
    return "transverse Mercator" if projection.is_tm else f"UTM {projection.zone}{'NS'[projection.is_south]}"


def _version(info: Entry) -> str | None:
    version = [info.get("maj_ver"), info.get("min_ver")]
    return None if version[0] is None else ".".join(_text(part) for part in version if part is not None)


def _text(value: object) -> str:
    return "none" if value is None or value == "" else str(value)


def _count(values: Iterable[str]) -> dict[str, int]:
    return dict(Counter(values).most_common())


def _lengths(length: Any, keys: Sequence[str]) -> dict[str, Entry]:  # noqa: ANN401 - an array (l,)
    """Return the number and length of the lanes for each key, the longest first."""
    out: dict[str, Entry] = {}
    for key, metres in zip(keys, length.tolist(), strict=True):
        entry = out.setdefault(key, {"num": 0, "length_km": 0.0})
        entry["num"] += 1
        entry["length_km"] += metres / 1000.0
    return dict(sorted(out.items(), key=lambda item: -item[1]["length_km"]))


def _lights(sets: dict[str, Any], plan: SignalPlan) -> Entry:
    def lamps(entry: Entry) -> str:
        sub_type = entry.get("sub_type")
        return ", ".join(map(str, sub_type)) if isinstance(sub_type, list) else _text(sub_type)

    return {
        "num": len(plan.lights),
        "by_type": _count(_text(entry.get("type")) for entry in sets["lights"]),
        "by_sub_type": _count(lamps(entry) for entry in sets["lights"]),
        "by_type_on_the_wire": _count(str(light_type(light)) for light in plan.lights),
        "num_groups": len(sets["synced"]),
    }


def _controllers(plan: SignalPlan) -> Iterator[Entry]:
    """Yield each intersection with its schedule [s]."""
    for i, controller in enumerate(plan.controllers):
        yield {
            "name": controller.name,
            "number": controller.number,
            "groups": [[plan.lights[row].name for row in group] for group in controller.groups],
            "cycle": float(plan.cycle[i]) * DT if controller.phases else None,
            "phases": [
                {"duration": phase.duration * DT, "colours": list(phase.colours)} for phase in controller.phases
            ],
            "yellow": [frames * DT for frames in controller.yellow],
            "num_walks": len(controller.walks),
        }


# Gaps


def _gaps(sets: dict[str, Any], road_map: RoadMap) -> Iterator[Entry]:
    """Yield each kind of gap with its number and the first names."""
    for what, names in (*_gaps_of_lanes(sets, road_map), *_gaps_of_lights(sets, road_map)):
        found = list(dict.fromkeys(names))
        if found:
            yield {"what": what, "num": len(found), "examples": found[:MAX_EXAMPLES]}


def _gaps_of_lanes(sets: dict[str, Any], road_map: RoadMap) -> Iterator[tuple[str, list[str]]]:
    roads = road_map.roads
    led_to = set(roads.successor.tolist())
    driven = set(roads.ids)
    lanes = [link for link in sets["links"] if not link.get("lazy_init") and _name(link) in driven]
    known = {"", *map(_name, sets["links"])}
    edges = set(map(_name, sets["borders"]))
    used = {_name(link, key) for link in sets["links"] for key in ("from_node_idx", "to_node_idx")}

    def where(is_so: Callable[[int], bool]) -> list[str]:
        return [name for lane, name in enumerate(roads.ids) if is_so(lane)]

    bays = {_name(link) for link in lanes if str(link.get("link_type")).casefold() == "parking"}
    far = find_far_lanes(roads)
    ways = [name not in bays for name in roads.ids]  # a bay is joined to no other link
    yield "lanes that lead nowhere", where(lambda lane: ways[lane] and len(roads.successors(lane)) == 0)
    yield "lanes that no lane leads to", where(lambda lane: ways[lane] and lane not in led_to)
    yield "lanes that lie kilometres away from all others", where(lambda lane: bool(far[lane]))
    yield "lanes that end away from where the next one begins", _torn(roads)
    yield "lanes without a speed limit", where(lambda lane: bool(roads.speed_limit[lane] <= 0.0))
    yield "lanes without a width (3.5 m is taken)", [_name(link) for link in lanes if link.get("width_start") is None]
    for side in ("left", "right"):
        key = f"{side}_lane_change_dst_link_idx"
        yield (
            f"lanes with a {side} neighbour that is not there",
            [_name(link) for link in lanes if _name(link, key) not in known],
        )
        yield f"lanes with a {side} edge that is not there", _lacking(lanes, f"lane_mark_{side}", edges)
    yield "links for a change to lanes that are not there", _lacking(sets["links"], "lane_ch_link_path", known)
    yield "nodes without a link", [_name(node) for node in sets["nodes"] if _name(node) not in used]


def _torn(roads: Roads) -> list[str]:
    """Return the lanes whose last point is not the first one of a lane that follows."""
    lane = roads.predecessor
    away = roads.points[roads.first[lane + 1] - 1, :2] - roads.points[roads.first[roads.successor], :2]
    return [roads.ids[row] for row in lane[np.hypot(away[:, 0], away[:, 1]) > MAX_STEP].tolist()]


def _lacking(entries: Sequence[Entry], key: str, known: Collection[str]) -> list[str]:
    """Return the names of entries that refer to something unknown."""
    return [_name(entry) for entry in entries if any(name not in known for name in _names(entry, key))]


def _gives_way(roads: Roads, lane: int) -> bool:
    """Return whether a stop line at the end of a lane tells who goes first: others come over none."""
    conflicts = roads.derived(LaneConflicts)
    _, link = conflicts.rivals.of(roads.successors(lane))
    return not conflicts.gives_way[conflicts.rivals.other[link]].all()


def _gaps_of_lights(sets: dict[str, Any], road_map: RoadMap) -> Iterator[tuple[str, list[str]]]:
    roads, plan = road_map.roads, road_map.plan
    lights, links = set(map(_name, sets["lights"])), set(map(_name, sets["links"]))
    yield "lights with a link that is not there", _lacking(sets["lights"], "link_id_list", links)
    without = [light.name for light in plan.lights if not light.is_pedestrian and not light.lanes]
    yield "lights for vehicles that serve no lane", without
    is_free = (plan.controller[plan.group] < 0) & ~plan.is_warning
    yield "lights that no intersection runs", [plan.lights[row].name for row in np.flatnonzero(is_free).tolist()]
    is_dark = plan.light_of_lane < 0
    ends = np.flatnonzero(roads.is_stop).tolist()
    yield (
        "lanes to a stop line without a light",
        [roads.ids[lane] for lane in ends if is_dark[roads.successors(lane)].all() and not _gives_way(roads, lane)],
    )
    yield "groups with a light that is not there", _lacking(sets["synced"], "signal_id_list", lights)
    flat = [{"idx": _name(one), "TL": [name for group in one["TL"] for name in group]} for one in sets["controllers"]]
    yield "intersection controllers with a light that is not there", _lacking(flat, "TL", lights)
    yield "intersection controllers without a schedule", [one.name for one in plan.controllers if not one.phases]
    run = {one.name for one in plan.controllers}
    yield (
        "schedules without an intersection controller",
        [_name(one) for one in sets["schedules"] if _name(one) not in run],
    )
    yield "crosswalks with a light that is not there", _lacking(sets["crosswalks"], "ref_traffic_light_list", lights)

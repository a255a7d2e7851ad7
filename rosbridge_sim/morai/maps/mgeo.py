"""MGeo maps: the JSON files of a map folder -> projection, lanes, traffic lights and crosswalks.

`global_info.json`, `node_set.json` and `link_set.json` are required. The other files of `MAP_FILES` are optional: a map
without them has no lights, or no crosswalks, or lane edges at half the lane's width. Other files may be passed too;
they are ignored. `links` reads the lanes, and `lights` reads the traffic lights.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field, TypeAdapter

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.documents import Coordinate, Document, find_mistakes, read_document
from rosbridge_sim.morai.maps.lights import (
    CROSSWALK_FILES,
    LIGHT_FILES,
    Crosswalk,
    find_light_mistakes,
    read_crosswalks,
    read_lights,
)
from rosbridge_sim.morai.maps.links import MAX_MAP_BYTES, Border, find_lane_mistakes, read_lanes
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.signal_plan import SignalPlan
from rosbridge_sim.world.surface import Surface

__all__ = [
    "BORDER_FILES",
    "FILES",
    "MAP_FILES",
    "Projection",
    "RoadMap",
    "find_map_mistakes",
    "read_map",
    "read_projection",
]

FILES: Final = ("global_info.json", "node_set.json", "link_set.json")
"""Files that `read_map` requires."""

BORDER_FILES: Final = ("lane_marking_set.json", "lane_boundary_set.json")
"""Edges of lanes, by their old and their new name. If a folder has both, the old one is read."""

MAP_FILES: Final = (*FILES, *BORDER_FILES, *LIGHT_FILES, *CROSSWALK_FILES)
"""All files that `read_map` reads."""

MapText = Annotated[str, Field(max_length=1_000)]
Point = tuple[Coordinate, Coordinate, Coordinate]


class _GlobalInfo(Document):
    global_coordinate_system: MapText
    local_origin_in_global: Point = (0.0, 0.0, 0.0)


_GLOBAL_INFO: Final = TypeAdapter(_GlobalInfo)


@dataclass(frozen=True, slots=True)
class Projection:
    """Position of the map's coordinates on the globe, as in `MapSpec`.

    Attributes:
        is_tm: a transverse Mercator with its own figures (`plane_coordinate_system` 1) instead of a UTM zone (0).
        zone: UTM zone 1..60; 0 for a TM.
        is_south: a UTM zone of the southern hemisphere (MapSpec has no field for it).
        ellipse: e.g. "WGS84".
        central_latitude, central_meridian: [deg]. A UTM zone is also a transverse Mercator and has all these figures.
        scale_factor: on the central meridian.
        false_easting, false_northing: [m].
        text: as the map has it.
    """

    is_tm: bool
    zone: int = 0
    is_south: bool = False
    ellipse: str = "WGS84"
    central_latitude: float = 0.0
    central_meridian: float = 0.0
    scale_factor: float = 1.0
    false_easting: float = 0.0
    false_northing: float = 0.0
    text: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class RoadMap:
    """A map.

    Attributes:
        name: of its folder.
        projection: of its plane coordinates.
        origin: east, north and up of the map's (0, 0, 0) in that projection [m].
        roads: its lanes, in the order of the file.
        plan: its traffic lights; None if it has none.
        crosswalks: its crosswalks.
        borders: painted lines and kerbs.
        notes: remarks about ignored or reinterpreted entries: a line each, for the log.
    """

    name: str
    projection: Projection
    origin: tuple[float, float, float]
    roads: Roads
    plan: SignalPlan | None = None
    crosswalks: tuple[Crosswalk, ...] = ()
    notes: tuple[str, ...] = ()
    borders: tuple[Border, ...] = ()


def read_map(files: Mapping[str, bytes], source: str) -> RoadMap:
    """Read a map.

    Args:
        files: contents by file name; `FILES` are required, the others of `MAP_FILES` are optional.
        source: the map's folder, for errors; its last part is the map's name.

    Returns:
        The map.

    Raises:
        DocumentError: one line: file, place in it, expected value, actual value.
    """
    name, known = _name_files(files, source)
    info_file, node_file, link_file = (known[file] for file in FILES)
    info = read_document(_GLOBAL_INFO, *info_file, MAX_MAP_BYTES)
    projection = read_projection(info.global_coordinate_system, info_file[1])
    lanes = read_lanes(node_file, link_file, _border_file(known))
    if not len(lanes.roads):
        raise DocumentError(f"{link_file[1]}: expected at least one link to drive on, got none")
    if not lanes.roads.is_flat:
        lanes.roads.derived(Surface)  # here and not at the first step: a large city needs a second
    notes: list[str] = []
    plan = read_lights(known, lanes, notes)
    crosswalks = read_crosswalks(known, plan)
    return RoadMap(
        *(name, projection, info.local_origin_in_global, lanes.roads),
        plan=plan if plan.lights else None,
        crosswalks=crosswalks,
        notes=tuple(_short(notes)),
        borders=lanes.borders,
    )


def find_map_mistakes(files: Mapping[str, bytes], source: str) -> list[str]:
    """Return all mistakes in the values of a map; if there are none, the first mistake in their meaning.

    Args:
        files: contents by file name, as for `read_map`.
        source: the map's folder, for errors.

    Returns:
        A line for each mistake.
    """
    try:
        _, known = _name_files(files, source)
        info_file, node_file, link_file = (known[file] for file in FILES)
        found = find_mistakes(_GLOBAL_INFO, *info_file, MAX_MAP_BYTES)
        found += find_lane_mistakes(node_file, link_file, _border_file(known))
        found += find_light_mistakes(known)
        if not found:
            read_map(files, source)
    except DocumentError as error:
        return [str(error)]
    return [mistake.text for mistake in found]


def _name_files(files: Mapping[str, bytes], source: str) -> tuple[str, dict[str, tuple[bytes, str]]]:
    """Return the map's name, and the content and the name in errors of each file that is read.

    Raises:
        DocumentError: a required file is missing.
    """
    name = re.split(r"[\\/]", source.rstrip("\\/"))[-1]
    missing = next((file for file in FILES if file not in files), None)
    if missing is not None:
        raise DocumentError(f"{source}: {missing} is missing")
    return name, {file: (files[file], f"{name}/{file}") for file in MAP_FILES if file in files}


def _border_file(known: Mapping[str, tuple[bytes, str]]) -> tuple[bytes, str] | None:
    return next((known[file] for file in BORDER_FILES if file in known), None)


def _short(notes: list[str]) -> list[str]:
    """Return the first few lines of many, because a map that lacks one thing often lacks it everywhere."""
    if len(notes) <= MAX_MAP_NOTES:
        return notes
    return [*notes[:MAX_MAP_NOTES], f"... and {len(notes) - MAX_MAP_NOTES} more of that kind"]


MAX_MAP_NOTES: Final = 20

_SHORT_UTM = re.compile(r"UTM[ _-]?(?P<zone>\d{1,2})(?P<half>[NS]?)", re.IGNORECASE)


def read_projection(text: str, source: str) -> Projection:
    """Read a `global_coordinate_system`: proj4 text of a UTM zone or a TM, or the old form "UTM52N".

    Args:
        text: the value.
        source: name of its file, for errors.

    Returns:
        The projection.

    Raises:
        DocumentError: another projection, or a value that is not a number.
    """
    where = f"{source}: global_coordinate_system"
    short = _SHORT_UTM.fullmatch(text.strip())
    if short:
        return _utm(_zone(short["zone"], where), "WGS84", text, is_south=short["half"].upper() == "S")
    terms = dict(term.lstrip("+").partition("=")[::2] for term in text.split() if term.startswith("+"))
    # A datum implies its ellipsoid. WGS84, the datum of published maps, has the same name as its ellipsoid.
    ellipse = terms.get("ellps") or terms.get("datum") or "WGS84"
    kind = terms.get("proj", "").casefold()
    if kind == "utm":
        return _utm(_zone(terms.get("zone", ""), where), ellipse, text, is_south="south" in terms)
    if kind == "tmerc":
        return Projection(
            is_tm=True,
            ellipse=ellipse,
            central_latitude=_figure(terms, "lat_0", 0.0, where),
            central_meridian=_figure(terms, "lon_0", 0.0, where),
            scale_factor=_figure(terms, "k" if "k" in terms else "k_0", 1.0, where),
            false_easting=_figure(terms, "x_0", 0.0, where),
            false_northing=_figure(terms, "y_0", 0.0, where),
            text=text,
        )
    raise DocumentError(f"{where}: expected proj4 text with +proj=utm or +proj=tmerc, or UTM52N, got {text[:80]!r}")


def _utm(zone: int, ellipse: str, text: str, *, is_south: bool) -> Projection:
    """Return a UTM zone. Zones are 6 degrees wide, from 180 degrees west on; the other figures are the same for all."""
    return Projection(
        is_tm=False,
        zone=zone,
        is_south=is_south,
        ellipse=ellipse,
        central_meridian=6.0 * zone - 183.0,
        scale_factor=0.9996,
        false_easting=500_000.0,
        false_northing=10_000_000.0 if is_south else 0.0,
        text=text,
    )


def _zone(text: str, where: str) -> int:
    if text.isdecimal() and len(text) <= 2 and 1 <= int(text) <= 60:  # noqa: PLR2004  # zones of 6 degrees
        return int(text)
    raise DocumentError(f"{where}: expected a UTM zone 1..60, got {text[:40]!r}")


def _figure(terms: Mapping[str, str], key: str, default: float, where: str) -> float:
    text = terms.get(key)
    if text is None:
        return default
    if _FIGURE.fullmatch(text):
        return float(text)
    raise DocumentError(f"{where}: expected a number for +{key}, got {text[:40]!r}")


_FIGURE = re.compile(r"[+-]?(\d{1,15}(\.\d*)?|\.\d+)([eE][+-]?\d{1,2})?")
